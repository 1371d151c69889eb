/*
 * What a molecule is inside the library.
 */
#ifndef OV_MOLECULE_MOLECULE_H
#define OV_MOLECULE_MOLECULE_H

#include "base/base.h"

/* Bounds of what is taken for a molecule. Far beyond any assembly and any coarse-grained bead, they
 * catch columns read wrongly, and keep squared distances well within single precision. */
#define OV_COORDINATE_LIMIT 1e6 /* |x|, |y|, |z|, angstrom */
#define OV_RADIUS_LIMIT 100.0   /* angstrom */

enum { OV_GUESSES_MAX = 64 };

struct ovoid_molecule {
    double *xyzr; /* 4 * atoms, owned */
    size_t atoms;
    ovoid_atom *identity; /* atoms of them, owned; NULL: none */
    ovoid_residue *residues;
    size_t residue_count;
    ovoid_molecule_counts counts;
    ovoid_molecule_format format;
    ovoid_radii radii;
    int32_t model;
    ovoid_guess *guesses;
    size_t guess_count;
};

#endif
