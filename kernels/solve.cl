/*
 * Conjugate gradients on the damped normal equations (J^T W J + lambda D) x = -J^T W r, D their
 * diagonal, with a block-Jacobi preconditioner of one 10 x 10 block per ellipsoid. J^T W J is never
 * stored: its product with a direction p is field_polynomial (J p), then moments (J^T W J p).
 *
 * The ten parameters of an ellipsoid are ln a, the centre, and L = (l11, l21, l31, l22, l32, l33)
 * with A = L L^T. With z = y - centre every derivative of e is e times a polynomial of degree 2 in
 * z: "to_polynomial" maps a direction of the parameters to its ten coefficients, "to_parameters" is
 * the transpose, from moments to parameters. (model/factor.h has them in double.)
 *
 * One work-item per ellipsoid in groups of OV_SOLVE_GROUP, which the build sets. Dot products: each
 * group leaves one partial sum, the next kernel's groups add them up, all in one order. Where
 * ellipsoids are few, one group does all of an iteration but the product with J^T W J.
 *
 * The device itself stops the iteration: state has a word that is not 0 once there is nothing more
 * to be done, which leaves the kernels of all iterations that follow nothing to do, and counts the
 * iterations. They meet their barriers all the same: PoCL spoils memory where a small group returns
 * before one. What the residual has to fall to is `limit`, `share` of its start.
 */

#define PARAMETERS 10
#define BLOCK OV_SOLVE_BLOCK
#define FACTOR OV_SOLVE_FACTOR
#define SOLVE_KERNEL __kernel __attribute__((reqd_work_group_size(OV_SOLVE_GROUP, 1, 1)))

static inline void to_polynomial(const float *l, const float *v, float *c) {
    const float s1 = fma(l[0], v[1], fma(l[1], v[2], l[2] * v[3]));
    const float s2 = fma(l[3], v[2], l[4] * v[3]);
    const float s3 = l[5] * v[3];
    c[0] = v[0];
    c[1] = 2.0f * l[0] * s1;
    c[2] = 2.0f * fma(l[1], s1, l[3] * s2);
    c[3] = 2.0f * fma(l[2], s1, fma(l[4], s2, l[5] * s3));
    c[4] = -2.0f * v[4] * l[0];
    c[5] = -2.0f * fma(v[4], l[1], v[5] * l[0]);
    c[6] = -2.0f * fma(v[4], l[2], v[6] * l[0]);
    c[7] = -2.0f * fma(v[5], l[1], v[7] * l[3]);
    c[8] = -2.0f * fma(v[5], l[2], fma(v[6], l[1], fma(v[7], l[4], v[8] * l[3])));
    c[9] = -2.0f * fma(v[6], l[2], fma(v[8], l[4], v[9] * l[5]));
}

static inline void to_parameters(const float *l, const float *m, float *g) {
    const float s1 = fma(l[0], m[1], fma(l[1], m[2], l[2] * m[3]));
    const float s2 = fma(l[3], m[2], l[4] * m[3]);
    const float s3 = l[5] * m[3];
    g[0] = m[0];
    g[1] = 2.0f * l[0] * s1;
    g[2] = 2.0f * fma(l[1], s1, l[3] * s2);
    g[3] = 2.0f * fma(l[2], s1, fma(l[4], s2, l[5] * s3));
    g[4] = -2.0f * fma(l[0], m[4], fma(l[1], m[5], l[2] * m[6]));
    g[5] = -2.0f * fma(l[0], m[5], fma(l[1], m[7], l[2] * m[8]));
    g[6] = -2.0f * fma(l[0], m[6], fma(l[1], m[8], l[2] * m[9]));
    g[7] = -2.0f * fma(l[3], m[7], l[4] * m[8]);
    g[8] = -2.0f * fma(l[3], m[8], l[4] * m[9]);
    g[9] = -2.0f * l[5] * m[9];
}

