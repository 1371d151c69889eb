/*
 * replay FILE|FOLDER...: the harness that this is linked with, on each file once. In builds without
 * libFuzzer, so that harnesses and seeds hold with every compiler.
 */
#include "fuzz.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static unsigned replayed;

static void replay_file(const char *path) {
    FILE *file = fopen(path, "rb");
    char *data = NULL, piece[4096];
    size_t size = 0, got;
    if (!file) {
        perror(path);
        exit(1);
    }
    while ((got = fread(piece, 1, sizeof piece, file)) > 0) {
        char *longer = realloc(data, size + got);
        if (!longer)
            abort();
        data = longer;
        memcpy(data + size, piece, got);
        size += got;
    }
    fclose(file);
    fprintf(stderr, "%s\n", path); /* the last one, where it ends here */
    LLVMFuzzerTestOneInput((const uint8_t *)(data ? data : ""), size);
    free(data);
    replayed++;
}

static void replay(const char *path) {
    DIR *folder = opendir(path);
    if (!folder) {
        replay_file(path);
        return;
    }
    const struct dirent *entry;
    char name[4096];
    while ((entry = readdir(folder)) != NULL)
        if (entry->d_name[0] != '.') {
            snprintf(name, sizeof name, "%s/%s", path, entry->d_name);
            replay(name);
        }
    closedir(folder);
}

int main(int argc, char **argv) {
    LLVMFuzzerTestOneInput((const uint8_t *)"", 0);
    for (int i = 1; i < argc; i++)
        replay(argv[i]);
    printf("%u inputs\n", replayed);
    return replayed ? 0 : 1;
}
