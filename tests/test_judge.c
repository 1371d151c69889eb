/*
 * Judging models by their surfaces: spheres, whose areas, volumes and distances are known.
 */
#include "measure/judge.h"
#include "support.h"

#define PI 3.14159265358979323846

static ov_quadric *quadrics_of(const double *xyzr, size_t atoms, double decay) {
    ov_quadric *const quadrics = test_alloc(atoms, sizeof *quadrics);
    for (size_t i = 0; i < atoms; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, decay, &quadrics[i]);
    return quadrics;
}

/* Too far apart to know of one another. */
static const double two[8] = {1.0, 2.0, 3.0, 1.7, 11.0, 2.0, 3.0, 1.4};

static double spacing(void) {
    return test_small() ? 0.65 : 0.35; /* features are 2.3 steps: no finer lattice for them */
}

static void judge_atoms(ovoid_context *context, const double *xyzr, size_t atoms, double decay,
                        double isovalue, ov_judge *judge) {
    memset(judge, 0, sizeof *judge);
    test_check(context, ov_judge_create(context, xyzr, atoms, decay, isovalue, spacing(),
                                        (ov_watch){0}, judge));
}

static ov_judgement judgement_of(ovoid_context *context, ov_judge *judge,
                                 const ov_quadric *quadrics, size_t count) {
    ov_judgement judgement;
    test_check(context, ov_judge_model(judge, quadrics, count, &judgement));
    return judgement;
}

static void expect_invalid(const ov_judgement *judgement) {
    assert_false(judgement->valid);
    assert_true(judgement->deviation == INFINITY && judgement->hausdorff == INFINITY &&
                judgement->score == INFINITY);
}

/* ---- judgements --------------------------------------------------------------------------- */

static void the_same_is_the_same(void **state) {
    const double xyzr[] = {0, 0, 0, 1.7, 1.5, 0.3, 0, 1.5, 0.2, 1.4, -0.5, 1.2, 8, 0, 0, 1.2};
    const double decays[] = {0.5, 0.5, 0.9}, isovalues[] = {1.0, 0.6, 1.3};
    for (size_t n = 0; n < test_size(3, 1); ++n) {
        ov_judge judge;
        judge_atoms(*state, xyzr, 4, decays[n], isovalues[n], &judge);
        ov_quadric *const quadrics = quadrics_of(xyzr, 4, decays[n]);
        const ov_judgement got = judgement_of(*state, &judge, quadrics, 4);
        assert_true(got.valid);
        expect_near(got.deviation, 0.0, 1e-4, "deviation");
        expect_near(got.hausdorff, 0.0, 1e-4, "hausdorff");
        expect_near(got.area_error, 0.0, 1e-6, "area");
        expect_near(got.volume_ratio, 1.0, 1e-6, "volume");
        expect_near(got.score, 0.0, 1e-4, "score");
        double ratio = NAN;
        test_check(*state, ov_judge_volume(&judge, quadrics, 4, &ratio));
        assert_true(ratio == got.volume_ratio);
        free(quadrics);
        ov_judge_destroy(&judge);
    }
}

/* One of two spheres left out: its far side is furthest from what is left. */
static void a_missing_piece(void **state) {
    ov_judge judge;
    judge_atoms(*state, two, 2, 0.5, 1.0, &judge);
    ov_quadric *const quadrics = quadrics_of(two, 2, 0.5);
    const double r = two[3], s = two[7];
    const double far = 10.0 + s - r, volume = r * r * r / (r * r * r + s * s * s),
                 area = s * s / (r * r + s * s);
    const ov_judgement got = judgement_of(*state, &judge, quadrics, 1);
    assert_true(got.valid);
    expect_near(got.deviation, far, test_size(2, 8) * 0.01, "deviation");
    expect_near(got.hausdorff, got.deviation, 0.0, "hausdorff");
    expect_near(got.volume_ratio, volume, test_size(1, 30) * 1e-3, "volume");
    expect_near(got.area_error, area, test_size(1, 30) * 1e-3, "area");
    expect_near(got.score, got.deviation + 10.0 * got.area_error, 1e-9, "score");

    ov_spot *spots = NULL;
    size_t count = 0;
    ov_judgement again;
    test_check(*state, ov_judge_spots(&judge, quadrics, 1, 5.0, 1.0, 3, &again, &spots, &count));
    assert_true(again.valid && again.deviation == got.deviation);
    assert_true(again.hausdorff == got.hausdorff);
    assert_true(isnan(again.area_error) && isnan(again.volume_ratio) && isnan(again.score));
    assert_int_equal(count, 3);
    expect_near(spots[0].distance, got.deviation, 0.0, "the first spot's distance");
    const double place[3] = {11.0 + s, 2.0, 3.0};
    for (int k = 0; k < 3; ++k)
        expect_near(spots[0].at[k], place[k], test_small() ? 0.5 : 0.25, "the first spot");
    free(spots);
    free(quadrics);
    ov_judge_destroy(&judge);
}

