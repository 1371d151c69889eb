/* A page for a browser: page/page.html with page.css and page.js in it, which are embedded in the
 * library, and between them the scene: blocks of binary data (page_blocks.h), and an element of
 * JSON that says what they are. All in one file, which asks for nothing else. */
#include "write/page.h"

#include "base/progress.h"
#include "write/export.h"
#include "write/page_blocks.h"
#include "write/page_names.h"
#include "write/paint.h"
#include "write/text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Each surface is there with two spacings, the second one twice the first. */
enum { DETAILS = 2 };

typedef struct page {
    const ov_scene *scene;
    const ovoid_export_options *options;
    double spacing; /* of the finer surfaces, angstrom */
    double range;   /* of the difference's colours, angstrom; 0: not known yet */
    double origin[3];
    double low[3], high[3]; /* about all surfaces */
    FILE *stream;
    FILE *surfaces, *differences, *levels; /* what the JSON says of them, in memory */
    char *text[3];
    size_t length[3];
    unsigned blocks; /* numbers given to blocks so far */
} page;

/* ---- what is measured ------------------------------------------------------------------------ */

/* The spacing asked for, or a larger one with which no surface has too many triangles: their number
 * goes with the square of the spacing. */
static ovoid_status choose_spacing(ovoid_context *context, page *p) {
    ovoid_status status = OVOID_OK;
    const ov_scene *const s = p->scene;
    ovoid_mesh *mesh = NULL;
    p->spacing = p->options->spacing;
    OV_TRY(ov_scene_mesh(context, s->original ? s->original : s->fields[0],
                         s->original ? s->isovalue : 0.0, 2.0 * p->spacing, &mesh));
    const double triangles = 4.0 * (double)ovoid_mesh_triangles(mesh);
    if (triangles > p->options->max_triangles)
        p->spacing *= sqrt(triangles / p->options->max_triangles);
cleanup:
    ovoid_mesh_destroy(&mesh);
    return status;
}

/* ---- surfaces ------------------------------------------------------------------------------ */

static void next_id(page *p, char id[16]) {
    snprintf(id, 16, "b%u", p->blocks++);
}

static void widen(page *p, const ovoid_mesh *mesh) {
    const double *const xyz = ovoid_mesh_xyz(mesh);
    for (size_t k = 0; k < 3 * ovoid_mesh_vertices(mesh); k++) {
        p->low[k % 3] = fmin(p->low[k % 3], xyz[k]);
        p->high[k % 3] = fmax(p->high[k % 3], xyz[k]);
    }
}

/* level -1: the molecule's. */
static ovoid_status put_surface(ovoid_context *context, page *p, const ovoid_mesh *mesh, int detail,
                                int level, double spacing) {
    char id[16];
    ov_page_box box;
    next_id(p, id);
    ov_page_box_of(mesh, &box);
    widen(p, mesh);
    fprintf(p->surfaces,
            "%s{\"id\":\"%s\",\"detail\":%d,\"level\":%d,\"spacing\":%.6g,\"vertices\":%zu,"
            "\"triangles\":%zu,\"low\":[%.9g,%.9g,%.9g],\"step\":%.9g}",
            ftell(p->surfaces) > 0 ? "," : "", id, detail, level, spacing,
            ovoid_mesh_vertices(mesh), ovoid_mesh_triangles(mesh), box.low[0], box.low[1],
            box.low[2], box.step);
    return ov_page_put_surface(context, mesh, &box, id, p->stream);
}

/* How far the two surfaces are apart, at the vertices of the one that is shown. */
static ovoid_status put_difference(ovoid_context *context, page *p, const ovoid_mesh *shown,
                                   const ovoid_mesh *other, int detail, int level, bool of_model) {
    ovoid_status status = OVOID_OK;
    const ov_scene *const s = p->scene;
    const size_t vertices = ovoid_mesh_vertices(shown);
    char id[16];
    float *distance = NULL, most = 0.0f;
    next_id(p, id);
    OV_TRY(ov_scene_distances(context, shown, other, of_model ? s->original : s->fields[level],
                              of_model ? s->isovalue : ovoid_model_isovalue(s->models[level]),
                              &distance));
    for (size_t i = 0; i < vertices; i++) {
        most = fmaxf(most, fabsf(distance[i]));
        if (of_model) /* where its vertex is within the molecule, the model is inside it */
            distance[i] = -distance[i];
    }
    if (p->range == 0.0)
        OV_TRY(ov_paint_range(context, p->options->range, distance, vertices, &p->range));
    fprintf(p->differences,
            "%s{\"id\":\"%s\",\"detail\":%d,\"level\":%d,\"of\":\"%s\",\"largest\":%.4g}",
            ftell(p->differences) > 0 ? "," : "", id, detail, level,
            of_model ? "model" : "molecule", (double)most);
    OV_TRY(ov_page_put_scalars(context, distance, vertices, p->range, id, p->stream));
cleanup:
    free(distance);
    return status;
}

