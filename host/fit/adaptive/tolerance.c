#include "fit/adaptive/tolerance.h"

#include <math.h>
#include <stdlib.h>

/* Ellipsoids per atom that a tolerance of 1 angstrom asks for at d = 0.5, about, and how the number
 * goes with the tolerance and the decay rate. Only the start of the search: growing from too few
 * ends with fewer than shrinking from too many. */
#define RATIO_AT_ONE 0.04
#define RATIO_POWER -0.95
#define RATIO_DECAY 1.25
/* Where so many spots per ellipsoid are off, the surface is rougher than that, as without
 * hydrogens, and merging the atoms to so many times as many is better than splitting most
 * ellipsoids. */
#define TOO_MANY 0.3
#define AGAIN 1.35
/* How far spots are apart (angstrom). */
#define SPOTS_APART 3.0
/* The weight of points about a spot, each time it is met. */
#define EMPHASIS_REACH 2.0
#define EMPHASIS 2.0
/* Growing: rounds at most, more than any place needs to end with its atoms. */
#define GROW_ROUNDS 24
/* An atom stays with its ellipsoid as long as that has this share of the largest value at its
 * centre, of ellipsoids this near (angstrom). */
#define OWNER_SHARE 0.1
#define OWNER_REACH 15.0

bool ov_trial_holds(const ov_trial *t, double tolerance) {
    return t->judgement.valid && t->judgement.deviation <= tolerance;
}

ovoid_status ov_adaptive_spots(ov_adaptive *f, ov_trial *t, double tolerance, size_t most,
                               ov_spots *spots) {
    ov_spots_destroy(spots);
    ov_adaptive_quadrics(f, t);
    const ovoid_status status =
        ov_judge_spots(&f->judge, f->quadrics, t->count, tolerance, SPOTS_APART, most,
                       &t->judgement, &spots->spot, &spots->count);
    if (status == OVOID_OK && (!t->judgement.valid || t->judgement.deviation <= tolerance))
        spots->count = 0;
    return status;
}

ovoid_status ov_adaptive_emphasise(ov_adaptive *f, const ov_spots *spots) {
    return ov_target_emphasise(f->context, &f->target, spots->spot->at, sizeof *spots->spot,
                               spots->count, EMPHASIS_REACH, EMPHASIS);
}

/* From the count that molecules of this size need, about, to a model that holds. */
static ovoid_status start_and_grow(ov_adaptive *f, double tolerance, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {.stage = "grow", .most = f->atoms, .rounds = GROW_ROUNDS};
    const double guess = RATIO_AT_ONE * pow(tolerance, RATIO_POWER) *
                         pow(f->options->decay / 0.5, RATIO_DECAY) * (double)f->atoms;
    double count = fmin(fmax(round(guess), 1.0), (double)f->atoms);
    const size_t kinds = f->options->adaptive.effort > 1 ? 3 : 1;
    OV_TRY(ov_adaptive_begin(f, 0, kinds, (size_t)count, t));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    while (f->options->adaptive.steps > 0 && (double)spots.count > TOO_MANY * count &&
           count < (double)f->atoms) {
        count = fmin(ceil(AGAIN * count), (double)f->atoms);
        OV_TRY(ov_adaptive_begin(f, 0, kinds, (size_t)count, t));
        OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    }
    if (f->options->adaptive.steps > 0)
        OV_TRY(ov_adaptive_grow(f, tolerance, &how, t, &spots));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* From the model given, unless it is off in so many places that the atoms are the better start: t
 * does not hold then. One that holds stays as it is. */
static ovoid_status grow_start(ov_adaptive *f, double tolerance, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    ov_spots spots = {0};
    const ov_growing how = {.stage = "grow", .most = f->atoms, .rounds = GROW_ROUNDS};
    OV_TRY(ov_adaptive_take_start(f, t));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    if (f->options->adaptive.steps == 0 || ov_trial_holds(t, tolerance))
        goto cleanup;
    OV_TRY(ov_adaptive_refine_fully(f, t, "refine"));
    OV_TRY(ov_adaptive_spots(f, t, tolerance, f->capacity, &spots));
    if ((double)spots.count <= TOO_MANY * (double)t->count)
        OV_TRY(ov_adaptive_grow(f, tolerance, &how, t, &spots));
cleanup:
    ov_spots_destroy(&spots);
    return status;
}

/* The atoms themselves: the field and its surface, exactly. */
static ovoid_status take_atoms(ov_adaptive *f, ov_trial *t) {
    const ovoid_status status = ov_adaptive_cut(f, 0, f->atoms, t);
    return status != OVOID_OK ? status : ov_adaptive_judge(f, t);
}

ovoid_status ov_adaptive_tolerance(ov_adaptive *f, double tolerance, ov_trial *best) {
    ovoid_status status = OVOID_OK;
    if (f->start)
        OV_TRY(grow_start(f, tolerance, best));
    if (!f->start || !ov_trial_holds(best, tolerance))
        OV_TRY(start_and_grow(f, tolerance, best));
    if (ov_trial_holds(best, tolerance))
        f->held = best;
    if (f->options->adaptive.steps == 0 || !f->judge.mesh)
        goto cleanup;
    if (!ov_trial_holds(best, tolerance))
        OV_TRY(take_atoms(f, best));
    if (ov_trial_holds(best, tolerance)) {
        f->held = best;
        OV_TRY(ov_adaptive_shrink(f, tolerance, best));
    }
    ov_adaptive_quadrics(f, best);
    OV_TRY(ov_owner_tidy(f->context, f->xyzr, f->atoms, f->quadrics, best->count, OWNER_SHARE,
                         OWNER_REACH, best->owner));
cleanup:
    return status;
}
