/*
 * The two lists that make every pass linear, pack -> terms and term -> packs.
 *
 * A term reaches a pack if its cut-off ellipsoid q(z) <= reach may meet the pack's box grown by
 * `skin` on every side. The test is tight: it minimises the convex q over the box by coordinate
 * descent, and its lower bound q + min over the box of grad q . (z' - z) never loses a pair.
 *
 * Each term walks once down a tree of boxes over the packs. What it finds is kept as entries, one
 * for each group of OV_GROUP packs with a bit for each of them: both lists are made of these, which
 * are several times fewer than pairs. Entries go to chunks taken as they are needed, since nobody
 * knows beforehand how many a term has.
 */

#define OV_SWEEPS 3
#define OV_GROUP_VECTORS (OV_GROUP / OV_TEST)

/* Width of the box test: wide on CPUs, and on GPUs four boxes per work-item hide the latencies. */
#if OV_VECTOR == 1
#define OV_TEST 4
#else
#define OV_TEST OV_VECTOR
#endif
/* Groups tested side by side: the test is a chain of operations that wait for each other, and a
 * group that is one vector is one chain. */
#if OV_GROUP_VECTORS == 1
#define OV_SIDES 2
#else
#define OV_SIDES 1
#endif
typedef OV_JOIN(float, OV_TEST) ov_test;
typedef OV_JOIN(int, OV_TEST) ov_test_hit;
#define OV_TEST_LOAD OV_JOIN(vload, OV_TEST)

/* A bit for each lane that is set. */
static inline uint ov_bits(ov_test_hit hit) {
#if OV_TEST == 16
    const int16 lane =
        hit & (int16)(1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7, 1 << 8,
                      1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15);
    const int8 eight = lane.lo | lane.hi;
    const int4 four = eight.lo | eight.hi;
#elif OV_TEST == 8
    const int8 lane = hit & (int8)(1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7);
    const int4 four = lane.lo | lane.hi;
#else
    const int4 four = hit & (int4)(1 << 0, 1 << 1, 1 << 2, 1 << 3);
#endif
    const int2 two = four.lo | four.hi;
    return (uint)(two.x | two.y);
}

/* As clamp(), which compilers make longer for the sake of values that are not finite. */
static inline ov_test ov_within(ov_test x, ov_test low, ov_test high) {
    return max(min(x, high), low);
}

/* Boxes relative to a term's centre. */
typedef struct ov_boxes {
    ov_test lx, ly, lz, hx, hy, hz;
} ov_boxes;

/* Vector v of a group's boxes, grown by skin. */
static inline ov_boxes ov_load_boxes(const ov_term t, __global const float *group, uint v,
                                     float skin) {
    ov_boxes b;
    b.lx = OV_TEST_LOAD(v, group) - (t.x + skin);
    b.ly = OV_TEST_LOAD(v, group + OV_GROUP) - (t.y + skin);
    b.lz = OV_TEST_LOAD(v, group + 2 * OV_GROUP) - (t.z + skin);
    b.hx = OV_TEST_LOAD(v, group + 3 * OV_GROUP) - (t.x - skin);
    b.hy = OV_TEST_LOAD(v, group + 4 * OV_GROUP) - (t.y - skin);
    b.hz = OV_TEST_LOAD(v, group + 5 * OV_GROUP) - (t.z - skin);
    return b;
}

/* Least q over the boxes, of a term whose axes are the boxes' own: q is least in each direction by
 * itself, in the point next to the centre. */
static inline ov_test ov_least_aligned(const ov_term t, const ov_boxes b) {
    const ov_test zero = 0.0f;
    const ov_test x = ov_within(zero, b.lx, b.hx), y = ov_within(zero, b.ly, b.hy),
                  z = ov_within(zero, b.lz, b.hz);
    return 0.5f * fma(x, x * (2.0f * t.xx), fma(y, y * (2.0f * t.yy), z * (z * (2.0f * t.zz))));
}

