/*
 * Judging models in boxes, near their changes or where no more than a region counts: what is found
 * there is what judging all of the model finds.
 */
#include "measure/changes.h"
#include "measure/judge.h"
#include "support.h"

/* ---- boxes ----------------------------------------------------------------------------------- */

static ov_quadric ball(double x, double y, double z) {
    const double xyzr[4] = {x, y, z, 1.6};
    ov_quadric quadric;
    ov_quadric_of_atom(xyzr, 0.5, &quadric);
    return quadric;
}

/* Boxes about what differs between two mixtures. */
static size_t boxes_of(ovoid_context *context, const ov_quadric *before, size_t befores,
                       const ov_quadric *now, size_t nows, ov_box box[OV_CHANGES_MOST], bool *few) {
    const ov_change change = {.before = before,
                              .before_count = befores,
                              .now = now,
                              .now_count = nows,
                              .floor = 0.01,
                              .about = 1.0,
                              .room = 2.0};
    size_t count = 99;
    test_check(context, ov_changes_find(context, &change, box, &count, few));
    return count;
}

static void boxes_are_about_changes(void **state) {
    enum { COUNT = 40 };
    ov_quadric before[COUNT], now[COUNT + 1];
    ov_box box[OV_CHANGES_MOST];
    double half[3];
    bool few;
    for (size_t i = 0; i < COUNT; ++i) {
        before[i] = ball(3.0 * (double)i, 0.0, 0.0);
        now[COUNT - 1 - i] = before[i];
    }
    assert_int_equal(boxes_of(*state, before, COUNT, now, COUNT, box, &few), 0);
    assert_true(few);
    now[7].centre[1] += 0.5; /* where it was and where it is now, in one box */
    assert_int_equal(boxes_of(*state, before, COUNT, now, COUNT, box, &few), 1);
    assert_true(ov_quadric_reach(&now[7], 0.01, half));
    expect_near(box[0].low[0], now[7].centre[0] - half[0] - 1.0, 1e-12, "low x");
    expect_near(box[0].low[1], -half[1] - 1.0, 1e-12, "low y");
    expect_near(box[0].high[1], 0.5 + half[1] + 1.0, 1e-12, "high y");
    now[30].amplitude *= 1.5; /* far away: another one */
    assert_int_equal(boxes_of(*state, before, COUNT, now, COUNT, box, &few), 2);
    now[COUNT] = ball(3.0 * (COUNT - 8), 1.0, 0.0); /* added near the first */
    assert_int_equal(boxes_of(*state, before, COUNT, now, COUNT + 1, box, &few), 2);
    assert_int_equal(boxes_of(*state, before, COUNT - 1, before, COUNT, box, &few), 1);
    assert_int_equal(boxes_of(*state, NULL, 0, before, COUNT, box, &few), 1); /* a row of them */
    assert_true(few);
    for (size_t i = 0; i < COUNT; ++i)
        before[i].amplitude = 0.005; /* nowhere as much as counts */
    assert_int_equal(boxes_of(*state, before, COUNT, NULL, 0, box, &few), 0);
    assert_true(few);
}

static void too_many_changes(void **state) {
    enum { COUNT = OV_CHANGES_MOST + 1 };
    ov_quadric *const all = test_alloc(COUNT, sizeof *all);
    ov_box box[OV_CHANGES_MOST];
    bool few;
    for (size_t i = 0; i < COUNT; ++i)
        all[i] = ball(100.0 * (double)i, 0.0, 0.0);
    assert_int_equal(boxes_of(*state, NULL, 0, all, OV_CHANGES_MOST, box, &few), OV_CHANGES_MOST);
    assert_true(few);
    assert_int_equal(boxes_of(*state, NULL, 0, all, COUNT, box, &few), 0);
    assert_false(few);
    free(all);
}

/* ---- spots ----------------------------------------------------------------------------------- */

enum { EACH = 12, ENDS = 7 }; /* atoms of a ring and of an end */
#define LEAST 0.5
#define APART 1.9 /* rings */

static size_t rings(void) {
    return test_size(76, 24);
}

static size_t atoms(void) {
    return rings() * EACH + 2 * ENDS;
}

/* Of a model. */
static size_t gaussians(void) {
    return atoms() + rings() / 4;
}

