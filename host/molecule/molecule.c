#include "base/progress.h"
#include "base/sized.h"
#include "molecule/cif.h"
#include "molecule/radii.h"
#include "molecule/reader.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- atoms -------------------------------------------------------------------------------- */

static const char *const axis_names[] = {"x", "y", "z", "the radius"};

const char *ov_reader_fault(size_t i, double value) {
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
        atom[i] = fields[i] ? fields[i]->number.value : 0.0;
        const char *what = ov_reader_fault(i, atom[i]);
        ov_quote quote;
        if (what)
            return ov_text_fail(reader->text, line, fields[i]->text, "%s is %s: %s", axis_names[i],
                                ov_quote_text(&quote, fields[i]->text, fields[i]->length),
                                *fields[i]->text == '*' ? "too wide for its column" : what);
    }
    molecule->atoms++;
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
    static const struct {
        const char *extension;
        ovoid_molecule_format format;
    } names[] = {{".PQR", OVOID_MOLECULE_PQR},   {".XYZR", OVOID_MOLECULE_XYZR},
                 {".PDB", OVOID_MOLECULE_PDB},   {".ENT", OVOID_MOLECULE_PDB},
                 {".CIF", OVOID_MOLECULE_MMCIF}, {".MMCIF", OVOID_MOLECULE_MMCIF}};
    size_t length = strlen(path);
    if (length > 3 && ov_begins_with(path + length - 3, 3, ".GZ"))
        length -= 3;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const size_t tail = strlen(names[i].extension);
        if (length > tail && ov_begins_with(path + length - tail, tail, names[i].extension))
            return names[i].format;
    }
    return OVOID_MOLECULE_AUTO;
}

/* What else a line shows the file to be; NULL if nothing is known. */
static const char *foreign(const char *text, size_t length) {
    static const struct {
        const char *start, *what;
    } kinds[] = {
        {"@<TRIPOS>", "MOL2"},
        {"<", "HTML or XML"},
        {"{", "JSON"},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (ov_begins_with(text, length, kinds[i].start))
            return kinds[i].what;
    return NULL;
}

static bool is_mmcif(const char *text, size_t length) {
    return ov_begins_with(text, length, "DATA_") || ov_begins_with(text, length, "LOOP_") ||
           ov_begins_with(text, length, "_ATOM_SITE.");
}

/* The format that a line shows, AUTO if it shows none. Lines before it are text or comments. */
static ovoid_molecule_format format_by_line(const ov_line *line) {
    const char *at = line->text;
    size_t length;
    const char *word = ov_word_next(&at, line->text + line->length, &length);
    if (!word)
        return OVOID_MOLECULE_AUTO;
    if (is_mmcif(line->text, line->length))
        return OVOID_MOLECULE_MMCIF;
    if (ov_pqr_knows(word, line->length - (size_t)(word - line->text)))
        return OVOID_MOLECULE_PQR; /* or PDB: see below */
    ov_field parts[OV_FIELDS_MAX];
    ov_fields_cut(word, length, parts);
    return parts[0].numeric ? OVOID_MOLECULE_XYZR : OVOID_MOLECULE_AUTO;
}

/* ---- PQR or PDB ---------------------------------------------------------------------------- */

/*
 * What looks like PQR may be a PDB file, and standard input cannot be read twice. So the first
 * lines are kept, and read as PDB where that shows. Lines are counted as well as their bytes, for
 * they may be empty.
 */
enum { LOOK_AHEAD_ATOMS = 1000, LOOK_AHEAD_BYTES = 8 << 20, LOOK_AHEAD_LINES = 200000 };

typedef struct ahead {
    bool open; /* not decided yet */
    char *text;
    size_t length, text_room;
    ov_line *lines; /* whose text is an offset until they are read again */
    size_t *offsets;
    size_t count, line_room, offset_room;
} ahead;

static ovoid_status keep_line(ov_reader *reader, ahead *kept, const ov_line *line) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(reader->context, &kept->text, &kept->text_room, kept->length + line->length + 1,
                   1, "lines"));
    OV_TRY(ov_grow(reader->context, &kept->lines, &kept->line_room, kept->count + 1,
                   sizeof *kept->lines, "lines"));
    OV_TRY(ov_grow(reader->context, &kept->offsets, &kept->offset_room, kept->count + 1,
                   sizeof *kept->offsets, "lines"));
    kept->offsets[kept->count] = kept->length;
    kept->lines[kept->count++] = *line;
    memcpy(kept->text + kept->length, line->text, line->length);
    kept->length += line->length;
