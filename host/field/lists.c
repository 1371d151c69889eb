#include "field/field.h"

#include <stdlib.h>
#include <string.h>

/* Chunks that a term is taken to need before anything is known; there are as many as the terms of
 * the last time took, and more when they do not suffice. */
#define CHUNKS_PER_TERM 3

/* Numbers of what kernels/lists.cl counts. */
typedef struct plan {
    cl_uint terms, packs;
    cl_uint groups;  /* of packs; 0 where their lists are not wanted */
    cl_uint block;   /* terms that share a bin */
    size_t bins;     /* of all groups */
    size_t counters; /* chunks, terms, bins, groups */
    size_t group;    /* work-items of a work-group */
} plan;

static plan make_plan(const ov_device *device, const ov_lists *lists, const ov_points *points,
                      const ov_terms *terms) {
    plan p = {.terms = (cl_uint)terms->count, .packs = (cl_uint)points->packs};
    p.groups = lists->terms_only ? 0 : (p.packs + OV_GROUP - 1) / OV_GROUP;
    p.block = p.terms / OV_BINS + 1;
    p.bins = (size_t)p.groups * OV_BINS;
    p.counters = 1 + (size_t)p.terms + p.bins + p.groups;
    p.group = ov_item_group(device);
    return p;
}

static ovoid_status prepare(ovoid_context *context, ov_lists *lists) {
    ovoid_status status = OVOID_OK;
    if (lists->packs_of_terms.handle)
        return OVOID_OK;
    OV_TRY(ov_kernel_create(context, "lists", "lists_of_terms", &lists->lists_of_terms));
    OV_TRY(ov_kernel_create(context, "lists", "entries_of_groups", &lists->entries_of_groups));
    OV_TRY(ov_kernel_create(context, "lists", "lists_of_packs", &lists->lists_of_packs));
    OV_TRY(ov_kernel_create(context, "lists", "packs_of_terms", &lists->packs_of_terms));
cleanup:
    return status;
}

static ovoid_status reserve_chunks(ovoid_context *context, ov_lists *lists, size_t chunks) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_buffer_reserve(context, &lists->next, chunks * sizeof(cl_uint), "chunks of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->entry_group, chunks * OV_CHUNK * sizeof(cl_uint),
                             "chunks of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->entry_bits, chunks * OV_CHUNK * sizeof(cl_ushort),
                             "chunks of lists"));
cleanup:
    return status;
}

/* Chunks that there is room for. */
static size_t chunks_held(const ov_lists *lists) {
    size_t chunks = lists->next.bytes / sizeof(cl_uint);
    const size_t groups = lists->entry_group.bytes / (OV_CHUNK * sizeof(cl_uint));
    const size_t bits = lists->entry_bits.bytes / (OV_CHUNK * sizeof(cl_ushort));
    chunks = groups < chunks ? groups : chunks;
    chunks = bits < chunks ? bits : chunks;
    return chunks < UINT32_MAX ? chunks : UINT32_MAX;
}

/* One walk of all terms, and its tally in lists->scan. */
static ovoid_status walk(ovoid_context *context, ov_lists *lists, const ov_points *points,
                         const ov_terms *terms, double skin, const plan *p) {
    ovoid_status status = OVOID_OK;
    const cl_uint room = (cl_uint)chunks_held(lists);
    const cl_float grow = (cl_float)(skin + (double)points->rounding);
    memset(lists->scan, 0, p->counters * sizeof *lists->scan);
    OV_TRY(
        ov_buffer_write(context, &lists->tally, 0, lists->scan, p->counters * sizeof *lists->scan));
    OV_TRY(OV_LAUNCH(context, &lists->packs_of_terms, p->terms, p->group, OV_ARG(p->terms),
                     OV_ARG(terms->device.memory), OV_ARG(points->tree),
                     OV_ARG(points->boxes.memory), OV_ARG(grow), OV_ARG(p->groups),
                     OV_ARG(p->block), OV_ARG(room), OV_ARG(lists->tally.memory),
                     OV_ARG(lists->chain.memory), OV_ARG(lists->next.memory),
                     OV_ARG(lists->entry_group.memory), OV_ARG(lists->entry_bits.memory)));
    OV_TRY(
        ov_buffer_read(context, &lists->tally, 0, lists->scan, p->counters * sizeof *lists->scan));
cleanup:
    return status;
}

/* Finds the entries of all terms. Where their chunks do not suffice, once more with enough. */
static ovoid_status find_entries(ovoid_context *context, ov_lists *lists, const ov_points *points,
                                 const ov_terms *terms, double skin, const plan *p) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(context, &lists->scan, &lists->scan_capacity, p->counters + 1,
                   sizeof *lists->scan, "lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->tally, p->counters * sizeof *lists->scan,
                             "counts of lists"));
    OV_TRY(
        ov_buffer_reserve(context, &lists->chain, p->terms * sizeof(cl_uint2), "chunks of lists"));
    if (!lists->next.memory)
        OV_TRY(reserve_chunks(context, lists, (size_t)p->terms * CHUNKS_PER_TERM));
    OV_TRY(walk(context, lists, points, terms, skin, p));
    if (lists->scan[0] > chunks_held(lists)) {
        OV_TRY(reserve_chunks(context, lists, lists->scan[0]));
        OV_TRY(walk(context, lists, points, terms, skin, p));
    }
