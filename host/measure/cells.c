#include "measure/cells.h"

#include "base/progress.h"
#include "measure/hands.h"
#include "measure/measure.h"
#include "measure/survey.h"
#include "mesh/march.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* How far about a cell its surfaces are known, at least; what is further from the other surface is
 * looked for in the other cells. */
#define HALO 3.0 /* angstrom */
#define HALO_STEPS 4.0
/* Terms of a shelf's parts, where they are not cells. */
#define SHELF ((size_t)1 << 10)
/* Points that are looked for in other cells at a time: 56 bytes each. */
#define FARS_MOST ((size_t)1 << 21)
/* Cells that are looked at side by side for what is far: a number of its own, so that what comes of
 * it does not depend on how many hands there are. */
#define SEARCHES 16
/* Surfaces of cells that are kept for a second look, bytes. */
#define KEPT_MOST ((size_t)1 << 28)

/* What one of those who look at cells works with. */
typedef struct desk {
    ov_survey_options options;
    ov_taken taken[OV_SURVEY_SIDES];
    double meshing, busy; /* seconds */
} desk;

/* What one look into a cell for points that are far is about. */
typedef struct search {
    size_t cell;
    ov_survey_far **far;  /* the points */
    ov_survey_far *found; /* as they lie to the cell, and are when it has been looked at */
    size_t count, far_capacity, found_capacity;
} search;

typedef struct job {
    ovoid_context *context;
    ov_survey_options options;
    ov_hands *hands;
    desk *desk; /* of each hand */
    ov_shelf shelf[OV_SURVEY_SIDES];
    size_t lead; /* the side whose parts are the cells */
    ov_survey_images images;
    double centre[3]; /* of the images */
    ov_rigid *back;   /* from each image to the unit */
    ov_unit_ends ends;
    ov_survey_cell *cell;
    ov_survey_kept **kept; /* of each cell; NULL: nothing is */
    bool *keeps;           /* cells whose surfaces are to be kept */
    size_t kept_bytes, kept_most, kept_largest, kept_wanted;
    bool *late; /* cells whose points that are far have been left for later */
    size_t cells;
    size_t fars, fars_most; /* points that are looked for in other cells at a time */
    ov_survey_standing standing;
    search *search; /* those under way */
} job;

static ov_box box_of(const job *j, size_t c) {
    ov_box box = j->shelf[j->lead].cut.part[c].cell;
    for (size_t k = 0; j->images.count > 1 && k < 3; ++k) {
        box.low[k] = fmax(box.low[k], j->ends.box.low[k]);
        box.high[k] = fmin(box.high[k], j->ends.box.high[k]);
    }
    return box;
}

static void destroy(job *j) {
    for (size_t h = 0; j->desk && h < ov_hands_count(j->hands); ++h)
        for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
            ov_taken_destroy(&j->desk[h].taken[n]);
    ov_hands_destroy(&j->hands);
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        ov_shelf_destroy(&j->shelf[n]);
    free(j->desk);
    free(j->keeps);
    for (size_t c = 0; j->cell && c < j->cells; ++c)
        ov_survey_cell_destroy(&j->cell[c]);
    for (size_t c = 0; j->kept && c < j->cells; ++c)
        ov_survey_kept_destroy(&j->kept[c]);
    free(j->cell);
    free(j->kept);
    free(j->late);
    free(j->back);
    ov_survey_standing_destroy(&j->standing);
}

static ovoid_status lay_desks(job *j, size_t wanted) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_hands_create(j->context, wanted, &j->hands));
    j->desk = ov_alloc(j->context, ov_hands_count(j->hands), sizeof *j->desk, "threads");
    if (!j->desk)
        return OVOID_ERROR_MEMORY;
    for (size_t h = 0; h < ov_hands_count(j->hands); ++h) {
        j->desk[h].options = j->options;
        j->desk[h].options.meshing = &j->desk[h].meshing;
    }
cleanup:
    return status;
}

