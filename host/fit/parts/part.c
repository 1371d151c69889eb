#include "fit/parts/part.h"

#include "fit/adaptive/constants.h"
#include "fit/parts/scene.h"

#include <math.h>
#include <stdlib.h>

void ov_part_count_work(const ovoid_fit_result *one, ovoid_fit_result *all) {
    all->iterations += one->iterations;
    all->adaptive.solver_iterations += one->adaptive.solver_iterations;
    for (size_t n = 0; n < OVOID_COUNTS; ++n)
        all->counts[n] += one->counts[n];
}

ovoid_status ov_part_take_atoms(ovoid_context *context, const ov_parts *parts, size_t p,
                                ov_part_fit *fit) {
    const ov_part *const part = &parts->partition.part[p];
    ov_found made = {.count = part->count};
    made.quadrics = ov_alloc(context, part->count, sizeof *made.quadrics, "ellipsoids");
    made.owner = ov_alloc(context, part->count, sizeof *made.owner, "owners");
    if (!made.quadrics || !made.owner) {
        ov_found_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t n = 0; n < part->count; ++n) {
        ov_quadric_of_atom(ov_part_atom(parts, p, n), parts->options->decay, &made.quadrics[n]);
        made.owner[n] = (uint32_t)n;
    }
    ov_found_destroy(&fit->found);
    ovoid_fit_result_init(&fit->result, sizeof fit->result);
    fit->found = made;
    fit->result.ellipsoids = made.count;
    fit->result.verdict = OVOID_VERDICT_NO_SURFACE;
    return OVOID_OK;
}

ovoid_fit_options ov_part_options(const ov_parts *parts, size_t ellipsoids) {
    ovoid_fit_options options = *parts->options;
    if (parts->ellipsoids) {
        options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
        options.adaptive.ellipsoids = (uint32_t)ellipsoids;
    }
    return options;
}

static ovoid_status fit_scene(ovoid_context *context, const ov_parts *parts, size_t p,
                              const ov_scene *scene, const ov_surroundings *around,
                              ov_part_fit *fit) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options options =
        ov_part_options(parts, parts->ellipsoids ? parts->ellipsoids[p] : 0);
    ov_adaptive *adaptive = NULL;
    OV_TRY(ov_adaptive_create(context, scene->xyzr, parts->partition.part[p].count, around, false,
                              &adaptive));
    OV_TRY(ov_adaptive_reach(adaptive, &options, NULL, ov_seconds(), &fit->found, &fit->result));
cleanup:
    ov_adaptive_destroy(&adaptive);
    return status;
}

ovoid_status ov_part_fit_atoms(ovoid_context *context, const ov_parts *parts, size_t p, size_t done,
                               ov_part_fit *fit) {
    ovoid_status status = OVOID_OK;
    ov_scene scene = {0};
    ov_surroundings around;
    ov_part_fit made = {0};
    const ov_part *const part = &parts->partition.part[p];
    ovoid_fit_result_init(&made.result, sizeof made.result);
    OV_TRY(ov_scene_of_part(context, parts, p, &scene));
    around = ov_scene_surround(parts, &scene, part->count, &part->box, done);
    status = fit_scene(context, parts, p, &scene, &around, &made);
    if (status == OVOID_ERROR_EMPTY) /* it has no part in the surface */
        status = ov_part_take_atoms(context, parts, p, &made);
    if (status == OVOID_OK) {
        *fit = made;
        made.found = (ov_found){0};
    }
cleanup:
    ov_found_destroy(&made.found);
    ov_scene_destroy(&scene);
    return status;
}

/* ---- after all parts ------------------------------------------------------------------------- */

ovoid_status ov_part_survey(ovoid_context *context, const ov_parts *parts, size_t p,
                            ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    const ov_box *const box = &parts->partition.part[p].cell;
    const ovoid_fit_options *const options = parts->options;
    ov_survey_options wanted = {.isovalue = options->isovalue,
                                .spacing = options->adaptive.mesh_spacing,
                                .flat = true,
                                .least = parts->least,
                                .exact = parts->ellipsoids};
    ov_scene scene = {0};
    ov_quadric *original = NULL;
    OV_TRY(ov_scene_of_cell(context, parts, p, &scene));
    if (parts->centre)
        wanted.image = scene.image;
    original = ov_alloc(context, scene.atoms, sizeof *original, "atoms");
    if (!original) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t i = 0; i < scene.atoms; ++i)
        ov_quadric_of_atom(scene.xyzr + 4 * i, options->decay, &original[i]);
    OV_TRY(ov_survey(context, &wanted, original, scene.atoms, scene.model, scene.model_count,
                     box->low, box->high, cell));
cleanup:
    free(original);
    ov_scene_destroy(&scene);
    return status;
}
