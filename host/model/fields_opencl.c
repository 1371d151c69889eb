/* Values of fields in the caller's OpenCL buffers. */
#include "model/fields.h"

#include "base/progress.h"
#include "ovoid/opencl.h"

#include <stdlib.h>

typedef struct request {
    ovoid_field *field;
    const double *xyz; /* one of the two */
    cl_mem points;
    size_t count;
    cl_mem value, gradient;
} request;

static ovoid_status check(ovoid_context *context, const request *r) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    OV_TRY(ov_field_check(context, r->field));
    OV_TRY(ov_device_get(context, &device));
    if (r->count > SIZE_MAX / (3 * sizeof(float)))
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu points are too many", r->count);
    if (r->points)
        OV_TRY(ov_memory_check(context, r->points, 3 * r->count * sizeof(float), false, "xyz"));
    OV_TRY(ov_memory_check(context, r->value, r->count * sizeof(float), true, "value"));
    if (r->gradient)
        OV_TRY(
            ov_memory_check(context, r->gradient, 3 * r->count * sizeof(float), true, "gradient"));
cleanup:
    return status;
}

/* Points first .. first + some - 1 as the host has them. */
static ovoid_status read_points(ovoid_context *context, const request *r, size_t first, size_t some,
                                float *floats, double *xyz) {
    const ov_buffer theirs = {.memory = r->points, .bytes = 3 * r->count * sizeof *floats};
    const ovoid_status status = ov_buffer_read(context, &theirs, 3 * first * sizeof *floats, floats,
                                               3 * some * sizeof *floats);
    for (size_t k = 0; status == OVOID_OK && k < 3 * some; ++k)
        xyz[k] = floats[k];
    return status;
}

static ovoid_status run(ovoid_context *context, const request *r) {
    ovoid_status status = OVOID_OK;
    ov_evaluator *evaluator;
    const size_t piece = r->count < OV_EVALUATE_PIECE ? r->count : OV_EVALUATE_PIECE;
    float *floats = NULL;
    double *read = NULL;
    if (r->points) {
        floats = ov_alloc(context, piece, 3 * sizeof *floats, "points");
        read = ov_alloc(context, piece, 3 * sizeof *read, "points");
        if (!floats || !read)
            OV_TRY(OVOID_ERROR_MEMORY);
    }
    OV_TRY(ov_field_load(context, r->field, &evaluator));
    OV_TRY(ov_memory_clear(context, r->value, r->count * sizeof(float)));
    if (r->gradient)
        OV_TRY(ov_memory_clear(context, r->gradient, 3 * r->count * sizeof(float)));
    for (size_t first = 0; first < r->count; first += piece) {
        const size_t some = r->count - first < piece ? r->count - first : piece;
        const double *const xyz = r->points ? read : r->xyz + 3 * first;
        if (r->points)
            OV_TRY(read_points(context, r, first, some, floats, read));
        OV_TRY(ov_points_check(context, xyz, some));
        OV_TRY(ov_evaluator_put(context, evaluator, xyz, some, first, r->value, r->gradient));
    }
cleanup:
    free(floats);
    free(read);
    return status;
}

static ovoid_status evaluate(ovoid_context *context, const request *r) {
    ov_progress_begin(context, "field");
    ovoid_status status = check(context, r);
    if (status == OVOID_OK && r->xyz)
        status = ov_points_check(context, r->xyz, r->count);
    if (status == OVOID_OK && r->count > 0)
        status = run(context, r);
    ov_progress_end(context);
    return status;
}

ovoid_status ovoid_field_evaluate_opencl(ovoid_context *context, ovoid_field *field,
                                         const double *xyz, size_t count, cl_mem value,
                                         cl_mem gradient) {
    OV_NEED(context, context);
    OV_NEED(context, field);
    OV_NEED(context, xyz);
    OV_NEED(context, value);
    const request r = {
        .field = field, .xyz = xyz, .count = count, .value = value, .gradient = gradient};
    return evaluate(context, &r);
}

ovoid_status ovoid_field_evaluate_buffer(ovoid_context *context, ovoid_field *field, cl_mem xyz,
                                         size_t count, cl_mem value, cl_mem gradient) {
    OV_NEED(context, context);
    OV_NEED(context, field);
    OV_NEED(context, xyz);
    OV_NEED(context, value);
    const request r = {
        .field = field, .points = xyz, .count = count, .value = value, .gradient = gradient};
    return evaluate(context, &r);
}
