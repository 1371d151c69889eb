#include "field/evaluate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Packs for which the host finds the terms. Measured on 8,000 atoms (bench/points): with more, the
 * device's lists are as fast. */
#define FEW_PACKS 24

#define SPREAD_GROUP 64

/* Cells of the curve along which points are put in packs, angstrom. */
#define CELL 1.0

/* ---- terms -------------------------------------------------------------------------------- */

/* Middle of the ellipsoids' centres: there float coordinates are finest. */
static void find_middle(ov_evaluator *e, const ov_quadric *quadrics, size_t count) {
    for (int axis = 0; axis < 3; ++axis) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; ++i) {
            low = fmin(low, quadrics[i].centre[axis]);
            high = fmax(high, quadrics[i].centre[axis]);
        }
        e->origin[axis] = count ? 0.5 * low + 0.5 * high : 0.0;
    }
}

/* The box of all that the terms reach. */
static void find_box(ov_evaluator *e, const ov_quadric *quadrics, size_t count) {
    for (int axis = 0; axis < 3; ++axis) {
        e->low[axis] = INFINITY;
        e->high[axis] = -INFINITY;
    }
    for (size_t i = 0; i < count; ++i) {
        double half[3];
        if (!ov_quadric_reach(&quadrics[i], OV_TARGET_CUTOFF, half))
            continue;
        for (int axis = 0; axis < 3; ++axis) {
            e->low[axis] = fmin(e->low[axis], quadrics[i].centre[axis] - half[axis]);
            e->high[axis] = fmax(e->high[axis], quadrics[i].centre[axis] + half[axis]);
        }
    }
}

ovoid_status ov_evaluator_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                                 ov_evaluator *evaluator) {
    ov_evaluator made = {.quadrics = quadrics, .count = count, .lists.packs_only = true};
    find_middle(&made, quadrics, count);
    find_box(&made, quadrics, count);
    const ovoid_status status =
        ov_terms_set(context, &made.terms, quadrics, count, made.origin, OV_TARGET_CUTOFF);
    if (status == OVOID_OK)
        *evaluator = made;
    else
        ov_evaluator_destroy(&made);
    return status;
}

void ov_evaluator_destroy(ov_evaluator *evaluator) {
    ov_terms_destroy(&evaluator->terms);
    ov_lists_destroy(&evaluator->lists);
    ov_near_destroy(&evaluator->near);
    ov_operations_destroy(&evaluator->operations);
    ov_buffer_destroy(&evaluator->value);
    ov_buffer_destroy(&evaluator->gradient);
    ov_buffer_destroy(&evaluator->to);
    ov_kernel_destroy(&evaluator->spread);
    free(evaluator->xyz);
    free(evaluator->index);
    free(evaluator->results);
    memset(evaluator, 0, sizeof *evaluator);
}

/* ---- points ------------------------------------------------------------------------------- */

static bool is_within(const ov_evaluator *e, const double *p) {
    return p[0] >= e->low[0] && p[0] <= e->high[0] && p[1] >= e->low[1] && p[1] <= e->high[1] &&
           p[2] >= e->low[2] && p[2] <= e->high[2];
}

/* Lists the piece's points within the box. Those beyond may be so far out that their squares exceed
 * a float's range, and the device never sees them. */
static ovoid_status take_points(ovoid_context *context, ov_evaluator *e, const double *xyz,
                                size_t count, size_t *taken) {
    ovoid_status status = OVOID_OK;
    size_t within = 0;
    for (size_t k = 0; k < count; ++k)
        within += is_within(e, xyz + 3 * k);
    OV_TRY(ov_grow(context, &e->xyz, &e->xyz_capacity, 3 * within, sizeof *e->xyz, "points"));
    OV_TRY(ov_grow(context, &e->index, &e->index_capacity, within, sizeof *e->index, "points"));
    *taken = 0;
    for (size_t k = 0; k < count; ++k)
        if (is_within(e, xyz + 3 * k)) {
            memcpy(e->xyz + 3 * *taken, xyz + 3 * k, 3 * sizeof *xyz);
            e->index[(*taken)++] = (uint32_t)k;
        }
cleanup:
    return status;
}

static ovoid_status pair(ovoid_context *context, ov_evaluator *e, const ov_points *points) {
    ovoid_status status = OVOID_OK;
    if (points->packs > FEW_PACKS)
        return ov_lists_build(context, &e->lists, points, &e->terms, 0.0);
    if (!e->near.term)
        OV_TRY(
            ov_near_create(context, e->quadrics, e->count, e->origin, OV_TARGET_CUTOFF, &e->near));
    OV_TRY(ov_near_lists(context, &e->near, points, e->xyz, &e->lists));
cleanup:
    return status;
}

/* Values, and gradients if they are wanted, at the packs, on the device. */
static ovoid_status launch_packs(ovoid_context *context, ov_evaluator *e, const ov_points *points,
                                 bool with_gradient) {
    ovoid_status status = OVOID_OK;
    OV_TRY(pair(context, e, points));
    if (with_gradient)
        OV_TRY(ov_field_gradient(context, &e->operations, points, &e->terms, &e->lists, &e->value,
                                 &e->gradient));
    else
        OV_TRY(ov_field(context, &e->operations, points, &e->terms, &e->lists, &e->value));
cleanup:
    return status;
}

