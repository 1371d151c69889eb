/*
 * Structures: PDB and mmCIF files, models, waters, alternate locations, selections, who the atoms
 * are, their radii, assemblies, and files that are damaged or mean harm.
 */
#include "molecule/structure.h"
#include "reading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
#include <zlib.h>

static char path[128];

static void write_file(const char *name, const char *text, size_t length) {
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
}

static ovoid_status read_text(const char *name, const char *text, const ovoid_read_options *options,
                              ovoid_molecule **molecule) {
    write_file(name, text, strlen(text));
    warnings[0] = '\0';
    const ovoid_status status = ovoid_molecule_read_with(context, path, options, molecule);
    unlink(path);
    return status;
}

static ovoid_read_options defaults(void) {
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    return options;
}

static ovoid_molecule *expect(const char *name, const char *text, const ovoid_read_options *options,
                              size_t atoms) {
    ovoid_molecule *molecule = NULL;
    if (read_text(name, text, options, &molecule) != OVOID_OK)
        fail_msg("%s", ovoid_context_error(context));
    assert_int_equal(ovoid_molecule_atoms(molecule), atoms);
    return molecule;
}

static void expect_failure(const char *name, const char *text, const ovoid_read_options *options,
                           ovoid_status status, const char *says) {
    ovoid_molecule *molecule = NULL;
    const ovoid_status got = read_text(name, text, options, &molecule);
    if (got != status || !strstr(ovoid_context_error(context), says))
        fail_msg("%s: '%s', where %s and '%s' are expected", ovoid_status_name(got),
                 ovoid_context_error(context), ovoid_status_name(status), says);
    assert_null(molecule);
}

/* The names of all atoms, one after another with blanks between. */
static const char *names_of(const ovoid_molecule *molecule) {
    static char text[512];
    const ovoid_atom *atoms = ovoid_molecule_identity(molecule);
    size_t used = 0;
    text[0] = '\0';
    for (size_t i = 0; i < ovoid_molecule_unit_atoms(molecule); i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%s%.1s", i ? " " : "",
                                 atoms[i].name, atoms[i].altloc ? &atoms[i].altloc : "");
    return text;
}

static double radius_of(const ovoid_molecule *molecule, size_t i) {
    return ovoid_molecule_unit_xyzr(molecule)[4 * i + 3];
}

/* ---- PDB ----------------------------------------------------------------------------------- */

static const char pdb[] =
    "HEADER    TEST\n"
    "MODEL        3\n"
    "ATOM      1  N   ALA A   5      11.104   6.134  -6.504  1.00 20.00           N\n"
    "ATOM      2  CA AALA A   5      11.639   6.071  -5.147  0.40 20.00           C\n"
    "ATOM      3  CA BALA A   5      11.700   6.500  -5.000  0.60 20.00           C\n"
    "ATOM      4  CB AALA A   5      12.639   6.071  -5.147  0.40 20.00           C\n"
    "ATOM      5  CB BALA A   5      12.700   6.500  -5.000  0.60 20.00           C\n"
    "ATOM      6  C   ALA A   5A     13.559   7.231  -4.900  0.00 20.00           C\n"
    "TER\n"
    "HETATM    7 CA    CA B 101      20.000   0.000   0.000  1.00 30.00          CA\n"
    "HETATM    8  O   HOH B 201      30.000   0.000   0.000  1.00 30.00           O\n"
    "HETATM    9  D1  DOD B 202      31.000   0.000   0.000  1.00 30.00           D\n"
    "ENDMDL\n"
    "MODEL        4\n"
    "ATOM      1  N   ALA A   5       1.000   2.000   3.000  1.00 20.00           N\n"
    "ENDMDL\n"
    "END\n";

static void pdb_files_are_read(void **state) {
    (void)state;
    ovoid_molecule *molecule = expect("a.pdb", pdb, NULL, 5);
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(molecule);
    const ovoid_atom *atoms = ovoid_molecule_identity(molecule);
    size_t count;
    const ovoid_residue *residues = ovoid_molecule_residues(molecule, &count);
    assert_string_equal(names_of(molecule), "N CAB CBB C CA");
    assert_int_equal(ovoid_molecule_read_format(molecule), OVOID_MOLECULE_PDB);
    assert_int_equal(ovoid_molecule_model(molecule), 3);
    assert_int_equal(c.models, 2);
    assert_int_equal(c.skipped, 5);
    assert_int_equal(c.skipped_models, 1);
    assert_int_equal(c.skipped_waters, 2);
    assert_int_equal(c.skipped_altlocs, 2);
    assert_int_equal(c.zero_occupancy, 1);
    assert_int_equal(count, 3);
    assert_string_equal(residues[1].name, "ALA");
    assert_string_equal(residues[1].chain, "A");
    assert_int_equal(residues[1].number, 5);
    assert_int_equal(residues[1].insertion, 'A');
    assert_int_equal(residues[1].first, 3);
    assert_int_equal(residues[0].insertion, 0);
    assert_string_equal(atoms[4].element, "Ca");
    assert_string_equal(atoms[1].element, "C");
    assert_int_equal(atoms[4].serial, 7);
    assert_int_equal(atoms[4].flags, OVOID_ATOM_HETERO);
    assert_int_equal(atoms[3].flags, OVOID_ATOM_ZERO_OCCUPANCY);
    assert_true(ovoid_molecule_xyzr(molecule)[4] == 11.7);
    ovoid_molecule_destroy(&molecule);
}

static void expect_models(const char *name, const char *text, const int32_t *numbers,
                          size_t count) {
    ovoid_molecule *molecule = NULL;
    size_t found;
    assert_int_equal(read_text(name, text, NULL, &molecule), OVOID_OK);
    const int32_t *models = ovoid_molecule_models(molecule, &found);
    assert_int_equal(found, count);
    assert_memory_equal(models, numbers, count * sizeof *numbers);
    ovoid_molecule_destroy(&molecule);
}

