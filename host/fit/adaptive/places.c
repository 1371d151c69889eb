#include "fit/adaptive/places.h"

#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_spots_destroy(ov_spots *spots) {
    free(spots->spot);
    *spots = (ov_spots){0};
}

ovoid_status ov_spots_copy(ovoid_context *context, const ov_spots *from, ov_spots *to) {
    ov_spot *const copy = ov_copy(context, from->spot, from->count, sizeof *copy, "spots");
    if (!copy)
        return OVOID_ERROR_MEMORY;
    ov_spots_destroy(to);
    *to = (ov_spots){.spot = copy, .count = from->count};
    return OVOID_OK;
}

void ov_places_destroy(ov_places *places) {
    free(places->place);
    *places = (ov_places){0};
}

static double squared_distance(const double a[3], const double b[3]) {
    double square = 0.0;
    for (int k = 0; k < 3; ++k)
        square += (a[k] - b[k]) * (a[k] - b[k]);
    return square;
}

/* The nearest of the grid's places to a point, UINT32_MAX if none is within its reach. */
static uint32_t nearest(const ov_places *places, const ov_grid *grid, const double at[3]) {
    uint32_t near[2 * OV_NEAR_MAX], best = UINT32_MAX;
    double least = grid->reach * grid->reach; /* they may have moved */
    const size_t count = ov_grid_near(grid, at, UINT32_MAX, near);
    for (size_t n = 0; n < count; ++n) {
        const double square = squared_distance(places->place[near[n]].at, at);
        if (square < least) {
            least = square;
            best = near[n];
        }
    }
    return best;
}

ovoid_status ov_places_add(ovoid_context *context, ov_places *places, const double at[3]) {
    const ovoid_status status = ov_grow(context, &places->place, &places->capacity,
                                        places->count + 1, sizeof *places->place, "places");
    if (status == OVOID_OK) {
        ov_place *const place = &places->place[places->count++];
        place->met = 1;
        memcpy(place->at, at, sizeof place->at);
    }
    return status;
}

ovoid_status ov_places_meet(ovoid_context *context, ov_places *places, const ov_spots *spots,
                            double reach, uint32_t *before) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    const bool any = places->count > 0;
    if (any)
        OV_TRY(ov_grid_of(context, places->place->at, sizeof *places->place, places->count, reach,
                          &grid));
    for (size_t n = 0; n < spots->count; ++n) {
        const uint32_t found = any ? nearest(places, &grid, spots->spot[n].at) : UINT32_MAX;
        before[n] = 0;
        if (found == UINT32_MAX) {
            OV_TRY(ov_places_add(context, places, spots->spot[n].at));
            continue;
        }
        before[n] = places->place[found].met++;
        memcpy(places->place[found].at, spots->spot[n].at, sizeof spots->spot[n].at);
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

ovoid_status ov_near_spots(ovoid_context *context, const ov_spots *spots, const double *points,
                           size_t stride, size_t count, double reach, bool *near) {
    ov_grid grid = {0};
    uint32_t found[2 * OV_NEAR_MAX];
    memset(near, 0, count * sizeof *near);
    if (spots->count == 0)
        return OVOID_OK;
    const ovoid_status status =
        ov_grid_of(context, spots->spot->at, sizeof *spots->spot, spots->count, reach, &grid);
    for (size_t n = 0; n < count && status == OVOID_OK; ++n) {
        const double *const at = (const double *)((const char *)points + n * stride);
        near[n] = ov_grid_near(&grid, at, UINT32_MAX, found) > 0;
    }
    ov_grid_destroy(&grid);
    return status;
}
