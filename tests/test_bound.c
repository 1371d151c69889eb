/*
 * The bound of how far surfaces are apart, against dense sampling of their triangles in double
 * precision, where vertices tell it and where they do not.
 */
#include "measure/compare.h"
#include "selftest/twin_distance.h"
#include "shapes.h"
#include "support.h"

/* ---- dense sampling ----------------------------------------------------------------------- */

#define SPLITS 6 /* of an edge */

static double length_between(const double *a, const double *b) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static const double *corner_of(const ovoid_mesh *mesh, size_t triangle, size_t i) {
    return mesh->xyz + 3 * (size_t)mesh->corners[3 * triangle + i];
}

/* The ball about a triangle's centre that it lies in. */
typedef struct ball {
    double centre[3], radius;
} ball;

static ball ball_of(const ovoid_mesh *mesh, size_t triangle) {
    ball b = {.radius = 0.0};
    ov_mesh_centre(mesh, triangle, b.centre);
    for (size_t i = 0; i < 3; ++i)
        b.radius = fmax(b.radius, length_between(b.centre, corner_of(mesh, triangle, i)));
    return b;
}

/* The triangles, given by their balls, that are the nearest one of some point of a ball. */
static size_t list_near(const ball *about, const ball *balls, size_t triangles, size_t *near) {
    double least = INFINITY;
    size_t count = 0;
    for (size_t t = 0; t < triangles; ++t)
        least = fmin(least, length_between(about->centre, balls[t].centre));
    const double reach = 1.000001 * (least + 2.0 * about->radius);
    for (size_t t = 0; t < triangles; ++t)
        if (length_between(about->centre, balls[t].centre) <= reach + balls[t].radius)
            near[count++] = t;
    return count;
}

static double distance_of(const double *at, const ovoid_mesh *to, const ball *balls,
                          const size_t *near, size_t count) {
    double least = INFINITY;
    for (size_t n = 0; n < count; ++n)
        if (length_between(at, balls[near[n]].centre) - balls[near[n]].radius < least)
            least = fmin(least, ov_twin_triangle_distance(at, corner_of(to, near[n], 0),
                                                          corner_of(to, near[n], 1),
                                                          corner_of(to, near[n], 2)));
    return least;
}

/* The largest distance of points everywhere in a triangle from the triangles of a list. */
static double sample_triangle(const ovoid_mesh *from, size_t triangle, const ovoid_mesh *to,
                              const ball *balls, const size_t *near, size_t count) {
    double largest = 0.0;
    for (int i = 0; i <= SPLITS; ++i)
        for (int j = 0; i + j <= SPLITS; ++j) {
            double at[3];
            for (size_t k = 0; k < 3; ++k)
                at[k] = (i * corner_of(from, triangle, 0)[k] + j * corner_of(from, triangle, 1)[k] +
                         (SPLITS - i - j) * corner_of(from, triangle, 2)[k]) /
                        SPLITS;
            largest = fmax(largest, distance_of(at, to, balls, near, count));
        }
    return largest;
}

/* The largest distance of points everywhere in the outer triangles of a mesh, no two neighbours
 * farther apart than a share of an edge; *pitch: how much more there may be. */
static double sample(const ovoid_mesh *from, const ovoid_mesh *to, double *pitch) {
    size_t *const near = test_alloc(to->triangles, sizeof *near);
    ball *const balls = test_alloc(to->triangles, sizeof *balls);
    double largest = 0.0;
    *pitch = 0.0;
    for (size_t t = 0; t < to->triangles; ++t)
        balls[t] = ball_of(to, t);
    for (size_t t = 0; t < from->triangles; ++t) {
        const ball own = ball_of(from, t);
        if (!ov_mesh_is_exposed(from, from->corners[3 * t]))
            continue;
        const size_t count = list_near(&own, balls, to->triangles, near);
        if (distance_of(own.centre, to, balls, near, count) + own.radius <= largest)
            continue;
        largest = fmax(largest, sample_triangle(from, t, to, balls, near, count));
        *pitch = fmax(*pitch, 2.0 * own.radius / SPLITS);
    }
    free(balls);
    free(near);
    return largest;
}

/* ---- bounds ------------------------------------------------------------------------------- */