/* Ascending and each once, wherever their atoms are. */
static void models_are_numbered(void **state) {
    (void)state;
    static const int32_t three_four[] = {3, 4}, one[] = {1}, mixed[] = {2, 7, 9};
    char cif[8192];
    size_t used = (size_t)snprintf(cif, sizeof cif,
                                   "data_\nloop_\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n"
                                   "_atom_site.Cartn_z\n_atom_site.pdbx_PDB_model_num\n");
    for (int i = 0; i < 120; i++)
        used += (size_t)snprintf(cif + used, sizeof cif - used, "%d 0 0 %d\n", 2 * i,
                                 mixed[(i + 1) % 3]);
    expect_models("m.cif", cif, mixed, 3);
    expect_models("m.pdb", pdb, three_four, 2);
    expect_models("m.xyzr", "0 0 0 1\n", one, 1);
    expect_models("m.pdb",
                  "MODEL 9\nATOM      1  N   ALA A   5      11.104   6.134  -6.504\nENDMDL\n"
                  "MODEL 2\nATOM      1  N   ALA A   5      11.104   6.134  -6.504\nENDMDL\n"
                  "MODEL 7\nATOM      1  N   ALA A   5      11.104   6.134  -6.504\nENDMDL\n"
                  "MODEL 2\nATOM      1  N   ALA A   5      11.104   6.134  -6.504\nENDMDL\n",
                  mixed, 3);
}

static void choices_are_followed(void **state) {
    (void)state;
    ovoid_read_options o = defaults();
    o.waters = true;
    ovoid_molecule *molecule = expect("a.pdb", pdb, &o, 7);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->hydrogens, 1); /* deuterium */
    assert_int_equal(ovoid_molecule_radii(molecule), OVOID_RADII_BONDI);
    ovoid_molecule_destroy(&molecule);
    o.no_hydrogens = true;
    molecule = expect("a.ent", pdb, &o, 6);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->skipped_hydrogens, 1);
    assert_int_equal(ovoid_molecule_radii(molecule), OVOID_RADII_UNITED);
    ovoid_molecule_destroy(&molecule);

    o = defaults();
    o.model = 4;
    molecule = expect("a.pdb", pdb, &o, 1);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->skipped_models, 9);
    ovoid_molecule_destroy(&molecule);
    o.model = 5;
    expect_failure("a.pdb", pdb, &o, OVOID_ERROR_EMPTY, "no model 5: the file has 2, numbers 3 to");

    o = defaults();
    o.select = "//A//:A,"; /* the lower conformer, and what has none */
    molecule = expect("a.pdb", pdb, &o, 4);
    assert_string_equal(names_of(molecule), "N CAA CBA C");
    assert_int_equal(ovoid_molecule_read_counts(molecule)->skipped_selection, 3);
    ovoid_molecule_destroy(&molecule);
    o.select = ";polymer";
    molecule = expect("a.pdb", pdb, &o, 4);
    ovoid_molecule_destroy(&molecule);
    /* What stands in front of TER is of the polymer, whatever its record and name. */
    molecule = expect("b.pdb",
                      "HETATM    1  C1  XYZ A   1       1.000   2.000   3.000\n"
                      "TER\n"
                      "HETATM    2  C1  XYZ A   2       5.000   2.000   3.000\n",
                      &o, 1);
    ovoid_molecule_destroy(&molecule);
    o.select = "(HOH)";
    expect_failure("a.pdb", pdb, &o, OVOID_ERROR_EMPTY, "2 of waters");
    o.select = "[[[";
    expect_failure("a.pdb", pdb, &o, OVOID_ERROR_ARGUMENT, "selection: ");
    o.select = "//A//:(";
    expect_failure("a.pdb", pdb, &o, OVOID_ERROR_ARGUMENT, "selection: ");
    o = (ovoid_read_options){0};
    expect_failure("a.pdb", pdb, &o, OVOID_ERROR_ARGUMENT, "size 0");
}

static void pdb_errors_say_where(void **state) {
    (void)state;
    expect_failure("a.pdb", "ATOM      1  N   ALA A   5      11.104   6.1x4  -6.504\n", NULL,
                   OVOID_ERROR_FORMAT, ":1:42: y (columns 39 to 46) is no number: '6.1x4'");
    expect_failure("a.pdb", "REMARK\nATOM      1  N   ALA A   5      11.104   6.134\n", NULL,
                   OVOID_ERROR_FORMAT, ":2:47: an atom without z");
    expect_failure("a.pdb", "ATOM      1  N   ALA A   5      11.104   6.134     nan\n", NULL,
                   OVOID_ERROR_FORMAT, ":1:52: z");
    expect_failure("a.pdb", "ATOM      1  N   ALA A   5    99999999   6.134   1.000\n", NULL,
                   OVOID_ERROR_FORMAT, "beyond 1e6");
    expect_failure("a.pdb", "HEADER    TEST\nEND\n", NULL, OVOID_ERROR_EMPTY,
                   "none of its 2 lines holds an ATOM or HETATM record");
}

