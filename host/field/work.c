#include "field/work.h"

#include <math.h>

ovoid_status ov_work_check(ovoid_context *context, double points, size_t terms, double spacing,
                           double slack, const char *what) {
    const double most = fmax(OV_WORK_POINTS, OV_WORK_POINTS_PER_TERM * (double)terms);
    if (points <= slack * most)
        return OVOID_OK;
    return ov_fail(
        context, OVOID_ERROR_LIMIT,
        "the lattice for %s would have about %.1e points at a spacing of %g angstrom, more "
        "than %.0e; use a spacing of about %.2g angstrom or more",
        what, points, spacing, most, spacing * cbrt(points / most));
}
