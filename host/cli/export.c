#include "measures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct export_numbers {
    double decay; /* 0: the model's, or the default */
    ovoid_export_options options;
} export_numbers;

#define REAL(name, member, low, above, high, unit, help)                                           \
    { name, CLI_REAL, offsetof(export_numbers, member), low, high, above, false, unit, help }

static const cli_number numbers[] = {
    REAL("isovalue", options.isovalue, 0, false, 1e6, "",
         "ellipsoids are drawn where their own Gaussian has this value, and maps reach to a "
         "hundredth of it; 0 takes the model's, or 1 for a molecule"),
    REAL("opacity", options.opacity, 0, false, 1, "", "of drawn ellipsoids, 0 to 1"),
    REAL("spacing", options.spacing, 0, true, 1e3, "Å",
         "of a map's points, and of the lattice on which surfaces are meshed"),
    REAL("max-gigabytes", options.max_gigabytes, 0, true, 1e6, "GB",
         "a map that would take more is refused"),
    REAL("range", options.range, 0, false, 1e6, "Å",
         "distance at which the colours of a difference end; 0 stands for what 99 % of the surface "
         "stays within"),
    REAL("max-triangles", options.max_triangles, 1, false, 1e9, "",
         "of a surface in a page: where it would have more, the spacing becomes larger"),
    REAL("decay", decay, 0, true, 100, "Å⁻²",
         "decay rate d of the atoms' Gaussians, for a molecule; with a model, its own value is the "
         "default"),
};
enum { NUMBER_COUNT = sizeof numbers / sizeof *numbers };

/* Values of the long options; those of the numbers follow. */
enum { OUTPUT = 256, AS, COLOUR, COLOUR_BY, DEVICE, QUIET, HELP, NUMBERS };

static const struct option named[] = {
    {"output", required_argument, NULL, OUTPUT},
    {"as", required_argument, NULL, AS},
    READING_OPTIONS,
    {"colour", required_argument, NULL, COLOUR},
    {"color", required_argument, NULL, COLOUR},
    {"colour-by", required_argument, NULL, COLOUR_BY},
    {"color-by", required_argument, NULL, COLOUR_BY},
    {"device", required_argument, NULL, DEVICE},
    {"quiet", no_argument, NULL, QUIET},
    {"help", no_argument, NULL, HELP},
};
enum { NAMED_COUNT = sizeof named / sizeof *named };

typedef struct export_job {
    char **inputs; /* a molecule or none, and then models */
    size_t input_count;
    const char *output;
    const char *device; /* NULL: the default */
    bool quiet;
    reading reading;
    export_numbers numbers;
    ovoid_context *context;
    ovoid_molecule *molecule; /* NULL: none */
    ovoid_model **models;     /* owned, room for input_count */
    size_t model_count;
} export_job;

/* Formats by their names, in the order of ovoid_export_format, with this between them. */
static void list_formats(char *text, size_t size, const char *between, const char *last) {
    const char *name;
    size_t used = 0;
    text[0] = '\0';
    for (int i = OVOID_EXPORT_AUTO + 1; (name = ovoid_export_format_name(i)) != NULL; i++) {
        const bool end = ovoid_export_format_name(i + 1) == NULL;
        used += (size_t)snprintf(text + used, used < size ? size - used : 0, "%s%s",
                                 used == 0 ? ""
                                 : end     ? last
                                           : between,
                                 name);
    }
}

/* Formats of what is computed on the device. */
static bool needs_device(ovoid_export_format format) {
    return format == OVOID_EXPORT_CCP4 || format == OVOID_EXPORT_DX ||
           format == OVOID_EXPORT_HTML || format >= OVOID_EXPORT_PLY;
}

/* Models that a format takes beside a molecule; 0: it takes one input alone. */
static size_t models_beside(ovoid_export_format format) {
    switch (format) {
    case OVOID_EXPORT_HTML:
        return SIZE_MAX - 1;
    case OVOID_EXPORT_IHM:
    case OVOID_EXPORT_PLY:
    case OVOID_EXPORT_GLB:
    case OVOID_EXPORT_3MF:
        return 1;
    default:
        return 0;
    }
}

