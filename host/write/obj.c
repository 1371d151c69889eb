/* Wavefront OBJ, text: v, vn and f lines, vertices counted from 1 (the format's description in
 * Wavefront's Advanced Visualizer manual, appendix B1). */
#include "write/mesh_file.h"

#include <inttypes.h>

ovoid_status ov_write_obj(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(mesh), triangles = ovoid_mesh_triangles(mesh);
    const double *xyz = ovoid_mesh_xyz(mesh);
    const float *normals = ovoid_mesh_normals(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    const int digits = ov_mesh_digits(mesh);
    fprintf(stream, "# Ovoid %s, lengths in angstrom: %zu vertices, %zu triangles\n",
            ovoid_version(), vertices, triangles);
    for (size_t i = 0; i < vertices && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, vertices));
        fprintf(stream, "v %.*g %.*g %.*g\n", digits, xyz[3 * i], digits, xyz[3 * i + 1], digits,
                xyz[3 * i + 2]);
    }
    for (size_t i = 0; i < vertices && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, vertices));
        fprintf(stream, "vn %.5g %.5g %.5g\n", (double)normals[3 * i], (double)normals[3 * i + 1],
                (double)normals[3 * i + 2]);
    }
    for (size_t i = 0; i < triangles && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, triangles));
        uint64_t n[3];
        for (size_t corner = 0; corner < 3; corner++)
            n[corner] = (uint64_t)corners[3 * i + corner] + 1;
        fprintf(stream,
                "f %" PRIu64 "//%" PRIu64 " %" PRIu64 "//%" PRIu64 " %" PRIu64 "//%" PRIu64 "\n",
                n[0], n[0], n[1], n[1], n[2], n[2]);
    }
cleanup:
    return status;
}
