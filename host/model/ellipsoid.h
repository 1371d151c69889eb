/*
 * One ellipsoid in the paper's parameters: amplitude, decay rates, centre and three Euler angles.
 */
#ifndef OV_ELLIPSOID_H
#define OV_ELLIPSOID_H

#include "field/quadric.h"
#include "ovoid/ovoid.h"

/* R = R_z(angle[2]) R_y(angle[1]) R_x(angle[0]) with the paper's signs (eq. 2.11). */
void ov_rotation(const double angle[3], double r[3][3]);

/* Derivatives of R with respect to the three angles. */
void ov_rotation_derivatives(const double angle[3], double dr[3][3][3]);

void ov_quadric_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_quadric *quadric);

#endif
