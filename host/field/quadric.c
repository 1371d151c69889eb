#include "field/quadric.h"

#include <math.h>

/* Annihilates a[p][q] by a turn of the axes p and q; v's rows turn with them. */
static void jacobi_turn(double a[3][3], double v[3][3], int p, int q) {
    if (a[p][q] == 0.0)
        return;
    const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    const double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
    const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
    for (int k = 0; k < 3; ++k) {
        const double kp = a[k][p], kq = a[k][q];
        a[k][p] = c * kp - s * kq;
        a[k][q] = s * kp + c * kq;
    }
    for (int k = 0; k < 3; ++k) {
        const double pk = a[p][k], qk = a[q][k];
        a[p][k] = c * pk - s * qk;
        a[q][k] = s * pk + c * qk;
        const double vp = v[p][k], vq = v[q][k];
        v[p][k] = c * vp - s * vq;
        v[q][k] = s * vp + c * vq;
    }
}

void ov_symmetric_axes(double a[3][3], double value[3], double axes[3][3]) {
    double v[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (int sweep = 0; sweep < 12; ++sweep) {
        jacobi_turn(a, v, 0, 1);
        jacobi_turn(a, v, 0, 2);
        jacobi_turn(a, v, 1, 2);
    }
    int order[3] = {0, 1, 2};
    for (int k = 0; k < 2; ++k)
        for (int j = 0; j < 2; ++j)
            if (a[order[j]][order[j]] < a[order[j + 1]][order[j + 1]]) {
                const int swap = order[j];
                order[j] = order[j + 1];
                order[j + 1] = swap;
            }
    for (int p = 0; p < 3; ++p) {
        value[p] = a[order[p]][order[p]];
        for (int k = 0; k < 3; ++k)
            axes[p][k] = v[order[p]][k];
    }
}

void ov_quadratic_form(double r[3][3], const double decay[3], double a[6]) {
    static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int k = 0; k < 6; ++k) {
        a[k] = 0.0;
        for (int p = 0; p < 3; ++p)
            a[k] += decay[p] * r[p][row[k]] * r[p][column[k]];
    }
}

void ov_quadric_move(const ov_quadric *quadric, const ov_rigid *rigid, ov_quadric *moved) {
    const double *const a = quadric->a;
    const double whole[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    double left[3][3], turned[3][3]; /* R A, and R A R^T */
    for (int j = 0; j < 3; ++j) {    /* A is symmetric: its rows are its columns */
        double column[3];
        ov_rigid_turn(rigid, whole[j], column);
        for (int i = 0; i < 3; ++i)
            left[i][j] = column[i];
    }
    for (int i = 0; i < 3; ++i)
        ov_rigid_turn(rigid, left[i], turned[i]);
    const ov_quadric made = {
        .amplitude = quadric->amplitude,
        .a = {turned[0][0], turned[0][1], turned[0][2], turned[1][1], turned[1][2], turned[2][2]}};
    double centre[3];
    ov_rigid_move(rigid, quadric->centre, centre);
    *moved = made;
    for (int k = 0; k < 3; ++k)
        moved->centre[k] = centre[k];
}

void ov_quadric_of_atom(const double xyzr[4], double d, ov_quadric *quadric) {
    quadric->amplitude = exp(d * xyzr[3] * xyzr[3]);
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = xyzr[k];
    quadric->a[0] = quadric->a[3] = quadric->a[5] = d;
    quadric->a[1] = quadric->a[2] = quadric->a[4] = 0.0;
}

double ov_quadric_log_value(const ov_quadric *quadric, const double at[3]) {
    const double *const a = quadric->a;
    const double x = at[0] - quadric->centre[0], y = at[1] - quadric->centre[1],
                 z = at[2] - quadric->centre[2];
    return log(quadric->amplitude) - (a[0] * x * x + a[3] * y * y + a[5] * z * z +
                                      2.0 * (a[1] * x * y + a[2] * x * z + a[4] * y * z));
}

/* Eigenvalues below this share of A's trace are all rounding. */
#define SHARE_LEAST 1e-14

/* The largest that the half-widths can be: along the longest axis. */
static double longest_reach(const double a[6], double q) {
    double matrix[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    double decay[3], axes[3][3];
    const double trace = a[0] + a[3] + a[5];
    ov_symmetric_axes(matrix, decay, axes);
    return sqrt(q / fmax(decay[2] - SHARE_LEAST * trace, SHARE_LEAST * trace));
}

/* A plane with normal n touches z^T A z = q at sqrt(q n^T A^-1 n). The inverse of a long needle's A
 * is all rounding, so there the longest axis bounds all three. */
bool ov_quadric_reach(const ov_quadric *quadric, double floor, double half[3]) {
    const double *const a = quadric->a; /* xx, xy, xz, yy, yz, zz */
    const double q = log(quadric->amplitude / floor);
    if (!(q > 0.0))
        return false;
    const double cofactor[3] = {a[3] * a[5] - a[4] * a[4], a[0] * a[5] - a[2] * a[2],
                                a[0] * a[3] - a[1] * a[1]};
    const double determinant = a[0] * cofactor[0] + a[1] * (a[2] * a[4] - a[1] * a[5]) +
                               a[2] * (a[1] * a[4] - a[2] * a[3]);
    const double trace = a[0] + a[3] + a[5];
    const bool rounded = !(determinant > 1e-9 * trace * trace * trace);
    const double longest = rounded ? longest_reach(a, q) : 0.0;
    for (int axis = 0; axis < 3; ++axis)
        half[axis] = (1.0 + 1e-6) * (rounded ? longest : sqrt(q * cofactor[axis] / determinant));
    return true;
}

bool ov_quadric_meets(const ov_quadric *quadric, double floor, const double low[3],
                      const double high[3]) {
    double half[3];
    if (!ov_quadric_reach(quadric, floor, half))
        return false;
    for (int k = 0; k < 3; ++k)
        if (quadric->centre[k] + half[k] < low[k] || quadric->centre[k] - half[k] > high[k])
            return false;
    return true;
}
