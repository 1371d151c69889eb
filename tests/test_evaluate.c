/* The public functions that evaluate a molecule's or a model's field at the caller's points. */
#include "support.h"

enum { ATOMS = 15 };

static ovoid_molecule *random_molecule(ovoid_context *context, double *xyzr) {
    test_random random = {1};
    ovoid_molecule *molecule = NULL;
    for (size_t i = 0; i < ATOMS; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = 100.0 + random_uniform(&random, -4.0, 4.0);
        xyzr[4 * i + 3] = random_uniform(&random, 0.0, 2.0);
    }
    test_check(context, ovoid_molecule_create(context, xyzr, ATOMS, &molecule));
    return molecule;
}

/* About the middle of random_molecule(). */
static double *random_positions(size_t count) {
    test_random random = {2};
    double *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < 3 * count; ++k)
        xyz[k] = 100.0 + random_uniform(&random, -6.0, 6.0);
    return xyz;
}

/* Value k belongs to point k. */
static void molecule_field_keeps_the_order(void **state) {
    const double d = 0.5;
    const size_t count = test_size(3000, 300);
    double xyzr[4 * ATOMS];
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    double *const xyz = random_positions(count), *const value = test_alloc(count, sizeof *value),
                  *const gradient = test_alloc(3 * count, sizeof *gradient);
    test_check(*state, once_molecule_field(*state, molecule, d, xyz, count, value, gradient));
    for (size_t k = 0; k < count; ++k) {
        const double wanted = ov_twin_phi(xyzr, ATOMS, d, xyz + 3 * k);
        expect_near(value[k], wanted, 5e-6 * wanted + 1e-7 * ATOMS, "phi");
        for (size_t axis = 0; axis < 3; ++axis) {
            const double h = 1e-4;
            double up[3], down[3];
            memcpy(up, xyz + 3 * k, sizeof up);
            memcpy(down, xyz + 3 * k, sizeof down);
            up[axis] += h;
            down[axis] -= h;
            const double slope =
                (ov_twin_phi(xyzr, ATOMS, d, up) - ov_twin_phi(xyzr, ATOMS, d, down)) /
                (up[axis] - down[axis]);
            expect_near(gradient[3 * k + axis], slope, 2e-5 * wanted + 1e-6 * ATOMS,
                        "a component of phi's gradient");
        }
    }
    free(xyz);
    free(value);
    free(gradient);
    ovoid_molecule_destroy(&molecule);
}

static void model_field_is_the_papers_sum(void **state) {
    const size_t count = test_size(2000, 200), size = 20;
    test_random random = {3};
    ovoid_ellipsoid ellipsoids[20];
    ovoid_model *model = NULL;
    random_ellipsoids(&random, MODEL_RANDOM, 4.0, ellipsoids, size);
    for (size_t i = 0; i < size; ++i)
        for (int k = 0; k < 3; ++k)
            ellipsoids[i].centre[k] += 100.0;
    test_check(*state, ovoid_model_create(*state, ellipsoids, size, 0.5, 1.0, &model));
    double *const xyz = random_positions(count), *const value = test_alloc(count, sizeof *value),
                  *const gradient = test_alloc(3 * count, sizeof *gradient);
    test_check(*state, once_model_field(*state, model, xyz, count, value, gradient));
    for (size_t k = 0; k < count; ++k) {
        double wanted = 0.0, slope[3] = {0};
        for (size_t i = 0; i < size; ++i) {
            const double h = 1e-4;
            wanted += ov_twin_ellipsoid(&ellipsoids[i], xyz + 3 * k);
            for (int axis = 0; axis < 3; ++axis) {
                double up[3], down[3];
                memcpy(up, xyz + 3 * k, sizeof up);
                memcpy(down, xyz + 3 * k, sizeof down);
                up[axis] += h;
                down[axis] -= h;
                slope[axis] += (ov_twin_ellipsoid(&ellipsoids[i], up) -
                                ov_twin_ellipsoid(&ellipsoids[i], down)) /
                               (up[axis] - down[axis]);
            }
        }
        expect_near(value[k], wanted, 1e-5 * wanted + 1e-6, "phi~");
        for (int axis = 0; axis < 3; ++axis)
            expect_near(gradient[3 * k + (size_t)axis], slope[axis], 5e-5 * wanted + 1e-5,
                        "a component of phi~'s gradient");
    }
    free(xyz);
    free(value);
    free(gradient);
    ovoid_model_destroy(&model);
}

