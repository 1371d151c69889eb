# Inputs that cannot be used: exit code 3 and a place in the file, no output.
need_device

bad() {
    text=$1
    shift
    run "$OVOID" fit "$@" -o out.ovoid
    expect_code 3
    expect_no_out
    expect_err "ovoid: error: "
    expect_err "$text"
    [ ! -e out.ovoid ] || fail "no model should be there"
}

bad "cannot " nothing.pqr
bad "missing.pqr" missing.pqr
mkdir folder.pqr
bad "folder.pqr" folder.pqr
: >empty.xyzr
bad "empty.xyzr" empty.xyzr
printf '1 2 3 1.5\n1 2 three 1.5\n' >bad.xyzr
bad "bad.xyzr:2:5: " bad.xyzr
printf '1 2 3 -1.5\n' >bad.xyzr
bad "bad.xyzr:1:7: " bad.xyzr
printf '1 2 nan 1.5\n' >bad.xyzr
bad "bad.xyzr:1:5: " bad.xyzr

# The wrong device is found out before the work, too.
make_helix 6 a.xyzr
run "$OVOID" fit a.xyzr --device "no such device"
expect_code 5
expect_err "no such device"
run env OVOID_DEVICE="no such device" "$OVOID" fit a.xyzr
expect_code 5
[ ! -e a.ovoid ] || fail "no model should be there"
