/*
 * Cavities that may be open. Whether a pocket is a cavity or part of the outer surface is up to its
 * neck, and a lattice tells an open neck from a closed one only where the neck is wider than a
 * step. Of the cavities of ten proteins, meshed at 0.5 angstrom, all 13 whose wall comes within 0.8
 * angstrom of the outer surface are open when meshed at 0.2, and of those within 0.8 to 2 angstrom
 * four are.
 */
#ifndef OV_EXPOSED_H
#define OV_EXPOSED_H

#include "mesh/mesh.h"

/* In lattice steps: what comes nearer than this may hang together. */
#define OV_NECK 2.0

/* Two vertices of different sets that are nearer to each other than `reach`. */
typedef ovoid_status (*ov_near_found)(uint32_t v, uint32_t w, void *user);

/* Finds such pairs, at least one of which is not of the largest set, each of them once or twice.
 * set_of: of each vertex, below `sets`, or OV_NO_SET, which is near nobody. */
#define OV_NO_SET UINT32_MAX
ovoid_status ov_mesh_near_sets(ovoid_context *context, const ovoid_mesh *mesh,
                               const uint32_t *set_of, size_t sets, double reach,
                               ov_near_found found, void *user);

/* Marks the components that are exposed: the outer ones and, where the mesh's spacing is known,
 * cavities that come within OV_NECK steps of one that is. */
ovoid_status ov_mesh_expose(ovoid_context *context, ovoid_mesh *mesh);

#endif
