/*
 * Fit sessions (ovoid/fitter.h): what is prepared once, goal after goal, starts, other coordinates,
 * and stops at every question. Models are measured by ovoid_measure(), which knows nothing of fits.
 */
#include "fit/motion.h"
#include "measure/judge.h"
#include "mixture/reduce.h"
#include "once.h"
#include "support.h"

#define TOLERANCE 0.5
/* Of the points, angstrom: half as many along each axis as such small molecules have by themselves.
 * All that is here is the search's own, which takes as many steps with them. */
#define SPACING 0.7
#define PI 3.14159265358979323846
/* What another start may cost: the search takes another way. */
#define MORE 1.15

/* ---- calls are counted ---------------------------------------------------------------------- */

static struct {
    unsigned samplings, judges, reductions; /* reductions: of all atoms */
    size_t atoms;
} calls;

ovoid_status __real_ov_sample(ovoid_context *context, const double *xyzr, size_t atoms,
                              double decay, const ov_lattice *lattice, ov_band band,
                              ov_sampling sampling, ov_samples *samples);
ovoid_status __wrap_ov_sample(ovoid_context *context, const double *xyzr, size_t atoms,
                              double decay, const ov_lattice *lattice, ov_band band,
                              ov_sampling sampling, ov_samples *samples);
ovoid_status __wrap_ov_sample(ovoid_context *context, const double *xyzr, size_t atoms,
                              double decay, const ov_lattice *lattice, ov_band band,
                              ov_sampling sampling, ov_samples *samples) {
    ++calls.samplings;
    return __real_ov_sample(context, xyzr, atoms, decay, lattice, band, sampling, samples);
}

ovoid_status __real_ov_judge_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                    double decay, double isovalue, double spacing, ov_watch watch,
                                    ov_judge *judge);
ovoid_status __wrap_ov_judge_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                    double decay, double isovalue, double spacing, ov_watch watch,
                                    ov_judge *judge);
ovoid_status __wrap_ov_judge_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                    double decay, double isovalue, double spacing, ov_watch watch,
                                    ov_judge *judge) {
    ++calls.judges;
    return __real_ov_judge_create(context, xyzr, atoms, decay, isovalue, spacing, watch, judge);
}

ovoid_status __real_ov_reduction_create(ovoid_context *context, const ov_quadric *start,
                                        size_t count, size_t down_to,
                                        const ov_reduction_options *options,
                                        ov_reduction **reduction);
ovoid_status __wrap_ov_reduction_create(ovoid_context *context, const ov_quadric *start,
                                        size_t count, size_t down_to,
                                        const ov_reduction_options *options,
                                        ov_reduction **reduction);
ovoid_status __wrap_ov_reduction_create(ovoid_context *context, const ov_quadric *start,
                                        size_t count, size_t down_to,
                                        const ov_reduction_options *options,
                                        ov_reduction **reduction) {
    calls.reductions += count == calls.atoms && down_to == 1;
    return __real_ov_reduction_create(context, start, count, down_to, options, reduction);
}

static void count_calls(const ovoid_molecule *molecule) {
    memset(&calls, 0, sizeof calls);
    calls.atoms = ovoid_molecule_atoms(molecule);
}

/* ---- molecules ------------------------------------------------------------------------------- */

static ovoid_molecule *molecule_of(ovoid_context *context, const double *xyzr, size_t atoms) {
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    return molecule;
}

/* A rod of atoms as dense as a protein's with hydrogens. */
static ovoid_molecule *rod(ovoid_context *context, size_t atoms) {
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    test_random random = {5};
    for (size_t i = 0; i < atoms; ++i) {
        const double t = 2.4 * (double)i, radius = 3.0 * sqrt(random_uniform(&random, 0.0, 1.0));
        xyzr[4 * i] = radius * cos(t);
        xyzr[4 * i + 1] = radius * sin(t);
        xyzr[4 * i + 2] = 0.3 * (double)i;
        xyzr[4 * i + 3] = random_uniform(&random, 1.2, 1.8);
    }
    ovoid_molecule *const molecule = molecule_of(context, xyzr, atoms);
    free(xyzr);
    return molecule;
}

typedef struct placement {
    double angle[2], shift[3], noise; /* rotations about z, then x; uniform noise, angstrom */
} placement;

