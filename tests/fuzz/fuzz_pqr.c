#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz_molecule(data, size, OVOID_MOLECULE_PQR);
    return 0;
}
