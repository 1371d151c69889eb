/* The public functions that evaluate a molecule's or a model's field. */
#include "base/progress.h"
#include "field/evaluate.h"
#include "field/field.h"
#include "model/ellipsoid.h"
#include "model/model.h"

#include <stdlib.h>
#include <string.h>

/* The results go where the caller wants them when there are all of them, or none at all. */
static ovoid_status evaluate(ovoid_context *context, const ov_quadric *quadrics,
                             size_t quadric_count, const double *xyz, size_t count, double *value,
                             double *gradient) {
    ovoid_status status = OVOID_OK;
    double *const values = ov_alloc(context, count, sizeof *values, "values at points");
    double *const gradients =
        gradient ? ov_alloc(context, count, 3 * sizeof *gradients, "gradients at points") : NULL;
    ov_progress_begin(context, "field");
    if (!values || (gradient && !gradients))
        OV_TRY(OVOID_ERROR_MEMORY);
    OV_TRY(ov_evaluate(context, quadrics, quadric_count, xyz, count, values, gradients));
    if (count > 0)
        memcpy(value, values, count * sizeof *value);
    if (count > 0 && gradient)
        memcpy(gradient, gradients, count * 3 * sizeof *gradient);
cleanup:
    free(values);
    free(gradients);
    ov_progress_end(context);
    return status;
}

ovoid_status ovoid_molecule_field(ovoid_context *context, const ovoid_molecule *molecule,
                                  double decay, const double *xyz, size_t count, double *value,
                                  double *gradient) {
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    if (count > 0) {
        OV_NEED(context, xyz);
        OV_NEED(context, value);
    }
    if (!(decay > 0.0 && decay <= 100.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "decay %g is not above 0 and at most 100",
                       decay);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const ovoid_status checked = ov_atoms_check(context, xyzr, atoms, decay);
    if (checked != OVOID_OK)
        return checked;
    ov_quadric *const quadrics = ov_alloc(context, atoms, sizeof *quadrics, "atoms");
    if (!quadrics)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < atoms; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, decay, &quadrics[i]);
    const ovoid_status status = evaluate(context, quadrics, atoms, xyz, count, value, gradient);
    free(quadrics);
    return status;
}

ovoid_status ovoid_model_field(ovoid_context *context, const ovoid_model *model, const double *xyz,
                               size_t count, double *value, double *gradient) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    if (count > 0) {
        OV_NEED(context, xyz);
        OV_NEED(context, value);
    }
    ov_quadric *const quadrics = ov_alloc(context, model->count, sizeof *quadrics, "ellipsoids");
    if (!quadrics)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < model->count; ++i)
        ov_quadric_of_ellipsoid(&model->ellipsoids[i], &quadrics[i]);
    const ovoid_status status =
        evaluate(context, quadrics, model->count, xyz, count, value, gradient);
    free(quadrics);
    return status;
}
