#include "fit/motion.h"

#include "fit/adaptive/constants.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- one motion ------------------------------------------------------------------------------ */

static const double *point(const double *xyzr, const uint32_t *pick, size_t n) {
    return xyzr + 4 * (pick ? pick[n] : n);
}

static void mean_of(const double *xyzr, const uint32_t *pick, size_t count, double mean[3]) {
    for (int k = 0; k < 3; ++k) {
        double sum = 0.0;
        for (size_t n = 0; n < count; ++n)
            sum += point(xyzr, pick, n)[k];
        mean[k] = count > 0 ? sum / (double)count : 0.0;
    }
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double c[3]) {
    for (int k = 0; k < 3; ++k)
        c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* Makes v a unit vector perpendicular to `to` (a unit vector, or NULL: to nothing); where v has no
 * such part, some such vector. */
static void straighten(const double *to, double v[3]) {
    const double before = sqrt(dot(v, v));
    for (int turn = 0; to && turn < 2; ++turn) { /* twice is enough for rounding */
        const double part = dot(v, to);
        for (int k = 0; k < 3; ++k)
            v[k] -= part * to[k];
    }
    double length = sqrt(dot(v, v));
    if (!(length > 1e-6 * before)) {
        int least = 0;
        for (int k = 1; k < 3; ++k)
            least = to && fabs(to[k]) < fabs(to[least]) ? k : least;
        for (int k = 0; k < 3; ++k)
            v[k] = (k == least) - (to ? to[k] * to[least] : 0.0);
        length = sqrt(dot(v, v));
    }
    for (int k = 0; k < 3; ++k)
        v[k] /= length;
}

/* The rotation R with the largest trace of R^T h: from the frame of h^T h's axes to that of their
 * images, both right-handed. */
static void nearest_rotation(double h[3][3], double rotation[3][3]) {
    double square[3][3], value[3], v[3][3], u[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            square[i][j] = h[0][i] * h[0][j] + h[1][i] * h[1][j] + h[2][i] * h[2][j];
    ov_symmetric_axes(square, value, v);
    for (int n = 0; n < 2; ++n)
        for (int k = 0; k < 3; ++k)
            u[n][k] = dot(h[k], v[n]);
    if (value[1] <= 1e-12 * value[0]) /* a line: the shortest way */
        memcpy(u[1], v[1], sizeof u[1]);
    if (value[0] <= 0.0)
        memcpy(u[0], v[0], sizeof u[0]);
    straighten(NULL, u[0]);
    straighten(u[0], u[1]);
    cross(u[0], u[1], u[2]);
    cross(v[0], v[1], v[2]);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            rotation[i][j] = u[0][i] * v[0][j] + u[1][i] * v[1][j] + u[2][i] * v[2][j];
}

void ov_motion_of(const double *before, const double *after, const uint32_t *pick, size_t count,
                  ov_motion *motion) {
    double h[3][3] = {{0.0}};
    mean_of(before, pick, count, motion->from);
    mean_of(after, pick, count, motion->to);
    for (size_t n = 0; n < count; ++n) {
        const double *const a = point(before, pick, n), *const b = point(after, pick, n);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                h[i][j] += (b[i] - motion->to[i]) * (a[j] - motion->from[j]);
    }
    nearest_rotation(h, motion->rotation);
}

void ov_motion_apply(const ov_motion *motion, ov_quadric *quadric) {
    const double *const a = quadric->a;
    const double form[3][3] = {{a[0], a[1], a[2]}, {a[1], a[3], a[4]}, {a[2], a[4], a[5]}};
    double from[3], half[3][3];
    int n = 0;
    for (int k = 0; k < 3; ++k)
        from[k] = quadric->centre[k] - motion->from[k];
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = motion->to[k] + dot(motion->rotation[k], from);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            half[i][j] = dot(motion->rotation[i], form[j]); /* form is symmetric */
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j)
            quadric->a[n++] = dot(half[i], motion->rotation[j]);
}

/* ---- a model --------------------------------------------------------------------------------- */

/* The atoms of each ellipsoid one after the other: atom[first[i]] to atom[first[i + 1] - 1]. */
static void sort_by_owner(const uint32_t *owner, size_t atoms, size_t count, size_t *first,
                          uint32_t *atom) {
    memset(first, 0, (count + 2) * sizeof *first);
    for (size_t n = 0; n < atoms; ++n)
        ++first[owner[n] + 2];
    for (size_t i = 2; i < count + 2; ++i)
        first[i] += first[i - 1];
    for (size_t n = 0; n < atoms; ++n)
        atom[first[owner[n] + 1]++] = (uint32_t)n;
}

/* Turns as the atoms about it, and goes where its own have gone; one without any goes with those
 * about it. */
static void move_one(const double *before, const double *after, const ov_motion *whole,
                     const uint32_t *near, size_t near_count, const uint32_t *own, size_t own_count,
                     ov_quadric *quadric) {
    ov_motion motion = *whole;
    if (near_count >= ov_tuned.motion_enough)
        ov_motion_of(before, after, near, near_count, &motion);
    if (own_count > 0) {
        mean_of(before, own, own_count, motion.from);
        mean_of(after, own, own_count, motion.to);
    }
    ov_motion_apply(&motion, quadric);
}

ovoid_status ov_move_with_atoms(ovoid_context *context, const double *before, const double *after,
                                size_t atoms, const uint32_t *owner, ov_quadric *quadrics,
                                size_t count) {
    ovoid_status status = OVOID_OK;
    ov_motion whole;
    ov_grid grid = {0};
    uint32_t near[2 * OV_NEAR_MAX];
    size_t *const first = ov_alloc(context, count + 2, sizeof *first, "owners");
    uint32_t *const atom = ov_alloc(context, atoms, sizeof *atom, "owners");
    if (!first || !atom) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_grid_of(context, before, 4 * sizeof *before, atoms, ov_tuned.motion_about, &grid));
    sort_by_owner(owner, atoms, count, first, atom);
    ov_motion_of(before, after, NULL, atoms, &whole);
    for (size_t i = 0; i < count; ++i) {
        const size_t near_count = ov_grid_near(&grid, quadrics[i].centre, UINT32_MAX, near);
        move_one(before, after, &whole, near, near_count, atom + first[i], first[i + 1] - first[i],
                 &quadrics[i]);
    }
cleanup:
    ov_grid_destroy(&grid);
    free(first);
    free(atom);
    return status;
}
