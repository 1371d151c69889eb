/*
 * The search's account by place (host/fit/adaptive/places.h), and going back to atoms here and
 * there (ov_adaptive_rebuild(), host/fit/adaptive/rebuild.c), by hand.
 */
#include "fit/adaptive/places.h"
#include "fit/adaptive/search.h"
#include "support.h"

/* ---- places ------------------------------------------------------------------------------- */

static ov_spots spots_at(const double (*at)[3], size_t count) {
    ov_spots spots = {.spot = test_alloc(count, sizeof *spots.spot), .count = count};
    for (size_t n = 0; n < count; ++n)
        memcpy(spots.spot[n].at, at[n], sizeof *at);
    return spots;
}

static void meet(ovoid_context *context, ov_places *places, const double (*at)[3], size_t count,
                 const uint32_t *expected) {
    uint32_t before[8];
    ov_spots spots = spots_at(at, count);
    test_check(context, ov_places_meet(context, places, &spots, 2.0, before));
    assert_memory_equal(before, expected, count * sizeof *before);
    ov_spots_destroy(&spots);
}

/* A place moves with its spot; two spots of one meeting are two places, however near. */
static void places_are_met_again(void **state) {
    ov_places places = {0};
    meet(*state, &places, (const double[][3]){{0, 0, 0}, {0.5, 0, 0}, {9, 0, 0}}, 3,
         (uint32_t[]){0, 0, 0});
    assert_int_equal(places.count, 3);
    meet(*state, &places, (const double[][3]){{10.9, 0, 0}}, 1, (uint32_t[]){1});
    meet(*state, &places, (const double[][3]){{12.8, 0, 0}, {8.9, 0, 0}}, 2,
         (uint32_t[]){2, 0}); /* the place was near both, and went with the first */
    meet(*state, &places, (const double[][3]){{0.1, 0, 0}}, 1, (uint32_t[]){1});
    assert_int_equal(places.count, 4);
    meet(*state, &places, NULL, 0, NULL);
    test_check(*state, ov_places_add(*state, &places, (const double[3]){9.0, 0, 0}));
    assert_int_equal(places.count, 5);
    ov_places_destroy(&places);
    ov_places_destroy(&places);
}

static void near_means_within_reach(void **state) {
    const double points[][4] = {{0, 0, 0, 7}, {2.9, 0, 0, 7}, {3.1, 0, 0, 7}, {0, 50, 0, 7}};
    const bool expected[4] = {true, true, false, true};
    bool near[4];
    ov_spots spots = spots_at((const double[][3]){{0, 0, 0}, {0, 51, 0}}, 2);
    test_check(*state, ov_near_spots(*state, &spots, points[0], sizeof *points, 4, 3.0, near));
    assert_memory_equal(near, expected, sizeof near);
    spots.count = 0;
    test_check(*state, ov_near_spots(*state, &spots, points[0], sizeof *points, 4, 3.0, near));
    for (size_t n = 0; n < 4; ++n)
        assert_false(near[n]);
    ov_spots_destroy(&spots);
}

/* ---- back to the atoms -------------------------------------------------------------------- */

enum { ATOMS = 24, BEFORE = 6, P = OV_FACTOR_PARAMETERS };

/* Atoms on a line; ellipsoid i owns atoms 4 i to 4 i + 3 but for 5, which owns none: 4 has eight.
 * Its parameters are numbers that tell it. */
typedef struct line {
    double xyzr[4 * ATOMS];
    ovoid_fit_options options;
    ov_adaptive fit;
    ov_trial trial;
} line;

static void line_create(ovoid_context *context, line *l) {
    memset(l, 0, sizeof *l);
    ovoid_fit_options_init(&l->options, sizeof l->options);
    for (size_t i = 0; i < ATOMS; ++i) {
        l->xyzr[4 * i] = 1.4 * (double)i;
        l->xyzr[4 * i + 3] = 1.5 + 0.01 * (double)i;
    }
    l->fit = (ov_adaptive){.context = context,
                           .xyzr = l->xyzr,
                           .atoms = ATOMS,
                           .options = &l->options,
                           .capacity = ATOMS + 8};
    test_check(context, ov_trial_create(&l->fit, &l->trial));
    l->trial.count = BEFORE;
    for (size_t i = 0; i < BEFORE * P; ++i)
        l->trial.x[i] = 1000.0 + (double)i;
    for (uint32_t i = 0; i < ATOMS; ++i)
        l->trial.owner[i] = i / 4 < 5 ? i / 4 : 4;
}

static bool is_old(const line *l, size_t i, size_t which) {
    for (size_t k = 0; k < P; ++k)
        if (l->trial.x[i * P + k] != 1000.0 + (double)(which * P + k))
            return false;
    return true;
}

