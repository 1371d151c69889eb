#include "mesh/pieces.h"

#include "field/bricks.h"
#include "field/work.h"
#include "model/ellipsoid.h"
#include "model/factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_body_of_atom(const double xyzr[4], double decay, ov_body *body) {
    ov_quadric quadric;
    ov_quadric_of_atom(xyzr, decay, &quadric);
    ov_body_of_ball(&quadric, decay, body);
}

void ov_body_of_ball(const ov_quadric *quadric, double decay, ov_body *body) {
    body->quadric = *quadric;
    for (int axis = 0; axis < 3; ++axis)
        body->extent[axis] = 1.0 / sqrt(decay);
    body->least = 1.0 / sqrt(decay);
}

/* Half-sides sqrt((A^-1)_kk), from A's own axes: the inverse of a long needle's A is all rounding.
 */
void ov_body_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_body *body) {
    double r[3][3];
    ov_quadric_of_ellipsoid(ellipsoid, &body->quadric);
    ov_rotation(ellipsoid->angle, r);
    for (int axis = 0; axis < 3; ++axis) {
        double sum = 0.0;
        for (int p = 0; p < 3; ++p)
            sum += r[p][axis] * r[p][axis] / ellipsoid->decay[p];
        body->extent[axis] = sqrt(sum);
    }
    body->least =
        1.0 / sqrt(fmax(fmax(ellipsoid->decay[0], ellipsoid->decay[1]), ellipsoid->decay[2]));
}

ovoid_status ov_bodies_of_quadrics(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                                   ov_body **bodies) {
    ov_body *const made = ov_alloc(context, count, sizeof *made, "ellipsoids");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; ++i) {
        ovoid_ellipsoid ellipsoid;
        ov_ellipsoid_of_quadric(&quadrics[i], &ellipsoid);
        ov_body_of_ellipsoid(&ellipsoid, &made[i]);
    }
    *bodies = made;
    return OVOID_OK;
}

double ov_body_reach(const ov_body *body, double value) {
    const double q = log(body->quadric.amplitude / value);
    return q > 0.0 ? sqrt(q) : -1.0;
}

/* (distance / half-side)^2 from which on a term is not looked at, and more than the share of the
 * isovalue that all of them come to: amplitudes are below 2^127. */
#define FAR 150.0
#define FAR_SUM 1e-6

/* What a lattice index may be; differences and doubles stay exact far beyond. */
#define INDEX_LIMIT 1e12

static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

typedef struct planner {
    const ov_body *bodies;
    size_t count;
    double isovalue;
    double cutoff, threshold; /* values that count as reaching a piece, and as making it one */
    ov_pieces *pieces;
    uint64_t *keys;  /* of all pairs of a piece and a term that reaches it */
    uint32_t *terms; /* of the pairs */
    bool *marked;    /* whether the term reaches the threshold there */
    uint32_t *order;
    size_t pairs;
} planner;

static ovoid_status fail_large(ovoid_context *context, double spacing) {
    return ov_fail(context, OVOID_ERROR_LIMIT,
                   "the lattice about the surface is too large for a spacing of %g angstrom; use a "
                   "larger one",
                   spacing);
}

/* The most that phi can be where coordinate `axis` is x: each term is largest where its axis
 * through the centre meets that plane. */
static double most_at(const planner *p, int axis, double x) {
    double sum = 0.0;
    for (size_t i = 0; i < p->count; ++i) {
        const ov_body *const body = &p->bodies[i];
        const double off = (x - body->quadric.centre[axis]) / body->extent[axis];
        if (off * off < FAR)
            sum += body->quadric.amplitude * exp(-off * off);
    }
    return sum + FAR_SUM * p->isovalue;
}

/* The lattice index between `out`, beyond which there is no surface, and `in`, up to which terms
 * only grow, where phi may first come up to the isovalue. */
static double first_near(const planner *p, int axis, double out, double in) {
    while (fabs(in - out) > 1.0) {
        const double middle = floor(0.5 * (out + in));
        if (most_at(p, axis, middle * p->pieces->spacing) < p->isovalue)
            out = middle;
        else
            in = middle;
    }
    return out;
}

