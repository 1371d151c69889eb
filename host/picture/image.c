#include "picture/image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool size_fits(uint32_t width, uint32_t height) {
    return width >= 1 && height >= 1 && width <= OVOID_PICTURE_SIDE_MAX &&
           height <= OVOID_PICTURE_SIDE_MAX;
}

ovoid_status ov_image_make(ovoid_context *context, uint32_t width, uint32_t height,
                           ovoid_image **image) {
    ovoid_image *const made = ov_alloc(context, 1, sizeof *made, "an image");
    if (!made)
        return OVOID_ERROR_MEMORY;
    *made = (ovoid_image){.width = width, .height = height};
    made->pixels = ov_alloc(context, (size_t)width * height, 4, "the pixels of an image");
    if (!made->pixels) {
        free(made);
        return OVOID_ERROR_MEMORY;
    }
    *image = made;
    return OVOID_OK;
}

ovoid_status ovoid_image_create(ovoid_context *context, uint32_t width, uint32_t height,
                                const uint8_t *pixels, ovoid_image **image) {
    OV_NEED(context, context);
    OV_NEED(context, pixels);
    OV_NEED(context, image);
    if (!size_fits(width, height))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "an image has 1 to %d pixels on a side, not %u by %u",
                       OVOID_PICTURE_SIDE_MAX, (unsigned)width, (unsigned)height);
    const ovoid_status status = ov_image_make(context, width, height, image);
    if (status == OVOID_OK)
        memcpy((*image)->pixels, pixels, (size_t)4 * width * height);
    return status;
}

void ovoid_image_destroy(ovoid_image **image) {
    if (!image || !*image)
        return;
    free((*image)->pixels);
    free(*image);
    *image = NULL;
}

uint32_t ovoid_image_width(const ovoid_image *image) {
    return image ? image->width : 0;
}

uint32_t ovoid_image_height(const ovoid_image *image) {
    return image ? image->height : 0;
}

const uint8_t *ovoid_image_pixels(const ovoid_image *image) {
    return image ? image->pixels : NULL;
}

uint64_t ovoid_image_covered(const ovoid_image *image) {
    return image ? image->covered : 0;
}

double ovoid_image_range(const ovoid_image *image) {
    return image ? image->range : NAN;
}

/* ---- drawing ------------------------------------------------------------------------------ */

void ov_image_blend(ovoid_image *image, int64_t x, int64_t y, const ov_colour *colour,
                    double share) {
    const double over = colour->rgba[3] * fmin(share, 1.0);
    if (x < 0 || y < 0 || x >= image->width || y >= image->height || !(over > 0.0))
        return;
    uint8_t *const pixel = image->pixels + 4 * ((size_t)y * image->width + (size_t)x);
    const double under = pixel[3] / 255.0 * (1.0 - over), whole = over + under;
    for (int k = 0; k < 3; ++k)
        pixel[k] =
            ov_srgb_encode((over * colour->rgba[k] + under * ov_srgb_decode(pixel[k])) / whole);
    pixel[3] = (uint8_t)(whole * 255.0 + 0.5);
}

/* Nearest whole numbers that enclose [low, high] within [0, size). */
static void clip(double low, double high, uint32_t size, int64_t *first, int64_t *end) {
    *first = (int64_t)fmin(fmax(floor(low), 0.0), size);
    *end = (int64_t)fmin(fmax(ceil(high), 0.0), size);
}

void ov_image_disc(ovoid_image *image, double x, double y, double radius, const ov_colour *colour) {
    int64_t left, right, top, bottom;
    clip(x - radius - 1.0, x + radius + 1.0, image->width, &left, &right);
    clip(y - radius - 1.0, y + radius + 1.0, image->height, &top, &bottom);
    for (int64_t row = top; row < bottom; ++row)
        for (int64_t column = left; column < right; ++column) {
            const double away = hypot((double)column + 0.5 - x, (double)row + 0.5 - y);
            ov_image_blend(image, column, row, colour, fmax(radius + 0.5 - away, 0.0));
        }
}

/* Part of [low, high] that lies in the pixel at `at`. */
static double overlap(double low, double high, int64_t at) {
    return fmax(fmin(high, (double)at + 1.0) - fmax(low, (double)at), 0.0);
}

void ov_image_rectangle(ovoid_image *image, double left, double top, double right, double bottom,
                        const ov_colour *colour) {
    int64_t first_column, end_column, first_row, end_row;
    clip(left, right, image->width, &first_column, &end_column);
    clip(top, bottom, image->height, &first_row, &end_row);
    for (int64_t row = first_row; row < end_row; ++row)
        for (int64_t column = first_column; column < end_column; ++column)
            ov_image_blend(image, column, row, colour,
                           overlap(left, right, column) * overlap(top, bottom, row));
}

void ov_image_place(ovoid_image *image, uint32_t left, uint32_t top, const ovoid_image *from) {
    for (uint32_t row = 0; row < from->height; ++row)
        memcpy(image->pixels + 4 * ((size_t)(top + row) * image->width + left),
               from->pixels + 4 * (size_t)row * from->width, (size_t)4 * from->width);
}

bool ovoid_image_radii(const ovoid_image *image, double radii[2]) {
    const bool known = image && image->radii[1] > 0.0;
    if (known && radii)
        memcpy(radii, image->radii, sizeof image->radii);
    return known;
}
