/*
 * The kernel gram against its twin in double, against the quadratic form of field_polynomial, and
 * against Gaussian integrals. Tolerances: see test_field.c.
 */
#include "model/ellipsoid.h"
#include "support.h"

#define PI 3.14159265358979323846
/* About twice what is measured, in all shapes; the twin's scale counts the roundings of e twice, as
 * e^2 does. */
#define TOLERANCE 2.0
/* What a preconditioner and a step need: of the sum of magnitudes. */
#define RELATIVE 1e-6

/* Non-negative, as squares and robust weights are, some of them 0; 0 at the fill. */
static float *random_weights(test_random *random, const bench *b, double largest) {
    float *const w = test_alloc(b->points.packs * OV_PACK, sizeof *w);
    for (size_t k = 0; k < b->count; ++k)
        w[k] = k % 11 ? (float)random_uniform(random, 0.0, largest) : 0.0f;
    return w;
}

/* OV_GRAM sums per term, as the device leaves them. */
static float *gram_of(bench *b, const float *w) {
    ov_buffer weights = {0}, result = {0};
    const size_t size = b->terms_count * OV_GRAM;
    const float untouched = NAN;
    float *const before = test_alloc(size, sizeof *before);
    for (size_t j = 0; j < size; ++j)
        before[j] = untouched;
    write_floats(b->context, &weights, w, b->points.packs * OV_PACK);
    write_floats(b->context, &result, before, size);
    test_check(b->context, ov_gram(b->context, &b->operations, &b->points, &b->terms, &b->lists,
                                   &weights, &result));
    float *const sums = read_floats(b->context, &result, size);
    free(before);
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

/* Far from the origin points and centres do not happen to be floats, and round as well. */
static double tolerance_of(const bench *b) {
    return b->points.rounding > 1e-3f ? 2.0 * TOLERANCE : TOLERANCE;
}

static void expect_gram(bench *b, const float *w, double *worst, const char *what) {
    float *const got = gram_of(b, w);
    double *const weights = in_double(w, b->count);
    for (size_t i = 0; i < b->terms_count; ++i) {
        ov_twin_sum wanted[OV_GRAM];
        ov_twin_gram(&b->quadrics[i], b->xyz, weights, b->count, wanted);
        for (size_t m = 0; m < OV_GRAM; ++m)
            expect_close(got[i * OV_GRAM + m], wanted[m], tolerance_of(b), worst, what,
                         i * OV_GRAM + m);
    }
    free(got);
    free(weights);
}

static void gram_equals_twin(void **state) {
    for (size_t place = 0; place < 2 * MODEL_KINDS; place = test_next(*state, place, 5)) {
        const model_kind kind = (model_kind)(place % MODEL_KINDS);
        const double near[3] = {0};
        bench b;
        double worst = 0.0;
        test_random random = {40};
        bench_random_at(&b, *state, kind, test_size(60, 4), test_size(3001, 101), 800 + place,
                        place < MODEL_KINDS ? near : bench_far);
        /* e^80 times quartics would leave the range of floats */
        float *const w = random_weights(&random, &b, kind == MODEL_HUGE ? 0x1p-40 : 1.0);
        expect_gram(&b, w, &worst, model_kind_name(kind));
        print_message("gram, %s: %.2f of %g\n", model_kind_name(kind), worst, TOLERANCE);
        free(w);
        bench_destroy(&b);
    }
}

/* List lengths about the sizes of tiles and of flushes, powers of two of packs. */
static void gram_of_every_list_length(void **state) {
    const size_t lengths[] = {1, 2, 15, 63, 64, 65, 127, 128, 129, 256, 511, 512, 513, 575, 577};
    const size_t count = test_size(sizeof lengths / sizeof lengths[0], 4);
    for (size_t n = 0; n < count; n = test_next(*state, n, 3)) {
        bench b;
        test_random random = {41};
        bench_random(&b, *state, MODEL_RANDOM, 2, lengths[n] * OV_PACK - 5, 900 + n);
        float *const w = random_weights(&random, &b, 1.0);
        expect_gram(&b, w, NULL, "gram");
        free(w);
        bench_destroy(&b);
    }
}

/* The last pack may hold one point and its repetitions. Weights of either sign are summed alike. */
static void fill_does_not_count(void **state) {
    for (size_t count = 1; count <= 2 * OV_PACK + 1; count += OV_PACK / 2) {
        bench b;
        test_random random = {42};
        bench_random(&b, *state, MODEL_SPHERE, 3, count, 950);
        float *const w = test_alloc(b.points.packs * OV_PACK, sizeof *w);
        for (size_t k = 0; k < count; ++k)
            w[k] = (float)random_uniform(&random, -1.0, 1.0);
        expect_gram(&b, w, NULL, "gram");
        free(w);
        bench_destroy(&b);
    }
}

/* One point at a power of two from the centre of a term that is 1 there but for a few roundings:
 * each sum is its monomial, and no two of these are the same but for their axes' order. */
static void sums_are_in_the_order_of_their_monomials(void **state) {
    static const char names[OV_GRAM][5] = {"",     "x",    "y",    "z",    "xx",   "xy",   "xz",
                                           "yy",   "yz",   "zz",   "xxx",  "xxy",  "xxz",  "xyy",
                                           "xyz",  "xzz",  "yyy",  "yyz",  "yzz",  "zzz",  "xxxx",
                                           "xxxy", "xxxz", "xxyy", "xxyz", "xxzz", "xyyy", "xyyz",
                                           "xyzz", "xzzz", "yyyy", "yyyz", "yyzz", "yzzz", "zzzz"};
    const ov_quadric quadric = {.amplitude = 1.0, .a = {1e-12, 0.0, 0.0, 1e-12, 0.0, 1e-12}};
    const float xyz[3] = {2.0f, -32.0f, 1024.0f};
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, 1, 1e-7);
    float *const w = test_alloc(OV_PACK, sizeof *w);
    w[0] = 1.0f;
    float *const got = gram_of(&b, w);
    for (size_t m = 0; m < OV_GRAM; ++m) {
        double wanted = 1.0;
        for (const char *name = names[m]; *name; ++name)
            wanted *= xyz[*name - 'x'];
        expect_near(got[m], wanted, 1e-4 * fabs(wanted), names[m]);
    }
    free(got);
    free(w);
    bench_destroy(&b);
}

