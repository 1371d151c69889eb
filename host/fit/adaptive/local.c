#include "fit/adaptive/local.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* How far (angstrom) ellipsoids may move before the points that matter to them are looked for
 * again.
 */
#define REACH_SKIN 1.0f

/* ---- who moves, and who does not ------------------------------------------------------------ */

/* Sets the terms of the ellipsoids with chosen[i] == which. */
static ovoid_status set_terms(ov_local *l, const ov_target *target, const double *x, size_t count,
                              const bool *chosen, bool which, float skin, ov_terms *terms) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    size_t taken = 0;
    ov_quadric *const quadrics = ov_alloc(context, count, sizeof *quadrics, "ellipsoids");
    float *const skins = ov_alloc(context, count, sizeof *skins, "skins");
    if (!quadrics || !skins) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t i = 0; i < count; ++i)
        if (chosen[i] == which) {
            skins[taken] = skin;
            ov_factor_quadric(x + i * OV_FACTOR_PARAMETERS, &quadrics[taken++]);
        }
    OV_TRY(ov_terms_set_skins(context, terms, quadrics, skins, taken, target->points->origin,
                              OV_REFINE_CUTOFF));
cleanup:
    free(quadrics);
    free(skins);
    return status;
}

/* ---- the points ------------------------------------------------------------------------------ */

/* Lists the packs that those who move may reach; *kept of them. */
static ovoid_status find_packs(ov_local *l, const ov_points *points, size_t *kept) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    OV_TRY(ov_grow(context, &l->packs, &l->packs_capacity, points->packs + 1, sizeof *l->packs,
                   "packs"));
    OV_TRY(ov_lists_build(context, &l->reached, points, &l->moving, 0.0));
    OV_TRY(ov_buffer_read(context, &l->reached.pack_start, 0, l->packs,
                          (points->packs + 1) * sizeof *l->packs));
    *kept = 0;
    for (uint32_t pack = 0; pack < points->packs; ++pack) /* in place: *kept <= pack */
        if (l->packs[pack + 1] > l->packs[pack])
            l->packs[(*kept)++] = pack;
cleanup:
    return status;
}

/* Copies the packs listed: they lie along the same curve. */
static ovoid_status keep_packs(ov_local *l, const ov_points *points, size_t kept) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    const size_t size = 3 * OV_PACK;
    float *const packed = ov_alloc(context, points->packs * size, sizeof *packed, "points");
    float *const origins = ov_alloc(context, kept * 4, sizeof *origins, "origins of packs");
    free(l->points.pack_origin);
    l->points.pack_origin = origins;
    if (!packed || !origins) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_buffer_read(context, &points->xyz, 0, packed, points->packs * size * sizeof *packed));
    for (size_t n = 0; n < kept; ++n) {
        memmove(packed + n * size, packed + l->packs[n] * size, size * sizeof *packed);
        memcpy(origins + 4 * n, points->pack_origin + 4 * (size_t)l->packs[n], 4 * sizeof *origins);
    }
    l->points.packs = kept;
    l->points.count = kept * OV_PACK;
    memcpy(l->points.origin, points->origin, sizeof points->origin);
    OV_TRY(ov_points_upload(context, packed, &l->points));
cleanup:
    free(packed);
    return status;
}

/* ---- the target ------------------------------------------------------------------------------ */

/* Whoever stays still leaves that much less of the target to the others. */
static ovoid_status take_target(ov_local *l, const ov_target *target, size_t kept) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = l->refiner.context;
    const size_t size = kept * OV_PACK;
    float *const still = ov_alloc(context, 4 * size, sizeof *still, "targets at points");
    if (!still)
        return OVOID_ERROR_MEMORY;
    float *const low = still + size, *const high = low + size, *const weight = high + size;
    OV_TRY(ov_lists_build(context, &l->lists, &l->points, &l->still, 0.0));
    OV_TRY(ov_field(context, &l->refiner.operations, &l->points, &l->still, &l->lists, &l->value));
    OV_TRY(ov_buffer_read(context, &l->value, 0, still, size * sizeof *still));
    for (size_t k = 0; k < size; ++k) {
        const size_t from = l->packs[k / OV_PACK] * (size_t)OV_PACK + k % OV_PACK;
        low[k] = target->host_low[from] - still[k]; /* FLT_MAX stays what it is */
        high[k] = target->host_high[from] - still[k];
        weight[k] = target->host_weight[from] * target->emphasis[from];
    }
    OV_TRY(ov_buffer_put(context, &l->target.low, low, size * sizeof(float), "targets at points"));
    OV_TRY(
        ov_buffer_put(context, &l->target.high, high, size * sizeof(float), "targets at points"));
    OV_TRY(ov_buffer_put(context, &l->target.weight, weight, size * sizeof(float),
                         "targets at points"));
    l->target.points = &l->points;
cleanup:
    free(still);
    return status;
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
                             OV_REFINE_CUTOFF) > (double)REACH_SKIN;
    return m->escaped;
}

/* Finds the points of those chosen and the target there, what the others leave of it; *kept: packs.
 */
static ovoid_status find_part(ov_local *l, const ov_target *target, const double *x, size_t count,
                              const bool *chosen, size_t *kept) {
    ovoid_status status = OVOID_OK;
    OV_TRY(set_terms(l, target, x, count, chosen, true, REACH_SKIN, &l->moving));
    OV_TRY(find_packs(l, target->points, kept));
    if (*kept == 0)
        goto cleanup;
    OV_TRY(keep_packs(l, target->points, *kept));
    OV_TRY(set_terms(l, target, x, count, chosen, false, 0.0f, &l->still));
    OV_TRY(take_target(l, target, *kept));
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
    size_t kept;
    now.enough = escaped;
    now.where = m;
    do {
        m->escaped = false;
        OV_TRY(find_part(l, target, x, count, chosen, &kept));
        if (kept == 0)
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

void ov_local_destroy(ov_local *l) {
    ov_refiner_destroy(&l->refiner);
    ov_terms_destroy(&l->moving);
    ov_terms_destroy(&l->still);
    ov_lists_destroy(&l->reached);
    ov_lists_destroy(&l->lists);
    ov_points_destroy(&l->points);
    ov_target_destroy(&l->target);
    ov_buffer_destroy(&l->value);
    free(l->packs);
    memset(l, 0, sizeof *l);
}
