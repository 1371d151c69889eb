#include "fit/parts/crew.h"

#include "device/device.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NOTE_SIZE 1024 /* bytes of a warning that begins here */

/* ---- warnings -------------------------------------------------------------------------------- */

static bool is_noted(const ov_crew *crew, const char *text) {
    for (size_t n = 0; n < crew->notes; ++n)
        if (strcmp(crew->note[n], text) == 0)
            return true;
    return false;
}

/* Of any thread. What there is no memory for is left out. */
static void add_note(ov_crew *crew, const char *text) {
    pthread_mutex_lock(&crew->lock);
    if (!is_noted(crew, text) && ov_grow(NULL, &crew->note, &crew->notes_capacity, crew->notes + 1,
                                         sizeof *crew->note, "warnings") == OVOID_OK) {
        crew->note[crew->notes] = strdup(text);
        crew->notes += crew->note[crew->notes] != NULL;
    }
    pthread_mutex_unlock(&crew->lock);
}

static void on_warning(const char *text, void *user) {
    add_note(user, text);
}

void ov_crew_tell(ov_crew *crew) {
    const char *text;
    do {
        text = NULL;
        pthread_mutex_lock(&crew->lock);
        if (crew->passed < crew->notes)
            text = crew->note[crew->passed++];
        pthread_mutex_unlock(&crew->lock);
        if (text)
            ov_warn(crew->context, "%s", text);
    } while (text);
}

/* ---- who is there ---------------------------------------------------------------------------- */

static bool is_left(const ov_worker *w) {
    return w->at_work && !w->dismissed;
}

size_t ov_crew_on(const ov_crew *crew, size_t device) {
    size_t count = 0;
    for (size_t n = 0; n < crew->workers; ++n)
        count += is_left(&crew->worker[n]) && crew->worker[n].device == device;
    return count;
}

size_t ov_crew_of(const ov_crew *crew, uint64_t hash) {
    size_t count = 0;
    for (size_t n = 0; n < crew->workers; ++n)
        count += is_left(&crew->worker[n]) && crew->device[crew->worker[n].device].hash == hash;
    return count;
}

size_t ov_crew_left(const ov_crew *crew) {
    size_t count = 0;
    for (size_t n = 0; n < crew->workers; ++n)
        count += is_left(&crew->worker[n]);
    return count;
}

static bool is_the_last(const ov_crew *crew, size_t device) {
    for (size_t d = 0; d < crew->devices; ++d)
        if (d != device && !crew->device[d].lost)
            return false;
    return true;
}

/* ---- failures -------------------------------------------------------------------------------- */

/* A warning is one line: the first of the error. */
static void note_failure(ov_crew *crew, size_t device, const char *what, const char *error) {
    const ovoid_device_info *const info = ovoid_context_device_at(crew->context, device);
    char text[NOTE_SIZE];
    snprintf(text, sizeof text, "device %u, %s, %s: %.*s", (unsigned)info->index, info->name, what,
             (int)strcspn(error, "\n"), error);
    add_note(crew, text);
}

/* The last device is not told of: its error is that of all the work. */
static void lose(ov_crew *crew, size_t device, const char *error) {
    if (!is_the_last(crew, device))
        note_failure(crew, device, "failed and is not used any more", error);
    crew->device[device].lost = true;
    for (size_t n = 0; n < crew->workers; ++n)
        crew->worker[n].dismissed |= crew->worker[n].device == device;
}

void ov_crew_blame(ov_crew *crew, ov_worker *worker, ovoid_status status) {
    const size_t device = worker->device;
    const char *const error = ovoid_context_error(worker->context);
    if (worker->dismissed)
        return;
    if (status != OVOID_ERROR_MEMORY || !worker->in_company) {
        lose(crew, device, error);
    } else if (ov_crew_on(crew, device) > 1) {
        worker->dismissed = true;
        note_failure(crew, device, "has too little memory for so many parts at a time", error);
    }
}

/* ---- hiring ---------------------------------------------------------------------------------- */

static size_t hired(const ov_crew *crew, size_t device) {
    size_t count = 0;
    for (size_t n = 0; n < crew->workers; ++n)
        count += crew->worker[n].context &&
                 (device == crew->devices || crew->worker[n].device == device);
    return count;
}

