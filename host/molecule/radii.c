#include "molecule/radii.h"
#include "molecule/united.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What an atom gets of which nothing tells the radius: carbon's where the element is unknown, and
 * what is usual for metals where nobody has published one. */
#define RADIUS_UNKNOWN 1.7
#define RADIUS_METAL 2.4

static const char *const names[] = {
    [OVOID_RADII_DEFAULT] = "default", [OVOID_RADII_OWN] = "own",
    [OVOID_RADII_BONDI] = "bondi",     [OVOID_RADII_PAPER] = "paper",
    [OVOID_RADII_UNITED] = "united",   [OVOID_RADII_FILE] = "file"};

const char *ovoid_radii_name(ovoid_radii radii) {
    if ((int)radii < 0 || (size_t)radii >= sizeof names / sizeof names[0])
        return "unknown";
    return names[radii];
}

/* What one assignment goes by. */
typedef struct assignment {
    ovoid_context *context;
    ovoid_molecule *molecule;
    ovoid_radii radii;
    ov_radii_table *table;    /* FILE */
    ov_bonds *bonds;          /* UNITED, made when first needed */
    unsigned char *hydrogens; /* UNITED: of each atom, those in the file; NULL: the file has none */
    unsigned char *ends;      /* UNITED: of each residue, OV_UNITED_FIRST and LAST */
} assignment;

/* ---- guesses ------------------------------------------------------------------------------- */

static ovoid_status count_guess(assignment *a, size_t i, double radius) {
    ovoid_molecule *m = a->molecule;
    ovoid_atom *atom = &m->identity[i];
    const ovoid_residue *residue = &m->residues[atom->residue];
    atom->flags |= OVOID_ATOM_GUESSED_RADIUS;
    m->counts.guessed_radii++;
    for (size_t k = 0; k < m->guess_count; k++) {
        ovoid_guess *guess = &m->guesses[k];
        if (strcmp(guess->atom, atom->name) == 0 && strcmp(guess->residue, residue->name) == 0 &&
            strcmp(guess->element, atom->element) == 0) {
            guess->atoms++;
            return OVOID_OK;
        }
    }
    if (m->guess_count == OV_GUESSES_MAX)
        return OVOID_OK;
    if (!m->guesses &&
        !(m->guesses = ov_alloc(a->context, OV_GUESSES_MAX, sizeof *m->guesses, "guessed radii")))
        return OVOID_ERROR_MEMORY;
    ovoid_guess *guess = &m->guesses[m->guess_count++];
    *guess = (ovoid_guess){.radius = radius, .atoms = 1};
    memcpy(guess->element, atom->element, sizeof atom->element);
    memcpy(guess->residue, residue->name, sizeof guess->residue);
    memcpy(guess->atom, atom->name, sizeof guess->atom);
    return OVOID_OK;
}

static void warn_of_guesses(const assignment *a, const char *name) {
    const ovoid_molecule *m = a->molecule;
    char text[160];
    size_t used = 0;
    if (!m->counts.guessed_radii)
        return;
    for (size_t k = 0; k < m->guess_count && k < 3; k++)
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%s of %s (%g Å)",
                                 k ? ", " : "", m->guesses[k].atom[0] ? m->guesses[k].atom : "?",
                                 m->guesses[k].residue[0] ? m->guesses[k].residue : "?",
                                 m->guesses[k].radius);
    ov_warn(a->context, "%s: radii of %llu atom%s are guessed: %s%s", name,
            (unsigned long long)m->counts.guessed_radii, m->counts.guessed_radii == 1 ? "" : "s",
            text, m->guess_count > 3 ? ", ..." : "");
}

/* ---- by element ------------------------------------------------------------------------------ */

/* Returns whether it is more than a guess. */
static bool find_by_element(ovoid_radii radii, int element, double *radius) {
    enum { OXYGEN = 8, PHOSPHORUS = 15 };
    *radius = ov_radius_of_element(element);
    if (radii == OVOID_RADII_PAPER && element == OXYGEN)
        *radius = 1.5;
    if (radii == OVOID_RADII_PAPER && element == PHOSPHORUS)
        *radius = 1.85;
    if (*radius > 0)
        return true;
    *radius = element ? RADIUS_METAL : RADIUS_UNKNOWN;
    return false;
}

/* ---- united ---------------------------------------------------------------------------------- */

