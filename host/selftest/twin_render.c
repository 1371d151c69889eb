#include "selftest/twin_render.h"

#include <math.h>

#define STEP 0.01 /* angstrom */

static double term_at(const ov_quadric *q, const double y[3], double slope[3]) {
    const double z[3] = {y[0] - q->centre[0], y[1] - q->centre[1], y[2] - q->centre[2]};
    const double *const a = q->a;
    const double az[3] = {a[0] * z[0] + a[1] * z[1] + a[2] * z[2],
                          a[1] * z[0] + a[3] * z[1] + a[4] * z[2],
                          a[2] * z[0] + a[4] * z[1] + a[5] * z[2]};
    const double e = q->amplitude * exp(-(z[0] * az[0] + z[1] * az[1] + z[2] * az[2]));
    for (int k = 0; k < 3; ++k)
        slope[k] = -2.0 * e * az[k];
    return e;
}

double ov_twin_sum_at(const ov_quadric *quadrics, size_t count, const double y[3]) {
    double sum = 0.0, unused[3];
    for (size_t i = 0; i < count; ++i)
        sum += term_at(&quadrics[i], y, unused);
    return sum;
}

double ov_twin_hit(const ov_quadric *quadrics, size_t count, double level, double x, double y,
                   double front, double back) {
    for (double z = front; z > back; z -= STEP) {
        const double here[3] = {x, y, z};
        if (ov_twin_sum_at(quadrics, count, here) < level)
            continue;
        double outer = z + STEP, inner = z;
        for (int k = 0; k < 40; ++k) {
            const double middle[3] = {x, y, 0.5 * (outer + inner)};
            if (ov_twin_sum_at(quadrics, count, middle) >= level)
                inner = middle[2];
            else
                outer = middle[2];
        }
        return inner;
    }
    return -INFINITY;
}

double ov_twin_hit_single(const ov_quadric *quadrics, size_t count, double level, double x,
                          double y, size_t *which) {
    double first = -INFINITY;
    for (size_t i = 0; i < count; ++i) {
        const ov_quadric *const q = &quadrics[i];
        const double dx = x - q->centre[0], dy = y - q->centre[1], *const a = q->a;
        const double reach = log(q->amplitude / level);
        /* a5 z^2 + 2 tilt z + flat = reach */
        const double tilt = a[2] * dx + a[4] * dy;
        const double flat = a[0] * dx * dx + 2.0 * a[1] * dx * dy + a[3] * dy * dy;
        const double under = tilt * tilt - a[5] * (flat - reach);
        if (!(reach > 0.0) || under < 0.0)
            continue;
        const double z = q->centre[2] + (sqrt(under) - tilt) / a[5];
        if (z > first) {
            first = z;
            *which = i;
        }
    }
    return first;
}

double ov_twin_normal(const ov_quadric *quadrics, size_t count, const double y[3],
                      double normal[3]) {
    double sum[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < count; ++i) {
        double slope[3];
        term_at(&quadrics[i], y, slope);
        for (int k = 0; k < 3; ++k)
            sum[k] += slope[k];
    }
    const double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    for (int k = 0; k < 3; ++k)
        normal[k] = -sum[k] / length;
    return length;
}

static double product(const double a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void ov_twin_light(const double colour[3], const double normal[3], const float key[4],
                   const float fill[4], double ambient, double light[3]) {
    const float middle[3] = {key[0], key[1], key[2] + 1.0f};
    const double length =
        sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
    const double t = fmin(normal[2] / 0.45, 1.0);
    const double edge = 0.55 + 0.45 * t * t * (3.0 - 2.0 * t);
    const double diffuse = key[3] * fmax(product(normal, key), 0.0) +
                           fill[3] * (0.5 + 0.5 * product(normal, fill)) +
                           ambient * (0.75 + 0.25 * normal[1]);
    const double shine = 0.15 * pow(fmax(product(normal, middle) / length, 0.0), 32.0);
    for (int k = 0; k < 3; ++k)
        light[k] = colour[k] * diffuse * edge + shine;
}
