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

#define LOG_2 0.6931471805599453

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
    uint32_t *row;    /* where the row of cells y + z size[1] begins, and where the last one ends;
                         NULL: there would be too many */
    uint64_t size[3]; /* cells that there are candidates in, at most */
    double low[3], cell;
} grid;

static void grid_destroy(grid *g) {
    free(g->term);
    free(g->key);
    free(g->row);
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
    for (int axis = 0; axis < 3; ++axis)
        g->size[axis] = 0;
}

static void widen(grid *g, uint64_t key) {
    const uint64_t mask = (1u << CELL_BITS) - 1;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t at = key >> (CELL_BITS * axis) & mask;
        g->size[axis] = g->size[axis] > at + 1 ? g->size[axis] : at + 1;
    }
}

/* So many rows at most for each candidate: else those that have any are searched for. */
#define ROWS_MOST 8

static ovoid_status find_rows(ovoid_context *context, grid *g) {
    const uint64_t rows = g->size[1] * g->size[2];
    if (rows > ROWS_MOST * (uint64_t)g->count)
        return OVOID_OK;
    g->row = ov_alloc(context, (size_t)rows + 1, sizeof *g->row, "small terms");
    if (!g->row)
        return OVOID_ERROR_MEMORY;
    size_t k = 0;
    for (uint64_t r = 0; r <= rows; ++r) {
        const uint64_t first = key_of(0, r % g->size[1], r / g->size[1]);
        while (k < g->count && g->key[k] < first)
            ++k;
        g->row[r] = (uint32_t)k;
    }
    return OVOID_OK;
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
        widen(g, keys[k]);
    }
    OV_TRY(ov_sort_keys(context, keys, count, order));
    for (size_t k = 0; k < count; ++k) {
        g->term[k] = term[order[k]];
        g->key[k] = keys[order[k]];
    }
    OV_TRY(find_rows(context, g));
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
        to[axis] = to[axis] < g->size[axis] ? to[axis] : g->size[axis] - 1;
        if (from[axis] > to[axis])
            return;
    }
    if ((to[1] - from[1] + 1) * (to[2] - from[2] + 1) > g->count) {
        for (size_t k = 0; k < g->count; ++k)
            visit(k, user);
        return;
    }
    size_t k = g->row ? 0 : ov_first_key(g->key, g->count, key_of(from[0], from[1], from[2]));
    for (uint64_t z = from[2]; z <= to[2]; ++z)
        for (uint64_t y = from[1]; y <= to[1]; ++y) {
            const uint64_t last = key_of(to[0], y, z);
            if (g->row)
                k = g->row[z * g->size[1] + y];
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
    double *log_amplitude; /* of all bodies, over the isovalue, */
    double *ball;          /* and the radius of the ball inside the surface that they have by
                              themselves, negative where there is none */
    uint32_t *group;       /* of all bodies: one of its group, itself in the end */
    bool *plain;           /* of all bodies, true for groups too large for specks */
    size_t body;           /* the one that is looking */
    double half_max[3];    /* of all candidates' boxes */
    size_t *start;         /* of the k-th of the grid */
    uint32_t *near_it;     /* NULL while they are counted */
} finder;

static void look_at_bodies(finder *f) {
    for (size_t i = 0; i < f->count; ++i) {
        const ov_body *const body = &f->bodies[i];
        f->log_amplitude[i] = log(body->quadric.amplitude / f->isovalue);
        f->ball[i] = ov_body_reach(body, f->isovalue) * body->least;
    }
}

static bool is_large(const finder *f, size_t i) {
    return !(f->ball[i] < BALL_STEPS * f->spacing);
}

static uint32_t group_of(const finder *f, uint32_t i) {
    while (f->group[i] != i) {
        f->group[i] = f->group[f->group[i]];
        i = f->group[i];
    }
    return i;
}

/* The exponent of a term at so many times a step away from its centre. */
static double exponent(const ov_quadric *quadric, const double step[3], double times) {
    const double *const a = quadric->a;
    const double x = times * step[0], y = times * step[1], z = times * step[2];
    return a[0] * x * x + a[3] * y * y + a[5] * z * z +
           2.0 * (a[1] * x * y + a[2] * x * z + a[4] * y * z);
}

