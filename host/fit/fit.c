#include "base/progress.h"
#include "base/sized.h"
#include "fit/adaptive/adaptive.h"
#include "fit/l1/l1.h"
#include "fit/options.h"
#include "model/model.h"

#include <math.h>
#include <stdlib.h>

typedef struct sampling_report {
    ovoid_context *context;
    uint64_t iterations;
    size_t atoms;
} sampling_report;

static bool report_sampling(uint64_t points, void *user) {
    const sampling_report *const report = user;
    const ovoid_progress progress = {.stage = "sample",
                                     .iterations = report->iterations,
                                     .ellipsoids = report->atoms,
                                     .points = points};
    return ov_progress_report(report->context, &progress);
}

/* Section 3.2.2 of the paper: |phi - c| <= 1; and what holds the inside, beyond the paper. */
static ovoid_status sample_band(ovoid_context *context, const ovoid_molecule *molecule,
                                const ovoid_fit_options *options, ov_samples *samples) {
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const ov_band band = {.low = options->isovalue - 1.0,
                          .high = options->isovalue + 1.0,
                          .inside_every = options->l1.inside_every};
    sampling_report report = {context, options->l1.iterations, atoms};
    const ov_sampling sampling = {.go_on = report_sampling, .user = &report};
    ov_lattice lattice;
    const double spacing = options->spacing > 0.0 ? options->spacing : OVOID_DEFAULT_SPACING_L1;
    const ovoid_status status =
        ov_lattice_create(context, xyzr, atoms, spacing, options->padding, &lattice);
    return status != OVOID_OK
               ? status
               : ov_sample(context, xyzr, atoms, options->decay, &lattice, band, sampling, samples);
}

static ovoid_status fit_l1(ovoid_context *context, const ovoid_molecule *molecule,
                           const ovoid_fit_options *options, double began,
                           ovoid_ellipsoid **ellipsoids, uint32_t **owner,
                           ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ov_samples samples = {0};
    OV_TRY(sample_band(context, molecule, options, &samples));
    result->sample_seconds = ov_seconds() - began;
    result->spacing = options->spacing > 0.0 ? options->spacing : OVOID_DEFAULT_SPACING_L1;
    result->reached = true;
    result->verdict = OVOID_VERDICT_NO_GOAL;
    OV_TRY(ov_l1_fit(context, ovoid_molecule_xyzr(molecule), ovoid_molecule_atoms(molecule),
                     &samples, options, ellipsoids, owner, result));
cleanup:
    ov_samples_destroy(&samples);
    return status;
}

ovoid_status ovoid_fit(ovoid_context *context, const ovoid_molecule *molecule,
                       const ovoid_fit_options *options, ovoid_model **model,
                       ovoid_fit_result *result) {
    ovoid_status status = OVOID_OK;
    ovoid_ellipsoid *ellipsoids = NULL;
    uint32_t *owner = NULL;
    ovoid_model *made = NULL;
    ovoid_fit_options o;
    ovoid_fit_result done;
    ov_device *device;
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, options);
    OV_NEED(context, model);
    ovoid_fit_options_init(&o, sizeof o);
    ovoid_fit_result_init(&done, sizeof done);
    const size_t atoms = ovoid_molecule_atoms(molecule);
    const double *const xyzr = ovoid_molecule_xyzr(molecule);
    const double began = ov_seconds();
    ov_progress_begin(context, "sample");
    context->now.ellipsoids = atoms;
    OV_TRY(OV_SIZED_TAKE(context, ovoid_fit_options, options, &o));
    OV_TRY(ov_sized_check(context, "ovoid_fit_result", result));
    OV_TRY(ov_fit_options_check(context, &o));
    ov_progress_fit(context, o.method);
    done.method = o.method;
    OV_TRY(ov_atoms_check(context, xyzr, atoms, o.decay));
    OV_TRY(ov_device_get(context, &device));
    if (o.method == OVOID_METHOD_L1)
        OV_TRY(fit_l1(context, molecule, &o, began, &ellipsoids, &owner, &done));
    else
        OV_TRY(ov_adaptive_fit(context, xyzr, atoms, &o, began, &ellipsoids, &owner, &done));
    OV_TRY(ovoid_model_create(context, ellipsoids, (size_t)done.ellipsoids, o.decay, o.isovalue,
                              &made));
    ov_model_take_owner(made, &owner, atoms);
    *model = made;
    done.fit_seconds = ov_seconds() - began - done.sample_seconds;
    ov_sized_give(result, &done, sizeof done);
cleanup:
    free(ellipsoids);
    free(owner);
    ov_progress_end(context);
    return status;
}
