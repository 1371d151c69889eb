/*
 * Merges and splits of a refined model: the kernel merge_loss against a twin that evaluates every
 * point, and what ov_merge_cheapest(), ov_split_worst() and ov_misfit_shares() do to a model.
 */
#include "fit/adaptive/merge.h"
#include "mixture/component.h"
#include "model/ellipsoid.h"
#include "selftest/losses.h"
#include "support.h"

enum { P = OV_FACTOR_PARAMETERS };

static double value_of(const ov_quadric *quadric, const double y[3]) {
    return quadric->amplitude * exp(-ov_twin_exponent(quadric, y));
}

/* ---- the kernel --------------------------------------------------------------------------- */

/* All pairs of neighbours in the list of terms, and some of one term with the last. */
static size_t make_pairs(const bench *b, uint32_t *pairs, ov_quadric *merged) {
    size_t count = 0;
    for (uint32_t i = 0; i + 1 < b->terms_count; ++i)
        for (uint32_t far = 0; far < 2; ++far) {
            const uint32_t j = far ? (uint32_t)b->terms_count - 1 : i + 1;
            pairs[2 * count] = i;
            pairs[2 * count + 1] = j;
            test_check(b->context, ov_merge_quadrics(b->context, &b->quadrics[i], &b->quadrics[j],
                                                     &merged[count]));
            ++count;
        }
    return count;
}

/* The packs that either term lists. */
static bool *packs_of_pair(const bench *b, const uint32_t pair[2]) {
    bool *const listed = test_alloc(b->points.packs, sizeof *listed);
    uint32_t *const start = read_indices(b->context, &b->lists.term_start, b->terms_count + 1);
    uint32_t *const item = read_indices(b->context, &b->lists.term_item, b->lists.items);
    for (int n = 0; n < 2; ++n)
        for (uint32_t k = start[pair[n]]; k < start[pair[n] + 1]; ++k)
            listed[item[k]] = true;
    free(start);
    free(item);
    return listed;
}

static void expect_losses(bench *b, uint64_t seed, bool every_point, const char *what) {
    ov_charges c;
    float *loss = NULL;
    double worst = 0.0;
    uint32_t *const pairs = test_alloc(4 * b->terms_count, sizeof *pairs);
    ov_quadric *const merged = test_alloc(2 * b->terms_count, sizeof *merged);
    test_check(b->context, ov_charges_create(b->context, b->quadrics, b->terms_count, &b->points,
                                             b->xyz, seed, &c));
    const size_t count = make_pairs(b, pairs, merged);
    test_check(b->context, ov_losses(b->context, &b->points, &b->terms, &b->lists, &c, pairs,
                                     merged, count, &loss));
    for (size_t n = 0; n < count; ++n) {
        bool *const listed = packs_of_pair(b, pairs + 2 * n);
        const ov_twin_sum wanted = ov_twin_loss(b->quadrics, pairs + 2 * n, &merged[n], b->xyz,
                                                b->count, &c, every_point ? NULL : listed);
        expect_close(loss[n], wanted, 2.0, &worst, "loss", n);
        free(listed);
    }
    print_message("losses, %s: %.2f of 2\n", what, worst);
    free(loss);
    free(pairs);
    free(merged);
    ov_charges_destroy(&c);
}

static void losses_equal_twin(void **state) {
    const model_kind kinds[] = {MODEL_RANDOM, MODEL_SPHERE, MODEL_GIMBAL};
    for (size_t n = 0; n < sizeof kinds / sizeof *kinds; n = test_next(*state, n, 3)) {
        bench b;
        bench_random(&b, *state, kinds[n], test_size(24, 6), test_size(1500, 117), 40 + n);
        expect_losses(&b, n, true, model_kind_name(kinds[n]));
        bench_destroy(&b);
    }
}

