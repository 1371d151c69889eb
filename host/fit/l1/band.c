#include "fit/l1/l1.h"

#include "base/progress.h"

#include <stdlib.h>

struct ov_l1_band {
    uint32_t inside_every;
    ov_samples samples;
};

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
static ovoid_status sample(ovoid_context *context, const double *xyzr, size_t atoms,
                           const ovoid_fit_options *options, ov_samples *samples) {
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

ovoid_status ov_l1_band_prepare(ovoid_context *context, const double *xyzr, size_t atoms,
                                const ovoid_fit_options *options, ov_l1_band **band) {
    ovoid_status status = OVOID_OK;
    ov_l1_band *made = NULL;
    if (*band && (*band)->inside_every == options->l1.inside_every)
        return OVOID_OK;
    made = ov_alloc(context, 1, sizeof *made, "a band");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->inside_every = options->l1.inside_every;
    OV_TRY(sample(context, xyzr, atoms, options, &made->samples));
    ov_l1_band_destroy(band);
    *band = made;
    made = NULL;
cleanup:
    ov_l1_band_destroy(&made);
    return status;
}

const ov_samples *ov_l1_band_samples(const ov_l1_band *band) {
    return &band->samples;
}

void ov_l1_band_destroy(ov_l1_band **band) {
    if (!*band)
        return;
    ov_samples_destroy(&(*band)->samples);
    free(*band);
    *band = NULL;
}
