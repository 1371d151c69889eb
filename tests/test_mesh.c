/*
 * Meshes: what they say of themselves, against closed forms.
 */
#include "base/parallel.h"
#include "shapes.h"
#include "support.h"

#define PI 3.14159265358979323846

static int make_context(void **state) {
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK)
        return -1;
    *state = context;
    return 0;
}

static void test_tetrahedron(void **state) {
    static const double xyz[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    static const uint32_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    ovoid_mesh *mesh = NULL;
    test_check(*state, ovoid_mesh_create(*state, xyz, NULL, 4, corners, 4, &mesh));
    assert_int_equal(ovoid_mesh_vertices(mesh), 4);
    assert_int_equal(ovoid_mesh_triangles(mesh), 4);
    assert_int_equal(ovoid_mesh_components(mesh), 1);
    const ovoid_component *const only = ovoid_mesh_component(mesh, 0);
    assert_null(ovoid_mesh_component(mesh, 1));
    assert_true(only->closed && only->outer);
    assert_int_equal(only->euler, 2);
    assert_int_equal(only->vertices, 4);
    assert_int_equal(only->triangles, 4);
    expect_near(ovoid_mesh_volume(mesh), 1.0 / 6.0, 1e-15, "volume");
    expect_near(ovoid_mesh_area(mesh), 1.5 + 0.5 * sqrt(3.0), 1e-15, "area");
    /* The normal at the origin is the mean of those of three faces of equal area. */
    for (size_t k = 0; k < 3; ++k)
        expect_near(ovoid_mesh_normals(mesh)[k], -1.0 / sqrt(3.0), 1e-7, "normal");
    assert_memory_equal(ovoid_mesh_xyz(mesh), xyz, sizeof xyz);
    assert_memory_equal(ovoid_mesh_corners(mesh), corners, sizeof corners);
    ovoid_mesh_destroy(&mesh);
    assert_null(mesh);
    ovoid_mesh_destroy(&mesh);
    ovoid_mesh_destroy(NULL);
}

/* One triangle is one component, whichever of its corners another shares. */
static void test_one_triangle(void **state) {
    static const double xyz[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
    static const uint32_t corners[6] = {0, 1, 2, 3, 4, 2};
    for (size_t triangles = 1; triangles <= 2; ++triangles) {
        ovoid_mesh *mesh = NULL;
        test_check(*state, ovoid_mesh_create(*state, xyz, NULL, 1 + 2 * triangles, corners,
                                             triangles, &mesh));
        assert_int_equal(ovoid_mesh_components(mesh), 1);
        assert_int_equal(ovoid_mesh_component(mesh, 0)->euler, 1);
        assert_false(ovoid_mesh_component(mesh, 0)->closed);
        ovoid_mesh_destroy(&mesh);
    }
}

/* Edges that are missing, double or turned are seen. */
static void test_defects(void **state) {
    shape s = {0};
    shape_add_sphere(&s, 2, 2.0, 0, 0, 0);
    ovoid_mesh *mesh = shape_mesh(*state, &s);
    assert_true(ovoid_mesh_component(mesh, 0)->closed);
    ovoid_mesh_destroy(&mesh);

    s.triangles--; /* a hole */
    mesh = shape_mesh(*state, &s);
    assert_false(ovoid_mesh_component(mesh, 0)->closed);
    assert_int_equal(ovoid_mesh_component(mesh, 0)->euler, 1);
    ovoid_mesh_destroy(&mesh);
    s.triangles++;

    uint32_t *const last = s.corners + 3 * (s.triangles - 1);
    const uint32_t kept[3] = {last[0], last[1], last[2]};
    last[1] = kept[2]; /* turned */
    last[2] = kept[1];
    mesh = shape_mesh(*state, &s);
    assert_false(ovoid_mesh_component(mesh, 0)->closed);
    assert_int_equal(ovoid_mesh_component(mesh, 0)->euler, 2);
    ovoid_mesh_destroy(&mesh);

    memcpy(last, s.corners, 3 * sizeof *last); /* double, and a hole */
    mesh = shape_mesh(*state, &s);
    assert_false(ovoid_mesh_component(mesh, 0)->closed);
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&s);
}

/* More edges than are looked at at a time. */
static void test_many_edges(void **state) {
    shape s = {0};
    shape_add_torus(&s, 300, 5.0, 1.0);
    for (int hole = 0; hole < 2; ++hole, --s.triangles) {
        ovoid_mesh *mesh = shape_mesh(*state, &s);
        assert_int_equal(ovoid_mesh_components(mesh), 1);
        assert_true(ovoid_mesh_component(mesh, 0)->closed == !hole);
        assert_int_equal(ovoid_mesh_component(mesh, 0)->euler, -hole);
        ovoid_mesh_destroy(&mesh);
    }
    shape_destroy(&s);
}

/* Numbers from 0 to count - 1 in any order. */
static uint32_t *any_order(size_t count, uint64_t seed) {
    test_random random = {seed};
    uint32_t *const order = test_alloc(count, sizeof *order);
    for (size_t k = 0; k < count; ++k)
        order[k] = (uint32_t)k;
    for (size_t k = count; k-- > 1;) {
        const size_t other = (size_t)(random_bits(&random) % (k + 1));
        const uint32_t swap = order[k];
        order[k] = order[other];
        order[other] = swap;
    }
    return order;
}

/* A torus of very many triangles with small spheres and a cavity about it, its vertices or its
 * triangles as they come or in any order: several parts, whose triangles lead into others. */
static ovoid_mesh *large_mesh(ovoid_context *context, bool vertices, bool triangles) {
    shape s = {0};
    ovoid_mesh *mesh = NULL;
    for (size_t k = 0; k < 40; ++k)
        shape_add_sphere(&s, 1, 0.5 + 0.01 * (double)k, 3.0 * (double)k, 20, 0);
    shape_add_torus(&s, 200, 5.0, 1.0);
    shape_add_ellipsoid(&s, 4, (const double[3]){2, 2, 3}, (const double[3]){-20, 0, 0}, true);
    uint32_t *const place = any_order(s.vertices, 3), *const turn = any_order(s.triangles, 4);
    double *const xyz = test_alloc(3 * s.vertices, sizeof *xyz);
    uint32_t *const corners = test_alloc(3 * s.triangles, sizeof *corners);
    for (size_t v = 0; v < s.vertices; ++v)
        memcpy(xyz + 3 * (vertices ? place[v] : v), s.xyz + 3 * v, 3 * sizeof *xyz);
    for (size_t k = 0; k < 3 * s.triangles; ++k) {
        const uint32_t v = s.corners[3 * (triangles ? turn[k / 3] : k / 3) + k % 3];
        corners[k] = vertices ? place[v] : v;
    }
    test_check(context,
               ovoid_mesh_create(context, xyz, NULL, s.vertices, corners, s.triangles, &mesh));
    assert_true(s.triangles > 60000);
    shape_destroy(&s);
    free(place);
    free(turn);
    free(xyz);
    free(corners);
    return mesh;
}

/* What each triangle adds, one after the other. */
static ov_content smooth_by_triangles(const ovoid_mesh *mesh, bool outer_only) {
    ov_content content = {0.0, 0.0};
    double origin[3];
    ov_mesh_at(mesh, 0, origin);
    for (size_t t = 0; t < mesh->triangles; ++t)
        if (!outer_only || ov_mesh_component_of_triangle(mesh, t)->outer)
            ov_mesh_smooth_triangle(mesh, t, origin, &content);
    return content;
}

static void expect_smooth(const ovoid_mesh *mesh) {
    for (int outer = 0; outer < 2; ++outer) {
        const ov_content got = ov_mesh_smooth(mesh, outer),
                         wanted = smooth_by_triangles(mesh, outer);
        assert_memory_equal(&got, &wanted, sizeof got);
    }
    assert_true(ov_mesh_smooth(mesh, true).area < ov_mesh_smooth(mesh, false).area);
}

static void test_threads_change_nothing(void **state) {
    for (int order = 0; order < 4; ++order) {
        ovoid_mesh *several, *alone;
        ov_parallel_limit(1);
        alone = large_mesh(*state, order & 1, order & 2);
        ov_parallel_limit(5);
        several = large_mesh(*state, order & 1, order & 2);
        expect_smooth(several);
        ov_parallel_limit(0);
        expect_smooth(alone);
        assert_int_equal(alone->components, 42);
        for (size_t t = 0; t < alone->triangles; ++t) /* of one component, all three */
            for (size_t i = 1; i < 3; ++i)
                assert_int_equal(alone->component_of[alone->corners[3 * t]],
                                 alone->component_of[alone->corners[3 * t + i]]);
        for (size_t c = 0; c < alone->components; ++c) {
            const ovoid_component *const one = &alone->component[c];
            assert_true(one->closed);
            assert_int_equal(one->triangles, 2 * (one->vertices - (size_t)one->euler));
        }
        assert_int_equal(several->components, alone->components);
        assert_memory_equal(several->component_of, alone->component_of,
                            alone->vertices * sizeof *alone->component_of);
        assert_memory_equal(several->component, alone->component,
                            alone->components * sizeof *alone->component);
        ovoid_mesh_destroy(&alone);
        ovoid_mesh_destroy(&several);
    }
}

/* What is no mesh is told of where it is, however large. */
static void test_faults_of_large_meshes(void **state) {
    ovoid_mesh *const mesh = large_mesh(*state, true, true);
    char text[100];
    const size_t triangle = mesh->triangles - 7, vertex = mesh->vertices / 3;
    const uint32_t corner = mesh->corners[3 * triangle + 1];
    mesh->corners[3 * triangle + 1] = (uint32_t)mesh->vertices;
    assert_int_equal(ov_mesh_check(*state, mesh), OVOID_ERROR_ARGUMENT);
    snprintf(text, sizeof text, "triangle %zu of a mesh", triangle);
    assert_non_null(strstr(ovoid_context_error(*state), text));
    mesh->corners[3 * triangle + 1] = corner;
    mesh->normals[3 * vertex + 2] = NAN;
    assert_int_equal(ov_mesh_check(*state, mesh), OVOID_ERROR_ARGUMENT);
    mesh->normals[3 * vertex + 2] = 0.0f;
    mesh->xyz[3 * vertex] = -INFINITY;
    assert_int_equal(ov_mesh_check(*state, mesh), OVOID_ERROR_ARGUMENT);
    snprintf(text, sizeof text, "vertex %zu of a mesh", vertex);
    assert_non_null(strstr(ovoid_context_error(*state), text));
    mesh->xyz[3 * vertex] = 0.0;
    test_check(*state, ov_mesh_check(*state, mesh));
    ovoid_mesh_destroy((ovoid_mesh **)&mesh);
}

/* A light mesh says the same, but for its edges. */
static void test_light(void **state) {
    const double origin[3] = {300.0, -200.0, 100.0};
    shape s = {0};
    shape_add_ellipsoid(&s, 3, (const double[3]){2, 3, 4}, origin, false);
    shape_add_sphere(&s, 2, 1.0, 300.5, -200, 100);
    float *const offsets = test_alloc(3 * s.vertices, sizeof *offsets);
    float *const normals = test_alloc(3 * s.vertices, sizeof *normals);
    uint32_t *const corners = test_alloc(3 * s.triangles, sizeof *corners);
    for (size_t k = 0; k < 3 * s.vertices; ++k) {
        offsets[k] = (float)(s.xyz[k] - origin[k % 3]);
        normals[k] = s.normals[k];
    }
    memcpy(corners, s.corners, 3 * s.triangles * sizeof *corners);
    ovoid_mesh *full = shape_mesh(*state, &s), *light = NULL;
    test_check(*state, ov_mesh_adopt_light(*state, offsets, origin, normals, s.vertices, corners,
                                           s.triangles, &light));
    test_check(*state, ov_mesh_finish(*state, light));
    assert_int_equal(light->components, 2);
    assert_memory_equal(light->component_of, full->component_of,
                        s.vertices * sizeof *light->component_of);
    for (size_t c = 0; c < 2; ++c) {
        const ovoid_component *const got = &light->component[c], *const wanted =
                                                                     &full->component[c];
        assert_true(got->outer == wanted->outer);
        expect_near(got->area, wanted->area, 1e-6 * wanted->area, "area");
        expect_near(got->volume, wanted->volume, 1e-6 * wanted->area, "volume");
    }
    const ov_content got = ov_mesh_smooth(light, false), wanted = ov_mesh_smooth(full, false);
    expect_near(got.area, wanted.area, 1e-6 * wanted.area, "smooth area");
    expect_near(got.volume, wanted.volume, 1e-6 * wanted.area, "smooth volume");
    for (size_t v = 0; v < s.vertices; ++v) {
        double at[3];
        ov_mesh_at(light, v, at);
        for (size_t k = 0; k < 3; ++k)
            expect_near(at[k], s.xyz[3 * v + k], 3e-7, "a vertex");
    }
    ovoid_mesh_destroy(&full);
    ovoid_mesh_destroy(&light);
    shape_destroy(&s);
}

/* A ball with a cavity, a torus beside it, and a vertex that nobody uses. */
static void test_components(void **state) {
    shape s = {0};
    shape_add_sphere(&s, 3, 3.0, 10, 0, 0);
    shape_add_ellipsoid(&s, 3, (const double[3]){1, 1, 1}, (const double[3]){10, 0, 0}, true);
    shape_add_torus(&s, 24, 4.0, 1.0);
    const size_t used = s.vertices;
    const double point[3] = {7, 7, 7};
    s.xyz = realloc(s.xyz, (3 * used + 3) * sizeof *s.xyz);
    s.normals = realloc(s.normals, (3 * used + 3) * sizeof *s.normals);
    memcpy(s.xyz + 3 * used, point, sizeof point);
    s.normals[3 * used] = s.normals[3 * used + 1] = 0.0f;
    s.normals[3 * used + 2] = 1.0f;
    s.vertices++;
    ovoid_mesh *mesh = shape_mesh(*state, &s);
    assert_int_equal(ovoid_mesh_components(mesh), 4);
    static const int euler[4] = {2, 2, 0, 1};
    static const bool outer[4] = {true, false, true, false}, closed[4] = {true, true, true, false};
    double area = 0.0, volume = 0.0;
    size_t vertices = 0;
    for (size_t c = 0; c < 4; ++c) {
        const ovoid_component *const component = ovoid_mesh_component(mesh, c);
        assert_int_equal(component->euler, euler[c]);
        assert_int_equal(component->outer, outer[c]);
        assert_int_equal(component->closed, closed[c]);
        area += component->area;
        volume += component->volume;
        for (size_t v = 0; v < component->vertices; ++v)
            assert_int_equal(ovoid_mesh_component_of(mesh)[vertices + v], c);
        vertices += component->vertices;
    }
    assert_int_equal(vertices, s.vertices);
    assert_true(ovoid_mesh_component(mesh, 1)->volume < 0.0);
    expect_near(ovoid_mesh_area(mesh), area, 1e-9, "area");
    expect_near(ovoid_mesh_volume(mesh), volume, 1e-9, "volume");
    expect_near(ov_mesh_flat(mesh, true).volume - volume, -ovoid_mesh_component(mesh, 1)->volume,
                1e-9, "volume of the cavity");
    const double wall = ov_mesh_smooth(mesh, false).area - ov_mesh_smooth(mesh, true).area;
    expect_near(wall, 4.0 * PI, 0.002, "area of the cavity's wall");
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&s);
}

