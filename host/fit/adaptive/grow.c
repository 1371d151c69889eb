#include "fit/adaptive/reach.h"
#include "fit/adaptive/tolerance.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Spots that are acted on at once: this share of the ellipsoids, the worst ones. */
#define SHARE 0.3
/* A spot this near to a place that was met before (angstrom) is that place again. */
#define SAME_PLACE 3.0
/* What is done at a place by how often it was met before: at first its largest ellipsoid is split,
 * then its two largest; from REBUILT on the ellipsoids that matter there are made anew from their
 * atoms, REBUILD times as many; from ATOMS on they are their atoms, further about each time. */
#define SPLIT_TWO 2
#define REBUILT 3
#define ATOMS 6
#define LAST 12
#define REBUILD 1.5
/* An ellipsoid matters at a spot where its value is at least this share of the isovalue, when it is
 * rebuilt, and when it is refined. */
#define MATTERS 0.05
#define REFINED 3e-3

/* What growing works with. */
typedef struct growth {
    ov_places places;
    uint32_t *before; /* per spot: how often its place was met before */
    bool *chosen;     /* ellipsoids */
    uint32_t *felt;   /* those at a place */
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

/* Splits what is largest at the places that are not known for long. f->twin then leads from each
 * half to the other. */
static ovoid_status split(ov_adaptive *f, ov_trial *t, const ov_spots *spots, growth *g) {
    ovoid_status status = OVOID_OK;
    ov_reach reach = {0};
    const size_t whole = t->count;
    memset(f->twin, 0xff, f->capacity * sizeof *f->twin);
    memset(g->chosen, 0, f->capacity * sizeof *g->chosen);
    OV_TRY(ov_reach_create(f->context, t->x, whole, log(MATTERS * f->options->isovalue), &reach));
    for (size_t n = 0; n < spots->count; ++n) {
        const int each = g->before[n] < SPLIT_TWO ? 1 : g->before[n] < REBUILT ? 2 : 0;
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

/* Goes back to the atoms at the places that do not give way. */
static ovoid_status rebuild(ov_adaptive *f, ov_trial *t, const ov_spots *spots, growth *g) {
    ovoid_status status = OVOID_OK;
    uint32_t longest = 0;
    for (size_t n = 0; n < spots->count; ++n)
        longest = g->before[n] > longest ? g->before[n] : longest;
    for (uint32_t met = REBUILT; met <= LAST && met <= longest; ++met) {
        const double share = met < ATOMS ? MATTERS : MATTERS * pow(0.25, met - ATOMS);
        OV_TRY(choose(f, t, spots, met, met == LAST ? UINT32_MAX : met, share, g));
        OV_TRY(ov_adaptive_rebuild(f, t, met < ATOMS ? REBUILD : (double)f->atoms, g->chosen));
    }
cleanup:
    return status;
}

/* One round: acts at each place as it deserves, and refines there. */
static ovoid_status act(ov_adaptive *f, const char *stage, ov_trial *t, const ov_spots *spots,
                        growth *g) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_adaptive_emphasise(f, spots));
    OV_TRY(ov_places_meet(f->context, &g->places, spots, SAME_PLACE, g->before));
    OV_TRY(rebuild(f, t, spots, g));
    OV_TRY(split(f, t, spots, g));
    OV_TRY(choose(f, t, spots, 0, UINT32_MAX, REFINED, g));
    OV_TRY(ov_adaptive_refine_some(f, t, stage, OV_LOCAL_STEPS, g->chosen));
    OV_TRY(ov_adaptive_share_atoms(f, t));
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
    if (!g.before || !g.chosen || !g.felt) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (int n = 0; n < how->rounds && spots->count > 0 && t->count <= how->most; ++n) {
        const size_t share = (size_t)(SHARE * (double)t->count) + 1;
        spots->count = spots->count < share ? spots->count : share;
        OV_TRY(act(f, how->stage, t, spots, &g));
        OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, spots));
    }
cleanup:
    free(g.before);
    free(g.chosen);
    free(g.felt);
    ov_places_destroy(&g.places);
    return status;
}
