/* Points in packs: the curve, the sort, the tree of boxes, the packs. Nothing here needs a kernel,
 * but points live on a device. */
#include "support.h"

static void curve_visits_every_cell_stepping_to_neighbours(void **state) {
    (void)state;
    for (unsigned bits = 1; bits <= 5; ++bits) {
        const uint32_t side = 1u << bits;
        const size_t cells = (size_t)side * side * side;
        uint32_t(*const at)[3] = test_alloc(cells, sizeof *at);
        bool *const seen = test_alloc(cells, sizeof *seen);
        for (uint32_t z = 0; z < side; ++z)
            for (uint32_t y = 0; y < side; ++y)
                for (uint32_t x = 0; x < side; ++x) {
                    const uint64_t index = ov_hilbert_index(x, y, z, bits);
                    assert_true(index < cells);
                    assert_false(seen[index]);
                    seen[index] = true;
                    at[index][0] = x;
                    at[index][1] = y;
                    at[index][2] = z;
                }
        for (size_t k = 1; k < cells; ++k) {
            int way = 0;
            for (int axis = 0; axis < 3; ++axis)
                way += abs((int)at[k][axis] - (int)at[k - 1][axis]);
            assert_int_equal(way, 1);
        }
        free(at);
        free(seen);
    }
}

static void curve_uses_all_its_bits(void **state) {
    (void)state;
    for (unsigned bits = 1; bits <= 21; ++bits) {
        const uint32_t last = (uint32_t)((1ull << bits) - 1);
        uint64_t index[4] = {ov_hilbert_index(0, 0, 0, bits), ov_hilbert_index(last, 0, 0, bits),
                             ov_hilbert_index(0, last, 0, bits),
                             ov_hilbert_index(0, 0, last, bits)};
        const uint64_t end = 1ull << (3 * bits);
        int ends = 0;
        for (int k = 0; k < 4; ++k) {
            assert_true(index[k] < end);
            ends += index[k] == 0 || index[k] == end - 1;
        }
        assert_int_equal(ends, 2); /* the curve runs along one edge of the cube */
    }
}

/* Skilling's own form of the curve: the axes are turned into the transposed index in place, one bit
 * plane at a time. */
static void axes_to_transpose(uint32_t axis[3], unsigned bits) {
    for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1) {
        const uint32_t below = bit - 1;
        for (int k = 0; k < 3; ++k) {
            if (axis[k] & bit) {
                axis[0] ^= below;
            } else {
                const uint32_t swap = (axis[0] ^ axis[k]) & below;
                axis[0] ^= swap;
                axis[k] ^= swap;
            }
        }
    }
    axis[1] ^= axis[0];
    axis[2] ^= axis[1];
    uint32_t flip = 0;
    for (uint32_t bit = 1u << (bits - 1); bit > 1; bit >>= 1)
        if (axis[2] & bit)
            flip ^= bit - 1;
    for (int k = 0; k < 3; ++k)
        axis[k] ^= flip;
}

static void curve_is_the_one_defined(void **state) {
    (void)state;
    test_random random = {5};
    for (unsigned bits = 1; bits <= 21; ++bits)
        for (int n = 0; n < 3000; ++n) {
            const uint32_t mask = (1u << bits) - 1;
            uint32_t axis[3];
            for (int k = 0; k < 3; ++k)
                axis[k] = (uint32_t)(random_bits(&random) >> 20) & mask;
            const uint64_t index = ov_hilbert_index(axis[0], axis[1], axis[2], bits);
            axes_to_transpose(axis, bits);
            uint64_t defined = 0;
            for (unsigned b = bits; b-- > 0;)
                for (int k = 0; k < 3; ++k)
                    defined = defined << 1 | (axis[k] >> b & 1u);
            assert_true(index == defined);
        }
}

/* ---- sort --------------------------------------------------------------------------------- */

static void expect_sorted(ovoid_context *context, const uint64_t *keys, size_t count) {
    uint32_t *const order = test_alloc(count, sizeof *order);
    bool *const seen = test_alloc(count, sizeof *seen);
    test_check(context, ov_sort_keys(context, keys, count, order));
    for (size_t k = 0; k < count; ++k) {
        assert_true(order[k] < count);
        assert_false(seen[order[k]]);
        seen[order[k]] = true;
        if (k > 0) {
            assert_true(keys[order[k - 1]] <= keys[order[k]]);
            if (keys[order[k - 1]] == keys[order[k]])
                assert_true(order[k - 1] < order[k]); /* stable */
        }
    }
    free(order);
    free(seen);
}

