#include "picture/colour_bar.h"

#include "picture/label.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Sizes as parts of the picture's height. */
#define TEXT 0.024
#define TEXT_LEAST 7.0 /* pixels */
#define ROOM_LEAST 100 /* pixels on a side, for a bar to be worth its place */

/* All measures follow from the text's height. */
static double text_height(uint32_t width, uint32_t height) {
    return fmax(TEXT * fmin(height, width), TEXT_LEAST);
}

uint32_t ov_colour_bar_width(uint32_t width, uint32_t height) {
    if (width < ROOM_LEAST || height < ROOM_LEAST)
        return 0;
    return (uint32_t)ceil(9.0 * text_height(width, height));
}

double ov_round_up(double value) {
    static const double steps[] = {1.0, 2.0, 4.0, 6.0, 8.0, 10.0};
    if (!(value > 1e-30 && value < 1e30))
        return 1.0;
    const double power = pow(10.0, floor(log10(value)));
    for (size_t k = 0; k < sizeof steps / sizeof steps[0]; ++k)
        if (steps[k] * power >= value * (1.0 - 1e-9))
            return steps[k] * power;
    return 10.0 * power;
}

static void print_tick(double value, char *text, size_t size) {
    snprintf(text, size, "%+.3g", value);
    if (value == 0.0)
        snprintf(text, size, "0");
    /* The decimal sign of the locale is a point here. */
    const char *const sign = localeconv()->decimal_point;
    char *const at = sign && sign[0] ? strstr(text, sign) : NULL;
    if (at && at[0] != '.') {
        memmove(at + 1, at + strlen(sign), strlen(at + strlen(sign)) + 1);
        at[0] = '.';
    }
}

void ov_colour_bar_draw(ovoid_image *image, const ov_colour palette[OV_PALETTE_SIZE], double range,
                        const ov_colour *ink) {
    if (ov_colour_bar_width(image->width, image->height) == 0)
        return;
    const double text = text_height(image->width, image->height), line = fmax(text / 12.0, 1.0);
    const double right = image->width - 6.4 * text, left = right - 1.2 * text;
    const double top = floor(0.2 * image->height), bottom = ceil(0.8 * image->height);
    ov_image_rectangle(image, left - line, top - line, right + line, bottom + line, ink);
    for (double y = top; y < bottom; y += 1.0) {
        const double at = (bottom - y - 0.5) / (bottom - top);
        ov_image_rectangle(image, left, y, right, y + 1.0,
                           &palette[(int)(at * (OV_PALETTE_SIZE - 1) + 0.5)]);
    }
    for (int tick = -2; tick <= 2; ++tick) {
        char label[32];
        const double y = 0.5 * (top + bottom) - 0.25 * tick * (bottom - top);
        print_tick(0.5 * tick * range, label, sizeof label);
        ov_image_rectangle(image, right, y - 0.5 * line, right + 0.5 * text, y + 0.5 * line, ink);
        /* Signs stand in a column of their own, so that digits are in line. */
        const double sign = tick == 0 ? ov_label_width(text, "+") + 0.26 * text : 0.0;
        ov_label_draw(image, right + 0.9 * text + sign, y - 0.5 * text, text, label, ink);
    }
    ov_label_draw(image, 0.5 * (left + right) - 0.38 * text, top - 2.4 * text, text, "A", ink);
}
