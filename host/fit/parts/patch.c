#include "fit/parts/patch.h"

#include "fit/adaptive/constants.h"
#include "fit/parts/record.h"
#include "fit/parts/scene.h"
#include "fit/parts/sharing.h"
#include "fit/parts/workers.h"
#include "mesh/union.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Spots that are near each other, and what is fitted about them. */
typedef struct patch {
    ov_spot *spot;
    size_t spots;
    uint32_t *ellipsoid; /* of the model as it is when this patch has its turn */
    size_t ellipsoids;
    uint32_t *atom; /* those that the ellipsoids stand for */
    size_t atoms;
    uint32_t *image; /* of each atom: in which image of the unit its ellipsoid is fitted */
    ov_part_fit fit; /* what became of the ellipsoids; count 0: they stay */
} patch;

typedef struct patches {
    ov_parts *parts;
    patch *patch;
    ov_partition cut; /* a part for each patch, with its box and its colour */
    double reach;     /* angstrom: ellipsoids this near to a spot are in */
    bool *todo;
} patches;

/* ---- which spots are one patch --------------------------------------------------------------- */

static double distance(const double a[3], const double b[3]) {
    const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

/* Spots that are in each other's reach are of one patch: of[n] is the first of them. */
static void unite_spots(const ov_spot *spots, size_t count, double apart, uint32_t *of) {
    for (size_t n = 0; n < count; ++n)
        of[n] = (uint32_t)n;
    for (size_t n = 0; n < count; ++n)
        for (size_t m = 0; m < n; ++m)
            if (distance(spots[n].at, spots[m].at) < apart)
                ov_unite(of, (uint32_t)n, (uint32_t)m);
}

static ovoid_status fill_patch(ovoid_context *context, patches *all, const ov_spot *spots,
                               size_t count, const uint32_t *of, uint32_t which, size_t p) {
    patch *const one = &all->patch[p];
    ov_part *const part = &all->cut.part[p];
    one->spot = ov_alloc(context, count, sizeof *one->spot, "spots");
    if (!one->spot)
        return OVOID_ERROR_MEMORY;
    part->box = ov_box_empty;
    for (size_t n = 0; n < count; ++n)
        if (of[n] == which) {
            one->spot[one->spots++] = spots[n];
            ov_box_add(&part->box, spots[n].at, all->reach);
        }
    return OVOID_OK;
}

static ovoid_status make_patches(ovoid_context *context, const ov_spot *spots, size_t count,
                                 patches *all) {
    ovoid_status status = OVOID_OK;
    uint32_t *const of = ov_alloc(context, count, sizeof *of, "spots");
    all->patch = ov_alloc(context, count, sizeof *all->patch, "spots");
    all->cut.part = ov_alloc(context, count, sizeof *all->cut.part, "spots");
    all->todo = ov_alloc(context, count, sizeof *all->todo, "spots");
    if (!of || !all->patch || !all->cut.part || !all->todo) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    unite_spots(spots, count, all->reach, of);
    for (size_t n = 0; n < count; ++n)
        of[n] = ov_union_first(of, (uint32_t)n);
    for (size_t n = 0; n < count; ++n)
        if (of[n] == n)
            OV_TRY(fill_patch(context, all, spots, count, of, (uint32_t)n, all->cut.count++));
    OV_TRY(ov_partition_colour(context, &all->cut));
cleanup:
    free(of);
    return status;
}

static void patches_destroy(patches *all) {
    for (size_t p = 0; all->patch && p < all->cut.count; ++p) {
        free(all->patch[p].spot);
        free(all->patch[p].ellipsoid);
        free(all->patch[p].atom);
        free(all->patch[p].image);
        ov_found_destroy(&all->patch[p].fit.found);
    }
    free(all->patch);
    free(all->cut.part);
    free(all->todo);
}

/* ---- what is fitted -------------------------------------------------------------------------- */

/* Whether an ellipsoid has to do with a place that is off, however far its centre is from there. */
static bool matters(const patches *all, const patch *one, const ov_quadric *placed) {
    const double least = log(ov_tuned.grow_matters * all->parts->options->isovalue);
    for (size_t n = 0; n < one->spots; ++n)
        if (ov_quadric_log_value(placed, one->spot[n].at) >= least)
            return true;
    return false;
}

/* Marks what an image of the model has about the spots of a patch. Of an ellipsoid that is there in
 * several images, one is fitted, and the others follow. */
static void choose_in_image(const patches *all, const patch *one, size_t image, ov_chosen *chosen) {
    const ov_found *const model = &all->parts->model;
    for (size_t i = 0; i < model->count; ++i) {
        ov_quadric placed;
        if (chosen[i])
            continue;
        ov_scene_place_term(all->parts, &model->quadrics[i], image, &placed);
        if (ov_spots_near(one->spot, one->spots, placed.centre, all->reach) ||
            matters(all, one, &placed))
            chosen[i] = (ov_chosen)(image + 1);
    }
}

/* Marks the ellipsoids of a patch, and lists them and their atoms; place gets where in the list
 * each is. */
static ovoid_status list_patch(ovoid_context *context, const patches *all, size_t p,
                               ov_chosen *chosen, uint32_t *place) {
    const ov_found *const model = &all->parts->model;
    patch *const one = &all->patch[p];
    for (size_t g = 0; g < all->cut.images; ++g)
        if (g == 0 || ov_scene_meets(all->parts, &all->cut.part[p].box, g))
            choose_in_image(all, one, g, chosen);
    for (size_t i = 0; i < model->count; ++i)
        if (chosen[i])
            place[i] = (uint32_t)one->ellipsoids++;
    for (size_t a = 0; a < all->parts->atoms; ++a)
        one->atoms += chosen[model->owner[a]] > 0;
    one->ellipsoid = ov_alloc(context, one->ellipsoids, sizeof *one->ellipsoid, "ellipsoids");
    one->atom = ov_alloc(context, one->atoms, sizeof *one->atom, "atoms");
    one->image = ov_alloc(context, one->atoms, sizeof *one->image, "atoms");
    if (!one->ellipsoid || !one->atom || !one->image)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < model->count; ++i)
        if (chosen[i])
            one->ellipsoid[place[i]] = (uint32_t)i;
    for (size_t a = 0, n = 0; a < all->parts->atoms; ++a)
        if (chosen[model->owner[a]]) {
            one->image[n] = chosen[model->owner[a]] - 1;
            one->atom[n++] = (uint32_t)a;
        }
    return OVOID_OK;
}

