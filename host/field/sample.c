#include "field/bricks.h"
#include "field/piece_grid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

/* Bytes on the device per constrained point: coordinates, phi, its gradient, and what a fit adds.
 */
#define BYTES_PER_POINT 100

typedef struct sampler {
    const double *xyzr;
    size_t atoms;
    double decay;
    const ov_lattice *lattice;
    ov_band band;
    ov_sampling sampling;
    double origin[3]; /* of the samples */
    ov_piece_grid pieces;
    ov_points points; /* of one piece, relative to its corner */
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
    ov_buffer value, gradient;
    float *values;        /* of one piece */
    uint32_t *order;      /* its packs as bricks */
    ov_quadric *quadrics; /* of one piece's atoms */
    size_t quadrics_capacity;
    double *kept;                     /* x, y, z */
    size_t kept_count, kept_capacity; /* capacity in floats */
    size_t band_count;                /* of the kept points, those within [low, high] */
    uint64_t kept_limit;
} sampler;

/* Lattice points along an axis at most; numbers of pieces stay exact. */
#define STEPS_MOST 1e12

ovoid_status ov_lattice_create(ovoid_context *context, const double *xyzr, size_t atoms,
                               double spacing, double padding, ov_lattice *lattice) {
    for (size_t axis = 0; axis < 3; ++axis) {
        double low = xyzr[axis], high = xyzr[axis];
        for (size_t i = 1; i < atoms; ++i) {
            low = fmin(low, xyzr[4 * i + axis]);
            high = fmax(high, xyzr[4 * i + axis]);
        }
        low -= padding;
        high += padding;
        const double steps = fmax(1.0, ceil((high - low) / spacing - 1e-9));
        if (!(steps < STEPS_MOST))
            return ov_fail(
                context, OVOID_ERROR_LIMIT,
                "the lattice of constrained points would have %.1e points along an axis at a "
                "spacing of %g angstrom, more than %.0e; use a larger spacing",
                steps, spacing, STEPS_MOST);
        lattice->low[axis] = low;
        lattice->size[axis] = (uint64_t)steps;
        lattice->step[axis] = (high - low) / steps;
    }
    return OVOID_OK;
}

/* Coordinate of lattice index i = 0 .. size - 1; the paper counts from 1. */
static double coordinate(const ov_lattice *lattice, size_t axis, uint64_t i) {
    return lattice->low[axis] + (double)(i + 1) * lattice->step[axis];
}

static double resolution_of(const sampler *s) {
    const double *const step = s->lattice->step;
    return fmax(step[0], fmax(step[1], step[2]));
}

/* How far (angstrom) an atom's Gaussian reaches the cut-off. */
static double reach_of(const sampler *s, double radius) {
    return sqrt(radius * radius - log(OV_TARGET_CUTOFF) / s->decay);
}

/* The bricks of a piece, along a curve, as the tree over them wants it; the same for all pieces
 * since each has its own origin. */
static ovoid_status lay_piece(ovoid_context *context, sampler *s) {
    uint64_t bricks[3];
    for (size_t axis = 0; axis < 3; ++axis)
        bricks[axis] = s->pieces.size[axis] / brick[axis];
    const size_t packs = (size_t)(bricks[0] * bricks[1] * bricks[2]);
    s->order = ov_alloc(context, packs, sizeof *s->order, "lattice bricks");
    s->values = ov_alloc(context, packs * OV_PACK, sizeof *s->values, "lattice values");
    if (!s->order || !s->values)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_bricks_order(context, bricks, s->order);
    if (status != OVOID_OK)
        return status;
    return ov_bricks_upload(context, bricks, s->order, s->lattice->step, false, &s->points);
}

