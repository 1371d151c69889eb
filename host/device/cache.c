#include "device/internal.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A file is this line, the key and the binary. */
#define HEADER_FORMAT "ovoid program 1 %016" PRIx64 " %016" PRIx64 " %016" PRIx64 "\n"
#define HEADER_LENGTH 67

static void make_header(char header[HEADER_LENGTH + 1], const ov_text *key, const void *binary,
                        size_t bytes) {
    snprintf(header, HEADER_LENGTH + 1, HEADER_FORMAT, (uint64_t)key->length, (uint64_t)bytes,
             ov_hash(binary, bytes));
}

/* ---- whether and where -------------------------------------------------------------------- */

/* Platforms that keep compiled programs themselves, or, as Oclgrind, are there to see the source.
 */
static bool driver_caches(const ov_device *device) {
    return strcmp(device->info.platform, OV_POCL_PLATFORM) == 0 ||
           strcmp(device->info.platform, OV_OCLGRIND_PLATFORM) == 0;
}

static void tell_once(ovoid_context *context, ov_device *device, const char *text,
                      const char *detail, const char *reason) {
    if (device->cache_told)
        return;
    device->cache_told = true;
    ov_warn(context, "%s%s%s%s", text, detail, reason[0] ? ": " : "", reason);
}

bool ov_cache_wanted(ovoid_context *context, ov_device *device) {
    const char *wish = getenv("OVOID_CACHE");
    if (wish && strcmp(wish, "on") == 0)
        return true;
    if (wish && strcmp(wish, "off") == 0)
        return false;
    if (wish && *wish && strcmp(wish, "auto") != 0)
        tell_once(context, device, "OVOID_CACHE is none of auto, on, off: ", wish, "");
    return !driver_caches(device);
}

/* The folder; false where the user has none. Relative XDG paths do not count (XDG Base
 * Directory Specification). */
static bool folder(ov_text *path) {
    const char *own = getenv("OVOID_CACHE_DIR");
    const char *cache = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    if (own && *own)
        return ov_text_print(NULL, path, "%s", own) == OVOID_OK;
    if (cache && cache[0] == '/')
        return ov_text_print(NULL, path, "%s/ovoid", cache) == OVOID_OK;
    if (home && *home)
        return ov_text_print(NULL, path, "%s/.cache/ovoid", home) == OVOID_OK;
    return false;
}

static bool append_name(ov_text *path, const char *program, const ov_text *key) {
    return ov_text_print(NULL, path, "/%s-%016" PRIx64 ".bin", program,
                         ov_hash(key->text, key->length)) == OVOID_OK;
}

/* ---- reading ------------------------------------------------------------------------------ */

static bool is_whole(const ov_text *file, const ov_text *key) {
    char header[HEADER_LENGTH + 1];
    if (file->length < HEADER_LENGTH || file->length - HEADER_LENGTH <= key->length)
        return false;
    const char *file_key = file->text + HEADER_LENGTH;
    const char *binary = file_key + key->length;
    make_header(header, key, binary, file->length - HEADER_LENGTH - key->length);
    return memcmp(header, file->text, HEADER_LENGTH) == 0 &&
           memcmp(key->text, file_key, key->length) == 0;
}

bool ov_cache_read(const char *program, const ov_text *key, ov_text *binary) {
    ov_text path = {0}, file = {0};
    bool found = folder(&path) && append_name(&path, program, key) &&
                 ov_text_read(NULL, &file, path.text) == OVOID_OK && is_whole(&file, key);
    if (found) {
        size_t skip = HEADER_LENGTH + key->length;
        found = ov_text_append(NULL, binary, file.text + skip, file.length - skip) == OVOID_OK;
    }
    free(path.text);
    free(file.text);
    return found;
}

/* ---- writing ------------------------------------------------------------------------------ */

static bool write_all(int descriptor, const ov_text *key, const unsigned char *binary,
                      size_t bytes) {
    char header[HEADER_LENGTH + 1];
    FILE *stream = fdopen(descriptor, "wb");
    if (!stream) {
        close(descriptor);
        return false;
    }
    make_header(header, key, binary, bytes);
    bool good = fwrite(header, 1, HEADER_LENGTH, stream) == HEADER_LENGTH &&
                fwrite(key->text, 1, key->length, stream) == key->length &&
                fwrite(binary, 1, bytes, stream) == bytes;
    int reason = errno;
    if (fclose(stream) != 0)
        return false;
    errno = reason;
    return good;
}

void ov_cache_write(ovoid_context *context, ov_device *device, const char *program,
                    const ov_text *key, const unsigned char *binary, size_t bytes) {
    static const char complaint[] = "what was compiled and tested is not kept for the next run: ";
    ov_text path = {0}, temporary = {0};
    if (!folder(&path)) {
        tell_once(context, device, complaint, "neither OVOID_CACHE_DIR nor HOME is set", "");
        return;
    }
    if (!ov_make_folders(path.text)) {
        tell_once(context, device, complaint, path.text, strerror(errno));
        goto cleanup;
    }
    if (!append_name(&path, program, key) ||
        ov_text_print(NULL, &temporary, "%s.XXXXXX", path.text) != OVOID_OK)
        goto cleanup;
    int descriptor = mkstemp(temporary.text);
    if (descriptor < 0) {
        tell_once(context, device, complaint, path.text, strerror(errno));
        goto cleanup;
    }
    if (!write_all(descriptor, key, binary, bytes) || rename(temporary.text, path.text) != 0) {
        tell_once(context, device, complaint, path.text, strerror(errno));
        unlink(temporary.text);
    }
cleanup:
    free(path.text);
    free(temporary.text);
}