/* A tube that is closed at both ends: its cavity runs through all of it. */
static void make_atoms(double *xyzr) {
    for (size_t i = 0; i < rings() * EACH; ++i) {
        const double turn = 2.0 * 3.14159265 * ((double)i / EACH + 0.5 * (double)(i / EACH % 2));
        const double at[4] = {APART * (double)(i / EACH), 4.5 * cos(turn), 4.5 * sin(turn), 1.5};
        memcpy(xyzr + 4 * i, at, sizeof at);
    }
    for (size_t i = 0; i < 2 * ENDS; ++i) {
        const double turn = 2.0 * 3.14159265 * (double)(i / 2) / (ENDS - 1),
                     radius = i / 2 < ENDS - 1 ? 2.5 : 0.0;
        const double at[4] = {i % 2 ? APART * (double)(rings() - 1) : 0.0, radius * cos(turn),
                              radius * sin(turn), 1.7};
        memcpy(xyzr + 4 * (rings() * EACH + i), at, sizeof at);
    }
}

/* The atoms, and what makes the cavity smaller all along, which no outer surface shows. */
static void make_model(const double *xyzr, ov_quadric *quadrics) {
    for (size_t i = 0; i < atoms(); ++i)
        ov_quadric_of_atom(xyzr + 4 * i, 0.5, &quadrics[i]);
    for (size_t i = 0; i < rings() / 4; ++i)
        quadrics[atoms() + i] = ball(APART * (double)(4 * i + 2), 2.3, 0.0);
}

/* Makes the tube thicker at an atom, or moves the atom: the cavity stays closed. Returns how many
 * there are. */
static size_t change(test_random *random, size_t i, ov_quadric *quadrics) {
    const double way = random_uniform(random, 0.0, 1.0);
    size_t count = gaussians();
    if (way < 0.4)
        quadrics[i].amplitude *= random_uniform(random, 1.5, 8.0);
    else if (way < 0.8) {
        quadrics[count] = quadrics[i];
        for (size_t k = 1; k < 3; ++k)
            quadrics[count].centre[k] *= random_uniform(random, 1.0, 1.6);
        ++count;
    } else
        for (size_t k = 0; k < 3; ++k)
            quadrics[i].centre[k] += random_uniform(random, -0.2, 0.2);
    return count;
}

static bool has(const ov_spot *spots, size_t count, const ov_spot *one) {
    for (size_t n = 0; n < count; ++n) {
        double square = 0.0;
        for (size_t k = 0; k < 3; ++k)
            square += (spots[n].at[k] - one->at[k]) * (spots[n].at[k] - one->at[k]);
        if (square < 1e-4 && fabs(spots[n].distance - one->distance) < 1e-3)
            return true;
    }
    return false;
}

/* All of one are in the other, those aside that hardly count. */
static void expect_among(const ov_spot *some, size_t count, const ov_spot *all, size_t all_count) {
    for (size_t n = 0; n < count; ++n)
        if (some[n].distance > LEAST + 1e-3 && !has(all, all_count, &some[n]))
            fail_msg("the spot %g off at %g, %g, %g is missing", some[n].distance, some[n].at[0],
                     some[n].at[1], some[n].at[2]);
}

/* Two judges of the same: one knows what it saw before. */
typedef struct judges {
    ov_judge knows, knows_not;
    size_t near, found, known; /* judgements near changes, those with spots, and all of them */
} judges;

static void judge_both(ovoid_context *context, judges *j, const ov_quadric *quadrics,
                       size_t count) {
    ov_judgement judgement, expected;
    ov_spot *spots = NULL, *all = NULL;
    size_t spot_count = 0, all_count = 0;
    bool whole;
    test_check(context, ov_judge_spots_near(&j->knows, quadrics, count, LEAST, 0.0, SIZE_MAX,
                                            &judgement, &spots, &spot_count, &whole));
    j->knows_not.seen.known = false;
    test_check(context, ov_judge_spots(&j->knows_not, quadrics, count, LEAST, 0.0, SIZE_MAX,
                                       &expected, &all, &all_count));
    expect_among(spots, spot_count, all, all_count);
    expect_among(all, all_count, spots, spot_count);
    if (spot_count > 0)
        expect_near(judgement.deviation, expected.deviation, 1e-4, "deviation");
    ++j->known;
    j->near += !whole;
    j->found += !whole && spot_count > 0;
    free(spots);
    free(all);
}

