/*
 * bench/constants: what each number that steers a method does (host/fit/adaptive/constants.def,
 * host/fit/l1/constants.def): it is halved and doubled, one at a time, in fits of several kinds.
 *
 *   constants [--only PREFIX]... [--record FILE] MOLECULE...
 *
 * Prints CSV: of every fit what it came to and what it took, counted, since that is the same on
 * every run; deviation inf where it came to nothing. --record goes on with a record that ended
 * early: fits that the file has are left out, and so is the header. The fits:
 *
 *   tolerance  to 0.5 angstrom
 *   number     half as many ellipsoids as that takes, with effort 0
 *   sharpen    the same with effort 1
 *   effort     the same with effort 2
 *   warm       from the model within the tolerance to 3/4 and to 3/2 of its ellipsoids, together,
 *              with effort 0
 *   frame      to the tolerance, and in the same session to other coordinates of the atoms, which
 *              alone counts
 *   l1         300 iterations of method l1
 *
 * A constant takes part where it is used. The rest of the library is as it is; this program
 * compiles the room `fit` for itself, with numbers that can be changed.
 */
#include "fit/adaptive/constants.h"
#include "fit/l1/constants.h"
#include "measure/judge.h"
#include "ovoid/ovoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

ov_constants ov_tuned = {
#define OV_REAL(name, value) .name = (value),
#define OV_COUNT(name, value) .name = (value),
#include "fit/adaptive/constants.def"
};
ov_l1_constants ov_l1_tuned = {
#include "fit/l1/constants.def"
#undef OV_REAL
#undef OV_COUNT
};

typedef struct constant {
    const char *name;
    double *real; /* either this */
    uint32_t *count;
} constant;

static const constant constants[] = {
#define OV_REAL(name, value) {#name, &ov_tuned.name, NULL},
#define OV_COUNT(name, value) {#name, NULL, &ov_tuned.name},
#include "fit/adaptive/constants.def"
#undef OV_REAL
#undef OV_COUNT
#define OV_REAL(name, value) {"l1_" #name, &ov_l1_tuned.name, NULL},
#define OV_COUNT(name, value) {"l1_" #name, NULL, &ov_l1_tuned.name},
#include "fit/l1/constants.def"
#undef OV_REAL
#undef OV_COUNT
};
enum { CONSTANTS = sizeof constants / sizeof *constants };

/* ---- counting -------------------------------------------------------------------------------- */

static uint64_t judgements;

ovoid_status __real_ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   ov_judgement *judgement);
ovoid_status __wrap_ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   ov_judgement *judgement);
ovoid_status __wrap_ov_judge_model(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   ov_judgement *judgement) {
    ++judgements;
    return __real_ov_judge_model(judge, quadrics, count, judgement);
}

ovoid_status __real_ov_judge_volume(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                    double *ratio);
ovoid_status __wrap_ov_judge_volume(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                    double *ratio);
ovoid_status __wrap_ov_judge_volume(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                    double *ratio) {
    ++judgements;
    return __real_ov_judge_volume(judge, quadrics, count, ratio);
}

ovoid_status __real_ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   double least, double apart, size_t most, ov_judgement *judgement,
                                   ov_spot **spots, size_t *spot_count);
ovoid_status __wrap_ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   double least, double apart, size_t most, ov_judgement *judgement,
                                   ov_spot **spots, size_t *spot_count);
ovoid_status __wrap_ov_judge_spots(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                   double least, double apart, size_t most, ov_judgement *judgement,
                                   ov_spot **spots, size_t *spot_count) {
    ++judgements;
    return __real_ov_judge_spots(judge, quadrics, count, least, apart, most, judgement, spots,
                                 spot_count);
}

ovoid_status __real_ov_judge_spots_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                        double least, double apart, size_t most,
                                        ov_judgement *judgement, ov_spot **spots,
                                        size_t *spot_count, bool *whole);
ovoid_status __wrap_ov_judge_spots_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                        double least, double apart, size_t most,
                                        ov_judgement *judgement, ov_spot **spots,
                                        size_t *spot_count, bool *whole);
ovoid_status __wrap_ov_judge_spots_near(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                                        double least, double apart, size_t most,
                                        ov_judgement *judgement, ov_spot **spots,
                                        size_t *spot_count, bool *whole) {
    ++judgements;
    return __real_ov_judge_spots_near(judge, quadrics, count, least, apart, most, judgement, spots,
                                      spot_count, whole);
}

