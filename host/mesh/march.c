#include "mesh/march.h"

#include "field/bricks.h"
#include "mesh/brick_grid.h"
#include "mesh/case_table.h"
#include "mesh/exposed.h"
#include "mesh/mesh.h"
#include "mesh/specks.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Newton's steps of a vertex at most: a few, or enough to halve a bracket down to rounding. */
#define REFINE_STEPS 24
#define REFINE_CLOSE 1e-4 /* lattice steps; what is left after such a step is of order 1e-8 */

#define BOX 6        /* low x, y, z, high x, y, z */
#define CROSSING 4   /* values per brick: number of the first vertex, masks along x, y, z */
#define BRICK_RUN 32 /* bricks per work-item of the kernels over all bricks, on CPUs */

enum { SIGNS, COUNT, NUMBER, GET, PUT, VERTICES, BOXES, TRIANGLES, REFINE, PLACE, KERNELS };

/* What a piece leaves behind for those before it: its faces. */
typedef struct piece_faces {
    float *value;      /* OV_PACK per face brick */
    cl_uint *crossing; /* CROSSING per face brick */
} piece_faces;

/* What is of one mesh comes first, up to the grid; what follows may serve the next. */
typedef struct ov_marcher {
    ov_store *store; /* of the mesh so far; the caller's */
    const ov_body *bodies;
    const ovoid_mesh_options *options;
    const double *origin; /* of the offsets of a light mesh, else NULL */
    bool bare;            /* a light mesh without normals is wanted */
    double cutoff;        /* terms count where they are at least this */
    bool resident;        /* the light mesh so far is on the device, too */
    const ov_watch *watch;
    ov_pieces pieces;
    piece_faces *faces; /* of each piece; empty where not needed, or no longer */
    size_t faces_end;   /* those from here on are gone */
    uint64_t at[3];     /* the current piece */
    double corner[3];
    float largest; /* value met while there was no vertex */

    double *xyz;    /* the mesh so far, */
    float *offsets; /* with these in place of xyz if it is light */
    float *normals;
    uint32_t *triangle;
    uint8_t *edge_of; /* of the mesh's vertices, unless it is light */
    size_t edge_of_capacity, missed;
    size_t xyz_capacity, offsets_capacity, normals_capacity, triangle_capacity;
    size_t vertices, triangles;
    size_t new_vertices, new_triangles; /* of the piece */

    ov_brick_grid grid;
    double clip[2][3];   /* the box that they end at, angstrom, */
    bool clipped;        /* if there is one, */
    ov_box ends;         /* and where the lattice did */
    double share;        /* of the isovalue, from which on terms count; 0: OV_MARCH_CUTOFF */
    uint64_t wanted[3];  /* points of pieces, so that the grid stays; 0: nothing is wanted */
    double grid_spacing; /* angstrom */
    bool ghosts_empty;   /* on the device */
    ov_points points;
    ov_points vertex_points; /* packs of the piece's vertices: their boxes alone */
    ov_terms terms;
    ov_lists lists, vertex_lists; /* of bricks, and of packs of vertices */
    ov_operations operations;
    ov_kernel kernel[KERNELS];
    ov_buffer value, sign, crossing, found, box, cases, list, totals, edge, t, normal, corners;
    ov_buffer face_list, ghost_list, place, brick_of, values, crossings;
    ov_buffer placed, placed_normals;          /* vertices of the light mesh, or of the piece */
    size_t placed_vertices, corners_triangles; /* of the last mesh: what the next may have */
    size_t group;
    cl_uint run;

    ov_quadric *quadrics; /* of one piece */
    size_t quadrics_capacity;
    float *ghost_value;
    cl_uint *ghost_crossing;
    cl_uint active; /* entries of march_vertices()'s list */
    cl_uint *edges; /* of the piece's vertices, in packs */
    size_t edges_capacity;
    float *refined;
    size_t refined_capacity;
} marcher;

