/*
 * Sums over the points that a term reaches (design: operation "gram"): for each term i
 * sum_k w_k e_i(y_k)^2 z^alpha, z = y_k - mu_i, for the OV_GRAM monomials z^alpha of shared.h.
 * These are the entries of sum_k w_k e_i^2 m m^T, m the OV_MONOMIALS monomials, and so of the
 * term's diagonal block of J^T W J.
 *
 * start, item: the packs of term i are item[start[i]] .. item[start[i + 1] - 1].
 * points, origins: as for field().
 * weight: OV_PACK per pack, 0 for points that only fill up the last pack.
 * result: OV_GRAM floats per term. Sums of tiles are added up in floats, and those of
 * OV_FLUSH_TILES tiles to a two-float total: about one rounding of the sum of magnitudes, however
 * long the list.
 *
 * On CPUs one work-item per term: w e^2 is computed for a tile of packs first, then the sums of
 * degree 0 to 2, 3 and 4 in a loop each, since all 35 need more registers than there are. On GPUs a
 * team of OV_TEAM work-items per term takes several packs at a time, and all sums go in one loop.
 */

#if OV_LANES == 1
#define OV_SHARERS 1 /* work-items per term */
#define OV_TEAM_KERNEL __kernel
#define OV_TILE_PACKS (64 / OV_VECTORS)
#define OV_TILE (OV_TILE_PACKS * OV_VECTORS)
#define OV_FLUSH_TILES 4
#else
#define OV_SHARERS OV_TEAM
#define OV_TEAM_KERNEL __kernel __attribute__((reqd_work_group_size(OV_TEAM, 1, 1)))
#define OV_TILE_PACKS (OV_SHARERS / OV_LANES)
#define OV_FLUSH_TILES (32 / OV_VECTORS)
#endif

/* Degrees 0 to 2, 3 and 4: where their sums start. */
#define OV_CUBIC 10
#define OV_QUARTIC 20

typedef struct ov_offset {
    ov_vec x, y, z;
} ov_offset;

static inline ov_offset ov_offset_of(__global const float *points, size_t pack, uint at,
                                     const float *centre) {
    __global const float *const p = points + pack * (3 * OV_PACK);
    ov_offset o;
    o.x = OV_LOAD(at, p) - centre[0];
    o.y = OV_LOAD(at, p + OV_PACK) - centre[1];
    o.z = OV_LOAD(at, p + 2 * OV_PACK) - centre[2];
    return o;
}

/* sum += e times the monomials of degree 0 to 2. */
static inline void ov_add_quadratic(ov_vec *sum, ov_vec e, const ov_offset o) {
    const ov_vec ex = e * o.x, ey = e * o.y, ez = e * o.z;
    sum[0] += e;
    sum[1] += ex;
    sum[2] += ey;
    sum[3] += ez;
    sum[4] = fma(ex, o.x, sum[4]);
    sum[5] = fma(ex, o.y, sum[5]);
    sum[6] = fma(ex, o.z, sum[6]);
    sum[7] = fma(ey, o.y, sum[7]);
    sum[8] = fma(ey, o.z, sum[8]);
    sum[9] = fma(ez, o.z, sum[9]);
}

/* sum += e times the monomials of degree 3. */
static inline void ov_add_cubic(ov_vec *sum, ov_vec e, const ov_offset o) {
    const ov_vec ey = e * o.y, ez = e * o.z;
    const ov_vec exx = e * o.x * o.x, eyy = ey * o.y, eyz = ey * o.z, ezz = ez * o.z;
    sum[0] = fma(exx, o.x, sum[0]);
    sum[1] = fma(exx, o.y, sum[1]);
    sum[2] = fma(exx, o.z, sum[2]);
    sum[3] = fma(eyy, o.x, sum[3]);
    sum[4] = fma(eyz, o.x, sum[4]);
    sum[5] = fma(ezz, o.x, sum[5]);
    sum[6] = fma(eyy, o.y, sum[6]);
    sum[7] = fma(eyy, o.z, sum[7]);
    sum[8] = fma(ezz, o.y, sum[8]);
    sum[9] = fma(ezz, o.z, sum[9]);
}

