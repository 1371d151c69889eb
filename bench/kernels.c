/*
 * bench/kernels: how fast the device operations run, as fractions of the device's measured peak.
 *
 *   kernels [--csv FILE] [--device SELECTOR] [--spacing A] [--padding A] [MOLECULE
 * [MODEL.ovoid]]...
 *
 * First the float32 peak: independent chains of fused multiply-adds in the device's preferred
 * vector width. Then pairs (of a point and an ellipsoid) per second of each operation on long lists
 * (every ellipsoid meets every pack), and on the lists of each molecule as a fit starts on it, or
 * with the ellipsoids of a model. "useful" is the share of the computed pairs that lie within the
 * cut-off. Each time is the least of several repeats; run nothing else beside it.
 */
#include "field/field.h"
#include "model/ellipsoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Floating-point operations per pair, a fused multiply-add counting as two: for field 3
 * differences, 14 for the exponent, 15 for 2^t, 1 for the sum; field_polynomial adds 19 for the
 * polynomial and its product, moments 18 for the ten sums. gram has 32 for e, 2 for w e^2, and 22,
 * 30 and 45 for its three groups of sums, differences included. */
#define FIELD_FLOPS 33.0
#define POLYNOMIAL_FLOPS 52.0
#define MOMENTS_FLOPS 51.0
#define GRAM_FLOPS 131.0

#define CUTOFF 1e-5
#define REPEATS 7
#define MIN_SECONDS 0.05 /* of one repeat */

typedef struct bench {
    ovoid_context *context;
    FILE *csv;
    double peak; /* flop/s */
    double spacing, padding, decay, isovalue;
} bench;

typedef struct setting {
    const char *name;
    ov_points points;
    ov_terms terms;
    ov_lists lists;
    double useful; /* share of the pairs, negative when not counted */
} setting;

static void fail(const bench *b) {
    fprintf(stderr, "kernels: %s\n", ovoid_context_error(b->context));
    exit(1);
}

static void *need(void *memory) {
    if (!memory) {
        fprintf(stderr, "kernels: out of memory\n");
        exit(1);
    }
    return memory;
}

/* ---- peak --------------------------------------------------------------------------------- */

#define CHAINS 12
#define STEPS 200000

/* Twelve chains hide the latency of a fused multiply-add on the CPUs and GPUs of today. */
static const char peak_source[] =
    "#define JOIN_(a, b) a##b\n"
    "#define JOIN(a, b) JOIN_(a, b)\n"
    "#if VECTOR == 1\n"
    "typedef float vec;\n"
    "#else\n"
    "typedef JOIN(float, VECTOR) vec;\n"
    "#endif\n"
    "#define EACH(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11)\n"
    "__kernel void peak(__global float *data, const int steps) {\n"
    "    const vec m = (vec)(data[0]), c = (vec)(data[1]);\n"
    "#define BEGIN(k) vec a##k = (vec)(data[2] + k + (float)get_global_id(0));\n"
    "    EACH(BEGIN)\n"
    "    for (int s = 0; s < steps; ++s) {\n"
    "#define STEP(k) a##k = fma(a##k, m, c);\n"
    "        EACH(STEP)\n"
    "    }\n"
    "    vec sum = (vec)(0.0f);\n"
    "#define ADD(k) sum += a##k;\n"
    "    EACH(ADD)\n"
    "    float out[VECTOR];\n"
    "    *(vec *)out = sum;\n"
    "    for (int k = 0; k < VECTOR; ++k)\n"
    "        data[3 + get_global_id(0) * VECTOR + k] = out[k];\n"
    "}\n";

static void check(bench *b, cl_int code, const char *call) {
    if (code != CL_SUCCESS) {
        ov_cl_fail(b->context, code, call, "peak");
        fail(b);
    }
}

