#define _GNU_SOURCE /* RTLD_NEXT */
#include "faults.h"

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct {
    bool armed, on;
    fault_kind kind;
    size_t at, calls;
    const char *call[1 << 16]; /* what the first ones are */
    const char *failed[32];    /* names, each once, the first one first */
    int code;
    long objects, allocations;
} faults;

void faults_arm(fault_kind kind, size_t at, bool on) {
    faults.armed = true;
    faults.on = on;
    faults.kind = kind;
    faults.at = at;
    faults.calls = 0;
    memset(faults.failed, 0, sizeof faults.failed);
    faults.code = 0;
}

size_t faults_disarm(void) {
    faults.armed = false;
    return faults.calls;
}

const char *faults_call(size_t at) {
    const size_t known = sizeof faults.call / sizeof *faults.call;
    return at > 0 && at <= faults.calls && at <= known ? faults.call[at - 1] : NULL;
}

const char *faults_first(void) {
    return faults.failed[0];
}

const char *faults_named(const char *text) {
    for (const char **name = faults.failed; *name; ++name)
        if (strstr(text, *name))
            return *name;
    return NULL;
}

int faults_code(void) {
    return faults.code;
}

long faults_objects(void) {
    return faults.objects;
}

long faults_allocations(void) {
    return faults.allocations;
}

/* Counts a call, and says whether it is to fail. what: its name, or more exactly. */
static bool fails_as(fault_kind kind, const char *name, const char *what) {
    if (!faults.armed || kind != faults.kind)
        return false;
    const size_t call = ++faults.calls;
    if (call <= sizeof faults.call / sizeof *faults.call)
        faults.call[call - 1] = what;
    if (!faults.at || call < faults.at || (call > faults.at && !faults.on))
        return false;
    const char **place = faults.failed;
    while (*place && strcmp(*place, name) != 0)
        ++place;
    *place = name; /* there are fewer names than places */
    return true;
}

static bool fails(fault_kind kind, const char *name) {
    return fails_as(kind, name, name);
}

/* ---- OpenCL ------------------------------------------------------------------------------- */

#define NEXT(name) ((__typeof__(&(name)))(uintptr_t)dlsym(RTLD_NEXT, #name))

/* What a failing call answers: in turn one code of either kind. */
static cl_int refuse_as(const char *name, const char *what) {
    if (!fails_as(FAULT_OPENCL, name, what))
        return CL_SUCCESS;
    const cl_int code = faults.at % 2 ? CL_OUT_OF_RESOURCES : CL_OUT_OF_HOST_MEMORY;
    if (!faults.code)
        faults.code = code;
    return code;
}

static cl_int refuse(const char *name) {
    return refuse_as(name, name);
}

