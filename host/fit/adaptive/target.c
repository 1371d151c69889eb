#include "fit/adaptive/target.h"

#include "neighbours/neighbours.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_target_options_init(ov_target_options *options) {
    *options = (ov_target_options){
        .low = 0.02,
        .high = 2.0,
        .slope_min = 0.7,
        .window = 0.5,
        .floor = 0.05,
        .inside_every = 2,
        .inside_weight = 2.0,
        .outside_every = 3,
        .outside_low = 1e-4,
        .outside_weight = 0.5,
    };
}

/* The root of a point's weight. */
static double root_weight(const ov_target *target, double phi, double slope) {
    const ov_target_options *const options = &target->options;
    const double length = 1.0 / sqrt(2.0 * target->decay);
    if (phi > options->high * target->isovalue)
        return options->inside_weight / target->isovalue;
    if (phi < options->low * target->isovalue)
        return options->outside_weight / target->isovalue;
    const double delta = (phi - target->isovalue) / (slope * length * options->window);
    return (options->floor + exp(-delta * delta)) / (slope * length);
}

static void set_bounds(ov_target *target, size_t k) {
    const double from = target->options.low * target->isovalue;
    const double to = target->options.high * target->isovalue;
    const double phi = target->phi[k];
    target->host_low[k] = phi > to ? (float)to : phi < from ? -FLT_MAX : (float)phi;
    target->host_high[k] = phi > to ? FLT_MAX : phi < from ? (float)from : (float)phi;
}

/* Reads phi and its slope at the points. */
static ovoid_status read_samples(ovoid_context *context, const ov_samples *samples, double floor,
                                 ov_target *target) {
    ovoid_status status = OVOID_OK;
    const size_t count = samples->points.packs * OV_PACK;
    float *const gradient = ov_alloc(context, 3 * count, sizeof *gradient, "gradients");
    target->phi = ov_alloc(context, count, sizeof *target->phi, "values at points");
    target->slope = ov_alloc(context, count, sizeof *target->slope, "slopes at points");
    target->emphasis = ov_alloc(context, count, sizeof *target->emphasis, "weights of points");
    target->host_weight = ov_alloc(context, count, sizeof *target->slope, "weights of points");
    if (!gradient || !target->phi || !target->slope || !target->host_weight || !target->emphasis) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_buffer_read(context, &samples->value, 0, target->phi, count * sizeof *target->phi));
    OV_TRY(ov_buffer_read(context, &samples->gradient, 0, gradient, 3 * count * sizeof *gradient));
    for (size_t k = 0; k < count; ++k) {
        target->emphasis[k] = 1.0f;
        const float *const g = gradient + k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        const double x = g[0], y = g[OV_PACK], z = g[2 * OV_PACK];
        target->slope[k] = (float)fmax(sqrt(x * x + y * y + z * z), floor);
    }
cleanup:
    free(gradient);
    return status;
}

ovoid_status ov_target_window(ovoid_context *context, ov_target *target, double window,
                              double floor) {
    const size_t count = target->points->packs * OV_PACK;
    target->options.window = window;
    target->options.floor = floor;
    for (size_t k = 0; k < count; ++k) {
        if (ov_points_fill(target->points, k))
            continue; /* its weight is 0 */
        const double root = root_weight(target, target->phi[k], target->slope[k]);
        target->host_weight[k] = (float)(root * root);
    }
    for (size_t k = 0; k < count; ++k)
        target->emphasis[k] = 1.0f;
    return ov_buffer_put(context, &target->weight, target->host_weight, count * sizeof(float),
                         "targets at points");
}

ovoid_status ov_target_create(ovoid_context *context, const ov_samples *samples, double decay,
                              double isovalue, const ov_target_options *options,
                              ov_target *target) {
    ovoid_status status = OVOID_OK;
    const size_t count = samples->points.packs * OV_PACK;
    ov_target made = {
        .points = &samples->points, .options = *options, .decay = decay, .isovalue = isovalue};
    made.host_low = ov_alloc(context, count, sizeof *made.host_low, "targets at points");
    made.host_high = ov_alloc(context, count, sizeof *made.host_high, "targets at points");
    if (!made.host_low || !made.host_high) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(
        read_samples(context, samples, options->slope_min * isovalue * sqrt(2.0 * decay), &made));
    for (size_t k = 0; k < count; ++k)
        if (!ov_points_fill(&samples->points, k))
            set_bounds(&made, k);
    OV_TRY(ov_buffer_put(context, &made.low, made.host_low, count * sizeof(float),
                         "targets at points"));
    OV_TRY(ov_buffer_put(context, &made.high, made.host_high, count * sizeof(float),
                         "targets at points"));
    OV_TRY(ov_target_window(context, &made, options->window, options->floor));
cleanup:
    if (status == OVOID_OK)
        *target = made;
    else
        ov_target_destroy(&made);
    return status;
}

