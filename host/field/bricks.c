#include "field/bricks.h"

#include <stdlib.h>

_Static_assert(OV_BRICK_X *OV_BRICK_Y *OV_BRICK_Z == OV_PACK, "a brick is a pack");

static const uint64_t brick[3] = {OV_BRICK_X, OV_BRICK_Y, OV_BRICK_Z};

/* Fills one brick's origin, its first point, and unless packed is NULL coordinates. */
static void lay_brick(const uint64_t at[3], const double step[3], float *origin, float *packed) {
    for (size_t axis = 0; axis < 3; ++axis)
        origin[axis] = ov_to_float((double)(at[axis] * brick[axis]) * step[axis]);
    origin[3] = OV_PACK;
    for (uint64_t j = 0; packed && j < OV_PACK; ++j) {
        uint64_t within[3];
        ov_brick_point(j, within);
        for (size_t axis = 0; axis < 3; ++axis) {
            const double x = (double)(at[axis] * brick[axis] + within[axis]) * step[axis];
            packed[axis * OV_PACK + j] = (float)(x - (double)origin[axis]);
        }
    }
}

ovoid_status ov_bricks_order(ovoid_context *context, const uint64_t bricks[3], uint32_t *order) {
    const size_t count = (size_t)(bricks[0] * bricks[1] * bricks[2]);
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "lattice bricks");
    if (!keys)
        return OVOID_ERROR_MEMORY;
    unsigned bits = 1;
    while (bricks[0] >> bits || bricks[1] >> bits || bricks[2] >> bits)
        ++bits;
    size_t k = 0;
    for (uint32_t z = 0; z < bricks[2]; ++z)
        for (uint32_t y = 0; y < bricks[1]; ++y)
            for (uint32_t x = 0; x < bricks[0]; ++x)
                keys[k++] = ov_hilbert_index(x, y, z, bits);
    const ovoid_status status = ov_sort_keys(context, keys, count, order);
    free(keys);
    return status;
}

ovoid_status ov_bricks_upload(ovoid_context *context, const uint64_t bricks[3],
                              const uint32_t *order, const double step[3], bool alike,
                              ov_points *points) {
    ovoid_status status = OVOID_OK;
    const size_t packs = (size_t)(bricks[0] * bricks[1] * bricks[2]);
    float *const packed =
        ov_alloc(context, (alike ? 1 : packs) * 3 * OV_PACK, sizeof *packed, "lattice points");
    points->pack_origin =
        ov_alloc(context, packs * 4, sizeof *points->pack_origin, "lattice bricks");
    if (!packed || !points->pack_origin) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t k = 0; k < packs; ++k) {
        const uint64_t at[3] = {order[k] % bricks[0], order[k] / bricks[0] % bricks[1],
                                order[k] / (bricks[0] * bricks[1])};
        lay_brick(at, step, points->pack_origin + 4 * k,
                  alike && k > 0 ? NULL : packed + k * (3 * OV_PACK));
    }
    points->count = packs * OV_PACK;
    points->packs = packs;
    points->alike = alike;
    OV_TRY(ov_points_upload(context, packed, points));
cleanup:
    free(packed);
    return status;
}
