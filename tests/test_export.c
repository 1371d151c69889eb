/*
 * Ellipsoids for other programs: each format is read back and held to the paper's Gaussian. PyMOL's
 * script is run by Python, in PyMOL itself where that is installed.
 */
#include "comma.h"
#include "ovoid/ovoid.h"
#include "scratch.h"
#include "support.h"

#include <cJSON.h>

#define PI 3.14159265358979323846

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

/* ---- models ------------------------------------------------------------------------------- */

enum { PER_KIND = 40 };
static const double isovalue = 1.2;

/* Angles of half a turn about a unit vector in no special direction: R = 2 u u^T - 1. What of a
 * rotation matrix is not symmetric is rounding there. */
static void half_turn(double angle[3]) {
    static const double u[3] = {0.6, 0.48, 0.64};
    angle[0] = atan2(2.0 * u[2] * u[1], 2.0 * u[2] * u[2] - 1.0);
    angle[1] = asin(2.0 * u[2] * u[0]);
    angle[2] = atan2(2.0 * u[1] * u[0], 2.0 * u[0] * u[0] - 1.0);
}

/* Every shape that is known to be difficult, and rotations by nothing and by half a turn. */
static ovoid_model *make_model(size_t repeat) {
    static const model_kind kinds[] = {MODEL_RANDOM, MODEL_NEEDLE, MODEL_PANCAKE, MODEL_SPHERE,
                                       MODEL_GIMBAL};
    static const double turns[][3] = {{0, 0, 0},  {PI, 0, 0},  {0, PI, 0},
                                      {0, 0, PI}, {PI, PI, 0}, {0}};
    enum { KINDS = sizeof kinds / sizeof *kinds, TURNS = sizeof turns / sizeof *turns };
    const size_t count = repeat * KINDS * PER_KIND + TURNS;
    ovoid_ellipsoid *e = test_alloc(count, sizeof *e);
    test_random random = {7};
    for (size_t i = 0; i < repeat * KINDS; i++)
        random_ellipsoids(&random, kinds[i % KINDS], 30.0, e + i * PER_KIND, PER_KIND);
    for (size_t i = 0; i < TURNS; i++) {
        ovoid_ellipsoid *turned = &e[count - TURNS + i];
        *turned = (ovoid_ellipsoid){4.0, {0.1, 0.2, 0.4}, {-100.5, 2, 30}, {0}};
        memcpy(turned->angle, turns[i], sizeof turned->angle);
    }
    half_turn(e[count - 1].angle);
    ovoid_model *model = NULL;
    test_check(context, ovoid_model_create(context, e, count, 0.5, isovalue, &model));
    free(e);
    return model;
}

static char *export_text(scratch *s, const ovoid_model *model, const char *name,
                         const ovoid_export_options *options) {
    const char *path = scratch_path(s, name);
    test_check(context, once_model_export(context, model, path, options));
    char *text = scratch_read(path);
    assert_non_null(text);
    return text;
}

/* ---- solids ------------------------------------------------------------------------------- */

/* The solid centre + sum_p t_p v_p, |t| = 1, is where the ellipsoid's Gaussian is c, or half its
 * amplitude where it nowhere is. Directions between the axes tell axes in the wrong order. */
static void expect_solid(const ovoid_ellipsoid *e, double c, const double centre[3],
                         double v[3][3]) {
    static const double directions[][3] = {{1, 0, 0},     {0, 1, 0},      {0, 0, -1},
                                           {0.6, 0.8, 0}, {0, -0.6, 0.8}, {0.8, 0, 0.6}};
    const double level = e->amplitude > c ? c : 0.5 * e->amplitude;
    for (size_t i = 0; i < sizeof directions / sizeof *directions; i++) {
        double x[3];
        for (int k = 0; k < 3; k++)
            x[k] = centre[k] + directions[i][0] * v[0][k] + directions[i][1] * v[1][k] +
                   directions[i][2] * v[2][k];
        expect_near(ov_twin_ellipsoid(e, x) / level, 1.0, 2e-4, "Gaussian on the solid");
    }
}

/* Rodrigues: v turned about the unit vector u by an angle in degrees. */
static void turn(const double u[3], double degrees, const double v[3], double out[3]) {
    const double s = sin(degrees * PI / 180.0), c = cos(degrees * PI / 180.0);
    const double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    for (int k = 0; k < 3; k++)
        out[k] = c * v[k] +
                 s * (u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]) +
                 (1.0 - c) * dot * u[k];
}

/* Axes of a sphere scaled along x, y and z, then turned. */
static void turned_axes(const double semi[3], const double u[3], double degrees, double v[3][3]) {
    for (int p = 0; p < 3; p++) {
        double along[3] = {0};
        along[p] = semi[p];
        turn(u, degrees, along, v[p]);
    }
}

static const char *next_line(const char *at) {
    at = strchr(at, '\n');
    assert_non_null(at);
    return at + 1;
}

