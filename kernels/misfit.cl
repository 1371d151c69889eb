/*
 * The weighted misfit of a model at the points, two-sided or one-sided.
 *
 * Each point allows values within [low, high] and charges what is outside: r = value - clamp(value,
 * low, high). A point of the surface has low = high = phi; a guard leaves one side open. Per point
 *   u[k]      = weight r           (so that J^T u is half the gradient of sum weight r^2)
 *   active[k] = weight where the point is charged or two-sided, else 0: the weight of J^T J
 * and sums[group] = sum_k weight r^2 over OV_MISFIT_PACKS packs. Points that fill up a pack have
 * weight 0. A work-group for each sum, of one work-item on CPUs: its work-items take the packs in
 * turn, whatever the shape, since the kernel is bound by memory.
 */

/* Of one pack; returns its sum. */
static inline float misfit_of_pack(size_t first, __global const float *restrict value,
                                   __global const float *restrict low,
                                   __global const float *restrict high,
                                   __global const float *restrict weight,
                                   __global float *restrict u, __global float *restrict active) {
    float4 sum = 0.0f;
    for (uint k = 0; k < OV_PACK / 4; ++k) {
        const float4 v = vload4(k, value + first), l = vload4(k, low + first),
                     h = vload4(k, high + first), w = vload4(k, weight + first);
        const float4 r = v - clamp(v, l, h);
        const float4 wr = w * r;
        vstore4(wr, k, u + first);
        vstore4(select(w, (float4)(0.0f), (r == 0.0f) & (l < h)), k, active + first);
        sum = fma(wr, r, sum);
    }
    return (sum.x + sum.y) + (sum.z + sum.w);
}

__kernel void misfit(const uint packs, __global const float *restrict value,
                     __global const float *restrict low, __global const float *restrict high,
                     __global const float *restrict weight, __global float *restrict u,
                     __global float *restrict active, __global float *restrict sums) {
    __local float scratch[OV_MISFIT_PACKS];
    const uint group = get_group_id(0), at = get_local_id(0), size = get_local_size(0);
    const uint first = group * OV_MISFIT_PACKS, end = min(first + OV_MISFIT_PACKS, packs);
    for (uint pack = first + at; pack < end; pack += size)
        scratch[pack - first] =
            misfit_of_pack((size_t)pack * OV_PACK, value, low, high, weight, u, active);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (at > 0 || first >= packs)
        return;
    float sum = 0.0f, lost = 0.0f; /* what rounding takes from it */
    for (uint k = 0; k < end - first; ++k) {
        const float next = scratch[k] - lost, total = sum + next;
        lost = (total - sum) - next;
        sum = total;
    }
    sums[group] = sum;
}
