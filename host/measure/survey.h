/*
 * Two surfaces compared cell by cell, so that memory follows a cell and not the surfaces. In each
 * cell both are meshed with what lies about it, and what lies in it is put on record: how far they
 * are from each other, areas and volumes, and by the vertices at its faces how its pieces hang
 * together with those of other cells. Whether a piece belongs to an outer surface is known at the
 * end, when all cells have been joined.
 */
#ifndef OV_SURVEY_H
#define OV_SURVEY_H

#include "base/rigid.h"
#include "measure/judge.h"

/* The surfaces: the original's and the model's. */
enum { OV_SURVEY_SIDES = 2 };

/* A part of a surface that hangs together within a cell. */
typedef struct ov_survey_piece {
    double area, volume; /* smooth; the volume between it and the origin of all coordinates, or the
                            centre of an assembly */
    double furthest;     /* of its vertices from the other surface, angstrom */
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
    ov_spot *spot;     /* vertices that are far from the other surface */
    uint32_t *spot_on; /* the piece of each */
    size_t pieces, seams, ports, spots;
    size_t seam_capacity, port_capacity, spot_capacity, spot_on_capacity;
} ov_survey_side;

/* What is on record of a cell. {0} is empty. */
typedef struct ov_survey_cell {
    ov_survey_side side[OV_SURVEY_SIDES];
} ov_survey_cell;

void ov_survey_cell_destroy(ov_survey_cell *cell);

/* What a survey looks at. */
typedef struct ov_survey_options {
    double isovalue, spacing; /* of both meshes, angstrom */
    double least;             /* angstrom: what is as far as this is a spot; INFINITY: nothing is */
    /* Where what is surveyed is the unit of a symmetric assembly: of which image of the unit each
     * term of the original is, 0 of itself, and where the axes meet. A place of either surface
     * belongs to the image of the original's largest term there, and what belongs to others than
     * the unit itself is left to their own survey. NULL: all is surveyed. */
    const uint32_t *image;
    const double *centre;
} ov_survey_options;

/* Surveys the cell [low, high), which has no end where they are infinite: what lies there of the
 * surfaces of these terms, among which are all that are felt in it or near what is there. */
ovoid_status ov_survey(ovoid_context *context, const ov_survey_options *options,
                       const ov_quadric *original, size_t original_count, const ov_quadric *model,
                       size_t model_count, const double low[3], const double high[3],
                       ov_survey_cell *cell);

typedef struct ov_survey_total {
    double area[OV_SURVEY_SIDES], volume[OV_SURVEY_SIDES];
    double area_outer[OV_SURVEY_SIDES], volume_outer[OV_SURVEY_SIDES];
    uint64_t components[OV_SURVEY_SIDES], outer[OV_SURVEY_SIDES];
    double hausdorff; /* of the whole surfaces, angstrom */
    double deviation; /* as in ovoid_measures, angstrom; both exact where there are no spots, or
                         some */
    ov_spot *spot;    /* of outer surfaces, the worst of each neighbourhood, the worst first */
    size_t spots;
} ov_survey_total;

/* Where a survey is of the unit of a symmetric assembly: the images that its cells speak of, first
 * the unit itself, and the spacing of its meshes. */
typedef struct ov_survey_images {
    const ov_rigid *image;
    size_t count; /* 1: there is the unit alone */
    double spacing;
} ov_survey_images;

/* Joins all cells: of a unit, too, what hangs together with images of it. Contents are then those
 * of the unit, and so are pieces: of what the images repeat one is counted. Spots are no nearer to
 * each other than `apart`. */
ovoid_status ov_survey_join(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                            const ov_survey_images *images, double apart, ov_survey_total *total);
void ov_survey_total_destroy(ov_survey_total *total);

#endif
