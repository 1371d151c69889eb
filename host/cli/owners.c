#include "fit.h"

#include <string.h>

enum { ROW_BYTES = 256 };

/* What tells an atom from others comes between its number and its ellipsoid. */
static const char header[] = "atom,x,y,z,ellipsoid\n";

/* Both are counted from 1: as records of the molecule's file that hold an atom, and as lines of the
 * model's file that hold an ellipsoid. */
static ovoid_status write_row(ovoid_context *context, ovoid_file *file, size_t atom,
                              const double xyz[3], uint32_t ellipsoid) {
    char row[ROW_BYTES];
    const int length = snprintf(row, sizeof row, "%zu,%.10g,%.10g,%.10g,%lu\n", atom + 1, xyz[0],
                                xyz[1], xyz[2], (unsigned long)ellipsoid + 1);
    return ovoid_file_write(context, file, row, (size_t)length);
}

ovoid_status fit_owners_write(const fit_job *job, const fit_level *level) {
    const uint32_t *const owner = ovoid_model_owner(level->model);
    const size_t atoms = ovoid_model_owner_count(level->model);
    const double *const xyzr = ovoid_molecule_xyzr(job->molecule);
    ovoid_file *file = NULL;
    ovoid_status status = ovoid_file_create(job->context, level->owners, &file);
    if (status == OVOID_OK)
        status = ovoid_file_write(job->context, file, header, strlen(header));
    for (size_t i = 0; i < atoms && status == OVOID_OK; i++)
        status = write_row(job->context, file, i, xyzr + 4 * i, owner[i]);
    if (status == OVOID_OK)
        status = ovoid_file_commit(job->context, file);
    ovoid_file_destroy(&file);
    return status;
}
