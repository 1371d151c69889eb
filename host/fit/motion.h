/*
 * A model that goes along with its atoms: from where they were to where they are.
 */
#ifndef OV_MOTION_H
#define OV_MOTION_H

#include "base/base.h"
#include "field/quadric.h"

/* A rigid motion: x becomes rotation (x - from) + to. */
typedef struct ov_motion {
    double rotation[3][3];
    double from[3], to[3];
} ov_motion;

/* The one that brings points nearest to others in the sum of squares (Kabsch 1976,
 * doi:10.1107/S0567739476001873): points pick[n] of both, x, y, z and a fourth number each; pick
 * NULL: the first `count`. Without any point it stands still, and about what points leave open
 * (those on a line) it turns in some way. */
void ov_motion_of(const double *before, const double *after, const uint32_t *pick, size_t count,
                  ov_motion *motion);

void ov_motion_apply(const ov_motion *motion, ov_quadric *quadric);

/* Moves each ellipsoid with the atoms that it owns, and turns it as the atoms about it have
 * turned. */
ovoid_status ov_move_with_atoms(ovoid_context *context, const double *before, const double *after,
                                size_t atoms, const uint32_t *owner, ov_quadric *quadrics,
                                size_t count);

#endif