/* ---- fits ------------------------------------------------------------------------------------ */

typedef struct subject {
    ovoid_context *context;
    const char *name;
    ovoid_molecule *molecule;
    ovoid_field *field; /* of the molecule, and where its atoms have moved to */
    ovoid_field *moved_field;
    double *moved;
    ovoid_model *model; /* within the tolerance, by the numbers as they are */
} subject;

/* What was recorded before, or NULL. */
static char *record;

static void read_record(const char *path) {
    FILE *const file = fopen(path, "rb");
    size_t length = 0;
    if (!file) {
        perror(path);
        exit(1);
    }
    for (size_t more = 1; more > 0; length += more) {
        record = realloc(record, length + (1 << 16) + 1);
        if (!record)
            exit(1);
        more = fread(record + length, 1, 1 << 16, file);
    }
    fclose(file);
    record[length] = '\0';
    if (length > 0 && record[length - 1] != '\n') {
        fprintf(stderr, "constants: %s ends within a line, which is to be taken out\n", path);
        exit(1);
    }
}

static bool is_recorded(const char *begin) {
    const size_t length = strlen(begin);
    for (const char *line = record; line && *line; line = strchr(line, '\n') + 1)
        if (strncmp(line, begin, length) == 0)
            return true;
    return false;
}

typedef struct sums {
    uint64_t ellipsoids, steps, iterations, judgements, launches;
    double distance, area_error, volume_error; /* the largest */
} sums;

static void stop(const subject *s, ovoid_status status) {
    if (status == OVOID_OK)
        return;
    fprintf(stderr, "constants: %s: %s\n", s->name ? s->name : "", ovoid_context_error(s->context));
    exit(1);
}

static void add(const subject *s, ovoid_field *original, const ovoid_model *model,
                const ovoid_fit_result *result, sums *sum) {
    ovoid_field *field = NULL;
    ovoid_measure_options how;
    ovoid_measures m;
    ovoid_measure_options_init(&how, sizeof how);
    ovoid_measures_init(&m, sizeof m);
    stop(s, ovoid_field_of_model(s->context, model, &field));
    stop(s, ovoid_measure(s->context, original, field, &how, &m));
    ovoid_field_destroy(&field);
    sum->ellipsoids += result->ellipsoids;
    sum->steps += result->iterations;
    sum->iterations += result->method == OVOID_METHOD_L1 ? result->l1.list_builds
                                                         : result->adaptive.solver_iterations;
    sum->launches += result->counts[OVOID_COUNT_LAUNCHES];
    sum->distance = fmax(sum->distance, m.deviation);
    sum->area_error = fmax(sum->area_error, m.area.error);
    sum->volume_error = fmax(sum->volume_error, m.volume.error);
}

/* A search that goes on and on, as some numbers make it, is given up. */
static bool go_on(const ovoid_progress *progress, void *user) {
    (void)user;
    return progress->iteration < 10000;
}

/* One fit by a fitter, whose model goes to *kept, if that is asked for. */
static void reach(const subject *s, ovoid_fitter *fitter, ovoid_field *original,
                  const ovoid_fit_options *options, ovoid_model **kept, sums *sum) {
    ovoid_model *model = NULL;
    ovoid_fit_result result;
    ovoid_fit_result_init(&result, sizeof result);
    judgements = 0;
    ovoid_context_on_progress(s->context, go_on, NULL);
    ovoid_fitter_reach(s->context, fitter, options, &model, &result);
    ovoid_context_on_progress(s->context, NULL, NULL);
    sum->judgements += judgements;
    if (!model) { /* given up, or a number that makes no sense */
        sum->distance = INFINITY;
        return;
    }
    add(s, original, model, &result, sum);
    if (kept)
        *kept = model;
    else
        ovoid_model_destroy(&model);
}

static ovoid_fit_options number(const subject *s, double share) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.ellipsoids =
        (uint32_t)fmax(1.0, round(share * (double)ovoid_model_size(s->model)));
    if (options.adaptive.ellipsoids > ovoid_molecule_atoms(s->molecule))
        options.adaptive.ellipsoids = (uint32_t)ovoid_molecule_atoms(s->molecule);
    return options;
}