/* The same into e->results. */
static ovoid_status evaluate_packs(ovoid_context *context, ov_evaluator *e, const ov_points *points,
                                   bool with_gradient) {
    ovoid_status status = OVOID_OK;
    const size_t values = points->packs * OV_PACK;
    OV_TRY(ov_grow(context, &e->results, &e->results_capacity, values * (with_gradient ? 4 : 1),
                   sizeof *e->results, "values at points"));
    OV_TRY(launch_packs(context, e, points, with_gradient));
    OV_TRY(ov_buffer_read(context, &e->value, 0, e->results, values * sizeof *e->results));
    if (with_gradient)
        OV_TRY(ov_buffer_read(context, &e->gradient, 0, e->results + values,
                              3 * values * sizeof *e->results));
cleanup:
    return status;
}

/* Hands the packs' results out to the piece's points; what fills a pack up repeats one of them. */
static void spread(const ov_evaluator *e, const ov_points *points, float *value, float *gradient) {
    const size_t values = points->packs * OV_PACK;
    for (size_t k = 0; k < values; ++k) {
        const size_t to = e->index[points->order[k]];
        const float *const g = e->results + values + k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        value[to] = e->results[k];
        for (size_t axis = 0; gradient && axis < 3; ++axis)
            gradient[3 * to + axis] = g[axis * OV_PACK];
    }
}

static ovoid_status run_piece(ovoid_context *context, ov_evaluator *e, const double *xyz,
                              size_t count, float *value, float *gradient) {
    ovoid_status status = OVOID_OK;
    ov_points points = {0};
    size_t taken = 0;
    OV_TRY(take_points(context, e, xyz, count, &taken));
    if (taken > 0) {
        OV_TRY(ov_points_create(context, e->xyz, taken, e->origin, CELL, &points));
        OV_TRY(evaluate_packs(context, e, &points, gradient != NULL));
    }
    memset(value, 0, count * sizeof *value);
    if (gradient)
        memset(gradient, 0, 3 * count * sizeof *gradient);
    spread(e, &points, value, gradient);
cleanup:
    ov_points_destroy(&points);
    return status;
}

ovoid_status ov_evaluator_run(ovoid_context *context, ov_evaluator *evaluator, const double *xyz,
                              size_t count, float *value, float *gradient) {
    ovoid_status status = OVOID_OK;
    for (size_t first = 0; first < count; first += OV_EVALUATE_PIECE) {
        const size_t some = count - first < OV_EVALUATE_PIECE ? count - first : OV_EVALUATE_PIECE;
        OV_TRY(run_piece(context, evaluator, xyz + 3 * first, some, value + first,
                         gradient ? gradient + 3 * first : NULL));
    }
cleanup:
    return status;
}

/* ---- into the caller's buffers ------------------------------------------------------------- */

#define NOBODY UINT32_MAX /* as in kernels/spread.cl */

/* Tells the device whose places of the packs are. */
static ovoid_status put_order(ovoid_context *context, ov_evaluator *e, const ov_points *points) {
    const size_t places = points->packs * OV_PACK;
    uint32_t *const to = ov_alloc(context, places, sizeof *to, "the order of the points");
    if (!to)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < places; ++k)
        to[k] = ov_points_fill(points, k) ? NOBODY : e->index[points->order[k]];
    const ovoid_status status =
        ov_buffer_put(context, &e->to, to, places * sizeof *to, "the order of the points");
    free(to);
    return status;
}

static ovoid_status launch_spread(ovoid_context *context, ov_evaluator *e, const ov_points *points,
                                  size_t first, cl_mem value, cl_mem gradient) {
    ovoid_status status = OVOID_OK;
    const cl_uint places = (cl_uint)(points->packs * OV_PACK);
    const cl_ulong from = first;
    if (!e->spread.handle)
        OV_TRY(ov_kernel_create(context, "spread", "spread", &e->spread));
    const cl_mem slopes = gradient ? e->gradient.memory : e->value.memory;
    OV_TRY(OV_LAUNCH(context, &e->spread, places, SPREAD_GROUP, OV_ARG(places), OV_ARG(from),
                     OV_ARG(e->to.memory), OV_ARG(e->value.memory), OV_ARG(slopes), OV_ARG(value),
                     OV_ARG(gradient)));
cleanup:
    return status;
}

ovoid_status ov_evaluator_put(ovoid_context *context, ov_evaluator *evaluator, const double *xyz,
                              size_t count, size_t first, cl_mem value, cl_mem gradient) {
    ovoid_status status = OVOID_OK;
    ov_evaluator *const e = evaluator;
    ov_points points = {0};
    size_t taken = 0;
    OV_TRY(take_points(context, e, xyz, count, &taken));
    if (taken == 0)
        return OVOID_OK;
    OV_TRY(ov_points_create(context, e->xyz, taken, e->origin, CELL, &points));
    OV_TRY(put_order(context, e, &points));
    OV_TRY(launch_packs(context, e, &points, gradient != NULL));
    OV_TRY(launch_spread(context, e, &points, first, value, gradient));
cleanup:
    ov_points_destroy(&points);
    return status;
}

/* ---- checks ------------------------------------------------------------------------------- */

ovoid_status ov_points_check(ovoid_context *context, const double *xyz, size_t count) {
    for (size_t k = 0; k < 3 * count; ++k)
        if (!isfinite(xyz[k]))
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "point %zu has a coordinate that is not finite", k / 3);
    return OVOID_OK;
}
