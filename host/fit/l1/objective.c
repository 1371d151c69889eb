#include "fit/l1/objective.h"

#include "fit/l1/constants.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Half-lengths of the cut-off ellipsoid along its axes, zero where it reaches nothing. */
static void half_lengths(const double *p, double half[3]) {
    const double q = 2.0 * log(fmax(fabs(p[OV_L1_C]), 1e-15)) - log(ov_l1_tuned.cutoff);
    for (int k = 0; k < 3; ++k)
        half[k] = q > 0.0 ? sqrt(q / fmax(p[OV_L1_D + k] * p[OV_L1_D + k], OV_L1_DECAY_MIN)) : 0.0;
}

/* Bound on how far any point of the cut-off ellipsoid's hull has moved outward: the centre's way,
 * growth along the axes, and for a turn by an angle t the difference of the half-lengths times t.
 */
static double outward_motion(const double *from, const double *to) {
    double before[3], after[3];
    half_lengths(from, before);
    half_lengths(to, after);
    double way = 0.0, growth = 0.0, turn = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double step = to[OV_L1_CENTRE + k] - from[OV_L1_CENTRE + k];
        way += step * step;
        growth = fmax(growth, after[k] - before[k]);
        turn += fabs(to[OV_L1_ANGLE + k] - from[OV_L1_ANGLE + k]);
    }
    const double longest = fmax(before[0], fmax(before[1], before[2]));
    const double shortest = fmin(before[0], fmin(before[1], before[2]));
    return sqrt(way) + growth + turn * (longest - shortest);
}

static bool lists_cover(const ov_l1_objective *objective, const double *x, size_t count) {
    if (objective->listed_count != count)
        return false;
    for (size_t i = 0; i < count; ++i)
        if (outward_motion(objective->listed + i * OV_L1_PARAMETERS, x + i * OV_L1_PARAMETERS) >
            objective->skin)
            return false;
    return true;
}

/* By counts alone, not by the clock, so that two runs do the same. A pruned model does not tell. */
static void adapt_skin(ov_l1_objective *objective, size_t count) {
    const uint64_t passes = objective->profile.field_passes - objective->listed_at;
    if (objective->listed_count == count && passes < ov_l1_tuned.skin_few)
        objective->skin = fmin(ov_l1_tuned.skin_factor * objective->skin, ov_l1_tuned.skin_max);
    else if (objective->listed_count == count && passes > ov_l1_tuned.skin_many)
        objective->skin = fmax(objective->skin / ov_l1_tuned.skin_factor, ov_l1_tuned.skin_min);
    objective->listed_at = objective->profile.field_passes;
}

static ovoid_status refresh_lists(ov_l1_objective *objective, const double *x, size_t count) {
    if (lists_cover(objective, x, count))
        return OVOID_OK;
    const double start = ov_seconds();
    adapt_skin(objective, count);
    objective->listed_count = 0; /* until the lists are whole again */
    const ovoid_status status =
        ov_lists_build(objective->context, &objective->lists, &objective->samples->points,
                       &objective->terms, objective->skin);
    if (status != OVOID_OK)
        return status;
    memcpy(objective->listed, x, count * OV_L1_PARAMETERS * sizeof *x);
    objective->listed_count = count;
    objective->profile.lists_seconds += ov_seconds() - start;
    ++objective->profile.list_builds;
    return OVOID_OK;
}

ovoid_status ov_l1_evaluate(ov_l1_objective *objective, const double *x, size_t count,
                            ov_l1_evaluation *result) {
    ovoid_status status = OVOID_OK;
    const ov_points *const points = &objective->samples->points;
    const double start = ov_seconds();
    for (size_t i = 0; i < count; ++i)
        ov_l1_quadric(x + i * OV_L1_PARAMETERS, &objective->quadrics[i]);
    OV_TRY(ov_terms_set(objective->context, &objective->terms, objective->quadrics, count,
                        points->origin, ov_l1_tuned.cutoff));
    objective->profile.host_seconds += ov_seconds() - start;
    OV_TRY(refresh_lists(objective, x, count));

    const double launched = ov_seconds();
    OV_TRY(ov_field(objective->context, &objective->operations, points, &objective->terms,
                    &objective->lists, &objective->value));
    OV_TRY(ov_residual(objective->context, &objective->operations, points, &objective->value,
                       &objective->samples->value, objective->limit, &objective->residual,
                       &objective->pack_sums));
    OV_TRY(ov_buffer_read(objective->context, &objective->pack_sums, 0, objective->sums,
                          points->packs * 2 * sizeof *objective->sums));
    *result = (ov_l1_evaluation){0};
    for (size_t pack = 0; pack < points->packs; ++pack) {
        result->accuracy += objective->sums[2 * pack];
        result->max_error = fmax(result->max_error, objective->sums[2 * pack + 1]);
    }
    objective->profile.field_seconds += ov_seconds() - launched;
    ++objective->profile.field_passes;
    if (!isfinite(result->accuracy))
        status = ov_fail(objective->context, OVOID_ERROR_NUMERIC, "the fitted field is not finite");
cleanup:
    return status;
}

