/*
 * Sums over the terms that reach a pack, at each of its points (design: operation "field").
 *
 * points: OV_PACK x, then OV_PACK y, then OV_PACK z for each pack, angstrom from the pack's origin.
 * field() alone also takes packs that are all alike: points then has one pack, for all of them.
 * origins: of each pack, x, y, z, relative to what terms are relative to; w is not used here.
 * start, item: the terms of pack p are item[start[p]] .. item[start[p + 1] - 1].
 * One pack per OV_LANES work-items; every lane runs over the whole list for its own points.
 */

typedef struct ov_lane_points {
    ov_vec x[OV_VECTORS], y[OV_VECTORS], z[OV_VECTORS];
} ov_lane_points;

static inline void ov_load_points(ov_lane_points *lane_points, __global const float *points,
                                  uint pack, uint lane) {
    __global const float *const x = points + (size_t)pack * (3 * OV_PACK);
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v) {
        lane_points->x[v] = OV_LOAD(v * OV_LANES + lane, x);
        lane_points->y[v] = OV_LOAD(v * OV_LANES + lane, x + OV_PACK);
        lane_points->z[v] = OV_LOAD(v * OV_LANES + lane, x + 2 * OV_PACK);
    }
}

/* value[k] = sum_i e_i(y_k) */
__kernel void field(const uint packs, const uint alike, __global const float *restrict points,
                    __global const float4 *restrict origins, __global const uint *restrict start,
                    __global const uint *restrict item, __global const ov_term *restrict terms,
                    __global float *restrict value) {
    const uint pack = get_global_id(0) / OV_LANES, lane = get_global_id(0) % OV_LANES;
    if (pack >= packs)
        return;
    ov_lane_points p;
    ov_load_points(&p, points, alike ? 0 : pack, lane);
    const float4 origin = origins[pack];
    ov_vec sum[OV_VECTORS];
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v)
        sum[v] = 0.0f;

    const uint end = start[pack + 1];
    for (uint first = start[pack]; first < end; first += OV_CENTRES) {
        const uint some = min((uint)OV_CENTRES, end - first);
        float centre[4 * OV_CENTRES];
        for (uint k = 0; k < some; ++k)
            vstore4(ov_centre(terms + item[first + k], origin), k, centre);
        for (uint k = 0; k < some; ++k) {
            const ov_term t = terms[item[first + k]];
#pragma unroll
            for (uint v = 0; v < OV_VECTORS; ++v)
                sum[v] += ov_value(t, p.x[v] - centre[4 * k], p.y[v] - centre[4 * k + 1],
                                   p.z[v] - centre[4 * k + 2]);
        }
    }
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v)
        OV_STORE(sum[v], v * OV_LANES + lane, value + (size_t)pack * OV_PACK);
}

/* value[k] = weight[k] sum_i e_i(y_k) p_i(y_k - mu_i); weight: OV_PACK per pack, or null for 1;
 * polynomial: OV_MONOMIALS coefficients per term, in the order of shared.h. With p_i the
 * derivatives along a direction v of the parameters this is J v, and W J v with weights. idle:
 * null, or a word that is not 0 where there is nothing to be done. */
