/* How many threads work on one device at a time. */
#include "device/internal.h"

#include <string.h>

/* Cores for each thread, as drivers have threads of their own, and threads at most: each keeps
 * memory of the host and of the device. */
#define CORES_EACH 2

/* Two threads at work on it end the process: docs/drivers.md. */
static bool is_basic(const ovoid_device_info *info) {
    return strcmp(info->platform, OV_POCL_PLATFORM) == 0 && strncmp(info->name, "basic", 5) == 0;
}

size_t ov_device_company(const ov_device *device, size_t cores) {
    const size_t pay = cores / CORES_EACH;
    const bool simulated = strcmp(device->info.platform, OV_OCLGRIND_PLATFORM) == 0;
    if (device->borrowed || device->profile || simulated || is_basic(&device->info))
        return 1;
    return pay < 1 ? 1 : pay < OVOID_DEFAULT_JOBS ? pay : OVOID_DEFAULT_JOBS;
}
