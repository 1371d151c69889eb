#include "fit/adaptive/constants.h"
#include "fit/adaptive/reach.h"
#include "fit/adaptive/tolerance.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In this round, as a place's number of earlier meetings. */
#define DEALT_WITH UINT32_MAX

/* What growing works with. */
typedef struct growth {
    ov_places places;
    uint32_t *before; /* per spot: how often its place was met before, patience included */
    uint32_t patience;
    bool in_order;
    ov_spots own;   /* where to act, of each spot */
    bool *chosen;   /* ellipsoids */
    uint32_t *felt; /* those at a place */
} growth;

/* The ellipsoid with the largest value at a point of those that are not chosen yet: of those felt
 * there, and where there is none of them, of all. `whole` if all are chosen. */
static size_t ellipsoid_at(const ov_reach *reach, const bool *chosen, const double at[3],
                           uint32_t *found) {
    size_t best = reach->count, felt = ov_reach_at(reach, at, found);
    double largest = -INFINITY;
    for (int all = 0; all < 2 && best == reach->count; ++all) {
        const size_t asked = all ? reach->count : felt;
        for (size_t n = 0; n < asked; ++n) {
            const size_t i = all ? n : found[n];
            const double value =
                chosen[i] ? -INFINITY : ov_quadric_log_value(&reach->quadrics[i], at);
            if (value > largest || (value == largest && i < best && !chosen[i])) {
                largest = value;
                best = i;
            }
        }
    }
    return best;
}

static void split_one(ov_adaptive *f, ov_trial *t, size_t i) {
    f->twin[i] = (uint32_t)t->count;
    f->twin[t->count] = (uint32_t)i;
    ov_split(t->x + i * OV_FACTOR_PARAMETERS, t->x + t->count * OV_FACTOR_PARAMETERS);
    ++t->count;
}

/* The largest value at a place, as a logarithm, of those that are felt there. */
static double log_value_at(const ov_reach *reach, const double at[3], uint32_t *found) {
    double largest = -INFINITY;
    const size_t felt = ov_reach_at(reach, at, found);
    for (size_t k = 0; k < felt; ++k)
        largest = fmax(largest, ov_quadric_log_value(&reach->quadrics[found[k]], at));
    return largest;
}

/* A spot may be where an image of an ellipsoid is: what is to be done is done to the ellipsoid, in
 * the place that the image has carried there. Of places that come to the same, the one where most
 * is felt. */
static ovoid_status bring_home(ov_adaptive *f, const ov_trial *t, const ov_spots *spots,
                               growth *g) {
    ovoid_status status = OVOID_OK;
    ov_reach reach = {0};
    OV_TRY(ov_spots_copy(f->context, spots, &g->own));
    if (f->around.images == 0)
        goto cleanup;
    OV_TRY(ov_reach_create(f->context, t->x, t->count,
                           log(ov_tuned.refine_cutoff * f->options->isovalue), &reach));
    for (size_t n = 0; n < spots->count; ++n) {
        double *const own = g->own.spot[n].at;
        double largest = log_value_at(&reach, own, g->felt);
        for (size_t k = 0; k < f->around.images; ++k) {
            const ov_rigid back = ov_rigid_inverse(&f->around.image[k]);
            double at[3];
            ov_rigid_move(&back, spots->spot[n].at, at);
            const double value = log_value_at(&reach, at, g->felt);
            if (value > largest) {
                largest = value;
                memcpy(own, at, sizeof at);
            }
        }
    }
cleanup:
    ov_reach_destroy(&reach);
    return status;
}

/* How many ellipsoids are split at a spot. */
static int splits_of(const growth *g, size_t n) {
    if (g->before[n] < g->patience)
        return 0;
    const uint32_t met = g->before[n] - g->patience;
    return met < ov_tuned.grow_split_two ? 1 : met < ov_tuned.grow_rebuild ? 2 : 0;
}

/* Splits what is largest at the places that are not known for long. f->twin then leads from each
 * half to the other. */
static ovoid_status split(ov_adaptive *f, ov_trial *t, const ov_spots *spots, growth *g) {
    ovoid_status status = OVOID_OK;
    ov_reach reach = {0};
    const size_t whole = t->count;
    memset(f->twin, 0xff, f->capacity * sizeof *f->twin);
    memset(g->chosen, 0, f->capacity * sizeof *g->chosen);
    OV_TRY(ov_reach_create(f->context, t->x, whole,
                           log(ov_tuned.grow_matters * f->options->isovalue), &reach));
    for (size_t n = 0; n < spots->count; ++n) {
        const int each = splits_of(g, n);
        for (int k = 0; k < each && t->count < f->atoms; ++k) {
            const size_t i = ellipsoid_at(&reach, g->chosen, spots->spot[n].at, g->felt);
            if (i == whole)
                break;
            g->chosen[i] = true;
            split_one(f, t, i);
        }
    }
cleanup:
    ov_reach_destroy(&reach);
    return status;
}

/* Chooses the ellipsoids with at least `share` of the isovalue at a spot whose place was met from
 * `least` to `most` times before. */
static ovoid_status choose(ov_adaptive *f, const ov_trial *t, const ov_spots *spots, uint32_t least,
                           uint32_t most, double share, growth *g) {
    ov_reach reach;
    memset(g->chosen, 0, t->count * sizeof *g->chosen);
    const ovoid_status status =
        ov_reach_create(f->context, t->x, t->count, log(share * f->options->isovalue), &reach);
    for (size_t n = 0; status == OVOID_OK && n < spots->count; ++n) {
        if (g->before[n] < least || g->before[n] > most)
            continue;
        const size_t felt = ov_reach_at(&reach, spots->spot[n].at, g->felt);
        for (size_t k = 0; k < felt; ++k)
            g->chosen[g->felt[k]] = true;
    }
    ov_reach_destroy(&reach);
    return status;
}

