/*
 * Distances between meshes, against closed forms and against every triangle in double precision.
 */
#include "measure/distance.h"
#include "selftest/twin_distance.h"
#include "shapes.h"
#include "support.h"

static ovoid_distances distances(ovoid_context *context, const shape *a, const shape *b,
                                 bool outer_only) {
    ovoid_mesh *first = shape_mesh(context, a), *second = shape_mesh(context, b);
    ovoid_distances result;
    test_check(context, ovoid_mesh_distances(context, first, second, outer_only, &result, NULL));
    ovoid_mesh_destroy(&first);
    ovoid_mesh_destroy(&second);
    return result;
}

/* Distances of points from triangles given as arrays, all at once and in chunks and batches. */
static void expect_distances(ovoid_context *context, const double *xyz, size_t vertices,
                             const uint32_t *corners, size_t triangles, const float *points,
                             size_t count, double tolerance) {
    static const double origin[3] = {0.0, 0.0, 0.0};
    static const size_t chunks[] = {16, 17, 33, 40};
    ovoid_mesh *mesh = NULL;
    ov_trail trail = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    const ov_sites sites = {.count = count, .xyz = points};
    float *const squared = test_alloc(count, sizeof *squared);
    float *const again = test_alloc(count, sizeof *again);
    test_check(context, ovoid_mesh_create(context, xyz, NULL, vertices, corners, triangles, &mesh));
    test_check(context, ov_trail_create(context, mesh, false, &trail));
    test_check(context, ov_facets_set(context, &facets, &trail, origin));
    test_check(context, ov_facets_distances(context, &meter, &facets, &sites, squared));
    for (size_t n = 0; n < sizeof chunks / sizeof *chunks; n = test_next(context, n, 2)) {
        facets.chunk = chunks[n];
        meter.batch = count / (n + 1) + n;
        test_check(context, ov_facets_distances(context, &meter, &facets, &sites, again));
        assert_memory_equal(again, squared, count * sizeof *squared);
    }
    double worst = 0.0;
    for (size_t k = 0; k < count; ++k) {
        const double point[3] = {points[3 * k], points[3 * k + 1], points[3 * k + 2]};
        const double wanted = ov_twin_mesh_distance(point, mesh, false);
        const double got = sqrt((double)squared[k]);
        if (!(fabs(got - wanted) <= tolerance * fmax(wanted, 1.0)))
            fail_msg("point %zu (%g, %g, %g) is %.9g away instead of %.9g", k, point[0], point[1],
                     point[2], got, wanted);
        worst = fmax(worst, fabs(got - wanted));
    }
    print_message("%zu points, %zu triangles: off by %.2g at most\n", count, triangles, worst);
    free(again);
    free(squared);
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    ov_trail_destroy(&trail);
    ovoid_mesh_destroy(&mesh);
}

/* On a corner, an edge, the face; above each; beside each. */
static void test_one_triangle(void **state) {
    static const double xyz[9] = {0, 0, 0, 4, 0, 0, 0, 3, 0};
    static const uint32_t corners[3] = {0, 1, 2};
    static const struct {
        float point[3];
        double distance;
    } cases[] = {{{0, 0, 0}, 0},   {{4, 0, 0}, 0},    {{0, 3, 0}, 0},  {{2, 0, 0}, 0},
                 {{0, 2, 0}, 0},   {{2, 1.5f, 0}, 0}, {{1, 1, 0}, 0},  {{1, 1, 2}, 2},
                 {{1, 1, -2}, 2},  {{2, -1, 0}, 1},   {{-1, 1, 0}, 1}, {{-3, -4, 0}, 5},
                 {{7, 0, 4}, 5},   {{0, 7, 3}, 5},    {{2, -3, 4}, 5}, {{5, 5.5f, 0}, 5},
                 {{100, 0, 0}, 96}};
    enum { CASES = sizeof cases / sizeof *cases };
    static const double origin[3] = {0.0, 0.0, 0.0};
    ovoid_context *const context = *state;
    ovoid_mesh *mesh = NULL;
    ov_trail trail = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    float points[3 * CASES], squared[CASES];
    for (size_t k = 0; k < CASES; ++k)
        memcpy(points + 3 * k, cases[k].point, sizeof cases[k].point);
    test_check(context, ovoid_mesh_create(context, xyz, NULL, 3, corners, 1, &mesh));
    test_check(context, ov_trail_create(context, mesh, false, &trail));
    assert_int_equal(trail.vertices, 3);
    test_check(context, ov_facets_set(context, &facets, &trail, origin));
    const ov_sites sites = {.count = CASES, .xyz = points};
    test_check(context, ov_facets_distances(context, &meter, &facets, &sites, squared));
    for (size_t k = 0; k < CASES; ++k) {
        const double got = sqrt((double)squared[k]);
        if (!(fabs(got - cases[k].distance) <= 3e-7 * fmax(1.0, cases[k].distance)))
            fail_msg("case %zu: %.9g instead of %.9g", k, got, cases[k].distance);
    }
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    ov_trail_destroy(&trail);
    ovoid_mesh_destroy(&mesh);
}

