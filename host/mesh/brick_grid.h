/*
 * How the bricks of a piece of the lattice are numbered, and which of them touch other pieces.
 */
#ifndef OV_BRICK_GRID_H
#define OV_BRICK_GRID_H

#include "base/base.h"

/* Bricks of a piece, within a grid with one more along each axis for its neighbours' first ones. */
typedef struct ov_brick_grid {
    uint64_t bricks[3], padded[3];
    size_t total, padded_total;
    uint32_t *curve; /* the bricks, raster numbers, along a space-filling curve */
    uint32_t *face;  /* the first bricks along x, then y, then z, numbers in the padded grid */
    size_t face_start[4];
    uint32_t *ghost; /* those beyond the last ones: along x, y, z, xy, xz, yz, xyz */
    size_t ghosts;
    uint32_t *place; /* pack with the values of a brick of the padded grid */
} ov_brick_grid;

/* Number of a brick in the padded grid. */
static inline uint32_t ov_brick_number(const ov_brick_grid *grid, uint64_t x, uint64_t y,
                                       uint64_t z) {
    return (uint32_t)((z * grid->padded[1] + y) * grid->padded[0] + x);
}

/* For pieces of this many points, whole bricks. The grid may be destroyed also after a failure. */
ovoid_status ov_brick_grid_create(ovoid_context *context, const uint64_t points[3],
                                  ov_brick_grid *grid);
void ov_brick_grid_destroy(ov_brick_grid *grid);

#endif
