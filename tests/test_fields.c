/*
 * The field object: what it keeps between calls, whose it is, and what becomes of it when the
 * device or the context goes. Values are those of test_evaluate.c; here they are compared with each
 * other and, at a few points, with the sum in double.
 */
#include "support.h"

#include "ovoid/ovoid.h"

enum { ATOMS = 300, FEW = 5 };

static double xyzr[4 * ATOMS];

/* A chain: neighbours overlap. */
static ovoid_molecule *chain(ovoid_context *context) {
    ovoid_molecule *molecule = NULL;
    test_random random = {7};
    for (size_t i = 0; i < ATOMS; ++i) {
        const double at[3] = {12.0 * cos(0.13 * (double)i), 12.0 * sin(0.13 * (double)i),
                              0.1 * (double)i};
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = at[k] + random_uniform(&random, -0.5, 0.5);
        xyzr[4 * i + 3] = random_uniform(&random, 1.2, 2.0);
    }
    test_check(context, ovoid_molecule_create(context, xyzr, ATOMS, &molecule));
    return molecule;
}

static ovoid_field *field_of_chain(ovoid_context *context) {
    ovoid_molecule *molecule = chain(context);
    ovoid_field *field = NULL;
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &field));
    ovoid_molecule_destroy(&molecule); /* need not live longer */
    return field;
}

static double phi(const double at[3]) {
    double sum = 0.0;
    for (size_t i = 0; i < ATOMS; ++i) {
        const double *const a = xyzr + 4 * i, x = at[0] - a[0], y = at[1] - a[1], z = at[2] - a[2];
        sum += exp(-0.5 * (x * x + y * y + z * z - a[3] * a[3]));
    }
    return sum;
}

/* Near atom i. */
static void place(size_t i, double at[3]) {
    for (size_t k = 0; k < 3; ++k)
        at[k] = xyzr[4 * i + k] + 0.3 + 0.1 * (double)k;
}

/* ---- values --------------------------------------------------------------------------------- */

static void expect_point(ovoid_context *context, ovoid_field *field, size_t i) {
    double at[3], value, again, gradient[3];
    place(i, at);
    test_check(context, ovoid_field_evaluate(context, field, at, 1, &value, NULL));
    test_check(context, ovoid_field_evaluate(context, field, at, 1, &again, gradient));
    expect_near(value, phi(at), 5e-6 * phi(at), "a value");
    expect_near(again, value, 1e-6 * value, "the value beside a gradient");
    for (size_t k = 0; k < 3; ++k) {
        double before[3], after[3];
        memcpy(before, at, sizeof at);
        memcpy(after, at, sizeof at);
        before[k] -= 1e-4;
        after[k] += 1e-4;
        expect_near(gradient[k], (phi(after) - phi(before)) / 2e-4, 1e-4 * value + 1e-4,
                    "a gradient");
    }
}

static void one_point_after_another(void **state) {
    ovoid_field *field = field_of_chain(*state);
    assert_int_equal(ovoid_field_terms(field), ATOMS);
    assert_true(ovoid_field_decay(field) == 0.5 && ovoid_field_isovalue(field) == 1.0);
    for (size_t i = 0; i < ATOMS; i += test_size(7, 150))
        expect_point(*state, field, i);
    ovoid_field_destroy(&field);
    assert_null(field);
}

