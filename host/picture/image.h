/*
 * A picture in memory, and drawing on it.
 */
#ifndef OV_IMAGE_H
#define OV_IMAGE_H

#include "base/base.h"
#include "ovoid/ovoid.h"
#include "picture/palette.h"

struct ovoid_image {
    uint32_t width, height;
    uint8_t *pixels; /* RGBA, sRGB, not premultiplied, rows from the top */
    uint64_t covered;
    double range;
    double radii[2]; /* of colours by radius, else 0, 0 */
};

/* All pixels are transparent black. Positions below are in pixels from the upper left corner of the
 * image; the middle of the first pixel is at (0.5, 0.5). */
ovoid_status ov_image_make(ovoid_context *context, uint32_t width, uint32_t height,
                           ovoid_image **image);

/* Lays `colour` (linear light) over a pixel with its opacity times `share`; outside the image
 * nothing happens. */
void ov_image_blend(ovoid_image *image, int64_t x, int64_t y, const ov_colour *colour,
                    double share);

/* Draws a disc with a smooth edge. */
void ov_image_disc(ovoid_image *image, double x, double y, double radius, const ov_colour *colour);

/* Fills the rectangle, edges smooth. */
void ov_image_rectangle(ovoid_image *image, double left, double top, double right, double bottom,
                        const ov_colour *colour);

/* Copies all of `from` to (left, top), which must have room for it. */
void ov_image_place(ovoid_image *image, uint32_t left, uint32_t top, const ovoid_image *from);

#endif
