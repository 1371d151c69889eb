/*
 * Marching cubes over one piece of the lattice, brick by brick, with signs in bit masks.
 *
 * A piece is a grid of nx * ny * nz bricks (OV_PACK lattice points each, see host/field/bricks.h)
 * in the corner of a grid with one more brick along each axis: these hold what the neighbouring
 * pieces found at their first points. A brick owns the cells and the lattice edges whose low corner
 * is one of its points. Bit j of a mask speaks of point j of the brick.
 *
 * A vertex lies on each edge whose ends differ in sign. `crossing` holds four values per brick: the
 * number of its first vertex, and the masks of its crossed edges along x, y and z. Its vertices are
 * numbered in that order, by point within each axis, so that any vertex's number follows from its
 * edge. Edges are named as in host/mesh/case_table.h: corner + 8 * axis.
 *
 * The values of phi lie elsewhere: those of a brick in pack place[brick].
 *
 * The kernels over bricks take several to a work-item where work-items are dear.
 */

/* Points of a brick that are its last in x, y and z, for bricks of 4 x 2 x 2. */
#define LAST_X 0x8888u
#define LAST_Y 0xf0f0u
#define LAST_Z 0xff00u
#define ALL 0xffffu

/* Signs of the points after those of a brick along an axis, from its own and the next brick's. */
static inline uint after_x(uint own, uint next) {
    return (own >> 1 & ~LAST_X) | (next << 3 & LAST_X);
}

static inline uint after_y(uint own, uint next) {
    return (own >> 4 & ~LAST_Y) | (next << 4 & LAST_Y);
}

static inline uint after_z(uint own, uint next) {
    return (own >> 8 & ~LAST_Z) | (next << 8 & LAST_Z);
}

/* The signs at the eight corners of a brick's cells; corner c at (c & 1, c >> 1 & 1, c >> 2). */
typedef struct corners {
    uint at[8];
} corners;

/* `brick` within the padded grid of nx + 1 by ny + 1 bricks per layer. */
static inline corners load_corners(__global const uint *sign, uint brick, uint nx, uint ny) {
    const uint row = nx + 1, layer = row * (ny + 1);
    corners c;
    uint upper[4];
    for (uint z = 0; z < 2; ++z) {
        __global const uint *const s = sign + brick + z * layer;
        const uint own[4] = {s[0], after_x(s[0], s[1]), s[row], after_x(s[row], s[row + 1])};
        for (uint x = 0; x < 2; ++x) {
            const uint y0 = own[x], y1 = after_y(own[x], own[x + 2]);
            if (z == 0) {
                c.at[x] = y0;
                c.at[x + 2] = y1;
            } else {
                upper[x] = y0;
                upper[x + 2] = y1;
            }
        }
    }
    for (uint k = 0; k < 4; ++k)
        c.at[k + 4] = after_z(c.at[k], upper[k]);
    return c;
}

/* Whether all points of a brick and its neighbours are on one side, as nearly everywhere. */
static inline bool is_uniform(__global const uint *sign, uint brick, uint nx, uint ny) {
    const uint row = nx + 1, layer = row * (ny + 1);
    __global const uint *const s = sign + brick, *const t = s + layer;
    const uint any = s[0] | s[1] | s[row] | s[row + 1] | t[0] | t[1] | t[row] | t[row + 1];
    const uint all = s[0] & s[1] & s[row] & s[row + 1] & t[0] & t[1] & t[row] & t[row + 1];
    return any == 0 || all == ALL;
}

/* Cells with corners on both sides. */
static inline uint mixed_cells(const corners *c) {
    uint any = 0, all = ALL;
    for (uint k = 0; k < 8; ++k) {
        any |= c->at[k];
        all &= c->at[k];
    }
    return any & ~all;
}

/* Where the lattice ends within a piece, the last point along each axis, it is open: no cell and no
 * edge lies beyond. Masks of a brick's points: those that are before the end along all axes have a
 * cell, and along one an edge if they are not beyond the others' ends. */
typedef struct within {
    uint cells, edges[3];
} within;

/* Points of a brick, the first at `first` along x, y or z, that are before `end`. */
static inline uint before_x(uint first, uint end) {
    return ((1u << min(max(end, first) - first, (uint)OV_BRICK_X)) - 1) * 0x1111u;
}

