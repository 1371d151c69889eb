/*
 * Measures cell by cell (host/measure/cells.h) beside those of the whole: random molecules with
 * cavities that faces of cells cut, hollow ones whose inside is seen by no cell alone, what is far
 * apart, and what has no surface.
 */
#include "measure/cells.h"
#include "measure/measure.h"
#include "support.h"

/* ---- molecules and models -------------------------------------------------------------------- */

typedef struct pair {
    ovoid_molecule *molecule;
    ovoid_model *model;
} pair;

static void pair_destroy(pair *p) {
    ovoid_molecule_destroy(&p->molecule);
    ovoid_model_destroy(&p->model);
}

/* Of atoms, and of ellipsoids that are atoms, too: x, y, z, radius each. */
static pair pair_of(ovoid_context *context, const double *xyzr, size_t atoms, const double *model,
                    size_t count) {
    pair p = {NULL, NULL};
    ovoid_ellipsoid *const ellipsoids = test_alloc(count, sizeof *ellipsoids);
    for (size_t i = 0; i < count; ++i) {
        const double *const at = model + 4 * i;
        ellipsoids[i] = (ovoid_ellipsoid){
            exp(0.5 * at[3] * at[3]), {0.5, 0.5, 0.5}, {at[0], at[1], at[2]}, {0, 0, 0}};
    }
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &p.molecule));
    test_check(context, ovoid_model_create(context, ellipsoids, count, 0.5, 1.0, &p.model));
    free(ellipsoids);
    return p;
}

/* Atoms all over a ball, or, where inner is not 0, between two spheres, as dense as in a protein.
 */
static double *atoms_in(test_random *random, size_t atoms, double inner, double outer) {
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    for (size_t i = 0; i < atoms;) {
        double square = 0.0, *const at = xyzr + 4 * i;
        for (size_t k = 0; k < 3; ++k) {
            at[k] = random_uniform(random, -outer, outer);
            square += at[k] * at[k];
        }
        at[3] = random_uniform(random, 1.2, 1.8);
        i += square <= outer * outer && square >= inner * inner;
    }
    return xyzr;
}

static double *moved(const double *xyzr, size_t atoms, double shift) {
    double *const copy = test_alloc(4 * atoms, sizeof *copy);
    for (size_t i = 0; i < 4 * atoms; ++i)
        copy[i] = xyzr[i] + (i % 4 == (i / 4) % 3 ? shift * sin((double)i) : 0.0);
    return copy;
}

static pair random_pair(ovoid_context *context, uint64_t seed, size_t atoms, double shift) {
    test_random random = {seed};
    double *const xyzr = atoms_in(&random, atoms, 0.0, cbrt(2.4 * (double)atoms));
    double *const model = moved(xyzr, atoms, shift);
    const pair p = pair_of(context, xyzr, atoms, model, atoms);
    free(xyzr);
    free(model);
    return p;
}

/* ---- comparing ------------------------------------------------------------------------------- */

static ovoid_status measure(ovoid_context *context, const pair *p,
                            const ovoid_measure_options *options, ovoid_measures *measures) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measures_init(measures, sizeof *measures);
    test_check(context, ovoid_field_of_molecule(context, p->molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, p->model, &sparse));
    const ovoid_status status = ovoid_measure(context, original, sparse, options, measures);
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return status;
}

static void expect_pair(ovoid_pair got, ovoid_pair wanted, double share, const char *what) {
    expect_near(got.original, wanted.original, share * fabs(wanted.original), what);
    expect_near(got.sparse, wanted.sparse, share * fabs(wanted.sparse), what);
}

/* Lengths to `close`, angstrom. */
static void expect_distances(const ovoid_distances *got, const ovoid_distances *wanted,
                             double close, const char *what) {
    expect_near(got->hausdorff, wanted->hausdorff, close, what);
    expect_near(got->forward, wanted->forward, close, what);
    expect_near(got->backward, wanted->backward, close, what);
    expect_near(got->mean, wanted->mean, 1e-5 * wanted->mean, what);
    expect_near(got->rms, wanted->rms, 1e-5 * wanted->rms, what);
}

