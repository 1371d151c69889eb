/*
 * Radii of heavy atoms that also stand for hydrogens a structure does not hold, so that its
 * Gaussian surface has the area and the volume of the one with hydrogens: docs/radii.md.
 *
 * Names are those of PDB and mmCIF files, in upper case and without blanks; nucleotides also in
 * their older spellings. Elements are in any case. Nothing here allocates or fails.
 */
#ifndef OV_MOLECULE_UNITED_H
#define OV_MOLECULE_UNITED_H

#include <stddef.h>

/* Which ends of its chain a residue is, as bits. */
enum {
    OV_UNITED_FIRST = 1, /* N-terminus; for a nucleotide a 5' end without a phosphate */
    OV_UNITED_LAST = 2   /* C-terminus or 3' end */
};

/* How many hydrogens are bonded to a heavy atom of a known residue at pH 7; -1 where residue or
 * atom is unknown. HIS is neutral with a hydrogen on NE2, CYS a thiol: in a disulfide it is to be
 * called CYX. N-termini are charged. */
int ov_united_hydrogens(const char *residue, const char *atom, unsigned ends);

/* Longest distance of bonded atoms in angstrom: of C, N and O among each other, and where one of
 * the two is of a later row. */
#define OV_UNITED_BOND 1.9
#define OV_UNITED_BOND_LONG 2.2

/* The same for an atom of an unknown residue, from its place and the places of all heavy atoms
 * bonded to it (angstrom): a guess by their number, the bonds' lengths and their angles. -1 for
 * elements other than C, N, O, P and S. */
int ov_united_hydrogens_of_shape(const char *element, const double place[3], size_t neighbours,
                                 const double (*others)[3]);

typedef enum ov_united_source {
    OV_UNITED_NONE,   /* the element has no united radius: metals, halogens, hydrogen */
    OV_UNITED_ATOM,   /* the number of hydrogens was given, or residue and atom are known */
    OV_UNITED_ELEMENT /* hydrogens unknown: what is usual for the element */
} ov_united_source;

/* The radius in angstrom of a heavy atom that also stands for so many hydrogens: those the file
 * lacks, at most as many as the element takes. With hydrogens = -1 it stands for those of
 * ov_united_hydrogens() inside a chain. *radius stays as it is for OV_UNITED_NONE. */
ov_united_source ov_united_radius(const char *residue, const char *atom, const char *element,
                                  int hydrogens, double *radius);

#endif
