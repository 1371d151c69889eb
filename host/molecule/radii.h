/*
 * Radii of atoms that a file gives none, and those that the caller wants instead of the file's.
 */
#ifndef OV_MOLECULE_RADII_H
#define OV_MOLECULE_RADII_H

#include "molecule/reader.h"

/* Van der Waals radius of an element in angstrom; 0 where none is published. */
double ov_radius_of_element(int element);

/* Gives every atom that was read its radius. */
ovoid_status ov_radii_assign(ov_reader *reader);

/* ---- neighbours (bonds.c) ------------------------------------------------------------------ */

/* Which atoms are near which, for bonds. */
typedef struct ov_bonds ov_bonds;

ovoid_status ov_bonds_create(ovoid_context *context, const ovoid_molecule *molecule,
                             ov_bonds **bonds);
void ov_bonds_destroy(ov_bonds **bonds);

enum { OV_NEIGHBOURS_MAX = 8 };

/* Heavy atoms bonded to atom i, by distance: their places and how many. */
size_t ov_bonds_heavy(const ov_bonds *bonds, size_t i, double places[OV_NEIGHBOURS_MAX][3]);

/* Whether another atom of this name is within `distance` (at most 2.5) angstrom of atom i. */
bool ov_bonds_near(const ov_bonds *bonds, size_t i, const char *name, double distance);

/* The heavy atom that hydrogen i is bonded to, SIZE_MAX for none. */
size_t ov_bonds_of_hydrogen(const ov_bonds *bonds, size_t i);

/* ---- files (radii_file.c) ------------------------------------------------------------------ */

/* Radii that a file gives. */
typedef struct ov_radii_table ov_radii_table;

ovoid_status ov_radii_table_read(ovoid_context *context, const char *path, ov_radii_table **table);
void ov_radii_table_destroy(ov_radii_table **table);

/* By residue and atom, else by element; false where the file has neither. */
bool ov_radii_table_find(const ov_radii_table *table, const char *residue, const char *atom,
                         int element, double *radius);

#endif
