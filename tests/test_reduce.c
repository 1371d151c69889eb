/* Mixture reduction: what merges keep, what they cost, which come first, and the cuts. */
#include "mixture/component.h"
#include "mixture/reduce.h"
#include "mixture/start_field.h"
#include "model/ellipsoid.h"
#include "neighbours/neighbours.h"
#include "support.h"

#define PI 3.14159265358979323846
#define DECAY 0.5

enum { SMALL = 60 };

static const ov_merge_cost costs[] = {OV_MERGE_L2, OV_MERGE_L2_PER_MASS, OV_MERGE_RUNNALLS};
enum { COSTS = sizeof costs / sizeof costs[0] };

static int open_context(void **state) {
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK)
        return -1;
    *state = context;
    return 0;
}

static int close_context(void **state) {
    ovoid_context *context = *state;
    ovoid_context_destroy(&context);
    return 0;
}

/* ---- starts ------------------------------------------------------------------------------- */

static void random_gaussians(uint64_t seed, model_kind kind, double half, ov_quadric *quadrics,
                             size_t count) {
    test_random random = {seed};
    ovoid_ellipsoid *ellipsoids = test_alloc(count, sizeof *ellipsoids);
    random_ellipsoids(&random, kind, half, ellipsoids, count);
    for (size_t k = 0; k < count; ++k)
        ov_quadric_of_ellipsoid(ellipsoids + k, quadrics + k);
    free(ellipsoids);
}

static void random_atoms(uint64_t seed, double half, double centre, ov_quadric *quadrics,
                         size_t count) {
    test_random random = {seed};
    for (size_t k = 0; k < count; ++k) {
        double xyzr[4];
        for (int axis = 0; axis < 3; ++axis)
            xyzr[axis] = centre + random_uniform(&random, -half, half);
        xyzr[3] = random_uniform(&random, 1.0, 2.0);
        ov_quadric_of_atom(xyzr, DECAY, quadrics + k);
    }
}

/* ---- moments, by another way -------------------------------------------------------------- */

typedef struct moments {
    double mass, first[3], second[6]; /* integrals of 1, x, x x^T over the Gaussians, about 0 */
} moments;

static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};

static double determinant(const double a[6]) {
    return a[0] * (a[3] * a[5] - a[4] * a[4]) - a[1] * (a[1] * a[5] - a[4] * a[2]) +
           a[2] * (a[1] * a[4] - a[3] * a[2]);
}

static void adjugate(const double a[6], double inverse[6]) {
    inverse[0] = a[3] * a[5] - a[4] * a[4];
    inverse[1] = a[2] * a[4] - a[1] * a[5];
    inverse[2] = a[1] * a[4] - a[2] * a[3];
    inverse[3] = a[0] * a[5] - a[2] * a[2];
    inverse[4] = a[1] * a[2] - a[0] * a[4];
    inverse[5] = a[0] * a[3] - a[1] * a[1];
}

static void add_moments(const ov_quadric *q, moments *sum) {
    double inverse[6];
    adjugate(q->a, inverse);
    const double mass = q->amplitude * pow(PI, 1.5) / sqrt(determinant(q->a));
    sum->mass += mass;
    for (int k = 0; k < 3; ++k)
        sum->first[k] += mass * q->centre[k];
    for (int k = 0; k < 6; ++k)
        sum->second[k] += mass * (q->centre[row[k]] * q->centre[column[k]] +
                                  0.5 * inverse[k] / determinant(q->a));
}

static void expect_moments(const moments *got, const moments *wanted, double tolerance) {
    expect_near(got->mass / wanted->mass, 1.0, tolerance, "the mass");
    const double spread = (wanted->second[0] + wanted->second[3] + wanted->second[5]);
    for (int k = 0; k < 3; ++k)
        expect_near(got->first[k], wanted->first[k], tolerance * sqrt(spread * wanted->mass),
                    "a first moment");
    for (int k = 0; k < 6; ++k)
        expect_near(got->second[k], wanted->second[k], tolerance * spread, "a second moment");
}

static ov_reduction *reduced(ovoid_context *context, const ov_quadric *start, size_t count,
                             size_t down_to, ov_merge_cost cost, double reach, double inside) {
    ov_reduction *reduction = NULL;
    const ov_reduction_options options = {.cost = cost, .reach = reach, .inside = inside};
    test_check(context, ov_reduction_create(context, start, count, down_to, &options, &reduction));
    assert_int_equal(ov_reduction_most(reduction), count);
    assert_int_equal(ov_reduction_least(reduction), down_to < count ? down_to : count);
    return reduction;
}

