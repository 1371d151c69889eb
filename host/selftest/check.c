#include "selftest/check.h"

#include "model/ellipsoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

size_t ov_check_size(const ov_checking *c, size_t whole, size_t brief) {
    return c->whole ? whole : brief;
}

/* ---- comparisons -------------------------------------------------------------------------- */

bool ov_expect(ov_checking *c, bool right, const char *format, ...) {
    ++c->compared;
    if (right || c->wrong)
        return right;
    va_list args;
    va_start(args, format);
    vsnprintf(c->text, sizeof c->text, format, args);
    va_end(args);
    c->wrong = true;
    return false;
}

bool ov_expect_near(ov_checking *c, double got, double wanted, double allowed, const char *what,
                    size_t index) {
    const double error = fabs(got - wanted);
    const bool right = error <= allowed;
    if (allowed > 0.0)
        c->worst = fmax(c->worst, right ? error / allowed : INFINITY);
    return ov_expect(c, right, "%s %zu is %.9g, not %.9g: off by %.3g where %.3g is allowed", what,
                     index, got, wanted, error, allowed);
}

bool ov_expect_close(ov_checking *c, double got, ov_twin_sum wanted, double tolerance,
                     const char *what, size_t index) {
    return ov_expect_near(c, got, wanted.value, tolerance * FLT_EPSILON * wanted.scale + 1e-30,
                          what, index);
}

bool ov_expect_same(ov_checking *c, const float *got, const float *wanted, size_t count,
                    const char *what) {
    for (size_t k = 0; k < count; ++k)
        if (!ov_expect(c, memcmp(&got[k], &wanted[k], sizeof *got) == 0, "%s %zu is %.9g, not %.9g",
                       what, k, (double)got[k], (double)wanted[k]))
            return false;
    return true;
}

/* ---- random numbers ----------------------------------------------------------------------- */

uint64_t ov_random_bits(ov_random *random) {
    uint64_t z = random->state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

double ov_random_uniform(ov_random *random, double low, double high) {
    return low + (high - low) * ldexp((double)(ov_random_bits(random) >> 11), -53);
}

float *ov_random_floats(ovoid_context *context, ov_random *random, size_t count, double low,
                        double high) {
    float *const made = ov_alloc(context, count, sizeof *made, "numbers of a check");
    for (size_t k = 0; made && k < count; ++k)
        made[k] = (float)ov_random_uniform(random, low, high);
    return made;
}

/* ---- buffers ------------------------------------------------------------------------------ */

ovoid_status ov_read_words(ovoid_context *context, const ov_buffer *buffer, size_t count,
                           void *allocated) {
    void *const words = ov_alloc(context, count, 4, "results of a check");
    if (!words)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_buffer_read(context, buffer, 0, words, 4 * count);
    if (status != OVOID_OK)
        free(words);
    else
        memcpy(allocated, &words, sizeof words);
    return status;
}

ovoid_status ov_put_floats(ovoid_context *context, ov_buffer *buffer, const float *values,
                           size_t count) {
    return ov_buffer_put(context, buffer, values, count * sizeof *values, "numbers of a check");
}

/* ---- a model about points ----------------------------------------------------------------- */

#define PI 3.14159265358979323846

void ov_random_quadric(ov_random *random, double half, ov_quadric *quadric) {
    ovoid_ellipsoid e = {.amplitude = exp(ov_random_uniform(random, -1.0, 2.0))};
    for (int k = 0; k < 3; ++k) {
        e.decay[k] = exp(ov_random_uniform(random, -2.0, 0.5));
        e.centre[k] = ov_random_uniform(random, -half, half);
        e.angle[k] = ov_random_uniform(random, -PI, PI);
    }
    ov_quadric_of_ellipsoid(&e, quadric);
}

/* Cells of the curve along which points are put in packs, angstrom. */
#define CELL 0.5

static ovoid_status place_points(ovoid_context *context, const double *xyz, size_t points,
                                 ov_setting *s) {
    const double origin[3] = {0};
    const ovoid_status status = ov_points_create(context, xyz, points, origin, CELL, &s->points);
    if (status != OVOID_OK)
        return status;
    s->places = s->points.packs * OV_PACK;
    s->xyz = ov_alloc(context, 3 * s->places, sizeof *s->xyz, "points of a check");
    if (!s->xyz)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < s->places; ++k)
        memcpy(s->xyz + 3 * k, xyz + 3 * (size_t)s->points.order[k], 3 * sizeof *xyz);
    return OVOID_OK;
}

ovoid_status ov_setting_of(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                           const double *xyz, size_t points, double cutoff, ov_setting *s) {
    ovoid_status status = OVOID_OK;
    const double origin[3] = {0};
    *s = (ov_setting){.count = count};
    s->quadrics = ov_alloc(context, count, sizeof *quadrics, "terms of a check");
    if (!s->quadrics)
        return OVOID_ERROR_MEMORY;
    memcpy(s->quadrics, quadrics, count * sizeof *quadrics);
    OV_TRY(place_points(context, xyz, points, s));
    OV_TRY(ov_terms_set(context, &s->terms, quadrics, count, origin, cutoff));
    OV_TRY(ov_lists_build(context, &s->lists, &s->points, &s->terms, 0.0));
cleanup:
    return status;
}

ovoid_status ov_setting_create(ovoid_context *context, uint64_t seed, size_t count, size_t points,
                               double inner, double outer, double cutoff, ov_setting *s) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ov_random random = {seed};
    ov_quadric *const quadrics = ov_alloc(context, count, sizeof *quadrics, "terms of a check");
    double *const xyz = ov_alloc(context, 3 * points, sizeof *xyz, "points of a check");
    if (!quadrics || !xyz)
        goto cleanup;
    for (size_t i = 0; i < count; ++i)
        ov_random_quadric(&random, inner, &quadrics[i]);
    for (size_t k = 0; k < 3 * points; ++k)
        xyz[k] = ov_random_uniform(&random, -outer, outer);
    status = ov_setting_of(context, quadrics, count, xyz, points, cutoff, s);
cleanup:
    free(quadrics);
    free(xyz);
    return status;
}

void ov_setting_destroy(ov_setting *s) {
    ov_points_destroy(&s->points);
    ov_terms_destroy(&s->terms);
    ov_lists_destroy(&s->lists);
    ov_operations_destroy(&s->operations);
    free(s->quadrics);
    free(s->xyz);
    *s = (ov_setting){0};
}

float *ov_setting_floats(ovoid_context *context, const ov_setting *s, ov_random *random, double low,
                         double high) {
    float *const made = ov_random_floats(context, random, s->places, low, high);
    for (size_t k = 0; made && k < s->places; ++k)
        if (ov_points_fill(&s->points, k))
            made[k] = 0.0f;
    return made;
}