/* phi at the points of one piece, into s->values. */
static ovoid_status evaluate_piece(ovoid_context *context, sampler *s, size_t piece,
                                   const uint64_t at[3]) {
    ovoid_status status = OVOID_OK;
    const size_t first = s->pieces.start[piece], count = s->pieces.start[piece + 1] - first;
    const size_t bytes = s->points.packs * OV_PACK * sizeof *s->values;
    if (count == 0) {
        memset(s->values, 0, bytes);
        return OVOID_OK;
    }
    OV_TRY(ov_grow(context, &s->quadrics, &s->quadrics_capacity, count, sizeof *s->quadrics,
                   "atoms of a lattice piece"));
    for (size_t k = 0; k < count; ++k)
        ov_quadric_of_atom(s->xyzr + 4 * (size_t)s->pieces.atom[first + k], s->decay,
                           &s->quadrics[k]);
    double corner[3];
    for (size_t axis = 0; axis < 3; ++axis)
        corner[axis] = coordinate(s->lattice, axis, at[axis]);
    OV_TRY(ov_terms_set(context, &s->terms, s->quadrics, count, corner, OV_TARGET_CUTOFF));
    s->lists.packs_only = true;
    OV_TRY(ov_lists_build(context, &s->lists, &s->points, &s->terms, 0.0));
    OV_TRY(ov_field(context, &s->operations, &s->points, &s->terms, &s->lists, &s->value));
    OV_TRY(ov_buffer_read(context, &s->value, 0, s->values, bytes));
cleanup:
    return status;
}

/* A band that reaches down to 0 holds all of space outside the molecule: say so before memory ends.
 */
static ovoid_status check_room(ovoid_context *context, const sampler *s, uint64_t points) {
    if (points <= s->kept_limit)
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_LIMIT,
                   "at least %llu constrained points, and the device has memory for %llu; use a "
                   "larger spacing or a smaller padding",
                   (unsigned long long)points, (unsigned long long)s->kept_limit);
}

/* Points on the lattice within the piece, those whose indices are multiples of step. */
static uint64_t points_in_piece(const sampler *s, size_t piece, uint64_t step) {
    uint64_t points = 1, at[3];
    ov_piece_grid_at(&s->pieces, piece, at);
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t first = at[axis] * s->pieces.size[axis];
        const uint64_t left = s->lattice->size[axis] - first;
        const uint64_t end = first + (left < s->pieces.size[axis] ? left : s->pieces.size[axis]);
        points *= (end + step - 1) / step - (first + step - 1) / step;
    }
    return points;
}

/* Least phi of the points that are kept. */
static double lowest(ov_band band) {
    return band.outside_every ? fmin(band.outside_low, band.low) : band.low;
}

/* What pieces without atoms hold is known, which bounds the count before any is evaluated: all of
 * their points, the outside's guards, or none. */
static ovoid_status check_empty_pieces(ovoid_context *context, const sampler *s) {
    uint64_t points = 0;
    const uint64_t step = s->band.low <= 0.0 ? 1 : s->band.outside_every;
    if (lowest(s->band) > 0.0)
        return OVOID_OK;
    for (size_t p = 0; p < s->pieces.pieces; ++p)
        if (s->pieces.start[p] == s->pieces.start[p + 1])
            points += points_in_piece(s, p, step);
    return check_room(context, s, points);
}

static bool every(uint32_t step, const uint64_t index[3]) {
    return step > 0 && index[0] % step == 0 && index[1] % step == 0 && index[2] % step == 0;
}

static bool is_kept(ov_band band, float value, const uint64_t index[3]) {
    if (value > band.high)
        return every(band.inside_every, index);
    return value >= band.low || (value >= band.outside_low && every(band.outside_every, index));
}

/* Whether a point is beyond the box of a part. */
static bool is_beyond(const sampler *s, const double at[3]) {
    for (size_t axis = 0; s->sampling.part && axis < 3; ++axis)
        if (at[axis] < s->sampling.part[0][axis] || at[axis] > s->sampling.part[1][axis])
            return true;
    return false;
}

/* Appends point j of the brick that begins at lattice point `first`, if it is on the lattice and
 * kept. */
