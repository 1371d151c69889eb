/*
 * The kernels field, field_polynomial and field_gradient against their twins in double, and the
 * field against closed forms.
 *
 * Tolerances are multiples of FLT_EPSILON times the conditioning that the twins report
 * (ov_twin_sum): about one rounding of each exponent and one of each part of a sum.
 */
#include "model/ellipsoid.h"
#include "support.h"

/* About twice what is measured on PoCL, in all shapes. */
#define TOLERANCE 3.0

/* Kinds from MODEL_KINDS on are the same ones, far from the origin. */
enum { PLACES = 2 * MODEL_KINDS };

static const char *name_of(size_t kind) {
    return model_kind_name((model_kind)(kind % MODEL_KINDS));
}

/* Sizes that are no multiples of a pack, a tile or a group. */
static void random_bench(bench *b, ovoid_context *context, size_t kind, uint64_t seed) {
    const double near[3] = {0};
    bench_random_at(b, context, (model_kind)(kind % MODEL_KINDS), test_size(150, 20),
                    test_size(2001, 101), seed + kind, kind < MODEL_KINDS ? near : bench_far);
}

static void field_equals_twin(void **state) {
    for (size_t kind = 0; kind < PLACES; kind = test_next(*state, kind, 5)) {
        bench b;
        double worst = 0.0;
        ov_buffer value = {0};
        random_bench(&b, *state, kind, 100);
        test_check(*state, ov_field(*state, &b.operations, &b.points, &b.terms, &b.lists, &value));
        float *const got = read_floats(*state, &value, b.points.packs * OV_PACK);
        for (size_t k = 0; k < b.count; ++k)
            expect_close(got[k], ov_twin_field(b.quadrics, b.terms_count, b.xyz + 3 * k), TOLERANCE,
                         &worst, name_of(kind), k);
        for (size_t k = b.count; k < b.points.packs * OV_PACK; ++k)
            assert_true(got[k] == got[b.count - 1]); /* the fill repeats the last point */
        print_message("field, %s: %.2f of %g\n", name_of(kind), worst, TOLERANCE);
        free(got);
        ov_buffer_destroy(&value);
        bench_destroy(&b);
    }
}

/* What a user reads: relative error of an ordinary model's field, where it is not small. */
static void field_is_accurate_to_two_millionths(void **state) {
    bench b;
    double worst = 0.0;
    ov_buffer value = {0};
    bench_random(&b, *state, MODEL_RANDOM, test_size(150, 20), test_size(2001, 165), 90);
    test_check(*state, ov_field(*state, &b.operations, &b.points, &b.terms, &b.lists, &value));
    float *const got = read_floats(*state, &value, b.count);
    for (size_t k = 0; k < b.count; ++k) {
        const double wanted = ov_twin_field(b.quadrics, b.terms_count, b.xyz + 3 * k).value;
        if (wanted > 1e-2)
            worst = fmax(worst, fabs(got[k] - wanted) / wanted);
    }
    print_message("relative error %.2g\n", worst);
    assert_true(worst < 2e-6);
    free(got);
    ov_buffer_destroy(&value);
    bench_destroy(&b);
}

static void polynomial_equals_twin(void **state) {
    for (size_t kind = 0; kind < PLACES; kind = test_next(*state, kind, 5)) {
        bench b;
        double worst = 0.0;
        test_random random = {7};
        ov_buffer value = {0}, polynomial = {0};
        random_bench(&b, *state, kind, 200);
        const size_t size = b.terms_count * OV_MONOMIALS;
        float *const coefficients = test_alloc(size, sizeof *coefficients);
        for (size_t j = 0; j < size; ++j)
            coefficients[j] = (float)random_uniform(&random, -1.0, 1.0);
        write_floats(*state, &polynomial, coefficients, size);
        test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                               &polynomial, NULL, &value));
        float *const got = read_floats(*state, &value, b.count);
        for (size_t k = 0; k < b.count; ++k)
            expect_close(
                got[k],
                ov_twin_field_polynomial(b.quadrics, coefficients, b.terms_count, b.xyz + 3 * k),
                TOLERANCE, &worst, name_of(kind), k);
        print_message("field_polynomial, %s: %.2f of %g\n", name_of(kind), worst, TOLERANCE);
        free(got);
        free(coefficients);
        ov_buffer_destroy(&value);
        ov_buffer_destroy(&polynomial);
        bench_destroy(&b);
    }
}

