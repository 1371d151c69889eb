#include "support.h"
#include "model/ellipsoid.h"

bool test_small(void) {
    const char *const text = getenv("OVOID_TEST_SMALL");
    return text && strcmp(text, "1") == 0;
}

size_t test_size(size_t full, size_t small) {
    return test_small() ? small : full;
}

void test_check(ovoid_context *context, ovoid_status status) {
    if (status != OVOID_OK)
        fail_msg("%s: %s", ovoid_status_name(status), ovoid_context_error(context));
}

void test_refused(ovoid_context *context, ovoid_status status, ovoid_status wanted,
                  const char *part) {
    if (status != wanted)
        fail_msg("status %s instead of %s (%s)", ovoid_status_name(status),
                 ovoid_status_name(wanted), ovoid_context_error(context));
    if (!strstr(ovoid_context_error(context), part))
        fail_msg("\"%s\" is missing in \"%s\"", part, ovoid_context_error(context));
}

bool test_simulated(ovoid_context *context) {
    return strstr(ovoid_context_device(context)->platform, "Oclgrind") != NULL;
}

size_t test_next(ovoid_context *context, size_t n, size_t every) {
    return n + (test_simulated(context) ? every : 1);
}

void test_skip_simulated(ovoid_context *context) {
    if (test_simulated(context))
        skip();
}

int test_open(void **state) {
    ovoid_context *context = NULL;
    if (ovoid_context_create(&context) != OVOID_OK)
        return -1;
    if (ovoid_context_open_device(context, NULL) != OVOID_OK) {
        fprintf(stderr, "%s\n", ovoid_context_error(context));
        ovoid_context_destroy(&context);
        return -1;
    }
    *state = context;
    return 0;
}

int test_close(void **state) {
    ovoid_context *context = *state;
    ovoid_context_destroy(&context);
    return 0;
}

void test_group_of_lane(void **state) {
    const char *const wanted = getenv("OVOID_TEST_GROUP");
    ov_device *device;
    test_check(*state, ov_device_get(*state, &device));
    if (!wanted)
        skip();
    const unsigned long group = strtoul(wanted, NULL, 10);
    assert_int_equal(device->solve_group, group);
    const size_t team = device->max_group < 256 ? device->max_group : 256;
    assert_int_equal(device->team, device->shape.lanes == 1 ? 1 : team);
}

void *test_alloc(size_t count, size_t size) {
    void *const memory = calloc(count > 0 ? count : 1, size);
    if (!memory)
        abort();
    return memory;
}

/* ---- models ------------------------------------------------------------------------------- */

#define PI 3.14159265358979323846

const char *model_kind_name(model_kind kind) {
    static const char *const names[MODEL_KINDS] = {"random", "needle", "pancake", "sphere",
                                                   "gimbal", "huge",   "tiny"};
    return names[kind];
}

void random_ellipsoids(test_random *random, model_kind kind, double half,
                       ovoid_ellipsoid *ellipsoids, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        ovoid_ellipsoid *const e = &ellipsoids[i];
        e->amplitude = exp(random_uniform(random, -1.0, 2.0));
        for (int k = 0; k < 3; ++k) {
            e->decay[k] = exp(random_uniform(random, -2.0, 0.5));
            e->centre[k] = (float)random_uniform(random, -half, half);
            e->angle[k] = random_uniform(random, -PI, PI);
        }
        if (kind == MODEL_NEEDLE || kind == MODEL_PANCAKE) {
            e->decay[0] = e->decay[1] = kind == MODEL_NEEDLE ? 4.0 : 4e-4;
            e->decay[2] = kind == MODEL_NEEDLE ? 4e-4 : 4.0;
        } else if (kind == MODEL_SPHERE) {
            e->decay[1] = e->decay[2] = e->decay[0];
        } else if (kind == MODEL_GIMBAL) {
            e->angle[1] = i % 2 ? 0.5 * PI : -0.5 * PI;
        } else if (kind == MODEL_HUGE) {
            e->amplitude = exp(random_uniform(random, 20.0, 40.0));
        } else if (kind == MODEL_TINY) {
            e->amplitude = exp(random_uniform(random, -18.0, -10.0));
        }
    }
}

