/*
 * A fit in parts: cut, fitted one by one or side by side, and put together.
 */
#ifndef OV_FIT_PARTS_H
#define OV_FIT_PARTS_H

#include "base/rigid.h"
#include "fit/adaptive/adaptive.h"
#include "fit/parts/ranks.h"

/* Whether so many atoms are fitted in parts. */
bool ov_parts_wanted(const ovoid_fit_options *options, size_t atoms);

/* What a unit is repeated by: a group of motions, first the identity. */
typedef struct ov_images {
    const ov_rigid *motion;
    size_t count; /* 1: the unit is all there is */
} ov_images;

/* As ov_adaptive_reach() from the atoms, which are the unit of the assembly that its images make;
 * *found is of the unit, and so is a number of ellipsoids that is asked for. The parts that are
 * done when it is stopped, with the others' atoms as they are, are what held, where a tolerance is
 * the goal. On all ranks that share it, it comes to the same. */
ovoid_status ov_parts_reach(ovoid_context *context, const double *xyzr, size_t atoms,
                            const ov_images *images, const ovoid_fit_options *options, double began,
                            ov_ranks *ranks, ov_found *found, ovoid_fit_result *result);

#endif