static double largest_of(const ovoid_mesh *mesh, const float *distance) {
    double largest = 0.0;
    for (size_t v = 0; v < mesh->vertices; ++v)
        if (ov_mesh_is_exposed(mesh, v))
            largest = fmax(largest, distance[v]);
    return largest;
}

/* *of_vertices: the largest distance of an outer vertex. */
static ov_bound bound_from(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                           float *from_a, float *from_b, double *of_vertices) {
    ov_bound bound = {0};
    ovoid_distances distances;
    test_check(context,
               ov_mesh_distances(context, a, b, false, &distances, from_a, from_b, &bound));
    *of_vertices = fmax(largest_of(a, from_a), largest_of(b, from_b));
    return bound;
}

static ov_bound bound_of(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                         double *of_vertices) {
    float *const from_a = test_alloc(a->vertices, sizeof *from_a);
    float *const from_b = test_alloc(b->vertices, sizeof *from_b);
    const ov_bound bound = bound_from(context, a, b, from_a, from_b, of_vertices);
    free(from_a);
    free(from_b);
    return bound;
}

static double slack(double least, bool loose) {
    return loose ? fmax(OV_BOUND_SLACK_LOOSE, OV_BOUND_SLACK_SHARE_LOOSE * least)
                 : fmax(OV_BOUND_SLACK, OV_BOUND_SLACK_SHARE * least);
}

/* ---- what is beyond a limit --------------------------------------------------------------- */

#define LIMIT_SLACK 2e-3

/* Points that were told to be beyond a limit of a mesh. */
typedef struct far_points {
    const ovoid_mesh *to;
    const ball *balls;
    size_t *all; /* its triangles */
    double limit;
    size_t count;
} far_points;

static ovoid_status check_far(const double at[3], double distance, void *user) {
    far_points *const far = user;
    const double found = distance_of(at, far->to, far->balls, far->all, far->to->triangles);
    expect_near(distance, found, 1e-5 + 1e-6 * found, "distance of a point beyond the limit");
    assert_true(distance > far->limit);
    ++far->count;
    return OVOID_OK;
}

/* Counts points beyond the limit from the outer triangles of one mesh to another one. */
static size_t count_far(ovoid_context *context, const ovoid_mesh *from, const ovoid_mesh *to,
                        const float *distance, double limit, bool *whole) {
    const double *const origin = corner_of(to, 0, 0);
    ov_trail first = {0}, second = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    ball *const balls = test_alloc(to->triangles, sizeof *balls);
    far_points far = {to, balls, test_alloc(to->triangles, sizeof *far.all), limit, 0};
    const ov_limits limits = {limit, LIMIT_SLACK, check_far, &far};
    for (size_t t = 0; t < to->triangles; ++t) {
        balls[t] = ball_of(to, t);
        far.all[t] = t;
    }
    test_check(context, ov_trail_create(context, from, false, &first));
    test_check(context, ov_trail_create(context, to, false, &second));
    test_check(context, ov_facets_set(context, &facets, &second, origin));
    test_check(context,
               ov_bound_exceed(context, &meter, &facets, &first, distance, &limits, whole));
    ov_meter_destroy(&meter);
    ov_facets_destroy(&facets);
    ov_trail_destroy(&first);
    ov_trail_destroy(&second);
    free(far.all);
    free(balls);
    return far.count;
}

/* sampled: the largest distance that was found in the triangles of `from`. */
static void expect_limits(ovoid_context *context, const ovoid_mesh *from, const ovoid_mesh *to,
                          float *distance, double sampled) {
    double largest = largest_of(from, distance);
    bool whole;
    for (size_t v = 0; v < from->vertices; ++v) /* the others do not count */
        distance[v] = ov_mesh_is_exposed(from, v) ? distance[v] : -1.0f;
    largest += 1e-5 + 1e-6 * largest;
    const size_t beyond = count_far(context, from, to, distance, largest, &whole);
    if (beyond == 0 && sampled > largest + LIMIT_SLACK)
        fail_msg("nothing is said to be beyond %.9g, and %.9g is", largest, sampled);
    assert_true(whole || beyond > 0); /* where there is much to tell, not all of it is */
    assert_int_equal(count_far(context, from, to, distance, 1.5 * largest + 2.0 * sampled, &whole),
                     0);
    assert_true(whole);
    for (size_t v = 0; v < from->vertices; ++v)
        distance[v] = -1.0f;
    assert_int_equal(count_far(context, from, to, distance, 0.0, &whole), 0);
    assert_true(whole);
}

