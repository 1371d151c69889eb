/*
 * Judging a model by its surface: meshes of both, distances, and where they are largest.
 */
#ifndef OV_JUDGE_H
#define OV_JUDGE_H

#include "base/box.h"
#include "field/quadric.h"
#include "measure/distance.h"
#include "mesh/march.h"
#include "neighbours/neighbours.h"

/* A place where an outer surface is far from the other surface. */
typedef struct ov_spot {
    double at[3];
    double distance;
} ov_spot;

/* Whether a point is within `reach` of one of the spots. */
bool ov_spots_near(const ov_spot *spots, size_t count, const double at[3], double reach);

/* Keeps the worst of each neighbourhood, the worst first: none nearer to another than `apart`,
 * `most` of them. */
ovoid_status ov_spots_thin(ovoid_context *context, ov_spot *spots, size_t *count, double apart,
                           size_t most);

typedef struct ov_spot_list {
    ov_spot *spot; /* owned */
    size_t count, capacity;
} ov_spot_list;

/* What a judge knows of the model whose spots it was asked for last. */
typedef struct ov_seen {
    bool known;
    double least, slack; /* which spots */
    bool closely, whole;
    ov_quadric *quadric; /* the model: owned, `count` of them */
    size_t count, capacity;
    ov_spot_list spots; /* all of them */
    double *hidden;     /* owned: 3 * hidden_count, the vertices that are of no outer surface */
    size_t hidden_count, hidden_capacity;
    ov_box box; /* of the mesh when all of it was judged */
} ov_seen;

/* What a judge knows of the original where no more than a region counts. */
typedef struct ov_region {
    ov_trail own, about; /* what is in the region; and about it, as far as `room` */
    double room;         /* angstrom; 0: nothing is known yet */
    double *outside;     /* owned: 3 * outside_count, vertices about it but not in it, */
    bool *hidden;        /* owned: and which of them are of no outer surface */
    size_t outside_count;
    ov_grid grid; /* of them */
} ov_region;

/* The original's surface, meshed once: a light mesh without normals, whose triangles stay on the
 * device. mesh is NULL where the field never reaches the isovalue. */
typedef struct ov_judge {
    ovoid_context *context;
    ovoid_mesh_options meshing;
    double origin[3]; /* of the meshes' offsets, angstrom */
    ovoid_mesh *mesh;
    ov_trail trail; /* of the mesh */
    ov_content content;
    double root_2d; /* sqrt(2 decay), angstrom^-1 */
    ov_watch watch; /* asked during whatever takes long */
    ov_marcher *marcher;
    ov_meter meter, back; /* of distances from the original, and to it */
    ov_facets facets;     /* of the original, */
    const ov_trail *laid; /* as far as it is there; NULL: it is not */
    ov_facets other;      /* of the model at hand, or of a part of it */
    ov_seen seen;
    ov_region known;
    ov_marcher *near_marcher; /* of what is near changes */
    double slack;             /* set by the owner, see ov_judge_spots() */
    bool closely;             /* set by the owner: less is left out where spots are looked for */
    bool whole;               /* set by the owner: walls of cavities count as outer surfaces do */
    bool in_region;       /* set by the owner: only the surfaces within this box count, and not */
    ov_box region;        /* their areas: beyond it they may be cut off, */
    double stray;         /* unless they are farther off than that, angstrom */
    ov_spot *excused;     /* owned; within `excused_reach` of these it does not count either, */
    size_t excused_count; /* unless it is more than `excused_times` as far off as they are */
    double excused_reach; /* angstrom */
    double excused_times;
    const ov_spot *wanted; /* the owner's; so near to these it does in any case, in cavities too */
    size_t wanted_count;
} ov_judge;

typedef struct ov_judgement {
    bool valid;          /* there are two surfaces to compare */
    double hausdorff;    /* of the whole surfaces, angstrom */
    double deviation;    /* as in ovoid_measures, angstrom */
    double area_error;   /* relative */
    double volume_ratio; /* the model's volume over the original's */
    double score;        /* what repairs make smaller: mostly the deviation, angstrom */
} ov_judgement;

ovoid_status ov_judge_create(ovoid_context *context, const double *xyzr, size_t atoms, double decay,
                             double isovalue, double spacing, ov_watch watch, ov_judge *judge);
/* To be called before a search: what the judge launches then does not go with the one before. */
void ov_judge_begin(ov_judge *judge);
void ov_judge_destroy(ov_judge *judge);

/* Distances are those of the meshes' vertices, which lie on the surfaces. */
ovoid_status ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                            ov_judgement *judgement);

/* The *spot_count places where the deviation is at least `least`, largest first, none nearer to
 * another than `apart`, at most `most`. *spots is to be freed. Of the judgement hausdorff and
 * deviation are filled in, exact where they are not much below `least`, else only bounds. Of
 * vertices alone, unless the judge's slack (angstrom) is above 0: then points inside triangles are
 * looked for, too, and where none is found no point of the outer meshes is farther than `least` and
 * the slack, unless the meshes are too coarse to tell that of so small a distance. Where little of
 * the model has changed since it was asked about last, spots are looked for near that alone, and
 * all of it is judged only where there are none. */
ovoid_status ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count, double least,
                            double apart, size_t most, ov_judgement *judgement, ov_spot **spots,
                            size_t *spot_count);

/* The same, but where there are none near what has changed, that is all that is known: *whole tells
 * whether all of the model was judged. */
ovoid_status ov_judge_spots_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                 double least, double apart, size_t most, ov_judgement *judgement,
                                 ov_spot **spots, size_t *spot_count, bool *whole);

/* The model's volume over the original's; 1 where there is nothing to compare. */
ovoid_status ov_judge_volume(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                             double *ratio);

/* By what to multiply all amplitudes so that a volume ratio becomes 1, about: the surface moves by
 * c / |grad phi~| per unit of ln a. */
double ov_judge_amplitude_factor(const ov_judge *judge, double volume_ratio);

#endif
