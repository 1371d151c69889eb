#include "field/work.h"

#include <math.h>

/* By how much a bound of the points may be above what is allowed before it tells. */
#define SLACK 8.0

static ovoid_status refuse(ovoid_context *context, const ov_work *work, const char *of,
                           double number, double most) {
    return ov_fail(context, OVOID_ERROR_LIMIT,
                   "the lattice for %s would have about %.1e %s at a spacing of %g angstrom, more "
                   "than %.0e; use a spacing of about %.2g angstrom or more",
                   work->what, number, of, work->spacing, most,
                   work->spacing * cbrt(number / most));
}

ovoid_status ov_work_check(ovoid_context *context, const ov_work *work) {
    const double terms = (double)work->terms,
                 points = fmax(OV_WORK_POINTS, OV_WORK_POINTS_PER_TERM * terms),
                 values = fmax(OV_WORK_VALUES, OV_WORK_VALUES_PER_TERM * terms);
    if (!(work->points_least <= points && work->points_most <= SLACK * points))
        return refuse(context, work, "points", work->points_most, points);
    if (!(work->values <= values))
        return refuse(context, work, "values of Gaussians at its points", work->values, values);
    return OVOID_OK;
}
