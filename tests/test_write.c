/*
 * Files of meshes: each format is read back by a reader of its own, written from the format's
 * document alone, and where the program assimp is installed, by that too.
 */
#include "comma.h"
#include "scratch.h"
#include "shapes.h"
#include "support.h"

#include <cJSON.h>
#include <ctype.h>

/* Far from the origin, and not at all symmetric. */
static const double axes[3] = {3.0, 5.0, 2.0}, centre[3] = {112.25, -30.5, 7.75};

static ovoid_context *context;
static ovoid_mesh *mesh;
static bool is_ellipsoid = true; /* what is read is about `centre`, and precise */

static int make_mesh(void **state) {
    (void)state;
    shape s = {0};
    if (ovoid_context_create(&context) != OVOID_OK)
        return -1;
    shape_add_ellipsoid(&s, 2, axes, centre, false);
    mesh = shape_mesh(context, &s);
    shape_destroy(&s);
    return mesh ? 0 : -1;
}

static int drop_mesh(void **state) {
    (void)state;
    ovoid_mesh_destroy(&mesh);
    ovoid_context_destroy(&context);
    return 0;
}

/* ---- bytes -------------------------------------------------------------------------------- */

typedef struct cursor {
    unsigned char *data;
    size_t size, at;
} cursor;

static cursor load(const char *path) {
    cursor c = {0};
    FILE *stream = fopen(path, "rb");
    assert_non_null(stream);
    assert_int_equal(fseek(stream, 0, SEEK_END), 0);
    c.size = (size_t)ftell(stream);
    rewind(stream);
    c.data = test_alloc(c.size + 1, 1);
    assert_int_equal(fread(c.data, 1, c.size, stream), c.size);
    fclose(stream);
    return c;
}

static uint32_t take(cursor *c, size_t bytes) {
    uint32_t value = 0;
    assert_true(c->at + bytes <= c->size);
    for (size_t i = 0; i < bytes; i++)
        value |= (uint32_t)c->data[c->at++] << (8 * i);
    return value;
}

