#include "fit/parts/ranks.h"

#include "device/device.h"
#include "fit/options.h"

#include <stdlib.h>
#include <string.h>

/* What each rank's message of a gather begins with; then its text and its parts, of each a
 * part_head and its bytes. No bytes at all: nothing is new. */
typedef struct head {
    uint64_t status;
    uint64_t leaving; /* not 0: it has left the work that the others may be at */
    uint64_t workers;
    uint64_t text, parts;
} head;

typedef struct part_head {
    uint64_t part, bytes;
} part_head;

/* ---- gathering ------------------------------------------------------------------------------- */

static uint32_t rank_of(const ov_ranks *r) {
    return r->exchange->rank;
}

static uint32_t ranks_of(const ov_ranks *r) {
    return r->exchange->ranks;
}

static ovoid_status call(ovoid_context *context, ov_ranks *r, const void *mine, void *all,
                         const uint64_t *sizes) {
    ++context->calling;
    const int result = r->exchange->gather(mine, all, sizes, r->exchange->user);
    --context->calling;
    if (result == 0)
        return OVOID_OK;
    r->over = true; /* nobody hears any more */
    return ov_fail(context, OVOID_ERROR_IO, "the exchange with the other ranks failed (%d)",
                   result);
}

/* A number of each rank, into r->sizes. */
static ovoid_status gather_numbers(ovoid_context *context, ov_ranks *r, uint64_t mine) {
    uint64_t *const each = r->sizes + ranks_of(r);
    for (uint32_t n = 0; n < ranks_of(r); ++n)
        each[n] = sizeof mine;
    return call(context, r, &mine, r->sizes, each);
}

/* All bytes of all, of which r->sizes[2 * ranks + n] are rank n's: how many, then whether everybody
 * has room for them, then themselves. */
static ovoid_status gather(ovoid_context *context, ov_ranks *r, const ov_bytes *mine,
                           ov_heard *all) {
    ovoid_status status = OVOID_OK;
    uint64_t *const sizes = r->sizes + 2 * (size_t)ranks_of(r);
    ov_heard made = {0};
    OV_TRY(gather_numbers(context, r, mine->count));
    memcpy(sizes, r->sizes, ranks_of(r) * sizeof *sizes);
    for (uint32_t n = 0; n < ranks_of(r); ++n)
        made.count += (size_t)sizes[n];
    if (made.count == 0)
        return OVOID_OK; /* nobody has anything to say */
    made.bytes = ov_alloc(context, made.count, 1, "what ranks exchange");
    OV_TRY(gather_numbers(context, r, made.bytes != NULL));
    for (uint32_t n = 0; n < ranks_of(r); ++n)
        if (!r->sizes[n]) {
            r->over = true;
            OV_TRY(ov_fail(context, OVOID_ERROR_MEMORY,
                           "rank %lu: out of memory for what ranks exchange (%zu bytes)",
                           (unsigned long)n, made.count));
        }
    OV_TRY(call(context, r, mine->data, made.bytes, sizes));
    *all = made;
    made.bytes = NULL;
cleanup:
    free(made.bytes);
    return status;
}

/* ---- messages -------------------------------------------------------------------------------- */

static ovoid_status add_part(ovoid_context *context, size_t part, const ov_speech *speech,
                             ov_bytes *to) {
    ovoid_status status = OVOID_OK;
    part_head h = {.part = part};
    const size_t at = to->count;
    OV_TRY(ov_bytes_put(context, to, &h, sizeof h));
    OV_TRY(speech->pack(context, part, to, speech->user));
    h.bytes = to->count - at - sizeof h;
    memcpy(to->data + at, &h, sizeof h);
cleanup:
    return status;
}

static bool is_quiet(const ov_ranks *r, const head *h) {
    return h->status == OVOID_OK && !h->leaving && h->parts == 0 &&
           h->workers == r->workers[rank_of(r)];
}

