#include "molecule/reader.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- the collection ------------------------------------------------------------------------ */

void ov_sites_init(ov_sites *sites) {
    *sites = (ov_sites){.announced = OV_NO_MODEL};
}

void ov_sites_destroy(ov_sites *sites) {
    free(sites->extra);
    free(sites->residue_extra);
    free(sites->numbers);
    ov_sites_init(sites);
}

char ov_site_letter(char c) {
    return (c > 0 && c < 0x20) || c == 0x7f ? '?' : c;
}

bool ov_site_text(char *field, size_t size, const char *text, size_t length) {
    const size_t kept = length < size ? length : size - 1;
    for (size_t i = 0; i < kept; i++)
        field[i] = ov_site_letter(text[i]);
    memset(field + kept, 0, size - kept);
    return kept == length;
}

/* ---- models -------------------------------------------------------------------------------- */

void ov_sites_announce_model(ov_sites *sites, int32_t number) {
    sites->announced = number;
    sites->model_ended = sites->model_any;
}

void ov_sites_end_model(ov_sites *sites) {
    sites->announced = OV_NO_MODEL;
    sites->model_ended = sites->model_any;
}

enum { MODELS_MAX = 1000000 }; /* a trajectory of so many frames is no longer written as text */

static int by_number(const void *a, const void *b) {
    const int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

/* Ascending, each once. */
static void sort_numbers(ov_sites *sites) {
    size_t kept = 0;
    qsort(sites->numbers, sites->number_count, sizeof *sites->numbers, by_number);
    for (size_t i = 0; i < sites->number_count; i++)
        if (kept == 0 || sites->numbers[i] != sites->numbers[kept - 1])
            sites->numbers[kept++] = sites->numbers[i];
    sites->number_count = kept;
}

/* Where the atoms of models alternate, a number comes again and again: the array grows with the
 * numbers, not with how often they come. */
static ovoid_status make_room(ov_reader *reader) {
    ov_sites *sites = &reader->sites;
    if (sites->number_count < sites->number_room)
        return OVOID_OK;
    if (sites->number_count)
        sort_numbers(sites);
    if (sites->number_count > MODELS_MAX)
        return ov_fail(reader->context, OVOID_ERROR_LIMIT, "%s: more than %d models",
                       ov_text_name(reader->text), (int)MODELS_MAX);
    return ov_grow(reader->context, &sites->numbers, &sites->number_room,
                   2 * sites->number_count + 1, sizeof *sites->numbers, "numbers of models");
}

static void add_number(ov_reader *reader, int32_t number) {
    ov_sites *sites = &reader->sites;
    if (sites->numbers_status == OVOID_OK)
        sites->numbers_status = make_room(reader);
    if (sites->numbers_status == OVOID_OK)
        sites->numbers[sites->number_count++] = number;
}

/* Hands the numbers over to the molecule. */
static ovoid_status finish_numbers(ov_reader *reader) {
    ov_sites *sites = &reader->sites;
    if (sites->numbers_status != OVOID_OK || sites->number_count == 0)
        return sites->numbers_status;
    sort_numbers(sites);
    reader->molecule->models = sites->numbers;
    reader->molecule->model_count = sites->number_count;
    if (sites->by_atom)
        reader->molecule->counts.models = sites->number_count;
    sites->numbers = NULL;
    return OVOID_OK;
}

static void start_model(ov_reader *reader, int32_t number, bool again) {
    ov_sites *sites = &reader->sites;
    const int32_t wanted = reader->options->model;
    const bool matches = wanted == 0 || number == wanted;
    sites->lowest = sites->model_any && sites->lowest < number ? sites->lowest : number;
    sites->highest = sites->model_any && sites->highest > number ? sites->highest : number;
    sites->model = number;
    sites->model_open = sites->model_chosen ? again && number == sites->chosen : matches;
    if (sites->model_open) {
        sites->model_chosen = true;
        sites->chosen = number;
    }
    sites->model_any = true;
    sites->model_ended = false;
    sites->announced = OV_NO_MODEL;
    reader->molecule->counts.models++;
    add_number(reader, number);
}

static bool count_unless_open(ov_reader *reader) {
    if (!reader->sites.model_open) {
        reader->molecule->counts.skipped++;
        reader->molecule->counts.skipped_models++;
    }
    return reader->sites.model_open;
}

bool ov_sites_wanted(ov_reader *reader) {
    ov_sites *sites = &reader->sites;
    if (!sites->model_any || sites->model_ended) {
        const int32_t next = !sites->model_any          ? 1
                             : sites->model < INT32_MAX ? sites->model + 1
                                                        : INT32_MAX;
        start_model(reader, sites->announced != OV_NO_MODEL ? sites->announced : next, false);
    }
    return count_unless_open(reader);
}

bool ov_sites_wanted_of(ov_reader *reader, int32_t number) {
    reader->sites.by_atom = true;
    if (!reader->sites.model_any || number != reader->sites.model)
        start_model(reader, number, true);
    return count_unless_open(reader);
}

/* ---- adding -------------------------------------------------------------------------------- */

static bool same_residue(const ovoid_residue *residue, const ov_residue_extra *extra,
                         const ov_site *site) {
    return residue->number == site->number && residue->insertion == site->insertion &&
           memcmp(residue->name, site->residue, sizeof residue->name) == 0 &&
           memcmp(residue->chain, site->chain, sizeof residue->chain) == 0 &&
           memcmp(extra->part, site->part, sizeof extra->part) == 0;
}

/* The residue that the atom to be added is in: the last one, or a new one. */
static ovoid_status add_residue(ov_reader *reader, const ov_site *site) {
    ovoid_molecule *m = reader->molecule;
    ov_sites *sites = &reader->sites;
    ovoid_status status = OVOID_OK;
    if (m->residue_count && same_residue(&m->residues[m->residue_count - 1],
                                         &sites->residue_extra[m->residue_count - 1], site))
        return OVOID_OK;
    OV_TRY(ov_grow(reader->context, &m->residues, &sites->residue_room, m->residue_count + 1,
                   sizeof *m->residues, "residues"));
    OV_TRY(ov_grow(reader->context, &sites->residue_extra, &sites->residue_extra_room,
                   m->residue_count + 1, sizeof *sites->residue_extra, "residues"));
    ovoid_residue *residue = &m->residues[m->residue_count];
    ov_residue_extra *extra = &sites->residue_extra[m->residue_count++];
    *residue = (ovoid_residue){
        .number = site->number, .insertion = site->insertion, .first = (uint32_t)m->atoms};
    memcpy(residue->name, site->residue, sizeof residue->name);
    memcpy(residue->chain, site->chain, sizeof residue->chain);
    *extra = (ov_residue_extra){.entity = site->entity};
    memcpy(extra->part, site->part, sizeof extra->part);
cleanup:
    return status;
}

static ovoid_status add_identity(ov_reader *reader, const ov_site *site) {
    ovoid_molecule *m = reader->molecule;
    ov_sites *sites = &reader->sites;
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(reader->context, &m->identity, &sites->identity_room, m->atoms + 1,
                   sizeof *m->identity, "atoms"));
    OV_TRY(ov_grow(reader->context, &sites->extra, &sites->extra_room, m->atoms + 1,
                   sizeof *sites->extra, "atoms"));
    OV_TRY(add_residue(reader, site));
    ovoid_atom *atom = &m->identity[m->atoms];
    *atom = (ovoid_atom){.altloc = site->altloc,
                         .serial = site->serial,
                         .residue = (uint32_t)(m->residue_count - 1),
                         .flags = site->hetero ? OVOID_ATOM_HETERO : 0};
    memcpy(atom->name, site->name, sizeof atom->name);
    const char *symbol = ov_element_name(site->element);
    memcpy(atom->element, symbol, strlen(symbol));
    if (site->occupancy == 0)
        atom->flags |= OVOID_ATOM_ZERO_OCCUPANCY;
    sites->extra[m->atoms] = (ov_site_extra){site->occupancy, site->b_factor};
    sites->altlocs |= site->altloc != 0;
cleanup:
    return status;
}

