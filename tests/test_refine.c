/*
 * The accuracy step: known mixtures are found again, the misfit never rises, what is rejected
 * leaves no trace, and lists that ellipsoids moved in hold all that matters.
 */
#include "fit/adaptive/refine.h"
#include "scene.h"

enum { P = OV_FACTOR_PARAMETERS };

#define CUTOFF 1e-4 /* of the refiner: a term counts where its value is at least this */

/* ---- problems ----------------------------------------------------------------------------- */

/* A mixture, its target, and parameters that are off by `share`. */
typedef struct problem {
    scene s;
    double *x;
    size_t count; /* ellipsoids with parameters: the first of the mixture */
    size_t size;  /* bytes of x */
} problem;

/* With images of them in the mixture. */
static void problem_create_of(problem *p, ovoid_context *context, size_t count,
                              const ov_followers *followers, double share, uint64_t seed) {
    test_random random = {seed};
    ov_target_options options;
    ov_target_options_init(&options);
    const size_t all = ov_followers_all(followers, count);
    ov_quadric *const own = scene_ellipsoids(&random, count);
    ov_quadric *const quadrics = test_alloc(all, sizeof *quadrics);
    memcpy(quadrics, own, count * sizeof *own);
    free(own);
    ov_followers_place(followers, count, quadrics, NULL);
    scene_create(&p->s, context, quadrics, all, 0.5, 1.0, test_size(6, 16) / 10.0,
                 test_small() ? 3.5 : 4.5, &options);
    p->count = count;
    p->size = count * P * sizeof *p->x;
    p->x = test_alloc(count * P, sizeof *p->x);
    for (size_t i = 0; i < count; ++i) {
        double *const x = p->x + i * P;
        ov_factor_of_quadric(&quadrics[i], x);
        for (int k = 0; k < P; ++k)
            x[k] += share * random_uniform(&random, -1.0, 1.0) *
                    (k < OV_FACTOR_L ? 1.0 : 0.5); /* L is about 0.6 */
    }
    free(quadrics);
}

static void problem_create(problem *p, ovoid_context *context, size_t count, double share,
                           uint64_t seed) {
    const ov_followers none = {0};
    problem_create_of(p, context, count, &none, share, seed);
}

static void problem_destroy(problem *p) {
    scene_destroy(&p->s);
    free(p->x);
}

static ov_refine_options options_of(uint32_t steps) {
    return (ov_refine_options){.steps = steps,
                               .solver_steps = (uint32_t)test_size(60, 4),
                               .solver_tolerance = 1e-3,
                               .decrease = 0.0,
                               .damping = 1e-2,
                               .width_max = 30.0};
}

/* sum_k weight_k r_k^2 in double, over all ellipsoids everywhere. */
static double misfit_of(const scene *s, const double *x) {
    ov_quadric *const quadrics = test_alloc(s->count, sizeof *quadrics);
    float *const low = read_floats(s->context, &s->target.low, s->all);
    float *const high = read_floats(s->context, &s->target.high, s->all);
    float *const weight = read_floats(s->context, &s->target.weight, s->all);
    double sum = 0.0;
    for (size_t i = 0; i < s->count; ++i)
        ov_factor_quadric(x + i * P, &quadrics[i]);
    for (size_t k = 0; k < s->points; ++k) {
        const double value = ov_twin_field(quadrics, s->count, s->xyz + 3 * k).value;
        const double r = value - fmin(fmax(value, low[k]), high[k]);
        sum += (double)weight[k] * r * r;
    }
    free(quadrics);
    free(low);
    free(high);
    free(weight);
    return sum;
}

/* ---- lists -------------------------------------------------------------------------------- */

/* Whether the accepted model's lists hold every ellipsoid wherever it reaches the cut-off. */
static void expect_covered(const ov_refiner *refiner, const scene *s, const double *x) {
    const ov_lists *const lists = &refiner->listing[refiner->now.listing].lists;
    const size_t packs = s->samples.points.packs;
    uint32_t *const start = read_indices(s->context, &lists->pack_start, packs + 1);
    uint32_t *const item = read_indices(s->context, &lists->pack_item, lists->items);
    ov_quadric *const quadrics = test_alloc(s->count, sizeof *quadrics);
    for (size_t i = 0; i < s->count; ++i)
        ov_factor_quadric(x + i * P, &quadrics[i]);
    for (size_t pack = 0; pack < packs; ++pack)
        for (uint32_t i = 0; i < s->count; ++i) {
            bool listed = false;
            for (uint32_t n = start[pack]; n < start[pack + 1] && !listed; ++n)
                listed = item[n] == i;
            for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK && !listed; ++k)
                if (ov_twin_field(&quadrics[i], 1, s->xyz + 3 * k).value > 1.001 * CUTOFF)
                    fail_msg("ellipsoid %u is missing in pack %zu", i, pack);
        }
    free(start);
    free(item);
    free(quadrics);
}

