/*
 * Times of kernels: what is launched is counted, timed where the driver tells times, and forgotten
 * nowhere. Some calls of OpenCL pass through here on their way to the driver, to be counted, and to
 * be refused as a driver without times would.
 */
#define _GNU_SOURCE /* RTLD_NEXT */

#include "support.h"

#include "device/internal.h"

#include <dlfcn.h>

/* ---- on the way to the driver ------------------------------------------------------------- */

enum { DAY = 86400, INVENTED = 256 };
static const cl_ulong nanoseconds = 1000000000;

static struct {
    bool refuse_queue, refuse_times, refuse_waiting; /* what is asked of the driver */
    bool invent_times;
    cl_ulong start, end;                    /* invented */
    cl_ulong layout_more;                   /* added to the end of a launch of `layout` */
    cl_command_queue_properties properties; /* of the last queue made */
    size_t events, released, waits;
    cl_event
        of[INVENTED]; /* of the first launches: their events, and whether they are of `layout` */
    bool of_layout[INVENTED];
} driver;

#define NEXT(name) ((__typeof__(&(name)))(uintptr_t)dlsym(RTLD_NEXT, #name))

cl_command_queue CL_API_CALL clCreateCommandQueue(cl_context context, cl_device_id device,
                                                  cl_command_queue_properties properties,
                                                  cl_int *code) {
    if (driver.refuse_queue && properties & CL_QUEUE_PROFILING_ENABLE) {
        *code = CL_INVALID_QUEUE_PROPERTIES;
        return NULL;
    }
    driver.properties = properties;
    return NEXT(clCreateCommandQueue)(context, device, properties, code);
}

cl_int CL_API_CALL clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dim,
                                          const size_t *offset, const size_t *global,
                                          const size_t *local, cl_uint count, const cl_event *wait,
                                          cl_event *event) {
    const cl_int code =
        NEXT(clEnqueueNDRangeKernel)(queue, kernel, dim, offset, global, local, count, wait, event);
    char name[64] = "";
    if (!event)
        return code;
    clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof name, name, NULL);
    if (driver.events < INVENTED) {
        driver.of[driver.events] = *event;
        driver.of_layout[driver.events] = strcmp(name, "layout") == 0;
    }
    ++driver.events;
    return code;
}

/* Handles come again after they were released: the last one counts. */
static bool is_of_layout(cl_event event) {
    size_t n = driver.events < INVENTED ? driver.events : INVENTED;
    while (n > 0 && driver.of[n - 1] != event)
        --n;
    return n > 0 && driver.of_layout[n - 1];
}

cl_int CL_API_CALL clGetEventProfilingInfo(cl_event event, cl_profiling_info what, size_t room,
                                           void *to, size_t *needed) {
    if (driver.refuse_times)
        return CL_PROFILING_INFO_NOT_AVAILABLE;
    if (!driver.invent_times)
        return NEXT(clGetEventProfilingInfo)(event, what, room, to, needed);
    assert_int_equal(room, sizeof(cl_ulong));
    if (what == CL_PROFILING_COMMAND_START)
        *(cl_ulong *)to = driver.start;
    else
        *(cl_ulong *)to = driver.end + (is_of_layout(event) ? driver.layout_more : 0);
    return CL_SUCCESS;
}

cl_int CL_API_CALL clWaitForEvents(cl_uint count, const cl_event *events) {
    ++driver.waits;
    return driver.refuse_waiting ? CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST
                                 : NEXT(clWaitForEvents)(count, events);
}

cl_int CL_API_CALL clReleaseEvent(cl_event event) {
    ++driver.released;
    return NEXT(clReleaseEvent)(event);
}

/* ---- helpers ------------------------------------------------------------------------------ */

static ovoid_context *new_context(void) {
    ovoid_context *context = NULL;
    memset(&driver, 0, sizeof driver);
    test_check(NULL, ovoid_context_create(&context));
    return context;
}

/* Launches the small kernel `layout` so many times, without waiting. */
static void launch(ovoid_context *context, size_t times) {
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    test_check(context, ov_kernel_create(context, "layout", "layout", &kernel));
    test_check(context, ov_buffer_reserve(context, &buffer, 64 * sizeof(uint32_t), "layout"));
    for (size_t i = 0; i < times; ++i)
        test_check(context, OV_LAUNCH(context, &kernel, 1, 1, OV_ARG(buffer.memory)));
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
}

/* Whether the driver tells times at all. */
static bool tells_times(void) {
    ovoid_context *context = new_context();
    ovoid_kernel_time *times = NULL;
    size_t count;
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 1);
    test_check(context, ovoid_context_kernel_times(context, &times, &count));
    const bool told = !isnan(times[0].seconds);
    ovoid_free(times);
    ovoid_context_destroy(&context);
    return told;
}

