#include "fit/adaptive.h"

#include "fit/judge.h"
#include "fit/merge.h"
#include "fit/reduce.h"
#include "fit/refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Ellipsoids per atom that a tolerance of 1 angstrom asks for, about, and how the number goes with
 * the tolerance. Only the start of the search. */
#define RATIO_AT_ONE 0.052
#define RATIO_POWER -0.95
/* Growing: rounds at most, the share of the tolerance from which a spot is split, how far apart
 * spots are (angstrom), and the largest share of ellipsoids split at once. */
#define GROW_ROUNDS 10
#define GROW_FROM 0.9
#define GROW_APART 1.5
#define GROW_SHARE 0.25
#define GROW_PATIENCE 2 /* rounds until one more ellipsoid is split at each spot that remains */
/* Steps after a change here and there: counted, since the misfit of the whole says little of them.
 */
#define LOCAL_STEPS 12
/* The weight of points about a spot, each time it is met. */
#define EMPHASIS_REACH 2.0
#define EMPHASIS 1.3
/* Where growing gets stuck, a new start has so many times the ellipsoids. */
#define RESTART 1.3
/* Shrinking: tries, and the share that is merged at first; halved after a failure. */
#define SHRINKS_PER_EFFORT 3
#define SHRINK_SHARE 0.08
/* Repairs: the share of ellipsoids that is split and merged back at first, and how many rounds. */
#define REPAIR_SHARE 0.08
#define REPAIRS_PER_EFFORT 4
/* Volumes are made equal to this relative error, in so many steps at most. */
#define VOLUME_ERROR 1e-4
#define CALIBRATIONS 5
#define CALIBRATION_MOST 0.2 /* of ln a at once */
/* Of the points of a molecule of so many atoms or fewer (angstrom). */
#define SPACING_SMALL 0.35
#define ATOMS_SMALL 40.0
/* How far the band may reach beyond an atom's own surface, in units of 1 / sqrt(2 d). */
#define FIELD_PADDING 2.5

/* The ways to merge that are tried, in this order: which one wins differs by molecule. */
static const ov_reduction_options starts[] = {
    {OV_MERGE_RUNNALLS, 5.0, 0.0},    {OV_MERGE_L2, 5.0, 0.0},
    {OV_MERGE_L2_PER_MASS, 5.0, 6.0}, {OV_MERGE_RUNNALLS, 5.0, 6.0},
    {OV_MERGE_L2_PER_MASS, 5.0, 0.0}, {OV_MERGE_L2, 5.0, 6.0},
};
enum { STARTS = sizeof starts / sizeof *starts };

/* Windows about the surface that are tried, the first one at any effort: a narrow one makes areas
 * better, a wide one distances. Lengths in angstrom for d = 0.5. */
static const struct { double width, floor; } windows[] = {{0.5, 0.05}, {0.3, 0.02}, {0.5, 0.15}};
enum { WINDOWS = sizeof windows / sizeof *windows };

typedef struct fit {
    ovoid_context *context;
    const double *xyzr;
    size_t atoms;
    const ovoid_fit_options *options;
    ov_samples samples;
    ov_target target;
    ov_reduction *reduction[STARTS];
    ov_refiner refiner;
    ov_merger merger;
    ov_judge judge;
    double spacing; /* of the points */
    const char *stage;
    double began;
    uint64_t steps; /* refinement steps so far */
    size_t count;   /* ellipsoids being worked on */
    double misfit;
    size_t capacity; /* ellipsoids that the arrays below hold */
    ov_quadric *quadrics;
    uint32_t *twin;
} fit;

/* A model with what is known of it. */
typedef struct trial {
    double *x; /* room for fit.capacity ellipsoids */
    size_t count;
    double misfit;
    ov_judgement judgement;
} trial;