/* The molecule's coordinates there, 3 per atom, to be freed. */
static double *place(const ovoid_molecule *molecule, placement p) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double *const from = ovoid_molecule_xyzr(molecule);
    double *const xyz = test_alloc(3 * atoms, sizeof *xyz);
    test_random random = {7};
    for (size_t i = 0; i < atoms; ++i) {
        const double *const a = from + 4 * i;
        const double x = cos(p.angle[0]) * a[0] - sin(p.angle[0]) * a[1];
        const double y = sin(p.angle[0]) * a[0] + cos(p.angle[0]) * a[1];
        const double at[3] = {x, cos(p.angle[1]) * y - sin(p.angle[1]) * a[2],
                              sin(p.angle[1]) * y + cos(p.angle[1]) * a[2]};
        for (int k = 0; k < 3; ++k)
            xyz[3 * i + (size_t)k] =
                at[k] + p.shift[k] + random_uniform(&random, -p.noise, p.noise);
    }
    return xyz;
}

static ovoid_molecule *molecule_at(ovoid_context *context, const ovoid_molecule *molecule,
                                   const double *xyz) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    for (size_t i = 0; i < atoms; ++i) {
        memcpy(xyzr + 4 * i, xyz + 3 * i, 3 * sizeof *xyz);
        xyzr[4 * i + 3] = ovoid_molecule_xyzr(molecule)[4 * i + 3];
    }
    ovoid_molecule *const moved = molecule_of(context, xyzr, atoms);
    free(xyzr);
    return moved;
}

/* ---- fits ------------------------------------------------------------------------------------ */

static ovoid_fit_options options_of(ovoid_goal goal, double value) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.spacing = SPACING;
    options.adaptive.goal = goal;
    options.adaptive.tolerance = goal == OVOID_GOAL_TOLERANCE ? value : 0.5;
    options.adaptive.ellipsoids = goal == OVOID_GOAL_ELLIPSOIDS ? (uint32_t)value : 0;
    options.adaptive.ratio = goal == OVOID_GOAL_RATIO ? value : 0.1;
    options.l1.iterations = 12;
    options.l1.sparse_iterations = 6;
    return options;
}

static ovoid_fitter *fitter_of(ovoid_context *context, const ovoid_molecule *molecule) {
    const ovoid_fit_options options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    ovoid_fitter *fitter = NULL;
    test_check(context, ovoid_fitter_create(context, molecule, &options, &fitter));
    return fitter;
}

static ovoid_model *reach(ovoid_context *context, ovoid_fitter *fitter, ovoid_goal goal,
                          double value, ovoid_fit_result *result) {
    const ovoid_fit_options options = options_of(goal, value);
    ovoid_model *model = NULL;
    ovoid_fit_result_init(result, sizeof *result);
    test_check(context, ovoid_fitter_reach(context, fitter, &options, &model, result));
    assert_int_equal(ovoid_model_size(model), result->ellipsoids);
    return model;
}

static double deviation_of(ovoid_context *context, const ovoid_molecule *molecule,
                           const ovoid_model *model) {
    ovoid_measure_options measuring;
    ovoid_measures measures;
    ovoid_measures_init(&measures, sizeof measures);
    ovoid_measure_options_init(&measuring, sizeof measuring);
    test_check(context, once_measure(context, molecule, model, &measuring, &measures));
    return measures.deviation;
}

/* Returns how far the surfaces are apart. */
static double expect_holds(ovoid_context *context, const ovoid_molecule *molecule,
                           const ovoid_model *model, double tolerance) {
    const double deviation = deviation_of(context, molecule, model);
    print_message("%zu ellipsoids, %.4f\n", ovoid_model_size(model), deviation);
    assert_true(deviation <= tolerance + 1e-4);
    return deviation;
}

/* ---- goal after goal --------------------------------------------------------------------------
 */

/* To the bits of a fit alone, whatever came before. */
static void expect_as_alone(ovoid_context *context, const ovoid_molecule *molecule,
                            ovoid_fitter *fitter, const ovoid_fit_options *options) {
    ovoid_model *alone = NULL, *model = NULL;
    ovoid_fit_result wanted, result;
    ovoid_fit_result_init(&wanted, sizeof wanted);
    ovoid_fit_result_init(&result, sizeof result);
    test_check(context, ovoid_fit(context, molecule, options, &alone, &wanted));
    const unsigned before = calls.samplings;
    test_check(context, ovoid_fitter_reach(context, fitter, options, &model, &result));
    print_message("%zu ellipsoids, %u samplings\n", ovoid_model_size(model),
                  calls.samplings - before);
    expect_same_models(alone, model);
    assert_int_equal(result.iterations, wanted.iterations);
    assert_int_equal(result.adaptive.solver_iterations, wanted.adaptive.solver_iterations);
    assert_int_equal(result.points, wanted.points);
    assert_true(result.spacing == wanted.spacing);
    assert_true(result.distance == wanted.distance ||
                (isnan(result.distance) && isnan(wanted.distance)));
    ovoid_model_destroy(&alone);
    ovoid_model_destroy(&model);
}

