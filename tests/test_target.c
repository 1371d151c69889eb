/*
 * What the adaptive fit holds a model to: bounds and weights against a twin in double, and what
 * windows, scales and emphasis make of them.
 */
#include "scene.h"

#include "fit/adaptive/constants.h"

/* ---- the twin ----------------------------------------------------------------------------- */

typedef enum zone { ZONE_OUTSIDE, ZONE_BAND, ZONE_INSIDE, ZONE_EDGE } zone;

/* EDGE: so near to a border that rounding decides. */
static zone zone_of(const scene *s, double phi) {
    const double low = s->target.options.low * s->isovalue,
                 high = s->target.options.high * s->isovalue;
    if (fabs(phi / low - 1.0) < 1e-4 || fabs(phi / high - 1.0) < 1e-4)
        return ZONE_EDGE;
    return phi < low ? ZONE_OUTSIDE : phi > high ? ZONE_INSIDE : ZONE_BAND;
}

/* The weight of a residual squared, lengths in units of 1 / sqrt(2 d) and values in units of c. */
static double weight_of(const scene *s, const double y[3], double phi) {
    const ov_target_options *const o = &s->target.options;
    const double length = 1.0 / sqrt(2.0 * s->decay), c = s->isovalue;
    ov_twin_sum g[3];
    double root = 0.0;
    ov_twin_gradient(s->quadrics, s->count, y, g);
    const double slope =
        sqrt(g[0].value * g[0].value + g[1].value * g[1].value + g[2].value * g[2].value) * length /
        c;
    const double floored = slope < o->slope_min ? o->slope_min : slope;
    const double away = (phi / c - 1.0) / floored / o->window;
    switch (zone_of(s, phi)) {
    case ZONE_INSIDE:
        root = o->inside_weight;
        break;
    case ZONE_OUTSIDE:
        root = o->outside_weight;
        break;
    case ZONE_BAND:
    case ZONE_EDGE:
        root = (o->floor + exp(-away * away)) / floored;
        break;
    }
    return root / c * (root / c);
}

/* Bounds and weights as they are on the device. */
typedef struct bounds {
    float *low, *high, *weight;
} bounds;

static bounds read_bounds(const scene *s) {
    return (bounds){.low = read_floats(s->context, &s->target.low, s->all),
                    .high = read_floats(s->context, &s->target.high, s->all),
                    .weight = read_floats(s->context, &s->target.weight, s->all)};
}

static void free_bounds(bounds *b) {
    free(b->low);
    free(b->high);
    free(b->weight);
}

static double phi_of(const scene *s, size_t k) {
    return ov_twin_field(s->quadrics, s->count, s->xyz + 3 * k).value;
}

static void expect_bounds(const scene *s, const bounds *b, size_t k, double scale) {
    const double phi = phi_of(s, k);
    const double low = s->target.options.low * s->isovalue,
                 high = s->target.options.high * s->isovalue;
    switch (zone_of(s, phi)) {
    case ZONE_OUTSIDE:
        assert_true(b->low[k] == -FLT_MAX);
        expect_near(b->high[k], low, 1e-6 * low, "the bound outside");
        break;
    case ZONE_INSIDE:
        assert_true(b->high[k] == FLT_MAX);
        expect_near(b->low[k], high, 1e-6 * high, "the bound inside");
        break;
    case ZONE_BAND:
        assert_true(b->low[k] == b->high[k]);
        expect_near(b->low[k], scale * phi, 1e-5 * phi, "what is followed");
        break;
    case ZONE_EDGE:
        break;
    }
}

/* Everything against the twin; factor[k], if not NULL, is the emphasis of point k. */
static void expect_target(const scene *s, double scale, const double *factor) {
    bounds b = read_bounds(s);
    for (size_t k = 0; k < s->points; ++k) {
        const double phi = phi_of(s, k);
        expect_bounds(s, &b, k, scale);
        const double weight = weight_of(s, s->xyz + 3 * k, phi) * (factor ? factor[k] : 1.0);
        if (zone_of(s, phi) != ZONE_EDGE)
            expect_near(b.weight[k], weight, 1e-4 * weight, "a weight");
    }
    for (size_t k = s->points; k < s->all; ++k)
        assert_true(b.weight[k] == 0.0f);
    free_bounds(&b);
}

/* ---- scenes ------------------------------------------------------------------------------- */

static void atoms_scene(scene *s, ovoid_context *context, double decay, double isovalue,
                        uint64_t seed) {
    test_random random = {seed};
    ov_target_options options;
    ov_target_options_init(&options);
    const size_t count = test_size(12, 2);
    const double length = 1.0 / sqrt(2.0 * decay);
    ov_quadric *const quadrics = scene_atoms(&random, count, decay);
    for (size_t i = 0; i < count; ++i)
        quadrics[i].amplitude *= isovalue;
    scene_create(s, context, quadrics, count, decay, isovalue, test_size(6, 5) / 10.0 * length,
                 5.0 * length, &options);
    free(quadrics);
}