static void expect_same(const ovoid_measures *got, const ovoid_measures *wanted) {
    print_message("pieces %llu %llu, outer %llu %llu; Hausdorff %.6g, outer %.6g, mean %.6g, "
                  "outer %.6g, deviation %.6g\n",
                  (unsigned long long)wanted->components_original,
                  (unsigned long long)wanted->components_sparse,
                  (unsigned long long)wanted->outer_original,
                  (unsigned long long)wanted->outer_sparse, wanted->distances.hausdorff,
                  wanted->distances_outer.hausdorff, wanted->distances.mean,
                  wanted->distances_outer.mean, wanted->deviation);
    assert_int_equal(got->components_original, wanted->components_original);
    assert_int_equal(got->components_sparse, wanted->components_sparse);
    assert_int_equal(got->outer_original, wanted->outer_original);
    assert_int_equal(got->outer_sparse, wanted->outer_sparse);
    expect_pair(got->area, wanted->area, 1e-6, "area");
    expect_pair(got->volume, wanted->volume, 1e-6, "volume");
    expect_pair(got->area_outer, wanted->area_outer, 1e-6, "outer area");
    expect_pair(got->volume_outer, wanted->volume_outer, 1e-6, "outer volume");
    expect_distances(&got->distances, &wanted->distances, 1e-4, "distances");
    expect_distances(&got->distances_outer, &wanted->distances_outer, 1e-4, "outer distances");
    expect_near(got->deviation, wanted->deviation, 1e-4, "deviation");
    assert_true(got->seconds_mesh > 0.0 && got->seconds_distances > 0.0);
}

/* The whole, and in cells of each of these sizes. Returns the measures of the whole. */
static ovoid_measures compare(ovoid_context *context, const pair *p, ovoid_measure_options options,
                              const uint32_t *sizes, size_t count) {
    ovoid_measures wanted, got;
    options.cell_atoms = 0;
    test_check(context, measure(context, p, &options, &wanted));
    for (size_t k = 0; k < count; ++k) {
        options.cell_atoms = sizes[k];
        test_check(context, measure(context, p, &options, &got));
        expect_same(&got, &wanted);
        assert_memory_not_equal(&got.area, &wanted.area, sizeof got.area); /* cells indeed */
    }
    return wanted;
}

/* In lanes the meshes are coarser: their kernels are the same. */
static ovoid_measure_options defaults(void) {
    ovoid_measure_options options;
    ovoid_measure_options_init(&options, sizeof options);
    if (test_small())
        options.spacing = 0.8;
    return options;
}

/* ---- the tests ------------------------------------------------------------------------------- */

static void cells_of_any_size(void **state) {
    const uint32_t sizes[] = {400, 150, 40};
    test_skip_simulated(*state);
    for (uint64_t seed = 1; seed <= (test_small() ? 1 : 4); ++seed) {
        const pair p = random_pair(*state, seed, test_size(700, 300), 0.25 * (double)seed);
        const ovoid_measures wanted =
            compare(*state, &p, defaults(), sizes + test_small(), 3 - 2 * test_small());
        assert_true(wanted.components_original > wanted.outer_original);
        assert_true(wanted.components_sparse > wanted.outer_sparse);
        assert_true(wanted.distances.hausdorff > wanted.deviation);
        pair_destroy((pair *)&p);
    }
}

/* The wall of its inside is a cavity's that no cell sees the whole of: each supposes that it is an
 * outer surface. The model's is closed, or there as well. */
