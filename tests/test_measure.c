/*
 * Measures of molecules and models: closed forms of one atom and one ellipsoid, what measures say
 * of surfaces with cavities, and the paper's Table 2.
 */
#include "measure/bound.h"
#include "measure/measure.h"
#include "shapes.h"
#include "support.h"

#define PI 3.14159265358979323846

static ovoid_molecule *make_molecule(ovoid_context *context, const double *xyzr, size_t atoms) {
    ovoid_molecule *molecule = NULL;
    test_check(context, ovoid_molecule_create(context, xyzr, atoms, &molecule));
    return molecule;
}

static ovoid_model *make_model(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                               size_t count) {
    ovoid_model *model = NULL;
    test_check(context, ovoid_model_create(context, ellipsoids, count, 0.5, 1.0, &model));
    return model;
}

/* The ellipsoid that is an atom of decay 0.5: a = exp(d r^2). */
static ovoid_ellipsoid atom_as_ellipsoid(double x, double y, double z, double radius) {
    return (ovoid_ellipsoid){exp(0.5 * radius * radius), {0.5, 0.5, 0.5}, {x, y, z}, {0, 0, 0}};
}

static void expect_share(double got, double wanted, double share, const char *what) {
    print_message("%s: %.6g, %.6g expected: off by %.2g\n", what, got, wanted, got / wanted - 1.0);
    expect_near(got / wanted, 1.0, share, what);
}

