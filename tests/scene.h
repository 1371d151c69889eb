/*
 * What the adaptive fit works on, made from a known mixture of Gaussians: points about its surface,
 * its field there and the target that follows it.
 */
#ifndef SCENE_H
#define SCENE_H

#include "fit/adaptive/target.h"
#include "model/factor.h"
#include "support.h"

typedef struct scene {
    ovoid_context *context;
    ov_quadric *quadrics; /* the mixture */
    size_t count;
    double decay, isovalue;
    ov_samples samples;
    ov_target target;
    size_t points, all; /* all: with those that fill up the last pack */
    double *xyz;        /* 3 * all, angstrom, in the order of the packs */
} scene;

/* Points of a lattice of this spacing that includes the origin, within `reach` of a centre and in
 * the band and the guards that options ask for; the field is the device's. */
void scene_create(scene *s, ovoid_context *context, const ov_quadric *quadrics, size_t count,
                  double decay, double isovalue, double spacing, double reach,
                  const ov_target_options *options);
void scene_destroy(scene *s);

/* Spheres of decay rate d in a cube, of which many overlap. */
ov_quadric *scene_atoms(test_random *random, size_t count, double decay);
/* Ellipsoids that are a little longer one way than another. */
ov_quadric *scene_ellipsoids(test_random *random, size_t count);

#endif