static ovoid_status trial_create(const fit *f, trial *t) {
    *t = (trial){.x = ov_alloc(f->context, f->capacity * OV_FACTOR_PARAMETERS, sizeof(double),
                               "parameters")};
    return t->x ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static void trial_copy(const trial *from, trial *to) {
    double *const x = to->x;
    memcpy(x, from->x, from->count * OV_FACTOR_PARAMETERS * sizeof *x);
    *to = *from;
    to->x = x;
}

static void trial_swap(trial *a, trial *b) {
    const trial swap = *a;
    *a = *b;
    *b = swap;
}

/* ---- progress ------------------------------------------------------------------------------- */

static bool report(fit *f) {
    const ovoid_progress progress = {.stage = f->stage,
                                     .iteration = f->steps,
                                     .ellipsoids = f->count,
                                     .points = f->samples.points.count,
                                     .accuracy_term = f->misfit,
                                     .accuracy_weight = 1.0,
                                     .objective = f->misfit,
                                     .seconds = ov_seconds() - f->began};
    return !f->options->progress || f->options->progress(&progress, f->options->user);
}

static bool report_sampling(uint64_t points, void *user) {
    fit *const f = user;
    const ovoid_progress progress = {.stage = "sample",
                                     .ellipsoids = f->atoms,
                                     .points = points,
                                     .seconds = ov_seconds() - f->began};
    return !f->options->progress || f->options->progress(&progress, f->options->user);
}

static bool report_step(uint32_t step, double misfit, void *user) {
    fit *const f = user;
    (void)step;
    ++f->steps;
    f->misfit = misfit;
    return report(f);
}

/* ---- parts ---------------------------------------------------------------------------------- */

/* The longest axis, as 1 / sqrt(decay rate), that a step may make (angstrom). */
#define WIDTH_MAX 30.0

static ovoid_status refine(fit *f, trial *t, const char *stage, uint32_t steps, double tolerance,
                           double decrease) {
    const ov_refine_options options = {
        .steps = steps < f->options->adaptive.steps ? steps : f->options->adaptive.steps,
        .solver_steps = 25,
        .solver_tolerance = tolerance,
        .decrease = decrease,
        .damping = 1e-2,
        .width_max = WIDTH_MAX * sqrt(0.5 / f->options->decay),
        .go_on = report_step,
        .user = f,
    };
    f->stage = stage;
    f->count = t->count;
    return ov_refine(&f->refiner, &f->target, &options, t->x, t->count, &t->misfit);
}

static ovoid_status refine_fully(fit *f, trial *t, const char *stage) {
    return refine(f, t, stage, UINT32_MAX, 1e-1, 1e-3);
}

static ovoid_status refine_quickly(fit *f, trial *t, const char *stage) {
    return refine(f, t, stage, 6, 1e-1, 1e-2);
}

static void quadrics_of(fit *f, const trial *t) {
    for (size_t i = 0; i < t->count; ++i)
        ov_factor_quadric(t->x + i * OV_FACTOR_PARAMETERS, &f->quadrics[i]);
}

static ovoid_status judge(fit *f, trial *t) {
    quadrics_of(f, t);
    return ov_judge_model(&f->judge, f->quadrics, t->count, &t->judgement);
}

/* The merged atoms of start `kind` at this count. */
static ovoid_status cut(fit *f, size_t kind, size_t count, trial *t) {
    ovoid_status status = OVOID_OK;
    f->stage = "merge";
    if (!f->reduction[kind]) {
        for (size_t i = 0; i < f->atoms; ++i)
            ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &f->quadrics[i]);
        OV_TRY(ov_reduction_create(f->context, f->quadrics, f->atoms, 1, &starts[kind],
                                   &f->reduction[kind]));
    }
    OV_TRY(ov_reduction_cut(f->context, f->reduction[kind], count, f->quadrics, NULL));
    for (size_t i = 0; i < count; ++i)
        ov_factor_of_quadric(&f->quadrics[i], t->x + i * OV_FACTOR_PARAMETERS);
    t->count = count;
    f->count = count;
    f->misfit = 0.0;
    if (!report(f))
        status = ov_fail(f->context, OVOID_ERROR_CANCELLED, "stopped while merging");
cleanup:
    return status;
}

