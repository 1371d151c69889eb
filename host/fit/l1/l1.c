#include "fit/l1/l1.h"

#include "base/progress.h"

#include "fit/l1/constants.h"
#include "fit/l1/objective.h"
#include "model/owner.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct fit {
    const ovoid_fit_options *options;
    ov_l1_objective objective;
    size_t count;            /* ellipsoids */
    uint32_t *atom;          /* of each, where it began */
    double *x;               /* accepted parameters, OV_L1_PARAMETERS per ellipsoid */
    double *trial;           /* between searches: the parameters before the last accepted step */
    double *gradient;        /* at x */
    double *gradient_before; /* at trial, between searches */
    bool comparable;         /* both gradients are of E_s alone, for the same ellipsoids */
    double step;             /* last accepted tau, 0 before the first */
    uint64_t iterations;     /* done */
    ov_l1_evaluation now;    /* at x, where `known` */
    bool known;
} fit;

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
        f->atom[kept] = f->atom[i];
        if (kept != i)
            memcpy(f->x + kept * OV_L1_PARAMETERS, p, OV_L1_PARAMETERS * sizeof *p);
        ++kept;
    }
    const bool changed = kept != f->count;
    f->count = kept;
    return changed;
}

/* Steps 5.4 to 5.6. */
static ov_l1_weights choose_weights(const ovoid_l1_options *l1, ov_l1_evaluation now, double sparse,
                                    bool accuracy_phase) {
    if (accuracy_phase || now.max_error > l1->max_error)
        return (ov_l1_weights){.accuracy = 1.0, .sparse = 0.0};
    const double total = now.accuracy + sparse;
    return (ov_l1_weights){.accuracy = fmax(now.accuracy / total, l1->epsilon),
                           .sparse = sparse / total};
}

/* The gradient at x; the one before it is kept for the secant step. */
static ovoid_status next_gradient(fit *f, ov_l1_weights w) {
    double *const swap = f->gradient;
    f->gradient = f->gradient_before;
    f->gradient_before = swap;
    return ov_l1_gradient(&f->objective, f->x, f->count, w, f->gradient);
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
        step = f->step > 0.0 ? f->options->l1.grow * f->step : ov_l1_tuned.change_first / largest;
    return fmin(step, ov_l1_tuned.change_max / largest);
}

/* A trial too far out to be a model, or to have a finite field, is as good as rejected. */
static ovoid_status evaluate_trial(fit *f, ov_l1_evaluation *tried) {
    const ovoid_status status = ov_l1_evaluate(&f->objective, f->trial, f->count, tried);
    if (status != OVOID_ERROR_NUMERIC)
        return status;
    *tried = (ov_l1_evaluation){.accuracy = INFINITY, .max_error = INFINITY};
    return OVOID_OK;
}

/* Steps 5.7 and 5.8: backtracking along -grad f until f falls by armijo * tau * |grad f|^2. On
 * success the trial becomes x and *now its evaluation; *tau is 0 where no step was found. */
