#include "mesh/mesh.h"
#include "mesh/exposed.h"
#include "mesh/union.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- vectors ------------------------------------------------------------------------------ */

static void subtract(const double *a, const double *b, double *result) {
    for (int k = 0; k < 3; ++k)
        result[k] = a[k] - b[k];
}

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *result) {
    result[0] = a[1] * b[2] - a[2] * b[1];
    result[1] = a[2] * b[0] - a[0] * b[2];
    result[2] = a[0] * b[1] - a[1] * b[0];
}

static void corners_at(const ovoid_mesh *mesh, size_t triangle, double *a, double *b, double *c) {
    const uint32_t *const corner = mesh->corners + 3 * triangle;
    ov_mesh_at(mesh, corner[0], a);
    ov_mesh_at(mesh, corner[1], b);
    ov_mesh_at(mesh, corner[2], c);
}

/* ---- components --------------------------------------------------------------------------- */

/* Fills component_of, components and the counts of component. */
static ovoid_status find_components(ovoid_context *context, ovoid_mesh *mesh) {
    uint32_t *const of = mesh->component_of;
    for (size_t v = 0; v < mesh->vertices; ++v)
        of[v] = (uint32_t)v;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        ov_unite(of, corner[0], corner[1]);
        ov_unite(of, corner[0], corner[2]);
    }
    size_t count = 0;
    for (size_t v = 0; v < mesh->vertices; ++v)
        count += of[v] == v;
    mesh->components = count;
    mesh->component = ov_alloc(context, count, sizeof *mesh->component, "components of a mesh");
    if (!mesh->component)
        return OVOID_ERROR_MEMORY;
    /* Parents come before their children: when v is met, of[parent] is a component already. */
    uint32_t next = 0;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        of[v] = of[v] == v ? next++ : of[of[v]];
        ++mesh->component[of[v]].vertices;
    }
    for (size_t t = 0; t < mesh->triangles; ++t)
        ++mesh->component[of[mesh->corners[3 * t]]].triangles;
    return OVOID_OK;
}

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

static inline void add_flat(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                            ov_content *content) {
    double a[3], u[3], v[3], normal[3];
    corners_at(mesh, triangle, a, u, v);
    subtract(u, a, u);
    subtract(v, a, v);
    subtract(a, origin, a);
    cross(u, v, normal);
    content->area += 0.5 * sqrt(dot(normal, normal));
    content->volume += dot(a, normal) / 6.0;
}

void ov_mesh_flat_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                           ov_content *content) {
    add_flat(mesh, triangle, origin, content);
}

void ov_mesh_flat_vector(const ovoid_mesh *mesh, size_t triangle, double vector[3]) {
    double a[3], u[3], v[3], normal[3];
    corners_at(mesh, triangle, a, u, v);
    subtract(u, a, u);
    subtract(v, a, v);
    cross(u, v, normal);
    for (size_t k = 0; k < 3; ++k)
        vector[k] += 0.5 * normal[k];
}

/* Flat areas and volumes. Each component has its own origin, one of its vertices, so that little
 * cancels; where it is closed the origin does not matter. */
static ovoid_status measure_components(ovoid_context *context, ovoid_mesh *mesh) {
    uint32_t *const first =
        ov_alloc(context, mesh->components, sizeof *first, "components of a mesh");
    if (!first)
        return OVOID_ERROR_MEMORY;
    for (size_t v = mesh->vertices; v-- > 0;)
        first[mesh->component_of[v]] = (uint32_t)v;
    for (size_t t = 0; t < mesh->triangles;) { /* neighbours are mostly of one component */
        const uint32_t c = mesh->component_of[mesh->corners[3 * t]];
        ov_content content = {mesh->component[c].area, mesh->component[c].volume};
        double origin[3];
        ov_mesh_at(mesh, first[c], origin);
        for (; t < mesh->triangles && mesh->component_of[mesh->corners[3 * t]] == c; ++t)
            add_flat(mesh, t, origin, &content);
        mesh->component[c].area = content.area;
        mesh->component[c].volume = content.volume;
    }
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].outer = mesh->component[c].volume > 0.0;
    free(first);
    return OVOID_OK;
}

/* ---- making ------------------------------------------------------------------------------- */

