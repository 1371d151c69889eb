#include "device/internal.h"

#include "base/progress.h"
#include "base/tenant.h"

#include "shared.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- shape -------------------------------------------------------------------------------- */

static bool parse_shape(const char *text, ov_shape *shape) {
    unsigned vector, lanes;
    char x, rest;
    if (!isdigit((unsigned char)text[0]) ||
        sscanf(text, "%4u%c%4u%c", &vector, &x, &lanes, &rest) != 3 || x != 'x')
        return false;
    if (vector != 1 && vector != 4 && vector != 8 && vector != 16)
        return false;
    if (!lanes || OV_PACK % (vector * lanes)) /* OV_PACK is a power of two: so is lanes */
        return false;
    *shape = (ov_shape){vector, lanes};
    return true;
}

static ov_shape natural_shape(const ov_device *device) {
    ov_shape shape = {1, 1};
    if (device->info.type == OVOID_DEVICE_GPU) {
        shape.lanes = OV_PACK;
        while (shape.lanes > 1 && shape.lanes > device->max_group)
            shape.lanes /= 2;
    } else if (device->info.float_width >= 16) {
        shape.vector = 16;
    } else if (device->info.float_width >= 8) {
        shape.vector = 8;
    } else if (device->info.float_width >= 4) {
        shape.vector = 4;
    }
    return shape;
}

static ovoid_status set_shape(ovoid_context *context, ov_device *device) {
    const char *wish = getenv("OVOID_SHAPE");
    device->shape = natural_shape(device);
    if (!wish || !*wish)
        return OVOID_OK;
    if (!parse_shape(wish, &device->shape))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "OVOID_SHAPE=%s: VxL is needed with V one of 1, 4, 8, 16, L a power of two "
                       "and V * L a divisor of %d",
                       wish, OV_PACK);
    if (device->shape.lanes > device->max_group)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "OVOID_SHAPE=%s: %s runs groups of at most %zu work-items", wish,
                       device->info.name, device->max_group);
    return OVOID_OK;
}

/* ---- groups ------------------------------------------------------------------------------- */

/* Work-items that a GPU runs in step, where it says so; 0 where it does not. */
#ifndef CL_DEVICE_PREFERRED_WORK_GROUP_SIZE_MULTIPLE
#define CL_DEVICE_PREFERRED_WORK_GROUP_SIZE_MULTIPLE 0x1067 /* OpenCL 3.0 */
#endif
#ifndef CL_DEVICE_WAVEFRONT_WIDTH_AMD
#define CL_DEVICE_WAVEFRONT_WIDTH_AMD 0x4043
#endif
static size_t wave_of(const ov_device *device) {
    size_t multiple = 0;
    cl_uint width = 0;
    if (clGetDeviceInfo(device->id, CL_DEVICE_WAVEFRONT_WIDTH_AMD, sizeof width, &width, NULL) ==
        CL_SUCCESS)
        return width;
    if (clGetDeviceInfo(device->id, CL_DEVICE_PREFERRED_WORK_GROUP_SIZE_MULTIPLE, sizeof multiple,
                        &multiple, NULL) == CL_SUCCESS)
        return multiple;
    return 0;
}

/* Groups whose work-items share memory: the solver's are a warp, or a wave of 64 where the device
 * has those; those that share a term are several, since few terms with long lists have to fill the
 * device. Powers of two, and no more than the device runs. */
#define WARP 32
#define WAVE 64
#define TEAM 256
static uint32_t group_of(const ov_device *device, uint32_t group) {
    while (group > 1 && group > device->max_group)
        group /= 2;
    return group;
}

static void set_groups(ov_device *device) {
    device->solve_group = group_of(device, wave_of(device) >= WAVE ? WAVE : WARP);
    device->team = device->shape.lanes == 1 ? 1 : group_of(device, TEAM); /* lanes fit into it */
}

/* ---- opening and closing ------------------------------------------------------------------ */

static void release(ov_device *device) {
    if (!device)
        return;
    const bool lost = ov_opencl_lost();
    ov_programs_release(device);
    ov_pool_close(device->pool);
    if (device->queue && !lost)
        clFinish(device->queue);
    ov_profile_release(device);
    if (device->queue && !lost)
        clReleaseCommandQueue(device->queue);
    if (device->context && !lost)
        clReleaseContext(device->context);
    if (device->borrowed && !lost)
        clReleaseDevice(device->id);
    free(device->staged);
    free(device->others);
    free(device);
}