/* ---- a record of a refinement ------------------------------------------------------------- */

enum { RECORD_MAX = 100 };

typedef struct record {
    const problem *p;
    const ov_refiner *refiner;
    uint32_t count, stop_at;
    double misfit[RECORD_MAX];
    double *x[RECORD_MAX]; /* at the end of each step */
} record;

static bool keep(uint32_t step, double misfit, void *user) {
    record *const r = user;
    assert_int_equal(step, r->count + 1);
    assert_true(r->count < RECORD_MAX);
    r->misfit[r->count] = misfit;
    r->x[r->count] = test_alloc(1, r->p->size);
    memcpy(r->x[r->count++], r->p->x, r->p->size);
    expect_covered(r->refiner, &r->p->s, r->p->x);
    return step != r->stop_at;
}

static void free_record(record *r) {
    for (uint32_t n = 0; n < r->count; ++n)
        free(r->x[n]);
}

static double run(ov_refiner *refiner, problem *p, ov_refine_options options, record *r) {
    double misfit = NAN;
    *r = (record){.p = p, .refiner = refiner};
    options.go_on = keep;
    options.user = r;
    test_check(p->s.context, ov_refine(refiner, &p->s.target, &options, p->x, p->s.count, &misfit));
    return misfit;
}

/* ---- tests -------------------------------------------------------------------------------- */

/* What one evaluation says, against all ellipsoids at all points in double. */
static void evaluation_equals_twin(void **state) {
    problem p;
    ov_refiner refiner = {.context = *state};
    double misfit;
    problem_create(&p, *state, test_size(10, 3), 0.1, 1);
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.s.count, &misfit));
    const double wanted = misfit_of(&p.s, p.x);
    expect_near(misfit, wanted, 1e-3 * wanted, "the misfit");
    float *const value = read_floats(*state, &refiner.now.value, p.s.all);
    ov_quadric *const quadrics = test_alloc(p.s.count, sizeof *quadrics);
    for (size_t i = 0; i < p.s.count; ++i)
        ov_factor_quadric(p.x + i * P, &quadrics[i]);
    for (size_t k = 0; k < p.s.points; ++k) {
        const double phi = ov_twin_field(quadrics, p.s.count, p.s.xyz + 3 * k).value;
        expect_near(value[k], phi, CUTOFF * (double)p.s.count + 1e-5 * phi, "a value");
    }
    free(value);
    free(quadrics);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

