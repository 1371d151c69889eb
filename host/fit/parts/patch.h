/*
 * Places of a model of parts where its surface is off, when all parts are done: the ellipsoids
 * about such a place, of whatever parts they are, are fitted anew together, all others fixed.
 */
#ifndef OV_FIT_PATCH_H
#define OV_FIT_PATCH_H

#include "fit/parts/part.h"

/* Mends parts->model about these spots, patches that are not near each other side by side. touched
 * gets the boxes of what was fitted, to be freed. result counts what it took. */
ovoid_status ov_patches_mend(ovoid_context *context, ov_parts *parts, size_t jobs,
                             const ov_spot *spots, size_t count, ov_box **touched,
                             size_t *touched_count, ovoid_fit_result *result);

#endif
