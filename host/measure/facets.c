#include "measure/facets.h"

#include "field/field.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

#define BOX 6 /* floats: low x, y, z, high x, y, z */

void ov_facets_round(const ov_facets *facets, const ovoid_mesh *mesh, const uint32_t *vertex,
                     size_t first, size_t count, float *xyz) {
    for (size_t k = 0; k < count; ++k) {
        double at[3];
        ov_mesh_at(mesh, vertex ? vertex[first + k] : first + k, at);
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * k + axis] = (float)(at[axis] - facets->origin[axis]);
    }
}

#define LEAF_BYTES (OV_TRIANGLE * OV_LEAF * sizeof(cl_float))

/* Vertices are rounded so many at a time, so that the host holds few of them twice. */
#define PIECE_VERTICES ((size_t)1 << 16)

/* Whether its mesh has left its vertices there. */
static bool is_on_device(const ov_facets *facets) {
    const ovoid_mesh *const mesh = facets->trail.mesh;
    return mesh->on_device[OV_ON_DEVICE_OFFSETS].memory && ov_mesh_is_about(mesh, facets->origin);
}

/* The same of its triangles, all of which are wanted. */
static bool are_corners_there(const ov_facets *facets) {
    return is_on_device(facets) && !facets->trail.triangle;
}

const ov_buffer *ov_facets_xyz(const ov_facets *facets) {
    return is_on_device(facets) ? &facets->trail.mesh->on_device[OV_ON_DEVICE_OFFSETS]
                                : &facets->vertices;
}

static ovoid_status load_vertices(ovoid_context *context, ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    const ovoid_mesh *const mesh = facets->trail.mesh;
    const size_t each = 3 * sizeof(float);
    float *xyz = NULL;
    if (is_on_device(facets))
        return OVOID_OK;
    if (ov_mesh_is_about(mesh, facets->origin))
        return ov_buffer_put(context, &facets->vertices, mesh->offsets, mesh->vertices * each,
                             "vertices of a mesh");
    OV_TRY(
        ov_buffer_reserve(context, &facets->vertices, mesh->vertices * each, "vertices of a mesh"));
    xyz = ov_alloc(context, PIECE_VERTICES, each, "vertices of a mesh");
    if (!xyz)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (size_t first = 0, count; first < mesh->vertices; first += count) {
        count = mesh->vertices - first < PIECE_VERTICES ? mesh->vertices - first : PIECE_VERTICES;
        OV_TRY(ov_progress_ask(context));
        ov_facets_round(facets, mesh, NULL, first, count, xyz);
        OV_TRY(ov_buffer_write(context, &facets->vertices, first * each, xyz, count * each));
    }
cleanup:
    free(xyz);
    return status;
}

/* The corners of the triangles from `first` to `end`, or of the first ones of so many leaves. */
static ovoid_status list_corners(ovoid_context *context, ov_facets *facets, bool coarse,
                                 size_t first, size_t end, const uint32_t **corners) {
    const uint32_t *const all = facets->trail.mesh->corners;
    *corners = all + 3 * first;
    if (!coarse && !facets->trail.triangle)
        return OVOID_OK;
    const ovoid_status status =
        ov_grow(context, &facets->listed, &facets->listed_capacity, 3 * (end - first),
                sizeof *facets->listed, "triangles of a mesh");
    for (size_t k = first; k < end && status == OVOID_OK; ++k) {
        const size_t t = ov_trail_triangle(&facets->trail, coarse ? k * OV_LEAF : k);
        memcpy(facets->listed + 3 * (k - first), all + 3 * t, 3 * sizeof *all);
    }
    *corners = facets->listed;
    return status;
}

static ovoid_status put_corners(ovoid_context *context, ov_facets *facets, bool coarse,
                                size_t first, size_t end) {
    const uint32_t *corners;
    const ovoid_status status = list_corners(context, facets, coarse, first, end, &corners);
    return status != OVOID_OK
               ? status
               : ov_buffer_put(context, &facets->corners, corners,
                               3 * (end - first) * sizeof *corners, "triangles of a mesh");
}

_Static_assert(OV_LEAF == OV_GROUP, "coarse leaves are groups of leaves");

ovoid_status ov_facets_load(ovoid_context *context, ov_facets *facets, bool coarse, size_t first,
                            size_t end) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    const size_t total = coarse ? facets->leaves : facets->trail.triangles, from = first * OV_LEAF,
                 to = end * OV_LEAF < total ? end * OV_LEAF : total;
    const cl_uint leaves = (cl_uint)(end - first), triangles = (cl_uint)(to - from);
    const bool there = are_corners_there(facets);
    const cl_mem xyz = ov_facets_xyz(facets)->memory;
    const cl_uint stride = there && coarse ? OV_LEAF : 1,
                  begin = there ? (cl_uint)(from * stride) : 0;
    cl_mem corners = there ? facets->trail.mesh->on_device[OV_ON_DEVICE_CORNERS].memory : NULL;
    if (facets->first == first && facets->end == end && facets->coarse == coarse)
        return OVOID_OK;
    facets->first = facets->end = 0;
    OV_TRY(ov_device_get(context, &device));
    if (!there) {
        OV_TRY(put_corners(context, facets, coarse, from, to));
        corners = facets->corners.memory;
    }
    OV_TRY(ov_buffer_reserve(context, &facets->packed, (end - first) * LEAF_BYTES,
                             "triangles of a mesh"));
    OV_TRY(ov_buffer_reserve(context, &facets->leaf_boxes, (end - first) * BOX * sizeof(cl_float),
                             "boxes of triangles"));
    OV_TRY(OV_LAUNCH(context, &facets->pack, leaves, ov_item_group(device), OV_ARG(leaves),
                     OV_ARG(triangles), OV_ARG(begin), OV_ARG(stride), OV_ARG(corners), OV_ARG(xyz),
                     OV_ARG(facets->packed.memory), OV_ARG(facets->leaf_boxes.memory)));
    if (!coarse && end - first == facets->leaves) { /* nobody asks for them again */
        ov_buffer_destroy(&facets->corners);
        free(facets->listed);
        facets->listed = NULL;
        facets->listed_capacity = 0;
    }
    facets->first = first;
    facets->end = end;
    facets->coarse = coarse;
