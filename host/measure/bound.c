#include "measure/bound.h"

#include "field/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Triangles are looked at so many at a time, with the parts that they are split into, of which
 * there may be so many; and are split no more often than this. */
#define PIECE ((size_t)1 << 14)
#define FRAGMENTS ((size_t)1 << 18)
#define ROUNDS 16

/* What single precision may take from a distance, as a share of it and of the edges it is measured
 * from; and what it moves a corner by, as a share of its coordinates. */
#define ROUNDING (16.0 / 16777216.0)
#define CORNER_ROUNDING (2.0 * 1.7320508 / 16777216.0)

/* A triangle of the surface, or a part of one. */
typedef struct fragment {
    double at[3][3];    /* relative to the facets' origin, angstrom */
    double distance[3]; /* of the corners */
    double most;        /* no point of it is farther away */
} fragment;

typedef struct fragments {
    fragment *fragment;
    size_t count, capacity;
} fragments;

/* The bounding of one surface. */
typedef struct bounding {
    ov_meter *meter;
    ov_facets *facets;
    ov_bound *bound;
    const ov_limits *limits; /* NULL: the largest distance itself is looked for */
    fragments now, next;
    double margin; /* what rounding may take from a distance, its own share of it aside */
    bool loose;    /* more slack is left */
    float *xyz, *squared;
    size_t xyz_capacity, squared_capacity;
} bounding;

static void bounding_destroy(bounding *b) {
    free(b->now.fragment);
    free(b->next.fragment);
    free(b->xyz);
    free(b->squared);
}

/* In loops over triangles. */
static ovoid_status ask(ovoid_context *context, const bounding *b, size_t turn, size_t total) {
    if (!b->meter->watch)
        return ov_progress_turn(context, turn, total);
    return turn % OV_PROGRESS_TURNS == 0 ? ov_watch_ask(context, b->meter->watch) : OVOID_OK;
}

static double square_between(const double a[3], const double b[3]) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* Squared. */
static double longest_edge(const double at[3][3]) {
    const double a = square_between(at[0], at[1]), b = square_between(at[1], at[2]),
                 c = square_between(at[2], at[0]);
    return a > b ? (a > c ? a : c) : (b > c ? b : c);
}

static double no_less(const bounding *b, float squared) {
    return sqrt((double)squared) * (1.0 + ROUNDING) + b->margin;
}

/* What does not reach farther is done with. */
static double enough(const bounding *b) {
    if (b->limits)
        return b->limits->limit + b->limits->slack;
    const double least = b->bound->least,
                 slack = b->loose ? fmax(OV_BOUND_SLACK_LOOSE, OV_BOUND_SLACK_SHARE_LOOSE * least)
                                  : fmax(OV_BOUND_SLACK, OV_BOUND_SLACK_SHARE * least);
    return fmax(least + slack, b->bound->most);
}

/* The corners of a triangle of a trail, as offsets from the facets' origin. */
static void corners_of(const bounding *b, const ov_trail *trail, size_t k, double at[3][3]) {
    const uint32_t *const corner = trail->mesh->corners + 3 * (size_t)ov_trail_triangle(trail, k);
    for (size_t i = 0; i < 3; ++i) {
        ov_mesh_at(trail->mesh, corner[i], at[i]);
        for (size_t axis = 0; axis < 3; ++axis)
            at[i][axis] -= b->facets->origin[axis];
    }
}

/* The largest coordinate of a surface, from the facets' origin. */
static ovoid_status find_largest(ovoid_context *context, const ov_trail *trail, const bounding *b,
                                 double *largest) {
    ovoid_status status = OVOID_OK;
    *largest = 0.0;
    for (size_t k = 0; k < trail->vertices; ++k) {
        double at[3];
        OV_TRY(ask(context, b, k, trail->vertices));
        ov_mesh_at(trail->mesh, ov_trail_vertex(trail, k), at);
        for (size_t axis = 0; axis < 3; ++axis) {
            const double size = fabs(at[axis] - b->facets->origin[axis]);
            *largest = size > *largest ? size : *largest;
        }
    }
cleanup:
    return status;
}