static bool has_atom(const ovoid_molecule *m, size_t residue, const char *name) {
    const size_t end = residue + 1 < m->residue_count ? m->residues[residue + 1].first : m->atoms;
    for (size_t i = m->residues[residue].first; i < end; i++)
        if (strcmp(m->identity[i].name, name) == 0)
            return true;
    return false;
}

/* Ends of the chains of amino acids and nucleotides. */
static ovoid_status find_ends(assignment *a, const ov_sites *sites) {
    const ovoid_molecule *m = a->molecule;
    size_t last = SIZE_MAX;
    a->ends = ov_alloc(a->context, m->residue_count, 1, "ends of chains");
    if (!a->ends)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < m->residue_count; i++) {
        if (!ov_residue_is_polymer(m->residues[i].name))
            continue;
        const bool goes_on = last != SIZE_MAX &&
                             memcmp(sites->residue_extra[last].part, sites->residue_extra[i].part,
                                    sizeof sites->residue_extra[i].part) == 0;
        if (!goes_on && last != SIZE_MAX)
            a->ends[last] |= OV_UNITED_LAST;
        if (!goes_on && !has_atom(m, i, "P"))
            a->ends[i] |= OV_UNITED_FIRST;
        last = i;
    }
    if (last != SIZE_MAX)
        a->ends[last] |= OV_UNITED_LAST;
    return OVOID_OK;
}

static ovoid_status need_bonds(assignment *a) {
    return a->bonds ? OVOID_OK : ov_bonds_create(a->context, a->molecule, &a->bonds);
}

/* Counts for each heavy atom the hydrogens that the file has. */
static ovoid_status count_hydrogens(assignment *a) {
    const ovoid_molecule *m = a->molecule;
    ovoid_status status = OVOID_OK;
    if (m->counts.hydrogens == 0)
        return OVOID_OK;
    OV_TRY(need_bonds(a));
    a->hydrogens = ov_alloc(a->context, m->atoms, 1, "hydrogens");
    if (!a->hydrogens)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < m->atoms; i++) {
        const int element = ov_element_find(m->identity[i].element);
        if (element != OV_HYDROGEN && element != OV_DEUTERIUM)
            continue;
        const size_t heavy = ov_bonds_of_hydrogen(a->bonds, i);
        if (heavy != SIZE_MAX && a->hydrogens[heavy] < 8)
            a->hydrogens[heavy]++;
    }
cleanup:
    return status;
}

/* How many hydrogens an atom ought to have, those in the file included; -1 unknown. */
static ovoid_status expect_hydrogens(assignment *a, size_t i, int *hydrogens) {
    const ovoid_molecule *m = a->molecule;
    const ovoid_atom *atom = &m->identity[i];
    const char *residue = m->residues[atom->residue].name;
    const bool thiol = strcmp(residue, "CYS") == 0 && strcmp(atom->name, "SG") == 0;
    ovoid_status status = OVOID_OK;
    *hydrogens = ov_united_hydrogens(residue, atom->name, a->ends[atom->residue]);
    if (*hydrogens < 0 || thiol)
        OV_TRY(need_bonds(a));
    if (*hydrogens < 0) {
        double places[OV_NEIGHBOURS_MAX][3];
        const size_t count = ov_bonds_heavy(a->bonds, i, places);
        *hydrogens = ov_united_hydrogens_of_shape(atom->element, m->xyzr + 4 * i, count,
                                                  (const double(*)[3])places);
        if (*hydrogens < 0 && !strchr("CNOS", atom->element[0]))
            *hydrogens = 0; /* P and the like hardly ever have any */
    } else if (thiol && ov_bonds_near(a->bonds, i, "SG", 2.5)) {
        *hydrogens = 0; /* a disulfide */
    }
cleanup:
    return status;
}

static ovoid_status find_united(assignment *a, size_t i, double *radius, bool *known) {
    const ovoid_molecule *m = a->molecule;
    const ovoid_atom *atom = &m->identity[i];
    const char *residue = m->residues[atom->residue].name;
    int hydrogens;
    ovoid_status status = expect_hydrogens(a, i, &hydrogens);
    if (status != OVOID_OK)
        return status;
    if (hydrogens >= 0 && a->hydrogens)
        hydrogens = hydrogens > a->hydrogens[i] ? hydrogens - a->hydrogens[i] : 0;
    const ov_united_source source =
        ov_united_radius(residue, atom->name, atom->element, hydrogens, radius);
    *known = source == OV_UNITED_ATOM;
    if (source == OV_UNITED_NONE)
        *known = find_by_element(OVOID_RADII_BONDI, ov_element_find(atom->element), radius);
    return OVOID_OK;
}

