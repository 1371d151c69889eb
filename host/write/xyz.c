/* Extended XYZ, as OVITO reads ellipsoids (its manual, "XYZ file reader" and "Aspherical
 * particles"): semi-axes, and the orientation as a quaternion x, y, z, w, which turns the axes x, y
 * and z to those of the ellipsoid. */
#include "write/export.h"

#include "base/progress.h"

ovoid_status ov_write_xyz(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const size_t count = ovoid_model_size(model);
    const ovoid_ellipsoid *const ellipsoids = ovoid_model_ellipsoids(model);
    fprintf(stream,
            "%zu\n"
            "Properties=species:S:1:pos:R:3:aspherical_shape:R:3:orientation:R:4:amplitude:R:1 "
            "isovalue=%.9g program=\"Ovoid %s\" unit=angstrom\n",
            count, drawing->isovalue, ovoid_version());
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        ov_solid s;
        double q[4];
        OV_TRY(ov_progress_turn(context, i, count));
        ov_solid_of_ellipsoid(&ellipsoids[i], drawing->isovalue, &s);
        ov_solid_quaternion(&s, q);
        fprintf(stream, "X %.9g %.9g %.9g %.7g %.7g %.7g %.9g %.9g %.9g %.9g %.9g\n", s.centre[0],
                s.centre[1], s.centre[2], s.semi[0], s.semi[1], s.semi[2], q[0], q[1], q[2], q[3],
                ellipsoids[i].amplitude);
    }
cleanup:
    return status;
}