/* What all bounds keep to; destroys the meshes. Returns how much the bound is above the vertices.
 */
static double expect_bound(ovoid_context *context, ovoid_mesh *a, ovoid_mesh *b, const char *what,
                           size_t number) {
    double of_vertices, pitch[2];
    float *const from_a = test_alloc(a->vertices, sizeof *from_a);
    float *const from_b = test_alloc(b->vertices, sizeof *from_b);
    const ov_bound got = bound_from(context, a, b, from_a, from_b, &of_vertices);
    const double forward = sample(a, b, &pitch[0]), backward = sample(b, a, &pitch[1]),
                 found = fmax(forward, backward), rounding = 1e-5 + 1e-6 * found;
    if (!(got.most >= found))
        fail_msg("%s %zu: a point is %.9g away, beyond the bound of %.9g", what, number, found,
                 got.most);
    if (!(got.least >= of_vertices - rounding &&
          got.least <= found + fmax(pitch[0], pitch[1]) + rounding))
        fail_msg("%s %zu: %.9g are known, %.9g of vertices, %.9g of points", what, number,
                 got.least, of_vertices, found);
    if (!(got.most <= got.least + slack(got.least, false) + rounding))
        fail_msg("%s %zu: from %.9g to %.9g", what, number, got.least, got.most);
    expect_limits(context, a, b, from_a, forward);
    expect_limits(context, b, a, from_b, backward);
    free(from_a);
    free(from_b);
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    return got.most / fmax(of_vertices, 1e-9);
}

/* ---- models ------------------------------------------------------------------------------- */

static ovoid_mesh *mesh_of(ovoid_context *context, ovoid_field *field, double spacing) {
    ovoid_mesh_options options;
    ovoid_mesh *mesh = NULL;
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = spacing;
    test_check(context, ovoid_field_mesh(context, field, &options, &mesh));
    ovoid_field_destroy(&field);
    return mesh;
}

static ovoid_mesh *mesh_atoms(ovoid_context *context, const double *xyzr, size_t atoms,
                              double spacing) {
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    test_check(context, ovoid_field_of_molecule(context, molecule, 0.5, 1.0, &field));
    ovoid_molecule_destroy(&molecule);
    return mesh_of(context, field, spacing);
}

static ovoid_mesh *mesh_ellipsoids(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                   size_t count, double spacing) {
    ovoid_model *model = NULL;
    ovoid_field *field = NULL;
    test_check(context, ovoid_model_create(context, ellipsoids, count, 0.5, 1.0, &model));
    test_check(context, ovoid_field_of_model(context, model, &field));
    ovoid_model_destroy(&model);
    return mesh_of(context, field, spacing);
}

/* Atoms, and ellipsoids that are them but for changes of every size. */
static void test_models(void **state) {
    enum { MOST = 3, PAIRS = 120 };
    test_random random = {41};
    double most = 0.0;
    if (test_small()) /* meshes take longer than what is tested */
        skip();
    for (size_t n = 0; n < PAIRS; ++n) {
        double xyzr[4 * MOST];
        ovoid_ellipsoid ellipsoids[MOST];
        const size_t atoms = 1 + n % MOST;
        const double change = exp(random_uniform(&random, -6.0, 0.0)),
                     spacing = random_uniform(&random, 1.0, 1.5);
        for (size_t i = 0; i < atoms; ++i) {
            for (size_t k = 0; k < 3; ++k)
                xyzr[4 * i + k] = random_uniform(&random, -1.3, 1.3);
            xyzr[4 * i + 3] = random_uniform(&random, 1.1, 1.9);
            ovoid_ellipsoid *const e = &ellipsoids[i];
            e->amplitude = exp(0.5 * xyzr[4 * i + 3] * xyzr[4 * i + 3] +
                               change * random_uniform(&random, -0.3, 0.8));
            for (size_t k = 0; k < 3; ++k) {
                e->decay[k] = 0.5 * exp(change * random_uniform(&random, -1.0, 1.0));
                e->centre[k] = xyzr[4 * i + k] + change * random_uniform(&random, -1.0, 1.0);
                e->angle[k] = random_uniform(&random, -3.0, 3.0);
            }
        }
        most = fmax(most,
                    expect_bound(*state, mesh_atoms(*state, xyzr, atoms, spacing),
                                 mesh_ellipsoids(*state, ellipsoids, atoms, spacing), "model", n));
    }
    print_message("bounds up to %.3g times the distance of vertices\n", most);
    assert_true(most < 20.0);
}

