# Report, trace and model of one run agree with each other; see check_report.c.
need_device
make_helix 30 a.xyzr
echo "9 9 9 0" >>a.xyzr
run "$OVOID" fit a.xyzr --iterations 60 --decay 0.45 --isovalue 1.1 --spacing 0.9 --padding 2.5 \
    --prune-every 7 --mesh-spacing 0.6 --report r.json --trace t.csv
expect_code 0
expect_silent
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

# On standard output, for a pipe.
"$OVOID" fit a.xyzr --iterations 3 -q --report - >r.json 2>"$err"
code=$?
expect_code 0
"$OVOID" fit a.xyzr --iterations 3 -q --trace - >t.csv 2>"$err"
run "$CHECK_REPORT" r.json a.ovoid t.csv atoms=31
expect_code 0

# Names that are not UTF-8, or hold quotes or line ends, still give JSON and whole header lines.
name=$(printf 'b"\\\n\377.xyzr')
cp a.xyzr "$name"
run "$OVOID" fit "$name" --iterations 3 -o b.ovoid --report r.json --trace t.csv
expect_code 0
run "$CHECK_REPORT" r.json b.ovoid t.csv atoms=31
expect_code 0
iconv -f UTF-8 -t UTF-8 r.json >/dev/null 2>&1 || fail "the report should be UTF-8"