/* A lower bound of q over the boxes. */
static inline ov_test ov_lower_bound(const ov_term t, const ov_boxes b) {
    const ov_test zero = 0.0f;
    const float ix = -0.5f / t.xx, iy = -0.5f / t.yy, iz = -0.5f / t.zz;
    ov_test x, y = ov_within(zero, b.ly, b.hy), z = ov_within(zero, b.lz, b.hz);
#pragma unroll
    for (int sweep = 0; sweep < OV_SWEEPS; ++sweep) {
        x = ov_within(ix * fma(y, (ov_test)(t.xy), z * t.xz), b.lx, b.hx);
        y = ov_within(iy * fma(x, (ov_test)(t.xy), z * t.yz), b.ly, b.hy);
        z = ov_within(iz * fma(x, (ov_test)(t.xz), y * t.yz), b.lz, b.hz);
    }
    const ov_test gx = fma(x, (ov_test)(2.0f * t.xx), fma(y, (ov_test)(t.xy), z * t.xz));
    const ov_test gy = fma(y, (ov_test)(2.0f * t.yy), fma(x, (ov_test)(t.xy), z * t.yz));
    const ov_test gz = fma(z, (ov_test)(2.0f * t.zz), fma(x, (ov_test)(t.xz), y * t.yz));
    const ov_test q = 0.5f * fma(x, gx, fma(y, gy, z * gz));
    return q + min(gx * (b.lx - x), gx * (b.hx - x)) + min(gy * (b.ly - y), gy * (b.hy - y)) +
           min(gz * (b.lz - z), gz * (b.hz - z));
}

/* A bit for each box that the term may reach. */
static inline uint ov_reached(const ov_term t, const ov_boxes b, ov_test least) {
    return ov_bits((least <= t.reach) & (b.lx <= b.hx));
}

/* Tests the term against the boxes of OV_SIDES groups, whose bits follow one another: bit j of a
 * group is set where its box j may be reached. */
static inline uint ov_test_groups(const ov_term t, __global const float *one,
                                  __global const float *other, float skin) {
    const bool aligned = t.xy == 0.0f && t.xz == 0.0f && t.yz == 0.0f;
#if OV_SIDES == 2
    const ov_boxes first = ov_load_boxes(t, one, 0, skin);
    const ov_boxes second = ov_load_boxes(t, other, 0, skin);
    ov_test least_first, least_second;
    if (aligned) {
        least_first = ov_least_aligned(t, first);
        least_second = ov_least_aligned(t, second);
    } else {
        least_first = ov_lower_bound(t, first);
        least_second = ov_lower_bound(t, second);
    }
    return ov_reached(t, first, least_first) | ov_reached(t, second, least_second) << OV_GROUP;
#else
    uint bits = 0;
#pragma unroll
    for (uint v = 0; v < OV_GROUP_VECTORS; ++v) {
        const ov_boxes b = ov_load_boxes(t, one, v, skin);
        ov_test least;
        if (aligned)
            least = ov_least_aligned(t, b);
        else
            least = ov_lower_bound(t, b);
        bits |= ov_reached(t, b, least) << (v * OV_TEST);
    }
    return bits;
#endif
}

/* The lowest bit that is set. */
static inline uint ov_lowest(uint bits) {
    return 31 - clz(bits & -bits);
}

/* Bin of the entries of a group: terms that follow one another share it (see shared.h). */
static inline uint ov_bin(uint group, uint term, uint block) {
    return group * OV_BINS + term / block;
}

/* The entries of every term, in ascending order of their groups: entry k of a term is at
 * k % OV_CHUNK of its chunk k / OV_CHUNK, of which chain[term] holds the first one, next[chunk] the
 * one after, and chain[term].y the number of entries. Chunks from `room` on are counted, not
 * written.
 *
 * tally, zero at the start: chunks taken, entries of every bin, pairs of every group, pairs of
 * every term. block: terms that share a bin. groups: of packs, 0 where nobody wants their lists,
 * and bins and groups are not counted. */
