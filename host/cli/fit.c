#include "fit.h"
#include "ranks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* What takes so long is told of, seconds. */
#define LONG 120.0
#ifdef __APPLE__
#define KIB 1.0 /* there ru_maxrss is in bytes */
#else
#define KIB 1024.0
#endif

/* How many parts are fitted at a time, at most. */
static uint64_t at_once(const fit_job *job) {
    const uint64_t wanted = job->options.parts.jobs,
                   jobs = wanted > 0 ? wanted : OVOID_DEFAULT_JOBS;
    return jobs * ovoid_context_device_count(job->context) * (job->shared ? ranks_count() : 1);
}

/* What is done when all parts are. */
static const char *what_follows(const fit_job *job) {
    const ovoid_adaptive_options *const wanted = &job->options.adaptive;
    if (wanted->goal != OVOID_GOAL_TOLERANCE && wanted->effort == 0)
        return job->measure ? ", and the surfaces are measured after that" : "";
    return job->measure ? ", and the surfaces are compared and measured after that"
                        : ", and the surfaces are compared after that";
}

/* Says how long a fit in parts takes as soon as parts tell, and what memory it has taken. */
static void foretell(fit_job *job, const ovoid_progress *progress) {
    struct rusage usage;
    char time[64];
    if (job->quiet || job->forecast_told)
        return;
    const double left = cli_forecast_left(&job->forecast, progress, at_once(job));
    if (left <= 0.0)
        return;
    job->forecast_told = true;
    if (left < LONG || getrusage(RUSAGE_SELF, &usage) != 0)
        return;
    cli_print_duration(left, time, sizeof time);
    cli_note("%llu of %llu parts fitted in %.3g s: the others take about %s%s; memory so far %.2g "
             "GB",
             (unsigned long long)(progress->done - job->forecast.first),
             (unsigned long long)progress->total, progress->seconds - job->forecast.began, time,
             what_follows(job), (double)usage.ru_maxrss * KIB / 1e9);
}

/* A signal ends the fit and all that it has made, the time limit the search alone. */
static bool on_progress(const ovoid_progress *progress, void *user) {
    fit_job *job = user;
    fit_trace_add(&job->tracer, progress);
    foretell(job, progress);
    if (!cli_on_progress(progress, NULL))
        return false;
    if (job->time_limit > 0.0 && cli_seconds() - job->fit_began >= job->time_limit)
        job->out_of_time = true;
    return !job->out_of_time;
}

static bool goes_to_standard_output(const char *path) {
    return path && strcmp(path, "-") == 0;
}

static FILE *choose_summary(const fit_job *job) {
    if (job->quiet)
        return NULL;
    bool taken = goes_to_standard_output(job->output) || goes_to_standard_output(job->report) ||
                 goes_to_standard_output(job->trace) || goes_to_standard_output(job->owners);
    return taken ? stderr : stdout;
}

/* Asks for every output before the work that it is to hold the result of. */
static ovoid_status check_outputs(const fit_job *job) {
    const char *const paths[] = {job->report, job->trace};
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < job->level_count && status == OVOID_OK; i++) {
        status = ovoid_file_check(job->context, job->levels[i].path);
        if (status == OVOID_OK && job->levels[i].owners)
            status = ovoid_file_check(job->context, job->levels[i].owners);
    }
    for (size_t i = 0; i < sizeof paths / sizeof *paths && status == OVOID_OK; i++)
        status = paths[i] ? ovoid_file_check(job->context, paths[i]) : OVOID_OK;
    return status;
}

double fit_sample_seconds(const fit_job *job) {
    double sum = 0.0;
    for (size_t i = 0; i < job->levels_done; i++)
        sum += job->levels[i].result.sample_seconds;
    return sum;
}

double fit_fit_seconds(const fit_job *job) {
    double sum = 0.0;
    for (size_t i = 0; i < job->levels_done; i++)
        sum += job->levels[i].result.fit_seconds;
    return sum;
}

const char *fit_distance(double distance, double above, char text[FIT_DISTANCE_TEXT]) {
    for (int digits = 4; digits <= 17; digits++) {
        snprintf(text, FIT_DISTANCE_TEXT, "%.*g", digits, distance);
        if (!(distance > above) || strtod(text, NULL) > above)
            break;
    }
    return text;
}

/* ---- the run -------------------------------------------------------------------------------- */

