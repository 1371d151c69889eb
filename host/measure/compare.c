#include "measure/compare.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of the distances from one surface to the other. */
typedef struct directed {
    double largest, mean, square;
} directed;

static double area_of(const ovoid_mesh *mesh, size_t triangle) {
    const uint32_t *const corner = mesh->corners + 3 * triangle;
    double a[3], u[3], v[3];
    ov_mesh_at(mesh, corner[0], a);
    ov_mesh_at(mesh, corner[1], u);
    ov_mesh_at(mesh, corner[2], v);
    for (size_t k = 0; k < 3; ++k) {
        u[k] -= a[k];
        v[k] -= a[k];
    }
    const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2],
                 z = u[0] * v[1] - u[1] * v[0];
    return 0.5 * sqrt(x * x + y * y + z * z);
}

/* Sums over the surface: a third of a quarter of each triangle's area at its corners, three
 * quarters of it at its centre, which integrates quadratic functions exactly. of_vertices: squared,
 * by the mesh's numbers. */
static ovoid_status sum_distances(ovoid_context *context, const ov_trail *from,
                                  const float *of_vertices, const float *of_centres,
                                  directed *result) {
    directed sum = {0.0, 0.0, 0.0};
    double weights = 0.0;
    for (size_t k = 0; k < from->triangles; ++k) {
        const ovoid_status asked = ov_progress_turn(context, k, from->triangles);
        if (asked != OVOID_OK)
            return asked;
        const uint32_t t = ov_trail_triangle(from, k);
        const double area = area_of(from->mesh, t), weight[2] = {area / 12.0, 0.75 * area};
        for (size_t i = 0; i < 4; ++i) {
            const double square =
                i < 3 ? of_vertices[from->mesh->corners[3 * (size_t)t + i]] : of_centres[k];
            const double distance = sqrt(square);
            sum.largest = fmax(sum.largest, distance);
            sum.mean += weight[i / 3] * distance;
            sum.square += weight[i / 3] * square;
        }
        weights += area;
    }
    if (!(weights > 0.0))
        return ov_fail(context, OVOID_ERROR_NUMERIC, "a surface without area has no distances");
    *result = (directed){sum.largest, sum.mean / weights, sum.square / weights};
    return OVOID_OK;
}

/* From the points of one mesh to the triangles of the other. */
static ovoid_status measure_directed(ovoid_context *context, const ov_trail *from,
                                     const ov_trail *to, const double origin[3], directed *result,
                                     float *of_vertices, ov_bound *bound) {
    ovoid_status status = OVOID_OK;
    ov_facets facets = {0};
    ov_meter meter = {0};
    float *at_vertices = NULL;
    const ov_sites sites = {.count = from->vertices + from->triangles, .trail = from};
    float *const squared = ov_alloc(context, sites.count, sizeof *squared, "distances");
    if (!squared)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_facets_set(context, &facets, to, origin));
    OV_TRY(ov_facets_distances(context, &meter, &facets, &sites, squared));
    if (from->vertex) {
        at_vertices = ov_alloc(context, from->mesh->vertices, sizeof *at_vertices, "distances");
        if (!at_vertices) {
            status = OVOID_ERROR_MEMORY;
            goto cleanup;
        }
        for (size_t k = 0; k < from->vertices; ++k)
            at_vertices[from->vertex[k]] = squared[k];
    }
    OV_TRY(sum_distances(context, from, at_vertices ? at_vertices : squared,
                         squared + from->vertices, result));
    if (bound)
        OV_TRY(ov_bound_add(context, &meter, &facets, from, at_vertices ? at_vertices : squared,
                            bound));
    if (of_vertices)
        ov_trail_put_distances(from, squared, of_vertices);
cleanup:
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    free(at_vertices);
    free(squared);
    return status;
}

/* The middle of the box about both meshes. */
static void middle_of(const ovoid_mesh *a, const ovoid_mesh *b, double origin[3]) {
    const ovoid_mesh *const both[2] = {a, b};
    double low[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, high[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    for (size_t m = 0; m < 2; ++m)
        for (size_t v = 0; v < both[m]->vertices; ++v) {
            double at[3];
            ov_mesh_at(both[m], v, at);
            for (size_t k = 0; k < 3; ++k) {
                low[k] = fmin(low[k], at[k]);
                high[k] = fmax(high[k], at[k]);
            }
        }
    for (size_t k = 0; k < 3; ++k)
        origin[k] = 0.5 * low[k] + 0.5 * high[k];
}

static ovoid_status check_trail(ovoid_context *context, const ov_trail *trail, const char *which,
                                bool outer_only) {
    if (trail->triangles > 0)
        return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_EMPTY, "the %s mesh has no %s: there are no distances",
                   which, outer_only ? "outer component" : "triangle");
}

ovoid_status ov_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                               bool outer_only, ovoid_distances *distances, float *from_a,
                               float *from_b, ov_bound *bound) {
    ovoid_status status = OVOID_OK;
    directed forward, backward;
    double origin[3];
    ov_trail first = {0}, second = {0};
    middle_of(a, b, origin);
    OV_TRY(ov_trail_create(context, a, outer_only, &first));
    OV_TRY(ov_trail_create(context, b, outer_only, &second));
    OV_TRY(check_trail(context, &first, "first", outer_only));
    OV_TRY(check_trail(context, &second, "second", outer_only));
    OV_TRY(measure_directed(context, &first, &second, origin, &forward, from_a, bound));
    OV_TRY(measure_directed(context, &second, &first, origin, &backward, from_b, bound));
    *distances = (ovoid_distances){.hausdorff = fmax(forward.largest, backward.largest),
                                   .forward = forward.largest,
                                   .backward = backward.largest,
                                   .mean = 0.5 * (forward.mean + backward.mean),
                                   .rms = sqrt(0.5 * (forward.square + backward.square))};
cleanup:
    ov_trail_destroy(&first);
    ov_trail_destroy(&second);
    return status;
}

ovoid_status ovoid_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                                  bool outer_only, ovoid_distances *distances, float *from_a) {
    float *of_vertices = NULL;
    OV_NEED(context, context);
    OV_NEED(context, a);
    OV_NEED(context, b);
    OV_NEED(context, distances);
    if (from_a) {
        of_vertices = ov_alloc(context, a->vertices, sizeof *of_vertices, "distances");
        if (!of_vertices)
            return OVOID_ERROR_MEMORY;
    }
    ov_progress_begin(context, "measure");
    const ovoid_status status =
        ov_mesh_distances(context, a, b, outer_only, distances, of_vertices, NULL, NULL);
    ov_progress_end(context);
    if (from_a && status == OVOID_OK)
        memcpy(from_a, of_vertices, a->vertices * sizeof *from_a);
    free(of_vertices);
    return status;
}