/* The relative error that the header states, where phi is not small. */
static void error_is_as_the_header_says(void **state) {
    const size_t count = test_size(5000, 300);
    double xyzr[4 * ATOMS], worst = 0.0;
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    double *const xyz = random_positions(count), *const value = test_alloc(count, sizeof *value);
    test_check(*state, once_molecule_field(*state, molecule, 0.5, xyz, count, value, NULL));
    for (size_t k = 0; k < count; ++k) {
        const double wanted = ov_twin_phi(xyzr, ATOMS, 0.5, xyz + 3 * k);
        if (wanted > 0.1)
            worst = fmax(worst, fabs(value[k] - wanted) / wanted);
    }
    print_message("largest relative error %.2g\n", worst);
    assert_true(worst < 2e-6);
    free(xyz);
    free(value);
    ovoid_molecule_destroy(&molecule);
}

/* More points than are handled at once: the second piece takes its own place. */
static void more_than_a_million_points(void **state) {
    const size_t count = ((size_t)1 << 20) + 77;
    double xyzr[4 * ATOMS];
    if (test_small())
        skip();
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    double *const xyz = random_positions(count), *const value = test_alloc(count, sizeof *value),
                  *const gradient = test_alloc(3 * count, sizeof *gradient);
    test_check(*state, once_molecule_field(*state, molecule, 0.5, xyz, count, value, gradient));
    for (size_t k = 0; k < count; k += k < count - 200 ? 997 : 1) {
        const double wanted = ov_twin_phi(xyzr, ATOMS, 0.5, xyz + 3 * k);
        expect_near(value[k], wanted, 5e-6 * wanted + 1e-7 * ATOMS, "phi");
    }
    double single[4];
    test_check(*state, once_molecule_field(*state, molecule, 0.5, xyz + 3 * (count - 1), 1, single,
                                           single + 1));
    expect_near(gradient[3 * count - 1], single[3], 1e-5, "the last gradient");
    free(xyz);
    free(value);
    free(gradient);
    ovoid_molecule_destroy(&molecule);
}

static void odd_points(void **state) {
    double xyzr[4 * ATOMS], value[4] = {-1.0, -1.0, -1.0, -1.0};
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    /* none */
    test_check(*state, once_molecule_field(*state, molecule, 0.5, NULL, 0, NULL, NULL));
    test_check(*state, once_molecule_field(*state, molecule, 0.5, xyzr, 0, value, NULL));
    assert_true(value[0] == -1.0);
    /* far away, and the same point several times */
    const double xyz[] = {1e7,   0.0,   0.0,   100.0, 100.0, 100.0,
                          100.0, 100.0, 100.0, -1e30, 1e30,  0.0};
    test_check(*state, once_molecule_field(*state, molecule, 0.5, xyz, 4, value, NULL));
    assert_true(value[0] >= 0.0 && value[0] < 1e-30 && value[3] >= 0.0 && value[3] < 1e-30);
    assert_true(value[1] == value[2]);
    expect_near(value[1], ov_twin_phi(xyzr, ATOMS, 0.5, xyz + 3), 1e-5 * value[1], "phi");
    ovoid_molecule_destroy(&molecule);
}

/* A point so far out that its squares overflow is outside, not a NaN. */
static void point_beyond_single_precision(void **state) {
    const ovoid_ellipsoid ellipsoid = {
        .amplitude = 2.0, .decay = {0.3, 1.0, 0.7}, .angle = {0.5, 0.6, 0.7}};
    const double xyz[] = {1e25, -1e25, 1e25, 0.5, 0.0, 0.0, -1e37, 1e37, 1e37};
    double value[3];
    ovoid_model *model = NULL;
    test_check(*state, ovoid_model_create(*state, &ellipsoid, 1, 0.5, 1.0, &model));
    test_check(*state, once_model_field(*state, model, xyz, 3, value, NULL));
    assert_true(value[0] >= 0.0 && value[0] < 1e-30);
    assert_true(value[2] >= 0.0 && value[2] < 1e-30);
    const double wanted = ov_twin_ellipsoid(&ellipsoid, xyz + 3);
    expect_near(value[1], wanted, 2e-6 * wanted, "phi~");
    ovoid_model_destroy(&model);
}

