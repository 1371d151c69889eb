#include "molecule/molecule.h"
#include "molecule/reader.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- atoms -------------------------------------------------------------------------------- */

static const char *const axis_names[] = {"x", "y", "z", "the radius"};

/* What is wrong with value i of x, y, z, radius; NULL if nothing is. */
static const char *fault(size_t i, double value) {
    if (!isfinite(value))
        return "not a finite number";
    if (i < 3)
        return fabs(value) > OV_COORDINATE_LIMIT ? "beyond 1e6 angstrom" : NULL;
    if (value < 0)
        return "negative";
    return value > OV_RADIUS_LIMIT ? "beyond 100 angstrom" : NULL;
}

ovoid_status ov_reader_add(ov_reader *reader, const ov_line *line, const ov_field *x,
                           const ov_field *y, const ov_field *z, const ov_field *radius) {
    const ov_field *const fields[] = {x, y, z, radius};
    ovoid_molecule *molecule = reader->molecule;
    if (molecule->atoms == reader->capacity) {
        ovoid_status status = ov_grow(reader->context, &molecule->xyzr, &reader->capacity,
                                      molecule->atoms + 1, 4 * sizeof(double), "atoms");
        if (status != OVOID_OK)
            return status;
    }
    double *atom = molecule->xyzr + 4 * molecule->atoms;
    for (size_t i = 0; i < 4; i++) {
        atom[i] = fields[i]->number.value;
        const char *what = fault(i, atom[i]);
        ov_quote quote;
        if (what)
            return ov_text_fail(reader->text, line, fields[i]->text, "%s is %s: %s", axis_names[i],
                                ov_quote_text(&quote, fields[i]->text, fields[i]->length),
                                *fields[i]->text == '*' ? "too wide for its column" : what);
    }
    molecule->atoms++;
    molecule->counts.zero_radius += atom[3] == 0;
    return OVOID_OK;
}

void ov_reader_ignore(ov_reader *reader, const ov_line *line) {
    const char *at = line->text;
    size_t length;
    const char *word = ov_word_next(&at, line->text + line->length, &length);
    if (!word || *word == '#' || reader->unknown_lines++)
        return;
    reader->unknown_first = line->number;
    ov_quote_text(&reader->unknown_text, line->text, line->length);
}

/* ---- formats ------------------------------------------------------------------------------ */

/* The format that the extension names, AUTO where it says nothing. */
static ovoid_molecule_format format_by_name(const char *path) {
    size_t length = strlen(path);
    if (length > 3 && ov_begins_with(path + length - 3, 3, ".GZ"))
        length -= 3;
    if (length > 4 && ov_begins_with(path + length - 4, 4, ".PQR"))
        return OVOID_MOLECULE_PQR;
    if (length > 5 && ov_begins_with(path + length - 5, 5, ".XYZR"))
        return OVOID_MOLECULE_XYZR;
    return OVOID_MOLECULE_AUTO;
}

/* What else a line shows the file to be; NULL if nothing is known. */
static const char *foreign(const char *text, size_t length) {
    static const struct {
        const char *start, *what;
    } kinds[] = {
        {"DATA_", "mmCIF, which holds no radii"},
        {"LOOP_", "mmCIF, which holds no radii"},
        {"_ATOM_SITE.", "mmCIF, which holds no radii"},
        {"@<TRIPOS>", "MOL2, which holds no radii"},
        {"<", "HTML or XML"},
        {"{", "JSON"},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (ov_begins_with(text, length, kinds[i].start))
            return kinds[i].what;
    return NULL;
}

/* The format that a line shows, AUTO if it shows none. Lines before it are text or comments. */
static ovoid_molecule_format format_by_line(const ov_line *line) {
    const char *at = line->text;
    size_t length;
    const char *word = ov_word_next(&at, line->text + line->length, &length);
    if (!word)
        return OVOID_MOLECULE_AUTO;
    if (ov_pqr_knows(word, line->length - (size_t)(word - line->text)))
        return OVOID_MOLECULE_PQR;
    ov_field parts[OV_FIELDS_MAX];
    ov_fields_cut(word, length, parts);
    return parts[0].numeric ? OVOID_MOLECULE_XYZR : OVOID_MOLECULE_AUTO;
}

static ovoid_status read_lines(ov_reader *reader, ovoid_molecule_format *format) {
    ovoid_molecule *molecule = reader->molecule;
    ovoid_status status = OVOID_OK;
    ov_line line;
    bool end;
    for (;;) {
        OV_TRY(ov_text_next(reader->text, &line, &end));
        if (end)
            break;
        molecule->counts.lines = line.number;
        const char *what = molecule->atoms ? NULL : foreign(line.text, line.length);
        if (what)
            return ov_text_fail(reader->text, &line, line.text,
                                "this looks like %s; PQR and XYZR files are read", what);
        if (*format == OVOID_MOLECULE_AUTO)
            *format = format_by_line(&line);
        if (*format == OVOID_MOLECULE_PQR)
            status = ov_pqr_line(reader, &line);
        else if (*format == OVOID_MOLECULE_XYZR)
            status = ov_xyzr_line(reader, &line);
        else if (line.length && *line.text != '#')
            ov_reader_ignore(reader, &line);
        if (status != OVOID_OK)
            return status;
    }
    if (*format == OVOID_MOLECULE_PQR)
        OV_TRY(ov_pqr_end(reader));
    else if (*format == OVOID_MOLECULE_XYZR)
        OV_TRY(ov_xyzr_end(reader));
cleanup:
    return status;
}

/* ---- the whole file ----------------------------------------------------------------------- */

static ovoid_status no_atoms(const ov_reader *reader, ovoid_molecule_format format) {
    const char *name = ov_text_name(reader->text);
    unsigned long long lines = reader->molecule->counts.lines;
    const char *sought = format == OVOID_MOLECULE_PQR    ? "an ATOM or HETATM record"
                         : format == OVOID_MOLECULE_XYZR ? "x, y, z and radius"
                                                         : "an atom of a PQR or XYZR file";
    if (lines == 0)
        return ov_fail(reader->context, OVOID_ERROR_EMPTY, "%s: no atoms: the file is empty", name);
    if (reader->unknown_lines)
        return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                       "%s: no atoms: none of its %llu line%s holds %s; line %llu is %s", name,
                       lines, lines == 1 ? "" : "s", sought,
                       (unsigned long long)reader->unknown_first, reader->unknown_text.text);
    return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                   "%s: no atoms: none of its %llu line%s holds %s", name, lines,
                   lines == 1 ? "" : "s", sought);
}

