#include "picture/radii.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_middle_of(const ov_quadric *quadrics, size_t count, double middle[3]) {
    memset(middle, 0, 3 * sizeof *middle);
    for (size_t i = 0; i < count; ++i)
        for (int k = 0; k < 3; ++k)
            middle[k] += quadrics[i].centre[k] / (double)count;
}

/* Depths become distances; where nothing is met they stay. The largest one is the result. */
static double distances_of(const ov_rays *rays, const double middle[3], float *depth) {
    double most = 0.0;
    for (uint32_t row = 0; row < rays->rows; ++row)
        for (uint32_t column = 0; column < rays->columns; ++column) {
            float *const at = &depth[ov_rays_index(rays, column, row)];
            const double x = rays->left + column * rays->spacing - middle[0];
            const double y = rays->top - row * rays->spacing - middle[1];
            if (*at <= OV_NOWHERE)
                continue;
            *at = (float)sqrt(x * x + y * y + (*at - middle[2]) * (*at - middle[2]));
            most = fmax(most, *at);
        }
    return most;
}

/* The distances that a percent of what is seen is below and above. */
static void choose_radii(const ov_rays *rays, const float *distance, double most, double radii[2]) {
    enum { BINS = 4096 };
    uint64_t bins[BINS] = {0}, count = 0, below = 0;
    for (uint32_t row = 0; row < rays->rows; ++row)
        for (uint32_t column = 0; column < rays->columns; ++column) {
            const float at = distance[ov_rays_index(rays, column, row)];
            if (at <= OV_NOWHERE)
                continue;
            ++count;
            ++bins[most > 0.0 ? (int)(at / most * (BINS - 1)) : 0];
        }
    radii[0] = radii[1] = 0.0;
    for (int k = 0; k < BINS && count > 0; ++k) {
        const uint64_t before = below;
        below += bins[k];
        if (100 * before <= count && 100 * below > count)
            radii[0] = most * k / (BINS - 1);
        if (100 * before < 99 * count && 100 * below >= 99 * count)
            radii[1] = most * (k + 1) / (BINS - 1);
    }
}

ovoid_status ov_hits_by_radius(ovoid_context *context, const ov_rays *rays, const double middle[3],
                               ov_hits *hits, double radii[2]) {
    ovoid_status status = OVOID_OK;
    const size_t count = ov_rays_packs(rays) * OV_PACK;
    float *const distance = ov_alloc(context, count, sizeof *distance, "depths of rays");
    if (!distance)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_buffer_read(context, &hits->depth, 0, distance, count * sizeof *distance));
    choose_radii(rays, distance, distances_of(rays, middle, distance), radii);
    for (size_t i = 0; i < count; ++i) {
        const double share = (distance[i] - radii[0]) / fmax(radii[1] - radii[0], 1e-6);
        distance[i] = (float)fmin(fmax(2.0 * share - 1.0, -1.0), 1.0);
    }
    OV_TRY(
        ov_buffer_put(context, &hits->extra, distance, count * sizeof *distance, "values of rays"));
cleanup:
    free(distance);
    return status;
}