/* A context on the device, with a queue of its own. */
static ovoid_status open_worker(ov_crew *crew, size_t device, ovoid_context **context) {
    if (ovoid_context_create(context) != OVOID_OK)
        return ov_fail(crew->context, OVOID_ERROR_MEMORY, "no memory for a worker");
    ovoid_context_on_warning(*context, on_warning, crew);
    (*context)->profile = crew->context->profile;
    const ovoid_status status = ov_device_open_again(crew->context, device, *context);
    return status == OVOID_OK ? OVOID_OK
                              : ov_fail(crew->context, status, "%s", ovoid_context_error(*context));
}

/* A device that cannot be opened a second time goes on with the workers that it has. */
static ovoid_status hire(ov_crew *crew, size_t device) {
    ovoid_context *context = NULL;
    ovoid_status status = ov_grow(crew->context, &crew->worker, &crew->capacity, crew->workers + 1,
                                  sizeof *crew->worker, "workers");
    if (status == OVOID_OK)
        status = open_worker(crew, device, &context);
    if (status == OVOID_OK) {
        crew->worker[crew->workers++] = (ov_worker){.context = context, .device = device};
        return OVOID_OK;
    }
    ovoid_context_destroy(&context);
    const char *const error = ovoid_context_error(crew->context);
    if (hired(crew, device) > 0)
        note_failure(crew, device, "takes no more parts at a time", error);
    else if (!is_the_last(crew, device))
        lose(crew, device, error);
    else
        return status;
    return OVOID_OK;
}

ovoid_status ov_crew_hire(ov_crew *crew, size_t each, size_t most) {
    ovoid_status status = OVOID_OK;
    for (size_t round = 0; round < each; ++round)
        for (size_t d = 0; d < crew->devices; ++d)
            if (!crew->device[d].lost && hired(crew, d) <= round &&
                (round == 0 || hired(crew, crew->devices) < most))
                OV_TRY(hire(crew, d));
cleanup:
    return status;
}

/* ---- beginning and end ----------------------------------------------------------------------- */

static ovoid_status compare_devices(ovoid_context *context, ov_crew *crew) {
    ovoid_status status = OVOID_OK;
    crew->alike = true;
    for (size_t d = 0; crew->devices > 1 && d < crew->devices; ++d) {
        OV_TRY(ov_device_hash_of(context, d, &crew->device[d].hash));
        crew->alike = crew->alike && crew->device[d].hash == crew->device[0].hash;
    }
cleanup:
    return status;
}

ovoid_status ov_crew_begin(ovoid_context *context) {
    ov_device *device;
    ovoid_status status = ov_device_get(context, &device);
    if (status != OVOID_OK)
        return status;
    ov_crew *const crew = ov_alloc(context, 1, sizeof *crew, "workers");
    if (!crew)
        return OVOID_ERROR_MEMORY;
    pthread_mutex_init(&crew->lock, NULL);
    context->crew = crew;
    crew->context = context;
    crew->devices = ovoid_context_device_count(context);
    crew->device = ov_alloc(context, crew->devices, sizeof *crew->device, "workers");
    status = crew->device ? compare_devices(context, crew) : OVOID_ERROR_MEMORY;
    if (status != OVOID_OK)
        ov_crew_end(context);
    return status;
}

static void leave_out_lost(ov_crew *crew) {
    bool any = false;
    bool *const lost = ov_alloc(NULL, crew->devices, sizeof *lost, "devices");
    for (size_t d = 0; lost && crew->device && d < crew->devices; ++d)
        any = (lost[d] = crew->device[d].lost) || any;
    if (any)
        ov_device_leave_out(crew->context, lost);
    free(lost);
}

/* What a device that was lost has counted is lost, too. */
static void absorb(ov_crew *crew, ov_worker *w) {
    if (w->context && !crew->device[w->device].lost &&
        ov_device_absorb(crew->context, w->context) != OVOID_OK)
        add_note(crew, ovoid_context_error(w->context));
}

void ov_crew_end(ovoid_context *context) {
    ov_crew *const crew = context->crew;
    if (!crew)
        return;
    context->crew = NULL;
    for (size_t n = 0; n < crew->workers; ++n) {
        absorb(crew, &crew->worker[n]);
        ovoid_context_destroy(&crew->worker[n].context);
    }
    ov_crew_tell(crew);
    leave_out_lost(crew);
    for (size_t n = 0; n < crew->notes; ++n)
        free(crew->note[n]);
    free(crew->note);
    free(crew->worker);
    free(crew->device);
    pthread_mutex_destroy(&crew->lock);
    free(crew);
}
