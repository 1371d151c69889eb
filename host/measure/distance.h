/*
 * Distances between meshes on the device: a tree of boxes over the triangles of one, points of the
 * other. A tree rather than cells of one size: it needs memory for the triangles alone, and the way
 * to a far triangle grows with the logarithm of their number, not with the empty cells between.
 *
 * The boxes lie on the device all the time, the triangles chunk by chunk, the points batch by
 * batch: so that memory hardly grows with the surface.
 */
#ifndef OV_DISTANCE_H
#define OV_DISTANCE_H

#include "device/device.h"
#include "measure/trail.h"
#include "mesh/mesh.h"
#include "shared.h"

/* Leaves of OV_LEAF triangles on the device at a time (38 MB), no fewer than OV_GROUP, and points.
 */
#define OV_FACETS_CHUNK ((size_t)1 << 15)
#define OV_FACETS_BATCH ((size_t)1 << 17)

/* A surface to be measured to. {0} is an empty one. */
typedef struct ov_facets {
    const ov_trail *trail; /* borrowed */
    double origin[3];      /* angstrom, subtracted before rounding to float */
    size_t chunk, batch;   /* as above, or less in tests */
    const ov_watch *watch; /* asked before each batch; NULL: the context */
    double enough; /* angstrom: a distance of at most this may be told as more, up to this */
    ov_tree tree;
    ov_buffer boxes;  /* device: the tree's boxes */
    ov_buffer leaves; /* device: the current chunk as kernels/distance.cl has it */
} ov_facets;

/* No triangle is no error. */
ovoid_status ov_facets_create(ovoid_context *context, const ov_trail *trail, const double origin[3],
                              ov_facets *facets);
void ov_facets_destroy(ov_facets *facets);

/* What is measured from: `count` points given by 3 floats each relative to the facets' origin or,
 * where xyz is NULL, the first `count` of a trail's vertices followed by its triangles' centres.
 * They are best in an order in which neighbours follow one another. */
typedef struct ov_sites {
    size_t count;
    const float *xyz;
    const ov_trail *trail;
} ov_sites;

/* squared[k] = squared distance (angstrom^2) of site k to the nearest of the facets.
 * OVOID_ERROR_NUMERIC when one is not finite, as without any triangle. */
ovoid_status ov_facets_distances(ovoid_context *context, ov_facets *facets, const ov_sites *sites,
                                 float *squared);

/* distance[v] of each vertex of `from` that is in a triangle to the surface `to`; 0 for others.
 * enough and watch: as in ov_facets. */
ovoid_status ov_vertex_distances(ovoid_context *context, const ovoid_mesh *from,
                                 const ovoid_mesh *to, const double origin[3], double enough,
                                 const ov_watch *watch, float *distance);

/* ovoid_mesh_distances() that tells the distance of each vertex of both meshes, where not NULL;
 * those of vertices that are left out stay as they are. */
ovoid_status ov_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                               bool outer_only, ovoid_distances *distances, float *from_a,
                               float *from_b);

#endif
