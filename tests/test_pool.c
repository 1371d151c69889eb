/*
 * Buffers from a pool, and kernels made once: what is created, reused, released and counted. The
 * calls that make and release buffers pass through here on their way to the driver, to be counted,
 * and to be refused as a driver without memory would.
 */
#define _GNU_SOURCE /* RTLD_NEXT */

#include "support.h"

#include "device/internal.h"

#include <dlfcn.h>

static struct {
    size_t created, released;
    int refuse_create, refuse_launch, refuse_write, refuse_read; /* the next so many calls */
} driver;

#define NEXT(name) ((__typeof__(&(name)))(uintptr_t)dlsym(RTLD_NEXT, #name))

cl_mem CL_API_CALL clCreateBuffer(cl_context context, cl_mem_flags flags, size_t bytes, void *host,
                                  cl_int *code) {
    if (driver.refuse_create > 0) {
        --driver.refuse_create;
        *code = CL_MEM_OBJECT_ALLOCATION_FAILURE;
        return NULL;
    }
    ++driver.created;
    return NEXT(clCreateBuffer)(context, flags, bytes, host, code);
}

cl_int CL_API_CALL clReleaseMemObject(cl_mem memory) {
    ++driver.released;
    return NEXT(clReleaseMemObject)(memory);
}

/* What a driver says that gives a buffer its memory when it is first used. */
static bool refuse(int *times) {
    return *times > 0 && (*times)--;
}

cl_int CL_API_CALL clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dim,
                                          const size_t *offset, const size_t *global,
                                          const size_t *local, cl_uint count, const cl_event *wait,
                                          cl_event *event) {
    if (refuse(&driver.refuse_launch))
        return CL_MEM_OBJECT_ALLOCATION_FAILURE;
    return NEXT(clEnqueueNDRangeKernel)(queue, kernel, dim, offset, global, local, count, wait,
                                        event);
}

cl_int CL_API_CALL clEnqueueWriteBuffer(cl_command_queue queue, cl_mem memory, cl_bool blocking,
                                        size_t offset, size_t bytes, const void *from,
                                        cl_uint count, const cl_event *wait, cl_event *event) {
    if (refuse(&driver.refuse_write))
        return CL_MEM_OBJECT_ALLOCATION_FAILURE;
    return NEXT(clEnqueueWriteBuffer)(queue, memory, blocking, offset, bytes, from, count, wait,
                                      event);
}

cl_int CL_API_CALL clEnqueueReadBuffer(cl_command_queue queue, cl_mem memory, cl_bool blocking,
                                       size_t offset, size_t bytes, void *to, cl_uint count,
                                       const cl_event *wait, cl_event *event) {
    if (refuse(&driver.refuse_read))
        return CL_MEM_OBJECT_ALLOCATION_FAILURE;
    return NEXT(clEnqueueReadBuffer)(queue, memory, blocking, offset, bytes, to, count, wait,
                                     event);
}

/* ---- helpers ------------------------------------------------------------------------------ */

static ovoid_context *new_context(void) {
    ovoid_context *context = NULL;
    ov_device *device;
    memset(&driver, 0, sizeof driver);
    test_check(NULL, ovoid_context_create(&context));
    test_check(context, ov_device_get(context, &device));
    return context;
}

static ov_buffer buffer_of(ovoid_context *context, size_t bytes) {
    ov_buffer buffer = {0};
    test_check(context, ov_buffer_reserve(context, &buffer, bytes, "bytes"));
    assert_true(buffer.bytes >= bytes);
    return buffer;
}

/* ---- tests -------------------------------------------------------------------------------- */

static void test_reuse(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_buffer one = buffer_of(context, 100000);
    const cl_mem memory = one.memory;
    ov_buffer_destroy(&one);
    assert_int_equal(driver.released, 0);
    one = buffer_of(context, 99000); /* not much less */
    assert_ptr_equal(one.memory, memory);
    ov_buffer other = buffer_of(context, 99000); /* the one kept is in use */
    assert_ptr_not_equal(other.memory, memory);
    ov_buffer_destroy(&one);
    ov_buffer small = buffer_of(context, 1000); /* most of it would lie idle */
    assert_ptr_not_equal(small.memory, memory);
    ov_buffer large = buffer_of(context, 200000);
    assert_ptr_not_equal(large.memory, memory);
    ov_buffer_destroy(&large);
    ov_buffer_destroy(&small);
    ov_buffer_destroy(&other);
    assert_int_equal(driver.created, 4);
    assert_int_equal(driver.released, 0);
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BUFFERS_CREATED), 4);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, 4);
}

