#include "fit/l1.h"

#include "fit/chain.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A term counts where its value is at least this; the sum of what is left out stays near 1e-4. */
#define CUTOFF 1e-5
/* How far (angstrom) a cut-off ellipsoid may move before the lists are rebuilt: widened when
 * rebuilds come more often than every SKIN_FEW evaluations, narrowed when more rarely than every
 * SKIN_MANY. */
#define SKIN_FIRST 0.25
#define SKIN_MIN 0.1
#define SKIN_MAX 1.5
#define SKIN_FEW 25
#define SKIN_MANY 150
/* The largest change of a parameter (angstrom, radian, ...) that a line search tries first, and the
 * one it starts from when it has no accepted step to go by. */
#define FIRST_CHANGE_MAX 0.2
#define FIRST_CHANGE 0.01

/* What an evaluation of the model at the points gives. */
typedef struct evaluation {
    double accuracy;  /* E_s */
    double max_error; /* max_k |phi~ - phi| */
} evaluation;

typedef struct weights {
    double accuracy, sparse; /* w_s, w_l */
} weights;

typedef struct fit {
    ovoid_context *context;
    const ovoid_fit_options *options;
    const ov_samples *samples;
    size_t count;            /* ellipsoids */
    double *x;               /* accepted parameters, OV_L1_PARAMETERS per ellipsoid */
    double *trial;           /* between searches: the parameters before the last accepted step */
    double *gradient;        /* at x */
    double *gradient_before; /* at trial, between searches */
    bool comparable;         /* both gradients are of E_s alone, for the same ellipsoids */
    double *listed;          /* parameters that the lists were built for */
    size_t listed_count;
    double skin;        /* of the lists, angstrom */
    uint64_t listed_at; /* evaluations done when they were built */
    ov_quadric *quadrics;
    float *moments; /* as read back */
    float *sums;    /* as read back */
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
    ov_buffer value, residual, pack_sums, moment_sums;
    double step; /* last accepted tau, 0 before the first */
    ovoid_fit_profile profile;
} fit;

/* ---- evaluation --------------------------------------------------------------------------- */

/* Half-lengths of the cut-off ellipsoid along its axes, zero where it reaches nothing. */
static void half_lengths(const double *p, double half[3]) {
    const double q = 2.0 * log(fmax(fabs(p[OV_L1_C]), 1e-15)) - log(CUTOFF);
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

static bool lists_cover(const fit *f, const double *x) {
    if (f->listed_count != f->count)
        return false;
    for (size_t i = 0; i < f->count; ++i)
        if (outward_motion(f->listed + i * OV_L1_PARAMETERS, x + i * OV_L1_PARAMETERS) > f->skin)
            return false;
    return true;
}

/* By counts alone, not by the clock, so that two runs do the same. A pruned model does not tell. */
static void adapt_skin(fit *f) {
    const uint64_t passes = f->profile.field_passes - f->listed_at;
    if (f->listed_count == f->count && passes < SKIN_FEW)
        f->skin = fmin(1.5 * f->skin, SKIN_MAX);
    else if (f->listed_count == f->count && passes > SKIN_MANY)
        f->skin = fmax(f->skin / 1.5, SKIN_MIN);
    f->listed_at = f->profile.field_passes;
}

static ovoid_status refresh_lists(fit *f, const double *x) {
    if (lists_cover(f, x))
        return OVOID_OK;
    const double start = ov_seconds();
    adapt_skin(f);
    const ovoid_status status =
        ov_lists_build(f->context, &f->lists, &f->samples->points, &f->terms, f->skin);
    memcpy(f->listed, x, f->count * OV_L1_PARAMETERS * sizeof *x);
    f->listed_count = f->count;
    f->profile.lists_seconds += ov_seconds() - start;
    ++f->profile.list_builds;
    return status;
}

/* phi~ and the residual at all points, for the parameters x. The residual stays on the device. */
static ovoid_status evaluate(fit *f, const double *x, evaluation *result) {
    ovoid_status status = OVOID_OK;
    const ov_points *const points = &f->samples->points;
    const double start = ov_seconds();
    for (size_t i = 0; i < f->count; ++i)
        ov_l1_quadric(x + i * OV_L1_PARAMETERS, &f->quadrics[i]);
    OV_TRY(ov_terms_set(f->context, &f->terms, f->quadrics, f->count, points->origin, CUTOFF));
    f->profile.host_seconds += ov_seconds() - start;
    OV_TRY(refresh_lists(f, x));

    const double launched = ov_seconds();
    OV_TRY(ov_field(f->context, &f->operations, points, &f->terms, &f->lists, &f->value));
    OV_TRY(ov_residual(f->context, &f->operations, points, &f->value, &f->samples->value,
                       &f->residual, &f->pack_sums));
    OV_TRY(
        ov_buffer_read(f->context, &f->pack_sums, 0, f->sums, points->packs * 2 * sizeof *f->sums));
    *result = (evaluation){0};
    for (size_t pack = 0; pack < points->packs; ++pack) {
        result->accuracy += f->sums[2 * pack];
        result->max_error = fmax(result->max_error, f->sums[2 * pack + 1]);
    }
    f->profile.field_seconds += ov_seconds() - launched;
    ++f->profile.field_passes;
    if (!isfinite(result->accuracy))
        status = ov_fail(f->context, OVOID_ERROR_NUMERIC, "the fitted field is not finite");
cleanup:
    return status;
}

/* E_l1 = sum |c| + |d_1| + |d_2| + |d_3| (eq. 3.3, on the substituted variables). */
static double sparse_term(const double *x, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; ++i)
        for (size_t j = 0; j < OV_L1_CENTRE; ++j)
            sum += fabs(x[i * OV_L1_PARAMETERS + j]);
    return sum;
}

