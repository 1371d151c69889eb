/* BILD, for ChimeraX (its user documentation, "BILD Format"): each ellipsoid is a unit sphere that
 * is scaled, rotated and moved. A transformation applies to what has been transformed by those that
 * follow it, so the last comes first. */
#include "write/export.h"

#include "base/progress.h"

ovoid_status ov_write_bild(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_ellipsoid *ellipsoids = ovoid_model_ellipsoids(model);
    fprintf(stream,
            ".comment Ovoid %s, lengths in angstrom, ellipsoids at isovalue %.9g\n"
            ".color %.4g %.4g %.4g\n"
            ".transparency %.4g\n",
            ovoid_version(), drawing->isovalue, drawing->colour[0], drawing->colour[1],
            drawing->colour[2], 1.0 - drawing->opacity);
    for (size_t i = 0; i < ovoid_model_size(model) && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, ovoid_model_size(model)));
        ov_solid s;
        double vector[3], angle;
        ov_solid_of_ellipsoid(&ellipsoids[i], drawing->isovalue, &s);
        ov_solid_rotation(&s, vector, &angle);
        fprintf(stream,
                ".note ellipsoid %zu, amplitude %.4g\n"
                ".translate %.7g %.7g %.7g\n"
                ".rotate %.7g %.7g %.7g %.7g\n"
                ".scale %.7g %.7g %.7g\n"
                ".sphere 0 0 0 1\n"
                ".pop\n.pop\n.pop\n",
                i + 1, ellipsoids[i].amplitude, s.centre[0], s.centre[1], s.centre[2], angle,
                vector[0], vector[1], vector[2], s.semi[0], s.semi[1], s.semi[2]);
    }
cleanup:
    return status;
}