/* A call that answers a code. */
#define CALL(name, parameters, arguments)                                                          \
    cl_int CL_API_CALL name parameters {                                                           \
        const cl_int code = refuse(#name);                                                         \
        return code != CL_SUCCESS ? code : NEXT(name) arguments;                                   \
    }

/* One that makes an event where it is asked to: with and without, they are two kinds of calls. */
#define ENQUEUE(name, parameters, arguments)                                                       \
    cl_int CL_API_CALL name parameters {                                                           \
        cl_int code = refuse_as(#name, event ? #name " with an event" : #name);                    \
        if (code != CL_SUCCESS)                                                                    \
            return code;                                                                           \
        code = NEXT(name) arguments;                                                               \
        faults.objects += code == CL_SUCCESS && event;                                             \
        return code;                                                                               \
    }

/* One that makes an object and leaves its code in *code, which may be NULL. */
#define MAKE(type, name, parameters, arguments)                                                    \
    type CL_API_CALL name parameters {                                                             \
        const cl_int refused = refuse(#name);                                                      \
        if (refused == CL_SUCCESS) {                                                               \
            type const made = NEXT(name) arguments;                                                \
            faults.objects += made != NULL;                                                        \
            return made;                                                                           \
        }                                                                                          \
        if (code)                                                                                  \
            *code = refused;                                                                       \
        return NULL;                                                                               \
    }

/* One that releases an object, and does so even where it fails: else the object would be lost. */
#define RELEASE(name, type)                                                                        \
    cl_int CL_API_CALL name(type object) {                                                         \
        const cl_int code = refuse(#name), released = NEXT(name)(object);                          \
        faults.objects -= released == CL_SUCCESS;                                                  \
        return code != CL_SUCCESS ? code : released;                                               \
    }

CALL(clGetPlatformIDs, (cl_uint room, cl_platform_id *to, cl_uint *count), (room, to, count))
CALL(clGetPlatformInfo,
     (cl_platform_id id, cl_platform_info what, size_t room, void *to, size_t *size),
     (id, what, room, to, size))
CALL(clGetDeviceIDs,
     (cl_platform_id id, cl_device_type type, cl_uint room, cl_device_id *to, cl_uint *count),
     (id, type, room, to, count))
CALL(clGetDeviceInfo, (cl_device_id id, cl_device_info what, size_t room, void *to, size_t *size),
     (id, what, room, to, size))
MAKE(cl_context, clCreateContext,
     (const cl_context_properties *properties, cl_uint count, const cl_device_id *ids,
      void(CL_CALLBACK *tell)(const char *, const void *, size_t, void *), void *user,
      cl_int *code),
     (properties, count, ids, tell, user, code))
MAKE(cl_command_queue, clCreateCommandQueue,
     (cl_context context, cl_device_id id, cl_command_queue_properties properties, cl_int *code),
     (context, id, properties, code))
MAKE(cl_mem, clCreateBuffer,
     (cl_context context, cl_mem_flags flags, size_t bytes, void *data, cl_int *code),
     (context, flags, bytes, data, code))
MAKE(cl_program, clCreateProgramWithSource,
     (cl_context context, cl_uint count, const char **texts, const size_t *lengths, cl_int *code),
     (context, count, texts, lengths, code))
MAKE(cl_program, clCreateProgramWithBinary,
     (cl_context context, cl_uint count, const cl_device_id *ids, const size_t *lengths,
      const unsigned char **bytes, cl_int *taken, cl_int *code),
     (context, count, ids, lengths, bytes, taken, code))
MAKE(cl_kernel, clCreateKernel, (cl_program program, const char *name, cl_int *code),
     (program, name, code))
CALL(clBuildProgram,
     (cl_program program, cl_uint count, const cl_device_id *ids, const char *options,
      void(CL_CALLBACK *tell)(cl_program, void *), void *user),
     (program, count, ids, options, tell, user))
CALL(clGetProgramInfo,
     (cl_program program, cl_program_info what, size_t room, void *to, size_t *size),
     (program, what, room, to, size))
CALL(clGetProgramBuildInfo,
     (cl_program program, cl_device_id id, cl_program_build_info what, size_t room, void *to,
      size_t *size),
     (program, id, what, room, to, size))
CALL(clGetKernelInfo, (cl_kernel kernel, cl_kernel_info what, size_t room, void *to, size_t *size),
     (kernel, what, room, to, size))
CALL(clGetKernelWorkGroupInfo,
     (cl_kernel kernel, cl_device_id id, cl_kernel_work_group_info what, size_t room, void *to,
      size_t *size),
     (kernel, id, what, room, to, size))
CALL(clSetKernelArg, (cl_kernel kernel, cl_uint index, size_t size, const void *value),
     (kernel, index, size, value))
ENQUEUE(clEnqueueReadBuffer,
        (cl_command_queue queue, cl_mem buffer, cl_bool wait, size_t offset, size_t bytes, void *to,
         cl_uint count, const cl_event *after, cl_event *event),
        (queue, buffer, wait, offset, bytes, to, count, after, event))
ENQUEUE(clEnqueueWriteBuffer,
        (cl_command_queue queue, cl_mem buffer, cl_bool wait, size_t offset, size_t bytes,
         const void *from, cl_uint count, const cl_event *after, cl_event *event),
        (queue, buffer, wait, offset, bytes, from, count, after, event))
ENQUEUE(clEnqueueNDRangeKernel,
        (cl_command_queue queue, cl_kernel kernel, cl_uint dim, const size_t *offset,
         const size_t *global, const size_t *local, cl_uint count, const cl_event *after,
         cl_event *event),
        (queue, kernel, dim, offset, global, local, count, after, event))
/* One that fails has waited: a driver that cannot has nothing under way. */
cl_int CL_API_CALL clFinish(cl_command_queue queue) {
    const cl_int code = refuse("clFinish"), finished = NEXT(clFinish)(queue);
    return code != CL_SUCCESS ? code : finished;
}

CALL(clWaitForEvents, (cl_uint count, const cl_event *events), (count, events))
CALL(clGetEventProfilingInfo,
     (cl_event event, cl_profiling_info what, size_t room, void *to, size_t *size),
     (event, what, room, to, size))
cl_int CL_API_CALL clRetainKernel(cl_kernel kernel) {
    const cl_int code = refuse("clRetainKernel");
    if (code != CL_SUCCESS)
        return code;
    ++faults.objects;
    return NEXT(clRetainKernel)(kernel);
}

RELEASE(clReleaseContext, cl_context)
RELEASE(clReleaseCommandQueue, cl_command_queue)
RELEASE(clReleaseMemObject, cl_mem)
RELEASE(clReleaseProgram, cl_program)
RELEASE(clReleaseKernel, cl_kernel)
RELEASE(clReleaseEvent, cl_event)

/* ---- allocations -------------------------------------------------------------------------- */

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
char *__real_strdup(const char *text);
void __real_free(void *memory);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);
char *__wrap_strdup(const char *text);
void __wrap_free(void *memory);

static void *kept(void *memory) {
    faults.allocations += memory != NULL;
    return memory;
}

void *__wrap_malloc(size_t size) {
    return fails(FAULT_MEMORY, "malloc") ? NULL : kept(__real_malloc(size));
}

void *__wrap_calloc(size_t count, size_t size) {
    return fails(FAULT_MEMORY, "calloc") ? NULL : kept(__real_calloc(count, size));
}

void *__wrap_realloc(void *memory, size_t size) {
    if (fails(FAULT_MEMORY, "realloc"))
        return NULL;
    void *const grown = __real_realloc(memory, size);
    faults.allocations += !memory && grown;
    return grown;
}

char *__wrap_strdup(const char *text) {
    return fails(FAULT_MEMORY, "strdup") ? NULL : kept(__real_strdup(text));
}

void __wrap_free(void *memory) {
    faults.allocations -= memory != NULL;
    __real_free(memory);
}

/* Its buffer, which the C library makes by itself, is freed here. */
FILE *__real_open_memstream(char **text, size_t *length);
FILE *__wrap_open_memstream(char **text, size_t *length);
FILE *__wrap_open_memstream(char **text, size_t *length) {
    if (fails(FAULT_MEMORY, "open_memstream"))
        return NULL;
    FILE *const stream = __real_open_memstream(text, length);
    faults.allocations += stream != NULL;
    return stream;
}

/* For faults_new.cpp. */
bool faults_new_fails(void);
bool faults_new_fails(void) {
    return fails(FAULT_NEW, "operator new");
}
