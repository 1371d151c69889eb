# What method adaptive is asked for, what it reached, and what it says where that is not the same.
need_device
make_chain 20 a.xyzr
reached() {
    text=$1
    shift
    run "$OVOID" fit a.xyzr --report r.json --trace t.csv "$@"
    expect_code 0
    expect_silent
    grep -q "^goal      $text\$" "$out" || fail "a line 'goal  $text' was expected"
}
check() {
    run "$CHECK_REPORT" r.json a.ovoid t.csv "$@"
    expect_code 0
}

# A tolerance; a closer one takes more ellipsoids. check_report compares with what was measured.
reached "outer surfaces within 1 Å: reached, 0\.[0-9]* Å" --tolerance 1
check goal.name=tolerance goal.asked=1 goal.reached=true spacing=0.35
coarse=$(rows a.ovoid)
reached "outer surfaces within 0.05 Å: reached, [0-9.e-]* Å" --tolerance 0.05
check goal.asked=0.05 goal.reached=true
[ "$(rows a.ovoid)" -gt "$coarse" ] || fail "a closer surface should take more ellipsoids"

# A number, up to that of the atoms, and a ratio, which leaves one at least.
reached "5 ellipsoids: reached, outer surfaces within [0-9.]* Å" --ellipsoids 5
check goal.name=ellipsoids goal.asked=5 goal.reached=true ellipsoids=5
reached "20 ellipsoids: reached, outer surfaces within [0-9.e-]* Å" --ellipsoids 20 --steps 3
check goal.asked=20 ellipsoids=20
run "$OVOID" fit a.xyzr --ellipsoids 21
expect_code 2
expect_no_out
expect_err "ovoid: error: --ellipsoids is 21, but a.xyzr has only 20 atoms"
reached "0.3 ellipsoids per atom: reached, outer surfaces within [0-9.]* Å" --ratio 0.3
check goal.name=ratio goal.asked=0.3 ellipsoids=6
reached "0.01 ellipsoids per atom: reached, .*" --ratio 0.01
check goal.asked=0.01 ellipsoids=1
expect_files a.xyzr a.ovoid r.json t.csv

# The last of the same goal counts, as of any option.
reached "4 ellipsoids: .*" --ellipsoids 5 --ellipsoids 4
check ellipsoids=4

# No model, not even one of all atoms, is as close as this: single precision ends before.
rm a.ovoid
run "$OVOID" fit a.xyzr --tolerance 0.3 --steps 0 --report r.json --trace t.csv
expect_code 7
expect_err "ovoid: warning: the goal was not reached: the outer surfaces are "
expect_err " Å apart, not within 0.3 Å"
expect_out "goal      outer surfaces within 0.3 Å: not reached, "
expect_out "model     written to a.ovoid"
check goal.asked=0.3 goal.reached=false
grep -q '^# goal: not reached$' a.ovoid || fail "the model should say so, too"
rm a.ovoid
run "$OVOID" fit a.xyzr --tolerance 0.3 --steps 0 --quiet
expect_code 7
expect_no_out
expect_err "not reached"
expect_files a.xyzr a.ovoid r.json t.csv

# Trouble with a file counts for more than the goal.
if [ -w /dev/full ]; then
    run "$OVOID" fit a.xyzr --tolerance 0.3 --steps 0 --report /dev/full
    expect_code 4
fi

# Where nothing was measured, nothing was reached: without a surface, or with too coarse a mesh.
rm -f ./*
printf '0 0 0 0\n' >zero.xyzr
run "$OVOID" fit zero.xyzr -o a.ovoid --report r.json
expect_code 7
expect_err "ovoid: warning: the goal was not reached: there is no surface to be near to: the molecule's"
expect_out "goal      outer surfaces within 0.5 Å: not reached: there is no surface to be near to"
grep -q '"reached":	false' r.json || fail "the report should say that it was not reached"
grep -q '"reason":	"there is no surface to be near to' r.json || fail "and why"
grep -q '^# goal: not reached$' a.ovoid || fail "and so should the model"
make_chain 20 a.xyzr
for name in a.xyzr zero.xyzr; do
    run "$OVOID" fit $name -o a.ovoid --report r.json --mesh-spacing 100
    expect_code 7
    expect_err "ovoid: warning: the goal was not reached: a mesh spacing of 100 Å is too coarse to tell whether"
    expect_out "not reached: a mesh spacing of 100 Å is too coarse"
    grep -q '"reason":	"a mesh spacing of 100 Å is too coarse' r.json || fail "the report should say why"
done
run "$OVOID" fit zero.xyzr -o a.ovoid --ellipsoids 1 --report r.json
expect_code 0
grep -q '"reached":	true' r.json || fail "one ellipsoid is what was asked"
