#include "fit/parts/bytes.h"

#include <stdlib.h>
#include <string.h>

void ov_bytes_destroy(ov_bytes *bytes) {
    free(bytes->data);
    *bytes = (ov_bytes){0};
}

ovoid_status ov_bytes_put(ovoid_context *context, ov_bytes *bytes, const void *values,
                          size_t size) {
    ovoid_status status = OVOID_OK;
    if (size == 0)
        return OVOID_OK;
    OV_TRY(ov_grow(context, &bytes->data, &bytes->capacity, bytes->count + size, 1, "a message"));
    memcpy(bytes->data + bytes->count, values, size);
    bytes->count += size;
cleanup:
    return status;
}

bool ov_bytes_take(ov_reading *from, void *values, size_t size) {
    if (from->left < size)
        return false;
    if (size > 0)
        memcpy(values, from->next, size);
    from->next += size;
    from->left -= size;
    return true;
}

ovoid_status ov_bytes_take_array(ovoid_context *context, ov_reading *from, void *array_pointer,
                                 uint64_t count, size_t size, const char *what) {
    if (count == 0)
        return OVOID_OK;
    if (count > from->left / size)
        return ov_fail(context, OVOID_ERROR_FORMAT, "a message ends within its %s", what);
    void *const made = ov_alloc(context, (size_t)count, size, what);
    if (!made)
        return OVOID_ERROR_MEMORY;
    ov_bytes_take(from, made, (size_t)count * size);
    memcpy(array_pointer, &made, sizeof made);
    return OVOID_OK;
}

uint64_t ov_hash_with(uint64_t hash, const void *bytes, size_t count) {
    const uint64_t both[2] = {hash, ov_hash(bytes, count)};
    return ov_hash(both, sizeof both);
}
