/*
 * Molecules: lines that PQR and XYZR files really hold, where errors point, line endings, gzip,
 * standard input, and files that are no molecules at all.
 */
#include "molecule/fields.h"
#include "molecule/text.h"
#include "reading.h"

#include <float.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#define APBS "/usr/share/apbs/examples"

/* A literal and its length. */
#define TEXT(literal) literal, sizeof(literal) - 1

/* ---- scratch files ------------------------------------------------------------------------ */

/* Path of a file of this name in the scratch folder; valid until the next call. */
static const char *path_of(const char *name) {
    static char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static const char *write_bytes(const char *name, const void *bytes, size_t count) {
    const char *path = path_of(name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, count, file), count);
    assert_int_equal(fclose(file), 0);
    return path;
}

/* Reads these bytes as a file of this name. */
static ovoid_status read_as(const char *name, const void *bytes, size_t count,
                            ovoid_molecule_format format, ovoid_molecule **molecule) {
    const char *path = write_bytes(name, bytes, count);
    warnings[0] = '\0';
    ovoid_status status = ovoid_molecule_read(context, path, format, molecule);
    unlink(path);
    return status;
}

static ovoid_status read_bytes(const char *name, const void *bytes, size_t count,
                               ovoid_molecule **molecule) {
    return read_as(name, bytes, count, OVOID_MOLECULE_AUTO, molecule);
}

static void expect_atom(const ovoid_molecule *molecule, size_t index, double x, double y, double z,
                        double radius) {
    const double expected[] = {x, y, z, radius};
    assert_true(index < ovoid_molecule_atoms(molecule));
    for (size_t k = 0; k < 4; k++)
        if (ovoid_molecule_xyzr(molecule)[4 * index + k] != expected[k])
            fail_msg("atom %zu, value %zu: %.17g, not %.17g", index, k,
                     ovoid_molecule_xyzr(molecule)[4 * index + k], expected[k]);
}

/* Reads and expects success with this number of atoms. */
static ovoid_molecule *expect_atoms(const char *name, const void *bytes, size_t count,
                                    size_t atoms) {
    ovoid_molecule *molecule = NULL;
    if (read_bytes(name, bytes, count, &molecule) != OVOID_OK)
        fail_msg("%s", ovoid_context_error(context));
    assert_int_equal(ovoid_molecule_atoms(molecule), atoms);
    assert_int_equal(ovoid_molecule_read_counts(molecule)->atoms, atoms);
    return molecule;
}

/* Reads and expects this failure: the message names the file, then has `text` in it. */
static void expect_failure(const char *name, const void *bytes, size_t count, ovoid_status status,
                           const char *text) {
    ovoid_molecule *molecule = NULL;
    ovoid_status got = read_bytes(name, bytes, count, &molecule);
    const char *error = ovoid_context_error(context), *path = path_of(name);
    if (got != status || strncmp(error, path, strlen(path)) || !strstr(error, text))
        fail_msg("%s: '%s', where %s and '%s' are expected", ovoid_status_name(got), error,
                 ovoid_status_name(status), text);
    assert_null(molecule);
}

/* ---- numbers ------------------------------------------------------------------------------ */

static void numbers_have_their_grammar(void **state) {
    (void)state;
    static const struct {
        const char *text;
        size_t length;
        double value;
        bool point;
        size_t decimals;
    } cases[] = {
        {"12", 2, 12, false, 0},
        {"-7", 2, -7, false, 0},
        {"+7x", 2, 7, false, 0},
        {"1.", 2, 1, true, 0},
        {".5", 2, 0.5, true, 1},
        {"-.25-", 4, -0.25, true, 2},
        {"-116.238", 8, -116.238, true, 3},
        {"81.812-137.418", 6, 81.812, true, 3},
        {"1.5e3", 5, 1500, true, 1},
        {"1E-2", 4, 0.01, true, 0},
        {"1e+", 1, 1, false, 0},
        {"12E", 2, 12, false, 0},
        {"1.2.3", 3, 1.2, true, 1},
        {"0.0000000000000000000000000000012", 33, 1.2e-30, true, 31},
        {"123456789012345678901234567890", 30, 123456789012345678901234567890.0, false, 0},
        {"9007199254740993", 16, 9007199254740993.0, false, 0},
        {"1e400", 5, INFINITY, true, 0},
        {"-1e99999999999", 14, -INFINITY, true, 0},
        {"1e-400", 6, 0, true, 0},
        {"4.9e-324", 8, 4.9e-324, true, 1},
        {"1.7976931348623157e308", 22, DBL_MAX, true, 16},
        {"", 0, 0, false, 0},
        {"-", 0, 0, false, 0},
        {".", 0, 0, false, 0},
        {"+.e1", 0, 0, false, 0},
        {"e5", 0, 0, false, 0},
        {"nan", 0, 0, false, 0},
        {"0x10", 1, 0, false, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ov_number number = {0};
        size_t length = ov_number_parse(cases[i].text, strlen(cases[i].text), &number);
        if (length != cases[i].length || number.value != cases[i].value ||
            number.point != cases[i].point || number.decimals != cases[i].decimals)
            fail_msg("'%s': %zu bytes, %.17g, point %d, %zu decimals", cases[i].text, length,
                     number.value, number.point, number.decimals);
    }
    ov_number number;
    assert_int_equal(ov_number_parse("12345", 3, &number), 3); /* never beyond the length */
    assert_true(number.value == 123);
    assert_int_equal(ov_number_parse("1.5e3", 4, &number), 3);
}

static uint64_t random_bits(uint64_t *seed) {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    *seed ^= *seed << 17;
    return *seed;
}

static void numbers_are_rounded_as_the_c_library_does(void **state) {
    (void)state;
    uint64_t seed = 88172645463325252u;
    for (int i = 0; i < 200000; i++) {
        char text[64];
        long long mantissa = (long long)(random_bits(&seed) >> (1 + random_bits(&seed) % 62));
        if (i % 2)
            snprintf(text, sizeof text, "%lld.%0*d", mantissa % 100000000,
                     1 + (int)(random_bits(&seed) % 6), (int)(random_bits(&seed) % 10));
        else
            snprintf(text, sizeof text, "-%llde%d", mantissa,
                     (int)(random_bits(&seed) % 640) - 330);
        ov_number number;
        assert_int_equal(ov_number_parse(text, strlen(text), &number), strlen(text));
        if (number.value != strtod(text, NULL))
            fail_msg("%s: %.17g", text, number.value);
    }
}

/* ---- PQR lines ---------------------------------------------------------------------------- */

static void pqr_lines_are_read(void **state) {
    (void)state;
    static const struct {
        const char *line;
        double x, y, z, radius;
    } cases[] = {
        /* by blanks, as APBS has it, without and with a chain */
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 1.00 2.00", -3, 0.5, 0, 2},
        {"ATOM 5 C PRO A 1 -3.00 0.50 0.00 1.00 2.00", -3, 0.5, 0, 2},
        {"HETATM 5 C PRO A 1 -3.00 0.50 0.00 1.00 2.00", -3, 0.5, 0, 2},
        {"atom 5 c pro a 1 -3.00 0.50 0.00 1.00 2.00", -3, 0.5, 0, 2},
        {"  ATOM\t5\tC\tPRO\t1\t-3.00\t0.50\t0.00\t1.00\t2.00\t", -3, 0.5, 0, 2},
        {"ATOM 5 C PRO 1 0 -1 2 1 3", 0, -1, 2, 3},
        {"ATOM 5 C PRO A 1 0 0.5 2 1.0 3", 0, 0.5, 2, 3},
        {"ATOM 5 C PRO A 1 B 0 0.5 2 1.0 3", 0, 0.5, 2, 3},
        {"ATOM 5 C PRO 1 1e1 -2.5E-1 +3.5 .5 2.", 10, -0.25, 3.5, 2},
        {"ATOM 5 C PRO 1 1234.5678 -12345.6789 99999.999 0.1 1.5", 1234.5678, -12345.6789,
         99999.999, 1.5},
        {"ATOM 1 1 017 1 12 1.5 2.5 3.5 0.25 1.25", 1.5, 2.5, 3.5, 1.25},
        {"ATOM 1 C A 1.5 2.5 3.5 0.25 1.25", 1.5, 2.5, 3.5, 1.25}, /* no residue number */
        {"ATOM      1  N   ALA     1       3.326   1.548  -0.000  0.1414 1.8240", 3.326, 1.548, 0,
         1.824},
        {"ATOM      1  I   ION     1      -3.000    0.000   0.000  1.00 0.00", -3, 0, 0, 0},
        /* fused before a sign */
        {"ATOM      1  N   GLY    49    -116.238  81.812-137.418 -0.4157 1.8240", -116.238, 81.812,
         -137.418, 1.824},
        {"ATOM   5346  O   ASN A 664     -34.085-167.825-100.826 -0.4157 1.8240", -34.085, -167.825,
         -100.826, 1.824},
        {"ATOM   5346  O   ASN A 664    -134.085-167.825-100.826-10.4157 1.8240", -134.085,
         -167.825, -100.826, 1.824},
        {"ATOM   5346  O   ASN A1234-134.085  67.825 100.826  0.4157 1.8240", -134.085, 67.825,
         100.826, 1.824},
        {"ATOM   5346  O   ASN A 664E-134.085  67.825 100.826  0.4157 1.8240", -134.085, 67.825,
         100.826, 1.824},
        {"ATOM 1 N ALA 12-116.238 81.812 1.0E-05-2.0E+01 1.5", -116.238, 81.812, 1e-5, 1.5},
        /* fused without a sign: only the columns tell */
        {"ATOM   5346  O   ASN A 664    1234.0852345.6783456.789  0.4157 1.8240", 1234.085,
         2345.678, 3456.789, 1.824},
        {"ATOM   5346  O   ASN A 664    -116.2381081.812-137.418 -0.4157 1.8240", -116.238,
         1081.812, -137.418, 1.824},
        {"ATOM   5346  O   ASN A 664      16.238  81.812  37.418  0.500010.0000", 16.238, 81.812,
         37.418, 10},
        {"ATOM   5346  O   ASN A 664      16.238  81.812  37.418 -0.5012.50           O", 16.238,
         81.812, 37.418, 12.5},
        {"ATOM   5346  O   ASN A 664      16.238  81.812  37.418 -0.5000 2.5000      1234", 16.238,
         81.812, 37.418, 2.5},
        /* glued in front of x */
        {"ATOM   1234  CA  GLY A1234      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM   1234 HG11VAL A 664      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM 100000 HG11VALA1234A     16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM100000 HG11AVALA1234      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"HETATM12345  O   HOH     1      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"HETATMA000K  O   HOH     1      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM  *****  O   HOH  ****      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM*****  O   HOH  A000      16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM     34  C   CHG A1           8.257  13.181  10.022 -0.1550  1.8700", 8.257, 13.181,
         10.022, 1.87},
        {"ATOM   1234  CA  GLY A 664A     16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM   1234  CA  GLY A 664 A    16.238  81.812  37.418 -0.5000 2.5000", 16.238, 81.812,
         37.418, 2.5},
        {"ATOM  10605  N   POPEa 496      37.380  63.975  30.931 -0.29  1.65           N", 37.38,
         63.975, 30.931, 1.65},
        /* columns behind the radius */
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 N", -3, 0.5, 0, 1.824},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 N 0", -3, 0.5, 0, 1.824},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 N -0.40", -3, 0.5, 0, 1.824},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 N1+", -3, 0.5, 0, 1.824},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 1ABC O1-", -3, 0.5, 0, 1.824},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 -0.4157 1.8240 # seen twice", -3, 0.5, 0, 1.824},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ovoid_molecule *molecule = NULL;
        if (read_bytes("line.pqr", cases[i].line, strlen(cases[i].line), &molecule) != OVOID_OK)
            fail_msg("'%s': %s", cases[i].line, ovoid_context_error(context));
        assert_int_equal(ovoid_molecule_atoms(molecule), 1);
        expect_atom(molecule, 0, cases[i].x, cases[i].y, cases[i].z, cases[i].radius);
        ovoid_molecule_destroy(&molecule);
    }
}