static void each_goal_as_alone(void **state) {
    ovoid_molecule *molecule = rod(*state, 20);
    ovoid_fitter *fitter = NULL;
    ovoid_fit_options l1 = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    l1.method = OVOID_METHOD_L1;
    ovoid_fit_options goals[] = {
        options_of(OVOID_GOAL_TOLERANCE, 0.7), options_of(OVOID_GOAL_ELLIPSOIDS, 3),  l1,
        options_of(OVOID_GOAL_RATIO, 0.2),     options_of(OVOID_GOAL_TOLERANCE, 0.5), l1,
        options_of(OVOID_GOAL_TOLERANCE, 0.7)};
    for (size_t n = 0; n < sizeof goals / sizeof *goals; ++n) {
        goals[n].spacing = 0.0; /* each method's own */
        if (!fitter)
            test_check(*state, ovoid_fitter_create(*state, molecule, &goals[n], &fitter));
        expect_as_alone(*state, molecule, fitter, &goals[n]);
    }
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

static void prepared_once(void **state) {
    ovoid_molecule *molecule = rod(*state, 30);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    ovoid_fit_options l1 = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    ovoid_fit_result result;
    count_calls(molecule);
    l1.method = OVOID_METHOD_L1;
    for (int n = 1; n < 5; ++n) {
        ovoid_model *model = reach(*state, fitter, OVOID_GOAL_ELLIPSOIDS, 3.0 * n, &result);
        ovoid_model_destroy(&model);
        model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, 0.3 * n, &result);
        ovoid_model_destroy(&model);
    }
    assert_int_equal(calls.samplings, 1);
    assert_int_equal(calls.judges, 2); /* and one at a finer spacing */
    assert_int_equal(calls.reductions, 1);
    for (int n = 0; n < 3; ++n) { /* its points are others, and others again with another inside */
        ovoid_model *model = NULL;
        l1.l1.inside_every = n < 2 ? 1 : 2;
        test_check(*state, ovoid_fitter_reach(*state, fitter, &l1, &model, NULL));
        assert_int_equal(calls.samplings, n < 2 ? 2 : 3);
        ovoid_model_destroy(&model);
    }
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

/* ---- starts -----------------------------------------------------------------------------------
 */

static void tighter_and_looser(void **state) {
    ovoid_molecule *molecule = rod(*state, 60);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    ovoid_fit_result first, result;
    ovoid_model *start = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &first);
    test_check(*state, ovoid_fitter_start_from(*state, fitter, start));
    static const double tolerances[] = {TOLERANCE, 1.0, 0.3};
    for (int n = 0; n < 3; ++n) {
        ovoid_model *model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, tolerances[n], &result);
        assert_true(result.reached);
        expect_holds(*state, molecule, model, tolerances[n]);
        assert_true(tolerances[n] < TOLERANCE || result.ellipsoids <= first.ellipsoids);
        assert_true(tolerances[n] <= TOLERANCE || result.ellipsoids < first.ellipsoids);
        assert_true(expect_owners(molecule, model, 3, 0.8) <= 3);
        ovoid_model_destroy(&model);
    }
    ovoid_model_destroy(&start);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

