/*
 * Buffers that are not in use, kept for the next that need one. A fit makes thousands of buffers of
 * much the same sizes, and what a driver takes to create one, to give its memory a place and to
 * free it costs more than many a kernel.
 */
#include "device/internal.h"

#include <stdlib.h>
#include <string.h>

/* Kept at most: so many buffers, and so many bytes or this share of the device's memory. */
#define KEPT_MOST 128
#define KEPT_BYTES ((size_t)256 << 20)
#define KEPT_SHARE 16

/* A buffer may be this much larger than asked for: an eighth of it comes from rounding sizes. */
#define LARGER 0.5

typedef struct kept_buffer {
    cl_mem memory;
    size_t bytes;
} kept_buffer;

struct ov_pool {
    size_t users; /* the device, and buffers in use: they may outlive it */
    bool open;    /* the device is there */
    size_t most;  /* bytes that may be kept */
    size_t bytes; /* kept */
    size_t count;
    kept_buffer kept[KEPT_MOST]; /* the oldest first */
};

ov_pool *ov_pool_create(ovoid_context *context, uint64_t memory) {
    const char *const wish = getenv("OVOID_POOL");
    ov_pool *const pool = ov_alloc(context, 1, sizeof *pool, "a pool of buffers");
    if (!pool)
        return NULL;
    pool->users = 1;
    pool->open = true;
    pool->most = memory / KEPT_SHARE < KEPT_BYTES ? (size_t)(memory / KEPT_SHARE) : KEPT_BYTES;
    if (wish && strcmp(wish, "off") == 0)
        pool->most = 0;
    return pool;
}

static void leave(ov_pool *pool) {
    if (--pool->users == 0)
        free(pool);
}

/* Takes one out of the list; the others keep their order. */
static kept_buffer take_out(ov_pool *pool, size_t k) {
    const kept_buffer taken = pool->kept[k];
    --pool->count;
    memmove(pool->kept + k, pool->kept + k + 1, (pool->count - k) * sizeof *pool->kept);
    pool->bytes -= taken.bytes;
    return taken;
}

bool ov_pool_empty(ov_pool *pool) {
    const bool some = pool->count > 0;
    while (pool->count > 0)
        ov_release_memory(take_out(pool, pool->count - 1).memory);
    return some;
}

void ov_pool_close(ov_pool *pool) {
    if (!pool)
        return;
    ov_pool_empty(pool);
    pool->open = false;
    leave(pool);
}

/* Eight sizes between a power of two and the next. */
size_t ov_pool_size(const ov_pool *pool, size_t bytes) {
    size_t step = 1;
    if (pool->most == 0)
        return bytes;
    while (bytes / step >= 16)
        step *= 2;
    const size_t rest = bytes % step;
    return rest == 0 || bytes > SIZE_MAX - step ? bytes : bytes - rest + step;
}

bool ov_pool_take(ov_pool *pool, size_t bytes, ov_buffer *buffer) {
    const size_t most = bytes + (size_t)(LARGER * (double)bytes);
    size_t best = pool->count;
    for (size_t k = 0; k < pool->count; k++)
        if (pool->kept[k].bytes >= bytes && pool->kept[k].bytes <= most &&
            (best == pool->count || pool->kept[k].bytes < pool->kept[best].bytes))
            best = k;
    if (best == pool->count)
        return false;
    const kept_buffer taken = take_out(pool, best);
    ov_pool_own(pool, taken.memory, taken.bytes, buffer);
    return true;
}

void ov_pool_own(ov_pool *pool, cl_mem memory, size_t bytes, ov_buffer *buffer) {
    *buffer = (ov_buffer){memory, bytes, pool};
    pool->users++;
}

void ov_pool_put(ov_buffer *buffer) {
    ov_pool *const pool = buffer->pool;
    if (!pool->open || buffer->bytes > pool->most) {
        ov_release_memory(buffer->memory);
    } else {
        while (pool->count == KEPT_MOST || pool->bytes > pool->most - buffer->bytes)
            ov_release_memory(take_out(pool, 0).memory);
        pool->kept[pool->count++] = (kept_buffer){buffer->memory, buffer->bytes};
        pool->bytes += buffer->bytes;
    }
    leave(pool);
}
