#include "picture/rays.h"

#include "picture/camera.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(OV_BLOCK_X *OV_BLOCK_Y == OV_PACK, "a block is a pack");

#define TILE 32                        /* rays on a side of the smallest tile, */
#define TILE_LEAST 8                   /* or fewer, where they are so far apart that */
#define TILE_SIDE 24.0                 /* it is larger than this, angstrom */
#define BOXES_MOST ((uint64_t)1 << 20) /* before tiles grow; */
#define BOXES_FAR ((uint64_t)1 << 22)  /* where rays are far apart */
#define SLABS_MOST ((uint64_t)1 << 21) /* altogether */
#define VISITS_MOST 1e11               /* of slabs by packs of rays: a minute on two cores */
#define CURVE_BITS 21                  /* tiles and slabs are fewer than 2^21 each way */
#define STEP_LEAST 0.05                /* angstrom */
#define STEP_MOST 0.4                  /* angstrom */
#define STEP_PER_WIDTH 0.45            /* of the narrowest term along the rays, */
#define STEP_PER_RAY 0.125             /* but of the rays' distance at least */
#define PACKS_MOST ((uint64_t)UINT32_MAX / OV_PACK)

size_t ov_rays_blocks(const ov_rays *rays) {
    return (rays->columns + OV_BLOCK_X - 1) / OV_BLOCK_X;
}

size_t ov_rays_packs(const ov_rays *rays) {
    return ov_rays_blocks(rays) * ((rays->rows + OV_BLOCK_Y - 1) / OV_BLOCK_Y);
}

size_t ov_rays_index(const ov_rays *rays, uint32_t column, uint32_t row) {
    const size_t block = row / OV_BLOCK_Y * ov_rays_blocks(rays) + column / OV_BLOCK_X;
    return block * OV_PACK + row % OV_BLOCK_Y * OV_BLOCK_X + column % OV_BLOCK_X;
}

/* ---- boxes -------------------------------------------------------------------------------- */

/* The part of the quadrics that rays can come by: depths from low to high, and the step that their
 * widths along z ask for. False: none. */
static bool measure_depth(const ov_quadric *quadrics, size_t count, double cutoff,
                          const ov_rays *rays, double *low, double *high, double *step) {
    const double right = rays->left + rays->columns * rays->spacing;
    const double bottom = rays->top - rays->rows * rays->spacing;
    double sharpest = 0.0;
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
        const ov_extent one = ov_extent_of(&quadrics[i], 1, cutoff);
        if (one.low[0] > right || one.high[0] < rays->left || one.low[1] > rays->top ||
            one.high[1] < bottom || one.low[2] > one.high[2])
            continue;
        *low = fmin(*low, one.low[2]);
        *high = fmax(*high, one.high[2]);
        sharpest = fmax(sharpest, quadrics[i].a[5]);
    }
    const double finest = fmin(fmax(STEP_LEAST, STEP_PER_RAY * rays->spacing), STEP_MOST);
    *step = fmax(finest, fmin(STEP_MOST, STEP_PER_WIDTH / sqrt(2.0 * sharpest)));
    return *low <= *high;
}

/* Tiles grow until the boxes are few enough; one tile for all in the worst case. */
static void plan_tiles(const ov_rays *rays, ov_boxes *boxes) {
    uint32_t least = TILE;
    while (least > TILE_LEAST && least * rays->spacing > TILE_SIDE)
        least /= 2;
    for (boxes->tile = least;; boxes->tile *= 2) {
        boxes->tiles_x = (rays->columns + boxes->tile - 1) / boxes->tile;
        boxes->tiles_y = (rays->rows + boxes->tile - 1) / boxes->tile;
        const uint64_t tiles = (uint64_t)boxes->tiles_x * boxes->tiles_y;
        if (tiles == 1 || tiles * boxes->slabs <= (least < TILE ? BOXES_FAR : BOXES_MOST))
            return;
    }
}

/* Boxes in the order of a space-filling curve, as a tree over them asks for. */
static ovoid_status order_boxes(ovoid_context *context, const ov_boxes *boxes, size_t count,
                                uint32_t *order) {
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "curve positions");
    if (!keys)
        return OVOID_ERROR_MEMORY;
    for (size_t b = 0; b < count; ++b) {
        const size_t tile = b / boxes->slabs;
        keys[b] =
            ov_hilbert_index((uint32_t)(tile % boxes->tiles_x), (uint32_t)(tile / boxes->tiles_x),
                             (uint32_t)(b % boxes->slabs), CURVE_BITS);
    }
    const ovoid_status status = ov_sort_keys(context, keys, count, order);
    free(keys);
    return status;
}

