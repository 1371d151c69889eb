#include "fit/adaptive/images.h"

#include "field/field.h"

#include <stdlib.h>

ovoid_status ov_followers_set(ovoid_context *context, ov_followers *f, const ov_rigid *motion,
                              size_t count) {
    ovoid_status status = OVOID_OK;
    f->motion = motion;
    f->count = count;
    if (count == 0)
        return OVOID_OK;
    float *const rotation = ov_alloc(context, 9 * count, sizeof *rotation, "motions");
    if (!rotation)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < count; ++g)
        for (size_t k = 0; k < 9; ++k)
            rotation[9 * g + k] = (float)motion[g].rotation[k];
    OV_TRY(ov_buffer_put(context, &f->rotation, rotation, 9 * count * sizeof *rotation, "motions"));
cleanup:
    free(rotation);
    return status;
}

void ov_followers_destroy(ov_followers *f) {
    ov_kernel_destroy(&f->turn);
    ov_kernel_destroy(&f->fold);
    ov_buffer_destroy(&f->rotation);
    *f = (ov_followers){0};
}

void ov_followers_place(const ov_followers *f, size_t count, ov_quadric *quadrics, float *skins) {
    for (size_t g = 0; g < f->count; ++g)
        for (size_t i = 0; i < count; ++i) {
            const size_t place = (g + 1) * count + i;
            ov_quadric_move(&quadrics[i], &f->motion[g], &quadrics[place]);
            if (skins)
                skins[place] = skins[i];
        }
}

/* One work-item for each of `items`. */
static ovoid_status launch(ovoid_context *context, ov_followers *f, ov_kernel *kernel,
                           const char *name, size_t items, size_t count, const ov_buffer *idle,
                           const ov_buffer *changed) {
    ovoid_status status = OVOID_OK;
    const cl_uint terms = (cl_uint)count, images = (cl_uint)f->count;
    const cl_mem word = idle ? idle->memory : NULL;
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    if (!kernel->handle)
        OV_TRY(ov_kernel_create(context, "images", name, kernel));
    OV_TRY(OV_LAUNCH(context, kernel, items, ov_item_group(device), OV_ARG(terms), OV_ARG(images),
                     OV_ARG(word), OV_ARG(f->rotation.memory), OV_ARG(changed->memory)));
cleanup:
    return status;
}

ovoid_status ov_followers_turn(ovoid_context *context, ov_followers *f, size_t count,
                               const ov_buffer *idle, ov_buffer *polynomial) {
    return f->count == 0 ? OVOID_OK
                         : launch(context, f, &f->turn, "turn_polynomials", count * f->count, count,
                                  idle, polynomial);
}

ovoid_status ov_followers_fold(ovoid_context *context, ov_followers *f, size_t count,
                               const ov_buffer *idle, ov_buffer *moments) {
    return f->count == 0
               ? OVOID_OK
               : launch(context, f, &f->fold, "fold_moments", count, count, idle, moments);
}
