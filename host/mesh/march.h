/*
 * Marching cubes on the device: from the terms of a field to a mesh.
 */
#ifndef OV_MARCH_H
#define OV_MARCH_H

#include "base/box.h"
#include "mesh/mesh.h"
#include "mesh/pieces.h"
#include "ovoid/ovoid.h"

/* Lattice points of a piece, per axis, at most: eight million, 75 MB on the device. Multiples of
 * the bricks' sides, and at most 256, which is what the kernels' names of edges hold. Each piece
 * takes some twenty launches and half a dozen round trips, so that few large ones cost less. */
#define OV_MARCH_PIECE                                                                             \
    { 256, 256, 128 }

/* A vertex keeps this far from the ends of its edge, in lattice steps (see kernels/march.cl). */
#define OV_EDGE_MARGIN 7.62939453125e-6

/* Terms count where they are at least this share of the isovalue, unless a marcher is told another.
 */
#define OV_MARCH_CUTOFF 1e-7

/* The mesh of phi = isovalue. Vertices are numbered piece by piece from the highest piece down, in
 * a piece along a space-filling curve of its bricks. options are valid; limit as OV_MARCH_PIECE, or
 * less in tests. OVOID_ERROR_EMPTY when no lattice point is inside. */
ovoid_status ov_march(ovoid_context *context, const ov_body *bodies, size_t count,
                      const ovoid_mesh_options *options, const uint64_t limit[3],
                      ovoid_mesh **mesh);

/* As ov_march(), a light mesh (see mesh.h) about this origin. The watch is asked
 * before each piece; where it is NULL, the context. */
ovoid_status ov_march_light(ovoid_context *context, const ov_body *bodies, size_t count,
                            const ovoid_mesh_options *options, const uint64_t limit[3],
                            const double origin[3], const ov_watch *watch, ovoid_mesh **mesh);

/* What meshing takes of the device and of memory, for one mesh after the other: pays where their
 * lattices are cut alike, as those of a model that changes here and there. */
typedef struct ov_marcher ov_marcher;
ovoid_status ov_marcher_create(ovoid_context *context, ov_marcher **marcher);
void ov_marcher_destroy(ov_marcher **marcher);

/* The next meshes have pieces a little larger than the last one, where that is enough for them:
 * then what depends on the size of pieces is not made anew each time. Nothing else of the last one
 * stays: the lists of a molecule's atoms take far more memory than those of its models. */
void ov_marcher_stay(ov_marcher *marcher);

/* What is launched for the next meshes does not go with those before: of them, only memory and the
 * size of pieces stays. */
void ov_marcher_begin(ov_marcher *marcher);

/* The next meshes end at this box, which may be endless, or up to two steps beyond, and are open
 * there: what they have is what the whole mesh has, but for specks beside the end. NULL: they are
 * whole. */
void ov_marcher_clip(ov_marcher *marcher, const double low[3], const double high[3]);

/* Where the lattice of the last one ended, angstrom: what is open there has vertices in these
 * planes, and nothing has any beyond but specks. */
ov_box ov_marcher_ends(const ov_marcher *marcher);

/* Terms count in the next meshes where they are at least this share of the isovalue. */
void ov_marcher_cut_off(ov_marcher *marcher, double share);

/* As those two, in pieces of OV_MARCH_PIECE, or of an eighth of that if the mesh is clipped, and
 * with the specks (specks.h). The full one is kept in
 * the store, which may be NULL, and shares it. The light one knows its components only after
 * ov_mesh_finish(), so that the device can have something to do meanwhile; normals: whether it is
 * to have them. */
ovoid_status ov_mesh_bodies(ovoid_context *context, ov_store *store, const ov_body *bodies,
                            size_t count, const ovoid_mesh_options *options, ovoid_mesh **mesh);
ovoid_status ov_mesh_bodies_light(ovoid_context *context, ov_marcher *marcher,
                                  const ov_body *bodies, size_t count,
                                  const ovoid_mesh_options *options, const double origin[3],
                                  const ov_watch *watch, bool normals, ovoid_mesh **mesh);

#endif
