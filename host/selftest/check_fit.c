/* The kernels of the adaptive method, and a fit. */
#include "selftest/check.h"

#include "fit/adaptive/solver.h"
#include "mixture/component.h"
#include "selftest/twin_factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { P = OV_FACTOR_PARAMETERS };

/* ---- merges ------------------------------------------------------------------------------- */

/* Values, bounds on them and weights at the points. */
typedef struct charges {
    float *value, *low, *high, *weight;
} charges;

static ovoid_status make_charges(ovoid_context *context, const ov_setting *s, charges *a) {
    ov_random random = {11};
    a->value = ov_setting_floats(context, s, &random, 0.0, 0.0);
    a->low = ov_setting_floats(context, s, &random, 0.7, 1.3);
    a->high = ov_setting_floats(context, s, &random, 0.0, 0.0);
    a->weight = ov_setting_floats(context, s, &random, 0.0, 2.0);
    if (!a->value || !a->low || !a->high || !a->weight)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < s->places; ++k) {
        const double phi = ov_twin_field(s->quadrics, s->count, s->xyz + 3 * k).value;
        a->value[k] = (float)phi;
        a->low[k] *= (float)phi;
        a->high[k] = k % 3 == 0 ? FLT_MAX : a->low[k];
        a->low[k] = k % 3 == 1 ? -FLT_MAX : a->low[k];
    }
    return OVOID_OK;
}

static void destroy_charges(charges *a) {
    free(a->value);
    free(a->low);
    free(a->high);
    free(a->weight);
}

static double square_residual(double value, double low, double high) {
    const double r = value - fmin(fmax(value, low), high);
    return r * r;
}

/* Over all points: the lists leave none out. */
static ov_twin_sum twin_loss(const ov_setting *s, const charges *a, const uint32_t pair[2],
                             const ov_quadric *merged) {
    ov_twin_sum sum = {0};
    for (size_t k = 0; k < s->places; ++k) {
        const double *const y = s->xyz + 3 * k;
        const ov_twin_sum ei = ov_twin_field(&s->quadrics[pair[0]], 1, y),
                          ej = ov_twin_field(&s->quadrics[pair[1]], 1, y),
                          em = ov_twin_field(merged, 1, y);
        const double before = a->value[k], after = before - ei.value - ej.value + em.value;
        const double x = square_residual(after, a->low[k], a->high[k]),
                     z = square_residual(before, a->low[k], a->high[k]);
        sum.value += a->weight[k] * (x - z);
        sum.scale +=
            a->weight[k] *
            (x + z + 2.0 * sqrt(x) * (ei.scale + ej.scale + em.scale + 2.0 * fabs(before)));
    }
    return sum;
}

/* Each term with the next. */
static ovoid_status make_pairs(ovoid_context *context, const ov_setting *s, uint32_t *pairs,
                               ov_quadric *merged) {
    for (uint32_t i = 0; i + 1 < s->count; ++i) {
        ov_component p, q, both;
        pairs[2 * i] = i;
        pairs[2 * i + 1] = i + 1;
        if (!ov_component_of_quadric(&s->quadrics[i], &p) ||
            !ov_component_of_quadric(&s->quadrics[i + 1], &q))
            return ov_fail(context, OVOID_ERROR_NUMERIC, "a term of a check is no Gaussian");
        ov_component_merge(&p, &q, &both);
        ov_quadric_of_component(&both, &merged[i]);
    }
    return OVOID_OK;
}

static ovoid_status run_losses(ovoid_context *context, const ov_setting *s, const charges *a,
                               const uint32_t *pairs, const ov_quadric *merged, size_t count,
                               float **losses) {
    ovoid_status status = OVOID_OK;
    const double origin[3] = {0};
    const float *const given[] = {a->value, a->low, a->high, a->weight};
    const cl_uint pairs_count = (cl_uint)count;
    ov_kernel kernel = {0};
    ov_terms terms = {0};
    ov_buffer in[4] = {0}, list = {0}, loss = {0};
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "merge", "merge_loss", &kernel));
    OV_TRY(ov_terms_set(context, &terms, merged, count, origin, 1e-37));
    for (size_t k = 0; k < 4; ++k)
        OV_TRY(ov_put_floats(context, &in[k], given[k], s->places));
    OV_TRY(ov_buffer_put(context, &list, pairs, 2 * count * sizeof *pairs, "pairs"));
    OV_TRY(ov_buffer_reserve(context, &loss, count * sizeof(float), "losses"));
    OV_TRY(OV_LAUNCH(
        context, &kernel, count * device->shape.lanes, device->team, OV_ARG(pairs_count),
        OV_ARG(list.memory), OV_ARG(terms.device.memory), OV_ARG(s->points.xyz.memory),
        OV_ARG(s->points.pack_origins.memory), OV_ARG(in[0].memory), OV_ARG(in[1].memory),
        OV_ARG(in[2].memory), OV_ARG(in[3].memory), OV_ARG(s->lists.term_start.memory),
        OV_ARG(s->lists.term_item.memory), OV_ARG(s->terms.device.memory), OV_ARG(loss.memory)));
    OV_TRY(ov_read_words(context, &loss, count, losses));
