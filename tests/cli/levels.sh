# Several models from one run, each with half the ellipsoids of the one before.
need_device
few="--spacing 0.7" # points: nothing depends on how good it is
make_helix 24 a.xyzr
run "$OVOID" fit a.xyzr --ellipsoids 11 $few --levels 3 -o x.y/../m.v1.ovoid
expect_code 4
mkdir x.y
run "$OVOID" fit a.xyzr --ellipsoids 11 $few --levels 3 -o x.y/m.v1.ovoid --report r.json --trace t.csv
expect_code 0
expect_silent
(cd x.y && expect_files m.v1.ovoid m.v1.level2.ovoid m.v1.level3.ovoid) || exit 1
[ "$(rows x.y/m.v1.ovoid)" -eq 11 ] || fail "the first level should hold 11 ellipsoids"
[ "$(rows x.y/m.v1.level2.ovoid)" -eq 5 ] || fail "the second level should hold 5 ellipsoids"
[ "$(rows x.y/m.v1.level3.ovoid)" -eq 2 ] || fail "the third level should hold 2 ellipsoids"
grep -q '^# level: 2 of 3$' x.y/m.v1.level2.ovoid || fail "the model should name its level"
number='  *[0-9.e+-]*'
for row in "1 $number$number$number$number$number  x.y/m.v1.ovoid" \
    "2  *5$number$number$number$number  x.y/m.v1.level2.ovoid" \
    "3  *2$number$number$number$number  x.y/m.v1.level3.ovoid"; do
    grep -q "^$row\$" "$out" || fail "a row '$row' was expected"
done
run "$CHECK_REPORT" r.json x.y/m.v1.ovoid t.csv levels=3 goal.name=ellipsoids ellipsoids=11
expect_code 0
[ "$(cut -d , -f 1 t.csv | sort -u | tr '\n' ' ')" = "1 2 3 level " ] ||
    fail "the trace should hold every level"

# What the table says of a level is what measuring its file says.
run "$OVOID" fit a.xyzr --ellipsoids 11 $few --levels 2 -o m
said=$(awk '$1 == 2 && $NF == "m.level2" { print $3, $5 }' "$out")
run "$OVOID" measure a.xyzr m.level2 --format xyzr
measured=$(sed -n 's/^area .*error \([0-9.e+-]*\) %.*/\1/p; s/.*outer surface \([0-9.]*\) Å), mean.*/\1/p' "$out" |
    tr '\n' ' ')
echo "$said $measured" | awk '{ a = $1 / $3; b = $2 / $4
    exit !(NF == 4 && a > 0.98 && a < 1.02 && b > 0.98 && b < 1.02) }' ||
    fail "the table says '$said', measuring '$measured'"
rm -r ./m* x.y r.json t.csv

# One ellipsoid cannot be halved.
run "$OVOID" fit a.xyzr --ellipsoids 3 --levels 6 -o m.ovoid --no-measure --report r.json
expect_code 0
expect_out "2 of 6 levels: one ellipsoid cannot be halved"
expect_files a.xyzr m.ovoid m.level2.ovoid r.json
grep -q '^# level: 2 of 2$' m.level2.ovoid || fail "the model should name its level"
grep -qE '^2  *1  *-  *-  *[0-9.]+  *-  m.level2.ovoid$' "$out" ||
    fail "without measures the distance alone is known"
rm m.* r.json

# Every file's place is asked for before the work.
mkdir m.level3.ovoid
run "$OVOID" fit a.xyzr --ellipsoids 8 --levels 3 -o m.ovoid
expect_code 4
expect_no_out
expect_err "m.level3.ovoid"
expect_files a.xyzr m.level3.ovoid
rmdir m.level3.ovoid

# The goal is the first level's; those after it are written where it was not reached, too.
run "$OVOID" fit a.xyzr --tolerance 0.3 --steps 0 --levels 2 -q
expect_code 7
expect_err "not reached"
expect_files a.xyzr a.ovoid a.level2.ovoid

# All levels come from one preparation: the molecule's field is sampled once.
samplings() {
    tr -d ' \n\t' <"$1" | sed -n 's/.*"name":"field_gradient","launches":\([0-9]*\).*/\1/p'
}
run "$OVOID" fit a.xyzr --ellipsoids 11 $few -o m.ovoid --profile --report one.json
expect_code 0
run "$OVOID" fit a.xyzr --ellipsoids 11 $few --levels 3 -o m.ovoid --profile --report three.json
expect_code 0
[ -n "$(samplings one.json)" ] && [ "$(samplings one.json)" = "$(samplings three.json)" ] ||
    fail "'$(samplings three.json)' samplings for three levels, '$(samplings one.json)' for one"
