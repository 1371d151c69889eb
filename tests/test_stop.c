/*
 * Stopping each long public function at each of the questions that it asks, or at many of them: it
 * ends with OVOID_ERROR_CANCELLED, does not ask again, leaves its outputs as they were (but for
 * fits, which hand over what they have) and no file behind, and the context is fit for what comes
 * next. What it had allocated is freed: the preset 'sanitize' tells.
 */
#include "scratch.h"
#include "support.h"

#include "ovoid/ovoid.h"

enum { ATOMS = 12, POINTS = 40 };

typedef struct subject {
    scratch *place;
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_mesh *mesh, *other;
    ovoid_image *image;
    char molecule_file[512], model_file[512];
} subject;

static subject s;

/* ---- what is stopped ------------------------------------------------------------------------ */

/* A function tells its status, and fails the test if it has touched an output when it was stopped.
 */
typedef ovoid_status (*work)(void);

static void *const nothing = &s;

#define MAKES(type, made, destroy, call)                                                           \
    do {                                                                                           \
        type *made = nothing;                                                                      \
        const ovoid_status status = (call);                                                        \
        if (status == OVOID_OK)                                                                    \
            destroy(&made);                                                                        \
        else                                                                                       \
            assert_ptr_equal(made, nothing);                                                       \
        return status;                                                                             \
    } while (0)

static ovoid_status open_device(void) {
    return ovoid_context_open_device(s.context, NULL);
}

static ovoid_status read_molecule(void) {
    MAKES(ovoid_molecule, m, ovoid_molecule_destroy,
          ovoid_molecule_read(s.context, s.molecule_file, OVOID_MOLECULE_AUTO, &m));
}

static ovoid_status read_model(void) {
    MAKES(ovoid_model, m, ovoid_model_destroy, ovoid_model_read(s.context, s.model_file, &m));
}

static ovoid_status fit(ovoid_method method) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.method = method;
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids = 4;
    options.adaptive.steps = 3;
    options.l1.iterations = 6;
    options.l1.sparse_iterations = 3;
    ovoid_model *m = nothing; /* a fit that is stopped has a model or none: test_fitter.c */
    const ovoid_status status = ovoid_fit(s.context, s.molecule, &options, &m, NULL);
    assert_true(m != nothing && (m || status == OVOID_ERROR_CANCELLED));
    ovoid_model_destroy(&m);
    return status;
}

static ovoid_status fit_adaptive(void) {
    return fit(OVOID_METHOD_ADAPTIVE);
}

static ovoid_status fit_l1(void) {
    return fit(OVOID_METHOD_L1);
}

static ovoid_status mesh_molecule(void) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    MAKES(ovoid_mesh, m, ovoid_mesh_destroy,
          once_molecule_mesh(s.context, s.molecule, 0.5, &options, &m));
}

static ovoid_status mesh_model(void) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    MAKES(ovoid_mesh, m, ovoid_mesh_destroy, once_model_mesh(s.context, s.model, &options, &m));
}

static ovoid_status make_mesh(void) {
    MAKES(ovoid_mesh, m, ovoid_mesh_destroy,
          ovoid_mesh_create(s.context, ovoid_mesh_xyz(s.mesh), NULL, ovoid_mesh_vertices(s.mesh),
                            ovoid_mesh_corners(s.mesh), ovoid_mesh_triangles(s.mesh), &m));
}

#define UNTOUCHED(before, after)                                                                   \
    do {                                                                                           \
        if (status != OVOID_OK)                                                                    \
            assert_memory_equal(&(before), &(after), sizeof(after));                               \
        return status;                                                                             \
    } while (0)

static ovoid_status measure_distances(void) {
    struct {
        ovoid_distances all;
        float of_vertices[1 << 14];
    } before, after;
    assert_true(ovoid_mesh_vertices(s.mesh) <= 1 << 14);
    memset(&before, 0x5a, sizeof before);
    after = before;
    const ovoid_status status =
        ovoid_mesh_distances(s.context, s.mesh, s.other, true, &after.all, after.of_vertices);
    UNTOUCHED(before, after);
}

static ovoid_status measure(void) {
    ovoid_measure_options options;
    ovoid_measures before, after;
    memset(&before, 0x5a, sizeof before);
    before.size = sizeof before;
    memcpy(&after, &before, sizeof after);
    ovoid_measure_options_init(&options, sizeof options);
    const ovoid_status status = once_measure(s.context, s.molecule, s.model, &options, &after);
    UNTOUCHED(before, after);
}

static ovoid_status field(bool of_model) {
    double xyz[3 * POINTS];
    struct {
        double value[POINTS], gradient[3 * POINTS];
    } before, after;
    for (int k = 0; k < 3 * POINTS; ++k)
        xyz[k] = 0.1 * k;
    memset(&before, 0x5a, sizeof before);
    after = before;
    const ovoid_status status =
        of_model ? once_model_field(s.context, s.model, xyz, POINTS, after.value, after.gradient)
                 : once_molecule_field(s.context, s.molecule, 0.5, xyz, POINTS, after.value,
                                       after.gradient);
    UNTOUCHED(before, after);
}

