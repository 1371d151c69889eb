/*
 * OpenCL calls, and allocations, that a piece of work makes fail in turn: by themselves, or with
 * all that follow. The work then ends with the right code and a message that names the call, or
 * does without it and gives the very same result; its outputs are as they were; afterwards the same
 * context does the work as if nothing had been; and nothing is left over, neither OpenCL objects
 * nor memory.
 *
 * OVOID_FAULTS=1 takes every call by itself, and does the work again after two in ten, which takes
 * minutes for the fits; a larger number, each of so many (bench/results/faults.csv). Without it,
 * all of few fail, and of many one of each function's by itself, and some with all that follow.
 * OVOID_FAULTS_WORK="fit by l1" takes the works alone whose names begin so.
 */
#include "base/store.h"
#include "faults.h"
#include "once.h"
#include "scratch.h"
#include "support.h"

#include <sys/stat.h>

enum { ATOMS = 4, POINTS = 20, WIDTH = 40, HEIGHT = 16, NAMES = 40, FOLLOWERS = 10, FEW = 50 };

static struct {
    scratch *place;
    ovoid_context *context; /* of what follows, without a device */
    ovoid_molecule *molecule;
    ovoid_model *model;
    char molecule_file[512], structure_file[512], map_file[512], mesh_file[512];
    char page_file[512], print_file[512], ihm_file[512];
} input;

/* What a piece of work gives. */
typedef struct outcome {
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_mesh *mesh;
    ovoid_image *image;
    ovoid_kernel_time *times;
    size_t times_count;
    ovoid_fit_result fit;
    ovoid_measures measures;
    double value[POINTS], gradient[3 * POINTS];
} outcome;

typedef struct work {
    const char *name;
    ovoid_status (*run)(ovoid_context *, outcome *);
    const char *file; /* that it writes; NULL: none */
    bool host;        /* needs no device */
} work;

/* ---- the work ----------------------------------------------------------------------------- */

static ovoid_status read_pqr(ovoid_context *context, outcome *o) {
    return ovoid_molecule_read(context, input.molecule_file, OVOID_MOLECULE_AUTO, &o->molecule);
}

static ovoid_status read_structure(ovoid_context *context, outcome *o) {
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.select = "//*/(GLY,ALA,SER,THR,LEU,ILE)/N,CA,C,O";
    return ovoid_molecule_read_with(context, input.structure_file, &options, &o->molecule);
}

static ovoid_fit_options fit_options(ovoid_method method, ovoid_goal goal) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.method = method;
    options.spacing = 1.0;
    options.padding = 2.0;
    options.adaptive.goal = goal;
    options.adaptive.ellipsoids = 2;
    options.adaptive.tolerance = 0.8;
    options.adaptive.steps = 2;
    options.adaptive.mesh_spacing = 1.0;
    options.l1.iterations = 6;
    options.l1.sparse_iterations = 3;
    options.l1.prune_every = 2;
    return options;
}

static ovoid_status fit_adaptive(ovoid_context *context, outcome *o) {
    const ovoid_fit_options options = fit_options(OVOID_METHOD_ADAPTIVE, OVOID_GOAL_ELLIPSOIDS);
    return ovoid_fit(context, input.molecule, &options, &o->model, &o->fit);
}

static ovoid_status fit_tolerance(ovoid_context *context, outcome *o) {
    const ovoid_fit_options options = fit_options(OVOID_METHOD_ADAPTIVE, OVOID_GOAL_TOLERANCE);
    return ovoid_fit(context, input.molecule, &options, &o->model, &o->fit);
}

static ovoid_status fit_l1(ovoid_context *context, outcome *o) {
    const ovoid_fit_options options = fit_options(OVOID_METHOD_L1, OVOID_GOAL_ELLIPSOIDS);
    return ovoid_fit(context, input.molecule, &options, &o->model, &o->fit);
}

static ovoid_status make_mesh(ovoid_context *context, outcome *o) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = 1.0;
    return once_molecule_mesh(context, input.molecule, 0.5, &options, &o->mesh);
}

