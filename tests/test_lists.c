/*
 * The two lists that pair terms with packs, against the exact least exponent over every pack's box.
 */
#include "model/ellipsoid.h"
#include "selftest/check.h"
#include "support.h"

/* The lists, on the host. */
typedef struct pairs {
    size_t terms, packs, items;
    uint32_t *term_start, *term_item, *pack_start, *pack_item;
} pairs;

static void read_pairs(ovoid_context *context, const ov_lists *lists, pairs *p) {
    p->terms = lists->terms;
    p->packs = lists->packs;
    p->items = lists->items;
    p->term_start = read_indices(context, &lists->term_start, p->terms + 1);
    p->term_item = read_indices(context, &lists->term_item, p->items);
    p->pack_start = read_indices(context, &lists->pack_start, p->packs + 1);
    p->pack_item = read_indices(context, &lists->pack_item, p->items);
}

static void free_pairs(pairs *p) {
    free(p->term_start);
    free(p->term_item);
    free(p->pack_start);
    free(p->pack_item);
}

/* Starts run from 0 to the number of items, items ascend without repeats and within range. */
static void expect_csr(const uint32_t *start, const uint32_t *item, size_t count, size_t items,
                       size_t range) {
    assert_int_equal(start[0], 0);
    assert_int_equal(start[count], items);
    for (size_t i = 0; i < count; ++i) {
        assert_true(start[i] <= start[i + 1]);
        for (uint32_t k = start[i]; k < start[i + 1]; ++k) {
            assert_true(item[k] < range);
            assert_true(k == start[i] || item[k - 1] < item[k]);
        }
    }
}

/* Both lists are in order and each the transpose of the other. */
static void expect_lists(const pairs *p) {
    expect_csr(p->term_start, p->term_item, p->terms, p->items, p->packs);
    expect_csr(p->pack_start, p->pack_item, p->packs, p->items, p->terms);
    for (size_t i = 0; i < p->terms; ++i)
        for (uint32_t k = p->term_start[i]; k < p->term_start[i + 1]; ++k)
            assert_true(ov_list_holds(p->pack_start, p->pack_item, p->term_item[k], (uint32_t)i));
}

static void pack_box(const bench *b, size_t pack, double skin, double box[6]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        box[axis] = INFINITY;
        box[axis + 3] = -INFINITY;
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK && k < b->count; ++k) {
            box[axis] = fmin(box[axis], b->xyz[3 * k + axis] - skin);
            box[axis + 3] = fmax(box[axis + 3], b->xyz[3 * k + axis] + skin);
        }
    }
}

/* What the comparison with the exact answer found. */
typedef struct tally {
    size_t wanted; /* pairs that must be listed */
    size_t listed;
    size_t excess; /* listed although the least exponent is above the reach */
} tally;

/* No pair is lost whose least exponent is within the reach by more than float rounding. */
static void expect_pairs(const bench *b, const pairs *p, double cutoff, double skin, tally *t) {
    for (size_t i = 0; i < b->terms_count; ++i) {
        const double reach = log(b->quadrics[i].amplitude / cutoff);
        for (size_t pack = 0; pack < p->packs; ++pack) {
            double box[6];
            pack_box(b, pack, skin, box);
            const double least = ov_twin_least_exponent(&b->quadrics[i], box);
            const bool listed = ov_list_holds(p->term_start, p->term_item, i, (uint32_t)pack);
            if (least <= reach - 1e-3 && !listed)
                fail_msg("term %zu, pack %zu: least exponent %g, reach %g, not listed", i, pack,
                         least, reach);
            t->wanted += least <= reach;
            t->listed += listed;
            t->excess += listed && least > reach + 1e-3;
        }
    }
}

