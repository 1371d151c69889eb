#include "surface/distance.h"

#include "field/field.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Consecutive points of one work-item on CPUs: enough to share what starting it costs, and for most
 * of them to have a neighbour's distance as a bound. */
#define CPU_POINTS 64

#define BOX 6 /* floats: low x, y, z, high x, y, z */

/* ---- order -------------------------------------------------------------------------------- */

static bool counts(const ovoid_mesh *mesh, size_t triangle, bool outer_only) {
    return !outer_only || ov_mesh_component_of_triangle(mesh, triangle)->outer;
}

static void centre_of(const ovoid_mesh *mesh, size_t triangle, double centre[3]) {
    const uint32_t *const corner = mesh->corners + 3 * triangle;
    for (size_t k = 0; k < 3; ++k)
        centre[k] = (mesh->xyz[3 * (size_t)corner[0] + k] + mesh->xyz[3 * (size_t)corner[1] + k] +
                     mesh->xyz[3 * (size_t)corner[2] + k]) /
                    3.0;
}

/* Bits per axis of the curve: a surface of n triangles is about sqrt(n) of them wide; two bits more
 * tell neighbours apart. */
static unsigned curve_bits(size_t triangles) {
    unsigned bits = 4;
    while (bits < 21 && triangles >> (2 * (bits - 2)) > 0)
        ++bits;
    return bits;
}

/* The triangles that count, `used` of them, along a Hilbert curve. *order is allocated. */
static ovoid_status order_triangles(ovoid_context *context, const ovoid_mesh *mesh, bool outer_only,
                                    uint32_t **order, size_t *used) {
    ovoid_status status = OVOID_OK;
    double low[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, extent = DBL_MIN;
    uint64_t *const keys = ov_alloc(context, mesh->triangles, sizeof *keys, "order of triangles");
    uint32_t *const index = ov_alloc(context, mesh->triangles, sizeof *index, "order of triangles");
    *order = ov_alloc(context, mesh->triangles, sizeof **order, "order of triangles");
    if (!keys || !index || !*order) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t v = 0; v < 3 * mesh->vertices; ++v)
        low[v % 3] = fmin(low[v % 3], mesh->xyz[v]);
    for (size_t v = 0; v < 3 * mesh->vertices; ++v)
        extent = fmax(extent, mesh->xyz[v] - low[v % 3]);
    const unsigned bits = curve_bits(mesh->triangles);
    const double cells = ldexp(1.0, (int)bits) - 1.0;
    size_t count = 0;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        double centre[3];
        uint32_t cell[3];
        if (!counts(mesh, t, outer_only))
            continue;
        centre_of(mesh, t, centre);
        for (size_t k = 0; k < 3; ++k)
            cell[k] = (uint32_t)fmin(fmax((centre[k] - low[k]) / extent * cells, 0.0), cells);
        keys[count] = ov_hilbert_index(cell[0], cell[1], cell[2], bits);
        index[count++] = (uint32_t)t;
    }
    OV_TRY(ov_sort_keys(context, keys, count, *order));
    for (size_t k = 0; k < count; ++k)
        (*order)[k] = index[(*order)[k]];
    *used = count;
cleanup:
    free(keys);
    free(index);
    return status;
}

/* ---- points ------------------------------------------------------------------------------- */

static double area_of(const ovoid_mesh *mesh, size_t triangle) {
    const uint32_t *const corner = mesh->corners + 3 * triangle;
    double u[3], v[3];
    for (size_t k = 0; k < 3; ++k) {
        u[k] = mesh->xyz[3 * (size_t)corner[1] + k] - mesh->xyz[3 * (size_t)corner[0] + k];
        v[k] = mesh->xyz[3 * (size_t)corner[2] + k] - mesh->xyz[3 * (size_t)corner[0] + k];
    }
    const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2],
                 z = u[0] * v[1] - u[1] * v[0];
    return 0.5 * sqrt(x * x + y * y + z * z);
}

