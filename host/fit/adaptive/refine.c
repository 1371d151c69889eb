#include "fit/adaptive/refine.h"

#include "fit/adaptive/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static ovoid_status make_room(ov_refiner *r, size_t count) {
    const size_t all = ov_followers_all(&r->followers, count);
    ovoid_status status = ov_grow(r->context, &r->quadrics, &r->quadrics_capacity, all,
                                  sizeof *r->quadrics, "ellipsoids");
    if (status != OVOID_OK || count <= r->capacity)
        return status;
    free(r->trial);
    free(r->step);
    r->trial = ov_alloc(r->context, count * OV_FACTOR_PARAMETERS, sizeof *r->trial, "parameters");
    r->step = ov_alloc(r->context, count * OV_FACTOR_PARAMETERS, sizeof *r->step, "parameters");
    r->capacity = r->trial && r->step ? count : 0;
    return r->capacity ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static double motion(const ov_listing *l, const double *x, size_t i) {
    return ov_factor_motion(l->listed + i * OV_FACTOR_PARAMETERS, x + i * OV_FACTOR_PARAMETERS,
                            ov_tuned.refine_cutoff);
}

static bool is_of(const ov_listing *l, const ov_points *points, size_t count) {
    return l->listed_points == points && l->listed_count == count;
}

static bool lists_cover(const ov_listing *l, const ov_points *points, const double *x,
                        size_t count) {
    if (!is_of(l, points, count))
        return false;
    for (size_t i = 0; i < count; ++i)
        if (motion(l, x, i) > l->skins[i])
            return false;
    return true;
}

/* Those that moved much since the last lists get much room, so that few of them do not make all
 * lists be built again. */
static void choose_skins(const ov_listing *last, const ov_points *points, const double *x,
                         size_t count, float *skins) {
    const bool known = is_of(last, points, count);
    for (size_t i = 0; i < count; ++i)
        skins[i] = known ? (float)fmin(fmax(ov_tuned.refine_skin_growth * motion(last, x, i),
                                            ov_tuned.refine_skin_min),
                                       ov_tuned.refine_skin_max)
                         : (float)ov_tuned.refine_skin;
}

static ovoid_status set_terms(ov_refiner *r, ov_evaluation *e, const ov_points *points,
                              const double *x, size_t count) {
    for (size_t i = 0; i < count; ++i)
        ov_factor_quadric(x + i * OV_FACTOR_PARAMETERS, &r->quadrics[i]);
    ov_followers_place(&r->followers, count, r->quadrics, r->listing[e->listing].skins);
    return ov_terms_set_skins(r->context, &e->terms, r->quadrics, r->listing[e->listing].skins,
                              ov_followers_all(&r->followers, count), points->origin,
                              ov_tuned.refine_cutoff);
}

/* Room for what the lists will be built for. */
static ovoid_status begin_listing(ov_refiner *r, size_t place, const ov_points *points,
                                  const double *x, size_t count) {
    ovoid_status status = OVOID_OK;
    ov_listing *const l = &r->listing[place];
    const size_t size = count * OV_FACTOR_PARAMETERS;
    OV_TRY(ov_grow(r->context, &l->skins, &l->skins_capacity,
                   ov_followers_all(&r->followers, count), sizeof *l->skins, "skins"));
    choose_skins(&r->listing[r->now.listing], points, x, count, l->skins);
    l->listed_count = 0; /* until the lists are whole again */
    OV_TRY(ov_grow(r->context, &l->listed, &l->listed_capacity, size, sizeof *x, "parameters"));
    memcpy(l->listed, x, size * sizeof *x);
    l->listed_points = points;
cleanup:
    return status;
}

/* Sets the terms, and begins to build lists if none cover them: *begun. */
static ovoid_status place(ov_refiner *r, ov_evaluation *e, const ov_points *points, const double *x,
                          size_t count, bool *begun) {
    ovoid_status status = OVOID_OK;
    const size_t accepted = r->now.listing;
    bool covered = false;
    for (size_t k = 0; k < 2 && !covered; ++k) {
        e->listing = k == 0 ? accepted : 1 - accepted;
        covered = lists_cover(&r->listing[e->listing], points, x, count);
    }
    if (!covered && e == &r->now)
        e->listing = accepted;
    if (!covered)
        OV_TRY(begin_listing(r, e->listing, points, x, count));
    OV_TRY(set_terms(r, e, points, x, count));
    if (covered)
        return OVOID_OK;
    ov_listing *const l = &r->listing[e->listing];
    *begun = ov_lists_built(&l->lists);
    OV_TRY(*begun ? ov_lists_begin(r->context, &l->lists, points, &e->terms, 0.0)
                  : ov_lists_build(r->context, &l->lists, points, &e->terms, 0.0));
    ++r->list_builds;
    if (!*begun)
        l->listed_count = count;
cleanup:
    return status;
}

