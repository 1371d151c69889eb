/*
 * mmCIF: the loop _atom_site and the few other categories that are needed, row by row. Nothing else
 * is kept: memory follows the atoms, not the file.
 *
 * The syntax is that of CIF 1.1 as gemmi reads it: values in quotes end at a quote with a blank
 * behind it, text fields between lines that begin with ';', names in any case.
 */
#include "molecule/cif.h"

#include <stdlib.h>
#include <string.h>

/* ---- tokens --------------------------------------------------------------------------------- */

typedef enum token_kind { TOKEN_TAG, TOKEN_VALUE, TOKEN_LOOP, TOKEN_BLOCK, TOKEN_OTHER } token_kind;

typedef struct token {
    token_kind kind;
    const char *text;
    size_t length;
    bool bare; /* not in quotes: '?' and '.' mean that there is no value */
} token;

static bool is_name(const token *t, const char *name) {
    return t->length == strlen(name) && ov_begins_with(t->text, t->length, name);
}

static token_kind kind_of(const token *t) {
    if (*t->text == '_')
        return TOKEN_TAG;
    if (is_name(t, "LOOP_"))
        return TOKEN_LOOP;
    if (ov_begins_with(t->text, t->length, "DATA_") || is_name(t, "GLOBAL_"))
        return TOKEN_BLOCK;
    if (ov_begins_with(t->text, t->length, "SAVE_") || is_name(t, "STOP_"))
        return TOKEN_OTHER;
    return TOKEN_VALUE;
}

/* The next token of the line from *at on; false at its end or at a comment. */
static bool next_token(const char **at, const char *end, token *t, bool *open_quote) {
    const char *p = *at;
    *open_quote = false;
    while (p < end && ov_blank(*p))
        p++;
    if (p == end || *p == '#') {
        *at = end;
        return false;
    }
    if (*p == '\'' || *p == '"') {
        const char quote = *p++;
        *t = (token){.kind = TOKEN_VALUE, .text = p};
        while (p < end && !(*p == quote && (p + 1 == end || ov_blank(p[1]) || p[1] == '#')))
            p++;
        *open_quote = p == end;
        t->length = (size_t)(p - t->text);
        *at = p + (p < end);
        return true;
    }
    t->text = p;
    while (p < end && !ov_blank(*p))
        p++;
    t->length = (size_t)(p - t->text);
    t->bare = true;
    t->kind = kind_of(t);
    *at = p;
    return true;
}

/* ---- categories ----------------------------------------------------------------------------- */

enum { WIDEST = 32 }; /* columns of a category that are read */

/* More than any file has: what is kept does not grow with a file that makes no sense. */
enum { COLUMNS_MAX = 10000, ENTITIES_MAX = 10000, ROW_BYTES_MAX = 1 << 20 };

enum {
    ID,
    GROUP,
    SYMBOL,
    LABEL_ATOM,
    AUTH_ATOM,
    ALT,
    LABEL_COMP,
    AUTH_COMP,
    LABEL_ASYM,
    AUTH_ASYM,
    LABEL_SEQ,
    AUTH_SEQ,
    INSERTION,
    ENTITY,
    X,
    Y,
    Z,
    OCCUPANCY,
    B_FACTOR,
    MODEL,
    ATOM_COLUMNS
};

static ovoid_status read_atom(ov_reader *reader, const ov_line *line);
static ovoid_status read_entity(ov_reader *reader, const ov_line *line);
static ovoid_status read_operator(ov_reader *reader, const ov_line *line);
static ovoid_status read_generator(ov_reader *reader, const ov_line *line);
static ovoid_status check_atom_columns(ov_reader *reader, const ov_line *line);

