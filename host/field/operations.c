#include "field/field.h"

#include <float.h>
#include <math.h>
#include <string.h>

static ovoid_status make(ovoid_context *context, ov_kernel *kernel, const char *program,
                         const char *name) {
    return kernel->handle ? OVOID_OK : ov_kernel_create(context, program, name, kernel);
}

void ov_operations_destroy(ov_operations *operations) {
    ov_kernel_destroy(&operations->field);
    ov_kernel_destroy(&operations->field_polynomial);
    ov_kernel_destroy(&operations->field_gradient);
    ov_kernel_destroy(&operations->moments);
    ov_kernel_destroy(&operations->gram);
    ov_kernel_destroy(&operations->residual);
}

size_t ov_item_group(const ov_device *device) {
    return device->shape.lanes == 1 ? 1 : 64;
}

/* Packs or terms in a work-group of a CPU: a few, to share what a group costs to start. On a GPU a
 * group has GPU_GROUP work-items. */
#define CPU_GROUP 4
#define GPU_GROUP 64

/* `packs` packs, each handled by the shape's lanes. */
static ovoid_status launch_packs(ovoid_context *context, const ov_kernel *kernel, size_t packs,
                                 const ov_arg *args, size_t arg_count) {
    ov_device *device;
    const ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    const size_t lanes = device->shape.lanes;
    return ov_launch(context, kernel, packs * lanes, lanes == 1 ? CPU_GROUP : GPU_GROUP, args,
                     arg_count);
}

/* `terms` terms, each handled by one work-item or by a team that is a work-group. */
static ovoid_status launch_terms(ovoid_context *context, const ov_kernel *kernel, size_t terms,
                                 const ov_arg *args, size_t arg_count) {
    ov_device *device;
    const ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    const size_t team = device->team;
    return ov_launch(context, kernel, terms * team, team == 1 ? CPU_GROUP : team, args, arg_count);
}

#define ARGS(...)                                                                                  \
    (const ov_arg[]){__VA_ARGS__}, sizeof((const ov_arg[]){__VA_ARGS__}) / sizeof(ov_arg)
static ovoid_status reserve_values(ovoid_context *context, const ov_points *points,
                                   ov_buffer *value) {
    return ov_buffer_reserve(context, value, points->packs * OV_PACK * sizeof(cl_float),
                             "values at points");
}

ovoid_status ov_field(ovoid_context *context, ov_operations *operations, const ov_points *points,
                      const ov_terms *terms, const ov_lists *lists, ov_buffer *value) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs = (cl_uint)points->packs, alike = points->alike;
    OV_TRY(make(context, &operations->field, "field", "field"));
    OV_TRY(reserve_values(context, points, value));
    OV_TRY(launch_packs(context, &operations->field, points->packs,
                        ARGS(OV_ARG(packs), OV_ARG(alike), OV_ARG(points->xyz.memory),
                             OV_ARG(points->pack_origins.memory), OV_ARG(lists->pack_start.memory),
                             OV_ARG(lists->pack_item.memory), OV_ARG(terms->device.memory),
                             OV_ARG(value->memory))));
cleanup:
    return status;
}

ovoid_status ov_field_polynomial(ovoid_context *context, ov_operations *operations,
                                 const ov_points *points, const ov_terms *terms,
                                 const ov_lists *lists, const ov_buffer *polynomial,
                                 const ov_buffer *weight, ov_buffer *value) {
    ovoid_status status = OVOID_OK;
    const cl_mem weights = weight ? weight->memory : NULL; /* null in the kernel, too */
    const cl_mem idle = operations->idle ? operations->idle->memory : NULL;
    const cl_uint packs = (cl_uint)points->packs;
    OV_TRY(make(context, &operations->field_polynomial, "field", "field_polynomial"));
    OV_TRY(reserve_values(context, points, value));
    OV_TRY(launch_packs(context, &operations->field_polynomial, points->packs,
                        ARGS(OV_ARG(packs), OV_ARG(idle), OV_ARG(points->xyz.memory),
                             OV_ARG(points->pack_origins.memory), OV_ARG(lists->pack_start.memory),
                             OV_ARG(lists->pack_item.memory), OV_ARG(terms->device.memory),
                             OV_ARG(polynomial->memory), OV_ARG(weights), OV_ARG(value->memory))));
cleanup:
    return status;
}

