/*
 * Several devices in one process (host/fit/parts/crew.c, workers.c): who gets which part, the same
 * bits as on one device, and devices that fail in the middle (lose.c). PoCL makes its devices by
 * POCL_DEVICES: 1 and 2 are alike, 0 is of another kind.
 */
#include "device/device.h"
#include "fit/parts/crew.h"
#include "fit/parts/workers.h"
#include "lose.h"
#include "support.h"

#include <pthread.h>
#include <unistd.h>

enum { PARTS = 12, DEVICES = 3, NOBODY = 99 };

/* ---- contexts ------------------------------------------------------------------------------ */

typedef struct warnings {
    size_t count;
    char last[1024];
    pthread_t thread;
    bool elsewhere; /* one came on another thread */
} warnings;

static void keep_warning(const char *text, void *user) {
    warnings *const w = user;
    ++w->count;
    w->elsewhere |= !pthread_equal(w->thread, pthread_self());
    snprintf(w->last, sizeof w->last, "%s", text);
}

static ovoid_context *open_devices(const char *selector, warnings *told) {
    ovoid_context *context = NULL;
    *told = (warnings){.thread = pthread_self()};
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    ovoid_context_on_warning(context, keep_warning, told);
    test_check(context, ovoid_context_open_device(context, selector));
    return context;
}

static void expect_text(const char *text, const char *part) {
    if (!strstr(text, part))
        fail_msg("\"%s\" is missing in \"%s\"", part, text);
}

/* ---- work that is made up -------------------------------------------------------------------- */

typedef struct play {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    size_t on[PARTS]; /* the device that a part was done on */
    size_t tries[PARTS];
    size_t failures;      /* so far */
    size_t most;          /* and how many there are to be */
    size_t failing;       /* the device on which tasks fail; NOBODY: on any */
    size_t part;          /* and the only part that does; NOBODY: any */
    cl_int code;          /* with what; CL_SUCCESS: as where the host has no memory */
    size_t entered, meet; /* tasks so far; they wait for each other until so many are there */
    bool wait;            /* other devices wait for a failure */
    bool warn;            /* each task warns */
    ov_part part_of[PARTS];
} play;

static ovoid_status act(ovoid_context *context, size_t part, size_t done, void *user) {
    play *const p = user;
    ovoid_status status = OVOID_OK;
    const size_t index = ovoid_context_device(context)->index;
    (void)done;
    if (p->warn)
        ov_warn(context, "a task");
    pthread_mutex_lock(&p->lock);
    ++p->tries[part];
    ++p->entered;
    pthread_cond_broadcast(&p->changed);
    while (p->entered < p->meet)
        pthread_cond_wait(&p->changed, &p->lock);
    if ((p->failing == NOBODY || p->failing == index) && (p->part == NOBODY || p->part == part) &&
        p->failures < p->most) {
        ++p->failures;
        status = p->code == CL_SUCCESS ? ov_fail(context, OVOID_ERROR_MEMORY, "no room")
                                       : ov_cl_fail(context, p->code, "clFoo", NULL);
        pthread_cond_broadcast(&p->changed);
    } else {
        while (p->wait && p->failures == 0)
            pthread_cond_wait(&p->changed, &p->lock);
        p->on[part] = index;
    }
    pthread_mutex_unlock(&p->lock);
    return status;
}

static ovoid_status perform(play *p, ovoid_context *context, size_t parts, size_t jobs) {
    const ov_partition cut = {.part = p->part_of, .count = parts, .colours = 2};
    const ov_part_work work = {.task = act, .user = p};
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->changed, NULL);
    for (size_t n = 0; n < PARTS; ++n) {
        p->part_of[n].colour = n % 4 == 3;
        p->on[n] = NOBODY;
    }
    const ovoid_status status = ov_parts_work(context, &cut, jobs, &work, NULL);
    pthread_cond_destroy(&p->changed);
    pthread_mutex_destroy(&p->lock);
    return status;
}

