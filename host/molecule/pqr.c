/*
 * PQR: the records ATOM and HETATM of a PDB file with charge and radius where that has occupancy
 * and temperature factor. Of an atom record only x, y, z and radius are wanted, the charge is
 * checked.
 *
 *   record serial atom-name residue-name [chain] residue-number x y z charge radius [element ...]
 *
 * By the word of its authors PQR goes by blanks, not by columns, but most programs write PDB
 * columns with or without blanks between them, so that any two neighbours may touch and the number
 * of words in front of x is not known. Hence:
 *
 * 1. By words, from the right. Words are cut where fixed columns fused them before a sign
 *    (ov_fields_cut()). Words at the end that are no numbers are passed over: element, formal
 *    charge, segment, and what stands behind them. The last five numbers in a row are then x, y, z,
 *    charge and radius. This holds if a residue number cannot have slipped in for a missing field,
 *    nor a further column for the radius: x carries a decimal point, which residue numbers never
 * do, or else all the words that belong in front of it are there; and no number with a decimal
 * point stands right before x.
 * 2. Where that fails, by the columns of PDB: x, y, z in columns 31-38, 39-46, 47-54, after a blank
 *    in column 30, each flush right and all with equally many decimals, so that no number is cut in
 *    two; charge and radius are the words from column 55 on, or, where these touch, are cut after 8
 *    or 6 columns, again only with equally many decimals. This reads what rule 1 cannot: values
 * that touch without a sign between them, and numeric segment names behind the radius.
 * 3. Where that fails too, the line is an error. A line is never skipped or half understood.
 */
#include "molecule/pdb.h"
#include "molecule/reader.h"

#include <math.h>
#include <string.h>

enum { X, Y, Z, CHARGE, RADIUS, FIELDS };

static const char *const expected = "x, y, z, charge and radius are expected";

/* ---- records ------------------------------------------------------------------------------ */

/* Length of the record name of an atom, 0 for other lines. The serial may be glued to it: digits,
 * '*' where it is too wide, and behind HETATM the five characters of hybrid-36. */
static size_t atom_record(const char *text, size_t length) {
    size_t name = ov_begins_with(text, length, "ATOM")     ? 4
                  : ov_begins_with(text, length, "HETATM") ? 6
                                                           : 0;
    if (!name || name == length || ov_blank(text[name]) || ov_digit(text[name]) ||
        text[name] == '*')
        return name;
    if (name == 6 && length >= 11 && ov_letter(text[6]) && (length == 11 || ov_blank(text[11]))) {
        size_t i = 7;
        while (i < 11 && (ov_letter(text[i]) || ov_digit(text[i])))
            i++;
        return i == 11 ? name : 0;
    }
    return 0;
}

/* Whether the line's first word is one of the space-separated names, a number behind it aside. */
static bool is_record(const char *text, size_t length, const char *names) {
    size_t word = 0;
    while (word < length && ov_letter(text[word]))
        word++;
    if (word < length && !ov_blank(text[word]) && !ov_digit(text[word]))
        return false;
    for (const char *name = names; word && *name;) {
        size_t size = strcspn(name, " ");
        if (size == word && memcmp(name, text, size) == 0)
            return true;
        name += size;
        name += *name == ' ';
    }
    return false;
}

/* Records of PDB files that PQR files hardly ever have. */
static const char pdb_records[] =
    "ANISOU SIGUIJ SIGATM HEADER OBSLTE SPLIT CAVEAT COMPND SOURCE KEYWDS EXPDTA NUMMDL MDLTYP "
    "AUTHOR REVDAT SPRSDE JRNL DBREF SEQADV SEQRES MODRES HET HETNAM HETSYN FORMUL ORIGX SCALE "
    "MTRIX MASTER";

/* Records that PQR files do have. */
static const char other_records[] = "REMARK TER END ENDMDL MODEL CONECT TITLE CRYST HELIX SHEET "
                                    "TURN SSBOND LINK CISPEP SITE USER";

static bool is_comment(const char *text, size_t length) {
    return length == 0 || memchr("#;!*/", *text, 5);
}

bool ov_pqr_knows(const char *text, size_t length) {
    return atom_record(text, length) || is_record(text, length, other_records) ||
           is_record(text, length, pdb_records);
}

