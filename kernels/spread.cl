/*
 * From packs to the caller's order.
 *
 * to: the caller's point of each place of the packs, counted from `first`; OV_NOBODY for places
 * that repeat another point. value, gradient: as field_gradient() leaves them; gradient is not
 * looked at unless slopes is there. values: one float per point; slopes: x, y, z of each point, or
 * null. One work-item per place.
 */
#define OV_NOBODY 0xffffffffu

__kernel void spread(const uint places, const ulong first, __global const uint *restrict to,
                     __global const float *restrict value, __global const float *restrict gradient,
                     __global float *restrict values, __global float *restrict slopes) {
    const uint place = get_global_id(0);
    if (place >= places || to[place] == OV_NOBODY)
        return;
    const size_t point = (size_t)first + to[place];
    values[point] = value[place];
    if (slopes) {
        __global const float *const g = gradient + (size_t)(place / OV_PACK) * (3 * OV_PACK);
        const uint k = place % OV_PACK;
        slopes[3 * point] = g[k];
        slopes[3 * point + 1] = g[OV_PACK + k];
        slopes[3 * point + 2] = g[2 * OV_PACK + k];
    }
}
