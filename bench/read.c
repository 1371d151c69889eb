/*
 * bench/read: what reading a molecule comes to: one line of JSON with counts, seconds, and the
 * largest memory that the process had (structures.py).
 *
 *   read FILE [RADII [SELECTION]]
 */
#include "ovoid/ovoid.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Not by getrusage(), which also counts the program that started this one. */
static long peak_kib(void) {
    char line[128];
    long kib = 0;
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        if (sscanf(line, "VmHWM: %ld", &kib) == 1)
            break;
    if (status)
        fclose(status);
    return kib;
}

static void choose_radii(ovoid_read_options *options, const char *name) {
    for (int i = OVOID_RADII_BONDI; i <= OVOID_RADII_UNITED; i++)
        if (strcmp(name, ovoid_radii_name((ovoid_radii)i)) == 0)
            options->radii = (ovoid_radii)i;
}

static void print(const ovoid_molecule *molecule, double seconds, long before) {
    const ovoid_molecule_counts c = *ovoid_molecule_read_counts(molecule);
    size_t residues;
    ovoid_molecule_residues(molecule, &residues);
    printf("{\"atoms\": %llu, \"residues\": %zu, \"skipped\": %llu, \"models\": %llu, "
           "\"other_models\": %llu, \"waters\": %llu, \"altlocs\": %llu, \"hydrogens\": %llu, "
           "\"zero_occupancy\": %llu, \"radii\": \"%s\", \"guessed\": %llu, \"seconds\": %.4f, "
           "\"peak_kib\": %ld, \"before_kib\": %ld}\n",
           (unsigned long long)c.atoms, residues, (unsigned long long)c.skipped,
           (unsigned long long)c.models, (unsigned long long)c.skipped_models,
           (unsigned long long)c.skipped_waters, (unsigned long long)c.skipped_altlocs,
           (unsigned long long)c.hydrogens, (unsigned long long)c.zero_occupancy,
           ovoid_radii_name(ovoid_molecule_radii(molecule)), (unsigned long long)c.guessed_radii,
           seconds, peak_kib(), before);
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_read_options options;
    if (argc < 2 || ovoid_context_create(&context) != OVOID_OK) {
        fputs("usage: read FILE [RADII [SELECTION]]\n", stderr);
        return 2;
    }
    ovoid_read_options_init(&options, sizeof options);
    if (argc > 2)
        choose_radii(&options, argv[2]);
    options.select = argc > 3 ? argv[3] : NULL;
    const long before = peak_kib();
    const double begin = now();
    if (ovoid_molecule_read_with(context, argv[1], &options, &molecule) != OVOID_OK) {
        fprintf(stderr, "read: %s\n", ovoid_context_error(context));
        return 1;
    }
    print(molecule, now() - begin, before);
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    return 0;
}
