#include "field/evaluate.h"

#include "field/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Points handled at once, which bounds the memory on the device. */
#define PIECE ((size_t)1 << 20)

typedef struct evaluator {
    double origin[3];
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
    ov_buffer value, gradient;
    float *xyz;     /* 3 * PIECE, relative to origin */
    float *results; /* 4 * (PIECE + OV_PACK): values, then gradients */
} evaluator;

/* Middle of the ellipsoids' centres: there float coordinates are finest. */
static void middle(const ov_quadric *quadrics, size_t count, double origin[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; ++i) {
            low = fmin(low, quadrics[i].centre[axis]);
            high = fmax(high, quadrics[i].centre[axis]);
        }
        origin[axis] = 0.5 * (low + high);
    }
}

/* A curve cell that holds a few points on average, whatever their spread. */
static double curve_resolution(const float *xyz, size_t count) {
    double extent = 0.0;
    for (size_t axis = 0; axis < 3; ++axis) {
        float low = xyz[axis], high = xyz[axis];
        for (size_t k = 1; k < count; ++k) {
            low = fminf(low, xyz[3 * k + axis]);
            high = fmaxf(high, xyz[3 * k + axis]);
        }
        extent = fmax(extent, (double)high - low);
    }
    return fmax(extent / (2.0 * cbrt((double)count)), 1e-3);
}

static ovoid_status evaluate_piece(ovoid_context *context, evaluator *e, const double *xyz,
                                   size_t count, double *value, double *gradient) {
    ovoid_status status = OVOID_OK;
    ov_points points = {0};
    for (size_t k = 0; k < 3 * count; ++k)
        e->xyz[k] = (float)(xyz[k] - e->origin[k % 3]);
    OV_TRY(ov_points_create(context, e->xyz, count, e->origin, curve_resolution(e->xyz, count),
                            &points));
    OV_TRY(ov_lists_build(context, &e->lists, &points, &e->terms, 0.0));
    OV_TRY(ov_field_gradient(context, &e->operations, &points, &e->terms, &e->lists, &e->value,
                             &e->gradient));
    const size_t values = points.packs * OV_PACK;
    float *const gradients = e->results + values;
    OV_TRY(ov_buffer_read(context, &e->value, 0, e->results, values * sizeof(float)));
    OV_TRY(ov_buffer_read(context, &e->gradient, 0, gradients, 3 * values * sizeof(float)));
    for (size_t k = 0; k < count; ++k) {
        const size_t to = points.order[k];
        const float *const g = gradients + k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        value[to] = e->results[k];
        for (size_t axis = 0; gradient && axis < 3; ++axis)
            gradient[3 * to + axis] = g[axis * OV_PACK];
    }
cleanup:
    ov_points_destroy(&points);
    return status;
}

static ovoid_status check_points(ovoid_context *context, const double *xyz, size_t count) {
    for (size_t k = 0; k < 3 * count; ++k)
        if (!isfinite(xyz[k]))
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "point %zu has a coordinate that is not finite", k / 3);
    return OVOID_OK;
}

ovoid_status ov_evaluate(ovoid_context *context, const ov_quadric *quadrics, size_t quadric_count,
                         const double *xyz, size_t count, double *value, double *gradient) {
    ovoid_status status = OVOID_OK;
    evaluator e = {.lists.packs_only = true};
    if (count == 0)
        return OVOID_OK;
    const size_t piece = count < PIECE ? count : PIECE;
    OV_TRY(check_points(context, xyz, count));
    e.xyz = ov_alloc(context, 3 * piece, sizeof *e.xyz, "points");
    e.results = ov_alloc(context, 4 * (piece + OV_PACK), sizeof *e.results, "values at points");
    if (!e.xyz || !e.results) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    middle(quadrics, quadric_count, e.origin);
    OV_TRY(ov_terms_set(context, &e.terms, quadrics, quadric_count, e.origin, OV_TARGET_CUTOFF));
    for (size_t first = 0; first < count; first += piece) {
        const size_t some = count - first < piece ? count - first : piece;
        OV_TRY(evaluate_piece(context, &e, xyz + 3 * first, some, value + first,
                              gradient ? gradient + 3 * first : NULL));
    }
cleanup:
    ov_terms_destroy(&e.terms);
    ov_lists_destroy(&e.lists);
    ov_operations_destroy(&e.operations);
    ov_buffer_destroy(&e.value);
    ov_buffer_destroy(&e.gradient);
    free(e.xyz);
    free(e.results);
    return status;
}