static void add_point(ov_facets *facets, const double *xyz, uint32_t vertex) {
    const size_t at = facets->points++;
    for (size_t k = 0; k < 3; ++k)
        facets->xyz[3 * at + k] = (float)(xyz[k] - facets->origin[k]);
    facets->vertex[at] = vertex;
}

/* The vertices of the triangles where they come up first. */
static ovoid_status list_vertices(ovoid_context *context, const ovoid_mesh *mesh,
                                  const uint32_t *order, ov_facets *facets) {
    bool *const listed = ov_alloc(context, mesh->vertices, sizeof *listed, "points of a mesh");
    facets->xyz = ov_alloc(context, 3 * mesh->vertices, sizeof *facets->xyz, "points of a mesh");
    facets->vertex = ov_alloc(context, mesh->vertices, sizeof *facets->vertex, "points of a mesh");
    const bool good = listed && facets->xyz && facets->vertex;
    for (size_t k = 0; good && k < 3 * facets->triangles; ++k) {
        const uint32_t v = mesh->corners[3 * (size_t)order[k / 3] + k % 3];
        if (!listed[v])
            add_point(facets, mesh->xyz + 3 * (size_t)v, v);
        listed[v] = true;
    }
    free(listed);
    return good ? OVOID_OK : OVOID_ERROR_MEMORY;
}

/* Each triangle's centre, and its vertices where they come up first. */
static ovoid_status list_points(ovoid_context *context, const ovoid_mesh *mesh,
                                const uint32_t *order, ov_facets *facets) {
    const size_t room = facets->triangles + mesh->vertices;
    uint32_t *const place = ov_alloc(context, mesh->vertices, sizeof *place, "points of a mesh");
    facets->xyz = ov_alloc(context, 3 * room, sizeof *facets->xyz, "points of a mesh");
    facets->weight = ov_alloc(context, room, sizeof *facets->weight, "points of a mesh");
    facets->vertex = ov_alloc(context, room, sizeof *facets->vertex, "points of a mesh");
    if (!place || !facets->xyz || !facets->weight || !facets->vertex) {
        free(place);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t v = 0; v < mesh->vertices; ++v)
        place[v] = UINT32_MAX;
    for (size_t k = 0; k < facets->triangles; ++k) {
        const double area = area_of(mesh, order[k]);
        double centre[3];
        centre_of(mesh, order[k], centre);
        facets->weight[facets->points] = 0.75 * area;
        add_point(facets, centre, UINT32_MAX);
        for (size_t i = 0; i < 3; ++i) {
            const uint32_t v = mesh->corners[3 * (size_t)order[k] + i];
            if (place[v] == UINT32_MAX) {
                place[v] = (uint32_t)facets->points;
                add_point(facets, mesh->xyz + 3 * (size_t)v, v);
            }
            facets->weight[place[v]] += area / 12.0;
        }
    }
    free(place);
    return OVOID_OK;
}

/* ---- triangles on the device -------------------------------------------------------------- */

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float inverse(double square) {
    const double result = square > 0.0 ? 1.0 / square : 0.0;
    return (float)fmin(result, FLT_MAX);
}

/* Writes triangle j of a leaf. Edges and their duals are those of the corners rounded to floats, so
 * that what a point is held against is what the mesh's own points are. */
