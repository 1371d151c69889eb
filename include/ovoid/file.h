/*
 * Output files that are whole or absent.
 */
#ifndef OVOID_FILE_H
#define OVOID_FILE_H

#include "ovoid/context.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A file that is whole or absent: its bytes go to a temporary file in the same folder, which takes
 * the final name at the end. Symbolic links are followed and stay, and a file that is replaced
 * keeps its permissions. "-" is standard output. What exists and is no regular file (a device, a
 * FIFO) is written in place. ovoid_model_write() writes this way; so can what goes beside a model.
 */
typedef struct ovoid_file ovoid_file;

/* OVOID_ERROR_IO if a file could not be written at `path` now, with the reason: no such folder, no
 * permission, a folder in its place. Changes nothing; made to be asked before long work. */
OVOID_API ovoid_status ovoid_file_check(ovoid_context *context, const char *path);

OVOID_API ovoid_status ovoid_file_create(ovoid_context *context, const char *path,
                                         ovoid_file **file);

/* The folder in which the bytes for `path` are until the file is whole: that of its final place,
 * links followed. Of what is no regular file, and of "-", the folder that TMPDIR names, or /tmp. To
 * be freed with ovoid_free(). OVOID_ERROR_IO as of ovoid_file_check(), but for the folder, which is
 * not looked at. */
OVOID_API ovoid_status ovoid_file_folder(ovoid_context *context, const char *path, char **folder);

/* Appends `bytes` bytes, buffered. */
OVOID_API ovoid_status ovoid_file_write(ovoid_context *context, ovoid_file *file, const void *data,
                                        size_t bytes);

/* Removes the temporary files of all outputs under way in this process, in every context. For a
 * signal handler that is about to end the process, and safe there (async-signal-safe): whoever
 * writes one of the files meets an error afterwards. */
OVOID_API void ovoid_remove_temporaries(void);

/* Writes out what is buffered and gives the file its name. On success and on failure alike the file
 * takes no more data; on failure nothing is left of it. */
OVOID_API ovoid_status ovoid_file_commit(ovoid_context *context, ovoid_file *file);

/* Drops the file; one that was not committed leaves nothing behind. */
OVOID_API void ovoid_file_destroy(ovoid_file **file);

#ifdef __cplusplus
}
#endif

#endif
