/* glTF 2.0, binary (Khronos Group, "glTF 2.0 Specification", sections 3 and 4): one mesh of one
 * primitive, its buffer holding positions, normals and indices one after the other, all of them
 * multiples of four bytes long.
 *
 * glTF's unit is the metre. A molecule in metres is lost to every viewer, so one unit here is one
 * angstrom, as other programs for molecules have it, and asset.extras says so.
 *
 * Positions are floats. Far from the origin, where these are coarse, they are relative to the
 * middle of the mesh, and the node moves them there. Colours of vertices, where there are any, are
 * linear light in 16 bits, between normals and indices. */
#include "picture/palette.h"
#include "write/bytes.h"
#include "write/mesh_file.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

enum { HEADER = 12, CHUNK_HEADER = 8, VECTOR = 12, COLOUR = 8, TEXT = 3072 };

typedef struct layout {
    size_t vertices, triangles;
    uint64_t vectors; /* bytes of the positions, and of the normals */
    uint64_t colours; /* bytes; 0: none */
    uint64_t indices; /* bytes */
    float low[3], high[3];
    double origin[3]; /* of the positions, angstrom */
} layout;

static void find_layout(const ovoid_mesh *mesh, const ov_colours *colours, layout *l) {
    *l = (layout){.vertices = ovoid_mesh_vertices(mesh), .triangles = ovoid_mesh_triangles(mesh)};
    l->vectors = (uint64_t)l->vertices * VECTOR;
    l->colours = colours ? (uint64_t)l->vertices * COLOUR : 0;
    l->indices = (uint64_t)l->triangles * VECTOR;
    if (!ov_mesh_floats_are_fine(mesh, l->origin))
        ov_mesh_middle(mesh, l->origin);
    for (size_t i = 0; i < l->vertices; i++) {
        float at[3];
        ov_store_turn(mesh->store, i);
        ov_mesh_float_at(mesh, i, l->origin, at);
        for (size_t axis = 0; axis < 3; axis++) {
            l->low[axis] = i == 0 ? at[axis] : fminf(l->low[axis], at[axis]);
            l->high[axis] = i == 0 ? at[axis] : fmaxf(l->high[axis], at[axis]);
        }
    }
}

/* The JSON chunk, filled up with blanks to a multiple of four. Nine digits keep a float. */
static uint32_t print_json(const layout *l, char *text) {
    char moved[128] = "", view[128] = "", accessor[128] = "";
    const uint64_t colours = 2 * l->vectors, indices = colours + l->colours;
    const char *const grey = l->colours ? "1,1,1,1" : "0.8,0.8,0.8,1";
    if (l->colours) {
        snprintf(view, sizeof view,
                 ",{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64
                 ",\"target\":34962}",
                 colours, l->colours);
        snprintf(accessor, sizeof accessor,
                 ",{\"bufferView\":3,\"componentType\":5123,\"normalized\":true,\"count\":%zu,"
                 "\"type\":\"VEC4\"}",
                 l->vertices);
    }
    if (l->origin[0] != 0.0 || l->origin[1] != 0.0 || l->origin[2] != 0.0)
        snprintf(moved, sizeof moved, ",\"translation\":[%.9g,%.9g,%.9g]", l->origin[0],
                 l->origin[1], l->origin[2]);
    int length = snprintf(
        text, TEXT,
        "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Ovoid %s\","
        "\"extras\":{\"unit\":\"angstrom\"}},"
        "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"mesh\":0,\"name\":\"surface\"%s}],"
        "\"meshes\":[{\"name\":\"surface\",\"primitives\":[{\"attributes\":{\"POSITION\":0,"
        "\"NORMAL\":1%s},\"indices\":2,\"material\":0,\"mode\":4}]}],"
        "\"materials\":[{\"name\":\"surface\",\"pbrMetallicRoughness\":{\"baseColorFactor\":"
        "[%s],\"metallicFactor\":0,\"roughnessFactor\":0.6}}],"
        "\"buffers\":[{\"byteLength\":%" PRIu64 "}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":%" PRIu64
        ",\"target\":34962},"
        "{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"target\":34962},"
        "{\"buffer\":0,\"byteOffset\":%" PRIu64 ",\"byteLength\":%" PRIu64 ",\"target\":34963}%s],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":%zu,\"type\":\"VEC3\","
        "\"min\":[%.9g,%.9g,%.9g],\"max\":[%.9g,%.9g,%.9g]},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":%zu,\"type\":\"VEC3\"},"
        "{\"bufferView\":2,\"componentType\":5125,\"count\":%zu,\"type\":\"SCALAR\"}%s]}",
        ovoid_version(), moved, l->colours ? ",\"COLOR_0\":3" : "", grey, indices + l->indices,
        l->vectors, l->vectors, l->vectors, indices, l->indices, view, l->vertices,
        (double)l->low[0], (double)l->low[1], (double)l->low[2], (double)l->high[0],
        (double)l->high[1], (double)l->high[2], l->vertices, 3 * l->triangles, accessor);
    while (length % 4)
        text[length++] = ' ';
    return (uint32_t)length;
}

