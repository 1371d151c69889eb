/*
 * Judging a model near its changes alone, in boxes about them (excerpt.h); elsewhere it is as far
 * from the original as it was. What comes out are the spots that judging all of the model would
 * find. What is hidden is known from the mesh seen last.
 */
#include "measure/changes.h"
#include "measure/excerpt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A change counts where it is of at least this share of the isovalue: less moves the surface by
 * less than a hundredth of an angstrom, where the field is as steep as it mostly is. */
#define FLOOR 0.01
/* Boxes are larger than that by so many times the distance that spots have at least: places whose
 * nearest points have changed lie in them. */
#define ABOUT 3.0
/* The share of the box about the model that is worth it: a little of it takes as long as much of
 * it, unless triangles are looked into. */
#define WORTH 0.15
#define WORTH_INSIDE 0.5

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

static bool is_in(const ov_box *box, const double at[3]) {
    return ov_box_near(box, at, 0.0);
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
        const ov_box all = ov_box_larger(&n->box[k], ov_excerpt_room(n->judge, n->least));
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

/* ---- what was seen --------------------------------------------------------------------------- */

ovoid_status ov_seen_model(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                           const ov_spot *spots, size_t spot_count) {
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
    seen->box = ov_box_empty;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        ov_box_add(&seen->box, at, 0.0);
        if (!ov_mesh_is_exposed(mesh, v))
            OV_TRY(ov_seen_hide(judge->context, seen, at));
    }
    OV_TRY(ov_seen_model(judge, quadrics, count, least, spots, spot_count));
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

/* *known is false where there is no surface to tell by. */
static ovoid_status look_in_box(const nearby *n, size_t k, bool *known) {
    const ov_excerpt_asked asked = {.judge = n->judge,
                                    .quadrics = n->quadrics,
                                    .count = n->count,
                                    .least = n->least,
                                    .marcher = n->judge->near_marcher,
                                    .box = &n->box[k]};
    double farthest = 0.0;
    return ov_excerpt_look(&asked, n->found, &farthest, known);
}

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
                              .room = ov_excerpt_room(judge, least)};
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
    OV_TRY(ov_seen_model(judge, quadrics, count, least, found->spot, found->count));
    *looked = true;
cleanup:
    if (status != OVOID_OK || !*looked)
        found->count = 0;
    judge->seen.known = judge->seen.known && status == OVOID_OK;
    free(n);
    return status;
}
