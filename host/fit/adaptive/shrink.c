#include "fit/adaptive/constants.h"
#include "fit/adaptive/tolerance.h"
#include "mixture/component.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* What happens where merges are off. */
typedef struct settling {
    uint32_t chances, back_rounds, steps;
    double emphasis, reach;
} settling;

/* A model that shrinks. */
typedef struct shrinking {
    settling how;
    const char *stage;
    ov_trial next;      /* the best model merged */
    uint32_t *parents;  /* as of ov_merge_cheapest(): in the best model */
    ov_places failed;   /* where merging was too much */
    ov_grid same, done; /* of these */
    size_t limit, most; /* failures until a place is left alone, for now and for ever */
    bool *chosen;
    double *x; /* room for a model */
    uint32_t *more_parents;
    double share;                   /* of the ellipsoids that are merged at once */
    size_t milestone;               /* the last count that was a gain */
    size_t idle_rounds, idle_tries; /* since */
} shrinking;

/* Parts of a molecule have seams to keep, which chances make worse where images meet. */
static settling settling_of(const ov_adaptive *f) {
    if (ov_adaptive_is_part(f))
        return (settling){0, ov_tuned.shrink_part_back_rounds, ov_tuned.refine_local_steps,
                          ov_tuned.spots_emphasis, ov_tuned.spots_emphasis_reach};
    return (settling){ov_tuned.shrink_chances, ov_tuned.shrink_back_rounds, ov_tuned.shrink_steps,
                      ov_tuned.shrink_emphasis, ov_tuned.shrink_emphasis_reach};
}

static ovoid_status shrinking_create(ov_adaptive *f, const char *stage, shrinking *s) {
    ovoid_status status = OVOID_OK;
    *s = (shrinking){.how = settling_of(f),
                     .stage = stage,
                     .share = ov_tuned.shrink_share,
                     .limit = ov_tuned.shrink_done_first,
                     .most = ov_tuned.shrink_done * (size_t)ov_adaptive_effort(f)};
    OV_TRY(ov_trial_create(f, &s->next));
    s->parents = ov_alloc(f->context, 2 * f->capacity, sizeof *s->parents, "merges");
    s->more_parents = ov_alloc(f->context, 2 * f->capacity, sizeof *s->parents, "merges");
    s->chosen = ov_alloc(f->context, f->capacity, sizeof *s->chosen, "ellipsoids");
    s->x = ov_alloc(f->context, f->capacity * OV_FACTOR_PARAMETERS, sizeof *s->x, "parameters");
    if (!s->parents || !s->more_parents || !s->chosen || !s->x)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

static void forget_grids(shrinking *s) {
    ov_grid_destroy(&s->same);
    ov_grid_destroy(&s->done);
}

static void shrinking_destroy(shrinking *s) {
    ov_trial_destroy(&s->next);
    ov_places_destroy(&s->failed);
    forget_grids(s);
    free(s->parents);
    free(s->more_parents);
    free(s->chosen);
    free(s->x);
}

/* ---- merging -------------------------------------------------------------------------------- */

/* Whether a merge may lie there, after those that were too much. */
static bool allowed(const double centre[3], void *user) {
    const shrinking *const s = user;
    uint32_t near[2 * OV_NEAR_MAX];
    return s->failed.count == 0 || (ov_grid_near(&s->same, centre, UINT32_MAX, near) == 0 &&
                                    ov_grid_near(&s->done, centre, UINT32_MAX, near) < s->limit);
}

static ovoid_status index_failures(ov_adaptive *f, shrinking *s) {
    ovoid_status status = OVOID_OK;
    const ov_places *const failed = &s->failed;
    forget_grids(s);
    if (failed->count == 0)
        return OVOID_OK;
    OV_TRY(ov_grid_of(f->context, failed->place->at, sizeof *failed->place, failed->count,
                      ov_tuned.shrink_same, &s->same));
    OV_TRY(ov_grid_of(f->context, failed->place->at, sizeof *failed->place, failed->count,
                      ov_tuned.shrink_done_reach, &s->done));
cleanup:
    return status;
}

/* Merges what costs least of the best model, in many places at once. */
static ovoid_status merge(ov_adaptive *f, const ov_trial *best, size_t least, shrinking *s) {
    ovoid_status status = OVOID_OK;
    const size_t share = (size_t)fmax(s->share * (double)best->count, ov_tuned.shrink_tries_min);
    const size_t most = best->count - least, fewer = share < most ? share : most;
    const ov_merging merging = {.share = ov_tuned.shrink_pairs * ov_adaptive_effort(f),
                                .allowed = allowed,
                                .user = s,
                                .apart = ov_tuned.shrink_apart,
                                .parents = s->parents};
    double misfit;
    OV_TRY(index_failures(f, s));
    ov_trial_copy(best, &s->next);
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, s->next.x, s->next.count, &misfit));
    OV_TRY(ov_merge_cheapest(&f->refiner, &f->merger, &f->target, s->next.x, &s->next.count, fewer,
                             &merging));