static ovoid_status compose(ovoid_context *context, const ov_ranks *r, const ov_speech *speech,
                            ov_bytes *to) {
    ovoid_status status = OVOID_OK;
    const size_t parts = speech->have ? speech->parts : 0;
    const char *const text = speech->status == OVOID_OK ? "" : ovoid_context_error(context);
    head h = {.status = (uint64_t)speech->status,
              .leaving = speech->leaving,
              .workers = speech->workers,
              .text = strlen(text)};
    for (size_t p = 0; p < parts; ++p)
        h.parts += speech->have[p];
    if (is_quiet(r, &h))
        return OVOID_OK;
    OV_TRY(ov_bytes_put(context, to, &h, sizeof h));
    OV_TRY(ov_bytes_put(context, to, text, (size_t)h.text));
    for (size_t p = 0; p < parts; ++p)
        if (speech->have[p])
            OV_TRY(add_part(context, p, speech, to));
cleanup:
    return status;
}

static void weigh(const head *h, const unsigned char *text, uint32_t rank, ov_heard *all) {
    const ovoid_status status = (ovoid_status)h->status;
    all->leaving = all->leaving || h->leaving;
    if (status == OVOID_OK || (all->status != OVOID_OK && (all->status != OVOID_ERROR_CANCELLED ||
                                                           status == OVOID_ERROR_CANCELLED)))
        return;
    all->status = status;
    all->rank = rank;
    all->text = (const char *)text;
    all->length = (size_t)h->text;
}

ovoid_status ov_ranks_garbled(ovoid_context *context, ov_ranks *ranks) {
    ranks->over = true; /* what was sent to one was sent to all */
    return ov_fail(context, OVOID_ERROR_IO,
                   "the exchange with the other ranks failed: what they sent is not what arrived");
}

static ovoid_status read_rank(ovoid_context *context, ov_ranks *r, uint32_t rank, size_t parts,
                              ov_reading *from, ov_reading *at, ov_heard *all) {
    head h;
    part_head of;
    if (!ov_bytes_take(from, &h, sizeof h) || h.text > from->left)
        return ov_ranks_garbled(context, r);
    weigh(&h, from->next, rank, all);
    r->workers[rank] = (uint32_t)h.workers;
    from->next += h.text;
    from->left -= (size_t)h.text;
    for (uint64_t n = 0; n < h.parts; ++n) {
        if (!ov_bytes_take(from, &of, sizeof of) || of.bytes > from->left)
            return ov_ranks_garbled(context, r);
        if (of.part < parts)
            at[of.part] = (ov_reading){from->next, (size_t)of.bytes};
        from->next += of.bytes;
        from->left -= (size_t)of.bytes;
    }
    return OVOID_OK;
}

ovoid_status ov_ranks_say(ovoid_context *context, ov_ranks *ranks, const ov_speech *speech,
                          ov_reading *at, ov_heard *heard) {
    ovoid_status status = OVOID_OK;
    /* What is said where there is no memory for what is to be said. */
    head h = {.status = OVOID_ERROR_MEMORY, .leaving = true};
    const ov_bytes least = {.data = (unsigned char *)&h, .count = sizeof h};
    ov_bytes mine = {0};
    if (speech->parts > 0)
        memset(at, 0, speech->parts * sizeof *at);
    const ovoid_status made = compose(context, ranks, speech, &mine);
    OV_TRY(gather(context, ranks, made == OVOID_OK ? &mine : &least, heard));
    ov_reading from = {heard->bytes, heard->count};
    for (uint32_t rank = 0; rank < ranks_of(ranks) && heard->count > 0; ++rank)
        if (ranks->sizes[2 * (size_t)ranks_of(ranks) + rank] > 0)
            OV_TRY(read_rank(context, ranks, rank, speech->parts, &from, at, heard));
    ranks->over = ranks->over || heard->status != OVOID_OK;
cleanup:
    ov_bytes_destroy(&mine);
    return status;
}

void ov_heard_destroy(ov_heard *heard) {
    free(heard->bytes);
    *heard = (ov_heard){0};
}

ovoid_status ov_heard_tell(ovoid_context *context, const ov_heard *heard) {
    const char *const text = heard->length > 0 ? heard->text : ovoid_status_name(heard->status);
    const int length = (int)(heard->length > 0 ? heard->length : strlen(text));
    return heard->status == OVOID_OK ? OVOID_OK
                                     : ov_fail(context, heard->status, "rank %lu: %.*s",
                                               (unsigned long)heard->rank, length, text);
}

/* ---- beginning and end ----------------------------------------------------------------------- */

