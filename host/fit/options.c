#include "fit/options.h"

#include <math.h>

void ovoid_fit_options_init(ovoid_fit_options *options) {
    if (!options)
        return;
    *options = (ovoid_fit_options){
        .method = OVOID_METHOD_ADAPTIVE,
        .decay = OVOID_DEFAULT_DECAY,
        .isovalue = OVOID_DEFAULT_ISOVALUE,
        .spacing = 0.0,
        .padding = 3.0,
        .adaptive =
            {
                .goal = OVOID_GOAL_TOLERANCE,
                .tolerance = OVOID_DEFAULT_TOLERANCE,
                .ellipsoids = 0,
                .ratio = 0.1,
                .effort = 1,
                .steps = 60,
                .mesh_spacing = 0.5,
            },
        .l1 =
            {
                .kernel = OVOID_KERNEL_ELLIPSOID,
                .iterations = 8000,
                .sparse_iterations = 6000,
                .inside_every = 1,
                .epsilon = 0.05,
                .max_error = 0.5,
                .prune_below = 1e-3,
                .prune_every = 20,
                .first_step = OVOID_FIRST_STEP_SECANT,
                .armijo = 1e-4,
                .shrink = 0.5,
                .grow = 2.0,
                .max_backtracks = 30,
            },
    };
}

typedef struct range {
    const char *name;
    double value, low, high; /* low < value <= high */
} range;

static ovoid_status check_ranges(ovoid_context *context, const range *ranges, size_t count) {
    for (size_t k = 0; k < count; ++k)
        if (!(ranges[k].value > ranges[k].low && ranges[k].value <= ranges[k].high))
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "option %s = %g is not above %g and at most %g", ranges[k].name,
                           ranges[k].value, ranges[k].low, ranges[k].high);
    return OVOID_OK;
}

static ovoid_status check_adaptive(ovoid_context *context, const ovoid_adaptive_options *adaptive) {
    const range ranges[] = {
        {"tolerance", adaptive->tolerance, 0.0, 1e3},
        {"ratio", adaptive->ratio, 0.0, 1.0},
        {"effort", adaptive->effort, 0.0, 10.0},
        {"mesh_spacing", adaptive->mesh_spacing, 0.0, 1e3},
    };
    if (adaptive->goal != OVOID_GOAL_TOLERANCE && adaptive->goal != OVOID_GOAL_ELLIPSOIDS &&
        adaptive->goal != OVOID_GOAL_RATIO)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "unknown goal %d", (int)adaptive->goal);
    if (adaptive->goal == OVOID_GOAL_ELLIPSOIDS && adaptive->ellipsoids == 0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a model has at least one ellipsoid");
    return check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
}

static ovoid_status check_l1(ovoid_context *context, const ovoid_l1_options *l1) {
    const range ranges[] = {
        {"iterations", l1->iterations, 0.0, UINT32_MAX},
        {"epsilon", l1->epsilon, 0.0, 1.0},
        {"max_error", l1->max_error, 0.0, INFINITY},
        {"prune_below", l1->prune_below, -1e-300, 1e3},
        {"prune_every", l1->prune_every, 0.0, UINT32_MAX},
        {"armijo", l1->armijo, 0.0, 0.999},
        {"shrink", l1->shrink, 0.0, 0.999},
        {"grow", l1->grow, 0.999, 1e6},
        {"max_backtracks", l1->max_backtracks, 0.0, 1000.0},
    };
    if (l1->kernel != OVOID_KERNEL_ELLIPSOID && l1->kernel != OVOID_KERNEL_SPHERE)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "unknown kernel %d", (int)l1->kernel);
    if (l1->first_step != OVOID_FIRST_STEP_SECANT && l1->first_step != OVOID_FIRST_STEP_GROW)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "unknown first step %d", (int)l1->first_step);
    const ovoid_status status = check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
    if (status == OVOID_OK && l1->sparse_iterations > l1->iterations)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option sparse_iterations = %lu is more than iterations = %lu",
                       (unsigned long)l1->sparse_iterations, (unsigned long)l1->iterations);
    return status;
}

/* Options of the method that is not used are not looked at. */
ovoid_status ov_fit_options_check(ovoid_context *context, const ovoid_fit_options *options) {
    const range ranges[] = {
        {"decay", options->decay, 0.0, 100.0},
        {"isovalue", options->isovalue, 0.0, 1e6},
        {"spacing", options->spacing, -1e-300, 1e3},
        {"padding", options->padding, -1e-300, 1e3},
    };
    const ovoid_status status = check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
    if (status != OVOID_OK)
        return status;
    switch (options->method) {
    case OVOID_METHOD_ADAPTIVE:
        return check_adaptive(context, &options->adaptive);
    case OVOID_METHOD_L1:
        return check_l1(context, &options->l1);
    }
    return ov_fail(context, OVOID_ERROR_ARGUMENT, "unknown method %d", (int)options->method);
}
