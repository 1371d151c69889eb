/*
 * How much the misfit grows (kernels/misfit.cl) if two terms i, j are replaced by one, m:
 *   loss = sum_k weight_k [r(v_k - e_i - e_j + e_m)^2 - r(v_k)^2],  r(v) = v - clamp(v, low, high)
 * over the points of the packs that i or j reaches.
 *
 * pairs: i, j for each pair; merged: its m; value: phi~ of all terms together.
 * points, origins: as for field().
 * start, item: the packs of term i are item[start[i]] .. item[start[i + 1] - 1], ascending, so that
 * one walk along both lists meets each pack once.
 * On CPUs one work-item per pair, elsewhere OV_LANES of them; a work-group of OV_TEAM has several
 * pairs then, so that it fills a warp.
 */

#if OV_LANES == 1
#define MERGE_KERNEL __kernel
#else
#define MERGE_KERNEL __kernel __attribute__((reqd_work_group_size(OV_TEAM, 1, 1)))
#endif

static inline ov_vec squared_residual(ov_vec v, ov_vec low, ov_vec high) {
    const ov_vec r = v - clamp(v, low, high);
    return r * r;
}

static inline ov_vec value_at(const ov_term t, const float4 centre, ov_vec x, ov_vec y, ov_vec z) {
    return ov_value(t, x - centre.x, y - centre.y, z - centre.z);
}

static inline float sum_of(ov_vec value) {
#if OV_VECTOR == 1
    return value;
#else
    float parts[OV_VECTOR], sum = 0.0f;
    OV_STORE(value, 0, parts);
    for (uint k = 0; k < OV_VECTOR; ++k)
        sum += parts[k];
    return sum;
#endif
}

MERGE_KERNEL void
merge_loss(const uint count, __global const uint *restrict pairs,
           __global const ov_term *restrict merged, __global const float *restrict points,
           __global const float4 *restrict origins, __global const float *restrict value,
           __global const float *restrict low, __global const float *restrict high,
           __global const float *restrict weight, __global const uint *restrict start,
           __global const uint *restrict item, __global const ov_term *restrict terms,
           __global float *restrict loss) {
    const uint own_pair = get_global_id(0) / OV_LANES, lane = get_global_id(0) % OV_LANES;
#if OV_LANES == 1
    if (own_pair >= count)
        return;
#endif
    /* Work-items beyond the last pair repeat it, since the whole group meets at the barrier. */
    const uint pair = min(own_pair, count - 1);
    const uint i = pairs[2 * pair], j = pairs[2 * pair + 1];
    const ov_term ti = terms[i], tj = terms[j], tm = merged[pair];
    uint at_i = start[i], at_j = start[j];
    const uint end_i = start[i + 1], end_j = start[j + 1];
    ov_vec sum = 0.0f;
    while (at_i < end_i || at_j < end_j) {
        const uint next_i = at_i < end_i ? item[at_i] : UINT_MAX;
        const uint next_j = at_j < end_j ? item[at_j] : UINT_MAX;
        const size_t pack = min(next_i, next_j);
        at_i += next_i == pack;
        at_j += next_j == pack;
        __global const float *const p = points + pack * (3 * OV_PACK);
        const size_t first = pack * OV_PACK;
        const float4 origin = origins[pack];
        const float4 ci = ov_centre(terms + i, origin), cj = ov_centre(terms + j, origin),
                     cm = ov_centre(merged + pair, origin);
#pragma unroll
        for (uint n = 0; n < OV_VECTORS; ++n) {
            const uint at = n * OV_LANES + lane;
            const ov_vec x = OV_LOAD(at, p), y = OV_LOAD(at, p + OV_PACK),
                         z = OV_LOAD(at, p + 2 * OV_PACK), v = OV_LOAD(at, value + first),
                         l = OV_LOAD(at, low + first), h = OV_LOAD(at, high + first);
            const ov_vec without = v - value_at(ti, ci, x, y, z) - value_at(tj, cj, x, y, z);
            const ov_vec after = squared_residual(without + value_at(tm, cm, x, y, z), l, h);
            sum = fma(OV_LOAD(at, weight + first), after - squared_residual(v, l, h), sum);
        }
    }
    const float own = sum_of(sum);
#if OV_LANES == 1
    loss[pair] = own;
#else
    __local float scratch[OV_TEAM];
    const uint at = get_local_id(0);
    scratch[at] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0 && own_pair < count) {
        float total = 0.0f;
        for (uint k = 0; k < OV_LANES; ++k)
            total += scratch[at + k];
        loss[pair] = total;
    }
#endif
}
