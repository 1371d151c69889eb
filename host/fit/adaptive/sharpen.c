#include "fit/adaptive/sharpen.h"

#include "fit/adaptive/constants.h"
#include "fit/adaptive/tolerance.h"

#include <math.h>

static void multiply_amplitudes(ov_trial *t, double factor) {
    const double more = log(factor);
    for (size_t i = 0; i < t->count; ++i)
        t->x[i * OV_FACTOR_PARAMETERS + OV_FACTOR_AMPLITUDE] += more;
}

static ovoid_status judge_once(ov_adaptive *f, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_adaptive_judge(f, t));
    if (t->judgement.valid && ov_adaptive_is_part(f)) /* its surfaces are cut off */
        OV_TRY(ov_adaptive_volume(f, t->count, &t->judgement.volume_ratio));
cleanup:
    return status;
}

/* Judges a trial with the right volume, as the search will end with it: where the field is flat,
 * that moves the surface by more than what is gained here. */
static ovoid_status judge(ov_adaptive *f, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    OV_TRY(judge_once(f, t));
    for (uint32_t n = 0; n < ov_tuned.sharpen_volume_steps && t->judgement.valid &&
                         fabs(t->judgement.volume_ratio - 1.0) > ov_tuned.volume_error;
         ++n) {
        multiply_amplitudes(t, ov_judge_amplitude_factor(&f->judge, t->judgement.volume_ratio));
        OV_TRY(judge_once(f, t));
    }
cleanup:
    return status;
}

/* More ellipsoids where the trial is off by more than `tolerance`, and as many fewer where they
 * cost least. Whether it came to that, and to the number, is to be seen from the trial. */
static ovoid_status exchange(ov_adaptive *f, double tolerance, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const size_t count = t->count;
    const bool frame = f->start && f->start->moved; /* whose ellipsoids are those of the last one */
    const double more = fmax(ov_tuned.sharpen_more * (double)count, ov_tuned.sharpen_more_min);
    const ov_growing grow = {.stage = "sharpen",
                             .most = count + (size_t)more,
                             .rounds = ov_tuned.sharpen_rounds,
                             .patience =
                                 frame ? ov_tuned.sharpen_rounds : ov_tuned.sharpen_patience};
    const ov_shrinking shrink = {.stage = "sharpen",
                                 .least = count,
                                 .gain = ov_tuned.shrink_gain,
                                 .idle_rounds = ov_tuned.sharpen_idle_rounds,
                                 .idle_tries = ov_tuned.sharpen_idle_tries};
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    OV_TRY(ov_adaptive_grow(f, tolerance, &grow, t, &spots));
    if (ov_trial_holds(t, tolerance) && t->count > count)
        OV_TRY(ov_adaptive_shrink(f, tolerance, &shrink, t));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* A patch is to be as near as the rest, which the tolerance tells. */
static bool is_worth_it(const ov_adaptive *f, const ov_trial *t) {
    const double enough = ov_adaptive_is_patch(f)
                              ? f->options->adaptive.tolerance
                              : ov_tuned.sharpen_enough / sqrt(2.0 * f->options->decay);
    return t->judgement.valid && t->judgement.deviation >= enough;
}

/* One try, in t: brings what is furthest off, walls of cavities too where `whole`, to a share of
 * that. *better: the score is, and t is the best model now. */
static ovoid_status try_once(ov_adaptive *f, double share, bool whole, ov_trial *t, ov_trial *best,
                             bool *better) {
    ovoid_status status = OVOID_OK;
    const ov_judgement *const j = &best->judgement;
    const double tolerance = share * (whole ? j->hausdorff : j->deviation);
    ov_trial_copy(best, t);
    f->judge.whole = whole;
    OV_TRY(exchange(f, tolerance, t));
    f->judge.whole = false;
    *better = t->count == best->count && ov_trial_holds(t, tolerance);
    if (*better)
        OV_TRY(judge(f, t));
    *better = *better && t->judgement.score < j->score;
    if (*better)
        ov_trial_swap(t, best);
cleanup:
    f->judge.whole = false;
    return status;
}

/* Smaller and smaller distances, until so many were too small. */
static ovoid_status sharpen(ov_adaptive *f, bool whole, ov_trial *t, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    const uint32_t failures = ov_tuned.sharpen_failures + f->options->adaptive.effort;
    double share = ov_tuned.sharpen_share;
    for (uint32_t n = 0; n < failures && is_worth_it(f, best);) {
        bool better;
        OV_TRY(try_once(f, share, whole, t, best, &better));
        share = better ? share : sqrt(share);
        n += !better;
    }
cleanup:
    return status;
}

ovoid_status ov_adaptive_sharpen(ov_adaptive *f, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial t = {0};
    OV_TRY(ov_trial_create(f, &t));
    OV_TRY(judge(f, best));
    if (!ov_adaptive_is_patch(f))
        OV_TRY(sharpen(f, true, &t, best));
    if (ov_adaptive_is_patch(f) || best->judgement.hausdorff > best->judgement.deviation)
        OV_TRY(sharpen(f, false, &t, best));
cleanup:
    ov_trial_destroy(&t);
    return status;
}