/* Sums that the kernel leaves. */
static size_t sums_of(const ov_points *points) {
    return (points->packs + OV_MISFIT_PACKS - 1) / OV_MISFIT_PACKS;
}

static ovoid_status launch_misfit(ov_refiner *r, ov_evaluation *e, const ov_target *target) {
    ovoid_status status = OVOID_OK;
    const cl_uint packs = (cl_uint)target->points->packs;
    const size_t bytes = packs * (size_t)OV_PACK * sizeof(cl_float);
    const size_t sums = sums_of(target->points);
    ov_device *device;
    OV_TRY(ov_device_get(r->context, &device));
    if (!r->misfit.handle)
        OV_TRY(ov_kernel_create(r->context, "misfit", "misfit", &r->misfit));
    OV_TRY(ov_buffer_reserve(r->context, &e->u, bytes, "residuals"));
    OV_TRY(ov_buffer_reserve(r->context, &e->active, bytes, "weights"));
    OV_TRY(ov_buffer_reserve(r->context, &e->sums, sums * sizeof(cl_float), "sums of packs"));
    const size_t group = ov_item_group(device);
    OV_TRY(OV_LAUNCH(r->context, &r->misfit, sums * group, group, OV_ARG(packs),
                     OV_ARG(e->value.memory), OV_ARG(target->low.memory),
                     OV_ARG(target->high.memory), OV_ARG(target->weight.memory),
                     OV_ARG(e->u.memory), OV_ARG(e->active.memory), OV_ARG(e->sums.memory)));
cleanup:
    return status;
}

/* Sums up the misfit with the lists as they are. */
static ovoid_status launch_sums(ov_refiner *r, ov_evaluation *e, const ov_target *target) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_field(r->context, &r->operations, target->points, &e->terms,
                    &r->listing[e->listing].lists, &e->value));
    OV_TRY(launch_misfit(r, e, target));
cleanup:
    return status;
}

/* later: without waiting for it. */
static ovoid_status read_sums(ov_refiner *r, const ov_evaluation *e, const ov_target *target,
                              bool later) {
    ovoid_status status = OVOID_OK;
    const size_t sums = sums_of(target->points), bytes = sums * sizeof *r->host;
    OV_TRY(
        ov_grow(r->context, &r->host, &r->host_capacity, sums, sizeof *r->host, "sums of packs"));
    OV_TRY(later ? ov_buffer_read_later(r->context, &e->sums, 0, r->host, bytes, &r->sums)
                 : ov_buffer_read(r->context, &e->sums, 0, r->host, bytes));
cleanup:
    return status;
}

static ovoid_status end_sums(ov_refiner *r, const ov_target *target, double *misfit) {
    const size_t sums = sums_of(target->points);
    const ovoid_status status = ov_later_end(r->context, &r->sums);
    *misfit = 0.0;
    for (size_t k = 0; k < sums && status == OVOID_OK; ++k)
        *misfit += r->host[k];
    return status;
}

/* Begins to evaluate, what read_sums() reads; *begun: with lists that may turn out to have had no
 * room. end_evaluation() is to follow, after failures too. */
static ovoid_status begin_evaluation(ov_refiner *r, ov_evaluation *e, const ov_target *target,
                                     const double *x, size_t count, bool *begun) {
    ovoid_status status = OVOID_OK;
    *begun = false;
    OV_TRY(make_room(r, count));
    OV_TRY(place(r, e, target->points, x, count, begun));
    OV_TRY(launch_sums(r, e, target));
cleanup:
    return status;
}

/* *whole: what was begun had room; otherwise it has been done again, and what was launched since is
 * worth nothing. */
static ovoid_status end_evaluation(ov_refiner *r, ov_evaluation *e, const ov_target *target,
                                   size_t count, bool begun, bool *whole, double *misfit) {
    ovoid_status status = OVOID_OK;
    ov_listing *const l = &r->listing[e->listing];
    *whole = true;
    OV_TRY(end_sums(r, target, misfit));
    if (begun)
        OV_TRY(ov_lists_end(r->context, &l->lists, whole));
    if (!*whole) { /* there were more pairs than ever before */
        OV_TRY(ov_lists_build(r->context, &l->lists, target->points, &e->terms, 0.0));
        OV_TRY(launch_sums(r, e, target));
        OV_TRY(read_sums(r, e, target, false));
        OV_TRY(end_sums(r, target, misfit));
    }
    if (begun)
        l->listed_count = count;
    ++r->evaluations;
cleanup:
    return status;
}

