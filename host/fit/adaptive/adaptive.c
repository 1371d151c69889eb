#include "fit/adaptive/tolerance.h"

#include "base/progress.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool report_sampling(uint64_t points, void *user) {
    ov_adaptive *const f = user;
    const ovoid_progress progress = {.stage = "sample",
                                     .done = f->around.done,
                                     .total = f->around.total,
                                     .ellipsoids = f->atoms,
                                     .points = points};
    return ov_progress_report(f->context, &progress);
}

/* Small molecules have few points at any spacing, and so few that more of them help. The field of
 * a larger decay rate has smaller features; that of a smaller one has fewer, and as many points. */
double ov_default_spacing(size_t atoms, double decay) {
    const double small = ov_tuned.sample_spacing * pow((double)atoms / ov_tuned.sample_atoms, 0.25);
    return fmin(fmax(small, ov_tuned.sample_spacing), OVOID_DEFAULT_SPACING_ADAPTIVE) *
           fmin(1.0, sqrt(0.5 / decay));
}

double ov_surface_reach(const double *xyzr, size_t atoms, const ovoid_fit_options *options) {
    double radius = 0.0;
    for (size_t i = 0; i < atoms; ++i)
        radius = fmax(radius, xyzr[4 * i + 3]);
    return sqrt(fmax(radius * radius - log(options->isovalue) / options->decay, 0.0));
}

/* The room about the atom centres that the band takes, angstrom. */
static double padding_of(const ov_adaptive *f) {
    const ovoid_fit_options *const options = f->options;
    return fmax(options->padding, ov_surface_reach(f->xyzr, f->atoms, options) +
                                      ov_tuned.sample_padding / sqrt(2.0 * options->decay));
}

/* The box of a part's atoms, grown by the padding. */
static void bound_part(const ov_adaptive *f, double padding, double part[2][3]) {
    for (size_t k = 0; k < 3; ++k) {
        part[0][k] = INFINITY;
        part[1][k] = -INFINITY;
        for (size_t i = 0; i < f->atoms; ++i) {
            part[0][k] = fmin(part[0][k], f->xyzr[4 * i + k] - padding);
            part[1][k] = fmax(part[1][k], f->xyzr[4 * i + k] + padding);
        }
    }
}

/* The field of these at the points. */
static ovoid_status evaluate(ov_adaptive *f, const ov_quadric *quadrics, size_t count,
                             ov_buffer *values) {
    ovoid_status status = OVOID_OK;
    const ov_points *const points = &f->samples.points;
    ov_terms terms = {0};
    ov_lists lists = {.packs_only = true};
    ov_operations operations = {0};
    OV_TRY(ov_terms_set(f->context, &terms, quadrics, count, points->origin, OV_TARGET_CUTOFF));
    OV_TRY(ov_lists_build(f->context, &lists, points, &terms, 0.0));
    OV_TRY(ov_field(f->context, &operations, points, &terms, &lists, values));
cleanup:
    ov_operations_destroy(&operations);
    ov_lists_destroy(&lists);
    ov_terms_destroy(&terms);
    return status;
}

/* The field of the start's images. */
static ovoid_status evaluate_images(ov_adaptive *f, ov_buffer *values) {
    const size_t count = f->start->count;
    memcpy(f->quadrics, f->start->quadrics, count * sizeof *f->quadrics);
    ov_followers_place(&f->refiner.followers, count, f->quadrics, NULL);
    return evaluate(f, f->quadrics + count, count * f->around.images, values);
}

/* What is fixed takes its share of the target. Beyond a part nothing of it is to be, but images of
 * it may be where they were. */
static ovoid_status fix_surroundings(ov_adaptive *f) {
    ovoid_status status = OVOID_OK;
    ov_buffer fixed = {0}, images = {0};
    OV_TRY(evaluate(f, f->around.fixed, f->around.fixed_count, &fixed));
    if (f->around.images > 0)
        OV_TRY(evaluate_images(f, &images));
    OV_TRY(ov_target_fix(f->context, &f->target, &fixed, f->around.images > 0 ? &images : NULL));
cleanup:
    ov_buffer_destroy(&fixed);
    ov_buffer_destroy(&images);
    return status;
}