static void put_triangle(const ovoid_mesh *mesh, uint32_t triangle, const double origin[3],
                         float *leaf, size_t j, float box[BOX]) {
    float p[3][3];
    double u[3], v[3], across[3];
    for (size_t i = 0; i < 3; ++i)
        for (size_t k = 0; k < 3; ++k) {
            const size_t at = 3 * (size_t)mesh->corners[3 * (size_t)triangle + i] + k;
            p[i][k] = (float)(mesh->xyz[at] - origin[k]);
            box[k] = fminf(box[k], p[i][k]);
            box[k + 3] = fmaxf(box[k + 3], p[i][k]);
        }
    for (size_t k = 0; k < 3; ++k) {
        u[k] = (double)p[1][k] - p[0][k];
        v[k] = (double)p[2][k] - p[0][k];
        across[k] = v[k] - u[k];
    }
    const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
    const double determinant = uu * vv - uv * uv;
    const bool flat = !(determinant > 1e-12 * uu * vv); /* its edges are all there is to it */
    for (size_t k = 0; k < 3; ++k) {
        leaf[k * OV_LEAF + j] = p[0][k];
        leaf[(3 + k) * OV_LEAF + j] = (float)u[k];
        leaf[(6 + k) * OV_LEAF + j] = (float)v[k];
        leaf[(9 + k) * OV_LEAF + j] = flat ? 0.0f : (float)((vv * u[k] - uv * v[k]) / determinant);
        leaf[(12 + k) * OV_LEAF + j] = flat ? 0.0f : (float)((uu * v[k] - uv * u[k]) / determinant);
    }
    leaf[15 * OV_LEAF + j] = inverse(uu);
    leaf[16 * OV_LEAF + j] = inverse(vv);
    leaf[17 * OV_LEAF + j] = inverse(dot(across, across));
}

static ovoid_status upload(ovoid_context *context, ov_buffer *buffer, const float *values,
                           size_t count, const char *what) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_buffer_reserve(context, buffer, count * sizeof *values, what));
    OV_TRY(ov_buffer_write(context, buffer, 0, values, count * sizeof *values));
cleanup:
    return status;
}

/* Packs the triangles piece by piece: all at once would take as much memory on the host as on the
 * device. */
#define PIECE_LEAVES ((size_t)4096)

static ovoid_status upload_leaves(ovoid_context *context, const ovoid_mesh *mesh,
                                  const uint32_t *order, ov_facets *facets, size_t leaves,
                                  float *low_high) {
    ovoid_status status = OVOID_OK;
    const size_t leaf_floats = OV_TRIANGLE * OV_LEAF, bytes = leaf_floats * sizeof(float);
    const size_t piece = leaves < PIECE_LEAVES ? leaves : PIECE_LEAVES;
    float *const packed = ov_alloc(context, piece * leaf_floats, sizeof *packed, "triangles");
    if (!packed)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_buffer_reserve(context, &facets->leaves, leaves * bytes, "triangles of a mesh"));
    for (size_t leaf = 0; leaf < leaves; ++leaf) {
        float *const box = low_high + leaf * BOX;
        for (size_t k = 0; k < BOX; ++k)
            box[k] = k < 3 ? FLT_MAX : -FLT_MAX;
        for (size_t j = 0; j < OV_LEAF; ++j) {
            const size_t at = leaf * OV_LEAF + j;
            put_triangle(mesh, order[at < facets->triangles ? at : facets->triangles - 1],
                         facets->origin, packed + leaf % piece * leaf_floats, j, box);
        }
        const size_t packed_leaves = leaf % piece + 1;
        if (packed_leaves == piece || leaf + 1 == leaves)
            OV_TRY(ov_buffer_write(context, &facets->leaves, (leaf + 1 - packed_leaves) * bytes,
                                   packed, packed_leaves * bytes));
    }
cleanup:
    free(packed);
    return status;
}

static ovoid_status upload_triangles(ovoid_context *context, const ovoid_mesh *mesh,
                                     const uint32_t *order, ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    const size_t leaves = (facets->triangles + OV_LEAF - 1) / OV_LEAF;
    float *boxes = NULL;
    size_t floats = 0;
    float *const low_high = ov_alloc(context, leaves * BOX, sizeof *low_high, "boxes of triangles");
    if (!low_high)
        return OVOID_ERROR_MEMORY;
    OV_TRY(upload_leaves(context, mesh, order, facets, leaves, low_high));
    OV_TRY(ov_tree_build(context, low_high, leaves, &facets->tree, &boxes, &floats));
    OV_TRY(upload(context, &facets->boxes, boxes, floats, "boxes of triangles"));
cleanup:
    free(boxes);
    free(low_high);
    return status;
}

/* ---- facets ------------------------------------------------------------------------------- */

