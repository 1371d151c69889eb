/*
 * Radii that stand for missing hydrogens: the facts against chemistry written down independently,
 * the guesses by shape on ideal geometry and on a protein, and that protein's surface.
 */
#include "measure/measure.h"
#include "molecule/united.h"
#include "molecule/united_table.h"
#include "support.h"

/* ---- known residues ----------------------------------------------------------------------- */

/* Hydrogens of whole residues inside a chain, from their formulas: alanine C3H5NO and so on. */
static void test_residues_have_their_formula(void **state) {
    (void)state;
    static const struct {
        const char *residue, *backbone;
        int hydrogens;
    } formulas[] = {
        {"GLY", "=amino", 3},  {"ALA", "=amino", 5},  {"ARG", "=amino", 13}, {"ASN", "=amino", 6},
        {"ASP", "=amino", 4},  {"CYS", "=amino", 5},  {"CYX", "=amino", 4},  {"GLN", "=amino", 8},
        {"GLU", "=amino", 6},  {"HIS", "=amino", 7},  {"HID", "=amino", 7},  {"HIP", "=amino", 8},
        {"LEU", "=amino", 11}, {"LYS", "=amino", 13}, {"LYN", "=amino", 12}, {"MET", "=amino", 9},
        {"MSE", "=amino", 9},  {"PHE", "=amino", 9},  {"PRO", "=amino", 7},  {"SER", "=amino", 5},
        {"THR", "=amino", 7},  {"TRP", "=amino", 10}, {"TYR", "=amino", 9},  {"VAL", "=amino", 9},
        {"ASH", "=amino", 5},  {"GLH", "=amino", 7},  {"A", "=rna", 11},     {"G", "=rna", 11},
        {"C", "=rna", 11},     {"U", "=rna", 10},     {"DA", "=dna", 11},    {"DG", "=dna", 11},
        {"DC", "=dna", 11}};
    for (size_t i = 0; i < sizeof formulas / sizeof formulas[0]; i++) {
        int hydrogens = 0;
        for (size_t k = 0; k < ov_united_atoms_count; k++) {
            const ov_united_atom *atom = &ov_united_atoms[k];
            bool own = strcmp(atom->residue, formulas[i].residue) == 0;
            if (own)
                hydrogens += atom->hydrogens;
            if (strcmp(atom->residue, formulas[i].backbone) != 0)
                continue;
            int found = ov_united_hydrogens(formulas[i].residue, atom->atom, 0);
            bool overridden =
                (strcmp(formulas[i].residue, "GLY") == 0 && strcmp(atom->atom, "CA") == 0) ||
                (strcmp(formulas[i].residue, "PRO") == 0 && strcmp(atom->atom, "N") == 0);
            if (!overridden)
                hydrogens += found;
        }
        if (hydrogens != formulas[i].hydrogens)
            fail_msg("%s has %d hydrogens, not %d", formulas[i].residue, hydrogens,
                     formulas[i].hydrogens);
    }
}

static void test_ends_add_hydrogens(void **state) {
    (void)state;
    const unsigned first = OV_UNITED_FIRST, last = OV_UNITED_LAST;
    assert_int_equal(ov_united_hydrogens("ALA", "N", 0), 1);
    assert_int_equal(ov_united_hydrogens("ALA", "N", first), 3);
    assert_int_equal(ov_united_hydrogens("ALA", "N", last), 1);
    assert_int_equal(ov_united_hydrogens("PRO", "N", first | last), 2);
    assert_int_equal(ov_united_hydrogens("ALA", "OXT", last), 0);
    assert_int_equal(ov_united_hydrogens("G", "O5'", 0), 0);
    assert_int_equal(ov_united_hydrogens("G", "O5'", first), 1);
    assert_int_equal(ov_united_hydrogens("DT", "O3'", last), 1);
    assert_int_equal(ov_united_hydrogens("DT", "O3'", first), 0);
    assert_int_equal(ov_united_hydrogens("HOH", "O", first | last), 2);
}

