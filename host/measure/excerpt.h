/*
 * Judging a model in a box: it is meshed there and a little about it, and its distances from the
 * original are measured there in both directions. Where that is sure to be as if all of it were
 * judged, as near changes (near.c) or where no more than a box counts (region.c), it costs less.
 *
 * A mesh that ends at a box does not tell what is a cavity: of a component that is open there, what
 * is known to be hidden about the box does.
 */
#ifndef OV_EXCERPT_H
#define OV_EXCERPT_H

#include "measure/judging.h"

/* What is asked: spots of the model that are `least` off, angstrom, in a box. The original is on
 * the device at least as far as ov_excerpt_room() about it. The judge's seen.hidden has the
 * vertices about the box that are of no outer surface, and afterwards those in the box, too. */
typedef struct ov_excerpt_asked {
    ov_judge *judge;
    const ov_quadric *quadrics; /* the model's */
    size_t count;
    double least;
    ov_marcher *marcher; /* for the box; it is clipped to it */
    const ov_box *box;
    const ov_region *region; /* what is known about the box if no more than it counts, else NULL */
} ov_excerpt_asked;

/* How far the model is meshed about a box. */
double ov_excerpt_room(const ov_judge *judge, double least);

/* Adds the spots; *farthest becomes the largest distance that counts, if that is more, exact where
 * it is not much below `least`. *known is false where there is no surface to tell by. */
ovoid_status ov_excerpt_look(const ov_excerpt_asked *asked, ov_spot_list *found, double *farthest,
                             bool *known);

/* The triangles of the original that come into a box, and their vertices. */
ovoid_status ov_excerpt_original(const ov_judge *judge, const ov_box *box, ov_trail *trail);

/* Adds a vertex to what is hidden. */
ovoid_status ov_seen_hide(ovoid_context *context, ov_seen *seen, const double at[3]);

#endif
