/*
 * Fits in parts (host/fit/parts): how a molecule is cut, surveys of cells beside measures of the
 * whole, models that hold across seams whatever number of workers, and checkpoints.
 */
#include "device/internal.h"
#include "measure/partition.h"
#include "measure/survey.h"
#include "model/factor.h"
#include "support.h"

#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#define TOLERANCE 0.7
/* For what becomes of parts, however much there is to do about each. */
#define LOOSE 1.5

/* A compact molecule: atoms in a ball, as dense as a protein's with hydrogens. */
static ovoid_molecule *ball(ovoid_context *context, size_t atoms) {
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    test_random random = {11};
    const double half = 0.5 * cbrt(10.0 * (double)atoms);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -half, half);
        xyzr[4 * i + 3] = random_uniform(&random, 1.2, 1.8);
    }
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    free(xyzr);
    return molecule;
}

/* ---- cutting --------------------------------------------------------------------------------- */

static void expect_partition(const double *xyzr, size_t atoms, size_t most,
                             const ov_partition *cut) {
    bool *const seen = test_alloc(atoms, sizeof *seen);
    size_t next = 0;
    for (size_t p = 0; p < cut->count; ++p) {
        const ov_part *const part = &cut->part[p];
        assert_int_equal(part->first, next);
        assert_in_range(part->count, 1, most);
        next += part->count;
        for (size_t n = part->first; n < next; ++n) {
            const size_t atom = cut->order[n];
            assert_false(seen[atom]);
            seen[atom] = true;
            assert_true(ov_box_near(&part->cell, xyzr + 4 * atom, 0.0));
            assert_true(ov_box_near(&part->box, xyzr + 4 * atom, 0.0));
        }
        for (size_t q = 0; q < p; ++q)
            if (ov_parts_near(cut, p, q))
                assert_int_not_equal(cut->part[q].colour, part->colour);
    }
    assert_int_equal(next, atoms);
    free(seen);
}

/* Each point of space is in the cell of one part, its ends in the later one. */
static void expect_cells(const ov_partition *cut) {
    test_random random = {3};
    for (int n = 0; n < 2000; ++n) {
        size_t cells = 0;
        double at[3];
        for (int k = 0; k < 3; ++k)
            at[k] = random_uniform(&random, -100.0, 100.0);
        for (size_t p = 0; p < cut->count; ++p) {
            const ov_box *const cell = &cut->part[p].cell;
            cells += at[0] >= cell->low[0] && at[0] < cell->high[0] && at[1] >= cell->low[1] &&
                     at[1] < cell->high[1] && at[2] >= cell->low[2] && at[2] < cell->high[2];
        }
        assert_int_equal(cells, 1);
    }
}

/* To be cut: without images. */
static ov_partition alone(double near) {
    return (ov_partition){.near = near, .image = &ov_rigid_identity, .images = 1};
}

static void atoms_are_shared_out(void **state) {
    ovoid_molecule *molecule = ball(*state, 1000);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const size_t most[] = {1, 64, 130, 999, 1000, 5000};
    for (size_t n = 0; n < sizeof most / sizeof *most; ++n) {
        ov_partition cut = alone(6.0);
        test_check(*state, ov_partition_create(*state, xyzr, 1000, most[n], &cut));
        assert_in_range(cut.count, (1000 + most[n] - 1) / most[n], 2 * 1000 / most[n] + 1);
        expect_partition(xyzr, 1000, most[n], &cut);
        expect_cells(&cut);
        ov_partition_destroy(&cut);
    }
    ovoid_molecule_destroy(&molecule);
}

/* Atoms that are all in one place, or in two. */
static void level_atoms_are_shared_out(void **state) {
    double xyzr[4 * 100] = {0};
    ov_partition cut = alone(1.0);
    for (size_t i = 0; i < 100; ++i)
        xyzr[4 * i + 1] = i < 70 ? 1.0 : 2.0;
    test_check(*state, ov_partition_create(*state, xyzr, 100, 8, &cut));
    expect_partition(xyzr, 100, 8, &cut);
    assert_int_equal(cut.count, 16);
    ov_partition_destroy(&cut);
}

/* ---- surveys --------------------------------------------------------------------------------- */

static ov_quadric *atoms_of(const ovoid_molecule *molecule, double shift) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ov_quadric *const quadrics = test_alloc(atoms, sizeof *quadrics);
    for (size_t i = 0; i < atoms; ++i) {
        ov_quadric_of_atom(ovoid_molecule_xyzr(molecule) + 4 * i, 0.5, &quadrics[i]);
        quadrics[i].centre[i % 3] += shift * sin((double)i);
    }
    return quadrics;
}

