/*
 * How well a model stands for a molecule: areas, volumes and distances.
 */
#ifndef OVOID_MEASURE_H
#define OVOID_MEASURE_H

#include "ovoid/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ovoid_pair { /* 24 bytes */
    double original;        /* of the molecule */
    double sparse;          /* of the model */
    double error;           /* |sparse - original| / original */
} ovoid_pair;

/* Surfaces of more atoms, or ellipsoids, than this are measured cell by cell, in cells of so many.
 */
#define OVOID_DEFAULT_MEASURE_ATOMS 65536
#define OVOID_DEFAULT_CELL_ATOMS 32768

typedef struct ovoid_measure_options {
    size_t size;
    double isovalue; /* of both surfaces; 0: that of the original's field */
    double spacing;  /* of both meshes, angstrom */
    ovoid_vertex_rule vertices;
    bool distances;      /* also compute distances */
    uint32_t cell_atoms; /* of a cell at most, so that memory follows a cell; 0: as above */
} ovoid_measure_options;

typedef struct ovoid_measures {
    size_t size;
    ovoid_pair area; /* of the whole surfaces, angstrom^2: smooth with exact vertices, flat with */
    ovoid_pair volume;     /* linear ones; volume in angstrom^3 */
    ovoid_pair area_outer; /* of the outer components alone */
    ovoid_pair volume_outer;
    uint64_t components_original, components_sparse; /* connected pieces */
    uint64_t outer_original, outer_sparse;           /* of these, outer ones */
    ovoid_distances distances;
    ovoid_distances distances_outer;
    double deviation; /* largest distance of a vertex of either outer surface from the other whole
                         surface, angstrom: unlike the Hausdorff distance of the outer surfaces it
                         does not jump when the neck of a tunnel opens or closes, and unlike that of
                         the whole ones not with a small cavity. What a tolerance is about.
                         Exposed cavities (ovoid_component) count as outer. */
    double seconds_mesh, seconds_distances;
    /* No point of a triangle of either outer surface's mesh is farther than this from the other
     * whole mesh, angstrom; NAN where that is not known: without distances, and cell by cell. */
    double deviation_bound;
} ovoid_measures;

/* isovalue 0, spacing OVOID_DEFAULT_MESH_SPACING, exact vertices, with distances; size is sizeof
 * *options. */
OVOID_API void ovoid_measure_options_init(ovoid_measure_options *options, size_t size);

/* Nothing known; size is sizeof *measures. */
OVOID_API void ovoid_measures_init(ovoid_measures *measures, size_t size);

/* Meshes both surfaces on the same lattice and compares them; measures was made by
 * ovoid_measures_init(). Large ones are meshed cell by cell, with the same numbers to rounding;
 * where both repeat a unit by the same motions, as a symmetric assembly and a model with its
 * placements do, that unit is, among its images, and what is said is of all of it: on another
 * lattice in each unit. */
OVOID_API ovoid_status ovoid_measure(ovoid_context *context, ovoid_field *original,
                                     ovoid_field *sparse, const ovoid_measure_options *options,
                                     ovoid_measures *measures);

#ifdef __cplusplus
}
#endif

#endif
