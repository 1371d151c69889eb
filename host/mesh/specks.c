#include "mesh/specks.h"

#include "field/quadric.h"
#include "mesh/case_table.h"
#include "mesh/march.h"
#include "mesh/small_pieces.h"
#include "mesh/speck_terms.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A piece is meshed on the first lattice that has so many points in it: nearly five across the
 * radius of a sphere, whose area is then right to 2e-4. */
#define POINTS_LEAST 500
/* Pieces of the lattice's mesh that a speck may replace are no longer than this, and lie in the
 * speck's box but for what rounding, and linear vertices, may add (lattice steps). */
#define SMALL_STEPS 16.0
#define EXACT_MARGIN 0.01
#define LINEAR_MARGIN 1.0
/* A piece with more points of the coarse lattice in it is left to that. */
#define MET_MOST 80
/* Lattice points of a box at most, and what a lattice index may be. */
#define POINTS_MOST ((size_t)1 << 21)
#define INDEX_MOST 1e12
/* The device rounds phi: within this share of the isovalue only its mesh tells what it found. */
#define ROUNDING 1e-4
/* Newton's steps of a vertex at most, and when it is there (lattice steps). */
#define VERTEX_STEPS 60
#define VERTEX_CLOSE 1e-12

enum { UNKNOWN = 0, OUTSIDE, INSIDE, PART }; /* of a lattice point; PART: of the piece looked at */

/* A box of a fine lattice about one term. */
typedef struct box {
    unsigned halvings;
    double spacing;
    int64_t low[3];
    size_t size[3], points;
} box;

typedef struct seeker {
    ovoid_context *context;
    const ov_body *bodies;
    const ovoid_mesh_options *options;
    const ov_lattice_mesh *lattice;
    ov_speck_terms terms;
    ov_case_table cases;
    const uint32_t *near_it; /* terms of the box at hand */
    size_t near_count;
    box box;
    uint8_t *state;    /* of its points */
    double *log_ratio; /* ln(phi / c) where the state is known */
    uint32_t *vertex;  /* of the edge along `axis` from point p: vertex[3 * p + axis] */
    uint32_t *part;    /* points of the piece */
    size_t state_room, ratio_room, vertex_room, part_room, part_count;
    size_t met;       /* of these, the ones of the coarse lattice that it has found inside */
    bool *done;       /* of all bodies: the piece about their centre has been looked at */
    bool have_pieces; /* of the coarse mesh: */
    ov_small_pieces pieces;
    ov_specks *specks;
} seeker;

/* ---- the field ---------------------------------------------------------------------------- */

/* ln(phi / c), and with `gradient` that of ln phi. */
static double log_ratio_at(const seeker *s, const double at[3], double gradient[3]) {
    double sum = 0.0, g[3] = {0};
    for (size_t k = 0; k < s->near_count; ++k) {
        const ov_quadric *const q = &s->bodies[s->near_it[k]].quadric;
        const double x = at[0] - q->centre[0], y = at[1] - q->centre[1], z = at[2] - q->centre[2];
        const double u = q->a[0] * x + q->a[1] * y + q->a[2] * z,
                     v = q->a[1] * x + q->a[3] * y + q->a[4] * z,
                     w = q->a[2] * x + q->a[4] * y + q->a[5] * z;
        const double e = q->amplitude * exp(-(x * u + y * v + z * w));
        sum += e;
        g[0] -= 2.0 * e * u;
        g[1] -= 2.0 * e * v;
        g[2] -= 2.0 * e * w;
    }
    for (int axis = 0; gradient && axis < 3; ++axis)
        gradient[axis] = sum > 0.0 ? g[axis] / sum : 0.0;
    return log(fmax(sum / s->options->isovalue, 1e-300));
}

static void index_of(const box *b, size_t point, int64_t index[3]) {
    index[0] = b->low[0] + (int64_t)(point % b->size[0]);
    index[1] = b->low[1] + (int64_t)(point / b->size[0] % b->size[1]);
    index[2] = b->low[2] + (int64_t)(point / (b->size[0] * b->size[1]));
}

static size_t stride_of(const box *b, unsigned axis) {
    return axis == 0 ? 1 : axis == 1 ? b->size[0] : b->size[0] * b->size[1];
}