/* Gradient of w_s E_s + w_l E_l1 at the parameters evaluated last; |x|' is taken as 0 at 0. */
static ovoid_status compute_gradient(fit *f, weights w) {
    ovoid_status status = OVOID_OK;
    const double start = ov_seconds();
    double *const swap = f->gradient;
    f->gradient = f->gradient_before;
    f->gradient_before = swap;
    OV_TRY(ov_moments(f->context, &f->operations, &f->samples->points, &f->terms, &f->lists,
                      &f->residual, &f->moment_sums));
    OV_TRY(ov_buffer_read(f->context, &f->moment_sums, 0, f->moments,
                          f->count * 2 * OV_MONOMIALS * sizeof *f->moments));
    const double read = ov_seconds();
    f->profile.moments_seconds += read - start;
    ++f->profile.moments_passes;
    for (size_t i = 0; i < f->count; ++i) {
        const double *const p = f->x + i * OV_L1_PARAMETERS;
        double *const g = f->gradient + i * OV_L1_PARAMETERS;
        double sums[OV_MONOMIALS];
        for (size_t m = 0; m < OV_MONOMIALS; ++m) {
            const float *const pair = f->moments + (i * OV_MONOMIALS + m) * 2;
            sums[m] = 2.0 * w.accuracy * ((double)pair[0] + pair[1]);
        }
        ov_l1_chain(p, sums, g);
        for (size_t j = 0; j < OV_L1_CENTRE; ++j)
            g[j] += w.sparse * ((p[j] > 0.0) - (p[j] < 0.0));
    }
    f->profile.host_seconds += ov_seconds() - read;
cleanup:
    return status;
}

/* ---- the steps of Algorithm 1 ------------------------------------------------------------- */

/* Step 5.1. Keeps at least one ellipsoid, the largest. */
static bool prune(fit *f) {
    size_t largest = 0, kept = 0;
    for (size_t i = 1; i < f->count; ++i)
        if (fabs(f->x[i * OV_L1_PARAMETERS]) > fabs(f->x[largest * OV_L1_PARAMETERS]))
            largest = i;
    for (size_t i = 0; i < f->count; ++i) {
        const double *const p = f->x + i * OV_L1_PARAMETERS;
        if (i != largest && fabs(p[OV_L1_C]) < f->options->l1.prune_below)
            continue;
        if (kept != i)
            memcpy(f->x + kept * OV_L1_PARAMETERS, p, OV_L1_PARAMETERS * sizeof *p);
        ++kept;
    }
    const bool changed = kept != f->count;
    f->count = kept;
    return changed;
}

/* Steps 5.4 to 5.6. */
static weights choose_weights(const ovoid_l1_options *l1, evaluation now, double sparse,
                              bool accuracy_phase) {
    if (accuracy_phase || now.max_error > l1->max_error)
        return (weights){.accuracy = 1.0, .sparse = 0.0};
    const double total = now.accuracy + sparse;
    return (weights){.accuracy = fmax(now.accuracy / total, l1->epsilon), .sparse = sparse / total};
}

/* Short Barzilai-Borwein step (J. Barzilai, J. M. Borwein, IMA J. Numer. Anal. 8 (1988) 141, eq.
 * 5): the inverse curvature along the last step. 0 where there is none to go by. */
