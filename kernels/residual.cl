/*
 * Residual of a model at the points, with what the objective and the gate need per pack.
 *
 * origins: as for field(); w is the number of points in each pack, which others fill up.
 * u[k] = value[k] - target[k], 0 for the points that fill up a pack. A target
 * above `limit` is one of the inside, where the model is only to stay above it: there u[k] =
 * min(value[k] - limit, 0).
 * sums: per pack sum_k u_k^2 and max_k |u_k|.
 * One work-item per pack, whatever the shape: the kernel is bound by memory.
 */
__kernel void residual(const uint packs, __global const float4 *restrict origins, const float limit,
                       __global const float *restrict value, __global const float *restrict target,
                       __global float *restrict u, __global float *restrict sums) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const size_t first = (size_t)pack * OV_PACK;
    const uint used = (uint)origins[pack].w;
    if (used < OV_PACK) {
        float sum = 0.0f, largest = 0.0f;
        for (uint k = 0; k < OV_PACK; ++k) {
            const float t = target[first + k];
            const float held = value[first + k] - min(t, limit);
            const float r = k >= used ? 0.0f : t > limit ? min(held, 0.0f) : held;
            u[first + k] = r;
            sum = fma(r, r, sum);
            largest = max(largest, fabs(r));
        }
        sums[2 * pack] = sum;
        sums[2 * pack + 1] = largest;
        return;
    }
    float4 sum = 0.0f, largest = 0.0f;
    for (uint k = 0; k < OV_PACK / 4; ++k) {
        const float4 t = vload4(k, target + first);
        const float4 held = vload4(k, value + first) - min(t, limit);
        const float4 r = select(held, min(held, 0.0f), t > limit);
        vstore4(r, k, u + first);
        sum = fma(r, r, sum);
        largest = max(largest, fabs(r));
    }
    sums[2 * pack] = (sum.x + sum.y) + (sum.z + sum.w);
    sums[2 * pack + 1] = max(max(largest.x, largest.y), max(largest.z, largest.w));
}
