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
#define OV_BOUND_SLACK 0.002
#define OV_BOUND_SLACK_SHARE 0.005
/* The same where two surfaces are so much alike everywhere that this would take too many parts. */
#define OV_BOUND_SLACK_LOOSE 0.02
#define OV_BOUND_SLACK_SHARE_LOOSE 0.05

/* A point of a surface, of which that much is known of its distance, angstrom. */
typedef ovoid_status (*ov_far_found)(const double at[3], double distance, void *user);

/* What is asked of a surface whose vertices are within a limit, angstrom. */
typedef struct ov_limits {
    double limit, slack; /* above 0 */
    ov_far_found found;
    void *user;
} ov_limits;

/* Looks inside triangles for points farther than the limit, one in each triangle that has some at
 * most: where none is found, no point of them is farther than limit + slack, unless *whole is
 * false, since that would take too many parts. distance: of each vertex of the trail's mesh, no
 * less than it is, angstrom; triangles with a corner beyond the limit are not looked at, nor those
 * with one below 0. */
ovoid_status ov_bound_exceed(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                             const ov_trail *from, const float *distance, const ov_limits *limits,
                             bool *whole);

/* Adds the outer triangles of a trail. squared: of each vertex of its mesh that is in the trail,
 * from the facets, angstrom^2. Where the looser slack, too, would take too many parts, `most` is
 * farther away, and holds. */
ovoid_status ov_bound_add(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                          const ov_trail *from, const float *squared, ov_bound *bound);

#endif
