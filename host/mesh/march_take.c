/* From the lattice of a piece to its part of the mesh. */
#include "mesh/marching.h"

#include <stdlib.h>
#include <string.h>

/* Newton's steps of a vertex at most: a few, or enough to halve a bracket down to rounding. */
#define REFINE_STEPS 24
#define REFINE_CLOSE 1e-4 /* lattice steps; what is left after such a step is of order 1e-8 */

#define BOX 6 /* low x, y, z, high x, y, z */

/* ---- vertices on the surface ----------------------------------------------------------------- */

/* Lattice coordinates within the piece and axis of an edge (see march_vertices()). */
static cl_uint read_edge(cl_uint edge, cl_uint at[3]) {
    at[0] = edge & 255u;
    at[1] = edge >> 8 & 255u;
    at[2] = edge >> 16 & 255u;
    return edge >> 24 & 3u;
}

/* Edges, numbers and first positions of the piece's vertices. */
static ovoid_status fill_vertices(ovoid_context *context, ov_marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const size_t room = packs * OV_PACK;
    const cl_uint nx = (cl_uint)m->grid.bricks[0], ny = (cl_uint)m->grid.bricks[1];
    const cl_float isovalue = (cl_float)m->options->isovalue;
    const cl_int logarithmic = m->options->vertices == OVOID_VERTEX_EXACT;
    OV_TRY(ov_buffer_reserve(context, &m->edge, room * sizeof(cl_uint), "edges of vertices"));
    OV_TRY(ov_buffer_reserve(context, &m->t, room * sizeof(cl_float), "vertices"));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_VERTICES], m->active, m->group, OV_ARG(m->active),
                     OV_ARG(m->list.memory), OV_ARG(nx), OV_ARG(ny), OV_ARG(isovalue),
                     OV_ARG(logarithmic), OV_ARG(m->place.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->edge.memory), OV_ARG(m->t.memory)));
cleanup:
    return status;
}

/* The box of each pack of vertices, and the tree over them. */
static ovoid_status box_packs(ovoid_context *context, ov_marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs_count = (cl_uint)packs, vertices = (cl_uint)m->new_vertices;
    const cl_float spacing = (cl_float)m->pieces.spacing;
    ov_points *const points = &m->vertex_points;
    points->count = packs * OV_PACK;
    points->packs = packs;
    OV_TRY(
        ov_buffer_reserve(context, &m->box, packs * BOX * sizeof(cl_float), "boxes of vertices"));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_BOXES], packs, m->group, OV_ARG(packs_count),
                     OV_ARG(vertices), OV_ARG(spacing), OV_ARG(m->edge.memory), OV_ARG(m->t.memory),
                     OV_ARG(m->box.memory)));
    OV_TRY(ov_tree_grow(context, &m->box, packs, &points->tree, &points->boxes));
cleanup:
    return status;
}

static ovoid_status refine(ovoid_context *context, ov_marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    const cl_uint packs_count = (cl_uint)packs;
    const cl_uint steps = m->options->vertices == OVOID_VERTEX_EXACT ? REFINE_STEPS : 0;
    const cl_float spacing = (cl_float)m->pieces.spacing, isovalue = (cl_float)m->options->isovalue,
                   close = (cl_float)REFINE_CLOSE;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(
        ov_buffer_reserve(context, &m->normal, packs * 3 * OV_PACK * sizeof(cl_float), "normals"));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_REFINE], packs * device->shape.lanes, m->group,
                     OV_ARG(packs_count), OV_ARG(spacing), OV_ARG(isovalue), OV_ARG(steps),
                     OV_ARG(close), OV_ARG(m->edge.memory),
                     OV_ARG(m->vertex_lists.pack_start.memory),
                     OV_ARG(m->vertex_lists.pack_item.memory), OV_ARG(m->terms.device.memory),
                     OV_ARG(m->t.memory), OV_ARG(m->normal.memory)));
cleanup:
    return status;
}

/* Puts the vertices on the surface. */
static ovoid_status make_vertices(ovoid_context *context, ov_marcher *m, size_t packs, bool begin,
                                  bool *whole) {
    ovoid_status status = OVOID_OK;
    bool begun = begin;
    OV_TRY(fill_vertices(context, m, packs));
    OV_TRY(box_packs(context, m, packs));
    status = ov_marching_begin_lists(context, m, &m->vertex_lists, &m->vertex_points, &begun);
    if (status == OVOID_OK)
        status = refine(context, m, packs);
    *whole = true;
    if (begun && status == OVOID_OK)
        status = ov_lists_end(context, &m->vertex_lists, whole);
    else if (begun)
        ov_later_end(context, &m->vertex_lists.later);
cleanup:
    return status;
}

/* ---- from the device ------------------------------------------------------------------------ */

