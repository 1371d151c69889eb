#include "device/internal.h"

#include "base/sized.h"

#include <ctype.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef CL_PLATFORM_NOT_FOUND_KHR
#define CL_PLATFORM_NOT_FOUND_KHR (-1001)
#endif

/* ---- what a device says about itself ------------------------------------------------------ */

/* Some drivers pad names with blanks; control characters would break a table. */
static void tidy(char *text) {
    char *out = text;
    for (const char *in = text; *in; in++) {
        char c = iscntrl((unsigned char)*in) ? ' ' : *in;
        if (c != ' ' || (out > text && out[-1] != ' '))
            *out++ = c;
    }
    if (out > text && out[-1] == ' ')
        out--;
    *out = '\0';
}

static cl_int platform_text(cl_platform_id id, cl_platform_info what, char *text, size_t size) {
    char whole[1024];
    size_t length = 0;
    text[0] = '\0';
    cl_int code = clGetPlatformInfo(id, what, 0, NULL, &length);
    if (code != CL_SUCCESS || length > sizeof whole)
        return code != CL_SUCCESS ? code : CL_INVALID_VALUE;
    code = clGetPlatformInfo(id, what, length, whole, NULL);
    if (code == CL_SUCCESS && length)
        snprintf(text, size, "%.*s", (int)length, whole);
    tidy(text);
    return code;
}

static cl_int device_text(cl_device_id id, cl_device_info what, char *text, size_t size) {
    char whole[1024];
    size_t length = 0;
    text[0] = '\0';
    cl_int code = clGetDeviceInfo(id, what, 0, NULL, &length);
    if (code != CL_SUCCESS || length > sizeof whole)
        return code != CL_SUCCESS ? code : CL_INVALID_VALUE;
    code = clGetDeviceInfo(id, what, length, whole, NULL);
    if (code == CL_SUCCESS && length)
        snprintf(text, size, "%.*s", (int)length, whole);
    tidy(text);
    return code;
}

static cl_uint device_uint(cl_device_id id, cl_device_info what) {
    cl_uint value = 0;
    return clGetDeviceInfo(id, what, sizeof value, &value, NULL) == CL_SUCCESS ? value : 0;
}

/* For what decides on the use of a device: without an answer there is none. */
static cl_int need_uint(cl_device_id id, cl_device_info what, cl_uint *value) {
    return clGetDeviceInfo(id, what, sizeof *value, value, NULL);
}

static uint64_t device_ulong(cl_device_id id, cl_device_info what) {
    cl_ulong value = 0;
    return clGetDeviceInfo(id, what, sizeof value, &value, NULL) == CL_SUCCESS ? value : 0;
}

static uint64_t device_size(cl_device_id id, cl_device_info what) {
    size_t value = 0;
    return clGetDeviceInfo(id, what, sizeof value, &value, NULL) == CL_SUCCESS ? value : 0;
}

static ovoid_device_type type_of(cl_device_type type) {
    if (type & CL_DEVICE_TYPE_CPU) /* first: a simulator that is everything runs on the CPU */
        return OVOID_DEVICE_CPU;
    if (type & CL_DEVICE_TYPE_GPU)
        return OVOID_DEVICE_GPU;
    return type & CL_DEVICE_TYPE_ACCELERATOR ? OVOID_DEVICE_ACCELERATOR : OVOID_DEVICE_OTHER;
}

const char *ov_device_type_name(ovoid_device_type type) {
    static const char *const names[] = {"cpu", "gpu", "accelerator", "other"};
    return (unsigned)type < 4 ? names[type] : "other";
}

static cl_int find_defect(ov_device_entry *entry) {
    int major = 0, minor = 0;
    cl_uint available = 0, compiler = 0;
    cl_int code = need_uint(entry->id, CL_DEVICE_AVAILABLE, &available);
    if (code == CL_SUCCESS)
        code = need_uint(entry->id, CL_DEVICE_COMPILER_AVAILABLE, &compiler);
    if (code != CL_SUCCESS)
        return code;
    if (!available)
        snprintf(entry->defect, sizeof entry->defect, "is not available at the moment");
    else if (!compiler)
        snprintf(entry->defect, sizeof entry->defect, "has no OpenCL compiler");
    else if (sscanf(entry->info.opencl, "OpenCL %d.%d", &major, &minor) != 2 ||
             major * 100 + minor < 102)
        snprintf(entry->defect, sizeof entry->defect, "supports \"%.40s\"; OpenCL 1.2 is needed",
                 entry->info.opencl);
    return CL_SUCCESS;
}

