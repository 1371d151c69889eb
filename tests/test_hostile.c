/*
 * Files that nobody means: what they hold never reaches a terminal raw, an error names the right
 * place, and neither memory nor time follows them where no atom asks for it. Several of these were
 * found by the harnesses in fuzz/.
 */
#define _DEFAULT_SOURCE /* wait4 */
#include "reading.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <zlib.h>

static void write_text(const char *path, const char *text, size_t length) {
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(text, 1, length, file), length);
    assert_int_equal(fclose(file), 0);
}

/* Reads `length` bytes as a file of this name in the folder. */
static ovoid_status read_bytes(const char *name, const char *text, size_t length,
                               const char *assembly, ovoid_molecule **molecule) {
    char path[128];
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.assembly = assembly;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    write_text(path, text, length);
    warnings[0] = '\0';
    *molecule = NULL;
    const ovoid_status status = ovoid_molecule_read_with(context, path, &options, molecule);
    remove(path);
    return status;
}

static void expect_failure(const char *name, const char *text, const char *assembly,
                           ovoid_status expected, const char *message) {
    ovoid_molecule *molecule;
    assert_int_equal(read_bytes(name, text, strlen(text), assembly, &molecule), expected);
    assert_null(molecule);
    if (!strstr(ovoid_context_error(context), message))
        fail_msg("'%s' is not in: %s", message, ovoid_context_error(context));
}

/* ---- messages ------------------------------------------------------------------------------- */

static void expect_printable(const char *text) {
    for (const char *c = text; *c; c++)
        if (((unsigned char)*c < 0x20 && *c != '\n') || *c == 0x7f)
            fail_msg("a control character: %s", text);
}

static void messages_hold_no_control_characters(void **state) {
    (void)state;
    static const char bytes[] = "\x1b]0;t\x07";
    char text[512];
    ovoid_molecule *molecule;
    ovoid_model *model = NULL;

    /* a warning of guessed radii, and the names themselves */
    snprintf(text, sizeof text, "ATOM      1  \x1b\x07  GLY A   1       1.000   2.000   3.000\n");
    assert_int_equal(read_bytes("a.pdb", text, strlen(text), NULL, &molecule), OVOID_OK);
    assert_non_null(strstr(warnings, "guessed: ?? of GLY"));
    expect_printable(warnings);
    assert_string_equal(ovoid_molecule_identity(molecule)->name, "??");
    ovoid_molecule_destroy(&molecule);

    /* an assembly's name, in a PDB file and as it is asked for */
    snprintf(text, sizeof text,
             "REMARK 350 BIOMOLECULE: %s\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n"
             "ATOM      1  CA  GLY A   1       1.000   2.000   3.000\n",
             bytes);
    assert_int_equal(read_bytes("a.pdb", text, strlen(text), "1\x1b[2J", &molecule),
                     OVOID_ERROR_ARGUMENT);
    assert_non_null(strstr(ovoid_context_error(context), "no assembly 1?[2J: the file has ?]0;t?"));

    /* a selection */
    snprintf(text, sizeof text, "/x%s", bytes);
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.select = text;
    assert_int_equal(ovoid_molecule_read_with(context, "none", &options, &molecule),
                     OVOID_ERROR_ARGUMENT);
    expect_printable(ovoid_context_error(context));

    /* a number of a model file */
    char path[128];
    snprintf(path, sizeof path, "%s/a.ovoid", folder);
    snprintf(text, sizeof text, "# ovoid model 1\n1 1 1 %s\xff\xc3\xa5\n", bytes);
    write_text(path, text, strlen(text));
    assert_int_equal(ovoid_model_read(context, path, &model), OVOID_ERROR_FORMAT);
    remove(path);
    assert_non_null(
        strstr(ovoid_context_error(context), "decay3 is not a number: '?]0;t?\?\xc3\xa5'"));
}

/* ---- places --------------------------------------------------------------------------------- */

#define ATOM_LOOP "loop_\n_atom_site.Cartn_y\n_atom_site.Cartn_x\n_atom_site.Cartn_z\n"

