/*
 * The field object: the Gaussians of a molecule or of a model, on the host and, once it has been
 * evaluated, on the device.
 */
#ifndef OV_FIELDS_H
#define OV_FIELDS_H

#include "base/tenant.h"
#include "field/evaluate.h"
#include "model/model.h"

struct ovoid_field {
    ov_tenant tenant;
    ovoid_model *model; /* a copy without placements, of a model's field; NULL of a molecule's */
    ov_quadric *quadrics;
    size_t count;
    size_t unit; /* terms of a unit, of a model with placements; of others all */
    double decay, isovalue;
    ov_evaluator evaluator; /* of the opened device, where `loaded` */
    bool loaded;
};

/* Refuses a field of another context, or of none. */
ovoid_status ov_field_check(ovoid_context *context, const ovoid_field *field);

/* What the field is of, for messages: "molecule" or "model". */
const char *ov_field_kind(const ovoid_field *field);

/* The evaluator, loaded on the opened device. */
ovoid_status ov_field_load(ovoid_context *context, ovoid_field *field, ov_evaluator **evaluator);

#endif
