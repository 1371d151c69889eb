/* A piece of the lattice: the field at its points, and what it shares with its neighbours. */
#include "mesh/marching.h"

#include "mesh/case_table.h"

#include <stdlib.h>
#include <string.h>

#define BRICK_RUN 32 /* bricks per work-item of the kernels over all bricks, on CPUs */

static const uint64_t brick_points[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

/* ---- setting up --------------------------------------------------------------------------- */

static ovoid_status make_kernels(ovoid_context *context, ov_marcher *m) {
    static const char *const names[OV_MARCH_KERNELS] = {
        "march_signs",    "march_count", "march_number",    "march_get",    "march_put",
        "march_vertices", "march_boxes", "march_triangles", "march_refine", "march_place",
    };
    ovoid_status status = OVOID_OK;
    for (size_t k = 0; k < OV_MARCH_KERNELS && status == OVOID_OK; ++k)
        if (!m->kernel[k].handle)
            status = ov_kernel_create(context, "march", names[k], &m->kernel[k]);
    return status;
}

/* Where the bricks are in the padded grid, by place. */
static ovoid_status put_brick_numbers(ovoid_context *context, ov_marcher *m) {
    const ov_brick_grid *const grid = &m->grid;
    cl_uint *const number = ov_alloc(context, grid->padded_total, sizeof *number, "lattice bricks");
    if (!number)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < grid->padded_total; ++k)
        number[grid->place[k]] = (cl_uint)k;
    const ovoid_status status = ov_buffer_put(
        context, &m->brick_of, number, grid->padded_total * sizeof *number, "lattice bricks");
    free(number);
    return status;
}