static void sort_orders_keys_of_every_width(void **state) {
    enum { COUNT = 5000 };
    test_random random = {1};
    uint64_t *const keys = test_alloc(COUNT, sizeof *keys);
    for (unsigned width = 1; width <= 64; ++width) {
        for (size_t k = 0; k < COUNT; ++k)
            keys[k] = random_bits(&random) >> (64 - width);
        expect_sorted(*state, keys, COUNT);
    }
    free(keys);
}

static void sort_takes_small_and_equal_keys(void **state) {
    uint64_t keys[100] = {0};
    for (size_t count = 0; count <= 3; ++count) {
        for (size_t k = 0; k < count; ++k)
            keys[k] = UINT64_MAX - k;
        expect_sorted(*state, keys, count);
    }
    for (size_t k = 0; k < 100; ++k)
        keys[k] = 42;
    expect_sorted(*state, keys, 100);
    memset(keys, 0, sizeof keys);
    expect_sorted(*state, keys, 100);
}

/* ---- tree --------------------------------------------------------------------------------- */

static void box_of(const float *boxes, const ov_tree *tree, unsigned level, size_t box,
                   float value[6]) {
    const size_t group = tree->groups[level] + box / OV_GROUP;
    for (size_t k = 0; k < 6; ++k)
        value[k] = boxes[group * 6 * OV_GROUP + k * OV_GROUP + box % OV_GROUP];
}

/* The device makes the same of the leaves. */
static void expect_tree_on_device(ovoid_context *context, const float *leaves, size_t count,
                                  const ov_tree *wanted, const float *boxes, size_t floats) {
    ov_buffer on_device = {0}, made = {0};
    ov_tree tree;
    if (count == 0 || count > test_size(count, 4200))
        return;
    write_floats(context, &on_device, leaves, 6 * count);
    test_check(context, ov_tree_grow(context, &on_device, count, &tree, &made));
    assert_memory_equal(&tree, wanted, sizeof tree);
    float *const got = read_floats(context, &made, floats);
    assert_memory_equal(got, boxes, floats * sizeof *got);
    free(got);
    ov_buffer_destroy(&on_device);
    ov_buffer_destroy(&made);
}

/* Every box is exactly the hull of its children, level 0 holds the leaves, and what fills up a
 * group is empty. */
static void expect_tree(ovoid_context *context, size_t count, uint64_t seed) {
    test_random random = {seed};
    float *const leaves = test_alloc(6 * count, sizeof *leaves), *boxes = NULL;
    size_t floats = 0;
    ov_tree tree;
    for (size_t k = 0; k < count; ++k)
        for (size_t axis = 0; axis < 3; ++axis) {
            const double low = random_uniform(&random, -100.0, 100.0);
            leaves[6 * k + axis] = (float)low;
            leaves[6 * k + axis + 3] = (float)(low + random_uniform(&random, 0.0, 5.0));
        }
    test_check(context, ov_tree_build(context, leaves, count, &tree, &boxes, &floats));
    size_t expected = count, groups = 0;
    for (unsigned level = 0; level < tree.levels; ++level) {
        const size_t used = (expected + OV_GROUP - 1) / OV_GROUP;
        assert_int_equal(tree.boxes[level], expected);
        assert_int_equal(tree.groups[level], groups);
        for (size_t b = 0; b < used * OV_GROUP; ++b) {
            float box[6], hull[6] = {FLT_MAX, FLT_MAX, FLT_MAX, -FLT_MAX, -FLT_MAX, -FLT_MAX};
            box_of(boxes, &tree, level, b, box);
            if (b >= expected) {
                assert_true(box[0] > box[3]);
                continue;
            }
            if (level == 0) {
                assert_memory_equal(box, leaves + 6 * b, sizeof box);
                continue;
            }
            for (size_t c = b * OV_GROUP; c < (b + 1) * OV_GROUP && c < tree.boxes[level - 1];
                 ++c) {
                float child[6];
                box_of(boxes, &tree, level - 1, c, child);
                for (int k = 0; k < 3; ++k) {
                    hull[k] = fminf(hull[k], child[k]);
                    hull[k + 3] = fmaxf(hull[k + 3], child[k + 3]);
                }
            }
            assert_memory_equal(box, hull, sizeof box);
        }
        groups += used;
        expected = used;
    }
    assert_int_equal(floats, groups * OV_GROUP * 6);
    expect_tree_on_device(context, leaves, count, &tree, boxes, floats);
    if (count > 0) /* the last level is one group */
        assert_true(tree.boxes[tree.levels - 1] <= OV_GROUP);
    else
        assert_int_equal(tree.levels, 0);
    free(boxes);
    free(leaves);
}

static void tree_contains_its_leaves(void **state) {
    const size_t counts[] = {0, 1, 15, 16, 17, 255, 256, 257, 4096, 4097, 70000};
    for (size_t n = 0; n < sizeof counts / sizeof counts[0]; ++n)
        expect_tree(*state, counts[n], n);
}