/* The best one, whatever the order they came back in; what it held is left to chance. */
static void test_best(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_buffer some[3];
    static const size_t sizes[3] = {1400, 1000, 1200};
    cl_mem memory[3];
    for (int k = 0; k < 3; ++k) {
        some[k] = buffer_of(context, sizes[k]);
        memory[k] = some[k].memory;
    }
    for (int k = 0; k < 3; ++k)
        ov_buffer_destroy(&some[k]);
    ov_buffer best = buffer_of(context, 1150);
    assert_ptr_equal(best.memory, memory[2]);
    ov_buffer_destroy(&best);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, 3);
}

/* Between tasks what is kept goes where it is the host's memory; buffers in use stay. */
static void test_trim(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    const bool is_host = ovoid_context_device(context)->type == OVOID_DEVICE_CPU;
    ov_buffer one = buffer_of(context, 100000), other = buffer_of(context, 100000);
    ov_buffer_destroy(&one);
    ov_buffers_trim(context);
    assert_int_equal(driver.released, is_host ? 1 : 0);
    one = buffer_of(context, 100000);
    assert_int_equal(driver.created, is_host ? 3 : 2);
    ov_buffer_destroy(&one);
    ov_buffer_destroy(&other);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.created);
    test_check(NULL, ovoid_context_create(&context));
    ov_buffers_trim(context); /* no device is open */
    ovoid_context_destroy(&context);
}

static void test_bounds(void **state) {
    (void)state;
    enum { BUFFERS = 200 };
    ovoid_context *context = new_context();
    ov_buffer some[BUFFERS];
    for (int k = 0; k < BUFFERS; ++k)
        some[k] = buffer_of(context, 1000);
    for (int k = 0; k < BUFFERS; ++k)
        ov_buffer_destroy(&some[k]);
    assert_in_range(driver.released, 1, BUFFERS - 16); /* not all are kept, and not none */
    const uint64_t memory = ovoid_context_device(context)->global_memory;
    const size_t quarter = (size_t)(memory / 16 < (256u << 20) ? memory / 16 : 256u << 20) / 4;
    size_t held = 0;
    const size_t before = driver.released;
    for (int k = 0; k < 8; ++k) {
        some[k] = buffer_of(context, quarter);
        held += some[k].bytes;
    }
    assert_true(held > 6 * quarter);
    for (int k = 0; k < 8; ++k)
        ov_buffer_destroy(&some[k]);
    assert_true(driver.released >= before + 4);
    const size_t created = driver.created; /* the oldest, small ones all, went first */
    some[0] = buffer_of(context, 1000);
    assert_int_equal(driver.created, created + 1);
    ov_buffer_destroy(&some[0]);
    ov_buffer huge = buffer_of(context, 5 * quarter); /* more than all that may be kept */
    const size_t released = driver.released;
    ov_buffer_destroy(&huge);
    assert_int_equal(driver.released, released + 1);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.created);
}

static void test_shortage(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_buffer kept = buffer_of(context, 100000), other = {0};
    ov_buffer_destroy(&kept);
    driver.refuse_create = 1; /* what is kept makes room */
    other = buffer_of(context, 1000);
    assert_int_equal(driver.released, 1);
    driver.refuse_create = 2; /* nothing is kept: refused as before */
    assert_int_equal(ov_buffer_reserve(context, &kept, 1000, "more"), OVOID_ERROR_MEMORY);
    assert_null(kept.memory);
    assert_non_null(strstr(ovoid_context_error(context), "CL_MEM_OBJECT_ALLOCATION_FAILURE"));
    ov_buffer_destroy(&other);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.created);
}

/* Drivers that find out late. */
static void test_late_shortage(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_kernel layout = {0};
    uint32_t words[64] = {0}, back[64];
    test_check(context, ov_kernel_create(context, "layout", "layout", &layout));
    ov_buffer buffer = buffer_of(context, sizeof words);
    for (int k = 0; k < 3; ++k) {
        ov_buffer kept = buffer_of(context, 100000);
        const size_t released = driver.released;
        ov_buffer_destroy(&kept);
        driver.refuse_launch = k == 0;
        driver.refuse_write = k == 1;
        driver.refuse_read = k == 2;
        test_check(context, ov_buffer_write(context, &buffer, 0, words, sizeof words));
        test_check(context, OV_LAUNCH(context, &layout, 1, 1, OV_ARG(buffer.memory)));
        test_check(context, ov_buffer_read(context, &buffer, 0, back, sizeof back));
        assert_int_equal(driver.released, released + 1);
        assert_memory_not_equal(words, back, sizeof words);
    }
    driver.refuse_launch = 1; /* nothing is kept */
    assert_int_equal(OV_LAUNCH(context, &layout, 1, 1, OV_ARG(buffer.memory)), OVOID_ERROR_MEMORY);
    ov_kernel_destroy(&layout);
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, driver.created);
}

