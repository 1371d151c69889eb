/* The paper's Algorithm 1. */
#ifndef OV_L1_H
#define OV_L1_H

#include "field/field.h"

/* The points of a molecule that fits are held to. */
typedef struct ov_l1_band ov_l1_band;

/* Samples them, unless *band (NULL at first) are those that the options ask for: of the same
 * molecule, decay, isovalue, spacing and padding they are. On errors *band stays. */
ovoid_status ov_l1_band_prepare(ovoid_context *context, const double *xyzr, size_t atoms,
                                const ovoid_fit_options *options, ov_l1_band **band);
const ov_samples *ov_l1_band_samples(const ov_l1_band *band);
void ov_l1_band_destroy(ov_l1_band **band);

/* Fits to the samples, starting from the atoms' own Gaussians. *ellipsoids and *owner are
 * allocated (free with free()); an atom's owner is the ellipsoid that it became, or, where that was
 * deleted, the one with the largest value at its centre; result's counts, errors and profile are
 * filled in. With OVOID_ERROR_CANCELLED they are those of the last iteration, if there was one, and
 * else untouched. */
ovoid_status ov_l1_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                       const ov_samples *samples, const ovoid_fit_options *options,
                       ovoid_ellipsoid **ellipsoids, uint32_t **owner, ovoid_fit_result *result);

#endif