static ovoid_status sample(ov_adaptive *f, const ov_target_options *targets) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options *const options = f->options;
    const double isovalue = options->isovalue;
    const ov_band band = {.low = targets->low * isovalue,
                          .high = targets->high * isovalue,
                          .inside_every = targets->inside_every,
                          .outside_low = targets->outside_low * isovalue,
                          .outside_every = targets->outside_every};
    double part[2][3], padding = padding_of(f);
    ov_sampling sampling = {.go_on = report_sampling, .user = f};
    ov_lattice lattice;
    if (f->around.atoms > 0) {
        bound_part(f, padding, part);
        sampling.part = (const double(*)[3])part;
        padding += ov_tuned.part_beyond / sqrt(2.0 * options->decay);
    }
    OV_TRY(ov_lattice_create(f->context, f->xyzr, f->atoms, f->spacing, padding, &lattice));
    OV_TRY(ov_sample(f->context, f->xyzr, f->atoms + f->around.atoms, options->decay, &lattice,
                     band, sampling, &f->samples));
    OV_TRY(
        ov_target_create(f->context, &f->samples, options->decay, isovalue, targets, &f->target));
    if (f->around.fixed_count > 0 || f->around.images > 0)
        OV_TRY(fix_surroundings(f));
    ov_buffer_destroy(&f->samples.value); /* the target has taken over what it needs */
    ov_buffer_destroy(&f->samples.gradient);
cleanup:
    return status;
}

/* What judges are not to look at: where the first `count` of f->quadrics, which nothing is to be
 * held against, are off. */
static ovoid_status excuse(ov_adaptive *f, size_t count, double least, ov_judge *judge) {
    ovoid_status status = OVOID_OK;
    ov_judgement judgement;
    size_t kept = 0;
    count = ov_adaptive_surround(f, count);
    OV_TRY(ov_judge_spots(judge, f->quadrics, count, least, ov_tuned.spots_apart, SIZE_MAX,
                          &judgement, &judge->excused, &judge->excused_count));
    for (size_t n = 0; n < judge->excused_count; ++n)
        if (!ov_spots_near(judge->wanted, judge->wanted_count, judge->excused[n].at,
                           2.0 * judge->excused_reach))
            judge->excused[kept++] = judge->excused[n];
    judge->excused_count = kept;
cleanup:
    return status;
}

/* The model at hand that others can be held against: the start or the part's own atoms. Returns how
 * many ellipsoids. */
static size_t take_standard(ov_adaptive *f) {
    if (ov_adaptive_is_patch(f)) {
        memcpy(f->quadrics, f->start->quadrics, f->start->count * sizeof *f->quadrics);
        return f->start->count;
    }
    for (size_t i = 0; i < f->atoms; ++i)
        ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &f->quadrics[i]);
    return f->atoms;
}

/* Neighbours of so many ellipsoids are far off in places: what is off with the part's own atoms,
 * too, counts where it is far more so, and one of its ellipsoids that has strayed counts anywhere.
 * Of a start that is mended nothing else is to become worse. */
static ovoid_status excuse_by_number(ov_adaptive *f, ov_judge *judge) {
    const bool mends = ov_adaptive_is_patch(f);
    judge->excused_times = mends ? ov_tuned.patch_excused_times : ov_tuned.part_excused_times;
    judge->stray = mends ? INFINITY : ov_tuned.part_stray / judge->root_2d;
    judge->whole = true;
    const ovoid_status status =
        excuse(f, take_standard(f), ov_tuned.sharpen_enough / judge->root_2d, judge);
    judge->whole = false;
    judge->wanted_count = 0; /* walls of cavities about these places count as others do */
    return status;
}

/* Surfaces count where the part has a say in them. What is off with its own atoms as they are is
 * none of its doing: cavities that are cut open at the end of what is about it, and what neighbours
 * left. In a start that holds but for some spots, what else seems to be off does not count as a
 * whole. */
