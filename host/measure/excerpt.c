#include "measure/excerpt.h"

#include "mesh/exposed.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The model is meshed so much further about a box: so many times the distance that spots have at
 * least, within which distances are right, and so many lattice steps, near the end of its mesh. */
#define BEYOND 2.0
#define BEYOND_STEPS 2.0
/* Vertices are those known to be hidden where they are this near to them, in lattice steps: what a
 * change moves that does not count, where the field is flat; other surfaces are OV_NECK steps away
 * (mesh/exposed.h). */
#define SAME 0.75

/* What is meshed of the model in the box. */
typedef struct excerpt {
    const ov_box *box;
    ovoid_mesh *mesh;
    float *distance;          /* theirs */
    ov_trail trail, own;      /* of the mesh; of the original in the box, if nobody has it, */
    const ov_trail *original; /* and whoever has it */
    float *from_original;     /* of all of the original's vertices */
} excerpt;

static void excerpt_destroy(excerpt *e) {
    ov_trail_destroy(&e->trail);
    ov_trail_destroy(&e->own);
    ovoid_mesh_destroy(&e->mesh);
    free(e->distance);
    free(e->from_original);
}

static bool is_in(const ov_box *box, const double at[3]) {
    return ov_box_near(box, at, 0.0);
}

double ov_excerpt_room(const ov_judge *judge, double least) {
    return BEYOND * least + BEYOND_STEPS * judge->meshing.spacing;
}

/* ---- what is exposed ------------------------------------------------------------------------- */

/* A share of a step: nothing else that lies in a plane of the lattice is so near to it. */
#define IN_PLANE 1e-3

/* The components that are open where the mesh ends. */
static void find_open(const ov_excerpt_asked *asked, const excerpt *e, bool *open) {
    const ov_box ends = ov_marcher_ends(asked->marcher),
                 within = ov_box_larger(&ends, -IN_PLANE * asked->judge->meshing.spacing);
    for (size_t v = 0; v < e->mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(e->mesh, v, at);
        if (!is_in(&within, at))
            open[e->mesh->component_of[v]] = true;
    }
}

/* An open component has no volume to tell by whether it is an outer one: it is if it leaves the box
 * anywhere where nothing was hidden when the model was seen last. */
static ovoid_status find_outer_as_seen(const ov_excerpt_asked *asked, const excerpt *e,
                                       const bool *open) {
    ovoid_status status = OVOID_OK;
    const ov_judge *const judge = asked->judge;
    const ov_seen *const seen = &judge->seen;
    ovoid_mesh *const mesh = e->mesh;
    ov_grid grid = {0};
    if (seen->hidden_count > 0)
        OV_TRY(ov_grid_of(judge->context, seen->hidden, 3 * sizeof *seen->hidden,
                          seen->hidden_count, SAME * judge->meshing.spacing, &grid));
    for (size_t v = 0; v < mesh->vertices; ++v) {
        const uint32_t own = mesh->component_of[v];
        uint32_t near[2 * OV_NEAR_MAX];
        double at[3];
        if (!open[own] || mesh->component[own].outer)
            continue;
        ov_mesh_at(mesh, v, at);
        mesh->component[own].outer =
            !is_in(e->box, at) &&
            (seen->hidden_count == 0 || ov_grid_near(&grid, at, UINT32_MAX, near) == 0);
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

/* The same where no more than the box counts: it is outer if the original is exposed near to most
 * of what leaves the box. Some of its vertices tell that of all. */
#define ASKED_EVERY 8

static ovoid_status find_outer_as_original(const ov_excerpt_asked *asked, const excerpt *e,
                                           const bool *open) {
    const ov_region *const region = asked->region;
    ovoid_mesh *const mesh = e->mesh;
    int32_t *const votes =
        ov_alloc(asked->judge->context, mesh->components, sizeof *votes, "pieces of a mesh");
    if (!votes)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < mesh->vertices; v += ASKED_EVERY) {
        const uint32_t own = mesh->component_of[v];
        double at[3];
        ov_mesh_at(mesh, v, at);
        if (!open[own] || is_in(e->box, at) || region->outside_count == 0)
            continue;
        const uint32_t nearest =
            ov_grid_nearest(&region->grid, region->outside, 3 * sizeof *region->outside, at);
        if (nearest != OV_NOBODY)
            votes[own] += region->hidden[nearest] ? -1 : 1;
    }
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].outer = open[c] ? votes[c] >= 0 : mesh->component[c].outer;
    free(votes);
    return OVOID_OK;
}

