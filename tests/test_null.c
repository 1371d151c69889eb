/*
 * NULL in the place of each argument of each public function: the one rule of ovoid.h. A function
 * that the headers declare and no line here names fails the last test.
 */
#include "support.h"

#include "ovoid/opencl.h"
#include "ovoid/ovoid.h"

#include <ctype.h>

enum { MOST = 256 };

typedef struct subject {
    ovoid_context *context;
    const char *tried[MOST]; /* names of functions */
    size_t count;
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_field *field;
    ovoid_mesh *mesh;
    ovoid_image *image;
} subject;

static subject all;

static void try(const char *function) {
    assert_true(all.count < MOST);
    all.tried[all.count++] = function;
}

/* The status, and with a context the text as well. */
static void refused(const char *function, const char *argument, ovoid_status status) {
    char wanted[128];
    try(function);
    snprintf(wanted, sizeof wanted, "%s: %s is NULL", function, argument);
    print_message("%s\n", wanted);
    assert_int_equal(status, OVOID_ERROR_ARGUMENT);
    if (strcmp(argument, "context") != 0)
        assert_int_equal(strncmp(ovoid_context_error(all.context), wanted, strlen(wanted)), 0);
}

#define REFUSED(function, argument, ...) refused(#function, #argument, function(__VA_ARGS__))
#define ANSWERS(wanted, function, ...)                                                             \
    do {                                                                                           \
        try(#function);                                                                            \
        assert_true(function(__VA_ARGS__) == (wanted));                                            \
    } while (0)
#define UNKNOWN(function)                                                                          \
    do {                                                                                           \
        try(#function);                                                                            \
        assert_true(isnan(function(NULL)));                                                        \
    } while (0)
#define DOES_NOTHING(function, ...)                                                                \
    do {                                                                                           \
        try(#function);                                                                            \
        function(__VA_ARGS__);                                                                     \
    } while (0)

static const double xyzr[4] = {0.0, 0.0, 0.0, 1.5};
static const double corners_xyz[9] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0};
static const uint32_t corners[3] = {0, 1, 2};
static const ovoid_ellipsoid one = {.amplitude = 2.0, .decay = {0.5, 0.5, 0.5}};
static const uint8_t pixel[4] = {0, 0, 0, 255};

static int make_subject(void **state) {
    (void)state;
    return ovoid_context_create(&all.context) == OVOID_OK &&
                   ovoid_molecule_create(all.context, xyzr, 1, &all.molecule) == OVOID_OK &&
                   ovoid_model_create(all.context, &one, 1, 0.5, 1.0, &all.model) == OVOID_OK &&
                   ovoid_field_of_model(all.context, all.model, &all.field) == OVOID_OK &&
                   ovoid_mesh_create(all.context, corners_xyz, NULL, 3, corners, 1, &all.mesh) ==
                       OVOID_OK &&
                   ovoid_image_create(all.context, 1, 1, pixel, &all.image) == OVOID_OK
               ? 0
               : -1;
}

static int drop_subject(void **state) {
    (void)state;
    ovoid_image_destroy(&all.image);
    ovoid_mesh_destroy(&all.mesh);
    ovoid_field_destroy(&all.field);
    ovoid_model_destroy(&all.model);
    ovoid_molecule_destroy(&all.molecule);
    ovoid_context_destroy(&all.context);
    return 0;
}

static void contexts_and_devices(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_device_info *devices;
    ovoid_kernel_time *times;
    size_t count;
    try("ovoid_context_create");
    assert_int_equal(ovoid_context_create(NULL), OVOID_ERROR_ARGUMENT);
    try("ovoid_context_error");
    assert_string_equal(ovoid_context_error(NULL), "");
    DOES_NOTHING(ovoid_context_on_warning, NULL, NULL, NULL);
    DOES_NOTHING(ovoid_context_on_progress, NULL, NULL, NULL);
    const size_t size = sizeof *devices;
    REFUSED(ovoid_devices, context, NULL, size, &devices, &count);
    REFUSED(ovoid_devices, devices, c, size, NULL, &count);
    REFUSED(ovoid_devices, count, c, size, &devices, NULL);
    REFUSED(ovoid_context_open_device, context, NULL, "");
    ANSWERS(NULL, ovoid_context_device, NULL);
    ANSWERS(NULL, ovoid_context_device_at, NULL, 0);
    ANSWERS(0, ovoid_context_device_count, NULL);
    ANSWERS(0, ovoid_context_count, NULL, OVOID_COUNT_LAUNCHES);
    size_t many = 7;
    ANSWERS(NULL, ovoid_context_tasks, NULL, &many);
    assert_int_equal(many, 0);
    many = 7;
    ANSWERS(NULL, ovoid_context_rank_times, NULL, &many);
    assert_int_equal(many, 0);
    assert_null(ovoid_context_tasks(all.context, NULL)); /* no fit yet */
    REFUSED(ovoid_context_profile, context, NULL, true);
    REFUSED(ovoid_selftest, context, NULL, NULL, NULL, NULL, NULL);
    DOES_NOTHING(ovoid_selftest_options_init, NULL, sizeof(ovoid_selftest_options));
    DOES_NOTHING(ovoid_selftest_result_init, NULL, sizeof(ovoid_selftest_result));
    REFUSED(ovoid_context_kernel_times, context, NULL, &times, &count);
    REFUSED(ovoid_context_kernel_times, times, c, NULL, &count);
    REFUSED(ovoid_context_kernel_times, count, c, &times, NULL);
}

static void destroyers(void **state) {
    (void)state;
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_field *field = NULL;
    ovoid_mesh *mesh = NULL;
    ovoid_image *image = NULL;
    ovoid_file *file = NULL;
    DOES_NOTHING(ovoid_context_destroy, NULL);
    DOES_NOTHING(ovoid_context_destroy, &context);
    DOES_NOTHING(ovoid_molecule_destroy, NULL);
    DOES_NOTHING(ovoid_molecule_destroy, &molecule);
    DOES_NOTHING(ovoid_model_destroy, NULL);
    DOES_NOTHING(ovoid_model_destroy, &model);
    DOES_NOTHING(ovoid_field_destroy, NULL);
    DOES_NOTHING(ovoid_field_destroy, &field);
    DOES_NOTHING(ovoid_mesh_destroy, NULL);
    DOES_NOTHING(ovoid_mesh_destroy, &mesh);
    DOES_NOTHING(ovoid_image_destroy, NULL);
    DOES_NOTHING(ovoid_image_destroy, &image);
    DOES_NOTHING(ovoid_file_destroy, NULL);
    DOES_NOTHING(ovoid_file_destroy, &file);
    DOES_NOTHING(ovoid_free, NULL);
}

static void defaults(void **state) {
    (void)state;
    DOES_NOTHING(ovoid_read_options_init, NULL, sizeof(ovoid_read_options));
    DOES_NOTHING(ovoid_fit_options_init, NULL, sizeof(ovoid_fit_options));
    DOES_NOTHING(ovoid_mesh_options_init, NULL, sizeof(ovoid_mesh_options));
    DOES_NOTHING(ovoid_fit_result_init, NULL, sizeof(ovoid_fit_result));
    DOES_NOTHING(ovoid_measures_init, NULL, sizeof(ovoid_measures));
    DOES_NOTHING(ovoid_measure_options_init, NULL, sizeof(ovoid_measure_options));
    DOES_NOTHING(ovoid_export_options_init, NULL, sizeof(ovoid_export_options));
    DOES_NOTHING(ovoid_scene_init, NULL, sizeof(ovoid_scene));
    DOES_NOTHING(ovoid_picture_options_init, NULL, sizeof(ovoid_picture_options));
    ANSWERS(0, ovoid_sizeof, NULL);
}

/* Nothing can be NULL in a call of these. */
static void without_pointers(void **state) {
    (void)state;
    try("ovoid_version");
    try("ovoid_abi");
    try("ovoid_status_name");
    try("ovoid_radii_name");
    try("ovoid_export_format_name");
    DOES_NOTHING(ovoid_remove_temporaries, );
    DOES_NOTHING(ovoid_prepare_process, );
}

static void molecules(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_molecule *made;
    size_t count = 7;
    REFUSED(ovoid_molecule_read, context, NULL, "a.pqr", OVOID_MOLECULE_AUTO, &made);
    REFUSED(ovoid_molecule_read, path, c, NULL, OVOID_MOLECULE_AUTO, &made);
    REFUSED(ovoid_molecule_read, molecule, c, "a.pqr", OVOID_MOLECULE_AUTO, NULL);
    REFUSED(ovoid_molecule_read_with, context, NULL, "a.pqr", NULL, &made);
    REFUSED(ovoid_molecule_read_with, path, c, NULL, NULL, &made);
    REFUSED(ovoid_molecule_read_with, molecule, c, "a.pqr", NULL, NULL);
    REFUSED(ovoid_molecule_create, context, NULL, xyzr, 1, &made);
    REFUSED(ovoid_molecule_create, xyzr, c, NULL, 1, &made);
    REFUSED(ovoid_molecule_create, molecule, c, xyzr, 1, NULL);
    const ovoid_atom atom = {.name = "C"};
    const ovoid_residue residue = {.name = "C"};
    const ovoid_radii own = OVOID_RADII_OWN;
#define KNOWN(argument, c, x, a, r, out)                                                           \
    REFUSED(ovoid_molecule_create_known, argument, c, x, a, 1, r, 1, own, NULL, out)
    KNOWN(context, NULL, xyzr, &atom, &residue, &made);
    KNOWN(xyzr, c, NULL, &atom, &residue, &made);
    KNOWN(identity, c, xyzr, NULL, &residue, &made);
    KNOWN(residues, c, xyzr, &atom, NULL, &made);
    KNOWN(molecule, c, xyzr, &atom, &residue, NULL);
#undef KNOWN
    const ovoid_placement place = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const ovoid_unit_part part = {NULL, 1};
#define PLACED(argument, c, x, p, q, out)                                                          \
    REFUSED(ovoid_molecule_create_placed, argument, c, x, 1, p, 1, q, 1, out)
    PLACED(context, NULL, xyzr, &part, &place, &made);
    PLACED(xyzr, c, NULL, &part, &place, &made);
    PLACED(parts, c, xyzr, NULL, &place, &made);
    PLACED(placements, c, xyzr, &part, NULL, &made);
    PLACED(molecule, c, xyzr, &part, &place, NULL);
#undef PLACED
    REFUSED(ovoid_molecule_expand, context, NULL, all.molecule);
    REFUSED(ovoid_molecule_expand, molecule, c, NULL);
    ANSWERS(0, ovoid_molecule_atoms, NULL);
    ANSWERS(NULL, ovoid_molecule_xyzr, NULL);
    try("ovoid_molecule_read_counts");
    assert_null(ovoid_molecule_read_counts(NULL));
    ANSWERS(OVOID_MOLECULE_AUTO, ovoid_molecule_read_format, NULL);
    ANSWERS(OVOID_RADII_DEFAULT, ovoid_molecule_radii, NULL);
    ANSWERS(0, ovoid_molecule_model, NULL);
    ANSWERS(NULL, ovoid_molecule_identity, NULL);
    ANSWERS(NULL, ovoid_molecule_residues, NULL, &count);
    assert_int_equal(count, 0);
    ANSWERS(NULL, ovoid_molecule_residues, all.molecule, NULL);
    ANSWERS(NULL, ovoid_molecule_guesses, NULL, &count);
    ANSWERS(NULL, ovoid_molecule_guesses, all.molecule, NULL);
    ANSWERS(NULL, ovoid_molecule_models, NULL, &count);
    assert_non_null(ovoid_molecule_models(all.molecule, NULL));
    ANSWERS(NULL, ovoid_molecule_assemblies, NULL, &count);
    ANSWERS(NULL, ovoid_molecule_assemblies, all.molecule, NULL);
    ANSWERS(NULL, ovoid_molecule_placements, NULL, &count);
    ANSWERS(NULL, ovoid_molecule_placements, all.molecule, NULL);
    ANSWERS(NULL, ovoid_molecule_part, NULL, 0, &count);
    ANSWERS(NULL, ovoid_molecule_part, all.molecule, 0, NULL);
    ANSWERS(0, ovoid_molecule_unit_atoms, NULL);
    ANSWERS(NULL, ovoid_molecule_unit_xyzr, NULL);
    ANSWERS(0, ovoid_molecule_origin, NULL, 3, &count);
    ANSWERS(0, ovoid_molecule_origin, all.molecule, 0, NULL);
}

static void files(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_file *file = NULL;
    char *folder = NULL;
    REFUSED(ovoid_file_check, context, NULL, "-");
    REFUSED(ovoid_file_check, path, c, NULL);
    REFUSED(ovoid_file_folder, context, NULL, "-", &folder);
    REFUSED(ovoid_file_folder, path, c, NULL, &folder);
    REFUSED(ovoid_file_folder, folder, c, "-", NULL);
    REFUSED(ovoid_file_create, context, NULL, "-", &file);
    REFUSED(ovoid_file_create, path, c, NULL, &file);
    REFUSED(ovoid_file_create, file, c, "-", NULL);
    test_check(c, ovoid_file_create(c, "/dev/null", &file));
    REFUSED(ovoid_file_write, context, NULL, file, "a", 1);
    REFUSED(ovoid_file_write, file, c, NULL, "a", 1);
    REFUSED(ovoid_file_write, data, c, file, NULL, 1);
    REFUSED(ovoid_file_commit, context, NULL, file);
    REFUSED(ovoid_file_commit, file, c, NULL);
    ovoid_file_destroy(&file);
}

static void fitters(const ovoid_fit_options *options) {
    ovoid_context *const c = all.context;
    ovoid_fitter *fitter = NULL;
    ovoid_model *made = NULL;
    const double xyz[3] = {0.0, 0.0, 0.0};
    REFUSED(ovoid_fitter_create, context, NULL, all.molecule, options, &fitter);
    REFUSED(ovoid_fitter_create, molecule, c, NULL, options, &fitter);
    REFUSED(ovoid_fitter_create, options, c, all.molecule, NULL, &fitter);
    REFUSED(ovoid_fitter_create, fitter, c, all.molecule, options, NULL);
    test_check(c, ovoid_fitter_create(c, all.molecule, options, &fitter));
    REFUSED(ovoid_fitter_reach, context, NULL, fitter, options, &made, NULL);
    REFUSED(ovoid_fitter_reach, fitter, c, NULL, options, &made, NULL);
    REFUSED(ovoid_fitter_reach, options, c, fitter, NULL, &made, NULL);
    REFUSED(ovoid_fitter_reach, model, c, fitter, options, NULL, NULL);
    REFUSED(ovoid_fitter_start_from, context, NULL, fitter, all.model);
    REFUSED(ovoid_fitter_start_from, fitter, c, NULL, all.model);
    test_check(c, ovoid_fitter_start_from(c, fitter, NULL)); /* the atoms */
    REFUSED(ovoid_fitter_move, context, NULL, fitter, xyz);
    REFUSED(ovoid_fitter_move, fitter, c, NULL, xyz);
    REFUSED(ovoid_fitter_move, xyz, c, fitter, NULL);
    ovoid_fitter_destroy(&fitter);
    DOES_NOTHING(ovoid_fitter_destroy, &fitter);
    DOES_NOTHING(ovoid_fitter_destroy, NULL);
}

static void fields_and_models(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_model *made;
    ovoid_fit_options options;
    double value;
    ovoid_fit_options_init(&options, sizeof options);
    const ovoid_motion motion = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    size_t count;
    ovoid_field *field;
    REFUSED(ovoid_field_of_molecule, context, NULL, all.molecule, 0.5, 1.0, &field);
    REFUSED(ovoid_field_of_molecule, molecule, c, NULL, 0.5, 1.0, &field);
    REFUSED(ovoid_field_of_molecule, field, c, all.molecule, 0.5, 1.0, NULL);
    REFUSED(ovoid_field_of_model, context, NULL, all.model, &field);
    REFUSED(ovoid_field_of_model, model, c, NULL, &field);
    REFUSED(ovoid_field_of_model, field, c, all.model, NULL);
    REFUSED(ovoid_field_evaluate, context, NULL, all.field, xyzr, 1, &value, NULL);
    REFUSED(ovoid_field_evaluate, field, c, NULL, xyzr, 1, &value, NULL);
    REFUSED(ovoid_field_evaluate, xyz, c, all.field, NULL, 1, &value, NULL);
    REFUSED(ovoid_field_evaluate, value, c, all.field, xyzr, 1, NULL, NULL);
    ANSWERS(0, ovoid_field_terms, NULL);
    UNKNOWN(ovoid_field_decay);
    UNKNOWN(ovoid_field_isovalue);
    REFUSED(ovoid_model_create, context, NULL, &one, 1, 0.5, 1.0, &made);
    REFUSED(ovoid_model_create, ellipsoids, c, NULL, 1, 0.5, 1.0, &made);
    REFUSED(ovoid_model_create, model, c, &one, 1, 0.5, 1.0, NULL);
    REFUSED(ovoid_model_create_placed, context, NULL, &one, 1, &motion, 1, 0.5, 1.0, &made);
    REFUSED(ovoid_model_create_placed, ellipsoids, c, NULL, 1, &motion, 1, 0.5, 1.0, &made);
    REFUSED(ovoid_model_create_placed, placements, c, &one, 1, NULL, 1, 0.5, 1.0, &made);
    REFUSED(ovoid_model_create_placed, model, c, &one, 1, &motion, 1, 0.5, 1.0, NULL);
    REFUSED(ovoid_model_expand, context, NULL, all.model, &made);
    REFUSED(ovoid_model_expand, model, c, NULL, &made);
    REFUSED(ovoid_model_expand, expanded, c, all.model, NULL);
    ANSWERS(0, ovoid_model_unit_size, NULL);
    ANSWERS(NULL, ovoid_model_unit_ellipsoids, NULL);
    ANSWERS(NULL, ovoid_model_placements, NULL, &count);
    ANSWERS(NULL, ovoid_model_placements, all.model, NULL);
    ANSWERS(0, ovoid_model_size, NULL);
    ANSWERS(NULL, ovoid_model_ellipsoids, NULL);
    UNKNOWN(ovoid_model_decay);
    UNKNOWN(ovoid_model_isovalue);
    ANSWERS(NULL, ovoid_model_owner, NULL);
    ANSWERS(0, ovoid_model_owner_count, NULL);
    ANSWERS(NULL, ovoid_model_note, NULL, 0);
    REFUSED(ovoid_model_annotate, context, NULL, all.model, "a", "b");
    REFUSED(ovoid_model_annotate, model, c, NULL, "a", "b");
    REFUSED(ovoid_model_annotate, key, c, all.model, NULL, "b");
    REFUSED(ovoid_model_annotate, value, c, all.model, "a", NULL);
    REFUSED(ovoid_model_read, context, NULL, "a.ovoid", &made);
    REFUSED(ovoid_model_read, path, c, NULL, &made);
    REFUSED(ovoid_model_read, model, c, "a.ovoid", NULL);
    REFUSED(ovoid_model_write, context, NULL, all.model, "/dev/null");
    REFUSED(ovoid_model_write, model, c, NULL, "/dev/null");
    REFUSED(ovoid_model_write, path, c, all.model, NULL);
    fitters(&options);
    REFUSED(ovoid_fit, context, NULL, all.molecule, &options, &made, NULL);
    REFUSED(ovoid_fit, molecule, c, NULL, &options, &made, NULL);
    REFUSED(ovoid_fit, options, c, all.molecule, NULL, &made, NULL);
    REFUSED(ovoid_fit, model, c, all.molecule, &options, NULL, NULL);
}

/* Handles that are never looked at: another argument is NULL. */
static void opencl(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    cl_context const h = (cl_context)(void *)&all;
    cl_device_id const d = (cl_device_id)(void *)&all;
    cl_command_queue const q = (cl_command_queue)(void *)&all;
    cl_mem const m = (cl_mem)(void *)&all;
    REFUSED(ovoid_context_open_opencl, context, NULL, h, d, q);
    REFUSED(ovoid_context_open_opencl, opencl, c, NULL, d, q);
    REFUSED(ovoid_context_open_opencl, device, c, h, NULL, q);
    REFUSED(ovoid_context_open_opencl, queue, c, h, d, NULL);
    REFUSED(ovoid_field_evaluate_opencl, context, NULL, all.field, xyzr, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_opencl, field, c, NULL, xyzr, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_opencl, xyz, c, all.field, NULL, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_opencl, value, c, all.field, xyzr, 1, NULL, NULL);
    REFUSED(ovoid_field_evaluate_buffer, context, NULL, all.field, m, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_buffer, field, c, NULL, m, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_buffer, xyz, c, all.field, NULL, 1, m, NULL);
    REFUSED(ovoid_field_evaluate_buffer, value, c, all.field, m, 1, NULL, NULL);
}

static void meshes(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_mesh *made;
    ovoid_mesh_options options;
    ovoid_measure_options measuring;
    ovoid_measures measures;
    ovoid_distances distances;
    const double *const xyz = corners_xyz;
    ovoid_mesh_options_init(&options, sizeof options);
    ovoid_measure_options_init(&measuring, sizeof measuring);
    REFUSED(ovoid_field_mesh, context, NULL, all.field, &options, &made);
    REFUSED(ovoid_field_mesh, field, c, NULL, &options, &made);
    REFUSED(ovoid_field_mesh, options, c, all.field, NULL, &made);
    REFUSED(ovoid_field_mesh, mesh, c, all.field, &options, NULL);
    REFUSED(ovoid_mesh_create, context, NULL, xyz, NULL, 3, corners, 1, &made);
    REFUSED(ovoid_mesh_create, xyz, c, NULL, NULL, 3, corners, 1, &made);
    REFUSED(ovoid_mesh_create, corners, c, xyz, NULL, 3, NULL, 1, &made);
    REFUSED(ovoid_mesh_create, mesh, c, xyz, NULL, 3, corners, 1, NULL);
    ANSWERS(0, ovoid_mesh_vertices, NULL);
    ANSWERS(0, ovoid_mesh_triangles, NULL);
    ANSWERS(NULL, ovoid_mesh_xyz, NULL);
    ANSWERS(NULL, ovoid_mesh_normals, NULL);
    ANSWERS(NULL, ovoid_mesh_corners, NULL);
    ANSWERS(NULL, ovoid_mesh_component_of, NULL);
    ANSWERS(0, ovoid_mesh_components, NULL);
    ANSWERS(NULL, ovoid_mesh_component, NULL, 0);
    UNKNOWN(ovoid_mesh_area);
    UNKNOWN(ovoid_mesh_volume);
    UNKNOWN(ovoid_mesh_smooth_area);
    UNKNOWN(ovoid_mesh_smooth_volume);
    REFUSED(ovoid_mesh_write, context, NULL, all.mesh, "a.ply");
    REFUSED(ovoid_mesh_write, mesh, c, NULL, "a.ply");
    REFUSED(ovoid_mesh_write, path, c, all.mesh, NULL);
    REFUSED(ovoid_mesh_distances, context, NULL, all.mesh, all.mesh, false, &distances, NULL);
    REFUSED(ovoid_mesh_distances, a, c, NULL, all.mesh, false, &distances, NULL);
    REFUSED(ovoid_mesh_distances, b, c, all.mesh, NULL, false, &distances, NULL);
    REFUSED(ovoid_mesh_distances, distances, c, all.mesh, all.mesh, false, NULL, NULL);
    REFUSED(ovoid_measure, context, NULL, all.field, all.field, &measuring, &measures);
    REFUSED(ovoid_measure, original, c, NULL, all.field, &measuring, &measures);
    REFUSED(ovoid_measure, sparse, c, all.field, NULL, &measuring, &measures);
    REFUSED(ovoid_measure, options, c, all.field, all.field, NULL, &measures);
    REFUSED(ovoid_measure, measures, c, all.field, all.field, &measuring, NULL);
}

static void exports_and_pictures(void **state) {
    (void)state;
    ovoid_context *const c = all.context;
    ovoid_image *made;
    ovoid_picture_options options;
    const uint8_t *const pixels = pixel;
    ovoid_picture_options_init(&options, sizeof options);
    REFUSED(ovoid_field_export, context, NULL, all.field, "a.bild", NULL);
    REFUSED(ovoid_field_export, field, c, NULL, "a.bild", NULL);
    REFUSED(ovoid_field_export, path, c, all.field, NULL, NULL);
    ovoid_scene scene;
    ovoid_scene_init(&scene, sizeof scene);
    REFUSED(ovoid_scene_export, context, NULL, &scene, "a.bild", NULL);
    REFUSED(ovoid_scene_export, scene, c, NULL, "a.bild", NULL);
    REFUSED(ovoid_scene_export, path, c, &scene, NULL, NULL);
    ANSWERS(OVOID_EXPORT_AUTO, ovoid_export_format_find, NULL);
    REFUSED(ovoid_render, context, NULL, all.field, all.field, &options, &made);
    REFUSED(ovoid_render, options, c, all.field, all.field, NULL, &made);
    REFUSED(ovoid_render, image, c, all.field, all.field, &options, NULL);
    REFUSED(ovoid_render, original, c, NULL, all.field, &options, &made);
    options.view = OVOID_VIEW_MODEL;
    REFUSED(ovoid_render, model, c, all.field, NULL, &options, &made);
    REFUSED(ovoid_image_create, context, NULL, 1, 1, pixels, &made);
    REFUSED(ovoid_image_create, pixels, c, 1, 1, NULL, &made);
    REFUSED(ovoid_image_create, image, c, 1, 1, pixels, NULL);
    ANSWERS(0, ovoid_image_width, NULL);
    ANSWERS(0, ovoid_image_height, NULL);
    ANSWERS(NULL, ovoid_image_pixels, NULL);
    ANSWERS(0, ovoid_image_covered, NULL);
    UNKNOWN(ovoid_image_range);
    ANSWERS(0, ovoid_image_radii, NULL, NULL);
    ANSWERS(0, ovoid_image_radii, all.image, NULL);
    REFUSED(ovoid_image_write, context, NULL, all.image, "/dev/null");
    REFUSED(ovoid_image_write, image, c, NULL, "/dev/null");
    REFUSED(ovoid_image_write, path, c, all.image, NULL);
}

/* ---- all of them? ------------------------------------------------------------------------- */

static bool was_tried(const char *name, size_t length) {
    for (size_t i = 0; i < all.count; ++i)
        if (strlen(all.tried[i]) == length && strncmp(all.tried[i], name, length) == 0)
            return true;
    return false;
}

/* A declaration is "OVOID_API type name(", maybe in several lines. */
static size_t check_header(const char *path) {
    static char text[1 << 18];
    size_t found = 0;
    FILE *const file = fopen(path, "r");
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    assert_true(strlen(text) < sizeof text - 1);
    fclose(file);
    for (const char *at = text; (at = strstr(at, "\nOVOID_API ")) != NULL; ++found) {
        const char *const end = at += strcspn(at, "("), *begin = end;
        while (isalnum((unsigned char)begin[-1]) || begin[-1] == '_')
            --begin;
        if (!was_tried(begin, (size_t)(end - begin)))
            fail_msg("no test gives NULL to %.*s()", (int)(end - begin), begin);
    }
    return found;
}

/* tests/project/symbols.sh sees to it that what is declared is what is exported. */
static void no_function_is_left_out(void **state) {
    (void)state;
    static const char *const headers[] = {"context", "export",   "field",   "file",
                                          "fit",     "fitter",   "measure", "mesh",
                                          "model",   "molecule", "opencl",  "picture"};
    size_t found = 0;
    for (size_t i = 0; i < sizeof headers / sizeof *headers; ++i) {
        char path[4096];
        snprintf(path, sizeof path, OVOID_HEADERS "/%s.h", headers[i]);
        found += check_header(path);
    }
    print_message("%zu functions\n", found);
    assert_true(found > 80);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(contexts_and_devices),
        cmocka_unit_test(destroyers),
        cmocka_unit_test(defaults),
        cmocka_unit_test(without_pointers),
        cmocka_unit_test(molecules),
        cmocka_unit_test(files),
        cmocka_unit_test(fields_and_models),
        cmocka_unit_test(opencl),
        cmocka_unit_test(meshes),
        cmocka_unit_test(exports_and_pictures),
        cmocka_unit_test(no_function_is_left_out),
    };
    return cmocka_run_group_tests(tests, make_subject, drop_subject);
}
