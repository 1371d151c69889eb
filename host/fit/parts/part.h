/*
 * The fit of one part of a molecule among its neighbours. What it comes to depends on these alone,
 * never on what is under way elsewhere.
 */
#ifndef OV_FIT_PART_H
#define OV_FIT_PART_H

#include "fit/adaptive/adaptive.h"
#include "fit/parts/ranks.h"
#include "measure/partition.h"
#include "measure/survey.h"

/* What a part came to. found.owner: of its atoms in the partition's order. */
typedef struct ov_part_fit {
    ov_found found;
    ovoid_fit_result result;
} ov_part_fit;

typedef struct ov_parts {
    const double *xyzr;
    size_t atoms;
    const ovoid_fit_options *options;
    const double *centre; /* angstrom: that the images of all lie about; NULL: there are none */
    ov_ranks *ranks;      /* that share it */
    double margin; /* angstrom: this far from the box of its centres a part's surface is judged, */
    double reach;  /* and what is this far from it counts there */
    ov_partition partition;
    ov_part_fit *fit;   /* of each part */
    size_t jobs;        /* so many parts at a time on each device */
    size_t *ellipsoids; /* of each, where their number is what is asked for; else NULL */
    ov_found model;     /* of all of them, when they are done, */
    double least;       /* which is mended where it is off by that much, angstrom */
} ov_parts;

/* Atom n of part p. */
static inline const double *ov_part_atom(const ov_parts *parts, size_t p, size_t n) {
    const ov_partition *const cut = &parts->partition;
    return parts->xyzr + 4 * (size_t)cut->order[cut->part[p].first + n];
}

/* Fits part p from its atoms: neighbours of earlier colours are fixed as their ellipsoids, which
 * they have got by then, the others, and images of its own, as their atoms. `done` parts are, for
 * whom the caller is told. On errors and when it is stopped *fit stays as it is. */
ovoid_status ov_part_fit_atoms(ovoid_context *context, const ov_parts *parts, size_t p, size_t done,
                               ov_part_fit *fit);

/* What is asked of an ov_adaptive that is to fit `ellipsoids` of them, where it is their number
 * that is asked for. */
ovoid_fit_options ov_part_options(const ov_parts *parts, size_t ellipsoids);

/* Adds the steps and counts of one fit to those of all. */
void ov_part_count_work(const ovoid_fit_result *one, ovoid_fit_result *all);

/* Surveys its cell, when all parts are done. */
ovoid_status ov_part_survey(ovoid_context *context, const ov_parts *parts, size_t p,
                            ov_survey_cell *cell);

/* The part's own atoms as they are: exact, and many. */
ovoid_status ov_part_take_atoms(ovoid_context *context, const ov_parts *parts, size_t p,
                                ov_part_fit *fit);

#endif