static ovoid_model *model_of(ovoid_context *context, const ov_quadric *quadrics, size_t count) {
    ovoid_ellipsoid *const ellipsoids = test_alloc(count, sizeof *ellipsoids);
    ovoid_model *model = NULL;
    for (size_t i = 0; i < count; ++i)
        ov_ellipsoid_of_quadric(&quadrics[i], &ellipsoids[i]);
    test_check(context, ovoid_model_create(context, ellipsoids, count, 0.5, 1.0, &model));
    free(ellipsoids);
    return model;
}

static void measure(ovoid_context *context, const ovoid_molecule *molecule,
                    const ovoid_model *model, ovoid_measures *measures) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measure_options options;
    ovoid_measure_options_init(&options, sizeof options);
    ovoid_measures_init(measures, sizeof *measures);
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &original));
    test_check(context, ovoid_field_of_model(context, model, &sparse));
    test_check(context, ovoid_measure(context, original, sparse, &options, measures));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
}

/* Cell by cell comes to what all at once does: pieces that run through many cells, cavities cut by
 * faces, specks. */
static void cells_add_up(void **state) {
    const size_t atoms = test_size(700, 400);
    ovoid_molecule *molecule = ball(*state, atoms);
    ov_quadric *const original = atoms_of(molecule, 0.0), *const moved = atoms_of(molecule, 0.6);
    ovoid_model *model = model_of(*state, moved, atoms);
    ovoid_measures wanted;
    ov_partition cut = alone(6.0);
    ov_survey_total total = {0};
    const ov_survey_options options = {.isovalue = 1.0, .spacing = 0.5, .least = 0.4};
    const ov_survey_images images = {.image = cut.image, .count = 1, .spacing = 0.5};
    measure(*state, molecule, model, &wanted);
    assert_true(wanted.components_original > 1 && wanted.components_sparse > 1);
    test_check(*state,
               ov_partition_create(*state, ovoid_molecule_xyzr(molecule), atoms, atoms / 8, &cut));
    ov_survey_cell *const cells = test_alloc(cut.count, sizeof *cells);
    for (size_t p = 0; p < cut.count; ++p)
        test_check(*state, ov_survey(*state, &options, original, atoms, moved, atoms,
                                     cut.part[p].cell.low, cut.part[p].cell.high, &cells[p]));
    test_check(*state, ov_survey_join(*state, cells, cut.count, &images, 3.0, &total));
    assert_int_equal(total.components[0], wanted.components_original);
    assert_int_equal(total.components[1], wanted.components_sparse);
    assert_int_equal(total.outer[0], wanted.outer_original);
    assert_int_equal(total.outer[1], wanted.outer_sparse);
    expect_near(total.area[0], wanted.area.original, 1e-5 * wanted.area.original, "area");
    expect_near(total.area[1], wanted.area.sparse, 1e-5 * wanted.area.sparse, "area");
    expect_near(total.volume[0], wanted.volume.original, 1e-5 * wanted.volume.original, "volume");
    expect_near(total.volume[1], wanted.volume.sparse, 1e-5 * wanted.volume.sparse, "volume");
    expect_near(total.volume_outer[1], wanted.volume_outer.sparse,
                1e-5 * wanted.volume_outer.sparse, "outer volume");
    expect_near(total.area_outer[0], wanted.area_outer.original, 1e-5 * wanted.area_outer.original,
                "outer area");
    assert_true(wanted.deviation > options.least);
    expect_near(total.deviation, wanted.deviation, 1e-4, "deviation");
    assert_true(total.spots > 0);
    expect_near(total.spot[0].distance, wanted.deviation, 1e-4, "worst spot");
    for (size_t p = 0; p < cut.count; ++p)
        ov_survey_cell_destroy(&cells[p]);
    free(cells);
    free(original);
    free(moved);
    ov_survey_total_destroy(&total);
    ov_partition_destroy(&cut);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* ---- fits ------------------------------------------------------------------------------------ */

static ovoid_fit_options in_parts(uint32_t atoms, uint32_t jobs) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.spacing = 0.7;
    options.adaptive.tolerance = TOLERANCE;
    options.parts.atoms = atoms;
    options.parts.jobs = jobs;
    return options;
}