/* Changes at one place after another, and one more at each. */
static void follow(ovoid_context *context, double slack) {
    double *const xyzr = test_alloc(4 * atoms(), sizeof *xyzr);
    ov_quadric *const base = test_alloc(2 * (gaussians() + 1), sizeof *base), *const quadrics =
                                                                                  base +
                                                                                  gaussians() + 1;
    test_random random = {9};
    judges j = {.near = 0};
    make_atoms(xyzr);
    make_model(xyzr, base);
    test_check(context,
               ov_judge_create(context, xyzr, atoms(), 0.5, 1.0, 0.5, (ov_watch){0}, &j.knows));
    test_check(context,
               ov_judge_create(context, xyzr, atoms(), 0.5, 1.0, 0.5, (ov_watch){0}, &j.knows_not));
    j.knows.slack = j.knows_not.slack = slack;
    judge_both(context, &j, base, gaussians());
    assert_true(j.knows.seen.spots.count == 0 && j.knows.seen.hidden_count > 500);
    for (size_t round = 0; round < test_size(10, 3); ++round) {
        const size_t place = (size_t)random_uniform(&random, 0.0, (double)(rings() * EACH - 6));
        memcpy(quadrics, base, (gaussians() + 1) * sizeof *base);
        size_t count = change(&random, place, quadrics);
        judge_both(context, &j, quadrics, count);
        if (count == gaussians())
            count = change(&random, place + 5, quadrics);
        judge_both(context, &j, quadrics, count);
        judge_both(context, &j, base, gaussians());
    }
    print_message("%zu of %zu near changes, %zu of them with spots\n", j.near, j.known, j.found);
    assert_true(2 * j.near > j.known && j.found >= test_size(8, 1));
    free(xyzr);
    free(base);
    ov_judge_destroy(&j.knows);
    ov_judge_destroy(&j.knows_not);
}

static void near_is_what_whole_is(void **state) {
    test_skip_simulated(*state); /* a cavity takes many atoms */
    if (strstr(ovoid_context_device(*state)->platform, "rusticl"))
        skip();        /* it prepares kernels at each launch */
    if (!test_small()) /* a box is too large a share of a short tube */
        follow(*state, 0.0);
    follow(*state, 0.002);
}

/* What was seen of another tolerance, slack or kind of surface, or before a search, is no help. */
static void other_questions(void **state) {
    if (test_small()) /* as above */
        skip();
    double *const xyzr = test_alloc(4 * atoms(), sizeof *xyzr);
    ov_quadric *const quadrics = test_alloc(gaussians() + 1, sizeof *quadrics);
    ov_judge judge;
    ov_judgement judgement;
    bool whole;
    make_atoms(xyzr);
    make_model(xyzr, quadrics);
    test_check(*state,
               ov_judge_create(*state, xyzr, atoms(), 0.5, 1.0, 0.5, (ov_watch){0}, &judge));
    for (int n = 0; n < 8; ++n) {
        ov_spot *spots;
        size_t spot_count;
        judge.slack = n >= 4 ? 0.002 : 0.0;
        if (n == 6)
            ov_judge_begin(&judge);
        judge.whole = n == 7;
        quadrics[100].centre[1] += 0.01;
        test_check(*state, ov_judge_spots_near(&judge, quadrics, gaussians(), n >= 2 ? 0.6 : LEAST,
                                               1.0, 9, &judgement, &spots, &spot_count, &whole));
        print_message("%d: %s, %zu spots\n", n, whole ? "whole" : "near", spot_count);
        assert_true(whole == (n % 2 == 0 || n == 7));
        assert_true((spot_count > 0) == (n == 7));
        free(spots);
    }
    judge.whole = false; /* and where none is found it is looked for everywhere, if need be */
    for (int n = 0; n < 2; ++n) {
        ov_spot *spots;
        size_t spot_count;
        quadrics[100].centre[1] += 0.01;
        test_check(*state, ov_judge_spots(&judge, quadrics, gaussians(), 0.6, 1.0, 9, &judgement,
                                          &spots, &spot_count));
        assert_true(spot_count == 0 && judgement.deviation > 0.05);
        free(spots);
    }
    free(xyzr);
    free(quadrics);
    ov_judge_destroy(&judge);
}

/* ---- a region -------------------------------------------------------------------------------- */

/* A stretch of the tube, from which its cavity leads on both ways, its end, one side of its wall,
 * or a stretch of an open tube, which has no cavity; nothing else counts, however far off it is:
 * for the other judge no more than nearly so, which judges all of it. */
enum { STRETCH, END, SIDE, OPEN, REGIONS };

