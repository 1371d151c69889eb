/*
 * A triangle mesh on the host: arrays, and what follows from them.
 */
#ifndef OV_MESH_H
#define OV_MESH_H

#include "base/base.h"
#include "ovoid/surface.h"

struct ovoid_mesh {
    size_t vertices, triangles;
    double *xyz;           /* 3 * vertices, angstrom */
    float *normals;        /* 3 * vertices, outward unit vectors */
    uint32_t *corners;     /* 3 * triangles */
    uint32_t *component_of; /* vertices */
    ovoid_component *component;
    size_t components;
};

/* Makes a mesh that takes the arrays over (they are freed on failure too): normals may be NULL. Finds
 * the components. OVOID_ERROR_ARGUMENT when a corner names no vertex or a coordinate is not finite. */
ovoid_status ov_mesh_adopt(ovoid_context *context, double *xyz, float *normals, size_t vertices,
                           uint32_t *corners, size_t triangles, ovoid_mesh **mesh);

#endif
