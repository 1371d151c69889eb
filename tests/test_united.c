/*
 * Radii that stand for missing hydrogens: the facts against chemistry written down independently,
 * the guesses by shape on ideal geometry, and the order of the radii.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "molecule/united.h"
#include "molecule/united_table.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

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
    assert_int_equal(shaped("P", 1, 1.6, 0, 0), -1);
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

/* More hydrogens take more room; nothing is smaller than an atom or larger than a molecule. */
static void test_radii_grow_with_hydrogens(void **state) {
    (void)state;
    for (size_t i = 0; i < ov_united_elements_count; i++) {
        const ov_united_element *row = &ov_united_elements[i];
        assert_in_range(row->count, 1, OV_UNITED_MOST);
        assert_in_range(row->usual, 0, row->count - 1);
        assert_true(row->radii[0] > 1.3 && row->radii[row->count - 1] < 2.6);
        for (int h = 1; h < row->count; h++)
            assert_true(row->radii[h] > row->radii[h - 1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_residues_have_their_formula),
                                       cmocka_unit_test(test_ends_add_hydrogens),
                                       cmocka_unit_test(test_spellings),
                                       cmocka_unit_test(test_tables_are_sorted),
                                       cmocka_unit_test(test_shapes),
                                       cmocka_unit_test(test_tetrahedral_shapes),
                                       cmocka_unit_test(test_sources),
                                       cmocka_unit_test(test_radii_grow_with_hydrogens)};
    return cmocka_run_group_tests_name("united", tests, NULL, NULL);
}