/* One monomial at a time: each coefficient belongs to its own. */
static void polynomial_takes_each_monomial(void **state) {
    bench b;
    ov_buffer value = {0}, polynomial = {0};
    bench_random(&b, *state, MODEL_RANDOM, 3, 40, 300);
    for (size_t m = 0; m < OV_MONOMIALS; ++m) {
        float coefficients[3 * OV_MONOMIALS] = {0};
        for (size_t i = 0; i < 3; ++i)
            coefficients[i * OV_MONOMIALS + m] = 1.0f + (float)i;
        write_floats(*state, &polynomial, coefficients, 3 * OV_MONOMIALS);
        test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                               &polynomial, NULL, &value));
        float *const got = read_floats(*state, &value, b.count);
        for (size_t k = 0; k < b.count; ++k)
            expect_close(got[k],
                         ov_twin_field_polynomial(b.quadrics, coefficients, 3, b.xyz + 3 * k),
                         TOLERANCE, NULL, "monomial", m);
        free(got);
    }
    ov_buffer_destroy(&value);
    ov_buffer_destroy(&polynomial);
    bench_destroy(&b);
}

/* The sum is multiplied once, at the end: to the last bit what the host makes of it. A weight of 0
 * leaves nothing, at the fill neither. */
static void polynomial_is_weighted(void **state) {
    bench b;
    double worst = 0.0;
    test_random random = {8};
    ov_buffer plain = {0}, weighted = {0}, polynomial = {0}, weights = {0};
    random_bench(&b, *state, MODEL_RANDOM, 350);
    const size_t size = b.terms_count * OV_MONOMIALS, all = b.points.packs * OV_PACK;
    float *const coefficients = test_alloc(size, sizeof *coefficients);
    float *const weight = test_alloc(all, sizeof *weight);
    for (size_t j = 0; j < size; ++j)
        coefficients[j] = (float)random_uniform(&random, -1.0, 1.0);
    for (size_t k = 0; k < b.count; ++k)
        weight[k] = k % 7 ? (float)random_uniform(&random, -2.0, 2.0) : 0.0f;
    write_floats(*state, &polynomial, coefficients, size);
    write_floats(*state, &weights, weight, all);
    test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                           &polynomial, &weights, &weighted));
    test_check(*state, ov_field_polynomial(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                           &polynomial, NULL, &plain));
    float *const got = read_floats(*state, &weighted, all), *const sum =
                                                                read_floats(*state, &plain, all);
    for (size_t k = 0; k < all; ++k) {
        const float product = weight[k] * sum[k];
        assert_true(got[k] == product);
    }
    for (size_t k = 0; k < b.count; ++k) {
        ov_twin_sum wanted =
            ov_twin_field_polynomial(b.quadrics, coefficients, b.terms_count, b.xyz + 3 * k);
        wanted.value *= weight[k];
        wanted.scale *= fabs((double)weight[k]);
        expect_close(got[k], wanted, TOLERANCE, &worst, "weighted value", k);
    }
    print_message("field_polynomial with weights: %.2f of %g\n", worst, TOLERANCE);
    free(got);
    free(sum);
    free(coefficients);
    free(weight);
    ov_buffer_destroy(&plain);
    ov_buffer_destroy(&weighted);
    ov_buffer_destroy(&polynomial);
    ov_buffer_destroy(&weights);
    bench_destroy(&b);
}

