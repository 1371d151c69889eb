/*
 * The paper's objective w_s E_s + w_l E_l1 and its gradient on the device (eqs. 3.2 to 3.6), with
 * the lists kept up to date as the ellipsoids move.
 */
#ifndef OV_L1_OBJECTIVE_H
#define OV_L1_OBJECTIVE_H

#include "field/field.h"
#include "model/chain.h"

/* What an evaluation of the model at the points gives. */
typedef struct ov_l1_evaluation {
    double accuracy;  /* E_s, the sum of squared residuals */
    double max_error; /* the largest residual: max_k |phi~ - phi|, inside how far phi~ fell */
} ov_l1_evaluation;

typedef struct ov_l1_weights {
    double accuracy, sparse; /* w_s, w_l */
} ov_l1_weights;

typedef struct ov_l1_objective {
    ovoid_context *context;
    const ov_samples *samples;
    double limit; /* targets above it hold the inside: see ov_residual() */
    ovoid_kernel kernel;
    double *listed; /* parameters that the lists were built for, listed_count ellipsoids */
    size_t listed_count;
    double skin;        /* of the lists, angstrom */
    uint64_t listed_at; /* evaluations done when they were built */
    ov_quadric *quadrics;
    float *moments; /* as read back */
    float *sums;    /* as read back */
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
    ov_buffer value, residual, pack_sums, moment_sums;
    ovoid_l1_result profile; /* its seconds and counts */
} ov_l1_objective;

/* Room for up to `ellipsoids` of them. Samples with phi > limit only ask that phi~ does not fall
 * below limit (INFINITY: all ask for phi~ = phi). samples must outlive the objective. */
ovoid_status ov_l1_objective_create(ovoid_context *context, const ov_samples *samples, double limit,
                                    ovoid_kernel kernel, size_t ellipsoids,
                                    ov_l1_objective *objective);
void ov_l1_objective_destroy(ov_l1_objective *objective);

/* phi~ and the residual at all points for the parameters x, OV_L1_PARAMETERS per ellipsoid. The
 * residual stays on the device, for ov_l1_gradient(). OVOID_ERROR_NUMERIC when x is no model or E_s
 * is not finite. After a failure the objective can be evaluated again. */
ovoid_status ov_l1_evaluate(ov_l1_objective *objective, const double *x, size_t count,
                            ov_l1_evaluation *result);

/* E_l1 = sum |c| + |d_1| + |d_2| + |d_3| (eq. 3.3, on the substituted variables); sum |c| of
 * spheres. */
double ov_l1_sparse_term(const ov_l1_objective *objective, const double *x, size_t count);

/* Gradient of w_s E_s + w_l E_l1 at the parameters x evaluated last; |t|' is taken as 0 at 0,
 * and the gradient of what the kernel holds fixed as 0. */
ovoid_status ov_l1_gradient(ov_l1_objective *objective, const double *x, size_t count,
                            ov_l1_weights w, double *gradient);

#endif