ovoid_status ov_marching_grow_vertices(ovoid_context *context, ov_marcher *m, size_t total) {
    ovoid_status status = OVOID_OK;
    if (m->origin)
        OV_TRY(ov_grow(context, &m->offsets, &m->offsets_capacity, 3 * total, sizeof *m->offsets,
                       "vertices"));
    else
        OV_TRY(ov_store_grow(context, m->store, &m->xyz, &m->xyz_capacity, 3 * total,
                             sizeof *m->xyz, "vertices"));
    if (!m->origin)
        OV_TRY(ov_store_grow(context, m->store, &m->edge_of, &m->edge_of_capacity, total,
                             sizeof *m->edge_of, "vertices"));
    if (!m->bare)
        OV_TRY(ov_store_grow(context, m->store, &m->normals, &m->normals_capacity, 3 * total,
                             sizeof *m->normals, "normals"));
cleanup:
    return status;
}

ovoid_status ov_marching_grow_triangles(ovoid_context *context, ov_marcher *m, size_t total) {
    return ov_store_grow(context, m->store, &m->triangle, &m->triangle_capacity, 3 * total,
                         sizeof *m->triangle, "triangles");
}

void ov_marching_put(ov_marcher *m, size_t at, double value) {
    if (m->origin)
        m->offsets[at] = (float)(value - m->origin[at % 3]);
    else
        m->xyz[at] = value;
}

/* Appends the piece's vertices to the mesh. */
static ovoid_status take_vertices(ovoid_context *context, ov_marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const size_t values = packs * OV_PACK, total = m->vertices + m->new_vertices;
    OV_TRY(ov_grow(context, &m->refined, &m->refined_capacity, 4 * values, sizeof *m->refined,
                   "vertices"));
    OV_TRY(ov_marching_grow_vertices(context, m, total));
    float *const t = m->refined, *const normal = t + values;
    OV_TRY(ov_grow(context, &m->edges, &m->edges_capacity, values, sizeof *m->edges, "vertices"));
    OV_TRY(ov_buffer_read(context, &m->edge, 0, m->edges, m->new_vertices * sizeof *m->edges));
    OV_TRY(ov_buffer_read(context, &m->t, 0, t, values * sizeof *t));
    OV_TRY(ov_buffer_read(context, &m->normal, 0, normal, 3 * values * sizeof *normal));
    for (size_t k = 0; k < m->new_vertices; ++k) {
        const size_t to = 3 * (m->vertices + k);
        const float *const n = normal + k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        cl_uint at[3];
        const cl_uint along = read_edge(m->edges[k], at);
        m->edge_of[m->vertices + k] = (uint8_t)along;
        for (cl_uint axis = 0; axis < 3; ++axis) {
            const int64_t index =
                m->pieces.origin[axis] + (int64_t)(m->at[axis] * m->pieces.size[axis] + at[axis]);
            const double within = axis == along ? (double)t[k] : 0.0;
            ov_marching_put(m, to + axis, ((double)index + within) * m->pieces.spacing);
            m->normals[to + axis] = n[axis * OV_PACK];
        }
    }
cleanup:
    return status;
}

/* Where the piece's part of the light mesh begins on the device: behind the pieces before, as long
 * as there is room for all, else at the beginning. */
static ovoid_status reserve_light(ovoid_context *context, ov_marcher *m, cl_uint *vertices,
                                  cl_uint *triangles) {
    ovoid_status status = OVOID_OK;
    const size_t offset = 3 * sizeof(cl_float), corner = 3 * sizeof(cl_uint);
    const size_t more = m->vertices + m->new_vertices, most = m->triangles + m->new_triangles;
    if (m->vertices > 0 && (more > m->placed_vertices || most > m->corners_triangles))
        m->resident = false;
    *vertices = m->resident ? (cl_uint)m->vertices : 0;
    *triangles = m->resident ? (cl_uint)m->triangles : 0;
    const size_t room = *vertices + m->new_vertices, expected = m->placed_vertices;
    OV_TRY(ov_buffer_reserve(context, &m->placed, (room > expected ? room : expected) * offset,
                             "vertices"));
    if (!m->bare)
        OV_TRY(ov_buffer_reserve(context, &m->placed_normals,
                                 (room > expected ? room : expected) * offset, "normals"));
    const size_t corners = *triangles + m->new_triangles;
    OV_TRY(ov_buffer_reserve(
        context, &m->corners,
        (corners > m->corners_triangles ? corners : m->corners_triangles) * corner, "triangles"));
cleanup:
    return status;
}

