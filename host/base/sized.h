/*
 * Structures of the interface that grow: between the caller's version of one and the library's. The
 * first member of each is its size (ovoid.h).
 */
#ifndef OV_SIZED_H
#define OV_SIZED_H

#include "base/base.h"

/* What xxx_init() does: `ours`, as much of it as the caller's has room for, zeros beyond, and the
 * caller's size. Does nothing where that is too small to hold itself. */
void ov_sized_init(void *theirs, size_t size, const void *ours, size_t our_size);

/* The caller's values over the defaults that `ours` holds. OVOID_ERROR_ARGUMENT where the size is
 * none, or something is set beyond what the library knows. `name` is the structure's. */
ovoid_status ov_sized_take(ovoid_context *context, const char *name, const void *theirs, void *ours,
                           size_t our_size);
#define OV_SIZED_TAKE(context, type, theirs, ours)                                                 \
    ov_sized_take((context), #type, (theirs), (ours), sizeof(type))

/* Of a structure for results, before the work: whether its size is one. NULL is fine. */
ovoid_status ov_sized_check(ovoid_context *context, const char *name, const void *theirs);

/* Results, as much of them as both sides know; the caller's size stays. NULL takes nothing. */
void ov_sized_give(void *theirs, const void *ours, size_t our_size);

#endif
