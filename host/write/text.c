#include "write/text.h"

#include <ctype.h>
#include <errno.h>
#include <string.h>
#include <strings.h>

ovoid_status ov_locale_enter(ovoid_context *context, ov_locale *locale) {
    locale->c = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    if (!locale->c)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a locale");
    locale->before = uselocale(locale->c);
    return OVOID_OK;
}

void ov_locale_leave(ov_locale *locale) {
    if (!locale->c)
        return;
    uselocale(locale->before);
    freelocale(locale->c);
    locale->c = (locale_t)0;
}

ovoid_status ov_stream_check(ovoid_context *context, FILE *stream, const char *path) {
    if (!ferror(stream))
        return OVOID_OK;
    const char *reason = strerror(errno ? errno : EIO);
    if (strcmp(path, "-") == 0)
        return ov_fail(context, OVOID_ERROR_IO, "cannot write standard output: %s", reason);
    return ov_fail(context, OVOID_ERROR_IO, "cannot write '%s': %s", path, reason);
}

static const char *last_part(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

const char *ov_extension(const char *path) {
    const char *name = last_part(path);
    const char *dot = strrchr(name, '.');
    return dot && dot != name ? dot : "";
}

bool ov_extension_is(const char *extension, const char *known) {
    size_t length = strlen(extension);
    while (length && *known) {
        size_t next = strcspn(known, " ");
        if (next == length && strncasecmp(extension, known, length) == 0)
            return true;
        known += next;
        known += strspn(known, " ");
    }
    return false;
}

void ov_title(const char *path, char *title, size_t size) {
    const char *name = last_part(path);
    size_t length = strlen(name) - strlen(ov_extension(path));
    if (length >= size)
        length = size - 1;
    bool sensible = false;
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)name[i];
        bool letter = c < 0x80 && isalnum(c);
        sensible |= letter;
        title[i] = letter || c == '-' ? (char)c : '_';
    }
    title[length] = '\0';
    if (!sensible)
        snprintf(title, size, "ovoid");
}

void ov_json_text(const char *string, FILE *stream) {
    const unsigned char *text = (const unsigned char *)string;
    while (*text) {
        const size_t length = ov_utf8_length(text);
        if (length == 0)
            fputs("\\ufffd", stream);
        else if (*text < 0x20 || *text == '<')
            fprintf(stream, "\\u%04x", *text);
        else if (*text == '"' || *text == '\\')
            fprintf(stream, "\\%c", *text);
        else
            fwrite(text, 1, length, stream);
        text += length ? length : 1;
    }
}

void ov_markup_text(const char *string, FILE *stream) {
    const unsigned char *text = (const unsigned char *)string;
    while (*text) {
        const size_t length = ov_utf8_length(text);
        if (length == 0)
            fputs("\xef\xbf\xbd", stream); /* U+FFFD */
        else if (*text < 0x20)
            putc(' ', stream);
        else if (*text == '&')
            fputs("&amp;", stream);
        else if (*text == '<')
            fputs("&lt;", stream);
        else
            fwrite(text, 1, length, stream);
        text += length ? length : 1;
    }
}

void ov_json_string(const char *string, FILE *stream) {
    putc('"', stream);
    ov_json_text(string, stream);
    putc('"', stream);
}
