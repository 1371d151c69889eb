#include "mixture/component.h"

#include <float.h>
#include <math.h>

#define PI 3.14159265358979323846

/* S = L diag(1 / r) L^T with L unit lower triangular. Pivots: their smallest share of the diagonal
 * is kept above rounding, so that a very long Gaussian stays one. */
typedef struct factors {
    double r[3];
    double xy, xz, yz; /* L's entries below the diagonal */
} factors;

static inline double pivot(double value, double diagonal) {
    const double least = DBL_EPSILON * diagonal;
    return value > least ? value : least;
}

static inline void factorise(const double s[6], factors *f) {
    f->r[0] = 1.0 / s[0];
    f->xy = s[1] * f->r[0];
    f->xz = s[2] * f->r[0];
    f->r[1] = 1.0 / pivot(s[3] - f->xy * s[1], s[3]);
    const double t = s[4] - f->xz * s[1];
    f->yz = t * f->r[1];
    f->r[2] = 1.0 / pivot(s[5] - f->xz * s[2] - f->yz * t, s[5]);
}

/* 1 / det S */
static inline double inverse_determinant(const factors *f) {
    return f->r[0] * f->r[1] * f->r[2];
}

/* d^T S^-1 d */
static inline double distance(const factors *f, const double d[3]) {
    const double y = d[1] - f->xy * d[0];
    const double z = d[2] - f->xz * d[0] - f->yz * y;
    return d[0] * d[0] * f->r[0] + y * y * f->r[1] + z * z * f->r[2];
}

/* S^-1 = L^-T diag(r) L^-1 */
static void invert(const factors *f, double inverse[6]) {
    const double zx = f->xy * f->yz - f->xz; /* L^-1: rows (1), (-xy, 1), (zx, -yz, 1) */
    inverse[0] = f->r[0] + f->xy * f->xy * f->r[1] + zx * zx * f->r[2];
    inverse[1] = -f->xy * f->r[1] - zx * f->yz * f->r[2];
    inverse[2] = zx * f->r[2];
    inverse[3] = f->r[1] + f->yz * f->yz * f->r[2];
    inverse[4] = -f->yz * f->r[2];
    inverse[5] = f->r[2];
}

/* The two sums that costs take from one Gaussian alone. */
static void complete(ov_component *m, const factors *f) {
    const double inverse = inverse_determinant(f);
    m->density = m->mass * m->mass * sqrt(inverse);
    m->log_volume = -log(inverse);
}

static bool positive_definite(const double a[6]) {
    const double y = a[3] - a[1] * a[1] / a[0];
    const double t = a[4] - a[2] * a[1] / a[0];
    const double z = a[5] - a[2] * a[2] / a[0] - t * t / y;
    return a[0] > 0.0 && y > 0.0 && z > 0.0;
}

bool ov_component_of_quadric(const ov_quadric *quadric, ov_component *component) {
    if (!(quadric->amplitude > 0.0) || !positive_definite(quadric->a))
        return false;
    factors f;
    factorise(quadric->a, &f);
    invert(&f, component->s);
    component->mass = quadric->amplitude * PI * sqrt(PI * inverse_determinant(&f));
    bool finite = isfinite(component->mass) && component->mass > 0.0;
    for (int k = 0; k < 6; ++k) {
        component->s[k] *= 0.5;
        finite = finite && isfinite(component->s[k]);
    }
    for (int k = 0; k < 3; ++k) {
        component->mean[k] = quadric->centre[k];
        finite = finite && isfinite(component->mean[k]);
    }
    factorise(component->s, &f);
    complete(component, &f);
    return finite;
}

void ov_quadric_of_component(const ov_component *component, ov_quadric *quadric) {
    factors f;
    factorise(component->s, &f);
    invert(&f, quadric->a);
    for (int k = 0; k < 6; ++k)
        quadric->a[k] *= 0.5;
    const double two_pi = 2.0 * PI;
    quadric->amplitude = component->mass / two_pi * sqrt(inverse_determinant(&f) / two_pi);
    for (int k = 0; k < 3; ++k)
        quadric->centre[k] = component->mean[k];
}

void ov_component_mean(const ov_component *p, const ov_component *q, double mean[3]) {
    const double share = q->mass / (p->mass + q->mass);
    for (int k = 0; k < 3; ++k)
        mean[k] = p->mean[k] + share * (q->mean[k] - p->mean[k]);
}

