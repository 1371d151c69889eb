#include "write/export.h"

#include "base/progress.h"
#include "field/evaluate.h"

#include <math.h>
#include <stdlib.h>

/* Points computed at once: what the evaluation takes in one piece. */
#define PIECE ((size_t)1 << 20)

/* Of these, so many are written between two questions whether to go on. */
#define SLICE ((size_t)1 << 16)

/* 32 GiB of floats. */
#define MOST_POINTS ((double)((uint64_t)1 << 33))

ovoid_status ov_map_cover(ovoid_context *context, ov_map *map, double isovalue) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    double points = 1.0;
    for (size_t i = 0; i < map->count; i++) {
        double half[3] = {0.0, 0.0, 0.0};
        ov_quadric_reach(&map->quadrics[i], isovalue / 100.0, half);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = fmin(low[axis], map->quadrics[i].centre[axis] - half[axis]);
            high[axis] = fmax(high[axis], map->quadrics[i].centre[axis] + half[axis]);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        const double first = floor(low[axis] / map->spacing) - 1.0;
        const double last = ceil(high[axis] / map->spacing) + 1.0;
        if (!(first >= -1e9 && last <= 1e9))
            return ov_fail(context, OVOID_ERROR_LIMIT,
                           "a map from %.6g to %.6g angstrom with a spacing of %.6g is too large",
                           low[axis], high[axis], map->spacing);
        map->start[axis] = (int32_t)first;
        map->size[axis] = (int32_t)(last - first) + 1;
        points *= map->size[axis];
    }
    if (points > MOST_POINTS)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a map with a spacing of %.6g angstrom would have %.3g points (%ld x %ld x "
                       "%ld), more than 2^33: choose a larger spacing",
                       map->spacing, points, (long)map->size[0], (long)map->size[1],
                       (long)map->size[2]);
    return OVOID_OK;
}

uint64_t ov_map_points(const ov_map *map) {
    return (uint64_t)map->size[0] * (uint64_t)map->size[1] * (uint64_t)map->size[2];
}

/* Coordinates of the points first .. first + count - 1 in the order of the file. */
static void place_points(const ov_map *map, const int fast[3], uint64_t first, size_t count,
                         double *xyz) {
    const uint64_t row = (uint64_t)map->size[fast[0]];
    const uint64_t section = row * (uint64_t)map->size[fast[1]];
    for (size_t k = 0; k < count; k++) {
        const uint64_t at = first + k;
        const uint64_t index[3] = {at % row, at / row % (section / row), at / section};
        for (int i = 0; i < 3; i++)
            xyz[3 * k + (size_t)fast[i]] =
                map->spacing * ((double)map->start[fast[i]] + (double)index[i]);
    }
}

ovoid_status ov_map_run(ovoid_context *context, const ov_map *map, const int fast[3], FILE *stream,
                        ov_map_sink sink, void *user) {
    ovoid_status status = OVOID_OK;
    const uint64_t total = ov_map_points(map);
    const size_t piece = total < PIECE ? (size_t)total : PIECE;
    double *xyz = ov_alloc(context, 3 * piece, sizeof *xyz, "a map's points");
    float *values = ov_alloc(context, piece, sizeof *values, "a map's values");
    if (!xyz || !values)
        OV_TRY(OVOID_ERROR_MEMORY);
    for (uint64_t first = 0; first < total && !ferror(stream); first += piece) {
        const size_t count = total - first < piece ? (size_t)(total - first) : piece;
        place_points(map, fast, first, count, xyz);
        OV_TRY(ov_evaluator_run(context, map->evaluator, xyz, count, values, NULL));
        for (size_t k = 0, some; k < count && !ferror(stream); k += some) {
            some = count - k < SLICE ? count - k : SLICE;
            sink(values + k, some, user);
            OV_TRY(ov_progress_step(context, first + k + some, total));
        }
    }

cleanup:
    free(xyz);
    free(values);
    return status;
}
