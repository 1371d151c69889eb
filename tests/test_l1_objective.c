/*
 * The paper's objective on the device: its lists follow moving ellipsoids, its gradient is that of
 * w_s E_s + w_l E_l1.
 */
#include "fit/l1/objective.h"
#include "support.h"

#define PI 3.14159265358979323846
#define CUTOFF 1e-5 /* of the objective */

enum { SIZE = OV_L1_PARAMETERS };

/* Constrained points anywhere, with targets. Destroy with ov_samples_destroy(). */
static double *make_samples(ovoid_context *context, test_random *random, size_t count,
                            const double half[3], double target, ov_samples *samples,
                            double **targets) {
    const double origin[3] = {0};
    float *const xyz = random_points(random, count, 1.0);
    double *const packed = test_alloc(3 * count, sizeof *packed);
    memset(samples, 0, sizeof *samples);
    for (size_t k = 0; k < 3 * count; ++k)
        xyz[k] *= (float)half[k % 3];
    double *const wide = widen_points(xyz, count);
    test_check(context, ov_points_create(context, wide, count, origin, 0.5, &samples->points));
    assert_int_equal(samples->points.packs, (count + OV_PACK - 1) / OV_PACK);
    free(wide);
    for (size_t k = 0; k < 3 * count; ++k)
        packed[k] = xyz[3 * (size_t)samples->points.order[k / 3] + k % 3];
    const size_t all = samples->points.packs * OV_PACK;
    float *const values = test_alloc(all, sizeof *values);
    *targets = test_alloc(count, sizeof **targets);
    for (size_t k = 0; k < count; ++k)
        (*targets)[k] = values[k] = (float)random_uniform(random, 0.0, target);
    write_floats(context, &samples->value, values, all);
    free(values);
    free(xyz);
    return packed;
}

/* ---- lists that could not be built --------------------------------------------------------- */

/* The linker hands ov_lists_build() to this (tests/CMakeLists.txt). */
static enum { BUILD, REFUSE, REFUSE_AFTERWARDS } lists_are;
ovoid_status __real_ov_lists_build(ovoid_context *, ov_lists *, const ov_points *, const ov_terms *,
                                   double);
ovoid_status __wrap_ov_lists_build(ovoid_context *, ov_lists *, const ov_points *, const ov_terms *,
                                   double);
ovoid_status __wrap_ov_lists_build(ovoid_context *context, ov_lists *lists, const ov_points *points,
                                   const ov_terms *terms, double skin) {
    ovoid_status status = OVOID_OK;
    if (lists_are != REFUSE)
        status = __real_ov_lists_build(context, lists, points, terms, skin);
    return lists_are == BUILD ? status : ov_fail(context, OVOID_ERROR_MEMORY, "no room for lists");
}

/* After a failure the lists are those of neither the parameters before it nor the new ones. */
static void lists_are_made_after_a_failure(void **state) {
    const size_t terms = 3, count = 150;
    const double half[3] = {7.9, 7.9, 7.9};
    test_random random = {77};
    ov_samples samples;
    ov_l1_objective objective;
    ov_l1_evaluation here, there, result;
    double *targets;
    double *const xyz = make_samples(*state, &random, count, half, 1.0, &samples, &targets);
    double x[3 * SIZE] = {0}, moved[3 * SIZE];
    for (size_t i = 0; i < terms; ++i) {
        x[i * SIZE + OV_L1_C] = 1.5;
        for (int k = 0; k < 3; ++k) {
            x[i * SIZE + OV_L1_D + k] = 0.6;
            x[i * SIZE + OV_L1_CENTRE + k] = i == (size_t)k ? 5.0 : -3.0;
        }
    }
    for (size_t j = 0; j < terms * SIZE; ++j)
        moved[j] = j % SIZE >= OV_L1_CENTRE && j % SIZE < OV_L1_CENTRE + 3 ? -x[j] : x[j];
    test_check(*state, ov_l1_objective_create(*state, &samples, INFINITY, OVOID_KERNEL_ELLIPSOID,
                                              terms, &objective));
    test_check(*state, ov_l1_evaluate(&objective, moved, terms, &there));
    test_check(*state, ov_l1_evaluate(&objective, x, terms, &here));
    for (int n = 0; n < 4; ++n) {
        const bool back = n % 2;
        lists_are = n < 2 ? REFUSE : REFUSE_AFTERWARDS;
        test_refused(*state, ov_l1_evaluate(&objective, moved, terms, &result), OVOID_ERROR_MEMORY,
                     "no room for lists");
        lists_are = BUILD;
        test_check(*state, ov_l1_evaluate(&objective, back ? x : moved, terms, &result));
        assert_true(result.accuracy == (back ? here : there).accuracy);
        test_check(*state, ov_l1_evaluate(&objective, x, terms, &result));
        assert_true(result.accuracy == here.accuracy);
    }
    ov_l1_objective_destroy(&objective);
    ov_samples_destroy(&samples);
    free(targets);
    free(xyz);
}

