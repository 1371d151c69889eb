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

/* So many half-edges, or a share of all of them, are sorted at a time; of a mesh in files no more
 * than its store keeps in memory. */
#define EDGES_LEAST ((size_t)1 << 18)
#define EDGES_SHARE 4

/* Triangles that follow one another have their edges under few vertices: of a block of them it is
 * known which shares of all vertices these are in, a bit for each. */
#define BLOCK ((size_t)1 << 10)
#define SHARES 64

typedef struct edge_check {
    ovoid_mesh *mesh;
    uint32_t *count;  /* half-edges of each vertex; becomes where they end */
    uint64_t *shares; /* of each block */
    size_t width;     /* vertices of a share */
    size_t most;      /* half-edges at a time, */
    size_t room;      /* and as many as one vertex may have by itself */
    half_edge *edges;
} edge_check;

static uint32_t low_end(const uint32_t *corners, size_t k, uint32_t *high) {
    const uint32_t a = corners[k], b = corners[k % 3 == 2 ? k - 2 : k + 1];
    *high = a < b ? b : a;
    return a < b ? a : b;
}

static size_t half_edges_of(const ovoid_mesh *mesh) {
    return 3 * mesh->triangles;
}

/* Where the half-edges of a block end. */
static size_t block_end(const ovoid_mesh *mesh, size_t block) {
    const size_t end = 3 * BLOCK * (block + 1);
    return end < half_edges_of(mesh) ? end : half_edges_of(mesh);
}

static ovoid_status count_half_edges(ovoid_context *context, edge_check *e) {
    const ovoid_mesh *const mesh = e->mesh;
    for (size_t block = 0; block * BLOCK < mesh->triangles; ++block) {
        const size_t end = block_end(mesh, block);
        ov_store_turn(mesh->store, block * BLOCK);
        for (size_t k = 3 * BLOCK * block; k < end; ++k) {
            uint32_t high;
            const uint32_t low = low_end(mesh->corners, k, &high), own = ++e->count[low];
            if (own == 0)
                return ov_fail(context, OVOID_ERROR_LIMIT, "a vertex of a mesh has 2^32 edges");
            e->room = own > e->room ? own : e->room; /* one vertex with more than its share */
            e->shares[block] |= (uint64_t)1 << low / e->width;
        }
    }
    return OVOID_OK;
}

/* The vertices from `first` on that have no more than so many half-edges; at least one. */
static size_t edges_end(const edge_check *e, size_t first) {
    size_t end = first, sum = 0;
    while (end < e->mesh->vertices && (end == first || sum + e->count[end] <= e->most))
        sum += e->count[end++];
    return end;
}

/* Files the half-edges of a block that are under the vertices from first to end. */
static void file_block(edge_check *e, size_t block, size_t first, size_t end) {
    const uint32_t *const corners = e->mesh->corners;
    const size_t last = block_end(e->mesh, block);
    for (size_t k = 3 * BLOCK * block; k < last; ++k) {
        uint32_t high;
        const uint32_t low = low_end(corners, k, &high);
        if (low >= first && low < end)
            e->edges[e->count[low]++] = (half_edge)high << 1 | (corners[k] != low);
    }
}

static uint64_t shares_between(const edge_check *e, size_t first, size_t end) {
    const size_t low = first / e->width, high = (end - 1) / e->width;
    const uint64_t up_to_high = UINT64_MAX >> (SHARES - 1 - high);
    return up_to_high & UINT64_MAX << low;
}

/* Files the half-edges under the vertices from first to end, and counts the edges. */
static void check_edges_of(edge_check *e, size_t first, size_t end) {
    ovoid_mesh *const mesh = e->mesh;
    const uint64_t wanted = shares_between(e, first, end);
    uint32_t sum = 0;
    for (size_t v = first; v < end; ++v) {
        const uint32_t own = e->count[v];
        e->count[v] = sum;
        sum += own;
    }
    for (size_t block = 0; block * BLOCK < mesh->triangles; ++block) {
        ov_store_turn(mesh->store, block * BLOCK);
        if (e->shares[block] & wanted)
            file_block(e, block, first, end);
    }
    for (size_t v = first; v < end; ++v) {
        ovoid_component *const component = &mesh->component[mesh->component_of[v]];
        const uint32_t from = v > first ? e->count[v - 1] : 0;
        component->euler -=
            (int32_t)count_edges(e->edges + from, e->count[v] - from, &component->closed);
    }
}

