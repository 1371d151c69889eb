#include "fit/parts/sharing.h"

#include <stdlib.h>
#include <string.h>

#define NOBODY UINT32_MAX

/* A rank is granted up to so many parts for each of its workers, where plenty are left: it then has
 * the next one at hand. */
#define AHEAD 2

/* What is known of the parts on all ranks alike, but for what is this rank's. */
typedef struct sharing {
    ovoid_context *context;
    ov_ranks *ranks; /* NULL where there is one process */
    const ov_partition *cut;
    const ov_shared_work *shared;
    bool *left;       /* of each part, whether it is still to be done; */
    uint32_t *holder; /* the rank that it is granted to; */
    uint32_t *owner;  /* where ranks differ, the one it is to be granted to; else NULL */
    size_t *waits;    /* how many it waits for; */
    uint64_t *path;   /* atoms on the longest way from it over parts that wait for it */
    uint32_t *order;  /* the parts, the longest way first */
    size_t *first;    /* where in after[] each part's begin, */
    uint32_t *after;  /* which it has to come after: those near it of earlier colours */
    size_t after_capacity;
    uint32_t *holds; /* of each rank, how many it is granted; */
    uint64_t *load;  /* and atoms of all that it ever was */
    uint32_t *most;  /* and its workers, at most */
    ov_reading *at;  /* what was told of each part */
    ov_task_time *time;
    size_t count, done;
} sharing;

/* ---- which part comes after which ------------------------------------------------------------ */

static ovoid_status list_after(sharing *s, size_t p) {
    ovoid_status status = OVOID_OK;
    const ov_part *const part = s->cut->part;
    const bool *const todo = s->shared->work.todo;
    size_t n = s->first[p];
    for (size_t q = 0; s->shared->work.in_turn && q < s->count; ++q)
        if (part[q].colour < part[p].colour && (!todo || todo[q]) && ov_parts_near(s->cut, p, q)) {
            OV_TRY(ov_grow(s->context, &s->after, &s->after_capacity, n + 1, sizeof *s->after,
                           "parts of a molecule"));
            s->after[n++] = (uint32_t)q;
        }
    s->first[p + 1] = n;
    s->waits[p] = n - s->first[p];
cleanup:
    return status;
}

/* How long the way is from each part on, those of the last colour first. */
static void find_paths(sharing *s) {
    for (size_t p = 0; p < s->count; ++p)
        s->path[p] = 0;
    for (uint32_t colour = s->cut->colours; colour-- > 0;)
        for (size_t p = 0; p < s->count; ++p) {
            if (s->cut->part[p].colour != colour)
                continue;
            s->path[p] += 1 + s->cut->part[p].count;
            for (size_t n = s->first[p]; n < s->first[p + 1]; ++n)
                if (s->path[s->after[n]] < s->path[p])
                    s->path[s->after[n]] = s->path[p];
        }
}

/* By insertion: the parts of a colour are about as large as each other. */
static void sort_by_path(sharing *s) {
    for (size_t p = 0; p < s->count; ++p) {
        size_t n = p;
        for (; n > 0 && s->path[s->order[n - 1]] < s->path[p]; --n)
            s->order[n] = s->order[n - 1];
        s->order[n] = (uint32_t)p;
    }
}

/* ---- who works on what ----------------------------------------------------------------------- */

static uint32_t ranks_of(const sharing *s) {
    return s->ranks ? s->ranks->exchange->ranks : 1;
}

static uint32_t rank_of(const sharing *s) {
    return s->ranks ? s->ranks->exchange->rank : 0;
}

/* Where ranks come to different bits, parts are dealt out beforehand, the longest way first, each
 * to the rank with the least so far: so the outcome depends on how many ranks there are, and not on
 * who was faster. */
static void deal_out(sharing *s) {
    const bool in_turn = s->shared->work.in_turn;
    for (uint32_t colour = 0; colour < (in_turn ? s->cut->colours : 1); ++colour) {
        memset(s->load, 0, ranks_of(s) * sizeof *s->load);
        for (size_t n = 0; n < s->count; ++n) {
            const ov_part *const part = &s->cut->part[s->order[n]];
            uint32_t least = 0;
            if (in_turn && part->colour != colour)
                continue;
            for (uint32_t k = 1; k < ranks_of(s); ++k)
                least = s->load[k] < s->load[least] ? k : least;
            s->load[least] += 1 + part->count;
            s->owner[s->order[n]] = least;
        }
    }
    memset(s->load, 0, ranks_of(s) * sizeof *s->load);
}

static bool has_room(const sharing *s, uint32_t rank, uint32_t each) {
    return s->holds[rank] < each * s->ranks->workers[rank];
}

