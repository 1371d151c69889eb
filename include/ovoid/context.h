/*
 * What everything else stands on: statuses, versions, contexts, progress, devices.
 */
#ifndef OVOID_CONTEXT_H
#define OVOID_CONTEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define OVOID_API __attribute__((visibility("default")))
#else
#define OVOID_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- status ------------------------------------------------------------------------------- */

typedef enum ovoid_status {
    OVOID_OK = 0,
    OVOID_ERROR_ARGUMENT,  /* an argument or option is out of its range */
    OVOID_ERROR_MEMORY,    /* the host or the device is out of memory */
    OVOID_ERROR_IO,        /* a file cannot be opened, read or written */
    OVOID_ERROR_FORMAT,    /* a file's contents are not what its format asks for */
    OVOID_ERROR_EMPTY,     /* a molecule or model without any atom or ellipsoid that counts */
    OVOID_ERROR_DEVICE,    /* no OpenCL device, none that matches the selector, or one that cannot
                              be used */
    OVOID_ERROR_OPENCL,    /* an OpenCL call failed or a kernel did not build */
    OVOID_ERROR_CANCELLED, /* a progress callback asked to stop */
    OVOID_ERROR_LIMIT,     /* the job is larger than an implementation limit */
    OVOID_ERROR_NUMERIC    /* the computation produced a value that is not finite */
} ovoid_status;

/* A number of type uint64_t that is not known, or makes no sense where it stands. */
#define OVOID_UNKNOWN UINT64_MAX

/* Short lower-case name of a status, e.g. "format"; "unknown" for other values. */
OVOID_API const char *ovoid_status_name(ovoid_status status);

/* ---- version ------------------------------------------------------------------------------ */

/* Of this header. */
#define OVOID_VERSION_MAJOR 0
#define OVOID_VERSION_MINOR 1
#define OVOID_VERSION_PATCH 0

/* Changes when a program that was compiled before would no longer work; libovoid.so.1 has it in its
 * name. */
#define OVOID_ABI 1

/* Of the library that is running, "MAJOR.MINOR.PATCH"; and its OVOID_ABI. */
OVOID_API const char *ovoid_version(void);
OVOID_API uint32_t ovoid_abi(void);

/* Bytes of a public structure in the library that is running, by the name of its type, such as
 * "ovoid_fit_options"; 0 for other names. For bindings, which have no header to compile. */
OVOID_API size_t ovoid_sizeof(const char *type);

/* ---- context ------------------------------------------------------------------------------ */

/* Holds the last error and, once opened, the device with its compiled programs and buffers. */
typedef struct ovoid_context ovoid_context;

/* Creates a context; opens no device yet. */
OVOID_API ovoid_status ovoid_context_create(ovoid_context **context);
OVOID_API void ovoid_context_destroy(ovoid_context **context);

/* Text of the last failure in this context, "" when there was none. One or more lines, no newline
 * at the end. Valid until the next failure or the context's end. */
OVOID_API const char *ovoid_context_error(const ovoid_context *context);

/* Called with one line of text for each condition that does not stop the work, such as an OpenCL
 * platform that does not answer or a program cache that cannot be written. NULL ignores them. Runs
 * on the thread that called the library; ovoid.h says what it may do. The text is valid until it
 * returns. */
typedef void (*ovoid_warning_fn)(const char *text, void *user);
OVOID_API void ovoid_context_on_warning(ovoid_context *context, ovoid_warning_fn fn, void *user);

/* ---- progress ----------------------------------------------------------------------------- */

/* Of an iteration of method l1; all NAN before the first. */
typedef struct ovoid_l1_progress { /* 56 bytes */
    double accuracy_term;          /* E_s = sum_k (phi~ - phi)^2 over the constrained points */
    double sparse_term; /* E_l1 = sum_i |c_i| + |d_i1| + |d_i2| + |d_i3|, square-root variables */
    double accuracy_weight; /* w_s */
    double sparse_weight;   /* w_l */
    double objective;       /* w_s E_s + w_l E_l1 */
    double max_error;       /* max_k |phi~ - phi| */
    double step;            /* tau of the line search, 0 where no descent was found */
} ovoid_l1_progress;

/* Of a step of method adaptive; NAN before the first. */
typedef struct ovoid_adaptive_progress { /* 8 bytes */
    double misfit;                       /* sum of weighted squared residuals */
} ovoid_adaptive_progress;