/* The order in which the error falls when triangles are halved, and the last error. */
typedef struct order {
    double area, volume, last_area, last_volume;
} order;

typedef void add_level(shape *s, int level);

static order convergence(ovoid_context *context, add_level *add, int from, double area,
                         double volume, bool smooth) {
    ov_content error[2];
    for (int k = 0; k < 2; ++k) {
        shape s = {0};
        add(&s, from + k);
        ovoid_mesh *mesh = shape_mesh(context, &s);
        error[k].area =
            fabs((smooth ? ovoid_mesh_smooth_area(mesh) : ovoid_mesh_area(mesh)) / area - 1.0);
        error[k].volume = fabs(
            (smooth ? ovoid_mesh_smooth_volume(mesh) : ovoid_mesh_volume(mesh)) / volume - 1.0);
        ovoid_mesh_destroy(&mesh);
        shape_destroy(&s);
    }
    return (order){log2(error[0].area / error[1].area), log2(error[0].volume / error[1].volume),
                   error[1].area, error[1].volume};
}

static void add_sphere(shape *s, int level) {
    shape_add_sphere(s, level, 2.0, 30.0, -20.0, 10.0);
}

static const double axes[3] = {1.5, 2.0, 3.0};
static void add_ellipsoid(shape *s, int level) {
    shape_add_ellipsoid(s, level, axes, (const double[3]){30.0, -20.0, 10.0}, false);
}

