#include "measure/judge.h"

#include "measure/bound.h"
#include "model/factor.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* How much the whole surface's distance, cavities included, counts beside the outer one's, and the
 * area's relative error (angstrom). */
#define SCORE_WHOLE 0.1
#define SCORE_AREA 10.0
/* Where spots are looked for, distances below this share of theirs are only bounded. Where they are
 * looked for inside triangles, too, what is bounded has to leave room for how much farther than its
 * corners a triangle may be, for most of them this many lattice steps. */
#define ENOUGH 0.8
#define ENOUGH_INSIDE 0.7

/* The light mesh of some bodies, with normals where its area and its volume are wanted; its
 * components are still to be found. *mesh is NULL where there is no surface. */
static ovoid_status mesh_bodies(const ov_judge *judge, const ov_body *bodies, size_t count,
                                bool normals, ovoid_mesh **mesh) {
    *mesh = NULL;
    const ovoid_status status =
        ov_mesh_bodies_light(judge->context, judge->marcher, bodies, count, &judge->meshing,
                             judge->origin, &judge->watch, normals, mesh);
    return status == OVOID_ERROR_EMPTY ? OVOID_OK : status;
}

/* Finds its components and, unless content is NULL, its area and volume, after which the normals
 * have done their part. */
static ovoid_status finish_mesh(const ov_judge *judge, ovoid_mesh *mesh, ov_content *content) {
    const ovoid_status status = ov_mesh_finish(judge->context, mesh);
    if (status == OVOID_OK && content)
        *content = ov_mesh_smooth(mesh, false);
    free(mesh->normals);
    mesh->normals = NULL;
    return status;
}

/* The middle of the atoms' box. */
static void middle_of(const double *xyzr, size_t atoms, double origin[3]) {
    for (size_t k = 0; k < 3; ++k) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < atoms; ++i) {
            low = fmin(low, xyzr[4 * i + k]);
            high = fmax(high, xyzr[4 * i + k]);
        }
        origin[k] = atoms > 0 ? 0.5 * low + 0.5 * high : 0.0;
    }
}

static bool has_outer(const ovoid_mesh *mesh) {
    for (size_t c = 0; mesh && c < mesh->components; ++c)
        if (mesh->component[c].outer)
            return true;
    return false;
}

static ovoid_status mesh_original(ov_judge *judge, const double *xyzr, size_t atoms, double decay) {
    ov_body *const bodies = ov_alloc(judge->context, atoms, sizeof *bodies, "atoms");
    if (!bodies)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < atoms; ++i)
        ov_body_of_atom(xyzr + 4 * i, decay, &bodies[i]);
    const ovoid_status status = mesh_bodies(judge, bodies, atoms, true, &judge->mesh);
    free(bodies);
    return status != OVOID_OK || !judge->mesh ? status
                                              : finish_mesh(judge, judge->mesh, &judge->content);
}

ovoid_status ov_judge_create(ovoid_context *context, const double *xyzr, size_t atoms, double decay,
                             double isovalue, double spacing, ov_watch watch, ov_judge *judge) {
    ovoid_status status = OVOID_OK;
    ov_judge made = {.context = context, .root_2d = sqrt(2.0 * decay), .watch = watch};
    ovoid_mesh_options_init(&made.meshing, sizeof made.meshing);
    made.meshing.isovalue = isovalue;
    made.meshing.spacing = spacing;
    middle_of(xyzr, atoms, made.origin);
    OV_TRY(ov_marcher_create(context, &made.marcher));
    OV_TRY(mesh_original(&made, xyzr, atoms, decay));
    ov_marcher_stay(made.marcher);
    *judge = made;
cleanup:
    if (status != OVOID_OK)
        ov_judge_destroy(&made);
    return status;
}

void ov_judge_begin(ov_judge *judge) {
    ov_marcher_begin(judge->marcher);
}

void ov_judge_destroy(ov_judge *judge) {
    ov_marcher_destroy(&judge->marcher);
    ov_meter_destroy(&judge->meter);
    ov_meter_destroy(&judge->back);
    ov_facets_destroy(&judge->facets);
    ov_facets_destroy(&judge->other);
    ov_trail_destroy(&judge->trail);
    ovoid_mesh_destroy(&judge->mesh);
    free(judge->excused);
    memset(judge, 0, sizeof *judge);
}

static ovoid_status mesh_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                               bool normals, ovoid_mesh **mesh) {
    ov_body *bodies = NULL;
    ovoid_status status = ov_bodies_of_quadrics(judge->context, quadrics, count, &bodies);
    if (status != OVOID_OK)
        return status;
    status = mesh_bodies(judge, bodies, count, normals, mesh);
    free(bodies);
    if (status != OVOID_ERROR_LIMIT)
        return status;
    *mesh = NULL; /* what was merged across empty space is no surface to compare with */
    return OVOID_OK;
}

