/* The devices of a selector's list: the first is the context's own, and the others are there for
 * what works on several (host/fit/parts). */
#include "device/internal.h"

#include "base/progress.h"

#include <stdlib.h>
#include <string.h>

/* ---- opening it --------------------------------------------------------------------------- */

static ov_device_entry entry_of(const ov_device *device, size_t n) {
    return n > 0 ? device->others[n - 1]
                 : (ov_device_entry){
                       .info = device->info, .platform = device->platform, .id = device->id};
}

/* Opens the first of the entries, with the others behind it, in the place of what was. */
static ovoid_status open_list(ovoid_context *context, const ov_device_entry *entries,
                              const size_t *chosen, size_t count) {
    ov_device_entry *const others =
        ov_alloc(context, count - 1, sizeof *others, "a list of devices");
    if (!others)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 1; n < count; n++)
        others[n - 1] = entries[chosen[n]];
    const ovoid_status status = ov_device_open(context, &entries[chosen[0]], NULL);
    if (status != OVOID_OK) {
        free(others);
        return status;
    }
    context->device->others = others;
    context->device->other_count = count - 1;
    return OVOID_OK;
}

ovoid_status ovoid_context_open_device(ovoid_context *context, const char *selector) {
    ovoid_status status = OVOID_OK;
    ov_device_entry *entries = NULL;
    size_t *chosen = NULL, count = 0, platforms = 0, chosen_count = 0;
    OV_NEED(context, context);
    ov_progress_begin(context, "open");
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_devices_list(context, &entries, &count, &platforms));
    chosen = ov_alloc(context, count, sizeof *chosen, "a list of devices");
    if (!chosen) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_device_choose(context, selector, entries, count, platforms, chosen, &chosen_count));
    OV_TRY(open_list(context, entries, chosen, chosen_count));
cleanup:
    free(chosen);
    free(entries);
    ov_progress_end(context);
    return status;
}

ovoid_status ov_device_open_again(const ovoid_context *context, size_t n, ovoid_context *another) {
    const ov_device *const device = context->device;
    const ov_device_entry entry = entry_of(device, n);
    const ovoid_status status = ov_device_open(another, &entry, NULL);
    if (status == OVOID_OK && n == 0) {
        another->device->trusted = device->trusted;
        another->device->cache_told = device->cache_told;
    }
    return status;
}

/* ---- what is in it ------------------------------------------------------------------------ */

const ovoid_device_info *ovoid_context_device(const ovoid_context *context) {
    return ovoid_context_device_at(context, 0);
}

size_t ovoid_context_device_count(const ovoid_context *context) {
    return context && context->device ? 1 + context->device->other_count : 0;
}

const ovoid_device_info *ovoid_context_device_at(const ovoid_context *context, size_t index) {
    if (index >= ovoid_context_device_count(context))
        return NULL;
    return index > 0 ? &context->device->others[index - 1].info : &context->device->info;
}

/* ---- without some of it ------------------------------------------------------------------- */

void ov_device_leave_out(ovoid_context *context, const bool *lost) {
    const size_t count = ovoid_context_device_count(context);
    size_t left_count = 0, first = 1;
    ov_device_entry *const left = ov_alloc(NULL, count, sizeof *left, "a list of devices");
    if (!left)
        return;
    for (size_t n = 0; n < count; n++)
        if (!lost[n])
            left[left_count++] = entry_of(context->device, n);
    if (lost[0]) {
        for (first = 0; first < left_count; first++)
            if (ov_device_open(context, &left[first], NULL) == OVOID_OK)
                break;
        if (first == left_count) { /* no other can be opened, either */
            free(left);
            return;
        }
        first++;
    }
    free(context->device->others);
    context->device->others = left;
    context->device->other_count = left_count - first;
    memmove(left, left + first, (left_count - first) * sizeof *left);
}

/* ---- what its bits depend on -------------------------------------------------------------- */

ovoid_status ov_device_hash_of(ovoid_context *context, size_t n, uint64_t *hash) {
    ovoid_status status = OVOID_OK;
    ov_device *device, planned = {0};
    ov_text text = {0};
    OV_TRY(ov_device_get(context, &device));
    const ov_device_entry entry = entry_of(device, n);
    OV_TRY(ov_device_plan(context, &entry, &planned));
    status = ov_device_key(&planned, &text);
    if (status == OVOID_OK)
        status = ov_whole_source(&text);
    if (status == OVOID_OK)
        status = ov_text_append(NULL, &text, (const char *)&planned.shape, sizeof planned.shape);
    if (status == OVOID_OK)
        *hash = ov_hash(text.text, text.length);
    else
        ov_fail(context, status, "%s: its driver's version, or the kernels, cannot be read",
                planned.info.name);
cleanup:
    free(text.text);
    return status;
}

ovoid_status ov_device_hash(ovoid_context *context, uint64_t *hash) {
    uint64_t next, all[2];
    bool alike = true;
    ovoid_status status = ov_device_hash_of(context, 0, hash);
    all[0] = *hash;
    for (size_t n = 1; status == OVOID_OK && n < ovoid_context_device_count(context); n++) {
        status = ov_device_hash_of(context, n, &next);
        alike = alike && next == *hash;
        all[1] = next;
        all[0] = ov_hash(all, sizeof all);
    }
    if (status == OVOID_OK && !alike)
        *hash = all[0];
    return status;
}