cleanup:
    return status;
}

/* Turns counts into starts; their sum. */
static uint64_t turn_to_starts(uint32_t *count, size_t size) {
    uint64_t sum = 0;
    for (size_t k = 0; k < size; ++k) {
        const uint32_t own = count[k];
        count[k] = (uint32_t)sum;
        sum += own;
    }
    return sum;
}

/* Counts the pairs of all terms. */
static ovoid_status count_items(ovoid_context *context, ov_lists *lists, const plan *p) {
    uint64_t items = 0;
    for (size_t i = 0; i < p->terms; ++i)
        items += lists->scan[1 + i];
    if (items > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "more than 2^32 pairs of ellipsoids and packs of points; use a larger "
                       "spacing");
    lists->items = (size_t)items;
    return OVOID_OK;
}

static ovoid_status make_pack_lists(ovoid_context *context, ov_lists *lists, const plan *p) {
    ovoid_status status = OVOID_OK;
    uint32_t *const bins = lists->scan + 1 + p->terms, *const pairs = bins + p->bins;
    const size_t entries = (size_t)turn_to_starts(bins, p->bins); /* no more than pairs */
    turn_to_starts(pairs, p->groups);
    OV_TRY(ov_buffer_put(context, &lists->place, bins, (p->bins + p->groups) * sizeof *bins,
                         "starts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->group_term, entries * sizeof(cl_uint),
                             "groups of packs"));
    OV_TRY(ov_buffer_reserve(context, &lists->group_bits, entries * sizeof(cl_ushort),
                             "groups of packs"));
    OV_TRY(ov_buffer_reserve(context, &lists->pack_start, (p->packs + (size_t)1) * sizeof *bins,
                             "starts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->pack_item, lists->items * sizeof(cl_uint),
                             "ellipsoids of packs"));
    OV_TRY(OV_LAUNCH(context, &lists->entries_of_groups, p->terms, p->group, OV_ARG(p->terms),
                     OV_ARG(p->block), OV_ARG(lists->chain.memory), OV_ARG(lists->next.memory),
                     OV_ARG(lists->entry_group.memory), OV_ARG(lists->entry_bits.memory),
                     OV_ARG(lists->place.memory), OV_ARG(lists->group_term.memory),
                     OV_ARG(lists->group_bits.memory)));
    OV_TRY(OV_LAUNCH(context, &lists->lists_of_packs, p->groups, p->group, OV_ARG(p->groups),
                     OV_ARG(p->packs), OV_ARG(lists->place.memory),
                     OV_ARG(lists->group_term.memory), OV_ARG(lists->group_bits.memory),
                     OV_ARG(lists->pack_start.memory), OV_ARG(lists->pack_item.memory)));
cleanup:
    return status;
}

static ovoid_status make_term_lists(ovoid_context *context, ov_lists *lists, const plan *p) {
    ovoid_status status = OVOID_OK;
    uint32_t *const start = lists->scan + 1;
    turn_to_starts(start, p->terms);
    start[p->terms] = (uint32_t)lists->items; /* over a bin that has been uploaded */
    OV_TRY(ov_buffer_put(context, &lists->term_start, start, (p->terms + (size_t)1) * sizeof *start,
                         "starts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->term_item, lists->items * sizeof(cl_uint),
                             "packs of ellipsoids"));
    OV_TRY(OV_LAUNCH(context, &lists->lists_of_terms, p->terms, p->group, OV_ARG(p->terms),
                     OV_ARG(lists->chain.memory), OV_ARG(lists->next.memory),
                     OV_ARG(lists->entry_group.memory), OV_ARG(lists->entry_bits.memory),
                     OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory)));
cleanup:
    return status;
}

ovoid_status ov_lists_build(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    const plan p = make_plan(device, lists, points, terms);
    OV_TRY(prepare(context, lists));
    lists->terms = terms->count;
    lists->packs = points->packs;
    OV_TRY(find_entries(context, lists, points, terms, skin, &p));
    OV_TRY(count_items(context, lists, &p));
    if (!lists->terms_only)
        OV_TRY(make_pack_lists(context, lists, &p));
    if (!lists->packs_only)
        OV_TRY(make_term_lists(context, lists, &p));
cleanup:
    return status;
}

void ov_lists_destroy(ov_lists *lists) {
    ov_buffer *const buffers[] = {
        &lists->term_start, &lists->term_item, &lists->pack_start, &lists->pack_item,
        &lists->tally,      &lists->chain,     &lists->next,       &lists->entry_group,
        &lists->entry_bits, &lists->place,     &lists->group_term, &lists->group_bits,
    };
    ov_kernel *const kernels[] = {&lists->packs_of_terms, &lists->lists_of_terms,
                                  &lists->entries_of_groups, &lists->lists_of_packs};
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
    for (size_t k = 0; k < sizeof kernels / sizeof kernels[0]; ++k)
        ov_kernel_destroy(kernels[k]);
    free(lists->scan);
    memset(lists, 0, sizeof *lists);
}
