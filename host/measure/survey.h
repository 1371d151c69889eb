/*
 * Two surfaces compared cell by cell, so that memory follows a cell and not the surfaces. In each
 * cell both are meshed with what lies about it, and what lies in it is put on record: how far they
 * are from each other, areas and volumes, and by the vertices at its faces how its pieces hang
 * together with those of other cells. Whether a piece belongs to an outer surface is known at the
 * end, when all cells have been joined.
 */
#ifndef OV_SURVEY_H
#define OV_SURVEY_H

#include "measure/judge.h"

/* The surfaces: the original's and the model's. */
enum { OV_SURVEY_SIDES = 2 };

/* A part of a surface that hangs together within a cell. */
typedef struct ov_survey_piece {
    double area, volume; /* smooth; the volume between it and the origin of all coordinates */
    double furthest;     /* of its vertices from the other surface, angstrom */
} ov_survey_piece;

/* A vertex at a face, by a hash of where it is, and its piece. */
typedef struct ov_survey_seam {
    uint64_t key;
    uint32_t piece;
} ov_survey_seam;

typedef struct ov_survey_side {
    ov_survey_piece *piece;
    ov_survey_seam *seam;
    ov_spot *spot;     /* vertices that are far from the other surface */
    uint32_t *spot_on; /* the piece of each */
    size_t pieces, seams, spots;
    size_t seam_capacity, spot_capacity, spot_on_capacity;
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

/* Joins all cells. Spots are no nearer to each other than `apart`. */
ovoid_status ov_survey_join(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                            double apart, ov_survey_total *total);
void ov_survey_total_destroy(ov_survey_total *total);

#endif