typedef enum fit_kind { TOLERANCE, NUMBER, SHARPEN, EFFORT, WARM, FRAME, L1, KINDS } fit_kind;
static const char *const kind_names[KINDS] = {"tolerance", "number", "sharpen", "effort",
                                              "warm",      "frame",  "l1"};

static void fit(subject *s, ovoid_fitter *fitter, fit_kind kind, sums *sum) {
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    switch (kind) {
    case TOLERANCE:
        reach(s, fitter, s->field, &options, s->model ? NULL : &s->model, sum);
        return;
    case NUMBER:
    case SHARPEN:
    case EFFORT:
        options = number(s, 0.5);
        options.adaptive.effort = kind - NUMBER;
        reach(s, fitter, s->field, &options, NULL, sum);
        return;
    case WARM:
        for (int k = 0; k < 2; ++k) {
            options = number(s, k == 0 ? 0.75 : 1.5);
            options.adaptive.effort = 0;
            stop(s, ovoid_fitter_start_from(s->context, fitter, s->model));
            reach(s, fitter, s->field, &options, NULL, sum);
        }
        return;
    case FRAME:
        reach(s, fitter, s->field, &options, NULL, &(sums){0});
        stop(s, ovoid_fitter_move(s->context, fitter, s->moved));
        reach(s, fitter, s->moved_field, &options, NULL, sum);
        return;
    case L1:
        options.method = OVOID_METHOD_L1;
        options.l1.iterations = 300;
        options.l1.sparse_iterations = 225;
        reach(s, fitter, s->field, &options, NULL, sum);
        return;
    case KINDS:
        break;
    }
}

static void run(subject *s, fit_kind kind, const char *what, const char *value,
                const char *change) {
    sums sum = {0};
    char begin[256];
    snprintf(begin, sizeof begin, "%s,%s,%s,%s,%s,", what, value, change, s->name,
             kind_names[kind]);
    const bool recorded = is_recorded(begin);
    if (recorded && (kind != TOLERANCE || s->model)) /* the first fit makes the model for others */
        return;
    ovoid_fitter *fitter = NULL;
    ovoid_fit_options options;
    ovoid_fit_options_init(&options, sizeof options);
    stop(s, ovoid_fitter_create(s->context, s->molecule, &options, &fitter));
    fit(s, fitter, kind, &sum);
    ovoid_fitter_destroy(&fitter);
    if (recorded)
        return;
    printf("%s%llu,%.4f,%.5f,%.5f,%llu,%llu,%llu,%llu\n", begin, (unsigned long long)sum.ellipsoids,
           sum.distance, sum.area_error, sum.volume_error, (unsigned long long)sum.steps,
           (unsigned long long)sum.iterations, (unsigned long long)sum.judgements,
           (unsigned long long)sum.launches);
    fflush(stdout);
}

/* ---- constants ------------------------------------------------------------------------------- */

static bool begins(const char *name, const char *with) {
    return strncmp(name, with, strlen(with)) == 0;
}

/* Whether a kind of fit uses a constant. */
static bool uses(fit_kind kind, const char *name) {
    const bool effort = begins(name, "count_") || begins(name, "atoms_inside");
    const bool warm = begins(name, "warm_"), l1 = begins(name, "l1_");
    const bool frame = begins(name, "motion_") || begins(name, "owner_");
    const bool tolerance = begins(name, "start_") || begins(name, "spots_") ||
                           begins(name, "grow_") || begins(name, "shrink_") ||
                           begins(name, "refine_local_") || begins(name, "merge_");
    const bool quick = begins(name, "refine_quick_"), sharpen = begins(name, "sharpen_");
    switch (kind) {
    case TOLERANCE:
        return !effort && !warm && !l1 && !frame && !quick && !sharpen;
    case NUMBER:
        return !effort && !warm && !l1 && !frame && !quick && !sharpen && !tolerance;
    case SHARPEN:
        return sharpen;
    case EFFORT:
        return effort || quick;
    case WARM:
        return warm || quick;
    case FRAME:
        return frame;
    case L1:
        return l1;
    case KINDS:
        break;
    }
    return false;
}

static double value_of(const constant *c) {
    return c->real ? *c->real : (double)*c->count;
}

static void set(const constant *c, double value) {
    if (c->real)
        *c->real = value;
    else
        *c->count = (uint32_t)value;
}

