# Measures of a model against its molecule, alone and at the end of a fit; see check_measures.c.
need_device
make_helix 12 a.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 40 --report fit.json
expect_code 0
expect_silent
for line in "area  *[0-9.]* Å², of the model [0-9.]* Å²: error [0-9.e-]* %" \
    "volume  *[0-9.]* Å³, of the model [0-9.]* Å³: error [0-9.e-]* %" \
    "pieces  *1, of the model 1 (outer ones: 1, 1)" \
    "distance  Hausdorff [0-9.]* Å (outer surface [0-9.]* Å), mean [0-9.]* Å" \
    "mesh  *spacing 0.5 Å, exact vertices"; do
    grep -q "^$line" "$out" || fail "a line '$line' was expected"
    grep "^$line" "$out" >>../of_fit
done

# The same from the files.
run "$OVOID" measure a.xyzr a.ovoid --report m.json
expect_code 0
expect_silent
expect_out "molecule  a.xyzr: 12 atoms"
expect_out "model     a.ovoid: "
expect_out "isovalue  1"
expect_out "report    written to m.json"
expect_files a.xyzr a.ovoid fit.json m.json
# Nine digits in the model's file are not quite the fitted numbers.
cut -c 1-14 ../of_fit >../first
grep -E '^(area|volume|pieces|distance|mesh)' "$out" | cut -c 1-14 >../second
grep -E '^(area|volume|pieces|distance|mesh)' "$out" >../whole
cmp ../first ../second || fail "a fit and a measurement of its model should agree"
run "$CHECK_MEASURES" fit.json m.json isovalue=1 mesh_spacing=0.5 atoms=12
expect_code 0

# Cell by cell it is the same.
run "$OVOID" measure a.xyzr a.ovoid --cell-atoms 3
expect_code 0
grep -E '^(area|volume|pieces|distance|mesh)' "$out" >../third
cmp ../whole ../third || fail "cells should add up to the whole"
grep -q '^area' ../third || fail "measures were expected"

# A row for each isovalue; one without a surface costs its row alone.
run "$OVOID" measure a.xyzr a.ovoid --isovalue 1,0.5,1e6,2 --report rows.json --spacing 0.6 \
    --vertices linear
expect_code 0
expect_err "ovoid: warning: isovalue 1000000: "
expect_out "spacing 0.6 Å, linear vertices"
[ "$(grep -cE '^(1|0.5|2) +[0-9.]+ ' "$out")" -eq 3 ] || fail "three rows were expected"
grep -q '^1e+06  *no surface$' "$out" || fail "a row without a surface was expected"
run "$CHECK_MEASURES" - rows.json rows=4 measured=3
expect_code 0
run "$OVOID" measure a.xyzr a.ovoid --isovalue 1e6,1e5 --quiet
expect_code 3
expect_err "no surface"

# Quiet, on standard output, from standard input.
run "$OVOID" measure a.xyzr a.ovoid -q
expect_code 0
expect_silent
expect_no_out
"$OVOID" measure - a.ovoid --report - <a.xyzr >m.json 2>"$err"
code=$?
expect_code 0
expect_err "molecule  standard input: 12 atoms"
run "$CHECK_MEASURES" fit.json m.json
expect_code 0
"$OVOID" measure a.xyzr - -q --report m.json <a.ovoid >"$out" 2>"$err"
code=$?
expect_code 0
expect_no_out
run "$CHECK_MEASURES" fit.json m.json
expect_code 0

# A fit without measures, with a coarser mesh, and of a model without a surface.
run "$OVOID" fit a.xyzr --method l1 --iterations 5 --no-measure --report none.json
expect_code 0
grep -qE '^(area|volume|distance)' "$out" && fail "no measures were asked for"
grep -qE '"(area|hausdorff)"' none.json && fail "no measures were asked for"
run "$OVOID" fit a.xyzr --method l1 --iterations 5 --mesh-spacing 0.8 --report fit.json
expect_code 0
expect_out "mesh      spacing 0.8 Å, exact vertices"
run "$OVOID" measure a.xyzr a.ovoid --spacing 0.8 --report m.json -q
run "$CHECK_MEASURES" fit.json m.json mesh_spacing=0.8
expect_code 0

refused() {
    wanted=$1
    text=$2
    shift 2
    run "$OVOID" "$@"
    expect_code "$wanted"
    expect_no_out
    expect_err "ovoid: error: "
    expect_err "$text"
}
rm -f ./*.json
refused 2 "which surfaces?" measure
refused 2 "which model?" measure a.xyzr
refused 2 "but 'c' follows 'a.ovoid'" measure a.xyzr a.ovoid c
refused 2 "'a.ovoid' is a model, but the molecule comes first" measure a.ovoid a.xyzr
refused 2 "cannot both come from standard input" measure - -
refused 2 "the model and the report (--report) are the same file" measure a.xyzr a.ovoid --report a.ovoid
refused 2 "--isovalue takes a number, not ''" measure a.xyzr a.ovoid --isovalue 1,
refused 2 "--isovalue takes a number, not 'x'" measure a.xyzr a.ovoid --isovalue 1,x,2
refused 2 "--isovalue is 0, but must be above 0" measure a.xyzr a.ovoid --isovalue 0
refused 2 "--spacing is -1, but must be above 0 Å" measure a.xyzr a.ovoid --spacing -1
refused 2 "--vertices takes exact or linear" measure a.xyzr a.ovoid --vertices round
refused 2 "did you mean '--report'?" measure a.xyzr a.ovoid --reprot x
refused 2 "--mesh-spacing is 0, but must be above 0 Å" fit a.xyzr --mesh-spacing 0
refused 3 "a.xyzr" measure a.xyzr a.xyzr
refused 3 "nothing.pqr" measure nothing.pqr a.ovoid
refused 4 "there is no folder 'no'" measure a.xyzr a.ovoid --report no/m.json
refused 5 "no such device" measure a.xyzr a.ovoid --device "no such device"
expect_files a.xyzr a.ovoid
