#include "model/chain.h"

#include <math.h>

void ov_l1_ellipsoid(const double parameters[OV_L1_PARAMETERS], ovoid_ellipsoid *ellipsoid) {
    ellipsoid->amplitude = fmax(parameters[OV_L1_C] * parameters[OV_L1_C], OV_L1_AMPLITUDE_MIN);
    for (int p = 0; p < 3; ++p) {
        const double d = parameters[OV_L1_D + p];
        ellipsoid->decay[p] = fmax(d * d, OV_L1_DECAY_MIN);
        ellipsoid->centre[p] = parameters[OV_L1_CENTRE + p];
        ellipsoid->angle[p] = parameters[OV_L1_ANGLE + p];
    }
}

void ov_l1_quadric(const double parameters[OV_L1_PARAMETERS], ov_quadric *quadric) {
    ovoid_ellipsoid ellipsoid;
    ov_l1_ellipsoid(parameters, &ellipsoid);
    ov_quadric_of_ellipsoid(&ellipsoid, quadric);
}

/* diagonal[p] = (Q S R^T)_pp for symmetric S. */
static void diagonal_of_product(double q[3][3], double s[3][3], double r[3][3],
                                double diagonal[3]) {
    for (int p = 0; p < 3; ++p) {
        diagonal[p] = 0.0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                diagonal[p] += q[p][i] * s[i][j] * r[p][j];
    }
}

/* With S = sum u e z z^T: d e / d A_ij = -z_i z_j e gives
 *   d / d d_p   = -2 d_p (R S R^T)_pp
 *   d / d angle = -2 sum_p d_p^2 (dR S R^T)_pp
 * and d e / d mu = 2 A z e, d e / d c = 2 e / c. */
void ov_l1_chain(const double parameters[OV_L1_PARAMETERS], const double moments[10],
                 double gradient[OV_L1_PARAMETERS]) {
    const double c = parameters[OV_L1_C];
    const double *const d = parameters + OV_L1_D;
    double s[3][3] = {{moments[4], moments[5], moments[6]},
                      {moments[5], moments[7], moments[8]},
                      {moments[6], moments[8], moments[9]}};
    double r[3][3], dr[3][3][3], a[6], diagonal[3];
    ovoid_ellipsoid ellipsoid;
    ov_l1_ellipsoid(parameters, &ellipsoid);
    ov_rotation(ellipsoid.angle, r);
    ov_rotation_derivatives(ellipsoid.angle, dr);
    ov_quadratic_form(r, ellipsoid.decay, a);

    gradient[OV_L1_C] = c != 0.0 ? 2.0 * moments[0] / c : 0.0;
    gradient[OV_L1_CENTRE] = 2.0 * (a[0] * moments[1] + a[1] * moments[2] + a[2] * moments[3]);
    gradient[OV_L1_CENTRE + 1] = 2.0 * (a[1] * moments[1] + a[3] * moments[2] + a[4] * moments[3]);
    gradient[OV_L1_CENTRE + 2] = 2.0 * (a[2] * moments[1] + a[4] * moments[2] + a[5] * moments[3]);
    diagonal_of_product(r, s, r, diagonal);
    for (int p = 0; p < 3; ++p)
        gradient[OV_L1_D + p] = -2.0 * d[p] * diagonal[p];
    for (int k = 0; k < 3; ++k) {
        diagonal_of_product(dr[k], s, r, diagonal);
        gradient[OV_L1_ANGLE + k] =
            -2.0 * (ellipsoid.decay[0] * diagonal[0] + ellipsoid.decay[1] * diagonal[1] +
                    ellipsoid.decay[2] * diagonal[2]);
    }
}
