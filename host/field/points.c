#include "field/field.h"

#include "base/progress.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BOX 6             /* low x, y, z, high x, y, z */
#define CURVE_BITS_MAX 21 /* cells per axis of the curve, as a power of two */
/* Largest side of a pack's box, angstrom, or cells of the curve if that is more. Floats of points
 * within half of it are good to 2.4e-7 angstrom. */
#define PACK_SIDE 16.0
#define PACK_CELLS 8.0

static void empty_box(float box[BOX]) {
    for (int k = 0; k < 3; ++k) {
        box[k] = FLT_MAX;
        box[k + 3] = -FLT_MAX;
    }
}

static void widen_box(float box[BOX], const float other[BOX]) {
    for (int k = 0; k < 3; ++k) {
        box[k] = other[k] < box[k] ? other[k] : box[k]; /* fminf() is a call */
        box[k + 3] = other[k + 3] > box[k + 3] ? other[k + 3] : box[k + 3];
    }
}

/* Where a box's first coordinate is. */
static size_t box_entry(const ov_tree *tree, unsigned level, size_t box) {
    const size_t group = tree->groups[level] + box / OV_GROUP;
    return group * (BOX * OV_GROUP) + box % OV_GROUP;
}

static void put_box(float *boxes, const ov_tree *tree, unsigned level, size_t box,
                    const float value[BOX]) {
    float *const entry = boxes + box_entry(tree, level, box);
    for (int k = 0; k < BOX; ++k)
        entry[(size_t)k * OV_GROUP] = value[k];
}

void ov_tree_box(const float *boxes, const ov_tree *tree, unsigned level, size_t box,
                 float value[BOX]) {
    const float *const entry = boxes + box_entry(tree, level, box);
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

static ovoid_status check_leaves(ovoid_context *context, size_t count) {
    if (count > (size_t)1 << (4 * OV_LEVELS))
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu boxes are more than a tree holds", count);
    return OVOID_OK;
}

/* Work-items that make a level and, unless above is 0, the one above: see kernels/tree.cl. */
static size_t makers_of(size_t boxes, cl_uint above) {
    return above > 0 ? groups_of(groups_of(boxes)) * OV_GROUP : groups_of(boxes);
}

/* Where the groups of a level begin; 0: there is none. */
static cl_uint first_group(const ov_tree *tree, unsigned level) {
    return level < tree->levels ? tree->groups[level] : 0;
}

ovoid_status ov_tree_grow(ovoid_context *context, const ov_buffer *leaves, size_t count,
                          ov_tree *tree, ov_buffer *boxes) {
    ovoid_status status = OVOID_OK;
    ov_kernel lowest = {0}, level_of = {0};
    ov_device *device;
    const cl_uint total = (cl_uint)count;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(check_leaves(context, count));
    const size_t groups = plan_tree(count, tree), group = ov_item_group(device);
    cl_uint above = first_group(tree, 1);
    OV_TRY(ov_kernel_create(context, "tree", "tree_leaves", &lowest));
    OV_TRY(ov_kernel_create(context, "tree", "tree_level", &level_of));
    OV_TRY(ov_buffer_reserve(context, boxes, groups * OV_GROUP * BOX * sizeof(cl_float),
                             "a tree of boxes"));
    OV_TRY(OV_LAUNCH(context, &lowest, makers_of(count, above), group, OV_ARG(total), OV_ARG(above),
                     OV_ARG(leaves->memory), OV_ARG(boxes->memory)));
    for (unsigned level = 2; level < tree->levels; level += 2) {
        above = first_group(tree, level + 1);
        OV_TRY(OV_LAUNCH(context, &level_of, makers_of(tree->boxes[level], above), group,
                         OV_ARG(tree->boxes[level]), OV_ARG(tree->groups[level - 1]),
                         OV_ARG(tree->groups[level]), OV_ARG(above), OV_ARG(boxes->memory)));
    }
cleanup:
    ov_kernel_destroy(&lowest);
    ov_kernel_destroy(&level_of);
    return status;
}

ovoid_status ov_tree_build(ovoid_context *context, const float *leaves, size_t count, ov_tree *tree,
                           float **boxes, size_t *floats) {
    const ovoid_status status = check_leaves(context, count);
    if (status != OVOID_OK)
        return status;
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
                ov_tree_box(made, tree, level - 1, child, other);
                widen_box(box, other);
            }
            put_box(made, tree, level, b, box);
        }
    }
    *boxes = made;
    *floats = groups * OV_GROUP * BOX;
    return OVOID_OK;
}

