#include "measures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct mesh_job {
    const char *input;
    const char *output;
    char *default_output; /* owned, output may point to it */
    char *folder;         /* of large arrays, owned */
    const char *device;   /* NULL: the default */
    bool quiet, decay_given, isovalue_given;
    reading reading;
    double decay; /* of molecules */
    ovoid_mesh_options options;
    FILE *summary; /* NULL: none */
    ovoid_context *context;
    source source;
    ovoid_mesh *mesh;
    double area, volume;
    double started, mesh_seconds;
} mesh_job;

static const cli_number numbers[] = {
    {"spacing", CLI_REAL, offsetof(mesh_job, options.spacing), 0, 1e3, true, false, "Å",
     "distance of the lattice points between which the surface is found"},
    {"isovalue", CLI_REAL, offsetof(mesh_job, options.isovalue), 0, 1e6, true, false, "",
     "the surface is where the field has this value c; a model brings its own"},
    {"decay", CLI_REAL, offsetof(mesh_job, decay), 0, 100, true, false, "Å⁻²",
     "of a molecule: decay rate d of the atoms' Gaussians"},
};
enum { NUMBER_COUNT = sizeof numbers / sizeof *numbers };

static void set_defaults(mesh_job *job) {
    ovoid_mesh_options_init(&job->options, sizeof job->options);
    job->options.isovalue = OVOID_DEFAULT_ISOVALUE;
    job->decay = OVOID_DEFAULT_DECAY;
}

void cli_mesh_help(FILE *stream) {
    mesh_job defaults = {0};
    set_defaults(&defaults);
    fputs(
        "Usage: ovoid mesh INPUT [OPTION]...\n"
        "\n"
        "Writes the surface of a molecule or of a model as a closed triangle mesh, made by\n"
        "marching cubes, with normals from the field's gradient. INPUT is a molecule (PDB,\n"
        "mmCIF, PQR or XYZR, also compressed with gzip), a model that 'ovoid fit' wrote, or -\n"
        "for standard input.\n"
        "\n"
        "Files:\n"
        "  -o, --output FILE   where the mesh goes; its name ends in .ply (binary), .obj, .stl\n"
        "                      (binary), .off or .glb (binary glTF) (default: the name of the\n"
        "                      input with the extension .ply, in the current folder)\n"
        "\n"
        "The file appears whole at the end or not at all; one that exists is replaced. Arrays of\n"
        "a large mesh are in files without a name in its folder on the way.\n",
        stream);
    reading_help(stream, true);
    fputs("\n"
          "Running:\n" CLI_HELP_RUNNING "\n"
          "The surface:\n",
          stream);
    for (size_t i = 0; i < NUMBER_COUNT; i++)
        cli_number_help(&numbers[i], &defaults, stream);
    fprintf(stream,
            "  --vertices exact|linear\n"
            "                          exact: on the surface; linear: where the field,\n"
            "                          interpolated linearly between lattice points, has the\n"
            "                          isovalue, as isosurface programs do (default %s)\n"
            "\n"
            "Examples:\n"
            "  ovoid mesh molecule.pqr -o molecule.ply\n"
            "  ovoid mesh molecule.ovoid -o model.glb --spacing 0.3\n"
            "\n",
            measures_vertices_name(defaults.options.vertices));
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

static bool is_mesh_name(const char *path) {
    static const char *const extensions[] = {".ply", ".obj", ".stl", ".off", ".glb"};
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < sizeof extensions / sizeof *extensions; i++)
        if (strcasecmp(dot, extensions[i]) == 0)
            return true;
    cli_error(
        "'%s' does not say how to write a mesh: its name has to end in .ply, .obj, .stl, .off "
        "or .glb",
        path);
    return false;
}

static bool complete(int argc, char **argv, mesh_job *job) {
    if (optind == argc) {
        cli_error("which surface? Name a molecule or a model: ovoid mesh INPUT (see 'ovoid mesh "
                  "--help')");
        return false;
    }
    if (optind + 1 < argc) {
        cli_error("one surface at a time, but '%s' follows '%s' (see 'ovoid mesh --help')",
                  argv[optind + 1], argv[optind]);
        return false;
    }
    job->input = argv[optind];
    if (!job->output && strcmp(job->input, "-") == 0) {
        cli_error("a surface from standard input has no name: name the mesh's file with -o");
        return false;
    }
    if (!job->output)
        job->output = job->default_output = source_output(job->input, ".ply");
    if (!job->output) {
        cli_error("out of memory");
        return false;
    }
    if (strcmp(job->input, "-") != 0 && cli_same_file(job->input, job->output)) {
        cli_error("the input and the mesh (-o) are the same file '%s'", job->output);
        return false;
    }
    return is_mesh_name(job->output);
}