ovoid_status ov_mesh_check(ovoid_context *context, const ovoid_mesh *mesh) {
    if (mesh->vertices > UINT32_MAX - 1 || mesh->triangles > UINT32_MAX - 1)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "a mesh holds at most 2^32 - 2 vertices and triangles, not %zu and %zu",
                       mesh->vertices, mesh->triangles);
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
    OV_TRY(find_components(context, mesh));
    OV_TRY(ov_progress_ask(context));
    if (mesh->xyz)
        OV_TRY(check_edges(context, mesh));
    OV_TRY(ov_progress_ask(context));
    OV_TRY(measure_components(context, mesh));
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

/* ---- area and volume ---------------------------------------------------------------------- */

ov_content ov_mesh_flat(const ovoid_mesh *mesh, bool outer_only) {
    ov_content content = {0.0, 0.0};
    for (size_t c = 0; c < mesh->components; ++c) {
        if (outer_only && !mesh->component[c].outer)
            continue;
        content.area += mesh->component[c].area;
        content.volume += mesh->component[c].volume;
    }
    return content;
}

/* A triangle bent to its normals: X(l) = sum_i l_i p_i + 4 sum_ij l_i l_j s_ij m_ij over the
 * barycentric coordinates l, where s_ij is the height of the middle of edge ij over its chord, m_ij
 * the mean normal there. A curve over the chord e with height 4 s t (1 - t) has slopes +-4 s / |e|
 * at its ends; normals are perpendicular to slopes, so that e . (n_j - n_i) = 8 s, in which odd
 * terms of the curve cancel. As s and m belong to the edge, neighbours meet without a gap: heights
 * over each flat triangle along its own normal would leave wedges at the edges, whose area is of
 * the same second order as what bending adds. */
typedef struct bent_triangle {
    double p[3][3]; /* corners */
    double n[3][3]; /* normals there */
    double b[3][3]; /* 4 s m of the edges 01, 12, 20 */
} bent_triangle;

static void bend(const ovoid_mesh *mesh, size_t triangle, const double *origin, bent_triangle *t) {
    corners_at(mesh, triangle, t->p[0], t->p[1], t->p[2]);
    for (size_t i = 0; i < 3; ++i) {
        const size_t v = mesh->corners[3 * triangle + i];
        for (size_t k = 0; k < 3; ++k) {
            t->p[i][k] -= origin[k];
            t->n[i][k] = mesh->normals[3 * v + k];
        }
    }
    for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3;
        double edge[3], turn[3], mean[3];
        subtract(t->p[j], t->p[i], edge);
        subtract(t->n[j], t->n[i], turn);
        for (size_t k = 0; k < 3; ++k)
            mean[k] = t->n[i][k] + t->n[j][k];
        const double length = sqrt(dot(mean, mean));
        const double height = length > 1e-3 ? 0.5 * dot(edge, turn) / length : 0.0;
        for (size_t k = 0; k < 3; ++k)
            t->b[i][k] = height * mean[k];
    }
}

/* Dunavant's rule of degree 4, which the volume's integrand has: barycentric coordinates and
 * weights. */
enum { NODES = 6 };
#define NEAR 0.445948490915965
#define FAR 0.091576213509771
#define NEAR_WEIGHT 0.223381589678011
#define FAR_WEIGHT 0.109951743655322
#define NEAR_APEX (1.0 - 2.0 * NEAR)
#define FAR_APEX (1.0 - 2.0 * FAR)
static const double node[3][NODES] = {{NEAR_APEX, NEAR, NEAR, FAR_APEX, FAR, FAR},
                                      {NEAR, NEAR_APEX, NEAR, FAR, FAR_APEX, FAR},
                                      {NEAR, NEAR, NEAR_APEX, FAR, FAR, FAR_APEX}};
static const double node_weight[NODES] = {NEAR_WEIGHT, NEAR_WEIGHT, NEAR_WEIGHT,
                                          FAR_WEIGHT,  FAR_WEIGHT,  FAR_WEIGHT};

/* The area's integrand is the vector area along the interpolated normal: signed, so that what
 * bending folds over in a needle of a triangle counts for nothing. All nodes go side by side, which
 * compilers turn into vectors. */
