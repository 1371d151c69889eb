/*
 * check_measures FIT REPORT [KEY=NUMBER]...: holds a report of measures to what it promises, and to
 * what the report of a fit (unless that is "-") says of the same surfaces. KEY is one of the
 * report, or `rows` or `measured`: the number of rows, and of those with measures. Says what is
 * wrong.
 */
#include <cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int problems;

static cJSON *read_json(const char *path) {
    FILE *stream = fopen(path, "rb");
    char *text = calloc(1, 1 << 20);
    if (!stream || !text || fread(text, 1, (1 << 20) - 1, stream) == 0) {
        printf("cannot read %s\n", path);
        exit(1);
    }
    fclose(stream);
    cJSON *json = cJSON_Parse(text);
    free(text);
    if (!json) {
        printf("%s is not JSON\n", path);
        exit(1);
    }
    return json;
}

static double number(const cJSON *object, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, key);
    if (cJSON_IsNumber(item) && isfinite(item->valuedouble) && item->valuedouble >= 0.0)
        return item->valuedouble;
    printf("'%s' is no number from 0\n", key);
    problems++;
    return NAN;
}

static const cJSON *object(const cJSON *report, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(report, key);
    if (cJSON_IsObject(item))
        return item;
    printf("'%s' is no object\n", key);
    exit(1);
}

static void expect(int good, const char *what, double found, double wanted) {
    if (good)
        return;
    printf("%s is %.9g, not %.9g\n", what, found, wanted);
    problems++;
}

static const char *const pairs[] = {"area", "volume", "area_outer", "volume_outer"};
static const char *const counts[] = {"components", "components_outer"};
static const char *const distances[] = {
    "hausdorff",           "mean_distance",      "rms_distance", "hausdorff_outer",
    "mean_distance_outer", "rms_distance_outer", "mesh_spacing"};

static void check_row(const cJSON *row) {
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        const cJSON *pair = object(row, pairs[i]);
        double original = number(pair, "original"), sparse = number(pair, "sparse");
        double error = fabs(sparse - original) / original;
        expect(original > 0.0 && sparse > 0.0, pairs[i], original, 1.0);
        expect(fabs(number(pair, "error") - error) < 1e-9, "an error", number(pair, "error"),
               error);
    }
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        expect(number(object(row, counts[i]), "original") >= 1, counts[i], 0, 1);
        expect(number(object(row, counts[i]), "sparse") >= 1, counts[i], 0, 1);
    }
    for (size_t i = 0; i < sizeof distances / sizeof *distances; i++)
        number(row, distances[i]);
    expect(number(row, "mean_distance") <= number(row, "rms_distance") &&
               number(row, "rms_distance") <= number(row, "hausdorff"),
           "mean <= rms <= largest distance: that", 0, 1);
    expect(number(row, "mean_distance") > 0.0, "a mean distance", 0, 1);
}

static void close_to(const char *what, double found, double wanted) {
    expect(fabs(found - wanted) <= 1e-4 * fabs(wanted), what, found, wanted);
}

/* A model's file has nine digits: nearly the same surface. */
static void compare(const cJSON *fit, const cJSON *report) {
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        const cJSON *a = object(fit, pairs[i]), *b = object(report, pairs[i]);
        close_to(pairs[i], number(b, "original"), number(a, "original"));
        close_to(pairs[i], number(b, "sparse"), number(a, "sparse"));
    }
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        close_to(counts[i], number(object(report, counts[i]), "sparse"),
                 number(object(fit, counts[i]), "sparse"));
    for (size_t i = 0; i < sizeof distances / sizeof *distances; i++)
        expect(fabs(number(report, distances[i]) - number(fit, distances[i])) < 1e-3, distances[i],
               number(report, distances[i]), number(fit, distances[i]));
    expect(number(object(fit, "seconds"), "measure") > 0.0, "seconds.measure", 0, 1);
}

int main(int argc, char **argv) {
    if (argc < 3)
        return 2;
    cJSON *report = read_json(argv[2]);
    const cJSON *rows = cJSON_GetObjectItemCaseSensitive(report, "rows"), *row;
    int measured = 0;
    cJSON_ArrayForEach(row, rows) {
        number(row, "isovalue");
        if (cJSON_IsString(cJSON_GetObjectItemCaseSensitive(row, "error")))
            continue;
        check_row(row);
        measured++;
    }
    if (cJSON_GetArraySize(rows) == 1)
        check_row(report);
    if (strcmp(argv[1], "-") != 0) {
        cJSON *fit = read_json(argv[1]);
        check_row(fit);
        compare(fit, report);
        cJSON_Delete(fit);
    }
    for (int i = 3; i < argc; i++) {
        char *equals = strchr(argv[i], '=');
        if (!equals)
            return 2;
        *equals = '\0';
        double wanted = strtod(equals + 1, NULL);
        double found = strcmp(argv[i], "rows") == 0       ? cJSON_GetArraySize(rows)
                       : strcmp(argv[i], "measured") == 0 ? measured
                                                          : number(report, argv[i]);
        expect(found == wanted, argv[i], found, wanted);
    }
    cJSON_Delete(report);
    return problems ? 1 : 0;
}