/* With short lists, that overlap in part or not at all: each pack counts once, for either term. */
static void each_listed_pack_counts_once(void **state) {
    test_random random = {50};
    const size_t count = test_size(20, 6), points = test_size(2500, 300);
    ovoid_ellipsoid *const ellipsoids = test_alloc(count, sizeof *ellipsoids);
    ov_quadric *const quadrics = test_alloc(count, sizeof *quadrics);
    random_ellipsoids(&random, MODEL_RANDOM, 6.0, ellipsoids, count);
    for (size_t i = 0; i < count; ++i) {
        ellipsoids[i].decay[0] += 0.5;                     /* short */
        ellipsoids[i].amplitude = i % 5 == 2 ? 1e-4 : 1.0; /* and some that reach nothing */
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadrics[i]);
    }
    float *const xyz = random_points(&random, points, 8.0);
    bench b;
    bench_create(&b, *state, quadrics, count, xyz, points, 1e-2);
    assert_true(b.lists.items > 0 && b.lists.items < count * b.points.packs / 2);
    expect_losses(&b, 51, false, "short lists");
    free(xyz);
    free(quadrics);
    free(ellipsoids);
    bench_destroy(&b);
}

/* ---- models ------------------------------------------------------------------------------- */

/* A molecule, its target, and a model: the atoms, a little off. */
typedef struct model {
    ovoid_context *context;
    ov_samples samples;
    ov_target target;
    ov_refiner refiner;
    ov_merger merger;
    double *x;
    size_t count, points;
    double misfit;
    double *xyz; /* of the points, in the order of the packs */
    float *low, *high, *weight;
} model;

static void read_target(model *m) {
    const ov_points *const points = &m->samples.points;
    const size_t all = points->packs * OV_PACK;
    m->points = points->count;
    assert_int_equal(points->packs, (m->points + OV_PACK - 1) / OV_PACK);
    m->xyz = read_places(m->context, points);
    m->low = read_floats(m->context, &m->target.low, all);
    m->high = read_floats(m->context, &m->target.high, all);
    m->weight = read_floats(m->context, &m->target.weight, all);
}

static void evaluate(model *m) {
    test_check(m->context, ov_refine_evaluate(&m->refiner, &m->target, m->x, m->count, &m->misfit));
}

/* Room in m->x for twice as many. */
static void create_model(model *m, ovoid_context *context, size_t atoms, double spacing,
                         uint64_t seed) {
    test_random random = {seed};
    const double half = 1.1 * cbrt((double)atoms);
    double *const xyzr = test_alloc(4 * atoms, sizeof *xyzr);
    ov_target_options options;
    ov_lattice lattice;
    *m = (model){.context = context, .refiner = {.context = context}, .count = atoms};
    m->x = test_alloc(2 * atoms * P, sizeof *m->x);
    for (size_t i = 0; i < atoms; ++i) {
        for (size_t k = 0; k < 3; ++k)
            xyzr[4 * i + k] = random_uniform(&random, -half, half);
        xyzr[4 * i + 3] = random_uniform(&random, 1.2, 1.8);
        ov_quadric quadric;
        ov_quadric_of_atom(xyzr + 4 * i, 0.5, &quadric);
        quadric.centre[i % 3] += random_uniform(&random, -0.4, 0.4);
        quadric.a[0] *= random_uniform(&random, 0.8, 1.2);
        ov_factor_of_quadric(&quadric, m->x + i * P);
    }
    ov_target_options_init(&options);
    const ov_band band = {.low = options.low,
                          .high = options.high,
                          .inside_every = options.inside_every,
                          .outside_low = options.outside_low,
                          .outside_every = options.outside_every};
    test_check(context,
               ov_lattice_create(context, xyzr, atoms, spacing, test_size(8, 5) * 0.5, &lattice));
    test_check(context,
               ov_sample(context, xyzr, atoms, 0.5, &lattice, band, (ov_sampling){0}, &m->samples));
    test_check(context, ov_target_create(context, &m->samples, 0.5, 1.0, &options, &m->target));
    read_target(m);
    evaluate(m);
    free(xyzr);
}

static void destroy_model(model *m) {
    ov_merger_destroy(&m->merger);
    ov_refiner_destroy(&m->refiner);
    ov_target_destroy(&m->target);
    ov_samples_destroy(&m->samples);
    free(m->x);
    free(m->xyz);
    free(m->low);
    free(m->high);
    free(m->weight);
}

static ov_component component_at(const double *x, size_t i) {
    ov_quadric quadric;
    ov_component component;
    ov_factor_quadric(x + i * P, &quadric);
    assert_true(ov_component_of_quadric(&quadric, &component));
    return component;
}

/* Mass, first and second moments about the origin of components from .. to - 1, added to sums. */
static void add_sums(const double *x, size_t from, size_t to, double sums[10]) {
    static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
    for (size_t i = from; i < to; ++i) {
        const ov_component c = component_at(x, i);
        sums[0] += c.mass;
        for (int k = 0; k < 3; ++k)
            sums[1 + k] += c.mass * c.mean[k];
        for (int k = 0; k < 6; ++k)
            sums[4 + k] += c.mass * (c.s[k] + c.mean[row[k]] * c.mean[column[k]]);
    }
}