/* All of its arrays are in files. */
static ovoid_status make_mesh_in_files(ovoid_context *context, outcome *o) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = 1.0;
    options.folder = input.place->folder;
    ov_store_limit(1);
    const ovoid_status status =
        once_molecule_mesh(context, input.molecule, 0.5, &options, &o->mesh);
    ov_store_limit(0);
    return status;
}

static ovoid_status write_mesh(ovoid_context *context, outcome *o) {
    const ovoid_status status = make_mesh(context, o);
    return status == OVOID_OK ? ovoid_mesh_write(context, o->mesh, input.mesh_file) : status;
}

static ovoid_status measure(ovoid_context *context, outcome *o) {
    ovoid_measure_options options;
    ovoid_measure_options_init(&options, sizeof options);
    options.spacing = 1.0;
    return once_measure(context, input.molecule, input.model, &options, &o->measures);
}

static ovoid_status take_picture(ovoid_context *context, outcome *o) {
    ovoid_picture_options options;
    ovoid_picture_options_init(&options, sizeof options);
    options.view = OVOID_VIEW_PANEL;
    options.width = WIDTH;
    options.height = HEIGHT;
    options.samples = 1;
    return once_render(context, input.molecule, 0.5, input.model, &options, &o->image);
}

static ovoid_status take_difference(ovoid_context *context, outcome *o) {
    ovoid_picture_options options;
    ovoid_picture_options_init(&options, sizeof options);
    options.view = OVOID_VIEW_DIFFERENCE;
    options.width = WIDTH;
    options.height = HEIGHT;
    options.samples = 1;
    return once_render(context, input.molecule, 0.5, input.model, &options, &o->image);
}

static ovoid_status evaluate(ovoid_context *context, outcome *o) {
    double xyz[3 * POINTS];
    for (size_t j = 0; j < 3 * POINTS; ++j)
        xyz[j] = (double)(7 * j % 11) * 0.5 - 2.0;
    return once_molecule_field(context, input.molecule, 0.5, xyz, POINTS, o->value, o->gradient);
}

static ovoid_status write_map(ovoid_context *context, outcome *o) {
    ovoid_export_options options;
    ovoid_export_options_init(&options, sizeof options);
    options.spacing = 2.0;
    (void)o;
    return once_model_export(context, input.model, input.map_file, &options);
}

static ovoid_status write_scene(ovoid_context *context, const char *path) {
    ovoid_export_options options;
    ovoid_scene scene;
    ovoid_export_options_init(&options, sizeof options);
    ovoid_scene_init(&scene, sizeof scene);
    options.spacing = 2.0;
    scene.molecule = input.molecule;
    scene.models = (const ovoid_model *const *)&input.model;
    scene.model_count = 1;
    return ovoid_scene_export(context, &scene, path, &options);
}

static ovoid_status write_page(ovoid_context *context, outcome *o) {
    (void)o;
    return write_scene(context, input.page_file);
}

static ovoid_status write_print(ovoid_context *context, outcome *o) {
    (void)o;
    return write_scene(context, input.print_file);
}

static ovoid_status write_ihm(ovoid_context *context, outcome *o) {
    (void)o;
    return write_scene(context, input.ihm_file);
}

/* Times of kernels are those of the day: only who was launched is compared. */
static ovoid_status take_times(ovoid_context *context, outcome *o) {
    ovoid_status status = ovoid_context_profile(context, true);
    if (status == OVOID_OK)
        status = evaluate(context, o);
    if (status == OVOID_OK)
        status = ovoid_context_kernel_times(context, &o->times, &o->times_count);
    return status;
}

