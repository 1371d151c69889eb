#include "fit/adaptive_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Ellipsoids per atom that a tolerance of 1 angstrom asks for at d = 0.5, about, and how the number
 * goes with the tolerance and the decay rate. Only the start of the search: growing from too few
 * ends with fewer than shrinking from too many. */
#define RATIO_AT_ONE 0.04
#define RATIO_POWER -0.95
#define RATIO_DECAY 1.25
/* Growing: rounds at most, how far apart the spots are that are split (angstrom), and the largest
 * share of ellipsoids split at once. */
#define GROW_ROUNDS 10
#define GROW_APART 3.0
#define GROW_SHARE 0.25
#define GROW_PATIENCE 2 /* rounds until one more ellipsoid is split at each spot that remains */
/* Steps after a change here and there: counted, since the misfit of the whole says little of them.
 */
#define LOCAL_STEPS 12
/* Whoever has this much of the isovalue at a spot is refined with it. */
#define LOCAL_FROM 3e-3
/* The weight of points about a spot, each time it is met. */
#define EMPHASIS_REACH 2.0
#define EMPHASIS 1.6
/* Where growing gets stuck, a new start has so many times the ellipsoids. */
#define RESTART 1.3
/* Shrinking: the share that is merged at first, halved after a failure: a try that gains less than
 * half of that; and failures at most. */
#define SHRINK_SHARE 0.08
#define FAILURES_PER_EFFORT 2
/* Where merging was too much: what was merged this near to the spot (angstrom) is taken back, next
 * time further about, in so many rounds; who is within the margin adapts to it. */
#define BACK_REACH 5.0
#define BACK_GROWTH 1.5
#define BACK_MARGIN 3.0
#define BACK_ROUNDS 3
/* Nobody this near to where merging was too much (angstrom) is merged again. */
#define FIXED_REACH 4.0

typedef struct spot_list {
    ov_spot *spot;
    size_t count;
} spot_list;

/* Adds the spots to those that were met before. */
static ovoid_status remember(ov_adaptive *f, const spot_list *spots, spot_list *all) {
    ov_spot *const more = ov_alloc(f->context, all->count + spots->count, sizeof *more, "spots");
    if (!more)
        return OVOID_ERROR_MEMORY;
    if (all->count > 0)
        memcpy(more, all->spot, all->count * sizeof *more);
    memcpy(more + all->count, spots->spot, spots->count * sizeof *more);
    free(all->spot);
    *all = (spot_list){more, all->count + spots->count};
    return OVOID_OK;
}

static bool within(const ov_trial *t, double tolerance) {
    return t->judgement.valid && t->judgement.deviation <= tolerance;
}

/* ---- growing -------------------------------------------------------------------------------- */

/* The ellipsoid with the largest value at a point of those that are not chosen yet. */
static size_t ellipsoid_at(const ov_quadric *quadrics, size_t count, const bool *chosen,
                           const double at[3]) {
    size_t best = count;
    double largest = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
        const double value = chosen[i] ? -INFINITY : ov_quadric_log_value(&quadrics[i], at);
        if (value > largest) {
            largest = value;
            best = i;
        }
    }
    return best;
}

/* Splits the `each` ellipsoids that weigh most at each spot; returns how many that were. f->twin
 * then leads from each half to the other. */
static size_t split_at_spots(ov_adaptive *f, ov_trial *t, const spot_list *spots, size_t each,
                             bool *chosen) {
    const size_t before = t->count;
    memset(f->twin, 0xff, f->capacity * sizeof *f->twin);
    for (size_t n = 0; n < spots->count; ++n)
        for (size_t k = 0; k < each && t->count < f->atoms; ++k) {
            const size_t i = ellipsoid_at(f->quadrics, before, chosen, spots->spot[n].at);
            if (i == before)
                break;
            chosen[i] = true;
            f->twin[i] = (uint32_t)t->count;
            f->twin[t->count] = (uint32_t)i;
            ov_split(t->x + i * OV_FACTOR_PARAMETERS, t->x + t->count * OV_FACTOR_PARAMETERS);
            ++t->count;
        }
    return t->count - before;
}

/* Chooses the ellipsoids that matter at the spots. */
static void choose_at_spots(ov_adaptive *f, const ov_trial *t, const spot_list *spots,
                            bool *chosen) {
    const double least = log(LOCAL_FROM * f->options->isovalue);
    ov_adaptive_quadrics(f, t);
    for (size_t i = 0; i < t->count; ++i) {
        chosen[i] = false;
        for (size_t n = 0; n < spots->count && !chosen[i]; ++n)
            chosen[i] = ov_quadric_log_value(&f->quadrics[i], spots->spot[n].at) > least;
    }
}

static ovoid_status emphasise(ov_adaptive *f, const spot_list *spots) {
    return ov_target_emphasise(f->context, &f->target, spots->spot->at, sizeof *spots->spot,
                               spots->count, EMPHASIS_REACH, EMPHASIS);
}

