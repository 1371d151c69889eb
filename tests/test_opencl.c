/*
 * A program's own OpenCL context, queue and buffers (ovoid/opencl.h): results are those on Ovoid's
 * own device, handles are counted, and what cannot work is refused.
 */
#include "support.h"

#include "ovoid/opencl.h"
#include "ovoid/ovoid.h"

enum { ATOMS = 60, POINTS = 300 };

typedef struct program {
    cl_device_id device;
    cl_context opencl;
    cl_command_queue queue;
    ovoid_context *context;
    ovoid_field *field;
    double xyz[3 * POINTS], value[POINTS], gradient[3 * POINTS]; /* on Ovoid's own device */
} program;

static program p;

static cl_device_id device_of(ovoid_context *context) {
    cl_uint platforms = 0, devices = 0, index = 0;
    cl_platform_id ids[16];
    assert_int_equal(clGetPlatformIDs(16, ids, &platforms), CL_SUCCESS);
    for (cl_uint i = 0; i < platforms; ++i) {
        cl_device_id found[16];
        if (clGetDeviceIDs(ids[i], CL_DEVICE_TYPE_ALL, 16, found, &devices) != CL_SUCCESS)
            continue;
        for (cl_uint k = 0; k < devices; ++k)
            if (index++ == ovoid_context_device(context)->index)
                return found[k];
    }
    return NULL;
}

static ovoid_field *make_field(ovoid_context *context) {
    double xyzr[4 * ATOMS];
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    for (size_t i = 0; i < ATOMS; ++i) {
        const double t = (double)i, atom[4] = {6.0 * cos(t), 6.0 * sin(t), 0.4 * t, 1.5};
        memcpy(xyzr + 4 * i, atom, sizeof atom);
    }
    test_check(context, ovoid_molecule_create(context, xyzr, ATOMS, &molecule));
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &field));
    ovoid_molecule_destroy(&molecule);
    return field;
}

static int make_program(void **state) {
    cl_int code;
    test_random random = {5};
    if (test_open(state) != 0 || !(p.device = device_of(*state)))
        return -1;
    /* At floats' positions, so that a buffer of them holds the same points; some far outside. */
    for (size_t k = 0; k < 3 * POINTS; ++k)
        p.xyz[k] = (float)random_uniform(&random, -9.0, k % 3 == 2 ? 60.0 : 9.0);
    ovoid_field *field = make_field(*state);
    test_check(*state, ovoid_field_evaluate(*state, field, p.xyz, POINTS, p.value, p.gradient));
    ovoid_field_destroy(&field);
    p.opencl = clCreateContext(NULL, 1, &p.device, NULL, NULL, &code);
    p.queue = clCreateCommandQueue(p.opencl, p.device, 0, &code);
    if (ovoid_context_create(&p.context) != OVOID_OK)
        return -1;
    test_check(p.context, ovoid_context_open_opencl(p.context, p.opencl, p.device, p.queue));
    p.field = make_field(p.context);
    return 0;
}

static int drop_program(void **state) {
    ovoid_field_destroy(&p.field);
    ovoid_context_destroy(&p.context);
    clReleaseCommandQueue(p.queue);
    clReleaseContext(p.opencl);
    return test_close(state);
}

static cl_mem buffer_of(cl_mem_flags flags, size_t floats, const float *data) {
    cl_int code;
    cl_mem made = clCreateBuffer(p.opencl, flags, floats * sizeof(float), NULL, &code);
    assert_int_equal(code, CL_SUCCESS);
    float *const fill = test_alloc(floats, sizeof *fill);
    memset(fill, 0x5a, floats * sizeof *fill);
    assert_int_equal(clEnqueueWriteBuffer(p.queue, made, CL_TRUE, 0, floats * sizeof *fill,
                                          data ? data : fill, 0, NULL, NULL),
                     CL_SUCCESS);
    free(fill);
    return made;
}

/* The results come by the same queue, without another wait. */
static void expect_results(cl_mem value, cl_mem gradient) {
    float values[POINTS], slopes[3 * POINTS];
    assert_int_equal(
        clEnqueueReadBuffer(p.queue, value, CL_TRUE, 0, sizeof values, values, 0, NULL, NULL),
        CL_SUCCESS);
    for (size_t k = 0; k < POINTS; ++k)
        if ((double)values[k] != p.value[k])
            fail_msg("value %zu: %g, not %g", k, (double)values[k], p.value[k]);
    if (!gradient)
        return;
    assert_int_equal(
        clEnqueueReadBuffer(p.queue, gradient, CL_TRUE, 0, sizeof slopes, slopes, 0, NULL, NULL),
        CL_SUCCESS);
    for (size_t k = 0; k < 3 * POINTS; ++k)
        if ((double)slopes[k] != p.gradient[k])
            fail_msg("gradient %zu: %g, not %g", k, (double)slopes[k], p.gradient[k]);
}

