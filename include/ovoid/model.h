/*
 * Models: ellipsoids, the surface they stand for, and their files.
 */
#ifndef OVOID_MODEL_H
#define OVOID_MODEL_H

#include "ovoid/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One ellipsoid in the paper's convention: amplitude * exp(-(x - centre)^T A (x - centre)) with
 * A = R^T diag(decay) R and R = R_z(angle[2]) R_y(angle[1]) R_x(angle[0]), the paper's signs (eqs.
 * 2.11 to 2.14; its R_y is the transpose of the usual one). An array of them is one of ten
 * contiguous doubles each. */
typedef struct ovoid_ellipsoid { /* 80 bytes */
    double amplitude;            /* a > 0 */
    double decay[3];             /* angstrom^-2, > 0 */
    double centre[3];            /* angstrom */
    double angle[3];             /* alpha, beta, gamma, radian */
} ovoid_ellipsoid;

typedef struct ovoid_model ovoid_model;

/* Makes a model of `count` ellipsoids (copied) that stands for a surface with this decay rate and
 * isovalue. Values must be finite, amplitudes and decay rates positive. */
OVOID_API ovoid_status ovoid_model_create(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                          size_t count, double decay, double isovalue,
                                          ovoid_model **model);
OVOID_API void ovoid_model_destroy(ovoid_model **model);

/* How many ellipsoids there are; of a model with placements those of all its units. */
OVOID_API size_t ovoid_model_size(const ovoid_model *model);

/* 10 * size contiguous doubles, those of ovoid_ellipsoid for each; of a model with placements unit
 * after unit. Those are computed when first asked for: NULL where there is no memory for them. */
OVOID_API const ovoid_ellipsoid *ovoid_model_ellipsoids(const ovoid_model *model);
OVOID_API double ovoid_model_decay(const ovoid_model *model);
OVOID_API double ovoid_model_isovalue(const ovoid_model *model);

/* For each atom of the molecule that the model was fitted to, in the molecule's order, the index
 * (from 0) of the ellipsoid that it became part of. NULL where nobody knows: owners are kept by
 * ovoid_fit(), not by model files.
 * - adaptive: the ellipsoid into which the atom's Gaussian was merged. When an ellipsoid is split,
 *   each of its atoms goes to the half with the larger value at the atom's centre, and one at least
 *   to each half; a half of an ellipsoid of one atom may own none.
 * - l1: the ellipsoid that the atom's Gaussian became; where that one was deleted, the ellipsoid
 *   with the largest value at the atom's centre. Every ellipsoid owns at least one atom. */
OVOID_API const uint32_t *ovoid_model_owner(const ovoid_model *model);

/* Entries of ovoid_model_owner(): atoms of that molecule; 0 where nobody knows. */
OVOID_API size_t ovoid_model_owner_count(const ovoid_model *model);

/* Header lines of a model file, "key: value" each, without '#'. NULL past the end. They come from
 * the file read, or from ovoid_model_annotate(). */
OVOID_API const char *ovoid_model_note(const ovoid_model *model, size_t index);

/* Adds a header line; key and value hold no line breaks. */
OVOID_API ovoid_status ovoid_model_annotate(ovoid_context *context, ovoid_model *model,
                                            const char *key, const char *value);

/* ---- units ---------------------------------------------------------------------------------- */

/*
 * The model of a symmetric assembly may be that of one unit, and placements: it stands for the unit
 * in each of them. Whatever takes a model (fields, and with them meshes, measures and pictures;
 * exports; fitters) and ovoid_model_size(), ovoid_model_ellipsoids() and ovoid_model_owner() are
 * about all ellipsoids, those of every placement; a program that knows of no placements computes
 * what it should.
 */

/* x' = rotation x + translation. */
typedef struct ovoid_motion { /* 96 bytes */
    double rotation[9];       /* row by row */
    double translation[3];    /* angstrom */
} ovoid_motion;

enum { OVOID_MODEL_PLACEMENTS_MAX = 100000 };

/* As ovoid_model_create(), of the ellipsoids of a unit in each of these placements (copied), which
 * are numbered from 0 in this order: ellipsoid i of the unit is ellipsoid n * count + i of the
 * model in placement n. No placements, 0 of them: the unit as it stands, an ordinary model.
 * Rotations are orthogonal to within 0.03 and do not mirror; translations and centres are within
 * 1e100 angstrom. More than OVOID_MODEL_PLACEMENTS_MAX placements, or 2^32 - 1 ellipsoids in all,
 * are OVOID_ERROR_LIMIT. */
OVOID_API ovoid_status ovoid_model_create_placed(ovoid_context *context,
                                                 const ovoid_ellipsoid *ellipsoids, size_t count,
                                                 const ovoid_motion *placements,
                                                 size_t placement_count, double decay,
                                                 double isovalue, ovoid_model **model);

/* The placements of the unit, *count of them; NULL and 0 of a model without. */
OVOID_API const ovoid_motion *ovoid_model_placements(const ovoid_model *model, size_t *count);

/* The unit's ellipsoids, before they are placed; of a model without placements all there are. */
OVOID_API size_t ovoid_model_unit_size(const ovoid_model *model);
OVOID_API const ovoid_ellipsoid *ovoid_model_unit_ellipsoids(const ovoid_model *model);

/* Makes a model of all ellipsoids, those of ovoid_model_ellipsoids(), without placements; notes and
 * owners are copied. */
OVOID_API ovoid_status ovoid_model_expand(ovoid_context *context, const ovoid_model *model,
                                          ovoid_model **expanded);

/* ---- files ---------------------------------------------------------------------------------- */

/* Reads a model file (.ovoid). "-" is standard input. Bad lines are OVOID_ERROR_FORMAT with
 * "file:line:column: reason". */
OVOID_API ovoid_status ovoid_model_read(ovoid_context *context, const char *path,
                                        ovoid_model **model);

/* Writes a model file: '#' header lines, a column line, one ellipsoid per line with nine
 * significant digits. Of a model with placements the header holds these, and the lines are the
 * unit's; such a file has version 2, which versions of Ovoid that know of no placements refuse. "-"
 * is standard output. A file is written beside its final place and renamed, so that `path` never
 * holds half a model. */
OVOID_API ovoid_status ovoid_model_write(ovoid_context *context, const ovoid_model *model,
                                         const char *path);

#ifdef __cplusplus
}
#endif

#endif
