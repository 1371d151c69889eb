/*
 * A tree of boxes (ov_tree in shared.h) made on the device: its two lowest levels from the leaves,
 * then one launch for two more above. A work-item makes a group of OV_GROUP boxes, and the box
 * about them. What it makes is what ov_tree_build() makes on the host, bit by bit.
 */

/* What an absent box has in place of side k of low x, y, z, high x, y, z. */
static inline float ov_absent_side(uint k) {
    return k < 3 ? FLT_MAX : -FLT_MAX;
}

static inline float ov_joint_side(uint k, float side, float other) {
    return k < 3 ? min(side, other) : max(side, other);
}

/* Work-items for `groups` groups: where there is a level above, one for each place of its groups.
 */
static inline uint ov_makers(const uint groups, const uint above) {
    return above > 0 ? (groups + OV_GROUP - 1) / OV_GROUP * OV_GROUP : groups;
}

/* Puts the box about a group where it belongs in the level above. */
static inline void ov_put_joint(const float *joint, const uint group, const uint above,
                                __global float *tree) {
    __global float *const to = tree + ((size_t)above + group / OV_GROUP) * (6 * OV_GROUP);
    for (uint k = 0; k < 6; ++k)
        to[k * OV_GROUP + group % OV_GROUP] = joint[k];
}

/* leaf: low x, y, z, high x, y, z of each. above: where the groups of the level above begin; 0:
 * there is none. */
__kernel void tree_leaves(const uint leaves, const uint above, __global const float *restrict leaf,
                          __global float *restrict tree) {
    const uint group = get_global_id(0), groups = (leaves + OV_GROUP - 1) / OV_GROUP;
    if (group >= ov_makers(groups, above))
        return;
    __global float *const own = tree + (size_t)group * (6 * OV_GROUP);
    float joint[6];
    for (uint k = 0; k < 6; ++k)
        joint[k] = ov_absent_side(k);
    for (uint j = 0; j < OV_GROUP && group < groups; ++j) {
        const size_t box = (size_t)group * OV_GROUP + j;
        for (uint k = 0; k < 6; ++k) {
            const float side = box < leaves ? leaf[6 * box + k] : ov_absent_side(k);
            own[k * OV_GROUP + j] = side;
            joint[k] = ov_joint_side(k, joint[k], side);
        }
    }
    if (above > 0)
        ov_put_joint(joint, group, above, tree);
}

/* boxes: of this level, whose groups begin at group `to` of the tree; `from`: those of the level
 * below, each of which goes into one box; `above`: as of tree_leaves(). */
__kernel void tree_level(const uint boxes, const uint from, const uint to, const uint above,
                         __global float *tree) {
    const uint group = get_global_id(0), groups = (boxes + OV_GROUP - 1) / OV_GROUP;
    if (group >= ov_makers(groups, above))
        return;
    __global float *const own = tree + ((size_t)to + group) * (6 * OV_GROUP);
    float joint[6];
    for (uint k = 0; k < 6; ++k)
        joint[k] = ov_absent_side(k);
    for (uint j = 0; j < OV_GROUP && group < groups; ++j) {
        const uint box = group * OV_GROUP + j;
        __global const float *const below = tree + ((size_t)from + box) * (6 * OV_GROUP);
        for (uint k = 0; k < 6; ++k) {
            float side = ov_absent_side(k);
            for (uint i = 0; i < OV_GROUP && box < boxes; ++i)
                side = ov_joint_side(k, side, below[k * OV_GROUP + i]);
            own[k * OV_GROUP + j] = side;
            joint[k] = ov_joint_side(k, joint[k], side);
        }
    }
    if (above > 0)
        ov_put_joint(joint, group, above, tree);
}