static double secant_step(const fit *f, size_t size) {
    double s_y = 0.0, y_y = 0.0;
    for (size_t j = 0; j < size; ++j) {
        const double s = f->x[j] - f->trial[j], y = f->gradient[j] - f->gradient_before[j];
        s_y += s * y;
        y_y += y * y;
    }
    return s_y > 0.0 ? s_y / y_y : 0.0;
}

/* The step that a search tries first. Between two iterations that minimise E_s alone the secant
 * step fits; otherwise the last accepted one, grown. */
static double first_step(const fit *f, size_t size, double largest) {
    double step = 0.0;
    if (f->comparable && f->options->l1.first_step == OVOID_FIRST_STEP_SECANT)
        step = secant_step(f, size);
    if (!(step > 0.0))
        step = f->step > 0.0 ? f->options->l1.grow * f->step : FIRST_CHANGE / largest;
    return fmin(step, FIRST_CHANGE_MAX / largest);
}

/* Steps 5.7 and 5.8: backtracking along -grad f until f falls by armijo * tau * |grad f|^2. On
 * success the trial becomes x and *now its evaluation; *tau is 0 where no step was found. */
static ovoid_status line_search(fit *f, weights w, evaluation *now, double *tau) {
    ovoid_status status = OVOID_OK;
    const ovoid_l1_options *const l1 = &f->options->l1;
    const size_t size = f->count * OV_L1_PARAMETERS;
    double square = 0.0, largest = 0.0;
    for (size_t j = 0; j < size; ++j) {
        square += f->gradient[j] * f->gradient[j];
        largest = fmax(largest, fabs(f->gradient[j]));
    }
    *tau = 0.0;
    if (!(largest > 0.0))
        return OVOID_OK;
    const double before = w.accuracy * now->accuracy + w.sparse * sparse_term(f->x, f->count);
    double step = first_step(f, size, largest);
    for (uint32_t k = 0; k < l1->max_backtracks; ++k, step *= l1->shrink) {
        for (size_t j = 0; j < size; ++j)
            f->trial[j] = f->x[j] - step * f->gradient[j];
        evaluation tried;
        OV_TRY(evaluate(f, f->trial, &tried));
        const double after =
            w.accuracy * tried.accuracy + w.sparse * sparse_term(f->trial, f->count);
        if (after <= before - l1->armijo * step * square) {
            double *const swap = f->x;
            f->x = f->trial;
            f->trial = swap;
            *now = tried;
            *tau = step;
            break;
        }
    }
    f->step = *tau;
cleanup:
    return status;
}

static bool report(const fit *f, uint64_t iteration, bool accuracy_phase, weights w, evaluation now,
                   double tau, double began) {
    if (!f->options->progress)
        return true;
    const double sparse = sparse_term(f->x, f->count);
    const ovoid_progress progress = {
        .stage = accuracy_phase ? "accuracy" : "sparse",
        .iteration = iteration,
        .iterations = f->options->l1.iterations,
        .ellipsoids = f->count,
        .points = f->samples->points.count,
        .accuracy_term = now.accuracy,
        .sparse_term = sparse,
        .accuracy_weight = w.accuracy,
        .sparse_weight = w.sparse,
        .objective = w.accuracy * now.accuracy + w.sparse * sparse,
        .max_error = now.max_error,
        .step = tau,
        .seconds = ov_seconds() - began,
    };
    return f->options->progress(&progress, f->options->user);
}

/* Algorithm 1, step 5. A phase ends early when two searches in a row, the second one with a fresh
 * first step, find no descent: nothing would change any more. */
static ovoid_status iterate(fit *f, double began, evaluation *now, uint64_t *iterations) {
    ovoid_status status = OVOID_OK;
    const ovoid_l1_options *const l1 = &f->options->l1;
    uint64_t sparse_end = l1->sparse_iterations;
    unsigned failures = 0;
    bool alone_before = false; /* the last accepted step went along the gradient of E_s alone */
    *iterations = 0;
    OV_TRY(evaluate(f, f->x, now));
    for (uint64_t n = 1; n <= l1->iterations; ++n) {
        double tau;
        const bool pruned = n % l1->prune_every == 0 && prune(f);
        if (pruned ||
            failures > 0) /* after a failure the device holds a rejected trial's residual */
            OV_TRY(evaluate(f, f->x, now));
        const bool accuracy_phase = n > sparse_end;
        const weights w = choose_weights(l1, *now, sparse_term(f->x, f->count), accuracy_phase);
        const bool alone = w.sparse == 0.0;
        OV_TRY(compute_gradient(f, w));
        f->comparable = alone && alone_before && !pruned;
        OV_TRY(line_search(f, w, now, &tau));
        *iterations = n;
        failures = tau > 0.0 ? 0 : failures + 1;
        alone_before = alone && tau > 0.0;
        if (!report(f, n, accuracy_phase, w, *now, tau, began)) {
            status = ov_fail(f->context, OVOID_ERROR_CANCELLED, "stopped at iteration %llu of %lu",
                             (unsigned long long)n, (unsigned long)l1->iterations);
            goto cleanup;
        }
        if (failures >= 2) {
            if (accuracy_phase)
                break;
            sparse_end = n;
            failures = 1;
        }
    }
cleanup:
    return status;
}