static void a_merge_keeps_mass_mean_and_covariance(void **state) {
    for (uint64_t n = 0; n < 100; ++n) {
        ov_quadric pair[2], one;
        random_gaussians(n, MODEL_RANDOM, 2.0, pair, 2);
        ov_reduction *reduction = reduced(*state, pair, 2, 1, costs[n % COSTS], 5.0, 0.0);
        test_check(*state, ov_reduction_cut(*state, reduction, 1, &one, NULL));
        moments wanted = {0}, got = {0};
        add_moments(pair, &wanted);
        add_moments(pair + 1, &wanted);
        add_moments(&one, &got);
        expect_moments(&got, &wanted, 1e-12);
        ov_reduction_destroy(&reduction);
        assert_null(reduction);
    }
}

/* ---- costs against sums over a lattice ---------------------------------------------------- */

static double value_at(const ov_quadric *q, const double x[3]) {
    double exponent = 0.0;
    for (int k = 0; k < 6; ++k)
        exponent += (row[k] == column[k] ? 1.0 : 2.0) * q->a[k] * (x[row[k]] - q->centre[row[k]]) *
                    (x[column[k]] - q->centre[column[k]]);
    return q->amplitude * exp(-exponent);
}

/* Trapezoid sums of Gaussians are exact but for terms like exp(-(pi / spacing)^2 / decay). L2: of
 * the squared difference. Runnalls: his bound is the mass-weighted sum of the two divergences
 * integral g ln(g / m) of the normalised Gaussians from the merged one. */
static double cost_by_quadrature(ov_merge_cost cost, const ov_quadric pair[2],
                                 const ov_quadric *merged) {
    const double half = 12.0, spacing = 0.25;
    const int steps = (int)(half / spacing);
    double sum = 0.0, mass[3];
    for (int k = 0; k < 3; ++k) {
        const ov_quadric *q = k < 2 ? pair + k : merged;
        mass[k] = q->amplitude * pow(PI, 1.5) / sqrt(determinant(q->a));
    }
    for (int i = -steps; i <= steps; ++i)
        for (int j = -steps; j <= steps; ++j)
            for (int k = -steps; k <= steps; ++k) {
                const double x[3] = {i * spacing, j * spacing, k * spacing};
                const double g[2] = {value_at(pair, x), value_at(pair + 1, x)};
                const double m = value_at(merged, x);
                if (cost != OV_MERGE_RUNNALLS)
                    sum += (g[0] + g[1] - m) * (g[0] + g[1] - m);
                else
                    for (int p = 0; p < 2; ++p)
                        if (g[p] > 1e-200)
                            sum += g[p] * log(g[p] / mass[p] * mass[2] / m);
            }
    sum *= spacing * spacing * spacing;
    return cost == OV_MERGE_L2_PER_MASS ? sum / mass[2] : sum;
}

static void costs_equal_quadrature(void **state) {
    const size_t rounds = test_size(12, 3);
    for (size_t n = 0; n < rounds; ++n) {
        test_random random = {100 + n};
        ovoid_ellipsoid ellipsoids[2];
        ov_quadric pair[2], one;
        random_ellipsoids(&random, MODEL_RANDOM, 1.5, ellipsoids, 2);
        for (int p = 0; p < 2; ++p) {
            for (int k = 0; k < 3; ++k)
                ellipsoids[p].decay[k] = random_uniform(&random, 0.2, 1.5);
            ov_quadric_of_ellipsoid(ellipsoids + p, pair + p);
        }
        ov_reduction *reduction = reduced(*state, pair, 2, 1, costs[n % COSTS], 5.0, 0.0);
        test_check(*state, ov_reduction_cut(*state, reduction, 1, &one, NULL));
        const double wanted = cost_by_quadrature(costs[n % COSTS], pair, &one);
        assert_true(wanted > 0.0);
        expect_near(ov_reduction_cost(reduction, 1) / wanted, 1.0, 1e-9, "a cost over quadrature");
        assert_true(ov_reduction_cost(reduction, 2) == 0.0);
        assert_true(ov_reduction_cost(reduction, 0) == 0.0);
        ov_reduction_destroy(&reduction);
    }
}

/* ---- the order of merges ------------------------------------------------------------------ */

typedef struct exhaustive {
    ov_component *nodes;
    bool *alive;
    uint32_t *owner; /* of each Gaussian of the start: a node */
    size_t nodes_count;
} exhaustive;

static double distance2(const double a[3], const double b[3]) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k)
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