#define OVOID_NO_METHOD (-1)

/* What a function that may take long is doing. Made by the library. */
typedef struct ovoid_progress {
    size_t size;
    const char *stage;    /* one word: "read" or "write" (a file), "open" (a device), "compile"
                             (kernels), "selftest" (of a device, at its first use), "field", "mesh",
                             "measure" (distances), "map", "render"; of
                             a fit also "sample"; of l1 "sparse" or "accuracy"; of adaptive "merge",
                             "refine", "repair", "sharpen", "grow", "shrink", "confirm" or "mend" */
    uint64_t done, total; /* of this stage, in parts of its own; total may be OVOID_UNKNOWN */
    double seconds;       /* since the function that was called began */
    int32_t method;       /* of the fit that is under way, one of OVOID_METHOD_...; OVOID_NO_METHOD:
                             it is none, and what follows says nothing */
    uint64_t iteration;   /* 1 .. iterations; 0 before the first */
    uint64_t iterations;  /* how many there will be at most; OVOID_UNKNOWN of adaptive */
    uint64_t ellipsoids;
    uint64_t points;                  /* while sampling, so far */
    ovoid_l1_progress l1;             /* of method l1, else NAN */
    ovoid_adaptive_progress adaptive; /* of method adaptive, else NAN */
} ovoid_progress;

/* Returns true to go on, false to stop: the function that was called then frees what it has made,
 * leaves its outputs untouched and no file behind, and returns OVOID_ERROR_CANCELLED; a fit hands
 * over the best model that held (see ovoid_fit()). */
typedef bool (*ovoid_progress_fn)(const ovoid_progress *progress, void *user);

/* Calls fn from now on while a function with this context is at work that may take long: reading,
 * writing, opening a device, compiling kernels, fields, fits, meshes, distances, measures, maps,
 * pictures. NULL, as at first: none.
 *
 * It is called on the thread that called the library, often: before every launch of a kernel and
 * between pieces of what is done on the host, the same state more than once, in a fit also after
 * each iteration. On a usual device a few milliseconds lie between two calls, and seldom more than
 * half a second; what a driver does in one go, such as compiling, is not interrupted. It should
 * return soon; ovoid.h says what it may do. *progress and its text are valid until it returns. */
OVOID_API void ovoid_context_on_progress(ovoid_context *context, ovoid_progress_fn fn, void *user);

/* ---- devices ------------------------------------------------------------------------------ */

/* For a program to call at its beginning, before it has other threads and before it uses OpenCL:
 * where PoCL cannot keep compiled kernels in its folder (full, not writable, or on a file system
 * mounted noexec, which would end the process), POCL_CACHE_DIR is set to another one. This is the
 * only function that touches the environment, which no thread may read meanwhile; a program that
 * does not call it loses PoCL's devices in such a case. The first context that lists devices warns
 * of what was done. */
OVOID_API void ovoid_prepare_process(void);

typedef enum ovoid_device_type {
    OVOID_DEVICE_CPU,
    OVOID_DEVICE_GPU,
    OVOID_DEVICE_ACCELERATOR,
    OVOID_DEVICE_OTHER
} ovoid_device_type;

typedef struct ovoid_device_info {
    size_t size;
    uint32_t index; /* position in the list of all devices of all platforms, from 0 */
    ovoid_device_type type;
    char name[128];
    char vendor[128];
    char platform[128];
    char driver[64]; /* driver version */
    char opencl[64]; /* e.g. "OpenCL 3.0 ..." as the device reports it */
    uint32_t compute_units;
    uint32_t clock_mhz;
    uint32_t float_width;      /* preferred vector width for float */
    bool fp64;                 /* double precision in kernels; Ovoid does not need it */
    uint64_t global_memory;    /* bytes, as the driver reports them */
    uint64_t max_allocation;   /* bytes of one buffer */
    uint64_t local_memory;     /* bytes that a work-group shares */
    uint64_t max_group;        /* work-items of a work-group, at most */
    char pci[16];              /* address on the PCI bus, such as "0000:3b:00.0"; "" if not told */
    char uuid[40];             /* "01234567-89ab-cdef-0123-456789abcdef"; "" if not told */
    char platform_version[64]; /* e.g. "OpenCL 3.0 PoCL ..." */
} ovoid_device_info;

