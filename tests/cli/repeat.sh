# The same input, options and device give the same bytes.
need_device
make_helix 30 a.xyzr
for name in one two; do
    run "$OVOID" fit a.xyzr --iterations 60 -q -o $name.ovoid --trace $name.csv
    expect_code 0
    cut -d , -f 1-9 $name.csv >$name.cut
done
cmp one.ovoid two.ovoid || fail "two runs should give the same model"
cmp one.cut two.cut || fail "two runs should take the same steps"
[ "$(rows one.ovoid)" -ge 1 ] || fail "the model should hold ellipsoids"
