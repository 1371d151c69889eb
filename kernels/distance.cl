/*
 * Distances from points to the nearest point of a mesh's triangles.
 *
 * The triangles lie along a space-filling curve in leaves of OV_LEAF, under a tree of boxes. A
 * point walks the tree nearest box first, with vectors over the 16 boxes of a group and over the
 * triangles of a leaf, and leaves out what is farther than the nearest triangle so far. The least
 * distance does not depend on the order in which it is found.
 *
 * triangles: per leaf OV_TRIANGLE arrays of OV_LEAF floats: corner p (3), edges u and v from it (3
 * each). The last leaf is filled up with its last triangle. What else a point needs of a triangle
 * is worked out each time: reading it would take longer.
 */

/* ---- making leaves ------------------------------------------------------------------------ */

/* The leaves of `triangles` triangles, three corners each, from number `first` on, each `stride`-th
 * of them, and the box about each leaf: low x, y, z, high x, y, z. xyz: of the vertices. */
__kernel void pack_leaves(const uint leaves, const uint triangles, const uint first,
                          const uint stride, __global const uint *restrict corners,
                          __global const float *restrict xyz, __global float *restrict packed,
                          __global float *restrict boxes) {
    const uint leaf = get_global_id(0);
    if (leaf >= leaves)
        return;
    float low[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, high[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
    for (uint j = 0; j < OV_LEAF; ++j) {
        __global const uint *const corner =
            corners + 3 * (first + stride * (size_t)min(leaf * OV_LEAF + j, triangles - 1));
        __global float *const to = packed + (size_t)leaf * (OV_TRIANGLE * OV_LEAF) + j;
        for (uint k = 0; k < 3; ++k) {
            const float a = xyz[3 * (size_t)corner[0] + k], b = xyz[3 * (size_t)corner[1] + k],
                        c = xyz[3 * (size_t)corner[2] + k];
            to[k * OV_LEAF] = a;
            to[(3 + k) * OV_LEAF] = b - a;
            to[(6 + k) * OV_LEAF] = c - a;
            low[k] = min(low[k], min(a, min(b, c)));
            high[k] = max(high[k], max(a, max(b, c)));
        }
    }
    for (uint k = 0; k < 3; ++k) {
        boxes[6 * (size_t)leaf + k] = low[k];
        boxes[6 * (size_t)leaf + 3 + k] = high[k];
    }
}

/* ---- distances ---------------------------------------------------------------------------- */

/* On GPUs four boxes or triangles per work-item hide the latencies. */
#if OV_VECTOR == 1
#define OV_WIDE 4
#else
#define OV_WIDE OV_VECTOR
#endif
typedef OV_JOIN(float, OV_WIDE) ov_wide;
#define OV_WIDE_LOAD OV_JOIN(vload, OV_WIDE)
#define OV_WIDE_STORE OV_JOIN(vstore, OV_WIDE)

/* The least component. */
#if OV_WIDE == 16
#define OV_FOLD(a) min(min((a).lo.lo, (a).lo.hi), min((a).hi.lo, (a).hi.hi))
#elif OV_WIDE == 8
#define OV_FOLD(a) min((a).lo, (a).hi)
#else
#define OV_FOLD(a) (a)
#endif
static inline float ov_least(ov_wide a) {
    const float4 four = OV_FOLD(a);
    const float2 two = min(four.lo, four.hi);
    return min(two.x, two.y);
}
#undef OV_FOLD

/* Squared length of w - s u - t v. */
static inline ov_wide ov_residue(const ov_wide *w, const ov_wide *u, const ov_wide *v, ov_wide s,
                                 ov_wide t) {
    const ov_wide x = fma(-t, v[0], fma(-s, u[0], w[0]));
    const ov_wide y = fma(-t, v[1], fma(-s, u[1], w[1]));
    const ov_wide z = fma(-t, v[2], fma(-s, u[2], w[2]));
    return fma(x, x, fma(y, y, z * z));
}

static inline ov_wide ov_dot(const ov_wide *a, const ov_wide *b) {
    return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2]));
}

/* A point, or the three corners of a triangle, from which distances are measured. */
typedef struct ov_from {
    float x[3], y[3], z[3];
} ov_from;