static ovoid_model *fit(ovoid_context *context, const ovoid_molecule *molecule,
                        const ovoid_fit_options *options, ovoid_fit_result *result) {
    ovoid_model *model = NULL;
    ovoid_fit_result_init(result, sizeof *result);
    test_check(context, ovoid_fit(context, molecule, options, &model, result));
    return model;
}

/* What parts and cells took of the host is given back as each is done: the next stage takes as
 * much. */
static void leaves_no_buffers(void **state) {
    ovoid_molecule *molecule = ball(*state, 300);
    ovoid_fit_options options = in_parts(75, 1);
    ovoid_measure_options measuring;
    ovoid_fit_result result;
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_measures measures;
    test_skip_simulated(*state);
    const ov_device *const device = (*(ovoid_context **)state)->device;
    if (device->info.type != OVOID_DEVICE_CPU)
        skip();
    options.adaptive.goal = OVOID_GOAL_RATIO;
    options.adaptive.ratio = 0.1;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    assert_true(result.parts > 1);
    assert_false(ov_pool_empty(device->pool));
    ovoid_measure_options_init(&measuring, sizeof measuring);
    measuring.cell_atoms = 75;
    ovoid_measures_init(&measures, sizeof measures);
    test_check(*state, ovoid_field_of_molecule(*state, molecule, 0.5, 1.0, &original));
    test_check(*state, ovoid_field_of_model(*state, model, &sparse));
    test_check(*state, ovoid_measure(*state, original, sparse, &measuring, &measures));
    assert_false(ov_pool_empty(device->pool));
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* The tolerance holds across seams as a measure of the whole has it, not with many more ellipsoids
 * than a fit of the whole takes, and with the same bits for any number of workers. */
static void holds_across_seams(void **state) {
    const size_t atoms = 300;
    ovoid_molecule *molecule = ball(*state, atoms);
    ovoid_fit_options options = in_parts(0, 0);
    ovoid_fit_result whole, result, again;
    ovoid_measures measures;
    test_skip_simulated(*state);
    ovoid_model *alone = fit(*state, molecule, &options, &whole);
    assert_int_equal(whole.parts, 1);
    options = in_parts((uint32_t)atoms / 4, 1);
    ovoid_model *model = fit(*state, molecule, &options, &result);
    measure(*state, molecule, model, &measures);
    print_message("%zu ellipsoids, %zu in %llu parts, within %g\n", ovoid_model_size(alone),
                  ovoid_model_size(model), (unsigned long long)result.parts, measures.deviation);
    assert_in_range(result.parts, 4, 8);
    assert_true(result.reached);
    assert_true(measures.deviation <= TOLERANCE);
    expect_near(result.distance, measures.deviation, 1e-4, "distance");
    assert_int_equal(result.ellipsoids, ovoid_model_size(model));
    assert_true((double)result.ellipsoids <= 1.5 * (double)whole.ellipsoids);
    assert_int_equal(expect_owners(molecule, model, 8, 0.9), 0);
    options.parts.jobs = 3;
    ovoid_model *other = fit(*state, molecule, &options, &again);
    expect_same_models(model, other);
    assert_int_equal(again.iterations, result.iterations);
    assert_int_equal(again.points, result.points);
    ovoid_model_destroy(&other);
    ovoid_model_destroy(&alone);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* Threads with a context each, at the same work on the same device, do not disturb each other. (An
 * array of a kernel, which PoCL 3.1 keeps once for the process, did.) */
typedef struct loner {
    const ovoid_molecule *molecule;
    const ovoid_fit_options *options;
    ovoid_model *model[3];
} loner;

static void *fit_alone(void *user) {
    loner *const l = user;
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK)
        return NULL;
    for (size_t n = 0; n < sizeof l->model / sizeof *l->model; ++n)
        if (ovoid_fit(context, l->molecule, l->options, &l->model[n], NULL) != OVOID_OK)
            print_message("%s\n", ovoid_context_error(context));
    ovoid_context_destroy(&context);
    return NULL;
}

static void threads_do_not_disturb_each_other(void **state) {
    ovoid_molecule *molecule = ball(*state, 120);
    ovoid_fit_options options = in_parts(0, 1);
    ovoid_fit_result result;
    pthread_t thread[2];
    loner of[2];
    test_skip_simulated(*state);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 15;
    ovoid_model *alone = fit(*state, molecule, &options, &result);
    for (int n = 0; n < 2; ++n) {
        of[n] = (loner){.molecule = molecule, .options = &options};
        assert_int_equal(pthread_create(&thread[n], NULL, fit_alone, &of[n]), 0);
    }
    for (int n = 0; n < 2; ++n)
        pthread_join(thread[n], NULL);
    for (int n = 0; n < 2; ++n)
        for (int k = 0; k < 3; ++k) {
            assert_non_null(of[n].model[k]);
            expect_same_models(alone, of[n].model[k]);
            ovoid_model_destroy(&of[n].model[k]);
        }
    ovoid_model_destroy(&alone);
    ovoid_molecule_destroy(&molecule);
}

/* Numbers of ellipsoids are those asked for, shared out by atoms. */
static void numbers_are_shared_out(void **state) {
    const size_t atoms = test_size(500, 150);
    ovoid_molecule *molecule = ball(*state, atoms);
    ovoid_fit_options options = in_parts(64, 2);
    ovoid_fit_result result;
    ovoid_model *none = NULL;
    test_skip_simulated(*state);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = (uint32_t)atoms / 7;
    options.adaptive.effort = 0;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    assert_int_equal(ovoid_model_size(model), atoms / 7);
    assert_true(result.reached);
    assert_true(isnan(result.distance));
    ovoid_model_destroy(&model);
    options.adaptive.ellipsoids = 2;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "2 ellipsoids cannot stand for");
    options.parts.atoms = 10;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "parts.atoms must be 0 or at least 64");
    assert_null(none);
    ovoid_molecule_destroy(&molecule);
}

