#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- cells -------------------------------------------------------------------------------- */

static void clear_table(ov_cells *cells) {
    for (size_t k = 0; k < cells->slots; ++k)
        cells->table[k] = OV_NO_CELL;
}

ovoid_status ov_cells_create(ovoid_context *context, const double origin[3], double edge,
                             size_t expected, ov_cells *cells) {
    memset(cells, 0, sizeof *cells);
    for (int k = 0; k < 3; ++k)
        cells->origin[k] = origin[k];
    cells->edge = edge;
    cells->per_edge = 1.0 / edge;
    cells->slots = 64;
    while (cells->slots < 2 * expected)
        cells->slots *= 2;
    cells->table = ov_alloc(context, cells->slots, sizeof *cells->table, "cells");
    if (!cells->table)
        return OVOID_ERROR_MEMORY;
    clear_table(cells);
    return OVOID_OK;
}

void ov_cells_destroy(ov_cells *cells) {
    free(cells->table);
    free(cells->place);
    memset(cells, 0, sizeof *cells);
}

/* floor() without a call where the processor's baseline has no instruction for it. */
static int32_t floor_of(double x) {
    const double bound = 1e9, inside = x < -bound ? -bound : x < bound ? x : bound;
    const int32_t whole = (int32_t)inside;
    return whole - (whole > inside);
}

void ov_cells_place(const ov_cells *cells, const double point[3], int32_t place[3]) {
    for (int k = 0; k < 3; ++k)
        place[k] = floor_of((point[k] - cells->origin[k]) * cells->per_edge);
}

static double corner_of(const ov_cells *cells, const int32_t place[3], int axis) {
    return cells->origin[axis] + place[axis] * cells->edge;
}

/* The slot that holds the cell, or the free one where it belongs. Cells that follow one another in
 * x mostly do so in the table. */
static size_t slot_of(const ov_cells *cells, const int32_t place[3]) {
    uint64_t hash = (uint64_t)(uint32_t)place[1] * 0x9e3779b97f4a7c15u;
    hash = (hash ^ (hash >> 32) ^ (uint32_t)place[2]) * 0xbf58476d1ce4e5b9u;
    size_t slot = ((size_t)(hash >> 24) + (uint32_t)place[0]) & (cells->slots - 1);
    while (cells->table[slot] != OV_NO_CELL &&
           memcmp(cells->place[cells->table[slot]], place, sizeof *cells->place) != 0)
        slot = (slot + 1) & (cells->slots - 1);
    return slot;
}

uint32_t ov_cells_find(const ov_cells *cells, const int32_t place[3]) {
    return cells->table[slot_of(cells, place)];
}

static ovoid_status widen_table(ovoid_context *context, ov_cells *cells) {
    uint32_t *table = ov_alloc(context, 2 * cells->slots, sizeof *table, "cells");
    if (!table)
        return OVOID_ERROR_MEMORY;
    free(cells->table);
    cells->table = table;
    cells->slots *= 2;
    clear_table(cells);
    for (size_t k = 0; k < cells->count; ++k)
        cells->table[slot_of(cells, cells->place[k])] = (uint32_t)k;
    return OVOID_OK;
}

ovoid_status ov_cells_add(ovoid_context *context, ov_cells *cells, const int32_t place[3],
                          uint32_t *number, bool *added) {
    ovoid_status status = OVOID_OK;
    *number = ov_cells_find(cells, place);
    *added = *number == OV_NO_CELL;
    if (!*added)
        return OVOID_OK;
    if (cells->count + 1 >= OV_NO_CELL)
        return ov_fail(context, OVOID_ERROR_LIMIT, "too many cells of %g angstrom", cells->edge);
    OV_TRY(ov_grow(context, &cells->place, &cells->capacity, cells->count + 1, sizeof *cells->place,
                   "cells"));
    if (2 * (cells->count + 1) > cells->slots)
        OV_TRY(widen_table(context, cells));
    *number = (uint32_t)cells->count;
    memcpy(cells->place[cells->count++], place, sizeof *cells->place);
    cells->table[slot_of(cells, place)] = *number;
cleanup:
    return status;
}

/* ---- who is near whom --------------------------------------------------------------------- */