static void the_inside_of_a_shell(void **state) {
    const size_t atoms = test_size(2600, 500);
    const double outer = test_small() ? 12.0 : 18.0, inner = test_small() ? 8.0 : 11.0;
    const uint32_t sizes[] = {(uint32_t)atoms / 9, (uint32_t)atoms / 3};
    const size_t count = test_size(2, 1);
    test_random random = {5};
    test_skip_simulated(*state);
    double *const hollow = atoms_in(&random, atoms, inner, outer);
    double *const also = moved(hollow, atoms, 0.4);
    double *const full = atoms_in(&random, 2 * atoms, 0.0, outer);
    pair p = pair_of(*state, hollow, atoms, also, atoms);
    compare(*state, &p, defaults(), sizes, count);
    pair_destroy(&p);
    p = pair_of(*state, hollow, atoms, full, 2 * atoms);
    const ovoid_measures wanted = compare(*state, &p, defaults(), sizes, count);
    assert_true(test_small() || wanted.distances.forward > wanted.distances_outer.forward + 1.0);
    pair_destroy(&p);
    free(hollow);
    free(also);
    free(full);
}

/* Atoms on a sphere that lack one, by which it is open: the lattice of 0.5 angstrom misses that,
 * and both sides of the neck are in different cells. A model that fills it is off all the same. */
static void a_neck_between_cells(void **state) {
    enum { SHELL = 60 };
    const uint32_t sizes[] = {30, 12, 5};
    double xyzr[4 * SHELL] = {0};
    size_t atoms = 0;
    test_skip_simulated(*state);
    for (size_t i = 0; i < SHELL; ++i) {
        const double z = 1.0 - (2.0 * (double)i + 1.0) / SHELL, turn = 2.399963 * (double)i;
        const double rho = 5.15 * sqrt(1.0 - z * z);
        const double at[4] = {rho * cos(turn), rho * sin(turn), 5.15 * z, 1.5};
        if (i != SHELL / 2)
            memcpy(xyzr + 4 * atoms++, at, sizeof at);
    }
    xyzr[4 * atoms + 3] = 3.0; /* the filling */
    double *const model = moved(xyzr, atoms + 1, 0.05);
    ovoid_measure_options options = defaults();
    options.spacing = 0.5;
    pair p = pair_of(*state, xyzr, atoms, model, atoms + 1);
    const ovoid_measures wanted = compare(*state, &p, options, sizes, 3);
    assert_int_equal(wanted.components_original, 2);
    assert_true(wanted.deviation > 1.0);
    pair_destroy(&p);
    free(model);
}

/* A second molecule that the model lacks, and a third one, near, that the molecule lacks: what is
 * far is looked for in other cells. */
static pair apart(ovoid_context *context, double distance) {
    test_random random = {9};
    double *const xyzr = atoms_in(&random, 400, 0.0, 9.0), *const model = moved(xyzr, 300, 0.3);
    for (size_t i = 300; i < 400; ++i)
        xyzr[4 * i] += distance;
    for (size_t i = 250; i < 300; ++i)
        model[4 * i + 1] -= 25.0;
    const pair p = pair_of(context, xyzr, 400, model, 300);
    free(xyzr);
    free(model);
    return p;
}

static void what_is_far_apart(void **state) {
    const uint32_t sizes[] = {200, 60};
    const double distances[] = {25.0, 300.0};
    test_skip_simulated(*state);
    for (size_t k = 0; k < 2; ++k) {
        pair p = apart(*state, distances[k]);
        const ovoid_measures wanted = compare(*state, &p, defaults(), sizes, 2);
        assert_true(wanted.distances_outer.forward > 0.5 * distances[k]);
        assert_true(wanted.distances_outer.backward > 10.0);
        pair_destroy(&p);
    }
}

static void measure_cells(ovoid_context *context, const pair *p, const ov_cells_options *how,
                          ovoid_measures *measures) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_mesh_options meshing;
    const ovoid_field *empty = NULL;
    test_check(context, ovoid_field_of_molecule(context, p->molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, p->model, &sparse));
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    meshing.isovalue = 1.0;
    meshing.spacing = defaults().spacing;
    test_check(context,
               ov_measure_cells(context, original, sparse, &meshing, how, &empty, measures));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
}

