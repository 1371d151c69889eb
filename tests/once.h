/*
 * Fields that serve one call: what most tests ask of a molecule or a model. Each makes the fields,
 * calls the function of the library, and destroys them; the first failure is what it returns.
 */
#ifndef ONCE_H
#define ONCE_H

#include "ovoid/ovoid.h"

ovoid_status once_molecule_field(ovoid_context *context, const ovoid_molecule *molecule,
                                 double decay, const double *xyz, size_t count, double *value,
                                 double *gradient);
ovoid_status once_model_field(ovoid_context *context, const ovoid_model *model, const double *xyz,
                              size_t count, double *value, double *gradient);
ovoid_status once_molecule_mesh(ovoid_context *context, const ovoid_molecule *molecule,
                                double decay, const ovoid_mesh_options *options, ovoid_mesh **mesh);
ovoid_status once_model_mesh(ovoid_context *context, const ovoid_model *model,
                             const ovoid_mesh_options *options, ovoid_mesh **mesh);
ovoid_status once_molecule_export(ovoid_context *context, const ovoid_molecule *molecule,
                                  double decay, const char *path,
                                  const ovoid_export_options *options);
ovoid_status once_model_export(ovoid_context *context, const ovoid_model *model, const char *path,
                               const ovoid_export_options *options);

/* The molecule's field has the model's decay. */
ovoid_status once_measure(ovoid_context *context, const ovoid_molecule *molecule,
                          const ovoid_model *model, const ovoid_measure_options *options,
                          ovoid_measures *measures);

/* Either may be NULL. */
ovoid_status once_render(ovoid_context *context, const ovoid_molecule *molecule, double decay,
                         const ovoid_model *model, const ovoid_picture_options *options,
                         ovoid_image **image);

#endif