/* What the first call has put on the device stays there. */
static void later_calls_pay_for_their_points_alone(void **state) {
    ovoid_field *field = field_of_chain(*state);
    double at[3], value, gradient[3];
    place(9, at);
    test_check(*state, ovoid_field_evaluate(*state, field, at, 1, &value, gradient));
    test_check(*state, ovoid_field_evaluate(*state, field, at, 1, &value, NULL));
    const uint64_t launches = ovoid_context_count(*state, OVOID_COUNT_LAUNCHES);
    const uint64_t bytes = ovoid_context_count(*state, OVOID_COUNT_BYTES_TO_DEVICE);
    const uint64_t kernels = ovoid_context_count(*state, OVOID_COUNT_KERNELS_CREATED);
    for (int k = 0; k < 10; ++k)
        test_check(*state,
                   ovoid_field_evaluate(*state, field, at, 1, &value, k % 2 ? gradient : NULL));
    assert_int_equal(ovoid_context_count(*state, OVOID_COUNT_LAUNCHES), launches + 10);
    assert_int_equal(ovoid_context_count(*state, OVOID_COUNT_KERNELS_CREATED), kernels);
    /* A pack, its box in a tree, and the terms near it; all terms would take 19 kB a call. */
    assert_true(ovoid_context_count(*state, OVOID_COUNT_BYTES_TO_DEVICE) < bytes + 10 * 1500);
    ovoid_field_destroy(&field);
}

/* Few points find their terms on the host, many on the device: they agree. */
static void few_and_many_agree(void **state) {
    test_skip_simulated(*state);
    const size_t count = test_size(2000, 400);
    double *const xyz = test_alloc(count, 3 * sizeof *xyz);
    double *const value = test_alloc(count, sizeof *value);
    double *const gradient = test_alloc(count, 3 * sizeof *gradient);
    test_random random = {11};
    ovoid_field *field = field_of_chain(*state);
    for (size_t k = 0; k < 3 * count; ++k)
        xyz[k] = random_uniform(&random, -18.0, k % 3 == 2 ? 48.0 : 18.0);
    test_check(*state, ovoid_field_evaluate(*state, field, xyz, count, value, gradient));
    for (size_t k = 0; k + FEW <= count; k += 40 * FEW) {
        double few[FEW], slopes[3 * FEW];
        test_check(*state, ovoid_field_evaluate(*state, field, xyz + 3 * k, FEW, few, slopes));
        for (size_t j = 0; j < FEW; ++j) {
            expect_near(few[j], value[k + j], 2e-6 * value[k + j] + 1e-6, "a value of few");
            for (size_t axis = 0; axis < 3; ++axis)
                expect_near(slopes[3 * j + axis], gradient[3 * (k + j) + axis],
                            1e-5 * value[k + j] + 1e-5, "a gradient of few");
        }
    }
    ovoid_field_destroy(&field);
    free(xyz);
    free(value);
    free(gradient);
}

/* Ellipsoids of every shape; the terms that the host finds are those that count. */
static void every_kind_of_model(void **state) {
    test_skip_simulated(*state);
    enum { TERMS = 60 };
    ovoid_ellipsoid ellipsoids[TERMS];
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        test_random random = {(uint64_t)kind + 3};
        ovoid_model *model = NULL;
        ovoid_field *field = NULL;
        random_ellipsoids(&random, (model_kind)kind, 6.0, ellipsoids, TERMS);
        test_check(*state, ovoid_model_create(*state, ellipsoids, TERMS, 0.5, 0.8, &model));
        test_check(*state, ovoid_field_of_model(*state, model, &field));
        assert_true(ovoid_field_isovalue(field) == 0.8);
        for (int n = 0; n < 10; ++n) {
            double many[3 * 500], values[500], one;
            for (size_t k = 0; k < 3 * 500; ++k)
                many[k] = random_uniform(&random, -8.0, 8.0);
            test_check(*state, ovoid_field_evaluate(*state, field, many, 500, values, NULL));
            for (size_t k = 0; k < 500; k += 100) {
                test_check(*state,
                           ovoid_field_evaluate(*state, field, many + 3 * k, 1, &one, NULL));
                expect_near(one, values[k], 4e-6 * values[k] + 1e-5, model_kind_name(kind));
            }
        }
        ovoid_field_destroy(&field);
        ovoid_model_destroy(&model);
    }
}

static void far_away_there_is_nothing(void **state) {
    ovoid_field *field = field_of_chain(*state);
    const double far[6] = {1e300, -1e300, 0.0, 1e5, 0.0, 0.0};
    double value[2] = {1.0, 1.0}, gradient[6] = {1, 1, 1, 1, 1, 1};
    test_check(*state, ovoid_field_evaluate(*state, field, far, 2, value, gradient));
    for (size_t k = 0; k < 6; ++k)
        assert_true(gradient[k] == 0.0 && value[k / 3] == 0.0);
    ovoid_field_destroy(&field);
}

