#include "selftest/twin.h"

#include <math.h>
#include <string.h>

#define LOG2_E 1.4426950408889634

static void multiply(double a[3][3], double b[3][3], double product[3][3]) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            product[i][j] = 0.0;
            for (int k = 0; k < 3; ++k)
                product[i][j] += a[i][k] * b[k][j];
        }
}

void ov_twin_rotation(const double angle[3], double r[3][3]) {
    const double a = angle[0], b = angle[1], g = angle[2];
    double rx[3][3] = {{1, 0, 0}, {0, cos(a), -sin(a)}, {0, sin(a), cos(a)}};
    double ry[3][3] = {{cos(b), 0, -sin(b)}, {0, 1, 0}, {sin(b), 0, cos(b)}};
    double rz[3][3] = {{cos(g), -sin(g), 0}, {sin(g), cos(g), 0}, {0, 0, 1}};
    double zy[3][3];
    multiply(rz, ry, zy);
    multiply(zy, rx, r);
}

double ov_twin_ellipsoid(const ovoid_ellipsoid *ellipsoid, const double y[3]) {
    double r[3][3], q = 0.0;
    ov_twin_rotation(ellipsoid->angle, r);
    for (int p = 0; p < 3; ++p) {
        double along = 0.0;
        for (int k = 0; k < 3; ++k)
            along += r[p][k] * (y[k] - ellipsoid->centre[k]);
        q += ellipsoid->decay[p] * along * along;
    }
    return ellipsoid->amplitude * exp(-q);
}

static void offset(const ov_quadric *quadric, const double y[3], double z[3]) {
    for (int k = 0; k < 3; ++k)
        z[k] = y[k] - quadric->centre[k];
}

static void full_matrix(const ov_quadric *quadric, double a[3][3]) {
    a[0][0] = quadric->a[0];
    a[0][1] = a[1][0] = quadric->a[1];
    a[0][2] = a[2][0] = quadric->a[2];
    a[1][1] = quadric->a[3];
    a[1][2] = a[2][1] = quadric->a[4];
    a[2][2] = quadric->a[5];
}

static double form(double a[3][3], const double z[3]) {
    double q = 0.0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            q += a[i][j] * z[i] * z[j];
    return q;
}

double ov_twin_exponent(const ov_quadric *quadric, const double y[3]) {
    double z[3], a[3][3];
    offset(quadric, y, z);
    full_matrix(quadric, a);
    return form(a, z);
}

void ov_twin_monomials(const double z[3], double m[OV_MONOMIALS]) {
    const double values[OV_MONOMIALS] = {
        1.0,         z[0],        z[1],        z[2],        z[0] * z[0],
        z[0] * z[1], z[0] * z[2], z[1] * z[1], z[1] * z[2], z[2] * z[2],
    };
    memcpy(m, values, sizeof values);
}

/* Value of a term at y; *magnified is how many roundings of its exponent weigh on it. */
static double evaluate(const ov_quadric *quadric, const double y[3], double z[3],
                       double *magnified) {
    double a[3][3], terms = 0.0;
    offset(quadric, y, z);
    full_matrix(quadric, a);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            terms += fabs(a[i][j] * z[i] * z[j]);
    *magnified = 1.0 + fabs(log2(quadric->amplitude)) + LOG2_E * terms;
    return quadric->amplitude * exp(-form(a, z));
}

ov_twin_sum ov_twin_field(const ov_quadric *quadrics, size_t count, const double y[3]) {
    ov_twin_sum sum = {0};
    for (size_t i = 0; i < count; ++i) {
        double z[3], magnified;
        const double e = evaluate(&quadrics[i], y, z, &magnified);
        sum.value += e;
        sum.scale += e * magnified;
    }
    return sum;
}

ov_twin_sum ov_twin_field_polynomial(const ov_quadric *quadrics, const float *polynomial,
                                     size_t count, const double y[3]) {
    ov_twin_sum sum = {0};
    for (size_t i = 0; i < count; ++i) {
        double z[3], m[OV_MONOMIALS], magnified;
        const double e = evaluate(&quadrics[i], y, z, &magnified);
        ov_twin_monomials(z, m);
        for (size_t j = 0; j < OV_MONOMIALS; ++j) {
            const double part = e * polynomial[i * OV_MONOMIALS + j] * m[j];
            sum.value += part;
            sum.scale += fabs(part) * magnified;
        }
    }
    return sum;
}

void ov_twin_gradient(const ov_quadric *quadrics, size_t count, const double y[3],
                      ov_twin_sum gradient[3]) {
    memset(gradient, 0, 3 * sizeof *gradient);
    for (size_t i = 0; i < count; ++i) {
        double z[3], a[3][3], magnified;
        const double e = evaluate(&quadrics[i], y, z, &magnified);
        full_matrix(&quadrics[i], a);
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k) {
                const double part = -2.0 * e * a[j][k] * z[k];
                gradient[j].value += part;
                gradient[j].scale += fabs(part) * magnified;
            }
    }
}

void ov_twin_moments(const ov_quadric *quadric, const double *xyz, const double *u, size_t count,
                     ov_twin_sum moments[OV_MONOMIALS]) {
    memset(moments, 0, OV_MONOMIALS * sizeof *moments);
    for (size_t k = 0; k < count; ++k) {
        double z[3], m[OV_MONOMIALS], magnified;
        const double ue = u[k] * evaluate(quadric, xyz + 3 * k, z, &magnified);
        ov_twin_monomials(z, m);
        for (size_t j = 0; j < OV_MONOMIALS; ++j) {
            moments[j].value += ue * m[j];
            moments[j].scale += fabs(ue * m[j]) * magnified;
        }
    }
}