/* Where the product of two of the ten monomials stands among the 35 of gram. */
__constant uchar product_of[OV_MONOMIALS][OV_MONOMIALS] = {
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9},          {1, 4, 5, 6, 10, 11, 12, 13, 14, 15},
    {2, 5, 7, 8, 11, 13, 14, 16, 17, 18},    {3, 6, 8, 9, 12, 14, 15, 17, 18, 19},
    {4, 10, 11, 12, 20, 21, 22, 23, 24, 25}, {5, 11, 13, 14, 21, 23, 24, 26, 27, 28},
    {6, 12, 14, 15, 22, 24, 25, 27, 28, 29}, {7, 13, 16, 17, 23, 26, 27, 30, 31, 32},
    {8, 14, 17, 18, 24, 27, 28, 31, 32, 33}, {9, 15, 18, 19, 25, 28, 29, 32, 33, 34},
};

static inline void load_ten(__global const float *from, uint index, float *to) {
#pragma unroll
    for (uint j = 0; j < PARAMETERS; ++j)
        to[j] = from[(size_t)index * PARAMETERS + j];
}

static inline void store_ten(const float *from, uint index, __global float *to) {
#pragma unroll
    for (uint j = 0; j < PARAMETERS; ++j)
        to[(size_t)index * PARAMETERS + j] = from[j];
}

static inline void load_factor(__global const float *factor, uint index, float *l) {
#pragma unroll
    for (uint j = 0; j < FACTOR; ++j)
        l[j] = factor[(size_t)index * FACTOR + j];
}

/* Moments arrive as (high, low) pairs. */
static inline void load_moments(__global const float *moments, uint index, float *m) {
#pragma unroll
    for (uint j = 0; j < OV_MONOMIALS; ++j) {
        const float2 pair = vload2((size_t)index * OV_MONOMIALS + j, moments);
        m[j] = pair.x + pair.y;
    }
}

static inline float dot_ten(const float *a, const float *b) {
    float sum = 0.0f;
#pragma unroll
    for (uint j = 0; j < PARAMETERS; ++j)
        sum = fma(a[j], b[j], sum);
    return sum;
}

/* x := (R R^T)^-1 x, R the block's Cholesky factor with its diagonal inverted. */
static inline void solve_block(__global const float *block, float *x) {
    for (uint i = 0; i < PARAMETERS; ++i) {
        __global const float *const row = block + i * (i + 1) / 2;
        float sum = x[i];
        for (uint j = 0; j < i; ++j)
            sum = fma(-row[j], x[j], sum);
        x[i] = sum * row[i];
    }
    for (uint i = PARAMETERS; i-- > 0;) {
        float sum = x[i];
        for (uint j = i + 1; j < PARAMETERS; ++j)
            sum = fma(-block[j * (j + 1) / 2 + i], x[j], sum);
        x[i] = sum * block[i * (i + 1) / 2 + i];
    }
}

/* Cholesky factorisation in place; the diagonal holds inverses. A pivot lost to rounding is put
 * back to a small share of its diagonal. */
static inline void factor_block(float *a) {
    for (uint i = 0; i < PARAMETERS; ++i) {
        float *const row = a + i * (i + 1) / 2;
        const float own = row[i];
        for (uint j = 0; j < i; ++j) {
            const float *const other = a + j * (j + 1) / 2;
            float sum = row[j];
            for (uint k = 0; k < j; ++k)
                sum = fma(-row[k], other[k], sum);
            row[j] = sum * other[j];
        }
        float pivot = own;
        for (uint k = 0; k < i; ++k)
            pivot = fma(-row[k], row[k], pivot);
        row[i] = rsqrt(max(pivot, 1e-6f * own));
    }
}

/* Leaves the group's sum in partial[group]; every work-item of the group takes part. */
static inline void leave_sum(float own, __local float *scratch, __global float *partial) {
    const uint at = get_local_id(0);
    scratch[at] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (at == 0) {
        float sum = 0.0f;
        for (uint k = 0; k < OV_SOLVE_GROUP; ++k)
            sum += scratch[k];
        partial[get_group_id(0)] = sum;
    }
}

