#include "mesh/mesh.h"
#include "base/parallel.h"
#include "mesh/components.h"
#include "mesh/exposed.h"
#include "mesh/vectors.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- edges --------------------------------------------------------------------------------- */

/* A half-edge, filed under its vertex of lower index: twice the other one, + 1 if it runs towards
 * the lower one. */
typedef uint64_t half_edge;

static void sort_half_edges(half_edge *edges, size_t count) {
    for (size_t k = 1; k < count; ++k) {
        const half_edge value = edges[k];
        size_t hole = k;
        for (; hole > 0 && edges[hole - 1] > value; --hole)
            edges[hole] = edges[hole - 1];
        edges[hole] = value;
    }
}

static int compare_half_edges(const void *a, const void *b) {
    const half_edge x = *(const half_edge *)a, y = *(const half_edge *)b;
    return (x > y) - (x < y);
}

/* Counts the edges under one vertex; whether each has two half-edges, one each way. */
static size_t count_edges(half_edge *edges, size_t count, bool *closed) {
    if (count <= 64)
        sort_half_edges(edges, count);
    else
        qsort(edges, count, sizeof *edges, compare_half_edges);
    size_t found = 0;
    for (size_t k = 0; k < count;) {
        size_t end = k + 1;
        while (end < count && edges[end] >> 1 == edges[k] >> 1)
            ++end;
        if (end - k != 2 || edges[k] == edges[k + 1])
            *closed = false;
        ++found;
        k = end;
    }
    return found;
}

/* Half-edges of so many, or a share of all of them, are sorted at a time. */
#define EDGES_LEAST ((size_t)1 << 18)
#define EDGES_SHARE 4

static uint32_t low_end(const uint32_t *corners, size_t k, uint32_t *high) {
    const uint32_t a = corners[k], b = corners[k % 3 == 2 ? k - 2 : k + 1];
    *high = a < b ? b : a;
    return a < b ? a : b;
}

/* The vertices from `first` on that have no more than `most` half-edges; at least one. */
static size_t edges_end(const ovoid_mesh *mesh, const uint32_t *count, size_t first, size_t most) {
    size_t end = first, sum = 0;
    while (end < mesh->vertices && (end == first || sum + count[end] <= most))
        sum += count[end++];
    return end;
}

/* Files the half-edges under the vertices from first to end, and counts the edges. count: how many
 * half-edges a vertex has; becomes where they end. */
static void check_edges_of(ovoid_mesh *mesh, size_t first, size_t end, uint32_t *count,
                           half_edge *edges) {
    uint32_t sum = 0;
    for (size_t v = first; v < end; ++v) {
        const uint32_t own = count[v];
        count[v] = sum;
        sum += own;
    }
    for (size_t k = 0; k < 3 * mesh->triangles; ++k) {
        uint32_t high;
        const uint32_t low = low_end(mesh->corners, k, &high);
        if (low >= first && low < end)
            edges[count[low]++] = (half_edge)high << 1 | (mesh->corners[k] != low);
    }
    for (size_t v = first; v < end; ++v) {
        ovoid_component *const component = &mesh->component[mesh->component_of[v]];
        const uint32_t from = v > first ? count[v - 1] : 0;
        component->euler -= (int32_t)count_edges(edges + from, count[v] - from, &component->closed);
    }
}

/* Euler characteristics, and whether components are closed and oriented. Half-edges are sorted by
 * counting, those of a share of the vertices at a time: linear, and in little memory. */
