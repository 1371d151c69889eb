#include "fit/adaptive/sharpen.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Splits where the misfit is largest, and merges as many elsewhere. */
static ovoid_status repair_once(ov_adaptive *f, const ov_trial *from, size_t skip, size_t more,
                                ov_trial *to) {
    ovoid_status status = OVOID_OK;
    double misfit;
    size_t split;
    const ov_merging merging = {.twin = f->twin, .parents = f->parents};
    ov_trial_copy(from, to);
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, to->x, to->count, &misfit));
    OV_TRY(ov_split_worst(&f->refiner, &f->merger, &f->target, to->x, &to->count, skip, more,
                          f->twin));
    OV_TRY(ov_adaptive_refine_quickly(f, to, "repair"));
    OV_TRY(ov_adaptive_share_atoms(f, to));
    split = to->count;
    OV_TRY(
        ov_merge_cheapest(&f->refiner, &f->merger, &f->target, to->x, &to->count, more, &merging));
    OV_TRY(
        ov_owner_merge(f->context, f->parents, to->count, split, to->owner, f->atoms, to->owner));
    OV_TRY(ov_adaptive_sort(f, to));
    OV_TRY(ov_adaptive_refine_fully(f, to, "repair"));
    OV_TRY(ov_adaptive_judge(f, to));
cleanup:
    return status;
}

static ovoid_status repair(ov_adaptive *f, ov_trial *best, uint32_t rounds) {
    ovoid_status status = OVOID_OK;
    ov_trial other = {0};
    double share = ov_tuned.count_repair_share;
    size_t skip = 0;
    OV_TRY(ov_trial_create(f, &other));
    for (uint32_t n = 0; n < rounds && best->count > 1 && skip < best->count; ++n) {
        const size_t most = f->capacity - best->count;
        size_t more = (size_t)(share * (double)best->count);
        more = more < 1 ? 1 : more;
        OV_TRY(repair_once(f, best, skip, more < most ? more : most, &other));
        if (other.count == best->count && other.judgement.score < best->judgement.score) {
            ov_trial_swap(&other, best);
            skip = 0;
        } else if (more > 1) {
            share *= 0.5;
        } else {
            ++skip;
        }
    }
cleanup:
    ov_trial_destroy(&other);
    return status;
}

static bool sharpens(const ov_adaptive *f) {
    return f->options->adaptive.effort > 0 && f->options->adaptive.steps > 0;
}

/* From the starts to the last repair, under one window. */
static ovoid_status fit_window(ov_adaptive *f, size_t count, size_t window, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    const uint32_t effort = ov_adaptive_effort(f);
    const size_t kinds = 2 * (size_t)effort - 1 < OV_STARTS ? 2 * (size_t)effort - 1 : OV_STARTS;
    OV_TRY(ov_adaptive_begin(f, window, kinds, count, best));
    if (effort > 1) {
        OV_TRY(ov_adaptive_judge(f, best));
        OV_TRY(repair(f, best, ov_tuned.count_repairs * (effort - 1)));
    }
    if (sharpens(f))
        OV_TRY(ov_adaptive_sharpen(f, best));
cleanup:
    return status;
}

static bool is_near(const ov_adaptive *f, size_t count) {
    return f->start && f->start->count <= ov_tuned.warm_times * count &&
           count <= ov_tuned.warm_times * f->start->count;
}

/* From the model given: at its own count, never worse than that. */
static ovoid_status fit_start(ov_adaptive *f, size_t count, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial other = {0};
    OV_TRY(ov_adaptive_take_start(f, best));
    const bool keeps = best->count == count;
    if (!keeps)
        OV_TRY(ov_adaptive_recount(f, count, best));
    if (best->count != count)
        goto cleanup;
    f->held = best;
    OV_TRY(ov_adaptive_judge(f, best));
    OV_TRY(ov_trial_create(f, &other));
    ov_trial_copy(best, &other);
    OV_TRY(ov_adaptive_refine_fully(f, &other, "refine"));
    OV_TRY(ov_adaptive_judge(f, &other));
    if (!keeps || other.judgement.score < best->judgement.score)
        ov_trial_swap(&other, best);
    OV_TRY(repair(f, best, ov_tuned.count_repairs * (ov_adaptive_effort(f) - 1)));
    if (sharpens(f))
        OV_TRY(ov_adaptive_sharpen(f, best));
cleanup:
    ov_trial_destroy(&other);
    return status;
}

/* Takes note of what can be expected of so many ellipsoids, if that is little. */
static void expect(ov_adaptive *f, size_t count) {
    const double most = ov_tuned.start_ratio * (double)f->atoms *
                        pow(f->options->decay / 0.5, ov_tuned.start_decay_power);
    const double distance = pow((double)count / most, 1.0 / ov_tuned.start_tolerance_power) *
                            sqrt(2.0 * f->options->decay);
    const double width = ov_tuned.coarse_width * cbrt((double)f->atoms / (double)count) *
                         sqrt(0.5 / f->options->decay);
    if (distance <= ov_tuned.coarse_distance)
        return;
    f->expected = distance;
    f->width_max = fmin(f->width_max, width);
}

ovoid_status ov_adaptive_count(ov_adaptive *f, size_t count, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial other = {0};
    expect(f, count);
    if (is_near(f, count)) {
        OV_TRY(fit_start(f, count, best));
        if (best->count == count)
            goto cleanup;
    }
    OV_TRY(fit_window(f, count, 0, best));
    if (ov_adaptive_effort(f) == 1)
        goto cleanup;
    OV_TRY(ov_trial_create(f, &other));
    for (size_t window = 1; window < OV_WINDOWS; ++window) {
        OV_TRY(fit_window(f, count, window, &other));
        if (other.judgement.score < best->judgement.score)
            ov_trial_swap(&other, best);
    }
cleanup:
    ov_trial_destroy(&other);
    return status;
}