/* Of so many ellipsoids, too, what is off is brought near, within parts and across seams. */
static void numbers_are_sharpened(void **state) {
    ovoid_molecule *molecule = ball(*state, 300);
    ovoid_fit_options options = in_parts(75, 1);
    ovoid_fit_result result;
    ovoid_measures before, after;
    test_skip_simulated(*state);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 60;
    options.adaptive.effort = 0;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    measure(*state, molecule, model, &before);
    ovoid_model_destroy(&model);
    options.adaptive.effort = 1;
    model = fit(*state, molecule, &options, &result);
    measure(*state, molecule, model, &after);
    print_message("within %g A instead of %g\n", after.deviation, before.deviation);
    assert_int_equal(ovoid_model_size(model), 60);
    assert_true(result.reached);
    expect_near(result.distance, after.deviation, 1e-4, "distance");
    assert_true(after.deviation <= 0.7 * before.deviation);
    options.parts.jobs = 3;
    ovoid_model *other = fit(*state, molecule, &options, &result);
    expect_same_models(model, other);
    ovoid_model_destroy(&other);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* ---- stops and checkpoints ------------------------------------------------------------------- */

typedef struct stopper {
    uint64_t done; /* parts after which it stops */
} stopper;

static bool stop_after(const ovoid_progress *progress, void *user) {
    const stopper *const s = user;
    return progress->total == OVOID_UNKNOWN || progress->done < s->done;
}

static ovoid_status stopped_fit(ovoid_context *context, const ovoid_molecule *molecule,
                                const ovoid_fit_options *options, uint64_t done,
                                ovoid_model **model) {
    stopper s = {done};
    ovoid_context_on_progress(context, stop_after, &s);
    const ovoid_status status = ovoid_fit(context, molecule, options, model, NULL);
    ovoid_context_on_progress(context, NULL, NULL);
    return status;
}

static void file_name(char *path, size_t size) {
    const char *const place = getenv("TMPDIR");
    snprintf(path, size, "%.200s/ovoid-parts-%ld", place ? place : "/tmp", (long)getpid());
}

static long length_of(const char *path) {
    FILE *const file = fopen(path, "rb");
    assert_non_null(file);
    fseek(file, 0, SEEK_END);
    const long length = ftell(file);
    fclose(file);
    return length;
}

/* The parts that were done and the atoms of the others hold, too. */
static void a_stop_hands_over_what_held(void **state) {
    ovoid_molecule *molecule = ball(*state, 300);
    const ovoid_fit_options options = in_parts(80, 1);
    ovoid_model *model = NULL;
    ovoid_measures measures;
    test_skip_simulated(*state);
    assert_int_equal(stopped_fit(*state, molecule, &options, 0, &model), OVOID_ERROR_CANCELLED);
    assert_null(model);
    assert_int_equal(stopped_fit(*state, molecule, &options, 2, &model), OVOID_ERROR_CANCELLED);
    assert_non_null(model);
    assert_in_range(ovoid_model_size(model), 100, 299);
    measure(*state, molecule, model, &measures);
    assert_true(measures.deviation <= 1.2 * TOLERANCE);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

static void goes_on_from_a_checkpoint(void **state) {
    ovoid_molecule *molecule = ball(*state, 280), *other = ball(*state, 281);
    char path[300];
    ovoid_fit_options options = in_parts(64, 1);
    ovoid_fit_result result;
    ovoid_model *resumed = NULL, *none = NULL;
    test_skip_simulated(*state);
    options.adaptive.tolerance = LOOSE;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    file_name(path, sizeof path);
    unlink(path);
    options.parts.checkpoint = path;
    for (uint64_t done = 1; done <= 5; done += 2) {
        options.parts.resume = done > 1;
        options.parts.jobs = (uint32_t)done; /* no matter how many */
        assert_int_equal(stopped_fit(*state, molecule, &options, done, &none),
                         OVOID_ERROR_CANCELLED);
        ovoid_model_destroy(&none);
    }
    const long length = length_of(path);
    options.parts.resume = 0;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_IO,
                 "is there already");
    options.parts.resume = 1;
    test_refused(*state, ovoid_fit(*state, other, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "other atoms");
    options.adaptive.tolerance = 0.9;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "other options");
    options.adaptive.tolerance = LOOSE;
    options.parts.atoms = 200;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "other parts");
    options.parts.atoms = 64;
    assert_int_equal(length_of(path), length);       /* and none of them changed it */
    assert_int_equal(truncate(path, length - 7), 0); /* a record that was cut short */
    test_check(*state, ovoid_fit(*state, molecule, &options, &resumed, &result));
    expect_same_models(model, resumed);
    ovoid_model_destroy(&resumed);

    FILE *const file = fopen(path, "rb+"); /* one that a disk has spoilt, and those after it */
    fseek(file, length / 2, SEEK_SET);
    fputs("spoilt", file);
    fclose(file);
    test_check(*state, ovoid_fit(*state, molecule, &options, &resumed, &result));
    expect_same_models(model, resumed);
    ovoid_model_destroy(&resumed);

    assert_int_equal(truncate(path, 30), 0);
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_FORMAT,
                 "is no checkpoint");
    unlink(path);
    options.parts.checkpoint = "/nowhere/at/all";
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_IO,
                 "/nowhere/at/all");
    options.parts.checkpoint = NULL;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "needs a checkpoint");
    assert_null(none);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
    ovoid_molecule_destroy(&other);
}