cleanup:
    return status;
}

static bool is_merged(const shrinking *s, size_t i) {
    return s->parents[2 * i + 1] != UINT32_MAX;
}

static const double *centre_of(const double *x, size_t i) {
    return x + i * OV_FACTOR_PARAMETERS + OV_FACTOR_CENTRE;
}

static ovoid_status choose_near(ov_adaptive *f, const ov_spots *spots, double reach, shrinking *s) {
    return ov_near_spots(f->context, spots, centre_of(s->next.x, 0),
                         OV_FACTOR_PARAMETERS * sizeof(double), s->next.count, reach, s->chosen);
}

/* Lets what is near the merges make up for them. */
static ovoid_status adapt(ov_adaptive *f, shrinking *s) {
    ovoid_status status = OVOID_OK;
    ov_spots merged = {.spot = ov_alloc(f->context, s->next.count, sizeof *merged.spot, "merges")};
    if (!merged.spot)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < s->next.count; ++i)
        if (is_merged(s, i))
            memcpy(merged.spot[merged.count++].at, centre_of(s->next.x, i), sizeof merged.spot->at);
    OV_TRY(choose_near(f, &merged, ov_tuned.shrink_adapt, s));
    OV_TRY(ov_adaptive_refine_some(f, &s->next, s->stage, s->how.steps, s->chosen));
cleanup:
    ov_spots_destroy(&merged);
    return status;
}

/* ---- taking back ---------------------------------------------------------------------------- */

/* Of some spots whose `found` is OV_NOBODY, the merged ellipsoids nearest to them, where these are
 * within reach. Returns in *left for how many there is none. */