static double distance(const double a[3], const double b[3]) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* One of two spheres grown: all around it, and nowhere else. */
static void a_grown_piece(void **state) {
    test_skip_simulated(*state); /* as a missing piece, but for the host */
    const double growth = 0.3, r = two[3], s = two[7];
    double grown[8];
    memcpy(grown, two, sizeof grown);
    grown[7] += growth;
    ov_judge judge;
    judge_atoms(*state, two, 2, 0.5, 1.0, &judge);
    ov_quadric *const quadrics = quadrics_of(grown, 2, 0.5);
    ov_spot *spots = NULL;
    size_t count = 0;
    ov_judgement bounded;
    const double apart = 1.0;
    const ov_judgement got = judgement_of(*state, &judge, quadrics, 2);
    assert_true(got.valid);
    /* Triangles are flat: the outer one's vertices are further away from those of the inner one. */
    assert_true(got.deviation > growth - 1e-3);
    expect_near(got.deviation, growth, 0.3 * spacing() * spacing(), "deviation");
    expect_near(got.volume_ratio, (r * r * r + pow(s + growth, 3.0)) / (r * r * r + s * s * s),
                test_size(1, 20) * 1e-3, "volume");
    expect_near(got.area_error, ((s + growth) * (s + growth) - s * s) / (r * r + s * s),
                test_size(1, 20) * 1e-3, "area");
    test_check(*state,
               ov_judge_spots(&judge, quadrics, 2, 0.2, apart, 100, &bounded, &spots, &count));
    assert_true(bounded.deviation == got.deviation && bounded.hausdorff == got.hausdorff);
    print_message("%zu spots\n", count);
    assert_true(count >= 6 && count < 100);
    bool of_model = false; /* those of the original alone are in a_missing_piece() */
    for (size_t n = 0; n < count; ++n) {
        const double from = distance(spots[n].at, two + 4);
        assert_true(spots[n].distance >= 0.2 && spots[n].distance <= got.deviation);
        assert_true(n == 0 || spots[n].distance <= spots[n - 1].distance);
        assert_true(fabs(from - s) < 1e-3 || fabs(from - s - growth) < 1e-3);
        of_model = of_model || from > s + 0.5 * growth;
        for (size_t m = 0; m < n; ++m)
            assert_true(distance(spots[n].at, spots[m].at) >= apart);
    }
    assert_true(of_model);
    free(spots);
    test_check(*state,
               ov_judge_spots(&judge, quadrics, 2, 0.6, apart, 100, &bounded, &spots, &count));
    assert_int_equal(count, 0); /* nothing is that far, and how far it is does not matter */
    assert_true(bounded.deviation >= got.deviation && bounded.deviation < 0.6);
    free(spots);
    test_check(*state, ov_judge_spots(&judge, quadrics, 2, 0.1, 0.0, 7, &bounded, &spots, &count));
    assert_int_equal(count, 7);
    free(spots);
    free(quadrics);
    ov_judge_destroy(&judge);
}

enum { SHELL = 60 };

/* Atoms on a sphere, and one in the middle that fills it. */
static void shell_of_atoms(double radius, double filling, double xyzr[4 * (SHELL + 1)]) {
    for (size_t i = 0; i < SHELL; ++i) {
        const double z = 1.0 - (2.0 * (double)i + 1.0) / SHELL, turn = 2.399963 * (double)i;
        const double rho = radius * sqrt(1.0 - z * z);
        const double at[4] = {rho * cos(turn), rho * sin(turn), radius * z, 1.5};
        memcpy(xyzr + 4 * i, at, sizeof at);
    }
    memset(xyzr + 4 * SHELL, 0, 3 * sizeof *xyzr);
    xyzr[4 * SHELL + 3] = filling;
}

