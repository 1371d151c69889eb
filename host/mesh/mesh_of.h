/*
 * From a field to what is meshed: its terms, and the options of a mesh.
 */
#ifndef OV_MESH_OF_H
#define OV_MESH_OF_H

#include "mesh/pieces.h"
#include "model/fields.h"

/* The caller's options of a mesh of this field, whole and within their ranges. */
ovoid_status ov_mesh_options_take(ovoid_context *context, const ovoid_mesh_options *given,
                                  const ovoid_field *field, ovoid_mesh_options *options);

/* Term i of a field whose terms are there, and how far it reaches: what its parameters tell more
 * exactly than its quadratic form. */
void ov_body_of_field(const ovoid_field *field, size_t i, ov_body *body);

/* The same of the term where a motion takes it. */
void ov_body_of_image(const ovoid_field *field, size_t i, const ov_rigid *motion, ov_body *body);

/* Refuses a field with an ellipsoid that the kernels' floats cannot hold, by its number. */
ovoid_status ov_field_check_ellipsoids(ovoid_context *context, const ovoid_field *field,
                                       double isovalue);

#endif
