/*
 * The formats of meshes, one file each. Every function writes the whole mesh to a stream, in the
 * order of its vertices and triangles, so that equal meshes give equal bytes. Coordinates are those
 * of the molecule's file, in angstrom. A failed write shows in the stream's error flag; the
 * context's progress callback may stop them.
 *
 * However a format rounds them, no two vertices become one and no triangle loses its area: programs
 * that merge equal vertices find a closed mesh.
 *
 * The mesh has at least one triangle. The thread's locale is "C".
 */
#ifndef OV_MESH_FILE_H
#define OV_MESH_FILE_H

#include "base/progress.h"
#include "mesh/mesh.h"

#include <stdio.h>

/* ---- single precision ----------------------------------------------------------------------- */

/* A vertex as floats relative to an origin, moved by no more than a float's step so as to stay
 * within its edge of the lattice. For meshes whose floats suffice. */
void ov_mesh_float_at(const ovoid_mesh *mesh, size_t vertex, const double origin[3], float at[3]);

/* Whether floats relative to an origin are much finer than the mesh, or fine enough at least to
 * keep vertices apart. */
bool ov_mesh_floats_are_fine(const ovoid_mesh *mesh, const double origin[3]);
bool ov_mesh_floats_suffice(const ovoid_mesh *mesh, const double origin[3]);

/* An origin in the middle of the mesh, in whole angstrom. */
void ov_mesh_middle(const ovoid_mesh *mesh, double middle[3]);

/* Significant digits of text that keep vertices apart. */
int ov_mesh_digits(const ovoid_mesh *mesh);

/* ov_progress_turn() in a loop over a mesh; lets pages of one in files go on the way. */
static inline ovoid_status ov_mesh_turn(ovoid_context *context, const ovoid_mesh *mesh, size_t turn,
                                        size_t total) {
    ov_store_turn(mesh->store, turn);
    return ov_progress_turn(context, turn, total);
}

/* ---- formats ------------------------------------------------------------------------------ */

/* Colours of the vertices: red, green, blue of each (sRGB), and a number that they stand for, which
 * PLY keeps as `quality`; difference may be NULL. */
typedef struct ov_colours {
    const uint8_t *rgb;
    const float *difference;
} ov_colours;

/* colours may be NULL. */
ovoid_status ov_write_ply_with(ovoid_context *context, const ovoid_mesh *mesh,
                               const ov_colours *colours, FILE *stream);
ovoid_status ov_write_glb_with(ovoid_context *context, const ovoid_mesh *mesh,
                               const ov_colours *colours, FILE *stream);

ovoid_status ov_write_ply(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_obj(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_stl(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_off(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_glb(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);

#endif
