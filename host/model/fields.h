/*
 * The field object: the Gaussians of a molecule or of a model, on the host and, once it has been
 * evaluated, on the device.
 */
#ifndef OV_FIELDS_H
#define OV_FIELDS_H

#include "base/rigid.h"
#include "base/tenant.h"
#include "field/evaluate.h"
#include "model/model.h"

/* One unit, and the motions, first the identity, that make all of the field of it. */
typedef struct ov_repeat {
    ovoid_field *unit; /* owned; NULL: the field repeats nothing */
    ov_rigid *motion;  /* owned */
    size_t order;      /* motions */
    bool group;        /* they are known to carry the whole into itself */
} ov_repeat;

struct ovoid_field {
    ov_tenant tenant;
    ovoid_model *model; /* of a model's field: a copy, which has placements until all terms are
                           there; NULL of a molecule's */
    ovoid_molecule *molecule; /* of an assembly's field, until all terms are there */
    ov_quadric *quadrics;     /* all terms, once ov_field_place() has placed them */
    size_t count;
    size_t unit; /* terms of a unit, of a model with placements; of others all */
    ov_repeat repeat;
    double decay, isovalue;
    ov_evaluator evaluator; /* of the opened device, where `loaded` */
    bool loaded;
};

/* Refuses a field of another context, or of none. */
ovoid_status ov_field_check(ovoid_context *context, const ovoid_field *field);

/* Makes the array of all terms, unless it is there: of what repeats a unit they are made when they
 * are first needed, for a large assembly may be meant to be looked at by its unit alone. */
ovoid_status ov_field_place(ovoid_context *context, const ovoid_field *field);

/* The motions of the group that carries both fields into themselves, where both repeat a unit by
 * the same ones; else NULL. */
const ov_repeat *ov_fields_repeat(const ovoid_field *a, const ovoid_field *b);

/* What the field is of, for messages: "molecule" or "model". */
const char *ov_field_kind(const ovoid_field *field);

/* The evaluator, loaded on the opened device. */
ovoid_status ov_field_load(ovoid_context *context, ovoid_field *field, ov_evaluator **evaluator);

#endif
