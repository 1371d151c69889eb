#include "fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const kind_names[] = {"fit", "judge", "mend"};

/* ---- taking it ------------------------------------------------------------------------------- */

/* Microseconds, as of the other seconds of a report. */
static bool add_seconds(cJSON *object, const char *key, double seconds) {
    return cJSON_AddNumberToObject(object, key, round(seconds * 1e6) / 1e6) != NULL;
}

static bool add_after(cJSON *object, const ovoid_task *task) {
    cJSON *const after = cJSON_AddArrayToObject(object, "after");
    bool good = after != NULL;
    for (uint64_t n = 0; good && n < task->after_count; n++) {
        cJSON *const number = cJSON_CreateNumber(task->after[n]);
        good = number && cJSON_AddItemToArray(after, number);
    }
    return good;
}

static bool add_task(cJSON *tasks, const ovoid_task *task) {
    cJSON *const object = cJSON_CreateObject();
    return object && cJSON_AddItemToArray(tasks, object) &&
           cli_json_string(object, "kind", kind_names[task->kind]) &&
           cJSON_AddNumberToObject(object, "stage", task->stage) &&
           cJSON_AddNumberToObject(object, "number", task->number) &&
           cJSON_AddNumberToObject(object, "rank", task->rank) &&
           cJSON_AddNumberToObject(object, "worker", task->worker) &&
           cJSON_AddNumberToObject(object, "atoms", task->atoms) &&
           add_seconds(object, "began", task->began) &&
           add_seconds(object, "seconds", task->seconds) && add_after(object, task);
}

static bool take_tasks(fit_work *work, const ovoid_task *tasks, size_t count, bool profile) {
    bool good = !profile || (work->tasks = cJSON_CreateArray()) != NULL;
    for (size_t n = 0; n < count; n++) {
        fit_task_kind *const kind = &work->kinds[tasks[n].kind];
        kind->count++;
        kind->seconds += tasks[n].seconds;
        kind->longest = fmax(kind->longest, tasks[n].seconds);
        good = good && (!profile || add_task(work->tasks, &tasks[n]));
    }
    return good;
}

bool fit_work_take(fit_work *work, const ovoid_context *context, bool profile) {
    size_t tasks = 0, ranks = 0;
    const ovoid_task *const task = ovoid_context_tasks(context, &tasks);
    const ovoid_rank_time *const rank = ovoid_context_rank_times(context, &ranks);
    if (tasks == 0 || ranks == 0)
        return true;
    work->rank = calloc(ranks, sizeof *work->rank);
    if (!work->rank)
        return false;
    memcpy(work->rank, rank, ranks * sizeof *rank);
    work->ranks = ranks;
    return take_tasks(work, task, tasks, profile);
}

void fit_work_destroy(fit_work *work) {
    free(work->rank);
    cJSON_Delete(work->tasks);
    *work = (fit_work){0};
}

/* ---- for people ------------------------------------------------------------------------------ */

/* Shares of a worker's time; 0 where there was none. */
static double percent(double part, double whole) {
    return whole > 0.0 ? 100.0 * part / whole : 0.0;
}

static double all_of(const ovoid_rank_time *rank) {
    return rank->seconds * rank->workers;
}

void fit_work_print(const fit_work *work, FILE *out) {
    double all = 0.0, busy = 0.0, waiting = 0.0, most = 0.0;
    unsigned long long workers = 0;
    for (size_t n = 0; n < work->ranks; n++) {
        const ovoid_rank_time *const rank = &work->rank[n];
        workers += rank->workers;
        all += all_of(rank);
        busy += rank->busy;
        waiting += rank->waiting;
        most = fmax(most, percent(rank->waiting, all_of(rank)));
    }
    if (workers < 2)
        return;
    fprintf(out, "work      %llu workers", workers);
    if (work->ranks > 1)
        fprintf(out, " of %zu ranks", work->ranks);
    fprintf(out, ": busy %.1f %% of their %.1f s, waiting %.1f %%", percent(busy, all), all,
            percent(waiting, all));
    if (work->ranks > 1)
        fprintf(out, " (%.1f %% of one rank's)", most);
    putc('\n', out);
}

void fit_work_print_table(const fit_work *work, FILE *out) {
    if (work->ranks == 0)
        return;
    fputs("\nrank              workers       tasks      busy s  waiting s  % waiting\n", out);
    for (size_t n = 0; n < work->ranks; n++) {
        const ovoid_rank_time *const rank = &work->rank[n];
        fprintf(out, "%-16u  %7u  %10llu  %10.3f  %9.3f  %9.1f\n", (unsigned)rank->rank,
                (unsigned)rank->workers, (unsigned long long)rank->tasks, rank->busy, rank->waiting,
                percent(rank->waiting, all_of(rank)));
    }
    fputs("\ntask                             tasks     seconds    longest\n", out);
    for (size_t k = 0; k < sizeof work->kinds / sizeof *work->kinds; k++)
        if (work->kinds[k].count > 0)
            fprintf(out, "%-16s           %10llu  %10.3f  %9.3f\n", kind_names[k],
                    (unsigned long long)work->kinds[k].count, work->kinds[k].seconds,
                    work->kinds[k].longest);
}

/* ---- for programs ---------------------------------------------------------------------------- */

static bool add_rank(cJSON *ranks, const ovoid_rank_time *rank) {
    cJSON *const object = cJSON_CreateObject();
    return object && cJSON_AddItemToArray(ranks, object) &&
           cJSON_AddNumberToObject(object, "rank", rank->rank) &&
           cJSON_AddNumberToObject(object, "workers", rank->workers) &&
           cJSON_AddNumberToObject(object, "tasks", (double)rank->tasks) &&
           add_seconds(object, "seconds", rank->seconds) &&
           add_seconds(object, "busy", rank->busy) &&
           add_seconds(object, "waiting", rank->waiting) &&
           cJSON_AddNumberToObject(object, "share_waiting",
                                   round(1e4 * percent(rank->waiting, all_of(rank))) / 1e6);
}

bool fit_work_report(const fit_work *work, cJSON *report) {
    if (work->ranks == 0)
        return true;
    cJSON *const object = cJSON_AddObjectToObject(report, "work");
    cJSON *const ranks = object ? cJSON_AddArrayToObject(object, "ranks") : NULL;
    bool good = ranks != NULL;
    for (size_t n = 0; good && n < work->ranks; n++)
        good = add_rank(ranks, &work->rank[n]);
    if (!good || !work->tasks)
        return good;
    cJSON *const tasks = cJSON_Duplicate(work->tasks, 1);
    return tasks && cJSON_AddItemToObject(object, "tasks", tasks);
}