static void gradient_equals_twin(void **state) {
    for (size_t kind = 0; kind < PLACES; kind = test_next(*state, kind, 5)) {
        bench b;
        double worst = 0.0;
        ov_buffer value = {0}, gradient = {0};
        random_bench(&b, *state, kind, 400);
        test_check(*state, ov_field_gradient(*state, &b.operations, &b.points, &b.terms, &b.lists,
                                             &value, &gradient));
        float *const got = read_floats(*state, &value, b.count);
        float *const slope = read_floats(*state, &gradient, b.points.packs * 3 * OV_PACK);
        for (size_t k = 0; k < b.count; ++k) {
            ov_twin_sum wanted[3];
            const double *const y = b.xyz + 3 * k;
            ov_twin_gradient(b.quadrics, b.terms_count, y, wanted);
            expect_close(got[k], ov_twin_field(b.quadrics, b.terms_count, y), TOLERANCE, &worst,
                         "value", k);
            for (size_t axis = 0; axis < 3; ++axis)
                expect_close(slope[k / OV_PACK * (3 * OV_PACK) + axis * OV_PACK + k % OV_PACK],
                             wanted[axis], TOLERANCE, &worst, "gradient", k);
        }
        print_message("field_gradient, %s: %.2f of %g\n", name_of(kind), worst, TOLERANCE);
        free(got);
        free(slope);
        ov_buffer_destroy(&value);
        ov_buffer_destroy(&gradient);
        bench_destroy(&b);
    }
}

/* With a real cut-off each term may be missing by less than the cut-off, and never adds anything.
 */
static void cut_off_loses_less_than_it_says(void **state) {
    const double cutoff = 1e-3;
    bench b;
    test_random random = {8};
    ov_buffer value = {0};
    const size_t terms = test_size(100, 20), count = test_size(1500, 200);
    ovoid_ellipsoid *const ellipsoids = test_alloc(terms, sizeof *ellipsoids);
    ov_quadric *const quadrics = test_alloc(terms, sizeof *quadrics);
    random_ellipsoids(&random, MODEL_RANDOM, 8.0, ellipsoids, terms);
    for (size_t i = 0; i < terms; ++i)
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadrics[i]);
    float *const xyz = random_points(&random, count, 7.9);
    bench_create(&b, *state, quadrics, terms, xyz, count, cutoff);
    assert_true(b.lists.items > 0 && b.lists.items < terms * b.points.packs);
    test_check(*state, ov_field(*state, &b.operations, &b.points, &b.terms, &b.lists, &value));
    float *const got = read_floats(*state, &value, count);
    for (size_t k = 0; k < count; ++k) {
        double left_out = 0.0;
        const ov_twin_sum wanted = ov_twin_field(quadrics, terms, b.xyz + 3 * k);
        const double rounding = TOLERANCE * FLT_EPSILON * wanted.scale;
        for (size_t i = 0; i < terms; ++i) {
            const double e =
                quadrics[i].amplitude * exp(-ov_twin_exponent(&quadrics[i], b.xyz + 3 * k));
            left_out += e < cutoff * (1.0 + 1e-4) ? e : 0.0;
        }
        assert_true(got[k] <= wanted.value + rounding);
        assert_true(got[k] >= wanted.value - left_out - rounding);
    }
    free(got);
    free(xyz);
    free(quadrics);
    free(ellipsoids);
    ov_buffer_destroy(&value);
    bench_destroy(&b);
}

static float *evaluate(bench *b, ovoid_context *context) {
    ov_buffer value = {0};
    test_check(context,
               ov_field(context, &b->operations, &b->points, &b->terms, &b->lists, &value));
    float *const got = read_floats(context, &value, b->points.packs * OV_PACK);
    ov_buffer_destroy(&value);
    return got;
}

/* One term whose exponent is exactly k^2 / 2^16 at x = k / 2^8: what is left is exp2 alone, from
 * 2^127 to 2^-126. */
static void exponential_is_accurate_over_its_range(void **state) {
    const size_t step = test_size(1, 17), count = 4071 / step + 1;
    const double log2_e = 1.4426950408889634;
    const ov_quadric quadric = {.amplitude = ldexp(1.0, 127),
                                .a = {1.0 / log2_e, 0.0, 0.0, 1.0 / log2_e, 0.0, 1.0 / log2_e}};
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < count; ++k)
        xyz[3 * k] = (float)(k * step) / 256.0f;
    bench b;
    bench_create(&b, *state, &quadric, 1, xyz, count, 1e-40);
    float *const got = evaluate(&b, *state);
    double worst = 0.0;
    for (size_t k = 0; k < count; ++k) {
        const double wanted = exp2(127.0 - b.xyz[3 * k] * b.xyz[3 * k]);
        worst = fmax(worst, fabs(got[k] - wanted) / wanted);
    }
    print_message("relative error of 2^t: %.3g\n", worst);
    assert_true(worst < 2.3e-7);
    free(got);
    free(xyz);
    bench_destroy(&b);
}

