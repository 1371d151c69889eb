#include "measure/cells.h"

#include "base/progress.h"
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
typedef struct job {
    ovoid_context *context;
    ov_survey_options options;
    ov_shelf shelf[OV_SURVEY_SIDES];
    size_t lead; /* the side whose parts are the cells */
    ov_survey_images images;
    double centre[3]; /* of the images */
    ov_rigid *back;   /* from each image to the unit */
    ov_unit_ends ends;
    ov_taken taken[OV_SURVEY_SIDES];
    ov_survey_cell *cell;
    bool *late; /* cells whose points that are far have been left for later */
    size_t cells;
    size_t fars_most; /* points that are looked for in other cells at a time */
    ov_survey_standing standing;
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
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ov_shelf_destroy(&j->shelf[n]);
        ov_taken_destroy(&j->taken[n]);
    }
    for (size_t c = 0; j->cell && c < j->cells; ++c)
        ov_survey_cell_destroy(&j->cell[c]);
    free(j->cell);
    free(j->late);
    free(j->back);
    ov_survey_standing_destroy(&j->standing);
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
    j->late = ov_alloc(j->context, j->cells, sizeof *j->late, "cells of a surface");
    if (!j->cell || !j->late)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

/* The terms that make the surfaces in a cell and its halo what they are. */
static ovoid_status take_terms(job *j, size_t c, ov_survey_terms *terms) {
    const double reach = j->options.halo + OV_SURVEY_ROOM * j->options.spacing;
    ov_box box = box_of(j, c);
    for (size_t k = 0; k < 3; ++k) {
        box.low[k] -= reach;
        box.high[k] += reach;
    }
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        const ovoid_status status =
            ov_shelf_take(j->context, &j->shelf[n], &j->images, &box, &j->taken[n]);
        if (status != OVOID_OK)
            return status;
        terms->body[n] = j->taken[n].body;
        terms->count[n] = j->taken[n].count;
    }
    j->options.cell = (uint32_t)c;
    j->options.image = j->images.count > 1 ? j->taken[0].image : NULL;
    return OVOID_OK;
}

/* ---- each cell by itself --------------------------------------------------------------------- */

static void forget_fars(ov_survey_cell *cell) {
    free(cell->far);
    cell->far = NULL;
    cell->fars = cell->far_capacity = 0;
}

static ovoid_status survey(job *j, size_t c, ov_survey_cell *cell) {
    const ov_box box = box_of(j, c);
    ov_survey_terms terms;
    const ovoid_status status = take_terms(j, c, &terms);
    return status != OVOID_OK
               ? status
               : ov_survey_bodies(j->context, &j->options, &terms, box.low, box.high, cell);
}

/* Cells with too many points that are far, for now, are left for later. */
static ovoid_status survey_all(job *j) {
    ovoid_status status = OVOID_OK;
    size_t fars = 0;
    for (size_t c = 0; c < j->cells; ++c) {
        OV_TRY(ov_progress_step(j->context, c, j->cells));
        OV_TRY(survey(j, c, &j->cell[c]));
        j->late[c] = fars + j->cell[c].fars > j->fars_most;
        if (j->late[c])
            forget_fars(&j->cell[c]);
        fars += j->cell[c].fars;
    }
cleanup:
    return status;
}

/* Where an outer surface was taken for what it is not. */
static ovoid_status correct(job *j, size_t c) {
    ovoid_status status = OVOID_OK;
    const ov_box box = box_of(j, c);
    ov_survey_terms terms;
    if (ov_survey_holds(&j->standing, &j->cell[c], c))
        return OVOID_OK;
    OV_TRY(take_terms(j, c, &terms));
    OV_TRY(ov_survey_again(j->context, &j->options, &terms, box.low, box.high, &j->standing,
                           &j->cell[c]));
cleanup:
    return status;
}

static ovoid_status correct_all(job *j) {
    ovoid_status status = OVOID_OK;
    for (size_t c = 0; c < j->cells; ++c) {
        OV_TRY(ov_progress_step(j->context, c, j->cells));
        if (!j->late[c])
            OV_TRY(correct(j, c));
    }
cleanup:
    return status;
}

/* ---- what is far ----------------------------------------------------------------------------- */

static double distance_to(const ov_box *box, const double at[3]) {
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
        const double off = fmax(fmax(box->low[k] - at[k], at[k] - box->high[k]), 0.0);
        square += off * off;
    }
    return sqrt(square);
}

/* Where nothing was within reach: as far as to one vertex of a piece. */
static void bound_far(const job *j, ov_survey_far *far) {
    const size_t n = 1 - far->side;
    for (size_t c = 0; c < j->cells; ++c)
        for (size_t p = 0; p < j->cell[c].side[n].pieces; ++p) {
            const double *const at = j->cell[c].side[n].piece[p].at;
            if (far->outer && !j->standing.outer[n][j->standing.first[n][c] + p])
                continue;
            const ov_box place = {{at[0], at[1], at[2]}, {at[0], at[1], at[2]}};
            far->distance = fmin(far->distance, distance_to(&place, far->at));
        }
}

/* A point that is far, as it lies to the unit from an image of it. */
typedef struct sought {
    ov_survey_far far;
    size_t of; /* the point */
} sought;