/* No edge of a surface is longer, squared: on a lattice than the diagonal of a cell. */
static ovoid_status find_longest(ovoid_context *context, const ov_trail *trail, const bounding *b,
                                 double *longest) {
    ovoid_status status = OVOID_OK;
    *longest = 3.0 * trail->mesh->spacing * trail->mesh->spacing;
    if (*longest > 0.0)
        return OVOID_OK;
    for (size_t k = 0; k < trail->triangles; ++k) {
        double at[3][3];
        OV_TRY(ask(context, b, k, trail->triangles));
        corners_of(b, trail, k, at);
        const double edge = longest_edge((const double(*)[3])at);
        *longest = edge > *longest ? edge : *longest;
    }
cleanup:
    return status;
}

/* Adds what rounding may do because of a surface. */
static ovoid_status find_margin(ovoid_context *context, const ov_trail *trail, bounding *b) {
    ovoid_status status = OVOID_OK;
    double largest, longest;
    OV_TRY(find_largest(context, trail, b, &largest));
    OV_TRY(find_longest(context, trail, b, &longest));
    b->margin += CORNER_ROUNDING * largest + ROUNDING * sqrt(longest);
cleanup:
    return status;
}

/* A distance changes by no more than one moves. For weights w of the corners that make a point of
 * the triangle, sum w |x - corner| <= sqrt(sum w |x - corner|^2), which is the square root of the
 * sum of w_i w_j |edge_ij|^2 over the edges, and that is at most a third of the longest edge's. */
static double most_by_corners(const fragment *p) {
    const double farthest = fmax(p->distance[0], fmax(p->distance[1], p->distance[2]));
    return farthest + sqrt(longest_edge(p->at) / 3.0);
}

/* Keeps a fragment unless it is done with. */
static ovoid_status keep(ovoid_context *context, bounding *b, fragments *to, const fragment *p) {
    if (p->most <= enough(b)) {
        b->bound->most = fmax(b->bound->most, p->most);
        return OVOID_OK;
    }
    const ovoid_status status =
        ov_grow(context, (void *)&to->fragment, &to->capacity, to->count + 1, sizeof *to->fragment,
                "triangles of a surface");
    if (status == OVOID_OK)
        to->fragment[to->count++] = *p;
    return status;
}

static bool is_exposed(const ov_trail *trail, size_t k) {
    return ov_mesh_component_of_triangle(trail->mesh, ov_trail_triangle(trail, k))->exposed;
}

static void raise_least(bounding *b, const float *squared, size_t count) {
    float farthest = 0.0f;
    for (size_t k = 0; k < count; ++k)
        farthest = fmaxf(farthest, squared[k]);
    b->bound->least = fmax(b->bound->least, sqrt((double)farthest));
}

/* The squared distances of a triangle's corners. */
static void squared_of(const ov_trail *from, size_t k, const float *squared, float of[3]) {
    const uint32_t *const corner = from->mesh->corners + 3 * (size_t)ov_trail_triangle(from, k);
    for (size_t i = 0; i < 3; ++i)
        of[i] = squared[corner[i]];
}

static ovoid_status know_corners(ovoid_context *context, bounding *b, const ov_trail *from,
                                 const float *squared) {
    for (size_t k = 0; k < from->triangles; ++k) {
        float of[3];
        const ovoid_status asked = ask(context, b, k, from->triangles);
        if (asked != OVOID_OK)
            return asked;
        squared_of(from, k, squared, of);
        if (is_exposed(from, k))
            raise_least(b, of, 3);
    }
    return OVOID_OK;
}

/* Whether a triangle is looked at within limits; its corners' distances. */
static bool is_within(const bounding *b, const ov_trail *from, size_t k, const float *distance,
                      double of[3]) {
    const uint32_t *const corner = from->mesh->corners + 3 * (size_t)ov_trail_triangle(from, k);
    for (size_t i = 0; i < 3; ++i) {
        of[i] = (double)distance[corner[i]];
        if (of[i] < 0.0 || of[i] > b->limits->limit)
            return false;
        of[i] += of[i] * ROUNDING + b->margin;
    }
    return true;
}

