/*
 * Pictures: where parallel rays first meet a surface, and how it looks from there.
 *
 * Everything is in the frame of the camera: x to the right, y up, z toward the eye, angstrom. Ray
 * (column, row) runs down z at x = left + column * spacing, y = top - row * spacing. The rays of a
 * pack are a block of OV_BLOCK_X columns and OV_BLOCK_Y rows, blocks row by row; everything that is
 * kept per ray is stored in that order. A work-item follows one vector of a pack.
 *
 * Space is cut into boxes: a tile of tile * tile rays, and of the depth a slab of OV_SLAB_STEPS
 * steps. start, item: the terms that reach box b are item[start[b]] .. item[start[b + 1] - 1],
 * where b is box_of[tile * slabs + slab]. Slab 0 begins at z = front.
 */

#if OV_BLOCK_X * OV_BLOCK_Y != OV_PACK
#error "a block of rays is a pack"
#endif
/* Vectors of rays in a pack, a work-item each. Several in one would share nothing, and some drivers
 * bound the rounds of a work-item's loops: llvmpipe's (Mesa 22.3) end after 65535 altogether. */
#define OV_PARTS (OV_PACK / OV_VECTOR)
/* Newton steps within a bracket of at most one step. */
#define OV_REFINEMENTS 5

/* Masks are -1 or 0 in every component, of scalars too. */
#if OV_VECTOR == 1
#define OV_MASK(condition) (-(int)(condition))
#define OV_ANY(mask) ((mask) != 0)
#define OV_TO_INT convert_int
#else
#define OV_MASK(condition) (condition)
#define OV_ANY(mask) any(mask)
#define OV_TO_INT OV_JOIN(convert_int, OV_VECTOR)
#endif

__constant float ov_block_x[OV_PACK] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
__constant float ov_block_y[OV_PACK] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

/* The terms of one box. */
typedef struct ov_box_terms {
    __global const uint *item;
    __global const ov_term *terms;
    uint first, end;
} ov_box_terms;

static inline ov_box_terms ov_terms_of(__global const uint *start, __global const uint *item,
                                       __global const ov_term *terms, uint box) {
    ov_box_terms list = {item, terms, start[box], start[box + 1]};
    return list;
}

/* The field at one point per ray, and how it grows along the ray, toward -z. */
static inline void ov_along(const ov_box_terms list, ov_vec x, ov_vec y, ov_vec z, ov_vec *value,
                            ov_vec *growth) {
    ov_vec sum = 0.0f, slope = 0.0f;
    for (uint k = list.first; k < list.end; ++k) {
        const ov_term t = list.terms[list.item[k]];
        const ov_vec dx = x - t.x, dy = y - t.y, dz = z - t.z;
        const ov_vec e = ov_value(t, dx, dy, dz);
        sum += e;
        slope = fma(e, fma(dz, (ov_vec)(2.0f * t.zz), fma(dx, (ov_vec)(t.xz), dy * t.yz)), slope);
    }
    *value = sum;
    *growth = slope * M_LN2_F;
}

/* The same at OV_SLAB_STEPS depths of each ray: what does not depend on the depth is computed once.
 */
static inline void ov_march(const ov_box_terms list, ov_vec x, ov_vec y, float z, float step,
                            ov_vec *value, ov_vec *growth) {
    ov_vec sum[OV_SLAB_STEPS], slope[OV_SLAB_STEPS];
#pragma unroll
    for (uint s = 0; s < OV_SLAB_STEPS; ++s)
        sum[s] = slope[s] = 0.0f;
    for (uint k = list.first; k < list.end; ++k) {
        const ov_term t = list.terms[list.item[k]];
        const ov_vec dx = x - t.x, dy = y - t.y;
        const ov_vec flat =
            t.log2_amplitude - fma(dx, fma(dy, (ov_vec)(t.xy), dx * t.xx), dy * (dy * t.yy));
        const ov_vec tilt = fma(dx, (ov_vec)(t.xz), dy * t.yz);
#pragma unroll
        for (uint s = 0; s < OV_SLAB_STEPS; ++s) {
            const float dz = z - (float)(s + 1) * step - t.z;
            const ov_vec half_slope = tilt + dz * t.zz;
            const ov_vec e = ov_exp2(fma(half_slope, (ov_vec)(-dz), flat));
            sum[s] += e;
            slope[s] = fma(e, half_slope + dz * t.zz, slope[s]);
        }
    }
#pragma unroll
    for (uint s = 0; s < OV_SLAB_STEPS; ++s) {
        value[s] = sum[s];
        growth[s] = slope[s] * M_LN2_F;
    }
}

