/*
 * Whether a device computes what it should: every kernel against plain C in double precision, on
 * known inputs.
 *
 * The first time that a device is used with a driver, a short form runs by itself: at the first
 * kernel that a context needs, not when the device is opened. A device that computes wrongly is
 * refused, with OVOID_ERROR_DEVICE and what was wrong. That it passed is remembered in the folder
 * of compiled kernels (OVOID_CACHE_DIR, $XDG_CACHE_HOME/ovoid or ~/.cache/ovoid), for that device,
 * driver and version of the library. The environment variable OVOID_SELFTEST turns it off ("off")
 * or runs it in every process ("on").
 */
#ifndef OVOID_SELFTEST_H
#define OVOID_SELFTEST_H

#include "ovoid/context.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ovoid_check_verdict {
    OVOID_CHECK_PASSED = 0,
    OVOID_CHECK_WRONG, /* a number is not what it should be */
    OVOID_CHECK_FAILED /* a call failed: nothing is known */
} ovoid_check_verdict;

/* One check. Made by the library. */
typedef struct ovoid_check {
    size_t size;
    const char *name;
    const char *kernels; /* the ones that it looks at, with blanks between them */
    ovoid_check_verdict verdict;
    double seconds;    /* with compiling what was not compiled before */
    uint64_t compared; /* numbers */
    double error;      /* the largest error, as a share of what is allowed; NAN unless passed */
    const char *text;  /* what was wrong or failed, "" of a check that passed */
} ovoid_check;

/* Called after each check, with the context's rules for callbacks. *check and its texts are valid
 * until it returns, its names as long as the library. */
typedef void (*ovoid_check_fn)(const ovoid_check *check, void *user);

typedef struct ovoid_selftest_options {
    size_t size;
    bool brief; /* false; true: the short form, with small sizes */
} ovoid_selftest_options;

/* What came of it, and what the device costs: the best of several tries, NAN where a call failed.
 */
typedef struct ovoid_selftest_result {
    size_t size;
    uint32_t passed, wrong, failed; /* checks */
    uint32_t vector, lanes; /* the shape of the kernels: floats of a vector, work-items of a pack */
    uint32_t team;          /* work-items that share a term */
    uint32_t solve_group;   /* work-items in a group of the solver */
    double launch_seconds;  /* to enqueue a kernel that does next to nothing, of many in a row */
    double round_trip_seconds; /* to launch one and read four bytes of what it wrote */
    double to_device_bytes;    /* per second, of 16 MiB in the caller's memory */
    double from_device_bytes;  /* the same, back */
} ovoid_selftest_result;

OVOID_API void ovoid_selftest_options_init(ovoid_selftest_options *options, size_t size);
OVOID_API void ovoid_selftest_result_init(ovoid_selftest_result *result, size_t size);

/* Runs all checks on the opened device, opening the default one if none is, whatever is remembered
 * of it. OVOID_OK when they have run: result tells how many found something wrong. Where the layout
 * of structures or the lists are wrong, the checks that follow, which work with them, are left out.
 * options, fn and result may be NULL. */
OVOID_API ovoid_status ovoid_selftest(ovoid_context *context, const ovoid_selftest_options *options,
                                      ovoid_check_fn fn, void *user, ovoid_selftest_result *result);

#ifdef __cplusplus
}
#endif

#endif
