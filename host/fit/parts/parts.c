#include "fit/parts/parts.h"

#include "base/parallel.h"
#include "device/device.h"
#include "fit/adaptive/constants.h"
#include "fit/need.h"
#include "fit/parts/checkpoint.h"
#include "fit/parts/crew.h"
#include "fit/parts/record.h"
#include "fit/parts/seams.h"
#include "fit/parts/sharing.h"
#include "fit/parts/workers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t most_of(const ovoid_fit_options *options, size_t atoms) {
    if (options->parts.atoms > 0)
        return options->parts.atoms < atoms ? options->parts.atoms : atoms;
    return atoms > OVOID_DEFAULT_WHOLE_ATOMS ? OVOID_DEFAULT_PART_ATOMS : atoms;
}

bool ov_parts_wanted(const ovoid_fit_options *options, size_t atoms) {
    return most_of(options, atoms) < atoms || options->parts.checkpoint;
}

/* ---- how many of each ------------------------------------------------------------------------ */

static size_t total_wanted(const ov_parts *parts) {
    const ovoid_adaptive_options *const wanted = &parts->options->adaptive;
    if (wanted->goal == OVOID_GOAL_ELLIPSOIDS)
        return wanted->ellipsoids;
    return (size_t)fmax(1.0, round(wanted->ratio * (double)parts->atoms));
}

/* Shares out a number of ellipsoids by atoms: what part p and those before it are to have is what
 * their atoms' share of it rounds to. */
static ovoid_status share_out(ovoid_context *context, ov_parts *parts) {
    const size_t total = total_wanted(parts), count = parts->partition.count;
    size_t before = 0, given = 0;
    if (parts->options->adaptive.goal == OVOID_GOAL_TOLERANCE)
        return OVOID_OK;
    if (total < count)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%zu ellipsoids cannot stand for %zu parts, of which each takes at least "
                       "one; ask for more of them, or for larger parts (parts.atoms)",
                       total, count);
    parts->ellipsoids = ov_alloc(context, count, sizeof *parts->ellipsoids, "ellipsoids of parts");
    if (!parts->ellipsoids)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < count; ++p) {
        const size_t left = count - 1 - p;
        before += parts->partition.part[p].count;
        size_t upto = (size_t)round((double)total * ((double)before / (double)parts->atoms));
        upto = upto > given ? upto : given + 1;
        upto = upto + left <= total ? upto : total - left;
        parts->ellipsoids[p] = upto - given;
        given = upto;
    }
    return OVOID_OK;
}

/* ---- what came of it ------------------------------------------------------------------------- */

/* The ellipsoids of the parts one after the other, and the owners of all atoms. */
static ovoid_status put_together(ovoid_context *context, ov_parts *parts) {
    const ov_partition *const cut = &parts->partition;
    ov_found made = {0};
    size_t first = 0;
    for (size_t p = 0; p < cut->count; ++p)
        made.count += parts->fit[p].found.count;
    made.quadrics = ov_alloc(context, made.count, sizeof *made.quadrics, "ellipsoids");
    made.owner = ov_alloc(context, parts->atoms, sizeof *made.owner, "owners");
    if (!made.quadrics || !made.owner) {
        ov_found_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t p = 0; p < cut->count; ++p) {
        const ov_found *const own = &parts->fit[p].found;
        memcpy(made.quadrics + first, own->quadrics, own->count * sizeof *own->quadrics);
        for (size_t n = 0; n < cut->part[p].count; ++n)
            made.owner[cut->order[cut->part[p].first + n]] = (uint32_t)first + own->owner[n];
        first += own->count;
        ov_found_destroy(&parts->fit[p].found); /* it is in the whole now */
    }
    if (parts->options->adaptive.goal == OVOID_GOAL_TOLERANCE) {
        made.tolerance = parts->options->adaptive.tolerance;
        made.fewest = made.count;
    }
    parts->model = made;
    return OVOID_OK;
}

