/*
 * The two lists that make every pass linear, pack -> terms and term -> packs.
 *
 * A term reaches a pack if its cut-off ellipsoid q(z) <= reach may meet the pack's box grown by
 * `skin` on every side. The test is tight: it minimises the convex q over the box by coordinate
 * descent, and its lower bound q + min over the box of grad q . (z' - z) never loses a pair.
 *
 * Each term walks once down a tree of boxes over the packs, as one work-item or as a team. What it
 * finds is kept as entries, one
 * for each group of OV_GROUP packs with a bit for each of them: both lists are made of these, which
 * are several times fewer than pairs. Entries go to chunks taken as they are needed, since nobody
 * knows beforehand how many a term has.
 */

#define OV_SWEEPS 3
#define OV_GROUP_VECTORS (OV_GROUP / OV_TEST)

/* Where a work-group is large enough, as on GPUs, a team shares the walk of a term and all that
 * follows; elsewhere a work-item does it alone. */
#define OV_BY_TEAM (OV_LANES > 1 && OV_TEAM >= OV_GROUP)
#if OV_BY_TEAM
#define OV_LIST_KERNEL __kernel __attribute__((reqd_work_group_size(OV_TEAM, 1, 1)))
#else
#define OV_LIST_KERNEL __kernel
#endif

/* Width of the box test: wide on CPUs, one box per work-item of a team. Single work-items without
 * vectors take four boxes, which hides the latencies. */
#if OV_BY_TEAM
#define OV_TEST 1
#elif OV_VECTOR == 1
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
#if OV_TEST == 1
typedef float ov_test;
#define OV_TEST_LOAD(index, pointer) ((pointer)[index])
#else
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
#endif

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
#if OV_TEST == 1
    return least <= t.reach && b.lx <= b.hx;
#else
    return ov_bits((least <= t.reach) & (b.lx <= b.hx));
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

/* Counts an entry in its bin; or hangs it into the chain that begins there, if there is room for
 * its chunk: link holds the number of the next one, from 1 on, 0 at the end, and the term. */
static inline void ov_put_in_bin(__global uint *bin, const uint term, const uint chunk,
                                 const uint entry, const uint room, __global uint2 *link) {
    const uint at = chunk * OV_CHUNK + entry;
    if (!link)
        atomic_inc(bin);
    else if (chunk < room)
        link[at] = (uint2)(atomic_xchg(bin, at + 1), term);
}

#if OV_BY_TEAM
/* What the values of the team's work-items before this one come to, and in .y those of all. */
static inline uint2 ov_sum_before(const uint value, const uint sharer, __local uint *scratch) {
    scratch[sharer] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint width = 1; width < OV_TEAM; width *= 2) {
        const uint more = sharer >= width ? scratch[sharer - width] : 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        scratch[sharer] += more;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    const uint2 sums = (uint2)(scratch[sharer] - value, scratch[OV_TEAM - 1]);
    barrier(CLK_LOCAL_MEM_FENCE);
    return sums;
}

/* Groups that a team tests side by side, and how many they may hand on to the level below. */
#define OV_ABREAST (OV_TEAM / OV_GROUP)
#define OV_HANDED (OV_ABREAST * OV_GROUP)
#if OV_ABREAST > OV_CHUNK
#error "entries of groups side by side would need more than one new chunk"
#endif

/* What a team shares: the groups of each level that are still to be tested, a bit for each box that
 * was reached in those under test, and the last chunk taken. */
typedef struct ov_walk {
    uint group[OV_LEVELS][OV_HANDED];
    uint bits[OV_ABREAST];
    uint chunk;
} ov_walk;

/* A lower bound of q over the box. */
static inline ov_test ov_least_q(const ov_term t, const ov_boxes b) {
    if (t.xy == 0.0f && t.xz == 0.0f && t.yz == 0.0f)
        return ov_least_aligned(t, b);
    return ov_lower_bound(t, b);
}

