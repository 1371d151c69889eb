/*
 * What the host and the kernels share: sizes and structures. Fixed-width scalars only, explicit
 * padding, sizes and offsets asserted by the host and reported by kernels/layout.cl.
 */
#ifndef OV_SHARED_H
#define OV_SHARED_H

#ifdef __OPENCL_C_VERSION__
typedef uint ov_u32;
typedef float ov_f32;
#define OV_ALIGNED(bytes) __attribute__((aligned(bytes)))
#else
#include <stdint.h>
typedef uint32_t ov_u32;
typedef float ov_f32;
#define OV_ALIGNED(bytes) /* what malloc() gives is enough */
#endif

/* Points in a pack: one float16 on a CPU, half a warp on a GPU. Measured on long lists and on real
 * molecules, 16 beats 32 in rate and in the share of useful pairs (bench/results). */
#define OV_PACK 16
/* Lattice points in bricks are packs: x runs fastest. */
#define OV_BRICK_X 4
#define OV_BRICK_Y 2
#define OV_BRICK_Z 2
/* Boxes in a group of the tree over packs or terms, and levels of that tree (16^7 leaves). */
#define OV_GROUP 16
#define OV_GROUP_BITS 4 /* its logarithm */
#define OV_LEVELS 7
/* What lists are made of (kernels/lists.cl): entries in a chunk, and bins for the entries of a
 * group. The more bins, the fewer entries come to lie in disorder. */
#define OV_CHUNK 16
#define OV_BINS 8
/* Monomials of degree up to 2 in z = y - centre: 1, x, y, z, xx, xy, xz, yy, yz, zz. */
#define OV_MONOMIALS 10
/* Monomials of degree up to 4, of which the products of two of those above are made: 1; x, y, z;
 * xx, xy, xz, yy, yz, zz; xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz; xxxx, xxxy, xxxz, xxyy,
 * xxyz, xxzz, xyyy, xyyz, xyzz, xzzz, yyyy, yyyz, yyzz, yzzz, zzzz. */
#define OV_GRAM 35

/* Work-items that make starts of counts, at most. */
#define OV_SCAN_GROUP 256

/* Packs that share a sum of the misfit (kernels/misfit.cl). */
#define OV_MISFIT_PACKS 64

/* The most ellipsoids whose iterations take one work-group each, and its size at most
 * (kernels/solve.cl). */
#define OV_SOLVE_ALONE 1024
#define OV_SOLVE_WIDE 256

/* Floats of an ellipsoid in the solver (kernels/solve.cl): its factor L, and the lower triangle of
 * its 10 x 10 block by rows. */
#define OV_SOLVE_FACTOR 6
#define OV_SOLVE_BLOCK 55

/* Blocks of rays that make up a pack, steps of a ray within a slab of depth, and the depth of a ray
 * that meets nothing (kernels/render.cl). */
#define OV_BLOCK_X 4
#define OV_BLOCK_Y 4
#define OV_SLAB_STEPS 4
#define OV_NOWHERE (-1e30f)

/* Bytes of a case of marching cubes: the number of its triangles, then three edges for each
 * (host/mesh/case_table.h, kernels/march.cl). */
#define OV_CASE_BYTES 16

/* Triangles in a leaf of the tree over a mesh, and floats of each (kernels/distance.cl). */
#define OV_LEAF 16
#define OV_TRIANGLE 9

/* One ellipsoid as the kernels see it: 2^(log2_amplitude - q(z)), q(z) = z^T A z with A already
 * multiplied by log2(e). Coordinates are relative to the points' origin, in angstrom. A float of
 * them is too coarse far from that origin, so the centre is a float and what that float leaves: see
 * ov_from_pack(). 64 bytes, a line of most caches. */
typedef struct ov_term {
    ov_f32 x, y, z; /* centre, to the nearest float */
    ov_f32 log2_amplitude;
    ov_f32 rest_x, rest_y, rest_z; /* of the centre */
    ov_f32 padding;
    ov_f32 xx, xy, xz, yy, yz, zz; /* A, off-diagonals doubled: q = xx x^2 + xy x y + ... */
    ov_f32 reach;                  /* largest q within the cut-off; negative: reaches nothing */
    ov_f32 skin;                   /* angstrom by which lists let it move, beyond their own skin */
} OV_ALIGNED(16) ov_term;

/* A tree of boxes over consecutive leaves: level 0 holds the leaves, each level above one box per
 * group of OV_GROUP below. Boxes are stored by group as OV_GROUP values each of low x, low y, low
 * z, high x, high y, high z; absent boxes are empty (low > high). */
typedef struct ov_tree {
    ov_u32 levels;
    ov_u32 boxes[OV_LEVELS];  /* number of boxes of a level */
    ov_u32 groups[OV_LEVELS]; /* index of a level's first group */
    ov_u32 padding;
} ov_tree;

#endif