/* A cavity that the model fills: the outer surface is as it was, the whole one is not. */
static void a_filled_cavity(void **state) {
    if (test_small()) /* a shell takes many atoms */
        skip();
    double xyzr[4 * (SHELL + 1)];
    shell_of_atoms(4.5, 2.4, xyzr);
    ov_judge judge;
    judge_atoms(*state, xyzr, SHELL, 0.5, 1.0, &judge);
    ov_quadric *const quadrics = quadrics_of(xyzr, SHELL + 1, 0.5);
    const ov_judgement got = judgement_of(*state, &judge, quadrics, SHELL + 1);
    print_message("deviation %g, hausdorff %g, volumes %g\n", got.deviation, got.hausdorff,
                  got.volume_ratio);
    assert_true(got.valid);
    expect_near(got.deviation, 0.0, 0.01, "deviation");
    assert_true(got.hausdorff > 1.0);
    assert_true(got.volume_ratio > 1.02);
    expect_near(got.score,
                got.deviation + 0.1 * (got.hausdorff - got.deviation) + 10.0 * got.area_error, 1e-9,
                "score");
    ov_spot *spots = NULL;
    size_t count = 1;
    ov_judgement again;
    test_check(*state,
               ov_judge_spots(&judge, quadrics, SHELL + 1, 0.5, 1.0, 9, &again, &spots, &count));
    assert_int_equal(count, 0); /* spots are of outer surfaces */
    free(spots);
    judge.whole = true; /* unless walls of cavities count, too */
    test_check(*state,
               ov_judge_spots(&judge, quadrics, SHELL + 1, 0.5, 1.0, 9, &again, &spots, &count));
    assert_true(count > 0);
    /* spots are looked for on rougher meshes */
    expect_near(spots[0].distance, got.hausdorff, 1e-4, "furthest spot");
    expect_near(again.deviation, got.hausdorff, 1e-4, "deviation of the whole");
    free(spots);
    free(quadrics);
    ov_judge_destroy(&judge);
}

/* A shell that lacks an atom, so that its inside is open by a neck that the lattice of 0.5 angstrom
 * misses: it is told from a cavity all the same, and a model that fills it is off, at any spacing.
 */
static void a_cavity_that_is_open(void **state) {
    if (test_small())
        skip();
    double xyzr[4 * (SHELL + 1)];
    shell_of_atoms(5.15, 3.0, xyzr);
    memmove(xyzr + 4 * (SHELL / 2), xyzr + 4 * (SHELL / 2 + 1), 4 * (SHELL / 2) * sizeof *xyzr);
    const size_t atoms = SHELL - 1;
    ov_quadric *const quadrics = quadrics_of(xyzr, atoms + 1, 0.5);
    for (int fine = 0; fine < 2; ++fine) {
        ov_judge judge;
        ov_judgement got;
        ov_spot *spots = NULL;
        size_t count = 0;
        memset(&judge, 0, sizeof judge);
        test_check(*state, ov_judge_create(*state, xyzr, atoms, 0.5, 1.0, fine ? 0.2 : 0.5,
                                           (ov_watch){0}, &judge));
        assert_int_equal(judge.mesh->components, fine ? 1 : 2);
        for (size_t c = 0; c < judge.mesh->components; ++c)
            assert_true(judge.mesh->component[c].exposed);
        test_check(*state,
                   ov_judge_spots(&judge, quadrics, atoms + 1, 0.5, 1.0, 99, &got, &spots, &count));
        print_message("deviation %g, %zu spots\n", got.deviation, count);
        assert_true(got.deviation > 1.0);
        assert_true(count > 0);
        free(spots);
        ov_judge_destroy(&judge);
    }
    free(quadrics);
}

typedef struct countdown {
    unsigned asked, most;
} countdown;

static bool count_down(void *user) {
    countdown *const c = user;
    return ++c->asked <= c->most;
}

/* ---- regions ------------------------------------------------------------------------------ */

/* Beside a region surfaces count where they are too far off to be cut off there, and nothing counts
 * that is hardly farther off than what is excused. */
