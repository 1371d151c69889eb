#include "fit/parts/workers.h"

#include "base/progress.h"
#include "device/device.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* How often the caller is told while others work, seconds. */
#define TELL_EVERY 0.05

/* What the workers share, under its lock. */
typedef struct yard {
    pthread_mutex_t lock;
    pthread_cond_t changed; /* a part has ended, or a worker */
    ovoid_context *context; /* of the caller */
    const ov_partition *partition;
    const ov_part_work *work;
    bool *taken; /* parts that a worker has, or had, or that are not to be worked on */
    bool *ended; /* and of these, those with which nobody is at work any more */
    size_t done, working;
    ovoid_status status; /* the first that is not OVOID_OK, with its text */
    char *error;
    bool stop;             /* no part is begun any more, and those under way end */
    ovoid_progress latest; /* what a worker said last */
} yard;

typedef struct worker {
    yard *yard;
    ovoid_context *context;
    pthread_t thread;
} worker;

/* ---- which part next ------------------------------------------------------------------------- */

static bool may_begin(const yard *y, size_t p) {
    const ov_partition *const cut = y->partition;
    for (size_t q = 0; y->work->in_turn && q < cut->count; ++q)
        if (!y->ended[q] && cut->part[q].colour < cut->part[p].colour && ov_parts_near(cut, p, q))
            return false;
    return true;
}

/* The part with the earliest colour, and of these the first, that is free and waits for none; as
 * many as there are parts if none is. *left: whether there are any. */
static size_t next_part(const yard *y, bool *left) {
    const ov_partition *const cut = y->partition;
    size_t next = cut->count;
    *left = false;
    for (size_t p = 0; p < cut->count; ++p) {
        if (y->taken[p])
            continue;
        *left = true;
        if ((next == cut->count || cut->part[p].colour < cut->part[next].colour) && may_begin(y, p))
            next = p;
    }
    return next;
}

/* ---- one after the other --------------------------------------------------------------------- */

static void set_failure(yard *y, ovoid_context *context, ovoid_status status) {
    if (y->status == OVOID_OK) {
        y->status = status;
        y->error = strdup(ovoid_context_error(context));
    }
    y->stop = true;
}

/* Works on part p with the yard's lock open meanwhile. */
static void work_on(yard *y, ovoid_context *context, size_t p) {
    const ov_part_work *const work = y->work;
    const size_t done = y->done - work->elsewhere;
    y->taken[p] = true;
    pthread_mutex_unlock(&y->lock);
    ovoid_status status = work->task(context, p, done, work->user);
    pthread_mutex_lock(&y->lock);
    if (status == OVOID_OK && work->commit)
        status = work->commit(context, p, work->user);
    if (status == OVOID_OK) {
        y->ended[p] = true;
        ++y->done;
    } else {
        set_failure(y, context, status);
    }
    pthread_cond_broadcast(&y->changed);
}

/* Works on parts until none is left, with the yard's lock. */
static void work(yard *y, ovoid_context *context) {
    bool left = true;
    while (!y->stop && left) {
        const size_t p = next_part(y, &left);
        if (p < y->partition->count)
            work_on(y, context, p);
        else if (left)
            pthread_cond_wait(&y->changed, &y->lock); /* for one that this one waits for */
    }
}

/* ---- side by side ---------------------------------------------------------------------------- */

static bool on_progress(const ovoid_progress *progress, void *user) {
    yard *const y = user;
    pthread_mutex_lock(&y->lock);
    y->latest = *progress;
    const bool go_on = !y->stop;
    pthread_mutex_unlock(&y->lock);
    return go_on;
}

static void *run(void *user) {
    worker *const w = user;
    yard *const y = w->yard;
    ov_progress_begin(w->context, "sample");
    ov_progress_fit(w->context, OVOID_METHOD_ADAPTIVE);
    pthread_mutex_lock(&y->lock);
    work(y, w->context);
    --y->working;
    pthread_cond_broadcast(&y->changed);
    pthread_mutex_unlock(&y->lock);
    ov_progress_end(w->context);
    return NULL;
}

