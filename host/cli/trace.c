#include "fit.h"

#include <string.h>

enum { ROW_BYTES = 512 };

/* Reports the failure and drops the file, which also gives a full disk its room back. */
static void give_up(fit_trace *trace) {
    cli_error("%s; there will be no trace", ovoid_context_error(trace->context));
    trace->failed = true;
    fit_trace_destroy(trace);
}

/* The methods have their own columns. */
static const char l1_header[] = "iteration,E_s,E_l1,w_s,w_l,objective,max_error,ellipsoids,step,"
                                "seconds,stage\n";
static const char adaptive_header[] = "level,step,ellipsoids,points,objective,seconds,stage\n";

ovoid_status fit_trace_open(fit_trace *trace, ovoid_context *context, const char *path,
                            ovoid_method method) {
    const char *header = method == OVOID_METHOD_L1 ? l1_header : adaptive_header;
    *trace = (fit_trace){.method = method};
    ovoid_status status = ovoid_context_create(&trace->context);
    if (status == OVOID_OK)
        status = ovoid_file_create(context, path, &trace->file);
    if (status != OVOID_OK)
        return status;
    if (ovoid_file_write(trace->context, trace->file, header, strlen(header)) != OVOID_OK)
        give_up(trace);
    return OVOID_OK;
}

void fit_trace_level(fit_trace *trace, size_t level) {
    trace->level = level;
    trace->iteration = 0;
}

void fit_trace_add(fit_trace *trace, const ovoid_progress *p) {
    char row[ROW_BYTES];
    int length;
    /* What is reported between iterations, such as a piece that was sampled, is none. */
    if (!trace->file || p->iteration <= trace->iteration)
        return;
    trace->iteration = p->iteration;
    if (trace->method == OVOID_METHOD_L1)
        length =
            snprintf(row, sizeof row, "%llu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%llu,%.9g,%.6f,%s\n",
                     (unsigned long long)p->iteration, p->l1.accuracy_term, p->l1.sparse_term,
                     p->l1.accuracy_weight, p->l1.sparse_weight, p->l1.objective, p->l1.max_error,
                     (unsigned long long)p->ellipsoids, p->l1.step, p->seconds, p->stage);
    else
        length = snprintf(row, sizeof row, "%zu,%llu,%llu,%llu,%.9g,%.6f,%s\n", trace->level + 1,
                          (unsigned long long)p->iteration, (unsigned long long)p->ellipsoids,
                          (unsigned long long)p->points, p->adaptive.misfit, p->seconds, p->stage);
    if (ovoid_file_write(trace->context, trace->file, row, (size_t)length) != OVOID_OK)
        give_up(trace);
}

void fit_trace_commit(fit_trace *trace) {
    if (!trace->file)
        return;
    if (ovoid_file_commit(trace->context, trace->file) != OVOID_OK)
        give_up(trace);
}

void fit_trace_destroy(fit_trace *trace) {
    ovoid_file_destroy(&trace->file);
    ovoid_context_destroy(&trace->context);
}
