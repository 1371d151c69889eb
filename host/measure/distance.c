#include "measure/distance.h"

#include "field/field.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Consecutive points of one work-item on CPUs: enough to share what starting it costs, and for most
 * of them to have a neighbour's distance as a bound. */
#define CPU_POINTS 64

#define BOX 6 /* floats: low x, y, z, high x, y, z */

/* ---- boxes -------------------------------------------------------------------------------- */

static void empty_box(float box[BOX]) {
    for (size_t k = 0; k < BOX; ++k)
        box[k] = k < 3 ? FLT_MAX : -FLT_MAX;
}

static void widen_box(float box[BOX], const float *p) {
    for (size_t k = 0; k < 3; ++k) {
        box[k] = fminf(box[k], p[k]);
        box[k + 3] = fmaxf(box[k + 3], p[k]);
    }
}

/* Squared distance between two boxes. */
static double box_distance(const float a[BOX], const float b[BOX]) {
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
        const double gap = fmax((double)a[k] - b[k + 3], (double)b[k] - a[k + 3]);
        square += gap > 0.0 ? gap * gap : 0.0;
    }
    return square;
}

/* ---- triangles on the device -------------------------------------------------------------- */

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float inverse(double square) {
    const double result = square > 0.0 ? 1.0 / square : 0.0;
    return (float)fmin(result, FLT_MAX);
}

/* A vertex as the device has it. */
static void round_vertex(const ovoid_mesh *mesh, size_t vertex, const double origin[3],
                         float p[3]) {
    double at[3];
    ov_mesh_at(mesh, vertex, at);
    for (size_t k = 0; k < 3; ++k)
        p[k] = (float)(at[k] - origin[k]);
}

static void round_triangle(const ov_facets *facets, size_t k, float p[3][3]) {
    const ovoid_mesh *const mesh = facets->trail->mesh;
    const uint32_t *const corner = mesh->corners + 3 * (size_t)ov_trail_triangle(facets->trail, k);
    for (size_t i = 0; i < 3; ++i)
        round_vertex(mesh, corner[i], facets->origin, p[i]);
}

/* Writes a triangle as number j of a leaf. Edges and their duals are those of the corners rounded
 * to floats, so that what a point is held against is what the mesh's own points are. */
