/*
 * Fields of molecules and models.
 */
#ifndef OVOID_FIELD_H
#define OVOID_FIELD_H

#include "ovoid/model.h"
#include "ovoid/molecule.h"

#ifdef __cplusplus
extern "C" {
#endif

#define OVOID_DEFAULT_DECAY 0.5    /* d, angstrom^-2 (section 3.2.3 of the paper) */
#define OVOID_DEFAULT_ISOVALUE 1.0 /* c (Table 2 of the paper) */

/* phi and, unless gradient is NULL, its gradient (angstrom^-1) at `count` points xyz[3 * k + {0, 1,
 * 2}], computed on the device in single precision. value has count entries, gradient 3 * count.
 * decay in angstrom^-2.
 *
 * Relative error of phi about 1e-6, and of its gradient's length a few times that, however far the
 * molecule extends: each 16 points or fewer have an origin of their own. Each Gaussian counts where
 * it is at least 1e-7; where none is, phi and its gradient are 0, as far out as a point may be. A
 * point that is not finite is OVOID_ERROR_ARGUMENT. */
OVOID_API ovoid_status ovoid_molecule_field(ovoid_context *context, const ovoid_molecule *molecule,
                                            double decay, const double *xyz, size_t count,
                                            double *value, double *gradient);

#ifdef __cplusplus
}
#endif

#endif