static void tree_has_a_limit(void **state) {
    ov_tree tree;
    float *boxes = NULL;
    size_t floats = 0;
    test_refused(
        *state,
        ov_tree_build(*state, NULL, ((size_t)1 << (4 * OV_LEVELS)) + 1, &tree, &boxes, &floats),
        OVOID_ERROR_LIMIT, "boxes");
    assert_null(boxes);
    test_refused(*state,
                 ov_tree_grow(*state, &(ov_buffer){0}, ((size_t)1 << (4 * OV_LEVELS)) + 1, &tree,
                              &(ov_buffer){0}),
                 OVOID_ERROR_LIMIT, "boxes");
}

/* ---- packs -------------------------------------------------------------------------------- */

/* What a place of a pack may be off, from rounding about the pack's own origin. */
#define PLACE_ERROR 0x1p-22 /* half a unit in the last place of 8 angstrom */

/* Box k of the packs is around the pack, and rounded outwards by no more than a float. */
static void expect_box(const float *boxes, const ov_points *points, size_t pack,
                       const double hull[6]) {
    float box[6];
    box_of(boxes, &points->tree, 0, pack, box);
    for (int k = 0; k < 6; ++k) {
        const double out = (k < 3 ? -1.0 : 1.0) * (box[k] - (hull[k] - points->origin[k % 3]));
        assert_true(out > -PLACE_ERROR * 4.0 && out < PLACE_ERROR * 4.0 + points->rounding);
    }
}

/* The packs hold each point once, in `order`, close to the double; what fills a pack up repeats its
 * last point; the leaf boxes are about the packs' hulls, whose sides are 16 angstrom or 8 cells at
 * most. Returns the mean diagonal of the boxes. */
static double expect_packs(ovoid_context *context, const double *xyz, size_t count,
                           double resolution) {
    const double origin[3] = {1.0, 2.0, 3.0};
    ov_points points = {0};
    test_check(context, ov_points_create(context, xyz, count, origin, resolution, &points));
    assert_int_equal(points.count, count);
    assert_true(points.packs >= (count + OV_PACK - 1) / OV_PACK && points.packs <= count);
    assert_memory_equal(points.origin, origin, sizeof origin);
    bool *const seen = test_alloc(count, sizeof *seen);
    size_t groups = 0, found = 0;
    for (unsigned level = 0; level < points.tree.levels; ++level)
        groups += (points.tree.boxes[level] + OV_GROUP - 1) / OV_GROUP;
    double *const places = read_places(context, &points);
    float *const boxes = read_floats(context, &points.boxes, groups * OV_GROUP * 6);
    double diagonals = 0.0;
    for (size_t pack = 0; pack < points.packs; ++pack) {
        double hull[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK; ++k) {
            const size_t from = points.order[k];
            assert_true(from < count && seen[from] == ov_points_fill(&points, k));
            if (ov_points_fill(&points, k))
                assert_int_equal(from, points.order[k - 1]);
            found += !seen[from];
            seen[from] = true;
            for (size_t axis = 0; axis < 3; ++axis) {
                expect_near(places[3 * k + axis], xyz[3 * from + axis],
                            PLACE_ERROR * fmax(1.0, resolution), "a coordinate");
                hull[axis] = fmin(hull[axis], xyz[3 * from + axis]);
                hull[axis + 3] = fmax(hull[axis + 3], xyz[3 * from + axis]);
            }
        }
        expect_box(boxes, &points, pack, hull);
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            assert_true(hull[k + 3] - hull[k] <= fmax(16.0, 8.0 * resolution));
            square += (hull[k + 3] - hull[k]) * (hull[k + 3] - hull[k]);
        }
        diagonals += sqrt(square);
    }
    assert_int_equal(found, count);
    const double mean = points.packs > 0 ? diagonals / (double)points.packs : 0.0;
    free(seen);
    free(places);
    free(boxes);
    ov_points_destroy(&points);
    ov_points_destroy(&points);
    return mean;
}

static double *random_places(test_random *random, size_t count, double half) {
    double *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < 3 * count; ++k)
        xyz[k] = random_uniform(random, -half, half);
    return xyz;
}

static void packs_hold_every_point_once(void **state) {
    const size_t counts[] = {0, 1, 15, 16, 17, 31, 32, 33, 256, 257, 5000};
    for (size_t n = 0; n < sizeof counts / sizeof counts[0]; ++n) {
        test_random random = {n};
        double *const xyz = random_places(&random, counts[n], 10.0);
        expect_packs(*state, xyz, counts[n], 0.5);
        free(xyz);
    }
}

/* The point of the curve: 16 consecutive points of a lattice lie together. A brick of 4 x 2 x 2 has
 * a diagonal of 3.3 steps, a row of 16 has 15. */