/* A disk that is full: the error says so, and what is there goes on. */
static void a_full_disk_leaves_the_checkpoint(void **state) {
    ovoid_molecule *molecule = ball(*state, 200);
    char path[300];
    ovoid_fit_options options = in_parts(64, 1);
    ovoid_fit_result result;
    ovoid_model *none = NULL, *resumed = NULL;
    struct rlimit before, less;
    test_skip_simulated(*state);
    options.adaptive.tolerance = LOOSE;
    ovoid_model *model = fit(*state, molecule, &options, &result);
    file_name(path, sizeof path);
    unlink(path);
    options.parts.checkpoint = path;
    assert_int_equal(stopped_fit(*state, molecule, &options, 2, &none), OVOID_ERROR_CANCELLED);
    ovoid_model_destroy(&none);
    const long length = length_of(path);
    options.parts.resume = 1;
    getrlimit(RLIMIT_FSIZE, &before);
    less = before;
    less.rlim_cur = (rlim_t)length + 100;
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &less);
    const ovoid_status status = ovoid_fit(*state, molecule, &options, &none, NULL);
    setrlimit(RLIMIT_FSIZE, &before);
    test_refused(*state, status, OVOID_ERROR_IO, "the checkpoint cannot be written");
    assert_int_equal(length_of(path), length);
    test_check(*state, ovoid_fit(*state, molecule, &options, &resumed, &result));
    expect_same_models(model, resumed);
    unlink(path);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&resumed);
    ovoid_molecule_destroy(&molecule);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(atoms_are_shared_out),
        cmocka_unit_test(level_atoms_are_shared_out),
        cmocka_unit_test(cells_add_up),
        cmocka_unit_test(leaves_no_buffers),
        cmocka_unit_test(holds_across_seams),
        cmocka_unit_test(threads_do_not_disturb_each_other),
        cmocka_unit_test(numbers_are_shared_out),
        cmocka_unit_test(numbers_are_sharpened),
        cmocka_unit_test(a_stop_hands_over_what_held),
        cmocka_unit_test(goes_on_from_a_checkpoint),
        cmocka_unit_test(a_full_disk_leaves_the_checkpoint),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