/* The corner of the piece from the origin, as floats and what these leave. */
static void split_corner(const ov_marcher *m, cl_float4 *corner, cl_float4 *rest) {
    *corner = *rest = (cl_float4){{0.0f, 0.0f, 0.0f, 0.0f}};
    for (size_t k = 0; k < 3; ++k) {
        const double exact = m->corner[k] - m->origin[k];
        corner->s[k] = ov_to_float(exact);
        rest->s[k] = (float)(exact - (double)corner->s[k]);
    }
}

static ovoid_status place_vertices(ovoid_context *context, ov_marcher *m, size_t packs,
                                   cl_uint before) {
    const cl_uint count = (cl_uint)m->new_vertices;
    const cl_float spacing = (cl_float)m->pieces.spacing;
    const cl_mem normal = m->bare ? NULL : m->normal.memory,
                 normals = m->bare ? NULL : m->placed_normals.memory; /* null in the kernel, too */
    cl_float4 corner, rest;
    split_corner(m, &corner, &rest);
    return OV_LAUNCH(context, &m->kernel[OV_MARCH_PLACE], packs, m->group, OV_ARG(count),
                     OV_ARG(before), OV_ARG(spacing), OV_ARG(corner), OV_ARG(rest),
                     OV_ARG(m->edge.memory), OV_ARG(m->t.memory), OV_ARG(normal),
                     OV_ARG(m->placed.memory), OV_ARG(normals));
}

static ovoid_status fill_triangles(ovoid_context *context, ov_marcher *m, cl_uint before) {
    const cl_uint nx = (cl_uint)m->grid.bricks[0], ny = (cl_uint)m->grid.bricks[1];
    const cl_uint4 last = ov_marching_last(m);
    return OV_LAUNCH(context, &m->kernel[OV_MARCH_TRIANGLES], m->active, m->group,
                     OV_ARG(m->active), OV_ARG(before), OV_ARG(m->list.memory), OV_ARG(nx),
                     OV_ARG(ny), OV_ARG(last), OV_ARG(m->sign.memory), OV_ARG(m->cases.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->corners.memory));
}

/* Appends what the device has of the piece's part of a light mesh, in one round trip. */
static ovoid_status take_light(ovoid_context *context, ov_marcher *m, cl_uint vertices,
                               cl_uint triangles) {
    ovoid_status status = OVOID_OK;
    const size_t each = 3 * sizeof(cl_float), bytes = m->new_vertices * each;
    ov_later offsets = {0}, normals = {0};
    OV_TRY(ov_marching_grow_vertices(context, m, m->vertices + m->new_vertices));
    OV_TRY(ov_buffer_read_later(context, &m->placed, vertices * each, m->offsets + 3 * m->vertices,
                                bytes, &offsets));
    if (!m->bare)
        OV_TRY(ov_buffer_read_later(context, &m->placed_normals, vertices * each,
                                    m->normals + 3 * m->vertices, bytes, &normals));
    OV_TRY(ov_buffer_read(context, &m->corners, triangles * each, m->triangle + 3 * m->triangles,
                          m->new_triangles * each));
cleanup:;
    const ovoid_status one = ov_later_end(context, &offsets),
                       other = ov_later_end(context, &normals);
    return status != OVOID_OK ? status : one != OVOID_OK ? one : other;
}

static ovoid_status take_corners(ovoid_context *context, ov_marcher *m) {
    return ov_buffer_read(context, &m->corners, 0, m->triangle + 3 * m->triangles,
                          3 * m->new_triangles * sizeof *m->triangle);
}

/* The current piece's part of the mesh. */
ovoid_status ov_marching_take(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    const size_t packs = (m->new_vertices + OV_PACK - 1) / OV_PACK;
    cl_uint vertices = 0, triangles = 0;
    bool whole = true;
    if (m->active == 0)
        return OVOID_OK;
    OV_TRY(ov_marching_grow_triangles(context, m, m->triangles + m->new_triangles));
    if (m->origin)
        OV_TRY(reserve_light(context, m, &vertices, &triangles));
    else
        OV_TRY(ov_buffer_reserve(context, &m->corners, 3 * m->new_triangles * sizeof(cl_uint),
                                 "triangles"));
    if (m->new_vertices > 0)
        OV_TRY(make_vertices(context, m, packs, true, &whole));
    if (!whole) /* there were more pairs than ever before */
        OV_TRY(make_vertices(context, m, packs, false, &whole));
    OV_TRY(fill_triangles(context, m, triangles));
    if (m->origin)
        OV_TRY(place_vertices(context, m, packs, vertices));
    else if (m->new_vertices > 0)
        OV_TRY(take_vertices(context, m, packs));
    OV_TRY(m->origin ? take_light(context, m, vertices, triangles) : take_corners(context, m));
    m->vertices += m->new_vertices;
    m->triangles += m->new_triangles;
    ov_store_rest(m->store);
cleanup:
    return status;
}