/* The line stands third, so that line numbers count; an error there must be ":3:column: text". */
static void expect_bad_line(const char *name, const char *before, const char *line, size_t column,
                            const char *text) {
    char file[1024], expected[512];
    int count = snprintf(file, sizeof file, "%s%s\n", before, line);
    snprintf(expected, sizeof expected, "%s:3:%zu: ", path_of(name), column);
    ovoid_molecule *molecule = NULL;
    ovoid_status status = read_bytes(name, file, (size_t)count, &molecule);
    const char *error = ovoid_context_error(context);
    if (status != OVOID_ERROR_FORMAT || strncmp(error, expected, strlen(expected)) ||
        !strstr(error, text))
        fail_msg("'%s'\n%s: %s\nwhere column %zu and '%s' are expected", line,
                 ovoid_status_name(status), status == OVOID_OK ? "" : error, column, text);
    assert_null(molecule);
}

static void pqr_errors_say_where(void **state) {
    (void)state;
    static const struct {
        const char *line;
        size_t column;
        const char *text;
    } cases[] = {
        {"ATOM 5 C PRO 1 -3.00 abc 0.00 1.00 2.00", 22, "'abc' is not a number"},
        {"ATOM 5 C PRO 1 0 abc 0.00 1.00 2.00", 18, "'abc' is not a number"},
        {"ATOM 5 C PRO 1 -3.00 0.5x 0.00 1.00 2.00", 22, "'0.5x' is not a number"},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 1.00 2.00x", 37, "'2.00x' is not a number"},
        {"ATOM 5 C PRO 1 1 -3.00 0.50 0.00 1.00 2.00x", 39, "'2.00x' is not a number"},
        {"ATOM 5 C PRO 1 -3.00 0,50 0.00 1.00 2.00", 22, "numbers take a decimal point"},
        {"ATOM 5 C PRO 1 -3,00 0,50 0,00 1,00 2,00", 16, "numbers take a decimal point"},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 1.00", 36, "ends after 4 numbers"},
        {"ATOM 5 C PRO A 1 -3.00 0.50 0.00 1.00  ", 38, "ends after 4 numbers"},
        {"ATOM 5 C DC5 1 -3.00 0.50 0.00 1.00", 36, "ends after 4 numbers"},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00", 31, "no charge and no radius"},
        {"ATOM 5 C PRO 1 -3.00 0.50", 26, "ends after 2 numbers"},
        {"ATOM 5 C PRO 1 -3.00", 21, "ends after 1 number;"},
        {"ATOM 5 C PRO 1", 15, "without coordinates"},
        {"ATOM", 5, "without coordinates"},
        {"HETATM   ", 7, "without coordinates"},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 1.00 2.00 3.00", 42, "more numbers than"},
        {"ATOM 5 C PRO 1 -3.00 0.50 0.00 1.00 0.00 -0.30 N", 42, "more numbers than"},
        {"ATOM 5 C PRO 1 nan 0.50 0.00 1.00 2.00", 16, "x is 'nan': not a finite"},
        {"ATOM 5 C PRO 1 0.1 -NaN 0.00 1.00 2.00", 20, "y is '-NaN': not a finite"},
        {"ATOM 5 C PRO 1 0.1 0.1 inf 1.00 2.00", 24, "z is 'inf': not a finite"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 -Infinity 2.00", 28, "the charge is '-Infinity'"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 1.00 nan", 33, "the radius is 'nan'"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 1.00 1.#QNAN", 33, "the radius is '1.#QNAN'"},
        {"ATOM 5 C PRO 1 0.1 ******** 0.1 1.00 1.0", 20, "too wide for its column"},
        {"ATOM 5 C PRO 1 0.1 0.1 1e999 1.00 1.0", 24, "z is '1e999': not a finite"},
        {"ATOM 5 C PRO 1 0.1 0.1 -1000001 1.00 1.0", 24, "z is '-1000001': beyond"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 1.00 -1.5", 33, "the radius is '-1.5': negative"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 1.00-1.5", 32, "the radius is '-1.5': negative"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 1.00 100.5", 33, "the radius is '100.5': beyond"},
        {"ATOM 5 C PRO 1 0.1 0.1 0.1 \x1b[31m\xc3\xa9 1.00", 28, "'\\x1b[31m\\xc3\\xa9' is not"},
        {"ATOM 5 C PRO 1 0.1 ABCDEFGHIJABCDEFGHIJABCDEFGHIJABCDEFGHIJABCDEFGHIJ 1.0 1.0", 20,
         "'ABCDEFGHIJABCDEFGHIJABCDEFGHIJABCDEFGHIJ...' is not"},
        {"ATM 5 C PRO 1 0.1 0.1 0.1 1.00 1.5", 1, "'ATM' is no record"},
        {"ATOM_5 C PRO 1 0.1 0.1 0.1 1.00 1.5", 1, "'ATOM_5' is no record"},
        /* one column too far to the right: x would lose its sign, or z its last digit */
        {"ATOM   5346  O   ASN A 664   -1234.0852345.6783456.789  0.4157 1.8240", 30, "is not"},
        {"ATOM   5346  O   ASN A 664     1234.0852345.6783456.789  0.4157 1.8240", 32, "is not"},
        {"ATOM   5346  O   ASN A 664    10000.123345.678  56.789  0.4157 1.8240", 31, "is not"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        expect_bad_line("bad.pqr", "REMARK one\nATOM 1 C PRO 1 -3.00 0.50 0.00 -1.00 2.00\n",
                        cases[i].line, cases[i].column, cases[i].text);
}

static void pqr_records_are_told_apart(void **state) {
    (void)state;
    static const char file[] =
        "REMARK   1 1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0\n"
        "HEADER    A TEST 1 N ALA 1 1.0 2.0 3.0 0.1 1.5\n"
        "# ATOM 9 N ALA 1 9.0 2.0 3.0 0.1 1.5\n"
        "; comment\n! comment\n// comment\n\n   \n"
        "ATOM 1 N ALA 1 1.0 2.0 3.0 -0.1 0.0\n"
        "ANISOU    1  N   ALA A   1      123    456    789     12     34     56\n"
        "TER\n"
        "Made by a program in 2001\n"
        "HETATM 2 O HOH 2 2.0 2.0 3.0 0.1 1.5\n"
        "CONECT    1    2    3    4    5    6\n"
        "END\n"
        "ATOM 3 N ALA 3 3.0 2.0 3.0 0.1 1.5\n" /* a second file behind the first */
        "nothing else";
    ovoid_molecule *molecule = expect_atoms("records.pqr", file, sizeof file - 1, 2);
    for (int i = 0; i < 2; i++)
        expect_atom(molecule, (size_t)i, i + 1, 2, 3, i == 0 ? 0 : 1.5);
    ovoid_molecule_counts counts = *ovoid_molecule_read_counts(molecule);
    assert_int_equal(counts.lines, 17);
    assert_int_equal(counts.zero_radius, 1);
    assert_int_equal(counts.skipped, 1);
    assert_int_equal(counts.skipped_models, 1);
    assert_non_null(strstr(warnings, "records.pqr: 1 of 2 atoms has radius 0"));
    assert_non_null(strstr(warnings, "records.pqr: 2 lines of no known kind ignored; line 12 is "
                                     "'Made by a program in 2001'\n"));
    ovoid_molecule_destroy(&molecule);
}

static void expect_models(const char *file, double x, size_t skipped) {
    ovoid_molecule *molecule = expect_atoms("models.pqr", file, strlen(file), 1);
    expect_atom(molecule, 0, x, 0, 0, 1);
    ovoid_molecule_counts counts = *ovoid_molecule_read_counts(molecule);
    assert_int_equal(counts.skipped, skipped);
    assert_int_equal(counts.skipped_models, skipped);
    assert_int_equal(counts.skipped_altlocs, 0);
    ovoid_molecule_destroy(&molecule);
}

static void only_the_first_model_counts(void **state) {
    (void)state;
#define A1 "ATOM 1 N ALA 1 1.0 0.0 0.0 0.1 1.0\n"
#define A2 "ATOM 1 N ALA 1 2.0 0.0 0.0 0.1 1.0\n"
    expect_models("MODEL 1\n" A1 "ENDMDL\n", 1, 0);
    expect_models("MODEL        1\n" A1 "TER\nENDMDL\nMODEL        2\n" A2 A2 "ENDMDL\nEND\n", 1,
                  2);
    expect_models("MODEL 1\n" A1 "MODEL 2\n" A2 "MODEL 3\n" A2 A2, 1, 3);
    expect_models("MODEL 7\n" A2 "ENDMDL\nMODEL 8\n" A1 "ENDMDL\n", 2, 1);
    expect_models("MODEL 1\nENDMDL\nMODEL 2\n" A2 "ENDMDL\nMODEL 3\n" A1, 2, 1);
    expect_models(A1 "ENDMDL\n" A2 "ENDMDL\n" A2 "ENDMDL\n", 1, 2);
    expect_models("MODEL 1\n" A1 "ENDMDL\nMODEL 2\nATOM what ever\nENDMDL\n", 1, 1);
    expect_models(A1 "END\n" A2 "END\n", 1, 1);
    expect_models("END\n" A1 "TER\nEND\n" A2, 1, 1);
}

/* Atoms exactly where another is are most likely a file's second copy of them. */
static void doubled_atoms_are_counted(void **state) {
    (void)state;
    static const char once[] = "1 2 3 1.5\n0 5 -0 1.2\n1 2 3.0001 1.5\n";
    static const char twice[] = "1 2 3 1.5\n0 5 -0 1.2\n1 2 3 1.5\n-0 5 0 1.7\n1 2 3 1.5\n";
    ovoid_molecule *molecule = expect_atoms("once.xyzr", once, sizeof once - 1, 3);
    assert_string_equal(warnings, "");
    ovoid_molecule_destroy(&molecule);
    molecule = expect_atoms("twice.xyzr", twice, sizeof twice - 1, 5);
    assert_non_null(strstr(warnings, "twice.xyzr: 3 of 5 atoms stand exactly where another does, "
                                     "the first of them atom 3; "));
    ovoid_molecule_destroy(&molecule);
}

/* ---- XYZR --------------------------------------------------------------------------------- */

static void xyzr_lines_are_read(void **state) {
    (void)state;
    static const struct {
        const char *file;
        size_t atoms;
    } cases[] = {
        {"1.5 2.5 -3.5 1.25", 1},
        {"  1.5\t2.5 -3.5   1.25  \n", 1},
        {"# x y z r\n\n1.5 2.5 -3.5 1.25 # carbon 1.0\n  # end\n", 1},
        {"2\n1.5 2.5 -3.5 1.25\n4 5 6 0\n", 2},
        {"# two\n 2 # atoms\n\n1.5 2.5 -3.5 1.25\n4 5 6 0\n", 2},
        {"1.5 2.5 -3.5 1.25 1 CA_ALA_1_A\n4 5 6 0 1 N\n", 2},
        {"1.5 2.5-3.5 1.25\n4 5 6 0 C\n", 2},
        {"15e-1 +2.5 -3.5 1.25\n4 5 6 -0", 2},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ovoid_molecule *molecule =
            expect_atoms("a.xyzr", cases[i].file, strlen(cases[i].file), cases[i].atoms);
        expect_atom(molecule, 0, 1.5, 2.5, -3.5, 1.25);
        if (cases[i].atoms == 2)
            expect_atom(molecule, 1, 4, 5, 6, 0);
        assert_int_equal(ovoid_molecule_read_counts(molecule)->zero_radius, cases[i].atoms - 1);
        ovoid_molecule_destroy(&molecule);
    }
}

static void xyzr_errors_say_where(void **state) {
    (void)state;
    static const struct {
        const char *line;
        size_t column;
        const char *text;
    } cases[] = {
        {"1.0 2.0 3.0", 12, "ends after 3 numbers; x, y, z and radius"},
        {"1.0 2.0 3.0 # 1.5", 12, "ends after 3 numbers"},
        {"7", 2, "ends after 1 number;"},
        {"1.0 2.0 x 1.5", 9, "'x' is not a number"},
        {"1.0, 2.0, 3.0, 1.5", 1, "numbers take a decimal point"},
        {"1.0 2.0 3.0 0.5 1.5", 17, "'1.5': more numbers than"},
        {"1.0 2.0 nan 1.5", 9, "z is 'nan'"},
        {"1.0 2.0 1.#QNAN 1.5", 9, "z is '1.#QNAN'"},
        {"1.0 2e6 3.0 1.5", 5, "y is '2e6': beyond 1e6"},
        {"1.0 2.0 3.0 -1.5", 13, "the radius is '-1.5': negative"},
        {"1.0 2.0 3.0 inf", 13, "the radius is 'inf': not a finite"},
        {"C 2.0 3.0 1.5", 1, "'C' is not a number"},
        {"ATOM 1 C PRO 1 -3.00 0.50 0.00 1.00 2.00", 1, "a PQR or PDB line"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        expect_bad_line("bad.xyzr", "#\n1 2 3 4\n", cases[i].line, cases[i].column, cases[i].text);
    expect_failure("short.xyzr", TEXT("\n3\n1 2 3 4\n5 6 7 8\n"), OVOID_ERROR_FORMAT,
                   ".xyzr:2:1: the file announces 3 atoms but holds 2");
    expect_failure("twice.xyzr", TEXT("2\n2\n1 2 3 4\n5 6 7 8\n"), OVOID_ERROR_FORMAT,
                   ":2:2: the line ends after 1 number");
    expect_failure("minus.xyzr", TEXT("-3\n1 2 3 4\n"), OVOID_ERROR_FORMAT,
                   ":1:1: '-3' is no number");
}

/* ---- formats ------------------------------------------------------------------------------ */

static void formats_are_recognised(void **state) {
    (void)state;
    static const char pqr[] = "REMARK 1.0 2.0 3.0 1.0\nATOM 1 N ALA 1 1.0 2.0 3.0 -0.1 1.5\n";
    static const char xyzr[] = "# made up\n1.0 2.0 3.0 1.5\n";
    static const char *const pqr_names[] = {"a.pqr", "a.PQR", "a.pqr.gz", "a.txt",
                                            "a",     "a.pdb", ".pqr"};
    static const char *const xyzr_names[] = {"a.xyzr", "a.XyzR", "a.xyzr.GZ",
                                             "a.txt",  "a.gz",   "a.xyzrn"};
    ovoid_molecule *molecule;
    for (size_t i = 0; i < sizeof pqr_names / sizeof pqr_names[0]; i++) {
        molecule = expect_atoms(pqr_names[i], pqr, sizeof pqr - 1, 1);
        ovoid_molecule_destroy(&molecule);
    }
    for (size_t i = 0; i < sizeof xyzr_names / sizeof xyzr_names[0]; i++) {
        molecule = expect_atoms(xyzr_names[i], xyzr, sizeof xyzr - 1, 1);
        ovoid_molecule_destroy(&molecule);
    }
    molecule = expect_atoms("prose.txt", TEXT("Radii by Bondi\n1 2 3 4\n"), 1);
    assert_non_null(strstr(warnings, "1 line of no known kind ignored; line 1 is 'Radii by"));
    ovoid_molecule_destroy(&molecule);
    expect_failure("a.pqr", xyzr, sizeof xyzr - 1, OVOID_ERROR_EMPTY,
                   "none of its 2 lines holds an ATOM or HETATM record; line 2 is '1.0 2.0");
    expect_failure("a.pqr.gz", xyzr, sizeof xyzr - 1, OVOID_ERROR_EMPTY, "ATOM or HETATM");
    expect_failure("a.xyzr", pqr, sizeof pqr - 1, OVOID_ERROR_FORMAT, ":1:1: 'REMARK' is not");

    /* What the caller says outweighs the name. */
    assert_int_equal(read_as("a.xyzr", pqr, sizeof pqr - 1, OVOID_MOLECULE_PQR, &molecule),
                     OVOID_OK);
    ovoid_molecule_destroy(&molecule);
    assert_int_equal(read_as("a.pqr", xyzr, sizeof xyzr - 1, OVOID_MOLECULE_XYZR, &molecule),
                     OVOID_OK);
    ovoid_molecule_destroy(&molecule);
    assert_int_equal(read_as("a.pqr", pqr, sizeof pqr - 1, (ovoid_molecule_format)7, &molecule),
                     OVOID_ERROR_ARGUMENT);
}

static void other_formats_are_named(void **state) {
    (void)state;
    static const struct {
        const char *file, *text;
    } cases[] = {
        {"\n<?xml version='1.0'?>\n", ":2:1: this looks like HTML or XML"},
        {"@<TRIPOS>MOLECULE\n", "MOL2"},
        {"{\"atoms\": []}\n", "JSON"},
        {"BZh91AY&SY", "compressed with bzip2"},
        {"\xfd"
         "7zXZ\n",
         "compressed with xz"},
        {"\x28\xb5\x2f\xfd\n", "compressed with zstd"},
        {"PK\x03\x04\n", "compressed with zip"},
        {"\xff\xfe"
         "A",
         "UTF-16"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        expect_failure("other.pqr", cases[i].file, strlen(cases[i].file), OVOID_ERROR_FORMAT,
                       cases[i].text);
        expect_failure("other", cases[i].file, strlen(cases[i].file), OVOID_ERROR_FORMAT,
                       cases[i].text);
    }
}

/* Writes `atoms` atoms as a PDB file has them, every eighth half occupied. */
static size_t write_pdb(char *file, size_t room, const char *start, int atoms, double charge,
                        double radius, const char *element) {
    size_t used = (size_t)snprintf(file, room, "%s", start);
    for (int i = 0; i < atoms; i++)
        used += (size_t)snprintf(file + used, room - used,
                                 "ATOM  %5d  N   ALA A%4d    %8.3f%8.3f%8.3f%6.2f%6.2f%10s%2s\n", i,
                                 i, i * 1.0, 0.0, 0.0, i % 8 == 7 ? charge / 2 : charge, radius + i,
                                 "", element);
    return used;
}

/* A PDB file under another name is read as what it is. */
static void expect_pdb(const char *name, const char *file, size_t size, size_t atoms) {
    ovoid_molecule *molecule = expect_atoms(name, file, size, atoms);
    assert_int_equal(ovoid_molecule_read_format(molecule), OVOID_MOLECULE_PDB);
    assert_int_equal(ovoid_molecule_radii(molecule), OVOID_RADII_UNITED);
    ovoid_molecule_destroy(&molecule);
}

static void pdb_files_are_not_taken_for_pqr(void **state) {
    (void)state;
    static char file[4096];
    size_t size = write_pdb(file, sizeof file, "", 16, 1.0, 20, ""); /* B factors */
    expect_pdb("a.pqr", file, size, 16);
    expect_pdb("a.pdb", file, size, 16);
    expect_pdb("a", file, size, 16);
    ovoid_molecule *molecule = NULL; /* unless the caller insists */
    assert_int_equal(read_as("a.pdb", file, size, OVOID_MOLECULE_PQR, &molecule), OVOID_OK);
    assert_int_equal(ovoid_molecule_radii(molecule), OVOID_RADII_OWN);
    expect_atom(molecule, 15, 15, 0, 0, 35);
    ovoid_molecule_destroy(&molecule);

    size = write_pdb(file, sizeof file, "", 16, 1.0, 90, ""); /* beyond any radius */
    expect_pdb("a.pqr", file, size, 16);
    size = write_pdb(file, sizeof file, "", 2, 1.0, 0, " N");
    expect_pdb("a.pqr", file, size, 2);
    size = write_pdb(file, sizeof file, "SEQRES   1 A    4  ALA ALA ALA ALA\n", 4, 1.0, 0, "");
    expect_pdb("a.pqr", file, size, 4);

    /* The same columns with charges and radii: some programs write PQR so. */
    size = write_pdb(file, sizeof file, "", 4, -0.25, 1.5, " N");
    molecule = expect_atoms("a.pqr", file, size, 4);
    ovoid_molecule_destroy(&molecule);
    size = write_pdb(file, sizeof file, "", 4, 1.0, 1.0, ""); /* ions */
    molecule = expect_atoms("a.pqr", file, size, 4);
    ovoid_molecule_destroy(&molecule);
    size = write_pdb(file, sizeof file, "", 4, 0.25, 1.5, " N");
    molecule = expect_atoms("a.pqr", file, size, 4);
    ovoid_molecule_destroy(&molecule);
    size = write_pdb(file, sizeof file, "", 7, 1.0, 1.5, " N");
    size += write_pdb(file + size, sizeof file - size, "", 1, -1.0, 1.5, " N");
    molecule = expect_atoms("a.pqr", file, size, 8);
    ovoid_molecule_destroy(&molecule);
    size = write_pdb(file, sizeof file, "", 4, 2.0, 6.0, " N");
    molecule = expect_atoms("a.pqr", file, size, 4);
    ovoid_molecule_destroy(&molecule);
}

/* ---- lines -------------------------------------------------------------------------------- */

static void line_endings_do_not_matter(void **state) {
    (void)state;
    static const struct {
        const char *file;
        size_t lines;
    } cases[] = {
        {"1 2 3 4\n5 6 7 8\n", 2},       {"1 2 3 4\n5 6 7 8", 2},
        {"1 2 3 4\r\n5 6 7 8\r\n", 2},   {"1 2 3 4\r\n5 6 7 8\r", 2},
        {"1 2 3 4\r5 6 7 8\r", 2},       {"1 2 3 4\r5 6 7 8", 2},
        {"1 2 3 4\r\n\r\n5 6 7 8\n", 3}, {"1 2 3 4\r\r5 6 7 8\r", 3},
        {"\n\n1 2 3 4\n\r5 6 7 8\n", 5}, {"\xef\xbb\xbf#\n1 2 3 4\n5 6 7 8\n", 3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ovoid_molecule *molecule =
            expect_atoms("lines.xyzr", cases[i].file, strlen(cases[i].file), 2);
        expect_atom(molecule, 0, 1, 2, 3, 4);
        expect_atom(molecule, 1, 5, 6, 7, 8);
        assert_int_equal(ovoid_molecule_read_counts(molecule)->lines, cases[i].lines);
        ovoid_molecule_destroy(&molecule);
    }
    expect_failure("crlf.xyzr", TEXT("1 2 3 4\r\n5 6 7 8\r\n9 x\r\n"), OVOID_ERROR_FORMAT,
                   ":3:3: 'x'");
    expect_failure("cr.xyzr", TEXT("1 2 3 4\r5 6 7 8\r9 x\r"), OVOID_ERROR_FORMAT, ":3:3: 'x'");
}

/* Larger than the reader's buffers, so that lines and CR LF pairs fall across their ends. */
static void long_files_are_read_in_pieces(void **state) {
    (void)state;
    const size_t atoms = 150000, room = atoms * 64;
    char *file = malloc(room);
    assert_non_null(file);
    for (int ending = 0; ending < 3; ending++) {
        static const char *const endings[] = {"\n", "\r\n", "\r"};
        size_t used = 0;
        for (size_t i = 0; i < atoms; i++)
            used += (size_t)snprintf(file + used, room - used, "%zu.5 %zu %zu 1.25%s", i, i % 1000,
                                     i % 7, endings[ending]);
        assert_true(used > 2 * 1024 * 1024);
        ovoid_molecule *molecule = expect_atoms("long.xyzr", file, used, atoms);
        assert_int_equal(ovoid_molecule_read_counts(molecule)->lines, atoms);
        for (size_t i = 0; i < atoms; i++)
            expect_atom(molecule, i, (double)i + 0.5, (double)(i % 1000), (double)(i % 7), 1.25);
        ovoid_molecule_destroy(&molecule);
    }
    free(file);
}

static void what_is_no_text_is_refused(void **state) {
    (void)state;
    expect_failure("zero.pqr", TEXT("REMARK\nATOM \0 x\n"), OVOID_ERROR_FORMAT,
                   ":2:6: a zero byte");
    size_t room = 3 * 1024 * 1024;
    char *line = malloc(room);
    assert_non_null(line);
    memset(line, ' ', room);
    expect_failure("wide.pqr", line, room, OVOID_ERROR_FORMAT, ":1:65537: the line is longer than");
    memcpy(line, "1 2 3 4", 7);
    line[OV_TEXT_LONGEST_LINE] = '\n';
    ovoid_molecule *molecule = expect_atoms("a.xyzr", line, OV_TEXT_LONGEST_LINE + 1, 1);
    ovoid_molecule_destroy(&molecule);
    line[OV_TEXT_LONGEST_LINE] = ' ';
    line[OV_TEXT_LONGEST_LINE + 1] = '\n';
    expect_failure("a.xyzr", line, OV_TEXT_LONGEST_LINE + 2, OVOID_ERROR_FORMAT, "longer than");
    free(line);
}

static void empty_files_say_what_was_seen(void **state) {
    (void)state;
    expect_failure("a.pqr", TEXT(""), OVOID_ERROR_EMPTY, "a.pqr: no atoms: the file is empty");
    expect_failure("a", TEXT(""), OVOID_ERROR_EMPTY, "no atoms: the file is empty");
    expect_failure("a", TEXT("\n \n#\n"), OVOID_ERROR_EMPTY,
                   "none of its 3 lines holds an atom of a");
    expect_failure("a.pqr", TEXT("REMARK\n"), OVOID_ERROR_EMPTY,
                   "none of its 1 line holds an ATOM");
    expect_failure("a.xyzr", TEXT("# 1 2 3 4\n"), OVOID_ERROR_EMPTY, "x, y, z and radius");
    expect_failure("a.xyzr", TEXT("0\n"), OVOID_ERROR_EMPTY, "x, y, z and radius");
    expect_failure("a", TEXT("Dear reader,\n"), OVOID_ERROR_EMPTY, "line 1 is 'Dear reader,'");
}

static void files_that_cannot_be_read(void **state) {
    (void)state;
    ovoid_molecule *molecule = NULL;
    assert_int_equal(
        ovoid_molecule_read(context, path_of("none.pqr"), OVOID_MOLECULE_AUTO, &molecule),
        OVOID_ERROR_IO);
    assert_non_null(strstr(ovoid_context_error(context), "none.pqr: cannot open: No such file"));
    assert_int_equal(ovoid_molecule_read(context, folder, OVOID_MOLECULE_AUTO, &molecule),
                     OVOID_ERROR_IO);
    assert_non_null(strstr(ovoid_context_error(context), "cannot read: Is a directory"));
    assert_int_equal(ovoid_molecule_read(context, "", OVOID_MOLECULE_AUTO, &molecule),
                     OVOID_ERROR_IO);
    assert_int_equal(ovoid_molecule_read(context, "\x1b[2J\n", OVOID_MOLECULE_AUTO, &molecule),
                     OVOID_ERROR_IO);
    assert_int_equal(strncmp(ovoid_context_error(context), "?[2J?: ", 7), 0);
    assert_int_equal(ovoid_molecule_read(context, NULL, OVOID_MOLECULE_AUTO, &molecule),
                     OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_molecule_read(context, folder, OVOID_MOLECULE_AUTO, NULL),
                     OVOID_ERROR_ARGUMENT);
    assert_null(molecule);
    if (geteuid() != 0) {
        const char *path = write_bytes("secret.pqr", "x", 1);
        chmod(path, 0);
        assert_int_equal(ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule),
                         OVOID_ERROR_IO);
        assert_non_null(strstr(ovoid_context_error(context), "Permission denied"));
        unlink(path_of("secret.pqr"));
    }
}

/* ---- gzip --------------------------------------------------------------------------------- */

static const char pqr_file[] =
    "REMARK a file of two atoms\n"
    "ATOM      1  N   GLY    49    -116.238  81.812-137.418 -0.4157 1.8240\n"
    "ATOM      2  CA  GLY    49    -116.954  80.724-136.770 -0.0252 1.9080\n"
    "END\n";

/* One gzip member. */
static size_t gzip_level(int level, const void *bytes, size_t count, unsigned char *out,
                         size_t room) {
    z_stream z = {0};
    assert_int_equal(deflateInit2(&z, level, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY), Z_OK);
    z.next_in = (unsigned char *)(uintptr_t)bytes;
    z.avail_in = (uInt)count;
    z.next_out = out;
    z.avail_out = (uInt)room;
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    size_t size = z.total_out;
    deflateEnd(&z);
    return size;
}

static size_t gzip(const void *bytes, size_t count, unsigned char *out, size_t room) {
    return gzip_level(9, bytes, count, out, room);
}

static void expect_pqr_file(const char *name, const void *bytes, size_t count) {
    ovoid_molecule *molecule = expect_atoms(name, bytes, count, 2);
    expect_atom(molecule, 0, -116.238, 81.812, -137.418, 1.824);
    expect_atom(molecule, 1, -116.954, 80.724, -136.77, 1.908);
    ovoid_molecule_destroy(&molecule);
}

static void gzip_is_recognised_by_content(void **state) {
    (void)state;
    unsigned char out[2048] = {0};
    size_t half = 50, size = gzip(pqr_file, sizeof pqr_file - 1, out, sizeof out);
    expect_pqr_file("a.pqr.gz", out, size);
    expect_pqr_file("a.pqr", out, size);
    expect_pqr_file("a", out, size);
    expect_pqr_file("padded.gz", out, size + 700); /* zeros, as tapes have them */

    size = gzip(pqr_file, half, out, sizeof out); /* members in a row, an empty one among them */
    size += gzip(TEXT(""), out + size, sizeof out - size);
    size += gzip(pqr_file + half, sizeof pqr_file - 1 - half, out + size, sizeof out - size);
    expect_pqr_file("members.pqr.gz", out, size);
    memcpy(out + size, "tail", 4);
    expect_failure("tail.pqr.gz", out, size + 4, OVOID_ERROR_FORMAT, "followed by something else");

    size = gzip(TEXT(""), out, sizeof out);
    expect_failure("void.gz", out, size, OVOID_ERROR_EMPTY, "the file is empty");
    size = gzip(TEXT("\xef\xbb\xbf"
                     "1 2 3 x\n"),
                out, sizeof out);
    expect_failure("a.xyzr.gz", out, size, OVOID_ERROR_FORMAT, ".gz:1:7: 'x' is not a number");
}

static void damaged_gzip_is_an_error(void **state) {
    (void)state;
    unsigned char out[1024];
    size_t size = gzip(pqr_file, sizeof pqr_file - 1, out, sizeof out);
    for (size_t cut = 2; cut < size; cut++)
        expect_failure("cut.pqr.gz", out, cut, OVOID_ERROR_FORMAT, "gzip data is cut off");
    size_t caught = 0;
    for (size_t i = 10; i < size; i++) { /* behind the header, every byte counts */
        out[i] ^= 0x10;
        expect_failure("flip.pqr.gz", out, size, OVOID_ERROR_FORMAT, "gzip data is");
        out[i] ^= 0x10;
        caught++;
    }
    assert_true(caught > 100);
    expect_pqr_file("whole.pqr.gz", out, size);
}

/* The checksum at the end explains why a line early in the file makes no sense. */
static void damage_outweighs_the_line_it_spoils(void **state) {
    (void)state;
    const size_t size = 4 * 1024 * 1024, room = size + size / 4;
    char *file = malloc(size);
    unsigned char *out = malloc(room);
    assert_true(file && out);
    for (size_t i = 0; i < size; i += 16)
        memcpy(file + i, "1.5 2.5 3.5 1.5\n", 16);
    size_t packed = gzip_level(0, file, size, out, room); /* stored as it is */
    ovoid_molecule *molecule = expect_atoms("stored.xyzr.gz", out, packed, size / 16);
    ovoid_molecule_destroy(&molecule);
    unsigned char *spoilt = memchr(out + 64, '.', 64);
    assert_non_null(spoilt);
    *spoilt = 'x';
    expect_failure("spoilt.xyzr.gz", out, packed, OVOID_ERROR_FORMAT, "gzip data is damaged");
    free(file);
    free(out);
}

/* ---- standard input ----------------------------------------------------------------------- */

/* Reads "-" while a child writes the bytes into the pipe, `step` at a time. */
static ovoid_status read_pipe(const void *bytes, size_t count, size_t step,
                              ovoid_molecule **molecule) {
    int ends[2], saved = dup(STDIN_FILENO);
    assert_int_equal(pipe(ends), 0);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        close(ends[0]);
        for (size_t at = 0; at < count; at += step) {
            if (write(ends[1], (const char *)bytes + at, count - at < step ? count - at : step) < 0)
                _exit(1);
            if (at < 4) /* let the reader see the first bytes one by one */
                nanosleep(&(struct timespec){.tv_nsec = 3000000}, NULL);
        }
        _exit(0);
    }
    close(ends[1]);
    dup2(ends[0], STDIN_FILENO);
    close(ends[0]);
    ovoid_status status = ovoid_molecule_read(context, "-", OVOID_MOLECULE_AUTO, molecule);
    dup2(saved, STDIN_FILENO); /* only if the reader left standard input open does this matter */
    close(saved);
    waitpid(child, NULL, 0);
    return status;
}

static void standard_input_is_read(void **state) {
    (void)state;
    unsigned char out[1024];
    size_t size = gzip(pqr_file, sizeof pqr_file - 1, out, sizeof out);
    for (size_t step = 1; step < 2000; step *= 10) {
        ovoid_molecule *molecule = NULL;
        assert_int_equal(read_pipe(pqr_file, sizeof pqr_file - 1, step, &molecule), OVOID_OK);
        assert_int_equal(ovoid_molecule_atoms(molecule), 2);
        ovoid_molecule_destroy(&molecule);
        assert_int_equal(read_pipe(out, size, step, &molecule), OVOID_OK);
        expect_atom(molecule, 1, -116.954, 80.724, -136.77, 1.908);
        ovoid_molecule_destroy(&molecule);
        assert_int_equal(read_pipe(TEXT("1 2 3\n"), step, &molecule), OVOID_ERROR_FORMAT);
        assert_non_null(strstr(ovoid_context_error(context), "standard input:1:6: the line ends"));
        assert_int_equal(read_pipe(TEXT(""), step, &molecule), OVOID_ERROR_EMPTY);
        assert_non_null(strstr(ovoid_context_error(context), "standard input: no atoms"));
    }
}

/* ---- locale ------------------------------------------------------------------------------- */

/* Makes a locale with a decimal comma, since few machines have one, and switches to it. */
static bool enter_comma_locale(void) {
    write_bytes("comma.source", TEXT("LC_NUMERIC\ndecimal_point \",\"\nthousands_sep \".\"\n"
                                     "grouping 3;3\nEND LC_NUMERIC\n"));
    char command[512];
    snprintf(command, sizeof command,
             "PATH=\"$PATH:/usr/bin\" localedef -c --no-archive -f ANSI_X3.4-1968 "
             "-i %s/comma.source %s/comma >%s/comma.log 2>&1",
             folder, folder, folder);
    int result = system(command); /* it complains of what the source leaves out */
    (void)result;
    setenv("LOCPATH", folder, 1);
    bool entered = setlocale(LC_NUMERIC, "comma") != NULL;
    unsetenv("LOCPATH");
    snprintf(command, sizeof command, "rm -rf %s/comma %s/comma.source %s/comma.log", folder,
             folder, folder);
    assert_int_equal(system(command), 0);
    return entered;
}

static void the_locale_does_not_matter(void **state) {
    (void)state;
    if (!enter_comma_locale()) {
        print_message("localedef makes no locale with a decimal comma here\n");
        skip();
    }
    char text[16];
    snprintf(text, sizeof text, "%.1f", 1.5);
    static const char line[] = "1.5 -2.25 1.2345678901234567891 9007199254740993e-15";
    ovoid_molecule *molecule = NULL;
    ovoid_status status = read_bytes("a.xyzr", line, sizeof line - 1, &molecule);
    setlocale(LC_NUMERIC, "C");
    assert_string_equal(text, "1,5");
    assert_int_equal(status, OVOID_OK);
    expect_atom(molecule, 0, 1.5, -2.25, 1.2345678901234567891, 9007199254740993e-15);
    ovoid_molecule_destroy(&molecule);
}

/* ---- molecules from memory ---------------------------------------------------------------- */

static void molecules_are_made_from_arrays(void **state) {
    (void)state;
    double xyzr[] = {1, 2, 3, 1.5, -4, 5, 6, 0, 7, 8, 9, 2};
    ovoid_molecule *molecule = NULL;
    assert_int_equal(ovoid_molecule_create(context, xyzr, 3, &molecule), OVOID_OK);
    xyzr[4] = 99; /* a copy was taken */
    expect_atom(molecule, 1, -4, 5, 6, 0);
    ovoid_molecule_counts counts = *ovoid_molecule_read_counts(molecule);
    assert_int_equal(counts.atoms, 3);
    assert_int_equal(counts.zero_radius, 1);
    assert_int_equal(counts.lines, 0);
    ovoid_molecule_destroy(&molecule);
    assert_null(molecule);
    ovoid_molecule_destroy(&molecule);
    ovoid_molecule_destroy(NULL);

    static const struct {
        size_t at;
        double value;
        const char *text;
    } bad[] = {
        {4, NAN, "x of atom 1 (from 0) is"},    {5, INFINITY, "y of atom 1"},
        {6, -INFINITY, "z of atom 1"},          {7, NAN, "the radius of atom 1"},
        {11, -0.5, "is -0.5: negative"},        {11, 1e3, "beyond 100 angstrom"},
        {8, -1.5e6, "x of atom 2 (from 0) is"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        double broken[12];
        memcpy(broken, xyzr, sizeof broken);
        broken[bad[i].at] = bad[i].value;
        assert_int_equal(ovoid_molecule_create(context, broken, 3, &molecule),
                         OVOID_ERROR_ARGUMENT);
        assert_non_null(strstr(ovoid_context_error(context), bad[i].text));
        assert_null(molecule);
    }
    assert_int_equal(ovoid_molecule_create(context, xyzr, 0, &molecule), OVOID_ERROR_EMPTY);
    assert_int_equal(ovoid_molecule_create(context, NULL, 3, &molecule), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_molecule_create(context, xyzr, 3, NULL), OVOID_ERROR_ARGUMENT);
    assert_int_equal(ovoid_molecule_create(context, xyzr, SIZE_MAX / 8, NULL),
                     OVOID_ERROR_ARGUMENT);
    assert_null(molecule);
}

/* ---- noise -------------------------------------------------------------------------------- */

/* Changes the bytes at random; returns the new size. */
static size_t mutate(char *bytes, size_t size, size_t room, uint64_t *seed) {
    static const char *const pieces[] = {"-",        ".",        " ",         "\n",  "\r",    "\t",
                                         "e9",       "nan",      "ATOM",      "#",   "*****", "1",
                                         "99999999", "\x1f\x8b", "MODEL 2\n", "\xff"};
    for (uint64_t changes = 1 + random_bits(seed) % 4; changes-- > 0;) {
        size_t at = size ? random_bits(seed) % size : 0, count;
        switch (random_bits(seed) % 5) {
        case 0:
            if (size)
                bytes[at] ^= (char)(1 << random_bits(seed) % 8);
            break;
        case 1: { /* put something in */
            const char *piece = pieces[random_bits(seed) % (sizeof pieces / sizeof pieces[0])];
            count = strlen(piece);
            if (size + count > room)
                break;
            memmove(bytes + at + count, bytes + at, size - at);
            memcpy(bytes + at, piece, count);
            size += count;
            break;
        }
        case 2: /* take something out */
            count = random_bits(seed) % 12;
            if (count > size - at)
                count = size - at;
            memmove(bytes + at, bytes + at + count, size - at - count);
            size -= count;
            break;
        case 3: /* repeat something */
            count = random_bits(seed) % 200;
            if (count > size - at || size + count > room)
                break;
            memmove(bytes + at + count, bytes + at, size - at);
            size += count;
            break;
        default:
            if (random_bits(seed) % 8 == 0)
                size = at;
        }
    }
    return size;
}

static const double two_atoms[8] = {1, 0, 0, 1.5, 0, 2, 0, 1.2};

/* A part of a unit of two atoms in one place, all of it in another. */
static void assemblies_are_made_from_arrays(void **state) {
    static const uint32_t second[1] = {1};
    const ovoid_unit_part parts[2] = {{second, 1}, {NULL, 2}};
    const ovoid_placement placements[2] = {{.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .part = 0},
                                           {.rotation = {-1, 0, 0, 0, -1, 0, 0, 0, 1},
                                            .translation = {0, 0, 5},
                                            .part = 1,
                                            .first = 9}};
    static const double all[12] = {0, 2, 0, 1.2, -1, 0, 5, 1.5, 0, -2, 5, 1.2};
    ovoid_molecule *molecule = NULL;
    size_t count;
    (void)state;
    assert_int_equal(
        ovoid_molecule_create_placed(context, two_atoms, 2, parts, 2, placements, 2, &molecule),
        OVOID_OK);
    assert_int_equal(ovoid_molecule_atoms(molecule), 3);
    assert_int_equal(ovoid_molecule_unit_atoms(molecule), 2);
    for (size_t k = 0; k < 12; ++k)
        assert_true(ovoid_molecule_xyzr(molecule)[k] == all[k]);
    assert_int_equal(ovoid_molecule_placements(molecule, &count)[1].first, 1);
    assert_int_equal(count, 2);
    ovoid_molecule_destroy(&molecule);
    assert_int_equal(
        ovoid_molecule_create_placed(context, two_atoms, 2, NULL, 0, placements, 1, &molecule),
        OVOID_OK);
    assert_int_equal(ovoid_molecule_atoms(molecule), 2);
    ovoid_molecule_destroy(&molecule);
}

static void refuse_placed(const ovoid_unit_part *parts, const ovoid_placement *placement,
                          const char *text) {
    ovoid_molecule *molecule = NULL;
    assert_int_equal(
        ovoid_molecule_create_placed(context, two_atoms, 2, parts, 1, placement, 1, &molecule),
        OVOID_ERROR_ARGUMENT);
    print_message("%s\n", ovoid_context_error(context));
    assert_non_null(strstr(ovoid_context_error(context), text));
    assert_null(molecule);
}

static void assemblies_that_are_none_are_refused(void **state) {
    static const uint32_t beyond[1] = {2}, twice[2] = {1, 1};
    const ovoid_unit_part all = {NULL, 2}, some = {NULL, 1}, none = {beyond, 0};
    const ovoid_unit_part far = {beyond, 1}, same = {twice, 2};
    const ovoid_placement here = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    ovoid_placement placement = here;
    ovoid_molecule *molecule = NULL;
    (void)state;
    refuse_placed(&some, &here, "part 0 (from 0) has to be ascending numbers");
    refuse_placed(&none, &here, "part 0");
    refuse_placed(&far, &here, "part 0");
    refuse_placed(&same, &here, "part 0");
    placement.part = 1;
    refuse_placed(&all, &placement, "placement 0 (from 0) is of a part that there is not");
    placement = here;
    placement.rotation[0] = 2.0;
    refuse_placed(&all, &placement, "is no rotation and translation");
    placement = here;
    placement.translation[1] = NAN;
    refuse_placed(&all, &placement, "beyond 1e6 angstrom");
    assert_int_equal(
        ovoid_molecule_create_placed(context, two_atoms, 2, NULL, 0, &here, 0, &molecule),
        OVOID_ERROR_EMPTY);
    assert_null(molecule);
}

static void noise_gives_atoms_or_a_message(void **state) {
    (void)state;
    static const char xyzr[] = "2\n17.047 14.099 3.625 1.70\n16.967 12.784 4.338 2.00 1 CA\n";
    unsigned char packed[1024];
    size_t packed_size = gzip(pqr_file, sizeof pqr_file - 1, packed, sizeof packed);
    const struct {
        const void *bytes;
        size_t size;
    } seeds[] = {{pqr_file, sizeof pqr_file - 1}, {xyzr, sizeof xyzr - 1}, {packed, packed_size}};
    static const char *const names[] = {"noise", "noise.pqr", "noise.xyzr"};
    uint64_t seed = 1234567;
    size_t outcomes[OVOID_ERROR_NUMERIC + 1] = {0};
    for (int i = 0; i < 6000; i++) {
        char bytes[4096];
        size_t which = random_bits(&seed) % 3;
        memcpy(bytes, seeds[which].bytes, seeds[which].size);
        size_t size = mutate(bytes, seeds[which].size, sizeof bytes, &seed);
        const char *name = names[random_bits(&seed) % 3];
        ovoid_molecule *molecule = NULL;
        ovoid_status status = read_bytes(name, bytes, size, &molecule);
        outcomes[status]++;
        if (status != OVOID_OK) {
            assert_true(status == OVOID_ERROR_FORMAT || status == OVOID_ERROR_EMPTY);
            assert_null(molecule);
            assert_non_null(strstr(ovoid_context_error(context), path_of(name)));
            for (const char *c = ovoid_context_error(context); *c; c++)
                assert_true((unsigned char)*c >= 0x20 && (unsigned char)*c < 0x7f);
            continue;
        }
        size_t atoms = ovoid_molecule_atoms(molecule);
        assert_true(atoms > 0);
        for (size_t k = 0; k < 4 * atoms; k++) {
            double value = ovoid_molecule_xyzr(molecule)[k];
            assert_true(fabs(value) <= (k % 4 == 3 ? 100 : 1e6) && (k % 4 != 3 || value >= 0));
        }
        ovoid_molecule_destroy(&molecule);
    }
    /* The noise must reach all of it to be worth anything. */
    assert_true(outcomes[OVOID_OK] > 500 && outcomes[OVOID_ERROR_FORMAT] > 500 &&
                outcomes[OVOID_ERROR_EMPTY] > 50);
}

/* ---- real files --------------------------------------------------------------------------- */

/* Compares with what sscanf() makes of the lines whose fields stand apart. Returns how many. */
static size_t compare_with_sscanf(const char *path, const ovoid_molecule *molecule) {
    gzFile file = gzopen(path, "rb");
    assert_non_null(file);
    char line[1024];
    size_t atom = 0, compared = 0;
    bool pqr = !strstr(path, ".xyzr");
    while (gzgets(file, line, sizeof line)) {
        double v[5] = {0};
        int words = 0;
        char *rest = line;
        if (pqr && strncmp(line, "ATOM", 4) && strncmp(line, "HETATM", 6))
            continue;
        for (char *word, *at = line; (word = at + strspn(at, " \t\r\n"), *word);
             at = word + strcspn(word, " \t\r\n"))
            words++;
        for (int i = 0; pqr && i < words - 5; i++) {
            rest += strspn(rest, " \t");
            rest += strcspn(rest, " \t");
        }
        int got = sscanf(rest, "%lf %lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3], &v[4]);
        if (pqr ? got == 5 && words >= 10 : got == 4) {
            expect_atom(molecule, atom, v[0], v[1], v[2], pqr ? v[4] : v[3]);
            compared++;
        }
        atom++;
    }
    gzclose(file);
    assert_int_equal(atom, ovoid_molecule_atoms(molecule));
    return compared;
}

typedef struct known_file {
    const char *name;
    size_t atoms, zero_radius, fused; /* lines whose fields do not stand apart */
} known_file;

static void read_known_file(const char *where, const known_file *known) {
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", where, known->name);
    ovoid_molecule *molecule = NULL;
    if (ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule) != OVOID_OK)
        fail_msg("%s", ovoid_context_error(context));
    ovoid_molecule_counts counts = *ovoid_molecule_read_counts(molecule);
    if (counts.atoms != known->atoms || counts.zero_radius != known->zero_radius || counts.skipped)
        fail_msg("%s: %zu atoms, %zu of radius 0", path, (size_t)counts.atoms,
                 (size_t)counts.zero_radius);
    assert_int_equal(compare_with_sscanf(path, molecule), known->atoms - known->fused);
    ovoid_molecule_destroy(&molecule);
}

/* `fused` is the number of atoms that are left out. */
static void read_known_structure(const char *where, const known_file *known) {
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", where, known->name);
    ovoid_molecule *molecule = NULL;
    if (ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &molecule) != OVOID_OK)
        fail_msg("%s", ovoid_context_error(context));
    const ovoid_molecule_counts counts = *ovoid_molecule_read_counts(molecule);
    if (counts.atoms != known->atoms || counts.skipped != known->fused || counts.guessed_radii ||
        counts.zero_radius != known->zero_radius)
        fail_msg("%s: %zu atoms, %zu skipped, %zu guessed", path, (size_t)counts.atoms,
                 (size_t)counts.skipped, (size_t)counts.guessed_radii);
    ovoid_molecule_destroy(&molecule);
}

static void apbs_examples_are_read(void **state) {
    (void)state;
    static const known_file files[] = {
        {"misc/fas2.pqr", 906, 0, 0},
        {"misc/mache.pqr", 8279, 0, 0},
        {"misc/achbp.pqr", 16090, 0, 0},
        {"helix/Membrane-helix-0.pqr", 317, 134, 0}, /* CR LF */
        {"bem/test_proteins/1a63.pqr", 2065, 0, 0},
        {"bem-binding-energy/test_proteins/1d30.pqr", 796, 0, 0}, /* CR LF and LF */
        {"pbsam-barn_bars/barstar.pqr", 1403, 12, 0},             /* with a chain column */
        {"pbsam-gly/gly_cg.pqr", 34, 0, 0},                       /* chain and number in one word */
        {"pka-lig/bx6_7_apo_apbs.pqr", 3423, 0, 0},               /* long residue names */
        {"born/ion.pqr", 1, 0, 0},
        {"point-pmf/complex-0_1.pqr", 2, 2, 0},
    };
    if (access(APBS "/misc/fas2.pqr", R_OK) != 0) {
        print_message("no " APBS "; install apbs-data\n");
        skip();
    }
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        read_known_file(APBS, &files[i]);
}

static void benchmark_molecules_are_read(void **state) {
    (void)state;
    static const known_file files[] = {
        {"GLY.pqr", 7, 0, 7},
        {"DIALA.pqr", 20, 0, 0},
        {"ADP.pqr", 39, 0, 0},
        {"chignolin_CLN025.pqr", 166, 5, 0},
        {"membrane_helix.pqr", 317, 134, 0},
        {"1MAG.pqr", 552, 0, 0},
        {"1crn.pqr", 642, 10, 0},
        {"1crn_heavy.xyzr", 327, 0, 0},
        {"FAS2.pqr", 906, 0, 0},
        {"1aki.pqr", 1960, 20, 0},
        {"1a63.pqr", 2065, 0, 0},
        {"actin.pqr", 5877, 0, 0},
        {"AChE.pqr", 8279, 0, 0},
        {"6xm4.xyzr.gz", 48519, 0, 0},
        {"1aon.pqr.gz", 120120, 868, 0},
        {"1ihm_asu.pqr.gz", 22281, 259, 0},
        {"1m4x_asu.pqr.gz", 19089, 273, 0},
    };
    /* Atoms of the first model without waters, as gemmi counts them. */
    static const known_file structures[] = {
        {"1CRN.pdb", 327, 0, 0},        {"1UBQ.pdb", 602, 0, 58},
        {"1AON.pdb.gz", 58870, 0, 0},   {"1F2N.pdb.gz", 4531, 0, 199},
        {"1L2Y.pdb.gz", 304, 0, 11248}, {"1FAS.cif", 468, 0, 107},
        {"1EMA.cif", 1771, 0, 95},      {"4V5A_70S_1.cif.gz", 145243, 0, 0}};
    const char *where = getenv("OVOID_MOLECULES");
    if (!where || !*where)
        where = OVOID_MOLECULES_DEFAULT;
    if (access(where, R_OK) != 0) {
        print_message("no molecules in %s: set OVOID_MOLECULES\n", where);
        skip();
    }
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++)
        read_known_file(where, &files[i]);
    for (size_t i = 0; i < sizeof structures / sizeof structures[0]; i++)
        read_known_structure(where, &structures[i]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_have_their_grammar),
        cmocka_unit_test(numbers_are_rounded_as_the_c_library_does),
        cmocka_unit_test(pqr_lines_are_read),
        cmocka_unit_test(pqr_errors_say_where),
        cmocka_unit_test(pqr_records_are_told_apart),
        cmocka_unit_test(only_the_first_model_counts),
        cmocka_unit_test(doubled_atoms_are_counted),
        cmocka_unit_test(xyzr_lines_are_read),
        cmocka_unit_test(xyzr_errors_say_where),
        cmocka_unit_test(formats_are_recognised),
        cmocka_unit_test(other_formats_are_named),
        cmocka_unit_test(pdb_files_are_not_taken_for_pqr),
        cmocka_unit_test(line_endings_do_not_matter),
        cmocka_unit_test(long_files_are_read_in_pieces),
        cmocka_unit_test(what_is_no_text_is_refused),
        cmocka_unit_test(empty_files_say_what_was_seen),
        cmocka_unit_test(files_that_cannot_be_read),
        cmocka_unit_test(gzip_is_recognised_by_content),
        cmocka_unit_test(damaged_gzip_is_an_error),
        cmocka_unit_test(damage_outweighs_the_line_it_spoils),
        cmocka_unit_test(standard_input_is_read),
        cmocka_unit_test(the_locale_does_not_matter),
        cmocka_unit_test(molecules_are_made_from_arrays),
        cmocka_unit_test(assemblies_are_made_from_arrays),
        cmocka_unit_test(assemblies_that_are_none_are_refused),
        cmocka_unit_test(noise_gives_atoms_or_a_message),
        cmocka_unit_test(apbs_examples_are_read),
        cmocka_unit_test(benchmark_molecules_are_read),
    };
    return cmocka_run_group_tests(tests, begin, finish);
}
