/*
 * An OpenCL driver for the tests of finding devices: one platform whose devices have a defect each,
 * or which fails as a whole when FAKE_ICD is "fail". When it is "gpu", a GPU without a defect comes
 * last. The loader opens it through OCL_ICD_VENDORS.
 */
#include <CL/cl.h>
#include <CL/cl_ext.h>
#include <CL/cl_icd.h>

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct _cl_platform_id {
    const cl_icd_dispatch *dispatch;
};

struct _cl_device_id {
    const cl_icd_dispatch *dispatch;
    const char *name;
    const char *version;
    cl_device_type type;
    cl_bool available;
    cl_bool compiler;
    const char *extensions; /* NULL: none */
};

static cl_int give(const void *from, size_t bytes, size_t room, void *to, size_t *needed) {
    if (needed)
        *needed = bytes;
    if (to && room < bytes)
        return CL_INVALID_VALUE;
    if (to)
        memcpy(to, from, bytes);
    return CL_SUCCESS;
}

static cl_int give_text(const char *text, size_t room, void *to, size_t *needed) {
    return give(text, strlen(text) + 1, room, to, needed);
}

static cl_int CL_API_CALL platform_info(cl_platform_id platform, cl_platform_info what, size_t room,
                                        void *to, size_t *needed) {
    (void)platform;
    switch (what) {
    case CL_PLATFORM_EXTENSIONS:
        return give_text("cl_khr_icd", room, to, needed);
    case CL_PLATFORM_ICD_SUFFIX_KHR:
        return give_text("FAKE", room, to, needed);
    case CL_PLATFORM_NAME:
        return give_text("Fake Platform", room, to, needed);
    default:
        return give_text("OpenCL 1.2 fake", room, to, needed);
    }
}

/* What the extensions tell, of each device that lists them: PCI addresses and a UUID. */
#ifndef CL_DEVICE_UUID_KHR
#define CL_DEVICE_UUID_KHR 0x106A
#endif
#ifndef CL_DEVICE_PCI_BUS_INFO_KHR
#define CL_DEVICE_PCI_BUS_INFO_KHR 0x410F
#endif
#define PCI_BUS_ID_NV 0x4008
#define PCI_SLOT_ID_NV 0x4009
static cl_int identity_info(cl_device_info what, size_t room, void *to, size_t *needed) {
    static const unsigned char uuid[16] = {0x01, 0x23, 0x45, 0x67, 0x89, 0xab, 0xcd, 0xef,
                                           0x01, 0x23, 0x45, 0x67, 0x89, 0xab, 0xcd, 0xef};
    static const cl_uint address[4] = {1, 0x3b, 0, 2}, bus = 0xaf, slot = 1 << 3;
    switch (what) {
    case CL_DEVICE_UUID_KHR:
        return give(uuid, sizeof uuid, room, to, needed);
    case CL_DEVICE_PCI_BUS_INFO_KHR:
        return give(address, sizeof address, room, to, needed);
    case PCI_BUS_ID_NV:
        return give(&bus, sizeof bus, room, to, needed);
    case PCI_SLOT_ID_NV:
        return give(&slot, sizeof slot, room, to, needed);
    default:
        return CL_INVALID_VALUE;
    }
}

static bool is_silent(cl_device_id device, cl_device_info what);

static cl_int CL_API_CALL device_info(cl_device_id device, cl_device_info what, size_t room,
                                      void *to, size_t *needed) {
    const cl_ulong memory = 1 << 20;
    const cl_uint zero = 0;
    const size_t group = 64;
    if (is_silent(device, what))
        return CL_OUT_OF_RESOURCES;
    switch (what) {
    case CL_DEVICE_NAME:
        return device->name ? give_text(device->name, room, to, needed) : CL_OUT_OF_RESOURCES;
    case CL_DEVICE_TYPE:
        return give(&device->type, sizeof device->type, room, to, needed);
    case CL_DEVICE_VERSION:
        return give_text(device->version, room, to, needed);
    case CL_DEVICE_AVAILABLE:
        return give(&device->available, sizeof device->available, room, to, needed);
    case CL_DEVICE_COMPILER_AVAILABLE:
        return give(&device->compiler, sizeof device->compiler, room, to, needed);
    case CL_DEVICE_VENDOR:
    case CL_DRIVER_VERSION:
        return give_text("fake", room, to, needed);
    case CL_DEVICE_GLOBAL_MEM_SIZE:
    case CL_DEVICE_MAX_MEM_ALLOC_SIZE:
        return give(&memory, sizeof memory, room, to, needed);
    case CL_DEVICE_MAX_WORK_GROUP_SIZE:
        return give(&group, sizeof group, room, to, needed);
    case CL_DEVICE_EXTENSIONS:
        return give_text(device->extensions ? device->extensions : "", room, to, needed);
    case CL_DEVICE_UUID_KHR:
    case CL_DEVICE_PCI_BUS_INFO_KHR:
    case PCI_BUS_ID_NV:
    case PCI_SLOT_ID_NV:
        return identity_info(what, room, to, needed);
    default:
        return give(&zero, sizeof zero, room, to, needed);
    }
}