static void add_torus(shape *s, int level) {
    shape_add_torus(s, (size_t)4 << level, 4.0, 1.0);
}

static void expect_orders(const char *what, order flat, order smooth) {
    print_message("%s: flat of order %.2f, %.2f (errors %.2g, %.2g), smooth %.2f, %.2f (%.2g, "
                  "%.2g)\n",
                  what, flat.area, flat.volume, flat.last_area, flat.last_volume, smooth.area,
                  smooth.volume, smooth.last_area, smooth.last_volume);
    expect_near(flat.area, 2.0, 0.1, "order of the flat area");
    expect_near(flat.volume, 2.0, 0.1, "order of the flat volume");
    expect_near(smooth.area, 4.0, 0.4, "order of the smooth area");
    expect_near(smooth.volume, 4.0, 0.4, "order of the smooth volume");
}

static void test_orders(void **state) {
    const double ball = 4.0 / 3.0 * PI;
    const double area = ellipsoid_area(axes);
    expect_near(ellipsoid_area((const double[3]){2, 2, 2}), 16.0 * PI, 1e-5, "quadrature");
    expect_orders("sphere", convergence(*state, add_sphere, 2, 16.0 * PI, 8.0 * ball, false),
                  convergence(*state, add_sphere, 2, 16.0 * PI, 8.0 * ball, true));
    expect_orders("ellipsoid", convergence(*state, add_ellipsoid, 3, area, 9.0 * ball, false),
                  convergence(*state, add_ellipsoid, 3, area, 9.0 * ball, true));
    const double torus_area = 16.0 * PI * PI, torus_volume = 8.0 * PI * PI;
    expect_orders("torus", convergence(*state, add_torus, 3, torus_area, torus_volume, false),
                  convergence(*state, add_torus, 3, torus_area, torus_volume, true));
}

