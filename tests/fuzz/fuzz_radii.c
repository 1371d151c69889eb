#include "fuzz.h"

#include "molecule/radii.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    ov_radii_table *table = NULL;
    const ovoid_status status =
        ov_radii_table_read(fuzz_context(), fuzz_file(0, data, size), &table);
    if (status != OVOID_OK) {
        fuzz_failed(status, table);
        return 0;
    }
    for (int element = 0; element < OV_ELEMENTS; element++) {
        double radius = 0;
        if (ov_radii_table_find(table, "GLY", "CA", element, &radius)) {
            fuzz_require(radius >= 0 && radius <= 100, "radii are 0 to 100");
        }
    }
    ov_radii_table_destroy(&table);
    return 0;
}