static cl_int CL_API_CALL device_ids(cl_platform_id platform, cl_device_type type, cl_uint room,
                                     cl_device_id *ids, cl_uint *count);

static cl_context CL_API_CALL create_context(const cl_context_properties *properties, cl_uint count,
                                             const cl_device_id *devices,
                                             void(CL_CALLBACK *notify)(const char *, const void *,
                                                                       size_t, void *),
                                             void *user, cl_int *code) {
    (void)properties, (void)count, (void)devices, (void)notify, (void)user;
    *code = CL_OUT_OF_HOST_MEMORY;
    return NULL;
}

static const cl_icd_dispatch dispatch = {
    .clGetPlatformInfo = platform_info,
    .clGetDeviceIDs = device_ids,
    .clGetDeviceInfo = device_info,
    .clCreateContext = create_context,
};

static struct _cl_platform_id fake_platform = {&dispatch};

static struct _cl_device_id fake_devices[] = {
    {&dispatch, "Fake Mute", "OpenCL 1.2", CL_DEVICE_TYPE_GPU, CL_TRUE, CL_FALSE, NULL},
    {&dispatch, "Fake Away", "OpenCL 1.2", CL_DEVICE_TYPE_GPU, CL_FALSE, CL_TRUE, NULL},
    {&dispatch, "Fake Old", "OpenCL 1.1", CL_DEVICE_TYPE_ACCELERATOR, CL_TRUE, CL_TRUE, NULL},
    {&dispatch, NULL, "OpenCL 1.2", CL_DEVICE_TYPE_GPU, CL_TRUE, CL_TRUE, NULL},
    {&dispatch, "  Fake\t Full  4090 ", "OpenCL 3.0 x", CL_DEVICE_TYPE_ACCELERATOR, CL_TRUE,
     CL_TRUE, "cl_khr_device_uuid_not cl_khr_pci_bus_info cl_khr_device_uuid"},
    {&dispatch, "Fake Screen", "OpenCL 1.2", CL_DEVICE_TYPE_GPU, CL_TRUE, CL_TRUE,
     "cl_khr_icd cl_nv_device_attribute_query"},
};

enum { ALL = sizeof fake_devices / sizeof fake_devices[0] };

static bool is_silent(cl_device_id device, cl_device_info what) {
    const char *const silent = getenv("FAKE_SILENT");
    return silent && device == &fake_devices[ALL - 1] && strtoul(silent, NULL, 0) == what;
}

static cl_int CL_API_CALL device_ids(cl_platform_id platform, cl_device_type type, cl_uint room,
                                     cl_device_id *ids, cl_uint *count) {
    const char *mode = getenv("FAKE_ICD");
    const bool gpu = mode && strcmp(mode, "gpu") == 0;
    const cl_uint all = ALL - (gpu ? 0 : 1);
    (void)platform, (void)type;
    if (mode && strcmp(mode, "fail") == 0)
        return CL_OUT_OF_RESOURCES;
    if (mode && strcmp(mode, "none") == 0)
        return CL_DEVICE_NOT_FOUND;
    if (count)
        *count = all;
    for (cl_uint i = 0; ids && i < room && i < all; i++)
        ids[i] = &fake_devices[i];
    return CL_SUCCESS;
}

static cl_int CL_API_CALL platform_ids(cl_uint room, cl_platform_id *ids, cl_uint *count) {
    if (count)
        *count = 1;
    if (ids && room)
        ids[0] = &fake_platform;
    return CL_SUCCESS;
}

#define EXPORT __attribute__((visibility("default")))

EXPORT cl_int CL_API_CALL clGetPlatformInfo(cl_platform_id platform, cl_platform_info what,
                                            size_t room, void *to, size_t *needed) {
    return platform_info(platform, what, room, to, needed);
}

EXPORT void *CL_API_CALL clGetExtensionFunctionAddress(const char *name) {
    union {
        cl_int(CL_API_CALL *function)(cl_uint, cl_platform_id *, cl_uint *);
        void *object;
    } get_platforms = {platform_ids};
    union {
        cl_int(CL_API_CALL *function)(cl_platform_id, cl_platform_info, size_t, void *, size_t *);
        void *object;
    } get_info = {platform_info};
    if (strcmp(name, "clIcdGetPlatformIDsKHR") == 0)
        return get_platforms.object;
    return strcmp(name, "clGetPlatformInfo") == 0 ? get_info.object : NULL;
}
