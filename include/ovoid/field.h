/*
 * Fields of molecules and models, and their values.
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

/* The field of a molecule or of a model, made once: what meshes, pictures, measures and exports are
 * made of. It keeps its Gaussians, on the host from its beginning and on the device from when they
 * are first evaluated, so that only the first evaluation pays for that. Neither the molecule nor
 * the model need to live longer than the call that makes it.
 *
 * It belongs to the context that it was made with, and is refused by others. When that one opens
 * another device, the field follows; when it is destroyed first, the field can only be destroyed.
 */
typedef struct ovoid_field ovoid_field;

/* decay in angstrom^-2, above 0 and at most 100. The isovalue, above 0, is that of the surface that
 * is meant where options do not name another one. OVOID_ERROR_LIMIT where exp(d r^2) of an atom is
 * beyond e^80. */
OVOID_API ovoid_status ovoid_field_of_molecule(ovoid_context *context,
                                               const ovoid_molecule *molecule, double decay,
                                               double isovalue, ovoid_field **field);

/* Decay and isovalue are the model's. */
OVOID_API ovoid_status ovoid_field_of_model(ovoid_context *context, const ovoid_model *model,
                                            ovoid_field **field);

OVOID_API void ovoid_field_destroy(ovoid_field **field);

OVOID_API size_t ovoid_field_terms(const ovoid_field *field); /* Gaussians that it is the sum of */
OVOID_API double ovoid_field_decay(const ovoid_field *field);
OVOID_API double ovoid_field_isovalue(const ovoid_field *field);

/* phi and, unless gradient is NULL, its gradient (angstrom^-1) at `count` points xyz[3 * k + {0, 1,
 * 2}], computed on the device in single precision. value has count entries, gradient 3 * count.
 *
 * Relative error of phi about 1e-6, and of its gradient's length a few times that, however far the
 * field extends: each 16 points or fewer have an origin of their own. Each Gaussian counts where it
 * is at least 1e-7; where none is, phi and its gradient are 0, as far out as a point may be. A
 * point that is not finite is OVOID_ERROR_ARGUMENT. Many points are handled 2^20 at a time, which
 * bounds the memory that they take on the device. */
OVOID_API ovoid_status ovoid_field_evaluate(ovoid_context *context, ovoid_field *field,
                                            const double *xyz, size_t count, double *value,
                                            double *gradient);

#ifdef __cplusplus
}
#endif

#endif