ovoid_status ov_grid_create(ovoid_context *context, const double low[3], const double high[3],
                            double reach, size_t expected, size_t indices, ov_grid *grid) {
    memset(grid, 0, sizeof *grid);
    grid->reach = reach;
    double edge = reach; /* places are integers of 32 bit, kept well within */
    for (int k = 0; k < 3; ++k)
        edge = fmax(edge, (high[k] - low[k]) * 1e-8);
    if (indices > 0) {
        grid->where = ov_alloc(context, indices, sizeof *grid->where, "neighbours");
        if (!grid->where)
            return OVOID_ERROR_MEMORY;
    }
    return ov_cells_create(context, low, edge, expected / 8, &grid->cells);
}

void ov_grid_destroy(ov_grid *grid) {
    ov_cells_destroy(&grid->cells);
    free(grid->members);
    free(grid->pool);
    free(grid->where);
    memset(grid, 0, sizeof *grid);
}

/* Room for one more in the cell: a full cell moves to the end of the pool. */
static ovoid_status make_room(ovoid_context *context, ov_grid *grid, ov_cell_members *cell) {
    if (cell->count < cell->capacity)
        return OVOID_OK;
    const uint32_t capacity = cell->capacity ? 2 * cell->capacity : 8;
    const ovoid_status status = ov_grow(context, &grid->pool, &grid->capacity,
                                        grid->used + capacity, sizeof *grid->pool, "neighbours");
    if (status != OVOID_OK)
        return status;
    if (cell->count)
        memcpy(grid->pool + grid->used, grid->pool + cell->first, cell->count * sizeof *grid->pool);
    cell->first = grid->used;
    cell->capacity = capacity;
    grid->used += capacity;
    return OVOID_OK;
}

ovoid_status ov_grid_add(ovoid_context *context, ov_grid *grid, const double centre[3],
                         uint32_t index) {
    ovoid_status status = OVOID_OK;
    int32_t place[3];
    uint32_t number;
    bool added;
    ov_cells_place(&grid->cells, centre, place);
    OV_TRY(ov_cells_add(context, &grid->cells, place, &number, &added));
    if (added) {
        OV_TRY(ov_grow(context, &grid->members, &grid->members_capacity, (size_t)number + 1,
                       sizeof *grid->members, "cells"));
        memset(grid->members + number, 0, sizeof *grid->members);
    }
    ov_cell_members *cell = grid->members + number;
    OV_TRY(make_room(context, grid, cell));
    if (grid->where)
        grid->where[index] = cell->count;
    ov_neighbour *last = grid->pool + cell->first + cell->count++;
    for (int k = 0; k < 3; ++k)
        last->offset[k] = (float)(centre[k] - corner_of(&grid->cells, place, k));
    last->index = index;
cleanup:
    return status;
}

void ov_grid_remove(ov_grid *grid, const double centre[3], uint32_t index) {
    int32_t place[3];
    ov_cells_place(&grid->cells, centre, place);
    const uint32_t number = ov_cells_find(&grid->cells, place);
    if (number == OV_NO_CELL)
        return;
    ov_cell_members *cell = grid->members + number;
    ov_neighbour *hole = grid->pool + cell->first + grid->where[index];
    *hole = grid->pool[cell->first + --cell->count];
    grid->where[hole->index] = grid->where[index];
}

/* Squared distance of a cell from a point at these offsets from the cell's corner. */
static float distance_to_cell(const float offset[3], float edge) {
    float sum = 0.0f;
    for (int k = 0; k < 3; ++k) {
        const float off = offset[k] < 0.0f ? offset[k] : offset[k] > edge ? offset[k] - edge : 0.0f;
        sum += off * off;
    }
    return sum;
}

/* Writes the indices of those of the members near the point to `found`, returns their number. */
static size_t near_in_cell(const ov_neighbour *members, size_t count, const float offset[3],
                           float limit, uint32_t below, uint32_t *found) {
    size_t number = 0;
    for (size_t k = 0; k < count && number < OV_NEAR_MAX; ++k) {
        const float x = members[k].offset[0] - offset[0], y = members[k].offset[1] - offset[1],
                    z = members[k].offset[2] - offset[2];
        found[number] = members[k].index; /* kept if the number goes up: no branch to mispredict */
        number += (members[k].index < below) & (x * x + y * y + z * z <= limit);
    }
    return number;
}

