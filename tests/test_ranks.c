/*
 * Fits that several ranks share (host/fit/parts/ranks.c), without MPI: threads of this process are
 * the ranks, and what they exchange goes through its memory.
 */
#include "fit/parts/patch.h"
#include "measure/survey.h"
#include "support.h"

#include <pthread.h>
#include <stdatomic.h>
#include <sys/stat.h>
#include <unistd.h>

enum { RANKS_MOST = 3 };

/* ---- an exchange in memory ------------------------------------------------------------------- */

typedef struct hall {
    pthread_barrier_t barrier;
    uint32_t ranks;
    const void *said[RANKS_MOST];
    uint32_t gathers, breaks_at; /* 0: never */
} hall;

/* One of the ranks, with what it is to do and what came of it. */
typedef struct rank {
    hall *hall;
    ovoid_exchange exchange;
    ovoid_context *context;
    const ovoid_molecule *molecule;
    ovoid_fit_options options;
    pthread_t thread;
    atomic_uint fits;    /* parts that its workers have fitted */
    uint32_t fails_at;   /* its so many-th fit of a part fails; 0: none does */
    uint32_t stops_at;   /* or its progress callback stops from there on */
    bool fails_to_join;  /* its surveys */
    bool told_late;      /* of more parts done than there are, or than before */
    uint64_t done;       /* parts, as its callback was told, at most */
    ovoid_status status; /* and what the fit came to */
    ovoid_model *model;
    ovoid_fit_result result;
} rank;

static int gather(const void *mine, void *all, const uint64_t *sizes, void *user) {
    const rank *const r = user;
    hall *const h = r->hall;
    unsigned char *to = all;
    h->said[r->exchange.rank] = mine;
    if (r->exchange.rank == 0)
        ++h->gathers;
    pthread_barrier_wait(&h->barrier);
    const bool broken = h->gathers == h->breaks_at;
    for (uint32_t n = 0; n < h->ranks && !broken; to += sizes[n++])
        if (sizes[n] > 0)
            memcpy(to, h->said[n], (size_t)sizes[n]);
    pthread_barrier_wait(&h->barrier);
    return broken ? 17 : 0;
}

/* ---- ranks that fail ------------------------------------------------------------------------- */

static rank all_ranks[RANKS_MOST];

/* NULL: one process fits. */
static rank *rank_of(const ov_ranks *ranks) {
    return ranks->exchange ? &all_ranks[ranks->exchange->rank] : NULL;
}

static rank *rank_with(const ovoid_context *context) {
    for (size_t n = 0; n < RANKS_MOST; ++n)
        if (all_ranks[n].context == context)
            return &all_ranks[n];
    return NULL;
}

ovoid_status __real_ov_part_fit_atoms(ovoid_context *context, const ov_parts *parts, size_t p,
                                      size_t done, ov_part_fit *fit);
ovoid_status __wrap_ov_part_fit_atoms(ovoid_context *context, const ov_parts *parts, size_t p,
                                      size_t done, ov_part_fit *fit);
ovoid_status __wrap_ov_part_fit_atoms(ovoid_context *context, const ov_parts *parts, size_t p,
                                      size_t done, ov_part_fit *fit) {
    rank *const r = rank_of(parts->ranks);
    if (r && atomic_fetch_add(&r->fits, 1) + 1 == r->fails_at)
        return ov_fail(context, OVOID_ERROR_NUMERIC, "made to fail");
    return __real_ov_part_fit_atoms(context, parts, p, done, fit);
}

ovoid_status __real_ov_survey_join(ovoid_context *context, const ov_survey_cell *cells,
                                   size_t count, const ov_survey_images *images, double apart,
                                   ov_survey_total *total);
ovoid_status __wrap_ov_survey_join(ovoid_context *context, const ov_survey_cell *cells,
                                   size_t count, const ov_survey_images *images, double apart,
                                   ov_survey_total *total);
