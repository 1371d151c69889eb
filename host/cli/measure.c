#include "measures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct measure_row {
    double isovalue;
    bool measured; /* else there is no surface, and error says which */
    ovoid_measures measures;
    char *error; /* owned */
} measure_row;

typedef struct measure_job {
    const char *molecule_path, *model_path;
    const char *report; /* NULL: none */
    const char *device; /* NULL: the default */
    bool quiet;
    reading reading;
    ovoid_measure_options options;
    measure_row *rows; /* owned; none: at the model's isovalue */
    size_t row_count;
    cli_profile profile; /* of all rows; `wanted` was asked, the rest came of it */
    FILE *summary;       /* NULL: none */
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_field *original, *sparse; /* of the two */
    double started;
} measure_job;

static const cli_number spacing_number = {"spacing",
                                          CLI_REAL,
                                          offsetof(ovoid_measure_options, spacing),
                                          0,
                                          1e3,
                                          true,
                                          false,
                                          "Å",
                                          "of both meshes; areas and volumes of smooth surfaces "
                                          "depend on it by about 0.1 % at 0.5 Å"};
static const cli_number cell_number = {"cell-atoms",
                                       CLI_COUNT,
                                       offsetof(ovoid_measure_options, cell_atoms),
                                       0,
                                       UINT32_MAX,
                                       false,
                                       false,
                                       "",
                                       "measures cell by cell, of at most so many atoms each, so "
                                       "that memory follows a cell; 0: in cells of 32768 atoms "
                                       "where there are more than 65536, else as a whole"};
static const cli_number isovalue_number = {
    "isovalue", CLI_REAL, offsetof(measure_row, isovalue), 0, 1e6, true, false, "", ""};

