/*
 * A molecule cut into parts that are fitted one by one, or side by side: each is some of its atoms,
 * and what lies about them. Where the molecule is the unit of a symmetric assembly, images of all
 * of it lie about it, too.
 */
#ifndef OV_PARTITION_H
#define OV_PARTITION_H

#include "base/base.h"
#include "base/box.h"

typedef struct ov_part {
    size_t first, count; /* of its atoms, in ov_partition.order */
    ov_box box;          /* of their centres */
    ov_box cell;     /* the cells of all parts share out space: infinite where there is no other */
    uint32_t colour; /* parts of one colour are not near each other */
} ov_part;

typedef struct ov_partition {
    uint32_t *order; /* the atoms, part by part */
    ov_part *part;
    size_t count;
    uint32_t colours;
    double near;           /* angstrom: parts whose boxes are this near are near each other */
    const ov_rigid *image; /* where the molecule is there: first where it is, by the identity */
    size_t images;         /* 1: there alone */
} ov_partition;

/* Halves the atoms (x, y, z, radius each) along the longest axis of their box until no part has
 * more than `most`. Neighbouring parts in space follow one another. near, image (the caller's, to
 * outlive it) and images of *partition are given. */
ovoid_status ov_partition_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                 size_t most, ov_partition *partition);
void ov_partition_destroy(ov_partition *partition);

/* Gives each part the first colour that no part before it has that is near. */
ovoid_status ov_partition_colour(ovoid_context *context, ov_partition *partition);

/* Whether an image of q is near p. */
bool ov_part_image_near(const ov_partition *partition, size_t p, size_t q, size_t image);

/* Whether any is, or one of p near q. */
bool ov_parts_near(const ov_partition *partition, size_t p, size_t q);

#endif