ovoid_status __wrap_ov_survey_join(ovoid_context *context, const ov_survey_cell *cells,
                                   size_t count, const ov_survey_images *images, double apart,
                                   ov_survey_total *total) {
    const rank *const r = rank_with(context);
    if (r && r->fails_to_join)
        return ov_fail(context, OVOID_ERROR_NUMERIC, "made to fail behind the others' backs");
    return __real_ov_survey_join(context, cells, count, images, apart, total);
}

static atomic_uint patches; /* rounds of mending, of all ranks */

ovoid_status __real_ov_patches_mend(ovoid_context *context, ov_parts *parts, size_t jobs,
                                    const ov_spot *spots, size_t count, ov_box **touched,
                                    size_t *touched_count, ovoid_fit_result *result);
ovoid_status __wrap_ov_patches_mend(ovoid_context *context, ov_parts *parts, size_t jobs,
                                    const ov_spot *spots, size_t count, ov_box **touched,
                                    size_t *touched_count, ovoid_fit_result *result);
ovoid_status __wrap_ov_patches_mend(ovoid_context *context, ov_parts *parts, size_t jobs,
                                    const ov_spot *spots, size_t count, ov_box **touched,
                                    size_t *touched_count, ovoid_fit_result *result) {
    ++patches;
    return __real_ov_patches_mend(context, parts, jobs, spots, count, touched, touched_count,
                                  result);
}

static bool on_progress(const ovoid_progress *progress, void *user) {
    rank *const r = user;
    if (progress->method == OVOID_METHOD_ADAPTIVE && progress->total != OVOID_UNKNOWN) {
        r->told_late = r->told_late || progress->done > progress->total;
        r->done = progress->done > r->done ? progress->done : r->done;
    }
    return r->stops_at == 0 || r->fits < r->stops_at;
}

/* ---- fits ------------------------------------------------------------------------------------ */

/* Atoms in a box of so much room across, angstrom, as dense as a protein's with hydrogens. */
static ovoid_molecule *box(ovoid_context *context, size_t atoms, double across) {
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    test_random random = {11};
    const double length = 10.0 * (double)atoms / (across * across);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, 0.0, k == 0 ? length : across);
        xyzr[4 * i + 3] = random_uniform(&random, 1.2, 1.8);
    }
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    free(xyzr);
    return molecule;
}

/* Long, so that many parts may be fitted at a time. */
static ovoid_molecule *rod(ovoid_context *context, size_t atoms) {
    return box(context, atoms, 5.0);
}

/* To a loose tolerance, and with few points and triangles: what is shared are parts, however much
 * there is to do about each. */
static ovoid_fit_options in_parts(uint32_t atoms) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.spacing = options.adaptive.mesh_spacing = 0.8;
    options.adaptive.tolerance = 1.0;
    options.parts.atoms = atoms;
    return options;
}

static hall one_hall;

/* Ranks 0 to count - 1 of all_ranks, ready to be told what each is to do. */
static void gather_ranks(uint32_t count, const ovoid_molecule *molecule,
                         const ovoid_fit_options *options) {
    one_hall = (hall){.ranks = count};
    assert_int_equal(pthread_barrier_init(&one_hall.barrier, NULL, count), 0);
    for (uint32_t n = 0; n < count; ++n) {
        rank *const r = &all_ranks[n];
        *r = (rank){.hall = &one_hall, .molecule = molecule, .options = *options};
        r->exchange = (ovoid_exchange){.rank = n, .ranks = count, .gather = gather, .user = r};
        r->options.parts.exchange = &r->exchange;
        assert_int_equal(ovoid_context_create(&r->context), OVOID_OK);
        ovoid_context_on_progress(r->context, on_progress, r);
        ovoid_fit_result_init(&r->result, sizeof r->result);
    }
}

static void *run(void *user) {
    rank *const r = user;
    r->status = ovoid_fit(r->context, r->molecule, &r->options, &r->model, &r->result);
    return NULL;
}