static bool is_hydrogen(int element) {
    return element == OV_HYDROGEN || element == OV_DEUTERIUM;
}

ovoid_status ov_reader_add_site(ov_reader *reader, const ov_line *line, const ov_field *x,
                                const ov_field *y, const ov_field *z, const ov_field *radius,
                                const ov_site *site) {
    ovoid_molecule_counts *counts = &reader->molecule->counts;
    ovoid_status status = OVOID_OK;
    const bool structure = radius == NULL;
    if (structure && !reader->options->waters && ov_residue_is_water(site->residue)) {
        counts->skipped++;
        counts->skipped_waters++;
        return OVOID_OK;
    }
    if (reader->options->no_hydrogens && is_hydrogen(site->element)) {
        counts->skipped++;
        counts->skipped_hydrogens++;
        return OVOID_OK;
    }
    if (reader->molecule->atoms >= UINT32_MAX)
        return ov_fail(reader->context, OVOID_ERROR_LIMIT, "%s: more than %u atoms",
                       ov_text_name(reader->text), UINT32_MAX);
    OV_TRY(add_identity(reader, site));
    OV_TRY(ov_reader_add(reader, line, x, y, z, radius));
cleanup:
    return status;
}

void ov_sites_ter(ov_reader *reader) {
    const ovoid_molecule *m = reader->molecule;
    for (size_t i = m->residue_count; i-- > 0;) {
        ov_residue_extra *extra = &reader->sites.residue_extra[i];
        if (extra->entity != OV_ENTITY_UNKNOWN ||
            memcmp(m->residues[i].chain, m->residues[m->residue_count - 1].chain,
                   sizeof m->residues[i].chain) != 0)
            return;
        extra->entity =
            ov_residue_is_water(m->residues[i].name) ? OV_ENTITY_WATER : OV_ENTITY_POLYMER;
    }
}