static void keep_point(sampler *s, const uint64_t first[3], uint64_t j, float value, double least) {
    if (!(value >= least) && !s->sampling.part)
        return;
    uint64_t index[3];
    ov_brick_point(j, index);
    for (size_t axis = 0; axis < 3; ++axis) {
        index[axis] += first[axis];
        if (index[axis] >= s->lattice->size[axis])
            return;
    }
    double *const at = s->kept + 3 * s->kept_count;
    for (size_t axis = 0; axis < 3; ++axis)
        at[axis] = coordinate(s->lattice, axis, index[axis]);
    const bool beyond = is_beyond(s, at);
    if (beyond ? !every(s->band.outside_every, index) : !is_kept(s->band, value, index))
        return;
    ++s->kept_count;
    if (beyond)
        return;
    s->band_count += value >= s->band.low && value <= s->band.high;
}

/* Appends the piece's points that lie on the lattice and are kept. */
static ovoid_status keep_band(ovoid_context *context, sampler *s, const uint64_t at[3]) {
    const uint64_t *const size = s->pieces.size;
    const uint64_t row = size[0] / OV_BRICK_X, rows = size[1] / OV_BRICK_Y;
    const double least = lowest(s->band);
    const ovoid_status status =
        ov_grow(context, &s->kept, &s->kept_capacity, 3 * (s->kept_count + s->points.count),
                sizeof *s->kept, "constrained points");
    if (status != OVOID_OK)
        return status;
    for (size_t k = 0; k < s->points.packs; ++k) {
        const uint64_t pack = s->order[k];
        const uint64_t first[3] = {at[0] + pack % row * OV_BRICK_X,
                                   at[1] + pack / row % rows * OV_BRICK_Y,
                                   at[2] + pack / (row * rows) * OV_BRICK_Z};
        for (uint64_t j = 0; j < OV_PACK; ++j)
            keep_point(s, first, j, s->values[k * OV_PACK + j], least);
    }
    return check_room(context, s, s->kept_count);
}

static ovoid_status ask_to_go_on(ovoid_context *context, const sampler *s) {
    if (!s->sampling.go_on || s->sampling.go_on(s->kept_count, s->sampling.user))
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_CANCELLED, "stopped while sampling");
}

static ovoid_status sample_pieces(ovoid_context *context, sampler *s) {
    ovoid_status status = OVOID_OK;
    for (size_t piece = 0; piece < s->pieces.pieces; ++piece) {
        uint64_t at[3];
        if (s->pieces.start[piece] == s->pieces.start[piece + 1] && lowest(s->band) > 0.0)
            continue; /* far outside, and the band has no such points */
        ov_piece_grid_at(&s->pieces, piece, at);
        for (int axis = 0; axis < 3; ++axis)
            at[axis] *= s->pieces.size[axis];
        OV_TRY(evaluate_piece(context, s, piece, at));
        OV_TRY(keep_band(context, s, at));
        OV_TRY(ask_to_go_on(context, s));
    }
    if (s->band_count == 0) /* guards alone say nothing about the surface */
        status = ov_fail(context, OVOID_ERROR_EMPTY,
                         "no lattice point has a field between %g and %g; use a smaller spacing or "
                         "a larger padding",
                         s->band.low, s->band.high);
cleanup:
    return status;
}

/* Frees what the lattice's pieces took. */
static void drop_pieces(sampler *s) {
    free(s->values);
    free(s->kept);
    s->values = NULL;
    s->kept = NULL;
    s->kept_capacity = 0;
    ov_points_destroy(&s->points);
    ov_buffer_destroy(&s->value);
}

/* ---- phi and its gradient at the kept points ----------------------------------------------- */

/* Packs at once: a quarter of a million points, so that their lists stay small however many there
 * are. */
#define SLICE ((size_t)1 << 14)

