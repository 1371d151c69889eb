/*
 * What merges cost: the kernel merge_loss by itself, and its twin.
 */
#ifndef OV_LOSSES_H
#define OV_LOSSES_H

#include "selftest/twin.h"

/* Of each place of some packs: the field, the bounds that it is held to, and its weight, 0 at the
 * fill. */
typedef struct ov_charges {
    float *value, *low, *high, *weight;
} ov_charges;

/* The field of the quadrics, with random bounds: both, one of them, or the other. xyz: of each
 * place, those of the fill may be missing at the end. */
ovoid_status ov_charges_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                               const ov_points *points, const double *xyz, uint64_t seed,
                               ov_charges *charges);
void ov_charges_destroy(ov_charges *charges);

/* The square of what a value is outside of bounds. */
double ov_twin_square_residual(double value, double low, double high);

/* What it costs to put `merged` in the place of a pair: over all places, or over those of the packs
 * in `counted`, if that is not NULL. */
ov_twin_sum ov_twin_loss(const ov_quadric *quadrics, const uint32_t pair[2],
                         const ov_quadric *merged, const double *xyz, size_t places,
                         const ov_charges *charges, const bool *counted);

/* The Gaussian of the mass, mean and covariance of two. */
ovoid_status ov_merge_quadrics(ovoid_context *context, const ov_quadric *a, const ov_quadric *b,
                               ov_quadric *merged);

/* The kernel's answers for `count` pairs of the terms, to be freed. */
ovoid_status ov_losses(ovoid_context *context, const ov_points *points, const ov_terms *terms,
                       const ov_lists *lists, const ov_charges *charges, const uint32_t *pairs,
                       const ov_quadric *merged, size_t count, float **losses);

#endif