static ovoid_status find_nearest(ov_adaptive *f, const shrinking *s, const ov_spots *spots,
                                 double reach, uint32_t *found, size_t *left) {
    ovoid_status status = OVOID_OK;
    const double *const centres = centre_of(s->next.x, 0);
    const size_t stride = OV_FACTOR_PARAMETERS * sizeof *centres;
    ov_grid grid = {0};
    OV_TRY(ov_grid_about(f->context, centres, stride, s->next.count, reach, &grid));
    for (size_t i = 0; i < s->next.count; ++i)
        if (is_merged(s, i))
            OV_TRY(ov_grid_add(f->context, &grid, centre_of(s->next.x, i), (uint32_t)i));
    *left = 0;
    for (size_t n = 0; n < spots->count; ++n) {
        if (found[n] == OV_NOBODY)
            found[n] = ov_grid_nearest(&grid, centres, stride, spots->spot[n].at);
        *left += found[n] == OV_NOBODY;
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

/* Chooses the merged ellipsoid that is nearest to each spot, wherever that is. */
static ovoid_status choose_nearest(ov_adaptive *f, shrinking *s, const ov_spots *spots) {
    ovoid_status status = OVOID_OK;
    size_t left = 0;
    uint32_t *const found = ov_alloc(f->context, spots->count, sizeof *found, "merges");
    if (!found)
        return OVOID_ERROR_MEMORY;
    memset(found, 0xff, spots->count * sizeof *found);
    for (size_t i = 0; i < s->next.count; ++i)
        left = is_merged(s, i) ? spots->count : left; /* else there is none for any */
    for (double reach = ov_tuned.shrink_adapt; left > 0 && isfinite(reach); reach *= 4.0)
        OV_TRY(find_nearest(f, s, spots, reach, found, &left));
    for (size_t n = 0; n < spots->count; ++n)
        if (found[n] != OV_NOBODY)
            s->chosen[found[n]] = true;
cleanup:
    free(found);
    return status;
}

/* Where two ellipsoids of the best model were merged. */
static void merged_at(const ov_trial *best, const uint32_t from[2], double centre[3]) {
    ov_component part[2];
    for (size_t k = 0; k < 2; ++k) {
        ov_quadric quadric;
        ov_factor_quadric(best->x + from[k] * (size_t)OV_FACTOR_PARAMETERS, &quadric);
        ov_component_of_quadric(&quadric, &part[k]); /* it was one when it was merged */
    }
    ov_component_mean(&part[0], &part[1], centre);
}

/* Takes note of where the merges chosen lay when they were made. */
static ovoid_status remember(ov_adaptive *f, const ov_trial *best, shrinking *s) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < s->next.count; ++i) {
        double centre[3];
        if (!s->chosen[i])
            continue;
        merged_at(best, s->parents + 2 * i, centre);
        OV_TRY(ov_places_add(f->context, &s->failed, centre));
    }
cleanup:
    return status;
}

static void append(const double *x, uint32_t parent, uint32_t other, size_t *count, shrinking *s) {
    memcpy(s->x + *count * OV_FACTOR_PARAMETERS, x, OV_FACTOR_PARAMETERS * sizeof *x);
    s->more_parents[2 * *count] = parent;
    s->more_parents[2 * *count + 1] = other;
    ++*count;
}

/* Puts back what the chosen ellipsoids, merges all, were in the best model. */
static void take_back(const ov_trial *best, shrinking *s) {
    size_t count = 0;
    for (size_t i = 0; i < s->next.count; ++i) {
        const uint32_t *const from = s->parents + 2 * i;
        if (!s->chosen[i])
            append(s->next.x + i * OV_FACTOR_PARAMETERS, from[0], from[1], &count, s);
        for (size_t k = 0; s->chosen[i] && k < 2; ++k)
            append(best->x + from[k] * (size_t)OV_FACTOR_PARAMETERS, from[k], UINT32_MAX, &count,
                   s);
    }
    memcpy(s->next.x, s->x, count * OV_FACTOR_PARAMETERS * sizeof *s->x);
    memcpy(s->parents, s->more_parents, 2 * count * sizeof *s->parents);
    s->next.count = count;
}

/* Asks for more at the spots, takes back the merges nearest to those that are further off than
 * `limit` (angstrom), and lets what is near all spots adapt. */
static ovoid_status back_off(ov_adaptive *f, const ov_trial *best, const ov_spots *spots,
                             double limit, shrinking *s) {
    ovoid_status status = OVOID_OK;
    ov_spots far = {.spot = spots->spot}; /* the worst come first */
    while (far.count < spots->count && far.spot[far.count].distance > limit)
        ++far.count;
    OV_TRY(ov_adaptive_emphasise(f, spots, s->how.reach, s->how.emphasis));
    memset(s->chosen, 0, s->next.count * sizeof *s->chosen);
    if (far.count > 0)
        OV_TRY(choose_nearest(f, s, &far));
    OV_TRY(remember(f, best, s));
    take_back(best, s);
    OV_TRY(choose_near(f, spots, ov_tuned.shrink_back, s));
    OV_TRY(ov_adaptive_refine_some(f, &s->next, s->stage, s->how.steps, s->chosen));
cleanup:
    return status;
}