static void errors_name_the_line_of_a_value(void **state) {
    (void)state;
    expect_failure("a.cif", ATOM_LOOP "1e7\n2 3\n", NULL, OVOID_ERROR_FORMAT,
                   "a.cif:5:1: y is '1e7': beyond 1e6 angstrom");
    expect_failure("a.cif", ATOM_LOOP "1\n2\n -2e6", NULL, OVOID_ERROR_FORMAT,
                   "a.cif:7:2: z is '-2e6': beyond 1e6 angstrom");
    /* a text field, of which the line that ends it holds nothing */
    expect_failure("a.cif", ATOM_LOOP "1 2\n;1e9(behind this there is more text\n;\n", NULL,
                   OVOID_ERROR_FORMAT, ":1: z is '1e9(behind this there");
}

/* A row without any text: there was no memory for text yet. */
static void rows_may_be_empty(void **state) {
    (void)state;
    ovoid_molecule *molecule;
    static const char text[] = "data_x\n_atom_site.other 1\n";
    assert_int_equal(read_bytes("a.cif", text, sizeof text - 1, NULL, &molecule),
                     OVOID_ERROR_FORMAT);
}

/* ---- assemblies ----------------------------------------------------------------------------- */

static void chains_do_not_part_an_operator(void **state) {
    (void)state;
    static const char text[] =
        "REMARK 350 BIOMOLECULE: 1\n"
        "REMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n"
        "REMARK 350   BIOMT1   1  1.0  0.0  0.0  0.0\n"
        "REMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n" /* its operators would begin behind all */
        "REMARK 350   BIOMT2   1  0.0  1.0  0.0  0.0\n"
        "REMARK 350   BIOMT3   1  0.0  0.0  1.0  0.0\n"
        "ATOM      1  CA  GLY A   1       1.000   2.000   3.000\n";
    expect_failure("a.pdb", text, "1", OVOID_ERROR_FORMAT,
                   "a.pdb:4:1: a list of chains between BIOMT1 and BIOMT2");
}

#define CIF_ATOM                                                                                   \
    "loop_\n_atom_site.id\n_atom_site.label_asym_id\n_atom_site.type_symbol\n_atom_site.Cartn_x\n" \
    "_atom_site.Cartn_y\n_atom_site.Cartn_z\n1 A C 0 0 0\n"
#define CIF_OPERATOR                                                                               \
    "_pdbx_struct_oper_list.id\n"                                                                  \
    "_pdbx_struct_oper_list.matrix[1][1]\n_pdbx_struct_oper_list.matrix[1][2]\n"                   \
    "_pdbx_struct_oper_list.matrix[1][3]\n_pdbx_struct_oper_list.vector[1]\n"                      \
    "_pdbx_struct_oper_list.matrix[2][1]\n_pdbx_struct_oper_list.matrix[2][2]\n"                   \
    "_pdbx_struct_oper_list.matrix[2][3]\n_pdbx_struct_oper_list.vector[2]\n"                      \
    "_pdbx_struct_oper_list.matrix[3][1]\n_pdbx_struct_oper_list.matrix[3][2]\n"                   \
    "_pdbx_struct_oper_list.matrix[3][3]\n_pdbx_struct_oper_list.vector[3]\n"
#define IDENTITY " 1 0 0 0 0 1 0 0 0 0 1 0\n"
#define CIF_PARTS                                                                                  \
    "loop_\n_pdbx_struct_assembly_gen.assembly_id\n_pdbx_struct_assembly_gen.oper_expression\n"    \
    "_pdbx_struct_assembly_gen.asym_id_list\n"

/* Ranges are counted, not walked through, which took two minutes for this file. */
static void long_ranges_cost_nothing(void **state) {
    (void)state;
    enum { RANGES = 3000 };
    static char text[RANGES * 22 + 512];
    size_t used = (size_t)sprintf(text, "%s%s1 ", CIF_ATOM, CIF_PARTS);
    for (int i = 0; i < RANGES; i++)
        used += (size_t)sprintf(text + used, "%s1-99999999999999", i ? "," : "");
    sprintf(text + used, " A\n2 0-9223372036854775807,9-3 A\n3 (1-4)(1-5,P) A\n");
    ovoid_molecule *molecule;
    assert_int_equal(read_bytes("a.cif", text, strlen(text), NULL, &molecule), OVOID_OK);
    size_t count;
    const ovoid_assembly_info *info = ovoid_molecule_assemblies(molecule, &count);
    assert_int_equal(count, 3);
    assert_true(info[0].placements == UINT64_C(99999999999999) * RANGES);
    assert_true(info[1].placements == UINT64_C(1) << 63);
    assert_int_equal(info[2].placements, 24);
    ovoid_molecule_destroy(&molecule);
    /* The largest number has no next one. */
    expect_failure("a.cif", CIF_ATOM CIF_PARTS "1 99999999999999999999-99999999999999999999 A\n",
                   "1", OVOID_ERROR_FORMAT,
                   "needs the operator 9223372036854775807, which is not there");
}

