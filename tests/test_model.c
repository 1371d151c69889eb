/* Models and the model file. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "comma.h"
#include "ovoid/ovoid.h"
#include "scratch.h"

#include <math.h>

static ovoid_context *context;

static int make_context(void **state) {
    (void)state;
    return ovoid_context_create(&context) == OVOID_OK ? 0 : -1;
}

static int drop_context(void **state) {
    (void)state;
    ovoid_context_destroy(&context);
    return 0;
}

static void assert_error(const char *part) {
    if (!strstr(ovoid_context_error(context), part))
        fail_msg("'%s' does not say '%s'", ovoid_context_error(context), part);
}

static const ovoid_ellipsoid plain = {1.5, {0.1, 0.2, 0.3}, {1, -2, 3.25}, {0.5, 0, -1}};

static ovoid_model *make_plain(void) {
    ovoid_model *model = NULL;
    assert_int_equal(ovoid_model_create(context, &plain, 1, 0.5, 1.0, &model), OVOID_OK);
    return model;
}

/* ---- models ------------------------------------------------------------------------------- */

static void create_copies(void **state) {
    (void)state;
    ovoid_ellipsoid two[2] = {plain, plain};
    ovoid_model *model = NULL;
    two[1].amplitude = 7;
    assert_int_equal(ovoid_model_create(context, two, 2, 0.3, 2.0, &model), OVOID_OK);
    two[1].amplitude = 8;
    assert_int_equal(ovoid_model_size(model), 2);
    assert_true(ovoid_model_ellipsoids(model)[1].amplitude == 7);
    assert_true(ovoid_model_decay(model) == 0.3);
    assert_true(ovoid_model_isovalue(model) == 2.0);
    assert_null(ovoid_model_note(model, 0));
    assert_null(ovoid_model_owner(model)); /* only a fit knows */
    assert_int_equal(ovoid_model_owner_count(model), 0);
    ovoid_model_destroy(&model);
    assert_null(model);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(NULL);
    assert_int_equal(ovoid_model_size(NULL), 0);
    assert_null(ovoid_model_ellipsoids(NULL));
    assert_null(ovoid_model_owner(NULL));
    assert_int_equal(ovoid_model_owner_count(NULL), 0);
    assert_null(ovoid_model_note(NULL, 0));
}

static void refuse(const ovoid_ellipsoid *bad, const char *text) {
    const ovoid_ellipsoid two[2] = {plain, *bad};
    ovoid_model *model = NULL;
    assert_int_equal(ovoid_model_create(context, two, 2, 0.5, 1, &model), OVOID_ERROR_ARGUMENT);
    assert_null(model);
    assert_error("ellipsoid 1: ");
    assert_error(text);
}

static void create_refuses(void **state) {
    (void)state;
    ovoid_model *model = NULL;
    for (size_t i = 0; i < 10; i++) {
        const double bad[] = {NAN, INFINITY, 0.0, -1.0};
        for (size_t j = 0; j < (i < 4 ? 4 : 2); j++) {
            double values[10];
            ovoid_ellipsoid e;
            memcpy(values, &plain, sizeof values);
            values[i] = bad[j];
            memcpy(&e, values, sizeof e);
            refuse(&e, j < 2 ? "must be finite" : "must be positive");
        }
    }
    assert_int_equal(ovoid_model_create(context, &plain, 0, 0.5, 1, &model), OVOID_ERROR_EMPTY);
    assert_int_equal(ovoid_model_create(context, NULL, 1, 0.5, 1, &model), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_create(context, &plain, 1, 0, 1, &model), OVOID_ERROR_ARGUMENT);
    assert_error("decay");
    assert_int_equal(ovoid_model_create(context, &plain, 1, NAN, 1, &model), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_create(context, &plain, 1, 0.5, -1, &model), OVOID_ERROR_ARGUMENT);
    assert_error("isovalue");
    assert_null(model);
}

/* ---- units -------------------------------------------------------------------------------- */

/* A third of a turn about (1, 1, 1), and a shift; half a turn about x. */
static const ovoid_motion moves[3] = {
    {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}},
    {{0, 0, 1, 1, 0, 0, 0, 1, 0}, {5, -7, 0.125}},
    {{1, 0, 0, 0, -1, 0, 0, 0, -1}, {0, 2, 3}},
};