static void a_mixture_is_found_again(void **state) {
    problem p;
    record r;
    ov_refiner refiner = {.context = *state};
    problem_create(&p, *state, test_size(8, 2), 0.15, 2);
    const double before = misfit_of(&p.s, p.x);
    const uint32_t steps = test_simulated(*state) ? 2 : (uint32_t)test_size(40, 8);
    const double misfit = run(&refiner, &p, options_of(steps), &r);
    print_message("misfit %g -> %g (%g in double), %u steps, lists built %llu times for %llu "
                  "evaluations\n",
                  before, misfit, misfit_of(&p.s, p.x), r.count,
                  (unsigned long long)refiner.list_builds, (unsigned long long)refiner.evaluations);
    const double least = test_simulated(*state) ? 0.5 : test_size(1, 100) * 1e-5;
    assert_true(misfit < least * before);
    assert_true(misfit_of(&p.s, p.x) < least * before);
    for (size_t i = 0; i < p.s.count && !test_simulated(*state); ++i) {
        ov_quadric found;
        ov_factor_quadric(p.x + i * P, &found);
        const double share = test_small() ? 0.15 : 0.01;
        expect_near(found.amplitude / p.s.quadrics[i].amplitude, 1.0, 2 * share, "an amplitude");
        for (int k = 0; k < 3; ++k)
            expect_near(found.centre[k], p.s.quadrics[i].centre[k], share, "a centre");
        for (int k = 0; k < 6; ++k)
            expect_near(found.a[k], p.s.quadrics[i].a[k], share, "A");
    }
    assert_true(refiner.list_builds < refiner.evaluations); /* skins are of use */
    free_record(&r);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

/* Near an axis that their images turn about, so that each of them overlaps its own: a mixture of
 * them and of images that follow is found again, too. */
static void images_follow(void **state) {
    test_skip_simulated(*state);
    const ov_rigid motion[2] = {
        {.rotation = {-0.5, -sqrt(0.75), 0.0, sqrt(0.75), -0.5, 0.0, 0.0, 0.0, 1.0}},
        {.rotation = {-0.5, sqrt(0.75), 0.0, -sqrt(0.75), -0.5, 0.0, 0.0, 0.0, 1.0}}};
    problem p;
    ov_refiner refiner = {.context = *state};
    double misfit, before;
    const ov_refine_options options = options_of((uint32_t)test_size(40, 8));
    test_check(*state, ov_followers_set(*state, &refiner.followers, motion, 2));
    problem_create_of(&p, *state, test_size(4, 2), &refiner.followers, 0.1, 4);
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.count, &before));
    test_check(*state, ov_refine(&refiner, &p.s.target, &options, p.x, p.count, &misfit));
    print_message("misfit %g -> %g\n", before, misfit);
    assert_true(misfit < test_size(1, 100) * 1e-4 * before);
    for (size_t i = 0; i < p.count && !test_small(); ++i)
        for (size_t k = 0; k < 3; ++k)
            expect_near(p.x[i * P + OV_FACTOR_CENTRE + k], p.s.quadrics[i].centre[k], 0.02,
                        "a centre");
    double *const all = test_alloc(p.s.count * P, sizeof *all);
    for (size_t i = 0; i < p.count; ++i)
        ov_factor_quadric(p.x + i * P, &p.s.quadrics[i]);
    ov_followers_place(&refiner.followers, p.count, p.s.quadrics, NULL);
    for (size_t i = 0; i < p.s.count; ++i)
        ov_factor_of_quadric(&p.s.quadrics[i], all + i * P);
    expect_near(misfit_of(&p.s, all), misfit, 1e-3 * misfit + 1e-7 * before, "in double");
    free(all);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

/* From far off and hardly damped, so that steps are rejected too. */
static void the_misfit_never_rises(void **state) {
    test_skip_simulated(*state);
    problem p;
    record r;
    ov_refiner refiner = {.context = *state};
    ov_refine_options options = options_of((uint32_t)test_size(30, 5));
    double misfit;
    uint32_t rejected = 0;
    options.damping = 1e-7;
    problem_create(&p, *state, test_size(8, 2), test_size(5, 9) / 10.0, 4);
    double *const x = test_alloc(1, p.size);
    memcpy(x, p.x, p.size);
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.s.count, &misfit));
    const double last = run(&refiner, &p, options, &r);
    for (uint32_t n = 0; n < r.count; ++n) {
        assert_true(r.misfit[n] <= misfit);
        const bool same = memcmp(r.x[n], n > 0 ? r.x[n - 1] : x, p.size) == 0;
        assert_true(same == (r.misfit[n] == misfit)); /* nothing moves in vain */
        rejected += same;
        misfit = r.misfit[n];
    }
    print_message("%u of %u steps rejected, misfit %g\n", rejected, r.count, last);
    assert_true((rejected > 0 || test_small()) && rejected < r.count);
    assert_true(last == misfit);
    assert_memory_equal(p.x, r.x[r.count - 1], p.size);
    assert_int_equal(refiner.steps, r.count);
    free(x);
    free_record(&r);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

/* After steps taken in old lists, fresh lists say the same but for what is cut off, and
 * refiner->now is of the accepted parameters. */
static void lists_with_skins_say_the_same(void **state) {
    test_skip_simulated(*state);
    for (uint32_t steps = 1; steps <= test_size(9, 1); steps += 2) {
        problem p;
        record r;
        ov_refiner refiner = {.context = *state}, fresh = {.context = *state};
        problem_create(&p, *state, test_size(10, 3), 0.3, 6);
        double misfit = run(&refiner, &p, options_of(steps), &r), again, anew;
        float *const value = read_floats(*state, &refiner.now.value, p.s.all);
        const uint64_t built = refiner.list_builds;
        test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.s.count, &again));
        assert_true(again == misfit);
        assert_int_equal(refiner.list_builds, built); /* nothing has moved since */
        test_check(*state, ov_refine_evaluate(&fresh, &p.s.target, p.x, p.s.count, &anew));
        float *const other = read_floats(*state, &fresh.now.value, p.s.all);
        for (size_t k = 0; k < p.s.points; ++k)
            expect_near(value[k], other[k], CUTOFF * (double)p.s.count, "a value");
        expect_near(misfit, anew, 1e-3 * anew + 1e-5, "the misfit");
        expect_covered(&fresh, &p.s, p.x);
        free(value);
        free(other);
        free_record(&r);
        ov_refiner_destroy(&refiner);
        ov_refiner_destroy(&fresh);
        problem_destroy(&p);
    }
}

