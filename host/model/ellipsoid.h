/*
 * One ellipsoid in the paper's parameters: amplitude, decay rates, centre and three Euler angles.
 */
#ifndef OV_ELLIPSOID_H
#define OV_ELLIPSOID_H

#include "field/quadric.h"
#include "ovoid/ovoid.h"

/* R = R_z(angle[2]) R_y(angle[1]) R_x(angle[0]) with the paper's signs (eq. 2.11). */
void ov_rotation(const double angle[3], double r[3][3]);

/* Its inverse; alpha is 0 where only its sum or difference with gamma counts. */
void ov_rotation_angles(double r[3][3], double angle[3]);

/* Derivatives of R with respect to the three angles. */
void ov_rotation_derivatives(const double angle[3], double dr[3][3][3]);

/* The same ellipsoid elsewhere: amplitude and decay rates keep their bits. moved is another one. */
void ov_ellipsoid_move(const ovoid_ellipsoid *ellipsoid, const ov_rigid *rigid,
                       ovoid_ellipsoid *moved);

void ov_quadric_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_quadric *quadric);

#endif