static void measure_peak(bench *b) {
    ov_device *device;
    if (ov_device_get(b->context, &device) != OVOID_OK)
        fail(b);
    const size_t width = device->shape.vector;
    const size_t lanes = device->shape.lanes;
    const size_t items = (size_t)device->info.compute_units * (lanes == 1 ? 4 : 2048);
    const size_t local = lanes == 1 ? 1 : 256;
    const cl_int steps = lanes == 1 ? STEPS * 5 : STEPS / 4;
    char options[64];
    snprintf(options, sizeof options, "-cl-std=CL1.2 -DVECTOR=%zu", width);
    const char *text = peak_source;
    cl_int code;
    cl_program program = clCreateProgramWithSource(device->context, 1, &text, NULL, &code);
    check(b, code, "clCreateProgramWithSource");
    check(b, clBuildProgram(program, 1, &device->id, options, NULL, NULL), "clBuildProgram");
    ov_kernel kernel = {.program = "peak", .name = "peak", .max_group = local, .arg_count = 2};
    kernel.handle = clCreateKernel(program, "peak", &code);
    check(b, code, "clCreateKernel");
    ov_buffer data = {0};
    const float start[3] = {0.5f, 0.25f, 1.0f};
    if (ov_buffer_reserve(b->context, &data, (3 + items * width) * sizeof(float), "peak") ||
        ov_buffer_write(b->context, &data, 0, start, sizeof start))
        fail(b);
    double best = INFINITY;
    for (int r = 0; r < REPEATS; ++r) {
        const double began = ov_seconds();
        if (OV_LAUNCH(b->context, &kernel, items, local, OV_ARG(data.memory), OV_ARG(steps)) ||
            ov_finish(b->context))
            fail(b);
        best = fmin(best, ov_seconds() - began);
    }
    b->peak = 2.0 * CHAINS * (double)steps * (double)width * (double)items / best;
    ov_buffer_destroy(&data);
    ov_kernel_destroy(&kernel);
    clReleaseProgram(program);
}

/* ---- settings ----------------------------------------------------------------------------- */

static double uniform(uint64_t *state) {
    *state += 0x9E3779B97F4A7C15u; /* splitmix64 */
    uint64_t z = *state;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

/* Every ellipsoid meets every pack: the kernels without the irregularity of a molecule. */
static void make_long_lists(bench *b, setting *s) {
    enum { POINTS = 1 << 16, TERMS = 512 };
    uint64_t state = 1;
    double *const xyz = need(malloc(3 * POINTS * sizeof *xyz));
    ov_quadric *const quadrics = need(malloc(TERMS * sizeof *quadrics));
    const double origin[3] = {0};
    for (size_t k = 0; k < 3 * POINTS; ++k)
        xyz[k] = 10.0 * uniform(&state) - 5.0;
    for (size_t i = 0; i < TERMS; ++i) {
        const double atom[4] = {10.0 * uniform(&state) - 5.0, 10.0 * uniform(&state) - 5.0,
                                10.0 * uniform(&state) - 5.0, 1.0 + uniform(&state)};
        ov_quadric_of_atom(atom, b->decay, &quadrics[i]);
    }
    s->name = "long lists";
    s->useful = -1.0;
    if (ov_points_create(b->context, xyz, POINTS, origin, 0.5, &s->points) ||
        ov_terms_set(b->context, &s->terms, quadrics, TERMS, origin, CUTOFF) ||
        ov_lists_build(b->context, &s->lists, &s->points, &s->terms, 100.0))
        fail(b);
    free(xyz);
    free(quadrics);
}

/* Coordinates of the places of the packs, about their common origin: 3 each, to be freed. */
static double *read_points(bench *b, const ov_points *points) {
    const size_t places = points->packs * OV_PACK, bytes = 3 * places * sizeof(float);
    float *const packed = need(malloc(bytes));
    double *const xyz = need(malloc(3 * places * sizeof *xyz));
    if (ov_buffer_read(b->context, &points->xyz, 0, packed, bytes))
        fail(b);
    for (size_t k = 0; k < places; ++k) {
        ov_points_at(points, packed, k, xyz + 3 * k);
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * k + axis] -= points->origin[axis];
    }
    free(packed);
    return xyz;
}

