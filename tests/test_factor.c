/*
 * The adaptive method's parameters and what they are made from and become: quadratic forms and the
 * paper's ellipsoids; and the bound on how far a cut-off ellipsoid moves.
 */
#include "model/ellipsoid.h"
#include "model/factor.h"
#include "support.h"

#define PI 3.14159265358979323846

enum { TRIALS = 200 };

static double largest_of(const double a[6]) {
    return fmax(a[0], fmax(a[3], a[5]));
}

static void expect_quadric(const ov_quadric *got, const ov_quadric *wanted, double tolerance) {
    const double scale = largest_of(wanted->a);
    expect_near(got->amplitude, wanted->amplitude,
                1e-14 * (1.0 + fabs(log(wanted->amplitude))) * wanted->amplitude, "an amplitude");
    for (int k = 0; k < 3; ++k)
        assert_true(got->centre[k] == wanted->centre[k]);
    for (int k = 0; k < 6; ++k)
        expect_near(got->a[k], wanted->a[k], tolerance * scale, "an entry of A");
}

/* ---- A = L L^T ---------------------------------------------------------------------------- */

static void quadrics_survive_factors(void **state) {
    (void)state;
    test_random random = {1};
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        ovoid_ellipsoid ellipsoids[TRIALS];
        random_ellipsoids(&random, (model_kind)kind, 4.0, ellipsoids, TRIALS);
        for (int n = 0; n < TRIALS; ++n) {
            ov_quadric quadric, again;
            double x[OV_FACTOR_PARAMETERS];
            ov_quadric_of_ellipsoid(&ellipsoids[n], &quadric);
            ov_factor_of_quadric(&quadric, x);
            expect_near(x[OV_FACTOR_AMPLITUDE], log(quadric.amplitude), 1e-14 * 40.0, "ln a");
            ov_factor_quadric(x, &again);
            expect_quadric(&again, &quadric, 1e-14);
        }
    }
}

/* Whatever L's signs: A is the product, written with whole matrices. */
static void quadric_is_the_product(void **state) {
    (void)state;
    test_random random = {2};
    for (int n = 0; n < TRIALS; ++n) {
        double x[OV_FACTOR_PARAMETERS];
        for (int k = 0; k < OV_FACTOR_PARAMETERS; ++k)
            x[k] = random_uniform(&random, -2.0, 2.0);
        const double *const p = x + OV_FACTOR_L;
        const double l[3][3] = {{p[0], 0.0, 0.0}, {p[1], p[3], 0.0}, {p[2], p[4], p[5]}};
        ov_quadric wanted = {.amplitude = exp(x[0]), .centre = {x[1], x[2], x[3]}}, got;
        for (int i = 0, k = 0; i < 3; ++i)
            for (int j = i; j < 3; ++j, ++k)
                for (int m = 0; m < 3; ++m)
                    wanted.a[k] += l[i][m] * l[j][m];
        ov_factor_quadric(x, &got);
        expect_quadric(&got, &wanted, 1e-15);
    }
}