static const work works[] = {
    {"read PQR", read_pqr, NULL, true},
    {"read mmCIF", read_structure, NULL, true},
    {"field", evaluate, NULL, false},
    {"field, with times", take_times, NULL, false},
    {"map", write_map, input.map_file, false},
    {"mesh in files", make_mesh_in_files, NULL, false},
    {"mesh file", write_mesh, input.mesh_file, false},
    {"page", write_page, input.page_file, false},
    {"print", write_print, input.print_file, false},
    {"IHMCIF", write_ihm, input.ihm_file, true},
    {"measure", measure, NULL, false},
    {"picture", take_picture, NULL, false},
    {"difference", take_difference, NULL, false},
    {"fit of a number", fit_adaptive, NULL, false},
    {"fit to a tolerance", fit_tolerance, NULL, false},
    {"fit by l1", fit_l1, NULL, false},
};
enum { WORKS = sizeof works / sizeof *works };

/* ---- what comes of it --------------------------------------------------------------------- */

static void begin(outcome *o) {
    memset(o, 0, sizeof *o);
    ovoid_fit_result_init(&o->fit, sizeof o->fit);
    ovoid_measures_init(&o->measures, sizeof o->measures);
}

static void release(outcome *o) {
    ovoid_molecule_destroy(&o->molecule);
    ovoid_model_destroy(&o->model);
    ovoid_mesh_destroy(&o->mesh);
    ovoid_image_destroy(&o->image);
    ovoid_free(o->times);
    begin(o);
}

static bool is_untouched(const outcome *o) {
    outcome nothing;
    begin(&nothing);
    return memcmp(o, &nothing, sizeof nothing) == 0;
}

static uint64_t add(uint64_t hash, const void *data, size_t bytes) {
    for (size_t i = 0; i < bytes; ++i) /* FNV-1a */
        hash = (hash ^ ((const unsigned char *)data)[i]) * 0x100000001b3u;
    return hash;
}

/* A number that stands for all that was found, times aside. */
static uint64_t digest(const outcome *o, const char *file) {
    uint64_t hash = 0xcbf29ce484222325u;
    ovoid_fit_result fit = o->fit;
    ovoid_measures measures = o->measures;
    fit.sample_seconds = fit.fit_seconds = fit.l1.lists_seconds = fit.l1.field_seconds =
        fit.l1.moments_seconds = fit.l1.host_seconds = 0.0;
    memset(fit.counts, 0, sizeof fit.counts); /* a context makes some things only once */
    measures.seconds_mesh = measures.seconds_distances = 0.0;
    hash = add(hash, &fit, sizeof fit);
    hash = add(hash, &measures, sizeof measures);
    hash = add(hash, o->value, sizeof o->value);
    hash = add(hash, o->gradient, sizeof o->gradient);
    if (o->molecule)
        hash = add(hash, ovoid_molecule_xyzr(o->molecule),
                   4 * ovoid_molecule_atoms(o->molecule) * sizeof(double));
    if (o->model)
        hash = add(hash, ovoid_model_ellipsoids(o->model),
                   ovoid_model_size(o->model) * sizeof(ovoid_ellipsoid));
    if (o->mesh) {
        hash =
            add(hash, ovoid_mesh_xyz(o->mesh), 3 * ovoid_mesh_vertices(o->mesh) * sizeof(double));
        hash = add(hash, ovoid_mesh_corners(o->mesh),
                   3 * ovoid_mesh_triangles(o->mesh) * sizeof(uint32_t));
    }
    if (o->image)
        hash = add(hash, ovoid_image_pixels(o->image), 4 * (size_t)WIDTH * HEIGHT);
    for (size_t k = 0; k < o->times_count; ++k) {
        hash = add(hash, o->times[k].name, strlen(o->times[k].name));
        hash = add(hash, &o->times[k].launches, sizeof o->times[k].launches);
    }
    char *const text = file ? scratch_read(file) : NULL;
    struct stat info;
    if (text && stat(file, &info) == 0)
        hash = add(hash, text, (size_t)info.st_size);
    free(text);
    return hash;
}

/* ---- one failure -------------------------------------------------------------------------- */

static char warnings[1 << 14];

static void keep_warning(const char *message, void *user) {
    (void)user;
    snprintf(warnings + strlen(warnings), sizeof warnings - strlen(warnings), "%s\n", message);
}