static void warn_of_ignored(const ov_reader *reader) {
    if (reader->unknown_lines)
        ov_warn(reader->context, "%s: %llu line%s of no known kind ignored; line %llu is %s",
                ov_text_name(reader->text), (unsigned long long)reader->unknown_lines,
                reader->unknown_lines == 1 ? "" : "s", (unsigned long long)reader->unknown_first,
                reader->unknown_text.text);
}

static ovoid_status read_text(ov_reader *reader, ovoid_molecule_format format) {
    ovoid_status status = read_lines(reader, &format);
    if (status == OVOID_ERROR_FORMAT) {
        /* A damaged gzip file can come out as text that makes no sense; say so if that is why. */
        ovoid_status damage = ov_text_verify(reader->text);
        return damage != OVOID_OK ? damage : status;
    }
    if (status != OVOID_OK)
        return status;
    if (reader->molecule->atoms == 0)
        return no_atoms(reader, format);
    warn_of_ignored(reader);
    return OVOID_OK;
}

/* Gives back what the geometric growth left over. */
static void trim(ovoid_molecule *molecule) {
    double *exact = realloc(molecule->xyzr, molecule->atoms * 4 * sizeof *exact);
    if (exact)
        molecule->xyzr = exact;
}

ovoid_status ovoid_molecule_read(ovoid_context *context, const char *path,
                                 ovoid_molecule_format format, ovoid_molecule **molecule) {
    if (!path || !molecule)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_read: %s is NULL",
                       path ? "molecule" : "path");
    if (format != OVOID_MOLECULE_AUTO && format != OVOID_MOLECULE_PQR &&
        format != OVOID_MOLECULE_XYZR)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_read: %d is no format",
                       (int)format);
    ovoid_status status = OVOID_ERROR_MEMORY;
    ov_reader reader = {.context = context, .guess = format == OVOID_MOLECULE_AUTO};
    reader.molecule = ov_alloc(context, 1, sizeof *reader.molecule, "a molecule");
    if (!reader.molecule)
        goto cleanup;
    OV_TRY(ov_text_open(context, path, &reader.text));
    OV_TRY(read_text(&reader, reader.guess ? format_by_name(path) : format));
    trim(reader.molecule);
    reader.molecule->counts.atoms = reader.molecule->atoms;
    *molecule = reader.molecule;
    reader.molecule = NULL;
cleanup:
    ov_text_close(&reader.text);
    ovoid_molecule_destroy(&reader.molecule);
    return status;
}

/* ---- molecules from memory ---------------------------------------------------------------- */

ovoid_status ovoid_molecule_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                   ovoid_molecule **molecule) {
    if (!molecule || (!xyzr && atoms))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_create: %s is NULL",
                       molecule ? "xyzr" : "molecule");
    if (atoms == 0)
        return ov_fail(context, OVOID_ERROR_EMPTY, "ovoid_molecule_create: no atoms");
    uint64_t zeros = 0;
    for (size_t i = 0; i < atoms; i++) {
        for (size_t k = 0; k < 4; k++) {
            const char *what = fault(k, xyzr[4 * i + k]);
            if (what)
                return ov_fail(context, OVOID_ERROR_ARGUMENT,
                               "ovoid_molecule_create: %s of atom %zu (from 0) is %g: %s",
                               axis_names[k], i, xyzr[4 * i + k], what);
        }
        zeros += xyzr[4 * i + 3] == 0;
    }
    ovoid_molecule *made = ov_alloc(context, 1, sizeof *made, "a molecule");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->xyzr = ov_alloc(context, atoms, 4 * sizeof *xyzr, "atoms");
    if (!made->xyzr) {
        ovoid_molecule_destroy(&made);
        return OVOID_ERROR_MEMORY;
    }
    memcpy(made->xyzr, xyzr, atoms * 4 * sizeof *xyzr);
    made->atoms = atoms;
    made->counts.atoms = atoms;
    made->counts.zero_radius = zeros;
    *molecule = made;
    return OVOID_OK;
}

void ovoid_molecule_destroy(ovoid_molecule **molecule) {
    if (!molecule || !*molecule)
        return;
    free((*molecule)->xyzr);
    free(*molecule);
    *molecule = NULL;
}

size_t ovoid_molecule_atoms(const ovoid_molecule *molecule) {
    return molecule ? molecule->atoms : 0;
}

const double *ovoid_molecule_xyzr(const ovoid_molecule *molecule) {
    return molecule ? molecule->xyzr : NULL;
}

ovoid_molecule_counts ovoid_molecule_read_counts(const ovoid_molecule *molecule) {
    return molecule ? molecule->counts : (ovoid_molecule_counts){0};
}
