/*
 * Meshes that end at a box: open there, and elsewhere what the whole mesh is.
 */
#include "mesh/march.h"
#include "mesh/mesh.h"
#include "neighbours/neighbours.h"
#include "support.h"

#define SAME 1e-4 /* angstrom */

/* Atoms in a ball, none so small that the lattice would miss it. */
static ov_body *make_atoms(size_t count, double radius) {
    ov_body *const bodies = test_alloc(count, sizeof *bodies);
    test_random random = {31};
    for (size_t i = 0; i < count; ++i) {
        double xyzr[4] = {0.0, 0.0, 0.0, 1.5}, square = INFINITY;
        while (square > radius * radius) {
            square = 0.0;
            for (size_t k = 0; k < 3; ++k) {
                xyzr[k] = random_uniform(&random, -radius, radius);
                square += xyzr[k] * xyzr[k];
            }
        }
        ov_body_of_atom(xyzr, 0.5, &bodies[i]);
    }
    return bodies;
}

static ovoid_mesh *mesh_of(ovoid_context *context, ov_marcher *marcher, const ov_body *bodies,
                           size_t count, double spacing) {
    static const double origin[3] = {0.5, -0.5, 0.25};
    ovoid_mesh_options options;
    ovoid_mesh *mesh = NULL;
    ovoid_mesh_options_init(&options, sizeof options);
    options.isovalue = 1.0;
    options.spacing = spacing;
    const ovoid_status status =
        ov_mesh_bodies_light(context, marcher, bodies, count, &options, origin, NULL, false, &mesh);
    if (status != OVOID_ERROR_EMPTY)
        test_check(context, status);
    if (mesh)
        test_check(context, ov_mesh_finish(context, mesh));
    return mesh;
}

static ov_grid grid_of(ovoid_context *context, const ovoid_mesh *mesh, double **points) {
    ov_grid grid;
    *points = test_alloc(3 * mesh->vertices, sizeof **points);
    for (size_t v = 0; v < mesh->vertices; ++v)
        ov_mesh_at(mesh, v, *points + 3 * v);
    test_check(context,
               ov_grid_of(context, *points, 3 * sizeof **points, mesh->vertices, SAME, &grid));
    return grid;
}

/* How many vertices of one mesh that lie in the box are none of the other. */
static size_t count_missing(ovoid_context *context, const ovoid_mesh *some, const ovoid_mesh *all,
                            const ov_box *box) {
    double *points;
    size_t missing = 0;
    ov_grid grid = grid_of(context, all, &points);
    for (size_t v = 0; v < some->vertices; ++v) {
        double at[3];
        ov_mesh_at(some, v, at);
        missing += ov_box_near(box, at, 0.0) &&
                   ov_grid_nearest(&grid, points, 3 * sizeof *points, at) == OV_NOBODY;
    }
    ov_grid_destroy(&grid);
    free(points);
    return missing;
}

static size_t count_triangles(const ovoid_mesh *mesh, const ov_box *box) {
    size_t count = 0;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        bool in = true;
        for (size_t i = 0; i < 3; ++i) {
            double at[3];
            ov_mesh_at(mesh, mesh->corners[3 * t + i], at);
            in = in && ov_box_near(box, at, 0.0);
        }
        count += in;
    }
    return count;
}

static void expect_clipped(ovoid_context *context, ov_marcher *marcher, const ov_body *bodies,
                           size_t count, double spacing, const ov_box *box, const ovoid_mesh *all) {
    static const ov_box endless = {{-INFINITY, -INFINITY, -INFINITY},
                                   {INFINITY, INFINITY, INFINITY}};
    ov_marcher_clip(marcher, box->low, box->high);
    ovoid_mesh *mesh = mesh_of(context, marcher, bodies, count, spacing);
    const ov_box ends = ov_marcher_ends(marcher), within = ov_box_larger(&ends, 1e-3 * spacing),
                 surely = ov_box_larger(&ends, -1e-3 * spacing);
    for (size_t k = 0; k < 3; ++k) {
        assert_true(ends.low[k] >= box->low[k] - 2.001 * spacing);
        assert_true(ends.high[k] <= box->high[k] + 2.001 * spacing);
    }
    print_message("%zu of %zu vertices\n", mesh ? mesh->vertices : 0, all->vertices);
    if (!mesh) {
        assert_int_equal(count_triangles(all, box), 0);
        return;
    }
    assert_int_equal(count_missing(context, mesh, all, &endless), 0); /* no caps */
    assert_int_equal(count_missing(context, all, mesh, box), 0);
    assert_true(mesh->triangles <= count_triangles(all, &within) &&
                mesh->triangles >= count_triangles(all, &surely));
    assert_int_equal(mesh->triangles, count_triangles(mesh, &within)); /* nothing beyond */
    ovoid_mesh_destroy(&mesh);
}

/* spacing: one piece or many. */
static void clip_at(ovoid_context *context, double spacing, size_t boxes) {
    const size_t count = test_size(60, 8);
    const double radius = test_small() ? 2.5 : 5.0;
    ov_body *const bodies = make_atoms(count, radius);
    ov_marcher *marcher = NULL;
    test_random random = {32};
    test_check(context, ov_marcher_create(context, &marcher));
    ovoid_mesh *all = mesh_of(context, marcher, bodies, count, spacing);
    for (size_t n = 0; n < boxes; ++n) {
        ov_box box;
        for (size_t k = 0; k < 3; ++k) {
            const double a = random_uniform(&random, -1.5 * radius, 1.5 * radius),
                         b = random_uniform(&random, -1.5 * radius, 1.5 * radius);
            box.low[k] = fmin(a, b);
            box.high[k] = fmax(a, b) + 1.0;
        }
        expect_clipped(context, marcher, bodies, count, spacing, &box, all);
    }
    ov_marcher_clip(marcher, NULL, NULL);
    ovoid_mesh *again = mesh_of(context, marcher, bodies, count, spacing);
    assert_int_equal(again->vertices, all->vertices);
    assert_int_equal(again->triangles, all->triangles);
    ovoid_mesh_destroy(&again);
    ovoid_mesh_destroy(&all);
    ov_marcher_destroy(&marcher);
    free(bodies);
}

static void clipped_is_open(void **state) {
    clip_at(*state, 0.5, test_size(12, 2));
}

static void clipped_in_many_pieces(void **state) {
    test_skip_simulated(*state);
    if (test_small())
        skip();
    clip_at(*state, 0.07, 3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clipped_is_open),
        cmocka_unit_test(clipped_in_many_pieces),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
