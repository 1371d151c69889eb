/*
 * The weighted misfit of a model at the points, two-sided or one-sided.
 *
 * Each point allows values within [low, high] and charges what is outside: r = value - clamp(value,
 * low, high). A point of the surface has low = high = phi; a guard leaves one side open. Per point
 *   u[k]      = weight r           (so that J^T u is half the gradient of sum weight r^2)
 *   active[k] = weight where the point is charged or two-sided, else 0: the weight of J^T J
 * and per pack sums[pack] = sum_k weight r^2. Points that fill up a pack have weight 0.
 * One work-item per pack, whatever the shape: the kernel is bound by memory.
 */
__kernel void misfit(const uint packs, __global const float *restrict value,
                     __global const float *restrict low, __global const float *restrict high,
                     __global const float *restrict weight, __global float *restrict u,
                     __global float *restrict active, __global float *restrict sums) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const size_t first = (size_t)pack * OV_PACK;
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
    sums[pack] = (sum.x + sum.y) + (sum.z + sum.w);
}
