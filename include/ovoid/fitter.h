/*
 * Ovoid: a fit session. See ovoid.h, which includes this, for the conventions.
 *
 * A fitter prepares a molecule once and fits it again and again: to several goals, from models that
 * there are, and at the next coordinates of the same atoms.
 *
 *     ovoid_fitter_create(context, molecule, &options, &fitter);
 *     options.adaptive.tolerance = 1.0;
 *     ovoid_fitter_reach(context, fitter, &options, &coarse, NULL);
 *     options.adaptive.tolerance = 0.5;
 *     ovoid_fitter_reach(context, fitter, &options, &fine, NULL);
 *     ovoid_fitter_move(context, fitter, next_frame);
 *     ovoid_fitter_reach(context, fitter, &options, &next, NULL);
 */
#ifndef OVOID_FITTER_H
#define OVOID_FITTER_H

#include "ovoid/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Keeps what fits of one molecule share: the constrained points and what a model is held to there,
 * the mesh of the original surface that models are judged by, how the atoms merge, and buffers on
 * the device. It belongs to the context that it was made with, and is refused by others. When that
 * one opens another device, the fitter follows, and prepares anew; when it is destroyed first, the
 * fitter can only be destroyed. */
typedef struct ovoid_fitter ovoid_fitter;

/* Makes a fitter for the molecule's atoms (copied) and the surface that the options define: decay,
 * isovalue, spacing and padding, for method adaptive also adaptive.mesh_spacing. Method and goal
 * are not looked at. Prepares nothing yet, and opens no device. */
OVOID_API ovoid_status ovoid_fitter_create(ovoid_context *context, const ovoid_molecule *molecule,
                                           const ovoid_fit_options *options, ovoid_fitter **fitter);
OVOID_API void ovoid_fitter_destroy(ovoid_fitter **fitter);

/* Fits a model by the method and to the goal in the options, as ovoid_fit() does, but for preparing
 * what has been prepared before: from the atoms it comes to the same bits, whatever the fitter did
 * before. result may be NULL, else it was made by ovoid_fit_result_init(); sample_seconds is next
 * to nothing where the points were there. Options that define the surface and differ from those
 * that the fitter was made with are OVOID_ERROR_ARGUMENT.
 *
 * OVOID_ERROR_CANCELLED, when the progress callback asked to stop, hands over the best model that
 * held by then, if one did: *model is it, to be destroyed by the caller, and *result says of it
 * what is known (distance: what the search knew, no less than it is; NAN where it was not measured
 * yet); otherwise *model is NULL and *result untouched. What holds is
 * - of OVOID_GOAL_TOLERANCE a model within the tolerance: from the end of growing on;
 * - of OVOID_GOAL_ELLIPSOIDS and OVOID_GOAL_RATIO one of so many ellipsoids: once the atoms are
 *   merged;
 * - of method l1 the model after any iteration (rms_error and max_error NAN where not known).
 * Nothing is computed for it after the callback has said no; the last touch of a fit, which makes
 * the volumes equal to 1e-4, is missing.
 *
 * After an error, a stop among them, the fitter is as it was before the call, but for what it has
 * prepared by then, and may be used again. */
OVOID_API ovoid_status ovoid_fitter_reach(ovoid_context *context, ovoid_fitter *fitter,
                                          const ovoid_fit_options *options, ovoid_model **model,
                                          ovoid_fit_result *result);

/* From now on method adaptive begins with this model (copied) instead of the atoms; NULL: with the
 * atoms again. Method l1 always begins with the atoms.
 * - To a tolerance: where the model is off, ellipsoids are added; then, and where it held from the
 *   start at once, as many are merged as the tolerance allows. One that held never ends with more
 *   ellipsoids, or off. One that is off in too many places is left for the atoms.
 * - To a number of at least half and at most twice as many: ellipsoids are merged or split until
 *   there are so many. A model of that many never ends further off, but for the volumes, which are
 *   made equal. To other numbers it begins with the atoms.
 * The model stands for a surface of the same decay and isovalue, and has no more ellipsoids than
 * the molecule has atoms; else it is OVOID_ERROR_ARGUMENT. Its owners are used if they are as many
 * as the atoms, else each atom is given to the ellipsoid with the largest value at its centre.
 * After an error the start is what it was. */
OVOID_API ovoid_status ovoid_fitter_start_from(ovoid_context *context, ovoid_fitter *fitter,
                                               const ovoid_model *model);

/* Moves the atoms: xyz[3 * i + {0, 1, 2}] are their new coordinates (angstrom), as many and in the
 * order of the molecule; their radii stay. The last model that method adaptive reached (or that was
 * given as a start after that) goes along and is what method adaptive begins with from now on: each
 * ellipsoid with the atoms that it owns, turned as the atoms about it. Points, target and meshes
 * are made anew by the next fit; kernels and buffers are kept. To the same tolerance as in the last
 * frame the next fit changes as little as it can: where the model is off, ellipsoids are first
 * refined, then added, and merged only down to 5 % more than frames before could do with. After an
 * error all is what it was. */
OVOID_API ovoid_status ovoid_fitter_move(ovoid_context *context, ovoid_fitter *fitter,
                                         const double *xyz);

#ifdef __cplusplus
}
#endif

#endif