/* Numbers in hybrid-36, chains of two characters, long residues, elements from names. */
static void wide_columns_are_read(void **state) {
    (void)state;
    ovoid_molecule *molecule = expect("a.pdb",
                                      "ATOM  A0000  CA  ALAAAA000      11.104   6.134  -6.504\n"
                                      "ATOM  a0000 HG11 VAL A9999      12.104   6.134  -6.504\n"
                                      "HETATM*****  C1  TIPX****       13.104   6.134  -6.504\n"
                                      "ATOM    100  N   NALAA   7      14.104   6.134  -6.504\n"
                                      "HETATM  101 ZN    ZN A   8      15.104   6.134  -6.504\n",
                                      NULL, 5);
    const ovoid_atom *atoms = ovoid_molecule_identity(molecule);
    const ovoid_residue *residues = ovoid_molecule_residues(molecule, NULL);
    assert_int_equal(atoms[0].serial, 100000);
    assert_int_equal(atoms[1].serial, 100000 + 26 * 36 * 36 * 36 * 36);
    assert_int_equal(atoms[2].serial, 0);
    assert_string_equal(residues[0].chain, "AA");
    assert_int_equal(residues[0].number, 10000);
    assert_int_equal(residues[2].number, OVOID_NO_NUMBER);
    assert_string_equal(residues[3].name, "NALA");
    assert_string_equal(residues[3].chain, "A");
    assert_string_equal(atoms[0].element, "C");
    assert_string_equal(atoms[1].element, "H");
    assert_string_equal(atoms[4].element, "Zn");
    ovoid_molecule_destroy(&molecule);
}

/* ---- mmCIF ---------------------------------------------------------------------------------- */

#define COLUMNS                                                                                    \
    "loop_\n_atom_site.group_PDB\n_atom_site.id\n_atom_site.type_symbol\n"                         \
    "_atom_site.label_atom_id\n_atom_site.label_alt_id\n_atom_site.label_comp_id\n"                \
    "_atom_site.label_asym_id\n_atom_site.auth_asym_id\n_atom_site.auth_seq_id\n"                  \
    "_atom_site.pdbx_PDB_ins_code\n_atom_site.Cartn_x\n_ATOM_SITE.Cartn_Y\n_atom_site.cartn_z\n"   \
    "_atom_site.occupancy\n_atom_site.pdbx_PDB_model_num\n"

static void mmcif_files_are_read(void **state) {
    (void)state;
    static const char cif[] =
        "# a comment\ndata_X\n_struct.title 'it''s a title'\n_entry.id\n;X\ntwo lines\n;\n" COLUMNS
        "ATOM 1 C \"C1'\" . U AA Ax 5 ? 1.0 2.0 3.0 1.0 1\n"
        "ATOM 2 O 'O\"' . U AA Ax 5 B 4.0(12) 5.0 -6e0 0 1 # behind\n"
        "HETATM 3 ?\n;P;A\n; . \"LIG 1\" C C . ? 7 8 9\n? 1\n"
        "HETATM 4 O O . HOH D D 9 ? 7 8 9 1 1\n"
        "ATOM 1 C C1 . U AA Ax 5 ? 1.0 2.0 3.0 1.0 2\n#\n"
        "loop_ _other.a _other.b 1 2 3 4\ndata_Y\n" COLUMNS
        "ATOM 1 C C1 . U AA Ax 5 ? 1.0 2.0 3.0 1.0 2\n";
    ovoid_molecule *molecule = expect("a.cif", cif, NULL, 3);
    const ovoid_atom *atoms = ovoid_molecule_identity(molecule);
    const ovoid_residue *residues = ovoid_molecule_residues(molecule, NULL);
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(molecule);
    assert_string_equal(names_of(molecule), "C1' O\" P;A");
    assert_string_equal(residues[0].chain, "Ax");
    assert_int_equal(residues[1].insertion, 'B');
    assert_string_equal(residues[2].name, "LIG 1");
    assert_int_equal(residues[2].number, OVOID_NO_NUMBER);
    assert_string_equal(atoms[2].element, "P");
    assert_int_equal(atoms[2].flags & OVOID_ATOM_HETERO, OVOID_ATOM_HETERO);
    assert_true(ovoid_molecule_xyzr(molecule)[4] == 4.0 &&
                ovoid_molecule_xyzr(molecule)[6] == -6.0);
    assert_int_equal(c.skipped_waters, 1);
    assert_int_equal(c.skipped_models, 1);
    assert_int_equal(c.zero_occupancy, 1);
    assert_non_null(strstr(warnings, "only the first block with atoms is read"));
    ovoid_molecule_destroy(&molecule);

    /* By contents, and a single atom without a loop. */
    molecule = expect("a.txt",
                      "data_\n_atom_site.type_symbol C\n_atom_site.Cartn_x 1\n"
                      "_atom_site.Cartn_y 2\n_atom_site.Cartn_z 3\n",
                      NULL, 1);
    assert_int_equal(ovoid_molecule_read_format(molecule), OVOID_MOLECULE_MMCIF);
    ovoid_molecule_destroy(&molecule);
}

static void damaged_mmcif_is_an_error(void **state) {
    (void)state;
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? 1.0 2.0", "ends within a row: 12 of 15"},
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? 1.0 2.0\nloop_\n",
         ":19:1: the loop that begin"},
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? 1.0 ? 3.0 1 1\n",
         ":18:29: an atom without a value of _atom_site.Cartn_y"},
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? 1.0 2.x 3.0 1 1\n",
         ":18:29: Cartn_y is no num"},
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? nan 2.0 3.0 1 1\n", "Cartn_x is no number"},
        {"data_X\n" COLUMNS "ATOM 1 C C1 . U A A 5 ? 1e9 2.0 3.0 1 1\n",
         ":18:25: x is '1e9': beyond"},
        {"data_X\n" COLUMNS "ATOM 1 C 'C1 . U A A 5 ? 1 2.0 3.0 1 1\n",
         ":18:10: a quote that is not"},
        {"data_X\n" COLUMNS ";ATOM 1 C C1\n", ":18:1: the text that begins here"},
        {"data_X\nloop_\n_atom_site.id\n_atom_site.Cartn_x\n1 2\n", ":2:1: the loop of atoms that"},
        {"data_X\n_atom_site.id\n_atom_site.Cartn_x 2\n", ":2:1: a name without a value"},
        {"data_X\n7\n", ":2:1: a value without a name: '7'"},
        {"data_X\nloop_\n7\n", ":3:1: a value without a name: '7'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        expect_failure("a.cif", cases[i].text, NULL, OVOID_ERROR_FORMAT, cases[i].says);
    expect_failure("a.cif", "data_X\n_entry.id 1\n", NULL, OVOID_ERROR_EMPTY,
                   "holds an atom of the loop _atom_site");
    expect_failure("a.cif", "data_X\n" COLUMNS, NULL, OVOID_ERROR_EMPTY, "no atoms");
}

