/*
 * check_report REPORT MODEL TRACE [KEY=NUMBER]...: holds the report of a fit to what it promises
 * and to the model and the trace of the same run. KEY may be a path with a dot. Says what is wrong.
 */
#include <cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int problems;

static void expect(int good, const char *what, double found, double wanted) {
    if (good)
        return;
    printf("%s is %.9g, not %.9g\n", what, found, wanted);
    problems++;
}

static char *read_file(const char *path) {
    FILE *stream = fopen(path, "rb");
    char *text = calloc(1, 1 << 22);
    if (!stream || !text || fread(text, 1, (1 << 22) - 1, stream) == 0) {
        printf("cannot read %s\n", path);
        exit(1);
    }
    fclose(stream);
    return text;
}

/* The item at "a.b", NULL if there is none. */
static const cJSON *find(const cJSON *report, const char *path) {
    char name[64];
    const char *dot = strchr(path, '.');
    snprintf(name, sizeof name, "%.*s", (int)strcspn(path, "."), path);
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(report, name);
    return item && dot ? find(item, dot + 1) : item;
}

static double number(const cJSON *report, const char *path) {
    const cJSON *item = find(report, path);
    if (cJSON_IsNumber(item) && isfinite(item->valuedouble))
        return item->valuedouble;
    printf("'%s' is no number of the report\n", path);
    problems++;
    return NAN;
}

static const char *const numbers[] = {"atoms",
                                      "atoms_skipped",
                                      "atoms_skipped_models",
                                      "atoms_skipped_altlocs",
                                      "zero_radius_atoms",
                                      "ellipsoids",
                                      "sparse_ratio",
                                      "decay",
                                      "isovalue",
                                      "spacing",
                                      "padding",
                                      "points",
                                      "rms_error",
                                      "max_error",
                                      "iterations",
                                      "options.iterations",
                                      "options.sparse_iterations",
                                      "options.epsilon",
                                      "options.max_error",
                                      "options.prune_below",
                                      "options.prune_every",
                                      "options.armijo",
                                      "options.shrink",
                                      "options.grow",
                                      "options.max_backtracks",
                                      "area.original",
                                      "area.sparse",
                                      "area.error",
                                      "volume.original",
                                      "volume.sparse",
                                      "volume.error",
                                      "hausdorff",
                                      "mean_distance",
                                      "hausdorff_outer",
                                      "components.original",
                                      "components.sparse",
                                      "mesh_spacing",
                                      "seconds.device",
                                      "seconds.read",
                                      "seconds.sample",
                                      "seconds.fit",
                                      "seconds.measure",
                                      "seconds.write",
                                      "seconds.total",
                                      "profile.lists_seconds",
                                      "profile.field_seconds",
                                      "profile.moments_seconds",
                                      "profile.host_seconds",
                                      "profile.list_builds",
                                      "profile.field_passes",
                                      "profile.moments_passes",
                                      "profile.launches",
                                      "opencl.compute_units"};
static const char *const texts[] = {
    "version", "input",           "output",        "options.kernel", "options.first_step", "method",
    "device",  "opencl.platform", "opencl.vendor", "opencl.driver",  "opencl.version"};

static void check_keys(const cJSON *report) {
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (number(report, numbers[i]) < 0.0) {
            printf("'%s' is negative\n", numbers[i]);
            problems++;
        }
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        const cJSON *item = find(report, texts[i]);
        if (!cJSON_IsString(item) || !item->valuestring[0]) {
            printf("'%s' is no text of the report\n", texts[i]);
            problems++;
        }
    }
    double total = number(report, "seconds.total");
    double parts = number(report, "seconds.device") + number(report, "seconds.read") +
                   number(report, "seconds.sample") + number(report, "seconds.fit") +
                   number(report, "seconds.measure") + number(report, "seconds.write");
    expect(parts <= total + 1e-5, "the sum of seconds", parts, total);
    expect(number(report, "profile.field_passes") >= number(report, "iterations"), "field_passes",
           number(report, "profile.field_passes"), number(report, "iterations"));
}

static size_t count_rows(char *text, const char *skip) {
    size_t rows = 0;
    for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n"))
        rows += strncmp(line, skip, strlen(skip)) != 0;
    return rows;
}

static void check_model(const cJSON *report, const char *path) {
    char *text = read_file(path);
    double ellipsoids = number(report, "ellipsoids");
    double ratio = ellipsoids / number(report, "atoms");
    double rows = (double)count_rows(text, "#");
    expect(ellipsoids == rows, "ellipsoids", ellipsoids, rows);
    expect(fabs(number(report, "sparse_ratio") - ratio) < 1e-12, "sparse_ratio",
           number(report, "sparse_ratio"), ratio);
    free(text);
}

/* One row per iteration, numbered from 1; the last one ends where the report begins. */
static void check_trace(const cJSON *report, const char *path) {
    static const char header[] = "iteration,E_s,E_l1,w_s,w_l,objective,max_error,ellipsoids,step,"
                                 "seconds,stage";
    char *text = read_file(path), stage[32] = "";
    double v[10] = {0}, before = -1.0;
    unsigned rows = 0;
    char *line = strtok(text, "\n");
    if (!line || strcmp(line, header) != 0) {
        printf("the trace has another header\n");
        problems++;
    }
    while ((line = strtok(NULL, "\n")) != NULL) {
        int got = sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%31s", &v[0], &v[1], &v[2],
                         &v[3], &v[4], &v[5], &v[6], &v[7], &v[8], &v[9], stage);
        rows++;
        expect(got == 11, "the number of columns", got, 11);
        expect(v[0] == rows, "an iteration's number", v[0], rows);
        double objective = v[1] * v[3] + v[2] * v[4];
        expect(fabs(v[5] - objective) <= 1e-6 * fabs(objective), "an objective", v[5], objective);
        expect(v[9] >= before, "an iteration's time", v[9], before);
        before = v[9];
    }
    double rms = sqrt(v[1] / number(report, "points"));
    expect(rows == number(report, "iterations"), "iterations", number(report, "iterations"), rows);
    expect(v[7] == number(report, "ellipsoids"), "the trace's last ellipsoids", v[7],
           number(report, "ellipsoids"));
    expect(fabs(rms - number(report, "rms_error")) <= 1e-6 * rms, "rms_error",
           number(report, "rms_error"), rms);
    expect(fabs(v[6] - number(report, "max_error")) <= 1e-6 * v[6], "max_error",
           number(report, "max_error"), v[6]);
    expect(strcmp(stage, "accuracy") == 0, "the last stage is accuracy: that", 0, 1);
    free(text);
}

int main(int argc, char **argv) {
    if (argc < 4)
        return 2;
    char *text = read_file(argv[1]);
    cJSON *report = cJSON_Parse(text);
    if (!report) {
        printf("%s is not JSON\n", argv[1]);
        return 1;
    }
    check_keys(report);
    check_model(report, argv[2]);
    check_trace(report, argv[3]);
    for (int i = 4; i < argc; i++) {
        char *equals = strchr(argv[i], '=');
        if (!equals)
            return 2;
        *equals = '\0';
        double wanted = strtod(equals + 1, NULL);
        expect(number(report, argv[i]) == wanted, argv[i], number(report, argv[i]), wanted);
    }
    cJSON_Delete(report);
    free(text);
    return problems ? 1 : 0;
}
