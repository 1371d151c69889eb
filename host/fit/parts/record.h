/*
 * What a part, or a patch, came to as bytes, for a checkpoint or for other ranks: a record of fixed
 * size, then the ellipsoids and the atoms' owners.
 */
#ifndef OV_FIT_RECORD_H
#define OV_FIT_RECORD_H

#include "fit/parts/bytes.h"
#include "fit/parts/part.h"

typedef struct ov_record {
    uint64_t part, ellipsoids, atoms; /* no ellipsoids: no owners of the atoms either */
    uint64_t points, iterations, solver_iterations;
    uint64_t counts[OVOID_COUNTS];
    double spacing, distance;
    uint64_t verdict;
    uint64_t hash; /* of the ellipsoids, the owners, and of this with hash 0 */
} ov_record;

/* Appends what part `part` of so many atoms came to. */
ovoid_status ov_record_put(ovoid_context *context, size_t part, size_t atoms,
                           const ov_part_fit *fit, ov_bytes *to);

/* Whether there can be such a record: for one that was read from a file, before its
 * ov_record_rest() bytes of ellipsoids and owners are. */
bool ov_record_is_sound(const ov_record *record);
size_t ov_record_rest(const ov_record *record);

/* Takes what follows a record, into an empty *fit. OVOID_ERROR_FORMAT where it is not what the
 * record was made of. */
ovoid_status ov_record_read(ovoid_context *context, const ov_record *record, ov_reading *from,
                            ov_part_fit *fit);

/* Takes record and fit, of part `part` of so many atoms. */
ovoid_status ov_record_take(ovoid_context *context, size_t part, size_t atoms, ov_reading *from,
                            ov_part_fit *fit);

#endif
