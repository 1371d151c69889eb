/*
 * Output files that are whole or absent: written beside the final place, renamed at the end.
 */
#ifndef OV_FILE_H
#define OV_FILE_H

#include "base/base.h"

#include <stdio.h>

typedef struct ov_output {
    FILE *stream;    /* write here */
    char *path;      /* final place; NULL for standard output */
    char *temporary; /* where the bytes go until ov_output_commit() */
    bool fresh;      /* there was no file in the final place */
} ov_output;

/* Opens an output; "-" is standard output. Symbolic links are followed and stay. A file that exists
 * keeps its permissions; a new one gets those of the umask. A path that exists and is not a regular
 * file (a device, a FIFO, /dev/stdout) is written in place. */
ovoid_status ov_output_open(ovoid_context *context, const char *path, ov_output *output);

/* Flushes and syncs, checks for write errors (a full disk, a closed pipe), renames into place. On
 * failure the temporary file is removed. The output is closed either way. */
ovoid_status ov_output_commit(ovoid_context *context, ov_output *output);

/* Closes and removes the temporary file; nothing happens on a committed or zeroed output. */
void ov_output_abandon(ov_output *output);

/* A file without a name in the folder, to read and write, on any file system: it has a name for a
 * moment. Returns an error number, or 0. */
int ov_file_nameless(const char *folder, int *descriptor);

/* Fails as ov_output_open() would for this path now, without changing what is there. */
ovoid_status ov_output_check(ovoid_context *context, const char *path);

#endif
