/*
 * The symmetry of an assembly: the motions that carry it into itself, placement onto placement. The
 * placements of a capsid need not be its symmetry: there may be several of the same chain that lie
 * differently about its axes, and these together are the unit that all motions repeat.
 */
#ifndef OV_MOLECULE_SYMMETRY_H
#define OV_MOLECULE_SYMMETRY_H

#include "base/base.h"
#include "base/rigid.h"

typedef struct ov_symmetry {
    ov_rigid *motion;  /* order of them, the identity first: a group */
    size_t order;      /* 1: none */
    size_t units;      /* placements that make up the unit */
    size_t *placement; /* their numbers */
    size_t *atoms;     /* of each of them */
    size_t unit_atoms; /* of all of them */
    size_t *first; /* first[g * units + u]: number among all atoms of the first one of what motion g
                      makes of the unit's placement u */
} ov_symmetry;

/* Finds it: order 0 and nothing else where the molecule is no assembly, or one of more placements
 * than are looked at. Motions that carry atoms to within 0.01 angstrom of others count. */
ovoid_status ov_symmetry_find(ovoid_context *context, const ovoid_molecule *molecule,
                              ov_symmetry *symmetry);
void ov_symmetry_destroy(ov_symmetry *symmetry);

/* The atoms of the unit, x, y, z, radius each, placement after placement: 4 * unit_atoms values, to
 * be freed. */
ovoid_status ov_symmetry_unit(ovoid_context *context, const ovoid_molecule *molecule,
                              const ov_symmetry *symmetry, double **xyzr);

#endif