static void test_spellings(void **state) {
    (void)state;
    assert_int_equal(ov_united_hydrogens("U", "C2*", 0), 1);
    assert_int_equal(ov_united_hydrogens("DT", "C2*", 0), 2);
    assert_int_equal(ov_united_hydrogens("URA", "O2*", 0), 1);
    assert_int_equal(ov_united_hydrogens("C", "O1P", 0), 0);
    assert_int_equal(ov_united_hydrogens("HSD", "ND1", 0), 1);
    assert_int_equal(ov_united_hydrogens("HSE", "ND1", 0), 0);
    assert_int_equal(ov_united_hydrogens("TIP3", "O", 0), 2);
    assert_int_equal(ov_united_hydrogens("ALA", "CG", 0), -1);
    assert_int_equal(ov_united_hydrogens("ALA", "", 0), -1);
    assert_int_equal(ov_united_hydrogens("ALA", "=amino", 0), -1);
    assert_int_equal(ov_united_hydrogens("ALA", "CA1234567890", 0), -1);
    assert_int_equal(ov_united_hydrogens("=amino", "CA", 0), -1);
    assert_int_equal(ov_united_hydrogens("", "CA", 0), -1);
    assert_int_equal(ov_united_hydrogens("CRO", "CA1", 0), -1);
    assert_int_equal(ov_united_hydrogens("ABCDEFGHIJKL", "CA", 0), -1);
}

/* bsearch() finds rows of a sorted table alone. */
static void test_tables_are_sorted(void **state) {
    (void)state;
    for (size_t i = 1; i < ov_united_residues_count; i++)
        assert_true(strcmp(ov_united_residues[i - 1].name, ov_united_residues[i].name) < 0);
    for (size_t i = 1; i < ov_united_atoms_count; i++) {
        const ov_united_atom *a = &ov_united_atoms[i - 1], *b = &ov_united_atoms[i];
        int order = strcmp(a->residue, b->residue);
        assert_true(order < 0 || (order == 0 && strcmp(a->atom, b->atom) < 0));
    }
}

/* ---- unknown residues --------------------------------------------------------------------- */

/* The hydrogens of an atom at the origin with bonds of these lengths in a plane, the second at an
 * angle (degrees) from the first and the third half-way around on the other side. */
static int shaped(const char *element, size_t bonds, double first, double second, double angle) {
    const double degree = acos(-1) / 180, at[3] = {7, -8, 9};
    double half = (angle + (360 - angle) / 2) * degree;
    double others[3][3] = {
        {at[0] + first, at[1], at[2]},
        {at[0] + second * cos(angle * degree), at[1] + second * sin(angle * degree), at[2]},
        {at[0] + first * cos(half), at[1] + first * sin(half), at[2]}};
    return ov_united_hydrogens_of_shape(element, at, bonds, (const double(*)[3])others);
}