static inline uint before_y(uint first, uint end) {
    return ((1u << 4 * min(max(end, first) - first, (uint)OV_BRICK_Y)) - 1) * 0x0101u;
}

static inline uint before_z(uint first, uint end) {
    return (1u << 8 * min(max(end, first) - first, (uint)OV_BRICK_Z)) - 1;
}

/* brick: its place in the grid; last: of the lattice's points, from the piece's corner. */
static inline within find_within(uint3 brick, uint3 last) {
    const uint x = brick.x * OV_BRICK_X, y = brick.y * OV_BRICK_Y, z = brick.z * OV_BRICK_Z;
    const uint3 before = (uint3)(before_x(x, last.x), before_y(y, last.y), before_z(z, last.z));
    const uint3 up_to =
        (uint3)(before_x(x, last.x + 1), before_y(y, last.y + 1), before_z(z, last.z + 1));
    within w;
    w.cells = before.x & before.y & before.z;
    w.edges[0] = before.x & up_to.y & up_to.z;
    w.edges[1] = up_to.x & before.y & up_to.z;
    w.edges[2] = up_to.x & up_to.y & before.z;
    return w;
}

static inline uint case_of(const corners *c, uint point) {
    uint index = 0;
    for (uint k = 0; k < 8; ++k)
        index |= (c->at[k] >> point & 1u) << k;
    return index;
}

static inline uint lowest_bit(uint mask) {
    return 31 - clz(mask & -mask);
}

/* sign: bit j set where point j of a brick is inside, phi > c: a point where phi only touches c,
 * such as the centre of an atom of radius 0, has no surface about it. All bricks of the padded
 * grid, by place: brick_of. */
__kernel void march_signs(const uint bricks, const uint run, const float isovalue,
                          __global const uint *restrict brick_of,
                          __global const float *restrict value, __global uint *restrict sign) {
    const uint first = get_global_id(0) * run, end = min(first + run, bricks);
    const int16 bit = (int16)(1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7,
                              1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, 1 << 15);
    for (uint k = first; k < end; ++k) {
        int lane[16];
        uint mask = 0;
        vstore16((vload16(k, value) > isovalue) & bit, 0, lane);
        for (uint j = 0; j < 16; ++j)
            mask |= (uint)lane[j];
        sign[brick_of[k]] = mask;
    }
}

/* For the nx * ny * nz bricks of the piece, in raster order: masks of crossed edges into `crossing`
 * (of the padded grid), number of vertices + 256 * number of triangles into `found` (of the piece,
 * by place). last: of find_within(). */
__kernel void march_count(const uint nx, const uint ny, const uint nz, const uint run,
                          const uint4 last, __global const uint *restrict place,
                          __global const uint *restrict sign, __global const uchar *restrict cases,
                          __global uint4 *restrict crossing, __global uint *restrict found) {
    const uint bricks = nx * ny * nz;
    const uint first = get_global_id(0) * run, end = min(first + run, bricks);
    for (uint k = first; k < end; ++k) {
        const uint3 at = (uint3)(k % nx, k / nx % ny, k / (nx * ny));
        const uint brick = (at.z * (ny + 1) + at.y) * (nx + 1) + at.x;
        if (is_uniform(sign, brick, nx, ny)) {
            crossing[brick] = (uint4)(0, 0, 0, 0);
            found[place[brick]] = 0;
            continue;
        }
        const corners c = load_corners(sign, brick, nx, ny);
        const within w = find_within(at, last.xyz);
        uint count = 0;
        for (uint cells = mixed_cells(&c) & w.cells; cells; cells &= cells - 1)
            count += cases[case_of(&c, lowest_bit(cells)) * OV_CASE_BYTES];
        const uint x = (c.at[0] ^ c.at[1]) & w.edges[0], y = (c.at[0] ^ c.at[2]) & w.edges[1],
                   z = (c.at[0] ^ c.at[4]) & w.edges[2];
        crossing[brick] = (uint4)(0, x, y, z);
        found[place[brick]] = popcount(x) + popcount(y) + popcount(z) + (count << 8);
    }
}

