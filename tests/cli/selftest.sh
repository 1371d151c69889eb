# The self-test as a user meets it: its table, JSON and exit codes; and the first use of a device.
need_device
mkdir cache
export OVOID_CACHE_DIR="$PWD/cache"
kernels=$here/../../kernels

run "$OVOID" selftest --short
expect_code 0
expect_silent
expect_out "check           verdict"
expect_out "For a bug report:"
expect_out "(short form)"
for line in layout tree lists field moments misfit gather spread merge solver images mesh distances; do
    grep -q "^$line  *passed " "$out" || fail "the check '$line' should have passed"
done
for line in ovoid device platform driver limits kernels costs launch "round trip" "to device"; do
    grep -q "^$line " "$out" || fail "a line about '$line' was expected"
done

run "$OVOID" selftest --short --json
expect_code 0
expect_silent
[ "$(grep -c '"verdict":.*"passed"' "$out")" -eq 13 ] || fail "JSON should have 13 checks that passed"
for key in launch_seconds round_trip_seconds to_device_bytes_per_second from_device_bytes_per_second; do
    grep -q "\"$key\":.*[1-9]" "$out" || fail "JSON should have '$key'"
done

run "$OVOID" selftest --device "no such device"
expect_code 5
expect_no_out
run "$OVOID" selftest --shot
expect_code 2
run "$OVOID" selftest now
expect_code 2
run sh -c "'$OVOID' selftest --short >/dev/full"
expect_code 4

# A kernel that computes wrongly, and one that does not compile.
wrong() {
    mkdir -p wrong
    cp "$kernels"/* wrong
    sed -i "$2" "wrong/$1"
    ! cmp -s "wrong/$1" "$kernels/$1" || fail "the change of $1 does not apply"
}
wrong moments.cl 's/sum\[5\] = fma(ex, y/sum[5] = fma(ex, 1.01f * y/'
run env OVOID_KERNEL_DIR=wrong "$OVOID" selftest --short
expect_code 5
grep -q "^moments  *WRONG " "$out" || fail "moments should be wrong"
grep -q "^moments: moments: sum [0-9]* is .*, not .*: off by" "$out" || fail "the report should say so"
expect_err "this device computes wrongly: "

make_helix 6 a.xyzr
run env OVOID_SELFTEST=auto OVOID_KERNEL_DIR=wrong "$OVOID" fit a.xyzr
expect_code 5
expect_err "computes wrongly and is not used: moments: sum "
[ ! -e a.ovoid ] || fail "no model should be there"
[ -z "$(ls cache)" ] || fail "nothing should be remembered of it"
run env OVOID_SELFTEST=auto OVOID_KERNEL_DIR=wrong "$OVOID" devices # makes no kernel
expect_code 0
run env OVOID_SELFTEST=off OVOID_KERNEL_DIR=wrong "$OVOID" mesh a.xyzr
expect_code 0

wrong spread.cl 's/const uint place =/uint no such =/'
run env OVOID_KERNEL_DIR=wrong "$OVOID" selftest --short
expect_code 1
grep -q "^spread  *failed " "$out" || fail "spread should have failed"
grep -q "^spread: clBuildProgram: " "$out" || fail "the report should say so"

# The first fit leaves a note, and the next believes it.
run env OVOID_SELFTEST=auto "$OVOID" fit a.xyzr
expect_code 0
[ "$(ls cache | grep -c '^selftest-')" -eq 1 ] || fail "that it passed should be remembered"