/* ---- selections ---------------------------------------------------------------------------- */

/* Where the file does not say what a residue belongs to, its name or its records do. */
static ov_entity entity_of(const ovoid_molecule *m, const ov_sites *sites, const ovoid_atom *atom) {
    const ov_entity entity = sites->residue_extra[atom->residue].entity;
    const char *name = m->residues[atom->residue].name;
    if (entity != OV_ENTITY_UNKNOWN)
        return entity;
    if (ov_residue_is_water(name))
        return OV_ENTITY_WATER;
    const bool hetero = atom->flags & OVOID_ATOM_HETERO;
    return !hetero || ov_residue_is_polymer(name) ? OV_ENTITY_POLYMER : OV_ENTITY_OTHER;
}

static bool is_selected(const ov_reader *reader, ov_selection *selection, size_t i) {
    const ovoid_molecule *m = reader->molecule;
    const ovoid_atom *atom = &m->identity[i];
    const ovoid_residue *residue = &m->residues[atom->residue];
    const ov_selectable seen = {.name = atom->name,
                                .residue = residue->name,
                                .chain = residue->chain,
                                .element = ov_element_find(atom->element),
                                .altloc = atom->altloc,
                                .insertion = residue->insertion ? residue->insertion : ' ',
                                .number = residue->number,
                                .model = reader->sites.chosen,
                                .entity = entity_of(m, &reader->sites, atom),
                                .occupancy = reader->sites.extra[i].occupancy,
                                .b_factor = reader->sites.extra[i].b_factor};
    return ov_selection_matches(selection, &seen);
}

static ovoid_status fail_selection(ovoid_context *context, const char *error) {
    return *error ? ov_fail(context, OVOID_ERROR_ARGUMENT, "selection: %s", error)
                  : ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a selection");
}

ovoid_status ov_selection_check(ovoid_context *context, const char *text) {
    char error[256];
    if (!text)
        return OVOID_OK;
    ov_selection *selection = ov_selection_create(text, error, sizeof error);
    if (!selection)
        return fail_selection(context, error);
    ov_selection_destroy(&selection);
    return OVOID_OK;
}

static ovoid_status select_atoms(ov_reader *reader, unsigned char *keep) {
    ovoid_molecule *m = reader->molecule;
    char error[256];
    ov_selection *selection = ov_selection_create(reader->options->select, error, sizeof error);
    if (!selection)
        return fail_selection(reader->context, error);
    for (size_t i = 0; i < m->atoms; i++) {
        keep[i] = is_selected(reader, selection, i);
        m->counts.skipped_selection += !keep[i];
    }
    m->counts.skipped += m->counts.skipped_selection;
    ov_selection_destroy(&selection);
    return OVOID_OK;
}

/* ---- alternate locations -------------------------------------------------------------------- */

/*
 * A residue's atoms with the same label are one conformer. The one with the highest mean occupancy
 * stays (of equal ones the first), and with it each further one that is no alternative to those
 * that stay: one that shares no atom name with them, is of the same kind of residue, and has no
 * atom where they have one. So two side-chain atoms labelled A and B and two others labelled C and
 * D become one of each pair, and a residue never mixes two conformers, nor hydrogen with the
 * deuterium in its place.
 */