static void bild_draws_the_ellipsoids(void **state) {
    ovoid_model *model = make_model(1);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.opacity = 0.25;
    char *text = export_text(*state, model, "m.bild", &options);
    assert_non_null(strstr(text, "\n.color 0.3 0.55 0.8\n.transparency 0.75\n"));
    const char *at = strstr(text, ".note");
    for (size_t i = 0; i < ovoid_model_size(model); i++) {
        double x[3], u[3], angle, semi[3], v[3][3];
        at = next_line(at);
        assert_int_equal(sscanf(at, ".translate %lf %lf %lf", x, x + 1, x + 2), 3);
        at = next_line(at);
        assert_int_equal(sscanf(at, ".rotate %lf %lf %lf %lf", &angle, u, u + 1, u + 2), 4);
        at = next_line(at);
        assert_int_equal(sscanf(at, ".scale %lf %lf %lf", semi, semi + 1, semi + 2), 3);
        at = next_line(at);
        assert_memory_equal(at, ".sphere 0 0 0 1\n.pop\n.pop\n.pop\n", 31);
        at += 31;
        turned_axes(semi, u, angle, v);
        expect_solid(&ovoid_model_ellipsoids(model)[i], isovalue, x, v);
    }
    assert_int_equal(*at, '\0');
    free(text);
    ovoid_model_destroy(&model);
}

static void cxc_draws_the_ellipsoids(void **state) {
    ovoid_model *model = make_model(1);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.isovalue = 0.7; /* not the model's */
    options.colour[0] = 1.0;
    options.colour[1] = options.colour[2] = 0.0;
    options.opacity = 0.5;
    char *text = export_text(*state, model, "a b.v2.cxc", &options);
    const char *at = text;
    for (size_t i = 0; i < ovoid_model_size(model); i++) {
        double x[3], u[3], angle, semi[3], v[3][3];
        char colour[16], name[64], wanted[64];
        at = next_line(at);
        assert_int_equal(sscanf(at,
                                "shape ellipsoid radius %lf,%lf,%lf center %lf,%lf,%lf rotation "
                                "%lf,%lf,%lf,%lf divisions 36 color %15s name %63s",
                                semi, semi + 1, semi + 2, x, x + 1, x + 2, u, u + 1, u + 2, &angle,
                                colour, name),
                         12);
        snprintf(wanted, sizeof wanted, "a_b_v2_%zu", i + 1);
        assert_string_equal(name, wanted);
        assert_string_equal(colour, "#ff000080");
        turned_axes(semi, u, angle, v);
        expect_solid(&ovoid_model_ellipsoids(model)[i], 0.7, x, v);
    }
    free(text);
    ovoid_model_destroy(&model);
}

/* ---- PyMOL -------------------------------------------------------------------------------- */

static char *output_of(const char *command) {
    enum { MOST = 1 << 20 };
    FILE *stream = popen(command, "r");
    assert_non_null(stream);
    char *text = test_alloc(MOST, 1);
    size_t length = fread(text, 1, MOST - 1, stream);
    text[length] = '\0';
    if (pclose(stream) != 0)
        fail_msg("%s failed:\n%s", command, text);
    return text;
}

/* A module that stands for PyMOL: it prints the numbers that it is given. */
static const char stand_in[] =
    "import sys, types\n"
    "pymol, cgo = types.ModuleType('pymol'), types.ModuleType('pymol.cgo')\n"
    "cgo.ALPHA, cgo.COLOR, cgo.ELLIPSOID = 25.0, 6.0, 18.0\n"
    "class cmd:\n"
    "    def load_cgo(numbers, name):\n"
    "        print(name, *('%.9g' % x for x in numbers))\n"
    "pymol.cmd, pymol.cgo = cmd, cgo\n"
    "sys.modules['pymol'], sys.modules['pymol.cgo'] = pymol, cgo\n"
    "exec(open(sys.argv[1]).read())\n";

static double take_number(char **at) {
    char *end;
    double number = strtod(*at, &end);
    assert_ptr_not_equal(end, *at);
    *at = end;
    return number;
}

static void pymol_script_draws_the_ellipsoids(void **state) {
    if (system("python3 -c '' >/dev/null 2>&1") != 0) {
        print_message("no program python3 here\n");
        skip();
    }
    ovoid_model *model = make_model(1);
    char command[700];
    const char *driver = scratch_path(*state, "stand-in"), *path = scratch_path(*state, "the m.py");
    scratch_write(driver, stand_in, sizeof stand_in - 1);
    free(export_text(*state, model, "the m.py", NULL));
    snprintf(command, sizeof command, "python3 '%s' '%s' 2>&1", driver, path);
    char *text = output_of(command), *at = text + 16;
    assert_memory_equal(text, "the_m_ellipsoids", 16);
    static const double head[] = {25, 1, 6, 0.3, 0.55, 0.8};
    for (size_t i = 0; i < sizeof head / sizeof *head; i++)
        expect_near(take_number(&at), head[i], 1e-6, "alpha and colour");
    for (size_t i = 0; i < ovoid_model_size(model); i++) {
        double x[3], size, v[3][3], longest = 0.0;
        assert_true(take_number(&at) == 18.0);
        for (int k = 0; k < 3; k++)
            x[k] = take_number(&at);
        size = take_number(&at);
        for (int p = 0; p < 3; p++) {
            double square = 0.0;
            for (int k = 0; k < 3; k++) {
                v[p][k] = size * take_number(&at);
                square += v[p][k] * v[p][k];
            }
            longest = fmax(longest, sqrt(square));
        }
        expect_near(longest / size, 1.0, 1e-5, "longest axis"); /* what PyMOL bounds it by */
        expect_solid(&ovoid_model_ellipsoids(model)[i], isovalue, x, v);
    }
    assert_string_equal(at, "\n");
    free(text);
    ovoid_model_destroy(&model);
}