/* The packs first .. first + points->packs - 1 of the samples, as points of their own. */
static ovoid_status take_slice(ovoid_context *context, const ov_points *all, size_t first,
                               ov_points *slice) {
    ovoid_status status = OVOID_OK;
    const size_t pack = 3 * OV_PACK * sizeof(float), packs = slice->packs;
    float *const packed = ov_alloc(context, packs, pack, "packed points");
    slice->pack_origin =
        ov_alloc(context, packs * 4, sizeof *slice->pack_origin, "origins of packs");
    if (!packed || !slice->pack_origin) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    memcpy(slice->origin, all->origin, sizeof all->origin);
    memcpy(slice->pack_origin, all->pack_origin + 4 * first, packs * 4 * sizeof(float));
    OV_TRY(ov_buffer_read(context, &all->xyz, first * pack, packed, packs * pack));
    OV_TRY(ov_points_upload(context, packed, slice));
cleanup:
    free(packed);
    return status;
}

/* The box about the packs of a slice, whose points are within `reach` of their packs' origins. */
static void bound_slice(const ov_points *slice, double reach, double low[3], double high[3]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = INFINITY;
        high[axis] = -INFINITY;
        for (size_t pack = 0; pack < slice->packs; ++pack) {
            const double at = slice->origin[axis] + (double)slice->pack_origin[4 * pack + axis];
            low[axis] = at < low[axis] ? at : low[axis];
            high[axis] = at > high[axis] ? at : high[axis];
        }
        low[axis] -= reach;
        high[axis] += reach;
    }
}

/* The Gaussians of the atoms that may reach the slice, as terms. */
static ovoid_status set_slice_terms(ovoid_context *context, sampler *s, const ov_points *slice) {
    double low[3], high[3];
    size_t count = 0;
    ovoid_status status = ov_grow(context, &s->quadrics, &s->quadrics_capacity, s->atoms,
                                  sizeof *s->quadrics, "atoms");
    if (status != OVOID_OK)
        return status;
    bound_slice(slice, ov_points_pack_reach(resolution_of(s)), low, high);
    for (size_t i = 0; i < s->atoms; ++i) {
        const double *const a = s->xyzr + 4 * i;
        const double reach = reach_of(s, a[3]);
        bool near = true;
        for (size_t axis = 0; axis < 3; ++axis)
            near = near && a[axis] >= low[axis] - reach && a[axis] <= high[axis] + reach;
        if (near)
            ov_quadric_of_atom(a, s->decay, &s->quadrics[count++]);
    }
    return ov_terms_set(context, &s->terms, s->quadrics, count, slice->origin, OV_TARGET_CUTOFF);
}

/* Makes the values 0 at a slice's points beyond the box of a part. */
static ovoid_status clear_beyond(ovoid_context *context, const sampler *s, const ov_points *slice,
                                 float *values) {
    ovoid_status status = OVOID_OK;
    const size_t floats = slice->packs * 3 * OV_PACK;
    if (!s->sampling.part)
        return OVOID_OK;
    float *const xyz = ov_alloc(context, floats, sizeof *xyz, "packed points");
    if (!xyz)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_buffer_read(context, &slice->xyz, 0, xyz, floats * sizeof *xyz));
    for (size_t k = 0; k < slice->packs * OV_PACK; ++k) {
        double at[3];
        for (size_t axis = 0; axis < 3; ++axis)
            at[axis] = slice->origin[axis] + (double)slice->pack_origin[4 * (k / OV_PACK) + axis] +
                       (double)xyz[k / OV_PACK * (3 * OV_PACK) + axis * OV_PACK + k % OV_PACK];
        if (is_beyond(s, at))
            values[k] = 0.0f;
    }
cleanup:
    free(xyz);
    return status;
}

