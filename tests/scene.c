#include "scene.h"
#include "model/ellipsoid.h"

static bool wanted(const scene *s, const int64_t at[3], double phi) {
    const ov_target_options *const options = &s->target.options;
    const double share = phi / s->isovalue;
    uint32_t every = 1;
    if (share > options->high)
        every = options->inside_every;
    else if (share < options->low)
        every = share >= options->outside_low ? options->outside_every : 0;
    return every > 0 && at[0] % every == 0 && at[1] % every == 0 && at[2] % every == 0;
}

/* Kept lattice points, 3 floats each. */
static float *choose_points(scene *s, double spacing, double reach, size_t *kept) {
    int64_t low[3], high[3], at[3];
    for (int k = 0; k < 3; ++k) {
        double from = INFINITY, to = -INFINITY;
        for (size_t i = 0; i < s->count; ++i) {
            from = fmin(from, s->quadrics[i].centre[k]);
            to = fmax(to, s->quadrics[i].centre[k]);
        }
        low[k] = (int64_t)floor((from - reach) / spacing);
        high[k] = (int64_t)ceil((to + reach) / spacing);
    }
    const size_t most =
        (size_t)((high[0] - low[0] + 1) * (high[1] - low[1] + 1) * (high[2] - low[2] + 1));
    float *const points = test_alloc(3 * most, sizeof *points);
    *kept = 0;
    for (at[2] = low[2]; at[2] <= high[2]; ++at[2])
        for (at[1] = low[1]; at[1] <= high[1]; ++at[1])
            for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) {
                double y[3];
                for (int k = 0; k < 3; ++k)
                    y[k] = (float)((double)at[k] * spacing);
                if (!wanted(s, at, ov_twin_field(s->quadrics, s->count, y).value))
                    continue;
                for (int k = 0; k < 3; ++k)
                    points[3 * *kept + (size_t)k] = (float)y[k];
                ++*kept;
            }
    return points;
}

static void evaluate_field(scene *s) {
    const double origin[3] = {0};
    ov_terms terms = {0};
    ov_lists lists = {0};
    ov_operations operations = {0};
    ov_points *const points = &s->samples.points;
    test_check(s->context, ov_terms_set(s->context, &terms, s->quadrics, s->count, origin,
                                        OV_TARGET_CUTOFF * s->isovalue));
    test_check(s->context, ov_lists_build(s->context, &lists, points, &terms, 0.0));
    test_check(s->context, ov_field_gradient(s->context, &operations, points, &terms, &lists,
                                             &s->samples.value, &s->samples.gradient));
    ov_operations_destroy(&operations);
    ov_lists_destroy(&lists);
    ov_terms_destroy(&terms);
}

void scene_create(scene *s, ovoid_context *context, const ov_quadric *quadrics, size_t count,
                  double decay, double isovalue, double spacing, double reach,
                  const ov_target_options *options) {
    const double origin[3] = {0};
    *s = (scene){.context = context, .count = count, .decay = decay, .isovalue = isovalue};
    s->quadrics = test_alloc(count, sizeof *s->quadrics);
    memcpy(s->quadrics, quadrics, count * sizeof *quadrics);
    s->target.options = *options;
    float *const xyz = choose_points(s, spacing, reach, &s->points);
    assert_true(s->points > 0);
    ov_points *const points = &s->samples.points;
    double *const wide = widen_points(xyz, s->points);
    test_check(context, ov_points_create(context, wide, s->points, origin, spacing, points));
    free(wide);
    s->all = points->packs * OV_PACK;
    s->xyz = test_alloc(3 * s->all, sizeof *s->xyz);
    for (size_t k = 0; k < s->all; ++k)
        for (size_t axis = 0; axis < 3; ++axis)
            s->xyz[3 * k + axis] = xyz[3 * (size_t)points->order[k] + axis];
    evaluate_field(s);
    test_check(context,
               ov_target_create(context, &s->samples, decay, isovalue, options, &s->target));
    free(xyz);
}

void scene_destroy(scene *s) {
    ov_target_destroy(&s->target);
    ov_samples_destroy(&s->samples);
    free(s->quadrics);
    free(s->xyz);
    memset(s, 0, sizeof *s);
}

ov_quadric *scene_atoms(test_random *random, size_t count, double decay) {
    const double scale = 1.0 / sqrt(2.0 * decay), half = 1.1 * cbrt((double)count) * scale;
    ov_quadric *const quadrics = test_alloc(count, sizeof *quadrics);
    for (size_t i = 0; i < count; ++i) {
        double xyzr[4];
        for (int k = 0; k < 3; ++k)
            xyzr[k] = random_uniform(random, -half, half);
        xyzr[3] = random_uniform(random, 1.2, 1.8) * scale;
        ov_quadric_of_atom(xyzr, decay, &quadrics[i]);
    }
    return quadrics;
}

ov_quadric *scene_ellipsoids(test_random *random, size_t count) {
    const double half = 1.3 * cbrt((double)count);
    ov_quadric *const quadrics = test_alloc(count, sizeof *quadrics);
    for (size_t i = 0; i < count; ++i) {
        ovoid_ellipsoid e = {.amplitude = exp(random_uniform(random, 0.6, 1.6))};
        for (int k = 0; k < 3; ++k) {
            e.centre[k] = random_uniform(random, -half, half);
            e.decay[k] = random_uniform(random, 0.25, 0.5);
            e.angle[k] = random_uniform(random, -3.0, 3.0);
        }
        ov_quadric_of_ellipsoid(&e, &quadrics[i]);
    }
    return quadrics;
}
