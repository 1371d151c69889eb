/*
 * The solver of the adaptive fit: the maps between parameters and polynomials, the blocks of the
 * preconditioner, and whole solutions against a dense system in double.
 */
#include "model/ellipsoid.h"
#include "selftest/problem.h"
#include "selftest/twin_factor.h"
#include "support.h"

enum { P = OV_FACTOR_PARAMETERS, BLOCK = P * (P + 1) / 2 };

/* ---- the twin itself ---------------------------------------------------------------------- */

static void random_factor(test_random *random, double half, double x[P]) {
    ovoid_ellipsoid ellipsoid;
    ov_quadric quadric;
    random_ellipsoids(random, MODEL_RANDOM, half, &ellipsoid, 1);
    ov_quadric_of_ellipsoid(&ellipsoid, &quadric);
    ov_factor_of_quadric(&quadric, x);
}

/* Central differences of the ellipsoid's own formula, extrapolated to fourth order, in all ten
 * parameters. */
static void twin_is_the_derivative(void **state) {
    (void)state;
    test_random random = {1};
    for (int n = 0; n < 100; ++n) {
        double x[P], y[3], row[P];
        random_factor(&random, 1.0, x);
        for (int k = OV_FACTOR_L; n % 2 && k < P; ++k)
            x[k] = random_uniform(&random, -1.0, 1.0);
        for (int k = 0; k < 3; ++k)
            y[k] = random_uniform(&random, -1.5, 1.5);
        ov_twin_jacobian(x, 1, y, row);
        const double value = ov_twin_factor_value(x, y);
        for (int j = 0; j < P; ++j) {
            double slope[2];
            for (int half = 0; half < 2; ++half) {
                const double h = half ? 1e-3 : 2e-3;
                double up[P], down[P];
                memcpy(up, x, sizeof up);
                memcpy(down, x, sizeof down);
                up[j] += h;
                down[j] -= h;
                slope[half] =
                    (ov_twin_factor_value(up, y) - ov_twin_factor_value(down, y)) / (2.0 * h);
            }
            expect_near(row[j], (4.0 * slope[1] - slope[0]) / 3.0, 1e-7 * (1.0 + 10.0 * value),
                        "a derivative");
        }
    }
}

/* ---- solve_start -------------------------------------------------------------------------- */

/* What solve_start takes and leaves, `count` ellipsoids. */
typedef struct start {
    size_t count, group;   /* ellipsoids, in all and of a work-group */
    double *x;             /* parameters */
    float *gram, *moments; /* given */
    float *block, *diagonal, *step, *r, *p, *polynomial, *rz;
} start;