/* The cheapest of all pairs within reach; of equals that whose younger, then older is lowest. */
static bool cheapest_pair(const exhaustive *e, const ov_reduction_options *options, double reach,
                          const ov_start_field *field, size_t *p, size_t *q, double *cost) {
    bool found = false;
    for (size_t j = 0; j < e->nodes_count; ++j)
        for (size_t i = 0; i < j; ++i) {
            if (!e->alive[i] || !e->alive[j] ||
                distance2(e->nodes[i].mean, e->nodes[j].mean) > reach * reach)
                continue;
            double c = ov_component_cost(options->cost, e->nodes + i, e->nodes + j), mean[3];
            ov_component_mean(e->nodes + i, e->nodes + j, mean);
            if (options->inside > 0.0)
                c /= 1.0 + pow(ov_start_field_at(field, mean) / options->inside, 2.0);
            if (!found || c < *cost) {
                found = true;
                *cost = c;
                *p = i;
                *q = j;
            }
        }
    return found;
}

/* Holds every cut of the reduction to a search through all pairs. */
static void expect_exhaustive(ovoid_context *context, const ov_quadric *start, size_t count,
                              const ov_reduction_options *options) {
    ov_reduction *reduction =
        reduced(context, start, count, 1, options->cost, options->reach, options->inside);
    exhaustive e = {.nodes = test_alloc(2 * count, sizeof *e.nodes),
                    .alive = test_alloc(2 * count, sizeof *e.alive),
                    .owner = test_alloc(count, sizeof *e.owner),
                    .nodes_count = count};
    ov_quadric *cut = test_alloc(count, sizeof *cut);
    uint32_t *owner = test_alloc(count, sizeof *owner), *place = test_alloc(2 * count, 4);
    for (size_t k = 0; k < count; ++k) {
        assert_true(ov_component_of_quadric(start + k, e.nodes + k));
        e.alive[k] = true;
        e.owner[k] = (uint32_t)k;
    }
    ov_start_field field = {0};
    if (options->inside > 0.0)
        test_check(context, ov_start_field_create(context, start, e.nodes, count,
                                                  2e-3 * options->inside, &field));
    double reach = options->reach;
    for (size_t left = count - 1; left >= 1; --left) {
        size_t p = 0, q = 0;
        double cost = 0.0;
        while (!cheapest_pair(&e, options, reach, &field, &p, &q, &cost))
            reach *= 2.0;
        ov_component_merge(e.nodes + p, e.nodes + q, e.nodes + e.nodes_count);
        e.alive[p] = e.alive[q] = false;
        e.alive[e.nodes_count] = true;
        uint32_t next = 0;
        for (size_t k = 0; k <= e.nodes_count; ++k)
            place[k] = e.alive[k] ? next++ : UINT32_MAX;
        test_check(context, ov_reduction_cut(context, reduction, left, cut, owner));
        assert_true(ov_reduction_cost(reduction, left) == cost);
        for (size_t k = 0; k < count; ++k) {
            if (e.owner[k] == p || e.owner[k] == q)
                e.owner[k] = (uint32_t)e.nodes_count;
            assert_int_equal(owner[k], place[e.owner[k]]);
        }
        ++e.nodes_count;
    }
    ov_start_field_destroy(&field);
    free(e.nodes);
    free(e.alive);
    free(e.owner);
    free(cut);
    free(owner);
    free(place);
    ov_reduction_destroy(&reduction);
}

static void merges_are_those_of_an_exhaustive_search(void **state) {
    static const double reaches[] = {1.5, 5.0, 100.0};
    for (int n = 0; n < COSTS; ++n)
        for (int inside = 0; inside < 2; ++inside)
            for (int k = 0; k < 3; ++k) {
                ov_quadric start[SMALL];
                random_atoms((uint64_t)(10 * n + k), 5.0, 100.0, start, SMALL);
                const ov_reduction_options options = {costs[n], reaches[k], inside ? 6.0 : 0.0};
                expect_exhaustive(*state, start, SMALL, &options);
                random_gaussians((uint64_t)(10 * n + k), MODEL_RANDOM, 5.0, start, SMALL);
                expect_exhaustive(*state, start, SMALL, &options);
            }
}

/* A cubic lattice of equal atoms, out of order: nearly all pairs cost the same as another. */
static void equal_costs_are_taken_by_index(void **state) {
    ov_quadric start[64];
    for (int k = 0; k < 64; ++k) {
        const int cell = k * 37 % 64;
        const double xyzr[4] = {cell % 4 * 2.0, cell / 4 % 4 * 2.0, cell / 16 * 2.0, 1.5};
        ov_quadric_of_atom(xyzr, DECAY, start + k);
    }
    for (int n = 0; n < COSTS; ++n) {
        const ov_reduction_options options = {costs[n], 5.0, 0.0};
        expect_exhaustive(*state, start, 64, &options);
    }
}

