/* Kernels that take points one by one: residuals and misfits, copies of packs, and the way back to
 * the caller's order. */
#include "selftest/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- residual and misfit ------------------------------------------------------------------ */

/* Bounds and weights of points that are followed (low = high), held on one side, or free. */
typedef struct charges {
    float *value, *low, *high, *weight;
} charges;

static void destroy_charges(charges *a) {
    free(a->value);
    free(a->low);
    free(a->high);
    free(a->weight);
}

static ovoid_status make_charges(ovoid_context *context, const ov_setting *s, ov_random *random,
                                 charges *a) {
    a->value = ov_setting_floats(context, s, random, 0.0, 2.0);
    a->low = ov_setting_floats(context, s, random, 0.0, 2.0);
    a->weight = ov_setting_floats(context, s, random, 0.1, 3.0);
    a->high = ov_alloc(context, s->places, sizeof *a->high, "bounds of a check");
    if (!a->value || !a->low || !a->weight || !a->high)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < s->places; ++k) {
        const uint64_t kind = ov_random_bits(random) % 5;
        a->high[k] = kind == 1 ? FLT_MAX : a->low[k] + (kind == 3 ? 0.25f : 0.0f);
        a->low[k] = kind == 2 ? -FLT_MAX : a->low[k];
        a->value[k] = kind == 4 ? a->high[k] : a->value[k];
    }
    return OVOID_OK;
}

#define LIMIT 1.2

static ovoid_status check_residual(ov_checking *c, ov_setting *s, const charges *a) {
    ovoid_status status = OVOID_OK;
    ov_buffer value = {0}, target = {0}, u = {0}, sums = {0};
    float *got = NULL, *of_packs = NULL;
    OV_TRY(ov_put_floats(c->context, &value, a->value, s->places));
    OV_TRY(ov_put_floats(c->context, &target, a->weight, s->places));
    OV_TRY(ov_residual(c->context, &s->operations, &s->points, &value, &target, LIMIT, &u, &sums));
    OV_TRY(ov_read_words(c->context, &u, s->places, &got));
    OV_TRY(ov_read_words(c->context, &sums, 2 * s->points.packs, &of_packs));
    for (size_t pack = 0; pack < s->points.packs; ++pack) {
        double sum = 0.0, largest = 0.0;
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK; ++k) {
            const double wanted = ov_points_fill(&s->points, k)
                                      ? 0.0
                                      : ov_twin_residual(a->value[k], a->weight[k], (float)LIMIT);
            ov_expect_near(c, got[k], wanted, 4.0 * FLT_EPSILON, "residual: point", k);
            sum += wanted * wanted;
            largest = fmax(largest, fabs(wanted));
        }
        ov_expect_near(c, of_packs[2 * pack], sum, 1e-5 * sum + 1e-9, "residual: sum of pack",
                       pack);
        ov_expect_near(c, of_packs[2 * pack + 1], largest, 1e-6, "residual: largest of pack", pack);
    }
cleanup:
    free(got);
    free(of_packs);
    ov_buffer *const buffers[] = {&value, &target, &u, &sums};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    return status;
}

/* u, then active, of all places, then the sums. */
static void expect_misfit(ov_checking *c, const ov_setting *s, const charges *a,
                          float *const got[3]) {
    double sum = 0.0;
    for (size_t k = 0; k < s->places; ++k) {
        const double v = a->value[k], low = a->low[k], high = a->high[k], w = a->weight[k];
        const double r = v - fmin(fmax(v, low), high);
        const size_t group = k / (OV_PACK * OV_MISFIT_PACKS);
        ov_expect_near(c, got[0][k], w * r, 8.0 * FLT_EPSILON, "misfit: residual", k);
        ov_expect_near(c, got[1][k], r != 0.0 || low == high ? w : 0.0, 0.0, "misfit: weight", k);
        sum += w * r * r;
        if (k + 1 < s->places && (k + 1) % (OV_PACK * OV_MISFIT_PACKS) != 0)
            continue;
        ov_expect_near(c, got[2][group], sum, 2e-6 * sum + 1e-9, "misfit: sum", group);
        sum = 0.0;
    }
}

