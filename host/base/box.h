/*
 * Boxes along the axes.
 */
#ifndef OV_BOX_H
#define OV_BOX_H

#include "base/rigid.h"

typedef struct ov_box {
    double low[3], high[3]; /* angstrom */
} ov_box;

/* A box with nothing in it, for what is added. */
extern const ov_box ov_box_empty;

/* Makes a box so large that a point is in it, and all within `about` of that along the axes. */
void ov_box_add(ov_box *box, const double at[3], double about);

/* Whether two boxes are no further apart than that along each axis, angstrom. */
bool ov_boxes_near(const ov_box *a, const ov_box *b, double distance);

/* What lies in both; the low end is above the high one where that is nothing. */
ov_box ov_box_common(const ov_box *a, const ov_box *b);

/* The box and all that is so near to it along the axes, angstrom. */
ov_box ov_box_larger(const ov_box *box, double by);

/* A box about the moved box. */
ov_box ov_box_move(const ov_box *box, const ov_rigid *rigid);

/* Whether a point is no further from the box than that along each axis. */
bool ov_box_near(const ov_box *box, const double at[3], double distance);

/* How far a point is from the box, angstrom. */
double ov_box_distance(const ov_box *box, const double at[3]);

#endif
