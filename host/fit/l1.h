/* The paper's Algorithm 1. */
#ifndef OV_L1_H
#define OV_L1_H

#include "field/field.h"

/* Fits to the samples, starting from the atoms' own Gaussians. *ellipsoids is allocated (free with
 * free()); result's counts, errors and profile are filled in. Seconds in progress count from began.
 */
ovoid_status ov_l1_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                       const ov_samples *samples, const ovoid_fit_options *options, double began,
                       ovoid_ellipsoid **ellipsoids, ovoid_fit_result *result);

#endif
