#include "fit/adaptive/target.h"

#include "fit/adaptive/constants.h"
#include "neighbours/neighbours.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_target_options_init(ov_target_options *options) {
    *options = (ov_target_options){
        .low = ov_tuned.target_low,
        .high = ov_tuned.target_high,
        .slope_min = ov_tuned.target_slope,
        .window = ov_tuned.target_window,
        .floor = ov_tuned.target_floor,
        .inside_every = ov_tuned.target_inside_every,
        .inside_weight = ov_tuned.target_inside_weight,
        .outside_every = ov_tuned.target_outside_every,
        .outside_low = ov_tuned.target_outside_low,
        .outside_weight = ov_tuned.target_outside_weight,
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

static double fixed_at(const ov_target *target, size_t k) {
    return target->fixed ? target->fixed[k] : 0.0;
}

static void set_bounds(ov_target *target, size_t k) {
    const double from = target->options.low * target->isovalue;
    const double to = target->options.high * target->isovalue;
    const double phi = target->phi[k], fixed = fixed_at(target, k);
    target->host_low[k] = phi > to     ? (float)(to - fixed)
                          : phi < from ? -FLT_MAX
                                       : (float)(phi - fixed);
    target->host_high[k] = phi > to     ? FLT_MAX
                           : phi < from ? (float)(from - fixed)
                                        : (float)(phi - fixed);
}

static bool is_followed(const ov_target *target, size_t k) {
    return target->host_low[k] == target->host_high[k];
}

/* Asks for `factor` phi at a point where phi is followed. */
static void follow(ov_target *target, size_t k, double factor) {
    if (is_followed(target, k))
        target->host_low[k] = target->host_high[k] =
            (float)(factor * target->phi[k] - fixed_at(target, k));
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

ovoid_status ov_target_reserve(ovoid_context *context, ov_target *target, size_t packs) {
    ovoid_status status = OVOID_OK;
    ov_buffer *const buffers[] = {&target->low, &target->high, &target->weight};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        OV_TRY(ov_buffer_reserve(context, buffers[k], packs * OV_PACK * sizeof(cl_float),
                                 "targets at points"));
cleanup:
    return status;
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

/* Where phi was set to 0, beyond a part, nothing of the part is to be, whatever else is there, but
 * for what is allowed (NULL: nothing). */
static void guard_beyond(ov_target *target, const float *allowed) {
    const size_t count = target->points->packs * OV_PACK;
    for (size_t k = 0; k < count; ++k)
        if (!(target->phi[k] > 0.0f))
            target->fixed[k] = allowed ? -allowed[k] : 0.0f;
}

ovoid_status ov_target_fix(ovoid_context *context, ov_target *target, const ov_buffer *values,
                           const ov_buffer *beyond) {
    ovoid_status status = OVOID_OK;
    const size_t count = target->points->packs * OV_PACK;
    float *allowed = NULL;
    if (!target->fixed)
        target->fixed = ov_alloc(context, count, sizeof *target->fixed, "values at points");
    if (!target->fixed)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_buffer_read(context, values, 0, target->fixed, count * sizeof *target->fixed));
    if (beyond) {
        allowed = ov_alloc(context, count, sizeof *allowed, "values at points");
        if (!allowed)
            return OVOID_ERROR_MEMORY;
        OV_TRY(ov_buffer_read(context, beyond, 0, allowed, count * sizeof *allowed));
    }
    guard_beyond(target, allowed);
    for (size_t k = 0; k < count; ++k)
        if (!ov_points_fill(target->points, k))
            set_bounds(target, k);
    OV_TRY(ov_buffer_write(context, &target->low, 0, target->host_low, count * sizeof(float)));
    OV_TRY(ov_buffer_write(context, &target->high, 0, target->host_high, count * sizeof(float)));
cleanup:
    free(allowed);
    return status;
}

ovoid_status ov_target_scale(ovoid_context *context, ov_target *target, double factor) {
    ovoid_status status = OVOID_OK;
    const size_t count = target->points->packs * OV_PACK;
    for (size_t k = 0; k < count; ++k)
        follow(target, k, factor);
    OV_TRY(ov_buffer_write(context, &target->low, 0, target->host_low, count * sizeof(float)));
    OV_TRY(ov_buffer_write(context, &target->high, 0, target->host_high, count * sizeof(float)));
cleanup:
    return status;
}

/* One more place is near the point. The field itself is asked for there, not a multiple of it: the
 * neck of a tunnel opens or closes with a percent of the field, and at a thousandth of the surface
 * the volume can do without it. */
static void emphasise_point(ov_target *target, size_t k, float factor) {
    target->emphasis[k] = fminf(target->emphasis[k] * factor, (float)ov_tuned.spots_emphasis_max);
    follow(target, k, 1.0);
}

/* Packs that places are near, with their points. */
typedef struct neighbourhood {
    ov_packs packs;
    ov_buffer list; /* the same on the device */
    ov_points points;
    float *host; /* their coordinates, and then their targets: 3 * OV_PACK per pack */
} neighbourhood;

static void neighbourhood_destroy(neighbourhood *n) {
    ov_packs_destroy(&n->packs);
    ov_buffer_destroy(&n->list);
    ov_points_destroy(&n->points);
    free(n->host);
}

static ovoid_status find_neighbourhood(ovoid_context *context, const ov_points *points,
                                       const double *places, size_t stride, size_t count,
                                       double reach, neighbourhood *n) {
    ovoid_status status = OVOID_OK;
    for (size_t k = 0; k < count; ++k)
        OV_TRY(ov_packs_near(context, points, (const double *)((const char *)places + k * stride),
                             reach, &n->packs));
    n->packs.count = ov_packs_tidy(n->packs.pack, n->packs.count);
    if (n->packs.count == 0)
        return OVOID_OK;
    const size_t floats = n->packs.count * 3 * OV_PACK;
    n->host = ov_alloc(context, floats, sizeof *n->host, "points");
    if (!n->host)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_points_gather(context, points, n->packs.pack, n->packs.count, &n->list, &n->points));
    OV_TRY(ov_buffer_read(context, &n->points.xyz, 0, n->host, floats * sizeof *n->host));
cleanup:
    return status;
}

/* Multiplies the emphasis of the points near the grid's places. The targets of each pack take the
 * place of its coordinates. */
static void emphasise(ov_target *target, const ov_grid *grid, float factor, neighbourhood *n) {
    uint32_t near[2 * OV_NEAR_MAX];
    double at[3];
    for (size_t k = 0; k < n->packs.count; ++k) {
        const size_t first = n->packs.pack[k] * (size_t)OV_PACK;
        float *const some = n->host + k * (3 * OV_PACK);
        for (size_t j = 0; j < OV_PACK; ++j) {
            ov_points_at(&n->points, n->host, k * OV_PACK + j, at);
            if (ov_grid_near(grid, at, UINT32_MAX, near) > 0)
                emphasise_point(target, first + j, factor);
        }
        for (size_t j = 0; j < OV_PACK; ++j) {
            some[j] = target->host_low[first + j];
            some[OV_PACK + j] = target->host_high[first + j];
            some[2 * OV_PACK + j] = target->host_weight[first + j] * target->emphasis[first + j];
        }
    }
}

static ovoid_status scatter(ovoid_context *context, ov_target *target, neighbourhood *n) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    ov_device *device;
    const cl_uint packs = (cl_uint)n->packs.count;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "gather", "scatter_target", &kernel));
    OV_TRY(ov_buffer_write(context, &n->points.xyz, 0, n->host,
                           n->packs.count * 3 * OV_PACK * sizeof *n->host));
    OV_TRY(OV_LAUNCH(context, &kernel, packs, ov_item_group(device), OV_ARG(packs),
                     OV_ARG(n->list.memory), OV_ARG(n->points.xyz.memory),
                     OV_ARG(target->low.memory), OV_ARG(target->high.memory),
                     OV_ARG(target->weight.memory)));
cleanup:
    ov_kernel_destroy(&kernel);
    return status;
}

ovoid_status ov_target_emphasise(ovoid_context *context, ov_target *target, const double *places,
                                 size_t stride, size_t count, double reach, double factor) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    neighbourhood n = {0};
    if (count == 0)
        return OVOID_OK;
    OV_TRY(find_neighbourhood(context, target->points, places, stride, count, reach, &n));
    if (n.packs.count == 0)
        goto cleanup;
    OV_TRY(ov_grid_of(context, places, stride, count, reach, &grid));
    emphasise(target, &grid, (float)factor, &n);
    OV_TRY(scatter(context, target, &n));
cleanup:
    ov_grid_destroy(&grid);
    neighbourhood_destroy(&n);
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
    free(target->fixed);
    memset(target, 0, sizeof *target);
}
