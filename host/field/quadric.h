/*
 * One Gaussian on the host, in double, as a quadratic form: what atoms and ellipsoids of every
 * parametrisation become before they are evaluated.
 */
#ifndef OV_QUADRIC_H
#define OV_QUADRIC_H

#include "base/rigid.h"

#include <stdbool.h>

/* amplitude * exp(-(x - centre)^T A (x - centre)); a = A's xx, xy, xz, yy, yz, zz (angstrom^-2). */
typedef struct ov_quadric {
    double amplitude;
    double centre[3];
    double a[6];
} ov_quadric;

/* Jacobi's method: the eigenvalues of a symmetric matrix in descending order, and their directions,
 * orthogonal unit vectors, in the rows of axes. a is used up. */
void ov_symmetric_axes(double a[3][3], double value[3], double axes[3][3]);

/* A = R^T diag(decay) R, as xx, xy, xz, yy, yz, zz. */
void ov_quadratic_form(double r[3][3], const double decay[3], double a[6]);

/* The same Gaussian elsewhere. */
void ov_quadric_move(const ov_quadric *quadric, const ov_rigid *rigid, ov_quadric *moved);

/* ln of its value at a point. */
double ov_quadric_log_value(const ov_quadric *quadric, const double at[3]);

/* Half the widths of the box about the region where the Gaussian is at least `floor`, angstrom; no
 * smaller than they are. False if it nowhere is. */
bool ov_quadric_reach(const ov_quadric *quadric, double floor, double half[3]);

/* Whether that box about it meets this one. */
bool ov_quadric_meets(const ov_quadric *quadric, double floor, const double low[3],
                      const double high[3]);

/* Largest d r^2 of an atom: up to here its exp(d r^2), and sums of many, fit a float. */
#define OV_EXPONENT_MAX 80.0

/* The Gaussian of an atom: exp(-d (|x - x_i|^2 - r^2)); xyzr in angstrom, d in angstrom^-2. */
void ov_quadric_of_atom(const double xyzr[4], double d, ov_quadric *quadric);

#endif
