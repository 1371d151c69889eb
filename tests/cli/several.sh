# Several devices: the same file as on one, a device lost on the way, and the checkpoint of the last one. They are
# PoCL's: 1 and 2 are alike. lose.c, of which build/tests has a library, loses one.
need_device
export POCL_DEVICES="pthread pthread basic"
lose=$(dirname "$CHECK_REPORT")/../liblose.so
[ -e "$lose" ] || fail "there should be $lose"
run env OVOID_DEVICE=cpus "$OVOID" devices
grep -q '^\* 2  cpu   pthread' "$out" || skip "PoCL makes no devices of its own here"
expect_code 0
[ "$(grep -c '^\* [0-9]' "$out")" -eq 3 ] || fail "three devices should have a star"
expect_out "* are used unless --device says otherwise: the first, and by fits in parts all."
run env OVOID_DEVICE=2,1 "$OVOID" devices --json
expect_code 0
[ "$(grep -c '"default":.*true' "$out")" -eq 2 ] || fail "two devices should be the default"

make_chain 800 a.xyzr
fit="fit a.xyzr --ratio 0.05 --part-atoms 64 --no-measure"
run "$OVOID" $fit -o one.ovoid --device 1
expect_code 0
run "$OVOID" $fit -o two.ovoid --device 1,2 --report r.json
expect_code 0
expect_silent
[ "$(grep -c '^device    pthread' "$out")" -eq 2 ] || fail "both devices should be named"
[ "$(grep -c '"device":.*"pthread' r.json)" -eq 3 ] || fail "both devices should be in the report"
cmp -s one.ovoid two.ovoid || fail "two devices should make the model that one makes"
run "$OVOID" $fit -o jobs.ovoid --device 1,2 --jobs 2 -q
expect_code 0
cmp -s one.ovoid jobs.ovoid || fail "two jobs on two devices should make the model that one makes"
run "$OVOID" $fit -o mixed.ovoid --device 1,0
expect_code 0
run "$OVOID" $fit -o again.ovoid --device 1,0
expect_code 0
cmp -s mixed.ovoid again.ovoid || fail "devices that differ should make the same model again"
grep -q '^# device: pthread.*, basic' mixed.ovoid || fail "the model should name both devices"

# What takes one device, or comes to one part, says that it is the first.
run "$OVOID" fit a.xyzr -o whole.ovoid --ratio 0.05 --device 1,2
expect_code 0
expect_err "of 2 devices the first did all the work, for a.xyzr was fitted as a whole"
run "$OVOID" fit a.xyzr -o whole.ovoid --ratio 0.05 --device 1,2 -q
expect_silent
run "$OVOID" measure a.xyzr one.ovoid --device 1,2
expect_code 0
expect_err "of the 2 devices that are named this takes the first, pthread"
[ "$(grep -c '^device ' "$out")" -eq 1 ] || fail "one device should be named"

# One is lost: the other goes on. (Leaks of the preloaded library's kind are none of ours.)
export ASAN_OPTIONS="${ASAN_OPTIONS:-}:verify_asan_link_order=0"
for place in 1 2; do
    run env LD_PRELOAD="$lose" OVOID_TEST_LOSE=$place:2:-5 "$OVOID" $fit -o lost.ovoid --device 1,2
    expect_code 0
    expect_err "warning: device $place, pthread"
    expect_err "failed and is not used any more: "
    expect_err "CL_OUT_OF_RESOURCES (-5)"
    [ "$(grep -c warning "$err")" -eq 1 ] || fail "one warning was expected"
    cmp -s one.ovoid lost.ovoid || fail "the device that is left should make the same model"
done
# One has no memory left in the middle of its work: likewise.
for place in 1 2; do
    run env LD_PRELOAD="$lose" OVOID_TEST_LOSE=$place:300:-4 "$OVOID" $fit -o lost.ovoid --device 1,2
    expect_code 0
    expect_err "warning: device $place, pthread"
    expect_err "failed and is not used any more: "
    expect_err "CL_MEM_OBJECT_ALLOCATION_FAILURE (-4)"
    cmp -s one.ovoid lost.ovoid || fail "the device with memory left should make the same model"
done
# The only one has none: a clear end, and the checkpoint.
run env LD_PRELOAD="$lose" OVOID_TEST_LOSE=1:2000:-4 "$OVOID" $fit -o last.ovoid --device 1 --checkpoint c
[ "$code" -ne 0 ] || fail "a device without memory should end the fit"
expect_err "CL_MEM_OBJECT_ALLOCATION_FAILURE (-4)"
expect_err "the parts that are done are in c: the same command with --resume goes on"
[ ! -e last.ovoid ] || fail "there should be no model"
run "$OVOID" $fit -o last.ovoid --device 1 --checkpoint c --resume
expect_code 0
cmp -s one.ovoid last.ovoid || fail "the checkpoint should come to the same model"
rm last.ovoid
# The only one is lost: an error, and the checkpoint.
run env LD_PRELOAD="$lose" OVOID_TEST_LOSE=1:2000:-5 "$OVOID" $fit -o last.ovoid --device 1 --checkpoint c
expect_code 1
expect_err "CL_OUT_OF_RESOURCES (-5)"
expect_err "the parts that are done are in c: the same command with --resume goes on"
[ ! -e last.ovoid ] || fail "there should be no model"
run "$OVOID" $fit -o last.ovoid --device 1,2 --checkpoint c --resume
expect_code 0
cmp -s one.ovoid last.ovoid || fail "the checkpoint should come to the same model"
expect_files a.xyzr one.ovoid two.ovoid jobs.ovoid mixed.ovoid again.ovoid whole.ovoid lost.ovoid last.ovoid r.json
