/*
 * What the checks of the self-test share: what is being checked, comparisons that keep the first
 * that fails, reproducible random numbers, and points, terms and lists to work on.
 */
#ifndef OV_CHECK_H
#define OV_CHECK_H

#include "field/field.h"
#include "selftest/twin.h"

/* One check under way. */
typedef struct ov_checking {
    ovoid_context *context;
    bool whole;      /* sizes of the whole self-test, not those of the short form */
    bool wrong;      /* something was not what it should be */
    double worst;    /* largest error, as a share of what is allowed */
    size_t compared; /* numbers */
    char text[256];  /* the first that was wrong */
} ov_checking;

/* A check of the list in selftest.c. Numbers that are not right are told to `checking`; a status
 * other than OVOID_OK is a call that failed. */
typedef struct ov_check {
    const char *name;
    const char *kernels; /* those that it looks at */
    bool brief;          /* part of the short form */
    bool needed;         /* all that follow work with it: where it is wrong, they are left out */
    ovoid_status (*run)(ov_checking *checking);
} ov_check;

/* All checks. */
const ov_check *ov_checks(size_t *count);

/* `whole` or `brief`, as is being checked. */
size_t ov_check_size(const ov_checking *c, size_t whole, size_t brief);

/* ---- comparisons: true where all is right ------------------------------------------------- */

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
bool
ov_expect(ov_checking *c, bool right, const char *format, ...);

/* |got - wanted.value| <= tolerance * FLT_EPSILON * wanted.scale, and 1e-30 for what lies below the
 * smallest float that every device keeps. */
bool ov_expect_close(ov_checking *c, double got, ov_twin_sum wanted, double tolerance,
                     const char *what, size_t index);

bool ov_expect_near(ov_checking *c, double got, double wanted, double allowed, const char *what,
                    size_t index);

/* Bit by bit. */
bool ov_expect_same(ov_checking *c, const float *got, const float *wanted, size_t count,
                    const char *what);

/* ---- random numbers (splitmix64) ---------------------------------------------------------- */

typedef struct ov_random {
    uint64_t state;
} ov_random;

uint64_t ov_random_bits(ov_random *random);
double ov_random_uniform(ov_random *random, double low, double high);

/* ---- buffers ------------------------------------------------------------------------------ */

/* The first `count` values of four bytes each, allocated: free with free(). */
ovoid_status ov_read_words(ovoid_context *context, const ov_buffer *buffer, size_t count,
                           void *allocated);
ovoid_status ov_put_floats(ovoid_context *context, ov_buffer *buffer, const float *values,
                           size_t count);

/* `count` floats between low and high, allocated; NULL with an error. */
float *ov_random_floats(ovoid_context *context, ov_random *random, size_t count, double low,
                        double high);

/* ---- a model about points ----------------------------------------------------------------- */

/* On the device, and as the twins have it. {0} is none. */
typedef struct ov_setting {
    ov_quadric *quadrics;
    size_t count;  /* of them */
    size_t places; /* of the packs, those that fill up the last one included */
    double *xyz;   /* of each place, angstrom */
    ov_points points;
    ov_terms terms;
    ov_lists lists;
    ov_operations operations;
} ov_setting;

/* An ellipsoid with its centre in the cube of this half-length. */
void ov_random_quadric(ov_random *random, double half, ov_quadric *quadric);

/* Random ellipsoids in the cube of half-length `inner` and points in that of `outer`; lists hold
 * what reaches the cut-off. */
ovoid_status ov_setting_create(ovoid_context *context, uint64_t seed, size_t count, size_t points,
                               double inner, double outer, double cutoff, ov_setting *setting);
/* The same for quadrics of the caller's, which are copied. */
ovoid_status ov_setting_of(ovoid_context *context, const ov_quadric *quadrics, size_t count,
                           const double *xyz, size_t points, double cutoff, ov_setting *setting);
void ov_setting_destroy(ov_setting *setting);

/* As ov_random_floats() for each place, 0 at those that fill up a pack. */
float *ov_setting_floats(ovoid_context *context, const ov_setting *setting, ov_random *random,
                         double low, double high);

/* Whether an ascending list, one of many that follow one another from start[list] on, has the
 * value.
 */
bool ov_list_holds(const uint32_t *start, const uint32_t *item, size_t list, uint32_t value);

/* ---- the checks --------------------------------------------------------------------------- */

/* Sizes and offsets of the structures that host and kernels share, in the order of
 * kernels/layout.cl. Returns how many. */
#define OV_LAYOUT_MOST 32
size_t ov_layout_of_host(uint32_t wanted[OV_LAYOUT_MOST]);

ovoid_status ov_check_layout(ov_checking *c);
ovoid_status ov_check_tree(ov_checking *c);
ovoid_status ov_check_lists(ov_checking *c);
ovoid_status ov_check_field(ov_checking *c);
ovoid_status ov_check_moments(ov_checking *c);
ovoid_status ov_check_misfit(ov_checking *c);
ovoid_status ov_check_gather(ov_checking *c);
ovoid_status ov_check_spread(ov_checking *c);
ovoid_status ov_check_merge(ov_checking *c);
ovoid_status ov_check_solver(ov_checking *c);
ovoid_status ov_check_images(ov_checking *c);
ovoid_status ov_check_mesh(ov_checking *c);
ovoid_status ov_check_distances(ov_checking *c);
ovoid_status ov_check_picture(ov_checking *c);
ovoid_status ov_check_many_points(ov_checking *c);
ovoid_status ov_check_many_terms(ov_checking *c);
ovoid_status ov_check_many_distances(ov_checking *c);
ovoid_status ov_check_fit(ov_checking *c);

#endif
