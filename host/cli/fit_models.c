#include "fit.h"

#include <stdlib.h>
#include <string.h>

/* `ovoid fit FILE --models all`: a batch whose molecules are the models of one file, and go on from
 * one to the next where their atoms are the same. */

bool fit_models_check(const fit_job *job) {
    if (job->input_count != 1)
        cli_error("--models fits all models of one file, and there are %zu files",
                  job->input_count);
    else if (strcmp(job->input, "-") == 0)
        cli_error("--models reads the file once for each model, which standard input cannot be: "
                  "name a file");
    else if (job->reading.options.model)
        cli_error("--models takes all models, and --model one of them: leave one of the two out");
    else
        return job->folder ? fit_batch_check(job) : fit_outputs_take_models(job);
    return false;
}

/* The file's models can be told apart, and read again by their numbers. */
static bool check_numbers(const fit_job *job, const ovoid_molecule *molecule, size_t count) {
    const uint64_t models = ovoid_molecule_read_counts(molecule)->models;
    if (ovoid_molecule_read_format(molecule) == OVOID_MOLECULE_XYZR) {
        cli_error("%s: an XYZR file has no models: leave out --models", job->input);
        return false;
    }
    if (models > count) {
        cli_error("%s: %llu models share %zu number%s: give each one its own to fit all of them",
                  job->input, (unsigned long long)models, count, count == 1 ? "" : "s");
        return false;
    }
    for (size_t i = 0; i < count; i++)
        if (ovoid_molecule_models(molecule, NULL)[i] < 1) {
            cli_error("%s: a model has the number %d, but numbers begin with 1", job->input,
                      (int)ovoid_molecule_models(molecule, NULL)[i]);
            return false;
        }
    return true;
}

/* The numbers, to be freed; NULL: *code is the exit code, all said. */
static int32_t *read_numbers(const fit_job *job, size_t *count, int *code) {
    ovoid_molecule *molecule = NULL;
    int32_t *numbers = NULL;
    const ovoid_status status =
        reading_molecule(&job->reading, job->context, job->input, &molecule);
    if (status != OVOID_OK) {
        *code = cli_failure(job->context, status, CLI_INPUT);
        return NULL;
    }
    const int32_t *const found = ovoid_molecule_models(molecule, count);
    *code = CLI_INPUT;
    if (check_numbers(job, molecule, *count)) {
        numbers = malloc(*count * sizeof *numbers);
        if (numbers)
            memcpy(numbers, found, *count * sizeof *numbers);
        else
            *code = cli_failure(job->context, OVOID_ERROR_MEMORY, CLI_INPUT);
    }
    ovoid_molecule_destroy(&molecule);
    return numbers;
}

int fit_models(fit_job *job) {
    fit_session session = {0};
    size_t count = 0;
    int code;
    int32_t *const numbers = read_numbers(job, &count, &code);
    char **const inputs = numbers ? malloc(count * sizeof *inputs) : NULL;
    if (inputs) {
        for (size_t i = 0; i < count; i++)
            inputs[i] = job->inputs[0];
        job->inputs = inputs;
        job->input_count = count;
        job->numbers = numbers;
        job->session = &session;
        code = fit_batch_check(job) ? fit_batch(job) : CLI_USAGE;
    } else if (numbers) {
        code = cli_failure(job->context, OVOID_ERROR_MEMORY, CLI_INPUT);
    }
    fit_session_destroy(&session);
    free(inputs);
    free(numbers);
    return code;
}