static void test_flat_surface_stays_flat(void **state) {
    shape s = {0};
    shape_add_square(&s, 5, 2.0, 3.0);
    ovoid_mesh *mesh = shape_mesh(*state, &s);
    expect_near(ovoid_mesh_area(mesh), 16.0, 1e-12, "area");
    expect_near(ovoid_mesh_smooth_area(mesh), 16.0, 1e-12, "smooth area");
    assert_false(ovoid_mesh_component(mesh, 0)->closed);
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&s);
}

/* Every triangle of a sphere cut at a point next to the middle of an edge: needles whose planes are
 * far from the surface, as marching cubes makes them. */
static void test_needles(void **state) {
    shape s = {0};
    shape_add_sphere(&s, 4, 2.0, 0, 0, 0);
    const size_t before = s.triangles;
    shape cut = {0};
    const size_t vertices = s.vertices + before;
    cut.xyz = test_alloc(3 * vertices, sizeof *cut.xyz);
    cut.normals = test_alloc(3 * vertices, sizeof *cut.normals);
    cut.corners = test_alloc(9 * before, sizeof *cut.corners);
    memcpy(cut.xyz, s.xyz, 3 * s.vertices * sizeof *s.xyz);
    memcpy(cut.normals, s.normals, 3 * s.vertices * sizeof *s.normals);
    cut.vertices = s.vertices;
    for (size_t t = 0; t < before; ++t) {
        const uint32_t *const c = s.corners + 3 * t;
        double x[3], length = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            x[k] = 0.49995 * s.xyz[3 * c[0] + k] + 0.49995 * s.xyz[3 * c[1] + k] +
                   0.0001 * s.xyz[3 * c[2] + k];
            length += x[k] * x[k];
        }
        for (size_t k = 0; k < 3; ++k) {
            cut.xyz[3 * cut.vertices + k] = 2.0 * x[k] / sqrt(length);
            cut.normals[3 * cut.vertices + k] = (float)(x[k] / sqrt(length));
        }
        const uint32_t at = (uint32_t)cut.vertices++;
        for (size_t k = 0; k < 3; ++k, ++cut.triangles) {
            cut.corners[3 * cut.triangles] = c[k];
            cut.corners[3 * cut.triangles + 1] = c[(k + 1) % 3];
            cut.corners[3 * cut.triangles + 2] = at;
        }
    }
    ovoid_mesh *mesh = shape_mesh(*state, &cut);
    print_message("needles: flat area off by %.2g, smooth by %.2g\n",
                  ovoid_mesh_area(mesh) / (16.0 * PI) - 1.0,
                  ovoid_mesh_smooth_area(mesh) / (16.0 * PI) - 1.0);
    expect_near(ovoid_mesh_smooth_area(mesh) / (16.0 * PI), 1.0, 2e-5, "smooth area");
    expect_near(ovoid_mesh_smooth_volume(mesh) / (32.0 / 3.0 * PI), 1.0, 2e-5, "smooth volume");
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&cut);
    shape_destroy(&s);
}