static void random_bench_at(bench *b, ovoid_context *context, model_kind kind, size_t terms,
                            size_t count, double cutoff, uint64_t seed, const double offset[3]) {
    test_random random = {seed};
    ovoid_ellipsoid *const ellipsoids = test_alloc(terms, sizeof *ellipsoids);
    ov_quadric *const quadrics = test_alloc(terms, sizeof *quadrics);
    random_ellipsoids(&random, kind, 12.0, ellipsoids, terms);
    for (size_t i = 0; i < terms; ++i) {
        for (int k = 0; k < 3; ++k) {
            if (kind != MODEL_NEEDLE && kind != MODEL_PANCAKE)
                ellipsoids[i].decay[k] *= 2.0; /* so that reaches are shorter than the box */
            ellipsoids[i].centre[k] += offset[k];
        }
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadrics[i]);
    }
    float *const xyz = random_points(&random, count, 12.0);
    double *const wide = widen_points(xyz, count);
    for (size_t k = 0; k < 3 * count; ++k)
        wide[k] += offset[k % 3];
    bench_place(b, context, quadrics, terms, wide, count, cutoff);
    free(wide);
    free(xyz);
    free(quadrics);
    free(ellipsoids);
}

static void random_bench(bench *b, ovoid_context *context, model_kind kind, size_t terms,
                         size_t count, double cutoff, uint64_t seed) {
    const double offset[3] = {0};
    random_bench_at(b, context, kind, terms, count, cutoff, seed, offset);
}

/* Three sweeps of coordinate descent find the minimum over most boxes: all of them for sphere-like
 * terms, and all but a few in a thousand even for needles and pancakes a hundred times as long as
 * thick. Only so many pairs may be listed in vain. */
static void lists_hold_what_terms_reach(void **state) {
    const double cutoff = 1e-5;
    const bool simulated = test_simulated(*state);
    for (size_t kind = 0; kind < MODEL_KINDS; kind = test_next(*state, kind, 3))
        for (size_t grown = 0; grown <= 1; ++grown) {
            const double skin = grown ? 0.37 : 0.0;
            if (simulated && grown != kind % 2)
                continue; /* to the kernels it is one more number */
            bench b;
            pairs p;
            tally t = {0};
            random_bench(&b, *state, (model_kind)kind, test_size(150, 15), test_size(6000, 700),
                         cutoff, 40 + kind);
            test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, skin));
            read_pairs(*state, &b.lists, &p);
            expect_lists(&p);
            expect_pairs(&b, &p, cutoff, skin, &t);
            print_message("%s, skin %.2f: %zu of %zu pairs needed, %zu listed\n",
                          model_kind_name((model_kind)kind), skin, t.wanted, p.terms * p.packs,
                          t.listed);
            if (kind != MODEL_TINY)
                assert_true(t.wanted > 0);
            assert_true(t.wanted < p.terms * p.packs);
            assert_true(t.excess <= (kind == MODEL_SPHERE ? 0 : 2 + t.wanted / 100));
            free_pairs(&p);
            bench_destroy(&b);
        }
}

/* At 1e6 angstrom floats are 0.06 apart: no pair is lost, and not many are listed in vain. */
static void lists_far_from_the_origin(void **state) {
    const double cutoff = 1e-5;
    test_skip_simulated(*state); /* other numbers, the same ways through the kernels */
    for (int kind = 0; kind < MODEL_KINDS; ++kind) {
        bench b;
        pairs p;
        tally t = {0};
        random_bench_at(&b, *state, (model_kind)kind, test_size(150, 15), test_size(6000, 700),
                        cutoff, 40 + (uint64_t)kind, bench_far);
        read_pairs(*state, &b.lists, &p);
        expect_lists(&p);
        expect_pairs(&b, &p, cutoff, 0.0, &t);
        print_message("%s: %zu of %zu pairs needed, %zu listed\n",
                      model_kind_name((model_kind)kind), t.wanted, p.terms * p.packs, t.listed);
        assert_true((double)t.excess <= 2.0 + 0.4 * (double)t.wanted);
        free_pairs(&p);
        bench_destroy(&b);
    }
}