static inline ov_from ov_from_load(__global const float *points, const uint count) {
    ov_from from;
#pragma unroll
    for (uint i = 0; i < count; ++i) {
        from.x[i] = points[3 * i];
        from.y[i] = points[3 * i + 1];
        from.z[i] = points[3 * i + 2];
    }
    return from;
}

/* Finite in any case: a degenerate triangle's squares are nothing, or less after rounding. */
static inline ov_wide ov_inverse(ov_wide square) {
    return 1.0f / max(square, (ov_wide)FLT_MIN);
}

/* Squared distances from a point to some triangles of a leaf, the k-th vector of them: of the
 * nearest point of each triangle's plane, moved into the triangle, and of the nearest points of its
 * three edges. Each of the four lies in the triangle, and one of them is its nearest point, so that
 * rounding never finds anything nearer than there is. */
static inline ov_wide ov_triangle_distances(float px, float py, float pz,
                                            __global const float *leaf, uint k) {
    ov_wide w[3], u[3], v[3], across[3];
    w[0] = px - OV_WIDE_LOAD(k, leaf);
    w[1] = py - OV_WIDE_LOAD(k, leaf + OV_LEAF);
    w[2] = pz - OV_WIDE_LOAD(k, leaf + 2 * OV_LEAF);
#pragma unroll
    for (uint axis = 0; axis < 3; ++axis) {
        u[axis] = OV_WIDE_LOAD(k, leaf + (3 + axis) * OV_LEAF);
        v[axis] = OV_WIDE_LOAD(k, leaf + (6 + axis) * OV_LEAF);
        across[axis] = v[axis] - u[axis];
    }
    const ov_wide one = 1.0f, zero = 0.0f;
    const ov_wide along_u = ov_dot(w, u), along_v = ov_dot(w, v);
    const ov_wide uu = ov_dot(u, u), vv = ov_dot(v, v), uv = ov_dot(u, v);
    const ov_wide ahead = ov_dot(u, across), length = ov_dot(across, across);
    const ov_wide foot = along_u * ov_inverse(uu), slant = uv * ov_inverse(uu);
    const ov_wide on_u = clamp(foot, zero, one);
    const ov_wide on_v = clamp(along_v * ov_inverse(vv), zero, one);
    const ov_wide on_w = clamp((along_v - along_u - ahead) * ov_inverse(length), zero, one);
    /* Across u: what is left of w and v. Both are rounded as much as these are, so that the point
     * stays near to w's foot in needles, too. */
    ov_wide rest[3], height[3];
#pragma unroll
    for (uint axis = 0; axis < 3; ++axis) {
        rest[axis] = fma(-foot, u[axis], w[axis]);
        height[axis] = fma(-slant, u[axis], v[axis]);
    }
    const ov_wide rise =
        clamp(ov_dot(rest, height) * ov_inverse(ov_dot(height, height)), zero, one);
    const ov_wide s = clamp(fma(-rise, slant, foot), zero, one), t = min(rise, one - s);
    const ov_wide edges = min(min(ov_residue(w, u, v, on_u, zero), ov_residue(w, u, v, zero, on_v)),
                              ov_residue(w, u, v, one - on_w, on_w));
    return min(edges, ov_residue(w, u, v, s, t));
}

/* Of a leaf's triangles the least of their squared distances: to the point, or to that of the
 * points which is farthest from the triangle. */
static inline float ov_leaf_distance(const ov_from *from, const uint points,
                                     __global const float *leaf) {
    float least = INFINITY;
    for (uint k = 0; k < OV_LEAF / OV_WIDE; ++k) {
        ov_wide farthest = ov_triangle_distances(from->x[0], from->y[0], from->z[0], leaf, k);
        for (uint i = 1; i < points; ++i)
            farthest =
                max(farthest, ov_triangle_distances(from->x[i], from->y[i], from->z[i], leaf, k));
        least = min(least, ov_least(farthest));
    }
    return least;
}

/* Least squared distance to one corner of each triangle of a leaf: no less than to the triangles,
 * and quickly found. */