/* Of the ranks with room the one that has had the least work; NOBODY if none has room. */
static uint32_t find_rank(const sharing *s, size_t p, uint32_t each) {
    uint32_t found = NOBODY;
    if (s->owner)
        return has_room(s, s->owner[p], each) ? s->owner[p] : NOBODY;
    for (uint32_t k = 0; k < ranks_of(s); ++k)
        if (has_room(s, k, each) && (found == NOBODY || s->load[k] < s->load[found]))
            found = k;
    return found;
}

static bool is_ready(const sharing *s, size_t p) {
    return s->left[p] && s->holder[p] == NOBODY && s->waits[p] == 0;
}

/* Grants parts that may begin to ranks with free workers, the longest way first; then, while so
 * many are left that nobody could miss them at the end, to all as many again. */
static void grant(sharing *s, bool *granted) {
    size_t ready = 0, workers = 0;
    for (uint32_t k = 0; k < ranks_of(s); ++k)
        workers += s->ranks->workers[k];
    for (size_t p = 0; p < s->count; ++p)
        ready += is_ready(s, p);
    for (uint32_t each = 1; each <= AHEAD; ++each)
        for (size_t n = 0; n < s->count && (each == 1 ? ready > 0 : ready > 2 * workers); ++n) {
            const size_t p = s->order[n];
            const uint32_t rank = is_ready(s, p) ? find_rank(s, p, each) : NOBODY;
            if (rank == NOBODY)
                continue;
            s->holder[p] = rank;
            ++s->holds[rank];
            s->load[rank] += 1 + s->cut->part[p].count;
            granted[p] = rank == rank_of(s);
            --ready;
        }
}

/* ---- what was done --------------------------------------------------------------------------- */

static ovoid_status note(const sharing *s, size_t p, uint32_t rank) {
    const ov_task_time *const time = &s->time[p];
    const ovoid_task task = {.kind = s->shared->kind,
                             .number = (uint32_t)p,
                             .rank = rank,
                             .worker = (uint32_t)time->worker,
                             .atoms = (uint32_t)s->cut->part[p].count,
                             .began = time->began,
                             .seconds = time->seconds,
                             .after_count = s->first[p + 1] - s->first[p],
                             .after = s->after + s->first[p]};
    return ov_times_add(s->context, &task);
}

static void free_those_behind(sharing *s, size_t done) {
    for (size_t p = 0; p < s->count && s->shared->work.in_turn; ++p)
        for (size_t n = s->first[p]; n < s->first[p + 1]; ++n)
            s->waits[p] -= s->after[n] == done;
}

/* What all have done since they last met, in the order of the parts. */
static ovoid_status commit(ovoid_context *context, sharing *s) {
    ovoid_status status = OVOID_OK;
    const ov_shared_work *const shared = s->shared;
    for (size_t p = 0; p < s->count; ++p) {
        ov_task_time time;
        if (s->at[p].left == 0)
            continue;
        if (!s->left[p] || s->holder[p] == NOBODY || !ov_bytes_take(&s->at[p], &time, sizeof time))
            OV_TRY(ov_ranks_garbled(context, s->ranks));
        s->time[p] = time;
        if (s->holder[p] != rank_of(s))
            OV_TRY(shared->unpack(context, p, &s->at[p], shared->work.user));
        if (shared->work.commit)
            OV_TRY(shared->work.commit(context, p, shared->work.user));
        OV_TRY(note(s, p, s->holder[p]));
        s->left[p] = false;
        ++s->done;
        --s->holds[s->holder[p]];
        free_those_behind(s, p);
    }
cleanup:
    return status;
}

static ovoid_status pack(ovoid_context *context, size_t part, ov_bytes *to, void *user) {
    const sharing *const s = user;
    ov_task_time time = s->time[part];
    time.began -= ov_times_origin(context);
    const ovoid_status status = ov_bytes_put(context, to, &time, sizeof time);
    return status == OVOID_OK ? s->shared->pack(context, part, to, s->shared->work.user) : status;
}

static ovoid_status meet(ovoid_context *context, ov_meeting *meeting, void *user) {
    ovoid_status status = OVOID_OK;
    sharing *const s = user;
    ov_heard all = {0};
    const ov_speech speech = {.status = meeting->status,
                              .workers = meeting->workers,
                              .parts = s->count,
                              .have = meeting->made,
                              .pack = pack,
                              .user = s};
    OV_TRY(ov_ranks_say(context, s->ranks, &speech, s->at, &all));
    if (all.leaving && all.status == OVOID_OK)
        OV_TRY(ov_ranks_garbled(context, s->ranks)); /* they are out of step */
    if (!all.leaving)
        OV_TRY(commit(context, s));
    for (uint32_t k = 0; k < ranks_of(s); ++k)
        s->most[k] = s->ranks->workers[k] > s->most[k] ? s->ranks->workers[k] : s->most[k];
    meeting->done = s->done;
    meeting->over = s->done == s->count;
    OV_TRY(ov_heard_tell(context, &all));
    grant(s, meeting->granted);
cleanup:
    ov_heard_destroy(&all);
    return status;
}

