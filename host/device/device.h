/*
 * The OpenCL device: finding and opening one, building and caching programs, launching kernels,
 * buffers. Every OpenCL call of the library goes through here, so that a failure always names the
 * call, the symbolic code, the kernel and the device.
 */
#ifndef OV_DEVICE_H
#define OV_DEVICE_H

#include "base/base.h"

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

/* How kernels are shaped for the device; passed to every build as -DOV_VECTOR, -DOV_LANES. A pack
 * of OV_PACK points is handled by `lanes` work-items with vectors of `vector` floats. */
typedef struct ov_shape {
    uint32_t vector; /* 16, 8, 4 or 1 */
    uint32_t lanes;  /* work-items that share a pack: 1 on CPUs, OV_PACK on GPUs */
} ov_shape;

/* Environment variables for development and tests:
 *
 * - OVOID_SHAPE: "VxL", such as 1x16 or 4x1, instead of the device's own shape. V is one of 1, 4,
 *   8, 16, L a power of two, and V * L a divisor of OV_PACK.
 *
 * - OVOID_KERNEL_DIR: the folder with the kernel sources, all of them, instead of the embedded
 *   ones.
 *
 * - OVOID_CACHE: auto (default), on or off: whether compiled programs are kept. auto leaves that to
 *   drivers with a cache of their own (PoCL).
 *
 * - OVOID_CACHE_DIR: where they are kept, instead of $XDG_CACHE_HOME/ovoid or ~/.cache/ovoid.
 *
 * - OVOID_POOL: off creates buffers as large as asked for, and releases them at once, for
 * simulators that look for accesses beyond a buffer's end. */

/* - OVOID_SELFTEST: auto (default), on or off: whether the first use of a device tests it; on does
 *   so in every process, and simulators too. */

#define OV_SELFTEST_TEXT 256 /* bytes of what is wrong with a device */

typedef struct ov_pool ov_pool; /* buffers kept for the next that need one (pool.c) */

typedef struct ov_device {
    ovoid_device_info info;
    cl_platform_id platform;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue; /* in order */
    bool borrowed;          /* the last three are the caller's */
    ov_shape shape;
    size_t max_group;              /* largest work-group */
    uint32_t team;                 /* work-items that share a term, -DOV_TEAM: 1 with one lane */
    uint32_t solve_group;          /* a work-group of the solver, -DOV_SOLVE_GROUP */
    uint64_t counts[OVOID_COUNTS]; /* since the device was opened */
    struct ov_program *programs;   /* built so far, a list */
    struct ov_made *made;          /* kernels made so far, a list */
    ov_pool *pool;
    uint32_t built;                  /* programs compiled from source so far */
    uint32_t loaded;                 /* programs taken from the cache so far */
    bool cache_told;                 /* the user knows that the cache does not work */
    bool trusted;                    /* its self-test is passed, or not wanted (trust.c) */
    char distrust[OV_SELFTEST_TEXT]; /* what it computes wrongly, "" as far as is known */
    struct ov_profile *profile;      /* times of kernels; NULL until ovoid_context_profile() */
    unsigned char *staged;           /* copies of small writes under way; NULL before the first */
    size_t staged_bytes;
    bool ran_out; /* a call failed because the device or driver had no memory left */
    struct ov_device_entry *others; /* further devices of the selector's list; not opened */
    size_t other_count;
} ov_device;

/* The short form of the self-test on the context's device: text gets what is wrong, or "". *whole:
 * no call failed. OVOID_ERROR_CANCELLED alone fails it. The checks need all that works on devices,
 * so this is of a room above, selftest, where it is bound when the library is linked. */
ovoid_status ov_selftest_brief(ovoid_context *context, char text[OV_SELFTEST_TEXT], bool *whole);

/* The context's device, opening the default one if none is open yet. */
ovoid_status ov_device_get(ovoid_context *context, ov_device **device);

/* How many threads, each with a context and a queue of its own, pay on the device of a machine with
 * so many cores (ov_cores()): one where its launches are timed, its queue is another one's, or it
 * does not stand more. */
size_t ov_device_company(const ov_device *device, size_t cores);

/* Opens device n of the list of one context in another one, with a queue of its own: for a thread
 * of its own. Device 0 is the one that is open. */
ovoid_status ov_device_open_again(const ovoid_context *context, size_t n, ovoid_context *another);

/* From now on the context's list is without those for which lost holds. If device 0 is one of them,
 * the first of the others that can be opened takes its place. */
void ov_device_leave_out(ovoid_context *context, const bool *lost);

/* Stands for all that bits depend on besides the input: the devices of the list, their drivers, the
 * kernels. Several equal ones count as one. */
ovoid_status ov_device_hash(ovoid_context *context, uint64_t *hash);

/* The same, of device n of the list alone. */
ovoid_status ov_device_hash_of(ovoid_context *context, size_t n, uint64_t *hash);

/* Whether what failed with this status in the context was the device's doing, so that another
 * device may well succeed. Of memory, since ran_out was last cleared. */
bool ov_device_is_at_fault(const ovoid_context *context, ovoid_status status);

/* Releases programs, queue and device; nothing happens when none is open. */
void ov_device_close(ovoid_context *context);

/* What the device has counted, less what it had counted `before` (NULL: nothing). */
void ov_device_counted(const ov_device *device, const uint64_t before[OVOID_COUNTS],
                       uint64_t counts[OVOID_COUNTS]);

/* Adds what another context of the same process has counted at its device, and the times of its
 * kernels, to what this one has. Nothing where either has no device. A failure is told to `from`.
 */
ovoid_status ov_device_absorb(ovoid_context *context, ovoid_context *from);