static cl_int describe(ov_device_entry *entry) {
    ovoid_device_info *info = &entry->info;
    cl_device_id id = entry->id;
    cl_int code = clGetDeviceInfo(id, CL_DEVICE_TYPE, sizeof entry->type, &entry->type, NULL);
    if (code == CL_SUCCESS)
        code = device_text(id, CL_DEVICE_NAME, info->name, sizeof info->name);
    if (code == CL_SUCCESS)
        code = device_text(id, CL_DEVICE_VERSION, info->opencl, sizeof info->opencl);
    if (code == CL_SUCCESS) /* the shape of kernels follows it */
        code = need_uint(id, CL_DEVICE_PREFERRED_VECTOR_WIDTH_FLOAT, &info->float_width);
    if (code != CL_SUCCESS)
        return code;
    device_text(id, CL_DEVICE_VENDOR, info->vendor, sizeof info->vendor);
    device_text(id, CL_DRIVER_VERSION, info->driver, sizeof info->driver);
    info->type = type_of(entry->type);
    info->compute_units = device_uint(id, CL_DEVICE_MAX_COMPUTE_UNITS);
    info->clock_mhz = device_uint(id, CL_DEVICE_MAX_CLOCK_FREQUENCY);
    info->fp64 = device_ulong(id, CL_DEVICE_DOUBLE_FP_CONFIG) != 0;
    info->global_memory = device_ulong(id, CL_DEVICE_GLOBAL_MEM_SIZE);
    info->max_allocation = device_ulong(id, CL_DEVICE_MAX_MEM_ALLOC_SIZE);
    info->local_memory = device_ulong(id, CL_DEVICE_LOCAL_MEM_SIZE);
    info->max_group = device_size(id, CL_DEVICE_MAX_WORK_GROUP_SIZE);
    ov_device_identify(id, info);
    return find_defect(entry);
}

/* ---- once per process --------------------------------------------------------------------- */

static pthread_once_t prepared = PTHREAD_ONCE_INIT;
static char prepare_warning[OV_POCL_TEXT]; /* about PoCL */
static bool pocl_usable;
static atomic_flag prepare_warned = ATOMIC_FLAG_INIT;

/* The first OpenCL call loads the drivers; it happens here so that no two threads load them at
 * once.
 */
static void prepare(void) {
    cl_uint count;
    pocl_usable = ov_pocl_usable(prepare_warning, sizeof prepare_warning);
    clGetPlatformIDs(0, NULL, &count);
}

ovoid_status ov_device_describe(ovoid_context *context, cl_device_id id, ov_device_entry *entry) {
    ov_device_entry made = {.id = id, .info.size = sizeof made.info, .info.index = UINT32_MAX};
    pthread_once(&prepared, prepare);
    const char *call = "clGetDeviceInfo";
    cl_int code =
        clGetDeviceInfo(id, CL_DEVICE_PLATFORM, sizeof made.platform, &made.platform, NULL);
    if (code == CL_SUCCESS)
        code = describe(&made);
    if (code == CL_SUCCESS) {
        call = "clGetPlatformInfo";
        code = platform_text(made.platform, CL_PLATFORM_NAME, made.info.platform,
                             sizeof made.info.platform);
        platform_text(made.platform, CL_PLATFORM_VERSION, made.info.platform_version,
                      sizeof made.info.platform_version);
    }
    if (code != CL_SUCCESS)
        return ov_cl_fail_on(context, code, call, NULL, NULL);
    if (!pocl_usable && strcmp(made.info.platform, OV_POCL_PLATFORM) == 0)
        return ov_fail(context, OVOID_ERROR_DEVICE, "%s", prepare_warning);
    if (made.defect[0])
        return ov_fail(context, OVOID_ERROR_DEVICE, "the device, %s, %s", made.info.name,
                       made.defect);
    *entry = made;
    return OVOID_OK;
}

/* ---- the list ----------------------------------------------------------------------------- */

typedef struct list {
    ov_device_entry *entries;
    size_t count;
    size_t capacity;
} list;

static ovoid_status add_device(ovoid_context *context, list *all, cl_platform_id platform,
                               const char *platform_name, cl_device_id id) {
    ov_device_entry entry = {.platform = platform, .id = id, .info.size = sizeof entry.info};
    cl_int code = describe(&entry);
    if (code != CL_SUCCESS) {
        ov_warn(context, "a device of OpenCL platform %s is left out: clGetDeviceInfo: %s (%d)",
                platform_name, ov_cl_name(code), (int)code);
        return OVOID_OK;
    }
    ovoid_status status = ov_grow(context, &all->entries, &all->capacity, all->count + 1,
                                  sizeof *all->entries, "the list of devices");
    if (status != OVOID_OK)
        return status;
    entry.info.index = (uint32_t)all->count;
    snprintf(entry.info.platform, sizeof entry.info.platform, "%s", platform_name);
    platform_text(platform, CL_PLATFORM_VERSION, entry.info.platform_version,
                  sizeof entry.info.platform_version);
    all->entries[all->count++] = entry;
    return OVOID_OK;
}