/* ---- lists -------------------------------------------------------------------------------- */

typedef enum motion { DRIFT, GROWTH, TURN, ALL, JUMP, MOTIONS } motion;

static const char *const motion_names[MOTIONS] = {"drift", "growth", "turn", "all", "jumps"};

static void move(test_random *random, motion how, double *x, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        double *const p = x + i * SIZE;
        for (int k = 0; k < 3; ++k) {
            const double way = random_uniform(random, -1.0, 1.0);
            if (how == DRIFT || how == ALL)
                p[OV_L1_CENTRE + k] += i % 2 ? 0.03 : 0.03 * way;
            if (how == JUMP)
                p[OV_L1_CENTRE + k] += 4.0 * way;
            if ((how == GROWTH || how == ALL) && fabs(p[OV_L1_D + k]) > 0.15)
                p[OV_L1_D + k] *= 0.985;
            if (how == TURN || how == ALL)
                p[OV_L1_ANGLE + k] += 0.01;
        }
        if (how == GROWTH || how == ALL)
            p[OV_L1_C] *= 1.01;
    }
}

/* However the ellipsoids move, at every point nothing is missing but what lies below the cut-off.
 */
static void lists_follow_moving_ellipsoids(void **state) {
    const size_t terms = test_size(12, 4), count = test_size(2500, 150), steps = test_size(80, 10);
    const double side = test_size(140, 79) / 10.0; /* so that no pack ends early */
    const double half[3] = {side, side, side};
    for (size_t how = DRIFT; how < MOTIONS; how = test_next(*state, how, ALL)) {
        test_random random = {10 + how};
        ov_samples samples;
        ov_l1_objective objective;
        ov_l1_evaluation result;
        double *targets;
        double *const xyz = make_samples(*state, &random, count, half, 1.0, &samples, &targets);
        double *const x = test_alloc(terms * SIZE, sizeof *x);
        ov_quadric *const quadrics = test_alloc(terms, sizeof *quadrics);
        const double limit = how % 2 ? 0.6 : INFINITY; /* of targets up to 1 */
        test_check(*state, ov_l1_objective_create(*state, &samples, limit, OVOID_KERNEL_ELLIPSOID,
                                                  terms, &objective));
        for (size_t i = 0; i < terms; ++i) {
            double *const p = x + i * SIZE;
            p[OV_L1_C] = random_uniform(&random, 1.0, 2.0);
            for (int k = 0; k < 3; ++k) {
                p[OV_L1_D + k] = i % 3 == (size_t)k ? 0.35 : 1.2; /* needles */
                p[OV_L1_CENTRE + k] = random_uniform(&random, -8.0, 8.0);
                p[OV_L1_ANGLE + k] = random_uniform(&random, -PI, PI);
            }
        }
        double most = 0.0;
        for (size_t step = 0; step < steps; ++step) {
            move(&random, (motion)how, x, terms);
            test_check(*state, ov_l1_evaluate(&objective, x, terms, &result));
            float *const value = read_floats(*state, &objective.value, count);
            double accuracy = 0.0, largest = 0.0;
            for (size_t i = 0; i < terms; ++i)
                ov_l1_quadric(x + i * SIZE, &quadrics[i]);
            for (size_t k = 0; k < count; ++k) {
                double below = 0.0;
                const ov_twin_sum wanted = ov_twin_field(quadrics, terms, xyz + 3 * k);
                const double rounding = 8.0 * FLT_EPSILON * wanted.scale + 1e-9;
                for (size_t i = 0; i < terms; ++i) {
                    const double e =
                        quadrics[i].amplitude * exp(-ov_twin_exponent(&quadrics[i], xyz + 3 * k));
                    below += e < CUTOFF * 1.001 ? e : 0.0;
                }
                if (value[k] < wanted.value - below - rounding)
                    fail_msg("%s, step %zu: %.8g at a point instead of %.8g", motion_names[how],
                             step, value[k], wanted.value);
                assert_true(value[k] <= wanted.value + rounding);
                most = fmax(most, wanted.value - value[k]);
                const double error = ov_twin_residual(value[k], targets[k], limit);
                accuracy += error * error;
                largest = fmax(largest, fabs(error));
            }
            expect_near(result.accuracy, accuracy, 1e-5 * accuracy, "E_s");
            expect_near(result.max_error, largest, 1e-6 * (1.0 + largest), "the largest error");
            free(value);
        }
        print_message("%s: %zu list builds in %zu steps, at most %.2g missing\n", motion_names[how],
                      (size_t)objective.profile.list_builds, steps, most);
        assert_true(objective.profile.list_builds > (test_small() ? 0 : 1));
        assert_true(how == JUMP || objective.profile.list_builds < 3 * steps / 4);
        ov_l1_objective_destroy(&objective);
        ov_l1_objective_destroy(&objective);
        ov_samples_destroy(&samples);
        free(targets);
        free(quadrics);
        free(xyz);
        free(x);
    }
}