static void run_start(ovoid_context *context, start *s, float lambda) {
    ov_kernel kernel = {0};
    ov_buffer factor = {0}, gram = {0}, moments = {0}, block = {0}, diagonal = {0}, x = {0},
              r = {0}, p = {0}, polynomial = {0}, rz = {0}, state = {0};
    const cl_uint count = (cl_uint)s->count;
    ov_device *device;
    test_check(context, ov_device_get(context, &device));
    s->group = device->solve_group;
    const size_t groups = (s->count + s->group - 1) / s->group;
    float *const l = test_alloc(6 * s->count, sizeof *l);
    for (size_t i = 0; i < s->count; ++i)
        for (size_t k = 0; k < 6; ++k)
            l[6 * i + k] = (float)s->x[i * P + OV_FACTOR_L + k];
    test_check(context, ov_kernel_create(context, "solve", "solve_start", &kernel));
    write_floats(context, &factor, l, 6 * s->count);
    write_floats(context, &gram, s->gram, OV_GRAM * s->count);
    write_floats(context, &moments, s->moments, 2 * OV_MONOMIALS * s->count);
    ov_buffer *const vectors[] = {&diagonal, &x, &r, &p, &polynomial};
    for (size_t k = 0; k < sizeof vectors / sizeof *vectors; ++k)
        test_check(context, ov_buffer_reserve(context, vectors[k], s->count * P * 4, "vector"));
    test_check(context, ov_buffer_reserve(context, &block, s->count * BLOCK * 4, "blocks"));
    test_check(context, ov_buffer_reserve(context, &rz, groups * 4, "sums"));
    test_check(context, ov_buffer_reserve(context, &state, 8, "states"));
    test_check(context,
               OV_LAUNCH(context, &kernel, count, s->group, OV_ARG(count), OV_ARG(lambda),
                         OV_ARG(factor.memory), OV_ARG(gram.memory), OV_ARG(moments.memory),
                         OV_ARG(block.memory), OV_ARG(diagonal.memory), OV_ARG(x.memory),
                         OV_ARG(r.memory), OV_ARG(p.memory), OV_ARG(polynomial.memory),
                         OV_ARG(rz.memory), OV_ARG(state.memory)));
    s->block = read_floats(context, &block, s->count * BLOCK);
    s->diagonal = read_floats(context, &diagonal, s->count * P);
    s->step = read_floats(context, &x, s->count * P);
    s->r = read_floats(context, &r, s->count * P);
    s->p = read_floats(context, &p, s->count * P);
    s->polynomial = read_floats(context, &polynomial, s->count * P);
    s->rz = read_floats(context, &rz, groups);
    ov_buffer *const buffers[] = {&factor, &gram, &moments,    &block, &diagonal, &x,
                                  &r,      &p,    &polynomial, &rz,    &state};
    for (size_t k = 0; k < sizeof buffers / sizeof *buffers; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_kernel_destroy(&kernel);
    free(l);
}

/* Random ellipsoids with the gram of random points about each, and random moments. */
static void make_start(test_random *random, size_t count, start *s) {
    enum { POINTS = 60 };
    *s = (start){.count = count};
    s->x = test_alloc(count * P, sizeof *s->x);
    s->gram = test_alloc(count * OV_GRAM, sizeof *s->gram);
    s->moments = test_alloc(count * 2 * OV_MONOMIALS, sizeof *s->moments);
    for (size_t i = 0; i < count; ++i) {
        double xyz[3 * POINTS], weight[POINTS];
        ov_quadric quadric;
        ov_twin_sum sums[OV_GRAM];
        random_factor(random, 4.0, s->x + i * P);
        for (size_t k = OV_FACTOR_L; k < P; ++k) /* floats, as the kernel sees them */
            s->x[i * P + k] = (float)s->x[i * P + k];
        ov_factor_quadric(s->x + i * P, &quadric);
        for (size_t k = 0; k < 3 * POINTS; ++k)
            xyz[k] = quadric.centre[k % 3] + random_uniform(random, -2.0, 2.0);
        for (size_t k = 0; k < POINTS; ++k)
            weight[k] = random_uniform(random, 0.1, 1.0);
        ov_twin_gram(&quadric, xyz, weight, POINTS, sums);
        for (size_t m = 0; m < OV_GRAM; ++m)
            s->gram[i * OV_GRAM + m] = (float)sums[m].value;
        for (size_t m = 0; m < OV_MONOMIALS; ++m) { /* high and low parts, the low not rounding */
            s->moments[2 * (i * OV_MONOMIALS + m)] = (float)random_uniform(random, -1.0, 1.0);
            s->moments[2 * (i * OV_MONOMIALS + m) + 1] = (float)random_uniform(random, -0.1, 0.1);
        }
    }
}

static void destroy_start(start *s) {
    float *const arrays[] = {s->gram, s->moments, s->block,      s->diagonal, s->step,
                             s->r,    s->p,       s->polynomial, s->rz};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k)
        free(arrays[k]);
    free(s->x);
}

/* r = -C^T moments and polynomial = C p, C the twin's map; and so the kernel's two are transposes:
 * (C p) . m = p . (C^T m). */
