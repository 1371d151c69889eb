/* BILD, for ChimeraX (its user documentation, "BILD Format"): each ellipsoid is a unit sphere that
 * is scaled, rotated and moved. A transformation applies to what has been transformed by those that
 * follow it, so the last comes first. */
#include "write/export.h"

static ovoid_status write_sphere(const ov_drawn *drawn) {
    const ov_solid *const s = &drawn->solid;
    double vector[3], angle;
    ov_solid_rotation(s, vector, &angle);
    fprintf(drawn->stream,
            ".note ellipsoid %zu, amplitude %.4g\n"
            ".translate %.7g %.7g %.7g\n"
            ".rotate %.7g %.7g %.7g %.7g\n"
            ".scale %.7g %.7g %.7g\n"
            ".sphere 0 0 0 1\n"
            ".pop\n.pop\n.pop\n",
            drawn->index + 1, drawn->ellipsoid->amplitude, s->centre[0], s->centre[1], s->centre[2],
            angle, vector[0], vector[1], vector[2], s->semi[0], s->semi[1], s->semi[2]);
    return OVOID_OK;
}

ovoid_status ov_write_bild(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, FILE *stream) {
    fprintf(stream,
            ".comment Ovoid %s, lengths in angstrom, ellipsoids at isovalue %.9g\n"
            ".color %.4g %.4g %.4g\n"
            ".transparency %.4g\n",
            ovoid_version(), drawing->isovalue, drawing->colour[0], drawing->colour[1],
            drawing->colour[2], 1.0 - drawing->opacity);
    return ov_write_each(context, model, drawing, write_sphere, stream);
}