/* Makes walk->bits for `count` groups of boxes, one box per work-item. */
static inline void ov_test_boxes(const ov_term t, __global const float *boxes,
                                 __local const uint *group, const uint count, const float skin,
                                 const uint sharer, __local ov_walk *walk) {
    if (sharer < count)
        walk->bits[sharer] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint own = sharer / OV_GROUP, j = sharer % OV_GROUP;
    if (own < count) {
        const ov_boxes b = ov_load_boxes(t, boxes + (size_t)group[own] * (6 * OV_GROUP), j, skin);
        if (ov_reached(t, b, ov_least_q(t, b)))
            atomic_or(&walk->bits[own], 1u << j);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

/* Counts what was reached in `count` groups side by side: by whole groups, or by single boxes. */
typedef struct ov_reach {
    uint before; /* reached groups before that of the work-item */
    uint groups;
    uint boxes_before; /* reached boxes before that of the work-item */
    uint boxes;
} ov_reach;

static inline ov_reach ov_count_reached(const uint count, const uint sharer,
                                        __local const ov_walk *walk) {
    const uint own = sharer / OV_GROUP, j = sharer % OV_GROUP;
    ov_reach reach = {0, 0, 0, 0};
    for (uint k = 0; k < count; ++k) {
        const uint bits = walk->bits[k], boxes = popcount(bits);
        reach.before += k < sharer && bits != 0;
        reach.groups += bits != 0;
        reach.boxes_before += k < own ? boxes : 0;
        reach.boxes += boxes;
    }
    if (own < count)
        reach.boxes_before += popcount(walk->bits[own] & ((1u << j) - 1u));
    return reach;
}

/* Keeps an entry, if there is room for its chunk. */
static inline void ov_enter(const uint entry, const uint chunk, const uint group, const uint bits,
                            const uint room, __global uint *entry_group,
                            __global ushort *entry_bits) {
    const size_t at = (size_t)chunk * OV_CHUNK + entry % OV_CHUNK;
    if (chunk < room) {
        entry_group[at] = group;
        entry_bits[at] = (ushort)bits;
    }
}

/* The entries of every term, in ascending order of their groups: entry k of a term is at
 * k % OV_CHUNK of its chunk k / OV_CHUNK, of which chain[term] holds the first one, next[chunk] the
 * one after, and chain[term].y the number of entries. Chunks from `room` on are counted, not
 * written.
 *
 * tally, zero at the start: chunks taken, entries of every bin, pairs of every group, pairs of
 * every term. block: terms that share a bin. groups: of packs, 0 where nobody wants their lists,
 * and bins and groups are not counted. link: null, or bins hold chains (make_few_lists()). */
OV_LIST_KERNEL void packs_of_terms(const uint terms_count, __global const ov_term *restrict terms,
                                   const ov_tree tree, __global const float *restrict boxes,
                                   const float skin, const uint groups, const uint block,
                                   const uint room, __global uint *restrict tally,
                                   __global uint2 *restrict chain, __global uint *restrict next,
                                   __global uint *restrict entry_group,
                                   __global ushort *restrict entry_bits,
                                   __global uint2 *restrict link) {
    __local ov_walk walk;
    const uint index = get_group_id(0), sharer = get_local_id(0);
    const int levels = (int)tree.levels;
    __global uint *const bins = tally + 1;
    __global uint *const pairs = bins + (size_t)groups * OV_BINS;
    const ov_term t = terms[index];
    uint found = 0, entries = 0, first = 0, chunk = 0;
    /* Depth first, some groups of one level at a time: of those held at a level, so many are taken.
     * Every work-item keeps the same count, and meets the same barriers. */
    uint held[OV_LEVELS], taken[OV_LEVELS], first_group[OV_LEVELS];
    for (uint l = 0; l < OV_LEVELS; ++l) {
        held[l] = taken[l] = 0;
        first_group[l] = tree.groups[l];
    }
    int level = t.reach >= 0.0f && levels > 0 ? levels - 1 : levels;
    if (level < levels)
        held[level] = 1;
    if (sharer == 0)
        walk.group[max(levels - 1, 0)][0] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    while (level < levels) {
        __local const uint *const group = walk.group[level] + taken[level];
        const uint count = min(held[level] - taken[level], (uint)OV_ABREAST);
        ov_test_boxes(t, boxes + (size_t)first_group[level] * (6 * OV_GROUP), group, count,
                      skin + t.skin, sharer, &walk);
        const ov_reach reach = ov_count_reached(count, sharer, &walk);
        taken[level] += count;
        /* The first entry that begins a chunk, if any of these does. */
        const uint begins = (entries + OV_CHUNK - 1) / OV_CHUNK * OV_CHUNK;
        const bool more = level == 0 && begins < entries + reach.groups;
        if (more && sharer == 0) {
            walk.chunk = atomic_inc(tally);
            if (begins > 0 && chunk < room)
                next[chunk] = walk.chunk;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        if (level == 0) {
            if (sharer < count && walk.bits[sharer] != 0) {
                const uint entry = entries + reach.before;
                const uint into = more && entry >= begins ? walk.chunk : chunk;
                ov_enter(entry, into, group[sharer], walk.bits[sharer], room, entry_group,
                         entry_bits);
                if (groups > 0) {
                    ov_put_in_bin(&bins[ov_bin(group[sharer], index, block)], index, into,
                                  entry % OV_CHUNK, room, link);
                    atomic_add(&pairs[group[sharer]], popcount(walk.bits[sharer]));
                }
            }
            first = more && begins == 0 ? walk.chunk : first;
            chunk = more ? walk.chunk : chunk;
            entries += reach.groups;
            found += reach.boxes;
        } else {
            const uint own = sharer / OV_GROUP, j = sharer % OV_GROUP;
            if (own < count && (walk.bits[own] >> j & 1u))
                walk.group[level - 1][reach.boxes_before] = group[own] * OV_GROUP + j;
            held[level - 1] = reach.boxes;
            taken[level - 1] = 0;
            --level;
        }
        while (level < levels && taken[level] == held[level])
            ++level;
        barrier(CLK_LOCAL_MEM_FENCE); /* all have read the bits, and what is handed on is there */
    }
    if (sharer == 0) {
        pairs[groups + index] = found;
        chain[index] = (uint2)(first, entries);
    }
}
#else
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

__kernel void packs_of_terms(const uint terms_count, __global const ov_term *restrict terms,
                             const ov_tree tree, __global const float *restrict boxes,
                             const float skin, const uint groups, const uint block, const uint room,
                             __global uint *restrict tally, __global uint2 *restrict chain,
                             __global uint *restrict next, __global uint *restrict entry_group,
                             __global ushort *restrict entry_bits, __global uint2 *restrict link) {
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
                        const uint packs = popcount(own), entry = entries % OV_CHUNK;
                        found += packs;
                        ++entries;
                        if (groups == 0)
                            continue;
                        ov_put_in_bin(&bins[ov_bin(group, index, block)], index, chunk, entry, room,
                                      link);
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

#endif

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

/* Hands out the entries of a term, own.y of them from chunk own.x on: into the bins of their
 * groups, unless place is null, and its packs to item[to] and on, unless item is. */
#if OV_BY_TEAM
static inline void ov_hand_out(const uint2 own, const uint index, const uint block, uint to,
                               const uint sharer, __local uint *scratch, __global const uint *next,
                               __global const uint *entry_group, __global const ushort *entry_bits,
                               __global uint *item, __global uint *place, __global uint *group_term,
                               __global ushort *group_bits) {
    uint chunk = own.x, reached = 0; /* the latter counts chunks along the chain */
    for (uint first = 0; first < own.y; first += OV_TEAM) {
        const uint entry = first + sharer;
        uint group = 0, bits = 0;
        if (entry < own.y) {
            for (; reached < entry / OV_CHUNK; ++reached)
                chunk = next[chunk];
            const size_t at = (size_t)chunk * OV_CHUNK + entry % OV_CHUNK;
            group = entry_group[at];
            bits = entry_bits[at];
        }
        if (place && bits != 0) {
            const uint into = atomic_inc(&place[ov_bin(group, index, block)]);
            group_term[into] = index;
            group_bits[into] = (ushort)bits;
        }
        if (item) {
            const uint2 packs = ov_sum_before(popcount(bits), sharer, scratch);
            for (uint own_to = to + packs.x; bits != 0; bits &= bits - 1)
                item[own_to++] = group * OV_GROUP + ov_lowest(bits);
            to += packs.y;
        }
    }
}
#else
static inline void ov_hand_out(const uint2 own, const uint index, const uint block, uint to,
                               __global const uint *next, __global const uint *entry_group,
                               __global const ushort *entry_bits, __global uint *item,
                               __global uint *place, __global uint *group_term,
                               __global ushort *group_bits) {
    uint chunk = own.x;
    for (uint k = 0; k < own.y; ++k) {
        if (k > 0 && k % OV_CHUNK == 0)
            chunk = next[chunk];
        const size_t at = (size_t)chunk * OV_CHUNK + k % OV_CHUNK;
        const uint group = entry_group[at];
        if (place) {
            const uint into = atomic_inc(&place[ov_bin(group, index, block)]);
            group_term[into] = index;
            group_bits[into] = entry_bits[at];
        }
        if (item)
            for (uint bits = entry_bits[at]; bits != 0; bits &= bits - 1)
                item[to++] = group * OV_GROUP + ov_lowest(bits);
    }
}
#endif

/* Hands out the entries of every term. item: its packs in ascending order, from item[start[i]] on.
 * group_term, group_bits: the entries of each group of packs; place holds where each bin begins,
 * and afterwards ends, and the order within a bin depends on timing. start or place may be null:
 * nobody wants these lists. */
#if OV_BY_TEAM
OV_LIST_KERNEL void
hand_out_entries(const uint terms_count, const uint block, __global const uint2 *restrict chain,
                 __global const uint *restrict next, __global const uint *restrict entry_group,
                 __global const ushort *restrict entry_bits, __global const uint *restrict start,
                 __global uint *restrict item, __global uint *restrict place,
                 __global uint *restrict group_term, __global ushort *restrict group_bits,
                 __global const uint *restrict totals) {
    __local uint scratch[OV_TEAM];
    const uint index = get_group_id(0);
    const uint entries = totals[4] != 0 ? chain[index].y : 0; /* all meet the barriers */
    ov_hand_out((uint2)(chain[index].x, entries), index, block, start ? start[index] : 0,
                get_local_id(0), scratch, next, entry_group, entry_bits, start ? item : 0, place,
                group_term, group_bits);
}
#else
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
    ov_hand_out(chain[index], index, block, start ? start[index] : 0, next, entry_group, entry_bits,
                start ? item : 0, place, group_term, group_bits);
}
#endif

/* Insertion sort: puts entry k where it belongs among those from `first` on, which are in order;
 * its bits. Only entries of the same bin can be in disorder, and few are. */
static inline ushort ov_sort_in(const uint first, const uint k, __global uint *group_term,
                                __global ushort *group_bits) {
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
    return bits;
}

#if OV_BY_TEAM
/* Entries that a team sorts at once, in local memory. */
#define OV_SORTED 512

/* Puts the entries from `first` to `end` in order: each goes behind all that are smaller. Where
 * there are too many for that, one work-item sorts them. */
static inline void ov_sort(const uint first, const uint end, const uint sharer, __local uint *term,
                           __local ushort *bits, __global uint *group_term,
                           __global ushort *group_bits) {
    const uint count = end - first;
    const bool few = count <= OV_SORTED;
    for (uint k = sharer; few && k < count; k += OV_TEAM) {
        term[k] = group_term[first + k];
        bits[k] = group_bits[first + k];
    }
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE); /* all are read */
    for (uint k = sharer; few && k < count; k += OV_TEAM) {
        uint before = 0;
        for (uint i = 0; i < count; ++i)
            before += term[i] < term[k];
        group_term[first + before] = term[k];
        group_bits[first + before] = bits[k];
    }
    for (uint k = first; !few && sharer == 0 && k < end; ++k)
        ov_sort_in(first, k, group_term, group_bits);
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
}
#endif

#if OV_BY_TEAM
/* Lists the packs of a group from its entries, which are in order, from item[at] on. Several
 * work-items per pack, each with a stretch of the entries. */
static inline void ov_list_packs(const uint first, const uint end, const uint at, const uint group,
                                 const uint groups, const uint packs, const uint sharer,
                                 __local uint *scratch, __global const uint *group_term,
                                 __global const ushort *group_bits, __global uint *start,
                                 __global uint *item) {
    const uint j = sharer / OV_ABREAST, share = sharer % OV_ABREAST;
    const uint each = (end - first + OV_ABREAST - 1) / OV_ABREAST;
    const uint from = min(first + share * each, end), stop = min(from + each, end);
    uint count = 0;
    for (uint k = from; k < stop; ++k)
        count += group_bits[k] >> j & 1u;
    const uint2 before = ov_sum_before(count, sharer, scratch);
    uint to = at + before.x;
    if (share == 0 && group * OV_GROUP + j < packs)
        start[group * OV_GROUP + j] = to;
    if (sharer == 0 && group == groups - 1)
        start[packs] = at + before.y;
    for (uint k = from; k < stop; ++k)
        if (group_bits[k] >> j & 1u)
            item[to++] = group_term[k];
}
#else
/* Lists the packs of a group from its entries, which are in order, from item[at] on; counts: how
 * many each pack has. */
static inline void ov_list_packs(const uint first, const uint end, uint at, const uint16 counts,
                                 const uint group, const uint groups, const uint packs,
                                 __global const uint *group_term, __global const ushort *group_bits,
                                 __global uint *start, __global uint *item) {
    uint cursor[OV_GROUP];
    vstore16(counts, 0, cursor);
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
#endif

/* The terms of every pack in ascending order, so that sums have one order: the entries of a group
 * are sorted, and the lists of its packs made from them.
 *
 * place: where the entries of each bin end, then where the pairs of each group begin. */
#if OV_BY_TEAM
OV_LIST_KERNEL void lists_of_packs(const uint groups, const uint packs,
                                   __global const uint *restrict place, __global uint *group_term,
                                   __global ushort *group_bits, __global uint *restrict start,
                                   __global uint *restrict item) {
    __local uint scratch[OV_TEAM], term[OV_SORTED];
    __local ushort bits[OV_SORTED];
    const uint group = get_group_id(0), sharer = get_local_id(0);
    __global const uint *const bin_end = place, *const pair_start =
                                                    place + (size_t)groups * OV_BINS;
    const uint first = group == 0 ? 0 : bin_end[group * OV_BINS - 1];
    const uint end = bin_end[group * OV_BINS + OV_BINS - 1];
    /* All at once where they are few; else bin by bin, which are in order. */
    const uint sorts = end - first <= OV_SORTED / 2 ? 1 : OV_BINS;
    uint from_bin = first;
    for (uint bin = 0; bin < sorts; ++bin) {
        const uint to_bin = sorts == 1 ? end : bin_end[group * OV_BINS + bin];
        ov_sort(from_bin, to_bin, sharer, term, bits, group_term, group_bits);
        from_bin = to_bin;
    }
    ov_list_packs(first, end, pair_start[group], group, groups, packs, sharer, scratch, group_term,
                  group_bits, start, item);
}
#else
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
    for (uint k = first; k < end; ++k)
        counts += (uint16)(ov_sort_in(first, k, group_term, group_bits)) >> lane & 1u;
    ov_list_packs(first, end, pair_start[group], counts, group, groups, packs, group_term,
                  group_bits, start, item);
}
#endif

/* ---- few ------------------------------------------------------------------------------------- */

/* What the numbers before number `index` come to, and in .y all of them. */
static inline uint2 ov_sum_few(__global const uint *number, const uint count, const uint index) {
    uint before = 0, all = 0;
    for (uint k = 0; k < index; ++k)
        before += number[k];
    for (uint k = index; k < count; ++k)
        all += number[k];
    return (uint2)(before, before + all);
}

/* All lists from the chains of packs_of_terms(), in one launch: where terms and groups are few,
 * each finds out by itself where its lists begin. A work-item or team for each group of packs, then
 * for each term. tally: what was counted; spare: that of the next time, which is made zero where
 * the last one has left something: `used` words. group_term, group_bits: room for as many entries
 * as there are pairs. pack_start, term_start may be null. totals: as of scan_lists(). */
#if OV_BY_TEAM
OV_LIST_KERNEL void
make_few_lists(const uint terms_count, const uint groups, const uint packs, const uint4 room,
               __global const uint *restrict tally, const uint used, __global uint *restrict spare,
               __global const uint2 *restrict chain, __global const uint *restrict next,
               __global const uint *restrict entry_group,
               __global const ushort *restrict entry_bits, __global const uint2 *restrict link,
               __global uint *group_term, __global ushort *group_bits,
               __global uint *restrict pack_start, __global uint *restrict pack_item,
               __global uint *restrict term_start, __global uint *restrict term_item,
               __global uint *restrict totals) {
    __local uint scratch[OV_TEAM], term[OV_SORTED], entries;
    __local ushort bits[OV_SORTED];
    const uint place = get_group_id(0), sharer = get_local_id(0);
    const bool of_group = place < groups;
    const uint index = of_group ? place : place - groups;
    __global const uint *const heads = tally + 1;
    __global const uint *const pairs = heads + (size_t)groups * OV_BINS, *const found =
                                                                             pairs + groups;
    const uint count = of_group ? groups : terms_count;
    __global const uint *const counted = of_group ? pairs : found;
    uint before = 0, all = 0;
    for (uint k = sharer; k < count; k += OV_TEAM)
        before += k < index ? counted[k] : 0;
    for (uint k = sharer; k < terms_count; k += OV_TEAM)
        all += found[k];
    const uint begin = ov_sum_before(before, sharer, scratch).y,
               items = ov_sum_before(all, sharer, scratch).y;
    const bool fits = tally[0] <= room.x && items <= room.z;
    if (sharer == 0)
        entries = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (of_group && fits && sharer < OV_BINS)
        for (uint at = heads[index * OV_BINS + sharer]; at > 0; at = link[at - 1].x) {
            const uint to = begin + atomic_inc(&entries);
            group_term[to] = link[at - 1].y;
            group_bits[to] = entry_bits[at - 1];
        }
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
    const uint end = begin + entries, at = fits ? begin : 0;
    ov_sort(begin, end, sharer, term, bits, group_term, group_bits);
    /* All meet all barriers: neither does anything for the other's groups. */
    ov_list_packs(begin, end, at, of_group ? index : 0, of_group ? groups : UINT_MAX,
                  of_group ? packs : 0, sharer, scratch, group_term, group_bits, pack_start,
                  pack_item);
    const bool listed = !of_group && term_start && fits;
    ov_hand_out(listed ? chain[index] : (uint2)(0, 0), index, 1, begin, sharer, scratch, next,
                entry_group, entry_bits, term_item, 0, group_term, group_bits);
    if (!of_group && term_start && sharer == 0) {
        term_start[index] = at;
        if (index == terms_count - 1)
            term_start[terms_count] = fits ? items : 0;
    }
    for (uint k = get_global_id(0); k < used; k += get_global_size(0))
        spare[k] = 0;
    if (place == groups && sharer == 0)
        vstore4((uint4)(tally[0], 0, items, 0), 0, totals);
    if (place == groups && sharer == 0)
        totals[4] = fits;
}
#else
__kernel void make_few_lists(const uint terms_count, const uint groups, const uint packs,
                             const uint4 room, __global const uint *restrict tally, const uint used,
                             __global uint *restrict spare, __global const uint2 *restrict chain,
                             __global const uint *restrict next,
                             __global const uint *restrict entry_group,
                             __global const ushort *restrict entry_bits,
                             __global const uint2 *restrict link, __global uint *group_term,
                             __global ushort *group_bits, __global uint *restrict pack_start,
                             __global uint *restrict pack_item, __global uint *restrict term_start,
                             __global uint *restrict term_item, __global uint *restrict totals) {
    const uint place = get_global_id(0);
    if (place >= groups + terms_count)
        return;
    const bool of_group = place < groups;
    const uint index = of_group ? place : place - groups;
    __global const uint *const heads = tally + 1;
    __global const uint *const pairs = heads + (size_t)groups * OV_BINS, *const found =
                                                                             pairs + groups;
    const uint2 own = ov_sum_few(of_group ? pairs : found, of_group ? groups : terms_count, index);
    const uint items = of_group ? ov_sum_few(found, terms_count, 0).y : own.y;
    const bool fits = tally[0] <= room.x && items <= room.z;
    const uint begin = fits ? own.x : 0;
    if (of_group) {
        const uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        uint16 counts = 0;
        uint end = begin;
        for (uint bin = 0; fits && bin < OV_BINS; ++bin) {
            const uint first = end;
            for (uint at = heads[index * OV_BINS + bin]; at > 0; at = link[at - 1].x) {
                group_term[end] = link[at - 1].y;
                group_bits[end] = entry_bits[at - 1];
                counts += (uint16)(ov_sort_in(first, end, group_term, group_bits)) >> lane & 1u;
                ++end;
            }
        }
        ov_list_packs(begin, end, begin, counts, index, groups, packs, group_term, group_bits,
                      pack_start, pack_item);
    } else if (term_start) {
        term_start[index] = begin;
        if (index == terms_count - 1)
            term_start[terms_count] = fits ? items : 0;
        if (fits)
            ov_hand_out(chain[index], index, 1, begin, next, entry_group, entry_bits, term_item, 0,
                        group_term, group_bits);
    }
    for (uint k = place; k < used; k += groups + terms_count)
        spare[k] = 0;
    if (place == groups) {
        totals[0] = tally[0];
        totals[1] = 0;
        totals[2] = items;
        totals[3] = 0;
        totals[4] = fits;
    }
}
#endif