static ovoid_status check_misfit(ov_checking *c, const ov_setting *s, const charges *a) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    const float *const given[] = {a->value, a->low, a->high, a->weight};
    const cl_uint packs = (cl_uint)s->points.packs;
    const size_t sums = (packs + OV_MISFIT_PACKS - 1) / OV_MISFIT_PACKS;
    const size_t sizes[] = {s->places, s->places, sums};
    ov_kernel kernel = {0};
    ov_buffer in[4] = {0}, out[3] = {0};
    float *got[3] = {NULL};
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "misfit", "misfit", &kernel));
    for (size_t k = 0; k < 4; ++k)
        OV_TRY(ov_put_floats(context, &in[k], given[k], s->places));
    for (size_t k = 0; k < 3; ++k)
        OV_TRY(ov_buffer_reserve(context, &out[k], sizes[k] * sizeof(float), "a misfit"));
    const size_t group = ov_item_group(device);
    OV_TRY(OV_LAUNCH(context, &kernel, sums * group, group, OV_ARG(packs), OV_ARG(in[0].memory),
                     OV_ARG(in[1].memory), OV_ARG(in[2].memory), OV_ARG(in[3].memory),
                     OV_ARG(out[0].memory), OV_ARG(out[1].memory), OV_ARG(out[2].memory)));
    for (size_t k = 0; k < 3; ++k)
        OV_TRY(ov_read_words(context, &out[k], sizes[k], &got[k]));
    expect_misfit(c, s, a, got);
cleanup:
    for (size_t k = 0; k < 4; ++k)
        ov_buffer_destroy(&in[k]);
    for (size_t k = 0; k < 3; ++k) {
        ov_buffer_destroy(&out[k]);
        free(got[k]);
    }
    ov_kernel_destroy(&kernel);
    return status;
}

ovoid_status ov_check_misfit(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ov_random random = {7};
    ov_setting s = {0};
    charges a = {0};
    OV_TRY(ov_setting_create(c->context, 6, 1, ov_check_size(c, 50003, 1403), 4.0, 20.0, 1e-3, &s));
    OV_TRY(make_charges(c->context, &s, &random, &a));
    OV_TRY(check_residual(c, &s, &a));
    OV_TRY(check_misfit(c, &s, &a));
cleanup:
    destroy_charges(&a);
    ov_setting_destroy(&s);
    return status;
}

/* ---- copies of packs ---------------------------------------------------------------------- */

static ovoid_status launch_gather(ovoid_context *context, const char *name,
                                  const ov_buffer *const *buffers, size_t packs) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    const cl_uint count = (cl_uint)packs;
    ov_arg args[9] = {OV_ARG(count)};
    size_t used = 1;
    ov_device *device;
    for (; buffers[used - 1]; ++used)
        args[used] = OV_ARG(buffers[used - 1]->memory);
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "gather", name, &kernel));
    OV_TRY(ov_launch(context, &kernel, packs, ov_item_group(device), args, used));
cleanup:
    ov_kernel_destroy(&kernel);
    return status;
}

/* Each third pack. */
static size_t some_packs(size_t packs, uint32_t *list) {
    size_t count = 0;
    for (size_t pack = 1; pack < packs; pack += 3)
        list[count++] = (uint32_t)pack;
    return count;
}

static ovoid_status check_points(ov_checking *c, const ov_setting *s, const uint32_t *list,
                                 size_t count, ov_buffer *numbers) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    ov_points some = {0};
    float *all = NULL, *got = NULL, *origins = NULL;
    float *const wanted = ov_alloc(context, 3 * OV_PACK * count, sizeof *wanted, "packs");
    if (!wanted)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_points_gather(context, &s->points, list, count, numbers, &some));
    OV_TRY(ov_read_words(context, &s->points.xyz, 3 * s->places, &all));
    OV_TRY(ov_read_words(context, &some.xyz, 3 * OV_PACK * count, &got));
    OV_TRY(ov_read_words(context, &some.pack_origins, 4 * count, &origins));
    ov_twin_gather(list, count, 3 * OV_PACK, all, wanted);
    ov_expect_same(c, got, wanted, 3 * OV_PACK * count, "gather_points: coordinate");
    ov_twin_gather(list, count, 4, s->points.pack_origin, wanted);
    ov_expect_same(c, origins, wanted, 4 * count, "gather_points: origin");
cleanup:
    free(wanted);
    free(all);
    free(got);
    free(origins);
    ov_points_destroy(&some);
    return status;
}

enum { LOW, HIGH, WEIGHT, TARGETS };

/* Bounds less the values of others; weights. */
static void expect_target(ov_checking *c, const uint32_t *list, size_t count, float *const *all,
                          const float *value, float *const *got) {
    for (size_t n = 0; n < count; ++n)
        for (size_t k = 0; k < OV_PACK; ++k) {
            const size_t from = list[n] * (size_t)OV_PACK + k, to = n * OV_PACK + k;
            for (int t = LOW; t <= HIGH; ++t)
                ov_expect_near(c, got[t][to], ov_twin_rest(all[t][from], value[to]),
                               fabsf(all[t][from]) == FLT_MAX ? 0.0 : 4.0 * FLT_EPSILON,
                               "gather_target: bound", to);
            ov_expect_same(c, &got[WEIGHT][to], &all[WEIGHT][from], 1, "gather_target: weight");
        }
}

