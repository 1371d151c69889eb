/*
 * Those who work on parts side by side: workers with a context each, on the devices of the list of
 * the context that fits. A crew is there for a whole fit, so that each of its workers compiles the
 * kernels once, and keeps its buffers.
 */
#ifndef OV_FIT_CREW_H
#define OV_FIT_CREW_H

#include "base/base.h"

#include <pthread.h>

typedef struct ov_worker {
    ovoid_context *context; /* NULL: it is dismissed, and all of it is released */
    size_t device;          /* of the list */
    bool at_work;           /* its thread is there to take parts */
    bool dismissed;         /* it takes no part any more */
    bool in_company;        /* others were at work on its device when it began its part */
    pthread_t thread;
    void *yard; /* of workers.c, while it is at work */
} ov_worker;

typedef struct ov_crew_device {
    uint64_t hash; /* devices of one hash come to the same bits */
    bool lost;     /* it failed, and is not used any more */
} ov_crew_device;

typedef struct ov_crew {
    ovoid_context *context; /* of the caller */
    ov_crew_device *device; /* those of the list */
    size_t devices;
    bool alike; /* all of one hash */
    ov_worker *worker;
    size_t workers, capacity;
    pthread_mutex_t lock; /* of the notes alone */
    char **note;          /* warnings, each once, */
    size_t notes, notes_capacity;
    size_t passed; /* and so many of them told */
} ov_crew;

/* Makes context->crew, without workers yet, and opens the default device if none is. The end
 * releases it, tells what was not told yet, and drops devices that were lost from the context's
 * list, its own among them. Without a beginning it does nothing. */
ovoid_status ov_crew_begin(ovoid_context *context);
void ov_crew_end(ovoid_context *context);

/* Sees to it that each device has a worker, and more of them, up to `each`, while all together are
 * fewer than `most`. A device that cannot be opened is lost, unless it is the last. */
ovoid_status ov_crew_hire(ov_crew *crew, size_t each, size_t most);

/* How many are at work and not dismissed: of the device; of devices of this hash; of all. */
size_t ov_crew_on(const ov_crew *crew, size_t device);
size_t ov_crew_of(const ov_crew *crew, uint64_t hash);
size_t ov_crew_left(const ov_crew *crew);

/* The worker's device failed it with this status and its context's error. Of memory, the worker
 * alone is dismissed, or none if it is the last one there, where others had worked beside it; else
 * the device is lost, and all of its workers are dismissed. */
void ov_crew_blame(ov_crew *crew, ov_worker *worker, ovoid_status status);

/* Tells the caller's context, on whose thread it is called, the warnings that have come. */
void ov_crew_tell(ov_crew *crew);

#endif
