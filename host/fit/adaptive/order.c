#include "fit/adaptive/search.h"

#include <stdlib.h>
#include <string.h>

/* Cells of the curve (angstrom): less than ellipsoids are apart, for the most part. */
#define CELL 2.0

static bool is_sorted(const uint32_t *order, size_t count) {
    size_t i = 0;
    while (i < count && order[i] == i)
        ++i;
    return i == count;
}

/* Place i is to hold what place order[i] holds. */
static ovoid_status find_order(ov_adaptive *f, const ov_trial *t, uint32_t *order) {
    double *const centre = ov_alloc(f->context, 3 * t->count, sizeof *centre, "centres");
    if (!centre)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < t->count; ++i)
        memcpy(centre + 3 * i, t->x + i * OV_FACTOR_PARAMETERS + OV_FACTOR_CENTRE,
               3 * sizeof *centre);
    const ovoid_status status = ov_curve_order(f->context, centre, t->count, CELL, order);
    free(centre);
    return status;
}

/* rank[i]: where what was in place i is now. */
static void move(const uint32_t *order, const uint32_t *rank, const double *from, ov_trial *t) {
    for (size_t i = 0; i < t->count; ++i)
        memcpy(t->x + i * OV_FACTOR_PARAMETERS, from + order[i] * (size_t)OV_FACTOR_PARAMETERS,
               OV_FACTOR_PARAMETERS * sizeof *from);
    for (size_t k = 0; k < t->atoms; ++k)
        t->owner[k] = rank[t->owner[k]];
}

ovoid_status ov_adaptive_sort(ov_adaptive *f, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    const size_t size = t->count * OV_FACTOR_PARAMETERS;
    double *const from = ov_alloc(f->context, size, sizeof *from, "parameters");
    uint32_t *const order = ov_alloc(f->context, 2 * t->count, sizeof *order, "an order");
    uint32_t *const rank = order ? order + t->count : NULL;
    if (!from || !order) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(find_order(f, t, order));
    if (is_sorted(order, t->count))
        goto cleanup;
    for (size_t i = 0; i < t->count; ++i)
        rank[order[i]] = (uint32_t)i;
    memcpy(from, t->x, size * sizeof *from);
    move(order, rank, from, t);
    ov_refiner_forget(&f->refiner); /* its lists and skins are by place */
cleanup:
    free(from);
    free(order);
    return status;
}