static inline float ov_corner_distance(float px, float py, float pz, __global const float *leaf) {
    float least = INFINITY;
    for (uint k = 0; k < OV_LEAF / OV_WIDE; ++k) {
        const ov_wide x = px - OV_WIDE_LOAD(k, leaf), y = py - OV_WIDE_LOAD(k, leaf + OV_LEAF),
                      z = pz - OV_WIDE_LOAD(k, leaf + 2 * OV_LEAF);
        least = min(least, ov_least(fma(x, x, fma(y, y, z * z))));
    }
    return least;
}

/* Squared distances from a point to some boxes of a group, the k-th vector of them; absent boxes
 * are infinitely far. */
static inline ov_wide ov_box_distance(float px, float py, float pz, __global const float *group,
                                      uint k) {
    const ov_wide zero = 0.0f;
    const ov_wide x =
        max(max(OV_WIDE_LOAD(k, group) - px, px - OV_WIDE_LOAD(k, group + 3 * OV_GROUP)), zero);
    const ov_wide y =
        max(max(OV_WIDE_LOAD(k, group + OV_GROUP) - py, py - OV_WIDE_LOAD(k, group + 4 * OV_GROUP)),
            zero);
    const ov_wide z = max(
        max(OV_WIDE_LOAD(k, group + 2 * OV_GROUP) - pz, pz - OV_WIDE_LOAD(k, group + 5 * OV_GROUP)),
        zero);
    return fma(x, x, fma(y, y, z * z));
}

/* Squared distances to the boxes of a group, of several points those of the farthest. */
static inline void ov_box_distances(const ov_from *from, const uint points,
                                    __global const float *group, float *distance) {
#pragma unroll
    for (uint k = 0; k < OV_GROUP / OV_WIDE; ++k) {
        ov_wide farthest = ov_box_distance(from->x[0], from->y[0], from->z[0], group, k);
        for (uint i = 1; i < points; ++i)
            farthest = max(farthest, ov_box_distance(from->x[i], from->y[i], from->z[i], group, k));
        OV_WIDE_STORE(farthest, k, distance);
    }
}

/* Squared distance to the nearest triangle of the leaves from first to end if that is below
 * `bound`, else bound; to any triangle once that is at most `enough`. Of several points that of the
 * farthest counts. triangles: of these leaves. *leaf becomes the one that the triangle is in. */
static inline float ov_nearest(const ov_from *from, const uint points, float bound, float enough,
                               int levels, const uint *first_group, __global const float *boxes,
                               uint first, uint end, __global const float *triangles, uint *leaf) {
    float distance[OV_LEVELS * OV_GROUP];      /* of the boxes of each level's current group */
    uint pending[OV_LEVELS], group[OV_LEVELS]; /* a bit for each of them still to be visited */
    int level = levels - 1;
    bool fresh = true;
    group[level] = 0;
    while (level < levels && bound > enough) {
        float *const own = distance + level * OV_GROUP;
        if (fresh) {
            const size_t g = first_group[level] + group[level];
            ov_box_distances(from, points, boxes + g * (6 * OV_GROUP), own);
            uint bits = 0;
            for (uint j = 0; j < OV_GROUP; ++j)
                bits |= own[j] < bound ? 1u << j : 0u;
            /* Of them, those of this level that hold some of the leaves. */
            const uint low = first >> (OV_GROUP_BITS * level),
                       high = (end - 1) >> (OV_GROUP_BITS * level), start = group[level] * OV_GROUP;
            bits &= ~0u << (low > start ? low - start : 0u);
            bits &= (2u << min(high - start, OV_GROUP - 1u)) - 1u;
            pending[level] = bits;
        }
        float least = bound;
        uint nearest = OV_GROUP;
        for (uint bits = pending[level]; bits != 0; bits &= bits - 1) {
            const uint j = 31 - clz(bits & -bits);
            if (own[j] < least) {
                least = own[j];
                nearest = j;
            }
        }
        fresh = false;
        if (nearest == OV_GROUP) {
            ++level;
            continue;
        }
        pending[level] &= ~(1u << nearest);
        const uint child = group[level] * OV_GROUP + nearest;
        if (level == 0) {
            const float found = ov_leaf_distance(
                from, points, triangles + (size_t)(child - first) * (OV_TRIANGLE * OV_LEAF));
            *leaf = found < bound ? child : *leaf;
            bound = min(bound, found);
        } else {
            group[--level] = child;
            fresh = true;
        }
    }
    return bound;
}

