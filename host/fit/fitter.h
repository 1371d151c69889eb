/*
 * A fit session from within.
 */
#ifndef OV_FITTER_H
#define OV_FITTER_H

#include "base/base.h"

/* As ovoid_fitter_create(). once: for one fit, after which nothing is kept for the next. */
ovoid_status ov_fitter_create(ovoid_context *context, const ovoid_molecule *molecule,
                              const ovoid_fit_options *options, bool once, ovoid_fitter **fitter);

#endif
