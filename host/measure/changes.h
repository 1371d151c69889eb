/*
 * Where a mixture is not what it was: boxes about the Gaussians that came, went or changed.
 */
#ifndef OV_CHANGES_H
#define OV_CHANGES_H

#include "base/base.h"
#include "base/box.h"
#include "field/quadric.h"

/* Of more Gaussians than this nobody asks where they are. */
#define OV_CHANGES_MOST 256

typedef struct ov_change {
    const ov_quadric *before, *now;
    size_t before_count, now_count;
    double floor; /* a Gaussian counts where its value is at least this; above 0 */
    double about; /* the boxes are so much larger than what counts, angstrom */
    double room;  /* what a box is looked at with about it, angstrom: two are one where that is less
                     to look at */
} ov_change;

/* The boxes, which may overlap: OV_CHANGES_MOST at most, for which there is room. *few: whether so
 * few changed; else there are no boxes. The order of the Gaussians does not matter. */
ovoid_status ov_changes_find(ovoid_context *context, const ov_change *change, ov_box *box,
                             size_t *count, bool *few);

#endif
