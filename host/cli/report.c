#include "fit.h"
#include "ranks.h"

#include <math.h>
#include <string.h>

/* One failure anywhere stays: no report with holes. */
typedef struct builder {
    cJSON *object;
    bool good;
} builder;

static void add_number(builder *b, const char *key, double value) {
    b->good = b->good && cJSON_AddNumberToObject(b->object, key, value);
}

static void add_string(builder *b, const char *key, const char *value) {
    b->good = b->good && cli_json_string(b->object, key, value);
}

/* Microseconds are more than a clock of a busy machine can tell. */
static void add_seconds(builder *b, const char *key, double seconds) {
    add_number(b, key, round(seconds * 1e6) / 1e6);
}

static builder add_object(builder *b, const char *key) {
    builder inner = {NULL, false};
    inner.object = b->good ? cJSON_AddObjectToObject(b->object, key) : NULL;
    inner.good = b->good = inner.object != NULL;
    return inner;
}

/* Keys are the options' names with underscores. */
static void add_numbers(builder *b, const cli_number *numbers, size_t count,
                        const ovoid_fit_options *options) {
    for (size_t i = 0; i < count; i++) {
        char key[64];
        snprintf(key, sizeof key, "%s", numbers[i].name);
        for (char *c = key; *c; c++)
            if (*c == '-')
                *c = '_';
        add_number(b, key, cli_number_value(&numbers[i], options));
    }
}

/* A finite number or null. */
static void add_finite(builder *b, const char *key, double value) {
    if (isfinite(value))
        add_number(b, key, value);
    else
        b->good = b->good && cJSON_AddNullToObject(b->object, key);
}

static void add_molecule(builder *b, const fit_job *job) {
    add_string(b, "input", job->input);
    b->good = b->good && reading_report(&job->reading, b->object, job->molecule);
    if (job->number)
        add_finite(b, "moved_from", job->moved_from ? job->moved_from : NAN);
}

/* Of the method that was used, and no other. */
static void add_options(builder *b, const ovoid_fit_options *from) {
    builder options = add_object(b, "options");
    if (from->method == OVOID_METHOD_L1) {
        add_numbers(&options, fit_l1_numbers, fit_l1_count, from);
        add_string(&options, "kernel", fit_kernel_name(from->l1.kernel));
        add_string(&options, "first_step", fit_first_step_name(from->l1.first_step));
    } else {
        add_numbers(&options, fit_adaptive_numbers, fit_adaptive_count, from);
    }
    b->good = options.good;
}

static void add_goal(builder *b, const fit_job *job) {
    const ovoid_fit_result *result = &job->levels[0].result;
    const cli_number *number = &fit_goal_numbers[job->options.adaptive.goal];
    builder goal = add_object(b, "goal");
    add_string(&goal, "name", number->name);
    add_number(&goal, "asked", cli_number_value(number, &job->options));
    goal.good = goal.good && cJSON_AddBoolToObject(goal.object, "reached", result->reached);
    add_finite(&goal, "distance", result->distance);
    char text[FIT_REASON_TEXT];
    const char *reason = fit_unreached(job, text);
    if (reason)
        add_string(&goal, "reason", reason);
    b->good = goal.good;
}

/* What became of one model. */
static void add_result(builder *b, const fit_job *job, const fit_level *level) {
    const ovoid_fit_result *result = &level->result;
    const bool l1 = job->options.method == OVOID_METHOD_L1;
    add_string(b, "output", level->path);
    if (level->owners)
        add_string(b, "owners", level->owners);
    add_number(b, "ellipsoids", (double)result->ellipsoids);
    add_number(b, "unit_ellipsoids", (double)ovoid_model_unit_size(level->model));
    add_number(b, "sparse_ratio",
               (double)result->ellipsoids / (double)ovoid_molecule_atoms(job->molecule));
    add_number(b, "points", (double)result->points);
    if (l1) {
        add_number(b, "rms_error", result->l1.rms_error);
        add_number(b, "max_error", result->l1.max_error);
    }
    add_number(b, "iterations", (double)result->iterations);
    b->good = b->good && cJSON_AddBoolToObject(b->object, "stopped", level->stopped);
    if (!l1)
        add_number(b, "solver_iterations", (double)result->adaptive.solver_iterations);
    if (!l1) {
        add_number(b, "parts", (double)result->parts);
        add_number(b, "units", (double)result->units);
        add_number(b, "ranks", job->shared ? (double)ranks_count() : 1.0);
    }
    if (level->measured)
        b->good = b->good && measures_report(b->object, &level->measures, &job->measuring);
}

