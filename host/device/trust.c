/* The first use of a device: a short self-test, whose outcome is remembered. */
#include "device/internal.h"

#include "base/progress.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char passed[] = "passed";

/* ---- what is remembered ------------------------------------------------------------------- */

/* All that the outcome depends on, without a null key where that cannot be told. */
static bool make_key(const ov_device *device, ov_text *key) {
    char options[OV_OPTIONS_SIZE];
    ov_text source = {0};
    ov_program_options(device, options);
    const bool made = ov_device_key(device, key) == OVOID_OK &&
                      ov_whole_source(&source) == OVOID_OK &&
                      ov_text_print(NULL, key, "%s %s\nlibrary %s\n%s\nkernels %016" PRIx64 "\n",
                                    device->info.pci, device->info.uuid, ovoid_version(), options,
                                    ov_hash(source.text, source.length)) == OVOID_OK;
    free(source.text);
    return made;
}

/* Those that passed in this process, where the folder may not be there for it. */
#define KNOWN_MOST 32
static pthread_mutex_t known_lock = PTHREAD_MUTEX_INITIALIZER;
static uint64_t known[KNOWN_MOST];
static size_t known_count;

static bool is_known(uint64_t hash) {
    bool found = false;
    pthread_mutex_lock(&known_lock);
    for (size_t k = 0; k < known_count; ++k)
        found = found || known[k] == hash;
    pthread_mutex_unlock(&known_lock);
    return found;
}

static void make_known(uint64_t hash) {
    pthread_mutex_lock(&known_lock);
    if (known_count < KNOWN_MOST)
        known[known_count++] = hash;
    pthread_mutex_unlock(&known_lock);
}

/* OVOID_CACHE=off asks for no files. */
static bool may_keep(void) {
    const char *const wish = getenv("OVOID_CACHE");
    return !wish || strcmp(wish, "off") != 0;
}

static bool is_kept(const ov_text *key) {
    ov_text outcome = {0};
    const bool kept = may_keep() && ov_cache_read("selftest", key, &outcome) &&
                      outcome.length == sizeof passed - 1 &&
                      memcmp(outcome.text, passed, sizeof passed - 1) == 0;
    free(outcome.text);
    return kept;
}

/* ---- the test ----------------------------------------------------------------------------- */

static bool ask_caller(const ovoid_progress *progress, void *caller) {
    (void)progress;
    return ov_progress_ask(caller) == OVOID_OK;
}

/* In a context of its own, so that what the caller counts, times and has enqueued stays as it is.
 * text: what is wrong, or "". Calls that fail are left for the caller's own work to meet, with what
 * they say there: *whole is false then. */
static ovoid_status test(ovoid_context *context, const ov_device *device,
                         char text[OV_SELFTEST_TEXT], bool *whole) {
    ovoid_status status = OVOID_OK;
    ovoid_context *own = NULL;
    const ov_device_entry entry = {
        .info = device->info, .platform = device->platform, .id = device->id};
    text[0] = '\0';
    *whole = false;
    const char *const before = ov_progress_stage(context, "selftest");
    if (ovoid_context_create(&own) != OVOID_OK)
        goto cleanup;
    ovoid_context_on_progress(own, ask_caller, context);
    if (ov_device_open(own, &entry, NULL) != OVOID_OK)
        goto cleanup;
    own->device->trusted = true;
    if (ov_selftest_brief(own, text, whole) == OVOID_ERROR_CANCELLED)
        status = OVOID_ERROR_CANCELLED; /* said by the question */
cleanup:
    ovoid_context_destroy(&own);
    ov_progress_stage(context, before);
    return status;
}

static ovoid_status refuse(ovoid_context *context, const ov_device *device) {
    return ov_fail(context, OVOID_ERROR_DEVICE,
                   "device %s (%s, driver %s) computes wrongly and is not used: %s\n"
                   "'ovoid selftest' tells more, and OVOID_SELFTEST=off uses it nonetheless",
                   device->info.name, device->info.platform, device->info.driver, device->distrust);
}

/* ---- whether it is to be tested ----------------------------------------------------------- */

/* Whether the environment or the device leaves nothing to do. *always: remembered or not. */
static bool is_left_alone(ovoid_context *context, const ov_device *device, bool *always) {
    const char *const wish = getenv("OVOID_SELFTEST");
    *always = wish && strcmp(wish, "on") == 0;
    if (wish && strcmp(wish, "off") == 0)
        return true;
    if (wish && *wish && !*always && strcmp(wish, "auto") != 0)
        ov_warn(context, "OVOID_SELFTEST is none of auto, on, off: %s", wish);
    return !*always && strcmp(device->info.platform, OV_OCLGRIND_PLATFORM) == 0;
}

ovoid_status ov_device_trust(ovoid_context *context, ov_device *device) {
    bool always, whole = false;
    if (device->trusted)
        return OVOID_OK;
    if (device->distrust[0])
        return refuse(context, device);
    device->trusted = is_left_alone(context, device, &always);
    if (device->trusted)
        return OVOID_OK;
    ov_text key = {0};
    const bool keyed = make_key(device, &key);
    const uint64_t hash = keyed ? ov_hash(key.text, key.length) : 0;
    ovoid_status status = OVOID_OK;
    if (!keyed || !(is_known(hash) || (!always && is_kept(&key)))) {
        OV_TRY(test(context, device, device->distrust, &whole));
        if (keyed && whole && !device->distrust[0]) {
            make_known(hash);
            if (may_keep())
                ov_cache_write(context, device, "selftest", &key, (const unsigned char *)passed,
                               sizeof passed - 1);
        }
    }
    if (device->distrust[0])
        status = refuse(context, device);
    else
        device->trusted = true;
cleanup:
    free(key.text);
    return status;
}