/* A skin of s finds all pairs of terms that have moved by up to s. */
static void skin_covers_motion(void **state) {
    const double cutoff = 1e-4, skin = 0.5, origin[3] = {0};
    bench b;
    pairs p;
    test_random random = {50};
    test_skip_simulated(*state); /* as above */
    random_bench(&b, *state, MODEL_RANDOM, test_size(100, 15), test_size(3000, 500), cutoff, 51);
    test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, skin));
    read_pairs(*state, &b.lists, &p);
    const size_t with_skin = p.items;
    for (size_t i = 0; i < b.terms_count; ++i) {
        double step[3], length = 0.0;
        for (int k = 0; k < 3; ++k) {
            step[k] = random_uniform(&random, -1.0, 1.0);
            length += step[k] * step[k];
        }
        for (int k = 0; k < 3; ++k)
            b.quadrics[i].centre[k] += 0.999 * skin * step[k] / sqrt(length);
    }
    tally t = {0};
    expect_pairs(&b, &p, cutoff, 0.0, &t);
    free_pairs(&p);
    test_check(*state, ov_terms_set(*state, &b.terms, b.quadrics, b.terms_count, origin, cutoff));
    test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, 0.0));
    assert_true(b.lists.items < with_skin);
    bench_destroy(&b);
}

/* Levels of the tree: one group up to 16 packs, then 256, 4096. The whole box in one term's reach,
 * and small terms scattered, so that walks end at every depth. */
static void trees_of_every_depth(void **state) {
    const size_t packs[] = {1, 16, 17, 256, 257, 4096, 4097};
    const size_t count = test_size(sizeof packs / sizeof packs[0], 5);
    const double cutoff = 1e-4;
    for (size_t n = 0; n < count; n = test_next(*state, n, 2)) {
        enum { TERMS = 40 };
        const size_t terms = test_size(TERMS, 12);
        bench b;
        pairs p;
        tally t = {0};
        test_random random = {60 + n};
        ov_quadric quadrics[TERMS] = {0};
        const size_t points = packs[n] * OV_PACK - n;
        const double half = fmin(0.4 * cbrt((double)points), 7.9); /* no pack ends early */
        for (int i = 0; i < TERMS; ++i) {
            ov_quadric *const q = &quadrics[i];
            q->amplitude = 1.0;
            q->a[0] = q->a[3] = q->a[5] = i == 0 ? 1e-6 : 4.0;
            for (int k = 0; k < 3; ++k)
                q->centre[k] = (float)random_uniform(&random, -half, half);
        }
        float *const xyz = random_points(&random, points, half);
        bench_create(&b, *state, quadrics, terms, xyz, points, cutoff);
        assert_int_equal(b.points.packs, packs[n]);
        read_pairs(*state, &b.lists, &p);
        expect_lists(&p);
        expect_pairs(&b, &p, cutoff, 0.0, &t);
        assert_int_equal(p.term_start[1], packs[n]);
        assert_int_equal(t.excess, 0);
        free_pairs(&p);
        free(xyz);
        bench_destroy(&b);
    }
}

/* A term below the cut-off reaches nothing, not even the point at its centre; one just above it
 * does. */
static void terms_below_the_cut_off(void **state) {
    const double cutoff = 1e-4;
    const ov_quadric quadrics[3] = {
        {.amplitude = 0.999e-4, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1.001e-4, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}},
        {.amplitude = 1e-30, .a = {1e-8, 0.0, 0.0, 1e-8, 0.0, 1e-8}},
    };
    const float xyz[3] = {0};
    bench b;
    pairs p;
    bench_create(&b, *state, quadrics, 3, xyz, 1, cutoff);
    read_pairs(*state, &b.lists, &p);
    expect_lists(&p);
    assert_int_equal(p.items, 1);
    assert_true(ov_list_holds(p.term_start, p.term_item, 1, 0));
    free_pairs(&p);
    bench_destroy(&b);
}

static void nothing_to_pair(void **state) {
    const ov_quadric far = {
        .amplitude = 1.0, .centre = {1e4, 0.0, 0.0}, .a = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}};
    test_random random = {70};
    float *const xyz = random_points(&random, 1000, 5.0);
    const size_t terms[] = {1, 0, 1, 0}, counts[] = {1000, 1000, 0, 0};
    for (int n = 0; n < 4; ++n) {
        bench b;
        pairs p;
        bench_create(&b, *state, &far, terms[n], xyz, counts[n], 1e-7);
        read_pairs(*state, &b.lists, &p);
        assert_int_equal(p.items, 0);
        if (counts[n] > 0 && terms[n] > 0)
            expect_lists(&p);
        free_pairs(&p);
        bench_destroy(&b);
    }
    free(xyz);
}

