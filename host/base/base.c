#include "base/base.h"

#include "base/tenant.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)

const char *ovoid_version(void) {
    return TEXT(OVOID_VERSION_MAJOR) "." TEXT(OVOID_VERSION_MINOR) "." TEXT(OVOID_VERSION_PATCH);
}

uint32_t ovoid_abi(void) {
    return OVOID_ABI;
}

const char *ovoid_status_name(ovoid_status status) {
    static const char *const names[] = {
        [OVOID_OK] = "ok",
        [OVOID_ERROR_ARGUMENT] = "argument",
        [OVOID_ERROR_MEMORY] = "memory",
        [OVOID_ERROR_IO] = "io",
        [OVOID_ERROR_FORMAT] = "format",
        [OVOID_ERROR_EMPTY] = "empty",
        [OVOID_ERROR_DEVICE] = "device",
        [OVOID_ERROR_OPENCL] = "opencl",
        [OVOID_ERROR_CANCELLED] = "cancelled",
        [OVOID_ERROR_LIMIT] = "limit",
        [OVOID_ERROR_NUMERIC] = "numeric",
    };
    if ((int)status < 0 || (size_t)status >= sizeof names / sizeof names[0])
        return "unknown";
    return names[status];
}

ovoid_status ovoid_context_create(ovoid_context **context) {
    if (!context)
        return OVOID_ERROR_ARGUMENT;
    ovoid_context *made = calloc(1, sizeof *made);
    if (!made)
        return OVOID_ERROR_MEMORY;
    *context = made;
    return OVOID_OK;
}

static const char out_of_memory[] = "out of memory";

static void drop_error(ovoid_context *context) {
    if (context->error != out_of_memory)
        free(context->error);
    context->error = NULL;
}

void ovoid_context_destroy(ovoid_context **context) {
    if (!context || !*context || (*context)->calling)
        return;
    ov_tenants_release(*context);
    if ((*context)->close_device)
        (*context)->close_device(*context);
    if ((*context)->drop_times)
        (*context)->drop_times(*context);
    drop_error(*context);
    free(*context);
    *context = NULL;
}

const char *ovoid_context_error(const ovoid_context *context) {
    return context && context->error ? context->error : "";
}

void ovoid_context_on_warning(ovoid_context *context, ovoid_warning_fn fn, void *user) {
    if (!context)
        return;
    context->warn = fn;
    context->warn_user = user;
}

void ovoid_free(void *memory) {
    free(memory);
}

size_t ov_utf8_length(const unsigned char *text) {
    size_t length = text[0] < 0x80 ? 1 : text[0] < 0xc2 ? 0 : text[0] < 0xe0 ? 2 : 3;
    unsigned char low = 0x80, high = 0xbf; /* of the second byte */
    if (text[0] >= 0xf0)
        length = text[0] < 0xf5 ? 4 : 0;
    if (text[0] == 0xe0)
        low = 0xa0;
    if (text[0] == 0xed)
        high = 0x9f; /* surrogates */
    if (text[0] == 0xf0)
        low = 0x90;
    if (text[0] == 0xf4)
        high = 0x8f;
    for (size_t i = 1; i < length; i++, low = 0x80, high = 0xbf)
        if (text[i] < low || text[i] > high)
            return 0;
    return length;
}

/* Control characters play with terminals. A line's end does not, and logs of compilers have several
 * lines. */
static bool is_control(const unsigned char *text) {
    return (*text < 0x20 && *text != '\n') || *text == 0x7f || (*text == 0xc2 && text[1] < 0xa0);
}

/* Messages quote what files and callers hold, and may be shown on a terminal: what is no text, or
 * would control that, becomes '?'. */
static void make_printable(char *text) {
    for (unsigned char *c = (unsigned char *)text; *c;) {
        const size_t length = ov_utf8_length(c);
        if (*c == '\t')
            *c = ' ';
        else if (!length || is_control(c))
            *c = '?';
        else
            c += length - 1;
        c++;
    }
}

static char *format_text(const char *format, va_list args) {
    va_list again;
    va_copy(again, args);
    int length = vsnprintf(NULL, 0, format, again);
    va_end(again);
    if (length < 0)
        return NULL;
    char *text = malloc((size_t)length + 1);
    if (!text)
        return NULL;
    vsnprintf(text, (size_t)length + 1, format, args);
    make_printable(text);
    return text;
}

ovoid_status ov_fail(ovoid_context *context, ovoid_status status, const char *format, ...) {
    if (!context)
        return status;
    va_list args;
    va_start(args, format);
    char *text = format_text(format, args); /* before the old text goes: it may be an argument */
    va_end(args);
    drop_error(context);
    context->error = text ? text : (char *)out_of_memory;
    return status;
}

void ov_warn(ovoid_context *context, const char *format, ...) {
    if (!context || !context->warn)
        return;
    va_list args;
    va_start(args, format);
    char *text = format_text(format, args);
    va_end(args);
    ++context->calling;
    context->warn(text ? text : out_of_memory, context->warn_user);
    --context->calling;
    free(text);
}

void *ov_alloc(ovoid_context *context, size_t count, size_t size, const char *what) {
    void *memory = calloc(count ? count : 1, size ? size : 1);
    if (!memory)
        ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for %s (%zu x %zu bytes)", what, count,
                size);
    return memory;
}

void *ov_copy(ovoid_context *context, const void *from, size_t count, size_t size,
              const char *what) {
    void *const copy = ov_alloc(context, count, size, what);
    if (copy && count > 0)
        memcpy(copy, from, count * size);
    return copy;
}

ovoid_status ov_grow(ovoid_context *context, void *array_pointer, size_t *capacity, size_t need,
                     size_t size, const char *what) {
    if (need <= *capacity)
        return OVOID_OK;
    void *array;
    memcpy(&array, array_pointer, sizeof array);
    size_t room = *capacity + *capacity / 2;
    if (room < need)
        room = need;
    if (room < 16)
        room = 16;
    void *grown = room > SIZE_MAX / size ? NULL : realloc(array, room * size);
    if (!grown)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for %s (%zu x %zu bytes)", what,
                       room, size);
    memcpy(array_pointer, &grown, sizeof grown);
    *capacity = room;
    return OVOID_OK;
}

uint64_t ov_hash(const void *bytes, size_t count) {
    const unsigned char *byte = bytes;
    uint64_t value = 0xcbf29ce484222325u;
    for (size_t i = 0; i < count; i++)
        value = (value ^ byte[i]) * 0x100000001b3u;
    return value;
}

double ov_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