/* ---- atoms: by words ---------------------------------------------------------------------- */

/* Numbers found at the end of a line. */
typedef struct ov_tail {
    ov_field field[FIELDS + 1]; /* from the right: radius, charge, z, y, x, and what is before x */
    size_t count;
    ov_field behind; /* word behind the radius, length 0 if there is none */
} ov_tail;

static void find_tail(const char *begin, const char *end, ov_tail *tail) {
    tail->count = 0;
    tail->behind = (ov_field){0};
    const char *p = end;
    while (tail->count <= FIELDS) {
        while (p > begin && ov_blank(p[-1]))
            p--;
        if (p == begin)
            return;
        const char *word_end = p;
        while (p > begin && !ov_blank(p[-1]))
            p--;
        ov_field parts[OV_FIELDS_MAX];
        size_t pieces = ov_fields_cut(p, (size_t)(word_end - p), parts);
        while (pieces-- > 0 && tail->count <= FIELDS) {
            if (parts[pieces].numeric) {
                tail->field[tail->count++] = parts[pieces];
            } else if (tail->count >= FIELDS) {
                return;
            } else {
                tail->count = 0;
                tail->behind = parts[pieces];
            }
        }
    }
}

/* Whether serial, atom name, residue name and residue number all stand as words in [p, end). */
static bool front_is_complete(const char *p, const char *end) {
    const char *word, *last = NULL, *before = NULL;
    size_t length, last_length = 0, before_length = 0, count = 0;
    while ((word = ov_word_next(&p, end, &length))) {
        before = last, before_length = last_length;
        last = word, last_length = length;
        count++;
    }
    if (count < 4)
        return false;
    if (ov_is_residue_number(last, last_length))
        return true;
    ov_number number; /* an insertion code apart from its number */
    return count > 4 && last_length == 1 && ov_letter(*last) &&
           ov_number_parse(before, before_length, &number) == before_length && !number.point;
}

/* Whether a word begins as a number with decimals does: damaged, it is not to pass for an element.
 */
static bool is_broken_number(const ov_field *word) {
    size_t i = word->length && (*word->text == '-' || *word->text == '+');
    while (i < word->length && ov_digit(word->text[i]))
        i++;
    return i > 0 && i < word->length && (word->text[i] == '.' || word->text[i] == ',');
}

static bool read_by_words(const char *begin, const char *end, ov_field fields[FIELDS]) {
    ov_tail tail;
    find_tail(begin, end, &tail);
    if (tail.count < FIELDS || is_broken_number(&tail.behind))
        return false;
    if (tail.count > FIELDS && tail.field[FIELDS].number.point)
        return false;
    const ov_field *x = &tail.field[FIELDS - 1];
    if (!x->number.point && !front_is_complete(begin, x->text))
        return false;
    for (size_t i = 0; i < FIELDS; i++)
        fields[i] = tail.field[FIELDS - 1 - i];
    return true;
}

/* ---- atoms: by columns -------------------------------------------------------------------- */

/* Reads a number that ends flush with text[width - 1], blanks in front of it. */
static bool read_column(const char *text, size_t width, ov_field *field) {
    size_t skip = 0;
    while (skip < width && text[skip] == ' ')
        skip++;
    *field = (ov_field){.text = text + skip, .length = width - skip, .numeric = true};
    return ov_number_parse(field->text, field->length, &field->number) == field->length &&
           field->length > 0 && field->number.point;
}

/* Reads charge and radius where the first word behind z holds both. */
static bool read_fused_pair(const char *text, const char *end, ov_field *charge, ov_field *radius) {
    static const size_t widths[] = {8, 6};
    for (size_t i = 0; i < sizeof widths / sizeof widths[0]; i++) {
        if ((size_t)(end - text) <= widths[i])
            continue;
        const char *p = text + widths[i];
        radius->text = ov_word_next(&p, end, &radius->length);
        radius->numeric = true;
        if (radius->text == text + widths[i] && read_column(text, widths[i], charge) &&
            ov_number_parse(radius->text, radius->length, &radius->number) == radius->length &&
            radius->number.point && radius->number.decimals == charge->number.decimals)
            return true;
    }
    return false;
}