/* An atom with a label, to be sorted by residue. */
typedef struct labelled {
    char chain[12];
    int32_t number;
    char insertion;
    uint32_t atom;
} labelled;

typedef struct conformer {
    char label;
    double occupancy; /* sum, then mean */
    size_t atoms, first;
    bool kept;
} conformer;

enum { LABELS = 256, LARGE_RESIDUE = 512 };

static int by_residue(const labelled *x, const labelled *y) {
    const int chain = memcmp(x->chain, y->chain, sizeof x->chain);
    if (chain)
        return chain;
    if (x->number != y->number)
        return x->number < y->number ? -1 : 1;
    return (x->insertion > y->insertion) - (x->insertion < y->insertion);
}

static int by_residue_and_atom(const void *a, const void *b) {
    const labelled *x = a, *y = b;
    const int residue = by_residue(x, y);
    return residue ? residue : (x->atom > y->atom) - (x->atom < y->atom);
}

/* Highest mean occupancy first; equal ones, up to what two decimals blur, as in the file. */
static int by_occupancy(const void *a, const void *b) {
    const conformer *x = a, *y = b;
    const long long p = llround(x->occupancy * 1e4), q = llround(y->occupancy * 1e4);
    if (p != q)
        return p > q ? -1 : 1;
    return (x->first > y->first) - (x->first < y->first);
}

static size_t find_conformers(const ov_reader *reader, const labelled *atoms, size_t count,
                              conformer found[LABELS]) {
    size_t labels = 0;
    for (size_t i = 0; i < count; i++) {
        const char label = reader->molecule->identity[atoms[i].atom].altloc;
        size_t k = 0;
        while (k < labels && found[k].label != label)
            k++;
        if (k == labels)
            found[labels++] = (conformer){.label = label, .first = i};
        found[k].occupancy += reader->sites.extra[atoms[i].atom].occupancy;
        found[k].atoms++;
    }
    for (size_t k = 0; k < labels; k++)
        found[k].occupancy /= (double)found[k].atoms;
    qsort(found, labels, sizeof *found, by_occupancy);
    return labels;
}

/* Whether two atoms of different labels stand for the same thing. */
static bool are_rivals(const ovoid_molecule *m, uint32_t a, uint32_t b) {
    const double near = 0.5; /* angstrom */
    const ovoid_atom *x = &m->identity[a], *y = &m->identity[b];
    const double *p = m->xyzr + 4 * (size_t)a, *q = m->xyzr + 4 * (size_t)b;
    const double dx = p[0] - q[0], dy = p[1] - q[1], dz = p[2] - q[2];
    return memcmp(x->name, y->name, sizeof x->name) == 0 ||
           memcmp(m->residues[x->residue].name, m->residues[y->residue].name,
                  sizeof m->residues[0].name) != 0 ||
           dx * dx + dy * dy + dz * dz < near * near;
}

static bool has_rival(const ovoid_molecule *m, const labelled *atoms, size_t count, char label,
                      char kept) {
    for (size_t i = 0; i < count; i++)
        for (size_t j = 0; m->identity[atoms[i].atom].altloc == label && j < count; j++)
            if (m->identity[atoms[j].atom].altloc == kept &&
                are_rivals(m, atoms[i].atom, atoms[j].atom))
                return true;
    return false;
}

static void resolve_residue(ov_reader *reader, const labelled *atoms, size_t count,
                            unsigned char *keep) {
    ovoid_molecule *m = reader->molecule;
    conformer found[LABELS];
    const size_t labels = find_conformers(reader, atoms, count, found);
    bool stays[LABELS] = {false};
    for (size_t k = 0; k < labels; k++) {
        found[k].kept = k == 0 || count <= LARGE_RESIDUE;
        for (size_t other = 0; other < k && found[k].kept; other++)
            if (found[other].kept)
                found[k].kept = !has_rival(m, atoms, count, found[k].label, found[other].label);
        stays[(unsigned char)found[k].label] = found[k].kept;
    }
    for (size_t i = 0; i < count; i++) {
        const uint32_t atom = atoms[i].atom;
        keep[atom] = stays[(unsigned char)m->identity[atom].altloc];
        m->counts.skipped_altlocs += !keep[atom];
    }
}