/* One far jump among still ones, and other numbers of ellipsoids in between. */
static void lists_follow_jumps(void **state) {
    problem p;
    ov_refiner refiner = {.context = *state};
    double misfit, anew;
    problem_create(&p, *state, test_size(10, 3), 0.1, 7);
    const double jumps[] = {0.05, 0.05, -3.0, 0.2, 8.0, -0.05};
    for (size_t n = 0; n < test_size(sizeof jumps / sizeof *jumps, 4); ++n) {
        ov_refiner fresh = {.context = *state};
        p.x[n % p.s.count * P + OV_FACTOR_CENTRE + n % 3] += jumps[n];
        if (n == 3 && !test_small()) {
            test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, 1, &misfit));
            test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, 0, &misfit));
        }
        test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.s.count, &misfit));
        test_check(*state, ov_refine_evaluate(&fresh, &p.s.target, p.x, p.s.count, &anew));
        expect_covered(&refiner, &p.s, p.x);
        expect_near(misfit, anew, 1e-3 * anew + 1e-5, "the misfit");
        ov_refiner_destroy(&fresh);
    }
    assert_true(refiner.list_builds < refiner.evaluations);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

static void no_steps_change_nothing(void **state) {
    test_skip_simulated(*state);
    problem p;
    record r;
    ov_refiner refiner = {.context = *state};
    double misfit;
    problem_create(&p, *state, 3, 0.2, 8);
    double *const x = test_alloc(1, p.size);
    memcpy(x, p.x, p.size);
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, p.s.count, &misfit));
    assert_true(run(&refiner, &p, options_of(0), &r) == misfit);
    assert_int_equal(r.count, 0);
    assert_int_equal(refiner.solver.iterations, 0);
    assert_memory_equal(p.x, x, p.size);
    free(x);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

