/*
 * What a fit is sure to take of memory: one that cannot have it is refused before it begins.
 */
#ifndef OV_FIT_NEED_H
#define OV_FIT_NEED_H

#include "device/device.h"

typedef struct ov_need {
    size_t atoms;   /* all that are fitted */
    size_t largest; /* of them, at a time: those of the largest part, or all */
    size_t jobs;    /* parts side by side */
} ov_need;

/* Bytes, of the host and of a device whose memory is the host's: no fit takes less. */
double ov_need_bytes(const ov_need *need);

/* OVOID_ERROR_LIMIT where so many bytes are clearly not enough, with what to change. */
ovoid_status ov_need_compare(ovoid_context *context, const ov_need *need, uint64_t available);

/* Whether there is memory for several times as much, the host's or, of a device that has its own,
 * the device's: what nobody asked for takes no memory that is short. */
bool ov_need_fits(const ov_device *device, const ov_need *need);

/* The same with what there is now, where the device's memory is the host's. */
ovoid_status ov_need_check(ovoid_context *context, const ov_need *need);

#endif
