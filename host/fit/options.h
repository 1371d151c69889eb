#ifndef OV_OPTIONS_H
#define OV_OPTIONS_H

#include "base/base.h"

/* OVOID_ERROR_ARGUMENT, naming the option, when one is out of its range. */
ovoid_status ov_fit_options_check(ovoid_context *context, const ovoid_fit_options *options);
/* The same, of those alone that define the surface. */
ovoid_status ov_surface_options_check(ovoid_context *context, const ovoid_fit_options *options);

/* Whether the exchange of a fit's options makes sense. */
ovoid_status ov_exchange_check(ovoid_context *context, const ovoid_exchange *exchange);

/* Stands for all that a model depends on in them; not for where files are, nor how many parts are
 * under way at once, nor how many atoms a part has. */
uint64_t ov_fit_options_hash(const ovoid_fit_options *options);

#endif
