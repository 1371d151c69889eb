#include "model/model.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static_assert(sizeof(ovoid_ellipsoid) == OV_ELLIPSOID_VALUES * sizeof(double),
              "an ellipsoid is ten doubles without gaps");

const char *ov_ellipsoid_value_name(size_t value) {
    static const char *const names[OV_ELLIPSOID_VALUES] = {
        "amplitude", "decay1", "decay2", "decay3", "x", "y", "z", "alpha", "beta", "gamma"};
    return value < OV_ELLIPSOID_VALUES ? names[value] : "";
}

const char *ov_ellipsoid_value_problem(size_t value, double number) {
    if (!isfinite(number))
        return "must be finite";
    if (value < 4 && !(number > 0.0))
        return "must be positive";
    return NULL;
}

static ovoid_status check_ellipsoid(ovoid_context *context, const ovoid_ellipsoid *ellipsoid,
                                    size_t index) {
    double values[OV_ELLIPSOID_VALUES];
    memcpy(values, ellipsoid, sizeof values);
    for (size_t i = 0; i < OV_ELLIPSOID_VALUES; i++) {
        const char *problem = ov_ellipsoid_value_problem(i, values[i]);
        if (problem)
            return ov_fail(context, OVOID_ERROR_ARGUMENT, "ellipsoid %zu: %s is %g and %s", index,
                           ov_ellipsoid_value_name(i), values[i], problem);
    }
    return OVOID_OK;
}

static ovoid_status check_placed(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                 size_t count, const ovoid_motion *placements,
                                 size_t placement_count) {
    for (size_t n = 0; n < placement_count; n++) {
        const char *problem = ov_placement_problem(&placements[n]);
        if (problem)
            return ov_fail(context, OVOID_ERROR_ARGUMENT, "placement %zu: %s", n, problem);
    }
    for (size_t i = 0; i < count && placement_count > 0; i++) {
        const char *problem = ov_placed_problem(&ellipsoids[i]);
        if (problem)
            return ov_fail(context, OVOID_ERROR_ARGUMENT, "ellipsoid %zu: %s", i, problem);
    }
    return ov_placements_check(context, placement_count, count);
}

static ovoid_status check_surface(ovoid_context *context, double decay, double isovalue) {
    if (!isfinite(decay) || decay <= 0.0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "decay is %g and must be positive", decay);
    if (!isfinite(isovalue) || isovalue <= 0.0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "isovalue is %g and must be positive",
                       isovalue);
    return OVOID_OK;
}

static ovoid_status create(ovoid_context *context, const ovoid_ellipsoid *ellipsoids, size_t count,
                           const ovoid_motion *placements, size_t placement_count, double decay,
                           double isovalue, ovoid_model **model) {
    ovoid_status status = OVOID_OK;
    ovoid_model *made = NULL;
    if (!count)
        return ov_fail(context, OVOID_ERROR_EMPTY, "a model needs at least one ellipsoid");
    OV_TRY(check_surface(context, decay, isovalue));
    for (size_t i = 0; i < count; i++)
        OV_TRY(check_ellipsoid(context, &ellipsoids[i], i));
    OV_TRY(check_placed(context, ellipsoids, count, placements, placement_count));
    made = ov_alloc(context, 1, sizeof *made, "a model");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->unit_count = count;
    made->placement_count = placement_count;
    made->decay = decay;
    made->isovalue = isovalue;
    made->unit = ov_copy(context, ellipsoids, count, sizeof *ellipsoids, "a model's ellipsoids");
    if (placement_count > 0)
        made->placements = ov_copy(context, placements, placement_count, sizeof *placements,
                                   "a model's placements");
    if (!made->unit || (placement_count > 0 && !made->placements))
        OV_TRY(OVOID_ERROR_MEMORY);
    *model = made;
    made = NULL;
cleanup:
    ovoid_model_destroy(&made);
    return status;
}

ovoid_status ovoid_model_create(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                size_t count, double decay, double isovalue, ovoid_model **model) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    if (count)
        OV_NEED(context, ellipsoids);
    return create(context, ellipsoids, count, NULL, 0, decay, isovalue, model);
}

ovoid_status ovoid_model_create_placed(ovoid_context *context, const ovoid_ellipsoid *ellipsoids,
                                       size_t count, const ovoid_motion *placements,
                                       size_t placement_count, double decay, double isovalue,
                                       ovoid_model **model) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    if (count)
        OV_NEED(context, ellipsoids);
    if (placement_count)
        OV_NEED(context, placements);
    return create(context, ellipsoids, count, placements, placement_count, decay, isovalue, model);
}

void ovoid_model_destroy(ovoid_model **model) {
    if (!model || !*model)
        return;
    for (size_t i = 0; i < (*model)->note_count; i++)
        free((*model)->notes[i]);
    free((*model)->notes);
    free((*model)->unit);
    free((*model)->placements);
    free((*model)->placed);
    free((*model)->owner);
    free(*model);
    *model = NULL;
}

