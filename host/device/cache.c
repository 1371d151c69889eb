#include "device/internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool ov_cache_wanted(const ov_device *device) {
    (void)device;
    return false;
}

unsigned char *ov_cache_read(ov_device *device, const ov_cache_entry *entry, size_t *bytes) {
    (void)device;
    (void)entry;
    *bytes = 0;
    return NULL;
}

void ov_cache_write(ovoid_context *context, ov_device *device, const ov_cache_entry *entry,
                    const unsigned char *binary, size_t bytes) {
    (void)context;
    (void)device;
    (void)entry;
    (void)binary;
    (void)bytes;
}
