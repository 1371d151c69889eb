#include "mixture/start_field.h"

#include "base/progress.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A brick has 8 intervals a side and so 9 samples, those on its faces shared by value: one look-up
 * serves an interpolation. */
enum { INTERVALS = 8, SIDE = INTERVALS + 1, SAMPLES = SIDE * SIDE * SIDE };

/* Spacing over the geometric mean width: the interpolated field is some per cent too low at a
 * lone Gaussian's centre, and much better where many overlap. */
#define SPACING 0.75

/* Keeps sums of huge amplitudes finite. */
#define VALUE_MAX 1e30f

/* Such that a start of n Gaussians takes the samples of n average boxes. */
static double spacing_of(const ov_component *components, size_t count) {
    double sum = 0.0;
    for (size_t k = 0; k < count; ++k)
        sum += sqrt(components[k].s[0] * components[k].s[3] * components[k].s[5]);
    return SPACING * cbrt(sum / (double)count);
}

/* The brick's samples from `low` to `high` (angstrom from its first) along one axis. */
static void sample_range(double low, double high, double spacing, int *first, int *last) {
    *first = (int)fmax(0.0, ceil(fmin(low / spacing, SIDE)));
    *last = (int)fmin(INTERVALS, floor(fmax(high / spacing, -1.0)));
}

static float sum_of(float a, double b) {
    const double sum = a + b;
    return (float)(sum < VALUE_MAX ? sum : VALUE_MAX);
}

/* values[i] = exp(-(constant + slope x + a x^2)) at x + i spacing, from first to last. From one
 * sample to the next the value changes by a factor, and that again by one that is always the same.
 */
static void fill_row(double a, double slope, double constant, double spacing, double x, int first,
                     int last, double values[SIDE]) {
    x += first * spacing;
    double value = exp(-(constant + x * (slope + a * x)));
    double factor = exp(-spacing * (slope + a * (2.0 * x + spacing)));
    const double change = exp(-2.0 * a * spacing * spacing);
    for (int i = first; i <= last; ++i) {
        values[i] = value;
        value *= factor;
        factor *= change;
    }
}

/* Adds a Gaussian to a row of samples, the first at x from its centre, where the exponent constant
 * + slope x + g->a[0] x^2 is at most exponent_max. */
static void add_to_row(const ov_quadric *g, double exponent_max, double spacing, double x,
                       double constant, double slope, float *row) {
    const double a = g->a[0], middle = -0.5 * slope / a;
    const double half2 = middle * middle + (exponent_max - constant) / a;
    if (!(half2 > 0.0))
        return;
    const double half = sqrt(half2);
    int first, last;
    sample_range(middle - half - x, middle + half - x, spacing, &first, &last);
    if (first > last)
        return;
    double values[SIDE];
    fill_row(a, slope, constant, spacing, x, first, last, values);
    for (int i = first; i <= last; ++i)
        row[i] = sum_of(row[i], g->amplitude * values[i]);
}

/* Adds a Gaussian to the samples of a brick within these ranges; `offset`: of the brick's first
 * sample from the centre. */
static void add_oblique(const ov_quadric *g, double exponent_max, double spacing,
                        const double offset[3], const int first[3], const int last[3],
                        float *values) {
    for (int k = first[2]; k <= last[2]; ++k)
        for (int j = first[1]; j <= last[1]; ++j) {
            const double y = offset[1] + j * spacing, z = offset[2] + k * spacing;
            add_to_row(g, exponent_max, spacing, offset[0],
                       g->a[3] * y * y + 2.0 * g->a[4] * y * z + g->a[5] * z * z,
                       2.0 * (g->a[1] * y + g->a[2] * z), values + (k * SIDE + j) * SIDE);
        }
}

/* The same for a form without xy, xz, yz, as atoms have: a product of three factors. */
static void add_upright(const ov_quadric *g, double spacing, const double offset[3],
                        const int first[3], const int last[3], float *values) {
    static const int diagonal[3] = {0, 3, 5};
    double factor[3][SIDE];
    for (int k = 0; k < 3; ++k)
        fill_row(g->a[diagonal[k]], 0.0, 0.0, spacing, offset[k], first[k], last[k], factor[k]);
    for (int k = first[2]; k <= last[2]; ++k)
        for (int j = first[1]; j <= last[1]; ++j) {
            const double scale = g->amplitude * factor[2][k] * factor[1][j];
            float *row = values + (k * SIDE + j) * SIDE;
            for (int i = first[0]; i <= last[0]; ++i)
                row[i] = sum_of(row[i], scale * factor[0][i]);
        }
}

