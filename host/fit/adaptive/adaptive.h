/* The adaptive method (design, section 3): mixture reduction, then Levenberg-Marquardt, then splits
 * and merges where the surface is off. */
#ifndef OV_ADAPTIVE_H
#define OV_ADAPTIVE_H

#include "field/field.h"
#include "measure/judge.h"

/* A molecule as the method prepares it, once for all goals: the points about its surface, what a
 * model is held to there, its mesh, and how its atoms merge. */
typedef struct ov_adaptive ov_adaptive;

/* Of a model: what a search begins with or ends with. owner has an entry per atom. */
typedef struct ov_found {
    ov_quadric *quadrics;
    size_t count;
    uint32_t *owner;
    double tolerance; /* that it was shrunk for, 0: for none */
    size_t fewest;    /* ellipsoids that this took, in this frame or one before; 0: for none */
    bool moved;       /* of a start: the last frame's model, where the atoms have gone */
} ov_found;

void ov_found_destroy(ov_found *found);

/* Of a part of a molecule: what is about it and stays as it is. The caller's, to outlive the fit.
 */
typedef struct ov_surroundings {
    size_t atoms; /* of others near it, which follow its own in xyzr */
    const ov_quadric
        *fixed; /* what stands for these in the model: their Gaussians, or ellipsoids */
    size_t fixed_count;
    /* Of the unit of a symmetric assembly: what carries it to its images. Those of what is fitted
     * follow it: of a start, which there is then. */
    const ov_rigid *image;
    size_t images;
    ov_box region; /* in which surfaces are held to one another */
    const ov_spot
        *spots;        /* where the start is off: it is mended there, cavities or not, and else */
    size_t spot_count; /* stays as it is; 0: an ordinary search */
    uint64_t done, total; /* parts, as the caller is told */
} ov_surroundings;

/* Prepares nothing yet. xyzr stays the caller's, to outlive it. around: NULL where the atoms are
 * alone. keep: how atoms merge stays for the next goal, too; as large as the molecule. */
ovoid_status ov_adaptive_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                const ov_surroundings *around, bool keep, ov_adaptive **adaptive);
void ov_adaptive_destroy(ov_adaptive **adaptive);

/* Forgets what depends on where the atoms are: it is made anew by the next search. Buffers and
 * kernels stay. */
void ov_adaptive_forget(ov_adaptive *adaptive);

/* Of the points, where the caller asks for none, in a molecule of so many atoms, angstrom. */
double ov_default_spacing(size_t atoms, double decay);

/* How far from an atom's centre its own Gaussian can reach the isovalue, at most, angstrom. */
double ov_surface_reach(const double *xyzr, size_t atoms, const ovoid_fit_options *options);

/* Whether `ellipsoids` of them can be asked for. */
ovoid_status ov_adaptive_check(ovoid_context *context, const ovoid_adaptive_options *wanted,
                               size_t atoms);

/* Fits to the molecule's surface, from the atoms, or where that is not NULL from `start`. What
 * defines the surface, the spacings and the padding are the same in all options of one ov_adaptive.
 * Seconds in result count from began; its counts, errors and profile are filled in. A goal that is
 * not reached is no error: result says so, and the model is the best there was.
 *
 * With OVOID_ERROR_CANCELLED *found is the best that held, if one did, and result says of it what
 * was known; else both are untouched, as on other errors. Whatever happens, the next search can
 * follow. */
ovoid_status ov_adaptive_reach(ov_adaptive *adaptive, const ovoid_fit_options *options,
                               const ov_found *start, double began, ov_found *found,
                               ovoid_fit_result *result);

#endif