/* Whether the field of the two alone reaches the isovalue all along from centre to centre. The
 * larger one tells alone where it reaches that by itself, or not even a half of it. */
static bool are_linked(const finder *f, size_t i, size_t j) {
    const ov_quadric *const a = &f->bodies[i].quadric, *const b = &f->bodies[j].quadric;
    double step[3];
    for (int axis = 0; axis < 3; ++axis)
        step[axis] = b->centre[axis] - a->centre[axis];
    for (size_t k = 0; k < sizeof between / sizeof *between; ++k) {
        const double p = f->log_amplitude[i] - exponent(a, step, between[k]),
                     q = f->log_amplitude[j] - exponent(b, step, 1.0 - between[k]);
        if (fmax(p, q) >= 0.0)
            continue;
        if (fmax(p, q) < -LOG_2 || exp(p) + exp(q) < 1.0)
            return false;
    }
    return true;
}

/* Terms on one piece of the surface become one group, under the term with the largest ball. */
static void link_bodies(size_t position, void *user) {
    finder *const f = user;
    const uint32_t candidate = f->candidates.term[position];
    uint32_t a = group_of(f, (uint32_t)f->body), b = group_of(f, candidate);
    if (a == b || (f->plain[a] && f->plain[b]) || !are_linked(f, f->body, candidate))
        return;
    const double p = f->ball[a], q = f->ball[b];
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

/* A candidate that joins what is too large for specks is of no speck: what it joins is not either,
 * whatever the group is. */
static void join_plain(size_t position, void *user) {
    finder *const f = user;
    const uint32_t candidate = f->candidates.term[position];
    if (!f->plain[candidate])
        f->plain[candidate] = are_linked(f, f->body, candidate);
}

/* Visits the candidates about the bodies that are large, or about the others. */
static void visit_linked(finder *f, bool large, visit_fn *visit) {
    double half[3], most[3] = {0};
    for (size_t k = 0; k < f->candidates.count; ++k)
        if (link_half(f, &f->bodies[f->candidates.term[k]], half))
            for (int axis = 0; axis < 3; ++axis)
                most[axis] = fmax(most[axis], half[axis]);
    for (f->body = 0; f->body < f->count; ++f->body) {
        const ov_body *const body = &f->bodies[f->body];
        if (is_large(f, f->body) != large || !link_half(f, body, half))
            continue;
        for (int axis = 0; axis < 3; ++axis)
            half[axis] += most[axis];
        visit_box(&f->candidates, body->quadric.centre, half, visit, f);
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
        if (!(f->ball[i] > 0.0) || is_large(f, i))
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

/* Most candidates, such as hydrogens, join something large, and are left out before the others are
 * looked at two by two. */
static ovoid_status find_groups(ovoid_context *context, finder *f) {
    ovoid_status status = OVOID_OK;
    visit_linked(f, true, join_plain);
    OV_TRY(keep_groups(context, f));
    if (f->candidates.count == 0)
        goto cleanup;
    visit_linked(f, false, link_bodies);
    drop_long_groups(f);
    OV_TRY(keep_groups(context, f));
cleanup:
    return status;
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
        order[k] = (sized){f->ball[f->candidates.term[k]], k, f->candidates.term[k]};
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
    f.log_amplitude = ov_alloc(context, count, sizeof *f.log_amplitude, "small terms");
    f.ball = ov_alloc(context, count, sizeof *f.ball, "small terms");
    if (!f.log_amplitude || !f.ball) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    look_at_bodies(&f);
    const size_t candidates = list_candidates(&f, NULL);
    if (candidates == 0)
        goto cleanup;
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
        f.plain[i] = is_large(&f, i);
    }
    OV_TRY(grid_create(context, bodies, term, candidates, spacing, &f.candidates));
    OV_TRY(find_groups(context, &f));
    if (f.candidates.count == 0)
        goto cleanup;
    OV_TRY(find_near(context, &f));
    OV_TRY(hand_over(context, &f, terms));
cleanup:
    free(term);
    free(f.log_amplitude);
    free(f.ball);
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
