#include "fit/fitter.h"

#include "base/progress.h"
#include "base/sized.h"
#include "base/tenant.h"
#include "fit/adaptive/adaptive.h"
#include "fit/adaptive/constants.h"
#include "fit/l1/l1.h"
#include "fit/motion.h"
#include "fit/need.h"
#include "fit/options.h"
#include "fit/parts/parts.h"
#include "fit/parts/times.h"
#include "model/factor.h"
#include "model/model.h"
#include "model/owner.h"
#include "molecule/assembly.h"
#include "molecule/molecule.h"
#include "molecule/symmetry.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct ovoid_fitter {
    ov_tenant tenant;
    ovoid_context *context; /* of the tenant, while that has one */
    bool once;
    size_t atoms;
    double *xyzr;              /* of all of them; NULL: where the molecule has them */
    ovoid_molecule *molecule;  /* of a symmetric assembly, of which one unit is fitted, */
    ov_symmetry symmetry;      /* unless the order is 0 */
    double *unit;              /* the unit's atoms */
    ovoid_fit_options surface; /* what defines it; method and goal are those of each fit */
    ov_adaptive *adaptive;     /* of the opened device; NULL until it is needed */
    ov_l1_band *band;          /* of method l1, likewise */
    ov_found start;            /* what method adaptive begins with; count 0: the atoms */
    ov_found last;             /* what it came to after that; count 0: nothing */
    bool last_by_unit;         /* that is the model of the unit */
};

/* ---- the object ------------------------------------------------------------------------------ */

static void leave_device(ov_tenant *tenant) {
    ovoid_fitter *const fitter = (ovoid_fitter *)tenant; /* its first member */
    ov_adaptive_destroy(&fitter->adaptive);
    ov_l1_band_destroy(&fitter->band);
}

/* All atoms, of an assembly where its placements have them. */
static ovoid_status take_all(ovoid_fitter *fitter, const ovoid_molecule *molecule) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_molecule_expand(fitter->context, molecule));
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    OV_TRY(ov_atoms_check(fitter->context, xyzr, fitter->atoms, fitter->surface.decay));
    fitter->xyzr = ov_alloc(fitter->context, 4 * fitter->atoms, sizeof *xyzr, "atoms");
    if (!fitter->xyzr)
        return OVOID_ERROR_MEMORY;
    memcpy(fitter->xyzr, xyzr, 4 * fitter->atoms * sizeof *xyzr);
cleanup:
    return status;
}

/* One unit of a symmetric assembly; the others when they are needed. */
static ovoid_status take_unit(ovoid_fitter *fitter, const ovoid_molecule *molecule) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = fitter->context;
    OV_TRY(ov_symmetry_unit(context, molecule, &fitter->symmetry, &fitter->unit));
    OV_TRY(
        ov_atoms_check(context, fitter->unit, fitter->symmetry.unit_atoms, fitter->surface.decay));
    OV_TRY(ov_molecule_copy_atoms(context, molecule, &fitter->molecule));
cleanup:
    return status;
}

static ovoid_status take_atoms(ovoid_fitter *fitter, const ovoid_molecule *molecule) {
    if (fitter->surface.parts.symmetry != OVOID_SYMMETRY_IGNORE) {
        const ovoid_status status = ov_symmetry_find(fitter->context, molecule, &fitter->symmetry);
        if (status != OVOID_OK)
            return status;
    }
    if (fitter->symmetry.order > 1)
        return take_unit(fitter, molecule);
    ov_symmetry_destroy(&fitter->symmetry);
    return take_all(fitter, molecule);
}

/* Makes fitter->xyzr. */
static ovoid_status need_all(ovoid_fitter *fitter) {
    return fitter->xyzr ? OVOID_OK : take_all(fitter, fitter->molecule);
}

ovoid_status ov_fitter_create(ovoid_context *context, const ovoid_molecule *molecule,
                              const ovoid_fit_options *options, bool once, ovoid_fitter **fitter) {
    ovoid_status status = OVOID_OK;
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ovoid_fitter *made = NULL;
    ovoid_fit_options surface;
    ovoid_fit_options_init(&surface, sizeof surface);
    OV_TRY(OV_SIZED_TAKE(context, ovoid_fit_options, options, &surface));
    OV_TRY(ov_surface_options_check(context, &surface));
    made = ov_alloc(context, 1, sizeof *made, "a fitter");
    if (!made)
        return OVOID_ERROR_MEMORY;
    *made = (ovoid_fitter){.context = context, .once = once, .atoms = atoms, .surface = surface};
    ov_tenant_join(context, &made->tenant, leave_device);
    OV_TRY(take_atoms(made, molecule));
    *fitter = made;
    made = NULL;
cleanup:
    ovoid_fitter_destroy(&made);
    return status;
}

