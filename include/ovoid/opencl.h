/*
 * For programs that use OpenCL themselves: their device and queue instead of Ovoid's own, and
 * values of fields in their buffers. Not included by ovoid.h, since it needs OpenCL's headers, and
 * programs that use it link OpenCL.
 */
#ifndef OVOID_OPENCL_H
#define OVOID_OPENCL_H

#include "ovoid/field.h"

#ifdef __APPLE__
#include <OpenCL/opencl.h>
#else
#include <CL/cl.h>
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* As ovoid_context_open_device(), with the caller's OpenCL context, a device of it (a sub-device,
 * too) and a queue on both. All three are retained until another device is opened or the context
 * destroyed, which waits for what is in the queue; the caller may release its own references at
 * once.
 *
 * Ovoid enqueues all its commands there and nowhere else, and waits for them where it needs
 * results. So the queue must execute in order, and no other thread may use it while a function with
 * this context is at work. ovoid_context_profile() counts launches, and tells their times where the
 * queue has CL_QUEUE_PROFILING_ENABLE.
 *
 * OVOID_ERROR_ARGUMENT where the queue is of another context or device, or executes out of order;
 * OVOID_ERROR_DEVICE where the device is not available, has no compiler, or has no OpenCL 1.2. */
OVOID_API ovoid_status ovoid_context_open_opencl(ovoid_context *context, cl_context opencl,
                                                 cl_device_id device, cl_command_queue queue);

/* As ovoid_field_evaluate(), into buffers of the OpenCL context of the opened device: value takes
 * `count` floats (32 bits), gradient, unless NULL, 3 * count: x, y, z of each point after one
 * another. The buffers hold at least that, from their beginning, and kernels may write to them;
 * else OVOID_ERROR_ARGUMENT. Returns when all is enqueued: commands that the caller enqueues
 * afterwards in the same queue find the results, others have to wait for it. After a failure what
 * the buffers hold is arbitrary. */
OVOID_API ovoid_status ovoid_field_evaluate_opencl(ovoid_context *context, ovoid_field *field,
                                                   const double *xyz, size_t count, cl_mem value,
                                                   cl_mem gradient);

/* The same for points that are in a buffer, too: 3 * count floats, x, y, z of each after one
 * another (angstrom). They are read by the host, which puts them in order; values and gradients
 * stay on the device. A float of a coordinate is as fine as 1e-7 of it. */
OVOID_API ovoid_status ovoid_field_evaluate_buffer(ovoid_context *context, ovoid_field *field,
                                                   cl_mem xyz, size_t count, cl_mem value,
                                                   cl_mem gradient);

#ifdef __cplusplus
}
#endif

#endif