/* Waits for what is under way, which writes to the refiner's memory. */
static void abandon(ov_refiner *r) {
    ov_later_end(r->context, &r->sums);
    for (size_t k = 0; k < 2; ++k)
        ov_later_end(r->context, &r->listing[k].lists.later);
}

static ovoid_status evaluate(ov_refiner *r, ov_evaluation *e, const ov_target *target,
                             const double *x, size_t count, double *misfit) {
    ovoid_status status = OVOID_OK;
    bool begun, whole;
    OV_TRY(begin_evaluation(r, e, target, x, count, &begun));
    OV_TRY(read_sums(r, e, target, false));
    OV_TRY(end_evaluation(r, e, target, count, begun, &whole, misfit));
cleanup:
    if (status != OVOID_OK)
        abandon(r);
    return status;
}

ovoid_status ov_refine_evaluate(ov_refiner *r, const ov_target *target, const double *x,
                                size_t count, double *misfit) {
    return evaluate(r, &r->now, target, x, count, misfit);
}

/* No axis of `to` becomes longer than width_max, nor than the longest of `from` where that is
 * longer already, as in models of a few for a large molecule. */
static void bound_axes(const double *from, double width_max, double *to) {
    static const int diagonal[3] = {OV_FACTOR_L, OV_FACTOR_L + 3, OV_FACTOR_L + 5};
    const double least = fmin(1.0 / (width_max * width_max), ov_factor_least_decay(from));
    for (int k = 0; k < 3; ++k) /* L away from singular */
        if (fabs(to[diagonal[k]]) < sqrt(least))
            to[diagonal[k]] = copysign(sqrt(least), to[diagonal[k]]);
    ov_factor_bound_decay(to, least);
}

/* The step shortened ellipsoid by ellipsoid, and axes bounded. */
static void take_step(const double *x, const double *step, size_t count, double width_max,
                      double *trial) {
    for (size_t i = 0; i < count; ++i) {
        const double *const from = x + i * OV_FACTOR_PARAMETERS;
        const double *const by = step + i * OV_FACTOR_PARAMETERS;
        double *const to = trial + i * OV_FACTOR_PARAMETERS;
        double centre = 0.0, factor = 0.0, size = 0.0;
        for (int k = 0; k < 3; ++k)
            centre += by[OV_FACTOR_CENTRE + k] * by[OV_FACTOR_CENTRE + k];
        for (int k = OV_FACTOR_L; k < OV_FACTOR_PARAMETERS; ++k) {
            factor += by[k] * by[k];
            size += from[k] * from[k];
        }
        const double share = fmax(
            fmax(sqrt(centre) / ov_tuned.refine_centre, fabs(by[0]) / ov_tuned.refine_amplitude),
            sqrt(factor / size) / ov_tuned.refine_factor);
        const double scale = share > 1.0 ? 1.0 / share : 1.0;
        for (int k = 0; k < OV_FACTOR_PARAMETERS; ++k)
            to[k] = from[k] + scale * by[k];
        if (!ov_factor_decays_reach(to, 1.0 / (width_max * width_max)))
            bound_axes(from, width_max, to);
    }
}

static ovoid_status find_step(ov_refiner *r, const ov_target *target,
                              const ov_refine_options *options, const double *x, size_t count,
                              double damping, bool fresh) {
    ovoid_status status = OVOID_OK;
    const ov_system system = {.points = target->points,
                              .terms = &r->now.terms,
                              .lists = ov_refiner_lists(r),
                              .weight = &r->now.active,
                              .moments = &r->moments,
                              .gram = &r->gram,
                              .parameters = x,
                              .count = count,
                              .followers = &r->followers};
    if (fresh) {
        OV_TRY(ov_moments(r->context, &r->operations, target->points, &r->now.terms, system.lists,
                          &r->now.u, &r->moments));
        OV_TRY(ov_followers_fold(r->context, &r->followers, count, NULL, &r->moments));
        OV_TRY(ov_gram(r->context, &r->operations, target->points, &r->now.terms, system.lists,
                       &r->now.active, &r->gram));
    }
    OV_TRY(ov_solve(r->context, &r->solver, &r->operations, &system, damping, options->solver_steps,
                    options->solver_tolerance, r->step));
cleanup:
    return status;
}

