#include "fit.h"

#include <stdlib.h>
#include <string.h>

static bool on_progress(const ovoid_progress *progress, void *user) {
    fit_job *job = user;
    fit_trace_add(&job->tracer, progress);
    cli_progress_show(progress);
    return cli_interrupted() == 0;
}

static bool goes_to_standard_output(const char *path) {
    return path && strcmp(path, "-") == 0;
}

static FILE *choose_summary(const fit_job *job) {
    if (job->quiet)
        return NULL;
    bool taken = goes_to_standard_output(job->output) || goes_to_standard_output(job->report) ||
                 goes_to_standard_output(job->trace);
    return taken ? stderr : stdout;
}

/* Asks for every output before the work that it is to hold the result of. */
static ovoid_status check_outputs(const fit_job *job) {
    const char *const paths[] = {job->output, job->report, job->trace};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        ovoid_status status = paths[i] ? ovoid_file_check(job->context, paths[i]) : OVOID_OK;
        if (status != OVOID_OK)
            return status;
    }
    return OVOID_OK;
}

/* Adds a header line to the model. Line breaks and the like, which a file name may hold, become
 * '?'. */
static ovoid_status annotate(const fit_job *job, const char *key, const char *text) {
    char *clean = strdup(text);
    if (!clean)
        return OVOID_ERROR_MEMORY;
    for (char *c = clean; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '?';
    ovoid_status status = ovoid_model_annotate(job->context, job->model, key, clean);
    free(clean);
    return status;
}

static void print_settings(const fit_job *job, char *text, size_t size) {
    const ovoid_fit_options *options = &job->options;
    size_t used =
        (size_t)snprintf(text, size, "method %s, spacing %.9g, padding %.9g",
                         fit_method_name(options->method), options->spacing, options->padding);
    for (size_t i = 0; i < fit_l1_count && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, ", %s %.9g", fit_l1_numbers[i].name,
                                 cli_number_value(&fit_l1_numbers[i], options));
    if (used < size)
        snprintf(text + used, size - used, ", kernel %s, first-step %s",
                 fit_kernel_name(options->l1.kernel), fit_first_step_name(options->l1.first_step));
}

/* The model file says where it comes from. */
static ovoid_status annotate_all(const fit_job *job) {
    const ovoid_device_info *device = ovoid_context_device(job->context);
    char text[1024];
    snprintf(text, sizeof text, "ovoid %s", ovoid_version());
    ovoid_status status = annotate(job, "program", text);
    if (status != OVOID_OK || (status = annotate(job, "input", job->input)) != OVOID_OK)
        return status;
    snprintf(text, sizeof text, "%s (%s, driver %s)", device->name, device->platform,
             device->driver);
    if ((status = annotate(job, "device", text)) != OVOID_OK)
        return status;
    print_settings(job, text, sizeof text);
    return annotate(job, "settings", text);
}

static ovoid_status read_molecule(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status =
        ovoid_molecule_read(job->context, job->input, job->format, &job->molecule);
    job->read_seconds = cli_seconds() - begin;
    return status;
}

static ovoid_status open_device(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status = ovoid_context_open_device(job->context, job->device);
    job->device_seconds = cli_seconds() - begin;
    return status;
}

static ovoid_status fit(fit_job *job) {
    ovoid_status status = OVOID_OK;
    cli_defer_signals();
    if (job->trace)
        status = fit_trace_open(&job->tracer, job->context, job->trace);
    if (status != OVOID_OK)
        return status;
    job->options.progress = on_progress;
    job->options.user = job;
    cli_progress_start(job->quiet);
    status = ovoid_fit(job->context, job->molecule, &job->options, &job->model, &job->result);
    cli_progress_erase();
    return status;
}

/* Compares the surfaces. The model is worth more than its measures: without them it is written,
 * too. *code is CLI_OK where there is nothing to measure, such as a model without a surface. */
static void measure(fit_job *job, int *code) {
    *code = CLI_OK;
    if (!job->measure)
        return;
    double begin = cli_seconds();
    job->measuring.isovalue = job->options.isovalue;
    ovoid_status status =
        ovoid_measure(job->context, job->molecule, job->model, &job->measuring, &job->measures);
    job->measured = status == OVOID_OK;
    if (status == OVOID_ERROR_EMPTY) {
        if (!job->quiet)
            cli_warning("not measured: %s", ovoid_context_error(job->context));
    } else if (status != OVOID_OK && !cli_interrupted()) {
        *code = cli_failure(job->context, status, CLI_OUTPUT);
    }
    job->measure_seconds = cli_seconds() - begin;
}

/* Writes the model, then the trace, then the report, which tells how long the others took. The
 * model is worth more than the others: their failure does not undo it. */
static int write_outputs(fit_job *job) {
    double begin = cli_seconds();
    ovoid_status status = annotate_all(job);
    if (status == OVOID_OK)
        status = ovoid_model_write(job->context, job->model, job->output);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    fit_trace_commit(&job->tracer);
    job->write_seconds = cli_seconds() - begin;
    job->total_seconds = cli_seconds() - job->started;
    int code = job->tracer.failed ? CLI_OUTPUT : CLI_OK;
    if (job->report && (status = fit_report_write(job)) != OVOID_OK) {
        code = cli_failure(job->context, status, CLI_OUTPUT);
        job->report_failed = true;
    }
    fit_summary_after(job); /* the model is there in any case */
    return code;
}

static int run(fit_job *job) {
    ovoid_status status = check_outputs(job);
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    if ((status = read_molecule(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_INPUT);
    if ((status = open_device(job)) != OVOID_OK)
        return cli_failure(job->context, status, CLI_DEVICE);
    fit_summary_before(job);
    int measured = CLI_OK;
    status = fit(job);
    if (status == OVOID_OK && !cli_interrupted())
        measure(job, &measured);
    if (status == OVOID_OK && cli_interrupted())
        status = OVOID_ERROR_CANCELLED;
    if (status != OVOID_OK)
        return cli_failure(job->context, status, CLI_OUTPUT);
    int written = write_outputs(job);
    return written == CLI_OK ? measured : written;
}

int cli_fit(int argc, char **argv) {
    fit_job job = {.started = cli_seconds()};
    int code;
    if (fit_options_parse(argc, argv, &job, &code)) {
        job.summary = choose_summary(&job);
        if (ovoid_context_create(&job.context) == OVOID_OK) {
            ovoid_context_on_warning(job.context, cli_on_warning, &job.quiet);
            code = run(&job);
        } else {
            cli_error("out of memory");
            code = CLI_COMPUTE;
        }
    }
    fit_trace_destroy(&job.tracer);
    ovoid_model_destroy(&job.model);
    ovoid_molecule_destroy(&job.molecule);
    ovoid_context_destroy(&job.context);
    free(job.default_output);
    return code;
}
