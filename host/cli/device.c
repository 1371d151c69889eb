/* The device, or the devices, that --device and OVOID_DEVICE name. */
#include "cli.h"

ovoid_status cli_open_device(ovoid_context *context, const char *selector, bool quiet) {
    const ovoid_status status = ovoid_context_open_device(context, selector);
    const size_t count = ovoid_context_device_count(context);
    if (status == OVOID_OK && count > 1 && !quiet)
        cli_warning("of the %zu devices that are named this takes the first, %s", count,
                    ovoid_context_device(context)->name);
    return status;
}

static void print_one(const ovoid_device_info *device, FILE *out) {
    fprintf(out, "device    %s (%s, driver %s)\n", device->name, device->platform, device->driver);
}

void cli_print_device(const ovoid_context *context, FILE *out) {
    print_one(ovoid_context_device(context), out);
}

void cli_print_devices(const ovoid_context *context, FILE *out) {
    for (size_t n = 0; n < ovoid_context_device_count(context); n++)
        print_one(ovoid_context_device_at(context, n), out);
}