typedef struct tally {
    size_t calls, failed, refused, harmless;
} tally;

/* Where the failure is of no consequence, the result is the same; else the code is that of the
 * failure, and the message or a warning names the call. */
static void judge(const work *w, fault_kind kind, size_t at, ovoid_context *context,
                  ovoid_status status, const outcome *o, uint64_t wanted, tally *t) {
    const char *const message = ovoid_context_error(context);
    const char *const told = faults_named(message), *const call = told ? told : faults_first();
    struct stat info;
    if (status == OVOID_OK) {
        ++t->harmless;
        if (digest(o, w->file) != wanted)
            fail_msg("%s: another result after %s, call %zu, failed", w->name, call, at);
        if (strncmp(call, "clEnqueue", 9) == 0) /* its work is lost, even if nobody misses it */
            fail_msg("%s: nothing is said of %s, call %zu, that failed", w->name, call, at);
        return;
    }
    ++t->refused;
    if (w->file && stat(w->file, &info) == 0)
        fail_msg("%s: a file is left after %s, call %zu, failed", w->name, call, at);
    if (w->file && scratch_entries(input.place) != 2)
        fail_msg("%s: a temporary file is left after %s, call %zu, failed", w->name, call, at);
    const bool memory = kind != FAULT_OPENCL || faults_code() == CL_OUT_OF_HOST_MEMORY ||
                        strcmp(call, "clCreateBuffer") == 0;
    const bool listed = status == OVOID_ERROR_DEVICE && faults_named(warnings); /* left out */
    const ovoid_status right = memory ? OVOID_ERROR_MEMORY : OVOID_ERROR_OPENCL;
    if (status != right && !listed)
        fail_msg("%s: %s, call %zu, failed: %s, \"%s\"", w->name, call, at,
                 ovoid_status_name(status), message);
    if (!listed && (kind == FAULT_OPENCL ? !told : !strstr(message, "out of memory")))
        fail_msg("%s: %s, call %zu, failed: \"%s\"", w->name, call, at, message);
}

/* The work in a context of its own; its call number `at` fails, and with `on` all that follow. Then
 * the work `again`, as if nothing had been. Returns the number of calls. */
static size_t try_failure(const work *w, fault_kind kind, size_t at, bool on, bool again,
                          uint64_t *wanted, tally *t) {
    ovoid_context *context = NULL;
    outcome o;
    const long objects = faults_objects(), allocations = faults_allocations();
    begin(&o);
    warnings[0] = '\0';
    if (w->file)
        unlink(w->file);
    test_check(NULL, ovoid_context_create(&context));
    ovoid_context_on_warning(context, keep_warning, NULL);
    faults_arm(kind, at, on);
    ovoid_status status = w->host ? OVOID_OK : ovoid_context_open_device(context, NULL);
    if (status == OVOID_OK)
        status = w->run(context, &o);
    const size_t calls = faults_disarm();
    if (at == 0) {
        test_check(context, status);
        *wanted = digest(&o, w->file);
    } else {
        if (!faults_first())
            fail_msg("%s makes %zu calls, not as many as before", w->name, calls);
        ++t->failed;
        judge(w, kind, at, context, status, &o, *wanted, t);
        if (status != OVOID_OK && w->run != write_mesh && w->run != take_times)
            assert_true(is_untouched(&o)); /* those have two steps and two outputs */
        release(&o);
        if (again) {
            test_check(context, w->run(context, &o));
            if (w->run != take_times && digest(&o, w->file) != *wanted)
                fail_msg("%s: another result on a context whose call %zu failed", w->name, at);
        }
    }
    release(&o);
    ovoid_context_destroy(&context);
    if (w->file)
        unlink(w->file);
    if (faults_objects() != objects || faults_allocations() != allocations)
        fail_msg("%s: %ld OpenCL objects and %ld allocations are left over after %s, call %zu%s",
                 w->name, faults_objects() - objects, faults_allocations() - allocations,
                 at ? faults_first() : "nothing", at, on ? " and all after it, failed" : "");
    return calls;
}

