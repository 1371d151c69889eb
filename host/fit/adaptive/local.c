#include "fit/adaptive/local.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- who moves, and who does not ------------------------------------------------------------ */

/* Sets the terms of the ellipsoids with chosen[i] == which, and of their images. */
static ovoid_status set_terms(ov_local *l, const ov_target *target, const double *x, size_t count,
                              const bool *chosen, bool which, float skin, ov_terms *terms) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    const ov_followers *const followers = &l->refiner.followers;
    const size_t all = ov_followers_all(followers, count);
    size_t taken = 0;
    ov_quadric *const quadrics = ov_alloc(context, all, sizeof *quadrics, "ellipsoids");
    float *const skins = ov_alloc(context, all, sizeof *skins, "skins");
    if (!quadrics || !skins) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t i = 0; i < count; ++i)
        if (chosen[i] == which) {
            skins[taken] = skin;
            ov_factor_quadric(x + i * OV_FACTOR_PARAMETERS, &quadrics[taken++]);
        }
    ov_followers_place(followers, taken, quadrics, skins);
    OV_TRY(ov_terms_set_skins(context, terms, quadrics, skins, ov_followers_all(followers, taken),
                              target->points->origin, ov_tuned.refine_cutoff));
cleanup:
    free(quadrics);
    free(skins);
    return status;
}

/* ---- the points ------------------------------------------------------------------------------ */

/* Lists the packs that those who move may reach. */
static ovoid_status find_packs(ov_local *l, const ov_points *points) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    bool begun, whole = true;
    l->reached.packs_only = true;
    begun = ov_lists_built(&l->reached);
    status = begun ? ov_lists_begin(context, &l->reached, points, &l->moving, 0.0)
                   : ov_lists_build(context, &l->reached, points, &l->moving, 0.0);
    if (status == OVOID_OK)
        status = ov_packs_reached(context, &l->reached, &l->list, &l->packs);
    if (begun && status == OVOID_OK)
        status = ov_lists_end(context, &l->reached, &whole);
    else if (begun)
        ov_later_end(context, &l->reached.later);
    OV_TRY(status);
    if (!whole) { /* there were more pairs than ever before */
        OV_TRY(ov_lists_build(context, &l->reached, points, &l->moving, 0.0));
        OV_TRY(ov_packs_reached(context, &l->reached, &l->list, &l->packs));
    }
cleanup:
    return status;
}

/* ---- the target ------------------------------------------------------------------------------ */

/* Fixed ellipsoids leave that much less of the target to the others. */
static ovoid_status take_target_with(ov_local *l, const ov_target *target, bool begin,
                                     bool *whole) {
    ovoid_status status = OVOID_OK;
    const bool begun = begin && ov_lists_built(&l->lists);
    ovoid_context *const context = l->refiner.context;
    ov_kernel kernel = {0};
    ov_device *device;
    const cl_uint packs = (cl_uint)l->packs.count;
    ov_target *const own = &l->target;
    *whole = true;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "gather", "gather_target", &kernel));
    OV_TRY(begun ? ov_lists_begin(context, &l->lists, &l->points, &l->still, 0.0)
                 : ov_lists_build(context, &l->lists, &l->points, &l->still, 0.0));
    OV_TRY(ov_field(context, &l->refiner.operations, &l->points, &l->still, &l->lists, &l->value));
    OV_TRY(ov_target_reserve(context, own, l->packs.count));
    OV_TRY(OV_LAUNCH(context, &kernel, packs, ov_item_group(device), OV_ARG(packs),
                     OV_ARG(l->list.memory), OV_ARG(target->low.memory),
                     OV_ARG(target->high.memory), OV_ARG(target->weight.memory),
                     OV_ARG(l->value.memory), OV_ARG(own->low.memory), OV_ARG(own->high.memory),
                     OV_ARG(own->weight.memory)));
    own->points = &l->points;
cleanup:
    ov_kernel_destroy(&kernel);
    if (begun && status == OVOID_OK)
        status = ov_lists_end(context, &l->lists, whole);
    else if (begun)
        ov_later_end(context, &l->lists.later);
    return status;
}

static ovoid_status take_target(ov_local *l, const ov_target *target) {
    bool whole;
    l->lists.packs_only = true;
    const ovoid_status status = take_target_with(l, target, true, &whole);
    return status != OVOID_OK || whole ? status : take_target_with(l, target, false, &whole);
}

/* ---- the step -------------------------------------------------------------------------------- */

static void gather(const double *x, size_t count, const bool *chosen, double *some) {
    for (size_t i = 0; i < count; ++i)
        if (chosen[i]) {
            memcpy(some, x + i * OV_FACTOR_PARAMETERS, OV_FACTOR_PARAMETERS * sizeof *some);
            some += OV_FACTOR_PARAMETERS;
        }
}

