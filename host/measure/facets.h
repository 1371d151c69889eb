/*
 * The triangles of a surface on the device, under a tree of boxes, to measure distances to. A tree
 * rather than cells of one size: it needs memory for the triangles alone, and the way to a far
 * triangle grows with the logarithm of their number, not with the empty cells between.
 *
 * The boxes and the vertices lie on the device all the time, the triangles chunk by chunk: they are
 * packed there from their corners, and stay where there is but one chunk.
 */
#ifndef OV_FACETS_H
#define OV_FACETS_H

#include "device/device.h"
#include "measure/trail.h"
#include "shared.h"

/* Leaves of OV_LEAF triangles on the device at a time, no fewer than OV_GROUP: at least so many (19
 * MB), or what this share of its memory holds, since a second chunk has all points looked at again.
 */
#define OV_FACETS_CHUNK ((size_t)1 << 15)
#define OV_FACETS_SHARE (1.0 / 32.0)

/* {0} is empty and holds no surface. What it has of kernels and memory serves the next surface. */
typedef struct ov_facets {
    ov_trail trail;   /* of the surface, which is borrowed, arrays and all */
    double origin[3]; /* angstrom, subtracted before rounding to float */
    size_t chunk;     /* as above, or less in tests */
    ov_tree tree;
    size_t leaves;
    float *box; /* of each leaf: low x, y, z, high x, y, z, */
    bool boxed; /* once they have been asked for */
    size_t box_capacity;
    uint32_t *listed; /* corners of triangles that do not follow one another in the mesh */
    size_t listed_capacity;
    ov_kernel pack;
    ov_buffer boxes;              /* device: the tree's */
    ov_buffer vertices, corners;  /* device: of the mesh, and of the chunk's triangles, unless the
                                     mesh has left its own there */
    ov_buffer packed, leaf_boxes; /* device: the chunk as kernels/distance.cl has it */
    size_t first, end;            /* leaves of the chunk; none where they are equal */
    bool coarse;                  /* see ov_facets_load() */
} ov_facets;

/* Replaces the surface. The origin of a light mesh costs least, and of one that is on the device
 * nothing goes there. No triangle is no error. After a
 * failure there is no surface. */
ovoid_status ov_facets_set(ovoid_context *context, ov_facets *facets, const ov_trail *trail,
                           const double origin[3]);
void ov_facets_destroy(ov_facets *facets);

/* Sees to it that the leaves from first to end are those on the device. Coarse leaves have one
 * triangle of each leaf of a group, and so lie in that group's box one level up the tree. */
ovoid_status ov_facets_load(ovoid_context *context, ov_facets *facets, bool coarse, size_t first,
                            size_t end);

/* The vertices of its mesh on the device, 3 floats each. */
const ov_buffer *ov_facets_xyz(const ov_facets *facets);

/* Sees to it that the host has the leaves' boxes: it chooses among chunks by them. */
ovoid_status ov_facets_boxes(ovoid_context *context, ov_facets *facets);

/* Writes the vertices from `first` on as the device has them; vertex: which ones, NULL: all. */
void ov_facets_round(const ov_facets *facets, const ovoid_mesh *mesh, const uint32_t *vertex,
                     size_t first, size_t count, float *xyz);

#endif
