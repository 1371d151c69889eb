#include "field/field.h"

#include "base/progress.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BOX 6             /* low x, y, z, high x, y, z */
#define CURVE_BITS_MAX 16 /* cells per axis of the curve, as a power of two */

static void empty_box(float box[BOX]) {
    for (int k = 0; k < 3; ++k) {
        box[k] = FLT_MAX;
        box[k + 3] = -FLT_MAX;
    }
}

static void widen_box(float box[BOX], const float other[BOX]) {
    for (int k = 0; k < 3; ++k) {
        box[k] = fminf(box[k], other[k]);
        box[k + 3] = fmaxf(box[k + 3], other[k + 3]);
    }
}

static float *box_entry(float *boxes, const ov_tree *tree, unsigned level, size_t box) {
    const size_t group = tree->groups[level] + box / OV_GROUP;
    return boxes + group * (BOX * OV_GROUP) + box % OV_GROUP;
}

static void put_box(float *boxes, const ov_tree *tree, unsigned level, size_t box,
                    const float value[BOX]) {
    float *const entry = box_entry(boxes, tree, level, box);
    for (int k = 0; k < BOX; ++k)
        entry[(size_t)k * OV_GROUP] = value[k];
}

static void get_box(float *boxes, const ov_tree *tree, unsigned level, size_t box,
                    float value[BOX]) {
    const float *const entry = box_entry(boxes, tree, level, box);
    for (int k = 0; k < BOX; ++k)
        value[k] = entry[(size_t)k * OV_GROUP];
}

static size_t groups_of(size_t boxes) {
    return (boxes + OV_GROUP - 1) / OV_GROUP;
}

/* Lays the levels out one after another until one group holds a whole level. */
static size_t plan_tree(size_t leaves, ov_tree *tree) {
    memset(tree, 0, sizeof *tree);
    size_t total = 0;
    for (size_t boxes = leaves; boxes > 0; boxes = groups_of(boxes)) {
        tree->boxes[tree->levels] = (ov_u32)boxes;
        tree->groups[tree->levels] = (ov_u32)total;
        total += groups_of(boxes);
        ++tree->levels;
        if (boxes <= OV_GROUP)
            break;
    }
    return total;
}

ovoid_status ov_tree_build(ovoid_context *context, const float *leaves, size_t count, ov_tree *tree,
                           float **boxes, size_t *floats) {
    if (count > (size_t)1 << (4 * OV_LEVELS))
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu boxes are more than a tree holds", count);
    const size_t groups = plan_tree(count, tree);
    float *const made = ov_alloc(context, groups * OV_GROUP * BOX, sizeof *made, "a tree of boxes");
    if (!made)
        return OVOID_ERROR_MEMORY;
    float box[BOX];
    for (unsigned level = 0; level < tree->levels; ++level) {
        const size_t used = tree->boxes[level];
        for (size_t b = 0; b < groups_of(used) * OV_GROUP; ++b) {
            empty_box(box);
            if (b < used && level == 0)
                memcpy(box, leaves + b * BOX, sizeof box);
            for (size_t child = b * OV_GROUP; level > 0 && child < (b + 1) * OV_GROUP; ++child) {
                float other[BOX];
                if (b >= used || child >= tree->boxes[level - 1])
                    break;
                get_box(made, tree, level - 1, child, other);
                widen_box(box, other);
            }
            put_box(made, tree, level, b, box);
        }
    }
    *boxes = made;
    *floats = groups * OV_GROUP * BOX;
    return OVOID_OK;
}

static void bounds_of(const float *xyz, size_t count, float box[BOX]) {
    empty_box(box);
    for (size_t k = 0; k < count; ++k) {
        const float *const p = xyz + 3 * k;
        const float one[BOX] = {p[0], p[1], p[2], p[0], p[1], p[2]};
        widen_box(box, one);
    }
}

/* Cells of about `resolution`, but no more than the curve's bits can number. */
static unsigned curve_bits(const float box[BOX], double resolution, double *cell) {
    double extent = 0.0;
    for (int k = 0; k < 3; ++k)
        extent = fmax(extent, (double)box[k + 3] - box[k]);
    unsigned bits = 1;
    while (bits < CURVE_BITS_MAX && ldexp(resolution, (int)bits) < extent)
        ++bits;
    *cell = fmax(resolution, extent / (ldexp(1.0, (int)bits) - 1.0));
    return bits;
}

