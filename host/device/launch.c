#include "device/internal.h"

#include "base/progress.h"

#include <stdlib.h>
#include <string.h>

/* ---- launches ----------------------------------------------------------------------------- */

static ovoid_status check_launch(ovoid_context *context, const ov_kernel *kernel, size_t global,
                                 size_t local, size_t arg_count) {
    if (arg_count != kernel->arg_count)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "kernel %s of %s.cl takes %zu arguments, %zu were given", kernel->name,
                       kernel->program, kernel->arg_count, arg_count);
    if (kernel->group && local != kernel->group)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "kernel %s is compiled for groups of %zu work-items, launched with %zu",
                       kernel->name, kernel->group, local);
    if (local && global > SIZE_MAX - (local - 1))
        return ov_fail(context, OVOID_ERROR_LIMIT, "kernel %s: %zu work-items are too many",
                       kernel->name, global);
    return OVOID_OK;
}

/* Drivers that give a buffer its memory when it is first used find out only then that there is
 * none left. Buffers that are kept are released for its sake; true: it is worth another try. */
static bool made_room(ov_device *device, cl_int code) {
    return code == CL_MEM_OBJECT_ALLOCATION_FAILURE && ov_pool_empty(device->pool) &&
           clFinish(device->queue) == CL_SUCCESS;
}

ovoid_status ov_launch(ovoid_context *context, const ov_kernel *kernel, size_t global, size_t local,
                       const ov_arg *args, size_t arg_count) {
    if (!global)
        return OVOID_OK;
    if (!context->device || !kernel->handle)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a kernel was launched before it was made");
    if (local > kernel->max_group)
        local = kernel->max_group;
    ovoid_status status = ov_opencl_check(context);
    if (status == OVOID_OK)
        status = check_launch(context, kernel, global, local, arg_count);
    if (status == OVOID_OK)
        status = ov_progress_ask(context);
    if (status != OVOID_OK)
        return status;
    for (size_t i = 0; i < arg_count; i++) {
        cl_int code = clSetKernelArg(kernel->handle, (cl_uint)i, args[i].size, args[i].value);
        if (code != CL_SUCCESS)
            return ov_fail(context, ov_cl_status(code),
                           "clSetKernelArg: %s (%d), argument %zu of kernel %s, device %s",
                           ov_cl_name(code), (int)code, i, kernel->name,
                           context->device->info.name);
    }
    if (local)
        global = (global + local - 1) / local * local;
    bool timed;
    if ((status = ov_profile_prepare(context, context->device, &timed)) != OVOID_OK)
        return status;
    cl_event event = NULL;
    cl_int code;
    do
        code = clEnqueueNDRangeKernel(context->device->queue, kernel->handle, 1, NULL, &global,
                                      local ? &local : NULL, 0, NULL, timed ? &event : NULL);
    while (made_room(context->device, code));
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clEnqueueNDRangeKernel", kernel->name);
    context->device->counts[OVOID_COUNT_LAUNCHES]++;
    ov_profile_add(context->device, kernel->name, event);
    return OVOID_OK;
}

/* What can be done when everything enqueued has run. */
static ovoid_status idle(ovoid_context *context) {
    context->device->staged_bytes = 0;
    return ov_profile_drain(context, context->device);
}

ovoid_status ov_finish(ovoid_context *context) {
    if (!context->device)
        return OVOID_OK;
    const ovoid_status status = ov_opencl_check(context);
    if (status != OVOID_OK)
        return status;
    cl_int code = clFinish(context->device->queue);
    return code == CL_SUCCESS ? idle(context) : ov_cl_fail(context, code, "clFinish", NULL);
}

/* ---- buffers ------------------------------------------------------------------------------ */

#define SMALLEST_BUFFER 256 /* bytes */

static cl_int allocate(ov_device *device, ov_buffer *buffer, size_t bytes) {
    cl_int code;
    cl_mem memory = clCreateBuffer(device->context, CL_MEM_READ_WRITE, bytes, NULL, &code);
    if (code != CL_SUCCESS && ov_pool_empty(device->pool) && clFinish(device->queue) == CL_SUCCESS)
        memory = clCreateBuffer(device->context, CL_MEM_READ_WRITE, bytes, NULL, &code);
    if (code != CL_SUCCESS)
        return code;
    ov_pool_own(device->pool, memory, bytes, buffer);
    device->counts[OVOID_COUNT_BUFFERS_CREATED]++;
    return CL_SUCCESS;
}

ovoid_status ov_buffer_reserve(ovoid_context *context, ov_buffer *buffer, size_t bytes,
                               const char *what) {
    ov_device *device;
    ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    if (buffer->memory && bytes <= buffer->bytes)
        return OVOID_OK;
    uint64_t limit = device->info.max_allocation;
    if (!limit) /* the driver does not say */
        limit = SIZE_MAX;
    if (bytes > limit)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "%s takes %zu bytes, a buffer of %s holds at most %llu", what, bytes,
                       device->info.name, (unsigned long long)limit);
    size_t room = buffer->bytes > SIZE_MAX / 3 ? bytes : buffer->bytes / 2 * 3;
    if (room < bytes)
        room = bytes;
    if (room < SMALLEST_BUFFER)
        room = SMALLEST_BUFFER;
    if (room > limit)
        room = bytes ? bytes : 1;
    ov_buffer_destroy(buffer);
    if (ov_pool_take(device->pool, room, buffer))
        return OVOID_OK;
    if (ov_pool_size(device->pool, room) <= limit)
        room = ov_pool_size(device->pool, room);
    cl_int code = allocate(device, buffer, room);
    if (code != CL_SUCCESS && bytes && room > bytes)
        code = allocate(device, buffer, bytes);
    device->ran_out = device->ran_out || (code != CL_SUCCESS && code != CL_INVALID_BUFFER_SIZE);
    if (code != CL_SUCCESS)
        return ov_fail(context,
                       code == CL_INVALID_BUFFER_SIZE ? OVOID_ERROR_LIMIT : OVOID_ERROR_MEMORY,
                       "clCreateBuffer: %s (%d) for %s of %zu bytes, device %s", ov_cl_name(code),
                       (int)code, what, bytes, device->info.name);
    return OVOID_OK;
}

