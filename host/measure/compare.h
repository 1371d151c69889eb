/*
 * The distances of two meshes from one another, both ways.
 */
#ifndef OV_COMPARE_H
#define OV_COMPARE_H

#include "measure/bound.h"

/* ovoid_mesh_distances() that tells the distance of each vertex of both meshes, where not NULL;
 * those of vertices that are left out stay as they are. bound: unless NULL, the outer
 * triangles of both are added to it. */
ovoid_status ov_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                               bool outer_only, ovoid_distances *distances, float *from_a,
                               float *from_b, ov_bound *bound);

#endif
