#include "write/model_file.h"

#include "base/file.h"
#include "base/progress.h"
#include "write/text.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- writing ------------------------------------------------------------------------------ */

static void write_placement(const ovoid_motion *placement, FILE *stream) {
    double values[OV_PLACEMENT_VALUES];
    memcpy(values, placement, sizeof values);
    fputs("# placement:", stream);
    for (size_t i = 0; i < OV_PLACEMENT_VALUES; i++)
        fprintf(stream, " %.17g", values[i]);
    putc('\n', stream);
}

static void write_header(const ovoid_model *model, FILE *stream) {
    fprintf(stream, "# %s %d\n", OV_MODEL_FILE_MAGIC,
            model->placement_count > 0 ? OV_MODEL_FILE_VERSION_PLACED : OV_MODEL_FILE_VERSION);
    fprintf(stream, "# decay: %.9g\n# isovalue: %.9g\n", model->decay, model->isovalue);
    for (size_t i = 0; i < model->note_count; i++)
        fprintf(stream, "# %s\n", model->notes[i]);
    for (size_t n = 0; n < model->placement_count; n++)
        write_placement(&model->placements[n], stream);
    for (size_t i = 0; i < OV_ELLIPSOID_VALUES; i++)
        fprintf(stream, "%s%s", i ? " " : "# ", ov_ellipsoid_value_name(i));
    putc('\n', stream);
}

static void write_ellipsoid(const ovoid_ellipsoid *ellipsoid, FILE *stream) {
    double values[OV_ELLIPSOID_VALUES];
    memcpy(values, ellipsoid, sizeof values);
    for (size_t i = 0; i < OV_ELLIPSOID_VALUES; i++)
        fprintf(stream, "%s%.9g", i ? " " : "", values[i]);
    putc('\n', stream);
}

ovoid_status ovoid_model_write(ovoid_context *context, const ovoid_model *model, const char *path) {
    OV_NEED(context, context);
    OV_NEED(context, model);
    OV_NEED(context, path);
    ovoid_status status = OVOID_OK;
    ov_output output = {0};
    ov_locale locale = {0};
    ov_progress_begin(context, "write");
    OV_TRY(ov_locale_enter(context, &locale));
    OV_TRY(ov_output_open(context, path, &output));
    write_header(model, output.stream);
    for (size_t i = 0; i < model->unit_count && !ferror(output.stream); i++) {
        OV_TRY(ov_progress_turn(context, i, model->unit_count));
        write_ellipsoid(&model->unit[i], output.stream);
    }
    status = ov_output_commit(context, &output); /* reports a failed write too */

cleanup:
    ov_output_abandon(&output);
    ov_locale_leave(&locale);
    ov_progress_end(context);
    return status;
}

/* ---- reading ------------------------------------------------------------------------------ */

enum { LINE_BYTES = 1 << 16 };

/* All notes take at most so many bytes, and each takes some beside its text. */
enum { NOTES_BYTES_MAX = 1 << 24, NOTE_ROOM = 48 };

typedef struct reader {
    ovoid_context *context;
    const char *name; /* of the file, for errors */
    FILE *stream;
    uint64_t line_number;
    char line[LINE_BYTES]; /* without the line end */
    size_t length;
    ovoid_model *model; /* notes go here; the rest at the end */
    long version;
    ovoid_ellipsoid *ellipsoids;
    size_t count, capacity;
    ovoid_motion *placements;
    size_t placement_count, placement_capacity;
    size_t notes_bytes;
    double decay, isovalue; /* NAN until given */
} reader;

/* A format error at a byte of the current line. */
static ovoid_status fail_at(const reader *r, size_t column, const char *reason) {
    return ov_fail(r->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %s", r->name,
                   (unsigned long long)r->line_number, column + 1, reason);
}

/* The same with the value's column name or key before the reason. */
static ovoid_status fail_value(const reader *r, size_t column, const char *what,
                               const char *reason) {
    return ov_fail(r->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %s %s", r->name,
                   (unsigned long long)r->line_number, column + 1, what, reason);
}

