#include "fit/parts/workers.h"

#include "base/progress.h"
#include "device/device.h"
#include "fit/parts/crew.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* How often the caller is told while others work, and how often processes that share the work meet,
 * seconds: a task takes longer, and a message less. */
#define TELL_EVERY 0.05
#define MEET_EVERY 0.004

/* What the workers share, under its lock. */
typedef struct yard {
    pthread_mutex_t lock;
    pthread_cond_t changed; /* a part has ended, or a worker */
    ovoid_context *context; /* of the caller */
    ov_crew *crew;
    const ov_partition *partition;
    const ov_part_work *work;
    bool *taken;             /* parts that a worker has, or had, or that are not to be worked on */
    bool *ended;             /* and of these, those with which nobody is at work any more */
    bool *spilt;             /* parts for which a device has had too little memory */
    bool *made;              /* parts, since processes last met */
    bool *telling, *granted; /* what the meeting under way is about */
    size_t *device;          /* where each is to be worked on; NULL: on any device of the list */
    size_t done;             /* parts; where processes meet, of all of them */
    size_t working;
    bool over;           /* where they meet: all parts are done */
    double told_at;      /* ov_seconds() */
    uint32_t most;       /* workers that there were */
    ovoid_status status; /* the first that is not OVOID_OK, with its text */
    char *error;
    bool stop;             /* no part is begun any more, and those under way end */
    ovoid_progress latest; /* what a worker said last */
} yard;

/* ---- which part next ------------------------------------------------------------------------- */

static bool may_begin(const yard *y, size_t p) {
    const ov_partition *const cut = y->partition;
    for (size_t q = 0; y->work->in_turn && q < cut->count; ++q)
        if (!y->ended[q] && cut->part[q].colour < cut->part[p].colour && ov_parts_near(cut, p, q))
            return false;
    return true;
}

/* Devices that come to the same bits stand in for each other, and any device for one that is lost.
 */
static bool may_take(const yard *y, const ov_worker *w, size_t p) {
    if (!w || !y->device)
        return true;
    const ov_crew_device *const of = y->crew->device;
    const uint64_t wanted = of[y->device[p]].hash;
    return of[w->device].hash == wanted || ov_crew_of(y->crew, wanted) == 0;
}

/* The part with the earliest colour, and of these the first, that is free, waits for none and may
 * be this worker's; as many as there are parts if none is. */