ovoid_status ovoid_fitter_create(ovoid_context *context, const ovoid_molecule *molecule,
                                 const ovoid_fit_options *options, ovoid_fitter **fitter) {
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, options);
    OV_NEED(context, fitter);
    return ov_fitter_create(context, molecule, options, false, fitter);
}

void ovoid_fitter_destroy(ovoid_fitter **fitter) {
    if (!fitter || !*fitter)
        return;
    ov_tenant_part(&(*fitter)->tenant);
    ov_found_destroy(&(*fitter)->start);
    ov_found_destroy(&(*fitter)->last);
    ov_symmetry_destroy(&(*fitter)->symmetry);
    ovoid_molecule_destroy(&(*fitter)->molecule);
    free((*fitter)->unit);
    free((*fitter)->xyzr);
    free(*fitter);
    *fitter = NULL;
}

/* ---- fitting --------------------------------------------------------------------------------- */

static ovoid_status check_same(ovoid_context *context, const char *name, double made, double now) {
    return made == now
               ? OVOID_OK
               : ov_fail(context, OVOID_ERROR_ARGUMENT,
                         "option %s is %.9g, and the fitter was made for %.9g", name, now, made);
}

/* The surface is that of the fitter. */
static ovoid_status check_surface(const ovoid_fitter *fitter, const ovoid_fit_options *options) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = fitter->context;
    const ovoid_fit_options *const made = &fitter->surface;
    OV_TRY(check_same(context, "decay", made->decay, options->decay));
    OV_TRY(check_same(context, "isovalue", made->isovalue, options->isovalue));
    OV_TRY(check_same(context, "spacing", made->spacing, options->spacing));
    OV_TRY(check_same(context, "padding", made->padding, options->padding));
    if (options->method == OVOID_METHOD_ADAPTIVE)
        OV_TRY(check_same(context, "mesh_spacing", made->adaptive.mesh_spacing,
                          options->adaptive.mesh_spacing));
cleanup:
    return status;
}

/* By method l1; *ellipsoids NULL: nothing is handed over. */
static ovoid_status fit_l1(ovoid_fitter *fitter, const ovoid_fit_options *options, double began,
                           ovoid_ellipsoid **ellipsoids, uint32_t **owner,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    OV_TRY(need_all(fitter));
    OV_TRY(
        ov_l1_band_prepare(fitter->context, fitter->xyzr, fitter->atoms, options, &fitter->band));
    result->sample_seconds = ov_seconds() - began;
    result->spacing = options->spacing > 0.0 ? options->spacing : OVOID_DEFAULT_SPACING_L1;
    result->reached = true;
    result->verdict = OVOID_VERDICT_NO_GOAL;
    OV_TRY(ov_l1_fit(fitter->context, fitter->xyzr, fitter->atoms, ov_l1_band_samples(fitter->band),
                     options, ellipsoids, owner, result));
cleanup:
    return status;
}

/* ---- handing over ---------------------------------------------------------------------------- */

/* The owners of all atoms, whose units follow one another among the ellipsoids. */
static void spread_owners(const ov_symmetry *symmetry, const ov_found *unit, uint32_t *owner) {
    for (size_t g = 0; g < symmetry->order; ++g) {
        const uint32_t *from = unit->owner;
        for (size_t u = 0; u < symmetry->units; ++u) {
            uint32_t *const to = owner + symmetry->first[g * symmetry->units + u];
            for (size_t n = 0; n < symmetry->atoms[u]; ++n)
                to[n] = (uint32_t)(g * unit->count) + *from++;
        }
    }
}

/* The model in the paper's parameters, with a copy of its owners; by_unit: found is that of a unit,
 * and the owners are those of all atoms. */
