/*
 * Fewer or other ellipsoids in a model that has been refined: merges chosen by what they cost at
 * the surface, and splits where the misfit is (design, section 3, repair).
 */
#ifndef OV_MERGE_H
#define OV_MERGE_H

#include "fit/adaptive/refine.h"

typedef struct ov_merger {
    ov_kernel kernel;
    ov_buffer pairs, loss, u, moments;
    ov_terms merged; /* one per pair */
} ov_merger;
void ov_merger_destroy(ov_merger *merger);

/* How to merge; NULL and NULL members: as one likes. */
typedef struct ov_merging {
    const uint32_t *twin; /* ellipsoid i is not merged with twin[i] */
    double share;         /* of the pairs looked at: the cheapest; 0: all */
    double apart;         /* angstrom: the centres of two merges are no nearer than this */
    bool (*allowed)(const double centre[3], void *user); /* whether a merge may lie there */
    void *user;
    uint32_t *parents; /* gets two for each ellipsoid left: the indices of those that became it,
                          UINT32_MAX in place of the second where it is one as before */
} ov_merging;

/* Merges pairs, the cheapest first and no ellipsoid twice, until *count has gone down by `fewer` or
 * no pair is left, and closes the gaps: the others keep their order. The refiner has evaluated x
 * last. */
ovoid_status ov_merge_cheapest(ov_refiner *refiner, ov_merger *merger, const ov_target *target,
                               double *x, size_t *count, size_t fewer, const ov_merging *how);

/* Splits the `more` ellipsoids with most misfit after the `skip` worst of all, or those there are,
 * along their longest axes into halves that together keep mass, mean and covariance: one in the
 * whole's place, one at the end. x has room for *count + more, and so has twin, where each half
 * finds the other one's index and the others UINT32_MAX; twin may be NULL. The refiner has
 * evaluated x last. */
ovoid_status ov_split_worst(ov_refiner *refiner, ov_merger *merger, const ov_target *target,
                            double *x, size_t *count, size_t skip, size_t more, uint32_t *twin);

/* Splits one ellipsoid along its longest axis into two halves that keep mass, mean and covariance;
 * the first half takes the whole's place. */
void ov_split(double whole[OV_FACTOR_PARAMETERS], double other[OV_FACTOR_PARAMETERS]);

/* Each ellipsoid's share of the misfit, sum_k weight_k r_k^2 e_i / phi~. Where phi~ is under 1e-3
 * nobody is there to be blamed in full, and the shares do not add up to the misfit. The refiner has
 * evaluated these `count` ellipsoids last. */
ovoid_status ov_misfit_shares(ov_refiner *refiner, ov_merger *merger, const ov_target *target,
                              size_t count, double *share);

#endif