/* Reads the next line; *end at the end of the file. */
static ovoid_status next_line(reader *r, bool *end) {
    int c;
    r->length = 0;
    r->line_number++;
    errno = 0;
    while ((c = getc_unlocked(r->stream)) != EOF && c != '\n') {
        if (c == '\0')
            return fail_at(r, r->length, "a zero byte: this is not a text file");
        if (r->length == LINE_BYTES - 1)
            return fail_at(r, r->length, "the line is too long for a model file");
        r->line[r->length++] = (char)c;
    }
    if (c == EOF && ferror(r->stream))
        return ov_fail(r->context, OVOID_ERROR_IO, "cannot read '%s': %s", r->name,
                       strerror(errno));
    *end = c == EOF && r->length == 0;
    while (r->length && strchr(" \t\r", r->line[r->length - 1]))
        r->length--;
    r->line[r->length] = '\0';
    return OVOID_OK;
}

static size_t skip_blanks(const reader *r, size_t at) {
    return at + strspn(r->line + at, " \t");
}

/* Reads the number in bytes [at, at + length) of the line: decimal, and all of them. */
static ovoid_status read_number(const reader *r, size_t at, size_t length, const char *what,
                                double *number) {
    char *end = NULL;
    /* strtod() alone would take hexadecimal numbers, "inf" and "nan". */
    if (length && strspn(r->line + at, "+-.0123456789eE") >= length)
        *number = strtod(r->line + at, &end);
    if (!end || end != r->line + at + length)
        return ov_fail(r->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %s is not a number: '%.*s'",
                       r->name, (unsigned long long)r->line_number, at + 1, what,
                       length < 40 ? (int)length : 40, r->line + at);
    return isfinite(*number) ? OVOID_OK : fail_value(r, at, what, "is too large");
}

/* The last ellipsoid that was read is one of a unit. */
static ovoid_status check_placed(const reader *r) {
    const char *problem = ov_placed_problem(&r->ellipsoids[r->count - 1]);
    if (problem)
        return fail_value(r, 0, "ellipsoid:", problem);
    if (r->placement_count == 0)
        return fail_at(r, 0, "a model file of version 2 has placements before its ellipsoids");
    if (r->count > UINT32_MAX / r->placement_count)
        return ov_fail(r->context, OVOID_ERROR_LIMIT,
                       "%s:%llu:1: the %zu placements of so many ellipsoids are more than %lu",
                       r->name, (unsigned long long)r->line_number, r->placement_count,
                       (unsigned long)UINT32_MAX);
    return OVOID_OK;
}

static ovoid_status read_ellipsoid(reader *r) {
    double values[OV_ELLIPSOID_VALUES];
    size_t at = skip_blanks(r, 0);
    for (size_t i = 0; i < OV_ELLIPSOID_VALUES; i++) {
        const char *name = ov_ellipsoid_value_name(i);
        if (at == r->length)
            return fail_value(r, at, name, "is missing: an ellipsoid is ten numbers");
        size_t length = strcspn(r->line + at, " \t");
        ovoid_status status = read_number(r, at, length, name, &values[i]);
        if (status != OVOID_OK)
            return status;
        const char *problem = ov_ellipsoid_value_problem(i, values[i]);
        if (problem)
            return fail_value(r, at, name, problem);
        at = skip_blanks(r, at + length);
    }
    if (at != r->length)
        return fail_at(r, at, "more than the ten numbers of an ellipsoid");
    ovoid_status status = ov_grow(r->context, &r->ellipsoids, &r->capacity, r->count + 1,
                                  sizeof *r->ellipsoids, "a model's ellipsoids");
    if (status != OVOID_OK)
        return status;
    memcpy(&r->ellipsoids[r->count++], values, sizeof values);
    return r->version == OV_MODEL_FILE_VERSION_PLACED ? check_placed(r) : OVOID_OK;
}

