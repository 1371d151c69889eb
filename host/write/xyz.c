/* Extended XYZ, as OVITO reads ellipsoids (its manual, "XYZ file reader" and "Aspherical
 * particles"): semi-axes, and the orientation as a quaternion x, y, z, w, which turns the axes x, y
 * and z to those of the ellipsoid. */
#include "write/export.h"

static ovoid_status write_line(const ov_drawn *drawn) {
    const ov_solid *const s = &drawn->solid;
    double q[4];
    ov_solid_quaternion(s, q);
    fprintf(drawn->stream, "X %.9g %.9g %.9g %.7g %.7g %.7g %.9g %.9g %.9g %.9g %.9g\n",
            s->centre[0], s->centre[1], s->centre[2], s->semi[0], s->semi[1], s->semi[2], q[0],
            q[1], q[2], q[3], drawn->ellipsoid->amplitude);
    return OVOID_OK;
}

ovoid_status ov_write_xyz(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream) {
    fprintf(stream,
            "%zu\n"
            "Properties=species:S:1:pos:R:3:aspherical_shape:R:3:orientation:R:4:amplitude:R:1 "
            "isovalue=%.9g program=\"Ovoid %s\" unit=angstrom\n",
            ovoid_model_size(model), drawing->isovalue, ovoid_version());
    return ov_write_each(context, model, drawing, write_line, stream);
}