static bool read_by_columns(const ov_line *line, ov_field fields[FIELDS]) {
    const size_t first = 30, width = 8, behind = first + 3 * width;
    const char *text = line->text, *end = text + line->length;
    if (line->length <= behind || text[first - 1] != ' ' || memchr(text, '\t', behind))
        return false;
    for (size_t i = X; i <= Z; i++)
        if (!read_column(text + first + i * width, width, &fields[i]) ||
            fields[i].number.decimals != fields[X].number.decimals)
            return false;

    const char *at = text + behind;
    size_t count = CHARGE;
    if (read_fused_pair(at, end, &fields[CHARGE], &fields[RADIUS])) {
        count = FIELDS;
        at = fields[RADIUS].text + fields[RADIUS].length;
    }
    const char *word;
    size_t length;
    while ((word = ov_word_next(&at, end, &length))) {
        ov_field parts[OV_FIELDS_MAX];
        size_t pieces = ov_fields_cut(word, length, parts);
        for (size_t i = 0; i < pieces; i++) {
            if (count < FIELDS && !parts[i].numeric)
                return false;
            if (count < FIELDS)
                fields[count++] = parts[i];
            else if ((parts[i].numeric && parts[i].number.point) || is_broken_number(&parts[i]))
                return false; /* a further column with decimals: which one is the radius? */
        }
    }
    return count == FIELDS;
}

/* ---- atoms: what is wrong ----------------------------------------------------------------- */

/* Where x ought to stand: the word behind the residue number if words are apart, else the first
 * number with decimals. NULL if neither is there. */
static const char *find_x(const char *begin, const char *end) {
    const char *at = begin, *word;
    size_t length;
    bool numbered = false;
    for (size_t index = 0; (word = ov_word_next(&at, end, &length)); index++) {
        if (numbered)
            return word;
        ov_field parts[OV_FIELDS_MAX];
        size_t pieces = ov_fields_cut(word, length, parts);
        for (size_t i = 0; i < pieces; i++)
            if (parts[i].numeric && parts[i].number.point && isfinite(parts[i].number.value))
                return parts[i].text;
        numbered = index >= 3 && ov_is_residue_number(word, length);
    }
    return NULL;
}

static ovoid_status fail_at_word(ov_reader *reader, const ov_line *line, const ov_field *field,
                                 size_t before) {
    ov_quote quote;
    const char *text = ov_quote_text(&quote, field->text, field->length);
    if (field->numeric)
        return ov_text_fail(reader->text, line, field->text,
                            "%s: more numbers than x, y, z, charge and radius", text);
    if (before < FIELDS && memchr(field->text, ',', field->length))
        return ov_text_fail(reader->text, line, field->text,
                            "%s is not a number (numbers take a decimal point, columns blanks); %s",
                            text, expected);
    return ov_text_fail(reader->text, line, field->text, "%s is not a number; %s", text, expected);
}

/* Finds the field to blame for a line that could not be read. */
static ovoid_status fail_to_read(ov_reader *reader, const ov_line *line, const char *begin) {
    const char *end = line->text + line->length;
    while (end > begin && ov_blank(end[-1]))
        end--;
    const char *at = find_x(begin, end), *word;
    if (!at)
        return ov_text_fail(reader->text, line, end, "an atom without coordinates; %s", expected);
    size_t count = 0, length;
    while ((word = ov_word_next(&at, end, &length))) {
        ov_field parts[OV_FIELDS_MAX];
        size_t pieces = ov_fields_cut(word, length, parts);
        for (size_t i = 0; i < pieces; i++) {
            bool good = parts[i].numeric;
            if (count < FIELDS ? !good : good || is_broken_number(&parts[i]))
                return fail_at_word(reader, line, &parts[i], count);
            count += good;
        }
    }
    if (count == 3)
        return ov_text_fail(reader->text, line, end, "no charge and no radius behind x, y and z");
    if (count < FIELDS)
        return ov_text_fail(reader->text, line, end, "the line ends after %zu number%s; %s", count,
                            count == 1 ? "" : "s", expected);
    return ov_text_fail(reader->text, line, begin,
                        "the fields of this line cannot be told apart; separate them by blanks");
}

/* ---- PDB files under another name --------------------------------------------------------- */

