#include "field/field.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BOX 6 /* low x, y, z, high x, y, z */

static int ascending(const void *a, const void *b) {
    const uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;
    return (p > q) - (p < q);
}

size_t ov_packs_tidy(uint32_t *packs, size_t count) {
    size_t kept = 0;
    if (count > 1) /* packs may be NULL where there are none */
        qsort(packs, count, sizeof *packs, ascending);
    for (size_t n = 0; n < count; ++n)
        if (n == 0 || packs[n] != packs[n - 1])
            packs[kept++] = packs[n];
    return kept;
}

/* ---- packs near a place --------------------------------------------------------------------- */

/* Whether a box comes as near as that to a place (angstrom, relative to the points' origin). */
static bool is_near(const float box[BOX], const double at[3], double reach) {
    double square = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double below = (double)box[k] - at[k], above = at[k] - (double)box[k + 3];
        const double off = below > 0.0 ? below : above > 0.0 ? above : 0.0;
        square += off * off;
    }
    return square <= reach * reach;
}

/* A walk down the tree. */
typedef struct search {
    ovoid_context *context;
    const ov_points *points;
    double at[3], reach;
    ov_packs *found;
} search;

static ovoid_status descend(const search *s, unsigned level, size_t box) {
    ovoid_status status = OVOID_OK;
    const ov_tree *const tree = &s->points->tree;
    float bounds[BOX];
    ov_tree_box(s->points->host_boxes, tree, level, box, bounds);
    if (!is_near(bounds, s->at, s->reach))
        return OVOID_OK;
    if (level == 0) {
        OV_TRY(ov_grow(s->context, &s->found->pack, &s->found->capacity, s->found->count + 1,
                       sizeof *s->found->pack, "packs"));
        s->found->pack[s->found->count++] = (uint32_t)box;
        return OVOID_OK;
    }
    for (size_t child = box * OV_GROUP;
         child < (box + 1) * OV_GROUP && child < tree->boxes[level - 1]; ++child)
        OV_TRY(descend(s, level - 1, child));
cleanup:
    return status;
}

ovoid_status ov_packs_near(ovoid_context *context, const ov_points *points, const double at[3],
                           double reach, ov_packs *found) {
    ovoid_status status = OVOID_OK;
    search s = {.context = context, .points = points, .found = found};
    s.reach = reach + (double)points->rounding;
    for (int k = 0; k < 3; ++k)
        s.at[k] = at[k] - points->origin[k];
    const unsigned top = points->tree.levels;
    for (size_t box = 0; top > 0 && box < points->tree.boxes[top - 1]; ++box)
        OV_TRY(descend(&s, top - 1, box));
cleanup:
    return status;
}

/* ---- packs that are reached ----------------------------------------------------------------- */

/* Read at once, so that one round trip is enough as a rule: this and a quarter more than there were
 * the last time. */
#define EXPECTED 255

static ovoid_status read_list(ovoid_context *context, const ov_buffer *list, size_t packs,
                              ov_packs *found) {
    ovoid_status status = OVOID_OK;
    size_t expected = EXPECTED + found->count + found->count / 4;
    expected = expected < packs ? expected : packs;
    OV_TRY(ov_grow(context, &found->pack, &found->capacity, 1 + expected, sizeof *found->pack,
                   "packs"));
    OV_TRY(ov_buffer_read(context, list, 0, found->pack, (1 + expected) * sizeof *found->pack));
    found->count = found->pack[0];
    if (found->count > expected) {
        OV_TRY(ov_grow(context, &found->pack, &found->capacity, 1 + found->count,
                       sizeof *found->pack, "packs"));
        OV_TRY(ov_buffer_read(context, list, 0, found->pack,
                              (1 + found->count) * sizeof *found->pack));
    }
    memmove(found->pack, found->pack + 1, found->count * sizeof *found->pack);
cleanup:
    return status;
}