/* Lists every device of every platform. A platform that fails is skipped with a warning. size is
 * that of an entry, sizeof(ovoid_device_info) as the program was compiled with. *devices is an
 * array of *count entries to be freed with ovoid_free(). No device at all is not an error here:
 * *count is 0 and *devices NULL. */
OVOID_API ovoid_status ovoid_devices(ovoid_context *context, size_t size,
                                     ovoid_device_info **devices, size_t *count);

/* Opens the device that selector names: an index ("0"), a type ("cpu", "gpu", "accelerator"), an
 * address on the PCI bus ("3b:00.0", "0000:3b:00.0"), a UUID or its beginning as "GPU-01234567", or
 * part of a device or platform name in any case. NULL or "" takes the environment variable
 * OVOID_DEVICE, and without it the first GPU, else the first device. The first device whose match
 * is found is taken.
 *
 * A list ("0,1", "gpu,cpu") names several, of any platforms, each once however often it is named,
 * and so do "all", "gpus", "cpus" and "accelerators": all that can be used. The first is opened,
 * and does all work but that of a fit in parts (ovoid_parts_options), which opens the others, too,
 * when it comes to them.
 *
 * Replaces the device, or list, opened before; objects made on that one must be gone. */
OVOID_API ovoid_status ovoid_context_open_device(ovoid_context *context, const char *selector);

/* The opened device, NULL before one is opened. Valid until another one is opened, or a fit loses
 * this one (ovoid_parts_options). */
OVOID_API const ovoid_device_info *ovoid_context_device(const ovoid_context *context);

/* How many devices the selector named, 0 before one is opened; and each of them, 0 being the opened
 * one, NULL beyond the last. Valid as that one. */
OVOID_API size_t ovoid_context_device_count(const ovoid_context *context);
OVOID_API const ovoid_device_info *ovoid_context_device_at(const ovoid_context *context,
                                                           size_t index);

/* What a kernel took on the device. */
typedef struct ovoid_kernel_time { /* 24 bytes */
    const char *name;              /* of the kernel, in kernels/; belongs to the library */
    uint64_t launches;
    double seconds; /* by the device's clock, the sum of all launches; NAN where the driver does not
                       tell them all */
} ovoid_kernel_time;

/* Counts and times each kernel launched from now on, on the opened device, on those opened later
 * and by the workers of fits in parts (true), or no longer (false, as it is at first). May be
 * called at any time: waits for what is under way. true begins with no kernels, and so does opening
 * a device; after false the times can still be had. Results do not change, and without it nothing
 * is spent on it. */
OVOID_API ovoid_status ovoid_context_profile(ovoid_context *context, bool on);

/* What was counted, the longest first: *times is an array of *count entries to be freed with
 * ovoid_free(), NULL when there are none. Waits for what is under way. */
OVOID_API ovoid_status ovoid_context_kernel_times(ovoid_context *context, ovoid_kernel_time **times,
                                                  size_t *count);

/* What is counted at the opened device. Bytes are those of copies between host and device. */
typedef enum ovoid_count {
    OVOID_COUNT_LAUNCHES,          /* kernels enqueued */
    OVOID_COUNT_BLOCKING_READS,    /* copies from the device that the host waits for, and with them
                                      for all that was enqueued before */
    OVOID_COUNT_BLOCKING_WRITES,   /* copies to the device that the host waits for */
    OVOID_COUNT_BYTES_TO_DEVICE,   /* of all copies, waited for or not */
    OVOID_COUNT_BYTES_FROM_DEVICE, /* of all copies, waited for or not */
    OVOID_COUNT_BUFFERS_CREATED,   /* allocations of device memory */
    OVOID_COUNT_KERNELS_CREATED,   /* kernel objects made, each once for a device */
    OVOID_COUNTS                   /* how many of them there are */
} ovoid_count;

/* How much of it there was since the device was opened, by the workers of fits in parts as well,
 * once these end; 0 before one is opened. Counting is always
 * on and takes no time. */
OVOID_API uint64_t ovoid_context_count(const ovoid_context *context, ovoid_count what);

/* Frees memory that the library handed over; NULL is fine. */
OVOID_API void ovoid_free(void *memory);

#ifdef __cplusplus
}
#endif

#endif