static void expect_sums(const double got[10], const double wanted[10], double mass) {
    for (int k = 0; k < 10; ++k)
        expect_near(got[k], wanted[k],
                    1e-9 * mass *
                        (k < 1   ? 1.0
                         : k < 4 ? 10.0
                                 : 100.0),
                    "a moment of the model");
}

/* Index of the parameters among `count` others, to the last bit, or count. */
static size_t find(const double *x, const double *among, size_t count) {
    size_t i = 0;
    while (i < count && memcmp(x, among + i * P, P * sizeof *x) != 0)
        ++i;
    return i;
}

/* The new model consists of old ellipsoids, and of merges of two of the rest: everyone is used
 * once, in the old order, and each merge stands where its first one stood. */
static void expect_merges(const double *old, size_t before, const double *now, size_t after,
                          const uint32_t *twin) {
    bool *const used = test_alloc(before, sizeof *used);
    size_t last = 0;
    for (size_t n = 0; n < after; ++n) {
        size_t place = find(now + n * P, old, before);
        if (place == before) {
            const ov_component got = component_at(now, n);
            for (size_t i = 0; i < before && place == before; ++i)
                for (size_t j = i + 1; j < before && place == before; ++j) {
                    const ov_component p = component_at(old, i), q = component_at(old, j);
                    ov_component both;
                    ov_component_merge(&p, &q, &both);
                    double off = fabs(both.mass / got.mass - 1.0);
                    for (int k = 0; k < 3; ++k)
                        off += fabs(both.mean[k] - got.mean[k]);
                    if (off > 1e-8)
                        continue;
                    assert_false(used[j]);
                    assert_false(twin && twin[i] == j);
                    used[j] = true;
                    place = i;
                }
        }
        assert_true(place < before && !used[place]);
        assert_true(n == 0 || place > last);
        used[place] = true;
        last = place;
    }
    for (size_t i = 0; i < before; ++i)
        assert_true(used[i]);
    free(used);
}

static double *copy_of(const model *m) {
    double *const copy = test_alloc(2 * m->count * P, sizeof *copy);
    memcpy(copy, m->x, m->count * P * sizeof *copy);
    return copy;
}

static void merge(model *m, double *x, size_t *count, size_t fewer, const uint32_t *twin) {
    test_check(m->context, ov_merge_cheapest(&m->refiner, &m->merger, &m->target, x, count, fewer,
                                             &(ov_merging){.twin = twin}));
}

static void merging_keeps_moments(void **state) {
    test_skip_simulated(*state); /* the host chooses, and the losses are compared above */
    model m;
    create_model(&m, *state, test_size(40, 8), test_size(6, 20) / 10.0, 60);
    for (size_t fewer = 0; fewer <= m.count; fewer = 3 * fewer + 1) {
        double before[10] = {0}, after[10] = {0};
        double *const x = copy_of(&m), *const again = copy_of(&m);
        size_t count = m.count, count_again = m.count;
        merge(&m, x, &count, fewer, NULL);
        merge(&m, again, &count_again, fewer, NULL);
        print_message("%zu ellipsoids, %zu fewer: %zu\n", m.count, fewer, count);
        if (fewer <= m.count / 3)
            assert_int_equal(count, m.count - fewer);
        assert_true(count >= (m.count + 1) / 2 && count <= m.count);
        add_sums(m.x, 0, m.count, before);
        add_sums(x, 0, count, after);
        expect_sums(after, before, before[0]);
        expect_merges(m.x, m.count, x, count, NULL);
        assert_int_equal(count, count_again);
        assert_memory_equal(x, again, count * P * sizeof *x);
        free(x);
        free(again);
    }
    destroy_model(&m);
}