/* The same where there are none; squared: of the corners. */
static bool is_outer(const bounding *b, const ov_trail *from, size_t k, const float *squared,
                     double of[3]) {
    float square[3];
    if (!is_exposed(from, k))
        return false;
    squared_of(from, k, squared, square);
    for (size_t i = 0; i < 3; ++i)
        of[i] = no_less(b, square[i]);
    return true;
}

/* Triangles from number *k on, until there is a piece of those that their corners do not do for.
 * known: of the corners, as is_within() or is_outer() has it. */
static ovoid_status collect(ovoid_context *context, bounding *b, const ov_trail *from,
                            const float *known, size_t *k) {
    ovoid_status status = OVOID_OK;
    for (; *k < from->triangles && b->now.count < PIECE; ++*k) {
        fragment p;
        OV_TRY(ask(context, b, *k, from->triangles));
        if (!(b->limits ? is_within : is_outer)(b, from, *k, known, p.distance))
            continue;
        corners_of(b, from, *k, p.at);
        p.most = most_by_corners(&p);
        OV_TRY(keep(context, b, &b->now, &p));
    }
cleanup:
    return status;
}

static ovoid_status make_room(ovoid_context *context, bounding *b, size_t floats, size_t sites) {
    const ovoid_status status = ov_grow(context, (void *)&b->xyz, &b->xyz_capacity, floats,
                                        sizeof *b->xyz, "points of a surface");
    return status != OVOID_OK ? status
                              : ov_grow(context, (void *)&b->squared, &b->squared_capacity, sites,
                                        sizeof *b->squared, "distances");
}

/* Asks again of the fragments at hand which of them are done with. */
static ovoid_status sift(ovoid_context *context, bounding *b) {
    ovoid_status status = OVOID_OK;
    const size_t count = b->now.count;
    b->now.count = 0;
    for (size_t n = 0; n < count; ++n)
        OV_TRY(keep(context, b, &b->now, &b->now.fragment[n]));
cleanup:
    return status;
}

/* What single triangles of the other surface say of the fragments. */
static ovoid_status bound_fragments(ovoid_context *context, bounding *b) {
    ovoid_status status = OVOID_OK;
    const size_t count = b->now.count;
    OV_TRY(make_room(context, b, 9 * count, count));
    for (size_t n = 0; n < count; ++n) {
        const fragment *const p = &b->now.fragment[n];
        for (size_t i = 0; i < 9; ++i)
            b->xyz[9 * n + i] = (float)p->at[i / 3][i % 3];
        b->squared[n] = (float)(p->most * p->most);
    }
    OV_TRY(ov_facets_reach(context, b->meter, b->facets, b->xyz, count, b->squared));
    for (size_t n = 0; n < count; ++n)
        b->now.fragment[n].most = fmin(b->now.fragment[n].most, no_less(b, b->squared[n]));
    b->bound->triangles += count;
    OV_TRY(sift(context, b));
cleanup:
    return status;
}

/* The middles of edges, each beside the corner opposite, and their distances. */
static ovoid_status measure_middles(ovoid_context *context, bounding *b) {
    ovoid_status status = OVOID_OK;
    const size_t count = b->now.count;
    const ov_sites sites = {.count = 3 * count, .xyz = b->xyz};
    for (size_t n = 0; n < count; ++n) {
        const fragment *const p = &b->now.fragment[n];
        for (size_t i = 0; i < 3; ++i)
            for (size_t k = 0; k < 3; ++k)
                b->xyz[9 * n + 3 * i + k] =
                    (float)(0.5 * (p->at[(i + 1) % 3][k] + p->at[(i + 2) % 3][k]));
    }
    OV_TRY(ov_facets_distances(context, b->meter, b->facets, &sites, b->squared));
cleanup:
    return status;
}

/* The four parts of a fragment: at each corner, and between the middles of the edges. */
static ovoid_status split(ovoid_context *context, bounding *b, const fragment *p,
                          const float squared[3]) {
    ovoid_status status = OVOID_OK;
    fragment middle = {.most = p->most};
    for (size_t i = 0; i < 3; ++i) {
        for (size_t k = 0; k < 3; ++k)
            middle.at[i][k] = 0.5 * (p->at[(i + 1) % 3][k] + p->at[(i + 2) % 3][k]);
        middle.distance[i] = no_less(b, squared[i]);
    }
    for (size_t i = 0; i < 4; ++i) {
        fragment part = middle;
        if (i < 3) {
            memcpy(part.at[i], p->at[i], sizeof part.at[i]);
            part.distance[i] = p->distance[i];
        }
        part.most = fmin(p->most, most_by_corners(&part));
        OV_TRY(keep(context, b, &b->next, &part));
    }
cleanup:
    return status;
}