/* A form that rounding has left singular still gets an L that is not. */
static void factors_of_flat_forms(void **state) {
    (void)state;
    const ov_quadric flat[] = {
        {.amplitude = 1.0, .a = {1.0, 1.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1.0, .a = {1.0, 1.0, 1.0, 1.0 + 1e-15, 1.0, 1.0 - 1e-16}},
        {.amplitude = 1.0, .a = {1.0, 0.0, 1.0, 1.0, 0.0, 1.0}},
    };
    for (size_t n = 0; n < sizeof flat / sizeof *flat; ++n) {
        double x[OV_FACTOR_PARAMETERS];
        ov_factor_of_quadric(&flat[n], x);
        for (int k = 0; k < OV_FACTOR_PARAMETERS; ++k)
            assert_true(isfinite(x[k]));
        const double *const l = x + OV_FACTOR_L;
        assert_true(l[0] > 0.0 && l[3] > 0.0 && l[5] > 0.0);
    }
}

/* ---- the paper's parameters --------------------------------------------------------------- */

/* The quadric's ellipsoid has these decay rates, angles in their ranges, and is the same form. */
static void expect_ellipsoid(const ovoid_ellipsoid *made_of, double tolerance) {
    ov_quadric quadric, again;
    ovoid_ellipsoid got;
    double decay[3];
    memcpy(decay, made_of->decay, sizeof decay);
    for (int k = 0; k < 2; ++k)
        for (int j = 0; j < 2; ++j)
            if (decay[j] < decay[j + 1]) {
                const double swap = decay[j];
                decay[j] = decay[j + 1];
                decay[j + 1] = swap;
            }
    ov_quadric_of_ellipsoid(made_of, &quadric);
    ov_ellipsoid_of_quadric(&quadric, &got);
    for (int k = 0; k < 3; ++k)
        expect_near(got.decay[k], decay[k], tolerance * decay[0], "a decay rate");
    assert_true(got.decay[0] >= got.decay[1] && got.decay[1] >= got.decay[2]);
    assert_true(fabs(got.angle[0]) <= PI && fabs(got.angle[1]) <= 0.5 * PI &&
                fabs(got.angle[2]) <= PI);
    ov_quadric_of_ellipsoid(&got, &again);
    expect_quadric(&again, &quadric, tolerance);
    /* the paper's own formula, with no form in between */
    for (int n = 0; n < 8; ++n) {
        const double r = 0.5 / sqrt(decay[0]);
        const double y[3] = {made_of->centre[0] + (n & 1 ? r : -r),
                             made_of->centre[1] + (n & 2 ? r : -r),
                             made_of->centre[2] + (n & 4 ? r : -r)};
        const double value = ov_twin_ellipsoid(made_of, y);
        expect_near(ov_twin_ellipsoid(&got, y), value, 10.0 * tolerance * value, "a value");
    }
}

static void ellipsoids_of_every_kind(void **state) {
    (void)state;
    test_random random = {3};
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        ovoid_ellipsoid ellipsoids[TRIALS];
        random_ellipsoids(&random, (model_kind)kind, 0.0, ellipsoids, TRIALS);
        for (int n = 0; n < TRIALS; ++n)
            expect_ellipsoid(&ellipsoids[n], 1e-14);
    }
}

static void nearly_gimbal_lock(void **state) {
    (void)state;
    test_random random = {4};
    for (int n = 0; n < TRIALS; ++n) {
        ovoid_ellipsoid ellipsoid;
        random_ellipsoids(&random, MODEL_RANDOM, 0.0, &ellipsoid, 1);
        ellipsoid.decay[0] = 4.0;
        ellipsoid.decay[1] = 1.0;
        ellipsoid.decay[2] = 0.1;
        ellipsoid.angle[1] = (n % 2 ? 0.5 : -0.5) * PI + (n % 4 < 2 ? 1 : -1) * pow(10.0, -n / 10);
        expect_ellipsoid(&ellipsoid, 1e-14);
    }
}

static void axes_along_the_coordinates(void **state) {
    (void)state;
    const double decays[][3] = {{3.0, 2.0, 1.0},  {1.0, 2.0, 3.0},  {2.0, 3.0, 1.0},
                                {1.0, 1.0, 2.0},  {2.0, 1.0, 1.0},  {1.0, 1.0, 1.0},
                                {1e8, 1.0, 1e-3}, {1e-6, 1.0, 1e-6}};
    for (size_t n = 0; n < sizeof decays / sizeof *decays; ++n)
        for (int turn = 0; turn < 64; ++turn) {
            ovoid_ellipsoid ellipsoid = {.amplitude = 2.0};
            memcpy(ellipsoid.decay, decays[n], sizeof ellipsoid.decay);
            for (int k = 0; k < 3; ++k)
                ellipsoid.angle[k] = 0.5 * PI * (turn >> 2 * k & 3);
            expect_ellipsoid(&ellipsoid, 1e-14);
        }
}

/* Axes that differ by as little as rounding, and by as much as a model file can hold. */
static void nearly_equal_and_very_unequal_axes(void **state) {
    (void)state;
    test_random random = {5};
    for (int n = 0; n < TRIALS; ++n) {
        ovoid_ellipsoid ellipsoid;
        random_ellipsoids(&random, MODEL_RANDOM, 0.0, &ellipsoid, 1);
        const double ratio = pow(10.0, -(n % 16));
        ellipsoid.decay[n % 3] = 1.0;
        ellipsoid.decay[(n + 1) % 3] = n % 2 ? 1.0 + ratio : ratio * ratio;
        ellipsoid.decay[(n + 2) % 3] = n % 2 ? 1.0 - 0.5 * ratio : 1.0;
        if (n % 2 || ratio > 1e-7)
            expect_ellipsoid(&ellipsoid, 1e-14);
    }
}

/* ---- motion ------------------------------------------------------------------------------- */

/* How far the hull reaches from the origin in direction n: centre . n + sqrt(q n^T A^-1 n), A^-1
 * by cofactors. */
