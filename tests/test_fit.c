/* ovoid_fit(), the public function: molecules of every kind, options, cancelling, results. */
#include "support.h"

static ovoid_fit_options short_options(void) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.method = OVOID_METHOD_L1;
    options.spacing = test_size(80, 180) / 100.0;
    options.padding = 2.0;
    options.l1.iterations = (uint32_t)test_size(60, 4);
    options.l1.sparse_iterations = (uint32_t)test_size(40, 3);
    return options;
}

static ovoid_molecule *molecule_of(ovoid_context *context, const double *xyzr, size_t atoms) {
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    return molecule;
}

static ovoid_molecule *random_molecule(ovoid_context *context, size_t atoms, uint64_t seed) {
    test_random random = {seed};
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    const double half = 1.2 * cbrt((double)atoms);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -half, half);
        xyzr[4 * i + 3] = random_uniform(&random, 1.0, 1.9);
    }
    ovoid_molecule *const molecule = molecule_of(context, xyzr, atoms);
    free(xyzr);
    return molecule;
}

/* ---- results ------------------------------------------------------------------------------ */

/* The field of the returned model, by the public function at the constrained points, has the errors
 * that the result states. */
static void expect_result(ovoid_context *context, const ovoid_molecule *molecule,
                          const ovoid_fit_options *options, const ovoid_model *model,
                          const ovoid_fit_result *result) {
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double inside = options->isovalue + 1.0;
    const ov_band band = {
        .low = options->isovalue - 1.0, .high = inside, .inside_every = options->l1.inside_every};
    const ov_sampling sampling = {0};
    ov_lattice lattice;
    ov_samples samples = {0};
    test_check(context, ov_lattice_create(context, xyzr, atoms, result->spacing, options->padding,
                                          &lattice));
    assert_true(result->spacing ==
                (options->spacing > 0.0 ? options->spacing : OVOID_DEFAULT_SPACING_L1));
    assert_true(result->reached && isnan(result->distance));
    test_check(context,
               ov_sample(context, xyzr, atoms, options->decay, &lattice, band, sampling, &samples));
    const size_t count = samples.points.count;
    assert_int_equal(samples.points.packs, (count + OV_PACK - 1) / OV_PACK);
    double *const xyz = read_places(context, &samples.points);
    double *const phi = test_alloc(count, sizeof *phi), *const fitted =
                                                            test_alloc(count, sizeof *phi);
    test_check(context,
               once_molecule_field(context, molecule, options->decay, xyz, count, phi, NULL));
    test_check(context, once_model_field(context, model, xyz, count, fitted, NULL));
    double square = 0.0, largest = 0.0;
    for (size_t k = 0; k < count; ++k) {
        const double error = ov_twin_residual(fitted[k], phi[k], inside);
        square += error * error;
        largest = fmax(largest, fabs(error));
    }
    const double rms = sqrt(square / (double)count);
    assert_int_equal(result->points, count);
    assert_int_equal(result->ellipsoids, ovoid_model_size(model));
    expect_near(result->l1.rms_error, rms, 2e-3 * rms + 1e-4, "the rms error");
    expect_near(result->l1.max_error, largest, 2e-3 * largest + 5e-4, "the largest error");
    free(xyz);
    free(phi);
    free(fitted);
    ov_samples_destroy(&samples);
}

/* Fits, checks what every result must be, and returns the largest error. */
static double fit_one(ovoid_context *context, const ovoid_molecule *molecule,
                      const ovoid_fit_options *options) {
    ovoid_model *model = NULL;
    ovoid_fit_result result;
    memset(&result, 0xff, sizeof result);
    result.size = sizeof result;
    test_check(context, ovoid_fit(context, molecule, options, &model, &result));
    assert_true(result.ellipsoids >= 1 && result.ellipsoids <= ovoid_molecule_atoms(molecule));
    assert_true(result.iterations >= 1 && result.iterations <= options->l1.iterations);
    assert_true(ovoid_model_decay(model) == options->decay);
    assert_true(ovoid_model_isovalue(model) == options->isovalue);
    assert_true(result.sample_seconds > 0.0 && result.fit_seconds > 0.0);
    assert_true(result.l1.list_builds >= 1);
    assert_true(result.l1.field_passes > result.iterations);
    assert_int_equal(result.l1.moments_passes, result.iterations);
    assert_true(result.counts[OVOID_COUNT_LAUNCHES] >=
                2 * result.l1.field_passes + result.l1.moments_passes);
    expect_result(context, molecule, options, model, &result);
    ovoid_model_destroy(&model);
    return result.l1.max_error;
}