static ovoid_model *make_placed(void) {
    ovoid_ellipsoid two[2] = {plain, plain};
    ovoid_model *model = NULL;
    two[1].amplitude = 2;
    two[1].centre[0] = 6;
    assert_int_equal(ovoid_model_create_placed(context, two, 2, moves, 3, 0.5, 1.0, &model),
                     OVOID_OK);
    return model;
}

/* ln of an ellipsoid's value at a point, by the header's words. */
static double log_value(const ovoid_ellipsoid *e, const double at[3]) {
    const double ca = cos(e->angle[0]), sa = sin(e->angle[0]), cb = cos(e->angle[1]),
                 sb = sin(e->angle[1]), cg = cos(e->angle[2]), sg = sin(e->angle[2]);
    const double r[3][3] = {{cb * cg, -ca * sg - sa * sb * cg, sa * sg - ca * sb * cg},
                            {cb * sg, ca * cg - sa * sb * sg, -sa * cg - ca * sb * sg},
                            {sb, sa * cb, ca * cb}};
    double sum = log(e->amplitude);
    for (int p = 0; p < 3; p++) {
        double along = 0.0;
        for (int k = 0; k < 3; k++)
            along += r[p][k] * (at[k] - e->centre[k]);
        sum -= e->decay[p] * along * along;
    }
    return sum;
}

static void move_point(const ovoid_motion *motion, const double at[3], double moved[3]) {
    for (int i = 0; i < 3; i++) {
        moved[i] = motion->translation[i];
        for (int k = 0; k < 3; k++)
            moved[i] += motion->rotation[3 * i + k] * at[k];
    }
}

/* All are there: what an ellipsoid of the unit is at a point, its image is where that goes. */
static void expect_placed(const ovoid_model *model, const ovoid_ellipsoid *all) {
    static const double points[4][3] = {{0, 0, 0}, {1, -2, 4}, {3, 1, 2}, {-1, -3, 3}};
    const size_t each = ovoid_model_unit_size(model);
    assert_non_null(all);
    for (size_t n = 0; n < 3 * each; n++) {
        const ovoid_ellipsoid *const of = &ovoid_model_unit_ellipsoids(model)[n % each];
        assert_true(all[n].amplitude == of->amplitude);
        assert_memory_equal(all[n].decay, of->decay, sizeof of->decay);
        for (size_t k = 0; k < 4; k++) {
            double moved[3];
            move_point(&moves[n / each], points[k], moved);
            assert_true(fabs(log_value(&all[n], moved) - log_value(of, points[k])) < 1e-12);
        }
    }
    assert_memory_equal(all, ovoid_model_unit_ellipsoids(model), each * sizeof *all);
}

static void units_stand_for_all(void **state) {
    (void)state;
    size_t count = 7;
    ovoid_model *model = make_placed(), *all = NULL;
    assert_int_equal(ovoid_model_size(model), 6);
    assert_int_equal(ovoid_model_unit_size(model), 2);
    assert_memory_equal(ovoid_model_placements(model, &count), moves, sizeof moves);
    assert_int_equal(count, 3);
    expect_placed(model, ovoid_model_ellipsoids(model));
    assert_ptr_equal(ovoid_model_ellipsoids(model), ovoid_model_ellipsoids(model));
    assert_int_equal(ovoid_model_annotate(context, model, "a", "b"), OVOID_OK);
    assert_int_equal(ovoid_model_expand(context, model, &all), OVOID_OK);
    assert_int_equal(ovoid_model_size(all), 6);
    assert_int_equal(ovoid_model_unit_size(all), 6);
    assert_null(ovoid_model_placements(all, &count));
    assert_int_equal(count, 0);
    assert_memory_equal(ovoid_model_ellipsoids(all), ovoid_model_ellipsoids(model),
                        6 * sizeof(ovoid_ellipsoid));
    assert_string_equal(ovoid_model_note(all, 0), "a: b");
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&all);
}

