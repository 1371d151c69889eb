#include "fit/parts/rounds.h"

#include "base/progress.h"

#include <stdlib.h>
#include <string.h>

/* With a checkpoint a round is no longer than so many parts of each worker, so that no more than
 * these are lost where a rank dies. */
#define ROUND_PARTS 4

typedef struct round {
    ov_ranks *ranks;
    const ov_partition *cut;
    const ov_shared_work *shared;
    bool *left;     /* of each part, whether it is still to be worked on, */
    bool *mine;     /* whether it is this rank's in this round, */
    bool *finished; /* and whether it was done here */
    ov_reading *at; /* what the ranks tell of it */
    size_t *ready;  /* the parts of this round */
    size_t ready_count;
    size_t done, foreign; /* parts that are done, and those of the others in `left` */
} round;

static bool may_begin(const round *r, size_t p) {
    const ov_part *const part = r->cut->part;
    for (size_t q = 0; r->shared->work.in_turn && q < r->cut->count; ++q)
        if (r->left[q] && part[q].colour < part[p].colour && ov_parts_near(r->cut, p, q))
            return false;
    return true;
}

/* The parts that wait for none, those of earlier colours first, as many as a round takes. */
static void find_ready(round *r) {
    const ov_ranks *const ranks = r->ranks;
    const size_t most = ranks->keeps && r->shared->work.in_turn
                            ? ROUND_PARTS * (size_t)ranks->jobs * ranks->exchange->ranks
                            : r->cut->count;
    r->ready_count = 0;
    for (uint32_t colour = 0; colour < r->cut->colours; ++colour)
        for (size_t p = 0; p < r->cut->count && r->ready_count < most; ++p)
            if (r->left[p] && r->cut->part[p].colour == colour && may_begin(r, p))
                r->ready[r->ready_count++] = p;
}

/* The largest first, each to the rank with the least so far. */
static void deal(round *r) {
    uint64_t *const load = r->ranks->sizes;
    const ov_part *const part = r->cut->part;
    memset(load, 0, r->ranks->exchange->ranks * sizeof *load);
    memset(r->mine, 0, r->cut->count * sizeof *r->mine);
    for (size_t n = 1; n < r->ready_count; ++n) /* nearly in order as they are */
        for (size_t m = n; m > 0 && part[r->ready[m]].count > part[r->ready[m - 1]].count; --m) {
            const size_t before = r->ready[m - 1];
            r->ready[m - 1] = r->ready[m];
            r->ready[m] = before;
        }
    for (size_t n = 0; n < r->ready_count; ++n) {
        uint32_t least = 0;
        for (uint32_t k = 1; k < r->ranks->exchange->ranks; ++k)
            least = load[k] < load[least] ? k : least;
        load[least] += 1 + part[r->ready[n]].count;
        r->mine[r->ready[n]] = least == r->ranks->exchange->rank;
    }
    r->foreign = 0;
    for (size_t p = 0; p < r->cut->count; ++p)
        r->foreign += r->left[p] && !r->mine[p];
}

static ovoid_status task(ovoid_context *context, size_t part, size_t done, void *user) {
    const round *const r = user;
    return r->shared->work.task(context, part, done, r->shared->work.user);
}

static ovoid_status finish(ovoid_context *context, size_t part, void *user) {
    round *const r = user;
    (void)context;
    r->finished[part] = true;
    return OVOID_OK;
}

static ovoid_status work_here(ovoid_context *context, round *r, size_t jobs) {
    const ov_part_work work = {
        .todo = r->mine, .elsewhere = r->foreign, .task = task, .commit = finish, .user = r};
    memset(r->finished, 0, r->cut->count * sizeof *r->finished);
    const ovoid_status status = ov_progress_ask(context);
    return status == OVOID_OK ? ov_parts_work(context, r->cut, jobs, &work) : status;
}

