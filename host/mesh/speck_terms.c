#include "mesh/speck_terms.h"

#include "field/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A piece of the surface with a ball of so many lattice steps in it is left to the lattice, which
 * has the area of a sphere of that radius right to 0.2 %, and a point in every ball of 0.87 steps.
 */
#define BALL_STEPS 2.3
/* So is one with terms further apart than this (lattice steps). */
#define APART_STEPS 4.0
/* Where two terms are looked at between their centres. */
static const double between[] = {0.5, 0.3, 0.7, 0.15, 0.85};

/* How far neighbours may push a piece beyond the surface of its own term: by a share of that, and
 * so many lattice steps. */
#define HALF_SHARE 0.5
#define HALF_STEPS 3.0

#define CELL_BITS 20 /* cells per axis of the grid over candidates, as a power of two */
#define CELL_STEPS 4.0

void ov_speck_half(const ov_body *body, double isovalue, double spacing, double share,
                   double half[3]) {
    const double reach = ov_body_reach(body, isovalue);
    for (int axis = 0; axis < 3; ++axis)
        half[axis] =
            (1.0 + HALF_SHARE * share) * reach * body->extent[axis] + HALF_STEPS * share * spacing;
}

/* ---- a grid over candidates --------------------------------------------------------------- */

/* Candidates sorted by the cells of a grid, in raster order. */
typedef struct grid {
    size_t count;
    uint32_t *term; /* in the order of their cells */
    uint64_t *key;
    double low[3], cell;
} grid;

static void grid_destroy(grid *g) {
    free(g->term);
    free(g->key);
}

static uint64_t cell_at(const grid *g, int axis, double x) {
    const double at = floor((x - g->low[axis]) / g->cell);
    return (uint64_t)fmin(fmax(at, 0.0), (double)((1u << CELL_BITS) - 1));
}

static uint64_t key_of(uint64_t x, uint64_t y, uint64_t z) {
    return (z << CELL_BITS | y) << CELL_BITS | x;
}

/* The smallest cell that the grid can number is a share of the candidates' box. */
static void lay_grid(const ov_body *bodies, const uint32_t *term, size_t count, double spacing,
                     grid *g) {
    double extent = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        double low = INFINITY, high = -INFINITY;
        for (size_t k = 0; k < count; ++k) {
            low = fmin(low, bodies[term[k]].quadric.centre[axis]);
            high = fmax(high, bodies[term[k]].quadric.centre[axis]);
        }
        g->low[axis] = low;
        extent = fmax(extent, high - low);
    }
    g->cell = fmax(CELL_STEPS * spacing, extent / (double)((1u << CELL_BITS) - 1));
}

static ovoid_status grid_create(ovoid_context *context, const ov_body *bodies, const uint32_t *term,
                                size_t count, double spacing, grid *g) {
    ovoid_status status = OVOID_OK;
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "small terms");
    uint32_t *const order = ov_alloc(context, count, sizeof *order, "small terms");
    *g = (grid){.count = count,
                .term = ov_alloc(context, count, sizeof *g->term, "small terms"),
                .key = ov_alloc(context, count, sizeof *g->key, "small terms")};
    if (!keys || !order || !g->term || !g->key) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    lay_grid(bodies, term, count, spacing, g);
    for (size_t k = 0; k < count; ++k) {
        const double *const at = bodies[term[k]].quadric.centre;
        keys[k] = key_of(cell_at(g, 0, at[0]), cell_at(g, 1, at[1]), cell_at(g, 2, at[2]));
    }
    OV_TRY(ov_sort_keys(context, keys, count, order));
    for (size_t k = 0; k < count; ++k) {
        g->term[k] = term[order[k]];
        g->key[k] = keys[order[k]];
    }
cleanup:
    free(keys);
    free(order);
    return status;
}

/* Called with the position in the grid of a candidate that may lie in the box. */
typedef void visit_fn(size_t position, void *user);