/* Tells of the farthest of a fragment's middles if it is beyond the limit: *told. */
static ovoid_status tell_far(const bounding *b, const fragment *p, const float squared[3],
                             bool *told) {
    const size_t i = squared[1] > squared[0] ? (squared[2] > squared[1] ? 2 : 1)
                                             : (squared[2] > squared[0] ? 2 : 0);
    const double distance = sqrt((double)squared[i]);
    double at[3];
    *told = distance > b->limits->limit;
    if (!*told)
        return OVOID_OK;
    for (size_t k = 0; k < 3; ++k)
        at[k] = b->facets->origin[k] + 0.5 * (p->at[(i + 1) % 3][k] + p->at[(i + 2) % 3][k]);
    return b->limits->found(at, distance, b->limits->user);
}

static ovoid_status split_all(ovoid_context *context, bounding *b) {
    ovoid_status status = OVOID_OK;
    b->next.count = 0;
    OV_TRY(make_room(context, b, 9 * b->now.count, 3 * b->now.count));
    OV_TRY(measure_middles(context, b));
    if (!b->limits)
        raise_least(b, b->squared, 3 * b->now.count);
    for (size_t n = 0; n < b->now.count; ++n) {
        const fragment *const p = &b->now.fragment[n];
        bool told = false;
        if (b->limits)
            OV_TRY(tell_far(b, p, b->squared + 3 * n, &told));
        if (!told)
            OV_TRY(split(context, b, p, b->squared + 3 * n));
    }
    b->bound->split += b->now.count;
    const fragments done = b->now;
    b->now = b->next;
    b->next = done;
cleanup:
    return status;
}

/* Bounds the fragments at hand, or concedes what they may reach. */
static ovoid_status bound_piece(ovoid_context *context, bounding *b) {
    ovoid_status status = OVOID_OK;
    for (size_t round = 0; b->now.count > 0; ++round) {
        OV_TRY(bound_fragments(context, b));
        if (4 * b->now.count > FRAGMENTS) {
            b->loose = true;
            OV_TRY(sift(context, b));
        }
        if (4 * b->now.count > FRAGMENTS || round == ROUNDS)
            break;
        OV_TRY(split_all(context, b));
    }
    for (size_t n = 0; n < b->now.count; ++n)
        b->bound->most = fmax(b->bound->most, b->now.fragment[n].most);
    b->now.count = 0;
cleanup:
    return status;
}

/* All of a surface, piece by piece. known: as collect() has it. */
static ovoid_status bound_all(ovoid_context *context, bounding *b, const ov_trail *from,
                              const float *known) {
    ovoid_status status = OVOID_OK;
    OV_TRY(find_margin(context, from, b));
    OV_TRY(find_margin(context, &b->facets->trail, b));
    if (!b->limits)
        OV_TRY(know_corners(context, b, from, known));
    for (size_t k = 0; k < from->triangles;) {
        OV_TRY(collect(context, b, from, known, &k));
        OV_TRY(bound_piece(context, b));
    }
cleanup:
    bounding_destroy(b);
    return status;
}

ovoid_status ov_bound_add(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                          const ov_trail *from, const float *squared, ov_bound *bound) {
    bounding b = {.meter = meter, .facets = facets, .bound = bound};
    const ovoid_status status = bound_all(context, &b, from, squared);
    if (status == OVOID_OK)
        bound->most = fmax(bound->most, bound->least);
    return status;
}

ovoid_status ov_bound_exceed(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                             const ov_trail *from, const float *distance, const ov_limits *limits,
                             bool *whole) {
    ov_bound bound = {0};
    bounding b = {.meter = meter, .facets = facets, .bound = &bound, .limits = limits};
    const ovoid_status status = bound_all(context, &b, from, distance);
    *whole = bound.most <= limits->limit + limits->slack;
    return status;
}
