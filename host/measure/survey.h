/*
 * Two surfaces compared cell by cell, so that memory follows a cell and not the surfaces. In each
 * cell both are meshed with what lies about it, and what lies in it is put on record: how far they
 * are from each other, areas and volumes, and by the vertices at its faces how its pieces hang
 * together with those of other cells. Whether a piece belongs to an outer surface is known at the
 * end, when all cells have been joined.
 *
 * With options->sums the distances are those of all of both surfaces, as ovoid_measures has them.
 * Three things are not known in a cell by itself: whether a surface that leaves it and what is
 * known about it is an outer one, which is supposed at first; whether the supposition was right
 * (ov_survey_holds(), else ov_survey_again()); and what the distance of a point is that has nothing
 * within reach. Such points are kept, and looked after in all other cells (ov_survey_seek()).
 */
#ifndef OV_SURVEY_H
#define OV_SURVEY_H

#include "base/rigid.h"
#include "measure/judge.h"
#include "mesh/pieces.h"

/* The surfaces: the original's and the model's. */
enum { OV_SURVEY_SIDES = 2 };

/* Distances from the points of a surface to another one, summed up over its area. */
typedef struct ov_survey_sums {
    double weight;       /* area, of flat triangles, angstrom^2 */
    double mean, square; /* weight times the distance, and times its square */
    double largest;      /* angstrom */
} ov_survey_sums;

/* A part of a surface that hangs together within a cell. */
typedef struct ov_survey_piece {
    double area, volume;         /* the volume between it and the vertex that follows */
    double at[3];                /* one of its vertices */
    double vector[3];            /* its vector area, angstrom^2 */
    double furthest;             /* of its vertices from the other surface, angstrom */
    ov_survey_sums whole, outer; /* to the other surface, and to its outer components alone */
    bool outer_supposed;         /* what was taken to be known of it, for `outer` */
} ov_survey_piece;

/* A vertex at a face, by a hash of where it is, and its piece. */
typedef struct ov_survey_seam {
    uint64_t key;
    uint32_t piece;
} ov_survey_seam;

/* A vertex where the unit of a symmetric assembly ends: an image of it goes on from there. */
typedef struct ov_survey_port {
    double at[3];
    float normal[3];
    uint32_t image, piece;
} ov_survey_port;

typedef struct ov_survey_side {
    ov_survey_piece *piece;
    ov_survey_seam *seam;
    ov_survey_port *port;
    ov_spot *spot;         /* vertices that are far from the other surface */
    uint32_t *spot_on;     /* the piece of each */
    ov_survey_seam *mark;  /* a few of the vertices that are in other cells' surroundings */
    ov_survey_seam *asked; /* such vertices of others, by surfaces (`piece`) that are not in the
                              cell, and were supposed to be outer ones */
    ov_survey_seam *neck;  /* by where two vertices are that are near to each other, and do not hang
                              together as far as is known here: what both belong to, where it is in
                              the cell */
    size_t pieces, seams, ports, spots, marks, askings, necks;
    size_t missed; /* terms whose pieces could not be meshed, here and about */
    size_t seam_capacity, port_capacity, spot_capacity, spot_on_capacity, mark_capacity,
        asked_capacity, neck_capacity;
} ov_survey_side;

/* A point whose distance is not known in its cell. */
typedef struct ov_survey_far {
    double at[3];    /* angstrom */
    double weight;   /* its share of the area, angstrom^2 */
    double distance; /* no more than this, angstrom */
    uint32_t cell, piece;
    uint8_t side;
    bool outer;  /* its distance from outer components alone */
    bool vertex; /* of the mesh, else the centre of a triangle */
} ov_survey_far;

/* What is on record of a cell. {0} is empty. */
typedef struct ov_survey_cell {
    ov_survey_side side[OV_SURVEY_SIDES];
    ov_survey_far *far;
    size_t fars, far_capacity;
    bool outer_later; /* nothing was supposed, and the distances of outer surfaces are still to come
                         (ov_survey_again()) */
} ov_survey_cell;

void ov_survey_cell_destroy(ov_survey_cell *cell);

/* What a survey looks at. */
typedef struct ov_survey_options {
    double isovalue, spacing; /* of both meshes, angstrom */
    double least;             /* angstrom: what is as far as this is a spot; INFINITY: nothing is */
    bool exact;               /* else distances far below `least` may be told as more */
    ovoid_vertex_rule vertices; /* linear: areas and volumes of flat triangles */
    bool flat;                  /* so, too: they only tell outer surfaces from cavities */
    double halo;     /* angstrom: so far about the cell the terms make the surfaces what they are,
                        and OV_SURVEY_ROOM steps more; 0: nothing is said of that */
    bool sums;       /* of distances, with a halo */
    bool contents;   /* nothing but areas, volumes and pieces */
    uint32_t cell;   /* its number, for what is far */
    double *meshing; /* gets the seconds that meshes take, too; NULL: nobody asks */
    /* Where what is surveyed is the unit of a symmetric assembly: of which image of the unit each
     * term of the original is, 0 of itself. A place of either surface
     * belongs to the image of the original's largest term there, and what belongs to others than
     * the unit itself is left to their own survey. NULL: all is surveyed. */
    const uint32_t *image;
    double nearest; /* angstrom: what is further from all these terms belongs to none; 0: a default
                     */
} ov_survey_options;