static void maps_equal_twin(void **state) {
    start s;
    test_random random = {2};
    make_start(&random, test_size(70, 33), &s);
    run_start(*state, &s, 0.01f);
    for (size_t i = 0; i < s.count; ++i) {
        double map[OV_MONOMIALS][P], left = 0.0, right = 0.0, parts = 0.0;
        const float *const p = s.p + i * P, *const r = s.r + i * P, *const c = s.polynomial + i * P;
        ov_twin_factor_map(s.x + i * P, map);
        for (size_t j = 0; j < P; ++j) {
            ov_twin_sum gradient = {0}, polynomial = {0};
            for (size_t m = 0; m < OV_MONOMIALS; ++m) {
                const float *const pair = s.moments + 2 * (i * OV_MONOMIALS + m);
                const double moment = (double)pair[0] + pair[1];
                gradient.value -= map[m][j] * moment;
                gradient.scale += 4.0 * fabs(map[m][j] * moment);
                polynomial.value += map[j][m] * p[m];
                polynomial.scale += 4.0 * fabs(map[j][m] * p[m]);
            }
            expect_close(r[j], gradient, 4.0, NULL, "component of r", i * P + j);
            expect_close(c[j], polynomial, 4.0, NULL, "coefficient", i * P + j);
            const float *const pair = s.moments + 2 * (i * OV_MONOMIALS + j);
            left += ((double)pair[0] + pair[1]) * c[j];
            right -= (double)p[j] * r[j];
            parts += fabs((double)p[j] * r[j]);
        }
        expect_near(left, right, 1e-4 * parts + 1e-9, "(C p) . m");
        for (size_t j = 0; j < P; ++j)
            assert_true(s.step[i * P + j] == 0.0f);
    }
    destroy_start(&s);
}

/* C^T G C from the 35 sums, the products of monomials looked up by their powers. */
static void twin_block(const double *x, const float *gram, double lambda, double block[P][P]) {
    static const int power[OV_MONOMIALS][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                               {2, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 2, 0},
                                               {0, 1, 1}, {0, 0, 2}};
    double map[OV_MONOMIALS][P], sum_of[5][5][5];
    size_t n = 0;
    for (int degree = 0; degree <= 4; ++degree)
        for (int a = degree; a >= 0; --a)
            for (int b = degree - a; b >= 0; --b)
                sum_of[a][b][degree - a - b] = gram[n++];
    ov_twin_factor_map(x, map);
    for (int i = 0; i < P; ++i)
        for (int j = 0; j < P; ++j) {
            block[i][j] = 0.0;
            for (int k = 0; k < OV_MONOMIALS; ++k)
                for (int m = 0; m < OV_MONOMIALS; ++m)
                    block[i][j] += map[k][i] * map[m][j] *
                                   sum_of[power[k][0] + power[m][0]][power[k][1] + power[m][1]]
                                         [power[k][2] + power[m][2]];
        }
    for (int i = 0; i < P; ++i)
        block[i][i] *= 1.0 + lambda;
}

/* The blocks multiplied out again; the diagonal; p = block^-1 r; and rz = r . p of each group. */
static void blocks_equal_twin(void **state) {
    start s;
    test_random random = {3};
    const double lambda = 0.05;
    double worst = 0.0;
    make_start(&random, test_size(100, 33), &s);
    run_start(*state, &s, (float)lambda);
    double *const rz = test_alloc(s.count, sizeof *rz);
    for (size_t i = 0; i < s.count; ++i) {
        const float *const rows = s.block + i * BLOCK;
        double wanted[P][P], lower[P][P] = {{0.0}};
        twin_block(s.x + i * P, s.gram + i * OV_GRAM, lambda, wanted);
        for (int j = 0; j < P; ++j)
            for (int k = 0; k <= j; ++k)
                lower[j][k] = j == k ? 1.0 / rows[j * (j + 1) / 2 + k] : rows[j * (j + 1) / 2 + k];
        for (int j = 0; j < P; ++j) {
            const float r = s.r[i * P + (size_t)j];
            double product = 0.0, scale = 0.0;
            for (int k = 0; k < P; ++k) {
                const double unit = sqrt(wanted[j][j] * wanted[k][k]);
                double entry = 0.0;
                for (int m = 0; m <= (j < k ? j : k); ++m)
                    entry += lower[j][m] * lower[k][m];
                worst = fmax(worst, fabs(entry - wanted[j][k]) / unit);
                product += wanted[j][k] * s.p[i * P + (size_t)k];
                scale += unit * fabs(s.p[i * P + (size_t)k]);
            }
            expect_near(product, r, 3e-5 * scale, "block p");
            const double diagonal = wanted[j][j] / (1.0 + lambda);
            expect_near(s.diagonal[i * P + (size_t)j], diagonal, 1e-5 * diagonal, "D");
            rz[i / s.group] += (double)r * s.p[i * P + (size_t)j];
        }
    }
    print_message("blocks: %.1e of their diagonals\n", worst);
    assert_true(worst < 1e-5);
    for (size_t group = 0; group * s.group < s.count; ++group)
        expect_near(s.rz[group], rz[group], 1e-5 * rz[group], "r . z");
    free(rz);
    destroy_start(&s);
}