/* Bricks with something in them, vertices and triangles among those from first to end. */
static inline uint3 count_found(__global const uint *restrict found, uint first, uint end) {
    uint3 sum = 0;
    for (uint k = first; k < end; ++k) {
        const uint own = found[k];
        sum += (uint3)(own > 0 ? 1 : 0, own & 255u, own >> 8);
    }
    return sum;
}

/* Numbers the vertices and triangles of `bricks` bricks by place, which follows a space-filling
 * curve, and lists the bricks that have some as march_vertices() wants it; before: vertices of the
 * mesh so far. brick_of: number in the padded grid of the brick at a place. totals: entries of the
 * list, vertices, triangles. One work-group of OV_SCAN_GROUP work-items at most. */
__kernel void march_number(const uint bricks, const uint before,
                           __global const uint *restrict brick_of,
                           __global const uint *restrict found, __global uint4 *restrict list,
                           __global uint *restrict totals) {
    __local uint scratch[3 * OV_SCAN_GROUP];
    const uint at = get_local_id(0), size = get_local_size(0), each = (bricks + size - 1) / size;
    const uint first = min(at * each, bricks), end = min(first + each, bricks);
    if (get_group_id(0) > 0)
        return;
    vstore3(count_found(found, first, end), at, scratch);
    barrier(CLK_LOCAL_MEM_FENCE);
    uint3 so_far = 0;
    for (uint k = 0; k < at; ++k)
        so_far += vload3(k, scratch);
    for (uint k = first; k < end; ++k) {
        const uint own = found[k];
        if (own == 0)
            continue;
        list[so_far.x] = (uint4)(brick_of[k], so_far.y, so_far.z, before + so_far.y);
        so_far += (uint3)(1, own & 255u, own >> 8);
    }
    if (at == size - 1)
        vstore3(so_far, 0, totals);
}

/* values[k], crossings[k] = those of the k-th brick of the list. */
__kernel void march_get(const uint count, __global const uint *restrict list,
                        __global const uint *restrict place, __global const float *restrict value,
                        __global const uint4 *restrict crossing, __global float *restrict values,
                        __global uint4 *restrict crossings) {
    const uint k = get_global_id(0);
    if (k >= count)
        return;
    __global const float *const from = value + (size_t)place[list[k]] * OV_PACK;
    for (uint j = 0; j < OV_PACK; ++j)
        values[(size_t)k * OV_PACK + j] = from[j];
    crossings[k] = crossing[list[k]];
}

/* The other way. */
__kernel void march_put(const uint count, __global const uint *restrict list,
                        __global const uint *restrict place, __global const float *restrict values,
                        __global const uint4 *restrict crossings, __global float *restrict value,
                        __global uint4 *restrict crossing) {
    const uint k = get_global_id(0);
    if (k >= count)
        return;
    __global float *const to = value + (size_t)place[list[k]] * OV_PACK;
    for (uint j = 0; j < OV_PACK; ++j)
        to[j] = values[(size_t)k * OV_PACK + j];
    crossing[list[k]] = crossings[k];
}

/* Number of a point within its brick, and of its brick within the padded grid. */
typedef struct spot {
    uint brick, point;
} spot;

/* The point at `corner` of the cell of `point` in `brick`. */
static inline spot move_to_corner(uint brick, uint point, uint corner, uint nx, uint ny) {
    uint x = (point & 3u) + (corner & 1u), y = (point >> 2 & 1u) + (corner >> 1 & 1u),
         z = (point >> 3) + (corner >> 2);
    spot p;
    p.brick = brick + x / OV_BRICK_X + (nx + 1) * (y / OV_BRICK_Y + (ny + 1) * (z / OV_BRICK_Z));
    p.point = x % OV_BRICK_X + OV_BRICK_X * (y % OV_BRICK_Y + OV_BRICK_Y * (z % OV_BRICK_Z));
    return p;
}

/* A vertex keeps this far from the ends of its edge, in lattice steps: where the surface passes
 * through a lattice point, all its edges have their vertex there, and programs that merge equal
 * vertices would be left with triangles without area and holes. Three points within three edges of
 * a box are never on one line, so that apart from these ends no triangle can lose its area. */
