#include "cli.h"

#include <stdlib.h>
#include <string.h>

void cli_devices_help(FILE *stream) {
    fputs(
        "Usage: ovoid devices [--json]\n"
        "\n"
        "Lists the OpenCL devices of all platforms, one line each. A star marks the one that\n"
        "is used when nothing else is said: OVOID_DEVICE, which may name several, else the\n"
        "first GPU, else the first device.\n"
        "\n"
        "Options:\n"
        "  --json      print JSON for other programs, with more about each device\n"
        "  -h, --help  show this help\n"
        "\n"
        "Columns:\n"
        "  #         what --device and OVOID_DEVICE take; so are the type, part of the name, the\n"
        "            PCI address or UUID that --json shows where the driver tells them, a list\n"
        "            such as 0,1, and all or gpus for all of them\n"
        "  type      cpu, gpu, accelerator or other\n"
        "  units     compute units: cores of a CPU, multiprocessors of a GPU\n"
        "  memory    memory of the device as its driver reports it\n"
        "  width     floats that one vector instruction handles best\n"
        "  fp64      double precision in kernels; Ovoid does not need it\n"
        "\n",
        stream);
    cli_print_environment(stream);
    putc('\n', stream);
    cli_print_exit_codes(stream);
}

static const char *type_name(ovoid_device_type type) {
    switch (type) {
    case OVOID_DEVICE_CPU:
        return "cpu";
    case OVOID_DEVICE_GPU:
        return "gpu";
    case OVOID_DEVICE_ACCELERATOR:
        return "accelerator";
    case OVOID_DEVICE_OTHER:
        break;
    }
    return "other";
}

/* "3.0" of "OpenCL 3.0 PoCL ...". */
static void short_version(const char *opencl, char *text, size_t size) {
    const char *number = strncmp(opencl, "OpenCL ", 7) == 0 ? opencl + 7 : opencl;
    snprintf(text, size, "%.*s", (int)strcspn(number, " "), number);
}

static void print_memory(uint64_t bytes, char *text, size_t size) {
    double mebibytes = (double)bytes / (1 << 20);
    if (mebibytes >= 1024.0)
        snprintf(text, size, "%.1f GiB", mebibytes / 1024.0);
    else
        snprintf(text, size, "%.0f MiB", mebibytes);
}

enum { COLUMNS = 10, CELL = 128 };
typedef char row[COLUMNS][CELL];

static void fill_row(const ovoid_device_info *device, bool chosen, row cells) {
    snprintf(cells[0], CELL, "%c %u", chosen ? '*' : ' ', (unsigned)device->index);
    snprintf(cells[1], CELL, "%s", type_name(device->type));
    snprintf(cells[2], CELL, "%s", device->name);
    snprintf(cells[3], CELL, "%s", device->platform);
    snprintf(cells[4], CELL, "%s", device->driver);
    short_version(device->opencl, cells[5], CELL);
    snprintf(cells[6], CELL, "%u", (unsigned)device->compute_units);
    print_memory(device->global_memory, cells[7], CELL);
    snprintf(cells[8], CELL, "%u", (unsigned)device->float_width);
    snprintf(cells[9], CELL, "%s", device->fp64 ? "yes" : "no");
}

static void print_row(row cells, const size_t *width) {
    for (int c = 0; c < COLUMNS; c++)
        if (c < COLUMNS - 1)
            printf("%-*s  ", (int)width[c], cells[c]);
        else
            printf("%s\n", cells[c]);
}

/* Whether a fit would take the device here: the context was opened with what it takes. */
static bool is_chosen(const ovoid_context *context, const ovoid_device_info *device) {
    for (size_t n = 0; n < ovoid_context_device_count(context); n++)
        if (ovoid_context_device_at(context, n)->index == device->index)
            return true;
    return false;
}

static int print_table(const ovoid_context *context, const ovoid_device_info *devices,
                       size_t count) {
    const size_t chosen = ovoid_context_device_count(context);
    static row head = {"  #",    "type",  "name",   "platform", "driver",
                       "OpenCL", "units", "memory", "width",    "fp64"};
    row *rows = calloc(count, sizeof *rows);
    size_t width[COLUMNS] = {0};
    if (!rows) {
        cli_error("out of memory for a table");
        return CLI_COMPUTE;
    }
    for (size_t i = 0; i < count; i++)
        fill_row(&devices[i], is_chosen(context, &devices[i]), rows[i]);
    for (int c = 0; c < COLUMNS; c++) {
        width[c] = strlen(head[c]);
        for (size_t i = 0; i < count; i++)
            if (strlen(rows[i][c]) > width[c])
                width[c] = strlen(rows[i][c]);
    }
    print_row(head, width);
    for (size_t i = 0; i < count; i++)
        print_row(rows[i], width);
    free(rows);
    if (chosen == 1)
        puts("\n* is used unless --device says otherwise.");
    else if (chosen > 1)
        puts("\n* are used unless --device says otherwise: the first, and by fits in parts all.");
    return CLI_OK;
}