/* Bodies that cross one another, cavities among them. */
static void test_shapes(void **state) {
    test_skip_simulated(*state);
    test_random random = {43};
    for (size_t n = 0; n < test_size(60, 1); ++n) {
        shape s[2] = {{0}, {0}};
        for (size_t i = 0; i < 2; ++i) {
            double axes[3], centre[3];
            for (size_t k = 0; k < 3; ++k) {
                axes[k] = random_uniform(&random, 1.0, 4.0);
                centre[k] = 100.0 + random_uniform(&random, -1.0, 1.0);
            }
            shape_add_ellipsoid(&s[i], 1, axes, centre, false);
            for (size_t k = 0; k < 3; ++k)
                axes[k] *= 0.3;
            if (n % 3 == i)
                shape_add_ellipsoid(&s[i], 0, axes, centre, true);
        }
        expect_bound(*state, shape_mesh(*state, &s[0]), shape_mesh(*state, &s[1]), "shape", n);
        shape_destroy(&s[0]);
        shape_destroy(&s[1]);
    }
}

/* ---- what vertices do not see ------------------------------------------------------------- */

/* Without the triangles whose centres are so near to a point. */
static void make_hole(shape *s, const double about[3], double radius) {
    size_t kept = 0;
    for (size_t t = 0; t < s->triangles; ++t) {
        double centre[3];
        for (size_t k = 0; k < 3; ++k)
            centre[k] = (s->xyz[3 * (size_t)s->corners[3 * t] + k] +
                         s->xyz[3 * (size_t)s->corners[3 * t + 1] + k] +
                         s->xyz[3 * (size_t)s->corners[3 * t + 2] + k]) /
                        3.0;
        if (length_between(centre, about) > radius)
            memmove(s->corners + 3 * kept++, s->corners + 3 * t, 3 * sizeof *s->corners);
    }
    s->triangles = kept;
}

/* A square of two triangles over one with a hole: all vertices of either lie on the other. */
static void test_hole(void **state) {
    test_skip_simulated(*state);
    ovoid_context *const context = *state;
    const double about[3] = {4.0, 2.5, 5.0}, radius = 3.0;
    shape whole = {0}, holed = {0};
    shape_add_square(&whole, 1, 10.0, 5.0);
    shape_add_square(&holed, (size_t)test_size(40, 8), 10.0, 5.0);
    make_hole(&holed, about, radius);
    ovoid_mesh *a = shape_mesh(context, &whole), *b = shape_mesh(context, &holed);
    double of_vertices;
    a->component[0].exposed = b->component[0].exposed = true; /* which open ones are not */
    const ov_bound got = bound_of(context, a, b, &of_vertices);
    print_message("by vertices %.3g, at least %.6g, at most %.6g\n", of_vertices, got.least,
                  got.most);
    expect_near(of_vertices, 0.0, 1e-5, "distance of vertices");
    expect_near(got.least, radius, test_small() ? 1.5 : 0.5, "the hole");
    expect_bound(context, a, b, "hole", 0);
    shape_destroy(&whole);
    shape_destroy(&holed);
}

/* A tent over a square, both of few triangles: farthest along its ridge, or where that ends. */
static void test_ridge(void **state) {
    static const double tent[] = {-6, -4, 5, 6, -4, 5, 6, 4, 5, -6, 4, 5, -5, 0, 7.5, 4, 0, 8};
    static const uint32_t corners[] = {0, 1, 5, 0, 5, 4, 1, 2, 5, 2, 3, 4, 2, 4, 5, 3, 0, 4};
    ovoid_context *const context = *state;
    ovoid_mesh *a = NULL;
    shape square = {0};
    shape_add_square(&square, 1, 6.0, 5.0);
    test_check(context, ovoid_mesh_create(context, tent, NULL, 6, corners, 6, &a));
    ovoid_mesh *const b = shape_mesh(context, &square);
    a->component[0].exposed = b->component[0].exposed = true;
    expect_bound(context, a, b, "ridge", 0);
    shape_destroy(&square);
}

