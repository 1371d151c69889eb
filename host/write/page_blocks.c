#include "write/page_blocks.h"

#include "base/progress.h"
#include "write/base64.h"
#include "write/export.h"

#include <math.h>
#include <stdlib.h>
#include <zlib.h>

enum { STEPS = 65535, NORMAL_STEPS = 1023, SCALAR_STEPS = 127 };

/* ---- deflate and base64 ------------------------------------------------------------------- */

ovoid_status ov_page_put_text(ovoid_context *context, const char *text, size_t length,
                              const char *id, FILE *stream) {
    ovoid_status status = OVOID_OK;
    uLongf size = compressBound((uLong)length);
    ov_base64 text64 = {.stream = stream};
    unsigned char *packed = ov_alloc(context, size, 1, "a block of a page");
    if (!packed)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_progress_ask(context));
    if (compress2(packed, &size, (const Bytef *)text, (uLong)length, Z_DEFAULT_COMPRESSION) != Z_OK)
        OV_TRY(ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a block of a page"));
    fprintf(stream, "<script type=\"application/octet-stream\" id=\"%s\">", id);
    ov_base64_put(&text64, packed, size);
    ov_base64_end(&text64);
    fputs("</script>\n", stream);
cleanup:
    free(packed);
    return status;
}

/* ---- blocks in memory ----------------------------------------------------------------------- */

typedef struct block {
    ov_bytes bytes;
    char *data;
    size_t size;
} block;

static ovoid_status block_open(ovoid_context *context, block *b) {
    b->data = NULL;
    b->bytes.used = 0;
    b->bytes.stream = open_memstream(&b->data, &b->size);
    return b->bytes.stream ? OVOID_OK
                           : ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a page");
}

/* Puts it into the page; nothing is left of it. */
static ovoid_status block_end(ovoid_context *context, block *b, const char *id, FILE *stream) {
    ovoid_status status = OVOID_OK;
    ov_bytes_flush(&b->bytes);
    const bool failed = ferror(b->bytes.stream) != 0;
    if (fclose(b->bytes.stream) != 0 || failed)
        status = ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a page");
    else
        status = ov_page_put_text(context, b->data, b->size, id, stream);
    free(b->data);
    return status;
}

static void block_drop(block *b) {
    fclose(b->bytes.stream);
    free(b->data);
}

static uint32_t zigzag(int64_t value) {
    return (uint32_t)(value < 0 ? -2 * value - 1 : 2 * value);
}

/* Seven bits at a time, the lowest first. */
static void put_varint(ov_bytes *bytes, uint32_t value) {
    for (; value >= 0x80; value >>= 7)
        ov_put_u8(bytes, (value & 0x7f) | 0x80);
    ov_put_u8(bytes, value);
}

/* ---- surfaces ------------------------------------------------------------------------------ */

void ov_page_box_of(const ovoid_mesh *mesh, ov_page_box *box) {
    const double *const xyz = ovoid_mesh_xyz(mesh);
    double longest = 0.0;
    for (size_t axis = 0; axis < 3; axis++) {
        double high = box->low[axis] = xyz[axis];
        for (size_t v = 1; v < ovoid_mesh_vertices(mesh); v++) {
            box->low[axis] = fmin(box->low[axis], xyz[3 * v + axis]);
            high = fmax(high, xyz[3 * v + axis]);
        }
        longest = fmax(longest, high - box->low[axis]);
    }
    box->step = longest > 0.0 ? longest / STEPS : 1.0;
}

/* Differences of whole numbers, as varints: those of one axis after the other, which are alike. */
static void put_positions(ov_bytes *bytes, const ovoid_mesh *mesh, const ov_page_box *box) {
    const double *const xyz = ovoid_mesh_xyz(mesh);
    for (size_t axis = 0; axis < 3; axis++) {
        long before = 0;
        for (size_t v = 0; v < ovoid_mesh_vertices(mesh); v++) {
            const long at = lround((xyz[3 * v + axis] - box->low[axis]) / box->step);
            put_varint(bytes, zigzag(at - before));
            before = at;
        }
    }
}

/* Octahedral (Meyer and others, "On Floating-Point Normal Vectors", 2010): the octahedron
 * |x| + |y| + |z| = 1, its lower half folded out, is a square. */