/* And which cavities are exposed because they come near to those. */
static ovoid_status find_exposed(const ov_excerpt_asked *asked, excerpt *e) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = asked->judge->context;
    bool *open = NULL;
    OV_TRY(ov_mesh_connect(context, e->mesh));
    open = ov_alloc(context, e->mesh->components, sizeof *open, "pieces of a mesh");
    if (!open)
        return OVOID_ERROR_MEMORY;
    find_open(asked, e, open);
    for (size_t c = 0; c < e->mesh->components; ++c)
        e->mesh->component[c].outer &= !open[c];
    OV_TRY(asked->region ? find_outer_as_original(asked, e, open)
                         : find_outer_as_seen(asked, e, open));
    OV_TRY(ov_mesh_expose(context, e->mesh));
cleanup:
    free(open);
    return status;
}

ovoid_status ov_seen_hide(ovoid_context *context, ov_seen *seen, const double at[3]) {
    const ovoid_status status =
        ov_grow(context, (void *)&seen->hidden, &seen->hidden_capacity,
                3 * (seen->hidden_count + 1), sizeof *seen->hidden, "points of a mesh");
    if (status == OVOID_OK)
        memcpy(seen->hidden + 3 * seen->hidden_count++, at, 3 * sizeof *at);
    return status;
}

/* What is hidden in the box is what is hidden there now; where no more than the box counts, all. */
static ovoid_status renew_hidden(const ov_excerpt_asked *asked, const excerpt *e) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = asked->judge;
    ov_seen *const seen = &judge->seen;
    size_t kept = 0;
    double at[3];
    for (size_t n = 0; n < seen->hidden_count; ++n)
        if (!asked->region && !is_in(e->box, seen->hidden + 3 * n))
            memmove(seen->hidden + 3 * kept++, seen->hidden + 3 * n, 3 * sizeof *seen->hidden);
    seen->hidden_count = kept;
    for (size_t v = 0; v < e->mesh->vertices; ++v) {
        ov_mesh_at(e->mesh, v, at);
        if (!ov_mesh_is_exposed(e->mesh, v) && (asked->region || is_in(e->box, at)))
            OV_TRY(ov_seen_hide(judge->context, seen, at));
    }
cleanup:
    return status;
}

/* ---- the two surfaces ------------------------------------------------------------------------ */

/* How far beyond its end a mesh needs all terms, lattice steps. */
#define LATTICE_BEYOND 2.0

/* Those that reach a box, to be freed. */
static ovoid_status choose_quadrics(const ov_excerpt_asked *asked, const ov_box *box, double least,
                                    ov_quadric **chosen, size_t *count) {
    *count = 0;
    *chosen = ov_alloc(asked->judge->context, asked->count, sizeof **chosen, "ellipsoids");
    if (!*chosen)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < asked->count; ++i)
        if (ov_quadric_meets(&asked->quadrics[i], least, box->low, box->high))
            (*chosen)[(*count)++] = asked->quadrics[i];
    return OVOID_OK;
}

/* Without its components. mesh stays NULL where the model has no surface there. */
static ovoid_status mesh_excerpt(const ov_excerpt_asked *asked, excerpt *e) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = asked->judge;
    const double cutoff = ov_judge_cutoff(judge, asked->least);
    const ov_box room = ov_box_larger(e->box, ov_excerpt_room(judge, asked->least)),
                 reached = ov_box_larger(&room, LATTICE_BEYOND * judge->meshing.spacing);
    size_t some;
    ov_quadric *chosen = NULL;
    ov_body *bodies = NULL;
    OV_TRY(choose_quadrics(asked, &reached, cutoff * judge->meshing.isovalue, &chosen, &some));
    OV_TRY(ov_bodies_of_quadrics(judge->context, chosen, some, &bodies));
    ov_marcher_clip(asked->marcher, room.low, room.high);
    ov_marcher_cut_off(asked->marcher, cutoff);
    OV_TRY(ov_mesh_bodies_light(judge->context, asked->marcher, bodies, some, &judge->meshing,
                                judge->origin, &judge->watch, false, &e->mesh));
cleanup:
    if (status == OVOID_ERROR_EMPTY || status == OVOID_ERROR_LIMIT)
        status = OVOID_OK;
    free(bodies);
    free(chosen);
    return status;
}

ovoid_status ov_excerpt_original(const ov_judge *judge, const ov_box *box, ov_trail *trail) {
    const ovoid_mesh *const mesh = judge->mesh;
    bool *const in =
        ov_alloc(judge->context, mesh->vertices + mesh->triangles, sizeof *in, "points of a mesh");
    if (!in)
        return OVOID_ERROR_MEMORY;
    bool *const chosen = in + mesh->vertices;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        in[v] = is_in(box, at);
    }
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        chosen[t] = in[corner[0]] || in[corner[1]] || in[corner[2]];
    }
    const ovoid_status status = ov_trail_choose(judge->context, mesh, chosen, trail);
    free(in);
    return status;
}

