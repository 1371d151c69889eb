/*
 * What is left to do where parts of a molecule meet, when all of them are fitted: the surfaces are
 * compared everywhere, and where they are far apart patches are fitted again.
 */
#ifndef OV_FIT_SEAMS_H
#define OV_FIT_SEAMS_H

#include "fit/parts/part.h"

/* Mends parts->model where it is off by parts->least or more. *total: what the last survey says of
 * it, to be destroyed. The work that was done is added to what result counts. */
ovoid_status ov_seams_mend(ovoid_context *context, ov_parts *parts, ov_survey_total *total,
                           ovoid_fit_result *result);

#endif
