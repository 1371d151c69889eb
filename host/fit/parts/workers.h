/*
 * Work on the parts of a molecule, one after the other or side by side: then by the workers of the
 * context's crew, or of one for this call, each with a thread. Which one has which part, and when,
 * changes nothing about what comes of it: where devices differ, parts are dealt out beforehand.
 */
#ifndef OV_FIT_WORKERS_H
#define OV_FIT_WORKERS_H

#include "fit/parts/times.h"
#include "measure/partition.h"

/* What this process has done since it last met the others, and what it may go on with. */
typedef struct ov_meeting {
    ovoid_status status; /* not OVOID_OK: it has failed here, with the context's error */
    uint32_t workers;    /* so many are at work here */
    const bool *made;    /* of each part, whether it was done since */
    bool *granted;       /* gets true for those to be worked on here, each once */
    size_t done;         /* gets how many parts are done, of all */
    bool over;           /* gets whether that is all of them */
} ov_meeting;

typedef struct ov_part_work {
    const bool *todo; /* of each part, whether it is to be worked on; NULL: all are */
    bool in_turn;     /* a part waits for those near it of earlier colours */
    /* The work itself; `done` parts are. It may read what belongs to parts that it waited for, and
     * changes nothing that others read. */
    ovoid_status (*task)(ovoid_context *context, size_t part, size_t done, void *user);
    /* Called after the task, for one part at a time: from then on others may read what it made. */
    ovoid_status (*commit)(ovoid_context *context, size_t part, void *user);
    /* Where other processes work on parts as well, else NULL: called on the caller's thread again
     * and again, while workers are at what was granted, until the work is over or this fails. What
     * is granted waits for nothing, and commit is not called. */
    ovoid_status (*meet)(ovoid_context *context, ov_meeting *meeting, void *user);
    ov_task_time *time; /* of each part: gets when its task was done; NULL: is not told */
    void *user;
} ov_part_work;

/* `jobs` at a time on each device of the context's list. A part whose device fails is taken by a
 * worker of another one, so that a task that failed is to have changed nothing; any other failure,
 * and that of the last device, ends it all. The caller is asked, and told warnings, on its own
 * thread alone. *most, if not NULL, gets how many were at work at most. */
ovoid_status ov_parts_work(ovoid_context *context, const ov_partition *partition, size_t jobs,
                           const ov_part_work *work, uint32_t *most);

#endif
