/*
 * Triangle meshes of surfaces, their areas and volumes, and distances between them.
 */
#ifndef OVOID_MESH_H
#define OVOID_MESH_H

#include "ovoid/field.h"

#ifdef __cplusplus
extern "C" {
#endif

#define OVOID_DEFAULT_MESH_SPACING 0.5 /* angstrom; the paper's areas and volumes fit it */

/* ---- meshes ------------------------------------------------------------------------------- */

/* A closed triangle mesh of a surface phi = c: vertices shared, triangles counter-clockwise seen
 * from outside (where phi <= c). No two vertices are equal, no triangle is without area. */
typedef struct ovoid_mesh ovoid_mesh;

/* Where the vertices lie on the edges of the lattice. */
typedef enum ovoid_vertex_rule {
    OVOID_VERTEX_EXACT = 0, /* on the surface, to about 1e-5 angstrom: Newton steps on the device */
    OVOID_VERTEX_LINEAR /* where phi, interpolated linearly along the edge, is c: what the paper's
                           isosurface function does */
} ovoid_vertex_rule;

typedef struct ovoid_mesh_options {
    size_t size;
    double isovalue; /* c; 0: the field's */
    double spacing;  /* of the marching-cubes lattice, angstrom */
    ovoid_vertex_rule vertices;
    const char *folder; /* where arrays of a mesh that become large are kept, in files without a
                           name, as long as the mesh is there; NULL: in memory. The mesh is the
                           same */
} ovoid_mesh_options;

/* isovalue 0, spacing OVOID_DEFAULT_MESH_SPACING, exact vertices, folder NULL; size is sizeof
 * *options. */
OVOID_API void ovoid_mesh_options_init(ovoid_mesh_options *options, size_t size);

/* Marching cubes on the device over the lattice of multiples of `spacing` that covers the surface;
 * the lattice grows until the surface is closed inside it. Pieces of the surface that are small to
 * the lattice, of single atoms and ellipsoids above all, are meshed on finer lattices, each the
 * last one halved; a warning counts what is smaller than a thousandth of the spacing. Time and
 * memory follow the surface, not the box. OVOID_ERROR_EMPTY when the field is nowhere above the
 * isovalue on the lattice, OVOID_ERROR_LIMIT when that would have more than 2e10 points and 1e5
 * for each Gaussian, or more than 1e12 values of Gaussians at them and 1e6 for each.
 * OVOID_ERROR_IO when the folder is not there, or has no room. */
OVOID_API ovoid_status ovoid_field_mesh(ovoid_context *context, ovoid_field *field,
                                        const ovoid_mesh_options *options, ovoid_mesh **mesh);

/* Makes a mesh from arrays (copied): xyz and normals 3 * vertices (normals may be NULL: taken from
 * the triangles), corners 3 * triangles vertex indices. For meshes read from elsewhere, and for
 * tests. */
OVOID_API ovoid_status ovoid_mesh_create(ovoid_context *context, const double *xyz,
                                         const float *normals, size_t vertices,
                                         const uint32_t *corners, size_t triangles,
                                         ovoid_mesh **mesh);
OVOID_API void ovoid_mesh_destroy(ovoid_mesh **mesh);

OVOID_API size_t ovoid_mesh_vertices(const ovoid_mesh *mesh);
OVOID_API size_t ovoid_mesh_triangles(const ovoid_mesh *mesh);
OVOID_API const double *ovoid_mesh_xyz(const ovoid_mesh *mesh);    /* 3 * vertices, angstrom */
OVOID_API const float *ovoid_mesh_normals(const ovoid_mesh *mesh); /* 3 * vertices, outward unit */
OVOID_API const uint32_t *ovoid_mesh_corners(const ovoid_mesh *mesh); /* 3 * triangles */
/* Connected component of each vertex, 0 .. components - 1, vertices values. */
OVOID_API const uint32_t *ovoid_mesh_component_of(const ovoid_mesh *mesh);

/* One connected piece of a surface. */
typedef struct ovoid_component { /* 48 bytes */
    uint64_t vertices, triangles;
    double area;   /* angstrom^2 */
    double volume; /* angstrom^3; negative for the wall of a cavity */
    bool outer;    /* encloses matter: its volume is positive */
    int32_t euler; /* vertices - edges + triangles: 2 - 2 genus where closed */
    bool closed;   /* every edge has two triangles, oppositely oriented */
    bool exposed;  /* outer, or a cavity that comes within two lattice steps of an exposed one: a
                      neck may be open there that is too narrow for the mesh */
} ovoid_component;
OVOID_API size_t ovoid_mesh_components(const ovoid_mesh *mesh);
OVOID_API const ovoid_component *ovoid_mesh_component(const ovoid_mesh *mesh, size_t index);

/* Area and volume of the flat triangles: the formulas of section 4.2 of the paper. */
OVOID_API double ovoid_mesh_area(const ovoid_mesh *mesh);
OVOID_API double ovoid_mesh_volume(const ovoid_mesh *mesh);

/* The same of the smooth surface that the vertices and their normals lie on: each edge is bent to
 * the height that its ends' normals ask for (sagitta of edge ij: (p_j - p_i) . (n_j - n_i) / 8),
 * each triangle to the quadratic patch through its three edges. The error is of fourth order in the
 * spacing. For exact vertices. */
OVOID_API double ovoid_mesh_smooth_area(const ovoid_mesh *mesh);
OVOID_API double ovoid_mesh_smooth_volume(const ovoid_mesh *mesh);

/* Writes a mesh by its extension: .ply (binary), .obj, .stl (binary), .off, .glb. Whole or not at
 * all. */
OVOID_API ovoid_status ovoid_mesh_write(ovoid_context *context, const ovoid_mesh *mesh,
                                        const char *path);

/* ---- distances ---------------------------------------------------------------------------- */

/* Distances from the points of a surface (its vertices and its triangles' centres) to the nearest
 * point of the other surface's triangles, both ways (as Metro does; section 4.2 of the paper). */
typedef struct ovoid_distances { /* 40 bytes */
    double hausdorff;            /* the larger of the two directed maxima, angstrom */
    double forward;              /* largest from a to b */
    double backward;             /* largest from b to a */
    double mean;                 /* area-weighted mean, average of both directions */
    double rms;
} ovoid_distances;

/* On the device, through a tree of boxes over the triangles. outer_only leaves out components that
 * are not outer, of both meshes. from_a, when not NULL, receives the distance of each vertex of a
 * (0 for those left out). OVOID_ERROR_EMPTY when a mesh has no triangle that counts. */
OVOID_API ovoid_status ovoid_mesh_distances(ovoid_context *context, const ovoid_mesh *a,
                                            const ovoid_mesh *b, bool outer_only,
                                            ovoid_distances *distances, float *from_a);

#ifdef __cplusplus
}
#endif

#endif
