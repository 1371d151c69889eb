/* PLY, binary: "The PLY Polygon File Format" (G. Turk, 1994). */
#include "write/bytes.h"
#include "write/mesh_file.h"

#include <inttypes.h>

/* Readers that know no unsigned indices are met as long as possible. */
static const char *index_type(size_t vertices) {
    return vertices <= INT32_MAX ? "int" : "uint";
}

static const double zero[3] = {0.0, 0.0, 0.0};

static void put_place(ov_bytes *bytes, const ovoid_mesh *mesh, size_t vertex, bool floats) {
    const double *xyz = ovoid_mesh_xyz(mesh) + 3 * vertex;
    float at[3];
    ov_mesh_float_at(mesh, vertex, zero, at);
    for (size_t axis = 0; axis < 3; axis++)
        if (floats)
            ov_put_f32(bytes, at[axis]);
        else
            ov_put_f64(bytes, xyz[axis]);
}

static void put_colour(ov_bytes *bytes, const ov_colours *colours, size_t vertex) {
    for (size_t k = 0; colours && k < 3; k++)
        ov_put_u8(bytes, colours->rgb[3 * vertex + k]);
    if (colours && colours->difference)
        ov_put_f32(bytes, colours->difference[vertex]);
}

/* Coordinates are floats, as readers expect, or where these are too coarse doubles. */
ovoid_status ov_write_ply(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    return ov_write_ply_with(context, mesh, NULL, stream);
}

ovoid_status ov_write_ply_with(ovoid_context *context, const ovoid_mesh *mesh,
                               const ov_colours *colours, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(mesh), triangles = ovoid_mesh_triangles(mesh);
    const float *normals = ovoid_mesh_normals(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    const bool floats = ov_mesh_floats_are_fine(mesh, zero);
    const char *const type = floats ? "float" : "double";
    ov_bytes bytes = {.stream = stream};
    fprintf(stream,
            "ply\n"
            "format binary_little_endian 1.0\n"
            "comment Ovoid %s, lengths in angstrom\n"
            "element vertex %zu\n"
            "property %s x\nproperty %s y\nproperty %s z\n"
            "property float nx\nproperty float ny\nproperty float nz\n"
            "%s%s"
            "element face %zu\n"
            "property list uchar %s vertex_indices\n"
            "end_header\n",
            ovoid_version(), vertices, type, type, type,
            colours ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "",
            colours && colours->difference ? "property float quality\n" : "", triangles,
            index_type(vertices));
    for (size_t i = 0; i < vertices && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, vertices));
        put_place(&bytes, mesh, i, floats);
        for (size_t axis = 0; axis < 3; axis++)
            ov_put_f32(&bytes, normals[3 * i + axis]);
        put_colour(&bytes, colours, i);
    }
    for (size_t i = 0; i < triangles && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, triangles));
        ov_put_u8(&bytes, 3);
        for (size_t corner = 0; corner < 3; corner++)
            ov_put_u32(&bytes, corners[3 * i + corner]);
    }
    ov_bytes_flush(&bytes);
cleanup:
    return status;
}