static bool add_device(cJSON *array, const ovoid_device_info *device, bool chosen) {
    cJSON *json = cJSON_CreateObject();
    if (!json || !cJSON_AddItemToArray(array, json)) {
        cJSON_Delete(json);
        return false;
    }
    return cJSON_AddNumberToObject(json, "index", device->index) &&
           cJSON_AddBoolToObject(json, "default", chosen) &&
           cli_json_string(json, "type", type_name(device->type)) &&
           cli_json_string(json, "name", device->name) &&
           cli_json_string(json, "vendor", device->vendor) &&
           cli_json_string(json, "platform", device->platform) &&
           cli_json_string(json, "driver", device->driver) &&
           cli_json_string(json, "opencl", device->opencl) &&
           cJSON_AddNumberToObject(json, "compute_units", device->compute_units) &&
           cJSON_AddNumberToObject(json, "clock_mhz", device->clock_mhz) &&
           cJSON_AddNumberToObject(json, "float_width", device->float_width) &&
           cJSON_AddBoolToObject(json, "fp64", device->fp64) &&
           cJSON_AddNumberToObject(json, "global_memory", (double)device->global_memory) &&
           cJSON_AddNumberToObject(json, "max_allocation", (double)device->max_allocation) &&
           cJSON_AddNumberToObject(json, "local_memory", (double)device->local_memory) &&
           cJSON_AddNumberToObject(json, "max_group", (double)device->max_group) &&
           cli_json_string(json, "pci", device->pci) && cli_json_string(json, "uuid", device->uuid);
}

static int print_json(ovoid_context *context, const ovoid_device_info *devices, size_t count) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    cJSON *json = cJSON_CreateObject();
    cJSON *array = json ? cJSON_AddArrayToObject(json, "devices") : NULL;
    bool made = array != NULL;
    for (size_t i = 0; made && i < count; i++)
        made = add_device(array, &devices[i], is_chosen(context, &devices[i]));
    if (made)
        status = cli_json_write(context, json, "-");
    cJSON_Delete(json);
    return status == OVOID_OK ? CLI_OK : cli_failure(context, status, CLI_OUTPUT);
}

/* Which device a fit would take here the library decides by opening it. */
static void find_default(ovoid_context *context) {
    if (ovoid_context_open_device(context, NULL) != OVOID_OK && !cli_interrupted())
        cli_warning("%s", ovoid_context_error(context));
}

static int list(ovoid_context *context, bool json) {
    ovoid_device_info *devices = NULL;
    size_t count = 0;
    bool quiet = false;
    ovoid_context_on_warning(context, cli_on_warning, &quiet);
    cli_watch(context, true);
    ovoid_status status = ovoid_devices(context, sizeof(ovoid_device_info), &devices, &count);
    if (status != OVOID_OK)
        return cli_failure(context, status, CLI_INPUT);
    quiet = true; /* opening a device would repeat the warnings */
    if (count)
        find_default(context);
    if (cli_interrupted())
        return cli_failure(context, OVOID_ERROR_CANCELLED, CLI_INPUT);
    int code = CLI_OK;
    if (json)
        code = print_json(context, devices, count);
    else if (count)
        code = print_table(context, devices, count);
    if (!count && code == CLI_OK) {
        cli_error(
            "no OpenCL device was found\n"
            "A device needs its driver: for the CPU, PoCL (on Debian and Ubuntu: apt install\n"
            "pocl-opencl-icd); for a GPU, its vendor's. The program clinfo shows what the\n"
            "system offers.");
        code = CLI_DEVICE;
    }
    ovoid_free(devices);
    return code;
}

int cli_devices(int argc, char **argv) {
    enum { JSON = 256, HELP };
    static const struct option options[] = {
        {"json", no_argument, NULL, JSON}, {"help", no_argument, NULL, HELP}, {NULL, 0, NULL, 0}};
    bool json = false;
    int option;
    opterr = 0;
    while ((option = getopt_long(argc, argv, ":h", options, NULL)) != -1) {
        if (option == 'h' || option == HELP) {
            cli_devices_help(stdout);
            return CLI_OK;
        }
        if (option != JSON)
            return cli_bad_option("devices", option, argv, options);
        json = true;
    }
    if (optind < argc) {
        cli_error("'ovoid devices' takes no '%s' (see 'ovoid devices --help')", argv[optind]);
        return CLI_USAGE;
    }
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK) {
        cli_error("out of memory");
        return CLI_COMPUTE;
    }
    int code = list(context, json);
    ovoid_context_destroy(&context);
    return code;
}
