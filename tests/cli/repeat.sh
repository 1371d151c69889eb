# The same input, options and device give the same bytes.
need_device
make_helix 30 a.xyzr
for name in one two; do
    run "$OVOID" fit a.xyzr --method l1 --iterations 60 -q -o $name.ovoid --trace $name.csv
    expect_code 0
    cut -d , -f 1-9 $name.csv >$name.cut
done
cmp one.ovoid two.ovoid || fail "two runs should give the same model"
cmp one.cut two.cut || fail "two runs should take the same steps"
for name in three four; do
    run "$OVOID" fit a.xyzr --ratio 0.3 --levels 2 -q -o $name.ovoid --trace $name.csv
    expect_code 0
    cut -d , -f 1-5 $name.csv >$name.cut
done
cmp three.ovoid four.ovoid || fail "two runs should give the same model"
cmp three.level2.ovoid four.level2.ovoid || fail "two runs should give the same second model"
cmp three.cut four.cut || fail "two runs should take the same steps"
[ "$(rows one.ovoid)" -ge 1 ] || fail "the model should hold ellipsoids"
