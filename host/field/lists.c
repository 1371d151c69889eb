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
    size_t counters; /* chunks, bins, groups, terms */
    size_t team;     /* work-items that share a term or a group of packs */
    size_t group;    /* work-items of a work-group, */
    size_t scan;     /* and of that which makes starts of counts */
} plan;

static plan make_plan(const ov_device *device, const ov_lists *lists, const ov_points *points,
                      const ov_terms *terms) {
    plan p = {.terms = (cl_uint)terms->count, .packs = (cl_uint)points->packs};
    p.groups = lists->terms_only ? 0 : (p.packs + OV_GROUP - 1) / OV_GROUP;
    p.block = p.terms / OV_BINS + 1;
    p.bins = (size_t)p.groups * OV_BINS;
    p.counters = 1 + p.bins + p.groups + p.terms;
    p.team = device->team >= OV_GROUP ? device->team : 1; /* OV_BY_TEAM in kernels/lists.cl */
    p.group = p.team > 1 ? p.team : ov_item_group(device);
    p.scan = device->shape.lanes == 1 ? 1 : OV_SCAN_GROUP;
    return p;
}

static ovoid_status prepare(ovoid_context *context, ov_lists *lists) {
    ovoid_status status = OVOID_OK;
    if (lists->packs_of_terms.handle)
        return OVOID_OK;
    OV_TRY(ov_kernel_create(context, "lists", "scan_lists", &lists->scan_lists));
    OV_TRY(ov_kernel_create(context, "lists", "hand_out_entries", &lists->hand_out_entries));
    OV_TRY(ov_kernel_create(context, "lists", "lists_of_packs", &lists->lists_of_packs));
    OV_TRY(ov_kernel_create(context, "lists", "make_few_lists", &lists->make_few_lists));
    OV_TRY(ov_kernel_create(context, "lists", "packs_of_terms", &lists->packs_of_terms));
cleanup:
    return status;
}

/* Room for a quarter more than is wanted, unless no buffer holds that, or what there is. */
static size_t roomy(const ovoid_context *context, size_t room, size_t wanted) {
    const size_t more = wanted + wanted / 4;
    const uint64_t limit = context->device->info.max_allocation;
    if (wanted <= room)
        return room;
    return more > UINT32_MAX || (limit > 0 && more > limit / sizeof(cl_uint)) ? wanted : more;
}

static ovoid_status reserve_chunks(ovoid_context *context, ov_lists *lists, size_t chunks) {
    ovoid_status status = OVOID_OK;
    lists->room_chunks = 0; /* until all buffers are there */
    OV_TRY(ov_buffer_reserve(context, &lists->next, chunks * sizeof(cl_uint), "chunks of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->entry_group, chunks * OV_CHUNK * sizeof(cl_uint),
                             "chunks of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->entry_bits, chunks * OV_CHUNK * sizeof(cl_ushort),
                             "chunks of lists"));
    lists->room_chunks = chunks;
cleanup:
    return status;
}

/* What a walk comes to: chunks taken, entries, pairs as low and high half, and whether all lists
 * fitted. */
enum { CHUNKS, ENTRIES, ITEMS, ITEMS_HIGH, FITS, TOTALS };

/* Room for so many words. Zeros at the beginning alone: who counts leaves them behind. */
static ovoid_status reserve_tally(ovoid_context *context, ov_buffer *tally, size_t words) {
    ovoid_status status = OVOID_OK;
    const size_t bytes = words * sizeof(cl_uint);
    uint32_t *zero = NULL;
    if (tally->memory && bytes <= tally->bytes)
        return OVOID_OK;
    OV_TRY(ov_buffer_reserve(context, tally, bytes, "counts of lists"));
    zero = ov_alloc(context, tally->bytes, 1, "counts of lists");
    if (!zero)
        status = OVOID_ERROR_MEMORY;
    else
        status = ov_buffer_write(context, tally, 0, zero, tally->bytes);
cleanup:
    free(zero);
    if (status != OVOID_OK)
        ov_buffer_destroy(tally); /* it may hold anything */
    return status;
}

/* Finds the entries of all terms; link: NULL, or that of chains. */
static ovoid_status launch_walk(ovoid_context *context, ov_lists *lists, const ov_points *points,
                                const ov_terms *terms, double skin, const plan *p, cl_uint chunks,
                                const ov_buffer *tally, const ov_buffer *link) {
    const cl_float grow = (cl_float)(skin + (double)points->rounding);
    const cl_mem chains = link ? link->memory : NULL; /* null in the kernel */
    return OV_LAUNCH(
        context, &lists->packs_of_terms, p->terms * p->team, p->group, OV_ARG(p->terms),
        OV_ARG(terms->device.memory), OV_ARG(points->tree), OV_ARG(points->boxes.memory),
        OV_ARG(grow), OV_ARG(p->groups), OV_ARG(p->block), OV_ARG(chunks), OV_ARG(tally->memory),
        OV_ARG(lists->chain.memory), OV_ARG(lists->next.memory), OV_ARG(lists->entry_group.memory),
        OV_ARG(lists->entry_bits.memory), OV_ARG(chains));
}