/* An atom with six equal neighbours, of which those of lowest index are found last. */
static void the_first_of_equal_neighbours_is_taken(void **state) {
    static const double at[7][3] = {{0, 0, 2},  {0, 2, 0},  {2, 0, 0}, {-2, 0, 0},
                                    {0, -2, 0}, {0, 0, -2}, {0, 0, 0}};
    ov_quadric start[7];
    for (int k = 0; k < 7; ++k) {
        const double xyzr[4] = {at[k][0], at[k][1], at[k][2], 1.5};
        ov_quadric_of_atom(xyzr, DECAY, start + k);
    }
    for (int n = 0; n < COSTS; ++n) {
        const ov_reduction_options options = {costs[n], 2.5, 0.0};
        expect_exhaustive(*state, start, 7, &options);
    }
}

/* Deep inside, a merge counts less: of two equal pairs, the one within a wide Gaussian goes first.
 */
static void merges_inside_come_first(void **state) {
    ov_quadric start[5];
    for (int k = 0; k < 4; ++k) {
        const double xyzr[4] = {k < 2 ? 40.0 : 0.0, 0.0, k % 2, 1.5};
        ov_quadric_of_atom(xyzr, DECAY, start + k);
    }
    const double wide[4] = {0.0, 0.0, 0.0, 12.0};
    ov_quadric_of_atom(wide, 0.02, start + 4);
    ov_quadric cut[4];
    uint32_t owner[5];
    for (int inside = 0; inside < 2; ++inside) {
        ov_reduction *reduction =
            reduced(*state, start, 5, 4, OV_MERGE_L2, 5.0, inside ? 6.0 : 0.0);
        test_check(*state, ov_reduction_cut(*state, reduction, 4, cut, owner));
        assert_true((owner[0] == owner[1]) == !inside);
        assert_true((owner[2] == owner[3]) == inside);
        ov_reduction_destroy(&reduction);
    }
}

/* The field of 400 Gaussians about -50, between and around them. */
static void expect_field(ovoid_context *context, const ov_quadric *start, double largest,
                         double typical) {
    enum { COUNT = 400 };
    const int samples = 2000;
    ov_component nodes[COUNT];
    for (int k = 0; k < COUNT; ++k)
        assert_true(ov_component_of_quadric(start + k, nodes + k));
    ov_start_field field;
    test_check(context, ov_start_field_create(context, start, nodes, COUNT, 1e-3, &field));
    test_random random = {9};
    double worst = 0.0, squares = 0.0;
    for (int n = 0; n < samples; ++n) {
        double x[3], wanted = 0.0;
        for (int k = 0; k < 3; ++k)
            x[k] = random_uniform(&random, -64.0, -36.0);
        for (int k = 0; k < COUNT; ++k)
            wanted += value_at(start + k, x);
        const double got = ov_start_field_at(&field, x),
                     error = fabs(got - wanted) / (1.0 + wanted);
        assert_true(got <= field.largest);
        worst = fmax(worst, error);
        squares += error * error;
    }
    expect_near(worst, 0.0, largest, "the largest error of the interpolated field");
    expect_near(sqrt(squares / samples), 0.0, typical, "its root mean square error");
    ov_start_field_destroy(&field);
}

static void the_starts_field_is_interpolated(void **state) {
    ov_quadric start[400];
    random_atoms(8, 8.0, -50.0, start, 400);
    expect_field(*state, start, 0.15, 0.03);
    random_gaussians(8, MODEL_RANDOM, 8.0, start, 400); /* oblique ones */
    for (int k = 0; k < 400; ++k)
        for (int axis = 0; axis < 3; ++axis)
            start[k].centre[axis] -= 50.0;
    expect_field(*state, start, 0.2, 0.03); /* some are narrower than the average */
}

/* ---- cuts --------------------------------------------------------------------------------- */