/* One structure serves fits whose terms grow fewer and samplers whose pieces differ. */
static void lists_can_be_rebuilt(void **state) {
    const double cutoff = 1e-4, origin[3] = {0};
    bench b;
    test_skip_simulated(*state); /* few_lists_repeat() is there for that */
    random_bench(&b, *state, MODEL_RANDOM, 40, test_size(2000, 300), cutoff, 80);
    for (size_t terms = 40; terms > 10; terms -= 13) {
        pairs p;
        tally t = {0};
        b.terms_count = terms;
        test_check(*state, ov_terms_set(*state, &b.terms, b.quadrics, terms, origin, cutoff));
        test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, 0.0));
        read_pairs(*state, &b.lists, &p);
        assert_int_equal(p.terms, terms);
        expect_lists(&p);
        expect_pairs(&b, &p, cutoff, 0.0, &t);
        free_pairs(&p);
    }
    bench_destroy(&b);
}

/* Either list by itself is what it is beside the other, in one structure after another size. */
static void either_list_alone(void **state) {
    bench b;
    ov_lists alone = {0};
    const int rounds = test_simulated(*state) ? 2 : 4; /* one of each */
    for (int round = 0; round < rounds; ++round) {
        pairs whole;
        random_bench(&b, *state, MODEL_RANDOM, round == 2 ? 90 : 30,
                     test_size(round == 1 ? 3000 : 1000, 200), 1e-4, 90 + (uint64_t)round);
        read_pairs(*state, &b.lists, &whole);
        alone.terms_only = round % 2 == 0;
        alone.packs_only = !alone.terms_only;
        test_check(*state, ov_lists_build(*state, &alone, &b.points, &b.terms, 0.0));
        assert_int_equal(alone.items, whole.items);
        const ov_buffer *const item = alone.terms_only ? &alone.term_item : &alone.pack_item;
        const ov_buffer *const start = alone.terms_only ? &alone.term_start : &alone.pack_start;
        const size_t starts = 1 + (alone.terms_only ? whole.terms : whole.packs);
        uint32_t *const items = read_indices(*state, item, whole.items);
        uint32_t *const begins = read_indices(*state, start, starts);
        assert_memory_equal(items, alone.terms_only ? whole.term_item : whole.pack_item,
                            whole.items * sizeof *items);
        assert_memory_equal(begins, alone.terms_only ? whole.term_start : whole.pack_start,
                            starts * sizeof *begins);
        free(items);
        free(begins);
        free_pairs(&whole);
        bench_destroy(&b);
    }
    ov_lists_destroy(&alone);
}

/* The twin of scan_lists: starts of `count` counts, and their sum. */
static uint64_t starts_of(const uint32_t *counts, size_t count, uint32_t *start) {
    uint64_t sum = 0;
    for (size_t k = 0; k < count; ++k) {
        start[k] = (uint32_t)sum;
        sum += counts[k];
    }
    return sum;
}

enum {
    SCAN_TERMS = 300,
    SCAN_GROUPS = 21,
    SCAN_BINS = SCAN_GROUPS * OV_BINS,
    SCAN_STARTS = SCAN_BINS + SCAN_GROUPS + SCAN_TERMS
};