/* Splits `each` ellipsoids at every spot, and refines there; *more of them. */
static ovoid_status grow_at(ov_adaptive *f, ov_trial *t, const spot_list *spots, size_t each,
                            size_t *more) {
    ovoid_status status = OVOID_OK;
    bool *const chosen = ov_alloc(f->context, f->capacity, sizeof *chosen, "splits");
    if (!chosen)
        return OVOID_ERROR_MEMORY;
    OV_TRY(emphasise(f, spots));
    ov_adaptive_quadrics(f, t);
    *more = split_at_spots(f, t, spots, each, chosen);
    if (*more == 0)
        goto cleanup;
    choose_at_spots(f, t, spots, chosen);
    OV_TRY(ov_adaptive_refine_some(f, t, "grow", LOCAL_STEPS, chosen));
    OV_TRY(ov_adaptive_share_atoms(f, t));
cleanup:
    free(chosen);
    return status;
}

/* Judges and finds the spots that are off, none where the tolerance holds. */
static ovoid_status find_spots(ov_adaptive *f, ov_trial *t, double tolerance, spot_list *spots) {
    const size_t most = (size_t)(GROW_SHARE * (double)t->count) + 1;
    free(spots->spot);
    *spots = (spot_list){0};
    ov_adaptive_quadrics(f, t);
    const ovoid_status status =
        ov_judge_spots(&f->judge, f->quadrics, t->count, tolerance, GROW_APART, most, &t->judgement,
                       &spots->spot, &spots->count);
    if (status == OVOID_OK && (!t->judgement.valid || t->judgement.deviation <= tolerance))
        spots->count = 0;
    return status;
}

/* Splits where the surface is off until the tolerance holds; the best on the way. */
static ovoid_status grow(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    ov_trial next = {0};
    spot_list spots = {0};
    size_t more = 1;
    OV_TRY(ov_trial_create(f, &next));
    ov_trial_copy(best, &next);
    for (int n = 0; n < GROW_ROUNDS && more > 0; ++n) {
        OV_TRY(find_spots(f, &next, tolerance, &spots));
        if (n == 0 || next.judgement.deviation < best->judgement.deviation)
            ov_trial_copy(&next, best);
        if (spots.count == 0 || n + 1 == GROW_ROUNDS)
            break;
        OV_TRY(grow_at(f, &next, &spots, 1 + (size_t)n / GROW_PATIENCE, &more));
    }
cleanup:
    free(spots.spot);
    ov_trial_destroy(&next);
    return status;
}

/* ---- shrinking ------------------------------------------------------------------------------ */

static double distance_to(const double *centre, const ov_spot *spot) {
    double square = 0.0;
    for (int k = 0; k < 3; ++k)
        square += (centre[k] - spot->at[k]) * (centre[k] - spot->at[k]);
    return sqrt(square);
}

/* Whether an ellipsoid's centre is that near to a spot. */
static bool near_spots(const double *x, const spot_list *spots, double reach) {
    for (size_t n = 0; n < spots->count; ++n)
        if (distance_to(x + OV_FACTOR_CENTRE, &spots->spot[n]) < reach)
            return true;
    return false;
}

/* A model that shrinks. */
typedef struct shrinking {
    ov_trial next;     /* the best model merged */
    uint32_t *parents; /* as of ov_merge_cheapest(): in the best model */
    ov_trial back;     /* next with some of the best put back, and its parents */
    uint32_t *back_parents;
    spot_list failed; /* where merging was too much */
    bool *chosen;
} shrinking;

