/* What callers that use OpenCL themselves hand over: a queue, and buffers. */
#include "device/internal.h"

#include "base/progress.h"
#include "ovoid/opencl.h"

/* ---- the queue ---------------------------------------------------------------------------- */

bool ov_queue_is_timed(cl_command_queue queue) {
    cl_command_queue_properties properties = 0;
    return clGetCommandQueueInfo(queue, CL_QUEUE_PROPERTIES, sizeof properties, &properties,
                                 NULL) == CL_SUCCESS &&
           (properties & CL_QUEUE_PROFILING_ENABLE);
}

static ovoid_status check_queue(ovoid_context *context, cl_device_id device,
                                const ov_handles *handles) {
    cl_context of_context = NULL;
    cl_device_id of_device = NULL;
    cl_command_queue_properties properties = 0;
    cl_int code = clGetCommandQueueInfo(handles->queue, CL_QUEUE_CONTEXT, sizeof of_context,
                                        &of_context, NULL);
    if (code == CL_SUCCESS)
        code = clGetCommandQueueInfo(handles->queue, CL_QUEUE_DEVICE, sizeof of_device, &of_device,
                                     NULL);
    if (code == CL_SUCCESS)
        code = clGetCommandQueueInfo(handles->queue, CL_QUEUE_PROPERTIES, sizeof properties,
                                     &properties, NULL);
    if (code != CL_SUCCESS)
        return ov_cl_fail_on(context, code, "clGetCommandQueueInfo", NULL, NULL);
    if (of_context != handles->context)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "the queue is of another OpenCL context");
    if (of_device != device)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "the queue is of another device");
    if (properties & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE)
        return ov_fail(
            context, OVOID_ERROR_ARGUMENT,
            "the queue executes out of order, and Ovoid relies on the order of commands");
    return OVOID_OK;
}

ovoid_status ovoid_context_open_opencl(ovoid_context *context, cl_context opencl,
                                       cl_device_id device, cl_command_queue queue) {
    ovoid_status status = OVOID_OK;
    ov_device_entry entry;
    OV_NEED(context, context);
    OV_NEED(context, opencl);
    OV_NEED(context, device);
    OV_NEED(context, queue);
    const ov_handles handles = {opencl, queue};
    ov_progress_begin(context, "open");
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_opencl_begin(context));
    OV_TRY(ov_device_describe(context, device, &entry));
    OV_TRY(check_queue(context, device, &handles));
    OV_TRY(ov_device_open(context, &entry, &handles));
cleanup:
    ov_progress_end(context);
    return status;
}

/* ---- buffers ------------------------------------------------------------------------------ */

ovoid_status ov_memory_check(ovoid_context *context, cl_mem memory, size_t bytes, bool written,
                             const char *name) {
    cl_context of_context = NULL;
    cl_mem_object_type type = 0;
    cl_mem_flags flags = 0;
    size_t size = 0;
    cl_int code = clGetMemObjectInfo(memory, CL_MEM_CONTEXT, sizeof of_context, &of_context, NULL);
    if (code == CL_SUCCESS)
        code = clGetMemObjectInfo(memory, CL_MEM_TYPE, sizeof type, &type, NULL);
    if (code == CL_SUCCESS)
        code = clGetMemObjectInfo(memory, CL_MEM_FLAGS, sizeof flags, &flags, NULL);
    if (code == CL_SUCCESS)
        code = clGetMemObjectInfo(memory, CL_MEM_SIZE, sizeof size, &size, NULL);
    if (code != CL_SUCCESS)
        return ov_cl_fail(context, code, "clGetMemObjectInfo", NULL);
    if (of_context != context->device->context)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s is a buffer of another OpenCL context",
                       name);
    if (type != CL_MEM_OBJECT_BUFFER)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s is no buffer", name);
    if (written && (flags & CL_MEM_READ_ONLY))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s is a buffer that kernels only read",
                       name);
    if (size < bytes)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s holds %zu bytes, and %zu are needed",
                       name, size, bytes);
    return OVOID_OK;
}

ovoid_status ov_memory_clear(ovoid_context *context, cl_mem memory, size_t bytes) {
    const cl_float zero = 0.0f;
    const cl_int code = clEnqueueFillBuffer(context->device->queue, memory, &zero, sizeof zero, 0,
                                            bytes, 0, NULL, NULL);
    return code == CL_SUCCESS ? OVOID_OK : ov_cl_fail(context, code, "clEnqueueFillBuffer", NULL);
}
