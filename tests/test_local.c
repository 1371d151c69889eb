/*
 * The accuracy step of some ellipsoids: the others keep their bits, the misfit of the whole falls
 * by what that of the part does, and the points left out do not matter.
 */
#include "fit/adaptive/local.h"
#include "scene.h"

enum { P = OV_FACTOR_PARAMETERS };

/* A row of ellipsoids, so that one end hardly knows of the other, and its target. */
typedef struct row {
    scene s;
    double *x; /* off by a little */
} row;

static void row_create(row *r, ovoid_context *context, size_t count, double off, uint64_t seed) {
    test_random random = {seed};
    ov_target_options options;
    ov_target_options_init(&options);
    ov_quadric *const quadrics = scene_ellipsoids(&random, count);
    for (size_t i = 0; i < count; ++i) {
        quadrics[i].centre[0] = 2.5 * (double)i;
        quadrics[i].centre[1] *= 0.2;
        quadrics[i].centre[2] *= 0.2;
    }
    scene_create(&r->s, context, quadrics, count, 0.5, 1.0, test_size(7, 16) / 10.0,
                 test_small() ? 3.0 : 4.5, &options);
    r->x = test_alloc(count * P, sizeof *r->x);
    for (size_t i = 0; i < count; ++i) {
        ov_factor_of_quadric(&quadrics[i], r->x + i * P);
        for (int k = 0; k < P; ++k)
            r->x[i * P + (size_t)k] += off * random_uniform(&random, -1.0, 1.0);
    }
    test_check(context, ov_target_emphasise(context, &r->s.target, quadrics->centre,
                                            sizeof *quadrics, 1, 3.0, 2.0));
    free(quadrics);
}

static void row_destroy(row *r) {
    scene_destroy(&r->s);
    free(r->x);
}

static double *copy_of(const row *r) {
    double *const copy = test_alloc(r->s.count * P, sizeof *copy);
    memcpy(copy, r->x, r->s.count * P * sizeof *copy);
    return copy;
}

static ov_refine_options options_of(uint32_t steps) {
    return (ov_refine_options){.steps = steps,
                               .solver_steps = (uint32_t)test_size(40, 4),
                               .solver_tolerance = 1e-2,
                               .damping = 1e-2,
                               .width_max = 30.0};
}

static double misfit_of_all(const row *r, const double *x) {
    ov_refiner refiner = {.context = r->s.context};
    double misfit;
    test_check(r->s.context, ov_refine_evaluate(&refiner, &r->s.target, x, r->s.count, &misfit));
    ov_refiner_destroy(&refiner);
    return misfit;
}

static double refine_some(ov_local *local, const row *r, uint32_t steps, const bool *chosen,
                          double *x) {
    const ov_refine_options options = options_of(steps);
    double misfit = NAN;
    test_check(r->s.context,
               ov_refine_some(local, &r->s.target, &options, x, r->s.count, chosen, &misfit));
    return misfit;
}

/* ---- tests -------------------------------------------------------------------------------- */

/* One end, then the other with the same structure, as growing does at one spot after another. */
static void the_others_stay_and_the_whole_gains(void **state) {
    row r;
    ov_local local = {.refiner = {.context = *state}};
    row_create(&r, *state, test_size(12, 4), 0.02, 1);
    const size_t count = r.s.count, some = count / 3;
    bool *const chosen = test_alloc(count, sizeof *chosen);
    double *const x = copy_of(&r);
    for (size_t first = 0; first < count; first += count - some) {
        double *const before = copy_of(&r);
        memcpy(before, x, count * P * sizeof *x);
        for (size_t i = 0; i < count; ++i)
            chosen[i] = i >= first && i < first + some;
        const double all_before = misfit_of_all(&r, x);
        const double some_before = refine_some(&local, &r, 0, chosen, x);
        assert_memory_equal(x, before, count * P * sizeof *x); /* no step yet */
        const double some_after = refine_some(&local, &r, (uint32_t)test_size(12, 3), chosen, x);
        const double all_after = misfit_of_all(&r, x);
        print_message("%zu of %zu packs, misfit %g -> %g, of the whole %g -> %g\n",
                      local.points.packs, r.s.samples.points.packs, some_before, some_after,
                      all_before, all_after);
        for (size_t i = 0; i < count; ++i)
            assert_true(chosen[i] == (memcmp(x + i * P, before + i * P, P * sizeof *x) != 0));
        assert_true(some_after < (test_small() ? 0.9 : 0.5) * some_before);
        assert_true(local.points.packs < r.s.samples.points.packs || test_small());
        expect_near(all_after - all_before, some_after - some_before, 1e-3 * all_before,
                    "what the whole gained");
        free(before);
    }
    free(chosen);
    free(x);
    ov_local_destroy(&local);
    row_destroy(&r);
}

