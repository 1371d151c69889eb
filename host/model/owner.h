/*
 * Which ellipsoid each atom is part of, kept right while ellipsoids are split and merged. owner
 * has one entry per atom: an index among the ellipsoids.
 */
#ifndef OV_OWNER_H
#define OV_OWNER_H

#include "base/base.h"
#include "field/quadric.h"

/* After splits: twin leads from each half to the other one, UINT32_MAX where an ellipsoid was not
 * split, and owner still holds one of the two, the same for all atoms. An atom goes to the half
 * that has the larger value at its centre; a half that would own nothing gets the atom that loses
 * least by it, unless it is the only one. */
ovoid_status ov_owner_split(ovoid_context *context, const double *xyzr, size_t atoms,
                            const ov_quadric *quadrics, size_t count, const uint32_t *twin,
                            uint32_t *owner);

/* After merges of `before` ellipsoids to `count`: follows parents, as of ov_merging, from the
 * owners among those before. owner may be owner_before. */
ovoid_status ov_owner_merge(ovoid_context *context, const uint32_t *parents, size_t count,
                            size_t before, const uint32_t *owner_before, size_t atoms,
                            uint32_t *owner);

/* After many splits and merges: an atom at whose centre its ellipsoid's value has fallen below
 * `share` of the largest there goes to the ellipsoid with the largest, unless it is the last that
 * its own has. Only ellipsoids with centres within `reach` (angstrom) of an atom are looked at. */
ovoid_status ov_owner_tidy(ovoid_context *context, const double *xyzr, size_t atoms,
                           const ov_quadric *quadrics, size_t count, double share, double reach,
                           uint32_t *owner);

/* The ellipsoid with the largest value at a point. */
uint32_t ov_owner_at(const ov_quadric *quadrics, size_t count, const double at[3]);

#endif