/* A point of the ellipsoid, from its centre in this direction of space: where its Gaussian has
 * fallen to c, or half its amplitude. */
static void point_on(const ovoid_ellipsoid *e, double c, const double direction[3], double z[3]) {
    const double x[3] = {e->centre[0] + direction[0], e->centre[1] + direction[1],
                         e->centre[2] + direction[2]};
    const double q = log(e->amplitude / ov_twin_ellipsoid(e, x));
    const double level = e->amplitude > c ? log(e->amplitude / c) : log(2.0);
    for (int k = 0; k < 3; k++)
        z[k] = direction[k] * sqrt(level / q);
}

static void pymol_opens_it(void **state) {
    if (system(TEST_PYMOL " -cq -d quit >/dev/null 2>&1") != 0) {
        print_message("no program pymol here (Debian: pymol)\n");
        skip();
    }
    static const char show[] = "from pymol import cmd\n"
                               "print('EXTENT', *sum(cmd.get_extent('m_ellipsoids'), []))\n";
    /* Semi-axes 4, 2 and 1: PyMOL bounds an ellipsoid by the sphere about it. */
    const ovoid_ellipsoid e = {exp(1.0), {1 / 16.0, 0.25, 1.0}, {10, -20, 30}, {0.3, 0.5, -0.7}};
    ovoid_model *model = NULL;
    char command[900];
    test_check(context, ovoid_model_create(context, &e, 1, 0.5, 1.0, &model));
    free(export_text(*state, model, "m.py", NULL));
    const char *driver = scratch_path(*state, "show.py");
    scratch_write(driver, show, sizeof show - 1);
    snprintf(command, sizeof command, TEST_PYMOL " -cqk '%s' '%s' 2>&1",
             scratch_path(*state, "m.py"), driver);
    char *text = output_of(command), *at = strstr(text, "EXTENT");
    if (!at)
        fail_msg("PyMOL says:\n%s", text);
    at += strlen("EXTENT");
    for (int i = 0; i < 6; i++)
        expect_near(take_number(&at), e.centre[i % 3] + (i < 3 ? -4.0 : 4.0), 1e-4, "extent");
    free(text);
    ovoid_model_destroy(&model);
}

/* ---- mixture ------------------------------------------------------------------------------ */

typedef struct gaussian {
    double weight, mean[3], c[3][3];
} gaussian;

/* As gmconvert reads: Gaussians are counted by lines with a blank in column 13 and an M in column
 * 18, and a new one begins where the number changes. */
static size_t read_gmm(const char *text, gaussian *found, size_t most) {
    size_t counted = 0, count = 0;
    int last = -1;
    for (const char *line = text; *line; line = next_line(line)) {
        int number;
        char key[8] = "", part[4] = "";
        double x[3] = {0};
        if (strncmp(line, "REMARK GAUSS ", 13) == 0 && line[17] == 'M')
            counted++;
        if (strncmp(line, "REMARK GAUSS", 12) != 0)
            continue;
        assert_int_equal(sscanf(line + 12, "%d %7s", &number, key), 2);
        if (number != last)
            assert_true(++count <= most);
        last = number;
        gaussian *g = &found[count - 1];
        const char *values = strstr(line + 16, key) + strlen(key);
        if (strcmp(key, "W") == 0) {
            assert_int_equal(sscanf(values, "%lf", &g->weight), 1);
        } else if (strcmp(key, "M") == 0) {
            assert_int_equal(sscanf(values, "%lf %lf %lf", g->mean, g->mean + 1, g->mean + 2), 3);
        } else {
            assert_string_equal(key, "CovM");
            assert_int_equal(sscanf(values, "%3s %lf %*s %lf %*s %lf", part, x, x + 1, x + 2), 4);
            if (strcmp(part, "xx") == 0) {
                g->c[0][0] = x[0];
                g->c[0][1] = g->c[1][0] = x[1];
                g->c[0][2] = g->c[2][0] = x[2];
            } else {
                assert_string_equal(part, "yy");
                g->c[1][1] = x[0];
                g->c[1][2] = g->c[2][1] = x[1];
                g->c[2][2] = x[2];
            }
        }
    }
    assert_int_equal(counted, count);
    return count;
}

/* Density of a normal distribution, weighted. */
static double density(const gaussian *g, const double x[3]) {
    double inverse[3][3], z[3], q = 0.0, determinant = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            inverse[i][j] = g->c[a][c] * g->c[b][d] - g->c[a][d] * g->c[b][c];
        }
    for (int j = 0; j < 3; j++)
        determinant += g->c[0][j] * inverse[j][0];
    for (int i = 0; i < 3; i++)
        z[i] = x[i] - g->mean[i];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            q += z[i] * inverse[i][j] * z[j] / determinant;
    return g->weight * exp(-0.5 * q) / sqrt(pow(2.0 * PI, 3.0) * determinant);
}