/* The misfit where refining begins and the first step, in one round trip. */
static ovoid_status find_first(ov_refiner *r, const ov_target *target,
                               const ov_refine_options *options, const double *x, size_t count,
                               double *misfit) {
    ovoid_status status = OVOID_OK;
    bool begun, whole;
    OV_TRY(begin_evaluation(r, &r->now, target, x, count, &begun));
    OV_TRY(read_sums(r, &r->now, target, true));
    OV_TRY(find_step(r, target, options, x, count, options->damping, true));
    OV_TRY(end_evaluation(r, &r->now, target, count, begun, &whole, misfit));
    if (!whole)
        OV_TRY(find_step(r, target, options, x, count, options->damping, true));
cleanup:
    if (status != OVOID_OK)
        abandon(r);
    return status;
}

ovoid_status ov_refine(ov_refiner *r, const ov_target *target, const ov_refine_options *options,
                       double *x, size_t count, double *misfit) {
    ovoid_status status = OVOID_OK;
    const size_t bytes = count * OV_FACTOR_PARAMETERS * sizeof *x;
    double damping = options->damping, tried;
    unsigned small = 0;
    bool fresh = true, failed = false; /* the last step */
    if (options->steps == 0)
        return ov_refine_evaluate(r, target, x, count, misfit);
    OV_TRY(find_first(r, target, options, x, count, misfit));
    for (uint32_t n = 1; n <= options->steps && small < 2 && damping < ov_tuned.refine_damping_max;
         ++n) {
        if (n > 1)
            OV_TRY(find_step(r, target, options, x, count, damping, fresh));
        take_step(x, r->step, count, options->width_max, r->trial);
        status = evaluate(r, &r->tried, target, r->trial, count, &tried);
        if (status == OVOID_ERROR_NUMERIC) { /* too far out to be a model: as good as rejected */
            status = OVOID_OK;
            tried = INFINITY;
        }
        OV_TRY(status);
        ++r->steps;
        fresh = tried < *misfit;
        if (fresh) {
            small = *misfit - tried < options->decrease * *misfit ? small + 1 : 0;
            const ov_evaluation swap = r->now;
            r->now = r->tried;
            r->tried = swap;
            memcpy(x, r->trial, bytes);
            *misfit = tried;
            if (!failed)
                damping = fmax(ov_tuned.refine_damping_down * damping, ov_tuned.refine_damping_min);
        } else {
            damping *= ov_tuned.refine_damping_up;
        }
        failed = !fresh;
        if (options->go_on && !options->go_on(n, *misfit, options->user)) {
            status = ov_fail(r->context, OVOID_ERROR_CANCELLED, "stopped while refining");
            goto cleanup;
        }
        if (fresh && options->enough && options->enough(x, count, options->where))
            break;
    }
cleanup:
    return status;
}

void ov_refiner_forget(ov_refiner *r) {
    for (size_t k = 0; k < 2; ++k) {
        r->listing[k].listed_points = NULL;
        r->listing[k].listed_count = 0;
    }
}

void ov_refiner_begin(ov_refiner *r) {
    ov_refiner_forget(r);
    r->now.listing = r->tried.listing = 0;
    for (size_t k = 0; k < 2; ++k)
        ov_lists_forget(&r->listing[k].lists);
    r->solver.last = 0;
}

static void destroy_evaluation(ov_evaluation *e) {
    ov_terms_destroy(&e->terms);
    ov_buffer_destroy(&e->value);
    ov_buffer_destroy(&e->u);
    ov_buffer_destroy(&e->active);
    ov_buffer_destroy(&e->sums);
}

static void destroy_listing(ov_listing *l) {
    ov_lists_destroy(&l->lists);
    free(l->listed);
    free(l->skins);
}

void ov_refiner_destroy(ov_refiner *r) {
    destroy_evaluation(&r->now);
    destroy_evaluation(&r->tried);
    destroy_listing(&r->listing[0]);
    destroy_listing(&r->listing[1]);
    ov_operations_destroy(&r->operations);
    ov_solver_destroy(&r->solver);
    ov_followers_destroy(&r->followers);
    ov_kernel_destroy(&r->misfit);
    ov_buffer_destroy(&r->moments);
    ov_buffer_destroy(&r->gram);
    free(r->quadrics);
    free(r->trial);
    free(r->step);
    free(r->host);
    memset(r, 0, sizeof *r);
}
