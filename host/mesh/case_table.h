/*
 * Marching cubes' table: for each of the 256 ways in which the corners of a cell can lie inside
 * (phi > c) or outside, the triangles that separate them. Made by a rule, not copied from a table:
 * see case_table.c.
 */
#ifndef OV_CASE_TABLE_H
#define OV_CASE_TABLE_H

#include "shared.h"

#include <stdint.h>

#define OV_CASES 256
#define OV_CASE_TRIANGLES 5 /* the most that a case has */

/* Corner b of a cell lies at (b & 1, b >> 1 & 1, b >> 2) of its low corner, and bit b of a case
 * says that it is inside. An edge is the corner at its low end with its axis: corner + 8 * axis. */
typedef struct ov_case_table {
    uint8_t entry[OV_CASES][OV_CASE_BYTES];
} ov_case_table;

/* Triangles are counter-clockwise seen from outside. Takes some microseconds. */
void ov_case_table_make(ov_case_table *table);

#define OV_CELL_EDGES 24 /* codes of edges; half of them name an edge */

/* next[e]: the edge at the other end of the segment that begins at edge e, for the segments in
 * which the case's surface meets the cell's faces; OV_CELL_EDGES for edges that are not crossed. */
void ov_case_segments(unsigned index, uint8_t next[OV_CELL_EDGES]);

#endif
