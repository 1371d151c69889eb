/*
 * Work on the parts of a molecule, one after the other or side by side: then by the workers of the
 * context's crew, or of one for this call, each with a thread. Which one has which part, and when,
 * changes nothing about what comes of it: where devices differ, parts are dealt out beforehand.
 */
#ifndef OV_FIT_WORKERS_H
#define OV_FIT_WORKERS_H

#include "measure/partition.h"

typedef struct ov_part_work {
    const bool *todo; /* of each part, whether it is to be worked on; NULL: all are */
    size_t elsewhere; /* of those that are not, how many are not done either: others work on them */
    bool in_turn;     /* a part waits for those near it of earlier colours */
    /* The work itself; `done` parts are. It may read what belongs to parts that it waited for, and
     * changes nothing that others read. */
    ovoid_status (*task)(ovoid_context *context, size_t part, size_t done, void *user);
    /* Called after the task, for one part at a time: from then on others may read what it made. */
    ovoid_status (*commit)(ovoid_context *context, size_t part, void *user);
    void *user;
} ov_part_work;

/* `jobs` at a time on each device of the context's list. A part whose device fails is taken by a
 * worker of another one, so that a task that failed is to have changed nothing; any other failure,
 * and that of the last device, ends it all. The caller is asked, and told warnings, on its own
 * thread alone. */
ovoid_status ov_parts_work(ovoid_context *context, const ov_partition *partition, size_t jobs,
                           const ov_part_work *work);

#endif