static ovoid_status molecule_field(void) {
    return field(false);
}

static ovoid_status model_field(void) {
    return field(true);
}

static ovoid_status render(ovoid_view view) {
    ovoid_picture_options options;
    ovoid_picture_options_init(&options, sizeof options);
    options.view = view;
    options.width = 60;
    options.height = 30;
    MAKES(ovoid_image, image, ovoid_image_destroy,
          once_render(s.context, s.molecule, 0.5, s.model, &options, &image));
}

static ovoid_status render_panel(void) {
    return render(OVOID_VIEW_PANEL);
}

static ovoid_status render_difference(void) {
    return render(OVOID_VIEW_DIFFERENCE);
}

static ovoid_status render_ellipsoids(void) {
    return render(OVOID_VIEW_ELLIPSOIDS);
}

/* Writes over a file that is there. */
static ovoid_status write_as(const char *name, ovoid_status (*write)(const char *path)) {
    const char *const path = scratch_path(s.place, name);
    scratch_write(path, "old", 3);
    const ovoid_status status = write(path);
    char *const text = scratch_read(path);
    assert_int_equal(strcmp(text, "old") == 0, status != OVOID_OK);
    free(text);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(scratch_entries(s.place), 2); /* what is read from */
    return status;
}

static ovoid_status put_mesh(const char *path) {
    return ovoid_mesh_write(s.context, s.mesh, path);
}
static ovoid_status put_model(const char *path) {
    return ovoid_model_write(s.context, s.model, path);
}
static ovoid_status put_image(const char *path) {
    return ovoid_image_write(s.context, s.image, path);
}
static ovoid_status export_model(const char *path) {
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 1.0;
    return once_model_export(s.context, s.model, path, &options);
}
static ovoid_status export_molecule(const char *path) {
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 1.0;
    return once_molecule_export(s.context, s.molecule, 0.5, path, &options);
}

#define WRITES(function, name, write)                                                              \
    static ovoid_status function(void) {                                                           \
        return write_as(name, write);                                                              \
    }
WRITES(write_ply, "a.ply", put_mesh)
WRITES(write_obj, "a.obj", put_mesh)
WRITES(write_stl, "a.stl", put_mesh)
WRITES(write_off, "a.off", put_mesh)
WRITES(write_glb, "a.glb", put_mesh)
WRITES(write_model, "b.ovoid", put_model)
WRITES(write_png, "a.png", put_image)
WRITES(write_bild, "a.bild", export_model)
WRITES(write_cxc, "a.cxc", export_model)
WRITES(write_pymol, "a.py", export_model)
WRITES(write_gmm, "a.gmm", export_model)
WRITES(write_json, "a.json", export_model)
WRITES(write_ccp4, "a.mrc", export_model)
WRITES(write_dx, "a.dx", export_molecule)

/* `stages` have to be told, in any order; `least` questions have to be asked. */
static const struct {
    const char *name;
    work run;
    const char *stages;
    unsigned least;
} works[] = {
    {"opening a device", open_device, "open", 1},
    {"reading a molecule", read_molecule, "read", 2},
    {"reading a model", read_model, "read", 1},
    {"a fit, adaptive", fit_adaptive, "sample mesh merge refine", 50},
    {"a fit, l1", fit_l1, "sample sparse accuracy", 20},
    {"meshing a molecule", mesh_molecule, "mesh", 5},
    {"meshing a model", mesh_model, "mesh", 5},
    {"a mesh of arrays", make_mesh, "mesh", 3},
    {"distances", measure_distances, "measure", 4},
    {"measures", measure, "mesh measure", 20},
    {"the field of a molecule", molecule_field, "field", 2},
    {"the field of a model", model_field, "field", 2},
    {"a panel", render_panel, "render", 5},
    {"a difference", render_difference, "render", 4},
    {"ellipsoids", render_ellipsoids, "render", 3},
    {"PLY", write_ply, "write", 2},
    {"OBJ", write_obj, "write", 2},
    {"STL", write_stl, "write", 2},
    {"OFF", write_off, "write", 2},
    {"glTF", write_glb, "write", 2},
    {"a model's file", write_model, "write", 2},
    {"PNG", write_png, "write", 2},
    {"BILD", write_bild, "write", 2},
    {"CXC", write_cxc, "write", 2},
    {"PyMOL", write_pymol, "write", 2},
    {"GMM", write_gmm, "write", 2},
    {"JSON", write_json, "write", 2},
    {"CCP4", write_ccp4, "map", 3},
    {"OpenDX", write_dx, "map", 3},
};

/* ---- stopping ----------------------------------------------------------------------------- */

typedef struct watcher {
    unsigned asked, stop_at; /* at this question; 0: never */
    double seconds;
    char stages[256]; /* that were told, with blanks between them */
} watcher;

