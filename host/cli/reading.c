#include "reading.h"

#include "measures.h"

#include <stdlib.h>
#include <string.h>

typedef unsigned long long count; /* as printf wants it */

/* ---- options ------------------------------------------------------------------------------- */

static const struct {
    const char *name;
    source_format format;
} format_names[] = {{"pdb", SOURCE_PDB}, {"mmcif", SOURCE_MMCIF}, {"cif", SOURCE_MMCIF},
                    {"pqr", SOURCE_PQR}, {"xyzr", SOURCE_XYZR},   {"ovoid", SOURCE_MODEL}};

static const cli_number model_number = {
    "model", CLI_COUNT, offsetof(reading, options.model), 1, INT32_MAX, false, false, "", ""};

void reading_init(reading *r, bool models) {
    *r = (reading){.models = models};
    ovoid_read_options_init(&r->options, sizeof r->options);
}

static bool parse_format(reading *r, const char *text) {
    for (size_t i = 0; i < sizeof format_names / sizeof *format_names; i++)
        if (strcmp(text, format_names[i].name) == 0 &&
            (r->models || format_names[i].format != SOURCE_MODEL)) {
            r->format = format_names[i].format;
            return true;
        }
    cli_error("--format takes pdb, mmcif, pqr%s, not '%s'",
              r->models ? ", xyzr or ovoid" : " or xyzr", text);
    return false;
}

/* A name, else a file. */
static void parse_radii(reading *r, const char *text) {
    r->options.radii = OVOID_RADII_FILE;
    r->options.radii_file = text;
    for (int i = OVOID_RADII_BONDI; i <= OVOID_RADII_UNITED; i++)
        if (strcmp(text, ovoid_radii_name((ovoid_radii)i)) == 0) {
            r->options.radii = (ovoid_radii)i;
            r->options.radii_file = NULL;
        }
}

bool reading_parse(reading *r, int option, const char *value) {
    switch (option) {
    case READING_FORMAT:
        return parse_format(r, value);
    case READING_RADII:
        r->given = "radii";
        parse_radii(r, value);
        return true;
    case READING_SELECT:
        r->given = "select";
        r->options.select = value;
        return true;
    case READING_MODEL:
        r->given = "model";
        return cli_number_parse(&model_number, value, r);
    case READING_ASSEMBLY:
        r->given = "assembly";
        r->options.assembly = value;
        return true;
    case READING_WATERS:
        r->given = "waters";
        r->options.waters = true;
        return true;
    default:
        r->given = "no-hydrogens";
        r->options.no_hydrogens = true;
        return true;
    }
}

void reading_help(FILE *stream, bool models) {
    fputs("\nReading a molecule:\n", stream);
    cli_option_help(models ? "--format pdb|mmcif|pqr|xyzr|ovoid" : "--format pdb|mmcif|pqr|xyzr",
                    models ? "how the file is written; ovoid is a model (default: by its "
                             "extension, else by its contents; standard input is a model)"
                           : "how the file is written (default: by its extension, else by its "
                             "contents)",
                    stream);
    cli_option_help("--radii bondi|paper|united|FILE",
                    "bondi or paper (by element), united (of heavy atoms that also stand for the "
                    "hydrogens that the file lacks), or a file with lines 'residue atom radius' or "
                    "'element radius' (default: those of the file, PQR or XYZR; of a structure "
                    "united if it has no hydrogens, else bondi)",
                    stream);
    cli_option_help("--select TEXT",
                    "keep the selected atoms alone, in gemmi's syntax: A,B (chains), A/10-60 "
                    "(residues), (ALA), [!C] (elements), ;polymer",
                    stream);
    cli_option_help("--model N", "the model of this number (default: the first)", stream);
    cli_option_help("--assembly ID|list",
                    "this assembly that the file describes, all its copies; 'list' prints which "
                    "there are, and does nothing else (default: the atoms as they are in the file)",
                    stream);
    cli_option_help("--waters", "keep the waters of PDB and mmCIF files", stream);
    cli_option_help("--no-hydrogens", "leave hydrogens out", stream);
}

/* ---- reading -------------------------------------------------------------------------------- */

bool reading_is_model(const reading *r, const char *path) {
    return r->format == SOURCE_AUTO ? cli_is_model(path) : r->format == SOURCE_MODEL;
}