static void drop_reductions(fit *f) {
    for (size_t k = 0; k < STARTS; ++k)
        ov_reduction_destroy(&f->reduction[k]);
}

/* The best of the first `kinds` starts after a few steps each, refined to the end. */
static ovoid_status start(fit *f, size_t kinds, size_t count, trial *best) {
    ovoid_status status = OVOID_OK;
    trial other = {0};
    if (kinds > 1)
        OV_TRY(trial_create(f, &other));
    OV_TRY(cut(f, 0, count, best));
    if (kinds > 1)
        OV_TRY(refine(f, best, "refine", 12, 1e-1, 3e-3));
    for (size_t kind = 1; kind < kinds; ++kind) {
        OV_TRY(cut(f, kind, count, &other));
        OV_TRY(refine(f, &other, "refine", 12, 1e-1, 3e-3));
        if (other.misfit < best->misfit)
            trial_swap(&other, best);
    }
    drop_reductions(f); /* as large as the molecule, and quick to make again */
    OV_TRY(refine_fully(f, best, "refine"));
cleanup:
    free(other.x);
    return status;
}

/* Lets further refinement aim at the right volume: the window about the surface is not symmetric,
 * and the fit to phi itself comes out a few tenths of a percent too small or too large. */
static ovoid_status aim_at_volume(fit *f, const trial *t) {
    ovoid_status status = OVOID_OK;
    double ratio;
    quadrics_of(f, t);
    OV_TRY(ov_judge_volume(&f->judge, f->quadrics, t->count, &ratio));
    OV_TRY(ov_target_scale(f->context, &f->target, ov_judge_amplitude_factor(&f->judge, ratio)));
cleanup:
    return status;
}

/* Refined from the starts, under one window, and with the right volume but for a little. */
static ovoid_status begin(fit *f, size_t window, size_t kinds, size_t count, trial *best) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_target_window(f->context, &f->target, windows[window].width, windows[window].floor));
    OV_TRY(ov_target_scale(f->context, &f->target, 1.0));
    OV_TRY(start(f, kinds, count, best));
    OV_TRY(aim_at_volume(f, best));
    OV_TRY(refine(f, best, "refine", 5, 1e-1, 1e-3));
cleanup:
    return status;
}

/* ---- a number of ellipsoids ----------------------------------------------------------------- */

/* Splits where the misfit is largest, and merges as many elsewhere. */
static ovoid_status repair_once(fit *f, const trial *from, size_t skip, size_t more, trial *to) {
    ovoid_status status = OVOID_OK;
    double misfit;
    trial_copy(from, to);
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, to->x, to->count, &misfit));
    OV_TRY(ov_split_worst(&f->refiner, &f->merger, &f->target, to->x, &to->count, skip, more,
                          f->twin));
    OV_TRY(refine_quickly(f, to, "repair"));
    OV_TRY(
        ov_merge_cheapest(&f->refiner, &f->merger, &f->target, to->x, &to->count, more, f->twin));
    OV_TRY(refine_fully(f, to, "repair"));
    OV_TRY(judge(f, to));
cleanup:
    return status;
}

static ovoid_status repair(fit *f, trial *best, uint32_t rounds) {
    ovoid_status status = OVOID_OK;
    trial other = {0};
    double share = REPAIR_SHARE;
    size_t skip = 0;
    OV_TRY(trial_create(f, &other));
    for (uint32_t n = 0; n < rounds && best->count > 1 && skip < best->count; ++n) {
        const size_t most = f->capacity - best->count;
        size_t more = (size_t)(share * (double)best->count);
        more = more < 1 ? 1 : more;
        OV_TRY(repair_once(f, best, skip, more < most ? more : most, &other));
        if (other.count == best->count && other.judgement.score < best->judgement.score) {
            trial_swap(&other, best);
            skip = 0;
        } else if (more > 1) {
            share *= 0.5;
        } else {
            ++skip;
        }
    }
cleanup:
    free(other.x);
    return status;
}

