#include "measure/judge.h"

#include "measure/judging.h"
#include "model/factor.h"

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

/* Terms that are left out where spots are looked for: below this share of the isovalue for each
 * 1 / sqrt(2 d) that spots are off, and none above the other. Where it is done closely, with some
 * slack, so much less; without any slack, as in other meshes. */
#define ROUGH_SLOPE 2e-4
#define ROUGH_MOST 1e-4
#define CLOSELY 0.1

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
    OV_TRY(ov_marcher_create(context, &made.near_marcher));
    OV_TRY(mesh_original(&made, xyzr, atoms, decay));
    ov_marcher_stay(made.marcher);
    ov_buffers_trim(context);
    *judge = made;
cleanup:
    if (status != OVOID_OK)
        ov_judge_destroy(&made);
    return status;
}

void ov_judge_begin(ov_judge *judge) {
    ov_marcher_begin(judge->marcher);
    ov_marcher_begin(judge->near_marcher);
    judge->seen.known = false;
}

void ov_judge_destroy(ov_judge *judge) {
    ov_marcher_destroy(&judge->marcher);
    ov_meter_destroy(&judge->meter);
    ov_meter_destroy(&judge->back);
    ov_facets_destroy(&judge->facets);
    ov_facets_destroy(&judge->other);
    ov_seen_destroy(&judge->seen);
    ov_region_destroy(&judge->known);
    ov_marcher_destroy(&judge->near_marcher);
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
    return (ov_box_near(&judge->region, at, 0.0) || distance > judge->stray) &&
           !is_excused(judge, at, distance);
}

bool ov_judge_counts(const ov_judge *judge, const ovoid_mesh *mesh, size_t vertex, double distance,
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
        if (distance[v] >= least && ov_judge_counts(judge, mesh, v, distance[v], &outer) && outer) {
            if (spots) {
                ov_mesh_at(mesh, v, spots[*count].at);
                spots[*count].distance = distance[v];
            }
            ++*count;
        }
}

static void judge_distances(const ov_judge *judge, const ovoid_mesh *mesh, const float *distance,
                            ov_judgement *judgement) {
    bool outer;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        if (distance[v] <= judgement->deviation ||
            !ov_judge_counts(judge, mesh, v, distance[v], &outer))
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
    ov_spot_list inside;               /* spots that are no vertices */
} trial;

static void trial_destroy(trial *t) {
    free(t->from_original);
    free(t->from_model);
    free(t->inside.spot);
    ov_trail_destroy(&t->trail);
    ovoid_mesh_destroy(&t->mesh);
}

ovoid_status ov_judge_lay(ov_judge *judge, const ov_trail *trail) {
    ovoid_status status = OVOID_OK;
    if (judge->laid == trail || (judge->laid && judge->laid == &judge->trail))
        return OVOID_OK;
    judge->laid = NULL;
    OV_TRY(ov_facets_set(judge->context, &judge->facets, trail, judge->origin));
    judge->laid = trail;
cleanup:
    return status;
}

/* All of it. */
static ovoid_status lay_original(ov_judge *judge) {
    ovoid_status status = OVOID_OK;
    if (!judge->trail.mesh)
        OV_TRY(ov_trail_create(judge->context, judge->mesh, false, &judge->trail));
    OV_TRY(ov_judge_lay(judge, &judge->trail));
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

/* Spots inside the triangles of one of the meshes; those with corners that do not count do not. */
static ovoid_status look_inside(const ov_judge *judge, ov_meter *meter, ov_facets *to,
                                const ov_trail *from, const float *distance, double least,
                                trial *t) {
    ov_listing listing = {judge->context, &t->inside};
    const ov_limits limits = {
        .limit = least, .slack = judge->slack, .found = ov_list_spot, .user = &listing};
    bool whole, outer;
    float *const counted =
        ov_alloc(judge->context, from->mesh->vertices, sizeof *counted, "distances");
    if (!counted)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < from->mesh->vertices; ++v)
        counted[v] = ov_judge_counts(judge, from->mesh, v, distance[v], &outer) && outer
                         ? distance[v]
                         : -1.0f;
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
    for (size_t n = 0; n < t->inside.count; ++n)
        judgement->deviation = fmax(judgement->deviation, t->inside.spot[n].distance);
    judgement->hausdorff = fmax(judgement->hausdorff, judgement->deviation);
cleanup:
    return status;
}

double ov_judge_cutoff(const ov_judge *judge, double least) {
    const double rough = fmin(ROUGH_SLOPE * least * judge->root_2d, ROUGH_MOST);
    const double share = !judge->closely ? 1.0 : judge->slack > 0.0 ? CLOSELY : 0.0;
    return fmax(share * rough, OV_MARCH_CUTOFF);
}

double ov_judge_enough(const ov_judge *judge, double least) {
    const double reach = judge->slack > 0.0 ? ENOUGH_INSIDE * judge->meshing.spacing : 0.0;
    return fmax(fmin(ENOUGH * least, least - reach), 0.0);
}

