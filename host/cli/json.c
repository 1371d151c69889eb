#include "cli.h"

#include <stdlib.h>
#include <string.h>

/* Bytes of the UTF-8 character at `text`, 0 if there is none. */
static size_t utf8_length(const unsigned char *text) {
    static const struct {
        unsigned char mask, lead;
        unsigned low; /* smallest code point that needs this many bytes */
    } forms[] = {{0x80, 0x00, 0}, {0xe0, 0xc0, 0x80}, {0xf0, 0xe0, 0x800}, {0xf8, 0xf0, 0x10000}};
    for (size_t n = 0; n < 4; n++) {
        if ((text[0] & forms[n].mask) != forms[n].lead)
            continue;
        unsigned code = text[0] & (unsigned char)~forms[n].mask;
        for (size_t i = 1; i <= n; i++) {
            if ((text[i] & 0xc0) != 0x80)
                return 0;
            code = code << 6 | (text[i] & 0x3f);
        }
        bool surrogate = code >= 0xd800 && code < 0xe000;
        return code >= forms[n].low && code <= 0x10ffff && !surrogate ? n + 1 : 0;
    }
    return 0;
}

bool cli_json_string(cJSON *object, const char *key, const char *text) {
    static const char replacement[] = "\xef\xbf\xbd";
    char *clean = malloc(3 * strlen(text) + 1);
    if (!clean)
        return false;
    size_t used = 0;
    for (const char *at = text; *at;) {
        size_t length = utf8_length((const unsigned char *)at);
        memcpy(clean + used, length ? at : replacement, length ? length : 3);
        used += length ? length : 3;
        at += length ? length : 1;
    }
    clean[used] = '\0';
    bool added = cJSON_AddStringToObject(object, key, clean) != NULL;
    free(clean);
    return added;
}

ovoid_status cli_json_write(ovoid_context *context, const cJSON *json, const char *path) {
    ovoid_file *file = NULL;
    char *text = cJSON_Print(json);
    if (!text)
        return OVOID_ERROR_MEMORY;
    ovoid_status status = ovoid_file_create(context, path, &file);
    if (status == OVOID_OK)
        status = ovoid_file_write(context, file, text, strlen(text));
    if (status == OVOID_OK)
        status = ovoid_file_write(context, file, "\n", 1);
    if (status == OVOID_OK)
        status = ovoid_file_commit(context, file);
    ovoid_file_destroy(&file);
    cJSON_free(text);
    return status;
}