cleanup:
    return status;
}

static void forget(ahead *kept) {
    free(kept->text);
    free(kept->lines);
    free(kept->offsets);
    *kept = (ahead){0};
}

/* Forgets the atoms that were read as PQR, and reads the kept lines as PDB. */
static ovoid_status read_again(ov_reader *reader, ahead *kept) {
    ovoid_status status = OVOID_OK;
    ovoid_molecule *m = reader->molecule;
    m->atoms = m->residue_count = 0;
    m->counts = (ovoid_molecule_counts){.lines = m->counts.lines};
    ov_sites_destroy(&reader->sites);
    ov_assembly_source_destroy(&reader->assemblies);
    reader->unknown_lines = 0;
    for (size_t i = 0; i < kept->count && status == OVOID_OK; i++) {
        kept->lines[i].text = kept->text + kept->offsets[i];
        status = ov_pdb_line(reader, &kept->lines[i]);
    }
    return status;
}

/* A line that is no PQR atom but a PDB one, in a file that nothing shows to be PQR. */
static bool fails_as_pdb(const ov_reader *reader, const ov_line *line) {
    return !reader->pdb.cleared && ov_pdb_knows(line) &&
           (reader->pdb.header || (line->length >= 78 && ov_letter(line->text[77])) ||
            line->length < 66 || reader->pdb.largest > OV_RADIUS_LIMIT);
}

/* Reads a line as PQR, and decides after it, if it is time. */
static ovoid_status try_pqr(ov_reader *reader, const ov_line *line, ahead *kept, bool *pdb) {
    ovoid_status status = keep_line(reader, kept, line);
    if (status != OVOID_OK)
        return status;
    status = ov_pqr_line(reader, line);
    if (status == OVOID_ERROR_FORMAT && fails_as_pdb(reader, line)) {
        *pdb = true;
        return OVOID_OK;
    }
    if (status != OVOID_OK)
        return status;
    if (reader->pdb.cleared || kept->length > LOOK_AHEAD_BYTES || kept->count > LOOK_AHEAD_LINES) {
        forget(kept);
    } else if (reader->molecule->atoms >= LOOK_AHEAD_ATOMS) {
        *pdb = ov_pqr_is_pdb(reader);
        if (!*pdb)
            forget(kept);
    }
    return status;
}

/* ---- lines --------------------------------------------------------------------------------- */

typedef ovoid_status (*line_reader)(ov_reader *reader, const ov_line *line);

static line_reader reader_of(ovoid_molecule_format format) {
    switch (format) {
    case OVOID_MOLECULE_PQR:
        return ov_pqr_line;
    case OVOID_MOLECULE_XYZR:
        return ov_xyzr_line;
    case OVOID_MOLECULE_PDB:
        return ov_pdb_line;
    case OVOID_MOLECULE_MMCIF:
        return ov_cif_line;
    case OVOID_MOLECULE_AUTO:
        break;
    }
    return NULL;
}

static ovoid_status end_format(ov_reader *reader, ovoid_molecule_format format) {
    switch (format) {
    case OVOID_MOLECULE_PQR:
        return ov_pqr_end(reader);
    case OVOID_MOLECULE_XYZR:
        return ov_xyzr_end(reader);
    case OVOID_MOLECULE_PDB:
        return ov_pdb_end(reader);
    case OVOID_MOLECULE_MMCIF:
        return ov_cif_end(reader);
    case OVOID_MOLECULE_AUTO:
        break;
    }
    return OVOID_OK;
}