static ovoid_status resolve_altlocs(ov_reader *reader, unsigned char *keep) {
    const ovoid_molecule *m = reader->molecule;
    size_t count = 0;
    for (size_t i = 0; i < m->atoms; i++)
        count += keep[i] && m->identity[i].altloc;
    labelled *atoms = ov_alloc(reader->context, count, sizeof *atoms, "alternate locations");
    if (!atoms)
        return OVOID_ERROR_MEMORY;
    count = 0;
    for (size_t i = 0; i < m->atoms; i++)
        if (keep[i] && m->identity[i].altloc) {
            const ovoid_residue *residue = &m->residues[m->identity[i].residue];
            labelled *one = &atoms[count++];
            one->number = residue->number;
            one->insertion = residue->insertion;
            one->atom = (uint32_t)i;
            memcpy(one->chain, residue->chain, sizeof one->chain);
        }
    if (count)
        qsort(atoms, count, sizeof *atoms, by_residue_and_atom);
    for (size_t begin = 0, end; begin < count; begin = end) {
        end = begin + 1;
        while (end < count && by_residue(&atoms[begin], &atoms[end]) == 0)
            end++;
        resolve_residue(reader, atoms + begin, end - begin, keep);
    }
    reader->molecule->counts.skipped += reader->molecule->counts.skipped_altlocs;
    free(atoms);
    return OVOID_OK;
}

/* ---- the end -------------------------------------------------------------------------------- */

/* Moves what stays together. Residues without atoms go. */
void ov_sites_compact(ov_reader *reader, const unsigned char *keep) {
    ovoid_molecule *m = reader->molecule;
    ov_sites *sites = &reader->sites;
    size_t atoms = 0, residues = 0;
    uint32_t last = UINT32_MAX; /* the residue, as it was numbered, of the last atom that stays */
    for (size_t i = 0; i < m->atoms; i++) {
        if (!keep[i])
            continue;
        const uint32_t old = m->identity[i].residue;
        if (old != last) {
            m->residues[residues] = m->residues[old];
            m->residues[residues].first = (uint32_t)atoms;
            sites->residue_extra[residues++] = sites->residue_extra[old];
            last = old;
        }
        memmove(m->xyzr + 4 * atoms, m->xyzr + 4 * i, 4 * sizeof *m->xyzr);
        m->identity[atoms] = m->identity[i];
        m->identity[atoms++].residue = (uint32_t)(residues - 1);
    }
    m->atoms = atoms;
    m->residue_count = residues;
}

static ovoid_status decide(ov_reader *reader) {
    ovoid_molecule *m = reader->molecule;
    ovoid_status status = OVOID_OK;
    unsigned char *keep = NULL;
    if (!reader->options->select && !reader->sites.altlocs)
        return OVOID_OK;
    keep = ov_alloc(reader->context, m->atoms, 1, "a selection");
    if (!keep)
        return OVOID_ERROR_MEMORY;
    memset(keep, 1, m->atoms);
    if (reader->options->select)
        OV_TRY(select_atoms(reader, keep));
    if (reader->sites.altlocs)
        OV_TRY(resolve_altlocs(reader, keep));
    ov_sites_compact(reader, keep);
cleanup:
    free(keep);
    return status;
}

void ov_sites_count(ovoid_molecule *m) {
    for (size_t i = 0; m->identity && i < m->atoms; i++) {
        m->counts.zero_occupancy += (m->identity[i].flags & OVOID_ATOM_ZERO_OCCUPANCY) != 0;
        m->counts.hydrogens += is_hydrogen(ov_element_find(m->identity[i].element));
    }
}

ovoid_status ov_sites_finish(ov_reader *reader) {
    ovoid_molecule *m = reader->molecule;
    if (m->identity) {
        ovoid_status status = decide(reader);
        if (status != OVOID_OK)
            return status;
    }
    const ovoid_status status = finish_numbers(reader);
    if (status != OVOID_OK)
        return status;
    if (m->counts.models == 0)
        m->counts.models = 1;
    m->model = reader->sites.model_chosen ? reader->sites.chosen : 1;
    if (reader->sites.cut_names)
        ov_warn(reader->context, "%s: %llu name%s longer than there is room for cut",
                ov_text_name(reader->text), (unsigned long long)reader->sites.cut_names,
                reader->sites.cut_names == 1 ? "" : "s");
    return OVOID_OK;
}