static void every_kind_of_point(void **state) {
    const double decays[] = {0.5, 0.5, 1.3, 0.11}, isovalues[] = {1.0, 0.4, 2.5, 7.0};
    for (size_t n = 0; n < 4; n = test_next(*state, n, 3)) {
        scene s;
        size_t met[4] = {0};
        atoms_scene(&s, *state, decays[n], isovalues[n], 10 + n);
        expect_target(&s, 1.0, NULL);
        for (size_t k = 0; k < s.points; ++k)
            ++met[zone_of(&s, phi_of(&s, k))];
        print_message("%zu outside, %zu in the band, %zu inside, %zu at an edge\n", met[0], met[1],
                      met[2], met[3]);
        assert_true(met[ZONE_OUTSIDE] > 0 && met[ZONE_BAND] > 0 && met[ZONE_INSIDE] > 0);
        scene_destroy(&s);
    }
}

/* The same molecule in other units of length and with another isovalue: bounds go with c, weights
 * with its inverse square, and lengths do not matter. */
static void units_scale(void **state) {
    test_skip_simulated(*state); /* other numbers, the same ways through the kernels */
    scene a, b;
    atoms_scene(&a, *state, 0.5, 1.0, 3);
    atoms_scene(&b, *state, 2.0, 4.0, 3); /* lengths halved, exactly */
    assert_int_equal(a.points, b.points);
    bounds of_a = read_bounds(&a), of_b = read_bounds(&b);
    for (size_t k = 0; k < a.points; ++k) {
        if (zone_of(&a, phi_of(&a, k)) == ZONE_EDGE)
            continue;
        for (size_t axis = 0; axis < 3; ++axis)
            assert_true(a.xyz[3 * k + axis] == 2.0 * b.xyz[3 * k + axis]);
        const double weight = of_a.weight[k] / 16.0;
        expect_near(of_b.weight[k], weight, 1e-4 * weight, "a weight");
        if (of_a.low[k] != -FLT_MAX)
            expect_near(of_b.low[k], 4.0 * of_a.low[k], 1e-5 * of_a.low[k], "a bound below");
        if (of_a.high[k] != FLT_MAX)
            expect_near(of_b.high[k], 4.0 * of_a.high[k], 1e-5 * of_a.high[k], "a bound above");
    }
    free_bounds(&of_a);
    free_bounds(&of_b);
    scene_destroy(&a);
    scene_destroy(&b);
}

/* A slope under the floor: between two atoms far apart and at the middle of one the field is flat.
 */
static void flat_places_have_a_floor(void **state) {
    scene s;
    ov_target_options options;
    ov_quadric quadric;
    const double xyzr[4] = {0.0, 0.0, 0.0, 1.0}; /* phi = 1.65 at its middle */
    ov_target_options_init(&options);
    ov_quadric_of_atom(xyzr, 0.5, &quadric);
    scene_create(&s, *state, &quadric, 1, 0.5, 1.0, 0.5, 5.0, &options);
    expect_target(&s, 1.0, NULL);
    bounds b = read_bounds(&s);
    size_t middle = 0;
    while (middle < s.points && (s.xyz[3 * middle] != 0.0 || s.xyz[3 * middle + 1] != 0.0 ||
                                 s.xyz[3 * middle + 2] != 0.0))
        ++middle;
    assert_true(middle < s.points);
    const double away = (exp(0.5) - 1.0) / 0.7 / 0.5;
    const double root = (0.05 + exp(-away * away)) / 0.7;
    expect_near(b.weight[middle], root * root, 1e-5, "the weight at the middle");
    free_bounds(&b);
    scene_destroy(&s);
}

/* ---- changes ------------------------------------------------------------------------------ */

static void windows_weigh_anew(void **state) {
    scene s;
    atoms_scene(&s, *state, 0.8, 1.5, 21);
    const double place[3] = {0.0, 0.0, 0.0};
    test_check(*state, ov_target_emphasise(*state, &s.target, place, sizeof place, 1, 50.0, 3.0));
    test_check(*state, ov_target_window(*state, &s.target, 0.3, 0.02));
    assert_true(s.target.options.window == 0.3 && s.target.options.floor == 0.02);
    expect_target(&s, 1.0, NULL); /* emphasis is forgotten */
    test_check(*state, ov_target_window(*state, &s.target, 0.9, 0.15));
    expect_target(&s, 1.0, NULL);
    scene_destroy(&s);
}

/* Of phi, however often; guards and weights stay. */
static void scales_do_not_add_up(void **state) {
    scene s;
    atoms_scene(&s, *state, 0.5, 1.0, 22);
    const double scales[] = {1.05, 0.97, 1.0};
    for (size_t n = 0; n < 3; ++n) {
        test_check(*state, ov_target_scale(*state, &s.target, scales[n]));
        expect_target(&s, scales[n], NULL);
    }
    test_check(*state, ov_target_scale(*state, &s.target, 1.02));
    test_check(*state, ov_target_window(*state, &s.target, 0.4, 0.1));
    expect_target(&s, 1.02, NULL); /* a window leaves what is followed */
    scene_destroy(&s);
}

