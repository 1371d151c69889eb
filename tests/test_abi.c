/*
 * What programs and bindings that were compiled against another version of the header rely on:
 * structures of other sizes, marks of what is unknown, versions, and what callbacks may do.
 */
#include "support.h"

#include "ovoid/ovoid.h"

enum { LATER = 64 }; /* bytes that a later version may have added */

static const double xyzr[8] = {0.0, 0.0, 0.0, 1.5, 1.4, 0.2, 0.0, 1.7};

static ovoid_molecule *two_atoms(ovoid_context *context) {
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, 2, &molecule));
    return molecule;
}

static void versions(void **state) {
    (void)state;
    char wanted[64];
    snprintf(wanted, sizeof wanted, "%d.%d.%d", OVOID_VERSION_MAJOR, OVOID_VERSION_MINOR,
             OVOID_VERSION_PATCH);
    assert_string_equal(ovoid_version(), wanted);
    assert_int_equal(ovoid_abi(), OVOID_ABI);
}

static void sizes_of_structures(void **state) {
    (void)state;
    assert_int_equal(ovoid_sizeof("ovoid_fit_options"), sizeof(ovoid_fit_options));
    assert_int_equal(ovoid_sizeof("ovoid_ellipsoid"), sizeof(ovoid_ellipsoid));
    assert_int_equal(ovoid_sizeof("ovoid_picture_options"), sizeof(ovoid_picture_options));
    assert_int_equal(ovoid_sizeof("ovoid_context"), 0); /* opaque */
    assert_int_equal(ovoid_sizeof(""), 0);
}

/* ---- structures that the caller fills in ---------------------------------------------------- */

/* Each *_init() fills as much as there is room for, zeros beyond, and nothing behind. */
#define EXPECT_INIT(type, function)                                                                \
    do {                                                                                           \
        unsigned char room[sizeof(type) + 2 * LATER];                                              \
        type whole;                                                                                \
        size_t size;                                                                               \
        function(&whole, sizeof whole);                                                            \
        assert_int_equal(whole.size, sizeof whole);                                                \
        for (size_t given = 0; given <= sizeof(type) + LATER; given += sizeof(size_t)) {           \
            memset(room, 0xee, sizeof room);                                                       \
            function((type *)(void *)room, given);                                                 \
            for (size_t k = sizeof size; k < given; ++k)                                           \
                assert_int_equal(room[k], k < sizeof whole ? ((unsigned char *)&whole)[k] : 0);    \
            memcpy(&size, room, sizeof size);                                                      \
            assert_true(given == 0 || size == given);                                              \
            for (size_t k = given; k < sizeof room; ++k)                                           \
                assert_int_equal(room[k], 0xee);                                                   \
        }                                                                                          \
    } while (0)

static void structures_begin_with_their_size(void **state) {
    (void)state;
    EXPECT_INIT(ovoid_read_options, ovoid_read_options_init);
    EXPECT_INIT(ovoid_fit_options, ovoid_fit_options_init);
    EXPECT_INIT(ovoid_fit_result, ovoid_fit_result_init);
    EXPECT_INIT(ovoid_mesh_options, ovoid_mesh_options_init);
    EXPECT_INIT(ovoid_measure_options, ovoid_measure_options_init);
    EXPECT_INIT(ovoid_measures, ovoid_measures_init);
    EXPECT_INIT(ovoid_export_options, ovoid_export_options_init);
    EXPECT_INIT(ovoid_scene, ovoid_scene_init);
    EXPECT_INIT(ovoid_picture_options, ovoid_picture_options_init);
    EXPECT_INIT(ovoid_selftest_options, ovoid_selftest_options_init);
    EXPECT_INIT(ovoid_selftest_result, ovoid_selftest_result_init);
}

/* A program of a later version: its structure is longer. */
typedef struct later_options {
    ovoid_fit_options known;
    unsigned char more[LATER];
} later_options;

static ovoid_status fit(ovoid_context *context, const ovoid_fit_options *options) {
    ovoid_molecule *molecule = two_atoms(context);
    ovoid_model *model = NULL;
    const ovoid_status status = ovoid_fit(context, molecule, options, &model, NULL);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
    return status;
}

static void later_structures_are_taken_where_they_ask_for_nothing_new(void **state) {
    later_options options;
    ovoid_fit_options_init(&options.known, sizeof options);
    options.known.adaptive.steps = 0;
    if (!test_simulated(*state))
        test_check(*state, fit(*state, &options.known));
    options.more[LATER - 1] = 1;
    test_refused(*state, fit(*state, &options.known), OVOID_ERROR_ARGUMENT, "later version");
}