static double count_useful(bench *b, const setting *s) {
    double *const xyz = read_points(b, &s->points);
    uint32_t *const start = need(malloc((s->lists.packs + 1) * sizeof *start));
    uint32_t *const item = need(malloc((s->lists.items + 1) * sizeof *item));
    if (ov_buffer_read(b->context, &s->lists.pack_start, 0, start,
                       (s->lists.packs + 1) * sizeof *start) ||
        ov_buffer_read(b->context, &s->lists.pack_item, 0, item, s->lists.items * sizeof *item))
        fail(b);
    uint64_t within = 0;
    for (size_t pack = 0; pack < s->lists.packs; ++pack)
        for (uint32_t k = start[pack]; k < start[pack + 1]; ++k) {
            const ov_term *const t = &s->terms.host[item[k]];
            for (size_t j = 0; j < ov_pack_points(&s->points, pack); ++j) {
                const double *const p = xyz + 3 * (pack * OV_PACK + j);
                const double x = p[0] - t->x, y = p[1] - t->y, z = p[2] - t->z;
                within += t->xx * x * x + t->xy * x * y + t->xz * x * z + t->yy * y * y +
                              t->yz * y * z + t->zz * z * z <=
                          t->reach;
            }
        }
    free(xyz);
    free(start);
    free(item);
    return (double)within / ((double)s->lists.items * OV_PACK);
}

/* Ellipsoids of the model, or the atoms' own Gaussians: to be freed. */
static ov_quadric *quadrics_of(bench *b, const double *xyzr, size_t atoms, const char *model_path,
                               size_t *count) {
    ovoid_model *model = NULL;
    if (model_path && ovoid_model_read(b->context, model_path, &model) != OVOID_OK)
        fail(b);
    *count = model ? ovoid_model_size(model) : atoms;
    ov_quadric *const quadrics = need(malloc(*count * sizeof *quadrics));
    for (size_t i = 0; i < *count; ++i) {
        if (model)
            ov_quadric_of_ellipsoid(ovoid_model_ellipsoids(model) + i, &quadrics[i]);
        else
            ov_quadric_of_atom(xyzr + 4 * i, b->decay, &quadrics[i]);
    }
    ovoid_model_destroy(&model);
    return quadrics;
}

static void make_molecule_lists(bench *b, const char *path, const char *model, setting *s) {
    ovoid_molecule *molecule = NULL;
    ov_samples samples = {0};
    ov_lattice lattice;
    if (ovoid_molecule_read(b->context, path, OVOID_MOLECULE_AUTO, &molecule) != OVOID_OK)
        fail(b);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const ov_band band = {.low = b->isovalue - 1.0, .high = b->isovalue + 1.0};
    size_t count;
    ov_quadric *const quadrics = quadrics_of(b, xyzr, atoms, model, &count);
    if (ov_lattice_create(b->context, xyzr, atoms, b->spacing, b->padding, &lattice) ||
        ov_sample(b->context, xyzr, atoms, b->decay, &lattice, band, (ov_sampling){0}, &samples))
        fail(b);
    s->points = samples.points;
    memset(&samples.points, 0, sizeof samples.points);
    ov_samples_destroy(&samples);
    if (ov_terms_set(b->context, &s->terms, quadrics, count, s->points.origin, CUTOFF) ||
        ov_lists_build(b->context, &s->lists, &s->points, &s->terms, 0.0))
        fail(b);
    const char *const slash = strrchr(model ? model : path, '/');
    s->name = slash ? slash + 1 : model ? model : path;
    s->useful = count_useful(b, s);
    free(quadrics);
    ovoid_molecule_destroy(&molecule);
}

static void destroy_setting(setting *s) {
    ov_points_destroy(&s->points);
    ov_terms_destroy(&s->terms);
    ov_lists_destroy(&s->lists);
}