/* The loss of a pair over all points, in double. */
static double model_loss(const model *m, const double *x, size_t count, size_t i, size_t j) {
    ov_quadric *const quadrics = test_alloc(count, sizeof *quadrics);
    ov_quadric merged;
    double loss = 0.0;
    for (size_t n = 0; n < count; ++n)
        ov_factor_quadric(x + n * P, &quadrics[n]);
    test_check(m->context, ov_merge_quadrics(m->context, &quadrics[i], &quadrics[j], &merged));
    for (size_t k = 0; k < m->points; ++k) {
        const double *const y = m->xyz + 3 * k;
        const double before = ov_twin_field(quadrics, count, y).value;
        const double after =
            before - value_of(&quadrics[i], y) - value_of(&quadrics[j], y) + value_of(&merged, y);
        loss += m->weight[k] * (ov_twin_square_residual(after, m->low[k], m->high[k]) -
                                ov_twin_square_residual(before, m->low[k], m->high[k]));
    }
    free(quadrics);
    return loss;
}

/* So few that every pair is a candidate: the chosen ones are those of the twin, in turn. */
static void cheapest_pairs_are_merged(void **state) {
    enum { COUNT = 7 };
    for (uint64_t seed = 0; seed < test_size(6, 1); ++seed) {
        model m;
        double loss[COUNT][COUNT];
        bool used[COUNT] = {false};
        create_model(&m, *state, COUNT, test_size(6, 20) / 10.0, 70 + seed);
        for (size_t i = 0; i < COUNT; ++i)
            for (size_t j = i + 1; j < COUNT; ++j)
                loss[i][j] = model_loss(&m, m.x, COUNT, i, j);
        for (size_t fewer = 1; fewer <= 3; ++fewer) {
            size_t a = COUNT, b = COUNT, count = COUNT;
            for (size_t i = 0; i < COUNT; ++i)
                for (size_t j = i + 1; j < COUNT; ++j)
                    if (!used[i] && !used[j] && (a == COUNT || loss[i][j] < loss[a][b])) {
                        a = i;
                        b = j;
                    }
            used[a] = used[b] = true;
            double *const x = copy_of(&m);
            merge(&m, x, &count, fewer, NULL);
            assert_int_equal(count, COUNT - fewer);
            for (size_t i = 0; i < COUNT; ++i)
                assert_true((find(m.x + i * P, x, count) == count) == used[i]);
            free(x);
        }
        destroy_model(&m);
    }
}

static void twins_stay_apart(void **state) {
    test_skip_simulated(*state);
    model m;
    create_model(&m, *state, 6, test_size(6, 20) / 10.0, 80);
    uint32_t twin[] = {1, 0, 3, 2, 5, 4};
    double *x = copy_of(&m);
    size_t count = m.count;
    merge(&m, x, &count, 2, twin); /* a third might find twins only */
    assert_int_equal(count, 4);
    expect_merges(m.x, m.count, x, count, twin);
    free(x);
    m.count = count = 2; /* only a pair of twins */
    evaluate(&m);
    x = copy_of(&m);
    merge(&m, x, &count, 1, twin);
    assert_int_equal(count, 2);
    assert_memory_equal(x, m.x, 2 * P * sizeof *x);
    merge(&m, x, &count, 1, NULL);
    assert_int_equal(count, 1);
    free(x);
    destroy_model(&m);
}

/* Each ellipsoid is found among the parents once. */
static void parents_are_named(void **state) {
    test_skip_simulated(*state);
    model m;
    const size_t count = test_size(24, 8);
    create_model(&m, *state, count, test_size(6, 20) / 10.0, 82);
    bool *const seen = test_alloc(count, sizeof *seen);
    uint32_t *const parents = test_alloc(2 * count, sizeof *parents);
    memset(seen, 0, count * sizeof *seen);
    const ov_merging merging = {.parents = parents};
    double *const x = copy_of(&m);
    size_t left = count;
    test_check(*state,
               ov_merge_cheapest(&m.refiner, &m.merger, &m.target, x, &left, count / 4, &merging));
    assert_int_equal(left, count - count / 4);
    for (size_t i = 0; i < left; ++i) {
        const uint32_t a = parents[2 * i], b = parents[2 * i + 1];
        assert_true(a < count && !seen[a]);
        seen[a] = true;
        if (b == UINT32_MAX) {
            assert_memory_equal(x + i * P, m.x + a * P, P * sizeof *x);
            continue;
        }
        assert_true(b < count && !seen[b]);
        seen[b] = true;
        ov_quadric one, two, both, got;
        ov_factor_quadric(m.x + a * P, &one);
        ov_factor_quadric(m.x + b * P, &two);
        ov_factor_quadric(x + i * P, &got);
        test_check(NULL, ov_merge_quadrics(NULL, &one, &two, &both));
        expect_near(got.amplitude, both.amplitude, 1e-6 * both.amplitude, "an amplitude");
        for (int k = 0; k < 3; ++k)
            expect_near(got.centre[k], both.centre[k], 1e-6, "a centre");
    }
    for (size_t i = 0; i < count; ++i)
        assert_true(seen[i]);
    free(seen);
    free(parents);
    free(x);
    destroy_model(&m);
}