/* The sum of all groups' partial sums, the same in every work-item. */
static inline float take_sum(__global const float *partial, uint groups) {
    float sum = 0.0f;
    for (uint k = 0; k < groups; ++k)
        sum += partial[k];
    return sum;
}

/* The blocks C^T G C + lambda diag(C^T G C), factored; the diagonal D, 1 where a parameter does not
 * matter, so that it stays still even without damping; and the start of the iteration: x = 0, r =
 * -C^T moments, z = block^-1 r, p = z, state = 0. */
SOLVE_KERNEL void solve_start(const uint count, const float lambda,
                              __global const float *restrict factor,
                              __global const float *restrict gram,
                              __global const float *restrict moments,
                              __global float *restrict block, __global float *restrict diagonal,
                              __global float *restrict x, __global float *restrict r,
                              __global float *restrict p, __global float *restrict polynomial,
                              __global float *restrict rz, __global uint *restrict state) {
    __local float scratch[OV_SOLVE_GROUP];
    const uint index = get_global_id(0);
    float sum = 0.0f;
    if (index < 2)
        state[index] = 0;
    if (index < count) {
        float l[FACTOR], c[OV_MONOMIALS], m[OV_MONOMIALS], v[PARAMETERS], a[BLOCK], d[PARAMETERS];
        load_factor(factor, index, l);
        __global const float *const g = gram + (size_t)index * OV_GRAM;
        for (uint j = 0; j < PARAMETERS; ++j) {
            for (uint k = 0; k < PARAMETERS; ++k)
                v[k] = k == j ? 1.0f : 0.0f;
            to_polynomial(l, v, c);
            for (uint k = 0; k < OV_MONOMIALS; ++k) {
                m[k] = 0.0f;
                for (uint n = 0; n < OV_MONOMIALS; ++n)
                    m[k] = fma(g[product_of[k][n]], c[n], m[k]);
            }
            to_parameters(l, m, v);
            for (uint i = j; i < PARAMETERS; ++i)
                a[i * (i + 1) / 2 + j] = v[i];
        }
        for (uint j = 0; j < PARAMETERS; ++j) {
            float *const own = &a[j * (j + 1) / 2 + j];
            const bool matters = *own > 1e-30f;
            d[j] = matters ? *own : 1.0f;
            *own = matters ? fma(lambda, *own, *own) : 1.0f;
        }
        factor_block(a);
        for (uint k = 0; k < BLOCK; ++k)
            block[(size_t)index * BLOCK + k] = a[k];
        store_ten(d, index, diagonal);
        load_moments(moments, index, m);
        to_parameters(l, m, v);
        for (uint k = 0; k < PARAMETERS; ++k)
            v[k] = -v[k];
        store_ten(v, index, r);
        float z[PARAMETERS], zero[PARAMETERS];
        for (uint k = 0; k < PARAMETERS; ++k) {
            z[k] = v[k];
            zero[k] = 0.0f;
        }
        solve_block(block + (size_t)index * BLOCK, z);
        store_ten(zero, index, x);
        store_ten(z, index, p);
        to_polynomial(l, z, c);
        store_ten(c, index, polynomial);
        sum = dot_ten(v, z);
    }
    leave_sum(sum, scratch, rz);
}

/* ---- an iteration, ellipsoid by ellipsoid -------------------------------------------------- */

/* q = C^T moments + lambda D p; returns p . q. */
static inline float multiply_one(uint index, float lambda, __global const float *restrict factor,
                                 __global const float *restrict moments,
                                 __global const float *restrict diagonal, __global const float *p,
                                 __global float *q) {
    float l[FACTOR], m[OV_MONOMIALS], g[PARAMETERS], own[PARAMETERS], d[PARAMETERS];
    load_factor(factor, index, l);
    load_moments(moments, index, m);
    load_ten(p, index, own);
    load_ten(diagonal, index, d);
    to_parameters(l, m, g);
    for (uint k = 0; k < PARAMETERS; ++k)
        g[k] = fma(lambda * d[k], own[k], g[k]);
    store_ten(g, index, q);
    return dot_ten(own, g);
}

