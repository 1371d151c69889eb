/*
 * XYZR: "x y z radius" per line, '#' begins a comment. Tolerated: a first line with the number of
 * atoms, which must then be right, and further columns that cannot be mistaken for a radius: words
 * and integers, such as the "1 name" of XYZRN.
 */
#include "molecule/reader.h"

#include <string.h>

enum { COLUMNS = 4 };

static const char *const expected = "x, y, z and radius are expected";

static ovoid_status not_a_number(ov_reader *reader, const ov_line *line, const ov_field *field,
                                 size_t before) {
    ov_quote quote;
    const char *text = ov_quote_text(&quote, field->text, field->length);
    if (before == 0 && (ov_begins_with(field->text, field->length, "ATOM") ||
                        ov_begins_with(field->text, field->length, "HETATM")))
        return ov_text_fail(reader->text, line, field->text,
                            "%s: a PQR or PDB line in an XYZR file", text);
    if (memchr(field->text, ',', field->length))
        return ov_text_fail(reader->text, line, field->text,
                            "%s is not a number (numbers take a decimal point, columns blanks); %s",
                            text, expected);
    return ov_text_fail(reader->text, line, field->text, "%s is not a number; %s", text, expected);
}

/* Takes a line of one integer as the number of atoms. */
static ovoid_status announce(ov_reader *reader, const ov_line *line, const ov_field *field) {
    if (field->number.value < 0) {
        ov_quote quote;
        return ov_text_fail(reader->text, line, field->text, "%s is no number of atoms",
                            ov_quote_text(&quote, field->text, field->length));
    }
    reader->announced = true;
    reader->announced_line = line->number;
    reader->announced_atoms = field->number.value;
    return OVOID_OK;
}

ovoid_status ov_xyzr_line(ov_reader *reader, const ov_line *line) {
    const char *at = line->text, *end = line->text + line->length, *word;
    ov_field found[COLUMNS];
    size_t count = 0, length;
    while ((word = ov_word_next(&at, end, &length))) {
        if (*word == '#') {
            end = word;
            break;
        }
        ov_field parts[OV_FIELDS_MAX];
        size_t pieces = ov_fields_cut(word, length, parts);
        for (size_t i = 0; i < pieces; i++) {
            if (count < COLUMNS && !parts[i].numeric)
                return not_a_number(reader, line, &parts[i], count);
            if (count < COLUMNS) {
                found[count++] = parts[i];
                continue;
            }
            ov_quote quote;
            if (parts[i].numeric && parts[i].number.point)
                return ov_text_fail(reader->text, line, parts[i].text,
                                    "%s: more numbers than x, y, z and radius",
                                    ov_quote_text(&quote, parts[i].text, parts[i].length));
        }
    }
    if (count == 0)
        return OVOID_OK;
    if (count == 1 && !found[0].number.point && !reader->announced && !reader->molecule->atoms)
        return announce(reader, line, &found[0]);
    if (count < COLUMNS) {
        while (end > line->text && ov_blank(end[-1]))
            end--;
        return ov_text_fail(reader->text, line, end, "the line ends after %zu number%s; %s", count,
                            count == 1 ? "" : "s", expected);
    }
    return ov_reader_add(reader, line, &found[0], &found[1], &found[2], &found[3]);
}

ovoid_status ov_xyzr_end(ov_reader *reader) {
    size_t atoms = reader->molecule->atoms;
    if (!reader->announced || reader->announced_atoms == (double)atoms)
        return OVOID_OK;
    return ov_fail(reader->context, OVOID_ERROR_FORMAT,
                   "%s:%llu:1: the file announces %.0f atoms but holds %zu",
                   ov_text_name(reader->text), (unsigned long long)reader->announced_line,
                   reader->announced_atoms, atoms);
}