/* ---- alternate locations ----------------------------------------------------------------------
 */

static void expect_conformers(const char *atoms, const char *names) {
    char text[2048];
    snprintf(text, sizeof text, "data_X\n" COLUMNS "%s", atoms);
    ovoid_molecule *molecule = NULL;
    assert_int_equal(read_text("a.cif", text, NULL, &molecule), OVOID_OK);
    assert_string_equal(names_of(molecule), names);
    ovoid_molecule_destroy(&molecule);
}

static void one_conformer_of_a_residue_stays(void **state) {
    (void)state;
    /* Equal occupancies: the first; B's CG does not come along. */
    expect_conformers(
        "ATOM 1 C CA . ALA A A 1 ? 0 0 0 1 1\nATOM 2 C CB A ALA A A 1 ? 1 0 0 .5 1\n"
        "ATOM 3 C CB B ALA A A 1 ? 2 0 0 .5 1\nATOM 4 C CG B ALA A A 1 ? 3 0 0 .5 1\n",
        "CA CBA");
    /* The mean decides, not the number of atoms; the file's order stays. */
    expect_conformers("ATOM 1 C CB A ALA A A 1 ? 1 0 0 .4 1\nATOM 2 C CG A ALA A A 1 ? 3 0 0 .4 1\n"
                      "ATOM 3 C CB B ALA A A 1 ? 2 0 0 .6 1\n",
                      "CBB");
    /* Two independent pairs become one of each. */
    expect_conformers(
        "ATOM 1 C CB A LYS A A 1 ? 1 0 0 .6 1\nATOM 2 C CB B LYS A A 1 ? 2 0 0 .4 1\n"
        "ATOM 3 N NZ C LYS A A 1 ? 5 0 0 .3 1\nATOM 4 N NZ D LYS A A 1 ? 6 0 0 .7 1\n",
        "CBA NZD");
    /* Different residues in one place, and deuterium in the place of hydrogen. */
    expect_conformers(
        "ATOM 1 O OG A SER A A 1 ? 1 0 0 .4 1\nATOM 2 C CB B ALA A A 1 ? 5 0 0 .6 1\n", "CBB");
    expect_conformers("ATOM 1 H H A ALA A A 1 ? 1 0 0 .3 1\nATOM 2 D D B ALA A A 1 ? 1 0 0 .7 1\n",
                      "DB");
    /* Each residue by itself. */
    expect_conformers(
        "ATOM 1 C CB A ALA A A 1 ? 1 0 0 .4 1\nATOM 2 C CB B ALA A A 1 ? 2 0 0 .6 1\n"
        "ATOM 3 C CB A ALA A A 2 ? 1 9 0 .6 1\nATOM 4 C CB B ALA A A 2 ? 2 9 0 .4 1\n",
        "CBB CBA");
}

/* ---- radii ------------------------------------------------------------------------------------
 */

static const char few[] =
    "ATOM      1  CA  ALA A   5      11.104   6.134  -6.504  1.00 20.00           C\n"
    "ATOM      2  O   ALA A   5      14.104   6.134  -6.504  1.00 20.00           O\n"
    "ATOM      3  P     A A   6      20.104   6.134  -6.504  1.00 20.00           P\n"
    "HETATM    4  H1  LIG A   7      30.104   6.134  -6.504  1.00 20.00           H\n"
    "HETATM    5 FE   LIG A   7      40.104   6.134  -6.504  1.00 20.00          FE\n"
    "HETATM    6  X1  UNX A   8      50.104   6.134  -6.504  1.00 20.00           X\n";

static void expect_radii(const ovoid_read_options *o, const double expected[6], size_t guessed) {
    ovoid_molecule *molecule = expect("a.pdb", few, o, 6);
    for (size_t i = 0; i < 6; i++)
        if (fabs(radius_of(molecule, i) - expected[i]) > 1e-12)
            fail_msg("atom %zu: %g, not %g", i, radius_of(molecule, i), expected[i]);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->guessed_radii, guessed);
    ovoid_molecule_destroy(&molecule);
}

static void radii_go_by_element(void **state) {
    (void)state;
    ovoid_read_options o = defaults(); /* it has a hydrogen */
    expect_radii(&o, (const double[]){1.7, 1.52, 1.8, 1.2, 2.44, 1.7}, 1);
    assert_non_null(strstr(warnings, "radii of 1 atom are guessed: X1 of UNX (1.7 Å)"));
    o.radii = OVOID_RADII_BONDI;
    expect_radii(&o, (const double[]){1.7, 1.52, 1.8, 1.2, 2.44, 1.7}, 1);
    o.radii = OVOID_RADII_PAPER;
    expect_radii(&o, (const double[]){1.7, 1.5, 1.85, 1.2, 2.44, 1.7}, 1);
    o.radii = OVOID_RADII_OWN;
    expect_failure("a.pdb", few, &o, OVOID_ERROR_ARGUMENT, "gives no radii");

    ovoid_molecule *molecule = expect("a.pdb", few, NULL, 6);
    size_t kinds;
    const ovoid_guess *guess = ovoid_molecule_guesses(molecule, &kinds);
    assert_int_equal(kinds, 1);
    assert_string_equal(guess->residue, "UNX");
    assert_int_equal(ovoid_molecule_identity(molecule)[5].flags,
                     OVOID_ATOM_HETERO | OVOID_ATOM_GUESSED_RADIUS);
    ovoid_molecule_destroy(&molecule);
}