void cli_measure_help(FILE *stream) {
    ovoid_measure_options defaults;
    ovoid_measure_options_init(&defaults, sizeof defaults);
    fputs("Usage: ovoid measure MOLECULE MODEL [OPTION]...\n"
          "\n"
          "Compares the surface of a molecule (PDB, mmCIF, PQR or XYZR, also compressed with\n"
          "gzip) with that of a model that 'ovoid fit' made of it: areas, volumes, distances\n"
          "in both directions from the points of one surface to the triangles of the other,\n"
          "and connected pieces. The outer surface is what is left without the walls of\n"
          "cavities.\n"
          "\n"
          "Files:\n"
          "  --report FILE       write the measures as JSON, - for standard output\n"
          "\n"
          "One of the inputs can be - for standard input. Files appear whole at the end or not\n"
          "at all; those that exist are replaced.\n",
          stream);
    reading_help(stream, false);
    fputs("\n"
          "Running:\n" CLI_HELP_RUNNING "  --profile           " CLI_HELP_PROFILE "\n"
          "\n"
          "The surfaces:\n"
          "  --isovalue X[,X]...\n"
          "                          measure where the fields have these values (default: the\n"
          "                          model's)\n",
          stream);
    cli_number_help(&spacing_number, &defaults, stream);
    cli_number_help(&cell_number, &defaults, stream);
    fprintf(
        stream,
        "  --vertices exact|linear\n"
        "                          exact: vertices on the surface, areas and volumes of the "
        "smooth\n"
        "                          surface between them; linear: vertices where the field,\n"
        "                          interpolated linearly, has the isovalue, areas and volumes of\n"
        "                          the flat triangles, as isosurface programs do (default %s)\n"
        "\n"
        "Examples:\n"
        "  ovoid measure molecule.pqr molecule.ovoid\n"
        "  ovoid measure molecule.pqr molecule.ovoid --isovalue 0.5,1,2 --report table.json\n"
        "\n",
        measures_vertices_name(defaults.vertices));
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

/* Numbers with commas between them. */
static bool parse_isovalues(const char *text, measure_job *job) {
    size_t count = 1;
    for (const char *c = text; *c; c++)
        count += *c == ',';
    free(job->rows);
    job->rows = calloc(count, sizeof *job->rows);
    job->row_count = count;
    char *copy = strdup(text);
    bool good = copy && job->rows;
    if (!good)
        cli_error("out of memory");
    char *number = copy;
    for (size_t i = 0; good && i < count; i++) {
        char *comma = strchr(number, ',');
        if (comma)
            *comma = '\0';
        good = cli_number_parse(&isovalue_number, number, &job->rows[i]);
        number = comma ? comma + 1 : number;
    }
    free(copy);
    return good;
}

static bool check_files(const measure_job *job) {
    const char *const inputs[] = {job->molecule_path, job->model_path};
    if (strcmp(job->molecule_path, "-") == 0 && strcmp(job->model_path, "-") == 0) {
        cli_error("the molecule and the model cannot both come from standard input");
        return false;
    }
    for (size_t i = 0; i < 2; i++)
        if (job->report && strcmp(inputs[i], "-") != 0 && cli_same_file(inputs[i], job->report)) {
            cli_error("the %s and the report (--report) are the same file '%s'",
                      i ? "model" : "molecule", job->report);
            return false;
        }
    return true;
}

static bool complete(int argc, char **argv, measure_job *job) {
    if (argc - optind < 2) {
        cli_error("which %s? Name the files of both: ovoid measure MOLECULE MODEL (see 'ovoid "
                  "measure --help')",
                  argc == optind ? "surfaces" : "model");
        return false;
    }
    if (argc - optind > 2) {
        cli_error("one molecule and one model at a time, but '%s' follows '%s' (see 'ovoid measure "
                  "--help')",
                  argv[optind + 2], argv[optind + 1]);
        return false;
    }
    job->molecule_path = argv[optind];
    job->model_path = argv[optind + 1];
    if (strcmp(job->molecule_path, "-") != 0 && cli_is_model(job->molecule_path)) {
        cli_error("'%s' is a model, but the molecule comes first: ovoid measure MOLECULE MODEL",
                  job->molecule_path);
        return false;
    }
    return check_files(job);
}

static bool parse(int argc, char **argv, measure_job *job, int *code) {
    enum { REPORT = 256, DEVICE, VERTICES, ISOVALUE, SPACING, CELLS, PROFILE, QUIET, HELP };
    static const struct option options[] = {{"report", required_argument, NULL, REPORT},
                                            {"device", required_argument, NULL, DEVICE},
                                            READING_OPTIONS,
                                            {"vertices", required_argument, NULL, VERTICES},
                                            {"isovalue", required_argument, NULL, ISOVALUE},
                                            {"spacing", required_argument, NULL, SPACING},
                                            {"cell-atoms", required_argument, NULL, CELLS},
                                            {"profile", no_argument, NULL, PROFILE},
                                            {"quiet", no_argument, NULL, QUIET},
                                            {"help", no_argument, NULL, HELP},
                                            {NULL, 0, NULL, 0}};
    bool good = true;
    int option;
    ovoid_measure_options_init(&job->options, sizeof job->options);
    reading_init(&job->reading, false);
    opterr = 0;
    *code = CLI_USAGE;
    while (good && (option = getopt_long(argc, argv, ":qh", options, NULL)) != -1) {
        if (reading_has(option)) {
            good = reading_parse(&job->reading, option, optarg);
            continue;
        }
        switch (option) {
        case REPORT:
            job->report = optarg;
            break;
        case DEVICE:
            job->device = optarg;
            break;
        case VERTICES:
            good = measures_parse_vertices(optarg, &job->options.vertices);
            break;
        case ISOVALUE:
            good = parse_isovalues(optarg, job);
            break;
        case SPACING:
            good = cli_number_parse(&spacing_number, optarg, &job->options);
            break;
        case CELLS:
            good = cli_number_parse(&cell_number, optarg, &job->options);
            break;
        case PROFILE:
            job->profile.wanted = true;
            break;
        case 'q':
        case QUIET:
            job->quiet = true;
            break;
        case 'h':
        case HELP:
            cli_measure_help(stdout);
            *code = CLI_OK;
            return false;
        default:
            *code = cli_bad_option("measure", option, argv, options);
            return false;
        }
    }
    return good && complete(argc, argv, job);
}

/* ---- the work ------------------------------------------------------------------------------- */

static ovoid_status read_inputs(measure_job *job) {
    ovoid_status status =
        reading_molecule(&job->reading, job->context, job->molecule_path, &job->molecule);
    return status == OVOID_OK ? ovoid_model_read(job->context, job->model_path, &job->model)
                              : status;
}

static void print_before(const measure_job *job) {
    if (!job->summary)
        return;
    reading_print(&job->reading, job->summary, job->molecule_path, job->molecule);
    source_print_model(job->model, job->model_path, job->summary);
    fprintf(job->summary, ", decay %.9g Å⁻²\n", ovoid_model_decay(job->model));
    cli_print_device(job->context, job->summary);
    fflush(job->summary);
}

/* A value without a surface costs its row alone. */
static ovoid_status measure_rows(measure_job *job) {
    ovoid_status status =
        measures_fields(job->context, job->molecule, job->model, &job->original, &job->sparse);
    for (size_t i = 0; i < job->row_count && status == OVOID_OK; i++) {
        measure_row *row = &job->rows[i];
        job->options.isovalue = row->isovalue;
        ovoid_measures_init(&row->measures, sizeof row->measures);
        status =
            ovoid_measure(job->context, job->original, job->sparse, &job->options, &row->measures);
        row->measured = status == OVOID_OK;
        if (status == OVOID_ERROR_EMPTY && job->row_count > 1) {
            row->error = strdup(ovoid_context_error(job->context));
            if (!row->error)
                return OVOID_ERROR_MEMORY;
            if (!job->quiet)
                cli_warning("isovalue %.9g: %s", row->isovalue, row->error);
            status = OVOID_OK;
        }
    }
    if (status != OVOID_OK)
        return status;
    for (size_t i = 0; i < job->row_count; i++)
        if (job->rows[i].measured)
            return OVOID_OK;
    return OVOID_ERROR_EMPTY;
}

static void print_rows(const measure_job *job, FILE *out) {
    putc('\n', out);
    measures_print_heading(out);
    for (size_t i = 0; i < job->row_count; i++)
        if (job->rows[i].measured)
            measures_print_row(out, job->rows[i].isovalue, &job->rows[i].measures);
        else
            fprintf(out, "%-11.6g  no surface\n", job->rows[i].isovalue);
}

static void print_after(const measure_job *job) {
    double mesh = 0.0, distances = 0.0;
    FILE *out = job->summary;
    if (!out)
        return;
    cli_progress_erase();
    for (size_t i = 0; i < job->row_count; i++) {
        mesh += job->rows[i].measures.seconds_mesh;
        distances += job->rows[i].measures.seconds_distances;
    }
    if (job->row_count == 1) {
        fprintf(out, "isovalue  %.9g\n", job->rows[0].isovalue);
        measures_print(out, &job->rows[0].measures, &job->options);
    } else {
        fprintf(out, "mesh      spacing %.9g Å, %s vertices\n", job->options.spacing,
                measures_vertices_name(job->options.vertices));
    }
    fprintf(out, "time      %.2f s: mesh %.2f, distances %.2f\n", cli_seconds() - job->started,
            mesh, distances);
    if (job->report)
        fprintf(out, "report    written to %s\n",
                strcmp(job->report, "-") == 0 ? "standard output" : job->report);
    if (job->row_count > 1)
        print_rows(job, out);
    cli_profile_print(&job->profile, "measure", out);
}

/* ---- report --------------------------------------------------------------------------------- */

static bool report_row(cJSON *object, const measure_job *job, const measure_row *row) {
    if (!cJSON_AddNumberToObject(object, "isovalue", row->isovalue))
        return false;
    if (!row->measured)
        return cli_json_string(object, "error", row->error);
    cJSON *seconds;
    return measures_report(object, &row->measures, &job->options) &&
           (seconds = cJSON_AddObjectToObject(object, "seconds")) != NULL &&
           cJSON_AddNumberToObject(seconds, "mesh",
                                   round(row->measures.seconds_mesh * 1e6) / 1e6) &&
           cJSON_AddNumberToObject(seconds, "distances",
                                   round(row->measures.seconds_distances * 1e6) / 1e6);
}

/* With one isovalue its measures stand in the report itself; `rows` holds them in any case. */
static bool fill_report(cJSON *json, const measure_job *job) {
    bool good = json && cli_json_string(json, "version", ovoid_version()) &&
                cli_json_string(json, "molecule", job->molecule_path) &&
                cli_json_string(json, "model", job->model_path) &&
                reading_report(&job->reading, json, job->molecule) &&
                cJSON_AddNumberToObject(json, "ellipsoids", (double)ovoid_model_size(job->model)) &&
                cJSON_AddNumberToObject(json, "decay", ovoid_model_decay(job->model)) &&
                cli_json_string(json, "device", ovoid_context_device(job->context)->name);
    if (good && job->row_count == 1)
        good = report_row(json, job, &job->rows[0]);
    cJSON *rows = good ? cJSON_AddArrayToObject(json, "rows") : NULL;
    good = good && rows;
    for (size_t i = 0; good && i < job->row_count; i++) {
        cJSON *row = cJSON_CreateObject();
        good = row && report_row(row, job, &job->rows[i]) && cJSON_AddItemToArray(rows, row);
        if (!good)
            cJSON_Delete(row);
    }
    cJSON *counts = good ? cJSON_AddObjectToObject(json, "profile") : NULL;
    return counts && cli_counts_report(job->profile.counts, counts) &&
           cli_profile_report(&job->profile, json);
}

static ovoid_status write_report(const measure_job *job) {
    cJSON *json = cJSON_CreateObject();
    ovoid_status status = fill_report(json, job) ? cli_json_write(job->context, json, job->report)
                                                 : OVOID_ERROR_MEMORY;
    cJSON_Delete(json);
    return status;
}

static int run(measure_job *job) {
    if (reading_lists(&job->reading))
        return reading_list(&job->reading, job->context, job->molecule_path);
    ovoid_status status = job->report ? ovoid_file_check(job->context, job->report) : OVOID_OK;
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = read_inputs(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (!job->rows && !(job->rows = calloc(job->row_count = 1, sizeof *job->rows)))
        return cli_failure(job->context, OVOID_ERROR_MEMORY, CLI_INPUT);
    if (job->rows[0].isovalue == 0.0)
        job->rows[0].isovalue = ovoid_model_isovalue(job->model);
    if ((status = cli_open_device(job->context, job->device, job->quiet)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    print_before(job);
    status = cli_profile_begin(&job->profile, job->context);
    if (status == OVOID_OK)
        status = measure_rows(job);
    if (status == OVOID_OK)
        status = cli_profile_end(&job->profile, job->context);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (job->report && (status = write_report(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    print_after(job);
    return CLI_OK;
}

int cli_measure(int argc, char **argv) {
    measure_job job = {.started = cli_seconds()};
    int code;
    if (parse(argc, argv, &job, &code)) {
        bool taken = job.report && strcmp(job.report, "-") == 0;
        job.summary = job.quiet ? NULL : taken ? stderr : stdout;
        if (cli_context(&job.quiet, &job.context, &code))
            code = run(&job);
    }
    for (size_t i = 0; job.rows && i < job.row_count; i++)
        free(job.rows[i].error);
    free(job.rows);
    cli_profile_destroy(&job.profile);
    ovoid_field_destroy(&job.original);
    ovoid_field_destroy(&job.sparse);
    ovoid_model_destroy(&job.model);
    ovoid_molecule_destroy(&job.molecule);
    ovoid_context_destroy(&job.context);
    return code;
}
