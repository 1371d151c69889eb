/*
 * Put before the OpenCL loader (LD_PRELOAD), makes each device one that runs 64 work-items in step,
 * as AMD's say of themselves.
 */
#define _GNU_SOURCE /* RTLD_NEXT */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <CL/cl_ext.h>

#include <dlfcn.h>
#include <stdint.h>

cl_int CL_API_CALL clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t room, void *to,
                                   size_t *needed) {
    __typeof__(&clGetDeviceInfo) next =
        (__typeof__(&clGetDeviceInfo))(uintptr_t)dlsym(RTLD_NEXT, "clGetDeviceInfo");
    if (what != CL_DEVICE_WAVEFRONT_WIDTH_AMD)
        return next(device, what, room, to, needed);
    if (needed)
        *needed = sizeof(cl_uint);
    if (to && room >= sizeof(cl_uint))
        *(cl_uint *)to = 64;
    return CL_SUCCESS;
}
