/*
 * What lies about a part, or about a cell: the atoms there, and the model there.
 */
#ifndef OV_FIT_SCENE_H
#define OV_FIT_SCENE_H

#include "fit/parts/part.h"

typedef struct ov_scene {
    double *xyzr;      /* atoms, of a part its own first */
    uint32_t *image;   /* of which image of the molecule each of them is; 0: of itself */
    ov_quadric *model; /* ellipsoids, and the Gaussians of atoms of parts that are not done; none of
                          the part's own */
    size_t atoms, atoms_capacity, image_capacity, model_count, model_capacity;
} ov_scene;

/* Part p among its neighbours, of which those of earlier colours are in the model as their
 * ellipsoids, the others as their atoms. */
ovoid_status ov_scene_of_part(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene);

/* Of an ellipsoid that is fitted anew: the image in which it is, and one more; 0: it stays. */
typedef uint32_t ov_chosen;

/* What is about a box when all parts are done, without the ellipsoids of the model that are chosen,
 * in any image, and their atoms in the image in which they are. NULL: with all. */
ovoid_status ov_scene_about(ovoid_context *context, const ov_parts *parts, const ov_box *box,
                            const ov_chosen *chosen, ov_scene *scene);

/* Whether an image of any part is about a box. */
bool ov_scene_meets(const ov_parts *parts, const ov_box *box, size_t image);

/* Where an image has a unit's atom, x, y, z, radius, and an ellipsoid. */
void ov_scene_place_atom(const ov_parts *parts, const double atom[4], size_t image,
                         double placed[4]);
void ov_scene_place_term(const ov_parts *parts, const ov_quadric *quadric, size_t image,
                         ov_quadric *placed);

/* The cell of part p, in which all parts are done. */
ovoid_status ov_scene_of_cell(ovoid_context *context, const ov_parts *parts, size_t p,
                              ov_scene *scene);

ovoid_status ov_scene_add_atom(ovoid_context *context, const double atom[4], size_t image,
                               ov_scene *scene);

/* The surroundings of a fit of the scene's first `own` atoms, whose centres are in the box; `done`
 * of all parts are, for whom the caller is told. */
ov_surroundings ov_scene_surround(const ov_parts *parts, const ov_scene *scene, size_t own,
                                  const ov_box *box, size_t done);

void ov_scene_destroy(ov_scene *scene);

#endif