/* Whatever its shape, an image has the decay rates of its unit, to the last bit. */
static void images_of_needles_are_needles(void **state) {
    (void)state;
    const ovoid_ellipsoid needle = {1, {1e300, 1, 1e-300}, {0, 0, 0}, {0.3, 1.5707963267948966, 2}};
    const double third = 1.0 / 3.0, most = 2.0 * third;
    const ovoid_motion turn = {{most, -third, most, most, most, -third, -third, most, most}, {0}};
    ovoid_model *model = NULL;
    assert_int_equal(ovoid_model_create_placed(context, &needle, 1, &turn, 1, 0.5, 1.0, &model),
                     OVOID_OK);
    assert_memory_equal(ovoid_model_ellipsoids(model)->decay, needle.decay, sizeof needle.decay);
    for (int k = 0; k < 3; k++)
        assert_true(isfinite(ovoid_model_ellipsoids(model)->angle[k]));
    ovoid_model_destroy(&model);
}

static void refuse_placement(size_t count, size_t value, double number, ovoid_status expected,
                             const char *text) {
    static ovoid_motion many[OVOID_MODEL_PLACEMENTS_MAX + 1];
    ovoid_model *model = NULL;
    double values[12];
    for (size_t n = 0; n < count; n++)
        many[n] = moves[n % 3];
    memcpy(values, &many[1], sizeof values);
    values[value] = number;
    memcpy(&many[1], values, sizeof values);
    assert_int_equal(ovoid_model_create_placed(context, &plain, 1, many, count, 0.5, 1.0, &model),
                     expected);
    assert_null(model);
    assert_error(text);
}

static void placements_are_rotations(void **state) {
    (void)state;
    static const char skew[] = "placement 1: its nine first numbers are no rotation";
    static const char far[] = "placement 1: its translation is not within 1e100 angstrom";
    const ovoid_ellipsoid away = {1, {1, 1, 1}, {0, 1e101, 0}, {0, 0, 0}};
    ovoid_model *model = NULL;
    refuse_placement(2, 0, 0.1, OVOID_ERROR_ARGUMENT, skew);
    refuse_placement(2, 2, -1, OVOID_ERROR_ARGUMENT, skew); /* a mirror */
    refuse_placement(2, 3, NAN, OVOID_ERROR_ARGUMENT, skew);
    refuse_placement(2, 8, INFINITY, OVOID_ERROR_ARGUMENT, skew);
    refuse_placement(2, 9, NAN, OVOID_ERROR_ARGUMENT, far);
    refuse_placement(2, 11, -1e101, OVOID_ERROR_ARGUMENT, far);
    refuse_placement(OVOID_MODEL_PLACEMENTS_MAX + 1, 9, 0, OVOID_ERROR_LIMIT,
                     "100001 placements of a model's unit are more than 100000");
    assert_int_equal(ovoid_model_create_placed(context, &away, 1, moves, 3, 0.5, 1.0, &model),
                     OVOID_ERROR_ARGUMENT);
    assert_error("ellipsoid 0: its centre, which is to be placed, is not within 1e100 angstrom");
    assert_int_equal(ovoid_model_create(context, &away, 1, 0.5, 1.0, &model), OVOID_OK);
    ovoid_model_destroy(&model);
}

/* Numbers of ellipsoids, and owners, are those of all. */
static void all_ellipsoids_can_be_numbered(void **state) {
    (void)state;
    enum { COUNT = 42950 }; /* times 100000 is just above 2^32 */
    ovoid_ellipsoid *const unit = calloc(COUNT, sizeof *unit);
    ovoid_motion *const many = calloc(OVOID_MODEL_PLACEMENTS_MAX, sizeof *many);
    ovoid_model *model = NULL;
    assert_true(unit && many);
    for (size_t i = 0; i < COUNT; i++)
        unit[i] = plain;
    for (size_t n = 0; n < OVOID_MODEL_PLACEMENTS_MAX; n++)
        many[n] = moves[n % 3];
    assert_int_equal(ovoid_model_create_placed(context, unit, COUNT, many,
                                               OVOID_MODEL_PLACEMENTS_MAX, 0.5, 1.0, &model),
                     OVOID_ERROR_LIMIT);
    assert_error("100000 units of 42950 ellipsoids are more than 4294967295 ellipsoids");
    assert_int_equal(ovoid_model_create_placed(context, unit, COUNT - 1, many,
                                               OVOID_MODEL_PLACEMENTS_MAX, 0.5, 1.0, &model),
                     OVOID_OK);
    assert_true(ovoid_model_size(model) == 4294900000u);
    ovoid_model_destroy(&model);
    free(unit);
    free(many);
}