/* A program of an earlier version: what follows its structure is something else. */
static void earlier_structures_get_defaults(void **state) {
    ovoid_mesh_options options = {.size = offsetof(ovoid_mesh_options, spacing),
                                  .isovalue = 1.0,
                                  .spacing = NAN,
                                  .vertices = (ovoid_vertex_rule)-1,
                                  .folder = "/nowhere"};
    ovoid_molecule *molecule = two_atoms(*state);
    ovoid_mesh *mesh = NULL;
    assert_int_equal(offsetof(ovoid_mesh_options, spacing), 2 * sizeof(double));
    test_check(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh));
    ovoid_mesh_destroy(&mesh);
    options.size = sizeof options; /* as if it were meant */
    test_refused(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh),
                 OVOID_ERROR_ARGUMENT, "spacing");
    ovoid_molecule_destroy(&molecule);
}

static void sizes_that_are_none_are_refused(void **state) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    const size_t sizes[] = {0, 1, sizeof(size_t) - 1, (size_t)1 << 40, SIZE_MAX};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; ++k) {
        options.size = sizes[k];
        test_refused(*state, fit(*state, &options), OVOID_ERROR_ARGUMENT, "ovoid_fit_options_init");
    }
    ovoid_device_info *devices = NULL;
    size_t count = 0;
    test_refused(*state, ovoid_devices(*state, 0, &devices, &count), OVOID_ERROR_ARGUMENT, "size");
}

/* ---- structures that the library fills in --------------------------------------------------- */

static void results_fill_what_both_sides_know(void **state) {
    test_skip_simulated(*state);
    ovoid_fit_options options;
    union {
        ovoid_fit_result result;
        unsigned char bytes[sizeof(ovoid_fit_result) + LATER];
    } r;
    ovoid_fit_options_init(&options, sizeof options);
    options.adaptive.steps = 0;
    ovoid_molecule *molecule = two_atoms(*state);
    const size_t sizes[] = {offsetof(ovoid_fit_result, iterations), sizeof r};
    for (int k = 0; k < 2; ++k) {
        ovoid_model *model = NULL;
        memset(&r, 0xee, sizeof r);
        r.result.size = sizes[k];
        test_check(*state, ovoid_fit(*state, molecule, &options, &model, &r.result));
        assert_int_equal(r.result.size, sizes[k]);
        assert_int_equal(r.result.ellipsoids, ovoid_model_size(model));
        for (size_t b = k ? sizeof r.result : sizes[k]; b < sizeof r; ++b)
            assert_int_equal(r.bytes[b], 0xee);
        ovoid_model_destroy(&model);
    }
    r.result.size = 3;
    ovoid_model *model = NULL;
    test_refused(*state, ovoid_fit(*state, molecule, &options, &model, &r.result),
                 OVOID_ERROR_ARGUMENT, "ovoid_fit_result_init");
    ovoid_molecule_destroy(&molecule);
}

/* Entries are as far apart as the caller's are large. */
static void devices_come_in_the_size_of_the_caller(void **state) {
    const size_t sizes[] = {offsetof(ovoid_device_info, vendor), sizeof(ovoid_device_info) + LATER};
    ovoid_device_info *whole = NULL;
    size_t count = 0;
    test_check(*state, ovoid_devices(*state, sizeof *whole, &whole, &count));
    for (int k = 0; k < 2; ++k) {
        ovoid_device_info *devices = NULL;
        size_t again = 0;
        test_check(*state, ovoid_devices(*state, sizes[k], &devices, &again));
        assert_int_equal(again, count);
        for (size_t i = 0; i < count; ++i) {
            const char *const entry = (const char *)devices + i * sizes[k];
            assert_memory_equal(entry, &sizes[k], sizeof(size_t));
            assert_string_equal(entry + offsetof(ovoid_device_info, name), whole[i].name);
        }
        ovoid_free(devices);
    }
    ovoid_free(whole);
}

/* Each method fills in its own part; what the other one would tell stays unknown. */
static void results_are_of_their_method(void **state) {
    test_skip_simulated(*state);
    ovoid_fit_options options;
    ovoid_molecule *molecule = two_atoms(*state);
    for (int method = 0; method < 2; ++method) {
        ovoid_model *model = NULL;
        ovoid_fit_result result;
        ovoid_fit_options_init(&options, sizeof options);
        ovoid_fit_result_init(&result, sizeof result);
        options.method = (ovoid_method)method;
        options.l1.iterations = options.l1.sparse_iterations = 2;
        test_check(*state, ovoid_fit(*state, molecule, &options, &model, &result));
        const bool l1 = method == OVOID_METHOD_L1;
        assert_int_equal(result.method, method);
        assert_true(result.counts[OVOID_COUNT_LAUNCHES] > 0 &&
                    result.counts[OVOID_COUNT_LAUNCHES] != OVOID_UNKNOWN);
        assert_int_equal(isnan(result.l1.rms_error), !l1);
        assert_int_equal(isnan(result.l1.host_seconds), !l1);
        assert_int_equal(result.l1.field_passes == OVOID_UNKNOWN, !l1);
        assert_int_equal(result.adaptive.solver_iterations == OVOID_UNKNOWN, l1);
        assert_int_equal(result.verdict == OVOID_VERDICT_NO_GOAL, l1);
        assert_int_equal(isnan(result.distance), l1);
        assert_true(result.reached);
        ovoid_model_destroy(&model);
    }
    ovoid_molecule_destroy(&molecule);
}