void cli_export_help(FILE *stream) {
    export_numbers defaults = {.decay = OVOID_DEFAULT_DECAY};
    char formats[256];
    ovoid_export_options_init(&defaults.options, sizeof defaults.options);
    list_formats(formats, sizeof formats, "|", "|");
    fputs(
        "Usage: ovoid export INPUT -o FILE [OPTION]...\n"
        "       ovoid export MOLECULE MODEL... -o FILE [OPTION]...\n"
        "\n"
        "Writes a model for another program, the field of a model or a molecule as a density\n"
        "map, or both as a page for a browser. INPUT is a model as 'ovoid fit' writes it, or for\n"
        "maps and pages also a molecule (PDB, mmCIF, PQR or XYZR); - is standard input, and a\n"
        "model unless --format says otherwise. Several models are levels of detail of the same\n"
        "molecule, the finest first.\n"
        "\n"
        "The extension of FILE says what is written:\n"
        "  .bild .bld        ellipsoids for ChimeraX, in one object (as bild)\n"
        "  .cxc              ellipsoids for ChimeraX, smoother, each of its own (as cxc)\n"
        "  .py               ellipsoids for PyMOL, a script to run in it (as pymol)\n"
        "  .gmm              the Gaussian mixture of gmconvert and gmfit (as gmm)\n"
        "  .json             the model with axes and semi-axes, for scripts (as json)\n"
        "  .xyz .extxyz      ellipsoids for OVITO, extended XYZ with semi-axes and orientations "
        "(as\n"
        "                    xyz)\n"
        "  .lmp .data        ellipsoids for LAMMPS, data of atom style ellipsoid (as lammps)\n"
        "  .pdb .ent         ellipsoids as pseudo-atoms with ANISOU, for Mol*, ChimeraX and PyMOL\n"
        "                    (as anisou)\n"
        "  .gltf             Gaussian splats, glTF with KHR_gaussian_splatting (as splat)\n"
        "  .cif .mmcif       Gaussians in IHMCIF, the PDB's format of integrative models; with\n"
        "                    MOLECULE and MODEL each says what residues it stands for (as ihm)\n"
        "  .mrc .map .ccp4   density map, MRC2014, 32-bit floats (as ccp4)\n"
        "  .dx               density map, OpenDX text as APBS writes it (as dx)\n"
        "  .ply .glb         the molecule's surface with colours, or a model's, as a mesh (as ply, "
        "glb);\n"
        "                    'ovoid mesh' writes it without\n"
        "  .3mf              the same for 3D printers, 1 Å as 1 mm (as 3mf)\n"
        "  .vert             the molecule's surface as MSMS writes it, with the nearest atom of "
        "each\n"
        "                    vertex, and beside it .face with the triangles (as msms)\n"
        "  .html .htm        a page for a browser, in which the surfaces of molecule and model,\n"
        "                    their difference and the ellipsoids can be turned; one file without\n"
        "                    network access (as html)\n"
        "\n"
        "Files:\n"
        "  -o, --output FILE   where it goes, - for standard output\n",
        stream);
    fprintf(stream,
            "  --as %s\n"
            "                      what to write when the extension does not say; where it says\n"
            "                      something else, nothing is written\n",
            formats);
    reading_help(stream, true);
    fputs("\n"
          "Running:\n"
          "  --device SELECTOR   the device that computes maps and surfaces, see 'ovoid devices'\n"
          "  -q, --quiet         print errors only\n"
          "  -h, --help          show this help\n"
          "\n"
          "What is written:\n",
          stream);
    for (size_t i = 0; i < NUMBER_COUNT; i++)
        cli_number_help(&numbers[i], &defaults, stream);
    fprintf(
        stream,
        "  --colour RRGGBB         of drawn ellipsoids, six hexadecimal digits (default "
        "%02lx%02lx%02lx)\n"
        "  --colour-by difference|chain|residue|ellipsoid|none\n"
        "                          what colours of surfaces stand for: how far outside (red) or\n"
        "                          inside (blue) it the model's surface lies, or the nearest "
        "atom's\n"
        "                          chain, residue, or ellipsoid (default: the difference with a\n"
        "                          molecule and a model, else none)\n"
        "\n"
        "An ellipsoid that nowhere reaches the isovalue is drawn where it has half its height.\n"
        "\n"
        "Examples:\n"
        "  ovoid export model.ovoid -o model.cxc                 then open it in ChimeraX\n"
        "  ovoid export model.ovoid -o model.py --opacity 0.5    then run it in PyMOL\n"
        "  ovoid export molecule.pqr -o field.mrc --spacing 0.4\n"
        "  ovoid export molecule.pdb -o surface.glb --colour-by chain\n"
        "  ovoid export molecule.pqr model.ovoid -o view.html    then open it in a browser\n"
        "  ovoid export model.ovoid -o - --as json | jq .ellipsoids[0]\n"
        "\n",
        lround(255.0 * defaults.options.colour[0]), lround(255.0 * defaults.options.colour[1]),
        lround(255.0 * defaults.options.colour[2]));
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

/* ---- options ------------------------------------------------------------------------------ */

static void say_formats(const char *text) {
    char formats[256];
    list_formats(formats, sizeof formats, ", ", " or ");
    cli_error("--as takes %s, not '%s'", formats, text);
}

static bool parse_as(const char *text, ovoid_export_format *format) {
    *format = ovoid_export_format_find(text);
    if (*format == OVOID_EXPORT_AUTO)
        say_formats(text);
    return *format != OVOID_EXPORT_AUTO;
}

static bool parse_colouring(const char *text, ovoid_colouring *colouring) {
    static const char *const names[] = {"none", "difference", "chain", "residue", "ellipsoid"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(text, names[i]) == 0) {
            *colouring = (ovoid_colouring)(OVOID_COLOUR_PLAIN + i);
            return true;
        }
    cli_error("--colour-by takes difference, chain, residue, ellipsoid or none, not '%s'", text);
    return false;
}

static bool parse_colour(const char *text, double colour[3]) {
    const char *digits = text[0] == '#' ? text + 1 : text;
    if (strlen(digits) != 6 || strspn(digits, "0123456789abcdefABCDEF") != 6) {
        cli_error("--colour takes six hexadecimal digits such as 4d8ccc, not '%s'", text);
        return false;
    }
    unsigned long value = strtoul(digits, NULL, 16);
    for (int i = 0; i < 3; i++)
        colour[i] = (double)(value >> (16 - 8 * i) & 0xff) / 255.0;
    return true;
}

static ovoid_export_format format_of(const export_job *job) {
    if (job->numbers.options.format != OVOID_EXPORT_AUTO)
        return job->numbers.options.format;
    const char *dot = strrchr(job->output, '.');
    return dot ? ovoid_export_format_find(dot) : OVOID_EXPORT_AUTO;
}

static bool check_inputs(const export_job *job) {
    size_t streams = 0;
    for (size_t i = 0; i < job->input_count; i++) {
        const bool stream = strcmp(job->inputs[i], "-") == 0;
        streams += stream;
        if (!stream && cli_same_file(job->inputs[i], job->output)) {
            cli_error("the input and the output (-o) are the same file '%s'", job->output);
            return false;
        }
    }
    if (streams > 1)
        cli_error("only one input can come from standard input");
    return streams <= 1;
}

static bool check_count(const export_job *job) {
    const size_t beside = models_beside(format_of(job));
    const bool molecule = !reading_is_model(&job->reading, job->inputs[0]);
    const size_t most = molecule ? beside + 1 : beside > 1 ? SIZE_MAX : 1;
    if (job->input_count <= most)
        return true;
    cli_error("%s at a time, but '%s' follows '%s' (see 'ovoid export --help')",
              most > 1 ? "a molecule and one model" : "one input", job->inputs[most],
              job->inputs[most - 1]);
    return false;
}

static bool complete(int argc, char **argv, export_job *job) {
    if (optind == argc) {
        cli_error("which model? Name its file: ovoid export INPUT -o FILE "
                  "(see 'ovoid export --help')");
        return false;
    }
    if (!job->output) {
        cli_error("where to? Name the file with -o, its extension says what is written "
                  "(see 'ovoid export --help')");
        return false;
    }
    job->inputs = argv + optind;
    job->input_count = (size_t)(argc - optind);
    return check_count(job) && check_inputs(job);
}

static bool parse_option(int option, export_job *job) {
    ovoid_export_options *options = &job->numbers.options;
    switch (option) {
    case 'o':
    case OUTPUT:
        job->output = optarg;
        return true;
    case AS:
        return parse_as(optarg, &options->format);
    case COLOUR:
        return parse_colour(optarg, options->colour);
    case COLOUR_BY:
        return parse_colouring(optarg, &options->colouring);
    case DEVICE:
        job->device = optarg;
        return true;
    case 'q':
    case QUIET:
        job->quiet = true;
        return true;
    default:
        return cli_number_parse(&numbers[option - NUMBERS], optarg, &job->numbers);
    }
}

/* Fills in the job from the command line. False: the program ends with *code, all said. */
static bool parse(int argc, char **argv, export_job *job, int *code) {
    struct option all[NAMED_COUNT + NUMBER_COUNT + 1];
    int option;
    memcpy(all, named, sizeof named);
    cli_number_options(numbers, NUMBER_COUNT, NUMBERS, all + NAMED_COUNT);
    ovoid_export_options_init(&job->numbers.options, sizeof job->numbers.options);
    reading_init(&job->reading, true);
    opterr = 0;
    *code = CLI_USAGE;
    while ((option = getopt_long(argc, argv, ":o:qh", all, NULL)) != -1) {
        if (option == 'h' || option == HELP) {
            cli_export_help(stdout);
            *code = CLI_OK;
            return false;
        }
        if (option == '?' || option == ':') {
            *code = cli_bad_option("export", option, argv, all);
            return false;
        }
        if (reading_has(option) ? !reading_parse(&job->reading, option, optarg)
                                : !parse_option(option, job))
            return false;
    }
    return complete(argc, argv, job);
}

/* ---- work --------------------------------------------------------------------------------- */

static void print_summary(const export_job *job) {
    if (job->quiet || strcmp(job->output, "-") == 0)
        return;
    cli_progress_erase();
    printf("%s: ", source_name(job->inputs[0]));
    if (job->molecule)
        printf("%zu atoms, ", ovoid_molecule_atoms(job->molecule));
    for (size_t i = 0; i < job->model_count; i++)
        printf("%s%zu%s", i ? " / " : "", ovoid_model_size(job->models[i]),
               i + 1 == job->model_count ? " ellipsoids, " : "");
    printf("written to %s as %s\n", job->output, ovoid_export_format_name(format_of(job)));
}

/* The first input may be a molecule, the others are models. */
static ovoid_status read_inputs(export_job *job) {
    ovoid_status status = OVOID_OK;
    const size_t first = reading_is_model(&job->reading, job->inputs[0]) ? 0 : 1;
    job->models = calloc(job->input_count, sizeof *job->models);
    if (!job->models)
        return OVOID_ERROR_MEMORY;
    if (first == 1)
        status = reading_molecule(&job->reading, job->context, job->inputs[0], &job->molecule);
    for (size_t i = first; i < job->input_count && status == OVOID_OK; i++) {
        status = ovoid_model_read(job->context, job->inputs[i], &job->models[job->model_count]);
        job->model_count += status == OVOID_OK;
    }
    return status;
}

static ovoid_status write_output(export_job *job) {
    ovoid_scene scene;
    ovoid_scene_init(&scene, sizeof scene);
    scene.molecule = job->molecule;
    scene.models = (const ovoid_model *const *)job->models;
    scene.model_count = job->model_count;
    scene.decay = job->numbers.decay;
    if (strcmp(job->inputs[0], "-") != 0)
        scene.title =
            strrchr(job->inputs[0], '/') ? strrchr(job->inputs[0], '/') + 1 : job->inputs[0];
    return ovoid_scene_export(job->context, &scene, job->output, &job->numbers.options);
}

static int run(export_job *job) {
    if (reading_lists(&job->reading))
        return reading_list(&job->reading, job->context, job->inputs[0]);
    ovoid_status status = ovoid_file_check(job->context, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = read_inputs(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (!job->molecule && !reading_check_model(&job->reading, job->inputs[0]))
        return CLI_USAGE;
    if (needs_device(format_of(job)))
        status = cli_open_device(job->context, job->device, job->quiet);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    if ((status = write_output(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    print_summary(job);
    return CLI_OK;
}

int cli_export(int argc, char **argv) {
    export_job job = {0};
    int code;
    if (parse(argc, argv, &job, &code)) {
        if (cli_context(&job.quiet, &job.context, &code))
            code = run(&job);
    }
    ovoid_molecule_destroy(&job.molecule);
    for (size_t i = 0; i < job.model_count; i++)
        ovoid_model_destroy(&job.models[i]);
    free(job.models);
    ovoid_context_destroy(&job.context);
    return code;
}
