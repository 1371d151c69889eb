/* OFF, text: counts of vertices, faces and edges, then both lists, counted from 0 (Geomview's
 * manual, section "OFF Files", which says that the count of edges is not looked at). */
#include "write/mesh_file.h"

#include <inttypes.h>

ovoid_status ov_write_off(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(mesh), triangles = ovoid_mesh_triangles(mesh);
    const double *xyz = ovoid_mesh_xyz(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    const int digits = ov_mesh_digits(mesh);
    fprintf(stream, "OFF\n%zu %zu 0\n", vertices, triangles);
    for (size_t i = 0; i < vertices && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, vertices));
        fprintf(stream, "%.*g %.*g %.*g\n", digits, xyz[3 * i], digits, xyz[3 * i + 1], digits,
                xyz[3 * i + 2]);
    }
    for (size_t i = 0; i < triangles && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, triangles));
        fprintf(stream, "3 %" PRIu32 " %" PRIu32 " %" PRIu32 "\n", corners[3 * i],
                corners[3 * i + 1], corners[3 * i + 2]);
    }
cleanup:
    return status;
}
