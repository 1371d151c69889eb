#include "write/export.h"

#include "base/file.h"
#include "base/progress.h"
#include "base/sized.h"
#include "model/fields.h"
#include "write/ihm.h"
#include "write/page.h"
#include "write/paint.h"
#include "write/scene.h"
#include "write/text.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct format {
    const char *name;
    const char *extensions;
    ovoid_status (*ellipsoids)(ovoid_context *context, const ovoid_model *model,
                               const ov_drawing *drawing, FILE *stream);
    ovoid_status (*map)(ovoid_context *context, const ov_map *map, FILE *stream);
    int bytes; /* of a map's value */
    ovoid_status (*scene)(ovoid_context *context, const ov_scene *scene,
                          const ovoid_export_options *options, const char *title, FILE *stream);
} format;

static const format formats[] = {
    [OVOID_EXPORT_AUTO] = {"", "", NULL, NULL, 0, NULL},
    [OVOID_EXPORT_BILD] = {"bild", ".bild .bld", ov_write_bild, NULL, 0, NULL},
    [OVOID_EXPORT_CXC] = {"cxc", ".cxc", ov_write_cxc, NULL, 0, NULL},
    [OVOID_EXPORT_PYMOL] = {"pymol", ".py", ov_write_pymol, NULL, 0, NULL},
    [OVOID_EXPORT_GMM] = {"gmm", ".gmm", ov_write_gmm, NULL, 0, NULL},
    [OVOID_EXPORT_JSON] = {"json", ".json", ov_write_json, NULL, 0, NULL},
    [OVOID_EXPORT_CCP4] = {"ccp4", ".mrc .map .ccp4", NULL, ov_write_ccp4, 4, NULL},
    [OVOID_EXPORT_DX] = {"dx", ".dx", NULL, ov_write_dx, 13, NULL},
    [OVOID_EXPORT_XYZ] = {"xyz", ".xyz .extxyz", ov_write_xyz, NULL, 0, NULL},
    [OVOID_EXPORT_LAMMPS] = {"lammps", ".lmp .data", ov_write_lammps, NULL, 0, NULL},
    [OVOID_EXPORT_ANISOU] = {"anisou", ".pdb .ent", ov_write_anisou, NULL, 0, NULL},
    [OVOID_EXPORT_SPLAT] = {"splat", ".gltf", ov_write_splat, NULL, 0, NULL},
    [OVOID_EXPORT_IHM] = {"ihm", ".cif .mmcif", NULL, NULL, 0, ov_write_ihm},
    [OVOID_EXPORT_PLY] = {"ply", ".ply", NULL, NULL, 0, ov_write_painted_ply},
    [OVOID_EXPORT_GLB] = {"glb", ".glb", NULL, NULL, 0, ov_write_painted_glb},
    [OVOID_EXPORT_3MF] = {"3mf", ".3mf", NULL, NULL, 0, ov_write_3mf},
    [OVOID_EXPORT_MSMS] = {"msms", ".vert", NULL, NULL, 0, NULL},
    [OVOID_EXPORT_HTML] = {"html", ".html .htm", NULL, NULL, 0, ov_write_page},
};
enum { FORMATS = sizeof formats / sizeof *formats };

#define ELLIPSOID_ENDINGS ".bild, .cxc, .py, .gmm, .json, .xyz, .lmp, .pdb, .gltf, .cif"
#define MAP_ENDINGS ".mrc, .map, .ccp4, .dx"
#define SCENE_ENDINGS ".ply, .glb, .3mf, .vert, .html"

const char *ovoid_export_format_name(ovoid_export_format which) {
    return which > OVOID_EXPORT_AUTO && (size_t)which < FORMATS ? formats[which].name : NULL;
}

ovoid_export_format ovoid_export_format_find(const char *name) {
    char dotted[16];
    if (!name || (size_t)snprintf(dotted, sizeof dotted, ".%s", name) >= sizeof dotted)
        return OVOID_EXPORT_AUTO;
    for (int i = 1; i < FORMATS; i++)
        if (strcasecmp(name, formats[i].name) == 0 ||
            ov_extension_is(name, formats[i].extensions) ||
            ov_extension_is(dotted, formats[i].extensions))
            return (ovoid_export_format)i;
    return OVOID_EXPORT_AUTO;
}

