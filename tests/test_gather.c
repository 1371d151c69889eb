/*
 * Packs by themselves: the kernels of gather.cl against their twins, and which packs are near a
 * place.
 */
#include "support.h"

enum { PACK = OV_PACK };

/* Points in a few clumps, so that packs are apart. */
static void make_points(ovoid_context *context, test_random *random, size_t count,
                        ov_points *points) {
    static const double origin[3] = {5.0, -3.0, 2.0};
    double *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < count; ++k) {
        const double clump = 12.0 * (double)(random_bits(random) % 5);
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * k + axis] = clump + random_uniform(random, -4.0, 4.0);
    }
    test_check(context, ov_points_create(context, xyz, count, origin, 0.5, points));
    free(xyz);
}

/* Some of the packs in ascending order. */
static size_t choose(test_random *random, size_t packs, size_t one_in, uint32_t *list) {
    size_t count = 0;
    for (uint32_t pack = 0; pack < packs; ++pack)
        if (random_bits(random) % one_in == 0)
            list[count++] = pack;
    if (count == 0)
        list[count++] = (uint32_t)packs - 1;
    return count;
}

static size_t tree_floats(const ov_tree *tree) {
    size_t groups = 0;
    for (unsigned level = 0; level < tree->levels; ++level)
        groups += (tree->boxes[level] + OV_GROUP - 1) / OV_GROUP;
    return groups * 6 * OV_GROUP;
}

/* The packs gathered are those listed, to the last bit, with a tree of their own. */
static void expect_gathered(ovoid_context *context, const ov_points *from, const uint32_t *list,
                            size_t count, const ov_points *to) {
    float *const all = read_floats(context, &from->xyz, from->packs * 3 * PACK);
    float *const some = read_floats(context, &to->xyz, count * 3 * PACK);
    float *const origins = read_floats(context, &to->pack_origins, 4 * count);
    float *const boxes = read_floats(context, &to->boxes, tree_floats(&to->tree));
    float *const wanted = test_alloc(count * 3 * PACK, sizeof *wanted);
    assert_int_equal(to->packs, count);
    assert_memory_equal(to->origin, from->origin, sizeof to->origin);
    ov_twin_gather(list, count, 3 * PACK, all, wanted);
    assert_memory_equal(some, wanted, count * 3 * PACK * sizeof *some);
    ov_twin_gather(list, count, 4, from->pack_origin, wanted);
    assert_memory_equal(origins, wanted, 4 * count * sizeof *origins);
    assert_memory_equal(to->pack_origin, wanted, 4 * count * sizeof *origins);
    assert_memory_equal(to->host_boxes, boxes, tree_floats(&to->tree) * sizeof *boxes);
    assert_true(to->rounding <= from->rounding && (to->rounding > 0.0f));
    for (size_t n = 0; n < count; ++n) {
        float own[6], before[6];
        ov_tree_box(to->host_boxes, &to->tree, 0, n, own);
        ov_tree_box(from->host_boxes, &from->tree, 0, list[n], before);
        assert_memory_equal(own, before, sizeof own);
    }
    free(all);
    free(some);
    free(origins);
    free(boxes);
    free(wanted);
}

static void points_are_gathered(void **state) {
    test_random random = {1};
    ov_points from = {0}, to = {0};
    ov_buffer list = {0};
    make_points(*state, &random, test_size(3000, 300), &from);
    uint32_t *const packs = test_alloc(from.packs, sizeof *packs);
    static const size_t one_in[] = {3, 1000000, 1, 7}; /* the last one alone, all, and again some */
    for (size_t n = 0; n < sizeof one_in / sizeof *one_in; ++n) {
        const size_t count = choose(&random, from.packs, one_in[n], packs);
        test_check(*state, ov_points_gather(*state, &from, packs, count, &list, &to));
        expect_gathered(*state, &from, packs, count, &to);
    }
    free(packs);
    ov_buffer_destroy(&list);
    ov_points_destroy(&to);
    ov_points_destroy(&from);
}

/* Bounds of all kinds, and values. */
static float *make_floats(test_random *random, size_t count, bool bounds) {
    float *const made = test_alloc(count, sizeof *made);
    for (size_t k = 0; k < count; ++k) {
        const unsigned kind = bounds ? (unsigned)(random_bits(random) % 4) : 3;
        made[k] = kind == 0 ? FLT_MAX : kind == 1 ? -FLT_MAX : (float)random_uniform(random, 0, 3);
    }
    return made;
}

