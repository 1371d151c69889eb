/*
 * Distances from points to triangles in double precision, every triangle tried.
 */
#ifndef REFERENCE_DISTANCE_H
#define REFERENCE_DISTANCE_H

#include "ovoid/ovoid.h"

/* Distance from a point to a triangle, by the region of the triangle's plane (corner, edge or
 * inside) that the point projects to. Degenerate triangles are edges or points. */
double reference_triangle_distance(const double point[3], const double a[3], const double b[3],
                                   const double c[3]);

/* Distance from a point to the nearest triangle, INFINITY if there is none. */
double reference_mesh_distance(const double point[3], const ovoid_mesh *mesh, bool outer_only);

/* What ovoid_mesh_distances() computes. */
ovoid_distances reference_distances(const ovoid_mesh *a, const ovoid_mesh *b, bool outer_only);

#endif