/* Chooses in addition the ellipsoids that stand for the atoms that matter at a place, wherever
 * these ellipsoids are. */
static void choose_owners(const ov_adaptive *f, const ov_trial *t, const double at[3], growth *g) {
    const double log_least = log(ov_tuned.grow_matters * f->options->isovalue);
    for (size_t i = 0; i < f->atoms; ++i) {
        ov_quadric atom;
        ov_quadric_of_atom(f->xyzr + 4 * i, f->options->decay, &atom);
        if (ov_quadric_log_value(&atom, at) >= log_least)
            g->chosen[t->owner[i]] = true;
    }
}

/* Where no ellipsoid matters, those that stand for the atoms there have strayed, and nothing that
 * is done to what is felt there would help: they are split, by their atoms. */
static ovoid_status call_back(ov_adaptive *f, ov_trial *t, const ov_spots *spots, growth *g) {
    ovoid_status status = OVOID_OK;
    ov_reach reach = {0};
    memset(g->chosen, 0, t->count * sizeof *g->chosen);
    OV_TRY(ov_reach_create(f->context, t->x, t->count,
                           log(ov_tuned.grow_matters * f->options->isovalue), &reach));
    for (size_t n = 0; n < spots->count; ++n) {
        const double *const at = spots->spot[n].at;
        if (g->before[n] < g->patience || ov_reach_at(&reach, at, g->felt) > 0)
            continue;
        choose_owners(f, t, at, g);
        g->before[n] = DEALT_WITH;
    }
    OV_TRY(ov_adaptive_rebuild(f, t, 2.0, g->chosen));
cleanup:
    ov_reach_destroy(&reach);
    return status;
}

/* Goes back to the atoms at the places that do not give way. */
static ovoid_status rebuild(ov_adaptive *f, ov_trial *t, const ov_spots *spots, growth *g) {
    ovoid_status status = OVOID_OK;
    uint32_t longest = 0;
    for (size_t n = 0; n < spots->count; ++n)
        longest = g->before[n] > longest ? g->before[n] : longest;
    longest -= longest > g->patience ? g->patience : longest;
    for (uint32_t met = ov_tuned.grow_rebuild; met <= ov_tuned.grow_last && met <= longest; ++met) {
        const double share = met < ov_tuned.grow_atoms
                                 ? ov_tuned.grow_matters
                                 : ov_tuned.grow_matters * pow(0.25, met - ov_tuned.grow_atoms);
        OV_TRY(choose(f, t, spots, g->patience + met,
                      met == ov_tuned.grow_last ? UINT32_MAX : g->patience + met, share, g));
        OV_TRY(ov_adaptive_rebuild(
            f, t, met < ov_tuned.grow_atoms ? ov_tuned.grow_rebuild_times : (double)f->atoms,
            g->chosen));
    }
cleanup:
    return status;
}

/* One round: acts at each place as it deserves, and refines there. */
static ovoid_status act(ov_adaptive *f, const char *stage, ov_trial *t, const ov_spots *spots,
                        growth *g) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_adaptive_emphasise(f, spots, ov_tuned.spots_emphasis_reach, ov_tuned.spots_emphasis));
    OV_TRY(ov_places_meet(f->context, &g->places, spots, ov_tuned.spots_apart, g->before));
    OV_TRY(bring_home(f, t, spots, g));
    OV_TRY(rebuild(f, t, &g->own, g));
    OV_TRY(call_back(f, t, &g->own, g));
    OV_TRY(split(f, t, &g->own, g));
    OV_TRY(choose(f, t, &g->own, 0, UINT32_MAX, ov_tuned.grow_refined, g));
    OV_TRY(ov_adaptive_refine_some(f, t, stage, ov_tuned.refine_local_steps, g->chosen));
    OV_TRY(ov_adaptive_share_atoms(f, t));
    if (!g->in_order)
        OV_TRY(ov_adaptive_sort(f, t));
cleanup:
    return status;
}

ovoid_status ov_adaptive_grow(ov_adaptive *f, double tolerance, const ov_growing *how, ov_trial *t,
                              ov_spots *spots) {
    ovoid_status status = OVOID_OK;
    growth g = {.before = ov_alloc(f->context, f->capacity, sizeof *g.before, "places"),
                .chosen = ov_alloc(f->context, f->capacity, sizeof *g.chosen, "ellipsoids"),
                .felt = ov_alloc(f->context, f->capacity, sizeof *g.felt, "ellipsoids")};
    g.patience = how->patience;
    g.in_order = how->patience >= how->rounds; /* none is split */
    if (!g.before || !g.chosen || !g.felt) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (uint32_t n = 0; n < how->rounds && spots->count > 0 && t->count <= how->most; ++n) {
        const size_t share = (size_t)(ov_tuned.grow_share * (double)t->count) + 1;
        spots->count = spots->count < share ? spots->count : share;
        OV_TRY(act(f, how->stage, t, spots, &g));
        OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, spots));
    }
cleanup:
    free(g.before);
    free(g.chosen);
    free(g.felt);
    ov_places_destroy(&g.places);
    ov_spots_destroy(&g.own);
    return status;
}
