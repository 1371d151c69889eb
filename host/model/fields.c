#include "model/fields.h"

#include "base/progress.h"
#include "field/field.h"
#include "model/ellipsoid.h"
#include "molecule/assembly.h"
#include "molecule/symmetry.h"

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
    field->count = field->unit = count;
    field->decay = decay;
    field->isovalue = isovalue;
    return field;
}

static ovoid_status take_atoms(ovoid_context *context, const double *xyzr, ovoid_field *field) {
    ov_quadric *const made = ov_alloc(context, field->count, sizeof *made, "a field's Gaussians");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < field->count; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, field->decay, &made[i]);
    field->quadrics = made;
    return OVOID_OK;
}

/* Those of the field's model, which has no placements. */
static ovoid_status take_ellipsoids(ovoid_context *context, ovoid_field *field) {
    ov_quadric *const made = ov_alloc(context, field->count, sizeof *made, "a field's Gaussians");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < field->count; ++i)
        ov_quadric_of_ellipsoid(&field->model->unit[i], &made[i]);
    field->quadrics = made;
    return OVOID_OK;
}

/* ---- of atoms ------------------------------------------------------------------------------- */

static ovoid_status make_of_atoms(ovoid_context *context, const double *xyzr, size_t atoms,
                                  double decay, double isovalue, ovoid_field **field) {
    ovoid_status status = OVOID_OK;
    ovoid_field *made = NULL;
    OV_TRY(ov_atoms_check(context, xyzr, atoms, decay));
    if (!(made = make(context, atoms, decay, isovalue)))
        return OVOID_ERROR_MEMORY;
    OV_TRY(take_atoms(context, xyzr, made));
    *field = made;
    made = NULL;
cleanup:
    ovoid_field_destroy(&made);
    return status;
}

/* The field of a symmetric assembly: its unit, and what places all others. */
static ovoid_status make_of_unit(ovoid_context *context, const ovoid_molecule *molecule,
                                 ov_symmetry *symmetry, double decay, double isovalue,
                                 ovoid_field **field) {
    ovoid_status status = OVOID_OK;
    double *xyzr = NULL;
    ovoid_field *made = make(context, ovoid_molecule_atoms(molecule), decay, isovalue);
    if (!made)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_symmetry_unit(context, molecule, symmetry, &xyzr));
    OV_TRY(make_of_atoms(context, xyzr, symmetry->unit_atoms, decay, isovalue, &made->repeat.unit));
    OV_TRY(ov_molecule_copy_atoms(context, molecule, &made->molecule));
    made->repeat.motion = symmetry->motion;
    made->repeat.order = symmetry->order;
    made->repeat.group = true;
    symmetry->motion = NULL;
    *field = made;
    made = NULL;
cleanup:
    free(xyzr);
    ovoid_field_destroy(&made);
    return status;
}

