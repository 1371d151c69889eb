#include "model/fields.h"

#include "base/progress.h"
#include "field/field.h"
#include "model/ellipsoid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- making one --------------------------------------------------------------------------- */

static void leave_device(ov_tenant *tenant) {
    ovoid_field *const field = (ovoid_field *)tenant; /* its first member */
    if (field->loaded)
        ov_evaluator_destroy(&field->evaluator);
    field->loaded = false;
}

static ovoid_field *make(ovoid_context *context, size_t count, double decay, double isovalue) {
    ovoid_field *field = ov_alloc(context, 1, sizeof *field, "a field");
    if (!field)
        return NULL;
    ov_tenant_join(context, &field->tenant, leave_device);
    field->quadrics = ov_alloc(context, count, sizeof *field->quadrics, "a field's Gaussians");
    field->count = field->unit = count;
    field->decay = decay;
    field->isovalue = isovalue;
    if (!field->quadrics)
        ovoid_field_destroy(&field);
    return field;
}

ovoid_status ovoid_field_of_molecule(ovoid_context *context, const ovoid_molecule *molecule,
                                     double decay, double isovalue, ovoid_field **field) {
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, field);
    if (!(decay > 0.0 && decay <= 100.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "decay %g is not above 0 and at most 100",
                       decay);
    if (!(isovalue > 0.0 && isfinite(isovalue)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "isovalue is %g and must be positive",
                       isovalue);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const ovoid_status status = ov_atoms_check(context, xyzr, atoms, decay);
    if (status != OVOID_OK)
        return status;
    ovoid_field *const made = make(context, atoms, decay, isovalue);
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < atoms; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, decay, &made->quadrics[i]);
    *field = made;
    return OVOID_OK;
}

ovoid_status ovoid_field_of_model(ovoid_context *context, const ovoid_model *model,
                                  ovoid_field **field) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, field);
    ovoid_field *made = make(context, ovoid_model_size(model), model->decay, model->isovalue);
    if (!made)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_model_copy(context, model, &made->model);
    if (status != OVOID_OK) {
        ovoid_field_destroy(&made);
        return status;
    }
    made->unit = model->unit_count;
    for (size_t i = 0; i < made->count; ++i)
        ov_quadric_of_ellipsoid(&made->model->unit[i], &made->quadrics[i]);
    *field = made;
    return OVOID_OK;
}

void ovoid_field_destroy(ovoid_field **field) {
    if (!field || !*field)
        return;
    ov_tenant_part(&(*field)->tenant);
    ovoid_model_destroy(&(*field)->model);
    free((*field)->quadrics);
    free(*field);
    *field = NULL;
}

/* ---- what it holds ------------------------------------------------------------------------ */

size_t ovoid_field_terms(const ovoid_field *field) {
    return field ? field->count : 0;
}

double ovoid_field_decay(const ovoid_field *field) {
    return field ? field->decay : NAN;
}

double ovoid_field_isovalue(const ovoid_field *field) {
    return field ? field->isovalue : NAN;
}

ovoid_status ov_field_check(ovoid_context *context, const ovoid_field *field) {
    return ov_tenant_check(context, &field->tenant, "field");
}

const char *ov_field_kind(const ovoid_field *field) {
    return field->model ? "model" : "molecule";
}

/* ---- values ------------------------------------------------------------------------------- */

ovoid_status ov_field_load(ovoid_context *context, ovoid_field *field, ov_evaluator **evaluator) {
    if (!field->loaded) {
        const ovoid_status status =
            ov_evaluator_create(context, field->quadrics, field->count, &field->evaluator);
        if (status != OVOID_OK)
            return status;
        field->loaded = true;
    }
    *evaluator = &field->evaluator;
    return OVOID_OK;
}

/* The results go where the caller wants them when there are all of them, or none at all. */
static ovoid_status evaluate(ovoid_context *context, ovoid_field *field, const double *xyz,
                             size_t count, double *value, double *gradient) {
    ovoid_status status = OVOID_OK;
    ov_evaluator *evaluator;
    float *const results =
        ov_alloc(context, count, (gradient ? 4 : 1) * sizeof *results, "values at points");
    if (!results)
        return OVOID_ERROR_MEMORY;
    float *const slopes = gradient ? results + count : NULL;
    OV_TRY(ov_points_check(context, xyz, count));
    OV_TRY(ov_field_load(context, field, &evaluator));
    OV_TRY(ov_evaluator_run(context, evaluator, xyz, count, results, slopes));
    for (size_t k = 0; k < count; ++k)
        value[k] = results[k];
    for (size_t k = 0; gradient && k < 3 * count; ++k)
        gradient[k] = slopes[k];
cleanup:
    free(results);
    return status;
}

ovoid_status ovoid_field_evaluate(ovoid_context *context, ovoid_field *field, const double *xyz,
                                  size_t count, double *value, double *gradient) {
    OV_NEED(context, context);
    OV_NEED(context, field);
    if (count > 0) {
        OV_NEED(context, xyz);
        OV_NEED(context, value);
    }
    ovoid_status status = ov_field_check(context, field);
    if (status != OVOID_OK || count == 0)
        return status;
    ov_progress_begin(context, "field");
    status = evaluate(context, field, xyz, count, value, gradient);
    ov_progress_end(context);
    return status;
}
