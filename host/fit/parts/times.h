/*
 * Where the time of a fit in parts goes: each task that was done, and what each rank's workers did
 * meanwhile, for ovoid_context_tasks() and ovoid_context_rank_times(). A context keeps what its
 * last fit in parts came to.
 */
#ifndef OV_FIT_TIMES_H
#define OV_FIT_TIMES_H

#include "base/base.h"

/* When a task was done, and by whom. */
typedef struct ov_task_time {
    double began, seconds; /* began: in ov_seconds() of the rank, less ov_times_origin() there */
    uint64_t worker;
} ov_task_time;

/* Forgets what the context has. */
void ov_times_forget(ovoid_context *context);

/* Begins anew with so many ranks. */
ovoid_status ov_times_begin(ovoid_context *context, uint32_t ranks);
double ov_times_origin(const ovoid_context *context);

/* Adds a task of the stage under way; `after` is copied. The stage's end adds what of its seconds
 * the workers of each rank, workers[rank] of them, waited. */
ovoid_status ov_times_add(ovoid_context *context, const ovoid_task *task);
void ov_times_end_stage(ovoid_context *context, double seconds, const uint32_t *workers);

#endif