/* x += alpha p, r -= alpha q, z = block^-1 r; returns r . z. */
static inline float advance_one(uint index, float alpha, __global const float *restrict block,
                                __global const float *p, __global const float *q, __global float *x,
                                __global float *r, __global float *z) {
    float own[PARAMETERS], change[PARAMETERS];
    load_ten(x, index, own);
    load_ten(p, index, change);
    for (uint k = 0; k < PARAMETERS; ++k)
        own[k] = fma(alpha, change[k], own[k]);
    store_ten(own, index, x);
    load_ten(r, index, own);
    load_ten(q, index, change);
    for (uint k = 0; k < PARAMETERS; ++k)
        change[k] = own[k] = fma(-alpha, change[k], own[k]);
    store_ten(own, index, r);
    solve_block(block + (size_t)index * BLOCK, change);
    store_ten(change, index, z);
    return dot_ten(own, change);
}

/* p = z + beta p and its polynomial. */
static inline void turn_one(uint index, float beta, __global const float *restrict factor,
                            __global const float *z, __global float *p,
                            __global float *restrict polynomial) {
    float l[FACTOR], own[PARAMETERS], next[PARAMETERS], c[OV_MONOMIALS];
    load_factor(factor, index, l);
    load_ten(p, index, own);
    load_ten(z, index, next);
    for (uint k = 0; k < PARAMETERS; ++k)
        next[k] = fma(beta, own[k], next[k]);
    store_ten(next, index, p);
    to_polynomial(l, next, c);
    store_ten(c, index, polynomial);
}

/* How far to go along p. */
static inline float step_length(float before, float curvature) {
    return curvature > 0.0f && before > 0.0f ? before / curvature : 0.0f;
}

/* The state after an iteration that took the residual from `before` to `after`. One that was not to
 * be done, or that begins with no residual at all, does not count. */
static inline void next_state(__global const uint *restrict state, float before, float after,
                              float share, __global float *restrict limit,
                              __global uint *restrict state_next) {
    if (state[1] == 0)
        limit[0] = share * before;
    state_next[0] = state[0] != 0 || !(before > 0.0f) || !(after > limit[0]);
    state_next[1] = state[1] + (state[0] == 0 && before > 0.0f ? 1 : 0);
}

/* ---- many ellipsoids ------------------------------------------------------------------------ */

/* q = C^T moments + lambda D p, and the partial sums of p . q. */
SOLVE_KERNEL void
solve_product(const uint count, const float lambda, __global const uint *restrict state,
              __global const float *restrict factor, __global const float *restrict moments,
              __global const float *restrict diagonal, __global const float *restrict p,
              __global float *restrict q, __global float *restrict pq) {
    __local float scratch[OV_SOLVE_GROUP];
    const uint index = get_global_id(0);
    float sum = 0.0f;
    if (index < count && state[0] == 0)
        sum = multiply_one(index, lambda, factor, moments, diagonal, p, q);
    leave_sum(sum, scratch, pq);
}

/* alpha = rz / pq; x += alpha p, r -= alpha q, z = block^-1 r, and the partial sums of r . z. */
SOLVE_KERNEL void solve_update(const uint count, const uint groups,
                               __global const uint *restrict state,
                               __global const float *restrict block,
                               __global const float *restrict rz, __global const float *restrict pq,
                               __global const float *restrict p, __global const float *restrict q,
                               __global float *restrict x, __global float *restrict r,
                               __global float *restrict z, __global float *restrict rz_next) {
    __local float scratch[OV_SOLVE_GROUP];
    __local float alpha;
    const uint index = get_global_id(0);
    float sum = 0.0f;
    if (get_local_id(0) == 0)
        alpha = step_length(take_sum(rz, groups), take_sum(pq, groups));
    barrier(CLK_LOCAL_MEM_FENCE);
    if (index < count && state[0] == 0)
        sum = advance_one(index, alpha, block, p, q, x, r, z);
    leave_sum(sum, scratch, rz_next);
}

