#include "base/temporary.h"

#include "base/base.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

/* More at a time than that are not removed by a handler: a context has one or two. */
enum { ROOM = 64 };
static _Atomic(const char *) paths[ROOM];

/* In the place of a path while a handler reads it. */
static const char taken[] = "";

void ov_temporary_begin(const char *path) {
    for (int i = 0; path && i < ROOM; i++) {
        const char *none = NULL;
        if (atomic_compare_exchange_strong(&paths[i], &none, path))
            return;
    }
}

void ov_temporary_end(char *path) {
    bool handled = false;
    for (int i = 0; path && i < ROOM; i++) {
        const char *found = path;
        if (atomic_compare_exchange_strong(&paths[i], &found, NULL)) {
            free(path);
            return;
        }
        handled |= found == taken;
    }
    if (!handled) /* there was no room for it, or a handler is done with it */
        free(path);
}

void ovoid_remove_temporaries(void) {
    for (int i = 0; i < ROOM; i++) {
        const char *const path = atomic_load(&paths[i]);
        if (path && path != taken) {
            const char *found = path;
            if (atomic_compare_exchange_strong(&paths[i], &found, taken)) {
                unlink(path);
                atomic_store(&paths[i], NULL);
            }
        }
    }
}