static void to_other_numbers(void **state) {
    ovoid_molecule *molecule = rod(*state, 60);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    ovoid_fit_result first, result, alone;
    ovoid_model *start = reach(*state, fitter, OVOID_GOAL_ELLIPSOIDS, 12, &first);
    static const double numbers[] = {12, 8, 17, 1, 60};
    for (int n = 0; n < 5; ++n) {
        test_check(*state, ovoid_fitter_start_from(*state, fitter, NULL));
        ovoid_model *model = reach(*state, fitter, OVOID_GOAL_ELLIPSOIDS, numbers[n], &alone);
        ovoid_model_destroy(&model);
        test_check(*state, ovoid_fitter_start_from(*state, fitter, start));
        model = reach(*state, fitter, OVOID_GOAL_ELLIPSOIDS, numbers[n], &result);
        print_message("%.0f: %.3g apart, alone %.3g\n", numbers[n], result.distance,
                      alone.distance);
        assert_int_equal(result.ellipsoids, (size_t)numbers[n]);
        assert_true(result.reached);
        if (n == 0) /* never worse than the start; the volumes were equal */
            assert_true(result.distance <= first.distance + 1e-3);
        if (n > 0 && n < 3)
            assert_true(result.distance <= 2.0 * alone.distance);
        ovoid_model_destroy(&model);
    }
    ovoid_model_destroy(&start);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

/* A model that stands for nothing here does no harm, and one from elsewhere has no owners. */
static void starts_from_anywhere(void **state) {
    const ovoid_ellipsoid far = {
        .amplitude = 3.0, .decay = {0.2, 0.1, 0.3}, .centre = {40.0, 0.0, 0.0}};
    ovoid_molecule *molecule = rod(*state, 40);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    ovoid_model *start = NULL;
    ovoid_fit_result first, result;
    ovoid_model *alone = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &first);
    test_check(*state, ovoid_model_create(*state, &far, 1, 0.5, 1.0, &start));
    test_check(*state, ovoid_fitter_start_from(*state, fitter, start));
    ovoid_model *model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &result);
    expect_holds(*state, molecule, model, TOLERANCE);
    assert_true((double)result.ellipsoids <= MORE * (double)first.ellipsoids + 1.0);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&start);
    test_check(*state,
               ovoid_model_create(*state, ovoid_model_ellipsoids(alone), ovoid_model_size(alone),
                                  0.5, 1.0, &start)); /* without owners */
    test_check(*state, ovoid_fitter_start_from(*state, fitter, start));
    model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &result);
    expect_holds(*state, molecule, model, TOLERANCE);
    assert_true(result.ellipsoids <= first.ellipsoids);
    assert_true(expect_owners(molecule, model, 3, 0.8) <= 3); /* they were found */
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&start);
    ovoid_model_destroy(&alone);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

/* The molecule and a bead of its own beyond the end, where nothing of a model of it is felt. */
static ovoid_molecule *with_bead(ovoid_context *context, const ovoid_molecule *molecule) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    double *const xyzr = test_alloc(4 * (atoms + 1), sizeof *xyzr);
    memcpy(xyzr, ovoid_molecule_xyzr(molecule), 4 * atoms * sizeof *xyzr);
    memcpy(xyzr + 4 * atoms, (const double[4]){0.0, 0.0, -14.0, 1.2}, 4 * sizeof *xyzr);
    ovoid_molecule *const made = molecule_of(context, xyzr, atoms + 1);
    free(xyzr);
    return made;
}

/* What the ellipsoids of a start have left to itself comes back: the search need not begin anew. */
static void what_is_missed_comes_back(void **state) {
    ovoid_molecule *molecule = rod(*state, 60), *both = with_bead(*state, molecule);
    ovoid_fitter *fitter = fitter_of(*state, molecule), *other = fitter_of(*state, both);
    ovoid_fit_result first, result;
    ovoid_model *start = reach(*state, fitter, OVOID_GOAL_TOLERANCE, 0.6 * TOLERANCE, &first);
    test_check(*state, ovoid_fitter_start_from(*state, other, start));
    count_calls(both);
    ovoid_model *model = reach(*state, other, OVOID_GOAL_TOLERANCE, TOLERANCE, &result);
    assert_int_equal(calls.reductions, 0);
    assert_true(result.reached);
    expect_holds(*state, both, model, TOLERANCE);
    print_message("%llu ellipsoids, %llu with a bead\n", (unsigned long long)first.ellipsoids,
                  (unsigned long long)result.ellipsoids);
    assert_true(result.ellipsoids <= first.ellipsoids + 1);
    ovoid_model_destroy(&start);
    ovoid_model_destroy(&model);
    ovoid_fitter_destroy(&fitter);
    ovoid_fitter_destroy(&other);
    ovoid_molecule_destroy(&molecule);
    ovoid_molecule_destroy(&both);
}

/* ---- other coordinates ------------------------------------------------------------------------
 */

/* At each place as good as a fit from the atoms there, or as the first one was, within what another
 * way through the search costs. */