/* ---- operations --------------------------------------------------------------------------- */

typedef enum operation { FIELD, POLYNOMIAL, MOMENTS, GRAM, LISTS } operation;

typedef struct work {
    ov_operations operations;
    ov_buffer value, moments, polynomial, product, gram;
} work;

static ovoid_status enqueue(bench *b, operation what, setting *s, work *w) {
    switch (what) {
    case FIELD:
        return ov_field(b->context, &w->operations, &s->points, &s->terms, &s->lists, &w->value);
    case MOMENTS:
        return ov_moments(b->context, &w->operations, &s->points, &s->terms, &s->lists, &w->value,
                          &w->moments);
    case POLYNOMIAL:
        return ov_field_polynomial(b->context, &w->operations, &s->points, &s->terms, &s->lists,
                                   &w->polynomial, &w->value, &w->product);
    case GRAM:
        return ov_gram(b->context, &w->operations, &s->points, &s->terms, &s->lists, &w->value,
                       &w->gram);
    default:
        return ov_lists_build(b->context, &s->lists, &s->points, &s->terms, 0.0);
    }
}

/* Coefficients that keep all of the arithmetic. */
static void make_polynomial(bench *b, const setting *s, work *w) {
    const size_t size = s->terms.count * OV_MONOMIALS, bytes = size * sizeof(float);
    float *const coefficients = need(malloc(bytes));
    uint64_t state = 2;
    for (size_t j = 0; j < size; ++j)
        coefficients[j] = (float)uniform(&state);
    if (ov_buffer_reserve(b->context, &w->polynomial, bytes, "polynomials") ||
        ov_buffer_write(b->context, &w->polynomial, 0, coefficients, bytes))
        fail(b);
    free(coefficients);
}

static double repeat(bench *b, operation what, setting *s, work *w, unsigned times) {
    const double began = ov_seconds();
    for (unsigned k = 0; k < times; ++k)
        if (enqueue(b, what, s, w) != OVOID_OK)
            fail(b);
    if (ov_finish(b->context) != OVOID_OK)
        fail(b);
    return ov_seconds() - began;
}

/* Seconds of one pass: launches follow each other as in a fit's pipeline. */
static double best_time(bench *b, operation what, setting *s, work *w) {
    unsigned times = 1;
    while (repeat(b, what, s, w, times) < MIN_SECONDS)
        times *= 2;
    double best = INFINITY;
    for (int r = 0; r < REPEATS; ++r)
        best = fmin(best, repeat(b, what, s, w, times) / times);
    return best;
}

static void row(bench *b, const setting *s, const char *pass, double seconds, double flops) {
    const double pairs = (double)s->lists.items * OV_PACK;
    const double rate = pairs / seconds;
    char useful[16] = "", fraction[16] = "";
    if (s->useful >= 0.0)
        snprintf(useful, sizeof useful, "%.2f", s->useful);
    if (flops > 0.0)
        snprintf(fraction, sizeof fraction, "%.2f", rate * flops / b->peak);
    printf("%-24.24s %8zu %9zu  %-10s %11.1f %12.2f %9s %7s\n", s->name, s->terms.count,
           s->points.count, pass, 1e6 * seconds, 1e-9 * rate, fraction, useful);
    if (b->csv)
        fprintf(b->csv, "%s,%zu,%zu,%s,%.0f,%.3f,%.3f,%s,%s\n", s->name, s->terms.count,
                s->points.count, pass, pairs, 1e6 * seconds, 1e-9 * rate, fraction, useful);
}