static const struct {
    const char *name;
    const char *columns[WIDEST]; /* NULL at the end */
    ovoid_status (*row)(ov_reader *, const ov_line *);
} categories[] = {
    {"_ATOM_SITE.",
     {[ID] = "ID",
      [GROUP] = "GROUP_PDB",
      [SYMBOL] = "TYPE_SYMBOL",
      [LABEL_ATOM] = "LABEL_ATOM_ID",
      [AUTH_ATOM] = "AUTH_ATOM_ID",
      [ALT] = "LABEL_ALT_ID",
      [LABEL_COMP] = "LABEL_COMP_ID",
      [AUTH_COMP] = "AUTH_COMP_ID",
      [LABEL_ASYM] = "LABEL_ASYM_ID",
      [AUTH_ASYM] = "AUTH_ASYM_ID",
      [LABEL_SEQ] = "LABEL_SEQ_ID",
      [AUTH_SEQ] = "AUTH_SEQ_ID",
      [INSERTION] = "PDBX_PDB_INS_CODE",
      [ENTITY] = "LABEL_ENTITY_ID",
      [X] = "CARTN_X",
      [Y] = "CARTN_Y",
      [Z] = "CARTN_Z",
      [OCCUPANCY] = "OCCUPANCY",
      [B_FACTOR] = "B_ISO_OR_EQUIV",
      [MODEL] = "PDBX_PDB_MODEL_NUM"},
     read_atom},
    {"_ENTITY.", {"ID", "TYPE"}, read_entity},
    {"_PDBX_STRUCT_OPER_LIST.",
     {"ID", "MATRIX[1][1]", "MATRIX[1][2]", "MATRIX[1][3]", "MATRIX[2][1]", "MATRIX[2][2]",
      "MATRIX[2][3]", "MATRIX[3][1]", "MATRIX[3][2]", "MATRIX[3][3]", "VECTOR[1]", "VECTOR[2]",
      "VECTOR[3]"},
     read_operator},
    {"_PDBX_STRUCT_ASSEMBLY_GEN.",
     {"ASSEMBLY_ID", "OPER_EXPRESSION", "ASYM_ID_LIST"},
     read_generator},
};
enum { CATEGORIES = sizeof categories / sizeof categories[0], NONE = -1, IGNORED = -2 };

typedef struct ov_entity_type {
    char id[12];
    ov_entity entity;
    size_t order; /* in the file: of several with the same id the first counts */
} ov_entity_type;

/* A value of the current row. */
typedef struct value {
    size_t at, length; /* in the row's text */
    bool given;        /* there, and neither '?' nor '.' */
    size_t column;     /* in its line, from 1 */
    uint64_t line;
} value;

struct ov_cif {
    int category;     /* NONE outside, IGNORED within one that is not needed */
    bool loop;        /* of it, or of what is ignored */
    bool header;      /* the names of a loop are still coming */
    bool pending_tag; /* a name without its value */
    uint64_t begins;  /* line of the loop or the name */
    uint64_t blocks;  /* data_ so far */
    bool done;        /* a further block has begun, atoms are read */

    int *column; /* of each name of the loop, the index in the category or NONE */
    size_t columns, column_room;
    size_t next; /* column of the value to come */

    value row[WIDEST];
    char *text; /* of the row's values */
    size_t text_length, text_room;

    bool field; /* within a text field */
    uint64_t field_begins;
    char *field_text;
    size_t field_length, field_room;

    ov_entity_type *entities;
    size_t entity_count, entity_room;
    bool entities_sorted;
};

void ov_cif_destroy(ov_cif **cif) {
    if (!cif || !*cif)
        return;
    free((*cif)->column);
    free((*cif)->text);
    free((*cif)->field_text);
    free((*cif)->entities);
    free(*cif);
    *cif = NULL;
}

static bool given(const ov_cif *cif, int column) {
    return cif->row[column].given;
}

static const char *text_of(const ov_cif *cif, int column) {
    return cif->text ? cif->text + cif->row[column].at : ""; /* no value yet, nor a text */
}

/* The first of two columns that has a value, NONE if neither has. */
static int first_given(const ov_cif *cif, int a, int b) {
    return given(cif, a) ? a : given(cif, b) ? b : NONE;
}