static ovoid_status read_molecule(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status = reading_molecule(&job->reading, job->context, job->input, &job->molecule);
    job->read_seconds = cli_seconds() - begin;
    return status;
}

static ovoid_status open_device(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status = ovoid_context_open_device(job->context, job->device);
    job->device_seconds = cli_seconds() - begin;
    return status;
}

/* Whether the molecule allows the goal; says so if not. */
static bool check_goal(const fit_job *job) {
    const ovoid_adaptive_options *wanted = &job->options.adaptive;
    const size_t atoms = ovoid_molecule_atoms(job->molecule);
    if (job->options.method != OVOID_METHOD_ADAPTIVE || wanted->goal != OVOID_GOAL_ELLIPSOIDS ||
        wanted->ellipsoids <= atoms)
        return true;
    cli_error("--ellipsoids is %u, but %s has only %zu atom%s", (unsigned)wanted->ellipsoids,
              source_name(job->input), atoms, atoms == 1 ? "" : "s");
    return false;
}

/* Half the ellipsoids; of a symmetric assembly as many of each unit, while that can be. */
static uint32_t half_of(const ovoid_fit_result *result) {
    const uint64_t half = result->ellipsoids / 2, units = result->units;
    return (uint32_t)(units <= half ? half / units * units : half);
}

/* Whether other ranks take part: in what is cut into parts. Says so where they cannot. */
static bool is_shared(const fit_job *job) {
    const ovoid_fit_options *options = &job->options;
    const size_t atoms = ovoid_molecule_atoms(job->molecule);
    const size_t whole = options->parts.atoms ? options->parts.atoms : OVOID_DEFAULT_WHOLE_ATOMS;
    static bool said;
    if (ranks_count() == 1)
        return false;
    if (options->method == OVOID_METHOD_ADAPTIVE && atoms > whole && !job->session)
        return true;
    if (!said && !job->quiet)
        cli_warning("rank 0 of %u works alone: %s", (unsigned)ranks_count(),
                    options->method != OVOID_METHOD_ADAPTIVE
                        ? "a fit by method l1 has no parts that ranks could share"
                    : job->session ? "models of one file follow one another"
                                   : "a molecule of one part cannot be shared, and --part-atoms "
                                     "makes parts of fewer atoms");
    said = true;
    return false;
}

/* Of a symmetric assembly it takes the fit to know how many parts one unit has. */
static void compare_parts(const fit_job *job, const ovoid_fit_result *result) {
    if (result->parts < ranks_count() && !job->quiet)
        cli_warning("%llu part%s cannot keep %u ranks busy: --part-atoms makes more of them",
                    (unsigned long long)result->parts, result->parts == 1 ? "" : "s",
                    (unsigned)ranks_count());
}

static ovoid_status reach(fit_job *job, const ovoid_fit_options *options, fit_level *now) {
    const double limit = job->time_limit;
    const double left = limit > 0.0 ? limit - (cli_seconds() - job->fit_began) : 0.0;
    if (!job->shared)
        return ovoid_fitter_reach(job->context, job->fitter, options, &now->model, &now->result);
    const ovoid_status status =
        ranks_reach(job->context, job->fitter, job->molecule, options,
                    limit > 0.0 ? fmax(left, 1e-3) : 0.0, &now->model, &now->result);
    if (status == OVOID_ERROR_CANCELLED && limit > 0.0 && cli_seconds() - job->fit_began >= limit)
        job->out_of_time = true; /* another rank has seen it first */
    if (status == OVOID_OK && now == job->levels)
        compare_parts(job, &now->result);
    return status;
}

/* The goal's model, or after it one with half the ellipsoids of the level before: that one begins
 * with the atoms, too, for they merge better than what has been fitted. */
static ovoid_status fit_model(fit_job *job, size_t level) {
    ovoid_fit_options options = job->options;
    fit_level *now = &job->levels[level];
    if (level > 0) {
        options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
        options.adaptive.ellipsoids = half_of(&now[-1].result);
    }
    ovoid_fit_result_init(&now->result, sizeof now->result);
    if (level > 0 && job->session) {
        const ovoid_status status = ovoid_fitter_start_from(job->context, job->fitter, NULL);
        if (status != OVOID_OK)
            return status;
    }
    ovoid_context_on_progress(job->context, on_progress, job);
    ovoid_status status = reach(job, &options, now);
    if (level == 0 && !fit_work_take(&job->work, job->context, job->profile.wanted))
        return OVOID_ERROR_MEMORY;
    ovoid_context_on_progress(job->context, cli_on_progress, NULL);
    if (status == OVOID_ERROR_CANCELLED && now->model && job->out_of_time && !cli_interrupted()) {
        now->stopped = true;
        status = OVOID_OK;
    }
    return status;
}

