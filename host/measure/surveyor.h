/*
 * The inside of a survey: both surfaces in the cell at hand, and how far they are from each other.
 */
#ifndef OV_SURVEYOR_H
#define OV_SURVEYOR_H

#include "measure/survey.h"
#include "neighbours/neighbours.h"

#define OV_NO_PIECE UINT32_MAX

#define OV_SURVEY_NEAREST 3

/* Where a triangle is. What lies beyond cell and halo may be an artefact of where the terms end. */
enum { OV_ZONE_BEYOND, OV_ZONE_HALO, OV_ZONE_CELL }; /* from the outside to the inside */

/* What is known of a part of a surface. */
enum { OV_STANDS_INNER, OV_STANDS_OUTER, OV_STANDS_UNKNOWN };

/* One of the surfaces in the cell at hand. */
typedef struct ov_sheet {
    ovoid_mesh *mesh;   /* NULL: there is none */
    uint8_t *zone;      /* of its triangles */
    float *distance;    /* of its vertices from the other one */
    uint32_t *piece_of; /* of its vertices; OV_NO_PIECE: of no triangle in the cell */
    size_t pieces;
    ov_trail trail;
    ov_facets facets;
    uint32_t *group_of; /* of its vertices: what hangs together in cell and halo */
    uint8_t *stands;    /* of each group */
    size_t groups;
    double reach; /* angstrom: so far about the cell all is known of outer surfaces */
} ov_sheet;

typedef struct ov_surveyor {
    ovoid_context *context;
    const ov_survey_options *options;
    const double *low, *high;
    double origin[3];
    const ov_body *original;
    size_t original_count;
    /* The original's terms, where images have to be told apart: the largest is looked for in one
     * grid, the nearest in one after the other. */
    ov_grid largest, nearest[OV_SURVEY_NEAREST];
    ov_watch watch; /* leaves questions to the context, where the cells are counted */
    ov_marcher *marcher;
    ov_meter meter;
    ov_facets facets; /* of the triangles that count */
    ov_sheet sheet[OV_SURVEY_SIDES];
    float *squared[OV_SURVEY_SIDES]; /* distances of what is measured from in the cell to all of the
                                        other surface, where sums are wanted; NULL: not known yet */
} ov_surveyor;

/* A hash of where a vertex is, the same in each cell. */
uint64_t ov_survey_key(const ov_surveyor *surveyor, const double at[3]);

/* Adds a key to a list of them. */
ovoid_status ov_survey_add_key(ovoid_context *context, uint64_t key, uint32_t piece,
                               ov_survey_seam **list, size_t *count, size_t *capacity);

/* Puts on record a few of the vertices in the cell which others have in their halo. */
ovoid_status ov_spans_mark(ov_surveyor *surveyor, size_t side, ov_survey_side *record);

/* Puts the distances on record that both surfaces have from the other one. */
ovoid_status ov_spans_whole(ov_surveyor *surveyor, ov_survey_cell *cell);

/* The same from their outer components to the other's, as they are known to stand, or, where
 * standing is NULL, are supposed to. */
ovoid_status ov_spans_outer(ov_surveyor *surveyor, const ov_survey_standing *standing,
                            ov_survey_cell *cell);

/* Makes the distances of these points smaller where something in the cell is nearer to them. */
ovoid_status ov_spans_seek(ov_surveyor *surveyor, const ov_survey_standing *standing,
                           ov_survey_far *far, size_t count);

/* Finds which vertices hang together by triangles in this zone or further in, and returns how many
 * such sets there are: of[v] is the number of v's; OV_NO_PIECE: v is of no such triangle. */
size_t ov_sheet_unite(const ov_sheet *at, int least, uint32_t *of);

#endif
