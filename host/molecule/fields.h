/*
 * Words and numbers within a line of a molecule file.
 *
 * The numbers are read here and not by strtod(): that one follows the program's locale, where the
 * decimal point may be a comma, and needs text that ends in a NUL.
 */
#ifndef OV_MOLECULE_FIELDS_H
#define OV_MOLECULE_FIELDS_H

#include <stdbool.h>
#include <stddef.h>

typedef struct ov_number {
    double value;    /* infinite where the text is beyond the range of double */
    bool point;      /* written with a decimal point or an exponent: not an integer such as "12" */
    size_t decimals; /* digits after the decimal point */
} ov_number;

/* Reads the longest number that text begins with: sign, digits, point, digits, exponent, where only
 * one digit is compulsory. Returns its length in bytes, 0 if there is none. Correctly rounded for
 * up to 19 significant digits; further ones are dropped. */
size_t ov_number_parse(const char *text, size_t length, ov_number *number);

/* A piece of a line. Numeric are also "nan", "inf" and a row of '*' (a value too wide for its
 * column), with a value that is not finite, so that the error can name what stands there. */
typedef struct ov_field {
    const char *text;
    size_t length;
    bool numeric;
    ov_number number;
} ov_field;

#define OV_FIELDS_MAX 8

/* Cuts a word without blanks into the fields that fixed columns have fused: "81.812-137.418" is two
 * numbers and "A1234-116.238" a residue number and a number. A cut is made only before a sign, and
 * only where everything behind it is numbers with decimal points. Returns how many fields there
 * are; a word that cannot be cut is one field. */
size_t ov_fields_cut(const char *text, size_t length, ov_field fields[OV_FIELDS_MAX]);

/* Whether text ends as a residue number does: in a digit, in a digit and an insertion code, or in
 * the '*' of a number too wide for its column. */
bool ov_is_residue_number(const char *text, size_t length);

static inline bool ov_blank(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}

static inline bool ov_digit(char c) {
    return c >= '0' && c <= '9';
}

static inline bool ov_letter(char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}

/* Next word of [*at, end): moves *at past it and returns its start and length; NULL at the end. */
const char *ov_word_next(const char **at, const char *end, size_t *length);

/* Whether text begins with prefix (given in upper case), in any case. */
bool ov_begins_with(const char *text, size_t length, const char *prefix);

#endif
