#include "fit/adaptive/tolerance.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

ovoid_status ov_adaptive_take_start(ov_adaptive *f, ov_trial *t) {
    const ov_found *const start = f->start;
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < start->count; ++i)
        ov_factor_of_quadric(&start->quadrics[i], t->x + i * OV_FACTOR_PARAMETERS);
    memcpy(t->owner, start->owner, f->atoms * sizeof *t->owner);
    t->count = start->count;
    f->stage = "refine";
    f->count = start->count;
    OV_TRY(ov_adaptive_aim(f, 0));
    OV_TRY(ov_adaptive_aim_at_volume(f, t));
cleanup:
    return status;
}

/* Merges what costs least, a share of it at once. */
static ovoid_status merge_some(ov_adaptive *f, size_t count, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    const size_t before = t->count;
    const size_t share = (size_t)fmax(ov_tuned.warm_merge_share * (double)before, 1.0);
    const size_t fewer = before - count < share ? before - count : share;
    ov_merging merging = {.apart = ov_tuned.warm_merge_apart, .parents = f->parents};
    double misfit;
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, t->x, t->count, &misfit));
    OV_TRY(
        ov_merge_cheapest(&f->refiner, &f->merger, &f->target, t->x, &t->count, fewer, &merging));
    OV_TRY(ov_owner_merge(f->context, f->parents, t->count, before, t->owner, f->atoms, t->owner));
    OV_TRY(ov_adaptive_refine_quickly(f, t, "merge"));
cleanup:
    return status;
}

/* Splits where the misfit is largest, a share of it at once. */
static ovoid_status split_some(ov_adaptive *f, size_t count, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    const size_t share = (size_t)fmax(ov_tuned.warm_split_share * (double)t->count, 1.0);
    const size_t more = count - t->count < share ? count - t->count : share;
    double misfit;
    OV_TRY(ov_refine_evaluate(&f->refiner, &f->target, t->x, t->count, &misfit));
    OV_TRY(ov_split_worst(&f->refiner, &f->merger, &f->target, t->x, &t->count, 0, more, f->twin));
    OV_TRY(ov_adaptive_refine_quickly(f, t, "grow"));
    OV_TRY(ov_adaptive_share_atoms(f, t));
cleanup:
    return status;
}

ovoid_status ov_adaptive_recount(ov_adaptive *f, size_t count, ov_trial *t) {
    ovoid_status status = OVOID_OK;
    size_t before = 0;
    while (t->count > count && t->count != before) { /* until no pair is left */
        before = t->count;
        OV_TRY(merge_some(f, count, t));
    }
    while (t->count < count)
        OV_TRY(split_some(f, count, t));
cleanup:
    return status;
}