static size_t next_part(const yard *y, const ov_worker *w) {
    const ov_partition *const cut = y->partition;
    size_t next = cut->count;
    for (size_t p = 0; p < cut->count; ++p)
        if (!y->taken[p] && (next == cut->count || cut->part[p].colour < cut->part[next].colour) &&
            may_take(y, w, p) && may_begin(y, p))
            next = p;
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

/* Releases what a worker has, so that its memory is there for others, with the lock open. */
static void release(yard *y, ov_worker *w) {
    pthread_mutex_unlock(&y->lock);
    ov_progress_end(w->context);
    ovoid_context_destroy(&w->context);
    pthread_mutex_lock(&y->lock);
}

/* Whether part p, which this worker could not do, is another's now: the device failed, not the
 * part, and there is a worker left. A part that two devices have no memory for is too large. */
static bool give_back(yard *y, ov_worker *w, size_t p, ovoid_status status) {
    if (!w || !ov_device_is_at_fault(w->context, status))
        return false;
    const bool spills = status == OVOID_ERROR_MEMORY && !w->in_company;
    ov_crew_blame(y->crew, w, status);
    if ((spills && y->spilt[p]) || ov_crew_left(y->crew) == 0)
        return false;
    y->spilt[p] |= spills;
    if (w->dismissed)
        release(y, w);
    y->taken[p] = false;
    return true;
}

static size_t number_of(const yard *y, const ov_worker *w) {
    return w ? (size_t)(w - y->crew->worker) : 0;
}

/* Works on part p with the yard's lock open meanwhile. w: NULL where the caller's context works. */
static void work_on(yard *y, ovoid_context *context, ov_worker *w, size_t p) {
    const ov_part_work *const work = y->work;
    const size_t done = y->done;
    y->taken[p] = true;
    if (w)
        w->in_company = ov_crew_on(y->crew, w->device) > 1;
    context->device->ran_out = false;
    pthread_mutex_unlock(&y->lock);
    const double began = ov_seconds();
    ovoid_status status = work->task(context, p, done, work->user);
    ov_buffers_trim(context);
    pthread_mutex_lock(&y->lock);
    const bool made = status == OVOID_OK;
    if (made && work->commit && !work->meet)
        status = work->commit(context, p, work->user);
    if (status == OVOID_OK) {
        if (work->time)
            work->time[p] = (ov_task_time){began, ov_seconds() - began, number_of(y, w)};
        y->ended[p] = y->made[p] = true;
        y->done += !work->meet;
    } else if (made || !give_back(y, w, p, status)) {
        set_failure(y, context, status);
    }
    pthread_cond_broadcast(&y->changed);
}

static bool is_over(const yard *y) {
    return y->stop || (y->work->meet ? y->over : y->done == y->partition->count);
}

/* Works on parts until all have ended, with the yard's lock: one that another worker has may come
 * back. */
static void work(yard *y, ovoid_context *context, ov_worker *w) {
    while (!is_over(y) && !(w && w->dismissed)) {
        const size_t p = next_part(y, w);
        if (p < y->partition->count)
            work_on(y, context, w, p);
        else
            pthread_cond_wait(&y->changed, &y->lock);
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
    ov_worker *const w = user;
    yard *const y = w->yard;
    ov_progress_begin(w->context, "sample");
    ov_progress_fit(w->context, OVOID_METHOD_ADAPTIVE);
    pthread_mutex_lock(&y->lock);
    work(y, w->context, w);
    w->at_work = false;
    if (w->context && w->dismissed)
        release(y, w);
    --y->working;
    pthread_cond_broadcast(&y->changed);
    pthread_mutex_unlock(&y->lock);
    if (w->context)
        ov_progress_end(w->context);
    return NULL;
}

/* With the yard's lock, for so many seconds or until something has changed. */
static void wait_for(yard *y, double seconds) {
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += (long)(seconds * 1e9);
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    pthread_cond_timedwait(&y->changed, &y->lock, &until);
}

/* Tells the caller what is going on, with the yard's lock open meanwhile. */
static void tell(yard *y) {
    ovoid_progress told = y->latest;
    told.done = y->done;
    told.total = y->partition->count;
    const bool over = y->stop || y->over || !told.stage;
    y->told_at = ov_seconds();
    pthread_mutex_unlock(&y->lock);
    ov_crew_tell(y->crew);
    const bool go_on = over || ov_progress_report(y->context, &told);
    pthread_mutex_lock(&y->lock);
    if (!go_on && y->status == OVOID_OK)
        set_failure(y, y->context,
                    ov_fail(y->context, OVOID_ERROR_CANCELLED, "stopped while fitting parts"));
}

/* Makes what was granted free to be taken. */
static void take_grants(yard *y) {
    for (size_t p = 0; p < y->partition->count; ++p)
        if (y->granted[p])
            y->taken[p] = y->granted[p] = false;
}

/* Meets the other processes, with the yard's lock open meanwhile: workers add to `made` what they
 * do until the next time. What all have heard of a failure takes the place of what was known of it
 * here. */
static void meet(yard *y) {
    const size_t count = y->partition->count;
    ov_meeting m = {.status = y->status,
                    .workers = (uint32_t)ov_crew_left(y->crew),
                    .made = y->telling,
                    .granted = y->granted,
                    .done = y->done};
    memcpy(y->telling, y->made, count * sizeof *y->made);
    memset(y->made, 0, count * sizeof *y->made);
    pthread_mutex_unlock(&y->lock);
    if (m.status != OVOID_OK)
        ov_fail(y->context, m.status, "%s", y->error ? y->error : "");
    const ovoid_status status = y->work->meet(y->context, &m, y->work->user);
    pthread_mutex_lock(&y->lock);
    y->done = m.done;
    y->over = m.over || status != OVOID_OK;
    take_grants(y);
    if (status != OVOID_OK) {
        free(y->error);
        y->error = NULL;
        y->status = OVOID_OK;
        set_failure(y, y->context, status);
    }
    pthread_cond_broadcast(&y->changed);
}

/* With the yard's lock, until all workers have ended: tells the caller what is going on, and the
 * workers when the caller has had enough. */
static void watch(yard *y) {
    const bool meets = y->work->meet != NULL;
    while (y->working > 0 || (meets && !y->over)) {
        if (meets && !y->over)
            meet(y);
        wait_for(y, meets ? MEET_EVERY : TELL_EVERY);
        if (!meets || ov_seconds() - y->told_at >= TELL_EVERY)
            tell(y);
    }
}

/* A thread for each worker. False: there could be none. */
static bool begin_work(yard *y, ov_worker *w) {
    w->yard = y;
    w->in_company = false;
    ovoid_context_on_progress(w->context, on_progress, y);
    w->at_work = pthread_create(&w->thread, NULL, run, w) == 0;
    y->working += w->at_work;
    return w->at_work;
}

static ovoid_status work_together(yard *y, size_t jobs, size_t left) {
    ov_crew *const crew = y->crew;
    const ovoid_status status = ov_crew_hire(crew, jobs, y->device ? SIZE_MAX : left);
    bool *const begun = ov_alloc(y->context, crew->workers, sizeof *begun, "workers");
    if (status != OVOID_OK || !begun) {
        free(begun);
        return status != OVOID_OK ? status : OVOID_ERROR_MEMORY;
    }
    pthread_mutex_lock(&y->lock);
    for (size_t n = 0; n < crew->workers; ++n)
        begun[n] = crew->worker[n].context && begin_work(y, &crew->worker[n]);
    y->most = (uint32_t)y->working;
    if (y->working == 0)
        set_failure(y, y->context,
                    ov_fail(y->context, OVOID_ERROR_MEMORY, "no thread could be started"));
    watch(y);
    pthread_mutex_unlock(&y->lock);
    for (size_t n = 0; n < crew->workers; ++n)
        if (begun[n])
            pthread_join(crew->worker[n].thread, NULL);
    free(begun);
    ov_crew_tell(crew);
    return OVOID_OK;
}

/* ---- where each part is worked on ------------------------------------------------------------ */

/* Where devices come to different bits, parts are dealt out beforehand, those of one colour in
 * turn, so that the outcome does not depend on who was free first. */
static ovoid_status deal_out(yard *y) {
    const ov_partition *const cut = y->partition;
    y->device = ov_alloc(y->context, cut->count, sizeof *y->device, "parts of a molecule");
    if (!y->device)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < cut->count; ++p)
        for (size_t q = p; q-- > 0;)
            if (cut->part[q].colour == cut->part[p].colour) {
                y->device[p] = (y->device[q] + 1) % y->crew->devices;
                break;
            }
    return OVOID_OK;
}

/* Parts that are not to be worked on have ended; where processes meet, none is free until it is
 * granted. */
static ovoid_status open_yard(yard *y) {
    const size_t count = y->partition->count;
    y->made = ov_alloc(y->context, count, sizeof *y->made, "parts of a molecule");
    y->telling = ov_alloc(y->context, count, sizeof *y->telling, "parts of a molecule");
    y->granted = ov_alloc(y->context, count, sizeof *y->granted, "parts of a molecule");
    y->taken = ov_alloc(y->context, count, sizeof *y->taken, "parts of a molecule");
    y->ended = ov_alloc(y->context, count, sizeof *y->ended, "parts of a molecule");
    y->spilt = ov_alloc(y->context, count, sizeof *y->spilt, "parts of a molecule");
    if (!y->made || !y->telling || !y->granted || !y->taken || !y->ended || !y->spilt)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < count; ++p) {
        y->ended[p] = y->work->todo && !y->work->todo[p];
        y->taken[p] = y->ended[p] || y->work->meet;
        y->done += y->ended[p];
    }
    return y->crew->alike ? OVOID_OK : deal_out(y);
}

