/*
 * Several processes that share a fit (ovoid_exchange): how they meet, talk and part. Each message
 * is heard by all, that of its sender too.
 *
 * Ranks stay in step as each gather is one of all: a rank that fails, wherever it does, tells so in
 * the next one, and all leave then. The work they share is in sharing.h.
 */
#ifndef OV_FIT_RANKS_H
#define OV_FIT_RANKS_H

#include "fit/parts/bytes.h"

/* {0}: there is one process. */
typedef struct ov_ranks {
    const ovoid_exchange *exchange;
    uint64_t *sizes;   /* room for numbers of each rank */
    uint32_t *workers; /* of each rank: so many it last said that it has */
    bool over;         /* all have been told that it failed, or that it is done */
    bool alike;        /* all have equal devices */
} ov_ranks;

static inline bool ov_ranks_shared(const ov_ranks *ranks) {
    return ranks->exchange != NULL;
}

/* Whether this is the process that reads and writes files: the only one, or rank 0. */
static inline bool ov_ranks_first(const ov_ranks *ranks) {
    return !ranks->exchange || ranks->exchange->rank == 0;
}

/* Meets the other ranks, if options have an exchange, and finds out whether all fit the same.
 * `start` stands for what the fit begins with, where that is not the atoms. Opens the device. */
ovoid_status ov_ranks_begin(ovoid_context *context, const ovoid_fit_options *options,
                            const double *xyzr, size_t atoms, uint64_t start, ov_ranks *ranks);

/* The last word of this rank, however it ended, where it has not been said yet; returns how all of
 * them ended. */
ovoid_status ov_ranks_end(ovoid_context *context, ov_ranks *ranks, ovoid_status status);

/* ---- messages -------------------------------------------------------------------------------- */

/* What a rank says: how it ended, and what it has made of parts. */
typedef struct ov_speech {
    ovoid_status status; /* the context has its text */
    bool leaving;        /* it has left the work that the others may be at */
    uint32_t workers;    /* that it has for parts */
    size_t parts;
    const bool *have; /* of each part, whether pack() is to tell of it; NULL: of none */
    ovoid_status (*pack)(ovoid_context *context, size_t part, ov_bytes *to, void *user);
    void *user;
} ov_speech;

/* What all said. */
typedef struct ov_heard {
    unsigned char *bytes; /* of all messages */
    size_t count;
    ovoid_status status; /* the first failure, or of the first that was stopped if nothing failed */
    uint32_t rank;       /* whose it is, with its text */
    const char *text;
    size_t length;
    bool leaving; /* somebody is: parts are of no use */
} ov_heard;

/* Says it, and hears all. at[p], of so many parts, gets what was told of part p, no bytes where
 * nothing was, and lives as long as *heard, which is to be destroyed; a status that is told is no
 * failure of this. */
ovoid_status ov_ranks_say(ovoid_context *context, ov_ranks *ranks, const ov_speech *speech,
                          ov_reading *at, ov_heard *heard);
void ov_heard_destroy(ov_heard *heard);

/* The status that was told, with its text and rank as the context's error. */
ovoid_status ov_heard_tell(ovoid_context *context, const ov_heard *heard);

/* For what cannot have been sent: nothing more is exchanged. */
ovoid_status ov_ranks_garbled(ovoid_context *context, ov_ranks *ranks);

#endif
