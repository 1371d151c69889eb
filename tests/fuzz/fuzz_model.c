#include "fuzz.h"

#include <math.h>
#include <string.h>

static void check_model(const ovoid_model *model) {
    const size_t count = ovoid_model_size(model);
    const ovoid_ellipsoid *ellipsoids = ovoid_model_ellipsoids(model);
    fuzz_require(count > 0, "a model has an ellipsoid");
    fuzz_require(ovoid_model_decay(model) > 0 && isfinite(ovoid_model_decay(model)) &&
                     ovoid_model_isovalue(model) > 0 && isfinite(ovoid_model_isovalue(model)),
                 "decay and isovalue are positive");
    for (size_t i = 0; i < count; i++) {
        double values[10];
        memcpy(values, &ellipsoids[i], sizeof values);
        for (int k = 0; k < 10; k++)
            fuzz_require(isfinite(values[k]) && (k > 3 || values[k] > 0),
                         "an ellipsoid is ten finite numbers, the first four positive");
    }
    for (size_t i = 0; ovoid_model_note(model, i); i++)
        fuzz_require(strchr(ovoid_model_note(model, i), ':'), "a note is a key and a value");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    ovoid_model *model = NULL;
    const ovoid_status status = ovoid_model_read(fuzz_context(), fuzz_file(0, data, size), &model);
    if (status == OVOID_OK)
        check_model(model);
    else
        fuzz_failed(status, model);
    ovoid_model_destroy(&model);
    return 0;
}
