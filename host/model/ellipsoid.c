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

void ov_quadric_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_quadric *quadric) {
    double r[3][3];
    ov_rotation(ellipsoid->angle, r);
    ov_quadratic_form(r, ellipsoid->decay, quadric->a);
    quadric->amplitude = ellipsoid->amplitude;
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = ellipsoid->centre[k];
}
