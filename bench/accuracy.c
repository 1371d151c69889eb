/*
 * bench/accuracy: relative error of a molecule's and a model's field, and of its gradient, by how
 * far the structure extends.
 *
 *   accuracy [--csv FILE] [--append LABEL] [--device SELECTOR]
 *
 * Atoms or ellipsoids stand in eight clusters at the corners of a cube, or are spread over it one
 * by one; points are near them, where the field is above 0.1. The field on the device is compared
 * with the formula in double precision. A gradient's error is that of the vector, over its length
 * or the field times 1 per angstrom, whichever is larger.
 */
#include "ovoid/ovoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CLUSTERS = 8, MEMBERS = 40, COUNT = CLUSTERS * MEMBERS, POINTS = 40000 };

#define DECAY 0.5
#define LEAST 0.1 /* smaller fields are not compared: each Gaussian counts down to 1e-7 */

static const double half_extents[] = {50.0, 200.0, 800.0, 1e4, 1e5, 1e6};

typedef struct setting {
    ovoid_ellipsoid members[COUNT]; /* spheres, for a molecule */
    double *xyz, *value, *gradient;
} setting;

typedef struct errors {
    size_t count;
    double *value, *gradient;
} errors;

static uint64_t state;

static double uniform(double low, double high) {
    state += 0x9E3779B97F4A7C15u; /* splitmix64 */
    uint64_t z = state;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return low + (high - low) * ((double)((z ^ z >> 31) >> 11) * 0x1p-53);
}

static void *need(size_t count, size_t size) {
    void *const memory = calloc(count, size);
    if (!memory) {
        fputs("accuracy: out of memory\n", stderr);
        exit(1);
    }
    return memory;
}

static void check(ovoid_context *context, ovoid_status status) {
    if (status == OVOID_OK)
        return;
    fprintf(stderr, "accuracy: %s\n", context ? ovoid_context_error(context) : "out of memory");
    exit(1);
}

/* Places members and points. */
static void fill(setting *s, double half, bool spread, bool spheres) {
    const double side = spread ? half : 6.0;
    for (size_t i = 0; i < COUNT; ++i) {
        ovoid_ellipsoid *const e = &s->members[i];
        const size_t corner = i / MEMBERS;
        for (size_t axis = 0; axis < 3; ++axis) {
            const double middle = spread ? 0.0 : (half - side) * (corner >> axis & 1 ? 1.0 : -1.0);
            e->centre[axis] = middle + uniform(-side, side);
            e->angle[axis] = spheres ? 0.0 : uniform(-3.0, 3.0);
            e->decay[axis] = spheres ? DECAY : exp(uniform(-3.0, 0.0));
        }
        const double radius = uniform(1.0, 2.0);
        e->amplitude = exp(DECAY * radius * radius);
    }
    for (size_t k = 0; k < POINTS; ++k) {
        const ovoid_ellipsoid *const e = &s->members[(size_t)uniform(0.0, COUNT)];
        for (size_t axis = 0; axis < 3; ++axis)
            s->xyz[3 * k + axis] = e->centre[axis] + uniform(-3.0, 3.0);
    }
}

/* R_z R_y R_x with the signs of ovoid.h, applied to x. */
static void turn(const double angle[3], double x[3]) {
    const double c[3] = {cos(angle[0]), cos(angle[1]), cos(angle[2])};
    const double s[3] = {sin(angle[0]), sin(angle[1]), sin(angle[2])};
    const double y1 = c[0] * x[1] - s[0] * x[2], z1 = s[0] * x[1] + c[0] * x[2];
    const double x2 = c[1] * x[0] - s[1] * z1, z2 = s[1] * x[0] + c[1] * z1;
    x[0] = c[2] * x2 - s[2] * y1;
    x[1] = s[2] * x2 + c[2] * y1;
    x[2] = z2;
}

/* x times R's transpose. */
static void turn_back(const double angle[3], double x[3]) {
    const double c[3] = {cos(angle[0]), cos(angle[1]), cos(angle[2])};
    const double s[3] = {sin(angle[0]), sin(angle[1]), sin(angle[2])};
    const double x1 = c[2] * x[0] + s[2] * x[1], y1 = -s[2] * x[0] + c[2] * x[1];
    const double x2 = c[1] * x1 + s[1] * x[2], z2 = -s[1] * x1 + c[1] * x[2];
    x[0] = x2;
    x[1] = c[0] * y1 + s[0] * z2;
    x[2] = -s[0] * y1 + c[0] * z2;
}

/* The field and its gradient in double. */
static double exact(const setting *s, const double at[3], double gradient[3]) {
    double sum = 0.0;
    memset(gradient, 0, 3 * sizeof *gradient);
    for (size_t i = 0; i < COUNT; ++i) {
        const ovoid_ellipsoid *const e = &s->members[i];
        double x[3], q = 0.0;
        for (size_t axis = 0; axis < 3; ++axis)
            x[axis] = at[axis] - e->centre[axis];
        turn(e->angle, x);
        for (size_t axis = 0; axis < 3; ++axis) {
            q += e->decay[axis] * x[axis] * x[axis];
            x[axis] *= e->decay[axis];
        }
        const double value = e->amplitude * exp(-q);
        turn_back(e->angle, x);
        sum += value;
        for (size_t axis = 0; axis < 3; ++axis)
            gradient[axis] -= 2.0 * value * x[axis];
    }
    return sum;
}