static ovoid_status reserve_piece(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const size_t padded = grid->padded_total, faces = grid->face_start[3];
    const size_t moved = faces > grid->ghosts ? faces : grid->ghosts;
    OV_TRY(ov_buffer_put(context, &m->face_list, grid->face, faces * sizeof(cl_uint),
                         "lattice bricks"));
    OV_TRY(ov_buffer_put(context, &m->ghost_list, grid->ghost, grid->ghosts * sizeof(cl_uint),
                         "lattice bricks"));
    OV_TRY(
        ov_buffer_put(context, &m->place, grid->place, padded * sizeof(cl_uint), "lattice bricks"));
    OV_TRY(put_brick_numbers(context, m));
    OV_TRY(
        ov_buffer_reserve(context, &m->value, padded * OV_PACK * sizeof(float), "lattice values"));
    OV_TRY(ov_buffer_reserve(context, &m->sign, padded * sizeof(cl_uint), "signs of bricks"));
    OV_TRY(ov_buffer_reserve(context, &m->crossing, padded * OV_CROSSING * sizeof(cl_uint),
                             "crossings of bricks"));
    OV_TRY(
        ov_buffer_reserve(context, &m->found, grid->total * sizeof(cl_uint), "vertices of bricks"));
    OV_TRY(
        ov_buffer_reserve(context, &m->values, moved * OV_PACK * sizeof(float), "values at faces"));
    OV_TRY(ov_buffer_reserve(context, &m->crossings, moved * OV_CROSSING * sizeof(cl_uint),
                             "crossings at faces"));
    OV_TRY(ov_buffer_reserve(context, &m->list, grid->total * 4 * sizeof(cl_uint),
                             "bricks at the surface"));
    OV_TRY(ov_buffer_reserve(context, &m->totals, 3 * sizeof(cl_uint), "vertices of bricks"));
    m->ghost_value = ov_alloc(context, moved * OV_PACK, sizeof(float), "values at faces");
    m->ghost_crossing =
        ov_alloc(context, moved * OV_CROSSING, sizeof(cl_uint), "crossings at faces");
    if (!m->ghost_value || !m->ghost_crossing)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

static bool has_grid(const ov_marcher *m) {
    for (size_t axis = 0; axis < 3; ++axis)
        if (m->grid.bricks[axis] * brick_points[axis] != m->pieces.size[axis])
            return false;
    return m->grid_spacing == m->pieces.spacing;
}

void ov_marching_drop_grid(ov_marcher *m) {
    free(m->ghost_value);
    free(m->ghost_crossing);
    m->ghost_crossing = NULL;
    m->ghost_value = NULL;
    ov_brick_grid_destroy(&m->grid);
    ov_points_destroy(&m->points);
    m->grid_spacing = 0.0;
    m->ghosts_empty = false;
}

/* A grid of bricks for pieces of this size, unless the last mesh's is one. */
static ovoid_status lay_grid(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    const double step[3] = {m->pieces.spacing, m->pieces.spacing, m->pieces.spacing};
    if (has_grid(m))
        return OVOID_OK;
    ov_marching_drop_grid(m);
    OV_TRY(ov_brick_grid_create(context, m->pieces.size, &m->grid));
    OV_TRY(ov_bricks_upload(context, m->grid.bricks, m->grid.curve, step, true, &m->points));
    OV_TRY(reserve_piece(context, m));
    m->grid_spacing = m->pieces.spacing;
cleanup:
    return status;
}

ovoid_status ov_marching_set_up(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    ov_case_table cases;
    ov_case_table_make(&cases);
    OV_TRY(ov_device_get(context, &device));
    m->group = ov_item_group(device);
    m->run = device->shape.lanes == 1 ? BRICK_RUN : 1;
    OV_TRY(make_kernels(context, m));
    OV_TRY(ov_buffer_put(context, &m->cases, &cases, sizeof cases, "cases of marching cubes"));
    OV_TRY(lay_grid(context, m));
    m->faces = ov_alloc(context, m->pieces.pieces, sizeof *m->faces, "pieces of the lattice");
    m->faces_end = m->pieces.pieces;
    if (!m->faces)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

/* ---- faces between pieces ----------------------------------------------------------------- */

/* The piece at this offset from the current one, or pieces->pieces. */
static size_t neighbour(const ov_marcher *m, int x, int y, int z) {
    const int offset[3] = {x, y, z};
    const uint64_t *const count = m->pieces.count;
    uint64_t at[3];
    for (int axis = 0; axis < 3; ++axis) {
        at[axis] = m->at[axis] + (uint64_t)offset[axis]; /* below 0 wraps far above count */
        if (at[axis] >= count[axis])
            return m->pieces.pieces;
    }
    return ov_pieces_find(&m->pieces, (at[2] * count[1] + at[1]) * count[0] + at[0]);
}

/* Copies `count` bricks, `stride` apart, of a neighbour's faces to the ghosts; zeros without one.
 */
static size_t copy_ghosts(ov_marcher *m, size_t ghost, size_t piece, size_t face, size_t stride,
                          size_t count, bool *any) {
    const ov_piece_faces *const from = piece < m->pieces.pieces ? &m->faces[piece] : NULL;
    for (size_t k = 0; k < count; ++k, ++ghost, face += stride) {
        float *const value = m->ghost_value + ghost * OV_PACK;
        cl_uint *const crossing = m->ghost_crossing + ghost * OV_CROSSING;
        if (from && from->value) {
            memcpy(value, from->value + face * OV_PACK, OV_PACK * sizeof *value);
            memcpy(crossing, from->crossing + face * OV_CROSSING, OV_CROSSING * sizeof *crossing);
            *any = true;
        } else {
            memset(value, 0, OV_PACK * sizeof *value);
            memset(crossing, 0, OV_CROSSING * sizeof *crossing);
        }
    }
    return ghost;
}

/* What the neighbours found at the points after the piece's last ones. Without neighbours that is
 * 0, which evaluation has left there. */
static ovoid_status fill_ghosts(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const size_t *const start = grid->face_start, nx = grid->bricks[0], ny = grid->bricks[1],
                        nz = grid->bricks[2];
    const cl_uint count = (cl_uint)grid->ghosts;
    bool any = false;
    size_t k = copy_ghosts(m, 0, neighbour(m, 1, 0, 0), start[0], 1, ny * nz, &any);
    k = copy_ghosts(m, k, neighbour(m, 0, 1, 0), start[1], 1, nx * nz, &any);
    k = copy_ghosts(m, k, neighbour(m, 0, 0, 1), start[2], 1, nx * ny, &any);
    k = copy_ghosts(m, k, neighbour(m, 1, 1, 0), start[0], ny, nz, &any);
    k = copy_ghosts(m, k, neighbour(m, 1, 0, 1), start[0], 1, ny, &any);
    k = copy_ghosts(m, k, neighbour(m, 0, 1, 1), start[1], 1, nx, &any);
    copy_ghosts(m, k, neighbour(m, 1, 1, 1), start[0], 1, 1, &any);
    if (!any && m->ghosts_empty)
        return OVOID_OK;
    m->ghosts_empty = !any;
    OV_TRY(ov_buffer_write(context, &m->values, 0, m->ghost_value,
                           grid->ghosts * OV_PACK * sizeof *m->ghost_value));
    OV_TRY(ov_buffer_write(context, &m->crossings, 0, m->ghost_crossing,
                           grid->ghosts * OV_CROSSING * sizeof *m->ghost_crossing));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_PUT], grid->ghosts, m->group, OV_ARG(count),
                     OV_ARG(m->ghost_list.memory), OV_ARG(m->place.memory),
                     OV_ARG(m->values.memory), OV_ARG(m->crossings.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory)));
