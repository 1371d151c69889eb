/*
 * One Levenberg-Marquardt step on the device: conjugate gradients on the damped normal equations,
 * matrix free (kernels/solve.cl). The host starts kernels and looks at the residual now and then;
 * vectors stay on the device until the step is read.
 */
#ifndef OV_SOLVER_H
#define OV_SOLVER_H

#include "field/field.h"
#include "model/factor.h"

/* Looks at the residual: waited for, or an iteration late. The device decides unless tests do. */
typedef enum ov_looks { OV_LOOKS_OF_DEVICE, OV_LOOKS_WAIT, OV_LOOKS_LAG } ov_looks;

typedef struct ov_solver {
    ov_kernel start, product, update, direction, step;
    ov_buffer factor, block, diagonal, x, r, z, p, q, polynomial, rz, rz_next, pq;
    ov_buffer jacobian_p; /* weight * (J p) at the points */
    ov_buffer moments;    /* of it */
    float *host;          /* factors as uploaded, steps and sums as read back */
    size_t host_capacity;
    size_t group; /* ellipsoids in a work-group of many, */
    size_t wide;  /* and work-items in the only one */
    ov_looks looks;
    bool apart;          /* set by tests: as if there were many */
    uint64_t iterations; /* of conjugate gradients, all solves together */
} ov_solver;

/* The system: J from terms and lists, W = weight (floats at the points), the moments of W r, and
 * the gram of W. */
typedef struct ov_system {
    const ov_points *points;
    const ov_terms *terms;
    const ov_lists *lists;
    const ov_buffer *weight, *moments, *gram;
    const double *parameters; /* OV_FACTOR_PARAMETERS per ellipsoid, those of the terms */
} ov_system;

/* step: OV_FACTOR_PARAMETERS per ellipsoid, the solution of (J^T W J + lambda D) step = -J^T W r
 * after at most `iterations` iterations or once the preconditioned residual has fallen to
 * `tolerance` of its start. */
ovoid_status ov_solve(ovoid_context *context, ov_solver *solver, ov_operations *operations,
                      const ov_system *system, double lambda, uint32_t iterations, double tolerance,
                      double *step);
void ov_solver_destroy(ov_solver *solver);

#endif
