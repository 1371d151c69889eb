#include "measure/changes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int by_bytes(const void *a, const void *b) {
    return memcmp(a, b, sizeof(ov_quadric));
}

static ov_box box_about(const ov_box *a, const ov_box *b) {
    ov_box both;
    for (size_t k = 0; k < 3; ++k) {
        both.low[k] = fmin(a->low[k], b->low[k]);
        both.high[k] = fmax(a->high[k], b->high[k]);
    }
    return both;
}

/* Of a box with that much room about it. */
static double volume_of(const ov_box *box, double room) {
    double volume = 1.0;
    for (size_t k = 0; k < 3; ++k)
        volume *= box->high[k] - box->low[k] + 2.0 * room;
    return volume;
}

/* Adds the box about one that changed, joined with those that this makes less to look at. */
static void add(const ov_change *change, const ov_quadric *quadric, ov_box *box, size_t *count) {
    double half[3];
    ov_box made;
    if (!ov_quadric_reach(quadric, change->floor, half))
        return;
    for (size_t k = 0; k < 3; ++k) {
        made.low[k] = quadric->centre[k] - half[k] - change->about;
        made.high[k] = quadric->centre[k] + half[k] + change->about;
    }
    for (size_t n = 0; n < *count;) {
        const ov_box both = box_about(&made, &box[n]);
        if (volume_of(&both, change->room) >
            volume_of(&made, change->room) + volume_of(&box[n], change->room)) {
            ++n;
            continue;
        }
        made = both;
        box[n] = box[--*count];
        n = 0; /* a larger one may join with others */
    }
    box[(*count)++] = made;
}

/* A sorted copy. */
static void sort(const ov_quadric *quadrics, size_t count, ov_quadric *sorted) {
    if (count == 0)
        return;
    memcpy(sorted, quadrics, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_bytes);
}

ovoid_status ov_changes_find(ovoid_context *context, const ov_change *change, ov_box *box,
                             size_t *count, bool *few) {
    const size_t befores = change->before_count, nows = change->now_count;
    size_t i = 0, k = 0, changed = 0;
    ov_quadric *const before = ov_alloc(context, befores + nows, sizeof *before, "ellipsoids");
    if (!before)
        return OVOID_ERROR_MEMORY;
    ov_quadric *const now = before + befores;
    sort(change->before, befores, before);
    sort(change->now, nows, now);
    *count = 0;
    while ((i < befores || k < nows) && changed <= OV_CHANGES_MOST) {
        const int order = i == befores ? 1 : k == nows ? -1 : by_bytes(&before[i], &now[k]);
        if (order != 0 && ++changed <= OV_CHANGES_MOST)
            add(change, order < 0 ? &before[i] : &now[k], box, count);
        i += order <= 0;
        k += order >= 0;
    }
    *few = changed <= OV_CHANGES_MOST;
    if (!*few)
        *count = 0;
    free(before);
    return OVOID_OK;
}
