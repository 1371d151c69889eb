/*
 * Blocks of binary data in a page: what they hold is made smaller by differences from one value to
 * the next and by deflate (RFC 1950), and becomes text by base64 (RFC 4648), in an element
 * <script type="application/octet-stream" id="...">. The other end is decode() in page/page.js.
 */
#ifndef OV_PAGE_BLOCKS_H
#define OV_PAGE_BLOCKS_H

#include "base/base.h"

#include <stdio.h>

/* How a surface's vertices are made whole numbers: x = low + step * (0 .. 65535). */
typedef struct ov_page_box {
    double low[3], step;
} ov_page_box;

/* The smallest one about a mesh. */
void ov_page_box_of(const ovoid_mesh *mesh, ov_page_box *box);

/* Positions, normals and triangles. */
ovoid_status ov_page_put_surface(ovoid_context *context, const ovoid_mesh *mesh,
                                 const ov_page_box *box, const char *id, FILE *stream);

/* A number per vertex, between -range and range, as a whole one of -127 to 127. */
ovoid_status ov_page_put_scalars(ovoid_context *context, const float *values, size_t count,
                                 double range, const char *id, FILE *stream);

/* Per ellipsoid 14 floats: centre relative to the origin, semi-axes, the first two axes,
 * amplitude, number of atoms. atoms may be NULL: not known, written as -1. */
ovoid_status ov_page_put_ellipsoids(ovoid_context *context, const ovoid_model *model,
                                    double isovalue, const double origin[3], const uint32_t *first,
                                    const char *id, FILE *stream);

/* Text, such as JSON. */
ovoid_status ov_page_put_text(ovoid_context *context, const char *text, size_t length,
                              const char *id, FILE *stream);

#endif