/* sum += e times the monomials of degree 4. */
static inline void ov_add_quartic(ov_vec *sum, ov_vec e, const ov_offset o) {
    const ov_vec xx = o.x * o.x, xy = o.x * o.y, xz = o.x * o.z, yy = o.y * o.y, yz = o.y * o.z,
                 zz = o.z * o.z;
    const ov_vec exx = e * xx, exy = e * xy, exz = e * xz, eyy = e * yy, eyz = e * yz, ezz = e * zz;
    sum[0] = fma(exx, xx, sum[0]);
    sum[1] = fma(exy, xx, sum[1]);
    sum[2] = fma(exz, xx, sum[2]);
    sum[3] = fma(eyy, xx, sum[3]);
    sum[4] = fma(eyz, xx, sum[4]);
    sum[5] = fma(ezz, xx, sum[5]);
    sum[6] = fma(eyy, xy, sum[6]);
    sum[7] = fma(eyz, xy, sum[7]);
    sum[8] = fma(ezz, xy, sum[8]);
    sum[9] = fma(ezz, xz, sum[9]);
    sum[10] = fma(eyy, yy, sum[10]);
    sum[11] = fma(eyz, yy, sum[11]);
    sum[12] = fma(ezz, yy, sum[12]);
    sum[13] = fma(ezz, yz, sum[13]);
    sum[14] = fma(ezz, zz, sum[14]);
}

#if OV_SHARERS == 1
/* One pass over the tile for `sums` of the sums, kept in registers: from zero, then added to
 * sum[first] .. */
#define OV_PASS(add, first, sums)                                                                  \
    {                                                                                              \
        ov_vec part[sums];                                                                         \
        _Pragma("unroll") for (uint m = 0; m < (sums); ++m) part[m] = 0.0f;                        \
        for (uint k = 0; k < packs; ++k) {                                                         \
            const size_t pack = item[begin + k];                                                   \
            _Pragma("unroll") for (uint v = 0; v < OV_VECTORS; ++v) add(                           \
                part, tile[k * OV_VECTORS + v], ov_offset_of(points, pack, v, centre + 4 * k));    \
        }                                                                                          \
        _Pragma("unroll") for (uint m = 0; m < (sums); ++m) sum[(first) + m] += part[m];           \
    }
#endif

/* Sum of a vector, halves first. */
static inline float ov_sum(ov_vec value) {
#if OV_VECTOR == 1
    return value;
#else
#if OV_VECTOR == 16
    const float8 eight = value.lo + value.hi;
    const float4 four = eight.lo + eight.hi;
#elif OV_VECTOR == 8
    const float4 four = value.lo + value.hi;
#else
    const float4 four = value;
#endif
    const float2 two = four.lo + four.hi;
    return two.x + two.y;
#endif
}

#if OV_SHARERS > 1
/* Monomials that a team adds up at a time: local memory for all would be too much. */
#define OV_AT_A_TIME (OV_GRAM / 2 + 1)

/* Sum over a team, in blocks: shorter chains, so fewer roundings. */
static inline float ov_sum_team(__local const float *parts) {
#if OV_SHARERS >= 16
    float4 four = 0.0f;
    for (uint s = 0; s < OV_SHARERS; s += 16)
        four += (vload4(0, parts + s) + vload4(1, parts + s)) +
                (vload4(2, parts + s) + vload4(3, parts + s));
    return (four.x + four.y) + (four.z + four.w);
#else
    float sum = 0.0f;
    for (uint s = 0; s < OV_SHARERS; ++s)
        sum += parts[s];
    return sum;
#endif
}
#endif

