/*
 * Numbers and their unit on pictures: a font of strokes, smooth at every size.
 */
#ifndef OV_LABEL_H
#define OV_LABEL_H

#include "picture/image.h"

/* Draws text with its left edge at x and digits from top to top + height, in pixels. Known are
 * digits, '+', '-', '.', 'e', ' ' and 'A' for the sign of the angstrom; others leave a gap. */
void ov_label_draw(ovoid_image *image, double x, double top, double height, const char *text,
                   const ov_colour *colour);

/* Width of the text, in pixels. */
double ov_label_width(double height, const char *text);

#endif