static ovoid_status add_platform(ovoid_context *context, list *all, cl_platform_id platform) {
    ovoid_status status = OVOID_OK;
    cl_device_id *ids = NULL;
    cl_uint count = 0;
    char name[sizeof all->entries->info.platform];
    const char *call = "clGetPlatformInfo";
    cl_int code = platform_text(platform, CL_PLATFORM_NAME, name, sizeof name);
    if (code == CL_SUCCESS && strcmp(name, OV_POCL_PLATFORM) == 0 && prepare_warning[0] &&
        context->warn && (!atomic_flag_test_and_set(&prepare_warned) || !pocl_usable))
        ov_warn(context, "%s%s",
                pocl_usable ? "" : "the devices of PoCL are left out: ", prepare_warning);
    if (code == CL_SUCCESS && strcmp(name, OV_POCL_PLATFORM) == 0 && !pocl_usable)
        return OVOID_OK;
    if (code == CL_SUCCESS) {
        call = "clGetDeviceIDs";
        code = clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 0, NULL, &count);
    }
    if (code == CL_DEVICE_NOT_FOUND || (code == CL_SUCCESS && !count))
        return OVOID_OK; /* a driver without its hardware, as Mesa's often are */
    if (code == CL_SUCCESS) {
        ids = ov_alloc(context, count, sizeof(cl_device_id), "the list of devices");
        if (!ids)
            return OVOID_ERROR_MEMORY;
        code = clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, count, ids, NULL);
    }
    if (code != CL_SUCCESS) {
        ov_warn(context, "OpenCL platform %s is left out: %s: %s (%d)", name[0] ? name : "?", call,
                ov_cl_name(code), (int)code);
        goto cleanup;
    }
    for (cl_uint i = 0; i < count; i++)
        OV_TRY(add_device(context, all, platform, name, ids[i]));
cleanup:
    free(ids);
    return status;
}

ovoid_status ov_devices_list(ovoid_context *context, ov_device_entry **entries, size_t *count,
                             size_t *platforms) {
    ovoid_status status = OVOID_OK;
    cl_platform_id *ids = NULL;
    cl_uint found = 0;
    list all = {0};
    OV_TRY(ov_opencl_begin(context));
    pthread_once(&prepared, prepare);
    cl_int code = clGetPlatformIDs(0, NULL, &found);
    if (code == CL_PLATFORM_NOT_FOUND_KHR)
        found = 0;
    else if (code != CL_SUCCESS)
        return ov_cl_fail_on(context, code, "clGetPlatformIDs", NULL, NULL);
    ids = ov_alloc(context, found, sizeof(cl_platform_id), "the list of platforms");
    if (!ids)
        return OVOID_ERROR_MEMORY;
    if (found)
        code = clGetPlatformIDs(found, ids, NULL);
    if (found && code != CL_SUCCESS) {
        status = ov_cl_fail_on(context, code, "clGetPlatformIDs", NULL, NULL);
        goto cleanup;
    }
    for (cl_uint i = 0; i < found; i++)
        OV_TRY(add_platform(context, &all, ids[i]));
    *entries = all.entries;
    *count = all.count;
    *platforms = found;
    all.entries = NULL;
cleanup:
    free(all.entries);
    free(ids);
    return status;
}

ovoid_status ovoid_devices(ovoid_context *context, size_t size, ovoid_device_info **devices,
                           size_t *count) {
    ovoid_status status = OVOID_OK;
    ov_device_entry *entries = NULL;
    char *infos = NULL;
    size_t found = 0, platforms = 0;
    char hint[OV_VENDORS_TEXT];
    OV_NEED(context, context);
    OV_NEED(context, devices);
    OV_NEED(context, count);
    OV_TRY(ov_sized_check(context, "ovoid_device_info", &size));
    OV_TRY(ov_devices_list(context, &entries, &found, &platforms));
    if (found) {
        infos = ov_alloc(context, found, size, "the list of devices");
        if (!infos) {
            status = OVOID_ERROR_MEMORY;
            goto cleanup;
        }
        for (size_t i = 0; i < found; i++)
            ov_sized_init(infos + i * size, size, &entries[i].info, sizeof entries[i].info);
    }
    if (context->warn && ov_vendors_hint(entries, found, hint))
        ov_warn(context, "%s", hint);
    *devices = (ovoid_device_info *)(void *)infos;
    *count = found;
cleanup:
    free(entries);
    return status;
}