static void mixture_is_the_field(void **state) {
    ovoid_model *model = make_model(7); /* more than 999 */
    const size_t size = ovoid_model_size(model);
    gaussian *found = test_alloc(size, sizeof *found);
    char *text = export_text(*state, model, "m.gmm", NULL);
    char wanted[64];
    double total, sum = 0.0;
    snprintf(wanted, sizeof wanted, "\nREMARK NGAUSS %zu\n", size);
    assert_non_null(strstr(text, wanted));
    assert_int_equal(sscanf(strstr(text, "field = "), "field = %lf * mixture", &total), 1);
    assert_int_equal(read_gmm(text, found, size), size);
    test_random random = {3};
    for (size_t i = 0; i < size; i++) {
        const ovoid_ellipsoid *e = &ovoid_model_ellipsoids(model)[i];
        double x[3];
        for (int k = 0; k < 3; k++)
            x[k] = e->centre[k] + random_uniform(&random, -0.5, 0.5);
        expect_near(total * density(&found[i], x) / ov_twin_ellipsoid(e, x), 1.0, 1e-4, "Gaussian");
        sum += found[i].weight;
    }
    expect_near(sum, 1.0, 1e-6, "sum of the weights");
    free(text);
    free(found);
    ovoid_model_destroy(&model);
}

/* ---- JSON --------------------------------------------------------------------------------- */

static const cJSON *get(const cJSON *object, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!item)
        fail_msg("there is no '%s'", key);
    return item;
}

static double element(const cJSON *array, int index) {
    const cJSON *item = cJSON_GetArrayItem(array, index);
    assert_true(cJSON_IsNumber(item));
    return item->valuedouble;
}

static void json_holds_the_model(void **state) {
    ovoid_model *model = make_model(1);
    /* A quote, a backslash, a tab, an e with an acute accent, and what is no UTF-8: a lone
     * continuation, an overlong slash, a surrogate, and a character cut off at the end. */
    test_check(context,
               ovoid_model_annotate(context, model, "input",
                                    "a\"b\\\t\xc3\xa9\x80/\xc0\xaf/\xed\xa0\x80/\xf0\x9f\x99"));
    char *text = export_text(*state, model, "m.json", NULL);
    cJSON *json = cJSON_Parse(text);
    assert_non_null(json);
    assert_string_equal(cJSON_GetStringValue(get(json, "format")), "ovoid model");
    assert_string_equal(
        cJSON_GetStringValue(cJSON_GetArrayItem(get(json, "notes"), 0)),
        "input: a\"b\\\t\xc3\xa9\xef\xbf\xbd/\xef\xbf\xbd\xef\xbf\xbd/"
        "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd/\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd");
    assert_true(get(json, "isovalue")->valuedouble == isovalue);
    assert_true(get(json, "decay")->valuedouble == 0.5);
    const cJSON *list = get(json, "ellipsoids");
    assert_int_equal(cJSON_GetArraySize(list), ovoid_model_size(model));
    for (size_t i = 0; i < ovoid_model_size(model); i++) {
        const ovoid_ellipsoid *e = &ovoid_model_ellipsoids(model)[i];
        const cJSON *item = cJSON_GetArrayItem(list, (int)i);
        double x[3], v[3][3];
        expect_near(get(item, "amplitude")->valuedouble / e->amplitude, 1.0, 1e-8, "amplitude");
        for (int k = 0; k < 3; k++) {
            x[k] = element(get(item, "centre"), k);
            expect_near(element(get(item, "decay"), k) / e->decay[k], 1.0, 1e-8, "decay");
            expect_near(element(get(item, "angle"), k), e->angle[k], 1e-8, "angle");
            for (int j = 0; j < 3; j++)
                v[k][j] = element(get(item, "semi_axes"), k) *
                          element(cJSON_GetArrayItem(get(item, "axes"), k), j);
        }
        expect_solid(e, isovalue, x, v);
        assert_int_equal(cJSON_IsTrue(get(item, "reaches_isovalue")), e->amplitude > isovalue);
    }
    cJSON_Delete(json);
    free(text);
    ovoid_model_destroy(&model);
}

/* ---- all of them -------------------------------------------------------------------------- */

static const char *const names[] = {"m.bild", "m.bld", "m.cxc", "m.py",  "m.gmm",
                                    "m.json", "m.xyz", "m.lmp", "m.gltf"};
enum { NAMES = sizeof names / sizeof *names };

/* ---- more ellipsoids ------------------------------------------------------------------------ */

