/*
 * The kernel misfit against its twin: residuals of points that are followed on both sides and of
 * guards that bound one side.
 */
#include "support.h"

/* Points of every kind, in turn. */
typedef enum point_kind {
    POINT_TWO_SIDED, /* low = high */
    POINT_HIT,       /* and the value is the same */
    POINT_INSIDE,    /* bounded below */
    POINT_OUTSIDE,   /* bounded above */
    POINT_ON_INSIDE, /* the value is the bound */
    POINT_ON_OUTSIDE,
    POINT_BETWEEN, /* bounded on both sides, apart */
    POINT_WEIGHTLESS,
    POINT_KINDS
} point_kind;

typedef struct case_of_points {
    size_t count, packs;
    float *value, *low, *high, *weight;
} case_of_points;

static void make_case(test_random *random, size_t count, case_of_points *c) {
    c->count = count;
    c->packs = (count + OV_PACK - 1) / OV_PACK;
    float **const arrays[] = {&c->value, &c->low, &c->high, &c->weight};
    for (size_t n = 0; n < sizeof arrays / sizeof *arrays; ++n)
        *arrays[n] = test_alloc(c->packs * OV_PACK, sizeof **arrays[n]);
    for (size_t k = 0; k < c->packs * OV_PACK; ++k) {
        const float bound = (float)random_uniform(random, 0.0, 2.0);
        const point_kind kind = (point_kind)(random_bits(random) % POINT_KINDS);
        c->value[k] = (float)random_uniform(random, 0.0, 2.0);
        c->weight[k] = (float)random_uniform(random, 0.1, 3.0);
        c->low[k] = c->high[k] = bound;
        if (kind == POINT_HIT || kind == POINT_ON_INSIDE || kind == POINT_ON_OUTSIDE)
            c->value[k] = bound;
        if (kind == POINT_INSIDE || kind == POINT_ON_INSIDE)
            c->high[k] = FLT_MAX;
        if (kind == POINT_OUTSIDE || kind == POINT_ON_OUTSIDE)
            c->low[k] = -FLT_MAX;
        if (kind == POINT_BETWEEN)
            c->high[k] = bound + 0.25f;
        if (kind == POINT_WEIGHTLESS)
            c->weight[k] = 0.0f;
        if (k >= count) { /* the fill */
            c->value[k] = 1e30f;
            c->low[k] = c->high[k] = c->weight[k] = 0.0f;
        }
    }
}

static void destroy_case(case_of_points *c) {
    free(c->value);
    free(c->low);
    free(c->high);
    free(c->weight);
}

/* What the kernel leaves, one pack more than there are: the last one is `untouched`. */
typedef struct result_of_points {
    float *u, *active, *sums;
} result_of_points;

static const float untouched = -77.0f;

static size_t sums_of(const case_of_points *c) {
    return (c->packs + OV_MISFIT_PACKS - 1) / OV_MISFIT_PACKS;
}

/* group: work-items that share a sum. */
static void run_case(ovoid_context *context, const case_of_points *c, size_t group,
                     result_of_points *result) {
    ov_kernel kernel = {0};
    ov_buffer value = {0}, low = {0}, high = {0}, weight = {0}, u = {0}, active = {0}, sums = {0};
    const size_t all = c->packs * OV_PACK, more = all + OV_PACK;
    const cl_uint packs = (cl_uint)c->packs;
    float *const marks = test_alloc(more, sizeof *marks);
    for (size_t k = 0; k < more; ++k)
        marks[k] = untouched;
    test_check(context, ov_kernel_create(context, "misfit", "misfit", &kernel));
    write_floats(context, &value, c->value, all);
    write_floats(context, &low, c->low, all);
    write_floats(context, &high, c->high, all);
    write_floats(context, &weight, c->weight, all);
    write_floats(context, &u, marks, more);
    write_floats(context, &active, marks, more);
    write_floats(context, &sums, marks, sums_of(c) + 1);
    test_check(context, OV_LAUNCH(context, &kernel, sums_of(c) * group, group, OV_ARG(packs),
                                  OV_ARG(value.memory), OV_ARG(low.memory), OV_ARG(high.memory),
                                  OV_ARG(weight.memory), OV_ARG(u.memory), OV_ARG(active.memory),
                                  OV_ARG(sums.memory)));
    result->u = read_floats(context, &u, more);
    result->active = read_floats(context, &active, more);
    result->sums = read_floats(context, &sums, sums_of(c) + 1);
    ov_buffer *const buffers[] = {&value, &low, &high, &weight, &u, &active, &sums};
    for (size_t n = 0; n < sizeof buffers / sizeof *buffers; ++n)
        ov_buffer_destroy(buffers[n]);
    ov_kernel_destroy(&kernel);
    free(marks);
}

static void destroy_result(result_of_points *result) {
    free(result->u);
    free(result->active);
    free(result->sums);
}

/* Residual of point k: how far its value is above high or below low. */
static float residual_of(const case_of_points *c, size_t k) {
    if (c->value[k] > c->high[k])
        return c->value[k] - c->high[k];
    return c->value[k] < c->low[k] ? c->value[k] - c->low[k] : 0.0f;
}