/* Minus the gradient, angstrom^-1. */
static inline void ov_descent(const ov_box_terms list, ov_vec x, ov_vec y, ov_vec z, ov_vec *out_x,
                              ov_vec *out_y, ov_vec *out_z) {
    ov_vec gx = 0.0f, gy = 0.0f, gz = 0.0f;
    for (uint k = list.first; k < list.end; ++k) {
        const ov_term t = list.terms[list.item[k]];
        const ov_vec dx = x - t.x, dy = y - t.y, dz = z - t.z;
        const ov_vec e = ov_value(t, dx, dy, dz);
        gx = fma(e, fma(dx, (ov_vec)(2.0f * t.xx), fma(dy, (ov_vec)(t.xy), dz * t.xz)), gx);
        gy = fma(e, fma(dy, (ov_vec)(2.0f * t.yy), fma(dx, (ov_vec)(t.xy), dz * t.yz)), gy);
        gz = fma(e, fma(dz, (ov_vec)(2.0f * t.zz), fma(dx, (ov_vec)(t.xz), dy * t.yz)), gz);
    }
    *out_x = gx * M_LN2_F;
    *out_y = gy * M_LN2_F;
    *out_z = gz * M_LN2_F;
}

/* x and y of a unit vector in 16 bits each; z follows, as what is seen looks toward the eye. */
static inline ov_ivec ov_pack_normal(ov_vec x, ov_vec y, ov_vec z) {
    const ov_vec scale = 32767.0f / sqrt(max(fma(x, x, fma(y, y, z * z)), 1e-30f));
    const ov_ivec low = OV_TO_INT(x * scale), high = OV_TO_INT(y * scale);
    return (high << 16) | (low & 0xffff);
}

/* Where a ray passes the level: between outer, where the field is below it, and inner. */
typedef struct ov_bracket {
    ov_vec outer, inner;             /* z */
    ov_vec outer_value, inner_value; /* of the field */
} ov_bracket;

static inline void ov_catch(ov_bracket *bracket, ov_ivec where, ov_vec outer, ov_vec outer_value,
                            ov_vec inner, ov_vec inner_value) {
    bracket->outer = select(bracket->outer, outer, where);
    bracket->inner = select(bracket->inner, inner, where);
    bracket->outer_value = select(bracket->outer_value, outer_value, where);
    bracket->inner_value = select(bracket->inner_value, inner_value, where);
}

/* Newton's method, halving the bracket where it would leave it. */
static inline ov_vec ov_refine(const ov_box_terms list, ov_vec x, ov_vec y, float level,
                               ov_bracket b) {
    ov_vec z = b.outer + (b.inner - b.outer) *
                             ((level - b.outer_value) / max(b.inner_value - b.outer_value, 1e-30f));
    for (uint k = 0; k < OV_REFINEMENTS; ++k) {
        ov_vec value, growth;
        ov_along(list, x, y, z, &value, &growth);
        const ov_ivec inside = OV_MASK(value >= level);
        b.inner = select(b.inner, z, inside);
        b.outer = select(z, b.outer, inside);
        const ov_vec next = z - (level - value) / growth;
        const ov_ivec good = OV_MASK(next >= b.inner) & OV_MASK(next <= b.outer);
        z = select(0.5f * (b.inner + b.outer), next, good);
    }
    return z;
}

/* First point of each ray where the field reaches level. depth: its z, or OV_NOWHERE; normal: see
 * ov_pack_normal(); slope: the gradient's length there, angstrom^-1.
 *
 * The field and its growth are known at every step. A level passed between two steps shows in the
 * values; a thin piece that is entered and left between two steps shows in the growth. */