static ovoid_status hand_over(const ovoid_fitter *fitter, const ov_found *found, bool by_unit,
                              ovoid_ellipsoid **ellipsoids, uint32_t **owner) {
    ovoid_context *const context = fitter->context;
    ovoid_ellipsoid *const made = ov_alloc(context, found->count, sizeof *made, "ellipsoids");
    uint32_t *const owned = ov_alloc(context, fitter->atoms, sizeof *owned, "owners");
    if (!made || !owned) {
        free(made);
        free(owned);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t i = 0; i < found->count; ++i)
        ov_ellipsoid_of_quadric(&found->quadrics[i], &made[i]);
    if (by_unit)
        spread_owners(&fitter->symmetry, found, owned);
    else
        memcpy(owned, found->owner, fitter->atoms * sizeof *owned);
    *ellipsoids = made;
    *owner = owned;
    return OVOID_OK;
}

/* ---- one unit for all ------------------------------------------------------------------------ */

/* Whether one unit is fitted: ellipsoids that are asked for have to be as many in each. */
static bool is_fitted_by_unit(const ovoid_fitter *fitter, const ovoid_fit_options *options) {
    const size_t order = fitter->symmetry.order;
    return order > 0 && fitter->start.count == 0 && options->parts.symmetry == OVOID_SYMMETRY_USE &&
           (options->adaptive.goal != OVOID_GOAL_ELLIPSOIDS ||
            options->adaptive.ellipsoids % order == 0);
}

static ovoid_status reach_by_unit(ovoid_fitter *fitter, const ovoid_fit_options *options,
                                  double began, ov_ranks *ranks, ov_found *found,
                                  ovoid_fit_result *result) {
    const ov_images images = {fitter->symmetry.motion, fitter->symmetry.order};
    ovoid_fit_options of_unit = *options;
    of_unit.adaptive.ellipsoids /= (uint32_t)images.count;
    ovoid_status status = ov_parts_reach(fitter->context, fitter->unit, fitter->symmetry.unit_atoms,
                                         &images, &of_unit, began, ranks, found, result);
    result->ellipsoids *= images.count;
    result->units = images.count;
    return status;
}

static ovoid_status reach_with_all(ovoid_fitter *fitter, const ovoid_fit_options *options,
                                   double began, ov_ranks *ranks, ov_found *found,
                                   ovoid_fit_result *result) {
    static const ov_images alone = {&ov_rigid_identity, 1};
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = fitter->context;
    const ov_found *const start = fitter->start.count > 0 ? &fitter->start : NULL;
    OV_TRY(need_all(fitter));
    if (!start && ov_parts_wanted(options, fitter->atoms))
        return ov_parts_reach(context, fitter->xyzr, fitter->atoms, &alone, options, began, ranks,
                              found, result);
    if (!fitter->adaptive) {
        OV_TRY(ov_need_check(context, &(ov_need){fitter->atoms, fitter->atoms, 1}));
        OV_TRY(ov_adaptive_create(context, fitter->xyzr, fitter->atoms, NULL, !fitter->once,
                                  &fitter->adaptive));
    }
    status = ov_adaptive_reach(fitter->adaptive, options, start, began, found, result);
cleanup:
    return status;
}

static ovoid_status fit_adaptive(ovoid_fitter *fitter, const ovoid_fit_options *options,
                                 double began, ov_ranks *ranks, ovoid_ellipsoid **ellipsoids,
                                 uint32_t **owner, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_found found = {0};
    const bool by_unit = is_fitted_by_unit(fitter, options);
    OV_TRY(ov_adaptive_check(fitter->context, &options->adaptive, fitter->atoms));
    status = by_unit ? reach_by_unit(fitter, options, began, ranks, &found, result)
                     : reach_with_all(fitter, options, began, ranks, &found, result);
    if (found.count > 0) {
        if (hand_over(fitter, &found, by_unit, ellipsoids, owner) != OVOID_OK) {
            status = OVOID_ERROR_MEMORY;
            goto cleanup;
        }
        ov_found_destroy(&fitter->last);
        fitter->last = found;
        fitter->last_by_unit = by_unit;
        found = (ov_found){0};
    }
cleanup:
    ov_found_destroy(&found);
    return status;
}

static uint64_t hash_start(const ov_found *start) {
    return start->count > 0 ? ov_hash(start->quadrics, start->count * sizeof *start->quadrics) : 0;
}