/* Needles as meshes have them where a surface passes a lattice point, and points in their planes:
 * rounding moves where the nearest point is along a needle, but not off it. */
static void test_needles(void **state) {
    const size_t triangles = test_size(400, 20), count = triangles;
    double *const xyz = test_alloc(9 * triangles, sizeof *xyz);
    uint32_t *const corners = test_alloc(3 * triangles, sizeof *corners);
    float *const points = test_alloc(3 * count, sizeof *points);
    test_random random = {17};
    for (size_t t = 0; t < triangles; ++t) {
        const double high = pow(10.0, random_uniform(&random, -7.0, -2.0)),
                     s = random_uniform(&random, 0.1, 0.6), r = random_uniform(&random, 0.0, 1.0);
        double *const corner = xyz + 9 * t;
        for (size_t k = 0; k < 3; ++k) {
            const double along = random_uniform(&random, -0.3, 0.3),
                         aside = high * random_uniform(&random, -1.0, 1.0);
            corner[k] = (float)random_uniform(&random, -9.0, 9.0);
            corner[3 + k] = (float)(corner[k] + along);
            corner[6 + k] = (float)(corner[k] + r * along + aside);
        }
        for (size_t k = 0; k < 3; ++k) {
            const size_t first = 3 * ((t + k) % 3); /* any of its edges is the short one */
            points[3 * t + k] =
                (float)((1.0 - s - 0.3) * corner[k] + s * corner[3 + k] + 0.3 * corner[6 + k]);
            corners[3 * t + k] = (uint32_t)(3 * t + first / 3);
        }
    }
    expect_distances(*state, xyz, 3 * triangles, corners, triangles, points, count, 2e-6);
    free(xyz);
    free(corners);
    free(points);
}

/* Triangles of every form, points near and far, every number of triangles about a leaf's. */
static void test_random_triangles(void **state) {
    static const size_t sizes[] = {1, 2, 15, 16, 17, 100, 256, 257, 1000, 9000};
    test_random random = {7};
    const size_t every = 7; /* one triangle, and leaves of which the last has one */
    for (size_t n = 0; n < sizeof sizes / sizeof *sizes; n = test_next(*state, n, every)) {
        const size_t triangles = sizes[n], count = test_size(triangles > 1000 ? 100 : 500, 40);
        if (test_small() && triangles > 300)
            continue;
        double *const xyz = test_alloc(9 * triangles, sizeof *xyz);
        uint32_t *const corners = test_alloc(3 * triangles, sizeof *corners);
        float *const points = test_alloc(3 * count, sizeof *points);
        for (size_t t = 0; t < triangles; ++t) {
            const double size = exp(random_uniform(&random, -4.0, 1.0));
            double centre[3];
            for (size_t k = 0; k < 3; ++k)
                centre[k] = random_uniform(&random, -5.0, 5.0);
            for (size_t k = 0; k < 9; ++k)
                xyz[9 * t + k] = (float)(centre[k % 3] + random_uniform(&random, -size, size));
            for (size_t k = 0; k < 3; ++k) {
                corners[3 * t + k] = (uint32_t)(3 * t + k);
                if (t % 7 == 3) /* an edge */
                    xyz[9 * t + 6 + k] = xyz[9 * t + k];
                if (t % 7 == 4) /* a point */
                    xyz[9 * t + 6 + k] = xyz[9 * t + 3 + k] = xyz[9 * t + k];
                if (t % 7 == 5) /* a needle */
                    xyz[9 * t + 6 + k] = (float)(0.5 * (xyz[9 * t + k] + xyz[9 * t + 3 + k]));
            }
        }
        for (size_t k = 0; k < count; ++k) {
            const double far = k % 4 == 0 ? 100.0 : 6.0;
            for (size_t axis = 0; axis < 3; ++axis)
                points[3 * k + axis] = (float)random_uniform(&random, -far, far);
        }
        expect_distances(*state, xyz, 3 * triangles, corners, triangles, points, count, 2e-6);
        free(points);
        free(corners);
        free(xyz);
    }
}