/* The parameters that E_l1 acts on, the first of each ellipsoid. */
static size_t penalised(const ov_l1_objective *objective) {
    return objective->kernel == OVOID_KERNEL_SPHERE ? OV_L1_D : OV_L1_CENTRE;
}

double ov_l1_sparse_term(const ov_l1_objective *objective, const double *x, size_t count) {
    const size_t parameters = penalised(objective);
    double sum = 0.0;
    for (size_t i = 0; i < count; ++i)
        for (size_t j = 0; j < parameters; ++j)
            sum += fabs(x[i * OV_L1_PARAMETERS + j]);
    return sum;
}

ovoid_status ov_l1_gradient(ov_l1_objective *objective, const double *x, size_t count,
                            ov_l1_weights w, double *gradient) {
    ovoid_status status = OVOID_OK;
    const size_t parameters = penalised(objective);
    const double start = ov_seconds();
    OV_TRY(ov_moments(objective->context, &objective->operations, &objective->samples->points,
                      &objective->terms, &objective->lists, &objective->residual,
                      &objective->moment_sums));
    OV_TRY(ov_buffer_read(objective->context, &objective->moment_sums, 0, objective->moments,
                          count * 2 * OV_MONOMIALS * sizeof *objective->moments));
    const double read = ov_seconds();
    objective->profile.moments_seconds += read - start;
    ++objective->profile.moments_passes;
    for (size_t i = 0; i < count; ++i) {
        const double *const p = x + i * OV_L1_PARAMETERS;
        double *const g = gradient + i * OV_L1_PARAMETERS;
        double sums[OV_MONOMIALS];
        for (size_t m = 0; m < OV_MONOMIALS; ++m) {
            const float *const pair = objective->moments + (i * OV_MONOMIALS + m) * 2;
            sums[m] = 2.0 * w.accuracy * ((double)pair[0] + pair[1]);
        }
        ov_l1_chain(p, sums, g);
        for (size_t j = 0; j < parameters; ++j)
            g[j] += w.sparse * ((p[j] > 0.0) - (p[j] < 0.0));
        for (size_t j = OV_L1_D; objective->kernel == OVOID_KERNEL_SPHERE && j < OV_L1_PARAMETERS;
             ++j)
            g[j] = 0.0;
    }
    objective->profile.host_seconds += ov_seconds() - read;
cleanup:
    return status;
}

ovoid_status ov_l1_objective_create(ovoid_context *context, const ov_samples *samples, double limit,
                                    ovoid_kernel kernel, size_t ellipsoids,
                                    ov_l1_objective *objective) {
    ov_l1_objective made = {.context = context,
                            .samples = samples,
                            .limit = limit,
                            .kernel = kernel,
                            .skin = ov_l1_tuned.skin_first};
    made.listed =
        ov_alloc(context, ellipsoids * OV_L1_PARAMETERS, sizeof *made.listed, "parameters");
    made.quadrics = ov_alloc(context, ellipsoids, sizeof *made.quadrics, "ellipsoids");
    made.moments =
        ov_alloc(context, ellipsoids * 2 * OV_MONOMIALS, sizeof *made.moments, "moments");
    made.sums = ov_alloc(context, samples->points.packs * 2, sizeof *made.sums, "pack sums");
    if (!made.listed || !made.quadrics || !made.moments || !made.sums) {
        ov_l1_objective_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    *objective = made;
    return OVOID_OK;
}

void ov_l1_objective_destroy(ov_l1_objective *objective) {
    free(objective->listed);
    free(objective->quadrics);
    free(objective->moments);
    free(objective->sums);
    ov_terms_destroy(&objective->terms);
    ov_lists_destroy(&objective->lists);
    ov_operations_destroy(&objective->operations);
    ov_buffer_destroy(&objective->value);
    ov_buffer_destroy(&objective->residual);
    ov_buffer_destroy(&objective->pack_sums);
    ov_buffer_destroy(&objective->moment_sums);
    memset(objective, 0, sizeof *objective);
}