/* As ov_first_key(), known to be no candidate before `from`, and mostly near it. */
static size_t first_from(const grid *g, size_t from, uint64_t key) {
    size_t step = 1;
    while (from + step < g->count && g->key[from + step] < key) {
        from += step;
        step *= 2;
    }
    const size_t left = g->count - from;
    return from + ov_first_key(g->key + from, left < step + 1 ? left : step + 1, key);
}

/* Visits all candidates in the cells that the box about `centre` touches. */
static void visit_box(const grid *g, const double centre[3], const double half[3], visit_fn *visit,
                      void *user) {
    uint64_t from[3], to[3];
    for (int axis = 0; axis < 3; ++axis) {
        from[axis] = cell_at(g, axis, centre[axis] - half[axis]);
        to[axis] = cell_at(g, axis, centre[axis] + half[axis]);
    }
    if ((to[1] - from[1] + 1) * (to[2] - from[2] + 1) > g->count) {
        for (size_t k = 0; k < g->count; ++k)
            visit(k, user);
        return;
    }
    size_t k = ov_first_key(g->key, g->count, key_of(from[0], from[1], from[2]));
    for (uint64_t z = from[2]; z <= to[2]; ++z)
        for (uint64_t y = from[1]; y <= to[1]; ++y) {
            const uint64_t last = key_of(to[0], y, z);
            for (k = first_from(g, k, key_of(from[0], y, z)); k < g->count && g->key[k] <= last;
                 ++k)
                visit(k, user);
        }
}

/* ---- which terms -------------------------------------------------------------------------- */

typedef struct finder {
    const ov_body *bodies;
    size_t count;
    double isovalue, cutoff, spacing;
    grid candidates;
    uint32_t *group;    /* of all bodies: one of its group, itself in the end */
    bool *plain;        /* of all bodies, true for groups too large for specks */
    size_t body;        /* the one that is looking */
    double half_max[3]; /* of all candidates' boxes */
    size_t *start;      /* of the k-th of the grid */
    uint32_t *near_it;  /* NULL while they are counted */
} finder;

/* Radius of the ball inside a term's own surface, negative where it has none. */
static double ball_of(const finder *f, size_t i) {
    return ov_body_reach(&f->bodies[i], f->isovalue) * f->bodies[i].least;
}

static uint32_t group_of(const finder *f, uint32_t i) {
    while (f->group[i] != i) {
        f->group[i] = f->group[f->group[i]];
        i = f->group[i];
    }
    return i;
}

/* Whether the field of the two alone reaches the isovalue all along from centre to centre. */
static bool are_linked(const finder *f, const ov_quadric *a, const ov_quadric *b) {
    for (size_t k = 0; k < sizeof between / sizeof *between; ++k) {
        double at[3];
        for (int axis = 0; axis < 3; ++axis)
            at[axis] = a->centre[axis] + between[k] * (b->centre[axis] - a->centre[axis]);
        if (exp(ov_quadric_log_value(a, at)) + exp(ov_quadric_log_value(b, at)) < f->isovalue)
            return false;
    }
    return true;
}

/* Terms on one piece of the surface become one group, under the term with the largest ball. */
static void link_bodies(size_t position, void *user) {
    finder *const f = user;
    const uint32_t candidate = f->candidates.term[position];
    uint32_t a = group_of(f, (uint32_t)f->body), b = group_of(f, candidate);
    if (a == b || (f->plain[a] && f->plain[b]) ||
        !are_linked(f, &f->bodies[f->body].quadric, &f->bodies[candidate].quadric))
        return;
    const double p = ball_of(f, a), q = ball_of(f, b);
    if (q > p || (q == p && b < a)) {
        const uint32_t swap = a;
        a = b;
        b = swap;
    }
    f->group[b] = a;
    f->plain[a] |= f->plain[b];
}

/* Half-sides of the box in which a term may reach the isovalue together with an equal one. */
static bool link_half(const finder *f, const ov_body *body, double half[3]) {
    const double reach = ov_body_reach(body, 0.5 * f->isovalue);
    for (int axis = 0; axis < 3; ++axis)
        half[axis] = reach * body->extent[axis];
    return ov_body_reach(body, f->isovalue) >= 0.0;
}