static bool parse(int argc, char **argv, mesh_job *job, int *code) {
    enum { OUTPUT = 256, DEVICE, VERTICES, QUIET, HELP, NUMBERS };
    static const struct option options[] = {{"output", required_argument, NULL, OUTPUT},
                                            {"device", required_argument, NULL, DEVICE},
                                            READING_OPTIONS,
                                            {"vertices", required_argument, NULL, VERTICES},
                                            {"quiet", no_argument, NULL, QUIET},
                                            {"help", no_argument, NULL, HELP},
                                            {"spacing", required_argument, NULL, NUMBERS},
                                            {"isovalue", required_argument, NULL, NUMBERS + 1},
                                            {"decay", required_argument, NULL, NUMBERS + 2},
                                            {NULL, 0, NULL, 0}};
    bool good = true;
    int option;
    set_defaults(job);
    reading_init(&job->reading, true);
    opterr = 0;
    *code = CLI_USAGE;
    while (good && (option = getopt_long(argc, argv, ":o:qh", options, NULL)) != -1) {
        if (reading_has(option)) {
            good = reading_parse(&job->reading, option, optarg);
            continue;
        }
        switch (option) {
        case 'o':
        case OUTPUT:
            job->output = optarg;
            break;
        case DEVICE:
            job->device = optarg;
            break;
        case VERTICES:
            good = measures_parse_vertices(optarg, &job->options.vertices);
            break;
        case 'q':
        case QUIET:
            job->quiet = true;
            break;
        case 'h':
        case HELP:
            cli_mesh_help(stdout);
            *code = CLI_OK;
            return false;
        default:
            if (option < NUMBERS) {
                *code = cli_bad_option("mesh", option, argv, options);
                return false;
            }
            good = cli_number_parse(&numbers[option - NUMBERS], optarg, job);
            job->isovalue_given |= option == NUMBERS + 1;
            job->decay_given |= option == NUMBERS + 2;
        }
    }
    return good && complete(argc, argv, job);
}

static void print_before(const mesh_job *job) {
    if (!job->summary)
        return;
    cli_progress_erase();
    if (job->source.model) {
        source_print_model(job->source.model, job->input, job->summary);
        putc('\n', job->summary);
    } else {
        reading_print(&job->reading, job->summary, job->input, job->source.molecule);
    }
    if (job->source.molecule)
        fprintf(job->summary, "field     decay %.9g Å⁻²\n", job->decay);
    cli_print_device(job->context, job->summary);
    fflush(job->summary);
}

static void print_after(const mesh_job *job) {
    FILE *out = job->summary;
    size_t outer = 0, components = ovoid_mesh_components(job->mesh);
    if (!out)
        return;
    cli_progress_erase();
    for (size_t c = 0; c < components; c++)
        outer += ovoid_mesh_component(job->mesh, c)->outer;
    fprintf(out, "surface   isovalue %.9g: %zu piece%s, %zu of them outer\n", job->options.isovalue,
            components, components == 1 ? "" : "s", outer);
    fprintf(out, "mesh      %zu vertices, %zu triangles, spacing %.9g Å, %s vertices\n",
            ovoid_mesh_vertices(job->mesh), ovoid_mesh_triangles(job->mesh), job->options.spacing,
            measures_vertices_name(job->options.vertices));
    fprintf(out, "area      %.6g Å²\n", job->area);
    fprintf(out, "volume    %.6g Å³\n", job->volume);
    fprintf(out, "time      %.2f s: mesh %.2f\n", cli_seconds() - job->started, job->mesh_seconds);
    fprintf(out, "mesh      written to %s\n", job->output);
}

/* Before the mesh is written: a signal that came while these were computed would find its file. */
static void measure_mesh(mesh_job *job) {
    const bool exact = job->options.vertices == OVOID_VERTEX_EXACT;
    if (!job->summary)
        return;
    job->area = exact ? ovoid_mesh_smooth_area(job->mesh) : ovoid_mesh_area(job->mesh);
    job->volume = exact ? ovoid_mesh_smooth_volume(job->mesh) : ovoid_mesh_volume(job->mesh);
}

/* Of what was read only the field is kept. */
static ovoid_status make_mesh(mesh_job *job) {
    const double begin = cli_seconds();
    ovoid_status status =
        source_field(job->context, &job->source, job->decay, job->options.isovalue);
    ovoid_molecule_destroy(&job->source.molecule);
    ovoid_model_destroy(&job->source.model);
    if (status == OVOID_OK)
        status = ovoid_field_mesh(job->context, job->source.field, &job->options, &job->mesh);
    job->mesh_seconds = cli_seconds() - begin;
    return status;
}

static int run(mesh_job *job) {
    if (reading_lists(&job->reading))
        return reading_list(&job->reading, job->context, job->input);
    ovoid_status status = ovoid_file_check(job->context, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    status = source_read(job->context, job->input, &job->reading, &job->source);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (job->source.model && job->decay_given) {
        cli_error("--decay is for molecules, but '%s' is a model", job->input);
        return CLI_USAGE;
    }
    if (job->source.model && !reading_check_model(&job->reading, job->input))
        return CLI_USAGE;
    if (job->source.model && !job->isovalue_given)
        job->options.isovalue = ovoid_model_isovalue(job->source.model);
    if ((status = cli_open_device(job->context, job->device, job->quiet)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    print_before(job);
    status = ovoid_file_folder(job->context, job->output, &job->folder);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    job->options.folder = job->folder;
    if ((status = make_mesh(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    measure_mesh(job);
    if ((status = ovoid_mesh_write(job->context, job->mesh, job->output)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    print_after(job);
    return CLI_OK;
}

int cli_mesh(int argc, char **argv) {
    mesh_job job = {.started = cli_seconds()};
    int code;
    if (parse(argc, argv, &job, &code)) {
        job.summary = job.quiet ? NULL : stdout;
        if (cli_context(&job.quiet, &job.context, &code))
            code = run(&job);
    }
    ovoid_mesh_destroy(&job.mesh);
    source_destroy(&job.source);
    ovoid_context_destroy(&job.context);
    ovoid_free(job.folder);
    free(job.default_output);
    return code;
}
