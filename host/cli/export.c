#include "measures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct export_numbers {
    double decay;
    ovoid_export_options options;
} export_numbers;

#define REAL(name, member, low, above, high, unit, help)                                           \
    { name, CLI_REAL, offsetof(export_numbers, member), low, high, above, false, unit, help }

static const cli_number numbers[] = {
    REAL("isovalue", options.isovalue, 0, false, 1e6, "",
         "ellipsoids are drawn where their own Gaussian has this value, and maps reach to a "
         "hundredth of it; 0 takes the model's, or 1 for a molecule"),
    REAL("opacity", options.opacity, 0, false, 1, "", "of drawn ellipsoids, 0 to 1"),
    REAL("spacing", options.spacing, 0, true, 1e3, "Å", "of a map's points"),
    REAL("max-gigabytes", options.max_gigabytes, 0, true, 1e6, "GB",
         "a map that would take more is refused"),
    REAL("decay", decay, 0, true, 100, "Å⁻²",
         "decay rate d of the atoms' Gaussians, for a molecule"),
};
enum { NUMBER_COUNT = sizeof numbers / sizeof *numbers };

/* Values of the long options; those of the numbers follow. */
enum { OUTPUT = 256, AS, COLOUR, DEVICE, QUIET, HELP, NUMBERS };

static const struct option named[] = {
    {"output", required_argument, NULL, OUTPUT},
    {"as", required_argument, NULL, AS},
    READING_OPTIONS,
    {"colour", required_argument, NULL, COLOUR},
    {"color", required_argument, NULL, COLOUR},
    {"device", required_argument, NULL, DEVICE},
    {"quiet", no_argument, NULL, QUIET},
    {"help", no_argument, NULL, HELP},
};
enum { NAMED_COUNT = sizeof named / sizeof *named };

typedef struct export_job {
    const char *input;
    const char *output;
    const char *device; /* NULL: the default */
    bool quiet;
    reading reading;
    export_numbers numbers;
    ovoid_context *context;
    source source;
} export_job;

void cli_export_help(FILE *stream) {
    export_numbers defaults = {.decay = OVOID_DEFAULT_DECAY};
    ovoid_export_options_init(&defaults.options, sizeof defaults.options);
    fputs("Usage: ovoid export INPUT -o FILE [OPTION]...\n"
          "\n"
          "Writes a model for another program, or the field of a model or a molecule as a density\n"
          "map. INPUT is a model as 'ovoid fit' writes it, or for maps also a molecule (PDB,\n"
          "mmCIF, PQR or XYZR); - is standard input, and a model unless --format says otherwise.\n"
          "\n"
          "The extension of FILE says what is written:\n"
          "  .bild .bld        ellipsoids for ChimeraX, in one object (as bild)\n"
          "  .cxc              ellipsoids for ChimeraX, smoother, each of its own (as cxc)\n"
          "  .py               ellipsoids for PyMOL, a script to run in it (as pymol)\n"
          "  .gmm              the Gaussian mixture of gmconvert and gmfit (as gmm)\n"
          "  .json             the model with axes and semi-axes, for scripts (as json)\n"
          "  .mrc .map .ccp4   density map, MRC2014, 32-bit floats (as ccp4)\n"
          "  .dx               density map, OpenDX text as APBS writes it (as dx)\n"
          "\n"
          "Files:\n"
          "  -o, --output FILE   where it goes, - for standard output\n"
          "  --as bild|cxc|pymol|gmm|json|ccp4|dx\n"
          "                      what to write when the extension does not say; where it says\n"
          "                      something else, nothing is written\n",
          stream);
    reading_help(stream, true);
    fputs("\n"
          "Running:\n"
          "  --device SELECTOR   the device that computes maps, see 'ovoid devices'\n"
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
        "\n"
        "An ellipsoid that nowhere reaches the isovalue is drawn where it has half its height.\n"
        "\n"
        "Examples:\n"
        "  ovoid export model.ovoid -o model.cxc                 then open it in ChimeraX\n"
        "  ovoid export model.ovoid -o model.py --opacity 0.5    then run it in PyMOL\n"
        "  ovoid export molecule.pqr -o field.mrc --spacing 0.4\n"
        "  ovoid export model.ovoid -o - --as json | jq .ellipsoids[0]\n"
        "\n",
        lround(255.0 * defaults.options.colour[0]), lround(255.0 * defaults.options.colour[1]),
        lround(255.0 * defaults.options.colour[2]));
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

/* ---- options ------------------------------------------------------------------------------ */

static bool parse_as(const char *text, ovoid_export_format *format) {
    *format = ovoid_export_format_find(text);
    if (*format == OVOID_EXPORT_AUTO)
        cli_error("--as takes bild, cxc, pymol, gmm, json, ccp4 or dx, not '%s'", text);
    return *format != OVOID_EXPORT_AUTO;
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

static bool complete(int argc, char **argv, export_job *job) {
    if (optind == argc) {
        cli_error("which model? Name its file: ovoid export INPUT -o FILE "
                  "(see 'ovoid export --help')");
        return false;
    }
    if (optind + 1 < argc) {
        cli_error("one input at a time, but '%s' follows '%s' (see 'ovoid export --help')",
                  argv[optind + 1], argv[optind]);
        return false;
    }
    job->input = argv[optind];
    if (!job->output) {
        cli_error("where to? Name the file with -o, its extension says what is written "
                  "(see 'ovoid export --help')");
        return false;
    }
    if (strcmp(job->input, "-") != 0 && cli_same_file(job->input, job->output)) {
        cli_error("the input and the output (-o) are the same file '%s'", job->output);
        return false;
    }
    return true;
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
    job->numbers.decay = OVOID_DEFAULT_DECAY;
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

static ovoid_export_format format_of(const export_job *job) {
    if (job->numbers.options.format != OVOID_EXPORT_AUTO)
        return job->numbers.options.format;
    const char *dot = strrchr(job->output, '.');
    return dot ? ovoid_export_format_find(dot) : OVOID_EXPORT_AUTO;
}

static void print_summary(const export_job *job) {
    if (job->quiet || strcmp(job->output, "-") == 0)
        return;
    cli_progress_erase();
    const char *from = source_name(job->input);
    const char *name = ovoid_export_format_name(format_of(job));
    if (job->source.model)
        printf("%s: %zu ellipsoids, written to %s as %s\n", from,
               ovoid_model_size(job->source.model), job->output, name);
    else
        printf("%s: %zu atoms, written to %s as %s\n", from,
               ovoid_molecule_atoms(job->source.molecule), job->output, name);
}

static int run(export_job *job) {
    ovoid_export_options *options = &job->numbers.options;
    ovoid_export_format format = format_of(job);
    if (reading_lists(&job->reading))
        return reading_list(&job->reading, job->context, job->input);
    ovoid_status status = ovoid_file_check(job->context, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = source_read(job->context, job->input, &job->reading, &job->source)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (job->source.model && !reading_check_model(&job->reading, job->input))
        return CLI_USAGE;
    if (format == OVOID_EXPORT_CCP4 || format == OVOID_EXPORT_DX)
        status = ovoid_context_open_device(job->context, job->device);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    status = source_field(job->context, &job->source, job->numbers.decay, OVOID_DEFAULT_ISOVALUE);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    status = ovoid_field_export(job->context, job->source.field, job->output, options);
    if (status != OVOID_OK)
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
    source_destroy(&job.source);
    ovoid_context_destroy(&job.context);
    return code;
}