/* What is to be the same on all ranks, and what rank 0 does. */
typedef struct hello {
    uint64_t order, version, input, options, parts, start; /* the same */
    uint64_t device;                                       /* 0: none could be opened */
    uint64_t keeps;
} hello;

static hello hello_of(const ovoid_fit_options *options, const double *xyzr, size_t atoms,
                      uint64_t start) {
    return (hello){.order = 0x0102030405060708u,
                   .version = ov_hash(ovoid_version(), strlen(ovoid_version())),
                   .input = ov_hash(xyzr, 4 * atoms * sizeof *xyzr),
                   .options = ov_fit_options_hash(options),
                   .parts = options->parts.atoms | (uint64_t)options->parts.symmetry << 32,
                   .start = start,
                   .keeps = options->parts.checkpoint != NULL};
}

/* What one rank has that rank 0 has not; NULL: nothing. */
static const char *difference(const hello *a, const hello *b) {
    if (a->order != b->order)
        return "is a machine of another byte order";
    if (a->version != b->version)
        return "runs another version of ovoid";
    if (a->input != b->input)
        return "has other atoms";
    if (a->options != b->options)
        return "has other options";
    if (a->parts != b->parts || a->keeps != b->keeps)
        return "has other options of parts";
    return a->start != b->start ? "begins with another model" : NULL;
}

static ovoid_status compare(ovoid_context *context, ov_ranks *r, const hello *all) {
    bool equal = true;
    for (uint32_t n = 1; n < ranks_of(r); ++n) {
        const char *const what = difference(&all[n], &all[0]);
        equal = equal && (all[n].device == all[0].device || !all[n].device || !all[0].device);
        if (!what)
            continue;
        r->over = true;
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "rank %lu %s, compared with rank 0: all ranks share one fit",
                       (unsigned long)n, what);
    }
    r->alike = equal;
    if (!equal && rank_of(r) == 0)
        ov_warn(context, "the ranks have different devices or drivers: with another number of "
                         "ranks the last bits of the model may be others");
    return OVOID_OK;
}

/* Whatever fails before all have greeted each other leaves the others waiting: memory for it is
 * there when it begins. */
ovoid_status ov_ranks_begin(ovoid_context *context, const ovoid_fit_options *options,
                            const double *xyzr, size_t atoms, uint64_t start, ov_ranks *ranks) {
    ovoid_status status = OVOID_OK;
    const ovoid_exchange *const exchange = options->parts.exchange;
    hello *all = NULL;
    if (!exchange)
        return OVOID_OK;
    OV_TRY(ov_exchange_check(context, exchange));
    ranks->sizes = ov_alloc(context, 3 * (size_t)exchange->ranks, sizeof *ranks->sizes, "ranks");
    all = ov_alloc(context, exchange->ranks, sizeof *all, "ranks");
    ranks->workers = ov_alloc(context, exchange->ranks, sizeof *ranks->workers, "ranks");
    if (!ranks->sizes || !ranks->workers || !all) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    ranks->exchange = exchange;
    hello mine = hello_of(options, xyzr, atoms, start);
    const ovoid_status opened = ov_device_hash(context, &mine.device);
    for (uint32_t n = 0; n < exchange->ranks; ++n)
        ranks->sizes[n] = sizeof mine;
    OV_TRY(call(context, ranks, &mine, all, ranks->sizes));
    OV_TRY(compare(context, ranks, all));
    status = opened; /* said at the end, where it failed */
cleanup:
    free(all);
    return status;
}

static ovoid_status agree(ovoid_context *context, ov_ranks *r, ovoid_status ended) {
    ovoid_status status = OVOID_OK;
    const ov_speech last = {.status = ended, .leaving = true};
    ov_heard all = {0};
    OV_TRY(ov_ranks_say(context, r, &last, NULL, &all));
    status = ov_heard_tell(context, &all);
cleanup:
    ov_heard_destroy(&all);
    return status;
}

ovoid_status ov_ranks_end(ovoid_context *context, ov_ranks *ranks, ovoid_status status) {
    if (ov_ranks_shared(ranks) && !ranks->over)
        status = agree(context, ranks, status);
    free(ranks->sizes);
    free(ranks->workers);
    *ranks = (ov_ranks){0};
    return status;
}