static void bad_arguments_change_nothing(void **state) {
    double xyzr[4 * ATOMS], value[2] = {-1.0, -1.0}, gradient[6] = {-1.0};
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    const double xyz[6] = {1.0, 2.0, 3.0, 4.0, NAN, 6.0};
    const double infinite[3] = {INFINITY, 0.0, 0.0};
    const ovoid_status argument = OVOID_ERROR_ARGUMENT;
    test_refused(*state, once_molecule_field(*state, molecule, 0.5, xyz, 2, value, gradient),
                 argument, "point 1");
    test_refused(*state, once_molecule_field(*state, molecule, 0.5, infinite, 1, value, gradient),
                 argument, "point 0");
    test_refused(*state, once_molecule_field(*state, NULL, 0.5, xyz, 1, value, NULL), argument,
                 "NULL");
    test_refused(*state, once_molecule_field(*state, molecule, 0.5, NULL, 1, value, NULL), argument,
                 "NULL");
    test_refused(*state, once_molecule_field(*state, molecule, 0.5, xyz, 1, NULL, NULL), argument,
                 "NULL");
    assert_int_equal(once_molecule_field(NULL, molecule, 0.5, xyz, 1, value, NULL), argument);
    test_refused(*state, once_model_field(*state, NULL, xyz, 1, value, NULL), argument, "NULL");
    const double decays[] = {0.0, -1.0, NAN, INFINITY, 101.0};
    for (size_t k = 0; k < sizeof decays / sizeof decays[0]; ++k)
        test_refused(*state, once_molecule_field(*state, molecule, decays[k], xyz, 1, value, NULL),
                     argument, "decay");
    assert_true(value[0] == -1.0 && value[1] == -1.0 && gradient[0] == -1.0);
    ovoid_molecule_destroy(&molecule);
}

/* exp(d r^2) beyond single precision is refused rather than wrong. */
static void huge_radius_is_refused(void **state) {
    const double xyzr[4] = {0.0, 0.0, 0.0, 14.0}, xyz[3] = {14.0, 0.0, 0.0};
    double value = -1.0;
    ovoid_molecule *molecule = NULL;
    test_check(*state, ovoid_molecule_create(*state, xyzr, 1, &molecule));
    test_refused(*state, once_molecule_field(*state, molecule, 0.5, xyz, 1, &value, NULL),
                 OVOID_ERROR_LIMIT, "radius");
    assert_true(value == -1.0);
    test_check(*state, once_molecule_field(*state, molecule, 0.3, xyz, 1, &value, NULL));
    expect_near(value, 1.0, 1e-4, "phi on the sphere of a large atom");
    ovoid_molecule_destroy(&molecule);
}

/* ---- large structures --------------------------------------------------------------------- */

enum { CORNERS = 8, MEMBERS = 12, WIDE = CORNERS * MEMBERS };

static const double half_extents[] = {50.0, 200.0, 800.0, 1e4, 1e5, 1e6};
enum { EXTENTS = sizeof half_extents / sizeof *half_extents };

/* Atoms in eight clusters at the corners of a cube, or one by one all over it, and points near them
 * in no order. */
static void place_wide(double half, bool spread, double *xyzr, double *xyz, size_t count) {
    test_random random = {7};
    const double side = spread ? half : 4.0;
    for (size_t i = 0; i < WIDE; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) {
            const double sign = i / MEMBERS >> axis & 1 ? 1.0 : -1.0;
            xyzr[4 * i + axis] =
                (spread ? 0.0 : sign * (half - side)) + random_uniform(&random, -side, side);
        }
        xyzr[4 * i + 3] = random_uniform(&random, 1.0, 2.0);
    }
    for (size_t k = 0; k < count; ++k)
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * k + axis] =
                xyzr[4 * (k * 29 % WIDE) + axis] + random_uniform(&random, -2.5, 2.5);
}

/* phi and its gradient by the formula. */
static double exact_field(const double *xyzr, size_t atoms, double d, const double at[3],
                          double gradient[3]) {
    double sum = 0.0;
    memset(gradient, 0, 3 * sizeof *gradient);
    for (size_t i = 0; i < atoms; ++i) {
        const double *const a = xyzr + 4 * i;
        const double one = ov_twin_phi(a, 1, d, at);
        sum += one;
        for (int axis = 0; axis < 3; ++axis)
            gradient[axis] -= 2.0 * d * (at[axis] - a[axis]) * one;
    }
    return sum;
}