/* ---- set-up ------------------------------------------------------------------------------- */

/* Section 3.2.2: centres at the atoms, c = sqrt(exp(d r^2)), d_p = sqrt(d), angles zero, so that
 * phi~ = phi. (The paper prints d_p = 0.5; in the substituted variables phi~ = phi asks for the
 * root.) */
static void initialise(fit *f, const double *xyzr) {
    const double d = f->options->decay;
    for (size_t i = 0; i < f->count; ++i) {
        double *const p = f->x + i * OV_L1_PARAMETERS;
        const double *const atom = xyzr + 4 * i;
        p[OV_L1_C] = exp(0.5 * d * atom[3] * atom[3]);
        for (size_t k = 0; k < 3; ++k) {
            p[OV_L1_D + k] = sqrt(d);
            p[OV_L1_CENTRE + k] = atom[k];
            p[OV_L1_ANGLE + k] = 0.0;
        }
    }
}

static ovoid_status allocate(fit *f, size_t atoms) {
    const size_t size = atoms * OV_L1_PARAMETERS;
    double **const vectors[] = {&f->x, &f->trial, &f->gradient, &f->gradient_before, &f->listed};
    for (size_t k = 0; k < sizeof vectors / sizeof vectors[0]; ++k)
        if (!(*vectors[k] = ov_alloc(f->context, size, sizeof(double), "parameters")))
            return OVOID_ERROR_MEMORY;
    f->quadrics = ov_alloc(f->context, atoms, sizeof *f->quadrics, "ellipsoids");
    f->moments = ov_alloc(f->context, atoms * 2 * OV_MONOMIALS, sizeof *f->moments, "moments");
    f->sums = ov_alloc(f->context, f->samples->points.packs * 2, sizeof *f->sums, "pack sums");
    return f->quadrics && f->moments && f->sums ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static void destroy(fit *f) {
    free(f->x);
    free(f->trial);
    free(f->gradient);
    free(f->gradient_before);
    free(f->listed);
    free(f->quadrics);
    free(f->moments);
    free(f->sums);
    ov_terms_destroy(&f->terms);
    ov_lists_destroy(&f->lists);
    ov_operations_destroy(&f->operations);
    ov_buffer_destroy(&f->value);
    ov_buffer_destroy(&f->residual);
    ov_buffer_destroy(&f->pack_sums);
    ov_buffer_destroy(&f->moment_sums);
}

static ovoid_status hand_over(fit *f, ovoid_ellipsoid **ellipsoids) {
    ovoid_ellipsoid *const made = ov_alloc(f->context, f->count, sizeof *made, "ellipsoids");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < f->count; ++i)
        ov_l1_ellipsoid(f->x + i * OV_L1_PARAMETERS, &made[i]);
    *ellipsoids = made;
    return OVOID_OK;
}

ovoid_status ov_l1_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                       const ov_samples *samples, const ovoid_fit_options *options, double began,
                       ovoid_ellipsoid **ellipsoids, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    evaluation last;
    fit f = {.context = context,
             .options = options,
             .samples = samples,
             .count = atoms,
             .skin = SKIN_FIRST};
    OV_TRY(ov_device_get(context, &device));
    const uint64_t launches = device->launches;
    OV_TRY(allocate(&f, atoms));
    initialise(&f, xyzr);
    OV_TRY(iterate(&f, began, &last, &result->iterations));
    OV_TRY(hand_over(&f, ellipsoids));
    result->points = samples->points.count;
    result->ellipsoids = f.count;
    result->rms_error = sqrt(last.accuracy / (double)samples->points.count);
    result->max_error = last.max_error;
    result->profile = f.profile;
    result->profile.launches = device->launches - launches;
cleanup:
    destroy(&f);
    return status;
}