static void expect_consistent(ovoid_context *context, const ov_reduction *reduction,
                              const ov_quadric *start, size_t count, double tolerance) {
    const size_t most = ov_reduction_most(reduction);
    ov_quadric *cut = test_alloc(count, sizeof *cut);
    uint32_t *owner = test_alloc(most, sizeof *owner);
    moments *wanted = test_alloc(count, sizeof *wanted);
    test_check(context, ov_reduction_cut(context, reduction, count, cut, owner));
    for (size_t k = 0; k < most; ++k) {
        assert_in_range(owner[k], 0, count - 1);
        add_moments(start + k, wanted + owner[k]);
    }
    for (size_t k = 0; k < count; ++k) {
        assert_true(wanted[k].mass > 0.0); /* everyone owns some */
        moments got = {0};
        add_moments(cut + k, &got);
        expect_moments(&got, wanted + k, tolerance);
    }
    free(cut);
    free(owner);
    free(wanted);
}

static void cuts_keep_the_moments_of_what_they_took_in(void **state) {
    enum { COUNT = 3000, LEAST = 7 };
    ov_quadric *start = test_alloc(COUNT, sizeof *start), *cut = test_alloc(COUNT, sizeof *cut);
    random_atoms(11, 15.0, 0.0, start, COUNT);
    ov_reduction *reduction = reduced(*state, start, COUNT, LEAST, OV_MERGE_L2, 5.0, 6.0);
    static const size_t counts[] = {COUNT, COUNT - 1, 2000, 777, 100, LEAST + 1, LEAST};
    for (size_t k = 0; k < sizeof counts / sizeof counts[0]; ++k)
        expect_consistent(*state, reduction, start, counts[k], 1e-10);
    test_check(*state, ov_reduction_cut(*state, reduction, COUNT, cut, NULL));
    assert_memory_equal(cut, start, COUNT * sizeof *start);
    ovoid_context *context = *state;
    test_refused(context, ov_reduction_cut(context, reduction, LEAST - 1, cut, NULL),
                 OVOID_ERROR_ARGUMENT, "no state of 6");
    test_refused(context, ov_reduction_cut(context, reduction, COUNT + 1, cut, NULL),
                 OVOID_ERROR_ARGUMENT, "no state of 3001");
    ov_reduction_destroy(&reduction);
    free(start);
    free(cut);
}

static void two_runs_give_the_same_bits(void **state) {
    enum { COUNT = 2000, LEFT = 90 };
    ov_quadric *start = test_alloc(COUNT, sizeof *start), *cut = test_alloc(2 * LEFT, sizeof *cut);
    random_atoms(12, 14.0, 3.0, start, COUNT);
    double cost[2];
    for (int k = 0; k < 2; ++k) {
        ov_reduction *reduction = reduced(*state, start, COUNT, LEFT, OV_MERGE_RUNNALLS, 5.0, 6.0);
        test_check(*state, ov_reduction_cut(*state, reduction, LEFT, cut + k * LEFT, NULL));
        cost[k] = ov_reduction_cost(reduction, LEFT);
        ov_reduction_destroy(&reduction);
    }
    assert_memory_equal(cut, cut + LEFT, LEFT * sizeof *cut);
    assert_true(cost[0] == cost[1]);
    free(start);
    free(cut);
}

/* ---- difficult starts --------------------------------------------------------------------- */

/* All finite, positive definite, and of the start's moments. */
static void expect_sound(ovoid_context *context, const ov_quadric *start, size_t count,
                         double tolerance) {
    for (int n = 0; n < COSTS; ++n)
        for (int inside = 0; inside < 2; ++inside) {
            ov_reduction *reduction =
                reduced(context, start, count, 1, costs[n], 5.0, inside ? 6.0 : 0.0);
            for (size_t left = count; left >= 1; left = left > 64 ? left / 2 : left - 1) {
                assert_true(ov_reduction_cost(reduction, left) >= 0.0);
                assert_true(isfinite(ov_reduction_cost(reduction, left)));
                if (tolerance > 0.0)
                    expect_consistent(context, reduction, start, left, tolerance);
            }
            ov_quadric one;
            test_check(context, ov_reduction_cut(context, reduction, 1, &one, NULL));
            assert_true(isfinite(one.amplitude) && one.amplitude > 0.0);
            for (int k = 0; k < 6; ++k)
                assert_true(isfinite(one.a[k]));
            ov_component component;
            assert_true(ov_component_of_quadric(&one, &component));
            ov_reduction_destroy(&reduction);
        }
}