/* Placements are limited in all, not in each part of an assembly alone. */
static void parts_share_the_limit_of_placements(void **state) {
    (void)state;
    enum { OPERATORS = 300, PARTS = 12 };
    static char text[OPERATORS * 40 + PARTS * 40 + 2048];
    size_t used = (size_t)sprintf(text, "%sloop_\n%s", CIF_ATOM, CIF_OPERATOR);
    for (int i = 1; i <= OPERATORS; i++)
        used += (size_t)sprintf(text + used, "%d%s", i, IDENTITY);
    used += (size_t)sprintf(text + used, "%s", CIF_PARTS);
    for (int i = 0; i < PARTS; i++)
        used += (size_t)sprintf(text + used, "1 (1-%d)(1-%d) A\n", OPERATORS, OPERATORS);
    expect_failure("a.cif", text, "1", OVOID_ERROR_LIMIT,
                   "assembly 1 has more than 1000000 placements");
}

/* Of several entities with one id the first counts, however many there are and in whatever order.
 */
static void entities_are_found_among_many(void **state) {
    (void)state;
    enum { OTHERS = 3000 };
    static char text[OTHERS * 20 + 1024];
    size_t used = (size_t)sprintf(text, "loop_\n_entity.id\n_entity.type\n7x polymer\n7x water\n");
    for (int i = OTHERS; i > 0; i--)
        used += (size_t)sprintf(text + used, "%d %s\n", i, i == 5 ? "polymer" : "other");
    sprintf(text + used, "%s",
            "loop_\n_atom_site.label_entity_id\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n"
            "_atom_site.Cartn_z\n_atom_site.label_seq_id\n"
            "7x 1 0 0 1\n4 2 0 0 2\n5 3 0 0 3\n9999 4 0 0 4\n7x 5 0 0 5\n");
    char path[128];
    ovoid_molecule *molecule = NULL;
    ovoid_read_options options;
    ovoid_read_options_init(&options, sizeof options);
    options.select = ";polymer";
    snprintf(path, sizeof path, "%s/a.cif", folder);
    write_text(path, text, strlen(text));
    assert_int_equal(ovoid_molecule_read_with(context, path, &options, &molecule), OVOID_OK);
    remove(path);
    const double *xyzr = ovoid_molecule_xyzr(molecule);
    static const double expected[] = {1, 3, 4, 5}; /* what has no entity is taken by its name */
    assert_int_equal(ovoid_molecule_atoms(molecule), 4);
    for (int i = 0; i < 4; i++)
        assert_true(xyzr[4 * i] == expected[i]);
    ovoid_molecule_destroy(&molecule);
}

/* ---- memory --------------------------------------------------------------------------------- */

typedef enum kind { MOLECULE, RADII, MODEL } kind;

/* A file of any length: head, a unit again and again, of which each '@' is a number that counts up,
 * and tail. */
typedef struct endless {
    kind kind;
    ovoid_molecule_format format;
    const char *head, *unit;
    size_t megabytes; /* of units */
    const char *tail;
    ovoid_status status;
    const char *message; /* "" for OK */
} endless;

static void write_unit(FILE *file, const char *unit, size_t number) {
    const char *mark;
    while ((mark = strchr(unit, '@')) != NULL) {
        fprintf(file, "%.*s%zu", (int)(mark - unit), unit, number);
        unit = mark + 1;
    }
    fputs(unit, file);
}

/* Until the reader has had enough. */
static void write_endless(FILE *file, const endless *e) {
    const bool small = getenv("OVOID_TEST_SMALL") && e->status == OVOID_OK; /* is read to its end */
    const size_t size = strlen(e->unit), units = e->megabytes * (small ? 250000 : 1000000) / size;
    fputs(e->head, file);
    for (size_t i = 0; i < units && !ferror(file); i++)
        write_unit(file, e->unit, i);
    fputs(e->tail, file);
}

