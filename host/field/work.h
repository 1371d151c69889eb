/*
 * How large a lattice may be: what would take hours is refused with an estimate.
 */
#ifndef OV_WORK_H
#define OV_WORK_H

#include "base/base.h"

/* Lattice points that are evaluated at most: this many, and for many terms so many each. Minutes on
 * two cores; the default spacings ask for less than 1e4 per atom. */
#define OV_WORK_POINTS 2e10
#define OV_WORK_POINTS_PER_TERM 1e5

/* OVOID_ERROR_LIMIT where `points` of a lattice are more than `slack` times that. What: what is
 * made of them, "constrained points". */
ovoid_status ov_work_check(ovoid_context *context, double points, size_t terms, double spacing,
                           double slack, const char *what);

#endif