/* A part that takes no part in the surface is no failure. */
static bool is_worse(ovoid_verdict verdict, ovoid_verdict than) {
    return verdict != OVOID_VERDICT_NO_SURFACE &&
           (than == OVOID_VERDICT_NO_SURFACE || (int)verdict > (int)than);
}

static void add_result(const ovoid_fit_result *one, ovoid_fit_result *all) {
    all->spacing = one->spacing == one->spacing ? one->spacing : all->spacing;
    all->ellipsoids += one->ellipsoids;
    if (is_worse(one->verdict, all->verdict))
        all->verdict = one->verdict;
    if (one->points == OVOID_UNKNOWN)
        return; /* the atoms themselves: nothing was done */
    all->points += one->points;
    all->distance = one->distance > all->distance || all->distance != all->distance ? one->distance
                                                                                    : all->distance;
    ov_part_count_work(one, all);
}

/* Whether anything but the part itself is on the other side of a seam. */
static bool meet(const ov_parts *parts) {
    return parts->partition.count > 1 || parts->partition.images > 1;
}

static void add_results(const ov_parts *parts, ovoid_fit_result *result) {
    result->points = result->ellipsoids = result->iterations = 0;
    result->adaptive.solver_iterations = 0;
    result->distance = NAN;
    result->verdict = OVOID_VERDICT_NO_SURFACE;
    result->parts = parts->partition.count;
    result->units = 1;
    memset(result->counts, 0, sizeof result->counts);
    for (size_t p = 0; p < parts->partition.count; ++p)
        add_result(&parts->fit[p].result, result);
    if (parts->ellipsoids && result->verdict != OVOID_VERDICT_MISSED)
        result->verdict = OVOID_VERDICT_REACHED; /* so many were asked for */
    if (parts->ellipsoids && meet(parts))
        result->distance = NAN; /* each part's is not that of the whole */
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
}

/* What is off by that much where parts meet is mended: the tolerance or, of so many ellipsoids,
 * more than any part was brought to. */
static double least_of(const ov_parts *parts) {
    double most = -INFINITY;
    if (!parts->ellipsoids)
        return parts->options->adaptive.tolerance;
    for (size_t p = 0; p < parts->partition.count; ++p)
        most = fmax(most, parts->fit[p].result.distance); /* NAN where it was not measured */
    return most >= 0.0 ? most : INFINITY;
}

static bool is_mended(const ov_parts *parts) {
    const ovoid_adaptive_options *const wanted = &parts->options->adaptive;
    return !parts->ellipsoids ||
           (meet(parts) && wanted->effort > 0 && wanted->steps > 0 && parts->least < INFINITY);
}

/* What the last survey of all says takes the place of what each part said. */
static void take_survey(const ov_parts *parts, const ov_survey_total *total,
                        ovoid_fit_result *result) {
    const double tolerance = parts->options->adaptive.tolerance;
    if (total->outer[0] == 0 || total->outer[1] == 0 || result->verdict == OVOID_VERDICT_COARSE)
        return;
    result->distance = total->deviation;
    result->ellipsoids = parts->model.count;
    if (parts->ellipsoids)
        return;
    result->verdict = total->deviation <= tolerance ? OVOID_VERDICT_REACHED : OVOID_VERDICT_MISSED;
    result->reached = result->verdict == OVOID_VERDICT_REACHED;
}

/* ---- fitting --------------------------------------------------------------------------------- */

/* What the work on parts goes on with. */
typedef struct job {
    ov_parts *parts;
    bool *todo;
    ov_part_fit *fresh; /* of each part, until it is committed */
    ov_checkpoint file;
} job;

static ovoid_status fit_task(ovoid_context *context, size_t part, size_t done, void *user) {
    job *const j = user;
    return ov_part_fit_atoms(context, j->parts, part, done, &j->fresh[part]);
}

static ovoid_status fit_commit(ovoid_context *context, size_t part, void *user) {
    job *const j = user;
    if (j->file.file) {
        const ovoid_status status =
            ov_checkpoint_add(context, &j->file, j->parts, part, &j->fresh[part]);
        if (status != OVOID_OK)
            return status;
    }
    ov_found_destroy(&j->parts->fit[part].found);
    j->parts->fit[part] = j->fresh[part];
    j->fresh[part].found = (ov_found){0};
    return OVOID_OK;
}

