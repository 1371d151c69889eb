#include "fit/options.h"

#include "base/sized.h"

#include <math.h>
#include <stdio.h>

void ovoid_fit_options_init(ovoid_fit_options *options, size_t size) {
    static const ovoid_fit_options defaults = {
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
        .parts = {.atoms = 0,
                  .jobs = 0,
                  .resume = 0,
                  .symmetry = OVOID_SYMMETRY_USE,
                  .checkpoint = NULL,
                  .exchange = NULL},
    };
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

void ovoid_fit_result_init(ovoid_fit_result *result, size_t size) {
    static const ovoid_fit_result unknown = {
        .spacing = NAN,
        .points = OVOID_UNKNOWN,
        .ellipsoids = OVOID_UNKNOWN,
        .iterations = OVOID_UNKNOWN,
        .distance = NAN,
        .sample_seconds = NAN,
        .fit_seconds = NAN,
        .l1 = {NAN, NAN, NAN, NAN, NAN, NAN, OVOID_UNKNOWN, OVOID_UNKNOWN, OVOID_UNKNOWN},
        .adaptive = {OVOID_UNKNOWN},
        .counts = {OVOID_UNKNOWN, OVOID_UNKNOWN, OVOID_UNKNOWN, OVOID_UNKNOWN, OVOID_UNKNOWN,
                   OVOID_UNKNOWN, OVOID_UNKNOWN},
        .parts = OVOID_UNKNOWN,
        .units = OVOID_UNKNOWN,
    };
    ov_sized_init(result, size, &unknown, sizeof unknown);
}

typedef struct range {
    const char *name;
    double value, low, high;
    bool above; /* low itself is not allowed */
} range;

/* What a value outside its range would have to be, in words. */
static ovoid_status fail_range(ovoid_context *context, const range *r) {
    char wanted[64];
    if (isnan(r->value))
        snprintf(wanted, sizeof wanted, "be a number");
    else if (r->value > r->low)
        snprintf(wanted, sizeof wanted, "be at most %.9g", r->high);
    else if (r->low == 0.0 && !r->above)
        snprintf(wanted, sizeof wanted, "not be negative");
    else
        snprintf(wanted, sizeof wanted, "be %s %.9g", r->above ? "above" : "at least", r->low);
    return ov_fail(context, OVOID_ERROR_ARGUMENT, "option %s must %s; it is %.9g", r->name, wanted,
                   r->value);
}

static ovoid_status check_ranges(ovoid_context *context, const range *ranges, size_t count) {
    for (size_t k = 0; k < count; ++k) {
        const range *const r = &ranges[k];
        if (!(r->above ? r->value > r->low : r->value >= r->low) || !(r->value <= r->high))
            return fail_range(context, r);
    }
    return OVOID_OK;
}

static ovoid_status check_adaptive(ovoid_context *context, const ovoid_adaptive_options *adaptive) {
    const range ranges[] = {
        {"tolerance", adaptive->tolerance, 0.0, 1e3, true},
        {"ratio", adaptive->ratio, 0.0, 1.0, true},
        {"effort", adaptive->effort, 0.0, 10.0, false},
        {"mesh_spacing", adaptive->mesh_spacing, 0.0, 1e3, true},
    };
    if (adaptive->goal != OVOID_GOAL_TOLERANCE && adaptive->goal != OVOID_GOAL_ELLIPSOIDS &&
        adaptive->goal != OVOID_GOAL_RATIO)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option goal must be one of OVOID_GOAL_...; it is %d", (int)adaptive->goal);
    if (adaptive->goal == OVOID_GOAL_ELLIPSOIDS && adaptive->ellipsoids == 0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option ellipsoids must be at least 1; it is 0");
    return check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
}

ovoid_status ov_exchange_check(ovoid_context *context, const ovoid_exchange *exchange) {
    if (!exchange->gather)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.exchange has no function that gathers");
    if (exchange->rank >= exchange->ranks)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.exchange must have a rank below the number of ranks, %lu; it "
                       "is %lu",
                       (unsigned long)exchange->ranks, (unsigned long)exchange->rank);
    return OVOID_OK;
}

static ovoid_status check_parts(ovoid_context *context, const ovoid_parts_options *parts) {
    if (parts->atoms > 0 && parts->atoms < OVOID_LEAST_PART_ATOMS)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.atoms must be 0 or at least %d; it is %lu",
                       OVOID_LEAST_PART_ATOMS, (unsigned long)parts->atoms);
    if (parts->jobs > OVOID_MOST_JOBS)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.jobs must be at most %d; it is %lu", OVOID_MOST_JOBS,
                       (unsigned long)parts->jobs);
    if (parts->resume && !parts->checkpoint)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.resume needs a checkpoint to go on from");
    if (parts->symmetry > OVOID_SYMMETRY_IGNORE)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option parts.symmetry must be one of OVOID_SYMMETRY_...; it is %lu",
                       (unsigned long)parts->symmetry);
    return parts->exchange ? ov_exchange_check(context, parts->exchange) : OVOID_OK;
}