/* ---- notes -------------------------------------------------------------------------------- */

static void notes_are_kept(void **state) {
    (void)state;
    ovoid_model *model = make_plain();
    assert_int_equal(ovoid_model_annotate(context, model, "input", " a: b.pqr \t"), OVOID_OK);
    assert_int_equal(ovoid_model_annotate(context, model, "empty", ""), OVOID_OK);
    assert_string_equal(ovoid_model_note(model, 0), "input: a: b.pqr");
    assert_string_equal(ovoid_model_note(model, 1), "empty:");
    assert_null(ovoid_model_note(model, 2));
    static const char *const keys[] = {"",     "#key",  " key",     "a:b",
                                       "a\nb", "decay", "isovalue", "placement"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        assert_int_equal(ovoid_model_annotate(context, model, keys[i], "x"), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_annotate(context, model, "key", "a\nb"), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_annotate(context, model, "key", "a\rb"), OVOID_ERROR_ARGUMENT);
    assert_null(ovoid_model_note(model, 2));
    for (int i = 0; i < 100; i++)
        assert_int_equal(ovoid_model_annotate(context, model, "key", "x"), OVOID_OK);
    assert_non_null(ovoid_model_note(model, 101));
    ovoid_model_destroy(&model);
}

/* ---- writing ------------------------------------------------------------------------------ */

static const char plain_file[] = "# ovoid model 1\n"
                                 "# decay: 0.5\n"
                                 "# isovalue: 1\n"
                                 "# input: a.pqr\n"
                                 "# empty:\n"
                                 "# amplitude decay1 decay2 decay3 x y z alpha beta gamma\n"
                                 "1.5 0.1 0.2 0.3 1 -2 3.25 0.5 0 -1\n";

static void write_plain(const char *path) {
    ovoid_model *model = make_plain();
    assert_int_equal(ovoid_model_annotate(context, model, "input", "a.pqr"), OVOID_OK);
    assert_int_equal(ovoid_model_annotate(context, model, "empty", ""), OVOID_OK);
    assert_int_equal(ovoid_model_write(context, model, path), OVOID_OK);
    ovoid_model_destroy(&model);
}

static void assert_holds(const char *path, const char *text) {
    char *found = scratch_read(path);
    assert_non_null(found);
    assert_string_equal(found, text);
    free(found);
}

static void file_is_as_documented(void **state) {
    const char *path = scratch_path(*state, "m.ovoid");
    write_plain(path);
    assert_holds(path, plain_file);
    assert_int_equal(scratch_entries(*state), 1);
}

static const char placed_file[] = "# ovoid model 2\n# decay: 0.5\n# isovalue: 1\n"
                                  "# placement: 1 0 0 0 1 0 0 0 1 0 0 0\n"
                                  "# placement: 0 0 1 1 0 0 0 1 0 5 -7 0.125\n"
                                  "# placement: 1 0 0 0 -1 0 0 0 -1 0 2 3\n"
                                  "# amplitude decay1 decay2 decay3 x y z alpha beta gamma\n"
                                  "1.5 0.1 0.2 0.3 1 -2 3.25 0.5 0 -1\n"
                                  "2 0.1 0.2 0.3 6 -2 3.25 0.5 0 -1\n";

static void files_hold_units_and_placements(void **state) {
    const char *path = scratch_path(*state, "p.ovoid");
    ovoid_model *model = make_placed(), *again = NULL;
    assert_int_equal(ovoid_model_write(context, model, path), OVOID_OK);
    assert_holds(path, placed_file);
    assert_int_equal(ovoid_model_read(context, path, &again), OVOID_OK);
    assert_int_equal(ovoid_model_size(again), 6);
    assert_memory_equal(ovoid_model_placements(again, NULL), moves, sizeof moves);
    expect_placed(again, ovoid_model_ellipsoids(again));
    assert_null(ovoid_model_note(again, 0));
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&again);
}

