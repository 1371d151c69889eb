/* The adaptive method (design, section 3): mixture reduction, then Levenberg-Marquardt, then splits
 * and merges where the surface is off. */
#ifndef OV_ADAPTIVE_H
#define OV_ADAPTIVE_H

#include "field/field.h"

/* Fits to the molecule's surface. *ellipsoids and *owner, the ellipsoid of each atom, are
 * allocated (free with free()); result's counts, errors and profile are filled in. Seconds in
 * result count from began. A goal that is not reached is no error: result says so, and the model
 * is the best there was. */
ovoid_status ov_adaptive_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                             const ovoid_fit_options *options, double began,
                             ovoid_ellipsoid **ellipsoids, uint32_t **owner,
                             ovoid_fit_result *result);

#endif