static void copy_to(ov_reader *reader, int column, char *field, size_t size) {
    const ov_cif *cif = reader->cif;
    memset(field, 0, size);
    if (column != NONE && !ov_site_text(field, size, text_of(cif, column), cif->row[column].length))
        reader->sites.cut_names++;
}

/* ---- atoms ---------------------------------------------------------------------------------- */

static ovoid_status fail_at_value(ov_reader *reader, int column, const char *what) {
    const value *v = &reader->cif->row[column];
    ov_quote quote;
    if (!v->given)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                       "%s:%llu:%zu: an atom without a value of _atom_site.%s",
                       ov_text_name(reader->text),
                       (unsigned long long)(v->line ? v->line : reader->cif->begins),
                       v->column ? v->column : 1, what);
    return ov_fail(reader->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %s is no number: %s",
                   ov_text_name(reader->text), (unsigned long long)v->line, v->column, what,
                   ov_quote_text(&quote, text_of(reader->cif, column), v->length));
}

/* Says what is wrong with a coordinate. Here, as a row goes over several lines, and only we know in
 * which of them a value is. */
static ovoid_status fail_at_coordinate(ov_reader *reader, int axis, const char *fault) {
    const value *v = &reader->cif->row[X + axis];
    ov_quote quote;
    return ov_fail(reader->context, OVOID_ERROR_FORMAT, "%s:%llu:%zu: %c is %s: %s",
                   ov_text_name(reader->text), (unsigned long long)v->line, v->column, 'x' + axis,
                   ov_quote_text(&quote, text_of(reader->cif, X + axis), v->length), fault);
}

/* Reads a number; one in parentheses behind it, a standard uncertainty, is passed over. */
static bool parse_real(const ov_cif *cif, int column, ov_field *field) {
    const value *v = &cif->row[column];
    *field = (ov_field){.text = text_of(cif, column), .length = v->length, .numeric = true};
    if (!v->given)
        return false;
    const size_t used = ov_number_parse(field->text, field->length, &field->number);
    return used > 0 && (used == v->length || field->text[used] == '(');
}

static bool parse_integer(const ov_cif *cif, int column, int32_t *number) {
    ov_field field;
    if (!parse_real(cif, column, &field) || field.number.point ||
        !(field.number.value > -2147483648.0 && field.number.value < 2147483648.0))
        return false;
    *number = (int32_t)field.number.value;
    return true;
}

/* The author's number, in old files with the insertion code behind it. */
static void read_number(const ov_cif *cif, ov_site *site) {
    const int column = first_given(cif, AUTH_SEQ, LABEL_SEQ);
    if (given(cif, INSERTION))
        site->insertion = ov_site_letter(*text_of(cif, INSERTION));
    site->number = OVOID_NO_NUMBER;
    if (column == NONE || parse_integer(cif, column, &site->number))
        return;
    const value *v = &cif->row[column];
    ov_number number;
    const char last = v->length ? text_of(cif, column)[v->length - 1] : '\0';
    if (ov_letter(last) && v->length > 1 && v->length < 11 &&
        ov_number_parse(text_of(cif, column), v->length - 1, &number) == v->length - 1 &&
        !number.point) {
        site->number = (int32_t)number.value;
        site->insertion = last;
    }
}

static int by_id(const void *a, const void *b) {
    const ov_entity_type *x = a, *y = b;
    const int ids = memcmp(x->id, y->id, sizeof x->id);
    return ids ? ids : (x->order > y->order) - (x->order < y->order);
}