/* Axes of a sphere scaled along x, y and z, then turned by a quaternion. */
static void quaternion_axes(const double semi[3], double x, double y, double z, double w,
                            double v[3][3]) {
    const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                            {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                            {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    expect_near(x * x + y * y + z * z + w * w, 1.0, 1e-6, "length of the quaternion");
    for (int p = 0; p < 3; p++)
        for (int k = 0; k < 3; k++)
            v[p][k] = semi[p] * r[k][p];
}

static void xyz_has_the_ellipsoids(void **state) {
    ovoid_model *model = make_model(1);
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.isovalue = 0.7; /* not the model's */
    char *text = export_text(*state, model, "m.xyz", &options);
    const char *at = next_line(text);
    assert_int_equal(atoi(text), ovoid_model_size(model));
    assert_memory_equal(at,
                        "Properties=species:S:1:pos:R:3:aspherical_shape:R:3:orientation:R:4:", 68);
    for (size_t i = 0; i < ovoid_model_size(model); i++) {
        const ovoid_ellipsoid *const e = &ovoid_model_ellipsoids(model)[i];
        double c[3], s[3], q[4], a, v[3][3];
        at = next_line(at);
        assert_int_equal(sscanf(at, "X %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf", c, c + 1,
                                c + 2, s, s + 1, s + 2, q, q + 1, q + 2, q + 3, &a),
                         11);
        quaternion_axes(s, q[0], q[1], q[2], q[3], v);
        expect_solid(e, 0.7, c, v);
        expect_near(a / e->amplitude, 1.0, 1e-7, "amplitude");
    }
    assert_string_equal(next_line(at), "");
    free(text);
    ovoid_model_destroy(&model);
}

/* Diameters, and the quaternion's real part first. */
static void lammps_has_the_ellipsoids(void **state) {
    ovoid_model *model = make_model(1);
    const size_t count = ovoid_model_size(model);
    char *text = export_text(*state, model, "m.lmp", NULL);
    const char *at = strstr(text, "Atoms # ellipsoid\n\n"), *shape = strstr(text, "Ellipsoids\n\n");
    double box[3][2];
    assert_true(at && shape);
    assert_int_equal(sscanf(strstr(text, "types\n\n") + 7,
                            "%lf %lf xlo xhi %lf %lf ylo yhi %lf %lf zlo zhi", box[0], box[0] + 1,
                            box[1], box[1] + 1, box[2], box[2] + 1),
                     6);
    at = next_line(at);
    shape = next_line(shape);
    for (size_t i = 0; i < count; i++) {
        double c[3], d[3], q[4], v[3][3];
        size_t number, again;
        at = next_line(at);
        shape = next_line(shape);
        assert_int_equal(sscanf(at, "%zu 1 1 1.0 %lf %lf %lf", &number, c, c + 1, c + 2), 4);
        assert_int_equal(sscanf(shape, "%zu %lf %lf %lf %lf %lf %lf %lf", &again, d, d + 1, d + 2,
                                q + 3, q, q + 1, q + 2),
                         8);
        assert_true(number == i + 1 && again == i + 1);
        for (int k = 0; k < 3; k++)
            d[k] *= 0.5;
        quaternion_axes(d, q[0], q[1], q[2], q[3], v);
        expect_solid(&ovoid_model_ellipsoids(model)[i], isovalue, c, v);
        for (int k = 0; k < 3; k++)
            assert_true(box[k][0] < c[k] - fabs(v[0][k]) && c[k] + fabs(v[0][k]) < box[k][1]);
    }
    assert_string_equal(next_line(shape), "");
    free(text);
    ovoid_model_destroy(&model);
}

/* Where z^T C^-1 z is 1, for any direction z. */
static void expect_on_ellipsoid(const double c[6], const double z[3], const char *what) {
    const double m[3][3] = {{c[0], c[1], c[2]}, {c[1], c[3], c[4]}, {c[2], c[4], c[5]}};
    double determinant = 0.0, q = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, d = (j + 1) % 3, e = (j + 2) % 3;
            const double cofactor = m[a][d] * m[b][e] - m[a][e] * m[b][d];
            q += z[i] * z[j] * cofactor;
            if (i == 0)
                determinant += m[0][j] * cofactor;
        }
    expect_near(q / determinant, 1.0, 2e-2, what);
}

/* U is such that 1.5382 standard deviations are the semi-axes, and in units of 1e-4. Shapes are
 * those that fit whole numbers: needles and pancakes do not. */
static void anisou_has_the_ellipsoids(void **state) {
    enum { COUNT = 20 };
    ovoid_ellipsoid e[COUNT];
    test_random random = {5};
    ovoid_model *model = NULL;
    random_ellipsoids(&random, MODEL_RANDOM, 30.0, e, COUNT);
    test_check(context, ovoid_model_create(context, e, COUNT, 0.5, isovalue, &model));
    char *text = export_text(*state, model, "m.pdb", NULL);
    const char *at = strstr(text, "HETATM");
    for (int i = 0; i < COUNT; i++) {
        static const double directions[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, 0, -0.8}};
        long u[6];
        char chain;
        int number;
        double x[3], c[6];
        assert_int_equal(sscanf(at, "HETATM%*5d  C   ELL %c%4d    %8lf%8lf%8lf  1.00", &chain,
                                &number, x, x + 1, x + 2),
                         5);
        assert_true(chain == 'A' && number == i + 1);
        at = next_line(at);
        assert_int_equal(sscanf(at, "ANISOU%*5d  C   ELL A%*4d  %7ld%7ld%7ld%7ld%7ld%7ld", u, u + 1,
                                u + 2, u + 3, u + 4, u + 5),
                         6);
        const double unit = 1e-4 * 1.5381722544550522 * 1.5381722544550522;
        const int order[6] = {0, 3, 4, 1, 5, 2}; /* U11 U22 U33 U12 U13 U23 as xx xy xz yy yz zz */
        for (int k = 0; k < 6; k++)
            c[k] = unit * (double)u[order[k]];
        for (size_t d = 0; d < 4; d++) {
            double z[3];
            point_on(&e[i], isovalue, directions[d], z);
            expect_on_ellipsoid(c, z, "point of the ellipsoid");
        }
        for (int k = 0; k < 3; k++)
            expect_near(x[k], e[i].centre[k], 6e-4, "centre");
        at = next_line(at);
    }
    assert_string_equal(at, "END\n");
    free(text);
    ovoid_model_destroy(&model);
}