/* Takes the file for PDB from now on. */
static ovoid_status turn_to_pdb(ov_reader *reader, ovoid_molecule_format *format, ahead *kept) {
    ovoid_status status = read_again(reader, kept);
    *format = OVOID_MOLECULE_PDB;
    forget(kept);
    return status;
}

static ovoid_status read_line(ov_reader *reader, const ov_line *line, ahead *kept,
                              ovoid_molecule_format *format) {
    ovoid_status status = OVOID_OK;
    const char *what = reader->molecule->atoms ? NULL : foreign(line->text, line->length);
    if (what && *format != OVOID_MOLECULE_MMCIF)
        return ov_text_fail(reader->text, line, line->text,
                            "this looks like %s; PDB, mmCIF, PQR and XYZR files are read", what);
    if (reader->molecule->counts.models == 0 && reader->molecule->atoms == 0 &&
        *format != OVOID_MOLECULE_MMCIF && *format != OVOID_MOLECULE_AUTO &&
        is_mmcif(line->text, line->length)) {
        if (!reader->guess)
            return ov_text_fail(reader->text, line, line->text,
                                "this looks like mmCIF, not like the format that was asked for");
        *format = OVOID_MOLECULE_MMCIF;
    }
    if (reader->guess && *format == OVOID_MOLECULE_PDB && reader->molecule->counts.models == 0 &&
        ov_pdb_misses(line))
        *format = OVOID_MOLECULE_PQR; /* words and no columns: some programs call that PDB, too */
    if (*format == OVOID_MOLECULE_AUTO) {
        *format = format_by_line(line);
        kept->open = *format == OVOID_MOLECULE_PQR;
    }
    if (kept->open && *format == OVOID_MOLECULE_PQR) {
        bool pdb = false;
        OV_TRY(try_pqr(reader, line, kept, &pdb));
        return pdb ? turn_to_pdb(reader, format, kept) : OVOID_OK;
    }
    const line_reader read = reader_of(*format);
    if (read)
        return read(reader, line);
    if (line->length && *line->text != '#')
        ov_reader_ignore(reader, line);
cleanup:
    return status;
}

static ovoid_status read_lines(ov_reader *reader, ovoid_molecule_format *format) {
    ovoid_molecule *molecule = reader->molecule;
    ovoid_status status = OVOID_OK;
    ahead kept = {.open = reader->guess && *format == OVOID_MOLECULE_PQR};
    ov_line line;
    bool end;
    for (;;) {
        OV_TRY(ov_text_next(reader->text, &line, &end));
        if (end)
            break;
        molecule->counts.lines = line.number;
        OV_TRY(read_line(reader, &line, &kept, format));
    }
    if (kept.open && *format == OVOID_MOLECULE_PQR && ov_pqr_is_pdb(reader))
        OV_TRY(turn_to_pdb(reader, format, &kept));
    status = end_format(reader, *format);
cleanup:
    forget(&kept);
    return status;
}

/* ---- the whole file ----------------------------------------------------------------------- */

static const char *sought(ovoid_molecule_format format) {
    switch (format) {
    case OVOID_MOLECULE_PQR:
    case OVOID_MOLECULE_PDB:
        return "an ATOM or HETATM record";
    case OVOID_MOLECULE_XYZR:
        return "x, y, z and radius";
    case OVOID_MOLECULE_MMCIF:
        return "an atom of the loop _atom_site";
    case OVOID_MOLECULE_AUTO:
        break;
    }
    return "an atom of a PDB, mmCIF, PQR or XYZR file";
}

static ovoid_status no_model(const ov_reader *reader) {
    const ov_sites *sites = &reader->sites;
    const unsigned long long models = reader->molecule->counts.models;
    return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                   "%s: no model %d: the file has %llu, number%s %d to %d",
                   ov_text_name(reader->text), (int)reader->options->model, models,
                   models == 1 ? "" : "s", (int)sites->lowest, (int)sites->highest);
}

