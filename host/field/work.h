/*
 * How large a lattice may be: what would take hours is refused with an estimate.
 */
#ifndef OV_WORK_H
#define OV_WORK_H

#include "base/base.h"

/* Lattice points that are evaluated at most, and values of terms at them: this many, and for many
 * terms so many each. Minutes on two cores; the default spacings ask for less than 1e4 points and
 * values per atom. */
#define OV_WORK_POINTS 2e10
#define OV_WORK_POINTS_PER_TERM 1e5
#define OV_WORK_VALUES 1e12
#define OV_WORK_VALUES_PER_TERM 1e6

/* How much a lattice asks for, as far as that is known. */
typedef struct ov_work {
    double points_least, points_most; /* bounds; equal where the number is known */
    double values;
    size_t terms;
    double spacing;   /* angstrom */
    const char *what; /* is made of the points: "constrained points" */
} ov_work;

/* OVOID_ERROR_LIMIT where that is too much: where points_least is, or points_most by far. */
ovoid_status ov_work_check(ovoid_context *context, const ov_work *work);

#endif
