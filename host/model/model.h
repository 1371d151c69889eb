/*
 * A model: the ellipsoids, the surface they stand for, and the notes that travel with them.
 */
#ifndef OV_MODEL_H
#define OV_MODEL_H

#include "base/base.h"

/* Values of one ellipsoid, in the order of ovoid_ellipsoid and of a model file's columns. */
enum { OV_ELLIPSOID_VALUES = 10 };

struct ovoid_model {
    ovoid_ellipsoid *ellipsoids;
    size_t count;
    double decay; /* angstrom^-2 */
    double isovalue;
    uint32_t *owner; /* of each atom: the ellipsoid that it is part of; NULL: not known */
    size_t owner_count;
    char **notes; /* "key: value" */
    size_t note_count;
    size_t note_capacity;
};

/* Column name of a value: "amplitude", "decay1", ... "gamma". */
const char *ov_ellipsoid_value_name(size_t value);

/* What is wrong with `number` as this value of an ellipsoid, as the end of a sentence ("must be
 * positive"), or NULL if nothing is. */
const char *ov_ellipsoid_value_problem(size_t value, double number);

/* Whether a note may have this key: it is neither empty nor one that the model file writes by
 * itself, does not begin with '#' or a blank, and holds no colon and no control character. */
bool ov_model_key_valid(const char *key);

/* Takes over *owner, one entry per atom, which becomes NULL. */
void ov_model_take_owner(ovoid_model *model, uint32_t **owner, size_t atoms);

/* Ellipsoids, surface and notes; owners stay behind. */
ovoid_status ov_model_copy(ovoid_context *context, const ovoid_model *model, ovoid_model **copy);

/* Adds the finished note text "key: value" (copied, `length` bytes). */
ovoid_status ov_model_add_note(ovoid_context *context, ovoid_model *model, const char *text,
                               size_t length);

#endif
