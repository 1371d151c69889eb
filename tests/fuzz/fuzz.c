#define _GNU_SOURCE /* memfd_create */
#include "fuzz.h"

#include "molecule/text.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <unistd.h>

/* Freed memory is not kept for long: what is kept counts as used, and its limit is to mean
 * something. */
const char *__asan_default_options(void);
const char *__asan_default_options(void) {
    return "quarantine_size_mb=16:detect_leaks=1";
}

void fuzz_require(bool holds, const char *promise) {
    if (holds)
        return;
    fprintf(stderr, "fuzz: broken promise: %s\n", promise);
    abort();
}

static void on_time(int signal) {
    (void)signal;
    static const char text[] = "fuzz: broken promise: 64 KiB take no 10 seconds\n";
    if (write(STDERR_FILENO, text, sizeof text - 1) < 0)
        _exit(1);
    abort();
}

void fuzz_begin(void) {
    const struct itimerval most = {.it_value.tv_sec = 10};
    signal(SIGPROF, on_time);
    setitimer(ITIMER_PROF, &most, NULL);
}

/* ---- input ---------------------------------------------------------------------------------- */

const char *fuzz_file(int number, const void *data, size_t size) {
    static int files[2] = {-1, -1};
    static char paths[2][32];
    int *file = &files[number];
    if (number == 0)
        fuzz_begin();
    if (*file < 0)
        *file = memfd_create("fuzz", MFD_CLOEXEC);
    if (*file < 0 || ftruncate(*file, 0) != 0 ||
        pwrite(*file, data, size, 0) != (ssize_t)size) { /* size 0 as well */
        perror("a file in memory");
        exit(1);
    }
    snprintf(paths[number], sizeof paths[number], "/proc/self/fd/%d", *file);
    return paths[number];
}

uint32_t fuzz_hash(const uint8_t *data, size_t size) {
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ data[i]) * 16777619u;
    return hash ^ hash >> 15;
}

/*
 * A line ends somewhere in a large buffer, and reading past its end is seen by no sanitizer. So
 * each line is given out as a copy in a piece of memory of just its size (linked with --wrap).
 */
ovoid_status __real_ov_text_next(ov_text *text, ov_line *line, bool *end);
ovoid_status __wrap_ov_text_next(ov_text *text, ov_line *line, bool *end);

static void *last_line;

ovoid_status __wrap_ov_text_next(ov_text *text, ov_line *line, bool *end) {
    const ovoid_status status = __real_ov_text_next(text, line, end);
    if (status != OVOID_OK || *end)
        return status;
    free(last_line);
    last_line = malloc(line->length ? line->length : 1);
    if (!last_line)
        abort();
    memcpy(last_line, line->text, line->length);
    line->text = last_line;
    return status;
}

/* ---- messages ------------------------------------------------------------------------------- */

/* Length of the UTF-8 character that text begins with, 0 where it is none or a control character.
 */
static size_t character(const unsigned char *text) {
    if (text[0] >= 0x20 && text[0] < 0x7f)
        return 1;
    const size_t length = text[0] >= 0xf0 && text[0] < 0xf8   ? 4
                          : text[0] >= 0xe0 && text[0] < 0xf0 ? 3
                          : text[0] >= 0xc2 && text[0] < 0xe0 ? 2
                                                              : 0;
    for (size_t i = 1; i < length; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    return text[0] == 0xc2 && text[1] < 0xa0 ? 0 : length;
}

void fuzz_message(const char *text) {
    fuzz_require(text && *text, "a failure or a warning has a message");
    for (const unsigned char *c = (const unsigned char *)text; *c;) {
        const size_t length = character(c);
        if (!length)
            fprintf(stderr, "fuzz: byte %02x at %td of: %s\n", *c, (const char *)c - text, text);
        fuzz_require(length, "messages are UTF-8 without control characters");
        c += length;
    }
}

static void on_warning(const char *text, void *user) {
    (void)user;
    fuzz_message(text);
}

ovoid_context *fuzz_context(void) {
    static ovoid_context *context;
    if (!context && ovoid_context_create(&context) != OVOID_OK)
        exit(1);
    ovoid_context_on_warning(context, on_warning, NULL);
    return context;
}

void fuzz_failed(ovoid_status status, const void *output) {
    fuzz_require(!output, "a failure leaves the output untouched");
    fuzz_require(status == OVOID_ERROR_FORMAT || status == OVOID_ERROR_EMPTY ||
                     status == OVOID_ERROR_ARGUMENT || status == OVOID_ERROR_LIMIT,
                 "what a file holds leads to FORMAT, EMPTY, ARGUMENT or LIMIT");
    fuzz_message(ovoid_context_error(fuzz_context()));
}
