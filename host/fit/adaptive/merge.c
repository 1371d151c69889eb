#include "fit/adaptive/merge.h"
#include "fit/adaptive/constants.h"
#include "mixture/component.h"
#include "model/ellipsoid.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct candidate {
    uint32_t i, j;
    float loss;
} candidate;

static int by_pair(const void *a, const void *b) {
    const candidate *const p = a, *const q = b;
    if (p->i != q->i)
        return p->i < q->i ? -1 : 1;
    return (p->j > q->j) - (p->j < q->j);
}

static int by_loss(const void *a, const void *b) {
    const candidate *const p = a, *const q = b;
    if (p->loss != q->loss)
        return p->loss < q->loss ? -1 : 1;
    return by_pair(a, b);
}

/* The partners of ellipsoid i, cheapest first; cost has room for theirs. Returns how many. */
static size_t partners_of(const ov_component *components, size_t i, const uint32_t *near,
                          size_t near_count, double *cost, candidate *best) {
    const size_t most = ov_tuned.merge_partners;
    size_t found = 0;
    for (size_t n = 0; n < near_count; ++n) {
        const size_t j = near[n];
        if (j == i)
            continue;
        const double own = ov_component_cost(OV_MERGE_L2, &components[i], &components[j]);
        size_t at = found < most ? found++ : most;
        while (at > 0 && cost[at - 1] > own) {
            if (at < most) {
                cost[at] = cost[at - 1];
                best[at] = best[at - 1];
            }
            --at;
        }
        if (at < most) {
            cost[at] = own;
            best[at] = i < j ? (candidate){(uint32_t)i, (uint32_t)j, 0.0f}
                             : (candidate){(uint32_t)j, (uint32_t)i, 0.0f};
        }
    }
    return found;
}

/* Pairs worth trying, each once. */
static ovoid_status list_candidates(ovoid_context *context, const ov_component *components,
                                    size_t count, candidate **list, size_t *listed) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    uint32_t near[2 * OV_NEAR_MAX];
    size_t found = 0, kept = 0;
    candidate *const made =
        ov_alloc(context, count * ov_tuned.merge_partners, sizeof *made, "pairs");
    double *const cost = ov_alloc(context, ov_tuned.merge_partners, sizeof *cost, "costs");
    if (!made || !cost) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_grid_of(context, components->mean, sizeof *components, count, ov_tuned.merge_reach,
                      &grid));
    for (size_t i = 0; i < count; ++i) {
        const size_t near_count = ov_grid_near(&grid, components[i].mean, UINT32_MAX, near);
        found += partners_of(components, i, near, near_count, cost, made + found);
    }
    qsort(made, found, sizeof *made, by_pair);
    for (size_t n = 0; n < found; ++n)
        if (n == 0 || by_pair(&made[n], &made[n - 1]) != 0)
            made[kept++] = made[n];
cleanup:
    ov_grid_destroy(&grid);
    free(cost);
    if (status != OVOID_OK)
        free(made);
    else {
        *list = made;
        *listed = kept;
    }
    return status;
}

/* The list's pairs and what each becomes, to the device. */
static ovoid_status upload_pairs(ov_refiner *r, ov_merger *m, const ov_target *target,
                                 const ov_component *components, const candidate *list,
                                 size_t listed) {
    ovoid_status status = OVOID_OK;
    uint32_t *const pairs = ov_alloc(r->context, 2 * listed, sizeof *pairs, "pairs");
    ov_quadric *const merged = ov_alloc(r->context, listed, sizeof *merged, "merged pairs");
    if (!pairs || !merged) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t n = 0; n < listed; ++n) {
        ov_component both;
        pairs[2 * n] = list[n].i;
        pairs[2 * n + 1] = list[n].j;
        ov_component_merge(&components[list[n].i], &components[list[n].j], &both);
        ov_quadric_of_component(&both, &merged[n]);
    }
    OV_TRY(ov_terms_set(r->context, &m->merged, merged, listed, target->points->origin,
                        ov_tuned.refine_cutoff));
    OV_TRY(ov_buffer_put(r->context, &m->pairs, pairs, 2 * listed * sizeof *pairs, "pairs"));
cleanup:
    free(pairs);
    free(merged);
    return status;
}

