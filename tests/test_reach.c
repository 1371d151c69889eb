/*
 * Which ellipsoids are felt at a place: all of them and no others, whatever their shapes, and
 * however many there are.
 */
#include "fit/adaptive/reach.h"
#include "support.h"

enum { P = OV_FACTOR_PARAMETERS };

/* Ellipsoids of a kind in a box; some of them long. */
static double *make_ellipsoids(test_random *random, model_kind kind, double half, size_t count) {
    ovoid_ellipsoid *const ellipsoids = test_alloc(count, sizeof *ellipsoids);
    double *const x = test_alloc(count * P, sizeof *x);
    random_ellipsoids(random, kind, half, ellipsoids, count);
    for (size_t i = 0; i < count; ++i) {
        ov_quadric quadric;
        if (kind == MODEL_RANDOM)
            ellipsoids[i].decay[2] *= i % 20 == 0 ? 0.002 : 2.0;
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadric);
        ov_factor_of_quadric(&quadric, x + i * P);
    }
    free(ellipsoids);
    return x;
}

/* Against asking each; returns how many were felt. */
static size_t expect_felt(const ov_reach *reach, const double *x, size_t count, double log_least,
                          const double at[3], uint32_t *found) {
    const size_t felt = ov_reach_at(reach, at, found);
    bool *const seen = test_alloc(count, sizeof *seen);
    memset(seen, 0, count * sizeof *seen);
    for (size_t n = 0; n < felt; ++n) {
        assert_true(found[n] < count && !seen[found[n]]);
        seen[found[n]] = true;
    }
    for (size_t i = 0; i < count; ++i) {
        ov_quadric quadric;
        ov_factor_quadric(x + i * P, &quadric);
        assert_true(seen[i] == (ov_quadric_log_value(&quadric, at) > log_least));
    }
    free(seen);
    return felt;
}

static void all_that_are_felt(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    test_check(NULL, ovoid_context_create(&context));
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        test_random random = {(uint64_t)kind};
        const size_t count = kind == MODEL_SPHERE ? 3000 : 400; /* the former are a crowd */
        const double half = kind == MODEL_SPHERE ? 3.0 : 20.0, log_least = log(0.01);
        double *const x = make_ellipsoids(&random, (model_kind)kind, half, count);
        uint32_t *const found = test_alloc(count, sizeof *found);
        ov_reach reach;
        size_t felt = 0;
        test_check(context, ov_reach_create(context, x, count, log_least, &reach));
        if (kind == MODEL_RANDOM)
            assert_in_range(reach.wide_count, 1, count / 4); /* most go through the grid */
        for (int n = 0; n < 100; ++n) {
            double at[3];
            for (int k = 0; k < 3; ++k)
                at[k] = random_uniform(&random, -1.2 * half, 1.2 * half);
            felt += expect_felt(&reach, x, count, log_least, at, found);
        }
        print_message("%s: %zu felt, %zu of %zu wide\n", model_kind_name((model_kind)kind), felt,
                      reach.wide_count, count);
        ov_reach_destroy(&reach);
        ov_reach_destroy(&reach);
        free(found);
        free(x);
    }
    ovoid_context_destroy(&context);
}

/* None at all, and none that is felt anywhere. */
static void nobody(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    test_random random = {9};
    test_check(NULL, ovoid_context_create(&context));
    double *const x = make_ellipsoids(&random, MODEL_RANDOM, 1.0, 5);
    const double at[3] = {0};
    uint32_t found[5];
    ov_reach reach;
    test_check(context, ov_reach_create(context, x, 0, 0.0, &reach));
    assert_int_equal(ov_reach_at(&reach, at, found), 0);
    ov_reach_destroy(&reach);
    test_check(context, ov_reach_create(context, x, 5, 1e3, &reach));
    assert_int_equal(ov_reach_at(&reach, at, found), 0);
    ov_reach_destroy(&reach);
    free(x);
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_that_are_felt),
        cmocka_unit_test(nobody),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