/* Evaluates the slice that begins at pack `first` and puts it where it belongs. */
static ovoid_status finish_slice(ovoid_context *context, sampler *s, ov_samples *samples,
                                 size_t first, float *results) {
    ovoid_status status = OVOID_OK;
    const size_t left = samples->points.packs - first, packs = left < SLICE ? left : SLICE;
    const size_t values = packs * OV_PACK * sizeof *results, at = first * OV_PACK * sizeof *results;
    ov_points slice = {.count = packs * OV_PACK, .packs = packs};
    OV_TRY(take_slice(context, &samples->points, first, &slice));
    OV_TRY(set_slice_terms(context, s, &slice));
    OV_TRY(ov_lists_build(context, &s->lists, &slice, &s->terms, 0.0));
    OV_TRY(ov_field_gradient(context, &s->operations, &slice, &s->terms, &s->lists, &s->value,
                             &s->gradient));
    OV_TRY(ov_buffer_read(context, &s->value, 0, results, values));
    OV_TRY(clear_beyond(context, s, &slice, results));
    OV_TRY(ov_buffer_write(context, &samples->value, at, results, values));
    OV_TRY(ov_buffer_read(context, &s->gradient, 0, results, 3 * values));
    OV_TRY(ov_buffer_write(context, &samples->gradient, 3 * at, results, 3 * values));
cleanup:
    ov_points_destroy(&slice);
    return status;
}

/* phi and its gradient once more at the kept points, with the rounding that a fit will see. */
static ovoid_status finish_samples(ovoid_context *context, sampler *s, ov_samples *samples) {
    ovoid_status status = OVOID_OK;
    float *results = NULL;
    OV_TRY(ov_points_create(context, s->kept, s->kept_count, s->origin, resolution_of(s),
                            &samples->points));
    free(samples->points.order); /* nobody asks which of the lattice's points they are */
    samples->points.order = NULL;
    drop_pieces(s);
    const size_t values = samples->points.packs * OV_PACK * sizeof(float);
    OV_TRY(ov_buffer_reserve(context, &samples->value, values, "values at points"));
    OV_TRY(ov_buffer_reserve(context, &samples->gradient, 3 * values, "gradients at points"));
    results = ov_alloc(context, SLICE * 3 * OV_PACK, sizeof *results, "values at points");
    if (!results)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (size_t first = 0; first < samples->points.packs; first += SLICE) {
        OV_TRY(finish_slice(context, s, samples, first, results));
        OV_TRY(ask_to_go_on(context, s));
    }
cleanup:
    free(results);
    return status;
}

static void destroy_sampler(sampler *s) {
    drop_pieces(s);
    ov_piece_grid_destroy(&s->pieces);
    free(s->order);
    free(s->quadrics);
    ov_terms_destroy(&s->terms);
    ov_lists_destroy(&s->lists);
    ov_operations_destroy(&s->operations);
    ov_buffer_destroy(&s->gradient);
}

ovoid_status ov_sample(ovoid_context *context, const double *xyzr, size_t atoms, double decay,
                       const ov_lattice *lattice, ov_band band, ov_sampling sampling,
                       ov_samples *samples) {
    ovoid_status status = OVOID_OK;
    ov_samples made = {0};
    ov_device *device;
    sampler s = {.xyzr = xyzr,
                 .atoms = atoms,
                 .decay = decay,
                 .lattice = lattice,
                 .band = band,
                 .sampling = sampling};
    for (size_t axis = 0; axis < 3; ++axis)
        s.origin[axis] =
            lattice->low[axis] + 0.5 * lattice->step[axis] * (double)lattice->size[axis];
    OV_TRY(ov_device_get(context, &device));
    s.kept_limit = device->info.global_memory > 0 /* 0: the driver does not say */
                       ? device->info.global_memory / BYTES_PER_POINT
                       : UINT64_MAX;
    OV_TRY(
        ov_piece_grid_create(context, lattice, xyzr, atoms, decay, lowest(band) <= 0.0, &s.pieces));
    OV_TRY(check_empty_pieces(context, &s));
    OV_TRY(lay_piece(context, &s));
    OV_TRY(sample_pieces(context, &s));
    OV_TRY(finish_samples(context, &s, &made));
cleanup:
    destroy_sampler(&s);
    if (status == OVOID_OK)
        *samples = made;
    else
        ov_samples_destroy(&made);
    return status;
}

void ov_samples_destroy(ov_samples *samples) {
    ov_points_destroy(&samples->points);
    ov_buffer_destroy(&samples->value);
    ov_buffer_destroy(&samples->gradient);
}