static ovoid_status fit_pack(ovoid_context *context, size_t part, ov_bytes *to, void *user) {
    const job *const j = user;
    const ov_part_fit *const done = &j->parts->fit[part]; /* one of the checkpoint */
    return ov_record_put(context, part, j->parts->partition.part[part].count,
                         done->found.count > 0 ? done : &j->fresh[part], to);
}

static ovoid_status fit_unpack(ovoid_context *context, size_t part, ov_reading *from, void *user) {
    job *const j = user;
    return ov_record_take(context, part, j->parts->partition.part[part].count, from,
                          &j->fresh[part]);
}

static ovoid_status resumed_unpack(ovoid_context *context, size_t part, ov_reading *from,
                                   void *user) {
    job *const j = user;
    return ov_record_take(context, part, j->parts->partition.part[part].count, from,
                          &j->parts->fit[part]);
}

/* Rank 0 opens the checkpoint, and tells the others which parts are there. */
static ovoid_status resume(ovoid_context *context, job *j) {
    const ovoid_parts_options *const wanted = &j->parts->options->parts;
    const ov_shared_work work = {.work = {.user = j}, .pack = fit_pack, .unpack = resumed_unpack};
    ovoid_status status = OVOID_OK;
    if (!wanted->checkpoint)
        return OVOID_OK;
    if (ov_ranks_first(j->parts->ranks))
        status = ov_checkpoint_open(context, wanted->checkpoint, wanted->resume != 0, j->parts,
                                    j->todo, &j->file);
    return ov_ranks_give(context, j->parts->ranks, j->parts->partition.count, j->todo, &work,
                         status);
}

/* Each part from its atoms, in turn; those of the checkpoint are there. */
static ovoid_status fit_all(ovoid_context *context, job *j) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &j->parts->partition;
    const ov_shared_work work = {.kind = OVOID_TASK_FIT,
                                 .work = {.todo = j->todo,
                                          .in_turn = true,
                                          .task = fit_task,
                                          .commit = fit_commit,
                                          .user = j},
                                 .pack = fit_pack,
                                 .unpack = fit_unpack};
    OV_TRY(resume(context, j));
    for (size_t p = 0; p < cut->count; ++p)
        j->todo[p] = !j->todo[p]; /* what is not done */
    OV_TRY(ov_ranks_work(context, j->parts->ranks, cut, j->parts->jobs, &work));
cleanup:
    ov_checkpoint_close(&j->file);
    return status;
}

/* ---- the whole ------------------------------------------------------------------------------- */

static void destroy(ov_parts *parts, job *j) {
    for (size_t p = 0; p < parts->partition.count; ++p) {
        if (parts->fit)
            ov_found_destroy(&parts->fit[p].found);
        if (j->fresh)
            ov_found_destroy(&j->fresh[p].found);
    }
    free(parts->fit);
    ov_found_destroy(&parts->model);
    free(parts->ellipsoids);
    free(j->fresh);
    free(j->todo);
    ov_partition_destroy(&parts->partition);
}

/* So many parts at a time as are asked for or, by default, as pay and as there is memory for. */
static ovoid_status choose_jobs(ovoid_context *context, ov_parts *parts) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    ov_need need = {.atoms = parts->atoms, .jobs = parts->options->parts.jobs};
    OV_TRY(ov_device_get(context, &device));
    for (size_t p = 0; p < parts->partition.count; ++p)
        if (parts->partition.part[p].count > need.largest)
            need.largest = parts->partition.part[p].count;
    if (need.jobs == 0) {
        need.jobs = ov_device_company(device, ov_cores());
        while (need.jobs > 1 && !ov_need_fits(device, &need))
            --need.jobs;
    }
    OV_TRY(ov_need_check(context, &need));
    parts->jobs = need.jobs;
cleanup:
    return status;
}

