#include "fit.h"

static void print_numbers(const cli_number *numbers, size_t count, const void *defaults,
                          FILE *stream) {
    for (size_t i = 0; i < count; i++)
        cli_number_help(&numbers[i], defaults, stream);
}

static void print_files(FILE *stream) {
    fputs("Files:\n", stream);
    cli_option_help("-o, --output FILE",
                    "where the model goes, - for standard output (default: the name of the "
                    "molecule with the extension .ovoid, in the current folder)",
                    stream);
    cli_option_help("--out-dir DIR",
                    "where the models of several molecules go, under the molecules' names with the "
                    "extension .ovoid; made if it is not there (default: the current folder)",
                    stream);
    cli_option_help("--report FILE",
                    "write numbers about the fit as JSON; of several molecules a line for each",
                    stream);
    cli_option_help("--trace FILE", "write a line per iteration or step as CSV", stream);
    cli_option_help(
        "--owners FILE",
        "write a line per atom as CSV: its number, x, y, z, the number of the ellipsoid "
        "that it became part of, both from 1, and what the molecule's file calls it; of "
        "further levels to "
        "FILE.level2.csv and so on",
        stream);
    fputs("\n"
          "Several molecules are fitted one after the other; one that fails does not stop the\n"
          "others. A table of all ends the run, and the exit code tells whether all, some or none\n"
          "were fitted. With them, and with --out-dir, the FILE of --trace and --owners is the\n"
          "ending of names in DIR: --owners owners.csv writes DIR/NAME.owners.csv.\n",
          stream);
    cli_option_help(
        "--models all",
        "fit every model of a PDB or mmCIF file, such as an NMR ensemble, each beginning with the "
        "one before where the atoms are the same; FILE.ovoid becomes FILE.model1.ovoid, "
        "FILE.model2.ovoid and so on by the models' numbers, and those of --trace and --owners "
        "accordingly",
        stream);
    fputs("\nFiles appear whole at the end or not at all; those that exist are replaced.\n",
          stream);
}

static void print_running(const ovoid_fit_options *defaults, FILE *stream) {
    char text[512];
    fputs("\nRunning:\n", stream);
    cli_option_help("--device SELECTOR",
                    "number, type (cpu, gpu) or part of the name of a device that 'ovoid devices' "
                    "lists (default: OVOID_DEVICE, else the first GPU, else the first device); of "
                    "several, as 0,1 or gpus or all, the parts of a large molecule are fitted on "
                    "each, and all else is done on the first",
                    stream);
    snprintf(text, sizeof text,
             "adaptive, which merges the atoms' Gaussians and fits the few that are left to the "
             "surface, or l1, Algorithm 1 of Gui, Chen and Lu, arXiv:1909.09095, which needs more "
             "ellipsoids and more time (default %s)",
             fit_method_name(defaults->method));
    cli_option_help("--method adaptive|l1", text, stream);
    cli_number_help(&fit_time_limit_number, NULL, stream);
    cli_option_help("--profile", CLI_HELP_PROFILE " during the fit", stream);
    cli_option_help("-q, --quiet", "print errors, and a goal that was not reached, only", stream);
    cli_option_help("-h, --help", "show this help", stream);
}

static void print_surface(const ovoid_fit_options *defaults, const ovoid_measure_options *measuring,
                          FILE *stream) {
    fputs("\nThe surface:\n", stream);
    for (size_t i = 0; i < fit_surface_count; i++) {
        char text[256];
        cli_number number = fit_surface_numbers[i];
        bool own = cli_number_value(&number, defaults) == 0.0; /* each method has its own */
        if (own) {
            snprintf(text, sizeof text, "%s (default %.9g Å, of method l1 %.9g Å)", number.help,
                     OVOID_DEFAULT_SPACING_ADAPTIVE, OVOID_DEFAULT_SPACING_L1);
            number.help = text;
        }
        cli_number_help(&number, own ? NULL : defaults, stream);
    }
    fputs("\nThe measures at the end:\n", stream);
    cli_number_help(&fit_mesh_spacing_number, measuring, stream);
    cli_option_help("--no-measure", "leave them out", stream);
}