static void what_strays_counts(void **state) {
    const double three[12] = {1.0, 2.0, 3.0, 1.7, 11.0, 2.0, 3.0, 1.4, 21.0, 2.0, 3.0, 1.4};
    const double far = 10.0, error = test_size(2, 8) * 0.01;
    ov_judge judge;
    judge_atoms(*state, two, 2, 0.5, 1.0, &judge);
    ov_quadric *const quadrics = quadrics_of(three, 3, 0.5);
    judge.in_region = true;
    judge.stray = judge.excused_times = INFINITY;
    for (int k = 0; k < 3; ++k) {
        judge.region.low[k] = two[k] - 3.0;
        judge.region.high[k] = two[k] + 3.0;
    }
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, 0.0, 1e-4, "beside it");
    judge.stray = far + error;
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, 0.0, 1e-4, "not so far");
    judge.stray = 4.0;
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, far, error, "strayed");
    judge.excused = test_alloc(1, sizeof *judge.excused); /* the judge's now */
    judge.excused_count = 1;
    judge.excused_reach = 3.0;
    *judge.excused = (ov_spot){.at = {21.0, 2.0, 3.0}, .distance = 0.4 * far};
    judge.excused_times = 2.0;
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, far, error, "far more so");
    judge.excused_times = 3.0;
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, 0.0, 1e-4, "excused");
    judge.excused->at[0] -= 10.0;
    expect_near(judgement_of(*state, &judge, quadrics, 3).deviation, far, error, "elsewhere");
    free(quadrics);
    ov_judge_destroy(&judge);
}

/* ---- one model after the other -------------------------------------------------------------- */

enum { ATOMS = 40, ROOM = 200 };

/* Molecules of several shapes: a clump, a chain, a shell about a cavity, all with an ion far off,
 * which is small to the lattice. */
static void put_molecule(test_random *random, int form, double *xyzr) {
    for (size_t i = 0; i < ATOMS; ++i) {
        const double s = (2.0 * (double)i + 1.0) / ATOMS, turn = 2.399963 * (double)i, z = 1.0 - s;
        const double ring = sqrt(1.0 - z * z), clump = 3.0 * cbrt(0.5 * s), shell = 3.7;
        const double at[3][3] = {
            {clump * ring * cos(turn), clump * ring * sin(turn), clump * z},
            {12.0 * z, 2.0 * sin(8.0 * s), 2.0 * cos(8.0 * s)},
            {shell * ring * cos(turn), shell * ring * sin(turn), shell * z},
        };
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = at[form][k] + random_uniform(random, -0.1, 0.1);
        xyzr[4 * i + 3] = random_uniform(random, 1.2, 1.7);
    }
    const double ion[4] = {9.0, 9.0, random_uniform(random, 9.0, 9.5), 0.3};
    memcpy(xyzr + 4 * (ATOMS - 1), ion, sizeof ion);
}

enum { NOTHING, MOVE, SPLIT, MERGE, REMOVE, DETACH, HOLE, GROW, EVERYTHING, REORDER, CHANGES };

/* Changes a model as that says, at a place of its own; returns how many quadrics it has then. */
static size_t change(test_random *random, int what, ov_quadric *q, size_t count) {
    const size_t i = (size_t)(random_bits(random) % count), j = count > 1 ? (i + 1) % count : i;
    for (size_t k = 0; k < 3; ++k) {
        const double by = random_uniform(random, -0.6, 0.6);
        if (what == MOVE)
            q[i].centre[k] += by;
        if (what == DETACH)
            q[i].centre[k] += 20.0 * by;
        if (what == MERGE)
            q[j].centre[k] = 0.5 * (q[i].centre[k] + q[j].centre[k]);
        if (what == SPLIT) {
            q[count] = k == 0 ? q[i] : q[count];
            q[count].centre[k] += by;
        }
    }
    if (what == HOLE)
        q[i].amplitude *= 0.05;
    if (what == GROW)
        q[i].amplitude *= 1.5;
    for (size_t n = 0; n < count && what == EVERYTHING; ++n)
        q[n].amplitude *= 1.01;
    if (what == MERGE || what == REMOVE || what == REORDER) {
        const ov_quadric swap = q[i];
        q[i] = q[count - 1];
        q[count - 1] = swap;
    }
    return what == SPLIT                     ? count + 1
           : what == MERGE || what == REMOVE ? count - (count > 1)
                                             : count;
}

/* To the bit. */
static void expect_same_judgement(const ov_judgement *got, const ov_judgement *wanted) {
    assert_int_equal(got->valid, wanted->valid);
    assert_memory_equal(&got->hausdorff, &wanted->hausdorff, sizeof got->hausdorff);
    assert_memory_equal(&got->deviation, &wanted->deviation, sizeof got->deviation);
    assert_memory_equal(&got->area_error, &wanted->area_error, sizeof got->area_error);
    assert_memory_equal(&got->volume_ratio, &wanted->volume_ratio, sizeof got->volume_ratio);
    assert_memory_equal(&got->score, &wanted->score, sizeof got->score);
}

