#include "write/scene.h"

#include "base/progress.h"
#include "base/sized.h"
#include "field/evaluate.h"
#include "model/ellipsoid.h"
#include "model/owner.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ovoid_scene_init(ovoid_scene *scene, size_t size) {
    static const ovoid_scene nothing = {0};
    ov_sized_init(scene, size, &nothing, sizeof nothing);
}

/* ---- taking one over ---------------------------------------------------------------------- */

static ovoid_status check_models(ovoid_context *context, const ovoid_scene *s) {
    if (!s->models && s->model_count)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a scene of %zu models without any",
                       s->model_count);
    for (size_t i = 0; i < s->model_count; i++)
        if (!s->models[i])
            return ov_fail(context, OVOID_ERROR_ARGUMENT, "model %zu of a scene is NULL", i + 1);
    if (!s->model_count && !s->molecule)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a scene has neither a molecule nor a model");
    return OVOID_OK;
}

static bool is_usable(double value) {
    return value >= 0.0 && isfinite(value);
}

ovoid_status ov_scene_take(ovoid_context *context, const ovoid_scene *given, ov_scene *scene) {
    ovoid_scene s;
    ovoid_scene_init(&s, sizeof s);
    ovoid_status status = OV_SIZED_TAKE(context, ovoid_scene, given, &s);
    if (status == OVOID_OK)
        status = check_models(context, &s);
    if (status != OVOID_OK)
        return status;
    if (!is_usable(s.decay) || !is_usable(s.isovalue))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "decay %g and isovalue %g of a scene must be finite and not negative",
                       s.decay, s.isovalue);
    const ovoid_model *const first = s.model_count ? s.models[0] : NULL;
    *scene = (ov_scene){.molecule = s.molecule,
                        .models = s.models,
                        .count = s.model_count,
                        .title = s.title,
                        .decay = s.decay,
                        .isovalue = s.isovalue};
    if (scene->decay == 0.0)
        scene->decay = first ? ovoid_model_decay(first) : OVOID_DEFAULT_DECAY;
    if (scene->isovalue == 0.0)
        scene->isovalue = first ? ovoid_model_isovalue(first) : OVOID_DEFAULT_ISOVALUE;
    return OVOID_OK;
}

ovoid_status ov_scene_fields(ovoid_context *context, ov_scene *scene) {
    ovoid_status status = OVOID_OK;
    if (scene->molecule && !scene->original)
        OV_TRY(ovoid_field_of_molecule(context, scene->molecule, scene->decay, scene->isovalue,
                                       &scene->original));
    if (!scene->count || scene->fields)
        return OVOID_OK;
    scene->fields = ov_alloc(context, scene->count, sizeof *scene->fields, "the fields of models");
    if (!scene->fields)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < scene->count; i++)
        OV_TRY(ovoid_field_of_model(context, scene->models[i], &scene->fields[i]));
cleanup:
    return status;
}

void ov_scene_drop(ov_scene *scene) {
    for (size_t i = 0; scene->fields && i < scene->count; i++)
        ovoid_field_destroy(&scene->fields[i]);
    free(scene->fields);
    scene->fields = NULL;
    ovoid_field_destroy(&scene->original);
}

/* ---- surfaces ------------------------------------------------------------------------------ */

ovoid_status ov_scene_mesh(ovoid_context *context, ovoid_field *field, double isovalue,
                           double spacing, ovoid_mesh **mesh) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.isovalue = isovalue;
    options.spacing = spacing;
    return ovoid_field_mesh(context, field, &options, mesh);
}

ovoid_status ov_scene_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                                ovoid_field *other, double level, float **distance) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(a);
    ovoid_distances all;
    float *found = ov_alloc(context, vertices, sizeof *found, "distances of vertices");
    double *value = ov_alloc(context, vertices, sizeof *value, "a field at vertices");
    if (!found || !value)
        OV_TRY(OVOID_ERROR_MEMORY);
    OV_TRY(ovoid_mesh_distances(context, a, b, false, &all, found));
    OV_TRY(ovoid_field_evaluate(context, other, ovoid_mesh_xyz(a), vertices, value, NULL));
    for (size_t i = 0; i < vertices; i++)
        if (value[i] <= level)
            found[i] = -found[i];
    *distance = found;
    found = NULL;
