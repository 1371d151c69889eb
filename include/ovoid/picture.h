/*
 * Pictures of surfaces.
 */
#ifndef OVOID_PICTURE_H
#define OVOID_PICTURE_H

#include "ovoid/field.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a picture shows. */
typedef enum ovoid_view {
    OVOID_VIEW_ORIGINAL = 0, /* the molecule's surface */
    OVOID_VIEW_MODEL,        /* the model's surface */
    OVOID_VIEW_OVERLAY,      /* the model's surface under the molecule's as tinted glass */
    OVOID_VIEW_DIFFERENCE,   /* the molecule's surface, coloured by how far outside it the model's
                                lies, (phi~ - phi) / |grad phi|, with a colour bar in angstrom */
    OVOID_VIEW_ELLIPSOIDS,   /* each ellipsoid by itself, where its own Gaussian is c; one whose
                                amplitude is at most c shows its centre alone */
    OVOID_VIEW_PANEL         /* original, model with centres, and overlay side by side */
} ovoid_view;

/* What colours a surface. */
typedef enum ovoid_picture_colouring {
    OVOID_PICTURE_PLAIN = 0, /* one colour; each ellipsoid has its own */
    OVOID_PICTURE_BY_RADIUS, /* views original, model and ellipsoids: how far what is seen is from
                                the middle of the atoms' or ellipsoids' centres, blue for near, red
                                for far */
    OVOID_PICTURE_BY_UNIT    /* view ellipsoids: those of a placement of the model's unit alike */
} ovoid_picture_colouring;

#define OVOID_PICTURE_SIDE_MAX 16384 /* pixels */
#define OVOID_PICTURE_SAMPLES_MAX 8  /* rays across a pixel */

/* A colour as 0xRRGGBBAA (sRGB). */
typedef struct ovoid_picture_options {
    size_t size;
    ovoid_view view;
    uint32_t width, height; /* pixels, 1 .. OVOID_PICTURE_SIDE_MAX; of the whole panel */
    uint32_t samples;       /* rays across a pixel, 1 .. OVOID_PICTURE_SAMPLES_MAX: a pixel is the
                               mean of samples^2 rays */
    double isovalue;        /* c; 0: that of the original, or of the model where there is none */
    double direction[3];    /* from the molecule to the eye; 0, 0, 0: along the least principal axis
                               of the atoms' centres. The longest one lies across the longer side. */
    double rotation[3]; /* about the screen's x (right), y (up), z (to the eye), radian: turns the
                           molecule after that, in this order */
    double centre[3];   /* angstrom, in the middle of the picture; NAN: chosen to fit */
    double across;      /* angstrom across the width of a picture; 0: chosen to fit */
    uint32_t original;  /* colours of the surfaces; opacity is not used */
    uint32_t model;
    uint32_t points;     /* of the centres */
    uint32_t background; /* opacity 00 makes it transparent */
    bool centres;        /* show the ellipsoids' centres in views of the model */
    bool colour_bar;     /* of the difference */
    double range;        /* of the difference's colours, angstrom to either side; 0: fits 99 % of
                            what is seen */
    ovoid_picture_colouring colouring; /* PLAIN; one that the view does not have is refused */
} ovoid_picture_options;

/* OVOID_VIEW_ORIGINAL, 1200 by 900 pixels of 3^2 rays, isovalue 0, default direction, fit to size,
 * a white background, centres and colour bar shown; size is sizeof *options. */
OVOID_API void ovoid_picture_options_init(ovoid_picture_options *options, size_t size);

typedef struct ovoid_image ovoid_image;

/* Takes a picture on the device: orthographic, shaded, with ambient occlusion and depth fading.
 * original is the field of the molecule, as a rule, and model that of the model; the view decides
 * which of the two are needed, and the other may be NULL. The same input, options, device and
 * driver give the same bytes.
 *
 * A surface that is out of sight or does not exist (the isovalue is above the field's maximum) is
 * no error: the picture shows the background, and ovoid_image_covered() is 0. */
OVOID_API ovoid_status ovoid_render(ovoid_context *context, ovoid_field *original,
                                    ovoid_field *model, const ovoid_picture_options *options,
                                    ovoid_image **image);

/* Makes an image of pixels (copied): 4 * width * height bytes as ovoid_image_pixels(). */
OVOID_API ovoid_status ovoid_image_create(ovoid_context *context, uint32_t width, uint32_t height,
                                          const uint8_t *pixels, ovoid_image **image);
OVOID_API void ovoid_image_destroy(ovoid_image **image);

OVOID_API uint32_t ovoid_image_width(const ovoid_image *image);
OVOID_API uint32_t ovoid_image_height(const ovoid_image *image);

/* Red, green, blue, opacity of each pixel (sRGB, not premultiplied), rows from the top. */
OVOID_API const uint8_t *ovoid_image_pixels(const ovoid_image *image);

/* Pixels in which ovoid_render() saw a surface; 0 for other images. */
OVOID_API uint64_t ovoid_image_covered(const ovoid_image *image);

/* The range of colours of OVOID_VIEW_DIFFERENCE, angstrom to either side; 0 for other views. */
OVOID_API double ovoid_image_range(const ovoid_image *image);

/* Of OVOID_PICTURE_BY_RADIUS the distances from the middle at which colours begin and end,
 * angstrom; false, and nothing, of others. */
OVOID_API bool ovoid_image_radii(const ovoid_image *image, double radii[2]);

/* Writes a PNG file, whole or not at all. "-" is standard output. */
OVOID_API ovoid_status ovoid_image_write(ovoid_context *context, const ovoid_image *image,
                                         const char *path);

#ifdef __cplusplus
}
#endif

#endif