/* The specification wants unit normals; a vertex of triangles without area may have none. */
static void put_normal(ov_bytes *bytes, const float *normal) {
    double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    bool usable = isfinite(length) && length > 0.0;
    for (int axis = 0; axis < 3; axis++)
        ov_put_f32(bytes, usable ? (float)(n[axis] / length) : axis == 2 ? 1.0f : 0.0f);
}

static void put_colour(ov_bytes *bytes, const uint8_t *rgb) {
    for (int k = 0; k < 3; k++)
        ov_put_u16(bytes, (unsigned)lround(UINT16_MAX * ov_srgb_decode(rgb[k])));
    ov_put_u16(bytes, UINT16_MAX);
}

static ovoid_status put_buffer(ovoid_context *context, ov_bytes *bytes, const ovoid_mesh *mesh,
                               const ov_colours *colours, const layout *l) {
    ovoid_status status = OVOID_OK;
    const float *normals = ovoid_mesh_normals(mesh);
    const uint32_t *corners = ovoid_mesh_corners(mesh);
    for (size_t i = 0; i < l->vertices; i++) {
        float at[3];
        OV_TRY(ov_mesh_turn(context, mesh, i, l->vertices));
        ov_mesh_float_at(mesh, i, l->origin, at);
        for (size_t axis = 0; axis < 3; axis++)
            ov_put_f32(bytes, at[axis]);
    }
    for (size_t i = 0; i < l->vertices; i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, l->vertices));
        put_normal(bytes, normals + 3 * i);
    }
    for (size_t i = 0; colours && i < l->vertices; i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, l->vertices));
        put_colour(bytes, colours->rgb + 3 * i);
    }
    for (size_t i = 0; i < 3 * l->triangles; i++) {
        OV_TRY(ov_mesh_turn(context, mesh, i, 3 * l->triangles));
        ov_put_u32(bytes, corners[i]);
    }
cleanup:
    return status;
}

ovoid_status ov_write_glb(ovoid_context *context, const ovoid_mesh *mesh, FILE *stream) {
    return ov_write_glb_with(context, mesh, NULL, stream);
}

ovoid_status ov_write_glb_with(ovoid_context *context, const ovoid_mesh *mesh,
                               const ov_colours *colours, FILE *stream) {
    layout l;
    char json[TEXT];
    ov_bytes bytes = {.stream = stream};
    find_layout(mesh, colours, &l);
    if (!ov_mesh_floats_suffice(mesh, l.origin))
        return ov_fail(
            context, OVOID_ERROR_LIMIT,
            "glTF has single precision alone, which is too coarse for a mesh that is so large "
            "and so fine: write .ply");
    const uint32_t json_length = print_json(&l, json);
    const uint64_t buffer = 2 * l.vectors + l.colours + l.indices;
    const uint64_t total = HEADER + 2 * CHUNK_HEADER + json_length + buffer;
    if (total > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a glTF binary file holds 4 GiB at most, the mesh needs %.1f: write .ply",
                       (double)total / (1 << 30));
    ov_put_text(&bytes, "glTF", 4);
    ov_put_u32(&bytes, 2);
    ov_put_u32(&bytes, (uint32_t)total);
    ov_put_u32(&bytes, json_length);
    ov_put_text(&bytes, "JSON", 4);
    ov_put_text(&bytes, json, json_length);
    ov_put_u32(&bytes, (uint32_t)buffer);
    ov_put_text(&bytes, "BIN\0", 4);
    const ovoid_status status = put_buffer(context, &bytes, mesh, colours, &l);
    ov_bytes_flush(&bytes);
    return status;
}