/* One of two balls has no counterpart: the other surface is 30 away. */
static void test_no_counterpart(void **state) {
    const int level = test_small() ? 0 : 2;
    shape a = {0}, b = {0};
    shape_add_sphere(&a, level, 2.0, 0, 0, 0);
    shape_add_sphere(&a, level, 1.0, 33, 0, 0);
    shape_add_sphere(&b, level, 2.0, 0, 0, 0);
    expect_bound(*state, shape_mesh(*state, &a), shape_mesh(*state, &b), "lonely", 0);
    shape_destroy(&a);
    shape_destroy(&b);
}

/* ---- limits ------------------------------------------------------------------------------- */

static void test_identical(void **state) {
    ovoid_context *const context = *state;
    shape s = {0};
    shape_add_torus(&s, test_size(16, 4), 5.0, 1.0);
    ovoid_mesh *a = shape_mesh(context, &s), *b = shape_mesh(context, &s);
    double of_vertices;
    const ov_bound got = bound_of(context, a, b, &of_vertices);
    expect_near(got.most, 0.0, 2e-5, "bound of identical surfaces");
    expect_near(got.least, 0.0, 1e-6, "distance of identical surfaces");
    assert_int_equal(got.split, 0);
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    shape_destroy(&s);
}

/* Edges, points and needles among triangles of every size, some far from the origin. */
static ovoid_mesh *soup(ovoid_context *context, test_random *random, size_t triangles,
                        double offset) {
    double *const xyz = test_alloc(9 * triangles, sizeof *xyz);
    uint32_t *const corners = test_alloc(3 * triangles, sizeof *corners);
    ovoid_mesh *mesh = NULL;
    for (size_t t = 0; t < triangles; ++t) {
        const double size = exp(random_uniform(random, -4.0, 1.0));
        for (size_t k = 0; k < 3; ++k) {
            const double centre = offset + random_uniform(random, -5.0, 5.0);
            double *const at = xyz + 9 * t + k;
            for (size_t i = 0; i < 3; ++i)
                at[3 * i] = centre + random_uniform(random, -size, size);
            if (t % 5 == 2 || t % 5 == 3)
                at[6] = at[3];
            if (t % 5 == 3)
                at[3] = at[0] = at[6];
            if (t % 5 == 4)
                at[6] = 0.5 * (at[0] + at[3]);
        }
        for (size_t i = 0; i < 3; ++i)
            corners[3 * t + i] = (uint32_t)(3 * t + i);
    }
    test_check(context,
               ovoid_mesh_create(context, xyz, NULL, 3 * triangles, corners, triangles, &mesh));
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].exposed = c % 4 != 0;
    free(xyz);
    free(corners);
    return mesh;
}

static void test_soup(void **state) {
    test_random random = {47};
    for (size_t n = 0; n < test_size(60, 2); ++n) {
        const double offset = n % 2 ? 3000.0 : 0.0;
        const size_t first = 1 + n % 40, second = 1 + (7 * n) % 50;
        ovoid_mesh *const a = soup(*state, &random, first, offset);
        expect_bound(*state, a, soup(*state, &random, second, offset), "soup", n);
    }
}