static void test_refusals(void **state) {
    static const double xyz[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const double bad[9] = {0, 0, 0, 1, NAN, 0, 0, 1, 0};
    static const float tilt[9] = {0, 0, 1, 0, 0, INFINITY, 0, 0, 1};
    static const uint32_t good[3] = {0, 1, 2}, past[3] = {0, 1, 3};
    ovoid_mesh *mesh = NULL;
    ovoid_context *const context = *state;
    test_refused(context, ovoid_mesh_create(context, xyz, NULL, 3, past, 1, &mesh),
                 OVOID_ERROR_ARGUMENT, "triangle 0 of a mesh names vertex 3, but there are 3");
    test_refused(context, ovoid_mesh_create(context, bad, NULL, 3, good, 1, &mesh),
                 OVOID_ERROR_ARGUMENT, "vertex 1 of a mesh");
    test_refused(context, ovoid_mesh_create(context, xyz, tilt, 3, good, 1, &mesh),
                 OVOID_ERROR_ARGUMENT, "vertex 1 of a mesh");
    test_refused(context, ovoid_mesh_create(context, NULL, NULL, 3, good, 1, &mesh),
                 OVOID_ERROR_ARGUMENT, "is NULL");
    test_refused(context, ovoid_mesh_create(context, xyz, NULL, SIZE_MAX / 2, good, 1, &mesh),
                 OVOID_ERROR_LIMIT, "vertices");
    assert_null(mesh);
    test_check(context, ovoid_mesh_create(context, NULL, NULL, 0, NULL, 0, &mesh));
    assert_int_equal(ovoid_mesh_components(mesh), 0);
    expect_near(ovoid_mesh_smooth_area(mesh), 0.0, 0.0, "area of nothing");
    ovoid_mesh_destroy(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tetrahedron),
        cmocka_unit_test(test_one_triangle),
        cmocka_unit_test(test_defects),
        cmocka_unit_test(test_components),
        cmocka_unit_test(test_many_edges),
        cmocka_unit_test(test_light),
        cmocka_unit_test(test_orders),
        cmocka_unit_test(test_flat_surface_stays_flat),
        cmocka_unit_test(test_needles),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_threads_change_nothing),
        cmocka_unit_test(test_faults_of_large_meshes),
    };
    return cmocka_run_group_tests(tests, make_context, test_close);
}