/* Where it has been before, with ellipsoids and packs a little elsewhere. */
static void a_second_time_equals_a_first(void **state) {
    test_skip_simulated(*state); /* a simulator's order is its own */
    row r;
    ov_local local = {.refiner = {.context = *state}}, fresh = {.refiner = {.context = *state}};
    row_create(&r, *state, test_size(9, 4), 0.1, 5);
    bool *const chosen = test_alloc(r.s.count, sizeof *chosen);
    for (size_t i = 0; i < r.s.count; ++i)
        chosen[i] = i < 3;
    refine_some(&local, &r, 0, chosen, r.x);
    for (size_t i = 0; i < 3; ++i)
        r.x[i * P + OV_FACTOR_CENTRE + 1] += 0.25;
    const double again = refine_some(&local, &r, 0, chosen, r.x);
    assert_true(again == refine_some(&fresh, &r, 0, chosen, r.x));
    free(chosen);
    ov_local_destroy(&local);
    ov_local_destroy(&fresh);
    row_destroy(&r);
}

/* Whether the packs that are looked at hold all points where the ellipsoid is felt. */
static bool sees_all(const ov_local *local, const row *r, const double *x) {
    ov_quadric quadric;
    ov_factor_quadric(x, &quadric);
    for (size_t k = 0; k < r->s.points; ++k) {
        bool kept = ov_twin_field(&quadric, 1, r->s.xyz + 3 * k).value < 1e-3;
        for (size_t n = 0; n < local->points.packs && !kept; ++n)
            kept = local->packs.pack[n] == k / OV_PACK;
        if (!kept)
            return false;
    }
    return true;
}

/* Those that go far from where they were meet the points there too, or they would do as they like
 * where nobody looks. */
static void who_escapes_is_followed(void **state) {
    test_skip_simulated(*state); /* the host follows */
    row r;
    ov_local local = {.refiner = {.context = *state}};
    row_create(&r, *state, test_size(10, 4), 0.0, 6);
    bool *const chosen = test_alloc(r.s.count, sizeof *chosen);
    memset(chosen, 0, r.s.count * sizeof *chosen);
    chosen[0] = true;
    r.x[OV_FACTOR_CENTRE] -= 5.0; /* off its place */
    const double before = misfit_of_all(&r, r.x);
    const double part = refine_some(&local, &r, (uint32_t)test_size(40, 12), chosen, r.x);
    const double after = misfit_of_all(&r, r.x);
    print_message("misfit of the whole %g -> %g, of the part %g\n", before, after, part);
    assert_true(after < (test_small() ? 0.05 : 1e-5) * before);
    assert_true(sees_all(&local, &r, r.x));
    free(chosen);
    ov_local_destroy(&local);
    row_destroy(&r);
}

/* All of them: the same as without choosing, but for the order of sums. */
static void all_chosen_is_everything(void **state) {
    test_skip_simulated(*state); /* the same kernels, of all of them */
    row r;
    ov_local local = {.refiner = {.context = *state}};
    ov_refiner refiner = {.context = *state};
    const ov_refine_options options = options_of(2);
    double wanted;
    row_create(&r, *state, test_size(6, 3), 0.05, 2);
    bool *const chosen = test_alloc(r.s.count, sizeof *chosen);
    memset(chosen, true, r.s.count * sizeof *chosen);
    double *const x = copy_of(&r);
    const double got = refine_some(&local, &r, 2, chosen, x);
    test_check(*state, ov_refine(&refiner, &r.s.target, &options, r.x, r.s.count, &wanted));
    expect_near(got, wanted, 1e-3 * wanted, "the misfit");
    for (size_t j = 0; j < r.s.count * P; ++j)
        expect_near(x[j], r.x[j], 1e-3, "a parameter");
    free(chosen);
    free(x);
    ov_local_destroy(&local);
    ov_refiner_destroy(&refiner);
    row_destroy(&r);
}

/* Of some of a row whose images stand beside it: those of the chosen follow, and those of the
 * others stay, so that the whole gains what is said. */
static void images_follow_those_chosen(void **state) {
    const ov_rigid beside = {.rotation = {1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0},
                             .shift = {1.0, 2.0, 0.0}};
    row r;
    ov_local local = {.refiner = {.context = *state}};
    ov_refiner whole = {.context = *state};
    const ov_refine_options none = options_of(0);
    double before, after;
    test_check(*state, ov_followers_set(*state, &local.refiner.followers, &beside, 1));
    test_check(*state, ov_followers_set(*state, &whole.followers, &beside, 1));
    row_create(&r, *state, test_size(9, 4), 0.02, 3);
    bool *const chosen = test_alloc(r.s.count, sizeof *chosen);
    for (size_t i = 0; i < r.s.count; ++i)
        chosen[i] = i < 3;
    test_check(*state, ov_refine(&whole, &r.s.target, &none, r.x, r.s.count, &before));
    const double some_before = refine_some(&local, &r, 0, chosen, r.x);
    const double some_after = refine_some(&local, &r, (uint32_t)test_size(12, 3), chosen, r.x);
    test_check(*state, ov_refine(&whole, &r.s.target, &none, r.x, r.s.count, &after));
    print_message("misfit %g -> %g, of the whole %g -> %g\n", some_before, some_after, before,
                  after);
    assert_true(some_after < 0.9 * some_before);
    expect_near(after - before, some_after - some_before, 1e-3 * before, "what the whole gained");
    free(chosen);
    ov_local_destroy(&local);
    ov_refiner_destroy(&whole);
    row_destroy(&r);
}