static void coincident_atoms_become_one(void **state) {
    enum { COUNT = 50 };
    ov_quadric start[COUNT], one;
    for (int k = 0; k < COUNT; ++k) {
        const double xyzr[4] = {3.0, -2.0, 1.0, 1.7};
        ov_quadric_of_atom(xyzr, DECAY, start + k);
    }
    expect_sound(*state, start, COUNT, 1e-12);
    ov_reduction *reduction = reduced(*state, start, COUNT, 1, OV_MERGE_L2, 5.0, 0.0);
    test_check(*state, ov_reduction_cut(*state, reduction, 1, &one, NULL));
    expect_near(one.amplitude / (COUNT * start[0].amplitude), 1.0, 1e-13, "the amplitude");
    for (int k = 0; k < 6; ++k)
        expect_near(one.a[k], start[0].a[k], 1e-13, "an entry of the form");
    ov_reduction_destroy(&reduction);
}

static void far_pieces_merge_last(void **state) {
    enum { COUNT = 80 };
    ov_quadric start[COUNT], cut[2];
    uint32_t owner[COUNT];
    random_atoms(21, 4.0, 0.0, start, COUNT / 2);
    random_atoms(22, 4.0, 5e5, start + COUNT / 2, COUNT / 2);
    expect_sound(*state, start, COUNT, 1e-6); /* widths of 1 beside 1e5 angstrom */
    ov_reduction *reduction = reduced(*state, start, COUNT, 1, OV_MERGE_RUNNALLS, 5.0, 0.0);
    test_check(*state, ov_reduction_cut(*state, reduction, 2, cut, owner));
    for (int k = 0; k < COUNT; ++k)
        assert_true((owner[k] == owner[0]) == (k < COUNT / 2));
    ov_reduction_destroy(&reduction);
}

/* Merged with something far away a Gaussian is lost: the cost is all of both. However long the
 * merged one is, its determinants must not get lost in rounding. */
static void far_pairs_cost_all_they_are(void **state) {
    test_random random = {23};
    for (int n = 0; n < 200; ++n) {
        ov_quadric pair[2];
        random_atoms(300 + (uint64_t)n, 1.0, 0.0, pair, 2);
        const double distance = pow(10.0, random_uniform(&random, 4.0, 10.0));
        for (int k = 0; k < 3; ++k)
            pair[1].centre[k] += distance * random_uniform(&random, -1.0, 1.0);
        double wanted = 0.0;
        for (int k = 0; k < 2; ++k)
            wanted += pair[k].amplitude * pair[k].amplitude * pow(0.5 * PI / DECAY, 1.5);
        ov_reduction *reduction = reduced(*state, pair, 2, 1, OV_MERGE_L2, 5.0, 0.0);
        expect_near(ov_reduction_cost(reduction, 1) / wanted, 1.0, 1e-2, "a cost over both");
        ov_reduction_destroy(&reduction);
    }
}

static void one_atom_stays(void **state) {
    ov_quadric start, cut;
    uint32_t owner = 7;
    random_atoms(31, 4.0, 0.0, &start, 1);
    for (size_t down_to = 1; down_to < 4; ++down_to) {
        ov_reduction *reduction = reduced(*state, &start, 1, down_to, OV_MERGE_L2, 5.0, 6.0);
        test_check(*state, ov_reduction_cut(*state, reduction, 1, &cut, &owner));
        assert_memory_equal(&cut, &start, sizeof cut);
        assert_int_equal(owner, 0);
        ov_reduction_destroy(&reduction);
    }
}

static void extreme_amplitudes_stay_finite(void **state) {
    enum { COUNT = 60 };
    ov_quadric start[COUNT];
    random_atoms(41, 6.0, 0.0, start, COUNT);
    for (int k = 0; k < COUNT; ++k)
        start[k].amplitude = exp(OV_EXPONENT_MAX * (k % 5) / 4.0);
    expect_sound(*state, start, COUNT, 1e-10);
    for (int k = 0; k < COUNT; ++k)
        start[k].amplitude = k % 3 == 0 ? 1.0 : k % 3 == 1 ? 1e-60 : 1e60;
    expect_sound(*state, start, COUNT, 1e-10);
    random_gaussians(42, MODEL_NEEDLE, 6.0, start, COUNT);
    expect_sound(*state, start, COUNT, 1e-6);
    random_gaussians(43, MODEL_PANCAKE, 6.0, start, COUNT);
    expect_sound(*state, start, COUNT, 1e-6);
}

/* What the reduction asks of its parts passes through here (see CMakeLists.txt) to be counted:
 * unlike time it is the same on every machine, however busy. */
static struct { size_t looks, pairs; /* searches for near ones, costs of pairs */ } work;

size_t __real_ov_grid_near(const ov_grid *grid, const double centre[3], uint32_t below,
                           uint32_t *found);
size_t __wrap_ov_grid_near(const ov_grid *grid, const double centre[3], uint32_t below,
                           uint32_t *found);