size_t ovoid_model_size(const ovoid_model *model) {
    if (!model)
        return 0;
    return model->placement_count > 0 ? model->placement_count * model->unit_count
                                      : model->unit_count;
}

const ovoid_ellipsoid *ovoid_model_ellipsoids(const ovoid_model *model) {
    if (!model || model->placement_count == 0)
        return model ? model->unit : NULL;
    return ov_model_place(NULL, model) == OVOID_OK ? model->placed : NULL;
}

double ovoid_model_decay(const ovoid_model *model) {
    return model ? model->decay : NAN;
}

double ovoid_model_isovalue(const ovoid_model *model) {
    return model ? model->isovalue : NAN;
}

const uint32_t *ovoid_model_owner(const ovoid_model *model) {
    return model ? model->owner : NULL;
}

size_t ovoid_model_owner_count(const ovoid_model *model) {
    return model ? model->owner_count : 0;
}

void ov_model_take_owner(ovoid_model *model, uint32_t **owner, size_t atoms) {
    free(model->owner);
    model->owner = *owner;
    model->owner_count = atoms;
    *owner = NULL;
}

const char *ovoid_model_note(const ovoid_model *model, size_t index) {
    return model && index < model->note_count ? model->notes[index] : NULL;
}

static bool is_control(char c) {
    return (unsigned char)c < 0x20 || c == 0x7f;
}

bool ov_model_key_valid(const char *key) {
    if (key[0] == '\0' || key[0] == '#' || key[0] == ' ')
        return false;
    if (strcmp(key, "decay") == 0 || strcmp(key, "isovalue") == 0 || strcmp(key, "placement") == 0)
        return false;
    for (const char *c = key; *c; c++)
        if (*c == ':' || is_control(*c))
            return false;
    return true;
}

ovoid_status ov_model_add_note(ovoid_context *context, ovoid_model *model, const char *text,
                               size_t length) {
    ovoid_status status = ov_grow(context, &model->notes, &model->note_capacity,
                                  model->note_count + 1, sizeof *model->notes, "a model's notes");
    if (status != OVOID_OK)
        return status;
    char *note = ov_alloc(context, length + 1, 1, "a model's note");
    if (!note)
        return OVOID_ERROR_MEMORY;
    memcpy(note, text, length);
    model->notes[model->note_count++] = note;
    return OVOID_OK;
}

static ovoid_status copy_notes(ovoid_context *context, const ovoid_model *model,
                               ovoid_model *copy) {
    ovoid_status status = OVOID_OK;
    for (size_t i = 0; i < model->note_count; i++)
        OV_TRY(ov_model_add_note(context, copy, model->notes[i], strlen(model->notes[i])));
cleanup:
    return status;
}

ovoid_status ov_model_copy(ovoid_context *context, const ovoid_model *model, ovoid_model **copy) {
    ovoid_status status = OVOID_OK;
    ovoid_model *made = NULL;
    OV_TRY(ov_model_place(context, model));
    OV_TRY(ovoid_model_create(context, ovoid_model_ellipsoids(model), ovoid_model_size(model),
                              model->decay, model->isovalue, &made));
    OV_TRY(copy_notes(context, model, made));
    *copy = made;
    made = NULL;
cleanup:
    ovoid_model_destroy(&made);
    return status;
}

ovoid_status ov_model_copy_placed(ovoid_context *context, const ovoid_model *model,
                                  ovoid_model **copy) {
    ovoid_status status = OVOID_OK;
    ovoid_model *made = NULL;
    OV_TRY(create(context, model->unit, model->unit_count, model->placements,
                  model->placement_count, model->decay, model->isovalue, &made));
    OV_TRY(copy_notes(context, model, made));
    *copy = made;
    made = NULL;
cleanup:
    ovoid_model_destroy(&made);
    return status;
}

ovoid_status ovoid_model_annotate(ovoid_context *context, ovoid_model *model, const char *key,
                                  const char *value) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, key);
    OV_NEED(context, value);
    if (!ov_model_key_valid(key))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "'%s' cannot be the key of a model's header line", key);
    for (const char *c = value; *c; c++)
        if (is_control(*c) && *c != '\t')
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "the header line '%s' of a model cannot hold a control character", key);
    /* Blanks about the value would not survive a file. */
    value += strspn(value, " \t");
    size_t tail = strlen(value), head = strlen(key);
    while (tail && (value[tail - 1] == ' ' || value[tail - 1] == '\t'))
        tail--;

    char *text = ov_alloc(context, head + tail + 3, 1, "a model's note");
    if (!text)
        return OVOID_ERROR_MEMORY;
    memcpy(text, key, head);
    text[head++] = ':';
    if (tail)
        text[head++] = ' ';
    memcpy(text + head, value, tail);
    ovoid_status status = ov_model_add_note(context, model, text, head + tail);
    free(text);
    return status;
}
