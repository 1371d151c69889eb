/*
 * From where a picture is taken: parallel rays, in a frame of their own.
 */
#ifndef OV_CAMERA_H
#define OV_CAMERA_H

#include "base/base.h"
#include "field/quadric.h"
#include "ovoid/ovoid.h"

typedef struct ov_camera {
    double axis[3][3]; /* unit vectors: to the right, up, toward the eye */
    double centre[3];  /* origin of the frame, angstrom */
    double pixel;      /* angstrom per pixel */
    double near, far;  /* depths between which things fade, in the frame, near > far */
} ov_camera;

/* A box in the camera's frame; empty where low > high. */
typedef struct ov_extent {
    double low[3], high[3];
} ov_extent;

/* Looks along the least principal axis of the centres with the largest one across the picture's
 * longer side, or from `direction` where that is not 0, then turns by `rotation`. The centre is 0.
 */
void ov_camera_aim(ov_camera *camera, const ov_quadric *quadrics, size_t count,
                   const ovoid_picture_options *options);

/* Moves the centre to the middle of what is to be seen and chooses the scale, so that `extent` (in
 * the frame of ov_camera_aim()) fits width * height pixels; `options` may say otherwise. */
void ov_camera_frame(ov_camera *camera, const ov_extent *extent, double width, double height,
                     const ovoid_picture_options *options);

/* The same quadric in the camera's frame. */
ov_quadric ov_camera_see(const ov_camera *camera, const ov_quadric *quadric);

/* The box of where quadrics in the camera's frame are at least `level`. */
ov_extent ov_extent_of(const ov_quadric *quadrics, size_t count, double level);

#endif
