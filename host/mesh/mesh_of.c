/* From a field to a mesh of its surface. */
#include "mesh/mesh_of.h"

#include "base/progress.h"
#include "base/sized.h"
#include "base/store.h"
#include "field/field.h"
#include "mesh/march.h"
#include "model/ellipsoid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* phi is kept in floats, with room above and below for the cut-off. */
#define ISOVALUE_MIN 1e-25
#define ISOVALUE_MAX 1e30

void ovoid_mesh_options_init(ovoid_mesh_options *options, size_t size) {
    static const ovoid_mesh_options defaults = {
        .spacing = OVOID_DEFAULT_MESH_SPACING,
        .vertices = OVOID_VERTEX_EXACT,
    };
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

ovoid_status ov_mesh_options_take(ovoid_context *context, const ovoid_mesh_options *given,
                                  const ovoid_field *field, ovoid_mesh_options *options) {
    ovoid_mesh_options_init(options, sizeof *options);
    const ovoid_status status = OV_SIZED_TAKE(context, ovoid_mesh_options, given, options);
    if (status != OVOID_OK)
        return status;
    if (options->isovalue == 0.0)
        options->isovalue = field->isovalue;
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

ovoid_status ov_field_check_ellipsoids(ovoid_context *context, const ovoid_field *field,
                                       double isovalue) {
    ov_terms terms = {0};
    if (!field->model)
        return OVOID_OK;
    ovoid_status status = ov_field_place(context, field);
    if (status != OVOID_OK)
        return status;
    status = ov_terms_set(context, &terms, field->quadrics, field->count, field->quadrics[0].centre,
                          OV_MARCH_CUTOFF * isovalue);
    ov_terms_destroy(&terms);
    return status;
}

void ov_body_of_field(const ovoid_field *field, size_t i, ov_body *body) {
    if (field->model)
        ov_body_of_ellipsoid(&field->model->unit[i], body);
    else
        ov_body_of_ball(&field->quadrics[i], field->decay, body);
}

void ov_body_of_image(const ovoid_field *field, size_t i, const ov_rigid *motion, ov_body *body) {
    if (field->model) {
        ovoid_ellipsoid moved;
        ov_ellipsoid_move(&field->model->unit[i], motion, &moved);
        ov_body_of_ellipsoid(&moved, body);
        return;
    }
    double centre[3];
    ov_body_of_ball(&field->quadrics[i], field->decay, body);
    ov_rigid_move(motion, body->quadric.centre, centre);
    memcpy(body->quadric.centre, centre, sizeof centre);
}

static ovoid_status bodies_of(ovoid_context *context, ov_store *store, const ovoid_field *field,
                              ov_body **bodies) {
    const ovoid_status status =
        ov_store_alloc(context, store, bodies, field->count, sizeof **bodies, "a surface's terms");
    for (size_t i = 0; status == OVOID_OK && i < field->count; ++i) {
        ov_store_turn(store, i);
        ov_body_of_field(field, i, &(*bodies)[i]);
    }
    return status;
}

ovoid_status ovoid_field_mesh(ovoid_context *context, ovoid_field *field,
                              const ovoid_mesh_options *options, ovoid_mesh **mesh) {
    ovoid_status status = OVOID_OK;
    ov_store *store = NULL;
    ov_body *bodies = NULL;
    ovoid_mesh_options o;
    OV_NEED(context, context);
    OV_NEED(context, field);
    OV_NEED(context, options);
    OV_NEED(context, mesh);
    ov_progress_begin(context, "mesh");
    OV_TRY(ov_field_check(context, field));
    OV_TRY(ov_mesh_options_take(context, options, field, &o));
    OV_TRY(ov_store_create(context, o.folder, &store));
    OV_TRY(ov_field_place(context, field));
    OV_TRY(bodies_of(context, store, field, &bodies));
    OV_TRY(ov_field_check_ellipsoids(context, field, o.isovalue));
    OV_TRY(ov_mesh_bodies(context, store, bodies, field->count, &o, mesh));
cleanup:
    ov_store_free(store, bodies);
    ov_store_destroy(&store);
    ov_progress_end(context);
    return status;
}
