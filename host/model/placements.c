/* Models of a unit and its placements. */
#include "model/ellipsoid.h"
#include "model/model.h"

#include <assert.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

static_assert(sizeof(ovoid_motion) == OV_PLACEMENT_VALUES * sizeof(double),
              "a placement is twelve doubles without gaps");

const ovoid_motion *ovoid_model_placements(const ovoid_model *model, size_t *count) {
    if (count)
        *count = model ? model->placement_count : 0;
    return model ? model->placements : NULL;
}

size_t ovoid_model_unit_size(const ovoid_model *model) {
    return model ? model->unit_count : 0;
}

const ovoid_ellipsoid *ovoid_model_unit_ellipsoids(const ovoid_model *model) {
    return model ? model->unit : NULL;
}

/* ---- what may be ---------------------------------------------------------------------------- */

const char *ov_placement_problem(const ovoid_motion *placement) {
    for (int k = 0; k < 3; k++)
        if (!(fabs(placement->translation[k]) <= OV_PLACEMENT_REACH))
            return "its translation is not within 1e100 angstrom";
    return ov_is_rotation(placement->rotation, OV_PLACEMENT_SKEW)
               ? NULL
               : "its nine first numbers are no rotation";
}

const char *ov_placed_problem(const ovoid_ellipsoid *ellipsoid) {
    for (int k = 0; k < 3; k++)
        if (!(fabs(ellipsoid->centre[k]) <= OV_PLACEMENT_REACH))
            return "its centre, which is to be placed, is not within 1e100 angstrom";
    return NULL;
}

ovoid_status ov_placements_check(ovoid_context *context, size_t placements, size_t ellipsoids) {
    if (placements > OVOID_MODEL_PLACEMENTS_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "%zu placements of a model's unit are more than %d", placements,
                       OVOID_MODEL_PLACEMENTS_MAX);
    if (placements > 0 && ellipsoids > UINT32_MAX / placements)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "%zu units of %zu ellipsoids are more than %lu ellipsoids", placements,
                       ellipsoids, (unsigned long)UINT32_MAX);
    return OVOID_OK;
}

/* ---- all ellipsoids ------------------------------------------------------------------------- */

static void place(const ovoid_model *model, const ovoid_motion *placement,
                  ovoid_ellipsoid *placed) {
    ov_rigid rigid;
    memcpy(rigid.rotation, placement->rotation, sizeof rigid.rotation);
    memcpy(rigid.shift, placement->translation, sizeof rigid.shift);
    if (memcmp(&rigid, &ov_rigid_identity, sizeof rigid) == 0) { /* to the last bit */
        memcpy(placed, model->unit, model->unit_count * sizeof *placed);
        return;
    }
    for (size_t i = 0; i < model->unit_count; i++)
        ov_ellipsoid_move(&model->unit[i], &rigid, &placed[i]);
}

ovoid_status ov_model_place(ovoid_context *context, const ovoid_model *model) {
    /* What a model looks like does not change: the array is a cache. */
    ovoid_model *const m = (ovoid_model *)model;
    const size_t count = ovoid_model_size(m);
    ovoid_ellipsoid *none = NULL;
    if (m->placement_count == 0 || m->placed)
        return OVOID_OK;
    ovoid_ellipsoid *const made = ov_alloc(context, count, sizeof *made, "all placed ellipsoids");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < m->placement_count; n++)
        place(m, &m->placements[n], made + n * m->unit_count);
    if (!atomic_compare_exchange_strong(&m->placed, &none, made))
        free(made); /* another thread was first */
    return OVOID_OK;
}

ovoid_status ovoid_model_expand(ovoid_context *context, const ovoid_model *model,
                                ovoid_model **expanded) {
    ovoid_status status = OVOID_OK;
    ovoid_model *made = NULL;
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, expanded);
    OV_TRY(ov_model_copy(context, model, &made));
    if (model->owner) {
        uint32_t *owner =
            ov_copy(context, model->owner, model->owner_count, sizeof *owner, "owners");
        if (!owner)
            OV_TRY(OVOID_ERROR_MEMORY);
        ov_model_take_owner(made, &owner, model->owner_count);
    }
    *expanded = made;
    made = NULL;
cleanup:
    ovoid_model_destroy(&made);
    return status;
}
