/*
 * The constrained points against a brute-force selection in double: every point of the paper's
 * lattice, every atom.
 */
#include "support.h"

static const ov_sampling no_questions = {0};

typedef struct job {
    const double *xyzr;
    size_t atoms;
    double decay, spacing, padding;
    ov_band band;
} job;

/* phi may differ from the device's by this much: the cut-off, and positions rounded to float. */
static double tolerance_at(const job *j, const ov_lattice *lattice, const double y[3], double *phi,
                           ov_twin_sum gradient[3]) {
    double extent = 0.0, slope = 0.0;
    ov_quadric *const quadrics = test_alloc(j->atoms, sizeof *quadrics);
    for (size_t i = 0; i < j->atoms; ++i)
        ov_quadric_of_atom(j->xyzr + 4 * i, j->decay, &quadrics[i]);
    const ov_twin_sum field = ov_twin_field(quadrics, j->atoms, y);
    ov_twin_gradient(quadrics, j->atoms, y, gradient);
    for (size_t axis = 0; axis < 3; ++axis) {
        extent = fmax(extent, lattice->step[axis] * (double)lattice->size[axis]);
        slope += gradient[axis].scale;
    }
    free(quadrics);
    *phi = field.value;
    return FLT_EPSILON * (3.0 * field.scale + extent * slope) + 1e-7 * (double)j->atoms;
}

/* Lattice index of a sampled position; fails where it is not on the lattice. */
static size_t index_of(const ov_lattice *lattice, const double y[3]) {
    size_t index = 0;
    for (size_t axis = 3; axis-- > 0;) {
        const double step = lattice->step[axis];
        const double extent = step * (double)lattice->size[axis];
        const double i = step > 0.0 ? round((y[axis] - lattice->low[axis]) / step) : 1.0;
        assert_true(i >= 1.0 && i <= (double)lattice->size[axis]);
        expect_near(y[axis], lattice->low[axis] + i * step, 1e-6 * (1.0 + extent),
                    "a lattice coordinate");
        index = index * (size_t)lattice->size[axis] + (size_t)i - 1;
    }
    return index;
}

static void position(const ov_lattice *lattice, size_t index, double y[3]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        const size_t size = (size_t)lattice->size[axis];
        y[axis] = lattice->low[axis] + (double)(index % size + 1) * lattice->step[axis];
        index /= size;
    }
}

/* Whether all three indices of a lattice point, counted from 0, are multiples of step; 0: never. */
static bool is_multiple(const ov_lattice *lattice, size_t index, uint32_t step) {
    bool multiple = step > 0;
    for (size_t axis = 0; axis < 3 && multiple; ++axis) {
        multiple = index % (size_t)lattice->size[axis] % step == 0;
        index /= (size_t)lattice->size[axis];
    }
    return multiple;
}

/* The points of the band, and the guards on either side of it. */
static bool belongs(const ov_band *band, const ov_lattice *lattice, size_t index, double phi) {
    if (phi >= band->low && phi <= band->high)
        return true;
    if (phi > band->high)
        return is_multiple(lattice, index, band->inside_every);
    return phi >= band->outside_low && is_multiple(lattice, index, band->outside_every);
}

/* x_i = a + i (b - a) / N_x with N_x = ceil((b - a) / spacing), at least 1. */
static void expect_lattice(const job *j, const ov_lattice *lattice) {
    for (size_t axis = 0; axis < 3; ++axis) {
        double a = INFINITY, b = -INFINITY;
        for (size_t i = 0; i < j->atoms; ++i) {
            a = fmin(a, j->xyzr[4 * i + axis] - j->padding);
            b = fmax(b, j->xyzr[4 * i + axis] + j->padding);
        }
        const double n = fmax(1.0, ceil((b - a) / j->spacing - 1e-9));
        assert_true((double)lattice->size[axis] == n);
        expect_near(lattice->low[axis], a, 1e-12 * (1.0 + fabs(a)), "a side of the lattice");
        expect_near(lattice->step[axis], (b - a) / n, 1e-12, "a step of the lattice");
    }
}

