/* A script for PyMOL that loads one compiled graphics object (PyMOL's example cgo08.py): an
 * ELLIPSOID is its centre, a size, and three orthogonal axes of length 1 or less, which the size
 * multiplies; so the size is the longest semi-axis. */
#include "write/export.h"

#include <math.h>

static ovoid_status write_ellipsoid(const ov_drawn *drawn) {
    const ov_solid *const s = &drawn->solid;
    const double size = fmax(s->semi[0], fmax(s->semi[1], s->semi[2]));
    fprintf(drawn->stream, "    ELLIPSOID, %.7g, %.7g, %.7g, %.7g,", s->centre[0], s->centre[1],
            s->centre[2], size);
    for (int p = 0; p < 3; p++) {
        const double length = s->semi[p] / size;
        fprintf(drawn->stream, " %.7g, %.7g, %.7g,", length * s->axis[p][0], length * s->axis[p][1],
                length * s->axis[p][2]);
    }
    putc('\n', drawn->stream);
    return OVOID_OK;
}

ovoid_status ov_write_pymol(ovoid_context *context, const ovoid_model *model,
                            const ov_drawing *drawing, FILE *stream) {
    fprintf(stream,
            "# Ovoid %s, lengths in angstrom, ellipsoids at isovalue %.9g.\n"
            "# In PyMOL: run FILE\n"
            "from pymol import cmd\n"
            "from pymol.cgo import ALPHA, COLOR, ELLIPSOID\n"
            "\n"
            "ellipsoids = [\n"
            "    ALPHA, %.4g, COLOR, %.4g, %.4g, %.4g,\n",
            ovoid_version(), drawing->isovalue, drawing->opacity, drawing->colour[0],
            drawing->colour[1], drawing->colour[2]);
    const ovoid_status status = ov_write_each(context, model, drawing, write_ellipsoid, stream);
    if (status != OVOID_OK)
        return status;
    /* The structure often has the same name, and an object of that name would be replaced. */
    fprintf(stream, "]\ncmd.load_cgo(ellipsoids, '%s_ellipsoids')\n", drawing->title);
    return OVOID_OK;
}