static ovoid_status read_endless(const char *path, const endless *e) {
    ovoid_molecule *molecule = NULL;
    ovoid_model *model = NULL;
    ovoid_read_options options;
    char one[128];
    ovoid_read_options_init(&options, sizeof options);
    options.format = e->format;
    ovoid_status status = OVOID_OK;
    if (e->kind == RADII) {
        options.radii = OVOID_RADII_FILE;
        options.radii_file = path;
        options.format = OVOID_MOLECULE_PDB;
        static const char text[] = "ATOM      1  CA  GLY A   1       1.000   2.000   3.000\n";
        snprintf(one, sizeof one, "%s/one.pdb", folder);
        write_text(one, text, sizeof text - 1);
        status = ovoid_molecule_read_with(context, one, &options, &molecule);
        remove(one);
    } else if (e->kind == MODEL) {
        status = ovoid_model_read(context, path, &model);
    } else {
        status = ovoid_molecule_read_with(context, path, &options, &molecule);
    }
    ovoid_molecule_destroy(&molecule);
    ovoid_model_destroy(&model);
    return status;
}

#if defined(__SANITIZE_ADDRESS__)
enum { MEGABYTES_MAX = 400 }; /* what was freed is kept for a while */
#else
enum { MEGABYTES_MAX = 80 };
#endif

/* Reads the file in a process of its own and ends it: 0 where all is as expected. */
static _Noreturn void read_and_exit(const char *path, const endless *e) {
    const ovoid_status status = read_endless(path, e);
    const bool right = status == e->status &&
                       (status == OVOID_OK || strstr(ovoid_context_error(context), e->message));
    if (!right)
        fprintf(stderr, "status %d: %s\n", (int)status, ovoid_context_error(context));
    _exit(!right);
}

/* Waits for it: what it took at most. */
static void expect_bounded(pid_t child, const endless *e) {
    struct rusage used;
    int result;
    assert_int_equal(wait4(child, &result, 0, &used), child);
    if (!WIFEXITED(result) || WEXITSTATUS(result) != 0)
        fail_msg("not as expected: %.60s...%.60s", e->head, e->unit);
    if (used.ru_maxrss > MEGABYTES_MAX * 1024L)
        fail_msg("%ld MB for: %.60s...%.60s", used.ru_maxrss / 1024, e->head, e->unit);
}

static void read_from_pipe(const endless *e) {
    int ends[2];
    char path[32];
    assert_int_equal(pipe(ends), 0);
    const pid_t child = fork();
    assert_int_not_equal(child, -1);
    if (child == 0) {
        close(ends[1]);
        snprintf(path, sizeof path, "/dev/fd/%d", ends[0]);
        read_and_exit(path, e);
    }
    close(ends[0]);
    FILE *file = fdopen(ends[1], "wb");
    assert_non_null(file);
    write_endless(file, e);
    fclose(file);
    expect_bounded(child, e);
}

/* The formats, in short. */
#define AUTO OVOID_MOLECULE_AUTO
#define PDB OVOID_MOLECULE_PDB
#define CIF OVOID_MOLECULE_MMCIF
#define XYZR OVOID_MOLECULE_XYZR
#define CIF_MODELS                                                                                 \
    "loop_\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n"                          \
    "_atom_site.pdbx_PDB_model_num\n"
#define PDB_CHAINS "REMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n"

