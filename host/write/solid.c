#include "base/progress.h"
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

ovoid_status ov_write_each(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, ov_drawn_writer write, FILE *stream) {
    const size_t count = ovoid_model_size(model);
    ov_drawn drawn = {.context = context, .drawing = drawing, .stream = stream};
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < count && !ferror(stream) && status == OVOID_OK; i++) {
        drawn.index = i;
        drawn.ellipsoid = ovoid_model_ellipsoids(model) + i;
        ov_solid_of_ellipsoid(drawn.ellipsoid, drawing->isovalue, &drawn.solid);
        status = ov_progress_turn(context, i, count);
        if (status == OVOID_OK)
            status = write(&drawn);
    }
    return status;
}

/* Its largest part is found first: no angle is special. */
void ov_solid_quaternion(const ov_solid *solid, double q[4]) {
    double m[3][3]; /* its columns are the axes */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[i][j] = solid->axis[j][i];
    const double trace = m[0][0] + m[1][1] + m[2][2];
    int i = 0;
    for (int k = 1; k < 3; k++)
        if (m[k][k] > m[i][i])
            i = k;
    if (trace >= m[i][i]) { /* four times the quaternion times its largest part */
        q[3] = 1.0 + trace;
        for (int k = 0; k < 3; k++)
            q[k] = m[(k + 2) % 3][(k + 1) % 3] - m[(k + 1) % 3][(k + 2) % 3];
    } else {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        q[3] = m[k][j] - m[j][k];
        q[i] = 1.0 + m[i][i] - m[j][j] - m[k][k];
        q[j] = m[i][j] + m[j][i];
        q[k] = m[i][k] + m[k][i];
    }
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double signed_length = q[3] < 0.0 ? -length : length;
    for (int k = 0; k < 4; k++)
        q[k] = q[k] / signed_length + 0.0;
}

void ov_solid_rotation(const ov_solid *solid, double vector[3], double *angle) {
    static const double degrees = 180.0 / 3.14159265358979323846;
    double q[4];
    ov_solid_quaternion(solid, q);
    const double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    for (int k = 0; k < 3; k++)
        vector[k] = length > 0.0 ? q[k] / length : k == 2;
    *angle = 2.0 * atan2(length, q[3]) * degrees;
}

double ov_ellipsoid_integral(const ovoid_ellipsoid *e) {
    static const double pi = 3.14159265358979323846;
    return e->amplitude * sqrt(pi / e->decay[0]) * sqrt(pi / e->decay[1]) * sqrt(pi / e->decay[2]);
}

void ov_ellipsoid_covariance(const ovoid_ellipsoid *e, double c[6]) {
    double r[3][3], variance[3];
    ov_rotation(e->angle, r);
    for (int p = 0; p < 3; p++)
        variance[p] = 0.5 / e->decay[p];
    ov_quadratic_form(r, variance, c);
}
