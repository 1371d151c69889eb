/* 3MF ("3D Manufacturing Format Core Specification" 1.3, and its "Materials and Properties
 * Extension"): a zip archive of three parts, of which 3D/3dmodel.model has the mesh, and a group of
 * colours that triangles refer to by their corners. 1 angstrom is 1 millimetre; the item is moved
 * to where coordinates are positive, as printers want it. */
#include "write/paint.h"
#include "write/text.h"

#include "base/progress.h"
#include "write/bytes.h"
#include "write/mesh_file.h"

#include <math.h>
#include <stdlib.h>
#include <zlib.h>

/* ---- zip ------------------------------------------------------------------------------------- */

enum { PARTS = 3, DEFLATED = 8, DOS_DATE = 0x21 /* 1 January 1980 */ };

typedef struct part {
    const char *name;
    unsigned char *data; /* packed, owned */
    size_t size, whole;  /* bytes of it, and of what was packed */
    uint32_t check;
} part;

/* "Appnote" of PKWARE, sections 4.3.7 and 4.3.12: what the local and the central header share. */
static void put_facts(ov_bytes *bytes, const part *p) {
    ov_put_u16(bytes, 20);
    ov_put_u16(bytes, 0);
    ov_put_u16(bytes, DEFLATED);
    ov_put_u16(bytes, 0);
    ov_put_u16(bytes, DOS_DATE);
    ov_put_u32(bytes, p->check);
    ov_put_u32(bytes, (uint32_t)p->size);
    ov_put_u32(bytes, (uint32_t)p->whole);
    ov_put_u16(bytes, (unsigned)strlen(p->name));
    ov_put_u16(bytes, 0);
}

static uint32_t put_part(ov_bytes *bytes, const part *p) {
    ov_put_u32(bytes, 0x04034b50);
    put_facts(bytes, p);
    ov_put_text(bytes, p->name, strlen(p->name));
    ov_put_text(bytes, (const char *)p->data, p->size);
    return (uint32_t)(30 + strlen(p->name) + p->size);
}

static uint32_t put_entry(ov_bytes *bytes, const part *p, uint32_t offset) {
    ov_put_u32(bytes, 0x02014b50);
    ov_put_u16(bytes, 20);
    put_facts(bytes, p);
    ov_put_u16(bytes, 0);
    ov_put_u16(bytes, 0);
    ov_put_u16(bytes, 0);
    ov_put_u32(bytes, 0);
    ov_put_u32(bytes, offset);
    ov_put_text(bytes, p->name, strlen(p->name));
    return (uint32_t)(46 + strlen(p->name));
}

static void put_archive(const part *parts, FILE *stream) {
    ov_bytes bytes = {.stream = stream};
    uint32_t offset[PARTS], at = 0, directory = 0;
    for (int i = 0; i < PARTS; i++) {
        offset[i] = at;
        at += put_part(&bytes, &parts[i]);
    }
    for (int i = 0; i < PARTS; i++)
        directory += put_entry(&bytes, &parts[i], offset[i]);
    ov_put_u32(&bytes, 0x06054b50);
    ov_put_u32(&bytes, 0);
    ov_put_u16(&bytes, PARTS);
    ov_put_u16(&bytes, PARTS);
    ov_put_u32(&bytes, directory);
    ov_put_u32(&bytes, at);
    ov_put_u16(&bytes, 0);
    ov_bytes_flush(&bytes);
}

