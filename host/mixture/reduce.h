/*
 * The sparsity step: mixture reduction. Gaussians are merged two by two, always the pair whose
 * merge costs least, until `down_to` are left. The record of the merges, a dendrogram, can be cut
 * at any number of Gaussians in between. Near-linear in their number; the same input gives the same
 * bits.
 */
#ifndef OV_REDUCE_H
#define OV_REDUCE_H

#include "base/base.h"
#include "field/quadric.h"

/* What a merge of i and j costs, from their masses w (integrals) and covariances S. The merged
 * Gaussian has the mass, mean and covariance of the two together. */
typedef enum ov_merge_cost {
    OV_MERGE_L2,          /* integral of (g_i + g_j - g_merged)^2 over space, angstrom^3 */
    OV_MERGE_L2_PER_MASS, /* the same / (w_i + w_j) */
    OV_MERGE_RUNNALLS /* 1/2 [(w_i + w_j) ln det S - w_i ln det S_i - w_j ln det S_j], angstrom^3:
                         Runnalls 2007, doi:10.1109/TAES.2007.4383588, eq. 16 */
} ov_merge_cost;

typedef struct ov_reduction_options {
    ov_merge_cost cost;
    double reach;  /* two with centres further apart are no candidates (angstrom, > 0), until no
                      pair lies within it: then it doubles. 4 to 8 for atoms: where more than 512
                      are within reach, only some of them are candidates */
    double inside; /* costs are divided by 1 + (phi / inside)^2, phi the field of the start at the
                      merged centre, so that merges deep inside come first; 0: they are not */
} ov_reduction_options;

typedef struct ov_reduction ov_reduction;

/* Reduces `start` (kept by copy) to `down_to` >= 1 Gaussians; a start of fewer stays as it is.
 * OVOID_ERROR_EMPTY for no Gaussian, OVOID_ERROR_ARGUMENT for one that is not a Gaussian (amplitude
 * not positive, form not positive definite, not finite) and for options out of range,
 * OVOID_ERROR_NUMERIC if the masses are too large to be squared (not with OV_EXPONENT_MAX). */
ovoid_status ov_reduction_create(ovoid_context *context, const ov_quadric *start, size_t count,
                                 size_t down_to, const ov_reduction_options *options,
                                 ov_reduction **reduction);

void ov_reduction_destroy(ov_reduction **reduction);

/* The count of the start, and the fewest Gaussians it can be cut at. */
size_t ov_reduction_most(const ov_reduction *reduction);
size_t ov_reduction_least(const ov_reduction *reduction);

/* The `count` Gaussians (least <= count <= most) alive when so many are left, in the order in which
 * they came to be: those of the start first, with the start's bits, then merged ones. owner, if not
 * NULL, gets for each Gaussian of the start the index in `quadrics` of the one that took it in. */
ovoid_status ov_reduction_cut(ovoid_context *context, const ov_reduction *reduction, size_t count,
                              ov_quadric *quadrics, uint32_t *owner);

/* Cost of the merge that led to `count` Gaussians, divided as asked; 0 for the start's own count
 * and out of range. */
double ov_reduction_cost(const ov_reduction *reduction, size_t count);

#endif