/* A half-space, and how often it was asked about. */
typedef struct border {
    double x;
    size_t asked;
} border;

static bool beyond(const double centre[3], void *user) {
    border *const b = user;
    ++b->asked;
    return centre[0] > b->x;
}

static double apart(const double *a, const double *b) {
    double square = 0.0;
    for (int k = 0; k < 3; ++k)
        square += (a[k] - b[k]) * (a[k] - b[k]);
    return sqrt(square);
}

/* What became of the model as `merging` says; *merged: the centres of those that are two in one. */
static size_t merged_as(model *m, const ov_merging *merging, double (*merged)[3]) {
    double *const x = copy_of(m);
    size_t left = m->count, count = 0;
    evaluate(m);
    test_check(m->context,
               ov_merge_cheapest(&m->refiner, &m->merger, &m->target, x, &left, m->count, merging));
    for (size_t i = 0; i < left; ++i)
        if (merging->parents[2 * i + 1] != UINT32_MAX)
            memcpy(merged[count++], x + i * P + OV_FACTOR_CENTRE, sizeof *merged);
    assert_int_equal(left, m->count - count);
    free(x);
    return count;
}

/* Merges keep their distance from one another, lie where they may, and are of the cheapest. */
static void merges_lie_where_they_may(void **state) {
    test_skip_simulated(*state);
    model m;
    const size_t count = test_size(24, 8);
    border b = {.x = 0.0};
    create_model(&m, *state, count, test_size(6, 20) / 10.0, 83);
    uint32_t *const parents = test_alloc(2 * count, sizeof *parents);
    double(*const centre)[3] = test_alloc(count, sizeof *centre);
    ov_merging merging = {.parents = parents};
    const size_t all = merged_as(&m, &merging, centre);
    double nearest = INFINITY, middle = 0.0;
    for (size_t i = 0; i < all; ++i) {
        middle += centre[i][0] / (double)all;
        for (size_t j = 0; j < i; ++j)
            nearest = fmin(nearest, apart(centre[i], centre[j]));
    }
    merging.apart = 1.5 * nearest;
    const size_t sparse = merged_as(&m, &merging, centre);
    for (size_t i = 0; i < sparse; ++i)
        for (size_t j = 0; j < i; ++j)
            assert_true(apart(centre[i], centre[j]) >= merging.apart * (1.0 - 1e-6));
    assert_true(sparse > 0);
    b.x = middle;
    merging = (ov_merging){.parents = parents, .allowed = beyond, .user = &b};
    const size_t half = merged_as(&m, &merging, centre);
    for (size_t i = 0; i < half; ++i)
        assert_true(centre[i][0] > b.x - 1e-6);
    assert_true(half > 0 && half < all && b.asked > half);
    merging = (ov_merging){.parents = parents, .share = 1e-6}; /* of the pairs: one */
    assert_int_equal(merged_as(&m, &merging, centre), 1);
    print_message("%zu merges, %zu apart, %zu on one side\n", all, sparse, half);
    free(parents);
    free(centre);
    destroy_model(&m);
}

static void nothing_to_merge(void **state) {
    model m;
    create_model(&m, *state, 3, 2.0, 81);
    size_t count = 0;
    merge(&m, m.x, &count, 5, NULL);
    assert_int_equal(count, 0);
    m.count = count = 1;
    evaluate(&m);
    double *const x = copy_of(&m);
    merge(&m, x, &count, 5, NULL);
    assert_int_equal(count, 1);
    assert_memory_equal(x, m.x, P * sizeof *x);
    free(x);
    m.count = count = 3; /* too far apart to be partners */
    for (size_t i = 0; i < 3; ++i)
        m.x[i * P + OV_FACTOR_CENTRE] += 50.0 * (double)i;
    evaluate(&m);
    merge(&m, m.x, &count, 2, NULL);
    assert_int_equal(count, 3);
    m.x[P + OV_FACTOR_L] = NAN;
    test_refused(m.context,
                 ov_merge_cheapest(&m.refiner, &m.merger, &m.target, m.x, &count, 1, NULL),
                 OVOID_ERROR_NUMERIC, "ellipsoid 2 is degenerate");
    assert_int_equal(count, 3);
    destroy_model(&m);
}