static ovoid_status put_model(ovoid_context *context, page *p, const ovoid_mesh *original,
                              int detail, int level, double spacing) {
    ovoid_status status = OVOID_OK;
    ovoid_mesh *mesh = NULL;
    OV_TRY(ov_scene_mesh(context, p->scene->fields[level], 0.0, spacing, &mesh));
    OV_TRY(put_surface(context, p, mesh, detail, level, spacing));
    if (original) {
        OV_TRY(put_difference(context, p, original, mesh, detail, level, false));
        OV_TRY(put_difference(context, p, mesh, original, detail, level, true));
    }
cleanup:
    ovoid_mesh_destroy(&mesh);
    return status;
}

static ovoid_status put_detail(ovoid_context *context, page *p, int detail) {
    ovoid_status status = OVOID_OK;
    const ov_scene *const s = p->scene;
    const double spacing = ldexp(p->spacing, detail);
    ovoid_mesh *original = NULL;
    if (s->original) {
        OV_TRY(ov_scene_mesh(context, s->original, s->isovalue, spacing, &original));
        OV_TRY(put_surface(context, p, original, detail, -1, spacing));
    }
    for (size_t level = 0; level < s->count; level++)
        OV_TRY(put_model(context, p, original, detail, (int)level, spacing));
cleanup:
    ovoid_mesh_destroy(&original);
    return status;
}

/* ---- ellipsoids ----------------------------------------------------------------------------- */