static void result_is_consistent(void **state) {
    ovoid_molecule *molecule = random_molecule(*state, test_size(40, 4), 1);
    ovoid_fit_options options = short_options();
    fit_one(*state, molecule, &options);
    options.isovalue = 1.3;
    options.decay = 0.7;
    options.padding = 1.0;
    fit_one(*state, molecule, &options);
    ovoid_molecule_destroy(&molecule);
}

static void odd_molecules(void **state) {
    const double one[] = {5.0, 6.0, 7.0, 1.7};
    const double bare[] = {0.0, 0.0, 0.0, 0.0};
    const double mixed[] = {0.0, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 1.6, 3.0, 0.4, 0.0, 0.0};
    const double coincident[] = {1.0, 1.0, 1.0, 1.5, 1.0, 1.0, 1.0, 1.5};
    const double flat[] = {0.0, 0.0, 5.0, 1.5, 2.0, 1.0, 5.0, 1.6, -1.0, 3.0, 5.0, 1.4};
    const double far[] = {1e5, -2e5, 3e4, 1.5, 1e5 + 2.0, -2e5 - 1.0, 3e4 + 1.0, 1.7};
    const double large[] = {0.0, 0.0, 0.0, 6.0}; /* a bead of a coarse model: exp(18) */
    const struct {
        const double *xyzr;
        size_t atoms;
        double padding;
    } cases[] = {{one, 1, 2.5},   {bare, 1, 2.0},       {bare, 1, 0.0},
                 {mixed, 3, 2.0}, {coincident, 2, 3.0}, {flat, 3, 0.0},
                 {flat, 3, 2.0},  {far, 2, 2.0},        {large, 1, 7.0}};
    const size_t tried = test_simulated(*state) ? 4 : sizeof cases / sizeof cases[0];
    for (size_t n = 0; n < tried; ++n) {
        ovoid_molecule *molecule = molecule_of(*state, cases[n].xyzr, cases[n].atoms);
        ovoid_fit_options options = short_options();
        options.padding = cases[n].padding;
        const double error = fit_one(*state, molecule, &options);
        print_message("molecule %zu: largest error %.3g\n", n, error);
        ovoid_molecule_destroy(&molecule);
    }
}

/* ---- the same bits ------------------------------------------------------------------------ */

static void two_fits_give_the_same_bits(void **state) {
    test_skip_simulated(*state);
    ovoid_molecule *molecule = random_molecule(*state, test_size(60, 4), 2);
    ovoid_fit_options options = short_options();
    options.l1.prune_below = 1.6; /* so that pruning takes part */
    options.l1.prune_every = (uint32_t)test_size(5, 3);
    ovoid_model *models[3] = {0};
    for (int n = 0; n < 3; ++n) {
        ovoid_context *other = NULL;
        if (n == 2) { /* a fresh context, the device opened by the fit */
            assert_int_equal(ovoid_context_create(&other), OVOID_OK);
            test_check(other, ovoid_fit(other, molecule, &options, &models[n], NULL));
            assert_non_null(ovoid_context_device(other));
            ovoid_context_destroy(&other);
        } else {
            test_check(*state, ovoid_fit(*state, molecule, &options, &models[n], NULL));
        }
        assert_int_equal(ovoid_model_size(models[n]), ovoid_model_size(models[0]));
        assert_memory_equal(ovoid_model_ellipsoids(models[n]), ovoid_model_ellipsoids(models[0]),
                            ovoid_model_size(models[0]) * sizeof(ovoid_ellipsoid));
    }
    assert_true(ovoid_model_size(models[0]) < ovoid_molecule_atoms(molecule));
    for (int n = 0; n < 3; ++n)
        ovoid_model_destroy(&models[n]);
    ovoid_molecule_destroy(&molecule);
}

/* ---- stopping ----------------------------------------------------------------------------- */

typedef struct stop {
    uint64_t at;     /* iteration */
    uint64_t asked;  /* calls */
    double seconds;  /* of the last call */
    uint64_t points; /* of the last call while sampling */
} stop;