/* u and active to the last bit, sums to rounding. */
static void expect_case(const case_of_points *c, const result_of_points *result) {
    double of_group = 0.0;
    for (size_t pack = 0; pack < c->packs; ++pack) {
        double sum = 0.0;
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK; ++k) {
            const float r = residual_of(c, k);
            const bool followed = c->low[k] == c->high[k];
            assert_true(result->u[k] == c->weight[k] * r);
            assert_true(result->active[k] == (r != 0.0f || followed ? c->weight[k] : 0.0f));
            sum += (double)c->weight[k] * r * r;
        }
        of_group += sum;
        if (pack % OV_MISFIT_PACKS < OV_MISFIT_PACKS - 1 && pack < c->packs - 1)
            continue;
        expect_near(result->sums[pack / OV_MISFIT_PACKS], of_group, 5e-7 * of_group, "a sum");
        of_group = 0.0;
    }
    for (size_t k = 0; k < OV_PACK; ++k) {
        assert_true(result->u[c->packs * OV_PACK + k] == untouched);
        assert_true(result->active[c->packs * OV_PACK + k] == untouched);
    }
    assert_true(result->sums[sums_of(c)] == untouched);
}

static void misfit_equals_twin(void **state) {
    const size_t counts[] = {1, OV_PACK - 1, OV_PACK, OV_PACK + 1, 4 * OV_PACK, 67, 1000, 5003};
    const size_t tried = test_size(sizeof counts / sizeof *counts, 7);
    for (size_t n = 0; n < tried; ++n) {
        test_random random = {n};
        case_of_points c;
        result_of_points result;
        make_case(&random, counts[n], &c);
        for (size_t group = 1; group <= OV_MISFIT_PACKS; group *= 4) {
            run_case(*state, &c, group, &result);
            expect_case(&c, &result);
            destroy_result(&result);
        }
        destroy_case(&c);
    }
}

/* Guards kept and broken, and points that are followed. */
static void charges_by_hand(void **state) {
    float value[OV_PACK] = {3.0f, 1.0f, 3.0f, 2.0f, 0.5f, 0.25f, 1.5f, -9.0f};
    float low[OV_PACK] = {2.0f, 2.0f, 2.0f, 2.0f, -FLT_MAX, -FLT_MAX, 1.5f, -FLT_MAX};
    float high[OV_PACK] = {FLT_MAX, FLT_MAX, 2.0f, FLT_MAX, 0.25f, 0.25f, 1.5f, 0.25f};
    float weight[OV_PACK] = {4.0f, 4.0f, 4.0f, 4.0f, 4.0f, 4.0f, 4.0f, 4.0f};
    const float u[OV_PACK] = {0.0f, -4.0f, 4.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f};
    const float active[OV_PACK] = {0.0f, 4.0f, 4.0f, 0.0f, 4.0f, 0.0f, 4.0f, 0.0f};
    const case_of_points c = {8, 1, value, low, high, weight};
    result_of_points result;
    run_case(*state, &c, 4, &result);
    for (size_t k = 0; k < OV_PACK; ++k) {
        assert_true(result.u[k] == u[k]);
        assert_true(result.active[k] == active[k]);
    }
    assert_true(result.sums[0] == 4.0f + 4.0f + 0.25f);
    destroy_result(&result);
}

/* The largest values that floats hold cost nothing where they are allowed. */
static void huge_values_within_guards(void **state) {
    float value[OV_PACK], low[OV_PACK], high[OV_PACK], weight[OV_PACK];
    for (size_t k = 0; k < OV_PACK; ++k) {
        value[k] = k % 2 ? FLT_MAX : -FLT_MAX;
        low[k] = k % 2 ? 2.0f : -FLT_MAX;
        high[k] = k % 2 ? FLT_MAX : 0.02f;
        weight[k] = 1e3f;
    }
    const case_of_points c = {OV_PACK, 1, value, low, high, weight};
    result_of_points result;
    run_case(*state, &c, 4, &result);
    for (size_t k = 0; k < OV_PACK; ++k)
        assert_true(result.u[k] == 0.0f && result.active[k] == 0.0f);
    assert_true(result.sums[0] == 0.0f);
    destroy_result(&result);
}

/* A model that overflows must not look like a good one. */
static void infinity_is_seen(void **state) {
    float value[OV_PACK] = {0.0f}, low[OV_PACK] = {0.0f}, high[OV_PACK] = {0.0f}, weight[OV_PACK];
    for (size_t k = 0; k < OV_PACK; ++k)
        weight[k] = 1.0f;
    value[3] = INFINITY;
    const case_of_points c = {OV_PACK, 1, value, low, high, weight};
    result_of_points result;
    run_case(*state, &c, 4, &result);
    assert_true(!(result.sums[0] < FLT_MAX));
    destroy_result(&result);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(misfit_equals_twin),
        cmocka_unit_test(charges_by_hand),
        cmocka_unit_test(huge_values_within_guards),
        cmocka_unit_test(infinity_is_seen),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