static void memory_follows_atoms_alone(void **state) {
    (void)state;
    static const endless cases[] = {
        {MOLECULE, AUTO, "REMARK ", "x", 100, "", OVOID_ERROR_FORMAT,
         ":1:65537: the line is longer than 65536 bytes"},
        {MOLECULE, CIF, "_struct.title '", "x", 100, "'", OVOID_ERROR_FORMAT, ":1:65537: the line"},
        {MOLECULE, AUTO, "REMARK\n", "\n", 30, "ATOM 1 N GLY 1 1.0 2.0 3.0 -0.3 1.8\n", OVOID_OK,
         ""},
        {MOLECULE, CIF, "_struct.title\n;", "text\r\n", 20, "\n;\n" CIF_ATOM, OVOID_OK, ""},
        {MOLECULE, CIF, "_entity.details\n;", "text\n", 20, "\n;\n" CIF_ATOM, OVOID_OK, ""},
        {MOLECULE, CIF, "_entity.id\n;", "text\n", 20, "\n;\n" CIF_ATOM, OVOID_ERROR_LIMIT,
         ":2:1: more than 1048576 bytes of a text between lines that begin with ';'"},
        {MOLECULE, CIF, "", "_entity.id @\n", 20, CIF_ATOM, OVOID_ERROR_LIMIT, "bytes of a row"},
        {MOLECULE, CIF, "", "_c@.x 'a ''b\"c\"' _c@.y \"'\"\n", 20, CIF_ATOM, OVOID_OK, ""},
        {MOLECULE, CIF, "loop_\n_x.a\n", "'\"'\"' \"'\"'\" '''' \"\"\"\"\n", 20, CIF_ATOM, OVOID_OK,
         ""},
        {MOLECULE, CIF, "loop_\n", "_atom_site.a@\n", 20, "", OVOID_ERROR_LIMIT,
         ":10002:1: more than 10000 names of a loop"},
        {MOLECULE, CIF, "loop_\n_entity.id\n_entity.type\n", "@ polymer\n", 20, "",
         OVOID_ERROR_LIMIT, ":10004:1: more than 10000 entities"},
        {MOLECULE, CIF, "loop_\n" CIF_OPERATOR, "@" IDENTITY, 20, "", OVOID_ERROR_LIMIT,
         "more than 100000 operators"},
        {MOLECULE, CIF, CIF_PARTS, "@ 1 A\n", 20, "", OVOID_ERROR_LIMIT,
         "more than 10000 parts of assemblies"},
        {MOLECULE, CIF, CIF_MODELS, "0 0 0 @\n", 20, "", OVOID_ERROR_LIMIT,
         "more than 1000000 models"},
        {MOLECULE, PDB, PDB_CHAINS, "REMARK 350 AND CHAINS: A, B, C, D, E, F\n", 60, "",
         OVOID_ERROR_LIMIT, "bytes of text about assemblies"},
        {MOLECULE, XYZR, "99999999999999999999\n", "0 0 @ 1\n", 0, "0 0 0 1\n", OVOID_ERROR_FORMAT,
         ":1:1: the file announces 100000000000000000000 atoms but holds 1"},
        {RADII, AUTO, "", "R@ A@ 1\n", 20, "", OVOID_ERROR_LIMIT, "more than 1000000 radii"},
        {MODEL, AUTO, "# ovoid model 1\n", "# k@: v\n", 20, "", OVOID_ERROR_LIMIT,
         "bytes of notes"},
        {MODEL, AUTO, "# ovoid model 2\n", "# placement: 1 0 0 0 1 0 0 0 1 0 0 @\n", 20, "",
         OVOID_ERROR_LIMIT, ":100002:1: more than 100000 placements"},
        {MODEL, AUTO, "# ovoid model 1\n", "1", 100, "", OVOID_ERROR_FORMAT, "is too long"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        read_from_pipe(&cases[i]);
}

/* A thousand times its size: nothing but the atoms in it is kept. */
static void gzip_is_unpacked_in_pieces(void **state) {
    (void)state;
    const int megabytes = getenv("OVOID_TEST_SMALL") ? 25 : 100;
    static const endless bomb = {MOLECULE, XYZR, "gzip", "", 0, "", OVOID_OK, ""};
    static char blanks[1000000];
    char path[128];
    snprintf(path, sizeof path, "%s/bomb.xyzr.gz", folder);
    for (size_t i = 0; i < sizeof blanks; i++)
        blanks[i] = i % 1000 == 999 ? '\n' : ' ';
    gzFile file = gzopen(path, "wb9");
    assert_non_null(file);
    assert_int_equal(gzputs(file, "0 0 0 1\n"), 8);
    for (int i = 0; i < megabytes; i++)
        assert_int_equal(gzwrite(file, blanks, sizeof blanks), sizeof blanks);
    assert_int_equal(gzclose(file), Z_OK);
    const pid_t child = fork();
    assert_int_not_equal(child, -1);
    if (child == 0)
        read_and_exit(path, &bomb);
    expect_bounded(child, &bomb);
    remove(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        /* First, as a child begins with what its parent has. */
        cmocka_unit_test(memory_follows_atoms_alone),
        cmocka_unit_test(gzip_is_unpacked_in_pieces),
        cmocka_unit_test(messages_hold_no_control_characters),
        cmocka_unit_test(errors_name_the_line_of_a_value),
        cmocka_unit_test(rows_may_be_empty),
        cmocka_unit_test(chains_do_not_part_an_operator),
        cmocka_unit_test(long_ranges_cost_nothing),
        cmocka_unit_test(entities_are_found_among_many),
        cmocka_unit_test(parts_share_the_limit_of_placements),
    };
    signal(SIGPIPE, SIG_IGN); /* of a pipe whose reader has had enough */
    return cmocka_run_group_tests(tests, begin, finish);
}
