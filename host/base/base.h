/*
 * What every room stands on: the context with its last error, allocation that reports, time.
 * Internal names begin with ov_; only ovoid_ names are exported.
 */
#ifndef OV_BASE_H
#define OV_BASE_H

#include "ovoid/ovoid.h"

#include <stdarg.h>

struct ov_device; /* host/device/device.h */

struct ovoid_context {
    char *error; /* last failure, owned, may be NULL */
    ovoid_warning_fn warn;
    void *warn_user;
    ovoid_progress_fn progress; /* base/progress.h */
    void *progress_user;
    ovoid_progress now;                    /* what it is told, but for the seconds; 0: unknown */
    int fitting;                           /* 1 + the method of the fit under way, 0: none */
    unsigned calling;                      /* callbacks that run, one within the other */
    double began;                          /* the outermost work, in ov_seconds() */
    unsigned works;                        /* public functions at work, one within the other */
    struct ov_tenant *tenants;             /* base/tenant.h */
    struct ov_crew *crew;                  /* workers of a fit in parts (fit/parts/crew.h) */
    struct ov_times *times;                /* of the last one (fit/parts/times.h) */
    void (*drop_times)(ovoid_context *);   /* set by the room that keeps them */
    bool profile;                          /* devices begin with their launches counted */
    struct ov_device *device;              /* NULL until opened */
    void (*close_device)(ovoid_context *); /* set by the room that opens it; base knows no OpenCL */
};

/* Records the failure text (printf style) and returns status. Bytes of it that are no UTF-8, and
 * control characters but for ends of lines, become '?'; the same holds for warnings.
 * context may be NULL. If even the text cannot be stored, a fixed text stands in for it. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
ovoid_status
ov_fail(ovoid_context *context, ovoid_status status, const char *format, ...);

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
void
ov_warn(ovoid_context *context, const char *format, ...);

/* calloc of count * size bytes with overflow check (at least one byte). On failure returns NULL and
 * records OVOID_ERROR_MEMORY with `what`. Free with free(). */
void *ov_alloc(ovoid_context *context, size_t count, size_t size, const char *what);

/* The same with what is at from[count * size] in it. */
void *ov_copy(ovoid_context *context, const void *from, size_t count, size_t size,
              const char *what);

/* Grows *array to hold at least `need` elements of `size` bytes; *capacity counts elements. Growth
 * is geometric. The new part is not cleared. */
ovoid_status ov_grow(ovoid_context *context, void *array_pointer, size_t *capacity, size_t need,
                     size_t size, const char *what);

/* Bytes of the UTF-8 character at text, 0 if there is none (RFC 3629, section 4). */
size_t ov_utf8_length(const unsigned char *text);

/* FNV-1a, 64 bits (Fowler, Noll, Vo). */
uint64_t ov_hash(const void *bytes, size_t count);

/* Seconds of a monotonic clock. */
double ov_seconds(void);

/* In a public function: refuses an argument that is NULL, naming both, and calls from callbacks of
 * the same context. The context comes first, for there is no telling without it. */
#define OV_NEED(context, argument)                                                                 \
    do {                                                                                           \
        if (!(argument))                                                                           \
            return ov_fail(context, OVOID_ERROR_ARGUMENT, "%s: %s is NULL", __func__, #argument);  \
        if (context->calling)                                                                      \
            return ov_fail(context, OVOID_ERROR_ARGUMENT,                                          \
                           "%s: called from a callback of this context", __func__);                \
    } while (0)

/* Runs `expression` (an ovoid_status) and jumps to `cleanup` unless it is OVOID_OK; needs a local
 * variable `status`. */
#define OV_TRY(expression)                                                                         \
    do {                                                                                           \
        status = (expression);                                                                     \
        if (status != OVOID_OK)                                                                    \
            goto cleanup;                                                                          \
    } while (0)

#endif
