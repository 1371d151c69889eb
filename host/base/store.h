/*
 * Arrays that may be larger than memory. Small ones are in memory; those that grow beyond a limit
 * move to files without a name, one each, which are mapped: what is in them reads and writes as
 * memory does, but the system can take their pages back at any time. The files go with the store,
 * or with the process, however that ends.
 *
 * All functions take NULL for a store: then everything is in memory.
 */
#ifndef OV_STORE_H
#define OV_STORE_H

#include "base/base.h"

typedef struct ov_store ov_store;

/* A store whose files are in `folder`. OVOID_ERROR_IO where there is no such folder. Where folder
 * is NULL the store is, too. */
ovoid_status ov_store_create(ovoid_context *context, const char *folder, ov_store **store);

/* One more who keeps it, and calls ov_store_destroy(). */
ov_store *ov_store_share(ov_store *store);

/* The last one who keeps it takes the arrays along that are in files. */
void ov_store_destroy(ov_store **store);

/* A new *array of count elements of `size` bytes, all 0, as ov_alloc() makes it. OVOID_ERROR_IO
 * where the folder has no room. */
ovoid_status ov_store_alloc(ovoid_context *context, ov_store *store, void *array_pointer,
                            size_t count, size_t size, const char *what);

/* As ov_grow(), with the same errors; from several threads at a time, too, each with arrays of its
 * own. */
ovoid_status ov_store_grow(ovoid_context *context, ov_store *store, void *array_pointer,
                           size_t *capacity, size_t need, size_t size, const char *what);

/* Gives back what is beyond so many bytes of *array. */
void ov_store_shrink(ov_store *store, void *array_pointer, size_t bytes);

/* As free(), of what the functions above have made. */
void ov_store_free(ov_store *store, void *array);

/* Lets go of the memory that holds what is in files: it is read again when it is asked for. */
void ov_store_rest(ov_store *store);

/* That, every now and then, in a loop over vertices or triangles. */
#define OV_STORE_TURN ((size_t)1 << 18)
static inline void ov_store_turn(ov_store *store, size_t k) {
    if (store && k % OV_STORE_TURN == 0)
        ov_store_rest(store);
}

/* Bytes of an array that stay in memory: a measure of what work on a mesh may take by itself.
 * Without a store that is all there is. */
size_t ov_store_room(const ov_store *store);

/* The same of stores made from now on, in tests; 0: the default. */
void ov_store_limit(size_t bytes);

#endif
