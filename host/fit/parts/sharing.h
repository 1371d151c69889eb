/*
 * Work on the parts of a molecule that several ranks share. While their workers are at it, the
 * ranks meet again and again: each tells what parts it has done since, all put that where it
 * belongs, and from what they all know now each finds, as the others do, who works on which part
 * next. So no rank waits for the end of another one's part but where its own parts do; each has the
 * whole model at any time; and which rank fitted what changes nothing about it. Where there is one
 * process it does what that does by itself.
 */
#ifndef OV_FIT_SHARING_H
#define OV_FIT_SHARING_H

#include "fit/parts/ranks.h"
#include "fit/parts/workers.h"

/* Work on parts, whose results can be told to other ranks. */
typedef struct ov_shared_work {
    ovoid_task_kind kind;
    ov_part_work work; /* its commit may be NULL */
    ovoid_status (*pack)(ovoid_context *context, size_t part, ov_bytes *to, void *user);
    /* Puts what another rank's task made where the task would have put it. */
    ovoid_status (*unpack)(ovoid_context *context, size_t part, ov_reading *from, void *user);
} ov_shared_work;

/* As ov_parts_work(), on all ranks, and notes when each part was worked on (times.h). What is done
 * when one of them stops is committed. */
ovoid_status ov_ranks_work(ovoid_context *context, ov_ranks *ranks, const ov_partition *partition,
                           size_t jobs, const ov_shared_work *work);

/* Tells the others what rank 0 has of the parts in `have`, which is known to rank 0 alone, and
 * marks them there. No part is committed. status: of what rank 0 did to have them. */
ovoid_status ov_ranks_give(ovoid_context *context, ov_ranks *ranks, size_t parts, bool *have,
                           const ov_shared_work *work, ovoid_status status);

#endif