/* A context on the same device with a queue of its own. */
static ovoid_status hire(yard *y, worker *w) {
    w->yard = y;
    if (ovoid_context_create(&w->context) != OVOID_OK)
        return ov_fail(y->context, OVOID_ERROR_MEMORY, "no memory for a worker");
    ovoid_context_on_progress(w->context, on_progress, y);
    const ovoid_status status = ov_device_open_again(y->context, w->context);
    return status == OVOID_OK ? OVOID_OK
                              : ov_fail(y->context, status, "%s", ovoid_context_error(w->context));
}

/* Tells the caller what is going on until all workers have ended, and those when it has had enough.
 */
static void watch(yard *y) {
    while (y->working > 0) {
        struct timespec until;
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_nsec += (long)(TELL_EVERY * 1e9);
        until.tv_sec += until.tv_nsec / 1000000000;
        until.tv_nsec %= 1000000000;
        pthread_cond_timedwait(&y->changed, &y->lock, &until);
        if (y->stop || !y->latest.stage)
            continue;
        ovoid_progress told = y->latest;
        told.done = y->done - y->work->elsewhere;
        told.total = y->partition->count;
        pthread_mutex_unlock(&y->lock);
        const bool go_on = ov_progress_report(y->context, &told);
        pthread_mutex_lock(&y->lock);
        if (!go_on && y->status == OVOID_OK)
            set_failure(y, y->context,
                        ov_fail(y->context, OVOID_ERROR_CANCELLED, "stopped while fitting parts"));
    }
}

static ovoid_status work_together(yard *y, size_t jobs) {
    ovoid_status status = OVOID_OK;
    size_t begun = 0;
    worker *const workers = ov_alloc(y->context, jobs, sizeof *workers, "workers");
    if (!workers)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < jobs; ++n)
        OV_TRY(hire(y, &workers[n]));
    pthread_mutex_lock(&y->lock);
    for (; begun < jobs; ++begun, ++y->working)
        if (pthread_create(&workers[begun].thread, NULL, run, &workers[begun]) != 0)
            break;
    if (begun == 0)
        set_failure(y, y->context,
                    ov_fail(y->context, OVOID_ERROR_MEMORY, "no thread could be started"));
    watch(y);
    pthread_mutex_unlock(&y->lock);
    for (size_t n = 0; n < begun; ++n)
        pthread_join(workers[n].thread, NULL);
cleanup:
    for (size_t n = 0; n < jobs; ++n)
        ovoid_context_destroy(&workers[n].context);
    free(workers);
    return status;
}

/* Parts that are not to be worked on have ended. */
static ovoid_status open_yard(yard *y) {
    const size_t count = y->partition->count;
    y->taken = ov_alloc(y->context, count, sizeof *y->taken, "parts of a molecule");
    y->ended = ov_alloc(y->context, count, sizeof *y->ended, "parts of a molecule");
    if (!y->taken || !y->ended)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < count; ++p) {
        y->taken[p] = y->ended[p] = y->work->todo && !y->work->todo[p];
        y->done += y->ended[p];
    }
    pthread_mutex_init(&y->lock, NULL);
    pthread_cond_init(&y->changed, NULL);
    return OVOID_OK;
}

static void close_yard(yard *y) {
    pthread_cond_destroy(&y->changed);
    pthread_mutex_destroy(&y->lock);
}

ovoid_status ov_parts_work(ovoid_context *context, const ov_partition *partition, size_t jobs,
                           const ov_part_work *work_of) {
    yard y = {.context = context, .partition = partition, .work = work_of};
    ovoid_status status = open_yard(&y);
    if (status != OVOID_OK)
        goto cleanup;
    if (jobs > 1 && partition->count - y.done > 1) {
        const size_t most = partition->count - y.done;
        status = work_together(&y, jobs < most ? jobs : most);
    } else {
        pthread_mutex_lock(&y.lock);
        work(&y, context);
        pthread_mutex_unlock(&y.lock);
    }
    close_yard(&y);
    if (status == OVOID_OK && y.status != OVOID_OK)
        status = ov_fail(context, y.status, "%s", y.error ? y.error : "");
cleanup:
    free(y.error);
    free(y.taken);
    free(y.ended);
    return status;
}
