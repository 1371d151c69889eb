/* A command file for ChimeraX (its user documentation, "Command: shape"): each ellipsoid a surface
 * of its own. The rotation is an axis and an angle in degrees. */
#include "write/export.h"

#include <math.h>

static unsigned byte_of(double part) {
    return (unsigned)lround(255.0 * part);
}

static ovoid_status write_command(const ov_drawn *drawn) {
    const ov_solid *const s = &drawn->solid;
    const double *const colour = drawn->drawing->colour;
    double vector[3], angle;
    ov_solid_rotation(s, vector, &angle);
    fprintf(drawn->stream,
            "shape ellipsoid radius %.7g,%.7g,%.7g center %.7g,%.7g,%.7g "
            "rotation %.7g,%.7g,%.7g,%.7g divisions 36 color #%02x%02x%02x%02x name %s_%zu\n",
            s->semi[0], s->semi[1], s->semi[2], s->centre[0], s->centre[1], s->centre[2], vector[0],
            vector[1], vector[2], angle, byte_of(colour[0]), byte_of(colour[1]), byte_of(colour[2]),
            byte_of(drawn->drawing->opacity), drawn->drawing->title, drawn->index + 1);
    return OVOID_OK;
}

ovoid_status ov_write_cxc(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream) {
    fprintf(stream, "# Ovoid %s, lengths in angstrom, ellipsoids at isovalue %.9g\n",
            ovoid_version(), drawing->isovalue);
    return ov_write_each(context, model, drawing, write_command, stream);
}
