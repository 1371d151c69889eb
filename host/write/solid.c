#include "model/ellipsoid.h"
#include "write/export.h"

#include <math.h>

void ov_solid_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, double isovalue, ov_solid *solid) {
    const double level = log(ellipsoid->amplitude / isovalue);
    double r[3][3];
    ov_rotation(ellipsoid->angle, r); /* A = R^T diag(decay) R: the axes are R's rows */
    for (int p = 0; p < 3; p++) {
        solid->centre[p] = ellipsoid->centre[p];
        solid->semi[p] = sqrt((level > 0.0 ? level : log(2.0)) / ellipsoid->decay[p]);
        for (int k = 0; k < 3; k++)
            solid->axis[p][k] = r[p][k] + 0.0; /* no -0, which looks odd in text */
    }
}

/* Through the quaternion, whose largest part is found first: no angle is special. */
void ov_solid_rotation(const ov_solid *solid, double vector[3], double *angle) {
    static const double degrees = 180.0 / 3.14159265358979323846;
    double m[3][3]; /* its columns are the axes */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[i][j] = solid->axis[j][i];
    const double trace = m[0][0] + m[1][1] + m[2][2];
    double w, v[3];
    int i = 0;
    for (int k = 1; k < 3; k++)
        if (m[k][k] > m[i][i])
            i = k;
    if (trace >= m[i][i]) { /* four times the quaternion times its largest part */
        w = 1.0 + trace;
        for (int k = 0; k < 3; k++)
            v[k] = m[(k + 2) % 3][(k + 1) % 3] - m[(k + 1) % 3][(k + 2) % 3];
    } else {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        w = m[k][j] - m[j][k];
        v[i] = 1.0 + m[i][i] - m[j][j] - m[k][k];
        v[j] = m[i][j] + m[j][i];
        v[k] = m[i][k] + m[k][i];
    }
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double sign = w < 0.0 ? -1.0 : 1.0;
    for (int k = 0; k < 3; k++)
        vector[k] = length > 0.0 ? sign * v[k] / length : k == 2;
    *angle = 2.0 * atan2(length, fabs(w)) * degrees;
}
