/*
 * The adaptive method's parameters of one ellipsoid: ln a, the centre, and the lower triangle of L
 * with A = L L^T. No angles: nothing degenerates where two axes are equal. (The maps between
 * parameters and monomials are in kernels/solve.cl; their twin is selftest/twin_factor.c.)
 */
#ifndef OV_FACTOR_H
#define OV_FACTOR_H

#include "model/ellipsoid.h"

enum { OV_FACTOR_AMPLITUDE = 0, OV_FACTOR_CENTRE = 1, OV_FACTOR_L = 4, OV_FACTOR_PARAMETERS = 10 };

/* A must be positive definite and the amplitude positive. */
void ov_factor_of_quadric(const ov_quadric *quadric, double parameters[OV_FACTOR_PARAMETERS]);
void ov_factor_quadric(const double parameters[OV_FACTOR_PARAMETERS], ov_quadric *quadric);

/* Smallest eigenvalue of A, the decay rate along the longest axis. */
double ov_factor_least_decay(const double parameters[OV_FACTOR_PARAMETERS]);

/* Quick: true only where no decay rate is below `least`; false may mean nothing. */
bool ov_factor_decays_reach(const double parameters[OV_FACTOR_PARAMETERS], double least);

/* Shortens axes, 1 / sqrt(decay), so that no decay rate is below `least`; leaves the bits of those
 * that have none. */
void ov_factor_bound_decay(double parameters[OV_FACTOR_PARAMETERS], double least);

/* The paper's parameters, decay rates in descending order. */
void ov_ellipsoid_of_quadric(const ov_quadric *quadric, ovoid_ellipsoid *ellipsoid);

/* Bound on how far (angstrom) the hull, where the value is `cutoff`, moves outward from one to the
 * other: |centre' - centre| + |sqrt(q') L'^-1 - sqrt(q) L^-1|, q the exponent at the cut-off, since
 * the hull reaches sqrt(q) |L^-1 n| in direction n. Infinite where L or L' is singular, and where
 * only the other one has a hull at all. */
double ov_factor_motion(const double from[OV_FACTOR_PARAMETERS],
                        const double to[OV_FACTOR_PARAMETERS], double cutoff);

#endif
