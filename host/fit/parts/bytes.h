/*
 * Values one after the other in a row of bytes, to be kept or sent, and taken from it again in the
 * same order by a machine of the same kind.
 */
#ifndef OV_FIT_BYTES_H
#define OV_FIT_BYTES_H

#include "base/base.h"

/* {0} is empty. */
typedef struct ov_bytes {
    unsigned char *data;
    size_t count, capacity;
} ov_bytes;

void ov_bytes_destroy(ov_bytes *bytes);

/* Appends a copy. */
ovoid_status ov_bytes_put(ovoid_context *context, ov_bytes *bytes, const void *values, size_t size);

/* What is still to be taken; the bytes are another's. */
typedef struct ov_reading {
    const unsigned char *next;
    size_t left;
} ov_reading;

/* False where fewer bytes than that are left. */
bool ov_bytes_take(ov_reading *from, void *values, size_t size);

/* An array to be freed of `count` values; *array stays where they are none.
 * OVOID_ERROR_FORMAT where fewer are left. `what` names them. */
ovoid_status ov_bytes_take_array(ovoid_context *context, ov_reading *from, void *array_pointer,
                                 uint64_t count, size_t size, const char *what);

/* One number for both. */
uint64_t ov_hash_with(uint64_t hash, const void *bytes, size_t count);

#endif