void ovoid_export_options_init(ovoid_export_options *options, size_t size) {
    static const ovoid_export_options defaults = {.spacing = OVOID_DEFAULT_MESH_SPACING,
                                                  .colour = {0.30, 0.55, 0.80},
                                                  .opacity = 1.0,
                                                  .max_gigabytes = OVOID_DEFAULT_MAP_GIGABYTES,
                                                  .max_triangles = OVOID_DEFAULT_MAX_TRIANGLES};
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

static bool is_share(double value) {
    return value >= 0.0 && value <= 1.0;
}

/* The caller's options, whole and within their ranges; NULL: the defaults. */
static ovoid_status take_options(ovoid_context *context, const ovoid_export_options *given,
                                 ovoid_export_options *o) {
    ovoid_export_options_init(o, sizeof *o);
    const ovoid_status status =
        given ? OV_SIZED_TAKE(context, ovoid_export_options, given, o) : OVOID_OK;
    if (status != OVOID_OK)
        return status;
    if ((size_t)o->format >= FORMATS)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%d is no format of an export",
                       (int)o->format);
    if (!(o->isovalue >= 0.0 && isfinite(o->isovalue)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "isovalue must be finite and not negative; it is %g", o->isovalue);
    if (!(o->spacing > 0.0 && o->spacing <= 1000.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "spacing %g is not above 0 and at most 1000 angstrom", o->spacing);
    if (!(o->max_gigabytes > 0.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a map of at most %g gigabytes is none",
                       o->max_gigabytes);
    if (!(o->range >= 0.0 && isfinite(o->range)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "range must be finite and not negative; it is %g", o->range);
    if ((unsigned)o->colouring > OVOID_COLOUR_ELLIPSOID)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "%d is no colouring", (int)o->colouring);
    if (!(o->max_triangles >= 1.0))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "a surface of at most %g triangles is none",
                       o->max_triangles);
    if (!is_share(o->colour[0]) || !is_share(o->colour[1]) || !is_share(o->colour[2]) ||
        !is_share(o->opacity))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "colour (%g, %g, %g) and opacity %g must be from 0 to 1", o->colour[0],
                       o->colour[1], o->colour[2], o->opacity);
    return OVOID_OK;
}

/* The format that the options or the path ask for. */
static ovoid_status choose_format(ovoid_context *context, const char *path,
                                  const ovoid_export_options *options, bool model,
                                  const format **chosen) {
    const ovoid_export_format named = ovoid_export_format_find(ov_extension(path));
    const ovoid_export_format which = options->format ? options->format : named;
    *chosen = &formats[which];
    if (named != OVOID_EXPORT_AUTO && named != which)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "%s is asked for, but the name '%s' says %s: other programs go by the name, "
                       "so change one of the two",
                       formats[which].name, path, formats[named].name);
    if (which == OVOID_EXPORT_AUTO && strcmp(path, "-") == 0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "standard output does not say what to write: name a format");
    if (which == OVOID_EXPORT_AUTO)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "'%s' does not say what to write: its name would end in one of "
                       "%s" MAP_ENDINGS ", " SCENE_ENDINGS,
                       path, model ? ELLIPSOID_ENDINGS ", " : "");
    if (!model && ((*chosen)->ellipsoids || which == OVOID_EXPORT_IHM))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a molecule has no ellipsoids to write as %s: fit a model to it first, or "
                       "write a map (" MAP_ENDINGS ")",
                       (*chosen)->name);
    return OVOID_OK;
}

/* What a format takes of these. */
typedef struct content {
    const ovoid_model *model; /* ellipsoids */
    const ov_drawing *drawing;
    const ov_map *map;
    const ov_scene *scene;
    const ovoid_export_options *options; /* of the scene */
    const char *title;
} content;

static ovoid_status write_content(ovoid_context *context, const format *chosen, const content *c,
                                  FILE *stream) {
    if (chosen->map)
        return chosen->map(context, c->map, stream);
    if (chosen->scene)
        return chosen->scene(context, c->scene, c->options, c->title, stream);
    return chosen->ellipsoids(context, c->model, c->drawing, stream);
}

/* Writes what the chosen format takes, whole or not at all. */
static ovoid_status write_file(ovoid_context *context, const char *path, const format *chosen,
                               const content *c) {
    ovoid_status status = OVOID_OK;
    ov_output output = {0};
    ov_locale locale = {0};
    ov_progress_begin(context, chosen->map ? "map" : "write");
    OV_TRY(ov_locale_enter(context, &locale));
    OV_TRY(ov_output_open(context, path, &output));
    OV_TRY(write_content(context, chosen, c, output.stream));
    OV_TRY(ov_stream_check(context, output.stream, path));
    status = ov_output_commit(context, &output);

cleanup:
    ov_output_abandon(&output);
    ov_locale_leave(&locale);
    ov_progress_end(context);
    return status;
}

