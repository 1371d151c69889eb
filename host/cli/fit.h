/*
 * `ovoid fit`: the job of one molecule, and many of them; shared by the files that make it up.
 */
#ifndef CLI_FIT_H
#define CLI_FIT_H

#include "forecast.h"
#include "measures.h"

/* Records every iteration in a CSV file. A trace that cannot be written ends without ending the
 * fit: the model is worth more. */
typedef struct fit_trace {
    ovoid_context *context; /* its own: rows are written in the callbacks of another one */
    ovoid_file *file;       /* NULL: no trace is kept (any more) */
    bool failed;            /* and the failure has been reported */
    ovoid_method method;
    size_t level;       /* from 0, being fitted */
    uint64_t iteration; /* the last one recorded of this level, 0 before the first */
} fit_trace;

/* From 2^32 atoms, halving comes to one ellipsoid after that many levels. */
enum { FIT_LEVELS_MAX = 32 };

/* One of the models that a run makes: the goal's, then each with half the ellipsoids. */
typedef struct fit_level {
    char *path;   /* of the model, owned */
    char *owners; /* of the table of owners, owned; NULL: none */
    ovoid_model *model;
    ovoid_fit_result result;
    bool stopped; /* by the time limit: the best that held by then */
    bool measured;
    ovoid_measures measures;
} fit_level;

/* What goes from one model of a file to the next. */
typedef struct fit_session {
    ovoid_fitter *fitter;     /* NULL: none yet */
    ovoid_molecule *molecule; /* that it is at */
    int32_t model;            /* number of the last one that was fitted, 0: none was */
} fit_session;

/* All tasks of a kind. */
typedef struct fit_task_kind {
    uint64_t count;
    double seconds, longest;
} fit_task_kind;

/* Where the time of a fit in parts went. {0}: it was fitted as a whole, or not yet. */
typedef struct fit_work {
    ovoid_rank_time *rank; /* owned */
    size_t ranks;
    fit_task_kind kinds[3]; /* by ovoid_task_kind */
    cJSON *tasks;           /* one by one, where a profile is wanted; owned */
} fit_work;

typedef struct fit_job {
    /* what was asked */
    const char *input;
    const char *output;
    const char *report;                        /* NULL: none */
    const char *trace;                         /* NULL: none */
    const char *owners;                        /* of the first level, NULL: none */
    char *own_output, *own_trace, *own_owners; /* what these may point to */
    const char *device;                        /* NULL: the default */
    const char *asked_device;                  /* as --device has it: each rank takes its own */
    const char *folder;  /* NULL: one molecule; else of several, where all goes (see fit_batch.c) */
    char *const *inputs; /* of several molecules */
    size_t input_count;
    bool all_models;        /* --models all: the inputs are one file again and again, ... */
    const int32_t *numbers; /* ... and these the numbers of its models; NULL: not read yet */
    int32_t number;         /* of the model that this job is about; 0: --models was not asked */
    fit_session *session;   /* NULL: the job has a fitter of its own */
    const char *label;      /* what a progress line begins with, NULL: nothing */
    bool quiet;
    reading reading;
    ovoid_fit_options options; /* with the method's spacing, never 0 */
    uint32_t level_count;      /* asked for */
    double time_limit;         /* of the fits of all levels together, seconds; 0: none */
    bool expand;               /* write all units of a symmetric assembly */
    bool measure;              /* compare the surfaces at the end */
    ovoid_measure_options measuring;
    cli_profile profile; /* of the fits of all levels; `wanted` was asked, the rest came of it */

    /* what came of it */
    FILE *summary; /* NULL: none */
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_fitter *fitter;             /* during the fits; with a session until that takes it */
    int32_t moved_from;               /* model that the session began with; 0: with the atoms */
    bool out_of_time;                 /* the time limit ended them */
    fit_work work;                    /* of the first level, where it was fitted in parts */
    bool shared;                      /* other ranks take part in the fits */
    fit_level levels[FIT_LEVELS_MAX]; /* all have their paths from the start */
    size_t levels_done; /* have their models; fewer than asked for where halving ends */
    fit_trace tracer;
    cli_forecast forecast;
    bool forecast_told;
    bool written; /* the models are */
    bool report_failed, owners_failed;
    double fit_began;
    double started, device_seconds, read_seconds, measure_seconds, write_seconds, total_seconds;
} fit_job;

/* ---- fit_options.c, fit_help.c --------------------------------------------------------------- */

/* Fills in the job from the command line. False: the program ends with *code, all said. */
bool fit_options_parse(int argc, char **argv, fit_job *job, int *code);

const char *fit_method_name(ovoid_method method);
const char *fit_kernel_name(ovoid_kernel kernel);
const char *fit_first_step_name(ovoid_first_step first_step);

/* The numbers of ovoid_fit_options that options set. Those of the goals are in the order of
 * ovoid_goal, so that fit_goal_numbers[goal] has its name and value. */
extern const cli_number fit_surface_numbers[], fit_goal_numbers[], fit_adaptive_numbers[],
    fit_parts_numbers[], fit_l1_numbers[];
extern const size_t fit_surface_count, fit_goal_count, fit_adaptive_count, fit_parts_count,
    fit_l1_count;

/* And of other structures: two of fit_job, and ovoid_measure_options.spacing. */
extern const cli_number fit_levels_number, fit_time_limit_number, fit_mesh_spacing_number;

