/*
 * Files of radii: "residue atom radius" or "element radius" per line, '#' begins a comment.
 */
#include "molecule/radii.h"

#include <stdlib.h>
#include <string.h>

enum { ROWS_MAX = 1000000 }; /* no list of residues has so many atoms */

typedef struct row {
    char residue[8], atom[8];
    double radius;
    uint64_t line;
} row;

struct ov_radii_table {
    row *rows; /* sorted by residue and atom */
    size_t count, room;
    double of_element[OV_ELEMENTS];
    uint64_t element_line[OV_ELEMENTS]; /* 0: none */
};

void ov_radii_table_destroy(ov_radii_table **table) {
    if (!table || !*table)
        return;
    free((*table)->rows);
    free(*table);
    *table = NULL;
}

static int by_name(const void *a, const void *b) {
    return memcmp(a, b, offsetof(row, radius));
}

static ovoid_status parse_radius(ov_text *text, const ov_line *line, const char *word,
                                 size_t length, double *radius) {
    ov_number number;
    ov_quote quote;
    const char *shown = ov_quote_text(&quote, word, length);
    if (ov_number_parse(word, length, &number) != length)
        return ov_text_fail(text, line, word, "%s is no radius", shown);
    if (!(number.value >= 0 && number.value <= OV_RADIUS_LIMIT))
        return ov_text_fail(text, line, word, "the radius %s is not within 0 and %g angstrom",
                            shown, OV_RADIUS_LIMIT);
    *radius = number.value;
    return OVOID_OK;
}

static ovoid_status twice(ov_text *text, const ov_line *line, uint64_t before) {
    return ov_text_fail(text, line, line->text, "this is already in line %llu",
                        (unsigned long long)before);
}

static ovoid_status add_element(ov_radii_table *table, ov_text *text, const ov_line *line,
                                const char *word, size_t length, double radius) {
    char symbol[8];
    ov_quote quote;
    const int element =
        ov_site_text(symbol, sizeof symbol, word, length) ? ov_element_find(symbol) : 0;
    if (!element)
        return ov_text_fail(text, line, word, "there is no element %s",
                            ov_quote_text(&quote, word, length));
    if (table->element_line[element])
        return twice(text, line, table->element_line[element]);
    table->of_element[element] = radius;
    table->element_line[element] = line->number;
    return OVOID_OK;
}

static ovoid_status add_row(ovoid_context *context, ov_radii_table *table, ov_text *text,
                            const ov_line *line, const char *const words[3],
                            const size_t lengths[3], double radius) {
    if (table->count == ROWS_MAX)
        return ov_text_limit(context, text, line->number, ROWS_MAX, "radii");
    ovoid_status status =
        ov_grow(context, &table->rows, &table->room, table->count + 1, sizeof(row), "radii");
    if (status != OVOID_OK)
        return status;
    row *made = &table->rows[table->count];
    *made = (row){.radius = radius, .line = line->number};
    for (int i = 0; i < 2; i++)
        if (!ov_site_text(i ? made->atom : made->residue, sizeof made->atom, words[i], lengths[i]))
            return ov_text_fail(text, line, words[i], "a name is longer than 7 characters");
    table->count++;
    return OVOID_OK;
}

static ovoid_status read_line(ovoid_context *context, ov_radii_table *table, ov_text *text,
                              const ov_line *line) {
    const char *words[4], *at = line->text, *end = at + line->length;
    const char *comment = memchr(at, '#', line->length);
    size_t lengths[4], count = 0;
    double radius = 0.0;
    if (comment)
        end = comment;
    while (count < 4 && (words[count] = ov_word_next(&at, end, &lengths[count])))
        count++;
    if (count == 0)
        return OVOID_OK;
    if (count != 2 && count != 3)
        return ov_text_fail(text, line, words[0],
                            "'residue atom radius' or 'element radius' is expected");
    ovoid_status status = parse_radius(text, line, words[count - 1], lengths[count - 1], &radius);
    if (status != OVOID_OK)
        return status;
    return count == 2 ? add_element(table, text, line, words[0], lengths[0], radius)
                      : add_row(context, table, text, line, words, lengths, radius);
}

/* Sorts the rows; two for one atom are an error. */
static ovoid_status complete(ovoid_context *context, ov_radii_table *table, const char *path) {
    if (table->count)
        qsort(table->rows, table->count, sizeof(row), by_name);
    for (size_t i = 1; i < table->count; i++) {
        const row *a = &table->rows[i - 1], *b = &table->rows[i];
        if (by_name(a, b) != 0)
            continue;
        const bool order = a->line < b->line;
        return ov_fail(context, OVOID_ERROR_FORMAT, "%s:%llu:1: %s %s is already in line %llu",
                       path, (unsigned long long)(order ? b : a)->line, a->residue, a->atom,
                       (unsigned long long)(order ? a : b)->line);
    }
    return OVOID_OK;
}

static bool is_empty(const ov_radii_table *table) {
    for (int i = 0; i < OV_ELEMENTS; i++)
        if (table->element_line[i])
            return false;
    return table->count == 0;
}

ovoid_status ov_radii_table_read(ovoid_context *context, const char *path, ov_radii_table **table) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ov_text *text = NULL;
    ov_line line;
    bool end;
    ov_radii_table *made = ov_alloc(context, 1, sizeof *made, "radii");
    if (!made)
        goto cleanup;
    OV_TRY(ov_text_open(context, path, &text));
    for (;;) {
        OV_TRY(ov_text_next(text, &line, &end));
        if (end)
            break;
        OV_TRY(read_line(context, made, text, &line));
    }
    if (is_empty(made)) {
        status = ov_fail(context, OVOID_ERROR_EMPTY, "%s: no radii", ov_text_name(text));
        goto cleanup;
    }
    OV_TRY(complete(context, made, ov_text_name(text)));
    *table = made;
    made = NULL;
cleanup:
    ov_text_close(&text);
    ov_radii_table_destroy(&made);
    return status;
}

bool ov_radii_table_find(const ov_radii_table *table, const char *residue, const char *atom,
                         int element, double *radius) {
    row key = {.radius = 0};
    ov_site_text(key.residue, sizeof key.residue, residue, strlen(residue));
    ov_site_text(key.atom, sizeof key.atom, atom, strlen(atom));
    const row *found =
        table->count ? bsearch(&key, table->rows, table->count, sizeof key, by_name) : NULL;
    if (found)
        *radius = found->radius;
    else if (table->element_line[element])
        *radius = table->of_element[element];
    else
        return false;
    return true;
}
