/*
 * The table behind united.h, a file of its own since a program writes it
 * (bench/calibrate_radii.py).
 */
#ifndef OV_MOLECULE_UNITED_TABLE_H
#define OV_MOLECULE_UNITED_TABLE_H

#include <stddef.h>

typedef struct ov_united_residue {
    char name[8];
    char same[8];     /* the residue whose atoms it has: itself unless it is another spelling */
    char backbone[8]; /* where else to look for its atoms */
} ov_united_residue;

typedef struct ov_united_atom {
    char residue[8]; /* or a backbone */
    char atom[8];
    int hydrogens;
} ov_united_atom;

enum { OV_UNITED_MOST = 5 };

typedef struct ov_united_element {
    char element[4]; /* upper case */
    int count;       /* of radii */
    int usual;       /* hydrogens where nothing is known */
    double radii[OV_UNITED_MOST];
} ov_united_element;

extern const ov_united_residue ov_united_residues[];
extern const size_t ov_united_residues_count;
extern const ov_united_atom ov_united_atoms[];
extern const size_t ov_united_atoms_count;
extern const ov_united_element ov_united_elements[];
extern const size_t ov_united_elements_count;

#endif
