#include "fit/parts/seams.h"

#include "base/progress.h"
#include "fit/adaptive/constants.h"
#include "fit/parts/patch.h"
#include "fit/parts/sharing.h"
#include "fit/parts/survey_bytes.h"

#include <math.h>
#include <stdlib.h>

/* What the work on seams goes on with. */
typedef struct job {
    ov_parts *parts;
    bool *todo;
    ov_survey_cell *cell;  /* of each part: what its last survey says, */
    ov_survey_cell *fresh; /* and the one at hand, until it is committed */
    ov_survey_total *total;
} job;

static ovoid_status survey_task(ovoid_context *context, size_t part, size_t done, void *user) {
    job *const j = user;
    (void)done;
    return ov_part_survey(context, j->parts, part, &j->fresh[part]);
}

static ovoid_status survey_commit(ovoid_context *context, size_t part, void *user) {
    job *const j = user;
    (void)context;
    ov_survey_cell_destroy(&j->cell[part]);
    j->cell[part] = j->fresh[part];
    j->fresh[part] = (ov_survey_cell){0};
    return OVOID_OK;
}

static ovoid_status survey_pack(ovoid_context *context, size_t part, ov_bytes *to, void *user) {
    const job *const j = user;
    return ov_survey_cell_put(context, &j->fresh[part], to);
}

static ovoid_status survey_unpack(ovoid_context *context, size_t part, ov_reading *from,
                                  void *user) {
    job *const j = user;
    return ov_survey_cell_take(context, from, &j->fresh[part]);
}

/* Surveys the cells of the parts in todo, and joins all. */
static ovoid_status survey(ovoid_context *context, job *j) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &j->parts->partition;
    const ov_shared_work work = {
        .kind = OVOID_TASK_JUDGE,
        .work = {.todo = j->todo, .task = survey_task, .commit = survey_commit, .user = j},
        .pack = survey_pack,
        .unpack = survey_unpack};
    const ov_survey_images images = {.image = cut->image,
                                     .count = cut->images,
                                     .spacing = j->parts->options->adaptive.mesh_spacing,
                                     .centre = j->parts->centre};
    ov_progress_stage(context, "measure");
    OV_TRY(ov_ranks_work(context, j->parts->ranks, cut, j->parts->jobs, &work));
    ov_survey_total_destroy(j->total);
    OV_TRY(ov_survey_join(context, j->cell, cut->count, &images, ov_tuned.spots_apart, j->total));
cleanup:
    return status;
}

/* Whether something may have changed in a cell with what is in the box, there or in an image. */
static bool is_touched(const ov_partition *cut, size_t p, const ov_box *touched) {
    for (size_t g = 0; g < cut->images; ++g) {
        const ov_box there = g > 0 ? ov_box_move(touched, &cut->image[g]) : *touched;
        if (ov_boxes_near(&cut->part[p].cell, &there, cut->near))
            return true;
    }
    return false;
}

/* Chooses the parts in whose cells something may have changed with what is in these boxes. */
static void choose_touched(job *j, const ov_box *touched, size_t count) {
    const ov_partition *const cut = &j->parts->partition;
    for (size_t p = 0; p < cut->count; ++p) {
        j->todo[p] = false;
        for (size_t n = 0; n < count && !j->todo[p]; ++n)
            j->todo[p] = is_touched(cut, p, &touched[n]);
    }
}

/* A model, and how far it is off. */
typedef struct mended {
    ov_found model;
    size_t spots;
    double deviation;
} mended;

/* Copies the model as it is, with what the last survey says of it. */
static ovoid_status keep(ovoid_context *context, const job *j, mended *kept) {
    const ov_found *const model = &j->parts->model;
    mended made = {.model = *model, .spots = j->total->spots, .deviation = j->total->deviation};
    made.model.quadrics =
        ov_copy(context, model->quadrics, model->count, sizeof *model->quadrics, "ellipsoids");
    made.model.owner =
        ov_copy(context, model->owner, j->parts->atoms, sizeof *model->owner, "owners");
    if (!made.model.quadrics || !made.model.owner) {
        ov_found_destroy(&made.model);
        return OVOID_ERROR_MEMORY;
    }
    ov_found_destroy(&kept->model);
    *kept = made;
    return OVOID_OK;
}

