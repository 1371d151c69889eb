/*
 * Distances between meshes on the device: from points of one, batch by batch, to the triangles of
 * the other, chunk by chunk, so that memory hardly grows with the surfaces.
 */
#ifndef OV_DISTANCE_H
#define OV_DISTANCE_H

#include "base/box.h"
#include "measure/facets.h"

/* Points on the device at a time. */
#define OV_METER_BATCH ((size_t)1 << 17)

/* What measuring takes, for one measurement after the other. {0} is ready. */
typedef struct ov_meter {
    size_t batch;          /* 0: as above */
    const ov_watch *watch; /* asked before each batch; NULL: the context */
    double enough;        /* angstrom: a distance of at most this may be told as more, up to this */
    const ov_box *within; /* of points outside, distances are not asked for: 0; NULL: of all */
    ov_kernel distances, reach;
    ov_buffer xyz, result; /* device */
    ov_later later;        /* the read of distances that are under way */
    float *points;         /* of a batch of a trail's */
    size_t points_capacity;
} ov_meter;

void ov_meter_destroy(ov_meter *meter);

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
ovoid_status ov_facets_distances(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                 const ov_sites *sites, float *squared);

/* The same where squared holds what is known already: it becomes less where one of the facets is
 * nearer. Most of them are not looked at, then. No triangle is no error. */
ovoid_status ov_facets_nearer(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                              const ov_sites *sites, float *squared);

/* How far triangles reach from the facets at most: squared[k], which holds a bound, becomes the
 * least over the facets of the largest squared distance of a corner of triangle k (9 floats of xyz,
 * relative to the facets' origin) from it, if that is less. No point of the triangle is farther. */
ovoid_status ov_facets_reach(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                             const float *xyz, size_t count, float *squared);

/* squared: of the trail's vertices, which become distances, each at its vertex's place. */
void ov_trail_put_distances(const ov_trail *trail, const float *squared, float *distance);

/* distance[v] of each vertex of a mesh that is in a triangle of its trail, in angstrom; 0 for
 * others. */
ovoid_status ov_trail_distances(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                const ov_trail *from, float *distance);

/* As ov_trail_distances() from all vertices of another surface on the device, without waiting where
 * that can be: distance is to stay until ov_vertex_distances_end(), which is to follow, after
 * failures too, and which fails for what begin did not wait for. */
ovoid_status ov_vertex_distances_begin(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                       const ov_facets *from, float *distance);
ovoid_status ov_vertex_distances_end(ovoid_context *context, ov_meter *meter, const ov_facets *from,
                                     float *distance);

#endif