double __real_ov_component_cost(ov_merge_cost cost, const ov_component *i, const ov_component *j);
double __wrap_ov_component_cost(ov_merge_cost cost, const ov_component *i, const ov_component *j);

size_t __wrap_ov_grid_near(const ov_grid *grid, const double centre[3], uint32_t below,
                           uint32_t *found) {
    ++work.looks;
    return __real_ov_grid_near(grid, centre, below, found);
}

double __wrap_ov_component_cost(ov_merge_cost cost, const ov_component *i, const ov_component *j) {
    ++work.pairs;
    return __real_ov_component_cost(cost, i, j);
}

/* Counts the work for so many atoms at one point, as in a file whose coordinates are missing. */
static void reduce_crowd(ovoid_context *context, size_t count) {
    ov_quadric *start = test_alloc(count, sizeof *start), one;
    for (size_t k = 0; k < count; ++k) {
        const double xyzr[4] = {0.0, 0.0, 0.0, 1.7};
        ov_quadric_of_atom(xyzr, DECAY, start + k);
    }
    memset(&work, 0, sizeof work);
    ov_reduction *reduction = reduced(context, start, count, 1, OV_MERGE_RUNNALLS, 5.0, 0.0);
    test_check(context, ov_reduction_cut(context, reduction, 1, &one, NULL));
    expect_near(one.amplitude / ((double)count * start[0].amplitude), 1.0, 1e-10, "the amplitude");
    ov_reduction_destroy(&reduction);
    free(start);
}

/* All pairs are near, and no pair is cheaper than another: still not all of them are looked at. The
 * work for an atom does not grow with their number. */
static void a_crowd_at_one_point_takes_no_quadratic_time(void **state) {
    const size_t few = test_size(3000, 1000), many = 8 * few;
    reduce_crowd(*state, few);
    const size_t looks = work.looks, pairs = work.pairs;
    reduce_crowd(*state, many);
    print_message("%zu atoms at one point: %zu searches, %zu pairs; %zu: %zu, %zu\n", few, looks,
                  pairs, many, work.looks, work.pairs);
    assert_true(looks >= few && pairs >= few);
    assert_true(work.looks <= 12 * looks); /* 8 times if linear, 64 if quadratic */
    assert_true(work.pairs <= 12 * pairs);
}

/* Nor does a search ask all of a crowd: what none of the first members is, is not found. */
static void a_search_asks_so_many_and_no_more(void **state) {
    const double place[3] = {0.0, 0.0, 0.0};
    const uint32_t counts[] = {OV_ASKED_MAX, OV_ASKED_MAX + 1};
    for (size_t n = 0; n < 2; ++n) {
        ov_grid grid = {0};
        uint32_t found[2 * OV_NEAR_MAX];
        test_check(*state, ov_grid_create(*state, place, place, 1.0, counts[n], counts[n], &grid));
        for (uint32_t k = counts[n]; k > 0; --k)
            test_check(*state, ov_grid_add(*state, &grid, place, k - 1));
        assert_int_equal(ov_grid_near(&grid, place, 1, found), n == 0 ? 1 : 0);
        assert_int_equal(ov_grid_near(&grid, place, UINT32_MAX, found), OV_NEAR_MAX);
        ov_grid_destroy(&grid);
    }
}

static uint32_t nearest_of_all(const double (*points)[3], size_t count, const double at[3],
                               double *distance) {
    uint32_t best = OV_NOBODY;
    double least = INFINITY;
    for (size_t k = 0; k < count; ++k) {
        const double x = points[k][0] - at[0], y = points[k][1] - at[1], z = points[k][2] - at[2];
        const double square = x * x + y * y + z * z;
        if (square < least) {
            least = square;
            best = (uint32_t)k;
        }
    }
    *distance = sqrt(least);
    return best;
}

/* The nearest of a cloud, of a lattice where many are as near, and of a crowd. */
static void the_nearest_is_found(void **state) {
    enum { POINTS = 9000 };
    const double reach = 1.5;
    test_random random = {17};
    double(*const points)[3] = test_alloc(POINTS, sizeof *points);
    for (int kind = 0; kind < 3; ++kind) {
        ov_grid grid = {0};
        size_t none = 0;
        for (size_t k = 0; k < 3 * POINTS; ++k) {
            const double x = random_uniform(&random, -12.0, 12.0);
            points[k / 3][k % 3] = kind == 0 ? x : kind == 1 ? round(x) : 1e-3 * x;
        }
        test_check(*state, ov_grid_of(*state, points[0], sizeof *points, POINTS, reach, &grid));
        for (size_t n = 0; n < 300; ++n) {
            const double scale = kind == 2 ? 0.1 : 1.2;
            double at[3], distance;
            for (int k = 0; k < 3; ++k) {
                at[k] = scale * random_uniform(&random, -12.0, 12.0);
                at[k] = kind == 1 ? 0.5 * round(2.0 * at[k]) : at[k];
            }
            const uint32_t wanted =
                nearest_of_all((const double(*)[3])points, POINTS, at, &distance);
            const bool within = distance < reach;
            assert_int_equal(ov_grid_nearest(&grid, points[0], sizeof *points, at),
                             within ? wanted : OV_NOBODY);
            none += !within;
        }
        assert_in_range(none, 10, 290);
        ov_grid_destroy(&grid);
    }
    free(points);
}