static void run_ranks(void) {
    for (uint32_t n = 0; n < one_hall.ranks; ++n)
        assert_int_equal(pthread_create(&all_ranks[n].thread, NULL, run, &all_ranks[n]), 0);
    for (uint32_t n = 0; n < one_hall.ranks; ++n)
        pthread_join(all_ranks[n].thread, NULL);
}

static void dismiss_ranks(void) {
    for (uint32_t n = 0; n < one_hall.ranks; ++n) {
        assert_false(all_ranks[n].told_late);
        ovoid_model_destroy(&all_ranks[n].model);
        ovoid_context_destroy(&all_ranks[n].context);
    }
    pthread_barrier_destroy(&one_hall.barrier);
    memset(all_ranks, 0, sizeof all_ranks);
}

static void expect_all(ovoid_status status, const char *text) {
    for (uint32_t n = 0; n < one_hall.ranks; ++n) {
        test_refused(all_ranks[n].context, all_ranks[n].status, status, text);
        if (status != OVOID_ERROR_CANCELLED)
            assert_null(all_ranks[n].model);
    }
}

static uint32_t all_fits(void) {
    uint32_t fits = 0;
    for (uint32_t n = 0; n < one_hall.ranks; ++n)
        fits += all_ranks[n].fits;
    return fits;
}

static void expect_models(const ovoid_model *model, const ovoid_fit_result *result) {
    for (uint32_t n = 0; n < one_hall.ranks; ++n) {
        const rank *const r = &all_ranks[n];
        test_check(r->context, r->status);
        expect_same_models(model, r->model);
        assert_int_equal(r->result.parts, result->parts);
        assert_int_equal(r->result.iterations, result->iterations);
        assert_int_equal(r->result.points, result->points);
        assert_int_equal(r->result.verdict, result->verdict);
        assert_true(r->result.distance == result->distance ||
                    (isnan(r->result.distance) && isnan(result->distance)));
    }
}

/* ---- what is told of the time ---------------------------------------------------------------- */

/* Each part once, fitted after those that it waits for, by whom it says. */
static void expect_tasks(const ovoid_context *context, uint32_t ranks, uint64_t parts) {
    size_t count, fitted = 0, waiting = 0;
    const ovoid_task *const task = ovoid_context_tasks(context, &count);
    bool *const done = test_alloc(parts, sizeof *done);
    for (size_t n = 0; n < count; ++n) {
        assert_in_range(task[n].rank, 0, ranks - 1);
        assert_true(task[n].began >= 0.0 && task[n].seconds > 0.0);
        assert_true(n == 0 || task[n].stage >= task[n - 1].stage);
        if (task[n].kind != OVOID_TASK_FIT)
            continue;
        assert_in_range(task[n].number, 0, parts - 1);
        assert_false(done[task[n].number]);
        for (uint64_t k = 0; k < task[n].after_count && ranks > 1; ++k)
            assert_true(done[task[n].after[k]]);
        waiting += task[n].after_count > 0;
        done[task[n].number] = true;
        ++fitted;
    }
    assert_int_equal(fitted, parts);
    assert_true(waiting > 0);
    free(done);
}

/* Workers are busy or wait, and no longer than the fit takes. */
static void expect_times(const ovoid_context *context, uint32_t ranks, uint64_t fits) {
    size_t count, tasks, of_all = 0, of_parts = 0;
    const ovoid_task *const task = ovoid_context_tasks(context, &tasks);
    const ovoid_rank_time *const time = ovoid_context_rank_times(context, &count);
    assert_int_equal(count, ranks);
    for (uint32_t n = 0; n < ranks; ++n) {
        double busy = 0.0;
        assert_int_equal(time[n].rank, n);
        assert_int_equal(time[n].workers, 1);
        for (size_t k = 0; k < tasks; ++k)
            busy += task[k].rank == n ? task[k].seconds : 0.0;
        assert_true(fabs(busy - time[n].busy) < 1e-9);
        assert_true(busy + time[n].waiting < 1.02 * time[n].seconds + 0.05);
        of_all += (size_t)time[n].tasks;
    }
    for (size_t k = 0; k < tasks; ++k)
        of_parts += task[k].kind == OVOID_TASK_FIT;
    assert_int_equal(of_all, tasks);
    assert_int_equal(of_parts, fits);
}