/* The kernel against its twin; zeros where there is no room. The counts are zero afterwards. */
static void expect_starts(ovoid_context *context, size_t group,
                          const uint32_t counts[1 + SCAN_STARTS], cl_uint4 room, bool fits) {
    ov_kernel kernel = {0};
    ov_buffer counted = {0}, place = {0}, start = {0}, totals = {0};
    uint32_t wanted[SCAN_STARTS + 1];
    const cl_uint terms = SCAN_TERMS, groups = SCAN_GROUPS;
    const uint64_t entries = starts_of(counts + 1, SCAN_BINS, wanted);
    starts_of(counts + 1 + SCAN_BINS, SCAN_GROUPS, wanted + SCAN_BINS);
    const uint64_t items = starts_of(counts + 1 + SCAN_BINS + SCAN_GROUPS, SCAN_TERMS,
                                     wanted + SCAN_BINS + SCAN_GROUPS);
    wanted[SCAN_STARTS] = (uint32_t)items;
    if (!fits)
        memset(wanted, 0, sizeof wanted);
    test_check(context, ov_kernel_create(context, "lists", "scan_lists", &kernel));
    test_check(context, ov_buffer_put(context, &counted, counts, (1 + SCAN_STARTS) * sizeof *counts,
                                      "counts"));
    test_check(context,
               ov_buffer_reserve(context, &place, (SCAN_BINS + SCAN_GROUPS) * 4, "starts"));
    test_check(context, ov_buffer_reserve(context, &start, (SCAN_TERMS + 1) * 4, "starts"));
    test_check(context, ov_buffer_reserve(context, &totals, 5 * 4, "totals"));
    test_check(context, OV_LAUNCH(context, &kernel, group, group, OV_ARG(terms), OV_ARG(groups),
                                  OV_ARG(room), OV_ARG(counted.memory), OV_ARG(place.memory),
                                  OV_ARG(start.memory), OV_ARG(totals.memory)));
    uint32_t *const total = read_indices(context, &totals, 5);
    uint32_t *const places = read_indices(context, &place, SCAN_BINS + SCAN_GROUPS);
    uint32_t *const starts = read_indices(context, &start, SCAN_TERMS + 1);
    uint32_t *const left = read_indices(context, &counted, 1 + SCAN_STARTS);
    assert_true(total[0] == counts[0] && total[1] == entries && total[4] == fits);
    assert_true(total[2] == (uint32_t)items && total[3] == items >> 32);
    assert_memory_equal(places, wanted, (SCAN_BINS + SCAN_GROUPS) * sizeof *wanted);
    assert_memory_equal(starts, wanted + SCAN_BINS + SCAN_GROUPS,
                        (SCAN_TERMS + 1) * sizeof *wanted);
    for (size_t k = 0; k < 1 + SCAN_STARTS; ++k)
        assert_int_equal(left[k], 0);
    free(total);
    free(places);
    free(starts);
    free(left);
    ov_buffer *const buffers[] = {&counted, &place, &start, &totals};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_kernel_destroy(&kernel);
}

/* Whatever the work-group; with room to the last one, with one too little of each, and with sums
 * beyond 32 bits. */
static void counts_become_starts(void **state) {
    const size_t groups[] = {1, 7, 32};
    for (size_t n = 0; n < sizeof groups / sizeof *groups; ++n) {
        test_random random = {n};
        uint32_t counts[1 + SCAN_STARTS], unused[SCAN_STARTS];
        for (size_t k = 0; k < 1 + SCAN_STARTS; ++k)
            counts[k] = (uint32_t)(random_bits(&random) % 50);
        const cl_uint4 exact = {
            {counts[0], (cl_uint)starts_of(counts + 1, SCAN_BINS, unused),
             (cl_uint)starts_of(counts + 1 + SCAN_BINS + SCAN_GROUPS, SCAN_TERMS, unused), 0}};
        expect_starts(*state, groups[n], counts, exact, true);
        for (int k = 0; k < 3; ++k) {
            cl_uint4 less = exact;
            --less.s[k];
            if (exact.s[k] > 0)
                expect_starts(*state, groups[n], counts, less, false);
        }
        for (size_t k = 1 + SCAN_BINS + SCAN_GROUPS; k < 1 + SCAN_STARTS; ++k)
            counts[k] += 1u << 25;
        const cl_uint4 all = {{UINT32_MAX, UINT32_MAX, UINT32_MAX, 0}};
        expect_starts(*state, groups[n], counts, all, false);
    }
}