void ov_device_close(ovoid_context *context) {
    if (!context)
        return;
    ov_tenants_leave(context);
    release(context->device);
    context->device = NULL;
    context->close_device = NULL;
}

/* A context and a queue of Ovoid's own. */
static cl_int create_queue(ov_device *device, const char **call) {
    const cl_context_properties properties[] = {CL_CONTEXT_PLATFORM,
                                                (cl_context_properties)device->platform, 0};
    cl_int code;
    *call = "clCreateContext";
    device->context = clCreateContext(properties, 1, &device->id, NULL, NULL, &code);
    if (code == CL_SUCCESS) {
        *call = "clCreateCommandQueue";
        device->queue = clCreateCommandQueue(device->context, device->id, 0, &code);
    }
    return code;
}

/* The caller's. */
static cl_int retain_queue(ov_device *device, const ov_handles *handles, const char **call) {
    *call = "clRetainDevice";
    cl_int code = clRetainDevice(device->id);
    device->borrowed = code == CL_SUCCESS;
    if (code == CL_SUCCESS) {
        *call = "clRetainContext";
        code = clRetainContext(handles->context);
    }
    if (code == CL_SUCCESS) {
        device->context = handles->context;
        *call = "clRetainCommandQueue";
        code = clRetainCommandQueue(handles->queue);
    }
    if (code == CL_SUCCESS)
        device->queue = handles->queue;
    return code;
}

ovoid_status ov_device_plan(ovoid_context *context, const ov_device_entry *entry,
                            ov_device *device) {
    device->info = entry->info;
    device->platform = entry->platform;
    device->id = entry->id;
    const cl_int code = clGetDeviceInfo(device->id, CL_DEVICE_MAX_WORK_GROUP_SIZE,
                                        sizeof device->max_group, &device->max_group, NULL);
    if (code != CL_SUCCESS)
        return ov_cl_fail_on(context, code, "clGetDeviceInfo", NULL, entry->info.name);
    const ovoid_status status = set_shape(context, device);
    if (status == OVOID_OK)
        set_groups(device);
    return status;
}

static ovoid_status make_device(ovoid_context *context, const ov_device_entry *entry,
                                const ov_handles *handles, ov_device **made) {
    ovoid_status status = OVOID_OK;
    const char *call;
    ov_device *device = ov_alloc(context, 1, sizeof *device, "a device");
    if (!device)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_device_plan(context, entry, device));
    const cl_int code =
        handles ? retain_queue(device, handles, &call) : create_queue(device, &call);
    if (code != CL_SUCCESS) {
        status = ov_cl_fail_on(context, code, call, NULL, entry->info.name);
        goto cleanup;
    }
    if (!(device->pool = ov_pool_create(context, device->info.global_memory))) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    if (context->profile)
        OV_TRY(ov_profile_start(context, device));
    *made = device;
    device = NULL;
cleanup:
    release(device);
    return status;
}

ovoid_status ov_device_open(ovoid_context *context, const ov_device_entry *entry,
                            const ov_handles *handles) {
    ov_device *device = NULL;
    const ovoid_status status = make_device(context, entry, handles, &device);
    if (status != OVOID_OK)
        return status;
    ov_device_close(context);
    context->device = device;
    context->close_device = ov_device_close;
    return OVOID_OK;
}

/* ---- counts ------------------------------------------------------------------------------- */

uint64_t ovoid_context_count(const ovoid_context *context, ovoid_count what) {
    const ov_device *const device = context ? context->device : NULL;
    return device && (unsigned)what < OVOID_COUNTS ? device->counts[what] : 0;
}

void ov_device_counted(const ov_device *device, const uint64_t before[OVOID_COUNTS],
                       uint64_t counts[OVOID_COUNTS]) {
    for (size_t n = 0; n < OVOID_COUNTS; ++n)
        counts[n] = device->counts[n] - (before ? before[n] : 0);
}

ovoid_status ov_device_get(ovoid_context *context, ov_device **device) {
    if (!context->device) {
        ovoid_status status = ovoid_context_open_device(context, NULL);
        if (status != OVOID_OK)
            return status;
    }
    *device = context->device;
    return ov_opencl_check(context);
}
