#include "fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NAME_LEAST = 4, NAME_MOST = 48, MODEL_WIDTH = 5 };

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
    if (row->model)
        fprintf(out, "%*d", width, (int)row->model);
    else
        fprintf(out, "%-*s", width, row->input);
    print_count(out, 8, row->atoms);
    print_count(out, 10, row->ellipsoids);
    print_value(out, 4, isfinite(row->distance), row->distance);
    print_value(out, 6, row->measured, row->area);
    print_value(out, 6, row->measured, row->volume);
    fprintf(out, "  %8.2f", row->seconds);
    print_status(out, row->code);
}

/* How many, of what, and where they are. */
static void print_fitted(FILE *out, const fit_job *asked, size_t fitted) {
    const char *const plural = asked->input_count == 1 ? "" : "s";
    fprintf(out, "%zu of %zu ", fitted, asked->input_count);
    if (!asked->numbers) {
        fprintf(out, "molecule%s fitted, models in %s", plural, asked->folder);
        return;
    }
    char *const pattern = fit_outputs_pattern(asked);
    fprintf(out, "model%s of %s fitted, written to %s", plural, asked->input,
            pattern ? pattern : "their files");
    free(pattern);
}

void fit_batch_print(FILE *out, const fit_job *asked, const fit_row *rows, size_t count) {
    const int width = asked->numbers ? MODEL_WIDTH : name_width(rows, count);
    size_t fitted = 0;
    fprintf(out,
            "%-*s     atoms  ellipsoids  distance Å     area Å²   volume Å³   seconds  status\n",
            width, asked->numbers ? "model" : "file");
    for (size_t i = 0; i < count; i++) {
        print_row(out, &rows[i], width);
        fitted += fit_made_model(rows[i].code);
    }
    print_fitted(out, asked, fitted);
    if (count > fitted)
        fprintf(out, "; %zu failed", count - fitted);
    if (asked->input_count > count)
        fprintf(out, "; %zu left out", asked->input_count - count);
    putc('\n', out);
}