static double take_float(cursor *c) {
    const uint32_t bits = take(c, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

static double take_double(cursor *c) {
    const uint64_t low = take(c, 4), bits = (uint64_t)take(c, 4) << 32 | low;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The next line of text, without its end. */
static const char *take_line(cursor *c, char line[256]) {
    size_t length = 0;
    assert_true(c->at < c->size);
    while (c->at < c->size && c->data[c->at] != '\n') {
        assert_true(length < 255);
        line[length++] = (char)c->data[c->at++];
    }
    c->at++;
    line[length] = '\0';
    return line;
}

/* ---- readers ------------------------------------------------------------------------------ */

typedef struct soup {
    size_t vertices, triangles;
    double *xyz, *normals; /* normals may be NULL */
    uint32_t *corners;
} soup;

static soup soup_make(size_t vertices, size_t triangles) {
    return (soup){.vertices = vertices,
                  .triangles = triangles,
                  .xyz = test_alloc(3 * vertices, sizeof(double)),
                  .normals = test_alloc(3 * vertices, sizeof(double)),
                  .corners = test_alloc(3 * triangles, sizeof(uint32_t))};
}

static void soup_free(soup *s) {
    free(s->xyz);
    free(s->normals);
    free(s->corners);
}

static soup read_ply(cursor *c) {
    char line[256];
    size_t vertices = 0, triangles = 0;
    bool doubles = false;
    assert_string_equal(take_line(c, line), "ply");
    assert_string_equal(take_line(c, line), "format binary_little_endian 1.0");
    while (strcmp(take_line(c, line), "end_header") != 0) {
        (void)sscanf(line, "element vertex %zu", &vertices);
        (void)sscanf(line, "element face %zu", &triangles);
        doubles |= strcmp(line, "property double x") == 0;
    }
    soup s = soup_make(vertices, triangles);
    for (size_t i = 0; i < vertices; i++) {
        for (size_t k = 0; k < 3; k++)
            s.xyz[3 * i + k] = doubles ? take_double(c) : take_float(c);
        for (size_t k = 0; k < 3; k++)
            s.normals[3 * i + k] = take_float(c);
    }
    for (size_t i = 0; i < triangles; i++) {
        assert_int_equal(take(c, 1), 3);
        for (size_t k = 0; k < 3; k++)
            s.corners[3 * i + k] = take(c, 4);
    }
    assert_int_equal(c->at, c->size);
    return s;
}

static soup read_obj(cursor *c) {
    char line[256];
    size_t v = 0, n = 0, f = 0;
    soup s = soup_make(c->size, c->size); /* more than enough */
    while (c->at < c->size) {
        double *x = s.xyz + 3 * v, *u = s.normals + 3 * n;
        uint32_t *t = s.corners + 3 * f, other[3];
        take_line(c, line);
        if (sscanf(line, "v %lf %lf %lf", x, x + 1, x + 2) == 3)
            v++;
        else if (sscanf(line, "vn %lf %lf %lf", u, u + 1, u + 2) == 3)
            n++;
        else if (sscanf(line, "f %u//%u %u//%u %u//%u", t, other, t + 1, other + 1, t + 2,
                        other + 2) == 6) {
            for (int k = 0; k < 3; k++)
                assert_int_equal(other[k], t[k]--);
            f++;
        } else {
            assert_int_equal(line[0], '#');
        }
    }
    assert_int_equal(v, n);
    s.vertices = v;
    s.triangles = f;
    return s;
}

static soup read_off(cursor *c) {
    char line[256];
    size_t vertices, triangles, edges;
    assert_string_equal(take_line(c, line), "OFF");
    assert_int_equal(sscanf(take_line(c, line), "%zu %zu %zu", &vertices, &triangles, &edges), 3);
    soup s = soup_make(vertices, triangles);
    for (size_t i = 0; i < vertices; i++) {
        double *x = s.xyz + 3 * i;
        assert_int_equal(sscanf(take_line(c, line), "%lf %lf %lf", x, x + 1, x + 2), 3);
    }
    for (size_t i = 0; i < triangles; i++) {
        uint32_t *t = s.corners + 3 * i;
        assert_int_equal(sscanf(take_line(c, line), "3 %u %u %u", t, t + 1, t + 2), 3);
    }
    assert_int_equal(c->at, c->size);
    free(s.normals);
    s.normals = NULL;
    return s;
}

/* Every triangle has corners of its own; the normals of triangles are checked here. */
static soup read_stl(cursor *c) {
    assert_true(memcmp(c->data, "solid", 5) != 0);
    c->at = 80;
    const size_t triangles = take(c, 4);
    soup s = soup_make(3 * triangles, triangles);
    for (size_t i = 0; i < triangles; i++) {
        double n[3], e[2][3], *x = s.xyz + 9 * i;
        for (size_t k = 0; k < 3; k++)
            n[k] = take_float(c);
        for (size_t k = 0; k < 9; k++)
            x[k] = take_float(c);
        assert_int_equal(take(c, 2), 0);
        for (size_t k = 0; k < 3; k++) {
            s.corners[3 * i + k] = (uint32_t)(3 * i + k);
            e[0][k] = x[3 + k] - x[k];
            e[1][k] = x[6 + k] - x[k];
        }
        if (!is_ellipsoid)
            continue;
        assert_true(fabs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0) < 1e-5);
        for (int k = 0; k < 2; k++)
            assert_true(fabs(n[0] * e[k][0] + n[1] * e[k][1] + n[2] * e[k][2]) < 1e-4);
        double outward = 0.0;
        for (size_t k = 0; k < 3; k++)
            outward += n[k] * (x[k] - centre[k]);
        assert_true(outward > 0.0);
    }
    assert_int_equal(c->at, c->size);
    free(s.normals);
    s.normals = NULL;
    return s;
}

static double number(const cJSON *object, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    assert_true(cJSON_IsNumber(item));
    return item->valuedouble;
}

static const cJSON *element(const cJSON *object, const char *key, int index) {
    const cJSON *item = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(object, key), index);
    assert_non_null(item);
    return item;
}

/* Places the cursor on an accessor's data, all bounds checked, and returns its count. */
static size_t seek_accessor(cursor *c, const cJSON *json, size_t binary, int index, int type,
                            const char *shape_name, size_t bytes) {
    const cJSON *accessor = element(json, "accessors", index);
    const cJSON *view = element(json, "bufferViews", (int)number(accessor, "bufferView"));
    const size_t count = (size_t)number(accessor, "count");
    const size_t offset = (size_t)number(view, "byteOffset");
    assert_true(number(accessor, "componentType") == type);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(accessor, "type")), shape_name);
    assert_true(number(view, "buffer") == 0);
    assert_int_equal(number(view, "byteLength"), count * bytes);
    assert_int_equal(offset % 4, 0);
    assert_true(offset + count * bytes <= number(element(json, "buffers", 0), "byteLength"));
    c->at = binary + offset;
    return count;
}