/* Whether the last survey says better things. Of so many ellipsoids what is furthest off counts. */
static bool is_better(const job *j, const mended *before) {
    const ov_survey_total *const now = j->total;
    if (j->parts->ellipsoids)
        return now->deviation < before->deviation;
    return now->spots < before->spots ||
           (now->spots == before->spots && now->deviation < before->deviation);
}

/* Fits patches about what is off, and surveys what that touched, if it did anything. Where so many
 * ellipsoids did not help, others may have one to spare: patches become larger from round to round.
 */
static ovoid_status mend(ovoid_context *context, job *j, uint32_t round, ovoid_fit_result *result,
                         bool *changed) {
    ovoid_status status = OVOID_OK;
    ov_box *touched = NULL;
    size_t count = 0;
    const double wider = j->parts->ellipsoids ? pow(ov_tuned.patch_wider, round) : 1.0;
    OV_TRY(ov_patches_mend(context, j->parts, wider * ov_tuned.patch_reach, j->total->spot,
                           j->total->spots, &touched, &count, result));
    *changed = count > 0;
    choose_touched(j, touched, count);
    if (*changed)
        OV_TRY(survey(context, j));
cleanup:
    free(touched);
    return status;
}

static void choose_all(job *j) {
    for (size_t p = 0; p < j->parts->partition.count; ++p)
        j->todo[p] = true;
}

/* Takes back what was kept, to be surveyed unless all that matters of that is known. */
static ovoid_status go_back(ovoid_context *context, job *j, mended *kept, bool surveyed) {
    ov_found_destroy(&j->parts->model);
    j->parts->model = kept->model;
    kept->model = (ov_found){0};
    choose_all(j);
    return surveyed ? survey(context, j) : OVOID_OK;
}

/* A part is held to the surface among what lies about it. Cavities of the model that open through a
 * neck in another part are seen by a look at all of them, and are mended then; so are seams where
 * images of one part meet. The best that any round ended with is what comes out. */
static ovoid_status mend_all(ovoid_context *context, job *j, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    mended best = {0};
    const bool by_number = j->parts->ellipsoids;
    const uint32_t rounds = by_number ? ov_tuned.patch_rounds : ov_tuned.part_mends;
    uint32_t n = 0, idle = 0;
    bool changed = true; /* by the last round */
    choose_all(j);
    OV_TRY(survey(context, j));
    for (; n < rounds && j->total->spots > 0; ++n) {
        if (n == 0 || is_better(j, &best)) {
            OV_TRY(keep(context, j, &best));
            idle = 0;
        } else if (by_number && changed) {
            OV_TRY(go_back(context, j, &best, true));
            OV_TRY(keep(context, j, &best));
        } else if (!by_number && ++idle == ov_tuned.part_mends_idle) {
            break;
        }
        OV_TRY(mend(context, j, n, result, &changed));
        if (!changed && !by_number) /* it would not the next time either */
            break;
    }
    const bool at_best = !changed && idle == 0; /* it is there as it was kept */
    if (n > 0 && !at_best && !is_better(j, &best)) {
        const double deviation = best.deviation;
        OV_TRY(go_back(context, j, &best, !by_number));
        j->total->deviation = deviation;
    }
cleanup:
    ov_found_destroy(&best.model);
    return status;
}

static void destroy(job *j) {
    for (size_t p = 0; p < j->parts->partition.count; ++p) {
        if (j->cell)
            ov_survey_cell_destroy(&j->cell[p]);
        if (j->fresh)
            ov_survey_cell_destroy(&j->fresh[p]);
    }
    free(j->cell);
    free(j->fresh);
    free(j->todo);
}

ovoid_status ov_seams_mend(ovoid_context *context, ov_parts *parts, ov_survey_total *total,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    const size_t count = parts->partition.count;
    job j = {.parts = parts, .total = total};
    j.todo = ov_alloc(context, count, sizeof *j.todo, "parts of a molecule");
    j.cell = ov_alloc(context, count, sizeof *j.cell, "parts of a molecule");
    j.fresh = ov_alloc(context, count, sizeof *j.fresh, "parts of a molecule");
    if (j.todo && j.cell && j.fresh)
        status = mend_all(context, &j, result);
    else
        status = OVOID_ERROR_MEMORY;
    destroy(&j);
    return status;
}