/* ---- whole solutions ---------------------------------------------------------------------- */

/* A model about points, with weights and residuals; a few of them without weight. */
typedef struct problem {
    bench b;
    ov_problem own;
} problem;

static void create_problem_of(problem *p, ovoid_context *context, size_t count,
                              const ov_rigid *motion, size_t images, size_t points, size_t lost,
                              uint64_t seed) {
    test_random random = {seed};
    ov_quadric *const quadrics = test_alloc(count * (1 + images), sizeof *quadrics);
    const double half = 1.2 * cbrt((double)count);
    double *const x = test_alloc(count * P, sizeof *x);
    for (size_t i = 0; i < count; ++i) {
        random_factor(&random, half, x + i * P);
        for (size_t k = 0; k < P; ++k)
            x[i * P + k] = (float)x[i * P + k];
        if (i < lost)
            x[i * P + OV_FACTOR_CENTRE] += 1000.0;
        ov_factor_quadric(x + i * P, &quadrics[i]);
    }
    float *const xyz = random_points(&random, points, half + 2.0);
    for (size_t g = 0; g < images; ++g)
        for (size_t i = 0; i < count; ++i)
            ov_quadric_move(&quadrics[i], &motion[g], &quadrics[(g + 1) * count + i]);
    bench_create(&p->b, context, quadrics, count * (1 + images), xyz, points, 1e-30);
    const size_t all = p->b.points.packs * OV_PACK;
    float *const weight = test_alloc(all, sizeof *weight), *const u = test_alloc(all, sizeof *u);
    for (size_t k = 0; k < points; ++k) {
        weight[k] = k % 7 ? (float)random_uniform(&random, 0.2, 2.0) : 0.0f;
        u[k] = weight[k] * (float)random_uniform(&random, -0.5, 0.5);
    }
    p->own = (ov_problem){.points = &p->b.points,
                          .terms = &p->b.terms,
                          .lists = &p->b.lists,
                          .operations = &p->b.operations,
                          .count = count,
                          .x = x,
                          .weight = weight,
                          .u = u};
    test_check(context, ov_problem_upload(context, &p->own));
    test_check(context, ov_followers_set(context, &p->own.followers, motion, images));
    free(xyz);
    free(quadrics);
}

static void create_problem(problem *p, ovoid_context *context, size_t count, size_t points,
                           size_t lost, uint64_t seed) {
    create_problem_of(p, context, count, NULL, 0, points, lost, seed);
}

static void destroy_problem(problem *p) {
    ov_problem_destroy(&p->own);
    bench_destroy(&p->b);
}

static double *solve(problem *p, ov_solver *solver, double lambda, uint32_t iterations,
                     double tolerance) {
    double *const step = test_alloc(p->own.count * P, sizeof *step);
    test_check(p->b.context, ov_problem_solve(p->b.context, &p->own, solver, lambda, iterations,
                                              tolerance, step));
    return step;
}

/* Error of a step in the norm of the matrix, as a share of the dense solution. */
static double error_of(const problem *p, const double *step, double lambda) {
    const size_t count = p->own.count, size = count * P;
    double *const matrix = test_alloc(size * size, sizeof *matrix);
    double *const factored = test_alloc(size * size, sizeof *factored);
    double *const wanted = test_alloc(size, sizeof *wanted);
    double error = 0.0, whole = 0.0;
    assert_true(ov_twin_system(p->own.x, count, p->own.followers.motion, p->own.followers.count,
                               p->b.xyz, p->own.weight, p->own.u, p->b.count, lambda, matrix,
                               wanted));
    memcpy(factored, matrix, size * size * sizeof *matrix);
    assert_true(ov_twin_solve(factored, size, wanted));
    for (size_t i = 0; i < size; ++i)
        for (size_t j = 0; j < size; ++j) {
            const double entry = matrix[i * size + j];
            error += entry * (step[i] - wanted[i]) * (step[j] - wanted[j]);
            whole += entry * wanted[i] * wanted[j];
        }
    free(matrix);
    free(factored);
    free(wanted);
    assert_true(whole > 0.0);
    return sqrt(fmax(error, 0.0) / whole);
}