static void put_triangle(float p[3][3], float *leaf, size_t j) {
    double u[3], v[3], across[3];
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

static size_t leaves_of(const ov_trail *trail) {
    return (trail->triangles + OV_LEAF - 1) / OV_LEAF;
}

/* The triangle that is number j of a leaf; the last leaf is filled up with the last one. */
static size_t triangle_of(const ov_facets *facets, size_t leaf, size_t j) {
    const size_t at = leaf * OV_LEAF + j, last = facets->trail->triangles - 1;
    return at < last ? at : last;
}

/* The same of a coarse leaf, which has one triangle of each leaf of a group, and so lies in that
 * group's box one level up the tree. */
static size_t coarse_triangle_of(const ov_facets *facets, size_t leaf, size_t j) {
    const size_t fine = leaf * OV_LEAF + j, last = leaves_of(facets->trail) - 1;
    return triangle_of(facets, fine < last ? fine : last, 0);
}
_Static_assert(OV_LEAF == OV_GROUP, "coarse leaves are groups of leaves");

/* Leaves are packed so many at a time, so that the host holds few of them. */
#define PIECE_LEAVES ((size_t)2048)

/* The leaves from first to end onto the device; the box about them, where it is not NULL. */
static ovoid_status load_leaves(ovoid_context *context, ov_facets *facets, bool coarse,
                                size_t first, size_t end, float box[BOX]) {
    ovoid_status status = OVOID_OK;
    const size_t leaf_floats = OV_TRIANGLE * OV_LEAF, bytes = leaf_floats * sizeof(float);
    const size_t piece = end - first < PIECE_LEAVES ? end - first : PIECE_LEAVES;
    float *const packed = ov_alloc(context, piece * leaf_floats, sizeof *packed, "triangles");
    if (!packed)
        return OVOID_ERROR_MEMORY;
    if (box)
        empty_box(box);
    OV_TRY(
        ov_buffer_reserve(context, &facets->leaves, (end - first) * bytes, "triangles of a mesh"));
    for (size_t from = first, count; from < end; from += count) {
        count = end - from < piece ? end - from : piece;
        for (size_t k = 0; k < count * OV_LEAF; ++k) {
            const size_t leaf = from + k / OV_LEAF, j = k % OV_LEAF;
            float p[3][3];
            round_triangle(
                facets, coarse ? coarse_triangle_of(facets, leaf, j) : triangle_of(facets, leaf, j),
                p);
            put_triangle(p, packed + k / OV_LEAF * leaf_floats, j);
            for (size_t i = 0; box && i < 3; ++i)
                widen_box(box, p[i]);
        }
        OV_TRY(ov_buffer_write(context, &facets->leaves, (from - first) * bytes, packed,
                               count * bytes));
    }
cleanup:
    free(packed);
    return status;
}

/* ---- facets ------------------------------------------------------------------------------- */

static void box_leaf(const ov_facets *facets, size_t leaf, float box[BOX]) {
    empty_box(box);
    for (size_t j = 0; j < OV_LEAF; ++j) {
        float p[3][3];
        round_triangle(facets, triangle_of(facets, leaf, j), p);
        for (size_t i = 0; i < 3; ++i)
            widen_box(box, p[i]);
    }
}

ovoid_status ov_facets_create(ovoid_context *context, const ov_trail *trail, const double origin[3],
                              ov_facets *facets) {
    ovoid_status status = OVOID_OK;
    ov_facets made = {.trail = trail, .chunk = OV_FACETS_CHUNK, .batch = OV_FACETS_BATCH};
    const size_t leaves = leaves_of(trail);
    size_t floats = 0;
    float *tree = NULL;
    float *const boxes = ov_alloc(context, leaves * BOX, sizeof *boxes, "boxes of triangles");
    if (!boxes)
        return OVOID_ERROR_MEMORY;
    memcpy(made.origin, origin, sizeof made.origin);
    for (size_t leaf = 0; leaf < leaves; ++leaf) {
        OV_TRY(ov_progress_turn(context, leaf, leaves));
        box_leaf(&made, leaf, boxes + leaf * BOX);
    }
    OV_TRY(ov_tree_build(context, boxes, leaves, &made.tree, &tree, &floats));
    OV_TRY(ov_buffer_put(context, &made.boxes, tree, floats * sizeof *tree, "boxes of triangles"));
    *facets = made;
cleanup:
    if (status != OVOID_OK)
        ov_facets_destroy(&made);
    free(tree);
    free(boxes);
    return status;
}

void ov_facets_destroy(ov_facets *facets) {
    ov_buffer_destroy(&facets->boxes);
    ov_buffer_destroy(&facets->leaves);
    memset(facets, 0, sizeof *facets);
}

/* ---- distances of points ------------------------------------------------------------------ */

/* One run over the sites. */
typedef struct measuring {
    ov_facets *facets;
    const ov_sites *sites;
    ov_kernel distances;
    ov_buffer xyz, result;
    float *points; /* of a batch of a trail's */
    size_t group;
    cl_uint each;      /* points of a work-item */
    bool use_bound;    /* the distances are bounds already */
    ov_tree tree;      /* over the leaves */
    size_t first, end; /* leaves on the device */
    float box[BOX];    /* about these, with use_bound */
} measuring;

/* The sites from `first` on; *xyz is theirs until the next call. */
static void find_sites(const measuring *m, size_t first, size_t count, const float **xyz) {
    const ov_trail *const trail = m->sites->trail;
    *xyz = m->points;
    if (m->sites->xyz)
        *xyz = m->sites->xyz + 3 * first;
    else
        for (size_t k = first; k < first + count; ++k) {
            float *const p = m->points + 3 * (k - first);
            if (k < trail->vertices) {
                round_vertex(trail->mesh, ov_trail_vertex(trail, k), m->facets->origin, p);
                continue;
            }
            double centre[3];
            ov_mesh_centre(trail->mesh, ov_trail_triangle(trail, k - trail->vertices), centre);
            for (size_t axis = 0; axis < 3; ++axis)
                p[axis] = (float)(centre[axis] - m->facets->origin[axis]);
        }
}

/* Whether none of these points can be nearer to the chunk on the device than squared says. */
static bool out_of_reach(const measuring *m, const float *xyz, size_t count, const float *squared) {
    float box[BOX];
    double most = 0.0;
    empty_box(box);
    for (size_t k = 0; k < count; ++k) {
        widen_box(box, xyz + 3 * k);
        most = fmax(most, squared[k]);
    }
    return box_distance(box, m->box) > most;
}

/* From `count` sites to the chunk on the device. */
static ovoid_status measure_batch(ovoid_context *context, measuring *m, const float *xyz,
                                  size_t count, float *squared) {
    ovoid_status status = OVOID_OK;
    const ov_facets *const facets = m->facets;
    const cl_uint total = (cl_uint)count, each = m->each, first_leaf = (cl_uint)m->first,
                  end_leaf = (cl_uint)m->end, use_bound = m->use_bound;
    const cl_float enough = (cl_float)(facets->enough * facets->enough);
    const cl_float4 low = {{m->box[0], m->box[1], m->box[2], 0.0f}},
                    high = {{m->box[3], m->box[4], m->box[5], 0.0f}};
    OV_TRY(ov_buffer_write(context, &m->xyz, 0, xyz, 3 * count * sizeof *xyz));
    if (m->use_bound)
        OV_TRY(ov_buffer_write(context, &m->result, 0, squared, count * sizeof *squared));
    OV_TRY(OV_LAUNCH(context, &m->distances, (count + each - 1) / each, m->group, OV_ARG(total),
                     OV_ARG(each), OV_ARG(m->xyz.memory), OV_ARG(m->tree),
                     OV_ARG(facets->boxes.memory), OV_ARG(first_leaf), OV_ARG(end_leaf),
                     OV_ARG(low), OV_ARG(high), OV_ARG(facets->leaves.memory), OV_ARG(use_bound),
                     OV_ARG(enough), OV_ARG(m->result.memory)));
    OV_TRY(ov_buffer_read(context, &m->result, 0, squared, count * sizeof *squared));
cleanup:
    return status;
}

/* From all sites to the leaves from m->first to m->end. */
static ovoid_status measure_leaves(ovoid_context *context, measuring *m, bool coarse,
                                   float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t count = m->sites->count, batch = m->facets->batch;
    OV_TRY(load_leaves(context, m->facets, coarse, m->first, m->end, m->use_bound ? m->box : NULL));
    for (size_t k = 0, size; k < count; k += size) {
        const float *xyz;
        if (m->facets->watch)
            OV_TRY(ov_watch_ask(context, m->facets->watch));
        else
            OV_TRY(ov_progress_step(context, k, count));
        size = count - k < batch ? count - k : batch;
        find_sites(m, k, size, &xyz);
        if (!m->use_bound || !out_of_reach(m, xyz, size, squared + k))
            OV_TRY(measure_batch(context, m, xyz, size, squared + k));
    }
cleanup:
    return status;
}

/* The tree without its lowest level. */
static ov_tree coarse_tree(const ov_tree *tree) {
    ov_tree coarse = {.levels = tree->levels - 1};
    for (size_t l = 0; l < coarse.levels; ++l) {
        coarse.boxes[l] = tree->boxes[l + 1];
        coarse.groups[l] = tree->groups[l + 1];
    }
    return coarse;
}

/* With more than one chunk each of them starts from what the others have found, the first one from
 * the distances to one triangle of each leaf: bounds that leave out most of what is not near. */
static ovoid_status measure_sites(ovoid_context *context, measuring *m, float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t leaves = leaves_of(m->facets->trail), chunk = m->facets->chunk;
    if (leaves > chunk) {
        m->tree = coarse_tree(&m->facets->tree);
        m->end = (leaves + OV_GROUP - 1) / OV_GROUP;
        OV_TRY(measure_leaves(context, m, true, squared));
        m->use_bound = true;
    }
    m->tree = m->facets->tree;
    for (m->first = 0; m->first < leaves; m->first = m->end) {
        m->end = leaves - m->first < chunk ? leaves : m->first + chunk;
        OV_TRY(measure_leaves(context, m, false, squared));
    }
cleanup:
    return status;
}

static ovoid_status check_distances(ovoid_context *context, const float *squared, size_t count) {
    for (size_t k = 0; k < count; ++k)
        if (!isfinite(squared[k]))
            return ov_fail(context, OVOID_ERROR_NUMERIC,
                           "the distance of a point from a surface is more than a float holds");
    return OVOID_OK;
}

ovoid_status ov_facets_distances(ovoid_context *context, ov_facets *facets, const ov_sites *sites,
                                 float *squared) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    measuring m = {.facets = facets, .sites = sites};
    const size_t batch = sites->count < facets->batch ? sites->count : facets->batch;
    if (sites->count == 0)
        return OVOID_OK;
    if (facets->trail->triangles == 0)
        return ov_fail(context, OVOID_ERROR_NUMERIC, "there is no surface to be distant from");
    OV_TRY(ov_device_get(context, &device));
    m.group = ov_item_group(device);
    m.each = device->shape.lanes == 1 ? CPU_POINTS : 1;
    m.points = ov_alloc(context, 3 * batch, sizeof *m.points, "points of a mesh");
    if (!m.points) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_buffer_reserve(context, &m.xyz, 3 * batch * sizeof(cl_float), "points of a mesh"));
    OV_TRY(ov_buffer_reserve(context, &m.result, batch * sizeof(cl_float), "distances"));
    OV_TRY(ov_kernel_create(context, "distance", "distances", &m.distances));
    OV_TRY(measure_sites(context, &m, squared));
    OV_TRY(check_distances(context, squared, sites->count));
