#include "measure/measure.h"

#include "base/progress.h"
#include "base/sized.h"
#include "measure/cells.h"
#include "measure/compare.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void ovoid_measure_options_init(ovoid_measure_options *options, size_t size) {
    static const ovoid_measure_options defaults = {
        .spacing = OVOID_DEFAULT_MESH_SPACING, .vertices = OVOID_VERTEX_EXACT, .distances = true};
    ov_sized_init(options, size, &defaults, sizeof defaults);
}

#define NO_PAIR                                                                                    \
    { NAN, NAN, NAN }
#define NO_DISTANCES                                                                               \
    { NAN, NAN, NAN, NAN, NAN }

static const ovoid_measures unknown = {
    .area = NO_PAIR,
    .volume = NO_PAIR,
    .area_outer = NO_PAIR,
    .volume_outer = NO_PAIR,
    .components_original = OVOID_UNKNOWN,
    .components_sparse = OVOID_UNKNOWN,
    .outer_original = OVOID_UNKNOWN,
    .outer_sparse = OVOID_UNKNOWN,
    .distances = NO_DISTANCES,
    .distances_outer = NO_DISTANCES,
    .deviation = NAN,
    .seconds_mesh = NAN,
    .seconds_distances = NAN,
    .deviation_bound = NAN,
};

void ovoid_measures_init(ovoid_measures *measures, size_t size) {
    ov_sized_init(measures, size, &unknown, sizeof unknown);
}

ovoid_pair ov_pair_of(double original, double sparse) {
    const double difference = fabs(sparse - original);
    return (ovoid_pair){original, sparse, difference > 0.0 ? difference / fabs(original) : 0.0};
}

static uint64_t count_outer(const ovoid_mesh *mesh) {
    uint64_t count = 0;
    for (size_t c = 0; c < mesh->components; ++c)
        count += mesh->component[c].outer;
    return count;
}

static ovoid_status compare_contents(ovoid_context *context, const ovoid_mesh *original,
                                     const ovoid_mesh *sparse, bool smooth, ovoid_measures *made) {
    ovoid_status status = OVOID_OK;
    ov_content first, second, first_outer, second_outer;
    OV_TRY(ov_mesh_contents(context, original, smooth, &first, &first_outer));
    OV_TRY(ov_mesh_contents(context, sparse, smooth, &second, &second_outer));
    made->area = ov_pair_of(first.area, second.area);
    made->volume = ov_pair_of(first.volume, second.volume);
    made->area_outer = ov_pair_of(first_outer.area, second_outer.area);
    made->volume_outer = ov_pair_of(first_outer.volume, second_outer.volume);
cleanup:
    return status;
}

static double largest_of_exposed(const ovoid_mesh *mesh, const float *distance) {
    double largest = 0.0;
    for (size_t v = 0; v < mesh->vertices; ++v)
        if (ov_mesh_is_exposed(mesh, v))
            largest = fmax(largest, distance[v]);
    return largest;
}

/* The distances of the whole surfaces, and with them the deviation. */
static ovoid_status compare_vertices(ovoid_context *context, const ovoid_mesh *original,
                                     const ovoid_mesh *sparse, ovoid_measures *measures) {
    ovoid_status status = OVOID_OK;
    float *const first = ov_alloc(context, original->vertices, sizeof *first, "distances");
    float *const second = ov_alloc(context, sparse->vertices, sizeof *second, "distances");
    ov_bound bound = {0};
    if (!first || !second) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_mesh_distances(context, original, sparse, false, &measures->distances, first, second,
                             &bound));
    measures->deviation =
        fmax(largest_of_exposed(original, first), largest_of_exposed(sparse, second));
    measures->deviation_bound = fmax(bound.most, measures->deviation);
cleanup:
    free(first);
    free(second);
    return status;
}

ovoid_status ov_measure_meshes(ovoid_context *context, const ovoid_mesh *original,
                               const ovoid_mesh *sparse, bool smooth, bool distances,
                               ovoid_measures *measures) {
    ovoid_status status = OVOID_OK;
    const double begin = ov_seconds();
    ovoid_measures made = unknown;
    made.components_original = original->components;
    made.components_sparse = sparse->components;
    made.outer_original = count_outer(original);
    made.outer_sparse = count_outer(sparse);
    OV_TRY(compare_contents(context, original, sparse, smooth, &made));
    if (distances) {
        OV_TRY(compare_vertices(context, original, sparse, &made));
        made.distances_outer = made.distances;
        if (made.outer_original < original->components || made.outer_sparse < sparse->components)
            OV_TRY(
                ovoid_mesh_distances(context, original, sparse, true, &made.distances_outer, NULL));
    }
    made.seconds_distances = ov_seconds() - begin;
    *measures = made;
cleanup:
    return status;
}