static void expect_field(const double *xyzr, size_t atoms, double d, const double *xyz,
                         size_t count, const double *value, const double *gradient) {
    double worst = 0.0, worst_slope = 0.0;
    for (size_t k = 0; k < count; ++k) {
        double wanted[3], off = 0.0, length = 0.0;
        const double phi = exact_field(xyzr, atoms, d, xyz + 3 * k, wanted);
        if (phi < 0.1)
            continue;
        for (size_t axis = 0; axis < 3; ++axis) {
            off += pow(gradient[3 * k + axis] - wanted[axis], 2.0);
            length += wanted[axis] * wanted[axis];
        }
        worst = fmax(worst, fabs(value[k] - phi) / phi);
        worst_slope = fmax(worst_slope, sqrt(off) / fmax(sqrt(length), phi));
    }
    print_message("largest relative errors %.2g, gradient %.2g\n", worst, worst_slope);
    assert_true(worst < 2.5e-6 && worst_slope < 6e-6);
}

/* The relative error that the header states, however far a structure extends. */
static void error_is_the_same_at_every_extent(void **state) {
    const size_t count = test_size(4000, 200);
    double *const xyzr = test_alloc(4 * WIDE, sizeof *xyzr), *const xyz =
                                                                 test_alloc(3 * count, sizeof *xyz);
    double *const value = test_alloc(count, sizeof *value), *const gradient = test_alloc(
                                                                3 * count, sizeof *gradient);
    for (size_t n = 0; n < 2 * EXTENTS; n = test_next(*state, n, 11)) {
        ovoid_molecule *molecule = NULL;
        place_wide(half_extents[n / 2], n % 2, xyzr, xyz, count);
        test_check(*state, ovoid_molecule_create(*state, xyzr, WIDE, &molecule));
        test_check(*state, once_molecule_field(*state, molecule, 0.5, xyz, count, value, gradient));
        print_message("half extent %g, %s: ", half_extents[n / 2], n % 2 ? "spread" : "clusters");
        expect_field(xyzr, WIDE, 0.5, xyz, count, value, gradient);
        ovoid_molecule_destroy(&molecule);
    }
    free(xyzr);
    free(xyz);
    free(value);
    free(gradient);
}

/* Likewise of a model, in which every ellipsoid is an atom's sphere. */
static void error_of_a_wide_model(void **state) {
    const size_t count = test_size(4000, 200);
    double xyzr[4 * WIDE];
    ovoid_ellipsoid ellipsoids[WIDE] = {{0}};
    ovoid_model *model = NULL;
    double *const xyz = test_alloc(3 * count, sizeof *xyz),
                  *const value = test_alloc(count, sizeof *value),
                  *const gradient = test_alloc(3 * count, sizeof *gradient);
    place_wide(1e6, false, xyzr, xyz, count);
    for (size_t i = 0; i < WIDE; ++i) {
        ellipsoids[i].amplitude = exp(0.5 * xyzr[4 * i + 3] * xyzr[4 * i + 3]);
        for (size_t axis = 0; axis < 3; ++axis) {
            ellipsoids[i].decay[axis] = 0.5;
            ellipsoids[i].centre[axis] = xyzr[4 * i + axis];
            ellipsoids[i].angle[axis] = (double)i;
        }
    }
    test_check(*state, ovoid_model_create(*state, ellipsoids, WIDE, 0.5, 1.0, &model));
    test_check(*state, once_model_field(*state, model, xyz, count, value, gradient));
    expect_field(xyzr, WIDE, 0.5, xyz, count, value, gradient);
    ovoid_model_destroy(&model);
    free(xyz);
    free(value);
    free(gradient);
}

/* However far out a point is, its value and gradient are 0, and those of its neighbours right: by
 * themselves, and among points that are near. */