static ovoid_status check_edges(ovoid_context *context, ovoid_mesh *mesh) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    const size_t half_edges = 3 * mesh->triangles, share = half_edges / EDGES_SHARE;
    const size_t most = share > EDGES_LEAST ? share : EDGES_LEAST;
    size_t room = most;
    half_edge *edges = NULL;
    uint32_t *const count = ov_alloc(context, mesh->vertices, sizeof *count, "edges of a mesh");
    if (!count)
        goto cleanup;
    for (size_t k = 0; k < half_edges; ++k) {
        uint32_t high;
        const uint32_t own = ++count[low_end(mesh->corners, k, &high)];
        if (own == 0) {
            status = ov_fail(context, OVOID_ERROR_LIMIT, "a vertex of a mesh has 2^32 edges");
            goto cleanup;
        }
        room = own > room ? own : room; /* one vertex with more than its share */
    }
    edges =
        ov_alloc(context, room < half_edges ? room : half_edges, sizeof *edges, "edges of a mesh");
    if (!edges)
        goto cleanup;
    for (size_t c = 0; c < mesh->components; ++c) {
        mesh->component[c].closed = mesh->component[c].triangles > 0;
        mesh->component[c].euler =
            (int32_t)(mesh->component[c].vertices + mesh->component[c].triangles);
    }
    for (size_t first = 0, end; first < mesh->vertices; first = end) {
        if ((status = ov_progress_ask(context)) != OVOID_OK)
            goto cleanup;
        end = edges_end(mesh, count, first, most);
        check_edges_of(mesh, first, end, count, edges);
    }
    status = OVOID_OK;
cleanup:
    free(edges);
    free(count);
    return status;
}

/* ---- making ------------------------------------------------------------------------------- */

/* Of an array of floats or doubles, whether all are finite: faster than to look for the first that
 * is not, which nearly always there is none. */
static bool are_finite(const float *some, const double *others, size_t first, size_t end) {
    bool finite = true;
    for (size_t k = first; some && k < end; ++k)
        finite &= isfinite(some[k]) != 0;
    for (size_t k = first; others && k < end; ++k)
        finite &= isfinite(others[k]) != 0;
    return finite;
}

/* A share of the arrays. */
#define CHECK_PARTS 16
typedef struct checking {
    const ovoid_mesh *mesh;
    bool fine[CHECK_PARTS];
} checking;

static void check_part(size_t k, void *user) {
    checking *const c = user;
    const ovoid_mesh *const mesh = c->mesh;
    const size_t vertices = 3 * mesh->vertices, corners = 3 * mesh->triangles;
    const size_t from = vertices / CHECK_PARTS * k,
                 to = k + 1 < CHECK_PARTS ? vertices / CHECK_PARTS * (k + 1) : vertices;
    const size_t first = corners / CHECK_PARTS * k,
                 end = k + 1 < CHECK_PARTS ? corners / CHECK_PARTS * (k + 1) : corners;
    uint32_t most = 0;
    for (size_t n = first; n < end; ++n)
        most = mesh->corners[n] > most ? mesh->corners[n] : most;
    c->fine[k] = are_finite(mesh->xyz ? NULL : mesh->offsets, mesh->xyz, from, to) &&
                 are_finite(mesh->normals, NULL, from, to) &&
                 (first == end || most < mesh->vertices);
}

/* Says what is wrong with a mesh, if anything is. */
static ovoid_status find_fault(ovoid_context *context, const ovoid_mesh *mesh) {
    for (size_t k = 0; k < 3 * mesh->vertices; ++k)
        if (!isfinite(mesh->xyz ? mesh->xyz[k] : mesh->offsets[k]) ||
            (mesh->normals && !isfinite(mesh->normals[k])))
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "vertex %zu of a mesh has a coordinate or normal that is not finite",
                           k / 3);
    for (size_t k = 0; k < 3 * mesh->triangles; ++k)
        if (mesh->corners[k] >= mesh->vertices)
            return ov_fail(context, OVOID_ERROR_ARGUMENT,
                           "triangle %zu of a mesh names vertex %lu, but there are %zu", k / 3,
                           (unsigned long)mesh->corners[k], mesh->vertices);
    return OVOID_OK;
}

/* Few arrays are not worth threads. */
#define CHECK_MANY ((size_t)1 << 15)

