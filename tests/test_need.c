/*
 * What fits are sure to take of memory (host/fit/need.h), and how much there is.
 */
#include "fit/need.h"

#include "base/memory.h"
#include "support.h"

#include <inttypes.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

static ovoid_status compare(ovoid_context *context, size_t atoms, size_t largest, size_t jobs,
                            uint64_t available) {
    const ov_need need = {atoms, largest, jobs};
    return ov_need_compare(context, &need, available);
}

static void expect_says(ovoid_context *context, const char *text) {
    if (!strstr(ovoid_context_error(context), text))
        fail_msg("'%s' does not say '%s'", ovoid_context_error(context), text);
}

/* The option that helps is named, and no other. */
static void names_the_option(void **state) {
    ovoid_context *const context = *state;
    assert_int_equal(compare(context, 1000000, 1000000, 1, 2000000000), OVOID_ERROR_LIMIT);
    expect_says(context, "1000000 atoms as a whole");
    expect_says(context, "at least 3.1 GB");
    expect_says(context, "there are 2 GB");
    expect_says(context, "(parts.atoms, --part-atoms)");
    assert_int_equal(compare(context, 1000000, 100000, 1, 200000000), OVOID_ERROR_LIMIT);
    expect_says(context, "1 part of up to 100000");
    assert_null(strstr(ovoid_context_error(context), "--jobs"));
    assert_int_equal(compare(context, 1000000, 100000, 4, 1000000000), OVOID_ERROR_LIMIT);
    expect_says(context, "4 parts of up to 100000");
    expect_says(context, "(parts.jobs, --jobs)");
}

/* Memory follows what is fitted at a time, of which there is no more than there are atoms. */
static void follows_what_is_under_way(void **state) {
    ovoid_context *const context = *state;
    const ov_need one = {1000000, 10000, 1}, four = {1000000, 10000, 4}, none = {1000000, 10000, 0};
    const ov_need two_parts = {20000, 10000, 64}, whole = {20000, 20000, 1};
    assert_true(ov_need_bytes(&one) == 1e8 + 3e7);
    assert_true(ov_need_bytes(&none) == ov_need_bytes(&one));
    assert_true(ov_need_bytes(&four) == 1e8 + 1.2e8);
    assert_true(ov_need_bytes(&two_parts) == ov_need_bytes(&whole));
    assert_int_equal(compare(context, 1000000, 10000, 1, 130000000), OVOID_OK);
    assert_int_equal(compare(context, 1000000, 10000, 1, 129999999), OVOID_ERROR_LIMIT);
    assert_int_equal(compare(context, 32000000, 16384, 1, UINT64_MAX), OVOID_OK);
}

/* What the process may have counts, whatever the machine has. */
static void a_process_has_its_limit(void **state) {
    (void)state;
    enum { MORE = 300 << 20 };
    const uint64_t before = ov_memory_available();
    uint64_t pages = 0;
    assert_true(before > 1 << 20);
    FILE *const file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%" SCNu64, &pages) != 1)
        skip();
    fclose(file);
    const uint64_t taken = pages * (uint64_t)sysconf(_SC_PAGESIZE);
    const pid_t child = fork();
    if (child == 0) {
        const struct rlimit limit = {taken + MORE, taken + MORE};
        setrlimit(RLIMIT_AS, &limit);
        const uint64_t left = ov_memory_available();
        _exit(left > MORE / 2 && left <= MORE ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

/* A whole that cannot be is refused before anything is made of it, on CPUs. */
static void a_fit_is_refused(void **state) {
    ovoid_context *const context = *state;
    const ov_need need = {(size_t)1 << 45, (size_t)1 << 45, 1};
    test_skip_simulated(context);
    const bool is_host = ovoid_context_device(context)->type == OVOID_DEVICE_CPU;
    assert_int_equal(ov_need_check(context, &need), is_host ? OVOID_ERROR_LIMIT : OVOID_OK);
}

/* Jobs that nobody asked for leave room: on a device with memory of its own, four times the need.
 */
static void jobs_leave_room(void **state) {
    (void)state;
    ov_device gpu = {.info = {.type = OVOID_DEVICE_GPU, .global_memory = 880000000}};
    const ov_need four = {1000000, 10000, 4};
    assert_true(ov_need_fits(&gpu, &four));
    gpu.info.global_memory -= 4;
    assert_false(ov_need_fits(&gpu, &four));
    gpu.info.type = OVOID_DEVICE_CPU; /* its memory is the host's */
    gpu.info.global_memory = 0;
    assert_true(ov_need_fits(&gpu, &(ov_need){1000, 1000, 1}));
    assert_false(ov_need_fits(&gpu, &(ov_need){(size_t)1 << 45, 1000, 1}));
}

/* Side by side where that pays, and not where it ends the process or times nothing. */
static void company_where_it_pays(void **state) {
    (void)state;
    ov_device device = {.info = {.platform = "Portable Computing Language", .name = "pthread-x"}};
    assert_int_equal(ov_device_company(&device, 1), 1);
    assert_int_equal(ov_device_company(&device, 3), 1);
    assert_int_equal(ov_device_company(&device, 4), 2);
    assert_int_equal(ov_device_company(&device, 64), OVOID_DEFAULT_JOBS);
    device.borrowed = true;
    assert_int_equal(ov_device_company(&device, 64), 1);
    device.borrowed = false;
    strcpy(device.info.name, "basic-x");
    assert_int_equal(ov_device_company(&device, 64), 1);
    strcpy(device.info.platform, "Oclgrind");
    strcpy(device.info.name, "x");
    assert_int_equal(ov_device_company(&device, 64), 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_the_option),        cmocka_unit_test(follows_what_is_under_way),
        cmocka_unit_test(a_process_has_its_limit), cmocka_unit_test(a_fit_is_refused),
        cmocka_unit_test(jobs_leave_room),         cmocka_unit_test(company_where_it_pays),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