__kernel void trace(const uint packs, const uint blocks, const uint tile, const uint tiles,
                    const uint slabs, const float left, const float top, const float spacing,
                    const float front, const float step, const float level,
                    __global const uint *restrict box_of, __global const uint *restrict start,
                    __global const uint *restrict item, __global const ov_term *restrict terms,
                    __global float *restrict depth, __global int *restrict normal,
                    __global float *restrict slope) {
    const uint pack = get_global_id(0) / OV_PARTS, part = get_global_id(0) % OV_PARTS;
    if (pack >= packs)
        return;
    const uint column = pack % blocks * OV_BLOCK_X, row = pack / blocks * OV_BLOCK_Y;
    __global const uint *const boxes =
        box_of + (size_t)(row / tile * tiles + column / tile) * slabs;
    const ov_vec x = left + ((float)column + OV_LOAD(part, ov_block_x)) * spacing;
    const ov_vec y = top - ((float)row + OV_LOAD(part, ov_block_y)) * spacing;
    ov_vec z = OV_NOWHERE, nx = 0.0f, ny = 0.0f, nz = 0.0f;
    ov_vec before = 0.0f, before_growth = 0.0f;
    ov_ivec open = -1;
    for (uint slab = 0; slab < slabs && OV_ANY(open); ++slab) {
        const ov_box_terms list = ov_terms_of(start, item, terms, boxes[slab]);
        if (list.first == list.end) {
            before = before_growth = 0.0f;
            continue;
        }
        const float z0 = front - (float)(slab * OV_SLAB_STEPS) * step;
        ov_vec value[OV_SLAB_STEPS], growth[OV_SLAB_STEPS];
        ov_march(list, x, y, z0, step, value, growth);
        ov_bracket bracket = {z0, z0, 0.0f, 1.0f};
        ov_ivec caught = 0;
        for (uint s = 0; s < OV_SLAB_STEPS; ++s) {
            const float above = z0 - (float)s * step, here = z0 - (float)(s + 1) * step;
            const ov_ivec free = open & ~caught;
            const ov_ivec inside = free & OV_MASK(value[s] >= level);
            ov_catch(&bracket, inside, above, before, here, value[s]);
            caught |= inside;
            /* Up and down again: how high at most, by the tangents at both ends? */
            const ov_vec bend = before_growth - growth[s];
            const ov_vec crest =
                before + before_growth * (value[s] - before - growth[s] * step) / bend;
            const ov_ivec peak = free & ~inside & OV_MASK(before_growth > 0.0f) &
                                 OV_MASK(growth[s] < 0.0f) & OV_MASK(crest >= level);
            if (OV_ANY(peak)) {
                const ov_vec summit =
                    above - select((ov_vec)0.0f, step * before_growth / bend, peak);
                ov_vec height, unused;
                ov_along(list, x, y, summit, &height, &unused);
                const ov_ivec reached = peak & OV_MASK(height >= level);
                ov_catch(&bracket, reached, above, before, summit, height);
                caught |= reached;
            }
            before = value[s];
            before_growth = growth[s];
        }
        if (!OV_ANY(caught))
            continue;
        const ov_vec found = ov_refine(list, x, y, level, bracket);
        ov_vec dx, dy, dz;
        ov_descent(list, x, y, found, &dx, &dy, &dz);
        z = select(z, found, caught);
        nx = select(nx, dx, caught);
        ny = select(ny, dy, caught);
        nz = select(nz, dz, caught);
        open &= ~caught;
    }
    const size_t base = (size_t)pack * OV_PACK;
    OV_STORE(z, part, depth + base);
    OV_STORE(ov_pack_normal(nx, ny, nz), part, normal + base);
    OV_STORE(sqrt(fma(nx, nx, fma(ny, ny, nz * nz))), part, slope + base);
}

/* As trace(), for the terms as ellipsoids of their own: the surface q = reach of each. term: which
 * one is met. */