static ovoid_status check_l1(ovoid_context *context, const ovoid_l1_options *l1) {
    const range ranges[] = {
        {"iterations", l1->iterations, 1.0, UINT32_MAX, false},
        {"epsilon", l1->epsilon, 0.0, 1.0, true},
        {"max_error", l1->max_error, 0.0, INFINITY, true},
        {"prune_below", l1->prune_below, 0.0, 1e3, false},
        {"prune_every", l1->prune_every, 1.0, UINT32_MAX, false},
        {"armijo", l1->armijo, 0.0, 0.999, true},
        {"shrink", l1->shrink, 0.0, 0.999, true},
        {"grow", l1->grow, 1.0, 1e6, false},
        {"max_backtracks", l1->max_backtracks, 1.0, 1000.0, false},
    };
    if (l1->kernel != OVOID_KERNEL_ELLIPSOID && l1->kernel != OVOID_KERNEL_SPHERE)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option kernel must be one of OVOID_KERNEL_...; it is %d", (int)l1->kernel);
    if (l1->first_step != OVOID_FIRST_STEP_SECANT && l1->first_step != OVOID_FIRST_STEP_GROW)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option first_step must be one of OVOID_FIRST_STEP_...; it is %d",
                       (int)l1->first_step);
    const ovoid_status status = check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
    if (status == OVOID_OK && l1->sparse_iterations > l1->iterations)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "option sparse_iterations must be at most iterations, %lu; it is %lu",
                       (unsigned long)l1->iterations, (unsigned long)l1->sparse_iterations);
    return status;
}

ovoid_status ov_surface_options_check(ovoid_context *context, const ovoid_fit_options *options) {
    const range ranges[] = {
        {"decay", options->decay, 0.0, 100.0, true},
        {"isovalue", options->isovalue, 0.0, 1e6, true},
        {"spacing", options->spacing, 0.0, 1e3, false},
        {"padding", options->padding, 0.0, 1e3, false},
    };
    return check_ranges(context, ranges, sizeof ranges / sizeof *ranges);
}

/* Options of the method that is not used are not looked at. */
ovoid_status ov_fit_options_check(ovoid_context *context, const ovoid_fit_options *options) {
    const ovoid_status status = ov_surface_options_check(context, options);
    if (status != OVOID_OK)
        return status;
    switch (options->method) {
    case OVOID_METHOD_ADAPTIVE: {
        const ovoid_status parts = check_parts(context, &options->parts);
        return parts != OVOID_OK ? parts : check_adaptive(context, &options->adaptive);
    }
    case OVOID_METHOD_L1:
        return check_l1(context, &options->l1);
    }
    return ov_fail(context, OVOID_ERROR_ARGUMENT,
                   "option method must be one of OVOID_METHOD_...; it is %d", (int)options->method);
}

uint64_t ov_fit_options_hash(const ovoid_fit_options *options) {
    const ovoid_adaptive_options *const a = &options->adaptive;
    const double numbers[] = {options->decay, options->isovalue, options->spacing, options->padding,
                              a->tolerance,   a->ratio,          a->mesh_spacing};
    const uint64_t counts[] = {(uint64_t)options->method, (uint64_t)a->goal, a->ellipsoids,
                               a->effort, a->steps};
    const uint64_t both[] = {ov_hash(numbers, sizeof numbers), ov_hash(counts, sizeof counts)};
    return ov_hash(both, sizeof both);
}