/* Ellipsoid i is atom `which` as the surface has it. */
static void expect_atom(const line *l, size_t i, size_t which) {
    ov_quadric atom, got;
    ov_quadric_of_atom(l->xyzr + 4 * which, l->options.decay, &atom);
    ov_factor_quadric(l->trial.x + i * P, &got);
    expect_near(got.amplitude, atom.amplitude, 1e-9, "an amplitude");
    expect_near(got.centre[0], atom.centre[0], 1e-9, "a centre");
    assert_int_equal(l->trial.owner[which], i);
}

static void atoms_come_back(void **state) {
    line l;
    const bool chosen[BEFORE] = {false, true, false, false, false, false};
    line_create(*state, &l);
    test_check(*state, ov_adaptive_rebuild(&l.fit, &l.trial, 1e9, chosen));
    assert_int_equal(l.trial.count, BEFORE + 3);
    for (size_t i = 0; i < BEFORE; ++i)
        assert_true(is_old(&l, i, i) == (i != 1));
    const size_t slot[4] = {1, 6, 7, 8};
    for (size_t n = 0; n < 4; ++n)
        expect_atom(&l, slot[n], 4 + n);
    for (size_t i = 0; i < ATOMS; ++i)
        if (i / 4 != 1)
            assert_int_equal(l.trial.owner[i], i / 4 < 5 ? i / 4 : 4);
    ov_trial_destroy(&l.trial);
}

/* Eight atoms of 2 and 3 to three ellipsoids, which keep the atoms' mass and own them all. */
static void regions_are_merged_anew(void **state) {
    line l;
    const bool chosen[BEFORE] = {false, false, true, true, false, false};
    size_t owned[BEFORE + 1] = {0};
    double mass = 0.0, expected = 0.0;
    line_create(*state, &l);
    test_check(*state, ov_adaptive_rebuild(&l.fit, &l.trial, 1.5, chosen));
    assert_int_equal(l.trial.count, BEFORE + 1);
    for (size_t i = 0; i < ATOMS; ++i)
        ++owned[l.trial.owner[i]];
    assert_int_equal(owned[2] + owned[3] + owned[6], 8);
    assert_true(owned[2] > 0 && owned[3] > 0 && owned[6] > 0);
    for (size_t i = 0; i <= BEFORE; ++i)
        if (i == 2 || i == 3 || i == 6) {
            const double *const x = l.trial.x + i * P;
            mass += exp(x[0]) / fabs(x[OV_FACTOR_L] * x[OV_FACTOR_L + 3] * x[OV_FACTOR_L + 5]);
        }
    for (size_t i = 8; i < 16; ++i) {
        double x[P];
        ov_quadric atom;
        ov_quadric_of_atom(l.xyzr + 4 * i, l.options.decay, &atom);
        ov_factor_of_quadric(&atom, x);
        expected += exp(x[0]) / fabs(x[OV_FACTOR_L] * x[OV_FACTOR_L + 3] * x[OV_FACTOR_L + 5]);
    }
    expect_near(mass, expected, 1e-9 * expected, "the mass");
    ov_trial_destroy(&l.trial);
}

/* 4 has eight atoms, 5 none: together they become one, and the gap closes. None have none alone. */
static void gaps_close(void **state) {
    line l;
    const bool both[BEFORE] = {true, false, false, false, false, true};
    const bool none[BEFORE] = {false, false, false, false, false, true};
    line_create(*state, &l);
    test_check(*state, ov_adaptive_rebuild(&l.fit, &l.trial, 2.0, none));
    assert_int_equal(l.trial.count, BEFORE);
    assert_true(is_old(&l, 5, 5));
    test_check(*state, ov_adaptive_rebuild(&l.fit, &l.trial, 0.5, both));
    assert_int_equal(l.trial.count, BEFORE - 1);
    for (size_t i = 1; i < BEFORE - 1; ++i)
        assert_true(is_old(&l, i, i));
    for (size_t i = 0; i < ATOMS; ++i)
        assert_int_equal(l.trial.owner[i], i / 4 < 5 ? i / 4 : 4);
    ov_trial_destroy(&l.trial);
}

/* Ellipsoids without atoms may take up what room there is for more than the atoms. */
static void no_more_than_there_is_room_for(void **state) {
    line l;
    const bool chosen[BEFORE] = {false, true, false, false, false, false};
    line_create(*state, &l);
    l.fit.capacity = BEFORE + 1;
    test_check(*state, ov_adaptive_rebuild(&l.fit, &l.trial, 1e9, chosen));
    assert_int_equal(l.trial.count, BEFORE + 1);
    for (size_t i = 4; i < 8; ++i)
        assert_true(l.trial.owner[i] == 1 || l.trial.owner[i] == BEFORE);
    ov_trial_destroy(&l.trial);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_are_met_again), cmocka_unit_test(near_means_within_reach),
        cmocka_unit_test(atoms_come_back),      cmocka_unit_test(regions_are_merged_anew),
        cmocka_unit_test(gaps_close),           cmocka_unit_test(no_more_than_there_is_room_for),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
