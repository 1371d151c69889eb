/* The list of checks, and who runs them: the public self-test, and the first use of a device. */
#include "ovoid/selftest.h"

#include "base/progress.h"
#include "base/sized.h"
#include "device/device.h"
#include "selftest/check.h"
#include "selftest/costs.h"

#include <math.h>
#include <stdio.h>

static const ov_check checks[] = {
    {"layout", "layout", true, true, ov_check_layout},
    {"tree", "tree_leaves tree_level", true, true, ov_check_tree},
    {"lists", "packs_of_terms scan_lists hand_out_entries lists_of_packs make_few_lists", true,
     true, ov_check_lists},
    {"field", "field field_polynomial field_gradient", true, false, ov_check_field},
    {"moments", "moments gram", true, false, ov_check_moments},
    {"misfit", "residual misfit", true, false, ov_check_misfit},
    {"gather", "gather_points gather_target scatter_target list_reached", true, false,
     ov_check_gather},
    {"spread", "spread", true, false, ov_check_spread},
    {"merge", "merge_loss", true, false, ov_check_merge},
    {"solver", "solve_start solve_product solve_update solve_direction solve_step", true, false,
     ov_check_solver},
    {"images", "turn_polynomials fold_moments", true, false, ov_check_images},
    {"mesh",
     "march_signs march_count march_number march_get march_put march_vertices march_boxes "
     "march_triangles march_refine march_place",
     true, false, ov_check_mesh},
    {"distances", "pack_leaves distances triangle_distances", true, false, ov_check_distances},
    {"picture", "trace trace_ellipsoids compare shade", false, false, ov_check_picture},
    {"many points", "field", false, false, ov_check_many_points},
    {"many terms", "packs_of_terms scan_lists hand_out_entries lists_of_packs field moments gram",
     false, false, ov_check_many_terms},
    {"many distances", "distances", false, false, ov_check_many_distances},
    {"fit", "all of a fit's", false, false, ov_check_fit},
};
enum { CHECKS = sizeof checks / sizeof *checks };

const ov_check *ov_checks(size_t *number) {
    *number = CHECKS;
    return checks;
}

/* OVOID_ERROR_CANCELLED alone ends the self-test; what else fails is a verdict. */
static ovoid_status run_check(ovoid_context *context, const ov_check *check, bool whole,
                              ov_checking *c, ovoid_check *told) {
    *c = (ov_checking){.context = context, .whole = whole};
    const double began = ov_seconds();
    const ovoid_status status = check->run(c);
    *told = (ovoid_check){.size = sizeof *told,
                          .name = check->name,
                          .kernels = check->kernels,
                          .seconds = ov_seconds() - began,
                          .compared = c->compared,
                          .error = NAN,
                          .text = c->text};
    if (c->wrong) {
        told->verdict = OVOID_CHECK_WRONG;
    } else if (status != OVOID_OK) {
        told->verdict = OVOID_CHECK_FAILED;
        told->text = ovoid_context_error(context);
    } else {
        told->error = c->worst;
    }
    return status == OVOID_ERROR_CANCELLED ? status : OVOID_OK;
}

/* ---- the first use of a device ------------------------------------------------------------ */

ovoid_status ov_selftest_brief(ovoid_context *context, char text[OV_SELFTEST_TEXT], bool *whole) {
    *whole = true;
    text[0] = '\0';
    for (size_t k = 0; k < CHECKS && !text[0]; ++k) {
        ov_checking c;
        ovoid_check told;
        if (!checks[k].brief)
            continue;
        const ovoid_status status = run_check(context, &checks[k], false, &c, &told);
        if (status != OVOID_OK)
            return status;
        *whole = *whole && told.verdict != OVOID_CHECK_FAILED;
        if (told.verdict == OVOID_CHECK_WRONG)
            snprintf(text, OV_SELFTEST_TEXT, "%s", told.text);
    }
    return OVOID_OK;
}

/* ---- the public self-test ----------------------------------------------------------------- */

void ovoid_selftest_options_init(ovoid_selftest_options *options, size_t size) {
    static const ovoid_selftest_options defaults = {0};
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

static const ovoid_selftest_result unknown = {.launch_seconds = NAN,
                                              .round_trip_seconds = NAN,
                                              .to_device_bytes = NAN,
                                              .from_device_bytes = NAN};

void ovoid_selftest_result_init(ovoid_selftest_result *result, size_t size) {
    ov_sized_init(result, size, &unknown, sizeof unknown);
}

static void count(const ovoid_check *check, ovoid_selftest_result *result) {
    result->passed += check->verdict == OVOID_CHECK_PASSED;
    result->wrong += check->verdict == OVOID_CHECK_WRONG;
    result->failed += check->verdict == OVOID_CHECK_FAILED;
}

static void tell(ovoid_context *context, const ovoid_check *check, ovoid_check_fn fn, void *user) {
    if (!fn)
        return;
    ++context->calling;
    fn(check, user);
    --context->calling;
}

static ovoid_status run_all(ovoid_context *context, const ovoid_selftest_options *options,
                            ovoid_check_fn fn, void *user, ovoid_selftest_result *result) {
    for (size_t k = 0; k < CHECKS; ++k) {
        ov_checking c;
        ovoid_check told;
        if (options->brief && !checks[k].brief)
            continue;
        ovoid_status status = ov_progress_step(context, k, CHECKS);
        if (status == OVOID_OK)
            status = run_check(context, &checks[k], !options->brief, &c, &told);
        if (status != OVOID_OK)
            return status;
        count(&told, result);
        tell(context, &told, fn, user);
        if (checks[k].needed && told.verdict != OVOID_CHECK_PASSED)
            break;
    }
    return OVOID_OK;
}

static ovoid_status measure_costs(ovoid_context *context, ovoid_selftest_result *result) {
    ov_costs costs;
    const ovoid_status status = ov_costs_measure(context, &costs);
    if (status != OVOID_OK) /* the checks have told */
        return status == OVOID_ERROR_CANCELLED ? status : OVOID_OK;
    result->launch_seconds = costs.launch;
    result->round_trip_seconds = costs.round_trip;
    result->to_device_bytes = costs.to_device;
    result->from_device_bytes = costs.from_device;
    return OVOID_OK;
}

ovoid_status ovoid_selftest(ovoid_context *context, const ovoid_selftest_options *options,
                            ovoid_check_fn fn, void *user, ovoid_selftest_result *result) {
    ovoid_status status = OVOID_OK;
    ovoid_selftest_options own = {0};
    ovoid_selftest_result made = unknown;
    ov_device *device = NULL;
    OV_NEED(context, context);
    ov_progress_begin(context, "selftest");
    if (options)
        OV_TRY(OV_SIZED_TAKE(context, ovoid_selftest_options, options, &own));
    OV_TRY(ov_sized_check(context, "ovoid_selftest_result", result));
    OV_TRY(ov_device_get(context, &device));
    const bool trusted = device->trusted;
    device->trusted = true; /* for as long as it is put to the test */
    made.vector = device->shape.vector;
    made.lanes = device->shape.lanes;
    made.team = device->team;
    made.solve_group = device->solve_group;
    status = run_all(context, &own, fn, user, &made);
    if (status == OVOID_OK)
        status = measure_costs(context, &made);
    device->trusted = trusted;
    OV_TRY(status);
    ov_sized_give(result, &made, sizeof made);
cleanup:
    ov_progress_end(context);
    return status;
}