static ovoid_status prepare(const ov_excerpt_asked *asked, excerpt *e) {
    ovoid_context *const context = asked->judge->context;
    const size_t vertices = asked->judge->mesh->vertices;
    e->distance = ov_alloc(context, e->mesh->vertices, sizeof *e->distance, "distances");
    e->from_original = ov_alloc(context, vertices, sizeof *e->from_original, "distances");
    e->original = asked->region ? &asked->region->own : &e->own;
    if (!e->distance || !e->from_original)
        return OVOID_ERROR_MEMORY;
    return asked->region ? OVOID_OK : ov_excerpt_original(asked->judge, e->box, &e->own);
}

/* How far the model is from the original, which the device finds while the host finds what is
 * exposed, and the other way. */
static ovoid_status measure(const ov_excerpt_asked *asked, excerpt *e) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = asked->judge;
    ovoid_context *const context = judge->context;
    judge->meter.watch = judge->back.watch = &judge->watch;
    judge->meter.enough = judge->back.enough = ov_judge_enough(judge, asked->least);
    judge->back.within = judge->meter.within = asked->box;
    OV_TRY(prepare(asked, e));
    OV_TRY(ov_trail_create(context, e->mesh, false, &e->trail));
    OV_TRY(ov_facets_set(context, &judge->other, &e->trail, judge->origin));
    OV_TRY(ov_vertex_distances_begin(context, &judge->back, &judge->facets, &judge->other,
                                     e->distance));
    OV_TRY(find_exposed(asked, e));
    OV_TRY(renew_hidden(asked, e));
    OV_TRY(ov_vertex_distances_end(context, &judge->back, &judge->other, e->distance));
    if (e->original->vertices > 0)
        OV_TRY(ov_trail_distances(context, &judge->meter, &judge->other, e->original,
                                  e->from_original));
cleanup:
    ov_later_end(context, &judge->back.later); /* what is under way writes to the excerpt */
    judge->back.within = judge->meter.within = NULL;
    return status;
}

/* ---- spots ----------------------------------------------------------------------------------- */

/* Whether a vertex counts, and is of an outer surface. */
static bool counts(const excerpt *e, const ov_judge *judge, const ov_trail *from, uint32_t v,
                   double distance, double at[3]) {
    bool outer;
    ov_mesh_at(from->mesh, v, at);
    return is_in(e->box, at) && ov_judge_counts(judge, from->mesh, v, distance, &outer) && outer;
}

/* Spots at the trail's vertices and inside its triangles. distance: where triangles are looked
 * into, what does not count gets -1. */
static ovoid_status find_spots(const ov_excerpt_asked *asked, const excerpt *e, ov_meter *meter,
                               ov_facets *to, const ov_trail *from, float *distance,
                               ov_spot_list *found, double *farthest) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = asked->judge;
    const bool inside = judge->slack > 0.0;
    ov_listing listing = {judge->context, found};
    const ov_limits limits = {
        .limit = asked->least, .slack = judge->slack, .found = ov_list_spot, .user = &listing};
    bool whole;
    for (size_t k = 0; k < from->vertices; ++k) {
        const uint32_t v = ov_trail_vertex(from, k);
        double at[3];
        if (!inside && distance[v] < asked->least && distance[v] <= *farthest)
            continue;
        if (!counts(e, judge, from, v, distance[v], at)) {
            distance[v] = -1.0f;
            continue;
        }
        *farthest = fmax(*farthest, distance[v]);
        if (distance[v] >= asked->least)
            OV_TRY(ov_list_spot(at, distance[v], &listing));
    }
    if (inside)
        OV_TRY(ov_bound_exceed(judge->context, meter, to, from, distance, &limits, &whole));
cleanup:
    return status;
}

ovoid_status ov_excerpt_look(const ov_excerpt_asked *asked, ov_spot_list *found, double *farthest,
                             bool *known) {
    ovoid_status status = OVOID_OK;
    ov_judge *const judge = asked->judge;
    excerpt e = {.box = asked->box};
    OV_TRY(mesh_excerpt(asked, &e));
    *known = e.mesh;
    if (!e.mesh)
        goto cleanup;
    OV_TRY(measure(asked, &e));
    OV_TRY(
        find_spots(asked, &e, &judge->back, &judge->facets, &e.trail, e.distance, found, farthest));
    OV_TRY(find_spots(asked, &e, &judge->meter, &judge->other, e.original, e.from_original, found,
                      farthest));
cleanup:
    excerpt_destroy(&e);
    return status;
}