/* Sections 4.4 (chunks), 3.6 (accessors) and 3.7 (meshes) of the specification. */
static soup read_glb(cursor *c) {
    assert_int_equal(take(c, 4), 0x46546C67);
    assert_int_equal(take(c, 4), 2);
    assert_int_equal(take(c, 4), c->size);
    const size_t text = take(c, 4);
    assert_int_equal(text % 4, 0);
    assert_int_equal(take(c, 4), 0x4E4F534A);
    cJSON *json = cJSON_ParseWithLength((const char *)c->data + c->at, text);
    assert_non_null(json);
    c->at += text;
    assert_int_equal(take(c, 4), number(element(json, "buffers", 0), "byteLength"));
    assert_int_equal(take(c, 4), 0x004E4942);
    const size_t binary = c->at;
    assert_int_equal(binary % 4, 0);
    assert_int_equal(c->size, binary + number(element(json, "buffers", 0), "byteLength"));

    assert_string_equal(
        cJSON_GetStringValue(cJSON_GetObjectItem(cJSON_GetObjectItem(json, "asset"), "version")),
        "2.0");
    const cJSON *primitive = element(element(json, "meshes", 0), "primitives", 0);
    const cJSON *attributes = cJSON_GetObjectItem(primitive, "attributes");
    const int position = (int)number(attributes, "POSITION");
    const size_t corners =
        seek_accessor(c, json, binary, (int)number(primitive, "indices"), 5125, "SCALAR", 4);
    const size_t at = c->at;
    assert_int_equal(corners % 3, 0);
    const size_t vertices = seek_accessor(c, json, binary, position, 5126, "VEC3", 12);
    soup s = soup_make(vertices, corners / 3);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * vertices; i++) {
        s.xyz[i] = take_float(c);
        low[i % 3] = fmin(low[i % 3], s.xyz[i]);
        high[i % 3] = fmax(high[i % 3], s.xyz[i]);
    }
    for (int axis = 0; axis < 3; axis++) { /* exactly, says the specification */
        const cJSON *accessor = element(json, "accessors", position);
        assert_true((float)element(accessor, "min", axis)->valuedouble == (float)low[axis]);
        assert_true((float)element(accessor, "max", axis)->valuedouble == (float)high[axis]);
    }
    assert_int_equal(
        seek_accessor(c, json, binary, (int)number(attributes, "NORMAL"), 5126, "VEC3", 12),
        vertices);
    for (size_t i = 0; i < 3 * vertices; i++)
        s.normals[i] = take_float(c);
    c->at = at;
    for (size_t i = 0; i < corners; i++)
        s.corners[i] = take(c, 4);
    const cJSON *moved = cJSON_GetObjectItem(element(json, "nodes", 0), "translation");
    for (size_t i = 0; moved && i < 3 * vertices; i++)
        s.xyz[i] += cJSON_GetArrayItem(moved, (int)(i % 3))->valuedouble;
    cJSON_Delete(json);
    return s;
}

/* ---- every format ------------------------------------------------------------------------- */

typedef struct format {
    const char *name;
    soup (*read)(cursor *c);
    double tolerance; /* of coordinates, relative to the largest: 0 means rounded to float */
    bool shared;      /* vertices are */
} format;

static const format formats[] = {{"m.ply", read_ply, 0.0, true},
                                 {"m.obj", read_obj, 5e-7, true},
                                 {"m.stl", read_stl, 0.0, false},
                                 {"m.off", read_off, 5e-7, true},
                                 {"m.glb", read_glb, 0.0, true}};
enum { FORMATS = sizeof formats / sizeof *formats };

