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
        for (size_t k = 0; k < 3; ++k) {
            box->low[k] = INFINITY;
            box->high[k] = -INFINITY;
        }
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

static bool reaches(const ov_shelf *shelf, const ov_body *body, const ov_box *box) {
    ov_box own = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    widen(body, shelf->least, &own);
    return ov_boxes_near(&own, box, 0.0);
}

static int by_number(const void *a, const void *b) {
    const uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;
    return (p > q) - (p < q);
}

/* Numbers of the terms that count in the box. */
static ovoid_status list(ovoid_context *context, const ov_shelf *shelf, const ov_box *box,
                         uint32_t **listed, size_t *count) {
    size_t capacity = 0;
    const ov_partition *const cut = &shelf->cut;
    for (size_t p = 0; p < cut->count; ++p) {
        if (!ov_boxes_near(&shelf->reach[p], box, 0.0))
            continue;
        for (size_t n = cut->part[p].first; n < cut->part[p].first + cut->part[p].count; ++n) {
            ov_body body;
            ov_body_of_field(shelf->field, cut->order[n], &body);
            if (!reaches(shelf, &body, box))
                continue;
            const ovoid_status status = ov_grow(context, listed, &capacity, *count + 1,
                                                sizeof **listed, "a surface's terms");
            if (status != OVOID_OK)
                return status;
            (*listed)[(*count)++] = cut->order[n];
        }
    }
    return OVOID_OK;
}

/* In the order of their numbers, so that sums are those of the whole. */
ovoid_status ov_shelf_take(ovoid_context *context, const ov_shelf *shelf, const ov_box *box,
                           ov_body **bodies, size_t *count, size_t *capacity) {
    ovoid_status status = OVOID_OK;
    uint32_t *listed = NULL;
    *count = 0;
    OV_TRY(list(context, shelf, box, &listed, count));
    if (*count > 0)
        qsort(listed, *count, sizeof *listed, by_number);
    OV_TRY(ov_grow(context, bodies, capacity, *count + 1, sizeof **bodies, "a surface's terms"));
    for (size_t i = 0; i < *count; ++i)
        ov_body_of_field(shelf->field, listed[i], &(*bodies)[i]);
cleanup:
    free(listed);
    return status;
}
