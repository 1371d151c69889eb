/*
 * The kernels moments and residual against their twins in double, and the moments of a fine lattice
 * against Gaussian integrals. Tolerances: see test_field.c.
 */
#include "model/ellipsoid.h"
#include "support.h"

#define PI 3.14159265358979323846
/* Twice what is measured: points round about their pack's origin, as centres do. */
#define TOLERANCE 2.0

/* u for the points of the packs, 0 at the fill. */
static float *random_weights(test_random *random, const bench *b) {
    float *const u = test_alloc(b->points.packs * OV_PACK, sizeof *u);
    for (size_t k = 0; k < b->count; ++k)
        u[k] = (float)random_uniform(random, -1.0, 1.0);
    return u;
}

/* The moments as the host reads them. */
static double *moments_of(bench *b, const float *u) {
    ov_buffer weights = {0}, result = {0};
    const size_t size = b->terms_count * OV_MONOMIALS;
    double *const sums = test_alloc(size, sizeof *sums);
    write_floats(b->context, &weights, u, b->points.packs * OV_PACK);
    test_check(b->context, ov_moments(b->context, &b->operations, &b->points, &b->terms, &b->lists,
                                      &weights, &result));
    float *const pairs = read_floats(b->context, &result, 2 * size);
    for (size_t j = 0; j < size; ++j)
        sums[j] = (double)pairs[2 * j] + pairs[2 * j + 1];
    free(pairs);
    ov_buffer_destroy(&weights);
    ov_buffer_destroy(&result);
    return sums;
}

static double *in_double(const float *values, size_t count) {
    double *const converted = test_alloc(count, sizeof *converted);
    for (size_t k = 0; k < count; ++k)
        converted[k] = values[k];
    return converted;
}

static void expect_moments(bench *b, const float *u, double *worst, const char *what) {
    double *const got = moments_of(b, u), *const weights = in_double(u, b->count);
    for (size_t i = 0; i < b->terms_count; ++i) {
        ov_twin_sum wanted[OV_MONOMIALS];
        ov_twin_moments(&b->quadrics[i], b->xyz, weights, b->count, wanted);
        for (size_t m = 0; m < OV_MONOMIALS; ++m)
            expect_close(got[i * OV_MONOMIALS + m], wanted[m], TOLERANCE, worst, what,
                         i * OV_MONOMIALS + m);
    }
    free(got);
    free(weights);
}

/* A word on the device says whether there is anything to be done: what was there stays otherwise.
 */
static void idle_kernels_leave_results(void **state) {
    bench b;
    ov_buffer weights = {0}, moments = {0}, polynomial = {0}, value = {0}, word = {0};
    test_random random = {12};
    bench_random(&b, *state, MODEL_RANDOM, 3, 40, 300);
    float *const u = random_weights(&random, &b);
    const size_t size = 2 * b.terms_count * OV_MONOMIALS, values = b.points.packs * OV_PACK;
    float *const mark = test_alloc(size + values, sizeof *mark);
    for (size_t k = 0; k < size + values; ++k)
        mark[k] = 7.0f;
    write_floats(*state, &weights, u, values);
    write_floats(*state, &polynomial, mark, b.terms_count * OV_MONOMIALS);
    b.operations.idle = &word;
    for (cl_uint idle = 0; idle < 2; ++idle) {
        write_floats(*state, &moments, mark, size);
        write_floats(*state, &value, mark, values);
        test_check(*state, ov_buffer_put(*state, &word, &idle, sizeof idle, "a word"));
        test_check(*state, ov_moments(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                      &weights, &moments));
        test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                               &polynomial, NULL, &value));
        float *const sums = read_floats(*state, &moments, size);
        float *const got = read_floats(*state, &value, values);
        for (size_t k = 0; k < size; ++k)
            assert_true((sums[k] == 7.0f) == (idle == 1));
        for (size_t k = 0; k < b.count; ++k)
            assert_true((got[k] == 7.0f) == (idle == 1));
        free(sums);
        free(got);
    }
    b.operations.idle = NULL;
    free(u);
    free(mark);
    ov_buffer *const buffers[] = {&weights, &moments, &polynomial, &value, &word};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    bench_destroy(&b);
}