#define EDGE_MARGIN 7.62939453125e-6f /* 2^-17, as in host/mesh/march.h */

static inline float keep_within(float t) {
    return clamp(t, EDGE_MARGIN, 1.0f - EDGE_MARGIN);
}

/* Where phi is c between a at 0 and b at 1. Interpolates ln phi if `logarithmic`: the start of a
 * search, as ln phi is quadratic about a single atom. */
static inline float crossing_at(float a, float b, float isovalue, int logarithmic) {
    if (logarithmic) {
        a = log(max(a, 1e-37f) / isovalue);
        b = log(max(b, 1e-37f) / isovalue);
        isovalue = 0.0f;
    }
    const float t = (isovalue - a) / (b - a);
    return t >= 0.0f && t <= 1.0f ? t : 0.5f; /* not a number where phi overflows */
}

/* The vertices of the listed bricks, and their numbers into `crossing`. Each entry of the list is
 * {brick, first vertex within the piece, first triangle, number of the first vertex}. edge: x + (y
 * << 8) + (z << 16) of the low end in lattice points from the piece's corner, axis << 24, and 1 <<
 * 26 if the low end is inside. t: where on the edge. */
__kernel void march_vertices(const uint count, __global const uint4 *restrict list, const uint nx,
                             const uint ny, const float isovalue, const int logarithmic,
                             __global const uint *restrict place,
                             __global const float *restrict value,
                             __global uint4 *restrict crossing, __global uint *restrict edge,
                             __global float *restrict t) {
    const uint item = get_global_id(0);
    if (item >= count)
        return;
    const uint brick = list[item].x;
    const uint4 crossed = crossing[brick];
    crossing[brick].x = list[item].w;
    const uint mask[3] = {crossed.y, crossed.z, crossed.w};
    const uint bx = brick % (nx + 1), by = brick / (nx + 1) % (ny + 1),
               bz = brick / ((nx + 1) * (ny + 1));
    uint at = list[item].y;
    for (uint axis = 0; axis < 3; ++axis)
        for (uint points = mask[axis]; points; points &= points - 1, ++at) {
            const uint point = lowest_bit(points);
            const spot end = move_to_corner(brick, point, 1u << axis, nx, ny);
            const float a = value[(size_t)place[brick] * OV_PACK + point];
            const float b = value[(size_t)place[end.brick] * OV_PACK + end.point];
            const uint x = bx * OV_BRICK_X + (point & 3u), y = by * OV_BRICK_Y + (point >> 2 & 1u),
                       z = bz * OV_BRICK_Z + (point >> 3);
            edge[at] = x | y << 8 | z << 16 | axis << 24 | (a > isovalue ? 1u : 0u) << 26;
            t[at] = keep_within(crossing_at(a, b, isovalue, logarithmic));
        }
}

/* Fills the last pack of vertices up with its last one. box: of each pack, low x, y, z, high x, y,
 * z in angstrom from the piece's corner, wherever on their edges the vertices come to lie. */
__kernel void march_boxes(const uint packs, const uint vertices, const float spacing,
                          __global uint *restrict edge, __global float *restrict t,
                          __global float *restrict box) {
    const uint pack = get_global_id(0);
    if (pack >= packs)
        return;
    const uint first = pack * OV_PACK;
    int low[3] = {256, 256, 256}, high[3] = {0, 0, 0};
    for (uint k = first; k < first + OV_PACK; ++k) {
        const uint from = min(k, vertices - 1), code = edge[from], axis = code >> 24 & 3u;
        const int at[3] = {code & 255u, code >> 8 & 255u, code >> 16 & 255u};
        for (uint i = 0; i < 3; ++i) {
            low[i] = min(low[i], at[i]);
            high[i] = max(high[i], at[i] + (i == axis ? 1 : 0));
        }
        if (k > from) {
            edge[k] = code;
            t[k] = t[from];
        }
    }
    for (uint i = 0; i < 3; ++i) {
        box[6 * pack + i] = (float)low[i] * spacing;
        box[6 * pack + 3 + i] = (float)high[i] * spacing;
    }
}

/* The triangles of the listed bricks, three vertex numbers each, behind those that are there
 * `before`. last: of find_within(). */
