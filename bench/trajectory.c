/*
 * bench/trajectory: a fit session that follows a molecule through the frames of a trajectory, each
 * fitted from the last one's model, beside a fit from the atoms.
 *
 *   trajectory MOLECULE FRAMES.dcd [FRESH [MOST]]
 *
 * Frames are those of a DCD file (CHARMM, NAMD) with the molecule's atoms in its order. Every
 * FRESH-th frame (default 10) is also fitted from the atoms, by itself; at most MOST frames are
 * taken. Prints CSV, a line per frame: what its model is, what it took, counted, and
 *   stayed   share of the atoms whose ellipsoid goes on from the one they had in the frame before
 *            (the one that most of that one's atoms went to)
 *   drift    root mean square of how far such an ellipsoid's centre went from where its atoms took
 *            it, angstrom
 *   fresh_*  the same of the fit from the atoms, where there was one
 */
#include "ovoid/ovoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- frames ---------------------------------------------------------------------------------- */

/* A record of Fortran, which has its length before and after it; its bytes, or -1 at the end. */
static long read_record(FILE *file, void *data, size_t room) {
    uint32_t length, again;
    if (fread(&length, sizeof length, 1, file) != 1)
        return -1;
    if (length > room || fread(data, 1, length, file) != length ||
        fread(&again, sizeof again, 1, file) != 1 || again != length) {
        fputs("trajectory: this is no DCD file of these atoms\n", stderr);
        exit(1);
    }
    return (long)length;
}

static FILE *open_frames(const char *path, size_t atoms) {
    char title[4096];
    int32_t count = 0;
    FILE *const file = fopen(path, "rb");
    if (!file) {
        perror(path);
        exit(1);
    }
    read_record(file, title, sizeof title);
    if (memcmp(title, "CORD", 4) != 0)
        fputs("trajectory: not a DCD file of this byte order\n", stderr);
    read_record(file, title, sizeof title);
    read_record(file, &count, sizeof count);
    if ((size_t)count != atoms) {
        fprintf(stderr, "trajectory: %d atoms in frames of a molecule of %zu\n", count, atoms);
        exit(1);
    }
    return file;
}

/* The next frame's x, y, z of each atom; false at the end. axis: room for atoms + 12 floats. */
static bool read_frame(FILE *file, size_t atoms, float *axis, double *xyz) {
    const size_t room = (atoms + 12) * sizeof *axis;
    for (size_t k = 0; k < 3; ++k) {
        long bytes = read_record(file, axis, room);
        if (k == 0 && bytes == 48 && atoms != 12) /* the unit cell */
            bytes = read_record(file, axis, room);
        if (bytes < 0)
            return false;
        for (size_t i = 0; i < atoms; ++i)
            xyz[3 * i + k] = axis[i];
    }
    return true;
}

/* ---- what became of ellipsoids --------------------------------------------------------------- */

/* A model with the atoms where they were. */
typedef struct frame {
    ovoid_model *model;
    double *xyz;
} frame;

typedef struct fate {
    double stayed, drift;
} fate;

/* Of the atoms of one ellipsoid: the ellipsoid that most of them have afterwards. */
static uint32_t heir_of(const uint32_t *before, const uint32_t *after, size_t atoms, uint32_t one,
                        size_t *votes, size_t *most) {
    uint32_t heir = 0;
    *most = 0;
    for (size_t i = 0; i < atoms; ++i)
        if (before[i] == one && ++votes[after[i]] > *most) {
            *most = votes[after[i]];
            heir = after[i];
        }
    for (size_t i = 0; i < atoms; ++i)
        votes[after[i]] = 0;
    return heir;
}

static fate fate_of(const frame *before, const frame *after, size_t atoms) {
    const size_t count = ovoid_model_size(before->model);
    const uint32_t *const was = ovoid_model_owner(before->model);
    const uint32_t *const is = ovoid_model_owner(after->model);
    size_t *const votes = calloc(ovoid_model_size(after->model), sizeof *votes);
    size_t stayed = 0, owners = 0, most;
    double squares = 0.0;
    for (uint32_t one = 0; one < count && votes; ++one) {
        const uint32_t heir = heir_of(was, is, atoms, one, votes, &most);
        double way[3] = {0.0};
        size_t own = 0;
        stayed += most;
        for (size_t i = 0; i < atoms; ++i)
            if (was[i] == one && ++own)
                for (size_t k = 0; k < 3; ++k)
                    way[k] += after->xyz[3 * i + k] - before->xyz[3 * i + k];
        for (size_t k = 0; k < 3 && own > 0; ++k)
            squares +=
                pow(ovoid_model_ellipsoids(after->model)[heir].centre[k] -
                        ovoid_model_ellipsoids(before->model)[one].centre[k] - way[k] / (double)own,
                    2);
        owners += own > 0;
    }
    free(votes);
    return (fate){(double)stayed / (double)atoms, sqrt(squares / (double)owners)};
}

/* ---- fits ------------------------------------------------------------------------------------ */

static int fail(const ovoid_context *context) {
    fprintf(stderr, "trajectory: %s\n", context ? ovoid_context_error(context) : "out of memory");
    return 1;
}

/* Steps of refinement by what they were made for. */
static struct { uint64_t last, grow, shrink; } steps;

static bool count_steps(const ovoid_progress *progress, void *user) {
    (void)user;
    if (progress->iteration > steps.last && strcmp(progress->stage, "grow") == 0)
        ++steps.grow;
    if (progress->iteration > steps.last && strcmp(progress->stage, "shrink") == 0)
        ++steps.shrink;
    steps.last = progress->iteration;
    return true;
}

