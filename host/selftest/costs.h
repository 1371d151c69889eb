/* What a device costs before it computes anything. */
#ifndef OV_COSTS_H
#define OV_COSTS_H

#include "device/device.h"

typedef struct ov_costs {
    double launch, round_trip;     /* seconds */
    double to_device, from_device; /* bytes per second */
} ov_costs;

/* Opens the default device if none is. */
ovoid_status ov_costs_measure(ovoid_context *context, ov_costs *costs);

#endif
