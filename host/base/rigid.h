/*
 * Rigid motions: a rotation and a translation, as the placements of an assembly are.
 */
#ifndef OV_RIGID_H
#define OV_RIGID_H

#include <stdbool.h>
#include <stddef.h>

/* x' = rotation x + shift. */
typedef struct ov_rigid {
    double rotation[9]; /* row by row */
    double shift[3];    /* angstrom */
} ov_rigid;

extern const ov_rigid ov_rigid_identity;

void ov_rigid_move(const ov_rigid *rigid, const double at[3], double moved[3]);

/* Directions turn, and do not move. */
void ov_rigid_turn(const ov_rigid *rigid, const double direction[3], double turned[3]);

/* Whether it keeps shapes: its rows are unit vectors, at right angles to each other to within
 * `most`, and nothing is mirrored. */
bool ov_is_rotation(const double rotation[9], double most);

ov_rigid ov_rigid_inverse(const ov_rigid *rigid);

/* First the one, then the other. */
ov_rigid ov_rigid_after(const ov_rigid *first, const ov_rigid *second);

/* Of a group: where the axes of all its motions meet, the mean of what they make of any place. */
void ov_rigid_centre(const ov_rigid *motions, size_t count, double centre[3]);

/* The one of these motions that turns most like it: of a group the only one that may be it. */
size_t ov_rigid_find(const ov_rigid *motions, size_t count, const ov_rigid *wanted);

#endif