static void expect_solution(ovoid_context *context, size_t count, size_t points, size_t lost,
                            double lambda, uint32_t iterations, double tolerance) {
    problem p;
    ov_solver solver = {0};
    create_problem(&p, context, count, points, lost, 100 + count);
    double *const step = solve(&p, &solver, lambda, iterations, 1e-6);
    const double error = error_of(&p, step, lambda);
    print_message("%zu ellipsoids, lambda %g: error %.1e after %llu iterations\n", count, lambda,
                  error, (unsigned long long)solver.iterations);
    assert_true(error < tolerance);
    for (size_t j = 0; j < lost * P; ++j)
        assert_true(step[j] == 0.0);
    free(step);
    ov_solver_destroy(&solver);
    destroy_problem(&p);
}

static void several_ellipsoids(void **state) {
    expect_solution(*state, test_size(6, 2), test_size(600, 60), 0, test_small() ? 1.0 : 0.1, 100,
                    1e-5);
    if (!test_small())
        expect_solution(*state, 6, 600, 0, 1e-3, 200, 1e-5);
}

/* The preconditioner is the matrix's inverse then, lambda included: one iteration will do. */
static void one_ellipsoid_takes_one_iteration(void **state) {
    expect_solution(*state, 1, test_size(400, 60), 0, 0.1, 1, 1e-5);
    expect_solution(*state, 1, test_size(400, 60), 0, 1e-3, 1, 1e-5);
}

/* Counts about the size of a group, and several groups. */
static void more_than_one_group(void **state) {
    const size_t counts[] = {33, 64, 100};
    const size_t tried = test_size(sizeof counts / sizeof *counts, 1);
    for (size_t n = 0; n < tried; ++n)
        expect_solution(*state, counts[n], test_size(5 * counts[n], 16), 0,
                        test_small() ? 2000.0 : 0.3, (uint32_t)test_size(60, 2),
                        test_size(3, 30) * 1e-5);
}

/* One group that does the rest of an iteration, and many: the same but for the order of sums. */
static void alone_equals_together(void **state) {
    test_skip_simulated(*state);
    const size_t counts[] = {1, 40, OV_SOLVE_WIDE + 44};
    for (size_t n = 0; n < sizeof counts / sizeof *counts; ++n) {
        problem p;
        ov_solver alone = {0}, together = {.apart = true};
        create_problem(&p, *state, counts[n], 4 * counts[n] + 60, 0, 30 + n);
        double *const one = solve(&p, &alone, 0.3, 4, 0.0);
        double *const many = solve(&p, &together, 0.3, 4, 0.0);
        double largest = 0.0, off = 0.0;
        for (size_t j = 0; j < counts[n] * P; ++j) {
            largest = fmax(largest, fabs(many[j]));
            off = fmax(off, fabs(one[j] - many[j]));
        }
        print_message("%zu ellipsoids: off by %.1e of %.1e\n", counts[n], off, largest);
        assert_true(largest > 0.0 && off < 1e-4 * largest);
        free(one);
        free(many);
        ov_solver_destroy(&alone);
        ov_solver_destroy(&together);
        destroy_problem(&p);
    }
}

/* What is waited for is the step; an iteration takes three launches, and as many are started as the
 * last solution took. */
