/*
 * bench/warm: seconds of a fit where the program is warm, kernels built and loaded: several fits in
 * one process, of which the first does not count.
 *
 *   warm MOLECULE ELLIPSOIDS [RUNS]
 *
 * Prints one line per run: seconds of sampling and of the rest (merging, refining, and the
 * measuring that steers it).
 */
#include "ovoid/ovoid.h"

#include <stdio.h>
#include <stdlib.h>

static int fail(const ovoid_context *context) {
    fprintf(stderr, "warm: %s\n", context ? ovoid_context_error(context) : "out of memory");
    return 1;
}

int main(int argc, char **argv) {
    ovoid_context *context = NULL;
    ovoid_molecule *molecule = NULL;
    ovoid_fit_options options;
    const int runs = argc > 3 ? atoi(argv[3]) : 5;
    if (argc < 3) {
        fputs("usage: warm MOLECULE ELLIPSOIDS [RUNS]\n", stderr);
        return 2;
    }
    ovoid_fit_options_init(&options, sizeof options);
    options.adaptive.goal = OVOID_GOAL_ELLIPSOIDS;
    options.adaptive.effort = 0; /* least squares alone, as its peers do */
    options.adaptive.ellipsoids = (uint32_t)strtoul(argv[2], NULL, 10);
    if (ovoid_context_create(&context) != OVOID_OK ||
        ovoid_molecule_read(context, argv[1], OVOID_MOLECULE_AUTO, &molecule) != OVOID_OK)
        return fail(context);
    for (int run = 0; run <= runs; ++run) {
        ovoid_model *model = NULL;
        ovoid_fit_result result;
        ovoid_fit_result_init(&result, sizeof result);
        if (ovoid_fit(context, molecule, &options, &model, &result) != OVOID_OK)
            return fail(context);
        if (run > 0)
            printf("%.6f %.6f\n", result.sample_seconds, result.fit_seconds);
        ovoid_model_destroy(&model);
    }
    ovoid_molecule_destroy(&molecule);
    ovoid_context_destroy(&context);
    return 0;
}