static void bounds_of(const double *xyz, size_t count, double box[BOX]) {
    for (int k = 0; k < 3; ++k) {
        box[k] = DBL_MAX;
        box[k + 3] = -DBL_MAX;
    }
    for (size_t k = 0; k < 3 * count; ++k) {
        double *const low = box + k % 3, *const high = low + 3;
        *low = xyz[k] < *low ? xyz[k] : *low;
        *high = xyz[k] > *high ? xyz[k] : *high;
    }
}

/* Cells of about `resolution`, but no more than the curve's bits can number. */
static unsigned curve_bits(const double box[BOX], double resolution, double *cell) {
    double extent = 0.0;
    for (int k = 0; k < 3; ++k)
        extent = fmax(extent, box[k + 3] - box[k]);
    unsigned bits = 1;
    while (bits < CURVE_BITS_MAX && ldexp(resolution, (int)bits) < extent)
        ++bits;
    *cell = fmax(resolution, extent / (ldexp(1.0, (int)bits) - 1.0));
    return bits;
}

ovoid_status ov_curve_order(ovoid_context *context, const double *xyz, size_t count,
                            double resolution, uint32_t *order) {
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "curve positions");
    if (!keys)
        return OVOID_ERROR_MEMORY;
    double box[BOX], cell;
    bounds_of(xyz, count, box);
    const unsigned bits = curve_bits(box, resolution, &cell);
    const uint32_t last = (1u << bits) - 1;
    for (size_t k = 0; k < count; ++k) {
        uint32_t at[3];
        for (int axis = 0; axis < 3; ++axis) {
            const double position = (xyz[3 * k + (size_t)axis] - box[axis]) / cell + 0.5;
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
            box[axis] = at[k] < box[axis] ? at[k] : box[axis];
            box[axis + 3] = at[k] > box[axis + 3] ? at[k] : box[axis + 3];
        }
    }
}

/* The float next to x that is not above it, or not below it. */
static float round_down(double x) {
    const float nearest = ov_to_float(x);
    return (double)nearest > x ? nextafterf(nearest, -INFINITY) : nearest;
}

static float round_up(double x) {
    return -round_down(-x);
}

/* The packs' boxes about points->origin, low x, y, z, high x, y, z, rounded outwards. Sets by how
 * much at most they and the floats of nearby centres are off, each half a unit in the last place or
 * one. */
static void box_packs(const float *packed, ov_points *points, float *leaves) {
    float largest = 0.0f;
    for (size_t pack = 0; pack < points->packs; ++pack) {
        float *const leaf = leaves + pack * BOX;
        ov_pack_box(packed + (points->alike ? 0 : pack) * (3 * OV_PACK), leaf);
        for (size_t k = 0; k < BOX; ++k) {
            const double side = (double)points->pack_origin[4 * pack + k % 3] + (double)leaf[k];
            leaf[k] = k < 3 ? round_down(side) : round_up(side);
            largest = fabsf(leaf[k]) > largest ? fabsf(leaf[k]) : largest;
        }
    }
    points->rounding = OV_BOX_ROUNDING * largest;
}

ovoid_status ov_points_upload(ovoid_context *context, const float *packed, ov_points *points) {
    ovoid_status status = OVOID_OK;
    size_t floats = 0;
    const size_t bytes = (points->alike ? 1 : points->packs) * 3 * OV_PACK * sizeof *packed;
    float *const leaves = ov_alloc(context, points->packs * BOX, sizeof *leaves, "boxes of packs");
    if (!leaves)
        return OVOID_ERROR_MEMORY;
    free(points->host_boxes);
    points->host_boxes = NULL;
    box_packs(packed, points, leaves);
    OV_TRY(
        ov_tree_build(context, leaves, points->packs, &points->tree, &points->host_boxes, &floats));
    OV_TRY(ov_buffer_put(context, &points->xyz, packed, bytes, "points"));
    OV_TRY(ov_buffer_put(context, &points->pack_origins, points->pack_origin,
                         points->packs * 4 * sizeof *points->pack_origin, "origins of packs"));
    OV_TRY(ov_buffer_put(context, &points->boxes, points->host_boxes,
                         floats * sizeof *points->host_boxes, "boxes of packs"));
cleanup:
    free(leaves);
    return status;
}

/* Largest side of a pack's box. */
static double longest_side(double resolution) {
    return fmax(PACK_SIDE, PACK_CELLS * resolution);
}

double ov_points_pack_reach(double resolution) {
    return 0.51 * longest_side(resolution); /* the origin is rounded */
}

