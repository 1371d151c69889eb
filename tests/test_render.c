/* Pictures: rays against closed forms and the reference, light, whole pictures, PNG files. */
#include "support.h"

#include "model/ellipsoid.h"
#include "picture/camera.h"
#include "picture/colour_bar.h"
#include "picture/image.h"
#include "picture/label.h"
#include "picture/palette.h"
#include "picture/rays.h"
#include "picture/render.h"
#include "selftest/twin_render.h"

#include <png.h>
#include <unistd.h>

/* The unit vector that a normal of ov_hits stands for. */
static void unpack_normal(int32_t packed, double normal[3]) {
    normal[0] = (int16_t)(uint16_t)((uint32_t)packed & 0xffffu) / 32767.0;
    normal[1] = (int16_t)(uint16_t)((uint32_t)packed >> 16) / 32767.0;
    normal[2] = sqrt(fmax(1.0 - normal[0] * normal[0] - normal[1] * normal[1], 0.0));
}

#define CUTOFF OV_PICTURE_CUTOFF

/* ---- rays on the device --------------------------------------------------------------------- */

/* What rays meet, on the host. */
typedef struct view {
    ov_rays rays;
    size_t count;
    float *depth, *extra;
    int32_t *normal;
} view;

static ov_rays square_of_rays(uint32_t columns, uint32_t rows, double side) {
    const double spacing = side / (columns > rows ? columns : rows);
    return (ov_rays){columns, rows, -0.5 * (columns - 1) * spacing, 0.5 * (rows - 1) * spacing,
                     spacing};
}

static void read_view(ovoid_context *context, const ov_hits *hits, view *v) {
    v->count = ov_rays_packs(&v->rays) * OV_PACK;
    v->depth = read_floats(context, &hits->depth, v->count);
    v->extra = read_floats(context, &hits->extra, v->count);
    v->normal = (int32_t *)read_indices(context, &hits->normal, v->count);
}

static void destroy_view(view *v) {
    free(v->depth);
    free(v->extra);
    free(v->normal);
}

static view trace(ovoid_context *context, const ov_quadric *quadrics, size_t count, double level,
                  ov_rays rays) {
    view v = {.rays = rays};
    ov_boxes boxes = {0};
    ov_hits hits = {0};
    ov_tracer tracer = {0};
    test_check(context, ov_boxes_create(context, quadrics, count, CUTOFF, &rays, &boxes));
    test_check(context, ov_trace(context, &tracer, &rays, &boxes, level, &hits));
    read_view(context, &hits, &v);
    ov_hits_destroy(&hits);
    ov_boxes_destroy(&boxes);
    ov_tracer_destroy(&tracer);
    return v;
}

static double ray_x(const ov_rays *rays, uint32_t column) {
    return rays->left + column * rays->spacing;
}

static double ray_y(const ov_rays *rays, uint32_t row) {
    return rays->top - row * rays->spacing;
}

static ov_quadric atom(double x, double y, double z, double radius, double decay) {
    const double xyzr[4] = {x, y, z, radius};
    ov_quadric quadric;
    ov_quadric_of_atom(xyzr, decay, &quadric);
    return quadric;
}

/* One atom is a sphere of radius sqrt(r^2 - ln c / d). */
static void sphere_has_its_shape(void **state) {
    const double r = 1.6, d = 0.7, c = 0.8, radius = sqrt(r * r - log(c) / d);
    const double centre[3] = {0.3, -0.2, 5.0};
    const uint32_t side = (uint32_t)test_size(200, 12);
    const ov_quadric one = atom(centre[0], centre[1], centre[2], r, d);
    view v = trace(*state, &one, 1, c, square_of_rays(side, side, 5.0));
    double worst = 0.0, worst_normal = 0.0;
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const size_t at = ov_rays_index(&v.rays, column, row);
            const double x = ray_x(&v.rays, column) - centre[0];
            const double y = ray_y(&v.rays, row) - centre[1], away = hypot(x, y);
            if (fabs(away - radius) < 1e-5)
                continue; /* who knows */
            assert_int_equal(v.depth[at] > OV_NOWHERE, away < radius);
            if (away > radius)
                continue;
            const double z = sqrt(radius * radius - away * away);
            double normal[3];
            unpack_normal(v.normal[at], normal);
            /* across the surface: along the ray nothing bounds the error at the rim */
            worst = fmax(worst, fabs(v.depth[at] - centre[2] - z) * z / radius);
            worst_normal = fmax(worst_normal, fabs(normal[0] - x / radius));
            worst_normal = fmax(worst_normal, fabs(normal[1] - y / radius));
            expect_near(v.extra[at], 2.0 * d * c * radius, 1e-4, "the gradient's length");
        }
    print_message("depth off by at most %.2g, normals by %.2g\n", worst, worst_normal);
    assert_true(worst < 1e-5);
    assert_true(worst_normal < 1e-4);
    destroy_view(&v);
}

/* The middle of the picture sees the nearest point. */
static void nearest_sphere_is_seen(void **state) {
    const ov_quadric three[] = {atom(0.0, 0.0, -9.0, 1.5, 0.5), atom(0.0, 0.0, 30.0, 1.5, 0.5),
                                atom(0.0, 0.0, 2.0, 1.5, 0.5)};
    view v = trace(*state, three, 3, 1.0, square_of_rays(3, 3, 0.3));
    expect_near(v.depth[ov_rays_index(&v.rays, 1, 1)], 31.5, 1e-4, "the depth in the middle");
    destroy_view(&v);
}

static void see_model(test_random *random, model_kind kind, double half, ov_quadric *quadrics,
                      size_t count) {
    ovoid_ellipsoid *const ellipsoids = test_alloc(count, sizeof *ellipsoids);
    random_ellipsoids(random, kind, half, ellipsoids, count);
    for (size_t i = 0; i < count; ++i)
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadrics[i]);
    free(ellipsoids);
}

/* A hit lies between those of a slightly higher and of a slightly lower level, which also holds
 * where rays only just touch. */