/* One atom against one ellipsoid about the same point: all has a closed form. */
static void test_closed_forms(void **state) {
    ovoid_context *const context = *state;
    const double xyzr[4] = {10.1, -20.2, 30.3, 1.9};
    const ovoid_ellipsoid ellipsoid = {4.0, {0.2, 0.45, 0.9}, {10.1, -20.2, 30.3}, {0.4, 1.1, -2}};
    const double isovalues[2] = {1.0, 0.7};
    ovoid_molecule *molecule = make_molecule(context, xyzr, 1);
    ovoid_model *model = make_model(context, &ellipsoid, 1);
    ovoid_measure_options options;
    ovoid_measure_options_init(&options, sizeof options);
    assert_true(options.distances && options.vertices == OVOID_VERTEX_EXACT);
    expect_near(options.spacing, 0.5, 0.0, "default spacing");
    expect_near(options.isovalue, 0.0, 0.0, "default isovalue");
    options.spacing = test_small() ? 0.8 : 0.3;
    const double share = test_small() ? 0.02 : 1e-3;
    for (int k = 0; k < (test_small() ? 1 : 2); ++k) {
        ovoid_measures got;
        ovoid_measures_init(&got, sizeof got);
        options.isovalue = isovalues[k];
        const double radius = sqrt(1.9 * 1.9 - log(isovalues[k]) / 0.5);
        double axes[3];
        for (int axis = 0; axis < 3; ++axis)
            axes[axis] = sqrt(log(ellipsoid.amplitude / isovalues[k]) / ellipsoid.decay[axis]);
        const double area = 4.0 * PI * radius * radius, volume = area * radius / 3.0;
        const double model_area = ellipsoid_area(axes);
        const double model_volume = 4.0 / 3.0 * PI * axes[0] * axes[1] * axes[2];
        test_check(context, once_measure(context, molecule, model, &options, &got));
        expect_share(got.area.original, area, share, "area of an atom");
        expect_share(got.volume.original, volume, share, "volume of an atom");
        expect_share(got.area.sparse, model_area, share, "area of an ellipsoid");
        expect_share(got.volume.sparse, model_volume, share, "volume of an ellipsoid");
        expect_near(got.area.error, fabs(model_area / area - 1.0), 2.0 * share,
                    "error of the area");
        expect_near(got.volume.error, fabs(model_volume / volume - 1.0), 2.0 * share,
                    "error of the volume");
        /* Concentric: largest where the axes differ most from the radius. */
        const double far = fmax(axes[0] - radius, radius - axes[2]);
        expect_near(got.distances.hausdorff, far, test_small() ? 0.2 : 0.02, "hausdorff");
        expect_near(got.distances_outer.hausdorff, got.distances.hausdorff, 0.0, "outer");
        expect_near(got.deviation_bound, far, test_small() ? 0.2 : 0.02, "bound");
        assert_true(got.deviation_bound >= got.deviation);
        assert_true(got.distances.mean < got.distances.rms &&
                    got.distances.rms < got.distances.hausdorff);
        assert_int_equal(got.components_original, 1);
        assert_int_equal(got.components_sparse, 1);
        assert_int_equal(got.outer_original, 1);
        assert_int_equal(got.outer_sparse, 1);
        expect_near(got.area_outer.error, got.area.error, 0.0, "outer area");
    }
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* The same field as atoms and as ellipsoids. */
static void test_same_surface(void **state) {
    test_skip_simulated(*state);
    ovoid_context *const context = *state;
    const double xyzr[12] = {0, 0, 0, 1.7, 1.5, 0.3, 0, 1.5, 8, 0, 0, 1.2};
    ovoid_ellipsoid ellipsoids[3];
    for (size_t i = 0; i < 3; ++i)
        ellipsoids[i] =
            atom_as_ellipsoid(xyzr[4 * i], xyzr[4 * i + 1], xyzr[4 * i + 2], xyzr[4 * i + 3]);
    ovoid_molecule *molecule = make_molecule(context, xyzr, 3);
    ovoid_model *model = make_model(context, ellipsoids, 3);
    ovoid_measure_options options;
    ovoid_measures got;
    ovoid_measures_init(&got, sizeof got);
    ovoid_measure_options_init(&options, sizeof options);
    options.spacing = test_small() ? 0.9 : 0.5;
    test_check(context, once_measure(context, molecule, model, &options, &got));
    expect_near(got.area.error, 0.0, 1e-6, "area");
    expect_near(got.volume.error, 0.0, 1e-6, "volume");
    expect_near(got.distances.hausdorff, 0.0, 1e-4, "hausdorff");
    expect_near(got.deviation_bound, 0.0, OV_BOUND_SLACK + 1e-4, "bound");
    assert_int_equal(got.components_original, 2);
    assert_int_equal(got.outer_sparse, 2);
    assert_true(got.seconds_mesh > 0.0 && got.seconds_distances > 0.0);

    options.distances = false;
    const double area = got.area.original;
    test_check(context, once_measure(context, molecule, model, &options, &got));
    expect_near(got.area.original, area, 0.0, "the area of a second run");
    assert_true(isnan(got.distances.hausdorff) && isnan(got.deviation) &&
                isnan(got.deviation_bound)); /* not asked for */

    options.vertices = OVOID_VERTEX_LINEAR; /* flat triangles of interpolated vertices: elsewhere */
    test_check(context, once_measure(context, molecule, model, &options, &got));
    assert_true(fabs(got.area.original - area) > 1e-4 * area);
    expect_near(got.area.original / area, 1.0, 0.06, "area of flat triangles");
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* A hollow ball against a full one: the walls of cavities count for the whole, not for the outer
 * surface. */
static void test_cavity(void **state) {
    test_skip_simulated(*state);
    ovoid_context *const context = *state;
    const int level = test_small() ? 2 : 4;
    shape hollow = {0}, full = {0};
    shape_add_sphere(&hollow, level, 4.0, 1, 2, 3);
    shape_add_ellipsoid(&hollow, level, (const double[3]){1, 1, 1}, (const double[3]){1, 2, 3},
                        true);
    shape_add_sphere(&full, level, 4.0, 1, 2, 3);
    ovoid_mesh *original = shape_mesh(context, &hollow), *sparse = shape_mesh(context, &full);
    ovoid_measures got;
    test_check(context, ov_measure_meshes(context, original, sparse, true, true, &got));
    expect_near(got.area.error, 1.0 / 17.0, 1e-3, "area");
    expect_near(got.volume.error, 1.0 / 63.0, 1e-3, "volume");
    expect_near(got.volume.original, 4.0 / 3.0 * PI * 63.0, 0.2, "volume");
    expect_near(got.area_outer.error, 0.0, 1e-12, "outer area");
    expect_near(got.volume_outer.error, 0.0, 1e-12, "outer volume");
    expect_near(got.distances.hausdorff, 3.0, test_small() ? 0.2 : 0.02, "hausdorff");
    expect_near(got.distances.backward, 0.0, 1e-5, "backward");
    expect_near(got.distances_outer.hausdorff, 0.0, 1e-5, "outer hausdorff");
    expect_near(got.deviation_bound, 0.0, 1e-4, "bound of outer surfaces");
    assert_int_equal(got.components_original, 2);
    assert_int_equal(got.outer_original, 1);
    assert_int_equal(got.components_sparse, 1);
    ovoid_mesh_destroy(&original);
    ovoid_mesh_destroy(&sparse);
    shape_destroy(&hollow);
    shape_destroy(&full);
}

static void test_refusals(void **state) {
    test_skip_simulated(*state);
    ovoid_context *const context = *state;
    const double xyzr[4] = {0, 0, 0, 1.5};
    const ovoid_ellipsoid faint = {0.5, {1, 1, 1}, {0, 0, 0}, {0, 0, 0}};
    ovoid_molecule *molecule = make_molecule(context, xyzr, 1);
    ovoid_model *model = make_model(context, &faint, 1);
    ovoid_measure_options options;
    ovoid_measures got = {.size = sizeof got, .components_original = 42};
    ovoid_measure_options_init(&options, sizeof options);
    test_refused(context, once_measure(context, molecule, model, &options, &got), OVOID_ERROR_EMPTY,
                 "the surface of the model: ");
    options.isovalue = 100.0;
    test_refused(context, once_measure(context, molecule, model, &options, &got), OVOID_ERROR_EMPTY,
                 "the surface of the molecule: ");
    options.isovalue = NAN;
    test_refused(context, once_measure(context, molecule, model, &options, &got),
                 OVOID_ERROR_ARGUMENT, "isovalue");
    ovoid_measure_options_init(&options, sizeof options);
    options.spacing = 0.0;
    test_refused(context, once_measure(context, molecule, model, &options, &got),
                 OVOID_ERROR_ARGUMENT, "spacing");
    test_refused(context, once_measure(context, NULL, model, &options, &got), OVOID_ERROR_ARGUMENT,
                 "is NULL");
    assert_int_equal(got.components_original, 42);
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* Originals of Table 2 of the paper, made by MATLAB's isosurface: linear vertices. */
static void test_table2(void **state) {
    static const struct {
        const char *name;
        double area, volume, share;
    } rows[] = {{"DIALA", 213.989, 252.007, 0.01},
                {"ADP", 367.853, 457.675, 0.005},
                {"1MAG", 2479.407, 5730.899, 0.005},
                {"FAS2", 3770.276, 9197.362, 0.01}};
    ovoid_context *const context = *state;
    const char *folder = getenv("OVOID_MOLECULES");
    if (!folder)
        folder = OVOID_MOLECULES_DEFAULT;
    if (test_small()) /* seconds here, hours where a device is simulated */
        skip();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; ++i) {
        char path[4096];
        ovoid_molecule *molecule = NULL;
        ovoid_mesh *mesh = NULL;
        ovoid_mesh_options options;
        snprintf(path, sizeof path, "%s/%s.pqr", folder, rows[i].name);
        FILE *const stream = fopen(path, "rb");
        if (!stream) {
            print_message("skipped: there is no %s\n", path);
            skip();
        }
        fclose(stream);
        ovoid_mesh_options_init(&options, sizeof options);
        options.vertices = OVOID_VERTEX_LINEAR;
        test_check(context, ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule));
        test_check(context, once_molecule_mesh(context, molecule, 0.5, &options, &mesh));
        print_message("%s: ", rows[i].name);
        expect_share(ovoid_mesh_area(mesh), rows[i].area, rows[i].share, "area");
        print_message("%s: ", rows[i].name);
        expect_share(ovoid_mesh_volume(mesh), rows[i].volume, rows[i].share, "volume");
        /* The smooth surface is a little smaller than what isosurface makes of it. */
        ovoid_mesh_destroy(&mesh);
        options.vertices = OVOID_VERTEX_EXACT;
        test_check(context, once_molecule_mesh(context, molecule, 0.5, &options, &mesh));
        expect_near(ovoid_mesh_smooth_area(mesh) / rows[i].area, 1.0, 0.015, "smooth area");
        expect_near(ovoid_mesh_smooth_volume(mesh) / rows[i].volume, 1.0, 0.01, "smooth volume");
        ovoid_mesh_destroy(&mesh);
        ovoid_molecule_destroy(&molecule);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms), cmocka_unit_test(test_same_surface),
        cmocka_unit_test(test_cavity),       cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_table2),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
