/*
 * Lines, plain and gzipped. The bytes are read as they are, whatever they are; then as the text of
 * one to three gzip members, whose lines must be those of the plain text.
 */
#include "fuzz.h"

#include "molecule/text.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

static ovoid_status open_text(const void *data, size_t size, int file, ov_text **text) {
    const ovoid_status status = ov_text_open(fuzz_context(), fuzz_file(file, data, size), text);
    if (status != OVOID_OK)
        fuzz_failed(status, *text);
    return status;
}

static void read_all(const uint8_t *data, size_t size) {
    ov_text *text = NULL;
    ov_line line;
    bool end = false;
    uint64_t lines = 0;
    ovoid_status status = open_text(data, size, 0, &text);
    while (status == OVOID_OK && !end) {
        status = ov_text_next(text, &line, &end);
        if (status == OVOID_OK && !end)
            fuzz_require(line.number == ++lines && line.length <= OV_TEXT_LONGEST_LINE &&
                             !memchr(line.text, 0, line.length) &&
                             !memchr(line.text, '\n', line.length) &&
                             !memchr(line.text, '\r', line.length),
                         "lines are numbered, short, and without their endings");
    }
    if (status == OVOID_ERROR_FORMAT && text)
        ov_text_verify(text);
    if (status != OVOID_OK)
        fuzz_failed(status, NULL);
    ov_text_close(&text);
}

/* Appends a gzip member with this text; returns its length. */
static size_t compress_member(const uint8_t *data, size_t size, int level, uint8_t *out,
                              size_t room) {
    z_stream z = {0};
    fuzz_require(deflateInit2(&z, level, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) == Z_OK,
                 "zlib begins");
    z.next_in = (uint8_t *)data;
    z.avail_in = (uInt)size;
    z.next_out = out;
    z.avail_out = (uInt)room;
    fuzz_require(deflate(&z, Z_FINISH) == Z_STREAM_END, "zlib ends");
    deflateEnd(&z);
    return room - z.avail_out;
}

static void compare(ov_text *plain, ov_text *packed) {
    ov_line a, b;
    bool end = false, packed_end = false;
    while (!end) {
        const ovoid_status status = ov_text_next(plain, &a, &end);
        char *copy = status == OVOID_OK && !end ? malloc(a.length + 1) : NULL;
        if (copy)
            memcpy(copy, a.text, a.length); /* the harness keeps one line alone */
        fuzz_require(ov_text_next(packed, &b, &packed_end) == status && packed_end == end,
                     "compressed text has the lines of the plain one");
        if (status != OVOID_OK)
            return;
        if (!end)
            fuzz_require(a.number == b.number && a.length == b.length &&
                             memcmp(copy, b.text, b.length) == 0,
                         "lines of compressed text are those of the plain one");
        free(copy);
    }
}

static void read_compressed(const uint8_t *data, size_t size) {
    const uint32_t chance = fuzz_hash(data, size);
    const size_t members = 1 + chance % 3, room = size + size / 500 + 3 * 64;
    uint8_t *packed = malloc(room);
    size_t used = 0;
    if (!packed)
        abort();
    for (size_t i = 0; i < members; i++) {
        const size_t from = size * i / members, to = size * (i + 1) / members;
        used += compress_member(data + from, to - from, (int)(chance >> 8) % 10, packed + used,
                                room - used);
    }
    ov_text *a = NULL, *b = NULL;
    const ovoid_status plain = open_text(data, size, 0, &a);
    const bool compressed = size >= 2 && data[0] == 0x1f && data[1] == 0x8b;
    if (open_text(packed, used, 1, &b) == OVOID_OK && plain == OVOID_OK && !compressed)
        compare(a, b);
    ov_text_close(&a);
    ov_text_close(&b);
    free(packed);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    read_all(data, size);
    read_compressed(data, size);
    return 0;
}