__kernel void packs_of_terms(const uint terms_count, __global const ov_term *restrict terms,
                             const ov_tree tree, __global const float *restrict boxes,
                             const float skin, const uint groups, const uint block, const uint room,
                             __global uint *restrict tally, __global uint2 *restrict chain,
                             __global uint *restrict next, __global uint *restrict entry_group,
                             __global ushort *restrict entry_bits) {
    /* A copy, made where all work-items still run together: Mesa's compiler does not look up kernel
     * arguments by an index that differs between them. */
    const int levels = (int)tree.levels;
    uint first_group[OV_LEVELS];
    for (uint l = 0; l < OV_LEVELS; ++l)
        first_group[l] = tree.groups[l];
    const uint index = get_global_id(0);
    if (index >= terms_count)
        return;
    __global uint *const bins = tally + 1;
    __global uint *const pairs = bins + (size_t)groups * OV_BINS;
    const ov_term t = terms[index];
    uint found = 0, entries = 0, first = 0, chunk = 0;
    if (t.reach >= 0.0f && levels > 0) {
        /* Depth first, OV_SIDES groups at a time. pending[l] has a bit for each box of the current
         * groups of level l that is still to be visited. */
        uint pending[OV_LEVELS], one[OV_LEVELS], other[OV_LEVELS];
        int level = levels - 1;
        one[level] = other[level] = 0;
        bool fresh = true;
        while (level < levels) {
            if (fresh) {
                const size_t base = first_group[level];
                uint bits =
                    ov_test_groups(t, boxes + (base + one[level]) * (6 * OV_GROUP),
                                   boxes + (base + other[level]) * (6 * OV_GROUP), skin + t.skin);
                if (one[level] == other[level])
                    bits &= (1u << OV_GROUP) - 1u;
                pending[level] = bits;
                fresh = false;
                if (level == 0) {
                    for (uint k = 0; k < OV_SIDES; ++k) {
                        const uint own =
                            k == 0 ? pending[0] & ((1u << OV_GROUP) - 1u) : pending[0] >> OV_GROUP;
                        const uint group = k == 0 ? one[0] : other[0];
                        if (own == 0)
                            continue;
                        if (entries % OV_CHUNK == 0) {
                            const uint taken = atomic_inc(tally);
                            if (entries == 0)
                                first = taken;
                            else if (chunk < room)
                                next[chunk] = taken;
                            chunk = taken;
                        }
                        if (chunk < room) {
                            const size_t at = (size_t)chunk * OV_CHUNK + entries % OV_CHUNK;
                            entry_group[at] = group;
                            entry_bits[at] = (ushort)own;
                        }
                        const uint packs = popcount(own);
                        found += packs;
                        ++entries;
                        if (groups == 0)
                            continue;
                        atomic_inc(&bins[ov_bin(group, index, block)]);
                        atomic_add(&pairs[group], packs);
                    }
                    pending[0] = 0;
                }
            }
            if (pending[level] == 0) {
                ++level;
                continue;
            }
            const uint j = ov_lowest(pending[level]);
            pending[level] &= pending[level] - 1;
            const uint child = (j < OV_GROUP ? one : other)[level] * OV_GROUP + j % OV_GROUP;
            uint sibling = child;
            if (OV_SIDES == 2 && pending[level] != 0) {
                const uint i = ov_lowest(pending[level]);
                pending[level] &= pending[level] - 1;
                sibling = (i < OV_GROUP ? one : other)[level] * OV_GROUP + i % OV_GROUP;
            }
            --level;
            one[level] = child;
            other[level] = sibling;
            fresh = true;
        }
    }
    pairs[groups + index] = found;
    chain[index] = (uint2)(first, entries);
}

/* The stretch of `count` numbers that a work-item of the only work-group takes: first and end. */
static inline uint2 own_stretch(const uint count) {
    const uint size = get_local_size(0), each = (count + size - 1) / size;
    const uint first = min((uint)get_local_id(0) * each, count);
    return (uint2)(first, min(first + each, count));
}

/* What the numbers of the stretches before this work-item's come to, and all of them. */
static inline ulong2 sums_of(__global const uint *number, const uint count,
                             __local ulong *scratch) {
    const uint2 own = own_stretch(count);
    ulong sum = 0;
    ulong2 sums = 0;
    for (uint k = own.x; k < own.y; ++k)
        sum += number[k];
    scratch[get_local_id(0)] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint k = 0; k < get_local_size(0); ++k) {
        sums.x += k < get_local_id(0) ? scratch[k] : 0;
        sums.y += scratch[k];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return sums;
}

/* Turns numbers into where each begins when all are laid out one after the other, or into zeros
 * where there is no room for them, and leaves zeros behind. start may be null. */
static inline void turn_to_starts(__global uint *number, const uint count, ulong before,
                                  const bool fits, __global uint *start) {
    const uint2 own = own_stretch(count);
    for (uint k = own.x; k < own.y; ++k) {
        const uint one = number[k];
        number[k] = 0;
        if (start)
            start[k] = fits ? (uint)before : 0;
        before += one;
    }
}

/* Where everything that was counted begins. place: the bins, then the pairs of the groups. start:
 * the pairs of the terms, and where the last ones end. Either may be null. room: for chunks,
 * entries and pairs; where one does not suffice all lists are empty. totals: chunks taken, entries,
 * pairs as low and high half, and whether there was room. The tally is zero afterwards, for the
 * next time. One work-group. */
