#include "fuzz.h"

#include <math.h>
#include <string.h>

/* Atoms of an assembly that are made: its limit of 2^32 would only test the machine. */
enum { EXPANDED_MAX = 100000 };

static void check_places(const double *xyzr, size_t atoms) {
    for (size_t i = 0; i < 4 * atoms; i++)
        fuzz_require(isfinite(xyzr[i]) &&
                         (i % 4 < 3 ? fabs(xyzr[i]) <= 1e6 : xyzr[i] >= 0 && xyzr[i] <= 100),
                     "coordinates are within 1e6, radii 0 to 100");
}

/* Text that ends within its field and is filled up with zeros. */
static void check_text(const char *field, size_t size) {
    const size_t length = strnlen(field, size);
    fuzz_require(length < size, "text ends in a zero byte");
    for (size_t i = length; i < size; i++)
        fuzz_require(field[i] == 0, "text is filled up with zeros");
}

static void check_identity(const ovoid_molecule *m) {
    const ovoid_atom *identity = ovoid_molecule_identity(m);
    const size_t atoms = ovoid_molecule_unit_atoms(m);
    size_t count;
    const ovoid_residue *residues = ovoid_molecule_residues(m, &count);
    if (!identity)
        return;
    fuzz_require(count > 0 && count <= atoms, "each residue has an atom");
    for (size_t i = 0; i < count; i++) {
        fuzz_require(i ? residues[i].first > residues[i - 1].first : residues[i].first == 0,
                     "residues follow one another");
        check_text(residues[i].name, sizeof residues[i].name);
        check_text(residues[i].chain, sizeof residues[i].chain);
    }
    for (size_t i = 0; i < atoms; i++) {
        const size_t r = identity[i].residue;
        fuzz_require(r < count && residues[r].first <= i &&
                         (r + 1 == count || i < residues[r + 1].first),
                     "an atom is in its residue");
        check_text(identity[i].name, sizeof identity[i].name);
        check_text(identity[i].element, sizeof identity[i].element);
    }
}

static void check_counts(const ovoid_molecule *m) {
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(m);
    fuzz_require(c.atoms == ovoid_molecule_atoms(m), "counts.atoms are the atoms");
    fuzz_require(c.unit_atoms == ovoid_molecule_unit_atoms(m), "counts.unit_atoms, too");
    fuzz_require(c.zero_radius <= c.unit_atoms && c.hydrogens <= c.unit_atoms &&
                     c.zero_occupancy <= c.unit_atoms && c.guessed_radii <= c.unit_atoms,
                 "no kind of atoms is more than all");
    fuzz_require(c.skipped == c.skipped_models + c.skipped_waters + c.skipped_hydrogens +
                                  c.skipped_selection + c.skipped_assembly + c.skipped_altlocs,
                 "each atom that was left out has one reason");
    size_t count;
    uint64_t guessed = 0;
    const ovoid_guess *guesses = ovoid_molecule_guesses(m, &count);
    for (size_t i = 0; i < count; i++)
        guessed += guesses[i].atoms;
    fuzz_require(guessed <= c.guessed_radii, "guesses are counted once");
}

static void check_models(const ovoid_molecule *m) {
    size_t count;
    bool own = false;
    const int32_t *models = ovoid_molecule_models(m, &count);
    fuzz_require(count > 0 && count <= ovoid_molecule_read_counts(m)->models,
                 "there are as many models as numbers, or more");
    for (size_t i = 0; i < count; i++) {
        fuzz_require(i == 0 || models[i - 1] < models[i], "numbers of models ascend");
        own = own || models[i] == ovoid_molecule_model(m);
    }
    fuzz_require(own, "the model that was read is one of them");
}

static void check_placements(const ovoid_molecule *m) {
    size_t count, part_atoms, placement;
    uint64_t total = 0;
    const ovoid_placement *placements = ovoid_molecule_placements(m, &count);
    for (size_t i = 0; i < count; i++) {
        fuzz_require(placements[i].first == total, "placements follow one another");
        const uint32_t *part = ovoid_molecule_part(m, placements[i].part, &part_atoms);
        fuzz_require(part_atoms > 0, "a placement is of a part");
        for (size_t k = 0; part && k < part_atoms && i < 100; k++)
            fuzz_require(part[k] < ovoid_molecule_unit_atoms(m), "a part is of the unit");
        total += part_atoms;
    }
    if (!count)
        return;
    const size_t atoms = ovoid_molecule_atoms(m);
    fuzz_require(total == atoms, "placements make up the assembly");
    fuzz_require(ovoid_molecule_origin(m, atoms - 1, &placement) < ovoid_molecule_unit_atoms(m) &&
                     placement == count - 1,
                 "the last atom is of the last placement");
}

ovoid_molecule *fuzz_read(const char *path, const ovoid_read_options *options) {
    ovoid_molecule *m = NULL;
    const ovoid_status status = ovoid_molecule_read_with(fuzz_context(), path, options, &m);
    if (status != OVOID_OK) {
        fuzz_failed(status, m);
        return NULL;
    }
    fuzz_require(ovoid_molecule_atoms(m) > 0, "a molecule has an atom");
    check_places(ovoid_molecule_unit_xyzr(m), ovoid_molecule_unit_atoms(m));
    check_identity(m);
    check_counts(m);
    check_models(m);
    check_placements(m);
    if (ovoid_molecule_atoms(m) <= EXPANDED_MAX)
        check_places(ovoid_molecule_xyzr(m), ovoid_molecule_atoms(m));
    return m;
}

/* Other choices than the defaults. */
static void choose(uint32_t chance, ovoid_read_options *options) {
    static const char *const selections[] = {"A", "[!C]", "/1/A/1-3", ";polymer", "(GLY)/CA", "*"};
    static const char radii[] = "GLY CA 2.1\nALA CB 2\nC 1.7\nO 1.5 # by element\n";
    static const ovoid_radii sources[] = {OVOID_RADII_DEFAULT, OVOID_RADII_BONDI,
                                          OVOID_RADII_UNITED, OVOID_RADII_FILE};
    options->radii = sources[chance & 3];
    if (options->radii == OVOID_RADII_FILE)
        options->radii_file = fuzz_file(1, radii, sizeof radii - 1);
    options->waters = chance & 4;
    options->no_hydrogens = chance & 8;
    options->model = chance & 16 ? 2 : 0;
    if (chance & 32)
        options->select = selections[(chance >> 6) % 6];
    if (chance & 1 << 12)
        options->format = OVOID_MOLECULE_AUTO;
}

void fuzz_molecule(const uint8_t *data, size_t size, ovoid_molecule_format format) {
    const uint32_t chance = fuzz_hash(data, size);
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.format = format;
    const char *path = fuzz_file(0, data, size);
    ovoid_molecule *m = fuzz_read(path, &options);
    size_t assemblies;
    const ovoid_assembly_info *info = ovoid_molecule_assemblies(m, &assemblies);
    if (assemblies) {
        check_text(info[chance % assemblies].id, sizeof info[0].id);
        options.assembly = info[chance % assemblies].id;
        ovoid_molecule *assembly = fuzz_read(path, &options);
        ovoid_molecule_destroy(&assembly);
        options.assembly = NULL;
    }
    ovoid_molecule_destroy(&m);
    choose(chance, &options);
    m = fuzz_read(path, &options);
    ovoid_molecule_destroy(&m);
}
