#include "fit.h"

#include <math.h>
#include <stdlib.h>
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
         "room for points about the outermost atom centres; method adaptive takes what the field "
         "needs, if that is more"),
};
const size_t fit_surface_count = sizeof fit_surface_numbers / sizeof *fit_surface_numbers;

const cli_number fit_goal_numbers[] = {
    REAL("tolerance", adaptive.tolerance, 0, true, 1e3, false, "Å",
         "the outer surfaces of molecule and model are nowhere further apart than this, with as "
         "few ellipsoids as are found to do"),
    COUNT("ellipsoids", adaptive.ellipsoids, 1, UINT32_MAX,
          "so many ellipsoids, no more than atoms, as near to the surface as they get"),
    REAL("ratio", adaptive.ratio, 0, true, 1, false, "",
         "so many ellipsoids per atom, at least one of them"),
};
const size_t fit_goal_count = sizeof fit_goal_numbers / sizeof *fit_goal_numbers;

const cli_number fit_adaptive_numbers[] = {
    COUNT(
        "effort", adaptive.effort, 0, 10,
        "how much is tried for a better model, up to 10: more starts, more repairs, more time; 0, "
        "of so many ellipsoids: the largest distances are not brought down, which takes most of "
        "the time; to a tolerance: soon content, with some more ellipsoids"),
    COUNT("steps", adaptive.steps, 0, UINT32_MAX,
          "steps of each refinement (Levenberg-Marquardt) at most; 0 leaves the merged Gaussians "
          "as they are"),
};
const size_t fit_adaptive_count = sizeof fit_adaptive_numbers / sizeof *fit_adaptive_numbers;

const cli_number fit_parts_numbers[] = {
    COUNT("part-atoms", parts.atoms, 0, UINT32_MAX,
          "fits the molecule in parts of at most so many atoms, from 64, so that memory follows a "
          "part and not the molecule; 0: in parts of 16384 where there are more than 65536"),
    COUNT(
        "jobs", parts.jobs, 0, OVOID_MOST_JOBS,
        "so many parts side by side on each device, each with a thread of its own: the model stays "
        "the same; 0: one for each two cores up to 4, while memory is plenty"),
};
const size_t fit_parts_count = sizeof fit_parts_numbers / sizeof *fit_parts_numbers;