/* Atoms there were, but none is left. */
static ovoid_status none_left(const ov_reader *reader) {
    const ovoid_molecule_counts *c = &reader->molecule->counts;
    return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                   "%s: no atoms left: of %llu, %llu are of other models, %llu of waters, %llu "
                   "hydrogens that were not wanted, %llu not selected",
                   ov_text_name(reader->text), (unsigned long long)c->skipped,
                   (unsigned long long)c->skipped_models, (unsigned long long)c->skipped_waters,
                   (unsigned long long)c->skipped_hydrogens,
                   (unsigned long long)c->skipped_selection);
}

static ovoid_status no_atoms(const ov_reader *reader, ovoid_molecule_format format) {
    const char *name = ov_text_name(reader->text);
    unsigned long long lines = reader->molecule->counts.lines;
    if (lines == 0)
        return ov_fail(reader->context, OVOID_ERROR_EMPTY, "%s: no atoms: the file is empty", name);
    if (reader->molecule->counts.skipped)
        return reader->sites.model_chosen ? none_left(reader) : no_model(reader);
    if (reader->unknown_lines)
        return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                       "%s: no atoms: none of its %llu line%s holds %s; line %llu is %s", name,
                       lines, lines == 1 ? "" : "s", sought(format),
                       (unsigned long long)reader->unknown_first, reader->unknown_text.text);
    return ov_fail(reader->context, OVOID_ERROR_EMPTY,
                   "%s: no atoms: none of its %llu line%s holds %s", name, lines,
                   lines == 1 ? "" : "s", sought(format));
}

static void warn_of_ignored(const ov_reader *reader) {
    if (reader->unknown_lines)
        ov_warn(reader->context, "%s: %llu line%s of no known kind ignored; line %llu is %s",
                ov_text_name(reader->text), (unsigned long long)reader->unknown_lines,
                reader->unknown_lines == 1 ? "" : "s", (unsigned long long)reader->unknown_first,
                reader->unknown_text.text);
}

/* XYZR holds places and radii alone. */
static ovoid_status check_xyzr(const ov_reader *reader) {
    const ovoid_read_options *o = reader->options;
    const bool radii = o->radii != OVOID_RADII_DEFAULT && o->radii != OVOID_RADII_OWN;
    const char *what = o->assembly       ? "an assembly"
                       : o->select       ? "a selection"
                       : o->no_hydrogens ? "leaving out hydrogens"
                       : radii           ? "other radii"
                       : o->model > 1    ? "a model's number"
                                         : NULL;
    if (!what)
        return OVOID_OK;
    return ov_fail(reader->context, OVOID_ERROR_ARGUMENT,
                   "%s: an XYZR file holds places and radii alone, and %s needs more",
                   ov_text_name(reader->text), what);
}

static ovoid_status read_text(ov_reader *reader, ovoid_molecule_format format) {
    ovoid_status status = read_lines(reader, &format);
    if (status == OVOID_ERROR_FORMAT) {
        /* A damaged gzip file can come out as text that makes no sense; say so if that is why. */
        ovoid_status damage = ov_text_verify(reader->text);
        return damage != OVOID_OK ? damage : status;
    }
    if (status == OVOID_OK && format == OVOID_MOLECULE_XYZR)
        status = check_xyzr(reader);
    if (status == OVOID_OK && reader->molecule->atoms)
        status = ov_sites_finish(reader);
    if (status != OVOID_OK)
        return status;
    if (reader->molecule->atoms == 0)
        return no_atoms(reader, format);
    reader->molecule->format = format;
    warn_of_ignored(reader);
    status = ov_assembly_finish(reader);
    ov_sites_count(reader->molecule);
    return status == OVOID_OK ? ov_radii_assign(reader) : status;
}

static void *trimmed(void *array, size_t count, size_t size) {
    void *exact = array ? realloc(array, count * size) : NULL;
    return exact ? exact : array;
}