/* Places with something between them, as spots have. */
typedef struct mark {
    double at[3], other;
} mark;

static double nearest(const mark *marks, size_t count, const double y[3]) {
    double least = INFINITY;
    for (size_t n = 0; n < count; ++n) {
        double square = 0.0;
        for (int k = 0; k < 3; ++k)
            square += (marks[n].at[k] - y[k]) * (marks[n].at[k] - y[k]);
        least = fmin(least, square);
    }
    return sqrt(least);
}

/* Exactly the points within reach, and once each though several places are near. */
static void emphasis_is_local(void **state) {
    scene s;
    test_random random = {5};
    mark marks[6];
    atoms_scene(&s, *state, 0.5, 1.0, 23);
    double *const factor = test_alloc(s.all, sizeof *factor);
    for (size_t k = 0; k < s.all; ++k)
        factor[k] = 1.0;
    for (int round = 0; round < 3; ++round) {
        const double reach = 0.7 + 0.6 * round;
        size_t within = 0;
        for (size_t n = 0; n < 6; ++n) {
            const size_t k = (size_t)(random_bits(&random) % s.points);
            for (size_t axis = 0; axis < 3; ++axis)
                marks[n].at[axis] = s.xyz[3 * k + axis] + random_uniform(&random, -0.5, 0.5);
            marks[n].other = 1e9;
        }
        memcpy(marks[5].at, marks[4].at, sizeof marks[5].at); /* two at one place */
        test_check(*state, ov_target_emphasise(*state, &s.target, marks[0].at, sizeof *marks, 6,
                                               reach, 1.3));
        for (size_t k = 0; k < s.points; ++k) {
            const double distance = nearest(marks, 6, s.xyz + 3 * k);
            assert_true(fabs(distance - reach) > 1e-5); /* rounding does not decide here */
            if (distance < reach) {
                factor[k] *= 1.3;
                ++within;
            }
        }
        print_message("%zu of %zu points within %g\n", within, s.points, reach);
        assert_true(within > 0 && within < s.points);
        expect_target(&s, 1.0, factor);
    }
    test_check(*state, ov_target_emphasise(*state, &s.target, NULL, sizeof *marks, 0, 2.0, 5.0));
    expect_target(&s, 1.0, factor); /* no place, no change */
    free(factor);
    scene_destroy(&s);
}

/* Emphasised points follow phi itself again, whatever multiple of it the others follow. */
static void emphasis_asks_for_phi_itself(void **state) {
    scene s;
    const mark middle = {.at = {0.0, 0.0, 0.0}};
    atoms_scene(&s, *state, 0.5, 1.0, 25);
    const double reach = test_small() ? 0.97 : 2.93;
    size_t exact = 0, scaled = 0;
    test_check(*state, ov_target_scale(*state, &s.target, 1.05));
    test_check(*state,
               ov_target_emphasise(*state, &s.target, middle.at, sizeof middle, 1, reach, 2.0));
    bounds b = read_bounds(&s);
    for (size_t k = 0; k < s.points; ++k) {
        const bool within = nearest(&middle, 1, s.xyz + 3 * k) < reach;
        expect_bounds(&s, &b, k, within ? 1.0 : 1.05);
        if (b.low[k] == b.high[k])
            ++*(within ? &exact : &scaled);
    }
    assert_true(exact > 0 && scaled > 0);
    free_bounds(&b);
    test_check(*state, ov_target_scale(*state, &s.target, 0.98));
    b = read_bounds(&s);
    for (size_t k = 0; k < s.points; ++k)
        expect_bounds(&s, &b, k, 0.98);
    free_bounds(&b);
    scene_destroy(&s);
}

static void emphasis_has_a_limit(void **state) {
    scene s;
    const mark far = {.at = {1e5, 0.0, 0.0}}, middle = {.at = {0.0, 0.0, 0.0}};
    atoms_scene(&s, *state, 0.5, 1.0, 24);
    double *const factor = test_alloc(s.all, sizeof *factor);
    for (size_t k = 0; k < s.all; ++k)
        factor[k] = 9.0;
    const mark both[2] = {far, middle};
    test_check(*state,
               ov_target_emphasise(*state, &s.target, both[0].at, sizeof *both, 2, 100.0, 9.0));
    expect_target(&s, 1.0, factor);
    for (size_t k = 0; k < s.all; ++k)
        factor[k] = (float)ov_tuned.spots_emphasis_max;
    for (int n = 0; n < 2; ++n) {
        test_check(*state,
                   ov_target_emphasise(*state, &s.target, middle.at, sizeof middle, 1, 100.0, 9.0));
        expect_target(&s, 1.0, factor);
    }
    free(factor);
    scene_destroy(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kind_of_point),          cmocka_unit_test(units_scale),
        cmocka_unit_test(flat_places_have_a_floor),     cmocka_unit_test(windows_weigh_anew),
        cmocka_unit_test(scales_do_not_add_up),         cmocka_unit_test(emphasis_is_local),
        cmocka_unit_test(emphasis_asks_for_phi_itself), cmocka_unit_test(emphasis_has_a_limit),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
