/*
 * The part of a mesh that counts, along a space-filling curve, so that what follows one another
 * there is near one another in space: for trees over triangles and walks over points.
 */
#ifndef OV_TRAIL_H
#define OV_TRAIL_H

#include "mesh/mesh.h"

typedef struct ov_trail {
    const ovoid_mesh *mesh; /* borrowed */
    size_t triangles, vertices;
    uint32_t *triangle; /* indices in the mesh; NULL: all of them, as they are there */
    uint32_t *vertex;   /* those of the triangles; NULL: all of them, as they are in the mesh */
} ov_trail;

/* The triangles that count are all or, with outer_only, those of outer components. A mesh that
 * follows a curve itself costs nothing here. */
ovoid_status ov_trail_create(ovoid_context *context, const ovoid_mesh *mesh, bool outer_only,
                             ov_trail *trail);
/* The triangles for which chosen holds, and their vertices, of a mesh that follows a curve. */
ovoid_status ov_trail_choose(ovoid_context *context, const ovoid_mesh *mesh, const bool *chosen,
                             ov_trail *trail);
void ov_trail_destroy(ov_trail *trail);

static inline uint32_t ov_trail_triangle(const ov_trail *trail, size_t k) {
    return trail->triangle ? trail->triangle[k] : (uint32_t)k;
}

static inline uint32_t ov_trail_vertex(const ov_trail *trail, size_t k) {
    return trail->vertex ? trail->vertex[k] : (uint32_t)k;
}

#endif
