/* The kernels of the adaptive method, and a fit. */
#include "selftest/check.h"

#include "selftest/losses.h"
#include "selftest/problem.h"
#include "selftest/twin_factor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { P = OV_FACTOR_PARAMETERS };

/* ---- merges ------------------------------------------------------------------------------- */

/* Each term with the next. */
static ovoid_status make_pairs(ovoid_context *context, const ov_setting *s, uint32_t *pairs,
                               ov_quadric *merged) {
    ovoid_status status = OVOID_OK;
    for (uint32_t i = 0; i + 1 < s->count; ++i) {
        pairs[2 * i] = i;
        pairs[2 * i + 1] = i + 1;
        OV_TRY(ov_merge_quadrics(context, &s->quadrics[i], &s->quadrics[i + 1], &merged[i]));
    }
cleanup:
    return status;
}

ovoid_status ov_check_merge(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    ov_setting s = {0};
    ov_charges a = {0};
    uint32_t *pairs = NULL;
    ov_quadric *merged = NULL;
    float *losses = NULL;
    OV_TRY(ov_setting_create(context, 10, ov_check_size(c, 70, 20), ov_check_size(c, 1303, 203),
                             3.0, 5.0, 1e-37, &s));
    OV_TRY(ov_charges_create(context, s.quadrics, s.count, &s.points, s.xyz, 11, &a));
    pairs = ov_alloc(context, 2 * s.count, sizeof *pairs, "pairs of a check");
    merged = ov_alloc(context, s.count, sizeof *merged, "terms of a check");
    if (!pairs || !merged) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(make_pairs(context, &s, pairs, merged));
    OV_TRY(
        ov_losses(context, &s.points, &s.terms, &s.lists, &a, pairs, merged, s.count - 1, &losses));
    for (size_t n = 0; n + 1 < s.count; ++n)
        ov_expect_close(
            c, losses[n],
            ov_twin_loss(s.quadrics, pairs + 2 * n, &merged[n], s.xyz, s.places, &a, NULL), 4.0,
            "merge_loss: pair", n);
cleanup:
    free(pairs);
    free(merged);
    free(losses);
    ov_charges_destroy(&a);
    ov_setting_destroy(&s);
    return status;
}

/* ---- images that follow -------------------------------------------------------------------- */

enum { IMAGES = 3 };

/* Polynomials and moments of terms and of their images, and what is to become of them. */
typedef struct image_data {
    size_t count;
    float *polynomial, *moments;
    ov_rigid motion[IMAGES];
} image_data;

static void turn_any_way(ov_random *random, ov_rigid *motion) {
    const double angle[3] = {ov_random_uniform(random, -3.0, 3.0),
                             ov_random_uniform(random, -1.5, 1.5),
                             ov_random_uniform(random, -3.0, 3.0)};
    double r[3][3];
    ov_twin_rotation(angle, r);
    for (size_t k = 0; k < 9; ++k)
        motion->rotation[k] = r[k / 3][k % 3];
    for (size_t k = 0; k < 3; ++k)
        motion->shift[k] = 0.0;
}

/* turned_n = sum_m turn_nm c_m for each image of each term. */
static void expect_turned(ov_checking *c, const image_data *d, const float *got) {
    for (size_t n = 0; n < d->count * IMAGES; ++n) {
        const float *const own = d->polynomial + n % d->count * OV_MONOMIALS;
        double turn[OV_MONOMIALS][OV_MONOMIALS];
        ov_twin_turn(d->motion[n / d->count].rotation, turn);
        for (size_t k = 0; k < OV_MONOMIALS; ++k) {
            ov_twin_sum wanted = {0};
            for (size_t m = 0; m < OV_MONOMIALS; ++m) {
                wanted.value += turn[k][m] * own[m];
                wanted.scale += 4.0 * fabs(turn[k][m] * own[m]);
            }
            ov_expect_close(c, got[(d->count + n) * OV_MONOMIALS + k], wanted, 4.0,
                            "turn_polynomials: coefficient", n * OV_MONOMIALS + k);
        }
    }
}

/* Of each term: its own moments and turn^T times those of each image. */
static void expect_folded(ov_checking *c, const image_data *d, const float *got) {
    for (size_t i = 0; i < d->count; ++i)
        for (size_t k = 0; k < OV_MONOMIALS; ++k) {
            const size_t at = 2 * (i * OV_MONOMIALS + k);
            ov_twin_sum wanted = {.value = (double)d->moments[at] + d->moments[at + 1],
                                  .scale = fabs(d->moments[at])};
            for (size_t g = 0; g < IMAGES; ++g) {
                const float *const image = d->moments + 2 * ((g + 1) * d->count + i) * OV_MONOMIALS;
                double turn[OV_MONOMIALS][OV_MONOMIALS];
                ov_twin_turn(d->motion[g].rotation, turn);
                for (size_t m = 0; m < OV_MONOMIALS; ++m) {
                    const double moment = (double)image[2 * m] + image[2 * m + 1];
                    wanted.value += turn[m][k] * moment;
                    wanted.scale += 4.0 * fabs(turn[m][k] * moment);
                }
            }
            ov_expect_close(c, (double)got[at] + got[at + 1], wanted, 4.0,
                            "fold_moments: component", i * OV_MONOMIALS + k);
        }
}

