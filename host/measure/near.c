/*
 * Judging a model near its changes alone. The model is meshed in boxes about them and its distances
 * from the original are measured there, in both directions; elsewhere both are what they were. What
 * comes out are the spots that judging all of the model would find.
 *
 * A mesh that ends at a box does not tell what is a cavity: where a piece of it leaves the box, the
 * mesh seen last does.
 */
#include "measure/changes.h"
#include "measure/judging.h"
#include "mesh/union.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A change counts where it is of at least this share of the isovalue: less moves the surface by
 * less than a hundredth of an angstrom, where the field is as steep as it mostly is. */
#define FLOOR 0.01
/* Boxes are larger than that by so many times the distance that spots have at least: places whose
 * nearest points have changed lie in them. */
#define ABOUT 3.0
/* The model is meshed so much further about a box: so many times that distance, within which
 * distances are right, and so many lattice steps, in which its mesh comes to its end. */
#define BEYOND 2.0
#define BEYOND_STEPS 4.0
/* The share of the box about the model that is worth it: a little of it takes as long as much of
 * it, unless triangles are looked into. */
#define WORTH 0.15
#define WORTH_INSIDE 0.5
/* Vertices are those of the mesh seen last where they are this near to them, in lattice steps: what
 * a change moves that does not count, where the field is flat; other surfaces are OV_NECK steps
 * away (mesh/exposed.h). */
#define SAME 0.75

/* The boxes, and what is found in them. */
typedef struct nearby {
    ov_judge *judge;
    const ov_quadric *quadrics;
    size_t count;
    double least;
    ov_box box[OV_CHANGES_MOST];
    size_t boxes;
    ov_spot_list *found;
} nearby;

/* What is meshed of the model in one of them. */
typedef struct excerpt {
    const ov_box *box;
    ov_box sure; /* where the mesh is that of the whole model */
    ovoid_mesh *mesh;
    bool *exposed; /* its vertices */
    float *distance;
    ov_trail trail, original; /* the original's: in the box alone */
    float *from_original;     /* of all of the original's vertices */
} excerpt;

static void excerpt_destroy(excerpt *e) {
    ov_trail_destroy(&e->trail);
    ov_trail_destroy(&e->original);
    ovoid_mesh_destroy(&e->mesh);
    free(e->exposed);
    free(e->distance);
    free(e->from_original);
}

static bool is_in(const ov_box *box, const double at[3]) {
    return ov_box_near(box, at, 0.0);
}

static double room_of(const ov_judge *judge, double least) {
    return BEYOND * least + BEYOND_STEPS * judge->meshing.spacing;
}

/* ---- whether --------------------------------------------------------------------------------- */

static bool is_in_any(const nearby *n, const double at[3]) {
    for (size_t k = 0; k < n->boxes; ++k)
        if (is_in(&n->box[k], at))
            return true;
    return false;
}

/* The share of the box about the model that has to be meshed. */
static double share_of(const nearby *n) {
    const ov_seen *const seen = &n->judge->seen;
    double sum = 0.0, whole = 1.0;
    for (size_t axis = 0; axis < 3; ++axis)
        whole *= seen->box.high[axis] - seen->box.low[axis];
    for (size_t k = 0; k < n->boxes; ++k) {
        const ov_box all = ov_box_larger(&n->box[k], room_of(n->judge, n->least));
        const ov_box meshed = ov_box_common(&all, &seen->box);
        double volume = 1.0;
        for (size_t axis = 0; axis < 3; ++axis)
            volume *= fmax(meshed.high[axis] - meshed.low[axis], 0.0);
        sum += volume;
    }
    return sum / whole;
}

/* Whether it is a small share of the work, and all that is known to be off lies there. */
static bool is_worth_it(const nearby *n) {
    const ov_seen *const seen = &n->judge->seen;
    if (n->boxes == 0 || !(share_of(n) < (n->judge->slack > 0.0 ? WORTH_INSIDE : WORTH)))
        return false;
    for (size_t k = 0; k < seen->spots.count; ++k)
        if (!is_in_any(n, seen->spots.spot[k].at))
            return false;
    return true;
}

/* ---- what is exposed ------------------------------------------------------------------------- */