/* Far below the range: nothing wraps around, nothing is NaN, the value is as good as zero. */
static void exponential_vanishes_below_its_range(void **state) {
    enum { COUNT = 200 };
    const ov_quadric quadric = {.amplitude = 1.0, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}};
    float xyz[3 * COUNT] = {0};
    for (size_t k = 0; k < COUNT; ++k)
        xyz[3 * k] = 9.5f * powf(1.2f, (float)k / 4.0f); /* to 8e4: q to 6e9 */
    const double origin[3] = {0};
    bench b = {.context = *state};
    double *const wide = widen_points(xyz, COUNT);
    test_check(*state, ov_points_create(*state, wide, COUNT, origin, 0.5, &b.points));
    test_check(*state, ov_terms_set(*state, &b.terms, &quadric, 1, origin, 1e-37));
    free(wide);
    /* All points in one list, however far: a reach as if there were no cut-off. */
    b.terms.host[0].reach = 1e30f;
    test_check(*state, ov_buffer_write(*state, &b.terms.device, 0, b.terms.host, sizeof(ov_term)));
    test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, 0.0));
    assert_int_equal(b.lists.items, b.points.packs);
    float *const got = evaluate(&b, *state);
    for (size_t k = 0; k < b.points.packs * OV_PACK; ++k)
        assert_true(got[k] >= 0.0f && got[k] <= 1.2e-38f);
    free(got);
    bench_destroy(&b);
}

static void direction(test_random *random, double unit[3]) {
    double length;
    do {
        length = 0.0;
        for (int k = 0; k < 3; ++k) {
            unit[k] = random_uniform(random, -1.0, 1.0);
            length += unit[k] * unit[k];
        }
    } while (length > 1.0 || length < 0.01);
    for (int k = 0; k < 3; ++k)
        unit[k] /= sqrt(length);
}

/* phi = c on the sphere of radius sqrt(r^2 - ln c / d). */
static void atom_is_a_sphere(void **state) {
    const double decays[] = {0.3, 0.5, 0.7, 2.0}, isovalues[] = {0.25, 0.5, 1.0, 1.5};
    enum { COUNT = 50 };
    test_random random = {9};
    for (size_t n = 0; n < 16; n = test_next(*state, n, 5)) {
        const double d = decays[n % 4], c = isovalues[n / 4], r = 1.7;
        const double xyzr[4] = {0.0, 0.0, 0.0, r}, radius = sqrt(r * r - log(c) / d);
        ov_quadric quadric;
        float xyz[3 * COUNT];
        ov_quadric_of_atom(xyzr, d, &quadric);
        for (int k = 0; k < COUNT; ++k) {
            double unit[3];
            direction(&random, unit);
            for (int axis = 0; axis < 3; ++axis)
                xyz[3 * k + axis] = (float)(radius * unit[axis]);
        }
        bench b;
        bench_create(&b, *state, &quadric, 1, xyz, COUNT, 1e-7);
        float *const got = evaluate(&b, *state);
        /* the points' own rounding moves phi by 2 d R dR */
        for (int k = 0; k < COUNT; ++k)
            expect_near(got[k], c, c * FLT_EPSILON * (4.0 + 6.0 * d * radius * radius),
                        "phi on an atom's sphere");
        free(got);
        bench_destroy(&b);
    }
}