/* Leaves before and after that one whose corners are tried. */
#define NEAR_LEAVES 3u

/* Point k is xyz[3 * (from + k) + {0, 1, 2}], and squared[k], counted from number `to` on, becomes
 * its squared distance to the leaves from first_leaf to end_leaf, which lie between low and high
 * and whose triangles are given; with use_bound to them or what squared[k] was before, whichever is
 * less. For `each` consecutive points per work-item:
 * corners about the leaf that was nearest to one of them bound the distance of the next, most often
 * by `enough` already. Infinite beyond what a float holds. What is at most `enough` need not be the
 * least, only as much as the distance or more. Points that are not between asked_low and asked_high
 * are not asked for: 0. */
__kernel void distances(const uint count, const uint each, const uint from,
                        __global const float *restrict xyz, const ov_tree tree,
                        __global const float *restrict boxes, const uint first_leaf,
                        const uint end_leaf, const float4 low, const float4 high,
                        const float4 asked_low, const float4 asked_high,
                        __global const float *restrict triangles, const uint use_bound,
                        const float enough, const uint to, __global float *restrict squared) {
    /* A copy, made where all work-items still run together: see lists.cl. */
    const int levels = (int)tree.levels;
    uint first_group[OV_LEVELS];
    for (uint l = 0; l < OV_LEVELS; ++l)
        first_group[l] = tree.groups[l];
    const size_t first = get_global_id(0) * (size_t)each;
    uint leaf = end_leaf; /* none */
    for (size_t k = first; k < min(first + each, (size_t)count); ++k) {
        const ov_from point = ov_from_load(xyz + 3 * (from + k), 1);
        const float x = point.x[0], y = point.y[0], z = point.z[0];
        if (x < asked_low.x || y < asked_low.y || z < asked_low.z || x > asked_high.x ||
            y > asked_high.y || z > asked_high.z) {
            squared[to + k] = 0.0f;
            continue;
        }
        float bound = use_bound ? squared[to + k] : INFINITY;
        const float bx = max(max(low.x - x, x - high.x), 0.0f),
                    by = max(max(low.y - y, y - high.y), 0.0f),
                    bz = max(max(low.z - z, z - high.z), 0.0f);
        if (use_bound && fma(bx, bx, fma(by, by, bz * bz)) >= bound)
            continue;
        const uint middle = leaf;
        for (uint n = 0; n < 2 * NEAR_LEAVES + 1 && middle < end_leaf && bound > enough; ++n) {
            const uint near = n & 1 ? middle - (n + 1) / 2 : middle + n / 2; /* outwards */
            if (near < first_leaf || near >= end_leaf)                       /* below 0, too */
                continue;
            const float found = ov_corner_distance(
                x, y, z, triangles + (size_t)(near - first_leaf) * (OV_TRIANGLE * OV_LEAF));
            leaf = found < bound ? near : leaf;
            bound = min(bound, found);
        }
        if (bound > enough)
            bound = ov_nearest(&point, 1, bound, enough, levels, first_group, boxes, first_leaf,
                               end_leaf, triangles, &leaf);
        squared[to + k] = bound;
    }
}

/* How far other triangles reach from these ones: squared[k] becomes the least over the triangles t
 * of the leaves of the largest squared distance of the three corners of triangle k, which are at
 * xyz[9 * k], from t, or stays what it was if that is less. The distance from t is a convex
 * function, largest at a corner, so that no point of triangle k is farther than this from t. */
__kernel void triangle_distances(const uint count, __global const float *restrict xyz,
                                 const ov_tree tree, __global const float *restrict boxes,
                                 const uint first_leaf, const uint end_leaf,
                                 __global const float *restrict triangles,
                                 __global float *restrict squared) {
    const size_t k = get_global_id(0);
    const int levels = (int)tree.levels;
    uint first_group[OV_LEVELS];
    for (uint l = 0; l < OV_LEVELS; ++l)
        first_group[l] = tree.groups[l];
    if (k >= count)
        return;
    const ov_from corners = ov_from_load(xyz + 9 * k, 3);
    uint leaf = end_leaf;
    squared[k] = ov_nearest(&corners, 3, squared[k], 0.0f, levels, first_group, boxes, first_leaf,
                            end_leaf, triangles, &leaf);
}