/* The images of a unit, and what is told of them from its shelves. */
static ovoid_status prepare_images(job *j, const ov_repeat *repeat) {
    ovoid_status status = OVOID_OK;
    j->back = ov_alloc(j->context, repeat->order, sizeof *j->back, "seams between units");
    if (!j->back)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < repeat->order; ++g)
        j->back[g] = ov_rigid_inverse(&repeat->motion[g]);
    ov_rigid_centre(repeat->motion, repeat->order, j->centre);
    j->images = (ov_survey_images){.image = repeat->motion,
                                   .count = repeat->order,
                                   .spacing = j->options.spacing,
                                   .centre = j->centre};
    OV_TRY(ov_unit_find_ends(j->context, j->shelf[0].field, j->shelf[1].field, j->options.isovalue,
                             j->back, repeat->order, &j->ends));
    j->options.nearest = j->ends.nearest;
cleanup:
    return status;
}

static ovoid_status prepare(job *j, const ovoid_field *fields[OV_SURVEY_SIDES],
                            const ov_cells_options *how) {
    ovoid_status status = OVOID_OK;
    const double least = OV_MARCH_CUTOFF * j->options.isovalue;
    j->lead = fields[0]->count >= fields[1]->count ? 0 : 1;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        OV_TRY(ov_field_check_ellipsoids(j->context, fields[n], j->options.isovalue));
        OV_TRY(ov_field_place(j->context, fields[n]));
        OV_TRY(ov_shelf_create(j->context, fields[n], n == j->lead ? how->most : SHELF, least,
                               &j->shelf[n]));
    }
    if (how->repeat)
        OV_TRY(prepare_images(j, how->repeat));
    j->cells = j->shelf[j->lead].cut.count;
    j->cell = ov_alloc(j->context, j->cells, sizeof *j->cell, "cells of a surface");
    j->kept = ov_alloc(j->context, j->cells, sizeof *j->kept, "cells of a surface");
    j->keeps = ov_alloc(j->context, j->cells, sizeof *j->keeps, "cells of a surface");
    j->late = ov_alloc(j->context, j->cells, sizeof *j->late, "cells of a surface");
    if (!j->cell || !j->kept || !j->keeps || !j->late)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

/* So far about a cell, angstrom, the terms make the surfaces in it and its halo what they are; and
 * those of atoms tell which image a place of it belongs to. */
static double reach_of(const job *j, size_t n) {
    const double reach = j->options.halo + OV_SURVEY_ROOM * j->options.spacing;
    return n == 0 && j->images.count > 1 ? fmax(reach, j->ends.nearest) : reach;
}

/* All that cell c takes; none where its surfaces are kept. */
static ovoid_status take_terms(const job *j, ovoid_context *context, desk *d, size_t c,
                               ov_survey_terms *terms) {
    d->options.cell = (uint32_t)c;
    d->options.image = NULL;
    if (j->kept[c])
        return OVOID_OK;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ov_box box = box_of(j, c);
        for (size_t k = 0; k < 3; ++k) {
            box.low[k] -= reach_of(j, n);
            box.high[k] += reach_of(j, n);
        }
        const ovoid_status status =
            ov_shelf_take(context, &j->shelf[n], &j->images, &box, &d->taken[n]);
        if (status != OVOID_OK)
            return status;
        terms->body[n] = d->taken[n].body;
        terms->count[n] = d->taken[n].count;
    }
    if (j->images.count > 1)
        d->options.image = d->taken[0].image;
    return OVOID_OK;
}

/* ---- each cell by itself --------------------------------------------------------------------- */

static void forget_fars(ov_survey_cell *cell) {
    free(cell->far);
    cell->far = NULL;
    cell->fars = cell->far_capacity = 0;
}

static ovoid_status survey(const job *j, ovoid_context *context, desk *d, size_t c,
                           ov_survey_cell *cell, ov_survey_kept **kept) {
    const ov_box box = box_of(j, c);
    const double began = ov_seconds();
    ov_survey_terms terms;
    ovoid_status status = take_terms(j, context, d, c, &terms);
    if (status == OVOID_OK)
        status = ov_survey_bodies(context, &d->options, &terms, box.low, box.high, cell, kept);
    d->busy += ov_seconds() - began;
    return status;
}

