/*
 * What the writers share: numbers with a decimal point in every locale, and extensions.
 */
#ifndef OV_TEXT_H
#define OV_TEXT_H

#include "base/base.h"

#include <locale.h>
#include <stdio.h>

/* This thread's numbers get a decimal point until ov_locale_leave(). Starts as {0}. */
typedef struct ov_locale {
    locale_t c, before;
} ov_locale;

ovoid_status ov_locale_enter(ovoid_context *context, ov_locale *locale);

/* Nothing happens on one that was not entered. */
void ov_locale_leave(ov_locale *locale);

/* OVOID_ERROR_IO with the reason in errno if a write to the stream failed; the writers stop at a
 * failure, so that the reason is still there. */
ovoid_status ov_stream_check(ovoid_context *context, FILE *stream, const char *path);

/* The end of a path's last part from its last dot on, "" without one. A leading dot begins no
 * extension. */
const char *ov_extension(const char *path);

/* Whether an extension is one of `known` (".a .b .c"), in any case of letters. */
bool ov_extension_is(const char *extension, const char *known);

/* Name of the last part of a path without its extension, for titles: letters, digits, '-' and '_';
 * everything else becomes '_'. "ovoid" for standard output and the like. */
void ov_title(const char *path, char *title, size_t size);

/* Text as a string of JSON (RFC 8259), also within a page: '<' is escaped. What is no UTF-8 (a file
 * name may be anything) is made so. The second one without the quotes about it. */
void ov_json_string(const char *string, FILE *stream);
void ov_json_text(const char *string, FILE *stream);

/* Text between the tags of XML or HTML, made UTF-8 likewise; control characters become spaces. */
void ov_markup_text(const char *string, FILE *stream);

#endif
