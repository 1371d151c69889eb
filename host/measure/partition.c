#include "measure/partition.h"

#include "base/progress.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

/* ---- cutting --------------------------------------------------------------------------------- */

static void bound(const double *xyzr, const uint32_t *order, ov_part *part) {
    part->box = ov_box_empty;
    for (size_t n = part->first; n < part->first + part->count; ++n)
        ov_box_add(&part->box, xyzr + 4 * (size_t)order[n], 0.0);
}

static size_t longest_axis(const ov_part *part) {
    size_t longest = 0;
    for (size_t k = 1; k < 3; ++k)
        if (part->box.high[k] - part->box.low[k] > part->box.high[longest] - part->box.low[longest])
            longest = k;
    return longest;
}

/* Whether atom a comes before atom b along an axis: by number where they are level, so that each
 * order is the only one. */
static bool is_before(const double *xyzr, size_t axis, uint32_t a, uint32_t b) {
    const double x = xyzr[4 * (size_t)a + axis], y = xyzr[4 * (size_t)b + axis];
    return x != y ? x < y : a < b;
}

static void swap(uint32_t *a, uint32_t *b) {
    const uint32_t t = *a;
    *a = *b;
    *b = t;
}

/* Orders three of them, so that the one in the middle is a good guess at the median. */
static void sort_three(const double *xyzr, size_t axis, uint32_t *a, uint32_t *b, uint32_t *c) {
    if (is_before(xyzr, axis, *b, *a))
        swap(a, b);
    if (is_before(xyzr, axis, *c, *b))
        swap(b, c);
    if (is_before(xyzr, axis, *b, *a))
        swap(a, b);
}

/* Puts the atoms that come first along the axis before order[half]: Hoare's selection. */
static void select_half(const double *xyzr, size_t axis, uint32_t *order, size_t count,
                        size_t half) {
    ptrdiff_t low = 0, high = (ptrdiff_t)count - 1;
    const ptrdiff_t wanted = (ptrdiff_t)half;
    while (low < high) {
        const ptrdiff_t middle = low + (high - low) / 2;
        ptrdiff_t i = low, j = high;
        sort_three(xyzr, axis, &order[low], &order[middle], &order[high]);
        const uint32_t pivot = order[middle];
        while (i <= j) {
            while (is_before(xyzr, axis, order[i], pivot))
                ++i;
            while (is_before(xyzr, axis, pivot, order[j]))
                --j;
            if (i <= j)
                swap(&order[i++], &order[j--]);
        }
        if (wanted <= j)
            high = j;
        else if (wanted >= i)
            low = i;
        else
            return;
    }
}

/* The middle between the first `half` atoms from `first` on and the `others` after them. */
static double between(const double *xyzr, size_t axis, const uint32_t *order, size_t first,
                      size_t half, size_t others) {
    double below = -INFINITY, above = INFINITY;
    for (size_t n = first; n < first + half; ++n)
        below = fmax(below, xyzr[4 * (size_t)order[n] + axis]);
    for (size_t n = first + half; n < first + half + others; ++n)
        above = fmin(above, xyzr[4 * (size_t)order[n] + axis]);
    return 0.5 * below + 0.5 * above;
}

/* Halves part after part; those that come of it stay beside each other. */
static ovoid_status cut(ovoid_context *context, const double *xyzr, size_t most,
                        ov_partition *made) {
    ovoid_status status = OVOID_OK;
    size_t capacity = 1, at = 0;
    while (at < made->count) {
        ov_part *const part = &made->part[at];
        bound(xyzr, made->order, part);
        if (part->count <= most) {
            ++at;
            continue;
        }
        const size_t half = part->count / 2;
        const size_t axis = longest_axis(part);
        select_half(xyzr, axis, made->order + part->first, part->count, half);
        OV_TRY(ov_grow(context, &made->part, &capacity, made->count + 1, sizeof *made->part,
                       "parts of a molecule"));
        ov_part *const whole = &made->part[at];
        for (size_t n = made->count; n > at + 1; --n)
            made->part[n] = made->part[n - 1];
        whole[1] = (ov_part){
            .first = whole->first + half, .count = whole->count - half, .cell = whole->cell};
        whole->count = half;
        whole->cell.high[axis] = whole[1].cell.low[axis] =
            between(xyzr, axis, made->order, whole->first, half, whole[1].count);
        ++made->count;
        OV_TRY(ov_progress_ask(context));
    }
cleanup:
    return status;
}

/* ---- neighbours ------------------------------------------------------------------------------ */

bool ov_part_image_near(const ov_partition *partition, size_t p, size_t q, size_t image) {
    const ov_box *const box = &partition->part[p].box, *const other = &partition->part[q].box;
    if (image == 0)
        return ov_boxes_near(box, other, partition->near);
    const ov_box moved = ov_box_move(other, &partition->image[image]);
    return ov_boxes_near(box, &moved, partition->near);
}

bool ov_parts_near(const ov_partition *partition, size_t p, size_t q) {
    for (size_t g = 0; g < partition->images;
         ++g) /* a box about a moved box is not that box moved */
        if (ov_part_image_near(partition, p, q, g) || ov_part_image_near(partition, q, p, g))
            return true;
    return false;
}

ovoid_status ov_partition_colour(ovoid_context *context, ov_partition *made) {
    bool *const taken = ov_alloc(context, made->count + 1, sizeof *taken, "parts of a molecule");
    if (!taken)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < made->count; ++p) {
        uint32_t first = 0;
        for (size_t q = 0; q < p; ++q)
            if (ov_parts_near(made, p, q))
                taken[made->part[q].colour] = true;
        while (taken[first])
            ++first;
        made->part[p].colour = first;
        made->colours = first + 1 > made->colours ? first + 1 : made->colours;
        for (uint32_t c = 0; c < made->colours; ++c)
            taken[c] = false;
    }
    free(taken);
    return OVOID_OK;
}

ovoid_status ov_partition_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                 size_t most, ov_partition *partition) {
    ovoid_status status = OVOID_OK;
    ov_partition made = {.count = 1,
                         .near = partition->near,
                         .image = partition->image,
                         .images = partition->images};
    made.order = ov_alloc(context, atoms, sizeof *made.order, "parts of a molecule");
    made.part = ov_alloc(context, 1, sizeof *made.part, "parts of a molecule");
    if (!made.order || !made.part) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t i = 0; i < atoms; ++i)
        made.order[i] = (uint32_t)i;
    made.part->count = atoms;
    for (size_t k = 0; k < 3; ++k) {
        made.part->cell.low[k] = -INFINITY;
        made.part->cell.high[k] = INFINITY;
    }
    OV_TRY(cut(context, xyzr, most, &made));
    OV_TRY(ov_partition_colour(context, &made));
cleanup:
    if (status == OVOID_OK)
        *partition = made;
    else
        ov_partition_destroy(&made);
    return status;
}

void ov_partition_destroy(ov_partition *partition) {
    free(partition->order);
    free(partition->part);
    *partition = (ov_partition){0};
}
