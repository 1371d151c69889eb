/*
 * What the adaptive method holds a model to: the original's field about its surface, and guards
 * inside and outside (design, section 3).
 */
#ifndef OV_TARGET_H
#define OV_TARGET_H

#include "field/field.h"

/* In units of the isovalue c and of the length 1 / sqrt(2 d), angstrom for d = 0.5. */
typedef struct ov_target_options {
    double low, high;      /* band in which phi is followed, both sides: [low c, high c] */
    double slope_min;      /* floor of |grad phi| */
    double window, floor;  /* weight of a residual: (floor + exp(-(delta / window)^2)) / slope */
    uint32_t inside_every; /* guards: where phi > high c, phi~ >= high c is asked for */
    double inside_weight;
    uint32_t outside_every; /* guards: where outside_low c < phi < low c, phi~ <= low c */
    double outside_low, outside_weight;
} ov_target_options;

/* [low, high] with a weight for each point (see kernels/misfit.cl), floats in the order of the
 * packs, weight 0 at the fill. */
typedef struct ov_target {
    const ov_points *points;
    ov_buffer low, high, weight;
    float *host_low, *host_high;
    float *host_weight; /* packs * OV_PACK, as first set */
    float *emphasis;    /* what they are multiplied by */
    ov_target_options options;
    double decay, isovalue;
    float *slope; /* max(|grad phi|, floor) at each point: a residual over it is a distance */
    float *phi;
    float *fixed; /* the field of what is not refined, at each point: the bounds are less by it,
                     those beyond a part by what is not to count there. NULL: no such thing */
} ov_target;

void ov_target_options_init(ov_target_options *options);

/* samples must outlive the target. */
ovoid_status ov_target_create(ovoid_context *context, const ov_samples *samples, double decay,
                              double isovalue, const ov_target_options *options, ov_target *target);
void ov_target_destroy(ov_target *target);

/* Lets `values` at the points, OV_PACK per pack, be the field of what is not refined from now on.
 * beyond: NULL, or what is allowed at guards beyond a part, above what is of any. */
ovoid_status ov_target_fix(ovoid_context *context, ov_target *target, const ov_buffer *values,
                           const ov_buffer *beyond);

/* Makes room on the device for low, high and weight of so many packs. */
ovoid_status ov_target_reserve(ovoid_context *context, ov_target *target, size_t packs);

/* Weights the residuals by another window; emphasis is forgotten. */
ovoid_status ov_target_window(ovoid_context *context, ov_target *target, double window,
                              double floor);

/* Asks for `factor` phi instead of phi, where phi is followed: what makes the volumes equal, known
 * from a fit to phi itself. */
ovoid_status ov_target_scale(ovoid_context *context, ov_target *target, double factor);

/* Multiplies the weights of the points within `reach` (angstrom) of any of the places (x, y, z
 * each, `stride` bytes apart) by `factor`, all such factors together up to a bound. There
 * phi itself is asked for again, whatever ov_target_scale() said. */
ovoid_status ov_target_emphasise(ovoid_context *context, ov_target *target, const double *places,
                                 size_t stride, size_t count, double reach, double factor);

#endif