static void test_spheres(void **state) {
    test_skip_simulated(*state); /* the same kernels as in test_twin() */
    const int level = test_small() ? 1 : 4;
    const double slack = test_small() ? 0.5 : 0.01; /* of triangles below their sphere */
    shape a = {0}, b = {0};
    shape_add_sphere(&a, level, 2.0, 100, -50, 30);
    shape_add_sphere(&b, level, 2.5, 100, -50, 30);
    ovoid_distances d = distances(*state, &a, &b, false); /* concentric */
    expect_near(d.hausdorff, 0.5, slack, "hausdorff");
    expect_near(d.mean, 0.5, slack, "mean");
    expect_near(d.rms, 0.5, slack, "rms");
    expect_near(d.forward, 0.5, slack, "forward");
    shape_destroy(&b);

    shape_add_sphere(&b, level, 2.0, 103, -46, 30); /* shifted by 5 along a diagonal */
    d = distances(*state, &a, &b, false);
    expect_near(d.hausdorff, 5.0, 2.0 * slack, "hausdorff of shifted spheres");
    expect_near(d.forward, d.backward, 2.0 * slack, "both ways");
    shape_destroy(&b);

    shape_add_sphere(&b, level, 2.0, 5000, -50, 30); /* far apart */
    d = distances(*state, &a, &b, false);
    expect_near(d.hausdorff, 4900.0, 2.0 * slack, "hausdorff of far spheres");
    shape_destroy(&b);

    d = distances(*state, &a, &a, false); /* with itself */
    expect_near(d.hausdorff, 0.0, 2e-6, "hausdorff of identical meshes");
    expect_near(d.mean, 0.0, 1e-6, "mean of identical meshes");
    shape_destroy(&a);
}

/* A small sphere touched by a big one: the two ways differ. */
static void test_ways(void **state) {
    test_skip_simulated(*state); /* the same */
    const int level = test_small() ? 1 : 4;
    const double slack = test_small() ? 0.5 : 0.02;
    shape a = {0}, b = {0};
    shape_add_sphere(&a, level, 1.0, 0, 0, 0);
    shape_add_sphere(&b, level, 1.0, 0, 0, 0);
    shape_add_sphere(&b, level, 1.0, 6, 0, 0);
    const ovoid_distances d = distances(*state, &a, &b, false);
    expect_near(d.forward, 0.0, 1e-6, "forward");
    expect_near(d.backward, 6.0, slack, "backward");
    expect_near(d.hausdorff, 6.0, slack, "hausdorff");
    const ovoid_distances e = distances(*state, &b, &a, false);
    expect_near(e.forward, d.backward, 1e-6, "forward, turned");
    expect_near(e.mean, d.mean, 1e-6, "mean, turned");
    shape_destroy(&a);
    shape_destroy(&b);
}

static void expect_same(ovoid_distances got, ovoid_distances wanted) {
    expect_near(got.hausdorff, wanted.hausdorff, 3e-6, "hausdorff");
    expect_near(got.forward, wanted.forward, 3e-6, "forward");
    expect_near(got.backward, wanted.backward, 3e-6, "backward");
    expect_near(got.mean, wanted.mean, 1e-6, "mean");
    expect_near(got.rms, wanted.rms, 1e-6, "rms");
}

/* Spheres with cavities of their own, a torus: against the reference, with and without cavities,
 * and the distance of each vertex. */