/* Gathers targets, then puts others in their places. */
static ovoid_status check_targets(ov_checking *c, const ov_setting *s, const uint32_t *list,
                                  size_t count, const ov_buffer *numbers) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ovoid_context *const context = c->context;
    const size_t own = count * OV_PACK;
    ov_random random = {9};
    charges a = {0};
    ov_buffer device[TARGETS] = {0}, some[TARGETS] = {0}, value = {0}, packed = {0};
    float *got[TARGETS] = {NULL};
    float *const values = ov_random_floats(context, &random, own, 0.0, 1.0);
    float *const news = ov_random_floats(context, &random, TARGETS * own, 0.0, 1.0);
    if (!values || !news)
        goto cleanup;
    OV_TRY(make_charges(context, s, &random, &a));
    float *const all[TARGETS] = {a.low, a.high, a.weight};
    for (int t = 0; t < TARGETS; ++t) {
        OV_TRY(ov_put_floats(context, &device[t], all[t], s->places));
        OV_TRY(ov_buffer_reserve(context, &some[t], own * sizeof(float), "targets"));
    }
    OV_TRY(ov_put_floats(context, &value, values, own));
    OV_TRY(ov_put_floats(context, &packed, news, TARGETS * own));
    OV_TRY(launch_gather(context, "gather_target",
                         (const ov_buffer *const[]){numbers, &device[LOW], &device[HIGH],
                                                    &device[WEIGHT], &value, &some[LOW],
                                                    &some[HIGH], &some[WEIGHT], NULL},
                         count));
    for (int t = 0; t < TARGETS; ++t)
        OV_TRY(ov_read_words(context, &some[t], own, &got[t]));
    expect_target(c, list, count, all, values, got);
    OV_TRY(launch_gather(context, "scatter_target",
                         (const ov_buffer *const[]){numbers, &packed, &device[LOW], &device[HIGH],
                                                    &device[WEIGHT], NULL},
                         count));
    for (int t = 0; t < TARGETS; ++t) {
        free(got[t]);
        got[t] = NULL;
        OV_TRY(ov_read_words(context, &device[t], s->places, &got[t]));
        for (size_t n = 0; n < count; ++n)
            memcpy(all[t] + list[n] * (size_t)OV_PACK, news + (TARGETS * n + (size_t)t) * OV_PACK,
                   OV_PACK * sizeof(float));
        ov_expect_same(c, got[t], all[t], s->places, "scatter_target: number");
    }
cleanup:
    for (int t = 0; t < TARGETS; ++t) {
        free(got[t]);
        ov_buffer_destroy(&device[t]);
        ov_buffer_destroy(&some[t]);
    }
    destroy_charges(&a);
    free(values);
    free(news);
    ov_buffer_destroy(&value);
    ov_buffer_destroy(&packed);
    return status;
}

/* Those of the list have terms, and nobody else. */
static ovoid_status check_reached(ov_checking *c, const uint32_t *list, size_t count,
                                  size_t packs) {
    ovoid_status status = OVOID_OK;
    ov_lists lists = {.packs = packs};
    ov_buffer there = {0};
    ov_packs found = {0};
    uint32_t *const start = ov_alloc(c->context, packs + 1, sizeof *start, "starts of lists");
    if (!start)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0, n = 0; k < packs; ++k) {
        const bool reached = n < count && list[n] == k;
        start[k + 1] = start[k] + (reached ? 1 + (uint32_t)(k % 5) : 0);
        n += reached;
    }
    OV_TRY(ov_buffer_put(c->context, &lists.pack_start, start, (packs + 1) * sizeof *start,
                         "starts of lists"));
    OV_TRY(ov_packs_reached(c->context, &lists, &there, &found));
    ov_expect_near(c, (double)found.count, (double)count, 0.0, "list_reached: number", 0);
    for (size_t n = 0; n < count && n < found.count; ++n)
        ov_expect_near(c, found.pack[n], list[n], 0.0, "list_reached: pack", n);
cleanup:
    free(start);
    ov_packs_destroy(&found);
    ov_buffer_destroy(&there);
    ov_lists_destroy(&lists);
    return status;
}