__kernel void
field_polynomial(const uint packs, __global const uint *restrict idle,
                 __global const float *restrict points, __global const float4 *restrict origins,
                 __global const uint *restrict start, __global const uint *restrict item,
                 __global const ov_term *restrict terms, __global const float *restrict polynomial,
                 __global const float *restrict weight, __global float *restrict value) {
    const uint pack = get_global_id(0) / OV_LANES, lane = get_global_id(0) % OV_LANES;
    if (pack >= packs || (idle && *idle != 0))
        return;
    ov_lane_points p;
    ov_load_points(&p, points, pack, lane);
    const float4 origin = origins[pack];
    ov_vec sum[OV_VECTORS];
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v)
        sum[v] = 0.0f;

    const uint end = start[pack + 1];
    for (uint first = start[pack]; first < end; first += OV_CENTRES) {
        const uint some = min((uint)OV_CENTRES, end - first);
        float centre[4 * OV_CENTRES];
        for (uint k = 0; k < some; ++k)
            vstore4(ov_centre(terms + item[first + k], origin), k, centre);
        for (uint k = 0; k < some; ++k) {
            const ov_term t = terms[item[first + k]];
            __global const float *const c = polynomial + (size_t)item[first + k] * OV_MONOMIALS;
            const float c0 = c[0], c1 = c[1], c2 = c[2], c3 = c[3], c4 = c[4], c5 = c[5], c6 = c[6],
                        c7 = c[7], c8 = c[8], c9 = c[9];
#pragma unroll
            for (uint v = 0; v < OV_VECTORS; ++v) {
                const ov_vec x = p.x[v] - centre[4 * k], y = p.y[v] - centre[4 * k + 1],
                             z = p.z[v] - centre[4 * k + 2];
                const ov_vec in_x =
                    fma(z, (ov_vec)(c6), fma(y, (ov_vec)(c5), fma(x, (ov_vec)(c4), (ov_vec)(c1))));
                const ov_vec in_y = fma(z, (ov_vec)(c8), fma(y, (ov_vec)(c7), (ov_vec)(c2)));
                const ov_vec in_z = fma(z, (ov_vec)(c9), (ov_vec)(c3));
                const ov_vec factor = fma(x, in_x, fma(y, in_y, fma(z, in_z, (ov_vec)(c0))));
                sum[v] = fma(ov_value(t, x, y, z), factor, sum[v]);
            }
        }
    }
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v) {
        const uint at = v * OV_LANES + lane;
        if (weight)
            sum[v] *= OV_LOAD(at, weight + (size_t)pack * OV_PACK);
        OV_STORE(sum[v], at, value + (size_t)pack * OV_PACK);
    }
}

/* value[k] = sum_i e_i(y_k), and its gradient in angstrom^-1: OV_PACK x, y, z components per pack,
 * as the points are stored. */
__kernel void field_gradient(const uint packs, __global const float *restrict points,
                             __global const float4 *restrict origins,
                             __global const uint *restrict start,
                             __global const uint *restrict item,
                             __global const ov_term *restrict terms, __global float *restrict value,
                             __global float *restrict gradient) {
    const uint pack = get_global_id(0) / OV_LANES, lane = get_global_id(0) % OV_LANES;
    if (pack >= packs)
        return;
    ov_lane_points p;
    ov_load_points(&p, points, pack, lane);
    const float4 origin = origins[pack];
    __global float *const out = gradient + (size_t)pack * (3 * OV_PACK);
#pragma unroll
    for (uint v = 0; v < OV_VECTORS; ++v) {
        ov_vec sum = 0.0f, gx = 0.0f, gy = 0.0f, gz = 0.0f;
        const uint end = start[pack + 1];
        for (uint k = start[pack]; k < end; ++k) {
            const ov_term t = terms[item[k]];
            const float4 centre = ov_centre(terms + item[k], origin);
            const ov_vec x = p.x[v] - centre.x, y = p.y[v] - centre.y, z = p.z[v] - centre.z;
            const ov_vec e = ov_value(t, x, y, z);
            sum += e;
            /* de/dx = -ln 2 e dq/dx, the factor left for the end */
            gx = fma(e, fma(x, (ov_vec)(2.0f * t.xx), fma(y, (ov_vec)(t.xy), z * t.xz)), gx);
            gy = fma(e, fma(y, (ov_vec)(2.0f * t.yy), fma(x, (ov_vec)(t.xy), z * t.yz)), gy);
            gz = fma(e, fma(z, (ov_vec)(2.0f * t.zz), fma(x, (ov_vec)(t.xz), y * t.yz)), gz);
        }
        OV_STORE(sum, v * OV_LANES + lane, value + (size_t)pack * OV_PACK);
        OV_STORE(gx * -M_LN2_F, v * OV_LANES + lane, out);
        OV_STORE(gy * -M_LN2_F, v * OV_LANES + lane, out + OV_PACK);
        OV_STORE(gz * -M_LN2_F, v * OV_LANES + lane, out + 2 * OV_PACK);
    }
}