/* Index in OV_GRAM of the product of two of the OV_MONOMIALS. */
static size_t product_index(size_t i, size_t j) {
    static const int power[OV_MONOMIALS][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                               {2, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 2, 0},
                                               {0, 1, 1}, {0, 0, 2}};
    static const size_t first[5] = {0, 1, 4, 10, 20};
    const int y = power[i][1] + power[j][1], z = power[i][2] + power[j][2];
    const int degree = power[i][0] + power[j][0] + y + z, rest = y + z;
    return first[degree] + (size_t)(rest * (rest + 1) / 2 + z);
}

/* Of one term: sum_k w_k (e p)^2 = c^T (sum_k w_k e^2 m m^T) c, c the coefficients of p. */
static void gram_is_the_quadratic_form_of_the_polynomial(void **state) {
    for (size_t seed = 0; seed < 5; seed = test_next(*state, seed, 5)) {
        bench b;
        test_random random = {43 + seed};
        bench_random(&b, *state, MODEL_RANDOM, 1, test_size(2000, 150), 970 + seed);
        float *const w = random_weights(&random, &b, 1.0);
        float c[OV_MONOMIALS];
        for (size_t j = 0; j < OV_MONOMIALS; ++j)
            c[j] = (float)random_uniform(&random, -1.0, 1.0);
        ov_buffer polynomial = {0}, value = {0};
        write_floats(*state, &polynomial, c, OV_MONOMIALS);
        test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                               &polynomial, NULL, &value));
        float *const jv = read_floats(*state, &value, b.count);
        float *const gram = gram_of(&b, w);
        double left = 0.0, right = 0.0, scale = 0.0;
        for (size_t k = 0; k < b.count; ++k)
            left += (double)w[k] * jv[k] * jv[k];
        for (size_t i = 0; i < OV_MONOMIALS; ++i)
            for (size_t j = 0; j < OV_MONOMIALS; ++j) {
                const double part = (double)c[i] * c[j] * gram[product_index(i, j)];
                right += part;
                scale += fabs(part);
            }
        assert_true(left > 1e-3 * scale);
        expect_near(right, left, RELATIVE * scale, "c^T G c");
        free(gram);
        free(jv);
        free(w);
        ov_buffer_destroy(&polynomial);
        ov_buffer_destroy(&value);
        bench_destroy(&b);
    }
}

