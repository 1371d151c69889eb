/*
 * Parallel rays against the surfaces of fields, on the device. Everything is in a camera's frame:
 * rays come down z, angstrom.
 *
 * Space is cut into boxes of a tile of rays and a slab of depth, and each box gets the list of
 * terms that reach it, from the same lists as fields of points: the cost is that of what a ray
 * comes by.
 */
#ifndef OV_RAYS_H
#define OV_RAYS_H

#include "field/field.h"
#include "shared.h"

/* Ray (column, row) runs at x = left + column * spacing, y = top - row * spacing. */
typedef struct ov_rays {
    uint32_t columns, rows;
    double left, top, spacing;
} ov_rays;

/* Blocks side by side, and packs of all rays. */
size_t ov_rays_blocks(const ov_rays *rays);
size_t ov_rays_packs(const ov_rays *rays);

/* Where ray (column, row) is kept in buffers that hold one value per ray. */
size_t ov_rays_index(const ov_rays *rays, uint32_t column, uint32_t row);

/* The terms of one field in boxes. */
typedef struct ov_boxes {
    ov_terms terms;
    ov_points cells; /* the boxes, where lists have packs of points */
    ov_lists lists;
    ov_buffer box_of; /* box of a tile and a slab */
    uint32_t tile;    /* rays on a side */
    uint32_t tiles_x, tiles_y, slabs;
    double front, step;
} ov_boxes;

/* Quadrics are in the camera's frame. A term counts where its value is at least cutoff.
 * OVOID_ERROR_LIMIT when the field is too deep for its steps. */
ovoid_status ov_boxes_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                             double cutoff, const ov_rays *rays, ov_boxes *boxes);
void ov_boxes_destroy(ov_boxes *boxes);

/* What the rays meet first: one value per ray each. */
typedef struct ov_hits {
    ov_buffer depth;  /* float: z, or OV_NOWHERE */
    ov_buffer normal; /* int: the outward unit vector's x and y, 16 bits each */
    ov_buffer extra;  /* depends on the operation */
} ov_hits;
void ov_hits_destroy(ov_hits *hits);

typedef struct ov_tracer {
    ov_kernel trace, ellipsoids, compare;
} ov_tracer;
void ov_tracer_destroy(ov_tracer *tracer);

/* The surface where the field is `level`; extra: float, length of its gradient there. */
ovoid_status ov_trace(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                      const ov_boxes *boxes, double level, ov_hits *hits);

/* Each term as an ellipsoid of its own, where its value is the cut-off of the boxes; extra: int,
 * index of the term. */
ovoid_status ov_trace_ellipsoids(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                                 const ov_boxes *boxes, ov_hits *hits);

/* Turns the extra of ov_trace() into (field - level) / slope of another field at the same points:
 * float, angstrom, how far out the other surface lies to first order; 0 at rays without a hit. */
ovoid_status ov_compare(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                        const ov_boxes *other, double level, ov_hits *hits);

#endif