__kernel void
trace_ellipsoids(const uint packs, const uint blocks, const uint tile, const uint tiles,
                 const uint slabs, const float left, const float top, const float spacing,
                 const float front, const float step, __global const uint *restrict box_of,
                 __global const uint *restrict start, __global const uint *restrict item,
                 __global const ov_term *restrict terms, __global float *restrict depth,
                 __global int *restrict normal, __global int *restrict term) {
    const uint pack = get_global_id(0) / OV_PARTS, part = get_global_id(0) % OV_PARTS;
    if (pack >= packs)
        return;
    const uint column = pack % blocks * OV_BLOCK_X, row = pack / blocks * OV_BLOCK_Y;
    __global const uint *const boxes =
        box_of + (size_t)(row / tile * tiles + column / tile) * slabs;
    const ov_vec x = left + ((float)column + OV_LOAD(part, ov_block_x)) * spacing;
    const ov_vec y = top - ((float)row + OV_LOAD(part, ov_block_y)) * spacing;
    ov_vec z = OV_NOWHERE, nx = 0.0f, ny = 0.0f, nz = 0.0f;
    ov_ivec which = 0, open = -1;
    for (uint slab = 0; slab < slabs && OV_ANY(open); ++slab) {
        const ov_box_terms list = ov_terms_of(start, item, terms, boxes[slab]);
        const float bottom = front - (float)((slab + 1) * OV_SLAB_STEPS) * step;
        for (uint k = list.first; k < list.end; ++k) {
            const ov_term t = terms[item[k]];
            const ov_vec dx = x - t.x, dy = y - t.y;
            const ov_vec flat = fma(dx, fma(dy, (ov_vec)(t.xy), dx * t.xx), dy * (dy * t.yy));
            const ov_vec tilt = fma(dx, (ov_vec)(t.xz), dy * t.yz);
            const ov_vec under = fma(tilt, tilt, 4.0f * t.zz * (t.reach - flat));
            const ov_vec dz = (sqrt(max(under, 0.0f)) - tilt) / (2.0f * t.zz);
            const ov_vec met = dz + t.z;
            /* What lies below the slab waits for its own: another term may come before it. */
            const ov_ivec nearer =
                open & OV_MASK(under >= 0.0f) & OV_MASK(met >= bottom) & OV_MASK(met > z);
            z = select(z, met, nearer);
            nx = select(nx, fma(dx, (ov_vec)(2.0f * t.xx), fma(dy, (ov_vec)(t.xy), dz * t.xz)),
                        nearer);
            ny = select(ny, fma(dy, (ov_vec)(2.0f * t.yy), fma(dx, (ov_vec)(t.xy), dz * t.yz)),
                        nearer);
            nz = select(nz, fma(dz, (ov_vec)(2.0f * t.zz), tilt), nearer);
            which = select(which, (ov_ivec)((int)item[k]), nearer);
        }
        open &= OV_MASK(z == OV_NOWHERE);
    }
    const size_t base = (size_t)pack * OV_PACK;
    OV_STORE(z, part, depth + base);
    OV_STORE(ov_pack_normal(nx, ny, nz), part, normal + base);
    OV_STORE(which, part, term + base);
}

/* At the points found by trace(): how far outside them the other field's surface lies to first
 * order, (field - level) / slope, angstrom; replaces slope. The boxes are those of the other
 * field. */
__kernel void compare(const uint packs, const uint blocks, const uint tile, const uint tiles,
                      const uint slabs, const float left, const float top, const float spacing,
                      const float front, const float step, const float level,
                      __global const uint *restrict box_of, __global const uint *restrict start,
                      __global const uint *restrict item, __global const ov_term *restrict terms,
                      __global const float *restrict depth, __global float *restrict slope) {
    const uint pack = get_global_id(0) / OV_PARTS, part = get_global_id(0) % OV_PARTS;
    if (pack >= packs)
        return;
    const uint column = pack % blocks * OV_BLOCK_X, row = pack / blocks * OV_BLOCK_Y;
    __global const uint *const boxes =
        box_of + (size_t)(row / tile * tiles + column / tile) * slabs;
    const size_t base = (size_t)pack * OV_PACK;
    const ov_vec x = left + ((float)column + OV_LOAD(part, ov_block_x)) * spacing;
    const ov_vec y = top - ((float)row + OV_LOAD(part, ov_block_y)) * spacing;
    const ov_vec z = OV_LOAD(part, depth + base);
    const ov_vec steep = OV_LOAD(part, slope + base);
    const ov_ivec seen = OV_MASK(z > OV_NOWHERE);
    const ov_vec place = clamp((front - z) / (OV_SLAB_STEPS * step), -1.0f, (float)slabs);
    const ov_ivec slab_of = select((ov_ivec)-1, OV_TO_INT(floor(place)), seen);
    ov_vec sum = 0.0f;
    int own[OV_VECTOR], low = (int)slabs, high = -1;
    OV_STORE(slab_of, 0, own);
    for (uint k = 0; k < OV_VECTOR; ++k) {
        low = own[k] >= 0 ? min(low, own[k]) : low;
        high = max(high, min(own[k], (int)slabs - 1));
    }
    for (int slab = low; slab <= high; ++slab) {
        const ov_ivec here = OV_MASK(slab_of == slab);
        if (!OV_ANY(here))
            continue;
        ov_vec value, unused;
        ov_along(ov_terms_of(start, item, terms, boxes[slab]), x, y, z, &value, &unused);
        sum = select(sum, value, here);
    }
    const ov_vec distance = (sum - level) / max(steep, 1e-6f);
    OV_STORE(select((ov_vec)0.0f, distance, seen), part, slope + base);
}

