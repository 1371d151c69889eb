/*
 * Triangle meshes of closed forms, for the tests of surfaces.
 */
#ifndef SHAPES_H
#define SHAPES_H

#include "mesh/mesh.h"

/* Arrays of a mesh under construction: shapes are appended to one another. Starts as {0}. */
typedef struct shape {
    double *xyz;
    float *normals;
    uint32_t *corners;
    size_t vertices, triangles;
} shape;
void shape_destroy(shape *s);

/* An icosahedron whose triangles are split in four `levels` times, put on the ellipsoid with these
 * semi-axes: 10 * 4^levels + 2 vertices, exact normals. inward: the wall of a cavity. */
void shape_add_ellipsoid(shape *s, int levels, const double axes[3], const double centre[3],
                         bool inward);
void shape_add_sphere(shape *s, int levels, double radius, double x, double y, double z);

/* A torus about z in (2 n) x n quadrilaterals of two triangles. */
void shape_add_torus(shape *s, size_t n, double major, double minor);

/* A rectangle of 2 n^2 triangles in the plane z, x and y within +-half: open. */
void shape_add_square(shape *s, size_t n, double half, double z);

ovoid_mesh *shape_mesh(ovoid_context *context, const shape *s);

/* Area of an ellipsoid, by quadrature. */
double ellipsoid_area(const double axes[3]);

#endif