/* Fewer ellipsoids, as after pruning: the lists are those of the ones that are left. */
static void lists_follow_pruning(void **state) {
    const double half[3] = {4.0, 4.0, 4.0};
    test_random random = {20};
    enum { TERMS = 5, COUNT = 200 };
    ov_samples samples;
    ov_l1_objective objective;
    ov_l1_evaluation result;
    double *targets, x[TERMS * SIZE];
    double *const xyz = make_samples(*state, &random, COUNT, half, 1.0, &samples, &targets);
    test_check(*state, ov_l1_objective_create(*state, &samples, INFINITY, OVOID_KERNEL_ELLIPSOID,
                                              TERMS, &objective));
    for (size_t i = 0; i < TERMS * SIZE; ++i)
        x[i] = random_uniform(&random, 0.5, 1.5);
    for (size_t count = TERMS; count > 0; --count) {
        test_check(*state, ov_l1_evaluate(&objective, x, count, &result));
        const double wanted = ov_twin_accuracy(x, count, xyz, targets, COUNT, INFINITY);
        expect_near(result.accuracy, wanted, 1e-4 * wanted, "E_s");
        if (count % 2 == 0) /* the first one goes, else the last */
            memmove(x, x + SIZE, (count - 1) * SIZE * sizeof *x);
    }
    ov_l1_objective_destroy(&objective);
    ov_samples_destroy(&samples);
    free(targets);
    free(xyz);
}

/* ---- gradient ----------------------------------------------------------------------------- */

static double objective_of(const double *x, size_t terms, const double *xyz, const double *targets,
                           size_t count, double limit, ov_l1_weights w) {
    return w.accuracy * ov_twin_accuracy(x, terms, xyz, targets, count, limit) +
           w.sparse * ov_twin_sparsity(x, terms);
}

typedef enum shape { RANDOM, NEEDLE, PANCAKE, SPHERE, GIMBAL, NEGATIVE, SHAPES } shape;

static void shape_parameters(test_random *random, shape kind, double *x, size_t terms) {
    for (size_t i = 0; i < terms; ++i) {
        double *const p = x + i * SIZE;
        p[OV_L1_C] = random_uniform(random, 0.5, 2.0);
        for (int k = 0; k < 3; ++k) {
            p[OV_L1_D + k] = random_uniform(random, 0.3, 1.2);
            p[OV_L1_CENTRE + k] = random_uniform(random, -1.5, 1.5);
            p[OV_L1_ANGLE + k] = random_uniform(random, -PI, PI);
            if (kind == NEEDLE)
                p[OV_L1_D + k] = k == 0 ? 0.02 : 1.5;
            if (kind == PANCAKE)
                p[OV_L1_D + k] = k == 0 ? 1.5 : 0.02;
            if (kind == SPHERE)
                p[OV_L1_D + k] = p[OV_L1_D];
        }
        if (kind == GIMBAL)
            p[OV_L1_ANGLE + 1] = 0.5 * PI;
        if (kind == NEGATIVE) {
            p[OV_L1_C] = -p[OV_L1_C];
            p[OV_L1_D + 1] = -p[OV_L1_D + 1];
        }
    }
}

/* Where a limit holds the inside, some targets above it are met and ask for nothing, others pull.
 */
static void expect_held(const ov_l1_objective *objective, const double *targets, size_t count,
                        double limit) {
    size_t met = 0, pulling = 0;
    float *const u = read_floats(objective->context, &objective->residual, count);
    for (size_t k = 0; k < count; ++k)
        if (targets[k] > limit) {
            assert_true(u[k] <= 0.0f);
            met += u[k] == 0.0f;
            pulling += u[k] < 0.0f;
        }
    free(u);
    if (isfinite(limit) && !test_small())
        assert_true(met > 0 && pulling > 0);
}