static void little_is_waited_for(void **state) {
    test_skip_simulated(*state);
    problem p;
    ov_solver solver = {0};
    create_problem(&p, *state, 20, 300, 0, 11);
    free(solve(&p, &solver, 0.1, 25, 0.0));
    const ov_device *const device = p.b.context->device;
    const uint64_t reads = device->counts[OVOID_COUNT_BLOCKING_READS];
    const uint64_t launches = device->counts[OVOID_COUNT_LAUNCHES];
    free(solve(&p, &solver, 0.1, 25, 0.0));
    assert_int_equal(device->counts[OVOID_COUNT_BLOCKING_READS] - reads, 1);
    assert_int_equal(device->counts[OVOID_COUNT_LAUNCHES] - launches,
                     2 + 1 + 25 * 3); /* moments, gram, start */
    ov_solver_destroy(&solver);
    destroy_problem(&p);
}

/* However many iterations are started at once, the device stops at the first whose residual is
 * small enough, and the step has the same bits. */
static void the_device_stops(void **state) {
    test_skip_simulated(*state);
    problem p;
    create_problem(&p, *state, 20, 300, 0, 12);
    for (int apart = 0; apart < 2; ++apart) {
        ov_solver exact = {.apart = apart};
        double *const one = solve(&p, &exact, 0.1, 100, 0.1);
        const uint64_t taken = exact.iterations;
        print_message("%llu iterations\n", (unsigned long long)taken);
        assert_true(taken > 1 && taken < 100);
        for (uint32_t last = 1; last < 60; last += (uint32_t)test_size(7, 20)) {
            ov_solver other = {.apart = apart, .last = last};
            double *const again = solve(&p, &other, 0.1, 100, 0.1);
            assert_int_equal(other.iterations, taken);
            assert_int_equal(other.last, taken);
            assert_memory_equal(one, again, 20 * P * sizeof *one);
            free(again);
            ov_solver_destroy(&other);
        }
        ov_solver bounded = {.apart = apart};
        double *const less = solve(&p, &bounded, 0.1, (uint32_t)taken - 1, 0.1);
        assert_int_equal(bounded.iterations, taken - 1);
        assert_memory_not_equal(one, less, 20 * P * sizeof *one);
        free(less);
        free(one);
        ov_solver_destroy(&bounded);
        ov_solver_destroy(&exact);
    }
    destroy_problem(&p);
}

/* Ellipsoids that reach no point stay still, and do not hinder the others; even undamped. */
static void ellipsoids_without_points(void **state) {
    expect_solution(*state, test_size(4, 2), test_size(400, 60), 1, 0.1, 100, 1e-5);
    expect_solution(*state, 2, 200, 1, 0.0, 1, 1e-4);
    problem p;
    ov_solver solver = {0};
    create_problem(&p, *state, 2, 50, 2, 5);
    double *const step = solve(&p, &solver, 0.1, 10, 1e-3);
    for (size_t j = 0; j < 2 * P; ++j)
        assert_true(step[j] == 0.0);
    assert_int_equal(solver.iterations, 0);
    free(step);
    ov_solver_destroy(&solver);
    destroy_problem(&p);
}

/* Images about the axes that they turn by, where they overlap: the step is that of the parameters
 * that all of them have in common. Without damping, since D is that of the ellipsoids alone. */
static void images_follow(void **state) {
    const ov_rigid motion[2] = {
        {.rotation = {0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0}, .shift = {0.5, 0.0, 0.0}},
        {.rotation = {0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0}, .shift = {0.0, 0.0, -0.3}}};
    const size_t counts[] = {1, 3};
    for (size_t n = 0; n < test_size(2, 1); ++n) {
        problem p;
        ov_solver together = {.apart = true}, alone = {0};
        create_problem_of(&p, *state, counts[n], motion, 2, test_size(600, 100), 0, 20 + n);
        double *const one = solve(&p, &alone, 0.0, 300, 1e-7);
        double *const many = solve(&p, &together, 0.0, 300, 1e-7);
        const double error[2] = {error_of(&p, one, 0.0), error_of(&p, many, 0.0)};
        print_message("%zu ellipsoids with images: error %.1e and %.1e after %llu iterations\n",
                      counts[n], error[0], error[1], (unsigned long long)alone.iterations);
        assert_true(error[0] < 1e-3 && error[1] < 1e-3);
        free(one);
        free(many);
        ov_solver_destroy(&alone);
        ov_solver_destroy(&together);
        destroy_problem(&p);
    }
}