static void test_twin(void **state) {
    ovoid_context *const context = *state;
    const bool simulated = test_simulated(context);
    const int level = simulated ? 0 : test_small() ? 1 : 3;
    shape s[2] = {{0}, {0}};
    shape_add_ellipsoid(&s[0], level, (const double[3]){2, 3, 4}, (const double[3]){9, 8, 7},
                        false);
    shape_add_ellipsoid(&s[0], level, (const double[3]){1, 1, 1}, (const double[3]){9, 8, 7}, true);
    shape_add_ellipsoid(&s[1], level, (const double[3]){2, 3.5, 4}, (const double[3]){9, 8, 7.5},
                        false);
    shape_add_torus(&s[1], simulated ? 4 : test_size(16, 6), 5.0, 1.0);
    ovoid_mesh *a = shape_mesh(context, &s[0]), *b = shape_mesh(context, &s[1]);
    float *const from_a = test_alloc(a->vertices, sizeof *from_a);
    float *const again = test_alloc(a->vertices, sizeof *again);
    for (int outer = 0; outer <= 1; ++outer) {
        ovoid_distances got;
        a->along_curve = b->along_curve = false;
        for (size_t v = 0; v < a->vertices; ++v)
            from_a[v] = -1.0f;
        test_check(context, ovoid_mesh_distances(context, a, b, outer, &got, from_a));
        expect_same(got, ov_twin_distances(a, b, outer));
        for (size_t v = 0; v < a->vertices; ++v) {
            const bool left_out = outer && a->component_of[v] == 1;
            expect_near(from_a[v], left_out ? 0.0 : ov_twin_mesh_distance(a->xyz + 3 * v, b, outer),
                        3e-6, "distance of a vertex");
        }
        ovoid_distances same;
        a->along_curve = b->along_curve = true; /* taken as they are, which is no worse */
        test_check(context, ovoid_mesh_distances(context, a, b, outer, &same, again));
        expect_same(same, got);
        for (size_t v = 0; v < a->vertices; ++v)
            expect_near(again[v], from_a[v], 1e-6, "distance of a vertex");
    }
    free(again);
    free(from_a);
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    shape_destroy(&s[0]);
    shape_destroy(&s[1]);
}

static void vertex_distances(ovoid_context *context, const ovoid_mesh *from, const ovoid_mesh *to,
                             const double origin[3], double enough, float *distance) {
    ov_trail points = {0}, triangles = {0};
    ov_facets facets = {0};
    ov_meter meter = {.enough = enough};
    test_check(context, ov_trail_create(context, from, false, &points));
    test_check(context, ov_trail_create(context, to, false, &triangles));
    test_check(context, ov_facets_set(context, &facets, &triangles, origin));
    test_check(context, ov_trail_distances(context, &meter, &facets, &points, distance));
    ov_meter_destroy(&meter);
    ov_facets_destroy(&facets);
    ov_trail_destroy(&points);
    ov_trail_destroy(&triangles);
}

/* What is further than enough is as far as ever, and what is not is told as no more than that. */
static void expect_bounds(ovoid_context *context, const ovoid_mesh *from, const ovoid_mesh *to,
                          const double origin[3], const float *exact) {
    const double enough = 0.9;
    size_t nearer = 0, looser = 0;
    float *const got = test_alloc(from->vertices, sizeof *got);
    vertex_distances(context, from, to, origin, enough, got);
    for (size_t v = 0; v < from->vertices; ++v) {
        if (exact[v] > enough)
            expect_near(got[v], exact[v], 1e-6, "a distance beyond enough");
        else
            assert_true(got[v] >= exact[v] - 1e-6f && got[v] <= enough + 1e-6);
        nearer += exact[v] <= enough;
        looser += got[v] > exact[v] + 1e-4f;
    }
    assert_true(nearer > 0 && nearer < from->vertices && looser > 0);
    free(got);
}