static ovoid_status shrinking_create(ov_adaptive *f, shrinking *s) {
    ovoid_status status = OVOID_OK;
    *s = (shrinking){0};
    OV_TRY(ov_trial_create(f, &s->next));
    OV_TRY(ov_trial_create(f, &s->back));
    s->parents = ov_alloc(f->context, 2 * f->capacity, sizeof *s->parents, "merges");
    s->back_parents = ov_alloc(f->context, 2 * f->capacity, sizeof *s->parents, "merges");
    s->chosen = ov_alloc(f->context, f->capacity, sizeof *s->chosen, "ellipsoids");
    if (!s->parents || !s->back_parents || !s->chosen)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

static void shrinking_destroy(shrinking *s) {
    ov_trial_destroy(&s->next);
    ov_trial_destroy(&s->back);
    free(s->parents);
    free(s->back_parents);
    free(s->failed.spot);
    free(s->chosen);
}

static void choose_near(const ov_trial *t, const spot_list *spots, double reach, bool *chosen) {
    for (size_t i = 0; i < t->count; ++i)
        chosen[i] = near_spots(t->x + i * OV_FACTOR_PARAMETERS, spots, reach);
}

static void append_ellipsoid(const double *x, uint32_t parent, uint32_t other, ov_trial *t,
                             uint32_t *parents) {
    memcpy(t->x + t->count * OV_FACTOR_PARAMETERS, x, OV_FACTOR_PARAMETERS * sizeof *x);
    parents[2 * t->count] = parent;
    parents[2 * t->count + 1] = other;
    ++t->count;
}

/* Puts back what the ellipsoids near the spots were in the best model. */
static void take_back(shrinking *s, const ov_trial *best, const spot_list *spots, double reach) {
    choose_near(&s->next, spots, reach, s->chosen);
    s->back.count = 0;
    for (size_t i = 0; i < s->next.count; ++i) {
        const uint32_t *const from = s->parents + 2 * i;
        if (!s->chosen[i])
            append_ellipsoid(s->next.x + i * OV_FACTOR_PARAMETERS, from[0], from[1], &s->back,
                             s->back_parents);
        for (size_t k = 0; s->chosen[i] && k < 2 && from[k] != UINT32_MAX; ++k)
            append_ellipsoid(best->x + from[k] * (size_t)OV_FACTOR_PARAMETERS, from[k], UINT32_MAX,
                             &s->back, s->back_parents);
    }
    ov_trial_swap(&s->next, &s->back);
    uint32_t *const swap = s->parents;
    s->parents = s->back_parents;
    s->back_parents = swap;
}

/* Each atom's owner in the model merged, from that in the best one. */
static ovoid_status follow_parents(ov_adaptive *f, const ov_trial *best, shrinking *s) {
    return ov_owner_merge(f->context, s->parents, s->next.count, best->count, best->owner, f->atoms,
                          s->next.owner);
}

/* Where merging was too much, goes back to the best model, region by region. */
static ovoid_status settle(ov_adaptive *f, double tolerance, const ov_trial *best, shrinking *s) {
    ovoid_status status = OVOID_OK;
    spot_list spots = {0};
    double reach = BACK_REACH;
    OV_TRY(find_spots(f, &s->next, tolerance, &spots));
    for (int n = 0; n < BACK_ROUNDS && spots.count > 0; ++n) {
        OV_TRY(emphasise(f, &spots));
        OV_TRY(remember(f, &spots, &s->failed));
        take_back(s, best, &spots, reach);
        OV_TRY(follow_parents(f, best, s));
        if (s->next.count == best->count)
            break;
        choose_near(&s->next, &spots, reach + BACK_MARGIN, s->chosen);
        OV_TRY(ov_adaptive_refine_some(f, &s->next, "shrink", LOCAL_STEPS, s->chosen));
        OV_TRY(find_spots(f, &s->next, tolerance, &spots));
        reach *= BACK_GROWTH;
    }
cleanup:
    free(spots.spot);
    return status;
}

/* Merges `fewer` of the best model's ellipsoids, where that was not too much before. */
static ovoid_status merge(ov_adaptive *f, const ov_trial *best, size_t fewer, shrinking *s) {
    ovoid_status status = OVOID_OK;
    const ov_merging merging = {.fixed = s->chosen, .parents = s->parents};
    double misfit;
    choose_near(best, &s->failed, FIXED_REACH, s->chosen);
    ov_trial_copy(best, &s->next);
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, s->next.x, s->next.count, &misfit));
    OV_TRY(ov_merge_cheapest(&f->refiner, &f->merger, &f->target, s->next.x, &s->next.count, fewer,
                             &merging));
    OV_TRY(follow_parents(f, best, s));
cleanup:
    return status;
}

/* Merges what costs least, region by region, as long as the tolerance holds. */
static ovoid_status shrink(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    shrinking s;
    double share = SHRINK_SHARE;
    uint32_t failures = FAILURES_PER_EFFORT * f->options->adaptive.effort;
    OV_TRY(shrinking_create(f, &s));
    while (failures > 0 && best->count > 1) {
        const size_t before = best->count, fewer = (size_t)(share * (double)before) + 1;
        OV_TRY(merge(f, best, fewer, &s));
        if (s.next.count == before)
            break;
        OV_TRY(ov_adaptive_refine(f, &s.next, "shrink", LOCAL_STEPS, 1e-1, 1e-5));
        OV_TRY(settle(f, tolerance, best, &s));
        if (s.next.count < before && within(&s.next, tolerance))
            ov_trial_swap(&s.next, best);
        if (2 * (before - best->count) < fewer) {
            share *= 0.5;
            --failures;
        }
    }
cleanup:
    shrinking_destroy(&s);
    return status;
}

/* ---- the tolerance -------------------------------------------------------------------------- */

/* The atoms themselves: the field and its surface, exactly. */
static ovoid_status take_atoms(ov_adaptive *f, ov_trial *t) {
    const ovoid_status status = ov_adaptive_cut(f, 0, f->atoms, t);
    return status != OVOID_OK ? status : ov_adaptive_judge(f, t);
}

static ovoid_status start_and_grow(ov_adaptive *f, double tolerance, size_t count, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_adaptive_begin(f, 0, f->options->adaptive.effort > 1 ? 3 : 1, count, best));
    OV_TRY(grow(f, tolerance, best));
cleanup:
    return status;
}

/* Where growing gets stuck: another start with more ellipsoids; in the end the atoms. */
ovoid_status ov_adaptive_tolerance(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    const double guess = RATIO_AT_ONE * pow(tolerance, RATIO_POWER) *
                         pow(f->options->decay / 0.5, RATIO_DECAY) * (double)f->atoms;
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
        OV_TRY(shrink(f, tolerance, best));
cleanup:
    return status;
}