/* Far from their unit, images are where they were to the last bit of the rotation. */
static void placements_round_trip_to_the_bit(void **state) {
    const char *path = scratch_path(*state, "p.ovoid");
    const double c = cos(0.1), s = sin(0.1);
    const ovoid_motion turn = {{c, -s, 0, s, c, 0, 0, 0, 1}, {1.0 / 3, 1e5 / 7, -1e-9 / 3}};
    ovoid_model *model = NULL, *again = NULL;
    size_t count;
    assert_int_equal(ovoid_model_create_placed(context, &plain, 1, &turn, 1, 0.5, 1.0, &model),
                     OVOID_OK);
    assert_int_equal(ovoid_model_write(context, model, path), OVOID_OK);
    assert_int_equal(ovoid_model_read(context, path, &again), OVOID_OK);
    assert_memory_equal(ovoid_model_placements(again, &count), &turn, sizeof turn);
    assert_int_equal(count, 1);
    assert_memory_equal(ovoid_model_ellipsoids(again), ovoid_model_ellipsoids(model),
                        sizeof(ovoid_ellipsoid));
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&again);
}

static void write_fails_cleanly(void **state) {
    scratch *s = *state;
    ovoid_model *model = make_plain();
    assert_int_equal(ovoid_model_write(context, model, scratch_path(s, "no/m.ovoid")),
                     OVOID_ERROR_IO);
    assert_int_equal(ovoid_model_write(context, model, s->folder), OVOID_ERROR_IO);
    assert_int_equal(ovoid_model_write(context, model, NULL), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_write(context, NULL, "x"), OVOID_ERROR_ARGUMENT);
    if (access("/dev/full", W_OK) == 0) {
        assert_int_equal(ovoid_model_write(context, model, "/dev/full"), OVOID_ERROR_IO);
        assert_error("No space left on device");
    }
    assert_int_equal(scratch_entries(s), 0);
    ovoid_model_destroy(&model);
}

/* Uniform in [0, 1), the same on every machine. */
static double next_random(uint64_t *seed) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 11) / 9007199254740992.0;
}

static void round_trip_is_exact(void **state) {
    scratch *s = *state;
    enum { COUNT = 2000 };
    static ovoid_ellipsoid many[COUNT];
    uint64_t seed = 1;
    for (size_t i = 0; i < COUNT; i++) {
        double values[10];
        for (size_t j = 0; j < 10; j++)
            values[j] = j < 4 ? exp(600.0 * (next_random(&seed) - 0.5))
                              : 200.0 * next_random(&seed) - 100.0;
        memcpy(&many[i], values, sizeof values);
    }
    many[0] = (ovoid_ellipsoid){5e-324, {1.7e308, 2.3e-308, 1}, {-0.0, 1e300, -1e300}, {1, 2, 3}};
    ovoid_model *model = NULL, *again = NULL;
    assert_int_equal(ovoid_model_create(context, many, COUNT, 0.1 + 0.2, 1.0 / 3, &model),
                     OVOID_OK);
    assert_int_equal(ovoid_model_annotate(context, model, "input", "a b: c.pqr"), OVOID_OK);
    assert_int_equal(ovoid_model_annotate(context, model, "Å", "β: γ"), OVOID_OK);
    const char *first = scratch_path(s, "first"), *second = scratch_path(s, "second");
    assert_int_equal(ovoid_model_write(context, model, first), OVOID_OK);
    assert_int_equal(ovoid_model_read(context, first, &again), OVOID_OK);
    assert_int_equal(ovoid_model_size(again), COUNT);
    for (size_t i = 1; i < COUNT; i++) {
        double x[10], y[10];
        memcpy(x, &many[i], sizeof x);
        memcpy(y, &ovoid_model_ellipsoids(again)[i], sizeof y);
        for (size_t j = 0; j < 10; j++)
            assert_true(fabs(x[j] - y[j]) <= 5e-9 * fabs(x[j]));
    }
    assert_true(fabs(ovoid_model_isovalue(again) - 1.0 / 3) < 1e-9);
    assert_string_equal(ovoid_model_note(again, 0), "input: a b: c.pqr");
    assert_string_equal(ovoid_model_note(again, 1), "Å: β: γ");
    assert_null(ovoid_model_note(again, 2));
    assert_int_equal(ovoid_model_write(context, again, second), OVOID_OK);
    char *text = scratch_read(first);
    assert_holds(second, text);
    free(text);
    ovoid_model_destroy(&model);
    ovoid_model_destroy(&again);
}