static void pdb_columns_are_not_overrun(void **state) {
    const ovoid_ellipsoid far = {3.0, {0.1, 0.1, 0.1}, {12345.0, 0, 0}, {0}};
    const ovoid_ellipsoid large = {3.0, {1e-5, 0.1, 0.1}, {0}, {0}};
    const ovoid_ellipsoid *const bad[] = {&far, &large};
    for (int i = 0; i < 2; i++) {
        ovoid_model *model = NULL;
        test_check(context, ovoid_model_create(context, bad[i], 1, 0.5, 1.0, &model));
        test_refused(context,
                     once_model_export(context, model, scratch_path(*state, "m.pdb"), NULL),
                     OVOID_ERROR_LIMIT, "ellipsoid 1 is too large or too far");
        ovoid_model_destroy(&model);
    }
    assert_int_equal(scratch_entries(*state), 0);
}

/* ---- splats --------------------------------------------------------------------------------- */

static size_t decode_base64(const char *text, unsigned char *out) {
    static const char all[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    size_t size = 0;
    for (; *text && *text != '='; text += 4) {
        uint32_t bits = 0;
        int digits = 0;
        for (; digits < 4 && text[digits] && text[digits] != '='; digits++)
            bits |= (uint32_t)(strchr(all, text[digits]) - all) << (18 - 6 * digits);
        for (int k = 0; k < digits - 1; k++)
            out[size++] = (unsigned char)(bits >> (16 - 8 * k));
        if (digits < 4)
            break;
    }
    return size;
}

/* The splat's Gaussian, exp(-|S^-1 R^T z|^2 / 2), is the ellipsoid's over its amplitude. */
static void splats_are_the_gaussians(void **state) {
    ovoid_model *model = make_model(1);
    const size_t count = ovoid_model_size(model);
    char *text = export_text(*state, model, "m.gltf", NULL);
    cJSON *json = cJSON_Parse(text);
    assert_non_null(json);
    const cJSON *buffer = cJSON_GetArrayItem(get(json, "buffers"), 0);
    const char *uri = cJSON_GetStringValue(get(buffer, "uri"));
    float *f = test_alloc(strlen(uri), 1);
    const size_t size = decode_base64(strchr(uri, ',') + 1, (unsigned char *)f);
    assert_true(size == count * 18 * sizeof(float));
    assert_true(get(buffer, "byteLength")->valuedouble == (double)size);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetArrayItem(get(json, "extensionsUsed"), 0)),
                        "KHR_gaussian_splatting");
    for (size_t i = 0; i < count; i++) {
        const ovoid_ellipsoid *const e = &ovoid_model_ellipsoids(model)[i];
        const float *const at = f + 3 * i, *q = f + 3 * count + 4 * i, *s = f + 7 * count + 3 * i;
        const double semi[3] = {(double)s[0], (double)s[1], (double)s[2]};
        double v[3][3], x[3];
        quaternion_axes(semi, (double)q[0], (double)q[1], (double)q[2], (double)q[3], v);
        for (int p = 0; p < 3; p++) {
            for (int k = 0; k < 3; k++)
                x[k] = e->centre[k] + v[p][k];
            expect_near(ov_twin_ellipsoid(e, x) / e->amplitude, exp(-0.5), 1e-3, "splat");
        }
        expect_near((double)at[0], e->centre[0], 1e-5 * (1 + fabs(e->centre[0])), "position");
        expect_near((double)f[10 * count + i], 1 - exp(-e->amplitude), 1e-6, "opacity");
        expect_near(0.5 + 0.28209479 * (double)f[11 * count + 3 * i], 0.30, 1e-6, "red");
    }
    cJSON_Delete(json);
    free(f);
    free(text);
    ovoid_model_destroy(&model);
}

/* ---- IHMCIF --------------------------------------------------------------------------------- */

static const char two_chains[] =
    "ATOM      1  CA  GLY A   5       0.000   0.000   0.000  1.00  0.00           C\n"
    "ATOM      2  CA  ALA A   6       3.800   0.000   0.000  1.00  0.00           C\n"
    "ATOM      3  CA  SER A   7A     20.000   0.000   0.000  1.00  0.00           C\n"
    "ATOM      4  CA  TRP B   1      23.800   0.000   0.000  1.00  0.00           C\n"
    "ATOM      5  CB  TRP B   1      24.800   0.000   0.000  1.00  0.00           C\n"
    "ATOM      6  CA  LYS B   2      25.800   0.000   0.000  1.00  0.00           C\n";

