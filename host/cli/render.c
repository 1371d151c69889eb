#include "measures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEGREE (3.14159265358979323846 / 180.0)

typedef struct render_job {
    /* what was asked */
    const char *molecule_path; /* NULL: none */
    const char *model_path;    /* NULL: none */
    const char *output;
    const char *device;
    reading reading;
    ovoid_picture_options options;
    double decay;
    bool decay_given, isovalue_given, size_given, view_given, quiet;

    /* what came of it */
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_field *original_field, *model_field;
    ovoid_image *image;
    double started;
} render_job;

#define REAL(name, member, low, above, high, below, unit, help)                                    \
    { name, CLI_REAL, offsetof(render_job, member), low, high, above, below, unit, help }

static const cli_number numbers[] = {
    REAL("isovalue", options.isovalue, 0, true, 1e6, false, "",
         "the surface is where the field has this value c; of a model, its own value is the "
         "default"),
    REAL("decay", decay, 0, true, 100, false, "Å⁻²",
         "decay rate d of the atoms' Gaussians; with a model, its own value is the default"),
    REAL("across", options.across, 0, false, 1e7, false, "Å",
         "what the width of a picture shows; 0 stands for all there is"),
    REAL("range", options.range, 0, false, 1e6, false, "Å",
         "view difference: distance at which the colours end; 0 stands for what fits"),
    {"samples", CLI_COUNT, offsetof(render_job, options.samples), 1, OVOID_PICTURE_SAMPLES_MAX,
     false, false, "", "rays across a pixel, against jagged edges"},
};
enum { NUMBER_COUNT = sizeof numbers / sizeof *numbers };

enum {
    OUTPUT = 256,
    VIEW,
    PANEL,
    SIZE,
    DIRECTION,
    ROTATE,
    CENTRE,
    COLOUR,
    COLOUR_BY,
    BACKGROUND,
    NO_CENTRES,
    NO_BAR,
    DEVICE,
    QUIET,
    HELP,
    NUMBERS
};

static const struct option named[] = {
    {"output", required_argument, NULL, OUTPUT},
    {"view", required_argument, NULL, VIEW},
    {"panel", no_argument, NULL, PANEL},
    {"size", required_argument, NULL, SIZE},
    {"direction", required_argument, NULL, DIRECTION},
    {"rotate", required_argument, NULL, ROTATE},
    {"centre", required_argument, NULL, CENTRE},
    {"colour", required_argument, NULL, COLOUR},
    {"background", required_argument, NULL, BACKGROUND},
    {"colour-by", required_argument, NULL, COLOUR_BY},
    {"color-by", required_argument, NULL, COLOUR_BY},
    {"no-centres", no_argument, NULL, NO_CENTRES},
    {"no-bar", no_argument, NULL, NO_BAR},
    READING_OPTIONS,
    {"device", required_argument, NULL, DEVICE},
    {"quiet", no_argument, NULL, QUIET},
    {"help", no_argument, NULL, HELP},
};
enum { NAMED_COUNT = sizeof named / sizeof *named };

/* In the order of ovoid_view. */
static const char *const view_names[] = {"original",   "model",      "overlay",
                                         "difference", "ellipsoids", "panel"};
enum { VIEWS = sizeof view_names / sizeof *view_names };

