#include "model/factor.h"

#include <math.h>

void ov_factor_of_quadric(const ov_quadric *quadric, double parameters[OV_FACTOR_PARAMETERS]) {
    const double *const a = quadric->a;
    double *const l = parameters + OV_FACTOR_L;
    parameters[OV_FACTOR_AMPLITUDE] = log(quadric->amplitude);
    for (int k = 0; k < 3; ++k)
        parameters[OV_FACTOR_CENTRE + k] = quadric->centre[k];
    l[0] = sqrt(a[0]);
    l[1] = a[1] / l[0];
    l[2] = a[2] / l[0];
    l[3] = sqrt(fmax(a[3] - l[1] * l[1], 1e-14 * a[3]));
    l[4] = (a[4] - l[1] * l[2]) / l[3];
    l[5] = sqrt(fmax(a[5] - l[2] * l[2] - l[4] * l[4], 1e-14 * a[5]));
}

void ov_factor_quadric(const double parameters[OV_FACTOR_PARAMETERS], ov_quadric *quadric) {
    const double *const l = parameters + OV_FACTOR_L;
    quadric->amplitude = exp(parameters[OV_FACTOR_AMPLITUDE]);
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = parameters[OV_FACTOR_CENTRE + k];
    quadric->a[0] = l[0] * l[0];
    quadric->a[1] = l[0] * l[1];
    quadric->a[2] = l[0] * l[2];
    quadric->a[3] = l[1] * l[1] + l[3] * l[3];
    quadric->a[4] = l[1] * l[2] + l[3] * l[4];
    quadric->a[5] = l[2] * l[2] + l[4] * l[4] + l[5] * l[5];
}

/* Eigenvalues in descending order; rows of r are their directions, together a rotation. */
static void eigen(const double form[6], double value[3], double r[3][3]) {
    double a[3][3] = {
        {form[0], form[1], form[2]}, {form[1], form[3], form[4]}, {form[2], form[4], form[5]}};
    ov_symmetric_axes(a, value, r);
    for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        r[2][k] = r[0][i] * r[1][j] - r[0][j] * r[1][i];
    }
}

void ov_ellipsoid_of_quadric(const ov_quadric *quadric, ovoid_ellipsoid *ellipsoid) {
    double r[3][3];
    eigen(quadric->a, ellipsoid->decay, r);
    ov_rotation_angles(r, ellipsoid->angle);
    ellipsoid->amplitude = quadric->amplitude;
    for (int k = 0; k < 3; ++k)
        ellipsoid->centre[k] = quadric->centre[k];
}

/* Exponent at the cut-off; negative where nothing is reached. */
static double reach(const double *parameters, double cutoff) {
    return parameters[OV_FACTOR_AMPLITUDE] - log(cutoff);
}

/* sqrt(q) L^-1, lower triangle, zero where nothing is reached. */
static void hull(const double *parameters, double cutoff, double h[6]) {
    const double *const l = parameters + OV_FACTOR_L;
    const double q = reach(parameters, cutoff), root = q < 0.0 ? 0.0 : sqrt(q);
    h[0] = root / l[0];
    h[3] = root / l[3];
    h[5] = root / l[5];
    h[1] = -l[1] * h[0] / l[3];
    h[4] = -l[4] * h[3] / l[5];
    h[2] = -(l[2] * h[0] + l[4] * h[1]) / l[5];
}

double ov_factor_motion(const double from[OV_FACTOR_PARAMETERS],
                        const double to[OV_FACTOR_PARAMETERS], double cutoff) {
    double before[6], after[6], way = 0.0, growth = 0.0;
    if (reach(from, cutoff) < 0.0 && !(reach(to, cutoff) < 0.0))
        return INFINITY;
    hull(from, cutoff, before);
    hull(to, cutoff, after);
    for (int k = 0; k < 3; ++k) {
        const double step = to[OV_FACTOR_CENTRE + k] - from[OV_FACTOR_CENTRE + k];
        way += step * step;
    }
    for (int k = 0; k < 6; ++k)
        growth += (after[k] - before[k]) * (after[k] - before[k]);
    const double motion = sqrt(way) + sqrt(growth);
    return isfinite(motion) ? motion : INFINITY;
}

double ov_factor_least_decay(const double parameters[OV_FACTOR_PARAMETERS]) {
    ov_quadric quadric;
    double value[3], axes[3][3];
    ov_factor_quadric(parameters, &quadric);
    eigen(quadric.a, value, axes);
    return value[2];
}

/* det A is at most the smallest eigenvalue times (trace / 2)^2, and both come from L: the trace is
 * the sum of its squares. */
bool ov_factor_decays_reach(const double parameters[OV_FACTOR_PARAMETERS], double least) {
    const double *const l = parameters + OV_FACTOR_L;
    const double root = l[0] * l[3] * l[5];
    double half_trace = 0.0;
    for (int k = 0; k < 6; ++k)
        half_trace += 0.5 * l[k] * l[k];
    return root * root >= least * half_trace * half_trace;
}

void ov_factor_bound_decay(double parameters[OV_FACTOR_PARAMETERS], double least) {
    ov_quadric quadric;
    double value[3], axes[3][3];
    const double amplitude = parameters[OV_FACTOR_AMPLITUDE];
    ov_factor_quadric(parameters, &quadric);
    eigen(quadric.a, value, axes);
    if (value[2] >= least)
        return;
    for (int k = 0; k < 3; ++k)
        value[k] = fmax(value[k], least);
    ov_quadratic_form(axes, value, quadric.a);
    ov_factor_of_quadric(&quadric, parameters);
    parameters[OV_FACTOR_AMPLITUDE] = amplitude; /* through exp() and log() it would be rounded */
}
