#include "device/internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A launch whose time has not been read yet. */
typedef struct pending {
    cl_event event;
    size_t kernel; /* index in ov_profile.kernels */
} pending;

struct ov_profile {
    bool on;    /* launches are counted; else what was counted is kept to be read */
    bool timed; /* the driver gave a queue that tells times */
    ovoid_kernel_time *kernels;
    size_t count, capacity;
    pending pending[OV_PROFILE_PENDING]; /* in the order of their launches */
    size_t pending_count;
};

/* ---- launches ----------------------------------------------------------------------------- */

/* No device runs a kernel in the first microsecond of its clock, but the rusticl of Mesa 22 says so
 * of every kernel, for want of a clock. */
#define EARLIEST_END 1000 /* nanoseconds */

/* NAN where the driver does not tell. */
static double seconds_of(cl_event event) {
    cl_ulong start = 0, end = 0;
    if (clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_START, sizeof start, &start, NULL) !=
            CL_SUCCESS ||
        clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_END, sizeof end, &end, NULL) !=
            CL_SUCCESS ||
        end < EARLIEST_END || end < start)
        return NAN;
    return 1e-9 * (double)(end - start);
}

ovoid_status ov_profile_drain(ovoid_context *context, ov_device *device) {
    ov_profile *profile = device->profile;
    if (!profile || profile->pending_count == 0)
        return OVOID_OK;
    const ovoid_status status = ov_opencl_check(context);
    if (status != OVOID_OK)
        return status;
    /* The queue is in order: the last launch is the last to end. */
    const pending last = profile->pending[profile->pending_count - 1];
    cl_int code = clWaitForEvents(1, &last.event);
    for (size_t i = 0; i < profile->pending_count; i++) {
        const pending *one = &profile->pending[i];
        profile->kernels[one->kernel].seconds += code == CL_SUCCESS ? seconds_of(one->event) : NAN;
        clReleaseEvent(one->event);
    }
    profile->pending_count = 0;
    return code == CL_SUCCESS
               ? OVOID_OK
               : ov_cl_fail_on(context, code, "clWaitForEvents", profile->kernels[last.kernel].name,
                               device->info.name);
}

ovoid_status ov_profile_prepare(ovoid_context *context, ov_device *device, bool *timed) {
    ov_profile *profile = device->profile;
    *timed = profile && profile->on && profile->timed;
    if (!profile || !profile->on)
        return OVOID_OK;
    ovoid_status status = ov_grow(context, &profile->kernels, &profile->capacity,
                                  profile->count + 1, sizeof *profile->kernels, "a profile");
    if (status == OVOID_OK && profile->pending_count == OV_PROFILE_PENDING)
        status = ov_profile_drain(context, device);
    return status;
}

void ov_profile_add(ov_device *device, const char *name, cl_event event) {
    ov_profile *profile = device->profile;
    size_t k = 0;
    if (!profile || !profile->on)
        return;
    while (k < profile->count && strcmp(profile->kernels[k].name, name) != 0)
        k++;
    if (k == profile->count)
        profile->kernels[profile->count++] = (ovoid_kernel_time){.name = name};
    profile->kernels[k].launches++;
    if (event)
        profile->pending[profile->pending_count++] = (pending){event, k};
    else
        profile->kernels[k].seconds = NAN;
}

/* ---- on and off --------------------------------------------------------------------------- */

void ov_profile_release(ov_device *device) {
    ov_profile *profile = device->profile;
    if (!profile)
        return;
    for (size_t i = 0; i < profile->pending_count && !ov_opencl_lost(); i++)
        clReleaseEvent(profile->pending[i].event);
    free(profile->kernels);
    free(profile);
    device->profile = NULL;
}

/* Whether times are told is a queue's property from its beginning, so another one takes its place.
 * Programs, kernels and buffers belong to no queue. */
static ovoid_status replace_queue(ovoid_context *context, ov_device *device, bool timed,
                                  bool *refused) {
    const char *call = "clFinish";
    cl_int code = clFinish(device->queue);
    if (device->borrowed) { /* the caller's is as it is */
        *refused = timed && !ov_queue_is_timed(device->queue);
        return code == CL_SUCCESS ? OVOID_OK
                                  : ov_cl_fail_on(context, code, call, NULL, device->info.name);
    }
    if (code == CL_SUCCESS) {
        call = "clCreateCommandQueue";
        cl_command_queue queue = clCreateCommandQueue(device->context, device->id,
                                                      timed ? CL_QUEUE_PROFILING_ENABLE : 0, &code);
        if (code == CL_SUCCESS) {
            clReleaseCommandQueue(device->queue);
            device->queue = queue;
        }
    }
    *refused = timed && code == CL_INVALID_QUEUE_PROPERTIES;
    return code == CL_SUCCESS || *refused
               ? OVOID_OK
               : ov_cl_fail_on(context, code, call, NULL, device->info.name);
}