/* As far as is known from the cells before, there is room for the surfaces of one more. */
static void begin_survey(size_t c, void *user) {
    job *const j = user;
    j->keeps[c] = j->options.sums && j->kept_wanted + j->kept_largest <= j->kept_most;
    if (j->keeps[c])
        j->kept_wanted += j->kept_largest;
}

static ovoid_status survey_one(ovoid_context *context, size_t hand, size_t c, void *user) {
    job *const j = user;
    return survey(j, context, &j->desk[hand], c, &j->cell[c], j->keeps[c] ? &j->kept[c] : NULL);
}

static void keep_or_not(job *j, size_t c) {
    const size_t bytes = ov_survey_kept_bytes(j->kept[c]);
    if (j->kept_bytes + bytes > j->kept_most)
        ov_survey_kept_destroy(&j->kept[c]);
    else
        j->kept_bytes += bytes;
    j->kept_largest = bytes > j->kept_largest ? bytes : j->kept_largest;
    j->kept_wanted = j->kept_bytes > j->kept_wanted ? j->kept_bytes : j->kept_wanted;
}

/* A cell with too many points that are far, for now, is left for later. */
static void end_survey(size_t c, void *user) {
    job *const j = user;
    keep_or_not(j, c);
    j->late[c] = j->fars + j->cell[c].fars > j->fars_most;
    if (j->late[c])
        forget_fars(&j->cell[c]);
    j->fars += j->cell[c].fars;
}

static ovoid_status survey_all(job *j) {
    const ov_hands_work work = {j->cells, begin_survey, end_survey, survey_one, j};
    return ov_hands_do(j->hands, &work);
}

/* Where an outer surface was taken for what it is not, or for nothing yet. */
static ovoid_status correct(job *j, ovoid_context *context, desk *d, size_t c) {
    ovoid_status status = OVOID_OK;
    const ov_box box = box_of(j, c);
    const double began = ov_seconds();
    ov_survey_terms terms;
    if (ov_survey_holds(&j->standing, &j->cell[c], c))
        return OVOID_OK;
    OV_TRY(take_terms(j, context, d, c, &terms));
    OV_TRY(ov_survey_again(context, &d->options, &terms, box.low, box.high, &j->standing,
                           j->kept[c], &j->cell[c]));
cleanup:
    d->busy += ov_seconds() - began;
    return status;
}

static ovoid_status correct_one(ovoid_context *context, size_t hand, size_t c, void *user) {
    job *const j = user;
    return j->late[c] ? OVOID_OK : correct(j, context, &j->desk[hand], c);
}

static ovoid_status correct_all(job *j) {
    const ov_hands_work work = {j->cells, NULL, NULL, correct_one, j};
    return ov_hands_do(j->hands, &work);
}

/* ---- what is far ----------------------------------------------------------------------------- */

/* Where nothing was within reach: as far as to one vertex of a piece. */
static void bound_far(const job *j, ov_survey_far *far) {
    const size_t n = 1 - far->side;
    for (size_t c = 0; c < j->cells; ++c)
        for (size_t p = 0; p < j->cell[c].side[n].pieces; ++p) {
            const double *const at = j->cell[c].side[n].piece[p].at;
            if (far->outer && !j->standing.outer[n][j->standing.first[n][c] + p])
                continue;
            const ov_box place = {{at[0], at[1], at[2]}, {at[0], at[1], at[2]}};
            far->distance = fmin(far->distance, ov_box_distance(&place, far->at));
        }
}

/* Whether something in cell c, or in image g of it, may be nearer to it. at gets where the point
 * lies to the cell from there. */
static bool may_be_near(const job *j, size_t c, size_t g, const ov_survey_far *far, double at[3]) {
    const ov_box box = box_of(j, c);
    if (j->cell[c].side[1 - far->side].pieces == 0 || (g == 0 && far->cell == c))
        return false;
    memcpy(at, far->at, sizeof far->at);
    if (g > 0)
        ov_rigid_move(&j->back[g], far->at, at);
    return ov_box_distance(&box, at) < far->distance;
}

