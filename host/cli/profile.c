#include "cli.h"

#include <math.h>

ovoid_status cli_profile_begin(cli_profile *profile, ovoid_context *context) {
    ovoid_status status = OVOID_OK;
    if (profile->wanted)
        status = ovoid_context_profile(context, true);
    for (int what = 0; what < OVOID_COUNTS; what++)
        profile->counts[what] = ovoid_context_count(context, (ovoid_count)what);
    profile->began = cli_seconds();
    return status;
}

ovoid_status cli_profile_end(cli_profile *profile, ovoid_context *context) {
    for (int what = 0; what < OVOID_COUNTS; what++)
        profile->counts[what] =
            ovoid_context_count(context, (ovoid_count)what) - profile->counts[what];
    if (!profile->wanted)
        return OVOID_OK;
    profile->seconds = cli_seconds() - profile->began;
    ovoid_status status = ovoid_context_profile(context, false);
    if (status == OVOID_OK)
        status = ovoid_context_kernel_times(context, &profile->times, &profile->count);
    profile->known = status == OVOID_OK;
    return status;
}

void cli_profile_destroy(cli_profile *profile) {
    ovoid_free(profile->times);
    profile->times = NULL;
}

/* ---- for people ----------------------------------------------------------------------------- */

static void print_time(const cli_profile *profile, double seconds, FILE *out) {
    if (isnan(seconds))
        fprintf(out, "  %10s  %9s\n", "-", "-");
    else
        fprintf(out, "  %10.3f  %9.1f\n", seconds, 100.0 * seconds / profile->seconds);
}

void cli_profile_print(const cli_profile *profile, const char *whole, FILE *out) {
    unsigned long long launches = 0;
    double sum = 0.0;
    if (!profile->known)
        return;
    fputs("\nkernel              launches    device s  % of time\n", out);
    for (size_t i = 0; i < profile->count; i++) {
        const ovoid_kernel_time *kernel = &profile->times[i];
        fprintf(out, "%-16s  %10llu", kernel->name, (unsigned long long)kernel->launches);
        print_time(profile, kernel->seconds, out);
        launches += kernel->launches;
        sum += kernel->seconds;
    }
    fprintf(out, "%-16s  %10s", "all else", "-");
    print_time(profile, sum > profile->seconds ? NAN : profile->seconds - sum, out);
    fprintf(out, "%-16s  %10llu", whole, launches);
    print_time(profile, profile->seconds, out);
    const uint64_t *const n = profile->counts;
    fprintf(out,
            "The device took %.1f MB, gave %.1f MB in %llu blocking reads, and made %llu buffers "
            "and %llu kernels.\n",
            1e-6 * (double)n[OVOID_COUNT_BYTES_TO_DEVICE],
            1e-6 * (double)n[OVOID_COUNT_BYTES_FROM_DEVICE],
            (unsigned long long)n[OVOID_COUNT_BLOCKING_READS],
            (unsigned long long)n[OVOID_COUNT_BUFFERS_CREATED],
            (unsigned long long)n[OVOID_COUNT_KERNELS_CREATED]);
    if (isnan(sum))
        fputs("The device's driver does not tell how long kernels run.\n", out);
}

/* ---- for programs --------------------------------------------------------------------------- */

/* Adds a number, null where it is not known. */
static bool add_known(cJSON *object, const char *key, double value) {
    return (isnan(value) ? cJSON_AddNullToObject(object, key)
                         : cJSON_AddNumberToObject(object, key, value)) != NULL;
}

/* Kernels run for microseconds: times to the nanosecond, as devices tell them. */
static bool report_kernel(cJSON *object, const cli_profile *profile,
                          const ovoid_kernel_time *kernel) {
    return cli_json_string(object, "name", kernel->name) &&
           cJSON_AddNumberToObject(object, "launches", (double)kernel->launches) &&
           add_known(object, "seconds", round(kernel->seconds * 1e9) / 1e9) &&
           add_known(object, "share", round(kernel->seconds / profile->seconds * 1e6) / 1e6);
}

bool cli_counts_report(const uint64_t counts[OVOID_COUNTS], cJSON *object) {
    static const char *const keys[OVOID_COUNTS] = {
        [OVOID_COUNT_LAUNCHES] = "launches",
        [OVOID_COUNT_BLOCKING_READS] = "blocking_reads",
        [OVOID_COUNT_BLOCKING_WRITES] = "blocking_writes",
        [OVOID_COUNT_BYTES_TO_DEVICE] = "bytes_to_device",
        [OVOID_COUNT_BYTES_FROM_DEVICE] = "bytes_from_device",
        [OVOID_COUNT_BUFFERS_CREATED] = "buffers_created",
        [OVOID_COUNT_KERNELS_CREATED] = "kernels_created",
    };
    bool good = true;
    for (int what = 0; good && what < OVOID_COUNTS; what++)
        good = cJSON_AddNumberToObject(object, keys[what], (double)counts[what]) != NULL;
    return good;
}

bool cli_profile_report(const cli_profile *profile, cJSON *report) {
    if (!profile->known)
        return true;
    cJSON *kernels = cJSON_AddArrayToObject(report, "kernels");
    bool good = kernels != NULL;
    for (size_t i = 0; good && i < profile->count; i++) {
        cJSON *kernel = cJSON_CreateObject();
        good = kernel && report_kernel(kernel, profile, &profile->times[i]) &&
               cJSON_AddItemToArray(kernels, kernel);
        if (!good)
            cJSON_Delete(kernel);
    }
    return good;
}