cleanup:
    for (size_t k = 0; k < 4; ++k)
        ov_buffer_destroy(&in[k]);
    ov_buffer_destroy(&list);
    ov_buffer_destroy(&loss);
    ov_terms_destroy(&terms);
    ov_kernel_destroy(&kernel);
    return status;
}

ovoid_status ov_check_merge(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    ov_setting s = {0};
    charges a = {0};
    uint32_t *pairs = NULL;
    ov_quadric *merged = NULL;
    float *losses = NULL;
    OV_TRY(ov_setting_create(context, 10, ov_check_size(c, 70, 20), ov_check_size(c, 1303, 203),
                             3.0, 5.0, 1e-37, &s));
    OV_TRY(make_charges(context, &s, &a));
    pairs = ov_alloc(context, 2 * s.count, sizeof *pairs, "pairs of a check");
    merged = ov_alloc(context, s.count, sizeof *merged, "terms of a check");
    if (!pairs || !merged) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(make_pairs(context, &s, pairs, merged));
    OV_TRY(run_losses(context, &s, &a, pairs, merged, s.count - 1, &losses));
    for (size_t n = 0; n + 1 < s.count; ++n)
        ov_expect_close(c, losses[n], twin_loss(&s, &a, pairs + 2 * n, &merged[n]), 4.0,
                        "merge_loss: pair", n);
cleanup:
    free(pairs);
    free(merged);
    free(losses);
    destroy_charges(&a);
    ov_setting_destroy(&s);
    return status;
}

/* ---- conjugate gradients ------------------------------------------------------------------ */

/* Iterations that are compared, before rounding makes their courses part. */
#define ITERATIONS 4
#define LAMBDA 0.05

typedef struct problem {
    ov_setting s;
    size_t size; /* parameters of all */
    double *x;   /* they */
    float *weight, *u;
    double *matrix, *right; /* J^T W J + lambda D, -J^T W r */
    ov_buffer weights, residuals, moments, gram;
} problem;

static void destroy_problem(problem *p) {
    ov_buffer *const buffers[] = {&p->weights, &p->residuals, &p->moments, &p->gram};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    free(p->x);
    free(p->weight);
    free(p->u);
    free(p->matrix);
    free(p->right);
    ov_setting_destroy(&p->s);
}

static ovoid_status make_problem(ov_checking *c, problem *p) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    ov_random random = {13};
    ov_setting *const s = &p->s;
    OV_TRY(ov_setting_create(context, 12, ov_check_size(c, 40, 5), ov_check_size(c, 3001, 301), 3.0,
                             5.0, 1e-30, s));
    p->size = s->count * P;
    p->x = ov_alloc(context, p->size, sizeof *p->x, "parameters of a check");
    p->weight = ov_setting_floats(context, s, &random, 0.2, 2.0);
    p->u = ov_setting_floats(context, s, &random, -0.5, 0.5);
    p->matrix = ov_alloc(context, p->size * p->size, sizeof *p->matrix, "a check's matrix");
    p->right = ov_alloc(context, p->size, sizeof *p->right, "a check's right side");
    status = OVOID_ERROR_MEMORY;
    if (!p->x || !p->weight || !p->u || !p->matrix || !p->right)
        goto cleanup;
    for (size_t i = 0; i < s->count; ++i)
        ov_factor_of_quadric(&s->quadrics[i], p->x + i * P);
    if (!ov_twin_system(p->x, s->count, s->xyz, p->weight, p->u, s->places, LAMBDA, p->matrix,
                        p->right))
        goto cleanup;
    OV_TRY(ov_put_floats(context, &p->weights, p->weight, s->places));
    OV_TRY(ov_put_floats(context, &p->residuals, p->u, s->places));
    OV_TRY(ov_moments(context, &s->operations, &s->points, &s->terms, &s->lists, &p->residuals,
                      &p->moments));
    OV_TRY(
        ov_gram(context, &s->operations, &s->points, &s->terms, &s->lists, &p->weights, &p->gram));