/* Low x, y, z, high x, y, z of the rays' positions in box b. */
static void box_bounds(const ov_boxes *boxes, const ov_rays *rays, size_t b, float bounds[6]) {
    const size_t tile = b / boxes->slabs, slab = b % boxes->slabs;
    const double column = (double)(tile % boxes->tiles_x * boxes->tile);
    const double row = (double)(tile / boxes->tiles_x * boxes->tile);
    const double side = (boxes->tile - 1) * rays->spacing;
    const double thick = OV_SLAB_STEPS * boxes->step;
    const double low[3] = {rays->left + column * rays->spacing,
                           rays->top - row * rays->spacing - side,
                           boxes->front - (double)(slab + 1) * thick};
    const double size[3] = {side, side, thick};
    for (int k = 0; k < 3; ++k) {
        bounds[k] = (float)low[k];
        bounds[k + 3] = (float)(low[k] + size[k]);
    }
}

static ovoid_status make_cells(ovoid_context *context, const ov_rays *rays, ov_boxes *boxes) {
    ovoid_status status = OVOID_OK;
    const size_t count = (size_t)boxes->tiles_x * boxes->tiles_y * boxes->slabs;
    uint32_t *const order = ov_alloc(context, count, sizeof *order, "the order of boxes");
    uint32_t *const box_of = ov_alloc(context, count, sizeof *box_of, "boxes");
    float *const leaves = ov_alloc(context, 6 * count, sizeof *leaves, "boxes");
    float *tree = NULL;
    size_t floats = 0;
    if (!order || !box_of || !leaves) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(order_boxes(context, boxes, count, order));
    for (size_t k = 0; k < count; ++k) {
        box_of[order[k]] = (uint32_t)k;
        box_bounds(boxes, rays, order[k], leaves + 6 * k);
    }
    boxes->cells.count = boxes->cells.packs = count;
    OV_TRY(ov_tree_build(context, leaves, count, &boxes->cells.tree, &tree, &floats));
    OV_TRY(ov_buffer_put(context, &boxes->cells.boxes, tree, floats * sizeof *tree, "boxes"));
    OV_TRY(ov_buffer_put(context, &boxes->box_of, box_of, count * sizeof *box_of, "boxes of rays"));
cleanup:
    free(order);
    free(box_of);
    free(leaves);
    free(tree);
    return status;
}

ovoid_status ov_boxes_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                             double cutoff, const ov_rays *rays, ov_boxes *boxes) {
    ovoid_status status = OVOID_OK;
    const double origin[3] = {0.0, 0.0, 0.0};
    double low, high;
    memset(boxes, 0, sizeof *boxes);
    if ((uint64_t)ov_rays_blocks(rays) * rays->rows / OV_BLOCK_Y >= PACKS_MOST)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%u by %u rays are more than 2^32",
                       (unsigned)rays->columns, (unsigned)rays->rows);
    if (!measure_depth(quadrics, count, cutoff, rays, &low, &high, &boxes->step))
        low = high = 0.0;
    /* A whole number of steps in front, so that the first position is outside. */
    boxes->front = high + boxes->step;
    const double slabs = ceil((boxes->front - low) / (OV_SLAB_STEPS * boxes->step));
    if (!(slabs < (double)SLABS_MOST))
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "%g angstrom along the line of sight are too deep for a picture",
                       boxes->front - low);
    if (slabs * (double)ov_rays_packs(rays) > VISITS_MOST)
        return ov_fail(
            context, OVOID_ERROR_LIMIT,
            "%g angstrom along the line of sight are too deep for a picture of so many pixels; "
            "take a smaller one, or look from where it is less deep",
            boxes->front - low);
    boxes->slabs = slabs < 1.0 ? 1 : (uint32_t)slabs;
    plan_tiles(rays, boxes);
    OV_TRY(make_cells(context, rays, boxes));
    OV_TRY(ov_terms_set(context, &boxes->terms, quadrics, count, origin, cutoff));
    boxes->lists.packs_only = true;
    OV_TRY(ov_lists_build(context, &boxes->lists, &boxes->cells, &boxes->terms, 0.0));
cleanup:
    if (status != OVOID_OK)
        ov_boxes_destroy(boxes);
    return status;
}

void ov_boxes_destroy(ov_boxes *boxes) {
    ov_terms_destroy(&boxes->terms);
    ov_points_destroy(&boxes->cells);
    ov_lists_destroy(&boxes->lists);
    ov_buffer_destroy(&boxes->box_of);
    memset(boxes, 0, sizeof *boxes);
}

/* ---- rays --------------------------------------------------------------------------------- */

void ov_hits_destroy(ov_hits *hits) {
    ov_buffer_destroy(&hits->depth);
    ov_buffer_destroy(&hits->normal);
    ov_buffer_destroy(&hits->extra);
}