/* Finds out whether a point lies inside. */
static void look_at(seeker *s, size_t point) {
    int64_t index[3];
    double at[3];
    if (s->state[point] != UNKNOWN)
        return;
    index_of(&s->box, point, index);
    for (int axis = 0; axis < 3; ++axis)
        at[axis] = (double)index[axis] * s->box.spacing;
    s->log_ratio[point] = log_ratio_at(s, at, NULL);
    s->state[point] = s->log_ratio[point] > 0.0 ? INSIDE : OUTSIDE;
}

/* ---- the piece about a term --------------------------------------------------------------- */

typedef enum outcome {
    IS_SPECK,
    IS_LARGE,
    LEAVES_BOX,
    IS_UNKNOWN /* it takes a finer lattice */
} outcome;

/* A box about a term (see ov_speck_half()). False: it would be too large. */
static bool lay_box(const seeker *s, const ov_body *body, unsigned halvings, double share, box *b) {
    double half[3], points = 1.0;
    *b = (box){.halvings = halvings, .spacing = ldexp(s->options->spacing, -(int)halvings)};
    ov_speck_half(body, s->options->isovalue, s->options->spacing, share, half);
    for (int axis = 0; axis < 3; ++axis) {
        const double centre = floor(body->quadric.centre[axis] / b->spacing + 0.5),
                     steps = ceil(half[axis] / b->spacing) + 2.0;
        points *= 2.0 * steps + 1.0;
        if (!(fabs(centre) < INDEX_MOST && points <= (double)POINTS_MOST))
            return false;
        b->low[axis] = (int64_t)(centre - steps);
        b->size[axis] = 2 * (size_t)steps + 1;
    }
    b->points = (size_t)points;
    return true;
}

static ovoid_status reserve_box(seeker *s) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = s->context;
    const size_t points = s->box.points;
    OV_TRY(ov_grow(context, &s->state, &s->state_room, points, sizeof *s->state, "specks"));
    OV_TRY(ov_grow(context, &s->log_ratio, &s->ratio_room, points, sizeof *s->log_ratio, "specks"));
    OV_TRY(ov_grow(context, &s->vertex, &s->vertex_room, 3 * points, sizeof *s->vertex, "specks"));
    OV_TRY(ov_grow(context, &s->part, &s->part_room, points, sizeof *s->part, "specks"));
    memset(s->state, UNKNOWN, points * sizeof *s->state);
cleanup:
    return status;
}

/* Whether a point is one of the coarse lattice too, and inside whatever the device's rounding. */
static bool is_met(const seeker *s, size_t point) {
    const int64_t step = (int64_t)1 << s->box.halvings;
    int64_t index[3];
    index_of(&s->box, point, index);
    for (int axis = 0; axis < 3; ++axis)
        if (index[axis] % step != 0)
            return false;
    return s->log_ratio[point] > ROUNDING;
}

static bool on_the_rim(const box *b, size_t point) {
    for (unsigned axis = 0; axis < 3; ++axis) {
        const size_t at = point / stride_of(b, axis) % b->size[axis];
        if (at == 0 || at + 1 == b->size[axis])
            return true;
    }
    return false;
}

/* Whether the middle of the box is in the piece about the term. */
static bool holds_middle(seeker *s, const ov_body *body) {
    static const double between[] = {0.25, 0.5, 0.75};
    const double *const centre = body->quadric.centre;
    int64_t index[3];
    look_at(s, s->box.points / 2);
    index_of(&s->box, s->box.points / 2, index);
    for (size_t k = 0; k < sizeof between / sizeof *between; ++k) {
        double at[3];
        for (int axis = 0; axis < 3; ++axis)
            at[axis] =
                centre[axis] + between[k] * ((double)index[axis] * s->box.spacing - centre[axis]);
        if (log_ratio_at(s, at, NULL) < 0.0)
            return false;
    }
    return s->state[s->box.points / 2] == INSIDE;
}

/* Adds the neighbours of a point that are in the piece. */
static void spread(seeker *s, size_t point) {
    for (unsigned side = 0; side < 6; ++side) {
        const size_t stride = stride_of(&s->box, side / 2),
                     next = side % 2 ? point + stride : point - stride;
        look_at(s, next);
        if (s->state[next] != INSIDE)
            continue;
        s->state[next] = PART;
        s->part[s->part_count++] = (uint32_t)next;
    }
}