ovoid_status ov_field_gradient(ovoid_context *context, ov_operations *operations,
                               const ov_points *points, const ov_terms *terms,
                               const ov_lists *lists, ov_buffer *value, ov_buffer *gradient) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs = (cl_uint)points->packs;
    OV_TRY(make(context, &operations->field_gradient, "field", "field_gradient"));
    OV_TRY(reserve_values(context, points, value));
    OV_TRY(ov_buffer_reserve(context, gradient, points->packs * 3 * OV_PACK * sizeof(cl_float),
                             "gradients at points"));
    OV_TRY(launch_packs(context, &operations->field_gradient, points->packs,
                        ARGS(OV_ARG(packs), OV_ARG(points->xyz.memory),
                             OV_ARG(points->pack_origins.memory), OV_ARG(lists->pack_start.memory),
                             OV_ARG(lists->pack_item.memory), OV_ARG(terms->device.memory),
                             OV_ARG(value->memory), OV_ARG(gradient->memory))));
cleanup:
    return status;
}

ovoid_status ov_moments(ovoid_context *context, ov_operations *operations, const ov_points *points,
                        const ov_terms *terms, const ov_lists *lists, const ov_buffer *u,
                        ov_buffer *result) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)terms->count;
    const cl_mem idle = operations->idle ? operations->idle->memory : NULL;
    OV_TRY(make(context, &operations->moments, "moments", "moments"));
    OV_TRY(ov_buffer_reserve(context, result, terms->count * 2 * OV_MONOMIALS * sizeof(cl_float),
                             "moments"));
    OV_TRY(launch_terms(context, &operations->moments, terms->count,
                        ARGS(OV_ARG(count), OV_ARG(idle), OV_ARG(points->xyz.memory),
                             OV_ARG(points->pack_origins.memory), OV_ARG(u->memory),
                             OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory),
                             OV_ARG(terms->device.memory), OV_ARG(result->memory))));
cleanup:
    return status;
}

ovoid_status ov_gram(ovoid_context *context, ov_operations *operations, const ov_points *points,
                     const ov_terms *terms, const ov_lists *lists, const ov_buffer *w,
                     ov_buffer *result) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)terms->count;
    OV_TRY(make(context, &operations->gram, "gram", "gram"));
    OV_TRY(ov_buffer_reserve(context, result, terms->count * OV_GRAM * sizeof(cl_float),
                             "sums of products"));
    OV_TRY(launch_terms(context, &operations->gram, terms->count,
                        ARGS(OV_ARG(count), OV_ARG(points->xyz.memory),
                             OV_ARG(points->pack_origins.memory), OV_ARG(w->memory),
                             OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory),
                             OV_ARG(terms->device.memory), OV_ARG(result->memory))));
cleanup:
    return status;
}

ovoid_status ov_residual(ovoid_context *context, ov_operations *operations, const ov_points *points,
                         const ov_buffer *value, const ov_buffer *target, double limit,
                         ov_buffer *u, ov_buffer *sums) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs = (cl_uint)points->packs;
    const cl_float single_limit = (cl_float)fmin(limit, FLT_MAX);
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(make(context, &operations->residual, "residual", "residual"));
    OV_TRY(reserve_values(context, points, u));
    OV_TRY(ov_buffer_reserve(context, sums, points->packs * 2 * sizeof(cl_float), "pack sums"));
    OV_TRY(OV_LAUNCH(context, &operations->residual, points->packs, ov_item_group(device),
                     OV_ARG(packs), OV_ARG(points->pack_origins.memory), OV_ARG(single_limit),
                     OV_ARG(value->memory), OV_ARG(target->memory), OV_ARG(u->memory),
                     OV_ARG(sums->memory)));
cleanup:
    return status;
}
