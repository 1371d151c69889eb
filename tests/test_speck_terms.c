/*
 * Which terms may have a piece of the surface that the lattice misses, and what is near them
 * (host/mesh/speck_terms.h), against a comparison of all with all.
 */
#include "mesh/speck_terms.h"
#include "support.h"

#include <math.h>

enum { ISOVALUE = 1 };
#define CUTOFF 1e-4
#define SPACING 0.5

/* Beads on a jittered grid of 4 angstrom, where their fields do not join, and atoms in one half of
 * the space between them. */
static size_t scatter(test_random *random, size_t along, double *xyzr, size_t *beads) {
    size_t count = 0;
    for (size_t k = 0; k < along * along * along; ++k, ++count) {
        const size_t at[3] = {k % along, k / along % along, k / (along * along)};
        for (size_t axis = 0; axis < 3; ++axis)
            xyzr[4 * count + axis] = 4.0 * (double)at[axis] + random_uniform(random, -0.2, 0.2);
        xyzr[4 * count + 3] = random_uniform(random, 0.3, 0.6);
    }
    *beads = count;
    for (size_t k = 0; k < *beads; k += 2, ++count) {
        const double size = 4.0 * (double)along;
        xyzr[4 * count] = random_uniform(random, -40.0, -8.0);
        xyzr[4 * count + 1] = random_uniform(random, 0.0, size);
        xyzr[4 * count + 2] = random_uniform(random, 0.0, size);
        xyzr[4 * count + 3] = random_uniform(random, 1.4, 1.8);
    }
    return count;
}

static bool is_near(const ov_body *body, const ov_body *bead) {
    const double reach = ov_body_reach(body, CUTOFF * ISOVALUE);
    double half[3];
    ov_speck_half(bead, ISOVALUE, SPACING, 1.0, half);
    for (int axis = 0; axis < 3; ++axis)
        if (fabs(body->quadric.centre[axis] - bead->quadric.centre[axis]) >=
            half[axis] + reach * body->extent[axis])
            return false;
    return true;
}

static void expect_near_it(const ov_speck_terms *terms, size_t k, const ov_body *bodies,
                           size_t count) {
    size_t at = terms->start[k];
    for (size_t i = 0; i < count; ++i)
        if (is_near(&bodies[i], &bodies[terms->term[k]])) {
            assert_true(at < terms->start[k + 1]);
            assert_int_equal(terms->near_it[at++], i);
        }
    assert_int_equal(at, terms->start[k + 1]);
}

static void all_that_is_near(void **state) {
    const size_t along = test_size(9, 5), most = 2 * along * along * along;
    double *const xyzr = test_alloc(4 * most, sizeof *xyzr);
    ov_body *const bodies = test_alloc(most, sizeof *bodies);
    test_random random = {3};
    ov_speck_terms terms;
    size_t beads = 0;
    const size_t count = scatter(&random, along, xyzr, &beads);
    for (size_t i = 0; i < count; ++i)
        ov_body_of_atom(xyzr + 4 * i, 0.5, &bodies[i]);
    test_check(*state, ov_speck_terms_find(*state, bodies, count, ISOVALUE, CUTOFF * ISOVALUE,
                                           SPACING, &terms));
    assert_int_equal(terms.count, beads);
    for (size_t k = 0; k < terms.count; ++k) {
        assert_true(terms.term[k] < beads);
        if (k > 0)
            assert_true(xyzr[4 * terms.term[k] + 3] <= xyzr[4 * terms.term[k - 1] + 3]);
        expect_near_it(&terms, k, bodies, count);
    }
    ov_speck_terms_destroy(&terms);
    free(xyzr);
    free(bodies);
}

/* Pairs whose fields join are one piece: the larger one's, in every direction. */
static void what_joins_is_one(void **state) {
    enum { PAIRS = 200 };
    double xyzr[8 * PAIRS];
    ov_body bodies[2 * PAIRS];
    test_random random = {4};
    ov_speck_terms terms;
    for (size_t k = 0; k < PAIRS; ++k) {
        const double angle = random_uniform(&random, -3.1, 3.1), height = 2.0 * sin(7.0 * angle);
        const double at[3] = {6.0 * (double)(k % 6), 6.0 * (double)(k / 6 % 6),
                              6.0 * (double)(k / 36)};
        const double step[3] = {cos(angle), sin(angle), height};
        const double length = sqrt(1.0 + height * height);
        for (size_t axis = 0; axis < 3; ++axis) {
            xyzr[8 * k + axis] = at[axis];
            xyzr[8 * k + 4 + axis] = at[axis] + 0.8 * step[axis] / length;
        }
        xyzr[8 * k + 3] = 0.7;
        xyzr[8 * k + 7] = random_uniform(&random, 0.4, 0.6);
    }
    for (size_t i = 0; i < 2 * PAIRS; ++i)
        ov_body_of_atom(xyzr + 4 * i, 0.5, &bodies[i]);
    test_check(*state,
               ov_speck_terms_find(*state, bodies, 2 * PAIRS, ISOVALUE, CUTOFF, SPACING, &terms));
    assert_int_equal(terms.count, PAIRS);
    for (size_t k = 0; k < PAIRS; ++k)
        assert_int_equal(terms.term[k] % 2, 0);
    ov_speck_terms_destroy(&terms);
}