/* The patch's ellipsoids as they are, and its atoms' owners among these. */
static ovoid_status take_start(ovoid_context *context, const patches *all, const patch *one,
                               const ov_chosen *chosen, const uint32_t *place, ov_found *start) {
    const ov_found *const model = &all->parts->model;
    *start = (ov_found){.count = one->ellipsoids};
    start->quadrics = ov_alloc(context, one->ellipsoids, sizeof *start->quadrics, "ellipsoids");
    start->owner = ov_alloc(context, one->atoms, sizeof *start->owner, "owners");
    if (!start->quadrics || !start->owner)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < one->ellipsoids; ++n) {
        const uint32_t i = one->ellipsoid[n];
        ov_scene_place_term(all->parts, &model->quadrics[i], chosen[i] - 1, &start->quadrics[n]);
    }
    for (size_t n = 0; n < one->atoms; ++n)
        start->owner[n] = place[model->owner[one->atom[n]]];
    return OVOID_OK;
}

/* Motions that carry what is in the box to where it is felt there: its images follow. */
static ovoid_status list_images(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                                ov_surroundings *around, ov_rigid **list) {
    const ov_partition *const cut = &parts->partition;
    *list = ov_alloc(context, cut->images, sizeof **list, "images");
    if (!*list)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 1; g < cut->images; ++g) {
        const ov_box there = ov_box_move(box, &cut->image[g]);
        if (ov_boxes_near(box, &there, cut->near))
            (*list)[around->images++] = cut->image[g];
    }
    around->image = *list;
    return OVOID_OK;
}

static ovoid_status fit_patch(ovoid_context *context, const patches *all, patch *one,
                              const ov_chosen *chosen, const ov_found *start, size_t done) {
    ovoid_status status = OVOID_OK;
    const ov_parts *const parts = all->parts;
    ovoid_fit_options options = ov_part_options(parts, one->ellipsoids);
    ov_box box = ov_box_empty;
    ov_scene scene = {0};
    ov_rigid *images = NULL;
    ov_adaptive *adaptive = NULL;
    for (size_t n = 0; n < one->atoms; ++n) {
        double atom[4];
        ov_scene_place_atom(parts, parts->xyzr + 4 * (size_t)one->atom[n], one->image[n], atom);
        ov_box_add(&box, atom, 0.0);
        OV_TRY(ov_scene_add_atom(context, atom, 0, &scene));
    }
    OV_TRY(ov_scene_about(context, parts, &box, chosen, &scene));
    ov_surroundings around = ov_scene_surround(parts, &scene, one->atoms, &box, done);
    around.total = all->cut.count;
    around.spots = one->spot;
    around.spot_count = one->spots;
    options.adaptive.tolerance = parts->least;
    OV_TRY(list_images(context, parts, &box, &around, &images));
    OV_TRY(ov_adaptive_create(context, scene.xyzr, one->atoms, &around, false, &adaptive));
    OV_TRY(ov_adaptive_reach(adaptive, &options, start, ov_seconds(), &one->fit.found,
                             &one->fit.result));
cleanup:
    ov_adaptive_destroy(&adaptive);
    ov_scene_destroy(&scene);
    free(images);
    return status;
}