static ovoid_status fit_one(fit_job *job, size_t level) {
    const char *begin = job->label ? job->label : "", *between = job->label ? "  " : "";
    char label[128];
    snprintf(label, sizeof label, "%s%slevel %zu/%u", begin, between, level + 1,
             (unsigned)job->level_count);
    fit_trace_level(&job->tracer, level);
    cli_progress_start(job->quiet, job->level_count > 1 ? label : job->label);
    ovoid_status status = fit_model(job, level);
    cli_progress_erase();
    cli_progress_start(job->quiet, job->label);
    if (status == OVOID_OK)
        job->levels_done = level + 1;
    return status;
}

/* Whether the time limit ended the search before anything held. */
static bool ran_out(const fit_job *job, ovoid_status status) {
    return status == OVOID_ERROR_CANCELLED && job->out_of_time && !cli_interrupted();
}

/* What comes of the levels after the first does not undo that one, and only sets *code. */
static ovoid_status fit_others(fit_job *job, int *code) {
    for (size_t i = 1;
         i < job->level_count && job->levels[i - 1].result.ellipsoids > 1 && !job->out_of_time;
         i++) {
        const ovoid_status further = fit_one(job, i);
        if (cli_interrupted())
            return OVOID_ERROR_CANCELLED;
        if (further != OVOID_OK && !ran_out(job, further))
            *code = cli_failure(job->context, further, CLI_OUTPUT);
        if (further != OVOID_OK)
            break;
    }
    return OVOID_OK;
}

/* All levels, from one preparation of the molecule. */
static ovoid_status fit_levels(fit_job *job, int *code) {
    job->fit_began = cli_seconds();
    ovoid_status status = job->session ? fit_session_join(job)
                                       : ovoid_fitter_create(job->context, job->molecule,
                                                             &job->options, &job->fitter);
    if (status == OVOID_OK)
        status = fit_one(job, 0);
    if (status == OVOID_OK)
        status = fit_others(job, code);
    if (!job->session)
        ovoid_fitter_destroy(&job->fitter);
    else if (status == OVOID_OK)
        fit_session_remember(job);
    return status;
}

/* What comes of the profile does not undo the models, and only sets *code. */
static ovoid_status fit(fit_job *job, int *code) {
    ovoid_status status = OVOID_OK;
    if (job->trace)
        status = fit_trace_open(&job->tracer, job->context, job->trace, job->options.method);
    if (status == OVOID_OK)
        status = cli_profile_begin(&job->profile, job->context);
    if (status == OVOID_OK)
        status = fit_levels(job, code);
    if (status != OVOID_OK)
        return status;
    const ovoid_status profiled = cli_profile_end(&job->profile, job->context);
    if (profiled != OVOID_OK)
        *code = cli_failure(job->context, profiled, CLI_OUTPUT);
    return OVOID_OK;
}

/* Compares the surfaces. The model is worth more than its measures: without them it is written,
 * too. CLI_OK where there is nothing to measure, such as a model without a surface. */
static int measure(fit_job *job, fit_level *level) {
    int code = CLI_OK;
    double begin = cli_seconds();
    job->measuring.isovalue = job->options.isovalue;
    ovoid_measures_init(&level->measures, sizeof level->measures);
    ovoid_status status = measures_compare(job->context, job->molecule, level->model,
                                           &job->measuring, &level->measures);
    level->measured = status == OVOID_OK;
    if (status == OVOID_ERROR_EMPTY) {
        if (!job->quiet)
            cli_warning("not measured: %s", ovoid_context_error(job->context));
    } else if (status != OVOID_OK && !cli_interrupted()) {
        code = cli_failure(job->context, status, CLI_OUTPUT);
    }
    job->measure_seconds += cli_seconds() - begin;
    return code;
}

static int measure_all(fit_job *job) {
    int code = CLI_OK;
    for (size_t i = 0; job->measure && i < job->levels_done && !cli_interrupted(); i++) {
        const int one = measure(job, &job->levels[i]);
        code = code == CLI_OK ? one : code;
    }
    return code;
}

