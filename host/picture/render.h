/*
 * Pictures: light on what the rays meet, layers put together, marks drawn on top.
 */
#ifndef OV_RENDER_H
#define OV_RENDER_H

#include "ovoid/ovoid.h"
#include "picture/camera.h"
#include "picture/rays.h"

/* How surfaces are lit; directions are unit vectors in the camera's frame. */
typedef struct ov_lights {
    float key[4];  /* toward the main light, strength */
    float fill[4]; /* toward a large soft light, strength */
    float ambient; /* from all around */
    float fade;    /* share of the haze at the far end */
    float reach;   /* angstrom, within which neighbours shade each other */
} ov_lights;
extern const ov_lights ov_default_lights;

/* Part of the largest term at which a picture's fields are cut off: moves surfaces by less than
 * 1e-4 angstrom. */
#define OV_PICTURE_CUTOFF 1e-5

#endif