static ovoid_status reserve_edges(ovoid_context *context, edge_check *e) {
    ovoid_status status = OVOID_OK;
    const ovoid_mesh *const mesh = e->mesh;
    const size_t half_edges = half_edges_of(mesh), share = half_edges / EDGES_SHARE;
    e->most = share > EDGES_LEAST ? share : EDGES_LEAST;
    if (e->most > ov_store_room(mesh->store) / sizeof *e->edges)
        e->most = ov_store_room(mesh->store) / sizeof *e->edges;
    e->room = e->most;
    e->width = mesh->vertices / SHARES + 1;
    OV_TRY(ov_store_alloc(context, mesh->store, &e->count, mesh->vertices, sizeof *e->count,
                          "edges of a mesh"));
    OV_TRY(ov_store_alloc(context, mesh->store, &e->shares, mesh->triangles / BLOCK + 1,
                          sizeof *e->shares, "edges of a mesh"));
    OV_TRY(count_half_edges(context, e));
    OV_TRY(ov_store_alloc(context, mesh->store, &e->edges,
                          e->room < half_edges ? e->room : half_edges, sizeof *e->edges,
                          "edges of a mesh"));
cleanup:
    return status;
}

/* Euler characteristics, and whether components are closed and oriented. Half-edges are sorted by
 * counting, those of a share of the vertices at a time: linear, and in little memory. */
static ovoid_status check_edges(ovoid_context *context, ovoid_mesh *mesh) {
    ovoid_status status = OVOID_OK;
    edge_check e = {.mesh = mesh};
    OV_TRY(reserve_edges(context, &e));
    for (size_t c = 0; c < mesh->components; ++c) {
        mesh->component[c].closed = mesh->component[c].triangles > 0;
        mesh->component[c].euler =
            (int32_t)(mesh->component[c].vertices + mesh->component[c].triangles);
    }
    for (size_t first = 0, end; first < mesh->vertices; first = end) {
        OV_TRY(ov_progress_ask(context));
        end = edges_end(&e, first);
        check_edges_of(&e, first, end);
    }
cleanup:
    ov_store_free(mesh->store, e.edges);
    ov_store_free(mesh->store, e.shares);
    ov_store_free(mesh->store, e.count);
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

/* The same of a mesh's arrays, whose pages are let go on the way. */
#define STRETCH ((size_t)1 << 20)

static bool are_finite_between(const ovoid_mesh *mesh, size_t first, size_t end) {
    bool finite = true;
    for (size_t from = first; from < end; from += STRETCH) {
        const size_t to = end - from < STRETCH ? end : from + STRETCH;
        finite &= are_finite(mesh->xyz ? NULL : mesh->offsets, mesh->xyz, from, to) &&
                  are_finite(mesh->normals, NULL, from, to);
        ov_store_rest(mesh->store);
    }
    return finite;
}

static bool are_corners_between(const ovoid_mesh *mesh, size_t first, size_t end) {
    uint32_t most = 0;
    for (size_t from = first; from < end; from += STRETCH) {
        const size_t to = end - from < STRETCH ? end : from + STRETCH;
        for (size_t n = from; n < to; ++n)
            most = mesh->corners[n] > most ? mesh->corners[n] : most;
        ov_store_rest(mesh->store);
    }
    return first == end || most < mesh->vertices;
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
    c->fine[k] = are_finite_between(mesh, from, to) && are_corners_between(mesh, first, end);
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
        made->store = ov_store_share(arrays->store);
        return made;
    }
    ov_store_free(arrays->store, arrays->xyz);
    ov_store_free(arrays->store, arrays->offsets);
    ov_store_free(arrays->store, arrays->normals);
    ov_store_free(arrays->store, arrays->corners);
    return NULL;
}

ovoid_status ov_mesh_connect(ovoid_context *context, ovoid_mesh *mesh) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_mesh_check(context, mesh));
    if (mesh->xyz && !mesh->normals)
        OV_TRY(make_normals(context, mesh));
    OV_TRY(ov_store_alloc(context, mesh->store, &mesh->component_of, mesh->vertices,
                          sizeof *mesh->component_of, "components of a mesh"));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_components_find(context, mesh));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(ov_components_measure(context, mesh));
    OV_TRY(ov_progress_ask(context));
    if (mesh->xyz)
        OV_TRY(check_edges(context, mesh));
    OV_TRY(ov_progress_ask(context));
cleanup:
    return status;
}

ovoid_status ov_mesh_finish(ovoid_context *context, ovoid_mesh *mesh) {
    const ovoid_status status = ov_mesh_connect(context, mesh);
    return status == OVOID_OK ? ov_mesh_expose(context, mesh) : status;
}

ovoid_status ov_mesh_adopt(ovoid_context *context, ov_store *store, double *xyz, float *normals,
                           size_t vertices, uint32_t *corners, size_t triangles,
                           ovoid_mesh **mesh) {
    const ovoid_mesh arrays = {.store = store,
                               .vertices = vertices,
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
        ov_mesh_adopt(context, NULL, points, directions, vertices, triples, triangles, mesh);
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
    void *const arrays[] = {(*mesh)->xyz,     (*mesh)->offsets, (*mesh)->edge,
                            (*mesh)->normals, (*mesh)->corners, (*mesh)->component_of};
    for (size_t k = 0; k < sizeof arrays / sizeof *arrays; ++k)
        ov_store_free((*mesh)->store, arrays[k]);
    ov_store_destroy(&(*mesh)->store);
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