/* Deflate without zlib's own header and end. */
static ovoid_status pack(ovoid_context *context, const char *text, size_t length, part *p) {
    z_stream z = {0};
    if (length > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a part of a 3MF file holds 4 GiB at most: choose a larger spacing");
    if (deflateInit2(&z, Z_DEFAULT_COMPRESSION, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a 3MF file");
    const size_t room = deflateBound(&z, (uLong)length);
    p->data = ov_alloc(context, room, 1, "a 3MF file");
    z.next_in = (Bytef *)(uintptr_t)text;
    z.avail_in = (uInt)length;
    z.next_out = p->data;
    z.avail_out = (uInt)room;
    const bool done = p->data && deflate(&z, Z_FINISH) == Z_STREAM_END;
    p->size = z.total_out;
    p->whole = length;
    p->check = (uint32_t)crc32_z(0, (const Bytef *)text, length);
    deflateEnd(&z);
    return done ? OVOID_OK : ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a 3MF file");
}

/* ---- the parts ------------------------------------------------------------------------------- */

static const char types[] =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
    "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">"
    "<Default Extension=\"rels\" "
    "ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>"
    "<Default Extension=\"model\" "
    "ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/></Types>\n";
static const char relations[] =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
    "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
    "<Relationship Target=\"/3D/3dmodel.model\" Id=\"rel0\" "
    "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>\n";

static int by_colour(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

static uint32_t colour_at(const uint8_t *rgb, size_t vertex) {
    return (uint32_t)rgb[3 * vertex] << 16 | (uint32_t)rgb[3 * vertex + 1] << 8 |
           rgb[3 * vertex + 2];
}

/* The colours that there are, each once, in ascending order; *count of them, to be freed. */
static ovoid_status find_colours(ovoid_context *context, const ov_painted *p, uint32_t **colours,
                                 size_t *count) {
    const size_t vertices = ovoid_mesh_vertices(p->mesh);
    *count = 0;
    *colours = ov_alloc(context, vertices, sizeof **colours, "colours of a 3MF file");
    if (!*colours)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < vertices; v++)
        (*colours)[v] = colour_at(p->rgb, v);
    qsort(*colours, vertices, sizeof **colours, by_colour);
    for (size_t v = 0; v < vertices; v++)
        if (v == 0 || (*colours)[v] != (*colours)[*count - 1])
            (*colours)[(*count)++] = (*colours)[v];
    return OVOID_OK;
}

static size_t colour_number(const ov_painted *p, const uint32_t *colours, size_t count,
                            size_t vertex) {
    const uint32_t colour = colour_at(p->rgb, vertex);
    const uint32_t *const found = bsearch(&colour, colours, count, sizeof *colours, by_colour);
    return (size_t)(found - colours);
}

static ovoid_status put_mesh(ovoid_context *context, const ov_painted *p, const uint32_t *colours,
                             size_t count, FILE *xml) {
    ovoid_status status = OVOID_OK;
    const size_t vertices = ovoid_mesh_vertices(p->mesh), triangles = ovoid_mesh_triangles(p->mesh);
    const uint32_t *const corners = ovoid_mesh_corners(p->mesh);
    const int digits = ov_mesh_digits(p->mesh);
    fputs("<mesh><vertices>\n", xml);
    for (size_t v = 0; v < vertices && !ferror(xml); v++) {
        const double *const x = ovoid_mesh_xyz(p->mesh) + 3 * v;
        OV_TRY(ov_progress_turn(context, v, vertices));
        fprintf(xml, "<vertex x=\"%.*g\" y=\"%.*g\" z=\"%.*g\"/>\n", digits, x[0], digits, x[1],
                digits, x[2]);
    }
    fputs("</vertices><triangles>\n", xml);
    for (size_t i = 0; i < triangles && !ferror(xml); i++) {
        const uint32_t *const c = corners + 3 * i;
        OV_TRY(ov_progress_turn(context, i, triangles));
        fprintf(xml, "<triangle v1=\"%lu\" v2=\"%lu\" v3=\"%lu\"", (unsigned long)c[0],
                (unsigned long)c[1], (unsigned long)c[2]);
        if (colours)
            fprintf(xml, " pid=\"1\" p1=\"%zu\" p2=\"%zu\" p3=\"%zu\"",
                    colour_number(p, colours, count, c[0]), colour_number(p, colours, count, c[1]),
                    colour_number(p, colours, count, c[2]));
        fputs("/>\n", xml);
    }
    fputs("</triangles></mesh>", xml);
cleanup:
    return status;
}

static void put_item(const ovoid_mesh *mesh, FILE *xml) {
    double low[3] = {INFINITY, INFINITY, INFINITY};
    for (size_t k = 0; k < 3 * ovoid_mesh_vertices(mesh); k++)
        low[k % 3] = fmin(low[k % 3], ovoid_mesh_xyz(mesh)[k]);
    fprintf(xml, "<item objectid=\"2\" transform=\"1 0 0 0 1 0 0 0 1 %.9g %.9g %.9g\"/>",
            -floor(low[0]), -floor(low[1]), -floor(low[2]));
}

static ovoid_status put_model(ovoid_context *context, const ov_painted *p, const char *title,
                              FILE *xml) {
    ovoid_status status = OVOID_OK;
    uint32_t *colours = NULL;
    size_t count = 0;
    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
          "<model unit=\"millimeter\" xml:lang=\"en-US\" "
          "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" "
          "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\">\n"
          "<metadata name=\"Title\">",
          xml);
    ov_markup_text(title, xml);
    fprintf(xml,
            "</metadata><metadata name=\"Application\">Ovoid %s</metadata>"
            "<metadata name=\"Description\">1 millimetre is 1 angstrom</metadata>\n<resources>",
            ovoid_version());
    if (p->rgb) {
        OV_TRY(find_colours(context, p, &colours, &count));
        fputs("<m:colorgroup id=\"1\">", xml);
        for (size_t i = 0; i < count; i++)
            fprintf(xml, "<m:color color=\"#%06lX\"/>", (unsigned long)colours[i]);
        fputs("</m:colorgroup>\n", xml);
    }
    fputs("<object id=\"2\" type=\"model\"", xml);
    fputs(p->rgb ? " pid=\"1\" pindex=\"0\">" : ">", xml);
    OV_TRY(put_mesh(context, p, colours, count, xml));
    fputs("</object></resources>\n<build>", xml);
    put_item(p->mesh, xml);
    fputs("</build></model>\n", xml);
cleanup:
    free(colours);
    return status;
}

static ovoid_status pack_model(ovoid_context *context, const ov_painted *p, const char *title,
                               part *packed) {
    ovoid_status status = OVOID_OK;
    char *text = NULL;
    size_t length = 0;
    FILE *xml = open_memstream(&text, &length);
    if (!xml)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a 3MF file");
    OV_TRY(put_model(context, p, title, xml));
    const bool failed = ferror(xml) != 0, closed = fclose(xml) == 0;
    xml = NULL;
    if (failed || !closed)
        OV_TRY(ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a 3MF file"));
    status = pack(context, text, length, packed);
cleanup:
    if (xml)
        fclose(xml);
    free(text);
    return status;
}

ovoid_status ov_write_3mf(ovoid_context *context, const ov_scene *scene,
                          const ovoid_export_options *options, const char *title, FILE *stream) {
    ovoid_status status = OVOID_OK;
    part parts[PARTS] = {
        {.name = "[Content_Types].xml"}, {.name = "_rels/.rels"}, {.name = "3D/3dmodel.model"}};
    ov_painted painted = {0};
    OV_TRY(ov_paint(context, scene, options, false, &painted));
    (void)ov_progress_stage(context, "write");
    OV_TRY(pack(context, types, sizeof types - 1, &parts[0]));
    OV_TRY(pack(context, relations, sizeof relations - 1, &parts[1]));
    OV_TRY(pack_model(context, &painted, title, &parts[2]));
    put_archive(parts, stream);
cleanup:
    ov_painted_drop(&painted);
    for (int i = 0; i < PARTS; i++)
        free(parts[i].data);
    return status;
}