static void vary(subject *s, const constant *c) {
    const double is = value_of(c);
    for (int k = 0; k < 2; ++k) {
        const double value = c->real  ? (k == 0 ? 0.5 : 2.0) * is
                             : k == 0 ? floor(0.5 * is)
                                      : 2.0 * is;
        char text[32];
        if (value == 0.0 || value == is)
            continue;
        snprintf(text, sizeof text, "%.6g", value);
        set(c, value);
        for (fit_kind kind = 0; kind < KINDS; ++kind)
            if (uses(kind, c->name))
                run(s, kind, c->name, text, k == 0 ? "halved" : "doubled");
        set(c, is);
    }
}

/* Another frame: all turn about an axis and go their own ways by some tenths of an angstrom. */
static void move(subject *s) {
    const double *const xyzr = ovoid_molecule_xyzr(s->molecule);
    const size_t atoms = ovoid_molecule_atoms(s->molecule);
    ovoid_molecule *there = NULL;
    double *const all = malloc(4 * atoms * sizeof *all);
    s->moved = malloc(3 * atoms * sizeof *s->moved);
    if (!s->moved || !all)
        exit(1);
    for (size_t i = 0; i < atoms; ++i) {
        const double *const at = xyzr + 4 * i;
        const double x = at[0] + 0.3 * sin(at[1] / 5.0), y = at[1] + 0.3 * sin(at[2] / 5.0);
        s->moved[3 * i] = cos(0.1) * x - sin(0.1) * y + 1.0;
        s->moved[3 * i + 1] = sin(0.1) * x + cos(0.1) * y;
        s->moved[3 * i + 2] = at[2] + 0.3 * sin(at[0] / 5.0);
        memcpy(all + 4 * i, s->moved + 3 * i, 3 * sizeof *all);
        all[4 * i + 3] = at[3];
    }
    stop(s, ovoid_molecule_create(s->context, all, atoms, &there));
    stop(s, ovoid_field_of_molecule(s->context, there, OVOID_DEFAULT_DECAY, OVOID_DEFAULT_ISOVALUE,
                                    &s->moved_field));
    ovoid_molecule_destroy(&there);
    free(all);
}

static bool is_wanted(const char *name, char **only, int count) {
    for (int n = 0; n < count; ++n)
        if (begins(name, only[n]))
            return true;
    return count == 0;
}

static const char *name_of(char *path) {
    char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    name[strcspn(name, ".")] = '\0';
    return name;
}

static void try_all(ovoid_context *context, char *path, char **only, int count) {
    subject s = {.context = context, .name = path};
    stop(&s, ovoid_molecule_read(context, path, OVOID_MOLECULE_AUTO, &s.molecule));
    stop(&s, ovoid_field_of_molecule(context, s.molecule, OVOID_DEFAULT_DECAY,
                                     OVOID_DEFAULT_ISOVALUE, &s.field));
    s.name = name_of(path);
    move(&s);
    for (fit_kind kind = 0; kind < KINDS; ++kind)
        run(&s, kind, "none", "", "");
    for (const constant *c = constants; c < constants + CONSTANTS; ++c)
        if (is_wanted(c->name, only, count))
            vary(&s, c);
    ovoid_model_destroy(&s.model);
    ovoid_field_destroy(&s.field);
    ovoid_field_destroy(&s.moved_field);
    ovoid_molecule_destroy(&s.molecule);
    free(s.moved);
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    char *only[64];
    int count = 0, at = 1;
    for (; at + 1 < argc && strcmp(argv[at], "--only") == 0 && count < 64; at += 2)
        only[count++] = argv[at + 1];
    if (at + 1 < argc && strcmp(argv[at], "--record") == 0) {
        read_record(argv[at + 1]);
        at += 2;
    }
    if (at >= argc) {
        fputs("usage: constants [--only PREFIX]... [--record FILE] MOLECULE...\n", stderr);
        return 2;
    }
    const subject nobody = {.context = NULL};
    if (ovoid_context_create(&context) != OVOID_OK)
        stop(&nobody, OVOID_ERROR_MEMORY);
    if (!record)
        puts(
            "constant,value,change,molecule,fit,ellipsoids,deviation,area_error,volume_error,steps,"
            "solver_iterations,judgements,launches");
    for (; at < argc; ++at)
        try_all(context, argv[at], only, count);
    free(record);
    ovoid_context_destroy(&context);
    return 0;
}