ovoid_status reading_molecule(const reading *r, ovoid_context *context, const char *path,
                              ovoid_molecule **molecule) {
    static const ovoid_molecule_format formats[] = {
        [SOURCE_AUTO] = OVOID_MOLECULE_AUTO,   [SOURCE_PQR] = OVOID_MOLECULE_PQR,
        [SOURCE_XYZR] = OVOID_MOLECULE_XYZR,   [SOURCE_PDB] = OVOID_MOLECULE_PDB,
        [SOURCE_MMCIF] = OVOID_MOLECULE_MMCIF, [SOURCE_MODEL] = OVOID_MOLECULE_AUTO};
    ovoid_read_options options = r->options;
    options.format = formats[r->format];
    return ovoid_molecule_read_with(context, path, &options, molecule);
}

bool reading_lists(const reading *r) {
    return r->options.assembly && strcmp(r->options.assembly, "list") == 0;
}

int reading_list(const reading *r, ovoid_context *context, const char *path) {
    reading all = *r;
    ovoid_molecule *molecule = NULL;
    size_t entries;
    all.options.assembly = NULL;
    const ovoid_status status = reading_molecule(&all, context, path, &molecule);
    if (status != OVOID_OK)
        return cli_failure(context, status, CLI_INPUT);
    const ovoid_assembly_info *info = ovoid_molecule_assemblies(molecule, &entries);
    cli_progress_erase();
    printf("%s: %zu atoms in the file\n", source_name(path), ovoid_molecule_atoms(molecule));
    if (entries == 0)
        puts("it describes no assemblies");
    else
        printf("%-10s  %10s  %12s\n", "assembly", "placements", "atoms");
    for (size_t i = 0; i < entries; i++)
        printf("%-10s  %10llu  %12llu\n", info[i].id, (count)info[i].placements,
               (count)info[i].atoms);
    ovoid_molecule_destroy(&molecule);
    return CLI_OK;
}

bool reading_check_model(const reading *r, const char *path) {
    if (!r->given)
        return true;
    cli_error("--%s is for molecules, but '%s' is a model", r->given, path);
    return false;
}

/* ---- summary -------------------------------------------------------------------------------- */

static const char *plural(count number) {
    return number == 1 ? "" : "s";
}

/* Each reason with its number, in brackets. */
static void print_skipped(FILE *out, const ovoid_molecule_counts *c) {
    const struct {
        count number;
        const char *what;
    } reasons[] = {{c->skipped_models, "in other models"},
                   {c->skipped_waters, "of waters"},
                   {c->skipped_hydrogens, "hydrogens"},
                   {c->skipped_selection, "not selected"},
                   {c->skipped_assembly, "not in the assembly"},
                   {c->skipped_altlocs, "at other alternate locations"}};
    const char *between = " (";
    fprintf(out, ", %llu skipped", (count)c->skipped);
    for (size_t i = 0; i < sizeof reasons / sizeof *reasons; i++)
        if (reasons[i].number) {
            fprintf(out, "%s%llu %s", between, reasons[i].number, reasons[i].what);
            between = ", ";
        }
    fputs(between[0] == ',' ? ")" : "", out);
}

/* What an assembly is made of, and what its atoms take. */
static void print_assembly(const reading *r, FILE *out, const ovoid_molecule *molecule) {
    size_t placements;
    if (!ovoid_molecule_placements(molecule, &placements))
        return;
    fprintf(out, "assembly  %s: %zu placement%s of %zu atoms of the file, %.1f MB\n",
            r->options.assembly, placements, plural(placements),
            ovoid_molecule_unit_atoms(molecule),
            (double)ovoid_molecule_atoms(molecule) * 4 * sizeof(double) / 1e6);
}

static bool is_structure(const ovoid_molecule *molecule) {
    const ovoid_molecule_format format = ovoid_molecule_read_format(molecule);
    return format == OVOID_MOLECULE_PDB || format == OVOID_MOLECULE_MMCIF;
}

/* Which radii, and why these. */
static void print_radii(const reading *r, FILE *out, const ovoid_molecule *molecule,
                        const ovoid_molecule_counts *c) {
    const ovoid_radii radii = ovoid_molecule_radii(molecule);
    if (radii == OVOID_RADII_OWN)
        return;
    fprintf(out, "radii     %s",
            radii == OVOID_RADII_FILE ? r->options.radii_file : ovoid_radii_name(radii));
    if (r->options.radii != OVOID_RADII_DEFAULT)
        fputs(is_structure(molecule) ? "" : ", instead of the file's", out);
    else if (c->hydrogens)
        fprintf(out, ", as there are %llu hydrogens", (count)c->hydrogens);
    else
        fputs(", as there are no hydrogens: they stand for those, too", out);
    if (c->guessed_radii)
        fprintf(out, "; %llu guessed", (count)c->guessed_radii);
    putc('\n', out);
}

