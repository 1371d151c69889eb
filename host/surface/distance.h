/*
 * Distances between meshes on the device: a tree of boxes over the triangles of one, points of the
 * other. A tree rather than cells of one size: it needs memory for the triangles alone, and the way
 * to a far triangle grows with the logarithm of their number, not with the empty cells between.
 */
#ifndef OV_DISTANCE_H
#define OV_DISTANCE_H

#include "device/device.h"
#include "shared.h"
#include "surface/mesh.h"

/* What is made of a surface: what it is measured to, and what it is measured from, which is either
 * its vertices and the centres of its triangles or its vertices alone. One at a time keeps memory
 * low. */
enum { OV_FACETS_TRIANGLES = 1, OV_FACETS_POINTS = 2, OV_FACETS_VERTICES = 4 };

/* A surface ready to be measured from and to: its points in an order in which neighbours follow
 * one another, and its triangles on the device. {0} is an empty one. */
typedef struct ov_facets {
    size_t triangles; /* that count */
    size_t points;    /* their centres and their vertices, or their vertices alone */
    double origin[3]; /* angstrom, subtracted before rounding to float */
    float *xyz;       /* 3 * points, host */
    double *weight;   /* of OV_FACETS_POINTS: a third of 1/4 of each triangle's area at its corners,
                         3/4 at its   centre, which integrates quadratic functions exactly */
    uint32_t *vertex; /* points: index in the mesh, UINT32_MAX for a centre */
    ov_tree tree;
    ov_buffer boxes;  /* device: the tree's boxes */
    ov_buffer leaves; /* device: triangles as kernels/distance.cl has them */
} ov_facets;

/* outer_only leaves out components that are not outer. No triangle left is no error. */
ovoid_status ov_facets_create(ovoid_context *context, const ovoid_mesh *mesh, bool outer_only,
                              unsigned parts, const double origin[3], ov_facets *facets);
void ov_facets_destroy(ov_facets *facets);

/* squared[k] = squared distance (angstrom^2) of point k, 3 floats relative to the facets' origin,
 * to the nearest of the facets. OVOID_ERROR_NUMERIC when one is not finite, as without any
 * triangle. */
ovoid_status ov_facets_distances(ovoid_context *context, const ov_facets *facets, const float *xyz,
                                 size_t count, float *squared);

/* ovoid_mesh_distances() that tells the distance of each vertex of both meshes, where not NULL;
 * those of vertices that are left out stay as they are. */
ovoid_status ov_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                               bool outer_only, ovoid_distances *distances, float *from_a,
                               float *from_b);

#endif