/* One walk of all terms, and where what it counted begins. room: for chunks, entries and pairs. */
static ovoid_status walk(ovoid_context *context, ov_lists *lists, const ov_points *points,
                         const ov_terms *terms, double skin, const plan *p, cl_uint4 room) {
    ovoid_status status = OVOID_OK;
    const cl_mem place = lists->terms_only ? NULL : lists->place.memory; /* null in the kernel */
    const cl_mem start = lists->packs_only ? NULL : lists->term_start.memory;
    OV_TRY(reserve_tally(context, &lists->tally, p->counters));
    OV_TRY(
        launch_walk(context, lists, points, terms, skin, p, room.s[CHUNKS], &lists->tally, NULL));
    OV_TRY(OV_LAUNCH(context, &lists->scan_lists, p->scan, p->scan, OV_ARG(p->terms),
                     OV_ARG(p->groups), OV_ARG(room), OV_ARG(lists->tally.memory), OV_ARG(place),
                     OV_ARG(start), OV_ARG(lists->totals.memory)));
cleanup:
    if (status != OVOID_OK)
        ov_buffer_destroy(&lists->tally);
    return status;
}

/* A walk with room for as many chunks as are held, and for whatever entries and pairs there are. */
static ovoid_status count(ovoid_context *context, ov_lists *lists, const ov_points *points,
                          const ov_terms *terms, double skin, const plan *p,
                          cl_uint totals[TOTALS]) {
    ovoid_status status = OVOID_OK;
    const cl_uint4 room = {{(cl_uint)lists->room_chunks, UINT32_MAX, UINT32_MAX, 0}};
    OV_TRY(walk(context, lists, points, terms, skin, p, room));
    OV_TRY(ov_buffer_read(context, &lists->totals, 0, totals, TOTALS * sizeof *totals));
cleanup:
    return status;
}

static ovoid_status reserve_starts(ovoid_context *context, ov_lists *lists, const plan *p) {
    ovoid_status status = OVOID_OK;
    const size_t size = sizeof(cl_uint);
    OV_TRY(ov_buffer_reserve(context, &lists->totals, TOTALS * size, "counts of lists"));
    OV_TRY(
        ov_buffer_reserve(context, &lists->chain, p->terms * sizeof(cl_uint2), "chunks of lists"));
    if (!lists->terms_only)
        OV_TRY(ov_buffer_reserve(context, &lists->place, (p->bins + p->groups) * size,
                                 "starts of lists"));
    if (!lists->packs_only)
        OV_TRY(ov_buffer_reserve(context, &lists->term_start, (p->terms + (size_t)1) * size,
                                 "starts of lists"));
    if (lists->room_chunks == 0)
        OV_TRY(reserve_chunks(context, lists, (size_t)p->terms * CHUNKS_PER_TERM));
cleanup:
    return status;
}

/* Finds the entries of all terms. Where their chunks do not suffice, once more with enough. */
static ovoid_status find_entries(ovoid_context *context, ov_lists *lists, const ov_points *points,
                                 const ov_terms *terms, double skin, const plan *p,
                                 cl_uint totals[TOTALS]) {
    ovoid_status status = OVOID_OK;
    OV_TRY(reserve_starts(context, lists, p));
    OV_TRY(count(context, lists, points, terms, skin, p, totals));
    if (totals[CHUNKS] > lists->room_chunks) {
        OV_TRY(reserve_chunks(context, lists, totals[CHUNKS]));
        OV_TRY(count(context, lists, points, terms, skin, p, totals));
    }
    if (totals[ITEMS_HIGH] > 0)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "more than 2^32 pairs of ellipsoids and packs of points; use a larger "
                       "spacing");
    lists->items = totals[ITEMS];
cleanup:
    return status;
}

