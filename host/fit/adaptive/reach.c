#include "fit/adaptive/reach.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Those that reach this many times as far as ellipsoids do on average are wide. */
#define WIDE 1.5

/* How far from its centre an ellipsoid is felt at most (angstrom), rounding included. */
static double radius_of(const double *x, double log_least) {
    const double above = x[0] - log_least;
    return above > 0.0 ? 1.001 * sqrt(above / ov_factor_least_decay(x)) + 1e-3 : 0.0;
}

/* Those that are nowhere felt are left out. */
static ovoid_status sort_out(ovoid_context *context, const double *x, const double *radius,
                             ov_reach *r) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < r->count; ++i) {
        const double *const own = x + i * OV_FACTOR_PARAMETERS;
        if (radius[i] > r->grid.reach)
            r->wide[r->wide_count++] = (uint32_t)i;
        else if (radius[i] > 0.0)
            OV_TRY(ov_grid_add(context, &r->grid, own + OV_FACTOR_CENTRE, (uint32_t)i));
    }
cleanup:
    return status;
}

ovoid_status ov_reach_create(ovoid_context *context, const double *x, size_t count,
                             double log_least, ov_reach *reach) {
    ovoid_status status = OVOID_OK;
    double sum = 0.0;
    *reach = (ov_reach){.count = count, .log_least = log_least};
    double *const radius = ov_alloc(context, count, sizeof *radius, "reaches");
    reach->quadrics = ov_alloc(context, count, sizeof *reach->quadrics, "ellipsoids");
    reach->wide = ov_alloc(context, count, sizeof *reach->wide, "ellipsoids");
    if (!radius || !reach->quadrics || !reach->wide) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t i = 0; i < count; ++i) {
        ov_factor_quadric(x + i * OV_FACTOR_PARAMETERS, &reach->quadrics[i]);
        radius[i] = radius_of(x + i * OV_FACTOR_PARAMETERS, log_least);
        sum += radius[i];
    }
    if (count > 0) {
        OV_TRY(ov_grid_about(context, x + OV_FACTOR_CENTRE, OV_FACTOR_PARAMETERS * sizeof *x, count,
                             fmax(WIDE * sum / (double)count, 1e-3), &reach->grid));
        OV_TRY(sort_out(context, x, radius, reach));
    }
cleanup:
    free(radius);
    if (status != OVOID_OK)
        ov_reach_destroy(reach);
    return status;
}

void ov_reach_destroy(ov_reach *reach) {
    free(reach->quadrics);
    free(reach->wide);
    ov_grid_destroy(&reach->grid);
    *reach = (ov_reach){0};
}

static bool is_felt(const ov_reach *r, uint32_t i, const double at[3]) {
    return ov_quadric_log_value(&r->quadrics[i], at) > r->log_least;
}

/* Where there may be more near than the grid tells, all are asked. */
size_t ov_reach_at(const ov_reach *r, const double at[3], uint32_t *found) {
    uint32_t near[2 * OV_NEAR_MAX];
    size_t count = 0;
    const size_t listed = r->count > 0 ? ov_grid_near(&r->grid, at, UINT32_MAX, near) : 0;
    const bool crowd = listed >= OV_NEAR_MAX;
    for (uint32_t i = 0; crowd && i < r->count; ++i)
        if (is_felt(r, i, at))
            found[count++] = i;
    for (size_t n = 0; !crowd && n < listed; ++n)
        if (is_felt(r, near[n], at))
            found[count++] = near[n];
    for (size_t n = 0; !crowd && n < r->wide_count; ++n)
        if (is_felt(r, r->wide[n], at))
            found[count++] = r->wide[n];
    return count;
}