static ovoid_status judge_region(ov_adaptive *f, ov_judge *judge) {
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    judge->in_region = true;
    judge->excused_reach = ov_tuned.part_excused / judge->root_2d;
    judge->excused_times = judge->stray = INFINITY;
    judge->wanted = f->around.spots;
    judge->wanted_count = f->around.spot_count;
    judge->region = f->around.region;
    if (wanted->goal == OVOID_GOAL_TOLERANCE)
        return excuse(f, take_standard(f), wanted->tolerance, judge);
    return wanted->effort > 0 ? excuse_by_number(f, judge) : OVOID_OK;
}

ovoid_status ov_adaptive_judge_at(ov_adaptive *f, double spacing, ov_judge *judge) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_judge_create(f->context, f->xyzr, f->atoms + f->around.atoms, f->options->decay,
                           f->options->isovalue, spacing,
                           (ov_watch){.go_on = ov_adaptive_report, .user = f}, judge));
    if (f->around.atoms > 0)
        OV_TRY(judge_region(f, judge));
cleanup:
    return status;
}

/* What all goals share, unless it is there. */
static ovoid_status prepare(ov_adaptive *f) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options *const options = f->options;
    ov_target_options targets;
    if (f->prepared)
        return OVOID_OK;
    ov_adaptive_forget(f); /* a part of it may be there */
    OV_TRY(ov_followers_set(f->context, &f->refiner.followers, f->around.image, f->around.images));
    OV_TRY(ov_followers_set(f->context, &f->local.refiner.followers, f->around.image,
                            f->around.images));
    f->spacing =
        options->spacing > 0.0 ? options->spacing : ov_default_spacing(f->atoms, options->decay);
    ov_target_options_init(&targets);
    OV_TRY(sample(f, &targets));
    f->stage = "mesh";
    f->count = f->atoms;
    OV_TRY(ov_adaptive_judge_at(f, options->adaptive.mesh_spacing, &f->judge));
    f->prepared = true;
cleanup:
    return status;
}

static size_t count_of_ratio(const ov_adaptive *f) {
    return (size_t)fmax(1.0, round(f->options->adaptive.ratio * (double)f->atoms));
}

static ovoid_status reach_goal(ov_adaptive *f, ov_trial *best) {
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    switch (wanted->goal) {
    case OVOID_GOAL_ELLIPSOIDS:
        return ov_adaptive_count(f, (size_t)wanted->ellipsoids, best);
    case OVOID_GOAL_RATIO:
        return ov_adaptive_count(f, count_of_ratio(f), best);
    case OVOID_GOAL_TOLERANCE:
        break;
    }
    return ov_adaptive_is_patch(f) ? ov_adaptive_mend(f, wanted->tolerance, best)
                                   : ov_adaptive_tolerance(f, wanted->tolerance, best);
}

static void multiply_amplitudes(ov_adaptive *f, size_t count, double factor) {
    for (size_t i = 0; i < count; ++i)
        f->quadrics[i].amplitude *= factor;
}

/* ln of the factor for all amplitudes that makes the volumes equal; per_log: what the volume ratio
 * gained per unit of it last time, 0 if nobody knows. */
static double log_calibration(const ov_adaptive *f, double volume_ratio, double per_log) {
    const double step = per_log > 0.0 ? (1.0 - volume_ratio) / per_log
                                      : log(ov_judge_amplitude_factor(&f->judge, volume_ratio));
    return fmin(fmax(step, -ov_tuned.volume_change), ov_tuned.volume_change);
}

static ovoid_status judge(ov_adaptive *f, size_t count, ov_judgement *judgement) {
    const size_t all = ov_adaptive_surround(f, count);
    return ov_judge_model(&f->judge, f->quadrics, all, judgement);
}

/* How far off it is where the tolerance may be lost; of a part where it has a say, as before. */
static ovoid_status judge_tolerance(ov_adaptive *f, size_t count, ov_judgement *judgement) {
    ov_spot *spots = NULL;
    size_t spot_count;
    if (f->around.atoms == 0)
        return judge(f, count, judgement);
    const size_t all = ov_adaptive_surround(f, count);
    const ovoid_status status =
        ov_judge_spots(&f->judge, f->quadrics, all, f->options->adaptive.tolerance,
                       ov_tuned.spots_apart, 1, judgement, &spots, &spot_count);
    free(spots);
    return status;
}

