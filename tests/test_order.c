/*
 * Ellipsoids along the curve: the same ones, neighbours beside each other, with the atoms that they
 * had.
 */
#include "fit/adaptive/search.h"
#include "support.h"

enum { P = OV_FACTOR_PARAMETERS, ATOMS = 900, COUNT = 300 };

/* Any ellipsoids, with any owners. */
static ov_trial trial_of(const ov_adaptive *f, test_random *random, size_t count) {
    ov_trial t;
    test_check(f->context, ov_trial_create(f, &t));
    t.count = count;
    for (size_t j = 0; j < count * P; ++j)
        t.x[j] = random_uniform(random, -1.0, 1.0);
    for (size_t i = 0; i < count; ++i)
        for (size_t k = 0; k < 3; ++k)
            t.x[i * P + OV_FACTOR_CENTRE + k] = random_uniform(random, -30.0, 30.0);
    for (size_t k = 0; k < f->atoms; ++k)
        t.owner[k] = (uint32_t)(random_bits(random) % count);
    return t;
}

/* From the first to the last, angstrom. */
static double way_along(const ov_trial *t) {
    double way = 0.0;
    for (size_t i = 1; i < t->count; ++i) {
        const double *const a = t->x + i * P + OV_FACTOR_CENTRE, *const b = a - P;
        way += hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    }
    return way;
}

static int by_bytes(const void *a, const void *b) {
    return memcmp(a, b, P * sizeof(double));
}

static void neighbours_come_together(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    test_random random = {1};
    test_check(NULL, ovoid_context_create(&context));
    ov_adaptive f = {.context = context, .atoms = ATOMS, .capacity = COUNT};
    ov_trial t = trial_of(&f, &random, COUNT), before = trial_of(&f, &random, COUNT);
    ov_trial_copy(&t, &before);
    f.refiner.listing[0].listed_count = COUNT; /* it knows of the old order */
    test_check(context, ov_adaptive_sort(&f, &t));
    assert_int_equal(f.refiner.listing[0].listed_count, 0);
    assert_int_equal(t.count, COUNT);
    print_message("from the first to the last: %.0f angstrom, before %.0f\n", way_along(&t),
                  way_along(&before));
    assert_true(way_along(&t) < 0.4 * way_along(&before));
    for (size_t k = 0; k < ATOMS; ++k)
        assert_memory_equal(t.x + t.owner[k] * (size_t)P, before.x + before.owner[k] * (size_t)P,
                            P * sizeof *t.x);
    f.refiner.listing[0].listed_count = COUNT;
    ov_trial again = trial_of(&f, &random, COUNT);
    ov_trial_copy(&t, &again);
    test_check(context, ov_adaptive_sort(&f, &again)); /* nothing to do */
    assert_memory_equal(again.x, t.x, COUNT * P * sizeof *t.x);
    assert_int_equal(f.refiner.listing[0].listed_count, COUNT);
    qsort(t.x, COUNT, P * sizeof *t.x, by_bytes);
    qsort(before.x, COUNT, P * sizeof *t.x, by_bytes);
    assert_memory_equal(t.x, before.x, COUNT * P * sizeof *t.x);
    ov_trial_destroy(&t);
    ov_trial_destroy(&before);
    ov_trial_destroy(&again);
    ovoid_context_destroy(&context);
}

/* One, and some at the same place, which keep their order. */
static void few_and_coincident(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    test_random random = {2};
    test_check(NULL, ovoid_context_create(&context));
    ov_adaptive f = {.context = context, .atoms = ATOMS, .capacity = COUNT};
    for (size_t count = 1; count <= 5; count += 4) {
        ov_trial t = trial_of(&f, &random, count), before = trial_of(&f, &random, count);
        for (size_t i = 0; i < count; ++i)
            for (size_t k = 0; k < 3; ++k)
                t.x[i * P + OV_FACTOR_CENTRE + k] = 7.0;
        ov_trial_copy(&t, &before);
        test_check(context, ov_adaptive_sort(&f, &t));
        assert_memory_equal(t.x, before.x, count * P * sizeof *t.x);
        assert_memory_equal(t.owner, before.owner, ATOMS * sizeof *t.owner);
        ov_trial_destroy(&t);
        ov_trial_destroy(&before);
    }
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(neighbours_come_together),
        cmocka_unit_test(few_and_coincident),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