void ov_buffer_destroy(ov_buffer *buffer) {
    if (!buffer)
        return;
    if (buffer->memory)
        ov_pool_put(buffer);
    *buffer = (ov_buffer){0};
}

void ov_buffers_trim(ovoid_context *context) {
    if (context->device && context->device->info.type == OVOID_DEVICE_CPU)
        ov_pool_empty(context->device->pool);
}

/* A copy of the data that stays until the queue is idle; NULL when there is no room, and it has to
 * be written at once. Waiting for each of a fit's thousand writes, a few hundred bytes most of
 * them, would let the device run dry each time. */
#define STAGE_BYTES ((size_t)1 << 20)
static const void *stage(ov_device *device, const void *data, size_t bytes) {
    if (bytes > STAGE_BYTES - device->staged_bytes)
        return NULL;
    if (!device->staged && !(device->staged = malloc(STAGE_BYTES)))
        return NULL;
    void *copy = device->staged + device->staged_bytes;
    memcpy(copy, data, bytes);
    device->staged_bytes += bytes;
    return copy;
}

static ovoid_status check_range(ovoid_context *context, const ov_buffer *buffer, size_t offset,
                                size_t bytes) {
    if (!context->device || offset > buffer->bytes || bytes > buffer->bytes - offset)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%zu bytes at %zu are outside a buffer of %zu bytes", bytes, offset,
                       buffer->bytes);
    return ov_opencl_check(context);
}

ovoid_status ov_buffer_write(ovoid_context *context, ov_buffer *buffer, size_t offset,
                             const void *data, size_t bytes) {
    if (!bytes)
        return OVOID_OK;
    ovoid_status status = check_range(context, buffer, offset, bytes);
    if (status != OVOID_OK)
        return status;
    const void *copy = stage(context->device, data, bytes);
    cl_int code;
    do
        code =
            clEnqueueWriteBuffer(context->device->queue, buffer->memory, copy ? CL_FALSE : CL_TRUE,
                                 offset, bytes, copy ? copy : data, 0, NULL, NULL);
    while (made_room(context->device, code));
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clEnqueueWriteBuffer", NULL);
    context->device->counts[OVOID_COUNT_BYTES_TO_DEVICE] += bytes;
    context->device->counts[OVOID_COUNT_BLOCKING_WRITES] += !copy;
    return copy ? OVOID_OK : idle(context);
}

ovoid_status ov_buffer_put(ovoid_context *context, ov_buffer *buffer, const void *data,
                           size_t bytes, const char *what) {
    const ovoid_status status = ov_buffer_reserve(context, buffer, bytes, what);
    return status != OVOID_OK ? status : ov_buffer_write(context, buffer, 0, data, bytes);
}

ovoid_status ov_buffer_read(ovoid_context *context, const ov_buffer *buffer, size_t offset,
                            void *data, size_t bytes) {
    if (!bytes)
        return OVOID_OK;
    ovoid_status status = check_range(context, buffer, offset, bytes);
    if (status != OVOID_OK)
        return status;
    cl_int code;
    do
        code = clEnqueueReadBuffer(context->device->queue, buffer->memory, CL_TRUE, offset, bytes,
                                   data, 0, NULL, NULL);
    while (made_room(context->device, code));
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clEnqueueReadBuffer", NULL);
    context->device->counts[OVOID_COUNT_BYTES_FROM_DEVICE] += bytes;
    context->device->counts[OVOID_COUNT_BLOCKING_READS]++;
    return idle(context);
}

ovoid_status ov_buffer_read_later(ovoid_context *context, const ov_buffer *buffer, size_t offset,
                                  void *data, size_t bytes, ov_later *later) {
    ovoid_status status = check_range(context, buffer, offset, bytes);
    if (status != OVOID_OK)
        return status;
    cl_int code;
    do
        code = clEnqueueReadBuffer(context->device->queue, buffer->memory, CL_FALSE, offset, bytes,
                                   data, 0, NULL, &later->event);
    while (made_room(context->device, code));
    if (code != CL_SUCCESS) {
        later->event = NULL;
        return ov_cl_fail(context, code, "clEnqueueReadBuffer", NULL);
    }
    context->device->counts[OVOID_COUNT_BYTES_FROM_DEVICE] += bytes;
    return OVOID_OK;
}

ovoid_status ov_later_end(ovoid_context *context, ov_later *later) {
    if (!later->event)
        return OVOID_OK;
    const cl_int code = clWaitForEvents(1, &later->event);
    if (code != CL_SUCCESS) /* nothing may be written to memory that is about to be freed */
        clFinish(context->device->queue);
    clReleaseEvent(later->event);
    later->event = NULL;
    return code == CL_SUCCESS ? OVOID_OK : ov_cl_fail(context, code, "clWaitForEvents", NULL);
}