static void test_shapes(void **state) {
    (void)state;
    assert_int_equal(shaped("C", 0, 0, 0, 0), 4);           /* methane */
    assert_int_equal(shaped("C", 1, 1.52, 0, 0), 3);        /* methyl */
    assert_int_equal(shaped("C", 1, 1.33, 0, 0), 2);        /* =CH2 */
    assert_int_equal(shaped("C", 1, 1.20, 0, 0), 1);        /* alkyne */
    assert_int_equal(shaped("c", 2, 1.53, 1.52, 112), 2);   /* chain */
    assert_int_equal(shaped("C", 2, 1.43, 1.51, 111), 2);   /* C5' of a sugar */
    assert_int_equal(shaped("C", 2, 1.39, 1.39, 120), 1);   /* benzene */
    assert_int_equal(shaped("C", 2, 1.32, 1.34, 109), 1);   /* CE1 of histidine */
    assert_int_equal(shaped("C", 2, 1.20, 1.46, 180), 0);   /* inside an alkyne */
    assert_int_equal(shaped("C", 3, 1.39, 1.39, 120), 0);   /* substituted benzene */
    assert_int_equal(shaped("N", 1, 1.49, 0, 0), 3);        /* ammonium */
    assert_int_equal(shaped("N", 1, 1.33, 0, 0), 2);        /* amide */
    assert_int_equal(shaped("N", 1, 1.15, 0, 0), 0);        /* nitrile */
    assert_int_equal(shaped("N", 2, 1.33, 1.46, 122), 1);   /* peptide */
    assert_int_equal(shaped("N", 2, 1.34, 1.34, 117), 0);   /* pyridine */
    assert_int_equal(shaped("N", 2, 1.38, 1.32, 105), 0);   /* ND1 of histidine */
    assert_int_equal(shaped("N", 2, 1.37, 1.35, 108.5), 1); /* NE2 of histidine */
    assert_int_equal(shaped("N", 2, 1.49, 1.49, 112), 2);   /* piperidinium */
    assert_int_equal(shaped("N", 3, 1.37, 1.46, 125), 0);   /* N9 of a purine */
    assert_int_equal(shaped("O", 0, 0, 0, 0), 2);           /* water */
    assert_int_equal(shaped("O", 1, 1.42, 0, 0), 1);        /* alcohol */
    assert_int_equal(shaped("O", 1, 1.24, 0, 0), 0);        /* carbonyl */
    assert_int_equal(shaped("O", 1, 1.49, 0, 0), 0);        /* phosphate */
    assert_int_equal(shaped("O", 2, 1.43, 1.43, 112), 0);   /* ether */
    assert_int_equal(shaped("S", 1, 1.81, 0, 0), 1);        /* thiol */
    assert_int_equal(shaped("S", 1, 2.05, 0, 0), 0);        /* end of a disulfide */
    assert_int_equal(shaped("S", 2, 1.81, 1.79, 101), 0);   /* thioether */
    assert_int_equal(shaped("P", 1, 1.6, 0, 0), 0);
    assert_int_equal(shaped("CL", 1, 1.74, 0, 0), -1);
}

static void test_tetrahedral_shapes(void **state) {
    (void)state;
    const double at[3] = {0}, s = 1.53 / sqrt(3);
    const double corners[4][3] = {{s, s, s}, {s, -s, -s}, {-s, s, -s}, {-s, -s, s}};
    assert_int_equal(ov_united_hydrogens_of_shape("C", at, 3, corners), 1);
    assert_int_equal(ov_united_hydrogens_of_shape("N", at, 3, corners), 1);
    assert_int_equal(ov_united_hydrogens_of_shape("C", at, 4, corners), 0);
    assert_int_equal(ov_united_hydrogens_of_shape("N", at, 4, corners), 0);
    /* Coincident atoms have no angles: some answer, no trap. */
    const double same[3][3] = {{0}};
    for (size_t bonds = 1; bonds <= 3; bonds++)
        assert_in_range(ov_united_hydrogens_of_shape("C", at, bonds, same), 0, 4);
}

/* ---- radii -------------------------------------------------------------------------------- */

static double radius_of(const char *residue, const char *atom, const char *element, int hydrogens,
                        ov_united_source expected) {
    double radius = -1;
    assert_int_equal(ov_united_radius(residue, atom, element, hydrogens, &radius), expected);
    return radius;
}

static void test_sources(void **state) {
    (void)state;
    double methyl = radius_of("ALA", "CB", "C", -1, OV_UNITED_ATOM);
    assert_true(methyl == radius_of("XYZ", "Q", "c", 3, OV_UNITED_ATOM));
    assert_true(methyl == radius_of("GLY", "CA", "C", 3, OV_UNITED_ATOM)); /* overrides */
    assert_true(radius_of("XYZ", "Q", "C", -1, OV_UNITED_ELEMENT) ==
                radius_of("XYZ", "Q", "C", 1, OV_UNITED_ATOM));
    assert_true(radius_of("XYZ", "Q", "O", 7, OV_UNITED_ATOM) ==
                radius_of("HOH", "O", "O", -1, OV_UNITED_ATOM));
    assert_true(radius_of("MSE", "SE", "Se", -1, OV_UNITED_ATOM) > 1.8);
    assert_true(radius_of("CA", "CA", "CA", -1, OV_UNITED_NONE) == -1);
    assert_true(radius_of("ALA", "HA", "H", -1, OV_UNITED_NONE) == -1);
    assert_true(radius_of("ALA", "CA", "", 1, OV_UNITED_NONE) == -1);
}

