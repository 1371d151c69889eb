/*
 * Who owns which atom after splits and merges (host/model/owner.h), by hand.
 */
#include "model/owner.h"
#include "support.h"

static ov_quadric sphere(double x, double amplitude, double decay) {
    return (ov_quadric){amplitude, {x, 0.0, 0.0}, {decay, 0.0, 0.0, decay, 0.0, decay}};
}

static void log_values(void **state) {
    (void)state;
    const ov_quadric quadric = {3.0, {1.0, -2.0, 0.5}, {2.0, 0.3, -0.2, 1.5, 0.1, 1.0}};
    const double at[3] = {1.5, -1.0, 0.25}; /* z = (0.5, 1, -0.25) */
    const double form = 2.0 * 0.25 + 1.5 + 0.0625 + 2.0 * (0.3 * 0.5 + 0.2 * 0.125 - 0.1 * 0.25);
    expect_near(ov_quadric_log_value(&quadric, at), log(3.0) - form, 1e-12, "ln of the value");
}

/* Ellipsoid 0 was split, and its other half is 2; 1 was not, whatever is nearer to its atom. */
static void splits(void **state) {
    const ov_quadric quadrics[3] = {sphere(-1.0, 1.0, 0.5), sphere(9.0, 1.0, 0.5),
                                    sphere(1.0, 1.0, 0.5)};
    const uint32_t twin[3] = {2, UINT32_MAX, 0};
    const double xyzr[] = {-1.2, 0, 0, 1, 1.4, 0, 0, 1, 0, 0, 0, 1, 1.1, 0, 0, 1};
    uint32_t owner[4] = {0, 0, 0, 1};
    const uint32_t expected[4] = {0, 2, 0, 1};
    test_check(*state, ov_owner_split(*state, xyzr, 4, quadrics, 3, twin, owner));
    assert_memory_equal(owner, expected, sizeof owner);
}

/* All atoms have one half's larger value: the other half, whichever, gets the readiest. One atom
 * alone stays. */
static void splits_leave_no_half_without(void **state) {
    const ov_quadric quadrics[4] = {sphere(-1.0, 1.0, 0.5), sphere(1.0, 1.0, 0.5),
                                    sphere(20.0, 1.0, 0.5), sphere(22.0, 1.0, 0.5)};
    const uint32_t twin[4] = {1, 0, 3, 2};
    for (int side = -1; side <= 1; side += 2) {
        const double xyzr[] = {side * 2.0, 0, 0, 1, side * 0.5, 0, 0, 1,
                               side * 0.9, 0, 0, 1, 20.1,       0, 0, 1};
        uint32_t owner[4] = {0, 0, 0, 2};
        const uint32_t near = side < 0 ? 0 : 1;
        const uint32_t expected[4] = {near, 1 - near, near, 2};
        test_check(*state, ov_owner_split(*state, xyzr, 4, quadrics, 4, twin, owner));
        assert_memory_equal(owner, expected, sizeof owner);
    }
}

/* 0 and 3 of five become one, the others move up; once as a copy and once in place. */
static void merges(void **state) {
    const uint32_t parents[8] = {0, 3, 1, UINT32_MAX, 2, UINT32_MAX, 4, UINT32_MAX};
    const uint32_t before[6] = {4, 3, 2, 1, 0, 3}, expected[6] = {3, 0, 2, 1, 0, 0};
    uint32_t owner[6];
    test_check(*state, ov_owner_merge(*state, parents, 4, 5, before, 6, owner));
    assert_memory_equal(owner, expected, sizeof owner);
    memcpy(owner, before, sizeof owner);
    test_check(*state, ov_owner_merge(*state, parents, 4, 5, owner, 6, owner));
    assert_memory_equal(owner, expected, sizeof owner);
}

/* Atom 1 has drifted away from its ellipsoid, 2 a little, and 3 is all that ellipsoid 1 has. */
static void drifted_atoms_change_hands(void **state) {
    const ov_quadric quadrics[3] = {sphere(0.0, 1.0, 0.5), sphere(4.0, 1.0, 0.5),
                                    sphere(50.0, 9.0, 0.5)};
    const double xyzr[] = {0.2, 0, 0, 1, 3.5, 0, 0, 1, 2.1, 0, 0, 1, 0.1, 0, 0, 1, 49, 0, 0, 1};
    uint32_t owner[5] = {0, 0, 0, 1, 2};
    test_check(*state, ov_owner_tidy(*state, xyzr, 5, quadrics, 3, 0.5, 10.0, owner));
    /* Atom 3 may leave once ellipsoid 1 has another one. */
    const uint32_t expected[5] = {0, 1, 0, 0, 2};
    assert_memory_equal(owner, expected, sizeof owner);
    const uint32_t alone[5] = {0, 0, 0, 0, 2};
    memcpy(owner, alone, sizeof owner);
    owner[1] = 1;
    test_check(*state, ov_owner_tidy(*state, xyzr, 5, quadrics, 3, 1e-9, 10.0, owner));
    const uint32_t kept[5] = {0, 1, 0, 0, 2}; /* no one is that far below */
    assert_memory_equal(owner, kept, sizeof owner);
    const double swapped[] = {0.1, 0, 0, 1, 0.2, 0, 0, 1, 0.3, 0, 0, 1, 0.2, 0, 0, 1, 49, 0, 0, 1};
    const uint32_t lone[5] = {1, 0, 0, 0, 2}; /* the last of ellipsoid 1 stays */
    memcpy(owner, lone, sizeof owner);
    test_check(*state, ov_owner_tidy(*state, swapped, 5, quadrics, 3, 0.5, 10.0, owner));
    assert_memory_equal(owner, lone, sizeof owner);
}

/* The largest value counts, not the nearest centre. */
static void largest(void **state) {
    (void)state;
    const ov_quadric quadrics[3] = {sphere(0.0, 1.0, 0.5), sphere(3.0, 50.0, 0.1),
                                    sphere(4.0, 1.0, 0.5)};
    const double at[3] = {0.5, 0.0, 0.0}, far[3] = {-900.0, 0.0, 0.0};
    assert_int_equal(ov_owner_at(quadrics, 3, at), 1);
    assert_int_equal(ov_owner_at(quadrics, 1, at), 0);
    assert_int_equal(ov_owner_at(quadrics, 3, far), 1); /* where no exponential is above 0 */
}

static int open_context(void **state) {
    return ovoid_context_create((ovoid_context **)state) == OVOID_OK ? 0 : -1;
}

static int close_context(void **state) {
    ovoid_context_destroy((ovoid_context **)state);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(log_values),
        cmocka_unit_test(splits),
        cmocka_unit_test(splits_leave_no_half_without),
        cmocka_unit_test(merges),
        cmocka_unit_test(drifted_atoms_change_hands),
        cmocka_unit_test(largest),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