/* Heavy atoms that stand for their hydrogens are larger, and less so where some are in the file. */
static void united_radii_stand_for_hydrogens(void **state) {
    (void)state;
    ovoid_read_options o = defaults();
    o.radii = OVOID_RADII_UNITED;
    static const char alone[] =
        "ATOM      1  CB  ALA A   5      11.104   6.134  -6.504  1.00 20.00           C\n"
        "ATOM      2  C   ALA A   5      15.104   6.134  -6.504  1.00 20.00           C\n"
        "HETATM    3 ZN    ZN A   6      19.104   6.134  -6.504  1.00 20.00          ZN\n";
    static const char with[] =
        "ATOM      1  CB  ALA A   5      11.104   6.134  -6.504  1.00 20.00           C\n"
        "ATOM      2  HB1 ALA A   5      12.104   6.134  -6.504  1.00 20.00           H\n"
        "ATOM      3  HB2 ALA A   5      10.104   6.134  -6.504  1.00 20.00           H\n";
    ovoid_molecule *methyl = expect("a.pdb", alone, NULL, 3);
    assert_int_equal(ovoid_molecule_radii(methyl), OVOID_RADII_UNITED);
    ovoid_molecule *partly = expect("a.pdb", with, &o, 3);
    assert_true(radius_of(methyl, 0) > radius_of(methyl, 1) + 0.1);
    assert_true(radius_of(partly, 0) > radius_of(methyl, 1));
    assert_true(radius_of(partly, 0) < radius_of(methyl, 0));
    assert_true(radius_of(methyl, 2) == 2.39 && radius_of(partly, 1) == 1.2);
    ovoid_molecule_destroy(&methyl);
    ovoid_molecule_destroy(&partly);
}

static void radii_come_from_files(void **state) {
    (void)state;
    char file[160];
    static const struct {
        const char *text, *says;
        ovoid_status status;
    } bad[] = {{"ALA CA\n", ":1:5: 'CA' is no radius", OVOID_ERROR_FORMAT},
               {"C 1.7\n\nQq 1.5\n", ":3:1: there is no element 'Qq'", OVOID_ERROR_FORMAT},
               {"C -1\n", ":1:3: the radius '-1' is not within", OVOID_ERROR_FORMAT},
               {"C nan\n", "is no radius", OVOID_ERROR_FORMAT},
               {"C 1.7 1 2\n", "is expected", OVOID_ERROR_FORMAT},
               {"C 1.7\nc 1.8\n", ":2:1: this is already in line 1", OVOID_ERROR_FORMAT},
               {"ALA CA 1\nALA CA 2\n", ":2:1: ALA CA is already in line 1", OVOID_ERROR_FORMAT},
               {"# nothing\n", "no radii", OVOID_ERROR_EMPTY}};
    snprintf(file, sizeof file, "%s/radii.txt", folder);
    ovoid_read_options o = defaults();
    o.radii = OVOID_RADII_FILE;
    o.radii_file = file;
    expect_failure("a.pdb", few, &o, OVOID_ERROR_IO, "radii.txt: cannot open");
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        write_file("radii.txt", bad[i].text, strlen(bad[i].text));
        expect_failure("a.pdb", few, &o, bad[i].status, bad[i].says);
    }
    static const char good[] = "# mine\nALA CA 2.5\nc 1.9 # carbon\nO 1\nX1 X1 1\nFe 0\nH 1\n";
    write_file("radii.txt", good, strlen(good));
    expect_radii(&o, (const double[]){2.5, 1.0, 1.8, 1.0, 0.0, 1.7}, 2); /* P and X1 guessed */
    unlink(file);
    o.radii_file = NULL;
    expect_failure("a.pdb", few, &o, OVOID_ERROR_ARGUMENT, "need radii and radii_file");
}

/* Asked for, they replace a PQR file's; XYZR has no elements to go by. */
static void radii_of_pqr_are_replaced(void **state) {
    (void)state;
    static const char pqr[] = "ATOM 7 CA ALA A 5B 1.0 2.0 3.0 0.1 3.0\n"
                              "ATOM 8 1HB ALA A 5B 2.0 2.0 3.0 0.1 3.0\n"
                              "HETATM 9 CA CA A 6 9.0 2.0 3.0 0.1 3.0\n";
    ovoid_read_options o = defaults();
    ovoid_molecule *molecule = expect("a.pqr", pqr, &o, 3);
    const ovoid_residue *residues = ovoid_molecule_residues(molecule, NULL);
    assert_true(radius_of(molecule, 0) == 3.0);
    assert_string_equal(residues[0].name, "ALA");
    assert_string_equal(residues[0].chain, "A");
    assert_int_equal(residues[0].number, 5);
    assert_int_equal(residues[0].insertion, 'B');
    assert_int_equal(ovoid_molecule_identity(molecule)[0].serial, 7);
    ovoid_molecule_destroy(&molecule);
    o.radii = OVOID_RADII_BONDI;
    molecule = expect("a.pqr", pqr, &o, 3);
    assert_true(radius_of(molecule, 0) == 1.7 && radius_of(molecule, 1) == 1.2 &&
                radius_of(molecule, 2) == 2.31);
    ovoid_molecule_destroy(&molecule);
    expect_failure("a.xyzr", "1 2 3 4\n", &o, OVOID_ERROR_ARGUMENT, "other radii needs more");
}

/* ---- assemblies -------------------------------------------------------------------------------
 */