static void rays_are_the_references(void **state) {
    static const model_kind kinds[] = {MODEL_RANDOM, MODEL_SPHERE, MODEL_GIMBAL, MODEL_PANCAKE};
    const uint32_t side = (uint32_t)test_size(20, 4);
    const size_t terms = 12;
    const double c = 1.0, depth = 60.0;
    const size_t tried = test_simulated(*state) ? 1 : sizeof kinds / sizeof kinds[0];
    for (size_t k = 0; k < tried; ++k) {
        test_random random = {k + 5};
        ov_quadric quadrics[12];
        size_t met = 0;
        see_model(&random, kinds[k], 4.0, quadrics, terms);
        view v = trace(*state, quadrics, terms, c, square_of_rays(side, side, 12.0));
        for (uint32_t row = 0; row < side; ++row)
            for (uint32_t column = 0; column < side; ++column) {
                const size_t at = ov_rays_index(&v.rays, column, row);
                const double x = ray_x(&v.rays, column), y = ray_y(&v.rays, row);
                const double later = ov_twin_hit(quadrics, terms, 1.0003 * c, x, y, depth, -depth);
                const double sooner = ov_twin_hit(quadrics, terms, 0.9997 * c, x, y, depth, -depth);
                const double z = v.depth[at] > OV_NOWHERE ? (double)v.depth[at] : -INFINITY;
                if (!(z >= later - 1e-4 && z <= sooner + 1e-4))
                    fail_msg("%s: ray (%g, %g) ends at %g, not within %g .. %g",
                             model_kind_name(kinds[k]), x, y, z, later, sooner);
                if (isinf(z))
                    continue;
                ++met;
                const double point[3] = {x, y, z};
                double wanted[3], got[3];
                const double slope = ov_twin_normal(quadrics, terms, point, wanted);
                unpack_normal(v.normal[at], got);
                expect_near(v.extra[at], slope, 1e-3 * slope + 1e-4, "the gradient's length");
                for (int axis = 0; axis < 2; ++axis)
                    expect_near(got[axis], wanted[axis], 1e-3, "a normal");
            }
        assert_true(met > v.count / 20);
        destroy_view(&v);
    }
}

/* A sheet so thin that it lies between two steps of a ray. */
static void thin_sheets_are_seen(void **state) {
    const double c = 1.0;
    const int step = test_simulated(*state) ? 6 : 1;
    for (int k = 0; k < 12; k += step) {
        const double amplitude = 1.0 + 0.003 * (k + 1), decay = 3.0, z = 0.037 * k;
        const double half = sqrt(log(amplitude / c) / decay);
        const ov_quadric sheet = {amplitude, {0.0, 0.0, z}, {1e-3, 0.0, 0.0, 1e-3, 0.0, decay}};
        view v = trace(*state, &sheet, 1, c, square_of_rays(4, 4, 0.01));
        expect_near(v.depth[ov_rays_index(&v.rays, 1, 1)], z + half, 1e-4, "the sheet's depth");
        destroy_view(&v);
    }
}

/* Rays so far apart that tiles have fewer of them, and steps follow the rays and not the narrowest
 * term: balls on a lattice, each where it would be alone. */
static void rays_far_apart_see_the_same(void **state) {
    enum { BALLS = 64 };
    const double r = 15.0, d = 0.05;
    const uint32_t side = 100;
    ov_quadric balls[BALLS + 1];
    size_t met = 0;
    if (test_small())
        skip();
    for (int n = 0; n < BALLS; ++n)
        balls[n] =
            atom(60.0 * (n % 8) - 210.0, 60.0 * (double)(n / 8) - 210.0, 7.0 * (n % 11), r, d);
    balls[BALLS] = (ov_quadric){1e-3, {0.0, 0.0, 0.0}, {0.1, 0.0, 0.0, 0.1, 0.0, 30.0}};
    view v = trace(*state, balls, BALLS + 1, 1.0, square_of_rays(side, side, 480.0));
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const size_t at = ov_rays_index(&v.rays, column, row);
            double depth = -INFINITY;
            for (int n = 0; n < BALLS; ++n) {
                const double away = hypot(ray_x(&v.rays, column) - balls[n].centre[0],
                                          ray_y(&v.rays, row) - balls[n].centre[1]);
                if (away < r)
                    depth = balls[n].centre[2] + sqrt(r * r - away * away);
            }
            assert_int_equal(v.depth[at] > OV_NOWHERE, depth > -INFINITY);
            if (depth > -INFINITY)
                expect_near(v.depth[at], depth, 2e-3, "a depth");
            met += depth > -INFINITY;
        }
    assert_in_range(met, 1500, 2500);
    destroy_view(&v);
}

/* Boxes of tiles and slabs that are many, and far apart. */
static void deep_scenes_work(void **state) {
    const ov_quadric two[] = {atom(-2.0, 0.0, 20000.0, 1.5, 0.5),
                              atom(2.0, 0.0, -20000.0, 1.5, 0.5)};
    if (test_small())
        skip();
    view v = trace(*state, two, 2, 1.0, square_of_rays(160, 160, 8.0));
    size_t met = 0, near = 0;
    for (uint32_t row = 0; row < 160; ++row)
        for (uint32_t column = 0; column < 160; ++column) {
            const float z = v.depth[ov_rays_index(&v.rays, column, row)];
            met += z > OV_NOWHERE;
            near += z > 0.0f;
        }
    const double disc = 3.14159265 * 1.5 * 1.5 / (0.05 * 0.05);
    expect_near((double)near, disc, 40.0, "rays on the near sphere");
    expect_near((double)(met - near), disc, 40.0, "rays on the far sphere");
    destroy_view(&v);
    const ov_quadric abyss[] = {atom(0.0, 0.0, 2e6, 1.5, 0.5), atom(0.0, 0.0, -2e6, 1.5, 0.5)};
    const ov_rays rays = square_of_rays(4, 4, 1.0);
    ov_boxes boxes;
    test_refused(*state, ov_boxes_create(*state, abyss, 2, CUTOFF, &rays, &boxes),
                 OVOID_ERROR_LIMIT, "too deep");
}