static void packs_are_compact(void **state) {
    enum { SIDE = 20 };
    double *const xyz = test_alloc(3 * SIDE * SIDE * SIDE, sizeof *xyz);
    for (size_t k = 0; k < SIDE * SIDE * SIDE; ++k) {
        xyz[3 * k] = (double)(k % SIDE);
        xyz[3 * k + 1] = (double)(k / SIDE % SIDE);
        xyz[3 * k + 2] = (double)(k / (SIDE * SIDE));
    }
    const double mean = expect_packs(*state, xyz, SIDE * SIDE * SIDE, 1.0);
    print_message("mean diagonal of a pack: %.2f steps\n", mean);
    assert_true(mean < 4.5);
    free(xyz);
}

static void coincident_points(void **state) {
    enum { COUNT = 100 };
    double xyz[3 * COUNT];
    for (int k = 0; k < 3 * COUNT; ++k)
        xyz[k] = (double)(k % 3) - 0.7;
    expect_packs(*state, xyz, COUNT, 0.5);
    expect_packs(*state, xyz, COUNT, 0.0); /* the step of a lattice that is one point */
}

/* Far coordinates, a spread that the curve's bits cannot resolve, flat and straight sets. */
static void odd_extents(void **state) {
    enum { COUNT = 300 };
    test_random random = {5};
    double *const xyz = random_places(&random, COUNT, 5.0);
    for (size_t k = 0; k < COUNT; ++k)
        xyz[3 * k] += 1e6;
    expect_packs(*state, xyz, COUNT, 0.5);
    for (size_t k = 0; k < COUNT; ++k)
        xyz[3 * k] = k % 2 ? 1e12 : -1e12;
    expect_packs(*state, xyz, COUNT, 0.5);
    for (size_t k = 0; k < COUNT; ++k)
        xyz[3 * k] = 0.0;
    expect_packs(*state, xyz, COUNT, 0.5);
    for (size_t k = 0; k < COUNT; ++k)
        xyz[3 * k + 1] = -3.0;
    expect_packs(*state, xyz, COUNT, 0.5);
    free(xyz);
}

/* A pack ends where the next point is far away: clusters a thousand angstrom apart, and points that
 * are all alone. Those of a cluster still share packs. */
static void packs_end_at_gaps(void **state) {
    enum { CLUSTERS = 10, OWN = 37, COUNT = CLUSTERS * OWN };
    const double origin[3] = {0.0, 0.0, 0.0};
    test_random random = {6};
    double xyz[3 * COUNT];
    ov_points points = {0};
    for (size_t k = 0; k < COUNT; ++k)
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * k + axis] = 1e3 * (double)(k % CLUSTERS) + random_uniform(&random, -3.0, 3.0);
    expect_packs(*state, xyz, COUNT, 0.5);
    test_check(*state, ov_points_create(*state, xyz, COUNT, origin, 0.5, &points));
    assert_int_equal(points.packs, CLUSTERS * 3);
    ov_points_destroy(&points);
    for (size_t k = 0; k < 3 * COUNT; ++k)
        xyz[k] = random_uniform(&random, -1e6, 1e6);
    expect_packs(*state, xyz, COUNT, 1.0);
}

/* The curve is fine enough to keep the packs of dense clusters small, as far apart as they may be.
 */
static void clusters_at_both_ends(void **state) {
    enum { COUNT = 20000 };
    const double origin[3] = {0.0, 0.0, 0.0};
    test_random random = {8};
    double *const xyz = random_places(&random, COUNT, 15.0);
    ov_points points = {0};
    for (size_t k = 0; k < 3 * COUNT; ++k)
        xyz[k] += k / 3 % 2 ? 1e6 : -1e6;
    test_check(*state, ov_points_create(*state, xyz, COUNT, origin, 1.0, &points));
    assert_true(points.packs < COUNT / OV_PACK + 10);
    assert_true(expect_packs(*state, xyz, COUNT, 1.0) < 7.0);
    ov_points_destroy(&points);
    free(xyz);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(curve_visits_every_cell_stepping_to_neighbours),
        cmocka_unit_test(curve_uses_all_its_bits),
        cmocka_unit_test(curve_is_the_one_defined),
        cmocka_unit_test(sort_orders_keys_of_every_width),
        cmocka_unit_test(sort_takes_small_and_equal_keys),
        cmocka_unit_test(tree_contains_its_leaves),
        cmocka_unit_test(tree_has_a_limit),
        cmocka_unit_test(packs_hold_every_point_once),
        cmocka_unit_test(packs_are_compact),
        cmocka_unit_test(coincident_points),
        cmocka_unit_test(odd_extents),
        cmocka_unit_test(packs_end_at_gaps),
        cmocka_unit_test(clusters_at_both_ends),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
