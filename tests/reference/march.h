/*
 * Marching cubes as it is usually written: phi in double at every point of a box of the lattice,
 * one cell after another, no pieces, no masks. With the same table of cases, linear vertices.
 */
#ifndef REFERENCE_MARCH_H
#define REFERENCE_MARCH_H

#include "reference/reference.h"

#define REFERENCE_NO_VERTEX UINT32_MAX

typedef struct reference_mesh {
    int64_t low[3]; /* lattice indices of the box's first point */
    size_t size[3]; /* its points */
    double spacing;
    double *phi;      /* of all points, x fastest */
    uint32_t *vertex; /* of the edge along `axis` from point p: vertex[3 * p + axis] */
    size_t vertices;
    double *xyz; /* 3 * vertices */
    double
        *softness; /* how far a vertex moves along its edge per relative change of phi, angstrom */
    uint32_t *corner; /* 3 * triangles */
    size_t triangles;
} reference_mesh;

/* The lattice of multiples of spacing, from `low` on. The surface must not leave the box. */
void reference_march(const ov_quadric *quadrics, size_t count, double isovalue, double spacing,
                     const int64_t low[3], const size_t size[3], reference_mesh *mesh);
void reference_mesh_destroy(reference_mesh *mesh);

#endif