/* Floods the piece from the middle of the box. */
static outcome flood(seeker *s, const ov_body *body) {
    s->part_count = s->met = 0;
    if (!holds_middle(s, body))
        return IS_UNKNOWN;
    s->state[s->box.points / 2] = PART;
    s->part[s->part_count++] = (uint32_t)(s->box.points / 2);
    for (size_t k = 0; k < s->part_count; ++k) {
        s->met += is_met(s, s->part[k]);
        if (s->met > MET_MOST)
            return IS_LARGE;
        if (on_the_rim(&s->box, s->part[k]))
            return LEAVES_BOX;
        spread(s, s->part[k]);
    }
    return s->part_count >= POINTS_LEAST || s->box.halvings == OV_SPECK_HALVINGS ? IS_SPECK
                                                                                 : IS_UNKNOWN;
}

/* On one lattice, in a small box first. What leaves the largest one is long: where the lattice has
 * points of it, those tell. */
static ovoid_status look_about(seeker *s, const ov_body *body, unsigned halvings, outcome *found) {
    static const double shares[] = {0.0, 0.1, 0.3, 1.0};
    *found = LEAVES_BOX;
    for (size_t k = 0; k < sizeof shares / sizeof *shares && *found == LEAVES_BOX; ++k) {
        if (!lay_box(s, body, halvings, shares[k], &s->box))
            return OVOID_OK;
        const ovoid_status status = reserve_box(s);
        if (status != OVOID_OK)
            return status;
        *found = flood(s, body);
    }
    if (*found == LEAVES_BOX && s->met > 0)
        *found = IS_LARGE;
    return OVOID_OK;
}

/* On finer and finer lattices. */
static ovoid_status look_closer(seeker *s, const ov_body *body, outcome *found) {
    *found = IS_UNKNOWN;
    for (unsigned k = 0; k <= OV_SPECK_HALVINGS && *found == IS_UNKNOWN; ++k) {
        const ovoid_status status = look_about(s, body, k, found);
        if (status != OVOID_OK)
            return status;
    }
    return OVOID_OK;
}

/* The terms whose centre lies in the piece, or within a step of it, have been looked at with it. */
static void mark_done(seeker *s) {
    const box *const b = &s->box;
    for (size_t k = 0; k < s->near_count; ++k) {
        const double *const centre = s->bodies[s->near_it[k]].quadric.centre;
        size_t point = 0;
        bool within = true;
        for (int axis = 2; axis >= 0; --axis) {
            const double at = floor(centre[axis] / b->spacing) - (double)b->low[axis];
            within &= at >= 0.0 && at + 1.0 < (double)b->size[axis];
            point = within ? point * b->size[axis] + (size_t)at : 0;
        }
        for (unsigned corner = 0; within && corner < 8; ++corner)
            if (s->state[point + (corner & 1u) + (corner >> 1 & 1u) * stride_of(b, 1) +
                         (corner >> 2) * stride_of(b, 2)] == PART)
                s->done[s->near_it[k]] = true;
    }
}

/* ---- its mesh ----------------------------------------------------------------------------- */

/* Where ln(phi / c) vanishes on the edge from `at` along `axis`: Newton's steps, halving the
 * bracket where one would leave it. log_low, log_high: at its ends. */
static double find_crossing(const seeker *s, const double at[3], unsigned axis, double log_low,
                            double log_high) {
    const double h = s->box.spacing;
    if (s->options->vertices == OVOID_VERTEX_LINEAR)
        return expm1(log_low) / (expm1(log_low) - expm1(log_high));
    double from = 0.0, to = 1.0, t = log_low / (log_low - log_high);
    for (int step = 0; step < VERTEX_STEPS; ++step) {
        double y[3] = {at[0], at[1], at[2]}, gradient[3];
        y[axis] += t * h;
        const double value = log_ratio_at(s, y, gradient);
        if ((value > 0.0) == (log_low > 0.0))
            from = t;
        else
            to = t;
        double next = t - value / (gradient[axis] * h);
        if (!(next > from && next < to))
            next = 0.5 * (from + to);
        const bool there = fabs(next - t) < VERTEX_CLOSE;
        t = next;
        if (there)
            break;
    }
    return t;
}