static void expect_all_on(const play *p, size_t device) {
    for (size_t n = 0; n < PARTS; ++n)
        assert_int_equal(p->on[n], device);
}

/* Devices of different bits get the parts of each colour in turn, however many work on them. */
static void parts_are_dealt_out_to_different_devices(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("0,1", &told);
    for (size_t jobs = 1; jobs <= 3; ++jobs) {
        play p = {.failing = NOBODY, .part = NOBODY};
        size_t of_colour[2] = {0};
        test_check(context, perform(&p, context, PARTS, jobs));
        for (size_t n = 0; n < PARTS; ++n) {
            const size_t turn = of_colour[p.part_of[n].colour]++;
            assert_int_equal(p.on[n], turn % 2 ? 1 : 0);
        }
    }
    assert_int_equal(told.count, 0);
    ovoid_context_destroy(&context);
}

/* One that fails gives its part back, and is left out from then on, by the context, too. */
static void a_device_that_fails_is_left_out(void **state) {
    static const char *const selectors[] = {"1,2", "1,0"}; /* alike, and not */
    warnings told;
    (void)state;
    for (size_t k = 0; k < 2; ++k)
        for (size_t jobs = 1; jobs <= 2; ++jobs) {
            ovoid_context *context = open_devices(selectors[k], &told);
            const size_t other = k == 0 ? 2 : 0;
            play p = {.failing = 1,
                      .part = NOBODY,
                      .most = PARTS,
                      .code = CL_OUT_OF_RESOURCES,
                      .wait = true};
            test_check(context, perform(&p, context, PARTS, jobs));
            expect_all_on(&p, other);
            assert_in_range(p.failures, 1, jobs);
            assert_int_equal(told.count, 1);
            expect_text(told.last, "device 1, pthread");
            expect_text(told.last, "failed and is not used any more: clFoo: CL_OUT_OF_RESOURCES");
            assert_false(told.elsewhere);
            assert_int_equal(ovoid_context_device_count(context), 1);
            assert_int_equal(ovoid_context_device(context)->index, other);
            ovoid_context_destroy(&context);
        }
}

/* The list goes on without it, behind the device that is the context's own. */
static void the_others_stay(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("1,2,0", &told);
    play p = {
        .failing = 2, .part = NOBODY, .most = PARTS, .code = CL_OUT_OF_RESOURCES, .wait = true};
    test_check(context, perform(&p, context, PARTS, 1));
    assert_int_equal(ovoid_context_device_count(context), 2);
    assert_int_equal(ovoid_context_device_at(context, 0)->index, 1);
    assert_int_equal(ovoid_context_device_at(context, 1)->index, 0);
    ovoid_context_destroy(&context);
}

static void the_last_device_ends_it(void **state) {
    warnings told;
    (void)state;
    for (size_t jobs = 1; jobs <= 2; ++jobs) {
        ovoid_context *context = open_devices("1,2", &told);
        play p = {.failing = NOBODY, .part = NOBODY, .most = 99, .code = CL_OUT_OF_RESOURCES};
        test_refused(context, perform(&p, context, PARTS, jobs), OVOID_ERROR_OPENCL, "clFoo");
        assert_int_equal(told.count, 1); /* the other one's error is the work's */
        ovoid_context_destroy(&context);
        context = open_devices("2", &told);
        p = (play){.failing = NOBODY, .part = NOBODY, .most = 99, .code = CL_OUT_OF_RESOURCES};
        test_refused(context, perform(&p, context, PARTS, jobs), OVOID_ERROR_OPENCL, "clFoo");
        assert_int_equal(told.count, 0);
        assert_in_range(p.failures, 1, jobs);
        ovoid_context_destroy(&context);
    }
}