static int by_distance(const void *a, const void *b) {
    const ov_spot *const p = a, *const q = b;
    if (p->distance != q->distance)
        return p->distance > q->distance ? -1 : 1;
    for (int k = 0; k < 3; ++k)
        if (p->at[k] != q->at[k])
            return p->at[k] < q->at[k] ? -1 : 1;
    return 0;
}

bool ov_spots_near(const ov_spot *spots, size_t count, const double at[3], double reach) {
    for (size_t n = 0; n < count; ++n) {
        const double x = at[0] - spots[n].at[0], y = at[1] - spots[n].at[1],
                     z = at[2] - spots[n].at[2];
        if (x * x + y * y + z * z < reach * reach)
            return true;
    }
    return false;
}

/* Whether it is no wonder that a point is so far off. */
static bool is_excused(const ov_judge *judge, const double at[3], double distance) {
    for (size_t n = 0; n < judge->excused_count; ++n)
        if (distance <= judge->excused_times * judge->excused[n].distance &&
            ov_spots_near(&judge->excused[n], 1, at, judge->excused_reach))
            return true;
    return false;
}

/* Whether a vertex is where surfaces count. */
static bool is_judged(const ov_judge *judge, const double at[3], double distance) {
    for (int k = 0; k < 3; ++k)
        if ((at[k] < judge->low[k] || at[k] > judge->high[k]) && distance <= judge->stray)
            return false;
    return !is_excused(judge, at, distance);
}

/* Whether a vertex that is so far off counts; *outer: as one of an outer surface. */
static bool counts(const ov_judge *judge, const ovoid_mesh *mesh, size_t vertex, double distance,
                   bool *outer) {
    double at[3];
    *outer = judge->whole || ov_mesh_is_exposed(mesh, vertex);
    if (!judge->in_region)
        return true;
    ov_mesh_at(mesh, vertex, at);
    *outer |= ov_spots_near(judge->wanted, judge->wanted_count, at, judge->excused_reach);
    return is_judged(judge, at, distance);
}

/* Counts them alone where spots is NULL. */
static void add_spots(const ov_judge *judge, const ovoid_mesh *mesh, const float *distance,
                      double least, ov_spot *spots, size_t *count) {
    bool outer;
    for (size_t v = 0; v < mesh->vertices; ++v)
        if (distance[v] >= least && counts(judge, mesh, v, distance[v], &outer) && outer) {
            if (spots) {
                ov_mesh_at(mesh, v, spots[*count].at);
                spots[*count].distance = distance[v];
            }
            ++*count;
        }
}

/* What rounding may add to a distance in a grid, as a share. */
#define ROUNDING 1e-4

/* Whether one of the spots in the grid is nearer than that. */
static bool has_near(const ov_grid *grid, const ov_spot *spots, const double at[3], double apart) {
    uint32_t near[2 * OV_NEAR_MAX];
    const size_t count = ov_grid_near(grid, at, UINT32_MAX, near);
    for (size_t n = 0; n < count; ++n) {
        double square = 0.0;
        for (size_t k = 0; k < 3; ++k)
            square += (at[k] - spots[near[n]].at[k]) * (at[k] - spots[near[n]].at[k]);
        if (square < apart * apart)
            return true;
    }
    return false;
}

ovoid_status ov_spots_thin(ovoid_context *context, ov_spot *spots, size_t *count, double apart,
                           size_t most) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    size_t kept = 0;
    if (*count == 0)
        return OVOID_OK;
    qsort(spots, *count, sizeof *spots, by_distance);
    if (apart > 0.0)
        OV_TRY(ov_grid_about(context, spots->at, sizeof *spots, *count, (1.0 + ROUNDING) * apart,
                             &grid));
    for (size_t n = 0; n < *count && kept < most; ++n) {
        if (apart > 0.0 && has_near(&grid, spots, spots[n].at, apart))
            continue;
        spots[kept] = spots[n];
        if (apart > 0.0)
            OV_TRY(ov_grid_add(context, &grid, spots[kept].at, (uint32_t)kept));
        ++kept;
    }
    *count = kept;
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

static void judge_distances(const ov_judge *judge, const ovoid_mesh *mesh, const float *distance,
                            ov_judgement *judgement) {
    bool outer;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        if (distance[v] <= judgement->deviation || !counts(judge, mesh, v, distance[v], &outer))
            continue; /* the deviation is never above the other */
        judgement->hausdorff = fmax(judgement->hausdorff, distance[v]);
        if (outer)
            judgement->deviation = distance[v];
    }
}