/* Judges with both, in one way and in the other. */
static size_t judge_twice(ovoid_context *context, ov_judge *kept, ov_judge *fresh,
                          const ov_quadric *quadrics, size_t count, double least) {
    ov_judge *const judges[2] = {kept, fresh};
    ov_judgement whole[2], found[2];
    ov_spot *spots[2];
    size_t number[2];
    for (int n = 0; n < 2; ++n) {
        test_check(context, ov_judge_spots(judges[n], quadrics, count, least, 1.5, 1000, &found[n],
                                           &spots[n], &number[n]));
        test_check(context, ov_judge_model(judges[n], quadrics, count, &whole[n]));
    }
    expect_same_judgement(&found[0], &found[1]);
    expect_same_judgement(&whole[0], &whole[1]);
    assert_int_equal(number[0], number[1]);
    assert_memory_equal(spots[0], spots[1], number[0] * sizeof *spots[0]);
    free(spots[0]);
    free(spots[1]);
    return number[0];
}

/* What a judge keeps of the last model has no part in what it says of the next: it is what a judge
 * made for that model alone says. Now and then it is stopped on the way. */
static void the_last_model_is_forgotten(void **state) {
    test_random random = {11};
    test_skip_simulated(*state); /* what is kept is the host's doing */
    countdown all = {.most = 1000000};
    const ov_watch patient = {.go_on = count_down, .user = &all};
    for (int form = 0; form < (int)test_size(3, 1); ++form) {
        double xyzr[4 * ATOMS];
        ov_quadric quadrics[ROOM];
        size_t count = ATOMS, spots = 0;
        ov_judge kept;
        put_molecule(&random, form, xyzr);
        for (size_t i = 0; i < ATOMS; ++i)
            ov_quadric_of_atom(xyzr + 4 * i, 0.5, &quadrics[i]);
        test_check(*state,
                   ov_judge_create(*state, xyzr, ATOMS, 0.5, 1.0, spacing(), patient, &kept));
        for (size_t n = 0; n < test_size(2 * CHANGES, 6); ++n) {
            ov_judge fresh;
            ov_judgement got;
            count = change(&random, (int)((n + MOVE) % CHANGES), quadrics, count);
            all.asked = 0;
            all.most = (unsigned)n % 3;
            if (n % 4 == 3) /* gives up on it after some questions */
                test_refused(*state, ov_judge_model(&kept, quadrics, count / 2 + 1, &got),
                             OVOID_ERROR_CANCELLED, "stopped");
            all.most = 1000000;
            judge_atoms(*state, xyzr, ATOMS, 0.5, 1.0, &fresh);
            spots += judge_twice(*state, &kept, &fresh, quadrics, count, 0.2);
            ov_judge_destroy(&fresh);
        }
        print_message("%zu spots\n", spots);
        assert_true(spots > 0);
        ov_judge_destroy(&kept);
    }
}

/* ---- no surfaces -------------------------------------------------------------------------- */

static void no_surface_of_the_original(void **state) {
    ov_judge judge;
    judge_atoms(*state, two, 2, 0.5, 100.0, &judge); /* phi is at most exp(1.445) */
    assert_null(judge.mesh);
    ov_quadric *const quadrics = quadrics_of(two, 2, 0.5);
    for (int n = 0; n < 2; ++n) {
        ov_spot *spots = NULL;
        size_t count = 5;
        ov_judgement got;
        double ratio = NAN;
        quadrics[0].amplitude *= n == 0 ? 1.0 : 1000.0; /* the model has none, then one */
        test_check(*state, ov_judge_spots(&judge, quadrics, 2, 0.0, 1.0, 9, &got, &spots, &count));
        expect_invalid(&got);
        assert_int_equal(count, 0);
        free(spots);
        test_check(*state, ov_judge_volume(&judge, quadrics, 2, &ratio));
        assert_true(ratio == 1.0);
        assert_true(ov_judge_amplitude_factor(&judge, 0.5) == 1.0);
    }
    free(quadrics);
    ov_judge_destroy(&judge);
}

static void no_surface_of_the_model(void **state) {
    ov_judge judge;
    judge_atoms(*state, two, 2, 0.5, 1.0, &judge);
    ov_quadric *const quadrics = quadrics_of(two, 2, 0.5);
    quadrics[0].amplitude = quadrics[1].amplitude = 0.5;
    const ov_judgement got = judgement_of(*state, &judge, quadrics, 2);
    expect_invalid(&got);
    double ratio = NAN;
    test_check(*state, ov_judge_volume(&judge, quadrics, 2, &ratio));
    assert_true(ratio == 1.0);
    free(quadrics);
    ov_judge_destroy(&judge);
}