ovoid_status ov_target_scale(ovoid_context *context, ov_target *target, double factor) {
    ovoid_status status = OVOID_OK;
    const size_t count = target->points->packs * OV_PACK;
    for (size_t k = 0; k < count; ++k)
        if (target->host_low[k] == target->host_high[k])
            target->host_low[k] = target->host_high[k] = (float)(factor * target->phi[k]);
    OV_TRY(ov_buffer_write(context, &target->low, 0, target->host_low, count * sizeof(float)));
    OV_TRY(ov_buffer_write(context, &target->high, 0, target->host_high, count * sizeof(float)));
cleanup:
    return status;
}

/* The middle of a pack's box; returns the half of its diagonal. */
static double middle_of(const ov_points *points, const float *xyz, size_t pack, double middle[3]) {
    float box[6];
    double square = 0.0;
    ov_pack_box(xyz + pack * (3 * OV_PACK), box);
    for (int axis = 0; axis < 3; ++axis) {
        const double low = box[axis], high = box[axis + 3];
        middle[axis] = points->origin[axis] + (double)points->pack_origin[4 * pack + (size_t)axis] +
                       0.5 * (low + high);
        square += (high - low) * (high - low);
    }
    return 0.5 * sqrt(square);
}

/* One more place is near the point. The field itself is asked for there, not a multiple of it: the
 * neck of a tunnel opens or closes with a percent of the field, and at a thousandth of the surface
 * the volume can do without it. */
static void emphasise_point(ov_target *target, size_t k, float factor) {
    target->emphasis[k] = fminf(target->emphasis[k] * factor, OV_EMPHASIS_MAX);
    if (target->host_low[k] == target->host_high[k])
        target->host_low[k] = target->host_high[k] = target->phi[k];
}

/* Multiplies the emphasis of the points near the places of the grids: of the reach, and of twice
 * that, which tells most packs that no place is near any of their points. */
static void emphasise(ov_target *target, const float *xyz, const ov_grid *grid, const ov_grid *wide,
                      float factor) {
    const ov_points *const points = target->points;
    uint32_t near[2 * OV_NEAR_MAX];
    double at[3];
    for (size_t pack = 0; pack < points->packs; ++pack) {
        if (middle_of(points, xyz, pack, at) <= grid->reach &&
            ov_grid_near(wide, at, UINT32_MAX, near) == 0)
            continue;
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK; ++k) {
            ov_points_at(points, xyz, k, at);
            if (ov_grid_near(grid, at, UINT32_MAX, near) > 0)
                emphasise_point(target, k, factor);
        }
    }
}

ovoid_status ov_target_emphasise(ovoid_context *context, ov_target *target, const double *places,
                                 size_t stride, size_t count, double reach, double factor) {
    ovoid_status status = OVOID_OK;
    const size_t size = target->points->packs * OV_PACK;
    ov_grid grid = {0}, wide = {0};
    if (count == 0)
        return OVOID_OK;
    float *const xyz = ov_alloc(context, 3 * size, sizeof *xyz, "points");
    if (!xyz)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_grid_of(context, places, stride, count, reach, &grid));
    OV_TRY(ov_grid_of(context, places, stride, count, 2.0 * reach, &wide));
    OV_TRY(ov_buffer_read(context, &target->points->xyz, 0, xyz, 3 * size * sizeof *xyz));
    emphasise(target, xyz, &grid, &wide, (float)factor);
    for (size_t k = 0; k < size; ++k)
        xyz[k] = target->host_weight[k] * target->emphasis[k];
    OV_TRY(ov_buffer_write(context, &target->weight, 0, xyz, size * sizeof *xyz));
    OV_TRY(ov_buffer_write(context, &target->low, 0, target->host_low, size * sizeof(float)));
    OV_TRY(ov_buffer_write(context, &target->high, 0, target->host_high, size * sizeof(float)));
cleanup:
    ov_grid_destroy(&grid);
    ov_grid_destroy(&wide);
    free(xyz);
    return status;
}

void ov_target_destroy(ov_target *target) {
    ov_buffer_destroy(&target->low);
    ov_buffer_destroy(&target->high);
    ov_buffer_destroy(&target->weight);
    free(target->host_low);
    free(target->host_high);
    free(target->emphasis);
    free(target->host_weight);
    free(target->slope);
    free(target->phi);
    memset(target, 0, sizeof *target);
}
