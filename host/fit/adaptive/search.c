#include "fit/adaptive/search.h"

#include "base/progress.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The ways to merge that are tried, in this order: which one wins differs by molecule. */
static const struct {
    ov_merge_cost cost;
    bool inside_first;
} starts[OV_STARTS] = {
    {OV_MERGE_RUNNALLS, false}, {OV_MERGE_L2, false},          {OV_MERGE_L2_PER_MASS, true},
    {OV_MERGE_RUNNALLS, true},  {OV_MERGE_L2_PER_MASS, false}, {OV_MERGE_L2, true},
};

static ov_reduction_options merging(size_t kind) {
    return (ov_reduction_options){
        .cost = starts[kind].cost,
        .reach = ov_tuned.atoms_reach,
        .inside = starts[kind].inside_first ? ov_tuned.atoms_inside : 0.0,
    };
}

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
                                     .done = f->around.done,
                                     .total = f->around.total,
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

void ov_adaptive_quadrics(ov_adaptive *f, const ov_trial *t) {
    for (size_t i = 0; i < t->count; ++i)
        ov_factor_quadric(t->x + i * OV_FACTOR_PARAMETERS, &f->quadrics[i]);
}

size_t ov_adaptive_surround(ov_adaptive *f, size_t count) {
    const size_t fixed = f->around.fixed_count;
    const double floor = ov_tuned.refine_cutoff * f->options->isovalue;
    size_t all = count + fixed;
    if (fixed > 0)
        memcpy(f->quadrics + count, f->around.fixed, fixed * sizeof *f->quadrics);
    for (size_t g = 0; g < f->around.images; ++g)
        for (size_t i = 0; i < count; ++i) {
            ov_quadric_move(&f->quadrics[i], &f->around.image[g], &f->quadrics[all]);
            all += ov_quadric_meets(&f->quadrics[all], floor, f->around.region.low,
                                    f->around.region.high);
        }
    return all;
}

ovoid_status ov_adaptive_volume(ov_adaptive *f, size_t count, double *ratio) {
    const double *const others = f->xyzr + 4 * f->atoms;
    *ratio = 1.0;
    if (ov_adaptive_is_patch(f) && f->options->adaptive.goal != OVOID_GOAL_TOLERANCE)
        return OVOID_OK; /* few ellipsoids, which would have to make up for all about them */
    for (size_t i = 0; i < f->around.atoms; ++i)
        ov_quadric_of_atom(others + 4 * i, f->options->decay, &f->quadrics[count + i]);
    return ov_judge_volume(&f->judge, f->quadrics, count + f->around.atoms, ratio);
}

static ov_refine_options refine_options(ov_adaptive *f, uint32_t steps, double decrease) {
    const bool coarse = f->expected > 0.0;
    return (ov_refine_options){
        .steps = steps < f->options->adaptive.steps ? steps : f->options->adaptive.steps,
        .solver_steps = ov_tuned.refine_solver_steps,
        .solver_tolerance =
            coarse ? ov_tuned.coarse_solver_tolerance : ov_tuned.refine_solver_tolerance,
        .decrease = coarse ? fmax(decrease, ov_tuned.coarse_gain) : decrease,
        .damping = ov_tuned.refine_damping,
        .width_max = f->width_max,
        .go_on = report_step,
        .user = f,
    };
}

ovoid_status ov_adaptive_refine(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                double decrease) {
    const ov_refine_options options = refine_options(f, steps, decrease);
    f->stage = stage;
    f->count = t->count;
    return ov_refine(&f->refiner, &f->target, &options, t->x, t->count, &t->misfit);
}

ovoid_status ov_adaptive_refine_some(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                     const bool *chosen) {
    const ov_refine_options options = refine_options(f, steps, ov_tuned.refine_local_gain);
    size_t some = 0;
    double misfit;
    for (size_t i = 0; i < t->count; ++i)
        some += chosen[i];
    if ((double)some > ov_tuned.refine_local_most * (double)t->count)
        return ov_adaptive_refine(f, t, stage, steps, ov_tuned.refine_local_gain);
    f->stage = stage;
    f->count = t->count;
    return ov_refine_some(&f->local, &f->target, &options, t->x, t->count, chosen, &misfit);
}

ovoid_status ov_adaptive_refine_fully(ov_adaptive *f, ov_trial *t, const char *stage) {
    return ov_adaptive_refine(f, t, stage, UINT32_MAX, ov_tuned.refine_gain);
}

ovoid_status ov_adaptive_refine_quickly(ov_adaptive *f, ov_trial *t, const char *stage) {
    return ov_adaptive_refine(f, t, stage, ov_tuned.refine_quick_steps, ov_tuned.refine_quick_gain);
}

ovoid_status ov_adaptive_share_atoms(ov_adaptive *f, ov_trial *t) {
    ov_adaptive_quadrics(f, t);
    return ov_owner_split(f->context, f->xyzr, f->atoms, f->quadrics, t->count, f->twin, t->owner);
}

ovoid_status ov_adaptive_judge(ov_adaptive *f, ov_trial *t) {
    ov_adaptive_quadrics(f, t);
    const size_t count = ov_adaptive_surround(f, t->count);
    return ov_judge_model(&f->judge, f->quadrics, count, &t->judgement);
}

ov_reduction_options ov_adaptive_merging(void) {
    return merging(0);
}

ovoid_status ov_adaptive_cut(ov_adaptive *f, size_t kind, size_t count, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    const ov_reduction_options options = merging(kind);
    f->stage = "merge";
    if (!f->reduction[kind]) {
        ov_progress_stage(f->context, f->stage);
        for (size_t i = 0; i < f->atoms; ++i)
            ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &f->quadrics[i]);
        OV_TRY(ov_reduction_create(f->context, f->quadrics, f->atoms, 1, &options,
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

/* Far enough to tell a good start from a bad one. */
static ovoid_status compare(ov_adaptive *f, ov_trial *t) {
    return ov_adaptive_refine(f, t, "refine", ov_tuned.count_start_steps,
                              ov_tuned.count_start_gain);
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
        OV_TRY(compare(f, best));
    for (size_t kind = 1; kind < kinds; ++kind) {
        OV_TRY(ov_adaptive_cut(f, kind, count, &other));
        OV_TRY(compare(f, &other));
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
    OV_TRY(ov_adaptive_volume(f, t->count, &ratio));
    OV_TRY(ov_target_scale(f->context, &f->target, ov_judge_amplitude_factor(&f->judge, ratio)));
cleanup:
    return status;
}

ovoid_status ov_adaptive_aim(ov_adaptive *f, size_t window) {
    ovoid_status status = OVOID_OK;
    const struct {
        double width, floor;
    } windows[OV_WINDOWS] = {{ov_tuned.target_window, ov_tuned.target_floor},
                             {ov_tuned.count_window_narrow, ov_tuned.count_floor_narrow},
                             {ov_tuned.count_window_wide, ov_tuned.count_floor_wide}};
    const double wide = fmin(ov_tuned.coarse_window * f->expected, ov_tuned.coarse_window_max);
    OV_TRY(ov_target_window(f->context, &f->target, fmax(windows[window].width, wide),
                            windows[window].floor));
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
    OV_TRY(
        ov_adaptive_refine(f, best, "refine", ov_tuned.refine_volume_steps, ov_tuned.refine_gain));
cleanup:
    return status;
}