cleanup:
    free(found);
    free(value);
    return status;
}

/* ---- who an ellipsoid stands for ------------------------------------------------------------ */

static ovoid_status make_quadrics(ovoid_context *context, const ovoid_model *model,
                                  ov_quadric **quadrics) {
    const size_t count = ovoid_model_size(model);
    *quadrics = ov_alloc(context, count, sizeof **quadrics, "quadrics of a model");
    if (!*quadrics)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; i++)
        ov_quadric_of_ellipsoid(ovoid_model_ellipsoids(model) + i, *quadrics + i);
    return OVOID_OK;
}

/* How far from its centre an ellipsoid may be the largest at an atom: where it has fallen below
 * this, others that are nearer are larger, or the atom is no part of the model. */
#define LEAST 1e-3
#define REACH_MOST 60.0 /* angstrom */

static double reach_of(const ov_quadric *quadrics, size_t count) {
    double reach = 1.0;
    for (size_t i = 0; i < count; i++) {
        double half[3];
        if (ov_quadric_reach(&quadrics[i], LEAST, half))
            for (int k = 0; k < 3; k++)
                reach = fmax(reach, half[k]);
    }
    return fmin(reach, REACH_MOST);
}

static uint32_t largest_of(const ov_quadric *quadrics, const uint32_t *near, size_t count,
                           const double at[3]) {
    uint32_t best = near[0];
    double most = -INFINITY;
    for (size_t k = 0; k < count; k++) {
        const double value = ov_quadric_log_value(&quadrics[near[k]], at);
        if (value > most) {
            most = value;
            best = near[k];
        }
    }
    return best;
}

/* Those near an atom are asked alone, all of them where none is, or so many that some are missing.
 */
static ovoid_status find_owners(ovoid_context *context, const double *xyzr, size_t atoms,
                                const ov_quadric *quadrics, size_t count, uint32_t *owner) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    uint32_t near[2 * OV_NEAR_MAX];
    OV_TRY(ov_grid_of(context, quadrics[0].centre, sizeof *quadrics, count,
                      reach_of(quadrics, count), &grid));
    for (size_t i = 0; i < atoms; i++) {
        const double *const at = xyzr + 4 * i;
        OV_TRY(ov_progress_turn(context, i, atoms));
        const size_t found = ov_grid_near(&grid, at, (uint32_t)count, near);
        owner[i] = found && found < OV_NEAR_MAX ? largest_of(quadrics, near, found, at)
                                                : ov_owner_at(quadrics, count, at);
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

ovoid_status ov_scene_owner(ovoid_context *context, const ovoid_molecule *molecule,
                            const ovoid_model *model, uint32_t **owner) {
    ovoid_status status = OVOID_OK;
    const size_t atoms = ovoid_molecule_atoms(molecule), count = ovoid_model_size(model);
    ov_quadric *quadrics = NULL;
    uint32_t *found = ov_alloc(context, atoms, sizeof *found, "owners of atoms");
    if (!found)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ovoid_molecule_expand(context, molecule));
    if (ovoid_model_owner_count(model) == atoms) {
        memcpy(found, ovoid_model_owner(model), atoms * sizeof *found);
    } else {
        OV_TRY(make_quadrics(context, model, &quadrics));
        OV_TRY(find_owners(context, ovoid_molecule_xyzr(molecule), atoms, quadrics, count, found));
    }
    *owner = found;
    found = NULL;
cleanup:
    free(quadrics);
    free(found);
    return status;
}

ovoid_status ov_scene_sort(ovoid_context *context, const uint32_t *owner, size_t atoms,
                           size_t count, uint32_t **first, const uint32_t **order) {
    uint32_t *const begin = ov_alloc(context, count + 2 + atoms, sizeof *begin, "atoms by owner");
    if (!begin)
        return OVOID_ERROR_MEMORY;
    uint32_t *const sorted = begin + count + 2;
    for (size_t i = 0; i < atoms; i++)
        begin[owner[i] + 2]++;
    for (size_t e = 0; e < count; e++)
        begin[e + 2] += begin[e + 1];
    for (size_t i = 0; i < atoms; i++) /* moves the begin of each to that of the next one */
        sorted[begin[owner[i] + 1]++] = (uint32_t)i;
    *first = begin;
    *order = sorted;
    return OVOID_OK;
}
