/*
 * The parts of a fit that are done, in a file that a later run goes on from: a header that says of
 * what fit they are, and a record for each part, appended and synced. What was cut short at its
 * end, by a killed process or a full disk, is left out.
 */
#ifndef OV_FIT_CHECKPOINT_H
#define OV_FIT_CHECKPOINT_H

#include "fit/parts/part.h"

#include <stdio.h>

typedef struct ov_checkpoint {
    FILE *file; /* NULL: none */
    const char *path;
    long end; /* of the last whole record */
} ov_checkpoint;

/* Begins the file, or with resume, where there is one, reads the parts that are done: done[p] tells
 * which. Errors:
 * OVOID_ERROR_IO, also where the file exists and was not to be resumed; OVOID_ERROR_FORMAT where it
 * is no checkpoint; OVOID_ERROR_ARGUMENT where it is of another fit, with the reason. */
ovoid_status ov_checkpoint_open(ovoid_context *context, const char *path, bool resume,
                                ov_parts *parts, bool *done, ov_checkpoint *checkpoint);

/* Adds a part. On errors the file is what it was before. */
ovoid_status ov_checkpoint_add(ovoid_context *context, ov_checkpoint *checkpoint,
                               const ov_parts *parts, size_t part, const ov_part_fit *fit);

void ov_checkpoint_close(ov_checkpoint *checkpoint);

#endif