/* ---- one process, or several ----------------------------------------------------------------- */

static ovoid_status task(ovoid_context *context, size_t part, size_t done, void *user) {
    const sharing *const s = user;
    return s->shared->work.task(context, part, done, s->shared->work.user);
}

static ovoid_status commit_alone(ovoid_context *context, size_t part, void *user) {
    const sharing *const s = user;
    const ov_part_work *const work = &s->shared->work;
    s->left[part] = false;
    return work->commit ? work->commit(context, part, work->user) : OVOID_OK;
}

/* With what was done where it was stopped, too. */
static ovoid_status note_all(sharing *s) {
    ovoid_status status = OVOID_OK;
    const bool *const todo = s->shared->work.todo;
    for (size_t p = 0; p < s->count; ++p)
        if (!s->left[p] && (!todo || todo[p])) {
            s->time[p].began -= ov_times_origin(s->context);
            OV_TRY(note(s, p, 0));
        }
cleanup:
    return status;
}

static ovoid_status work_alone(sharing *s, size_t jobs) {
    ov_part_work work = s->shared->work;
    work.task = task;
    work.commit = commit_alone;
    work.time = s->time;
    work.user = s;
    const ovoid_status status = ov_parts_work(s->context, s->cut, jobs, &work, s->most);
    const ovoid_status noted = note_all(s);
    return status == OVOID_OK ? noted : status;
}

static ovoid_status work_together(sharing *s, size_t jobs) {
    const ov_part_work work = {
        .todo = s->shared->work.todo, .task = task, .meet = meet, .time = s->time, .user = s};
    sort_by_path(s);
    if (s->owner)
        deal_out(s);
    return ov_parts_work(s->context, s->cut, jobs, &work, NULL);
}

static void sharing_destroy(sharing *s) {
    free(s->left);
    free(s->holder);
    free(s->owner);
    free(s->waits);
    free(s->path);
    free(s->order);
    free(s->first);
    free(s->after);
    free(s->holds);
    free(s->load);
    free(s->most);
    free(s->at);
    free(s->time);
}

static ovoid_status make_room(sharing *s) {
    static const char what[] = "parts of a molecule";
    const size_t ranks = ranks_of(s);
    s->left = ov_alloc(s->context, s->count, sizeof *s->left, what);
    s->holder = ov_alloc(s->context, s->count, sizeof *s->holder, what);
    s->waits = ov_alloc(s->context, s->count, sizeof *s->waits, what);
    s->path = ov_alloc(s->context, s->count, sizeof *s->path, what);
    s->order = ov_alloc(s->context, s->count, sizeof *s->order, what);
    s->first = ov_alloc(s->context, s->count + 1, sizeof *s->first, what);
    s->at = ov_alloc(s->context, s->count, sizeof *s->at, what);
    s->time = ov_alloc(s->context, s->count, sizeof *s->time, what);
    s->holds = ov_alloc(s->context, ranks, sizeof *s->holds, what);
    s->load = ov_alloc(s->context, ranks, sizeof *s->load, what);
    s->most = ov_alloc(s->context, ranks, sizeof *s->most, what);
    if (s->ranks && !s->ranks->alike)
        s->owner = ov_alloc(s->context, s->count, sizeof *s->owner, what);
    const bool whole = s->left && s->holder && s->waits && s->path && s->order && s->first &&
                       s->at && s->time && s->holds && s->load && s->most;
    return whole && (s->owner || !s->ranks || s->ranks->alike) ? OVOID_OK : OVOID_ERROR_MEMORY;
}

static ovoid_status prepare(sharing *s) {
    ovoid_status status = OVOID_OK;
    const bool *const todo = s->shared->work.todo;
    OV_TRY(make_room(s));
    for (size_t p = 0; p < s->count; ++p) {
        s->left[p] = !todo || todo[p];
        s->done += !s->left[p];
        s->holder[p] = NOBODY;
        OV_TRY(list_after(s, p));
    }
    find_paths(s);
cleanup:
    return status;
}

ovoid_status ov_ranks_work(ovoid_context *context, ov_ranks *ranks, const ov_partition *partition,
                           size_t jobs, const ov_shared_work *work) {
    ovoid_status status = OVOID_OK;
    const double began = ov_seconds();
    sharing s = {.context = context,
                 .ranks = ov_ranks_shared(ranks) ? ranks : NULL,
                 .cut = partition,
                 .shared = work,
                 .count = partition->count};
    OV_TRY(prepare(&s));
    if (s.done == s.count)
        goto cleanup;
    status = s.ranks ? work_together(&s, jobs) : work_alone(&s, jobs);
    ov_times_end_stage(context, ov_seconds() - began, s.most);
cleanup:
    sharing_destroy(&s);
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
