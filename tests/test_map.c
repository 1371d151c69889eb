/*
 * Density maps: MRC2014 and OpenDX files are read by readers written from the formats' documents,
 * and by gemmi and PyMOL where those are installed; their values are those of the reference.
 */
#include "model/ellipsoid.h"
#include "ovoid/ovoid.h"
#include "scratch.h"
#include "support.h"

#include <sys/stat.h>

/* ---- fields ------------------------------------------------------------------------------- */

/* A field in all the forms that the tests need. */
typedef struct subject {
    ovoid_model *model; /* one of both */
    ovoid_molecule *molecule;
    ov_quadric *quadrics;
    size_t count;
} subject;

static const double decay = 0.45;

/* Off the origin, so that start indices are neither 0 nor of one sign. */
static subject model_subject(ovoid_context *context) {
    subject s = {.count = 4, .quadrics = test_alloc(4, sizeof(ov_quadric))};
    const ovoid_ellipsoid e[4] = {{3.0, {0.2, 0.5, 1.5}, {20.3, -3.1, 0.4}, {0.3, 0.5, -0.7}},
                                  {1.4, {0.9, 0.3, 0.6}, {22.3, -1.1, 1.4}, {1.3, -0.5, 0.7}},
                                  {0.6, {0.5, 0.5, 0.5}, {21.3, -5.1, -1.4}, {0, 0, 0}},
                                  {1e-9, {0.5, 0.5, 0.5}, {20.3, -3.1, 0.4}, {0, 0, 0}}};
    test_check(context, ovoid_model_create(context, e, 4, 0.5, 1.0, &s.model));
    for (size_t i = 0; i < 4; i++)
        ov_quadric_of_ellipsoid(&e[i], &s.quadrics[i]);
    return s;
}

static subject molecule_subject(ovoid_context *context) {
    subject s = {.count = 3, .quadrics = test_alloc(3, sizeof(ov_quadric))};
    const double xyzr[12] = {-10.3, 4.1, 7.7, 1.7, -8.9, 4.4, 7.1, 1.2, -9.4, 3.1, 8.6, 0.0};
    test_check(context, ovoid_molecule_create(context, xyzr, 3, &s.molecule));
    for (size_t i = 0; i < 3; i++)
        ov_quadric_of_atom(xyzr + 4 * i, decay, &s.quadrics[i]);
    return s;
}

static void subject_free(subject *s) {
    ovoid_model_destroy(&s->model);
    ovoid_molecule_destroy(&s->molecule);
    free(s->quadrics);
}

static ovoid_status export_subject(ovoid_context *context, const subject *s, const char *path,
                                   const ovoid_export_options *options) {
    return s->model ? once_model_export(context, s->model, path, options)
                    : once_molecule_export(context, s->molecule, decay, path, options);
}

/* ---- readers ------------------------------------------------------------------------------ */

typedef struct map {
    long size[3];
    double origin[3], spacing[3];
    double low, high, mean, deviation; /* as the header says, if it does */
    float *values;                     /* x fastest */
} map;

static size_t map_count(const map *m) {
    return (size_t)(m->size[0] * m->size[1] * m->size[2]);
}

