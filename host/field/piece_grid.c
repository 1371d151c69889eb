#include "field/piece_grid.h"

#include "field/bricks.h"
#include "field/work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Largest pieces, evaluated at once: a million points, 16 MB on the device; and smaller ones, where
 * atoms are so few and far apart that most of a large piece would be empty. */
static const uint64_t limits[][3] = {{128, 128, 64}, {64, 64, 32}, {32, 32, 16}, {16, 16, 8}};
enum { LIMITS = sizeof limits / sizeof *limits };
/* Where there are so many more pieces than an atom reaches, the others are left out. */
#define EMPTY_SHARE 8.0
/* What a piece costs beside its points, in points. */
#define OVERHEAD 2e4
/* Pieces of one axis, and of all, at most. */
#define COUNT_MOST 4e18

static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

typedef struct planner {
    const ov_lattice *lattice;
    const double *xyzr;
    size_t atoms;
    double decay;
    ov_piece_grid *grid;
    uint64_t *keys;  /* of all pairs of a piece and an atom that reaches it */
    uint32_t *owner; /* the atom of each pair */
    uint32_t *order; /* the pairs by their keys */
    size_t pairs, reached;
} planner;

/* Cuts the lattice; returns how many pieces it has. */
static double cut(const ov_lattice *lattice, const uint64_t limit[3], ov_piece_grid *grid) {
    double total = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t size = lattice->size[axis];
        const uint64_t count = (size + limit[axis] - 1) / limit[axis];
        const uint64_t bricks = (size + count * brick[axis] - 1) / (count * brick[axis]);
        grid->size[axis] = bricks * brick[axis];
        grid->count[axis] = (size + grid->size[axis] - 1) / grid->size[axis];
        total *= (double)grid->count[axis];
    }
    return total;
}

static double points_of(const ov_piece_grid *grid) {
    return (double)grid->size[0] * (double)grid->size[1] * (double)grid->size[2];
}

/* How far (angstrom) an atom's Gaussian reaches the cut-off. */
static double reach_of(const planner *p, size_t atom) {
    const double radius = p->xyzr[4 * atom + 3];
    return sqrt(radius * radius - log(OV_TARGET_CUTOFF) / p->decay);
}

/* Range of pieces along one axis that an atom of this reach touches; empty if first > last. */
static void piece_range(const planner *p, size_t axis, double centre, double reach, int64_t *first,
                        int64_t *last) {
    const ov_lattice *const lattice = p->lattice;
    const double width = lattice->step[axis] * (double)p->grid->size[axis];
    const double from = lattice->low[axis] + lattice->step[axis];
    *first = (int64_t)fmax(0.0, floor((centre - reach - from) / width - 1e-6));
    *last = (int64_t)fmin((double)p->grid->count[axis] - 1.0,
                          floor((centre + reach - from) / width + 1e-6));
}

static void atom_range(const planner *p, size_t atom, int64_t first[3], int64_t last[3]) {
    const double reach = reach_of(p, atom);
    for (size_t axis = 0; axis < 3; ++axis)
        piece_range(p, axis, p->xyzr[4 * atom + axis], reach, &first[axis], &last[axis]);
}

/* Pairs of a piece and an atom that reaches it; *most: of one atom. */
static double count_pairs(const planner *p, double *most) {
    double pairs = 0.0;
    *most = 0.0;
    for (size_t i = 0; i < p->atoms; ++i) {
        int64_t first[3], last[3];
        double own = 1.0;
        atom_range(p, i, first, last);
        for (int axis = 0; axis < 3; ++axis)
            own *= fmax(0.0, (double)(last[axis] - first[axis]) + 1.0);
        pairs += own;
        *most = fmax(*most, own);
    }
    return pairs;
}

static void list_pairs(planner *p) {
    const uint64_t *const count = p->grid->count;
    p->pairs = 0;
    for (size_t i = 0; i < p->atoms; ++i) {
        int64_t first[3], last[3];
        atom_range(p, i, first, last);
        for (int64_t z = first[2]; z <= last[2]; ++z)
            for (int64_t y = first[1]; y <= last[1]; ++y)
                for (int64_t x = first[0]; x <= last[0]; ++x) {
                    p->keys[p->pairs] =
                        ((uint64_t)z * count[1] + (uint64_t)y) * count[0] + (uint64_t)x;
                    p->owner[p->pairs++] = (uint32_t)i;
                }
    }
}

static void drop_pairs(planner *p) {
    free(p->keys);
    free(p->owner);
    free(p->order);
    p->keys = NULL;
    p->owner = p->order = NULL;
}

/* Lists and sorts the pairs, and counts the pieces that atoms reach. */
static ovoid_status sort_pairs(ovoid_context *context, planner *p, double spacing) {
    double most;
    const double pairs = count_pairs(p, &most);
    drop_pairs(p);
    if (!(pairs < (double)UINT32_MAX))
        return ov_fail(
            context, OVOID_ERROR_LIMIT,
            "atoms reach the pieces of the lattice of constrained points %.1e times at a "
            "spacing of %g angstrom, more than 2^32; use a larger one",
            pairs, spacing);
    p->keys = ov_alloc(context, (size_t)pairs, sizeof *p->keys, "lattice pieces");
    p->owner = ov_alloc(context, (size_t)pairs, sizeof *p->owner, "lattice pieces");
    p->order = ov_alloc(context, (size_t)pairs, sizeof *p->order, "lattice pieces");
    if (!p->keys || !p->owner || !p->order)
        return OVOID_ERROR_MEMORY;
    list_pairs(p);
    const ovoid_status status = ov_sort_keys(context, p->keys, p->pairs, p->order);
    if (status != OVOID_OK)
        return status;
    p->reached = 0;
    for (size_t k = 0; k < p->pairs; ++k)
        p->reached += k == 0 || p->keys[p->order[k]] != p->keys[p->order[k - 1]];
    return OVOID_OK;
}