cleanup:
    ov_buffer_destroy(&m.xyz);
    ov_buffer_destroy(&m.result);
    ov_buffer_destroy(&facets->leaves);
    ov_kernel_destroy(&m.distances);
    free(m.points);
    return status;
}

/* ---- of vertices -------------------------------------------------------------------------- */

/* squared: of the trail's vertices, which become distances, each at its vertex's place. */
static void put_distances(const ov_trail *trail, const float *squared, float *distance) {
    for (size_t k = 0; k < trail->vertices; ++k)
        distance[ov_trail_vertex(trail, k)] = (float)sqrt((double)squared[k]);
}

ovoid_status ov_vertex_distances(ovoid_context *context, const ovoid_mesh *from,
                                 const ovoid_mesh *to, const double origin[3], double enough,
                                 const ov_watch *watch, float *distance) {
    ovoid_status status = OVOID_OK;
    ov_trail points = {0}, triangles = {0};
    ov_facets facets = {0};
    float *squared = NULL;
    OV_TRY(ov_trail_create(context, from, false, &points));
    OV_TRY(ov_trail_create(context, to, false, &triangles));
    OV_TRY(ov_facets_create(context, &triangles, origin, &facets));
    const ov_sites sites = {.count = points.vertices, .trail = &points};
    facets.watch = watch;
    facets.enough = enough;
    if (points.vertex) {
        squared = ov_alloc(context, sites.count, sizeof *squared, "distances");
        if (!squared) {
            status = OVOID_ERROR_MEMORY;
            goto cleanup;
        }
        memset(distance, 0, from->vertices * sizeof *distance);
    }
    float *const found = squared ? squared : distance;
    OV_TRY(ov_facets_distances(context, &facets, &sites, found));
    put_distances(&points, found, distance);
cleanup:
    free(squared);
    ov_facets_destroy(&facets);
    ov_trail_destroy(&points);
    ov_trail_destroy(&triangles);
    return status;
}

