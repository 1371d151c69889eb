/*
 * What judging a whole model and judging it near its changes have in common.
 */
#ifndef OV_JUDGING_H
#define OV_JUDGING_H

#include "measure/bound.h"
#include "measure/judge.h"

/* Whether a vertex that is so far off counts; *outer: as one of an outer surface. */
bool ov_judge_counts(const ov_judge *judge, const ovoid_mesh *mesh, size_t vertex, double distance,
                     bool *outer);

/* Distances below this are only bounded where spots are looked for that are `least` off. */
double ov_judge_enough(const ov_judge *judge, double least);

/* From which share of the isovalue on terms count where spots are looked for that are `least` off:
 * what all others together move a vertex by is 0.4 % of that at most, and mostly a tenth of it;
 * where they are looked for closely, a tenth of that, or nothing. */
double ov_judge_cutoff(const ov_judge *judge, double least);

/* Adds a spot to the list `spots` of a judge. */
typedef struct ov_listing {
    ovoid_context *context;
    ov_spot_list *spots;
} ov_listing;
ovoid_status ov_list_spot(const double at[3], double distance, void *listing);

/* Lays a part of the original, or all of it, on the device, to measure distances to: those to what
 * is not of the part may be told as more. Does nothing where all of it is there. Not before
 * somebody asks for distances: of a part that is to have a number of ellipsoids nobody does, and
 * triangles are the largest that a judge has on the device. trail: stays as long as it is laid. */
ovoid_status ov_judge_lay(ov_judge *judge, const ov_trail *trail);

/* ---- in a region (region.c) ------------------------------------------------------------------ */

/* Whether only what lies in the judge's region counts, however far off the rest is: such a model is
 * judged there alone. */
bool ov_judge_is_regional(const ov_judge *judge);

/* All spots there, and the model is taken note of; *farthest: the largest distance that counts,
 * exact where it is not much below `least`. *looked is false, and nothing known, where one of the
 * two has no surface there. */
ovoid_status ov_judge_region(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                             double least, ov_spot_list *found, double *farthest, bool *looked);

void ov_region_destroy(ov_region *region);

/* ---- near changes (near.c) ------------------------------------------------------------------- */

/* Looks for spots only where the model is not what it was when it was seen last, and takes note of
 * what it is now. *looked is false, and nothing done, where that is not enough to know them all, or
 * little less work than to judge all of it. What is not known for sure is whether there are none:
 * only a whole judgement says so. */
ovoid_status ov_judge_near(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                           ov_spot_list *found, bool *looked);

/* Takes note of a model and its mesh, all of which was judged, and of all the spots there are. */
ovoid_status ov_judge_remember(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                               const ovoid_mesh *mesh, double least, const ov_spot *spots,
                               size_t spot_count);

/* Takes note of a model and its spots alone. */
ovoid_status ov_seen_model(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                           const ov_spot *spots, size_t spot_count);

void ov_seen_destroy(ov_seen *seen);

#endif
