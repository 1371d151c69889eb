#include "fit/adaptive/tolerance.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>

bool ov_trial_holds(const ov_trial *t, double tolerance) {
    return t->judgement.valid && t->judgement.deviation <= tolerance;
}

/* whole: as of ov_judge_spots_near(); NULL: all of the model is judged before it is said to hold.
 */
static ovoid_status find_spots(ov_adaptive *f, ov_judge *judge, ov_trial *t, double tolerance,
                               size_t most, ov_spots *spots, bool *whole) {
    ov_spots_destroy(spots);
    ov_adaptive_quadrics(f, t);
    const size_t count = ov_adaptive_surround(f, t->count);
    const ovoid_status status =
        whole ? ov_judge_spots_near(judge, f->quadrics, count, tolerance, ov_tuned.spots_apart,
                                    most, &t->judgement, &spots->spot, &spots->count, whole)
              : ov_judge_spots(judge, f->quadrics, count, tolerance, ov_tuned.spots_apart, most,
                               &t->judgement, &spots->spot, &spots->count);
    if (status == OVOID_OK && (!t->judgement.valid || t->judgement.deviation <= tolerance))
        spots->count = 0;
    return status;
}

/* By both judges. What holds by the first near its changes is likely to hold elsewhere: whether it
 * does is looked at when it holds by the second one. */
static ovoid_status find_spots_closely(ov_adaptive *f, ov_trial *t, double tolerance, size_t most,
                                       ov_spots *spots) {
    ovoid_status status = OVOID_OK;
    bool whole;
    OV_TRY(find_spots(f, &f->judge, t, tolerance, most, spots, &whole));
    const double coarse = t->judgement.deviation;
    if (!ov_trial_holds(t, tolerance))
        return OVOID_OK;
    OV_TRY(find_spots(f, &f->fine, t, tolerance, most, spots, NULL));
    if (!ov_trial_holds(t, tolerance))
        return OVOID_OK;
    if (whole) /* what is told is what meshes of the spacing tell */
        t->judgement.deviation = coarse;
    else
        OV_TRY(find_spots(f, &f->judge, t, tolerance, most, spots, NULL));
cleanup:
    return status;
}

ovoid_status ov_adaptive_spots(ov_adaptive *f, ov_trial *t, double tolerance, size_t most,
                               ov_spots *spots) {
    return f->finely ? find_spots_closely(f, t, tolerance, most, spots)
                     : find_spots(f, &f->judge, t, tolerance, most, spots, NULL);
}

ovoid_status ov_adaptive_emphasise(ov_adaptive *f, const ov_spots *spots, double reach,
                                   double factor) {
    return ov_target_emphasise(f->context, &f->target, spots->spot->at, sizeof *spots->spot,
                               spots->count, reach, factor);
}

