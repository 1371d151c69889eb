/*
 * The residues that an ellipsoid stands for, as text.
 */
#ifndef OV_PAGE_NAMES_H
#define OV_PAGE_NAMES_H

#include "base/base.h"

#include <stdio.h>

/* A JSON array of a text for each of `count` ellipsoids, whose atoms are order[first[e]] ..: "A:
 * PRO 1, GLN 2; B: PRO 1", chains in the order of their first atoms; "" where the molecule does not
 * say. Copies of an assembly are told apart by the number of their placement: "A/2". */
void ov_page_names(const ovoid_molecule *molecule, const uint32_t *first, const uint32_t *order,
                   size_t count, FILE *stream);

#endif