void ov_molecule_count_zero_radii(ovoid_molecule *molecule) {
    molecule->counts.zero_radius = 0;
    for (size_t i = 0; i < molecule->atoms; i++)
        molecule->counts.zero_radius += molecule->xyzr[4 * i + 3] == 0;
}

/* Gives back what the geometric growth left over. */
static void trim(ovoid_molecule *m) {
    m->xyzr = trimmed(m->xyzr, m->atoms, 4 * sizeof *m->xyzr);
    m->identity = trimmed(m->identity, m->atoms, sizeof *m->identity);
    m->residues = trimmed(m->residues, m->residue_count, sizeof *m->residues);
}

/* ---- options ------------------------------------------------------------------------------- */

void ovoid_read_options_init(ovoid_read_options *options, size_t size) {
    const ovoid_read_options defaults = {0};
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

/* The caller's options, those that its version of the structure lacks filled in. */
static ovoid_status complete_options(ovoid_context *context, const ovoid_read_options *given,
                                     ovoid_read_options *options) {
    ovoid_read_options_init(options, sizeof *options);
    if (!given)
        return OVOID_OK;
    const ovoid_status status = OV_SIZED_TAKE(context, ovoid_read_options, given, options);
    if (status != OVOID_OK)
        return status;
    if ((int)options->format < OVOID_MOLECULE_AUTO || options->format > OVOID_MOLECULE_MMCIF)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_read: %d is no format",
                       (int)options->format);
    if ((int)options->radii < OVOID_RADII_DEFAULT || options->radii > OVOID_RADII_FILE)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_read_with: %d names no radii",
                       (int)options->radii);
    if (options->model < 0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "ovoid_molecule_read_with: model %d",
                       (int)options->model);
    if ((options->radii == OVOID_RADII_FILE) != (options->radii_file != NULL))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "ovoid_molecule_read_with: radii of a file need radii and radii_file");
    return OVOID_OK;
}

ovoid_status ovoid_molecule_read_with(ovoid_context *context, const char *path,
                                      const ovoid_read_options *given, ovoid_molecule **molecule) {
    OV_NEED(context, context);
    OV_NEED(context, path);
    OV_NEED(context, molecule);
    ovoid_read_options options;
    ovoid_status status = complete_options(context, given, &options);
    if (status != OVOID_OK)
        return status;
    ov_reader reader = {
        .context = context, .guess = options.format == OVOID_MOLECULE_AUTO, .options = &options};
    ov_progress_begin(context, "read");
    ov_sites_init(&reader.sites);
    status = OVOID_ERROR_MEMORY;
    reader.molecule = ov_alloc(context, 1, sizeof *reader.molecule, "a molecule");
    if (!reader.molecule)
        goto cleanup;
    OV_TRY(ov_selection_check(context, options.select));
    OV_TRY(ov_text_open(context, path, &reader.text));
    OV_TRY(read_text(&reader, reader.guess ? format_by_name(path) : options.format));
    OV_TRY(ov_progress_ask(context));
    trim(reader.molecule);
    ov_molecule_count_zero_radii(reader.molecule);
    OV_TRY(ov_molecule_doubts(context, ov_text_name(reader.text), reader.molecule));
    reader.molecule->counts.atoms = ovoid_molecule_atoms(reader.molecule);
    reader.molecule->counts.unit_atoms = reader.molecule->atoms;
    reader.molecule->counts.size = sizeof reader.molecule->counts;
    *molecule = reader.molecule;
    reader.molecule = NULL;
cleanup:
    ov_cif_destroy(&reader.cif);
    ov_sites_destroy(&reader.sites);
    ov_assembly_source_destroy(&reader.assemblies);
    ov_text_close(&reader.text);
    ovoid_molecule_destroy(&reader.molecule);
    ov_progress_end(context);
    return status;
}

