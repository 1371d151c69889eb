/*
 * The inside of marching cubes: what one mesh is made with, piece by piece of its lattice.
 */
#ifndef OV_MARCHING_H
#define OV_MARCHING_H

#include "field/bricks.h"
#include "mesh/brick_grid.h"
#include "mesh/march.h"

/* Kernels of march.cl. */
enum {
    OV_MARCH_SIGNS,
    OV_MARCH_COUNT,
    OV_MARCH_NUMBER,
    OV_MARCH_GET,
    OV_MARCH_PUT,
    OV_MARCH_VERTICES,
    OV_MARCH_BOXES,
    OV_MARCH_TRIANGLES,
    OV_MARCH_REFINE,
    OV_MARCH_PLACE,
    OV_MARCH_KERNELS
};

/* Values per brick: number of the first vertex, masks along x, y, z. */
#define OV_CROSSING 4

/* What a piece leaves behind for those before it: its faces. */
typedef struct ov_piece_faces {
    float *value;      /* OV_PACK per face brick */
    cl_uint *crossing; /* OV_CROSSING per face brick */
} ov_piece_faces;

/* What is of one mesh comes first, up to the grid; what follows may serve the next. */
struct ov_marcher {
    ov_store *store; /* of the mesh so far; the caller's */
    const ov_body *bodies;
    const ovoid_mesh_options *options;
    const double *origin; /* of the offsets of a light mesh, else NULL */
    bool bare;            /* a light mesh without normals is wanted */
    double cutoff;        /* terms count where they are at least this */
    bool resident;        /* the light mesh so far is on the device, too */
    const ov_watch *watch;
    ov_pieces pieces;
    ov_piece_faces *faces; /* of each piece; empty where not needed, or no longer */
    size_t faces_end;      /* those from here on are gone */
    uint64_t at[3];        /* the current piece */
    double corner[3];
    float largest; /* value met while there was no vertex */

    double *xyz;    /* the mesh so far, */
    float *offsets; /* with these in place of xyz if it is light */
    float *normals;
    uint32_t *triangle;
    uint8_t *edge_of; /* of the mesh's vertices, unless it is light */
    size_t edge_of_capacity, missed;
    size_t xyz_capacity, offsets_capacity, normals_capacity, triangle_capacity;
    size_t vertices, triangles;
    size_t new_vertices, new_triangles; /* of the piece */

    ov_brick_grid grid;
    double clip[2][3];   /* the box that they end at, angstrom, */
    bool clipped;        /* if there is one, */
    ov_box ends;         /* and where the lattice did */
    double share;        /* of the isovalue, from which on terms count; 0: OV_MARCH_CUTOFF */
    uint64_t wanted[3];  /* points of pieces, so that the grid stays; 0: nothing is wanted */
    double grid_spacing; /* angstrom */
    bool ghosts_empty;   /* on the device */
    ov_points points;
    ov_points vertex_points; /* packs of the piece's vertices: their boxes alone */
    ov_terms terms;
    ov_lists lists, vertex_lists; /* of bricks, and of packs of vertices */
    ov_operations operations;
    ov_kernel kernel[OV_MARCH_KERNELS];
    ov_buffer value, sign, crossing, found, box, cases, list, totals, edge, t, normal, corners;
    ov_buffer face_list, ghost_list, place, brick_of, values, crossings;
    ov_buffer placed, placed_normals;          /* vertices of the light mesh, or of the piece */
    size_t placed_vertices, corners_triangles; /* of the last mesh: what the next may have */
    size_t group;
    cl_uint run;

    ov_quadric *quadrics; /* of one piece */
    size_t quadrics_capacity;
    float *ghost_value;
    cl_uint *ghost_crossing;
    cl_uint active; /* entries of march_vertices()'s list */
    cl_uint *edges; /* of the piece's vertices, in packs */
    size_t edges_capacity;
    float *refined;
    size_t refined_capacity;
};

/* ---- a piece of the lattice (march_piece.c) -------------------------------------------------- */

/* What all pieces of a mesh need; m->pieces are known. */
ovoid_status ov_marching_set_up(ovoid_context *context, ov_marcher *m);
void ov_marching_drop_grid(ov_marcher *m);

/* Evaluates the field in a piece, and finds where its edges cross the surface: m->active,
 * m->new_vertices and m->new_triangles. */
ovoid_status ov_marching_evaluate(ovoid_context *context, ov_marcher *m, size_t piece);

/* The last lattice point along each axis, from the piece's first one. */
cl_uint4 ov_marching_last(const ov_marcher *m);

/* Builds lists of the piece's terms, in the memory that they have where there is one (*begin):
 * ov_lists_end() is to follow then. */
ovoid_status ov_marching_begin_lists(ovoid_context *context, ov_marcher *m, ov_lists *lists,
                                     const ov_points *points, bool *begin);

/* Keeps the piece's faces for the neighbours below, which come later. */
ovoid_status ov_marching_keep_faces(ovoid_context *context, ov_marcher *m, size_t piece);
void ov_marching_drop_faces(ov_piece_faces *faces);
/* Drops the faces that no piece up to this one can need. */
void ov_marching_drop_old_faces(ov_marcher *m, size_t piece);

/* ---- its part of the mesh (march_take.c) ----------------------------------------------------- */

/* Puts the vertices of the piece that has been evaluated on the surface, and appends them and its
 * triangles to the mesh. */
ovoid_status ov_marching_take(ovoid_context *context, ov_marcher *m);

/* Makes room for so many in all. */
ovoid_status ov_marching_grow_vertices(ovoid_context *context, ov_marcher *m, size_t total);
ovoid_status ov_marching_grow_triangles(ovoid_context *context, ov_marcher *m, size_t total);

/* Sets a coordinate, number `at` of all vertices', angstrom. */
void ov_marching_put(ov_marcher *m, size_t at, double value);

/* ---- afterwards (march_mend.c) --------------------------------------------------------------- */

/* Adds the pieces of the surface that are small to the lattice of `count` bodies (specks.h). */
ovoid_status ov_marching_add_specks(ovoid_context *context, ov_marcher *m, size_t count);

/* Gives the vertices that have no normal, as where the gradient vanishes, that of their triangles.
 */
ovoid_status ov_marching_mend_normals(ovoid_context *context, ov_marcher *m);

#endif