/* The samples are the band of the lattice, each with its phi and gradient. Returns their number. */
static size_t expect_samples(ovoid_context *context, const job *j) {
    ov_lattice lattice;
    ov_samples samples = {0};
    test_check(context,
               ov_lattice_create(context, j->xyzr, j->atoms, j->spacing, j->padding, &lattice));
    expect_lattice(j, &lattice);
    test_check(context, ov_sample(context, j->xyzr, j->atoms, j->decay, &lattice, j->band,
                                  no_questions, &samples));
    const ov_points *const points = &samples.points;
    const size_t all = (size_t)(lattice.size[0] * lattice.size[1] * lattice.size[2]);
    bool *const kept = test_alloc(all, sizeof *kept);
    double *const xyz = read_places(context, points);
    float *const value = read_floats(context, &samples.value, points->packs * OV_PACK);
    float *const slope = read_floats(context, &samples.gradient, points->packs * 3 * OV_PACK);
    double phi;
    ov_twin_sum gradient[3];
    for (size_t k = 0; k < points->packs * OV_PACK; ++k) {
        const size_t at = k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        const double *const y = xyz + 3 * k;
        if (ov_points_fill(points, k))
            continue;
        const size_t index = index_of(&lattice, y);
        assert_false(kept[index]);
        kept[index] = true;
        const double tolerance = tolerance_at(j, &lattice, y, &phi, gradient);
        expect_near(value[k], phi, tolerance, "phi");
        for (size_t axis = 0; axis < 3; ++axis)
            expect_near(slope[at + axis * OV_PACK], gradient[axis].value,
                        20.0 * (tolerance + FLT_EPSILON * gradient[axis].scale),
                        "a component of phi's gradient");
    }
    size_t wanted = 0;
    for (size_t index = 0; index < all; ++index) {
        double y[3];
        position(&lattice, index, y);
        phi = ov_twin_phi(j->xyzr, j->atoms, j->decay, y);
        const bool is_wanted = belongs(&j->band, &lattice, index, phi);
        wanted += is_wanted;
        if (is_wanted == kept[index])
            continue;
        /* only where rounding decides */
        const double tolerance = tolerance_at(j, &lattice, y, &phi, gradient);
        assert_true(is_wanted != belongs(&j->band, &lattice, index, phi - tolerance) ||
                    is_wanted != belongs(&j->band, &lattice, index, phi + tolerance));
    }
    const size_t count = points->count;
    print_message("%zu of %zu lattice points kept, %zu wanted\n", count, all, wanted);
    free(kept);
    free(xyz);
    free(value);
    free(slope);
    ov_samples_destroy(&samples);
    ov_samples_destroy(&samples);
    return count;
}

static void random_atoms(test_random *random, double *xyzr, size_t atoms, const double half[3]) {
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(random, -half[k], half[k]);
        xyzr[4 * i + 3] = random_uniform(random, 1.0, 2.0);
    }
}

enum { ATOMS = 12 };

static void small_molecule(void **state) {
    double xyzr[4 * ATOMS];
    test_random random = {1};
    random_atoms(&random, xyzr, ATOMS, (const double[3]){3.0, 2.0, 2.5});
    job j = {.xyzr = xyzr,
             .atoms = ATOMS,
             .decay = 0.5,
             .spacing = test_size(70, 110) / 100.0,
             .padding = 2.0};
    const ov_band bands[] = {{.low = 0.0, .high = 2.0},
                             {.low = 0.02, .high = 2.0},
                             {.low = 0.5, .high = 2.5},
                             {.low = -0.5, .high = 1.5}};
    size_t count[4];
    for (size_t n = 0; n < 4; n = test_next(*state, n, 3)) {
        j.band = bands[n];
        count[n] = expect_samples(*state, &j);
    }
    assert_true(count[0] > count[3]);
    if (test_simulated(*state))
        return;
    assert_true(count[1] < count[0]);
    j.decay = 0.9;
    j.spacing = 1.3;
    j.padding = 0.0;
    expect_samples(*state, &j);
}

