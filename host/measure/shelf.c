/* A field's terms by where they are. */
#include "measure/cells.h"

#include "base/progress.h"

#include <math.h>
#include <stdlib.h>

void ov_shelf_destroy(ov_shelf *shelf) {
    ov_partition_destroy(&shelf->cut);
    free(shelf->reach);
    *shelf = (ov_shelf){0};
}

/* Half the widths of the box where a term counts; negative where it nowhere does. */
static double half_of(const ov_body *body, double least, double half[3]) {
    const double reach = ov_body_reach(body, least);
    for (size_t k = 0; k < 3; ++k)
        half[k] = reach * body->extent[k];
    return reach;
}

static void widen(const ov_body *body, double least, ov_box *box) {
    double half[3];
    if (half_of(body, least, half) < 0.0)
        return;
    for (size_t k = 0; k < 3; ++k) {
        box->low[k] = fmin(box->low[k], body->quadric.centre[k] - half[k]);
        box->high[k] = fmax(box->high[k], body->quadric.centre[k] + half[k]);
    }
}

static ovoid_status bound_parts(ovoid_context *context, ov_shelf *shelf) {
    ovoid_status status = OVOID_OK;
    const ov_partition *const cut = &shelf->cut;
    shelf->reach = ov_alloc(context, cut->count, sizeof *shelf->reach, "parts of a surface");
    if (!shelf->reach)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < cut->count; ++p) {
        ov_box *const box = &shelf->reach[p];
        *box = ov_box_empty;
        for (size_t n = cut->part[p].first; n < cut->part[p].first + cut->part[p].count; ++n) {
            ov_body body;
            ov_body_of_field(shelf->field, cut->order[n], &body);
            widen(&body, shelf->least, box);
        }
        OV_TRY(ov_progress_ask(context));
    }
cleanup:
    return status;
}

ovoid_status ov_shelf_create(ovoid_context *context, const ovoid_field *field, size_t most,
                             double least, ov_shelf *shelf) {
    ovoid_status status = OVOID_OK;
    ov_shelf made = {.field = field, .least = least, .cut = {.images = 1}};
    double *const centres = ov_alloc(context, 4 * field->count, sizeof *centres, "centres");
    if (!centres)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < field->count; ++i)
        for (size_t k = 0; k < 3; ++k)
            centres[4 * i + k] = field->quadrics[i].centre[k];
    OV_TRY(ov_partition_create(context, centres, field->count, most, &made.cut));
    OV_TRY(bound_parts(context, &made));
cleanup:
    free(centres);
    if (status == OVOID_OK)
        *shelf = made;
    else
        ov_shelf_destroy(&made);
    return status;
}

/* ---- taking --------------------------------------------------------------------------------- */

void ov_taken_destroy(ov_taken *taken) {
    free(taken->body);
    free(taken->image);
    *taken = (ov_taken){0};
}

/* Whether what is in a box where the field is may be felt in another one where an image is. */
static bool meets(const ov_box *own, const ov_rigid *motion, const ov_box *box) {
    if (!motion)
        return ov_boxes_near(own, box, 0.0);
    const ov_box moved = ov_box_move(own, motion);
    return ov_boxes_near(&moved, box, 0.0);
}

static bool reaches(const ov_shelf *shelf, size_t term, const ov_rigid *motion, const ov_box *box) {
    ov_body body;
    ov_box own = ov_box_empty;
    ov_body_of_field(shelf->field, term, &body);
    widen(&body, shelf->least, &own);
    return own.low[0] <= own.high[0] && meets(&own, motion, box);
}

static int by_number(const void *a, const void *b) {
    const uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;
    return (p > q) - (p < q);
}

/* Numbers of the terms that count in the box where the motion takes them; NULL: where they are. */
static ovoid_status list(ovoid_context *context, const ov_shelf *shelf, const ov_rigid *motion,
                         const ov_box *box, uint32_t **listed, size_t *count, size_t *capacity) {
    const ov_partition *const cut = &shelf->cut;
    *count = 0;
    for (size_t p = 0; p < cut->count; ++p) {
        if (shelf->reach[p].low[0] > shelf->reach[p].high[0] ||
            !meets(&shelf->reach[p], motion, box))
            continue;
        for (size_t n = cut->part[p].first; n < cut->part[p].first + cut->part[p].count; ++n) {
            if (!reaches(shelf, cut->order[n], motion, box))
                continue;
            const ovoid_status status = ov_grow(context, listed, capacity, *count + 1,
                                                sizeof **listed, "a surface's terms");
            if (status != OVOID_OK)
                return status;
            (*listed)[(*count)++] = cut->order[n];
        }
    }
    if (*count > 0) /* so that sums are those of the whole */
        qsort(*listed, *count, sizeof **listed, by_number);
    return OVOID_OK;
}

static ovoid_status add(ovoid_context *context, const ov_shelf *shelf, const ov_rigid *motion,
                        size_t image, const uint32_t *listed, size_t count, ov_taken *taken) {
    ovoid_status status = OVOID_OK;
    const size_t needed = taken->count + count + 1;
    OV_TRY(ov_grow(context, &taken->body, &taken->body_capacity, needed, sizeof *taken->body,
                   "a surface's terms"));
    OV_TRY(ov_grow(context, &taken->image, &taken->image_capacity, needed, sizeof *taken->image,
                   "a surface's terms"));
    for (size_t i = 0; i < count; ++i, ++taken->count) {
        taken->image[taken->count] = (uint32_t)image;
        if (motion)
            ov_body_of_image(shelf->field, listed[i], motion, &taken->body[taken->count]);
        else
            ov_body_of_field(shelf->field, listed[i], &taken->body[taken->count]);
    }
cleanup:
    return status;
}

ovoid_status ov_shelf_take(ovoid_context *context, const ov_shelf *shelf,
                           const ov_survey_images *images, const ov_box *box, ov_taken *taken) {
    ovoid_status status = OVOID_OK;
    uint32_t *listed = NULL;
    size_t count, capacity = 0;
    taken->count = 0;
    for (size_t g = 0; g < images->count; ++g) {
        const ov_rigid *const motion = g > 0 ? &images->image[g] : NULL;
        OV_TRY(list(context, shelf, motion, box, &listed, &count, &capacity));
        OV_TRY(add(context, shelf, motion, g, listed, count, taken));
    }
cleanup:
    free(listed);
    return status;
}