/* Makes the box of everything that reaches the threshold smaller, where all of it together is too
 * little: long faint terms reach far, and few of them. */
static void tighten(const planner *p, double low[3], double high[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        double first = INFINITY, last = -INFINITY;
        if (!(low[axis] > -INDEX_LIMIT && high[axis] < INDEX_LIMIT))
            continue;
        for (size_t i = 0; i < p->count; ++i) {
            const double centre = p->bodies[i].quadric.centre[axis] / p->pieces->spacing;
            first = fmin(first, centre);
            last = fmax(last, centre);
        }
        if (first > low[axis])
            low[axis] = first_near(p, axis, low[axis], floor(first));
        if (last < high[axis])
            high[axis] = first_near(p, axis, high[axis], ceil(last));
    }
}

/* The box of everything that reaches the threshold, as lattice indices. False if nothing does. */
static bool bounds(const planner *p, double low[3], double high[3]) {
    bool any = false;
    for (size_t i = 0; i < p->count; ++i) {
        const ov_body *const body = &p->bodies[i];
        const double reach = ov_body_reach(body, p->threshold);
        if (reach < 0.0)
            continue;
        for (int axis = 0; axis < 3; ++axis) {
            const double half = reach * body->extent[axis], centre = body->quadric.centre[axis];
            const double from = floor((centre - half) / p->pieces->spacing),
                         to = ceil((centre + half) / p->pieces->spacing);
            low[axis] = any ? fmin(low[axis], from) : from;
            high[axis] = any ? fmax(high[axis], to) : to;
        }
        any = true;
    }
    return any;
}

/* Ends the box, as lattice indices, where another one does. False if nothing is left. */
static bool cut_off(double spacing, double clip[2][3], double low[3], double high[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        low[axis] = fmax(low[axis], floor(clip[0][axis] / spacing));
        high[axis] = fmin(high[axis], ceil(clip[1][axis] / spacing));
        if (low[axis] > high[axis])
            return false;
    }
    return true;
}

/* A piece grows by this factor at most, along an axis, to be as large as is wanted. */
#define WANTED_MOST 1.25

/* Cuts the box, grown by one point for the cells below it, into equal pieces of whole bricks. */
static ovoid_status plan(ovoid_context *context, const planner *p, const uint64_t limit[3],
                         const uint64_t wanted[3], double clip[2][3]) {
    ov_pieces *const pieces = p->pieces;
    double low[3] = {0}, high[3] = {0}, total = 1.0;
    if (!bounds(p, low, high))
        return OVOID_OK;
    tighten(p, low, high);
    if (clip && !cut_off(pieces->spacing, clip, low, high))
        return OVOID_OK;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(low[axis] > -INDEX_LIMIT && high[axis] < INDEX_LIMIT))
            return fail_large(context, pieces->spacing);
        const uint64_t size = (uint64_t)(high[axis] - low[axis]) + 3;
        const uint64_t count = (size + limit[axis] - 1) / limit[axis];
        pieces->origin[axis] = (int64_t)low[axis] - 1;
        pieces->last[axis] = (int64_t)high[axis] + 1;
        pieces->size[axis] = (size + count * brick[axis] - 1) / (count * brick[axis]) * brick[axis];
        if (wanted && wanted[axis] >= pieces->size[axis] && wanted[axis] <= limit[axis] &&
            (double)wanted[axis] <= WANTED_MOST * (double)pieces->size[axis])
            pieces->size[axis] = wanted[axis];
        pieces->count[axis] = (size + pieces->size[axis] - 1) / pieces->size[axis];
        total *= (double)pieces->count[axis];
    }
    return total < 9e18 ? OVOID_OK : fail_large(context, pieces->spacing);
}

/* What rounding may add to a reach, in lattice steps. */
#define MARGIN 0.5

/* Pieces along an axis that an interval reaches, one lattice step about them included. */
static void piece_range(const ov_pieces *pieces, int axis, double centre, double half,
                        uint64_t *first, uint64_t *end) {
    const double size = (double)pieces->size[axis], origin = (double)pieces->origin[axis];
    const double from = (centre - half) / pieces->spacing - origin - MARGIN,
                 to = (centre + half) / pieces->spacing - origin + MARGIN;
    const double low = fmax(ceil(from / size) - 1.0, 0.0),
                 high = fmin(floor((to + 1.0) / size) + 1.0, (double)pieces->count[axis]);
    *first = (uint64_t)low;
    *end = high > low ? (uint64_t)high : *first;
}

