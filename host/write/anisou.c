/* Pseudo-atoms of a PDB file with ANISOU records ("PDB File Format", version 3.30), which programs
 * that show structures draw as ellipsoids: one Gaussian's covariance U is drawn where it holds a
 * probability, of 50 % unless told otherwise, 1.5382 standard deviations along each axis. U here is
 * such that this is the ellipsoid at the isovalue: its semi-axes are 1.5382 times the square roots
 * of U's eigenvalues. Units of 1e-4 angstrom^2; the B-factor is 8 pi^2 / 3 times U's trace.
 *
 * Chains have 9999 pseudo-atoms each, and begin again after 62 of them, numbers after 99999. */
#include "write/export.h"

#include "field/quadric.h"

#include <math.h>

/* Where a normal distribution in three dimensions holds one half. */
#define HALF_RADIUS 1.5381722544550522

enum { RESIDUES = 9999, SERIALS = 99999 };

static ovoid_status write_atom(const ov_drawn *drawn) {
    static const char chains[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";
    static const double pi = 3.14159265358979323846;
    const ov_solid *const s = &drawn->solid;
    const size_t index = drawn->index;
    const int serial = (int)(index % SERIALS) + 1, residue = (int)(index % RESIDUES) + 1;
    const char chain = chains[index / RESIDUES % (sizeof chains - 1)];
    double axes[3][3], variance[3], u[6];
    for (int p = 0; p < 3; p++) {
        variance[p] = pow(s->semi[p] / HALF_RADIUS, 2.0);
        for (int k = 0; k < 3; k++)
            axes[p][k] = s->axis[p][k];
        if (variance[p] >= 999.0 || fabs(s->centre[p]) >= 999.0)
            return ov_fail(drawn->context, OVOID_ERROR_LIMIT,
                           "ellipsoid %zu is too large or too far from the origin for the columns "
                           "of a PDB file: write .cif",
                           index + 1);
    }
    ov_quadratic_form(axes, variance, u);
    const double b = 8.0 * pi * pi / 3.0 * (u[0] + u[3] + u[5]);
    fprintf(drawn->stream, "HETATM%5d  C   ELL %c%4d    %8.3f%8.3f%8.3f  1.00%6.2f           C\n",
            serial, chain, residue, s->centre[0], s->centre[1], s->centre[2], fmin(b, 999.99));
    fprintf(drawn->stream, "ANISOU%5d  C   ELL %c%4d  %7ld%7ld%7ld%7ld%7ld%7ld       C\n", serial,
            chain, residue, lround(1e4 * u[0]), lround(1e4 * u[3]), lround(1e4 * u[5]),
            lround(1e4 * u[1]), lround(1e4 * u[2]), lround(1e4 * u[4]));
    return OVOID_OK;
}

ovoid_status ov_write_anisou(ovoid_context *context, const ovoid_model *model,
                             const ov_drawing *drawing, FILE *stream) {
    fprintf(stream,
            "REMARK   3 OVOID %s: %zu ELLIPSOIDS AS PSEUDO-ATOMS. DRAWN AT A PROBABILITY\n"
            "REMARK   3 OF 50 %% THEY ARE THE ELLIPSOIDS AT ISOVALUE %.6g.\n",
            ovoid_version(), ovoid_model_size(model), drawing->isovalue);
    const ovoid_status status = ov_write_each(context, model, drawing, write_atom, stream);
    if (status == OVOID_OK)
        fputs("END\n", stream);
    return status;
}