const cli_number fit_l1_numbers[] = {
    COUNT("iterations", l1.iterations, 1, UINT32_MAX, "iterations at most: MaxNiter"),
    COUNT("sparse-iterations", l1.sparse_iterations, 0, UINT32_MAX,
          "of these, iterations that also make the model sparse: SparseNiter"),
    COUNT(
        "inside-every", l1.inside_every, 0, UINT32_MAX,
        "where the field is above c + 1, every so many-th point along each axis holds the inside: "
        "the model's field is not to fall below c + 1; 0: none, the paper's text taken literally"),
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

const cli_number fit_levels_number = {
    "levels",
    CLI_COUNT,
    offsetof(fit_job, level_count),
    1,
    FIT_LEVELS_MAX,
    false,
    false,
    "",
    "levels of detail: so many models, each with half the ellipsoids of the one before, down to "
    "one; those after FILE.ovoid go to FILE.level2.ovoid, FILE.level3.ovoid and so on"};

const cli_number fit_time_limit_number = {
    "time-limit",
    CLI_REAL,
    offsetof(fit_job, time_limit),
    0,
    1e9,
    true,
    false,
    "s",
    "ends the search after so long, for each molecule and all its levels together; what is written "
    "is the best model that held by then: one within the tolerance, or of so many ellipsoids. "
    "Reading before, and measuring and writing after it are not counted"};

const cli_number fit_mesh_spacing_number = {
    "mesh-spacing",
    CLI_REAL,
    offsetof(ovoid_measure_options, spacing),
    0,
    1e3,
    true,
    false,
    "Å",
    "of the meshes on which the surfaces are compared, at the end and by method adaptive on the "
    "way. What is within a tolerance is so by meshes of half of it, too, but no finer than 0.25 Å"};

/* Values of the long options; those of the numbers follow. */
enum {
    OUTPUT = 256,
    METHOD,
    DEVICE,
    REPORT,
    TRACE,
    OWNERS,
    OUT_DIR,
    MODELS,
    QUIET,
    KERNEL,
    FIRST_STEP,
    NO_MEASURE,
    MESH_SPACING,
    CHECKPOINT,
    RESUME,
    NO_SYMMETRY,
    EXPAND,
    LEVELS,
    TIME_LIMIT,
    PROFILE,
    HELP,
    NUMBERS
};

static const struct option named[] = {
    {"output", required_argument, NULL, OUTPUT},
    {"method", required_argument, NULL, METHOD},
    {"device", required_argument, NULL, DEVICE},
    {"report", required_argument, NULL, REPORT},
    {"trace", required_argument, NULL, TRACE},
    {"owners", required_argument, NULL, OWNERS},
    {"out-dir", required_argument, NULL, OUT_DIR},
    {"models", required_argument, NULL, MODELS},
    {"quiet", no_argument, NULL, QUIET},
    READING_OPTIONS,
    {"kernel", required_argument, NULL, KERNEL},
    {"first-step", required_argument, NULL, FIRST_STEP},
    {"no-measure", no_argument, NULL, NO_MEASURE},
    {"mesh-spacing", required_argument, NULL, MESH_SPACING},
    {"checkpoint", required_argument, NULL, CHECKPOINT},
    {"resume", no_argument, NULL, RESUME},
    {"no-symmetry", no_argument, NULL, NO_SYMMETRY},
    {"expand", no_argument, NULL, EXPAND},
    {"levels", required_argument, NULL, LEVELS},
    {"time-limit", required_argument, NULL, TIME_LIMIT},
    {"profile", no_argument, NULL, PROFILE},
    {"help", no_argument, NULL, HELP},
};

enum {
    NAMED_COUNT = sizeof named / sizeof *named,
    SURFACE_COUNT = sizeof fit_surface_numbers / sizeof *fit_surface_numbers,
    GOAL_COUNT = sizeof fit_goal_numbers / sizeof *fit_goal_numbers,
    ADAPTIVE_COUNT = sizeof fit_adaptive_numbers / sizeof *fit_adaptive_numbers,
    PARTS_COUNT = sizeof fit_parts_numbers / sizeof *fit_parts_numbers,
    L1_COUNT = sizeof fit_l1_numbers / sizeof *fit_l1_numbers,
    /* The first of each group. */
    GOALS = NUMBERS + SURFACE_COUNT,
    ADAPTIVES = GOALS + GOAL_COUNT,
    PARTS = ADAPTIVES + ADAPTIVE_COUNT,
    L1S = PARTS + PARTS_COUNT,
    NUMBERS_END = L1S + L1_COUNT,
    NUMBER_COUNT = NUMBERS_END - NUMBERS
};

/* The command line as far as it has been read. */
typedef struct parser {
    fit_job *job;
    const char *goal;     /* the option that set it, NULL for none */
    const char *adaptive; /* the last option that method adaptive alone has, NULL for none */
    const char *l1;       /* the same of method l1 */
    bool iterations, sparse_iterations;
} parser;

static const cli_number *number_of(int option) {
    if (option >= L1S)
        return &fit_l1_numbers[option - L1S];
    if (option >= PARTS)
        return &fit_parts_numbers[option - PARTS];
    if (option >= ADAPTIVES)
        return &fit_adaptive_numbers[option - ADAPTIVES];
    if (option >= GOALS)
        return &fit_goal_numbers[option - GOALS];
    return &fit_surface_numbers[option - NUMBERS];
}

const char *fit_method_name(ovoid_method method) {
    switch (method) {
    case OVOID_METHOD_ADAPTIVE:
        return "adaptive";
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

static bool parse_method(const char *text, ovoid_method *method) {
    for (int m = OVOID_METHOD_ADAPTIVE; m <= OVOID_METHOD_L1; m++)
        if (strcmp(text, fit_method_name((ovoid_method)m)) == 0) {
            *method = (ovoid_method)m;
            return true;
        }
    cli_error("--method takes adaptive or l1, not '%s'", text);
    return false;
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

static bool parse_goal(parser *p, int option) {
    const char *name = number_of(option)->name;
    if (p->goal && p->goal != name) {
        cli_error("--%s and --%s are both goals, and a fit has one (see 'ovoid fit --help')",
                  p->goal, name);
        return false;
    }
    p->goal = p->adaptive = name;
    p->job->options.adaptive.goal = (ovoid_goal)(option - GOALS);
    return true;
}

static bool parse_number(parser *p, int option, const char *text) {
    const cli_number *number = number_of(option);
    if (!cli_number_parse(number, text, &p->job->options))
        return false;
    if (option >= L1S)
        p->l1 = number->name;
    else if (option >= ADAPTIVES)
        p->adaptive = number->name;
    else if (option >= GOALS)
        return parse_goal(p, option);
    p->iterations |= strcmp(number->name, "iterations") == 0;
    p->sparse_iterations |= strcmp(number->name, "sparse-iterations") == 0;
    return true;
}

/* Options of the other method would have no effect. */
static bool check_method(const parser *p) {
    const ovoid_method method = p->job->options.method;
    if (method == OVOID_METHOD_ADAPTIVE && p->l1) {
        cli_error("--%s is an option of method l1, and the method is adaptive: add --method l1, or "
                  "leave it out",
                  p->l1);
        return false;
    }
    if (method == OVOID_METHOD_L1 && p->adaptive) {
        cli_error("--%s is an option of method adaptive, and the method is l1", p->adaptive);
        return false;
    }
    return true;
}

/* What depends on other options. */
static bool complete_options(const parser *p) {
    ovoid_fit_options *options = &p->job->options;
    ovoid_l1_options *l1 = &options->l1;
    if (p->iterations && !p->sparse_iterations) {
        ovoid_fit_options defaults;
        ovoid_fit_options_init(&defaults, sizeof defaults);
        l1->sparse_iterations = (uint32_t)((uint64_t)l1->iterations *
                                           defaults.l1.sparse_iterations / defaults.l1.iterations);
    }
    if (l1->sparse_iterations > l1->iterations) {
        cli_error("--sparse-iterations is %u, but there are only %u --iterations",
                  (unsigned)l1->sparse_iterations, (unsigned)l1->iterations);
        return false;
    }
    options->adaptive.mesh_spacing = p->job->measuring.spacing;
    return true;
}

/* One file holds the parts of one fit. */
static bool check_checkpoint(const fit_job *job) {
    const ovoid_parts_options *parts = &job->options.parts;
    const char *const with = job->all_models ? "--models"
                             : job->folder   ? "several molecules, or --out-dir"
                                             : "--levels";
    if (parts->resume && !parts->checkpoint) {
        cli_error("--resume goes on from a checkpoint: name its file, --checkpoint FILE");
        return false;
    }
    if (parts->checkpoint && (job->all_models || job->folder || job->level_count > 1)) {
        cli_error("--checkpoint does not go with %s: it holds the parts of one fit", with);
        return false;
    }
    return true;
}

static bool complete(int argc, char **argv, const parser *p) {
    if (optind == argc) {
        cli_error("which molecule? Name its file: ovoid fit MOLECULE (see 'ovoid fit --help')");
        return false;
    }
    if (!check_method(p) || !complete_options(p))
        return false;
    fit_job *job = p->job;
    job->input = argv[optind];
    job->inputs = argv + optind;
    job->input_count = (size_t)(argc - optind);
    if (job->input_count > 1 && !job->folder && !job->all_models)
        job->folder = ".";
    if (!check_checkpoint(job))
        return false;
    if (job->all_models)
        return fit_models_check(job);
    return job->folder ? fit_batch_check(job) : fit_outputs_name(job) && fit_outputs_check(job);
}

static void fill_long_options(struct option *all) {
    memcpy(all, named, sizeof named);
    for (int i = 0; i < NUMBER_COUNT; i++)
        all[NAMED_COUNT + i] =
            (struct option){number_of(NUMBERS + i)->name, required_argument, NULL, NUMBERS + i};
    all[NAMED_COUNT + NUMBER_COUNT] = (struct option){NULL, 0, NULL, 0};
}

/* One option that is no number of ovoid_fit_options. */
static bool parse_named(parser *p, int option) {
    fit_job *job = p->job;
    switch (option) {
    case 'o':
    case OUTPUT:
        job->output = optarg;
        return true;
    case METHOD:
        return parse_method(optarg, &job->options.method);
    case DEVICE:
        job->device = optarg;
        return true;
    case REPORT:
        job->report = optarg;
        return true;
    case TRACE:
        job->trace = optarg;
        return true;
    case OWNERS:
        job->owners = optarg;
        return true;
    case OUT_DIR:
        job->folder = optarg;
        return true;
    case MODELS:
        job->all_models = strcmp(optarg, "all") == 0;
        if (!job->all_models)
            cli_error("--models takes all, not '%s'; --model N fits one of them", optarg);
        return job->all_models;
    case 'q':
    case QUIET:
        job->quiet = true;
        return true;
    case KERNEL:
        p->l1 = "kernel";
        return parse_kernel(optarg, &job->options.l1.kernel);
    case FIRST_STEP:
        p->l1 = "first-step";
        return parse_first_step(optarg, &job->options.l1.first_step);
    case NO_MEASURE:
        job->measure = false;
        return true;
    case CHECKPOINT:
        p->adaptive = "checkpoint";
        job->options.parts.checkpoint = optarg;
        return true;
    case RESUME:
        p->adaptive = "resume";
        job->options.parts.resume = 1;
        return true;
    case NO_SYMMETRY:
        p->adaptive = "no-symmetry";
        job->options.parts.symmetry = OVOID_SYMMETRY_IGNORE;
        return true;
    case EXPAND:
        p->adaptive = "expand";
        job->expand = true;
        return true;
    case PROFILE:
        job->profile.wanted = true;
        return true;
    case LEVELS:
        p->adaptive = fit_levels_number.name;
        return cli_number_parse(&fit_levels_number, optarg, job);
    case TIME_LIMIT:
        return cli_number_parse(&fit_time_limit_number, optarg, job);
    default: /* MESH_SPACING */
        return cli_number_parse(&fit_mesh_spacing_number, optarg, &job->measuring);
    }
}

bool fit_options_parse(int argc, char **argv, fit_job *job, int *code) {
    struct option all[NAMED_COUNT + NUMBER_COUNT + 1];
    parser p = {.job = job};
    bool good = true;
    int option;
    fill_long_options(all);
    ovoid_fit_options_init(&job->options, sizeof job->options);
    ovoid_measure_options_init(&job->measuring, sizeof job->measuring);
    reading_init(&job->reading, false);
    job->measure = true;
    job->level_count = 1;
    opterr = 0;
    *code = CLI_USAGE;
    while (good && (option = getopt_long(argc, argv, ":o:qh", all, NULL)) != -1) {
        if (option == 'h' || option == HELP) {
            cli_fit_help(stdout);
            *code = CLI_OK;
            return false;
        }
        if (option == '?' || option == ':') {
            *code = cli_bad_option("fit", option, argv, all);
            return false;
        }
        good = reading_has(option) ? reading_parse(&job->reading, option, optarg)
               : option >= NUMBERS ? parse_number(&p, option, optarg)
                                   : parse_named(&p, option);
    }
    return good && complete(argc, argv, &p);
}