static void expect_same_pairs(const pairs *a, const pairs *b) {
    assert_true(a->items == b->items && a->terms == b->terms && a->packs == b->packs);
    assert_memory_equal(a->term_start, b->term_start, (a->terms + 1) * sizeof *a->term_start);
    assert_memory_equal(a->term_item, b->term_item, a->items * sizeof *a->term_item);
    assert_memory_equal(a->pack_start, b->pack_start, (a->packs + 1) * sizeof *a->pack_start);
    assert_memory_equal(a->pack_item, b->pack_item, a->items * sizeof *a->pack_item);
}

/* In memory that suffices the lists are the same; else they are empty, and said not to be whole. */
static void expect_built_without_waiting(void **state, size_t terms) {
    bench small, large;
    ov_lists lists = {0};
    pairs wanted, got;
    bool whole = false;
    random_bench(&small, *state, MODEL_RANDOM, 5, test_size(1000, 200), 1e-4, 70);
    random_bench(&large, *state, MODEL_RANDOM, terms, test_size(3000, 300), 1e-4, 71);
    assert_false(ov_lists_built(&lists));
    test_check(*state, ov_lists_build(*state, &lists, &small.points, &small.terms, 0.0));
    assert_true(ov_lists_built(&lists));
    const uint64_t reads = small.context->device->counts[OVOID_COUNT_BLOCKING_READS];
    test_check(*state, ov_lists_begin(*state, &lists, &large.points, &large.terms, 0.0));
    test_check(*state, ov_lists_end(*state, &lists, &whole));
    assert_false(whole);
    read_pairs(*state, &lists, &got);
    assert_true(got.items == 0 && got.pack_start[got.packs] == 0 && got.term_start[got.terms] == 0);
    free_pairs(&got);
    test_check(*state, ov_lists_build(*state, &lists, &large.points, &large.terms, 0.0));
    for (int round = 0; round < 2; ++round) { /* the larger one, then the smaller one */
        const bench *const b = round == 0 ? &large : &small;
        const uint64_t before = b->context->device->counts[OVOID_COUNT_BLOCKING_READS];
        test_check(*state, ov_lists_begin(*state, &lists, &b->points, &b->terms, 0.0));
        test_check(*state, ov_lists_end(*state, &lists, &whole));
        assert_int_equal(b->context->device->counts[OVOID_COUNT_BLOCKING_READS], before);
        assert_true(whole && before > reads);
        read_pairs(*state, &b->lists, &wanted);
        read_pairs(*state, &lists, &got);
        expect_same_pairs(&got, &wanted);
        free_pairs(&wanted);
        free_pairs(&got);
    }
    ov_lists_destroy(&lists);
    bench_destroy(&small);
    bench_destroy(&large);
}

/* Few are made in two launches, many in four. */
static void built_without_waiting(void **state) {
    const size_t few = test_size(200, 20), many = 1100;
    expect_built_without_waiting(state, few);
    if (!test_small())
        expect_built_without_waiting(state, many);
}

/* The memory of few serves others, of more and of fewer terms and packs, packs alone or both. */
static void few_lists_repeat(void **state) {
    static const size_t terms[] = {60, 900, 3, 200, 1, 60},
                        points[] = {3000, 2000, 6000, 1000, 1500, 3000};
    const size_t few = test_simulated(*state) ? 2 : 3;
    const size_t rounds = test_size(sizeof terms / sizeof *terms, few);
    ov_lists lists = {0};
    for (size_t n = 0; n < rounds; ++n) {
        bench b;
        pairs wanted;
        bool whole = false;
        random_bench(&b, *state, MODEL_RANDOM, test_size(terms[n], 3 + 10 * n),
                     test_size(points[n], 300), 1e-4, 80 + n);
        read_pairs(*state, &b.lists, &wanted);
        for (int round = 0; round < 3; ++round) {
            lists.packs_only = round == 1;
            test_check(*state, round == 0
                                   ? ov_lists_build(*state, &lists, &b.points, &b.terms, 0.0)
                                   : ov_lists_begin(*state, &lists, &b.points, &b.terms, 0.0));
            if (round > 0)
                test_check(*state, ov_lists_end(*state, &lists, &whole));
            assert_true(round == 0 || whole);
            uint32_t *const start = read_indices(*state, &lists.pack_start, b.points.packs + 1);
            uint32_t *const item = read_indices(*state, &lists.pack_item, lists.items);
            assert_memory_equal(start, wanted.pack_start, (b.points.packs + 1) * sizeof *start);
            assert_memory_equal(item, wanted.pack_item, lists.items * sizeof *item);
            free(start);
            free(item);
        }
        lists.packs_only = false;
        free_pairs(&wanted);
        bench_destroy(&b);
    }
    ov_lists_destroy(&lists);
}