typedef struct seeker {
    ov_survey_far *const *far;
    size_t count;
    sought *found;
    ov_survey_far **list; /* of what was found */
    size_t founds, capacity, list_capacity;
} seeker;

static ovoid_status add_sought(const job *j, size_t point, const double at[3], seeker *s) {
    const ovoid_status status = ov_grow(j->context, &s->found, &s->capacity, s->founds + 1,
                                        sizeof *s->found, "points that are far");
    if (status != OVOID_OK)
        return status;
    s->found[s->founds] = (sought){.far = *s->far[point], .of = point};
    memcpy(s->found[s->founds++].far.at, at, 3 * sizeof *at);
    return OVOID_OK;
}

/* Those which something in cell c, or in an image of it, may be nearer to. */
static ovoid_status choose_fars(const job *j, size_t c, seeker *s) {
    ovoid_status status = OVOID_OK;
    const ov_box box = box_of(j, c);
    s->founds = 0;
    for (size_t k = 0; k < s->count; ++k) {
        const ov_survey_far *const far = s->far[k];
        if (j->cell[c].side[1 - far->side].pieces == 0)
            continue;
        if (far->cell != c && distance_to(&box, far->at) < far->distance)
            OV_TRY(add_sought(j, k, far->at, s));
        for (size_t g = 1; g < j->images.count; ++g) {
            double at[3];
            ov_rigid_move(&j->back[g], far->at, at);
            if (distance_to(&box, at) < far->distance)
                OV_TRY(add_sought(j, k, at, s));
        }
    }
    OV_TRY(ov_grow(j->context, &s->list, &s->list_capacity, s->founds + 1, sizeof *s->list,
                   "points that are far"));
    for (size_t n = 0; n < s->founds; ++n)
        s->list[n] = &s->found[n].far;
cleanup:
    return status;
}

/* Looks for these points in cell c. */
static ovoid_status seek_in(job *j, size_t c, seeker *s) {
    ovoid_status status = OVOID_OK;
    const ov_box box = box_of(j, c);
    ov_survey_terms terms;
    OV_TRY(choose_fars(j, c, s));
    if (s->founds == 0)
        return OVOID_OK;
    OV_TRY(take_terms(j, c, &terms));
    OV_TRY(ov_survey_seek(j->context, &j->options, &terms, box.low, box.high, &j->standing,
                          &j->cell[c], s->list, s->founds));
    for (size_t n = 0; n < s->founds; ++n) {
        ov_survey_far *const far = s->far[s->found[n].of];
        far->distance = fmin(far->distance, s->found[n].far.distance);
    }
cleanup:
    return status;
}

/* Looks for these points in all cells. */
static ovoid_status seek(job *j, ov_survey_far *const *far, size_t count) {
    ovoid_status status = OVOID_OK;
    seeker s = {.far = far, .count = count};
    for (size_t k = 0; k < count; ++k) {
        OV_TRY(ov_progress_ask(j->context));
        if (isinf(far[k]->distance))
            bound_far(j, far[k]);
    }
    for (size_t c = 0; c < j->cells; ++c) {
        OV_TRY(ov_progress_step(j->context, c, j->cells));
        OV_TRY(seek_in(j, c, &s));
    }
cleanup:
    free(s.found);
    free(s.list);
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
    far = ov_alloc(j->context, count, sizeof *far, "points that are far");
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
        OV_TRY(survey(j, c, &fresh));
        ov_survey_cell_destroy(&j->cell[c]);
        j->cell[c] = fresh;
        OV_TRY(correct(j, c));
        OV_TRY(settle(j, c, c + 1));
    }
cleanup:
    return status;
}

/* ---- all of them ----------------------------------------------------------------------------- */

/* A surface that is nowhere: says why. */
static ovoid_status check_surfaces(job *j, const ovoid_field **empty) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ovoid_mesh_options meshing = {sizeof meshing, j->options.isovalue, j->options.spacing,
                                      j->options.vertices};
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
    double meshing = 0.0;
    ovoid_measures made;
    job j = {.context = context,
             .images = {.count = 1}, /* there are none, but for all of it */
             .fars_most = how->fars_most > 0 ? how->fars_most : FARS_MOST,
             .options = {.isovalue = o->isovalue,
                         .spacing = o->spacing,
                         .vertices = o->vertices,
                         .least = INFINITY,
                         .halo = fmax(HALO, HALO_STEPS * o->spacing),
                         .sums = how->distances,
                         .contents = !how->distances,
                         .meshing = &meshing}};
    ovoid_measures_init(&made, sizeof made);
    ov_progress_stage(context, "measure");
    OV_TRY(prepare(&j, fields, how));
    if (how->repeat && (*how->scattered = j.ends.scattered))
        goto cleanup;
    OV_TRY(survey_all(&j));
    OV_TRY(check_surfaces(&j, empty));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        warn_of_missed(&j, n);
    OV_TRY(find_contents(&j, &made));
    if (how->distances)
        OV_TRY(find_distances(&j, &made));
    made.seconds_mesh = meshing;
    made.seconds_distances = ov_seconds() - began - meshing;
    *measures = made;
cleanup:
    destroy(&j);
    return status;
}
