#include "field/field.h"

#include <stdlib.h>
#include <string.h>

/* Room beyond what a term had: a share of it, and at least so many packs. */
#define ROOM_SHARE 3
#define ROOM_LEAST 8

static ovoid_status prepare(ovoid_context *context, ov_lists *lists) {
    ovoid_status status = OVOID_OK;
    if (lists->packs_of_terms.handle)
        return OVOID_OK;
    OV_TRY(ov_kernel_create(context, "lists", "close_gaps", &lists->close_gaps));
    OV_TRY(ov_kernel_create(context, "lists", "count_transposed", &lists->count_transposed));
    OV_TRY(ov_kernel_create(context, "lists", "fill_transposed", &lists->fill_transposed));
    OV_TRY(ov_kernel_create(context, "lists", "sort_lists", &lists->sort_lists));
    OV_TRY(ov_kernel_create(context, "lists", "packs_of_terms", &lists->packs_of_terms));
cleanup:
    return status;
}

/* Turns the counts on the device into starts (count + 1 of them) in `start`; *total is their sum.
 */
static ovoid_status scan_counts(ovoid_context *context, ov_lists *lists, size_t count,
                                ov_buffer *start, size_t *total) {
    ovoid_status status = ov_grow(context, &lists->scan, &lists->scan_capacity, count + 1,
                                  sizeof *lists->scan, "lists");
    if (status != OVOID_OK)
        return status;
    uint32_t *const scan = lists->scan;
    OV_TRY(ov_buffer_read(context, &lists->count, 0, scan, count * sizeof *scan));
    uint64_t sum = 0;
    for (size_t k = 0; k < count; ++k) {
        const uint32_t own = scan[k];
        scan[k] = (uint32_t)sum;
        sum += own;
        if (sum > UINT32_MAX) {
            status = ov_fail(context, OVOID_ERROR_LIMIT,
                             "more than 2^32 pairs of ellipsoids and packs of points; use a larger "
                             "spacing");
            goto cleanup;
        }
    }
    scan[count] = (uint32_t)sum;
    OV_TRY(ov_buffer_reserve(context, start, (count + 1) * sizeof *scan, "starts of lists"));
    OV_TRY(ov_buffer_write(context, start, 0, scan, (count + 1) * sizeof *scan));
    *total = (size_t)sum;
cleanup:
    return status;
}

/* See kernels/lists.cl. */
enum { COUNT, FILL, FILL_COUNT };

static ovoid_status find_packs(ovoid_context *context, ov_lists *lists, const ov_points *points,
                               const ov_terms *terms, double skin, size_t group, cl_uint mode,
                               const ov_buffer *start, const ov_buffer *item) {
    const cl_uint count = (cl_uint)terms->count;
    const cl_float grow = (cl_float)skin;
    return OV_LAUNCH(context, &lists->packs_of_terms, terms->count, group, OV_ARG(count),
                     OV_ARG(terms->device.memory), OV_ARG(points->tree),
                     OV_ARG(points->boxes.memory), OV_ARG(grow), OV_ARG(mode),
                     OV_ARG(lists->count.memory), OV_ARG(start->memory), OV_ARG(item->memory));
}

/* Terms that are listed again have moved a little: with some room for each of them one walk finds
 * their packs, where count and fill take two. */
static ovoid_status lay_room(ovoid_context *context, ov_lists *lists, size_t terms) {
    ovoid_status status = OVOID_OK;
    lists->room_terms = 0;
    OV_TRY(ov_grow(context, &lists->room, &lists->room_capacity, terms + 1, sizeof *lists->room,
                   "lists"));
    uint64_t sum = 0;
    for (size_t i = 0; i < terms; ++i) {
        const uint32_t had = lists->scan[i + 1] - lists->scan[i];
        lists->room[i] = (uint32_t)sum;
        sum += had + had / ROOM_SHARE + ROOM_LEAST;
        if (sum > UINT32_MAX)
            return OVOID_OK; /* two walks, then */
    }
    lists->room[terms] = (uint32_t)sum;
    OV_TRY(ov_buffer_reserve(context, &lists->room_start, (terms + 1) * sizeof *lists->room,
                             "starts of lists"));
    OV_TRY(ov_buffer_write(context, &lists->room_start, 0, lists->room,
                           (terms + 1) * sizeof *lists->room));
    OV_TRY(ov_buffer_reserve(context, &lists->room_item, sum * sizeof(cl_uint),
                             "packs of ellipsoids"));
    lists->room_terms = terms;
cleanup:
    return status;
}

static bool room_sufficed(const ov_lists *lists) {
    for (size_t i = 0; i < lists->room_terms; ++i)
        if (lists->scan[i + 1] - lists->scan[i] > lists->room[i + 1] - lists->room[i])
            return false;
    return true;
}