/* Entries come to their group in whatever order work-items happen to run; here, in the worst one.
 */
static void lists_are_sorted_on_the_device(void **state) {
    enum { GROUPS = 9, PACKS = GROUPS * OV_GROUP - 3, LENGTH = 60 };
    test_random random = {95};
    uint32_t place[GROUPS * OV_BINS + GROUPS] = {0}, term[GROUPS * LENGTH];
    uint16_t bits[GROUPS * LENGTH];
    bool paired[PACKS][LENGTH] = {{false}};
    ov_kernel lists = {0};
    ov_buffer places = {0}, group_terms = {0}, group_bits = {0}, start = {0}, item = {0};
    const cl_uint groups = GROUPS, packs = PACKS;
    uint32_t used = 0, expected = 0;
    ov_device *device;
    test_check(*state, ov_device_get(*state, &device));
    const size_t team = device->team >= OV_GROUP ? device->team : 1;
    for (uint32_t g = 0; g < GROUPS; ++g) {
        const uint32_t length = g == 0 ? 0 : g == 1 ? 1 : LENGTH - g;
        place[GROUPS * OV_BINS + g] = expected;
        for (uint32_t k = 0; k < length; ++k, ++used) {
            /* backwards, or in a stride without a common factor */
            const uint32_t i = g % 2 ? length - 1 - k : k * 23 % length;
            const uint32_t left = PACKS - g * OV_GROUP;
            const uint32_t mask = left < OV_GROUP ? (1u << left) - 1u : (1u << OV_GROUP) - 1u;
            term[used] = i;
            bits[used] = (uint16_t)(random_bits(&random) >> 40 & mask);
            for (uint32_t j = 0; j < OV_GROUP && j < left; ++j)
                if (bits[used] >> j & 1u && !paired[g * OV_GROUP + j][i]) {
                    paired[g * OV_GROUP + j][i] = true;
                    ++expected;
                }
        }
        for (uint32_t bin = 0; bin < OV_BINS; ++bin)
            place[g * OV_BINS + bin] = used; /* where they end; the first bin has all of them */
    }
    test_check(*state, ov_kernel_create(*state, "lists", "lists_of_packs", &lists));
    test_check(*state, ov_buffer_reserve(*state, &places, sizeof place, "places"));
    test_check(*state, ov_buffer_write(*state, &places, 0, place, sizeof place));
    test_check(*state, ov_buffer_reserve(*state, &group_terms, sizeof term, "terms"));
    test_check(*state, ov_buffer_write(*state, &group_terms, 0, term, used * sizeof *term));
    test_check(*state, ov_buffer_reserve(*state, &group_bits, sizeof bits, "bits"));
    test_check(*state, ov_buffer_write(*state, &group_bits, 0, bits, used * sizeof *bits));
    test_check(*state, ov_buffer_reserve(*state, &start, (PACKS + 1) * sizeof *term, "starts"));
    test_check(*state, ov_buffer_reserve(*state, &item, expected * sizeof *term, "items"));
    test_check(*state,
               OV_LAUNCH(*state, &lists, GROUPS * team, team, OV_ARG(groups), OV_ARG(packs),
                         OV_ARG(places.memory), OV_ARG(group_terms.memory),
                         OV_ARG(group_bits.memory), OV_ARG(start.memory), OV_ARG(item.memory)));
    uint32_t *const starts = read_indices(*state, &start, PACKS + 1);
    uint32_t *const items = read_indices(*state, &item, expected);
    expect_csr(starts, items, PACKS, expected, LENGTH);
    for (size_t pack = 0; pack < PACKS; ++pack)
        for (uint32_t i = 0; i < LENGTH; ++i)
            assert_true(ov_list_holds(starts, items, pack, i) == paired[pack][i]);
    free(starts);
    free(items);
    ov_kernel_destroy(&lists);
    ov_buffer_destroy(&places);
    ov_buffer_destroy(&group_terms);
    ov_buffer_destroy(&group_bits);
    ov_buffer_destroy(&start);
    ov_buffer_destroy(&item);
}

