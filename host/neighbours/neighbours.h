/*
 * Cells of a uniform lattice, numbered as they are first met: a hash table, so that empty space
 * costs nothing. And, on top of it, who is near whom.
 */
#ifndef OV_NEIGHBOURS_H
#define OV_NEIGHBOURS_H

#include "base/base.h"

#define OV_NO_CELL UINT32_MAX

typedef struct ov_cells {
    double origin[3], edge; /* angstrom */
    double per_edge;        /* 1 / edge */
    size_t count;           /* numbered so far */
    size_t slots;           /* a power of two */
    uint32_t *table;        /* a cell's number, or OV_NO_CELL */
    int32_t (*place)[3];    /* of each numbered cell */
    size_t capacity;
} ov_cells;

ovoid_status ov_cells_create(ovoid_context *context, const double origin[3], double edge,
                             size_t expected, ov_cells *cells);
void ov_cells_destroy(ov_cells *cells);

/* The cell of a point. */
void ov_cells_place(const ov_cells *cells, const double point[3], int32_t place[3]);

/* Its number, or OV_NO_CELL if it has none yet. */
uint32_t ov_cells_find(const ov_cells *cells, const int32_t place[3]);

/* Its number; *added tells whether it is new. */
ovoid_status ov_cells_add(ovoid_context *context, ov_cells *cells, const int32_t place[3],
                          uint32_t *number, bool *added);

/* ---- who is near whom --------------------------------------------------------------------- */

typedef struct ov_neighbour {
    float offset[3]; /* of its centre from its cell's corner */
    uint32_t index;
} ov_neighbour;

/* The members of one cell: a stretch of the grid's pool. */
typedef struct ov_cell_members {
    size_t first;
    uint32_t count, capacity;
} ov_cell_members;

typedef struct ov_grid {
    ov_cells cells; /* edge >= reach */
    double reach;
    ov_cell_members *members; /* per cell */
    size_t members_capacity;
    ov_neighbour *pool;
    size_t used, capacity;
    uint32_t *where; /* per index: its place among its cell's members; NULL: nobody is taken out */
} ov_grid;

/* Where so many are near, or more than so many are asked whether they are, some will do: it bounds
 * the time that a crowd at one point takes. */
#define OV_NEAR_MAX 512
#define OV_ASKED_MAX 8192

/* An empty grid for about `expected` points in the box, with indices below `indices`; 0: they may
 * be any, and none is taken out again. */
ovoid_status ov_grid_create(ovoid_context *context, const double low[3], const double high[3],
                            double reach, size_t expected, size_t indices, ov_grid *grid);
void ov_grid_destroy(ov_grid *grid);

/* An empty grid in the box of `count` >= 1 points, x, y, z each and `stride` bytes apart, for what
 * is added of them. */
ovoid_status ov_grid_about(ovoid_context *context, const double *points, size_t stride,
                           size_t count, double reach, ov_grid *grid);

/* The same with all the points in it, by their numbers. */
ovoid_status ov_grid_of(ovoid_context *context, const double *points, size_t stride, size_t count,
                        double reach, ov_grid *grid);

ovoid_status ov_grid_add(ovoid_context *context, ov_grid *grid, const double centre[3],
                         uint32_t index);

/* Takes out what was added with the same centre and index. */
void ov_grid_remove(ov_grid *grid, const double centre[3], uint32_t index);

/* Those with an index below `below` within reach of the centre (to single precision), in a fixed
 * order, OV_NEAR_MAX of them at most; returns their number. */
size_t ov_grid_near(const ov_grid *grid, const double centre[3], uint32_t below,
                    uint32_t found[2 * OV_NEAR_MAX]);

#define OV_NOBODY UINT32_MAX

/* The one nearest to the place of the points in the grid, which lie where they were added; of
 * several as near, the one with the lowest index. OV_NOBODY where none is surely within reach. All
 * in the cells about the place are asked, however many. */
uint32_t ov_grid_nearest(const ov_grid *grid, const double *points, size_t stride,
                         const double at[3]);

#endif