/* Glass over a surface: angstrom over which it begins where both cross, and over which what lies
 * below comes out of its tint: a thin film shows its colour, deep glass what is in it. */
#define OV_GLASS_EDGE 0.05f
#define OV_GLASS_DEPTH 0.5f

/* ---- light -------------------------------------------------------------------------------- */

/* One surface as the rays of a picture see it. */
typedef struct ov_seen {
    __global const float *depth;
    __global const int *normal;
    uint blocks;
    int columns, rows; /* rays */
} ov_seen;

static inline size_t ov_ray(const ov_seen seen, int column, int row) {
    const size_t block = (size_t)(row / OV_BLOCK_Y) * seen.blocks + (size_t)(column / OV_BLOCK_X);
    return block * OV_PACK + (size_t)(row % OV_BLOCK_Y * OV_BLOCK_X + column % OV_BLOCK_X);
}

static inline float4 ov_unpack_normal(int packed) {
    const float x = (float)(short)(packed & 0xffff) / 32767.0f;
    const float y = (float)(packed >> 16) / 32767.0f;
    return (float4)(x, y, sqrt(max(1.0f - x * x - y * y, 0.0f)), 0.0f);
}

/* Share of the light from all around that is left at a point: neighbours on the screen that rise
 * above its tangent plane take some away. taps: offsets in units of reach (angstrom). */
static inline float ov_openness(const ov_seen seen, int column, int row, float z, float4 n,
                                float spacing, float reach, __global const float2 *taps, uint first,
                                uint stride, uint count) {
    float closed = 0.0f;
    for (uint k = first; k < count; k += stride) {
        const float2 tap = taps[k] * (reach / spacing);
        const int x = column + (int)rint(tap.x), y = row + (int)rint(tap.y);
        if (x < 0 || y < 0 || x >= seen.columns || y >= seen.rows)
            continue;
        const float other = seen.depth[ov_ray(seen, x, y)];
        if (other == OV_NOWHERE)
            continue;
        const float dx = (float)(x - column) * spacing, dy = (float)(row - y) * spacing;
        const float dz = other - z;
        const float square = dx * dx + dy * dy + dz * dz;
        const float rise = (n.x * dx + n.y * dy + n.z * dz) * rsqrt(square + 1e-4f);
        const float near = max(1.0f - square / (4.0f * reach * reach), 0.0f);
        closed += max(rise - 0.08f, 0.0f) * near;
    }
    const float share = closed * (float)stride / (float)count;
    return 1.0f / (1.0f + 4.5f * share);
}

/* Light from a surface of this colour, linear RGB. key, fill: unit vectors toward the lights, their
 * strengths in w. */
static inline float4 ov_light(float4 colour, float4 n, float open, float4 key, float4 fill,
                              float ambient) {
    const float4 to_key = (float4)(key.x, key.y, key.z, 0.0f);
    const float4 to_fill = (float4)(fill.x, fill.y, fill.z, 0.0f);
    const float direct = key.w * max(dot(n, to_key), 0.0f);
    const float soft = fill.w * (0.5f + 0.5f * dot(n, to_fill));
    const float sky = ambient * (0.75f + 0.25f * n.y);
    const float diffuse = direct * (0.35f + 0.65f * open) + (soft + sky) * open;
    const float4 half_way = normalize(to_key + (float4)(0.0f, 0.0f, 1.0f, 0.0f));
    float shine = max(dot(n, half_way), 0.0f);
#pragma unroll
    for (uint k = 0; k < 5; ++k) /* to the power of 32 */
        shine *= shine;
    shine *= 0.15f * open;
    /* Toward the contour the surface turns away: a soft dark edge. */
    const float edge = mix(0.55f, 1.0f, smoothstep(0.0f, 0.45f, n.z));
    return colour * (diffuse * edge) + shine;
}

static inline float4 ov_fade(float4 colour, float4 haze, float z, float near, float far,
                             float most) {
    const float share = most * clamp((near - z) / max(near - far, 1e-6f), 0.0f, 1.0f);
    return mix(colour, haze, share);
}

static inline uchar ov_encode(float linear) {
    const float v = clamp(linear, 0.0f, 1.0f);
    const float s = v <= 0.0031308f ? 12.92f * v : 1.055f * powr(v, 1.0f / 2.4f) - 0.055f;
    return (uchar)(s * 255.0f + 0.5f);
}