void cli_render_help(FILE *stream) {
    render_job defaults = {.decay = OVOID_DEFAULT_DECAY};
    ovoid_picture_options_init(&defaults.options, sizeof defaults.options);
    defaults.options.isovalue = OVOID_DEFAULT_ISOVALUE;
    fprintf(
        stream,
        "Usage: ovoid render MOLECULE [MODEL] -o FILE.png [OPTION]...\n"
        "       ovoid render MODEL.ovoid -o FILE.png [OPTION]...\n"
        "\n"
        "Takes a picture of the surface of the molecule in the file MOLECULE (PDB, mmCIF,\n"
        "PQR or XYZR, also compressed with gzip, or - for standard input), of the surface of a\n"
        "MODEL that 'ovoid fit' has written, or of both.\n"
        "\n"
        "What to show:\n"
        "  --view NAME         original    the molecule's surface\n"
        "                      model       the model's surface, with the ellipsoids' centres\n"
        "                      overlay     the model's surface, and over it the molecule's as\n"
        "                                  tinted glass\n"
        "                      difference  the molecule's surface, coloured by how many Å\n"
        "                                  outside (red) or inside (blue) it the model's lies,\n"
        "                                  (φ~ - φ) / |grad φ|\n"
        "                      ellipsoids  each ellipsoid by itself, where its Gaussian is c,\n"
        "                                  with its centre\n"
        "                      panel       original, model and overlay in a row\n"
        "                      (default: overlay, or the one there is)\n"
        "  --panel             the same as --view panel\n"
        "  --colour-by radius|unit|none\n"
        "                      colour the surface, or ellipsoids, by how far from the middle\n"
        "                      what is seen is, blue for near, red for far; or ellipsoids by\n"
        "                      the placement of the model's unit (default: none)\n"
        "  --no-centres        leave out the ellipsoids' centres\n"
        "  --no-bar            leave out the difference's colour bar\n");
    fprintf(stream,
            "\n"
            "From where:\n"
            "  --direction X,Y,Z   from the molecule to the eye (default: the least principal\n"
            "                      axis, with the longest one across the picture)\n"
            "  --rotate X,Y,Z      turn the molecule by these angles (degrees) about the\n"
            "                      picture's axes: right, up, toward the eye\n"
            "  --centre X,Y,Z      this point (Å) in the middle (default: all of it fits)\n");
    fputs("\nNumbers:\n", stream);
    for (int i = 0; i < NUMBER_COUNT; i++)
        cli_number_help(&numbers[i], &defaults, stream);
    fprintf(
        stream,
        "\n"
        "The picture:\n"
        "  -o, --output FILE   the PNG file, - for standard output; it appears whole at the end\n"
        "                      or not at all, and replaces one that exists\n"
        "  --size WxH          pixels (default %ux%u, of a panel 2100x660)\n"
        "  --colour A[,B]      of the molecule's and of the model's surface, as RRGGBB or a name\n"
        "                      (default %06x,%06x)\n"
        "  --background A      a colour or 'transparent' (default white)\n",
        (unsigned)defaults.options.width, (unsigned)defaults.options.height,
        (unsigned)defaults.options.original >> 8, (unsigned)defaults.options.model >> 8);
    reading_help(stream, false);
    fputs("\n"
          "Running:\n" CLI_HELP_RUNNING "\n"
          "Examples:\n"
          "  ovoid render molecule.pqr -o molecule.png\n"
          "  ovoid render molecule.pqr model.ovoid --view difference -o difference.png\n"
          "  ovoid render molecule.pqr model.ovoid --panel --rotate 0,90,0 -o side.png\n"
          "\n",
          stream);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

/* ---- values of options ---------------------------------------------------------------------- */

static bool parse_view(const char *text, render_job *job) {
    const char *names[VIEWS + 1] = {NULL};
    for (int i = 0; i < VIEWS; i++) {
        names[i] = view_names[i];
        if (strcmp(text, view_names[i]) == 0) {
            job->options.view = (ovoid_view)i;
            return job->view_given = true;
        }
    }
    const char *near = cli_nearest(text, names);
    cli_error(
        "--view takes original, model, overlay, difference, ellipsoids or panel, not '%s'%s%s%s",
        text, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    return false;
}

/* A whole number of 1 to most at *text; moves *text behind it. */
static bool parse_side(const char **text, uint32_t most, uint32_t *side) {
    char *end;
    if (**text < '0' || **text > '9')
        return false;
    const unsigned long long value = strtoull(*text, &end, 10);
    *text = end;
    *side = (uint32_t)value;
    return value >= 1 && value <= most;
}

static bool parse_size(const char *text, render_job *job) {
    const char *at = text;
    if (!parse_side(&at, OVOID_PICTURE_SIDE_MAX, &job->options.width) || *at++ != 'x' ||
        !parse_side(&at, OVOID_PICTURE_SIDE_MAX, &job->options.height) || *at != '\0') {
        cli_error("--size takes WIDTHxHEIGHT in pixels, 1 to %d each, not '%s'",
                  OVOID_PICTURE_SIDE_MAX, text);
        return false;
    }
    return job->size_given = true;
}

static bool parse_vector(const char *option, const char *text, double vector[3]) {
    const char *at = text;
    for (int k = 0; k < 3; k++) {
        char *end;
        const size_t length = strcspn(at, ",");
        bool good = length > 0 && strspn(at, "+-.0123456789eE") == length;
        if (good)
            vector[k] = strtod(at, &end);
        if (!good || end != at + length || !isfinite(vector[k]) ||
            at[length] != (k < 2 ? ',' : 0)) {
            cli_error("%s takes three numbers X,Y,Z, not '%s'", option, text);
            return false;
        }
        at += length + 1;
    }
    return true;
}

static const struct {
    const char *name;
    uint32_t colour;
} colours[] = {{"white", 0xffffffff},      {"black", 0x000000ff},  {"grey", 0x808080ff},
               {"gray", 0x808080ff},       {"red", 0xc8413aff},    {"orange", 0xf2a64bff},
               {"yellow", 0xe6cf55ff},     {"green", 0x64a864ff},  {"teal", 0x4aa5a5ff},
               {"blue", 0x5b9bd5ff},       {"purple", 0x9a7fc2ff}, {"pink", 0xe09ab8ff},
               {"transparent", 0xffffff00}};

/* A colour from `length` letters of text; opacity 00 for 'transparent' alone. */
static bool parse_colour(const char *option, const char *text, size_t length, bool transparent,
                         uint32_t *colour) {
    for (size_t i = 0; i < sizeof colours / sizeof *colours; i++)
        if (strlen(colours[i].name) == length && strncmp(text, colours[i].name, length) == 0 &&
            (transparent || (colours[i].colour & 0xff))) {
            *colour = colours[i].colour;
            return true;
        }
    const size_t skip = length > 0 && text[0] == '#';
    if (length == 6 + skip && strspn(text + skip, "0123456789abcdefABCDEF") >= 6) {
        *colour = (uint32_t)strtoul(text + skip, NULL, 16) << 8 | 0xffu;
        return true;
    }
    cli_error("%s takes RRGGBB in hexadecimal%s or a name such as white, grey, orange or blue, not "
              "'%.*s'",
              option, transparent ? ", 'transparent'" : "", (int)length, text);
    return false;
}

static bool parse_colours(const char *text, ovoid_picture_options *options) {
    const size_t first = strcspn(text, ",");
    char part[64];
    snprintf(part, sizeof part, "%.*s", (int)(first < 63 ? first : 63), text);
    if (!parse_colour("--colour", part, strlen(part), false, &options->original))
        return false;
    if (text[first] == '\0')
        return true;
    return parse_colour("--colour", text + first + 1, strlen(text + first + 1), false,
                        &options->model);
}

/* In the order of ovoid_picture_colouring. */
static const char *const colouring_names[] = {"none", "radius", "unit"};
enum { COLOURINGS = sizeof colouring_names / sizeof *colouring_names };

static bool parse_colouring(const char *text, ovoid_picture_options *options) {
    for (int i = 0; i < COLOURINGS; i++)
        if (strcmp(text, colouring_names[i]) == 0) {
            options->colouring = (ovoid_picture_colouring)i;
            return true;
        }
    cli_error("--colour-by takes radius, unit or none, not '%s'", text);
    return false;
}

static bool check_colouring(const ovoid_picture_options *options) {
    const ovoid_view view = options->view;
    const bool ellipsoids = view == OVOID_VIEW_ELLIPSOIDS;
    const bool alone = ellipsoids || view == OVOID_VIEW_ORIGINAL || view == OVOID_VIEW_MODEL;
    if (options->colouring == OVOID_PICTURE_BY_RADIUS && !alone)
        cli_error("--colour-by radius is for the views original, model and ellipsoids, not '%s'",
                  view_names[view]);
    else if (options->colouring == OVOID_PICTURE_BY_UNIT && !ellipsoids)
        cli_error("--colour-by unit is for the view ellipsoids, not '%s'", view_names[view]);
    else
        return true;
    return false;
}

/* ---- the command line ----------------------------------------------------------------------- */

static bool check_files(const render_job *job) {
    const char *const inputs[] = {job->molecule_path, job->model_path};
    for (int i = 0; i < 2; i++)
        if (inputs[i] && strcmp(inputs[i], "-") != 0 && cli_same_file(inputs[i], job->output)) {
            cli_error("the picture (-o) and the %s are the same file '%s'",
                      i ? "model" : "molecule", job->output);
            return false;
        }
    if (inputs[0] && inputs[1] && strcmp(inputs[0], "-") == 0 && strcmp(inputs[1], "-") == 0) {
        cli_error("molecule and model cannot both come from standard input");
        return false;
    }
    return true;
}

static bool take_inputs(int argc, char **argv, render_job *job) {
    if (optind == argc) {
        cli_error("a picture of what? ovoid render MOLECULE [MODEL] -o FILE.png (see 'ovoid render "
                  "--help')");
        return false;
    }
    if (optind + 2 < argc) {
        cli_error(
            "one molecule and one model at most, but '%s' follows (see 'ovoid render --help')",
            argv[optind + 2]);
        return false;
    }
    const bool alone = optind + 1 == argc;
    if (alone && strcmp(argv[optind], "-") != 0 && cli_is_model(argv[optind]))
        job->model_path = argv[optind];
    else
        job->molecule_path = argv[optind];
    if (!alone)
        job->model_path = argv[optind + 1];
    return true;
}

static bool complete(int argc, char **argv, render_job *job) {
    ovoid_picture_options *const options = &job->options;
    if (!take_inputs(argc, argv, job))
        return false;
    if (!job->output) {
        cli_error("where does the picture go? Name a PNG file with -o (see 'ovoid render --help')");
        return false;
    }
    if (!job->view_given)
        options->view = !job->model_path      ? OVOID_VIEW_ORIGINAL
                        : !job->molecule_path ? OVOID_VIEW_MODEL
                                              : OVOID_VIEW_OVERLAY;
    const char *const view = view_names[options->view];
    if (options->view != OVOID_VIEW_ORIGINAL && !job->model_path) {
        cli_error(
            "view '%s' needs a model: ovoid render MOLECULE MODEL (see 'ovoid render --help')",
            view);
        return false;
    }
    if (options->view != OVOID_VIEW_MODEL && options->view != OVOID_VIEW_ELLIPSOIDS &&
        !job->molecule_path) {
        cli_error("view '%s' needs a molecule: ovoid render MOLECULE MODEL (see 'ovoid render "
                  "--help')",
                  view);
        return false;
    }
    if (!check_colouring(options))
        return false;
    if (options->view == OVOID_VIEW_PANEL && !job->size_given) {
        options->width = 2100;
        options->height = 660;
    }
    if (options->view == OVOID_VIEW_PANEL && options->width < 3) {
        cli_error("a panel is at least 3 pixels wide");
        return false;
    }
    return check_files(job);
}

static bool take_option(int option, render_job *job) {
    ovoid_picture_options *const options = &job->options;
    switch (option) {
    case 'o':
    case OUTPUT:
        job->output = optarg;
        return true;
    case VIEW:
        return parse_view(optarg, job);
    case PANEL:
        return parse_view("panel", job);
    case SIZE:
        return parse_size(optarg, job);
    case DIRECTION:
        if (!parse_vector("--direction", optarg, options->direction))
            return false;
        if (options->direction[0] == 0.0 && options->direction[1] == 0.0 &&
            options->direction[2] == 0.0) {
            cli_error("--direction 0,0,0 points nowhere");
            return false;
        }
        return true;
    case ROTATE:
        if (!parse_vector("--rotate", optarg, options->rotation))
            return false;
        for (int k = 0; k < 3; k++)
            options->rotation[k] = fmod(options->rotation[k], 360.0) * DEGREE;
        return true;
    case CENTRE:
        return parse_vector("--centre", optarg, options->centre);
    case COLOUR:
        return parse_colours(optarg, options);
    case COLOUR_BY:
        return parse_colouring(optarg, options);
    case BACKGROUND:
        return parse_colour("--background", optarg, strlen(optarg), true, &options->background);
    case NO_CENTRES:
        options->centres = false;
        return true;
    case NO_BAR:
        options->colour_bar = false;
        return true;
    case DEVICE:
        job->device = optarg;
        return true;
    case 'q':
    case QUIET:
        return job->quiet = true;
    default:
        break;
    }
    const cli_number *const number = &numbers[option - NUMBERS];
    job->isovalue_given |= strcmp(number->name, "isovalue") == 0;
    job->decay_given |= strcmp(number->name, "decay") == 0;
    return cli_number_parse(number, optarg, job);
}

/* False: the program ends with *code, all said. */
static bool parse(int argc, char **argv, render_job *job, int *code) {
    struct option all[NAMED_COUNT + NUMBER_COUNT + 1];
    int option;
    memcpy(all, named, sizeof named);
    cli_number_options(numbers, NUMBER_COUNT, NUMBERS, all + NAMED_COUNT);
    reading_init(&job->reading, false);
    opterr = 0;
    *code = CLI_USAGE;
    while ((option = getopt_long(argc, argv, ":o:qh", all, NULL)) != -1) {
        if (option == 'h' || option == HELP) {
            cli_render_help(stdout);
            *code = CLI_OK;
            return false;
        }
        if (option == '?' || option == ':') {
            *code = cli_bad_option("render", option, argv, all);
            return false;
        }
        if (reading_has(option) ? !reading_parse(&job->reading, option, optarg)
                                : !take_option(option, job))
            return false;
    }
    return complete(argc, argv, job);
}

/* ---- the work ------------------------------------------------------------------------------- */

static ovoid_status read_inputs(render_job *job) {
    ovoid_status status = OVOID_OK;
    if (job->molecule_path)
        status = reading_molecule(&job->reading, job->context, job->molecule_path, &job->molecule);
    if (status == OVOID_OK && job->model_path)
        status = ovoid_model_read(job->context, job->model_path, &job->model);
    if (status == OVOID_OK && job->model && !job->decay_given)
        job->decay = ovoid_model_decay(job->model);
    if (status == OVOID_OK && job->model && !job->isovalue_given)
        job->options.isovalue = ovoid_model_isovalue(job->model);
    return status;
}

static ovoid_status make_fields(render_job *job) {
    ovoid_status status = OVOID_OK;
    if (job->molecule)
        status = ovoid_field_of_molecule(job->context, job->molecule, job->decay,
                                         job->options.isovalue, &job->original_field);
    if (status == OVOID_OK && job->model)
        status = ovoid_field_of_model(job->context, job->model, &job->model_field);
    return status;
}

static void print_summary(const render_job *job) {
    cli_progress_erase();
    FILE *const stream = strcmp(job->output, "-") == 0 ? stderr : stdout;
    const ovoid_device_info *const device = ovoid_context_device(job->context);
    if (job->molecule)
        reading_print(&job->reading, stream, job->molecule_path, job->molecule);
    if (job->model) {
        source_print_model(job->model, job->model_path, stream);
        putc('\n', stream);
    }
    fprintf(stream, "device    %s\n", device->name);
    double radii[2];
    if (ovoid_image_radii(job->image, radii))
        fprintf(stream, "colours   from %.4g Å from the middle, blue, to %.4g Å, red\n", radii[0],
                radii[1]);
    if (ovoid_image_range(job->image) > 0.0)
        fprintf(stream, "colours   -%g to +%g Å\n", ovoid_image_range(job->image),
                ovoid_image_range(job->image));
    fprintf(stream, "picture   %s, %u x %u pixels, written to %s (%.1f s)\n",
            view_names[job->options.view], (unsigned)ovoid_image_width(job->image),
            (unsigned)ovoid_image_height(job->image),
            strcmp(job->output, "-") == 0 ? "standard output" : job->output,
            cli_seconds() - job->started);
}

static int write_picture(render_job *job) {
    const ovoid_status status = ovoid_image_write(job->context, job->image, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if (ovoid_image_covered(job->image) == 0 && !job->quiet)
        cli_warning("there is no surface in the picture: the isovalue %g is above the field's "
                    "maximum, or the surface is out of sight or smaller than a pixel",
                    job->options.isovalue);
    if (!job->quiet)
        print_summary(job);
    return CLI_OK;
}

static int run(render_job *job) {
    if (reading_lists(&job->reading) && job->molecule_path)
        return reading_list(&job->reading, job->context, job->molecule_path);
    ovoid_status status = ovoid_file_check(job->context, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = read_inputs(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if ((status = cli_open_device(job->context, job->device, job->quiet)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    status = make_fields(job);
    if (status == OVOID_OK)
        status = ovoid_render(job->context, job->original_field, job->model_field, &job->options,
                              &job->image);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    return write_picture(job);
}

int cli_render(int argc, char **argv) {
    render_job job = {.started = cli_seconds(), .decay = OVOID_DEFAULT_DECAY};
    int code;
    ovoid_picture_options_init(&job.options, sizeof job.options);
    job.options.isovalue = OVOID_DEFAULT_ISOVALUE;
    if (parse(argc, argv, &job, &code)) {
        if (cli_context(&job.quiet, &job.context, &code))
            code = run(&job);
    }
    ovoid_image_destroy(&job.image);
    ovoid_field_destroy(&job.original_field);
    ovoid_field_destroy(&job.model_field);
    ovoid_model_destroy(&job.model);
    ovoid_molecule_destroy(&job.molecule);
    ovoid_context_destroy(&job.context);
    return code;
}
