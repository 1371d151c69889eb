/* The field of a list of quadrics at any points, for the public evaluation functions and maps. */
#ifndef OV_EVALUATE_H
#define OV_EVALUATE_H

#include "field/near.h"

/* Terms on the device, and what else calls share. Starts as {0}. */
typedef struct ov_evaluator {
    double origin[3];           /* of the terms, angstrom */
    const ov_quadric *quadrics; /* not owned */
    size_t count;
    double low[3], high[3]; /* beyond this box no term reaches the cut-off */
    ov_terms terms;
    ov_lists lists;
    ov_near near; /* for few points; empty before the first of them */
    ov_operations operations;
    ov_kernel spread;
    ov_buffer value, gradient, to;
    double *xyz;     /* of a piece's points within the box */
    uint32_t *index; /* which of the piece's they are */
    size_t xyz_capacity, index_capacity;
    float *results; /* of the packs: values, then gradients */
    size_t results_capacity;
} ov_evaluator;

/* The quadrics stay as long as the evaluator. Needs a device. */
ovoid_status ov_evaluator_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                                 ov_evaluator *evaluator);
void ov_evaluator_destroy(ov_evaluator *evaluator);

/* value[k], and unless NULL gradient[3 * k ..], at the finite points xyz[3 * k ..] (angstrom), in
 * the caller's order; 0 where no term reaches the cut-off. On failure some of them
 * may be set. */
ovoid_status ov_evaluator_run(ovoid_context *context, ov_evaluator *evaluator, const double *xyz,
                              size_t count, float *value, float *gradient);

/* Points that are evaluated at once, which bounds the memory on the device. */
#define OV_EVALUATE_PIECE ((size_t)1 << 20)

/* Of at most OV_EVALUATE_PIECE points, into the caller's buffers: floats of the points from `first`
 * on, as ovoid_field_evaluate_opencl() has them; where no term reaches the cut-off they stay as
 * they are. Does not wait. gradient may be NULL. */
ovoid_status ov_evaluator_put(ovoid_context *context, ov_evaluator *evaluator, const double *xyz,
                              size_t count, size_t first, cl_mem value, cl_mem gradient);

/* OVOID_ERROR_ARGUMENT where a coordinate is not finite. */
ovoid_status ov_points_check(ovoid_context *context, const double *xyz, size_t count);

#endif