static ovoid_status check_size(ovoid_context *context, const ov_map *map, int bytes,
                               double max_gigabytes) {
    const double gigabytes = 1e-9 * (double)bytes * (double)ov_map_points(map);
    if (gigabytes <= max_gigabytes)
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_LIMIT,
                   "the map would have %llu points (%ld x %ld x %ld) and take %.3g GB, more than "
                   "%g GB: choose a larger spacing, or allow more (max-gigabytes)",
                   (unsigned long long)ov_map_points(map), (long)map->size[0], (long)map->size[1],
                   (long)map->size[2], gigabytes, max_gigabytes);
}

static ovoid_status write_map(ovoid_context *context, const char *path, const format *chosen,
                              const ovoid_export_options *options, double isovalue,
                              ovoid_field *field) {
    ov_map map = {.quadrics = field->quadrics, .count = field->count, .spacing = options->spacing};
    if (field->model)
        snprintf(map.label, sizeof map.label, "field of %zu ellipsoids, isovalue %.6g",
                 field->count, field->isovalue);
    else
        snprintf(map.label, sizeof map.label, "field of %zu atoms, decay %.6g per square angstrom",
                 field->count, field->decay);
    ovoid_status status = ov_map_cover(context, &map, isovalue);
    if (status == OVOID_OK)
        status = check_size(context, &map, chosen->bytes, options->max_gigabytes);
    if (status == OVOID_OK)
        status = ov_field_load(context, field, &map.evaluator);
    return status == OVOID_OK ? write_file(context, path, chosen, &(content){.map = &map}) : status;
}

static ovoid_status write_ellipsoids(ovoid_context *context, const char *path, const format *chosen,
                                     const ovoid_export_options *options, double isovalue,
                                     const ovoid_model *model) {
    ov_drawing drawing = {.isovalue = isovalue, .opacity = options->opacity};
    memcpy(drawing.colour, options->colour, sizeof drawing.colour);
    ov_title(path, drawing.title, sizeof drawing.title);
    return write_file(context, path, chosen, &(content){.model = model, .drawing = &drawing});
}

static ovoid_status export_field(ovoid_context *context, ovoid_field *field, const char *path,
                                 const format *chosen, const ovoid_export_options *o) {
    const double isovalue = o->isovalue > 0.0 ? o->isovalue : field->isovalue;
    const ovoid_status status = ov_field_place(context, field);
    if (status != OVOID_OK)
        return status;
    return chosen->map ? write_map(context, path, chosen, o, isovalue, field)
                       : write_ellipsoids(context, path, chosen, o, isovalue, field->model);
}

ovoid_status ovoid_field_export(ovoid_context *context, ovoid_field *field, const char *path,
                                const ovoid_export_options *options) {
    OV_NEED(context, context);
    OV_NEED(context, field);
    OV_NEED(context, path);
    ovoid_export_options o;
    const format *chosen;
    ovoid_status status = ov_field_check(context, field);
    if (status == OVOID_OK)
        status = take_options(context, options, &o);
    if (status == OVOID_OK)
        status = choose_format(context, path, &o, field->model != NULL, &chosen);
    if (status != OVOID_OK)
        return status;
    if (!chosen->map && !chosen->ellipsoids)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a field alone is no scene, as %s needs one: ovoid_scene_export()",
                       chosen->name);
    return export_field(context, field, path, chosen, &o);
}

/* ---- scenes --------------------------------------------------------------------------------- */

static ovoid_status export_scene(ovoid_context *context, ov_scene *scene, const char *path,
                                 const format *chosen, const ovoid_export_options *o) {
    char name[64];
    ovoid_status status = ov_scene_fields(context, scene);
    if (status != OVOID_OK)
        return status;
    if (chosen->map || chosen->ellipsoids)
        return export_field(context, scene->count ? scene->fields[0] : scene->original, path,
                            chosen, o);
    ov_title(path, name, sizeof name);
    const char *const title = scene->title ? scene->title : name;
    if (!chosen->scene) /* more than one file */
        return ov_write_msms(context, scene, o, title, path);
    return write_file(context, path, chosen,
                      &(content){.scene = scene, .options = o, .title = title});
}

ovoid_status ovoid_scene_export(ovoid_context *context, const ovoid_scene *scene, const char *path,
                                const ovoid_export_options *options) {
    OV_NEED(context, context);
    OV_NEED(context, scene);
    OV_NEED(context, path);
    ovoid_export_options o;
    const format *chosen;
    ov_scene s = {0};
    ovoid_status status = ov_scene_take(context, scene, &s);
    if (status == OVOID_OK)
        status = take_options(context, options, &o);
    if (status == OVOID_OK)
        status = choose_format(context, path, &o, s.count > 0, &chosen);
    if (status == OVOID_OK)
        status = export_scene(context, &s, path, chosen, &o);
    ov_scene_drop(&s);
    return status;
}
