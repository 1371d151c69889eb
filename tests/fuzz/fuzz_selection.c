/*
 * A selection, as --select has it: parsed, and asked about a few atoms. What is read in it is
 * gemmi's; that nothing but a verdict comes out of it is ours.
 */
#include "fuzz.h"

#include "molecule/sites.h"

#include <stdlib.h>
#include <string.h>

static const ov_selectable atoms[] = {
    {"CA", "GLY", "A", 6, 0, ' ', 1, 1, OV_ENTITY_POLYMER, 1.0f, 20.0f},
    {"H", "GLY", "A", 1, 'A', 'B', 10, 2, OV_ENTITY_POLYMER, 0.5f, 0.0f},
    {"O", "HOH", "", 8, 0, ' ', INT32_MIN, 1, OV_ENTITY_WATER, 0.0f, -1.0f},
    {"ZN", "ZN", "AAA", 30, 0, ' ', -5, 1, OV_ENTITY_OTHER, 1.0f, 99.0f},
    {"X", "UNL", "B", 0, 0, ' ', 9999, 1, OV_ENTITY_UNKNOWN, 1.0f, 1.0f}};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *text = malloc(size + 1), error[256] = "";
    if (!text)
        abort();
    fuzz_begin();
    memcpy(text, data, size);
    text[size] = '\0';
    ov_selection *selection = ov_selection_create(text, error, sizeof error);
    for (size_t i = 0; selection && i < sizeof atoms / sizeof atoms[0]; i++)
        ov_selection_matches(selection, &atoms[i]);
    const ovoid_status status = ov_selection_check(fuzz_context(), text);
    fuzz_require((status == OVOID_OK) == (selection != NULL),
                 "a selection is checked as it is made");
    if (status != OVOID_OK)
        fuzz_failed(status, NULL);
    ov_selection_destroy(&selection);
    free(text);
    return 0;
}