/* From the starts to the last repair, under one window. */
static ovoid_status fit_window(fit *f, size_t count, size_t window, trial *best) {
    ovoid_status status = OVOID_OK;
    const uint32_t effort = f->options->adaptive.effort;
    const size_t kinds = 2 * (size_t)effort - 1 < STARTS ? 2 * (size_t)effort - 1 : STARTS;
    OV_TRY(begin(f, window, kinds, count, best));
    if (effort == 1)
        goto cleanup;
    OV_TRY(judge(f, best));
    OV_TRY(repair(f, best, REPAIRS_PER_EFFORT * (effort - 1)));
cleanup:
    return status;
}

static ovoid_status fit_count(fit *f, size_t count, trial *best) {
    ovoid_status status = OVOID_OK;
    trial other = {0};
    OV_TRY(fit_window(f, count, 0, best));
    if (f->options->adaptive.effort == 1)
        goto cleanup;
    OV_TRY(trial_create(f, &other));
    for (size_t window = 1; window < WINDOWS; ++window) {
        OV_TRY(fit_window(f, count, window, &other));
        if (other.judgement.score < best->judgement.score)
            trial_swap(&other, best);
    }
cleanup:
    free(other.x);
    return status;
}

/* ---- a tolerance ---------------------------------------------------------------------------- */

/* ln of an ellipsoid's value at a point. */
static double log_value(const ov_quadric *quadric, const double at[3]) {
    const double *const a = quadric->a;
    const double x = at[0] - quadric->centre[0], y = at[1] - quadric->centre[1],
                 z = at[2] - quadric->centre[2];
    return log(quadric->amplitude) - (a[0] * x * x + a[3] * y * y + a[5] * z * z +
                                      2.0 * (a[1] * x * y + a[2] * x * z + a[4] * y * z));
}

/* The ellipsoid with the largest value at a point of those that are not chosen yet. */
static size_t ellipsoid_at(const ov_quadric *quadrics, size_t count, const bool *chosen,
                           const double at[3]) {
    size_t best = count;
    double largest = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
        const double value = chosen[i] ? -INFINITY : log_value(&quadrics[i], at);
        if (value > largest) {
            largest = value;
            best = i;
        }
    }
    return best;
}

/* Splits the `each` ellipsoids that weigh most at each spot; returns how many that were. */
static size_t split_at_spots(fit *f, trial *t, const ov_spot *spots, size_t spot_count, size_t each,
                             bool *chosen) {
    const size_t before = t->count;
    for (size_t n = 0; n < spot_count; ++n)
        for (size_t k = 0; k < each && t->count < f->atoms; ++k) {
            const size_t i = ellipsoid_at(f->quadrics, before, chosen, spots[n].at);
            if (i == before)
                break;
            chosen[i] = true;
            ov_split(t->x + i * OV_FACTOR_PARAMETERS, t->x + t->count * OV_FACTOR_PARAMETERS);
            ++t->count;
        }
    return t->count - before;
}

/* Judges, and splits `each` ellipsoids at every spot that is off; *more of them. */
static ovoid_status grow_once(fit *f, trial *t, double tolerance, size_t each, size_t *more) {
    ovoid_status status = OVOID_OK;
    ov_spot *spots = NULL;
    const size_t most = (size_t)(GROW_SHARE * (double)t->count) + 1;
    size_t spot_count = 0;
    bool *const chosen = ov_alloc(f->context, t->count, sizeof *chosen, "splits");
    *more = 0;
    if (!chosen)
        return OVOID_ERROR_MEMORY;
    quadrics_of(f, t);
    OV_TRY(ov_judge_spots(&f->judge, f->quadrics, t->count, GROW_FROM * tolerance, GROW_APART, most,
                          &t->judgement, &spots, &spot_count));
    if (!t->judgement.valid || t->judgement.deviation <= tolerance)
        goto cleanup;
    OV_TRY(ov_target_emphasise(f->context, &f->target, spots->at, sizeof *spots, spot_count,
                               EMPHASIS_REACH, EMPHASIS));
    *more = split_at_spots(f, t, spots, spot_count, each, chosen);
cleanup:
    free(chosen);
    free(spots);
    return status;
}