/* Two parts at a time may be too many for a device, where one is not. */
static void fewer_parts_at_a_time_take_less_memory(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("2", &told);
    for (size_t most = 1; most <= 2; ++most) {
        play p = {.failing = NOBODY,
                  .part = NOBODY,
                  .most = most,
                  .meet = 2,
                  .code = CL_MEM_OBJECT_ALLOCATION_FAILURE};
        told.count = 0;
        test_check(context, perform(&p, context, PARTS, 2));
        expect_all_on(&p, 2);
        assert_int_equal(told.count, 1);
        expect_text(told.last, "has too little memory for so many parts at a time");
    }
    ovoid_context_destroy(&context);
}

/* What two devices have no memory for is too large; and another device does not help a host. */
static void a_part_too_large_is_tried_twice(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("1,2,0", &told);
    play p = {.failing = NOBODY, .part = 5, .most = 99, .code = CL_MEM_OBJECT_ALLOCATION_FAILURE};
    test_refused(context, perform(&p, context, PARTS, 1), OVOID_ERROR_MEMORY, "clFoo");
    assert_int_equal(p.tries[5], 2);
    ovoid_context_destroy(&context);
    context = open_devices("1,2", &told);
    p = (play){.failing = NOBODY, .part = 5, .most = 99, .code = CL_SUCCESS};
    test_refused(context, perform(&p, context, PARTS, 1), OVOID_ERROR_MEMORY, "no room");
    assert_int_equal(p.tries[5], 1);
    assert_int_equal(told.count, 0);
    assert_int_equal(ovoid_context_device_count(context), 2);
    ovoid_context_destroy(&context);
}

static void warnings_of_workers_are_told_once(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("1,2", &told);
    play p = {.failing = NOBODY, .part = NOBODY, .warn = true};
    test_check(context, perform(&p, context, PARTS, 2));
    assert_int_equal(told.count, 1);
    assert_string_equal(told.last, "a task");
    assert_false(told.elsewhere);
    ovoid_context_destroy(&context);
}

/* A molecule that is one part is the first device's. */
static void one_part_is_the_first_devices(void **state) {
    warnings told;
    (void)state;
    ovoid_context *context = open_devices("2,1", &told);
    play p = {.failing = NOBODY, .part = NOBODY};
    lose_device(0, 0, 0);
    test_check(context, perform(&p, context, 1, 2));
    assert_int_equal(p.on[0], 2);
    assert_int_equal(lose_contexts(), 0);
    ovoid_context_destroy(&context);
}

/* ---- fits ---------------------------------------------------------------------------------- */

/* Atoms along a helix, as near as bonded ones. */
static ovoid_molecule *chain(ovoid_context *context, size_t atoms) {
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    ovoid_molecule *molecule = NULL;
    for (size_t i = 0; i < atoms; ++i) {
        const double n = (double)i;
        const double atom[4] = {1.5 * cos(n), 1.5 * sin(n), 0.5 * n, 1.4 + 0.1 * (double)(i % 4)};
        memcpy(xyzr + 4 * i, atom, sizeof atom);
    }
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    free(xyzr);
    return molecule;
}

typedef struct case_of {
    ovoid_context *context;
    warnings told;
    ovoid_molecule *molecule;
    ovoid_fit_options options;
    ovoid_model *alone; /* on device 1 */
} case_of;

static void begin_case(case_of *c, ovoid_goal goal) {
    c->context = open_devices("1", &c->told);
    c->molecule = chain(c->context, goal == OVOID_GOAL_RATIO ? 640 : 200);
    ovoid_fit_options_init(&c->options, sizeof c->options);
    c->options.adaptive.goal = goal;
    c->options.adaptive.ratio = 0.05;
    c->options.adaptive.tolerance = 0.3;
    c->options.parts.atoms = 64;
    c->alone = NULL;
    test_check(c->context, ovoid_fit(c->context, c->molecule, &c->options, &c->alone, NULL));
}