#define OPERATORS                                                                                  \
    "loop_\n_pdbx_struct_oper_list.id\n_pdbx_struct_oper_list.matrix[1][1]\n"                      \
    "_pdbx_struct_oper_list.matrix[1][2]\n_pdbx_struct_oper_list.matrix[1][3]\n"                   \
    "_pdbx_struct_oper_list.matrix[2][1]\n_pdbx_struct_oper_list.matrix[2][2]\n"                   \
    "_pdbx_struct_oper_list.matrix[2][3]\n_pdbx_struct_oper_list.matrix[3][1]\n"                   \
    "_pdbx_struct_oper_list.matrix[3][2]\n_pdbx_struct_oper_list.matrix[3][3]\n"                   \
    "_pdbx_struct_oper_list.vector[1]\n_pdbx_struct_oper_list.vector[2]\n"                         \
    "_pdbx_struct_oper_list.vector[3]\n"                                                           \
    "1 1 0 0 0 1 0 0 0 1 0 0 0\n2 0 -1 0 1 0 0 0 0 1 10 0 0\n3 -1 0 0 0 1 0 0 0 1 0 0 0\n"         \
    "4 1 0 0 0 1 0 0 0 1 1e7 0 0\n5 ? 0 0 0 1 0 0 0 1 0 0 0\n"

#define ATOMS                                                                                      \
    COLUMNS "ATOM 1 C CA . ALA A A 5 ? 1 2 3 1 1\nATOM 2 C CB . ALA A A 5 ? 4 5 6 1 1\n"           \
            "ATOM 3 C CA . ALA B B 1 ? 7 8 9 1 1\n"

static const char *with_expression(const char *expression, const char *chains) {
    static char text[8192];
    snprintf(text, sizeof text,
             "data_X\n_pdbx_struct_assembly_gen.assembly_id 1\n"
             "_pdbx_struct_assembly_gen.oper_expression '%s'\n"
             "_pdbx_struct_assembly_gen.asym_id_list '%s'\n" OPERATORS ATOMS,
             expression, chains);
    return text;
}

static void assemblies_are_units_and_placements(void **state) {
    (void)state;
    ovoid_read_options o = defaults();
    o.assembly = "1";
    ovoid_molecule *molecule = expect("a.cif", with_expression("(1-2)(2)", "A"), &o, 4);
    const double *all = ovoid_molecule_xyzr(molecule);
    size_t count, which;
    const ovoid_placement *placements = ovoid_molecule_placements(molecule, &count);
    assert_int_equal(count, 2);
    assert_int_equal(ovoid_molecule_unit_atoms(molecule), 2);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->skipped_assembly, 1);
    assert_int_equal(placements[1].first, 2);
    assert_null(ovoid_molecule_part(molecule, placements[1].part, &count));
    assert_int_equal(count, 2);
    /* (1,2,3) to (-2+10, 1, 3), and from there again. */
    assert_true(all[0] == 8 && all[1] == 1 && all[2] == 3);
    assert_true(all[8] == 9 && all[9] == 8 && all[10] == 3);
    assert_true(all[11] == radius_of(molecule, 0));
    assert_int_equal(ovoid_molecule_origin(molecule, 3, &which), 1);
    assert_int_equal(which, 1);
    ovoid_molecule_destroy(&molecule);

    /* Nothing but places is asked for: the file's atoms and its list. */
    molecule = expect("a.cif", with_expression("(1-2)(2)", "A,B"), NULL, 3);
    const ovoid_assembly_info *info = ovoid_molecule_assemblies(molecule, &count);
    assert_int_equal(count, 1);
    assert_string_equal(info->id, "1");
    assert_int_equal(info->placements, 2);
    assert_int_equal(info->atoms, 6);
    assert_null(ovoid_molecule_placements(molecule, &count));
    ovoid_molecule_destroy(&molecule);
}

static void impossible_assemblies_are_errors(void **state) {
    (void)state;
    static const struct {
        const char *expression, *says;
        ovoid_status status;
    } cases[] = {
        {"1,7", "needs the operator 7, which is not there", OVOID_ERROR_FORMAT},
        {"5", "needs the operator 5", OVOID_ERROR_FORMAT}, /* its matrix has a hole */
        {"3", "no rotation and translation", OVOID_ERROR_FORMAT},
        {"4", "beyond 1e6 angstrom", OVOID_ERROR_FORMAT},
        {"()", "names no operator", OVOID_ERROR_FORMAT},
        {"(1)((((", "needs the operator (((,", OVOID_ERROR_FORMAT},
        {"(1,1,1,1,1,1,1,1,1,1)(1,1,1,1,1,1,1,1,1,1)(1,1,1,1,1,1,1,1,1,1)(1,1,1,1,1,1,1,1,1,1)"
         "(1,1,1,1,1,1,1,1,1,1)(1,1,1,1,1,1,1,1,1,1)(1,1,1,1,1,1,1,1,1,1)",
         "more than 1000000 placements", OVOID_ERROR_LIMIT},
        {"(1-999999999999)", "needs the operator 5", OVOID_ERROR_FORMAT},
    };
    ovoid_read_options o = defaults();
    o.assembly = "1";
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        expect_failure("a.cif", with_expression(cases[i].expression, "A,B"), &o, cases[i].status,
                       cases[i].says);
    expect_failure("a.cif", with_expression("1", "Z"), &o, OVOID_ERROR_EMPTY, "none of its chains");
    o.assembly = "2";
    expect_failure("a.cif", with_expression("1", "A"), &o, OVOID_ERROR_ARGUMENT,
                   "no assembly 2: the file has 1");
    expect_failure("a.cif", "data_X\n" ATOMS, &o, OVOID_ERROR_ARGUMENT, "describes none");
    expect_failure("a.xyzr", "1 2 3 4\n", &o, OVOID_ERROR_ARGUMENT, "an assembly needs more");
    expect_failure("a.pdb", "REMARK 350   BIOMT2   1  1.0 0.0 0.0 0.0\n", &o, OVOID_ERROR_FORMAT,
                   ":1:1: BIOMT1, BIOMT2 and BIOMT3 are expected in turn");
    expect_failure("a.pdb", "REMARK 350   BIOMT1   1  1.0 0.0 inf 0.0\n", &o, OVOID_ERROR_FORMAT,
                   ":1:34: 'inf' where a number is expected");
    char cut[1024];
    snprintf(cut, sizeof cut, "REMARK 350   BIOMT1   1  1.0 0.0 0.0 0.0\n%s", few);
    expect_failure("a.pdb", cut, &o, OVOID_ERROR_FORMAT, "the last operator has no BIOMT2");
}

