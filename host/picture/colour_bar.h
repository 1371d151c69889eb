/*
 * The bar that explains the colours of a difference.
 */
#ifndef OV_COLOUR_BAR_H
#define OV_COLOUR_BAR_H

#include "picture/image.h"

/* Pixels that the bar takes at the right of a picture of this size; 0 where there is no room. */
uint32_t ov_colour_bar_width(uint32_t width, uint32_t height);

/* Draws it there: -range to range (angstrom) from the bottom to the top, with ticks. */
void ov_colour_bar_draw(ovoid_image *image, const ov_colour palette[OV_PALETTE_SIZE], double range,
                        const ov_colour *ink);

/* The smallest of 1, 2, 4, 6, 8 times a power of ten that is at least `value`. */
double ov_round_up(double value);

#endif
