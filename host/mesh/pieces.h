/*
 * The part of an endless lattice that a surface may pass through, cut into pieces, with the terms
 * that reach each of them. Memory follows the terms, not the box about them.
 */
#ifndef OV_PIECES_H
#define OV_PIECES_H

#include "base/base.h"
#include "field/quadric.h"

/* A term of a field, and how far it reaches: {q <= s^2} fits in a box of half-sides s * extent, and
 * a ball of radius s * least fits in it. */
typedef struct ov_body {
    ov_quadric quadric;
    double extent[3]; /* angstrom */
    double least;     /* angstrom */
} ov_body;

void ov_body_of_atom(const double xyzr[4], double decay, ov_body *body);
/* Of the Gaussian of an atom. */
void ov_body_of_ball(const ov_quadric *quadric, double decay, ov_body *body);
void ov_body_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, ov_body *body);

/* Those of ellipsoids given as quadrics, to be freed. */
ovoid_status ov_bodies_of_quadrics(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                                   ov_body **bodies);

/* The s up to which a term is at least `value`; negative where it nowhere is. */
double ov_body_reach(const ov_body *body, double value);

/* A piece holds size[0] x size[1] x size[2] points of the lattice of multiples of `spacing`. */
typedef struct ov_pieces {
    double spacing;    /* angstrom */
    int64_t origin[3]; /* lattice indices of the first piece's first point */
    uint64_t size[3];  /* points of a piece, whole bricks */
    uint64_t count[3]; /* pieces per axis */
    int64_t last[3];   /* lattice indices at which the lattice ends if it was clipped, open */
    size_t pieces;     /* of these, the ones that may meet the surface: */
    uint64_t *key;     /* (z * count[1] + y) * count[0] + x, ascending */
    size_t *start;     /* terms of piece p: term[start[p]] .. term[start[p + 1] - 1], */
    uint32_t *term;    /* ascending; pieces + 1 starts */
} ov_pieces;

/* The pieces with all cells and lattice edges that phi = isovalue may cross, each as large as limit
 * (lattice points per axis) or smaller, but where that is little more as large as `wanted`, whole
 * bricks within the limit; NULL: nothing is. Where no term reaches isovalue / count, phi <
 * isovalue; so a piece in which none does, one lattice step about it included, is left out. A piece
 * has the terms that reach cutoff in it, the lattice step included. OVOID_ERROR_LIMIT when the
 * lattice is too large. No pieces at all are not an error here. clip: a box, angstrom, a step
 * beyond which the lattice ends; NULL: none. */
ovoid_status ov_pieces_create(ovoid_context *context, const ov_body *bodies, size_t count,
                              double isovalue, double cutoff, double spacing,
                              const uint64_t limit[3], const uint64_t wanted[3], double clip[2][3],
                              ov_pieces *pieces);
void ov_pieces_destroy(ov_pieces *pieces);

/* Position of the first of ascending keys that is this one or higher; count where there is none. */
size_t ov_first_key(const uint64_t *keys, size_t count, uint64_t key);

/* Position of the piece with this key among the pieces, or pieces->pieces. */
size_t ov_pieces_find(const ov_pieces *pieces, uint64_t key);

#endif
