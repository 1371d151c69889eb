/*
 * One Levenberg-Marquardt step on the device: conjugate gradients on the damped normal equations,
 * matrix free (kernels/solve.cl). The host starts as many iterations as it may take, and the device
 * stops them; vectors stay there until the step is read.
 */
#ifndef OV_SOLVER_H
#define OV_SOLVER_H

#include "field/field.h"
#include "fit/adaptive/images.h"
#include "model/factor.h"

typedef struct ov_solver {
    ov_kernel start, product, update, direction, step;
    ov_buffer factor, block, diagonal, x, r, z, p, q, polynomial, rz, rz_next, pq;
    ov_buffer limit, state, state_next; /* see kernels/solve.cl */
    ov_buffer jacobian_p;               /* weight * (J p) at the points */
    ov_buffer moments;                  /* of it */
    float *host;                        /* factors as uploaded, steps and sums as read back */
    size_t host_capacity;
    size_t group;        /* ellipsoids in a work-group of many, */
    size_t wide;         /* and work-items in the only one */
    uint32_t last;       /* iterations that the last solution took; 0: not known */
    bool apart;          /* set by tests: as if there were many */
    uint64_t iterations; /* of conjugate gradients, all solves together */
} ov_solver;

/* The system: J from terms and lists, W = weight (floats at the points), the moments of W r, and
 * the gram of W. Terms are `count` ellipsoids and their images, whose moments have been folded in;
 * the gram is that of the ellipsoids alone, whose preconditioner it makes. */
typedef struct ov_system {
    const ov_points *points;
    const ov_terms *terms;
    const ov_lists *lists;
    const ov_buffer *weight, *moments, *gram;
    const double *parameters; /* OV_FACTOR_PARAMETERS per ellipsoid */
    size_t count;
    ov_followers *followers;
} ov_system;

/* step: OV_FACTOR_PARAMETERS per ellipsoid, the solution of (J^T W J + lambda D) step = -J^T W r
 * after at most `iterations` iterations or once the preconditioned residual has fallen to
 * `tolerance` of its start. */
ovoid_status ov_solve(ovoid_context *context, ov_solver *solver, ov_operations *operations,
                      const ov_system *system, double lambda, uint32_t iterations, double tolerance,
                      double *step);
void ov_solver_destroy(ov_solver *solver);

#endif