static ovoid_status add_search(const job *j, ov_survey_far *far, const double at[3], search *made) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(j->context, &made->far, &made->far_capacity, made->count + 1, sizeof(void *),
                   "points that are far"));
    OV_TRY(ov_grow(j->context, &made->found, &made->found_capacity, made->count + 1,
                   sizeof *made->found, "points that are far"));
    made->far[made->count] = far;
    made->found[made->count] = *far;
    memcpy(made->found[made->count++].at, at, sizeof far->at);
cleanup:
    return status;
}

/* Copies of the points change until all searches under way have ended, so that none of them
 * depends on another. */
static ovoid_status choose_fars(const job *j, size_t c, ov_survey_far *const *far, size_t count,
                                search *made) {
    ovoid_status status = OVOID_OK;
    *made = (search){.cell = c};
    for (size_t k = 0; k < count; ++k)
        for (size_t g = 0; g < j->images.count; ++g) {
            double at[3];
            if (may_be_near(j, c, g, far[k], at))
                OV_TRY(add_search(j, far[k], at, made));
        }
cleanup:
    return status;
}

static ovoid_status search_one(ovoid_context *context, size_t hand, size_t n, void *user) {
    job *const j = user;
    desk *const d = &j->desk[hand];
    ovoid_status status = OVOID_OK;
    const search *const s = &j->search[n];
    const ov_box box = box_of(j, s->cell);
    const double began = ov_seconds();
    ov_survey_terms terms;
    OV_TRY(take_terms(j, context, d, s->cell, &terms));
    OV_TRY(ov_survey_seek(context, &d->options, &terms, box.low, box.high, &j->standing,
                          &j->cell[s->cell], j->kept[s->cell], s->found, s->count));
cleanup:
    d->busy += ov_seconds() - began;
    return status;
}

static void end_searches(search *searches, size_t count) {
    for (size_t n = 0; n < count; ++n) {
        for (size_t k = 0; searches[n].found && k < searches[n].count; ++k)
            searches[n].far[k]->distance =
                fmin(searches[n].far[k]->distance, searches[n].found[k].distance);
        free(searches[n].far);
        free(searches[n].found);
    }
}

/* Looks for these points in the cells from first on, in so many that have to be looked at; *end:
 * in those before it. */
static ovoid_status seek_in(job *j, ov_survey_far *const *far, size_t count, size_t first,
                            size_t *end) {
    ovoid_status status = OVOID_OK;
    search searches[SEARCHES] = {{0}};
    size_t under_way = 0;
    for (*end = first; *end < j->cells && under_way < SEARCHES; ++*end) {
        OV_TRY(ov_progress_step(j->context, *end, j->cells));
        OV_TRY(choose_fars(j, *end, far, count, &searches[under_way]));
        under_way += searches[under_way].count > 0;
    }
    j->search = searches;
    const ov_hands_work work = {under_way, NULL, NULL, search_one, j};
    OV_TRY(ov_hands_do(j->hands, &work));
cleanup:
    j->search = NULL;
    end_searches(searches, SEARCHES);
    return status;
}

/* Looks for these points in all cells. */
static ovoid_status seek(job *j, ov_survey_far *const *far, size_t count) {
    ovoid_status status = OVOID_OK;
    for (size_t k = 0; k < count; ++k) {
        OV_TRY(ov_progress_ask(j->context));
        if (isinf(far[k]->distance))
            bound_far(j, far[k]);
    }
    for (size_t first = 0; first < j->cells;)
        OV_TRY(seek_in(j, far, count, first, &first));
cleanup:
    return status;
}