/* The first ellipsoid has residues 5 and 6 of A, the second one of A and three atoms of B. */
static void ihm_says_what_is_where(void **state) {
    const ovoid_ellipsoid e[2] = {{2.0, {0.1, 0.2, 0.3}, {2, 0, 0}, {0.3, -0.4, 0.5}},
                                  {3.0, {0.1, 0.1, 0.1}, {23, 0, 0}, {0}}};
    const char *path = scratch_path(*state, "m.pdb");
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    scratch_write(path, two_chains, sizeof two_chains - 1);
    test_check(context, ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule));
    test_check(context, ovoid_model_create(context, e, 2, 0.5, 1.0, &model));
    ovoid_scene scene;
    ovoid_scene_init(&scene, sizeof scene);
    scene.molecule = molecule;
    scene.models = (const ovoid_model *const *)&model;
    scene.model_count = 1;
    scene.title = "two; chains\nof it";
    path = scratch_path(*state, "m.cif");
    test_check(context, ovoid_scene_export(context, &scene, path, NULL));
    char *text = scratch_read(path);
    assert_non_null(strstr(text, "_struct.title \n;two; chains of it\n;\n"));
    assert_non_null(strstr(text, "\nA 1 .\nB 2 .\n"));
    assert_non_null(strstr(text, "\n1 1 GLY .\n1 2 ALA .\n1 3 SER .\n2 1 TRP .\n2 2 LYS .\n"));
    assert_non_null(strstr(text, "\nA 1 3 SER 7 A A\nB 2 1 TRP 1 B .\n"));
    const char *at = strstr(text, "_ihm_gaussian_obj_site.model_id\n");
    for (int i = 0; i < 2; i++) {
        static const char *const wanted[] = {"1 1 A 1 2 ", "2 2 B 1 2 "};
        gaussian g;
        at = next_line(at);
        assert_memory_equal(at, wanted[i], 10);
        double *const c = &g.c[0][0];
        assert_int_equal(sscanf(at + 10, "%lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf 1\n",
                                g.mean, g.mean + 1, g.mean + 2, &g.weight, c, c + 1, c + 2, c + 3,
                                c + 4, c + 5, c + 6, c + 7, c + 8),
                         13);
        const double x[3] = {g.mean[0] + 0.7, g.mean[1] - 0.4, g.mean[2] + 1.1};
        expect_near(density(&g, x) / ov_twin_ellipsoid(&e[i], x), 1.0, 1e-6, "Gaussian");
    }
    assert_string_equal(next_line(at), "#\n");
    free(text);
    scene.molecule = NULL; /* an unknown residue for each */
    test_check(context, ovoid_scene_export(context, &scene, path, NULL));
    text = scratch_read(path);
    assert_non_null(strstr(text, "\n1 1 UNK .\n1 2 UNK .\n#"));
    assert_non_null(strstr(text, "model_id\n1 1 A 1 1 2 0 0 "));
    free(text);
    scene.models = NULL;
    scene.model_count = 0;
    scene.molecule = molecule;
    test_refused(context, ovoid_scene_export(context, &scene, path, NULL), OVOID_ERROR_ARGUMENT,
                 "fit a model to it first");
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* ---- all of them ---------------------------------------------------------------------------- */

static void locale_changes_nothing(void **state) {
    scratch *s = *state;
    ovoid_model *model = make_model(1);
    char *plain[NAMES];
    ovoid_status written[NAMES];
    for (size_t i = 0; i < NAMES; i++)
        plain[i] = export_text(s, model, names[i], NULL);
    if (!comma_enter(s)) {
        setlocale(LC_ALL, "C");
        print_message("no locale with a decimal comma here\n");
        for (size_t i = 0; i < NAMES; i++)
            free(plain[i]);
        ovoid_model_destroy(&model);
        skip();
    }
    for (size_t i = 0; i < NAMES; i++)
        written[i] = once_model_export(context, model, scratch_path(s, names[i]), NULL);
    assert_true(comma_leave(s));
    for (size_t i = 0; i < NAMES; i++) {
        assert_int_equal(written[i], OVOID_OK);
        char *again = scratch_read(scratch_path(s, names[i]));
        assert_string_equal(again, plain[i]);
        free(again);
        free(plain[i]);
    }
    ovoid_model_destroy(&model);
}

static void failures_leave_nothing(void **state) {
    scratch *s = *state;
    ovoid_model *model = make_model(7);
    for (size_t i = 0; i < NAMES; i++) {
        const char *path = scratch_path(s, names[i]);
        if (access("/dev/full", W_OK) != 0 || symlink("/dev/full", path) != 0) {
            print_message("no /dev/full here\n");
            ovoid_model_destroy(&model);
            skip();
        }
        test_refused(context, once_model_export(context, model, path, NULL), OVOID_ERROR_IO,
                     "No space left on device");
    }
    test_refused(context, once_model_export(context, model, scratch_path(s, "no/m.py"), NULL),
                 OVOID_ERROR_IO, "there is no folder");
    assert_int_equal(scratch_entries(s), NAMES); /* the links */
    ovoid_model_destroy(&model);
}