static ovoid_status grow_specks(seeker *s, size_t vertices, size_t triangles) {
    ovoid_status status = OVOID_OK;
    ov_specks *const made = s->specks;
    OV_TRY(ov_store_grow(s->context, made->store, &made->xyz, &made->xyz_room, 3 * vertices,
                         sizeof *made->xyz, "vertices"));
    OV_TRY(ov_store_grow(s->context, made->store, &made->normals, &made->normals_room, 3 * vertices,
                         sizeof *made->normals, "normals"));
    OV_TRY(ov_store_grow(s->context, made->store, &made->edge, &made->edge_room, vertices,
                         sizeof *made->edge, "vertices"));
    OV_TRY(ov_store_grow(s->context, made->store, &made->corners, &made->corners_room,
                         3 * triangles, sizeof *made->corners, "triangles"));
cleanup:
    return status;
}

/* The vertex on the edge from point `low` along `axis`. */
static void put_vertex(seeker *s, size_t low, unsigned axis) {
    ov_specks *const made = s->specks;
    const size_t v = made->vertices++, high = low + stride_of(&s->box, axis);
    int64_t index[3];
    double at[3], gradient[3], length = 0.0;
    s->vertex[3 * low + axis] = (uint32_t)v;
    index_of(&s->box, low, index);
    for (int k = 0; k < 3; ++k)
        at[k] = (double)index[k] * s->box.spacing;
    double t = find_crossing(s, at, axis, s->log_ratio[low], s->log_ratio[high]);
    t = fmin(fmax(t, OV_EDGE_MARGIN), 1.0 - OV_EDGE_MARGIN);
    at[axis] = ((double)index[axis] + t) * s->box.spacing;
    log_ratio_at(s, at, gradient);
    for (int k = 0; k < 3; ++k)
        length += gradient[k] * gradient[k];
    length = sqrt(length);
    for (int k = 0; k < 3; ++k) {
        made->xyz[3 * v + (size_t)k] = at[k];
        made->normals[3 * v + (size_t)k] = length > 0.0 ? (float)(-gradient[k] / length) : 0.0f;
    }
    made->edge[v] = (uint8_t)(axis | s->box.halvings << OV_EDGE_AXIS_BITS);
}

/* The vertices on the edges that leave the piece from a point of it. */
static ovoid_status put_vertices_about(seeker *s, size_t point) {
    const ovoid_status status = grow_specks(s, s->specks->vertices + 6, s->specks->triangles);
    for (unsigned side = 0; side < 6 && status == OVOID_OK; ++side) {
        const unsigned axis = side / 2;
        const size_t stride = stride_of(&s->box, axis);
        if (s->state[side % 2 ? point + stride : point - stride] != PART)
            put_vertex(s, side % 2 ? point : point - stride, axis);
    }
    return status;
}

static size_t corner_of(const box *b, size_t low, unsigned corner) {
    return low + (corner & 1u) + (corner >> 1 & 1u) * stride_of(b, 1) +
           (corner >> 2) * stride_of(b, 2);
}

/* The triangles of the cell whose low corner is this point. */
static ovoid_status put_cell(seeker *s, size_t low) {
    ov_specks *const made = s->specks;
    unsigned index = 0;
    for (unsigned corner = 0; corner < 8; ++corner)
        index |= (unsigned)(s->state[corner_of(&s->box, low, corner)] == PART) << corner;
    const uint8_t *const entry = s->cases.entry[index];
    const ovoid_status status = grow_specks(s, made->vertices, made->triangles + entry[0]);
    if (status != OVOID_OK)
        return status;
    for (size_t k = 0; k < 3 * (size_t)entry[0]; ++k) {
        const unsigned edge = entry[1 + k];
        made->corners[3 * made->triangles + k] =
            s->vertex[3 * corner_of(&s->box, low, edge % 8) + edge / 8];
    }
    made->triangles += entry[0];
    return OVOID_OK;
}

/* A cell is taken from its first corner in the piece, so that each is once. */
static bool is_first(const seeker *s, size_t low, unsigned corner) {
    for (unsigned before = 0; before < corner; ++before)
        if (s->state[corner_of(&s->box, low, before)] == PART)
            return false;
    return true;
}

