/*
 * The two lists that make every pass linear: term -> packs, by walking a tree of boxes over the
 * packs, and pack -> terms, its transpose. Each is counted, scanned on the host, then filled.
 *
 * A term reaches a pack if its cut-off ellipsoid q(z) <= reach may meet the pack's box grown by
 * `skin` on every side. The test is tight: it minimises the convex q over the box by coordinate
 * descent, and its lower bound q + min over the box of grad q . (z' - z) never loses a pair.
 */

#define OV_SWEEPS 3
#define OV_GROUP_VECTORS (OV_GROUP / OV_TEST)

/* Width of the box test: wide on CPUs, and on GPUs four boxes per work-item hide the latencies. */
#if OV_VECTOR == 1
#define OV_TEST 4
#else
#define OV_TEST OV_VECTOR
#endif
typedef OV_JOIN(float, OV_TEST) ov_test;
typedef OV_JOIN(int, OV_TEST) ov_test_hit;
#define OV_TEST_LOAD OV_JOIN(vload, OV_TEST)
#define OV_TEST_STORE OV_JOIN(vstore, OV_TEST)

/* -1 where the term may meet the box low..high (relative to its centre), else 0. */
static inline ov_test_hit ov_meets(const ov_term t, ov_test lx, ov_test ly, ov_test lz, ov_test hx,
                                   ov_test hy, ov_test hz) {
    const ov_test zero = 0.0f;
    ov_test x = clamp(zero, lx, hx), y = clamp(zero, ly, hy), z = clamp(zero, lz, hz);
    const float ix = -0.5f / t.xx, iy = -0.5f / t.yy, iz = -0.5f / t.zz;
#pragma unroll
    for (int sweep = 0; sweep < OV_SWEEPS; ++sweep) {
        x = clamp(ix * fma(y, (ov_test)(t.xy), z * t.xz), lx, hx);
        y = clamp(iy * fma(x, (ov_test)(t.xy), z * t.yz), ly, hy);
        z = clamp(iz * fma(x, (ov_test)(t.xz), y * t.yz), lz, hz);
    }
    const ov_test gx = fma(x, (ov_test)(2.0f * t.xx), fma(y, (ov_test)(t.xy), z * t.xz));
    const ov_test gy = fma(y, (ov_test)(2.0f * t.yy), fma(x, (ov_test)(t.xy), z * t.yz));
    const ov_test gz = fma(z, (ov_test)(2.0f * t.zz), fma(x, (ov_test)(t.xz), y * t.yz));
    const ov_test q = 0.5f * fma(x, gx, fma(y, gy, z * gz));
    const ov_test lower = q + min(gx * (lx - x), gx * (hx - x)) +
                          min(gy * (ly - y), gy * (hy - y)) + min(gz * (lz - z), gz * (hz - z));
    return (lower <= t.reach) & (lx <= hx);
}

/* Tests the term against the boxes of one group; hit[j] != 0 where box j may be reached. */
static inline void ov_test_group(const ov_term t, __global const float *group, float skin,
                                 int *hit) {
#pragma unroll
    for (uint v = 0; v < OV_GROUP_VECTORS; ++v) {
        const ov_test lx = OV_TEST_LOAD(v, group) - (t.x + skin);
        const ov_test ly = OV_TEST_LOAD(v, group + OV_GROUP) - (t.y + skin);
        const ov_test lz = OV_TEST_LOAD(v, group + 2 * OV_GROUP) - (t.z + skin);
        const ov_test hx = OV_TEST_LOAD(v, group + 3 * OV_GROUP) - (t.x - skin);
        const ov_test hy = OV_TEST_LOAD(v, group + 4 * OV_GROUP) - (t.y - skin);
        const ov_test hz = OV_TEST_LOAD(v, group + 5 * OV_GROUP) - (t.z - skin);
        OV_TEST_STORE(ov_meets(t, lx, ly, lz, hx, hy, hz), v, hit);
    }
}

/* What packs_of_terms() writes. */
#define OV_COUNT 0      /* count[i] alone */
#define OV_FILL 1       /* the packs of term i, to item[start[i]] and on */
#define OV_FILL_COUNT 2 /* both, of the packs as many as fit before start[i + 1] */