static ovoid_status list_packs(ovoid_context *context, ov_lists *lists, const ov_points *points,
                               const ov_terms *terms, double skin, size_t group) {
    ovoid_status status = OVOID_OK;
    const cl_uint count = (cl_uint)terms->count;
    const size_t most = terms->count > points->packs ? terms->count : points->packs;
    const bool again = lists->room_terms == terms->count && terms->count > 0;
    OV_TRY(ov_buffer_reserve(context, &lists->count, most * sizeof(cl_uint), "counts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->term_start, (most + 1) * sizeof(cl_uint),
                             "starts of lists"));
    OV_TRY(ov_buffer_reserve(context, &lists->term_item, sizeof(cl_uint), "packs of ellipsoids"));
    OV_TRY(again ? find_packs(context, lists, points, terms, skin, group, FILL_COUNT,
                              &lists->room_start, &lists->room_item)
                 : find_packs(context, lists, points, terms, skin, group, COUNT, &lists->term_start,
                              &lists->term_item));
    OV_TRY(scan_counts(context, lists, terms->count, &lists->term_start, &lists->items));
    OV_TRY(ov_buffer_reserve(context, &lists->term_item, lists->items * sizeof(cl_uint),
                             "packs of ellipsoids"));
    if (again && room_sufficed(lists))
        return OV_LAUNCH(context, &lists->close_gaps, terms->count, group, OV_ARG(count),
                         OV_ARG(lists->room_start.memory), OV_ARG(lists->room_item.memory),
                         OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory));
    OV_TRY(find_packs(context, lists, points, terms, skin, group, FILL, &lists->term_start,
                      &lists->term_item));
    OV_TRY(lay_room(context, lists, terms->count));
cleanup:
    return status;
}

static ovoid_status transpose(ovoid_context *context, ov_lists *lists, size_t packs, size_t group) {
    ovoid_status status = OVOID_OK;
    const cl_uint terms = (cl_uint)lists->terms, lists_count = (cl_uint)packs;
    size_t total = 0;
    OV_TRY(ov_grow(context, &lists->scan, &lists->scan_capacity, packs + 1, sizeof *lists->scan,
                   "lists"));
    memset(lists->scan, 0, packs * sizeof *lists->scan);
    OV_TRY(ov_buffer_write(context, &lists->count, 0, lists->scan, packs * sizeof *lists->scan));
    OV_TRY(OV_LAUNCH(context, &lists->count_transposed, lists->terms, group, OV_ARG(terms),
                     OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory),
                     OV_ARG(lists->count.memory)));
    OV_TRY(scan_counts(context, lists, packs, &lists->pack_start, &total));
    OV_TRY(ov_buffer_write(context, &lists->count, 0, lists->scan, packs * sizeof *lists->scan));
    OV_TRY(ov_buffer_reserve(context, &lists->pack_item, total * sizeof(cl_uint),
                             "ellipsoids of packs"));
    OV_TRY(OV_LAUNCH(context, &lists->fill_transposed, lists->terms, group, OV_ARG(terms),
                     OV_ARG(lists->term_start.memory), OV_ARG(lists->term_item.memory),
                     OV_ARG(lists->count.memory), OV_ARG(lists->pack_item.memory)));
    OV_TRY(OV_LAUNCH(context, &lists->sort_lists, packs, group, OV_ARG(lists_count),
                     OV_ARG(lists->pack_start.memory), OV_ARG(lists->pack_item.memory)));
cleanup:
    return status;
}

ovoid_status ov_lists_build(ovoid_context *context, ov_lists *lists, const ov_points *points,
                            const ov_terms *terms, double skin) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    OV_TRY(ov_device_get(context, &device));
    const size_t group = ov_item_group(device);
    OV_TRY(prepare(context, lists));
    lists->terms = terms->count;
    lists->packs = points->packs;
    OV_TRY(list_packs(context, lists, points, terms, skin, group));
    OV_TRY(transpose(context, lists, points->packs, group));
cleanup:
    return status;
}

void ov_lists_destroy(ov_lists *lists) {
    ov_buffer *const buffers[] = {&lists->term_start, &lists->term_item, &lists->pack_start,
                                  &lists->pack_item,  &lists->count,     &lists->room_start,
                                  &lists->room_item};
    for (size_t k = 0; k < sizeof buffers / sizeof buffers[0]; ++k)
        ov_buffer_destroy(buffers[k]);
    ov_kernel_destroy(&lists->packs_of_terms);
    ov_kernel_destroy(&lists->count_transposed);
    ov_kernel_destroy(&lists->fill_transposed);
    ov_kernel_destroy(&lists->sort_lists);
    ov_kernel_destroy(&lists->close_gaps);
    free(lists->scan);
    free(lists->room);
    memset(lists, 0, sizeof *lists);
}