static ovoid_status grow(fit *f, double tolerance, trial *best) {
    ovoid_status status = OVOID_OK;
    trial next = {0}, now = {0};
    size_t more;
    OV_TRY(trial_create(f, &next));
    OV_TRY(trial_create(f, &now));
    trial_copy(best, &next);
    for (int n = 0; n < GROW_ROUNDS; ++n) {
        const size_t before = next.count;
        trial_copy(&next, &now);
        OV_TRY(grow_once(f, &next, tolerance, 1 + (size_t)n / GROW_PATIENCE, &more));
        now.judgement = next.judgement;
        if (n == 0 || now.judgement.deviation < best->judgement.deviation)
            trial_copy(&now, best);
        if (more == 0 || before == f->atoms)
            break;
        OV_TRY(refine(f, &next, "grow", LOCAL_STEPS, 1e-1, 1e-5));
    }
cleanup:
    free(now.x);
    free(next.x);
    return status;
}

/* Merges what costs least as long as the tolerance holds. */
static ovoid_status shrink(fit *f, double tolerance, uint32_t tries, trial *best) {
    ovoid_status status = OVOID_OK;
    trial next = {0};
    double share = SHRINK_SHARE, misfit;
    OV_TRY(trial_create(f, &next));
    for (uint32_t failures = 0; failures < tries && best->count > 1;) {
        const size_t fewer = (size_t)(share * (double)best->count) + 1;
        trial_copy(best, &next);
        OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, next.x, next.count, &misfit));
        OV_TRY(ov_merge_cheapest(&f->refiner, &f->merger, &f->target, next.x, &next.count, fewer,
                                 NULL));
        OV_TRY(refine(f, &next, "shrink", LOCAL_STEPS, 1e-1, 1e-5));
        OV_TRY(judge(f, &next));
        if (next.count < best->count && next.judgement.deviation <= tolerance) {
            trial_swap(&next, best);
        } else {
            if (fewer == 1)
                break;
            share *= 0.4;
            ++failures;
        }
    }
cleanup:
    free(next.x);
    return status;
}

/* The atoms themselves: the field and its surface, exactly. */
static ovoid_status take_atoms(fit *f, trial *t) {
    const ovoid_status status = cut(f, 0, f->atoms, t);
    return status != OVOID_OK ? status : judge(f, t);
}

static ovoid_status start_and_grow(fit *f, double tolerance, size_t count, trial *best) {
    ovoid_status status = OVOID_OK;
    OV_TRY(begin(f, 0, f->options->adaptive.effort > 1 ? 3 : 1, count, best));
    OV_TRY(grow(f, tolerance, best));
cleanup:
    return status;
}

static bool within(const trial *t, double tolerance) {
    return t->judgement.valid && t->judgement.deviation <= tolerance;
}

/* Where growing gets stuck, another start with more ellipsoids; in the end the atoms. */
static ovoid_status fit_tolerance(fit *f, double tolerance, trial *best) {
    ovoid_status status = OVOID_OK;
    const double guess = RATIO_AT_ONE * pow(tolerance, RATIO_POWER) * (double)f->atoms;
    size_t count = (size_t)fmin(fmax(round(guess), 1.0), (double)f->atoms);
    bool reached = false;
    while (!reached && count < f->atoms) {
        OV_TRY(start_and_grow(f, tolerance, count, best));
        reached = within(best, tolerance) || f->options->adaptive.steps == 0 || !f->judge.mesh;
        count = (size_t)fmin(ceil(RESTART * (double)best->count), (double)f->atoms);
    }
    if (!reached)
        OV_TRY(take_atoms(f, best));
    if (within(best, tolerance))
        OV_TRY(shrink(f, tolerance, SHRINKS_PER_EFFORT * f->options->adaptive.effort, best));
cleanup:
    return status;
}

/* ---- the whole ------------------------------------------------------------------------------ */