static double reach_along(const ov_quadric *quadric, double cutoff, const double n[3]) {
    const double *const a = quadric->a;
    const double c[6] = {a[3] * a[5] - a[4] * a[4], a[2] * a[4] - a[1] * a[5],
                         a[1] * a[4] - a[2] * a[3], a[0] * a[5] - a[2] * a[2],
                         a[1] * a[2] - a[0] * a[4], a[0] * a[3] - a[1] * a[1]};
    const double determinant = a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
    const double square = c[0] * n[0] * n[0] + c[3] * n[1] * n[1] + c[5] * n[2] * n[2] +
                          2.0 * (c[1] * n[0] * n[1] + c[2] * n[0] * n[2] + c[4] * n[1] * n[2]);
    const double q = log(quadric->amplitude / cutoff);
    double sum = sqrt(q * square / determinant);
    for (int k = 0; k < 3; ++k)
        sum += quadric->centre[k] * n[k];
    return sum;
}

static void random_direction(test_random *random, double n[3]) {
    double length;
    do {
        length = 0.0;
        for (int k = 0; k < 3; ++k) {
            n[k] = random_uniform(random, -1.0, 1.0);
            length += n[k] * n[k];
        }
    } while (length > 1.0 || length < 0.01);
    for (int k = 0; k < 3; ++k)
        n[k] /= sqrt(length);
}

/* The largest outward motion of the hull over many directions; fails if it exceeds the bound. */
static double expect_bounded(test_random *random, const double *from, const double *to,
                             double cutoff) {
    ov_quadric before, after;
    double largest = 0.0;
    const double bound = ov_factor_motion(from, to, cutoff);
    ov_factor_quadric(from, &before);
    ov_factor_quadric(to, &after);
    for (int k = 0; k < 500; ++k) {
        double n[3];
        random_direction(random, n);
        const double growth = reach_along(&after, cutoff, n) - reach_along(&before, cutoff, n);
        largest = fmax(largest, growth);
    }
    if (!(largest <= bound * (1.0 + 1e-9) + 1e-9))
        fail_msg("a hull moves by %g, the bound is %g", largest, bound);
    return largest;
}

static void random_factor(test_random *random, double x[OV_FACTOR_PARAMETERS]) {
    ovoid_ellipsoid ellipsoid;
    ov_quadric quadric;
    random_ellipsoids(random, MODEL_RANDOM, 4.0, &ellipsoid, 1);
    ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
    ov_factor_of_quadric(&quadric, x);
}

/* Small steps as a fit takes them, large ones, and each kind of change by itself; and the bound is
 * of the size of the motion, or lists would be rebuilt for nothing. */
/* Decay rates below the bound are raised to it along their own axes, the others stay, and where
 * none is below not a bit changes. */
static void least_decay_is_bounded(void **state) {
    (void)state;
    test_random random = {44};
    size_t kept = 0, raised = 0;
    for (int n = 0; n < 400; ++n) {
        double x[OV_FACTOR_PARAMETERS], bounded[OV_FACTOR_PARAMETERS];
        ov_quadric before, after;
        ovoid_ellipsoid was, is;
        random_factor(&random, x);
        const double least = n % 3 ? random_uniform(&random, 0.001, 1.0)
                                   : ov_factor_least_decay(x) * (1.0 + (n % 2 ? 1e-6 : -1e-6));
        memcpy(bounded, x, sizeof x);
        ov_factor_bound_decay(bounded, least);
        ov_factor_quadric(x, &before);
        ov_factor_quadric(bounded, &after);
        ov_ellipsoid_of_quadric(&before, &was);
        ov_ellipsoid_of_quadric(&after, &is);
        expect_near(ov_factor_least_decay(x), was.decay[2], 1e-9 * was.decay[0], "the least rate");
        assert_true(is.decay[2] >= least * (1.0 - 1e-9));
        for (int k = 0; k < 3; ++k)
            expect_near(is.decay[k], fmax(was.decay[k], least), 1e-8 * is.decay[0], "a rate");
        for (int k = 0; k < OV_FACTOR_L; ++k)
            assert_true(bounded[k] == x[k]);
        if (was.decay[2] >= least)
            assert_memory_equal(bounded, x, sizeof x);
        ++*(was.decay[2] >= least ? &kept : &raised);
    }
    assert_true(kept > 50 && raised > 50);
}