static void close_yard(yard *y) {
    pthread_cond_destroy(&y->changed);
    pthread_mutex_destroy(&y->lock);
    free(y->error);
    free(y->made);
    free(y->telling);
    free(y->granted);
    free(y->taken);
    free(y->ended);
    free(y->spilt);
    free(y->device);
}

/* Whose thread meets others works on no part. Several devices stand by for each other, even where
 * there is one part left to do; a molecule that is one part is the first one's. */
static bool is_for_several(const yard *y, size_t jobs, size_t left) {
    const ov_crew *const crew = y->crew;
    if (y->work->meet)
        return true;
    if (crew->devices > 1)
        return left > 0 && (crew->workers > 0 || y->partition->count > 1);
    return jobs > 1 && left > 1;
}

ovoid_status ov_parts_work(ovoid_context *context, const ov_partition *partition, size_t jobs,
                           const ov_part_work *work_of, uint32_t *most) {
    yard y = {.most = 1, .context = context, .partition = partition, .work = work_of};
    const bool alone = !context->crew; /* no crew is there for longer */
    ovoid_status status = alone ? ov_crew_begin(context) : OVOID_OK;
    if (status != OVOID_OK)
        return status;
    y.crew = context->crew;
    pthread_mutex_init(&y.lock, NULL);
    pthread_cond_init(&y.changed, NULL);
    OV_TRY(open_yard(&y));
    const size_t left = partition->count - y.done;
    if (is_for_several(&y, jobs, left)) {
        OV_TRY(work_together(&y, jobs > 1 ? jobs : 1, left));
    } else {
        pthread_mutex_lock(&y.lock);
        work(&y, context, NULL);
        pthread_mutex_unlock(&y.lock);
    }
    if (y.status != OVOID_OK)
        status = ov_fail(context, y.status, "%s", y.error ? y.error : "");
cleanup:
    if (most)
        *most = y.most;
    close_yard(&y);
    if (alone)
        ov_crew_end(context);
    return status;
}