/* Chunks, batches and meshes that do not follow a curve make no difference. */
static void test_chunks(void **state) {
    test_skip_simulated(*state); /* the host divides, and so few triangles into one chunk */
    ovoid_context *const context = *state;
    const int level = test_small() ? 1 : 3;
    const double origin[3] = {0.5, 0.0, 0.0};
    shape s[2] = {{0}, {0}};
    shape_add_sphere(&s[0], level, 3.0, 0, 0, 0);
    shape_add_ellipsoid(&s[1], level, (const double[3]){3, 2.5, 3.5}, (const double[3]){1, 0, 0},
                        false);
    ovoid_mesh *a = shape_mesh(context, &s[0]), *b = shape_mesh(context, &s[1]);
    ov_bound first = {0};
    for (size_t n = 0; n < test_size(3, 2); ++n) {
        ov_trail trail[2] = {{0}, {0}};
        ov_facets facets = {.chunk = n == 0 ? 0 : 16 + n};
        ov_meter meter = {.batch = n == 0 ? 0 : 100 * n};
        ov_bound got = {0};
        test_check(context, ov_trail_create(context, a, false, &trail[0]));
        test_check(context, ov_trail_create(context, b, false, &trail[1]));
        test_check(context, ov_facets_set(context, &facets, &trail[1], origin));
        float *const squared = test_alloc(a->vertices, sizeof *squared);
        test_check(context, ov_trail_distances(context, &meter, &facets, &trail[0], squared));
        for (size_t v = 0; v < a->vertices; ++v)
            squared[v] *= squared[v];
        test_check(context, ov_bound_add(context, &meter, &facets, &trail[0], squared, &got));
        if (n == 0)
            first = got;
        expect_near(got.least, first.least, 0.0, "least");
        expect_near(got.most, first.most, 0.0, "most");
        assert_int_equal(got.triangles, first.triangles);
        assert_true(got.split > 0);
        free(squared);
        ov_facets_destroy(&facets);
        ov_meter_destroy(&meter);
        ov_trail_destroy(&trail[0]);
        ov_trail_destroy(&trail[1]);
    }
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
    shape_destroy(&s[0]);
    shape_destroy(&s[1]);
}

/* Parallel squares of other triangles: all of either is as far away, so that all triangles have to
 * be split, the more often the nearer they are. Where that is too often the bound is looser, and
 * holds. */
static void test_parallel(void **state) {
    if (test_small())
        skip();
    static const double gaps[3] = {12.0, 0.1, 0.02};
    ovoid_context *const context = *state;
    for (size_t n = 0; n < 3; ++n) {
        shape s[2] = {{0}, {0}};
        shape_add_square(&s[0], 64, 32.0, 0.0);
        shape_add_square(&s[1], 50, 32.0, gaps[n]);
        ovoid_mesh *a = shape_mesh(context, &s[0]), *b = shape_mesh(context, &s[1]);
        double of_vertices;
        a->component[0].exposed = b->component[0].exposed = true;
        const ov_bound got = bound_of(context, a, b, &of_vertices);
        print_message("%g apart: from %.6g to %.6g, %zu triangles\n", gaps[n], got.least, got.most,
                      got.triangles);
        expect_near(got.least, gaps[n], 1e-4, "what is known");
        assert_true(got.most >= gaps[n]);
        if (n < 2)
            assert_true(got.most <= got.least + slack(got.least, n > 0) + 1e-4);
        assert_true((got.most > got.least + slack(got.least, n > 1)) == (n > 0));
        assert_true(got.triangles < (size_t)1 << 20);
        ovoid_mesh_destroy(&a);
        ovoid_mesh_destroy(&b);
        shape_destroy(&s[0]);
        shape_destroy(&s[1]);
    }
}

/* Few triangles of an ordinary model's surface are split. */
static void test_work(void **state) {
    if (test_small())
        skip();
    enum { ATOMS = 40 };
    ovoid_context *const context = *state;
    test_random random = {53};
    double xyzr[4 * ATOMS];
    for (size_t i = 0; i < ATOMS; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -5.0, 5.0);
        xyzr[4 * i + 3] = 1.7;
    }
    ovoid_mesh *a = mesh_atoms(context, xyzr, ATOMS, 0.5);
    for (size_t i = 0; i < 4 * ATOMS; ++i)
        xyzr[i] += random_uniform(&random, -0.2, 0.2);
    ovoid_mesh *b = mesh_atoms(context, xyzr, ATOMS, 0.5);
    double of_vertices;
    const ov_bound got = bound_of(context, a, b, &of_vertices);
    print_message("of %zu and %zu triangles %zu looked at, %zu split\n", a->triangles, b->triangles,
                  got.triangles, got.split);
    assert_true(got.triangles < a->triangles + b->triangles);
    assert_true(50 * got.split < a->triangles + b->triangles);
    ovoid_mesh_destroy(&a);
    ovoid_mesh_destroy(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_models),    cmocka_unit_test(test_shapes),
        cmocka_unit_test(test_hole),      cmocka_unit_test(test_ridge),
        cmocka_unit_test(test_identical), cmocka_unit_test(test_no_counterpart),
        cmocka_unit_test(test_soup),      cmocka_unit_test(test_chunks),
        cmocka_unit_test(test_parallel),  cmocka_unit_test(test_work),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
