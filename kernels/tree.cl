/*
 * A tree of boxes (ov_tree in shared.h) made on the device: its lowest level from the leaves, then
 * one launch for each level above. A work-item makes a group of OV_GROUP boxes. What it makes is
 * what ov_tree_build() makes on the host, bit by bit.
 */

/* What an absent box has in place of side k of low x, y, z, high x, y, z. */
static inline float ov_absent_side(uint k) {
    return k < 3 ? FLT_MAX : -FLT_MAX;
}

/* leaf: low x, y, z, high x, y, z of each. */
__kernel void tree_leaves(const uint leaves, __global const float *restrict leaf,
                          __global float *restrict tree) {
    const uint group = get_global_id(0);
    if (group >= (leaves + OV_GROUP - 1) / OV_GROUP)
        return;
    __global float *const own = tree + (size_t)group * (6 * OV_GROUP);
    for (uint j = 0; j < OV_GROUP; ++j) {
        const size_t box = (size_t)group * OV_GROUP + j;
        for (uint k = 0; k < 6; ++k)
            own[k * OV_GROUP + j] = box < leaves ? leaf[6 * box + k] : ov_absent_side(k);
    }
}

/* boxes: of this level, whose groups begin at group `to` of the tree; `from`: those of the level
 * below, each of which goes into one box. */
__kernel void tree_level(const uint boxes, const uint from, const uint to, __global float *tree) {
    const uint group = get_global_id(0);
    if (group >= (boxes + OV_GROUP - 1) / OV_GROUP)
        return;
    __global float *const own = tree + ((size_t)to + group) * (6 * OV_GROUP);
    for (uint j = 0; j < OV_GROUP; ++j) {
        const uint box = group * OV_GROUP + j;
        __global const float *const below = tree + ((size_t)from + box) * (6 * OV_GROUP);
        for (uint k = 0; k < 6; ++k) {
            float side = ov_absent_side(k);
            for (uint i = 0; i < OV_GROUP && box < boxes; ++i) {
                const float other = below[k * OV_GROUP + i];
                side = k < 3 ? min(side, other) : max(side, other);
            }
            own[k * OV_GROUP + j] = side;
        }
    }
}
