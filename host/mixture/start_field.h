/*
 * The field of the start, for the many points where two might be merged: sampled once on a sparse
 * lattice as fine as the Gaussians are wide, then interpolated.
 */
#ifndef OV_START_FIELD_H
#define OV_START_FIELD_H

#include "mixture/component.h"
#include "neighbours/neighbours.h"

typedef struct ov_start_field {
    ov_cells bricks;
    double spacing; /* angstrom */
    double largest; /* no interpolated value is above it */
    float *values;  /* per brick, its faces' samples included */
    size_t capacity;
} ov_start_field;

/* Each Gaussian counts down to `least` of the field. */
ovoid_status ov_start_field_create(ovoid_context *context, const ov_quadric *start,
                                   const ov_component *components, size_t count, double least,
                                   ov_start_field *field);
void ov_start_field_destroy(ov_start_field *field);

/* The field at a point, interpolated; 0 far from all. */
double ov_start_field_at(const ov_start_field *field, const double point[3]);

#endif
