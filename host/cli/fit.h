/*
 * One run of `ovoid fit`, shared by the files that make it up.
 */
#ifndef CLI_FIT_H
#define CLI_FIT_H

#include "measures.h"

/* Records every iteration in a CSV file. A trace that cannot be written ends without ending the
 * fit: the model is worth more. */
typedef struct fit_trace {
    ovoid_context *context;
    ovoid_file *file; /* NULL: no trace is kept (any more) */
    bool failed;      /* and the failure has been reported */
    ovoid_method method;
    size_t level;       /* from 0, being fitted */
    uint64_t iteration; /* the last one recorded of this level, 0 before the first */
} fit_trace;

/* From 2^32 atoms, halving comes to one ellipsoid after that many levels. */
enum { FIT_LEVELS_MAX = 32 };

/* One of the models that a run makes: the goal's, then each with half the ellipsoids. */
typedef struct fit_level {
    const char *path;
    char *own_path; /* path may point to it */
    ovoid_model *model;
    ovoid_fit_result result;
    bool measured;
    ovoid_measures measures;
} fit_level;

typedef struct fit_job {
    /* what was asked */
    const char *input;
    const char *output;
    char *default_output; /* owned, output may point to it */
    const char *report;   /* NULL: none */
    const char *trace;    /* NULL: none */
    const char *device;   /* NULL: the default */
    bool quiet;
    reading reading;
    ovoid_fit_options options; /* with the method's spacing, never 0 */
    uint32_t level_count;      /* asked for */
    bool measure;              /* compare the surfaces at the end */
    ovoid_measure_options measuring;
    cli_profile profile; /* of the fits of all levels; `wanted` was asked, the rest came of it */

    /* what came of it */
    FILE *summary; /* NULL: none */
    ovoid_context *context;
    ovoid_molecule *molecule;
    fit_level levels[FIT_LEVELS_MAX]; /* all have their paths from the start */
    size_t levels_done; /* have their models; fewer than asked for where halving ends */
    fit_trace tracer;
    bool report_failed;
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
    fit_l1_numbers[];
extern const size_t fit_surface_count, fit_goal_count, fit_adaptive_count, fit_l1_count;

/* And of other structures: fit_job.level_count and ovoid_measure_options.spacing. */
extern const cli_number fit_levels_number, fit_mesh_spacing_number;

/* ---- fit.c ----------------------------------------------------------------------------------- */

/* Of all levels. */
double fit_sample_seconds(const fit_job *job);
double fit_fit_seconds(const fit_job *job);

/* A distance with four digits, or with as many as it takes to be above `above` if it is. */
enum { FIT_DISTANCE_TEXT = 32 };
const char *fit_distance(double distance, double above, char text[FIT_DISTANCE_TEXT]);

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

/* Writes what is known for programs, as JSON. */
ovoid_status fit_report_write(const fit_job *job);

#endif