/* Of a symmetric assembly by its unit: all atoms may be there on some ranks alone. */
static ovoid_status meet_ranks(const ovoid_fitter *fitter, const ovoid_fit_options *options,
                               ov_ranks *ranks) {
    const ov_symmetry *const symmetry = &fitter->symmetry;
    const bool by_unit = symmetry->order > 0;
    const uint64_t start = hash_start(&fitter->start) ^ (by_unit ? symmetry->order : 0);
    return ov_ranks_begin(fitter->context, options, by_unit ? fitter->unit : fitter->xyzr,
                          by_unit ? symmetry->unit_atoms : fitter->atoms, start, ranks);
}

static ovoid_status fit(ovoid_fitter *fitter, const ovoid_fit_options *options, double began,
                        ovoid_ellipsoid **ellipsoids, uint32_t **owner, ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    ov_ranks ranks = {0};
    ov_times_forget(fitter->context);
    if (options->method == OVOID_METHOD_ADAPTIVE)
        OV_TRY(meet_ranks(fitter, options, &ranks));
    OV_TRY(ov_fit_options_check(fitter->context, options));
    ov_progress_fit(fitter->context, options->method);
    result->method = options->method;
    OV_TRY(check_surface(fitter, options));
    OV_TRY(ov_device_get(fitter->context, &device));
    OV_TRY(options->method == OVOID_METHOD_L1
               ? fit_l1(fitter, options, began, ellipsoids, owner, result)
               : fit_adaptive(fitter, options, began, &ranks, ellipsoids, owner, result));
cleanup:
    return ov_ranks_end(fitter->context, &ranks, status);
}

/* The motions of the symmetry as placements of its unit. */
static ovoid_status copy_motions(const ovoid_fitter *fitter, ovoid_motion **placements) {
    const ov_symmetry *const symmetry = &fitter->symmetry;
    ovoid_motion *const made =
        ov_alloc(fitter->context, symmetry->order, sizeof *made, "placements");
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < symmetry->order; ++g) {
        memcpy(made[g].rotation, symmetry->motion[g].rotation, sizeof made[g].rotation);
        memcpy(made[g].translation, symmetry->motion[g].shift, sizeof made[g].translation);
    }
    *placements = made;
    return OVOID_OK;
}

/* The model of what was found, and the last of the result. */
static ovoid_status make_model(const ovoid_fitter *fitter, const ovoid_ellipsoid *ellipsoids,
                               uint32_t **owner, double began, ovoid_fit_result *result,
                               ovoid_model **model) {
    const bool by_unit = result->units != OVOID_UNKNOWN && result->units > 1;
    const size_t units = by_unit ? (size_t)result->units : 1;
    ovoid_motion *placements = NULL;
    ovoid_status status = OVOID_OK;
    if (by_unit)
        OV_TRY(copy_motions(fitter, &placements));
    OV_TRY(ovoid_model_create_placed(
        fitter->context, ellipsoids, (size_t)result->ellipsoids / units, placements,
        by_unit ? units : 0, fitter->surface.decay, fitter->surface.isovalue, model));
    ov_model_take_owner(*model, owner, fitter->atoms);
    result->fit_seconds = ov_seconds() - began - result->sample_seconds;
cleanup:
    free(placements);
    return status;
}

/* A model with OVOID_OK, and maybe with OVOID_ERROR_CANCELLED. */
static ovoid_status reach(ovoid_fitter *fitter, const ovoid_fit_options *options,
                          ovoid_model **model, ovoid_fit_result *result) {
    ovoid_ellipsoid *ellipsoids = NULL;
    uint32_t *owner = NULL;
    const double began = ov_seconds();
    ovoid_status status = fit(fitter, options, began, &ellipsoids, &owner, result);
    if (ellipsoids && (status == OVOID_OK || status == OVOID_ERROR_CANCELLED)) {
        const ovoid_status made = make_model(fitter, ellipsoids, &owner, began, result, model);
        status = made == OVOID_OK ? status : made;
    }
    free(ellipsoids);
    free(owner);
    return status;
}