void ov_tracer_destroy(ov_tracer *tracer) {
    ov_kernel_destroy(&tracer->trace);
    ov_kernel_destroy(&tracer->ellipsoids);
    ov_kernel_destroy(&tracer->compare);
}

/* What every kernel over rays takes first, as its arguments want it. */
typedef struct ray_arguments {
    cl_uint packs, blocks, tile, tiles, slabs;
    cl_float left, top, spacing, front, step;
    size_t global, group; /* work-items, each a vector of rays */
} ray_arguments;

/* Work-items in a work-group of a CPU and of a GPU: nothing is shared. */
#define CPU_GROUP 4
#define GPU_GROUP 64

static ovoid_status prepare(ovoid_context *context, ov_kernel *kernel, const char *name,
                            const ov_rays *rays, const ov_boxes *boxes, ov_hits *hits,
                            ray_arguments *arguments) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    const size_t packs = ov_rays_packs(rays), bytes = packs * OV_PACK * sizeof(cl_float);
    OV_TRY(ov_device_get(context, &device));
    if (!kernel->handle)
        OV_TRY(ov_kernel_create(context, "render", name, kernel));
    OV_TRY(ov_buffer_reserve(context, &hits->depth, bytes, "depths of rays"));
    OV_TRY(ov_buffer_reserve(context, &hits->normal, bytes, "normals of rays"));
    OV_TRY(ov_buffer_reserve(context, &hits->extra, bytes, "values of rays"));
    *arguments = (ray_arguments){
        .packs = (cl_uint)packs,
        .blocks = (cl_uint)ov_rays_blocks(rays),
        .tile = boxes->tile,
        .tiles = boxes->tiles_x,
        .slabs = boxes->slabs,
        .left = (cl_float)rays->left,
        .top = (cl_float)rays->top,
        .spacing = (cl_float)rays->spacing,
        .front = (cl_float)boxes->front,
        .step = (cl_float)boxes->step,
        .global = packs * (OV_PACK / device->shape.vector),
        .group = device->shape.lanes == 1 ? CPU_GROUP : GPU_GROUP,
    };
cleanup:
    return status;
}

#define GRID(a)                                                                                    \
    OV_ARG((a).packs), OV_ARG((a).blocks), OV_ARG((a).tile), OV_ARG((a).tiles), OV_ARG((a).slabs), \
        OV_ARG((a).left), OV_ARG((a).top), OV_ARG((a).spacing), OV_ARG((a).front),                 \
        OV_ARG((a).step)
#define LISTS(boxes)                                                                               \
    OV_ARG((boxes)->box_of.memory), OV_ARG((boxes)->lists.pack_start.memory),                      \
        OV_ARG((boxes)->lists.pack_item.memory), OV_ARG((boxes)->terms.device.memory)

ovoid_status ov_trace(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                      const ov_boxes *boxes, double level, ov_hits *hits) {
    ovoid_status status = OVOID_OK;
    ray_arguments a;
    const cl_float at = (cl_float)level;
    OV_TRY(prepare(context, &tracer->trace, "trace", rays, boxes, hits, &a));
    OV_TRY(OV_LAUNCH(context, &tracer->trace, a.global, a.group, GRID(a), OV_ARG(at), LISTS(boxes),
                     OV_ARG(hits->depth.memory), OV_ARG(hits->normal.memory),
                     OV_ARG(hits->extra.memory)));
cleanup:
    return status;
}

ovoid_status ov_trace_ellipsoids(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                                 const ov_boxes *boxes, ov_hits *hits) {
    ovoid_status status = OVOID_OK;
    ray_arguments a;
    OV_TRY(prepare(context, &tracer->ellipsoids, "trace_ellipsoids", rays, boxes, hits, &a));
    OV_TRY(OV_LAUNCH(context, &tracer->ellipsoids, a.global, a.group, GRID(a), LISTS(boxes),
                     OV_ARG(hits->depth.memory), OV_ARG(hits->normal.memory),
                     OV_ARG(hits->extra.memory)));
cleanup:
    return status;
}

ovoid_status ov_compare(ovoid_context *context, ov_tracer *tracer, const ov_rays *rays,
                        const ov_boxes *other, double level, ov_hits *hits) {
    ovoid_status status = OVOID_OK;
    ray_arguments a;
    const cl_float at = (cl_float)level;
    OV_TRY(prepare(context, &tracer->compare, "compare", rays, other, hits, &a));
    OV_TRY(OV_LAUNCH(context, &tracer->compare, a.global, a.group, GRID(a), OV_ARG(at),
                     LISTS(other), OV_ARG(hits->depth.memory), OV_ARG(hits->extra.memory)));
cleanup:
    return status;
}