/* *spots: of the trial's surfaces, in no order; free with free(). */
static ovoid_status collect_spots(ov_judge *judge, const trial *t, double least, ov_spot **spots,
                                  size_t *spot_count) {
    size_t room = t->inside.count;
    *spot_count = 0;
    add_spots(judge, judge->mesh, t->from_original, least, NULL, &room);
    add_spots(judge, t->mesh, t->from_model, least, NULL, &room);
    *spots = ov_alloc(judge->context, room, sizeof **spots, "spots");
    if (!*spots)
        return OVOID_ERROR_MEMORY;
    add_spots(judge, judge->mesh, t->from_original, least, *spots, spot_count);
    add_spots(judge, t->mesh, t->from_model, least, *spots, spot_count);
    for (size_t n = 0; n < t->inside.count; ++n)
        (*spots)[(*spot_count)++] = t->inside.spot[n];
    return OVOID_OK;
}

/* All of them, of all of the model. */
static ovoid_status look_everywhere(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                    double least, ov_judgement *judgement, ov_spot **spots,
                                    size_t *spot_count) {
    ovoid_status status = OVOID_OK;
    trial t = {0};
    judge->seen.known = false;
    ov_marcher_cut_off(judge->marcher, ov_judge_cutoff(judge, least));
    OV_TRY(try_model(judge, quadrics, count, ov_judge_enough(judge, least), &t, NULL, judgement));
    if (!judgement->valid)
        goto cleanup;
    if (judge->slack > 0.0)
        OV_TRY(look_inside_both(judge, least, &t, judgement));
    OV_TRY(collect_spots(judge, &t, least, spots, spot_count));
    OV_TRY(ov_judge_remember(judge, quadrics, count, t.mesh, least, *spots, *spot_count));
cleanup:
    trial_destroy(&t);
    return status;
}

/* All of them, where these are all near what has changed. */
static ovoid_status look_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                              double least, ov_judgement *judgement, ov_spot **spots,
                              size_t *spot_count, bool *looked) {
    ov_spot_list found = {0};
    const ovoid_status status = ov_judge_near(judge, quadrics, count, least, &found, looked);
    *judgement =
        (ov_judgement){.valid = true, .area_error = NAN, .volume_ratio = NAN, .score = NAN};
    for (size_t n = 0; n < found.count; ++n)
        judgement->deviation = fmax(judgement->deviation, found.spot[n].distance);
    judgement->hausdorff = judgement->deviation;
    *spots = found.spot;
    *spot_count = found.count;
    return status;
}

/* All of them, where these are all in the judge's region. */
static ovoid_status look_in_region(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   double least, ov_judgement *judgement, ov_spot **spots,
                                   size_t *spot_count, bool *looked) {
    ov_spot_list found = {0};
    double farthest;
    const ovoid_status status =
        ov_judge_region(judge, quadrics, count, least, &found, &farthest, looked);
    *judgement = (ov_judgement){.valid = true,
                                .hausdorff = farthest,
                                .deviation = farthest,
                                .area_error = NAN,
                                .volume_ratio = NAN,
                                .score = NAN};
    *spots = found.spot;
    *spot_count = found.count;
    return status;
}

/* All of them, of all that counts of the model. */
static ovoid_status look_at_all(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                double least, ov_judgement *judgement, ov_spot **spots,
                                size_t *spot_count) {
    bool looked;
    if (!ov_judge_is_regional(judge) || !has_outer(judge->mesh))
        return look_everywhere(judge, quadrics, count, least, judgement, spots, spot_count);
    const ovoid_status status =
        look_in_region(judge, quadrics, count, least, judgement, spots, spot_count, &looked);
    if (status != OVOID_OK || looked)
        return status;
    free(*spots);
    *spots = NULL;
    return look_everywhere(judge, quadrics, count, least, judgement, spots, spot_count);
}

/* near_will_do: also where there are none near what has changed. */
static ovoid_status look(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                         bool near_will_do, ov_judgement *judgement, ov_spot **spots,
                         size_t *spot_count, bool *whole) {
    bool looked;
    const ovoid_status status =
        look_near(judge, quadrics, count, least, judgement, spots, spot_count, &looked);
    *whole = !looked || (*spot_count == 0 && !near_will_do);
    if (status != OVOID_OK || !*whole)
        return status;
    free(*spots);
    *spots = NULL;
    *spot_count = 0;
    return look_at_all(judge, quadrics, count, least, judgement, spots, spot_count);
}

/* Leaves those that are wanted, or none after a failure. */
static ovoid_status thin(ov_judge *judge, ovoid_status status, double apart, size_t most,
                         ov_spot **spots, size_t *spot_count) {
    if (status == OVOID_OK)
        status = ov_spots_thin(judge->context, *spots, spot_count, apart, most);
    if (status != OVOID_OK) {
        free(*spots);
        *spots = NULL;
        *spot_count = 0;
    }
    return status;
}

ovoid_status ov_judge_spots_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                 double least, double apart, size_t most, ov_judgement *judgement,
                                 ov_spot **spots, size_t *spot_count, bool *whole) {
    const ovoid_status status =
        look(judge, quadrics, count, least, true, judgement, spots, spot_count, whole);
    return thin(judge, status, apart, most, spots, spot_count);
}

ovoid_status ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                            double apart, size_t most, ov_judgement *judgement, ov_spot **spots,
                            size_t *spot_count) {
    bool whole;
    const ovoid_status status =
        look(judge, quadrics, count, least, false, judgement, spots, spot_count, &whole);
    return thin(judge, status, apart, most, spots, spot_count);
}

ovoid_status ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                            ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    trial t = {0};
    ov_content content;
    ov_marcher_cut_off(judge->marcher, OV_MARCH_CUTOFF);
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
    ov_marcher_cut_off(judge->marcher, OV_MARCH_CUTOFF);
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