/* A kernel. `name` and `program` are string constants. */
typedef struct ov_kernel {
    cl_kernel handle;
    const char *program;
    const char *name;
    size_t max_group; /* largest work-group of this kernel */
    size_t group;     /* the only work-group that it is compiled for; 0: any */
    size_t arg_count;
} ov_kernel;

/* The first kernel of a device may take its self-test: OVOID_ERROR_DEVICE if that finds an error.
 *
 * Makes the kernel `name` of kernels/<program>.cl, building that program on the first request (from
 * the embedded source, or from the folder OVOID_KERNEL_DIR when that is set) and keeping it with
 * the device. On PoCL all embedded files are built as one program: no two kernels, functions or
 * macros of theirs may share a name. Build options: -cl-std=CL1.2, the shape, -DOV_PACK, and never
 * a relaxed-math flag.
 *
 * A kernel is made once for a device and kept with it: all that ask for it share the handle, whose
 * arguments each launch sets anew. Like all of a context, it belongs to one thread at a time. */
ovoid_status ov_kernel_create(ovoid_context *context, const char *program, const char *name,
                              ov_kernel *kernel);
void ov_kernel_destroy(ov_kernel *kernel);

/* One kernel argument: a value of `size` bytes. OV_ARG takes an lvalue (a cl_mem, a scalar). */
typedef struct ov_arg {
    size_t size;
    const void *value;
} ov_arg;
#define OV_ARG(lvalue) ((ov_arg){sizeof(lvalue), &(lvalue)})
#define OV_LOCAL(bytes) ((ov_arg){(bytes), NULL})

/* Sets all arguments and enqueues a one-dimensional launch of at least `global` work-items in
 * groups of `local`, or of fewer where the device cannot run so many of this kernel (0: the driver
 * chooses; otherwise global is rounded up to a multiple, so kernels check their bounds). A kernel
 * whose work-items share memory is compiled for its group (reqd_work_group_size), and launched with
 * that alone. Does not wait. global == 0 does nothing. */
ovoid_status ov_launch(ovoid_context *context, const ov_kernel *kernel, size_t global, size_t local,
                       const ov_arg *args, size_t arg_count);
#define OV_LAUNCH(context, kernel, global, local, ...)                                             \
    ov_launch((context), (kernel), (global), (local), (const ov_arg[]){__VA_ARGS__},               \
              sizeof((const ov_arg[]){__VA_ARGS__}) / sizeof(ov_arg))

/* A device buffer that remembers its size. {0} is an empty one. */
typedef struct ov_buffer {
    cl_mem memory;
    size_t bytes;  /* allocated */
    ov_pool *pool; /* where it goes when it is destroyed */
} ov_buffer;

/* Makes the buffer at least `bytes` large (never zero), growing geometrically; contents are lost
 * when it grows, and what a new one holds is arbitrary. `what` names it in errors. Beyond the
 * device's max_allocation: OVOID_ERROR_LIMIT.
 */
ovoid_status ov_buffer_reserve(ovoid_context *context, ov_buffer *buffer, size_t bytes,
                               const char *what);
void ov_buffer_destroy(ov_buffer *buffer);

/* Between tasks: releases the buffers that are kept for the next, where the device's memory is the
 * host's. What one task took is not held while another one, or another thread, needs it. */
void ov_buffers_trim(ovoid_context *context);

/* Copies between host and device; `data` is free to change, or whole, on return. A read waits for
 * all that was enqueued; a small write does not. bytes == 0 does nothing. */
ovoid_status ov_buffer_write(ovoid_context *context, ov_buffer *buffer, size_t offset,
                             const void *data, size_t bytes);
ovoid_status ov_buffer_read(ovoid_context *context, const ov_buffer *buffer, size_t offset,
                            void *data, size_t bytes);
/* ov_buffer_reserve() and ov_buffer_write() in one. */
ovoid_status ov_buffer_put(ovoid_context *context, ov_buffer *buffer, const void *data,
                           size_t bytes, const char *what);

/* A read that is waited for later, so that the device has something to do meanwhile: `data` is to
 * stay until ov_later_end(), which has to follow, after failures too. {0} is none. */
typedef struct ov_later {
    cl_event event;
} ov_later;
ovoid_status ov_buffer_read_later(ovoid_context *context, const ov_buffer *buffer, size_t offset,
                                  void *data, size_t bytes, ov_later *later);
/* Waits for the read, but not for what was enqueued after it; at once where there is none. */
ovoid_status ov_later_end(ovoid_context *context, ov_later *later);

/* For buffers of the caller's: OVOID_ERROR_ARGUMENT unless it is one of the opened device's context
 * that holds so many bytes and, `written`, that kernels may write to. `name` is the argument's. */
ovoid_status ov_memory_check(ovoid_context *context, cl_mem memory, size_t bytes, bool written,
                             const char *name);
/* Fills its first bytes with zeros; does not wait. */
ovoid_status ov_memory_clear(ovoid_context *context, cl_mem memory, size_t bytes);
/* Waits until everything enqueued has run. */
ovoid_status ov_finish(ovoid_context *context);

/* Symbolic name of an OpenCL error code, "CL_INVALID_VALUE" and so on. */
const char *ov_cl_name(cl_int code);

/* Records a failed call: "clEnqueueNDRangeKernel: CL_OUT_OF_RESOURCES (-5), kernel field, device
 * NAME". kernel may be NULL. Out-of-memory codes become OVOID_ERROR_MEMORY. */
ovoid_status ov_cl_fail(ovoid_context *context, cl_int code, const char *call, const char *kernel);

#endif
