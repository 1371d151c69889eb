/*
 * The chain rule from moments to the ten parameters of the paper's model, held to central
 * differences of the paper's own formula in double.
 */
#include "model/chain.h"
#include "support.h"

#define PI 3.14159265358979323846

enum { POINTS = 60, ELLIPSOIDS = 3, SIZE = ELLIPSOIDS * OV_L1_PARAMETERS };

/* A small problem: ellipsoids, points, targets. */
typedef struct problem {
    double x[SIZE];
    double xyz[3 * POINTS];
    double target[POINTS];
} problem;

static void random_problem(test_random *random, problem *p) {
    for (int i = 0; i < ELLIPSOIDS; ++i) {
        double *const x = p->x + i * OV_L1_PARAMETERS;
        x[OV_L1_C] = random_uniform(random, 0.5, 2.0);
        for (int k = 0; k < 3; ++k) {
            x[OV_L1_D + k] = random_uniform(random, 0.3, 1.2);
            x[OV_L1_CENTRE + k] = random_uniform(random, -1.0, 1.0);
            x[OV_L1_ANGLE + k] = random_uniform(random, -PI, PI);
        }
    }
    for (int k = 0; k < 3 * POINTS; ++k)
        p->xyz[k] = random_uniform(random, -2.0, 2.0);
    for (int k = 0; k < POINTS; ++k)
        p->target[k] = random_uniform(random, 0.0, 2.0);
}

/* Gradient of E_s by way of the moments and ov_l1_chain(), as the fit does. */
static void chained(const problem *p, double gradient[SIZE]) {
    ov_quadric quadrics[ELLIPSOIDS];
    double u[POINTS];
    for (int i = 0; i < ELLIPSOIDS; ++i)
        ov_l1_quadric(p->x + i * OV_L1_PARAMETERS, &quadrics[i]);
    for (int k = 0; k < POINTS; ++k)
        u[k] = 2.0 * (ov_twin_field(quadrics, ELLIPSOIDS, p->xyz + 3 * k).value - p->target[k]);
    for (int i = 0; i < ELLIPSOIDS; ++i) {
        ov_twin_sum sums[OV_MONOMIALS];
        double moments[OV_MONOMIALS];
        ov_twin_moments(&quadrics[i], p->xyz, u, POINTS, sums);
        for (int m = 0; m < OV_MONOMIALS; ++m)
            moments[m] = sums[m].value;
        ov_l1_chain(p->x + i * OV_L1_PARAMETERS, moments, gradient + i * OV_L1_PARAMETERS);
    }
}

static double accuracy(const problem *p) {
    return ov_twin_accuracy(p->x, ELLIPSOIDS, p->xyz, p->target, POINTS, INFINITY);
}

/* Central difference of E_s with respect to one parameter, extrapolated to fourth order. */
static double difference(const problem *p, int j) {
    const double h = 1e-3;
    double slope[2];
    for (int n = 0; n < 2; ++n) {
        const double step = n ? 2.0 * h : h;
        problem up = *p, down = *p;
        up.x[j] += step;
        down.x[j] -= step;
        slope[n] = (accuracy(&up) - accuracy(&down)) / (up.x[j] - down.x[j]);
    }
    return (4.0 * slope[0] - slope[1]) / 3.0;
}

/* The error of the differences is about 1e-9 of the largest component. */
static void expect_gradient(const problem *p) {
    double gradient[SIZE], slope[SIZE], largest = 0.0;
    chained(p, gradient);
    for (int j = 0; j < SIZE; ++j) {
        slope[j] = difference(p, j);
        largest = fmax(largest, fabs(slope[j]));
    }
    assert_true(largest > 1e-3);
    for (int j = 0; j < SIZE; ++j) {
        char what[64];
        snprintf(what, sizeof what, "component %d of the gradient", j);
        expect_near(gradient[j], slope[j], 2e-7 * largest, what);
    }
}

static void random_models(void **state) {
    (void)state;
    test_random random = {1};
    for (int n = 0; n < 50; ++n) {
        problem p;
        random_problem(&random, &p);
        expect_gradient(&p);
    }
}