/* Light meshes far from the origin of coordinates, and a vertex that nobody uses. */
static void test_vertices(void **state) {
    ovoid_context *const context = *state;
    const int level = test_small() ? 1 : 3;
    const double middle[3] = {90, -80, 70};
    shape s[2] = {{0}, {0}};
    ovoid_mesh *full[2], *light[2];
    shape_add_ellipsoid(&s[0], level, (const double[3]){2, 3, 4}, middle, false);
    shape_add_sphere(&s[1], level, 3.0, 91, -80, 70);
    for (int n = 0; n < 2; ++n) {
        const size_t vertices = s[n].vertices, triangles = s[n].triangles - 7 * (size_t)n;
        float *const offsets = test_alloc(3 * vertices, sizeof *offsets);
        float *const normals = test_alloc(3 * vertices, sizeof *normals);
        uint32_t *const corners = test_alloc(3 * triangles, sizeof *corners);
        for (size_t k = 0; k < 3 * vertices; ++k) {
            offsets[k] = (float)(s[n].xyz[k] - middle[k % 3]);
            s[n].xyz[k] = middle[k % 3] + (double)offsets[k];
        }
        memcpy(normals, s[n].normals, 3 * vertices * sizeof *normals);
        memcpy(corners, s[n].corners, 3 * triangles * sizeof *corners);
        s[n].triangles = triangles; /* of the last ones' vertices some have none left */
        full[n] = shape_mesh(context, &s[n]);
        test_check(context, ov_mesh_adopt_light(context, offsets, middle, normals, vertices,
                                                corners, triangles, &light[n]));
    }
    for (int n = 0; n < 2; ++n) {
        const ovoid_mesh *const from = light[n], *const to = light[1 - n];
        float *const got = test_alloc(from->vertices, sizeof *got);
        bool *const used = test_alloc(from->vertices, sizeof *used);
        got[0] = NAN;
        vertex_distances(context, from, to, middle, 0.0, got);
        for (size_t k = 0; k < 3 * from->triangles; ++k)
            used[from->corners[k]] = true;
        for (size_t v = 0; v < from->vertices; ++v)
            expect_near(got[v],
                        used[v] ? ov_twin_mesh_distance(full[n]->xyz + 3 * v, full[1 - n], false)
                                : 0.0,
                        3e-6, "distance of a vertex");
        expect_bounds(context, from, to, middle, got);
        free(used);
        free(got);
    }
    for (int n = 0; n < 2; ++n) {
        ovoid_mesh_destroy(&full[n]);
        ovoid_mesh_destroy(&light[n]);
        shape_destroy(&s[n]);
    }
}

/* Chunks that are far away are not looked at: balls in a row, in chunks of their own. */
static void test_far_chunks(void **state) {
    enum { BALLS = 8 };
    test_skip_simulated(*state); /* the host decides which chunks */
    ovoid_context *const context = *state;
    const int level = test_small() ? 2 : 3; /* 20 or 80 leaves each */
    shape s = {0};
    for (int n = 0; n < BALLS; ++n)
        shape_add_sphere(&s, level, 2.0, 10.0 * n, 0, 0);
    ovoid_mesh *mesh = shape_mesh(context, &s);
    mesh->along_curve = true;
    const double origin[3] = {40, 0, 0};
    ov_trail trail = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    ov_device *device;
    float *const squared = test_alloc(mesh->vertices, sizeof *squared);
    test_check(context, ov_device_get(context, &device));
    test_check(context, ov_trail_create(context, mesh, false, &trail));
    test_check(context, ov_facets_set(context, &facets, &trail, origin));
    facets.chunk = mesh->triangles / OV_LEAF / BALLS;
    meter.batch = mesh->vertices / BALLS;
    const ov_sites sites = {.count = mesh->vertices, .trail = &trail};
    const uint64_t before = device->counts[OVOID_COUNT_LAUNCHES];
    test_check(context, ov_facets_distances(context, &meter, &facets, &sites, squared));
    /* Of the coarse leaves and of each chunk one that packs them, and one for each ball. */
    assert_int_equal(device->counts[OVOID_COUNT_LAUNCHES] - before, 1 + BALLS + 2 * BALLS);
    for (size_t v = 0; v < mesh->vertices; ++v)
        expect_near(squared[v], 0.0, 1e-9, "distance of a vertex from itself");
    free(squared);
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    ov_trail_destroy(&trail);
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&s);
}

/* Chunks that may hold the nearest triangle are looked at, however close the call: sites off a
 * surface in many chunks, in batches so small that their boxes do not hide it. */
