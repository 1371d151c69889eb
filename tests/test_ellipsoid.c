/* One ellipsoid on the host: the paper's rotation, its derivatives, the quadratic form, atoms. */
#include "model/ellipsoid.h"
#include "support.h"

#define PI 3.14159265358979323846

static const double special_angles[][3] = {
    {0.0, 0.0, 0.0},      {0.5 * PI, 0.0, 0.0}, {0.0, 0.5 * PI, 0.0},
    {0.0, 0.0, 0.5 * PI}, {0.3, 0.5 * PI, 0.4}, {-1.0, -0.5 * PI, 2.0},
    {PI, -PI, PI},        {7.0, -20.0, 100.0},  {1e-9, -1e-9, 1e-9},
};
enum { SPECIALS = sizeof special_angles / sizeof special_angles[0], ANGLES = 200 };

static void angles_of(test_random *random, size_t index, double angle[3]) {
    for (int k = 0; k < 3; ++k)
        angle[k] = index < SPECIALS ? special_angles[index][k] : random_uniform(random, -PI, PI);
}

static void is_the_product_of_the_papers_matrices(void **state) {
    (void)state;
    test_random random = {1};
    for (size_t n = 0; n < ANGLES; ++n) {
        double angle[3], r[3][3], wanted[3][3];
        angles_of(&random, n, angle);
        ov_rotation(angle, r);
        ov_twin_rotation(angle, wanted);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                expect_near(r[i][j], wanted[i][j], 4 * DBL_EPSILON, "an entry of R");
    }
}

static void is_a_rotation(void **state) {
    (void)state;
    test_random random = {2};
    for (size_t n = 0; n < ANGLES; ++n) {
        double angle[3], r[3][3];
        angles_of(&random, n, angle);
        ov_rotation(angle, r);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                double dot = 0.0;
                for (int k = 0; k < 3; ++k)
                    dot += r[i][k] * r[j][k];
                expect_near(dot, i == j, 8 * DBL_EPSILON, "an entry of R R^T");
            }
        const double determinant = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) -
                                   r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0]) +
                                   r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
        expect_near(determinant, 1.0, 8 * DBL_EPSILON, "det R");
    }
}

static void derivatives_equal_central_differences(void **state) {
    (void)state;
    test_random random = {3};
    const double h = 1e-5;
    for (size_t n = 0; n < ANGLES; ++n) {
        double angle[3], dr[3][3][3];
        angles_of(&random, n, angle);
        ov_rotation_derivatives(angle, dr);
        for (int k = 0; k < 3; ++k) {
            double up[3], down[3], above[3][3], below[3][3];
            memcpy(up, angle, sizeof up);
            memcpy(down, angle, sizeof down);
            up[k] += h;
            down[k] -= h;
            ov_twin_rotation(up, above);
            ov_twin_rotation(down, below);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    expect_near(dr[k][i][j], (above[i][j] - below[i][j]) / (up[k] - down[k]), 1e-9,
                                "an entry of dR");
        }
    }
}

/* z^T (R^T D R) z = |D^(1/2) R z|^2, the paper's form, for every kind of ellipsoid. */
static void form_equals_the_papers(void **state) {
    (void)state;
    test_random random = {4};
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        ovoid_ellipsoid ellipsoids[20];
        random_ellipsoids(&random, (model_kind)kind, 3.0, ellipsoids, 20);
        for (size_t n = 0; n < 20; ++n) {
            ov_quadric quadric;
            ov_quadric_of_ellipsoid(&ellipsoids[n], &quadric);
            assert_true(quadric.amplitude == ellipsoids[n].amplitude);
            assert_memory_equal(quadric.centre, ellipsoids[n].centre, sizeof quadric.centre);
            for (int k = 0; k < 20; ++k) {
                double y[3];
                for (int axis = 0; axis < 3; ++axis)
                    y[axis] = ellipsoids[n].centre[axis] + random_uniform(&random, -1.0, 1.0);
                const double wanted = ov_twin_ellipsoid(&ellipsoids[n], y);
                const double got = quadric.amplitude * exp(-ov_twin_exponent(&quadric, y));
                expect_near(got, wanted, 1e-13 * wanted, "an ellipsoid's value");
            }
        }
    }
}

static void equal_decays_leave_no_direction(void **state) {
    (void)state;
    test_random random = {5};
    for (size_t n = 0; n < ANGLES; ++n) {
        double angle[3], r[3][3], a[6];
        const double d = exp(random_uniform(&random, -10.0, 5.0));
        angles_of(&random, n, angle);
        ov_rotation(angle, r);
        ov_quadratic_form(r, (const double[3]){d, d, d}, a);
        const double wanted[6] = {d, 0, 0, d, 0, d};
        for (int k = 0; k < 6; ++k)
            expect_near(a[k], wanted[k], 8 * DBL_EPSILON * d, "an entry of A");
    }
}

static void atom_is_its_gaussian(void **state) {
    (void)state;
    test_random random = {6};
    for (int n = 0; n < 100; ++n) {
        double xyzr[4], y[3];
        for (int k = 0; k < 4; ++k)
            xyzr[k] = random_uniform(&random, k < 3 ? -50.0 : 0.0, k < 3 ? 50.0 : 3.0);
        if (n == 0)
            xyzr[3] = 0.0;
        for (int k = 0; k < 3; ++k)
            y[k] = xyzr[k] + random_uniform(&random, -3.0, 3.0);
        const double d = random_uniform(&random, 0.1, 1.0);
        ov_quadric quadric;
        ov_quadric_of_atom(xyzr, d, &quadric);
        const double wanted = ov_twin_phi(xyzr, 1, d, y);
        expect_near(quadric.amplitude * exp(-ov_twin_exponent(&quadric, y)), wanted, 1e-13 * wanted,
                    "an atom's value");
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(is_the_product_of_the_papers_matrices),
        cmocka_unit_test(is_a_rotation),
        cmocka_unit_test(derivatives_equal_central_differences),
        cmocka_unit_test(form_equals_the_papers),
        cmocka_unit_test(equal_decays_leave_no_direction),
        cmocka_unit_test(atom_is_its_gaussian),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
