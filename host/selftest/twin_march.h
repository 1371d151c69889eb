/*
 * Marching cubes as it is usually written: phi in double at every point of a box of the lattice,
 * one cell after another, no pieces, no masks. With the same table of cases, linear vertices.
 */
#ifndef OV_TWIN_MARCH_H
#define OV_TWIN_MARCH_H

#include "selftest/twin.h"

#define OV_TWIN_NO_VERTEX UINT32_MAX

typedef struct ov_twin_mesh {
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
} ov_twin_mesh;

/* The lattice of multiples of spacing, from `low` on. The surface must not leave the box. False
 * without memory. */
bool ov_twin_march(const ov_quadric *quadrics, size_t count, double isovalue, double spacing,
                   const int64_t low[3], const size_t size[3], ov_twin_mesh *mesh);
void ov_twin_mesh_destroy(ov_twin_mesh *mesh);

#endif