/* The numbers of a placement, from a byte of the line on. */
static ovoid_status read_motion(const reader *r, size_t at, ovoid_motion *placement) {
    static const char *const names[OV_PLACEMENT_VALUES] = {"r11", "r12", "r13", "r21", "r22", "r23",
                                                           "r31", "r32", "r33", "t1",  "t2",  "t3"};
    double values[OV_PLACEMENT_VALUES];
    for (size_t i = 0; i < OV_PLACEMENT_VALUES; i++) {
        if (at == r->length)
            return fail_value(r, at, names[i], "is missing: a placement is twelve numbers");
        const size_t length = strcspn(r->line + at, " \t");
        const ovoid_status status = read_number(r, at, length, names[i], &values[i]);
        if (status != OVOID_OK)
            return status;
        at = skip_blanks(r, at + length);
    }
    if (at != r->length)
        return fail_at(r, at, "more than the twelve numbers of a placement");
    memcpy(placement, values, sizeof values);
    return OVOID_OK;
}

/* Of a line "# placement: ...", whose numbers begin at `value`. */
static ovoid_status read_placement(reader *r, size_t key, size_t value) {
    ovoid_status status = OVOID_OK;
    ovoid_motion placement;
    if (r->version != OV_MODEL_FILE_VERSION_PLACED)
        return fail_at(r, key, "a file with placements begins with '# ovoid model 2'");
    if (r->count > 0)
        return fail_at(r, key, "placements come before the first ellipsoid");
    OV_TRY(read_motion(r, value, &placement));
    const char *problem = ov_placement_problem(&placement);
    if (problem)
        return fail_value(r, value, "placement:", problem);
    if (r->placement_count == OVOID_MODEL_PLACEMENTS_MAX)
        return ov_fail(r->context, OVOID_ERROR_LIMIT, "%s:%llu:1: more than %d placements", r->name,
                       (unsigned long long)r->line_number, OVOID_MODEL_PLACEMENTS_MAX);
    OV_TRY(ov_grow(r->context, &r->placements, &r->placement_capacity, r->placement_count + 1,
                   sizeof *r->placements, "a model's placements"));
    r->placements[r->placement_count++] = placement;
cleanup:
    return status;
}

/* The first line says what the file is. */
static ovoid_status read_magic(reader *r) {
    static const char magic[] = OV_MODEL_FILE_MAGIC;
    static const char mark[] = "\xef\xbb\xbf"; /* some editors begin a file with it */
    size_t at = strncmp(r->line, mark, 3) == 0 ? 3 : 0;
    size_t text = r->line[at] == '#' ? skip_blanks(r, at + 1) : at;
    if (text == at || strncmp(r->line + text, magic, sizeof magic - 1) != 0)
        return fail_at(r, 0, "not a model file: its first line would be '# ovoid model 1'");
    text = skip_blanks(r, text + sizeof magic - 1);
    char *end;
    long version = strtol(r->line + text, &end, 10);
    if (end == r->line + text || *end)
        return fail_at(r, text, "the version of the model file is not a number");
    if (version != OV_MODEL_FILE_VERSION && version != OV_MODEL_FILE_VERSION_PLACED)
        return ov_fail(
            r->context, OVOID_ERROR_FORMAT,
            "%s:%llu:%zu: the model file has version %ld, but Ovoid %s reads versions %d and %d",
            r->name, (unsigned long long)r->line_number, text + 1, version, ovoid_version(),
            OV_MODEL_FILE_VERSION, OV_MODEL_FILE_VERSION_PLACED);
    r->version = version;
    return OVOID_OK;
}

/* A '#' line: the surface's constants, a placement, a note, or a remark of no concern. Only the
 * lines before the first ellipsoid are the header. */