static ovoid_status launch_losses(ov_refiner *r, ov_merger *m, const ov_target *target,
                                  size_t listed) {
    ovoid_status status = OVOID_OK;
    const cl_uint pairs = (cl_uint)listed;
    ov_device *device;
    OV_TRY(ov_device_get(r->context, &device));
    if (!m->kernel.handle)
        OV_TRY(ov_kernel_create(r->context, "merge", "merge_loss", &m->kernel));
    OV_TRY(ov_buffer_reserve(r->context, &m->loss, listed * sizeof(cl_float), "losses"));
    const size_t lanes = device->shape.lanes;
    OV_TRY(OV_LAUNCH(r->context, &m->kernel, listed * lanes, device->team, OV_ARG(pairs),
                     OV_ARG(m->pairs.memory), OV_ARG(m->merged.device.memory),
                     OV_ARG(target->points->xyz.memory),
                     OV_ARG(target->points->pack_origins.memory), OV_ARG(r->now.value.memory),
                     OV_ARG(target->low.memory), OV_ARG(target->high.memory),
                     OV_ARG(target->weight.memory), OV_ARG(ov_refiner_lists(r)->term_start.memory),
                     OV_ARG(ov_refiner_lists(r)->term_item.memory),
                     OV_ARG(r->now.terms.device.memory), OV_ARG(m->loss.memory)));
cleanup:
    return status;
}

/* What each merge costs at the surface. */
static ovoid_status find_losses(ov_refiner *r, ov_merger *m, const ov_target *target,
                                const ov_component *components, candidate *list, size_t listed) {
    ovoid_status status = OVOID_OK;
    float *const loss = ov_alloc(r->context, listed, sizeof *loss, "losses");
    if (!loss)
        return OVOID_ERROR_MEMORY;
    OV_TRY(upload_pairs(r, m, target, components, list, listed));
    OV_TRY(launch_losses(r, m, target, listed));
    OV_TRY(ov_buffer_read(r->context, &m->loss, 0, loss, listed * sizeof *loss));
    for (size_t n = 0; n < listed; ++n)
        list[n].loss = isnan(loss[n]) ? INFINITY : loss[n]; /* so that they can be sorted */
cleanup:
    free(loss);
    return status;
}

/* Moves those that are left together. partner[i]: whom i took in or was taken in by, UINT32_MAX:
 * nobody; the one with the larger index is gone. */
static size_t close_gaps(const uint32_t *partner, size_t count, double *x, uint32_t *parents) {
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
        if (partner[i] < i)
            continue;
        memmove(x + OV_FACTOR_PARAMETERS * kept, x + OV_FACTOR_PARAMETERS * i,
                OV_FACTOR_PARAMETERS * sizeof *x);
        if (parents) {
            parents[2 * kept] = (uint32_t)i;
            parents[2 * kept + 1] = partner[i];
        }
        ++kept;
    }
    return kept;
}

/* The merges of one call: what became of whom, and where they lie. */
typedef struct merges {
    uint32_t *partner; /* as close_gaps() wants it */
    ov_grid grid;      /* of their centres, where they must lie apart */
    uint32_t count;
} merges;

static ovoid_status merges_create(ovoid_context *context, const ov_component *components,
                                  size_t count, double apart, merges *m) {
    ovoid_status status = OVOID_OK;
    *m = (merges){.partner = ov_alloc(context, count, sizeof *m->partner, "merges")};
    if (!m->partner)
        return OVOID_ERROR_MEMORY;
    memset(m->partner, 0xff, count * sizeof *m->partner);
    if (apart > 0.0)
        OV_TRY(
            ov_grid_about(context, components->mean, sizeof *components, count, apart, &m->grid));
cleanup:
    return status;
}

static void merges_destroy(merges *m) {
    ov_grid_destroy(&m->grid);
    free(m->partner);
}

/* Whether two of the ellipsoids may merge and their merge may lie at the centre. */
static bool may_merge(const merges *m, const ov_merging *how, uint32_t i, uint32_t j,
                      const double centre[3]) {
    uint32_t near[2 * OV_NEAR_MAX];
    return m->partner[i] == UINT32_MAX && m->partner[j] == UINT32_MAX &&
           !(how->twin && how->twin[i] == j) &&
           !(how->apart > 0.0 && ov_grid_near(&m->grid, centre, UINT32_MAX, near) > 0) &&
           !(how->allowed && !how->allowed(centre, how->user));
}

