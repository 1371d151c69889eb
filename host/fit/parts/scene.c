#include "fit/parts/scene.h"

#include "fit/adaptive/constants.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_scene_destroy(ov_scene *scene) {
    free(scene->xyzr);
    free(scene->model);
    *scene = (ov_scene){0};
}

ovoid_status ov_scene_add_atom(ovoid_context *context, const double atom[4], ov_scene *s) {
    const ovoid_status status = ov_grow(context, &s->xyzr, &s->atoms_capacity, 4 * (s->atoms + 1),
                                        sizeof *s->xyzr, "atoms");
    if (status == OVOID_OK)
        memcpy(s->xyzr + 4 * s->atoms++, atom, 4 * sizeof *atom);
    return status;
}

static ovoid_status add_term(ovoid_context *context, const ov_quadric *quadric, ov_scene *s) {
    const ovoid_status status = ov_grow(context, &s->model, &s->model_capacity, s->model_count + 1,
                                        sizeof *s->model, "ellipsoids");
    if (status == OVOID_OK)
        s->model[s->model_count++] = *quadric;
    return status;
}

/* The atoms of part q that are about a box; unless it is done, they are the model there, too. felt
 * gets which they are. */
static ovoid_status add_atoms(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                              size_t q, bool done, bool *felt, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < parts->partition.part[q].count; ++n) {
        const double *const atom = ov_part_atom(parts, q, n);
        felt[n] = ov_box_near(box, atom, parts->reach);
        if (!felt[n])
            continue;
        OV_TRY(ov_scene_add_atom(context, atom, s));
        if (!done) {
            ov_quadric quadric;
            ov_quadric_of_atom(atom, parts->options->decay, &quadric);
            OV_TRY(add_term(context, &quadric, s));
        }
    }
cleanup:
    return status;
}

/* Whether an ellipsoid is felt where the surface about a box is judged. */
static bool reaches(const ov_parts *parts, const ov_quadric *quadric, const ov_box *box) {
    double half[3];
    if (!ov_quadric_reach(quadric, ov_tuned.refine_cutoff * parts->options->isovalue, half))
        return false;
    for (size_t k = 0; k < 3; ++k)
        if (quadric->centre[k] + half[k] < box->low[k] - parts->margin ||
            quadric->centre[k] - half[k] > box->high[k] + parts->margin)
            return false;
    return true;
}

/* The ellipsoids of part q that stand for atoms about a box, and those that are felt there. */
static ovoid_status add_ellipsoids(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                                   size_t q, const bool *felt, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    const ov_found *const found = &parts->fit[q].found;
    bool *const taken = ov_alloc(context, found->count, sizeof *taken, "ellipsoids");
    if (!taken)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < parts->partition.part[q].count; ++n)
        if (felt[n])
            taken[found->owner[n]] = true;
    for (size_t i = 0; i < found->count; ++i)
        if (taken[i] || reaches(parts, &found->quadrics[i], box))
            OV_TRY(add_term(context, &found->quadrics[i], s));
cleanup:
    free(taken);
    return status;
}

static ovoid_status add_part(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                             size_t q, bool done, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    bool *const felt =
        ov_alloc(context, parts->partition.part[q].count, sizeof *felt, "atoms of a part");
    if (!felt)
        return OVOID_ERROR_MEMORY;
    OV_TRY(add_atoms(context, parts, box, q, done, felt, s));
    if (done)
        OV_TRY(add_ellipsoids(context, parts, box, q, felt, s));
cleanup:
    free(felt);
    return status;
}

ovoid_status ov_scene_of_part(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &parts->partition;
    for (size_t n = 0; n < cut->part[p].count; ++n)
        OV_TRY(ov_scene_add_atom(context, ov_part_atom(parts, p, n), scene));
    for (size_t q = 0; q < cut->count; ++q)
        if (q != p && ov_parts_near(cut, p, q))
            OV_TRY(add_part(context, parts, &cut->part[p].box, q,
                            cut->part[q].colour < cut->part[p].colour, scene));
cleanup:
    return status;
}

/* The box about which surfaces are judged in all of the cell where there are any. */
static void box_of_cell(const ov_parts *parts, size_t p, ov_box *box) {
    const ov_box *const cell = &parts->partition.part[p].cell;
    for (size_t k = 0; k < 3; ++k) {
        double low = INFINITY, high = -INFINITY;
        for (size_t q = 0; q < parts->partition.count; ++q) {
            low = fmin(low, parts->partition.part[q].box.low[k]);
            high = fmax(high, parts->partition.part[q].box.high[k]);
        }
        box->low[k] = fmax(low, cell->low[k] + parts->margin);
        box->high[k] = fmin(high, cell->high[k] - parts->margin);
    }
}

/* The atoms of part q about the box; taken gets the ellipsoids that stand for them. */
static ovoid_status add_done(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                             size_t q, const bool *chosen, bool *taken, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    const ov_part *const part = &parts->partition.part[q];
    for (size_t n = 0; n < part->count; ++n) {
        const double *const atom = ov_part_atom(parts, q, n);
        const uint32_t owner = parts->model.owner[parts->partition.order[part->first + n]];
        if (!ov_box_near(box, atom, parts->reach) || (chosen && chosen[owner]))
            continue;
        OV_TRY(ov_scene_add_atom(context, atom, s));
        taken[owner] = true;
    }
cleanup:
    return status;
}

ovoid_status ov_scene_about(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                            const bool *chosen, ov_scene *scene) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &parts->partition;
    const ov_found *const model = &parts->model;
    bool *const taken = ov_alloc(context, model->count, sizeof *taken, "ellipsoids");
    if (!taken)
        return OVOID_ERROR_MEMORY;
    for (size_t q = 0; q < cut->count; ++q)
        if (ov_boxes_near(box, &cut->part[q].box, cut->near))
            OV_TRY(add_done(context, parts, box, q, chosen, taken, scene));
    for (size_t i = 0; i < model->count; ++i)
        if (!(chosen && chosen[i]) && (taken[i] || reaches(parts, &model->quadrics[i], box)))
            OV_TRY(add_term(context, &model->quadrics[i], scene));
cleanup:
    free(taken);
    return status;
}

ovoid_status ov_scene_of_cell(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene) {
    ov_box box;
    box_of_cell(parts, p, &box);
    return ov_scene_about(context, parts, &box, NULL, scene);
}

ov_surroundings ov_scene_surround(const ov_parts *parts, const ov_scene *scene, size_t own,
                                  const ov_box *box, size_t done) {
    ov_surroundings around = {.atoms = scene->atoms - own,
                              .fixed = scene->model,
                              .fixed_count = scene->model_count,
                              .done = done,
                              .total = parts->partition.count};
    for (size_t k = 0; k < 3; ++k) {
        around.low[k] = box->low[k] - parts->margin;
        around.high[k] = box->high[k] + parts->margin;
    }
    return around;
}