ovoid_status ovoid_molecule_read(ovoid_context *context, const char *path,
                                 ovoid_molecule_format format, ovoid_molecule **molecule) {
    ovoid_read_options options;
    OV_NEED(context, context);
    OV_NEED(context, path);
    OV_NEED(context, molecule);
    ovoid_read_options_init(&options, sizeof options);
    options.format = format;
    return ovoid_molecule_read_with(context, path, &options, molecule);
}

/* ---- molecules from memory ---------------------------------------------------------------- */

ovoid_status ovoid_molecule_create(ovoid_context *context, const double *xyzr, size_t atoms,
                                   ovoid_molecule **molecule) {
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    if (atoms)
        OV_NEED(context, xyzr);
    if (atoms == 0)
        return ov_fail(context, OVOID_ERROR_EMPTY, "ovoid_molecule_create: no atoms");
    for (size_t i = 0; i < atoms; i++) {
        for (size_t k = 0; k < 4; k++) {
            const char *what = ov_reader_fault(k, xyzr[4 * i + k]);
            if (what)
                return ov_fail(context, OVOID_ERROR_ARGUMENT,
                               "ovoid_molecule_create: %s of atom %zu (from 0) is %g: %s",
                               axis_names[k], i, xyzr[4 * i + k], what);
        }
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
    made->counts.unit_atoms = atoms;
    made->counts.size = sizeof made->counts;
    ov_molecule_count_zero_radii(made);
    made->counts.models = 1;
    made->radii = OVOID_RADII_OWN;
    made->model = 1;
    *molecule = made;
    return OVOID_OK;
}

void ovoid_molecule_destroy(ovoid_molecule **molecule) {
    if (!molecule || !*molecule)
        return;
    free((*molecule)->xyzr);
    free((*molecule)->models);
    free((*molecule)->identity);
    free((*molecule)->residues);
    free((*molecule)->guesses);
    for (size_t i = 0; i < (*molecule)->part_count; i++)
        free((*molecule)->parts[i].index);
    free((*molecule)->parts);
    free((*molecule)->assemblies);
    free((*molecule)->placements);
    free((*molecule)->all_xyzr);
    free(*molecule);
    *molecule = NULL;
}

static ovoid_status copy_parts(ovoid_context *context, const ovoid_molecule *from,
                               ovoid_molecule *copy) {
    copy->placements = ov_copy(context, from->placements, from->placement_count,
                               sizeof *copy->placements, "a molecule");
    copy->parts = ov_alloc(context, from->part_count, sizeof *copy->parts, "a molecule");
    if (!copy->placements || !copy->parts)
        return OVOID_ERROR_MEMORY;
    copy->placement_count = from->placement_count;
    copy->all_atoms = from->all_atoms;
    for (; copy->part_count < from->part_count; copy->part_count++) {
        const ov_part *const part = &from->parts[copy->part_count];
        ov_part *const made = &copy->parts[copy->part_count];
        made->atoms = part->atoms;
        if (!part->index)
            continue;
        made->index = ov_copy(context, part->index, part->atoms, sizeof *part->index, "a molecule");
        if (!made->index)
            return OVOID_ERROR_MEMORY;
    }
    return OVOID_OK;
}

ovoid_status ov_molecule_copy_atoms(ovoid_context *context, const ovoid_molecule *molecule,
                                    ovoid_molecule **copy) {
    ovoid_status status = OVOID_OK;
    ovoid_molecule *made = ov_alloc(context, 1, sizeof *made, "a molecule");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->atoms = molecule->atoms;
    made->xyzr =
        ov_copy(context, molecule->xyzr, 4 * molecule->atoms, sizeof *made->xyzr, "a molecule");
    if (!made->xyzr)
        status = OVOID_ERROR_MEMORY;
    else if (molecule->placement_count > 0)
        status = copy_parts(context, molecule, made);
    if (status == OVOID_OK)
        *copy = made;
    else
        ovoid_molecule_destroy(&made);
    return status;
}

size_t ovoid_molecule_atoms(const ovoid_molecule *molecule) {
    if (!molecule)
        return 0;
    return molecule->placement_count ? molecule->all_atoms : molecule->atoms;
}

const double *ovoid_molecule_xyzr(const ovoid_molecule *molecule) {
    if (!molecule)
        return NULL;
    if (molecule->placement_count == 0)
        return molecule->xyzr;
    return ov_molecule_expand(NULL, molecule) == OVOID_OK ? molecule->all_xyzr : NULL;
}

ovoid_status ovoid_molecule_expand(ovoid_context *context, const ovoid_molecule *molecule) {
    OV_NEED(context, context);
    OV_NEED(context, molecule);
    return ov_molecule_expand(context, molecule);
}

size_t ovoid_molecule_unit_atoms(const ovoid_molecule *molecule) {
    return molecule ? molecule->atoms : 0;
}

const double *ovoid_molecule_unit_xyzr(const ovoid_molecule *molecule) {
    return molecule ? molecule->xyzr : NULL;
}

const ovoid_assembly_info *ovoid_molecule_assemblies(const ovoid_molecule *molecule,
                                                     size_t *count) {
    if (count)
        *count = molecule ? molecule->assembly_count : 0;
    return molecule ? molecule->assemblies : NULL;
}

const ovoid_placement *ovoid_molecule_placements(const ovoid_molecule *molecule, size_t *count) {
    if (count)
        *count = molecule ? molecule->placement_count : 0;
    return molecule ? molecule->placements : NULL;
}

const uint32_t *ovoid_molecule_part(const ovoid_molecule *molecule, uint32_t part, size_t *count) {
    const bool known = molecule && part < molecule->part_count;
    if (count)
        *count = known ? molecule->parts[part].atoms : 0;
    return known ? molecule->parts[part].index : NULL;
}

size_t ovoid_molecule_origin(const ovoid_molecule *molecule, size_t atom, size_t *placement) {
    if (placement)
        *placement = 0;
    if (!molecule || molecule->placement_count == 0)
        return molecule ? atom : 0;
    size_t low = 0, high = molecule->placement_count; /* the last that begins at `atom` or before */
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (molecule->placements[middle].first <= atom)
            low = middle;
        else
            high = middle;
    }
    const ovoid_placement *p = &molecule->placements[low];
    const ov_part *part = &molecule->parts[p->part];
    const size_t within = atom - (size_t)p->first;
    if (placement)
        *placement = low;
    return part->index && within < part->atoms ? part->index[within] : within;
}