ovoid_status ov_mesh_check(ovoid_context *context, const ovoid_mesh *mesh) {
    checking c = {.mesh = mesh};
    if (mesh->vertices > UINT32_MAX - 1 || mesh->triangles > UINT32_MAX - 1)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a mesh holds at most 2^32 - 2 vertices and triangles, not %zu and %zu",
                       mesh->vertices, mesh->triangles);
    if (mesh->triangles < CHECK_MANY)
        return find_fault(context, mesh);
    ov_parallel(CHECK_PARTS, check_part, &c);
    for (size_t k = 0; k < CHECK_PARTS; ++k)
        if (!c.fine[k])
            return find_fault(context, mesh);
    return OVOID_OK;
}

/* Sums of the normals of the triangles about each vertex, weighted with their areas. */
static ovoid_status make_normals(ovoid_context *context, ovoid_mesh *mesh) {
    double *const sum = ov_alloc(context, 3 * mesh->vertices, sizeof *sum, "normals of a mesh");
    mesh->normals =
        ov_alloc(context, 3 * mesh->vertices, sizeof *mesh->normals, "normals of a mesh");
    if (!sum || !mesh->normals) {
        free(sum);
        return OVOID_ERROR_MEMORY;
    }
    for (size_t t = 0; t < mesh->triangles; ++t) {
        double a[3], u[3], v[3], normal[3];
        corners_at(mesh, t, a, u, v);
        subtract(u, a, u);
        subtract(v, a, v);
        cross(u, v, normal);
        for (size_t k = 0; k < 9; ++k)
            sum[3 * (size_t)mesh->corners[3 * t + k / 3] + k % 3] += normal[k % 3];
    }
    for (size_t v = 0; v < mesh->vertices; ++v) {
        const double length = sqrt(dot(sum + 3 * v, sum + 3 * v));
        const double up[3] = {0.0, 0.0, 1.0}; /* where no triangle gives a direction */
        for (size_t k = 0; k < 3; ++k)
            mesh->normals[3 * v + k] = (float)(length > 0.0 ? sum[3 * v + k] / length : up[k]);
    }
    free(sum);
    return OVOID_OK;
}

/* Takes `arrays` over; NULL where memory runs out. */
static ovoid_mesh *take_arrays(ovoid_context *context, const ovoid_mesh *arrays) {
    ovoid_mesh *const made = ov_alloc(context, 1, sizeof *made, "a mesh");
    if (made) {
        *made = *arrays;
        return made;
    }
    free(arrays->xyz);
    free(arrays->offsets);
    free(arrays->normals);
    free(arrays->corners);
    return NULL;
}

ovoid_status ov_mesh_finish(ovoid_context *context, ovoid_mesh *mesh) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_mesh_check(context, mesh));
    if (mesh->xyz && !mesh->normals)
        OV_TRY(make_normals(context, mesh));
    mesh->component_of =
        ov_alloc(context, mesh->vertices, sizeof *mesh->component_of, "components of a mesh");
    if (!mesh->component_of)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_components_find(context, mesh));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_components_measure(context, mesh));
    OV_TRY(ov_progress_ask(context));
    if (mesh->xyz)
        OV_TRY(check_edges(context, mesh));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_mesh_expose(context, mesh));
cleanup:
    return status;
}

ovoid_status ov_mesh_adopt(ovoid_context *context, double *xyz, float *normals, size_t vertices,
                           uint32_t *corners, size_t triangles, ovoid_mesh **mesh) {
    const ovoid_mesh arrays = {.vertices = vertices,
                               .triangles = triangles,
                               .xyz = xyz,
                               .normals = normals,
                               .corners = corners};
    ovoid_mesh *made = take_arrays(context, &arrays);
    if (!made)
        return OVOID_ERROR_MEMORY;
    const ovoid_status status = ov_mesh_finish(context, made);
    if (status == OVOID_OK)
        *mesh = made;
    else
        ovoid_mesh_destroy(&made);
    return status;
}

