#include "measure/hands.h"

#include "base/parallel.h"
#include "base/progress.h"
#include "device/device.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Tasks that may be done before their turn to be committed, for each hand. */
#define AHEAD 2
/* How often the caller is asked while it waits for others, seconds. */
#define ASK_EVERY 0.05

enum { FREE, TAKEN, DONE };

typedef struct hand {
    ovoid_context *context;
    ov_hands *of;
    size_t number;
    pthread_t thread;
    bool at_work;
} hand;

struct ov_hands {
    ovoid_context *context; /* of the caller, which is hand 0 */
    hand *hand;             /* all of them; contexts of others are made when there is work */
    size_t count;
    bool opened;
    pthread_mutex_t lock; /* of what follows */
    pthread_cond_t changed;
    const ov_hands_work *work;
    uint8_t *state;   /* of each task */
    size_t committed; /* tasks, the first ones */
    bool stop;        /* nobody takes up another task, and those under way end */
};

/* ---- who there is ---------------------------------------------------------------------------- */

static size_t choose_count(const ov_device *device, size_t wanted) {
    if (device->borrowed || device->profile)
        return 1;
    if (wanted > 0)
        return wanted < OV_HANDS_MOST ? wanted : OV_HANDS_MOST;
    return ov_device_company(device, ov_cores());
}

ovoid_status ov_hands_create(ovoid_context *context, size_t wanted, ov_hands **hands) {
    ov_device *device;
    const ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    ov_hands *const made = ov_alloc(context, 1, sizeof *made, "threads");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->context = context;
    made->count = choose_count(device, wanted);
    made->hand = ov_alloc(context, made->count, sizeof *made->hand, "threads");
    if (!made->hand) {
        free(made);
        return OVOID_ERROR_MEMORY;
    }
    pthread_mutex_init(&made->lock, NULL);
    pthread_cond_init(&made->changed, NULL);
    *hands = made;
    return OVOID_OK;
}

/* What a hand's device has counted is the caller's. */
static void dismiss(ov_hands *hands, hand *h) {
    uint64_t *const all = hands->context->device ? hands->context->device->counts : NULL;
    for (size_t n = 0; all && h->context && h->context->device && n < OVOID_COUNTS; ++n)
        all[n] += h->context->device->counts[n];
    ovoid_context_destroy(&h->context);
}

void ov_hands_destroy(ov_hands **hands) {
    ov_hands *const of = *hands;
    if (!of)
        return;
    for (size_t n = 1; n < of->count; ++n)
        dismiss(of, &of->hand[n]);
    pthread_cond_destroy(&of->changed);
    pthread_mutex_destroy(&of->lock);
    free(of->hand);
    free(of);
    *hands = NULL;
}

size_t ov_hands_count(const ov_hands *hands) {
    return hands->count;
}

/* ---- tasks ----------------------------------------------------------------------------------- */

/* The first that is free; as many as there are if none is, or none yet. */
static size_t next_task(const ov_hands *hands) {
    const size_t count = hands->work->count, ahead = hands->committed + AHEAD * hands->count;
    for (size_t n = hands->committed; n < count && n < ahead; ++n)
        if (hands->state[n] == FREE)
            return n;
    return count;
}

static void commit(ov_hands *hands) {
    const ov_hands_work *const work = hands->work;
    for (; hands->committed < work->count && hands->state[hands->committed] == DONE;
         ++hands->committed)
        if (work->commit)
            work->commit(hands->committed, work->user);
}

/* Does one task, with the lock open meanwhile. */
static ovoid_status do_task(ov_hands *hands, ovoid_context *context, size_t number, size_t task) {
    const ov_hands_work *const work = hands->work;
    hands->state[task] = TAKEN;
    if (work->begin)
        work->begin(task, work->user);
    pthread_mutex_unlock(&hands->lock);
    const ovoid_status status = work->task(context, number, task, work->user);
    ov_buffers_trim(context);
    pthread_mutex_lock(&hands->lock);
    hands->state[task] = status == OVOID_OK ? DONE : FREE;
    commit(hands);
    pthread_cond_broadcast(&hands->changed);
    return status;
}

/* ---- the others ------------------------------------------------------------------------------ */

static bool on_progress(const ovoid_progress *progress, void *user) {
    ov_hands *const hands = user;
    (void)progress;
    pthread_mutex_lock(&hands->lock);
    const bool go_on = !hands->stop;
    pthread_mutex_unlock(&hands->lock);
    return go_on;
}

