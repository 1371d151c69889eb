/* A script for PyMOL that loads one compiled graphics object (PyMOL's example cgo08.py): an
 * ELLIPSOID is its centre, a size, and three orthogonal axes of length 1 or less, which the size
 * multiplies; so the size is the longest semi-axis. */
#include "write/export.h"

#include "base/progress.h"

#include <math.h>

static void write_ellipsoid(const ov_solid *s, FILE *stream) {
    const double size = fmax(s->semi[0], fmax(s->semi[1], s->semi[2]));
    fprintf(stream, "    ELLIPSOID, %.7g, %.7g, %.7g, %.7g,", s->centre[0], s->centre[1],
            s->centre[2], size);
    for (int p = 0; p < 3; p++) {
        const double length = s->semi[p] / size;
        fprintf(stream, " %.7g, %.7g, %.7g,", length * s->axis[p][0], length * s->axis[p][1],
                length * s->axis[p][2]);
    }
    putc('\n', stream);
}

ovoid_status ov_write_pymol(ovoid_context *context, const ovoid_model *model,
                            const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_ellipsoid *ellipsoids = ovoid_model_ellipsoids(model);
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
    for (size_t i = 0; i < ovoid_model_size(model) && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, ovoid_model_size(model)));
        ov_solid s;
        ov_solid_of_ellipsoid(&ellipsoids[i], drawing->isovalue, &s);
        write_ellipsoid(&s, stream);
    }
    /* The structure often has the same name, and an object of that name would be replaced. */
    fprintf(stream, "]\ncmd.load_cgo(ellipsoids, '%s_ellipsoids')\n", drawing->title);
cleanup:
    return status;
}
