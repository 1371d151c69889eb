/*
 * A scene on its way into a file: a molecule, its models, what they look like as surfaces, how far
 * these are apart, and which atoms an ellipsoid stands for.
 */
#ifndef OV_SCENE_H
#define OV_SCENE_H

#include "base/base.h"

#include <stdio.h>

/* The caller's scene with nothing left open, and the fields of what is in it. */
typedef struct ov_scene {
    const ovoid_molecule *molecule;   /* NULL: none */
    const ovoid_model *const *models; /* not owned */
    size_t count;                     /* of models */
    const char *title;                /* not owned */
    double decay, isovalue;           /* of the molecule's field */
    ovoid_field *original;            /* owned; NULL: none, or not made yet */
    ovoid_field **fields;             /* of the models, owned; NULL: not made yet */
} ov_scene;

/* Checks the caller's scene and takes it over. */
ovoid_status ov_scene_take(ovoid_context *context, const ovoid_scene *given, ov_scene *scene);

/* Makes the fields. */
ovoid_status ov_scene_fields(ovoid_context *context, ov_scene *scene);

/* Destroys the fields. */
void ov_scene_drop(ov_scene *scene);

/* The surface of a field as a mesh with exact vertices. */
ovoid_status ov_scene_mesh(ovoid_context *context, ovoid_field *field, double isovalue,
                           double spacing, ovoid_mesh **mesh);

/* For each vertex of mesh `a` the distance to the nearest point of mesh `b`, angstrom: positive
 * where other, the field whose surface at `level` b is, is above the level there. To be freed. NULL
 * without memory, with the error recorded. */
ovoid_status ov_scene_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                                ovoid_field *other, double level, float **distance);

/* The ellipsoid of a model that each atom of the molecule counts for, to be freed. */
ovoid_status ov_scene_owner(ovoid_context *context, const ovoid_molecule *molecule,
                            const ovoid_model *model, uint32_t **owner);

/* The atoms of a molecule in the order of their owners, and where those of each begin: atoms
 * order[first[e]] .. order[first[e + 1] - 1] count for ellipsoid e. Both arrays in one allocation,
 * `first`, which is to be freed; it has count + 1 entries. */
ovoid_status ov_scene_sort(ovoid_context *context, const uint32_t *owner, size_t atoms,
                           size_t count, uint32_t **first, const uint32_t **order);

#endif
