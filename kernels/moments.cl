/*
 * Sums over the points that a term reaches (design: operation "moments"): for each term i
 * sum_k u_k e_i(y_k) m(y_k - mu_i), m the OV_MONOMIALS monomials of shared.h.
 *
 * start, item: the packs of term i are item[start[i]] .. item[start[i + 1] - 1].
 * points, origins: as for field().
 * u: weights of the points, OV_PACK per pack, 0 for points that only fill up the last pack.
 * idle: null, or a word that is not 0 where there is nothing to be done.
 * moments: OV_MONOMIALS pairs (high, low) per term; the sum is high + low. Floats are summed over a
 * few thousand points and then added to a two-float total, so no device needs double precision.
 *
 * On CPUs one work-item per term: u e is computed for a tile of packs first and the ten sums in a
 * second loop, since one fused loop needs more registers than there are. On GPUs a team of OV_TEAM
 * work-items per term takes several packs at a time, and each work-item OV_DEPTH points at once: a
 * list is a chain of loads that wait for each other, item, origin, points, and so several are under
 * way.
 */

#if OV_LANES == 1
#define OV_SHARERS 1 /* work-items per term */
#define OV_TEAM_KERNEL __kernel
#define OV_TILE_PACKS 32
#define OV_TILE (OV_TILE_PACKS * OV_VECTORS)
#else
#define OV_SHARERS OV_TEAM
#define OV_TEAM_KERNEL __kernel __attribute__((reqd_work_group_size(OV_TEAM, 1, 1)))
#define OV_PACKS_AT_ONCE (OV_SHARERS / OV_LANES)
#define OV_DEPTH 4
#define OV_TILE_PACKS (OV_DEPTH * OV_PACKS_AT_ONCE)
#endif
#define OV_FLUSH_TILES (256 / OV_TILE_PACKS)

/* Halves a pair of vectors by adding its halves, error free. */
#define OV_FOLD(name, whole, half_type)                                                            \
    static inline void name(whole high, whole low, half_type *high_half, half_type *low_half) {    \
        const half_type sum = high.lo + high.hi;                                                   \
        const half_type part = sum - high.lo;                                                      \
        *low_half = (low.lo + low.hi) + ((high.lo - (sum - part)) + (high.hi - part));             \
        *high_half = sum;                                                                          \
    }
#if OV_VECTOR >= 16
OV_FOLD(ov_fold16, float16, float8)
#endif
#if OV_VECTOR >= 8
OV_FOLD(ov_fold8, float8, float4)
#endif
#if OV_VECTOR >= 4
OV_FOLD(ov_fold4, float4, float2)
OV_FOLD(ov_fold2, float2, float)
#endif
#undef OV_FOLD

/* Sum of a pair of vectors as a pair of scalars. */
static inline void ov_sum_both(ov_vec high, ov_vec low, float *high_sum, float *low_sum) {
#if OV_VECTOR == 1
    *high_sum = high;
    *low_sum = low;
#else
    float2 high2, low2;
#if OV_VECTOR >= 8
    float4 high4, low4;
#if OV_VECTOR >= 16
    float8 high8, low8;
    ov_fold16(high, low, &high8, &low8);
    ov_fold8(high8, low8, &high4, &low4);
#else
    ov_fold8(high, low, &high4, &low4);
#endif
    ov_fold4(high4, low4, &high2, &low2);
#else
    ov_fold4(high, low, &high2, &low2);
#endif
    ov_fold2(high2, low2, high_sum, low_sum);
#endif
}

#if OV_SHARERS > 1
static inline void ov_add_scalar(float *high, float *low, float value) {
    const float sum = *high + value;
    const float part = sum - *high;
    *low += (*high - (sum - part)) + (value - part);
    *high = sum;
}

/* Adds up the pairs of the team's work-items in a fixed order: `pairs` holds OV_SHARERS of them for
 * each monomial, and the first of these the sum. */
static inline void ov_add_team(__local float2 *pairs, const uint sharer) {
    for (uint width = OV_SHARERS / 2; width > 0; width /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint k = sharer; k < OV_MONOMIALS * width; k += OV_SHARERS) {
            const uint at = k / width * OV_SHARERS + k % width;
            const float2 other = pairs[at + width];
            float high = pairs[at].x, low = pairs[at].y;
            ov_add_scalar(&high, &low, other.x);
            pairs[at] = (float2)(high, low + other.y);
        }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}
#endif

/* sum += e times the monomials of x, y, z. */
static inline void ov_add_monomials(ov_vec *sum, ov_vec e, ov_vec x, ov_vec y, ov_vec z) {
    const ov_vec ex = e * x, ey = e * y, ez = e * z;
    sum[0] += e;
    sum[1] += ex;
    sum[2] += ey;
    sum[3] += ez;
    sum[4] = fma(ex, x, sum[4]);
    sum[5] = fma(ex, y, sum[5]);
    sum[6] = fma(ex, z, sum[6]);
    sum[7] = fma(ey, y, sum[7]);
    sum[8] = fma(ey, z, sum[8]);
    sum[9] = fma(ez, z, sum[9]);
}