/* What all have done, in the order of the parts. */
static ovoid_status commit(ovoid_context *context, round *r) {
    ovoid_status status = OVOID_OK;
    const ov_shared_work *const shared = r->shared;
    for (size_t p = 0; p < r->cut->count; ++p) {
        if (r->at[p].left == 0)
            continue;
        if (!r->finished[p])
            OV_TRY(shared->unpack(context, p, &r->at[p], shared->work.user));
        if (shared->work.commit)
            OV_TRY(shared->work.commit(context, p, shared->work.user));
        r->left[p] = false;
    }
cleanup:
    return status;
}

static ovoid_status work_round(ovoid_context *context, round *r, size_t jobs) {
    ovoid_status status = OVOID_OK;
    ov_heard all = {0};
    deal(r);
    const ov_speech speech = {.status = work_here(context, r, jobs),
                              .parts = r->cut->count,
                              .have = r->finished,
                              .pack = r->shared->pack,
                              .user = r->shared->work.user};
    OV_TRY(ov_ranks_say(context, r->ranks, &speech, r->at, &all));
    if (all.leaving && all.status == OVOID_OK)
        OV_TRY(ov_ranks_garbled(context, r->ranks)); /* they are out of step */
    if (!all.leaving)
        OV_TRY(commit(context, r));
    status = ov_heard_tell(context, &all);
cleanup:
    ov_heard_destroy(&all);
    return status;
}

static void round_destroy(round *r) {
    free(r->left);
    free(r->mine);
    free(r->finished);
    free(r->at);
    free(r->ready);
}

static ovoid_status round_create(ovoid_context *context, round *r) {
    const size_t count = r->cut->count;
    const bool *const todo = r->shared->work.todo;
    r->left = ov_alloc(context, count, sizeof *r->left, "parts of a molecule");
    r->mine = ov_alloc(context, count, sizeof *r->mine, "parts of a molecule");
    r->finished = ov_alloc(context, count, sizeof *r->finished, "parts of a molecule");
    r->at = ov_alloc(context, count, sizeof *r->at, "parts of a molecule");
    r->ready = ov_alloc(context, count, sizeof *r->ready, "parts of a molecule");
    if (!r->left || !r->mine || !r->finished || !r->at || !r->ready)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < count; ++p)
        r->left[p] = !todo || todo[p];
    return OVOID_OK;
}

ovoid_status ov_ranks_work(ovoid_context *context, ov_ranks *ranks, const ov_partition *partition,
                           size_t jobs, const ov_shared_work *work) {
    ovoid_status status = OVOID_OK;
    round r = {.ranks = ranks, .cut = partition, .shared = work};
    if (!ov_ranks_shared(ranks))
        return ov_parts_work(context, partition, jobs, &work->work);
    OV_TRY(round_create(context, &r));
    for (find_ready(&r); r.ready_count > 0; find_ready(&r))
        OV_TRY(work_round(context, &r, jobs));
cleanup:
    round_destroy(&r);
    return status;
}

ovoid_status ov_ranks_give(ovoid_context *context, ov_ranks *ranks, size_t parts, bool *have,
                           const ov_shared_work *work, ovoid_status status) {
    const bool first = ov_ranks_first(ranks);
    const ov_speech speech = {.status = status,
                              .parts = parts,
                              .have = first ? have : NULL,
                              .pack = work->pack,
                              .user = work->work.user};
    ov_heard all = {0};
    if (!ov_ranks_shared(ranks))
        return status;
    ov_reading *const at = ov_alloc(context, parts, sizeof *at, "parts of a molecule");
    if (!at)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_ranks_say(context, ranks, &speech, at, &all));
    OV_TRY(ov_heard_tell(context, &all));
    for (size_t p = 0; p < parts && !first; ++p)
        if (at[p].left > 0) {
            OV_TRY(work->unpack(context, p, &at[p], work->work.user));
            have[p] = true;
        }
cleanup:
    free(at);
    ov_heard_destroy(&all);
    return status;
}
