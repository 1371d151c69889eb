/* Where on the PCI bus a device is, and its UUID: Khronos has extensions for both, and NVIDIA and
 * AMD had their own before. A query of an extension that a driver does not list may do anything, so
 * the list is asked first. */
#include "device/internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Of cl_khr_device_uuid, cl_khr_pci_bus_info, cl_nv_device_attribute_query and
 * cl_amd_device_attribute_query; older headers lack some. */
#define DEVICE_UUID 0x106A
#define DEVICE_PCI_BUS_INFO 0x410F
#define DEVICE_PCI_BUS_ID_NV 0x4008
#define DEVICE_PCI_SLOT_ID_NV 0x4009
#define DEVICE_PCI_DOMAIN_ID_NV 0x400A
#define DEVICE_TOPOLOGY_AMD 0x4037
#define TOPOLOGY_PCIE_AMD 1

/* NULL where there is none, or no memory. */
static char *extensions_of(cl_device_id id) {
    size_t bytes = 0;
    if (clGetDeviceInfo(id, CL_DEVICE_EXTENSIONS, 0, NULL, &bytes) != CL_SUCCESS || !bytes)
        return NULL;
    char *const text = calloc(bytes + 1, 1);
    if (text && clGetDeviceInfo(id, CL_DEVICE_EXTENSIONS, bytes, text, NULL) != CL_SUCCESS)
        text[0] = '\0';
    return text;
}

static bool has(const char *extensions, const char *name) {
    const size_t length = strlen(name);
    for (const char *at = strstr(extensions, name); at; at = strstr(at + 1, name))
        if ((at == extensions || at[-1] == ' ') && (!at[length] || at[length] == ' '))
            return true;
    return false;
}

static bool get(cl_device_id id, cl_device_info what, size_t bytes, void *value) {
    size_t told = 0;
    return clGetDeviceInfo(id, what, bytes, value, &told) == CL_SUCCESS && told == bytes;
}

static void print_pci(ovoid_device_info *info, unsigned domain, unsigned bus, unsigned device,
                      unsigned function) {
    snprintf(info->pci, sizeof info->pci, "%04x:%02x:%02x.%x", domain & 0xffffu, bus & 0xffu,
             device & 0x1fu, function & 7u);
}

static void find_pci(cl_device_id id, const char *extensions, ovoid_device_info *info) {
    cl_uint khronos[4], bus, slot, domain = 0; /* domain, bus, device, function */
    struct {
        cl_uint type;
        cl_char unused[17];
        cl_uchar bus, device, function;
    } amd;
    if (has(extensions, "cl_khr_pci_bus_info") && get(id, DEVICE_PCI_BUS_INFO, 16, khronos)) {
        print_pci(info, khronos[0], khronos[1], khronos[2], khronos[3]);
    } else if (has(extensions, "cl_nv_device_attribute_query") &&
               get(id, DEVICE_PCI_BUS_ID_NV, 4, &bus) && get(id, DEVICE_PCI_SLOT_ID_NV, 4, &slot)) {
        if (!get(id, DEVICE_PCI_DOMAIN_ID_NV, 4, &domain))
            domain = 0;
        print_pci(info, domain, bus, slot >> 3, slot);
    } else if (has(extensions, "cl_amd_device_attribute_query") &&
               get(id, DEVICE_TOPOLOGY_AMD, sizeof amd, &amd) && amd.type == TOPOLOGY_PCIE_AMD) {
        print_pci(info, 0, amd.bus, amd.device, amd.function);
    }
}

static void find_uuid(cl_device_id id, const char *extensions, ovoid_device_info *info) {
    static const char dash_before[16] = {[4] = 1, [6] = 1, [8] = 1, [10] = 1};
    unsigned char bytes[16];
    size_t at = 0;
    if (!has(extensions, "cl_khr_device_uuid") || !get(id, DEVICE_UUID, sizeof bytes, bytes))
        return;
    for (size_t k = 0; k < sizeof bytes; k++)
        at += (size_t)snprintf(info->uuid + at, sizeof info->uuid - at, "%s%02x",
                               dash_before[k] ? "-" : "", bytes[k]);
}

void ov_device_identify(cl_device_id id, ovoid_device_info *info) {
    char *const extensions = extensions_of(id);
    info->pci[0] = info->uuid[0] = '\0';
    if (extensions) {
        find_pci(id, extensions, info);
        find_uuid(id, extensions, info);
    }
    free(extensions);
}