static void fold_normal(const float n[3], long folded[2]) {
    const double sum = fabs((double)n[0]) + fabs((double)n[1]) + fabs((double)n[2]);
    double x = sum > 0.0 ? (double)n[0] / sum : 0.0, y = sum > 0.0 ? (double)n[1] / sum : 0.0;
    if (n[2] < 0.0f) {
        const double kept = x;
        x = copysign(1.0 - fabs(y), x);
        y = copysign(1.0 - fabs(kept), y);
    }
    folded[0] = lround(x * NORMAL_STEPS);
    folded[1] = lround(y * NORMAL_STEPS);
}

static void put_normals(ov_bytes *bytes, const ovoid_mesh *mesh) {
    const float *const normals = ovoid_mesh_normals(mesh);
    for (size_t k = 0; k < 2; k++) {
        long before = 0;
        for (size_t v = 0; v < ovoid_mesh_vertices(mesh); v++) {
            long folded[2];
            fold_normal(normals + 3 * v, folded);
            put_varint(bytes, zigzag(folded[k] - before));
            before = folded[k];
        }
    }
}

static ovoid_status put_corners(ovoid_context *context, ov_bytes *bytes, const ovoid_mesh *mesh) {
    ovoid_status status = OVOID_OK;
    const uint32_t *const corners = ovoid_mesh_corners(mesh);
    const size_t count = 3 * ovoid_mesh_triangles(mesh);
    int64_t before = 0;
    for (size_t i = 0; i < count; i++) {
        OV_TRY(ov_progress_turn(context, i, count));
        put_varint(bytes, zigzag((int64_t)corners[i] - before));
        before = corners[i];
    }
cleanup:
    return status;
}

ovoid_status ov_page_put_surface(ovoid_context *context, const ovoid_mesh *mesh,
                                 const ov_page_box *box, const char *id, FILE *stream) {
    block b;
    ovoid_status status = block_open(context, &b);
    if (status != OVOID_OK)
        return status;
    put_positions(&b.bytes, mesh, box);
    put_normals(&b.bytes, mesh);
    status = put_corners(context, &b.bytes, mesh);
    if (status == OVOID_OK)
        return block_end(context, &b, id, stream);
    block_drop(&b);
    return status;
}

ovoid_status ov_page_put_scalars(ovoid_context *context, const float *values, size_t count,
                                 double range, const char *id, FILE *stream) {
    block b;
    const ovoid_status status = block_open(context, &b);
    if (status != OVOID_OK)
        return status;
    unsigned before = 0;
    for (size_t i = 0; i < count; i++) {
        const double share = fmin(fmax((double)values[i] / range, -1.0), 1.0);
        const unsigned at = (unsigned)(lround(share * SCALAR_STEPS) + SCALAR_STEPS);
        ov_put_u8(&b.bytes, (at - before) & 0xff);
        before = at;
    }
    return block_end(context, &b, id, stream);
}

/* ---- ellipsoids ----------------------------------------------------------------------------- */

static void put_ellipsoid(ov_bytes *bytes, const ovoid_ellipsoid *e, double isovalue,
                          const double origin[3], double atoms) {
    ov_solid s;
    ov_solid_of_ellipsoid(e, isovalue, &s);
    for (int k = 0; k < 3; k++)
        ov_put_f32(bytes, (float)(s.centre[k] - origin[k]));
    for (int k = 0; k < 3; k++)
        ov_put_f32(bytes, (float)s.semi[k]);
    for (int p = 0; p < 2; p++)
        for (int k = 0; k < 3; k++)
            ov_put_f32(bytes, (float)s.axis[p][k]);
    ov_put_f32(bytes, (float)e->amplitude);
    ov_put_f32(bytes, (float)atoms);
}

ovoid_status ov_page_put_ellipsoids(ovoid_context *context, const ovoid_model *model,
                                    double isovalue, const double origin[3], const uint32_t *first,
                                    const char *id, FILE *stream) {
    block b;
    const ovoid_status status = block_open(context, &b);
    if (status != OVOID_OK)
        return status;
    for (size_t i = 0; i < ovoid_model_size(model); i++)
        put_ellipsoid(&b.bytes, ovoid_model_ellipsoids(model) + i, isovalue, origin,
                      first ? first[i + 1] - first[i] : -1.0);
    return block_end(context, &b, id, stream);
}
