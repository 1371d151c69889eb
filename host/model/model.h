/*
 * A model: the ellipsoids, or those of a unit and where it is placed, the surface they stand for,
 * and the notes that travel with them.
 */
#ifndef OV_MODEL_H
#define OV_MODEL_H

#include "base/base.h"

/* Values of one ellipsoid, in the order of ovoid_ellipsoid and of a model file's columns. */
enum { OV_ELLIPSOID_VALUES = 10 };

/* How far rotations of placements may be from orthogonal: files of assemblies may be off by 0.01,
 * and motions from one of their placements to another by twice that. */
#define OV_PLACEMENT_SKEW 0.03
/* Translations, and centres that are placed, so that all stay finite, angstrom. */
#define OV_PLACEMENT_REACH 1e100

/* Numbers of a placement, in the order of ovoid_motion and of a model file. */
enum { OV_PLACEMENT_VALUES = 12 };

struct ovoid_model {
    ovoid_ellipsoid *unit;
    size_t unit_count;
    ovoid_motion *placements; /* of the unit; NULL: it stands alone, where it is */
    size_t placement_count;
    _Atomic(ovoid_ellipsoid *) placed; /* all of them, where there are placements: made when asked
                                          for, by whichever thread comes first */
    double decay;                      /* angstrom^-2 */
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

/* What is wrong with a placement, or NULL if nothing is; an ellipsoid that is placed likewise. */
const char *ov_placement_problem(const ovoid_motion *placement);
const char *ov_placed_problem(const ovoid_ellipsoid *ellipsoid);

/* Whether so many placements of so many ellipsoids are too many. */
ovoid_status ov_placements_check(ovoid_context *context, size_t placements, size_t ellipsoids);

/* Makes what ovoid_model_ellipsoids() answers, unless it is there. */
ovoid_status ov_model_place(ovoid_context *context, const ovoid_model *model);

/* Whether a note may have this key: it is neither empty nor one that the model file writes by
 * itself, does not begin with '#' or a blank, and holds no colon and no control character. */
bool ov_model_key_valid(const char *key);

/* Takes over *owner, one entry per atom, which becomes NULL. */
void ov_model_take_owner(ovoid_model *model, uint32_t **owner, size_t atoms);

/* All ellipsoids, without placements, surface and notes; owners stay behind. */
ovoid_status ov_model_copy(ovoid_context *context, const ovoid_model *model, ovoid_model **copy);

/* The same with the placements, as a unit. */
ovoid_status ov_model_copy_placed(ovoid_context *context, const ovoid_model *model,
                                  ovoid_model **copy);

/* Adds the finished note text "key: value" (copied, `length` bytes). */
ovoid_status ov_model_add_note(ovoid_context *context, ovoid_model *model, const char *text,
                               size_t length);

#endif
