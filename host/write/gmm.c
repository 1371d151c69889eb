/* The Gaussian mixture of gmconvert and gmfit (T. Kawabata, gmconvert's instructions, "File formats
 * For GMM", and the example in its source file GaussIO.c): per Gaussian its weight W, mean M and
 * covariance CovM, and a HETATM record for programs that show PDB files.
 *
 * a exp(-z^T A z) has the covariance (2 A)^-1 and the integral a sqrt(pi^3 / det A). Weights of a
 * mixture have the sum 1, so a comment keeps the sum of the integrals: the field is that number
 * times the mixture.
 *
 * gmconvert counts the Gaussians by lines that have a blank before their number's four columns and
 * tells them apart by a change of the number. So numbers begin again after 999. */
#include "write/export.h"

#include "base/progress.h"

enum { NUMBERS = 999, RESIDUES = 9999, SERIALS = 99999 };

static void write_gaussian(const ovoid_ellipsoid *e, size_t index, double weight, FILE *stream) {
    const int number = (int)(index % NUMBERS) + 1;
    const double *x = e->centre;
    double c[6];
    ov_ellipsoid_covariance(e, c);
    fprintf(stream, "HETATM%5d  GAU GAU A%4d    %8.3f%8.3f%8.3f%6.3f%6.3f\n",
            (int)(index % SERIALS) + 1, (int)(index % RESIDUES) + 1, x[0], x[1], x[2], weight,
            weight);
    fprintf(stream, "REMARK GAUSS%4d W %.10g\n", number, weight);
    fprintf(stream, "REMARK GAUSS%4d M %.9g %.9g %.9g\n", number, x[0], x[1], x[2]);
    fprintf(stream, "REMARK GAUSS%4d CovM  xx %15.10g xy %15.10g xz %15.10g\n", number, c[0], c[1],
            c[2]);
    fprintf(stream, "REMARK GAUSS%4d CovM  yy %15.10g yz %15.10g zz %15.10g\n", number, c[3], c[4],
            c[5]);
}

ovoid_status ov_write_gmm(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream) {
    ovoid_status status = OVOID_OK;
    const ovoid_ellipsoid *ellipsoids = ovoid_model_ellipsoids(model);
    const size_t count = ovoid_model_size(model);
    double total = 0.0;
    for (size_t i = 0; i < count; i++)
        total += ov_ellipsoid_integral(&ellipsoids[i]);
    fprintf(stream,
            "HEADER 3D Gaussian Mixture Model\n"
            "REMARK COMMAND ovoid export\n"
            "REMARK COMMENT Ovoid %s, lengths in angstrom, isovalue %.9g\n"
            "REMARK COMMENT field = %.9g * mixture\n"
            "REMARK NGAUSS %zu\n",
            ovoid_version(), drawing->isovalue, total, count);
    if (count > NUMBERS)
        fprintf(stream, "REMARK COMMENT numbers begin again after %d\n", NUMBERS);
    for (size_t i = 0; i < count && !ferror(stream); i++) {
        OV_TRY(ov_progress_turn(context, i, count));
        write_gaussian(&ellipsoids[i], i, ov_ellipsoid_integral(&ellipsoids[i]) / total, stream);
    }
    fputs("TER\n", stream);
cleanup:
    return status;
}