/* Small molecules have few points at any spacing, and so few that more of them help. */
static double default_spacing(size_t atoms) {
    const double small = SPACING_SMALL * pow((double)atoms / ATOMS_SMALL, 0.25);
    return fmin(fmax(small, SPACING_SMALL), OVOID_DEFAULT_SPACING_ADAPTIVE);
}

static ovoid_status prepare(fit *f) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options *const options = f->options;
    f->spacing = options->spacing > 0.0 ? options->spacing : default_spacing(f->atoms);
    double radius = 0.0;
    ov_target_options targets;
    ov_lattice lattice;
    ov_target_options_init(&targets);
    for (size_t i = 0; i < f->atoms; ++i)
        radius = fmax(radius, f->xyzr[4 * i + 3]);
    const double reach = radius * radius - log(options->isovalue) / options->decay;
    const double padding =
        fmax(options->padding, sqrt(fmax(reach, 0.0)) + FIELD_PADDING / sqrt(2.0 * options->decay));
    const ov_band band = {.low = targets.low * options->isovalue,
                          .high = targets.high * options->isovalue,
                          .inside_every = targets.inside_every,
                          .outside_low = targets.outside_low * options->isovalue,
                          .outside_every = targets.outside_every};
    const ov_sampling sampling = {.go_on = report_sampling, .user = f};
    f->capacity = f->atoms + f->atoms / 4 + 2;
    f->quadrics = ov_alloc(f->context, f->capacity, sizeof *f->quadrics, "ellipsoids");
    f->twin = ov_alloc(f->context, f->capacity, sizeof *f->twin, "ellipsoids");
    if (!f->quadrics || !f->twin)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_lattice_create(f->context, f->xyzr, f->atoms, f->spacing, padding, &lattice));
    OV_TRY(ov_sample(f->context, f->xyzr, f->atoms, options->decay, &lattice, band, sampling,
                     &f->samples));
    OV_TRY(ov_target_create(f->context, &f->samples, options->decay, options->isovalue, &targets,
                            &f->target));
    ov_buffer_destroy(&f->samples.value); /* the target has taken over what it needs */
    ov_buffer_destroy(&f->samples.gradient);
    OV_TRY(ov_judge_create(f->context, f->xyzr, f->atoms, options->decay, options->isovalue,
                           options->adaptive.mesh_spacing, &f->judge));
cleanup:
    return status;
}

static ovoid_status reach_goal(fit *f, trial *best) {
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    switch (wanted->goal) {
    case OVOID_GOAL_ELLIPSOIDS:
        return fit_count(f, (size_t)wanted->ellipsoids, best);
    case OVOID_GOAL_RATIO:
        return fit_count(f, (size_t)fmax(1.0, round(wanted->ratio * (double)f->atoms)), best);
    case OVOID_GOAL_TOLERANCE:
        break;
    }
    return fit_tolerance(f, wanted->tolerance, best);
}

static void multiply_amplitudes(fit *f, size_t count, double factor) {
    for (size_t i = 0; i < count; ++i)
        f->quadrics[i].amplitude *= factor;
}

/* ln of the factor for all amplitudes that makes the volumes equal; per_log: what the volume ratio
 * gained per unit of it last time, 0 if nobody knows. */
static double log_calibration(const fit *f, double volume_ratio, double per_log) {
    const double step = per_log > 0.0 ? (1.0 - volume_ratio) / per_log
                                      : log(ov_judge_amplitude_factor(&f->judge, volume_ratio));
    return fmin(fmax(step, -CALIBRATION_MOST), CALIBRATION_MOST);
}

/* Distances only matter on the way where a tolerance may be lost. */
static ovoid_status judge_volume(fit *f, size_t count, ov_judgement *judgement) {
    if (f->options->adaptive.goal == OVOID_GOAL_TOLERANCE)
        return ov_judge_model(&f->judge, f->quadrics, count, judgement);
    *judgement = (ov_judgement){.valid = true};
    return ov_judge_volume(&f->judge, f->quadrics, count, &judgement->volume_ratio);
}