__kernel void march_triangles(const uint count, const uint before,
                              __global const uint4 *restrict list, const uint nx, const uint ny,
                              const uint4 last, __global const uint *restrict sign,
                              __global const uchar *restrict cases,
                              __global const uint4 *restrict crossing,
                              __global uint *restrict corner) {
    const uint item = get_global_id(0);
    if (item >= count)
        return;
    const uint brick = list[item].x;
    const corners c = load_corners(sign, brick, nx, ny);
    const uint3 place =
        (uint3)(brick % (nx + 1), brick / (nx + 1) % (ny + 1), brick / ((nx + 1) * (ny + 1)));
    const within w = find_within(place, last.xyz);
    size_t at = ((size_t)before + list[item].z) * 3;
    for (uint cells = mixed_cells(&c) & w.cells; cells; cells &= cells - 1) {
        const uint point = lowest_bit(cells);
        __global const uchar *const entry = cases + case_of(&c, point) * OV_CASE_BYTES;
        const uint edges = 3u * entry[0];
        for (uint k = 1; k <= edges; ++k, ++at) {
            const uint axis = entry[k] >> 3;
            const spot low = move_to_corner(brick, point, entry[k] & 7u, nx, ny);
            const uint4 crossed = crossing[low.brick];
            const uint before = (1u << low.point) - 1;
            const uint own = axis == 0 ? crossed.y : axis == 1 ? crossed.z : crossed.w;
            corner[at] = crossed.x + (axis > 0 ? popcount(crossed.y) : 0) +
                         (axis > 1 ? popcount(crossed.z) : 0) + popcount(own & before);
        }
    }
}

/* ---- vertices on the surface -------------------------------------------------------------- */

#if OV_VECTOR == 1
#define TO_FLOAT(x) convert_float(x)
#define ANY(x) ((x) != 0)
#else
#define TO_FLOAT(x) OV_JOIN(convert_float, OV_VECTOR)(x)
#define ANY(x) any(x)
#endif

/* A bracket must be this much smaller than the last of Newton's steps: it halves its error, where
 * they square it. */
#define HALVED 64.0f

/* A gradient is all rounding where phi changes by less than this share in a lattice step. */
#define VANISHING 1e-5f

/* Moves the vertices along their edges to where phi = c, by Newton's steps on ln phi, and by
 * halving the bracket where such a step would leave it. A step under `close` (in lattice steps) is
 * the last one: the error that it leaves is of the order of its square. With steps = 0 vertices
 * stay.
 *
 * Vertices in packs; start, item, terms as for field(). normal: OV_PACK x, y, z per pack of the
 * unit vector against the gradient, 0 where that vanishes. */