/* Values of Gaussians at lattice points, about. */
static double count_values(const planner *p) {
    const double *const step = p->lattice->step;
    const double cell = step[0] * step[1] * step[2];
    double points = 1.0, values = 0.0;
    for (int axis = 0; axis < 3; ++axis)
        points *= (double)p->lattice->size[axis];
    for (size_t i = 0; i < p->atoms; ++i)
        values += fmin(points, 4.19 * pow(reach_of(p, i), 3) / cell);
    return values;
}

/* Refuses what is too much: so many pieces at least and at most. */
static ovoid_status check_work(ovoid_context *context, const planner *p, double least,
                               double most) {
    const double *const step = p->lattice->step;
    const ov_work work = {.points_least = least * points_of(p->grid),
                          .points_most = most * points_of(p->grid),
                          .values = count_values(p),
                          .terms = p->atoms,
                          .spacing = fmax(fmax(step[0], step[1]), step[2]),
                          .what = "constrained points"};
    return ov_work_check(context, &work);
}

/* Before pieces are told apart: at least those of one atom, and at most all, or all that atoms
 * reach.
 */
static ovoid_status check_bounds(ovoid_context *context, const planner *p, double total) {
    double most;
    const double pairs = count_pairs(p, &most);
    return check_work(context, p, most, fmin(total, pairs));
}

/* The largest pieces; or where these are few of many, those that cost least. */
static ovoid_status choose_pieces(ovoid_context *context, planner *p, double *total) {
    ovoid_status status = OVOID_OK;
    double least = INFINITY;
    size_t best = 0;
    for (size_t n = 0; n < LIMITS; ++n) {
        *total = cut(p->lattice, limits[n], p->grid);
        if (!(*total < COUNT_MOST))
            break;
        if (n == 0)
            OV_TRY(check_bounds(context, p, *total));
        OV_TRY(sort_pairs(context, p, p->lattice->step[0]));
        const double cost = (double)p->reached * (points_of(p->grid) + OVERHEAD);
        if (n == 0 && *total <= EMPTY_SHARE * (double)p->reached)
            return OVOID_OK;
        best = cost < least ? n : best;
        least = fmin(cost, least);
    }
    *total = cut(p->lattice, limits[best], p->grid);
    OV_TRY(sort_pairs(context, p, p->lattice->step[0]));
cleanup:
    return status;
}

/* Takes the pairs over; `all` pieces, or those that are reached. */
static ovoid_status fill_grid(ovoid_context *context, planner *p, bool all, size_t total) {
    ov_piece_grid *const grid = p->grid;
    size_t at = 0;
    grid->pieces = all ? total : p->reached;
    grid->key = ov_alloc(context, grid->pieces, sizeof *grid->key, "lattice pieces");
    grid->start = ov_alloc(context, grid->pieces + 1, sizeof *grid->start, "lattice pieces");
    grid->atom = ov_alloc(context, p->pairs, sizeof *grid->atom, "atoms of pieces");
    if (!grid->key || !grid->start || !grid->atom)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < p->pairs; ++k)
        grid->atom[k] = p->owner[p->order[k]];
    for (size_t piece = 0; piece < grid->pieces; ++piece) {
        const uint64_t key = all ? piece : p->keys[p->order[at]];
        grid->key[piece] = key;
        grid->start[piece] = at;
        while (at < p->pairs && p->keys[p->order[at]] == key)
            ++at;
    }
    grid->start[grid->pieces] = at;
    return OVOID_OK;
}

ovoid_status ov_piece_grid_create(ovoid_context *context, const ov_lattice *lattice,
                                  const double *xyzr, size_t atoms, double decay, bool with_empty,
                                  ov_piece_grid *grid) {
    ovoid_status status = OVOID_OK;
    double total;
    planner p = {.lattice = lattice, .xyzr = xyzr, .atoms = atoms, .decay = decay, .grid = grid};
    *grid = (ov_piece_grid){0};
    OV_TRY(choose_pieces(context, &p, &total));
    const bool all = with_empty && total <= EMPTY_SHARE * (double)p.reached;
    const double pieces = all ? total : (double)p.reached;
    OV_TRY(check_work(context, &p, pieces, pieces));
    OV_TRY(fill_grid(context, &p, all, (size_t)total));
cleanup:
    drop_pairs(&p);
    return status;
}

void ov_piece_grid_destroy(ov_piece_grid *grid) {
    free(grid->key);
    free(grid->start);
    free(grid->atom);
    memset(grid, 0, sizeof *grid);
}

void ov_piece_grid_at(const ov_piece_grid *grid, size_t piece, uint64_t at[3]) {
    uint64_t key = grid->key[piece];
    for (int axis = 0; axis < 3; ++axis) {
        at[axis] = key % grid->count[axis];
        key /= grid->count[axis];
    }
}
