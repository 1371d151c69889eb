/*
 * Points in packs, terms, the lists that pair them, and the operations over them on the device
 * (design, section 4). Everything here is linear in points and terms.
 *
 * Use: points once, terms whenever the parameters change, lists when terms have moved further than
 * the lists' skin, then the operations. Structures start as {0}; destroy functions accept that.
 */
#ifndef OV_FIELD_H
#define OV_FIELD_H

#include "device/device.h"
#include "field/quadric.h"
#include "shared.h"

#include <float.h>

/* The float next to x, for what is then to be subtracted from x. Through memory, since GCC 12 drops
 * the rounding of (double)(float)x where it makes vectors of it. */
static inline float ov_to_float(double x) {
    volatile float rounded = (float)x;
    return rounded;
}

/* ---- points ------------------------------------------------------------------------------- */

typedef struct ov_points {
    size_t count;
    size_t packs;
    bool alike;         /* each pack has the same points about its origin, and the device one of
                           them for all: lists and ov_field() take such points, no more */
    double origin[3];   /* angstrom: what packs and terms are relative to */
    float *pack_origin; /* 4 per pack: x, y, z of its own origin, which its points are relative
                           to, and how many points it has; its last one repeated fills it up */
    uint32_t *order;    /* place k of the packs holds the caller's point order[k], OV_PACK entries
                           per pack; NULL where nobody needs it */
    ov_tree tree;       /* of boxes over the packs */
    float *host_boxes;  /* the tree's boxes; NULL where they are the device's alone */
    float rounding;     /* angstrom by which boxes and floats of centres may be off together */
    ov_buffer xyz;      /* device: per pack OV_PACK x, y, z */
    ov_buffer pack_origins; /* device: pack_origin */
    ov_buffer boxes;        /* device: the tree's boxes */
} ov_points;

/* Sorts `count` points along a space-filling curve, cuts them into packs, uploads. xyz: 3 * count
 * coordinates, angstrom; resolution: size of the curve's cells, angstrom. A pack ends early where
 * its next point is far away, so that all its points are near its origin. */
ovoid_status ov_points_create(ovoid_context *context, const double *xyz, size_t count,
                              const double origin[3], double resolution, ov_points *points);
void ov_points_destroy(ov_points *points);

/* How far (angstrom, along each axis) points of such a pack may be from its origin. */
double ov_points_pack_reach(double resolution);

/* Uploads points that are in packs already: packed holds OV_PACK x, y, z per pack, or once where
 * packs are alike, and all that is the host's is set, except the tree, its boxes and rounding. */
ovoid_status ov_points_upload(ovoid_context *context, const float *packed, ov_points *points);

/* Points of a pack, without those that fill it up. */
static inline size_t ov_pack_points(const ov_points *points, size_t pack) {
    return (size_t)points->pack_origin[4 * pack + 3];
}

/* Whether place k of the packs repeats another point. */
static inline bool ov_points_fill(const ov_points *points, size_t k) {
    return k % OV_PACK >= ov_pack_points(points, k / OV_PACK);
}

/* Coordinates (angstrom) of place k of the packs, given what points->xyz holds. */
static inline void ov_points_at(const ov_points *points, const float *packed, size_t k,
                                double at[3]) {
    const size_t pack = k / OV_PACK;
    for (size_t axis = 0; axis < 3; ++axis)
        at[axis] = points->origin[axis] + (double)points->pack_origin[4 * pack + axis] +
                   (double)packed[(3 * pack + axis) * OV_PACK + k % OV_PACK];
}

/* Rounding of points whose boxes' coordinates are at most 1. */
#define OV_BOX_ROUNDING (2.0f * FLT_EPSILON)

/* ---- packs by themselves ------------------------------------------------------------------ */

/* A list of packs. {0} is an empty one. */
typedef struct ov_packs {
    uint32_t *pack;
    size_t count, capacity;
} ov_packs;
void ov_packs_destroy(ov_packs *packs);

/* Sorts them, each once; returns how many that leaves. */
size_t ov_packs_tidy(uint32_t *packs, size_t count);

/* Adds the packs whose boxes are within reach (angstrom) of a place to those found: a walk down the
 * tree. */
ovoid_status ov_packs_near(ovoid_context *context, const ov_points *points, const double at[3],
                           double reach, ov_packs *found);

/* Makes points of some packs of others, in ascending order, on the device: what it costs goes with
 * their number. list: their numbers on the device, for kernels/gather.cl. `to` may hold others,
 * whose memory is used again; its order stays NULL, and its count is that of whole packs. */
ovoid_status ov_points_gather(ovoid_context *context, const ov_points *from, const uint32_t *packs,
                              size_t count, ov_buffer *list, ov_points *to);

/* The box about the OV_PACK x, y, z of a pack: low x, y, z, high x, y, z. */
void ov_pack_box(const float *pack, float box[6]);

/* Index of cell (x, y, z), `bits` bits each (1 to 21), along the Hilbert curve. */
uint64_t ov_hilbert_index(uint32_t x, uint32_t y, uint32_t z, unsigned bits);