static void frames(void **state) {
    static const placement places[] = {{{0, 0}, {0, 0, 0}, 0},
                                       {{0.5 * PI, 1.0}, {100.0, -40.0, 7.0}, 0},
                                       {{0.5 * PI, 1.0}, {100.0, -40.0, 7.0}, 0.2},
                                       {{-1.0, 2.0}, {0, 0, 0}, 0.4}};
    ovoid_molecule *molecule = rod(*state, 60);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    ovoid_fit_result before, result, alone;
    ovoid_model *model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &before);
    const ovoid_fit_options options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    ovoid_model_destroy(&model);
    for (int n = 0; n < 4; ++n) {
        double *const xyz = place(molecule, places[n]);
        ovoid_molecule *moved = molecule_at(*state, molecule, xyz);
        ovoid_model *other = NULL;
        ovoid_fit_result_init(&alone, sizeof alone);
        test_check(*state, ovoid_fitter_move(*state, fitter, xyz));
        count_calls(moved);
        model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &result);
        assert_int_equal(calls.samplings, 1);
        assert_true(n == 3 || calls.reductions == 0); /* it began with what it had */
        test_check(*state, ovoid_fit(*state, moved, &options, &other, &alone));
        print_message("frame %d: %llu ellipsoids in %llu steps, from the atoms %llu in %llu\n", n,
                      (unsigned long long)result.ellipsoids, (unsigned long long)result.iterations,
                      (unsigned long long)alone.ellipsoids, (unsigned long long)alone.iterations);
        expect_holds(*state, moved, model, TOLERANCE);
        assert_true((double)result.ellipsoids <=
                    MORE * fmax((double)alone.ellipsoids, (double)before.ellipsoids) + 1.0);
        if (n == 0)
            assert_true(result.ellipsoids <= before.ellipsoids);
        if (n < 3) /* what a frame is for: a model that is only just within the tolerance has little
                      room for atoms that moved by themselves */
            assert_true((n < 2 ? 3 : 1) * result.iterations < alone.iterations);
        ovoid_model_destroy(&model);
        ovoid_model_destroy(&other);
        ovoid_molecule_destroy(&moved);
        free(xyz);
    }
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

/* What moves as a whole keeps its shape, whether it is a body, a plane, a line or a point, and is
 * never mirrored. */
static void motions(void **state) {
    static const int extents[][3] = {{1, 1, 1}, {1, 1, 0}, {1, 0, 0}, {0, 0, 0}};
    static const placement there = {{1.1, -2.0}, {5.0, 6.0, -7.0}, 0.0};
    test_random random = {3};
    for (int n = 0; n < 4; ++n) {
        double before[4 * 20], after[4 * 20];
        ov_motion motion;
        for (int i = 0; i < 80; ++i)
            before[i] = i % 4 < 3 && extents[n][i % 4] ? random_uniform(&random, -3.0, 3.0) : 1.0;
        ovoid_molecule *molecule = molecule_of(*state, before, 20);
        double *const xyz = place(molecule, there);
        for (size_t i = 0; i < 80; ++i)
            after[i] = i % 4 < 3 ? xyz[3 * (i / 4) + i % 4] : 1.0;
        ov_motion_of(before, after, NULL, 20, &motion);
        for (size_t i = 0; i < 20; ++i) {
            ov_quadric atom = {.amplitude = 1.0, .a = {0.5, 0.0, 0.0, 0.5, 0.0, 0.5}};
            memcpy(atom.centre, before + 4 * i, sizeof atom.centre);
            ov_motion_apply(&motion, &atom);
            for (size_t k = 0; k < 3; ++k)
                expect_near(atom.centre[k], after[4 * i + k], 1e-9, "a coordinate");
            expect_near(atom.a[0], 0.5, 1e-12, "a sphere");
            expect_near(atom.a[1], 0.0, 1e-12, "a sphere");
        }
        double(*const r)[3] = motion.rotation;
        const double det = r[0][0] * (r[1][1] * r[2][2] - r[1][2] * r[2][1]) -
                           r[0][1] * (r[1][0] * r[2][2] - r[1][2] * r[2][0]) +
                           r[0][2] * (r[1][0] * r[2][1] - r[1][1] * r[2][0]);
        expect_near(det, 1.0, 1e-9, "a determinant");
        free(xyz);
        ovoid_molecule_destroy(&molecule);
    }
}