static ovoid_status read_hash_line(reader *r) {
    size_t key = skip_blanks(r, skip_blanks(r, 0) + 1);
    size_t colon = key + strcspn(r->line + key, ":");
    if (colon == r->length || (r->line[colon + 1] && r->line[colon + 1] != ' '))
        return OVOID_OK;
    size_t value = skip_blanks(r, colon + 1);
    r->line[colon] = '\0';
    bool is_placement = strcmp(r->line + key, "placement") == 0;
    bool is_decay = strcmp(r->line + key, "decay") == 0;
    bool is_isovalue = strcmp(r->line + key, "isovalue") == 0;
    bool is_note = ov_model_key_valid(r->line + key);
    r->line[colon] = ':';
    if (is_placement)
        return read_placement(r, key, value);
    if (r->count)
        return OVOID_OK;
    if (is_note) {
        r->notes_bytes += r->length - key + NOTE_ROOM;
        if (r->notes_bytes > NOTES_BYTES_MAX)
            return ov_fail(r->context, OVOID_ERROR_LIMIT, "%s:%llu:1: more than %d bytes of notes",
                           r->name, (unsigned long long)r->line_number, NOTES_BYTES_MAX);
        return ov_model_add_note(r->context, r->model, r->line + key, r->length - key);
    }
    if (!is_decay && !is_isovalue)
        return OVOID_OK;

    const char *what = is_decay ? "decay" : "isovalue";
    double *number = is_decay ? &r->decay : &r->isovalue;
    if (!isnan(*number))
        return fail_value(r, key, what, "is given twice");
    ovoid_status status = read_number(r, value, r->length - value, what, number);
    if (status == OVOID_OK && *number <= 0.0)
        status = fail_value(r, value, what, "must be positive");
    return status;
}

static ovoid_status read_lines(reader *r) {
    bool end = false, begun = false;
    ovoid_status status = OVOID_OK;
    while ((status = next_line(r, &end)) == OVOID_OK && !end) {
        size_t at = skip_blanks(r, 0);
        const ovoid_status asked = ov_progress_turn(r->context, r->line_number, 0);
        if (asked != OVOID_OK)
            return asked;
        if (at == r->length)
            continue;
        if (!begun)
            status = read_magic(r);
        else
            status = r->line[at] == '#' ? read_hash_line(r) : read_ellipsoid(r);
        if (status != OVOID_OK)
            return status;
        begun = true;
    }
    if (status == OVOID_OK && !r->count)
        status = ov_fail(r->context, OVOID_ERROR_EMPTY, "'%s' holds no ellipsoid", r->name);
    return status;
}

ovoid_status ovoid_model_read(ovoid_context *context, const char *path, ovoid_model **model) {
    OV_NEED(context, context);
    OV_NEED(context, path);
    OV_NEED(context, model);
    ovoid_status status = OVOID_OK;
    ov_locale locale = {0};
    bool standard_input = strcmp(path, "-") == 0;
    reader *r = ov_alloc(context, 1, sizeof *r, "reading a model");
    if (!r)
        return OVOID_ERROR_MEMORY;
    ov_progress_begin(context, "read");
    r->context = context;
    r->name = standard_input ? "standard input" : path;
    r->decay = r->isovalue = NAN;
    r->model = ov_alloc(context, 1, sizeof *r->model, "a model");
    if (!r->model)
        OV_TRY(OVOID_ERROR_MEMORY);
    r->stream = standard_input ? stdin : fopen(path, "r");
    if (!r->stream)
        OV_TRY(ov_fail(context, OVOID_ERROR_IO, "cannot read '%s': %s", path, strerror(errno)));
    OV_TRY(ov_locale_enter(context, &locale));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(read_lines(r));
    r->model->decay = isnan(r->decay) ? OVOID_DEFAULT_DECAY : r->decay;
    r->model->isovalue = isnan(r->isovalue) ? OVOID_DEFAULT_ISOVALUE : r->isovalue;
    r->model->unit = r->ellipsoids;
    r->model->unit_count = r->count;
    r->model->placements = r->placements;
    r->model->placement_count = r->placement_count;
    r->ellipsoids = NULL;
    r->placements = NULL;
    *model = r->model;
    r->model = NULL;

cleanup:
    ov_locale_leave(&locale);
    if (r->stream && !standard_input)
        fclose(r->stream);
    ovoid_model_destroy(&r->model);
    free(r->ellipsoids);
    free(r->placements);
    free(r);
    ov_progress_end(context);
    return status;
}
