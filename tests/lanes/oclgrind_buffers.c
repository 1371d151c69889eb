/*
 * Preloaded before Oclgrind's own library: buffers are never released.
 *
 * Oclgrind 21.10 gives the address of a released buffer to the next one, but keeps its record of
 * which bytes are initialised, with the old size. What lies beyond that counts as uninitialised for
 * ever, in a buffer that is not.
 */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

cl_int clReleaseMemObject(cl_mem memory) {
    (void)memory;
    return CL_SUCCESS;
}