/* Two halves that fold about a hinge: ellipsoids turn with their own. */
static void ellipsoids_go_with_their_atoms(void **state) {
    enum { HALF = 30 };
    double before[8 * HALF], after[8 * HALF];
    uint32_t owner[2 * HALF];
    test_random random = {11};
    for (int i = 0; i < 2 * HALF; ++i) {
        double *const a = before + 4 * i, *const b = after + 4 * i;
        for (int k = 0; k < 3; ++k)
            b[k] = a[k] = random_uniform(&random, -3.0, 3.0);
        a[3] = b[3] = 1.5;
        a[0] = b[0] += i < HALF ? -20.0 : 20.0;
        owner[i] = i < HALF ? 0 : 1;
        if (i >= HALF) { /* by a quarter about z */
            b[0] = -a[1];
            b[1] = a[0];
        }
    }
    ov_quadric q[2] = {{1.0, {-20.0, 1.0, 2.0}, {0.5, 0.0, 0.0, 0.2, 0.0, 0.1}},
                       {1.0, {20.0, 1.0, 2.0}, {0.5, 0.0, 0.0, 0.2, 0.0, 0.1}}};
    const ov_quadric still = q[0];
    test_check(*state, ov_move_with_atoms(*state, before, after, (size_t)2 * HALF, owner, q, 2));
    static const double turned[6] = {0.2, 0.0, 0.0, 0.5, 0.0, 0.1}, at[3] = {-1.0, 20.0, 2.0};
    for (int k = 0; k < 6; ++k) {
        expect_near(q[0].a[k], still.a[k], 1e-9, "the half that stays");
        expect_near(q[1].a[k], turned[k], 1e-9, "the half that turns");
    }
    for (int k = 0; k < 3; ++k) {
        expect_near(q[0].centre[k], still.centre[k], 1e-9, "the half that stays");
        expect_near(q[1].centre[k], at[k], 1e-9, "the half that turns");
    }
}

/* ---- stops ------------------------------------------------------------------------------------
 */

typedef struct stopper {
    unsigned asked, stop_at;
} stopper;

static bool stop_there(const ovoid_progress *progress, void *user) {
    stopper *const s = user;
    (void)progress;
    assert_true(s->stop_at == 0 || s->asked < s->stop_at); /* nobody is asked again */
    return ++s->asked != s->stop_at;
}

/* What a stop hands over is nothing, or holds. True: it held. */
static bool expect_stop(ovoid_context *context, const ovoid_molecule *molecule,
                        ovoid_fitter *fitter, const ovoid_fit_options *options, unsigned at) {
    stopper s = {.stop_at = at};
    ovoid_fit_result result, untouched;
    ovoid_model *model = (void *)&s;
    ovoid_fit_result_init(&untouched, sizeof untouched);
    memcpy(&result, &untouched, sizeof result);
    ovoid_context_on_progress(context, stop_there, &s);
    test_refused(context, ovoid_fitter_reach(context, fitter, options, &model, &result),
                 OVOID_ERROR_CANCELLED, "stopped");
    ovoid_context_on_progress(context, NULL, NULL);
    assert_int_equal(s.asked, at);
    if (!model) {
        assert_memory_equal(&result, &untouched, sizeof result);
        return false;
    }
    assert_int_equal(result.ellipsoids, ovoid_model_size(model));
    assert_int_equal(ovoid_model_owner_count(model), ovoid_molecule_atoms(molecule));
    assert_true(result.reached);
    if (options->method == OVOID_METHOD_ADAPTIVE &&
        options->adaptive.goal == OVOID_GOAL_TOLERANCE) {
        const double tolerance = options->adaptive.tolerance;
        const double deviation = expect_holds(context, molecule, model, tolerance);
        assert_true(result.distance <= tolerance);
        assert_true(result.distance >= deviation - 1e-4); /* a bound */
    } else if (options->method == OVOID_METHOD_ADAPTIVE) {
        assert_int_equal(ovoid_model_size(model), options->adaptive.ellipsoids);
    }
    ovoid_model_destroy(&model);
    return true;
}

/* How many questions a fit asks that nobody stops. *model: to be destroyed. */
static unsigned questions_of(ovoid_context *context, ovoid_fitter *fitter,
                             const ovoid_fit_options *options, ovoid_model **model) {
    stopper all = {0};
    ovoid_context_on_progress(context, stop_there, &all);
    test_check(context, ovoid_fitter_reach(context, fitter, options, model, NULL));
    ovoid_context_on_progress(context, NULL, NULL);
    return all.asked;
}

/* After a stop the next fit asks what it asks after one that came to its end, and comes to the
 * same. */
static void expect_as_many(ovoid_context *context, ovoid_fitter *fitter,
                           const ovoid_fit_options *options, unsigned asked,
                           const ovoid_model *alone) {
    ovoid_model *model = NULL;
    assert_int_equal(questions_of(context, fitter, options, &model), asked);
    expect_same_models(alone, model);
    ovoid_model_destroy(&model);
}