static ov_entity entity_of(ov_cif *cif) {
    ov_entity_type wanted = {.order = 0};
    if (!given(cif, ENTITY) || !cif->entity_count)
        return OV_ENTITY_UNKNOWN;
    ov_site_text(wanted.id, sizeof wanted.id, text_of(cif, ENTITY), cif->row[ENTITY].length);
    if (!cif->entities_sorted)
        qsort(cif->entities, cif->entity_count, sizeof wanted, by_id);
    cif->entities_sorted = true;
    size_t low = 0, high = cif->entity_count; /* the first that is not before the wanted one */
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (by_id(&cif->entities[middle], &wanted) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    const ov_entity_type *found = &cif->entities[low];
    return low < cif->entity_count && memcmp(found->id, wanted.id, sizeof wanted.id) == 0
               ? found->entity
               : OV_ENTITY_UNKNOWN;
}

static void read_element(ov_reader *reader, ov_site *site) {
    char symbol[8];
    copy_to(reader, given(reader->cif, SYMBOL) ? SYMBOL : NONE, symbol, sizeof symbol);
    site->element =
        symbol[0] ? ov_element_find(symbol) : ov_element_of_name(site->name, site->residue, NULL);
}

static void read_site(ov_reader *reader, ov_site *site) {
    ov_cif *cif = reader->cif;
    ov_field field;
    *site = (ov_site){.occupancy = 1.0f};
    copy_to(reader, first_given(cif, AUTH_ATOM, LABEL_ATOM), site->name, sizeof site->name);
    copy_to(reader, first_given(cif, AUTH_COMP, LABEL_COMP), site->residue, sizeof site->residue);
    copy_to(reader, first_given(cif, AUTH_ASYM, LABEL_ASYM), site->chain, sizeof site->chain);
    copy_to(reader, first_given(cif, LABEL_ASYM, AUTH_ASYM), site->part, sizeof site->part);
    read_number(cif, site);
    read_element(reader, site);
    site->altloc = given(cif, ALT) ? ov_site_letter(*text_of(cif, ALT)) : '\0';
    site->hetero = given(cif, GROUP) && *text_of(cif, GROUP) == 'H';
    site->entity = entity_of(cif);
    parse_integer(cif, ID, &site->serial);
    if (parse_real(cif, OCCUPANCY, &field))
        site->occupancy = (float)field.number.value;
    if (parse_real(cif, B_FACTOR, &field))
        site->b_factor = (float)field.number.value;
}

static ovoid_status read_atom(ov_reader *reader, const ov_line *line) {
    static const char *const names[] = {"Cartn_x", "Cartn_y", "Cartn_z"};
    ov_field xyz[3];
    ov_site site;
    int32_t model = 1;
    parse_integer(reader->cif, MODEL, &model);
    if (!ov_sites_wanted_of(reader, model))
        return OVOID_OK;
    for (int i = 0; i < 3; i++) {
        if (!parse_real(reader->cif, X + i, &xyz[i]))
            return fail_at_value(reader, X + i, names[i]);
        const char *fault = ov_reader_fault((size_t)i, xyz[i].number.value);
        if (fault)
            return fail_at_coordinate(reader, i, fault);
    }
    read_site(reader, &site);
    return ov_reader_add_site(reader, line, &xyz[0], &xyz[1], &xyz[2], NULL, &site);
}

static ovoid_status check_atom_columns(ov_reader *reader, const ov_line *line) {
    static const char *const names[] = {"Cartn_x", "Cartn_y", "Cartn_z"};
    const ov_cif *cif = reader->cif;
    for (int i = 0; i < 3; i++) {
        bool found = false;
        for (size_t k = 0; k < cif->columns; k++)
            found |= cif->column[k] == X + i;
        if (!found)
            return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                           "%s:%llu:1: the loop of atoms that begins here has no column "
                           "_atom_site.%s",
                           ov_text_name(reader->text), (unsigned long long)cif->begins, names[i]);
    }
    (void)line;
    return OVOID_OK;
}