static void print_adaptive(const ovoid_fit_options *defaults, FILE *stream) {
    const fit_job job = {.level_count = 1};
    fputs("\nMethod adaptive, the goal (one of these):\n", stream);
    for (size_t i = 0; i < fit_goal_count; i++)
        cli_number_help(&fit_goal_numbers[i],
                        i == (size_t)defaults->adaptive.goal ? defaults : NULL, stream);
    fprintf(
        stream,
        "\n"
        "%.9g Å is as far as an atom of a well-ordered crystal moves by itself: a temperature\n"
        "factor B of 20 Å² is a root mean square displacement of 0.5 Å along each axis. What a\n"
        "model reaches is measured on meshes of both surfaces. If it is not the goal, the best\n"
        "model found is written, a warning says what it reached, and the exit code is %d.\n"
        "\n"
        "Method adaptive, further options:\n",
        OVOID_DEFAULT_TOLERANCE, (int)CLI_GOAL);
    cli_number_help(&fit_levels_number, &job, stream);
    print_numbers(fit_adaptive_numbers, fit_adaptive_count, defaults, stream);
    fputs("\nMethod adaptive, large molecules:\n", stream);
    print_numbers(fit_parts_numbers, fit_parts_count, NULL, stream);
    cli_option_help(
        "--checkpoint FILE",
        "keep each part in FILE as soon as it is done, until the model is written; with "
        "--resume a run that was ended goes on from there, to the same model",
        stream);
    cli_option_help("--resume",
                    "go on from the file of --checkpoint, if it is there; one of other atoms, "
                    "options, device or version is refused",
                    stream);
    cli_option_help("--no-symmetry",
                    "fit all of a symmetric assembly, instead of one unit among its images",
                    stream);
    cli_option_help(
        "--expand",
        "write the ellipsoids of all units of a symmetric assembly, instead of those of "
        "one unit and its placements",
        stream);
}

static void print_l1(const ovoid_fit_options *defaults, FILE *stream) {
    char text[512];
    fputs("\nMethod l1:\n", stream);
    snprintf(text, sizeof text,
             "what an atom's Gaussian may become: ellipsoid (everything about it moves), or sphere "
             "(stays where it is and as wide, only its amplitude moves: the sparse RBF model in "
             "Table 1 of the paper) (default %s)",
             fit_kernel_name(defaults->l1.kernel));
    cli_option_help("--kernel ellipsoid|sphere", text, stream);
    print_numbers(fit_l1_numbers, fit_l1_count, defaults, stream);
    snprintf(text, sizeof text,
             "line search: what is tried first, secant (the inverse curvature along the last step, "
             "where it is defined) or grow (default %s)",
             fit_first_step_name(defaults->l1.first_step));
    cli_option_help("--first-step secant|grow", text, stream);
    fprintf(stream, "\nWith --iterations alone, --sparse-iterations keeps its share of %.3g %%.\n",
            100.0 * defaults->l1.sparse_iterations / defaults->l1.iterations);
}

void cli_fit_help(FILE *stream) {
    ovoid_fit_options defaults;
    ovoid_measure_options measuring;
    ovoid_fit_options_init(&defaults, sizeof defaults);
    ovoid_measure_options_init(&measuring, sizeof measuring);
    fputs("Usage: ovoid fit MOLECULE... [OPTION]...\n"
          "\n"
          "Fits a sparse model, a few rotated ellipsoid Gaussians, to the Gaussian surface of the\n"
          "molecule in the file MOLECULE: PDB, mmCIF, PQR or XYZR, also compressed with gzip,\n"
          "or - for standard input. Prints what was done and writes the model to a text file.\n"
          "\n",
          stream);
    print_files(stream);
    reading_help(stream, false);
    print_running(&defaults, stream);
    print_surface(&defaults, &measuring, stream);
    print_adaptive(&defaults, stream);
    print_l1(&defaults, stream);
    fputs(
        "\n"
        "Examples:\n"
        "  ovoid fit molecule.pqr                          to molecule.ovoid, within 0.5 Å\n"
        "  ovoid fit 1abc.cif.gz --select A                chain A of a PDB entry\n"
        "  ovoid fit molecule.pqr --tolerance 0.2          closer, with more ellipsoids\n"
        "  ovoid fit molecule.pqr --ellipsoids 50          the best that 50 can do\n"
        "  ovoid fit molecule.pqr --ratio 0.1 --levels 4   10 % of the atoms, 5 %, 2.5 %, 1.2 %\n"
        "  ovoid fit molecule.pqr -o model.ovoid --report report.json --device gpu\n"
        "  ovoid fit molecule.pqr --method l1              by the paper's Algorithm 1\n"
        "  ovoid fit *.pqr --out-dir models                many, to models/NAME.ovoid\n"
        "  ovoid fit nmr.pdb --models all -o m.ovoid       to m.model1.ovoid, m.model2.ovoid ...\n"
        "  ovoid fit - -o model.ovoid < molecule.pqr       from standard input\n"
        "\n",
        stream);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}