static ovoid_status order_points(ovoid_context *context, const float *xyz, size_t count,
                                 double resolution, uint32_t *order) {
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "curve positions");
    if (!keys)
        return OVOID_ERROR_MEMORY;
    float box[BOX];
    double cell;
    bounds_of(xyz, count, box);
    const unsigned bits = curve_bits(box, resolution, &cell);
    const uint32_t last = (1u << bits) - 1;
    for (size_t k = 0; k < count; ++k) {
        uint32_t at[3];
        for (int axis = 0; axis < 3; ++axis) {
            const double position = ((double)xyz[3 * k + (size_t)axis] - box[axis]) / cell + 0.5;
            at[axis] = position < last ? (uint32_t)position : last;
        }
        keys[k] = ov_hilbert_index(at[0], at[1], at[2], bits);
    }
    ovoid_status status = ov_progress_ask(context);
    if (status == OVOID_OK)
        status = ov_sort_keys(context, keys, count, order);
    free(keys);
    return status;
}

void ov_pack_box(const float *pack, float box[BOX]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        const float *const at = pack + axis * OV_PACK;
        box[axis] = box[axis + 3] = at[0];
        for (size_t k = 1; k < OV_PACK; ++k) {
            box[axis] = fminf(box[axis], at[k]);
            box[axis + 3] = fmaxf(box[axis + 3], at[k]);
        }
    }
}

/* Fills packed with the points in pack order and leaves with the packs' boxes. */
static void pack_points(const float *xyz, const ov_points *points, float *packed, float *leaves) {
    for (size_t pack = 0; pack < points->packs; ++pack) {
        float *const own = packed + pack * (3 * OV_PACK);
        for (size_t j = 0; j < OV_PACK; ++j) {
            const size_t k = pack * OV_PACK + j;
            const uint32_t from = points->order[k < points->count ? k : points->count - 1];
            const float *const p = xyz + 3 * (size_t)from;
            for (size_t axis = 0; axis < 3; ++axis)
                own[axis * OV_PACK + j] = p[axis];
        }
        ov_pack_box(own, leaves + pack * BOX);
    }
}

ovoid_status ov_points_upload(ovoid_context *context, const float *packed, const float *leaves,
                              ov_points *points) {
    ovoid_status status = OVOID_OK;
    float *boxes = NULL;
    size_t floats = 0;
    const size_t bytes = points->packs * 3 * OV_PACK * sizeof *packed;
    OV_TRY(ov_tree_build(context, leaves, points->packs, &points->tree, &boxes, &floats));
    OV_TRY(ov_buffer_put(context, &points->xyz, packed, bytes, "points"));
    OV_TRY(ov_buffer_put(context, &points->boxes, boxes, floats * sizeof *boxes, "boxes of packs"));
cleanup:
    free(boxes);
    return status;
}

ovoid_status ov_points_create(ovoid_context *context, const float *xyz, size_t count,
                              const double origin[3], double resolution, ov_points *points) {
    ovoid_status status = OVOID_OK;
    float *packed = NULL, *leaves = NULL;
    ov_points made = {.count = count, .packs = (count + OV_PACK - 1) / OV_PACK};
    memcpy(made.origin, origin, sizeof made.origin);
    if (count > UINT32_MAX - OV_PACK)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu points are more than 2^32", count);

    made.order = ov_alloc(context, count, sizeof *made.order, "the order of the points");
    packed = ov_alloc(context, made.packs * 3 * OV_PACK, sizeof *packed, "packed points");
    leaves = ov_alloc(context, made.packs * BOX, sizeof *leaves, "boxes of packs");
    if (!made.order || !packed || !leaves) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(order_points(context, xyz, count, resolution, made.order));
    OV_TRY(ov_progress_ask(context));
    pack_points(xyz, &made, packed, leaves);
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_points_upload(context, packed, leaves, &made));

cleanup:
    free(packed);
    free(leaves);
    if (status == OVOID_OK)
        *points = made;
    else
        ov_points_destroy(&made);
    return status;
}

void ov_points_destroy(ov_points *points) {
    free(points->order);
    ov_buffer_destroy(&points->xyz);
    ov_buffer_destroy(&points->boxes);
    memset(points, 0, sizeof *points);
}
