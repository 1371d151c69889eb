/*
 * Measures cell by cell: what ov_measure_meshes() says of two whole meshes, in the memory of those
 * cells that are looked at side by side, a fixed amount for surfaces that are kept for a second
 * look, and some bytes for each atom.
 */
#ifndef OV_CELLS_H
#define OV_CELLS_H

#include "measure/partition.h"
#include "mesh/mesh_of.h"

/* One field's terms by where they are. */
typedef struct ov_shelf {
    const ovoid_field *field;
    ov_partition cut;
    ov_box *reach; /* of each part: where any of its terms counts */
    double least;  /* what counts */
} ov_shelf;

/* In parts of at most `most` terms. */
ovoid_status ov_shelf_create(ovoid_context *context, const ovoid_field *field, size_t most,
                             double least, ov_shelf *shelf);
void ov_shelf_destroy(ov_shelf *shelf);

/* The terms that count anywhere in a box, ascending; *bodies is grown. */
ovoid_status ov_shelf_take(ovoid_context *context, const ov_shelf *shelf, const ov_box *box,
                           ov_body **bodies, size_t *count, size_t *capacity);

typedef struct ov_cells_options {
    size_t most;      /* terms of a cell, of the field that has more of them */
    bool distances;   /* else those stay unknown */
    size_t hands;     /* threads that look at cells side by side; 0: some (hands.h) */
    size_t fars_most; /* points that are kept for a look into other cells, in tests; 0: some */
    size_t kept_most; /* bytes of cells' surfaces that are kept, in tests; 0: some */
} ov_cells_options;

/* Compares the surfaces. o: of both meshes, whole. seconds_mesh and seconds_distances are filled
 * in. OVOID_ERROR_EMPTY when a field has no surface: *empty says which. */
ovoid_status ov_measure_cells(ovoid_context *context, const ovoid_field *original,
                              const ovoid_field *sparse, const ovoid_mesh_options *o,
                              const ov_cells_options *how, const ovoid_field **empty,
                              ovoid_measures *measures);

#endif
