#include "fit/adaptive/parts.h"

#include "base/progress.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The ways to merge that are tried, in this order: which one wins differs by molecule. */
static const ov_reduction_options starts[OV_STARTS] = {
    {OV_MERGE_RUNNALLS, 5.0, 0.0},    {OV_MERGE_L2, 5.0, 0.0},
    {OV_MERGE_L2_PER_MASS, 5.0, 6.0}, {OV_MERGE_RUNNALLS, 5.0, 6.0},
    {OV_MERGE_L2_PER_MASS, 5.0, 0.0}, {OV_MERGE_L2, 5.0, 6.0},
};

/* Windows about the surface that are tried, the first one at any effort: a narrow one makes areas
 * better, a wide one distances. Lengths in angstrom for d = 0.5. */
static const struct {
    double width, floor;
} windows[OV_WINDOWS] = {{0.5, 0.05}, {0.3, 0.02}, {0.5, 0.15}};

/* Those that are refined alone are at most this share of all. */
#define SOME_MOST 0.5

ovoid_status ov_trial_create(const ov_adaptive *f, ov_trial *t) {
    *t = (ov_trial){
        .x = ov_alloc(f->context, f->capacity * OV_FACTOR_PARAMETERS, sizeof(double), "parameters"),
        .owner = ov_alloc(f->context, f->atoms, sizeof *t->owner, "owners"),
        .atoms = f->atoms};
    return t->x && t->owner ? OVOID_OK : OVOID_ERROR_MEMORY;
}

void ov_trial_destroy(ov_trial *t) {
    free(t->x);
    free(t->owner);
    *t = (ov_trial){0};
}

void ov_trial_copy(const ov_trial *from, ov_trial *to) {
    double *const x = to->x;
    uint32_t *const owner = to->owner;
    memcpy(x, from->x, from->count * OV_FACTOR_PARAMETERS * sizeof *x);
    memcpy(owner, from->owner, from->atoms * sizeof *owner);
    *to = *from;
    to->x = x;
    to->owner = owner;
}

void ov_trial_swap(ov_trial *a, ov_trial *b) {
    const ov_trial swap = *a;
    *a = *b;
    *b = swap;
}

uint64_t ov_adaptive_solver_iterations(const ov_adaptive *f) {
    return f->refiner.solver.iterations + f->local.refiner.solver.iterations;
}

/* ---- progress ------------------------------------------------------------------------------- */

bool ov_adaptive_report(void *fit) {
    const ov_adaptive *const f = fit;
    const ovoid_progress progress = {.stage = f->stage,
                                     .iteration = f->steps,
                                     .ellipsoids = f->count,
                                     .points = f->samples.points.count,
                                     .adaptive.misfit = f->misfit};
    return ov_progress_report(f->context, &progress);
}

static bool report_step(uint32_t step, double misfit, void *user) {
    ov_adaptive *const f = user;
    (void)step;
    ++f->steps;
    f->misfit = misfit;
    return ov_adaptive_report(f);
}

/* ---- parts ---------------------------------------------------------------------------------- */

/* The longest axis, as 1 / sqrt(decay rate), that a step may make (angstrom). */
#define WIDTH_MAX 50.0

void ov_adaptive_quadrics(ov_adaptive *f, const ov_trial *t) {
    for (size_t i = 0; i < t->count; ++i)
        ov_factor_quadric(t->x + i * OV_FACTOR_PARAMETERS, &f->quadrics[i]);
}

static ov_refine_options refine_options(ov_adaptive *f, uint32_t steps, double tolerance,
                                        double decrease) {
    return (ov_refine_options){
        .steps = steps < f->options->adaptive.steps ? steps : f->options->adaptive.steps,
        .solver_steps = 25,
        .solver_tolerance = tolerance,
        .decrease = decrease,
        .damping = 1e-2,
        .width_max = WIDTH_MAX * sqrt(0.5 / f->options->decay),
        .go_on = report_step,
        .user = f,
    };
}

ovoid_status ov_adaptive_refine(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                double tolerance, double decrease) {
    const ov_refine_options options = refine_options(f, steps, tolerance, decrease);
    f->stage = stage;
    f->count = t->count;
    return ov_refine(&f->refiner, &f->target, &options, t->x, t->count, &t->misfit);
}

ovoid_status ov_adaptive_refine_some(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                     const bool *chosen) {
    const ov_refine_options options = refine_options(f, steps, 1e-1, 1e-5);
    size_t some = 0;
    double misfit;
    for (size_t i = 0; i < t->count; ++i)
        some += chosen[i];
    if ((double)some > SOME_MOST * (double)t->count)
        return ov_adaptive_refine(f, t, stage, steps, 1e-1, 1e-5);
    f->stage = stage;
    f->count = t->count;
    return ov_refine_some(&f->local, &f->target, &options, t->x, t->count, chosen, &misfit);
}