/* The model's units become ellipsoids as all others. */
static ovoid_status expand(const fit_job *job, fit_level *level) {
    ovoid_model *all = NULL;
    if (!job->expand || !ovoid_model_placements(level->model, NULL))
        return OVOID_OK;
    const ovoid_status status = ovoid_model_expand(job->context, level->model, &all);
    if (status == OVOID_OK) {
        ovoid_model_destroy(&level->model);
        level->model = all;
    }
    return status;
}

static ovoid_status write_models(fit_job *job) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < job->levels_done && status == OVOID_OK; i++) {
        status = expand(job, &job->levels[i]);
        if (status == OVOID_OK)
            status = fit_annotate(job, i);
        if (status == OVOID_OK)
            status = ovoid_model_write(job->context, job->levels[i].model, job->levels[i].path);
        if (status == OVOID_OK)
            cli_finish_in_any_case(true); /* all of what a fit writes, or nothing */
    }
    return status;
}

static int write_owners(fit_job *job) {
    for (size_t i = 0; job->owners && i < job->levels_done; i++) {
        const ovoid_status status = fit_owners_write(job, &job->levels[i]);
        if (status != OVOID_OK) {
            job->owners_failed = true;
            return cli_failure(job->context, status, CLI_OUTPUT);
        }
    }
    return CLI_OK;
}

/* Writes the models, then the trace and the owners, then the report, which tells how long the
 * others took. The model is worth more than the others: their failure does not undo it. */
static int write_all(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status = write_models(job);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    job->written = true;
    fit_trace_commit(&job->tracer);
    const int owners = write_owners(job);
    job->write_seconds = cli_seconds() - begin;
    job->total_seconds = cli_seconds() - job->started;
    int code = job->tracer.failed ? CLI_OUTPUT : owners;
    if (job->report && (status = fit_report_write(job)) != OVOID_OK) {
        code = cli_failure(job->context, status, CLI_OUTPUT);
        job->report_failed = true;
    }
    fit_summary_after(job); /* the model is there in any case */
    return code;
}

const char *fit_unreached(const fit_job *job, char text[FIT_REASON_TEXT]) {
    const ovoid_adaptive_options *wanted = &job->options.adaptive;
    const ovoid_fit_result *result = &job->levels[0].result;
    char digits[FIT_DISTANCE_TEXT];
    switch (result->verdict) {
    case OVOID_VERDICT_REACHED:
    case OVOID_VERDICT_NO_GOAL:
        return NULL;
    case OVOID_VERDICT_NO_SURFACE:
        snprintf(text, FIT_REASON_TEXT,
                 "there is no surface to be near to: the molecule's field is "
                 "nowhere above the isovalue %.9g",
                 job->options.isovalue);
        break;
    case OVOID_VERDICT_NO_MODEL_SURFACE:
        snprintf(text, FIT_REASON_TEXT, "the model has no surface to be within %.9g Å",
                 wanted->tolerance);
        break;
    case OVOID_VERDICT_COARSE:
        snprintf(
            text, FIT_REASON_TEXT,
            "a mesh spacing of %.9g Å is too coarse to tell whether the surfaces are within %.9g "
            "Å",
            wanted->mesh_spacing, wanted->tolerance);
        break;
    case OVOID_VERDICT_MISSED:
        if (wanted->goal == OVOID_GOAL_TOLERANCE)
            snprintf(text, FIT_REASON_TEXT, "the outer surfaces are %s Å apart, not within %.9g Å",
                     fit_distance(result->distance, wanted->tolerance, digits), wanted->tolerance);
        else
            snprintf(text, FIT_REASON_TEXT, "the model has %llu ellipsoid%s",
                     (unsigned long long)result->ellipsoids, result->ellipsoids == 1 ? "" : "s");
        break;
    }
    return text;
}

static int write_outputs(fit_job *job) {
    const int code = write_all(job);
    cli_finish_in_any_case(false);
    return code;
}

/* Says where devices were named for nothing: once in a run. */
static void compare_with_devices(const fit_job *job) {
    static bool told;
    const size_t count = ovoid_context_device_count(job->context);
    if (told || job->quiet || count < 2 || job->levels[0].result.parts > 1)
        return;
    told = true;
    cli_warning("of %zu devices the first did all the work, for %s was fitted as a whole; see "
                "--part-atoms",
                count, source_name(job->input));
}