static bool watch(const ovoid_progress *progress, void *user) {
    watcher *const w = user;
    ++w->asked;
    assert_true(w->stop_at == 0 || w->asked <= w->stop_at); /* nobody is asked again */
    assert_true(progress->seconds >= w->seconds);
    assert_true(progress->total == OVOID_UNKNOWN || progress->done <= progress->total);
    w->seconds = progress->seconds;
    if (!strstr(w->stages, progress->stage)) {
        strcat(w->stages, progress->stage);
        strcat(w->stages, " ");
        assert_true(strlen(w->stages) < 200);
    }
    return w->asked != w->stop_at;
}

static void expect_stages(const watcher *w, const char *stages) {
    char wanted[128];
    snprintf(wanted, sizeof wanted, "%s", stages);
    for (char *one = strtok(wanted, " "); one; one = strtok(NULL, " "))
        if (!strstr(w->stages, one))
            fail_msg("stage %s was not told: %s", one, w->stages);
}

/* Of the questions, all up to some, and then fewer and fewer, and the last ones. */
static unsigned next_question(unsigned n, unsigned all) {
    const unsigned step = n < 16 || n + 8 > all ? 1 : n / 6;
    return n + step > all && n < all ? all : n + step;
}

static void each_question_can_stop(void **state) {
    (void)state;
    for (size_t k = 0; k < sizeof works / sizeof *works; ++k) {
        watcher free_run = {0};
        ovoid_context_on_progress(s.context, watch, &free_run);
        test_check(s.context, works[k].run());
        print_message("%s: %u questions; %s\n", works[k].name, free_run.asked, free_run.stages);
        assert_true(free_run.asked >= works[k].least);
        expect_stages(&free_run, works[k].stages);
        free_run = (watcher){0}; /* again, with kernels compiled */
        test_check(s.context, works[k].run());
        unsigned tried = 0;
        for (unsigned n = 1; n <= free_run.asked; n = next_question(n, free_run.asked), ++tried) {
            watcher w = {.stop_at = n};
            ovoid_context_on_progress(s.context, watch, &w);
            test_refused(s.context, works[k].run(), OVOID_ERROR_CANCELLED, "stopped");
            assert_int_equal(w.asked, n);
        }
        assert_true(tried >= 1);
        ovoid_context_on_progress(s.context, NULL, NULL);
        test_check(s.context, works[k].run()); /* the context is fit for the next one */
    }
}

static int make_subject(void **state) {
    static double xyzr[4 * ATOMS];
    ovoid_mesh_options meshing;
    ovoid_fit_options fitting;
    ovoid_picture_options picture;
    if (scratch_setup(state) != 0)
        return -1;
    s.place = *state;
    for (int i = 0; i < ATOMS; ++i) {
        const double atom[4] = {3.0 * cos(i), 3.0 * sin(i), 0.8 * i, 1.5};
        memcpy(xyzr + 4 * i, atom, sizeof atom);
    }
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    ovoid_fit_options_init(&fitting, sizeof fitting);
    ovoid_picture_options_init(&picture, sizeof picture);
    picture.width = picture.height = 20;
    fitting.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    fitting.adaptive.ellipsoids = 4;
    if (ovoid_context_create(&s.context) != OVOID_OK)
        return -1;
    test_check(s.context, ovoid_molecule_create(s.context, xyzr, ATOMS, &s.molecule));
    test_check(s.context, ovoid_fit(s.context, s.molecule, &fitting, &s.model, NULL));
    test_check(s.context, once_molecule_mesh(s.context, s.molecule, 0.5, &meshing, &s.mesh));
    test_check(s.context, once_model_mesh(s.context, s.model, &meshing, &s.other));
    test_check(s.context, once_render(s.context, s.molecule, 0.5, NULL, &picture, &s.image));
    snprintf(s.model_file, sizeof s.model_file, "%s", scratch_path(s.place, "model.ovoid"));
    snprintf(s.molecule_file, sizeof s.molecule_file, "%s", scratch_path(s.place, "m.xyzr"));
    test_check(s.context, ovoid_model_write(s.context, s.model, s.model_file));
    FILE *const file = fopen(s.molecule_file, "w");
    assert_non_null(file);
    for (int i = 0; i < ATOMS; ++i)
        fprintf(file, "%.4f %.4f %.4f %.4f\n", xyzr[4 * i], xyzr[4 * i + 1], xyzr[4 * i + 2],
                xyzr[4 * i + 3]);
    return fclose(file);
}

static int drop_subject(void **state) {
    ovoid_image_destroy(&s.image);
    ovoid_mesh_destroy(&s.mesh);
    ovoid_mesh_destroy(&s.other);
    ovoid_model_destroy(&s.model);
    ovoid_molecule_destroy(&s.molecule);
    ovoid_context_destroy(&s.context);
    return scratch_teardown(state);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_question_can_stop),
    };
    return cmocka_run_group_tests(tests, make_subject, drop_subject);
}
