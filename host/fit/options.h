#ifndef OV_OPTIONS_H
#define OV_OPTIONS_H

#include "base/base.h"

/* OVOID_ERROR_ARGUMENT, naming the option, when one is out of its range. */
ovoid_status ov_fit_options_check(ovoid_context *context, const ovoid_fit_options *options);
/* The same, of those alone that define the surface. */
ovoid_status ov_surface_options_check(ovoid_context *context, const ovoid_fit_options *options);

#endif
