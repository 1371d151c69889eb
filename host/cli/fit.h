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
} fit_trace;

typedef struct fit_job {
    /* what was asked */
    const char *input;
    const char *output;
    char *default_output; /* owned, output may point to it */
    const char *report;   /* NULL: none */
    const char *trace;    /* NULL: none */
    const char *device;   /* NULL: the default */
    bool quiet;
    ovoid_molecule_format format;
    ovoid_fit_options options;
    bool measure; /* compare the surfaces at the end */
    ovoid_measure_options measuring;

    /* what came of it */
    FILE *summary; /* NULL: none */
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_model *model;
    ovoid_fit_result result;
    bool measured;
    ovoid_measures measures;
    fit_trace tracer;
    bool report_failed;
    double started, device_seconds, read_seconds, measure_seconds, write_seconds, total_seconds;
} fit_job;

/* ---- fit_options.c -------------------------------------------------------------------------- */

/* Fills in the job from the command line. False: the program ends with *code, all said. */
bool fit_options_parse(int argc, char **argv, fit_job *job, int *code);

const char *fit_method_name(ovoid_method method);
const char *fit_kernel_name(ovoid_kernel kernel);
const char *fit_first_step_name(ovoid_first_step first_step);

/* The numbers of ovoid_fit_options that options set, apart for the surface and for method l1. */
extern const cli_number fit_surface_numbers[], fit_l1_numbers[];
extern const size_t fit_surface_count, fit_l1_count;

/* ---- trace.c, summary.c, report.c ------------------------------------------------------------ */

ovoid_status fit_trace_open(fit_trace *trace, ovoid_context *context, const char *path);
void fit_trace_add(fit_trace *trace, const ovoid_progress *progress);
void fit_trace_commit(fit_trace *trace);
void fit_trace_destroy(fit_trace *trace);

/* What is known before and after the fit, for people. */
void fit_summary_before(const fit_job *job);
void fit_summary_after(const fit_job *job);

/* Writes what is known for programs, as JSON. */
ovoid_status fit_report_write(const fit_job *job);

#endif