static ovoid_status check_following(ov_checking *c, const image_data *d, ov_followers *followers,
                                    ov_buffer *buffer) {
    ovoid_status status = OVOID_OK;
    const size_t all = d->count * (1 + IMAGES) * OV_MONOMIALS;
    float *turned = NULL, *folded = NULL;
    OV_TRY(ov_followers_set(c->context, followers, d->motion, IMAGES));
    OV_TRY(ov_put_floats(c->context, buffer, d->polynomial, all));
    OV_TRY(ov_followers_turn(c->context, followers, d->count, NULL, buffer));
    OV_TRY(ov_read_words(c->context, buffer, all, &turned));
    ov_expect_same(c, turned, d->polynomial, d->count * OV_MONOMIALS, "turn_polynomials: a term's");
    expect_turned(c, d, turned);
    OV_TRY(ov_put_floats(c->context, buffer, d->moments, 2 * all));
    OV_TRY(ov_followers_fold(c->context, followers, d->count, NULL, buffer));
    OV_TRY(ov_read_words(c->context, buffer, 2 * all, &folded));
    expect_folded(c, d, folded);
cleanup:
    free(turned);
    free(folded);
    return status;
}

ovoid_status ov_check_images(ov_checking *c) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ov_random random = {14};
    ov_followers followers = {0};
    ov_buffer buffer = {0};
    image_data d = {.count = ov_check_size(c, 501, 21)};
    const size_t all = d.count * (1 + IMAGES) * OV_MONOMIALS;
    d.polynomial = ov_random_floats(c->context, &random, all, -1.0, 1.0);
    d.moments = ov_random_floats(c->context, &random, 2 * all, -1.0, 1.0);
    if (!d.polynomial || !d.moments)
        goto cleanup;
    for (size_t k = 1; k < 2 * all; k += 2) /* the low parts */
        d.moments[k] *= 0x1p-24f;
    for (size_t g = 0; g < IMAGES; ++g)
        turn_any_way(&random, &d.motion[g]);
    status = check_following(c, &d, &followers, &buffer);
cleanup:
    free(d.polynomial);
    free(d.moments);
    ov_followers_destroy(&followers);
    ov_buffer_destroy(&buffer);
    return status;
}

/* ---- conjugate gradients ------------------------------------------------------------------ */

/* Iterations that are compared, before rounding makes their courses part. */
#define ITERATIONS 4
#define LAMBDA 0.05

typedef struct problem {
    ov_setting s;
    ov_problem own;
    size_t size;            /* parameters of all */
    double *matrix, *right; /* J^T W J + lambda D, -J^T W r */
} problem;

static void destroy_problem(problem *p) {
    ov_problem_destroy(&p->own);
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
    p->own = (ov_problem){.points = &s->points,
                          .terms = &s->terms,
                          .lists = &s->lists,
                          .operations = &s->operations,
                          .count = s->count,
                          .x = ov_alloc(context, p->size, sizeof(double), "parameters of a check"),
                          .weight = ov_setting_floats(context, s, &random, 0.2, 2.0),
                          .u = ov_setting_floats(context, s, &random, -0.5, 0.5)};
    p->matrix = ov_alloc(context, p->size * p->size, sizeof *p->matrix, "a check's matrix");
    p->right = ov_alloc(context, p->size, sizeof *p->right, "a check's right side");
    status = OVOID_ERROR_MEMORY;
    if (!p->own.x || !p->own.weight || !p->own.u || !p->matrix || !p->right)
        goto cleanup;
    for (size_t i = 0; i < s->count; ++i)
        ov_factor_of_quadric(&s->quadrics[i], p->own.x + i * P);
    if (!ov_twin_system(p->own.x, s->count, NULL, 0, s->xyz, p->own.weight, p->own.u, s->places,
                        LAMBDA, p->matrix, p->right))
        goto cleanup;
    OV_TRY(ov_problem_upload(context, &p->own));
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
    ov_solver solver = {.apart = apart};
    const ovoid_status status =
        ov_problem_solve(c->context, &p->own, &solver, LAMBDA, ITERATIONS, 1e-12, got);
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