/* Ellipsoids at one place, more than a search for partners looks at. */
static void crowd_at_one_point(void **state) {
    test_skip_simulated(*state);
    model m;
    const size_t crowd = test_size(600, 8);
    create_model(&m, *state, crowd, 2.0, 82);
    for (size_t i = 1; i < crowd; ++i)
        memcpy(m.x + i * P, m.x, P * sizeof *m.x);
    evaluate(&m);
    size_t count = crowd;
    merge(&m, m.x, &count, 3, NULL);
    assert_int_equal(count, crowd - 3);
    destroy_model(&m);
}

/* ---- shares ------------------------------------------------------------------------------- */

/* sum_k weight r^2 e_i / phi~, phi~ no less than 1e-3. */
static double twin_share(const model *m, const ov_quadric *quadrics, size_t i) {
    double share = 0.0;
    for (size_t k = 0; k < m->points; ++k) {
        const double *const y = m->xyz + 3 * k;
        const double phi = ov_twin_field(quadrics, m->count, y).value;
        share += m->weight[k] * ov_twin_square_residual(phi, m->low[k], m->high[k]) *
                 value_of(&quadrics[i], y) / fmax(phi, 1e-3);
    }
    return share;
}

static void expect_shares(model *m) {
    ov_quadric *const quadrics = test_alloc(m->count, sizeof *quadrics);
    double *const share = test_alloc(m->count, sizeof *share);
    double sum = 0.0;
    evaluate(m);
    test_check(m->context, ov_misfit_shares(&m->refiner, &m->merger, &m->target, m->count, share));
    for (size_t i = 0; i < m->count; ++i)
        ov_factor_quadric(m->x + i * P, &quadrics[i]);
    for (size_t i = 0; i < m->count; ++i) {
        sum += share[i];
        expect_near(share[i], twin_share(m, quadrics, i), 2e-3 * m->misfit, "a share");
    }
    print_message("misfit %g, shares %g\n", m->misfit, sum);
    expect_near(sum, m->misfit, 5e-3 * m->misfit, "the shares' sum");
    free(quadrics);
    free(share);
}

/* Also with weights that are not those the target began with. */
static void shares_add_up_to_the_misfit(void **state) {
    model m;
    create_model(&m, *state, test_size(20, 8), test_size(6, 16) / 10.0, 90);
    expect_shares(&m);
    const size_t all = m.samples.points.packs * OV_PACK;
    for (size_t k = 0; k < all; ++k)
        m.weight[k] *= k % 2 ? 6.0f : 0.3f;
    test_check(*state,
               ov_buffer_write(*state, &m.target.weight, 0, m.weight, all * sizeof *m.weight));
    expect_shares(&m);
    destroy_model(&m);
}

/* ---- splits ------------------------------------------------------------------------------- */

/* Each half about its own part of the whole's longest axis, and together the whole. */
static void expect_split(const double *whole, const double *x, size_t i, size_t other) {
    double before[10] = {0}, after[10] = {0};
    add_sums(whole, i, i + 1, before);
    add_sums(x, i, i + 1, after);
    add_sums(x, other, other + 1, after);
    expect_sums(after, before, before[0]);
    const ov_component p = component_at(x, i), q = component_at(x, other);
    expect_near(p.mass, q.mass, 1e-9 * q.mass, "a half's mass");
    ov_quadric quadric;
    ovoid_ellipsoid ellipsoid;
    double r[3][3], length = 0.0, along = 0.0;
    ov_factor_quadric(whole + i * P, &quadric);
    ov_ellipsoid_of_quadric(&quadric, &ellipsoid);
    ov_rotation(ellipsoid.angle, r);
    for (int k = 0; k < 3; ++k) {
        length += (p.mean[k] - q.mean[k]) * (p.mean[k] - q.mean[k]);
        along += (p.mean[k] - q.mean[k]) * r[2][k];
    }
    assert_true(sqrt(length) > 0.5 / sqrt(ellipsoid.decay[2]));
    expect_near(fabs(along), sqrt(length), 1e-9, "the way between two halves along the axis");
}