/* With c = 1 the band reaches down to 0, and every exterior point belongs to it. */
static void exterior_points_are_kept(void **state) {
    const double xyzr[4] = {0.3, 0.2, -0.1, 1.5};
    const double far = test_size(12, 7);
    const job j = {.xyzr = xyzr,
                   .atoms = 1,
                   .decay = 0.5,
                   .spacing = 1.0,
                   .padding = far,
                   .band = {.low = 0.0, .high = 2.0}};
    const job shell = {.xyzr = xyzr,
                       .atoms = 1,
                       .decay = 0.5,
                       .spacing = 1.0,
                       .padding = far,
                       .band = {.low = 1e-6, .high = 2.0}};
    const size_t all = expect_samples(*state, &j), near = expect_samples(*state, &shell);
    assert_true(all > 2 * near);
}

/* More than 128 points along x and more than 64 along z: the lattice is evaluated in pieces, some
 * of them without any atom in reach. */
static void lattice_of_several_pieces(void **state) {
    test_skip_simulated(*state);
    const double half[3] = {test_size(45, 32), test_size(2, 0), test_size(21, 16)};
    double xyzr[4 * ATOMS];
    test_random random = {2};
    random_atoms(&random, xyzr, ATOMS, half);
    for (size_t k = 0; k < 3; ++k) { /* the corners, so that the extent is known */
        xyzr[k] = -half[k];
        xyzr[4 + k] = half[k];
    }
    job j = {.xyzr = xyzr,
             .atoms = ATOMS,
             .decay = 0.5,
             .spacing = 0.5,
             .padding = 1.0,
             .band = {.low = 0.02, .high = 2.0}};
    ov_lattice lattice;
    test_check(*state, ov_lattice_create(*state, xyzr, ATOMS, j.spacing, j.padding, &lattice));
    assert_true(lattice.size[0] > 128 && lattice.size[2] > 64);
    expect_samples(*state, &j);
    if (!test_small()) {
        j.band.low = 0.0;
        expect_samples(*state, &j);
    }
}

/* Pieces that no atom reaches lie outside, and belong to a band that begins at 0. */
static void pieces_without_atoms(void **state) {
    test_skip_simulated(*state);
    const double xyzr[] = {0.0, 0.0, 0.0, 1.7, 0.0, 0.0, 140.0, 1.7};
    job j = {.xyzr = xyzr,
             .atoms = 2,
             .decay = 0.5,
             .spacing = 0.6,
             .padding = 1.0,
             .band = {.low = 0.0, .high = 2.0}};
    const size_t all = expect_samples(*state, &j);
    j.band.low = 0.02;
    assert_true(expect_samples(*state, &j) < all / 10);
}

/* Guards are every n-th point of the lattice, on the side where they are asked for. */
static void guards_on_a_coarser_lattice(void **state) {
    test_skip_simulated(*state);
    double xyzr[4 * ATOMS];
    test_random random = {3};
    random_atoms(&random, xyzr, ATOMS, (const double[3]){3.0, 2.0, 2.5});
    job j = {.xyzr = xyzr,
             .atoms = ATOMS,
             .decay = 0.5,
             .spacing = test_size(50, 130) / 100.0,
             .padding = 3.0,
             .band = {.low = 0.02, .high = 2.0, .outside_low = 1e-4}};
    const size_t bare = expect_samples(*state, &j);
    size_t inside[4] = {bare}, outside[4] = {bare};
    for (uint32_t every = 1; every <= 3; ++every) {
        j.band.inside_every = every;
        j.band.outside_every = 0;
        inside[every] = expect_samples(*state, &j);
        j.band.inside_every = 0;
        j.band.outside_every = every;
        outside[every] = expect_samples(*state, &j);
    }
    assert_true(inside[1] > inside[2] && inside[2] > inside[3] && inside[3] > bare);
    assert_true(outside[1] > outside[2] && outside[2] > outside[3] && outside[3] > bare);
    j.band.inside_every = 2;
    j.band.outside_every = 3;
    assert_int_equal(expect_samples(*state, &j), inside[2] + outside[3] - bare);
    j.band.outside_low = 0.5; /* above the band's low end: nothing is left for guards */
    assert_int_equal(expect_samples(*state, &j), inside[2]);
}