static void ellipsoids_are_seen_singly(void **state) {
    const uint32_t side = (uint32_t)test_size(60, 8);
    const size_t terms = 25;
    const double c = 1.2;
    ov_quadric quadrics[25];
    test_random random = {9};
    see_model(&random, MODEL_RANDOM, 5.0, quadrics, terms);
    view v = {.rays = square_of_rays(side, side, 14.0)};
    ov_boxes boxes;
    ov_hits hits = {0};
    ov_tracer tracer = {0};
    test_check(*state, ov_boxes_create(*state, quadrics, terms, c, &v.rays, &boxes));
    test_check(*state, ov_trace_ellipsoids(*state, &tracer, &v.rays, &boxes, &hits));
    read_view(*state, &hits, &v);
    size_t met = 0;
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const size_t at = ov_rays_index(&v.rays, column, row);
            size_t which = 0;
            const double x = ray_x(&v.rays, column), y = ray_y(&v.rays, row);
            const double z = ov_twin_hit_single(quadrics, terms, c, x, y, &which);
            assert_int_equal(v.depth[at] > OV_NOWHERE, z > -INFINITY);
            if (!(z > -INFINITY))
                continue;
            ++met;
            int32_t index;
            double normal[3], wanted[3];
            const double point[3] = {x, y, z};
            memcpy(&index, &v.extra[at], sizeof index);
            assert_int_equal(index, which);
            ov_twin_normal(&quadrics[which], 1, point, wanted);
            unpack_normal(v.normal[at], normal);
            expect_near(fabs(v.depth[at] - z) * wanted[2], 0.0, 1e-4, "an ellipsoid's depth");
            for (int axis = 0; axis < 2; ++axis)
                expect_near(normal[axis], wanted[axis], 2e-3, "an ellipsoid's normal");
        }
    assert_true(met > v.count / 4);
    destroy_view(&v);
    ov_hits_destroy(&hits);
    ov_boxes_destroy(&boxes);
    ov_tracer_destroy(&tracer);
}

static void comparison_is_the_formula(void **state) {
    const uint32_t side = (uint32_t)test_size(60, 8);
    const size_t terms = 10;
    const double c = 1.0;
    ov_quadric own[10], other[10];
    test_random random = {10};
    see_model(&random, MODEL_RANDOM, 4.0, own, terms);
    memcpy(other, own, sizeof other);
    for (size_t i = 0; i < terms; ++i)
        other[i].amplitude *= random_uniform(&random, 0.8, 1.25);
    view v = {.rays = square_of_rays(side, side, 11.0)};
    ov_boxes boxes, compared;
    ov_hits hits = {0};
    ov_tracer tracer = {0};
    test_check(*state, ov_boxes_create(*state, own, terms, CUTOFF, &v.rays, &boxes));
    test_check(*state, ov_boxes_create(*state, other, terms, CUTOFF, &v.rays, &compared));
    test_check(*state, ov_trace(*state, &tracer, &v.rays, &boxes, c, &hits));
    test_check(*state, ov_compare(*state, &tracer, &v.rays, &compared, c, &hits));
    read_view(*state, &hits, &v);
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const size_t at = ov_rays_index(&v.rays, column, row);
            if (v.depth[at] <= OV_NOWHERE) {
                assert_true(v.extra[at] == 0.0f);
                continue;
            }
            const double point[3] = {ray_x(&v.rays, column), ray_y(&v.rays, row),
                                     (double)v.depth[at]};
            double normal[3];
            const double slope = ov_twin_normal(own, terms, point, normal);
            const double wanted = (ov_twin_sum_at(other, terms, point) - c) / slope;
            expect_near(v.extra[at], wanted, 2e-3 * fabs(wanted) + 2e-4, "a distance");
        }
    destroy_view(&v);
    ov_hits_destroy(&hits);
    ov_boxes_destroy(&boxes);
    ov_boxes_destroy(&compared);
    ov_tracer_destroy(&tracer);
}

/* On a real protein: the public field has its isovalue at the points that rays find. */
static void protein_is_hit_where_phi_is_c(void **state) {
    char path[1024];
    const char *const folder = getenv("OVOID_MOLECULES");
    snprintf(path, sizeof path, "%s/1MAG.pqr", folder ? folder : OVOID_MOLECULES_DEFAULT);
    if (test_small() || access(path, R_OK) != 0) {
        print_message("skipped: %s\n", path);
        skip();
    }
    ovoid_molecule *molecule = NULL;
    ovoid_picture_options options;
    test_check(*state, ovoid_molecule_read(*state, path, OVOID_MOLECULE_AUTO, &molecule));
    ovoid_picture_options_init(&options, sizeof options);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ov_quadric *const world = test_alloc(atoms, sizeof *world), *const seen =
                                                                    test_alloc(atoms, sizeof *seen);
    ov_camera camera;
    for (size_t i = 0; i < atoms; ++i)
        ov_quadric_of_atom(ovoid_molecule_xyzr(molecule) + 4 * i, 0.5, &world[i]);
    ov_camera_aim(&camera, world, atoms, &options);
    for (size_t i = 0; i < atoms; ++i)
        seen[i] = ov_camera_see(&camera, &world[i]);
    const ov_extent extent = ov_extent_of(seen, atoms, 0.4);
    ov_camera_frame(&camera, &extent, 200, 150, &options);
    for (size_t i = 0; i < atoms; ++i)
        seen[i] = ov_camera_see(&camera, &world[i]);
    const ov_rays rays = {200, 150, -99.5 * camera.pixel, 74.5 * camera.pixel, camera.pixel};
    view v = trace(*state, seen, atoms, 1.0, rays);
    double *const points = test_alloc(3 * 30000, sizeof *points);
    double *const value = test_alloc(30000, sizeof *value);
    size_t met = 0;
    for (uint32_t row = 0; row < 150; ++row)
        for (uint32_t column = 0; column < 200; ++column) {
            const double z = v.depth[ov_rays_index(&rays, column, row)];
            const double p[3] = {ray_x(&rays, column), ray_y(&rays, row), z};
            if (z <= OV_NOWHERE)
                continue;
            assert_true(column > 2 && column < 197 && row > 2 && row < 147); /* all is in sight */
            for (int k = 0; k < 3; ++k)
                points[3 * met + (size_t)k] = camera.centre[k] + p[0] * camera.axis[0][k] +
                                              p[1] * camera.axis[1][k] + p[2] * camera.axis[2][k];
            ++met;
        }
    assert_true(met > 12000);
    test_check(*state, once_molecule_field(*state, molecule, 0.5, points, met, value, NULL));
    double worst = 0.0;
    for (size_t k = 0; k < met; ++k)
        worst = fmax(worst, fabs(value[k] - 1.0));
    print_message("%zu rays, phi off by at most %.2g\n", met, worst);
    assert_true(worst < 5e-4);
    free(points);
    free(value);
    free(world);
    free(seen);
    destroy_view(&v);
    ovoid_molecule_destroy(&molecule);
}

/* ---- the camera ----------------------------------------------------------------------------- */