/* Nobody, or one that reaches no point: nothing to do. */
static void none_chosen_changes_nothing(void **state) {
    row r;
    ov_local local = {.refiner = {.context = *state}};
    row_create(&r, *state, 3, 0.1, 3);
    bool chosen[3] = {false, false, false};
    double *const x = copy_of(&r);
    assert_true(refine_some(&local, &r, 3, chosen, x) == 0.0);
    assert_memory_equal(x, r.x, r.s.count * P * sizeof *x);
    chosen[1] = true;
    x[P + OV_FACTOR_CENTRE] = 500.0;
    assert_true(refine_some(&local, &r, 3, chosen, x) == 0.0);
    assert_true(x[P + OV_FACTOR_CENTRE] == 500.0);
    free(x);
    ov_local_destroy(&local);
    ov_local_destroy(&local); /* again */
    row_destroy(&r);
}

static bool stop(uint32_t step, double misfit, void *user) {
    (void)step;
    (void)misfit;
    (void)user;
    return false;
}

static void cancelling_leaves_all_as_it_was(void **state) {
    test_skip_simulated(*state); /* the host stops */
    row r;
    ov_local local = {.refiner = {.context = *state}};
    ov_refine_options options = options_of(5);
    const bool chosen[3] = {true, false, false};
    double misfit;
    options.go_on = stop;
    row_create(&r, *state, 3, 0.1, 4);
    double *const x = copy_of(&r);
    test_refused(*state,
                 ov_refine_some(&local, &r.s.target, &options, x, r.s.count, chosen, &misfit),
                 OVOID_ERROR_CANCELLED, "stopped while refining");
    assert_memory_equal(x, r.x, r.s.count * P * sizeof *x);
    free(x);
    ov_local_destroy(&local);
    row_destroy(&r);
}

/* Bytes each way that refining the first three ellipsoids takes in a row of so many, and reads. */
typedef struct cost {
    uint64_t up, down, reads;
} cost;

static cost cost_in_a_row(ovoid_context *context, size_t count) {
    row r;
    ov_local local = {.refiner = {.context = context}};
    row_create(&r, context, count, 0.02, 7);
    bool *const chosen = test_alloc(count, sizeof *chosen);
    for (size_t i = 0; i < count; ++i)
        chosen[i] = i < 3;
    const ov_device *const device = context->device;
    const cost before = {device->counts[OVOID_COUNT_BYTES_TO_DEVICE],
                         device->counts[OVOID_COUNT_BYTES_FROM_DEVICE],
                         device->counts[OVOID_COUNT_BLOCKING_READS]};
    refine_some(&local, &r, 2, chosen, r.x);
    test_check(context, ov_target_emphasise(context, &r.s.target, r.s.quadrics->centre,
                                            sizeof *r.s.quadrics, 3, 2.0, 2.0));
    const cost after = {device->counts[OVOID_COUNT_BYTES_TO_DEVICE] - before.up,
                        device->counts[OVOID_COUNT_BYTES_FROM_DEVICE] - before.down,
                        device->counts[OVOID_COUNT_BLOCKING_READS] - before.reads};
    print_message("%zu ellipsoids, %zu packs: %llu bytes up, %llu down, %llu reads\n", count,
                  r.s.samples.points.packs, (unsigned long long)after.up,
                  (unsigned long long)after.down, (unsigned long long)after.reads);
    free(chosen);
    ov_local_destroy(&local);
    row_destroy(&r);
    return after;
}

/* What it costs goes with what is refined, not with the molecule. */
static void far_ellipsoids_cost_little(void **state) {
    test_skip_simulated(*state);
    const cost small = cost_in_a_row(*state, 12), large = cost_in_a_row(*state, 48);
    const uint64_t terms = 36 * sizeof(ov_term); /* they are looked at, though */
    assert_true(large.up < small.up + small.up / 4 + 2 * terms);
    assert_true(large.down < small.down + small.down / 4 + 2 * terms);
    assert_true(large.reads <= small.reads + 2); /* lists may need a second walk */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_others_stay_and_the_whole_gains),
        cmocka_unit_test(a_second_time_equals_a_first),
        cmocka_unit_test(who_escapes_is_followed),
        cmocka_unit_test(all_chosen_is_everything),
        cmocka_unit_test(images_follow_those_chosen),
        cmocka_unit_test(none_chosen_changes_nothing),
        cmocka_unit_test(cancelling_leaves_all_as_it_was),
        cmocka_unit_test(far_ellipsoids_cost_little),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