/* Beyond the halo, in steps of the lattice. */
#define OV_SURVEY_ROOM 4.0

/* The terms of the two fields about a cell. */
typedef struct ov_survey_terms {
    const ov_body *body[OV_SURVEY_SIDES];
    size_t count[OV_SURVEY_SIDES];
} ov_survey_terms;

/* Surveys the cell [low, high), which has no end where they are infinite: what lies there of the
 * surfaces of these terms, among which are all that are felt in it or near what is there. */
ovoid_status ov_survey(ovoid_context *context, const ov_survey_options *options,
                       const ov_quadric *original, size_t original_count, const ov_quadric *model,
                       size_t model_count, const double low[3], const double high[3],
                       ov_survey_cell *cell);

/* Both surfaces of a cell as a survey of sums found them, and how far they are from each other, for
 * a second look: on the host alone. */
typedef struct ov_survey_kept ov_survey_kept;
size_t ov_survey_kept_bytes(const ov_survey_kept *kept);
void ov_survey_kept_destroy(ov_survey_kept **kept);

/* kept: NULL, or where to leave what a second look needs, which the distances of outer surfaces are
 * left to then; NULL there where memory is short. */
ovoid_status ov_survey_bodies(ovoid_context *context, const ov_survey_options *options,
                              const ov_survey_terms *terms, const double low[3],
                              const double high[3], ov_survey_cell *cell, ov_survey_kept **kept);

/* ---- when all cells are known ---------------------------------------------------------------- */

/* Where a survey is of the unit of a symmetric assembly: the images that its cells speak of, first
 * the unit itself, and the spacing of its meshes. */
typedef struct ov_survey_images {
    const ov_rigid *image;
    size_t count; /* 1: there is the unit alone */
    double spacing;
    const double *centre; /* where the axes meet */
} ov_survey_images;

/* Which pieces belong to outer surfaces. {0} is empty. */
typedef struct ov_survey_standing {
    size_t *first[OV_SURVEY_SIDES];        /* piece of each cell among those of all */
    bool *outer[OV_SURVEY_SIDES];          /* of each piece of all cells */
    ov_survey_seam *mark[OV_SURVEY_SIDES]; /* of all cells, by key; piece: 1 for an outer one */
    size_t marks[OV_SURVEY_SIDES];
} ov_survey_standing;

ovoid_status ov_survey_stand(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                             const ov_survey_images *images, ov_survey_standing *standing);
void ov_survey_standing_destroy(ov_survey_standing *standing);

/* For the vertex with this key: 1 on an outer surface, -1 on the wall of a cavity, 0 not known. */
int ov_survey_stands(const ov_survey_standing *standing, size_t side, uint64_t key);

/* Whether all that cell c supposed of outer surfaces is so, and has led to their distances. */
bool ov_survey_holds(const ov_survey_standing *standing, const ov_survey_cell *cell, size_t c);

/* Surveys the distances of cell options->cell from outer surfaces again, now that they are known:
 * the same terms and the same cell as before. kept: what the cell's survey has left, whose
 * distances this needs for the last time, and terms are not looked at; NULL: the surfaces are made
 * anew. */
ovoid_status ov_survey_again(ovoid_context *context, const ov_survey_options *options,
                             const ov_survey_terms *terms, const double low[3],
                             const double high[3], const ov_survey_standing *standing,
                             ov_survey_kept *kept, ov_survey_cell *cell);

/* Looks for what is nearer to these points of other cells in cell options->cell. kept: as above. */
ovoid_status ov_survey_seek(ovoid_context *context, const ov_survey_options *options,
                            const ov_survey_terms *terms, const double low[3], const double high[3],
                            const ov_survey_standing *standing, const ov_survey_cell *cell,
                            ov_survey_kept *kept, ov_survey_far *far, size_t count);

/* The distance of a point that was far has become known. */
void ov_survey_settle(const ov_survey_far *far, ov_survey_cell *cell);

typedef struct ov_survey_total {
    double area[OV_SURVEY_SIDES], volume[OV_SURVEY_SIDES];
    double area_outer[OV_SURVEY_SIDES], volume_outer[OV_SURVEY_SIDES];
    uint64_t components[OV_SURVEY_SIDES], outer[OV_SURVEY_SIDES];
    ov_survey_sums sums[OV_SURVEY_SIDES];       /* from each whole surface to the other, */
    ov_survey_sums sums_outer[OV_SURVEY_SIDES]; /* and from outer surface to outer surface */
    double hausdorff;                           /* of the whole surfaces' vertices, angstrom */
    double deviation; /* as in ovoid_measures, angstrom; both exact where there are no spots, or
                         some */
    ov_spot *spot;    /* of exposed surfaces (mesh/exposed.h), the worst of each neighbourhood, the
                         worst first */
    size_t spots;
} ov_survey_total;

/* Joins all cells: of a unit, too, what hangs together with images of it. Contents are then those
 * of the unit, and pieces those of the whole that its images make. Spots are no nearer to
 * each other than `apart`. */
ovoid_status ov_survey_join(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                            const ov_survey_images *images, double apart, ov_survey_total *total);
void ov_survey_total_destroy(ov_survey_total *total);

#endif
