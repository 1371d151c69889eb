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

bool ov_twin_system(const double *parameters, size_t count, const double *xyz, const float *weight,
                    const float *u, size_t points, double lambda, double *matrix, double *right) {
    const size_t size = count * OV_FACTOR_PARAMETERS;
    double *const row = calloc(size > 0 ? size : 1, sizeof *row);
    if (!row)
        return false;
    memset(matrix, 0, size * size * sizeof *matrix);
    memset(right, 0, size * sizeof *right);
    for (size_t k = 0; k < points; ++k) {
        ov_twin_jacobian(parameters, count, xyz + 3 * k, row);
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
