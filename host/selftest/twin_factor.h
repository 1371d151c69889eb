/*
 * The adaptive method's parameters in double: the value of an ellipsoid, its derivatives as
 * polynomials, and the whole Levenberg-Marquardt system as one dense matrix.
 */
#ifndef OV_TWIN_FACTOR_H
#define OV_TWIN_FACTOR_H

#include "model/factor.h"
#include "selftest/twin.h"

/* exp(ln a - |L^T (y - centre)|^2) */
double ov_twin_factor_value(const double parameters[OV_FACTOR_PARAMETERS], const double y[3]);

/* The derivative of the value along each parameter is the value times sum_m map[m][j] m(z): from
 * e's logarithm, whose quadratic form changes by dL L^T + L dL^T. */
void ov_twin_factor_map(const double parameters[OV_FACTOR_PARAMETERS],
                        double map[OV_MONOMIALS][OV_FACTOR_PARAMETERS]);

/* Row k of J: the derivatives of the sum of `count` ellipsoids at y. */
void ov_twin_jacobian(const double *parameters, size_t count, const double y[3], double *row);

/* The same with images of them all, which follow them: at y, an image is what it is the image of
 * where the motion came from. work: as long as the row. */
void ov_twin_jacobian_images(const double *parameters, size_t count, const ov_rigid *motion,
                             size_t images, const double y[3], double *row, double *work);

/* How a rotation turns polynomials: those of p(R^T z) are sum_m turn[n][m] c_m. Its transpose takes
 * moments of an image back. */
void ov_twin_turn(const double rotation[9], double turn[OV_MONOMIALS][OV_MONOMIALS]);

/* (J^T W J + lambda D) and -J^T W r, with u = W r, and 1 on the diagonal where it is 0, so that
 * what does not matter stays still. motion: those of `images` images of all ellipsoids, or NULL.
 * matrix: size * size, right: size, with size = count * OV_FACTOR_PARAMETERS. False without memory.
 */
bool ov_twin_system(const double *parameters, size_t count, const ov_rigid *motion, size_t images,
                    const double *xyz, const float *weight, const float *u, size_t points,
                    double lambda, double *matrix, double *right);

/* x := matrix^-1 x by Cholesky's factorisation, which takes the matrix's place. False where it is
 * not positive definite. */
bool ov_twin_solve(double *matrix, size_t size, double *x);

#endif