cleanup:
    return status;
}

static bool has_lower_neighbour(const ov_marcher *m) {
    for (int k = 1; k < 8; ++k)
        if (neighbour(m, -(k & 1), -(k >> 1 & 1), -(k >> 2)) < m->pieces.pieces)
            return true;
    return false;
}

/* Keeps the piece's faces for the neighbours below, which come later. */
ovoid_status ov_marching_keep_faces(ovoid_context *context, ov_marcher *m, size_t piece) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const size_t faces = grid->face_start[3];
    const cl_uint count = (cl_uint)faces;
    ov_piece_faces *const kept = &m->faces[piece];
    if (!has_lower_neighbour(m))
        return OVOID_OK;
    kept->value = ov_alloc(context, faces * OV_PACK, sizeof *kept->value, "values at faces");
    kept->crossing =
        ov_alloc(context, faces * OV_CROSSING, sizeof *kept->crossing, "crossings at faces");
    if (!kept->value || !kept->crossing)
        return OVOID_ERROR_MEMORY;
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_GET], faces, m->group, OV_ARG(count),
                     OV_ARG(m->face_list.memory), OV_ARG(m->place.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->values.memory),
                     OV_ARG(m->crossings.memory)));
    OV_TRY(
        ov_buffer_read(context, &m->values, 0, kept->value, faces * OV_PACK * sizeof *kept->value));
    OV_TRY(ov_buffer_read(context, &m->crossings, 0, kept->crossing,
                          faces * OV_CROSSING * sizeof *kept->crossing));
cleanup:
    return status;
}

void ov_marching_drop_faces(ov_piece_faces *faces) {
    free(faces->value);
    free(faces->crossing);
    *faces = (ov_piece_faces){0};
}

/* Drops the faces that no piece up to this one can need. */
void ov_marching_drop_old_faces(ov_marcher *m, size_t piece) {
    const uint64_t *const count = m->pieces.count;
    const uint64_t furthest = (count[1] + 1) * count[0] + 1;
    while (m->faces_end > 0 && m->pieces.key[m->faces_end - 1] > m->pieces.key[piece] + furthest)
        ov_marching_drop_faces(&m->faces[--m->faces_end]);
}

/* ---- one piece ---------------------------------------------------------------------------- */

/* Where the piece is, and its terms. */
static ovoid_status set_terms(ovoid_context *context, ov_marcher *m, size_t piece) {
    ovoid_status status = OVOID_OK;
    const size_t first = m->pieces.start[piece], count = m->pieces.start[piece + 1] - first;
    uint64_t key = m->pieces.key[piece];
    for (int axis = 0; axis < 3; ++axis) {
        m->at[axis] = key % m->pieces.count[axis];
        key /= m->pieces.count[axis];
        const int64_t index =
            m->pieces.origin[axis] + (int64_t)(m->at[axis] * m->pieces.size[axis]);
        m->corner[axis] = (double)index * m->pieces.spacing;
    }
    OV_TRY(ov_grow(context, &m->quadrics, &m->quadrics_capacity, count, sizeof *m->quadrics,
                   "terms of a lattice piece"));
    for (size_t k = 0; k < count; ++k)
        m->quadrics[k] = m->bodies[m->pieces.term[first + k]].quadric;
    OV_TRY(ov_terms_set(context, &m->terms, m->quadrics, count, m->corner, m->cutoff));
cleanup:
    return status;
}