static bool stop_there(const ovoid_progress *progress, void *user) {
    stop *const s = user;
    ++s->asked;
    assert_true(progress->seconds >= s->seconds);
    s->seconds = progress->seconds;
    if (strcmp(progress->stage, "sample") == 0) {
        assert_int_equal(progress->iteration, 0);
        assert_true(progress->points >= s->points);
        s->points = progress->points;
    } else if (strcmp(progress->stage, "compile") != 0 && strcmp(progress->stage, "open") != 0) {
        assert_true(progress->points > 0);
    }
    return progress->iteration < s->at;
}

/* The model after the last iteration, and before the first one none. */
static void a_stopped_fit_hands_over_what_it_has(void **state) {
    test_skip_simulated(*state);
    ovoid_molecule *molecule = random_molecule(*state, 6, 3);
    const uint64_t stops[] = {0, 1, 3};
    for (size_t n = 0; n < 3; ++n) {
        stop s = {.at = stops[n]};
        ovoid_fit_options options = short_options();
        ovoid_fit_result result, untouched;
        ovoid_model *const nothing = (ovoid_model *)&s, *model = nothing;
        memset(&untouched, 0x5a, sizeof untouched);
        untouched.size = sizeof untouched;
        result = untouched;
        ovoid_context_on_progress(*state, stop_there, &s);
        test_refused(*state, ovoid_fit(*state, molecule, &options, &model, &result),
                     OVOID_ERROR_CANCELLED, "stopped");
        ovoid_context_on_progress(*state, NULL, NULL);
        assert_int_equal(model != NULL, s.at > 0);
        if (model) {
            assert_int_equal(result.iterations, s.at);
            assert_int_equal(result.ellipsoids, ovoid_model_size(model));
            assert_true(result.l1.rms_error >= 0.0 && result.l1.max_error >= 0.0);
        } else {
            assert_memory_equal(&result, &untouched, sizeof result);
        }
        ovoid_model_destroy(&model);
        assert_true(s.asked > s.at);
    }
    /* the context is fit for the next one */
    const ovoid_fit_options options = short_options();
    fit_one(*state, molecule, &options);
    ovoid_molecule_destroy(&molecule);
}

/* ---- refusals ----------------------------------------------------------------------------- */

static void expect_refusal(ovoid_context *context, const ovoid_molecule *molecule,
                           const ovoid_fit_options *options, const char *name) {
    ovoid_model *model = NULL;
    ovoid_fit_result result, untouched;
    memset(&untouched, 0x5a, sizeof untouched);
    untouched.size = sizeof untouched;
    result = untouched;
    test_refused(context, ovoid_fit(context, molecule, options, &model, &result),
                 OVOID_ERROR_ARGUMENT, name);
    assert_null(model);
    assert_memory_equal(&result, &untouched, sizeof result);
}

static void bad_options_are_named(void **state) {
    ovoid_molecule *molecule = random_molecule(*state, 3, 4);
    ovoid_fit_options o;
#define REFUSE(member, value, name)                                                                \
    do {                                                                                           \
        o = short_options();                                                                       \
        o.member = (value);                                                                        \
        expect_refusal(*state, molecule, &o, name);                                                \
    } while (0)
#define REFUSE_ODD(member, name)                                                                   \
    do {                                                                                           \
        REFUSE(member, NAN, name);                                                                 \
        REFUSE(member, -1.0, name);                                                                \
        REFUSE(member, -INFINITY, name);                                                           \
    } while (0)
    REFUSE_ODD(decay, "decay");
    REFUSE_ODD(isovalue, "isovalue");
    REFUSE_ODD(spacing, "spacing");
    REFUSE_ODD(padding, "padding");
    REFUSE_ODD(l1.epsilon, "epsilon");
    REFUSE_ODD(l1.max_error, "max_error");
    REFUSE_ODD(l1.prune_below, "prune_below");
    REFUSE_ODD(l1.armijo, "armijo");
    REFUSE_ODD(l1.shrink, "shrink");
    REFUSE_ODD(l1.grow, "grow");
    REFUSE(padding, -1.0, "option padding must not be negative; it is -1");
    REFUSE(spacing, -1e-300, "option spacing must not be negative; it is -1e-300");
    REFUSE(decay, 0.0, "option decay must be above 0; it is 0");
    REFUSE(l1.grow, NAN, "option grow must be a number; it is nan");
    REFUSE(l1.grow, 0.5, "option grow must be at least 1; it is 0.5");
    REFUSE(l1.prune_every, 0, "option prune_every must be at least 1; it is 0");
    REFUSE(spacing, INFINITY, "option spacing must be at most 1000; it is inf");
    REFUSE(method, (ovoid_method)9, "option method must be one of OVOID_METHOD_...; it is 9");
    REFUSE(decay, INFINITY, "decay");
    REFUSE(isovalue, 0.0, "isovalue");
    REFUSE(isovalue, INFINITY, "isovalue");
    REFUSE(spacing, INFINITY, "spacing");
    REFUSE(padding, INFINITY, "padding");
    REFUSE(l1.epsilon, 0.0, "epsilon");
    REFUSE(l1.epsilon, 1.5, "epsilon");
    REFUSE(l1.max_error, 0.0, "max_error");
    REFUSE(l1.armijo, 1.0, "armijo");
    REFUSE(l1.shrink, 0.0, "shrink");
    REFUSE(l1.shrink, 1.0, "shrink");
    REFUSE(l1.grow, 0.5, "grow");
    REFUSE(l1.prune_every, 0, "prune_every");
    REFUSE(l1.max_backtracks, 0, "max_backtracks");
    REFUSE(l1.sparse_iterations, 100000, "sparse_iterations");
    REFUSE(l1.first_step, (ovoid_first_step)9, "option first_step");
    REFUSE(method, (ovoid_method)9, "method");
    o = short_options();
    o.l1.iterations = o.l1.sparse_iterations = 0;
    expect_refusal(*state, molecule, &o, "iterations");
#undef REFUSE_ODD
#undef REFUSE
    ovoid_molecule_destroy(&molecule);
}

