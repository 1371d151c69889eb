#define _GNU_SOURCE /* O_TMPFILE, madvise() */
#include "base/store.h"

#include "base/file.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/* What stays in memory of each array. */
#define LIMIT ((size_t)16 << 20)

/* An array in a file. */
typedef struct mapping {
    struct mapping *next;
    void *data;
    size_t bytes; /* of the file, and mapped */
    int file;
} mapping;

struct ov_store {
    char *folder;
    size_t limit, users;
    mapping *first;
    pthread_mutex_t lock; /* of the list */
};

static size_t wanted_limit;

void ov_store_limit(size_t bytes) {
    wanted_limit = bytes;
}

/* ---- the store ------------------------------------------------------------------------------ */

static ovoid_status check_folder(ovoid_context *context, const char *folder) {
    struct stat info;
    const int error = stat(folder, &info) != 0 ? errno : S_ISDIR(info.st_mode) ? 0 : ENOTDIR;
    if (error == ENOENT)
        return ov_fail(context, OVOID_ERROR_IO, "there is no folder '%s' for large arrays", folder);
    if (error)
        return ov_fail(context, OVOID_ERROR_IO, "large arrays cannot be kept in '%s': %s", folder,
                       strerror(error));
    return OVOID_OK;
}

ovoid_status ov_store_create(ovoid_context *context, const char *folder, ov_store **store) {
    ovoid_status status = OVOID_OK;
    ov_store *made = NULL;
    *store = NULL;
    if (!folder)
        return OVOID_OK;
    OV_TRY(check_folder(context, folder));
    made = ov_alloc(context, 1, sizeof *made, "large arrays");
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->folder = ov_copy(context, folder, strlen(folder) + 1, 1, "the name of a folder");
    if (!made->folder || pthread_mutex_init(&made->lock, NULL) != 0) {
        free(made->folder);
        free(made);
        return OVOID_ERROR_MEMORY;
    }
    made->limit = wanted_limit > 0 ? wanted_limit : LIMIT;
    made->users = 1;
    *store = made;
cleanup:
    return status;
}

ov_store *ov_store_share(ov_store *store) {
    if (store)
        ++store->users;
    return store;
}

static void release(mapping *m) {
    munmap(m->data, m->bytes);
    close(m->file);
    free(m);
}

void ov_store_destroy(ov_store **store) {
    ov_store *const s = *store;
    *store = NULL;
    if (!s || --s->users > 0)
        return;
    while (s->first) {
        mapping *const gone = s->first;
        s->first = gone->next;
        release(gone);
    }
    pthread_mutex_destroy(&s->lock);
    free(s->folder);
    free(s);
}

size_t ov_store_room(const ov_store *store) {
    return store ? store->limit : SIZE_MAX;
}

/* The link that leads to the file of an array; to NULL where that is in memory. */
static mapping **find(ov_store *store, const void *array) {
    mapping **link = &store->first;
    while (*link && (*link)->data != array)
        link = &(*link)->next;
    return link;
}

static mapping *look_up(ov_store *store, const void *array) {
    if (!store || !array)
        return NULL;
    pthread_mutex_lock(&store->lock);
    mapping *const found = *find(store, array);
    pthread_mutex_unlock(&store->lock);
    return found;
}

/* ---- files ---------------------------------------------------------------------------------- */

static ovoid_status fail(ovoid_context *context, const ov_store *store, const char *what,
                         int error) {
    return ov_fail(context, OVOID_ERROR_IO, "no room for %s in a file in folder '%s': %s", what,
                   store->folder, strerror(error));
}

/* A file that has no name, or none any more. */
static ovoid_status open_file(ovoid_context *context, const ov_store *store, const char *what,
                              int *file) {
#ifdef O_TMPFILE
    *file = open(store->folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (*file >= 0)
        return OVOID_OK;
#endif
    const int error = ov_file_nameless(store->folder, file); /* not every file system has those */
    return error ? fail(context, store, what, error) : OVOID_OK;
}

/* Makes a file longer, with room on the disk: one that is full is met here, and not by whoever
 * writes to the memory. */
static int extend(int file, size_t from, size_t to) {
    int error;
    do
        error = posix_fallocate(file, (off_t)from, (off_t)(to - from));
    while (error == EINTR);
    return error;
}

static ovoid_status map(ovoid_context *context, int file, size_t bytes, const char *what,
                        void **data) {
    void *const made = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (made == MAP_FAILED)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for %s (%zu bytes of a file)",
                       what, bytes);
    *data = made;
    return OVOID_OK;
}

/* A mapping of so many bytes, 0 all of them, that is in no list yet. */
static ovoid_status create(ovoid_context *context, const ov_store *store, size_t bytes,
                           const char *what, mapping **result) {
    ovoid_status status = OVOID_OK;
    int error;
    mapping *made = ov_alloc(context, 1, sizeof *made, what);
    if (!made)
        return OVOID_ERROR_MEMORY;
    made->file = -1;
    made->bytes = bytes;
    OV_TRY(open_file(context, store, what, &made->file));
    if ((error = extend(made->file, 0, bytes)) != 0)
        OV_TRY(fail(context, store, what, error));
    OV_TRY(map(context, made->file, bytes, what, &made->data));
    *result = made;
cleanup:
    if (status != OVOID_OK && made->file >= 0)
        close(made->file);
    if (status != OVOID_OK)
        free(made);
    return status;
}