/* Makes the volumes equal by a factor of all amplitudes, unless that loses the tolerance. */
static ovoid_status calibrate(fit *f, size_t count, ov_judgement *judgement) {
    ovoid_status status = OVOID_OK;
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    double per_log = 0.0;
    OV_TRY(judge_volume(f, count, judgement));
    for (int n = 0; n < CALIBRATIONS && judgement->valid && wanted->steps > 0 &&
                    fabs(judgement->volume_ratio - 1.0) > VOLUME_ERROR;
         ++n) {
        const double step = log_calibration(f, judgement->volume_ratio, per_log);
        ov_judgement after;
        multiply_amplitudes(f, count, exp(step));
        OV_TRY(judge_volume(f, count, &after));
        per_log = (after.volume_ratio - judgement->volume_ratio) / step;
        const bool lost = wanted->goal == OVOID_GOAL_TOLERANCE &&
                          after.deviation > wanted->tolerance &&
                          judgement->deviation <= wanted->tolerance;
        if (!lost && fabs(after.volume_ratio - 1.0) < fabs(judgement->volume_ratio - 1.0))
            *judgement = after;
        else
            multiply_amplitudes(f, count, exp(-step)); /* too far */
        if (lost)
            break;
    }
    if (wanted->goal != OVOID_GOAL_TOLERANCE)
        OV_TRY(ov_judge_model(&f->judge, f->quadrics, count, judgement));
cleanup:
    return status;
}

/* The last judgement, and the model in the paper's parameters. */
static ovoid_status finish(fit *f, trial *best, ovoid_ellipsoid **ellipsoids,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    const ovoid_adaptive_options *const wanted = &f->options->adaptive;
    ov_judgement judgement;
    quadrics_of(f, best);
    OV_TRY(calibrate(f, best->count, &judgement));
    *ellipsoids = ov_alloc(f->context, best->count, sizeof **ellipsoids, "ellipsoids");
    if (!*ellipsoids)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < best->count; ++i)
        ov_ellipsoid_of_quadric(&f->quadrics[i], &(*ellipsoids)[i]);
    result->spacing = f->spacing;
    result->points = f->samples.points.count;
    result->ellipsoids = best->count;
    result->iterations = f->steps;
    result->solver_iterations = f->refiner.solver.iterations;
    result->distance = judgement.valid ? judgement.deviation : NAN;
    result->reached = wanted->goal != OVOID_GOAL_TOLERANCE || !f->judge.mesh ||
                      (judgement.valid && judgement.deviation <= wanted->tolerance);
cleanup:
    return status;
}

static void destroy(fit *f) {
    drop_reductions(f);
    ov_refiner_destroy(&f->refiner);
    ov_merger_destroy(&f->merger);
    ov_judge_destroy(&f->judge);
    ov_target_destroy(&f->target);
    ov_samples_destroy(&f->samples);
    free(f->quadrics);
    free(f->twin);
}

ovoid_status ov_adaptive_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                             const ovoid_fit_options *options, double began,
                             ovoid_ellipsoid **ellipsoids, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    trial best = {0};
    fit f = {.context = context,
             .xyzr = xyzr,
             .atoms = atoms,
             .options = options,
             .began = began,
             .refiner = {.context = context}};
    if (options->adaptive.goal == OVOID_GOAL_ELLIPSOIDS && options->adaptive.ellipsoids > atoms)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%llu ellipsoids are asked for, and there are only %zu atoms to begin with",
                       (unsigned long long)options->adaptive.ellipsoids, atoms);
    OV_TRY(ov_device_get(context, &device));
    const uint64_t launches = device->launches;
    OV_TRY(prepare(&f));
    OV_TRY(trial_create(&f, &best));
    result->sample_seconds = ov_seconds() - began;
    OV_TRY(reach_goal(&f, &best));
    OV_TRY(finish(&f, &best, ellipsoids, result));
    result->profile.launches = device->launches - launches;
cleanup:
    free(best.x);
    destroy(&f);
    return status;
}