/* Where only so much may be kept of what is far, cells are looked at again. */
static void little_is_kept(void **state) {
    pair p = apart(*state, 40.0);
    const ovoid_measure_options options = defaults();
    ovoid_measures wanted, got;
    const ov_cells_options how = {.most = 60, .distances = true, .fars_most = 5000};
    test_skip_simulated(*state);
    test_check(*state, measure(*state, &p, &options, &wanted));
    measure_cells(*state, &p, &how, &got);
    expect_same(&got, &wanted);
    pair_destroy(&p);
}

static void expect_identical(ovoid_measures a, ovoid_measures b) {
    a.seconds_mesh = b.seconds_mesh;
    a.seconds_distances = b.seconds_distances;
    assert_memory_equal(&a, &b, sizeof a);
}

/* Surfaces that are kept for a second look change nothing: of all cells, of some, of none. */
static void kept_surfaces_change_nothing(void **state) {
    test_skip_simulated(*state);
    for (int k = 0; k < 2; ++k) {
        pair p = k == 0 ? apart(*state, 25.0) : random_pair(*state, 4, test_size(700, 300), 0.8);
        ov_cells_options how = {.most = 60, .distances = true};
        ovoid_measures all, some, none;
        measure_cells(*state, &p, &how, &all);
        how.kept_most = (size_t)1 << 20;
        measure_cells(*state, &p, &how, &some);
        how.kept_most = 1;
        measure_cells(*state, &p, &how, &none);
        expect_identical(all, some);
        expect_identical(all, none);
        pair_destroy(&p);
    }
}

/* Nor does it how many look at cells side by side; in lanes, five or one. */
static void hands_change_nothing(void **state) {
    test_skip_simulated(*state);
    for (int k = 0; k < (test_small() ? 1 : 2); ++k) {
        pair p = k == 0 ? apart(*state, 25.0) : random_pair(*state, 6, test_size(400, 300), 0.8);
        ov_cells_options how = {.most = test_size(40, 80), .distances = true, .hands = 1};
        ovoid_measures alone, several;
        measure_cells(*state, &p, &how, &alone);
        for (how.hands = test_small() ? 5 : 2; how.hands <= 5; how.hands += 3) {
            how.kept_most = how.hands == 2 ? (size_t)1 << 20 : 0;
            measure_cells(*state, &p, &how, &several);
            expect_identical(several, alone);
        }
        how.fars_most = 2000;
        measure_cells(*state, &p, &how, &several);
        expect_same(&several, &alone);
        pair_destroy(&p);
    }
}

static void linear_vertices_and_spacings(void **state) {
    const uint32_t sizes[] = {100};
    pair p = random_pair(*state, 7, 300, 0.5);
    ovoid_measure_options options = defaults();
    ovoid_measures whole, cells;
    test_skip_simulated(*state);
    options.vertices = OVOID_VERTEX_LINEAR;
    compare(*state, &p, options, sizes, 1);
    options.vertices = OVOID_VERTEX_EXACT;
    options.spacing = 0.9;
    compare(*state, &p, options, sizes, 1);
    options.isovalue = 2.0;
    compare(*state, &p, options, sizes, 1);
    options.distances = false;
    test_check(*state, measure(*state, &p, &options, &whole));
    options.cell_atoms = 100;
    test_check(*state, measure(*state, &p, &options, &cells));
    expect_pair(cells.area, whole.area, 1e-6, "area");
    expect_pair(cells.volume_outer, whole.volume_outer, 1e-6, "volume");
    assert_true(isnan(cells.distances.mean) && isnan(cells.deviation));
    pair_destroy(&p);
}

/* Far from the origin, as some entries are. */
static void far_from_the_origin(void **state) {
    test_random random = {3};
    const uint32_t sizes[] = {80};
    test_skip_simulated(*state);
    double *const xyzr = atoms_in(&random, 300, 0.0, 9.0);
    for (size_t i = 0; i < 300; ++i)
        xyzr[4 * i] += 9000.0;
    double *const model = moved(xyzr, 300, 0.4);
    pair p = pair_of(*state, xyzr, 300, model, 300);
    compare(*state, &p, defaults(), sizes, 1);
    pair_destroy(&p);
    free(xyzr);
    free(model);
}