/* ---- reading ------------------------------------------------------------------------------ */

#define MAGIC "# ovoid model 1\n"
#define MAGIC2 "# ovoid model 2\n"
#define PLACEMENT "# placement: 1 0 0 0 1 0 0 0 1 0 0 0\n"
#define ROW "1.5 0.1 0.2 0.3 1 -2 3.25 0.5 0 -1\n"

static ovoid_status read_text(scratch *s, const char *text, ovoid_model **model) {
    const char *path = scratch_path(s, "in.ovoid");
    scratch_write(path, text, strlen(text));
    return ovoid_model_read(context, path, model);
}

static void reader_is_tolerant(void **state) {
    static const char *const texts[] = {
        MAGIC ROW ROW,
        "# ovoid model 1\r\n\r\n1.5 0.1 0.2 0.3 1 -2 3.25 0.5 0 -1\r\n" ROW,
        "\n\n" MAGIC "\n" ROW "\n  \t\n" ROW "\n",
        MAGIC "#\n# a remark\n#no space\n## more\n" ROW "# between\n  # and here\n" ROW "# end",
        "\xef\xbb\xbf" MAGIC ROW ROW,
        "#ovoid model 1\n" ROW "1.5 .1 2e-1 +0.3 1. -2.0 3.25 0.5 0 -1.",
        MAGIC " \t1.5\t0.1  0.2 0.3 1 -2 3.25 0.5 0 -1  \n" ROW,
        MAGIC "# decay: 0.5\n# isovalue: 1\n" ROW "# decay: what follows is no header\n" ROW,
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        ovoid_model *model = NULL;
        if (read_text(*state, texts[i], &model) != OVOID_OK)
            fail_msg("text %zu: %s", i, ovoid_context_error(context));
        assert_int_equal(ovoid_model_size(model), 2);
        assert_memory_equal(&ovoid_model_ellipsoids(model)[0], &plain, sizeof plain);
        assert_memory_equal(&ovoid_model_ellipsoids(model)[1], &plain, sizeof plain);
        assert_true(ovoid_model_decay(model) == OVOID_DEFAULT_DECAY);
        assert_true(ovoid_model_isovalue(model) == OVOID_DEFAULT_ISOVALUE);
        ovoid_model_destroy(&model);
    }
}

static void header_is_read(void **state) {
    ovoid_model *model = NULL;
    assert_int_equal(read_text(*state,
                               MAGIC "# input: x.pqr\n# decay: 0.3\n#isovalue: 2.5\n"
                                     "# time 12:30 is no key\n" ROW "# late: 1\n",
                               &model),
                     OVOID_OK);
    assert_true(ovoid_model_decay(model) == 0.3);
    assert_true(ovoid_model_isovalue(model) == 2.5);
    assert_string_equal(ovoid_model_note(model, 0), "input: x.pqr");
    assert_null(ovoid_model_note(model, 1));
    ovoid_model_destroy(&model);
}

