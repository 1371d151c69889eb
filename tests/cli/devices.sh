# The list of devices, for people and for programs, and a machine without any.
need_device
run "$OVOID" devices
expect_code 0
head -n 1 "$out" | grep -q '# *type *name *platform *driver *OpenCL *units *memory *width *fp64' ||
    fail "a heading was expected"
[ "$(grep -c '^\* ' "$out")" -eq 2 ] || fail "one device and the remark should have a star"
devices=$(grep -cE '^[* ] +[0-9]+ ' "$out")
[ "$devices" -ge 1 ] || fail "a device was expected"

run "$OVOID" devices --json
expect_code 0
[ "$(grep -c '"index":' "$out")" -eq "$devices" ] || fail "JSON should list as many devices"
[ "$(grep -c '"default":.*true' "$out")" -eq 1 ] || fail "one device should be the default"
for key in type name vendor platform driver opencl compute_units clock_mhz float_width fp64 \
    global_memory max_allocation; do
    [ "$(grep -c "\"$key\":" "$out")" -eq "$devices" ] || fail "every device should have '$key'"
done

# A selector that matches nothing costs the star and no more.
run env OVOID_DEVICE="no such device" "$OVOID" devices
expect_code 0
expect_err "ovoid: warning: "
[ "$(grep -c '^\* ' "$out")" -eq 0 ] || fail "no device should have a star"

# Without any driver.
mkdir none
without_drivers="run env OCL_ICD_VENDORS=$PWD/none/ OPENCL_VENDOR_PATH=$PWD/none OCL_ICD_FILENAMES="
$without_drivers "$OVOID" devices
[ ! -s "$out" ] || skip "this OpenCL loader cannot be told to find nothing"
expect_code 5
expect_err "no OpenCL device was found"
expect_err "pocl-opencl-icd"
make_helix 6 a.xyzr
$without_drivers "$OVOID" fit a.xyzr
expect_code 5
[ ! -e a.ovoid ] || fail "no model should be there"