static ovoid_status read_entity(ov_reader *reader, const ov_line *line) {
    ov_cif *cif = reader->cif;
    if (!given(cif, 0) || !given(cif, 1))
        return OVOID_OK;
    if (cif->entity_count == ENTITIES_MAX)
        return ov_text_limit(reader->context, reader->text, line->number, ENTITIES_MAX, "entities");
    ovoid_status status = ov_grow(reader->context, &cif->entities, &cif->entity_room,
                                  cif->entity_count + 1, sizeof *cif->entities, "entities");
    if (status != OVOID_OK)
        return status;
    ov_entity_type *entity = &cif->entities[cif->entity_count];
    entity->order = cif->entity_count++;
    cif->entities_sorted = false;
    const char *type = text_of(cif, 1);
    const size_t length = cif->row[1].length;
    ov_site_text(entity->id, sizeof entity->id, text_of(cif, 0), cif->row[0].length);
    entity->entity = ov_begins_with(type, length, "POLYMER") ? OV_ENTITY_POLYMER
                     : ov_begins_with(type, length, "WATER") ? OV_ENTITY_WATER
                                                             : OV_ENTITY_OTHER;
    return OVOID_OK;
}

/* ---- assemblies ------------------------------------------------------------------------------ */

/* An operator that lacks a number is left out: an assembly that needs it will say so. */
static ovoid_status read_operator(ov_reader *reader, const ov_line *line) {
    const ov_cif *cif = reader->cif;
    ov_operator made = {{0}, {0}, {0}};
    ov_field field;
    if (!given(cif, 0) ||
        !ov_site_text(made.id, sizeof made.id, text_of(cif, 0), cif->row[0].length))
        return OVOID_OK;
    for (int k = 0; k < 12; k++) {
        if (!parse_real(cif, 1 + k, &field))
            return OVOID_OK;
        *(k < 9 ? &made.rotation[k] : &made.translation[k - 9]) = field.number.value;
    }
    return ov_assembly_add_operator(reader->context, &reader->assemblies, reader->text, line,
                                    &made);
}

static ovoid_status read_generator(ov_reader *reader, const ov_line *line) {
    const ov_cif *cif = reader->cif;
    if (!given(cif, 0) || !given(cif, 1) || !given(cif, 2))
        return OVOID_OK;
    return ov_assembly_add_generator(reader->context, &reader->assemblies, reader->text, line,
                                     text_of(cif, 0), text_of(cif, 2), text_of(cif, 1));
}

/* ---- rows ------------------------------------------------------------------------------------ */

static void begin_row(ov_cif *cif) {
    memset(cif->row, 0, sizeof cif->row);
    cif->text_length = 0;
    cif->next = 0;
}

static ovoid_status end_row(ov_reader *reader, const ov_line *line) {
    ovoid_status status = categories[reader->cif->category].row(reader, line);
    begin_row(reader->cif);
    return status;
}

/* Ends the category that is being read, be it a loop or single items. */
static ovoid_status end_category(ov_reader *reader, const ov_line *line) {
    ov_cif *cif = reader->cif;
    ovoid_status status = OVOID_OK;
    if (cif->pending_tag)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT, "%s:%llu:1: a name without a value",
                       ov_text_name(reader->text), (unsigned long long)cif->begins);
    if (cif->loop && !cif->header && cif->next != 0)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                       "%s:%llu:1: the loop that begins in line %llu ends within a row: %zu of %zu "
                       "values",
                       ov_text_name(reader->text), (unsigned long long)line->number,
                       (unsigned long long)cif->begins, cif->next, cif->columns);
    if (!cif->loop && cif->category >= 0)
        status = end_row(reader, line);
    cif->category = NONE;
    cif->loop = cif->header = false;
    cif->columns = 0;
    begin_row(cif);
    return status;
}

static int find_category(const token *t) {
    for (int i = 0; i < CATEGORIES; i++)
        if (ov_begins_with(t->text, t->length, categories[i].name))
            return i;
    return IGNORED;
}