/* More points than the device takes at once. */
static void a_million_points(void **state) {
    if (test_small())
        skip();
    const size_t count = ((size_t)1 << 20) + 1000;
    double *const xyz = test_alloc(count, 3 * sizeof *xyz);
    double *const value = test_alloc(count, sizeof *value);
    ovoid_field *field = field_of_chain(*state);
    for (size_t k = 0; k < count; ++k)
        place(k % ATOMS, xyz + 3 * k);
    test_check(*state, ovoid_field_evaluate(*state, field, xyz, count, value, NULL));
    for (size_t k = 0; k < count; ++k)
        if (!(fabs(value[k] - value[k % ATOMS]) <= 4e-6 * value[k]))
            fail_msg("point %zu: %g, not %g", k, value[k], value[k % ATOMS]);
    ovoid_field_destroy(&field);
    free(xyz);
    free(value);
}

/* ---- what else takes it --------------------------------------------------------------------- */

/* The field's isovalue is meant where options do not name one. */
static void its_isovalue_is_the_default(void **state) {
    test_skip_simulated(*state);
    const double ball[4] = {0.0, 0.0, 0.0, 1.5};
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    ovoid_mesh_options options;
    test_check(*state, ovoid_molecule_create(*state, ball, 1, &molecule));
    test_check(*state, ovoid_field_of_molecule(*state, molecule, 0.5, 0.4, &field));
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = 0.25;
    for (int named = 0; named < 2; ++named) {
        ovoid_mesh *mesh = NULL;
        options.isovalue = named ? 2.0 : 0.0;
        const double radius = sqrt(1.5 * 1.5 - log(named ? 2.0 : 0.4) / 0.5);
        const double area = 4.0 * 3.14159265358979 * radius * radius;
        test_check(*state, ovoid_field_mesh(*state, field, &options, &mesh));
        expect_near(ovoid_mesh_smooth_area(mesh), area, 1e-3 * area, "the area of a ball");
        ovoid_mesh_destroy(&mesh);
    }
    ovoid_field_destroy(&field);
    ovoid_molecule_destroy(&molecule);
}

/* Any two fields are measured, also one with itself, and a failure says whose it is. */
static void two_fields_of_a_kind(void **state) {
    test_skip_simulated(*state);
    ovoid_field *field = field_of_chain(*state), *same = field_of_chain(*state);
    ovoid_measure_options options;
    ovoid_measures measures;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(&measures, sizeof measures);
    test_check(*state, ovoid_measure(*state, field, same, &options, &measures));
    assert_true(measures.area.error == 0.0 && measures.distances.hausdorff < 1e-4);
    test_check(*state, ovoid_measure(*state, field, field, &options, &measures));
    assert_true(measures.volume.error == 0.0);
    options.isovalue = 1e6;
    test_refused(*state, ovoid_measure(*state, field, same, &options, &measures), OVOID_ERROR_EMPTY,
                 "the surface of the first molecule: ");
    ovoid_field_destroy(&field);
    ovoid_field_destroy(&same);
}

/* ---- whose it is ---------------------------------------------------------------------------- */

static void every_function_refuses(ovoid_context *context, ovoid_field *field, const char *text) {
    const double at[3] = {0.0, 0.0, 0.0};
    double value = 42.0;
    ovoid_mesh_options meshing;
    ovoid_measure_options measuring;
    ovoid_picture_options picture;
    ovoid_measures measures;
    ovoid_mesh *mesh = NULL;
    ovoid_image *image = NULL;
    const ovoid_status wanted = OVOID_ERROR_ARGUMENT;
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    ovoid_measure_options_init(&measuring, sizeof measuring);
    ovoid_measures_init(&measures, sizeof measures);
    ovoid_picture_options_init(&picture, sizeof picture);
    test_refused(context, ovoid_field_evaluate(context, field, at, 1, &value, NULL), wanted, text);
    test_refused(context, ovoid_field_evaluate(context, field, at, 0, &value, NULL), wanted, text);
    test_refused(context, ovoid_field_mesh(context, field, &meshing, &mesh), wanted, text);
    test_refused(context, ovoid_measure(context, field, field, &measuring, &measures), wanted,
                 text);
    test_refused(context, ovoid_render(context, field, NULL, &picture, &image), wanted, text);
    test_refused(context, ovoid_field_export(context, field, "/dev/null", NULL), wanted, text);
    assert_true(value == 42.0 && !mesh && !image);
}