/* Covariance of the two together; d = mean of q - mean of p. */
static inline void spread(const ov_component *p, const ov_component *q, const double d[3], double u,
                          double v, double s[6]) {
    const double uv = u * v;
    s[0] = u * p->s[0] + v * q->s[0] + uv * d[0] * d[0];
    s[1] = u * p->s[1] + v * q->s[1] + uv * d[0] * d[1];
    s[2] = u * p->s[2] + v * q->s[2] + uv * d[0] * d[2];
    s[3] = u * p->s[3] + v * q->s[3] + uv * d[1] * d[1];
    s[4] = u * p->s[4] + v * q->s[4] + uv * d[1] * d[2];
    s[5] = u * p->s[5] + v * q->s[5] + uv * d[2] * d[2];
}

void ov_component_merge(const ov_component *p, const ov_component *q, ov_component *merged) {
    const double mass = p->mass + q->mass;
    double d[3];
    for (int k = 0; k < 3; ++k)
        d[k] = q->mean[k] - p->mean[k];
    ov_component_mean(p, q, merged->mean);
    spread(p, q, d, p->mass / mass, q->mass / mass, merged->s);
    merged->mass = mass;
    factors f;
    factorise(merged->s, &f);
    complete(merged, &f);
}

/* exp(-1/2 scale^2 d^T S^-1 d) / sqrt(det S): with S the sum of two covariances, the integral of
 * the product of two normal densities, times (2 pi)^(3/2). By Cramer's rule, with one division,
 * except where S is so long that the determinant's terms nearly cancel. */
static inline double density_of_sum(const double s[6], const double d[3], double scale) {
    const double xx = s[3] * s[5] - s[4] * s[4], xy = s[2] * s[4] - s[1] * s[5];
    const double xz = s[1] * s[4] - s[2] * s[3], yy = s[0] * s[5] - s[2] * s[2];
    const double yz = s[1] * s[2] - s[0] * s[4], zz = s[0] * s[3] - s[1] * s[1];
    const double determinant = s[0] * xx + s[1] * xy + s[2] * xz;
    if (determinant > 1e-6 * s[0] * s[3] * s[5]) {
        const double inverse = 1.0 / determinant;
        const double form = d[0] * (d[0] * xx + 2.0 * (d[1] * xy + d[2] * xz)) +
                            d[1] * (d[1] * yy + 2.0 * d[2] * yz) + d[2] * d[2] * zz;
        return exp(-0.5 * scale * scale * inverse * form) * sqrt(inverse);
    }
    factors f;
    factorise(s, &f);
    return exp(-0.5 * scale * scale * distance(&f, d)) * sqrt(inverse_determinant(&f));
}

static inline double overlap(const double s[6], const double t[6], const double d[3],
                             double scale) {
    double sum[6];
    for (int k = 0; k < 6; ++k)
        sum[k] = s[k] + t[k];
    return density_of_sum(sum, d, scale);
}

/* integral (g_p + g_q - g_m)^2, from the integrals of the six products. That of a Gaussian with
 * itself has det (2 S) = 8 det S. */
static double l2(const ov_component *p, const ov_component *q) {
    const double mass = p->mass + q->mass, u = p->mass / mass, v = q->mass / mass;
    double d[3], s[6];
    for (int k = 0; k < 3; ++k)
        d[k] = q->mean[k] - p->mean[k];
    spread(p, q, d, u, v, s);
    factors f;
    factorise(s, &f);
    const double root8 = 0.35355339059327376220; /* 8^(-1/2) */
    const double own =
        root8 * (p->density + q->density + mass * mass * sqrt(inverse_determinant(&f)));
    const double cross =
        p->mass * q->mass * overlap(p->s, q->s, d, 1.0) -
        mass * (p->mass * overlap(p->s, s, d, v) + q->mass * overlap(q->s, s, d, u));
    const double inverse_normal = 0.063493635934240969786; /* (2 pi)^(-3/2) */
    const double cost = inverse_normal * (own + 2.0 * cross);
    return cost > 0.0 ? cost : 0.0; /* rounding, for two that hardly differ */
}

static double runnalls(const ov_component *p, const ov_component *q) {
    const double mass = p->mass + q->mass;
    double d[3], s[6];
    for (int k = 0; k < 3; ++k)
        d[k] = q->mean[k] - p->mean[k];
    spread(p, q, d, p->mass / mass, q->mass / mass, s);
    factors f;
    factorise(s, &f);
    const double log_volume = -log(inverse_determinant(&f));
    const double cost =
        0.5 * (p->mass * (log_volume - p->log_volume) + q->mass * (log_volume - q->log_volume));
    return cost > 0.0 ? cost : 0.0;
}

double ov_component_cost(ov_merge_cost kind, const ov_component *p, const ov_component *q) {
    switch (kind) {
    case OV_MERGE_L2_PER_MASS:
        return l2(p, q) / (p->mass + q->mass);
    case OV_MERGE_RUNNALLS:
        return runnalls(p, q);
    case OV_MERGE_L2:
        break;
    }
    return l2(p, q);
}
