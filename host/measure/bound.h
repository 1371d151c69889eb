/*
 * How far the points of a surface are from another one, bounded from above: those in its triangles,
 * where vertices tell nothing.
 *
 * The distance from a triangle t is a convex function, so that over another triangle T it is
 * largest at a corner: no point of T is farther from the whole surface than the farthest of its
 * corners is from t, whichever t that is. The device looks for the t that says least. Where that
 * leaves more slack than wanted, T is split in four, and the distances of the new corners raise
 * what is known from below.
 */
#ifndef OV_BOUND_H
#define OV_BOUND_H

#include "measure/distance.h"

/* The largest distance lies between the two, in angstrom. {0} is ready; over several surfaces it is
 * that of all of them, and costs least where `least` is large from the start. */
typedef struct ov_bound {
    double least, most;
    size_t triangles, split; /* how many were looked at, parts of others included, and split */
} ov_bound;

/* How far `most` may be above `least`: so much (angstrom), or this share of `least`. */
#define OV_BOUND_SLACK 0.005
#define OV_BOUND_SLACK_SHARE 0.005
/* The same where two surfaces are so much alike everywhere that this would take too many parts. */
#define OV_BOUND_SLACK_LOOSE 0.02
#define OV_BOUND_SLACK_SHARE_LOOSE 0.05

/* Adds the outer triangles of a trail. squared: of each vertex of its mesh that is in the trail,
 * from the facets, angstrom^2. Where the looser slack, too, would take too many parts, `most` is
 * farther away, and holds. */
ovoid_status ov_bound_add(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                          const ov_trail *from, const float *squared, ov_bound *bound);

#endif