static uint32_t image_of_nearest(const ov_parts *parts, const patch *one, const double at[3]) {
    double least = INFINITY;
    uint32_t image = 0;
    for (size_t n = 0; n < one->atoms; ++n) {
        double atom[4];
        ov_scene_place_atom(parts, parts->xyzr + 4 * (size_t)one->atom[n], one->image[n], atom);
        if (distance(atom, at) < least) {
            least = distance(atom, at);
            image = one->image[n];
        }
    }
    return image;
}

/* Takes what was fitted in images of the unit back to the unit: an ellipsoid was in the image of
 * its atoms, or, if it stands for none, of the atom that is nearest. */
static ovoid_status bring_home(ovoid_context *context, const patches *all, patch *one) {
    const ov_partition *const cut = &all->parts->partition;
    ov_found *const found = &one->fit.found;
    uint32_t *const image = ov_alloc(context, found->count, sizeof *image, "ellipsoids");
    if (!image)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < found->count; ++i)
        image[i] = image_of_nearest(all->parts, one, found->quadrics[i].centre);
    for (size_t n = one->atoms; n-- > 0;) /* the first atom has the last word */
        image[found->owner[n]] = one->image[n];
    for (size_t i = 0; i < found->count; ++i)
        if (image[i] > 0) {
            const ov_rigid back = ov_rigid_inverse(&cut->image[image[i]]);
            ov_quadric_move(&found->quadrics[i], &back, &found->quadrics[i]);
        }
    free(image);
    return OVOID_OK;
}

/* As it was before its task, for another device to try. */
static void forget(patch *one) {
    free(one->ellipsoid);
    free(one->atom);
    free(one->image);
    one->ellipsoid = one->atom = one->image = NULL;
    one->ellipsoids = one->atoms = 0;
    ov_found_destroy(&one->fit.found);
}

/* Whether the patch is as far off as it was. */
static bool is_no_better(const ov_parts *parts, const patch *one) {
    const ovoid_fit_result *const result = &one->fit.result;
    double before = 0.0;
    for (size_t n = 0; n < one->spots; ++n)
        before = fmax(before, one->spot[n].distance);
    return parts->ellipsoids
               ? !(result->distance < before)
               : result->verdict == OVOID_VERDICT_MISSED && result->distance >= before;
}

static ovoid_status task(ovoid_context *context, size_t p, size_t done, void *user) {
    ovoid_status status = OVOID_OK;
    const patches *const all = user;
    patch *const one = &all->patch[p];
    const size_t count = all->parts->model.count;
    ov_found start = {0};
    ov_chosen *const chosen = ov_alloc(context, count, sizeof *chosen, "ellipsoids");
    uint32_t *const place = ov_alloc(context, count, sizeof *place, "ellipsoids");
    if (!chosen || !place) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    ovoid_fit_result_init(&one->fit.result, sizeof one->fit.result);
    OV_TRY(list_patch(context, all, p, chosen, place));
    if (one->atoms == 0)
        goto cleanup;
    OV_TRY(take_start(context, all, one, chosen, place, &start));
    status = fit_patch(context, all, one, chosen, &start, done);
    if (status == OVOID_ERROR_EMPTY || (status == OVOID_OK && is_no_better(all->parts, one))) {
        forget(one); /* nothing of the surface is there, or it stays as it is */
        status = OVOID_OK;
    } else if (status == OVOID_OK) {
        status = bring_home(context, all, one);
    }
cleanup:
    if (status != OVOID_OK)
        forget(one);
    ov_found_destroy(&start);
    free(chosen);
    free(place);
    return status;
}

/* For other ranks: which ellipsoids and atoms, and what became of them. */
static ovoid_status pack(ovoid_context *context, size_t p, ov_bytes *to, void *user) {
    ovoid_status status = OVOID_OK;
    const patches *const all = user;
    const patch *const one = &all->patch[p];
    const uint64_t counts[] = {one->ellipsoids, one->atoms};
    OV_TRY(ov_bytes_put(context, to, counts, sizeof counts));
    OV_TRY(ov_bytes_put(context, to, one->ellipsoid, one->ellipsoids * sizeof *one->ellipsoid));
    OV_TRY(ov_bytes_put(context, to, one->atom, one->atoms * sizeof *one->atom));
    OV_TRY(ov_record_put(context, p, one->atoms, &one->fit, to));
cleanup:
    return status;
}

