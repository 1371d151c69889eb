#include "fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Adds a header line to the model. Line breaks and the like, which a file name may hold, become
 * '?'. */
static ovoid_status annotate(const fit_job *job, ovoid_model *model, const char *key,
                             const char *text) {
    char *clean = strdup(text);
    if (!clean)
        return OVOID_ERROR_MEMORY;
    for (char *c = clean; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f)
            *c = '?';
    ovoid_status status = ovoid_model_annotate(job->context, model, key, clean);
    free(clean);
    return status;
}

/* ", name value" of each, as far as there is room. */
static size_t append_numbers(const cli_number *numbers, size_t count,
                             const ovoid_fit_options *options, char *text, size_t size,
                             size_t used) {
    for (size_t i = 0; i < count && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, ", %s %.9g", numbers[i].name,
                                 cli_number_value(&numbers[i], options));
    return used;
}

static void print_settings(const fit_job *job, char *text, size_t size) {
    const ovoid_fit_options *options = &job->options;
    size_t used = (size_t)snprintf(text, size, "method %s, spacing %.9g, padding %.9g",
                                   fit_method_name(options->method), job->levels[0].result.spacing,
                                   options->padding);
    if (options->method == OVOID_METHOD_ADAPTIVE) {
        used =
            append_numbers(&fit_goal_numbers[options->adaptive.goal], 1, options, text, size, used);
        used = append_numbers(fit_adaptive_numbers, fit_adaptive_count, options, text, size, used);
        if (used < size)
            used += (size_t)snprintf(text + used, size - used, ", mesh-spacing %.9g",
                                     options->adaptive.mesh_spacing);
        if (used < size && job->levels[0].result.parts > 1) /* the model depends on them alone */
            used += (size_t)snprintf(text + used, size - used, ", parts %llu",
                                     (unsigned long long)job->levels[0].result.parts);
        if (used < size && job->levels[0].result.units > 1)
            snprintf(text + used, size - used, ", units %llu",
                     (unsigned long long)job->levels[0].result.units);
        return;
    }
    used = append_numbers(fit_l1_numbers, fit_l1_count, options, text, size, used);
    if (used < size)
        snprintf(text + used, size - used, ", kernel %s, first-step %s",
                 fit_kernel_name(options->l1.kernel), fit_first_step_name(options->l1.first_step));
}

/* What method adaptive reached. */
static ovoid_status annotate_result(const fit_job *job, size_t level, ovoid_model *model) {
    const ovoid_fit_result *result = &job->levels[level].result;
    const double tolerance = job->options.adaptive.tolerance;
    char text[64], digits[FIT_DISTANCE_TEXT];
    ovoid_status status = OVOID_OK;
    if (job->level_count > 1) {
        snprintf(text, sizeof text, "%zu of %zu", level + 1, job->levels_done);
        status = annotate(job, model, "level", text);
    }
    if (status == OVOID_OK && level == 0)
        status = annotate(job, model, "goal", result->reached ? "reached" : "not reached");
    if (status == OVOID_OK && isfinite(result->distance))
        status =
            annotate(job, model, "distance", fit_distance(result->distance, tolerance, digits));
    return status;
}

/* Which model of the file, and which one was before it, if that counts. */
static ovoid_status annotate_number(const fit_job *job, ovoid_model *model) {
    char text[64];
    int used = snprintf(text, sizeof text, "%d", (int)job->number);
    if (job->moved_from)
        snprintf(text + used, sizeof text - (size_t)used, ", moved on from model %d",
                 (int)job->moved_from);
    return annotate(job, model, "model", text);
}

/* The devices that worked on it, equal ones once: the model is the same on one of them. */
static void print_devices(const fit_job *job, size_t level, char *text, size_t size) {
    const bool in_parts = job->levels[level].result.parts > 1;
    const size_t count = in_parts ? ovoid_context_device_count(job->context) : 1;
    size_t used = 0;
    *text = '\0';
    for (size_t n = 0; n < count && used < size; n++) {
        const ovoid_device_info *const device = ovoid_context_device_at(job->context, n);
        char one[512];
        snprintf(one, sizeof one, "%s (%s, driver %s)", device->name, device->platform,
                 device->driver);
        if (!strstr(text, one))
            used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", one);
    }
}

ovoid_status fit_annotate(const fit_job *job, size_t level) {
    ovoid_model *model = job->levels[level].model;
    char text[1024];
    snprintf(text, sizeof text, "ovoid %s", ovoid_version());
    ovoid_status status = annotate(job, model, "program", text);
    if (status != OVOID_OK || (status = annotate(job, model, "input", job->input)) != OVOID_OK)
        return status;
    if (job->number && (status = annotate_number(job, model)) != OVOID_OK)
        return status;
    print_devices(job, level, text, sizeof text);
    if ((status = annotate(job, model, "device", text)) != OVOID_OK)
        return status;
    print_settings(job, text, sizeof text);
    status = annotate(job, model, "settings", text);
    if (status == OVOID_OK && job->levels[level].stopped) {
        snprintf(text, sizeof text, "after the time limit of %.9g s", job->time_limit);
        status = annotate(job, model, "stopped", text);
    }
    if (status == OVOID_OK && job->options.method == OVOID_METHOD_ADAPTIVE)
        status = annotate_result(job, level, model);
    return status;
}