static ovoid_status line_search(fit *f, ov_l1_weights w, ov_l1_evaluation *now, double *tau) {
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
    const double before =
        w.accuracy * now->accuracy + w.sparse * ov_l1_sparse_term(&f->objective, f->x, f->count);
    double step = first_step(f, size, largest);
    for (uint32_t k = 0; k < l1->max_backtracks; ++k, step *= l1->shrink) {
        for (size_t j = 0; j < size; ++j)
            f->trial[j] = f->x[j] - step * f->gradient[j];
        ov_l1_evaluation tried;
        OV_TRY(evaluate_trial(f, &tried));
        const double after = w.accuracy * tried.accuracy +
                             w.sparse * ov_l1_sparse_term(&f->objective, f->trial, f->count);
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

static bool report(const fit *f, uint64_t iteration, bool accuracy_phase, ov_l1_weights w,
                   ov_l1_evaluation now, double tau) {
    if (!f->objective.context->progress)
        return true; /* the sum below is worth sparing */
    const double sparse = ov_l1_sparse_term(&f->objective, f->x, f->count);
    const ovoid_progress progress = {
        .stage = accuracy_phase ? "accuracy" : "sparse",
        .iteration = iteration,
        .iterations = f->options->l1.iterations,
        .ellipsoids = f->count,
        .points = f->objective.samples->points.count,
        .l1 = {.accuracy_term = now.accuracy,
               .sparse_term = sparse,
               .accuracy_weight = w.accuracy,
               .sparse_weight = w.sparse,
               .objective = w.accuracy * now.accuracy + w.sparse * sparse,
               .max_error = now.max_error,
               .step = tau},
    };
    return ov_progress_report(f->objective.context, &progress);
}

static ovoid_status evaluate(fit *f) {
    f->known = false;
    const ovoid_status status = ov_l1_evaluate(&f->objective, f->x, f->count, &f->now);
    f->known = status == OVOID_OK;
    return status;
}

/* Algorithm 1, step 5. A phase ends early when two searches in a row, the second one with a fresh
 * first step, find no descent: nothing would change any more. */
static ovoid_status iterate(fit *f) {
    ovoid_status status = OVOID_OK;
    const ovoid_l1_options *const l1 = &f->options->l1;
    uint64_t sparse_end = l1->sparse_iterations;
    unsigned failures = 0;
    bool alone_before = false; /* the last accepted step went along the gradient of E_s alone */
    OV_TRY(evaluate(f));
    for (uint64_t n = 1; n <= l1->iterations; ++n) {
        double tau;
        const bool pruned = n % l1->prune_every == 0 && prune(f);
        if (pruned ||
            failures > 0) /* after a failure the device holds a rejected trial's residual */
            OV_TRY(evaluate(f));
        const bool accuracy_phase = n > sparse_end;
        const ov_l1_weights w = choose_weights(
            l1, f->now, ov_l1_sparse_term(&f->objective, f->x, f->count), accuracy_phase);
        const bool alone = w.sparse == 0.0;
        OV_TRY(next_gradient(f, w));
        f->comparable = alone && alone_before && !pruned;
        OV_TRY(line_search(f, w, &f->now, &tau));
        f->iterations = n;
        failures = tau > 0.0 ? 0 : failures + 1;
        alone_before = alone && tau > 0.0;
        if (!report(f, n, accuracy_phase, w, f->now, tau)) {
            status = ov_fail(f->objective.context, OVOID_ERROR_CANCELLED,
                             "stopped at iteration %llu of %lu", (unsigned long long)n,
                             (unsigned long)l1->iterations);
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

/* Section 3.2.2: centres at the atoms, c = sqrt(exp(d r^2)), d_p = sqrt(d), angles zero, so that
 * phi~ = phi. (The paper prints d_p = 0.5; in the substituted variables phi~ = phi asks for the
 * root.) */
static void initialise(fit *f, const double *xyzr) {
    const double d = f->options->decay;
    for (size_t i = 0; i < f->count; ++i) {
        double *const p = f->x + i * OV_L1_PARAMETERS;
        const double *const atom = xyzr + 4 * i;
        f->atom[i] = (uint32_t)i;
        p[OV_L1_C] = exp(0.5 * d * atom[3] * atom[3]);
        for (size_t k = 0; k < 3; ++k) {
            p[OV_L1_D + k] = sqrt(d);
            p[OV_L1_CENTRE + k] = atom[k];
            p[OV_L1_ANGLE + k] = 0.0;
        }
    }
}

static ovoid_status allocate(fit *f, ovoid_context *context, const ov_samples *samples) {
    const double limit = f->options->l1.inside_every ? f->options->isovalue + 1.0 : INFINITY;
    double **const vectors[] = {&f->x, &f->trial, &f->gradient, &f->gradient_before};
    for (size_t k = 0; k < sizeof vectors / sizeof vectors[0]; ++k)
        if (!(*vectors[k] =
                  ov_alloc(context, f->count * OV_L1_PARAMETERS, sizeof(double), "parameters")))
            return OVOID_ERROR_MEMORY;
    f->atom = ov_alloc(context, f->count, sizeof *f->atom, "atoms");
    if (!f->atom)
        return OVOID_ERROR_MEMORY;
    return ov_l1_objective_create(context, samples, limit, f->options->l1.kernel, f->count,
                                  &f->objective);
}

static void destroy(fit *f) {
    free(f->atom);
    free(f->x);
    free(f->trial);
    free(f->gradient);
    free(f->gradient_before);
    ov_l1_objective_destroy(&f->objective);
}

static ovoid_status hand_over(fit *f, ovoid_ellipsoid **ellipsoids) {
    ovoid_ellipsoid *const made =
        ov_alloc(f->objective.context, f->count, sizeof *made, "ellipsoids");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < f->count; ++i)
        ov_l1_ellipsoid(f->x + i * OV_L1_PARAMETERS, &made[i]);
    *ellipsoids = made;
    return OVOID_OK;
}

/* See l1.h. Atoms of deleted ellipsoids are compared with all that are left: a moment, beside
 * thousands of iterations. */
static ovoid_status find_owners(const fit *f, const double *xyzr, size_t atoms, uint32_t **owner) {
    ovoid_context *const context = f->objective.context;
    ov_quadric *const quadrics = ov_alloc(context, f->count, sizeof *quadrics, "ellipsoids");
    uint32_t *const found = ov_alloc(context, atoms, sizeof *found, "owners");
    if (!quadrics || !found) {
        free(quadrics);
        free(found);
        return OVOID_ERROR_MEMORY;
    }
    memset(found, 0xff, atoms * sizeof *found);
    for (size_t i = 0; i < f->count; ++i) {
        ov_l1_quadric(f->x + i * OV_L1_PARAMETERS, &quadrics[i]);
        found[f->atom[i]] = (uint32_t)i;
    }
    for (size_t i = 0; i < atoms; ++i)
        if (found[i] == UINT32_MAX)
            found[i] = ov_owner_at(quadrics, f->count, xyzr + 4 * i);
    free(quadrics);
    *owner = found;
    return OVOID_OK;
}

static void tell(const fit *f, ovoid_fit_result *result) {
    const double points = (double)f->objective.samples->points.count;
    result->points = f->objective.samples->points.count;
    result->ellipsoids = f->count;
    result->iterations = f->iterations;
    result->l1 = f->objective.profile;
    result->l1.rms_error = f->known ? sqrt(f->now.accuracy / points) : NAN;
    result->l1.max_error = f->known ? f->now.max_error : NAN;
}

ovoid_status ov_l1_fit(ovoid_context *context, const double *xyzr, size_t atoms,
                       const ov_samples *samples, const ovoid_fit_options *options,
                       ovoid_ellipsoid **ellipsoids, uint32_t **owner, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    uint64_t before[OVOID_COUNTS];
    fit f = {.options = options, .count = atoms};
    OV_TRY(ov_device_get(context, &device));
    ov_device_counted(device, NULL, before);
    OV_TRY(allocate(&f, context, samples));
    initialise(&f, xyzr);
    status = iterate(&f);
    if (status != OVOID_OK && !(status == OVOID_ERROR_CANCELLED && f.iterations > 0))
        goto cleanup;
    if (find_owners(&f, xyzr, atoms, owner) != OVOID_OK || hand_over(&f, ellipsoids) != OVOID_OK) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    tell(&f, result);
    ov_device_counted(device, before, result->counts);
cleanup:
    destroy(&f);
    return status;
}