ovoid_status ovoid_fitter_reach(ovoid_context *context, ovoid_fitter *fitter,
                                const ovoid_fit_options *options, ovoid_model **model,
                                ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ovoid_model *made = NULL;
    ovoid_fit_options wanted;
    ovoid_fit_result done;
    OV_NEED(context, context);
    OV_NEED(context, fitter);
    OV_NEED(context, options);
    OV_NEED(context, model);
    ovoid_fit_options_init(&wanted, sizeof wanted);
    ovoid_fit_result_init(&done, sizeof done);
    ov_progress_begin(context, "sample");
    context->now.ellipsoids = fitter->atoms;
    OV_TRY(ov_tenant_check(context, &fitter->tenant, "fitter"));
    OV_TRY(OV_SIZED_TAKE(context, ovoid_fit_options, options, &wanted));
    OV_TRY(ov_sized_check(context, "ovoid_fit_result", result));
    status = reach(fitter, &wanted, &made, &done);
    if (status == OVOID_OK || status == OVOID_ERROR_CANCELLED)
        *model = made;
    if (made)
        ov_sized_give(result, &done, sizeof done);
cleanup:
    ov_progress_end(context);
    return status;
}

/* ---- starts ---------------------------------------------------------------------------------- */

static ovoid_status check_start(const ovoid_fitter *fitter, const ovoid_model *model) {
    ovoid_context *const context = fitter->context;
    const ovoid_fit_options *const made = &fitter->surface;
    if (ovoid_model_size(model) > fitter->atoms)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a start has at most as many ellipsoids as there are atoms, %zu; this model "
                       "has %zu",
                       fitter->atoms, ovoid_model_size(model));
    if (ovoid_model_decay(model) != made->decay || ovoid_model_isovalue(model) != made->isovalue)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a start stands for the same surface, decay %.9g and isovalue %.9g; this "
                       "model has %.9g and %.9g",
                       made->decay, made->isovalue, ovoid_model_decay(model),
                       ovoid_model_isovalue(model));
    return OVOID_OK;
}