/* Adds the packs item[first] .. item[end - 1], at most OV_TILE_PACKS, to the sums. */
#if OV_SHARERS > 1
static inline void ov_add_tile(ov_vec *sum, const ov_term t, __global const ov_term *own,
                               __global const float *points, __global const float4 *origins,
                               __global const float *u, __global const uint *item, const uint first,
                               const uint end, const uint sharer) {
    const uint lane = sharer % OV_LANES;
    uint pack[OV_DEPTH];
    float4 centre[OV_DEPTH];
#pragma unroll
    for (uint n = 0; n < OV_DEPTH; ++n)
        pack[n] = item[min(first + n * OV_PACKS_AT_ONCE + sharer / OV_LANES, end - 1)];
#pragma unroll
    for (uint n = 0; n < OV_DEPTH; ++n)
        centre[n] = ov_centre(own, origins[pack[n]]);
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v) {
        const uint at = v * OV_LANES + lane;
        ov_vec x[OV_DEPTH], y[OV_DEPTH], z[OV_DEPTH], e[OV_DEPTH];
#pragma unroll
        for (uint n = 0; n < OV_DEPTH; ++n) {
            __global const float *const p = points + (size_t)pack[n] * (3 * OV_PACK);
            x[n] = OV_LOAD(at, p) - centre[n].x;
            y[n] = OV_LOAD(at, p + OV_PACK) - centre[n].y;
            z[n] = OV_LOAD(at, p + 2 * OV_PACK) - centre[n].z;
            e[n] = OV_LOAD(at, u + (size_t)pack[n] * OV_PACK);
        }
#pragma unroll
        for (uint n = 0; n < OV_DEPTH; ++n) {
            const bool there = first + n * OV_PACKS_AT_ONCE + sharer / OV_LANES < end;
            const ov_vec ue = there ? e[n] * ov_value(t, x[n], y[n], z[n]) : (ov_vec)(0.0f);
            ov_add_monomials(sum, ue, x[n], y[n], z[n]);
        }
    }
}
#else
static inline void ov_add_tile(ov_vec *sum, const ov_term t, __global const ov_term *own,
                               __global const float *points, __global const float4 *origins,
                               __global const float *u, __global const uint *item, const uint first,
                               const uint end, const uint sharer) {
    const uint packs = end - first;
    ov_vec ue[OV_TILE];
    float centre[4 * OV_TILE_PACKS];
    for (uint k = 0; k < packs; ++k)
        vstore4(ov_centre(own, origins[item[first + k]]), k, centre);
    for (uint k = 0; k < packs; ++k) {
        const size_t pack = item[first + k];
        __global const float *const p = points + pack * (3 * OV_PACK);
#pragma unroll
        for (uint v = 0; v < OV_VECTORS; ++v) {
            const ov_vec x = OV_LOAD(v, p) - centre[4 * k],
                         y = OV_LOAD(v, p + OV_PACK) - centre[4 * k + 1],
                         z = OV_LOAD(v, p + 2 * OV_PACK) - centre[4 * k + 2];
            ue[k * OV_VECTORS + v] = OV_LOAD(v, u + pack * OV_PACK) * ov_value(t, x, y, z);
        }
    }
    for (uint k = 0; k < packs; ++k) {
        const size_t pack = item[first + k];
        __global const float *const p = points + pack * (3 * OV_PACK);
#pragma unroll
        for (uint v = 0; v < OV_VECTORS; ++v) {
            const ov_vec x = OV_LOAD(v, p) - centre[4 * k],
                         y = OV_LOAD(v, p + OV_PACK) - centre[4 * k + 1],
                         z = OV_LOAD(v, p + 2 * OV_PACK) - centre[4 * k + 2];
            ov_add_monomials(sum, ue[k * OV_VECTORS + v], x, y, z);
        }
    }
}
#endif

OV_TEAM_KERNEL void
moments(const uint count, __global const uint *restrict idle, __global const float *restrict points,
        __global const float4 *restrict origins, __global const float *restrict u,
        __global const uint *restrict start, __global const uint *restrict item,
        __global const ov_term *restrict terms, __global float *restrict result) {
    const uint index = get_global_id(0) / OV_SHARERS, sharer = get_global_id(0) % OV_SHARERS;
    const bool done = idle && *idle != 0;
#if OV_SHARERS == 1
    if (index >= count || done)
        return;
#endif
    /* otherwise a group is exactly one term, and all of it takes part in the barriers */
    const ov_term t = terms[index];
    ov_vec total[OV_MONOMIALS], rest[OV_MONOMIALS], sum[OV_MONOMIALS];
#pragma unroll
    for (uint m = 0; m < OV_MONOMIALS; ++m)
        total[m] = rest[m] = sum[m] = 0.0f;

    const uint end = done ? start[index] : start[index + 1];
    uint tiles = 0;
    for (uint first = start[index]; first < end; first += OV_TILE_PACKS) {
        ov_add_tile(sum, t, terms + index, points, origins, u, item, first,
                    first + min((uint)OV_TILE_PACKS, end - first), sharer);
        if (++tiles == OV_FLUSH_TILES) {
            tiles = 0;
#pragma unroll
            for (uint m = 0; m < OV_MONOMIALS; ++m) {
                ov_add(&total[m], &rest[m], sum[m]);
                sum[m] = 0.0f;
            }
        }
    }

#if OV_SHARERS > 1
    __local float2 pairs[OV_MONOMIALS * OV_SHARERS];
#endif
    __global float *const out = result + (size_t)index * (2 * OV_MONOMIALS);
#pragma unroll
    for (uint m = 0; m < OV_MONOMIALS; ++m) {
        ov_add(&total[m], &rest[m], sum[m]);
        float high, low;
        ov_sum_both(total[m], rest[m], &high, &low);
#if OV_SHARERS > 1
        pairs[m * OV_SHARERS + sharer] = (float2)(high, low);
#else
        vstore2((float2)(high, low), m, out);
#endif
    }
#if OV_SHARERS > 1
    ov_add_team(pairs, sharer);
    for (uint m = sharer; m < OV_MONOMIALS && !done; m += OV_SHARERS)
        vstore2(pairs[m * OV_SHARERS], m, out);
#endif
}

/* Other files have their own. */
#undef OV_TILE_PACKS
#undef OV_FLUSH_TILES
#undef OV_TILE
#undef OV_PACKS_AT_ONCE