static ovoid_status reserve_packs(ovoid_context *context, ov_lists *lists, const plan *p,
                                  size_t entries, size_t items) {
    ovoid_status status = OVOID_OK;
    const size_t size = sizeof(cl_uint);
    OV_TRY(ov_buffer_reserve(context, &lists->group_term, entries * size, "groups of packs"));
    OV_TRY(ov_buffer_reserve(context, &lists->group_bits, entries * sizeof(cl_ushort),
                             "groups of packs"));
    OV_TRY(ov_buffer_reserve(context, &lists->pack_start, (p->packs + (size_t)1) * size,
                             "starts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->pack_item, items * size, "ellipsoids of packs"));
cleanup:
    return status;
}

static ovoid_status reserve_items(ovoid_context *context, ov_lists *lists, const plan *p,
                                  size_t entries) {
    ovoid_status status = OVOID_OK;
    const size_t items = roomy(context, lists->room_items, lists->items);
    entries = roomy(context, lists->room_entries, entries);
    lists->room_items = lists->room_entries = 0;
    lists->built = false; /* until all buffers are there */
    if (!lists->packs_only)
        OV_TRY(ov_buffer_reserve(context, &lists->term_item, items * sizeof(cl_uint),
                                 "packs of ellipsoids"));
    if (!lists->terms_only)
        OV_TRY(reserve_packs(context, lists, p, entries, items));
    lists->room_items = items;
    lists->room_entries = entries;
    lists->built = true;
cleanup:
    return status;
}

/* Makes the lists that are wanted from the entries. */
static ovoid_status make_lists(ovoid_context *context, ov_lists *lists, const plan *p) {
    ovoid_status status = OVOID_OK;
    const bool terms = !lists->packs_only, packs = !lists->terms_only;
    const cl_mem start = terms ? lists->term_start.memory : NULL;
    const cl_mem item = terms ? lists->term_item.memory : NULL;
    const cl_mem place = packs ? lists->place.memory : NULL;
    const cl_mem group_term = packs ? lists->group_term.memory : NULL;
    const cl_mem group_bits = packs ? lists->group_bits.memory : NULL;
    OV_TRY(OV_LAUNCH(context, &lists->hand_out_entries, p->terms * p->team, p->group,
                     OV_ARG(p->terms), OV_ARG(p->block), OV_ARG(lists->chain.memory),
                     OV_ARG(lists->next.memory), OV_ARG(lists->entry_group.memory),
                     OV_ARG(lists->entry_bits.memory), OV_ARG(start), OV_ARG(item), OV_ARG(place),
                     OV_ARG(group_term), OV_ARG(group_bits), OV_ARG(lists->totals.memory)));
    if (packs)
        OV_TRY(OV_LAUNCH(context, &lists->lists_of_packs, p->groups * p->team, p->group,
                         OV_ARG(p->groups), OV_ARG(p->packs), OV_ARG(lists->place.memory),
                         OV_ARG(lists->group_term.memory), OV_ARG(lists->group_bits.memory),
                         OV_ARG(lists->pack_start.memory), OV_ARG(lists->pack_item.memory)));
cleanup:
    return status;
}

ovoid_status ov_lists_build(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    cl_uint totals[TOTALS] = {0};
    OV_TRY(ov_device_get(context, &device));
    const plan p = make_plan(device, lists, points, terms);
    OV_TRY(prepare(context, lists));
    lists->terms = terms->count;
    lists->packs = points->packs;
    OV_TRY(find_entries(context, lists, points, terms, skin, &p, totals));
    OV_TRY(reserve_items(context, lists, &p, totals[ENTRIES]));
    OV_TRY(make_lists(context, lists, &p));
cleanup:
    return status;
}

/* ---- without waiting ------------------------------------------------------------------------ */

bool ov_lists_built(const ov_lists *lists) {
    return lists->built;
}

void ov_lists_forget(ov_lists *lists) {
    lists->built = false;
    lists->room_chunks = lists->room_entries = lists->room_items = 0;
}

/* Entries and pairs that there is room for. */
static cl_uint4 rooms_of(const ov_lists *lists) {
    const size_t entries = lists->terms_only ? UINT32_MAX : lists->room_entries;
    return (cl_uint4){
        {(cl_uint)lists->room_chunks, (cl_uint)entries, (cl_uint)lists->room_items, 0}};
}

/* Few enough for each to find out by itself where its lists begin. */
#define FEW_TERMS 1024
#define FEW_GROUPS 1024

static bool are_few(const ov_lists *lists, const plan *p) {
    return !lists->terms_only && p->terms > 0 && p->terms <= FEW_TERMS && p->groups > 0 &&
           p->groups <= FEW_GROUPS;
}

static ovoid_status reserve_few(ovoid_context *context, ov_lists *lists, const plan *p) {
    ovoid_status status = OVOID_OK;
    const size_t entries = lists->room_chunks * OV_CHUNK;
    for (size_t k = 0; k < 2; ++k) {
        const cl_mem before = lists->few_tally[k].memory;
        OV_TRY(reserve_tally(context, &lists->few_tally[k], p->counters));
        if (lists->few_tally[k].memory != before)
            lists->few_used[k] = 0;
    }
    OV_TRY(ov_buffer_reserve(context, &lists->link, entries * sizeof(cl_uint2), "chains of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->few_term, lists->room_items * sizeof(cl_uint),
                             "groups of packs"));
    OV_TRY(ov_buffer_reserve(context, &lists->few_bits, lists->room_items * sizeof(cl_ushort),
                             "groups of packs"));
cleanup:
    return status;
}

/* The next time counts where the last one has been made zero. */
static void swap_tallies(ov_lists *lists, size_t used) {
    const ov_buffer swap = lists->few_tally[0];
    lists->few_tally[0] = lists->few_tally[1];
    lists->few_tally[1] = swap;
    lists->few_used[1] = used;
    lists->few_used[0] = 0;
}

/* All lists in two launches. */
static ovoid_status make_few(ovoid_context *context, ov_lists *lists, const ov_points *points,
                             const ov_terms *terms, double skin, const plan *p) {
    ovoid_status status = OVOID_OK;
    const cl_uint4 room = rooms_of(lists);
    const cl_mem start = lists->packs_only ? NULL : lists->term_start.memory;
    const cl_mem item = lists->packs_only ? NULL : lists->term_item.memory;
    OV_TRY(reserve_few(context, lists, p));
    const cl_uint used = (cl_uint)lists->few_used[1];
    OV_TRY(launch_walk(context, lists, points, terms, skin, p, room.s[CHUNKS], &lists->few_tally[0],
                       &lists->link));
    OV_TRY(OV_LAUNCH(context, &lists->make_few_lists, ((size_t)p->groups + p->terms) * p->team,
                     p->group, OV_ARG(p->terms), OV_ARG(p->groups), OV_ARG(p->packs), OV_ARG(room),
                     OV_ARG(lists->few_tally[0].memory), OV_ARG(used),
                     OV_ARG(lists->few_tally[1].memory), OV_ARG(lists->chain.memory),
                     OV_ARG(lists->next.memory), OV_ARG(lists->entry_group.memory),
                     OV_ARG(lists->entry_bits.memory), OV_ARG(lists->link.memory),
                     OV_ARG(lists->few_term.memory), OV_ARG(lists->few_bits.memory),
                     OV_ARG(lists->pack_start.memory), OV_ARG(lists->pack_item.memory),
                     OV_ARG(start), OV_ARG(item), OV_ARG(lists->totals.memory)));
    swap_tallies(lists, p->counters);
cleanup:
    for (size_t k = 0; k < 2 && status != OVOID_OK; ++k)
        ov_buffer_destroy(&lists->few_tally[k]); /* they may hold anything */
    return status;
}

ovoid_status ov_lists_begin(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    const plan p = make_plan(device, lists, points, terms);
    OV_TRY(prepare(context, lists));
    lists->terms = terms->count;
    lists->packs = points->packs;
    OV_TRY(reserve_starts(context, lists, &p));
    if (!lists->terms_only)
        OV_TRY(ov_buffer_reserve(context, &lists->pack_start,
                                 (p.packs + (size_t)1) * sizeof(cl_uint), "starts of lists"));
    const bool few = are_few(lists, &p);
    OV_TRY(few ? make_few(context, lists, points, terms, skin, &p)
               : walk(context, lists, points, terms, skin, &p, rooms_of(lists)));
    OV_TRY(ov_buffer_read_later(context, &lists->totals, 0, lists->told, sizeof lists->told,
                                &lists->later));
    if (!few)
        OV_TRY(make_lists(context, lists, &p));
cleanup:
    return status;
}

ovoid_status ov_lists_end(ovoid_context *context, ov_lists *lists, bool *whole) {
    const ovoid_status status = ov_later_end(context, &lists->later);
    *whole = status == OVOID_OK && lists->told[FITS];
    lists->items = *whole ? lists->told[ITEMS] : 0;
    return status;
}

void ov_lists_destroy(ov_lists *lists) {
    ov_buffer *const buffers[] = {
        &lists->term_start,   &lists->term_item,    &lists->pack_start, &lists->pack_item,
        &lists->tally,        &lists->chain,        &lists->next,       &lists->entry_group,
        &lists->entry_bits,   &lists->place,        &lists->group_term, &lists->group_bits,
        &lists->totals,       &lists->link,         &lists->few_term,   &lists->few_bits,
        &lists->few_tally[0], &lists->few_tally[1],
    };
    ov_kernel *const kernels[] = {&lists->packs_of_terms, &lists->scan_lists,
                                  &lists->hand_out_entries, &lists->lists_of_packs,
                                  &lists->make_few_lists};
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
    for (size_t k = 0; k < sizeof kernels / sizeof kernels[0]; ++k)
        ov_kernel_destroy(kernels[k]);
    memset(lists, 0, sizeof *lists);
}
