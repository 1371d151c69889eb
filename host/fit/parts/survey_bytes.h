/* What a survey has on record of a cell as bytes, for other ranks. */
#ifndef OV_FIT_SURVEY_BYTES_H
#define OV_FIT_SURVEY_BYTES_H

#include "fit/parts/bytes.h"
#include "measure/survey.h"

ovoid_status ov_survey_cell_put(ovoid_context *context, const ov_survey_cell *cell, ov_bytes *to);

/* Into an empty cell, which is destroyed by its owner whatever comes of it. */
ovoid_status ov_survey_cell_take(ovoid_context *context, ov_reading *from, ov_survey_cell *cell);

#endif