/* Merges the first pairs of the list, no ellipsoid twice, and closes the gaps. */
static ovoid_status apply_merges(ovoid_context *context, const ov_component *components,
                                 const candidate *list, size_t listed, const ov_merging *how,
                                 double *x, size_t *count, size_t fewer) {
    ovoid_status status = OVOID_OK;
    merges m;
    if (how->share > 0.0 && how->share < 1.0)
        listed = (size_t)ceil(how->share * (double)listed);
    OV_TRY(merges_create(context, components, *count, how->apart, &m));
    for (size_t n = 0; n < listed && m.count < fewer; ++n) {
        const uint32_t i = list[n].i, j = list[n].j; /* i < j */
        ov_component both;
        ov_quadric quadric;
        ov_component_merge(&components[i], &components[j], &both);
        if (!may_merge(&m, how, i, j, both.mean))
            continue;
        ov_quadric_of_component(&both, &quadric);
        ov_factor_of_quadric(&quadric, x + i * OV_FACTOR_PARAMETERS);
        m.partner[i] = j;
        m.partner[j] = i;
        if (how->apart > 0.0)
            OV_TRY(ov_grid_add(context, &m.grid, both.mean, m.count));
        ++m.count;
    }
    *count = close_gaps(m.partner, *count, x, how->parents);
cleanup:
    merges_destroy(&m);
    return status;
}

static ovoid_status components_of(ovoid_context *context, const double *x, size_t count,
                                  ov_component **components) {
    *components = ov_alloc(context, count, sizeof **components, "ellipsoids");
    if (!*components)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; ++i) {
        ov_quadric quadric;
        ov_factor_quadric(x + i * OV_FACTOR_PARAMETERS, &quadric);
        if (!ov_component_of_quadric(&quadric, &(*components)[i]))
            return ov_fail(context, OVOID_ERROR_NUMERIC, "ellipsoid %zu is degenerate", i + 1);
    }
    return OVOID_OK;
}

ovoid_status ov_merge_cheapest(ov_refiner *r, ov_merger *m, const ov_target *target, double *x,
                               size_t *count, size_t fewer, const ov_merging *how) {
    static const ov_merging anyhow = {0};
    ovoid_status status = OVOID_OK;
    ov_component *components = NULL;
    candidate *list = NULL;
    size_t listed = 0;
    OV_TRY(components_of(r->context, x, *count, &components));
    OV_TRY(list_candidates(r->context, components, *count, &list, &listed));
    if (listed > 0)
        OV_TRY(find_losses(r, m, target, components, list, listed));
    qsort(list, listed, sizeof *list, by_loss);
    OV_TRY(
        apply_merges(r->context, components, list, listed, how ? how : &anyhow, x, count, fewer));
cleanup:
    free(components);
    free(list);
    return status;
}

/* weight r^2 / phi~ at each point, from u = weight r and the weights of the last evaluation. */
static ovoid_status upload_blame(ov_refiner *r, ov_merger *m, size_t points) {
    ovoid_status status = OVOID_OK;
    float *const u = ov_alloc(r->context, points, sizeof *u, "residuals");
    float *const weight = ov_alloc(r->context, points, sizeof *weight, "weights");
    float *const value = ov_alloc(r->context, points, sizeof *value, "values");
    if (!u || !weight || !value) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_buffer_read(r->context, &r->now.u, 0, u, points * sizeof *u));
    OV_TRY(ov_buffer_read(r->context, &r->now.active, 0, weight, points * sizeof *weight));
    OV_TRY(ov_buffer_read(r->context, &r->now.value, 0, value, points * sizeof *value));
    for (size_t k = 0; k < points; ++k)
        u[k] = weight[k] > 0.0f
                   ? u[k] * (u[k] / weight[k]) / fmaxf(value[k], (float)ov_tuned.merge_shared)
                   : 0.0f;
    OV_TRY(ov_buffer_put(r->context, &m->u, u, points * sizeof *u, "residuals"));
cleanup:
    free(u);
    free(weight);
    free(value);
    return status;
}

