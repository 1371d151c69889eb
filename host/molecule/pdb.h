/*
 * The columns of a PDB file, for PQR files that keep to them.
 */
#ifndef OV_MOLECULE_PDB_H
#define OV_MOLECULE_PDB_H

#include "molecule/sites.h"
#include "molecule/text.h"

/* Reads who an atom is from its columns, all but occupancy and temperature factor. The line has at
 * least 16 characters. */
void ov_pdb_site(const ov_line *line, ov_site *site);

#endif