static void reopen(case_of *c, const char *selector) {
    lose_device(0, 0, 0);
    ovoid_context_destroy(&c->context);
    c->context = open_devices(selector, &c->told);
}

static void end_case(case_of *c) {
    lose_device(0, 0, 0);
    ovoid_model_destroy(&c->alone);
    ovoid_molecule_destroy(&c->molecule);
    ovoid_context_destroy(&c->context);
}

/* The model of a fit that succeeds is the one that device 1 makes alone. */
static void expect_same_fit(case_of *c) {
    ovoid_model *model = NULL;
    test_check(c->context, ovoid_fit(c->context, c->molecule, &c->options, &model, NULL));
    assert_int_equal(ovoid_model_size(model), ovoid_model_size(c->alone));
    assert_memory_equal(ovoid_model_ellipsoids(model), ovoid_model_ellipsoids(c->alone),
                        ovoid_model_size(model) * sizeof(ovoid_ellipsoid));
    assert_memory_equal(ovoid_model_owner(model), ovoid_model_owner(c->alone),
                        ovoid_model_owner_count(model) * sizeof(uint32_t));
    ovoid_model_destroy(&model);
}

/* Any number of equal devices and of workers comes to the same bits, with a context for each worker
 * from the first part to the last mend. */
static void equal_devices_come_to_the_same_bits(void **state) {
    static const char *const selectors[] = {"2", "1,2", "2,1"};
    case_of c;
    (void)state;
    begin_case(&c, OVOID_GOAL_RATIO);
    for (size_t k = 0; k < 3; ++k)
        for (uint32_t jobs = 1; jobs <= 2; ++jobs) {
            reopen(&c, selectors[k]);
            c.options.parts.jobs = jobs;
            lose_device(0, 0, 0);
            expect_same_fit(&c);
            const size_t workers = jobs * (k > 0 ? 2 : 1);
            assert_int_equal(lose_contexts(), workers > 1 ? workers : 0);
        }
    end_case(&c);
    begin_case(&c, OVOID_GOAL_TOLERANCE);
    reopen(&c, "1,2");
    expect_same_fit(&c);
    end_case(&c);
}

/* Wherever a device is lost, from the opening of its worker on, the other one comes to the same. */
static void a_lost_device_changes_no_bits(void **state) {
    static const struct {
        size_t place, at;
        cl_int code;
    } cases[] = {{1, 1, CL_OUT_OF_HOST_MEMORY},
                 {2, 1, CL_DEVICE_NOT_AVAILABLE},
                 {1, 2, CL_OUT_OF_RESOURCES},
                 {2, 2, CL_MEM_OBJECT_ALLOCATION_FAILURE},
                 {1, 200, -9999},
                 {2, 200, CL_MEM_OBJECT_ALLOCATION_FAILURE},
                 {2, 300, CL_OUT_OF_RESOURCES}};
    case_of c;
    (void)state;
    begin_case(&c, OVOID_GOAL_RATIO);
    for (size_t k = test_small() ? 3 : 0; k < sizeof cases / sizeof *cases; ++k) {
        reopen(&c, "1,2");
        lose_device(cases[k].place, cases[k].at, cases[k].code);
        expect_same_fit(&c);
        const bool met = lose_calls() >= cases[k].at; /* it may have been slow */
        print_message("device %zu, call %zu of %zu\n", cases[k].place, cases[k].at, lose_calls());
        assert_int_equal(c.told.count, met);
        assert_true(met || cases[k].at > 1);
        assert_int_equal(ovoid_context_device_count(c.context), met ? 1 : 2);
        if (met) {
            expect_text(c.told.last, "failed and is not used any more");
            assert_int_equal(ovoid_context_device(c.context)->index, 3 - cases[k].place);
            expect_same_fit(&c); /* on that one alone */
            assert_int_equal(c.told.count, 1);
        }
    }
    end_case(&c);
}