/* The same of all pairs, one by one: which terms are left, in any order. */
static size_t group_of(const size_t *group, size_t i) {
    while (group[i] != i)
        i = group[i];
    return i;
}

static bool are_linked(const ov_body *a, const ov_body *b) {
    static const double between[] = {0.5, 0.3, 0.7, 0.15, 0.85};
    for (size_t k = 0; k < sizeof between / sizeof *between; ++k) {
        double at[3];
        for (int axis = 0; axis < 3; ++axis)
            at[axis] = a->quadric.centre[axis] +
                       between[k] * (b->quadric.centre[axis] - a->quadric.centre[axis]);
        if (exp(ov_quadric_log_value(&a->quadric, at)) +
                exp(ov_quadric_log_value(&b->quadric, at)) <
            ISOVALUE)
            return false;
    }
    return true;
}

static double ball_of(const ov_body *body) {
    return ov_body_reach(body, ISOVALUE) * body->least;
}

static void expect_all_pairs(const ov_body *bodies, size_t count, const ov_speck_terms *terms) {
    size_t *const group = test_alloc(count, sizeof *group), left = 0;
    bool *const dropped = test_alloc(count, sizeof *dropped);
    for (size_t i = 0; i < count; ++i)
        group[i] = i;
    for (size_t i = 0; i < count; ++i)
        for (size_t j = 0; j < i; ++j) {
            const size_t a = group_of(group, i), b = group_of(group, j);
            if (a == b || !(ball_of(&bodies[i]) > 0.0 && ball_of(&bodies[j]) > 0.0) ||
                !are_linked(&bodies[i], &bodies[j]))
                continue;
            const double p = ball_of(&bodies[a]), q = ball_of(&bodies[b]);
            const bool first = p > q || (p == q && a < b);
            group[first ? b : a] = first ? a : b;
        }
    for (size_t i = 0; i < count; ++i) {
        const size_t head = group_of(group, i);
        dropped[head] |= ball_of(&bodies[head]) >= 2.3 * SPACING;
        for (int axis = 0; axis < 3; ++axis)
            dropped[head] |= fabs(bodies[i].quadric.centre[axis] -
                                  bodies[head].quadric.centre[axis]) > 4.0 * SPACING;
    }
    for (size_t i = 0; i < count; ++i) {
        bool found = false;
        for (size_t k = 0; k < terms->count; ++k)
            found |= terms->term[k] == i;
        const bool wanted = group[i] == i && !dropped[i] && ball_of(&bodies[i]) > 0.0;
        assert_true(found == wanted);
        left += wanted;
    }
    assert_int_equal(terms->count, left);
    print_message("%zu of %zu terms are left\n", left, count);
    free(group);
    free(dropped);
}

/* Small and large atoms in any number of places, thinly and densely, and in a long row. */
static void groups_are_those_of_all_pairs(void **state) {
    const size_t count = test_size(900, 200);
    double *const xyzr = test_alloc(4 * count, sizeof *xyzr);
    ov_body *const bodies = test_alloc(count, sizeof *bodies);
    for (int n = 0; n < 6; ++n) {
        const double half = (n < 3 ? 0.8 + 0.5 * n : 0.2) * cbrt(10.0 * (double)count);
        test_random random = {(uint64_t)(20 + n)};
        ov_speck_terms terms;
        for (size_t i = 0; i < count; ++i) {
            for (size_t axis = 0; axis < 3; ++axis)
                xyzr[4 * i + axis] = random_uniform(&random, -half, half);
            if (n >= 3) /* along an axis */
                xyzr[4 * i + (size_t)n - 3] *= 300.0;
            xyzr[4 * i + 3] =
                i % 9 == 0 ? random_uniform(&random, 1.2, 1.8) : random_uniform(&random, 0.0, 1.1);
            ov_body_of_atom(xyzr + 4 * i, 0.5, &bodies[i]);
        }
        test_check(*state,
                   ov_speck_terms_find(*state, bodies, count, ISOVALUE, CUTOFF, SPACING, &terms));
        expect_all_pairs(bodies, count, &terms);
        ov_speck_terms_destroy(&terms);
    }
    free(xyzr);
    free(bodies);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_that_is_near),
        cmocka_unit_test(what_joins_is_one),
        cmocka_unit_test(groups_are_those_of_all_pairs),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
