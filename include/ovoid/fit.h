/*
 * Fitting a model to the surface of a molecule.
 */
#ifndef OVOID_FIT_H
#define OVOID_FIT_H

#include "ovoid/model.h"
#include "ovoid/molecule.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of the constrained points, angstrom. */
#define OVOID_DEFAULT_SPACING_ADAPTIVE                                                             \
    0.7                               /* less for molecules of less than 640 atoms, and times      \
                                         sqrt(0.5 / decay) for decays above 0.5 */
#define OVOID_DEFAULT_SPACING_L1 1.25 /* bench/l1_settings.py says why */

typedef enum ovoid_method {
    OVOID_METHOD_ADAPTIVE = 0, /* merges the atoms' Gaussians, then fits what is left to the
                                  surface: fewer ellipsoids, nearer to it, in a fraction of the
                                  time */
    OVOID_METHOD_L1            /* the paper's Algorithm 1 */
} ovoid_method;

/* What each atom's Gaussian may become. */
typedef enum ovoid_kernel {
    OVOID_KERNEL_ELLIPSOID = 0, /* the paper's model: all ten parameters move, E_l1 is eq. 3.3 */
    OVOID_KERNEL_SPHERE /* the "sparse RBF" model that Table 1 compares with: spheres of decay d
                           at the atoms, only amplitudes move, E_l1 is sum_i |c_i| */
} ovoid_kernel;

/* The step that the line search tries first (open in the paper, which asks for an inexact search
 * along the negative gradient). */
typedef enum ovoid_first_step {
    OVOID_FIRST_STEP_SECANT = 0, /* Barzilai and Borwein's, where the last two gradients are of E_s
                                    alone; else as GROW */
    OVOID_FIRST_STEP_GROW        /* grow times the last accepted step */
} ovoid_first_step;

/* Constants of the paper's Algorithm 1. Those marked "open" are not given in the paper. */
typedef struct ovoid_l1_options { /* 80 bytes */
    ovoid_kernel kernel;          /* ELLIPSOID */
    uint32_t iterations;          /* MaxNiter: 8000 (section 4.1, ADP) */
    uint32_t sparse_iterations;   /* SparseNiter: 6000 (section 4.1, ADP) */
    uint32_t inside_every;        /* beyond the paper: of the lattice points with phi > c + 1, those
                                     whose three indices are multiples of this hold the inside, where
                                     phi~ is not to fall below c + 1: their residual is
                                     min(phi~ - (c + 1), 0). 0: none, the paper's text taken
                                     literally */
    double epsilon;               /* lower bound of w_s in step 5.4 (open) */
    double max_error;             /* gate of step 5.5: 0.5 */
    double prune_below;           /* tol of step 5.1: |c~| under it is deleted: 1e-3 */
    uint32_t prune_every;         /* iterations between deletions: 20 */
    ovoid_first_step first_step;  /* of the line search (open): SECANT */
    double armijo;                /* sufficient decrease of the line search (open): 1e-4 */
    double shrink;                /* factor of a rejected step (open): 0.5 */
    double grow;                  /* of the last accepted step, for the next first one (open): 2 */
    uint32_t max_backtracks;      /* trial steps of one search before giving up (open): 30 */
} ovoid_l1_options;

/* What the adaptive method is to reach. */
typedef enum ovoid_goal {
    OVOID_GOAL_TOLERANCE = 0, /* the outer surfaces are nowhere further apart than `tolerance`, with
                                 as few ellipsoids as it finds */
    OVOID_GOAL_ELLIPSOIDS,    /* `ellipsoids` of them */
    OVOID_GOAL_RATIO          /* `ratio` ellipsoids per atom, at least one */
} ovoid_goal;

/* Half an angstrom: what an atom of a well-ordered crystal moves by itself (B = 20 angstrom^2 is a
 * root mean square displacement of 0.5 angstrom along each axis). */
#define OVOID_DEFAULT_TOLERANCE 0.5

