/*
 * Places of a molecule where its model is off, and how often that was met: so that the search for
 * the fewest ellipsoids keeps its account by place, and one stubborn place costs the rest nothing.
 */
#ifndef OV_PLACES_H
#define OV_PLACES_H

#include "measure/judge.h"

typedef struct ov_spots {
    ov_spot *spot;
    size_t count;
} ov_spots;
void ov_spots_destroy(ov_spots *spots);
/* *to has others before, or none. */
ovoid_status ov_spots_copy(ovoid_context *context, const ov_spots *from, ov_spots *to);

typedef struct ov_place {
    double at[3]; /* angstrom: where it was off last */
    uint32_t met; /* how often */
} ov_place;

typedef struct ov_places {
    ov_place *place;
    size_t count, capacity;
} ov_places;
void ov_places_destroy(ov_places *places);

/* before[n]: how often the place of spot n, the nearest within `reach` (angstrom), was met before;
 * now it was once more. A spot that is near none makes one. */
ovoid_status ov_places_meet(ovoid_context *context, ov_places *places, const ov_spots *spots,
                            double reach, uint32_t *before);

/* Adds a place, whatever is near. */
ovoid_status ov_places_add(ovoid_context *context, ov_places *places, const double at[3]);

/* near[n]: whether point n (x, y, z each, `stride` bytes apart) is within reach of a spot. */
ovoid_status ov_near_spots(ovoid_context *context, const ov_spots *spots, const double *points,
                           size_t stride, size_t count, double reach, bool *near);

#endif