/* ---- stopping ----------------------------------------------------------------------------- */

/* Stopped at each of the questions in turn, and never where there are as many as that. */
static void stopping(void **state) {
    countdown all = {.most = 1000000};
    ov_judge judge = {0};
    ov_judgement got;
    ov_spot *spots = NULL;
    size_t count = 0;
    const ov_watch patient = {.go_on = count_down, .user = &all};
    test_skip_simulated(*state); /* nothing here but the host's questions */
    test_check(*state, ov_judge_create(*state, two, 2, 0.5, 1.0, spacing(), patient, &judge));
    assert_true(all.asked >= 1);
    countdown none = {0};
    ov_judge other = {0};
    test_refused(*state,
                 ov_judge_create(*state, two, 2, 0.5, 1.0, spacing(),
                                 (ov_watch){.go_on = count_down, .user = &none}, &other),
                 OVOID_ERROR_CANCELLED, "stopped");
    ov_quadric *const quadrics = quadrics_of(two, 2, 0.5);
    all.asked = 0;
    test_check(*state, ov_judge_model(&judge, quadrics, 2, &got));
    const unsigned questions = all.asked;
    print_message("%u questions\n", questions);
    assert_true(questions >= 3); /* a mesh and two ways */
    for (all.most = 0; all.most < questions; ++all.most) {
        all.asked = 0;
        test_refused(*state, ov_judge_spots(&judge, quadrics, 2, 0.0, 1.0, 9, &got, &spots, &count),
                     OVOID_ERROR_CANCELLED, "stopped");
        assert_int_equal(all.asked, all.most + 1);
        assert_null(spots);
    }
    all.asked = 0;
    test_check(*state, ov_judge_model(&judge, quadrics, 2, &got));
    free(quadrics);
    ov_judge_destroy(&judge);
}

/* ---- volumes ------------------------------------------------------------------------------ */

/* Spheres too small or too large by 5 % in volume become equal in three steps, and no factor is
 * large, whatever the ratio. */
static void factors_make_volumes_equal(void **state) {
    test_skip_simulated(*state); /* what the host makes of volumes */
    const double decays[] = {0.5, 1.5}, isovalues[] = {1.0, 1.4};
    for (size_t n = 0; n < test_size(4, 1); ++n) {
        const double d = decays[n / 2], c = isovalues[n / 2];
        const double radius = 1.7 * sqrt(0.5 / d);
        double xyzr[4] = {0.3, -0.2, 0.1, radius};
        ov_judge judge;
        judge_atoms(*state, xyzr, 1, d, c, &judge);
        xyzr[3] =
            sqrt(log(c) / d + (radius * radius - log(c) / d) * pow(n % 2 ? 1.05 : 0.95, 2.0 / 3.0));
        ov_quadric *const quadric = quadrics_of(xyzr, 1, d);
        double ratio = NAN;
        test_check(*state, ov_judge_volume(&judge, quadric, 1, &ratio));
        expect_near(ratio, n % 2 ? 1.05 : 0.95, 0.01, "the volume at first");
        for (int step = 0; step < 3; ++step) {
            const double factor = ov_judge_amplitude_factor(&judge, ratio);
            assert_true((factor > 1.0) == (ratio < 1.0));
            quadric->amplitude *= factor;
            test_check(*state, ov_judge_volume(&judge, quadric, 1, &ratio));
        }
        print_message("volumes %.6f\n", ratio);
        expect_near(ratio, 1.0, 2e-3, "the volume at last");
        expect_near(ov_judge_amplitude_factor(&judge, 0.01), 1.1, 1e-12, "the largest factor");
        expect_near(ov_judge_amplitude_factor(&judge, 100.0), 1.0 / 1.1, 1e-12, "the least factor");
        expect_near(ov_judge_amplitude_factor(&judge, 1.0), 1.0, 0.0, "no factor");
        free(quadric);
        ov_judge_destroy(&judge);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_same_is_the_same),
        cmocka_unit_test(a_missing_piece),
        cmocka_unit_test(what_strays_counts),
        cmocka_unit_test(a_grown_piece),
        cmocka_unit_test(a_filled_cavity),
        cmocka_unit_test(a_cavity_that_is_open),
        cmocka_unit_test(the_last_model_is_forgotten),
        cmocka_unit_test(no_surface_of_the_original),
        cmocka_unit_test(no_surface_of_the_model),
        cmocka_unit_test(stopping),
        cmocka_unit_test(factors_make_volumes_equal),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