static void defaults_are_accepted(void **state) {
    test_skip_simulated(*state);
    const double xyzr[4] = {0.0, 0.0, 0.0, 1.7};
    ovoid_molecule *molecule = molecule_of(*state, xyzr, 1);
    ovoid_fit_options options;
    memset(&options, 0xff, sizeof options);
    ovoid_fit_options_init(&options, sizeof options);
    ovoid_fit_options_init(NULL, sizeof options);
    assert_true(options.decay == OVOID_DEFAULT_DECAY);
    assert_true(options.isovalue == OVOID_DEFAULT_ISOVALUE);
    assert_int_equal(options.method, OVOID_METHOD_ADAPTIVE);
    assert_true(options.spacing == 0.0); /* the method's own */
    /* the constants that the paper gives */
    assert_int_equal(options.l1.iterations, 8000);
    assert_int_equal(options.l1.sparse_iterations, 6000);
    assert_true(options.l1.max_error == 0.5 && options.l1.prune_below == 1e-3);
    assert_int_equal(options.l1.prune_every, 20);
    options.method = OVOID_METHOD_L1;
    options.l1.iterations = options.l1.sparse_iterations = 3;
    fit_one(*state, molecule, &options);
    ovoid_molecule_destroy(&molecule);
}

static void missing_arguments(void **state) {
    ovoid_molecule *molecule = random_molecule(*state, 2, 5);
    const ovoid_fit_options options = short_options();
    ovoid_model *model = NULL;
    const ovoid_status wanted = OVOID_ERROR_ARGUMENT;
    test_refused(*state, ovoid_fit(*state, NULL, &options, &model, NULL), wanted, "NULL");
    test_refused(*state, ovoid_fit(*state, molecule, NULL, &model, NULL), wanted, "NULL");
    test_refused(*state, ovoid_fit(*state, molecule, &options, NULL, NULL), wanted, "NULL");
    assert_int_equal(ovoid_fit(NULL, molecule, &options, &model, NULL), wanted);
    assert_null(model);
    ovoid_molecule_destroy(&molecule);
}

static void impossible_molecules(void **state) {
    const double bead[4] = {0.0, 0.0, 0.0, 20.0}, atom[4] = {0.0, 0.0, 0.0, 2.0};
    ovoid_model *model = NULL;
    ovoid_fit_options options = short_options();
    ovoid_molecule *molecule = molecule_of(*state, bead, 1);
    test_refused(*state, ovoid_fit(*state, molecule, &options, &model, NULL), OVOID_ERROR_LIMIT,
                 "radius");
    ovoid_molecule_destroy(&molecule);
    molecule = molecule_of(*state, atom, 1);
    options.spacing = 1e-4;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &model, NULL), OVOID_ERROR_LIMIT,
                 "points at a spacing of 0.0001 angstrom, more than 2e+10; use a spacing of about");
    ovoid_molecule_destroy(&molecule);
    options.spacing = short_options().spacing;
    options.padding = 0.0; /* one lattice point, at the centre, where phi = e^2 */
    molecule = molecule_of(*state, atom, 1);
    test_refused(*state, ovoid_fit(*state, molecule, &options, &model, NULL), OVOID_ERROR_EMPTY,
                 "no lattice point");
    ovoid_molecule_destroy(&molecule);
    assert_null(model);
}