__kernel void scan_lists(const uint terms_count, const uint groups, const uint4 room,
                         __global uint *restrict tally, __global uint *restrict place,
                         __global uint *restrict start, __global uint *restrict totals) {
    __local ulong scratch[OV_SCAN_GROUP];
    if (get_group_id(0) > 0)
        return;
    const uint count = groups * OV_BINS, chunks = tally[0];
    __global uint *const bins = tally + 1, *const pairs = bins + count;
    __global uint *const terms = pairs + groups;
    const ulong2 entries = sums_of(bins, count, scratch);
    const ulong2 grouped = sums_of(pairs, groups, scratch);
    const ulong2 items = sums_of(terms, terms_count, scratch);
    const bool fits = chunks <= room.x && entries.y <= room.y && items.y <= room.z;
    turn_to_starts(bins, count, entries.x, fits, place);
    turn_to_starts(pairs, groups, grouped.x, fits, place ? place + count : place);
    turn_to_starts(terms, terms_count, items.x, fits, start);
    barrier(CLK_GLOBAL_MEM_FENCE); /* all have read the chunks by now */
    if (get_local_id(0) > 0)
        return;
    if (start)
        start[terms_count] = fits ? (uint)items.y : 0;
    totals[0] = chunks;
    totals[1] = (uint)entries.y;
    totals[2] = (uint)items.y;
    totals[3] = (uint)(items.y >> 32);
    totals[4] = fits;
    tally[0] = 0;
}

/* Hands out the entries of every term. item: its packs in ascending order, from item[start[i]] on.
 * group_term, group_bits: the entries of each group of packs; place holds where each bin begins,
 * and afterwards ends, and the order within a bin depends on timing. start or place may be null:
 * nobody wants these lists. */
__kernel void
hand_out_entries(const uint terms_count, const uint block, __global const uint2 *restrict chain,
                 __global const uint *restrict next, __global const uint *restrict entry_group,
                 __global const ushort *restrict entry_bits, __global const uint *restrict start,
                 __global uint *restrict item, __global uint *restrict place,
                 __global uint *restrict group_term, __global ushort *restrict group_bits,
                 __global const uint *restrict totals) {
    const uint index = get_global_id(0);
    if (index >= terms_count || totals[4] == 0)
        return;
    const uint entries = chain[index].y;
    uint chunk = chain[index].x;
    uint to = start ? start[index] : 0;
    for (uint k = 0; k < entries; ++k) {
        if (k > 0 && k % OV_CHUNK == 0)
            chunk = next[chunk];
        const size_t at = (size_t)chunk * OV_CHUNK + k % OV_CHUNK;
        const uint group = entry_group[at];
        if (place) {
            const uint own = atomic_inc(&place[ov_bin(group, index, block)]);
            group_term[own] = index;
            group_bits[own] = entry_bits[at];
        }
        if (start)
            for (uint bits = entry_bits[at]; bits != 0; bits &= bits - 1)
                item[to++] = group * OV_GROUP + ov_lowest(bits);
    }
}

/* The terms of every pack in ascending order, so that sums have one order: a work-item sorts the
 * entries of its group, and makes the lists of its packs from them. Insertion sort: only entries of
 * the same bin can be in disorder, and few are.
 *
 * place: where the entries of each bin end, then where the pairs of each group begin. */
__kernel void lists_of_packs(const uint groups, const uint packs,
                             __global const uint *restrict place, __global uint *group_term,
                             __global ushort *group_bits, __global uint *restrict start,
                             __global uint *restrict item) {
    const uint group = get_global_id(0);
    if (group >= groups)
        return;
    __global const uint *const bin_end = place, *const pair_start =
                                                    place + (size_t)groups * OV_BINS;
    const uint first = group == 0 ? 0 : bin_end[group * OV_BINS - 1];
    const uint end = bin_end[group * OV_BINS + OV_BINS - 1];
    const uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint16 counts = 0;
    for (uint k = first; k < end; ++k) {
        const uint term = group_term[k];
        const ushort bits = group_bits[k];
        uint hole = k;
        for (; hole > first && group_term[hole - 1] > term; --hole) {
            group_term[hole] = group_term[hole - 1];
            group_bits[hole] = group_bits[hole - 1];
        }
        if (hole != k) {
            group_term[hole] = term;
            group_bits[hole] = bits;
        }
        counts += (uint16)(bits) >> lane & 1u;
    }
    uint cursor[OV_GROUP];
    vstore16(counts, 0, cursor);
    uint at = pair_start[group];
    for (uint j = 0; j < OV_GROUP; ++j) {
        const uint count = cursor[j];
        cursor[j] = at;
        if (group * OV_GROUP + j < packs)
            start[group * OV_GROUP + j] = at;
        at += count;
    }
    if (group == groups - 1)
        start[packs] = at;
    for (uint k = first; k < end; ++k) {
        const uint term = group_term[k];
        for (uint bits = group_bits[k]; bits != 0; bits &= bits - 1)
            item[cursor[ov_lowest(bits)]++] = term;
    }
}
