#include "fit.h"

#include <math.h>
#include <string.h>

#define REAL(name, member, low, above, high, below, unit, help)                                    \
    { name, CLI_REAL, offsetof(ovoid_fit_options, member), low, high, above, below, unit, help }
#define COUNT(name, member, low, high, help)                                                       \
    { name, CLI_COUNT, offsetof(ovoid_fit_options, member), low, high, false, false, "", help }

/* The ranges are the library's, so that a value out of range is met before any work. */
const cli_number fit_surface_numbers[] = {
    REAL("decay", decay, 0, true, 100, false, "Å⁻²",
         "decay rate d of the atoms' Gaussians: larger is closer to the atoms"),
    REAL("isovalue", isovalue, 0, true, 1e6, false, "",
         "the surface is where the field has this value c"),
    REAL("spacing", spacing, 0, true, 1e3, false, "Å",
         "distance of the points where the fields are compared"),
    REAL("padding", padding, 0, false, 1e3, false, "Å",
         "room for points about the outermost atom centres"),
};
const size_t fit_surface_count = sizeof fit_surface_numbers / sizeof *fit_surface_numbers;

const cli_number fit_l1_numbers[] = {
    COUNT("iterations", l1.iterations, 1, UINT32_MAX, "iterations at most: MaxNiter"),
    COUNT("sparse-iterations", l1.sparse_iterations, 0, UINT32_MAX,
          "of these, iterations that also make the model sparse: SparseNiter"),
    REAL("epsilon", l1.epsilon, 0, true, 1, false, "",
         "smallest weight of the accuracy term in step 5.4"),
    REAL("max-error", l1.max_error, 0, true, INFINITY, true, "",
         "sparsity has to wait while an error is above this, step 5.5"),
    REAL("prune-below", l1.prune_below, 0, false, 1e3, false, "",
         "ellipsoids are deleted when the root of their amplitude is below this"),
    COUNT("prune-every", l1.prune_every, 1, UINT32_MAX, "iterations from one deletion to the next"),
    REAL("armijo", l1.armijo, 0, true, 0.999, false, "",
         "line search: share of the predicted decrease that a step must reach"),
    REAL("shrink", l1.shrink, 0, true, 0.999, false, "",
         "line search: factor after a rejected step"),
    REAL("grow", l1.grow, 1, false, 1e6, false, "",
         "line search: factor of the last step, for the next one to try"),
    COUNT("max-backtracks", l1.max_backtracks, 1, 1000,
          "line search: rejected steps before giving up"),
};
const size_t fit_l1_count = sizeof fit_l1_numbers / sizeof *fit_l1_numbers;

static const cli_number mesh_spacing = {
    "mesh-spacing",
    CLI_REAL,
    offsetof(ovoid_measure_options, spacing),
    0,
    1e3,
    true,
    false,
    "Å",
    "of the meshes on which the model's surface is measured at the end"};

enum {
    SURFACE_COUNT = sizeof fit_surface_numbers / sizeof *fit_surface_numbers,
    L1_COUNT = sizeof fit_l1_numbers / sizeof *fit_l1_numbers
};

/* Values of the long options; those of the numbers follow. */
enum {
    OUTPUT = 256,
    METHOD,
    DEVICE,
    REPORT,
    TRACE,
    QUIET,
    FORMAT,
    KERNEL,
    FIRST_STEP,
    NO_MEASURE,
    MESH_SPACING,
    HELP,
    NUMBERS
};

static const struct option named[] = {
    {"output", required_argument, NULL, OUTPUT},
    {"method", required_argument, NULL, METHOD},
    {"device", required_argument, NULL, DEVICE},
    {"report", required_argument, NULL, REPORT},
    {"trace", required_argument, NULL, TRACE},
    {"quiet", no_argument, NULL, QUIET},
    {"format", required_argument, NULL, FORMAT},
    {"kernel", required_argument, NULL, KERNEL},
    {"first-step", required_argument, NULL, FIRST_STEP},
    {"no-measure", no_argument, NULL, NO_MEASURE},
    {"mesh-spacing", required_argument, NULL, MESH_SPACING},
    {"help", no_argument, NULL, HELP},
};
enum { NAMED_COUNT = sizeof named / sizeof *named };

static const cli_number *number_of(int option) {
    size_t index = (size_t)(option - NUMBERS);
    return index < SURFACE_COUNT ? &fit_surface_numbers[index]
                                 : &fit_l1_numbers[index - SURFACE_COUNT];
}

const char *fit_method_name(ovoid_method method) {
    switch (method) {
    case OVOID_METHOD_L1:
        return "l1";
    }
    return "unknown";
}

const char *fit_kernel_name(ovoid_kernel kernel) {
    switch (kernel) {
    case OVOID_KERNEL_ELLIPSOID:
        return "ellipsoid";
    case OVOID_KERNEL_SPHERE:
        return "sphere";
    }
    return "unknown";
}

