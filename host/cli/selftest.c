#include "cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

void cli_selftest_help(FILE *stream) {
    fputs(
        "Usage: ovoid selftest [OPTION]...\n"
        "\n"
        "Tests whether a device computes what it should: each kernel against plain C in double\n"
        "precision on known inputs, with more than 2^21 items too, where drivers have failed,\n"
        "and a fit of a small molecule. Then what a launch, a round trip and a transfer cost,\n"
        "and a text to paste into a bug report.\n"
        "\n"
        "A short form runs by itself at the first use of a device with a driver: see\n"
        "OVOID_SELFTEST below.\n"
        "\n"
        "Options:\n"
        "  --device SELECTOR   the device to test: number, type (cpu, gpu), PCI address, UUID or\n"
        "                      part of its name (default: OVOID_DEVICE, else the first GPU, else\n"
        "                      the first device)\n"
        "  --short             the short form: small sizes, no pictures, no fit\n"
        "  --json              print JSON for other programs\n"
        "  -h, --help          show this help\n"
        "\n"
        "Columns:\n"
        "  seconds   with compiling the kernels, where that was not done before\n"
        "  numbers   that were compared\n"
        "  error     the largest, as a share of what is allowed\n"
        "\n"
        "The exit code is 0 when all checks passed, 5 when a number was wrong, and 1 when a call\n"
        "failed and none was wrong.\n"
        "\n",
        stream);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

typedef struct run {
    ovoid_context *context;
    const ovoid_device_info *device;
    ovoid_selftest_options options;
    ovoid_selftest_result result;
    bool as_json;
    cJSON *json, *checks; /* NULL unless as_json */
    bool json_whole;      /* nothing was left out of it for want of memory */
    char *wrong;          /* what did not pass, a line each, for the text; owned, may be NULL */
} run;

static const char *verdict_name(ovoid_check_verdict verdict) {
    static const char *const names[] = {"passed", "WRONG", "failed"};
    return (unsigned)verdict < 3 ? names[verdict] : "unknown";
}

/* ---- JSON --------------------------------------------------------------------------------- */

/* NAN becomes null. */
static bool add_number(cJSON *object, const char *key, double value) {
    return isfinite(value) ? cJSON_AddNumberToObject(object, key, value) != NULL
                           : cJSON_AddNullToObject(object, key) != NULL;
}

static bool add_check(cJSON *array, const ovoid_check *check) {
    cJSON *const json = cJSON_CreateObject();
    if (!json || !cJSON_AddItemToArray(array, json)) {
        cJSON_Delete(json);
        return false;
    }
    return cli_json_string(json, "name", check->name) &&
           cli_json_string(json, "kernels", check->kernels) &&
           cli_json_string(json, "verdict",
                           check->verdict == OVOID_CHECK_WRONG ? "wrong"
                                                               : verdict_name(check->verdict)) &&
           add_number(json, "seconds", check->seconds) &&
           add_number(json, "numbers", (double)check->compared) &&
           add_number(json, "error", check->error) && cli_json_string(json, "text", check->text);
}

static bool start_json(run *r) {
    const ovoid_device_info *const d = r->device;
    r->json = cJSON_CreateObject();
    cJSON *const device = r->json ? cJSON_AddObjectToObject(r->json, "device") : NULL;
    r->json_whole =
        device && cli_json_string(r->json, "version", ovoid_version()) &&
        add_number(device, "index", d->index) && cli_json_string(device, "name", d->name) &&
        cli_json_string(device, "vendor", d->vendor) &&
        cli_json_string(device, "platform", d->platform) &&
        cli_json_string(device, "driver", d->driver) &&
        cli_json_string(device, "opencl", d->opencl) && cli_json_string(device, "pci", d->pci) &&
        cli_json_string(device, "uuid", d->uuid);
    r->checks = r->json ? cJSON_AddArrayToObject(r->json, "checks") : NULL;
    r->json_whole = r->json_whole && r->checks;
    return r->json_whole;
}

static ovoid_status end_json(run *r) {
    const ovoid_selftest_result *const s = &r->result;
    r->json_whole = r->json_whole && add_number(r->json, "passed", s->passed) &&
                    add_number(r->json, "wrong", s->wrong) &&
                    add_number(r->json, "failed", s->failed) &&
                    add_number(r->json, "launch_seconds", s->launch_seconds) &&
                    add_number(r->json, "round_trip_seconds", s->round_trip_seconds) &&
                    add_number(r->json, "to_device_bytes_per_second", s->to_device_bytes) &&
                    add_number(r->json, "from_device_bytes_per_second", s->from_device_bytes);
    return r->json_whole ? cli_json_write(r->context, r->json, "-") : OVOID_ERROR_MEMORY;
}

/* ---- text --------------------------------------------------------------------------------- */

/* What is not kept for want of memory was printed. */
static void keep_wrong(run *r, const ovoid_check *check) {
    const size_t before = r->wrong ? strlen(r->wrong) : 0;
    const size_t more = strlen(check->name) + strlen(check->text) + 8;
    char *const grown = realloc(r->wrong, before + more);
    if (!grown)
        return;
    snprintf(grown + before, more, "%s: %s\n", check->name, check->text);
    r->wrong = grown;
}

static void on_check(const ovoid_check *check, void *user) {
    run *const r = user;
    cli_progress_erase();
    if (r->as_json) {
        r->json_whole = r->json_whole && add_check(r->checks, check);
        return;
    }
    printf("%-14s  %-7s  %7.2f  %8llu  ", check->name, verdict_name(check->verdict), check->seconds,
           (unsigned long long)check->compared);
    if (isnan(check->error))
        printf("%5s  %s\n", "-", check->kernels);
    else
        printf("%5.2f  %s\n", check->error, check->kernels);
    if (check->text[0]) {
        printf("    %s\n", check->text);
        keep_wrong(r, check);
    }
    fflush(stdout);
}

static void print_costs(const ovoid_selftest_result *s) {
    printf("\nlaunch       %9.1f us    a kernel, of many in a row\n"
           "round trip   %9.1f us    a kernel, and four bytes of what it wrote read\n"
           "to device    %9.2f GB/s  copies of 16 MiB\n"
           "from device  %9.2f GB/s\n",
           1e6 * s->launch_seconds, 1e6 * s->round_trip_seconds, 1e-9 * s->to_device_bytes,
           1e-9 * s->from_device_bytes);
}

static void print_line(const char *name, const char *value) {
    printf("%-10s %s\n", name, value[0] ? value : "-");
}

static void print_report(const run *r) {
    const ovoid_device_info *const d = r->device;
    const ovoid_selftest_result *const s = &r->result;
    struct utsname system;
    printf("\nFor a bug report:\n----\n");
    printf("ovoid      %s, ABI %u\n", ovoid_version(), (unsigned)ovoid_abi());
    if (uname(&system) == 0)
        printf("system     %s %s %s\n", system.sysname, system.release, system.machine);
    print_line("device", d->name);
    print_line("vendor", d->vendor);
    print_line("platform", d->platform);
    printf("%-10s %s; of the platform %s\n", "OpenCL", d->opencl, d->platform_version);
    print_line("driver", d->driver);
    print_line("PCI", d->pci);
    print_line("UUID", d->uuid);
    printf(
        "limits     %u units at %u MHz, groups of %llu, %llu KiB local, %llu MiB memory, %llu MiB "
        "a buffer\n",
        (unsigned)d->compute_units, (unsigned)d->clock_mhz, (unsigned long long)d->max_group,
        (unsigned long long)(d->local_memory >> 10), (unsigned long long)(d->global_memory >> 20),
        (unsigned long long)(d->max_allocation >> 20));
    printf("kernels    %ux%u, teams of %u, solver's groups of %u\n", (unsigned)s->vector,
           (unsigned)s->lanes, (unsigned)s->team, (unsigned)s->solve_group);
    printf("costs      launch %.1f us, round trip %.1f us, %.2f GB/s to, %.2f GB/s from\n",
           1e6 * s->launch_seconds, 1e6 * s->round_trip_seconds, 1e-9 * s->to_device_bytes,
           1e-9 * s->from_device_bytes);
    printf("checks     %u passed, %u wrong, %u failed%s\n", (unsigned)s->passed, (unsigned)s->wrong,
           (unsigned)s->failed, r->options.brief ? " (short form)" : "");
    printf("%s----\n", r->wrong ? r->wrong : "");
}

static void print_head(const run *r) {
    printf("device %u: %s (%s, driver %s)\n\n", (unsigned)r->device->index, r->device->name,
           r->device->platform, r->device->driver);
    printf("%-14s  %-7s  %7s  %8s  %5s  %s\n", "check", "verdict", "seconds", "numbers", "error",
           "kernels");
    fflush(stdout);
}

/* ---- the command -------------------------------------------------------------------------- */

static int test(run *r, const char *selector) {
    ovoid_status status = cli_open_device(r->context, selector, false);
    if (status != OVOID_OK)
        return cli_failure(r->context, status, CLI_INPUT);
    r->device = ovoid_context_device(r->context);
    if (r->as_json && !start_json(r))
        return cli_failure(r->context, OVOID_ERROR_MEMORY, CLI_OUTPUT);
    if (!r->as_json)
        print_head(r);
    status = ovoid_selftest(r->context, &r->options, on_check, r, &r->result);
    cli_progress_erase();
    if (status == OVOID_OK && r->as_json) {
        status = end_json(r);
    } else if (status == OVOID_OK) {
        print_costs(&r->result);
        print_report(r);
    }
    if (status != OVOID_OK)
        return cli_failure(r->context, status, CLI_OUTPUT);
    if (r->result.wrong)
        cli_error("this device computes wrongly: %u of %u checks", (unsigned)r->result.wrong,
                  (unsigned)(r->result.passed + r->result.wrong + r->result.failed));
    else if (r->result.failed)
        cli_error("calls failed in %u checks", (unsigned)r->result.failed);
    return r->result.wrong ? CLI_DEVICE : r->result.failed ? CLI_INTERNAL : CLI_OK;
}

/* False: *code is the exit code. */
static bool read_options(int argc, char **argv, run *r, const char **selector, int *code) {
    enum { DEVICE = 256, SHORT, JSON, HELP };
    static const struct option options[] = {{"device", required_argument, NULL, DEVICE},
                                            {"short", no_argument, NULL, SHORT},
                                            {"json", no_argument, NULL, JSON},
                                            {"help", no_argument, NULL, HELP},
                                            {NULL, 0, NULL, 0}};
    int option;
    opterr = 0;
    *code = CLI_OK;
    while ((option = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (option == 'h' || option == HELP) {
            cli_selftest_help(stdout);
            return false;
        }
        if (option == DEVICE)
            *selector = optarg;
        else if (option == SHORT)
            r->options.brief = true;
        else if (option == JSON)
            r->as_json = true;
        else
            *code = cli_bad_option("selftest", option, argv, options);
        if (*code != CLI_OK)
            return false;
    }
    if (optind < argc) {
        cli_error("'ovoid selftest' takes no '%s' (see 'ovoid selftest --help')", argv[optind]);
        *code = CLI_USAGE;
    }
    return *code == CLI_OK;
}

int cli_selftest(int argc, char **argv) {
    run r = {0};
    const char *selector = NULL;
    bool quiet = false;
    int code;
    ovoid_selftest_options_init(&r.options, sizeof r.options);
    ovoid_selftest_result_init(&r.result, sizeof r.result);
    if (!read_options(argc, argv, &r, &selector, &code) || !cli_context(&quiet, &r.context, &code))
        return code;
    code = test(&r, selector);
    cJSON_Delete(r.json);
    free(r.wrong);
    ovoid_context_destroy(&r.context);
    return code;
}