/* Says which of the two surfaces failed: of a molecule, or the first of two. */
static ovoid_status name_failure(ovoid_context *context, ovoid_status status,
                                 const ovoid_field *field, const ovoid_field *other,
                                 const char *place) {
    const char *const kind = ov_field_kind(field);
    const bool alike = strcmp(kind, ov_field_kind(other)) == 0;
    const bool named = status != OVOID_OK && status != OVOID_ERROR_CANCELLED;
    char *const text = !named ? NULL : strdup(ovoid_context_error(context));
    if (text)
        ov_fail(context, status, "the surface of the %s%s: %s", alike ? place : "", kind, text);
    free(text);
    return status;
}

static ovoid_status measure_whole(ovoid_context *context, ovoid_field *original,
                                  ovoid_field *sparse, const ovoid_mesh_options *meshing,
                                  bool distances, ovoid_measures *made) {
    ovoid_status status = OVOID_OK;
    ovoid_mesh *first = NULL, *second = NULL;
    const double begin = ov_seconds();
    status = ovoid_field_mesh(context, original, meshing, &first);
    OV_TRY(name_failure(context, status, original, sparse, "first "));
    status = ovoid_field_mesh(context, sparse, meshing, &second);
    OV_TRY(name_failure(context, status, sparse, original, "second "));
    const double meshed = ov_seconds();
    ov_progress_stage(context, "measure");
    OV_TRY(ov_measure_meshes(context, first, second, meshing->vertices == OVOID_VERTEX_EXACT,
                             distances, made));
    made->seconds_mesh = meshed - begin;
cleanup:
    ovoid_mesh_destroy(&first);
    ovoid_mesh_destroy(&second);
    return status;
}

/* How many atoms or ellipsoids a cell is to have; 0: both surfaces are measured as wholes. */
static size_t cell_terms(const ovoid_measure_options *o, const ovoid_field *original,
                         const ovoid_field *sparse) {
    const size_t most = original->count > sparse->count ? original->count : sparse->count;
    if (o->cell_atoms > 0)
        return o->cell_atoms < most ? o->cell_atoms : 0;
    return most > OVOID_DEFAULT_MEASURE_ATOMS ? OVOID_DEFAULT_CELL_ATOMS : 0;
}

/* Cell by cell; of all of both fields or, repeat given, of their units. */
static ovoid_status measure_cells(ovoid_context *context, ovoid_field *original,
                                  ovoid_field *sparse, const ovoid_mesh_options *meshing,
                                  const ov_cells_options *how, ovoid_measures *made) {
    const ovoid_field *empty = NULL;
    const ovoid_field *const first = how->repeat ? original->repeat.unit : original,
                             *const second = how->repeat ? sparse->repeat.unit : sparse;
    const ovoid_status status =
        ov_measure_cells(context, first, second, meshing, how, &empty, made);
    if (!empty)
        return status;
    return name_failure(context, status, empty, empty == first ? second : first,
                        empty == first ? "first " : "second ");
}

/* Two fields that repeat their units by the same motions are measured by these, if that goes. */
static ovoid_status measure_large(ovoid_context *context, ovoid_field *original,
                                  ovoid_field *sparse, const ovoid_mesh_options *meshing,
                                  const ovoid_measure_options *o, ovoid_measures *made) {
    bool scattered = false;
    ov_cells_options how = {.most = cell_terms(o, original, sparse),
                            .distances = o->distances,
                            .repeat = ov_fields_repeat(original, sparse),
                            .scattered = &scattered};
    const ovoid_status status = measure_cells(context, original, sparse, meshing, &how, made);
    if (status != OVOID_OK || !scattered)
        return status;
    how.repeat = NULL;
    return measure_cells(context, original, sparse, meshing, &how, made);
}

ovoid_status ovoid_measure(ovoid_context *context, ovoid_field *original, ovoid_field *sparse,
                           const ovoid_measure_options *options, ovoid_measures *measures) {
    ovoid_status status = OVOID_OK;
    ovoid_measures made;
    ovoid_measure_options o;
    ovoid_mesh_options meshing;
    OV_NEED(context, context);
    OV_NEED(context, original);
    OV_NEED(context, sparse);
    OV_NEED(context, options);
    OV_NEED(context, measures);
    ov_progress_begin(context, "mesh");
    OV_TRY(ov_field_check(context, original));
    OV_TRY(ov_field_check(context, sparse));
    ovoid_measure_options_init(&o, sizeof o);
    OV_TRY(OV_SIZED_TAKE(context, ovoid_measure_options, options, &o));
    OV_TRY(ov_sized_check(context, "ovoid_measures", measures));
    const ovoid_mesh_options wanted = {.size = sizeof wanted,
                                       .isovalue = o.isovalue,
                                       .spacing = o.spacing,
                                       .vertices = o.vertices};
    OV_TRY(ov_mesh_options_take(context, &wanted, original, &meshing));
    if (cell_terms(&o, original, sparse) > 0)
        OV_TRY(measure_large(context, original, sparse, &meshing, &o, &made));
    else
        OV_TRY(measure_whole(context, original, sparse, &meshing, o.distances, &made));
    ov_sized_give(measures, &made, sizeof made);
cleanup:
    ov_progress_end(context);
    return status;
}