/* A term that meets thousands of packs, at points all alike: every addition to a sum rounds to the
 * same side, so one float total would drift far off. */
static void long_lists_do_not_drift(void **state) {
    test_skip_simulated(*state);
    const size_t count = test_size(400000, 2000);
    const ov_quadric quadric = {.amplitude = 1.0, .a = {1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6}};
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < count; ++k) {
        xyz[3 * k] = 0.7f;
        xyz[3 * k + 1] = -0.9f;
        xyz[3 * k + 2] = 1.1f;
    }
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-7);
    float *const w = test_alloc(b.points.packs * OV_PACK, sizeof *w);
    for (size_t k = 0; k < count; ++k)
        w[k] = 0.1f;
    float *const got = gram_of(&b, w);
    double *const weights = in_double(w, count);
    ov_twin_sum wanted[OV_GRAM];
    ov_twin_gram(&quadric, b.xyz, weights, count, wanted);
    double worst = 0.0;
    for (size_t m = 0; m < OV_GRAM; ++m) {
        const double error = fabs(got[m] - wanted[m].value) / fabs(wanted[m].value);
        worst = fmax(worst, error);
        expect_near(error, 0.0, RELATIVE, "the relative error of a long sum");
    }
    print_message("%zu points alike: %.2g of %g\n", count, worst, RELATIVE);
    free(got);
    free(weights);
    free(w);
    free(xyz);
    bench_destroy(&b);
}

/* Random points over a long list, error relative to the sum of magnitudes. */
static void long_lists_are_accurate(void **state) {
    test_skip_simulated(*state);
    const size_t count = test_size(200000, 2000);
    test_random random = {44};
    const ov_quadric quadric = {.amplitude = 1.5, .a = {0.2, 0.05, -0.04, 0.3, 0.02, 0.25}};
    float *const xyz = random_points(&random, count, 3.0);
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-7);
    float *const w = random_weights(&random, &b, 1.0);
    float *const got = gram_of(&b, w);
    double *const weights = in_double(w, count);
    double magnitude[OV_GRAM] = {0}, worst = 0.0;
    ov_twin_sum wanted[OV_GRAM];
    ov_twin_gram(&quadric, b.xyz, weights, count, wanted);
    for (size_t k = 0; k < count; ++k) {
        ov_twin_sum one[OV_GRAM];
        ov_twin_gram(&quadric, b.xyz + 3 * k, weights + k, 1, one);
        for (size_t m = 0; m < OV_GRAM; ++m)
            magnitude[m] += fabs(one[m].value);
    }
    for (size_t m = 0; m < OV_GRAM; ++m) {
        expect_near(got[m], wanted[m].value, RELATIVE * magnitude[m], "a sum of a long list");
        worst = fmax(worst, fabs(got[m] - wanted[m].value) / magnitude[m]);
    }
    print_message("%zu points: %.2g of %g\n", count, worst, RELATIVE);
    free(got);
    free(weights);
    free(w);
    free(xyz);
    bench_destroy(&b);
}

/* sum_k h^3 e(y_k)^2 z^alpha over a lattice that resolves the ellipsoid is the integral of a
 * Gaussian of amplitude a^2 and matrix 2 A: a^2 pi^(3/2) / sqrt(det 2 A) times the moments of the
 * normal distribution of covariance S = (4 A)^-1, by Isserlis' theorem. */
