/*
 * PDB: the records ATOM and HETATM by their columns, as the format's guide (version 3.3) has them,
 * with what large and old files make of it: hybrid-36 numbers, chains of two characters (columns 21
 * and 22), residues of four (18 to 21), elements that only the atom's name tells.
 *
 * Coordinates must be there and be numbers. What is not needed for a surface may be missing or be
 * too wide for its columns.
 */
#include "molecule/pdb.h"
#include "molecule/reader.h"

#include <math.h>
#include <string.h>

enum { NAME = 12, ALTLOC = 16, RESIDUE = 17, CHAIN = 20, NUMBER = 22, INSERTION = 26, X = 30 };
enum { OCCUPANCY = 54, B_FACTOR = 60, ELEMENT = 76 };

/* A piece of a line without the blanks about it; length 0 past the line's end. */
typedef struct piece {
    const char *text;
    size_t length;
} piece;

static piece columns(const ov_line *line, size_t first, size_t width) {
    const char *end = line->text + line->length;
    piece p = {first < line->length ? line->text + first : end, 0};
    p.length = (size_t)(end - p.text) < width ? (size_t)(end - p.text) : width;
    while (p.length && ov_blank(*p.text))
        p.text++, p.length--;
    while (p.length && ov_blank(p.text[p.length - 1]))
        p.length--;
    return p;
}

static char column(const ov_line *line, size_t at) {
    return at < line->length && !ov_blank(line->text[at]) ? ov_site_letter(line->text[at]) : '\0';
}

/* ---- numbers ------------------------------------------------------------------------------- */

/* Value of a number in base 36, letters of one case, -1 where it is none. */
static int64_t base36(const char *text, size_t width) {
    int64_t value = 0;
    const bool lower = *text >= 'a' && *text <= 'z';
    for (size_t i = 0; i < width; i++) {
        const char c = text[i], first = lower ? 'a' : 'A';
        if (ov_digit(c))
            value = 36 * value + (c - '0');
        else if (c >= first && c <= first + 25)
            value = 36 * value + (c - first + 10);
        else
            return -1;
    }
    return value;
}

/* Decimal, and in columns of 4 and 5 hybrid-36: numbers as far as they go, then A000.., then
 * a000... */
static bool parse_integer(piece p, size_t width, int32_t *number) {
    int64_t power10 = 1, power36 = 1;
    for (size_t i = 0; i < width && width <= 5; i++)
        power10 *= 10;
    for (size_t i = 0; i + 1 < width && width <= 5; i++)
        power36 *= 36;
    if (width <= 5 && p.length == width && ov_letter(*p.text)) {
        const int64_t value = base36(p.text, width);
        const bool lower = *p.text >= 'a';
        if (value < 0)
            return false;
        *number = (int32_t)(value - 10 * power36 + power10 + (lower ? 26 * power36 : 0));
        return true;
    }
    ov_number parsed;
    if (p.length == 0 || p.length > 9 || ov_number_parse(p.text, p.length, &parsed) != p.length ||
        parsed.point)
        return false;
    *number = (int32_t)parsed.value;
    return true;
}

static bool parse_real(piece p, ov_field *field) {
    *field = (ov_field){.text = p.text, .length = p.length, .numeric = true};
    return p.length > 0 && ov_number_parse(p.text, p.length, &field->number) == p.length;
}

/* ---- who the atom is ------------------------------------------------------------------------ */

/* Residues whose names fill columns 18 to 21: water models, and the ends of chains as AMBER names
 * them. Elsewhere column 21 belongs to the chain. */
static bool is_long_residue(const char *text) {
    static const char *const waters[] = {"TIP3", "TIP4", "TIP5", "SPCE"};
    for (size_t i = 0; i < sizeof waters / sizeof *waters; i++)
        if (memcmp(text, waters[i], 4) == 0)
            return true;
    const char inner[4] = {text[1], text[2], text[3], '\0'};
    return (*text == 'N' || *text == 'C') && ov_residue_is_polymer(inner);
}

static void read_residue(const ov_line *line, ov_site *site) {
    const piece name = columns(line, RESIDUE, 3), wide = columns(line, RESIDUE, 4);
    const bool four = wide.length == 4 && is_long_residue(wide.text);
    const piece residue = four ? wide : name,
                chain = columns(line, four ? 21 : CHAIN, four ? 1 : 2);
    ov_site_text(site->residue, sizeof site->residue, residue.text, residue.length);
    ov_site_text(site->chain, sizeof site->chain, chain.text, chain.length);
    ov_site_text(site->part, sizeof site->part, chain.text, chain.length);
    if (!parse_integer(columns(line, NUMBER, 4), 4, &site->number))
        site->number = OVOID_NO_NUMBER;
    site->insertion = column(line, INSERTION);
}

static int find_element(const ov_line *line, const ov_site *site) {
    const piece p = columns(line, ELEMENT, 2);
    char symbol[3] = {0};
    if (p.length && ov_letter(*p.text)) {
        memcpy(symbol, p.text, p.length);
        const int element = ov_element_find(symbol);
        if (element || strcmp(symbol, "X") == 0)
            return element;
    }
    return ov_element_of_name(site->name, site->residue, line->text + NAME);
}