/* ---- both ways ---------------------------------------------------------------------------- */

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
                                     float *of_vertices) {
    ovoid_status status = OVOID_OK;
    ov_facets facets = {0};
    float *at_vertices = NULL;
    const ov_sites sites = {.count = from->vertices + from->triangles, .trail = from};
    float *const squared = ov_alloc(context, sites.count, sizeof *squared, "distances");
    if (!squared)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ov_facets_create(context, to, origin, &facets));
    OV_TRY(ov_facets_distances(context, &facets, &sites, squared));
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
    if (of_vertices)
        put_distances(from, squared, of_vertices);
cleanup:
    ov_facets_destroy(&facets);
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
                               float *from_b) {
    ovoid_status status = OVOID_OK;
    directed forward, backward;
    double origin[3];
    ov_trail first = {0}, second = {0};
    middle_of(a, b, origin);
    OV_TRY(ov_trail_create(context, a, outer_only, &first));
    OV_TRY(ov_trail_create(context, b, outer_only, &second));
    OV_TRY(check_trail(context, &first, "first", outer_only));
    OV_TRY(check_trail(context, &second, "second", outer_only));
    OV_TRY(measure_directed(context, &first, &second, origin, &forward, from_a));
    OV_TRY(measure_directed(context, &second, &first, origin, &backward, from_b));
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
        ov_mesh_distances(context, a, b, outer_only, distances, of_vertices, NULL);
    ov_progress_end(context);
    if (from_a && status == OVOID_OK)
        memcpy(from_a, of_vertices, a->vertices * sizeof *from_a);
    free(of_vertices);
    return status;
}