static void points_far_outside(void **state) {
    static const double out[] = {1e3,  1e5,  1e6,  1e7,   1e12,  1e19,
                                 1e20, 3e38, 4e38, 1e100, 1e300, DBL_MAX};
    enum { OUT = sizeof out / sizeof *out };
    double xyzr[4 * ATOMS], value[4], gradient[12], single[4];
    const double near[3] = {101.0, 99.0, 100.0};
    ovoid_molecule *molecule = random_molecule(*state, xyzr);
    test_check(*state, once_molecule_field(*state, molecule, 0.5, near, 1, single, single + 1));
    assert_true(single[0] > 0.1);
    for (size_t n = 0; n < 2 * OUT * 3; n = test_next(*state, n, 17)) {
        const double far = n % 2 ? out[n / 6] : -out[n / 6];
        double xyz[12] = {far, far, far, 0.0, 0.0, 0.0, 100.0, 100.0, 100.0};
        xyz[3 + n / 2 % 3] = far;
        xyz[6 + n / 2 % 3] = far;
        memcpy(xyz + 9, near, sizeof near);
        for (size_t count = 3; count <= 4; ++count) {
            memset(value, 0xff, sizeof value);
            memset(gradient, 0xff, sizeof gradient);
            test_check(*state,
                       once_molecule_field(*state, molecule, 0.5, xyz, count, value, gradient));
            for (int k = 0; k < 3; ++k) {
                assert_true(value[k] == 0.0);
                for (int axis = 0; axis < 3; ++axis)
                    assert_true(gradient[3 * k + axis] == 0.0);
            }
            if (count == 4)
                expect_near(value[3], single[0], 1e-6 * single[0], "phi of the neighbour");
            for (int axis = 0; axis < 3 && count == 4; ++axis)
                expect_near(gradient[9 + axis], single[1 + axis], 1e-5, "its gradient");
        }
    }
    ovoid_molecule_destroy(&molecule);
}

/* A model as long as a float is wide: far points that it does reach, and some that it does not. */
static void model_that_reaches_far(void **state) {
    const ovoid_ellipsoid ellipsoid = {.amplitude = 2.0,
                                       .decay = {1e-10, 1.0, 2.0},
                                       .centre = {5e4, 0.0, 0.0},
                                       .angle = {0.3, 0.0, 0.0}};
    const double xyz[] = {1e5, 0.1, -0.1, 1.5e5, 0.2, 0.3, 1e12, 0.0, 0.0, 1e300, 0.0, 0.0};
    double value[4], gradient[12];
    ovoid_model *model = NULL;
    test_check(*state, ovoid_model_create(*state, &ellipsoid, 1, 0.5, 1.0, &model));
    test_check(*state, once_model_field(*state, model, xyz, 4, value, gradient));
    for (int k = 0; k < 2; ++k) {
        const double wanted = ov_twin_ellipsoid(&ellipsoid, xyz + 3 * k);
        expect_near(value[k], wanted, 2e-6 * wanted, "phi~");
    }
    for (int k = 6; k < 12; ++k)
        assert_true(value[k / 3] == 0.0 && gradient[k] == 0.0);
    ovoid_model_destroy(&model);
}

/* Nothing is written when a later piece fails, although the first went well. */
static void failure_leaves_the_outputs(void **state) {
    const size_t outside = (size_t)1 << 20, inside = 20000, count = outside + inside;
    double xyzr[4 * ATOMS];
    ovoid_context *context = NULL;
    ov_device *device = NULL;
    if (test_small())
        skip();
    (void)state;
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    test_check(context, ovoid_context_open_device(context, NULL));
    test_check(context, ov_device_get(context, &device));
    ovoid_molecule *molecule = random_molecule(context, xyzr);
    double *const xyz = test_alloc(3 * count, sizeof *xyz), *const near = random_positions(inside);
    double *const value = test_alloc(count, sizeof *value), *const gradient = test_alloc(
                                                                3 * count, sizeof *gradient);
    memcpy(xyz + 3 * outside, near, 3 * inside * sizeof *xyz);
    for (size_t k = 0; k < 4 * count; ++k)
        *(k < count ? value + k : gradient + k - count) = -7.0;
    device->info.max_allocation = 3 * inside * sizeof(float) - 1; /* not enough for the points */
    test_refused(context, once_molecule_field(context, molecule, 0.5, xyz, count, value, gradient),
                 OVOID_ERROR_LIMIT, "points");
    for (size_t k = 0; k < 4 * count; ++k)
        assert_true(*(k < count ? value + k : gradient + k - count) == -7.0);
    free(xyz);
    free(near);
    free(value);
    free(gradient);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(molecule_field_keeps_the_order),
        cmocka_unit_test(model_field_is_the_papers_sum),
        cmocka_unit_test(error_is_as_the_header_says),
        cmocka_unit_test(more_than_a_million_points),
        cmocka_unit_test(odd_points),
        cmocka_unit_test(point_beyond_single_precision),
        cmocka_unit_test(bad_arguments_change_nothing),
        cmocka_unit_test(huge_radius_is_refused),
        cmocka_unit_test(error_is_the_same_at_every_extent),
        cmocka_unit_test(error_of_a_wide_model),
        cmocka_unit_test(points_far_outside),
        cmocka_unit_test(model_that_reaches_far),
        cmocka_unit_test(failure_leaves_the_outputs),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
