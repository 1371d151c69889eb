/*
 * check_report REPORT MODEL TRACE [KEY=VALUE]...: holds the report of a fit to what it promises
 * and to the models and the trace of the same run. KEY may be a path with a dot; of an array, VALUE
 * is the length. Says what is wrong.
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

/* Every report has these; those with a method alone follow. */
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
                                      "iterations",
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
                                      "opencl.compute_units",
                                      "profile.launches",
                                      "profile.blocking_reads",
                                      "profile.blocking_writes",
                                      "profile.bytes_to_device",
                                      "profile.bytes_from_device",
                                      "profile.buffers_created",
                                      "profile.kernels_created"};
static const char *const texts[] = {"version",       "input",         "output",
                                    "method",        "device",        "opencl.platform",
                                    "opencl.vendor", "opencl.driver", "opencl.version"};
static const char *const l1_numbers[] = {"rms_error",
                                         "max_error",
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
                                         "profile.lists_seconds",
                                         "profile.field_seconds",
                                         "profile.moments_seconds",
                                         "profile.host_seconds",
                                         "profile.list_builds",
                                         "profile.field_passes",
                                         "profile.moments_passes"};
static const char *const l1_texts[] = {"options.kernel", "options.first_step"};
static const char *const adaptive_numbers[] = {"solver_iterations", "options.effort",
                                               "options.steps", "goal.asked", "goal.distance"};
static const char *const adaptive_texts[] = {"goal.name"};

#define LENGTH(array) (sizeof(array) / sizeof *(array))

static void check_numbers(const cJSON *report, const char *const *paths, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (number(report, paths[i]) < 0.0) {
            printf("'%s' is negative\n", paths[i]);
            problems++;
        }
}

static void check_texts(const cJSON *report, const char *const *paths, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const cJSON *item = find(report, paths[i]);
        if (!cJSON_IsString(item) || !item->valuestring[0]) {
            printf("'%s' is no text of the report\n", paths[i]);
            problems++;
        }
    }
}

/* What another method would have reported, or measured. */
static void check_absent(const cJSON *report, const char *const *paths, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (find(report, paths[i])) {
            printf("'%s' is in the report\n", paths[i]);
            problems++;
        }
}

static int is_adaptive(const cJSON *report) {
    const cJSON *method = find(report, "method");
    return cJSON_IsString(method) && strcmp(method->valuestring, "adaptive") == 0;
}

/* What lies between vertices is bounded, a little above where they are, but for large surfaces. */
static void check_bound(const cJSON *report) {
    if (cJSON_IsNull(find(report, "deviation_bound")))
        return;
    const double deviation = number(report, "deviation"), bound = number(report, "deviation_bound");
    expect(bound >= deviation && bound <= 1.5 * deviation + 0.5, "deviation_bound", bound,
           deviation);
}

/* What was reached is what was measured. */
static void check_goal(const cJSON *report) {
    const cJSON *name = find(report, "goal.name"), *reached = find(report, "goal.reached");
    const double asked = number(report, "goal.asked"), distance = number(report, "goal.distance");
    expect(cJSON_IsBool(reached), "goal.reached is a truth value: that", 0, 1);
    expect(fabs(distance - number(report, "deviation")) <= 1e-3 * distance + 1e-4, "goal.distance",
           distance, number(report, "deviation"));
    if (!cJSON_IsString(name))
        return;
    if (strcmp(name->valuestring, "tolerance") == 0) {
        expect(cJSON_IsTrue(reached) == (distance <= asked), "goal.reached", cJSON_IsTrue(reached),
               distance <= asked);
        if (cJSON_IsTrue(reached) && number(report, "parts") == 1.0 &&
            asked >= 0.4 * number(report, "mesh_spacing")) /* else meshes are too coarse for that */
            expect(number(report, "deviation_bound") <= asked, "deviation_bound",
                   number(report, "deviation_bound"), asked);
    } else if (strcmp(name->valuestring, "ellipsoids") == 0)
        expect(number(report, "ellipsoids") == asked, "ellipsoids", number(report, "ellipsoids"),
               asked);
    else
        expect(fabs(number(report, "ellipsoids") - asked * number(report, "atoms")) <= 0.5 ||
                   number(report, "ellipsoids") == 1.0,
               "ellipsoids", number(report, "ellipsoids"), asked * number(report, "atoms"));
}