/* Few gains in a row end it early, and so does a model that fits already. */
static void little_gain_ends_it(void **state) {
    test_skip_simulated(*state);
    problem p;
    record r;
    ov_refiner refiner = {.context = *state};
    ov_refine_options options = options_of((uint32_t)test_size(60, 12));
    options.decrease = 0.99;
    problem_create(&p, *state, test_size(6, 2), 0.4, 9);
    run(&refiner, &p, options, &r);
    assert_true(r.count < options.steps);
    free_record(&r);
    problem_destroy(&p);
    problem_create(&p, *state, 2, 0.0, 10); /* exact but for rounding */
    const double misfit = run(&refiner, &p, options_of((uint32_t)test_size(60, 1)), &r);
    print_message("misfit %g after %u steps\n", misfit, r.count);
    assert_true(misfit < 1e-5 && r.count < test_size(60, 2));
    free_record(&r);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

static void cancelling_keeps_what_is_accepted(void **state) {
    test_skip_simulated(*state);
    problem p;
    ov_refiner refiner = {.context = *state};
    ov_refine_options options = options_of(10);
    double misfit;
    problem_create(&p, *state, 3, 0.3, 11);
    record r = {.p = &p, .refiner = &refiner, .stop_at = 2};
    options.go_on = keep;
    options.user = &r;
    test_refused(*state, ov_refine(&refiner, &p.s.target, &options, p.x, p.s.count, &misfit),
                 OVOID_ERROR_CANCELLED, "stopped while refining");
    assert_int_equal(r.count, 2);
    assert_memory_equal(p.x, r.x[1], p.size);
    assert_true(misfit == r.misfit[1]);
    free_record(&r);
    run(&refiner, &p, options_of(2), &r); /* the refiner is fit for more */
    assert_true(r.misfit[1] <= misfit);
    free_record(&r);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

/* Fresh or used, on a problem of the same or another size. */
static void runs_repeat(void **state) {
    test_skip_simulated(*state);
    problem p, other;
    record r;
    ov_refiner used = {.context = *state}, fresh = {.context = *state};
    const uint32_t steps = (uint32_t)test_size(12, 2);
    problem_create(&p, *state, test_size(10, 3), 0.3, 12);
    problem_create(&other, *state, 5, 0.2, 13);
    double *const start = test_alloc(1, p.size), *const first = test_alloc(1, p.size);
    memcpy(start, p.x, p.size);
    const double misfit = run(&fresh, &p, options_of(steps), &r);
    free_record(&r);
    memcpy(first, p.x, p.size);
    run(&used, &other, options_of(2), &r);
    free_record(&r);
    memcpy(p.x, start, p.size);
    assert_true(run(&used, &p, options_of(steps), &r) == misfit);
    free_record(&r);
    assert_memory_equal(p.x, first, p.size);
    free(start);
    free(first);
    ov_refiner_destroy(&used);
    ov_refiner_destroy(&fresh);
    problem_destroy(&p);
    problem_destroy(&other);
}

/* No axis becomes longer than asked for, and no ellipsoid jumps. */
static void steps_are_bounded(void **state) {
    test_skip_simulated(*state);
    problem p;
    record r;
    ov_refiner refiner = {.context = *state};
    static const int diagonal[3] = {OV_FACTOR_L, OV_FACTOR_L + 3, OV_FACTOR_L + 5};
    ov_refine_options options = options_of((uint32_t)test_size(12, 2));
    options.width_max = 1.5; /* tighter than the mixture */
    problem_create(&p, *state, test_size(6, 2), 0.6, 14);
    for (size_t i = 0; i < p.s.count; ++i)
        for (int k = 0; k < 3; ++k)
            p.x[i * P + diagonal[k]] = fmax(p.x[i * P + diagonal[k]], 0.7);
    double *const x = test_alloc(1, p.size);
    memcpy(x, p.x, p.size);
    run(&refiner, &p, options, &r);
    bool moved = false;
    size_t bounded = 0;
    for (uint32_t n = 0; n < r.count; ++n) {
        const double *const from = n > 0 ? r.x[n - 1] : x;
        moved = moved || memcmp(from, r.x[n], p.size) != 0;
        for (size_t i = 0; i < p.s.count; ++i) {
            const double *const a = from + i * P, *const b = r.x[n] + i * P;
            const double motion =
                sqrt((b[1] - a[1]) * (b[1] - a[1]) + (b[2] - a[2]) * (b[2] - a[2]) +
                     (b[3] - a[3]) * (b[3] - a[3]));
            assert_true(motion <= 1.0 + 1e-9 && fabs(b[0] - a[0]) <= 1.0 + 1e-9);
            const double longest = 1.0 / sqrt(ov_factor_least_decay(b));
            const double before = 1.0 / sqrt(ov_factor_least_decay(a));
            assert_true(longest <= fmax(options.width_max, before) * (1.0 + 1e-9));
            bounded += longest > options.width_max * (1.0 - 1e-9);
        }
    }
    assert_true(moved && (bounded > 0 || test_small()));
    free(x);
    free_record(&r);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

static void a_broken_model_is_refused(void **state) {
    test_skip_simulated(*state);
    problem p;
    ov_refiner refiner = {.context = *state};
    const ov_refine_options options = options_of(3);
    double misfit, anew;
    problem_create(&p, *state, 3, 0.1, 15);
    const double kept = p.x[P + OV_FACTOR_L];
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, 3, &anew));
    p.x[P + OV_FACTOR_L] = NAN;
    test_refused(*state, ov_refine(&refiner, &p.s.target, &options, p.x, 3, &misfit),
                 OVOID_ERROR_NUMERIC, "ellipsoid 2");
    p.x[P + OV_FACTOR_L] = kept;
    test_check(*state, ov_refine_evaluate(&refiner, &p.s.target, p.x, 3, &misfit));
    assert_true(misfit == anew);
    ov_refiner_destroy(&refiner);
    problem_destroy(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(evaluation_equals_twin),
        cmocka_unit_test(a_mixture_is_found_again),
        cmocka_unit_test(images_follow),
        cmocka_unit_test(the_misfit_never_rises),
        cmocka_unit_test(lists_with_skins_say_the_same),
        cmocka_unit_test(lists_follow_jumps),
        cmocka_unit_test(no_steps_change_nothing),
        cmocka_unit_test(little_gain_ends_it),
        cmocka_unit_test(cancelling_keeps_what_is_accepted),
        cmocka_unit_test(runs_repeat),
        cmocka_unit_test(steps_are_bounded),
        cmocka_unit_test(a_broken_model_is_refused),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
