/*
 * A system for the solver of the adaptive method by itself, from weights and residuals.
 */
#ifndef OV_PROBLEM_H
#define OV_PROBLEM_H

#include "fit/adaptive/solver.h"

typedef struct ov_problem {
    const ov_points *points; /* these four are somebody else's */
    const ov_terms *terms;
    const ov_lists *lists;
    ov_operations *operations;
    ov_followers followers;
    size_t count;      /* ellipsoids; terms are their images, too */
    double *x;         /* parameters, OV_FACTOR_PARAMETERS per ellipsoid */
    float *weight, *u; /* W and W r at each place, 0 at the fill */
    ov_buffer weights, residuals, moments, gram; /* on the device */
} ov_problem;

/* Uploads weights and residuals as they are now. */
ovoid_status ov_problem_upload(ovoid_context *context, ov_problem *problem);

/* As ov_solve(), with the moments and the gram made first. */
ovoid_status ov_problem_solve(ovoid_context *context, ov_problem *problem, ov_solver *solver,
                              double lambda, uint32_t iterations, double tolerance, double *step);

/* With x, weight and u. */
void ov_problem_destroy(ov_problem *problem);

#endif