static void moments_equal_twin(void **state) {
    for (size_t place = 0; place < 2 * MODEL_KINDS; place = test_next(*state, place, 5)) {
        const model_kind kind = (model_kind)(place % MODEL_KINDS);
        const double near[3] = {0};
        bench b;
        double worst = 0.0;
        test_random random = {20};
        bench_random_at(&b, *state, kind, test_size(100, 4), test_size(3001, 101), 500 + place,
                        place < MODEL_KINDS ? near : bench_far);
        float *const u = random_weights(&random, &b);
        expect_moments(&b, u, &worst, model_kind_name(kind));
        print_message("moments, %s: %.2f of %g\n", model_kind_name(kind), worst, TOLERANCE);
        free(u);
        bench_destroy(&b);
    }
}

/* List lengths about the sizes of tiles and of flushes, powers of two of packs. */
static void moments_of_every_list_length(void **state) {
    const size_t lengths[] = {1, 2, 15, 16, 17, 31, 32, 33, 145, 255, 256, 257, 300, 513};
    const size_t count = test_size(sizeof lengths / sizeof lengths[0], 5);
    for (size_t n = 0; n < count; n = test_next(*state, n, 4)) {
        bench b;
        test_random random = {21};
        bench_random(&b, *state, MODEL_RANDOM, 2, lengths[n] * OV_PACK - 5, 600 + n);
        float *const u = random_weights(&random, &b);
        expect_moments(&b, u, NULL, "moment");
        free(u);
        bench_destroy(&b);
    }
}

/* A broad term at coincident points sums u itself. Large parts that cancel leave the small ones
 * exactly, which one float total, or the high parts alone, would lose. `flush` points are a
 * multiple of what the kernel sums in single floats. */
static void totals_hold_two_floats(void **state) {
    test_skip_simulated(*state);
    const size_t flush = 256 * OV_PACK, flushes = test_size(9, 4), count = flushes * flush;
    const ov_quadric quadric = {.amplitude = 1.0, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}};
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    float *const u = test_alloc(count, sizeof *u);
    double wanted = 0.0;
    for (size_t k = 0; k < count; ++k) {
        if (k < flush)
            u[k] = 0x1p20f;
        else
            u[k] = k >= count - flush ? -0x1p20f : 0x1p-9f;
        wanted += u[k];
    }
    assert_true(wanted > 0.0);
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-7);
    double *const got = moments_of(&b, u);
    expect_near(got[0], wanted, 0.0, "a sum of numbers that cancel");
    for (size_t m = 1; m < OV_MONOMIALS; ++m)
        assert_true(got[m] == 0.0);
    free(got);
    free(u);
    free(xyz);
    bench_destroy(&b);
}

/* Weights of either sign over a long list: the sum is a hundredth of its parts or less, and its
 * error stays far below one rounding of all of them. */
static void long_lists_that_cancel(void **state) {
    const size_t count = test_size(40000, 8224);
    test_random random = {22};
    const ov_quadric quadric = {.amplitude = 2.0, .a = {0.02, 0.005, -0.004, 0.03, 0.002, 0.025}};
    float *const xyz = random_points(&random, count, 4.0);
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-7);
    float *const u = test_alloc(b.points.packs * OV_PACK, sizeof *u);
    for (size_t k = 0; k < count; ++k)
        u[k] = random_bits(&random) % 2 ? 1.0f : -1.0f;
    double *const got = moments_of(&b, u), *const weights = in_double(u, count);
    ov_twin_sum wanted[OV_MONOMIALS];
    double worst = 0.0;
    ov_twin_moments(&quadric, b.xyz, weights, count, wanted);
    for (size_t m = 0; m < OV_MONOMIALS; ++m)
        expect_close(got[m], wanted[m], 0.1, &worst, "moment", m);
    print_message("%zu weights of either sign: %.4f of 0.1\n", count, worst);
    free(got);
    free(weights);
    free(u);
    free(xyz);
    bench_destroy(&b);
}

