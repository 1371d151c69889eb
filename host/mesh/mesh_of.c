/* The public functions that mesh a molecule's or a model's surface. */
#include "base/sized.h"
#include "field/field.h"
#include "mesh/march.h"
#include "model/model.h"

#include <math.h>
#include <stdlib.h>

/* phi is kept in floats, with room above and below for the cut-off. */
#define ISOVALUE_MIN 1e-25
#define ISOVALUE_MAX 1e30

void ovoid_mesh_options_init(ovoid_mesh_options *options, size_t size) {
    static const ovoid_mesh_options defaults = {
        .isovalue = OVOID_DEFAULT_ISOVALUE,
        .spacing = OVOID_DEFAULT_MESH_SPACING,
        .vertices = OVOID_VERTEX_EXACT,
    };
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

/* The caller's options, whole and within their ranges. */
static ovoid_status take_options(ovoid_context *context, const ovoid_mesh_options *given,
                                 ovoid_mesh_options *options) {
    ovoid_mesh_options_init(options, sizeof *options);
    const ovoid_status status = OV_SIZED_TAKE(context, ovoid_mesh_options, given, options);
    if (status != OVOID_OK)
        return status;
    if (!(options->isovalue >= ISOVALUE_MIN && options->isovalue <= ISOVALUE_MAX))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "isovalue %g is not between %g and %g",
                       options->isovalue, ISOVALUE_MIN, ISOVALUE_MAX);
    if (!(options->spacing > 0.0 && isfinite(options->spacing)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "spacing %g is not a positive length",
                       options->spacing);
    if (options->vertices != OVOID_VERTEX_EXACT && options->vertices != OVOID_VERTEX_LINEAR)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "there is no vertex rule %d",
                       (int)options->vertices);
    return OVOID_OK;
}

ovoid_status ovoid_molecule_mesh(ovoid_context *context, const ovoid_molecule *molecule,
                                 double decay, const ovoid_mesh_options *options,
                                 ovoid_mesh **mesh) {
    ovoid_status status = OVOID_OK;
    ov_body *bodies = NULL;
    ovoid_mesh_options o;
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, options);
    OV_NEED(context, mesh);
    if (!(decay > 0.0 && decay <= 100.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "decay %g is not above 0 and at most 100",
                       decay);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    ov_progress_begin(context, "mesh");
    OV_TRY(take_options(context, options, &o));
    OV_TRY(ov_atoms_check(context, xyzr, atoms, decay));
    bodies = ov_alloc(context, atoms, sizeof *bodies, "atoms");
    if (!bodies)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (size_t i = 0; i < atoms; ++i)
        ov_body_of_atom(xyzr + 4 * i, decay, &bodies[i]);
    OV_TRY(ov_mesh_bodies(context, bodies, atoms, &o, mesh));
cleanup:
    free(bodies);
    ov_progress_end(context);
    return status;
}

/* Names an ellipsoid that the kernels' floats cannot hold by its number in the model. */
static ovoid_status check_ellipsoids(ovoid_context *context, const ov_body *bodies, size_t count,
                                     double cutoff) {
    ovoid_status status = OVOID_OK;
    ov_terms terms = {0};
    ov_quadric *const quadrics = ov_alloc(context, count, sizeof *quadrics, "ellipsoids");
    if (!quadrics)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; ++i)
        quadrics[i] = bodies[i].quadric;
    OV_TRY(ov_terms_set(context, &terms, quadrics, count, quadrics[0].centre, cutoff));
cleanup:
    ov_terms_destroy(&terms);
    free(quadrics);
    return status;
}

ovoid_status ovoid_model_mesh(ovoid_context *context, const ovoid_model *model,
                              const ovoid_mesh_options *options, ovoid_mesh **mesh) {
    ovoid_status status = OVOID_OK;
    ov_body *bodies = NULL;
    ovoid_mesh_options o;
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, options);
    OV_NEED(context, mesh);
    ov_progress_begin(context, "mesh");
    OV_TRY(take_options(context, options, &o));
    bodies = ov_alloc(context, model->count, sizeof *bodies, "ellipsoids");
    if (!bodies)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (size_t i = 0; i < model->count; ++i)
        ov_body_of_ellipsoid(&model->ellipsoids[i], &bodies[i]);
    if (model->count > 0)
        OV_TRY(check_ellipsoids(context, bodies, model->count, OV_MARCH_CUTOFF * o.isovalue));
    OV_TRY(ov_mesh_bodies(context, bodies, model->count, &o, mesh));
cleanup:
    free(bodies);
    ov_progress_end(context);
    return status;
}