/* The pieces of a mesh in a box, by their first vertices. */
static void find_pieces(const ovoid_mesh *mesh, const ov_box *box, uint32_t *piece) {
    for (size_t v = 0; v < mesh->vertices; ++v)
        piece[v] = (uint32_t)v;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        bool in = true;
        for (size_t i = 0; i < 3 && in; ++i) {
            double at[3];
            ov_mesh_at(mesh, corner[i], at);
            in = is_in(box, at);
        }
        if (in) {
            ov_unite(piece, corner[0], corner[1]);
            ov_unite(piece, corner[0], corner[2]);
        }
    }
    for (size_t v = 0; v < mesh->vertices; ++v)
        piece[v] = piece[piece[v]];
}

/* Of each piece that leaves the box: whether it does so where something was exposed. */
static ovoid_status find_leaving(const ov_judge *judge, const excerpt *e, const uint32_t *piece,
                                 bool *leaves, bool *exposed) {
    ovoid_status status = OVOID_OK;
    const ov_seen *const seen = &judge->seen;
    uint32_t near[2 * OV_NEAR_MAX];
    ov_grid grid = {0};
    if (seen->hidden_count > 0)
        OV_TRY(ov_grid_of(judge->context, seen->hidden, 3 * sizeof *seen->hidden,
                          seen->hidden_count, SAME * judge->meshing.spacing, &grid));
    for (size_t v = 0; v < e->mesh->vertices; ++v) {
        double at[3];
        if (exposed[piece[v]])
            continue;
        ov_mesh_at(e->mesh, v, at);
        if (is_in(e->box, at) || !is_in(&e->sure, at))
            continue;
        leaves[piece[v]] = true;
        exposed[piece[v]] =
            seen->hidden_count == 0 || ov_grid_near(&grid, at, UINT32_MAX, near) == 0;
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

static ovoid_status find_exposed(const ov_judge *judge, excerpt *e) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = e->mesh->vertices;
    bool *exposed; /* behind leaves */
    uint32_t *const piece = ov_alloc(judge->context, vertices, sizeof *piece, "pieces of a mesh");
    bool *const leaves = ov_alloc(judge->context, 2 * vertices, sizeof *leaves, "pieces of a mesh");
    e->exposed = ov_alloc(judge->context, vertices, sizeof *e->exposed, "points of a mesh");
    if (!piece || !leaves || !e->exposed) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    exposed = leaves + vertices;
    find_pieces(e->mesh, &e->sure, piece);
    OV_TRY(find_leaving(judge, e, piece, leaves, exposed));
    for (size_t v = 0; v < vertices; ++v)
        e->exposed[v] = leaves[piece[v]] ? exposed[piece[v]] : ov_mesh_is_exposed(e->mesh, v);
cleanup:
    free(piece);
    free(leaves);
    return status;
}

static ovoid_status add_hidden(ovoid_context *context, ov_seen *seen, const double at[3]) {
    const ovoid_status status =
        ov_grow(context, (void *)&seen->hidden, &seen->hidden_capacity,
                3 * (seen->hidden_count + 1), sizeof *seen->hidden, "points of a mesh");
    if (status == OVOID_OK)
        memcpy(seen->hidden + 3 * seen->hidden_count++, at, 3 * sizeof *at);
    return status;
}

/* What is hidden in the box is what is hidden there now. */
static ovoid_status renew_hidden(ov_judge *judge, const excerpt *e) {
    ovoid_status status = OVOID_OK;
    ov_seen *const seen = &judge->seen;
    size_t kept = 0;
    double at[3];
    for (size_t n = 0; n < seen->hidden_count; ++n)
        if (!is_in(e->box, seen->hidden + 3 * n))
            memmove(seen->hidden + 3 * kept++, seen->hidden + 3 * n, 3 * sizeof *seen->hidden);
    seen->hidden_count = kept;
    for (size_t v = 0; v < e->mesh->vertices; ++v) {
        ov_mesh_at(e->mesh, v, at);
        if (!e->exposed[v] && is_in(e->box, at))
            OV_TRY(add_hidden(judge->context, seen, at));
    }
cleanup:
    return status;
}

/* ---- in one box ------------------------------------------------------------------------------ */

/* mesh stays NULL where the model has no surface there. */
static ovoid_status mesh_excerpt(const nearby *n, excerpt *e) {
    ov_judge *const judge = n->judge;
    const ov_box room = ov_box_larger(e->box, room_of(judge, n->least));
    size_t some = 0;
    ov_body *bodies = NULL;
    ovoid_status status = OVOID_OK;
    const double cutoff = ov_judge_cutoff(judge, n->least);
    ov_quadric *const chosen = ov_alloc(judge->context, n->count, sizeof *chosen, "ellipsoids");
    if (!chosen)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < n->count; ++i)
        if (ov_quadric_meets(&n->quadrics[i], cutoff * judge->meshing.isovalue, room.low,
                             room.high))
            chosen[some++] = n->quadrics[i];
    OV_TRY(ov_bodies_of_quadrics(judge->context, chosen, some, &bodies));
    ov_marcher_clip(judge->near_marcher, room.low, room.high);
    ov_marcher_cut_off(judge->near_marcher, cutoff);
    OV_TRY(ov_mesh_bodies_light(judge->context, judge->near_marcher, bodies, some, &judge->meshing,
                                judge->origin, &judge->watch, false, &e->mesh));
    OV_TRY(ov_mesh_finish(judge->context, e->mesh));
cleanup:
    if (status == OVOID_ERROR_EMPTY || status == OVOID_ERROR_LIMIT) {
        ovoid_mesh_destroy(&e->mesh);
        status = OVOID_OK;
    }
    free(bodies);
    free(chosen);
    return status;
}

