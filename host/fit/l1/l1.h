/* The paper's Algorithm 1. */
#ifndef OV_L1_H
#define OV_L1_H

#include "field/field.h"

/* Fits to the samples, starting from the atoms' own Gaussians. *ellipsoids and *owner are
 * allocated (free with free()); an atom's owner is the ellipsoid that it became, or, where that was
 * deleted, the one with the largest value at its centre; result's counts, errors and profile are
 * filled in.
 */
ovoid_status ov_l1_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                       const ov_samples *samples, const ovoid_fit_options *options,
                       ovoid_ellipsoid **ellipsoids, uint32_t **owner, ovoid_fit_result *result);

#endif