/* ---- all of them -------------------------------------------------------------------------- */

/* The middle one of the calls with the name of call `at`, if that is the first of them; else 0. */
static size_t middle_of_name(size_t at) {
    const char *const name = faults_call(at);
    size_t count = 0, middle = 0;
    for (size_t k = 1; k < at; ++k)
        if (strcmp(faults_call(k), name) == 0)
            return 0;
    for (size_t k = at; faults_call(k); ++k)
        count += strcmp(faults_call(k), name) == 0;
    for (size_t k = at, n = 0; middle == 0; ++k)
        if (strcmp(faults_call(k), name) == 0 && n++ == count / 2)
            middle = k;
    return middle;
}

/* The calls that fail by themselves in a short run: one of each name, in the order of the first
 * ones. Returns how many. */
static size_t choose_calls(size_t chosen[NAMES]) {
    size_t count = 0;
    for (size_t at = 1; faults_call(at) && count < NAMES; ++at) {
        const size_t middle = middle_of_name(at);
        if (middle > 0)
            chosen[count++] = middle;
    }
    return count;
}

/* Every `step`-th call; in each tenth case with all that follow, too. */
static void try_every(const work *w, fault_kind kind, size_t step, uint64_t *wanted, tally *t) {
    for (size_t at = 1, n = 1; at <= t->calls; at += step, ++n) {
        try_failure(w, kind, at, false, n % 10 == 5, wanted, t);
        if (n % 10 == 0)
            try_failure(w, kind, at, true, true, wanted, t);
    }
}

/* The calls after some of those that leave an event behind, spread over all of them: who fails
 * there has something under way. */
static size_t choose_followers(size_t chosen[FOLLOWERS]) {
    size_t all = 0, count = 0, n = 0;
    for (size_t at = 1; faults_call(at + 1); ++at)
        all += strstr(faults_call(at), "with an event") != NULL;
    for (size_t at = 1; faults_call(at + 1); ++at)
        if (strstr(faults_call(at), "with an event") && n++ % (all / FOLLOWERS + 1) == 0)
            chosen[count++] = at + 1;
    return count;
}

static void try_some(const work *w, fault_kind kind, size_t few, uint64_t *wanted, tally *t) {
    size_t chosen[NAMES], after[FOLLOWERS];
    const size_t names = choose_calls(chosen), step = t->calls / few + 1;
    const size_t followers = choose_followers(after);
    for (size_t n = 0; n < followers; ++n)
        try_failure(w, kind, after[n], false, false, wanted, t);
    for (size_t n = 0; n < names; ++n)
        try_failure(w, kind, chosen[n], false, n % 2 == 0, wanted, t);
    for (size_t at = 1 + step / 2; at <= t->calls; at += step)
        try_failure(w, kind, at, true, true, wanted, t);
}

static void try_all(fault_kind kind, const char *what, size_t few) {
    const char *const wish = getenv("OVOID_FAULTS");
    const char *const only = getenv("OVOID_FAULTS_WORK");
    const size_t step = wish ? strtoul(wish, NULL, 10) : 0;
    for (const work *w = works; w < works + WORKS; ++w) {
        tally t = {0};
        uint64_t wanted = 0;
        if (only && strncmp(w->name, only, strlen(only)) != 0)
            continue;
        if ((kind == FAULT_OPENCL && w->host) || (kind == FAULT_NEW && w->run != read_structure))
            continue;
        try_failure(w, kind, 0, false, false, &wanted, &t); /* what happens once in a process */
        t.calls = try_failure(w, kind, 0, false, false, &wanted, &t);
        if (step > 0 || t.calls <= FEW)
            try_every(w, kind, step > 0 ? step : 1, &wanted, &t);
        else
            try_some(w, kind, few, &wanted, &t);
        print_message("%s%s,%s,%zu,%zu,%zu,%zu\n", step > 0 ? "CSV: " : "", w->name, what, t.calls,
                      t.failed, t.refused, t.harmless);
        if (t.calls == 0)
            fail_msg("%s: nothing could fail", w->name);
        assert_int_equal(t.failed, t.refused + t.harmless);
    }
}

