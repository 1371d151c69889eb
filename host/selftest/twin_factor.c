#include "selftest/twin_factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Where L's entries stand, in the order of the parameters. */
static const int row_of[6] = {0, 1, 2, 1, 2, 2}, column_of[6] = {0, 0, 0, 1, 1, 2};

static void whole_factor(const double *parameters, double l[3][3]) {
    memset(l, 0, 9 * sizeof(double));
    for (int k = 0; k < 6; ++k)
        l[row_of[k]][column_of[k]] = parameters[OV_FACTOR_L + k];
}

double ov_twin_factor_value(const double parameters[OV_FACTOR_PARAMETERS], const double y[3]) {
    double l[3][3], q = 0.0;
    whole_factor(parameters, l);
    for (int j = 0; j < 3; ++j) {
        double along = 0.0;
        for (int i = 0; i < 3; ++i)
            along += l[i][j] * (y[i] - parameters[OV_FACTOR_CENTRE + i]);
        q += along * along;
    }
    return exp(parameters[OV_FACTOR_AMPLITUDE] - q);
}

/* left right^T */
static void product(double left[3][3], double right[3][3], double out[3][3]) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            out[i][j] = 0.0;
            for (int k = 0; k < 3; ++k)
                out[i][j] += left[i][k] * right[j][k];
        }
}

void ov_twin_factor_map(const double parameters[OV_FACTOR_PARAMETERS],
                        double map[OV_MONOMIALS][OV_FACTOR_PARAMETERS]) {
    double l[3][3], a[3][3];
    memset(map, 0, OV_MONOMIALS * sizeof *map);
    whole_factor(parameters, l);
    product(l, l, a);
    map[0][OV_FACTOR_AMPLITUDE] = 1.0;
    for (int axis = 0; axis < 3; ++axis) /* -q = -z^T A z, dz = -d centre */
        for (int i = 0; i < 3; ++i)
            map[1 + i][OV_FACTOR_CENTRE + axis] = 2.0 * a[i][axis];
    for (int k = 0; k < 6; ++k) {
        double dl[3][3] = {{0.0}}, change[3][3];
        dl[row_of[k]][column_of[k]] = 1.0;
        product(dl, l, change);
        for (int i = 0, m = 4; i < 3; ++i) /* xx, xy, xz, yy, yz, zz */
            for (int j = i; j < 3; ++j, ++m) {
                const double entry = change[i][j] + change[j][i];
                map[m][OV_FACTOR_L + k] = i == j ? -entry : -2.0 * entry;
            }
    }
}

void ov_twin_jacobian(const double *parameters, size_t count, const double y[3], double *row) {
    for (size_t i = 0; i < count; ++i) {
        const double *const own = parameters + i * OV_FACTOR_PARAMETERS;
        double map[OV_MONOMIALS][OV_FACTOR_PARAMETERS], z[3], m[OV_MONOMIALS];
        for (int k = 0; k < 3; ++k)
            z[k] = y[k] - own[OV_FACTOR_CENTRE + k];
        ov_twin_monomials(z, m);
        ov_twin_factor_map(own, map);
        const double value = ov_twin_factor_value(own, y);
        for (int j = 0; j < OV_FACTOR_PARAMETERS; ++j) {
            double polynomial = 0.0;
            for (int n = 0; n < OV_MONOMIALS; ++n)
                polynomial += map[n][j] * m[n];
            row[i * OV_FACTOR_PARAMETERS + (size_t)j] = value * polynomial;
        }
    }
}

void ov_twin_jacobian_images(const double *parameters, size_t count, const ov_rigid *motion,
                             size_t images, const double y[3], double *row, double *work) {
    ov_twin_jacobian(parameters, count, y, row);
    for (size_t g = 0; g < images; ++g) {
        const ov_rigid back = ov_rigid_inverse(&motion[g]);
        double from[3];
        ov_rigid_move(&back, y, from);
        ov_twin_jacobian(parameters, count, from, work);
        for (size_t j = 0; j < count * OV_FACTOR_PARAMETERS; ++j)
            row[j] += work[j];
    }
}

void ov_twin_turn(const double rotation[9], double turn[OV_MONOMIALS][OV_MONOMIALS]) {
    static const int place[3][3] = {{4, 5, 6}, {5, 7, 8}, {6, 8, 9}};
    memset(turn, 0, OV_MONOMIALS * sizeof *turn);
    turn[0][0] = 1.0;
    for (int a = 0; a < 3; ++a) /* z_a becomes sum_c R_ca z_c */
        for (int c = 0; c < 3; ++c)
            turn[1 + c][1 + a] = rotation[3 * c + a];
    for (int a = 0; a < 3; ++a)
        for (int b = a; b < 3; ++b)
            for (int c = 0; c < 3; ++c)
                for (int d = 0; d < 3; ++d)
                    turn[place[c][d]][place[a][b]] += rotation[3 * c + a] * rotation[3 * d + b];
}

bool ov_twin_system(const double *parameters, size_t count, const ov_rigid *motion, size_t images,
                    const double *xyz, const float *weight, const float *u, size_t points,
                    double lambda, double *matrix, double *right) {
    const size_t size = count * OV_FACTOR_PARAMETERS;
    double *const row = calloc(2 * size + 1, sizeof *row);
    if (!row)
        return false;
    memset(matrix, 0, size * size * sizeof *matrix);
    memset(right, 0, size * sizeof *right);
    for (size_t k = 0; k < points; ++k) {
        ov_twin_jacobian_images(parameters, count, motion, images, xyz + 3 * k, row, row + size);
        for (size_t i = 0; i < size; ++i) {
            right[i] -= row[i] * u[k];
            for (size_t j = 0; j <= i; ++j)
                matrix[i * size + j] += weight[k] * row[i] * row[j];
        }
    }
    for (size_t i = 0; i < size; ++i) {
        double *const own = &matrix[i * size + i];
        *own = *own > 0.0 ? *own * (1.0 + lambda) : 1.0;
        for (size_t j = 0; j < i; ++j)
            matrix[j * size + i] = matrix[i * size + j];
    }
    free(row);
    return true;
}

bool ov_twin_solve(double *matrix, size_t size, double *x) {
    for (size_t i = 0; i < size; ++i) {
        double *const row = matrix + i * size;
        for (size_t j = 0; j <= i; ++j) {
            const double *const other = matrix + j * size;
            double sum = row[j];
            for (size_t k = 0; k < j; ++k)
                sum -= row[k] * other[k];
            if (i == j && !(sum > 0.0))
                return false;
            row[j] = i == j ? sqrt(sum) : sum / other[j];
        }
    }
    for (size_t i = 0; i < size; ++i) {
        for (size_t k = 0; k < i; ++k)
            x[i] -= matrix[i * size + k] * x[k];
        x[i] /= matrix[i * size + i];
    }
    for (size_t i = size; i-- > 0;) {
        for (size_t k = i + 1; k < size; ++k)
            x[i] -= matrix[k * size + i] * x[k];
        x[i] /= matrix[i * size + i];
    }
    return true;
}