/*
 * A PDB file reads well as PQR: occupancies become charges, temperature factors radii, and the
 * surface nonsense. Atoms of a PDB file have both numbers in columns 55-60 and 61-66 with two
 * decimals and occupancies within 0 and 1; only one of many PQR atoms passes that.
 */
static void suspect_pdb(ov_pdb_suspicion *pdb, const ov_line *line, const ov_field fields[FIELDS]) {
    if (pdb->cleared)
        return;
    const ov_field *charge = &fields[CHARGE], *radius = &fields[RADIUS];
    double occupancy = charge->number.value;
    if (charge->text + charge->length != line->text + 60 || charge->number.decimals != 2 ||
        radius->text + radius->length != line->text + 66 || radius->number.decimals != 2 ||
        !(occupancy >= 0 && occupancy <= 1)) {
        pdb->cleared = true;
        return;
    }
    pdb->atoms++;
    pdb->ones += occupancy == 1;
    pdb->element += line->length >= 78 && ov_letter(line->text[77]);
    if (radius->number.value > pdb->largest)
        pdb->largest = radius->number.value;
}

/* Something must be there that PQR files do not have: header records, elements, or temperature
 * factors no radius could be. One of these is enough where most occupancies are 1.00. */
bool ov_pqr_is_pdb(const ov_reader *reader) {
    const ov_pdb_suspicion *pdb = &reader->pdb;
    const double largest_radius = 5; /* angstrom; the largest atom has 3.5 */
    const uint64_t atoms = pdb->atoms;
    const bool full = pdb->ones >= atoms - atoms / 4;
    const int signs = pdb->header + (pdb->element >= atoms) + (pdb->largest > largest_radius);
    return !pdb->cleared && atoms > 1 && (full ? signs > 0 : signs > 1);
}

static ovoid_status fail_as_pdb(const ov_reader *reader) {
    return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                   "%s: this looks like a PDB file, with occupancies and temperature factors where "
                   "PQR has charges and radii; ask for the format PDB, or, if the last column does "
                   "hold radii, for the format PQR",
                   ov_text_name(reader->text));
}

ovoid_status ov_pqr_end(ov_reader *reader) {
    return reader->guess && ov_pqr_is_pdb(reader) ? fail_as_pdb(reader) : OVOID_OK;
}

/* ---- who the atom is ---------------------------------------------------------------------- */

typedef struct ov_word {
    const char *text;
    size_t length;
} ov_word;

/* "A", "12", "12B", "A12" or "A12B" as chain, number and insertion code, as far as they are there.
 */
static void read_number(const ov_word *word, ov_site *site) {
    size_t at = 0;
    while (at < word->length && !ov_digit(word->text[at]) && word->text[at] != '-')
        at++;
    if (at > 0 && !site->chain[0])
        ov_site_text(site->chain, sizeof site->chain, word->text, at);
    ov_number number;
    const size_t used = ov_number_parse(word->text + at, word->length - at, &number);
    if (used == 0 || number.point || !(fabs(number.value) < 2147483648.0))
        return;
    site->number = (int32_t)number.value;
    if (at + used + 1 == word->length)
        site->insertion = ov_site_letter(word->text[at + used]);
}

/* The words in front of x: [serial] name residue [chain] number [insertion code]. */
static void read_names(ov_reader *reader, const char *begin, const char *x, ov_site *site) {
    ov_word words[8];
    size_t count = 0, first = 0;
    ov_number serial;
    while (count < 8 && (words[count].text = ov_word_next(&begin, x, &words[count].length)))
        count++;
    if (count && ov_number_parse(words[0].text, words[0].length, &serial) == words[0].length &&
        !serial.point && fabs(serial.value) < 2147483648.0) {
        site->serial = (int32_t)serial.value;
        first = 1;
    }
    if (count > first)
        reader->sites.cut_names +=
            !ov_site_text(site->name, sizeof site->name, words[first].text, words[first].length);
    if (count > first + 1)
        reader->sites.cut_names += !ov_site_text(site->residue, sizeof site->residue,
                                                 words[first + 1].text, words[first + 1].length);
    for (size_t i = first + 2; i < count; i++) {
        const bool alone = i == first + 2 && count > first + 3; /* a chain of its own */
        if (alone)
            ov_site_text(site->chain, sizeof site->chain, words[i].text, words[i].length);
        else if (site->number == OVOID_NO_NUMBER)
            read_number(&words[i], site);
        else if (words[i].length == 1)
            site->insertion = ov_site_letter(*words[i].text);
    }
}