/* Those in use outlive the device that they are of, and serve no other. */
static void test_outlive(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_buffer old = buffer_of(context, 1000);
    test_check(context, ovoid_context_open_device(context, NULL));
    ov_buffer_destroy(&old);
    assert_int_equal(driver.released, 1);
    old = buffer_of(context, 1000);
    assert_int_equal(driver.created, 2);
    ovoid_context_destroy(&context);
    assert_int_equal(driver.released, 1);
    ov_buffer_destroy(&old);
    assert_int_equal(driver.released, 2);
}

static void test_off(void **state) {
    (void)state;
    setenv("OVOID_POOL", "off", 1);
    ovoid_context *context = new_context();
    unsetenv("OVOID_POOL");
    ov_buffer buffer = buffer_of(context, 100001);
    assert_int_equal(buffer.bytes, 100001);
    ov_buffer_destroy(&buffer);
    assert_int_equal(driver.released, 1);
    ovoid_context_destroy(&context);
}

/* Kernels are made once; each name of each program is another one. */
static void test_kernels(void **state) {
    (void)state;
    ovoid_context *context = new_context();
    ov_kernel one = {0}, same = {0}, other = {0};
    test_check(context, ov_kernel_create(context, "field", "field", &one));
    test_check(context, ov_kernel_create(context, "field", "field_gradient", &other));
    test_check(context, ov_kernel_create(context, "field", "field", &same));
    assert_ptr_equal(one.handle, same.handle);
    assert_ptr_not_equal(one.handle, other.handle);
    assert_int_equal(one.arg_count, same.arg_count);
    ov_kernel_destroy(&one);
    ov_kernel_destroy(&same);
    test_check(context, ov_kernel_create(context, "field", "field", &one));
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_KERNELS_CREATED), 2);
    assert_int_not_equal(ov_kernel_create(context, "field", "no_such_kernel", &same), OVOID_OK);
    assert_null(same.handle);
    ov_kernel_destroy(&one);
    ov_kernel_destroy(&other);
    ovoid_context_destroy(&context);
}

static void test_counts(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    test_check(NULL, ovoid_context_create(&context));
    for (int what = 0; what <= OVOID_COUNTS; ++what)
        assert_int_equal(ovoid_context_count(context, (ovoid_count)what), 0); /* no device yet */
    assert_int_equal(ovoid_context_count(NULL, OVOID_COUNT_LAUNCHES), 0);
    ov_buffer buffer = buffer_of(context, (size_t)4 << 20);
    unsigned char *const bytes = calloc((size_t)4 << 20, 1);
    assert_non_null(bytes);
    test_check(context, ov_buffer_write(context, &buffer, 0, bytes, 1000));
    test_check(context, ov_buffer_write(context, &buffer, 0, bytes, 0));
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BLOCKING_WRITES), 0);
    test_check(context, ov_buffer_write(context, &buffer, 0, bytes, (size_t)4 << 20));
    test_check(context, ov_buffer_read(context, &buffer, 0, bytes, 77));
    test_check(context, ov_buffer_read(context, &buffer, 5, bytes, 3));
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BLOCKING_WRITES), 1);
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BLOCKING_READS), 2);
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BYTES_TO_DEVICE), 1000 + (4 << 20));
    assert_int_equal(ovoid_context_count(context, OVOID_COUNT_BYTES_FROM_DEVICE), 80);
    const uint64_t before[OVOID_COUNTS] = {
        [OVOID_COUNT_BLOCKING_READS] = 1, [OVOID_COUNT_BYTES_FROM_DEVICE] = 80};
    uint64_t now[OVOID_COUNTS];
    ov_device_counted(context->device, before, now);
    assert_int_equal(now[OVOID_COUNT_BLOCKING_READS], 1);
    assert_int_equal(now[OVOID_COUNT_BYTES_FROM_DEVICE], 0);
    assert_int_equal(now[OVOID_COUNT_BYTES_TO_DEVICE], 1000 + (4 << 20));
    assert_int_equal(now[OVOID_COUNT_BUFFERS_CREATED], 1);
    free(bytes);
    ov_buffer_destroy(&buffer);
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reuse),         cmocka_unit_test(test_best),
        cmocka_unit_test(test_bounds),        cmocka_unit_test(test_shortage),
        cmocka_unit_test(test_late_shortage), cmocka_unit_test(test_outlive),
        cmocka_unit_test(test_off),           cmocka_unit_test(test_kernels),
        cmocka_unit_test(test_counts),        cmocka_unit_test(test_trim),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