static void test_near_chunks(void **state) {
    test_skip_simulated(*state); /* the host decides which chunks */
    ovoid_context *const context = *state;
    const size_t count = test_size(400, 24);
    const double origin[3] = {0.0, 0.0, 0.0}, axes[3] = {3.0, 5.0, 8.0};
    test_random random = {31};
    shape s = {0};
    shape_add_ellipsoid(&s, 3, axes, origin, false); /* 80 leaves, 5 chunks */
    ovoid_mesh *mesh = shape_mesh(context, &s);
    ov_trail trail = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    float *const squared = test_alloc(count, sizeof *squared);
    for (size_t k = 0; k < count; ++k) /* from 1 to 6 angstrom outside, in order */
        for (size_t j = 0; j < 3; ++j) {
            const double angle = 2.0 * 3.14159265358979 * (double)k / (double)count;
            const double way = j == 2 ? sin(5.0 * angle) : j == 1 ? cos(angle) : sin(angle);
            xyz[3 * k + j] = (float)(way * (axes[j] + random_uniform(&random, 1.0, 6.0)));
        }
    test_check(context, ov_trail_create(context, mesh, false, &trail));
    test_check(context, ov_facets_set(context, &facets, &trail, origin));
    facets.chunk = OV_GROUP;
    for (size_t batch = 1; batch <= 4; batch += 3) {
        const ov_sites sites = {.count = count, .xyz = xyz};
        size_t off = 0;
        meter.batch = batch;
        test_check(context, ov_facets_distances(context, &meter, &facets, &sites, squared));
        for (size_t k = 0; k < count; ++k) {
            const double point[3] = {xyz[3 * k], xyz[3 * k + 1], xyz[3 * k + 2]};
            const double wanted = ov_twin_mesh_distance(point, mesh, false);
            expect_near(sqrt((double)squared[k]), wanted, 3e-6 * fmax(wanted, 1.0),
                        "distance of a site");
            off += wanted > 0.5;
        }
        assert_true(off > count / 2);
    }
    free(xyz);
    free(squared);
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    ov_trail_destroy(&trail);
    ovoid_mesh_destroy(&mesh);
    shape_destroy(&s);
}

static void test_repeats(void **state) {
    test_skip_simulated(*state); /* a simulator's order is its own */
    shape a = {0}, b = {0};
    shape_add_torus(&a, test_size(64, 6), 5.0, 1.0);
    shape_add_torus(&b, test_size(60, 5), 5.1, 1.1);
    const ovoid_distances first = distances(*state, &a, &b, false);
    for (int run = 0; run < 2; ++run) {
        const ovoid_distances again = distances(*state, &a, &b, false);
        assert_memory_equal(&first, &again, sizeof first);
    }
    shape_destroy(&a);
    shape_destroy(&b);
}

/* Surfaces without triangles, without outer components, beyond floats. */
static void test_refusals(void **state) {
    ovoid_context *const context = *state;
    shape ball = {0}, cavity = {0}, huge = {0}, none = {0};
    shape_add_sphere(&ball, 1, 1.0, 0, 0, 0);
    shape_add_ellipsoid(&cavity, 1, (const double[3]){1, 1, 1}, (const double[3]){0, 0, 0}, true);
    shape_add_sphere(&huge, 1, 1e30, 0, 0, 0);
    ovoid_mesh *a = shape_mesh(context, &ball), *b = shape_mesh(context, &cavity),
               *c = shape_mesh(context, &none), *d = shape_mesh(context, &huge);
    ovoid_distances result = {.hausdorff = 42.0};
    float from_a[42];
    from_a[0] = 42.0f;
    test_refused(context, ovoid_mesh_distances(context, a, c, false, &result, from_a),
                 OVOID_ERROR_EMPTY, "second mesh has no triangle");
    test_refused(context, ovoid_mesh_distances(context, c, a, false, &result, NULL),
                 OVOID_ERROR_EMPTY, "first mesh has no triangle");
    test_refused(context, ovoid_mesh_distances(context, b, a, true, &result, NULL),
                 OVOID_ERROR_EMPTY, "first mesh has no outer component");
    test_refused(context, ovoid_mesh_distances(context, a, d, false, &result, from_a),
                 OVOID_ERROR_NUMERIC, "more than a float holds");
    test_refused(context, ovoid_mesh_distances(context, a, NULL, false, &result, NULL),
                 OVOID_ERROR_ARGUMENT, "is NULL");
    expect_near(result.hausdorff, 42.0, 0.0, "an output of a failure");
    expect_near(from_a[0], 42.0, 0.0, "an output of a failure");
    test_check(context, ovoid_mesh_distances(context, b, a, false, &result, NULL));
    expect_near(result.hausdorff, 0.0, 1e-6, "walls in the same place");
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    ovoid_mesh_destroy(&c);
    ovoid_mesh_destroy(&d);
    shape_destroy(&ball);
    shape_destroy(&cavity);
    shape_destroy(&huge);
    shape_destroy(&none);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_triangle),
        cmocka_unit_test(test_needles),
        cmocka_unit_test(test_random_triangles),
        cmocka_unit_test(test_spheres),
        cmocka_unit_test(test_ways),
        cmocka_unit_test(test_twin),
        cmocka_unit_test(test_repeats),
        cmocka_unit_test(test_vertices),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_far_chunks),
        cmocka_unit_test(test_near_chunks),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