static void motion_is_bounded(void **state) {
    (void)state;
    test_random random = {6};
    double tightest = INFINITY, loosest = 0.0;
    for (int n = 0; n < TRIALS; ++n) {
        double from[OV_FACTOR_PARAMETERS], to[OV_FACTOR_PARAMETERS];
        const double size = n % 3 ? 0.02 : 0.4, cutoff = n % 2 ? 1e-4 : 1e-2;
        random_factor(&random, from);
        memcpy(to, from, sizeof to);
        for (int k = 0; k < OV_FACTOR_PARAMETERS; ++k)
            if (n % 4 == 3 || (k == 0 ? 0 : k < OV_FACTOR_L ? 1 : 2) == n % 4)
                to[k] += size * random_uniform(&random, -1.0, 1.0);
        const double moved = fmax(expect_bounded(&random, from, to, cutoff),
                                  expect_bounded(&random, to, from, cutoff));
        const double bound = ov_factor_motion(from, to, cutoff);
        if (moved > 0.01) {
            tightest = fmin(tightest, bound / moved);
            loosest = fmax(loosest, bound / moved);
        }
    }
    print_message("bound / motion: %.2f to %.2f\n", tightest, loosest);
    assert_true(loosest < 6.0);
}

/* From one shape to quite another. */
static void motion_between_any_two(void **state) {
    (void)state;
    test_random random = {7};
    for (int n = 0; n < TRIALS; ++n) {
        double from[OV_FACTOR_PARAMETERS], to[OV_FACTOR_PARAMETERS];
        random_factor(&random, from);
        random_factor(&random, to);
        for (int k = OV_FACTOR_L; n % 2 && k < OV_FACTOR_PARAMETERS; ++k)
            to[k] = -to[k]; /* the same A */
        expect_bounded(&random, from, to, 1e-3);
    }
}

static void motion_in_closed_form(void **state) {
    (void)state;
    const double ball[OV_FACTOR_PARAMETERS] = {1.0, 0.5, 0.5, 0.5, 0.8, 0.0, 0.0, 0.8, 0.0, 0.8};
    double other[OV_FACTOR_PARAMETERS];
    memcpy(other, ball, sizeof other);
    assert_true(ov_factor_motion(ball, other, 1e-4) == 0.0);
    other[1] += 2.0;
    other[3] -= 1.5;
    expect_near(ov_factor_motion(ball, other, 1e-4), 2.5, 1e-14, "a translation's motion");
    memcpy(other, ball, sizeof other);
    other[0] += 1.0; /* the radius is sqrt(q) / 0.8; the bound sums three axes */
    const double growth = (sqrt(2.0 - log(1e-4)) - sqrt(1.0 - log(1e-4))) / 0.8;
    expect_near(ov_factor_motion(ball, other, 1e-4), sqrt(3.0) * growth, 1e-14,
                "a growth's motion");
    expect_near(ov_factor_motion(other, ball, 1e-4), sqrt(3.0) * growth, 1e-14, "a shrinking");
}

static void motion_without_bound(void **state) {
    (void)state;
    const double ball[OV_FACTOR_PARAMETERS] = {1.0, 0.5, 0.5, 0.5, 0.8, 0.1, 0.2, 0.8, 0.1, 0.8};
    double other[OV_FACTOR_PARAMETERS];
    for (int k = 0; k < OV_FACTOR_PARAMETERS; ++k) {
        memcpy(other, ball, sizeof other);
        other[k] = NAN;
        assert_true(ov_factor_motion(ball, other, 1e-4) == INFINITY);
        assert_true(ov_factor_motion(other, ball, 1e-4) == INFINITY);
    }
    static const int diagonal[3] = {OV_FACTOR_L, OV_FACTOR_L + 3, OV_FACTOR_L + 5};
    for (int k = 0; k < 3; ++k) {
        memcpy(other, ball, sizeof other);
        other[diagonal[k]] = 0.0;
        assert_true(ov_factor_motion(ball, other, 1e-4) == INFINITY);
        assert_true(ov_factor_motion(other, ball, 1e-4) == INFINITY);
    }
    memcpy(other, ball, sizeof other); /* below the cut-off, and so in no list */
    other[0] = log(1e-4) - 1e-9;
    assert_true(ov_factor_motion(other, ball, 1e-4) == INFINITY);
    assert_true(isfinite(ov_factor_motion(ball, other, 1e-4)));
    assert_true(ov_factor_motion(other, other, 1e-4) == 0.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quadrics_survive_factors),
        cmocka_unit_test(quadric_is_the_product),
        cmocka_unit_test(factors_of_flat_forms),
        cmocka_unit_test(ellipsoids_of_every_kind),
        cmocka_unit_test(nearly_gimbal_lock),
        cmocka_unit_test(axes_along_the_coordinates),
        cmocka_unit_test(nearly_equal_and_very_unequal_axes),
        cmocka_unit_test(least_decay_is_bounded),
        cmocka_unit_test(motion_is_bounded),
        cmocka_unit_test(motion_between_any_two),
        cmocka_unit_test(motion_in_closed_form),
        cmocka_unit_test(motion_without_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