void ov_pdb_site(const ov_line *line, ov_site *site) {
    const piece name = columns(line, NAME, 4);
    *site = (ov_site){.occupancy = 1.0f,
                      .altloc = column(line, ALTLOC),
                      .hetero = ov_begins_with(line->text, line->length, "HETATM")};
    ov_site_text(site->name, sizeof site->name, name.text, name.length);
    read_residue(line, site);
    parse_integer(columns(line, 6, 5), 5, &site->serial);
    site->element = find_element(line, site);
}

/* ---- lines ---------------------------------------------------------------------------------- */

static bool is_atom(const ov_line *line) {
    return ov_begins_with(line->text, line->length, "ATOM  ") ||
           ov_begins_with(line->text, line->length, "HETATM");
}

bool ov_pdb_knows(const ov_line *line) {
    ov_field field;
    if (!is_atom(line))
        return false;
    for (size_t i = 0; i < 3; i++)
        if (!parse_real(columns(line, X + 8 * i, 8), &field) || !field.number.point)
            return false;
    return true;
}

bool ov_pdb_misses(const ov_line *line) {
    const bool named = ov_begins_with(line->text, line->length, "ATOM ") ||
                       ov_begins_with(line->text, line->length, "ATOM\t");
    return named && !is_atom(line);
}

static ovoid_status read_coordinates(ov_reader *reader, const ov_line *line, ov_field xyz[3]) {
    static const char *const names[] = {"x", "y", "z"};
    for (size_t i = 0; i < 3; i++) {
        const size_t first = X + 8 * i;
        const piece p = columns(line, first, 8);
        if (parse_real(p, &xyz[i]))
            continue;
        ov_quote quote;
        const size_t at = first < line->length ? first : line->length;
        if (!p.length)
            return ov_text_fail(reader->text, line, line->text + at,
                                "an atom without %s: columns %zu to %zu are empty", names[i],
                                first + 1, first + 8);
        return ov_text_fail(reader->text, line, p.text, "%s (columns %zu to %zu) is no number: %s",
                            names[i], first + 1, first + 8,
                            ov_quote_text(&quote, p.text, p.length));
    }
    return OVOID_OK;
}

/* Occupancy and temperature factor; a missing one is 1 or 0, and so is one too wide for its
 * columns. */
static void read_weights(ov_reader *reader, const ov_line *line, ov_site *site) {
    ov_field field;
    if (parse_real(columns(line, OCCUPANCY, 6), &field)) {
        site->occupancy = (float)field.number.value;
        reader->pqr_like += !(field.number.value >= 0 && field.number.value <= 1);
    }
    if (parse_real(columns(line, B_FACTOR, 6), &field))
        site->b_factor = (float)field.number.value;
}

static ovoid_status read_atom(ov_reader *reader, const ov_line *line) {
    ov_field xyz[3];
    ov_site site;
    if (!ov_sites_wanted(reader))
        return OVOID_OK;
    ovoid_status status = read_coordinates(reader, line, xyz);
    if (status != OVOID_OK)
        return status;
    ov_pdb_site(line, &site);
    read_weights(reader, line, &site);
    return ov_reader_add_site(reader, line, &xyz[0], &xyz[1], &xyz[2], NULL, &site);
}

/* Whether the line's first word, a number behind it aside, is this. */
static bool is_word(const char *text, size_t length, const char *word) {
    const size_t size = strlen(word);
    return ov_begins_with(text, length, word) && (length == size || !ov_letter(text[size]));
}

void ov_pdb_follow_models(ov_reader *reader, const char *text, size_t length) {
    if (is_word(text, length, "MODEL")) {
        const ov_line line = {text, length, 0};
        int32_t number;
        const bool numbered = parse_integer(columns(&line, 5, 15), 15, &number);
        ov_sites_announce_model(&reader->sites, numbered ? number : OV_NO_MODEL);
    } else if (is_word(text, length, "ENDMDL") || is_word(text, length, "END")) {
        /* END ends the file, but some programs put it between models. */
        ov_sites_end_model(&reader->sites);
    }
}

ovoid_status ov_pdb_line(ov_reader *reader, const ov_line *line) {
    const char *text = line->text;
    if (is_atom(line))
        return read_atom(reader, line);
    if (is_word(text, line->length, "TER"))
        ov_sites_ter(reader);
    else if (ov_pdb_misses(line))
        return ov_text_fail(reader->text, line, text,
                            "an atom whose record is not in the columns of a PDB file");
    else if (ov_begins_with(text, line->length, "REMARK"))
        return ov_assembly_remark(reader->context, &reader->assemblies, reader->text, line);
    else
        ov_pdb_follow_models(reader, text, line->length);
    return OVOID_OK;
}

ovoid_status ov_pdb_end(ov_reader *reader) {
    const size_t atoms = reader->molecule->atoms;
    if (reader->pqr_like > atoms / 4)
        ov_warn(reader->context,
                "%s: most occupancies are none; if this is a PQR file, ask for that format to have "
                "its radii",
                ov_text_name(reader->text));
    return OVOID_OK;
}