/* A model's mesh, and how far its vertices and those of the original are from the other surface. */
typedef struct trial {
    ovoid_mesh *mesh;
    ov_trail trail;                    /* of the mesh */
    float *from_original, *from_model; /* NULL where there are no two outer surfaces */
    ov_spot *inside;                   /* spots that are no vertices */
    size_t inside_count, inside_room;
} trial;

static void trial_destroy(trial *t) {
    free(t->from_original);
    free(t->from_model);
    free(t->inside);
    ov_trail_destroy(&t->trail);
    ovoid_mesh_destroy(&t->mesh);
}

/* Not before somebody asks for distances: of a part that is to have a number of ellipsoids nobody
 * does, and the facets are the largest that a judge has on the device. */
static ovoid_status lay_original(ov_judge *judge) {
    ovoid_status status = OVOID_OK;
    if (judge->laid)
        return OVOID_OK;
    if (!judge->trail.mesh)
        OV_TRY(ov_trail_create(judge->context, judge->mesh, false, &judge->trail));
    OV_TRY(ov_facets_set(judge->context, &judge->facets, &judge->trail, judge->origin));
    judge->laid = true;
cleanup:
    return status;
}

/* Where both surfaces are there, how far they are from one another; the device looks for that while
 * the host finds out what else there is to know of the model's. */
static ovoid_status measure_trial(ov_judge *judge, double enough, trial *t, ov_content *content) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = judge->context;
    t->from_original =
        ov_alloc(context, judge->mesh->vertices, sizeof *t->from_original, "distances");
    t->from_model = ov_alloc(context, t->mesh->vertices, sizeof *t->from_model, "distances");
    if (!t->from_original || !t->from_model) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(lay_original(judge));
    judge->meter.watch = judge->back.watch = &judge->watch;
    judge->meter.enough = judge->back.enough = enough;
    OV_TRY(ov_trail_create(context, t->mesh, false, &t->trail));
    OV_TRY(ov_facets_set(context, &judge->other, &t->trail, judge->origin));
    OV_TRY(ov_vertex_distances_begin(context, &judge->meter, &judge->other, &judge->facets,
                                     t->from_original));
    OV_TRY(ov_vertex_distances_begin(context, &judge->back, &judge->facets, &judge->other,
                                     t->from_model));
    OV_TRY(finish_mesh(judge, t->mesh, content));
    OV_TRY(ov_vertex_distances_end(context, &judge->meter, &judge->facets, t->from_original));
    OV_TRY(ov_vertex_distances_end(context, &judge->back, &judge->other, t->from_model));
cleanup:
    ov_later_end(context, &judge->meter.later); /* what is under way writes to the trial */
    ov_later_end(context, &judge->back.later);
    return status;
}

/* content may be NULL. */
static ovoid_status try_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                              double enough, trial *t, ov_content *content,
                              ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    *judgement = (ov_judgement){.hausdorff = INFINITY, .deviation = INFINITY, .score = INFINITY};
    OV_TRY(mesh_model(judge, quadrics, count, content, &t->mesh));
    if (!t->mesh || !has_outer(judge->mesh))
        goto cleanup;
    OV_TRY(measure_trial(judge, enough, t, content));
    if (!has_outer(t->mesh))
        goto cleanup;
    *judgement =
        (ov_judgement){.valid = true, .area_error = NAN, .volume_ratio = NAN, .score = NAN};
    judge_distances(judge, judge->mesh, t->from_original, judgement);
    judge_distances(judge, t->mesh, t->from_model, judgement);
cleanup:
    return status;
}

/* ---- spots ---------------------------------------------------------------------------------- */

/* Whose spots are looked for. */
typedef struct looking {
    const ov_judge *judge;
    trial *t;
} looking;

static ovoid_status add_inside(const double at[3], double distance, void *user) {
    const looking *const l = user;
    trial *const t = l->t;
    const ovoid_status status = ov_grow(l->judge->context, (void *)&t->inside, &t->inside_room,
                                        t->inside_count + 1, sizeof *t->inside, "spots");
    if (status == OVOID_OK)
        t->inside[t->inside_count++] = (ov_spot){.at = {at[0], at[1], at[2]}, .distance = distance};
    return status;
}

/* Spots inside the triangles of one of the meshes; those with corners that do not count do not. */
static ovoid_status look_inside(const ov_judge *judge, ov_meter *meter, ov_facets *to,
                                const ov_trail *from, const float *distance, double least,
                                trial *t) {
    looking l = {judge, t};
    const ov_limits limits = {
        .limit = least, .slack = judge->slack, .found = add_inside, .user = &l};
    bool whole, outer;
    float *const counted =
        ov_alloc(judge->context, from->mesh->vertices, sizeof *counted, "distances");
    if (!counted)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < from->mesh->vertices; ++v)
        counted[v] =
            counts(judge, from->mesh, v, distance[v], &outer) && outer ? distance[v] : -1.0f;
    const ovoid_status status =
        ov_bound_exceed(judge->context, meter, to, from, counted, &limits, &whole);
    free(counted);
    return status;
}