static void without_a_surface(void **state) {
    double xyzr[4 * 8], none[4 * 8];
    char wanted[500];
    ovoid_measure_options options = defaults();
    ovoid_measures measures;
    test_skip_simulated(*state);
    for (size_t i = 0; i < 32; ++i) {
        xyzr[i] = i % 4 == 3 ? 1.5 : (double)(i % 7) + (double)(i / 4);
        none[i] = i % 4 == 3 ? 1.0 : 9.0 * (double)(i / 4);
    }
    for (int k = 0; k < 2; ++k) {
        pair p = pair_of(*state, k == 0 ? xyzr : none, 8, k == 0 ? none : xyzr, 8);
        options.isovalue = 1.8; /* above exp(d r^2) of the small ones */
        options.cell_atoms = 0;
        assert_int_equal(measure(*state, &p, &options, &measures), OVOID_ERROR_EMPTY);
        snprintf(wanted, sizeof wanted, "%s", ovoid_context_error(*state));
        assert_non_null(
            strstr(wanted, k == 0 ? "surface of the model" : "surface of the molecule"));
        options.cell_atoms = 2;
        assert_int_equal(measure(*state, &p, &options, &measures), OVOID_ERROR_EMPTY);
        assert_string_equal(ovoid_context_error(*state), wanted);
        pair_destroy(&p);
    }
}

/* One atom to a cell, some of them at the same place, and more cells than there is anything in. */
static void atoms_in_one_place(void **state) {
    double xyzr[4 * 12];
    const uint32_t sizes[] = {1, 5};
    test_skip_simulated(*state);
    for (size_t i = 0; i < 48; ++i)
        xyzr[i] = i % 4 == 3 ? 1.4 : i < 24 ? 0.25 : 2.0;
    double *const model = moved(xyzr, 12, 0.5);
    pair p = pair_of(*state, xyzr, 12, model, 12);
    compare(*state, &p, defaults(), sizes, test_small() ? 1 : 2);
    pair_destroy(&p);
    free(model);
}

/* ---- stopping -------------------------------------------------------------------------------- */

typedef struct stopper {
    uint64_t asked, most;
} stopper;

static bool stop_later(const ovoid_progress *progress, void *user) {
    stopper *const s = user;
    assert_true(progress->total == OVOID_UNKNOWN || progress->done <= progress->total);
    return ++s->asked <= s->most;
}

static void stops_anywhere(void **state) {
    pair p = apart(*state, 40.0);
    ovoid_measure_options options = defaults();
    ovoid_measures measures;
    stopper s = {0, UINT64_MAX};
    test_skip_simulated(*state);
    options.cell_atoms = 200;
    ovoid_context_on_progress(*state, stop_later, &s);
    test_check(*state, measure(*state, &p, &options, &measures));
    const uint64_t all = s.asked;
    assert_true(all > 20);
    for (uint64_t k = 0; k < 12; ++k) {
        s = (stopper){0, k * all / 12};
        assert_int_equal(measure(*state, &p, &options, &measures), OVOID_ERROR_CANCELLED);
        assert_true(isnan(measures.deviation));
    }
    ovoid_context_on_progress(*state, NULL, NULL);
    pair_destroy(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_of_any_size),    cmocka_unit_test(the_inside_of_a_shell),
        cmocka_unit_test(a_neck_between_cells), cmocka_unit_test(what_is_far_apart),
        cmocka_unit_test(little_is_kept),       cmocka_unit_test(kept_surfaces_change_nothing),
        cmocka_unit_test(hands_change_nothing), cmocka_unit_test(linear_vertices_and_spacings),
        cmocka_unit_test(far_from_the_origin),  cmocka_unit_test(without_a_surface),
        cmocka_unit_test(atoms_in_one_place),   cmocka_unit_test(stops_anywhere),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