static void worst_are_split(void **state) {
    test_skip_simulated(*state); /* the host splits */
    model m;
    create_model(&m, *state, test_size(20, 8), test_size(6, 20) / 10.0, 91);
    const size_t before = m.count, cases[] = {0, 1, 5, before, before + 4};
    double *const share = test_alloc(before, sizeof *share);
    test_check(*state, ov_misfit_shares(&m.refiner, &m.merger, &m.target, before, share));
    for (size_t n = 0; n < sizeof cases / sizeof *cases; ++n) {
        const size_t more = cases[n], made = more < before ? more : before;
        double *const x = test_alloc((before + more) * P, sizeof *x);
        uint32_t *const twin = test_alloc(before + more, sizeof *twin);
        size_t count = before, split = 0;
        double least = INFINITY, most = 0.0;
        memcpy(x, m.x, before * P * sizeof *x);
        test_check(*state,
                   ov_split_worst(&m.refiner, &m.merger, &m.target, x, &count, 0, more, twin));
        assert_int_equal(count, before + made);
        for (size_t i = 0; i < before; ++i) {
            if (twin[i] == UINT32_MAX) {
                assert_memory_equal(x + i * P, m.x + i * P, P * sizeof *x);
                most = fmax(most, share[i]);
                continue;
            }
            ++split;
            assert_true(twin[i] >= before && twin[i] < count && twin[twin[i]] == i);
            expect_split(m.x, x, i, twin[i]);
            least = fmin(least, share[i]);
        }
        assert_int_equal(split, made);
        assert_true(least >= most);
        for (size_t i = count; i < before + more; ++i)
            assert_true(twin[i] == UINT32_MAX);
        free(x);
        free(twin);
    }
    free(share);
    destroy_model(&m);
}

/* Needles, pancakes and the like have one longest axis, or several that will all do. */
static void splits_of_every_shape(void **state) {
    test_skip_simulated(*state);
    test_random random = {92};
    model m;
    create_model(&m, *state, 6, 2.0, 93);
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        ovoid_ellipsoid ellipsoids[6];
        double whole[6 * P];
        size_t count = 6;
        if (kind == MODEL_HUGE || kind == MODEL_TINY)
            continue;
        random_ellipsoids(&random, (model_kind)kind, 2.0, ellipsoids, 6);
        for (size_t i = 0; i < 6; ++i) {
            ov_quadric quadric;
            ov_quadric_of_ellipsoid(&ellipsoids[i], &quadric);
            ov_factor_of_quadric(&quadric, m.x + i * P);
        }
        m.count = 6;
        evaluate(&m);
        memcpy(whole, m.x, sizeof whole);
        uint32_t twin[12];
        test_check(*state,
                   ov_split_worst(&m.refiner, &m.merger, &m.target, m.x, &count, 0, 6, twin));
        assert_int_equal(count, 12);
        for (size_t i = 0; i < 6; ++i) {
            double before[10] = {0}, after[10] = {0};
            add_sums(whole, i, i + 1, before);
            add_sums(m.x, i, i + 1, after);
            add_sums(m.x, twin[i], twin[i] + 1, after);
            for (int k = 0; k < 10; ++k)
                expect_near(after[k], before[k],
                            1e-8 * (before[0] + before[4] + before[7] + before[9]),
                            "a moment of two halves");
        }
    }
    destroy_model(&m);
}

static void nothing_to_split(void **state) {
    model m;
    create_model(&m, *state, 2, 2.0, 94);
    size_t count = 0;
    m.count = 0;
    evaluate(&m);
    test_check(*state, ov_split_worst(&m.refiner, &m.merger, &m.target, m.x, &count, 0, 2, NULL));
    assert_int_equal(count, 0);
    destroy_model(&m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(losses_equal_twin),     cmocka_unit_test(each_listed_pack_counts_once),
        cmocka_unit_test(merging_keeps_moments), cmocka_unit_test(cheapest_pairs_are_merged),
        cmocka_unit_test(twins_stay_apart),      cmocka_unit_test(merges_lie_where_they_may),
        cmocka_unit_test(nothing_to_merge),      cmocka_unit_test(parents_are_named),
        cmocka_unit_test(crowd_at_one_point),    cmocka_unit_test(shares_add_up_to_the_misfit),
        cmocka_unit_test(worst_are_split),       cmocka_unit_test(splits_of_every_shape),
        cmocka_unit_test(nothing_to_split),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