static void it_belongs_to_its_context(void **state) {
    ovoid_context *other = NULL;
    ovoid_field *field = field_of_chain(*state);
    assert_int_equal(ovoid_context_create(&other), OVOID_OK);
    every_function_refuses(other, field, "belongs to another context");
    expect_point(*state, field, 1);
    ovoid_context_destroy(&other);
    ovoid_field_destroy(&field);
}

/* What is left can be destroyed, in any order. */
static void the_context_may_go_first(void **state) {
    enum { FIELDS = 4 };
    ovoid_context *context = NULL;
    ovoid_field *fields[FIELDS];
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    for (int k = 0; k < FIELDS; ++k)
        fields[k] = field_of_chain(context);
    expect_point(context, fields[0], 3);
    expect_point(context, fields[2], 3);
    ovoid_field_destroy(&fields[1]); /* in the middle of the list */
    ovoid_context_destroy(&context);
    every_function_refuses(*state, fields[0], "context of this field is gone");
    assert_int_equal(ovoid_field_terms(fields[2]), ATOMS);
    ovoid_field_destroy(&fields[2]);
    ovoid_field_destroy(&fields[0]);
    ovoid_field_destroy(&fields[3]);
}

/* Opening a device again is opening another one: what lay on the first is loaded anew. */
static void it_follows_the_device(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    ovoid_field *field = field_of_chain(context);
    for (int k = 0; k < 3; ++k) {
        expect_point(context, field, 5);
        test_check(context, ovoid_context_open_device(context, NULL));
    }
    ovoid_field_destroy(&field);
    ovoid_context_destroy(&context);
}

static void bad_arguments(void **state) {
    ovoid_molecule *molecule = chain(*state);
    ovoid_field *field = NULL;
    const double bad[] = {0.0, -1.0, NAN, INFINITY};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; ++k) {
        test_refused(*state, ovoid_field_of_molecule(*state, molecule, bad[k], 1.0, &field),
                     OVOID_ERROR_ARGUMENT, "decay");
        test_refused(*state, ovoid_field_of_molecule(*state, molecule, 0.5, bad[k], &field),
                     OVOID_ERROR_ARGUMENT, "isovalue");
    }
    test_refused(*state, ovoid_field_of_molecule(*state, molecule, 90.0, 1.0, &field),
                 OVOID_ERROR_LIMIT, "atom 1: a radius of");
    assert_null(field);
    ovoid_molecule_destroy(&molecule);
    field = field_of_chain(*state);
    test_refused(*state, ovoid_field_export(*state, field, "/dev/null/a.bild", NULL),
                 OVOID_ERROR_ARGUMENT, "a molecule has no ellipsoids");
    ovoid_field_destroy(&field);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_point_after_another),
        cmocka_unit_test(later_calls_pay_for_their_points_alone),
        cmocka_unit_test(few_and_many_agree),
        cmocka_unit_test(every_kind_of_model),
        cmocka_unit_test(far_away_there_is_nothing),
        cmocka_unit_test(a_million_points),
        cmocka_unit_test(its_isovalue_is_the_default),
        cmocka_unit_test(two_fields_of_a_kind),
        cmocka_unit_test(it_belongs_to_its_context),
        cmocka_unit_test(the_context_may_go_first),
        cmocka_unit_test(it_follows_the_device),
        cmocka_unit_test(bad_arguments),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