static void bad_files_are_located(void **state) {
    static const struct {
        const char *text, *error;
    } cases[] = {
        {"1.5 0.1\n", "in.ovoid:1:1: not a model file"},
        {"ovoid model 1\n", "in.ovoid:1:1: not a model file"},
        {"# a model\n" ROW, "in.ovoid:1:1: not a model file"},
        {"# ovoid model\n" ROW, ":1:14: the version of the model file is not a number"},
        {"# ovoid model x\n" ROW, ":1:15: the version"},
        {"# ovoid model 1 x\n" ROW, ":1:15: the version"},
        {"# ovoid model 3\n" ROW, ":1:15: the model file has version 3"},
        {"# ovoid model 2\n" ROW, ":2:1: a model file of version 2 has placements before its"},
        {MAGIC PLACEMENT ROW, ":2:3: a file with placements begins with '# ovoid model 2'"},
        {MAGIC "# placement: none\n" ROW, ":2:3: a file with placements"},
        {MAGIC2 PLACEMENT ROW PLACEMENT, ":4:3: placements come before the first ellipsoid"},
        {MAGIC2 "# placement: 1 0 0 0 1 0 0 0 1 0 0\n" ROW, ":2:35: t3 is missing: a placement"},
        {MAGIC2 "# placement:\n" ROW, ":2:13: r11 is missing"},
        {MAGIC2 "# placement: 1 0 0 0 1 0 0 0 1 0 0 0 0\n" ROW, ":2:38: more than the twelve"},
        {MAGIC2 "# placement: 1 0 0 0 one 0 0 0 1 0 0 0\n" ROW,
         ":2:22: r22 is not a number: 'one'"},
        {MAGIC2 "# placement: 1 0 0 0 nan 0 0 0 1 0 0 0\n" ROW, ":2:22: r22 is not a number"},
        {MAGIC2 "# placement: 1 0 0 0 1 0 0 0 1 0 0 1e999\n" ROW, ":2:36: t3 is too large"},
        {MAGIC2 "# placement: 1 0 0 0 1 0 0 0 1 0 0 1e101\n" ROW,
         ":2:14: placement: its translation is not within 1e100 angstrom"},
        {MAGIC2 "# placement: 1 0 0 0 1 0 0 0 -1 0 0 0\n" ROW,
         ":2:14: placement: its nine first numbers are no rotation"},
        {MAGIC2 "# placement: 2 0 0 0 1 0 0 0 1 0 0 0\n" ROW, "are no rotation"},
        {MAGIC2 "# placement: 0 0 0 0 0 0 0 0 0 0 0 0\n" ROW, "are no rotation"},
        {MAGIC2 "# placement: 1e200 0 0 0 1 0 0 0 1 0 0 0\n" ROW, "are no rotation"},
        {MAGIC2 PLACEMENT "1 1 1 1 0 0 -1e101 0 0 0\n", ":3:1: ellipsoid: its centre, which is to"},
        {MAGIC ROW "1 1 1 1 0 0 0 0 0\n", ":3:18: gamma is missing"},
        {MAGIC "1 1 1 1 0 0 0 0 0 0 0\n", ":2:21: more than the ten numbers"},
        {MAGIC "1 1 1 1 0 0 0 0 0 0 # no\n", ":2:21: more than the ten numbers"},
        {MAGIC "1 1 1 1 zero 0 0 0 0 0\n", ":2:9: x is not a number: 'zero'"},
        {MAGIC "1 1 1 1 0 0 0 0 0 0x1\n", ":2:19: gamma is not a number: '0x1'"},
        {MAGIC "1 1 1 1 nan 0 0 0 0 0\n", ":2:9: x is not a number"},
        {MAGIC "1 1 1 1 inf 0 0 0 0 0\n", ":2:9: x is not a number"},
        {MAGIC "1 1 1 1 1e999 0 0 0 0 0\n", ":2:9: x is too large"},
        {MAGIC "1 1 1 1 1e 0 0 0 0 0\n", ":2:9: x is not a number"},
        {MAGIC "1 1 1 1 1-2 0 0 0 0 0\n", ":2:9: x is not a number"},
        {MAGIC "1,5 1 1 1 0 0 0 0 0 0\n", ":2:1: amplitude is not a number"},
        {MAGIC "0 1 1 1 0 0 0 0 0 0\n", ":2:1: amplitude must be positive"},
        {MAGIC "1e-999 1 1 1 0 0 0 0 0 0\n", ":2:1: amplitude must be positive"},
        {MAGIC "\n  1 1 -1 1 0 0 0 0 0 0\n", ":3:7: decay2 must be positive"},
        {MAGIC "# decay: 0\n" ROW, ":2:10: decay must be positive"},
        {MAGIC "# decay:\n" ROW, ":2:9: decay is not a number"},
        {MAGIC "# isovalue: -1\n" ROW, ":2:13: isovalue must be positive"},
        {MAGIC "# isovalue: 1 A\n" ROW, ":2:13: isovalue is not a number: '1 A'"},
        {MAGIC "# decay: 0.5\n# decay: 0.5\n" ROW, ":3:3: decay is given twice"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        ovoid_model *model = NULL;
        assert_int_equal(read_text(*state, cases[i].text, &model), OVOID_ERROR_FORMAT);
        assert_null(model);
        assert_error(cases[i].error);
    }
}

static void files_that_are_no_text_are_refused(void **state) {
    scratch *s = *state;
    enum { LONG = 100000 };
    ovoid_model *model = NULL;
    const char *path = scratch_path(s, "in.ovoid");
    scratch_write(path, "# ovoid model 1\n1 1 1 \0 1", 26);
    assert_int_equal(ovoid_model_read(context, path, &model), OVOID_ERROR_FORMAT);
    assert_error(":2:7: a zero byte");
    char *text = malloc(LONG);
    assert_non_null(text);
    memset(text, '#', LONG);
    scratch_write(path, text, LONG);
    free(text);
    assert_int_equal(ovoid_model_read(context, path, &model), OVOID_ERROR_FORMAT);
    assert_error("too long");
    assert_null(model);
}

static void empty_files_are_empty(void **state) {
    static const char *const texts[] = {"", "\n\n", MAGIC, MAGIC "# decay: 1\n#\n\n"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        ovoid_model *model = NULL;
        assert_int_equal(read_text(*state, texts[i], &model), OVOID_ERROR_EMPTY);
        assert_null(model);
        assert_error("holds no ellipsoid");
    }
}

static void unreadable_files_are_named(void **state) {
    scratch *s = *state;
    ovoid_model *model = NULL;
    assert_int_equal(ovoid_model_read(context, scratch_path(s, "nothing"), &model), OVOID_ERROR_IO);
    assert_error("nothing': No such file or directory");
    assert_int_equal(ovoid_model_read(context, s->folder, &model), OVOID_ERROR_IO);
    assert_error("Is a directory");
    assert_int_equal(ovoid_model_read(context, NULL, &model), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_model_read(context, "x", NULL), OVOID_ERROR_ARGUMENT);
    assert_null(model);
}

static void standard_input_is_read(void **state) {
    const char *path = scratch_path(*state, "in.ovoid");
    ovoid_model *model = NULL;
    scratch_write(path, plain_file, sizeof plain_file - 1);
    assert_non_null(freopen(path, "r", stdin));
    assert_int_equal(ovoid_model_read(context, "-", &model), OVOID_OK);
    assert_int_equal(ovoid_model_size(model), 1);
    ovoid_model_destroy(&model);
    scratch_write(path, MAGIC "x\n", sizeof MAGIC + 1);
    assert_non_null(freopen(path, "r", stdin));
    assert_int_equal(ovoid_model_read(context, "-", &model), OVOID_ERROR_FORMAT);
    assert_error("standard input:2:1: ");
}

/* ---- locale ------------------------------------------------------------------------------- */

static void locale_changes_nothing(void **state) {
    scratch *s = *state;
    ovoid_model *model = NULL;
    if (!comma_enter(s)) {
        setlocale(LC_ALL, "C");
        print_message("no locale with a decimal comma here\n");
        skip();
    }
    const char *path = scratch_path(s, "m.ovoid");
    write_plain(path);
    char *text = scratch_read(path);
    ovoid_status status = ovoid_model_read(context, path, &model);
    assert_true(comma_leave(s)); /* the caller's locale is as it was */
    assert_string_equal(text, plain_file);
    free(text);
    assert_int_equal(status, OVOID_OK);
    assert_memory_equal(ovoid_model_ellipsoids(model), &plain, sizeof plain);
    ovoid_model_destroy(&model);
}

#define IN_SCRATCH(test) cmocka_unit_test_setup_teardown(test, scratch_setup, scratch_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(create_copies),
        cmocka_unit_test(create_refuses),
        cmocka_unit_test(units_stand_for_all),
        cmocka_unit_test(images_of_needles_are_needles),
        cmocka_unit_test(placements_are_rotations),
        cmocka_unit_test(all_ellipsoids_can_be_numbered),
        cmocka_unit_test(notes_are_kept),
        IN_SCRATCH(file_is_as_documented),
        IN_SCRATCH(files_hold_units_and_placements),
        IN_SCRATCH(placements_round_trip_to_the_bit),
        IN_SCRATCH(write_fails_cleanly),
        IN_SCRATCH(round_trip_is_exact),
        IN_SCRATCH(reader_is_tolerant),
        IN_SCRATCH(header_is_read),
        IN_SCRATCH(bad_files_are_located),
        IN_SCRATCH(files_that_are_no_text_are_refused),
        IN_SCRATCH(empty_files_are_empty),
        IN_SCRATCH(unreadable_files_are_named),
        IN_SCRATCH(standard_input_is_read),
        IN_SCRATCH(locale_changes_nothing),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
