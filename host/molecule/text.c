#include "molecule/text.h"

#include "base/progress.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

enum { RAW_ROOM = OV_TEXT_RAW_ROOM, DATA_ROOM = OV_TEXT_ROOM };

struct ov_text {
    ovoid_context *context;
    char *name;
    int file; /* -1 when closed */
    bool own; /* the file is ours to close */
    bool gzip;
    bool inflating; /* zlib holds memory */
    bool in_member; /* between a gzip header and its trailer */
    z_stream zlib;

    unsigned char *raw; /* bytes of the file, raw[raw_at .. raw_end) not yet used */
    size_t raw_at, raw_end;
    bool raw_done;

    char *data; /* text, data[at .. end) not yet handed out */
    size_t at, end;
    bool done;
    bool drop_lf; /* the last line ended in CR: an LF that follows belongs to it */
    uint64_t lines;
    uint64_t read, bytes; /* of the file; bytes 0: not known */
};

const char *ov_text_name(const ov_text *text) {
    return text ? text->name : "molecule";
}

/* The path as it may stand in a message: a control character could play with the terminal. */
static char *printable_name(ovoid_context *context, const char *path) {
    if (strcmp(path, "-") == 0)
        path = "standard input";
    size_t length = strlen(path);
    char *name = ov_alloc(context, length + 1, 1, "a file name");
    if (!name)
        return NULL;
    for (size_t i = 0; i < length; i++)
        name[i] = (unsigned char)path[i] < 0x20 || path[i] == 0x7f ? '?' : path[i];
    return name;
}

/* ---- bytes -------------------------------------------------------------------------------- */

/* Adds what one read() brings to the raw bytes, which must have been used up or be few. */
static ovoid_status read_raw(ov_text *text) {
    memmove(text->raw, text->raw + text->raw_at, text->raw_end - text->raw_at);
    text->raw_end -= text->raw_at;
    text->raw_at = 0;
    ssize_t got;
    while ((got = read(text->file, text->raw + text->raw_end, RAW_ROOM - text->raw_end)) < 0 &&
           errno == EINTR) {
        const ovoid_status asked = ov_progress_ask(text->context);
        if (asked != OVOID_OK)
            return asked;
    }
    if (got < 0)
        return ov_fail(text->context, OVOID_ERROR_IO, "%s: cannot read: %s", text->name,
                       strerror(errno));
    text->raw_end += (size_t)got;
    text->read += (uint64_t)got;
    text->raw_done = got == 0;
    return OVOID_OK;
}

static ovoid_status damaged(ov_text *text, const char *how) {
    return ov_fail(text->context, OVOID_ERROR_FORMAT, "%s: %s", text->name, how);
}

/* Begins the next gzip member, or finds the end. Zeros after the last member are padding. */
static ovoid_status next_member(ov_text *text) {
    ovoid_status status = OVOID_OK;
    while (text->raw_at < text->raw_end && text->raw[text->raw_at] == 0)
        text->raw_at++;
    while (!text->raw_done && text->raw_end - text->raw_at < 2) {
        OV_TRY(read_raw(text));
        while (text->raw_at < text->raw_end && text->raw[text->raw_at] == 0)
            text->raw_at++;
    }
    if (text->raw_at == text->raw_end) {
        text->done = true;
        return OVOID_OK;
    }
    if (text->raw_end - text->raw_at < 2 || text->raw[text->raw_at] != 0x1f ||
        text->raw[text->raw_at + 1] != 0x8b)
        return damaged(text, "gzip data is followed by something else");
    if (inflateReset(&text->zlib) != Z_OK)
        return damaged(text, "gzip data cannot be decompressed");
    text->in_member = true;
cleanup:
    return status;
}

