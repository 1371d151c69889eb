#include "base/parallel.h"

#include <pthread.h>
#include <stdbool.h>
#include <unistd.h>

/* Cores for each thread, as the device's driver may be at work beside it, and threads at most: to
 * begin one takes tens of microseconds. */
#define CORES_EACH 2
#define THREADS_PAY 8
#define THREADS_MOST 16

size_t ov_cores(void) {
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    return cores > 1 ? (size_t)cores : 1;
}

static size_t limit;

void ov_parallel_limit(size_t threads) {
    limit = threads;
}

static size_t threads_of(size_t count) {
    const size_t cores = limit > 0 ? 0 : ov_cores();
    const size_t pay = cores > CORES_EACH ? cores / CORES_EACH : 1;
    size_t threads = limit > 0 ? limit : pay < THREADS_PAY ? pay : THREADS_PAY;
    threads = threads < THREADS_MOST ? threads : THREADS_MOST;
    return threads < count ? threads : count;
}

/* The parts from `first` on, `stride` apart. */
typedef struct share {
    size_t first, stride, count;
    void (*part)(size_t k, void *user);
    void *user;
    pthread_t thread;
    bool begun;
} share;

static void *run(void *of) {
    const share *const s = of;
    for (size_t k = s->first; k < s->count; k += s->stride)
        s->part(k, s->user);
    return NULL;
}

void ov_parallel(size_t count, void (*part)(size_t k, void *user), void *user) {
    share shares[THREADS_MOST];
    const size_t threads = threads_of(count);
    for (size_t n = 0; n < threads; ++n)
        shares[n] =
            (share){.first = n, .stride = threads, .count = count, .part = part, .user = user};
    for (size_t n = 1; n < threads; ++n)
        shares[n].begun = pthread_create(&shares[n].thread, NULL, run, &shares[n]) == 0;
    for (size_t n = 0; n < threads; ++n)
        if (!shares[n].begun)
            run(&shares[n]);
    for (size_t n = 1; n < threads; ++n)
        if (shares[n].begun)
            pthread_join(shares[n].thread, NULL);
}