/* From the count that molecules of this size need, about, to a model that holds. */
static ovoid_status start_and_grow(ov_adaptive *f, double tolerance, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {.stage = "grow", .most = f->atoms, .rounds = ov_tuned.grow_rounds};
    const double guess = ov_tuned.start_ratio * pow(tolerance, ov_tuned.start_tolerance_power) *
                         pow(f->options->decay / 0.5, ov_tuned.start_decay_power) *
                         (double)f->atoms;
    double count = fmin(fmax(round(guess), 1.0), (double)f->atoms);
    const size_t kinds = f->options->adaptive.effort > 1 ? 3 : 1;
    OV_TRY(ov_adaptive_begin(f, 0, kinds, (size_t)count, t));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    while (f->options->adaptive.steps > 0 &&
           (double)spots.count > ov_tuned.start_too_many * count && count < (double)f->atoms) {
        count = fmin(ceil((1.0 + ov_tuned.start_more) * count), (double)f->atoms);
        OV_TRY(ov_adaptive_begin(f, 0, kinds, (size_t)count, t));
        OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    }
    if (f->options->adaptive.steps > 0)
        OV_TRY(ov_adaptive_grow(f, tolerance, &how, t, &spots));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* Whether the search begins with the model of the last frame, shrunk for the same. */
static bool is_frame(const ov_adaptive *f) {
    return f->start && f->start->moved && f->start->tolerance == f->options->adaptive.tolerance;
}

/* From the model given, unless it is off in so many places that the atoms are the better start: t
 * does not hold then. One that holds stays as it is. */
static ovoid_status grow_start(ov_adaptive *f, double tolerance, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    ov_growing how = {.stage = "grow", .most = f->atoms, .rounds = ov_tuned.grow_rounds};
    how.patience = is_frame(f) ? ov_tuned.motion_patience : 0;
    const double too_many = is_frame(f) ? ov_tuned.motion_too_many : ov_tuned.start_too_many;
    OV_TRY(ov_adaptive_take_start(f, t));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    if (f->options->adaptive.steps == 0 || ov_trial_holds(t, tolerance))
        goto cleanup;
    OV_TRY(ov_adaptive_refine_fully(f, t, "refine"));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    if ((double)spots.count <= too_many * (double)t->count)
        OV_TRY(ov_adaptive_grow(f, tolerance, &how, t, &spots));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* The atoms themselves: the field and its surface, exactly. */
static ovoid_status take_atoms(ov_adaptive *f, ov_trial *t) {
    const ovoid_status status = ov_adaptive_cut(f, 0, f->atoms, t);
    return status != OVOID_OK ? status : ov_adaptive_judge(f, t);
}

/* When shrinking ends, by what is fitted. */
static void choose_patience(const ov_adaptive *f, ov_shrinking *how) {
    const uint32_t effort = f->options->adaptive.effort;
    const bool frame = is_frame(f), part = ov_adaptive_is_part(f);
    if (effort == 0) {
        how->gain = ov_tuned.shrink_soon_gain;
        how->idle_rounds = ov_tuned.shrink_soon_rounds;
        return;
    }
    how->gain = ov_tuned.shrink_gain;
    how->thorough = !frame && !part;
    how->idle_rounds = effort * (frame  ? ov_tuned.motion_idle_rounds
                                 : part ? ov_tuned.shrink_part_idle_rounds
                                        : ov_tuned.shrink_idle_rounds);
    how->idle_tries = effort * (frame  ? ov_tuned.motion_idle_tries
                                : part ? ov_tuned.shrink_part_idle_tries
                                       : ov_tuned.shrink_idle_tries);
}

/* The model of the last frame was shrunk as far as it goes: only where growing ended with more
 * ellipsoids than frames can do with, and some, they are made fewer. */
static ovoid_status shrink(ov_adaptive *f, double tolerance, ov_trial *best) {
    const bool frame = is_frame(f);
    const double slack = 1.0 + ov_tuned.motion_slack;
    ov_shrinking how = {.stage = "shrink",
                        .least = frame ? (size_t)(slack * (double)f->start->fewest) : 1};
    choose_patience(f, &how);
    const ovoid_status status = ov_adaptive_shrink(f, tolerance, &how, best);
    f->fewest = best->count;
    if (frame) { /* if that many are there still, it takes so many */
        const size_t needed = (size_t)((double)best->count / slack);
        f->fewest = f->start->fewest > needed ? f->start->fewest : needed;
    }
    return status;
}

/* Whether what was seen of a model is better than what was seen of another one. */
static bool is_better(const ov_judgement *one, const ov_judgement *other) {
    return one->valid && (!other->valid || one->deviation < other->deviation);
}

/* A trial that held, at a finer spacing: grows where it is off there, and so seen by both. */
static ovoid_status confirm_trial(ov_adaptive *f, double tolerance, ov_trial *t, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {.stage = "confirm",
                            .most = f->atoms,
                            .rounds = ov_tuned.confirm_patience + ov_tuned.grow_rounds,
                            .patience = ov_tuned.confirm_patience};
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    const ov_judgement first = t->judgement;
    OV_TRY(ov_adaptive_grow(f, tolerance, &how, t, &spots));
    if (ov_trial_holds(t, tolerance) || is_better(&t->judgement, &first))
        ov_trial_swap(t, best);
    else
        best->judgement = first;
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* The fine judge, where its meshes are finer than those of the other one. */
static ovoid_status prepare_fine(ov_adaptive *f) {
    ovoid_status status = OVOID_OK;
    const double coarse = f->options->adaptive.mesh_spacing;
    const double least = ov_tuned.confirm_spacing * sqrt(0.5 / f->options->decay);
    const double fine = fmax(ov_tuned.confirm_finer * coarse, least);
    if (fine >= coarse)
        return OVOID_OK;
    if (!f->fine.mesh)
        OV_TRY(ov_adaptive_judge_at(f, fine, &f->fine));
    ov_judge_begin(&f->fine);
cleanup:
    return status;
}

/* A mesh misses what is narrower than its steps, such as the end of a groove, and the model's may
 * be elsewhere than the original's: what holds has to do so by a finer one, too; and by vertices,
 * between which triangles may be farther away: it has to do so all over them. */
static ovoid_status confirm(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial t = {0};
    f->stage = "confirm";
    OV_TRY(ov_trial_create(f, &t));
    ov_trial_copy(best, &t);
    OV_TRY(prepare_fine(f));
    ov_adaptive_look_closely(f, true);
    OV_TRY(confirm_trial(f, tolerance, &t, best));
cleanup:
    ov_trial_destroy(&t);
    return status;
}

/* With an effort above 1, what confirming added is merged again where it can be, judged as closely:
 * that takes about as long as all that was done before. */
static ovoid_status confirm_and_shrink(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    const size_t before = best->count;
    OV_TRY(confirm(f, tolerance, best));
    if (best->count <= before)
        goto cleanup;
    f->fewest += best->count - before;
    if (f->options->adaptive.effort > 1 && ov_trial_holds(best, tolerance))
        OV_TRY(shrink(f, tolerance, best));
cleanup:
    return status;
}

/* Shrinks what holds by the spacing, and confirms what that comes to. A start is confirmed before,
 * and is what is left where that takes no more ellipsoids: what merges saved by the spacing may
 * have to be added again by the finer one. */
static ovoid_status shrink_and_confirm(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial kept = {0};
    bool keeps = false;
    if (f->start) {
        OV_TRY(confirm(f, tolerance, best));
        keeps = ov_trial_holds(best, tolerance);
        ov_adaptive_look_closely(f, false);
        OV_TRY(ov_trial_create(f, &kept));
        ov_trial_copy(best, &kept);
    }
    OV_TRY(shrink(f, tolerance, best));
    if (!keeps || best->count < kept.count)
        OV_TRY(confirm_and_shrink(f, tolerance, best));
    if (keeps && (best->count >= kept.count || !ov_trial_holds(best, tolerance)))
        ov_trial_swap(&kept, best);
    ov_adaptive_look_closely(f, true);
cleanup:
    ov_trial_destroy(&kept);
    return status;
}

/* Surfaces that end at a part's region, or meet images of themselves, are judged by vertices, as
 * seams are surveyed in the end. */
static double margin(const ov_adaptive *f) {
    return ov_adaptive_is_part(f) ? 0.0 : ov_tuned.tolerance_margin;
}

double ov_adaptive_held_to(const ov_adaptive *f) {
    return (1.0 - 0.5 * margin(f)) * f->options->adaptive.tolerance;
}

void ov_adaptive_look_closely(ov_adaptive *f, bool closely) {
    const bool inside = closely && margin(f) > 0.0;
    f->judge.slack = f->fine.slack =
        inside ? ov_tuned.tolerance_slack * f->options->adaptive.tolerance : 0.0;
    f->judge.closely = f->fine.closely = closely;
    f->finely = closely && f->fine.mesh;
}

ovoid_status ov_adaptive_tolerance(ov_adaptive *f, double asked, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    double tolerance = (1.0 - margin(f)) * asked;
    if (f->start) { /* one that was fitted to it may have come nearer to it in the end */
        tolerance = ov_adaptive_held_to(f);
        OV_TRY(grow_start(f, tolerance, best));
    }
    if (!f->start || !ov_trial_holds(best, tolerance))
        OV_TRY(start_and_grow(f, tolerance, best));
    if (ov_trial_holds(best, tolerance))
        f->held = best;
    if (f->options->adaptive.steps == 0 || !f->judge.mesh)
        goto cleanup;
    if (!ov_trial_holds(best, tolerance))
        OV_TRY(take_atoms(f, best));
    if (ov_trial_holds(best, tolerance)) {
        f->held = best;
        OV_TRY(shrink_and_confirm(f, tolerance, best));
    }
    ov_adaptive_quadrics(f, best);
    OV_TRY(ov_owner_tidy(f->context, f->xyzr, f->atoms, f->quadrics, best->count,
                         ov_tuned.owner_share, ov_tuned.owner_reach, best->owner));
cleanup:
    return status;
}

ovoid_status ov_adaptive_mend(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {.stage = "mend", .most = f->atoms, .rounds = ov_tuned.grow_rounds};
    ov_adaptive_look_closely(f, true); /* what is mended here is surveyed next */
    OV_TRY(ov_adaptive_take_start(f, best));
    OV_TRY(ov_adaptive_spots(f, best, tolerance, f->capacity, &spots));
    if (f->options->adaptive.steps > 0)
        OV_TRY(ov_adaptive_grow(f, tolerance, &how, best, &spots));
    ov_adaptive_quadrics(f, best);
    OV_TRY(ov_owner_tidy(f->context, f->xyzr, f->atoms, f->quadrics, best->count,
                         ov_tuned.owner_share, ov_tuned.owner_reach, best->owner));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}
