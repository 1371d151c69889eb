#include "field/field.h"

#include <stdlib.h>
#include <string.h>

/* The Hilbert curve of J. Skilling, "Programming the Hilbert curve", AIP Conf. Proc. 707 (2004)
 * 381, as a machine that reads one bit of x, y and z at a time, from the highest: how the curve
 * runs through a cube, up to its 24 rotations, decides which of the cube's octants comes when, and
 * how the curve runs through that. states[8 * state + octant] = 8 * next state + place of the
 * octant, with octant = 4 x + 2 y + z and the first state 0. The tests hold the curve's definition
 * against it. */
static const uint8_t states[24 * 8] = {
    8,   17,  27,  2,   39,  46,  52,  5,   56,  71,  73,  86,  91,  20,  10,  13,  48,  1,
    103, 110, 115, 18,  12,  21,  126, 129, 29,  26,  79,  80,  140, 3,   148, 43,  37,  34,
    127, 128, 78,  81,  156, 45,  35,  42,  31,  6,   160, 105, 72,  87,  139, 4,   57,  70,
    50,  53,  0,   171, 111, 76,  49,  58,  102, 61,  180, 143, 83,  184, 69,  54,  66,  97,
    16,  123, 9,   74,  47,  60,  38,  77,  132, 95,  85,  14,  67,  144, 82,  33,  142, 55,
    185, 96,  93,  116, 90,  11,  188, 107, 175, 176, 101, 98,  62,  65,  164, 109, 119, 22,
    99,  106, 152, 41,  174, 177, 63,  64,  117, 114, 92,  19,  30,  125, 161, 122, 7,   172,
    104, 75,  130, 25,  133, 166, 179, 136, 84,  191, 94,  15,  141, 28,  145, 32,  138, 51,
    146, 155, 149, 36,  137, 24,  190, 167, 154, 157, 147, 44,  169, 182, 120, 135, 162, 165,
    121, 134, 187, 108, 168, 183, 118, 173, 23,  124, 153, 170, 40,  59,  178, 113, 131, 88,
    181, 158, 68,  151, 186, 163, 89,  112, 189, 100, 150, 159,
};

uint64_t ov_hilbert_index(uint32_t x, uint32_t y, uint32_t z, unsigned bits) {
    uint64_t index = 0;
    unsigned state = 0;
    for (unsigned b = bits; b-- > 0;) {
        const unsigned octant = (x >> b & 1u) << 2 | (y >> b & 1u) << 1 | (z >> b & 1u);
        const unsigned next = states[state | octant];
        index = index << 3 | (next & 7u);
        state = next & ~7u;
    }
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