static int find_column(int category, const token *t) {
    if (category < 0)
        return NONE;
    const size_t skip = strlen(categories[category].name);
    const token rest = {.text = t->text + skip, .length = t->length - skip};
    for (int i = 0; i < WIDEST && categories[category].columns[i]; i++)
        if (is_name(&rest, categories[category].columns[i]))
            return i;
    return NONE;
}

static ovoid_status add_column(ov_reader *reader, const ov_line *line, int column) {
    ov_cif *cif = reader->cif;
    if (cif->columns == COLUMNS_MAX)
        return ov_text_limit(reader->context, reader->text, line->number, COLUMNS_MAX,
                             "names of a loop");
    ovoid_status status = ov_grow(reader->context, &cif->column, &cif->column_room,
                                  cif->columns + 1, sizeof *cif->column, "names of a loop");
    if (status == OVOID_OK)
        cif->column[cif->columns++] = column;
    return status;
}

static ovoid_status take_tag(ov_reader *reader, const ov_line *line, const token *t) {
    ov_cif *cif = reader->cif;
    ovoid_status status = OVOID_OK;
    const int category = find_category(t);
    if (cif->loop && cif->header) {
        if (cif->columns == 0)
            cif->category = category;
        return add_column(reader, line,
                          category == cif->category ? find_column(category, t) : NONE);
    }
    if (cif->loop || cif->pending_tag || category != cif->category || category < 0)
        OV_TRY(end_category(reader, line));
    cif->category = category;
    cif->columns = 0;
    cif->begins = line->number;
    cif->pending_tag = true;
    status = add_column(reader, line, find_column(category, t));
cleanup:
    return status;
}

static ovoid_status keep_value(ov_reader *reader, const ov_line *line, const token *t,
                               size_t at_column) {
    ov_cif *cif = reader->cif;
    const int column = cif->column[cif->loop ? cif->next : 0];
    if (column == NONE || cif->category < 0)
        return OVOID_OK;
    if (cif->text_length + t->length > ROW_BYTES_MAX)
        return ov_text_limit(reader->context, reader->text, line->number, ROW_BYTES_MAX,
                             "bytes of a row");
    ovoid_status status = ov_grow(reader->context, &cif->text, &cif->text_room,
                                  cif->text_length + t->length + 1, 1, "a row");
    if (status != OVOID_OK)
        return status;
    const bool null = t->bare && t->length == 1 && (*t->text == '?' || *t->text == '.');
    cif->row[column] = (value){.at = cif->text_length,
                               .length = t->length,
                               .given = !null && t->length > 0,
                               .column = at_column,
                               .line = line->number};
    memcpy(cif->text + cif->text_length, t->text, t->length);
    cif->text_length += t->length;
    cif->text[cif->text_length++] = '\0';
    return OVOID_OK;
}

static ovoid_status take_value(ov_reader *reader, const ov_line *line, const token *t,
                               size_t column) {
    ov_cif *cif = reader->cif;
    ovoid_status status = OVOID_OK;
    ov_quote quote;
    if (cif->loop ? cif->columns == 0 : !cif->pending_tag)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                       "%s:%llu:%zu: a value without a name: %s", ov_text_name(reader->text),
                       (unsigned long long)line->number, column,
                       ov_quote_text(&quote, t->text, t->length));
    if (cif->loop && cif->header) {
        cif->header = false;
        if (cif->category == 0)
            OV_TRY(check_atom_columns(reader, line));
        begin_row(cif);
    }
    OV_TRY(keep_value(reader, line, t, column));
    cif->pending_tag = false;
    if (!cif->loop || ++cif->next < cif->columns)
        return OVOID_OK;
    cif->next = 0;
    if (cif->category >= 0)
        status = end_row(reader, line);
cleanup:
    return status;
}