/* ---- fit_outputs.c --------------------------------------------------------------------------- */

/* Names every level's files. In job->folder, output, trace and owners are called as the molecule,
 * and what was asked for as trace and owners is the ending. With job->number, "out.ovoid" becomes
 * "out.model3.ovoid". False: it cannot be, all said. */
bool fit_outputs_name(fit_job *job);
/* What the models' files of --models are called, "out.modelN.ovoid"; NULL without memory, else to
 * be freed. */
char *fit_outputs_pattern(const fit_job *job);
/* Whether there can be a file for each model where one was named; says so if not. */
bool fit_outputs_take_models(const fit_job *job);
/* Whether no file would be written twice or over the molecule; says so if not. */
bool fit_outputs_check(const fit_job *job);
void fit_outputs_destroy(fit_job *job);

/* ---- fit.c ----------------------------------------------------------------------------------- */

/* One molecule from its file to its model; returns the exit code, all said. The context is there,
 * the device may be open already. */
int fit_run(fit_job *job);
/* Frees what the run has made, and the outputs' names. */
void fit_job_destroy(fit_job *job);

/* Of all levels. */
double fit_sample_seconds(const fit_job *job);
double fit_fit_seconds(const fit_job *job);

/* A distance with four digits, or with as many as it takes to be above `above` if it is. */
enum { FIT_DISTANCE_TEXT = 32 };
const char *fit_distance(double distance, double above, char text[FIT_DISTANCE_TEXT]);

/* Why the goal was not reached, NULL where it was. */
enum { FIT_REASON_TEXT = 160 };
const char *fit_unreached(const fit_job *job, char text[FIT_REASON_TEXT]);

/* ---- fit_session.c, fit_models.c ------------------------------------------------------------- */

/* The job's fitter: the session's, moved to its molecule, or a new one where the session has none
 * for the same atoms. */
ovoid_status fit_session_join(fit_job *job);
/* With more levels than one: the first of them is what the next model begins with. */
void fit_session_remember(fit_job *job);
/* Takes the job's fitter and molecule for the next one. */
void fit_session_keep(fit_job *job);
void fit_session_destroy(fit_session *session);

/* Whether all models of the file can be fitted as asked, as far as is known before it is read; says
 * why not. */
bool fit_models_check(const fit_job *job);
/* Fits each of them; returns the exit code, all said. */
int fit_models(fit_job *job);

/* ---- fit_notes.c, owners.c ------------------------------------------------------------------- */

/* The model's header says where it comes from. */
ovoid_status fit_annotate(const fit_job *job, size_t level);

/* A line per atom with its ellipsoid, as CSV. */
ovoid_status fit_owners_write(const fit_job *job, const fit_level *level);

/* ---- trace.c, summary.c, report.c ------------------------------------------------------------ */

ovoid_status fit_trace_open(fit_trace *trace, ovoid_context *context, const char *path,
                            ovoid_method method);
/* What follows is of this level. */
void fit_trace_level(fit_trace *trace, size_t level);
void fit_trace_add(fit_trace *trace, const ovoid_progress *progress);
void fit_trace_commit(fit_trace *trace);
void fit_trace_destroy(fit_trace *trace);

/* What is known before and after the fit, for people. */
void fit_summary_before(const fit_job *job);
void fit_summary_after(const fit_job *job);

/* What is known for programs, as JSON to be deleted; NULL without memory. The models are there. */
cJSON *fit_report_make(const fit_job *job);
ovoid_status fit_report_write(const fit_job *job);

/* ---- work.c ---------------------------------------------------------------------------------- */

/* Takes what the context's last fit in parts tells of its ranks, and of its tasks where a profile
 * is wanted. False: no memory. */
bool fit_work_take(fit_work *work, const ovoid_context *context, bool profile);
void fit_work_destroy(fit_work *work);

/* A line of what the ranks' time went into, where there was more than one worker; for a profile a
 * table. Nothing where no parts were fitted. */
void fit_work_print(const fit_work *work, FILE *out);
void fit_work_print_table(const fit_work *work, FILE *out);

/* The same as `work`: an object with `ranks` and, for a profile, `tasks`. */
bool fit_work_report(const fit_work *work, cJSON *report);

/* ---- fit_batch.c, fit_batch_names.c, fit_batch_summary.c --------------------------------------
 */

/* What came of one of several molecules. */
typedef struct fit_row {
    const char *input;
    int32_t model; /* its number, 0: rows are files */
    int code;      /* as if it were the only one */
    bool measured;
    uint64_t atoms, ellipsoids; /* 0: not known */
    double distance;            /* NAN: not known */
    double area, volume;        /* of the molecule */
    double seconds;
} fit_row;

/* Whether several molecules can be fitted as asked; says why not. */
bool fit_batch_check(const fit_job *job);
/* Fits job->inputs one after the other into job->folder, if that is not NULL; returns the exit
 * code, all said. */
int fit_batch(fit_job *job);

/* Of a molecule's exit code: whether there is a model of it, and what became of it in a word. */
bool fit_made_model(int code);
const char *fit_status_name(int code);

/* A row each, and how many were fitted of those that were asked. */
void fit_batch_print(FILE *out, const fit_job *asked, const fit_row *rows, size_t count);

#endif
