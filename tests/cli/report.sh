# Report, trace and model of one run agree with each other; see check_report.c.
need_device
make_helix 30 a.xyzr
echo "9 9 9 0" >>a.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 60 --decay 0.45 --isovalue 1.1 --spacing 0.9 --padding 2.5 \
    --prune-every 7 --mesh-spacing 0.6 --report r.json --trace t.csv
expect_code 0
expect_err "warning: a.xyzr: 1 of 31 atoms has radius 0"
expect_out "molecule  a.xyzr: 31 atoms, 1 of them of radius 0"
expect_out "surface   decay 0.45 Å⁻², isovalue 1.1"
expect_out "spacing 0.9 Å, padding 2.5 Å"
expect_out "mesh      spacing 0.6 Å"
expect_out "report    written to r.json"
expect_out "trace     written to t.csv"
expect_files a.xyzr a.ovoid r.json t.csv
run "$CHECK_REPORT" r.json a.ovoid t.csv atoms=31 zero_radius_atoms=1 atoms_skipped=0 decay=0.45 \
    isovalue=1.1 spacing=0.9 padding=2.5 options.prune_every=7 options.iterations=60 \
    options.sparse_iterations=45 options.max_error=0.5 mesh_spacing=0.6
expect_code 0

# Spheres stay where their atoms are and as wide; their number and amplitudes are what changes.
run "$OVOID" fit a.xyzr --method l1 --iterations 60 --decay 0.45 --kernel sphere -o s.ovoid --report s.json \
    --trace s.csv
expect_code 0
expect_out "iterations of method l1, spheres at the atoms"
grep -q '"kernel":[[:space:]]*"sphere"' s.json || fail "the report should name the kernel"
grep -q '^# settings:.* kernel sphere' s.ovoid || fail "the model should name the kernel"
run "$CHECK_REPORT" s.json s.ovoid s.csv atoms=31 decay=0.45
expect_code 0
awk '/^#|^amplitude/ { next }
    function off(a, b) { return a - b > 1e-6 || b - a > 1e-6 }
    off($2, 0.45) || off($3, 0.45) || off($4, 0.45) || $8 || $9 || $10 { bad = 1 }
    END { exit bad || NR < 20 }' s.ovoid || fail "the model should hold spheres of the atoms' decay"
rm -f s.ovoid s.json s.csv

# On standard output, for a pipe.
"$OVOID" fit a.xyzr --method l1 --iterations 3 -q --report - >r.json 2>"$err"
code=$?
expect_code 0
"$OVOID" fit a.xyzr --method l1 --iterations 3 -q --trace - >t.csv 2>"$err"
run "$CHECK_REPORT" r.json a.ovoid t.csv atoms=31
expect_code 0

# Names that are not UTF-8, or hold quotes or line ends, still give JSON and whole header lines.
name=$(printf 'b"\\\n\377.xyzr')
cp a.xyzr "$name"
run "$OVOID" fit "$name" --method l1 --iterations 3 -o b.ovoid --report r.json --trace t.csv
expect_code 0
run "$CHECK_REPORT" r.json b.ovoid t.csv atoms=31
expect_code 0
iconv -f UTF-8 -t UTF-8 r.json >/dev/null 2>&1 || fail "the report should be UTF-8"

# Method adaptive has other options, a goal, and other columns in its trace.
rm -f ./*
make_chain 30 a.xyzr
run "$OVOID" fit a.xyzr --tolerance 0.8 --effort 2 --steps 50 --decay 0.45 --isovalue 1.1 \
    --mesh-spacing 0.6 --report r.json --trace t.csv
expect_code 0
expect_silent
expect_out "surface   decay 0.45 Å⁻², isovalue 1.1"
expect_out "spacing 0.35 Å"
expect_out "mesh      spacing 0.6 Å"
expect_out "conjugate gradients, method adaptive"
grep -q '^goal      outer surfaces within 0.8 Å: reached, 0\.[0-9]* Å$' "$out" ||
    fail "the summary should say asked and reached"
grep -q '^error' "$out" && fail "errors over the points belong to method l1"
run "$CHECK_REPORT" r.json a.ovoid t.csv method=adaptive atoms=30 decay=0.45 isovalue=1.1 spacing=0.35 \
    mesh_spacing=0.6 options.effort=2 options.steps=50 goal.name=tolerance goal.asked=0.8 \
    goal.reached=true
expect_code 0
grep -q '^# settings: method adaptive, spacing 0.35, .*tolerance 0.8, effort 2, steps 50, mesh-spacing 0.6$' \
    a.ovoid || fail "the model should say how it was made"
grep -q '^# goal: reached$' a.ovoid || fail "the model should say that its goal was reached"
