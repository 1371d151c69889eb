/*
 * The short form of the self-test on the device of each lane: all kernels, in every shape.
 */
#include "ovoid/selftest.h"
#include "support.h"

static void keep(const ovoid_check *check, void *user) {
    size_t *const count = user;
    print_message("%s: %llu numbers, %.2f of what is allowed\n", check->name,
                  (unsigned long long)check->compared, check->error);
    if (check->verdict != OVOID_CHECK_PASSED)
        fail_msg("%s: %s", check->name, check->text);
    ++*count;
}

static void device_passes(void **state) {
    size_t count = 0;
    ovoid_selftest_options options;
    ovoid_selftest_result result;
    ovoid_selftest_options_init(&options, sizeof options);
    ovoid_selftest_result_init(&result, sizeof result);
    assert_false(options.brief);
    assert_true(isnan(result.launch_seconds) && isnan(result.to_device_bytes));
    options.brief = true;
    test_check(*state, ovoid_selftest(*state, &options, keep, &count, &result));
    assert_true(count > 8);
    assert_int_equal(result.passed, count);
    assert_int_equal(result.wrong + result.failed, 0);
    assert_true(result.launch_seconds > 0.0 && result.round_trip_seconds > 0.0);
    assert_true(result.to_device_bytes > 0.0 && result.from_device_bytes > 0.0);
    assert_true(result.vector * result.lanes > 0 && OV_PACK % (result.vector * result.lanes) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(device_passes)};
    return cmocka_run_group_tests(tests, test_open, test_close);
}
