/*
 * Images of what is refined under the motions of a symmetric assembly: they follow it, and are part
 * of the field that it is refined in. Of `count` terms, image g of term i is term
 * (g + 1) count + i (kernels/images.cl).
 */
#ifndef OV_FIT_IMAGES_H
#define OV_FIT_IMAGES_H

#include "device/device.h"
#include "field/quadric.h"

/* {0}: there are none. */
typedef struct ov_followers {
    const ov_rigid *motion; /* the caller's */
    size_t count;
    ov_kernel turn, fold;
    ov_buffer rotation; /* on the device */
} ov_followers;

/* From here on these are the motions, which are to outlive it. */
ovoid_status ov_followers_set(ovoid_context *context, ov_followers *followers,
                              const ov_rigid *motion, size_t count);
void ov_followers_destroy(ov_followers *followers);

/* Terms and their images together. */
static inline size_t ov_followers_all(const ov_followers *followers, size_t count) {
    return count * (1 + followers->count);
}

/* Puts the images behind the first `count` of these: room for all. skins may be NULL. */
void ov_followers_place(const ov_followers *followers, size_t count, ov_quadric *quadrics,
                        float *skins);

/* Makes the images' polynomials from the terms' (ov_field_polynomial()), and adds the images'
 * moments (ov_moments()) to the terms'. idle: a word on the device that is not 0 where there is
 * nothing to do; NULL: there always is. */
ovoid_status ov_followers_turn(ovoid_context *context, ov_followers *followers, size_t count,
                               const ov_buffer *idle, ov_buffer *polynomial);
ovoid_status ov_followers_fold(ovoid_context *context, ov_followers *followers, size_t count,
                               const ov_buffer *idle, ov_buffer *moments);

#endif