size_t ov_grid_near(const ov_grid *grid, const double centre[3], uint32_t below,
                    uint32_t found[2 * OV_NEAR_MAX]) {
    const ov_cells *cells = &grid->cells;
    const float edge = (float)cells->edge, limit = (float)(grid->reach * grid->reach);
    size_t count = 0, budget = OV_ASKED_MAX;
    int32_t home[3];
    ov_cells_place(cells, centre, home);
    double within[3];
    for (int k = 0; k < 3; ++k)
        within[k] = centre[k] - corner_of(cells, home, k);
    for (int n = 0; n < 27 && count < OV_NEAR_MAX && budget > 0; ++n) {
        const int step[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        int32_t place[3];
        float offset[3];
        for (int k = 0; k < 3; ++k) {
            place[k] = home[k] + step[k];
            offset[k] = (float)(within[k] - step[k] * cells->edge);
        }
        if (distance_to_cell(offset, edge) > 1.0001f * limit) /* to rounding */
            continue;
        const uint32_t number = ov_cells_find(cells, place);
        if (number == OV_NO_CELL)
            continue;
        const ov_cell_members *cell = grid->members + number;
        const size_t asked = cell->count < budget ? cell->count : budget;
        budget -= asked;
        count += near_in_cell(grid->pool + cell->first, asked, offset, limit, below, found + count);
    }
    return count < OV_NEAR_MAX ? count : OV_NEAR_MAX;
}

static const double *strided(const double *points, size_t stride, size_t n) {
    return (const double *)((const char *)points + n * stride);
}

ovoid_status ov_grid_about(ovoid_context *context, const double *points, size_t stride,
                           size_t count, double reach, ov_grid *grid) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t n = 0; n < count; ++n)
        for (int k = 0; k < 3; ++k) {
            low[k] = fmin(low[k], strided(points, stride, n)[k]);
            high[k] = fmax(high[k], strided(points, stride, n)[k]);
        }
    return ov_grid_create(context, low, high, reach, count, count, grid);
}

ovoid_status ov_grid_of(ovoid_context *context, const double *points, size_t stride, size_t count,
                        double reach, ov_grid *grid) {
    ovoid_status status = ov_grid_about(context, points, stride, count, reach, grid);
    for (size_t n = 0; n < count && status == OVOID_OK; ++n)
        status = ov_grid_add(context, grid, strided(points, stride, n), (uint32_t)n);
    return status;
}

/* The nearest so far. */
typedef struct nearest {
    uint32_t index;
    double square;
} nearest;

static void nearest_in_cell(const ov_grid *grid, const ov_cell_members *cell, const double *points,
                            size_t stride, const double at[3], nearest *best) {
    for (size_t n = 0; n < cell->count; ++n) {
        const uint32_t index = grid->pool[cell->first + n].index;
        const double *const point = strided(points, stride, index);
        double square = 0.0;
        for (int k = 0; k < 3; ++k)
            square += (point[k] - at[k]) * (point[k] - at[k]);
        if (square < best->square || (square == best->square && index < best->index))
            *best = (nearest){index, square};
    }
}

/* What rounding may do to the cell of a point, as a share of the reach. */
#define CELL_ROUNDING 1e-6

/* The square of how far a place is from the cell that is this many cells away, at least. */
static double square_to_cell(const ov_cells *cells, const double at[3], const int32_t home[3],
                             const int step[3]) {
    double square = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double in = at[k] - corner_of(cells, home, k);
        const double off = step[k] < 0 ? in : step[k] > 0 ? cells->edge - in : 0.0;
        const double least = fmax(off - CELL_ROUNDING * cells->edge, 0.0);
        square += least * least;
    }
    return square;
}

/* The 27 cells about a place, its own first. */
static const int8_t about[3] = {0, -1, 1};

uint32_t ov_grid_nearest(const ov_grid *grid, const double *points, size_t stride,
                         const double at[3]) {
    nearest best = {OV_NOBODY, INFINITY};
    const double sure = (1.0 - CELL_ROUNDING) * grid->reach;
    int32_t home[3];
    ov_cells_place(&grid->cells, at, home);
    for (int n = 0; n < 27; ++n) {
        const int step[3] = {about[n % 3], about[n / 3 % 3], about[n / 9]};
        const int32_t place[3] = {home[0] + step[0], home[1] + step[1], home[2] + step[2]};
        if (square_to_cell(&grid->cells, at, home, step) > fmin(best.square, sure * sure))
            continue;
        const uint32_t number = ov_cells_find(&grid->cells, place);
        if (number != OV_NO_CELL)
            nearest_in_cell(grid, grid->members + number, points, stride, at, &best);
    }
    return best.square <= sure * sure ? best.index : OV_NOBODY;
}