/* By the columns of PDB where the line keeps to them, else by words. What cannot be told apart is
 * left empty: the surface does without. */
static void read_site(ov_reader *reader, const ov_line *line, const char *begin, const char *x,
                      ov_site *site) {
    const size_t at = (size_t)(x - line->text);
    const char *last = x;
    while (last < line->text + line->length && !ov_blank(*last))
        last++;
    const bool columns = at >= 30 && last - line->text == 38 && ov_letter(*line->text) &&
                         ov_digit(line->text[25]) && ov_blank(line->text[11]) &&
                         ov_blank(line->text[27]) && ov_blank(line->text[28]) &&
                         !memchr(line->text, '\t', 38);
    if (columns) {
        ov_pdb_site(line, site);
        if (line->length > 54) /* what stands in the columns of the element is something else */
            site->element = ov_element_of_name(site->name, site->residue, line->text + 12);
        return;
    }
    *site = (ov_site){.occupancy = 1.0f, .number = OVOID_NO_NUMBER};
    site->hetero = begin - line->text >= 6 && ov_begins_with(begin - 6, 6, "HETATM");
    read_names(reader, begin, x, site);
    memcpy(site->part, site->chain, sizeof site->part);
    site->element = ov_element_of_name(site->name, site->residue, NULL);
}

/* ---- lines -------------------------------------------------------------------------------- */

static ovoid_status read_atom(ov_reader *reader, const ov_line *line, const char *begin) {
    const char *end = line->text + line->length;
    ov_field fields[FIELDS];
    if (!read_by_words(begin, end, fields) && !read_by_columns(line, fields))
        return fail_to_read(reader, line, begin);
    if (!isfinite(fields[CHARGE].number.value)) {
        ov_quote quote;
        return ov_text_fail(reader->text, line, fields[CHARGE].text, "the charge is %s: not finite",
                            ov_quote_text(&quote, fields[CHARGE].text, fields[CHARGE].length));
    }
    if (reader->guess) {
        suspect_pdb(&reader->pdb, line, fields);
        if (!reader->pdb.cleared && reader->pdb.largest > OV_RADIUS_LIMIT)
            return fail_as_pdb(reader);
    }
    ov_site site;
    read_site(reader, line, begin, fields[X].text, &site);
    return ov_reader_add_site(reader, line, &fields[X], &fields[Y], &fields[Z], &fields[RADIUS],
                              &site);
}

/* A line of no known kind is ignored, but not one that holds what an atom does: a misspelt record
 * must not cost an atom unseen. */
static ovoid_status read_unknown(ov_reader *reader, const ov_line *line, const char *text) {
    const char *at = text, *end = line->text + line->length;
    size_t length;
    ov_word_next(&at, end, &length);
    ov_field fields[FIELDS];
    bool atom = ov_begins_with(text, length, "ATOM") || ov_begins_with(text, length, "HETATM");
    if (read_by_words(at, end, fields) && (atom || front_is_complete(at, fields[X].text))) {
        ov_quote quote;
        return ov_text_fail(reader->text, line, text,
                            "%s is no record of a PQR file, but the line looks like an atom",
                            ov_quote_text(&quote, text, length));
    }
    ov_reader_ignore(reader, line);
    return OVOID_OK;
}

ovoid_status ov_pqr_line(ov_reader *reader, const ov_line *line) {
    const char *text = line->text, *end = text + line->length;
    while (text < end && ov_blank(*text))
        text++;
    size_t length = (size_t)(end - text);
    size_t record = atom_record(text, length);
    if (record) {
        return ov_sites_wanted(reader) ? read_atom(reader, line, text + record) : OVOID_OK;
    }
    if (is_comment(text, length))
        return OVOID_OK;
    if (is_record(text, length, other_records)) {
        ov_pdb_follow_models(reader, text, length);
        return ov_assembly_remark(reader->context, &reader->assemblies, reader->text, line);
    }
    if (is_record(text, length, pdb_records)) {
        reader->pdb.header = true;
        return OVOID_OK;
    }
    return read_unknown(reader, line, text);
}