static void integrate_bent(const bent_triangle *t, ov_content *content) {
    double x[3][NODES], n[3][NODES], u[3][NODES], v[3][NODES];
    for (size_t k = 0; k < 3; ++k) {
        const double *const p0 = t->p[0], *const p1 = t->p[1], *const p2 = t->p[2];
        const double b0 = t->b[0][k], b1 = t->b[1][k], b2 = t->b[2][k];
        const double u0 = p1[k] - p0[k], v0 = p2[k] - p0[k];
        for (size_t q = 0; q < NODES; ++q) {
            const double l0 = node[0][q], l1 = node[1][q], l2 = node[2][q];
            x[k][q] =
                l0 * p0[k] + l1 * p1[k] + l2 * p2[k] + l0 * l1 * b0 + l1 * l2 * b1 + l2 * l0 * b2;
            n[k][q] = l0 * t->n[0][k] + l1 * t->n[1][k] + l2 * t->n[2][k];
            u[k][q] = u0 + (l0 - l1) * b0 + l2 * (b1 - b2);
            v[k][q] = v0 + (l0 - l2) * b2 + l1 * (b1 - b0);
        }
    }
    double volume[NODES], along[NODES], square[NODES];
    for (size_t q = 0; q < NODES; ++q) {
        const double a0 = u[1][q] * v[2][q] - u[2][q] * v[1][q],
                     a1 = u[2][q] * v[0][q] - u[0][q] * v[2][q],
                     a2 = u[0][q] * v[1][q] - u[1][q] * v[0][q];
        volume[q] = x[0][q] * a0 + x[1][q] * a1 + x[2][q] * a2;
        along[q] = n[0][q] * a0 + n[1][q] * a1 + n[2][q] * a2;
        square[q] = n[0][q] * n[0][q] + n[1][q] * n[1][q] + n[2][q] * n[2][q];
    }
    for (size_t q = 0; q < NODES; ++q) {
        if (square[q] > 1e-6)
            content->area += 0.5 * node_weight[q] * along[q] / sqrt(square[q]);
        content->volume += node_weight[q] / 6.0 * volume[q];
    }
}

void ov_mesh_smooth_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                             ov_content *content) {
    bent_triangle bent;
    bend(mesh, triangle, origin, &bent);
    integrate_bent(&bent, content);
}

/* Bending adds the areas between the edges and their chords: over a chord e the curve encloses with
 * it b x e / 6, where b is four times its height. */
void ov_mesh_smooth_vector(const ovoid_mesh *mesh, size_t triangle, double vector[3]) {
    const double zero[3] = {0.0, 0.0, 0.0};
    bent_triangle bent;
    ov_mesh_flat_vector(mesh, triangle, vector);
    bend(mesh, triangle, zero, &bent);
    for (size_t i = 0; i < 3; ++i) {
        double edge[3], area[3];
        subtract(bent.p[(i + 1) % 3], bent.p[i], edge);
        cross(bent.b[i], edge, area);
        for (size_t k = 0; k < 3; ++k)
            vector[k] += area[k] / 6.0;
    }
}

ovoid_status ov_mesh_content(ovoid_context *context, const ovoid_mesh *mesh, bool smooth,
                             bool outer_only, ov_content *result) {
    ovoid_status status = OVOID_OK;
    ov_content content = {0.0, 0.0};
    double origin[3] = {0.0, 0.0, 0.0};
    if (mesh->vertices > 0)
        ov_mesh_at(mesh, 0, origin);
    for (size_t t = 0; smooth && t < mesh->triangles; ++t) {
        OV_TRY(ov_progress_turn(context, t, mesh->triangles));
        if (outer_only && !ov_mesh_component_of_triangle(mesh, t)->outer)
            continue;
        bent_triangle bent;
        bend(mesh, t, origin, &bent);
        integrate_bent(&bent, &content);
    }
    *result = smooth ? content : ov_mesh_flat(mesh, outer_only);
cleanup:
    return status;
}

ov_content ov_mesh_smooth(const ovoid_mesh *mesh, bool outer_only) {
    ov_content content = {0.0, 0.0};
    (void)ov_mesh_content(NULL, mesh, true, outer_only, &content); /* nobody stops it */
    return content;
}

double ovoid_mesh_area(const ovoid_mesh *mesh) {
    return mesh ? ov_mesh_flat(mesh, false).area : NAN;
}

double ovoid_mesh_volume(const ovoid_mesh *mesh) {
    return mesh ? ov_mesh_flat(mesh, false).volume : NAN;
}

double ovoid_mesh_smooth_area(const ovoid_mesh *mesh) {
    return mesh ? ov_mesh_smooth(mesh, false).area : NAN;
}

double ovoid_mesh_smooth_volume(const ovoid_mesh *mesh) {
    return mesh ? ov_mesh_smooth(mesh, false).volume : NAN;
}