/* No radius is smaller than the bare atom's (Bondi), none larger than that of a whole methane. */
static void test_radii_are_plausible(void **state) {
    (void)state;
    const struct {
        const char *element;
        int most;
        double bare;
    } known[] = {{"C", 4, 1.7}, {"N", 4, 1.55}, {"O", 2, 1.52},
                 {"P", 0, 1.8}, {"S", 2, 1.8},  {"SE", 1, 1.9}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        for (int h = 0; h <= known[i].most; h++) {
            double radius = radius_of("", "", known[i].element, h, OV_UNITED_ATOM);
            assert_true(radius >= known[i].bare && radius < 2.6);
            if (h > 0)
                assert_true(radius >= radius_of("", "", known[i].element, 0, OV_UNITED_ATOM));
        }
    for (size_t i = 0; i < ov_united_elements_count; i++)
        assert_in_range(ov_united_elements[i].usual, 0, ov_united_elements[i].count - 1);
}

/* ---- a protein ---------------------------------------------------------------------------- */

#define FAS2 "/usr/share/apbs/examples/misc/fas2.pqr"
#define DNA "/usr/share/apbs/examples/bem-binding-energy/test_proteins/1d30.pqr"
enum { ATOMS_MOST = 1000, BONDS_MOST = 8 };

typedef struct atom {
    char name[8], residue[8], element[2];
    double place[3];
    int hydrogens; /* bonded */
} atom;

static double between(const atom *a, const atom *b) {
    return sqrt(pow(a->place[0] - b->place[0], 2) + pow(a->place[1] - b->place[1], 2) +
                pow(a->place[2] - b->place[2], 2));
}

/* Atoms of the file, each with how many hydrogens are bonded to it. */
static size_t read_atoms(const char *path, atom *atoms) {
    FILE *file = fopen(path, "r");
    if (!file)
        skip();
    char line[256];
    size_t count = 0;
    while (fgets(line, sizeof line, file) && count < ATOMS_MOST) {
        atom *a = &atoms[count];
        *a = (atom){.hydrogens = 0};
        if (sscanf(line, "ATOM %*d %7s %7s %*d %lf %lf %lf", a->name, a->residue, &a->place[0],
                   &a->place[1], &a->place[2]) == 5) {
            a->element[0] = a->name[0];
            count++;
        }
    }
    fclose(file);
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < count; k++)
            atoms[i].hydrogens += atoms[k].element[0] == 'H' && between(&atoms[i], &atoms[k]) < 1.4;
    return count;
}

static int by_shape(const atom *atoms, size_t count, size_t i) {
    double others[BONDS_MOST][3];
    size_t bonds = 0;
    for (size_t k = 0; k < count && bonds < BONDS_MOST; k++) {
        bool wide = atoms[i].element[0] == 'S' || atoms[k].element[0] == 'S';
        if (k == i || atoms[k].element[0] == 'H' ||
            between(&atoms[i], &atoms[k]) > (wide ? OV_UNITED_BOND_LONG : OV_UNITED_BOND))
            continue;
        memcpy(others[bonds++], atoms[k].place, sizeof others[0]);
    }
    return ov_united_hydrogens_of_shape(atoms[i].element, atoms[i].place, bonds,
                                        (const double(*)[3])others);
}

/* How many heavy atoms there are, for how many the table or their shape tell how many hydrogens
 * they have, and for how many that is true. */
typedef struct tally {
    size_t heavy, known, same, alike;
} tally;

static tally tally_of(const char *path) {
    static atom atoms[ATOMS_MOST];
    size_t count = read_atoms(path, atoms);
    tally t = {0};
    for (size_t i = 0; i < count; i++) {
        if (atoms[i].element[0] == 'H')
            continue;
        int table = ov_united_hydrogens(atoms[i].residue, atoms[i].name, 0);
        t.heavy++;
        t.known += table >= 0;
        t.same += table == atoms[i].hydrogens;
        t.alike += by_shape(atoms, count, i) == atoms[i].hydrogens;
    }
    print_message("%zu heavy atoms: %zu in the table, %zu of them right; %zu right by shape\n",
                  t.heavy, t.known, t.same, t.alike);
    return t;
}

