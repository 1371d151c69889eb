#include "picture/palette.h"

#include <math.h>

double ov_srgb_decode(uint8_t encoded) {
    const double v = encoded / 255.0;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

uint8_t ov_srgb_encode(double linear) {
    const double v = fmin(fmax(linear, 0.0), 1.0);
    const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055;
    return (uint8_t)(s * 255.0 + 0.5);
}

ov_colour ov_colour_linear(uint32_t srgb) {
    ov_colour colour;
    for (int k = 0; k < 3; ++k)
        colour.rgba[k] = (float)ov_srgb_decode((uint8_t)(srgb >> (24 - 8 * k)));
    colour.rgba[3] = (float)(srgb & 0xffu) / 255.0f;
    return colour;
}

/* ---- between colours as the eye sees them ---------------------------------------------------- */

/* Oklab (B. Ottosson, 2020): equal differences look equal. */
static void oklab_of(const ov_colour *colour, double lab[3]) {
    const double r = colour->rgba[0], g = colour->rgba[1], b = colour->rgba[2];
    const double l = cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
    const double m = cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
    const double s = cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
    lab[0] = 0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s;
    lab[1] = 1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s;
    lab[2] = 0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s;
}

static ov_colour colour_of_oklab(const double lab[3]) {
    const double l = pow(lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2], 3.0);
    const double m = pow(lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2], 3.0);
    const double s = pow(lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2], 3.0);
    const double rgb[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                           -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                           -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
    ov_colour colour = {{0.0f, 0.0f, 0.0f, 1.0f}};
    for (int k = 0; k < 3; ++k)
        colour.rgba[k] = (float)fmin(fmax(rgb[k], 0.0), 1.0);
    return colour;
}

/* Colours between the stops, as many as a palette has. */
static void fill_between(const uint32_t *stops, int count, ov_colour palette[OV_PALETTE_SIZE]) {
    const int last = count - 1;
    for (int i = 0; i < OV_PALETTE_SIZE; ++i) {
        const double at = (double)i * last / (OV_PALETTE_SIZE - 1);
        const int stop = at < last ? (int)at : last - 1;
        const ov_colour from = ov_colour_linear(stops[stop]),
                        to = ov_colour_linear(stops[stop + 1]);
        double a[3], b[3];
        oklab_of(&from, a);
        oklab_of(&to, b);
        for (int k = 0; k < 3; ++k)
            a[k] += (at - stop) * (b[k] - a[k]);
        palette[i] = colour_of_oklab(a);
    }
}

void ov_palette_diverging(ov_colour palette[OV_PALETTE_SIZE]) {
    /* Darker toward both ends, which read apart without colour vision too. */
    static const uint32_t stops[] = {0x1f3f8fff, 0x3f7fc4ff, 0x9cc8e6ff, 0xf2f0ecff,
                                     0xf0b59aff, 0xd4604aff, 0x8f1a2eff};
    fill_between(stops, (int)(sizeof stops / sizeof *stops), palette);
}

void ov_palette_radial(ov_colour palette[OV_PALETTE_SIZE]) {
    static const uint32_t stops[] = {0x34569cff, 0x3f93b0ff, 0x7fbf9aff,
                                     0xe8d98cff, 0xe59a50ff, 0xbf4a3fff};
    fill_between(stops, (int)(sizeof stops / sizeof *stops), palette);
}

void ov_palette_distinct(ov_colour palette[OV_PALETTE_SIZE]) {
    const double turn = 2.399963229728653; /* the golden angle: no two near ones are alike */
    for (int i = 0; i < OV_PALETTE_SIZE; ++i) {
        const double lab[3] = {0.76 + 0.05 * (i % 3 - 1), 0.065 * cos(turn * i),
                               0.065 * sin(turn * i)};
        palette[i] = colour_of_oklab(lab);
    }
}