static void compare(const soup *s, const format *f) {
    const double *xyz = ovoid_mesh_xyz(mesh);
    const float *normals = ovoid_mesh_normals(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    assert_int_equal(s->triangles, ovoid_mesh_triangles(mesh));
    assert_int_equal(s->vertices,
                     f->shared ? ovoid_mesh_vertices(mesh) : 3 * ovoid_mesh_triangles(mesh));
    for (size_t i = 0; i < 3 * s->triangles; i++) {
        if (f->shared)
            assert_int_equal(s->corners[i], corners[i]);
        for (size_t k = 0; k < 3; k++) {
            const size_t got = 3 * (size_t)s->corners[i] + k, at = 3 * (size_t)corners[i] + k;
            const double wanted = f->tolerance > 0.0 ? xyz[at] : (double)(float)xyz[at];
            assert_true(fabs(s->xyz[got] - wanted) <= f->tolerance * fabs(wanted));
            if (s->normals)
                assert_true(fabs(s->normals[got] - (double)normals[at]) < 1e-5);
        }
    }
}

static void every_format_reads_back(void **state) {
    for (size_t i = 0; i < FORMATS; i++) {
        const char *path = scratch_path(*state, formats[i].name);
        test_check(context, ovoid_mesh_write(context, mesh, path));
        cursor c = load(path);
        soup s = formats[i].read(&c);
        compare(&s, &formats[i]);
        soup_free(&s);
        free(c.data);
    }
    assert_int_equal(scratch_entries(*state), FORMATS);
}

static void equal_meshes_give_equal_bytes(void **state) {
    for (size_t i = 0; i < FORMATS; i++) {
        char second[32] = "2";
        strcat(second, formats[i].name);
        for (char *p = second; *p; p++)
            *p = (char)toupper((unsigned char)*p); /* and .PLY is .ply */
        const char *paths[2] = {scratch_path(*state, formats[i].name),
                                scratch_path(*state, second)};
        cursor c[2];
        for (int k = 0; k < 2; k++) {
            test_check(context, ovoid_mesh_write(context, mesh, paths[k]));
            c[k] = load(paths[k]);
        }
        assert_int_equal(c[0].size, c[1].size);
        assert_memory_equal(c[0].data, c[1].data, c[0].size);
        free(c[0].data);
        free(c[1].data);
    }
}

static void locale_changes_nothing(void **state) {
    scratch *s = *state;
    if (!comma_enter(s)) {
        setlocale(LC_ALL, "C");
        print_message("no locale with a decimal comma here\n");
        skip();
    }
    ovoid_status written[FORMATS];
    for (size_t i = 0; i < FORMATS; i++)
        written[i] = ovoid_mesh_write(context, mesh, scratch_path(s, formats[i].name));
    assert_true(comma_leave(s));
    for (size_t i = 0; i < FORMATS; i++) {
        assert_int_equal(written[i], OVOID_OK);
        cursor c = load(scratch_path(s, formats[i].name));
        soup read = formats[i].read(&c);
        compare(&read, &formats[i]);
        soup_free(&read);
        free(c.data);
    }
}

/* ---- after equal vertices are merged ------------------------------------------------------- */

static const double *places; /* what is sorted */

static int by_place(const void *a, const void *b) {
    const double *const p = places + 3 * *(const size_t *)a, *const q =
                                                                 places + 3 * *(const size_t *)b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

static int by_key(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Gives equal vertices one number; returns how many are left. */
static size_t merge_equal(soup *s) {
    size_t *const order = test_alloc(s->vertices, sizeof *order), left = 0;
    uint32_t *const name = test_alloc(s->vertices, sizeof *name);
    for (size_t v = 0; v < s->vertices; v++)
        order[v] = v;
    places = s->xyz;
    qsort(order, s->vertices, sizeof *order, by_place);
    for (size_t k = 0; k < s->vertices; k++) {
        left += k == 0 || by_place(&order[k], &order[k - 1]) != 0;
        name[order[k]] = (uint32_t)left - 1;
    }
    for (size_t k = 0; k < 3 * s->triangles; k++)
        s->corners[k] = name[s->corners[k]];
    free(order);
    free(name);
    return left;
}

/* From the coordinates before vertices had new numbers. */
static void expect_area(const soup *s) {
    for (size_t t = 0; t < s->triangles; t++) {
        double u[3], v[3];
        for (int k = 0; k < 3; k++) {
            const double from = s->xyz[3 * (size_t)s->corners[3 * t] + (size_t)k];
            u[k] = s->xyz[3 * (size_t)s->corners[3 * t + 1] + (size_t)k] - from;
            v[k] = s->xyz[3 * (size_t)s->corners[3 * t + 2] + (size_t)k] - from;
        }
        assert_true(u[1] * v[2] != u[2] * v[1] || u[2] * v[0] != u[0] * v[2] ||
                    u[0] * v[1] != u[1] * v[0]);
    }
}

/* Each edge has two triangles, which run along it in opposite directions. */
static void expect_watertight(const soup *s) {
    const size_t sides = 3 * s->triangles;
    uint64_t *const forward = test_alloc(sides, sizeof *forward), *const backward = test_alloc(
                                                                      sides, sizeof *backward);
    for (size_t k = 0; k < sides; k++) {
        const uint64_t a = s->corners[k], b = s->corners[k % 3 == 2 ? k - 2 : k + 1];
        assert_true(a != b);
        forward[k] = a << 32 | b;
        backward[k] = b << 32 | a;
    }
    qsort(forward, sides, sizeof *forward, by_key);
    qsort(backward, sides, sizeof *backward, by_key);
    for (size_t k = 0; k < sides; k++) {
        assert_true(k == 0 || forward[k] != forward[k - 1]);
        assert_true(forward[k] == backward[k]);
    }
    free(forward);
    free(backward);
}

/* Atoms whose surfaces pass through lattice points, or by them as near as rounding can tell; and
 * what a format says where its floats are too coarse, NULL where it writes in any case. */
static const struct {
    double x, y, z, radius, spacing;
    ovoid_vertex_rule vertices;
    const char *refused[2]; /* by STL, by glTF */
} touching[] = {
    {0.0, 0.0, 0.0, 1.0, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {0.0, 0.0, 0.0, 2.0, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {0.0, 0.0, 0.0, 2.0, 0.5, OVOID_VERTEX_LINEAR, {NULL, NULL}},
    {3.0, -7.5, 0.5, 1.5, 0.1, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {64.5, 100.0, -33.0, 2.5, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {0.0, 0.0, 0.0, 2.0 + 1e-7, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {0.0, 0.0, 0.0, 2.0 - 1e-7, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {1e-6, -1e-6, 1e-6, 2.0, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {1000.0, -1000.0, 2000.0, 2.5, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {99999.5, -1e5, 1e5, 2.5, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {1e5, 1e5, 1e5, 2.0, 0.125, OVOID_VERTEX_EXACT, {NULL, NULL}},
    {1e6, -1e6, 1e6, 2.0, 0.25, OVOID_VERTEX_EXACT, {"write .ply, or move the molecule", NULL}},
    {99.0,
     -1e6,
     1e6,
     1.3,
     0.03125,
     OVOID_VERTEX_LINEAR,
     {"write .ply, or move the molecule", NULL}},
    {0.0, 0.0, 0.0, 0.2, 0.5, OVOID_VERTEX_EXACT, {NULL, NULL}},
};

static ovoid_mesh *mesh_touching(size_t k) {
    const double xyzr[4] = {touching[k].x, touching[k].y, touching[k].z, touching[k].radius};
    ovoid_molecule *molecule = NULL;
    ovoid_mesh *made = NULL;
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = touching[k].spacing;
    options.vertices = touching[k].vertices;
    test_check(context, ovoid_molecule_create(context, xyzr, 1, &molecule));
    test_check(context, once_molecule_mesh(context, molecule, 0.5, &options, &made));
    ovoid_molecule_destroy(&molecule);
    return made;
}

static void expect_closed_file(const char *path, const format *f, const ovoid_mesh *made) {
    test_check(context, ovoid_mesh_write(context, made, path));
    cursor c = load(path);
    soup s = f->read(&c);
    expect_area(&s);
    assert_int_equal(merge_equal(&s), ovoid_mesh_vertices(made));
    expect_watertight(&s);
    soup_free(&s);
    free(c.data);
}

static void merging_equal_vertices_leaves_no_holes(void **state) {
    is_ellipsoid = false;
    test_check(context, ovoid_context_open_device(context, NULL));
    for (size_t k = 0; k < sizeof touching / sizeof *touching; k++) {
        ovoid_mesh *made = mesh_touching(k);
        for (size_t i = 0; i < FORMATS; i++) {
            const char *path = scratch_path(*state, formats[i].name);
            const char *refused = formats[i].read == read_stl   ? touching[k].refused[0]
                                  : formats[i].read == read_glb ? touching[k].refused[1]
                                                                : NULL;
            if (refused)
                test_refused(context, ovoid_mesh_write(context, made, path), OVOID_ERROR_LIMIT,
                             refused);
            else
                expect_closed_file(path, &formats[i], made);
        }
        ovoid_mesh_destroy(&made);
    }
    is_ellipsoid = true;
}

/* What `assimp info` says after `label`. */
static void find_info(const char *text, const char *label, double *values, int count) {
    const char *at = strstr(text, label);
    if (!at)
        fail_msg("assimp says nothing of '%s' in:\n%s", label, text);
    at += strlen(label);
    for (int i = 0; i < count; i++) {
        char *end;
        values[i] = strtod(at + strspn(at, " ("), &end);
        assert_ptr_not_equal(end, at);
        at = end;
    }
}

static void assimp_reads_every_format(void **state) {
    if (system("assimp version >/dev/null 2>&1") != 0) {
        print_message("no program assimp here (Debian: assimp-utils)\n");
        skip();
    }
    for (size_t i = 0; i < FORMATS; i++) {
        char command[600], text[8192];
        const char *path = scratch_path(*state, formats[i].name);
        test_check(context, ovoid_mesh_write(context, mesh, path));
        snprintf(command, sizeof command, "assimp info '%s' --raw 2>&1", path);
        FILE *stream = popen(command, "r");
        assert_non_null(stream);
        text[fread(text, 1, sizeof text - 1, stream)] = '\0';
        assert_int_equal(pclose(stream), 0);
        double faces, low[3], high[3];
        find_info(text, "Faces:", &faces, 1);
        find_info(text, "Minimum point", low, 3);
        find_info(text, "Maximum point", high, 3);
        assert_true(faces == (double)ovoid_mesh_triangles(mesh));
        for (int axis = 0; axis < 3; axis++) {
            assert_true(fabs(low[axis] - (centre[axis] - axes[axis])) < 0.15);
            assert_true(fabs(high[axis] - (centre[axis] + axes[axis])) < 0.15);
        }
    }
}

/* ---- failures ----------------------------------------------------------------------------- */

static void unknown_extensions_are_refused(void **state) {
    static const char *const names[] = {"m", "m.", "m.xyz", ".ply", "m.ply.gz", "ply"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        test_refused(context, ovoid_mesh_write(context, mesh, scratch_path(*state, names[i])),
                     OVOID_ERROR_ARGUMENT, "would end in .ply, .obj, .stl, .off or .glb");
    test_refused(context, ovoid_mesh_write(context, mesh, "-"), OVOID_ERROR_ARGUMENT, "'-'");
    test_refused(context, ovoid_mesh_write(context, NULL, "m.ply"), OVOID_ERROR_ARGUMENT, "NULL");
    test_refused(context, ovoid_mesh_write(context, mesh, NULL), OVOID_ERROR_ARGUMENT, "NULL");
    assert_int_equal(scratch_entries(*state), 0);
}

static void failures_leave_nothing(void **state) {
    scratch *s = *state;
    test_refused(context, ovoid_mesh_write(context, mesh, scratch_path(s, "no/m.ply")),
                 OVOID_ERROR_IO, "there is no folder");
    for (size_t i = 0; i < FORMATS; i++) {
        const char *path = scratch_path(s, formats[i].name);
        if (access("/dev/full", W_OK) != 0 || symlink("/dev/full", path) != 0) {
            print_message("no /dev/full here\n");
            skip();
        }
        test_refused(context, ovoid_mesh_write(context, mesh, path), OVOID_ERROR_IO,
                     "No space left on device");
    }
    assert_int_equal(scratch_entries(s), FORMATS); /* the links */
}

static void meshes_without_triangles_are_empty(void **state) {
    static const double point[3] = {1, 2, 3};
    static const float up[3] = {0, 0, 1};
    ovoid_mesh *lone = NULL;
    if (ovoid_mesh_create(context, point, up, 1, NULL, 0, &lone) == OVOID_OK)
        test_refused(context, ovoid_mesh_write(context, lone, scratch_path(*state, "m.ply")),
                     OVOID_ERROR_EMPTY, "without triangles");
    ovoid_mesh_destroy(&lone);
    assert_int_equal(scratch_entries(*state), 0);
}

#define IN_SCRATCH(test) cmocka_unit_test_setup_teardown(test, scratch_setup, scratch_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        IN_SCRATCH(every_format_reads_back),   IN_SCRATCH(equal_meshes_give_equal_bytes),
        IN_SCRATCH(locale_changes_nothing),    IN_SCRATCH(merging_equal_vertices_leaves_no_holes),
        IN_SCRATCH(assimp_reads_every_format), IN_SCRATCH(unknown_extensions_are_refused),
        IN_SCRATCH(failures_leave_nothing),    IN_SCRATCH(meshes_without_triangles_are_empty),
    };
    return cmocka_run_group_tests(tests, make_mesh, drop_mesh);
}