/* ---- values --------------------------------------------------------------------------------- */

static void values_arrive_in_the_callers_buffers(void **state) {
    (void)state;
    float points[3 * POINTS];
    double few = 0.0;
    for (size_t k = 0; k < 3 * POINTS; ++k)
        points[k] = (float)p.xyz[k];
    cl_mem xyz = buffer_of(CL_MEM_READ_ONLY, 3 * POINTS, points);
    for (int slopes = 0; slopes < 2; ++slopes)
        for (int from_buffer = 0; from_buffer < 2; ++from_buffer) {
            if (test_simulated(p.context) && from_buffer != slopes)
                continue; /* each of the kernels once */
            cl_mem value = buffer_of(CL_MEM_WRITE_ONLY, POINTS, NULL);
            cl_mem gradient = slopes ? buffer_of(CL_MEM_READ_WRITE, 3 * POINTS, NULL) : NULL;
            test_check(p.context, from_buffer
                                      ? ovoid_field_evaluate_buffer(p.context, p.field, xyz, POINTS,
                                                                    value, gradient)
                                      : ovoid_field_evaluate_opencl(p.context, p.field, p.xyz,
                                                                    POINTS, value, gradient));
            if (slopes) /* the values beside a gradient differ by rounding */
                expect_results(value, gradient);
            clReleaseMemObject(value);
            if (gradient)
                clReleaseMemObject(gradient);
        }
    clReleaseMemObject(xyz);
    test_check(p.context, ovoid_field_evaluate(p.context, p.field, p.xyz, 1, &few, NULL));
    expect_near(few, p.value[0], 2e-6 * few + 1e-6, "a value for the host");
}

/* Beyond the end of what was asked for nothing is written, and nothing at all for no points. */
static void only_what_was_asked_for(void **state) {
    (void)state;
    float values[POINTS], marks[POINTS];
    memset(marks, 0x5a, sizeof marks);
    cl_mem value = buffer_of(CL_MEM_READ_WRITE, POINTS, NULL);
    for (size_t count = 0; count <= 5; count += 5) {
        test_check(p.context,
                   ovoid_field_evaluate_opencl(p.context, p.field, p.xyz, count, value, NULL));
        assert_int_equal(
            clEnqueueReadBuffer(p.queue, value, CL_TRUE, 0, sizeof values, values, 0, NULL, NULL),
            CL_SUCCESS);
        assert_memory_equal(values + count, marks, sizeof marks - count * sizeof *marks);
        for (size_t k = 0; k < count; ++k)
            expect_near(values[k], p.value[k], 2e-6 * p.value[k] + 1e-6, "one of a few values");
    }
    clReleaseMemObject(value);
}

/* ---- handles -------------------------------------------------------------------------------- */

static cl_uint references(void) {
    cl_uint context = 0, queue = 0;
    clGetContextInfo(p.opencl, CL_CONTEXT_REFERENCE_COUNT, sizeof context, &context, NULL);
    clGetCommandQueueInfo(p.queue, CL_QUEUE_REFERENCE_COUNT, sizeof queue, &queue, NULL);
    return 1000 * context + queue;
}

static void handles_are_counted(void **state) {
    const cl_uint before = references();
    ovoid_context *context = NULL;
    test_check(*state, ovoid_context_create(&context));
    test_check(context, ovoid_context_open_opencl(context, p.opencl, p.device, p.queue));
    assert_true(references() >= before + 1001);
    test_check(context,
               ovoid_context_open_opencl(context, p.opencl, p.device, p.queue)); /* again */
    const ovoid_device_info *const info = ovoid_context_device(context);
    assert_int_equal(info->index, UINT32_MAX);
    assert_string_equal(info->name, ovoid_context_device(*state)->name);
    assert_string_equal(info->platform, ovoid_context_device(*state)->platform);
    ovoid_context_destroy(&context);
    assert_int_equal(references(), before);
}

