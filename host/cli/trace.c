#include "fit.h"

#include <string.h>

enum { ROW_BYTES = 512 };

/* Reports the failure and drops the file, which also gives a full disk its room back. */
static void give_up(fit_trace *trace) {
    cli_error("%s; there will be no trace", ovoid_context_error(trace->context));
    trace->failed = true;
    fit_trace_destroy(trace);
}

ovoid_status fit_trace_open(fit_trace *trace, ovoid_context *context, const char *path) {
    static const char header[] = "iteration,E_s,E_l1,w_s,w_l,objective,max_error,ellipsoids,step,"
                                 "seconds,stage\n";
    *trace = (fit_trace){.context = context};
    ovoid_status status = ovoid_file_create(context, path, &trace->file);
    if (status != OVOID_OK)
        return status;
    cli_remove_when_killed(ovoid_file_temporary(trace->file));
    if (ovoid_file_write(context, trace->file, header, strlen(header)) != OVOID_OK)
        give_up(trace);
    return OVOID_OK;
}

void fit_trace_add(fit_trace *trace, const ovoid_progress *p) {
    char row[ROW_BYTES];
    if (!trace->file || p->iteration == 0)
        return;
    int length = snprintf(row, sizeof row, "%llu,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%llu,%.9g,%.6f,%s\n",
                          (unsigned long long)p->iteration, p->accuracy_term, p->sparse_term,
                          p->accuracy_weight, p->sparse_weight, p->objective, p->max_error,
                          (unsigned long long)p->ellipsoids, p->step, p->seconds, p->stage);
    if (ovoid_file_write(trace->context, trace->file, row, (size_t)length) != OVOID_OK)
        give_up(trace);
}

void fit_trace_commit(fit_trace *trace) {
    if (!trace->file)
        return;
    cli_remove_when_killed(NULL);
    if (ovoid_file_commit(trace->context, trace->file) != OVOID_OK)
        give_up(trace);
}

void fit_trace_destroy(fit_trace *trace) {
    cli_remove_when_killed(NULL);
    ovoid_file_destroy(&trace->file);
}