static ovoid_status prepare(ovoid_context *context, ov_parts *parts, job *j) {
    ovoid_status status = OVOID_OK;
    const ovoid_fit_options *const options = parts->options;
    const double surface = ov_surface_reach(parts->xyzr, parts->atoms, options);
    const double length = 1.0 / sqrt(2.0 * options->decay);
    parts->margin = surface + ov_tuned.part_margin * length;
    parts->reach = parts->margin + surface + ov_tuned.part_reach * length;
    parts->partition.near = parts->reach + ov_tuned.part_near * length;
    OV_TRY(ov_partition_create(context, parts->xyzr, parts->atoms, most_of(options, parts->atoms),
                               &parts->partition));
    const size_t count = parts->partition.count;
    OV_TRY(choose_jobs(context, parts));
    OV_TRY(share_out(context, parts));
    parts->fit = ov_alloc(context, count, sizeof *parts->fit, "parts of a molecule");
    j->fresh = ov_alloc(context, count, sizeof *j->fresh, "parts of a molecule");
    j->todo = ov_alloc(context, count, sizeof *j->todo, "parts of a molecule");
    if (!parts->fit || !j->fresh || !j->todo)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

static void hand_over(ov_parts *parts, ov_found *found) {
    *found = parts->model;
    parts->model = (ov_found){0};
}

/* What held when it was stopped: the parts that are done, and the others' atoms. */
static void rescue(ovoid_context *context, ov_parts *parts, ov_found *found,
                   ovoid_fit_result *result) {
    size_t done = 0;
    if (parts->model.count > 0) { /* all were done, and were being mended */
        result->ellipsoids = parts->model.count;
        hand_over(parts, found);
        return;
    }
    for (size_t p = 0; p < parts->partition.count; ++p)
        done += parts->fit[p].found.count > 0;
    if (done == 0 || parts->options->adaptive.goal != OVOID_GOAL_TOLERANCE)
        return;
    for (size_t p = 0; p < parts->partition.count; ++p)
        if (parts->fit[p].found.count == 0 &&
            ov_part_take_atoms(context, parts, p, &parts->fit[p]) != OVOID_OK)
            return;
    add_results(parts, result);
    if (put_together(context, parts) == OVOID_OK)
        hand_over(parts, found);
}

ovoid_status ov_parts_reach(ovoid_context *context, const double *xyzr, size_t atoms,
                            const ov_images *images, const ovoid_fit_options *options, double began,
                            ov_ranks *ranks, ov_found *found, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ovoid_fit_options of_parts = *options; /* the points are as close as in the whole */
    double centre[3];
    ov_rigid_centre(images->motion, images->count, centre);
    ov_parts parts = {.xyzr = xyzr,
                      .atoms = atoms,
                      .options = &of_parts,
                      .ranks = ranks,
                      .centre = images->count > 1 ? centre : NULL,
                      .partition = {.image = images->motion, .images = images->count}};
    job j = {.parts = &parts};
    ov_survey_total total = {0};
    if (of_parts.spacing == 0.0)
        of_parts.spacing = ov_default_spacing(atoms, options->decay);
    OV_TRY(prepare(context, &parts, &j));
    OV_TRY(ov_crew_begin(context)); /* for all that follows */
    OV_TRY(ov_times_begin(context, ov_ranks_shared(ranks) ? ranks->exchange->ranks : 1));
    result->sample_seconds = ov_seconds() - began;
    OV_TRY(fit_all(context, &j));
    add_results(&parts, result);
    parts.least = least_of(&parts);
    OV_TRY(put_together(context, &parts));
    if (is_mended(&parts)) {
        OV_TRY(ov_seams_mend(context, &parts, &total, result));
        take_survey(&parts, &total, result);
    }
    hand_over(&parts, found);
cleanup:
    if (status == OVOID_ERROR_CANCELLED && parts.fit)
        rescue(context, &parts, found, result);
    ov_crew_end(context);
    ov_survey_total_destroy(&total);
    destroy(&parts, &j);
    return status;
}
