/*
 * Colours: between sRGB, in which they are named and stored, and linear light, in which they are
 * mixed.
 */
#ifndef OV_PALETTE_H
#define OV_PALETTE_H

#include <stdint.h>

/* Red, green, blue, opacity, 0 .. 1. */
typedef struct ov_colour {
    float rgba[4];
} ov_colour;

/* Of 0xRRGGBBAA, in linear light; opacity is linear already. */
ov_colour ov_colour_linear(uint32_t srgb);

/* 0 .. 1 of linear light in 0 .. 255 of sRGB, and back. */
uint8_t ov_srgb_encode(double linear);
double ov_srgb_decode(uint8_t encoded);

#define OV_PALETTE_SIZE 256

/* Blue over white to red: from the least to the greatest value. Linear light. */
void ov_palette_diverging(ov_colour palette[OV_PALETTE_SIZE]);

/* From the inside to the outside of something large: blue, green, yellow, red. Linear light. */
void ov_palette_radial(ov_colour palette[OV_PALETTE_SIZE]);

/* Colours that neighbours in a list can be told apart by. Linear light. */
void ov_palette_distinct(ov_colour palette[OV_PALETTE_SIZE]);

#endif