/* Grows the box about another point, unless that makes a side of it longer than `longest`. */
static bool take_into(double box[BOX], const double *p, double longest) {
    double grown[BOX];
    for (int k = 0; k < 3; ++k) {
        grown[k] = p[k] < box[k] ? p[k] : box[k];
        grown[k + 3] = p[k] > box[k + 3] ? p[k] : box[k + 3];
        if (grown[k + 3] - grown[k] > longest)
            return false;
    }
    memcpy(box, grown, sizeof grown);
    return true;
}

/* Points along the curve, and the pack that begins at `first` of them. */
typedef struct cutter {
    const double *xyz;
    const uint32_t *curve;
    size_t count;
    double longest; /* side of a pack's box */
} cutter;

/* Points in the pack, and its box. */
static size_t cut_pack(const cutter *c, size_t first, double box[BOX]) {
    const double *const p = c->xyz + 3 * (size_t)c->curve[first];
    size_t size = 1;
    memcpy(box, p, 3 * sizeof *p);
    memcpy(box + 3, p, 3 * sizeof *p);
    while (size < OV_PACK && first + size < c->count &&
           take_into(box, c->xyz + 3 * (size_t)c->curve[first + size], c->longest))
        ++size;
    return size;
}

static size_t count_packs(const cutter *c) {
    double box[BOX];
    size_t packs = 0;
    for (size_t first = 0; first < c->count; first += cut_pack(c, first, box))
        ++packs;
    return packs;
}

/* Fills packed with the points along the curve, pack by pack, each pack about the middle of its
 * box. */
static void pack_points(const cutter *c, ov_points *points, float *packed) {
    size_t first = 0;
    for (size_t pack = 0; pack < points->packs; ++pack) {
        double box[BOX];
        float *const own = packed + pack * (3 * OV_PACK), *const base =
                                                              points->pack_origin + 4 * pack;
        const size_t size = cut_pack(c, first, box);
        for (int k = 0; k < 3; ++k)
            base[k] = ov_to_float(0.5 * box[k] + 0.5 * box[k + 3] - points->origin[k]);
        base[3] = (float)size;
        for (size_t j = 0; j < OV_PACK; ++j) {
            const uint32_t from = c->curve[first + (j < size ? j : size - 1)];
            points->order[pack * OV_PACK + j] = from;
            for (size_t k = 0; k < 3; ++k)
                own[k * OV_PACK + j] =
                    (float)(c->xyz[3 * (size_t)from + k] - points->origin[k] - (double)base[k]);
        }
        first += size;
    }
}

/* Cuts the curve into packs and uploads them. */
static ovoid_status make_packs(ovoid_context *context, const cutter *c, ov_points *points) {
    ovoid_status status = OVOID_OK;
    points->packs = count_packs(c);
    if (points->packs > UINT32_MAX / OV_PACK)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu packs of points are more than 2^28",
                       points->packs);
    const size_t size = points->packs * OV_PACK;
    float *const packed = ov_alloc(context, 3 * size, sizeof *packed, "packed points");
    points->order = ov_alloc(context, size, sizeof *points->order, "the order of the points");
    points->pack_origin =
        ov_alloc(context, points->packs * 4, sizeof *points->pack_origin, "origins of packs");
    if (!packed || !points->order || !points->pack_origin) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    pack_points(c, points, packed);
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_points_upload(context, packed, points));
cleanup:
    free(packed);
    return status;
}

ovoid_status ov_points_create(ovoid_context *context, const double *xyz, size_t count,
                              const double origin[3], double resolution, ov_points *points) {
    ovoid_status status = OVOID_OK;
    ov_points made = {.count = count};
    memcpy(made.origin, origin, sizeof made.origin);
    if (count > UINT32_MAX - OV_PACK)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu points are more than 2^32", count);
    uint32_t *const curve = ov_alloc(context, count, sizeof *curve, "the order of the points");
    if (!curve)
        return OVOID_ERROR_MEMORY;
    const cutter c = {
        .xyz = xyz, .curve = curve, .count = count, .longest = longest_side(resolution)};
    OV_TRY(ov_curve_order(context, xyz, count, resolution, curve));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(make_packs(context, &c, &made));
cleanup:
    free(curve);
    if (status == OVOID_OK)
        *points = made;
    else
        ov_points_destroy(&made);
    return status;
}

void ov_points_destroy(ov_points *points) {
    free(points->order);
    free(points->pack_origin);
    free(points->host_boxes);
    ov_buffer_destroy(&points->xyz);
    ov_buffer_destroy(&points->pack_origins);
    ov_buffer_destroy(&points->boxes);
    memset(points, 0, sizeof *points);
}