typedef struct ovoid_adaptive_options { /* 48 bytes */
    ovoid_goal goal;                    /* TOLERANCE */
    double tolerance;                   /* angstrom: OVOID_DEFAULT_TOLERANCE */
    uint32_t ellipsoids;                /* for OVOID_GOAL_ELLIPSOIDS; more than atoms is an error */
    double ratio;                       /* for OVOID_GOAL_RATIO, at most 1 */
    uint32_t effort;     /* 1 (the default) to 10: how many starts and repairs are tried; 0: of so
                            many ellipsoids the largest distances are not brought down as well, and
                            a search to a tolerance ends as soon as it gains little */
    uint32_t steps;      /* Levenberg-Marquardt steps of one refinement at most: 60; 0 leaves the
                            merged Gaussians as they are */
    double mesh_spacing; /* of the meshes that surfaces are judged on, angstrom: 0.5. What is
                            within the tolerance is so by meshes of half of this as well, but no
                            finer than 0.25 (times sqrt(0.5 / decay)) */
} ovoid_adaptive_options;

/* A molecule of more atoms than this is fitted in parts of at most so many, one after the other or
 * side by side: memory follows what is under way, not the molecule. */
#define OVOID_DEFAULT_WHOLE_ATOMS 65536
#define OVOID_DEFAULT_PART_ATOMS 16384

/* A fit in parts that several processes share, such as the ranks of an MPI job: each of them makes
 * the same call, each fits some of the parts, and all come to the same model. The library knows no
 * MPI; the caller brings what passes bytes around.
 *
 * All ranks give the same molecule and the same options but for `jobs`, on equal devices, and run
 * the same version of the library on machines of one byte order: what differs is found at the
 * beginning, and refused on all of them (OVOID_ERROR_ARGUMENT) with what it is; only unequal
 * devices are no more than a warning on rank 0, for they may come to other last bits. What one rank
 * meets, an error or a progress callback that stops, ends the fit on all of them with its status
 * and its text, which names the rank, when next they exchange: every few milliseconds while their
 * workers are at parts. What is not fitted in parts each rank fits by itself, to the same model. */
typedef struct ovoid_exchange { /* 24 bytes */
    uint32_t rank, ranks;       /* of this process, from 0, and how many there are */
    /* Gives all ranks the bytes of all. `mine` has sizes[rank] of them, and `all` gets those of
     * rank 0, then of rank 1 and so on: sizes[0] + sizes[1] + ... bytes, which is what there is
     * room for. `sizes`, one for each rank, are the same on all of them, and a size may be 0. All
     * arrays are the library's, and are theirs until it returns. Every rank calls it equally often
     * and in the same order, on the thread that called the library; it returns when the bytes are
     * there, however long the other ranks take. It is called some hundred times a second, mostly
     * with 8 bytes of each rank, and waits best without taking a core from the workers. Not 0: they
     * cannot be exchanged any more; the fit then ends on this rank with OVOID_ERROR_IO, without
     * another call. */
    int (*gather)(const void *mine, void *all, const uint64_t *sizes, void *user);
    void *user;
} ovoid_exchange;

/* Assemblies (molecule.h) that motions carry into themselves, such as capsids: one unit of them is
 * fitted among its images, and the model is that of the unit and its placements, the motions: see
 * ovoid_model_placements(). */
typedef enum ovoid_symmetry {
    OVOID_SYMMETRY_USE = 0, /* where there is one, and the number of ellipsoids that is asked for,
                               if one is, can be shared out equally */
    OVOID_SYMMETRY_IGNORE   /* the assembly is fitted as any molecule */
} ovoid_symmetry;

/* How method adaptive cuts a molecule into parts. A part is fitted among its neighbours, those that
 * were fitted before as their ellipsoids and the others as their atoms, so that the goal holds
 * across seams; no ellipsoid stands for atoms of two parts, but where seams were mended. The model
 * depends on the parts, never on how many of them are fitted side by side. What begins with a
 * model, such as the next frame of a trajectory, is fitted as a whole.
 *
 * Parts are fitted on all devices that the context was opened with, each part on one that is free:
 * the model is that of one of them alone, if name, driver and kernels' shape are the same of all.
 * Where they are not, parts are dealt out to the devices in turn, so that the model depends on the
 * list and not on who was faster. A device that fails, or has no memory for a part, is warned of
 * and left out from then on, by this context, too: others take its parts. When the last one fails,
 * the fit does, and the checkpoint has what was done. */