static ovoid_status stop(ovoid_context *context, ov_device *device) {
    ovoid_status status = OVOID_OK;
    ov_profile *profile = device->profile;
    bool refused;
    if (!profile || !profile->on)
        return OVOID_OK;
    OV_TRY(ov_profile_drain(context, device));
    if (profile->timed)
        OV_TRY(replace_queue(context, device, false, &refused));
    profile->on = false;
cleanup:
    return status;
}

ovoid_status ov_profile_start(ovoid_context *context, ov_device *device) {
    ovoid_status status = OVOID_OK;
    ov_profile *profile = ov_alloc(context, 1, sizeof *profile, "a profile");
    bool refused;
    if (!profile)
        return OVOID_ERROR_MEMORY;
    OV_TRY(stop(context, device));
    OV_TRY(replace_queue(context, device, true, &refused));
    ov_profile_release(device);
    device->profile = profile;
    profile->on = true;
    profile->timed = !refused;
    profile = NULL;
cleanup:
    free(profile);
    return status;
}

ovoid_status ovoid_context_profile(ovoid_context *context, bool on) {
    ovoid_status status = OVOID_OK;
    OV_NEED(context, context);
    if (context->device)
        status = ov_opencl_check(context);
    if (context->device && status == OVOID_OK)
        status = on ? ov_profile_start(context, context->device) : stop(context, context->device);
    if (status == OVOID_OK)
        context->profile = on;
    return status;
}

static ovoid_status absorb_times(ovoid_context *context, ov_profile *to, const ov_profile *from) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < from->count; ++n) {
        const ovoid_kernel_time *const one = &from->kernels[n];
        size_t k = 0;
        while (k < to->count && strcmp(to->kernels[k].name, one->name) != 0)
            ++k;
        OV_TRY(
            ov_grow(context, &to->kernels, &to->capacity, k + 1, sizeof *to->kernels, "a profile"));
        if (k == to->count)
            to->kernels[to->count++] = (ovoid_kernel_time){.name = one->name};
        to->kernels[k].launches += one->launches;
        to->kernels[k].seconds += one->seconds;
    }
cleanup:
    return status;
}

ovoid_status ov_device_absorb(ovoid_context *context, ovoid_context *from) {
    ov_device *const to = context->device, *const other = from->device;
    if (!to || !other)
        return OVOID_OK;
    for (size_t n = 0; n < OVOID_COUNTS; ++n)
        to->counts[n] += other->counts[n];
    if (!to->profile || !to->profile->on || !other->profile)
        return OVOID_OK;
    const ovoid_status status = ov_profile_drain(from, other);
    return status == OVOID_OK ? absorb_times(from, to->profile, other->profile) : status;
}

/* ---- times -------------------------------------------------------------------------------- */

/* The longest first; of unknown times, the most launches. */
static int compare(const void *left, const void *right) {
    const ovoid_kernel_time *a = left, *b = right;
    const double x = isnan(a->seconds) ? 0.0 : a->seconds, y = isnan(b->seconds) ? 0.0 : b->seconds;
    if (x != y)
        return x > y ? -1 : 1;
    if (a->launches != b->launches)
        return a->launches > b->launches ? -1 : 1;
    return strcmp(a->name, b->name);
}

ovoid_status ovoid_context_kernel_times(ovoid_context *context, ovoid_kernel_time **times,
                                        size_t *count) {
    OV_NEED(context, context);
    OV_NEED(context, times);
    OV_NEED(context, count);
    const ov_profile *profile = context->device ? context->device->profile : NULL;
    ovoid_kernel_time *copy = NULL;
    if (profile && profile->count) {
        ovoid_status status = ov_profile_drain(context, context->device);
        if (status != OVOID_OK)
            return status;
        copy = ov_alloc(context, profile->count, sizeof *copy, "the times of kernels");
        if (!copy)
            return OVOID_ERROR_MEMORY;
        memcpy(copy, profile->kernels, profile->count * sizeof *copy);
        qsort(copy, profile->count, sizeof *copy, compare);
    }
    *times = copy;
    *count = profile ? profile->count : 0;
    return OVOID_OK;
}
