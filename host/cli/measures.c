#include "measures.h"

#include <math.h>
#include <string.h>

typedef unsigned long long count; /* as printf wants it */

bool measures_parse_vertices(const char *text, ovoid_vertex_rule *vertices) {
    if (strcmp(text, measures_vertices_name(OVOID_VERTEX_EXACT)) == 0) {
        *vertices = OVOID_VERTEX_EXACT;
    } else if (strcmp(text, measures_vertices_name(OVOID_VERTEX_LINEAR)) == 0) {
        *vertices = OVOID_VERTEX_LINEAR;
    } else {
        cli_error("--vertices takes exact or linear, not '%s'", text);
        return false;
    }
    return true;
}

const char *measures_vertices_name(ovoid_vertex_rule vertices) {
    switch (vertices) {
    case OVOID_VERTEX_EXACT:
        return "exact";
    case OVOID_VERTEX_LINEAR:
        return "linear";
    }
    return "unknown";
}

ovoid_status measures_fields(ovoid_context *context, const ovoid_molecule *molecule,
                             const ovoid_model *model, ovoid_field **original,
                             ovoid_field **sparse) {
    const ovoid_status status = ovoid_field_of_molecule(context, molecule, ovoid_model_decay(model),
                                                        ovoid_model_isovalue(model), original);
    return status == OVOID_OK ? ovoid_field_of_model(context, model, sparse) : status;
}

ovoid_status measures_compare(ovoid_context *context, const ovoid_molecule *molecule,
                              const ovoid_model *model, const ovoid_measure_options *options,
                              ovoid_measures *measures) {
    ovoid_field *original = NULL, *sparse = NULL;
    ovoid_status status = measures_fields(context, molecule, model, &original, &sparse);
    if (status == OVOID_OK)
        status = ovoid_measure(context, original, sparse, options, measures);
    ovoid_field_destroy(&original);
    ovoid_field_destroy(&sparse);
    return status;
}

static void print_pair(FILE *stream, const char *name, const char *unit, ovoid_pair whole,
                       ovoid_pair outer) {
    fprintf(stream, "%-8s  %.6g %s, of the model %.6g %s: error %.3g %%", name, whole.original,
            unit, whole.sparse, unit, 100.0 * whole.error);
    if (outer.original != whole.original || outer.sparse != whole.sparse)
        fprintf(stream, " (outer surface %.3g %%)", 100.0 * outer.error);
    putc('\n', stream);
}

void measures_print(FILE *stream, const ovoid_measures *measures,
                    const ovoid_measure_options *options) {
    print_pair(stream, "area", "Å²", measures->area, measures->area_outer);
    print_pair(stream, "volume", "Å³", measures->volume, measures->volume_outer);
    fprintf(stream, "pieces    %llu, of the model %llu (outer ones: %llu, %llu)\n",
            (count)measures->components_original, (count)measures->components_sparse,
            (count)measures->outer_original, (count)measures->outer_sparse);
    if (options->distances)
        fprintf(stream,
                "distance  Hausdorff %.4g Å (outer surface %.4g Å), mean %.3g Å (outer surface "
                "%.3g Å)\n",
                measures->distances.hausdorff, measures->distances_outer.hausdorff,
                measures->distances.mean, measures->distances_outer.mean);
    if (options->distances)
        fprintf(stream, "deviation %.4g Å: largest of an outer surface from the other surface",
                measures->deviation);
    if (options->distances && isfinite(measures->deviation_bound))
        fprintf(stream, "; anywhere on the meshes at most %.4g Å", measures->deviation_bound);
    if (options->distances)
        putc('\n', stream);
    fprintf(stream, "mesh      spacing %.9g Å, %s vertices\n", options->spacing,
            measures_vertices_name(options->vertices));
}

void measures_print_heading(FILE *stream) {
    fputs("                 area (Å²)                    volume (Å³)                 distance (Å)"
          "                 pieces\n"
          "isovalue      original    model  error %     original    model  error %  Hausdorff  "
          "outer   mean  original model\n",
          stream);
}

void measures_print_row(FILE *stream, double isovalue, const ovoid_measures *m) {
    fprintf(stream,
            "%-11.6g  %9.6g %8.6g %8.3g    %9.6g %8.6g %8.3g  %9.4g %6.3g %6.2g  %8llu %5llu\n",
            isovalue, m->area.original, m->area.sparse, 100.0 * m->area.error, m->volume.original,
            m->volume.sparse, 100.0 * m->volume.error, m->distances.hausdorff,
            m->distances_outer.hausdorff, m->distances.mean, (count)m->components_original,
            (count)m->components_sparse);
}

static bool add_pair(cJSON *object, const char *key, ovoid_pair pair) {
    cJSON *inner = cJSON_AddObjectToObject(object, key);
    return inner && cJSON_AddNumberToObject(inner, "original", pair.original) &&
           cJSON_AddNumberToObject(inner, "sparse", pair.sparse) &&
           cJSON_AddNumberToObject(inner, "error", pair.error);
}

static bool add_counts(cJSON *object, const char *key, uint64_t original, uint64_t sparse) {
    cJSON *inner = cJSON_AddObjectToObject(object, key);
    return inner && cJSON_AddNumberToObject(inner, "original", (double)original) &&
           cJSON_AddNumberToObject(inner, "sparse", (double)sparse);
}

static bool add_distances(cJSON *object, const ovoid_distances *whole,
                          const ovoid_distances *outer) {
    return cJSON_AddNumberToObject(object, "hausdorff", whole->hausdorff) &&
           cJSON_AddNumberToObject(object, "mean_distance", whole->mean) &&
           cJSON_AddNumberToObject(object, "rms_distance", whole->rms) &&
           cJSON_AddNumberToObject(object, "hausdorff_outer", outer->hausdorff) &&
           cJSON_AddNumberToObject(object, "mean_distance_outer", outer->mean) &&
           cJSON_AddNumberToObject(object, "rms_distance_outer", outer->rms);
}

bool measures_report(cJSON *object, const ovoid_measures *measures,
                     const ovoid_measure_options *options) {
    if (!add_pair(object, "area", measures->area) ||
        !add_pair(object, "volume", measures->volume) ||
        !add_pair(object, "area_outer", measures->area_outer) ||
        !add_pair(object, "volume_outer", measures->volume_outer) ||
        !add_counts(object, "components", measures->components_original,
                    measures->components_sparse) ||
        !add_counts(object, "components_outer", measures->outer_original, measures->outer_sparse))
        return false;
    if (options->distances &&
        (!cJSON_AddNumberToObject(object, "deviation", measures->deviation) ||
         !cJSON_AddNumberToObject(object, "deviation_bound", measures->deviation_bound)))
        return false;
    if (options->distances &&
        !add_distances(object, &measures->distances, &measures->distances_outer))
        return false;
    return cJSON_AddNumberToObject(object, "mesh_spacing", options->spacing) &&
           cli_json_string(object, "mesh_vertices", measures_vertices_name(options->vertices));
}
