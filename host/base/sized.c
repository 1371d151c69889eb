#include "base/sized.h"

#include <string.h>

/* No structure of the interface will be larger: what says so was never initialised. */
#define SIZE_MOST ((size_t)1 << 16)

static size_t size_of(const void *structure) {
    size_t size;
    memcpy(&size, structure, sizeof size);
    return size;
}

static size_t smaller(size_t a, size_t b) {
    return a < b ? a : b;
}

void ov_sized_init(void *theirs, size_t size, const void *ours, size_t our_size) {
    if (!theirs || size < sizeof size)
        return;
    memset(theirs, 0, size);
    memcpy(theirs, ours, smaller(size, our_size));
    memcpy(theirs, &size, sizeof size);
}

ovoid_status ov_sized_check(ovoid_context *context, const char *name, const void *theirs) {
    const size_t size = theirs ? size_of(theirs) : sizeof size;
    if (size >= sizeof size && size <= SIZE_MOST)
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_ARGUMENT,
                   "%s: size %zu is none of this structure: %s_init() sets it", name, size, name);
}

ovoid_status ov_sized_take(ovoid_context *context, const char *name, const void *theirs, void *ours,
                           size_t our_size) {
    const ovoid_status status = ov_sized_check(context, name, theirs);
    if (status != OVOID_OK)
        return status;
    const size_t size = size_of(theirs);
    for (size_t k = our_size; k < size; ++k)
        if (((const unsigned char *)theirs)[k] != 0)
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "%s: byte %zu of %zu is set, and libovoid %s knows %zu: the program was "
                           "made for a later version",
                           name, k, size, ovoid_version(), our_size);
    memcpy(ours, theirs, smaller(size, our_size));
    memcpy(ours, &our_size, sizeof our_size);
    return OVOID_OK;
}

void ov_sized_give(void *theirs, const void *ours, size_t our_size) {
    if (!theirs)
        return;
    const size_t head = sizeof(size_t), both = smaller(size_of(theirs), our_size);
    memcpy((char *)theirs + head, (const char *)ours + head, both - head);
}
