/*
 * Images of terms under rigid motions, as those of a symmetric assembly's unit: they have no
 * parameters of their own, and follow the terms that they are images of. Of `count` terms, image g
 * of term i is term (g + 1) count + i. A motion turns z = y - centre: z' = R z.
 *
 * A change of a term's parameters is a polynomial p(z); of its image it is p(R^T z'). What the
 * image feels is felt by the term: its moments are those of z = R^T z'. The two are transposes of
 * each other. rotation: the nine of R, row by row, of each motion. idle: as in moments.cl.
 */

/* out = R S R^T, or R^T S R with `back`; both are xx, xy, xz, yy, yz, zz. */
static inline void turn_symmetric(const float *r, int back, const float *s, float *out) {
    const float whole[3][3] = {{s[0], s[1], s[2]}, {s[1], s[3], s[4]}, {s[2], s[4], s[5]}};
    float left[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            left[i][j] = 0.0f;
            for (int k = 0; k < 3; ++k)
                left[i][j] = fma(back ? r[3 * k + i] : r[3 * i + k], whole[k][j], left[i][j]);
        }
    for (int i = 0, n = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j, ++n) {
            out[n] = 0.0f;
            for (int k = 0; k < 3; ++k)
                out[n] = fma(left[i][k], back ? r[3 * k + j] : r[3 * j + k], out[n]);
        }
}

/* out = R v, or R^T v with `back`. */
static inline void turn_vector(const float *r, int back, const float *v, float *out) {
    for (int i = 0; i < 3; ++i)
        out[i] = back ? fma(r[i], v[0], fma(r[3 + i], v[1], r[6 + i] * v[2]))
                      : fma(r[3 * i], v[0], fma(r[3 * i + 1], v[1], r[3 * i + 2] * v[2]));
}

static inline void load_rotation(__global const float *restrict rotation, uint g, float *r) {
    for (uint k = 0; k < 9; ++k)
        r[k] = rotation[9 * (size_t)g + k];
}

/* The images' polynomials from the terms'. One work-item per image of a term. */
__kernel void turn_polynomials(const uint count, const uint images,
                               __global const uint *restrict idle,
                               __global const float *restrict rotation,
                               __global float *polynomial) {
    const uint index = get_global_id(0);
    if (index >= count * images || (idle && idle[0]))
        return;
    __global const float *const from = polynomial + (size_t)(index % count) * OV_MONOMIALS;
    __global float *const to = polynomial + ((size_t)count + index) * OV_MONOMIALS;
    float r[9], c[OV_MONOMIALS], turned[OV_MONOMIALS];
    load_rotation(rotation, index / count, r);
    for (uint k = 0; k < OV_MONOMIALS; ++k)
        c[k] = from[k];
    c[5] *= 0.5f; /* x y stands twice in z^T S z */
    c[6] *= 0.5f;
    c[8] *= 0.5f;
    turned[0] = c[0];
    turn_vector(r, 0, c + 1, turned + 1);
    turn_symmetric(r, 0, c + 4, turned + 4);
    turned[5] *= 2.0f;
    turned[6] *= 2.0f;
    turned[8] *= 2.0f;
    for (uint k = 0; k < OV_MONOMIALS; ++k)
        to[k] = turned[k];
}

/* Adds to the moments of terms those of their images. moments: (high, low) pairs. One work-item per
 * term. */
__kernel void fold_moments(const uint count, const uint images, __global const uint *restrict idle,
                           __global const float *restrict rotation, __global float *moments) {
    const uint index = get_global_id(0);
    if (index >= count || (idle && idle[0]))
        return;
    float r[9], m[OV_MONOMIALS], back[OV_MONOMIALS], sum[OV_MONOMIALS];
    for (uint k = 0; k < OV_MONOMIALS; ++k)
        sum[k] = 0.0f;
    for (uint g = 0; g < images; ++g) {
        const size_t from = ((size_t)(g + 1) * count + index) * OV_MONOMIALS;
        for (uint k = 0; k < OV_MONOMIALS; ++k) {
            const float2 pair = vload2(from + k, moments);
            m[k] = pair.x + pair.y;
        }
        load_rotation(rotation, g, r);
        back[0] = m[0];
        turn_vector(r, 1, m + 1, back + 1);
        turn_symmetric(r, 1, m + 4, back + 4);
        for (uint k = 0; k < OV_MONOMIALS; ++k)
            sum[k] += back[k];
    }
    for (uint k = 0; k < OV_MONOMIALS; ++k) {
        const size_t at = (size_t)index * OV_MONOMIALS + k;
        const float2 own = vload2(at, moments);
        vstore2((float2)(own.x + sum[k], own.y), at, moments);
    }
}