/* Several pieces, their sizes no multiples of the guards' step; and guards of the outside that
 * reach down to 0, where pieces without atoms hold nothing else. */
static void guards_in_pieces(void **state) {
    test_skip_simulated(*state);
    const double xyzr[] = {0.0, 0.0, 0.0, 1.7, 0.0, 0.0, 140.0, 1.7};
    job j = {.xyzr = xyzr,
             .atoms = 2,
             .decay = 0.5,
             .spacing = test_size(6, 11) / 10.0,
             .padding = 1.0,
             .band = {.low = 0.02, .high = 2.0, .inside_every = 3, .outside_every = 7}};
    const size_t all = expect_samples(*state, &j);
    j.band.outside_low = 1e-5;
    assert_true(expect_samples(*state, &j) < all);
}

/* Counts the questions in *user; says stop to the third. */
static bool stop_at_third(uint64_t points, void *user) {
    uint64_t *const asked = user;
    (void)points;
    return ++*asked < 3;
}

/* Guards that reach down to 0 everywhere are counted for what they are, not as whole pieces: the
 * lattice has 5e11 points, and the guards among them are a dozen. */
static void few_guards_need_little_room(void **state) {
    const double xyzr[] = {0.0, 0.0, 0.0, 1.7, 5000.0, 300.0, 300.0, 1.7};
    const ov_band band = {.low = 0.02, .high = 2.0, .outside_every = 4000};
    ov_lattice lattice;
    ov_samples samples = {0};
    uint64_t asked = 0;
    const ov_sampling sampling = {.go_on = stop_at_third, .user = &asked};
    if (test_small())
        skip();
    test_check(*state, ov_lattice_create(*state, xyzr, 2, 0.1, 3.0, &lattice));
    test_refused(*state, ov_sample(*state, xyzr, 2, 0.5, &lattice, band, sampling, &samples),
                 OVOID_ERROR_CANCELLED, "");
    assert_int_equal(asked, 3);
}

static void odd_molecules(void **state) {
    const double one[] = {1.0, 2.0, 3.0, 1.7};
    const double bare[] = {0.0, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.2};
    const double coincident[] = {1.0, 1.0, 1.0, 1.5, 1.0, 1.0, 1.0, 1.5, 1.0, 1.0, 1.0, 1.5};
    const double flat[] = {0.0, 0.0, 5.0, 1.5, 2.0, 1.0, 5.0, 1.6, -1.0, 3.0, 5.0, 1.4};
    const double straight[] = {0.0, 7.0, 5.0, 1.5, 2.5, 7.0, 5.0, 1.6, 6.0, 7.0, 5.0, 1.4};
    const double far[] = {1e5, -2e5, 3e4, 1.5, 1e5 + 2.0, -2e5 - 1.0, 3e4 + 1.0, 1.7};
    const job jobs[] = {
        {bare, 1, 0.5, 0.5, 0.0, {.low = 0.0, .high = 2.0}},
        {flat, 3, 0.5, 0.4, 0.0, {.low = 0.0, .high = 2.0}},
        {straight, 3, 0.5, 0.1, 0.0, {.low = 0.0, .high = 2.0}},
        {one, 1, 0.5, 50.0, 3.0, {.low = 0.0, .high = 2.0}},
        {one, 1, 0.5, 0.6, 3.0, {.low = 0.0, .high = 2.0}},
        {one, 1, 0.3, 0.6, 3.0, {.low = 0.02, .high = 2.0}},
        {bare, 3, 0.5, 0.5, 2.0, {.low = 0.0, .high = 2.0}},
        {coincident, 3, 0.5, 0.6, 3.5, {.low = 0.0, .high = 2.0}},
        {far, 2, 0.5, 0.6, 3.0, {.low = 0.0, .high = 2.0}},
    };
    enum { SHAPES = 4, JOBS = sizeof jobs / sizeof *jobs };
    const size_t tried = test_simulated(*state) ? SHAPES : JOBS; /* lattices without a side */
    for (size_t n = 0; n < tried; ++n)
        expect_samples(*state, &jobs[n]);
}

