#include "field/field.h"

#include <stdlib.h>
#include <string.h>

/* J. Skilling, "Programming the Hilbert curve", AIP Conf. Proc. 707 (2004) 381: the axes are turned
 * into the transposed index in place, one bit plane at a time. */
static void axes_to_transpose(uint32_t axis[3], unsigned bits) {
    for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1) {
        const uint32_t below = bit - 1;
        for (int k = 0; k < 3; ++k) {
            if (axis[k] & bit) {
                axis[0] ^= below;
            } else {
                const uint32_t swap = (axis[0] ^ axis[k]) & below;
                axis[0] ^= swap;
                axis[k] ^= swap;
            }
        }
    }
    axis[1] ^= axis[0];
    axis[2] ^= axis[1];
    uint32_t flip = 0;
    for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1)
        if (axis[2] & bit)
            flip ^= bit - 1;
    for (int k = 0; k < 3; ++k)
        axis[k] ^= flip;
}

uint64_t ov_hilbert_index(uint32_t x, uint32_t y, uint32_t z, unsigned bits) {
    uint32_t axis[3] = {x, y, z};
    axes_to_transpose(axis, bits);
    uint64_t index = 0;
    for (unsigned b = bits; b-- > 0;)
        for (int k = 0; k < 3; ++k)
            index = index << 1 | (axis[k] >> b & 1u);
    return index;
}

#define RADIX_BITS 11
#define RADIX (1u << RADIX_BITS)

/* One pass of a least-significant-digit radix sort. */
static void sort_digit(const uint64_t *keys, const uint32_t *from, uint32_t *to, size_t count,
                       unsigned shift) {
    size_t start[RADIX + 1] = {0};
    for (size_t k = 0; k < count; ++k)
        ++start[(keys[k] >> shift & (RADIX - 1)) + 1];
    for (size_t d = 0; d < RADIX; ++d)
        start[d + 1] += start[d];
    for (size_t k = 0; k < count; ++k)
        to[start[keys[from[k]] >> shift & (RADIX - 1)]++] = from[k];
}

ovoid_status ov_sort_keys(ovoid_context *context, const uint64_t *keys, size_t count,
                          uint32_t *order) {
    uint32_t *other = ov_alloc(context, count, sizeof *other, "sorting points");
    if (!other)
        return OVOID_ERROR_MEMORY;
    uint64_t used = 0;
    for (size_t k = 0; k < count; ++k) {
        order[k] = (uint32_t)k;
        used |= keys[k];
    }
    uint32_t *from = order, *to = other;
    for (unsigned shift = 0; shift < 64 && used >> shift; shift += RADIX_BITS) {
        sort_digit(keys, from, to, count, shift);
        uint32_t *const swap = from;
        from = to;
        to = swap;
    }
    if (from != order)
        memcpy(order, from, count * sizeof *order);
    free(other);
    return OVOID_OK;
}