static void formats_have_names(void **state) {
    (void)state;
    static const struct {
        const char *name;
        ovoid_export_format format;
    } known[] = {{"bild", OVOID_EXPORT_BILD},     {".bld", OVOID_EXPORT_BILD},
                 {"CXC", OVOID_EXPORT_CXC},       {"pymol", OVOID_EXPORT_PYMOL},
                 {".py", OVOID_EXPORT_PYMOL},     {"gmm", OVOID_EXPORT_GMM},
                 {"json", OVOID_EXPORT_JSON},     {"ccp4", OVOID_EXPORT_CCP4},
                 {".MRC", OVOID_EXPORT_CCP4},     {"map", OVOID_EXPORT_CCP4},
                 {".dx", OVOID_EXPORT_DX},        {"html", OVOID_EXPORT_HTML},
                 {".htm", OVOID_EXPORT_HTML},     {"", OVOID_EXPORT_AUTO},
                 {".", OVOID_EXPORT_AUTO},        {"xtc", OVOID_EXPORT_AUTO},
                 {"anisou", OVOID_EXPORT_ANISOU}, {".PDB", OVOID_EXPORT_ANISOU},
                 {"ihm", OVOID_EXPORT_IHM},       {"cif", OVOID_EXPORT_IHM},
                 {"extxyz", OVOID_EXPORT_XYZ},    {"lammps", OVOID_EXPORT_LAMMPS},
                 {".data", OVOID_EXPORT_LAMMPS},  {"gltf", OVOID_EXPORT_SPLAT},
                 {NULL, OVOID_EXPORT_AUTO},       {"a very long name", OVOID_EXPORT_AUTO}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        assert_int_equal(ovoid_export_format_find(known[i].name), known[i].format);
    for (int i = 1; i <= OVOID_EXPORT_MSMS; i++)
        assert_int_equal(ovoid_export_format_find(ovoid_export_format_name((ovoid_export_format)i)),
                         i);
    assert_null(ovoid_export_format_name(OVOID_EXPORT_AUTO));
    assert_null(ovoid_export_format_name((ovoid_export_format)(OVOID_EXPORT_MSMS + 1)));
}

static void refuse_scene(const ovoid_scene *scene, const char *path, const char *text) {
    test_refused(context, ovoid_scene_export(context, scene, path, NULL), OVOID_ERROR_ARGUMENT,
                 text);
}

static void scenes_that_make_no_sense_are_refused(const char *path, const ovoid_model *model,
                                                  const ovoid_molecule *molecule) {
    const ovoid_model *const models[] = {model, NULL};
    ovoid_scene s;
    ovoid_scene_init(&s, sizeof s);
    refuse_scene(&s, path, "neither a molecule nor a model");
    s.molecule = molecule;
    refuse_scene(&s, path, "fit a model to it first");
    s.model_count = 2;
    refuse_scene(&s, path, "without any");
    s.models = models;
    refuse_scene(&s, path, "model 2 of a scene is NULL");
    s.model_count = 1;
    s.decay = -1.0;
    refuse_scene(&s, path, "decay -1");
    s.decay = 0.0;
    s.isovalue = NAN;
    refuse_scene(&s, path, "isovalue");
}

static void what_makes_no_sense_is_refused(void **state) {
    static const double xyzr[4] = {0, 0, 0, 1};
    ovoid_model *model = make_model(1);
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, 1, &molecule));
    static const char *const bad[] = {"m", "m.xtc", ".json", "m.json.gz", "m."};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        test_refused(context, once_model_export(context, model, scratch_path(*state, bad[i]), NULL),
                     OVOID_ERROR_ARGUMENT,
                     "one of .bild, .cxc, .py, .gmm, .json, .xyz, .lmp, .pdb, .gltf, .cif, .mrc, "
                     ".map, .ccp4, .dx, .ply, .glb, .3mf, .vert, .html");
    test_refused(context, once_model_export(context, model, "-", NULL), OVOID_ERROR_ARGUMENT,
                 "name a format");
    const char *path = scratch_path(*state, "m.xtc");
    test_refused(context, once_molecule_export(context, molecule, 0.5, path, NULL),
                 OVOID_ERROR_ARGUMENT, "in one of .mrc, .map, .ccp4, .dx");
    path = scratch_path(*state, "m.py");
    test_refused(context, once_molecule_export(context, molecule, 0.5, path, NULL),
                 OVOID_ERROR_ARGUMENT, "fit a model to it first");
    test_refused(context, once_molecule_export(context, molecule, 0.0, path, NULL),
                 OVOID_ERROR_ARGUMENT, "decay");
    test_refused(context, once_model_export(context, NULL, path, NULL), OVOID_ERROR_ARGUMENT,
                 "NULL");
    static const double wrong[] = {-1.0, NAN, INFINITY};
    test_refused(context, once_model_export(context, model, scratch_path(*state, "m.html"), NULL),
                 OVOID_ERROR_ARGUMENT, "ovoid_scene_export()");
    for (size_t i = 0; i < 3; i++) {
        for (int which = 0; which < 5; which++) {
            ovoid_export_options o;
            ovoid_export_options_init(&o, sizeof o);
            double *const value[] = {&o.isovalue, &o.spacing, &o.colour[2], &o.opacity, &o.range};
            static const char *const text[] = {"isovalue", "spacing", "colour", "opacity", "range"};
            *value[which] = wrong[i];
            test_refused(context, once_model_export(context, model, path, &o), OVOID_ERROR_ARGUMENT,
                         text[which]);
        }
    }
    scenes_that_make_no_sense_are_refused(path, model, molecule);
    assert_int_equal(scratch_entries(*state), 0);
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

#define IN_SCRATCH(test) cmocka_unit_test_setup_teardown(test, scratch_setup, scratch_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        IN_SCRATCH(bild_draws_the_ellipsoids),
        IN_SCRATCH(cxc_draws_the_ellipsoids),
        IN_SCRATCH(pymol_script_draws_the_ellipsoids),
        IN_SCRATCH(pymol_opens_it),
        IN_SCRATCH(mixture_is_the_field),
        IN_SCRATCH(json_holds_the_model),
        IN_SCRATCH(xyz_has_the_ellipsoids),
        IN_SCRATCH(lammps_has_the_ellipsoids),
        IN_SCRATCH(anisou_has_the_ellipsoids),
        IN_SCRATCH(pdb_columns_are_not_overrun),
        IN_SCRATCH(splats_are_the_gaussians),
        IN_SCRATCH(ihm_says_what_is_where),
        IN_SCRATCH(locale_changes_nothing),
        IN_SCRATCH(failures_leave_nothing),
        cmocka_unit_test(formats_have_names),
        IN_SCRATCH(what_makes_no_sense_is_refused),
    };
    return cmocka_run_group_tests(tests, make_context, drop_context);
}
