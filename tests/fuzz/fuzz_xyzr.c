#include "fuzz.h"

#include "molecule/fields.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A number at the beginning is the one that the C library reads there, but for digits behind the
 * nineteenth. */
static void compare_number(const uint8_t *data, size_t size) {
    char text[64] = "";
    ov_number number;
    const size_t length = size < sizeof text ? size : sizeof text - 1;
    if (length)
        memcpy(text, data, length);
    const size_t used = ov_number_parse(text, length, &number);
    if (used == 0)
        return;
    text[used] = '\0';
    char *end;
    const double expected = strtod(text, &end);
    fuzz_require(end == text + used, "a number is one for the C library, too");
    fuzz_require(number.value == expected ||
                     fabs(number.value - expected) <= 1e-15 * fabs(expected) + 5e-324,
                 "numbers have the value that the C library gives them");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz_molecule(data, size, OVOID_MOLECULE_XYZR);
    compare_number(data, size);
    return 0;
}