static void launch(ovoid_context *context, const char *name, const ov_buffer *const *buffers,
                   size_t packs) {
    ov_kernel kernel = {0};
    const cl_uint count = (cl_uint)packs;
    ov_arg args[9] = {OV_ARG(count)};
    size_t used = 1;
    for (; buffers[used - 1]; ++used)
        args[used] = OV_ARG(buffers[used - 1]->memory);
    test_check(context, ov_kernel_create(context, "gather", name, &kernel));
    test_check(context, ov_launch(context, &kernel, packs, 4, args, used));
    ov_kernel_destroy(&kernel);
}

enum { LOW, HIGH, WEIGHT, TARGETS };

/* What is gathered is the rest of the bounds, and the weights; more than that is not touched. */
static void targets_are_gathered(void **state) {
    ovoid_context *const context = *state;
    test_random random = {2};
    const size_t packs = test_size(101, 11), some = packs / 3;
    uint32_t *const list = test_alloc(some, sizeof *list);
    ov_buffer device[TARGETS] = {0}, gathered[TARGETS] = {0}, value = {0}, numbers = {0};
    float *all[TARGETS], *wanted = test_alloc(some * PACK, sizeof *wanted);
    float *const values = make_floats(&random, some * PACK, false);
    for (uint32_t n = 0; n < some; ++n)
        list[n] = 3 * n + 1;
    for (int k = 0; k < TARGETS; ++k) {
        all[k] = make_floats(&random, packs * PACK, k != WEIGHT);
        write_floats(context, &device[k], all[k], packs * PACK);
        write_floats(context, &gathered[k], all[k], (some + 1) * PACK);
    }
    write_floats(context, &value, values, some * PACK);
    test_check(context, ov_buffer_put(context, &numbers, list, some * sizeof *list, "packs"));
    launch(context, "gather_target",
           (const ov_buffer *const[]){&numbers, &device[LOW], &device[HIGH], &device[WEIGHT],
                                      &value, &gathered[LOW], &gathered[HIGH], &gathered[WEIGHT],
                                      NULL},
           some);
    for (int k = 0; k < TARGETS; ++k) {
        float *const got = read_floats(context, &gathered[k], (some + 1) * PACK);
        ov_twin_gather(list, some, PACK, all[k], wanted);
        for (size_t j = 0; j < some * PACK; ++j)
            assert_true(got[j] ==
                        (k == WEIGHT ? wanted[j] : (float)ov_twin_rest(wanted[j], values[j])));
        assert_memory_equal(got + some * PACK, all[k] + some * PACK, PACK * sizeof *got);
        free(got);
    }
    for (int k = 0; k < TARGETS; ++k) {
        ov_buffer_destroy(&device[k]);
        ov_buffer_destroy(&gathered[k]);
        free(all[k]);
    }
    ov_buffer_destroy(&value);
    ov_buffer_destroy(&numbers);
    free(values);
    free(wanted);
    free(list);
}

/* Those of the packs listed change, all others stay. */
static void targets_are_scattered(void **state) {
    ovoid_context *const context = *state;
    test_random random = {3};
    const size_t packs = test_size(90, 12), some = packs / 3;
    uint32_t *const list = test_alloc(some, sizeof *list);
    ov_buffer device[TARGETS] = {0}, from = {0}, numbers = {0};
    float *const fresh = make_floats(&random, some * TARGETS * PACK, true);
    float *all[TARGETS], *const own = test_alloc(some * PACK, sizeof *own);
    for (uint32_t n = 0; n < some; ++n)
        list[n] = 3 * n + n % 2;
    for (int k = 0; k < TARGETS; ++k) {
        all[k] = make_floats(&random, packs * PACK, true);
        write_floats(context, &device[k], all[k], packs * PACK);
    }
    write_floats(context, &from, fresh, some * TARGETS * PACK);
    test_check(context, ov_buffer_put(context, &numbers, list, some * sizeof *list, "packs"));
    launch(context, "scatter_target",
           (const ov_buffer *const[]){&numbers, &from, &device[LOW], &device[HIGH], &device[WEIGHT],
                                      NULL},
           some);
    for (size_t k = 0; k < TARGETS; ++k) {
        float *const got = read_floats(context, &device[k], packs * PACK);
        for (size_t n = 0; n < some; ++n)
            memcpy(own + n * PACK, fresh + (n * TARGETS + k) * PACK, PACK * sizeof *own);
        ov_twin_scatter(list, some, PACK, own, all[k]);
        assert_memory_equal(got, all[k], packs * PACK * sizeof *got);
        free(got);
        free(all[k]);
        ov_buffer_destroy(&device[k]);
    }
    ov_buffer_destroy(&from);
    ov_buffer_destroy(&numbers);
    free(fresh);
    free(own);
    free(list);
}