/* The semi-axes of the surface of one ellipsoid are sqrt(ln(a / c) / d_p) along the rows of R. */
static void ellipsoid_has_its_semi_axes(void **state) {
    test_random random = {10};
    for (size_t n = 0; n < 12; n = test_next(*state, n, 4)) {
        const double c = random_uniform(&random, 0.5, 1.5);
        ovoid_ellipsoid ellipsoid;
        ov_quadric quadric;
        double r[3][3];
        float xyz[18];
        random_ellipsoids(&random, MODEL_RANDOM, 0.0, &ellipsoid, 1);
        ellipsoid.amplitude = exp(random_uniform(&random, 1.0, 3.0));
        ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
        ov_twin_rotation(ellipsoid.angle, r);
        for (int p = 0; p < 3; ++p)
            for (int end = 0; end < 2; ++end)
                for (int axis = 0; axis < 3; ++axis)
                    xyz[3 * (2 * p + end) + axis] =
                        (float)((end ? -1.0 : 1.0) *
                                sqrt(log(ellipsoid.amplitude / c) / ellipsoid.decay[p]) *
                                r[p][axis]);
        bench b;
        bench_create(&b, *state, &quadric, 1, xyz, 6, 1e-7);
        float *const got = evaluate(&b, *state);
        for (int k = 0; k < 6; ++k) {
            const double scale = ov_twin_field(&quadric, 1, b.xyz + 3 * k).scale;
            expect_near(got[k], c, 4.0 * FLT_EPSILON * scale, "phi~ at the end of a semi-axis");
        }
        free(got);
        bench_destroy(&b);
    }
}

static void coincident_atoms_add_up(void **state) {
    enum { ATOMS = 37, COUNT = 70 };
    const double xyzr[4] = {0.5, -0.25, 1.0, 1.5};
    test_random random = {11};
    ov_quadric quadrics[ATOMS];
    float *const xyz = random_points(&random, COUNT, 3.0);
    for (int i = 0; i < ATOMS; ++i)
        ov_quadric_of_atom(xyzr, 0.5, &quadrics[i]);
    bench one, many;
    bench_create(&one, *state, quadrics, 1, xyz, COUNT, 1e-37);
    bench_create(&many, *state, quadrics, ATOMS, xyz, COUNT, 1e-37);
    float *const single = evaluate(&one, *state), *const all = evaluate(&many, *state);
    for (int k = 0; k < COUNT; ++k)
        expect_near(all[k], ATOMS * (double)single[k],
                    ATOMS * 0.5 * FLT_EPSILON * ATOMS * single[k], "the field of coincident atoms");
    free(single);
    free(all);
    free(xyz);
    bench_destroy(&one);
    bench_destroy(&many);
}

/* A crystal's or a capsid's coordinates: the origin takes the offset away before rounding. */
static void far_from_the_origin(void **state) {
    const double origin[3] = {100000.5, -20000.25, 3000.125};
    enum { COUNT = 100, TERMS = 10 };
    test_random random = {12};
    ovoid_ellipsoid ellipsoids[TERMS];
    ov_quadric near[TERMS], far[TERMS];
    ov_points points = {0};
    ov_terms terms = {0};
    ov_lists lists = {0};
    ov_operations operations = {0};
    ov_buffer value = {0};
    random_ellipsoids(&random, MODEL_RANDOM, 3.0, ellipsoids, TERMS);
    for (int i = 0; i < TERMS; ++i) {
        ov_quadric_of_ellipsoid(&ellipsoids[i], &near[i]);
        far[i] = near[i];
        for (int k = 0; k < 3; ++k)
            far[i].centre[k] += origin[k];
    }
    float *const xyz = random_points(&random, COUNT, 4.0);
    double *const wide = widen_points(xyz, COUNT);
    for (size_t k = 0; k < 3 * COUNT; ++k)
        wide[k] += origin[k % 3];
    test_check(*state, ov_points_create(*state, wide, COUNT, origin, 0.5, &points));
    free(wide);
    test_check(*state, ov_terms_set(*state, &terms, far, TERMS, origin, 1e-37));
    test_check(*state, ov_lists_build(*state, &lists, &points, &terms, 0.0));
    test_check(*state, ov_field(*state, &operations, &points, &terms, &lists, &value));
    float *const got = read_floats(*state, &value, COUNT);
    for (size_t k = 0; k < COUNT; ++k) {
        const float *const p = xyz + 3 * (size_t)points.order[k];
        const double y[3] = {p[0], p[1], p[2]};
        expect_close(got[k], ov_twin_field(near, TERMS, y), TOLERANCE, NULL, "value", k);
    }
    free(got);
    free(xyz);
    ov_points_destroy(&points);
    ov_terms_destroy(&terms);
    ov_lists_destroy(&lists);
    ov_operations_destroy(&operations);
    ov_buffer_destroy(&value);
}