static void term_range(const planner *p, const ov_body *body, double value, uint64_t first[3],
                       uint64_t end[3]) {
    const double reach = ov_body_reach(body, value);
    for (int axis = 0; axis < 3; ++axis) {
        first[axis] = end[axis] = 0;
        if (reach >= 0.0)
            piece_range(p->pieces, axis, body->quadric.centre[axis], reach * body->extent[axis],
                        &first[axis], &end[axis]);
    }
}

static bool in_range(const uint64_t at[3], const uint64_t first[3], const uint64_t end[3]) {
    for (int axis = 0; axis < 3; ++axis)
        if (at[axis] < first[axis] || at[axis] >= end[axis])
            return false;
    return true;
}

/* Pairs of a piece and a term that reaches the value in it; *most: of one term. */
static double count_pairs(const planner *p, double value, double *most) {
    double pairs = 0.0;
    uint64_t first[3], end[3];
    *most = 0.0;
    for (size_t i = 0; i < p->count; ++i) {
        term_range(p, &p->bodies[i], value, first, end);
        const double own =
            (double)(end[0] - first[0]) * (double)(end[1] - first[1]) * (double)(end[2] - first[2]);
        pairs += own;
        *most = fmax(*most, own);
    }
    return pairs;
}

static void list_pairs(planner *p, size_t term) {
    uint64_t first[3], end[3], near_first[3], near_end[3], at[3];
    const uint64_t *const count = p->pieces->count;
    term_range(p, &p->bodies[term], p->cutoff, first, end);
    term_range(p, &p->bodies[term], p->threshold, near_first, near_end);
    for (at[2] = first[2]; at[2] < end[2]; ++at[2])
        for (at[1] = first[1]; at[1] < end[1]; ++at[1])
            for (at[0] = first[0]; at[0] < end[0]; ++at[0], ++p->pairs) {
                p->keys[p->pairs] = (at[2] * count[1] + at[1]) * count[0] + at[0];
                p->terms[p->pairs] = (uint32_t)term;
                p->marked[p->pairs] = in_range(at, near_first, near_end);
            }
}

/* Takes over the pairs of pieces that some term marks. */
static void keep_pieces(planner *p) {
    ov_pieces *const pieces = p->pieces;
    size_t kept = 0;
    for (size_t first = 0, end; first < p->pairs; first = end) {
        const uint64_t key = p->keys[p->order[first]];
        bool marked = false;
        for (end = first; end < p->pairs && p->keys[p->order[end]] == key; ++end)
            marked |= p->marked[p->order[end]];
        if (!marked)
            continue;
        pieces->key[pieces->pieces] = key;
        pieces->start[pieces->pieces++] = kept;
        for (size_t k = first; k < end; ++k)
            pieces->term[kept++] = p->terms[p->order[k]];
    }
    pieces->start[pieces->pieces] = kept;
}

/* Values of terms at lattice points, about: in its ellipsoid {q <= s^2} a term counts. */
static double count_values(const planner *p) {
    const double cell = pow(p->pieces->spacing, 3);
    double values = 0.0;
    for (size_t i = 0; i < p->count; ++i) {
        const double *const a = p->bodies[i].quadric.a;
        const double reach = fmax(0.0, ov_body_reach(&p->bodies[i], p->cutoff));
        const double determinant = a[0] * (a[3] * a[5] - a[4] * a[4]) -
                                   a[1] * (a[1] * a[5] - a[4] * a[2]) +
                                   a[2] * (a[1] * a[4] - a[3] * a[2]);
        if (determinant > 0.0)
            values += 4.19 * pow(reach, 3) / (sqrt(determinant) * cell);
    }
    return values;
}