static double product(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void camera_looks_along_principal_axes(void **state) {
    (void)state;
    const double turned[3] = {0.4, -0.7, 1.1};
    double r[3][3];
    ov_quadric atoms[200];
    test_random random = {11};
    ovoid_picture_options options;
    ov_camera camera;
    ov_rotation(turned, r);
    for (size_t i = 0; i < 200; ++i) {
        const double p[3] = {random_uniform(&random, -20, 20), random_uniform(&random, -9, 9),
                             random_uniform(&random, -3, 3)};
        double q[3];
        for (int k = 0; k < 3; ++k)
            q[k] = 50.0 + p[0] * r[0][k] + p[1] * r[1][k] + p[2] * r[2][k];
        atoms[i] = atom(q[0], q[1], q[2], 1.5, 0.5);
    }
    ovoid_picture_options_init(&options, sizeof options);
    ov_camera_aim(&camera, atoms, 200, &options);
    assert_true(fabs(product(camera.axis[0], r[0])) > 0.99);
    assert_true(fabs(product(camera.axis[1], r[1])) > 0.99);
    assert_true(fabs(product(camera.axis[2], r[2])) > 0.99);
    options.height = 2 * options.width; /* upright */
    ov_camera_aim(&camera, atoms, 200, &options);
    assert_true(fabs(product(camera.axis[1], r[0])) > 0.99);
    for (int k = 0; k < 3; ++k)
        options.direction[k] = 7.0 * r[1][k];
    ov_camera_aim(&camera, atoms, 200, &options);
    assert_true(product(camera.axis[2], r[1]) > 0.999999);
    /* right-handed and orthonormal, whatever is asked */
    options.rotation[0] = 0.3;
    options.rotation[1] = -2.0;
    options.rotation[2] = 1.0;
    ov_camera_aim(&camera, atoms, 200, &options);
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            expect_near(product(camera.axis[i], camera.axis[k]), i == k, 1e-12, "axes");
    const double *const x = camera.axis[0], *const y = camera.axis[1];
    const double z[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                         x[0] * y[1] - x[1] * y[0]};
    expect_near(product(z, camera.axis[2]), 1.0, 1e-12, "handedness");
}

/* A quarter turn about the screen's up: what was at the right goes away from the eye. */
static void rotation_turns_the_molecule(void **state) {
    (void)state;
    const ov_quadric two[] = {atom(-9.0, 0.0, 0.0, 1.0, 0.5), atom(9.0, 0.0, 0.0, 1.0, 0.5)};
    ovoid_picture_options options;
    ov_camera camera;
    ovoid_picture_options_init(&options, sizeof options);
    options.direction[2] = 1.0;
    ov_camera_aim(&camera, two, 2, &options);
    expect_near(ov_camera_see(&camera, &two[1]).centre[0], 9.0, 1e-9, "x");
    options.rotation[1] = 0.5 * 3.14159265358979;
    ov_camera_aim(&camera, two, 2, &options);
    expect_near(ov_camera_see(&camera, &two[1]).centre[2], -9.0, 1e-9, "z");
    options.rotation[1] = 0.0;
    options.rotation[2] = 0.5 * 3.14159265358979;
    ov_camera_aim(&camera, two, 2, &options);
    expect_near(ov_camera_see(&camera, &two[1]).centre[1], 9.0, 1e-9, "y");
}

static void quadrics_keep_their_values(void **state) {
    (void)state;
    test_random random = {12};
    ov_quadric quadrics[20];
    ovoid_picture_options options;
    ov_camera camera;
    see_model(&random, MODEL_RANDOM, 4.0, quadrics, 20);
    ovoid_picture_options_init(&options, sizeof options);
    options.rotation[0] = 0.7;
    ov_camera_aim(&camera, quadrics, 20, &options);
    camera.centre[0] = 3.0;
    for (size_t i = 0; i < 20; ++i) {
        const ov_quadric seen = ov_camera_see(&camera, &quadrics[i]);
        double p[3], y[3];
        for (int k = 0; k < 3; ++k)
            p[k] = random_uniform(&random, -4.0, 4.0);
        for (int k = 0; k < 3; ++k)
            y[k] = camera.centre[k] + p[0] * camera.axis[0][k] + p[1] * camera.axis[1][k] +
                   p[2] * camera.axis[2][k];
        const double wanted = ov_twin_sum_at(&quadrics[i], 1, y);
        expect_near(ov_twin_sum_at(&seen, 1, p), wanted, 1e-10 * wanted + 1e-14, "a value");
    }
}

/* ---- pictures ------------------------------------------------------------------------------- */

static ovoid_molecule *make_molecule(ovoid_context *context, const double *xyzr, size_t atoms) {
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    return molecule;
}

static ovoid_model *make_sphere_model(ovoid_context *context, double x, double amplitude,
                                      double decay) {
    const ovoid_ellipsoid one = {amplitude, {decay, decay, decay}, {x, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    ovoid_model *model = NULL;
    test_check(context, ovoid_model_create(context, &one, 1, decay, 1.0, &model));
    return model;
}

static ovoid_picture_options small_picture(uint32_t width, uint32_t height) {
    ovoid_picture_options options;
    ovoid_picture_options_init(&options, sizeof options);
    options.width = width;
    options.height = height;
    options.samples = 1;
    return options;
}

static const uint8_t *pixel_of(const ovoid_image *image, uint32_t x, uint32_t y) {
    return ovoid_image_pixels(image) + 4 * ((size_t)y * ovoid_image_width(image) + x);
}

static ovoid_image *render(ovoid_context *context, const ovoid_molecule *molecule,
                           const ovoid_model *model, const ovoid_picture_options *options) {
    ovoid_image *image = NULL;
    test_check(context, once_render(context, molecule, 0.5, model, options, &image));
    assert_int_equal(ovoid_image_width(image), options->width);
    assert_int_equal(ovoid_image_height(image), options->height);
    return image;
}

static const double lone_atom[4] = {30.0, -20.0, 10.0, 2.0};

/* Radius and place of the silhouette, colour of the middle, and nothing around. */
static void sphere_looks_like_one(void **state) {
    ovoid_molecule *molecule = make_molecule(*state, lone_atom, 1);
    const uint32_t side = (uint32_t)test_size(121, 15), middle = side / 2;
    ovoid_picture_options options = small_picture(side, side);
    options.across = 6.0;
    options.background = 0x204060ff;
    ovoid_image *image = render(*state, molecule, NULL, &options);
    const double pixel = 6.0 / side, area = 3.14159265 * 4.0 / (pixel * pixel);
    expect_near((double)ovoid_image_covered(image), area, 12.0 / pixel, "the silhouette's area");
    for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x) {
            const double away = pixel * hypot((double)x - middle, (double)y - middle);
            const uint8_t wanted[4] = {0x20, 0x40, 0x60, 0xff}, *const got = pixel_of(image, x, y);
            if (fabs(away - 2.0) > 1e-4)
                assert_int_equal(memcmp(wanted, got, 4) == 0, away > 2.0);
        }
    /* It is lit as the reference says; nothing shades a lone sphere. */
    const ov_lights *const lights = &ov_default_lights;
    const ov_colour own = ov_colour_linear(options.original), haze = ov_colour_linear(0x204060ffu);
    const double extent = sqrt(4.0 + log(1.0 / 0.4) / 0.5); /* what the distance fades over */
    for (uint32_t step = 0; step < 10; ++step) {
        const uint32_t x = middle - step * middle / 18, y = middle + step * middle / 22;
        const double u = pixel * ((double)x - middle), v = pixel * ((double)middle - y);
        const double z = sqrt(4.0 - u * u - v * v), normal[3] = {u / 2.0, v / 2.0, z / 2.0};
        const double colour[3] = {own.rgba[0], own.rgba[1], own.rgba[2]};
        const double fade = lights->fade * (extent - z) / (2.0 * extent);
        double light[3];
        ov_twin_light(colour, normal, lights->key, lights->fill, lights->ambient, light);
        for (int k = 0; k < 3; ++k) {
            const double wanted = light[k] + fade * (haze.rgba[k] - light[k]);
            expect_near(pixel_of(image, x, y)[k], ov_srgb_encode(wanted), 1.01, "a colour");
        }
    }
    ovoid_image_destroy(&image);
    ovoid_molecule_destroy(&molecule);
}

static void edges_are_smooth(void **state) {
    ovoid_molecule *molecule = make_molecule(*state, lone_atom, 1);
    const uint32_t side = (uint32_t)test_size(24, 12);
    ovoid_picture_options options = small_picture(side, side);
    options.samples = (uint32_t)test_size(4, 2);
    options.background = 0xffffff00;
    ovoid_image *image = render(*state, molecule, NULL, &options);
    size_t none = 0, some = 0, all = 0;
    for (uint32_t k = 0; k < side * side; ++k) {
        const uint8_t opacity = ovoid_image_pixels(image)[4 * k + 3];
        none += opacity == 0;
        all += opacity == 255;
        some += opacity > 0 && opacity < 255;
    }
    assert_true(none > side && all > side && some > side / 2);
    assert_int_equal(ovoid_image_covered(image), some + all);
    ovoid_image_destroy(&image);
    ovoid_molecule_destroy(&molecule);
}

/* Where a sphere looks toward another one it is darker than alone. */
static void neighbours_shade_each_other(void **state) {
    const double two[8] = {-2.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 2.0};
    ovoid_molecule *pair = make_molecule(*state, two, 2), *alone = make_molecule(*state, two, 1);
    const uint32_t width = (uint32_t)test_size(41, 21), height = (uint32_t)test_size(21, 5);
    const uint32_t row = height / 2;
    ovoid_picture_options options = small_picture(width, height);
    options.across = 10.0;
    options.direction[2] = 1.0;
    memset(options.centre, 0, sizeof options.centre);
    ovoid_image *shaded = render(*state, pair, NULL, &options);
    ovoid_image *open = render(*state, alone, NULL, &options);
    const uint32_t toward = width / 2 * 4 / 5, away = width / 2 * 3 / 10;
    for (int k = 0; k < 3; ++k) {
        assert_true(pixel_of(shaded, toward, row)[k] + 1 < pixel_of(open, toward, row)[k]);
        expect_near(pixel_of(shaded, away, row)[k], pixel_of(open, away, row)[k], 1.0,
                    "a pixel that looks away");
    }
    ovoid_image_destroy(&shaded);
    ovoid_image_destroy(&open);
    ovoid_molecule_destroy(&alone);
    ovoid_molecule_destroy(&pair);
}

static void nothing_to_see(void **state) {
    ovoid_molecule *molecule = make_molecule(*state, lone_atom, 1);
    ovoid_model *model = make_sphere_model(*state, 0.0, 0.5, 0.5);
    for (int k = 0; k < 3; ++k) {
        ovoid_picture_options options = small_picture(9, 7);
        options.background = 0xffeeddff;
        if (k == 0)
            options.isovalue = 1e4; /* above phi's maximum of e^2 */
        else if (k == 1)
            options.centre[0] = options.centre[1] = options.centre[2] = 500.0;
        else
            options.view = OVOID_VIEW_ELLIPSOIDS; /* of an amplitude below c */
        options.centres = false;
        options.across = k == 1 ? 5.0 : 0.0;
        ovoid_image *image = render(*state, molecule, k == 2 ? model : NULL, &options);
        assert_int_equal(ovoid_image_covered(image), 0);
        for (uint32_t i = 0; i < 9 * 7; ++i)
            assert_memory_equal(ovoid_image_pixels(image) + 4 * i, "\xff\xee\xdd\xff", 4);
        ovoid_image_destroy(&image);
    }
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

static void tiny_pictures(void **state) {
    ovoid_molecule *molecule = make_molecule(*state, lone_atom, 1);
    ovoid_model *model = make_sphere_model(*state, 30.0, exp(2.0), 0.5);
    for (int view_of = OVOID_VIEW_ORIGINAL; view_of <= OVOID_VIEW_PANEL; ++view_of) {
        ovoid_picture_options options = small_picture(view_of == OVOID_VIEW_PANEL ? 3 : 1, 1);
        options.view = (ovoid_view)view_of;
        options.samples = 3;
        ovoid_image *image = render(*state, molecule, model, &options);
        assert_int_equal(pixel_of(image, 0, 0)[3], 255);
        ovoid_image_destroy(&image);
    }
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* A model that is larger is red, one that is smaller blue, and the range is the distance's. */
static void difference_has_its_sign(void **state) {
    const double one[4] = {0.0, 0.0, 0.0, 2.0};
    const uint32_t width = (uint32_t)test_size(16, 8), height = (uint32_t)test_size(12, 6);
    ovoid_molecule *molecule = make_molecule(*state, one, 1);
    for (int sign = -1; sign <= 1; sign += 2) {
        /* (phi~ - phi) / |grad phi| = (f - 1) / 2 at r = 2 with d = 0.5 */
        ovoid_model *model = make_sphere_model(*state, 0.0, (1.0 + 0.3 * sign) * exp(2.0), 0.5);
        ovoid_picture_options options = small_picture(width, height);
        options.view = OVOID_VIEW_DIFFERENCE;
        ovoid_image *image = render(*state, molecule, model, &options);
        const uint8_t *const middle = pixel_of(image, width / 2, height / 2);
        assert_true(sign > 0 ? middle[0] > middle[2] + 40 : middle[2] > middle[0] + 40);
        expect_near(ovoid_image_range(image), 0.2, 1e-9, "the range: 0.15, rounded up");
        ovoid_image_destroy(&image);
        options.range = 0.7;
        image = render(*state, molecule, model, &options);
        expect_near(ovoid_image_range(image), 0.7, 0.0, "the range asked for");
        ovoid_image_destroy(&image);
        ovoid_model_destroy(&model);
    }
    ovoid_molecule_destroy(&molecule);
}

/* Right of the surfaces' middle the model is shifted out of the molecule's glass. */
static void overlay_shows_both(void **state) {
    const double one[4] = {0.0, 0.0, 0.0, 2.0};
    ovoid_molecule *molecule = make_molecule(*state, one, 1);
    ovoid_model *model = make_sphere_model(*state, 1.0, exp(2.0), 0.5);
    const uint32_t height = (uint32_t)test_size(4, 2), row = height / 2;
    ovoid_picture_options options = small_picture(80, height);
    options.view = OVOID_VIEW_OVERLAY;
    options.across = 8.0;
    options.direction[2] = 1.0;
    options.original = 0x0000ffff;
    options.model = 0xff0000ff;
    ovoid_image *image = render(*state, molecule, model, &options);
    const uint8_t *const film = pixel_of(image, 42, row), *const bare = pixel_of(image, 60, row);
    const uint8_t *const glass = pixel_of(image, 23, row); /* and nothing below */
    assert_true(film[2] > film[0] + 60);
    assert_true(bare[0] > bare[2] + 60);
    assert_true(glass[2] > glass[0] + 15 && glass[0] > film[0]);
    ovoid_image_destroy(&image);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

/* A ball in the middle, and others about it: near is blue, far is red, whatever is turned. */
static void radii_have_colours(void **state) {
    static const double balls[20] = {0.0, 0.0, 0.0, 2.0, 10.0, 0.0, 0.0, 2.0,  -10.0, 0.0,
                                     0.0, 2.0, 0.0, 10., 0.0,  2.0, 0.0, -10., 0.0,   2.0};
    ovoid_molecule *molecule = make_molecule(*state, balls, 5);
    const uint32_t side = (uint32_t)test_size(65, 33), middle = side / 2;
    ovoid_picture_options options = small_picture(side, side);
    double radii[2] = {7.0, 7.0};
    test_skip_simulated(*state);
    options.direction[2] = 1.0;
    options.across = 26.0;
    ovoid_image *plain = render(*state, molecule, NULL, &options);
    assert_false(ovoid_image_radii(plain, radii));
    assert_true(radii[0] == 7.0);
    options.colouring = OVOID_PICTURE_BY_RADIUS;
    ovoid_image *image = render(*state, molecule, NULL, &options);
    assert_true(ovoid_image_radii(image, radii));
    expect_near(radii[0], 2.0, 0.1, "the inmost of what is seen");
    expect_near(radii[1], 12.0, 0.3, "the outermost of what is seen");
    assert_int_equal(ovoid_image_covered(image), ovoid_image_covered(plain));
    const uint32_t off = (uint32_t)(10.0 / 26.0 * side + 0.5);
    const uint8_t *const near = pixel_of(image, middle, middle);
    const uint8_t *const far[2] = {pixel_of(image, middle + off, middle),
                                   pixel_of(image, middle, middle - off)};
    assert_true(near[2] > near[0] + 40);
    for (int k = 0; k < 2; ++k)
        assert_true(far[k][0] > far[k][2] + 40);
    assert_memory_equal(pixel_of(image, 0, 0), pixel_of(plain, 0, 0), 4);
    ovoid_image_destroy(&plain);
    ovoid_image_destroy(&image);
    ovoid_molecule_destroy(&molecule);
}

/* Two units of two ellipsoids each, in a row. */
static void units_have_colours(void **state) {
    const double d = 0.5;
    const ovoid_ellipsoid two[2] = {{exp(2.0), {d, d, d}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}},
                                    {exp(2.0), {d, d, d}, {5.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}};
    const ovoid_motion placements[2] = {{{1, 0, 0, 0, 1, 0, 0, 0, 1}, {-7.5, 0.0, 0.0}},
                                        {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {2.5, 0.0, 0.0}}};
    const uint32_t height = 7, row = 3;
    ovoid_picture_options options = small_picture(80, height);
    ovoid_model *model = NULL;
    test_skip_simulated(*state);
    test_check(*state, ovoid_model_create_placed(*state, two, 2, placements, 2, d, 1.0, &model));
    options.view = OVOID_VIEW_ELLIPSOIDS;
    options.centres = false;
    options.direction[2] = 1.0;
    options.across = 20.0;
    for (int by_unit = 0; by_unit < 2; ++by_unit) {
        options.colouring = by_unit ? OVOID_PICTURE_BY_UNIT : OVOID_PICTURE_PLAIN;
        ovoid_image *image = render(*state, NULL, model, &options);
        const uint8_t *const first = pixel_of(image, 10, row), *const second = first + 4 * 20,
                             *const other = first + 4 * 40;
        assert_true(memcmp(first, "\xff\xff\xff", 3) != 0);
        assert_int_equal(memcmp(first, second, 4) == 0, by_unit);
        assert_true(memcmp(first, other, 4) != 0);
        assert_int_equal(memcmp(other, other + 4 * 20, 4) == 0, by_unit);
        ovoid_image_destroy(&image);
    }
    ovoid_model_destroy(&model);
}

static void centres_are_marked(void **state) {
    test_skip_simulated(*state);
    ovoid_model *model = make_sphere_model(*state, 4.0, exp(2.0), 0.5);
    const uint32_t side = (uint32_t)test_size(20, 12), middle = side / 2, off = side / 3;
    ovoid_picture_options options = small_picture(side, side);
    options.view = OVOID_VIEW_MODEL;
    options.points = 0x0000ffff;
    ovoid_image *marked = render(*state, NULL, model, &options);
    options.centres = false;
    ovoid_image *bare = render(*state, NULL, model, &options);
    assert_true(pixel_of(marked, middle, middle)[2] > pixel_of(marked, middle, middle)[0] + 80);
    assert_true(pixel_of(bare, middle, middle)[0] > pixel_of(bare, middle, middle)[2]);
    assert_memory_equal(pixel_of(marked, off, off), pixel_of(bare, off, off), 4);
    ovoid_image_destroy(&marked);
    ovoid_image_destroy(&bare);
    ovoid_model_destroy(&model);
}

/* The panel is the pictures that it is made of. */
static void panel_is_three_pictures(void **state) {
    test_skip_simulated(*state); /* the host puts them side by side */
    const double two[8] = {-1.6, 0.0, 0.0, 2.0, 1.6, 0.5, 0.0, 1.5};
    static const ovoid_view views[] = {OVOID_VIEW_ORIGINAL, OVOID_VIEW_MODEL, OVOID_VIEW_OVERLAY};
    ovoid_molecule *molecule = make_molecule(*state, two, 2);
    ovoid_model *model = make_sphere_model(*state, 0.4, exp(2.2), 0.4);
    ovoid_picture_options options = small_picture(31, 8);
    options.view = OVOID_VIEW_PANEL;
    ovoid_image *panel = render(*state, molecule, model, &options);
    options.width = 10;
    for (uint32_t k = 0; k < 3; ++k) {
        options.view = views[k];
        ovoid_image *one = render(*state, molecule, model, &options);
        for (uint32_t y = 0; y < 8; ++y)
            assert_memory_equal(pixel_of(panel, 10 * k, y), pixel_of(one, 0, y), 4 * 10);
        ovoid_image_destroy(&one);
    }
    assert_memory_equal(pixel_of(panel, 30, 4), "\xff\xff\xff\xff", 4);
    ovoid_image_destroy(&panel);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

static void pictures_repeat_exactly(void **state) {
    test_skip_simulated(*state);
    double xyzr[4 * 30];
    const size_t atoms = test_size(30, 8);
    test_random random = {13};
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -5.0, 5.0);
        xyzr[4 * i + 3] = random_uniform(&random, 1.0, 2.0);
    }
    ovoid_molecule *molecule = make_molecule(*state, xyzr, atoms);
    ovoid_model *model = make_sphere_model(*state, 0.4, exp(3.0), 0.2);
    const uint32_t width = (uint32_t)test_size(120, 6), height = (uint32_t)test_size(90, 4);
    for (int view_of = OVOID_VIEW_ORIGINAL; view_of <= OVOID_VIEW_ELLIPSOIDS; ++view_of) {
        ovoid_picture_options options = small_picture(width, height);
        options.view = (ovoid_view)view_of;
        options.samples = 2;
        ovoid_image *first = render(*state, molecule, model, &options);
        ovoid_image *second = render(*state, molecule, model, &options);
        assert_memory_equal(ovoid_image_pixels(first), ovoid_image_pixels(second),
                            4 * (size_t)width * height);
        ovoid_image_destroy(&first);
        ovoid_image_destroy(&second);
    }
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&molecule);
}

static void bad_arguments_are_refused(void **state) {
    ovoid_molecule *molecule = make_molecule(*state, lone_atom, 1);
    ovoid_image *image = NULL;
    const ovoid_picture_options good = small_picture(8, 8);
    ovoid_picture_options o = good;
#define REFUSED(part)                                                                              \
    do {                                                                                           \
        test_refused(*state, once_render(*state, molecule, 0.5, NULL, &o, &image),                 \
                     OVOID_ERROR_ARGUMENT, part);                                                  \
        assert_null(image);                                                                        \
        o = good;                                                                                  \
    } while (0)
    o.width = 0;
    REFUSED("0 by 8 pixels");
    o.height = OVOID_PICTURE_SIDE_MAX + 1;
    REFUSED("8 by 16385 pixels");
    o.samples = 9;
    REFUSED("9 rays across a pixel");
    o.isovalue = NAN;
    REFUSED("isovalue nan");
    o.isovalue = -1.0;
    REFUSED("isovalue -1");
    o.across = -1.0;
    REFUSED("across");
    o.range = INFINITY;
    REFUSED("range of colours");
    o.direction[1] = NAN;
    REFUSED("not finite");
    o.rotation[2] = INFINITY;
    REFUSED("not finite");
    o.view = OVOID_VIEW_MODEL;
    REFUSED("needs the model's");
    o.view = (ovoid_view)17;
    REFUSED("no view 17");
    o.colouring = (ovoid_picture_colouring)3;
    REFUSED("no colouring 3");
    o.colouring = OVOID_PICTURE_BY_UNIT;
    REFUSED("colours by unit are those of ellipsoids");
#undef REFUSED
    o.view = OVOID_VIEW_ORIGINAL;
    test_refused(*state, once_render(*state, NULL, 0.5, NULL, &o, &image), OVOID_ERROR_ARGUMENT,
                 "needs the original's");
    test_refused(*state, once_render(*state, molecule, 0.0, NULL, &o, &image), OVOID_ERROR_ARGUMENT,
                 "decay 0");
    test_refused(*state, once_render(*state, molecule, 0.5, NULL, NULL, &image),
                 OVOID_ERROR_ARGUMENT, "NULL");
    ovoid_image_destroy(&image);
    ovoid_image_destroy(NULL);
    ovoid_molecule_destroy(&molecule);
}

/* ---- drawing -------------------------------------------------------------------------------- */

static void colours_survive_both_ways(void **state) {
    (void)state;
    for (int k = 0; k < 256; ++k)
        assert_int_equal(ov_srgb_encode(ov_srgb_decode((uint8_t)k)), k);
    const ov_colour colour = ov_colour_linear(0xff0080c0u);
    expect_near(colour.rgba[0], 1.0, 1e-6, "red");
    expect_near(colour.rgba[1], 0.0, 1e-6, "green");
    expect_near(colour.rgba[2], 0.2158605, 1e-5, "blue");
    expect_near(colour.rgba[3], 192.0 / 255.0, 1e-6, "opacity");
    ov_colour palette[OV_PALETTE_SIZE];
    ov_palette_diverging(palette);
    assert_true(palette[0].rgba[2] > 3.0f * palette[0].rgba[0]);
    assert_true(palette[255].rgba[0] > 3.0f * palette[255].rgba[2]);
    assert_true(palette[127].rgba[0] > 0.8f && palette[127].rgba[2] > 0.8f);
}

static void discs_have_their_area(void **state) {
    ovoid_image *image = NULL;
    const ov_colour black = ov_colour_linear(0x000000ffu);
    test_check(*state, ov_image_make(*state, 40, 30, &image));
    ov_image_disc(image, 20.3, 14.8, 6.0, &black);
    double sum = 0.0;
    for (size_t k = 0; k < 40 * 30; ++k)
        sum += image->pixels[4 * k + 3] / 255.0;
    expect_near(sum, 3.14159265 * 36.0, 1.5, "a disc's area");
    /* half of one, and none, of discs at and beyond the edge */
    memset(image->pixels, 0, 4 * 40 * 30);
    ov_image_disc(image, 0.0, 15.0, 6.0, &black);
    ov_image_disc(image, -1e9, 1e9, 6.0, &black);
    for (sum = 0.0, image->covered = 0; image->covered < 40 * 30; ++image->covered)
        sum += image->pixels[4 * image->covered + 3] / 255.0;
    expect_near(sum, 3.14159265 * 18.0, 1.5, "half a disc's area");
    ovoid_image_destroy(&image);
}

/* Every sign looks different, and stays in its place. */
static void letters_can_be_told_apart(void **state) {
    static const char letters[] = "0123456789+-.A";
    enum { SIDE = 40, COUNT = sizeof letters - 1 };
    static double drawn[COUNT][SIDE * SIDE];
    const ov_colour black = ov_colour_linear(0x000000ffu);
    for (int i = 0; i < COUNT; ++i) {
        const char text[2] = {letters[i], '\0'};
        ovoid_image *image = NULL;
        test_check(*state, ov_image_make(*state, SIDE, SIDE, &image));
        ov_label_draw(image, 10.0, 10.0, 20.0, text, &black);
        double ink = 0.0;
        for (int k = 0; k < SIDE * SIDE; ++k) {
            drawn[i][k] = image->pixels[4 * k + 3] / 255.0;
            ink += drawn[i][k];
        }
        assert_true(ink > 4.0 && ink < 250.0);
        for (int row = 0; row < SIDE; ++row)
            assert_true(drawn[i][row * SIDE + 2] == 0.0 && drawn[i][row * SIDE + 32] == 0.0);
        ovoid_image_destroy(&image);
    }
    for (int i = 0; i < COUNT; ++i)
        for (int j = 0; j < i; ++j) {
            double difference = 0.0;
            for (int k = 0; k < SIDE * SIDE; ++k)
                difference += fabs(drawn[i][k] - drawn[j][k]);
            if (difference < 12.0)
                fail_msg("%c and %c look alike", letters[i], letters[j]);
        }
    assert_true(ov_label_width(20.0, "10") > 1.9 * ov_label_width(20.0, "1"));
}

static void ranges_are_round(void **state) {
    (void)state;
    static const double pairs[][2] = {{0.15, 0.2}, {0.2, 0.2},  {0.21, 0.4}, {0.07, 0.08},
                                      {5.0, 6.0},  {9.1, 10.0}, {1.0, 1.0},  {0.0, 1.0}};
    for (size_t k = 0; k < sizeof pairs / sizeof pairs[0]; ++k)
        expect_near(ov_round_up(pairs[k][0]), pairs[k][1], 1e-12, "a range");
    assert_int_equal(ov_colour_bar_width(99, 2000), 0);
    assert_true(ov_colour_bar_width(1200, 900) > 60);
}

/* ---- PNG files ------------------------------------------------------------------------------ */

static void png_keeps_every_pixel(void **state) {
    enum { WIDTH = 37, HEIGHT = 11 };
    uint8_t pixels[4 * WIDTH * HEIGHT], back[4 * WIDTH * HEIGHT];
    char path[] = "/tmp/ovoid-test-XXXXXX";
    test_random random = {14};
    const int descriptor = mkstemp(path);
    assert_true(descriptor >= 0);
    close(descriptor);
    for (int opaque = 0; opaque <= 1; ++opaque) {
        ovoid_image *image = NULL;
        for (size_t k = 0; k < sizeof pixels; ++k)
            pixels[k] = opaque && k % 4 == 3 ? 255 : (uint8_t)random_bits(&random);
        test_check(*state, ovoid_image_create(*state, WIDTH, HEIGHT, pixels, &image));
        test_check(*state, ovoid_image_write(*state, image, path));
        png_image png = {.version = PNG_IMAGE_VERSION};
        assert_true(png_image_begin_read_from_file(&png, path));
        assert_int_equal(png.width, WIDTH);
        assert_int_equal(png.height, HEIGHT);
        assert_int_equal(png.format, opaque ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA);
        png.format = PNG_FORMAT_RGBA;
        assert_true(png_image_finish_read(&png, NULL, back, 0, NULL));
        assert_memory_equal(back, pixels, sizeof pixels);
        test_refused(*state, ovoid_image_write(*state, image, "/no/such/folder/a.png"),
                     OVOID_ERROR_IO, "/no/such/folder");
        if (access("/dev/full", W_OK) == 0)
            test_refused(*state, ovoid_image_write(*state, image, "/dev/full"), OVOID_ERROR_IO,
                         "No space left");
        ovoid_image_destroy(&image);
    }
    unlink(path);
    ovoid_image *image = NULL;
    test_refused(*state, ovoid_image_create(*state, 0, 5, pixels, &image), OVOID_ERROR_ARGUMENT,
                 "0 by 5");
    assert_null(image);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sphere_has_its_shape),
        cmocka_unit_test(nearest_sphere_is_seen),
        cmocka_unit_test(rays_are_the_references),
        cmocka_unit_test(thin_sheets_are_seen),
        cmocka_unit_test(rays_far_apart_see_the_same),
        cmocka_unit_test(deep_scenes_work),
        cmocka_unit_test(ellipsoids_are_seen_singly),
        cmocka_unit_test(comparison_is_the_formula),
        cmocka_unit_test(protein_is_hit_where_phi_is_c),
        cmocka_unit_test(camera_looks_along_principal_axes),
        cmocka_unit_test(rotation_turns_the_molecule),
        cmocka_unit_test(quadrics_keep_their_values),
        cmocka_unit_test(sphere_looks_like_one),
        cmocka_unit_test(edges_are_smooth),
        cmocka_unit_test(neighbours_shade_each_other),
        cmocka_unit_test(nothing_to_see),
        cmocka_unit_test(tiny_pictures),
        cmocka_unit_test(difference_has_its_sign),
        cmocka_unit_test(overlay_shows_both),
        cmocka_unit_test(radii_have_colours),
        cmocka_unit_test(units_have_colours),
        cmocka_unit_test(centres_are_marked),
        cmocka_unit_test(panel_is_three_pictures),
        cmocka_unit_test(pictures_repeat_exactly),
        cmocka_unit_test(bad_arguments_are_refused),
        cmocka_unit_test(colours_survive_both_ways),
        cmocka_unit_test(discs_have_their_area),
        cmocka_unit_test(letters_can_be_told_apart),
        cmocka_unit_test(ranges_are_round),
        cmocka_unit_test(png_keeps_every_pixel),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
