/*
 * Plain C, double precision: what the kernels compute, written as the formulas are. Sums run over
 * all terms and all points; lists, packs and cut-offs do not exist here.
 */
#ifndef OV_TWIN_H
#define OV_TWIN_H

#include "field/field.h"

/* A sum with its conditioning: scale is the sum of the magnitudes of its parts, each multiplied by
 * how much its exponent magnifies a relative rounding error. Single precision can be held to a
 * small multiple of FLT_EPSILON * scale, whatever the model. */
typedef struct ov_twin_sum {
    double value;
    double scale;
} ov_twin_sum;

/* R_z(angle[2]) R_y(angle[1]) R_x(angle[0]) as a product of the paper's three matrices. */
void ov_twin_rotation(const double angle[3], double r[3][3]);

/* The paper's ellipsoid Gaussian itself: a exp(-|D^(1/2) R (y - mu)|^2), with no A in between. */
double ov_twin_ellipsoid(const ovoid_ellipsoid *ellipsoid, const double y[3]);

/* q = (y - mu)^T A (y - mu). */
double ov_twin_exponent(const ov_quadric *quadric, const double y[3]);

/* 1, x, y, z, xx, xy, xz, yy, yz, zz. */
void ov_twin_monomials(const double z[3], double m[OV_MONOMIALS]);

ov_twin_sum ov_twin_field(const ov_quadric *quadrics, size_t count, const double y[3]);

/* polynomial: OV_MONOMIALS coefficients per term. */
ov_twin_sum ov_twin_field_polynomial(const ov_quadric *quadrics, const float *polynomial,
                                     size_t count, const double y[3]);

void ov_twin_gradient(const ov_quadric *quadrics, size_t count, const double y[3],
                      ov_twin_sum gradient[3]);

/* sum_k u_k e(y_k) m(y_k - mu); xyz: 3 per point. */
void ov_twin_moments(const ov_quadric *quadric, const double *xyz, const double *u, size_t count,
                     ov_twin_sum moments[OV_MONOMIALS]);

/* sum_k w_k e(y_k)^2 z^alpha, z = y_k - mu, in the order of OV_GRAM. */
void ov_twin_gram(const ov_quadric *quadric, const double *xyz, const double *w, size_t count,
                  ov_twin_sum gram[OV_GRAM]);

/* Least q of a term over a box (low x, y, z, high x, y, z), exactly: the minimum lies inside, on a
 * face, an edge or a corner, and all 27 are tried. */
double ov_twin_least_exponent(const ov_quadric *quadric, const double box[6]);

/* some = the `size` floats of each pack listed, of all; and back. */
void ov_twin_gather(const uint32_t *list, size_t packs, size_t size, const float *all, float *some);
void ov_twin_scatter(const uint32_t *list, size_t packs, size_t size, const float *some,
                     float *all);

/* What others leave of a bound (kernels/misfit.cl): FLT_MAX, which is none, stays. */
double ov_twin_rest(double bound, double value);

/* phi of the paper's eq. 1.1. */
double ov_twin_phi(const double *xyzr, size_t atoms, double decay, const double y[3]);

/* sum_k (phi~(y_k) - target_k)^2 for the paper's parameters, ten per ellipsoid in the order of
 * model/chain.h. */
double ov_twin_accuracy(const double *parameters, size_t ellipsoids, const double *xyz,
                        const double *target, size_t points, double limit);

/* What the model's value leaves of a target; one above limit only asks for a value of limit. */
double ov_twin_residual(double value, double target, double limit);

/* sum |c| + |d_1| + |d_2| + |d_3|. */
double ov_twin_sparsity(const double *parameters, size_t ellipsoids);

#endif