cleanup:
    return status;
}

/* z = block^-1 r, the blocks those of the matrix's diagonal. */
static bool precondition(const problem *p, const double *r, double *z) {
    memcpy(z, r, p->size * sizeof *z);
    for (size_t first = 0; first < p->size; first += P) {
        double block[P * P];
        for (size_t i = 0; i < P; ++i)
            for (size_t j = 0; j < P; ++j)
                block[i * P + j] = p->matrix[(first + i) * p->size + first + j];
        if (!ov_twin_solve(block, P, z + first))
            return false;
    }
    return true;
}

static double dot(const double *a, const double *b, size_t size) {
    double sum = 0.0;
    for (size_t k = 0; k < size; ++k)
        sum += a[k] * b[k];
    return sum;
}

/* x after so many iterations of conjugate gradients from 0; work: 4 * size. */
static bool twin_iterate(const problem *p, unsigned iterations, double *x, double *work) {
    const size_t size = p->size;
    double *const r = work, *const z = r + size, *const d = z + size, *const q = d + size;
    memset(x, 0, size * sizeof *x);
    memcpy(r, p->right, size * sizeof *r);
    if (!precondition(p, r, z))
        return false;
    memcpy(d, z, size * sizeof *d);
    for (unsigned n = 0; n < iterations; ++n) {
        const double before = dot(r, z, size);
        for (size_t i = 0; i < size; ++i)
            q[i] = dot(p->matrix + i * size, d, size);
        const double alpha = before / dot(d, q, size);
        for (size_t i = 0; i < size; ++i) {
            x[i] += alpha * d[i];
            r[i] -= alpha * q[i];
        }
        if (!precondition(p, r, z))
            return false;
        const double beta = dot(r, z, size) / before;
        for (size_t i = 0; i < size; ++i)
            d[i] = z[i] + beta * d[i];
    }
    return true;
}

/* The step in units of the diagonal, which parameters of all kinds have in common. */
static void expect_step(ov_checking *c, const problem *p, const double *wanted, const double *got,
                        const char *what) {
    double largest = 0.0;
    for (size_t k = 0; k < p->size; ++k)
        largest = fmax(largest, fabs(wanted[k]) * sqrt(p->matrix[k * p->size + k]));
    for (size_t k = 0; k < p->size; ++k)
        ov_expect_near(c, got[k], wanted[k], 2e-3 * largest / sqrt(p->matrix[k * p->size + k]),
                       what, k);
}

static ovoid_status solve(ov_checking *c, problem *p, bool apart, const double *wanted,
                          double *got) {
    ov_setting *const s = &p->s;
    ov_solver solver = {.apart = apart};
    const ov_system system = {.points = &s->points,
                              .terms = &s->terms,
                              .lists = &s->lists,
                              .weight = &p->weights,
                              .moments = &p->moments,
                              .gram = &p->gram,
                              .parameters = p->x};
    const ovoid_status status =
        ov_solve(c->context, &solver, &s->operations, &system, LAMBDA, ITERATIONS, 1e-12, got);
    if (status == OVOID_OK)
        expect_step(c, p, wanted, got,
                    apart ? "solve_start, _product, _update, _direction: component"
                          : "solve_start, _step: component");
    ov_solver_destroy(&solver);
    return status;
}

ovoid_status ov_check_solver(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    problem p = {0};
    double *work = NULL;
    OV_TRY(make_problem(c, &p));
    work = ov_alloc(c->context, 6 * p.size, sizeof *work, "a check's vectors");
    if (!work) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    double *const wanted = work, *const got = work + p.size;
    if (!twin_iterate(&p, ITERATIONS, wanted, got + p.size)) {
        status = ov_fail(c->context, OVOID_ERROR_NUMERIC, "a check's matrix has no inverse");
        goto cleanup;
    }
    OV_TRY(solve(c, &p, true, wanted, got));
    OV_TRY(solve(c, &p, false, wanted, got));
cleanup:
    free(work);
    destroy_problem(&p);
    return status;
}