/* Gives each atom to the ellipsoid with the largest value at its centre. */
static ovoid_status find_owners(const ovoid_fitter *fitter, ov_found *found) {
    ovoid_status status = OVOID_OK;
    uint32_t near[2 * OV_NEAR_MAX];
    ov_grid grid = {0};
    OV_TRY(ov_grid_of(fitter->context, found->quadrics->centre, sizeof *found->quadrics,
                      found->count, ov_tuned.owner_reach, &grid));
    for (size_t i = 0; i < fitter->atoms; ++i) {
        const double *const at = fitter->xyzr + 4 * i;
        const size_t near_count = ov_grid_near(&grid, at, UINT32_MAX, near);
        double largest = -INFINITY;
        if (near_count == 0)
            found->owner[i] = ov_owner_at(found->quadrics, found->count, at);
        for (size_t n = 0; n < near_count; ++n) {
            const double value = ov_quadric_log_value(&found->quadrics[near[n]], at);
            if (n == 0 || value > largest) {
                largest = value;
                found->owner[i] = near[n];
            }
        }
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

static ovoid_status found_create(ovoid_context *context, size_t count, size_t atoms,
                                 ov_found *found) {
    *found = (ov_found){.count = count};
    found->quadrics = ov_alloc(context, count, sizeof *found->quadrics, "ellipsoids");
    found->owner = ov_alloc(context, atoms, sizeof *found->owner, "owners");
    return found->quadrics && found->owner ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static ovoid_status take_model(const ovoid_fitter *fitter, const ovoid_model *model,
                               ov_found *found) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_model_place(fitter->context, model));
    OV_TRY(found_create(fitter->context, ovoid_model_size(model), fitter->atoms, found));
    for (size_t i = 0; i < found->count; ++i)
        ov_quadric_of_ellipsoid(&ovoid_model_ellipsoids(model)[i], &found->quadrics[i]);
    if (ovoid_model_owner_count(model) == fitter->atoms)
        memcpy(found->owner, ovoid_model_owner(model), fitter->atoms * sizeof *found->owner);
    else
        OV_TRY(find_owners(fitter, found));
cleanup:
    return status;
}

/* The start is `found` from now on, which is taken over. */
static void take_start(ovoid_fitter *fitter, ov_found *found) {
    ov_found_destroy(&fitter->last);
    ov_found_destroy(&fitter->start);
    fitter->start = *found;
    *found = (ov_found){0};
}

ovoid_status ovoid_fitter_start_from(ovoid_context *context, ovoid_fitter *fitter,
                                     const ovoid_model *model) {
    ovoid_status status = OVOID_OK;
    ov_found found = {0};
    OV_NEED(context, context);
    OV_NEED(context, fitter);
    OV_TRY(ov_tenant_check(context, &fitter->tenant, "fitter"));
    if (model) {
        OV_TRY(check_start(fitter, model));
        OV_TRY(need_all(fitter));
        OV_TRY(take_model(fitter, model, &found));
    }
    take_start(fitter, &found);
cleanup:
    ov_found_destroy(&found);
    return status;
}

/* ---- other coordinates ----------------------------------------------------------------------- */

/* The last model, if it is that of a unit, becomes that of all of them. */
static ovoid_status repeat_last(ovoid_fitter *fitter) {
    const ov_symmetry *const symmetry = &fitter->symmetry;
    ov_found *const last = &fitter->last;
    ov_found made = {0};
    ovoid_status status = OVOID_OK;
    if (!fitter->last_by_unit || last->count == 0)
        return OVOID_OK;
    OV_TRY(found_create(fitter->context, symmetry->order * last->count, fitter->atoms, &made));
    for (size_t n = 0; n < made.count; ++n)
        if (n < last->count)
            made.quadrics[n] = last->quadrics[n];
        else
            ov_quadric_move(&last->quadrics[n % last->count], &symmetry->motion[n / last->count],
                            &made.quadrics[n]);
    spread_owners(symmetry, last, made.owner);
    made.tolerance = last->tolerance;
    made.fewest = symmetry->order * last->fewest;
    ov_found_destroy(last);
    *last = made;
    fitter->last_by_unit = false;
    made = (ov_found){0};
cleanup:
    ov_found_destroy(&made);
    return status;
}

/* The last model where the atoms are now; *found is empty where there is none. */
static ovoid_status move_model(const ovoid_fitter *fitter, const double *after, ov_found *found) {
    ovoid_status status = OVOID_OK;
    const ov_found *const from = fitter->last.count > 0 ? &fitter->last : &fitter->start;
    if (from->count == 0)
        return OVOID_OK;
    OV_TRY(found_create(fitter->context, from->count, fitter->atoms, found));
    memcpy(found->quadrics, from->quadrics, from->count * sizeof *from->quadrics);
    memcpy(found->owner, from->owner, fitter->atoms * sizeof *from->owner);
    OV_TRY(ov_move_with_atoms(fitter->context, fitter->xyzr, after, fitter->atoms, found->owner,
                              found->quadrics, found->count));
    found->tolerance = from->tolerance;
    found->fewest = from->fewest;
    found->moved = true;
cleanup:
    return status;
}

static ovoid_status check_coordinates(const ovoid_fitter *fitter, const double *xyz) {
    for (size_t n = 0; n < 3 * fitter->atoms; ++n)
        if (!(fabs(xyz[n]) <= OV_COORDINATE_LIMIT))
            return ov_fail(
                fitter->context, OVOID_ERROR_ARGUMENT,
                "ovoid_fitter_move: %c of atom %zu (from 0) is %g: not within %g angstrom",
                "xyz"[n % 3], n / 3, xyz[n], OV_COORDINATE_LIMIT);
    return OVOID_OK;
}

ovoid_status ovoid_fitter_move(ovoid_context *context, ovoid_fitter *fitter, const double *xyz) {
    ovoid_status status = OVOID_OK;
    ov_found found = {0};
    double *after = NULL;
    OV_NEED(context, context);
    OV_NEED(context, fitter);
    OV_NEED(context, xyz);
    OV_TRY(ov_tenant_check(context, &fitter->tenant, "fitter"));
    OV_TRY(check_coordinates(fitter, xyz));
    OV_TRY(need_all(fitter));
    after = ov_alloc(context, 4 * fitter->atoms, sizeof *after, "atoms");
    if (!after)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < fitter->atoms; ++i) {
        memcpy(after + 4 * i, xyz + 3 * i, 3 * sizeof *xyz);
        after[4 * i + 3] = fitter->xyzr[4 * i + 3];
    }
    OV_TRY(repeat_last(fitter));
    OV_TRY(move_model(fitter, after, &found));
    memcpy(fitter->xyzr, after, 4 * fitter->atoms * sizeof *after);
    ov_symmetry_destroy(&fitter->symmetry); /* the atoms may go anywhere */
    take_start(fitter, &found);
    if (fitter->adaptive)
        ov_adaptive_forget(fitter->adaptive);
    ov_l1_band_destroy(&fitter->band);
cleanup:
    ov_found_destroy(&found);
    free(after);
    return status;
}