static void opencl_calls(void **state) {
    (void)state;
    try_all(FAULT_OPENCL, "OpenCL", test_size(4, 2));
}

static void allocations(void **state) {
    (void)state;
    try_all(FAULT_MEMORY, "memory", test_size(4, 2));
}

static void allocations_of_cpp(void **state) {
    (void)state;
    try_all(FAULT_NEW, "new", 10);
}

/* ---- input -------------------------------------------------------------------------------- */

static const double atoms[4 * ATOMS] = {
    10.0, -5.0, 3.0, 1.7, 11.2, -4.3, 3.5, 1.2, 9.1, -4.2, 2.4, 1.55, 12.8, -5.4, 4.4, 1.5,
};

static void write_inputs(void) {
    char text[2048] = "", cif[4096] = "data_small\nloop_\n_atom_site.group_PDB\n_atom_site.id\n"
                                      "_atom_site.type_symbol\n_atom_site.label_atom_id\n"
                                      "_atom_site.label_alt_id\n_atom_site.label_comp_id\n"
                                      "_atom_site.label_asym_id\n_atom_site.label_seq_id\n"
                                      "_atom_site.Cartn_x\n_atom_site.Cartn_y\n"
                                      "_atom_site.Cartn_z\n_atom_site.occupancy\n";
    static const char *const names[ATOMS] = {"N", "CA", "C", "O"};
    for (int i = 0; i < ATOMS; ++i) {
        const double *const a = atoms + 4 * i;
        sprintf(text + strlen(text), "ATOM %d %s GLY 1 %g %g %g 0.0 %g\n", i + 1, names[i], a[0],
                a[1], a[2], a[3]);
        sprintf(cif + strlen(cif), "ATOM %d %c %s . GLY A 1 %g %g %g 1.0\n", i + 1, names[i][0],
                names[i], a[0], a[1], a[2]);
    }
    snprintf(input.molecule_file, 512, "%s", scratch_path(input.place, "small.pqr"));
    snprintf(input.structure_file, 512, "%s", scratch_path(input.place, "small.cif"));
    snprintf(input.map_file, 512, "%s", scratch_path(input.place, "small.mrc"));
    snprintf(input.mesh_file, 512, "%s", scratch_path(input.place, "small.ply"));
    snprintf(input.page_file, 512, "%s", scratch_path(input.place, "small.html"));
    snprintf(input.print_file, 512, "%s", scratch_path(input.place, "small.3mf"));
    snprintf(input.ihm_file, 512, "%s", scratch_path(input.place, "model.cif"));
    scratch_write(input.molecule_file, text, strlen(text));
    scratch_write(input.structure_file, cif, strlen(cif));
}

static int set_up(void **state) {
    (void)state;
    void *place;
    if (scratch_setup(&place) != 0)
        return -1;
    input.place = place;
    write_inputs();
    const ovoid_ellipsoid ellipsoids[2] = {
        {3.0, {0.5, 0.6, 0.4}, {10.1, -4.6, 3.0}, {0.1, 0.2, 0.3}},
        {2.0, {0.4, 0.6, 0.5}, {12.0, -5.0, 4.0}, {0.3, 0.2, 0.1}},
    };
    test_check(NULL, ovoid_context_create(&input.context));
    test_check(input.context, ovoid_molecule_create(input.context, atoms, ATOMS, &input.molecule));
    test_check(input.context,
               ovoid_model_create(input.context, ellipsoids, 2, 0.5, 1.0, &input.model));
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    void *place = input.place;
    ovoid_molecule_destroy(&input.molecule);
    ovoid_model_destroy(&input.model);
    ovoid_context_destroy(&input.context);
    return scratch_teardown(&place);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opencl_calls),
        cmocka_unit_test(allocations),
        cmocka_unit_test(allocations_of_cpp),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