/* One pixel per work-item, each the mean of samples * samples rays.
 *
 * paint: 0 one colour, 1 extra is a distance as float, looked up in palette over -range .. range, 2
 * extra is an index into palette. glass != 0 lays a second, translucent surface over the first.
 * Colours are linear RGB. background.w is its opacity; haze is what the distance fades to. image:
 * RGBA8, not premultiplied; cover: rays of the pixel that meet a surface. */
__kernel void shade(const uint width, const uint height, const uint samples, const uint blocks,
                    const float spacing, __global const float *restrict depth,
                    __global const int *restrict normal, __global const int *restrict extra,
                    const uint paint, __global const float4 *restrict palette,
                    const uint palette_size, const float range, const uint glass,
                    __global const float *restrict glass_depth,
                    __global const int *restrict glass_normal, const float4 colour,
                    const float4 glass_colour, const float4 background, const float4 haze,
                    const float4 key, const float4 fill, const float4 ambient_near_far_fade,
                    __global const float2 *restrict taps, const uint tap_count, const float reach,
                    __global uchar4 *restrict image, __global uchar *restrict cover) {
    const uint pixel = get_global_id(0);
    if (pixel >= width * height)
        return;
    const float ambient = ambient_near_far_fade.x, near = ambient_near_far_fade.y;
    const float far = ambient_near_far_fade.z, most = ambient_near_far_fade.w;
    const int column = (int)(pixel % width * samples), row = (int)(pixel / width * samples);
    const ov_seen base = {depth, normal, blocks, (int)(width * samples), (int)(height * samples)};
    const ov_seen pane = {glass_depth, glass_normal, blocks, base.columns, base.rows};
    const uint rays = samples * samples;
    float4 sum = 0.0f; /* premultiplied, opacity in w */
    uint met = 0;
    for (uint k = 0; k < rays; ++k) {
        const int x = column + (int)(k % samples), y = row + (int)(k / samples);
        const size_t at = ov_ray(base, x, y);
        const float z = depth[at];
        bool any_surface = false;
        float4 light = background * background.w;
        light.w = background.w;
        if (z > OV_NOWHERE) {
            const float4 n = ov_unpack_normal(normal[at]);
            float4 own = colour;
            if (paint == 1)
                own = palette[(uint)(clamp(as_float(extra[at]) / range * 0.5f + 0.5f, 0.0f, 1.0f) *
                                         (float)(palette_size - 1) +
                                     0.5f)];
            else if (paint == 2)
                own = palette[(uint)extra[at] % palette_size];
            const float open =
                ov_openness(base, x, y, z, n, spacing, reach, taps, k, rays, tap_count);
            light = ov_fade(ov_light(own, n, open, key, fill, ambient), haze, z, near, far, most);
            light.w = 1.0f;
            any_surface = true;
        }
        if (glass) {
            const float front = glass_depth[at];
            const float4 n = ov_unpack_normal(glass_normal[at]);
            /* How deep the glass is, straight through it. Where the surfaces cross, it begins
             * softly. */
            const float thick = (front - z) * n.z;
            if (front > OV_NOWHERE && thick > -OV_GLASS_EDGE) {
                const float open =
                    ov_openness(pane, x, y, front, n, spacing, reach, taps, k, rays, tap_count);
                float4 veil = ov_fade(ov_light(glass_colour, n, open, key, fill, ambient), haze,
                                      front, near, far, most);
                const float slant = 1.0f - n.z,
                            depth_share = exp(-max(thick, 0.0f) / OV_GLASS_DEPTH);
                const float opacity =
                    smoothstep(-OV_GLASS_EDGE, OV_GLASS_EDGE, thick) *
                    mix(mix(0.5f, 0.88f, depth_share), 0.95f, slant * slant * slant);
                veil.w = 1.0f;
                light = mix(light, veil, opacity);
                any_surface = true;
            }
        }
        sum += light;
        met += any_surface ? 1 : 0;
    }
    sum /= (float)rays;
    const float whole = max(sum.w, 1e-6f);
    image[pixel] =
        (uchar4)(ov_encode(sum.x / whole), ov_encode(sum.y / whole), ov_encode(sum.z / whole),
                 (uchar)(clamp(sum.w, 0.0f, 1.0f) * 255.0f + 0.5f));
    cover[pixel] = (uchar)met;
}
