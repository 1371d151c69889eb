#include "fit/parts/survey_bytes.h"

static ovoid_status put_side(ovoid_context *context, const ov_survey_side *side, ov_bytes *to) {
    ovoid_status status = OVOID_OK;
    const uint64_t counts[] = {side->pieces, side->seams, side->ports, side->spots, side->necks};
    OV_TRY(ov_bytes_put(context, to, counts, sizeof counts));
    OV_TRY(ov_bytes_put(context, to, side->piece, side->pieces * sizeof *side->piece));
    OV_TRY(ov_bytes_put(context, to, side->seam, side->seams * sizeof *side->seam));
    OV_TRY(ov_bytes_put(context, to, side->port, side->ports * sizeof *side->port));
    OV_TRY(ov_bytes_put(context, to, side->spot, side->spots * sizeof *side->spot));
    OV_TRY(ov_bytes_put(context, to, side->spot_on, side->spots * sizeof *side->spot_on));
    OV_TRY(ov_bytes_put(context, to, side->neck, side->necks * sizeof *side->neck));
cleanup:
    return status;
}

static ovoid_status take_side(ovoid_context *context, ov_reading *from, ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    uint64_t counts[5];
    if (!ov_bytes_take(from, counts, sizeof counts))
        return ov_fail(context, OVOID_ERROR_FORMAT, "a message ends within a survey");
    OV_TRY(
        ov_bytes_take_array(context, from, &side->piece, counts[0], sizeof *side->piece, "pieces"));
    OV_TRY(ov_bytes_take_array(context, from, &side->seam, counts[1], sizeof *side->seam, "seams"));
    OV_TRY(ov_bytes_take_array(context, from, &side->port, counts[2], sizeof *side->port, "seams"));
    OV_TRY(ov_bytes_take_array(context, from, &side->spot, counts[3], sizeof *side->spot, "spots"));
    OV_TRY(ov_bytes_take_array(context, from, &side->spot_on, counts[3], sizeof *side->spot_on,
                               "spots"));
    OV_TRY(ov_bytes_take_array(context, from, &side->neck, counts[4], sizeof *side->neck, "necks"));
    side->pieces = (size_t)counts[0];
    side->seams = side->seam_capacity = (size_t)counts[1];
    side->ports = side->port_capacity = (size_t)counts[2];
    side->spots = side->spot_capacity = side->spot_on_capacity = (size_t)counts[3];
    side->necks = side->neck_capacity = (size_t)counts[4];
cleanup:
    return status;
}

ovoid_status ov_survey_cell_put(ovoid_context *context, const ov_survey_cell *cell, ov_bytes *to) {
    ovoid_status status = OVOID_OK;
    for (int side = 0; side < OV_SURVEY_SIDES && status == OVOID_OK; ++side)
        status = put_side(context, &cell->side[side], to);
    return status;
}

ovoid_status ov_survey_cell_take(ovoid_context *context, ov_reading *from, ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    for (int side = 0; side < OV_SURVEY_SIDES && status == OVOID_OK; ++side)
        status = take_side(context, from, &cell->side[side]);
    return status;
}
