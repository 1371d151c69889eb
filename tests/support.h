/*
 * What the tests of fields and fits share: a context with the device, reproducible random numbers,
 * models of every shape that is known to be difficult, points, and comparisons.
 */
#ifndef SUPPORT_H
#define SUPPORT_H

#include "field/field.h"
#include "once.h"
#include "selftest/check.h"
#include "selftest/twin.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* True under OVOID_TEST_SMALL=1: sizes for devices that are simulated. */
bool test_small(void);

/* `full`, or `small` in small mode. */
size_t test_size(size_t full, size_t small);

/* Fails the test with the context's message unless status is OVOID_OK. */
void test_check(ovoid_context *context, ovoid_status status);
/* Fails unless status is `wanted` and the message contains `part`. */
void test_refused(ovoid_context *context, ovoid_status status, ovoid_status wanted,
                  const char *part);

/* Whether a simulator executes kernels: it takes minutes for what takes a device a second. */
bool test_simulated(ovoid_context *context);
/* What comes after `n` where the same kernels are tried with one set of numbers after the other: of
 * these a simulator, which is there for how work-items share memory, has only each `every`-th. */
size_t test_next(ovoid_context *context, size_t n, size_t every);
/* Ends a test as skipped there: one of what the host does with kernels that others run there. */
void test_skip_simulated(ovoid_context *context);

/* Group fixtures: *state is a context with the device opened. */
int test_open(void **state);
int test_close(void **state);

/* A test of any lane: a device's groups are as large as OVOID_TEST_GROUP says, where it is set. */
void test_group_of_lane(void **state);

/* Allocates or aborts; free with free(). Zeroed. */
void *test_alloc(size_t count, size_t size);

/* PyMOL, for a shell. Debian's script starts it with the first python3 there is, which has to be
 * Debian's. */
#define TEST_PYMOL "PATH=/usr/bin:\"$PATH\" pymol"

/* ---- random numbers (splitmix64) ---------------------------------------------------------- */

typedef ov_random test_random;

#define random_bits ov_random_bits
#define random_uniform ov_random_uniform

/* ---- models ------------------------------------------------------------------------------- */

typedef enum model_kind {
    MODEL_RANDOM,  /* moderately long ellipsoids */
    MODEL_NEEDLE,  /* one axis a hundred times as long as the others */
    MODEL_PANCAKE, /* one axis a hundred times as short as the others */
    MODEL_SPHERE,  /* D proportional to I */
    MODEL_GIMBAL,  /* beta = +-pi/2 */
    MODEL_HUGE,    /* amplitudes up to e^40 */
    MODEL_TINY,    /* amplitudes down to 1e-8 */
    MODEL_KINDS
} model_kind;

const char *model_kind_name(model_kind kind);

/* Ellipsoids with centres in the cube of this half-length, at float positions, so that moving them
 * to the device does not round. */
void random_ellipsoids(test_random *random, model_kind kind, double half,
                       ovoid_ellipsoid *ellipsoids, size_t count);

/* ---- a model on the device ---------------------------------------------------------------- */

/* Points, terms and lists of one test. */
typedef struct bench {
    ovoid_context *context;
    ov_quadric *quadrics;
    size_t terms_count, count;
    double *xyz; /* of the points in pack order, 3 per point */
    ov_points points;
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
} bench;

/* Puts `count` points (3 floats each) and the terms on the device, lists included; origin 0. */
void bench_create(bench *b, ovoid_context *context, const ov_quadric *quadrics, size_t terms_count,
                  const float *xyz, size_t count, double cutoff);
/* As bench_create(), for points in double. */
void bench_place(bench *b, ovoid_context *context, const ov_quadric *quadrics, size_t terms_count,
                 const double *xyz, size_t count, double cutoff);
void bench_destroy(bench *b);

/* As doubles, 3 per point, to be freed. */
double *widen_points(const float *xyz, size_t count);

/* Random points in the cube of this half-length. */
float *random_points(test_random *random, size_t count, double half);

/* Random ellipsoids of the kind with random points about them, every pair in the lists: the cut-off
 * is far below single precision. */
void bench_random(bench *b, ovoid_context *context, model_kind kind, size_t terms_count,
                  size_t count, uint64_t seed);

/* As bench_random(), with all moved by this far from the origin (angstrom). */
void bench_random_at(bench *b, ovoid_context *context, model_kind kind, size_t terms_count,
                     size_t count, uint64_t seed, const double offset[3]);

/* Offsets as far as coordinates go, and none that floats hold. */
extern const double bench_far[3];

/* The first `count` floats of a buffer, to be freed. */
float *read_floats(ovoid_context *context, const ov_buffer *buffer, size_t count);
/* Coordinates (angstrom) of every place of the packs, 3 each, to be freed. */
double *read_places(ovoid_context *context, const ov_points *points);
uint32_t *read_indices(ovoid_context *context, const ov_buffer *buffer, size_t count);
void write_floats(ovoid_context *context, ov_buffer *buffer, const float *values, size_t count);

/* ---- comparison --------------------------------------------------------------------------- */

/* Fails unless |got - wanted.value| <= tolerance * FLT_EPSILON * wanted.scale (+ 1e-30, for what
 * lies below the smallest float that every device keeps). Keeps the largest quotient in *worst. */
void expect_close(double got, ov_twin_sum wanted, double tolerance, double *worst, const char *what,
                  size_t index);

/* Fails unless each atom of the molecule has an owner among the model's ellipsoids, and of the
 * share `most` of the atoms the owner has one of the `among` largest values at the atom's centre.
 * Returns how many ellipsoids own no atom. */
size_t expect_owners(const ovoid_molecule *molecule, const ovoid_model *model, size_t among,
                     double most);

/* Fails unless both have the same ellipsoids and owners, bit by bit. */
void expect_same_models(const ovoid_model *a, const ovoid_model *b);

/* Fails unless |got - wanted| <= tolerance. */
void expect_near(double got, double wanted, double tolerance, const char *what);

#endif