ovoid_status ov_mesh_adopt_light(ovoid_context *context, float *offsets, const double origin[3],
                                 float *normals, size_t vertices, uint32_t *corners,
                                 size_t triangles, ovoid_mesh **mesh) {
    const ovoid_mesh arrays = {.vertices = vertices,
                               .triangles = triangles,
                               .offsets = offsets,
                               .origin = {origin[0], origin[1], origin[2]},
                               .normals = normals,
                               .corners = corners};
    ovoid_mesh *const made = take_arrays(context, &arrays);
    if (!made)
        return OVOID_ERROR_MEMORY;
    *mesh = made;
    return OVOID_OK;
}

static void *copy_of(ovoid_context *context, const void *data, size_t count, size_t size) {
    void *const copy = ov_alloc(context, count, size, "a mesh");
    if (copy && count > 0)
        memcpy(copy, data, count * size);
    return copy;
}

ovoid_status ovoid_mesh_create(ovoid_context *context, const double *xyz, const float *normals,
                               size_t vertices, const uint32_t *corners, size_t triangles,
                               ovoid_mesh **mesh) {
    OV_NEED(context, context);
    OV_NEED(context, mesh);
    if (vertices > 0)
        OV_NEED(context, xyz);
    if (triangles > 0)
        OV_NEED(context, corners);
    if (vertices > SIZE_MAX / 3 || triangles > SIZE_MAX / 3)
        return ov_fail(context, OVOID_ERROR_LIMIT, "a mesh of %zu vertices and %zu triangles",
                       vertices, triangles);
    double *const points = copy_of(context, xyz, 3 * vertices, sizeof *xyz);
    uint32_t *const triples = copy_of(context, corners, 3 * triangles, sizeof *corners);
    float *const directions =
        normals ? copy_of(context, normals, 3 * vertices, sizeof *normals) : NULL;
    if (!points || !triples || (normals && !directions)) {
        free(points);
        free(triples);
        free(directions);
        return OVOID_ERROR_MEMORY;
    }
    ov_progress_begin(context, "mesh");
    const ovoid_status status =
        ov_mesh_adopt(context, points, directions, vertices, triples, triangles, mesh);
    ov_progress_end(context);
    return status;
}

void ov_mesh_lighten(ovoid_mesh *mesh) {
    free(mesh->normals);
    mesh->normals = NULL;
    for (size_t k = 0; k < sizeof mesh->on_device / sizeof *mesh->on_device; ++k)
        ov_buffer_destroy(&mesh->on_device[k]);
}

void ovoid_mesh_destroy(ovoid_mesh **mesh) {
    if (!mesh || !*mesh)
        return;
    free((*mesh)->xyz);
    free((*mesh)->offsets);
    free((*mesh)->edge);
    free((*mesh)->normals);
    free((*mesh)->corners);
    free((*mesh)->component_of);
    free((*mesh)->component);
    for (size_t k = 0; k < sizeof(*mesh)->on_device / sizeof *(*mesh)->on_device; ++k)
        ov_buffer_destroy(&(*mesh)->on_device[k]);
    free(*mesh);
    *mesh = NULL;
}

/* ---- accessors ---------------------------------------------------------------------------- */

size_t ovoid_mesh_vertices(const ovoid_mesh *mesh) {
    return mesh ? mesh->vertices : 0;
}

size_t ovoid_mesh_triangles(const ovoid_mesh *mesh) {
    return mesh ? mesh->triangles : 0;
}

const double *ovoid_mesh_xyz(const ovoid_mesh *mesh) {
    return mesh ? mesh->xyz : NULL;
}

const float *ovoid_mesh_normals(const ovoid_mesh *mesh) {
    return mesh ? mesh->normals : NULL;
}

const uint32_t *ovoid_mesh_corners(const ovoid_mesh *mesh) {
    return mesh ? mesh->corners : NULL;
}

const uint32_t *ovoid_mesh_component_of(const ovoid_mesh *mesh) {
    return mesh ? mesh->component_of : NULL;
}

size_t ovoid_mesh_components(const ovoid_mesh *mesh) {
    return mesh ? mesh->components : 0;
}

const ovoid_component *ovoid_mesh_component(const ovoid_mesh *mesh, size_t index) {
    return mesh && index < mesh->components ? &mesh->component[index] : NULL;
}
