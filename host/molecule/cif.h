/*
 * The reader of mmCIF files.
 */
#ifndef OV_MOLECULE_CIF_H
#define OV_MOLECULE_CIF_H

#include "molecule/reader.h"

typedef struct ov_cif ov_cif;

#endif