const char *fit_first_step_name(ovoid_first_step first_step) {
    switch (first_step) {
    case OVOID_FIRST_STEP_SECANT:
        return "secant";
    case OVOID_FIRST_STEP_GROW:
        return "grow";
    }
    return "unknown";
}

void cli_fit_help(FILE *stream) {
    ovoid_fit_options defaults;
    ovoid_measure_options measuring;
    ovoid_fit_options_init(&defaults);
    ovoid_measure_options_init(&measuring);
    fprintf(
        stream,
        "Usage: ovoid fit MOLECULE [OPTION]...\n"
        "\n"
        "Fits a sparse model, a few rotated ellipsoid Gaussians, to the Gaussian surface of the\n"
        "molecule in the file MOLECULE: PQR or XYZR, also compressed with gzip, or - for\n"
        "standard input. Prints what was done and writes the model to a text file.\n"
        "\n"
        "Files:\n"
        "  -o, --output FILE   where the model goes, - for standard output (default: the name of\n"
        "                      the molecule with the extension .ovoid, in the current folder)\n"
        "  --report FILE       write numbers about the fit as JSON\n"
        "  --trace FILE        write a line per iteration as CSV\n"
        "  --format NAME       of the molecule: pqr or xyzr (default: by its extension, else by\n"
        "                      its contents)\n"
        "\n"
        "Files appear whole at the end or not at all; those that exist are replaced.\n"
        "\n"
        "Running:\n"
        "  --device SELECTOR   number, type (cpu, gpu) or part of the name of a device that\n"
        "                      'ovoid devices' lists (default: OVOID_DEVICE, else the first GPU,\n"
        "                      else the first device)\n"
        "  --method NAME       how to fit: l1, Algorithm 1 of Gui, Chen and Lu, arXiv:1909.09095\n"
        "                      (default %s)\n"
        "  -q, --quiet         print errors only\n"
        "  -h, --help          show this help\n"
        "\n"
        "The surface:\n",
        fit_method_name(defaults.method));
    for (size_t i = 0; i < fit_surface_count; i++)
        cli_number_help(&fit_surface_numbers[i], &defaults, stream);
    fputs("\nThe measures of the surface at the end:\n", stream);
    cli_number_help(&mesh_spacing, &measuring, stream);
    fputs("  --no-measure        leave them out\n\nMethod l1:\n", stream);
    fprintf(
        stream,
        "  --kernel NAME       what an atom's Gaussian may become: ellipsoid (everything about\n"
        "                      it moves), or sphere (stays where it is and as wide, only its\n"
        "                      amplitude moves: the sparse RBF model in Table 1 of the paper)\n"
        "                      (default %s)\n",
        fit_kernel_name(defaults.l1.kernel));
    for (size_t i = 0; i < fit_l1_count; i++)
        cli_number_help(&fit_l1_numbers[i], &defaults, stream);
    fprintf(
        stream,
        "  --first-step NAME   line search: what is tried first, secant (the inverse curvature\n"
        "                      along the last step, where it is defined) or grow (default %s)\n",
        fit_first_step_name(defaults.l1.first_step));
    fprintf(stream,
            "\n"
            "With --iterations alone, --sparse-iterations keeps its share of %.3g %%.\n"
            "\n"
            "Examples:\n"
            "  ovoid fit molecule.pqr\n"
            "  ovoid fit molecule.pqr -o model.ovoid --report report.json --device gpu\n"
            "  ovoid fit molecule.pqr --iterations 2000        a quick look\n"
            "  ovoid fit - -o model.ovoid < molecule.pqr       from standard input\n"
            "\n",
            100.0 * defaults.l1.sparse_iterations / defaults.l1.iterations);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

static bool parse_method(const char *text, ovoid_method *method) {
    if (strcmp(text, fit_method_name(OVOID_METHOD_L1)) != 0) {
        cli_error("--method takes l1, not '%s'", text);
        return false;
    }
    *method = OVOID_METHOD_L1;
    return true;
}

static bool parse_kernel(const char *text, ovoid_kernel *kernel) {
    if (strcmp(text, fit_kernel_name(OVOID_KERNEL_ELLIPSOID)) == 0) {
        *kernel = OVOID_KERNEL_ELLIPSOID;
    } else if (strcmp(text, fit_kernel_name(OVOID_KERNEL_SPHERE)) == 0) {
        *kernel = OVOID_KERNEL_SPHERE;
    } else {
        cli_error("--kernel takes ellipsoid or sphere, not '%s'", text);
        return false;
    }
    return true;
}

static bool parse_first_step(const char *text, ovoid_first_step *first_step) {
    if (strcmp(text, fit_first_step_name(OVOID_FIRST_STEP_SECANT)) == 0) {
        *first_step = OVOID_FIRST_STEP_SECANT;
    } else if (strcmp(text, fit_first_step_name(OVOID_FIRST_STEP_GROW)) == 0) {
        *first_step = OVOID_FIRST_STEP_GROW;
    } else {
        cli_error("--first-step takes secant or grow, not '%s'", text);
        return false;
    }
    return true;
}

/* What goes where must be told apart before anything is written. */
static bool check_files(const fit_job *job) {
    const struct {
        const char *option, *path;
    } files[] = {{"the molecule", strcmp(job->input, "-") == 0 ? NULL : job->input},
                 {"the model (-o)", job->output},
                 {"the report (--report)", job->report},
                 {"the trace (--trace)", job->trace}};
    for (size_t i = 0; i < 4; i++)
        for (size_t j = i + 1; j < 4; j++) {
            if (!files[i].path || !files[j].path || !cli_same_file(files[i].path, files[j].path))
                continue;
            if (strcmp(files[i].path, "-") == 0)
                cli_error("%s and %s cannot both go to standard output", files[i].option,
                          files[j].option);
            else
                cli_error("%s and %s are the same file '%s'", files[i].option, files[j].option,
                          files[j].path);
            return false;
        }
    return true;
}

static bool complete(int argc, char **argv, fit_job *job, bool iterations, bool sparse) {
    if (optind == argc) {
        cli_error("which molecule? Name its file: ovoid fit MOLECULE (see 'ovoid fit --help')");
        return false;
    }
    if (optind + 1 < argc) {
        cli_error("one molecule at a time, but '%s' follows '%s' (see 'ovoid fit --help')",
                  argv[optind + 1], argv[optind]);
        return false;
    }
    job->input = argv[optind];
    if (!job->output && strcmp(job->input, "-") == 0) {
        cli_error("a molecule from standard input has no name: name the model's file with -o");
        return false;
    }
    if (!job->output)
        job->output = job->default_output = source_output(job->input, ".ovoid");
    if (!job->output) {
        cli_error("out of memory");
        return false;
    }
    ovoid_l1_options *l1 = &job->options.l1;
    if (iterations && !sparse) {
        ovoid_fit_options defaults;
        ovoid_fit_options_init(&defaults);
        l1->sparse_iterations = (uint32_t)((uint64_t)l1->iterations *
                                           defaults.l1.sparse_iterations / defaults.l1.iterations);
    }
    if (l1->sparse_iterations > l1->iterations) {
        cli_error("--sparse-iterations is %u, but there are only %u --iterations",
                  (unsigned)l1->sparse_iterations, (unsigned)l1->iterations);
        return false;
    }
    return check_files(job);
}

static void fill_long_options(struct option *all) {
    memcpy(all, named, sizeof named);
    for (int i = 0; i < SURFACE_COUNT + L1_COUNT; i++)
        all[NAMED_COUNT + i] =
            (struct option){number_of(NUMBERS + i)->name, required_argument, NULL, NUMBERS + i};
    all[NAMED_COUNT + SURFACE_COUNT + L1_COUNT] = (struct option){NULL, 0, NULL, 0};
}

bool fit_options_parse(int argc, char **argv, fit_job *job, int *code) {
    struct option all[NAMED_COUNT + SURFACE_COUNT + L1_COUNT + 1];
    bool iterations = false, sparse = false, good = true;
    int option;
    fill_long_options(all);
    ovoid_fit_options_init(&job->options);
    ovoid_measure_options_init(&job->measuring);
    job->measure = true;
    opterr = 0;
    *code = CLI_USAGE;
    while (good && (option = getopt_long(argc, argv, ":o:qh", all, NULL)) != -1) {
        switch (option) {
        case 'o':
        case OUTPUT:
            job->output = optarg;
            break;
        case METHOD:
            good = parse_method(optarg, &job->options.method);
            break;
        case DEVICE:
            job->device = optarg;
            break;
        case REPORT:
            job->report = optarg;
            break;
        case TRACE:
            job->trace = optarg;
            break;
        case 'q':
        case QUIET:
            job->quiet = true;
            break;
        case FORMAT:
            good = source_parse_molecule(optarg, &job->format);
            break;
        case KERNEL:
            good = parse_kernel(optarg, &job->options.l1.kernel);
            break;
        case FIRST_STEP:
            good = parse_first_step(optarg, &job->options.l1.first_step);
            break;
        case NO_MEASURE:
            job->measure = false;
            break;
        case MESH_SPACING:
            good = cli_number_parse(&mesh_spacing, optarg, &job->measuring);
            break;
        case 'h':
        case HELP:
            cli_fit_help(stdout);
            *code = CLI_OK;
            return false;
        default:
            if (option < NUMBERS) {
                *code = cli_bad_option("fit", option, argv, all);
                return false;
            }
            good = cli_number_parse(number_of(option), optarg, &job->options);
            iterations |= strcmp(number_of(option)->name, "iterations") == 0;
            sparse |= strcmp(number_of(option)->name, "sparse-iterations") == 0;
        }
    }
    return good && complete(argc, argv, job, iterations, sparse);
}