static void print(const ovoid_fit_result *r) {
    printf(",%llu,%.4f,%llu,%llu,%llu,%llu,%llu,%.2f", (unsigned long long)r->ellipsoids,
           r->distance, (unsigned long long)r->iterations, (unsigned long long)steps.grow,
           (unsigned long long)steps.shrink, (unsigned long long)r->adaptive.solver_iterations,
           (unsigned long long)r->counts[OVOID_COUNT_LAUNCHES], r->sample_seconds + r->fit_seconds);
}

/* From the atoms, by itself. */
static ovoid_status fit_fresh(ovoid_context *context, const ovoid_molecule *molecule,
                              const double *xyz) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    double *const xyzr = malloc(4 * atoms * sizeof *xyzr);
    ovoid_molecule *there = NULL;
    ovoid_model *model = NULL;
    ovoid_fit_options options;
    ovoid_fit_result result;
    ovoid_fit_options_init(&options, sizeof options);
    ovoid_fit_result_init(&result, sizeof result);
    for (size_t i = 0; i < atoms && xyzr; ++i) {
        memcpy(xyzr + 4 * i, xyz + 3 * i, 3 * sizeof *xyz);
        xyzr[4 * i + 3] = ovoid_molecule_xyzr(molecule)[4 * i + 3];
    }
    ovoid_status status =
        xyzr ? ovoid_molecule_create(context, xyzr, atoms, &there) : OVOID_ERROR_MEMORY;
    memset(&steps, 0, sizeof steps);
    if (status == OVOID_OK)
        status = ovoid_fit(context, there, &options, &model, &result);
    if (status == OVOID_OK)
        print(&result);
    ovoid_model_destroy(&model);
    ovoid_molecule_destroy(&there);
    free(xyzr);
    return status;
}

static ovoid_status fit_frame(ovoid_context *context, ovoid_fitter *fitter, frame *now) {
    ovoid_fit_options options;
    ovoid_fit_result result;
    ovoid_fit_options_init(&options, sizeof options);
    ovoid_fit_result_init(&result, sizeof result);
    memset(&steps, 0, sizeof steps);
    ovoid_status status = ovoid_fitter_move(context, fitter, now->xyz);
    if (status == OVOID_OK)
        status = ovoid_fitter_reach(context, fitter, &options, &now->model, &result);
    if (status == OVOID_OK)
        print(&result);
    return status;
}

static ovoid_status follow(ovoid_context *context, const ovoid_molecule *molecule,
                           ovoid_fitter *fitter, FILE *frames, unsigned fresh, unsigned most) {
    const size_t atoms = ovoid_molecule_atoms(molecule);
    ovoid_status status = OVOID_OK;
    float *const axis = malloc((atoms + 12) * sizeof *axis);
    frame last = {.xyz = malloc(3 * atoms * sizeof *last.xyz)};
    frame now = {.xyz = malloc(3 * atoms * sizeof *now.xyz)};
    if (!axis || !last.xyz || !now.xyz)
        status = OVOID_ERROR_MEMORY;
    for (unsigned n = 0; n < most && status == OVOID_OK && read_frame(frames, atoms, axis, now.xyz);
         ++n) {
        printf("%u", n);
        status = fit_frame(context, fitter, &now);
        if (status != OVOID_OK)
            break;
        const fate f = last.model ? fate_of(&last, &now, atoms) : (fate){NAN, NAN};
        printf(",%.4f,%.3f", f.stayed, f.drift);
        if (n % fresh == 0)
            status = fit_fresh(context, molecule, now.xyz);
        puts(n % fresh == 0 ? "" : ",,,,,,,,");
        fflush(stdout);
        ovoid_model_destroy(&last.model);
        const frame swap = last;
        last = now;
        now = swap;
    }
    ovoid_model_destroy(&last.model);
    free(axis);
    free(last.xyz);
    free(now.xyz);
    return status;
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_fitter *fitter = NULL;
    ovoid_fit_options options;
    const unsigned fresh = argc > 3 ? (unsigned)atoi(argv[3]) : 10;
    const unsigned most = argc > 4 ? (unsigned)atoi(argv[4]) : UINT32_MAX;
    if (argc < 3 || fresh == 0) {
        fputs("usage: trajectory MOLECULE FRAMES.dcd [FRESH [MOST]]\n", stderr);
        return 2;
    }
    ovoid_fit_options_init(&options, sizeof options);
    if (ovoid_context_create(&context) != OVOID_OK ||
        ovoid_molecule_read(context, argv[1], OVOID_MOLECULE_AUTO, &molecule) != OVOID_OK ||
        ovoid_fitter_create(context, molecule, &options, &fitter) != OVOID_OK)
        return fail(context);
    FILE *const frames = open_frames(argv[2], ovoid_molecule_atoms(molecule));
    puts("frame,ellipsoids,deviation,steps,grow_steps,shrink_steps,solver_iterations,launches,"
         "seconds,stayed,drift,fresh_ellipsoids,fresh_deviation,fresh_steps,fresh_grow_steps,"
         "fresh_shrink_steps,fresh_solver_iterations,fresh_launches,fresh_seconds");
    ovoid_context_on_progress(context, count_steps, NULL);
    const ovoid_status status = follow(context, molecule, fitter, frames, fresh, most);
    fclose(frames);
    ovoid_fitter_destroy(&fitter);
    ovoid_molecule_destroy(&molecule);
    const int code = status == OVOID_OK ? 0 : fail(context);
    ovoid_context_destroy(&context);
    return code;
}
