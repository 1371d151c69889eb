/* PLY, binary: "The PLY Polygon File Format" (G. Turk, 1994). */
#include "base/progress.h"
#include "write/bytes.h"
#include "write/mesh_file.h"

#include <inttypes.h>

/* Readers that know no unsigned indices are met as long as possible. */
static const char *index_type(size_t vertices) {
    return vertices <= INT32_MAX ? "int" : "uint";
}

ovoid_status ov_write_ply(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(mesh), triangles = ovoid_mesh_triangles(mesh);
    const double *xyz = ovoid_mesh_xyz(mesh);
    const float *normals = ovoid_mesh_normals(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    ov_bytes bytes = {.stream = stream};
    fprintf(stream,
            "ply\n"
            "format binary_little_endian 1.0\n"
            "comment Ovoid %s, lengths in angstrom\n"
            "element vertex %zu\n"
            "property float x\nproperty float y\nproperty float z\n"
            "property float nx\nproperty float ny\nproperty float nz\n"
            "element face %zu\n"
            "property list uchar %s vertex_indices\n"
            "end_header\n",
            ovoid_version(), vertices, triangles, index_type(vertices));
    for (size_t i = 0; i < vertices && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, vertices));
        for (size_t axis = 0; axis < 3; axis++)
            ov_put_f32(&bytes, (float)xyz[3 * i + axis]);
        for (size_t axis = 0; axis < 3; axis++)
            ov_put_f32(&bytes, normals[3 * i + axis]);
    }
    for (size_t i = 0; i < triangles && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, triangles));
        ov_put_u8(&bytes, 3);
        for (size_t corner = 0; corner < 3; corner++)
            ov_put_u32(&bytes, corners[3 * i + corner]);
    }
    ov_bytes_flush(&bytes);
cleanup:
    return status;
}