/* Finds the distances of what is far in cells from first to end. */
static ovoid_status settle(job *j, size_t first, size_t end) {
    ovoid_status status = OVOID_OK;
    size_t count = 0, next = 0;
    ov_survey_far **far = NULL;
    for (size_t c = first; c < end; ++c)
        count += j->cell[c].fars;
    if (count == 0)
        return OVOID_OK;
    far = ov_alloc(j->context, count, sizeof(void *), "points that are far");
    if (!far)
        return OVOID_ERROR_MEMORY;
    for (size_t c = first; c < end; ++c)
        for (size_t k = 0; k < j->cell[c].fars; ++k)
            far[next++] = &j->cell[c].far[k];
    OV_TRY(seek(j, far, count));
    for (size_t k = 0; k < count; ++k)
        ov_survey_settle(far[k], &j->cell[far[k]->cell]);
    for (size_t c = first; c < end; ++c)
        forget_fars(&j->cell[c]);
cleanup:
    free(far);
    return status;
}

/* Cells of which too much was far, one after the other. */
static ovoid_status settle_late(job *j) {
    ovoid_status status = OVOID_OK;
    for (size_t c = 0; c < j->cells; ++c) {
        ov_survey_cell fresh = {0};
        if (!j->late[c])
            continue;
        ov_survey_kept_destroy(&j->kept[c]);
        OV_TRY(survey(j, j->context, &j->desk[0], c, &fresh, NULL));
        ov_survey_cell_destroy(&j->cell[c]);
        j->cell[c] = fresh;
        OV_TRY(correct(j, j->context, &j->desk[0], c));
        OV_TRY(settle(j, c, c + 1));
    }
cleanup:
    return status;
}

/* ---- all of them ----------------------------------------------------------------------------- */

/* A surface that is nowhere: says why. */
static ovoid_status check_surfaces(job *j, const ovoid_field **empty) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ovoid_mesh_options meshing = {.size = sizeof meshing,
                                      .isovalue = j->options.isovalue,
                                      .spacing = j->options.spacing,
                                      .vertices = j->options.vertices};
        ovoid_mesh *none = NULL;
        size_t pieces = 0;
        for (size_t c = 0; c < j->cells; ++c)
            pieces += j->cell[c].side[n].pieces;
        if (pieces > 0)
            continue;
        *empty = j->shelf[n].field;
        const ovoid_status status =
            ovoid_field_mesh(j->context, (ovoid_field *)*empty, &meshing, &none);
        ovoid_mesh_destroy(&none);
        return status != OVOID_OK ? status
                                  : ov_fail(j->context, OVOID_ERROR_EMPTY, "no surface was found");
    }
    return OVOID_OK;
}

static void warn_of_missed(job *j, size_t n) {
    size_t missed = 0;
    for (size_t c = 0; c < j->cells; ++c)
        missed = j->cell[c].side[n].missed > missed ? j->cell[c].side[n].missed : missed;
    if (missed > 0)
        ov_warn(j->context,
                "at least %zu atom%s or ellipsoid%s make%s a surface too small or too thin for the "
                "spacing of %g angstrom, which the mesh may lack; use a smaller one",
                missed, missed == 1 ? "" : "s", missed == 1 ? "" : "s", missed == 1 ? "s" : "",
                j->options.spacing);
}

static ovoid_status check_outer(job *j, const ov_survey_total *total) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        if (total->outer[n] == 0)
            return ov_fail(j->context, OVOID_ERROR_EMPTY,
                           "the %s mesh has no outer component: there are no distances",
                           n == 0 ? "first" : "second");
    return OVOID_OK;
}

static ovoid_status distances_of(job *j, const ov_survey_sums sums[OV_SURVEY_SIDES],
                                 ovoid_distances *distances) {
    const ov_survey_sums *const to = &sums[0], *const back = &sums[1];
    if (!(to->weight > 0.0 && back->weight > 0.0))
        return ov_fail(j->context, OVOID_ERROR_NUMERIC, "a surface without area has no distances");
    *distances = (ovoid_distances){
        .hausdorff = fmax(to->largest, back->largest),
        .forward = to->largest,
        .backward = back->largest,
        .mean = 0.5 * (to->mean / to->weight + back->mean / back->weight),
        .rms = sqrt(0.5 * (to->square / to->weight + back->square / back->weight))};
    return OVOID_OK;
}