static ovoid_status unpack(ovoid_context *context, size_t p, ov_reading *from, void *user) {
    ovoid_status status = OVOID_OK;
    patch *const one = &((patches *)user)->patch[p];
    uint64_t counts[2];
    if (!ov_bytes_take(from, counts, sizeof counts))
        return ov_fail(context, OVOID_ERROR_FORMAT, "a message ends within a patch");
    OV_TRY(ov_bytes_take_array(context, from, &one->ellipsoid, counts[0], sizeof *one->ellipsoid,
                               "ellipsoids"));
    one->ellipsoids = (size_t)counts[0];
    OV_TRY(ov_bytes_take_array(context, from, &one->atom, counts[1], sizeof *one->atom, "atoms"));
    one->atoms = (size_t)counts[1];
    OV_TRY(ov_record_take(context, p, one->atoms, from, &one->fit));
cleanup:
    return status;
}

/* ---- the model after it ---------------------------------------------------------------------- */

/* The model's ellipsoids less those of the patches of a colour, and these patches' own behind them.
 */
static ovoid_status replace(ovoid_context *context, patches *all) {
    ov_found *const model = &all->parts->model;
    ov_found made = *model;
    size_t kept = 0, room = model->count;
    uint32_t *const moved = ov_alloc(context, model->count, sizeof *moved, "ellipsoids");
    for (size_t p = 0; p < all->cut.count; ++p)
        room += all->todo[p] ? all->patch[p].fit.found.count : 0;
    made.quadrics = ov_alloc(context, room, sizeof *made.quadrics, "ellipsoids");
    if (!moved || !made.quadrics) {
        free(moved);
        free(made.quadrics);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t p = 0; p < all->cut.count; ++p)
        for (size_t i = 0;
             all->todo[p] && all->patch[p].fit.found.count > 0 && i < all->patch[p].ellipsoids; ++i)
            moved[all->patch[p].ellipsoid[i]] = UINT32_MAX;
    for (size_t i = 0; i < model->count; ++i)
        if (moved[i] != UINT32_MAX) {
            made.quadrics[kept] = model->quadrics[i];
            moved[i] = (uint32_t)kept++;
        }
    for (size_t a = 0; a < all->parts->atoms; ++a)
        model->owner[a] = moved[model->owner[a]];
    for (size_t p = 0; p < all->cut.count; ++p) {
        const ov_found *const found = &all->patch[p].fit.found;
        if (!all->todo[p] || found->count == 0)
            continue;
        for (size_t n = 0; n < all->patch[p].atoms; ++n)
            model->owner[all->patch[p].atom[n]] = (uint32_t)kept + found->owner[n];
        memcpy(made.quadrics + kept, found->quadrics, found->count * sizeof *found->quadrics);
        kept += found->count;
    }
    free(model->quadrics);
    model->quadrics = made.quadrics;
    model->count = model->fewest = kept;
    free(moved);
    return OVOID_OK;
}

static void count_work(const patches *all, ovoid_fit_result *result) {
    for (size_t p = 0; p < all->cut.count; ++p) {
        const ovoid_fit_result *const one = &all->patch[p].fit.result;
        if (all->todo[p] && one->iterations != OVOID_UNKNOWN)
            ov_part_count_work(one, result);
    }
}

static ovoid_status tell_touched(ovoid_context *context, const patches *all, ov_box **touched,
                                 size_t *count) {
    *count = 0;
    *touched = ov_alloc(context, all->cut.count, sizeof **touched, "patches");
    if (!*touched)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < all->cut.count; ++p)
        if (all->patch[p].fit.found.count > 0)
            (*touched)[(*count)++] = all->cut.part[p].box;
    return OVOID_OK;
}

ovoid_status ov_patches_mend(ovoid_context *context, ov_parts *parts, double reach,
                             const ov_spot *spots, size_t count, ov_box **touched,
                             size_t *touched_count, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    const double length = 1.0 / sqrt(2.0 * parts->options->decay);
    patches all = {.parts = parts,
                   .cut = {.near = 2.0 * parts->partition.near,
                           .image = parts->partition.image,
                           .images = parts->partition.images},
                   .reach = reach * length};
    OV_TRY(make_patches(context, spots, count, &all));
    for (uint32_t colour = 0; colour < all.cut.colours; ++colour) {
        const ov_shared_work work = {.kind = OVOID_TASK_MEND,
                                     .work = {.todo = all.todo, .task = task, .user = &all},
                                     .pack = pack,
                                     .unpack = unpack};
        for (size_t p = 0; p < all.cut.count; ++p)
            all.todo[p] = all.cut.part[p].colour == colour;
        OV_TRY(ov_ranks_work(context, parts->ranks, &all.cut, parts->jobs, &work));
        OV_TRY(replace(context, &all));
        count_work(&all, result);
    }
    OV_TRY(tell_touched(context, &all, touched, touched_count));
cleanup:
    patches_destroy(&all);
    return status;
}