static ovoid_status inflate_some(ov_text *text) {
    ovoid_status status = OVOID_OK;
    size_t before = text->end;
    while (text->end == before && !text->done) {
        if (!text->in_member) {
            OV_TRY(next_member(text));
            continue;
        }
        if (text->raw_at == text->raw_end && !text->raw_done)
            OV_TRY(read_raw(text));
        z_stream *z = &text->zlib;
        z->next_in = text->raw + text->raw_at;
        z->avail_in = (uInt)(text->raw_end - text->raw_at);
        z->next_out = (unsigned char *)text->data + text->end;
        z->avail_out = (uInt)(DATA_ROOM - text->end);
        int result = inflate(z, Z_NO_FLUSH);
        text->raw_at = text->raw_end - z->avail_in;
        text->end = DATA_ROOM - z->avail_out;
        if (result == Z_STREAM_END)
            text->in_member = false;
        else if (result == Z_MEM_ERROR)
            return ov_fail(text->context, OVOID_ERROR_MEMORY, "out of memory to decompress %s",
                           text->name);
        else if (result != Z_OK && result != Z_BUF_ERROR)
            return ov_fail(text->context, OVOID_ERROR_FORMAT, "%s: gzip data is damaged: %s",
                           text->name, z->msg ? z->msg : "it asks for a dictionary");
        else if (text->raw_at == text->raw_end && text->raw_done && text->end == before)
            return damaged(text, "gzip data is cut off: the file is incomplete");
    }
cleanup:
    return status;
}

static ovoid_status copy_some(ov_text *text) {
    if (text->raw_at == text->raw_end && !text->raw_done) {
        ovoid_status status = read_raw(text);
        if (status != OVOID_OK)
            return status;
    }
    size_t count = text->raw_end - text->raw_at;
    if (count > DATA_ROOM - text->end)
        count = DATA_ROOM - text->end;
    memcpy(text->data + text->end, text->raw + text->raw_at, count);
    text->raw_at += count;
    text->end += count;
    text->done = count == 0 && text->raw_done;
    return OVOID_OK;
}

/* Makes room and adds text, at least one byte unless it is done. */
static ovoid_status fill(ov_text *text) {
    const ovoid_status asked = ov_progress_step(text->context, text->read, text->bytes);
    if (asked != OVOID_OK)
        return asked;
    memmove(text->data, text->data + text->at, text->end - text->at);
    text->end -= text->at;
    text->at = 0;
    return text->gzip ? inflate_some(text) : copy_some(text);
}

/* ---- opening ------------------------------------------------------------------------------ */

static ovoid_status recognise_compression(ov_text *text) {
    static const struct {
        const char *magic;
        size_t length;
        const char *name;
    } others[] = {{"BZh", 3, "bzip2"},
                  {"\xfd"
                   "7zXZ",
                   5, "xz"},
                  {"\x28\xb5\x2f\xfd", 4, "zstd"},
                  {"PK\x03\x04", 4, "zip"},
                  {"\x1f\x9d", 2, "compress"}};
    ovoid_status status = OVOID_OK;
    while (!text->raw_done && text->raw_end < 5) /* a pipe may bring one byte at a time */
        OV_TRY(read_raw(text));
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        if (text->raw_end >= others[i].length &&
            memcmp(text->raw, others[i].magic, others[i].length) == 0)
            return ov_fail(text->context, OVOID_ERROR_FORMAT,
                           "%s: compressed with %s; of compressed files only gzip is read",
                           text->name, others[i].name);
    text->gzip = text->raw_end >= 2 && text->raw[0] == 0x1f && text->raw[1] == 0x8b;
    if (text->gzip) {
        if (inflateInit2(&text->zlib, 15 + 16) != Z_OK) /* largest window, gzip wrapper */
            return ov_fail(text->context, OVOID_ERROR_MEMORY, "out of memory to decompress %s",
                           text->name);
        text->inflating = true;
    }
cleanup:
    return status;
}

static ovoid_status recognise_encoding(ov_text *text) {
    ovoid_status status = OVOID_OK;
    while (!text->done && text->end - text->at < 3)
        OV_TRY(fill(text));
    size_t count = text->end - text->at;
    const char *data = text->data + text->at;
    if (count >= 2 && (memcmp(data, "\xff\xfe", 2) == 0 || memcmp(data, "\xfe\xff", 2) == 0))
        return damaged(text, "this is UTF-16 text; save it as ASCII or UTF-8");
    if (count >= 3 && memcmp(data, "\xef\xbb\xbf", 3) == 0)
        text->at += 3;
cleanup:
    return status;
}

