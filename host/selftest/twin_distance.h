/*
 * Distances from points to triangles in double precision, every triangle tried.
 */
#ifndef OV_TWIN_DISTANCE_H
#define OV_TWIN_DISTANCE_H

#include "ovoid/ovoid.h"

/* Distance from a point to a triangle, by the region of the triangle's plane (corner, edge or
 * inside) that the point projects to. Degenerate triangles are edges or points. */
double ov_twin_triangle_distance(const double point[3], const double a[3], const double b[3],
                                 const double c[3]);

/* Distance from a point to the nearest triangle, INFINITY if there is none. */
double ov_twin_mesh_distance(const double point[3], const ovoid_mesh *mesh, bool outer_only);

/* What ovoid_mesh_distances() computes. */
ovoid_distances ov_twin_distances(const ovoid_mesh *a, const ovoid_mesh *b, bool outer_only);

#endif