ovoid_status ov_adaptive_refine_fully(ov_adaptive *f, ov_trial *t, const char *stage) {
    return ov_adaptive_refine(f, t, stage, UINT32_MAX, 1e-1, 1e-3);
}

ovoid_status ov_adaptive_refine_quickly(ov_adaptive *f, ov_trial *t, const char *stage) {
    return ov_adaptive_refine(f, t, stage, 6, 1e-1, 1e-2);
}

ovoid_status ov_adaptive_share_atoms(ov_adaptive *f, ov_trial *t) {
    ov_adaptive_quadrics(f, t);
    return ov_owner_split(f->context, f->xyzr, f->atoms, f->quadrics, t->count, f->twin, t->owner);
}

ovoid_status ov_adaptive_judge(ov_adaptive *f, ov_trial *t) {
    ov_adaptive_quadrics(f, t);
    return ov_judge_model(&f->judge, f->quadrics, t->count, &t->judgement);
}

const ov_reduction_options *ov_adaptive_merging(void) {
    return &starts[0];
}

ovoid_status ov_adaptive_cut(ov_adaptive *f, size_t kind, size_t count, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    f->stage = "merge";
    if (!f->reduction[kind]) {
        ov_progress_stage(f->context, f->stage);
        for (size_t i = 0; i < f->atoms; ++i)
            ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &f->quadrics[i]);
        OV_TRY(ov_reduction_create(f->context, f->quadrics, f->atoms, 1, &starts[kind],
                                   &f->reduction[kind]));
    }
    OV_TRY(ov_reduction_cut(f->context, f->reduction[kind], count, f->quadrics, t->owner));
    for (size_t i = 0; i < count; ++i)
        ov_factor_of_quadric(&f->quadrics[i], t->x + i * OV_FACTOR_PARAMETERS);
    t->count = count;
    OV_TRY(ov_adaptive_sort(f, t));
    f->count = count;
    f->misfit = 0.0;
    if (!ov_adaptive_report(f))
        status = ov_fail(f->context, OVOID_ERROR_CANCELLED, "stopped while merging");
cleanup:
    return status;
}

void ov_adaptive_drop_reductions(ov_adaptive *f) {
    for (size_t k = 0; k < OV_STARTS; ++k)
        ov_reduction_destroy(&f->reduction[k]);
}

/* The best of the first `kinds` starts after a few steps each, refined to the end. */
static ovoid_status start(ov_adaptive *f, size_t kinds, size_t count, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial other = {0};
    if (kinds > 1)
        OV_TRY(ov_trial_create(f, &other));
    OV_TRY(ov_adaptive_cut(f, 0, count, best));
    if (f->options->adaptive.goal != OVOID_GOAL_TOLERANCE && !f->held)
        f->held = best; /* so many it are, and each step makes them better */
    if (kinds > 1)
        OV_TRY(ov_adaptive_refine(f, best, "refine", 12, 1e-1, 3e-3));
    for (size_t kind = 1; kind < kinds; ++kind) {
        OV_TRY(ov_adaptive_cut(f, kind, count, &other));
        OV_TRY(ov_adaptive_refine(f, &other, "refine", 12, 1e-1, 3e-3));
        if (other.misfit < best->misfit)
            ov_trial_swap(&other, best);
    }
    if (!f->keep)
        ov_adaptive_drop_reductions(f); /* as large as the molecule, and quick to make again */
    OV_TRY(ov_adaptive_refine_fully(f, best, "refine"));
cleanup:
    ov_trial_destroy(&other);
    return status;
}

/* The window about the surface is not symmetric, and the fit to phi itself comes out a few tenths
 * of a percent too small or too large. */
ovoid_status ov_adaptive_aim_at_volume(ov_adaptive *f, const ov_trial *t) {
    ovoid_status status = OVOID_OK;
    double ratio;
    ov_adaptive_quadrics(f, t);
    OV_TRY(ov_judge_volume(&f->judge, f->quadrics, t->count, &ratio));
    OV_TRY(ov_target_scale(f->context, &f->target, ov_judge_amplitude_factor(&f->judge, ratio)));
cleanup:
    return status;
}

ovoid_status ov_adaptive_aim(ov_adaptive *f, size_t window) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_target_window(f->context, &f->target, windows[window].width, windows[window].floor));
    OV_TRY(ov_target_scale(f->context, &f->target, 1.0));
cleanup:
    return status;
}

ovoid_status ov_adaptive_begin(ov_adaptive *f, size_t window, size_t kinds, size_t count,
                               ov_trial *best) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_adaptive_aim(f, window));
    OV_TRY(start(f, kinds, count, best));
    OV_TRY(ov_adaptive_aim_at_volume(f, best));
    OV_TRY(ov_adaptive_refine(f, best, "refine", 5, 1e-1, 1e-3));
cleanup:
    return status;
}
