/*
 * Measures cell by cell: what ov_measure_meshes() says of two whole meshes, in the memory of those
 * cells that are looked at side by side, a fixed amount for surfaces that are kept for a second
 * look, and some bytes for each atom.
 */
#ifndef OV_CELLS_H
#define OV_CELLS_H

#include "base/box.h"
#include "measure/partition.h"
#include "measure/survey.h"
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

/* Terms that were taken off a shelf, and of which image of the field each is. {0} is empty. */
typedef struct ov_taken {
    ov_body *body;
    uint32_t *image;
    size_t count, body_capacity, image_capacity;
} ov_taken;

void ov_taken_destroy(ov_taken *taken);

/* The terms that count anywhere in a box, of each image ascending; what was taken before is
 * forgotten. */
ovoid_status ov_shelf_take(ovoid_context *context, const ov_shelf *shelf,
                           const ov_survey_images *images, const ov_box *box, ov_taken *taken);

typedef struct ov_cells_options {
    size_t most;      /* terms of a cell, of the field that has more of them */
    bool distances;   /* else those stay unknown */
    size_t hands;     /* threads that look at cells side by side; 0: some (hands.h) */
    size_t fars_most; /* points that are kept for a look into other cells, in tests; 0: some */
    size_t kept_most; /* bytes of cells' surfaces that are kept, in tests; 0: some */
    const ov_repeat *repeat; /* the fields are those of the unit that this repeats, and what is
                                measured is all of it; NULL: they are all there is */
    bool *scattered;         /* gets whether this cannot be: nothing was measured */
} ov_cells_options;

/* Compares the surfaces. o: of both meshes, whole. seconds_mesh and seconds_distances are filled
 * in. OVOID_ERROR_EMPTY when a field has no surface: *empty says which. */
ovoid_status ov_measure_cells(ovoid_context *context, const ovoid_field *original,
                              const ovoid_field *sparse, const ovoid_mesh_options *o,
                              const ov_cells_options *how, const ovoid_field **empty,
                              ovoid_measures *measures);

/* Where a unit ends among its images: a place belongs to the image of which the largest term of an
 * atom is there or, far from all, the nearest atom. */
typedef struct ov_unit_ends {
    ov_box box;     /* of all places of the two surfaces that belong to the unit */
    double nearest; /* angstrom: none of them is as far from all atoms as this, */
    bool scattered; /* unless some are further from them than is looked at: not told apart then */
} ov_unit_ends;

/* original: of the unit's atoms; back: from each image to it. */
ovoid_status ov_unit_find_ends(ovoid_context *context, const ovoid_field *original,
                               const ovoid_field *sparse, double isovalue, const ov_rigid *back,
                               size_t images, ov_unit_ends *ends);

#endif