static void needles_and_pancakes(void **state) {
    (void)state;
    test_random random = {2};
    for (int n = 0; n < 50; ++n) {
        problem p;
        random_problem(&random, &p);
        for (int i = 0; i < ELLIPSOIDS; ++i)
            for (int k = 0; k < 3; ++k) {
                const bool is_long = n % 2 ? k == n % 3 : k != n % 3;
                p.x[i * OV_L1_PARAMETERS + OV_L1_D + k] = is_long ? 0.015 : 1.5;
            }
        expect_gradient(&p);
    }
}

static void equal_decays(void **state) {
    (void)state;
    test_random random = {3};
    for (int n = 0; n < 50; ++n) {
        problem p;
        double gradient[SIZE];
        random_problem(&random, &p);
        for (int i = 0; i < ELLIPSOIDS; ++i) {
            double *const x = p.x + i * OV_L1_PARAMETERS;
            x[OV_L1_D + 1] = x[OV_L1_D + 2] = x[OV_L1_D];
            if (n % 2)
                x[OV_L1_ANGLE] = x[OV_L1_ANGLE + 1] = x[OV_L1_ANGLE + 2] = 0.0;
        }
        expect_gradient(&p);
        chained(&p, gradient);
        for (int i = 0; i < ELLIPSOIDS; ++i)
            for (int k = 0; k < 3; ++k) {
                const double turn = gradient[i * OV_L1_PARAMETERS + OV_L1_ANGLE + k];
                if (n % 2) /* the start of every fit */
                    assert_true(turn == 0.0);
                expect_near(turn, 0.0, 1e-11, "the derivative by an angle of a sphere");
            }
    }
}

static void gimbal_lock(void **state) {
    (void)state;
    test_random random = {4};
    for (int n = 0; n < 50; ++n) {
        problem p;
        random_problem(&random, &p);
        for (int i = 0; i < ELLIPSOIDS; ++i)
            p.x[i * OV_L1_PARAMETERS + OV_L1_ANGLE + 1] = n % 2 ? 0.5 * PI : -0.5 * PI;
        expect_gradient(&p);
    }
}

static void negative_roots(void **state) {
    (void)state;
    test_random random = {5};
    for (int n = 0; n < 50; ++n) {
        problem p;
        random_problem(&random, &p);
        for (int i = 0; i < ELLIPSOIDS; ++i) {
            double *const x = p.x + i * OV_L1_PARAMETERS;
            x[OV_L1_C] = -x[OV_L1_C];
            x[OV_L1_D + n % 3] = -x[OV_L1_D + n % 3];
        }
        expect_gradient(&p);
    }
}

/* An ellipsoid of amplitude 0 moves nothing, and no component of its gradient is NaN. */
static void vanished_amplitude(void **state) {
    (void)state;
    test_random random = {6};
    problem p;
    double gradient[SIZE];
    random_problem(&random, &p);
    p.x[OV_L1_C] = 0.0;
    expect_gradient(&p);
    chained(&p, gradient);
    assert_true(gradient[OV_L1_C] == 0.0);
    for (int j = 0; j < SIZE; ++j)
        assert_true(isfinite(gradient[j]));
}

static void vanished_decay(void **state) {
    (void)state;
    test_random random = {7};
    problem p;
    double gradient[SIZE];
    random_problem(&random, &p);
    p.x[OV_L1_D + 1] = 0.0;
    expect_gradient(&p);
    chained(&p, gradient);
    assert_true(gradient[OV_L1_D + 1] == 0.0);
}

static void ellipsoid_holds_the_squares(void **state) {
    (void)state;
    const double x[OV_L1_PARAMETERS] = {-3.0, 0.5, -2.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
    const ovoid_ellipsoid wanted = {.amplitude = 9.0,
                                    .decay = {0.25, 4.0, OV_L1_DECAY_MIN},
                                    .centre = {1.0, 2.0, 3.0},
                                    .angle = {4.0, 5.0, 6.0}};
    ovoid_ellipsoid ellipsoid;
    ov_l1_ellipsoid(x, &ellipsoid);
    assert_memory_equal(&ellipsoid, &wanted, sizeof wanted);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_models),  cmocka_unit_test(needles_and_pancakes),
        cmocka_unit_test(equal_decays),   cmocka_unit_test(gimbal_lock),
        cmocka_unit_test(negative_roots), cmocka_unit_test(vanished_amplitude),
        cmocka_unit_test(vanished_decay), cmocka_unit_test(ellipsoid_holds_the_squares),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