/* The packs of every term in ascending order. */
__kernel void packs_of_terms(const uint terms_count, __global const ov_term *restrict terms,
                             const ov_tree tree, __global const float *restrict boxes,
                             const float skin, const uint mode, __global uint *restrict count,
                             __global const uint *restrict start, __global uint *restrict item) {
    /* A copy, made where all work-items still run together: Mesa's compiler does not look up kernel
     * arguments by an index that differs between them. */
    const int levels = (int)tree.levels;
    uint first_group[OV_LEVELS];
    for (uint l = 0; l < OV_LEVELS; ++l)
        first_group[l] = tree.groups[l];
    const uint index = get_global_id(0);
    if (index >= terms_count)
        return;
    const ov_term t = terms[index];
    uint found = 0;
    uint at = mode == OV_COUNT ? 0 : start[index];
    const uint end = mode == OV_COUNT ? 0 : mode == OV_FILL ? UINT_MAX : start[index + 1];
    if (t.reach >= 0.0f && levels > 0) {
        /* Depth first: pending[l] has a bit for each box of the current group of level l that is
         * still to be visited. */
        uint pending[OV_LEVELS];
        uint group[OV_LEVELS];
        int hit[OV_GROUP];
        int level = levels - 1;
        group[level] = 0;
        bool fresh = true;
        while (level < levels) {
            if (fresh) {
                const size_t g = first_group[level] + group[level];
                ov_test_group(t, boxes + g * (6 * OV_GROUP), skin + t.skin, hit);
                uint bits = 0;
                for (uint j = 0; j < OV_GROUP; ++j)
                    bits |= hit[j] ? 1u << j : 0u;
                if (level == 0) {
                    found += popcount(bits);
                    for (uint j = 0; j < OV_GROUP && at < end; ++j)
                        if (bits >> j & 1u)
                            item[at++] = group[0] * OV_GROUP + j;
                    bits = 0;
                }
                pending[level] = bits;
                fresh = false;
            }
            if (pending[level] == 0) {
                ++level;
                continue;
            }
            const uint j = 31 - clz(pending[level] & -pending[level]);
            pending[level] &= pending[level] - 1;
            group[level - 1] = group[level] * OV_GROUP + j;
            --level;
            fresh = true;
        }
    }
    if (mode != OV_FILL)
        count[index] = found;
}

/* Closes the gaps that OV_FILL_COUNT leaves: the packs of term i from room[room_start[i]] and on to
 * item[start[i]] and on. */
__kernel void close_gaps(const uint terms_count, __global const uint *restrict room_start,
                         __global const uint *restrict room, __global const uint *restrict start,
                         __global uint *restrict item) {
    const uint index = get_global_id(0);
    if (index >= terms_count)
        return;
    __global const uint *const from = room + room_start[index];
    __global uint *const to = item + start[index];
    const uint count = start[index + 1] - start[index];
    for (uint k = 0; k < count; ++k)
        to[k] = from[k];
}

/* count[p] += 1 for every term of pack p; count starts at zero. */
__kernel void count_transposed(const uint terms_count, __global const uint *restrict start,
                               __global const uint *restrict item, __global uint *restrict count) {
    const uint index = get_global_id(0);
    if (index >= terms_count)
        return;
    for (uint k = start[index]; k < start[index + 1]; ++k)
        atomic_inc(&count[item[k]]);
}

/* Writes the transpose; cursor starts as a copy of the transposed list's start. The order within a
 * pack depends on timing, so sort_lists() follows. */
__kernel void fill_transposed(const uint terms_count, __global const uint *restrict start,
                              __global const uint *restrict item, __global uint *restrict cursor,
                              __global uint *restrict transposed) {
    const uint index = get_global_id(0);
    if (index >= terms_count)
        return;
    for (uint k = start[index]; k < start[index + 1]; ++k)
        transposed[atomic_inc(&cursor[item[k]])] = index;
}

/* Sorts each list in ascending order, so that sums have one order. Insertion sort: lists are short
 * and nearly sorted. */
__kernel void sort_lists(const uint count, __global const uint *restrict start,
                         __global uint *restrict item) {
    const uint index = get_global_id(0);
    if (index >= count)
        return;
    const uint first = start[index], end = start[index + 1];
    for (uint k = first + 1; k < end; ++k) {
        const uint value = item[k];
        uint hole = k;
        for (; hole > first && item[hole - 1] > value; --hole)
            item[hole] = item[hole - 1];
        item[hole] = value;
    }
}
