/*
 * How long evaluations of a field take: points MOLECULE [COUNT [RUNS]]
 *
 * Prints, for COUNT points about the molecule's centre (1 by default) and RUNS evaluations (200),
 * microseconds: of the first one with a field (which puts it on the device, kernels compiled), the
 * median of those after it, without and with the gradient, and the median where each evaluation
 * makes a field of its own.
 */
#include "ovoid/ovoid.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

typedef struct subject {
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_field *field;
    double *xyz, *value, *gradient, *took;
    size_t count, runs;
} subject;

static void check(const subject *s, ovoid_status status) {
    if (status == OVOID_OK)
        return;
    fprintf(stderr, "points: %s\n", ovoid_context_error(s->context));
    exit(1);
}

static void make_field(subject *s) {
    check(s, ovoid_field_of_molecule(s->context, s->molecule, OVOID_DEFAULT_DECAY,
                                     OVOID_DEFAULT_ISOVALUE, &s->field));
}

static double once(subject *s, bool gradient, bool anew) {
    const double begin = now();
    if (anew)
        make_field(s);
    check(s, ovoid_field_evaluate(s->context, s->field, s->xyz, s->count, s->value,
                                  gradient ? s->gradient : NULL));
    if (anew)
        ovoid_field_destroy(&s->field);
    return now() - begin;
}

static double median(subject *s, bool gradient, bool anew) {
    for (size_t k = 0; k < s->runs; ++k)
        s->took[k] = once(s, gradient, anew);
    qsort(s->took, s->runs, sizeof *s->took, ascending);
    return s->took[s->runs / 2];
}

/* Near atoms, half an angstrom off. */
static void place_points(subject *s) {
    const double *const xyzr = ovoid_molecule_xyzr(s->molecule);
    const size_t atoms = ovoid_molecule_atoms(s->molecule);
    for (size_t k = 0; k < s->count; ++k)
        for (size_t axis = 0; axis < 3; ++axis)
            s->xyz[3 * k + axis] = xyzr[4 * (k * 7919 % atoms) + axis] + 0.5;
}

int main(int argc, char **argv) {
    subject s = {.count = argc > 2 ? strtoul(argv[2], NULL, 10) : 1,
                 .runs = argc > 3 ? strtoul(argv[3], NULL, 10) : 200};
    if (argc < 2 || s.count < 1 || s.runs < 1) {
        fputs("usage: points MOLECULE [COUNT [RUNS]]\n", stderr);
        return 2;
    }
    s.xyz = calloc(s.count, 3 * sizeof *s.xyz);
    s.value = calloc(s.count, sizeof *s.value);
    s.gradient = calloc(s.count, 3 * sizeof *s.gradient);
    s.took = calloc(s.runs, sizeof *s.took);
    if (!s.xyz || !s.value || !s.gradient || !s.took)
        return 1;
    check(&s, ovoid_context_create(&s.context));
    check(&s, ovoid_molecule_read(s.context, argv[1], OVOID_MOLECULE_AUTO, &s.molecule));
    place_points(&s);
    once(&s, false, true); /* compiles */
    once(&s, true, true);
    make_field(&s);
    printf("%zu points, microseconds\n", s.count);
    printf("first     %9.1f\n", once(&s, false, false));
    printf("others    %9.1f\n", median(&s, false, false));
    printf("gradient  %9.1f\n", median(&s, true, false));
    ovoid_field_destroy(&s.field);
    printf("anew      %9.1f\n", median(&s, false, true));
    ovoid_molecule_destroy(&s.molecule);
    ovoid_context_destroy(&s.context);
    free(s.xyz);
    free(s.value);
    free(s.gradient);
    free(s.took);
    return 0;
}