/* sum_k h^3 e(y_k) m(y_k - mu) over a lattice that resolves the ellipsoid is the integral: a
 * pi^(3/2) / sqrt(det A), first moments 0, second moments half A^-1 times it. The trapezoidal rule
 * converges so fast that only rounding and the cut-off are left. */
static void lattice_gives_gaussian_integrals(void **state) {
    test_skip_simulated(*state); /* moments_equal_twin() sums as well */
    const ovoid_ellipsoid ellipsoid = {.amplitude = 1.5,
                                       .decay = {0.7, 1.0, 1.3},
                                       .centre = {0.25, -0.5, 0.125},
                                       .angle = {0.4, -0.7, 1.9}};
    const double h = test_size(400, 750) / 1000.0, half = 5.5;
    const size_t side = (size_t)(2.0 * half / h) + 1, count = side * side * side;
    ov_quadric quadric;
    ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < count; ++k) {
        xyz[3 * k] = (float)(h * (double)(k % side) - half);
        xyz[3 * k + 1] = (float)(h * (double)(k / side % side) - half);
        xyz[3 * k + 2] = (float)(h * (double)(k / (side * side)) - half);
    }
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-10);
    float *const u = test_alloc(b.points.packs * OV_PACK, sizeof *u);
    for (size_t k = 0; k < count; ++k)
        u[k] = (float)(h * h * h);
    double *const got = moments_of(&b, u);

    double r[3][3];
    ov_twin_rotation(ellipsoid.angle, r);
    const double *const d = ellipsoid.decay;
    const double mass = ellipsoid.amplitude * pow(PI, 1.5) / sqrt(d[0] * d[1] * d[2]);
    expect_near(got[0], mass, 1e-5 * mass, "the integral of an ellipsoid");
    for (int k = 1; k <= 3; ++k)
        expect_near(got[k], 0.0, 1e-5 * mass, "a first moment");
    const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int k = 0; k < 6; ++k) {
        double inverse = 0.0;
        for (int p = 0; p < 3; ++p)
            inverse += r[p][row[k]] * r[p][column[k]] / d[p];
        expect_near(got[4 + k], 0.5 * inverse * mass, 1e-5 * mass, "a second moment");
    }
    free(got);
    free(u);
    free(xyz);
    bench_destroy(&b);
}

/* J^T u and J v are transposes of each other: u . (J v) = (J^T u) . v. */
static void moments_and_polynomial_are_adjoint(void **state) {
    bench b;
    test_random random = {23};
    bench_random(&b, *state, MODEL_RANDOM, test_size(60, 10), test_size(1000, 150), 700);
    const size_t size = b.terms_count * OV_MONOMIALS;
    float *const u = random_weights(&random, &b);
    float *const v = test_alloc(size, sizeof *v);
    for (size_t j = 0; j < size; ++j)
        v[j] = (float)random_uniform(&random, -1.0, 1.0);
    ov_buffer polynomial = {0}, value = {0};
    write_floats(*state, &polynomial, v, size);
    test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                           &polynomial, NULL, &value));
    float *const jv = read_floats(*state, &value, b.count);
    double *const jtu = moments_of(&b, u);
    double left = 0.0, right = 0.0, scale = 0.0;
    for (size_t k = 0; k < b.count; ++k) {
        left += (double)u[k] * jv[k];
        scale += fabs((double)u[k] * jv[k]);
    }
    for (size_t j = 0; j < size; ++j)
        right += jtu[j] * v[j];
    expect_near(left, right, 1e-6 * scale, "u . J v");
    free(jv);
    free(jtu);
    free(u);
    free(v);
    ov_buffer_destroy(&polynomial);
    ov_buffer_destroy(&value);
    bench_destroy(&b);
}

