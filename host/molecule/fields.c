#include "molecule/fields.h"

#include <inttypes.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* mantissa * 10^exponent. */
static double scale(uint64_t mantissa, int exponent) {
    static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    /* Both factors are exact in double, so the one operation rounds correctly. */
    if (mantissa <= UINT64_C(1) << 53 && exponent >= -22 && exponent <= 22)
        return exponent < 0 ? (double)mantissa / powers[-exponent]
                            : (double)mantissa * powers[exponent];
    /* No decimal point in this text, hence nothing for a locale to change. */
    char text[48];
    snprintf(text, sizeof text, "%" PRIu64 "e%d", mantissa, exponent);
    return strtod(text, NULL);
}

/* Length of the exponent "e-05" that text begins with, 0 if it begins with none. */
static size_t parse_exponent(const char *text, const char *end, int *exponent) {
    const char *p = text;
    if (p == end || (*p != 'e' && *p != 'E'))
        return 0;
    p++;
    bool negative = false;
    if (p < end && (*p == '-' || *p == '+'))
        negative = *p++ == '-';
    if (p == end || !ov_digit(*p))
        return 0;
    int value = 0;
    for (; p < end && ov_digit(*p); p++)
        if (value < 100000)
            value = 10 * value + (*p - '0');
    *exponent = negative ? -value : value;
    return (size_t)(p - text);
}

size_t ov_number_parse(const char *text, size_t length, ov_number *number) {
    const uint64_t room = UINT64_C(1000000000000000000); /* below it one more digit fits */
    const char *p = text, *end = text + length;
    bool negative = false;
    if (p < end && (*p == '-' || *p == '+'))
        negative = *p++ == '-';

    uint64_t mantissa = 0;
    int exponent = 0;
    const char *digits = p;
    for (; p < end && ov_digit(*p); p++) {
        if (mantissa < room)
            mantissa = 10 * mantissa + (uint64_t)(*p - '0');
        else
            exponent++;
    }
    size_t whole = (size_t)(p - digits), decimals = 0;
    bool point = p < end && *p == '.';
    if (point) {
        digits = ++p;
        for (; p < end && ov_digit(*p); p++)
            if (mantissa < room) {
                mantissa = 10 * mantissa + (uint64_t)(*p - '0');
                exponent--;
            }
        decimals = (size_t)(p - digits);
    }
    if (whole + decimals == 0)
        return 0;
    int written = 0;
    size_t suffix = parse_exponent(p, end, &written);

    double value = mantissa ? scale(mantissa, exponent + written) : 0.0;
    number->value = negative ? -value : value;
    number->point = point || suffix > 0;
    number->decimals = decimals;
    return (size_t)(p - text) + suffix;
}

bool ov_begins_with(const char *text, size_t length, const char *prefix) {
    for (size_t i = 0; prefix[i]; i++) {
        if (i == length)
            return false;
        char c = text[i];
        if (c >= 'a' && c <= 'z')
            c = (char)(c - 'a' + 'A');
        if (c != prefix[i])
            return false;
    }
    return true;
}

const char *ov_word_next(const char **at, const char *end, size_t *length) {
    const char *p = *at;
    while (p < end && ov_blank(*p))
        p++;
    const char *word = p;
    while (p < end && !ov_blank(*p))
        p++;
    *at = p;
    *length = (size_t)(p - word);
    return *length ? word : NULL;
}

bool ov_is_residue_number(const char *text, size_t length) {
    if (length > 1 && ov_letter(text[length - 1]) && ov_digit(text[length - 2]))
        return true;
    return length > 0 && (ov_digit(text[length - 1]) || text[length - 1] == '*');
}

static bool is_not_finite(const char *text, size_t length) {
    size_t stars = 0;
    while (stars < length && text[stars] == '*')
        stars++;
    if (stars && stars == length)
        return true;
    if (length && (*text == '-' || *text == '+'))
        text++, length--;
    return (length == 3 &&
            (ov_begins_with(text, length, "NAN") || ov_begins_with(text, length, "INF"))) ||
           (length == 8 && ov_begins_with(text, length, "INFINITY")) ||
           (length > 3 && ov_begins_with(text, length, "1.#"));
}

/* Cuts text into nothing but numbers; returns 0 where that cannot be done. Numbers behind a sign
 * within the word must have a decimal point, and all of them if `points`. */
static size_t cut_numbers(const char *text, size_t length, bool points, ov_field *fields,
                          size_t room) {
    size_t count = 0;
    for (size_t at = 0; at < length; count++) {
        if (count == room || (at > 0 && text[at] != '-' && text[at] != '+'))
            return 0;
        ov_field *field = &fields[count];
        size_t used = ov_number_parse(text + at, length - at, &field->number);
        if (!used || ((at > 0 || points) && !field->number.point))
            return 0;
        field->text = text + at;
        field->length = used;
        field->numeric = true;
        at += used;
    }
    return count;
}

size_t ov_fields_cut(const char *text, size_t length, ov_field fields[OV_FIELDS_MAX]) {
    size_t count = cut_numbers(text, length, false, fields, OV_FIELDS_MAX);
    if (count)
        return count;
    bool not_finite = is_not_finite(text, length);
    if (!not_finite && length && (ov_digit(text[length - 1]) || text[length - 1] == '.'))
        for (size_t at = 1; at < length; at++) {
            if ((text[at] != '-' && text[at] != '+') || !ov_is_residue_number(text, at))
                continue;
            count = cut_numbers(text + at, length - at, true, fields + 1, OV_FIELDS_MAX - 1);
            if (count) {
                fields[0] = (ov_field){.text = text, .length = at};
                return count + 1;
            }
        }
    fields[0] = (ov_field){.text = text, .length = length, .numeric = not_finite};
    if (not_finite)
        fields[0].number = (ov_number){.value = NAN, .point = true};
    return 1;
}