static void compare(const setting *s, errors *e) {
    e->count = 0;
    for (size_t k = 0; k < POINTS; ++k) {
        double wanted[3], off = 0.0, length = 0.0;
        const double phi = exact(s, s->xyz + 3 * k, wanted);
        if (phi < LEAST)
            continue;
        for (size_t axis = 0; axis < 3; ++axis) {
            const double difference = s->gradient[3 * k + axis] - wanted[axis];
            off += difference * difference;
            length += wanted[axis] * wanted[axis];
        }
        e->value[e->count] = fabs(s->value[k] - phi) / phi;
        e->gradient[e->count++] = sqrt(off) / fmax(sqrt(length), phi);
    }
}

static void evaluate(ovoid_context *context, setting *s, bool spheres) {
    ovoid_field *field = NULL;
    if (spheres) {
        ovoid_molecule *molecule = NULL;
        double *const xyzr = need(4 * COUNT, sizeof *xyzr);
        for (size_t i = 0; i < COUNT; ++i) {
            memcpy(xyzr + 4 * i, s->members[i].centre, 3 * sizeof *xyzr);
            xyzr[4 * i + 3] = sqrt(log(s->members[i].amplitude) / DECAY);
        }
        check(context, ovoid_molecule_create(context, xyzr, COUNT, &molecule));
        check(context, ovoid_field_of_molecule(context, molecule, DECAY, 1.0, &field));
        ovoid_molecule_destroy(&molecule);
        free(xyzr);
    } else {
        ovoid_model *model = NULL;
        check(context, ovoid_model_create(context, s->members, COUNT, DECAY, 1.0, &model));
        check(context, ovoid_field_of_model(context, model, &field));
        ovoid_model_destroy(&model);
    }
    check(context, ovoid_field_evaluate(context, field, s->xyz, POINTS, s->value, s->gradient));
    ovoid_field_destroy(&field);
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *list, size_t count) {
    qsort(list, count, sizeof *list, ascending);
    return list[count / 2];
}

static void run(ovoid_context *context, FILE *csv, const char *label) {
    static setting s;
    errors e = {.value = need(POINTS, sizeof(double)), .gradient = need(POINTS, sizeof(double))};
    s.xyz = need(3 * POINTS, sizeof *s.xyz);
    s.value = need(POINTS, sizeof *s.value);
    s.gradient = need(3 * POINTS, sizeof *s.gradient);
    printf("%-10s %-9s %12s %12s %12s %12s %12s\n", "places", "field of", "half extent", "phi max",
           "median", "grad max", "median");
    for (int kind = 0; kind < 4; ++kind)
        for (size_t n = 0; n < sizeof half_extents / sizeof *half_extents; ++n) {
            const bool spread = kind & 1, spheres = kind < 2;
            state = 1 + n;
            fill(&s, half_extents[n], spread, spheres);
            evaluate(context, &s, spheres);
            compare(&s, &e);
            const double values = median(e.value, e.count), slopes = median(e.gradient, e.count);
            const double worst = e.value[e.count - 1], worst_slope = e.gradient[e.count - 1];
            const char *const places = spread ? "spread" : "clusters";
            const char *const of = spheres ? "molecule" : "model";
            printf("%-10s %-9s %12g %12.2g %12.2g %12.2g %12.2g\n", places, of, half_extents[n],
                   worst, values, worst_slope, slopes);
            if (csv)
                fprintf(csv, "%s,%s,%s,%g,%zu,%.3g,%.3g,%.3g,%.3g\n", label, places, of,
                        half_extents[n], e.count, worst, values, worst_slope, slopes);
        }
    free(e.value);
    free(e.gradient);
    free(s.xyz);
    free(s.value);
    free(s.gradient);
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    const char *path = NULL, *label = NULL, *selector = NULL;
    FILE *csv = NULL;
    for (int k = 1; k < argc; k += 2) {
        if (k + 1 < argc && strcmp(argv[k], "--csv") == 0)
            path = argv[k + 1];
        else if (k + 1 < argc && strcmp(argv[k], "--append") == 0)
            label = argv[k + 1];
        else if (k + 1 < argc && strcmp(argv[k], "--device") == 0)
            selector = argv[k + 1];
        else {
            fputs("usage: accuracy [--csv FILE] [--append LABEL] [--device SELECTOR]\n", stderr);
            return 2;
        }
    }
    check(context, ovoid_context_create(&context));
    check(context, ovoid_context_open_device(context, selector));
    if (path && !(csv = fopen(path, label ? "a" : "w"))) {
        perror(path);
        return 4;
    }
    if (csv && !label)
        fprintf(csv,
                "# device: %s; relative errors where the field is above %g; bench/accuracy.c\n"
                "version,places,field_of,half_extent,points,phi_largest,phi_median,"
                "gradient_largest,gradient_median\n",
                ovoid_context_device(context)->name, LEAST);
    run(context, csv, label ? label : ovoid_version());
    ovoid_context_destroy(&context);
    if (csv && fclose(csv) != 0) {
        perror(path);
        return 4;
    }
    return 0;
}