static const uint64_t brick_points[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

/* ---- setting up --------------------------------------------------------------------------- */

static ovoid_status make_kernels(ovoid_context *context, marcher *m) {
    static const char *const names[KERNELS] = {
        "march_signs",    "march_count", "march_number",    "march_get",    "march_put",
        "march_vertices", "march_boxes", "march_triangles", "march_refine", "march_place",
    };
    ovoid_status status = OVOID_OK;
    for (size_t k = 0; k < KERNELS && status == OVOID_OK; ++k)
        if (!m->kernel[k].handle)
            status = ov_kernel_create(context, "march", names[k], &m->kernel[k]);
    return status;
}

/* Where the bricks are in the padded grid, by place. */
static ovoid_status put_brick_numbers(ovoid_context *context, marcher *m) {
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

static ovoid_status reserve_piece(ovoid_context *context, marcher *m) {
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
    OV_TRY(ov_buffer_reserve(context, &m->crossing, padded * CROSSING * sizeof(cl_uint),
                             "crossings of bricks"));
    OV_TRY(
        ov_buffer_reserve(context, &m->found, grid->total * sizeof(cl_uint), "vertices of bricks"));
    OV_TRY(
        ov_buffer_reserve(context, &m->values, moved * OV_PACK * sizeof(float), "values at faces"));
    OV_TRY(ov_buffer_reserve(context, &m->crossings, moved * CROSSING * sizeof(cl_uint),
                             "crossings at faces"));
    OV_TRY(ov_buffer_reserve(context, &m->list, grid->total * 4 * sizeof(cl_uint),
                             "bricks at the surface"));
    OV_TRY(ov_buffer_reserve(context, &m->totals, 3 * sizeof(cl_uint), "vertices of bricks"));
    m->ghost_value = ov_alloc(context, moved * OV_PACK, sizeof(float), "values at faces");
    m->ghost_crossing = ov_alloc(context, moved * CROSSING, sizeof(cl_uint), "crossings at faces");
    if (!m->ghost_value || !m->ghost_crossing)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

static bool has_grid(const marcher *m) {
    for (size_t axis = 0; axis < 3; ++axis)
        if (m->grid.bricks[axis] * brick_points[axis] != m->pieces.size[axis])
            return false;
    return m->grid_spacing == m->pieces.spacing;
}

static void drop_grid(marcher *m) {
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
static ovoid_status lay_grid(ovoid_context *context, marcher *m) {
    ovoid_status status = OVOID_OK;
    const double step[3] = {m->pieces.spacing, m->pieces.spacing, m->pieces.spacing};
    if (has_grid(m))
        return OVOID_OK;
    drop_grid(m);
    OV_TRY(ov_brick_grid_create(context, m->pieces.size, &m->grid));
    OV_TRY(ov_bricks_upload(context, m->grid.bricks, m->grid.curve, step, true, &m->points));
    OV_TRY(reserve_piece(context, m));
    m->grid_spacing = m->pieces.spacing;
cleanup:
    return status;
}

static ovoid_status set_up(ovoid_context *context, marcher *m) {
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
static size_t neighbour(const marcher *m, int x, int y, int z) {
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
static size_t copy_ghosts(marcher *m, size_t ghost, size_t piece, size_t face, size_t stride,
                          size_t count, bool *any) {
    const piece_faces *const from = piece < m->pieces.pieces ? &m->faces[piece] : NULL;
    for (size_t k = 0; k < count; ++k, ++ghost, face += stride) {
        float *const value = m->ghost_value + ghost * OV_PACK;
        cl_uint *const crossing = m->ghost_crossing + ghost * CROSSING;
        if (from && from->value) {
            memcpy(value, from->value + face * OV_PACK, OV_PACK * sizeof *value);
            memcpy(crossing, from->crossing + face * CROSSING, CROSSING * sizeof *crossing);
            *any = true;
        } else {
            memset(value, 0, OV_PACK * sizeof *value);
            memset(crossing, 0, CROSSING * sizeof *crossing);
        }
    }
    return ghost;
}

/* What the neighbours found at the points after the piece's last ones. Without neighbours that is
 * 0, which evaluation has left there. */
static ovoid_status fill_ghosts(ovoid_context *context, marcher *m) {
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
                           grid->ghosts * CROSSING * sizeof *m->ghost_crossing));
    OV_TRY(OV_LAUNCH(context, &m->kernel[PUT], grid->ghosts, m->group, OV_ARG(count),
                     OV_ARG(m->ghost_list.memory), OV_ARG(m->place.memory),
                     OV_ARG(m->values.memory), OV_ARG(m->crossings.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory)));
cleanup:
    return status;
}

static bool has_lower_neighbour(const marcher *m) {
    for (int k = 1; k < 8; ++k)
        if (neighbour(m, -(k & 1), -(k >> 1 & 1), -(k >> 2)) < m->pieces.pieces)
            return true;
    return false;
}

/* Keeps the piece's faces for the neighbours below, which come later. */
static ovoid_status keep_faces(ovoid_context *context, marcher *m, size_t piece) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const size_t faces = grid->face_start[3];
    const cl_uint count = (cl_uint)faces;
    piece_faces *const kept = &m->faces[piece];
    if (!has_lower_neighbour(m))
        return OVOID_OK;
    kept->value = ov_alloc(context, faces * OV_PACK, sizeof *kept->value, "values at faces");
    kept->crossing =
        ov_alloc(context, faces * CROSSING, sizeof *kept->crossing, "crossings at faces");
    if (!kept->value || !kept->crossing)
        return OVOID_ERROR_MEMORY;
    OV_TRY(OV_LAUNCH(context, &m->kernel[GET], faces, m->group, OV_ARG(count),
                     OV_ARG(m->face_list.memory), OV_ARG(m->place.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->values.memory),
                     OV_ARG(m->crossings.memory)));
    OV_TRY(
        ov_buffer_read(context, &m->values, 0, kept->value, faces * OV_PACK * sizeof *kept->value));
    OV_TRY(ov_buffer_read(context, &m->crossings, 0, kept->crossing,
                          faces * CROSSING * sizeof *kept->crossing));
cleanup:
    return status;
}

static void drop_faces(piece_faces *faces) {
    free(faces->value);
    free(faces->crossing);
    *faces = (piece_faces){0};
}

/* Drops the faces that no piece up to this one can need. */
static void drop_old_faces(marcher *m, size_t piece) {
    const uint64_t *const count = m->pieces.count;
    const uint64_t furthest = (count[1] + 1) * count[0] + 1;
    while (m->faces_end > 0 && m->pieces.key[m->faces_end - 1] > m->pieces.key[piece] + furthest)
        drop_faces(&m->faces[--m->faces_end]);
}

/* ---- one piece ---------------------------------------------------------------------------- */

/* Where the piece is, and its terms. */
static ovoid_status set_terms(ovoid_context *context, marcher *m, size_t piece) {
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
static ovoid_status begin_lists(ovoid_context *context, marcher *m, ov_lists *lists,
                                const ov_points *points, bool *begun) {
    *begun = *begun && ov_lists_built(lists);
    lists->packs_only = true;
    return *begun ? ov_lists_begin(context, lists, points, &m->terms, 0.0)
                  : ov_lists_build(context, lists, points, &m->terms, 0.0);
}

/* Beyond all points of a piece. */
#define ENDLESS 65536

/* The last lattice point along each axis, from the piece's first one. */
static cl_uint4 last_points(const marcher *m) {
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
static ovoid_status classify(ovoid_context *context, marcher *m) {
    ovoid_status status = OVOID_OK;
    const ov_brick_grid *const grid = &m->grid;
    const cl_uint padded = (cl_uint)grid->padded_total, total = (cl_uint)grid->total,
                  nx = (cl_uint)grid->bricks[0], ny = (cl_uint)grid->bricks[1],
                  nz = (cl_uint)grid->bricks[2], before = (cl_uint)m->vertices;
    const cl_uint4 last = last_points(m);
    const cl_float isovalue = (cl_float)m->options->isovalue;
    const size_t scan = m->run > 1 ? 1 : OV_SCAN_GROUP;
    OV_TRY(OV_LAUNCH(context, &m->kernel[SIGNS], (padded + m->run - 1) / m->run, m->group,
                     OV_ARG(padded), OV_ARG(m->run), OV_ARG(isovalue), OV_ARG(m->brick_of.memory),
                     OV_ARG(m->value.memory), OV_ARG(m->sign.memory)));
    OV_TRY(OV_LAUNCH(context, &m->kernel[COUNT], (total + m->run - 1) / m->run, m->group,
                     OV_ARG(nx), OV_ARG(ny), OV_ARG(nz), OV_ARG(m->run), OV_ARG(last),
                     OV_ARG(m->place.memory), OV_ARG(m->sign.memory), OV_ARG(m->cases.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->found.memory)));
    OV_TRY(OV_LAUNCH(context, &m->kernel[NUMBER], scan, scan, OV_ARG(total), OV_ARG(before),
                     OV_ARG(m->brick_of.memory), OV_ARG(m->found.memory), OV_ARG(m->list.memory),
                     OV_ARG(m->totals.memory)));
cleanup:
    return status;
}

/* phi at the lattice points, and what is found between them. */
static ovoid_status look(ovoid_context *context, marcher *m, bool begin, bool *whole) {
    ovoid_status status = OVOID_OK;
    bool begun = begin;
    cl_uint totals[3];
    OV_TRY(begin_lists(context, m, &m->lists, &m->points, &begun));
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

static ovoid_status evaluate(ovoid_context *context, marcher *m, size_t piece) {
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

/* Lattice coordinates within the piece and axis of an edge (see march_vertices()). */
static cl_uint read_edge(cl_uint edge, cl_uint at[3]) {
    at[0] = edge & 255u;
    at[1] = edge >> 8 & 255u;
    at[2] = edge >> 16 & 255u;
    return edge >> 24 & 3u;
}

/* Edges, numbers and first positions of the piece's vertices. */
static ovoid_status fill_vertices(ovoid_context *context, marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const size_t room = packs * OV_PACK;
    const cl_uint nx = (cl_uint)m->grid.bricks[0], ny = (cl_uint)m->grid.bricks[1];
    const cl_float isovalue = (cl_float)m->options->isovalue;
    const cl_int logarithmic = m->options->vertices == OVOID_VERTEX_EXACT;
    OV_TRY(ov_buffer_reserve(context, &m->edge, room * sizeof(cl_uint), "edges of vertices"));
    OV_TRY(ov_buffer_reserve(context, &m->t, room * sizeof(cl_float), "vertices"));
    OV_TRY(OV_LAUNCH(context, &m->kernel[VERTICES], m->active, m->group, OV_ARG(m->active),
                     OV_ARG(m->list.memory), OV_ARG(nx), OV_ARG(ny), OV_ARG(isovalue),
                     OV_ARG(logarithmic), OV_ARG(m->place.memory), OV_ARG(m->value.memory),
                     OV_ARG(m->crossing.memory), OV_ARG(m->edge.memory), OV_ARG(m->t.memory)));
cleanup:
    return status;
}

/* The box of each pack of vertices, and the tree over them. */
static ovoid_status box_packs(ovoid_context *context, marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs_count = (cl_uint)packs, vertices = (cl_uint)m->new_vertices;
    const cl_float spacing = (cl_float)m->pieces.spacing;
    ov_points *const points = &m->vertex_points;
    points->count = packs * OV_PACK;
    points->packs = packs;
    OV_TRY(
        ov_buffer_reserve(context, &m->box, packs * BOX * sizeof(cl_float), "boxes of vertices"));
    OV_TRY(OV_LAUNCH(context, &m->kernel[BOXES], packs, m->group, OV_ARG(packs_count),
                     OV_ARG(vertices), OV_ARG(spacing), OV_ARG(m->edge.memory), OV_ARG(m->t.memory),
                     OV_ARG(m->box.memory)));
    OV_TRY(ov_tree_grow(context, &m->box, packs, &points->tree, &points->boxes));
cleanup:
    return status;
}

static ovoid_status refine(ovoid_context *context, marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    const cl_uint packs_count = (cl_uint)packs;
    const cl_uint steps = m->options->vertices == OVOID_VERTEX_EXACT ? REFINE_STEPS : 0;
    const cl_float spacing = (cl_float)m->pieces.spacing, isovalue = (cl_float)m->options->isovalue,
                   close = (cl_float)REFINE_CLOSE;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(
        ov_buffer_reserve(context, &m->normal, packs * 3 * OV_PACK * sizeof(cl_float), "normals"));
    OV_TRY(OV_LAUNCH(
        context, &m->kernel[REFINE], packs * device->shape.lanes, m->group, OV_ARG(packs_count),
        OV_ARG(spacing), OV_ARG(isovalue), OV_ARG(steps), OV_ARG(close), OV_ARG(m->edge.memory),
        OV_ARG(m->vertex_lists.pack_start.memory), OV_ARG(m->vertex_lists.pack_item.memory),
        OV_ARG(m->terms.device.memory), OV_ARG(m->t.memory), OV_ARG(m->normal.memory)));
cleanup:
    return status;
}

/* Puts the vertices on the surface. */
static ovoid_status make_vertices(ovoid_context *context, marcher *m, size_t packs, bool begin,
                                  bool *whole) {
    ovoid_status status = OVOID_OK;
    bool begun = begin;
    OV_TRY(fill_vertices(context, m, packs));
    OV_TRY(box_packs(context, m, packs));
    status = begin_lists(context, m, &m->vertex_lists, &m->vertex_points, &begun);
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

static ovoid_status grow_vertices(ovoid_context *context, marcher *m, size_t total) {
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

static ovoid_status grow_triangles(ovoid_context *context, marcher *m, size_t total) {
    return ov_store_grow(context, m->store, &m->triangle, &m->triangle_capacity, 3 * total,
                         sizeof *m->triangle, "triangles");
}

static void put_coordinate(marcher *m, size_t at, double value) {
    if (m->origin)
        m->offsets[at] = (float)(value - m->origin[at % 3]);
    else
        m->xyz[at] = value;
}

/* Appends the piece's vertices to the mesh. */
static ovoid_status take_vertices(ovoid_context *context, marcher *m, size_t packs) {
    ovoid_status status = OVOID_OK;
    const size_t values = packs * OV_PACK, total = m->vertices + m->new_vertices;
    OV_TRY(ov_grow(context, &m->refined, &m->refined_capacity, 4 * values, sizeof *m->refined,
                   "vertices"));
    OV_TRY(grow_vertices(context, m, total));
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
            put_coordinate(m, to + axis, ((double)index + within) * m->pieces.spacing);
            m->normals[to + axis] = n[axis * OV_PACK];
        }
    }
cleanup:
    return status;
}

/* Where the piece's part of the light mesh begins on the device: behind the pieces before, as long
 * as there is room for all, else at the beginning. */
static ovoid_status reserve_light(ovoid_context *context, marcher *m, cl_uint *vertices,
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
static void split_corner(const marcher *m, cl_float4 *corner, cl_float4 *rest) {
    *corner = *rest = (cl_float4){{0.0f, 0.0f, 0.0f, 0.0f}};
    for (size_t k = 0; k < 3; ++k) {
        const double exact = m->corner[k] - m->origin[k];
        corner->s[k] = ov_to_float(exact);
        rest->s[k] = (float)(exact - (double)corner->s[k]);
    }
}

static ovoid_status place_vertices(ovoid_context *context, marcher *m, size_t packs,
                                   cl_uint before) {
    const cl_uint count = (cl_uint)m->new_vertices;
    const cl_float spacing = (cl_float)m->pieces.spacing;
    const cl_mem normal = m->bare ? NULL : m->normal.memory,
                 normals = m->bare ? NULL : m->placed_normals.memory; /* null in the kernel, too */
    cl_float4 corner, rest;
    split_corner(m, &corner, &rest);
    return OV_LAUNCH(context, &m->kernel[PLACE], packs, m->group, OV_ARG(count), OV_ARG(before),
                     OV_ARG(spacing), OV_ARG(corner), OV_ARG(rest), OV_ARG(m->edge.memory),
                     OV_ARG(m->t.memory), OV_ARG(normal), OV_ARG(m->placed.memory),
                     OV_ARG(normals));
}

static ovoid_status fill_triangles(ovoid_context *context, marcher *m, cl_uint before) {
    const cl_uint nx = (cl_uint)m->grid.bricks[0], ny = (cl_uint)m->grid.bricks[1];
    const cl_uint4 last = last_points(m);
    return OV_LAUNCH(context, &m->kernel[TRIANGLES], m->active, m->group, OV_ARG(m->active),
                     OV_ARG(before), OV_ARG(m->list.memory), OV_ARG(nx), OV_ARG(ny), OV_ARG(last),
                     OV_ARG(m->sign.memory), OV_ARG(m->cases.memory), OV_ARG(m->crossing.memory),
                     OV_ARG(m->corners.memory));
}

/* Appends what the device has of the piece's part of a light mesh, in one round trip. */
static ovoid_status take_light(ovoid_context *context, marcher *m, cl_uint vertices,
                               cl_uint triangles) {
    ovoid_status status = OVOID_OK;
    const size_t each = 3 * sizeof(cl_float), bytes = m->new_vertices * each;
    ov_later offsets = {0}, normals = {0};
    OV_TRY(grow_vertices(context, m, m->vertices + m->new_vertices));
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

static ovoid_status take_corners(ovoid_context *context, marcher *m) {
    return ov_buffer_read(context, &m->corners, 0, m->triangle + 3 * m->triangles,
                          3 * m->new_triangles * sizeof *m->triangle);
}

/* The current piece's part of the mesh. */
static ovoid_status take_piece(ovoid_context *context, marcher *m) {
    ovoid_status status = OVOID_OK;
    const size_t packs = (m->new_vertices + OV_PACK - 1) / OV_PACK;
    cl_uint vertices = 0, triangles = 0;
    bool whole = true;
    if (m->active == 0)
        return OVOID_OK;
    OV_TRY(grow_triangles(context, m, m->triangles + m->new_triangles));
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

/* For the message about a surface that is not there. */
static ovoid_status note_largest(ovoid_context *context, marcher *m) {
    const size_t count = m->points.count;
    float *const values = ov_alloc(context, count, sizeof *values, "lattice values");
    if (!values)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status =
        ov_buffer_read(context, &m->value, 0, values, count * sizeof *values);
    for (size_t k = 0; k < count && status == OVOID_OK; ++k)
        m->largest = fmaxf(m->largest, values[k]);
    free(values);
    return status;
}

static ovoid_status fail_empty(ovoid_context *context, const marcher *m) {
    if (m->pieces.pieces == 0)
        return ov_fail(context, OVOID_ERROR_EMPTY,
                       "no surface: the field is nowhere above the isovalue %g",
                       m->options->isovalue);
    return ov_fail(context, OVOID_ERROR_EMPTY,
                   "no surface: the largest value of the field at a lattice point is %g, and the "
                   "isovalue %g; use a smaller isovalue or spacing (now %g angstrom)",
                   (double)m->largest, m->options->isovalue, m->options->spacing);
}

/* From the highest down, so that the neighbours above have been there. */
static ovoid_status march_pieces(ovoid_context *context, marcher *m) {
    ovoid_status status = OVOID_OK;
    for (size_t piece = m->pieces.pieces; piece-- > 0;) {
        const size_t pieces = m->pieces.pieces;
        if (m->watch)
            OV_TRY(ov_watch_ask(context, m->watch));
        else
            OV_TRY(ov_progress_step(context, pieces - 1 - piece, pieces));
        drop_old_faces(m, piece);
        OV_TRY(evaluate(context, m, piece));
        OV_TRY(take_piece(context, m));
        OV_TRY(keep_faces(context, m, piece));
        if (m->vertices == 0)
            OV_TRY(note_largest(context, m));
    }
cleanup:
    return status;
}

static double coordinate(const marcher *m, size_t vertex, size_t axis) {
    return m->origin ? (double)m->offsets[3 * vertex + axis] : m->xyz[3 * vertex + axis];
}

/* ---- what the lattice does not meet ------------------------------------------------------- */

static void vertex_at(size_t vertex, double xyz[3], const void *user) {
    const marcher *const m = user;
    for (size_t k = 0; k < 3; ++k)
        xyz[k] = coordinate(m, vertex, k) + (m->origin ? m->origin[k] : 0.0);
}

/* Drops the vertices that are replaced, and their triangles. `number` becomes the new ones. */
static void drop_replaced(marcher *m, const bool *replaced, uint32_t *number) {
    size_t kept = 0, triangles = 0;
    for (size_t v = 0; v < m->vertices; ++v) {
        ov_store_turn(m->store, v);
        if (replaced[v])
            continue;
        for (size_t k = 0; k < 3; ++k) {
            if (m->origin)
                m->offsets[3 * kept + k] = m->offsets[3 * v + k];
            else
                m->xyz[3 * kept + k] = m->xyz[3 * v + k];
            if (!m->bare)
                m->normals[3 * kept + k] = m->normals[3 * v + k];
        }
        if (m->edge_of)
            m->edge_of[kept] = m->edge_of[v];
        number[v] = (uint32_t)kept++;
    }
    for (size_t t = 0; t < m->triangles; ++t) {
        const uint32_t *const from = m->triangle + 3 * t;
        ov_store_turn(m->store, t);
        if (replaced[from[0]])
            continue;
        for (size_t k = 0; k < 3; ++k)
            m->triangle[3 * triangles + k] = number[from[k]];
        ++triangles;
    }
    m->vertices = kept;
    m->triangles = triangles;
}

static ovoid_status append_specks(ovoid_context *context, marcher *m, const ov_specks *specks) {
    ovoid_status status = OVOID_OK;
    const size_t total = m->vertices + specks->vertices, corners = 3 * m->triangles;
    if (total > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "the mesh has more than 2^32 vertices; use a larger spacing");
    OV_TRY(grow_vertices(context, m, total));
    OV_TRY(grow_triangles(context, m, m->triangles + specks->triangles));
    for (size_t k = 0; k < 3 * specks->vertices; ++k) {
        ov_store_turn(m->store, k);
        put_coordinate(m, 3 * m->vertices + k, specks->xyz[k]);
        if (!m->bare)
            m->normals[3 * m->vertices + k] = specks->normals[k];
    }
    if (m->edge_of)
        memcpy(m->edge_of + m->vertices, specks->edge, specks->vertices);
    for (size_t k = 0; k < 3 * specks->triangles; ++k) {
        ov_store_turn(m->store, k);
        m->triangle[corners + k] = (uint32_t)m->vertices + specks->corners[k];
    }
    m->vertices = total;
    m->triangles += specks->triangles;
cleanup:
    return status;
}

static ovoid_status add_specks(ovoid_context *context, marcher *m, size_t count) {
    ovoid_status status = OVOID_OK;
    ov_specks specks = {.store = m->store};
    uint32_t *number = NULL;
    ov_lattice_mesh lattice = {.at = vertex_at,
                               .user = m,
                               .corners = m->triangle,
                               .vertices = m->vertices,
                               .triangles = m->triangles};
    OV_TRY(ov_store_alloc(context, m->store, &lattice.replaced, m->vertices,
                          sizeof *lattice.replaced, "vertices"));
    OV_TRY(ov_specks_find(context, m->bodies, count, m->options, m->cutoff, &lattice, &specks));
    m->missed = specks.missed;
    if (specks.vertices == 0)
        goto cleanup;
    OV_TRY(ov_store_alloc(context, m->store, &number, m->vertices, sizeof *number, "vertices"));
    m->resident = false;
    drop_replaced(m, lattice.replaced, number);
    OV_TRY(append_specks(context, m, &specks));
cleanup:
    ov_store_free(m->store, number);
    ov_store_free(m->store, lattice.replaced);
    ov_specks_destroy(&specks);
    return status;
}

/* ---- normals where the gradient vanishes -------------------------------------------------- */

static bool vanishes(const float normal[3]) {
    return normal[0] == 0.0f && normal[1] == 0.0f && normal[2] == 0.0f;
}

/* Twice a triangle's area times its normal. */
static void triangle_normal(const marcher *m, const uint32_t corner[3], double normal[3]) {
    double u[3], v[3];
    for (size_t k = 0; k < 3; ++k) {
        const double from = coordinate(m, corner[0], k);
        u[k] = coordinate(m, corner[1], k) - from;
        v[k] = coordinate(m, corner[2], k) - from;
    }
    for (int k = 0; k < 3; ++k)
        normal[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
}

/* Gives a vertex the mean normal of its triangles, or any unit vector if they have no area. */
static ovoid_status mend_normals(ovoid_context *context, marcher *m) {
    size_t missing = 0;
    double *sums = NULL;
    for (size_t k = 0; !m->bare && k < m->vertices; ++k) {
        ov_store_turn(m->store, k);
        missing += vanishes(m->normals + 3 * k);
    }
    if (missing == 0)
        return OVOID_OK;
    const ovoid_status status =
        ov_store_alloc(context, m->store, &sums, 3 * m->vertices, sizeof *sums, "normals");
    if (status != OVOID_OK)
        return status;
    for (size_t k = 0; k < m->triangles; ++k) {
        double normal[3];
        ov_store_turn(m->store, k);
        triangle_normal(m, m->triangle + 3 * k, normal);
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                sums[3 * (size_t)m->triangle[3 * k + (size_t)corner] + (size_t)axis] +=
                    normal[axis];
    }
    for (size_t k = 0; k < m->vertices; ++k) {
        const double *const s = sums + 3 * k;
        float *const normal = m->normals + 3 * k;
        const double length = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
        ov_store_turn(m->store, k);
        if (!vanishes(normal))
            continue;
        normal[2] = 1.0f;
        for (int axis = 0; axis < 3 && length > 0.0; ++axis)
            normal[axis] = (float)(s[axis] / length);
    }
    ov_store_free(m->store, sums);
    return OVOID_OK;
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* Frees what the next mesh cannot use, the mesh itself among it. */
static void end_mesh(marcher *m) {
    for (size_t k = 0; m->faces && k < m->pieces.pieces; ++k)
        drop_faces(&m->faces[k]);
    free(m->faces);
    void *const arrays[] = {m->xyz, m->offsets, m->edge_of, m->normals, m->triangle};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k)
        ov_store_free(m->store, arrays[k]);
    ov_pieces_destroy(&m->pieces);
    memset(m, 0, offsetof(marcher, grid));
}

/* Frees what it works with. */
static void release_work(marcher *m) {
    ov_buffer *const buffers[] = {&m->value,      &m->sign,     &m->crossing, &m->found,
                                  &m->box,        &m->cases,    &m->list,     &m->edge,
                                  &m->t,          &m->normal,   &m->corners,  &m->face_list,
                                  &m->ghost_list, &m->place,    &m->values,   &m->crossings,
                                  &m->totals,     &m->brick_of, &m->placed,   &m->placed_normals};
    void *const memory[] = {m->quadrics, m->edges, m->refined};
    drop_grid(m);
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
    for (size_t k = 0; k < KERNELS; ++k)
        ov_kernel_destroy(&m->kernel[k]);
    for (size_t k = 0; k < sizeof memory / sizeof memory[0]; ++k)
        free(memory[k]);
    ov_points_destroy(&m->vertex_points);
    ov_terms_destroy(&m->terms);
    ov_lists_destroy(&m->lists);
    ov_lists_destroy(&m->vertex_lists);
    ov_operations_destroy(&m->operations);
    memset((char *)m + offsetof(marcher, grid), 0, sizeof *m - offsetof(marcher, grid));
}

/* Hands over what the device has of a light mesh. The next one may be a little larger. */
static void adopt_device(marcher *m, ovoid_mesh *mesh) {
    m->placed_vertices = m->vertices + m->vertices / 8;
    m->corners_triangles = m->triangles + m->triangles / 8;
    if (!m->resident)
        return;
    mesh->on_device[OV_ON_DEVICE_OFFSETS] = m->placed;
    mesh->on_device[OV_ON_DEVICE_CORNERS] = m->corners;
    m->placed = m->corners = (ov_buffer){0};
}

/* Hands the arrays over, without what growing has taken too much. */
static ovoid_status adopt(ovoid_context *context, marcher *m, ovoid_mesh **mesh) {
    ov_store_shrink(m->store, &m->xyz, 3 * m->vertices * sizeof *m->xyz);
    ov_store_shrink(m->store, &m->offsets, 3 * m->vertices * sizeof *m->offsets);
    ov_store_shrink(m->store, &m->normals, 3 * m->vertices * sizeof *m->normals);
    ov_store_shrink(m->store, &m->triangle, 3 * m->triangles * sizeof *m->triangle);
    const ovoid_status status =
        m->origin ? ov_mesh_adopt_light(context, m->offsets, m->origin, m->normals, m->vertices,
                                        m->triangle, m->triangles, mesh)
                  : ov_mesh_adopt(context, m->store, m->xyz, m->normals, m->vertices, m->triangle,
                                  m->triangles, mesh);
    m->xyz = NULL;
    m->offsets = m->normals = NULL;
    m->triangle = NULL;
    if (status != OVOID_OK)
        return status;
    (*mesh)->along_curve = true;
    (*mesh)->spacing = m->options->spacing;
    (*mesh)->missed = m->missed;
    if (m->origin)
        adopt_device(m, *mesh);
    (*mesh)->edge = m->edge_of;
    m->edge_of = NULL;
    const ovoid_status exposed = m->origin ? OVOID_OK : ov_mesh_expose(context, *mesh);
    if (exposed != OVOID_OK)
        ovoid_mesh_destroy(mesh);
    return exposed;
}

/* Where there are so many more pieces than ones with a surface, small pieces are tried, and ones of
 * a middle size where pieces have so many points that much of them may be empty; and what a piece
 * costs beside its points, in points. */
#define EMPTY_SHARE 8.0
#define EMPTY_POINTS 2e6
#define OVERHEAD 2e5
static const uint64_t sparse_limits[][3] = {
    {128, 128, 64}, {64, 64, 32}, {32, 32, 16}, {16, 16, 8}};

static double points_of(const ov_pieces *pieces) {
    return (double)pieces->size[0] * (double)pieces->size[1] * (double)pieces->size[2];
}

static double cost_of(const ov_pieces *pieces) {
    return (double)pieces->pieces * (OVERHEAD + points_of(pieces));
}

/* Cuts the lattice into pieces: small ones where terms are few and far apart. */
static ovoid_status plan(ovoid_context *context, marcher *m, size_t count,
                         const uint64_t limit[3]) {
    ovoid_status status = OVOID_OK;
    bool sparse;
    const ovoid_mesh_options *const o = m->options;
    ov_pieces *const best = &m->pieces;
    const uint64_t *const wanted = m->clipped ? NULL : m->wanted; /* of whole meshes */
    OV_TRY(ov_pieces_create(context, m->bodies, count, o->isovalue, m->cutoff, o->spacing, limit,
                            wanted, m->clipped ? m->clip : NULL, best));
    sparse = (double)best->count[0] * (double)best->count[1] * (double)best->count[2] >
             EMPTY_SHARE * (double)best->pieces;
    for (size_t k = 0; k < sizeof sparse_limits / sizeof *sparse_limits; ++k) {
        ov_pieces other;
        if (k == 0 ? points_of(best) <= EMPTY_POINTS : !sparse)
            continue;
        OV_TRY(ov_pieces_create(context, m->bodies, count, o->isovalue, m->cutoff, o->spacing,
                                sparse_limits[k], wanted, m->clipped ? m->clip : NULL, &other));
        if (cost_of(&other) < cost_of(best)) {
            const ov_pieces swap = *best;
            *best = other;
            other = swap;
        }
        ov_pieces_destroy(&other);
    }
    for (int axis = 0; axis < 3; ++axis) {
        m->ends.low[axis] = (double)best->origin[axis] * o->spacing;
        m->ends.high[axis] = (double)best->last[axis] * o->spacing;
    }
cleanup:
    return status;
}

/* How a mesh is to be made, beside its options. */
typedef struct plan_of_mesh {
    const uint64_t *limit;
    const double *origin; /* of a light mesh, else NULL */
    const ov_watch *watch;
    ov_store *store; /* NULL: in memory, as a light mesh is */
    bool specks;
    bool bare; /* without normals; light */
} plan_of_mesh;

static ovoid_status march_with(ovoid_context *context, marcher *m, size_t count,
                               const plan_of_mesh *how) {
    ovoid_status status = OVOID_OK;
    OV_TRY(plan(context, m, count, how->limit));
    if (m->pieces.pieces > 0)
        OV_TRY(set_up(context, m));
    OV_TRY(march_pieces(context, m));
    if (how->specks && m->pieces.pieces > 0)
        OV_TRY(add_specks(context, m, count));
    if (m->vertices == 0)
        OV_TRY(fail_empty(context, m));
    OV_TRY(mend_normals(context, m));
cleanup:
    return status;
}

/* kept: a marcher for this mesh and the next, or NULL. */
static ovoid_status march(ovoid_context *context, marcher *kept, const ov_body *bodies,
                          size_t count, const ovoid_mesh_options *options, const plan_of_mesh *how,
                          ovoid_mesh **mesh) {
    marcher own = {0}, *const m = kept ? kept : &own;
    m->store = how->store;
    m->bodies = bodies;
    m->options = options;
    m->origin = how->origin;
    m->watch = how->watch;
    m->bare = how->bare;
    m->cutoff = (m->share > 0.0 ? m->share : OV_MARCH_CUTOFF) * options->isovalue;
    m->resident = kept && how->origin;
    ovoid_status status = march_with(context, m, count, how);
    if (!kept)
        release_work(m); /* what is left is the mesh */
    if (status == OVOID_OK)
        status = adopt(context, m, mesh);
    end_mesh(m);
    return status;
}

/* The components, unless the caller sees to them. */
static ovoid_status finish(ovoid_context *context, ovoid_status status, ovoid_mesh **mesh) {
    if (status == OVOID_OK)
        status = ov_mesh_finish(context, *mesh);
    if (status != OVOID_OK)
        ovoid_mesh_destroy(mesh);
    return status;
}

ovoid_status ov_march(ovoid_context *context, const ov_body *bodies, size_t count,
                      const ovoid_mesh_options *options, const uint64_t limit[3],
                      ovoid_mesh **mesh) {
    return march(context, NULL, bodies, count, options, &(plan_of_mesh){.limit = limit}, mesh);
}

ovoid_status ov_march_light(ovoid_context *context, const ov_body *bodies, size_t count,
                            const ovoid_mesh_options *options, const uint64_t limit[3],
                            const double origin[3], const ov_watch *watch, ovoid_mesh **mesh) {
    *mesh = NULL;
    return finish(context,
                  march(context, NULL, bodies, count, options,
                        &(plan_of_mesh){.limit = limit, .origin = origin, .watch = watch}, mesh),
                  mesh);
}

static const uint64_t piece_limit[3] = OV_MARCH_PIECE;
/* Of meshes that are clipped so that they take little, an eighth of the memory. */
static const uint64_t clipped_limit[3] = {128, 128, 64};

ovoid_status ov_mesh_bodies(ovoid_context *context, ov_store *store, const ov_body *bodies,
                            size_t count, const ovoid_mesh_options *options, ovoid_mesh **mesh) {
    ovoid_mesh *made = NULL;
    const ovoid_status status =
        march(context, NULL, bodies, count, options,
              &(plan_of_mesh){.limit = piece_limit, .store = store, .specks = true}, &made);
    if (status != OVOID_OK)
        return status;
    if (made->missed > 0)
        ov_warn(
            context,
            "%zu atom%s or ellipsoid%s make%s a surface too small or too thin for the spacing of "
            "%g angstrom, which the mesh may lack; use a smaller one",
            made->missed, made->missed == 1 ? "" : "s", made->missed == 1 ? "" : "s",
            made->missed == 1 ? "s" : "", options->spacing);
    *mesh = made;
    return OVOID_OK;
}

ovoid_status ov_marcher_create(ovoid_context *context, ov_marcher **result) {
    ov_marcher *const made = ov_alloc(context, 1, sizeof *made, "what meshing takes");
    if (!made)
        return OVOID_ERROR_MEMORY;
    *result = made;
    return OVOID_OK;
}

/* Beyond what the last mesh took: models end here and there a step outside the original. */
#define WANTED_MORE 8

void ov_marcher_stay(ov_marcher *m) {
    static const uint64_t limit[3] = OV_MARCH_PIECE;
    uint64_t wanted[3] = {0, 0, 0};
    for (size_t axis = 0; axis < 3 && m->grid.total > 0; ++axis) {
        wanted[axis] = m->grid.bricks[axis] * brick_points[axis] + WANTED_MORE;
        wanted[axis] = wanted[axis] < limit[axis] ? wanted[axis] : limit[axis];
    }
    release_work(m);
    memcpy(m->wanted, wanted, sizeof wanted);
}

void ov_marcher_clip(ov_marcher *m, const double low[3], const double high[3]) {
    m->clipped = low;
    if (!low)
        return;
    memcpy(m->clip[0], low, sizeof m->clip[0]);
    memcpy(m->clip[1], high, sizeof m->clip[1]);
}

ov_box ov_marcher_ends(const ov_marcher *m) {
    return m->ends;
}

void ov_marcher_cut_off(ov_marcher *m, double share) {
    m->share = share;
}

void ov_marcher_begin(ov_marcher *m) {
    drop_grid(m);
    ov_lists_forget(&m->lists);
    ov_lists_forget(&m->vertex_lists);
    m->placed_vertices = m->corners_triangles = 0;
}

void ov_marcher_destroy(ov_marcher **kept) {
    if (!*kept)
        return;
    release_work(*kept);
    free(*kept);
    *kept = NULL;
}

ovoid_status ov_mesh_bodies_light(ovoid_context *context, ov_marcher *kept, const ov_body *bodies,
                                  size_t count, const ovoid_mesh_options *options,
                                  const double origin[3], const ov_watch *watch, bool normals,
                                  ovoid_mesh **mesh) {
    const plan_of_mesh how = {.limit = kept->clipped ? clipped_limit : piece_limit,
                              .origin = origin,
                              .watch = watch,
                              .specks = true,
                              .bare = !normals};
    return march(context, kept, bodies, count, options, &how, mesh);
}
