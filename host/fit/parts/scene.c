#include "fit/parts/scene.h"

#include "fit/adaptive/constants.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ov_scene_destroy(ov_scene *scene) {
    free(scene->xyzr);
    free(scene->image);
    free(scene->model);
    *scene = (ov_scene){0};
}

ovoid_status ov_scene_add_atom(ovoid_context *context, const double atom[4], size_t image,
                               ov_scene *s) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(context, &s->xyzr, &s->atoms_capacity, 4 * (s->atoms + 1), sizeof *s->xyzr,
                   "atoms"));
    OV_TRY(
        ov_grow(context, &s->image, &s->image_capacity, s->atoms + 1, sizeof *s->image, "atoms"));
    s->image[s->atoms] = (uint32_t)image;
    memcpy(s->xyzr + 4 * s->atoms++, atom, 4 * sizeof *atom);
cleanup:
    return status;
}

static ovoid_status add_term(ovoid_context *context, const ov_quadric *quadric, ov_scene *s) {
    const ovoid_status status = ov_grow(context, &s->model, &s->model_capacity, s->model_count + 1,
                                        sizeof *s->model, "ellipsoids");
    if (status == OVOID_OK)
        s->model[s->model_count++] = *quadric;
    return status;
}

/* An image of part q. */
typedef struct neighbour {
    size_t part, image;
    bool done;
} neighbour;

void ov_scene_place_atom(const ov_parts *parts, const double atom[4], size_t image,
                         double placed[4]) {
    memcpy(placed, atom, 4 * sizeof *atom);
    if (image > 0)
        ov_rigid_move(&parts->partition.image[image], atom, placed);
}

void ov_scene_place_term(const ov_parts *parts, const ov_quadric *quadric, size_t image,
                         ov_quadric *placed) {
    if (image > 0)
        ov_quadric_move(quadric, &parts->partition.image[image], placed);
    else
        *placed = *quadric;
}

/* The neighbour's atoms that are about a box; unless it is done, they are the model there, too.
 * felt gets which they are. */
static ovoid_status add_atoms(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                              const neighbour *of, bool *felt, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < parts->partition.part[of->part].count; ++n) {
        double atom[4];
        ov_scene_place_atom(parts, ov_part_atom(parts, of->part, n), of->image, atom);
        felt[n] = ov_box_near(box, atom, parts->reach);
        if (!felt[n])
            continue;
        OV_TRY(ov_scene_add_atom(context, atom, of->image, s));
        if (!of->done) {
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
    const ov_box judged = ov_box_larger(box, parts->margin);
    return ov_quadric_meets(quadric, ov_tuned.refine_cutoff * parts->options->isovalue, judged.low,
                            judged.high);
}

/* An image's ellipsoids that stand for atoms about a box (taken), and those that are felt there;
 * without those that are chosen. */
static ovoid_status add_ellipsoids(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                                   const ov_found *found, size_t image, const ov_chosen *chosen,
                                   const bool *taken, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < found->count; ++i) {
        ov_quadric placed;
        if (chosen && chosen[i] > 0)
            continue;
        ov_scene_place_term(parts, &found->quadrics[i], image, &placed);
        if (taken[i] || reaches(parts, &placed, box))
            OV_TRY(add_term(context, &placed, s));
    }
cleanup:
    return status;
}

/* The ellipsoids of a neighbour that is done. */
static ovoid_status add_done_part(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                                  const neighbour *of, const bool *felt, ov_scene *s) {
    const ov_found *const found = &parts->fit[of->part].found;
    bool *const taken = ov_alloc(context, found->count, sizeof *taken, "ellipsoids");
    if (!taken)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < parts->partition.part[of->part].count; ++n)
        if (felt[n])
            taken[found->owner[n]] = true;
    const ovoid_status status =
        add_ellipsoids(context, parts, box, found, of->image, NULL, taken, s);
    free(taken);
    return status;
}

static ovoid_status add_part(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                             const neighbour *of, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    bool *const felt =
        ov_alloc(context, parts->partition.part[of->part].count, sizeof *felt, "atoms of a part");
    if (!felt)
        return OVOID_ERROR_MEMORY;
    OV_TRY(add_atoms(context, parts, box, of, felt, s));
    if (of->done)
        OV_TRY(add_done_part(context, parts, box, of, felt, s));
cleanup:
    free(felt);
    return status;
}

ovoid_status ov_scene_of_part(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &parts->partition;
    for (size_t n = 0; n < cut->part[p].count; ++n)
        OV_TRY(ov_scene_add_atom(context, ov_part_atom(parts, p, n), 0, scene));
    for (size_t g = 0; g < cut->images; ++g)
        for (size_t q = 0; q < cut->count; ++q) {
            const neighbour of = {
                .part = q, .image = g, .done = cut->part[q].colour < cut->part[p].colour};
            if ((g > 0 || q != p) && ov_part_image_near(cut, p, q, g))
                OV_TRY(add_part(context, parts, &cut->part[p].box, &of, scene));
        }
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

/* The atoms of an image of part q about the box; taken gets the ellipsoids that stand for them. */
static ovoid_status add_done(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                             size_t q, size_t image, const ov_chosen *chosen, bool *taken,
                             ov_scene *s) {
    ovoid_status status = OVOID_OK;
    const ov_part *const part = &parts->partition.part[q];
    for (size_t n = 0; n < part->count; ++n) {
        const uint32_t owner = parts->model.owner[parts->partition.order[part->first + n]];
        double atom[4];
        ov_scene_place_atom(parts, ov_part_atom(parts, q, n), image, atom);
        if (!ov_box_near(box, atom, parts->reach) || (chosen && chosen[owner] == image + 1))
            continue;
        OV_TRY(ov_scene_add_atom(context, atom, image, s));
        taken[owner] = true;
    }
cleanup:
    return status;
}

static bool meets(const ov_partition *cut, const ov_box *box, size_t q, size_t image) {
    const ov_box there =
        image > 0 ? ov_box_move(&cut->part[q].box, &cut->image[image]) : cut->part[q].box;
    return ov_boxes_near(box, &there, cut->near);
}

bool ov_scene_meets(const ov_parts *parts, const ov_box *box, size_t image) {
    for (size_t q = 0; q < parts->partition.count; ++q)
        if (meets(&parts->partition, box, q, image))
            return true;
    return false;
}

/* What an image of all that is done has about the box. */
static ovoid_status add_image(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                              size_t image, const ov_chosen *chosen, bool *taken, ov_scene *s) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &parts->partition;
    memset(taken, 0, parts->model.count * sizeof *taken);
    for (size_t q = 0; q < cut->count; ++q)
        if (meets(cut, box, q, image))
            OV_TRY(add_done(context, parts, box, q, image, chosen, taken, s));
    if (image == 0 || ov_scene_meets(parts, box, image))
        OV_TRY(add_ellipsoids(context, parts, box, &parts->model, image, chosen, taken, s));
cleanup:
    return status;
}

ovoid_status ov_scene_about(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                            const ov_chosen *chosen, ov_scene *scene) {
    ovoid_status status = OVOID_OK;
    bool *const taken = ov_alloc(context, parts->model.count, sizeof *taken, "ellipsoids");
    if (!taken)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < parts->partition.images; ++g)
        OV_TRY(add_image(context, parts, box, g, chosen, taken, scene));
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
    return (ov_surroundings){.atoms = scene->atoms - own,
                             .fixed = scene->model,
                             .fixed_count = scene->model_count,
                             .region = ov_box_larger(box, parts->margin),
                             .done = done,
                             .total = parts->partition.count};
}