/* Coincident atoms' phi is that of one, times their number. */
static void band_follows_the_sum(void **state) {
    test_skip_simulated(*state);
    const double two[] = {0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.5};
    const job one = {two, 1, 0.5, 0.5, 3.0, {.low = 0.5, .high = 1.1}},
              both = {two, 2, 0.5, 0.5, 3.0, {.low = 1.0, .high = 2.2}};
    assert_int_equal(expect_samples(*state, &one), expect_samples(*state, &both));
}

static void empty_band_is_an_error(void **state) {
    const double xyzr[4] = {0.0, 0.0, 0.0, 2.0};
    const ov_band band = {.low = 0.0, .high = 2.0}; /* phi at the only lattice point is e^2 */
    ov_lattice lattice;
    ov_samples samples = {0};
    test_check(*state, ov_lattice_create(*state, xyzr, 1, 0.5, 0.0, &lattice));
    assert_int_equal(lattice.size[0] * lattice.size[1] * lattice.size[2], 1);
    test_refused(*state, ov_sample(*state, xyzr, 1, 0.5, &lattice, band, no_questions, &samples),
                 OVOID_ERROR_EMPTY, "no lattice point");
    assert_null(samples.points.order);
    assert_null(samples.value.memory);
}

/* Two atoms five thousand angstrom apart: the space between costs nothing, whether the band ends
 * above 0 or holds all of the outside. What would cost hours is refused. */
static void empty_space_between_atoms(void **state) {
    const double xyzr[] = {0.0, 0.0, 0.0, 1.7, 5000.0, 300.0, 300.0, 1.7};
    const ov_band shell = {.low = 0.02, .high = 2.0}, everything = {.low = 0.0, .high = 2.0};
    ov_lattice lattice;
    ov_samples samples = {0};
    if (test_small())
        skip();
    test_check(*state, ov_lattice_create(*state, xyzr, 2, 0.5, 3.0, &lattice));
    test_check(*state, ov_sample(*state, xyzr, 2, 0.5, &lattice, shell, no_questions, &samples));
    const job one = {xyzr, 1, 0.5, 0.5, 3.0, {.low = 0.02, .high = 2.0}};
    const size_t single = expect_samples(*state, &one), both = samples.points.count;
    /* the steps differ a little from 0.5, and so does the number of points about an atom */
    assert_true(both > 1.9 * (double)single && both < 2.1 * (double)single);
    ov_samples_destroy(&samples);
    test_check(*state,
               ov_sample(*state, xyzr, 2, 0.5, &lattice, everything, no_questions, &samples));
    assert_true(samples.points.count > both && samples.points.count < 100000);
    ov_samples_destroy(&samples);
    test_check(*state, ov_lattice_create(*state, xyzr, 2, 1e-4, 3.0, &lattice));
    uint64_t asked = 0; /* the refusal comes before the first piece */
    const ov_sampling sampling = {.go_on = stop_at_third, .user = &asked};
    test_refused(*state, ov_sample(*state, xyzr, 2, 0.5, &lattice, everything, sampling, &samples),
                 OVOID_ERROR_LIMIT, "points at a spacing of 0.0001 angstrom, more than 2e+10; use");
    assert_int_equal(asked, 0);
    test_refused(*state, ov_lattice_create(*state, xyzr, 2, 1e-9, 3.0, &lattice), OVOID_ERROR_LIMIT,
                 "points along an axis");
}

/* Atoms as far apart as coordinates can be, one of them by itself: as many points about each as
 * about one that is alone. */