const ovoid_molecule_counts *ovoid_molecule_read_counts(const ovoid_molecule *molecule) {
    return molecule ? &molecule->counts : NULL;
}

ovoid_molecule_format ovoid_molecule_read_format(const ovoid_molecule *molecule) {
    return molecule ? molecule->format : OVOID_MOLECULE_AUTO;
}

ovoid_radii ovoid_molecule_radii(const ovoid_molecule *molecule) {
    return molecule ? molecule->radii : OVOID_RADII_DEFAULT;
}

int32_t ovoid_molecule_model(const ovoid_molecule *molecule) {
    return molecule ? molecule->model : 0;
}

const int32_t *ovoid_molecule_models(const ovoid_molecule *molecule, size_t *count) {
    static const int32_t one = 1;
    const bool any = molecule && molecule->models;
    if (count)
        *count = any ? molecule->model_count : molecule != NULL;
    return any ? molecule->models : molecule ? &one : NULL;
}

const ovoid_atom *ovoid_molecule_identity(const ovoid_molecule *molecule) {
    return molecule ? molecule->identity : NULL;
}

const ovoid_residue *ovoid_molecule_residues(const ovoid_molecule *molecule, size_t *count) {
    const bool any = molecule && molecule->identity;
    if (count)
        *count = any ? molecule->residue_count : 0;
    return any ? molecule->residues : NULL;
}

const ovoid_guess *ovoid_molecule_guesses(const ovoid_molecule *molecule, size_t *count) {
    if (count)
        *count = molecule ? molecule->guess_count : 0;
    return molecule ? molecule->guesses : NULL;
}