static void check_keys(const cJSON *report) {
    check_numbers(report, numbers, LENGTH(numbers));
    check_texts(report, texts, LENGTH(texts));
    double total = number(report, "seconds.total");
    double parts = number(report, "seconds.device") + number(report, "seconds.read") +
                   number(report, "seconds.sample") + number(report, "seconds.fit") +
                   number(report, "seconds.measure") + number(report, "seconds.write");
    expect(parts <= total + 1e-5, "the sum of seconds", parts, total);
    if (is_adaptive(report)) {
        check_numbers(report, adaptive_numbers, LENGTH(adaptive_numbers));
        check_texts(report, adaptive_texts, LENGTH(adaptive_texts));
        check_absent(report, l1_numbers, LENGTH(l1_numbers));
        check_absent(report, l1_texts, LENGTH(l1_texts));
        check_goal(report);
        check_bound(report);
        return;
    }
    check_numbers(report, l1_numbers, LENGTH(l1_numbers));
    check_texts(report, l1_texts, LENGTH(l1_texts));
    check_absent(report, adaptive_numbers, LENGTH(adaptive_numbers));
    check_absent(report, adaptive_texts, LENGTH(adaptive_texts));
    expect(number(report, "profile.field_passes") >= number(report, "iterations"), "field_passes",
           number(report, "profile.field_passes"), number(report, "iterations"));
}

/* A kernel's number, or null as `unknown`. */
static double kernel_number(const cJSON *kernel, const char *key, double unknown) {
    return cJSON_IsNull(find(kernel, key)) ? unknown : number(kernel, key);
}

/* Each kernel once, the longest first, and as many launches as the fit counted: of method l1 it
 * leaves out those of sampling, and the kernels are those of all levels. */
static void check_kernels(const cJSON *report) {
    const cJSON *kernels = find(report, "kernels"), *kernel;
    const double wall = number(report, "seconds.total");
    const double counted = number(report, "profile.launches");
    double launches = 0.0, share = 0.0, before = INFINITY;
    if (!kernels)
        return;
    cJSON_ArrayForEach(kernel, kernels) {
        const cJSON *name = find(kernel, "name");
        const double seconds = kernel_number(kernel, "seconds", 0.0);
        if (!cJSON_IsString(name)) {
            printf("a kernel has no name\n");
            problems++;
            continue;
        }
        for (const cJSON *other = kernel->next; other; other = other->next)
            if (strcmp(find(other, "name")->valuestring, name->valuestring) == 0) {
                printf("the kernel %s is there twice\n", name->valuestring);
                problems++;
            }
        expect(number(kernel, "launches") >= 1.0, "launches of a kernel",
               number(kernel, "launches"), 1.0);
        expect(seconds >= 0.0 && seconds <= before, "seconds of a kernel", seconds, before);
        expect(kernel_number(kernel, "share", 0.0) >= seconds / wall - 1e-6, "a share",
               kernel_number(kernel, "share", 0.0), seconds / wall);
        launches += number(kernel, "launches");
        share += kernel_number(kernel, "share", 0.0);
        before = seconds;
    }
    expect(share <= 1.0, "the sum of shares", share, 1.0);
    expect(number(report, "profile.bytes_from_device") > number(report, "profile.blocking_reads"),
           "profile.bytes_from_device", number(report, "profile.bytes_from_device"),
           number(report, "profile.blocking_reads"));
    expect(number(report, "profile.kernels_created") < counted, "profile.kernels_created",
           number(report, "profile.kernels_created"), counted);
    if (is_adaptive(report) && !find(report, "levels"))
        expect(launches == counted, "the sum of launches", launches, counted);
    else
        expect(launches > counted, "the sum of launches", launches, counted);
}

static size_t count_rows(char *text, const char *skip) {
    size_t rows = 0;
    for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n"))
        rows += strncmp(line, skip, strlen(skip)) != 0;
    return rows;
}

static void check_model(const cJSON *report, const char *path, double atoms) {
    char *text = read_file(path);
    double ellipsoids = number(report, "ellipsoids");
    double ratio = ellipsoids / atoms;
    double rows = (double)count_rows(text, "#");
    expect(ellipsoids == rows, "ellipsoids", ellipsoids, rows);
    expect(fabs(number(report, "sparse_ratio") - ratio) < 1e-12, "sparse_ratio",
           number(report, "sparse_ratio"), ratio);
    free(text);
}