/* Distances only matter on the way where a tolerance may be lost. */
static ovoid_status judge_volume(ov_adaptive *f, size_t count, ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    *judgement = (ov_judgement){.valid = true};
    if (f->options->adaptive.goal == OVOID_GOAL_TOLERANCE)
        OV_TRY(judge_tolerance(f, count, judgement));
    if (f->options->adaptive.goal != OVOID_GOAL_TOLERANCE || f->around.atoms > 0)
        OV_TRY(ov_adaptive_volume(f, count, &judgement->volume_ratio));
cleanup:
    return status;
}

/* Makes the volumes equal by a factor of all amplitudes, unless that loses the tolerance. */
static ovoid_status calibrate(ov_adaptive *f, size_t count, ov_judgement *judgement,
                              bool *changed) {
    ovoid_status status = OVOID_OK;
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    double per_log = 0.0;
    *changed = false;
    OV_TRY(judge_volume(f, count, judgement));
    for (uint32_t n = 0; n < ov_tuned.volume_steps && judgement->valid && wanted->steps > 0 &&
                         fabs(judgement->volume_ratio - 1.0) > ov_tuned.volume_error;
         ++n) {
        const double step = log_calibration(f, judgement->volume_ratio, per_log);
        ov_judgement after;
        multiply_amplitudes(f, count, exp(step));
        OV_TRY(judge_volume(f, count, &after));
        per_log = (after.volume_ratio - judgement->volume_ratio) / step;
        const bool lost = wanted->goal == OVOID_GOAL_TOLERANCE &&
                          after.deviation > wanted->tolerance &&
                          judgement->deviation <= wanted->tolerance;
        if (!lost && fabs(after.volume_ratio - 1.0) < fabs(judgement->volume_ratio - 1.0)) {
            *judgement = after;
            *changed = true;
        } else {
            multiply_amplitudes(f, count, exp(-step)); /* too far */
        }
        if (lost)
            break;
    }
    if (wanted->goal != OVOID_GOAL_TOLERANCE && (f->around.atoms == 0 || wanted->effort > 0))
        OV_TRY(judge(f, count, judgement));
cleanup:
    return status;
}

/* Meshes tell how near surfaces are where they are finer than the tolerance, or than what a
 * Gaussian of the decay rate can have for features: so many of its widths. */
#define COARSEST 2.0

static bool is_coarse(const ov_adaptive *f) {
    const double spacing = f->options->adaptive.mesh_spacing;
    return (spacing > f->options->adaptive.tolerance && spacing * f->judge.root_2d > COARSEST) ||
           (f->judge.mesh && f->judge.mesh->missed > 0);
}

/* A goal is reached only where it was measured. */
static ovoid_verdict verdict_of(const ov_adaptive *f, size_t count, const ov_judgement *judgement) {
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    switch (wanted->goal) {
    case OVOID_GOAL_ELLIPSOIDS:
        return count == wanted->ellipsoids ? OVOID_VERDICT_REACHED : OVOID_VERDICT_MISSED;
    case OVOID_GOAL_RATIO:
        return count == count_of_ratio(f) ? OVOID_VERDICT_REACHED : OVOID_VERDICT_MISSED;
    case OVOID_GOAL_TOLERANCE:
        break;
    }
    if (is_coarse(f))
        return OVOID_VERDICT_COARSE;
    if (!f->judge.mesh)
        return OVOID_VERDICT_NO_SURFACE;
    if (!judgement->valid)
        return OVOID_VERDICT_NO_MODEL_SURFACE;
    return judgement->deviation <= wanted->tolerance ? OVOID_VERDICT_REACHED : OVOID_VERDICT_MISSED;
}

/* ---- what came of it ------------------------------------------------------------------------ */

