/*
 * What the goals of the adaptive method have in common (see adaptive.h): a fit with its trials, and
 * the steps they are made of. Progress is reported on the way; OVOID_ERROR_CANCELLED when the
 * caller has had enough.
 */
#ifndef OV_ADAPTIVE_SEARCH_H
#define OV_ADAPTIVE_SEARCH_H

#include "fit/adaptive/adaptive.h"

#include "fit/adaptive/local.h"
#include "fit/adaptive/merge.h"
#include "fit/adaptive/refine.h"
#include "measure/judge.h"
#include "mixture/reduce.h"
#include "model/owner.h"

/* Ways to merge, and windows about the surface. */
enum { OV_STARTS = 6, OV_WINDOWS = 3 };

struct ov_adaptive {
    ovoid_context *context;
    const double *xyzr; /* of the atoms, and then of those around */
    size_t atoms;
    ov_surroundings around;           /* atoms 0: there is nothing */
    bool keep;                        /* the reductions */
    bool prepared;                    /* points, target and judge are there */
    const ovoid_fit_options *options; /* of this search */
    const ov_found *start;            /* NULL: the atoms */
    size_t fewest;                    /* ellipsoids that the tolerance takes; 0: not known */
    ov_samples samples;
    ov_target target;
    ov_reduction *reduction[OV_STARTS];
    ov_refiner refiner;
    ov_local local;
    ov_merger merger;
    ov_judge judge;
    ov_judge fine;    /* at a finer spacing; mesh is NULL until a model is to be confirmed */
    bool finely;      /* models are judged by that, too */
    double spacing;   /* of the points */
    double expected;  /* distance of a coarse model, in units of 1 / sqrt(2 d); 0: of none */
    double width_max; /* angstrom: no axis, 1 / sqrt(decay rate), becomes longer */
    const char *stage;
    uint64_t steps;         /* refinement steps so far */
    uint64_t solver_before; /* iterations of conjugate gradients before this search */
    size_t count;           /* ellipsoids being worked on */
    double misfit;
    size_t capacity;      /* ellipsoids that the arrays below hold */
    ov_quadric *quadrics; /* and what is fixed behind them */
    uint32_t *twin;       /* of halves, as of ov_split_worst() */
    uint32_t *parents;    /* of merges, as of ov_merging */
    /* The best that held so far in this search, NULL: none did. A trial that is changed in place
     * only as long as each of its states holds. */
    const struct ov_trial *held;
};

/* Whether it is of a part of a molecule, with something around it. */
static inline bool ov_adaptive_is_part(const ov_adaptive *f) {
    return f->around.atoms > 0 || f->around.images > 0 || f->around.fixed_count > 0;
}

/* Whether it is of the places of a start that are to be mended. */
static inline bool ov_adaptive_is_patch(const ov_adaptive *f) {
    return f->around.spot_count > 0;
}

/* What is tried where effort 0, which only leaves out sharpening and ends shrinking soon, tries as
 * much as 1. */
static inline uint32_t ov_adaptive_effort(const ov_adaptive *f) {
    return f->options->adaptive.effort > 1 ? f->options->adaptive.effort : 1;
}

/* A model with what is known of it. */
typedef struct ov_trial {
    double *x; /* room for capacity ellipsoids */
    size_t count;
    uint32_t *owner; /* of each atom: the ellipsoid that it is part of */
    size_t atoms;
    double misfit;
    ov_judgement judgement;
} ov_trial;

/* Of conjugate gradients, in all searches. */
uint64_t ov_adaptive_solver_iterations(const ov_adaptive *f);

/* Tells the caller where an ov_adaptive is; false: the caller has had enough. */
bool ov_adaptive_report(void *fit);

ovoid_status ov_trial_create(const ov_adaptive *f, ov_trial *t);
void ov_trial_destroy(ov_trial *t);
void ov_trial_copy(const ov_trial *from, ov_trial *to);
void ov_trial_swap(ov_trial *a, ov_trial *b);

/* Fills f->quadrics with the trial's ellipsoids. */
void ov_adaptive_quadrics(ov_adaptive *f, const ov_trial *t);