/* ---- a model on the device ---------------------------------------------------------------- */

double *widen_points(const float *xyz, size_t count) {
    double *const wide = test_alloc(3 * count, sizeof *wide);
    for (size_t k = 0; k < 3 * count; ++k)
        wide[k] = xyz[k];
    return wide;
}

void bench_place(bench *b, ovoid_context *context, const ov_quadric *quadrics, size_t terms_count,
                 const double *xyz, size_t count, double cutoff) {
    const double origin[3] = {0};
    memset(b, 0, sizeof *b);
    b->context = context;
    b->terms_count = terms_count;
    b->count = count;
    b->quadrics = test_alloc(terms_count, sizeof *quadrics);
    if (terms_count > 0)
        memcpy(b->quadrics, quadrics, terms_count * sizeof *quadrics);
    test_check(context, ov_points_create(context, xyz, count, origin, 0.5, &b->points));
    assert_int_equal(b->points.packs, (count + OV_PACK - 1) / OV_PACK); /* none ends early */
    b->xyz = test_alloc(3 * count, sizeof *b->xyz);
    for (size_t k = 0; k < count; ++k)
        memcpy(b->xyz + 3 * k, xyz + 3 * (size_t)b->points.order[k], 3 * sizeof *xyz);
    test_check(context, ov_terms_set(context, &b->terms, quadrics, terms_count, origin, cutoff));
    test_check(context, ov_lists_build(context, &b->lists, &b->points, &b->terms, 0.0));
}

void bench_create(bench *b, ovoid_context *context, const ov_quadric *quadrics, size_t terms_count,
                  const float *xyz, size_t count, double cutoff) {
    double *const wide = widen_points(xyz, count);
    bench_place(b, context, quadrics, terms_count, wide, count, cutoff);
    free(wide);
}

void bench_destroy(bench *b) {
    ov_points_destroy(&b->points);
    ov_terms_destroy(&b->terms);
    ov_lists_destroy(&b->lists);
    ov_operations_destroy(&b->operations);
    free(b->quadrics);
    free(b->xyz);
    memset(b, 0, sizeof *b);
}

float *random_points(test_random *random, size_t count, double half) {
    float *const xyz = test_alloc(3 * count, sizeof *xyz);
    for (size_t k = 0; k < 3 * count; ++k)
        xyz[k] = (float)random_uniform(random, -half, half);
    return xyz;
}

const double bench_far[3] = {-987654.3217, 523.456789, 12345.6789012};

void bench_random_at(bench *b, ovoid_context *context, model_kind kind, size_t terms_count,
                     size_t count, uint64_t seed, const double offset[3]) {
    test_random random = {seed};
    ovoid_ellipsoid *const ellipsoids = test_alloc(terms_count, sizeof *ellipsoids);
    ov_quadric *const quadrics = test_alloc(terms_count, sizeof *quadrics);
    random_ellipsoids(&random, kind, 4.0, ellipsoids, terms_count);
    for (size_t i = 0; i < terms_count; ++i) {
        for (int axis = 0; axis < 3; ++axis)
            ellipsoids[i].centre[axis] += offset[axis];
        ov_quadric_of_ellipsoid(&ellipsoids[i], &quadrics[i]);
    }
    float *const xyz = random_points(&random, count, 6.0);
    double *const wide = widen_points(xyz, count);
    for (size_t k = 0; k < 3 * count; ++k)
        wide[k] += offset[k % 3];
    bench_place(b, context, quadrics, terms_count, wide, count, 1e-37);
    free(wide);
    free(xyz);
    free(quadrics);
    free(ellipsoids);
}

void bench_random(bench *b, ovoid_context *context, model_kind kind, size_t terms_count,
                  size_t count, uint64_t seed) {
    const double offset[3] = {0};
    bench_random_at(b, context, kind, terms_count, count, seed, offset);
}

float *read_floats(ovoid_context *context, const ov_buffer *buffer, size_t count) {
    float *const values = test_alloc(count, sizeof *values);
    test_check(context, ov_buffer_read(context, buffer, 0, values, count * sizeof *values));
    return values;
}

