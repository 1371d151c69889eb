#include "field/near.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BOX 6 /* low x, y, z, high x, y, z */
#define CURVE_BITS                                                                                 \
    10                  /* cells per axis of the curve that terms are put along, as a power of two \
                         */
#define ROUNDING 1.0e-6 /* of floats of boxes, relative to the coordinates, with room to spare */

/* ---- the tree ----------------------------------------------------------------------------- */

/* The box of what the term reaches, about the origin; false: nothing. */
static bool box_of(const ov_near *near, const ov_quadric *quadric, float box[BOX]) {
    double half[3];
    if (!ov_quadric_reach(quadric, exp(near->log_cutoff), half))
        return false;
    for (int axis = 0; axis < 3; ++axis) {
        const double centre = quadric->centre[axis] - near->origin[axis];
        const double room = ROUNDING * (fabs(centre) + half[axis]);
        box[axis] = (float)(centre - half[axis] - room);
        box[axis + 3] = (float)(centre + half[axis] + room);
    }
    return true;
}

static uint64_t key_of(const ov_near *near, const ov_quadric *quadric, double extent) {
    const double last = (1 << CURVE_BITS) - 1;
    uint32_t at[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double place = (quadric->centre[axis] - near->origin[axis]) / extent;
        at[axis] = (uint32_t)(fmin(fmax(0.5 + 0.5 * place, 0.0), 1.0) * last);
    }
    return ov_hilbert_index(at[0], at[1], at[2], CURVE_BITS);
}

/* The terms along a curve, so that those of a group are neighbours. */
static ovoid_status order_terms(ovoid_context *context, ov_near *near, size_t count) {
    double extent = DBL_MIN;
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "curve positions");
    if (!keys)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; ++i)
        for (int axis = 0; axis < 3; ++axis)
            extent = fmax(extent, fabs(near->quadrics[i].centre[axis] - near->origin[axis]));
    for (size_t i = 0; i < count; ++i)
        keys[i] = key_of(near, &near->quadrics[i], extent);
    const ovoid_status status = ov_sort_keys(context, keys, count, near->term);
    free(keys);
    return status;
}

/* Leaves out terms that reach nothing. */
static size_t box_terms(ov_near *near, size_t count, float *leaves) {
    size_t used = 0;
    for (size_t k = 0; k < count; ++k)
        if (box_of(near, &near->quadrics[near->term[k]], leaves + used * BOX))
            near->term[used++] = near->term[k];
    return used;
}

ovoid_status ov_near_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                            const double origin[3], double cutoff, ov_near *near) {
    ovoid_status status = OVOID_OK;
    ov_near made = {.quadrics = quadrics, .log_cutoff = log(cutoff)};
    size_t floats;
    memcpy(made.origin, origin, sizeof made.origin);
    made.term = ov_alloc(context, count, sizeof *made.term, "terms");
    float *const leaves = ov_alloc(context, count * BOX, sizeof *leaves, "boxes of terms");
    if (!made.term || !leaves) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(order_terms(context, &made, count));
    OV_TRY(ov_tree_build(context, leaves, box_terms(&made, count, leaves), &made.tree, &made.boxes,
                         &floats));
    *near = made;
    memset(&made, 0, sizeof made);
cleanup:
    free(leaves);
    ov_near_destroy(&made);
    return status;
}

void ov_near_destroy(ov_near *near) {
    free(near->term);
    free(near->boxes);
    free(near->found);
    memset(near, 0, sizeof *near);
}

/* ---- packs -------------------------------------------------------------------------------- */

/* One pack's points. */
typedef struct pack {
    const double *at[OV_PACK];
    size_t count;
    double box[BOX]; /* about the tree's origin */
} pack;

static void take_pack(const ov_near *near, const ov_points *points, const double *xyz, size_t index,
                      pack *p) {
    p->count = ov_pack_points(points, index);
    for (size_t k = 0; k < p->count; ++k)
        p->at[k] = xyz + 3 * (size_t)points->order[index * OV_PACK + k];
    for (int axis = 0; axis < 3; ++axis) {
        double low = INFINITY, high = -INFINITY;
        for (size_t k = 0; k < p->count; ++k) {
            low = fmin(low, p->at[k][axis]);
            high = fmax(high, p->at[k][axis]);
        }
        p->box[axis] = low - near->origin[axis];
        p->box[axis + 3] = high - near->origin[axis];
    }
}

static bool reaches(const ov_near *near, uint32_t term, const pack *p) {
    for (size_t k = 0; k < p->count; ++k)
        if (ov_quadric_log_value(&near->quadrics[term], p->at[k]) >= near->log_cutoff)
            return true;
    return false;
}

static ovoid_status add(ovoid_context *context, ov_near *near, uint32_t term) {
    const ovoid_status status =
        ov_grow(context, &near->found, &near->found_capacity, near->found_count + 1,
                sizeof *near->found, "terms near points");
    if (status == OVOID_OK)
        near->found[near->found_count++] = term;
    return status;
}

/* Absent boxes are empty, and meet nothing. */
static bool meets(const float *group, size_t entry, const double box[BOX]) {
    for (size_t axis = 0; axis < 3; ++axis)
        if ((double)group[axis * OV_GROUP + entry] > box[axis + 3] ||
            (double)group[(axis + 3) * OV_GROUP + entry] < box[axis])
            return false;
    return true;
}

/* Adds the terms below a group of the tree that reach the pack; as deep as the tree is high. */
static ovoid_status search(ovoid_context *context, ov_near *near, unsigned level, size_t group,
                           const pack *p) {
    ovoid_status status = OVOID_OK;
    const float *const boxes =
        near->boxes + (near->tree.groups[level] + group) * (BOX * (size_t)OV_GROUP);
    for (size_t entry = 0; entry < OV_GROUP && status == OVOID_OK; ++entry) {
        const size_t box = group * OV_GROUP + entry;
        if (!meets(boxes, entry, p->box))
            continue;
        if (level > 0)
            status = search(context, near, level - 1, box, p);
        else if (reaches(near, near->term[box], p))
            status = add(context, near, near->term[box]);
    }
    return status;
}

static int ascending(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static ovoid_status find(ovoid_context *context, ov_near *near, const pack *p) {
    const size_t first = near->found_count;
    if (near->tree.levels == 0)
        return OVOID_OK;
    const ovoid_status status = search(context, near, near->tree.levels - 1, 0, p);
    if (status == OVOID_OK && near->found_count > first)
        qsort(near->found + first, near->found_count - first, sizeof *near->found, ascending);
    return status;
}

ovoid_status ov_near_lists(ovoid_context *context, ov_near *near, const ov_points *points,
                           const double *xyz, ov_lists *lists) {
    ovoid_status status = OVOID_OK;
    uint32_t *const start = ov_alloc(context, points->packs + 1, sizeof *start, "starts of lists");
    if (!start)
        return OVOID_ERROR_MEMORY;
    near->found_count = 0;
    for (size_t k = 0; k < points->packs; ++k) {
        pack p;
        take_pack(near, points, xyz, k, &p);
        OV_TRY(find(context, near, &p));
        start[k + 1] = (uint32_t)near->found_count;
    }
    OV_TRY(ov_buffer_put(context, &lists->pack_start, start, (points->packs + 1) * sizeof *start,
                         "starts of lists"));
    OV_TRY(ov_buffer_put(context, &lists->pack_item, near->found,
                         near->found_count * sizeof *near->found, "ellipsoids of packs"));
cleanup:
    free(start);
    return status;
}