/* The share of the time in which those who looked at cells meshed. */
static double meshing_share(const job *j) {
    double meshing = 0.0, busy = 0.0;
    for (size_t h = 0; h < ov_hands_count(j->hands); ++h) {
        meshing += j->desk[h].meshing;
        busy += j->desk[h].busy;
    }
    return busy > 0.0 ? meshing / busy : 0.0;
}

static ovoid_status find_distances(job *j, ovoid_measures *made) {
    ovoid_status status = OVOID_OK;
    ov_survey_total total = {0};
    OV_TRY(ov_survey_join(j->context, j->cell, j->cells, &j->images, 0.0, &total));
    OV_TRY(check_outer(j, &total));
    ov_survey_total_destroy(&total);
    OV_TRY(ov_survey_stand(j->context, j->cell, j->cells, &j->images, &j->standing));
    OV_TRY(correct_all(j));
    OV_TRY(settle(j, 0, j->cells));
    OV_TRY(settle_late(j));
    OV_TRY(ov_survey_join(j->context, j->cell, j->cells, &j->images, 0.0, &total));
    OV_TRY(distances_of(j, total.sums, &made->distances));
    OV_TRY(distances_of(j, total.sums_outer, &made->distances_outer));
    made->deviation = total.deviation;
cleanup:
    ov_survey_total_destroy(&total);
    return status;
}

static ovoid_status find_contents(job *j, ovoid_measures *made) {
    ov_survey_total total = {0};
    const ovoid_status status =
        ov_survey_join(j->context, j->cell, j->cells, &j->images, 0.0, &total);
    const double units = (double)j->images.count;
    made->area = ov_pair_of(units * total.area[0], units * total.area[1]);
    made->volume = ov_pair_of(units * total.volume[0], units * total.volume[1]);
    made->area_outer = ov_pair_of(units * total.area_outer[0], units * total.area_outer[1]);
    made->volume_outer = ov_pair_of(units * total.volume_outer[0], units * total.volume_outer[1]);
    made->components_original = total.components[0];
    made->components_sparse = total.components[1];
    made->outer_original = total.outer[0];
    made->outer_sparse = total.outer[1];
    ov_survey_total_destroy(&total);
    return status;
}

ovoid_status ov_measure_cells(ovoid_context *context, const ovoid_field *original,
                              const ovoid_field *sparse, const ovoid_mesh_options *o,
                              const ov_cells_options *how, const ovoid_field **empty,
                              ovoid_measures *measures) {
    ovoid_status status = OVOID_OK;
    const ovoid_field *fields[OV_SURVEY_SIDES] = {original, sparse};
    const double began = ov_seconds();
    ovoid_measures made;
    job j = {.context = context,
             .images = {.count = 1}, /* there are none, but for all of it */
             .fars_most = how->fars_most > 0 ? how->fars_most : FARS_MOST,
             .kept_most = how->kept_most > 0 ? how->kept_most : KEPT_MOST,
             .options = {.isovalue = o->isovalue,
                         .spacing = o->spacing,
                         .vertices = o->vertices,
                         .least = INFINITY,
                         .halo = fmax(HALO, HALO_STEPS * o->spacing),
                         .sums = how->distances,
                         .contents = !how->distances}};
    ovoid_measures_init(&made, sizeof made);
    ov_progress_stage(context, "measure");
    OV_TRY(prepare(&j, fields, how));
    if (how->repeat && (*how->scattered = j.ends.scattered))
        goto cleanup;
    OV_TRY(lay_desks(&j, how->hands));
    OV_TRY(survey_all(&j));
    OV_TRY(check_surfaces(&j, empty));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        warn_of_missed(&j, n);
    OV_TRY(find_contents(&j, &made));
    if (how->distances)
        OV_TRY(find_distances(&j, &made));
    const double seconds = ov_seconds() - began;
    made.seconds_mesh = meshing_share(&j) * seconds;
    made.seconds_distances = seconds - made.seconds_mesh;
    *measures = made;
cleanup:
    destroy(&j);
    return status;
}
