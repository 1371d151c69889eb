/*
 * Lines of a text file, a pipe or standard input, plain or gzipped, with the position of what is
 * wrong in them. Reads in pieces: memory does not grow with the file.
 */
#ifndef OV_MOLECULE_TEXT_H
#define OV_MOLECULE_TEXT_H

#include "base/base.h"

typedef struct ov_text ov_text;

typedef struct ov_line {
    const char
        *text; /* without its ending, not NUL-terminated; valid until the next line is read */
    size_t length;
    uint64_t number; /* from 1 */
} ov_line;

/* Longest line that is read, in bytes; and room for bytes of the file and for text, which has to be
 * more than such a line. Builds for fuzzing make them small (CMakeLists.txt), so that
 * small inputs come to their limits. */
#ifndef OV_TEXT_LONGEST_LINE
#define OV_TEXT_LONGEST_LINE ((size_t)64 * 1024)
#define OV_TEXT_RAW_ROOM ((size_t)256 * 1024)
#define OV_TEXT_ROOM ((size_t)1024 * 1024)
#endif

/* Opens path, "-" for standard input. gzip is recognised by content (members in a row are one
 * text); a UTF-8 byte order mark is dropped. OVOID_ERROR_IO where the file cannot be opened or
 * read, OVOID_ERROR_FORMAT for other compressions and for UTF-16. */
ovoid_status ov_text_open(ovoid_context *context, const char *path, ov_text **text);
void ov_text_close(ov_text **text);

/* Reads the next line. Lines end in LF, CR LF or CR; the last one may lack its ending. *end is set
 * once there is no further line. OVOID_ERROR_IO on a read error; OVOID_ERROR_FORMAT for damaged
 * gzip data, a NUL byte, or a line that is too long. */
ovoid_status ov_text_next(ov_text *text, ov_line *line, bool *end);

/* Reads what is left and drops it, for the errors that this finds: where a line of a gzip file made
 * no sense, the checksum tells whether the file is damaged. Does nothing for a plain file. */
ovoid_status ov_text_verify(ov_text *text);

/* The name for messages: the path, or "standard input". */
const char *ov_text_name(const ov_text *text);

/* Records OVOID_ERROR_FORMAT as "name:line:column: reason"; `at` points into the line, at the byte
 * that the column is to name. */
#if defined(__GNUC__)
__attribute__((format(printf, 4, 5)))
#endif
ovoid_status
ov_text_fail(ov_text *text, const ov_line *line, const char *at, const char *format, ...);

/* Records OVOID_ERROR_LIMIT as "name:line:1: more than `most` `what`", of something that no
 * molecule's file has so many of: memory is not to follow such a file. */
ovoid_status ov_text_limit(ovoid_context *context, const ov_text *text, uint64_t line, size_t most,
                           const char *what);

/* Room for a piece of a file in quotes in a message. */
typedef struct ov_quote {
    char text[176];
} ov_quote;

/* Writes text in quotes: bytes that are no printable ASCII as \xNN, cut after 40 bytes. Returns
 * quote->text. */
const char *ov_quote_text(ov_quote *quote, const char *text, size_t length);

#endif