/* Terms that reach nearly all packs need far more chunks than lists begin with, some of them in the
 * middle of a chunk's entries, and lists of packs alone are the same. */
static void wide_terms_find_room(void **state) {
    enum { TERMS = 5 };
    const double cutoff = 1e-4;
    const size_t points = test_size(3000, 500) * OV_PACK, packs = points / OV_PACK;
    test_random random = {97};
    ov_quadric quadrics[TERMS] = {0};
    for (int i = 0; i < TERMS; ++i) {
        quadrics[i].amplitude = 1.0;
        quadrics[i].a[0] = quadrics[i].a[3] = quadrics[i].a[5] = i == 3 ? 1.0 : 1e-5 * (i + 1.0);
        quadrics[i].centre[0] = 4.0 * i;
    }
    float *const xyz = random_points(&random, points, 10.0);
    bench b;
    pairs p;
    tally t = {0};
    bench_create(&b, *state, quadrics, TERMS, xyz, points, cutoff);
    read_pairs(*state, &b.lists, &p);
    expect_lists(&p);
    expect_pairs(&b, &p, cutoff, 0.0, &t);
    assert_int_equal(p.term_start[1], packs);
    assert_int_equal(t.excess, 0);

    ov_lists alone = {.packs_only = true};
    test_check(*state, ov_lists_build(*state, &alone, &b.points, &b.terms, 0.0));
    assert_null(alone.term_item.memory);
    assert_int_equal(alone.items, p.items);
    uint32_t *const start = read_indices(*state, &alone.pack_start, packs + 1);
    uint32_t *const item = read_indices(*state, &alone.pack_item, alone.items);
    assert_memory_equal(start, p.pack_start, (packs + 1) * sizeof *start);
    assert_memory_equal(item, p.pack_item, alone.items * sizeof *item);
    free(start);
    free(item);
    free(xyz);
    free_pairs(&p);
    ov_lists_destroy(&alone);
    bench_destroy(&b);
}

/* Order of construction aside, the same input gives the same lists: sums have one order. */
static void lists_are_reproducible(void **state) {
    bench b;
    pairs first, second;
    test_skip_simulated(*state); /* a simulator's order is its own */
    random_bench(&b, *state, MODEL_RANDOM, test_size(400, 30), test_size(4000, 300), 1e-5, 90);
    read_pairs(*state, &b.lists, &first);
    test_check(*state, ov_lists_build(*state, &b.lists, &b.points, &b.terms, 0.0));
    read_pairs(*state, &b.lists, &second);
    assert_int_equal(first.items, second.items);
    assert_memory_equal(first.pack_item, second.pack_item, first.items * sizeof(uint32_t));
    assert_memory_equal(first.term_item, second.term_item, first.items * sizeof(uint32_t));
    free_pairs(&first);
    free_pairs(&second);
    bench_destroy(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lists_hold_what_terms_reach),
        cmocka_unit_test(lists_far_from_the_origin),
        cmocka_unit_test(skin_covers_motion),
        cmocka_unit_test(trees_of_every_depth),
        cmocka_unit_test(terms_below_the_cut_off),
        cmocka_unit_test(nothing_to_pair),
        cmocka_unit_test(lists_can_be_rebuilt),
        cmocka_unit_test(either_list_alone),
        cmocka_unit_test(counts_become_starts),
        cmocka_unit_test(built_without_waiting),
        cmocka_unit_test(few_lists_repeat),
        cmocka_unit_test(lists_are_sorted_on_the_device),
        cmocka_unit_test(wide_terms_find_room),
        cmocka_unit_test(lists_are_reproducible),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