/* How far off a spot may be in round n of settling before the merge there is taken back: less in
 * each round, and nothing once merges have had all their chances. */
static double patience(double tolerance, uint32_t n, uint32_t chances) {
    const double left = 1.0 - (double)n / fmax((double)chances, 1.0);
    return n < chances ? tolerance * (1.0 + (ov_tuned.shrink_chance - 1.0) * left) : 0.0;
}

/* Where merging was too much: asks for more there, takes back the merges that this does not help,
 * and where that is not enough, grows. */
static ovoid_status settle(ov_adaptive *f, double tolerance, const ov_trial *best, shrinking *s) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {
        .stage = s->stage, .most = best->count - 1, .rounds = ov_tuned.shrink_grow_rounds};
    const uint32_t rounds = s->how.chances + s->how.back_rounds;
    OV_TRY(ov_adaptive_spots(f, &s->next, tolerance, f->capacity, &spots));
    for (uint32_t n = 0; n < rounds && spots.count > 0 && s->next.count < best->count; ++n) {
        OV_TRY(back_off(f, best, &spots, patience(tolerance, n, s->how.chances), s));
        OV_TRY(ov_adaptive_spots(f, &s->next, tolerance, f->capacity, &spots));
    }
    OV_TRY(ov_owner_merge(f->context, s->parents, s->next.count, best->count, best->owner, f->atoms,
                          s->next.owner));
    OV_TRY(ov_adaptive_grow(f, tolerance, &how, &s->next, &spots));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* Fewer at once where most were too much: each then has its neighbours to itself. */
static void choose_share(shrinking *s, size_t tries, size_t held) {
    if (4 * held < tries)
        s->share = fmax(0.5 * s->share, ov_tuned.shrink_share_min);
    else if (2 * held > tries)
        s->share = fmin(2.0 * s->share, ov_tuned.shrink_share);
}

/* Whether the last rounds were worth their while: too little was gained in a few of them and in
 * enough tries, which in a small molecule take more rounds. */
static bool is_idle(shrinking *s, const ov_shrinking *how, size_t tries, size_t count) {
    if (!how->thorough || s->share <= ov_tuned.shrink_share_min ||
        tries <= ov_tuned.shrink_tries_min) {
        ++s->idle_rounds;
        s->idle_tries += tries;
    }
    if ((double)count <= (1.0 - how->gain) * (double)s->milestone) {
        s->milestone = count;
        s->idle_rounds = 0;
        s->idle_tries = 0;
    }
    return s->idle_rounds >= how->idle_rounds && s->idle_tries >= how->idle_tries;
}

ovoid_status ov_adaptive_shrink(ov_adaptive *f, double tolerance, const ov_shrinking *how,
                                ov_trial *best) {
    ovoid_status status = OVOID_OK;
    shrinking s;
    bool idle = false;
    OV_TRY(shrinking_create(f, how->stage, &s));
    s.milestone = best->count;
    while (!idle && best->count > how->least) {
        const size_t before = best->count;
        OV_TRY(merge(f, best, how->least, &s));
        const size_t tries = before - s.next.count;
        if (tries == 0 && s.limit >= s.most)
            break;
        if (tries == 0) {
            s.limit *= 2; /* another turn for each place */
            continue;
        }
        OV_TRY(adapt(f, &s));
        OV_TRY(settle(f, tolerance, best, &s));
        if (s.next.count < before + (s.how.chances > 0) && ov_trial_holds(&s.next, tolerance))
            ov_trial_swap(&s.next, best);
        idle = is_idle(&s, how, tries, best->count);
        choose_share(&s, tries, before - best->count);
    }
cleanup:
    shrinking_destroy(&s);
    return status;
}
