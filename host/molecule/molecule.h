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

/* Atoms of the unit that some placements take. */
typedef struct ov_part {
    uint32_t *index; /* atoms of them, ascending; NULL: the whole unit */
    size_t atoms;
} ov_part;

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
    int32_t *models; /* numbers of all in the file, ascending, owned; NULL: 1 alone */
    size_t model_count;
    ovoid_guess *guesses;
    size_t guess_count;

    /* Assemblies: those of the file, and the placements of the atoms above in the one that this
     * molecule is. */
    ovoid_assembly_info *assemblies;
    size_t assembly_count;
    ovoid_placement *placements; /* NULL: this is no assembly */
    size_t placement_count;
    ov_part *parts;
    size_t part_count;
    size_t all_atoms;
    double *all_xyzr; /* 4 * all_atoms, made when first asked for */
};

/* Where its atoms are, and of an assembly where its placements are, and nothing else of it. */
ovoid_status ov_molecule_copy_atoms(ovoid_context *context, const ovoid_molecule *molecule,
                                    ovoid_molecule **copy);

/* When all radii are known: of a structure they come last. */
void ov_molecule_count_zero_radii(ovoid_molecule *molecule);

/* Warns of atoms without a radius, and of atoms at the place of another. */
ovoid_status ov_molecule_doubts(ovoid_context *context, const char *name,
                                const ovoid_molecule *molecule);

#endif