static void each_question_stops(void **state) {
    ovoid_molecule *molecule = rod(*state, 20);
    ovoid_fit_options l1 = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    l1.method = OVOID_METHOD_L1;
    const ovoid_fit_options goals[] = {options_of(OVOID_GOAL_TOLERANCE, TOLERANCE),
                                       options_of(OVOID_GOAL_ELLIPSOIDS, 4), l1};
    for (size_t n = 0; n < 3; ++n) {
        ovoid_fitter *fitter = fitter_of(*state, molecule);
        unsigned held = 0, tried = 0;
        stopper all = {0};
        ovoid_model *alone = NULL, *model = NULL;
        ovoid_context_on_progress(*state, stop_there, &all);
        test_check(*state, ovoid_fit(*state, molecule, &goals[n], &alone, NULL));
        ovoid_context_on_progress(*state, NULL, NULL);
        /* Of a fitter that has prepared nothing yet, each question once: then it has. */
        for (unsigned at = 1; at <= all.asked && at <= 12; ++at, ++tried) {
            held += expect_stop(*state, molecule, fitter, &goals[n], at);
            ovoid_fitter_destroy(&fitter);
            fitter = fitter_of(*state, molecule);
        }
        test_check(*state, ovoid_fitter_reach(*state, fitter, &goals[n], &model, NULL));
        expect_same_models(alone, model);
        ovoid_model_destroy(&model);
        const unsigned asked = questions_of(*state, fitter, &goals[n], &model);
        ovoid_model_destroy(&model);
        for (unsigned at = 1; at <= asked; at += 1 + asked / 16, ++tried) {
            held += expect_stop(*state, molecule, fitter, &goals[n], at);
            if (tried % 4 == 0)
                expect_as_many(*state, fitter, &goals[n], asked, alone);
        }
        held += expect_stop(*state, molecule, fitter, &goals[n], asked); /* the last one */
        print_message("goal %zu: %u questions, %u stops, %u held\n", n, asked, tried + 1, held);
        assert_true(held > 0 && held < tried);
        expect_as_many(*state, fitter, &goals[n], asked, alone); /* as if nothing had been */
        ovoid_model_destroy(&alone);
        ovoid_fitter_destroy(&fitter);
    }
    ovoid_molecule_destroy(&molecule);
}

/* One that holds from the start is there from the first judgement on. */
static void a_start_that_holds_is_kept(void **state) {
    ovoid_molecule *molecule = rod(*state, 40);
    ovoid_fitter *fitter = fitter_of(*state, molecule);
    const ovoid_fit_options options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    ovoid_fit_result result;
    stopper all = {0};
    ovoid_model *start = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &result), *model;
    test_check(*state, ovoid_fitter_start_from(*state, fitter, start));
    ovoid_context_on_progress(*state, stop_there, &all);
    model = reach(*state, fitter, OVOID_GOAL_TOLERANCE, TOLERANCE, &result);
    ovoid_context_on_progress(*state, NULL, NULL);
    unsigned held = 0, tried = 0;
    for (unsigned at = 1; at <= all.asked; at += 1 + all.asked / 20, ++tried)
        held += expect_stop(*state, molecule, fitter, &options, at);
    print_message("%u of %u stops held\n", held, tried);
    assert_true(10 * held >= 9 * tried); /* all but the first */
    ovoid_model_destroy(&start);
    ovoid_model_destroy(&model);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

/* ---- errors -----------------------------------------------------------------------------------
 */

static void refuse(ovoid_context *context, ovoid_fitter *fitter, const ovoid_fit_options *options,
                   const char *part) {
    ovoid_model *const untouched = (void *)&calls, *model = untouched;
    test_refused(context, ovoid_fitter_reach(context, fitter, options, &model, NULL),
                 OVOID_ERROR_ARGUMENT, part);
    assert_ptr_equal(model, untouched);
}

static void other_surfaces(ovoid_context *context, ovoid_fitter *fitter) {
    ovoid_fit_options options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    options.decay = 0.7;
    refuse(context, fitter, &options, "decay");
    options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    options.isovalue = 2.0;
    refuse(context, fitter, &options, "isovalue");
    options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    options.spacing = 0.5;
    refuse(context, fitter, &options, "spacing");
    options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    options.padding = 4.0;
    refuse(context, fitter, &options, "padding");
    options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    options.adaptive.mesh_spacing = 0.4;
    refuse(context, fitter, &options, "mesh_spacing");
    options = options_of(OVOID_GOAL_ELLIPSOIDS, 41);
    refuse(context, fitter, &options, "41 ellipsoids");
    options = options_of(OVOID_GOAL_TOLERANCE, -1.0);
    refuse(context, fitter, &options, "tolerance");
}