/* Refuses what is too much: so many pieces at least and at most. */
static ovoid_status check_work(ovoid_context *context, const planner *p, double least,
                               double most) {
    const uint64_t *const size = p->pieces->size;
    const double points = (double)size[0] * (double)size[1] * (double)size[2];
    const ov_work work = {.points_least = least * points,
                          .points_most = most * points,
                          .values = count_values(p),
                          .terms = p->count,
                          .spacing = p->pieces->spacing,
                          .what = "the surface"};
    return ov_work_check(context, &work);
}

/* Before pieces are told apart: at least those of one term, and at most all of the box or all that
 * terms reach. */
static ovoid_status check_bounds(ovoid_context *context, const planner *p) {
    const uint64_t *const count = p->pieces->count;
    double most;
    const double box = (double)count[0] * (double)count[1] * (double)count[2],
                 pairs = count_pairs(p, p->threshold, &most);
    return check_work(context, p, most, fmin(box, pairs));
}

static ovoid_status sort_pairs(ovoid_context *context, planner *p) {
    ov_pieces *const pieces = p->pieces;
    double most;
    const ovoid_status bound = check_bounds(context, p);
    if (bound != OVOID_OK)
        return bound;
    const double pairs = count_pairs(p, p->cutoff, &most);
    if (!(pairs < (double)UINT32_MAX))
        return fail_large(context, pieces->spacing);
    const size_t room = (size_t)pairs;
    p->keys = ov_alloc(context, room, sizeof *p->keys, "pieces of the lattice");
    p->terms = ov_alloc(context, room, sizeof *p->terms, "pieces of the lattice");
    p->marked = ov_alloc(context, room, sizeof *p->marked, "pieces of the lattice");
    p->order = ov_alloc(context, room, sizeof *p->order, "pieces of the lattice");
    if (!p->keys || !p->terms || !p->marked || !p->order)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < p->count; ++i)
        list_pairs(p, i);
    const ovoid_status status = ov_sort_keys(context, p->keys, p->pairs, p->order);
    if (status != OVOID_OK)
        return status;
    size_t different = 0;
    for (size_t k = 0; k < p->pairs; ++k)
        different += k == 0 || p->keys[p->order[k]] != p->keys[p->order[k - 1]];
    pieces->key = ov_alloc(context, different, sizeof *pieces->key, "pieces of the lattice");
    pieces->start = ov_alloc(context, different + 1, sizeof *pieces->start, "pieces' terms");
    pieces->term = ov_alloc(context, p->pairs, sizeof *pieces->term, "pieces' terms");
    if (!pieces->key || !pieces->start || !pieces->term)
        return OVOID_ERROR_MEMORY;
    keep_pieces(p);
    return check_work(context, p, (double)pieces->pieces, (double)pieces->pieces);
}

ovoid_status ov_pieces_create(ovoid_context *context, const ov_body *bodies, size_t count,
                              double isovalue, double cutoff, double spacing,
                              const uint64_t limit[3], const uint64_t wanted[3], double clip[2][3],
                              ov_pieces *pieces) {
    ovoid_status status = OVOID_OK;
    ov_pieces made = {.spacing = spacing};
    planner p = {.bodies = bodies,
                 .count = count,
                 .isovalue = isovalue,
                 .cutoff = cutoff,
                 .threshold = fmax(isovalue / (double)count, cutoff),
                 .pieces = &made};
    OV_TRY(plan(context, &p, limit, wanted, clip));
    if (made.count[0] > 0)
        OV_TRY(sort_pairs(context, &p));
cleanup:
    free(p.keys);
    free(p.terms);
    free(p.marked);
    free(p.order);
    if (status == OVOID_OK)
        *pieces = made;
    else
        ov_pieces_destroy(&made);
    return status;
}

void ov_pieces_destroy(ov_pieces *pieces) {
    free(pieces->key);
    free(pieces->start);
    free(pieces->term);
    memset(pieces, 0, sizeof *pieces);
}

size_t ov_first_key(const uint64_t *keys, size_t count, uint64_t key) {
    size_t low = 0, high = count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (keys[middle] < key)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

size_t ov_pieces_find(const ov_pieces *pieces, uint64_t key) {
    const size_t at = ov_first_key(pieces->key, pieces->pieces, key);
    return at < pieces->pieces && pieces->key[at] == key ? at : pieces->pieces;
}