static void atoms_at_the_ends_of_space(void **state) {
    test_skip_simulated(*state); /* the host places the pieces */
    const double xyzr[] = {-1e6, 1e6, -1e6, 1.7, 1e6, -1e6, 1e6, 1.7, 1e6, -1e6, 1e6 - 1.4, 1.7};
    const ov_band shell = {.low = 0.02, .high = 2.0};
    const job one = {xyzr, 1, 0.5, 0.7, 3.0, {.low = 0.02, .high = 2.0}},
              pair = {xyzr + 4, 2, 0.5, 0.7, 3.0, {.low = 0.02, .high = 2.0}};
    ov_lattice lattice;
    ov_samples samples = {0};
    test_check(*state, ov_lattice_create(*state, xyzr, 3, 0.7, 3.0, &lattice));
    test_check(*state, ov_sample(*state, xyzr, 3, 0.5, &lattice, shell, no_questions, &samples));
    const double wanted = (double)(expect_samples(*state, &one) + expect_samples(*state, &pair));
    assert_true(samples.points.count > 0.9 * wanted && samples.points.count < 1.1 * wanted);
    ov_samples_destroy(&samples);
}

/* Sampling can be stopped between pieces, and leaves nothing behind. */
static void sampling_can_be_stopped(void **state) {
    test_skip_simulated(*state); /* the host asks */
    const double xyzr[] = {0.0, 0.0, 0.0, 1.7, 0.0, 0.0, 140.0, 1.7};
    uint64_t asked = 0;
    const ov_sampling sampling = {.go_on = stop_at_third, .user = &asked};
    const ov_band band = {.low = 0.0, .high = 2.0};
    ov_lattice lattice;
    ov_samples samples = {0};
    test_check(*state, ov_lattice_create(*state, xyzr, 2, 0.6, 1.0, &lattice));
    assert_true(lattice.size[2] > 2 * 64); /* at least three pieces */
    test_refused(*state, ov_sample(*state, xyzr, 2, 0.5, &lattice, band, sampling, &samples),
                 OVOID_ERROR_CANCELLED, "");
    assert_int_equal(asked, 3);
    assert_null(samples.points.order);
}

/* ---- large structures --------------------------------------------------------------------- */

/* Molecules a long way apart: phi and its gradient at the samples are as good as anywhere. */
static void samples_of_a_wide_structure(void **state) {
    enum { MOLECULES = 3, OWN = 5, ALL = MOLECULES * OWN };
    const double far = 40000.0, spacing = 0.9, padding = 1.5;
    const ov_band band = {.low = 0.1, .high = 2.0, .inside_every = 2};
    double xyzr[4 * ALL], worst = 0.0, worst_slope = 0.0;
    test_random random = {70};
    ov_lattice lattice;
    ov_samples samples = {0};
    test_skip_simulated(*state);
    random_atoms(&random, xyzr, ALL, (const double[3]){2.0, 2.0, 2.0});
    for (size_t i = 0; i < ALL; ++i)
        xyzr[4 * i] += far * ((double)(i / OWN) - 1.0);
    test_check(*state, ov_lattice_create(*state, xyzr, ALL, spacing, padding, &lattice));
    test_check(*state, ov_sample(*state, xyzr, ALL, 0.5, &lattice, band, no_questions, &samples));
    const size_t all = samples.points.packs * OV_PACK;
    double *const xyz = read_places(*state, &samples.points);
    float *const value = read_floats(*state, &samples.value, all);
    float *const slope = read_floats(*state, &samples.gradient, 3 * all);
    assert_true(samples.points.count > 300);
    for (size_t k = 0; k < all; ++k) {
        const float *const g = slope + k / OV_PACK * (3 * OV_PACK) + k % OV_PACK;
        const double phi = ov_twin_phi(xyzr, ALL, 0.5, xyz + 3 * k);
        double off = 0.0, length = 0.0;
        for (size_t axis = 0; axis < 3; ++axis) {
            double wanted = 0.0;
            for (size_t i = 0; i < ALL; ++i)
                wanted -= (xyz[3 * k + axis] - xyzr[4 * i + axis]) *
                          ov_twin_phi(xyzr + 4 * i, 1, 0.5, xyz + 3 * k);
            off += pow(g[axis * OV_PACK] - wanted, 2.0);
            length += wanted * wanted;
        }
        worst = fmax(worst, fabs(value[k] - phi) / phi);
        worst_slope = fmax(worst_slope, sqrt(off) / fmax(sqrt(length), phi));
    }
    print_message("largest relative errors %.2g, gradient %.2g\n", worst, worst_slope);
    assert_true(worst < 3e-6 && worst_slope < 6e-6);
    free(xyz);
    free(value);
    free(slope);
    ov_samples_destroy(&samples);
}