/* One whose task fails takes up no other. */
static void *run(void *user) {
    hand *const h = user;
    ov_hands *const hands = h->of;
    ovoid_status status = OVOID_OK;
    ov_progress_begin(h->context, "measure");
    pthread_mutex_lock(&hands->lock);
    while (status == OVOID_OK && !hands->stop && hands->committed < hands->work->count) {
        const size_t task = next_task(hands);
        if (task < hands->work->count)
            status = do_task(hands, h->context, h->number, task);
        else
            pthread_cond_wait(&hands->changed, &hands->lock);
    }
    pthread_mutex_unlock(&hands->lock);
    ov_progress_end(h->context);
    return NULL;
}

/* Whoever cannot have a context, or a thread, is not there. */
static void *open_hand(void *user) {
    hand *const h = user;
    if (ovoid_context_create(&h->context) != OVOID_OK)
        return NULL;
    ovoid_context_on_progress(h->context, on_progress, h->of);
    if (ov_device_open_again(h->of->context, 0, h->context) != OVOID_OK)
        ovoid_context_destroy(&h->context);
    return NULL;
}

static void start(hand *h, void *(*what)(void *)) {
    h->at_work = pthread_create(&h->thread, NULL, what, h) == 0;
}

static void await(hand *h) {
    if (h->at_work)
        pthread_join(h->thread, NULL);
    h->at_work = false;
}

/* All at a time, as drivers take long for it, and while the caller's context is left alone. Its
 * first kernel comes before, so that the device is tested, and programs are compiled, once. */
static ovoid_status open_others(ov_hands *hands) {
    ov_kernel first = {0};
    const ovoid_status status = ov_kernel_create(hands->context, "distance", "distances", &first);
    ov_kernel_destroy(&first);
    if (status != OVOID_OK)
        return status;
    for (size_t n = 1; n < hands->count; ++n) {
        hands->hand[n] = (hand){.of = hands, .number = n};
        start(&hands->hand[n], open_hand);
    }
    for (size_t n = 1; n < hands->count; ++n)
        await(&hands->hand[n]);
    hands->opened = true;
    return OVOID_OK;
}

static ovoid_status begin_others(ov_hands *hands) {
    const size_t others = hands->work->count < hands->count ? hands->work->count : hands->count;
    if (others > 1 && !hands->opened) {
        const ovoid_status status = open_others(hands);
        if (status != OVOID_OK)
            return status;
    }
    for (size_t n = 1; n < others; ++n)
        if (hands->hand[n].context)
            start(&hands->hand[n], run);
    return OVOID_OK;
}

static void end_others(ov_hands *hands) {
    for (size_t n = 1; n < hands->count; ++n)
        await(&hands->hand[n]);
}

/* ---- the caller ------------------------------------------------------------------------------ */

static void wait_a_little(ov_hands *hands) {
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += (long)(ASK_EVERY * 1e9);
    until.tv_sec += until.tv_nsec / 1000000000;
    until.tv_nsec %= 1000000000;
    pthread_cond_timedwait(&hands->changed, &hands->lock, &until);
}

/* With the lock, which is open while the caller is asked. */
static ovoid_status ask(ov_hands *hands) {
    const size_t done = hands->committed, count = hands->work->count;
    pthread_mutex_unlock(&hands->lock);
    const ovoid_status status = ov_progress_step(hands->context, done, count);
    pthread_mutex_lock(&hands->lock);
    return status;
}

static ovoid_status do_all(ov_hands *hands) {
    ovoid_status status = OVOID_OK;
    pthread_mutex_lock(&hands->lock);
    while (hands->committed < hands->work->count) {
        OV_TRY(ask(hands));
        const size_t task = next_task(hands);
        if (task < hands->work->count)
            OV_TRY(do_task(hands, hands->context, 0, task));
        else if (hands->committed < hands->work->count)
            wait_a_little(hands);
    }
cleanup:
    hands->stop = status != OVOID_OK;
    pthread_cond_broadcast(&hands->changed);
    pthread_mutex_unlock(&hands->lock);
    return status;
}

ovoid_status ov_hands_do(ov_hands *hands, const ov_hands_work *work) {
    if (work->count == 0)
        return OVOID_OK;
    hands->work = work;
    hands->committed = 0;
    hands->stop = false;
    hands->state = ov_alloc(hands->context, work->count, sizeof *hands->state, "tasks");
    if (!hands->state)
        return OVOID_ERROR_MEMORY;
    ovoid_status status = begin_others(hands);
    if (status == OVOID_OK)
        status = do_all(hands);
    end_others(hands);
    free(hands->state);
    hands->state = NULL;
    return status;
}