/* A header, then one row per iteration and level, both numbered from 1. */
static void check_adaptive_trace(const cJSON *report, const char *path) {
    static const char header[] = "level,step,ellipsoids,points,objective,seconds,stage";
    char *text = read_file(path), stage[32] = "";
    double v[6] = {0}, level = 1.0, step = 0.0, steps = 0.0, before = -1.0;
    const cJSON *levels = find(report, "levels");
    char *line = strtok(text, "\n");
    if (!line || strcmp(line, header) != 0) {
        printf("the trace has another header\n");
        problems++;
    }
    while ((line = strtok(NULL, "\n")) != NULL) {
        int got = sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%31s", &v[0], &v[1], &v[2], &v[3], &v[4],
                         &v[5], stage);
        expect(got == 7, "the number of columns", got, 7);
        if (v[0] != level) {
            expect(v[0] == level + 1.0, "a level", v[0], level + 1.0);
            level = v[0];
            step = 0.0;
            before = -1.0;
        }
        step += 1.0;
        expect(v[1] == step, "a step's number", v[1], step);
        expect(v[3] == number(report, "points"), "points", v[3], number(report, "points"));
        expect(v[4] > 0.0 && v[2] >= 1.0, "an objective", v[4], 1.0);
        expect(v[5] >= before, "a step's time", v[5], before);
        before = v[5];
        if (level == 1.0)
            steps = step;
    }
    expect(steps == number(report, "iterations"), "iterations", number(report, "iterations"),
           steps);
    expect(!levels || level <= cJSON_GetArraySize(levels), "the last level", level,
           cJSON_GetArraySize(levels));
    free(text);
}

/* A row per level, each with half the ellipsoids of the one before and a file that holds them. */
static void check_levels(const cJSON *report) {
    const cJSON *levels = find(report, "levels"), *level;
    double before = 0.0, at = 0.0;
    cJSON_ArrayForEach(level, levels) {
        const cJSON *output = find(level, "output");
        const double ellipsoids = number(level, "ellipsoids");
        at += 1.0;
        expect(number(level, "level") == at, "a level", number(level, "level"), at);
        const double wanted = at > 1.0 ? floor(before / 2.0) : number(report, "ellipsoids");
        expect(ellipsoids == wanted, "a level's ellipsoids", ellipsoids, wanted);
        expect(fabs(number(level, "distance") - number(level, "deviation")) < 1e-3,
               "a level's distance", number(level, "distance"), number(level, "deviation"));
        number(level, "area.error");
        number(level, "volume.error");
        check_model(level, cJSON_IsString(output) ? output->valuestring : "",
                    number(report, "atoms"));
        before = ellipsoids;
    }
}

/* One row per iteration, numbered from 1; the last one ends where the report begins. */
static void check_l1_trace(const cJSON *report, const char *path) {
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
    check_model(report, argv[2], number(report, "atoms"));
    check_levels(report);
    check_kernels(report);
    if (is_adaptive(report))
        check_adaptive_trace(report, argv[3]);
    else
        check_l1_trace(report, argv[3]);
    for (int i = 4; i < argc; i++) {
        char *equals = strchr(argv[i], '=');
        if (!equals)
            return 2;
        *equals = '\0';
        char *end;
        double wanted = strtod(equals + 1, &end);
        const cJSON *item = find(report, argv[i]);
        if (*end || end == equals + 1) { /* a text or a truth value */
            const char *text_of = cJSON_IsTrue(item)     ? "true"
                                  : cJSON_IsFalse(item)  ? "false"
                                  : cJSON_IsString(item) ? item->valuestring
                                                         : "neither text nor truth value";
            if (strcmp(text_of, equals + 1) != 0) {
                printf("%s is %s, not %s\n", argv[i], text_of, equals + 1);
                problems++;
            }
            continue;
        }
        if (cJSON_IsArray(item)) { /* its length */
            expect(cJSON_GetArraySize(item) == wanted, argv[i], cJSON_GetArraySize(item), wanted);
            continue;
        }
        expect(number(report, argv[i]) == wanted, argv[i], number(report, argv[i]), wanted);
    }
    cJSON_Delete(report);
    free(text);
    return problems ? 1 : 0;
}