ovoid_status ov_misfit_shares(ov_refiner *r, ov_merger *m, const ov_target *target, size_t count,
                              double *share) {
    ovoid_status status = OVOID_OK;
    const size_t sums = 2 * OV_MONOMIALS; /* the first pair is that of the monomial 1 */
    float *const moments = ov_alloc(r->context, count * sums, sizeof *moments, "moments");
    if (!moments)
        return OVOID_ERROR_MEMORY;
    OV_TRY(upload_blame(r, m, target->points->packs * OV_PACK));
    OV_TRY(ov_moments(r->context, &r->operations, target->points, &r->now.terms,
                      ov_refiner_lists(r), &m->u, &m->moments));
    OV_TRY(ov_buffer_read(r->context, &m->moments, 0, moments, count * sums * sizeof *moments));
    for (size_t i = 0; i < count; ++i)
        share[i] = (double)moments[i * sums] + moments[i * sums + 1];
cleanup:
    free(moments);
    return status;
}

void ov_split(double whole[OV_FACTOR_PARAMETERS], double other[OV_FACTOR_PARAMETERS]) {
    ov_quadric quadric;
    ovoid_ellipsoid half;
    double r[3][3], centre[3];
    ov_factor_quadric(whole, &quadric);
    ov_ellipsoid_of_quadric(&quadric, &half);
    ov_rotation(half.angle, r);
    const double deviation = 1.0 / sqrt(2.0 * half.decay[2]); /* decay rates descend */
    const double shrink = 1.0 - ov_tuned.merge_split * ov_tuned.merge_split; /* of the variance */
    memcpy(centre, half.centre, sizeof centre);
    half.decay[2] /= shrink;
    half.amplitude *= 0.5 / sqrt(shrink);
    for (int side = -1; side <= 1; side += 2) {
        for (int k = 0; k < 3; ++k)
            half.centre[k] = centre[k] + side * ov_tuned.merge_split * deviation * r[2][k];
        ov_quadric_of_ellipsoid(&half, &quadric);
        ov_factor_of_quadric(&quadric, side < 0 ? whole : other);
    }
}

typedef struct ranked {
    double share;
    uint32_t index;
} ranked;

static int by_share(const void *a, const void *b) {
    const ranked *const p = a, *const q = b;
    if (p->share != q->share)
        return p->share > q->share ? -1 : 1;
    return (p->index > q->index) - (p->index < q->index);
}

/* Ellipsoids by their share of the misfit, the largest first; *ranking is to be freed. */
static ovoid_status rank(ov_refiner *r, ov_merger *m, const ov_target *target, size_t count,
                         ranked **ranking) {
    ovoid_status status = OVOID_OK;
    double *const share = ov_alloc(r->context, count, sizeof *share, "shares");
    *ranking = ov_alloc(r->context, count, sizeof **ranking, "shares");
    if (!share || !*ranking) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_misfit_shares(r, m, target, count, share));
    for (size_t i = 0; i < count; ++i)
        (*ranking)[i] = (ranked){isnan(share[i]) ? 0.0 : share[i], (uint32_t)i};
    qsort(*ranking, count, sizeof **ranking, by_share);
cleanup:
    free(share);
    return status;
}

ovoid_status ov_split_worst(ov_refiner *r, ov_merger *m, const ov_target *target, double *x,
                            size_t *count, size_t skip, size_t more, uint32_t *twin) {
    ovoid_status status = OVOID_OK;
    const size_t before = *count;
    ranked *ranking = NULL;
    for (size_t i = 0; twin && i < before + more; ++i)
        twin[i] = UINT32_MAX;
    OV_TRY(rank(r, m, target, before, &ranking));
    for (size_t n = skip; n < skip + more && n < before; ++n) {
        const size_t worst = ranking[n].index, other = *count;
        ov_split(x + worst * OV_FACTOR_PARAMETERS, x + other * OV_FACTOR_PARAMETERS);
        if (twin) {
            twin[worst] = (uint32_t)other;
            twin[other] = (uint32_t)worst;
        }
        ++*count;
    }
cleanup:
    free(ranking);
    return status;
}

void ov_merger_destroy(ov_merger *m) {
    ov_buffer *const buffers[] = {&m->pairs, &m->loss, &m->u, &m->moments};
    ov_kernel_destroy(&m->kernel);
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_terms_destroy(&m->merged);
    memset(m, 0, sizeof *m);
}