/* Atoms as far apart as can be: each has the points, and the model, that it would have by itself.
 */
static void atoms_far_apart(void **state) {
    test_skip_simulated(*state);
    const double apart[8] = {-1e6, -1e6, -1e6, 1.7, 1e6, 1e6, 1e6, 1.7};
    const ovoid_fit_options options = short_options();
    ovoid_fit_result result;
    ovoid_fit_result_init(&result, sizeof result);
    ovoid_model *model = NULL;
    ovoid_molecule *molecule = molecule_of(*state, apart, 2);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    assert_int_equal(result.ellipsoids, 2);
    assert_true(result.points < 100000);
    for (size_t i = 0; i < 2; ++i)
        for (size_t k = 0; k < 3; ++k)
            expect_near(ovoid_model_ellipsoids(model)[i].centre[k], apart[4 * i + k], 0.3,
                        "a centre");
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* ---- real molecules ----------------------------------------------------------------------- */

/* A short fit of a molecule that may be absent: ellipsoids, errors. Bounds are twice what is
 * measured. */
static void fit_file(ovoid_context *context, const char *path, uint32_t sparse, uint32_t all,
                     size_t atoms, double rms_bound) {
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_fit_result result;
    ovoid_fit_result_init(&result, sizeof result);
    ovoid_fit_options options = short_options();
    options.spacing = 1.0;
    options.l1.sparse_iterations = sparse;
    options.l1.iterations = all;
    test_check(context, ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule));
    assert_int_equal(ovoid_molecule_atoms(molecule), atoms);
    test_check(context, ovoid_fit(context, molecule, &options, &model, &result));
    print_message("%s: %zu of %zu ellipsoids, rms %.4g, max %.3g, %zu points, %.2f s\n", path,
                  (size_t)result.ellipsoids, atoms, result.l1.rms_error, result.l1.max_error,
                  (size_t)result.points, result.fit_seconds);
    assert_true(result.l1.rms_error < rms_bound);
    expect_result(context, molecule, &options, model, &result);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

static bool readable(const char *path) {
    FILE *const file = fopen(path, "r");
    if (file)
        fclose(file);
    else
        print_message("skipped: there is no %s\n", path);
    return file != NULL;
}

/* Dimethyl sulfoxide and the protein that binds it, from the Debian package apbs-data. */
#define FKBP "/usr/share/apbs/examples/FKBP/"

static void small_molecule(void **state) {
    if (test_small() || !readable(FKBP "dmso-min.pqr"))
        skip();
    fit_file(*state, FKBP "dmso-min.pqr", 300, 400, 10, 0.14);
}

static void protein(void **state) {
    if (test_small() || !readable(FKBP "1d7h-min.pqr"))
        skip();
    fit_file(*state, FKBP "1d7h-min.pqr", 60, 90, 1663, 0.016);
}

/* The folder OVOID_MOLECULES, with the paper's molecules. */
static void fasciculin(void **state) {
    const char *const folder = getenv("OVOID_MOLECULES");
    char path[4096];
    snprintf(path, sizeof path, "%s/FAS2.pqr", folder ? folder : OVOID_MOLECULES_DEFAULT);
    if (test_small() || !readable(path))
        skip();
    fit_file(*state, path, 300, 400, 906, 0.045);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(result_is_consistent),
        cmocka_unit_test(odd_molecules),
        cmocka_unit_test(two_fits_give_the_same_bits),
        cmocka_unit_test(a_stopped_fit_hands_over_what_it_has),
        cmocka_unit_test(bad_options_are_named),
        cmocka_unit_test(defaults_are_accepted),
        cmocka_unit_test(missing_arguments),
        cmocka_unit_test(impossible_molecules),
        cmocka_unit_test(atoms_far_apart),
        cmocka_unit_test(small_molecule),
        cmocka_unit_test(protein),
        cmocka_unit_test(fasciculin),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
