/*
 * The lattice of constrained points cut into pieces, with the atoms that reach each of them. Memory
 * and work follow the atoms, not the box about them.
 */
#ifndef OV_PIECE_GRID_H
#define OV_PIECE_GRID_H

#include "field/field.h"

/* Equal pieces of whole bricks; the last ones of an axis may reach past the lattice's end. */
typedef struct ov_piece_grid {
    uint64_t size[3];  /* lattice points of a piece */
    uint64_t count[3]; /* pieces per axis */
    size_t pieces;     /* of these, the ones that count: */
    uint64_t *key;     /* (z * count[1] + y) * count[0] + x, ascending */
    size_t *start;     /* atoms of piece p: atom[start[p]] .. atom[start[p + 1] - 1], ascending */
    uint32_t *atom;
} ov_piece_grid;

/* The pieces that some atom reaches at the cut-off OV_TARGET_CUTOFF; and, with_empty, the others
 * too, unless nearly all are such: space between atoms that are far apart is left out.
 * OVOID_ERROR_LIMIT where it all would have too many points. */
ovoid_status ov_piece_grid_create(ovoid_context *context, const ov_lattice *lattice,
                                  const double *xyzr, size_t atoms, double decay, bool with_empty,
                                  ov_piece_grid *grid);
void ov_piece_grid_destroy(ov_piece_grid *grid);

/* Position of a piece along the axes, in pieces. */
void ov_piece_grid_at(const ov_piece_grid *grid, size_t piece, uint64_t at[3]);

#endif