/* Begins to make lists in the memory of the last ones if there were any, and says so; else makes
 * them. */
ovoid_status ov_marching_begin_lists(ovoid_context *context, ov_marcher *m, ov_lists *lists,
                                     const ov_points *points, bool *begun) {
    *begun = *begun && ov_lists_built(lists);
    lists->packs_only = true;
    return *begun ? ov_lists_begin(context, lists, points, &m->terms, 0.0)
                  : ov_lists_build(context, lists, points, &m->terms, 0.0);
}

/* Beyond all points of a piece. */
#define ENDLESS 65536

cl_uint4 ov_marching_last(const ov_marcher *m) {
    cl_uint4 last = {{ENDLESS, ENDLESS, ENDLESS, 0}};
    for (int axis = 0; m->clipped && axis < 3; ++axis) {
        const int64_t first =
                          m->pieces.origin[axis] + (int64_t)(m->at[axis] * m->pieces.size[axis]),
                      left = m->pieces.last[axis] - first;
        last.s[axis] = left < 0 ? 0 : left < ENDLESS ? (cl_uint)left : ENDLESS;
    }
    return last;
}

/* Signs, crossed edges, numbers of vertices and triangles along the curve. */
static ovoid_status classify(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const cl_uint padded = (cl_uint)grid->padded_total, total = (cl_uint)grid->total,
                  nx = (cl_uint)grid->bricks[0], ny = (cl_uint)grid->bricks[1],
                  nz = (cl_uint)grid->bricks[2], before = (cl_uint)m->vertices;
    const cl_uint4 last = ov_marching_last(m);
    const cl_float isovalue = (cl_float)m->options->isovalue;
    const size_t scan = m->run > 1 ? 1 : OV_SCAN_GROUP;
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_SIGNS], (padded + m->run - 1) / m->run, m->group,
                     OV_ARG(padded), OV_ARG(m->run), OV_ARG(isovalue), OV_ARG(m->brick_of.memory),
                     OV_ARG(m->value.memory), OV_ARG(m->sign.memory)));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_COUNT], (total + m->run - 1) / m->run, m->group,
                     OV_ARG(nx), OV_ARG(ny), OV_ARG(nz), OV_ARG(m->run), OV_ARG(last),
                     OV_ARG(m->place.memory), OV_ARG(m->sign.memory), OV_ARG(m->cases.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->found.memory)));
    OV_TRY(OV_LAUNCH(context, &m->kernel[OV_MARCH_NUMBER], scan, scan, OV_ARG(total),
                     OV_ARG(before), OV_ARG(m->brick_of.memory), OV_ARG(m->found.memory),
                     OV_ARG(m->list.memory), OV_ARG(m->totals.memory)));
cleanup:
    return status;
}

/* phi at the lattice points, and what is found between them. */
static ovoid_status look(ovoid_context *context, ov_marcher *m, bool begin, bool *whole) {
    ovoid_status status = OVOID_OK;
    bool begun = begin;
    cl_uint totals[3];
    OV_TRY(ov_marching_begin_lists(context, m, &m->lists, &m->points, &begun));
    OV_TRY(ov_field(context, &m->operations, &m->points, &m->terms, &m->lists, &m->value));
    OV_TRY(fill_ghosts(context, m));
    OV_TRY(classify(context, m));
    OV_TRY(ov_buffer_read(context, &m->totals, 0, totals, sizeof totals));
    m->active = totals[0];
    m->new_vertices = totals[1];
    m->new_triangles = totals[2];
cleanup:
    *whole = true;
    if (begun && status == OVOID_OK)
        status = ov_lists_end(context, &m->lists, whole);
    else if (begun)
        ov_later_end(context, &m->lists.later);
    return status;
}

ovoid_status ov_marching_evaluate(ovoid_context *context, ov_marcher *m, size_t piece) {
    ovoid_status status = OVOID_OK;
    bool whole;
    OV_TRY(set_terms(context, m, piece));
    OV_TRY(look(context, m, true, &whole));
    if (!whole) /* there were more pairs than ever before */
        OV_TRY(look(context, m, false, &whole));
    if (m->vertices + m->new_vertices > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "the mesh has more than 2^32 vertices; use a larger spacing");
cleanup:
    return status;
}
