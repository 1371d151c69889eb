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
 * work-items per term takes several packs at a time, and a tile is one point per work-item.
 */

#if OV_LANES == 1
#define OV_SHARERS 1 /* work-items per term */
#define OV_TEAM_KERNEL __kernel
#define OV_TILE_PACKS 32
#else
#define OV_SHARERS OV_TEAM
#define OV_TEAM_KERNEL __kernel __attribute__((reqd_work_group_size(OV_TEAM, 1, 1)))
#define OV_TILE_PACKS OV_PACKS_AT_ONCE
#endif
#define OV_PACKS_AT_ONCE (OV_SHARERS / OV_LANES)
#define OV_TILE (OV_TILE_PACKS / OV_PACKS_AT_ONCE * OV_VECTORS)
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

/* Adds up the team's pairs in a fixed order; sharer 0 holds the result. */
static inline void ov_add_team(float *high, float *low, uint lane, __local float *scratch) {
    for (uint width = OV_SHARERS / 2; width > 0; width /= 2) {
        scratch[2 * lane] = *high;
        scratch[2 * lane + 1] = *low;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (lane < width) {
            ov_add_scalar(high, low, scratch[2 * (lane + width)]);
            *low += scratch[2 * (lane + width) + 1];
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}
#endif

OV_TEAM_KERNEL void
moments(const uint count, __global const uint *restrict idle, __global const float *restrict points,
        __global const float4 *restrict origins, __global const float *restrict u,
        __global const uint *restrict start, __global const uint *restrict item,
        __global const ov_term *restrict terms, __global float *restrict result) {
    const uint index = get_global_id(0) / OV_SHARERS, sharer = get_global_id(0) % OV_SHARERS;
    const uint lane = sharer % OV_LANES;
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
        const uint packs = min((uint)OV_TILE_PACKS, end - first);
        ov_vec ue[OV_TILE];
        float centre[4 * OV_TILE_PACKS / OV_PACKS_AT_ONCE];
        for (uint k = sharer / OV_LANES, n = 0; k < packs; k += OV_PACKS_AT_ONCE, ++n)
            vstore4(ov_centre(terms + index, origins[item[first + k]]), n, centre);
        for (uint k = sharer / OV_LANES, n = 0; k < packs; k += OV_PACKS_AT_ONCE, ++n) {
            const size_t pack = item[first + k];
            __global const float *const p = points + pack * (3 * OV_PACK);
#pragma unroll
            for (uint v = 0; v < OV_VECTORS; ++v) {
                const uint at = v * OV_LANES + lane;
                const ov_vec x = OV_LOAD(at, p) - centre[4 * n],
                             y = OV_LOAD(at, p + OV_PACK) - centre[4 * n + 1],
                             z = OV_LOAD(at, p + 2 * OV_PACK) - centre[4 * n + 2];
                ue[n * OV_VECTORS + v] = OV_LOAD(at, u + pack * OV_PACK) * ov_value(t, x, y, z);
            }
        }
        for (uint k = sharer / OV_LANES, n = 0; k < packs; k += OV_PACKS_AT_ONCE, ++n) {
            const size_t pack = item[first + k];
            __global const float *const p = points + pack * (3 * OV_PACK);
#pragma unroll
            for (uint v = 0; v < OV_VECTORS; ++v) {
                const uint at = v * OV_LANES + lane;
                const ov_vec x = OV_LOAD(at, p) - centre[4 * n],
                             y = OV_LOAD(at, p + OV_PACK) - centre[4 * n + 1],
                             z = OV_LOAD(at, p + 2 * OV_PACK) - centre[4 * n + 2];
                const ov_vec e = ue[n * OV_VECTORS + v];
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
        }
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
    __local float scratch[2 * OV_SHARERS];
#endif
#pragma unroll
    for (uint m = 0; m < OV_MONOMIALS; ++m) {
        ov_add(&total[m], &rest[m], sum[m]);
        float high, low;
        ov_sum_both(total[m], rest[m], &high, &low);
#if OV_SHARERS > 1
        ov_add_team(&high, &low, sharer, scratch);
        if (sharer == 0 && !done)
#endif
        {
            result[((size_t)index * OV_MONOMIALS + m) * 2] = high;
            result[((size_t)index * OV_MONOMIALS + m) * 2 + 1] = low;
        }
    }
}

/* Other files have their own. */
#undef OV_TILE_PACKS
#undef OV_FLUSH_TILES
