/* CCP4 and MRC maps, after MRC2014 (A. Cheng et al., J. Struct. Biol. 192, 146, 2015; CCP-EM, "MRC/
 * CCP4 2014 file format specification"). Words count from 1, four bytes each.
 *
 * Mode 2, x fastest, z slowest, right angles. The map is the whole of a cell (MX = NX) or, where it
 * lies far from the origin, a part of one. Its first point lies at NXSTART times the spacing, and
 * ORIGIN is 0. Programs for crystals go by NXSTART alone and do not look at ORIGIN; those of
 * electron microscopy take ORIGIN only where it is not 0; and some add the two, so that a file may
 * not say the same thing twice. */
#include "write/bytes.h"
#include "write/export.h"

#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { HEADER = 1024, LABEL = 80, LABELS = 10, VERSION = 20140 };

typedef struct statistics {
    float low, high;
    double sum, squares;
} statistics;

typedef struct writer {
    ov_bytes bytes;
    statistics of;
} writer;

static void take_values(const float *values, size_t count, void *user) {
    writer *w = user;
    for (size_t k = 0; k < count; k++) {
        const float value = values[k];
        w->of.low = fminf(w->of.low, value);
        w->of.high = fmaxf(w->of.high, value);
        w->of.sum += (double)value;
        w->of.squares += (double)value * (double)value;
        ov_put_f32(&w->bytes, value);
    }
    ov_bytes_flush(&w->bytes);
}

static void put_zeros(ov_bytes *bytes, int words) {
    for (int i = 0; i < words; i++)
        ov_put_u32(bytes, 0);
}

static void put_labels(ov_bytes *bytes, const ov_map *map) {
    char label[LABEL + 1] = "";
    ov_put_u32(bytes, 1); /* 56: NLABL */
    snprintf(label, sizeof label, "Ovoid %.12s: %.60s", ovoid_version(), map->label);
    memset(label + strlen(label), ' ', LABEL - strlen(label));
    ov_put_text(bytes, label, LABEL);
    put_zeros(bytes, (LABELS - 1) * LABEL / 4);
}

/* ChimeraX takes an NXSTART of more than ten times the longest side of cell and map to be no number
 * at all, and puts the map at the origin. */
enum { START_MOST = 9 };

/* MX, MY, MZ: the map's, except that the axis along which it lies farthest out is long enough. */
static void choose_cell(const ov_map *map, uint32_t cell[3]) {
    uint32_t longest = 0, farthest = 0;
    int axis_out = 0;
    for (int axis = 0; axis < 3; axis++) {
        const uint32_t out = (uint32_t)labs((long)map->start[axis]);
        cell[axis] = (uint32_t)map->size[axis];
        longest = cell[axis] > longest ? cell[axis] : longest;
        if (out > farthest) {
            farthest = out;
            axis_out = axis;
        }
    }
    if (farthest / START_MOST >= longest)
        cell[axis_out] = farthest / START_MOST + 1;
}

/* of: NULL where the statistics are not known, which a maximum under the minimum, a mean under both
 * and a negative deviation tell. */
static void put_header(ov_bytes *bytes, const ov_map *map, const statistics *of) {
    const double points = (double)ov_map_points(map);
    uint32_t cell[3];
    choose_cell(map, cell);
    const double mean = of ? of->sum / points : -2.0;
    const double variance = of ? of->squares / points - mean * mean : 0.0;
    for (int axis = 0; axis < 3; axis++) /* 1 to 3: NX, NY, NZ */
        ov_put_u32(bytes, (uint32_t)map->size[axis]);
    ov_put_u32(bytes, 2);                /* 4: MODE, floats */
    for (int axis = 0; axis < 3; axis++) /* 5 to 7: NXSTART */
        ov_put_u32(bytes, (uint32_t)map->start[axis]);
    for (int axis = 0; axis < 3; axis++) /* 8 to 10: MX */
        ov_put_u32(bytes, cell[axis]);
    for (int axis = 0; axis < 3; axis++) /* 11 to 13: cell, angstrom */
        ov_put_f32(bytes, (float)(map->spacing * cell[axis]));
    for (int axis = 0; axis < 3; axis++) /* 14 to 16: angles, degrees */
        ov_put_f32(bytes, 90.0f);
    for (uint32_t axis = 1; axis <= 3; axis++) /* 17 to 19: MAPC, MAPR, MAPS */
        ov_put_u32(bytes, axis);
    ov_put_f32(bytes, of ? of->low : 0.0f);   /* 20: DMIN */
    ov_put_f32(bytes, of ? of->high : -1.0f); /* 21: DMAX */
    ov_put_f32(bytes, (float)mean);           /* 22: DMEAN */
    ov_put_u32(bytes, 1);                     /* 23: ISPG, a volume in P 1 */
    put_zeros(bytes, 4);                      /* 24 to 27: NSYMBT, EXTRA, EXTTYP */
    ov_put_u32(bytes, VERSION);               /* 28: NVERSION */
    put_zeros(bytes, 21);                     /* 29 to 49: EXTRA */
    put_zeros(bytes, 3);                      /* 50 to 52: ORIGIN, where NXSTART says it */
    ov_put_text(bytes, "MAP ", 4);            /* 53 */
    ov_put_text(bytes, "DD\0\0", 4);          /* 54: MACHST, little-endian */
    ov_put_f32(bytes, of ? (float)sqrt(fmax(variance, 0.0)) : -1.0f); /* 55: RMS about the mean */
    put_labels(bytes, map);
    ov_bytes_flush(bytes);
}

/* Whether the header can be written once more at the end: not in a pipe, nor where all that is
 * written is appended. */
static bool can_return(FILE *stream, off_t *begin) {
    const int flags = fcntl(fileno(stream), F_GETFL);
    *begin = ftello(stream);
    return *begin >= 0 && flags != -1 && !(flags & O_APPEND);
}

ovoid_status ov_write_ccp4(ovoid_context *context, const ov_map *map, FILE *stream) {
    static const int fast[3] = {0, 1, 2};
    writer w = {.bytes = {.stream = stream}, .of = {INFINITY, -INFINITY, 0.0, 0.0}};
    off_t begin;
    const bool returns = can_return(stream, &begin);
    put_header(&w.bytes, map, NULL);
    ovoid_status status = ov_map_run(context, map, fast, stream, take_values, &w);
    if (status != OVOID_OK || ferror(stream) || !returns)
        return status;
    if (fseeko(stream, begin, SEEK_SET) == 0) {
        put_header(&w.bytes, map, &w.of);
        (void)fseeko(stream, 0, SEEK_END);
    }
    return OVOID_OK;
}