ovoid_status ovoid_field_of_molecule(ovoid_context *context, const ovoid_molecule *molecule,
                                     double decay, double isovalue, ovoid_field **field) {
    ovoid_status status = OVOID_OK;
    ov_symmetry symmetry = {0};
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, field);
    if (!(decay > 0.0 && decay <= 100.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "decay %g is not above 0 and at most 100",
                       decay);
    if (!(isovalue > 0.0 && isfinite(isovalue)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "isovalue is %g and must be positive",
                       isovalue);
    OV_TRY(ov_symmetry_find(context, molecule, &symmetry));
    if (symmetry.order > 1)
        OV_TRY(make_of_unit(context, molecule, &symmetry, decay, isovalue, field));
    else
        OV_TRY(make_of_atoms(context, ovoid_molecule_xyzr(molecule), ovoid_molecule_atoms(molecule),
                             decay, isovalue, field));
cleanup:
    ov_symmetry_destroy(&symmetry);
    return status;
}

/* ---- of ellipsoids -------------------------------------------------------------------------- */

static ovoid_status copy_motions(ovoid_context *context, const ovoid_model *model,
                                 ov_repeat *repeat) {
    repeat->motion =
        ov_alloc(context, model->placement_count, sizeof *repeat->motion, "a field's placements");
    if (!repeat->motion)
        return OVOID_ERROR_MEMORY;
    repeat->order = model->placement_count;
    for (size_t n = 0; n < repeat->order; ++n) {
        const ovoid_motion *const from = &model->placements[n];
        memcpy(repeat->motion[n].rotation, from->rotation, sizeof from->rotation);
        memcpy(repeat->motion[n].shift, from->translation, sizeof from->translation);
    }
    return OVOID_OK;
}

/* The field of the model's unit, without its placements. */
static ovoid_status make_of_model_unit(ovoid_context *context, const ovoid_model *model,
                                       ov_repeat *repeat) {
    ovoid_status status = OVOID_OK;
    ovoid_model *unit = NULL;
    OV_TRY(copy_motions(context, model, repeat));
    OV_TRY(ovoid_model_create(context, model->unit, model->unit_count, model->decay,
                              model->isovalue, &unit));
    OV_TRY(ovoid_field_of_model(context, unit, &repeat->unit));
cleanup:
    ovoid_model_destroy(&unit);
    return status;
}

ovoid_status ovoid_field_of_model(ovoid_context *context, const ovoid_model *model,
                                  ovoid_field **field) {
    ovoid_status status = OVOID_OK;
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, field);
    ovoid_field *made = make(context, ovoid_model_size(model), model->decay, model->isovalue);
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->unit = model->unit_count;
    OV_TRY(ov_model_copy_placed(context, model, &made->model));
    if (model->placement_count > 0)
        OV_TRY(make_of_model_unit(context, model, &made->repeat));
    else
        OV_TRY(take_ellipsoids(context, made));
    *field = made;
    made = NULL;
cleanup:
    ovoid_field_destroy(&made);
    return status;
}

/* ---- all terms ------------------------------------------------------------------------------ */

static ovoid_status place_ellipsoids(ovoid_context *context, ovoid_field *field) {
    ovoid_status status = OVOID_OK;
    ovoid_model *all = NULL;
    OV_TRY(ov_model_copy(context, field->model, &all));
    ovoid_model_destroy(&field->model);
    field->model = all;
    OV_TRY(take_ellipsoids(context, field));
cleanup:
    return status;
}

static ovoid_status place_atoms(ovoid_context *context, ovoid_field *field) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_molecule_expand(context, field->molecule));
    OV_TRY(take_atoms(context, ovoid_molecule_xyzr(field->molecule), field));
    ovoid_molecule_destroy(&field->molecule);
cleanup:
    return status;
}

ovoid_status ov_field_place(ovoid_context *context, const ovoid_field *field) {
    /* What a field is does not change: the array is a cache. */
    ovoid_field *const f = (ovoid_field *)field;
    if (f->quadrics)
        return OVOID_OK;
    return f->model ? place_ellipsoids(context, f) : place_atoms(context, f);
}

/* Rotations and shifts that carry atoms to within so much of each other, angstrom, count as the
 * same, of what is some 1000 angstrom wide. */
#define SAME_ROTATION 1e-5
#define SAME_SHIFT 0.01

static bool is_same_motion(const ov_rigid *a, const ov_rigid *b) {
    for (size_t k = 0; k < 9; ++k)
        if (!(fabs(a->rotation[k] - b->rotation[k]) <= SAME_ROTATION))
            return false;
    for (size_t k = 0; k < 3; ++k)
        if (!(fabs(a->shift[k] - b->shift[k]) <= SAME_SHIFT))
            return false;
    return true;
}

const ov_repeat *ov_fields_repeat(const ovoid_field *a, const ovoid_field *b) {
    const ov_repeat *const p = &a->repeat, *const q = &b->repeat;
    if (!p->unit || !q->unit || p->order != q->order || !(p->group || q->group))
        return NULL;
    for (size_t g = 0; g < p->order; ++g)
        if (!is_same_motion(&p->motion[g], &q->motion[g]))
            return NULL;
    return p->group ? p : q;
}

void ovoid_field_destroy(ovoid_field **field) {
    if (!field || !*field)
        return;
    ov_tenant_part(&(*field)->tenant);
    ovoid_field_destroy(&(*field)->repeat.unit);
    free((*field)->repeat.motion);
    ovoid_model_destroy(&(*field)->model);
    ovoid_molecule_destroy(&(*field)->molecule);
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
        ovoid_status status = ov_field_place(context, field);
        if (status == OVOID_OK)
            status = ov_evaluator_create(context, field->quadrics, field->count, &field->evaluator);
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