static void no_residual_no_step(void **state) {
    problem p;
    ov_solver solver = {0};
    create_problem(&p, *state, 3, 100, 0, 6);
    memset(p.own.u, 0, p.b.points.packs * OV_PACK * sizeof *p.own.u);
    test_check(*state, ov_problem_upload(*state, &p.own));
    double *const step = solve(&p, &solver, 0.01, 10, 1e-3);
    for (size_t j = 0; j < 3 * P; ++j)
        assert_true(step[j] == 0.0);
    assert_int_equal(solver.iterations, 0);
    free(step);
    ov_solver_destroy(&solver);
    destroy_problem(&p);
}

/* A solver gives the same bits whatever it has solved before, larger or smaller. */
static void solutions_repeat(void **state) {
    test_skip_simulated(*state); /* a simulator's order is its own */
    problem large, small;
    ov_solver used = {0}, fresh = {0};
    create_problem(&large, *state, test_size(70, 5), test_size(700, 16), 0, 7);
    create_problem(&small, *state, test_size(3, 2), test_size(60, 16), 0, 8);
    const size_t bytes = large.b.terms_count * P * sizeof(double);
    const uint32_t iterations = (uint32_t)test_size(30, 2);
    double *const first = solve(&large, &used, 0.01, iterations, 0.0);
    double *const between = solve(&small, &used, 0.01, iterations, 0.0);
    double *const second = solve(&large, &used, 0.01, iterations, 0.0);
    double *const third = solve(&large, &fresh, 0.01, iterations, 0.0);
    assert_memory_equal(first, second, bytes);
    assert_memory_equal(first, third, bytes);
    free(first);
    free(between);
    free(second);
    free(third);
    ov_solver_destroy(&used);
    ov_solver_destroy(&fresh);
    destroy_problem(&large);
    destroy_problem(&small);
}

/* Iterations stop at their limit, and at the tolerance where that comes first. */
static void iterations_end(void **state) {
    test_skip_simulated(*state);
    problem p;
    uint64_t taken[3];
    double error[3];
    const double tolerances[3] = {0.3, 1e-2, test_small() ? 1e-3 : 1e-5};
    create_problem(&p, *state, test_size(30, 3), test_size(400, 32), 0, 9);
    for (int n = 0; n < 3; ++n) {
        ov_solver solver = {0};
        double *const step = solve(&p, &solver, 0.03, 1000, tolerances[n]);
        taken[n] = solver.iterations;
        error[n] = error_of(&p, step, 0.03);
        free(step);
        ov_solver_destroy(&solver);
    }
    print_message("iterations %llu, %llu, %llu; errors %.1e, %.1e, %.1e\n",
                  (unsigned long long)taken[0], (unsigned long long)taken[1],
                  (unsigned long long)taken[2], error[0], error[1], error[2]);
    assert_true(taken[0] < taken[1] && taken[1] < taken[2] && taken[2] < 300);
    assert_true(error[0] > error[1] && error[1] > error[2]);
    ov_solver solver = {0};
    for (uint32_t limit = 0; limit <= test_size(5, 1); ++limit) {
        solver.iterations = 0;
        double *const step = solve(&p, &solver, 0.03, limit, 1e-5);
        assert_int_equal(solver.iterations, limit);
        assert_true((step[0] == 0.0) == (limit == 0));
        free(step);
    }
    ov_solver_destroy(&solver);
    destroy_problem(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_group_of_lane),
        cmocka_unit_test(twin_is_the_derivative),
        cmocka_unit_test(maps_equal_twin),
        cmocka_unit_test(blocks_equal_twin),
        cmocka_unit_test(several_ellipsoids),
        cmocka_unit_test(one_ellipsoid_takes_one_iteration),
        cmocka_unit_test(more_than_one_group),
        cmocka_unit_test(alone_equals_together),
        cmocka_unit_test(little_is_waited_for),
        cmocka_unit_test(the_device_stops),
        cmocka_unit_test(ellipsoids_without_points),
        cmocka_unit_test(images_follow),
        cmocka_unit_test(no_residual_no_step),
        cmocka_unit_test(solutions_repeat),
        cmocka_unit_test(iterations_end),
    };
    return cmocka_run_group_tests(tests, test_open, test_close);
}