/* ---- all atoms ---------------------------------------------------------------------------------
 */

static ovoid_status find_radius(assignment *a, size_t i, double *radius, bool *known) {
    const ovoid_molecule *m = a->molecule;
    const ovoid_atom *atom = &m->identity[i];
    const int element = ov_element_find(atom->element);
    if (a->radii == OVOID_RADII_UNITED)
        return find_united(a, i, radius, known);
    *known = a->radii == OVOID_RADII_FILE
                 ? ov_radii_table_find(a->table, m->residues[atom->residue].name, atom->name,
                                       element, radius)
                 : find_by_element(a->radii, element, radius);
    if (!*known && a->radii == OVOID_RADII_FILE)
        find_by_element(OVOID_RADII_BONDI, element, radius);
    return OVOID_OK;
}

static ovoid_status assign(assignment *a, const ov_sites *sites) {
    ovoid_molecule *m = a->molecule;
    ovoid_status status = OVOID_OK;
    if (a->radii == OVOID_RADII_UNITED) {
        OV_TRY(find_ends(a, sites));
        OV_TRY(count_hydrogens(a));
    }
    for (size_t i = 0; i < m->atoms; i++) {
        double radius = 0.0;
        bool known = false;
        OV_TRY(find_radius(a, i, &radius, &known));
        m->xyzr[4 * i + 3] = radius;
        if (!known)
            OV_TRY(count_guess(a, i, radius));
    }
cleanup:
    return status;
}

/* Bondi's radii on a molecule that lacks most of its hydrogens leave it porous. */
static void warn_of_missing(const assignment *a, const char *name) {
    const ovoid_molecule_counts *c = &a->molecule->counts;
    const uint64_t heavy = a->molecule->atoms - c->hydrogens;
    if (a->radii == OVOID_RADII_UNITED || a->radii == OVOID_RADII_FILE || heavy < 20 ||
        4 * c->hydrogens > heavy)
        return;
    ov_warn(a->context,
            "%s: %llu hydrogens for %llu other atoms: most are missing, and without them radii by "
            "element leave gaps; the radii 'united' stand for those that are missing",
            name, (unsigned long long)c->hydrogens, (unsigned long long)heavy);
}

static ovoid_radii choose(const ov_reader *reader) {
    const ovoid_molecule *m = reader->molecule;
    const bool own = m->format == OVOID_MOLECULE_PQR || m->format == OVOID_MOLECULE_XYZR;
    const ovoid_radii wanted = reader->options->radii;
    if (wanted != OVOID_RADII_DEFAULT)
        return wanted;
    if (own)
        return OVOID_RADII_OWN;
    return m->counts.hydrogens ? OVOID_RADII_BONDI : OVOID_RADII_UNITED;
}

ovoid_status ov_radii_assign(ov_reader *reader) {
    ovoid_molecule *m = reader->molecule;
    ovoid_status status = OVOID_OK;
    assignment a = {.context = reader->context, .molecule = m, .radii = choose(reader)};
    const bool structure = m->format == OVOID_MOLECULE_PDB || m->format == OVOID_MOLECULE_MMCIF;
    if (a.radii == OVOID_RADII_OWN && structure)
        return ov_fail(reader->context, OVOID_ERROR_ARGUMENT, "%s: the file gives no radii",
                       ov_text_name(reader->text));
    m->radii = a.radii;
    if (a.radii == OVOID_RADII_OWN)
        return OVOID_OK;
    if (a.radii == OVOID_RADII_FILE)
        OV_TRY(ov_radii_table_read(reader->context, reader->options->radii_file, &a.table));
    OV_TRY(assign(&a, &reader->sites));
    warn_of_guesses(&a, ov_text_name(reader->text));
    warn_of_missing(&a, ov_text_name(reader->text));
cleanup:
    ov_radii_table_destroy(&a.table);
    ov_bonds_destroy(&a.bonds);
    free(a.hydrogens);
    free(a.ends);
    return status;
}