typedef struct ovoid_parts_options { /* 32 bytes */
    uint32_t atoms;  /* of a part at most, from OVOID_LEAST_PART_ATOMS; 0: OVOID_DEFAULT_PART_ATOMS
                        in a molecule of more than OVOID_DEFAULT_WHOLE_ATOMS, else all of them */
    uint32_t jobs;   /* parts side by side on each device, each with a thread and a queue of its
                        own, at most OVOID_MOST_JOBS; 0: as many as pay, one for each two of
                        the host's cores up to OVOID_DEFAULT_JOBS, while memory is plenty */
    uint32_t resume; /* not 0: goes on where the checkpoint ends, if there is one */
    uint32_t symmetry;      /* an ovoid_symmetry: USE. A fit that begins with a model uses none */
    const char *checkpoint; /* a file that gets each part as it is done, or NULL. It may not be
                               there unless the fit resumes, and stays whatever comes of that. Of
                               several ranks, rank 0 alone reads and writes it */
    const ovoid_exchange *exchange; /* with the other processes that share the fit, the caller's;
                                       NULL: there are none */
} ovoid_parts_options;

#define OVOID_LEAST_PART_ATOMS 64
#define OVOID_MOST_JOBS 64
#define OVOID_DEFAULT_JOBS 4

typedef struct ovoid_fit_options {
    size_t size;
    ovoid_method method;
    double decay;    /* d, angstrom^-2 */
    double isovalue; /* c */
    double spacing;  /* of the lattice of constrained points, angstrom (open); 0: the method's own,
                        OVOID_DEFAULT_SPACING_... */
    double padding;  /* of the box about the atom centres, angstrom (open); adaptive takes what the
                        field needs, if that is more */
    ovoid_adaptive_options adaptive;
    ovoid_l1_options l1;
    ovoid_parts_options parts; /* of method adaptive */
} ovoid_fit_options;

/* Whether the goal of method adaptive was reached, and if not, why. */
typedef enum ovoid_verdict {
    OVOID_VERDICT_REACHED = 0,
    OVOID_VERDICT_MISSED, /* measured, and further apart than asked; or not so many ellipsoids */
    OVOID_VERDICT_NO_SURFACE, /* there is none to be near to: the molecule's field is nowhere above
                                 the isovalue at the lattice points. The model follows the field
                                 then */
    OVOID_VERDICT_NO_MODEL_SURFACE, /* the model has none */
    OVOID_VERDICT_COARSE, /* mesh_spacing is above both the tolerance and 2 / sqrt(2 decay), or
                            parts of the surface are too small for it: nothing that was measured
                            would tell */
    OVOID_VERDICT_NO_GOAL /* method l1 has none */
} ovoid_verdict;

/* What method l1 tells of a fit, beyond what both do. The seconds are measured on the host between
 * waits for the device, so they include launches. */
typedef struct ovoid_l1_result { /* 72 bytes */
    double rms_error;            /* sqrt(E_s / points) */
    double max_error;            /* max_k |phi~ - phi| over the constrained points */
    double lists_seconds;        /* building the pack lists */
    double field_seconds;        /* phi~ and the residual, including every trial step */
    double moments_seconds;      /* sums for the gradient */
    double host_seconds;         /* parameter updates and the chain rule */
    uint64_t list_builds;
    uint64_t field_passes;
    uint64_t moments_passes;
} ovoid_l1_result;

/* What method adaptive tells of a fit, beyond what both do. It waits for the device too seldom for
 * times of its parts: ovoid_context_profile() tells those of kernels. */
typedef struct ovoid_adaptive_result { /* 8 bytes */
    uint64_t solver_iterations;        /* of conjugate gradients */
} ovoid_adaptive_result;

