/*
 * Lattice points in bricks, each of them a pack: what sampling and meshing evaluate phi on.
 */
#ifndef OV_BRICKS_H
#define OV_BRICKS_H

#include "field/field.h"

/* Where point j of a brick lies, in lattice points from the brick's first one. */
static inline void ov_brick_point(uint64_t j, uint64_t within[3]) {
    within[0] = j % OV_BRICK_X;
    within[1] = j / OV_BRICK_X % OV_BRICK_Y;
    within[2] = j / (OV_BRICK_X * OV_BRICK_Y);
}

/* order[k] = the k-th brick along a space-filling curve, of bricks[0] x bricks[1] x bricks[2]
 * numbered in raster order (x fastest). */
ovoid_status ov_bricks_order(ovoid_context *context, const uint64_t bricks[3], uint32_t *order);

/* Uploads the bricks as packs in this order, with points `step` angstrom apart and relative to the
 * first one. alike: each brick has its points where the first one has them about its origin, to
 * rounding, and the device holds them once. Free with ov_points_destroy(). */
ovoid_status ov_bricks_upload(ovoid_context *context, const uint64_t bricks[3],
                              const uint32_t *order, const double step[3], bool alike,
                              ov_points *points);

#endif
