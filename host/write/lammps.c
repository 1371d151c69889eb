/* LAMMPS data of atom style ellipsoid (its manual, "read_data command" and "atom_style command"):
 * per ellipsoid its type, a flag, a density and its centre, and then its three diameters (not
 * semi-axes) and a quaternion w, x, y, z. The box holds every ellipsoid whole; the density is 1, so
 * that masses are volumes. */
#include "write/export.h"

#include <math.h>

static void widen(const ov_solid *s, double low[3], double high[3]) {
    for (int k = 0; k < 3; k++) {
        double half = 0.0;
        for (int p = 0; p < 3; p++)
            half += pow(s->semi[p] * s->axis[p][k], 2.0);
        low[k] = fmin(low[k], s->centre[k] - sqrt(half));
        high[k] = fmax(high[k], s->centre[k] + sqrt(half));
    }
}

static void write_head(const ovoid_model *model, const ov_drawing *drawing, FILE *stream) {
    const size_t count = ovoid_model_size(model);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        ov_solid s;
        ov_solid_of_ellipsoid(ovoid_model_ellipsoids(model) + i, drawing->isovalue, &s);
        widen(&s, low, high);
    }
    fprintf(stream,
            "Ovoid %s: ellipsoids at isovalue %.9g, lengths in angstrom, diameters\n\n"
            "%zu atoms\n%zu ellipsoids\n1 atom types\n\n",
            ovoid_version(), drawing->isovalue, count, count);
    for (int k = 0; k < 3; k++)
        fprintf(stream, "%.9g %.9g %clo %chi\n", floor(low[k]) - 1.0, ceil(high[k]) + 1.0, 'x' + k,
                'x' + k);
}

static ovoid_status write_centre(const ov_drawn *drawn) {
    const double *const x = drawn->solid.centre;
    fprintf(drawn->stream, "%zu 1 1 1.0 %.10g %.10g %.10g\n", drawn->index + 1, x[0], x[1], x[2]);
    return OVOID_OK;
}

static ovoid_status write_shape(const ov_drawn *drawn) {
    const double *const semi = drawn->solid.semi;
    double q[4];
    ov_solid_quaternion(&drawn->solid, q);
    fprintf(drawn->stream, "%zu %.8g %.8g %.8g %.9g %.9g %.9g %.9g\n", drawn->index + 1,
            2.0 * semi[0], 2.0 * semi[1], 2.0 * semi[2], q[3], q[0], q[1], q[2]);
    return OVOID_OK;
}

ovoid_status ov_write_lammps(ovoid_context *context, const ovoid_model *model,
                             const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    write_head(model, drawing, stream);
    fputs("\nAtoms # ellipsoid\n\n", stream);
    OV_TRY(ov_write_each(context, model, drawing, write_centre, stream));
    fputs("\nEllipsoids\n\n", stream);
    OV_TRY(ov_write_each(context, model, drawing, write_shape, stream));
cleanup:
    return status;
}
