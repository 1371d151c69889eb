/*
 * A folder of its own for each test of files, and short ways to put text there and look at it.
 */
#ifndef SCRATCH_H
#define SCRATCH_H

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct scratch {
    char folder[256];
    char *path[8]; /* of scratch_path(), used in turn */
    unsigned next;
} scratch;

/* Path of a name in the folder; valid for the next seven calls. */
static inline const char *scratch_path(scratch *s, const char *name) {
    char **path = &s->path[s->next++ % 8];
    free(*path);
    *path = malloc(strlen(s->folder) + strlen(name) + 2);
    if (!*path)
        abort();
    sprintf(*path, "%s/%s", s->folder, name);
    return *path;
}

/* cmocka fixtures: *state is the scratch. */
static inline int scratch_setup(void **state) {
    scratch *s = calloc(1, sizeof *s);
    if (!s)
        return -1;
    const char *place = getenv("TMPDIR");
    snprintf(s->folder, sizeof s->folder, "%.200s/ovoid-test-XXXXXX", place ? place : "/tmp");
    *state = s;
    return mkdtemp(s->folder) ? 0 : -1;
}

/* Entries of the folder, "." and ".." aside. */
static inline int scratch_entries(const scratch *s) {
    int count = -2;
    DIR *folder = opendir(s->folder);
    while (folder && readdir(folder))
        count++;
    if (folder)
        closedir(folder);
    return count;
}

static inline int scratch_teardown(void **state) {
    scratch *s = *state;
    char path[512];
    const struct dirent *entry;
    DIR *folder = opendir(s->folder);
    while (folder && (entry = readdir(folder)) != NULL) {
        snprintf(path, sizeof path, "%s/%s", s->folder, entry->d_name);
        if (unlink(path) != 0)
            rmdir(path);
    }
    if (folder)
        closedir(folder);
    int result = rmdir(s->folder);
    for (int i = 0; i < 8; i++)
        free(s->path[i]);
    free(s);
    return result;
}

static inline void scratch_write(const char *path, const char *text, size_t length) {
    FILE *stream = fopen(path, "wb");
    if (!stream || fwrite(text, 1, length, stream) != length || fclose(stream) != 0)
        abort();
}

/* The whole file with a zero at its end, to be freed; NULL if there is none. */
static inline char *scratch_read(const char *path) {
    FILE *stream = fopen(path, "rb");
    if (!stream)
        return NULL;
    char *text = NULL;
    size_t length = 0, got;
    do {
        text = realloc(text, length + 4097);
        if (!text)
            abort();
        got = fread(text + length, 1, 4096, stream);
        length += got;
    } while (got);
    text[length] = '\0';
    fclose(stream);
    return text;
}

#endif
