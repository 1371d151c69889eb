#include "fit.h"

#include <math.h>
#include <string.h>

enum { NAME_LEAST = 4, NAME_MOST = 48 };

bool fit_made_model(int code) {
    return code == CLI_OK || code == CLI_GOAL;
}

const char *fit_status_name(int code) {
    return code == CLI_OK     ? "done"
           : code == CLI_GOAL ? "goal not reached"
           : code == CLI_TIME ? "out of time"
                              : "failed";
}

static int name_width(const fit_row *rows, size_t count) {
    size_t width = NAME_LEAST;
    for (size_t i = 0; i < count; i++) {
        const size_t length = strlen(rows[i].input);
        if (length > width)
            width = length < NAME_MOST ? length : NAME_MOST;
    }
    return (int)width;
}

static void print_count(FILE *out, int width, uint64_t number) {
    if (number)
        fprintf(out, "  %*llu", width, (unsigned long long)number);
    else
        fprintf(out, "  %*s", width, "-");
}

static void print_value(FILE *out, int digits, bool known, double value) {
    char text[64] = "-";
    if (known)
        snprintf(text, sizeof text, "%.*g", digits, value);
    fprintf(out, "  %10s", text);
}

static void print_status(FILE *out, int code) {
    fprintf(out, "  %s", fit_status_name(code));
    if (!fit_made_model(code))
        fprintf(out, " (%d)", code);
    putc('\n', out);
}

/* Names may be longer than their column. */
static void print_row(FILE *out, const fit_row *row, int width) {
    fprintf(out, "%-*s", width, row->input);
    print_count(out, 8, row->atoms);
    print_count(out, 10, row->ellipsoids);
    print_value(out, 4, isfinite(row->distance), row->distance);
    print_value(out, 6, row->measured, row->area);
    print_value(out, 6, row->measured, row->volume);
    fprintf(out, "  %8.2f", row->seconds);
    print_status(out, row->code);
}

void fit_batch_print(FILE *out, const fit_row *rows, size_t count, size_t asked,
                     const char *folder) {
    const int width = name_width(rows, count);
    size_t fitted = 0;
    fprintf(out,
            "%-*s     atoms  ellipsoids  distance Å     area Å²   volume Å³   seconds  status\n",
            width, "file");
    for (size_t i = 0; i < count; i++) {
        print_row(out, &rows[i], width);
        fitted += fit_made_model(rows[i].code);
    }
    fprintf(out, "%zu of %zu molecule%s fitted, models in %s", fitted, asked, asked == 1 ? "" : "s",
            folder);
    if (count > fitted)
        fprintf(out, "; %zu failed", count - fitted);
    if (asked > count)
        fprintf(out, "; %zu left out", asked - count);
    putc('\n', out);
}