/* The triangles of the original in the box. */
static ovoid_status choose_original(const ov_judge *judge, excerpt *e) {
    const ovoid_mesh *const mesh = judge->mesh;
    bool *const in =
        ov_alloc(judge->context, mesh->vertices + mesh->triangles, sizeof *in, "points of a mesh");
    if (!in)
        return OVOID_ERROR_MEMORY;
    bool *const chosen = in + mesh->vertices;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        in[v] = is_in(e->box, at);
    }
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        chosen[t] = in[corner[0]] && in[corner[1]] && in[corner[2]];
    }
    const ovoid_status status = ov_trail_choose(judge->context, mesh, chosen, &e->original);
    free(in);
    return status;
}

/* Spots at the trail's vertices and inside its triangles, which another box may find, too.
 * distance: what does not count gets -1. */
static ovoid_status find_spots(const nearby *n, const excerpt *e, ov_meter *meter, ov_facets *to,
                               const ov_trail *from, const bool *exposed, float *distance) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = n->judge;
    ov_listing listing = {judge->context, n->found};
    const ov_limits limits = {
        .limit = n->least, .slack = judge->slack, .found = ov_list_spot, .user = &listing};
    bool whole, outer;
    for (size_t k = 0; k < from->vertices; ++k) {
        const uint32_t v = ov_trail_vertex(from, k);
        double at[3];
        ov_mesh_at(from->mesh, v, at);
        if (!is_in(e->box, at) ||
            !ov_judge_counts(judge, from->mesh, exposed, v, distance[v], &outer) || !outer)
            distance[v] = -1.0f;
        else if (distance[v] >= n->least)
            OV_TRY(ov_list_spot(at, distance[v], &listing));
    }
    if (judge->slack > 0.0)
        OV_TRY(ov_bound_exceed(judge->context, meter, to, from, distance, &limits, &whole));
cleanup:
    return status;
}

/* In both directions. */
static ovoid_status measure_excerpt(const nearby *n, excerpt *e) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = n->judge;
    ovoid_context *const context = judge->context;
    e->distance = ov_alloc(context, e->mesh->vertices, sizeof *e->distance, "distances");
    e->from_original =
        ov_alloc(context, judge->mesh->vertices, sizeof *e->from_original, "distances");
    if (!e->distance || !e->from_original)
        return OVOID_ERROR_MEMORY;
    judge->meter.watch = judge->back.watch = &judge->watch;
    judge->meter.enough = judge->back.enough = ov_judge_enough(judge, n->least);
    OV_TRY(choose_original(judge, e));
    OV_TRY(ov_trail_create(context, e->mesh, false, &e->trail));
    OV_TRY(ov_facets_set(context, &judge->other, &e->trail, judge->origin));
    OV_TRY(ov_trail_distances(context, &judge->back, &judge->facets, &e->trail, e->distance));
    OV_TRY(find_spots(n, e, &judge->back, &judge->facets, &e->trail, e->exposed, e->distance));
    if (e->original.vertices == 0)
        goto cleanup;
    OV_TRY(
        ov_trail_distances(context, &judge->meter, &judge->other, &e->original, e->from_original));
    OV_TRY(find_spots(n, e, &judge->meter, &judge->other, &e->original, NULL, e->from_original));
cleanup:
    return status;
}