/* order[k] = index of the k-th point along the curve, of cells of about `resolution` angstrom; xyz:
 * 3
 * * count coordinates. */
ovoid_status ov_curve_order(ovoid_context *context, const double *xyz, size_t count,
                            double resolution, uint32_t *order);

/* order[k] = index of the k-th smallest key; equal keys keep their order. */
ovoid_status ov_sort_keys(ovoid_context *context, const uint64_t *keys, size_t count,
                          uint32_t *order);

/* Builds the tree over leaf boxes given as low x, y, z, high x, y, z (6 * leaves floats). *boxes is
 * allocated (free with free()) in the layout of ov_tree, *floats long. */
ovoid_status ov_tree_build(ovoid_context *context, const float *leaves, size_t count, ov_tree *tree,
                           float **boxes, size_t *floats);

/* The same on the device, from leaf boxes there, without waiting: boxes is made large enough. */
ovoid_status ov_tree_grow(ovoid_context *context, const ov_buffer *leaves, size_t count,
                          ov_tree *tree, ov_buffer *boxes);

/* Box `box` of a level, from boxes in the layout of ov_tree. */
void ov_tree_box(const float *boxes, const ov_tree *tree, unsigned level, size_t box,
                 float value[6]);

/* OVOID_ERROR_LIMIT when an atom's exp(d r^2) is too large for the kernels' floats. */
ovoid_status ov_atoms_check(ovoid_context *context, const double *xyzr, size_t atoms, double decay);

/* ---- terms -------------------------------------------------------------------------------- */

typedef struct ov_terms {
    size_t count;
    ov_term *host; /* what was uploaded */
    size_t capacity;
    ov_buffer device;
} ov_terms;

/* Converts and uploads. cutoff: a term counts where its value is at least this. A term of amplitude
 * at most `cutoff` reaches nothing. OVOID_ERROR_NUMERIC when a value is not finite or A is not
 * positive definite. */
ovoid_status ov_terms_set(ovoid_context *context, ov_terms *terms, const ov_quadric *quadrics,
                          size_t count, const double origin[3], double cutoff);
/* As ov_terms_set(), with the skin of each term in lists (angstrom; NULL: 0). */
ovoid_status ov_terms_set_skins(ovoid_context *context, ov_terms *terms, const ov_quadric *quadrics,
                                const float *skins, size_t count, const double origin[3],
                                double cutoff);
void ov_terms_destroy(ov_terms *terms);

/* ---- lists -------------------------------------------------------------------------------- */

typedef struct ov_lists {
    bool packs_only; /* set by the owner: term_start and term_item are not wanted, */
    bool terms_only; /* or pack_start and pack_item are not */
    size_t terms, packs;
    size_t items;         /* term-pack pairs; each list holds this many entries */
    ov_buffer term_start; /* terms + 1 */
    ov_buffer term_item;  /* packs of each term, ascending */
    ov_buffer pack_start; /* packs + 1 */
    ov_buffer pack_item;  /* terms of each pack, ascending */
    /* Scratch, kept for the next time (kernels/lists.cl). */
    ov_buffer tally, totals, chain, next, entry_group, entry_bits, place, group_term, group_bits;
    ov_buffer link, few_term, few_bits;
    ov_buffer few_tally[2]; /* the next one, and the last one, */
    size_t few_used[2];     /* words of them that are not zero */
    ov_kernel packs_of_terms, scan_lists, hand_out_entries, lists_of_packs, make_few_lists;
    size_t room_chunks, room_entries, room_items; /* what there is room for: as asked for, so that
                                                     what is launched does not go with buffers */
    bool built;
    ov_later later; /* the read of what they come to, between begin and end */
    cl_uint told[5];
} ov_lists;

/* Pairs terms with the packs that they reach, boxes grown by skin and the term's own (angstrom).
 * OVOID_ERROR_LIMIT when there are more pairs than 2^32 - 1 or than a buffer of the device holds.
 */
ovoid_status ov_lists_build(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin);
/* As ov_lists_build() without waiting, in the memory that the lists have got: ov_lists_end() is to
 * follow, after failures too, and says whether that was enough. What is launched in between finds
 * empty lists otherwise, and is to be done again after ov_lists_build(). */
ovoid_status ov_lists_begin(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin);
ovoid_status ov_lists_end(ovoid_context *context, ov_lists *lists, bool *whole);
/* Whether lists were built in the memory before: ov_lists_begin() has something to begin with. */
bool ov_lists_built(const ov_lists *lists);
/* From here on as if they had never been built, so that what is launched does not go with what was
 * built before. The memory stays. */
void ov_lists_forget(ov_lists *lists);
void ov_lists_destroy(ov_lists *lists);

/* The packs that terms reach, ascending, from lists that were built with those of packs. list: room
 * on the device. */
ovoid_status ov_packs_reached(ovoid_context *context, const ov_lists *lists, ov_buffer *list,
                              ov_packs *found);

/* ---- operations --------------------------------------------------------------------------- */

typedef struct ov_operations {
    ov_kernel field, field_polynomial, field_gradient, moments, gram, residual;
    const ov_buffer *idle; /* a word that is not 0 where ov_field_polynomial() and ov_moments() have
                              nothing to do, and leave their results; NULL: they always have */
} ov_operations;