/* ---- what means harm ----------------------------------------------------------------------------
 */

/* Bytes changed, cut and repeated in good files give atoms or a message, never more. */
static void noise_gives_atoms_or_a_message(void **state) {
    (void)state;
    static const char *const names[] = {"a.pdb", "a.cif", "a.pqr", "a"};
    const char *const texts[] = {pdb, with_expression("(1-2)(2)", "A,B")};
    uint32_t seed = 7;
    for (int round = 0; round < 4000; round++) {
        char text[8192];
        size_t length = (size_t)snprintf(text, sizeof text, "%s", texts[round % 2]);
        for (int k = 0; k < 1 + round % 5; k++) {
            seed = seed * 1664525u + 1013904223u;
            static const char bytes[] = "'\"; \n\t_.?-9#A(\x80";
            text[seed / 7 % length] = bytes[seed % (sizeof bytes - 1)];
        }
        if (round % 3 == 0)
            length = seed / 11 % length;
        ovoid_read_options o = defaults();
        o.assembly = round % 7 == 0 ? "1" : NULL;
        write_file(names[round / 2 % 4], text, length);
        ovoid_molecule *molecule = NULL;
        const ovoid_status status = ovoid_molecule_read_with(context, path, &o, &molecule);
        assert_true((status == OVOID_OK) == (molecule != NULL));
        assert_true(status == OVOID_OK || ovoid_context_error(context)[0]);
        if (molecule)
            assert_non_null(ovoid_molecule_xyzr(molecule));
        ovoid_molecule_destroy(&molecule);
        unlink(path);
    }
}

/* Memory follows the atoms that stay: a file of 60 MB with one does not need it. */
static void memory_follows_the_atoms(void **state) {
    (void)state;
    snprintf(path, sizeof path, "%s/large.cif.gz", folder);
    gzFile file = gzopen(path, "wb1");
    assert_non_null(file);
    gzputs(file, "data_X\nloop_\n_refln.a\n_refln.b\n");
    for (int i = 0; i < 1500000; i++)
        gzputs(file, "'some text' another_text\n");
    gzputs(file, COLUMNS);
    for (int i = 0; i < 400000; i++)
        gzputs(file, "HETATM 4 O O . HOH D D 9 ? 7 8 9 1 1\n");
    gzputs(file, "ATOM 1 C CA . ALA A A 5 ? 1 2 3 1 1\n");
    gzclose(file);
    struct rusage before, after;
    getrusage(RUSAGE_SELF, &before);
    ovoid_molecule *molecule = NULL;
    assert_int_equal(ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule), OVOID_OK);
    getrusage(RUSAGE_SELF, &after);
    assert_int_equal(ovoid_molecule_atoms(molecule), 1);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->skipped_waters, 400000);
    if (!getenv("LSAN_OPTIONS")) /* sanitizers keep what is freed */
        assert_true(after.ru_maxrss - before.ru_maxrss < 8 * 1024);
    ovoid_molecule_destroy(&molecule);
    unlink(path);
}

/* Many atoms in one place, all with alternate locations and of an unknown residue. */
static void crowds_take_no_longer(void **state) {
    (void)state;
    const int atoms = 60000;
    char *text = malloc(64 + (size_t)atoms * 64 + sizeof COLUMNS);
    assert_non_null(text);
    size_t used = (size_t)sprintf(text, "data_X\n" COLUMNS);
    for (int i = 0; i < atoms; i++)
        used += (size_t)sprintf(text + used, "ATOM 1 C C%d %c LIG A A 1 ? 1 2 %d 1 1\n", i,
                                'A' + i % 20, i % 2);
    ovoid_molecule *molecule = expect("a.cif", text, NULL, (size_t)atoms / 20);
    ovoid_molecule_destroy(&molecule);
    free(text);
}

/* ---- from memory ---------------------------------------------------------------------------- */

/* A molecule of what is known of another one's atoms, but for their radii. */
static ovoid_status make_known(const ovoid_molecule *molecule, ovoid_radii radii,
                               ovoid_molecule **known) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    size_t residues;
    double *xyzr = malloc(4 * atoms * sizeof *xyzr);
    const ovoid_residue *named = ovoid_molecule_residues(molecule, &residues);
    assert_non_null(xyzr);
    memcpy(xyzr, ovoid_molecule_xyzr(molecule), 4 * atoms * sizeof *xyzr);
    for (size_t i = 0; i < atoms; i++)
        xyzr[4 * i + 3] = 0.0;
    const ovoid_status status =
        ovoid_molecule_create_known(context, xyzr, ovoid_molecule_identity(molecule), atoms, named,
                                    residues, radii, NULL, known);
    free(xyzr);
    return status;
}