static void run_setting(bench *b, setting *s) {
    static const struct {
        operation what;
        const char *name;
        double flops;
    } rows[] = {
        {FIELD, "field", FIELD_FLOPS},
        {POLYNOMIAL, "polynomial", POLYNOMIAL_FLOPS},
        {MOMENTS, "moments", MOMENTS_FLOPS},
        {GRAM, "gram", GRAM_FLOPS},
        {LISTS, "lists", 0},
    };
    work w = {0};
    make_polynomial(b, s, &w);
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; ++k) {
        if (rows[k].what == LISTS && s->useful < 0.0)
            continue;
        row(b, s, rows[k].name, best_time(b, rows[k].what, s, &w), rows[k].flops);
    }
    ov_operations_destroy(&w.operations);
    ov_buffer_destroy(&w.value);
    ov_buffer_destroy(&w.moments);
    ov_buffer_destroy(&w.polynomial);
    ov_buffer_destroy(&w.product);
    ov_buffer_destroy(&w.gram);
    destroy_setting(s);
}

static bool is_model(const char *path) {
    const size_t length = path ? strlen(path) : 0;
    return length > 6 && strcmp(path + length - 6, ".ovoid") == 0;
}

int main(int argc, char **argv) {
    ovoid_fit_options defaults;
    ovoid_fit_options_init(&defaults, sizeof defaults);
    bench b = {.spacing = OVOID_DEFAULT_SPACING_L1,
               .padding = defaults.padding,
               .decay = defaults.decay,
               .isovalue = defaults.isovalue};
    const char *csv = NULL, *selector = NULL;
    int first = 1;
    for (; first + 1 < argc && argv[first][0] == '-'; first += 2) {
        if (strcmp(argv[first], "--csv") == 0)
            csv = argv[first + 1];
        else if (strcmp(argv[first], "--device") == 0)
            selector = argv[first + 1];
        else if (strcmp(argv[first], "--spacing") == 0)
            b.spacing = atof(argv[first + 1]);
        else if (strcmp(argv[first], "--padding") == 0)
            b.padding = atof(argv[first + 1]);
        else
            break;
    }
    if ((first < argc && argv[first][0] == '-') || !(b.spacing > 0.0)) {
        fprintf(stderr, "usage: kernels [--csv FILE] [--device SELECTOR] [--spacing A] "
                        "[--padding A] [MOLECULE [MODEL.ovoid]]...\n");
        return 2;
    }
    if (ovoid_context_create(&b.context) != OVOID_OK ||
        ovoid_context_open_device(b.context, selector) != OVOID_OK)
        fail(&b);
    if (csv && !(b.csv = fopen(csv, "w"))) {
        perror(csv);
        return 4;
    }
    measure_peak(&b);
    const ovoid_device_info *const info = ovoid_context_device(b.context);
    printf("device   %s (%s, driver %s)\n", info->name, info->platform, info->driver);
    printf("peak     %.1f GFLOP/s float32, measured\n\n", 1e-9 * b.peak);
    printf("%-24s %8s %9s  %-10s %11s %12s %9s %7s\n", "lists", "terms", "points", "pass",
           "microsec", "Gpairs/s", "of peak", "useful");
    if (b.csv)
        fprintf(b.csv,
                "# device: %s (%s, driver %s)\n# peak: %.1f GFLOP/s float32, measured\n"
                "# spacing %g, padding %g, cut-off %g\n"
                "lists,terms,points,pass,pairs,microseconds,gpairs_per_second,of_peak,useful\n",
                info->name, info->platform, info->driver, 1e-9 * b.peak, b.spacing, b.padding,
                CUTOFF);
    setting s = {0};
    make_long_lists(&b, &s);
    run_setting(&b, &s);
    for (int k = first; k < argc; ++k) {
        const char *const model = k + 1 < argc && is_model(argv[k + 1]) ? argv[k + 1] : NULL;
        memset(&s, 0, sizeof s);
        make_molecule_lists(&b, argv[k], NULL, &s);
        run_setting(&b, &s);
        if (model) {
            memset(&s, 0, sizeof s);
            make_molecule_lists(&b, argv[k++], model, &s);
            run_setting(&b, &s);
        }
    }
    if (b.csv && fclose(b.csv) != 0) {
        perror(csv);
        return 4;
    }
    ovoid_context_destroy(&b.context);
    return 0;
}
