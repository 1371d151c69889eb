#define _GNU_SOURCE /* RTLD_NEXT */
#include "lose.h"

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <dlfcn.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST = 16 };

static struct {
    size_t place, at;
    int code;
    atomic_size_t calls, contexts;
    cl_device_id device[MOST]; /* as the platform lists them */
    atomic_uint devices;
} lost;

#define NEXT(name) ((__typeof__(&(name)))(uintptr_t)dlsym(RTLD_NEXT, #name))

void lose_device(size_t place, size_t at, int code) {
    lost.place = place;
    lost.at = at;
    lost.code = code;
    atomic_store(&lost.calls, 0);
    atomic_store(&lost.contexts, 0);
}

size_t lose_calls(void) {
    return atomic_load(&lost.calls);
}

size_t lose_contexts(void) {
    return atomic_load(&lost.contexts);
}

/* ---- which device ------------------------------------------------------------------------- */

static void read_environment(void) {
    const char *const text = getenv("OVOID_TEST_LOSE");
    size_t place, at;
    int code;
    if (text && !lost.at && sscanf(text, "%zu:%zu:%d", &place, &at, &code) == 3)
        lose_device(place, at, code);
}

cl_int CL_API_CALL clGetDeviceIDs(cl_platform_id id, cl_device_type type, cl_uint room,
                                  cl_device_id *to, cl_uint *count) {
    const cl_int code = NEXT(clGetDeviceIDs)(id, type, room, to, count);
    if (code == CL_SUCCESS && to && atomic_load(&lost.devices) == 0) {
        read_environment();
        for (cl_uint n = 0; n < room && n < MOST; n++)
            lost.device[n] = to[n];
        atomic_store(&lost.devices, room < MOST ? room : MOST);
    }
    return code;
}

/* Counts a call to the device, and says what it answers. */
static cl_int call_to(cl_device_id device) {
    if (lost.place >= atomic_load(&lost.devices) || device != lost.device[lost.place])
        return CL_SUCCESS;
    const size_t call = atomic_fetch_add(&lost.calls, 1) + 1;
    return lost.at && call >= lost.at ? lost.code : CL_SUCCESS;
}

static cl_int call_to_queue(cl_command_queue queue) {
    cl_device_id device = NULL;
    clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof device, &device, NULL);
    return call_to(device);
}

static cl_int call_to_context(cl_context context) {
    cl_device_id device = NULL;
    clGetContextInfo(context, CL_CONTEXT_DEVICES, sizeof device, &device, NULL);
    return call_to(device);
}

/* ---- the calls ---------------------------------------------------------------------------- */

cl_context CL_API_CALL clCreateContext(
    const cl_context_properties *properties, cl_uint count, const cl_device_id *ids,
    void(CL_CALLBACK *tell)(const char *, const void *, size_t, void *), void *user, cl_int *code) {
    atomic_fetch_add(&lost.contexts, 1);
    const cl_int refused = call_to(ids[0]);
    if (refused == CL_SUCCESS)
        return NEXT(clCreateContext)(properties, count, ids, tell, user, code);
    *code = refused;
    return NULL;
}

cl_mem CL_API_CALL clCreateBuffer(cl_context context, cl_mem_flags flags, size_t bytes, void *data,
                                  cl_int *code) {
    const cl_int refused = call_to_context(context);
    if (refused == CL_SUCCESS)
        return NEXT(clCreateBuffer)(context, flags, bytes, data, code);
    *code = refused;
    return NULL;
}

cl_int CL_API_CALL clEnqueueReadBuffer(cl_command_queue queue, cl_mem buffer, cl_bool wait,
                                       size_t offset, size_t bytes, void *to, cl_uint count,
                                       const cl_event *after, cl_event *event) {
    const cl_int code = call_to_queue(queue);
    return code != CL_SUCCESS ? code
                              : NEXT(clEnqueueReadBuffer)(queue, buffer, wait, offset, bytes, to,
                                                          count, after, event);
}

cl_int CL_API_CALL clEnqueueWriteBuffer(cl_command_queue queue, cl_mem buffer, cl_bool wait,
                                        size_t offset, size_t bytes, const void *from,
                                        cl_uint count, const cl_event *after, cl_event *event) {
    const cl_int code = call_to_queue(queue);
    return code != CL_SUCCESS ? code
                              : NEXT(clEnqueueWriteBuffer)(queue, buffer, wait, offset, bytes, from,
                                                           count, after, event);
}

cl_int CL_API_CALL clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dim,
                                          const size_t *offset, const size_t *global,
                                          const size_t *local, cl_uint count, const cl_event *after,
                                          cl_event *event) {
    const cl_int code = call_to_queue(queue);
    return code != CL_SUCCESS ? code
                              : NEXT(clEnqueueNDRangeKernel)(queue, kernel, dim, offset, global,
                                                             local, count, after, event);
}

cl_int CL_API_CALL clFinish(cl_command_queue queue) {
    const cl_int code = call_to_queue(queue), finished = NEXT(clFinish)(queue);
    return code != CL_SUCCESS ? code : finished;
}