static void find_groups(finder *f) {
    double half[3], most[3] = {0};
    for (size_t k = 0; k < f->candidates.count; ++k)
        if (link_half(f, &f->bodies[f->candidates.term[k]], half))
            for (int axis = 0; axis < 3; ++axis)
                most[axis] = fmax(most[axis], half[axis]);
    for (f->body = 0; f->body < f->count; ++f->body) {
        const ov_body *const body = &f->bodies[f->body];
        if (!link_half(f, body, half))
            continue;
        for (int axis = 0; axis < 3; ++axis)
            half[axis] += most[axis];
        visit_box(&f->candidates, body->quadric.centre, half, link_bodies, f);
    }
}

/* A group that is long is no speck. */
static void drop_long_groups(finder *f) {
    for (size_t k = 0; k < f->candidates.count; ++k) {
        const uint32_t i = f->candidates.term[k], g = group_of(f, i);
        for (int axis = 0; axis < 3; ++axis)
            if (fabs(f->bodies[i].quadric.centre[axis] - f->bodies[g].quadric.centre[axis]) >
                APART_STEPS * f->spacing)
                f->plain[g] = true;
    }
}

/* Fills `term` with the candidates; NULL only counts them. */
static size_t list_candidates(const finder *f, uint32_t *term) {
    size_t count = 0;
    for (size_t i = 0; i < f->count; ++i) {
        const double ball = ball_of(f, i);
        if (!(ball > 0.0 && ball < BALL_STEPS * f->spacing))
            continue;
        if (term)
            term[count] = (uint32_t)i;
        ++count;
    }
    return count;
}

/* ---- what is near them -------------------------------------------------------------------- */

static void note_near(size_t position, void *user) {
    finder *const f = user;
    const ov_body *const body = &f->bodies[f->body], *const candidate =
                                                         &f->bodies[f->candidates.term[position]];
    const double reach = ov_body_reach(body, f->cutoff);
    double half[3];
    ov_speck_half(candidate, f->isovalue, f->spacing, 1.0, half);
    for (int axis = 0; axis < 3; ++axis)
        if (fabs(body->quadric.centre[axis] - candidate->quadric.centre[axis]) >
            half[axis] + reach * body->extent[axis])
            return;
    if (f->near_it)
        f->near_it[f->start[position]] = (uint32_t)f->body;
    ++f->start[position + (f->near_it ? 0 : 1)];
}

static void visit_near(finder *f) {
    for (f->body = 0; f->body < f->count; ++f->body) {
        const ov_body *const body = &f->bodies[f->body];
        const double reach = ov_body_reach(body, f->cutoff);
        double half[3];
        if (reach < 0.0)
            continue;
        for (int axis = 0; axis < 3; ++axis)
            half[axis] = reach * body->extent[axis] + f->half_max[axis];
        visit_box(&f->candidates, body->quadric.centre, half, note_near, f);
    }
}

static ovoid_status find_near(ovoid_context *context, finder *f) {
    const size_t count = f->candidates.count;
    for (size_t k = 0; k < count; ++k) {
        double half[3];
        ov_speck_half(&f->bodies[f->candidates.term[k]], f->isovalue, f->spacing, 1.0, half);
        for (int axis = 0; axis < 3; ++axis)
            f->half_max[axis] = fmax(f->half_max[axis], half[axis]);
    }
    f->start = ov_alloc(context, count + 1, sizeof *f->start, "terms near small ones");
    if (!f->start)
        return OVOID_ERROR_MEMORY;
    visit_near(f);
    for (size_t k = 0; k < count; ++k)
        f->start[k + 1] += f->start[k];
    f->near_it = ov_alloc(context, f->start[count], sizeof *f->near_it, "terms near small ones");
    if (!f->near_it)
        return OVOID_ERROR_MEMORY;
    visit_near(f); /* moves each start to the next one */
    memmove(f->start + 1, f->start, count * sizeof *f->start);
    f->start[0] = 0;
    return OVOID_OK;
}