/* In both directions. */
static ovoid_status look_inside_both(ov_judge *judge, double least, trial *t,
                                     ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    OV_TRY(look_inside(judge, &judge->meter, &judge->other, &judge->trail, t->from_original, least,
                       t));
    OV_TRY(look_inside(judge, &judge->back, &judge->facets, &t->trail, t->from_model, least, t));
    for (size_t n = 0; n < t->inside_count; ++n)
        judgement->deviation = fmax(judgement->deviation, t->inside[n].distance);
    judgement->hausdorff = fmax(judgement->hausdorff, judgement->deviation);
cleanup:
    return status;
}

static double enough_of(const ov_judge *judge, double least) {
    const double reach = judge->slack > 0.0 ? ENOUGH_INSIDE * judge->meshing.spacing : 0.0;
    return fmax(fmin(ENOUGH * least, least - reach), 0.0);
}

/* *spots: of the trial's surfaces; free with free(). */
static ovoid_status collect_spots(ov_judge *judge, const trial *t, double least, double apart,
                                  size_t most, ov_spot **spots, size_t *spot_count) {
    size_t room = t->inside_count;
    *spot_count = 0;
    add_spots(judge, judge->mesh, t->from_original, least, NULL, &room);
    add_spots(judge, t->mesh, t->from_model, least, NULL, &room);
    *spots = ov_alloc(judge->context, room, sizeof **spots, "spots");
    if (!*spots)
        return OVOID_ERROR_MEMORY;
    add_spots(judge, judge->mesh, t->from_original, least, *spots, spot_count);
    add_spots(judge, t->mesh, t->from_model, least, *spots, spot_count);
    for (size_t n = 0; n < t->inside_count; ++n)
        (*spots)[(*spot_count)++] = t->inside[n];
    return ov_spots_thin(judge->context, *spots, spot_count, apart, most);
}

ovoid_status ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                            double apart, size_t most, ov_judgement *judgement, ov_spot **spots,
                            size_t *spot_count) {
    ovoid_status status = OVOID_OK;
    trial t = {0};
    *spots = NULL;
    *spot_count = 0;
    OV_TRY(try_model(judge, quadrics, count, enough_of(judge, least), &t, NULL, judgement));
    if (judgement->valid && judge->slack > 0.0)
        OV_TRY(look_inside_both(judge, least, &t, judgement));
    if (judgement->valid)
        OV_TRY(collect_spots(judge, &t, least, apart, most, spots, spot_count));
cleanup:
    if (status != OVOID_OK) {
        free(*spots);
        *spots = NULL;
        *spot_count = 0;
    }
    trial_destroy(&t);
    return status;
}

ovoid_status ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                            ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    trial t = {0};
    ov_content content;
    OV_TRY(try_model(judge, quadrics, count, 0.0, &t, &content, judgement));
    if (!judgement->valid)
        goto cleanup;
    judgement->area_error = fabs(content.area - judge->content.area) / judge->content.area;
    judgement->volume_ratio = content.volume / judge->content.volume;
    judgement->score = judgement->deviation +
                       SCORE_WHOLE * (judgement->hausdorff - judgement->deviation) +
                       (judge->in_region ? 0.0 : SCORE_AREA * judgement->area_error);
cleanup:
    trial_destroy(&t);
    return status;
}

ovoid_status ov_judge_volume(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                             double *ratio) {
    ovoid_mesh *mesh = NULL;
    ov_content content;
    *ratio = 1.0;
    if (!judge->mesh)
        return OVOID_OK;
    ovoid_status status = mesh_model(judge, quadrics, count, true, &mesh);
    if (mesh)
        status = finish_mesh(judge, mesh, &content);
    if (mesh && status == OVOID_OK)
        *ratio = content.volume / judge->content.volume;
    ovoid_mesh_destroy(&mesh);
    return status;
}

/* Mean of |grad phi| / c over the surfaces of molecules, in units of sqrt(2 d). */
#define MEAN_SLOPE 1.5
#define FACTOR_MOST 1.1

double ov_judge_amplitude_factor(const ov_judge *judge, double volume_ratio) {
    if (!judge->mesh || !(judge->content.area > 0.0))
        return 1.0;
    const double per_log = judge->content.area / (MEAN_SLOPE * judge->root_2d);
    const double log_factor = (1.0 - volume_ratio) * judge->content.volume / per_log;
    return fmin(fmax(exp(log_factor), 1.0 / FACTOR_MOST), FACTOR_MOST);
}
