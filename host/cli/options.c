#include "cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

double cli_number_value(const cli_number *number, const void *structure) {
    const char *place = (const char *)structure + number->offset;
    uint32_t count;
    double real;
    if (number->kind == CLI_COUNT) {
        memcpy(&count, place, sizeof count);
        return count;
    }
    memcpy(&real, place, sizeof real);
    return real;
}

/* The bound that a value breaks: "at least 1", "below 1". */
static void print_bound(const cli_number *number, bool low, char *text, size_t size) {
    if (low)
        snprintf(text, size, "%s %.10g", number->above ? "above" : "at least", number->low);
    else if (isfinite(number->high))
        snprintf(text, size, "%s %.10g", number->below ? "below" : "at most", number->high);
    else
        snprintf(text, size, "finite");
}

/* Decimal numbers only, and nothing after them. */
static bool parse_decimal(cli_kind kind, const char *text, double *value) {
    const char *digits = kind == CLI_COUNT ? "0123456789" : "+-.0123456789eE";
    char *end;
    if (text[0] == '\0' || strspn(text, digits) != strlen(text))
        return false;
    *value = strtod(text, &end);
    return *end == '\0';
}

bool cli_number_parse(const cli_number *number, const char *text, void *structure) {
    double value = 0.0;
    bool negative_count = number->kind == CLI_COUNT && text[0] == '-';
    if (!parse_decimal(negative_count ? CLI_REAL : number->kind, text, &value)) {
        cli_error("--%s takes a %s, not '%s'", number->name,
                  number->kind == CLI_COUNT ? "whole number" : "number", text);
        return false;
    }
    bool low = number->above ? value > number->low : value >= number->low;
    bool high = number->below ? value < number->high : value <= number->high;
    if (!low || !high) {
        char bound[80];
        print_bound(number, !low, bound, sizeof bound);
        cli_error("--%s is %s, but must be %s%s%s", number->name, text, bound,
                  number->unit[0] ? " " : "", number->unit);
        return false;
    }
    char *place = (char *)structure + number->offset;
    uint32_t count = (uint32_t)(number->kind == CLI_COUNT ? value : 0.0);
    memcpy(place, number->kind == CLI_COUNT ? (const void *)&count : (const void *)&value,
           number->kind == CLI_COUNT ? sizeof count : sizeof value);
    return true;
}

enum { HELP_INDENT = 26, HELP_WIDTH = 88 };

/* Columns of a word: bytes that do not continue a UTF-8 character. */
static int columns(const char *word, size_t length) {
    int count = 0;
    for (size_t i = 0; i < length; i++)
        count += ((unsigned char)word[i] & 0xc0) != 0x80;
    return count;
}

/* Prints words within [HELP_INDENT, HELP_WIDTH), the cursor being at the former. */
static void print_wrapped(const char *text, FILE *stream) {
    int column = HELP_INDENT;
    while (*text) {
        bool last = strncmp(text, "(default ", 9) == 0; /* and not to be torn apart */
        size_t length = last ? strlen(text) : strcspn(text, " ");
        int width = columns(text, length);
        bool first = column == HELP_INDENT;
        if (!first && column + 1 + width > HELP_WIDTH) {
            fprintf(stream, "\n%*s", HELP_INDENT, "");
            column = HELP_INDENT;
            first = true;
        }
        fprintf(stream, "%s%.*s", first ? "" : " ", (int)length, text);
        column += width + !first;
        text += length;
        text += strspn(text, " ");
    }
    putc('\n', stream);
}

void cli_option_help(const char *option, const char *meaning, FILE *stream) {
    int used = fprintf(stream, "  %s", option);
    if (used < HELP_INDENT)
        fprintf(stream, "%*s", HELP_INDENT - used, "");
    else
        fprintf(stream, "\n%*s", HELP_INDENT, "");
    print_wrapped(meaning, stream);
}

void cli_number_help(const cli_number *number, const void *structure, FILE *stream) {
    char option[64], text[512];
    snprintf(option, sizeof option, "--%s %c", number->name, number->kind == CLI_COUNT ? 'N' : 'X');
    if (structure)
        snprintf(text, sizeof text, "%s (default %.9g%s%s)", number->help,
                 cli_number_value(number, structure), number->unit[0] ? " " : "", number->unit);
    else
        snprintf(text, sizeof text, "%s", number->help);
    cli_option_help(option, text, stream);
}

void cli_number_options(const cli_number *numbers, size_t count, int first,
                        struct option *options) {
    for (size_t i = 0; i < count; i++)
        options[i] = (struct option){numbers[i].name, required_argument, NULL, first + (int)i};
    options[count] = (struct option){NULL, 0, NULL, 0};
}

int cli_bad_option(const char *command, int result, char **argv, const struct option *options) {
    enum { MOST = 64 };
    const char *given = argv[optind - 1];
    if (optopt > 0 && optopt <= 255) {
        cli_error(result == ':' ? "-%c needs a value (see 'ovoid %s --help')"
                                : "there is no option -%c (see 'ovoid %s --help')",
                  optopt, command);
        return CLI_USAGE;
    }
    if (optopt > 255) { /* a known long option */
        cli_error(result == ':' ? "%s needs a value (see 'ovoid %s --help')"
                                : "%s: this option takes no value (see 'ovoid %s --help')",
                  given, command);
        return CLI_USAGE;
    }
    char name[MOST];
    const char *names[MOST] = {NULL};
    for (size_t i = 0; options[i].name && i < MOST - 1; i++)
        names[i] = options[i].name;
    snprintf(name, sizeof name, "%.*s", (int)strcspn(given + 2, "="), given + 2);
    const char *near = cli_nearest(name, names);
    cli_error("there is no option '--%s'%s%s%s (see 'ovoid %s --help')", name,
              near ? "; did you mean '--" : "", near ? near : "", near ? "'?" : "", command);
    return CLI_USAGE;
}

enum { NAME_LENGTH = 32 };

/* Letters to insert, delete or replace to get from a to b; too long names are far from all. */
static size_t edit_distance(const char *a, const char *b) {
    size_t row[NAME_LENGTH + 1], m = strlen(a), n = strlen(b);
    if (m > NAME_LENGTH || n > NAME_LENGTH)
        return SIZE_MAX;
    for (size_t j = 0; j <= n; j++)
        row[j] = j;
    for (size_t i = 1; i <= m; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= n; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            row[j] = best;
        }
    }
    return row[n];
}

const char *cli_nearest(const char *text, const char *const *names) {
    const char *nearest = NULL;
    size_t least = strlen(text) < 4 ? 2 : 3; /* must be nearer than this */
    for (; *names; names++) {
        bool begins = strlen(text) >= 3 && strncmp(text, *names, strlen(text)) == 0;
        size_t distance = begins ? 1 : edit_distance(text, *names);
        if (distance < least) {
            least = distance;
            nearest = *names;
        }
    }
    return nearest;
}