static ovoid_status put_names(ovoid_context *context, page *p, const uint32_t *first,
                              const uint32_t *order, size_t count, char id[16]) {
    ovoid_status status = OVOID_OK;
    char *text = NULL;
    size_t length = 0;
    FILE *const names = open_memstream(&text, &length);
    if (!names)
        return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for the names of residues");
    ov_page_names(p->scene->molecule, first, order, count, names);
    const bool failed = ferror(names) != 0;
    if (fclose(names) != 0 || failed)
        OV_TRY(ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for the names of residues"));
    next_id(p, id);
    OV_TRY(ov_page_put_text(context, text, length, id, p->stream));
cleanup:
    free(text);
    return status;
}

static ovoid_status put_level(ovoid_context *context, page *p, size_t level) {
    ovoid_status status = OVOID_OK;
    const ovoid_molecule *const molecule = p->scene->molecule;
    const ovoid_model *const model = p->scene->models[level];
    const size_t count = ovoid_model_size(model);
    char id[16], names[16] = "";
    uint32_t *owner = NULL, *first = NULL;
    const uint32_t *order;
    if (molecule) {
        OV_TRY(ov_scene_owner(context, molecule, model, &owner));
        OV_TRY(
            ov_scene_sort(context, owner, ovoid_molecule_atoms(molecule), count, &first, &order));
        OV_TRY(put_names(context, p, first, order, count, names));
    }
    next_id(p, id);
    fprintf(p->levels, "%s{\"id\":\"%s\",\"names\":\"%s\",\"ellipsoids\":%zu}", level ? "," : "",
            id, names, count);
    OV_TRY(ov_page_put_ellipsoids(context, model,
                                  p->options->isovalue > 0.0 ? p->options->isovalue
                                                             : ovoid_model_isovalue(model),
                                  p->origin, first, id, p->stream));
cleanup:
    free(owner);
    free(first);
    return status;
}

/* ---- the whole ------------------------------------------------------------------------------ */

static void put_description(page *p, const char *title) {
    const ov_scene *const s = p->scene;
    double radius = 0.0;
    for (int k = 0; k < 3; k++)
        radius += pow(0.5 * (p->high[k] - p->low[k]), 2.0);
    fputs("<script type=\"application/json\" id=\"scene\">{\"title\":", p->stream);
    ov_json_string(title, p->stream);
    fprintf(p->stream, ",\"program\":\"Ovoid %s\",\"atoms\":", ovoid_version());
    if (s->molecule)
        fprintf(p->stream, "%zu", ovoid_molecule_atoms(s->molecule));
    else
        fputs("null", p->stream);
    fprintf(p->stream,
            ",\"decay\":%.9g,\"isovalue\":%.9g,\"range\":%.6g,\"origin\":[%.9g,%.9g,%.9g],"
            "\"centre\":[%.9g,%.9g,%.9g],\"radius\":%.6g,\"surfaces\":[%s],\"differences\":[%s],"
            "\"levels\":[%s]}</script>\n",
            s->decay, s->isovalue, p->range, p->origin[0], p->origin[1], p->origin[2],
            0.5 * (p->low[0] + p->high[0]), 0.5 * (p->low[1] + p->high[1]),
            0.5 * (p->low[2] + p->high[2]), sqrt(radius), p->text[0], p->text[1], p->text[2]);
}

static ovoid_status open_texts(ovoid_context *context, page *p) {
    FILE **const streams[] = {&p->surfaces, &p->differences, &p->levels};
    for (int i = 0; i < 3; i++)
        if (!(*streams[i] = open_memstream(&p->text[i], &p->length[i])))
            return ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a page");
    return OVOID_OK;
}

static ovoid_status close_texts(ovoid_context *context, page *p) {
    FILE **const streams[] = {&p->surfaces, &p->differences, &p->levels};
    bool good = true;
    for (int i = 0; i < 3; i++) {
        good = good && *streams[i] && !ferror(*streams[i]);
        if (*streams[i] && fclose(*streams[i]) != 0)
            good = false;
        *streams[i] = NULL;
    }
    return good ? OVOID_OK : ov_fail(context, OVOID_ERROR_MEMORY, "out of memory for a page");
}

static ovoid_status put_scene(ovoid_context *context, page *p, const char *title) {
    ovoid_status status = OVOID_OK;
    OV_TRY(open_texts(context, p));
    OV_TRY(choose_spacing(context, p));
    for (int detail = 0; detail < DETAILS && !ferror(p->stream); detail++)
        OV_TRY(put_detail(context, p, detail));
    for (int k = 0; k < 3; k++)
        p->origin[k] = 0.5 * (p->low[k] + p->high[k]);
    for (size_t level = 0; level < p->scene->count && !ferror(p->stream); level++)
        OV_TRY(put_level(context, p, level));
    OV_TRY(close_texts(context, p));
    put_description(p, title);
cleanup:
    if (p->surfaces || p->differences || p->levels)
        (void)close_texts(NULL, p);
    for (int i = 0; i < 3; i++)
        free(p->text[i]);
    return status;
}

/* The file as it is embedded. */
static const char *source(const char *name) {
    for (const ov_page_source *s = ov_page_sources; s->name; s++)
        if (strcmp(s->name, name) == 0)
            return s->text;
    return "";
}

/* page.html has a line @NAME@ where each of the parts goes. */
ovoid_status ov_write_page(ovoid_context *context, const ov_scene *scene,
                           const ovoid_export_options *options, const char *title, FILE *stream) {
    ovoid_status status = OVOID_OK;
    page p = {.scene = scene,
              .options = options,
              .low = {INFINITY, INFINITY, INFINITY},
              .high = {-INFINITY, -INFINITY, -INFINITY},
              .stream = stream};
    for (const char *at = source("page.html"), *mark; *at && !ferror(stream); at = mark) {
        mark = at + strcspn(at, "@");
        fwrite(at, 1, (size_t)(mark - at), stream);
        if (strncmp(mark, "@TITLE@", 7) == 0)
            ov_markup_text(title, stream);
        else if (strncmp(mark, "@STYLE@", 7) == 0)
            fputs(source("page.css"), stream);
        else if (strncmp(mark, "@SCRIPT@", 8) == 0)
            fputs(source("page.js"), stream);
        else if (strncmp(mark, "@SCENE@", 7) == 0)
            OV_TRY(put_scene(context, &p, title));
        if (*mark)
            mark += 2 + strcspn(mark + 1, "@");
    }
cleanup:
    return status;
}
