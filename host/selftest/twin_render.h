/*
 * What rays meet and how it is lit, in double, one ray at a time: steps far smaller than the
 * kernels' and every term at every step. Quadrics are in the camera's frame; rays come down z.
 */
#ifndef OV_TWIN_RENDER_H
#define OV_TWIN_RENDER_H

#include "field/quadric.h"

#include <stddef.h>

double ov_twin_sum_at(const ov_quadric *quadrics, size_t count, const double y[3]);

/* Largest z of [back, front] on the ray at (x, y) where the field reaches level, or -INFINITY. */
double ov_twin_hit(const ov_quadric *quadrics, size_t count, double level, double x, double y,
                   double front, double back);

/* The first of the surfaces where each term by itself is level; *which is its index. */
double ov_twin_hit_single(const ov_quadric *quadrics, size_t count, double level, double x,
                          double y, size_t *which);

/* Outward unit normal of the level set through y; returns the gradient's length. */
double ov_twin_normal(const ov_quadric *quadrics, size_t count, const double y[3],
                      double normal[3]);

/* Linear light from a surface of this colour whose surroundings are open: key and fill are unit
 * vectors toward the lights with their strengths. */
void ov_twin_light(const double colour[3], const double normal[3], const float key[4],
                   const float fill[4], double ambient, double light[3]);

#endif