static const ov_reduction_options usual_options = {.cost = OV_MERGE_L2, .reach = 5.0};

static void what_is_no_gaussian_is_refused(void **state) {
    ovoid_context *context = *state;
    ov_quadric start[3];
    ov_reduction *reduction = NULL;
    ov_reduction_options options = usual_options;
    random_atoms(51, 4.0, 0.0, start, 3);
    test_refused(context, ov_reduction_create(context, start, 0, 1, &options, &reduction),
                 OVOID_ERROR_EMPTY, "no Gaussian");
    test_refused(context, ov_reduction_create(context, start, 3, 0, &options, &reduction),
                 OVOID_ERROR_ARGUMENT, "no Gaussian at all");
    static const double bad_amplitudes[] = {0.0, -1.0, NAN, INFINITY};
    for (int k = 0; k < 4; ++k) {
        random_atoms(51, 4.0, 0.0, start, 3);
        start[1].amplitude = bad_amplitudes[k];
        test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                     OVOID_ERROR_ARGUMENT, "number 2");
    }
    static const double bad_forms[][6] = {{0, 0, 0, 1, 0, 1},   {1, 0, 0, -1, 0, 1},
                                          {1, 2, 0, 1, 0, 1},   {1, 0, 0, 1, 1.5, 1},
                                          {NAN, 0, 0, 1, 0, 1}, {1, 0, 0, 1, 0, INFINITY}};
    for (int k = 0; k < 6; ++k) {
        random_atoms(51, 4.0, 0.0, start, 3);
        memcpy(start[2].a, bad_forms[k], sizeof start[2].a);
        test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                     OVOID_ERROR_ARGUMENT, "number 3");
    }
    random_atoms(51, 4.0, 0.0, start, 3);
    start[0].centre[1] = NAN;
    test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                 OVOID_ERROR_ARGUMENT, "number 1");
    random_atoms(51, 4.0, 0.0, start, 3);
    start[0].amplitude = 1e200;
    test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                 OVOID_ERROR_NUMERIC, "too large");
    random_atoms(51, 4.0, 0.0, start, 3);
    static const double bad_reaches[] = {0.0, -5.0, NAN, INFINITY};
    for (int k = 0; k < 4; ++k) {
        options.reach = bad_reaches[k];
        test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                     OVOID_ERROR_ARGUMENT, "reach");
    }
    options = usual_options;
    options.inside = -1.0;
    test_refused(context, ov_reduction_create(context, start, 3, 1, &options, &reduction),
                 OVOID_ERROR_ARGUMENT, "inside");
    assert_null(reduction);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_merge_keeps_mass_mean_and_covariance),
        cmocka_unit_test(costs_equal_quadrature),
        cmocka_unit_test(merges_are_those_of_an_exhaustive_search),
        cmocka_unit_test(equal_costs_are_taken_by_index),
        cmocka_unit_test(the_first_of_equal_neighbours_is_taken),
        cmocka_unit_test(merges_inside_come_first),
        cmocka_unit_test(the_starts_field_is_interpolated),
        cmocka_unit_test(cuts_keep_the_moments_of_what_they_took_in),
        cmocka_unit_test(two_runs_give_the_same_bits),
        cmocka_unit_test(coincident_atoms_become_one),
        cmocka_unit_test(far_pieces_merge_last),
        cmocka_unit_test(far_pairs_cost_all_they_are),
        cmocka_unit_test(one_atom_stays),
        cmocka_unit_test(extreme_amplitudes_stay_finite),
        cmocka_unit_test(a_crowd_at_one_point_takes_no_quadratic_time),
        cmocka_unit_test(a_search_asks_so_many_and_no_more),
        cmocka_unit_test(the_nearest_is_found),
        cmocka_unit_test(what_is_no_gaussian_is_refused),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