ovoid_status ov_text_open(ovoid_context *context, const char *path, ov_text **text) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ov_text *made = ov_alloc(context, 1, sizeof *made, "a text reader");
    if (!made)
        return status;
    made->context = context;
    made->file = -1;
    made->name = printable_name(context, path);
    made->raw = ov_alloc(context, RAW_ROOM, 1, "a read buffer");
    made->data = ov_alloc(context, DATA_ROOM, 1, "a read buffer");
    if (!made->name || !made->raw || !made->data)
        goto cleanup;
    made->own = strcmp(path, "-") != 0;
    made->file = made->own ? open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY) : STDIN_FILENO;
    if (made->file < 0) {
        status =
            ov_fail(context, OVOID_ERROR_IO, "%s: cannot open: %s", made->name, strerror(errno));
        goto cleanup;
    }
    struct stat info;
    if (fstat(made->file, &info) == 0 && S_ISREG(info.st_mode))
        made->bytes = (uint64_t)info.st_size;
    OV_TRY(recognise_compression(made));
    OV_TRY(recognise_encoding(made));
    *text = made;
    return OVOID_OK;
cleanup:
    ov_text_close(&made);
    return status;
}

void ov_text_close(ov_text **text) {
    if (!text || !*text)
        return;
    ov_text *gone = *text;
    if (gone->inflating)
        inflateEnd(&gone->zlib);
    if (gone->own && gone->file >= 0)
        close(gone->file);
    free(gone->name);
    free(gone->raw);
    free(gone->data);
    free(gone);
    *text = NULL;
}

/* ---- lines -------------------------------------------------------------------------------- */

static ovoid_status hand_out(ov_text *text, size_t length, ov_line *line) {
    *line = (ov_line){text->data + text->at, length, ++text->lines};
    if (length > OV_TEXT_LONGEST_LINE)
        return ov_text_fail(text, line, line->text + OV_TEXT_LONGEST_LINE,
                            "the line is longer than %zu bytes; this is no molecule file",
                            OV_TEXT_LONGEST_LINE);
    const char *nul = memchr(line->text, 0, length);
    if (nul)
        return ov_text_fail(text, line, nul, "a zero byte; this is no text file");
    return OVOID_OK;
}

ovoid_status ov_text_next(ov_text *text, ov_line *line, bool *end) {
    ovoid_status status = OVOID_OK;
    size_t seen = 0; /* bytes known to hold no line ending */
    *end = false;
    for (;;) {
        if (text->drop_lf && text->at < text->end) {
            text->at += text->data[text->at] == '\n';
            text->drop_lf = false;
        }
        const char *from = text->data + text->at, *p = from + seen, *stop = text->data + text->end;
        while (p < stop && *p != '\n' && *p != '\r')
            p++;
        seen = (size_t)(p - from);
        if (p < stop || seen > OV_TEXT_LONGEST_LINE || (text->done && seen > 0)) {
            status = hand_out(text, seen, line);
            text->at += seen + (p < stop);
            text->drop_lf = p < stop && *p == '\r';
            return status;
        }
        if (text->done)
            break;
        OV_TRY(fill(text));
    }
    *end = true;
cleanup:
    return status;
}

ovoid_status ov_text_verify(ov_text *text) {
    ovoid_status status = OVOID_OK;
    while (text->gzip && !text->done) {
        text->at = text->end;
        OV_TRY(fill(text));
    }
cleanup:
    return status;
}

/* ---- messages ----------------------------------------------------------------------------- */

ovoid_status ov_text_fail(ov_text *text, const ov_line *line, const char *at, const char *format,
                          ...) {
    char reason[512];
    va_list args;
    va_start(args, format);
    vsnprintf(reason, sizeof reason, format, args);
    va_end(args);
    return ov_fail(text->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %s", text->name,
                   (unsigned long long)line->number, (size_t)(at - line->text) + 1, reason);
}

ovoid_status ov_text_limit(ovoid_context *context, const ov_text *text, uint64_t line, size_t most,
                           const char *what) {
    return ov_fail(context, OVOID_ERROR_LIMIT, "%s:%llu:1: more than %zu %s", text->name,
                   (unsigned long long)line, most, what);
}

const char *ov_quote_text(ov_quote *quote, const char *text, size_t length) {
    const size_t most = 40;
    char *out = quote->text;
    size_t shown = length < most ? length : most;
    *out++ = '\'';
    for (size_t i = 0; i < shown; i++) {
        unsigned char c = (unsigned char)text[i];
        if (c >= 0x20 && c < 0x7f)
            *out++ = (char)c;
        else
            out += snprintf(out, 5, "\\x%02x", c);
    }
    snprintf(out, 5, length > most ? "...'" : "'");
    return quote->text;
}
