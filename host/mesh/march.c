#include "mesh/marching.h"

#include "mesh/exposed.h"
#include "mesh/mesh.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* ---- piece by piece -------------------------------------------------------------------------- */

/* For the message about a surface that is not there. */
static ovoid_status note_largest(ovoid_context *context, ov_marcher *m) {
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

static ovoid_status fail_empty(ovoid_context *context, const ov_marcher *m) {
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
static ovoid_status march_pieces(ovoid_context *context, ov_marcher *m) {
    ovoid_status status = OVOID_OK;
    for (size_t piece = m->pieces.pieces; piece-- > 0;) {
        const size_t pieces = m->pieces.pieces;
        if (m->watch)
            OV_TRY(ov_watch_ask(context, m->watch));
        else
            OV_TRY(ov_progress_step(context, pieces - 1 - piece, pieces));
        ov_marching_drop_old_faces(m, piece);
        OV_TRY(ov_marching_evaluate(context, m, piece));
        OV_TRY(ov_marching_take(context, m));
        OV_TRY(ov_marching_keep_faces(context, m, piece));
        if (m->vertices == 0)
            OV_TRY(note_largest(context, m));
    }
cleanup:
    return status;
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* Frees what the next mesh cannot use, the mesh itself among it. */
static void end_mesh(ov_marcher *m) {
    for (size_t k = 0; m->faces && k < m->pieces.pieces; ++k)
        ov_marching_drop_faces(&m->faces[k]);
    free(m->faces);
    void *const arrays[] = {m->xyz, m->offsets, m->edge_of, m->normals, m->triangle};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k)
        ov_store_free(m->store, arrays[k]);
    ov_pieces_destroy(&m->pieces);
    memset(m, 0, offsetof(ov_marcher, grid));
}

/* Frees what it works with. */
static void release_work(ov_marcher *m) {
    ov_buffer *const buffers[] = {&m->value,      &m->sign,     &m->crossing, &m->found,
                                  &m->box,        &m->cases,    &m->list,     &m->edge,
                                  &m->t,          &m->normal,   &m->corners,  &m->face_list,
                                  &m->ghost_list, &m->place,    &m->values,   &m->crossings,
                                  &m->totals,     &m->brick_of, &m->placed,   &m->placed_normals};
    void *const memory[] = {m->quadrics, m->edges, m->refined};
    ov_marching_drop_grid(m);
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
    for (size_t k = 0; k < OV_MARCH_KERNELS; ++k)
        ov_kernel_destroy(&m->kernel[k]);
    for (size_t k = 0; k < sizeof memory / sizeof memory[0]; ++k)
        free(memory[k]);
    ov_points_destroy(&m->vertex_points);
    ov_terms_destroy(&m->terms);
    ov_lists_destroy(&m->lists);
    ov_lists_destroy(&m->vertex_lists);
    ov_operations_destroy(&m->operations);
    memset((char *)m + offsetof(ov_marcher, grid), 0, sizeof *m - offsetof(ov_marcher, grid));
}

/* Hands over what the device has of a light mesh. The next one may be a little larger. */
static void adopt_device(ov_marcher *m, ovoid_mesh *mesh) {
    m->placed_vertices = m->vertices + m->vertices / 8;
    m->corners_triangles = m->triangles + m->triangles / 8;
    if (!m->resident)
        return;
    mesh->on_device[OV_ON_DEVICE_OFFSETS] = m->placed;
    mesh->on_device[OV_ON_DEVICE_CORNERS] = m->corners;
    m->placed = m->corners = (ov_buffer){0};
}

/* Hands the arrays over, without what growing has taken too much. */
static ovoid_status adopt(ovoid_context *context, ov_marcher *m, ovoid_mesh **mesh) {
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
static ovoid_status plan(ovoid_context *context, ov_marcher *m, size_t count,
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

static ovoid_status march_with(ovoid_context *context, ov_marcher *m, size_t count,
                               const plan_of_mesh *how) {
    ovoid_status status = OVOID_OK;
    OV_TRY(plan(context, m, count, how->limit));
    if (m->pieces.pieces > 0)
        OV_TRY(ov_marching_set_up(context, m));
    OV_TRY(march_pieces(context, m));
    if (how->specks && m->pieces.pieces > 0)
        OV_TRY(ov_marching_add_specks(context, m, count));
    if (m->vertices == 0)
        OV_TRY(fail_empty(context, m));
    OV_TRY(ov_marching_mend_normals(context, m));
cleanup:
    return status;
}

/* kept: a marcher for this mesh and the next, or NULL. */
static ovoid_status march(ovoid_context *context, ov_marcher *kept, const ov_body *bodies,
                          size_t count, const ovoid_mesh_options *options, const plan_of_mesh *how,
                          ovoid_mesh **mesh) {
    ov_marcher own = {0}, *const m = kept ? kept : &own;
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
    static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z},
                          limit[3] = OV_MARCH_PIECE;
    uint64_t wanted[3] = {0, 0, 0};
    for (size_t axis = 0; axis < 3 && m->grid.total > 0; ++axis) {
        wanted[axis] = m->grid.bricks[axis] * brick[axis] + WANTED_MORE;
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
    ov_marching_drop_grid(m);
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
