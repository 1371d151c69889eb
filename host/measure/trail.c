#include "measure/trail.h"

#include "base/progress.h"

#include "field/field.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool counts(const ovoid_mesh *mesh, size_t triangle, bool outer_only) {
    return !outer_only || ov_mesh_component_of_triangle(mesh, triangle)->outer;
}

static void list_triangles(ov_trail *trail, bool outer_only) {
    size_t count = 0;
    for (size_t t = 0; t < trail->mesh->triangles; ++t)
        if (counts(trail->mesh, t, outer_only))
            trail->triangle[count++] = (uint32_t)t;
    trail->triangles = count;
}

/* ---- along a Hilbert curve ---------------------------------------------------------------- */

/* Bits per axis of the curve: a surface of n triangles is about sqrt(n) of them wide; two bits more
 * tell neighbours apart. */
static unsigned curve_bits(size_t triangles) {
    unsigned bits = 4;
    while (bits < 21 && triangles >> (2 * (bits - 2)) > 0)
        ++bits;
    return bits;
}

/* The low corner of the box about the vertices, and its longest side. */
static double extent_of(const ovoid_mesh *mesh, double low[3]) {
    double high[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX}, extent = DBL_MIN;
    for (size_t k = 0; k < 3; ++k)
        low[k] = DBL_MAX;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        for (size_t k = 0; k < 3; ++k) {
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
        }
    }
    for (size_t k = 0; k < 3; ++k)
        extent = fmax(extent, high[k] - low[k]);
    return extent;
}

static void find_keys(const ov_trail *trail, uint64_t *keys) {
    const ovoid_mesh *const mesh = trail->mesh;
    const unsigned bits = curve_bits(mesh->triangles);
    const double cells = ldexp(1.0, (int)bits) - 1.0;
    double low[3];
    const double extent = extent_of(mesh, low);
    for (size_t n = 0; n < trail->triangles; ++n) {
        double centre[3];
        uint32_t cell[3];
        ov_mesh_centre(mesh, trail->triangle[n], centre);
        for (size_t k = 0; k < 3; ++k)
            cell[k] = (uint32_t)fmin(fmax((centre[k] - low[k]) / extent * cells, 0.0), cells);
        keys[n] = ov_hilbert_index(cell[0], cell[1], cell[2], bits);
    }
}

static ovoid_status sort_triangles(ovoid_context *context, ov_trail *trail) {
    ovoid_status status = OVOID_OK;
    const size_t count = trail->triangles;
    uint64_t *const keys = ov_alloc(context, count, sizeof *keys, "order of triangles");
    uint32_t *const order = ov_alloc(context, count, sizeof *order, "order of triangles");
    if (!keys || !order) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    find_keys(trail, keys);
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_sort_keys(context, keys, count, order));
    for (size_t k = 0; k < count; ++k)
        order[k] = trail->triangle[order[k]];
    memcpy(trail->triangle, order, count * sizeof *order);
cleanup:
    free(keys);
    free(order);
    return status;
}

/* ---- making ------------------------------------------------------------------------------- */

/* The vertices of the triangles where they come up first. */
static ovoid_status list_vertices(ovoid_context *context, ov_trail *trail) {
    const ovoid_mesh *const mesh = trail->mesh;
    bool *const listed = ov_alloc(context, mesh->vertices, sizeof *listed, "points of a mesh");
    trail->vertex = ov_alloc(context, mesh->vertices, sizeof *trail->vertex, "points of a mesh");
    if (!listed || !trail->vertex) {
        free(listed);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t k = 0; k < 3 * trail->triangles; ++k) {
        const uint32_t v = mesh->corners[3 * (size_t)trail->triangle[k / 3] + k % 3];
        if (!listed[v])
            trail->vertex[trail->vertices++] = v;
        listed[v] = true;
    }
    free(listed);
    return OVOID_OK;
}

static bool all_count(const ovoid_mesh *mesh, bool outer_only) {
    for (size_t c = 0; outer_only && c < mesh->components; ++c)
        if (!mesh->component[c].outer)
            return false;
    return true;
}

ovoid_status ov_trail_create(ovoid_context *context, const ovoid_mesh *mesh, bool outer_only,
                             ov_trail *trail) {
    ovoid_status status = OVOID_OK;
    ov_trail made = {.mesh = mesh};
    if (mesh->along_curve && all_count(mesh, outer_only)) {
        made.triangles = mesh->triangles;
        made.vertices = mesh->vertices;
        *trail = made;
        return OVOID_OK;
    }
    made.triangle = ov_alloc(context, mesh->triangles, sizeof *made.triangle, "order of triangles");
    if (!made.triangle)
        return OVOID_ERROR_MEMORY;
    list_triangles(&made, outer_only);
    if (!mesh->along_curve)
        OV_TRY(sort_triangles(context, &made));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(list_vertices(context, &made));
    *trail = made;
cleanup:
    if (status != OVOID_OK)
        ov_trail_destroy(&made);
    return status;
}

ovoid_status ov_trail_choose(ovoid_context *context, const ovoid_mesh *mesh, const bool *chosen,
                             ov_trail *trail) {
    ovoid_status status = OVOID_OK;
    ov_trail made = {.mesh = mesh};
    for (size_t t = 0; t < mesh->triangles; ++t)
        made.triangles += chosen[t];
    made.triangle = ov_alloc(context, made.triangles, sizeof *made.triangle, "order of triangles");
    if (!made.triangle)
        return OVOID_ERROR_MEMORY;
    made.triangles = 0;
    for (size_t t = 0; t < mesh->triangles; ++t)
        if (chosen[t])
            made.triangle[made.triangles++] = (uint32_t)t;
    OV_TRY(list_vertices(context, &made));
    *trail = made;
cleanup:
    if (status != OVOID_OK)
        ov_trail_destroy(&made);
    return status;
}

void ov_trail_destroy(ov_trail *trail) {
    free(trail->triangle);
    free(trail->vertex);
    *trail = (ov_trail){0};
}
