/* The field of a list of quadrics at any points, for the public evaluation functions and maps. */
#ifndef OV_EVALUATE_H
#define OV_EVALUATE_H

#include "field/field.h"

/* Terms on the device, and what else calls share. Starts as {0}. */
typedef struct ov_evaluator {
    double origin[3];       /* of the terms, angstrom */
    double low[3], high[3]; /* beyond this box no term reaches the cut-off */
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
    ov_buffer value, gradient;
    double *xyz;     /* of a piece's points within the box */
    uint32_t *index; /* which of the piece's they are */
    size_t xyz_capacity, index_capacity;
    float *results; /* of the packs: values, then gradients */
    size_t results_capacity;
} ov_evaluator;

/* The quadrics are not kept. Needs a device. */
ovoid_status ov_evaluator_create(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                                 ov_evaluator *evaluator);
void ov_evaluator_destroy(ov_evaluator *evaluator);

/* value[k], and unless NULL gradient[3 * k ..], at the finite points xyz[3 * k ..] (angstrom), in
 * the caller's order; 0 where no term reaches the cut-off. On failure some of them
 * may be set. */
ovoid_status ov_evaluator_run(ovoid_context *context, ov_evaluator *evaluator, const double *xyz,
                              size_t count, float *value, float *gradient);

/* As ov_evaluator_run(), once, for points that need not be finite. */
ovoid_status ov_evaluate(ovoid_context *context, const ov_quadric *quadrics, size_t quadric_count,
                         const double *xyz, size_t count, double *value, double *gradient);

#endif
