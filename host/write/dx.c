/* OpenDX scalar data as APBS writes it (APBS's documentation, "OpenDX scalar data format"): a
 * regular lattice, z fastest, x slowest, three values in a line. */
#include "write/export.h"

typedef struct writer {
    FILE *stream;
    uint64_t written;
} writer;

static void take_values(const float *values, size_t count, void *user) {
    writer *w = user;
    for (size_t k = 0; k < count && !ferror(w->stream); k++)
        fprintf(w->stream, "%.6e%c", (double)values[k], ++w->written % 3 ? ' ' : '\n');
}

static void write_head(const ov_map *map, FILE *stream) {
    const long size[3] = {map->size[0], map->size[1], map->size[2]};
    fprintf(stream,
            "# Data from Ovoid %s\n"
            "#\n"
            "# %s\n"
            "#\n"
            "object 1 class gridpositions counts %ld %ld %ld\n"
            "origin %.9e %.9e %.9e\n",
            ovoid_version(), map->label, size[0], size[1], size[2], map->spacing * map->start[0],
            map->spacing * map->start[1], map->spacing * map->start[2]);
    for (int row = 0; row < 3; row++)
        fprintf(stream, "delta %.9e %.9e %.9e\n", row == 0 ? map->spacing : 0.0,
                row == 1 ? map->spacing : 0.0, row == 2 ? map->spacing : 0.0);
    fprintf(stream,
            "object 2 class gridconnections counts %ld %ld %ld\n"
            "object 3 class array type double rank 0 items %llu data follows\n",
            size[0], size[1], size[2], (unsigned long long)ov_map_points(map));
}

ovoid_status ov_write_dx(ovoid_context *context, const ov_map *map, FILE *stream) {
    static const int fast[3] = {2, 1, 0};
    writer w = {.stream = stream};
    write_head(map, stream);
    ovoid_status status = ov_map_run(context, map, fast, stream, take_values, &w);
    if (status != OVOID_OK)
        return status;
    if (w.written % 3)
        putc('\n', stream);
    fputs("attribute \"dep\" string \"positions\"\n"
          "object \"regular positions regular connections\" class field\n"
          "component \"positions\" value 1\n"
          "component \"connections\" value 2\n"
          "component \"data\" value 3\n",
          stream);
    return OVOID_OK;
}
