#include "picture/camera.h"

#include <math.h>
#include <string.h>

/* Part of the picture's sides that stays free. */
#define MARGIN 0.035

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static bool normalize(double v[3]) {
    const double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(largest > 0.0))
        return false;
    for (int k = 0; k < 3; ++k)
        v[k] /= largest;
    const double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; ++k)
        v[k] /= length;
    return true;
}

/* ---- principal axes ----------------------------------------------------------------------- */

static void covariance(const ov_quadric *quadrics, size_t count, double m[3][3]) {
    double mean[3] = {0.0, 0.0, 0.0};
    memset(m, 0, 9 * sizeof m[0][0]);
    for (size_t i = 0; i < count; ++i)
        for (int k = 0; k < 3; ++k)
            mean[k] += quadrics[i].centre[k] / (double)count;
    for (size_t i = 0; i < count; ++i)
        for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
                m[j][k] += (quadrics[i].centre[j] - mean[j]) * (quadrics[i].centre[k] - mean[k]);
}

/* Unit vectors, largest variance first, each with its largest component positive. */
static void principal_axes(const ov_quadric *quadrics, size_t count, double axes[3][3]) {
    double m[3][3], variance[3], vectors[3][3];
    covariance(quadrics, count, m);
    ov_symmetric_axes(m, variance, vectors);
    for (int i = 0; i < 3; ++i) {
        const double *const v = vectors[i];
        int largest = 0;
        for (int k = 1; k < 3; ++k)
            largest = fabs(v[k]) > fabs(v[largest]) + 1e-9 ? k : largest;
        for (int k = 0; k < 3; ++k)
            axes[i][k] = v[largest] < 0.0 ? -v[k] : v[k];
    }
}

/* ---- the camera --------------------------------------------------------------------------- */

/* v without its part along unit vector n; false if little is left. */
static bool flatten(const double v[3], const double n[3], double out[3]) {
    const double along = dot(v, n);
    for (int k = 0; k < 3; ++k)
        out[k] = v[k] - along * n[k];
    return dot(out, out) > 1e-6 && normalize(out);
}

/* Turns the view by angle about the screen's axis `about`. */
static void turn(double axis[3][3], int about, double angle) {
    const int p = (about + 1) % 3, q = (about + 2) % 3;
    const double c = cos(angle), s = sin(angle);
    for (int k = 0; k < 3; ++k) {
        /* The camera moves one way so that the molecule turns the other. */
        const double vp = axis[p][k], vq = axis[q][k];
        axis[p][k] = c * vp - s * vq;
        axis[q][k] = s * vp + c * vq;
    }
}

void ov_camera_aim(ov_camera *camera, const ov_quadric *quadrics, size_t count,
                   const ovoid_picture_options *options) {
    double principal[3][3], eye[3], *const right = camera->axis[0], *const up = camera->axis[1];
    *camera = (ov_camera){.pixel = 1.0};
    principal_axes(quadrics, count, principal);
    memcpy(eye, options->direction, sizeof eye);
    if (!normalize(eye))
        memcpy(eye, principal[2], sizeof eye);
    const bool upright = options->height > options->width;
    double *const longer = upright ? up : right, *const shorter = upright ? right : up;
    if (!flatten(principal[0], eye, longer) && !flatten(principal[1], eye, longer))
        flatten(principal[2], eye, longer);
    if (upright)
        cross(longer, eye, shorter);
    else
        cross(eye, longer, shorter);
    memcpy(camera->axis[2], eye, sizeof eye);
    for (int k = 0; k < 3; ++k)
        turn(camera->axis, k, options->rotation[k]);
}

void ov_camera_frame(ov_camera *camera, const ov_extent *extent, double width, double height,
                     const ovoid_picture_options *options) {
    double middle[3] = {0.0, 0.0, 0.0}, half[3] = {1.0, 1.0, 1.0};
    for (int k = 0; k < 3; ++k)
        if (extent->low[k] <= extent->high[k]) {
            middle[k] = 0.5 * (extent->low[k] + extent->high[k]);
            half[k] = fmax(0.5 * (extent->high[k] - extent->low[k]), 1e-3);
        }
    const bool given = isfinite(options->centre[0]) && isfinite(options->centre[1]) &&
                       isfinite(options->centre[2]);
    for (int k = 0; k < 3; ++k)
        camera->centre[k] = given
                                ? options->centre[k]
                                : middle[0] * camera->axis[0][k] + middle[1] * camera->axis[1][k] +
                                      middle[2] * camera->axis[2][k];
    const double free = 1.0 - 2.0 * MARGIN;
    camera->pixel = 2.0 * fmax(half[0] / (free * width), half[1] / (free * height));
    if (options->across > 0.0)
        camera->pixel = options->across / options->width;
    const double shift = middle[2] - dot(camera->centre, camera->axis[2]);
    camera->near = shift + half[2];
    camera->far = shift - half[2];
}

ov_quadric ov_camera_see(const ov_camera *camera, const ov_quadric *quadric) {
    const double *const a = quadric->a;
    const double full[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
    ov_quadric seen = {.amplitude = quadric->amplitude};
    double offset[3];
    for (int k = 0; k < 3; ++k)
        offset[k] = quadric->centre[k] - camera->centre[k];
    for (int k = 0; k < 3; ++k)
        seen.centre[k] = dot(camera->axis[k], offset);
    for (int k = 0; k < 6; ++k)
        for (int i = 0; i < 3; ++i)
            seen.a[k] += camera->axis[row[k]][i] * dot(full[i], camera->axis[column[k]]);
    return seen;
}

/* Diagonal of A's inverse. */
static void inverse_diagonal(const double a[6], double inverse[3]) {
    const double minor[3] = {a[3] * a[5] - a[4] * a[4], a[0] * a[5] - a[2] * a[2],
                             a[0] * a[3] - a[1] * a[1]};
    const double determinant =
        a[0] * minor[0] + a[1] * (a[2] * a[4] - a[1] * a[5]) + a[2] * (a[1] * a[4] - a[2] * a[3]);
    for (int k = 0; k < 3; ++k)
        inverse[k] = determinant > 0.0 ? fmax(minor[k] / determinant, 0.0) : 0.0;
}

ov_extent ov_extent_of(const ov_quadric *quadrics, size_t count, double level) {
    ov_extent extent;
    for (int k = 0; k < 3; ++k) {
        extent.low[k] = INFINITY;
        extent.high[k] = -INFINITY;
    }
    for (size_t i = 0; i < count; ++i) {
        double inverse[3];
        const double q = log(quadrics[i].amplitude / level);
        if (!(q >= 0.0))
            continue;
        inverse_diagonal(quadrics[i].a, inverse);
        for (int k = 0; k < 3; ++k) {
            const double half = sqrt(q * inverse[k]);
            extent.low[k] = fmin(extent.low[k], quadrics[i].centre[k] - half);
            extent.high[k] = fmax(extent.high[k], quadrics[i].centre[k] + half);
        }
    }
    return extent;
}
