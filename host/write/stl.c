/* STL, binary: 80 bytes of text, a count, then per triangle its normal, its corners and two bytes
 * (3D Systems, "StereoLithography Interface Specification", 1989). */
#include "write/bytes.h"
#include "write/mesh_file.h"

#include <math.h>

enum { HEADER = 80 };

/* Unit normal of the flat triangle, 0 where it has no area. */
static void triangle_normal(const double *a, const double *b, const double *c, double normal[3]) {
    double u[3], v[3];
    for (int axis = 0; axis < 3; axis++) {
        u[axis] = b[axis] - a[axis];
        v[axis] = c[axis] - a[axis];
    }
    normal[0] = u[1] * v[2] - u[2] * v[1];
    normal[1] = u[2] * v[0] - u[0] * v[2];
    normal[2] = u[0] * v[1] - u[1] * v[0];
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int axis = 0; axis < 3; axis++)
        normal[axis] = length > 0.0 ? normal[axis] / length : 0.0;
}

ovoid_status ov_write_stl(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t triangles = ovoid_mesh_triangles(mesh);
    const double *xyz = ovoid_mesh_xyz(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    ov_bytes bytes = {.stream = stream};
    static const double zero[3] = {0.0, 0.0, 0.0};
    char header[HEADER + 1] = "";
    if (triangles > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "STL holds 2^32 - 1 triangles at most, the mesh has %zu: write .ply",
                       triangles);
    if (!ov_mesh_floats_suffice(mesh, zero))
        return ov_fail(
            context, OVOID_ERROR_LIMIT,
            "STL has single precision alone, which so far from the origin is too coarse for "
            "this mesh: write .ply, or move the molecule");
    /* Must not begin with "solid", the mark of the text form. */
    snprintf(header, sizeof header, "Ovoid %s, lengths in angstrom", ovoid_version());
    ov_put_text(&bytes, header, HEADER);
    ov_put_u32(&bytes, (uint32_t)triangles);
    for (size_t i = 0; i < triangles && !ferror(stream); i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, triangles));
        const double *at[3];
        double normal[3];
        for (size_t corner = 0; corner < 3; corner++)
            at[corner] = xyz + 3 * (size_t)corners[3 * i + corner];
        triangle_normal(at[0], at[1], at[2], normal);
        for (size_t axis = 0; axis < 3; axis++)
            ov_put_f32(&bytes, (float)normal[axis]);
        for (size_t corner = 0; corner < 3; corner++) {
            float place[3];
            ov_mesh_float_at(mesh, corners[3 * i + corner], zero, place);
            for (size_t axis = 0; axis < 3; axis++)
                ov_put_f32(&bytes, place[axis]);
        }
        ov_put_u16(&bytes, 0);
    }
    ov_bytes_flush(&bytes);
cleanup:
    return status;
}