/* Where no other device is left the fit fails, and goes on from its checkpoint. */
static void the_checkpoint_outlives_the_device(void **state) {
    case_of c;
    char path[300];
    ovoid_model *none = NULL;
    const char *const place = getenv("TMPDIR");
    (void)state;
    snprintf(path, sizeof path, "%.200s/ovoid-several-%ld", place ? place : "/tmp", (long)getpid());
    begin_case(&c, OVOID_GOAL_RATIO);
    unlink(path);
    for (uint32_t jobs = 1; jobs <= 2; ++jobs) {
        reopen(&c, "2");
        c.options.parts.jobs = jobs;
        c.options.parts.checkpoint = NULL;
        c.options.parts.resume = 0;
        lose_device(2, 0, 0);
        expect_same_fit(&c);
        const size_t calls = lose_calls();
        c.options.parts.checkpoint = path;
        lose_device(2, calls / 2, CL_INVALID_COMMAND_QUEUE);
        test_refused(c.context, ovoid_fit(c.context, c.molecule, &c.options, &none, NULL),
                     OVOID_ERROR_OPENCL, "CL_INVALID_COMMAND_QUEUE");
        assert_null(none);
        c.options.parts.resume = 1;
        reopen(&c, jobs == 1 ? "1,2" : "1"); /* devices that are alike are one to a checkpoint */
        lose_device(1, 0, 0);
        expect_same_fit(&c);
        assert_true(lose_calls() < calls); /* for some was there */
        unlink(path);
    }
    end_case(&c);
}

/* A checkpoint of devices that differ is one of their list. */
static void a_checkpoint_knows_the_list(void **state) {
    uint64_t hash[5];
    static const char *const selectors[] = {"1", "1,2", "1,0", "0,1", "0"};
    warnings told;
    (void)state;
    for (size_t k = 0; k < 5; ++k) {
        ovoid_context *context = open_devices(selectors[k], &told);
        test_check(context, ov_device_hash(context, &hash[k]));
        ovoid_context_destroy(&context);
    }
    assert_true(hash[0] == hash[1]);
    for (size_t k = 1; k < 5; ++k)
        for (size_t n = 1; n < k; ++n)
            assert_true(hash[k] != hash[n]);
}

/* Skips all where PoCL does not make such devices. */
static int check_devices(void) {
    ovoid_context *context = NULL;
    ovoid_device_info *devices = NULL;
    size_t count = 0;
    if (ovoid_context_create(&context) != OVOID_OK)
        return 1;
    const ovoid_status status = ovoid_devices(context, sizeof *devices, &devices, &count);
    const bool good = status == OVOID_OK && count >= DEVICES &&
                      strcmp(devices[0].platform, devices[2].platform) == 0 &&
                      strcmp(devices[1].name, devices[2].name) == 0 &&
                      strcmp(devices[0].name, devices[2].name) != 0;
    ovoid_free(devices);
    ovoid_context_destroy(&context);
    return good ? 0 : 77;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_are_dealt_out_to_different_devices),
        cmocka_unit_test(a_device_that_fails_is_left_out),
        cmocka_unit_test(the_others_stay),
        cmocka_unit_test(the_last_device_ends_it),
        cmocka_unit_test(fewer_parts_at_a_time_take_less_memory),
        cmocka_unit_test(a_part_too_large_is_tried_twice),
        cmocka_unit_test(warnings_of_workers_are_told_once),
        cmocka_unit_test(one_part_is_the_first_devices),
        cmocka_unit_test(equal_devices_come_to_the_same_bits),
        cmocka_unit_test(a_lost_device_changes_no_bits),
        cmocka_unit_test(the_checkpoint_outlives_the_device),
        cmocka_unit_test(a_checkpoint_knows_the_list),
    };
    setenv("POCL_DEVICES", "pthread pthread basic", 1);
    const int missing = check_devices();
    if (missing) {
        print_message("skipped: PoCL has no devices of its own here\n");
        return missing;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