static uint32_t word(const unsigned char *header, int number) {
    const unsigned char *p = header + 4 * (number - 1);
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static double real(const unsigned char *header, int number) {
    const uint32_t bits = word(header, number);
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

static map read_ccp4(FILE *stream) {
    unsigned char header[1024], value[4];
    uint32_t cell = 0;
    map m;
    assert_non_null(stream);
    assert_int_equal(fread(header, 1, sizeof header, stream), sizeof header);
    assert_int_equal(word(header, 4), 2);
    assert_int_equal(word(header, 23), 1);
    assert_int_equal(word(header, 24), 0); /* no extended header */
    assert_int_equal(word(header, 28), 20140);
    assert_memory_equal(header + 208, "MAP DD\0\0", 8);
    assert_int_equal(word(header, 56), 1);
    assert_memory_equal(header + 224, "Ovoid ", 6);
    for (int i = 0; i < 80; i++)
        assert_in_range(header[224 + i], ' ', '~');
    for (int axis = 0; axis < 3; axis++) {
        m.size[axis] = (long)word(header, 1 + axis);
        assert_true(word(header, 8 + axis) >= m.size[axis]);
        cell = word(header, 8 + axis) > cell ? word(header, 8 + axis) : cell;
        assert_true(real(header, 14 + axis) == 90.0);
        assert_int_equal(word(header, 17 + axis), axis + 1);
        m.spacing[axis] = real(header, 11 + axis) / (double)word(header, 8 + axis);
        m.origin[axis] = (double)(int32_t)word(header, 5 + axis) * m.spacing[axis];
        assert_true(real(header, 50 + axis) == 0.0); /* ORIGIN: some add it to NXSTART */
    }
    for (int axis = 0; axis < 3; axis++) /* what ChimeraX believes */
        assert_true(labs((long)(int32_t)word(header, 5 + axis)) <= 10 * (long)cell);
    m.low = real(header, 20);
    m.high = real(header, 21);
    m.mean = real(header, 22);
    m.deviation = real(header, 55);
    m.values = test_alloc(map_count(&m), sizeof *m.values);
    for (size_t k = 0; k < map_count(&m); k++) {
        assert_int_equal(fread(value, 1, 4, stream), 4);
        m.values[k] = (float)real(value, 1);
    }
    assert_int_equal(fread(value, 1, 1, stream), 0);
    return m;
}

static map read_dx(FILE *stream) {
    char line[256];
    long other[3];
    unsigned long long items;
    map m = {.low = NAN};
    assert_non_null(stream);
    do
        assert_non_null(fgets(line, sizeof line, stream));
    while (line[0] == '#');
    assert_int_equal(sscanf(line, "object 1 class gridpositions counts %ld %ld %ld", m.size,
                            m.size + 1, m.size + 2),
                     3);
    assert_int_equal(fscanf(stream, " origin %lf %lf %lf", m.origin, m.origin + 1, m.origin + 2),
                     3);
    for (int row = 0; row < 3; row++) {
        double delta[3];
        assert_int_equal(fscanf(stream, " delta %lf %lf %lf", delta, delta + 1, delta + 2), 3);
        m.spacing[row] = delta[row];
        assert_true(delta[(row + 1) % 3] == 0.0 && delta[(row + 2) % 3] == 0.0);
    }
    assert_int_equal(fscanf(stream, " object 2 class gridconnections counts %ld %ld %ld", other,
                            other + 1, other + 2),
                     3);
    assert_memory_equal(other, m.size, sizeof other);
    assert_int_equal(
        fscanf(stream, " object 3 class array type double rank 0 items %llu data follows", &items),
        1);
    assert_int_equal(items, map_count(&m));
    m.values = test_alloc(items, sizeof *m.values);
    for (long x = 0; x < m.size[0]; x++)
        for (long y = 0; y < m.size[1]; y++)
            for (long z = 0; z < m.size[2]; z++)
                assert_int_equal(
                    fscanf(stream, "%f", &m.values[(z * m.size[1] + y) * m.size[0] + x]), 1);
    assert_int_equal(fscanf(stream, " attribute \"dep\" string \"%255[^\"]\"", line), 1);
    assert_string_equal(line, "positions");
    assert_int_equal(fscanf(stream, " object \"%255[^\"]\" class field", line), 1);
    return m;
}

typedef struct format {
    const char *name;
    map (*read)(FILE *stream);
    double rounding; /* of values, relative */
} format;

static const format formats[] = {{"m.mrc", read_ccp4, 0.0},
                                 {"m.map", read_ccp4, 0.0},
                                 {"m.ccp4", read_ccp4, 0.0},
                                 {"m.dx", read_dx, 5.1e-7}};
enum { FORMATS = sizeof formats / sizeof *formats };

static map load(const format *f, const char *path) {
    FILE *stream = fopen(path, "rb");
    map m = f->read(stream);
    fclose(stream);
    return m;
}

/* ---- comparison --------------------------------------------------------------------------- */

static void point_of(const map *m, size_t k, double x[3]) {
    const long size[3] = {m->size[0], m->size[1], m->size[2]};
    const long at[3] = {(long)k % size[0], (long)k / size[0] % size[1],
                        (long)k / size[0] / size[1]};
    for (int axis = 0; axis < 3; axis++)
        x[axis] = m->origin[axis] + m->spacing[axis] * (double)at[axis];
}

static bool on_face(const map *m, size_t k) {
    const long row = m->size[0], section = m->size[0] * m->size[1];
    const long at[3] = {(long)k % row, (long)k / row % m->size[1], (long)k / section};
    return at[0] == 0 || at[0] == m->size[0] - 1 || at[1] == 0 || at[1] == m->size[1] - 1 ||
           at[2] == 0 || at[2] == m->size[2] - 1;
}

/* Values against the reference at every stride-th point, and none of note on the faces. */
static void compare(const map *m, const subject *s, double spacing, double isovalue, size_t stride,
                    double rounding) {
    for (int axis = 0; axis < 3; axis++) {
        expect_near(m->spacing[axis], spacing, 1e-6, "spacing");
        expect_near(remainder(m->origin[axis], spacing), 0.0, 1e-4, "origin off the lattice");
    }
    for (size_t k = 0; k < map_count(m); k++) {
        double x[3];
        const double value = (double)m->values[k];
        if (on_face(m, k))
            assert_true(value < 0.01 * isovalue * (double)s->count);
        if (k % stride)
            continue;
        point_of(m, k, x);
        ov_twin_sum wanted = ov_twin_field(s->quadrics, s->count, x);
        wanted.scale += rounding / FLT_EPSILON * wanted.value + 1e-5; /* origin rounded to float */
        wanted.scale += 2e-7 * (double)s->count / FLT_EPSILON;        /* the cut-off */
        expect_close(value, wanted, 8.0, NULL, "value", k);
    }
}

static void compare_statistics(const map *m) {
    double low = INFINITY, high = -INFINITY, sum = 0.0, squares = 0.0;
    for (size_t k = 0; k < map_count(m); k++) {
        const double value = (double)m->values[k];
        low = fmin(low, value);
        high = fmax(high, value);
        sum += value;
    }
    const double mean = sum / (double)map_count(m);
    for (size_t k = 0; k < map_count(m); k++)
        squares += ((double)m->values[k] - mean) * ((double)m->values[k] - mean);
    assert_true(m->low == low && m->high == high);
    expect_near(m->mean, mean, 1e-6 * high, "mean");
    expect_near(m->deviation, sqrt(squares / (double)map_count(m)), 1e-6 * high, "deviation");
}

/* ---- tests -------------------------------------------------------------------------------- */

static ovoid_context *context;

static int open_all(void **state) {
    void *opened = NULL;
    int failed = test_open(&opened);
    (void)state;
    context = opened;
    return failed;
}

static int close_all(void **state) {
    (void)state;
    ovoid_context_destroy(&context);
    return 0;
}

/* How many formats to write: to a simulator, which runs the same kernel for each, they are one. */
static size_t formats_here(void) {
    return test_simulated(context) ? 1 : FORMATS;
}

static void maps_hold_the_field(void **state) {
    for (int which = 0; which < 2; which++) {
        subject s = which ? molecule_subject(context) : model_subject(context);
        ovoid_export_options options;
        ovoid_export_options_init(&options, sizeof options);
        options.spacing = test_small() ? 1.3 : 0.37;
        for (size_t i = 0; i < formats_here(); i++) {
            const char *path = scratch_path(*state, formats[i].name);
            test_check(context, export_subject(context, &s, path, &options));
            map m = load(&formats[i], path);
            compare(&m, &s, options.spacing, 1.0, 7, formats[i].rounding);
            if (formats[i].read == read_ccp4)
                compare_statistics(&m);
            free(m.values);
        }
        subject_free(&s);
    }
    assert_int_equal(scratch_entries(*state), formats_here());
}

/* The room about the surface goes by the isovalue. */
static void isovalue_sets_the_room(void **state) {
    test_skip_simulated(context);
    subject s = model_subject(context);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 1.1;
    size_t before = SIZE_MAX;
    for (double isovalue = 1e-4; isovalue < 200.0; isovalue *= 100.0) {
        const char *path = scratch_path(*state, "m.mrc");
        options.isovalue = isovalue;
        test_check(context, export_subject(context, &s, path, &options));
        map m = load(&formats[0], path);
        compare(&m, &s, options.spacing, isovalue, 3, 0.0);
        assert_true(map_count(&m) < before);
        before = map_count(&m);
        free(m.values);
    }
    subject_free(&s);
}

typedef struct watch {
    uint64_t calls, last, stop_after;
} watch;

/* Counts the pieces that are done. */
static bool look(const ovoid_progress *progress, void *user) {
    watch *w = user;
    assert_true(w->calls != w->stop_after || w->calls == 0);
    if (strcmp(progress->stage, "map") != 0 || progress->done == w->last)
        return true;
    assert_true(progress->done > w->last && progress->done <= progress->total);
    w->last = progress->done == progress->total ? 0 : progress->done;
    return ++w->calls != w->stop_after;
}

/* More points than are computed at once. */
static void large_maps_come_in_pieces(void **state) {
    if (test_small())
        skip();
    subject s = model_subject(context);
    ovoid_export_options options;
    watch w = {0};
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 0.08;
    for (size_t i = 0; i < FORMATS; i += 3) {
        const char *path = scratch_path(*state, formats[i].name);
        w = (watch){0};
        ovoid_context_on_progress(context, look, &w);
        test_check(context, export_subject(context, &s, path, &options));
        assert_true(w.calls > 1 && w.last == 0);
        map m = load(&formats[i], path);
        compare(&m, &s, options.spacing, 1.0, 997, formats[i].rounding);
        free(m.values);
        assert_int_equal(unlink(path), 0);
        w = (watch){.stop_after = 2};
        test_refused(context, export_subject(context, &s, path, &options), OVOID_ERROR_CANCELLED,
                     "stage 'map'");
        ovoid_context_on_progress(context, NULL, NULL);
        assert_int_equal(w.calls, 2);
    }
    assert_int_equal(scratch_entries(*state), 0);
    subject_free(&s);
}

/* Far from the origin, and on all sides of it: readers go by NXSTART, whatever the distance. */
static void maps_far_out(void **state) {
    test_skip_simulated(context);
    static const double at[][3] = {{150, -3, 12}, {-2000, 1, 3000.7}, {1e4, 1e4, -1e4}};
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    for (size_t n = 0; n < sizeof at / sizeof *at; n++) {
        subject s = {.count = 1, .quadrics = test_alloc(1, sizeof(ov_quadric))};
        const double xyzr[4] = {at[n][0], at[n][1], at[n][2], 1.7};
        test_check(context, ovoid_molecule_create(context, xyzr, 1, &s.molecule));
        ov_quadric_of_atom(xyzr, decay, s.quadrics);
        for (size_t i = 0; i < FORMATS; i++) {
            const char *path = scratch_path(*state, formats[i].name);
            test_check(context, export_subject(context, &s, path, &options));
            map m = load(&formats[i], path);
            size_t most = 0;
            for (size_t k = 1; k < map_count(&m); k++)
                most = m.values[k] > m.values[most] ? k : most;
            const size_t nx = (size_t)m.size[0], ny = (size_t)m.size[1];
            const size_t index[3] = {most % nx, most / nx % ny, most / (nx * ny)};
            for (int axis = 0; axis < 3; axis++)
                expect_near(m.origin[axis] + m.spacing[axis] * (double)index[axis], xyzr[axis],
                            0.51 * options.spacing, "where the map is highest");
            free(m.values);
        }
        subject_free(&s);
    }
}

/* Refused with its size before anything is written, unless it is allowed. */
static void large_maps_are_asked_for(void **state) {
    const double xyzr[8] = {0, 0, 0, 1.5, 5e4, 0, 0, 1.5};
    subject s = {.count = 2, .quadrics = test_alloc(2, sizeof(ov_quadric))};
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    assert_true(options.max_gigabytes == OVOID_DEFAULT_MAP_GIGABYTES);
    test_check(context, ovoid_molecule_create(context, xyzr, 2, &s.molecule));
    options.spacing = 5.0;
    options.max_gigabytes = 1e-3;
    for (size_t i = 0; i < FORMATS; i++) {
        const char *path = scratch_path(*state, formats[i].name);
        test_refused(context, export_subject(context, &s, path, &options), OVOID_ERROR_LIMIT,
                     "take 0.00");
        if (test_simulated(context)) /* 250000 points */
            continue;
        options.max_gigabytes = 1e-2;
        test_check(context, export_subject(context, &s, path, &options));
        options.max_gigabytes = 1e-3;
        struct stat info;
        assert_int_equal(stat(path, &info), 0);
        assert_true(info.st_size > 1000000 && info.st_size < 10000000);
        assert_int_equal(unlink(path), 0);
    }
    options.max_gigabytes = NAN;
    test_refused(context, export_subject(context, &s, scratch_path(*state, "m.dx"), &options),
                 OVOID_ERROR_ARGUMENT, "gigabytes");
    assert_int_equal(scratch_entries(*state), 0);
    subject_free(&s);
}

/* The header of a map in a pipe cannot be completed at the end: it says so as MRC2014 asks. */
static void pipes_get_no_statistics(void **state) {
    test_skip_simulated(context);
    subject s = model_subject(context);
    ovoid_export_options options;
    char command[700];
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 0.9;
    const char *fifo = scratch_path(*state, "m.mrc"), *copy = scratch_path(*state, "copy");
    assert_int_equal(mkfifo(fifo, 0600), 0);
    snprintf(command, sizeof command, "cat '%s' >'%s'", fifo, copy);
    FILE *reader = popen(command, "w");
    assert_non_null(reader);
    test_check(context, export_subject(context, &s, fifo, &options));
    assert_int_equal(pclose(reader), 0);
    map m = load(&formats[0], copy);
    compare(&m, &s, options.spacing, 1.0, 3, 0.0);
    assert_true(m.high < m.low && m.mean < m.high && m.deviation < 0.0);
    free(m.values);
    subject_free(&s);
}

static void failures_leave_nothing(void **state) {
    test_skip_simulated(context);
    scratch *f = *state;
    subject s = model_subject(context);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = test_small() ? 0.9 : 0.3; /* must overflow a buffer */
    if (access("/dev/full", W_OK) == 0) {
        for (size_t i = 0; i < FORMATS; i++) {
            const char *path = scratch_path(f, formats[i].name);
            assert_int_equal(symlink("/dev/full", path), 0);
            test_refused(context, export_subject(context, &s, path, &options), OVOID_ERROR_IO,
                         "No space left on device");
            assert_int_equal(unlink(path), 0);
        }
    }
    options.spacing = 1e-5;
    test_refused(context, export_subject(context, &s, scratch_path(f, "m.mrc"), &options),
                 OVOID_ERROR_LIMIT, "choose a larger spacing");
    options.spacing = 1e-300;
    test_refused(context, export_subject(context, &s, scratch_path(f, "m.mrc"), &options),
                 OVOID_ERROR_LIMIT, "too large");
    assert_int_equal(scratch_entries(f), 0);
    subject_free(&s);
}

/* ---- other programs ----------------------------------------------------------------------- */

static char *output_of(const char *command) {
    enum { MOST = 1 << 16 };
    FILE *stream = popen(command, "r");
    assert_non_null(stream);
    char *text = test_alloc(MOST, 1);
    size_t length = fread(text, 1, MOST - 1, stream);
    text[length] = '\0';
    if (pclose(stream) != 0)
        fail_msg("%s failed:\n%s", command, text);
    return text;
}

/* The numbers after `label`. */
static void find_numbers(const char *text, const char *label, double *numbers, int count) {
    const char *at = strstr(text, label);
    if (!at)
        fail_msg("there is no '%s' in:\n%s", label, text);
    at += strlen(label);
    for (int i = 0; i < count; i++) {
        char *end;
        numbers[i] = strtod(at, &end);
        assert_ptr_not_equal(end, at);
        at = end;
    }
}

/* Where the tests ask other programs for the field: next to the centre, but not on a symmetry. */
static const double probe[3] = {20.8, -2.8, 0.8}; /* a multiple of the spacing 0.4 */

static void expect_probe(const subject *s, double value) {
    expect_near(value, ov_twin_field(s->quadrics, s->count, probe).value, 1e-4, "field");
}

static void gemmi_reads_it(void **state) {
    static const char script[] = "import sys, gemmi\n"
                                 "m = gemmi.read_ccp4_map(sys.argv[1])\n"
                                 "m.setup(0)\n"
                                 "x = gemmi.Position(*map(float, sys.argv[2:5]))\n"
                                 "print('VALUE', m.grid.interpolate_value(x))\n"
                                 "print('GROUP', m.grid.spacegroup.number)\n"
                                 "c, g = m.grid.unit_cell, m.grid\n"
                                 "print('SPACING', c.a / g.nu, c.b / g.nv, c.c / g.nw)\n";
    static const char *const pythons[] = {"python3", "/usr/bin/python3"};
    const char *python = NULL;
    char command[900];
    for (size_t i = 0; i < 2 && !python; i++) {
        snprintf(command, sizeof command, "%s -c 'import gemmi' >/dev/null 2>&1", pythons[i]);
        python = system(command) == 0 ? pythons[i] : NULL;
    }
    if (test_small())
        skip();
    if (!python) {
        print_message("no gemmi for Python here (Debian: python3-gemmi)\n");
        skip();
    }
    subject s = model_subject(context);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 0.4;
    const char *path = scratch_path(*state, "m.map"), *driver = scratch_path(*state, "read.py");
    scratch_write(driver, script, sizeof script - 1);
    test_check(context, export_subject(context, &s, path, &options));
    snprintf(command, sizeof command, "%s '%s' '%s' %g %g %g 2>&1", python, driver, path, probe[0],
             probe[1], probe[2]);
    char *text = output_of(command);
    double value, group, spacing[3];
    find_numbers(text, "VALUE", &value, 1);
    find_numbers(text, "GROUP", &group, 1);
    find_numbers(text, "SPACING", spacing, 3);
    expect_probe(&s, value);
    assert_true(group == 1.0);
    for (int axis = 0; axis < 3; axis++)
        expect_near(spacing[axis], 0.4, 1e-6, "spacing");
    free(text);
    subject_free(&s);
}

/* PyMOL's map object: where it lies, and its values by index. */
static void pymol_opens_it(void **state) {
    static const char script[] =
        "from pymol import cmd\n"
        "extent = cmd.get_extent('m')\n"
        "print('EXTENT', *extent[0], *extent[1])\n"
        "field = cmd.get_volume_field('m')\n"
        "print('SHAPE', *field.shape)\n"
        "at = [round((p - low) / 0.4) for p, low in zip((%g, %g, %g), extent[0])]\n"
        "print('VALUE', field[tuple(at)])\n";
    if (test_small())
        skip();
    if (system(TEST_PYMOL " -cq -d quit >/dev/null 2>&1") != 0) {
        print_message("no program pymol here (Debian: pymol)\n");
        skip();
    }
    subject s = model_subject(context);
    ovoid_export_options options;
    char driver[1000], command[1200];
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 0.4;
    const int length = snprintf(driver, sizeof driver, script, probe[0], probe[1], probe[2]);
    scratch_write(scratch_path(*state, "show.py"), driver, (size_t)length);
    for (size_t i = 0; i < FORMATS; i++) {
        const char *path = scratch_path(*state, formats[i].name);
        test_check(context, export_subject(context, &s, path, &options));
        map m = load(&formats[i], path);
        /* Maps as they are, not scaled to their deviation. */
        snprintf(command, sizeof command,
                 TEST_PYMOL " -cqk -d 'set normalize_ccp4_maps, 0; load %s, m; run %s' 2>&1", path,
                 scratch_path(*state, "show.py"));
        char *text = output_of(command);
        double extent[6], shape[3], value;
        find_numbers(text, "EXTENT", extent, 6);
        find_numbers(text, "SHAPE", shape, 3);
        find_numbers(text, "VALUE", &value, 1);
        for (int axis = 0; axis < 3; axis++) {
            expect_near(extent[axis], m.origin[axis], 1e-3, "first point");
            assert_true(shape[axis] == (double)m.size[axis]);
        }
        expect_probe(&s, value);
        free(m.values);
        free(text);
    }
    subject_free(&s);
}

#define IN_SCRATCH(test) cmocka_unit_test_setup_teardown(test, scratch_setup, scratch_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        IN_SCRATCH(maps_hold_the_field),
        IN_SCRATCH(isovalue_sets_the_room),
        IN_SCRATCH(large_maps_come_in_pieces),
        IN_SCRATCH(maps_far_out),
        IN_SCRATCH(large_maps_are_asked_for),
        IN_SCRATCH(pipes_get_no_statistics),
        IN_SCRATCH(failures_leave_nothing),
        IN_SCRATCH(gemmi_reads_it),
        IN_SCRATCH(pymol_opens_it),
    };
    return cmocka_run_group_tests(tests, open_all, close_all);
}
