/* The field of a list of quadrics at any points, for the public evaluation functions. */
#ifndef OV_EVALUATE_H
#define OV_EVALUATE_H

#include "field/ellipsoid.h"

/* value[k], and unless NULL gradient[3 * k ..], at xyz[3 * k ..] (angstrom), in the caller's order.
 */
ovoid_status ov_evaluate(ovoid_context *context, const ov_quadric *quadrics, size_t quadric_count,
                         const double *xyz, size_t count, double *value, double *gradient);

#endif