/* Fails unless `layout` alone was launched, so many times; its seconds. */
static double layout_seconds(ovoid_context *context, size_t launches) {
    ovoid_kernel_time *times = NULL;
    size_t count = 99;
    test_check(context, ovoid_context_kernel_times(context, &times, &count));
    assert_int_equal(count, 1);
    assert_string_equal(times->name, "layout");
    assert_int_equal(times->launches, launches);
    const double seconds = times->seconds;
    ovoid_free(times);
    return seconds;
}

static void expect_nothing(ovoid_context *context) {
    ovoid_kernel_time some, *times = &some;
    size_t count = 99;
    test_check(context, ovoid_context_kernel_times(context, &times, &count));
    assert_int_equal(count, 0);
    assert_null(times);
}

/* ---- tests -------------------------------------------------------------------------------- */

static void off_counts_nothing(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    expect_nothing(context); /* not even a device */
    launch(context, 3);
    test_check(context, ov_finish(context));
    expect_nothing(context);
    assert_int_equal(driver.events, 0);
    assert_int_equal(driver.waits, 0);
    assert_int_equal(driver.properties, 0);
    assert_int_equal(context->device->counts[OVOID_COUNT_LAUNCHES], 3);
    ovoid_context_destroy(&context);
}

static void counts_and_times(void **state) {
    (void)state;
    const bool told = tells_times();
    ovoid_context *context = new_context();
    test_check(context, ovoid_context_profile(context, true)); /* the device opens later */
    assert_null(context->device);
    launch(context, 7);
    const double once = layout_seconds(context, 7);
    assert_int_equal(driver.properties, CL_QUEUE_PROFILING_ENABLE);
    assert_int_equal(driver.events, 7);
    if (told) {
        assert_true(once >= 0.0); /* 0 by a coarse clock */
        driver.invent_times = true;
        driver.start = driver.end = DAY * nanoseconds;
        driver.layout_more = 100 * nanoseconds;
        launch(context, 20); /* and they add up */
        expect_near(layout_seconds(context, 27), once + 2000.0, 1e-6, "seconds");
    } else {
        print_message("the driver tells no times\n");
        assert_true(isnan(once));
    }
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.events);
}

/* Times are those of the kernel they belong to: here of a driver that says a launch of `layout`
 * took a hundred seconds, and one of any other kernel a quarter of a second. */
static void kernels_are_told_apart(void **state) {
    (void)state;
    const bool told = tells_times();
    const size_t count = test_size(20000, 500);
    ovoid_context *context = new_context();
    driver.invent_times = true;
    driver.start = DAY * nanoseconds;
    driver.end = driver.start + nanoseconds / 4;
    driver.layout_more = 100 * nanoseconds - nanoseconds / 4;
    test_random random = {7};
    ovoid_molecule *molecule = NULL;
    double *const xyzr = test_alloc(4 * count, sizeof *xyzr);
    double *const value = test_alloc(count, sizeof *value);
    double *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t i = 0; i < 4 * count; ++i)
        xyzr[i] = i % 4 == 3 ? 1.5 : random_uniform(&random, -5.0, 5.0);
    for (size_t i = 0; i < 3 * count; ++i)
        xyz[i] = random_uniform(&random, -5.0, 5.0);
    test_check(context, ovoid_molecule_create(context, xyzr, test_size(200, 20), &molecule));
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 1);
    test_check(context, once_molecule_field(context, molecule, 0.5, xyz, count, value, NULL));
    ovoid_kernel_time *times = NULL;
    size_t kernels = 0, launches = 0;
    test_check(context, ovoid_context_kernel_times(context, &times, &kernels));
    assert_true(kernels > 2);
    for (size_t k = 0; k < kernels; ++k) {
        launches += times[k].launches;
        assert_true(times[k].launches > 0);
        for (size_t other = 0; other < k; ++other)
            assert_string_not_equal(times[k].name, times[other].name);
        if (told && k > 0)
            assert_true(times[k].seconds <= times[k - 1].seconds);
        if (told)
            expect_near(times[k].seconds / (double)times[k].launches,
                        strcmp(times[k].name, "layout") == 0 ? 100.0 : 0.25, 1e-9, times[k].name);
    }
    assert_int_equal(launches, context->device->counts[OVOID_COUNT_LAUNCHES]);
    if (told)
        assert_string_equal(times[0].name, "layout");
    ovoid_free(times);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    free(xyzr);
    free(value);
    free(xyz);
}

static void on_and_off(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    launch(context, 2);
    test_check(context,
               ovoid_context_profile(context, true)); /* with a device and work under way */
    expect_nothing(context);
    launch(context, 3);
    test_check(context, ovoid_context_profile(context, false));
    assert_int_equal(driver.properties, 0);
    launch(context, 4);
    layout_seconds(context, 3); /* still told */
    assert_int_equal(driver.events, 3);
    assert_int_equal(driver.released, 3);
    test_check(context, ovoid_context_profile(context, true));
    expect_nothing(context);
    launch(context, 5);
    layout_seconds(context, 5);
    test_check(context, ovoid_context_profile(context, true)); /* anew */
    launch(context, 6);
    layout_seconds(context, 6);
    test_check(context, ovoid_context_open_device(context, NULL));
    expect_nothing(context);
    launch(context, 1);
    layout_seconds(context, 1);
    test_check(context, ovoid_context_profile(context, false));
    test_check(context, ovoid_context_profile(context, false));
    test_check(context, ovoid_context_open_device(context, NULL));
    launch(context, 1);
    expect_nothing(context);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.events);
}

