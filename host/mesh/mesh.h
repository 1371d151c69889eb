/*
 * A triangle mesh on the host: arrays, and what follows from them.
 */
#ifndef OV_MESH_H
#define OV_MESH_H

#include "base/base.h"
#include "base/progress.h"
#include "base/store.h"
#include "field/field.h"
#include "ovoid/ovoid.h"

/* A light mesh, which the library keeps for itself, has offsets instead of xyz, knows nothing of
 * its edges (its components' closed and euler are 0), and may have given up its normals. */
struct ovoid_mesh {
    ov_store *store; /* of the arrays of vertices and triangles; NULL: they are in memory */
    size_t vertices, triangles;
    double *xyz;            /* 3 * vertices, angstrom; NULL if light */
    float *offsets;         /* 3 * vertices, angstrom from the origin; NULL unless light */
    double origin[3];       /* of the offsets */
    float *normals;         /* 3 * vertices, outward unit vectors; NULL if given up */
    uint32_t *corners;      /* 3 * triangles */
    uint32_t *component_of; /* vertices */
    ovoid_component *component;
    size_t components;
    double spacing; /* of the lattice on whose edges the vertices lie, angstrom; 0 if not known */
    uint8_t *edge;  /* vertices, the edge of each: its axis, and shifted by OV_EDGE_AXIS_BITS how
                       often the lattice was halved there; NULL if light, or not known */
    size_t missed;  /* terms whose piece of the surface could not be meshed (specks.h) */
    ov_buffer on_device[2]; /* of a light mesh, offsets and corners once more, or none */
    bool along_curve; /* vertices and triangles follow a space-filling curve, none is without the
                         other */
};

enum { OV_ON_DEVICE_OFFSETS, OV_ON_DEVICE_CORNERS };

#define OV_EDGE_AXIS_BITS 2
#define OV_EDGE_AXES 3u /* mask */

static inline void ov_mesh_at(const ovoid_mesh *mesh, size_t vertex, double at[3]) {
    for (size_t k = 0; k < 3; ++k)
        at[k] = mesh->xyz ? mesh->xyz[3 * vertex + k]
                          : mesh->origin[k] + (double)mesh->offsets[3 * vertex + k];
}

/* Whether its offsets count from there. */
static inline bool ov_mesh_is_about(const ovoid_mesh *mesh, const double origin[3]) {
    return mesh->offsets && mesh->origin[0] == origin[0] && mesh->origin[1] == origin[1] &&
           mesh->origin[2] == origin[2];
}

static inline void ov_mesh_centre(const ovoid_mesh *mesh, size_t triangle, double centre[3]) {
    double at[3][3];
    for (size_t i = 0; i < 3; ++i)
        ov_mesh_at(mesh, mesh->corners[3 * triangle + i], at[i]);
    for (size_t k = 0; k < 3; ++k)
        centre[k] = (at[0][k] + at[1][k] + at[2][k]) / 3.0;
}

/* Makes a mesh that takes the arrays over (they are freed on failure too), and shares the store
 * that they are in: normals may be NULL. Finds the components, numbered by their first vertex.
 * OVOID_ERROR_ARGUMENT when a corner names no vertex or a coordinate is not finite,
 * OVOID_ERROR_LIMIT beyond 2^32 - 1 vertices or triangles. */
ovoid_status ov_mesh_adopt(ovoid_context *context, ov_store *store, double *xyz, float *normals,
                           size_t vertices, uint32_t *corners, size_t triangles, ovoid_mesh **mesh);

/* A light mesh: offsets from origin, and normals or NULL for none. ov_mesh_finish() is to follow,
 * which checks the arrays and finds the components, or ov_mesh_check() where nobody asks for these.
 */
ovoid_status ov_mesh_adopt_light(ovoid_context *context, float *offsets, const double origin[3],
                                 float *normals, size_t vertices, uint32_t *corners,
                                 size_t triangles, ovoid_mesh **mesh);
ovoid_status ov_mesh_finish(ovoid_context *context, ovoid_mesh *mesh);
/* The same, but which components are exposed is still to be found (exposed.h). */
ovoid_status ov_mesh_connect(ovoid_context *context, ovoid_mesh *mesh);
ovoid_status ov_mesh_check(ovoid_context *context, const ovoid_mesh *mesh);

/* Leaves of a light mesh where its vertices are and how they hang together, on the host. */
void ov_mesh_lighten(ovoid_mesh *mesh);

/* Component of a triangle. */
static inline const ovoid_component *ov_mesh_component_of_triangle(const ovoid_mesh *mesh,
                                                                   size_t triangle) {
    return &mesh->component[mesh->component_of[mesh->corners[3 * triangle]]];
}

/* Whether a vertex is of an outer surface, or of a cavity that may be open (exposed.h). */
static inline bool ov_mesh_is_exposed(const ovoid_mesh *mesh, size_t vertex) {
    return mesh->component[mesh->component_of[vertex]].exposed;
}

/* Area and volume of all components or of the outer ones alone. */
typedef struct ov_content {
    double area, volume;
} ov_content;
ov_content ov_mesh_flat(const ovoid_mesh *mesh, bool outer_only);
ov_content ov_mesh_smooth(const ovoid_mesh *mesh, bool outer_only);

/* Adds what one triangle has of the smooth ones, the volume as that between it and the origin. The
 * mesh has its normals. */
void ov_mesh_smooth_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                             ov_content *content);

/* The same of the flat one. */
void ov_mesh_flat_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                           ov_content *content);

/* Adds the vector area of either: what moving the origin adds to the volume is a third of its
 * product with the way back. */
void ov_mesh_smooth_vector(const ovoid_mesh *mesh, size_t triangle, double vector[3]);
void ov_mesh_flat_vector(const ovoid_mesh *mesh, size_t triangle, double vector[3]);

/* Those of all components, and of the outer ones, asking on the way whether to go on. */
ovoid_status ov_mesh_contents(ovoid_context *context, const ovoid_mesh *mesh, bool smooth,
                              ov_content *whole, ov_content *outer);

#endif