ovoid_status ov_check_gather(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ov_setting s = {0};
    ov_buffer numbers = {0};
    uint32_t *list = NULL;
    OV_TRY(ov_setting_create(c->context, 8, 1, ov_check_size(c, 50003, 503), 4.0, 9.0, 1e-3, &s));
    list = ov_alloc(c->context, s.points.packs, sizeof *list, "a list of packs");
    if (!list) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    const size_t count = some_packs(s.points.packs, list);
    OV_TRY(check_points(c, &s, list, count, &numbers));
    OV_TRY(check_targets(c, &s, list, count, &numbers));
    OV_TRY(check_reached(c, list, count, s.points.packs));
cleanup:
    free(list);
    ov_buffer_destroy(&numbers);
    ov_setting_destroy(&s);
    return status;
}

/* ---- the caller's order ------------------------------------------------------------------- */

#define NOBODY UINT32_MAX /* as in kernels/spread.cl */
#define SPREAD_GROUP 64

/* A number that tells place and component apart, exact in a float. */
static float mark(size_t place, size_t component) {
    return (float)(place % 4000003 + 4194304 * component);
}

static ovoid_status run_spread(ovoid_context *context, cl_uint places, cl_ulong first,
                               const uint32_t *to, const float *value, const float *gradient,
                               ov_buffer *values, ov_buffer *slopes) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    ov_buffer of_to = {0}, of_value = {0}, of_gradient = {0};
    OV_TRY(ov_kernel_create(context, "spread", "spread", &kernel));
    OV_TRY(ov_buffer_put(context, &of_to, to, places * sizeof *to, "places"));
    OV_TRY(ov_put_floats(context, &of_value, value, places));
    OV_TRY(ov_put_floats(context, &of_gradient, gradient, 3 * (size_t)places));
    OV_TRY(OV_LAUNCH(context, &kernel, places, SPREAD_GROUP, OV_ARG(places), OV_ARG(first),
                     OV_ARG(of_to.memory), OV_ARG(of_value.memory), OV_ARG(of_gradient.memory),
                     OV_ARG(values->memory), OV_ARG(slopes->memory)));
cleanup:
    ov_buffer_destroy(&of_to);
    ov_buffer_destroy(&of_value);
    ov_buffer_destroy(&of_gradient);
    ov_kernel_destroy(&kernel);
    return status;
}

/* Places back to front, every seventh of nobody's; `first` points lie before. More than 2^21 of
 * them in the whole form. */
ovoid_status ov_check_spread(ov_checking *c) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ovoid_context *const context = c->context;
    const size_t packs = ov_check_size(c, ((size_t)1 << 17) + 5, 23), places = packs * OV_PACK;
    const size_t first = 3, all = places + first;
    ov_buffer values = {0}, slopes = {0};
    float *got = NULL, *got_slopes = NULL;
    uint32_t *const to = ov_alloc(context, places, sizeof *to, "places of a check");
    float *const value = ov_alloc(context, places, sizeof *value, "values of a check");
    float *const gradient = ov_alloc(context, 3 * places, sizeof *gradient, "slopes of a check");
    float *const wanted = ov_alloc(context, 4 * all, sizeof *wanted, "results of a check");
    if (!to || !value || !gradient || !wanted)
        goto cleanup;
    for (size_t k = 0; k < places; ++k) {
        to[k] = k % 7 == 3 ? NOBODY : (uint32_t)(places - 1 - k);
        value[k] = mark(k, 0);
        for (size_t axis = 0; axis < 3; ++axis)
            gradient[(3 * (k / OV_PACK) + axis) * OV_PACK + k % OV_PACK] = mark(k, 1 + axis);
    }
    OV_TRY(ov_put_floats(context, &values, wanted, all));
    OV_TRY(ov_put_floats(context, &slopes, wanted, 3 * all));
    OV_TRY(run_spread(context, (cl_uint)places, first, to, value, gradient, &values, &slopes));
    OV_TRY(ov_read_words(context, &values, all, &got));
    OV_TRY(ov_read_words(context, &slopes, 3 * all, &got_slopes));
    for (size_t k = 0; k < places; ++k)
        for (size_t n = 0; n < 4 && to[k] != NOBODY; ++n)
            wanted[n == 0 ? first + to[k] : all + 3 * (first + to[k]) + n - 1] = mark(k, n);
    ov_expect_same(c, got, wanted, all, "spread: value");
    ov_expect_same(c, got_slopes, wanted + all, 3 * all, "spread: slope");
cleanup:
    free(to);
    free(value);
    free(gradient);
    free(wanted);
    free(got);
    free(got_slopes);
    ov_buffer_destroy(&values);
    ov_buffer_destroy(&slopes);
    return status;
}