double *read_places(ovoid_context *context, const ov_points *points) {
    const size_t all = points->packs * OV_PACK;
    float *const packed = read_floats(context, &points->xyz, 3 * all);
    double *const xyz = test_alloc(3 * all, sizeof *xyz);
    for (size_t k = 0; k < all; ++k)
        ov_points_at(points, packed, k, xyz + 3 * k);
    free(packed);
    return xyz;
}

uint32_t *read_indices(ovoid_context *context, const ov_buffer *buffer, size_t count) {
    uint32_t *const values = test_alloc(count, sizeof *values);
    test_check(context, ov_buffer_read(context, buffer, 0, values, count * sizeof *values));
    return values;
}

void write_floats(ovoid_context *context, ov_buffer *buffer, const float *values, size_t count) {
    test_check(context, ov_buffer_reserve(context, buffer, count * sizeof *values, "test values"));
    test_check(context, ov_buffer_write(context, buffer, 0, values, count * sizeof *values));
}

/* ---- comparison --------------------------------------------------------------------------- */

void expect_close(double got, ov_twin_sum wanted, double tolerance, double *worst, const char *what,
                  size_t index) {
    const double unit = FLT_EPSILON * wanted.scale;
    const double error = fabs(got - wanted.value);
    if (!(error <= tolerance * unit + 1e-30))
        fail_msg("%s %zu is %.9g instead of %.9g, off by %.3g where %.3g is allowed", what, index,
                 got, wanted.value, error, tolerance * unit);
    if (worst && unit > 1e-30)
        *worst = fmax(*worst, error / unit);
}

void expect_near(double got, double wanted, double tolerance, const char *what) {
    if (!(fabs(got - wanted) <= tolerance))
        fail_msg("%s is %.12g instead of %.12g, off by %.3g where %.3g is allowed", what, got,
                 wanted, fabs(got - wanted), tolerance);
}

/* How many ellipsoids have a larger value at the point than this one. */
static size_t rank_at(const ov_quadric *quadrics, size_t count, uint32_t of, const double at[3]) {
    const double own = ov_quadric_log_value(&quadrics[of], at);
    size_t rank = 0;
    for (size_t i = 0; i < count; ++i)
        rank += ov_quadric_log_value(&quadrics[i], at) > own;
    return rank;
}

void expect_same_models(const ovoid_model *a, const ovoid_model *b) {
    assert_non_null(b);
    assert_int_equal(ovoid_model_size(a), ovoid_model_size(b));
    assert_memory_equal(ovoid_model_ellipsoids(a), ovoid_model_ellipsoids(b),
                        ovoid_model_size(a) * sizeof(ovoid_ellipsoid));
    assert_int_equal(ovoid_model_owner_count(a), ovoid_model_owner_count(b));
    assert_memory_equal(ovoid_model_owner(a), ovoid_model_owner(b),
                        ovoid_model_owner_count(a) * sizeof(uint32_t));
}

size_t expect_owners(const ovoid_molecule *molecule, const ovoid_model *model, size_t among,
                     double most) {
    const size_t atoms = ovoid_molecule_atoms(molecule), count = ovoid_model_size(model);
    const uint32_t *const owner = ovoid_model_owner(model);
    ov_quadric *const quadrics = test_alloc(count, sizeof *quadrics);
    bool *const owns = test_alloc(count, sizeof *owns);
    size_t near = 0, idle = 0;
    assert_int_equal(ovoid_model_owner_count(model), atoms);
    for (size_t i = 0; i < count; ++i)
        ov_quadric_of_ellipsoid(&ovoid_model_ellipsoids(model)[i], &quadrics[i]);
    for (size_t i = 0; i < atoms; ++i) {
        assert_true(owner[i] < count);
        owns[owner[i]] = true;
        near += rank_at(quadrics, count, owner[i], ovoid_molecule_xyzr(molecule) + 4 * i) < among;
    }
    for (size_t i = 0; i < count; ++i)
        idle += !owns[i];
    print_message("%zu of %zu atoms near their owners, %zu of %zu ellipsoids without an atom\n",
                  near, atoms, idle, count);
    assert_true((double)near >= most * (double)atoms);
    free(quadrics);
    free(owns);
    return idle;
}