/* After a failure: what is left of the work. */
static void tell_checkpoint(const fit_job *job, ovoid_status status) {
    const char *const path = job->options.parts.checkpoint;
    const bool by_device = status == OVOID_ERROR_DEVICE || status == OVOID_ERROR_OPENCL ||
                           status == OVOID_ERROR_MEMORY;
    if (path && by_device && !cli_interrupted() && access(path, F_OK) == 0)
        cli_error("the parts that are done are in %s: the same command with --resume goes on",
                  path);
}

/* Says what was reached instead of the goal. */
static int compare_with_goal(const fit_job *job) {
    const ovoid_adaptive_options *wanted = &job->options.adaptive;
    char text[FIT_REASON_TEXT];
    const char *reason = fit_unreached(job, text);
    const bool missed = job->levels[0].result.verdict == OVOID_VERDICT_MISSED &&
                        wanted->goal == OVOID_GOAL_TOLERANCE;
    if (!reason)
        return CLI_OK;
    cli_warning(
        "the goal was not reached: %s%s%s", reason, missed ? "; this is the best model found" : "",
        missed && wanted->effort < 10 ? ", and a higher --effort may find a better one" : "");
    return CLI_GOAL;
}

static ovoid_status run_fit(fit_job *job, int *levels, int *measured) {
    fit_summary_before(job);
    ovoid_status status = fit(job, levels);
    if (status == OVOID_OK && !cli_interrupted())
        *measured = measure_all(job);
    return status == OVOID_OK && cli_interrupted() ? OVOID_ERROR_CANCELLED : status;
}

int fit_run(fit_job *job) {
    int levels = CLI_OK, measured = CLI_OK;
    ovoid_status status = check_outputs(job);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = read_molecule(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if (!check_goal(job))
        return CLI_USAGE;
    if (!ovoid_context_device(job->context) && (status = open_device(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    job->shared = is_shared(job);
    if (job->shared && !ranks_open(job->asked_device, &levels))
        return levels;
    status = run_fit(job, &levels, &measured);
    if (ran_out(job, status)) {
        cli_error("no model held within the %.9g s of --time-limit, and none is written",
                  job->time_limit);
        return CLI_TIME;
    }
    if (status != OVOID_OK) {
        const int code = cli_failure(job->context, status, CLI_OUTPUT);
        tell_checkpoint(job, status);
        return code;
    }
    const int written = write_outputs(job);
    compare_with_devices(job);
    if (job->written && job->options.parts.checkpoint)
        remove(job->options.parts.checkpoint); /* it has done its part */
    if (written != CLI_OK || levels != CLI_OK || measured != CLI_OK)
        return written != CLI_OK ? written : levels != CLI_OK ? levels : measured;
    return compare_with_goal(job);
}

void fit_job_destroy(fit_job *job) {
    ovoid_fitter_destroy(&job->fitter);
    fit_trace_destroy(&job->tracer);
    for (size_t i = 0; i < FIT_LEVELS_MAX; i++)
        ovoid_model_destroy(&job->levels[i].model);
    cli_profile_destroy(&job->profile);
    fit_work_destroy(&job->work);
    ovoid_molecule_destroy(&job->molecule);
    fit_outputs_destroy(job);
}

/* What assemblies there are in each of the files. */
static int list_assemblies(const fit_job *job) {
    int code = CLI_OK;
    for (size_t i = 0; i < job->input_count; i++) {
        const int one = reading_list(&job->reading, job->context, job->inputs[i]);
        code = code == CLI_OK ? one : code;
    }
    return code;
}

static int run(fit_job *job) {
    if (reading_lists(&job->reading))
        return list_assemblies(job);
    if (job->all_models)
        return fit_models(job);
    return job->folder ? fit_batch(job) : fit_run(job);
}

int cli_fit(int argc, char **argv) {
    fit_job job = {.started = cli_seconds()};
    int code;
    if (fit_options_parse(argc, argv, &job, &code)) {
        job.summary = choose_summary(&job);
        if (cli_context(&job.quiet, &job.context, &code)) {
            job.asked_device = job.device;
            job.device = ranks_device(job.context, job.device);
            code = run(&job);
        }
    }
    fit_job_destroy(&job);
    ovoid_context_destroy(&job.context);
    return code;
}