static void lattice_gives_gaussian_integrals(void **state) {
    test_skip_simulated(*state); /* gram_equals_twin() sums as well */
    const ovoid_ellipsoid ellipsoid = {.amplitude = 1.5,
                                       .decay = {0.35, 0.5, 0.65},
                                       .centre = {0.25, -0.5, 0.125},
                                       .angle = {0.4, -0.7, 1.9}};
    const double h = test_size(400, 720) / 1000.0, half = 5.5;
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
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-8);
    float *const w = test_alloc(b.points.packs * OV_PACK, sizeof *w);
    for (size_t k = 0; k < count; ++k)
        w[k] = (float)(h * h * h);
    float *const got = gram_of(&b, w);

    double r[3][3], s[3][3];
    ov_twin_rotation(ellipsoid.angle, r);
    const double *const d = ellipsoid.decay, a = ellipsoid.amplitude;
    const double mass = a * a * pow(PI, 1.5) / sqrt(8.0 * d[0] * d[1] * d[2]);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            s[i][j] = 0.0;
            for (int p = 0; p < 3; ++p)
                s[i][j] += r[p][i] * r[p][j] / (4.0 * d[p]);
        }
    expect_near(got[0], mass, 1e-5 * mass, "the integral of a square");
    for (size_t m = 1; m < OV_GRAM; ++m)
        if (m < 4 || (m >= 10 && m < 20))
            expect_near(got[m], 0.0, 1e-5 * mass, "an odd moment");
    for (int i = 0, second = 4, fourth = 20; i < 3; ++i)
        for (int j = i; j < 3; ++j) {
            expect_near(got[second++], mass * s[i][j], 1e-5 * mass, "a second moment");
            for (int k = j; k < 3; ++k)
                for (int l = k; l < 3; ++l)
                    expect_near(got[fourth++],
                                mass * (s[i][j] * s[k][l] + s[i][k] * s[j][l] + s[i][l] * s[j][k]),
                                1e-5 * mass, "a fourth moment");
        }
    free(got);
    free(w);
    free(xyz);
    bench_destroy(&b);
}

/* Terms without packs have zero sums, whatever stood there. */
static void empty_lists_give_zeros(void **state) {
    bench b;
    test_random random = {45};
    const ov_quadric quadrics[3] = {
        {.amplitude = 1e-9, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1.0, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1.0, .centre = {500.0, 0.0, 0.0}, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
    };
    float *const xyz = random_points(&random, 100, 2.0);
    bench_create(&b, *state, quadrics, 3, xyz, 100, 1e-7);
    float *const w = random_weights(&random, &b, 1.0);
    float *const got = gram_of(&b, w);
    for (size_t m = 0; m < OV_GRAM; ++m) {
        assert_true(got[m] == 0.0f);
        assert_true(got[2 * OV_GRAM + m] == 0.0f);
    }
    assert_true(got[OV_GRAM] > 0.0f);
    free(got);
    free(w);
    free(xyz);
    bench_destroy(&b);
}

/* The same bits every time. */
static void gram_repeats_itself(void **state) {
    test_skip_simulated(*state);
    bench b;
    test_random random = {46};
    bench_random(&b, *state, MODEL_RANDOM, test_size(40, 5), test_size(3001, 165), 990);
    float *const w = random_weights(&random, &b, 1.0);
    float *const once = gram_of(&b, w), *const again = gram_of(&b, w);
    assert_memory_equal(once, again, b.terms_count * OV_GRAM * sizeof *once);
    free(once);
    free(again);
    free(w);
    bench_destroy(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_group_of_lane),
        cmocka_unit_test(gram_equals_twin),
        cmocka_unit_test(gram_of_every_list_length),
        cmocka_unit_test(fill_does_not_count),
        cmocka_unit_test(sums_are_in_the_order_of_their_monomials),
        cmocka_unit_test(gram_is_the_quadratic_form_of_the_polynomial),
        cmocka_unit_test(long_lists_do_not_drift),
        cmocka_unit_test(long_lists_are_accurate),
        cmocka_unit_test(lattice_gives_gaussian_integrals),
        cmocka_unit_test(empty_lists_give_zeros),
        cmocka_unit_test(gram_repeats_itself),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
