#include "fit/parts/times.h"

#include <stdlib.h>
#include <string.h>

typedef struct ov_times {
    ovoid_task *task;
    size_t tasks, capacity;
    ovoid_rank_time *rank;
    uint32_t ranks;
    uint32_t stage; /* the one under way */
    double origin;  /* ov_seconds() */
} ov_times;

void ov_times_forget(ovoid_context *context) {
    ov_times *const t = context->times;
    context->times = NULL;
    for (size_t n = 0; t && n < t->tasks; ++n)
        free((void *)(uintptr_t)t->task[n].after); /* made in ov_times_add() */
    if (t) {
        free(t->task);
        free(t->rank);
    }
    free(t);
}

ovoid_status ov_times_begin(ovoid_context *context, uint32_t ranks) {
    ov_times_forget(context);
    ov_times *const t = ov_alloc(context, 1, sizeof *t, "times of tasks");
    if (!t)
        return OVOID_ERROR_MEMORY;
    context->times = t;
    context->drop_times = ov_times_forget;
    t->ranks = ranks;
    t->origin = ov_seconds();
    t->rank = ov_alloc(context, ranks, sizeof *t->rank, "times of ranks");
    for (uint32_t n = 0; t->rank && n < ranks; ++n)
        t->rank[n].rank = n;
    return t->rank ? OVOID_OK : OVOID_ERROR_MEMORY;
}

double ov_times_origin(const ovoid_context *context) {
    return context->times->origin;
}

ovoid_status ov_times_add(ovoid_context *context, const ovoid_task *task) {
    ov_times *const t = context->times;
    ovoid_status status =
        ov_grow(context, &t->task, &t->capacity, t->tasks + 1, sizeof *t->task, "times of tasks");
    if (status != OVOID_OK)
        return status;
    ovoid_task one = *task;
    one.stage = t->stage;
    one.after = NULL;
    if (task->after_count > 0) {
        one.after = ov_copy(context, task->after, (size_t)task->after_count, sizeof *task->after,
                            "times of tasks");
        if (!one.after)
            return OVOID_ERROR_MEMORY;
    }
    t->task[t->tasks++] = one;
    t->rank[one.rank].busy += one.seconds;
    ++t->rank[one.rank].tasks;
    return OVOID_OK;
}

/* What the tasks of a rank took in the stage under way: they are the last ones. */
static double busy_of(const ov_times *t, uint32_t rank) {
    double busy = 0.0;
    for (size_t n = t->tasks; n-- > 0 && t->task[n].stage == t->stage;)
        busy += t->task[n].rank == rank ? t->task[n].seconds : 0.0;
    return busy;
}

/* Clocks of several ranks differ by what a message takes: no rank has waited less than nothing. */
void ov_times_end_stage(ovoid_context *context, double seconds, const uint32_t *workers) {
    ov_times *const t = context->times;
    for (uint32_t n = 0; n < t->ranks; ++n) {
        ovoid_rank_time *const r = &t->rank[n];
        const double waited = seconds * workers[n] - busy_of(t, n);
        r->workers = workers[n] > r->workers ? workers[n] : r->workers;
        r->waiting += waited > 0.0 ? waited : 0.0;
        r->seconds = ov_seconds() - t->origin;
    }
    ++t->stage;
}

const ovoid_task *ovoid_context_tasks(const ovoid_context *context, size_t *count) {
    const ov_times *const t = context ? context->times : NULL;
    if (count)
        *count = t ? t->tasks : 0;
    return t && t->tasks > 0 ? t->task : NULL;
}

const ovoid_rank_time *ovoid_context_rank_times(const ovoid_context *context, size_t *count) {
    const ov_times *const t = context ? context->times : NULL;
    if (count)
        *count = t && t->rank ? t->ranks : 0;
    return t ? t->rank : NULL;
}
