/*
 * A component of a mixture: a Gaussian by its mass, mean and covariance. Merges of two, and what
 * these cost.
 */
#ifndef OV_COMPONENT_H
#define OV_COMPONENT_H

#include "mixture/reduce.h"

typedef struct ov_component {
    double mass;       /* integral over space, angstrom^3 */
    double mean[3];    /* angstrom */
    double s[6];       /* covariance xx, xy, xz, yy, yz, zz, angstrom^2 */
    double density;    /* mass^2 / sqrt(det S): its squared integral is (4 pi)^(-3/2) of it */
    double log_volume; /* ln det S */
} ov_component;

/* False if the quadric is no Gaussian: see ov_reduction_create(). */
bool ov_component_of_quadric(const ov_quadric *quadric, ov_component *component);

void ov_quadric_of_component(const ov_component *component, ov_quadric *quadric);

/* Mass, mean and covariance of the two together. */
void ov_component_merge(const ov_component *p, const ov_component *q, ov_component *merged);

/* Mean of the two together, by the same arithmetic as the merge. */
void ov_component_mean(const ov_component *p, const ov_component *q, double mean[3]);

/* Cost of merging p and q, at least 0, before any division for what lies inside. */
double ov_component_cost(ov_merge_cost kind, const ov_component *p, const ov_component *q);

#endif
