/*
 * What lies about a part, or about a cell: the atoms there, and the model there.
 */
#ifndef OV_FIT_SCENE_H
#define OV_FIT_SCENE_H

#include "fit/parts/part.h"

typedef struct ov_scene {
    double *xyzr;      /* atoms, of a part its own first */
    ov_quadric *model; /* ellipsoids, and the Gaussians of atoms of parts that are not done; none of
                          the part's own */
    size_t atoms, atoms_capacity, model_count, model_capacity;
} ov_scene;

/* Part p among its neighbours, of which those of earlier colours are in the model as their
 * ellipsoids, the others as their atoms. */
ovoid_status ov_scene_of_part(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene);

/* What is about a box when all parts are done, without the ellipsoids of the model for which chosen
 * holds, and their atoms. NULL: with all. */
ovoid_status ov_scene_about(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                            const bool *chosen, ov_scene *scene);

/* The cell of part p, in which all parts are done. */
ovoid_status ov_scene_of_cell(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene);

ovoid_status ov_scene_add_atom(ovoid_context *context, const double atom[4], ov_scene *scene);

/* The surroundings of a fit of the scene's first `own` atoms, whose centres are in the box; `done`
 * of all parts are, for whom the caller is told. */
ov_surroundings ov_scene_surround(const ov_parts *parts, const ov_scene *scene, size_t own,
                                  const ov_box *box, size_t done);

void ov_scene_destroy(ov_scene *scene);

#endif
