/*
 * No OpenCL driver survives fork(): its threads are gone in the child, and locks that they held
 * stay locked. So the child must not even release what it inherited.
 */
#include "device/internal.h"

#include <stdatomic.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_long first_user; /* the process that used OpenCL first; 0: none yet */

bool ov_opencl_lost(void) {
    const long user = atomic_load(&first_user);
    return user != 0 && user != (long)getpid();
}

void ov_release_memory(cl_mem memory) {
    if (!ov_opencl_lost())
        clReleaseMemObject(memory);
}

void ov_release_kernel(cl_kernel kernel) {
    if (!ov_opencl_lost())
        clReleaseKernel(kernel);
}

void ov_release_program(cl_program program) {
    if (!ov_opencl_lost())
        clReleaseProgram(program);
}

ovoid_status ov_opencl_check(ovoid_context *context) {
    if (!ov_opencl_lost())
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_DEVICE,
                   "this process was forked from process %ld after that had used OpenCL, which no "
                   "driver survives: fork before the first use, or exec",
                   atomic_load(&first_user));
}

ovoid_status ov_opencl_begin(ovoid_context *context) {
    long nobody = 0;
    atomic_compare_exchange_strong(&first_user, &nobody, (long)getpid());
    return ov_opencl_check(context);
}