/* ---- one model ------------------------------------------------------------------------------- */

/* The bits of one process, each part fitted by one rank alone, and none idle. */
static void all_ranks_come_to_the_model_of_one(void **state) {
    ovoid_molecule *molecule = rod(*state, 300);
    ovoid_fit_options options = in_parts(64);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    expect_tasks(*state, 1, result.parts);
    expect_times(*state, 1, result.parts);
    for (uint32_t ranks = 1; ranks <= RANKS_MOST; ++ranks) {
        gather_ranks(ranks, molecule, &options);
        run_ranks();
        expect_models(model, &result);
        assert_int_equal(all_fits(), result.parts);
        for (uint32_t n = 0; n < ranks; ++n) {
            expect_tasks(all_ranks[n].context, ranks, result.parts);
            expect_times(all_ranks[n].context, ranks, result.parts);
            assert_in_range(all_ranks[n].fits, result.parts / ranks / 2, result.parts);
            assert_in_range(all_ranks[n].done, result.parts / 2, result.parts);
        }
        dismiss_ranks();
    }
    gather_ranks(2, molecule, &options); /* with workers of their own, not as many on each */
    all_ranks[0].options.parts.jobs = 3;
    run_ranks();
    expect_models(model, &result);
    dismiss_ranks();
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* Where all parts are near each other, and the seams have to be mended. */
static void seams_are_mended_by_all(void **state) {
    ovoid_molecule *molecule = box(*state, 200, cbrt(2000.0));
    ovoid_fit_options options = in_parts(64);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    options.adaptive.mesh_spacing = 0.5; /* sees what is off there */
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    patches = 0;
    gather_ranks(2, molecule, &options);
    run_ranks();
    expect_models(model, &result);
    dismiss_ranks();
    assert_true(patches > 0);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* A PQR file of a rod beside the z axis, with an assembly of it and half a turn of it. */
static ovoid_molecule *pair(ovoid_context *context) {
    char path[300];
    const char *const place = getenv("TMPDIR");
    ovoid_read_options options;
    ovoid_molecule *molecule = NULL, *unit = rod(context, 200);
    const double *const xyzr = ovoid_molecule_xyzr(unit);
    snprintf(path, sizeof path, "%.200s/ovoid-ranks-%ld.pqr", place ? place : "/tmp",
             (long)getpid());
    FILE *const file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "REMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n");
    for (int p = 1; p <= 2; ++p)
        for (int k = 0; k < 3; ++k)
            fprintf(file, "REMARK 350   BIOMT%d %3d %9.6f %9.6f %9.6f %14.5f\n", k + 1, p,
                    k == 0 ? 3.0 - 2.0 * p : 0.0, k == 1 ? 3.0 - 2.0 * p : 0.0, k == 2 ? 1.0 : 0.0,
                    0.0);
    for (size_t i = 0; i < 200; ++i)
        fprintf(file, "ATOM  %5zu  C   ALA A %3zu    %8.3f %8.3f %8.3f %6.3f %6.3f\n", i + 1,
                i / 8 + 1, xyzr[4 * i], xyzr[4 * i + 1] + 1.0, xyzr[4 * i + 2], 0.0,
                xyzr[4 * i + 3]);
    fclose(file);
    ovoid_read_options_init(&options, sizeof options);
    options.assembly = "1";
    test_check(context, ovoid_molecule_read_with(context, path, &options, &molecule));
    unlink(path);
    ovoid_molecule_destroy(&unit);
    return molecule;
}

/* The same made of its unit and placements, as one rank sends them to another. */
static ovoid_molecule *placed_again(ovoid_context *context, const ovoid_molecule *from) {
    ovoid_molecule *molecule = NULL;
    ovoid_unit_part part;
    size_t count;
    const ovoid_placement *const placed = ovoid_molecule_placements(from, &count);
    const double *const xyzr = ovoid_molecule_unit_xyzr(from);
    const size_t atoms = ovoid_molecule_unit_atoms(from);
    part.atoms = ovoid_molecule_part(from, 0, &part.count);
    test_check(context, ovoid_molecule_create_placed(context, xyzr, atoms, &part, 1, placed, count,
                                                     &molecule));
    return molecule;
}

/* One unit of an assembly is fitted for all, and its pieces go on in images of it. */
static void units_are_those_of_one(void **state) {
    ovoid_molecule *molecule = pair(*state);
    ovoid_fit_options options = in_parts(64);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    assert_int_equal(result.units, 2);
    assert_in_range(result.parts, 3, 8);
    ovoid_molecule *again = placed_again(*state, molecule);
    gather_ranks(2, molecule, &options);
    all_ranks[1].molecule = again;
    run_ranks();
    expect_models(model, &result);
    assert_int_equal(all_ranks[1].result.units, 2);
    dismiss_ranks();
    gather_ranks(2, molecule, &options);
    all_ranks[1].options.parts.symmetry = OVOID_SYMMETRY_IGNORE;
    run_ranks();
    expect_all(OVOID_ERROR_ARGUMENT, "rank 1 has other");
    dismiss_ranks();
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&again);
    ovoid_molecule_destroy(&molecule);
}