void reading_print(const reading *r, FILE *out, const char *path, const ovoid_molecule *molecule) {
    cli_progress_erase();
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(molecule);
    fprintf(out, "molecule  %s: %llu atom%s", source_name(path), (count)c.atoms, plural(c.atoms));
    if (c.zero_radius)
        fprintf(out, ", %llu of them of radius 0", (count)c.zero_radius);
    if (c.zero_occupancy)
        fprintf(out, ", %llu of them of occupancy 0", (count)c.zero_occupancy);
    if (c.models > 1)
        fprintf(out, ", model %d of %llu", (int)ovoid_molecule_model(molecule), (count)c.models);
    if (c.skipped)
        print_skipped(out, &c);
    putc('\n', out);
    print_assembly(r, out, molecule);
    print_radii(r, out, molecule, &c);
}

/* ---- report --------------------------------------------------------------------------------- */

static const char *format_name(const ovoid_molecule *molecule) {
    switch (ovoid_molecule_read_format(molecule)) {
    case OVOID_MOLECULE_PQR:
        return "pqr";
    case OVOID_MOLECULE_XYZR:
        return "xyzr";
    case OVOID_MOLECULE_PDB:
        return "pdb";
    case OVOID_MOLECULE_MMCIF:
        return "mmcif";
    case OVOID_MOLECULE_AUTO:
        break;
    }
    return "unknown";
}

static bool report_counts(cJSON *object, const ovoid_molecule *molecule) {
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(molecule);
    const struct {
        const char *key;
        uint64_t value;
    } numbers[] = {{"atoms", c.atoms},
                   {"unit_atoms", c.unit_atoms},
                   {"atoms_skipped", c.skipped},
                   {"atoms_skipped_models", c.skipped_models},
                   {"atoms_skipped_waters", c.skipped_waters},
                   {"atoms_skipped_hydrogens", c.skipped_hydrogens},
                   {"atoms_skipped_selection", c.skipped_selection},
                   {"atoms_skipped_assembly", c.skipped_assembly},
                   {"atoms_skipped_altlocs", c.skipped_altlocs},
                   {"zero_radius_atoms", c.zero_radius},
                   {"zero_occupancy_atoms", c.zero_occupancy},
                   {"models", c.models}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (!cJSON_AddNumberToObject(object, numbers[i].key, (double)numbers[i].value))
            return false;
    if (!cJSON_AddNumberToObject(object, "model", ovoid_molecule_model(molecule)))
        return false;
    return ovoid_molecule_identity(molecule)
               ? cJSON_AddNumberToObject(object, "hydrogens", (double)c.hydrogens) != NULL
               : cJSON_AddNullToObject(object, "hydrogens") != NULL;
}

static bool report_guess(cJSON *list, const ovoid_guess *guess) {
    cJSON *object = cJSON_CreateObject();
    if (!object || !cJSON_AddItemToArray(list, object)) {
        cJSON_Delete(object);
        return false;
    }
    return cli_json_string(object, "element", guess->element) &&
           cli_json_string(object, "residue", guess->residue) &&
           cli_json_string(object, "atom", guess->atom) &&
           cJSON_AddNumberToObject(object, "radius", guess->radius) &&
           cJSON_AddNumberToObject(object, "atoms", (double)guess->atoms);
}

static bool report_radii(const reading *r, cJSON *object, const ovoid_molecule *molecule) {
    const ovoid_radii radii = ovoid_molecule_radii(molecule);
    size_t kinds;
    const ovoid_guess *guesses = ovoid_molecule_guesses(molecule, &kinds);
    cJSON *list;
    bool good =
        cli_json_string(object, "radii", ovoid_radii_name(radii)) &&
        (radii != OVOID_RADII_FILE ||
         cli_json_string(object, "radii_file", r->options.radii_file)) &&
        cJSON_AddNumberToObject(object, "guessed_radii",
                                (double)ovoid_molecule_read_counts(molecule)->guessed_radii) &&
        (list = cJSON_AddArrayToObject(object, "guessed")) != NULL;
    for (size_t i = 0; i < kinds && good; i++)
        good = report_guess(list, &guesses[i]);
    return good;
}

static bool report_assembly(const reading *r, cJSON *object, const ovoid_molecule *molecule) {
    size_t placements;
    if (!ovoid_molecule_placements(molecule, &placements))
        return cJSON_AddNullToObject(object, "assembly") != NULL;
    return cli_json_string(object, "assembly", r->options.assembly) &&
           cJSON_AddNumberToObject(object, "placements", (double)placements);
}

bool reading_report(const reading *r, cJSON *object, const ovoid_molecule *molecule) {
    return report_assembly(r, object, molecule) &&
           cli_json_string(object, "format", format_name(molecule)) &&
           report_counts(object, molecule) && report_radii(r, object, molecule);
}