ovoid_status ov_facets_create(ovoid_context *context, const ovoid_mesh *mesh, bool outer_only,
                              unsigned parts, const double origin[3], ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    ov_facets made = {0};
    uint32_t *order = NULL;
    memcpy(made.origin, origin, sizeof made.origin);
    if (mesh->triangles + mesh->vertices >= UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "%zu vertices and %zu triangles are more points than distances are taken of",
                       mesh->vertices, mesh->triangles);
    OV_TRY(order_triangles(context, mesh, outer_only, &order, &made.triangles));
    if (parts & OV_FACETS_POINTS)
        OV_TRY(list_points(context, mesh, order, &made));
    else if (parts & OV_FACETS_VERTICES)
        OV_TRY(list_vertices(context, mesh, order, &made));
    if (parts & OV_FACETS_TRIANGLES)
        OV_TRY(upload_triangles(context, mesh, order, &made));
    *facets = made;
cleanup:
    if (status != OVOID_OK)
        ov_facets_destroy(&made);
    free(order);
    return status;
}

void ov_facets_destroy(ov_facets *facets) {
    free(facets->xyz);
    free(facets->weight);
    free(facets->vertex);
    ov_buffer_destroy(&facets->boxes);
    ov_buffer_destroy(&facets->leaves);
    memset(facets, 0, sizeof *facets);
}

ovoid_status ov_facets_distances(ovoid_context *context, const ov_facets *facets, const float *xyz,
                                 size_t count, float *squared) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    ov_kernel kernel = {0};
    ov_buffer points = {0}, result = {0};
    if (count == 0)
        return OVOID_OK;
    if (facets->triangles == 0)
        return ov_fail(context, OVOID_ERROR_NUMERIC, "there is no surface to be distant from");
    OV_TRY(ov_device_get(context, &device));
    OV_TRY(ov_kernel_create(context, "distance", "distances", &kernel));
    OV_TRY(upload(context, &points, xyz, 3 * count, "points of a mesh"));
    OV_TRY(ov_buffer_reserve(context, &result, count * sizeof *squared, "distances"));
    const cl_uint total = (cl_uint)count, each = device->shape.lanes == 1 ? CPU_POINTS : 1;
    OV_TRY(OV_LAUNCH(context, &kernel, (count + each - 1) / each, ov_item_group(device),
                     OV_ARG(total), OV_ARG(each), OV_ARG(points.memory), OV_ARG(facets->tree),
                     OV_ARG(facets->boxes.memory), OV_ARG(facets->leaves.memory),
                     OV_ARG(result.memory)));
    OV_TRY(ov_buffer_read(context, &result, 0, squared, count * sizeof *squared));
    for (size_t k = 0; k < count; ++k)
        if (!isfinite(squared[k])) {
            status = ov_fail(context, OVOID_ERROR_NUMERIC,
                             "the distance of a point from a surface is more than a float holds");
            goto cleanup;
        }
cleanup:
    ov_buffer_destroy(&points);
    ov_buffer_destroy(&result);
    ov_kernel_destroy(&kernel);
    return status;
}

/* ---- both ways ---------------------------------------------------------------------------- */

/* Of the distances from one surface to the other. */
typedef struct directed {
    double largest, mean, square;
} directed;

static ovoid_status measure_directed(ovoid_context *context, const ov_facets *from,
                                     const ov_facets *to, directed *result, float *of_vertices) {
    float *const squared = ov_alloc(context, from->points, sizeof *squared, "distances");
    if (!squared)
        return OVOID_ERROR_MEMORY;
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_facets_distances(context, to, from->xyz, from->points, squared));
    directed sum = {0.0, 0.0, 0.0};
    double weights = 0.0;
    for (size_t k = 0; k < from->points; ++k) {
        const double distance = sqrt((double)squared[k]);
        sum.largest = fmax(sum.largest, distance);
        sum.mean += from->weight[k] * distance;
        sum.square += from->weight[k] * squared[k];
        weights += from->weight[k];
        if (of_vertices && from->vertex[k] != UINT32_MAX)
            of_vertices[from->vertex[k]] = (float)distance;
    }
    if (!(weights > 0.0)) {
        status = ov_fail(context, OVOID_ERROR_NUMERIC, "a surface without area has no distances");
        goto cleanup;
    }
    *result = (directed){sum.largest, sum.mean / weights, sum.square / weights};