/* Terms that reach nothing have zero moments, and packs that nothing reaches a zero field. */
static void empty_lists_give_zeros(void **state) {
    bench b;
    test_random random = {24};
    const ov_quadric quadrics[2] = {
        {.amplitude = 1e-9, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1.0, .centre = {500.0, 0.0, 0.0}, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
    };
    float *const xyz = random_points(&random, 100, 2.0);
    bench_create(&b, *state, quadrics, 2, xyz, 100, 1e-7);
    assert_int_equal(b.lists.items, 0);
    float *const u = random_weights(&random, &b);
    double *const got = moments_of(&b, u);
    for (size_t j = 0; j < 2 * OV_MONOMIALS; ++j)
        assert_true(got[j] == 0.0);
    ov_buffer value = {0};
    test_check(*state, ov_field(*state, &b.operations, &b.points, &b.terms, &b.lists, &value));
    float *const field = read_floats(*state, &value, 100);
    for (size_t k = 0; k < 100; ++k)
        assert_true(field[k] == 0.0f);
    free(field);
    free(got);
    free(u);
    free(xyz);
    ov_buffer_destroy(&value);
    bench_destroy(&b);
}

/* ---- residual ----------------------------------------------------------------------------- */

/* ov_twin_residual(), in the kernel's precision. */
static float single_residual(float value, float target, float limit) {
    if (target > limit)
        return value < limit ? value - limit : 0.0f;
    return value - target;
}

/* value - target to the last bit, or where the target is above the limit, how far the value is
 * under the limit; sums per pack; at the fill zero, whatever stands there. */
static void residual_equals_twin(void **state) {
    const size_t counts[] = {1, 31, 32, 33, 63, 64, 65, 1000};
    for (size_t n = 0; n < sizeof counts / sizeof counts[0]; ++n) {
        const size_t count = counts[n];
        const double origin[3] = {0};
        const double limit = n % 2 ? 0.5 : INFINITY;
        test_random random = {30 + n};
        ov_points points = {0};
        ov_operations operations = {0};
        ov_buffer values = {0}, targets = {0}, result = {0}, pack_sums = {0};
        float *const xyz = random_points(&random, count, 3.0);
        double *const wide = widen_points(xyz, count);
        test_check(*state, ov_points_create(*state, wide, count, origin, 0.5, &points));
        free(wide);
        const size_t all = points.packs * OV_PACK;
        float *const value = test_alloc(all, sizeof *value);
        float *const target = test_alloc(all, sizeof *target);
        for (size_t k = 0; k < all; ++k) {
            value[k] = k < count ? (float)random_uniform(&random, -2.0, 2.0) : 1e30f;
            target[k] = k < count ? (float)random_uniform(&random, -2.0, 2.0) : -NAN;
        }
        write_floats(*state, &values, value, all);
        write_floats(*state, &targets, target, all);
        test_check(*state, ov_residual(*state, &operations, &points, &values, &targets, limit,
                                       &result, &pack_sums));
        float *const u = read_floats(*state, &result, all);
        float *const sums = read_floats(*state, &pack_sums, 2 * points.packs);
        for (size_t k = 0; k < all; ++k) {
            const float wanted =
                k < count ? single_residual(value[k], target[k], (float)limit) : 0.0f;
            assert_true(u[k] == wanted);
        }
        for (size_t pack = 0; pack < points.packs; ++pack) {
            double square = 0.0, largest = 0.0;
            for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK && k < count; ++k) {
                const float wanted = single_residual(value[k], target[k], (float)limit);
                square += (double)wanted * wanted;
                largest = fmax(largest, fabsf(wanted));
            }
            expect_near(sums[2 * pack], square, 2e-6 * square, "a pack's sum of squares");
            assert_true(sums[2 * pack + 1] == (float)largest);
        }
        free(u);
        free(sums);
        free(value);
        free(target);
        free(xyz);
        ov_points_destroy(&points);
        ov_operations_destroy(&operations);
        ov_buffer_destroy(&values);
        ov_buffer_destroy(&targets);
        ov_buffer_destroy(&result);
        ov_buffer_destroy(&pack_sums);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(idle_kernels_leave_results),
        cmocka_unit_test(moments_equal_twin),
        cmocka_unit_test(moments_of_every_list_length),
        cmocka_unit_test(totals_hold_two_floats),
        cmocka_unit_test(long_lists_that_cancel),
        cmocka_unit_test(lattice_gives_gaussian_integrals),
        cmocka_unit_test(moments_and_polynomial_are_adjoint),
        cmocka_unit_test(empty_lists_give_zeros),
        cmocka_unit_test(residual_equals_twin),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
