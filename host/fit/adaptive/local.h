/*
 * The accuracy step here and there: some ellipsoids are refined and the others stay as they are, on
 * the packs of points that the former reach. What it costs goes with their number, not with the
 * molecule's.
 */
#ifndef OV_LOCAL_H
#define OV_LOCAL_H

#include "fit/adaptive/refine.h"

typedef struct ov_local {
    ov_refiner refiner; /* its context and followers are set by who makes this */
    ov_terms moving, still;
    ov_lists reached; /* of those that move, over all points */
    ov_lists lists;   /* of those that stay still, over the points kept: these alone */
    ov_points points; /* the packs that may be reached */
    ov_target target; /* of these, less the field of those that stay still */
    ov_buffer value;
    ov_packs packs; /* which of the whole target's they are */
    ov_buffer list; /* the same on the device */
} ov_local;

/* As ov_refine() for the ellipsoids i of x with chosen[i]; count: of all. The misfit is that at the
 * points kept. With none chosen nothing happens. */
ovoid_status ov_refine_some(ov_local *local, const ov_target *target,
                            const ov_refine_options *options, double *x, size_t count,
                            const bool *chosen, double *misfit);
/* To be called before a search, as ov_refiner_begin(). */
void ov_local_begin(ov_local *local);
void ov_local_destroy(ov_local *local);

#endif
