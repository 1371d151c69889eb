/*
 * PNG files, by libpng.
 */
#ifndef OV_PNG_H
#define OV_PNG_H

#include "picture/image.h"

#include <stdio.h>

/* Writes the image to an open stream: RGBA, or RGB where every pixel is opaque, 8 bits, sRGB. */
ovoid_status ov_png_write(ovoid_context *context, const ovoid_image *image, FILE *stream);

#endif