static void a_queue_that_tells_times(void **state) {
    for (int timed = 0; timed < 2; ++timed) {
        cl_int code;
        ovoid_context *context = NULL;
        ovoid_kernel_time *times = NULL;
        size_t count = 0;
        double value;
        cl_command_queue queue =
            clCreateCommandQueue(p.opencl, p.device, timed ? CL_QUEUE_PROFILING_ENABLE : 0, &code);
        assert_int_equal(code, CL_SUCCESS);
        test_check(*state, ovoid_context_create(&context));
        test_check(context, ovoid_context_profile(context, true));
        test_check(context, ovoid_context_open_opencl(context, p.opencl, p.device, queue));
        ovoid_field *field = make_field(context);
        test_check(context, ovoid_field_evaluate(context, field, p.xyz, 1, &value, NULL));
        test_check(context, ovoid_context_kernel_times(context, &times, &count));
        assert_int_equal(count, 1);
        assert_int_equal(times[0].launches, 1);
        if (!timed)
            assert_true(isnan(times[0].seconds));
        ovoid_free(times);
        test_check(context, ovoid_context_profile(context, false));
        test_check(context, ovoid_field_evaluate(context, field, p.xyz, 1, &value, NULL));
        ovoid_field_destroy(&field);
        ovoid_context_destroy(&context);
        clReleaseCommandQueue(queue);
    }
}

/* ---- refusals ------------------------------------------------------------------------------- */

static void queues_that_do_not_fit(void **state) {
    cl_int code;
    ovoid_context *context = NULL;
    test_check(*state, ovoid_context_create(&context));
    cl_context other = clCreateContext(NULL, 1, &p.device, NULL, NULL, &code);
    assert_int_equal(code, CL_SUCCESS);
    test_refused(context, ovoid_context_open_opencl(context, other, p.device, p.queue),
                 OVOID_ERROR_ARGUMENT, "another OpenCL context");
    cl_command_queue queue =
        clCreateCommandQueue(p.opencl, p.device, CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE, &code);
    if (code == CL_SUCCESS) {
        test_refused(context, ovoid_context_open_opencl(context, p.opencl, p.device, queue),
                     OVOID_ERROR_ARGUMENT, "out of order");
        clReleaseCommandQueue(queue);
    } else {
        print_message("this driver makes no queues that execute out of order\n");
    }
    assert_null(ovoid_context_device(context));
    clReleaseContext(other);
    ovoid_context_destroy(&context);
}

static void buffers_that_do_not_fit(void **state) {
    cl_mem value = buffer_of(CL_MEM_READ_WRITE, POINTS, NULL);
    cl_mem read_only = buffer_of(CL_MEM_READ_ONLY, POINTS, NULL);
    const ovoid_status wanted = OVOID_ERROR_ARGUMENT;
#define REFUSED(points, count, v, g, text)                                                         \
    test_refused(p.context,                                                                        \
                 ovoid_field_evaluate_opencl(p.context, p.field, (points), (count), (v), (g)),     \
                 wanted, text)
    REFUSED(p.xyz, POINTS + 1, value, NULL, "value holds 1200 bytes, and 1204 are needed");
    REFUSED(p.xyz, POINTS, value, value, "gradient holds");
    REFUSED(p.xyz, POINTS, read_only, NULL, "value is a buffer that kernels only read");
    const double odd[3] = {0.0, NAN, 0.0};
    REFUSED(odd, 1, value, NULL, "point 0 has a coordinate that is not finite");
#undef REFUSED
    test_refused(p.context,
                 ovoid_field_evaluate_buffer(p.context, p.field, value, POINTS, value, NULL),
                 wanted, "xyz holds");
    ovoid_field *field = make_field(*state); /* of Ovoid's own OpenCL context */
    test_refused(*state, ovoid_field_evaluate_opencl(*state, field, p.xyz, 1, value, NULL), wanted,
                 "value is a buffer of another OpenCL context");
    test_refused(p.context, ovoid_field_evaluate_opencl(p.context, field, p.xyz, 1, value, NULL),
                 wanted, "belongs to another context");
    ovoid_field_destroy(&field);
    clReleaseMemObject(value);
    clReleaseMemObject(read_only);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_arrive_in_the_callers_buffers),
        cmocka_unit_test(only_what_was_asked_for),
        cmocka_unit_test(handles_are_counted),
        cmocka_unit_test(a_queue_that_tells_times),
        cmocka_unit_test(queues_that_do_not_fit),
        cmocka_unit_test(buffers_that_do_not_fit),
    };
    return cmocka_run_group_tests(tests, make_program, drop_program);
}
