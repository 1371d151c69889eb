/* Vectors of three numbers, and the corners of a triangle as such. */
#ifndef OV_VECTORS_H
#define OV_VECTORS_H

#include "mesh/mesh.h"

static inline void subtract(const double *a, const double *b, double *result) {
    for (int k = 0; k < 3; ++k)
        result[k] = a[k] - b[k];
}

static inline double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cross(const double *a, const double *b, double *result) {
    result[0] = a[1] * b[2] - a[2] * b[1];
    result[1] = a[2] * b[0] - a[0] * b[2];
    result[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void corners_at(const ovoid_mesh *mesh, size_t triangle, double *a, double *b,
                              double *c) {
    const uint32_t *const corner = mesh->corners + 3 * triangle;
    ov_mesh_at(mesh, corner[0], a);
    ov_mesh_at(mesh, corner[1], b);
    ov_mesh_at(mesh, corner[2], c);
}

#endif
