#include "mesh/brick_grid.h"

#include "field/bricks.h"

#include <stdlib.h>
#include <string.h>

static void list_faces(ov_brick_grid *grid) {
    const uint64_t *const n = grid->bricks;
    size_t k = 0;
    for (uint64_t z = 0; z < n[2]; ++z)
        for (uint64_t y = 0; y < n[1]; ++y)
            grid->face[k++] = ov_brick_number(grid, 0, y, z);
    for (uint64_t z = 0; z < n[2]; ++z)
        for (uint64_t x = 0; x < n[0]; ++x)
            grid->face[k++] = ov_brick_number(grid, x, 0, z);
    for (uint64_t y = 0; y < n[1]; ++y)
        for (uint64_t x = 0; x < n[0]; ++x)
            grid->face[k++] = ov_brick_number(grid, x, y, 0);
}

/* In the order in which fill_ghosts() takes them from the neighbours' faces. */
static void list_ghosts(ov_brick_grid *grid) {
    const uint64_t *const n = grid->bricks;
    uint32_t *next = grid->ghost;
    for (uint64_t z = 0; z < n[2]; ++z)
        for (uint64_t y = 0; y < n[1]; ++y)
            *next++ = ov_brick_number(grid, n[0], y, z);
    for (uint64_t z = 0; z < n[2]; ++z)
        for (uint64_t x = 0; x < n[0]; ++x)
            *next++ = ov_brick_number(grid, x, n[1], z);
    for (uint64_t y = 0; y < n[1]; ++y)
        for (uint64_t x = 0; x < n[0]; ++x)
            *next++ = ov_brick_number(grid, x, y, n[2]);
    for (uint64_t z = 0; z < n[2]; ++z)
        *next++ = ov_brick_number(grid, n[0], n[1], z);
    for (uint64_t y = 0; y < n[1]; ++y)
        *next++ = ov_brick_number(grid, n[0], y, n[2]);
    for (uint64_t x = 0; x < n[0]; ++x)
        *next++ = ov_brick_number(grid, x, n[1], n[2]);
    *next = ov_brick_number(grid, n[0], n[1], n[2]);
}

/* Evaluated bricks come first among the packs, along the curve; then the others. */
static void place_bricks(ov_brick_grid *grid) {
    const uint64_t nx = grid->bricks[0], ny = grid->bricks[1];
    for (size_t k = 0; k < grid->total; ++k) {
        const uint32_t brick = grid->curve[k];
        grid->place[ov_brick_number(grid, brick % nx, brick / nx % ny, brick / (nx * ny))] =
            (uint32_t)k;
    }
    for (size_t k = 0; k < grid->ghosts; ++k)
        grid->place[grid->ghost[k]] = (uint32_t)(grid->total + k);
}

ovoid_status ov_brick_grid_create(ovoid_context *context, const uint64_t points[3],
                                  ov_brick_grid *grid) {
    static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};
    const uint64_t *const n = grid->bricks;
    for (int axis = 0; axis < 3; ++axis) {
        grid->bricks[axis] = points[axis] / brick[axis];
        grid->padded[axis] = grid->bricks[axis] + 1;
    }
    grid->total = n[0] * n[1] * n[2];
    grid->padded_total = grid->padded[0] * grid->padded[1] * grid->padded[2];
    grid->face_start[1] = n[1] * n[2];
    grid->face_start[2] = grid->face_start[1] + n[0] * n[2];
    grid->face_start[3] = grid->face_start[2] + n[0] * n[1];
    grid->ghosts = grid->padded_total - grid->total;
    grid->curve = ov_alloc(context, grid->total, sizeof *grid->curve, "lattice bricks");
    grid->face = ov_alloc(context, grid->face_start[3], sizeof *grid->face, "lattice bricks");
    grid->ghost = ov_alloc(context, grid->ghosts, sizeof *grid->ghost, "lattice bricks");
    grid->place = ov_alloc(context, grid->padded_total, sizeof *grid->place, "lattice bricks");
    if (!grid->curve || !grid->face || !grid->ghost || !grid->place)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_bricks_order(context, n, grid->curve);
    if (status != OVOID_OK)
        return status;
    list_faces(grid);
    list_ghosts(grid);
    place_bricks(grid);
    return OVOID_OK;
}

void ov_brick_grid_destroy(ov_brick_grid *grid) {
    free(grid->curve);
    free(grid->face);
    free(grid->ghost);
    free(grid->place);
    memset(grid, 0, sizeof *grid);
}