static ovoid_status put_mesh(seeker *s) {
    ovoid_status status = OVOID_OK;
    for (size_t k = 0; k < s->part_count; ++k)
        OV_TRY(put_vertices_about(s, s->part[k]));
    for (size_t k = 0; k < s->part_count; ++k)
        for (unsigned corner = 0; corner < 8; ++corner) {
            const size_t low = s->part[k] - corner_of(&s->box, 0, corner);
            if (is_first(s, low, corner))
                OV_TRY(put_cell(s, low));
        }
cleanup:
    return status;
}

/* ---- the lattice's mesh ------------------------------------------------------------------- */

static ovoid_status find_pieces(seeker *s) {
    const ov_lattice_mesh *const mesh = s->lattice;
    if (s->have_pieces)
        return OVOID_OK;
    s->have_pieces = true;
    return ov_small_pieces_find(s->context, s->specks->store, mesh->at, mesh->user, mesh->vertices,
                                mesh->corners, mesh->triangles, SMALL_STEPS * s->options->spacing,
                                &s->pieces);
}

static void replace(const ov_small_piece *piece, void *user) {
    const seeker *const s = user;
    s->lattice->replaced[piece->root] = true;
}

/* Marks what the lattice has made of the piece; returns in how many pieces of its own. */
static size_t replace_pieces(seeker *s) {
    const double margin =
        s->options->spacing *
        (s->options->vertices == OVOID_VERTEX_LINEAR ? LINEAR_MARGIN : EXACT_MARGIN);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t k = 0; k < s->part_count; ++k) {
        int64_t index[3];
        index_of(&s->box, s->part[k], index);
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = fmin(low[axis], (double)(index[axis] - 1) * s->box.spacing - margin);
            high[axis] = fmax(high[axis], (double)(index[axis] + 1) * s->box.spacing + margin);
        }
    }
    return ov_small_pieces_within(&s->pieces, low, high, replace, s);
}

/* From first vertices to all of their pieces. */
static void spread_replaced(seeker *s) {
    for (size_t v = 0; s->have_pieces && v < s->lattice->vertices; ++v) {
        ov_store_turn(s->specks->store, v);
        s->lattice->replaced[v] = s->lattice->replaced[s->pieces.root[v]];
    }
}

/* ---- all of them -------------------------------------------------------------------------- */

static ovoid_status seek(seeker *s, size_t k) {
    ovoid_status status = OVOID_OK;
    outcome found;
    s->near_it = s->terms.near_it + s->terms.start[k];
    s->near_count = s->terms.start[k + 1] - s->terms.start[k];
    OV_TRY(look_closer(s, &s->bodies[s->terms.term[k]], &found));
    if (found == IS_SPECK) {
        mark_done(s);
        OV_TRY(find_pieces(s));
        if (replace_pieces(s) > 0 || s->met == 0)
            OV_TRY(put_mesh(s));
    }
    s->specks->missed += found == IS_UNKNOWN || found == LEAVES_BOX;
cleanup:
    return status;
}

ovoid_status ov_specks_find(ovoid_context *context, const ov_body *bodies, size_t count,
                            const ovoid_mesh_options *options, double cutoff,
                            const ov_lattice_mesh *lattice, ov_specks *specks) {
    ovoid_status status = OVOID_OK;
    seeker s = {.context = context,
                .bodies = bodies,
                .options = options,
                .lattice = lattice,
                .specks = specks};
    OV_TRY(ov_speck_terms_find(context, bodies, count, options->isovalue, cutoff, options->spacing,
                               &s.terms));
    if (s.terms.count == 0)
        goto cleanup;
    ov_case_table_make(&s.cases);
    s.done = ov_alloc(context, count, sizeof *s.done, "specks");
    if (!s.done) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t k = 0; k < s.terms.count; ++k) {
        ov_store_turn(specks->store, k);
        if (!s.done[s.terms.term[k]])
            OV_TRY(seek(&s, k));
    }
    spread_replaced(&s);
cleanup:
    ov_speck_terms_destroy(&s.terms);
    free(s.state);
    free(s.log_ratio);
    free(s.vertex);
    free(s.part);
    free(s.done);
    ov_small_pieces_destroy(&s.pieces);
    return status;
}

void ov_specks_destroy(ov_specks *specks) {
    void *const arrays[] = {specks->xyz, specks->normals, specks->edge, specks->corners};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k)
        ov_store_free(specks->store, arrays[k]);
    memset(specks, 0, sizeof *specks);
}