/* ---- packs near a place ------------------------------------------------------------------- */

/* The distance of a place from the pack's box. */
static double distance_of(const ov_points *points, size_t pack, const double at[3]) {
    float box[6];
    double square = 0.0;
    ov_tree_box(points->host_boxes, &points->tree, 0, pack, box);
    for (int k = 0; k < 3; ++k) {
        const double x = at[k] - points->origin[k];
        const double off = fmax(fmax((double)box[k] - x, x - (double)box[k + 3]), 0.0);
        square += off * off;
    }
    return sqrt(square);
}

static void near_packs_are_found(void **state) {
    test_random random = {4};
    ov_points points = {0};
    ov_packs found = {0};
    size_t most = 0;
    make_points(*state, &random, test_size(6000, 500), &points);
    for (int n = 0; n < 50; ++n) {
        const double reach = random_uniform(&random, 0.0, 6.0);
        double at[3];
        for (int k = 0; k < 3; ++k)
            at[k] = random_uniform(&random, -10.0, 60.0);
        found.count = 0;
        test_check(*state, ov_packs_near(*state, &points, at, reach, &found));
        assert_int_equal(ov_packs_tidy(found.pack, found.count), found.count); /* each once */
        size_t next = 0;
        for (size_t pack = 0; pack < points.packs; ++pack) {
            const bool listed = next < found.count && found.pack[next] == pack;
            const double distance = distance_of(&points, pack, at);
            next += listed;
            assert_true(listed ? distance < reach + 1e-3 : distance > reach);
        }
        assert_int_equal(next, found.count);
        most = found.count > most ? found.count : most;
    }
    assert_true(most > test_size(3, 0));
    const double far[3] = {1e4, 0.0, 0.0};
    found.count = 0;
    test_check(*state, ov_packs_near(*state, &points, far, 10.0, &found));
    assert_int_equal(found.count, 0);
    ov_packs_destroy(&found);
    ov_packs_destroy(&found);
    ov_points_destroy(&points);
}

/* Packs with terms, few and many of them, more than the last time and fewer. */
static void reached_packs_are_listed(void **state) {
    static const size_t one_in[] = {2, 1000, 1, 1000000, 3};
    const size_t packs = test_size(5000, 300);
    test_random random = {5};
    ov_lists lists = {.packs = packs};
    ov_buffer list = {0};
    ov_packs found = {0};
    uint32_t *const start = test_alloc(packs + 1, sizeof *start);
    uint32_t *const wanted = test_alloc(packs, sizeof *wanted);
    for (size_t n = 0; n < sizeof one_in / sizeof *one_in; ++n) {
        size_t count = 0;
        for (size_t k = 0; k < packs; ++k) {
            const bool some = random_bits(&random) % one_in[n] == 0;
            start[k + 1] = start[k] + (some ? 1 + (uint32_t)(random_bits(&random) % 3) : 0);
            if (some)
                wanted[count++] = (uint32_t)k;
        }
        test_check(*state, ov_buffer_put(*state, &lists.pack_start, start,
                                         (packs + 1) * sizeof *start, "starts"));
        test_check(*state, ov_packs_reached(*state, &lists, &list, &found));
        assert_int_equal(found.count, count);
        assert_memory_equal(found.pack, wanted, count * sizeof *wanted);
    }
    free(start);
    free(wanted);
    ov_packs_destroy(&found);
    ov_buffer_destroy(&list);
    ov_lists_destroy(&lists);
}

static void lists_are_tidied(void **state) {
    (void)state;
    uint32_t some[] = {7, 3, 7, UINT32_MAX, 0, 3, 0, 7};
    assert_int_equal(ov_packs_tidy(some, 8), 4);
    assert_memory_equal(some, ((const uint32_t[]){0, 3, 7, UINT32_MAX}), 4 * sizeof *some);
    assert_int_equal(ov_packs_tidy(some, 0), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_gathered),   cmocka_unit_test(targets_are_gathered),
        cmocka_unit_test(targets_are_scattered), cmocka_unit_test(near_packs_are_found),
        cmocka_unit_test(lists_are_tidied),      cmocka_unit_test(reached_packs_are_listed),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