typedef struct ovoid_fit_result {
    size_t size;
    ovoid_method method;
    double spacing;  /* of the constrained points, angstrom: what was asked for or the default */
    uint64_t points; /* constrained points */
    uint64_t ellipsoids;
    uint64_t iterations; /* done */
    bool reached; /* the goal, as measured: verdict is OVOID_VERDICT_REACHED, or there is none */
    ovoid_verdict verdict;
    double distance; /* largest between the outer surfaces, measured, angstrom: right to 1e-7 of the
                        molecule's half extent; NAN where it was not measured (l1, no surface, too
                        coarse a mesh, or so many ellipsoids in parts with effort 0:
                        ovoid_measure() tells) */
    double sample_seconds;
    double fit_seconds;
    ovoid_l1_result l1;             /* of method l1, else NAN and OVOID_UNKNOWN */
    ovoid_adaptive_result adaptive; /* of method adaptive, else OVOID_UNKNOWN */
    uint64_t counts[OVOID_COUNTS];  /* by ovoid_count: what the fit made of them, of l1 without
                                       sampling */
    uint64_t parts;                 /* that the molecule was cut into: 1 as a whole */
    uint64_t units; /* of a symmetric assembly, of which one was fitted, in so many parts: the
                       placements of the model. 1: all atoms were fitted */
} ovoid_fit_result;

/* Nothing known; size is sizeof *result. */
OVOID_API void ovoid_fit_result_init(ovoid_fit_result *result, size_t size);

/* Fills in the defaults; size is sizeof *options. */
OVOID_API void ovoid_fit_options_init(ovoid_fit_options *options, size_t size);

/* Fits a model to a molecule's surface on the opened device (opening the default one if none is).
 * The same input, options, device and driver give the same bits. result may be NULL, else it was
 * made by ovoid_fit_result_init(). A fit that the progress callback stops (OVOID_ERROR_CANCELLED)
 * hands over the best model that held by then, or sets *model to NULL, as ovoid_fitter_reach()
 * does. For more than one fit of a molecule make an ovoid_fitter (fitter.h). */
OVOID_API ovoid_status ovoid_fit(ovoid_context *context, const ovoid_molecule *molecule,
                                 const ovoid_fit_options *options, ovoid_model **model,
                                 ovoid_fit_result *result);

/* ---- where the time of a fit in parts went --------------------------------------------------- */

/* What a part takes, one after the other. */
typedef enum ovoid_task_kind {
    OVOID_TASK_FIT = 0, /* a part is fitted */
    OVOID_TASK_JUDGE,   /* its cell is judged: how far the surfaces are apart there */
    OVOID_TASK_MEND     /* a patch is fitted about spots where they are too far apart */
} ovoid_task_kind;

/* One task that was done. Those of one stage wait for each other at most as `after` says; a stage
 * begins when the one before is done. */
typedef struct ovoid_task { /* 56 bytes on 64-bit machines */
    ovoid_task_kind kind;
    uint32_t stage;        /* from 0, in the order of time */
    uint32_t number;       /* of the part or patch, from 0; of parts in the order of the model */
    uint32_t rank;         /* that did it, 0 where one process fits */
    uint32_t worker;       /* of this rank, from 0 */
    uint32_t atoms;        /* of the part; 0 of a patch */
    double began;          /* seconds since parts were begun with, by the clock of the rank */
    double seconds;        /* that it took */
    uint64_t after_count;  /* tasks of the stage that had to be done before this one began: */
    const uint32_t *after; /* their numbers */
} ovoid_task;

/* What a rank did meanwhile. seconds * workers is busy + waiting + what is done between stages,
 * which all ranks do alike. */
typedef struct ovoid_rank_time { /* 40 bytes */
    uint32_t rank;
    uint32_t workers; /* at most */
    double seconds;   /* from the first stage to the end of the last one */
    double busy;      /* of all its workers, with tasks, s */
    double waiting;   /* of all its workers, for tasks that they could begin, s */
    uint64_t tasks;
} ovoid_rank_time;

/* The tasks of the context's last fit in parts, as far as it came, in the order in which they were
 * done, and the times of all ranks, as rank 0 and the others know them. NULL and 0 where there was
 * none. They belong to the context, until its next fit. */
OVOID_API const ovoid_task *ovoid_context_tasks(const ovoid_context *context, size_t *count);
OVOID_API const ovoid_rank_time *ovoid_context_rank_times(const ovoid_context *context,
                                                          size_t *count);

#ifdef __cplusplus
}
#endif

#endif
