/*
 * The accuracy step: Levenberg-Marquardt on sum_k weight_k r_k^2 over all parameters of all
 * ellipsoids, every pass on the device.
 */
#ifndef OV_REFINE_H
#define OV_REFINE_H

#include "fit/adaptive/solver.h"
#include "fit/adaptive/target.h"

typedef struct ov_refine_options {
    uint32_t steps;        /* at most, accepted or not */
    uint32_t solver_steps; /* of conjugate gradients, at most */
    double solver_tolerance;
    double decrease;  /* stops after two steps in a row that gain a smaller share than this */
    double damping;   /* lambda at the start */
    double width_max; /* angstrom: no axis, 1 / sqrt(decay), becomes longer than this or than the
                         ellipsoid's longest was */
    bool (*go_on)(uint32_t step, double misfit, void *user); /* may be NULL */
    void *user;
    bool (*enough)(const double *x, size_t count, void *where); /* asked after steps that were
                                                                   accepted; may be NULL */
    void *where;
} ov_refine_options;

/* Lists, and what they serve for. */
typedef struct ov_listing {
    ov_lists lists;
    double *listed; /* parameters that the lists were built for */
    float *skins;   /* and how far each ellipsoid may move before they are built again (angstrom) */
    size_t listed_count, listed_capacity, skins_capacity;
    const ov_points *listed_points;
} ov_listing;

/* What one evaluation of a model leaves on the device. */
typedef struct ov_evaluation {
    ov_terms terms;
    size_t listing;                   /* which of the refiner's its lists are */
    ov_buffer value, u, active, sums; /* see kernels/misfit.cl */
} ov_evaluation;

typedef struct ov_refiner {
    ovoid_context *context;
    ov_operations operations;
    ov_solver solver;
    ov_followers followers; /* of what is refined; none unless they are set */
    ov_kernel misfit;
    ov_evaluation now, tried; /* of the accepted parameters, and of a step from there */
    ov_listing listing[2];    /* those of the former, which the latter shares as long as they do */
    ov_buffer moments, gram;
    ov_quadric *quadrics;
    double *trial, *step;
    size_t capacity, quadrics_capacity;
    float *host;
    size_t host_capacity;
    ov_later sums; /* the read of a misfit's sums, while it is under way */
    uint64_t list_builds, evaluations, steps;
} ov_refiner;

/* Changes the parameters x (OV_FACTOR_PARAMETERS per ellipsoid) to fit the target better; *misfit
 * is sum_k weight_k r_k^2 at the end. OVOID_ERROR_CANCELLED when go_on says so. */
ovoid_status ov_refine(ov_refiner *refiner, const ov_target *target,
                       const ov_refine_options *options, double *x, size_t count, double *misfit);

/* The misfit at x; the model's values at the points stay in refiner->now. */
ovoid_status ov_refine_evaluate(ov_refiner *refiner, const ov_target *target, const double *x,
                                size_t count, double *misfit);
/* The lists of refiner->now. */
static inline ov_lists *ov_refiner_lists(ov_refiner *refiner) {
    return &refiner->listing[refiner->now.listing].lists;
}
/* To be called when points that it has seen are replaced by others in the same place. */
void ov_refiner_forget(ov_refiner *refiner);
/* To be called before a search: what it launches then does not go with the one before. */
void ov_refiner_begin(ov_refiner *refiner);
void ov_refiner_destroy(ov_refiner *refiner);

#endif