/* The whole objective, E_l1 with its signs, by every one of the ten parameters, against central
 * differences in double. Single precision and the cut-off leave 1e-4 of the largest component. */
static void gradient_equals_central_differences(void **state) {
    const double half[3] = {3.0, 3.0, 3.0};
    const ov_l1_weights weights[] = {{0.05, 0.95}, {1.0, 0.0}, {0.0, 1.0}};
    const double limits[] = {1.2, INFINITY, 1.2};
    enum { TERMS = 3 };
    const size_t count = test_size(400, 40);
    for (size_t kind = RANDOM; kind < SHAPES; kind = test_next(*state, kind, NEGATIVE))
        for (size_t n = 0; n < test_size(3, 1); ++n) {
            test_random random = {30 + kind};
            const ov_l1_weights w = weights[n];
            const double limit = limits[n]; /* of targets up to 2 */
            ov_samples samples;
            ov_l1_objective objective;
            ov_l1_evaluation result;
            double *targets, x[TERMS * SIZE], gradient[TERMS * SIZE], slope[TERMS * SIZE];
            double *const xyz = make_samples(*state, &random, count, half, 2.0, &samples, &targets);
            double largest = 0.0;
            shape_parameters(&random, (shape)kind, x, TERMS);
            test_check(*state, ov_l1_objective_create(*state, &samples, limit,
                                                      OVOID_KERNEL_ELLIPSOID, TERMS, &objective));
            test_check(*state, ov_l1_evaluate(&objective, x, TERMS, &result));
            expect_held(&objective, targets, count, limit);
            test_check(*state, ov_l1_gradient(&objective, x, TERMS, w, gradient));
            for (size_t j = 0; j < TERMS * SIZE; ++j) {
                const double h = 1e-4, middle = x[j];
                x[j] = middle + h;
                const double up = objective_of(x, TERMS, xyz, targets, count, limit, w);
                x[j] = middle - h;
                const double down = objective_of(x, TERMS, xyz, targets, count, limit, w);
                x[j] = middle;
                slope[j] = (up - down) / (2.0 * h);
                largest = fmax(largest, fabs(slope[j]));
            }
            for (size_t j = 0; j < TERMS * SIZE; ++j) {
                char what[64];
                snprintf(what, sizeof what, "shape %zu: component %zu of the gradient", kind, j);
                expect_near(gradient[j], slope[j], 1e-4 * largest, what);
            }
            expect_near(ov_l1_sparse_term(&objective, x, TERMS), ov_twin_sparsity(x, TERMS), 1e-12,
                        "E_l1");
            ov_l1_objective_destroy(&objective);
            ov_samples_destroy(&samples);
            free(targets);
            free(xyz);
        }
}

/* |t|' is 0 at 0: an ellipsoid whose amplitude has vanished stays as it is. */
static void gradient_at_zero(void **state) {
    const double half[3] = {2.0, 2.0, 2.0};
    const ov_l1_weights w = {0.5, 0.5};
    test_random random = {40};
    ov_samples samples;
    ov_l1_objective objective;
    ov_l1_evaluation result;
    double *targets, x[2 * SIZE], gradient[2 * SIZE];
    double *const xyz = make_samples(*state, &random, 50, half, 2.0, &samples, &targets);
    shape_parameters(&random, RANDOM, x, 2);
    x[OV_L1_C] = 0.0;
    x[SIZE + OV_L1_D] = 0.0;
    test_check(*state, ov_l1_objective_create(*state, &samples, INFINITY, OVOID_KERNEL_ELLIPSOID, 2,
                                              &objective));
    test_check(*state, ov_l1_evaluate(&objective, x, 2, &result));
    test_check(*state, ov_l1_gradient(&objective, x, 2, w, gradient));
    assert_true(gradient[OV_L1_C] == 0.0);
    assert_true(gradient[SIZE + OV_L1_D] == 0.0);
    for (int k = 0; k < 3; ++k) {
        assert_true(gradient[OV_L1_D + k] == 0.5); /* of the L1 term alone */
        assert_true(gradient[OV_L1_CENTRE + k] == 0.0 && gradient[OV_L1_ANGLE + k] == 0.0);
    }
    for (int j = 0; j < 2 * SIZE; ++j)
        assert_true(isfinite(gradient[j]));
    ov_l1_objective_destroy(&objective);
    ov_samples_destroy(&samples);
    free(targets);
    free(xyz);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lists_follow_moving_ellipsoids),
        cmocka_unit_test(lists_follow_pruning),
        cmocka_unit_test(lists_are_made_after_a_failure),
        cmocka_unit_test(gradient_equals_central_differences),
        cmocka_unit_test(gradient_at_zero),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
