#include "device/internal.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

ovoid_status ov_text_append(ovoid_context *context, ov_text *text, const char *bytes,
                            size_t length) {
    ovoid_status status =
        ov_grow(context, &text->text, &text->capacity, text->length + length + 1, 1, "a text");
    if (status != OVOID_OK)
        return status;
    if (length)
        memcpy(text->text + text->length, bytes, length);
    text->length += length;
    text->text[text->length] = '\0';
    return OVOID_OK;
}

ovoid_status ov_text_print(ovoid_context *context, ov_text *text, const char *format, ...) {
    va_list args;
    va_start(args, format);
    int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    if (length < 0)
        return ov_fail(context, OVOID_ERROR_MEMORY, "a text cannot be formatted");
    ovoid_status status = ov_grow(context, &text->text, &text->capacity,
                                  text->length + (size_t)length + 1, 1, "a text");
    if (status != OVOID_OK)
        return status;
    va_start(args, format);
    vsnprintf(text->text + text->length, (size_t)length + 1, format, args);
    va_end(args);
    text->length += (size_t)length;
    return OVOID_OK;
}

ovoid_status ov_text_read(ovoid_context *context, ov_text *text, const char *path) {
    ovoid_status status = OVOID_OK;
    struct stat info;
    char block[4096];
    size_t got;
    FILE *file = NULL;
    if (stat(path, &info) != 0 || !(file = fopen(path, "rb")))
        return ov_fail(context, OVOID_ERROR_IO, "%s: %s", path, strerror(errno));
    if (!S_ISREG(info.st_mode)) {
        status = ov_fail(context, OVOID_ERROR_IO, "%s: not a regular file", path);
        goto cleanup;
    }
    while ((got = fread(block, 1, sizeof block, file)) > 0)
        OV_TRY(ov_text_append(context, text, block, got));
    if (ferror(file))
        status = ov_fail(context, OVOID_ERROR_IO, "%s: %s", path, strerror(errno));
cleanup:
    fclose(file);
    return status;
}