/* Adds a Gaussian to a brick whose first sample lies at `corner`. */
static void add_to_brick(const ov_quadric *g, const double half[3], double exponent_max,
                         double spacing, const double corner[3], float *values) {
    int first[3], last[3];
    double offset[3];
    for (int k = 0; k < 3; ++k) {
        offset[k] = corner[k] - g->centre[k];
        sample_range(-half[k] - offset[k], half[k] - offset[k], spacing, first + k, last + k);
        if (first[k] > last[k])
            return;
    }
    if (g->a[1] == 0.0 && g->a[2] == 0.0 && g->a[4] == 0.0)
        add_upright(g, spacing, offset, first, last, values);
    else
        add_oblique(g, exponent_max, spacing, offset, first, last, values);
}

/* The samples of a brick; a new one is zero. */
static ovoid_status brick_at(ovoid_context *context, ov_start_field *field, const int32_t place[3],
                             float **values) {
    ovoid_status status = OVOID_OK;
    uint32_t number;
    bool added;
    OV_TRY(ov_cells_add(context, &field->bricks, place, &number, &added));
    if (added) {
        OV_TRY(ov_grow(context, &field->values, &field->capacity, ((size_t)number + 1) * SAMPLES,
                       sizeof *field->values, "the field of the start"));
        memset(field->values + (size_t)number * SAMPLES, 0, SAMPLES * sizeof *field->values);
    }
    *values = field->values + (size_t)number * SAMPLES;
cleanup:
    return status;
}

static ovoid_status add_gaussian(ovoid_context *context, ov_start_field *field, const ov_quadric *g,
                                 const ov_component *components, double least) {
    static const int diagonal[3] = {0, 3, 5};
    const ov_cells *bricks = &field->bricks;
    const double exponent_max = log(g->amplitude / least);
    if (!(exponent_max > 0.0))
        return OVOID_OK;
    double half[3], low[3], high[3];
    int32_t from[3], to[3], place[3];
    for (int k = 0; k < 3; ++k) {
        half[k] = sqrt(2.0 * exponent_max * components->s[diagonal[k]]);
        low[k] =
            g->centre[k] - half[k] - field->spacing; /* a face belongs to the brick below too */
        high[k] = g->centre[k] + half[k];
    }
    ov_cells_place(bricks, low, from);
    ov_cells_place(bricks, high, to);
    for (place[2] = from[2]; place[2] <= to[2]; ++place[2])
        for (place[1] = from[1]; place[1] <= to[1]; ++place[1])
            for (place[0] = from[0]; place[0] <= to[0]; ++place[0]) {
                double corner[3];
                float *values;
                for (int k = 0; k < 3; ++k)
                    corner[k] = bricks->origin[k] + place[k] * bricks->edge;
                const ovoid_status status = brick_at(context, field, place, &values);
                if (status != OVOID_OK)
                    return status;
                add_to_brick(g, half, exponent_max, field->spacing, corner, values);
            }
    return OVOID_OK;
}

ovoid_status ov_start_field_create(ovoid_context *context, const ov_quadric *start,
                                   const ov_component *components, size_t count, double least,
                                   ov_start_field *field) {
    ovoid_status status = OVOID_OK;
    memset(field, 0, sizeof *field);
    field->spacing = spacing_of(components, count);
    OV_TRY(ov_cells_create(context, start[0].centre, INTERVALS * field->spacing, count / 8,
                           &field->bricks));
    for (size_t k = 0; k < count; ++k) {
        if ((k & 0x3ff) == 0)
            OV_TRY(ov_progress_ask(context));
        OV_TRY(add_gaussian(context, field, start + k, components + k, least));
    }
    for (size_t k = 0; k < field->bricks.count * SAMPLES; ++k)
        field->largest = fmax(field->largest, field->values[k]);
cleanup:
    if (status != OVOID_OK)
        ov_start_field_destroy(field);
    return status;
}

void ov_start_field_destroy(ov_start_field *field) {
    ov_cells_destroy(&field->bricks);
    free(field->values);
    memset(field, 0, sizeof *field);
}

double ov_start_field_at(const ov_start_field *field, const double point[3]) {
    int32_t place[3];
    ov_cells_place(&field->bricks, point, place);
    const uint32_t number = ov_cells_find(&field->bricks, place);
    if (number == OV_NO_CELL)
        return 0.0;
    int at[3];
    double t[3];
    for (int k = 0; k < 3; ++k) {
        const double corner = field->bricks.origin[k] + place[k] * field->bricks.edge;
        const double u = fmax(0.0, fmin(INTERVALS, (point[k] - corner) / field->spacing));
        at[k] = u < INTERVALS ? (int)u : INTERVALS - 1;
        t[k] = u - at[k];
    }
    const float *v =
        field->values + (size_t)number * SAMPLES + (at[2] * SIDE + at[1]) * SIDE + at[0];
    double plane[2];
    for (int k = 0; k < 2; ++k, v += SIDE * SIDE) {
        const double low = v[0] + t[0] * (v[1] - v[0]);
        const double high = v[SIDE] + t[0] * (v[SIDE + 1] - v[SIDE]);
        plane[k] = low + t[1] * (high - low);
    }
    return plane[0] + t[2] * (plane[1] - plane[0]);
}