/* The file's geometry is strained: some of its hydroxyls' bonds are as long as those of ethers. */
static void test_hydrogens_of_a_protein(void **state) {
    (void)state;
    tally t = tally_of(FAS2);
    assert_int_equal(t.heavy, 464);
    assert_int_equal(t.known, 460); /* two odd residues are the ends of the chain */
    assert_int_equal(t.same, t.known);
    assert_true(t.alike >= 450);
}

/* A dodecamer with a drug, which the table does not know. */
static void test_hydrogens_of_dna(void **state) {
    (void)state;
    tally t = tally_of(DNA);
    assert_int_equal(t.heavy, 507);
    assert_true(t.known >= 400);
    assert_int_equal(t.same, t.known);
    assert_true(t.alike >= 500);
}

static void measure_fas2(ovoid_context *context, const double *xyzr, size_t heavy,
                         const ovoid_ellipsoid *all, size_t count, ovoid_measures *measures) {
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_measure_options options;
    ovoid_measure_options_init(&options, sizeof options);
    options.distances = false;
    test_check(context, ovoid_molecule_create(context, xyzr, heavy, &molecule));
    test_check(context, ovoid_model_create(context, all, count, 0.5, 1.0, &model));
    test_check(context, once_measure(context, molecule, model, &options, measures));
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
}

/* Heavy atoms with united radii have the area and the volume of all atoms with Bondi radii. The
 * hydrogens of this file stand further out than those the radii were calibrated with. */
static void test_surface_of_a_protein(void **state) {
    ovoid_context *context = *state;
    static atom atoms[ATOMS_MOST];
    static double united[4 * ATOMS_MOST];
    static ovoid_ellipsoid all[ATOMS_MOST];
    size_t count = read_atoms(FAS2, atoms), heavy = 0;
    for (size_t i = 0; i < count; i++) {
        const atom *a = &atoms[i];
        char e = a->element[0];
        double bondi = e == 'H' ? 1.2 : e == 'C' ? 1.7 : e == 'N' ? 1.55 : e == 'O' ? 1.52 : 1.8;
        const double *x = a->place;
        all[i] = (ovoid_ellipsoid){
            exp(0.5 * bondi * bondi), {0.5, 0.5, 0.5}, {x[0], x[1], x[2]}, {0, 0, 0}};
        if (e == 'H')
            continue;
        memcpy(united + 4 * heavy, x, sizeof a->place);
        int hydrogens = ov_united_hydrogens(a->residue, a->name, 0);
        if (hydrogens < 0)
            hydrogens = by_shape(atoms, count, i);
        assert_int_equal(ov_united_radius("", "", a->element, hydrogens, united + 4 * heavy++ + 3),
                         OV_UNITED_ATOM);
    }
    ovoid_measures got;
    ovoid_measures_init(&got, sizeof got);
    measure_fas2(context, united, heavy, all, count, &got);
    print_message("area %.1f of %.1f, volume %.1f of %.1f\n", got.area.original, got.area.sparse,
                  got.volume.original, got.volume.sparse);
    assert_true(fabs(got.area.original / got.area.sparse - 1) < 0.01);
    assert_true(fabs(got.volume.original / got.volume.sparse - 1) < 0.012);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_residues_have_their_formula),
                                       cmocka_unit_test(test_ends_add_hydrogens),
                                       cmocka_unit_test(test_spellings),
                                       cmocka_unit_test(test_tables_are_sorted),
                                       cmocka_unit_test(test_shapes),
                                       cmocka_unit_test(test_tetrahedral_shapes),
                                       cmocka_unit_test(test_sources),
                                       cmocka_unit_test(test_radii_are_plausible),
                                       cmocka_unit_test(test_hydrogens_of_a_protein),
                                       cmocka_unit_test(test_hydrogens_of_dna),
                                       cmocka_unit_test(test_surface_of_a_protein)};
    return cmocka_run_group_tests_name("united", tests, test_open, test_close);
}