ovoid_status ov_packs_reached(ovoid_context *context, const ov_lists *lists, ov_buffer *list,
                              ov_packs *found) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    ov_device *device;
    const cl_uint packs = (cl_uint)lists->packs;
    OV_TRY(ov_device_get(context, &device));
    const size_t group = device->shape.lanes == 1 ? 1 : OV_SCAN_GROUP;
    OV_TRY(ov_kernel_create(context, "gather", "list_reached", &kernel));
    OV_TRY(ov_buffer_reserve(context, list, (1 + lists->packs) * sizeof(cl_uint), "packs"));
    OV_TRY(OV_LAUNCH(context, &kernel, group, group, OV_ARG(packs),
                     OV_ARG(lists->pack_start.memory), OV_ARG(list->memory)));
    OV_TRY(read_list(context, list, lists->packs, found));
cleanup:
    ov_kernel_destroy(&kernel);
    return status;
}

void ov_packs_destroy(ov_packs *packs) {
    free(packs->pack);
    *packs = (ov_packs){0};
}

/* ---- gathering ------------------------------------------------------------------------------ */

/* What is known of the packs on the host: origins, boxes and the tree of these. */
static ovoid_status gather_host(ovoid_context *context, const ov_points *from,
                                const uint32_t *packs, size_t count, ov_points *to) {
    ovoid_status status = OVOID_OK;
    float *const leaves = ov_alloc(context, count * BOX, sizeof *leaves, "boxes of packs");
    size_t floats = 0;
    free(to->pack_origin);
    free(to->host_boxes);
    to->host_boxes = NULL;
    to->pack_origin = ov_alloc(context, count * 4, sizeof *to->pack_origin, "origins of packs");
    if (!leaves || !to->pack_origin) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    float largest = 0.0f;
    for (size_t n = 0; n < count; ++n) {
        memcpy(to->pack_origin + 4 * n, from->pack_origin + 4 * (size_t)packs[n],
               4 * sizeof *to->pack_origin);
        ov_tree_box(from->host_boxes, &from->tree, 0, packs[n], leaves + n * BOX);
        for (size_t k = n * BOX; k < (n + 1) * BOX; ++k)
            largest = fabsf(leaves[k]) > largest ? fabsf(leaves[k]) : largest;
    }
    to->rounding = OV_BOX_ROUNDING * largest;
    OV_TRY(ov_tree_build(context, leaves, count, &to->tree, &to->host_boxes, &floats));
    OV_TRY(ov_buffer_put(context, &to->boxes, to->host_boxes, floats * sizeof *to->host_boxes,
                         "boxes of packs"));
cleanup:
    free(leaves);
    return status;
}

ovoid_status ov_points_gather(ovoid_context *context, const ov_points *from, const uint32_t *packs,
                              size_t count, ov_buffer *list, ov_points *to) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    ov_device *device;
    const cl_uint some = (cl_uint)count;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "gather", "gather_points", &kernel));
    to->packs = count;
    to->count = count * OV_PACK;
    memcpy(to->origin, from->origin, sizeof to->origin);
    OV_TRY(gather_host(context, from, packs, count, to));
    OV_TRY(ov_buffer_put(context, list, packs, count * sizeof *packs, "packs"));
    OV_TRY(ov_buffer_reserve(context, &to->xyz, count * 3 * OV_PACK * sizeof(cl_float), "points"));
    OV_TRY(ov_buffer_reserve(context, &to->pack_origins, count * 4 * sizeof(cl_float),
                             "origins of packs"));
    OV_TRY(OV_LAUNCH(context, &kernel, count, ov_item_group(device), OV_ARG(some),
                     OV_ARG(list->memory), OV_ARG(from->xyz.memory),
                     OV_ARG(from->pack_origins.memory), OV_ARG(to->xyz.memory),
                     OV_ARG(to->pack_origins.memory)));
cleanup:
    ov_kernel_destroy(&kernel);
    return status;
}