/* Where the host waits anyway, no event stays. */
static void waiting_reads_the_times(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_buffer buffer = {0};
    uint32_t word = 0;
    const size_t many = (size_t)4 << 20;
    void *bytes = calloc(1, many);
    assert_non_null(bytes);
    test_check(context, ovoid_context_profile(context, true));
    test_check(context, ov_buffer_reserve(context, &buffer, many, "bytes"));
    launch(context, 2);
    assert_int_equal(driver.released, 0);
    test_check(context, ov_buffer_write(context, &buffer, 0, &word, sizeof word));
    assert_int_equal(driver.released, 0); /* a small write does not wait */
    test_check(context, ov_buffer_write(context, &buffer, 0, bytes, many));
    assert_int_equal(driver.released, 2);
    launch(context, 3);
    test_check(context, ov_buffer_read(context, &buffer, 0, &word, sizeof word));
    assert_int_equal(driver.released, 5);
    launch(context, 4);
    test_check(context, ov_finish(context));
    assert_int_equal(driver.released, 9);
    launch(context, 1); /* and without waiting, the device's end */
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, 10);
    free(bytes);
}

static void few_events_are_kept(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    const size_t more = 10;
    test_check(context, ovoid_context_profile(context, true));
    launch(context, OV_PROFILE_PENDING);
    assert_int_equal(driver.released, 0);
    launch(context, more);
    assert_int_equal(driver.released, OV_PROFILE_PENDING);
    layout_seconds(context, OV_PROFILE_PENDING + more);
    assert_int_equal(driver.released, driver.events);
    ovoid_context_destroy(&context);
}

/* Drivers that time nothing, or not this. */
static void without_times(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    driver.refuse_queue = true;
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 3);
    assert_true(isnan(layout_seconds(context, 3)));
    assert_int_equal(driver.events, 0);
    test_check(context, ovoid_context_profile(context, true)); /* the device is open */
    launch(context, 2);
    test_check(context, ovoid_context_profile(context, false));
    launch(context, 1);
    assert_true(isnan(layout_seconds(context, 2)));
    driver.refuse_queue = false;
    driver.refuse_times = true;
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 4);
    test_check(context, ov_finish(context));
    driver.refuse_times = false;
    launch(context, 1); /* a sum with a hole is none */
    assert_true(isnan(layout_seconds(context, 5)));
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.events);
}

/* Seconds of two launches that the driver says to have begun and ended then (nanoseconds). */
static double invented(cl_ulong start, cl_ulong end) {
    ovoid_context *context = new_context();
    driver.invent_times = true;
    driver.start = start;
    driver.end = end;
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 2);
    const double seconds = layout_seconds(context, 2);
    ovoid_context_destroy(&context);
    return seconds;
}

static void times_are_believed_or_not(void **state) {
    (void)state;
    const cl_ulong day = DAY * nanoseconds;
    expect_near(invented(day, day + 250000000), 0.5, 1e-12, "seconds");
    assert_true(invented(day, day) == 0.0);     /* a coarse clock */
    assert_true(isnan(invented(2, 3)));         /* rusticl 22 */
    assert_true(isnan(invented(0, 0)));         /* nobody's clock */
    assert_true(isnan(invented(day, day - 1))); /* backwards */
}

static void failures(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ovoid_kernel_time *times = NULL;
    size_t count = 0;
    assert_int_equal(ovoid_context_profile(NULL, true), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_context_kernel_times(NULL, &times, &count), OVOID_ERROR_ARGUMENT);
    test_refused(context, ovoid_context_kernel_times(context, NULL, &count), OVOID_ERROR_ARGUMENT,
                 "NULL");
    test_refused(context, ovoid_context_kernel_times(context, &times, NULL), OVOID_ERROR_ARGUMENT,
                 "NULL");
    test_check(context, ovoid_context_profile(context, true));
    launch(context, 2);
    driver.refuse_waiting = true;
    test_refused(context, ov_finish(context), OVOID_ERROR_OPENCL,
                 "clWaitForEvents: CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST (-14), kernel "
                 "layout");
    assert_int_equal(driver.released, 2);
    driver.refuse_waiting = false;
    assert_true(isnan(layout_seconds(context, 2)));
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(off_counts_nothing),
        cmocka_unit_test(counts_and_times),
        cmocka_unit_test(kernels_are_told_apart),
        cmocka_unit_test(on_and_off),
        cmocka_unit_test(waiting_reads_the_times),
        cmocka_unit_test(few_events_are_kept),
        cmocka_unit_test(without_times),
        cmocka_unit_test(times_are_believed_or_not),
        cmocka_unit_test(failures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