static void numbers_of_ellipsoids_are_those_of_one(void **state) {
    ovoid_molecule *molecule = rod(*state, 300);
    ovoid_fit_options options = in_parts(64);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 40;
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    gather_ranks(3, molecule, &options);
    run_ranks();
    expect_models(model, &result);
    dismiss_ranks();
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* What is not cut into parts each rank fits by itself; those that meet are told of differences. */
static void one_part_is_fitted_by_each(void **state) {
    ovoid_molecule *molecule = rod(*state, 60);
    ovoid_fit_options options = in_parts(0);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    assert_null(ovoid_context_tasks(*state, NULL)); /* those of the fit before are forgotten */
    assert_null(ovoid_context_rank_times(*state, NULL));
    gather_ranks(2, molecule, &options);
    run_ranks();
    expect_models(model, &result);
    dismiss_ranks();
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* ---- what is refused ------------------------------------------------------------------------- */

static void different_fits_are_refused(void **state) {
    ovoid_molecule *molecule = rod(*state, 300), *other = rod(*state, 301);
    const ovoid_fit_options options = in_parts(64);
    test_skip_simulated(*state);
    gather_ranks(3, molecule, &options);
    all_ranks[1].options.adaptive.tolerance = 0.4;
    run_ranks();
    expect_all(OVOID_ERROR_ARGUMENT, "rank 1 has other options");
    dismiss_ranks();
    gather_ranks(2, molecule, &options);
    all_ranks[1].molecule = other;
    run_ranks();
    expect_all(OVOID_ERROR_ARGUMENT, "rank 1 has other atoms");
    dismiss_ranks();
    gather_ranks(2, molecule, &options);
    all_ranks[1].options.parts.atoms = 0;
    run_ranks();
    expect_all(OVOID_ERROR_ARGUMENT, "rank 1 has other options of parts");
    assert_int_equal(all_fits(), 0);
    dismiss_ranks();
    ovoid_molecule_destroy(&molecule);
    ovoid_molecule_destroy(&other);
}

static void exchanges_that_are_none_are_refused(void **state) {
    ovoid_molecule *molecule = rod(*state, 100);
    ovoid_fit_options options = in_parts(64);
    ovoid_exchange exchange = {.rank = 1, .ranks = 1, .gather = gather};
    ovoid_model *none = NULL;
    test_skip_simulated(*state);
    options.parts.exchange = &exchange;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "a rank below the number of ranks, 1; it is 1");
    exchange = (ovoid_exchange){.rank = 0, .ranks = 1};
    test_refused(*state, ovoid_fit(*state, molecule, &options, &none, NULL), OVOID_ERROR_ARGUMENT,
                 "no function");
    assert_null(none);
    ovoid_molecule_destroy(&molecule);
}

/* ---- failures -------------------------------------------------------------------------------- */

static void a_failure_ends_it_on_all(void **state) {
    ovoid_molecule *molecule = rod(*state, 300);
    ovoid_fit_options options = in_parts(64);
    test_skip_simulated(*state);
    gather_ranks(3, molecule, &options);
    all_ranks[1].fails_at = 2; /* at a part */
    run_ranks();
    expect_all(OVOID_ERROR_NUMERIC, "rank 1: made to fail");
    dismiss_ranks();
    gather_ranks(3, molecule, &options);
    all_ranks[2].fails_to_join = true; /* at what all do, while the others go on */
    run_ranks();
    expect_all(OVOID_ERROR_NUMERIC, "rank 2: made to fail behind");
    dismiss_ranks();
    gather_ranks(2, molecule, &options);
    one_hall.breaks_at = 6; /* the exchange itself */
    run_ranks();
    expect_all(OVOID_ERROR_IO, "the exchange with the other ranks failed (17)");
    dismiss_ranks();
    options.parts.checkpoint = "/nowhere/at/all"; /* a file, on rank 0 */
    gather_ranks(2, molecule, &options);
    run_ranks();
    expect_all(OVOID_ERROR_IO, "rank 0: /nowhere/at/all");
    assert_int_equal(all_fits(), 0);
    dismiss_ranks();
    ovoid_molecule_destroy(&molecule);
}

static long length_of(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 ? (long)info.st_size : -1;
}

/* One that is stopped stops all, with the same model of what was done; and rank 0 goes on from the
 * checkpoint for all, however many there are then. */
static void a_stop_stops_all_and_they_resume(void **state) {
    ovoid_molecule *molecule = rod(*state, 300);
    ovoid_fit_options options = in_parts(64);
    ovoid_fit_result result;
    ovoid_model *model = NULL;
    char path[300];
    const char *const place = getenv("TMPDIR");
    test_skip_simulated(*state);
    snprintf(path, sizeof path, "%.200s/ovoid-ranks-%ld", place ? place : "/tmp", (long)getpid());
    unlink(path);
    ovoid_fit_result_init(&result, sizeof result);
    test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
    options.parts.checkpoint = path;
    gather_ranks(2, molecule, &options);
    all_ranks[1].stops_at = 2; /* it has done one */
    run_ranks();
    expect_all(OVOID_ERROR_CANCELLED, "rank 1: ");
    assert_non_null(all_ranks[0].model);
    expect_same_models(all_ranks[0].model, all_ranks[1].model);
    assert_true(length_of(path) > 600); /* one part at least: the head alone has 304 */
    dismiss_ranks();
    options.parts.resume = 1;
    gather_ranks(3, molecule, &options);
    run_ranks();
    expect_models(model, &result);
    assert_in_range(all_fits(), 1, result.parts - 1);
    dismiss_ranks();
    gather_ranks(2, molecule, &options); /* all of them are there */
    run_ranks();
    expect_models(model, &result);
    assert_int_equal(all_fits(), 0);
    dismiss_ranks();
    unlink(path);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_ranks_come_to_the_model_of_one),
        cmocka_unit_test(seams_are_mended_by_all),
        cmocka_unit_test(units_are_those_of_one),
        cmocka_unit_test(numbers_of_ellipsoids_are_those_of_one),
        cmocka_unit_test(one_part_is_fitted_by_each),
        cmocka_unit_test(different_fits_are_refused),
        cmocka_unit_test(exchanges_that_are_none_are_refused),
        cmocka_unit_test(a_failure_ends_it_on_all),
        cmocka_unit_test(a_stop_stops_all_and_they_resume),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