static void add_levels(builder *b, const fit_job *job) {
    cJSON *levels = b->good ? cJSON_AddArrayToObject(b->object, "levels") : NULL;
    b->good = levels != NULL;
    for (size_t i = 0; i < job->levels_done && b->good; i++) {
        const fit_level *from = &job->levels[i];
        builder level = {cJSON_CreateObject(), true};
        level.good = level.object && cJSON_AddItemToArray(levels, level.object);
        add_number(&level, "level", (double)(i + 1));
        add_result(&level, job, from);
        add_finite(&level, "distance", from->result.distance);
        add_seconds(&level, "seconds", from->result.sample_seconds + from->result.fit_seconds);
        b->good = level.good;
    }
}

static void add_device(builder *b, const ovoid_device_info *device) {
    add_string(b, "device", device->name);
    if (!b->good)
        return;
    builder opencl = add_object(b, "opencl");
    add_string(&opencl, "platform", device->platform);
    add_string(&opencl, "vendor", device->vendor);
    add_string(&opencl, "driver", device->driver);
    add_string(&opencl, "version", device->opencl);
    add_number(&opencl, "compute_units", device->compute_units);
    b->good = opencl.good;
}

/* Of a list all, as the first. */
static void add_devices(builder *b, const ovoid_context *context) {
    const size_t count = ovoid_context_device_count(context);
    add_device(b, ovoid_context_device(context));
    cJSON *const devices =
        b->good && count > 1 ? cJSON_AddArrayToObject(b->object, "devices") : NULL;
    b->good = b->good && (devices || count < 2);
    for (size_t n = 0; b->good && devices && n < count; n++) {
        builder one = {cJSON_CreateObject(), true};
        one.good = one.object && cJSON_AddItemToArray(devices, one.object);
        if (one.good)
            add_device(&one, ovoid_context_device_at(context, n));
        b->good = one.good;
    }
}

static void add_times(builder *b, const fit_job *job) {
    builder seconds = add_object(b, "seconds");
    add_seconds(&seconds, "device", job->device_seconds);
    add_seconds(&seconds, "read", job->read_seconds);
    add_seconds(&seconds, "sample", fit_sample_seconds(job));
    add_seconds(&seconds, "fit", fit_fit_seconds(job));
    add_seconds(&seconds, "measure", job->measure_seconds);
    add_seconds(&seconds, "write", job->write_seconds);
    add_seconds(&seconds, "total", job->total_seconds);
    b->good = seconds.good;
}

/* Of the first level. Method adaptive does not wait for each part of its work. */
static void add_profile(builder *b, const fit_job *job) {
    const ovoid_fit_result *result = &job->levels[0].result;
    const ovoid_l1_result *spent = &result->l1;
    builder profile = add_object(b, "profile");
    if (result->method == OVOID_METHOD_L1) {
        add_seconds(&profile, "lists_seconds", spent->lists_seconds);
        add_seconds(&profile, "field_seconds", spent->field_seconds);
        add_seconds(&profile, "moments_seconds", spent->moments_seconds);
        add_seconds(&profile, "host_seconds", spent->host_seconds);
        add_number(&profile, "list_builds", (double)spent->list_builds);
        add_number(&profile, "field_passes", (double)spent->field_passes);
        add_number(&profile, "moments_passes", (double)spent->moments_passes);
    }
    b->good = profile.good && cli_counts_report(result->counts, profile.object);
}

cJSON *fit_report_make(const fit_job *job) {
    builder b = {cJSON_CreateObject(), true};
    b.good = b.object != NULL;
    add_string(&b, "version", ovoid_version());
    add_molecule(&b, job);
    add_string(&b, "method", fit_method_name(job->options.method));
    ovoid_fit_options used = job->options;
    used.spacing = job->levels[0].result.spacing; /* the default depends on the molecule */
    add_numbers(&b, fit_surface_numbers, fit_surface_count, &used);
    add_options(&b, &job->options);
    if (job->options.method == OVOID_METHOD_ADAPTIVE)
        add_goal(&b, job);
    if (job->time_limit > 0.0)
        add_number(&b, "time_limit", job->time_limit);
    add_result(&b, job, &job->levels[0]);
    if (job->level_count > 1)
        add_levels(&b, job);
    add_devices(&b, job->context);
    add_times(&b, job);
    add_profile(&b, job);
    b.good = b.good && fit_work_report(&job->work, b.object);
    b.good = b.good && cli_profile_report(&job->profile, b.object);
    if (!b.good) {
        cJSON_Delete(b.object);
        b.object = NULL;
    }
    return b.object;
}

ovoid_status fit_report_write(const fit_job *job) {
    cJSON *report = fit_report_make(job);
    const ovoid_status status =
        report ? cli_json_write(job->context, report, job->report) : OVOID_ERROR_MEMORY;
    cJSON_Delete(report);
    return status;
}