static void scatter(const double *some, size_t count, const bool *chosen, double *x) {
    for (size_t i = 0; i < count; ++i)
        if (chosen[i]) {
            memcpy(x + i * OV_FACTOR_PARAMETERS, some, OV_FACTOR_PARAMETERS * sizeof *some);
            some += OV_FACTOR_PARAMETERS;
        }
}

/* Those that move, and where they were when their points were found. */
typedef struct movers {
    double *x, *found;
    size_t count;
    bool escaped; /* one of them to where points are missing */
} movers;

static bool escaped(const double *x, size_t count, void *where) {
    movers *const m = where;
    for (size_t i = 0; i < count && !m->escaped; ++i)
        m->escaped =
            ov_factor_motion(m->found + i * OV_FACTOR_PARAMETERS, x + i * OV_FACTOR_PARAMETERS,
                             ov_tuned.refine_cutoff) > ov_tuned.refine_local_skin;
    return m->escaped;
}

/* Finds the points of those chosen and the target there, what the others leave of it. */
static ovoid_status find_part(ov_local *l, const ov_target *target, const double *x, size_t count,
                              const bool *chosen) {
    ovoid_status status = OVOID_OK;
    OV_TRY(set_terms(l, target, x, count, chosen, true, (float)ov_tuned.refine_local_skin,
                     &l->moving));
    OV_TRY(find_packs(l, target->points));
    if (l->packs.count == 0)
        goto cleanup;
    OV_TRY(ov_points_gather(l->refiner.context, target->points, l->packs.pack, l->packs.count,
                            &l->list, &l->points));
    OV_TRY(set_terms(l, target, x, count, chosen, false, 0.0f, &l->still));
    OV_TRY(take_target(l, target));
    ov_refiner_forget(&l->refiner);
cleanup:
    return status;
}

/* Refines until somebody escapes, then finds the points anew. */
static ovoid_status refine_movers(ov_local *l, const ov_target *target,
                                  const ov_refine_options *options, double *x, size_t count,
                                  const bool *chosen, movers *m, double *misfit) {
    ovoid_status status = OVOID_OK;
    ov_refine_options now = *options;
    const uint64_t before = l->refiner.steps;
    now.enough = escaped;
    now.where = m;
    do {
        m->escaped = false;
        OV_TRY(find_part(l, target, x, count, chosen));
        if (l->packs.count == 0)
            break;
        gather(x, count, chosen, m->x);
        gather(x, count, chosen, m->found);
        OV_TRY(ov_refine(&l->refiner, &l->target, &now, m->x, m->count, misfit));
        scatter(m->x, count, chosen, x);
        now.steps = options->steps - (uint32_t)(l->refiner.steps - before);
    } while (m->escaped && now.steps > 0);
cleanup:
    return status;
}

ovoid_status ov_refine_some(ov_local *l, const ov_target *target, const ov_refine_options *options,
                            double *x, size_t count, const bool *chosen, double *misfit) {
    ovoid_status status = OVOID_OK;
    movers m = {0};
    *misfit = 0.0;
    for (size_t i = 0; i < count; ++i)
        m.count += chosen[i];
    if (m.count == 0)
        return OVOID_OK;
    double *const all = ov_alloc(l->refiner.context, count * OV_FACTOR_PARAMETERS, sizeof *all,
                                 "parameters"); /* x stays as it is on errors */
    m.x =
        ov_alloc(l->refiner.context, 2 * m.count * OV_FACTOR_PARAMETERS, sizeof *m.x, "parameters");
    if (!all || !m.x) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    m.found = m.x + m.count * OV_FACTOR_PARAMETERS;
    memcpy(all, x, count * OV_FACTOR_PARAMETERS * sizeof *all);
    OV_TRY(refine_movers(l, target, options, all, count, chosen, &m, misfit));
    memcpy(x, all, count * OV_FACTOR_PARAMETERS * sizeof *all);
cleanup:
    free(all);
    free(m.x);
    return status;
}

void ov_local_begin(ov_local *l) {
    ov_refiner_begin(&l->refiner);
    ov_lists_forget(&l->reached);
    ov_lists_forget(&l->lists);
}

void ov_local_destroy(ov_local *l) {
    ov_refiner_destroy(&l->refiner);
    ov_terms_destroy(&l->moving);
    ov_terms_destroy(&l->still);
    ov_lists_destroy(&l->reached);
    ov_lists_destroy(&l->lists);
    ov_points_destroy(&l->points);
    ov_target_destroy(&l->target);
    ov_buffer_destroy(&l->value);
    ov_buffer_destroy(&l->list);
    ov_packs_destroy(&l->packs);
    memset(l, 0, sizeof *l);
}
