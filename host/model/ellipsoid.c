#include "model/ellipsoid.h"

#include <math.h>

void ov_rotation(const double angle[3], double r[3][3]) {
    const double ca = cos(angle[0]), sa = sin(angle[0]);
    const double cb = cos(angle[1]), sb = sin(angle[1]);
    const double cg = cos(angle[2]), sg = sin(angle[2]);
    r[0][0] = cb * cg;
    r[0][1] = -ca * sg - sa * sb * cg;
    r[0][2] = sa * sg - ca * cg * sb;
    r[1][0] = cb * sg;
    r[1][1] = ca * cg - sa * sb * sg;
    r[1][2] = -sa * cg - ca * sb * sg;
    r[2][0] = sb;
    r[2][1] = cb * sa;
    r[2][2] = ca * cb;
}

/* Where alpha counts only as its sum or difference with gamma it is known to rounding only; gamma
 * is that of R R_x(alpha)^T, so that R is kept all the same. */
void ov_rotation_angles(double r[3][3], double angle[3]) {
    const double cosine = hypot(r[0][0], r[1][0]);
    angle[0] = cosine > 1e-15 ? atan2(r[2][1], r[2][2]) : 0.0;
    angle[1] = atan2(r[2][0], cosine);
    const double c = cos(angle[0]), s = sin(angle[0]);
    angle[2] = atan2(s * r[0][2] - c * r[0][1], c * r[1][1] - s * r[1][2]);
}

void ov_rotation_derivatives(const double angle[3], double dr[3][3][3]) {
    const double ca = cos(angle[0]), sa = sin(angle[0]);
    const double cb = cos(angle[1]), sb = sin(angle[1]);
    const double cg = cos(angle[2]), sg = sin(angle[2]);
    const double alpha[3][3] = {{0.0, sa * sg - ca * sb * cg, ca * sg + sa * cg * sb},
                                {0.0, -sa * cg - ca * sb * sg, -ca * cg + sa * sb * sg},
                                {0.0, cb * ca, -sa * cb}};
    const double beta[3][3] = {{-sb * cg, -sa * cb * cg, -ca * cg * cb},
                               {-sb * sg, -sa * cb * sg, -ca * cb * sg},
                               {cb, -sb * sa, -ca * sb}};
    const double gamma[3][3] = {{-cb * sg, -ca * cg + sa * sb * sg, sa * cg + ca * sg * sb},
                                {cb * cg, -ca * sg - sa * sb * cg, sa * sg - ca * sb * cg},
                                {0.0, 0.0, 0.0}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            dr[0][i][j] = alpha[i][j];
            dr[1][i][j] = beta[i][j];
            dr[2][i][j] = gamma[i][j];
        }
}

void ov_ellipsoid_move(const ovoid_ellipsoid *ellipsoid, const ov_rigid *rigid,
                       ovoid_ellipsoid *moved) {
    double r[3][3], turned[3][3];
    ov_rotation(ellipsoid->angle, r);
    for (int p = 0; p < 3; ++p)
        ov_rigid_turn(rigid, r[p], turned[p]);
    *moved = *ellipsoid;
    ov_rigid_move(rigid, ellipsoid->centre, moved->centre);
    ov_rotation_angles(turned, moved->angle);
}

void ov_quadric_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_quadric *quadric) {
    double r[3][3];
    ov_rotation(ellipsoid->angle, r);
    ov_quadratic_form(r, ellipsoid->decay, quadric->a);
    quadric->amplitude = ellipsoid->amplitude;
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = ellipsoid->centre[k];
}