static void other_starts(ovoid_context *context, const ovoid_molecule *molecule,
                         ovoid_fitter *fitter) {
    enum { MANY = 41 };
    ovoid_ellipsoid many[MANY];
    ovoid_model *model = NULL;
    for (int i = 0; i < MANY; ++i)
        many[i] = (ovoid_ellipsoid){.amplitude = 1.0, .decay = {0.5, 0.5, 0.5}};
    assert_int_equal(ovoid_molecule_atoms(molecule), MANY - 1);
    test_check(context, ovoid_model_create(context, many, MANY, 0.5, 1.0, &model));
    test_refused(context, ovoid_fitter_start_from(context, fitter, model), OVOID_ERROR_ARGUMENT,
                 "has 41");
    ovoid_model_destroy(&model);
    test_check(context, ovoid_model_create(context, many, 1, 0.6, 1.0, &model));
    test_refused(context, ovoid_fitter_start_from(context, fitter, model), OVOID_ERROR_ARGUMENT,
                 "0.6");
    ovoid_model_destroy(&model);
}

static void errors_leave_it_usable(void **state) {
    ovoid_molecule *molecule = rod(*state, 40);
    ovoid_fitter *fitter = fitter_of(*state, molecule), *none = NULL;
    ovoid_context *other = NULL;
    ovoid_fit_options options = options_of(OVOID_GOAL_TOLERANCE, TOLERANCE);
    ovoid_model *alone = NULL, *model = NULL;
    double *const xyz = place(molecule, (placement){{1, 1}, {1, 1, 1}, 1});
    test_check(*state, ovoid_fit(*state, molecule, &options, &alone, NULL));
    for (int n = 0; n < 2; ++n) { /* before anything is prepared, and after */
        other_surfaces(*state, fitter);
        other_starts(*state, molecule, fitter);
        xyz[7] = NAN;
        test_refused(*state, ovoid_fitter_move(*state, fitter, xyz), OVOID_ERROR_ARGUMENT,
                     "y of atom 2 (from 0) is nan");
        test_check(*state, ovoid_context_create(&other));
        test_refused(other, ovoid_fitter_reach(other, fitter, &options, &model, NULL),
                     OVOID_ERROR_ARGUMENT, "another context");
        ovoid_context_destroy(&other);
        test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &model, NULL));
        expect_same_models(alone, model);
        ovoid_model_destroy(&model);
    }
    test_check(*state, ovoid_context_open_device(*state, NULL)); /* it follows */
    test_check(*state, ovoid_fitter_reach(*state, fitter, &options, &model, NULL));
    expect_same_models(alone, model);
    ovoid_model_destroy(&model);
    test_check(*state, ovoid_context_create(&other));
    test_check(other, ovoid_fitter_create(other, molecule, &options, &none));
    test_check(other, ovoid_fitter_reach(other, none, &options, &model, NULL));
    ovoid_model_destroy(&model);
    ovoid_context_destroy(&other);
    test_refused(*state, ovoid_fitter_reach(*state, none, &options, &model, NULL),
                 OVOID_ERROR_ARGUMENT, "is gone");
    test_refused(*state, ovoid_fitter_start_from(*state, none, alone), OVOID_ERROR_ARGUMENT,
                 "the context of this fitter is gone");
    test_refused(*state, ovoid_fitter_move(*state, none, xyz), OVOID_ERROR_ARGUMENT, "is gone");
    ovoid_fitter_destroy(&none);
    options.decay = -1.0;
    test_refused(*state, ovoid_fitter_create(*state, molecule, &options, &none),
                 OVOID_ERROR_ARGUMENT, "decay");
    assert_null(none);
    free(xyz);
    ovoid_model_destroy(&alone);
    ovoid_fitter_destroy(&fitter);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_goal_as_alone),
        cmocka_unit_test(prepared_once),
        cmocka_unit_test(tighter_and_looser),
        cmocka_unit_test(to_other_numbers),
        cmocka_unit_test(starts_from_anywhere),
        cmocka_unit_test(what_is_missed_comes_back),
        cmocka_unit_test(frames),
        cmocka_unit_test(motions),
        cmocka_unit_test(ellipsoids_go_with_their_atoms),
        cmocka_unit_test(each_question_stops),
        cmocka_unit_test(a_start_that_holds_is_kept),
        cmocka_unit_test(errors_leave_it_usable),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
