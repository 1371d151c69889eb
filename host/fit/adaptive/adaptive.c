#include "fit/adaptive/parts.h"

#include "base/progress.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Volumes are made equal to this relative error, in so many steps at most. */
#define VOLUME_ERROR 1e-4
#define CALIBRATIONS 5
#define CALIBRATION_MOST 0.2 /* of ln a at once */
/* Of the points of a molecule of so many atoms or fewer (angstrom). */
#define SPACING_SMALL 0.35
#define ATOMS_SMALL 40.0
/* How far the band may reach beyond an atom's own surface, in units of 1 / sqrt(2 d). */
#define FIELD_PADDING 2.5

static bool report_sampling(uint64_t points, void *user) {
    ov_adaptive *const f = user;
    const ovoid_progress progress = {.stage = "sample", .ellipsoids = f->atoms, .points = points};
    return ov_progress_report(f->context, &progress);
}

/* Small molecules have few points at any spacing, and so few that more of them help. The field of
 * a larger decay rate has smaller features; that of a smaller one has fewer, and as many points. */
static double default_spacing(size_t atoms, double decay) {
    const double small = SPACING_SMALL * pow((double)atoms / ATOMS_SMALL, 0.25);
    return fmin(fmax(small, SPACING_SMALL), OVOID_DEFAULT_SPACING_ADAPTIVE) *
           fmin(1.0, sqrt(0.5 / decay));
}

static ovoid_status prepare(ov_adaptive *f) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options *const options = f->options;
    f->spacing =
        options->spacing > 0.0 ? options->spacing : default_spacing(f->atoms, options->decay);
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
    f->parents = ov_alloc(f->context, 2 * f->capacity, sizeof *f->parents, "merges");
    if (!f->quadrics || !f->twin || !f->parents)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_lattice_create(f->context, f->xyzr, f->atoms, f->spacing, padding, &lattice));
    OV_TRY(ov_sample(f->context, f->xyzr, f->atoms, options->decay, &lattice, band, sampling,
                     &f->samples));
    OV_TRY(ov_target_create(f->context, &f->samples, options->decay, options->isovalue, &targets,
                            &f->target));
    ov_buffer_destroy(&f->samples.value); /* the target has taken over what it needs */
    ov_buffer_destroy(&f->samples.gradient);
    f->stage = "mesh";
    f->count = f->atoms;
    OV_TRY(ov_judge_create(f->context, f->xyzr, f->atoms, options->decay, options->isovalue,
                           options->adaptive.mesh_spacing,
                           (ov_watch){.go_on = ov_adaptive_report, .user = f}, &f->judge));
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
    return ov_adaptive_tolerance(f, wanted->tolerance, best);
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
    return fmin(fmax(step, -CALIBRATION_MOST), CALIBRATION_MOST);
}

/* Distances only matter on the way where a tolerance may be lost. */
static ovoid_status judge_volume(ov_adaptive *f, size_t count, ov_judgement *judgement) {
    if (f->options->adaptive.goal == OVOID_GOAL_TOLERANCE)
        return ov_judge_model(&f->judge, f->quadrics, count, judgement);
    *judgement = (ov_judgement){.valid = true};
    return ov_judge_volume(&f->judge, f->quadrics, count, &judgement->volume_ratio);
}

/* Makes the volumes equal by a factor of all amplitudes, unless that loses the tolerance. */
static ovoid_status calibrate(ov_adaptive *f, size_t count, ov_judgement *judgement) {
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

/* The last judgement, and the model in the paper's parameters. */
static ovoid_status finish(ov_adaptive *f, ov_trial *best, ovoid_ellipsoid **ellipsoids,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_judgement judgement;
    ov_adaptive_quadrics(f, best);
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
    result->adaptive.solver_iterations =
        f->refiner.solver.iterations + f->local.refiner.solver.iterations;
    result->distance = judgement.valid && !is_coarse(f) ? judgement.deviation : NAN;
    result->verdict = verdict_of(f, best->count, &judgement);
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
cleanup:
    return status;
}

static void destroy(ov_adaptive *f) {
    ov_adaptive_drop_reductions(f);
    ov_refiner_destroy(&f->refiner);
    ov_local_destroy(&f->local);
    ov_merger_destroy(&f->merger);
    ov_judge_destroy(&f->judge);
    ov_target_destroy(&f->target);
    ov_samples_destroy(&f->samples);
    free(f->quadrics);
    free(f->twin);
    free(f->parents);
}

ovoid_status ov_adaptive_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                             const ovoid_fit_options *options, double began,
                             ovoid_ellipsoid **ellipsoids, uint32_t **owner,
                             ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    uint64_t before[OVOID_COUNTS];
    ov_trial best = {0};
    ov_adaptive f = {.context = context,
                     .xyzr = xyzr,
                     .atoms = atoms,
                     .options = options,
                     .refiner = {.context = context},
                     .local = {.refiner = {.context = context}}};
    if (options->adaptive.goal == OVOID_GOAL_ELLIPSOIDS && options->adaptive.ellipsoids > atoms)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%llu ellipsoids are asked for, and there are only %zu atoms to begin with",
                       (unsigned long long)options->adaptive.ellipsoids, atoms);
    OV_TRY(ov_device_get(context, &device));
    ov_device_counted(device, NULL, before);
    OV_TRY(prepare(&f));
    OV_TRY(ov_trial_create(&f, &best));
    result->sample_seconds = ov_seconds() - began;
    OV_TRY(reach_goal(&f, &best));
    OV_TRY(finish(&f, &best, ellipsoids, result));
    *owner = best.owner;
    best.owner = NULL;
    ov_device_counted(device, before, result->counts);
cleanup:
    ov_trial_destroy(&best);
    destroy(&f);
    return status;
}