static void choose_region(judges *j, int kind) {
    const double length = APART * (double)rings();
    const ov_box region = {{kind == END ? -9.0 : 0.3 * length, kind == SIDE ? 3.4 : -12.0, -12.0},
                           {kind == END ? 9.0 : 0.7 * length, 12.0, 12.0}};
    j->knows.region = j->knows_not.region = region;
    j->knows.in_region = j->knows_not.in_region = true;
    j->knows.stray = INFINITY;
    j->knows_not.stray = 1e6;
    j->knows.seen.known = false;
}

/* Changes all along the tube, outwards and, where it is open, inwards. Returns how many there are.
 */
static size_t change_all(test_random *random, int kind, size_t changes, const double *xyzr,
                         ov_quadric *quadrics) {
    size_t count = gaussians();
    make_model(xyzr, quadrics);
    if (kind == OPEN)
        count = rings() * EACH;
    for (size_t n = 0; n < changes; ++n, ++count) {
        const size_t i = (size_t)random_uniform(random, 0.0, (double)(rings() * EACH));
        quadrics[count] = quadrics[i];
        for (size_t k = 1; k < 3; ++k)
            quadrics[count].centre[k] *= random_uniform(random, kind == OPEN ? 0.6 : 1.0, 1.5);
    }
    return count;
}

static void judge_region(ovoid_context *context, int kind) {
    double *const xyzr = test_alloc(4 * atoms(), sizeof *xyzr);
    ov_quadric *const quadrics = test_alloc(gaussians() + 64, sizeof *quadrics);
    const size_t own = kind == OPEN ? rings() * EACH : atoms();
    test_random random = {19};
    judges j = {.near = 0};
    size_t with_spots = 0;
    make_atoms(xyzr);
    test_check(context,
               ov_judge_create(context, xyzr, own, 0.5, 1.0, 0.5, (ov_watch){0}, &j.knows));
    test_check(context,
               ov_judge_create(context, xyzr, own, 0.5, 1.0, 0.5, (ov_watch){0}, &j.knows_not));
    choose_region(&j, kind);
    for (size_t round = 0; round < test_size(8, 3); ++round) {
        const size_t count = change_all(&random, kind, 2 * round, xyzr, quadrics);
        j.knows.seen.known = false; /* not near changes */
        judge_both(context, &j, quadrics, count);
        with_spots += j.knows.seen.spots.count > 0;
        assert_true(j.knows.known.about.triangles < j.knows.mesh->triangles);
        assert_true(j.knows.laid == &j.knows.known.about);
    }
    print_message("%zu of %zu with spots\n", with_spots, j.known);
    assert_true(with_spots > 0 && with_spots < j.known && j.near == 0);
    free(xyzr);
    free(quadrics);
    ov_judge_destroy(&j.knows);
    ov_judge_destroy(&j.knows_not);
}

static void a_region_is_what_whole_is(void **state) {
    test_skip_simulated(*state);
    if (strstr(ovoid_context_device(*state)->platform, "rusticl"))
        skip(); /* as above */
    for (int kind = 0; kind < REGIONS; ++kind)
        judge_region(*state, kind);
}

/* Where one of the two has no surface in the region, all of the model is judged. */
static void nothing_in_the_region(void **state) {
    const double xyzr[8] = {0.0, 0.0, 0.0, 1.5, 12.0, 0.0, 0.0, 1.5};
    const ov_box region = {{-4.0, -4.0, -4.0}, {4.0, 4.0, 4.0}};
    ov_quadric both[2];
    ov_judge judge;
    ov_judgement judgement;
    for (size_t i = 0; i < 2; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, 0.5, &both[i]);
    for (size_t lacks = 0; lacks < 2; ++lacks) { /* the model, or the original, has none there */
        ov_spot *spots;
        size_t spot_count;
        test_check(*state, ov_judge_create(*state, xyzr + 4 * lacks, 2 - lacks, 0.5, 1.0, 0.5,
                                           (ov_watch){0}, &judge));
        judge.in_region = true;
        judge.region = region;
        judge.stray = INFINITY;
        test_check(*state, ov_judge_spots(&judge, both + 1 - lacks, 1 + lacks, LEAST, 1.0, 9,
                                          &judgement, &spots, &spot_count));
        print_message("%zu spots, %g off\n", spot_count, judgement.deviation);
        assert_true(spot_count > 0 && judgement.deviation > 8.0);
        free(spots);
        ov_judge_destroy(&judge);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_are_about_changes),   cmocka_unit_test(too_many_changes),
        cmocka_unit_test(near_is_what_whole_is),     cmocka_unit_test(other_questions),
        cmocka_unit_test(a_region_is_what_whole_is), cmocka_unit_test(nothing_in_the_region),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