static void degenerate_terms_are_refused(void **state) {
    const double origin[3] = {0};
    const ov_quadric good = {.amplitude = 1.0, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}};
    enum { CASES = 8 };
    ov_quadric bad[CASES];
    for (int n = 0; n < CASES; ++n)
        bad[n] = good;
    bad[0].amplitude = 0.0;
    bad[1].amplitude = -1.0;
    bad[2].amplitude = NAN;
    bad[3].centre[1] = INFINITY;
    bad[4].a[3] = -1.0;
    bad[5].a[1] = 2.0; /* indefinite */
    bad[6].a[5] = NAN;
    bad[7].amplitude = INFINITY;
    for (int n = 0; n < CASES; ++n) {
        ov_terms terms = {0};
        const ov_quadric quadrics[2] = {good, bad[n]};
        test_refused(*state, ov_terms_set(*state, &terms, quadrics, 2, origin, 1e-7),
                     OVOID_ERROR_NUMERIC, "ellipsoid 2");
        ov_terms_destroy(&terms);
    }
}

/* A needle or pancake whose long axes decay 1e-8 times as fast as its short ones is still a
 * Gaussian, however it is turned. */
static void thin_terms_are_accepted(void **state) {
    const double origin[3] = {0};
    const double decays[][3] = {{1e-8, 1e-8, 4.0}, {4.0, 1e-8, 4.0}, {1e-8, 1e-8, 100.0}};
    test_random random = {13};
    for (int n = 0; n < 300; ++n) {
        ov_terms terms = {0};
        ov_quadric quadric;
        ovoid_ellipsoid ellipsoid;
        random_ellipsoids(&random, MODEL_RANDOM, 3.0, &ellipsoid, 1);
        memcpy(ellipsoid.decay, decays[n % 3], sizeof ellipsoid.decay);
        ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
        test_check(*state, ov_terms_set(*state, &terms, &quadric, 1, origin, 1e-7));
        ov_terms_destroy(&terms);
    }
}

/* More than single precision holds: an error, not a wrong number. */
static void amplitudes_beyond_single_precision(void **state) {
    const double origin[3] = {0};
    ov_quadric quadric = {.amplitude = 1e38, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}};
    ov_terms terms = {0};
    test_check(*state, ov_terms_set(*state, &terms, &quadric, 1, origin, 1e-7));
    quadric.amplitude = 1e39;
    test_refused(*state, ov_terms_set(*state, &terms, &quadric, 1, origin, 1e-7),
                 OVOID_ERROR_NUMERIC, "ellipsoid 1");
    ov_terms_destroy(&terms);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(field_equals_twin),
        cmocka_unit_test(field_is_accurate_to_two_millionths),
        cmocka_unit_test(polynomial_equals_twin),
        cmocka_unit_test(polynomial_takes_each_monomial),
        cmocka_unit_test(polynomial_is_weighted),
        cmocka_unit_test(gradient_equals_twin),
        cmocka_unit_test(cut_off_loses_less_than_it_says),
        cmocka_unit_test(exponential_is_accurate_over_its_range),
        cmocka_unit_test(exponential_vanishes_below_its_range),
        cmocka_unit_test(atom_is_a_sphere),
        cmocka_unit_test(ellipsoid_has_its_semi_axes),
        cmocka_unit_test(coincident_atoms_add_up),
        cmocka_unit_test(far_from_the_origin),
        cmocka_unit_test(degenerate_terms_are_refused),
        cmocka_unit_test(thin_terms_are_accepted),
        cmocka_unit_test(amplitudes_beyond_single_precision),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
