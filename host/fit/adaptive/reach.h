/*
 * Which ellipsoids are felt at a place: found through a grid of their centres, so that asking for
 * many places costs less than places times ellipsoids.
 */
#ifndef OV_REACH_H
#define OV_REACH_H

#include "model/factor.h"
#include "neighbours/neighbours.h"

typedef struct ov_reach {
    ov_quadric *quadrics;
    size_t count;
    double log_least;
    ov_grid grid;   /* of the centres of those that reach no further than its reach */
    uint32_t *wide; /* the others */
    size_t wide_count;
} ov_reach;

/* Of ellipsoids (OV_FACTOR_PARAMETERS each), which are felt where the logarithm of their value is
 * above log_least. */
ovoid_status ov_reach_create(ovoid_context *context, const double *x, size_t count,
                             double log_least, ov_reach *reach);
void ov_reach_destroy(ov_reach *reach);

/* The ellipsoids felt at a place, each once in any order; found has room for all. Returns how many.
 */
size_t ov_reach_at(const ov_reach *reach, const double at[3], uint32_t *found);

#endif