cleanup:
    return status;
}

/* The boxes of all leaves, chunk by chunk, and the tree over them. */
static ovoid_status grow_tree_by_chunks(ovoid_context *context, ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    const size_t leaves = facets->leaves, chunk = facets->chunk;
    float *tree = NULL;
    size_t floats = 0;
    OV_TRY(ov_grow(context, &facets->box, &facets->box_capacity, leaves * BOX + 1,
                   sizeof *facets->box, "boxes of triangles"));
    for (size_t first = 0, end; first < leaves; first = end) {
        end = leaves - first < chunk ? leaves : first + chunk;
        OV_TRY(ov_facets_load(context, facets, false, first, end));
        OV_TRY(ov_buffer_read(context, &facets->leaf_boxes, 0, facets->box + first * BOX,
                              (end - first) * BOX * sizeof *facets->box));
    }
    facets->boxed = true;
    OV_TRY(ov_tree_build(context, facets->box, leaves, &facets->tree, &tree, &floats));
    OV_TRY(
        ov_buffer_put(context, &facets->boxes, tree, floats * sizeof *tree, "boxes of triangles"));
cleanup:
    free(tree);
    return status;
}

ovoid_status ov_facets_boxes(ovoid_context *context, ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    const ov_tree *const tree = &facets->tree;
    const size_t groups = (facets->leaves + OV_GROUP - 1) / OV_GROUP;
    float *lowest = NULL;
    if (facets->boxed || facets->leaves == 0)
        return OVOID_OK;
    lowest = ov_alloc(context, groups * OV_GROUP * BOX, sizeof *lowest, "boxes of triangles");
    if (!lowest)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_grow(context, &facets->box, &facets->box_capacity, facets->leaves * BOX,
                   sizeof *facets->box, "boxes of triangles"));
    OV_TRY(ov_buffer_read(context, &facets->boxes, 0, lowest,
                          groups * OV_GROUP * BOX * sizeof *lowest));
    for (size_t leaf = 0; leaf < facets->leaves; ++leaf)
        ov_tree_box(lowest, tree, 0, leaf, facets->box + leaf * BOX);
    facets->boxed = true;
cleanup:
    free(lowest);
    return status;
}

static ovoid_status grow_tree(ovoid_context *context, ov_facets *facets) {
    if (facets->leaves > facets->chunk || facets->leaves == 0)
        return grow_tree_by_chunks(context, facets);
    const ovoid_status status = ov_facets_load(context, facets, false, 0, facets->leaves);
    return status != OVOID_OK ? status
                              : ov_tree_grow(context, &facets->leaf_boxes, facets->leaves,
                                             &facets->tree, &facets->boxes);
}

/* Leaves at a time, unless a test says how many. */
static ovoid_status choose_chunk(ovoid_context *context, ov_facets *facets) {
    ov_device *device;
    const ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK || facets->chunk > 0)
        return status;
    const size_t most =
        (size_t)(OV_FACETS_SHARE * (double)device->info.global_memory / (double)LEAF_BYTES);
    facets->chunk = most > OV_FACETS_CHUNK ? most : OV_FACETS_CHUNK;
    return OVOID_OK;
}

ovoid_status ov_facets_set(ovoid_context *context, ov_facets *facets, const ov_trail *trail,
                           const double origin[3]) {
    ovoid_status status = OVOID_OK;
    facets->trail = *trail;
    memcpy(facets->origin, origin, sizeof facets->origin);
    facets->leaves = (trail->triangles + OV_LEAF - 1) / OV_LEAF;
    facets->first = facets->end = 0;
    facets->boxed = false;
    OV_TRY(choose_chunk(context, facets));
    if (!facets->pack.handle)
        OV_TRY(ov_kernel_create(context, "distance", "pack_leaves", &facets->pack));
    OV_TRY(load_vertices(context, facets));
    OV_TRY(grow_tree(context, facets));
cleanup:
    if (status != OVOID_OK) {
        facets->trail = (ov_trail){0};
        facets->leaves = 0;
    }
    return status;
}

void ov_facets_destroy(ov_facets *facets) {
    ov_buffer *const buffers[] = {&facets->boxes, &facets->vertices, &facets->corners,
                                  &facets->packed, &facets->leaf_boxes};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_kernel_destroy(&facets->pack);
    free(facets->box);
    free(facets->listed);
    memset(facets, 0, sizeof *facets);
}