/* Hands over the trial's owners and the quadrics f->quadrics, which are its. */
static ovoid_status hand_over(const ov_adaptive *f, const ov_trial *t, ov_found *found) {
    ov_found made = {.count = t->count,
                     .tolerance = f->fewest > 0 ? f->options->adaptive.tolerance : 0.0,
                     .fewest = f->fewest < t->count ? f->fewest : t->count};
    made.quadrics = ov_alloc(f->context, t->count, sizeof *made.quadrics, "ellipsoids");
    made.owner = ov_alloc(f->context, f->atoms, sizeof *made.owner, "owners");
    if (!made.quadrics || !made.owner) {
        ov_found_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    memcpy(made.quadrics, f->quadrics, t->count * sizeof *made.quadrics);
    memcpy(made.owner, t->owner, f->atoms * sizeof *made.owner);
    *found = made;
    return OVOID_OK;
}

static void tell(const ov_adaptive *f, size_t count, const ov_judgement *judgement,
                 ovoid_fit_result *result) {
    result->spacing = f->spacing;
    result->points = f->samples.points.count;
    result->parts = result->units = 1;
    result->ellipsoids = count;
    result->iterations = f->steps;
    result->adaptive.solver_iterations = ov_adaptive_solver_iterations(f) - f->solver_before;
    result->distance = judgement->valid && !is_coarse(f) ? judgement->deviation : NAN;
    result->verdict = verdict_of(f, count, judgement);
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
}

/* By both judges, as far as the first one sees it hold; f->quadrics are the model's. */
static ovoid_status judge_closely(ov_adaptive *f, size_t count, ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    const double tolerance = ov_adaptive_held_to(f);
    ov_judge *const judges[2] = {&f->judge, &f->fine};
    bool holds = true;
    for (size_t n = 0; n < (f->finely ? 2 : 1) && holds; ++n) {
        ov_spot *spots = NULL;
        size_t found;
        OV_TRY(ov_judge_spots(judges[n], f->quadrics, ov_adaptive_surround(f, count), tolerance,
                              0.0, 1, judgement, &spots, &found));
        free(spots);
        holds = judgement->valid && judgement->deviation <= tolerance;
    }
cleanup:
    return status;
}

/* What was confirmed may be lost by making the volumes equal, and is then as it was. changed:
 * whether anything was, for that. */
static ovoid_status keep_confirmed(ov_adaptive *f, const ov_trial *best, bool changed,
                                   ov_judgement *judgement) {
    const double tolerance = ov_adaptive_held_to(f);
    ov_judgement closely = best->judgement;
    const ovoid_status status = changed ? judge_closely(f, best->count, &closely) : OVOID_OK;
    if (status != OVOID_OK || (closely.valid && closely.deviation <= tolerance))
        return status;
    if (ov_trial_holds(best, tolerance)) {
        ov_adaptive_quadrics(f, best);
        *judgement = best->judgement;
    } else {
        judgement->valid = judgement->valid && closely.valid;
        judgement->deviation = fmax(judgement->deviation, closely.deviation);
    }
    return OVOID_OK;
}

/* The last judgement, with the volumes made equal. */
static ovoid_status finish(ov_adaptive *f, const ov_trial *best, ov_found *found,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_judgement judgement;
    bool changed;
    ov_adaptive_quadrics(f, best);
    OV_TRY(calibrate(f, best->count, &judgement, &changed));
    if (f->finely || f->judge.slack > 0.0)
        OV_TRY(keep_confirmed(f, best, changed, &judgement));
    OV_TRY(hand_over(f, best, found));
    tell(f, best->count, &judgement, result);
cleanup:
    return status;
}

/* What held when the search was stopped, as it was: no more questions are asked. */
static void rescue(ov_adaptive *f, ov_found *found, ovoid_fit_result *result) {
    if (!f->held)
        return;
    ov_adaptive_quadrics(f, f->held);
    if (hand_over(f, f->held, found) == OVOID_OK)
        tell(f, f->held->count, &f->held->judgement, result);
}

void ov_found_destroy(ov_found *found) {
    free(found->quadrics);
    free(found->owner);
    *found = (ov_found){0};
}

/* ---- the whole ------------------------------------------------------------------------------ */

ovoid_status ov_adaptive_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                const ov_surroundings *around, bool keep, ov_adaptive **adaptive) {
    size_t behind = 0;
    ov_adaptive *f = ov_alloc(context, 1, sizeof *f, "a fit");
    if (!f)
        return OVOID_ERROR_MEMORY;
    *f = (ov_adaptive){.context = context,
                       .xyzr = xyzr,
                       .atoms = atoms,
                       .keep = keep,
                       .capacity = atoms + atoms / 4 + 2,
                       .refiner = {.context = context},
                       .local = {.refiner = {.context = context}}};
    if (around) {
        f->around = *around;
        behind = around->fixed_count + around->images * f->capacity;
        behind = around->atoms > behind ? around->atoms : behind;
    }
    f->quadrics = ov_alloc(context, f->capacity + behind, sizeof *f->quadrics, "ellipsoids");
    f->twin = ov_alloc(context, f->capacity, sizeof *f->twin, "ellipsoids");
    f->parents = ov_alloc(context, 2 * f->capacity, sizeof *f->parents, "merges");
    if (!f->quadrics || !f->twin || !f->parents) {
        ov_adaptive_destroy(&f);
        return OVOID_ERROR_MEMORY;
    }
    *adaptive = f;
    return OVOID_OK;
}