static ovoid_status take(ov_reader *reader, const ov_line *line, const token *t, size_t column) {
    ov_cif *cif = reader->cif;
    ovoid_status status = OVOID_OK;
    if (t->kind == TOKEN_VALUE)
        return take_value(reader, line, t, column);
    if (t->kind == TOKEN_TAG)
        return take_tag(reader, line, t);
    OV_TRY(end_category(reader, line));
    if (t->kind == TOKEN_LOOP) {
        cif->loop = cif->header = true;
        cif->begins = line->number;
    } else if (t->kind == TOKEN_BLOCK) {
        cif->blocks++;
        cif->done = reader->sites.model_any;
        cif->entity_count = 0;
        if (!cif->done)
            ov_assembly_source_destroy(&reader->assemblies);
    }
cleanup:
    return status;
}

/* ---- lines ----------------------------------------------------------------------------------- */

/* Whether the value to come is of a column that is read. */
static bool is_wanted(const ov_cif *cif) {
    const size_t column = cif->loop ? cif->next : 0;
    return cif->category >= 0 && column < cif->columns && cif->column[column] != NONE;
}

static ovoid_status field_line(ov_reader *reader, const char *text, size_t length) {
    ov_cif *cif = reader->cif;
    if (!is_wanted(cif))
        return OVOID_OK;
    if (cif->field_length + length > ROW_BYTES_MAX)
        return ov_text_limit(reader->context, reader->text, cif->field_begins, ROW_BYTES_MAX,
                             "bytes of a text between lines that begin with ';'");
    ovoid_status status = ov_grow(reader->context, &cif->field_text, &cif->field_room,
                                  cif->field_length + length + 1, 1, "a text field");
    if (status != OVOID_OK)
        return status;
    memcpy(cif->field_text + cif->field_length, text, length);
    cif->field_length += length;
    cif->field_text[cif->field_length++] = '\n';
    return OVOID_OK;
}

static ovoid_status begin_field(ov_reader *reader, const ov_line *line) {
    ov_cif *cif = reader->cif;
    cif->field = true;
    cif->field_begins = line->number;
    cif->field_length = 0;
    return field_line(reader, line->text + 1, line->length - 1);
}

static ovoid_status end_field(ov_reader *reader, const ov_line *line) {
    ov_cif *cif = reader->cif;
    const size_t length = cif->field_length ? cif->field_length - 1 : 0;
    const token t = {.kind = TOKEN_VALUE, .text = length ? cif->field_text : "", .length = length};
    cif->field = false;
    return take(reader, line, &t, 1);
}

ovoid_status ov_cif_line(ov_reader *reader, const ov_line *line) {
    ovoid_status status = OVOID_OK;
    const char *at = line->text, *end = at + line->length;
    bool open_quote;
    token t;
    ov_cif *cif = reader->cif;
    if (!cif) {
        reader->cif = cif = ov_alloc(reader->context, 1, sizeof *cif, "a reader");
        if (!cif)
            return OVOID_ERROR_MEMORY;
        cif->category = NONE;
    }
    if (cif->done)
        return OVOID_OK;
    if (line->length && *at == ';') {
        if (!cif->field)
            return begin_field(reader, line);
        OV_TRY(end_field(reader, line));
        at++;
    } else if (cif->field) {
        return field_line(reader, line->text, line->length);
    }
    while (!cif->done && next_token(&at, end, &t, &open_quote)) {
        if (open_quote)
            return ov_text_fail(reader->text, line, t.text - 1, "a quote that is not closed");
        OV_TRY(take(reader, line, &t, (size_t)(t.text - line->text) + 1));
    }
cleanup:
    return status;
}

ovoid_status ov_cif_end(ov_reader *reader) {
    const ov_cif *cif = reader->cif;
    const ov_line line = {"", 0, reader->molecule->counts.lines};
    if (!cif)
        return OVOID_OK;
    if (cif->field)
        return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                       "%s:%llu:1: the text that begins here with ';' does not end",
                       ov_text_name(reader->text), (unsigned long long)cif->field_begins);
    if (cif->done)
        ov_warn(reader->context, "%s: only the first block with atoms is read",
                ov_text_name(reader->text));
    return end_category(reader, &line);
}