void ov_twin_gram(const ov_quadric *quadric, const double *xyz, const double *w, size_t count,
                  ov_twin_sum gram[OV_GRAM]) {
    memset(gram, 0, OV_GRAM * sizeof *gram);
    for (size_t k = 0; k < count; ++k) {
        double z[3], magnified, power[3][5];
        const double e = evaluate(quadric, xyz + 3 * k, z, &magnified);
        for (int axis = 0; axis < 3; ++axis) {
            power[axis][0] = 1.0;
            for (int n = 1; n <= 4; ++n)
                power[axis][n] = power[axis][n - 1] * z[axis];
        }
        size_t j = 0;
        for (int degree = 0; degree <= 4; ++degree)
            for (int x = degree; x >= 0; --x)
                for (int y = degree - x; y >= 0; --y, ++j) {
                    const double part =
                        w[k] * e * e * power[0][x] * power[1][y] * power[2][degree - x - y];
                    gram[j].value += part;
                    gram[j].scale += fabs(part) * 2.0 * magnified;
                }
    }
}

/* Solves the rows and columns `use` of a x = b (n <= 3) by Gaussian elimination with pivoting. */
static bool solve(double a[3][3], const double b[3], const int *use, int n, double *x) {
    double m[3][4];
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j)
            m[i][j] = a[use[i]][use[j]];
        m[i][n] = b[i];
    }
    for (int column = 0; column < n; ++column) {
        int pivot = column;
        for (int i = column + 1; i < n; ++i)
            if (fabs(m[i][column]) > fabs(m[pivot][column]))
                pivot = i;
        if (m[pivot][column] == 0.0)
            return false;
        for (int j = column; j <= n; ++j) {
            const double swap = m[column][j];
            m[column][j] = m[pivot][j];
            m[pivot][j] = swap;
        }
        for (int i = column + 1; i < n; ++i)
            for (int j = n; j >= column; --j)
                m[i][j] -= m[i][column] / m[column][column] * m[column][j];
    }
    for (int i = n - 1; i >= 0; --i) {
        x[i] = m[i][n];
        for (int j = i + 1; j < n; ++j)
            x[i] -= m[i][j] * x[j];
        x[i] /= m[i][i];
    }
    return true;
}

double ov_twin_least_exponent(const ov_quadric *quadric, const double box[6]) {
    double a[3][3], low[3], high[3], least = INFINITY;
    full_matrix(quadric, a);
    offset(quadric, box, low);
    offset(quadric, box + 3, high);
    for (int code = 0; code < 27; ++code) {
        const int choice[3] = {code % 3, code / 3 % 3, code / 9};
        double z[3] = {0}, b[3], x[3];
        int use[3], n = 0;
        for (int k = 0; k < 3; ++k) {
            if (choice[k] == 2)
                use[n++] = k;
            else
                z[k] = choice[k] ? high[k] : low[k];
        }
        for (int i = 0; i < n; ++i) {
            b[i] = 0.0;
            for (int k = 0; k < 3; ++k)
                if (choice[k] != 2)
                    b[i] -= a[use[i]][k] * z[k];
        }
        if (!solve(a, b, use, n, x))
            continue;
        bool inside = true;
        for (int i = 0; i < n; ++i) {
            z[use[i]] = x[i];
            inside = inside && x[i] >= low[use[i]] && x[i] <= high[use[i]];
        }
        if (inside)
            least = fmin(least, form(a, z));
    }
    return least;
}

double ov_twin_phi(const double *xyzr, size_t atoms, double decay, const double y[3]) {
    double sum = 0.0;
    for (size_t i = 0; i < atoms; ++i) {
        const double *const a = xyzr + 4 * i;
        double square = 0.0;
        for (int k = 0; k < 3; ++k)
            square += (y[k] - a[k]) * (y[k] - a[k]);
        sum += exp(-decay * (square - a[3] * a[3]));
    }
    return sum;
}

double ov_twin_residual(double value, double target, double limit) {
    if (target > limit)
        return value < limit ? value - limit : 0.0;
    return value - target;
}

double ov_twin_accuracy(const double *parameters, size_t ellipsoids, const double *xyz,
                        const double *target, size_t points, double limit) {
    double sum = 0.0;
    for (size_t k = 0; k < points; ++k) {
        double field = 0.0;
        for (size_t i = 0; i < ellipsoids; ++i) {
            const double *const p = parameters + 10 * i;
            const ovoid_ellipsoid ellipsoid = {
                .amplitude = p[0] * p[0],
                .decay = {p[1] * p[1], p[2] * p[2], p[3] * p[3]},
                .centre = {p[4], p[5], p[6]},
                .angle = {p[7], p[8], p[9]},
            };
            field += ov_twin_ellipsoid(&ellipsoid, xyz + 3 * k);
        }
        const double residual = ov_twin_residual(field, target[k], limit);
        sum += residual * residual;
    }
    return sum;
}

double ov_twin_sparsity(const double *parameters, size_t ellipsoids) {
    double sum = 0.0;
    for (size_t i = 0; i < ellipsoids; ++i)
        for (size_t j = 0; j < 4; ++j)
            sum += fabs(parameters[10 * i + j]);
    return sum;
}

void ov_twin_gather(const uint32_t *list, size_t packs, size_t size, const float *all,
                    float *some) {
    for (size_t n = 0; n < packs; ++n)
        for (size_t k = 0; k < size; ++k)
            some[n * size + k] = all[list[n] * size + k];
}

void ov_twin_scatter(const uint32_t *list, size_t packs, size_t size, const float *some,
                     float *all) {
    for (size_t n = 0; n < packs; ++n)
        for (size_t k = 0; k < size; ++k)
            all[list[n] * size + k] = some[n * size + k];
}

double ov_twin_rest(double bound, double value) {
    return fabs(bound) == (double)FLT_MAX ? bound : bound - value;
}