/* ---- callbacks ------------------------------------------------------------------------------ */

typedef struct listener {
    ovoid_context *context, *other;
    const ovoid_molecule *molecule;
    int32_t method;
    unsigned calls, steps;
} listener;

static bool listen(const ovoid_progress *p, void *user) {
    listener *const l = user;
    const bool l1 = l->method == OVOID_METHOD_L1, adaptive = l->method == OVOID_METHOD_ADAPTIVE;
    assert_int_equal(p->size, sizeof *p);
    assert_int_equal(p->method, l->method);
    assert_true(p->total != 0 && p->iterations != 0);
    assert_int_equal(isnan(p->l1.objective), !(l1 && p->iteration > 0));
    assert_int_equal(isnan(p->l1.step), !(l1 && p->iteration > 0));
    assert_int_equal(isnan(p->adaptive.misfit), !(adaptive && p->iteration > 0));
    assert_true(l1 == (p->iterations != OVOID_UNKNOWN) || p->iteration == 0);
    l->steps += p->iteration > 0;
    ++l->calls;
    return true;
}

static void progress_is_of_its_method(void **state) {
    test_skip_simulated(*state);
    ovoid_molecule *molecule = two_atoms(*state);
    for (int method = OVOID_NO_METHOD; method <= OVOID_METHOD_L1; ++method) {
        listener l = {.method = method};
        ovoid_fit_options options;
        ovoid_mesh_options meshing;
        ovoid_model *model = NULL;
        ovoid_mesh *mesh = NULL;
        ovoid_fit_options_init(&options, sizeof options);
        ovoid_mesh_options_init(&meshing, sizeof meshing);
        options.method = method == OVOID_NO_METHOD ? OVOID_METHOD_ADAPTIVE : (ovoid_method)method;
        options.l1.iterations = options.l1.sparse_iterations = 2;
        options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
        options.adaptive.ellipsoids = 1;
        ovoid_context_on_progress(*state, listen, &l);
        if (method == OVOID_NO_METHOD)
            test_check(*state, once_molecule_mesh(*state, molecule, 0.5, &meshing, &mesh));
        else
            test_check(*state, ovoid_fit(*state, molecule, &options, &model, NULL));
        ovoid_context_on_progress(*state, NULL, NULL);
        assert_true(l.calls > 0 && (l.steps > 0) == (method != OVOID_NO_METHOD));
        ovoid_model_destroy(&model);
        ovoid_mesh_destroy(&mesh);
    }
    ovoid_molecule_destroy(&molecule);
}

/* The same context is refused, even its end; others work. */
static bool call_back(const ovoid_progress *progress, void *user) {
    listener *const l = user;
    ovoid_context *same = l->context;
    ovoid_model *model = NULL;
    const ovoid_ellipsoid one = {.amplitude = 2.0, .decay = {0.5, 0.5, 0.5}};
    (void)progress;
    test_refused(same, ovoid_model_create(same, &one, 1, 0.5, 1.0, &model), OVOID_ERROR_ARGUMENT,
                 "called from a callback");
    ovoid_context_destroy(&same);
    assert_non_null(same);
    test_check(l->other, ovoid_model_create(l->other, &one, 1, 0.5, 1.0, &model));
    ovoid_model_destroy(&model);
    ++l->calls;
    return true;
}

static void callbacks_may_use_other_contexts_alone(void **state) {
    listener l = {.context = *state};
    ovoid_molecule *molecule = two_atoms(*state);
    ovoid_mesh_options options;
    ovoid_mesh *mesh = NULL;
    ovoid_mesh_options_init(&options, sizeof options);
    test_check(NULL, ovoid_context_create(&l.other));
    ovoid_context_on_progress(*state, call_back, &l);
    test_check(*state, once_molecule_mesh(*state, molecule, 0.5, &options, &mesh));
    ovoid_context_on_progress(*state, NULL, NULL);
    assert_true(l.calls > 0);
    ovoid_mesh_destroy(&mesh);
    ovoid_context_destroy(&l.other);
    ovoid_molecule_destroy(&molecule);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(versions),
        cmocka_unit_test(sizes_of_structures),
        cmocka_unit_test(structures_begin_with_their_size),
        cmocka_unit_test(later_structures_are_taken_where_they_ask_for_nothing_new),
        cmocka_unit_test(earlier_structures_get_defaults),
        cmocka_unit_test(sizes_that_are_none_are_refused),
        cmocka_unit_test(results_fill_what_both_sides_know),
        cmocka_unit_test(devices_come_in_the_size_of_the_caller),
        cmocka_unit_test(results_are_of_their_method),
        cmocka_unit_test(progress_is_of_its_method),
        cmocka_unit_test(callbacks_may_use_other_contexts_alone),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