__kernel void march_refine(const uint packs, const float spacing, const float isovalue,
                           const uint steps, const float close, __global const uint *restrict edge,
                           __global const uint *restrict start, __global const uint *restrict item,
                           __global const ov_term *restrict terms, __global float *restrict t,
                           __global float *restrict normal) {
    const uint pack = get_global_id(0) / OV_LANES, lane = get_global_id(0) % OV_LANES;
    if (pack >= packs)
        return;
    __global const int *const codes = (__global const int *)edge + (size_t)pack * OV_PACK;
    __global float *const ts = t + (size_t)pack * OV_PACK;
    __global float *const out = normal + (size_t)pack * (3 * OV_PACK);
    const uint first = start[pack], end = start[pack + 1];
    const ov_vec zero = 0.0f, one = 1.0f, h = spacing;
    for (uint v = 0; v < OV_VECTORS; ++v) {
        const uint place = v * OV_LANES + lane;
        const ov_ivec code = OV_LOAD(place, codes);
        const ov_vec x0 = TO_FLOAT(code & 255) * h, y0 = TO_FLOAT(code >> 8 & 255) * h,
                     z0 = TO_FLOAT(code >> 16 & 255) * h;
        const ov_ivec axis = code >> 24 & 3, low_inside = (code >> 26 & 1) == 1;
        const ov_vec ux = axis == 0 ? one : zero, uy = axis == 1 ? one : zero,
                     uz = axis == 2 ? one : zero;
        ov_vec s = OV_LOAD(place, ts), from = zero, to = one, sum, gx, gy, gz;
        ov_ivec moving = s >= zero;
        for (uint step = 0;; ++step) {
            const ov_vec px = fma(s * h, ux, x0), py = fma(s * h, uy, y0), pz = fma(s * h, uz, z0);
            sum = gx = gy = gz = zero;
            for (uint k = first; k < end; ++k) {
                const ov_term term = terms[item[k]];
                const ov_vec x = px - term.x, y = py - term.y, z = pz - term.z;
                const ov_vec e = ov_value(term, x, y, z);
                sum += e;
                /* -grad phi / ln 2 */
                gx =
                    fma(e, fma(x, (ov_vec)(2.0f * term.xx), fma(y, (ov_vec)(term.xy), z * term.xz)),
                        gx);
                gy =
                    fma(e, fma(y, (ov_vec)(2.0f * term.yy), fma(x, (ov_vec)(term.xy), z * term.yz)),
                        gy);
                gz =
                    fma(e, fma(z, (ov_vec)(2.0f * term.zz), fma(x, (ov_vec)(term.xz), y * term.yz)),
                        gz);
            }
            if (step >= steps)
                break;
            const ov_ivec beyond = (sum > isovalue) == low_inside;
            from = moving && beyond ? s : from;
            to = moving && !beyond ? s : to;
            const ov_vec slope = fma(gx, ux, fma(gy, uy, gz * uz)) * (M_LN2_F * h);
            const ov_vec newton =
                sum == isovalue ? s : s + log(max(sum, 1e-37f) / isovalue) * sum / slope;
            const ov_ivec within = newton >= from - close && newton <= to + close;
            const ov_vec next = within ? clamp(newton, from, to) : 0.5f * (from + to);
            const ov_vec left = within ? fabs(next - s) : (to - from) * HALVED;
            s = moving ? next : s;
            moving = moving && left >= close;
            if (!ANY(moving))
                break;
        }
        const ov_vec largest = max(fabs(gx), max(fabs(gy), fabs(gz)));
        const ov_ivec usable = largest * h > VANISHING * sum && largest < INFINITY;
        const ov_vec scale = usable ? one / largest : zero;
        gx *= scale;
        gy *= scale;
        gz *= scale;
        const ov_vec length = usable ? one / sqrt(fma(gx, gx, fma(gy, gy, gz * gz))) : zero;
        OV_STORE(clamp(s, (ov_vec)EDGE_MARGIN, (ov_vec)(1.0f - EDGE_MARGIN)), place, ts);
        OV_STORE(usable ? gx * length : zero, place, out);
        OV_STORE(usable ? gy * length : zero, place, out + OV_PACK);
        OV_STORE(usable ? gz * length : zero, place, out + 2 * OV_PACK);
    }
}

/* Coordinates of the piece's refined vertices behind those that are there `before`, and, unless
 * normal is null, their normals. corner: of the piece, angstrom, as a float and what that leaves.
 */
__kernel void march_place(const uint count, const uint before, const float spacing,
                          const float4 corner, const float4 rest,
                          __global const uint *restrict edge, __global const float *restrict t,
                          __global const float *restrict normal, __global float *restrict xyz,
                          __global float *restrict normals) {
    const uint pack = get_global_id(0);
    for (uint k = pack * OV_PACK; k < min((pack + 1) * OV_PACK, count); ++k) {
        const uint code = edge[k], axis = code >> 24 & 3u;
        const size_t to = (size_t)before + k;
        const float3 low =
            convert_float3((uint3)(code & 255u, code >> 8 & 255u, code >> 16 & 255u));
        const float along = t[k] * spacing;
        const float3 small = rest.xyz + (float3)(axis == 0 ? along : 0.0f, axis == 1 ? along : 0.0f,
                                                 axis == 2 ? along : 0.0f);
        vstore3(corner.xyz + fma(low, (float3)(spacing), small), to, xyz);
        if (normal)
            for (uint i = 0; i < 3; ++i)
                normals[3 * to + i] =
                    normal[(size_t)pack * (3 * OV_PACK) + i * OV_PACK + k % OV_PACK];
    }
}
