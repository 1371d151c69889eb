/*
 * Which terms may have a piece of the surface to themselves that the lattice does not meet, and
 * which others are near them.
 */
#ifndef OV_SPECK_TERMS_H
#define OV_SPECK_TERMS_H

#include "mesh/pieces.h"

typedef struct ov_speck_terms {
    size_t count;
    uint32_t *term;    /* the terms, the largest first */
    size_t *start;     /* those near the k-th: near[start[k]] .. near[start[k + 1] - 1], */
    uint32_t *near_it; /* ascending */
} ov_speck_terms;

/* The terms that reach the isovalue by themselves, in a small ball only; of those whose fields
 * join, two by two, the one with the largest ball, and none where they join to something long or to
 * a larger term. Near them are the terms that reach the cutoff where the box of ov_speck_half()
 * with share 1 about their centre is. */
ovoid_status ov_speck_terms_find(ovoid_context *context, const ov_body *bodies, size_t count,
                                 double isovalue, double cutoff, double spacing,
                                 ov_speck_terms *terms);
void ov_speck_terms_destroy(ov_speck_terms *terms);

/* Half-sides of a box about a term in which its piece of the surface is looked for: from share 0,
 * where nothing is near, to 1, beyond which it is not small. */
void ov_speck_half(const ov_body *body, double isovalue, double spacing, double share,
                   double half[3]);

#endif
