/*
 * From moments to the gradient of the paper's parameters. Written once, in double; tests hold it to
 * finite differences.
 */
#ifndef OV_CHAIN_H
#define OV_CHAIN_H

#include "model/ellipsoid.h"

/* The paper's unconstrained parameters of one ellipsoid (eq. 3.5): amplitude c^2, decay rates
 * d_p^2. E_l1 acts on c and d. */
enum { OV_L1_C = 0, OV_L1_D = 1, OV_L1_CENTRE = 4, OV_L1_ANGLE = 7, OV_L1_PARAMETERS = 10 };

/* Amplitudes and decay rates are kept above these, so that every parameter vector is a Gaussian. */
#define OV_L1_AMPLITUDE_MIN 1e-30
#define OV_L1_DECAY_MIN 1e-8

void ov_l1_quadric(const double parameters[OV_L1_PARAMETERS], ov_quadric *quadric);
void ov_l1_ellipsoid(const double parameters[OV_L1_PARAMETERS], ovoid_ellipsoid *ellipsoid);

/* gradient[j] = sum_k u_k d e(y_k) / d parameters[j], from the ten moments sum_k u_k e(y_k) m(y_k -
 * mu) in the order of shared.h. */
void ov_l1_chain(const double parameters[OV_L1_PARAMETERS], const double moments[10],
                 double gradient[OV_L1_PARAMETERS]);

#endif