static ovoid_status lengthen(ovoid_context *context, ov_store *store, mapping *m, size_t bytes,
                             const char *what) {
    ovoid_status status = OVOID_OK;
    void *data = NULL;
    const int error = extend(m->file, m->bytes, bytes);
    if (error)
        return fail(context, store, what, error);
    OV_TRY(map(context, m->file, bytes, what, &data));
    pthread_mutex_lock(&store->lock); /* others may let pages go meanwhile */
    munmap(m->data, m->bytes);
    m->data = data;
    m->bytes = bytes;
    pthread_mutex_unlock(&store->lock);
cleanup:
    return status;
}

static void add(ov_store *store, mapping *m) {
    pthread_mutex_lock(&store->lock);
    m->next = store->first;
    store->first = m;
    pthread_mutex_unlock(&store->lock);
}

/* ---- arrays --------------------------------------------------------------------------------- */

/* Bytes of an array, if that is a number and a file can be so long. */
static bool bytes_of(size_t count, size_t size, size_t *bytes) {
    if (count > (size_t)(PTRDIFF_MAX / 2) / size)
        return false;
    *bytes = count * size;
    return true;
}

static ovoid_status fail_size(ovoid_context *context, const char *what, size_t count, size_t size) {
    return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for %s (%zu x %zu bytes)", what,
                   count, size);
}

ovoid_status ov_store_alloc(ovoid_context *context, ov_store *store, void *array_pointer,
                            size_t count, size_t size, const char *what) {
    ovoid_status status = OVOID_OK;
    mapping *made = NULL;
    size_t bytes = 0;
    void *array;
    if (!bytes_of(count, size, &bytes))
        return fail_size(context, what, count, size);
    if (!store || bytes <= store->limit) {
        array = ov_alloc(context, count, size, what);
        memcpy(array_pointer, &array, sizeof array);
        return array ? OVOID_OK : OVOID_ERROR_MEMORY;
    }
    OV_TRY(create(context, store, bytes, what, &made));
    add(store, made);
    memcpy(array_pointer, &made->data, sizeof made->data);
cleanup:
    return status;
}

/* From memory to a file. */
static ovoid_status move(ovoid_context *context, ov_store *store, void *old, size_t held,
                         size_t bytes, const char *what, void **data) {
    ovoid_status status = OVOID_OK;
    mapping *made = NULL;
    OV_TRY(create(context, store, bytes, what, &made));
    if (old)
        memcpy(made->data, old, held);
    free(old);
    add(store, made);
    *data = made->data;
cleanup:
    return status;
}

/* Files grow by a quarter. */
enum { GROWTH = 4 };

ovoid_status ov_store_grow(ovoid_context *context, ov_store *store, void *array_pointer,
                           size_t *capacity, size_t need, size_t size, const char *what) {
    ovoid_status status = OVOID_OK;
    size_t bytes = 0;
    void *array;
    const size_t more = *capacity + *capacity / GROWTH, room = more > need ? more : need;
    if (need <= *capacity)
        return OVOID_OK;
    if (!bytes_of(room, size, &bytes))
        return fail_size(context, what, room, size);
    if (!store || need * size <= store->limit)
        return ov_grow(context, array_pointer, capacity, need, size, what);
    memcpy(&array, array_pointer, sizeof array);
    mapping *const m = look_up(store, array);
    if (m) {
        OV_TRY(lengthen(context, store, m, bytes, what));
        array = m->data;
    } else {
        OV_TRY(move(context, store, array, *capacity * size, bytes, what, &array));
    }
    memcpy(array_pointer, &array, sizeof array);
    *capacity = room;
cleanup:
    return status;
}

/* Cuts a file off at the page that the bytes end in. */
static void cut(ov_store *store, mapping *m, size_t bytes) {
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), kept = (bytes + page - 1) / page * page;
    if (bytes == 0 || kept >= m->bytes)
        return;
    pthread_mutex_lock(&store->lock);
    munmap((char *)m->data + kept, m->bytes - kept);
    m->bytes = kept;
    if (ftruncate(m->file, (off_t)kept) != 0)
        (void)0; /* it is longer than it had to be, and goes with the rest */
    pthread_mutex_unlock(&store->lock);
}

void ov_store_shrink(ov_store *store, void *array_pointer, size_t bytes) {
    void *array, *less;
    memcpy(&array, array_pointer, sizeof array);
    mapping *const m = look_up(store, array);
    if (m) {
        cut(store, m, bytes);
        return;
    }
    less = array && bytes > 0 ? realloc(array, bytes) : NULL;
    if (less)
        memcpy(array_pointer, &less, sizeof less);
}

void ov_store_free(ov_store *store, void *array) {
    mapping *found = NULL;
    if (store && array) {
        pthread_mutex_lock(&store->lock);
        mapping **const link = find(store, array);
        found = *link;
        if (found)
            *link = found->next;
        pthread_mutex_unlock(&store->lock);
    }
    if (found)
        release(found);
    else
        free(array);
}

void ov_store_rest(ov_store *store) {
    if (!store)
        return;
    pthread_mutex_lock(&store->lock);
    for (const mapping *m = store->first; m; m = m->next)
        (void)madvise(m->data, m->bytes, MADV_DONTNEED); /* of a shared mapping: nothing is lost */
    pthread_mutex_unlock(&store->lock);
}