static void expect_same_known(const ovoid_molecule *molecule, ovoid_radii radii) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ovoid_molecule *known = NULL;
    size_t residues, same;
    assert_int_equal(make_known(molecule, radii, &known), OVOID_OK);
    const ovoid_residue *there = ovoid_molecule_residues(molecule, &residues);
    const ovoid_residue *here = ovoid_molecule_residues(known, &same);
    assert_int_equal(same, residues);
    assert_memory_equal(here, there, residues * sizeof *there);
    assert_memory_equal(ovoid_molecule_identity(known), ovoid_molecule_identity(molecule),
                        atoms * sizeof(ovoid_atom));
    assert_memory_equal(ovoid_molecule_xyzr(known), ovoid_molecule_xyzr(molecule),
                        4 * atoms * sizeof(double));
    assert_int_equal(ovoid_molecule_radii(known), ovoid_molecule_radii(molecule));
    assert_int_equal(ovoid_molecule_read_counts(known)->guessed_radii,
                     ovoid_molecule_read_counts(molecule)->guessed_radii);
    ovoid_molecule_destroy(&known);
}

/* Atoms from memory that are known by name get the radii that they have in a file. */
static void known_atoms_are_those_of_a_file(void **state) {
    (void)state;
    static const char *const entry = "/usr/share/pymol/data/tut/1hpv.pdb";
    ovoid_molecule *molecule = expect("a.pdb", pdb, NULL, 5);
    expect_same_known(molecule, OVOID_RADII_DEFAULT);
    ovoid_molecule_destroy(&molecule);
    if (access(entry, R_OK) != 0)
        skip();
    for (ovoid_radii radii = OVOID_RADII_BONDI; radii <= OVOID_RADII_UNITED; radii++) {
        ovoid_read_options options = defaults();
        options.radii = radii;
        assert_int_equal(ovoid_molecule_read_with(context, entry, &options, &molecule), OVOID_OK);
        expect_same_known(molecule, radii);
        ovoid_molecule_destroy(&molecule);
    }
}

static void expect_refused(const ovoid_atom *atoms, size_t count, const ovoid_residue *residues,
                           size_t residue_count, const char *text) {
    static const double xyzr[12] = {0.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 1.0, 6.0, 0.0, 0.0, 1.0};
    ovoid_molecule *molecule = NULL;
    assert_int_equal(ovoid_molecule_create_known(context, xyzr, atoms, count, residues,
                                                 residue_count, OVOID_RADII_DEFAULT, NULL,
                                                 &molecule),
                     OVOID_ERROR_ARGUMENT);
    assert_null(molecule);
    assert_non_null(strstr(ovoid_context_error(context), text));
}

static void known_atoms_must_follow_their_residues(void **state) {
    (void)state;
    const ovoid_residue residues[2] = {{.name = "ALA"}, {.name = "GLY"}};
    const ovoid_atom back[3] = {{.residue = 0}, {.residue = 1}, {.residue = 0}};
    const ovoid_atom late[3] = {{.residue = 1}, {.residue = 1}, {.residue = 1}};
    const ovoid_atom beyond[3] = {{.residue = 0}, {.residue = 1}, {.residue = 2}};
    expect_refused(back, 3, residues, 2, "atom 2 (from 0) is of residue 0");
    expect_refused(late, 3, residues, 2, "atom 0 (from 0) is of residue 1");
    expect_refused(beyond, 3, residues, 2, "atom 2 (from 0) is of residue 2");
    expect_refused(back, 1, residues, 2, "residue 1 (from 0) has no atom");
    expect_refused(back, 3, residues, 0, "atom 0 (from 0)");
}

/* What the caller's arrays hold is as little to be trusted as a file. */
static void known_names_are_ended(void **state) {
    (void)state;
    static const double xyzr[4] = {0.0, 0.0, 0.0, 2.5};
    ovoid_atom atom = {.residue = 0, .flags = 0xffu};
    ovoid_residue residue = {.number = 7, .first = 99};
    ovoid_molecule *molecule = NULL;
    memcpy(atom.name, "C\033LONGER", sizeof atom.name);
    memcpy(atom.element, "C", 2);
    memset(residue.chain, 'X', sizeof residue.chain);
    assert_int_equal(ovoid_molecule_create_known(context, xyzr, &atom, 1, &residue, 1,
                                                 OVOID_RADII_OWN, NULL, &molecule),
                     OVOID_OK);
    const ovoid_atom *made = ovoid_molecule_identity(molecule);
    const ovoid_residue *chain = ovoid_molecule_residues(molecule, NULL);
    assert_string_equal(made->name, "C?LONGE");
    assert_string_equal(chain->chain, "XXXXXXXXXXX");
    assert_int_equal(made->flags, OVOID_ATOM_HETERO | OVOID_ATOM_ZERO_OCCUPANCY);
    assert_int_equal(chain->first, 0);
    assert_true(ovoid_molecule_xyzr(molecule)[3] == 2.5);
    ovoid_molecule_destroy(&molecule);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pdb_files_are_read),
        cmocka_unit_test(models_are_numbered),
        cmocka_unit_test(choices_are_followed),
        cmocka_unit_test(pdb_errors_say_where),
        cmocka_unit_test(wide_columns_are_read),
        cmocka_unit_test(mmcif_files_are_read),
        cmocka_unit_test(damaged_mmcif_is_an_error),
        cmocka_unit_test(one_conformer_of_a_residue_stays),
        cmocka_unit_test(radii_go_by_element),
        cmocka_unit_test(united_radii_stand_for_hydrogens),
        cmocka_unit_test(radii_come_from_files),
        cmocka_unit_test(radii_of_pqr_are_replaced),
        cmocka_unit_test(assemblies_are_units_and_placements),
        cmocka_unit_test(impossible_assemblies_are_errors),
        cmocka_unit_test(noise_gives_atoms_or_a_message),
        cmocka_unit_test(memory_follows_the_atoms),
        cmocka_unit_test(crowds_take_no_longer),
        cmocka_unit_test(known_atoms_are_those_of_a_file),
        cmocka_unit_test(known_atoms_must_follow_their_residues),
        cmocka_unit_test(known_names_are_ended),
    };
    return cmocka_run_group_tests(tests, begin, finish);
}
