#include "fuzz.h"

#include <math.h>
#include <string.h>

/* So many are looked at where they are placed. */
enum { ALL_MAX = 100000 };

static void check_ellipsoids(const ovoid_ellipsoid *ellipsoids, size_t count) {
    for (size_t i = 0; i < count; i++) {
        double values[10];
        memcpy(values, &ellipsoids[i], sizeof values);
        for (int k = 0; k < 10; k++)
            fuzz_require(isfinite(values[k]) && (k > 3 || values[k] > 0),
                         "an ellipsoid is ten finite numbers, the first four positive");
    }
}

static void check_model(const ovoid_model *model) {
    const size_t count = ovoid_model_unit_size(model);
    const ovoid_ellipsoid *ellipsoids = ovoid_model_unit_ellipsoids(model);
    fuzz_require(count > 0, "a model has an ellipsoid");
    fuzz_require(ovoid_model_decay(model) > 0 && isfinite(ovoid_model_decay(model)) &&
                     ovoid_model_isovalue(model) > 0 && isfinite(ovoid_model_isovalue(model)),
                 "decay and isovalue are positive");
    check_ellipsoids(ellipsoids, count);
    if (ovoid_model_size(model) <= ALL_MAX)
        check_ellipsoids(ovoid_model_ellipsoids(model), ovoid_model_size(model));
    for (size_t i = 0; ovoid_model_note(model, i); i++)
        fuzz_require(strchr(ovoid_model_note(model, i), ':'), "a note is a key and a value");
}

/* What is written reads as it was, but for digits behind the ninth. */
static void write_and_read(const ovoid_model *model) {
    ovoid_model *again = NULL;
    const char *path = fuzz_file(1, "", 0);
    fuzz_require(ovoid_model_write(fuzz_context(), model, path) == OVOID_OK &&
                     ovoid_model_read(fuzz_context(), path, &again) == OVOID_OK,
                 "a model that was read can be written, and read again");
    fuzz_require(ovoid_model_size(again) == ovoid_model_size(model), "with as many ellipsoids");
    fuzz_require(ovoid_model_unit_size(again) == ovoid_model_unit_size(model), "in its unit");
    for (size_t i = 0; i < ovoid_model_unit_size(model); i++) {
        double a[10], b[10];
        memcpy(a, &ovoid_model_unit_ellipsoids(model)[i], sizeof a);
        memcpy(b, &ovoid_model_unit_ellipsoids(again)[i], sizeof b);
        for (int k = 0; k < 10; k++)
            fuzz_require(fabs(a[k] - b[k]) <= 1e-8 * fabs(a[k]), "with the same values");
    }
    size_t placements, others, notes = 0;
    const ovoid_motion *const placed = ovoid_model_placements(model, &placements);
    const ovoid_motion *const other = ovoid_model_placements(again, &others);
    fuzz_require(placements == others &&
                     (placements == 0 || memcmp(placed, other, placements * sizeof *placed) == 0),
                 "with the same placements");
    for (const char *note; (note = ovoid_model_note(model, notes)) != NULL; notes++) {
        const char *same = ovoid_model_note(again, notes);
        fuzz_require(same && strcmp(note, same) == 0, "with the same notes");
    }
    fuzz_require(!ovoid_model_note(again, notes), "and no further ones");
    ovoid_model_destroy(&again);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    ovoid_model *model = NULL;
    const ovoid_status status = ovoid_model_read(fuzz_context(), fuzz_file(0, data, size), &model);
    if (status == OVOID_OK) {
        check_model(model);
        write_and_read(model);
    } else {
        fuzz_failed(status, model);
    }
    ovoid_model_destroy(&model);
    return 0;
}
