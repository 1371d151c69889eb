#include "once.h"

static ovoid_status of_molecule(ovoid_context *context, const ovoid_molecule *molecule,
                                double decay, ovoid_field **field) {
    *field = NULL;
    return ovoid_field_of_molecule(context, molecule, decay, OVOID_DEFAULT_ISOVALUE, field);
}

static ovoid_status of_model(ovoid_context *context, const ovoid_model *model,
                             ovoid_field **field) {
    *field = NULL;
    return ovoid_field_of_model(context, model, field);
}

/* Runs `call`, which uses `field`, unless making that failed. */
#define ONCE(make, call)                                                                           \
    do {                                                                                           \
        ovoid_field *field;                                                                        \
        ovoid_status status = (make);                                                              \
        if (status == OVOID_OK)                                                                    \
            status = (call);                                                                       \
        ovoid_field_destroy(&field);                                                               \
        return status;                                                                             \
    } while (0)

ovoid_status once_molecule_field(ovoid_context *context, const ovoid_molecule *molecule,
                                 double decay, const double *xyz, size_t count, double *value,
                                 double *gradient) {
    ONCE(of_molecule(context, molecule, decay, &field),
         ovoid_field_evaluate(context, field, xyz, count, value, gradient));
}

ovoid_status once_model_field(ovoid_context *context, const ovoid_model *model, const double *xyz,
                              size_t count, double *value, double *gradient) {
    ONCE(of_model(context, model, &field),
         ovoid_field_evaluate(context, field, xyz, count, value, gradient));
}

ovoid_status once_molecule_mesh(ovoid_context *context, const ovoid_molecule *molecule,
                                double decay, const ovoid_mesh_options *options,
                                ovoid_mesh **mesh) {
    ONCE(of_molecule(context, molecule, decay, &field),
         ovoid_field_mesh(context, field, options, mesh));
}

ovoid_status once_model_mesh(ovoid_context *context, const ovoid_model *model,
                             const ovoid_mesh_options *options, ovoid_mesh **mesh) {
    ONCE(of_model(context, model, &field), ovoid_field_mesh(context, field, options, mesh));
}

ovoid_status once_molecule_export(ovoid_context *context, const ovoid_molecule *molecule,
                                  double decay, const char *path,
                                  const ovoid_export_options *options) {
    ONCE(of_molecule(context, molecule, decay, &field),
         ovoid_field_export(context, field, path, options));
}

ovoid_status once_model_export(ovoid_context *context, const ovoid_model *model, const char *path,
                               const ovoid_export_options *options) {
    ONCE(of_model(context, model, &field), ovoid_field_export(context, field, path, options));
}

ovoid_status once_measure(ovoid_context *context, const ovoid_molecule *molecule,
                          const ovoid_model *model, const ovoid_measure_options *options,
                          ovoid_measures *measures) {
    ovoid_field *original, *sparse = NULL;
    ovoid_status status = of_molecule(context, molecule, ovoid_model_decay(model), &original);
    if (status == OVOID_OK)
        status = of_model(context, model, &sparse);
    if (status == OVOID_OK)
        status = ovoid_measure(context, original, sparse, options, measures);
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return status;
}

ovoid_status once_render(ovoid_context *context, const ovoid_molecule *molecule, double decay,
                         const ovoid_model *model, const ovoid_picture_options *options,
                         ovoid_image **image) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_status status = molecule ? of_molecule(context, molecule, decay, &original) : OVOID_OK;
    if (status == OVOID_OK && model)
        status = of_model(context, model, &sparse);
    if (status == OVOID_OK)
        status = ovoid_render(context, original, sparse, options, image);
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return status;
}