void ov_adaptive_forget(ov_adaptive *f) {
    f->prepared = false;
    ov_adaptive_drop_reductions(f);
    ov_refiner_forget(&f->refiner);
    ov_judge_destroy(&f->judge);
    ov_judge_destroy(&f->fine);
    ov_target_destroy(&f->target);
    ov_samples_destroy(&f->samples);
}

void ov_adaptive_destroy(ov_adaptive **adaptive) {
    ov_adaptive *const f = *adaptive;
    if (!f)
        return;
    ov_adaptive_forget(f);
    ov_refiner_destroy(&f->refiner);
    ov_local_destroy(&f->local);
    ov_merger_destroy(&f->merger);
    free(f->quadrics);
    free(f->twin);
    free(f->parents);
    free(f);
    *adaptive = NULL;
}

ovoid_status ov_adaptive_check(ovoid_context *context, const ovoid_adaptive_options *wanted,
                               size_t atoms) {
    if (wanted->goal == OVOID_GOAL_ELLIPSOIDS && wanted->ellipsoids > atoms)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%llu ellipsoids are asked for, and there are only %zu atoms to begin with",
                       (unsigned long long)wanted->ellipsoids, atoms);
    return OVOID_OK;
}

/* Nothing of the search before stays, so that a second goal comes to the bits that it comes to
 * alone, */
static void begin_search(ov_adaptive *f, const ovoid_fit_options *options, const ov_found *start) {
    f->options = options;
    f->start = start;
    f->fewest = 0;
    f->finely = false;
    f->judge.slack = 0.0;
    f->held = NULL;
    f->steps = 0;
    f->misfit = 0.0;
    f->expected = 0.0;
    f->width_max = ov_tuned.refine_width * sqrt(0.5 / options->decay);
    f->solver_before = ov_adaptive_solver_iterations(f);
}

/* and by the same launches, whether the search before came to its end or was stopped. */
static void begin_launches(ov_adaptive *f) {
    ov_judge_begin(&f->judge);
    ov_refiner_begin(&f->refiner);
    ov_local_begin(&f->local);
}

ovoid_status ov_adaptive_reach(ov_adaptive *f, const ovoid_fit_options *options,
                               const ov_found *start, double began, ov_found *found,
                               ovoid_fit_result *result) {
    ov_device *device;
    uint64_t before[OVOID_COUNTS];
    ov_trial best = {0};
    ovoid_status status = ov_device_get(f->context, &device);
    if (status != OVOID_OK)
        return status;
    ov_device_counted(device, NULL, before);
    begin_search(f, options, start);
    OV_TRY(prepare(f));
    begin_launches(f);
    OV_TRY(ov_trial_create(f, &best));
    result->sample_seconds = ov_seconds() - began;
    OV_TRY(reach_goal(f, &best));
    OV_TRY(finish(f, &best, found, result));
cleanup:
    if (status == OVOID_ERROR_CANCELLED)
        rescue(f, found, result);
    if (status == OVOID_OK || status == OVOID_ERROR_CANCELLED)
        ov_device_counted(device, before, result->counts);
    ov_trial_destroy(&best);
    if (!f->keep)
        ov_judge_destroy(&f->fine);
    f->held = NULL;
    return status;
}
