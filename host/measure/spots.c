#include "measure/judging.h"
#include "neighbours/neighbours.h"

#include <stdlib.h>

ovoid_status ov_list_spot(const double at[3], double distance, void *listing) {
    const ov_listing *const l = listing;
    ov_spot_list *const spots = l->spots;
    const ovoid_status status = ov_grow(l->context, (void *)&spots->spot, &spots->capacity,
                                        spots->count + 1, sizeof *spots->spot, "spots");
    if (status == OVOID_OK)
        spots->spot[spots->count++] = (ov_spot){.at = {at[0], at[1], at[2]}, .distance = distance};
    return status;
}

bool ov_spots_near(const ov_spot *spots, size_t count, const double at[3], double reach) {
    for (size_t n = 0; n < count; ++n) {
        const double x = at[0] - spots[n].at[0], y = at[1] - spots[n].at[1],
                     z = at[2] - spots[n].at[2];
        if (x * x + y * y + z * z < reach * reach)
            return true;
    }
    return false;
}

/* What rounding may add to a distance in a grid, as a share. */
#define ROUNDING 1e-4

/* Whether one of the spots in the grid is nearer than that. */
static bool has_near(const ov_grid *grid, const ov_spot *spots, const double at[3], double apart) {
    uint32_t near[2 * OV_NEAR_MAX];
    const size_t count = ov_grid_near(grid, at, UINT32_MAX, near);
    for (size_t n = 0; n < count; ++n) {
        double square = 0.0;
        for (size_t k = 0; k < 3; ++k)
            square += (at[k] - spots[near[n]].at[k]) * (at[k] - spots[near[n]].at[k]);
        if (square < apart * apart)
            return true;
    }
    return false;
}

/* The worst first. */
static int by_distance(const void *a, const void *b) {
    const ov_spot *const p = a, *const q = b;
    if (p->distance != q->distance)
        return p->distance > q->distance ? -1 : 1;
    for (int k = 0; k < 3; ++k)
        if (p->at[k] != q->at[k])
            return p->at[k] < q->at[k] ? -1 : 1;
    return 0;
}

ovoid_status ov_spots_thin(ovoid_context *context, ov_spot *spots, size_t *count, double apart,
                           size_t most) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    size_t kept = 0;
    if (*count == 0)
        return OVOID_OK;
    qsort(spots, *count, sizeof *spots, by_distance);
    if (apart > 0.0)
        OV_TRY(ov_grid_about(context, spots->at, sizeof *spots, *count, (1.0 + ROUNDING) * apart,
                             &grid));
    for (size_t n = 0; n < *count && kept < most; ++n) {
        if (apart > 0.0 && has_near(&grid, spots, spots[n].at, apart))
            continue;
        spots[kept] = spots[n];
        if (apart > 0.0)
            OV_TRY(ov_grid_add(context, &grid, spots[kept].at, (uint32_t)kept));
        ++kept;
    }
    *count = kept;
cleanup:
    ov_grid_destroy(&grid);
    return status;
}
