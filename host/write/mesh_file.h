/*
 * The formats of meshes, one file each. Every function writes the whole mesh to a stream, in the
 * order of its vertices and triangles, so that equal meshes give equal bytes. Coordinates are those
 * of the molecule's file, in angstrom, as floats (24 bits: 1e-5 angstrom at 100 angstrom from the
 * origin). A failed write shows in the stream's error flag; the
 * context's progress callback may stop them.
 *
 * The mesh has at least one triangle. The thread's locale is "C".
 */
#ifndef OV_MESH_FILE_H
#define OV_MESH_FILE_H

#include "base/base.h"
#include "ovoid/surface.h"

#include <stdio.h>

ovoid_status ov_write_ply(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_obj(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_stl(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_off(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);
ovoid_status ov_write_glb(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream);

#endif
