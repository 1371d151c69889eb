#include "mesh/case_table.h"

#include <stdbool.h>
#include <string.h>

/*
 * The surface meets each face of a cell in segments that depend on the face's four corners alone,
 * so that the two cells of a face agree and no hole can open. Going round a face counter-clockwise,
 * seen from outside the cell, each run of inside corners is cut off by one segment from the edge
 * that enters it to the edge that leaves it. Where inside corners are diagonal (an ambiguous face)
 * that separates them. Each crossed edge of a cell is entered on one of its two faces and left on
 * the other, so the segments close to loops, which are cut into triangles.
 *
 * A cut between two vertices of the same face would lie in that face, and the cell beyond might
 * have the same one: an edge with four triangles. Hence only cuts through the cell's inside are
 * taken; the first triangulation in a fixed order that has no others.
 */

#define LOOP_MAX 12
#define CORNERS 8

static unsigned edge_between(unsigned from, unsigned to) {
    const unsigned bit = from ^ to, axis = bit == 1 ? 0 : bit == 2 ? 1 : 2;
    return (from & to) + CORNERS * axis;
}

/* Corners of the face `side` (0 or 1) of this axis, counter-clockwise seen from outside the cell.
 */
static void face_corners(unsigned axis, unsigned side, unsigned corner[4]) {
    const unsigned u = 1u << (axis + 1) % 3, v = 1u << (axis + 2) % 3, base = side << axis;
    const unsigned around[4] = {base, base | u, base | u | v, base | v};
    for (unsigned k = 0; k < 4; ++k)
        corner[k] = around[side ? k : 3 - k];
}

static bool inside(unsigned index, unsigned corner) {
    return index >> corner & 1u;
}

/* Adds the segments of one face. */
static void face_segments(unsigned index, const unsigned corner[4], uint8_t next[OV_CELL_EDGES]) {
    for (unsigned k = 0; k < 4; ++k) {
        if (inside(index, corner[k]) || !inside(index, corner[(k + 1) % 4]))
            continue;
        unsigned last = (k + 1) % 4;
        while (inside(index, corner[(last + 1) % 4]))
            last = (last + 1) % 4;
        next[edge_between(corner[k], corner[(k + 1) % 4])] =
            (uint8_t)edge_between(corner[last], corner[(last + 1) % 4]);
    }
}

void ov_case_segments(unsigned index, uint8_t next[OV_CELL_EDGES]) {
    unsigned corner[4];
    memset(next, OV_CELL_EDGES, OV_CELL_EDGES);
    for (unsigned axis = 0; axis < 3; ++axis)
        for (unsigned side = 0; side < 2; ++side) {
            face_corners(axis, side, corner);
            face_segments(index, corner, next);
        }
}

/* The two faces of an edge as bits: face `side` of an axis is bit 2 * axis + side. */
static unsigned faces_of(unsigned edge) {
    const unsigned corner = edge % CORNERS, axis = edge / CORNERS;
    unsigned faces = 0;
    for (unsigned other = 0; other < 3; ++other)
        if (other != axis)
            faces |= 1u << (2 * other + (corner >> other & 1u));
    return faces;
}

static bool cut_allowed(unsigned a, unsigned b) {
    return (faces_of(a) & faces_of(b)) == 0;
}

/* Triangles for loop[first .. last], a polygon whose side from last to first exists already. The
 * third corner of that side's triangle is tried in ascending order. */
static bool triangulate(const uint8_t *loop, unsigned first, unsigned last, uint8_t *entry) {
    if (last - first < 2)
        return true;
    for (unsigned middle = first + 1; middle < last; ++middle) {
        if ((middle > first + 1 && !cut_allowed(loop[first], loop[middle])) ||
            (middle + 1 < last && !cut_allowed(loop[middle], loop[last])))
            continue;
        const uint8_t before = entry[0];
        uint8_t *const triangle = entry + 1 + 3 * before;
        triangle[0] = loop[first];
        triangle[1] = loop[middle];
        triangle[2] = loop[last];
        ++entry[0];
        if (triangulate(loop, first, middle, entry) && triangulate(loop, middle, last, entry))
            return true;
        entry[0] = before;
    }
    return false;
}

static void make_case(unsigned index, uint8_t entry[OV_CASE_BYTES]) {
    uint8_t next[OV_CELL_EDGES], loop[LOOP_MAX];
    ov_case_segments(index, next);
    for (unsigned edge = 0; edge < OV_CELL_EDGES; ++edge) {
        unsigned length = 0;
        for (unsigned at = edge; next[at] != OV_CELL_EDGES;) {
            const unsigned to = next[at];
            loop[length++] = (uint8_t)at;
            next[at] = OV_CELL_EDGES;
            at = to;
        }
        if (length > 0)
            triangulate(loop, 0, length - 1, entry);
    }
}

void ov_case_table_make(ov_case_table *table) {
    memset(table, 0, sizeof *table);
    for (unsigned index = 0; index < OV_CASES; ++index)
        make_case(index, table->entry[index]);
}
