#include "fit/fitter.h"

ovoid_status ovoid_fit(ovoid_context *context, const ovoid_molecule *molecule,
                       const ovoid_fit_options *options, ovoid_model **model,
                       ovoid_fit_result *result) {
    ovoid_fitter *fitter = NULL;
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    OV_NEED(context, options);
    OV_NEED(context, model);
    ovoid_status status = ov_fitter_create(context, molecule, options, true, &fitter);
    if (status == OVOID_OK)
        status = ovoid_fitter_reach(context, fitter, options, model, result);
    ovoid_fitter_destroy(&fitter);
    return status;
}
