/*
 * Which terms reach a few points, found on the host: for so little, asking the device for lists
 * costs more than the evaluation.
 */
#ifndef OV_NEAR_H
#define OV_NEAR_H

#include "field/field.h"

/* A tree of boxes about the terms that reach the cut-off somewhere. Starts as {0}. */
typedef struct ov_near {
    const ov_quadric *quadrics; /* not owned */
    double origin[3];           /* angstrom: what boxes are relative to */
    double log_cutoff;
    uint32_t *term; /* of each leaf */
    ov_tree tree;
    float *boxes;
    uint32_t *found; /* of the packs asked for last, each ascending */
    size_t found_count, found_capacity;
} ov_near;

/* The quadrics stay as long as it. */
ovoid_status ov_near_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                            const double origin[3], double cutoff, ov_near *near);
void ov_near_destroy(ov_near *near);

/* The lists of the packs, for operations over packs alone: the terms that reach one of a pack's
 * points. xyz: the points in the caller's order (angstrom). */
ovoid_status ov_near_lists(ovoid_context *context, ov_near *near, const ov_points *points,
                           const double *xyz, ov_lists *lists);

#endif