/* Replaces the grid by one of the groups that are left: of each the term with the largest ball. */
static ovoid_status keep_groups(ovoid_context *context, finder *f) {
    size_t kept = 0;
    grid next;
    for (size_t k = 0; k < f->candidates.count; ++k) {
        const uint32_t i = f->candidates.term[k];
        if (group_of(f, i) == i && !f->plain[i])
            f->candidates.term[kept++] = i;
    }
    if (kept == 0) {
        f->candidates.count = 0;
        return OVOID_OK;
    }
    const ovoid_status status =
        grid_create(context, f->bodies, f->candidates.term, kept, f->spacing, &next);
    if (status != OVOID_OK) {
        grid_destroy(&next);
        return status;
    }
    grid_destroy(&f->candidates);
    f->candidates = next;
    return OVOID_OK;
}

/* The candidates that are left, largest first. */
typedef struct sized {
    double ball;
    size_t position; /* in the grid */
    uint32_t term;
} sized;

static int by_size(const void *a, const void *b) {
    const sized *const p = a, *const q = b;
    if (p->ball != q->ball)
        return p->ball > q->ball ? -1 : 1;
    return (p->term > q->term) - (p->term < q->term);
}

static ovoid_status hand_over(ovoid_context *context, finder *f, ov_speck_terms *terms) {
    const size_t count = f->candidates.count;
    sized *const order = ov_alloc(context, count, sizeof *order, "small terms");
    *terms = (ov_speck_terms){
        .count = count,
        .term = ov_alloc(context, count, sizeof *terms->term, "small terms"),
        .start = ov_alloc(context, count + 1, sizeof *terms->start, "terms near small ones"),
        .near_it =
            ov_alloc(context, f->start[count], sizeof *terms->near_it, "terms near small ones")};
    if (!order || !terms->term || !terms->start || !terms->near_it) {
        free(order);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t k = 0; k < count; ++k)
        order[k] = (sized){ball_of(f, f->candidates.term[k]), k, f->candidates.term[k]};
    qsort(order, count, sizeof *order, by_size);
    for (size_t k = 0; k < count; ++k) {
        const size_t first = f->start[order[k].position],
                     number = f->start[order[k].position + 1] - first;
        terms->term[k] = order[k].term;
        terms->start[k + 1] = terms->start[k] + number;
        memcpy(terms->near_it + terms->start[k], f->near_it + first, number * sizeof *f->near_it);
    }
    free(order);
    return OVOID_OK;
}

ovoid_status ov_speck_terms_find(ovoid_context *context, const ov_body *bodies, size_t count,
                                 double isovalue, double cutoff, double spacing,
                                 ov_speck_terms *terms) {
    ovoid_status status = OVOID_OK;
    finder f = {.bodies = bodies,
                .count = count,
                .isovalue = isovalue,
                .cutoff = cutoff,
                .spacing = spacing};
    uint32_t *term = NULL;
    *terms = (ov_speck_terms){0};
    const size_t candidates = list_candidates(&f, NULL);
    if (candidates == 0)
        return OVOID_OK;
    term = ov_alloc(context, candidates, sizeof *term, "small terms");
    f.group = ov_alloc(context, count, sizeof *f.group, "small terms");
    f.plain = ov_alloc(context, count, sizeof *f.plain, "small terms");
    if (!term || !f.group || !f.plain) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    list_candidates(&f, term);
    for (size_t i = 0; i < count; ++i) {
        f.group[i] = (uint32_t)i;
        f.plain[i] = !(ball_of(&f, i) < BALL_STEPS * spacing);
    }
    OV_TRY(grid_create(context, bodies, term, candidates, spacing, &f.candidates));
    find_groups(&f);
    drop_long_groups(&f);
    OV_TRY(keep_groups(context, &f));
    if (f.candidates.count == 0)
        goto cleanup;
    OV_TRY(find_near(context, &f));
    OV_TRY(hand_over(context, &f, terms));
cleanup:
    free(term);
    free(f.group);
    free(f.plain);
    free(f.start);
    free(f.near_it);
    grid_destroy(&f.candidates);
    return status;
}

void ov_speck_terms_destroy(ov_speck_terms *terms) {
    free(terms->term);
    free(terms->start);
    free(terms->near_it);
    *terms = (ov_speck_terms){0};
}