cleanup:
    free(squared);
    return status;
}

/* The middle of the box about both meshes. */
static void middle_of(const ovoid_mesh *a, const ovoid_mesh *b, double origin[3]) {
    const ovoid_mesh *const both[2] = {a, b};
    double low[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, high[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    for (size_t m = 0; m < 2; ++m)
        for (size_t k = 0; k < 3 * both[m]->vertices; ++k) {
            low[k % 3] = fmin(low[k % 3], both[m]->xyz[k]);
            high[k % 3] = fmax(high[k % 3], both[m]->xyz[k]);
        }
    for (size_t k = 0; k < 3; ++k)
        origin[k] = 0.5 * low[k] + 0.5 * high[k];
}

/* From the points of one mesh to the triangles of the other. */
static ovoid_status measure_meshes(ovoid_context *context, const ovoid_mesh *from,
                                   const ovoid_mesh *to, bool outer_only, const double origin[3],
                                   directed *result, float *of_vertices) {
    ovoid_status status = OVOID_OK;
    ov_facets points = {0}, triangles = {0};
    OV_TRY(ov_facets_create(context, from, outer_only, OV_FACETS_POINTS, origin, &points));
    OV_TRY(ov_facets_create(context, to, outer_only, OV_FACETS_TRIANGLES, origin, &triangles));
    OV_TRY(measure_directed(context, &points, &triangles, result, of_vertices));
cleanup:
    ov_facets_destroy(&points);
    ov_facets_destroy(&triangles);
    return status;
}

static ovoid_status check_mesh(ovoid_context *context, const ovoid_mesh *mesh, const char *which,
                               bool outer_only) {
    for (size_t t = 0; t < mesh->triangles; ++t)
        if (counts(mesh, t, outer_only))
            return OVOID_OK;
    return ov_fail(context, OVOID_ERROR_EMPTY, "the %s mesh has no %s: there are no distances",
                   which, outer_only ? "outer component" : "triangle");
}

ovoid_status ov_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                               bool outer_only, ovoid_distances *distances, float *from_a,
                               float *from_b) {
    ovoid_status status = OVOID_OK;
    directed forward, backward;
    double origin[3];
    middle_of(a, b, origin);
    OV_TRY(check_mesh(context, a, "first", outer_only));
    OV_TRY(check_mesh(context, b, "second", outer_only));
    OV_TRY(measure_meshes(context, a, b, outer_only, origin, &forward, from_a));
    OV_TRY(measure_meshes(context, b, a, outer_only, origin, &backward, from_b));
    *distances = (ovoid_distances){.hausdorff = fmax(forward.largest, backward.largest),
                                   .forward = forward.largest,
                                   .backward = backward.largest,
                                   .mean = 0.5 * (forward.mean + backward.mean),
                                   .rms = sqrt(0.5 * (forward.square + backward.square))};
cleanup:
    return status;
}

ovoid_status ovoid_mesh_distances(ovoid_context *context, const ovoid_mesh *a, const ovoid_mesh *b,
                                  bool outer_only, ovoid_distances *distances, float *from_a) {
    float *of_vertices = NULL;
    if (!a || !b || !distances)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "distances are of two meshes");
    if (from_a) {
        of_vertices = ov_alloc(context, a->vertices, sizeof *of_vertices, "distances");
        if (!of_vertices)
            return OVOID_ERROR_MEMORY;
    }
    const ovoid_status status =
        ov_mesh_distances(context, a, b, outer_only, distances, of_vertices, NULL);
    if (from_a && status == OVOID_OK)
        memcpy(from_a, of_vertices, a->vertices * sizeof *from_a);
    free(of_vertices);
    return status;
}