/* Adds the packs item[begin] .. item[end - 1], at most OV_TILE_PACKS, to the sums. */
#if OV_SHARERS > 1
static inline void ov_add_tile_gram(ov_vec *sum, const ov_term t, __global const ov_term *own,
                                    __global const float *points, __global const float4 *origins,
                                    __global const float *weight, __global const uint *item,
                                    const uint begin, const uint end, const uint sharer) {
    const uint k = begin + sharer / OV_LANES, lane = sharer % OV_LANES;
    if (k >= end)
        return;
    const size_t pack = item[k];
    float centre[4];
    vstore4(ov_centre(own, origins[pack]), 0, centre);
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v) {
        const uint at = v * OV_LANES + lane;
        const ov_offset o = ov_offset_of(points, pack, at, centre);
        const ov_vec e = ov_value(t, o.x, o.y, o.z);
        const ov_vec we = OV_LOAD(at, weight + pack * OV_PACK) * e * e;
        ov_add_quadratic(sum, we, o);
        ov_add_cubic(sum + OV_CUBIC, we, o);
        ov_add_quartic(sum + OV_QUARTIC, we, o);
    }
}
#else
static inline void ov_add_tile_gram(ov_vec *sum, const ov_term t, __global const ov_term *own,
                                    __global const float *points, __global const float4 *origins,
                                    __global const float *weight, __global const uint *item,
                                    const uint begin, const uint end, const uint sharer) {
    const uint packs = end - begin;
    ov_vec tile[OV_TILE];
    float centre[4 * OV_TILE_PACKS];
    for (uint k = 0; k < packs; ++k)
        vstore4(ov_centre(own, origins[item[begin + k]]), k, centre);
    for (uint k = 0; k < packs; ++k) {
        const size_t pack = item[begin + k];
#pragma unroll
        for (uint v = 0; v < OV_VECTORS; ++v) {
            const ov_offset o = ov_offset_of(points, pack, v, centre + 4 * k);
            const ov_vec e = ov_value(t, o.x, o.y, o.z);
            tile[k * OV_VECTORS + v] = OV_LOAD(v, weight + pack * OV_PACK) * e * e;
        }
    }
    OV_PASS(ov_add_quadratic, 0, OV_CUBIC)
    OV_PASS(ov_add_cubic, OV_CUBIC, OV_QUARTIC - OV_CUBIC)
    OV_PASS(ov_add_quartic, OV_QUARTIC, OV_GRAM - OV_QUARTIC)
}
#endif

OV_TEAM_KERNEL void gram(const uint count, __global const float *restrict points,
                         __global const float4 *restrict origins,
                         __global const float *restrict weight, __global const uint *restrict start,
                         __global const uint *restrict item, __global const ov_term *restrict terms,
                         __global float *restrict result) {
    const uint index = get_global_id(0) / OV_SHARERS, sharer = get_global_id(0) % OV_SHARERS;
#if OV_SHARERS == 1
    if (index >= count)
        return;
#endif
    /* otherwise a group is exactly one term, and all of it takes part in the barrier */
    const ov_term t = terms[index];
    ov_vec total[OV_GRAM], rest[OV_GRAM];
#pragma unroll
    for (uint m = 0; m < OV_GRAM; ++m)
        total[m] = rest[m] = 0.0f;

    const uint end = start[index + 1], flush = OV_FLUSH_TILES * OV_TILE_PACKS;
    for (uint first = start[index]; first < end; first += flush) {
        const uint stop = first + min(flush, end - first);
        ov_vec sum[OV_GRAM];
#pragma unroll
        for (uint m = 0; m < OV_GRAM; ++m)
            sum[m] = 0.0f;
        for (uint begin = first; begin < stop; begin += OV_TILE_PACKS) {
            ov_add_tile_gram(sum, t, terms + index, points, origins, weight, item, begin,
                             begin + min((uint)OV_TILE_PACKS, stop - begin), sharer);
        }
#pragma unroll
        for (uint m = 0; m < OV_GRAM; ++m)
            ov_add(&total[m], &rest[m], sum[m]);
    }

    __global float *const out = result + (size_t)index * OV_GRAM;
#if OV_SHARERS == 1
#pragma unroll
    for (uint m = 0; m < OV_GRAM; ++m)
        out[m] = ov_sum(total[m] + rest[m]);
#else
    /* One work-item adds up the team's sums of one monomial, in order. */
    __local float scratch[OV_AT_A_TIME * (OV_SHARERS + 1)];
#pragma unroll
    for (uint first = 0; first < OV_GRAM; first += OV_AT_A_TIME) {
        const uint last = min((uint)OV_GRAM, first + OV_AT_A_TIME);
        barrier(CLK_LOCAL_MEM_FENCE);
#pragma unroll
        for (uint m = 0; m < OV_GRAM; ++m)
            if (m >= first && m < last)
                scratch[(m - first) * (OV_SHARERS + 1) + sharer] = ov_sum(total[m] + rest[m]);
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint m = first + sharer; m < last; m += OV_SHARERS)
            out[m] = ov_sum_team(scratch + (m - first) * (OV_SHARERS + 1));
    }
#endif
}

/* Other files have their own. */
#undef OV_TILE_PACKS
#undef OV_FLUSH_TILES
#undef OV_TILE