/* Puts behind the first `count` of f->quadrics what is fixed around them, and images of them, and
 * returns how many there are then: a model as surfaces see it. */
size_t ov_adaptive_surround(ov_adaptive *f, size_t count);

/* The volume of the first `count` of f->quadrics over the original's, both among the atoms around
 * them. What is fixed there has lost its place in f->quadrics. */
ovoid_status ov_adaptive_volume(ov_adaptive *f, size_t count, double *ratio);

/* At most `steps` of them, until two gain less than the share `decrease`. */
ovoid_status ov_adaptive_refine(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                double decrease);
ovoid_status ov_adaptive_refine_fully(ov_adaptive *f, ov_trial *t, const char *stage);
ovoid_status ov_adaptive_refine_quickly(ov_adaptive *f, ov_trial *t, const char *stage);
/* Refines the chosen ellipsoids alone, unless they are most of them; t->misfit stays as it is. */
ovoid_status ov_adaptive_refine_some(ov_adaptive *f, ov_trial *t, const char *stage, uint32_t steps,
                                     const bool *chosen);

/* After splits, and best once the halves have been refined: shares out the atoms of each ellipsoid
 * that was split between it and its f->twin. */
ovoid_status ov_adaptive_share_atoms(ov_adaptive *f, ov_trial *t);

/* Puts the ellipsoids in the order of a space-filling curve, so that those that are near each other
 * are so in memory, too; owners follow. What else goes by place, such as twins and parents, does
 * not. Merging leaves them in no order, and splits append. */
ovoid_status ov_adaptive_sort(ov_adaptive *f, ov_trial *t);

ovoid_status ov_adaptive_judge(ov_adaptive *f, ov_trial *t);
/* A judge like f->judge at another spacing, of meshes, angstrom. */
ovoid_status ov_adaptive_judge_at(ov_adaptive *f, double spacing, ov_judge *judge);

/* The merged atoms of start `kind` at this count. */
ovoid_status ov_adaptive_cut(ov_adaptive *f, size_t kind, size_t count, ov_trial *t);
/* How atoms merge at the first start. */
ov_reduction_options ov_adaptive_merging(void);
/* Goes back to the atoms of the chosen ellipsoids and merges these anew to `factor` times as many
 * ellipsoids, the atoms themselves at most and as many as there is room for, in place of the
 * chosen; all stays as it is where the chosen have no atoms. */
ovoid_status ov_adaptive_rebuild(ov_adaptive *f, ov_trial *t, double factor, const bool *chosen);
void ov_adaptive_drop_reductions(ov_adaptive *f);
/* Asks for phi under one window: the target as it was before any search. */
ovoid_status ov_adaptive_aim(ov_adaptive *f, size_t window);
/* Lets further refinement aim at the right volume, known from a model that was fitted to phi. */
ovoid_status ov_adaptive_aim_at_volume(ov_adaptive *f, const ov_trial *t);
/* The model that the search begins with, under the first window, and with the right volume. */
ovoid_status ov_adaptive_take_start(ov_adaptive *f, ov_trial *t);
/* Merges or splits and refines on the way, until there are so many; more are left where no two can
 * merge. */
ovoid_status ov_adaptive_recount(ov_adaptive *f, size_t count, ov_trial *t);
/* Refined from the first `kinds` starts, under one window, and with the right volume but for a
 * little. */
ovoid_status ov_adaptive_begin(ov_adaptive *f, size_t window, size_t kinds, size_t count,
                               ov_trial *best);

/* ---- goals ---------------------------------------------------------------------------------- */

/* The best model of so many ellipsoids. */
ovoid_status ov_adaptive_count(ov_adaptive *f, size_t count, ov_trial *best);
/* The fewest ellipsoids with a deviation of at most `tolerance` angstrom, or the best there is. */
ovoid_status ov_adaptive_tolerance(ov_adaptive *f, double tolerance, ov_trial *best);
/* The start, with more ellipsoids where it is off. */
ovoid_status ov_adaptive_mend(ov_adaptive *f, double tolerance, ov_trial *best);

#endif