/* beta = rz_next / rz; p = z + beta p and its polynomials; and the state after the iteration. */
SOLVE_KERNEL void
solve_direction(const uint count, const uint groups, const float share,
                __global const uint *restrict state, __global const float *restrict factor,
                __global const float *restrict rz, __global const float *restrict rz_next,
                __global const float *restrict z, __global float *restrict p,
                __global float *restrict polynomial, __global float *restrict limit,
                __global uint *restrict state_next) {
    __local float beta;
    const uint index = get_global_id(0);
    if (get_local_id(0) == 0) {
        const float before = take_sum(rz, groups), after = take_sum(rz_next, groups);
        beta = before > 0.0f ? after / before : 0.0f;
        if (index == 0)
            next_state(state, before, after, share, limit, state_next);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (index < count && state[0] == 0)
        turn_one(index, beta, factor, z, p, polynomial);
}

/* ---- few ellipsoids -------------------------------------------------------------------------- */

/* The sum over a work-group, the same in every work-item of it, in an order that goes with its size
 * alone. */
static inline float sum_of_group(float own, __local float *scratch) {
    const uint at = get_local_id(0), size = get_local_size(0);
    scratch[at] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
#if OV_LANES == 1
    if (at == 0)
        for (uint k = 1; k < size; ++k)
            scratch[0] += scratch[k];
    barrier(CLK_LOCAL_MEM_FENCE);
#else
    for (uint left = size; left > 1;) {
        const uint half_of = (left + 1) / 2;
        if (at + half_of < left)
            scratch[at] += scratch[at + half_of];
        left = half_of;
        barrier(CLK_LOCAL_MEM_FENCE);
    }
#endif
    const float sum = scratch[0];
    barrier(CLK_LOCAL_MEM_FENCE);
    return sum;
}

/* The three above in one, by one work-group: for up to OV_SOLVE_ALONE ellipsoids, for which a
 * launch takes longer than what it does. Each work-item has its own ellipsoids from beginning to
 * end. rz: the partial sums of `groups` groups; rz_next: one sum. scratch: a float per work-item,
 * an argument since PoCL 3.1 makes one array for the whole process of an array in this kernel,
 * where two threads that solve at once spoil it. */
__kernel void solve_step(const uint count, const float lambda, const uint groups, const float share,
                         __global const uint *restrict state, __global const float *restrict factor,
                         __global const float *restrict moments,
                         __global const float *restrict diagonal,
                         __global const float *restrict block, __global const float *restrict rz,
                         __global float *restrict p, __global float *restrict q,
                         __global float *restrict x, __global float *restrict r,
                         __global float *restrict z, __global float *restrict polynomial,
                         __global float *restrict rz_next, __global float *restrict limit,
                         __global uint *restrict state_next, __local float *restrict scratch) {
    const uint at = get_local_id(0), size = get_local_size(0);
    const float before = take_sum(rz, groups);
    float sum = 0.0f;
    if (get_group_id(0) > 0)
        return;
    const uint end = state[0] == 0 ? count : 0;
    for (uint index = at; index < end; index += size)
        sum += multiply_one(index, lambda, factor, moments, diagonal, p, q);
    const float curvature = sum_of_group(sum, scratch);
    const float alpha = step_length(before, curvature);
    sum = 0.0f;
    for (uint index = at; index < end; index += size)
        sum += advance_one(index, alpha, block, p, q, x, r, z);
    const float after = sum_of_group(sum, scratch);
    const float beta = before > 0.0f ? after / before : 0.0f;
    for (uint index = at; index < end; index += size)
        turn_one(index, beta, factor, z, p, polynomial);
    if (at == 0) {
        rz_next[0] = after;
        next_state(state, before, after, share, limit, state_next);
    }
}
