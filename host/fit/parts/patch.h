/*
 * Places of a model of parts where its surface is off, when all parts are done: the ellipsoids
 * about such a place, of whatever parts they are, are fitted anew together, all others fixed.
 */
#ifndef OV_FIT_PATCH_H
#define OV_FIT_PATCH_H

#include "fit/parts/part.h"

/* Mends parts->model about these spots with what is within reach (in units of 1 / sqrt(2 d)) of
 * them, patches that are not near each other side by side. touched gets the boxes of what this
 * changed, to be freed. result counts what it took. */
ovoid_status ov_patches_mend(ovoid_context *context, ov_parts *parts, double reach,
                             const ov_spot *spots, size_t count, ov_box **touched,
                             size_t *touched_count, ovoid_fit_result *result);

#endif