/* Work-group for kernels whose work-items do not share anything: one item on CPUs, where a driver
 * left to choose may put all of them in one group and so on one core. */
size_t ov_item_group(const ov_device *device);

/* Kernels are made on first use. */
void ov_operations_destroy(ov_operations *operations);

/* value[k] = sum_i e_i(y_k): packs * OV_PACK floats on the device. */
ovoid_status ov_field(ovoid_context *context, ov_operations *operations, const ov_points *points,
                      const ov_terms *terms, const ov_lists *lists, ov_buffer *value);

/* value[k] = weight[k] sum_i e_i(y_k) p_i(y_k - mu_i). polynomial: OV_MONOMIALS floats per term, on
 * the device; weight: packs * OV_PACK floats, NULL for 1 everywhere; value is neither of them. */
ovoid_status ov_field_polynomial(ovoid_context *context, ov_operations *operations,
                                 const ov_points *points, const ov_terms *terms,
                                 const ov_lists *lists, const ov_buffer *polynomial,
                                 const ov_buffer *weight, ov_buffer *value);

/* As ov_field(), with the gradient: OV_PACK x, y, z components per pack (angstrom^-1). */
ovoid_status ov_field_gradient(ovoid_context *context, ov_operations *operations,
                               const ov_points *points, const ov_terms *terms,
                               const ov_lists *lists, ov_buffer *value, ov_buffer *gradient);

/* result: OV_MONOMIALS (high, low) pairs of floats per term, sum_k u_k e_i(y_k) m(y_k - mu_i). */
ovoid_status ov_moments(ovoid_context *context, ov_operations *operations, const ov_points *points,
                        const ov_terms *terms, const ov_lists *lists, const ov_buffer *u,
                        ov_buffer *result);

/* result: OV_GRAM floats per term, sum_k w_k e_i(y_k)^2 z^alpha, z = y_k - mu_i, for the monomials
 * of shared.h; w: packs * OV_PACK floats, 0 at the fill. Infinite where a sum exceeds a float's
 * range. */
ovoid_status ov_gram(ovoid_context *context, ov_operations *operations, const ov_points *points,
                     const ov_terms *terms, const ov_lists *lists, const ov_buffer *w,
                     ov_buffer *result);

/* u = value - target at the points, 0 at the fill; where target > limit, u = min(value - limit, 0)
 * (INFINITY: nowhere). sums: per pack sum of u^2 and largest |u|. */
ovoid_status ov_residual(ovoid_context *context, ov_operations *operations, const ov_points *points,
                         const ov_buffer *value, const ov_buffer *target, double limit,
                         ov_buffer *u, ov_buffer *sums);

/* ---- constrained points ------------------------------------------------------------------- */

/* Cut-off of the target field, well under its float rounding. */
#define OV_TARGET_CUTOFF 1e-7

/* The lattice of section 3.2.2: x_i = a + i (b - a) / N_x with i = 1 .. N_x, on the box of the atom
 * centres grown by padding; N_x = ceil((b - a) / spacing). */
typedef struct ov_lattice {
    double low[3];
    double step[3];
    uint64_t size[3];
} ov_lattice;

ovoid_status ov_lattice_create(ovoid_context *context, const double *xyzr, size_t atoms,
                               double spacing, double padding, ov_lattice *lattice);

/* Which lattice points are kept: phi within [low, high]; of those above, as guards of the inside,
 * the ones whose three lattice indices, counted from 0, are multiples of inside_every (0: none); of
 * those from outside_low to low, as guards of the outside, the multiples of outside_every (0:
 * none). */
typedef struct ov_band {
    double low, high;
    uint32_t inside_every;
    double outside_low;
    uint32_t outside_every;
} ov_band;

/* The constrained points with phi and its gradient, on the device. */
typedef struct ov_samples {
    ov_points points;
    ov_buffer value;    /* phi, as ov_field() stores it */
    ov_buffer gradient; /* its gradient, as ov_field_gradient() stores it */
} ov_samples;

/* Asked after each piece of the lattice, with the points kept so far; false stops the sampling. */
typedef struct ov_sampling {
    bool (*go_on)(uint64_t points, void *user); /* may be NULL */
    void *user;
    /* NULL, or a box (low, high; angstrom), that of a part of a molecule: of the lattice beyond it,
     * the points that could be guards of the outside are kept whatever phi is, and get the value 0.
     * What stands for the part has nothing to do there. */
    const double (*part)[3];
} ov_sampling;

/* Evaluates phi on the lattice piece by piece and keeps the band. Where atoms are far apart, the
 * space between them, which no atom reaches, has no points. OVOID_ERROR_EMPTY when no lattice point
 * lies in the band, OVOID_ERROR_LIMIT when the device has no room for the points,
 * OVOID_ERROR_CANCELLED when go_on says so. */
ovoid_status ov_sample(ovoid_context *context, const double *xyzr, size_t atoms, double decay,
                       const ov_lattice *lattice, ov_band band, ov_sampling sampling,
                       ov_samples *samples);
void ov_samples_destroy(ov_samples *samples);

#endif
