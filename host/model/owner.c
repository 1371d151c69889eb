#include "model/owner.h"

#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What sharing out the atoms of split ellipsoids takes note of, per ellipsoid. */
typedef struct half {
    size_t atoms;
    uint32_t readiest; /* of them, the one that loses least by going to the other half */
    double loss;
} half;

/* Each atom to the half with the larger value. */
static void share_out(const double *xyzr, size_t atoms, const ov_quadric *quadrics,
                      const uint32_t *twin, half *halves, uint32_t *owner) {
    for (size_t i = 0; i < atoms; ++i) {
        const uint32_t whole = owner[i], other = twin[whole];
        double loss = INFINITY;
        if (other != UINT32_MAX) {
            const double *const at = xyzr + 4 * i;
            loss = ov_quadric_log_value(&quadrics[whole], at) -
                   ov_quadric_log_value(&quadrics[other], at);
        }
        if (loss < 0.0)
            owner[i] = other;
        half *const own = &halves[owner[i]];
        if (own->atoms++ == 0 || fabs(loss) < own->loss) {
            own->readiest = (uint32_t)i;
            own->loss = fabs(loss);
        }
    }
}

ovoid_status ov_owner_split(ovoid_context *context, const double *xyzr, size_t atoms,
                            const ov_quadric *quadrics, size_t count, const uint32_t *twin,
                            uint32_t *owner) {
    half *const halves = ov_alloc(context, count, sizeof *halves, "owners");
    if (!halves)
        return OVOID_ERROR_MEMORY;
    share_out(xyzr, atoms, quadrics, twin, halves, owner);
    for (size_t i = 0; i < count; ++i)
        if (twin[i] != UINT32_MAX && halves[i].atoms > 1 && halves[twin[i]].atoms == 0)
            owner[halves[i].readiest] = twin[i];
    free(halves);
    return OVOID_OK;
}

ovoid_status ov_owner_merge(ovoid_context *context, const uint32_t *parents, size_t count,
                            size_t before, const uint32_t *owner_before, size_t atoms,
                            uint32_t *owner) {
    uint32_t *const place = ov_alloc(context, before, sizeof *place, "owners");
    if (!place)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; ++i)
        for (size_t k = 0; k < 2 && parents[2 * i + k] != UINT32_MAX; ++k)
            place[parents[2 * i + k]] = (uint32_t)i;
    for (size_t i = 0; i < atoms; ++i)
        owner[i] = place[owner_before[i]];
    free(place);
    return OVOID_OK;
}

/* The one of those near with the largest value at the point, if that is above *log_value, which
 * becomes its; otherwise `best`. */
static uint32_t larger_at(const ov_quadric *quadrics, const uint32_t *near, size_t near_count,
                          const double at[3], uint32_t best, double *log_value) {
    for (size_t n = 0; n < near_count; ++n) {
        const double value = ov_quadric_log_value(&quadrics[near[n]], at);
        if (value > *log_value) {
            *log_value = value;
            best = near[n];
        }
    }
    return best;
}

ovoid_status ov_owner_tidy(ovoid_context *context, const double *xyzr, size_t atoms,
                           const ov_quadric *quadrics, size_t count, double share, double reach,
                           uint32_t *owner) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    uint32_t near[2 * OV_NEAR_MAX];
    size_t *const owned = ov_alloc(context, count, sizeof *owned, "owners");
    if (!owned)
        return OVOID_ERROR_MEMORY;
    memset(owned, 0, count * sizeof *owned);
    OV_TRY(ov_grid_of(context, quadrics->centre, sizeof *quadrics, count, reach, &grid));
    for (size_t i = 0; i < atoms; ++i)
        ++owned[owner[i]];
    for (size_t i = 0; i < atoms; ++i) {
        const double *const at = xyzr + 4 * i;
        double value = ov_quadric_log_value(&quadrics[owner[i]], at) - log(share);
        const size_t near_count = ov_grid_near(&grid, at, UINT32_MAX, near);
        const uint32_t best = larger_at(quadrics, near, near_count, at, owner[i], &value);
        if (owned[owner[i]] > 1) {
            --owned[owner[i]];
            ++owned[owner[i] = best];
        }
    }
cleanup:
    ov_grid_destroy(&grid);
    free(owned);
    return status;
}

uint32_t ov_owner_at(const ov_quadric *quadrics, size_t count, const double at[3]) {
    size_t best = 0;
    double largest = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
        const double value = ov_quadric_log_value(&quadrics[i], at);
        if (value > largest) {
            largest = value;
            best = i;
        }
    }
    return (uint32_t)best;
}