/* *known is false where there is no surface to tell by. */
static ovoid_status look_in_box(nearby *n, size_t k, bool *known) {
    ovoid_status status = OVOID_OK;
    excerpt e = {.box = &n->box[k], .sure = ov_box_larger(&n->box[k], BEYOND * n->least)};
    OV_TRY(mesh_excerpt(n, &e));
    *known = e.mesh;
    if (!e.mesh)
        goto cleanup;
    OV_TRY(find_exposed(n->judge, &e));
    OV_TRY(renew_hidden(n->judge, &e));
    OV_TRY(measure_excerpt(n, &e));
cleanup:
    excerpt_destroy(&e);
    return status;
}

/* ---- what was seen --------------------------------------------------------------------------- */

static ovoid_status remember_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   double least, const ov_spot *spots, size_t spot_count) {
    ovoid_status status = OVOID_OK;
    ov_seen *const seen = &judge->seen;
    seen->known = false;
    OV_TRY(ov_grow(judge->context, (void *)&seen->quadric, &seen->capacity, count,
                   sizeof *seen->quadric, "ellipsoids"));
    OV_TRY(ov_grow(judge->context, (void *)&seen->spots.spot, &seen->spots.capacity, spot_count,
                   sizeof *seen->spots.spot, "spots"));
    if (count > 0)
        memcpy(seen->quadric, quadrics, count * sizeof *quadrics);
    if (spot_count > 0)
        memcpy(seen->spots.spot, spots, spot_count * sizeof *spots);
    seen->count = count;
    seen->spots.count = spot_count;
    seen->least = least;
    seen->slack = judge->slack;
    seen->closely = judge->closely;
    seen->whole = judge->whole;
    seen->known = true;
cleanup:
    return status;
}

ovoid_status ov_judge_remember(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                               const ovoid_mesh *mesh, double least, const ov_spot *spots,
                               size_t spot_count) {
    ovoid_status status = OVOID_OK;
    ov_seen *const seen = &judge->seen;
    seen->hidden_count = 0;
    for (size_t k = 0; k < 3; ++k) {
        seen->box.low[k] = INFINITY;
        seen->box.high[k] = -INFINITY;
    }
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        for (size_t k = 0; k < 3; ++k) {
            seen->box.low[k] = fmin(seen->box.low[k], at[k]);
            seen->box.high[k] = fmax(seen->box.high[k], at[k]);
        }
        if (!ov_mesh_is_exposed(mesh, v))
            OV_TRY(add_hidden(judge->context, seen, at));
    }
    OV_TRY(remember_model(judge, quadrics, count, least, spots, spot_count));
cleanup:
    return status;
}

void ov_seen_destroy(ov_seen *seen) {
    free(seen->quadric);
    free(seen->spots.spot);
    free(seen->hidden);
    *seen = (ov_seen){0};
}

/* ---- the whole ------------------------------------------------------------------------------- */

/* Whether what was seen last was asked for in the same way. */
static bool is_the_same(const ov_judge *judge, double least) {
    const ov_seen *const seen = &judge->seen;
    return seen->known && seen->least == least && seen->slack == judge->slack &&
           seen->closely == judge->closely && seen->whole == judge->whole;
}

ovoid_status ov_judge_near(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                           ov_spot_list *found, bool *looked) {
    ovoid_status status = OVOID_OK;
    const ov_change change = {.before = judge->seen.quadric,
                              .before_count = judge->seen.count,
                              .now = quadrics,
                              .now_count = count,
                              .floor = FLOOR * judge->meshing.isovalue,
                              .about = ABOUT * least,
                              .room = room_of(judge, least)};
    bool known = true, few;
    *looked = false;
    if (!is_the_same(judge, least))
        return OVOID_OK;
    nearby *const n = ov_alloc(judge->context, 1, sizeof *n, "boxes");
    if (!n)
        return OVOID_ERROR_MEMORY;
    *n = (nearby){
        .judge = judge, .quadrics = quadrics, .count = count, .least = least, .found = found};
    OV_TRY(ov_changes_find(judge->context, &change, n->box, &n->boxes, &few));
    if (!is_worth_it(n))
        goto cleanup;
    for (size_t k = 0; k < n->boxes && known; ++k)
        OV_TRY(look_in_box(n, k, &known));
    if (!known)
        goto cleanup;
    OV_TRY(remember_model(judge, quadrics, count, least, found->spot, found->count));
    *looked = true;
cleanup:
    if (status != OVOID_OK || !*looked)
        found->count = 0;
    judge->seen.known = judge->seen.known && status == OVOID_OK;
    free(n);
    return status;
}