/* Lists are made slice by slice: a device whose buffers hold the samples, and not all pairs of them
 * with atoms, suffices. */
static void lists_of_samples_need_little_room(void **state) {
    enum { MANY = 2500 };
    const ov_band band = {.low = 1e-3, .high = 1e30};
    test_random random = {71};
    ovoid_context *context = NULL;
    ov_device *device = NULL;
    ov_lattice lattice;
    ov_samples samples = {0};
    ov_terms terms = {0};
    ov_lists lists = {.packs_only = true};
    test_skip_simulated(*state);
    if (test_small())
        skip();
    double *const xyzr = test_alloc(4 * MANY, sizeof *xyzr);
    assert_int_equal(ovoid_context_create(&context), OVOID_OK);
    test_check(context, ovoid_context_open_device(context, NULL));
    test_check(context, ov_device_get(context, &device));
    random_atoms(&random, xyzr, MANY, (const double[3]){14.0, 14.0, 14.0});
    test_check(context, ov_lattice_create(context, xyzr, MANY, 0.42, 3.0, &lattice));
    device->info.max_allocation = (uint64_t)8 << 20;
    test_check(context,
               ov_sample(context, xyzr, MANY, 0.5, &lattice, band, no_questions, &samples));
    assert_true(samples.points.packs > 1 << 14); /* more than a slice */
    /* all at once they would not have room */
    ov_quadric *const quadrics = test_alloc(MANY, sizeof *quadrics);
    for (size_t i = 0; i < MANY; ++i)
        ov_quadric_of_atom(xyzr + 4 * i, 0.5, &quadrics[i]);
    test_check(context, ov_terms_set(context, &terms, quadrics, MANY, samples.points.origin,
                                     OV_TARGET_CUTOFF));
    test_refused(context, ov_lists_build(context, &lists, &samples.points, &terms, 0.0),
                 OVOID_ERROR_LIMIT, "bytes");
    /* and each slice has what belongs to it */
    const size_t all = samples.points.packs * OV_PACK;
    double *const xyz = read_places(context, &samples.points);
    float *const value = read_floats(context, &samples.value, all);
    for (size_t k = 0; k < all; k += 1009) {
        const double phi = ov_twin_phi(xyzr, MANY, 0.5, xyz + 3 * k);
        expect_near(value[k], phi, 3e-6 * phi + 1e-7 * MANY, "phi");
    }
    free(xyz);
    free(value);
    free(quadrics);
    free(xyzr);
    ov_terms_destroy(&terms);
    ov_lists_destroy(&lists);
    ov_samples_destroy(&samples);
    ovoid_context_destroy(&context);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(small_molecule),
        cmocka_unit_test(exterior_points_are_kept),
        cmocka_unit_test(lattice_of_several_pieces),
        cmocka_unit_test(pieces_without_atoms),
        cmocka_unit_test(guards_on_a_coarser_lattice),
        cmocka_unit_test(guards_in_pieces),
        cmocka_unit_test(few_guards_need_little_room),
        cmocka_unit_test(odd_molecules),
        cmocka_unit_test(band_follows_the_sum),
        cmocka_unit_test(empty_band_is_an_error),
        cmocka_unit_test(empty_space_between_atoms),
        cmocka_unit_test(atoms_at_the_ends_of_space),
        cmocka_unit_test(sampling_can_be_stopped),
        cmocka_unit_test(samples_of_a_wide_structure),
        cmocka_unit_test(lists_of_samples_need_little_room),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
