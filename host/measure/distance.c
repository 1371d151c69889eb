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

/* Comparisons rather than fminf(), which is a call. */
static void widen_box(float box[BOX], const float low[3], const float high[3]) {
    for (size_t k = 0; k < 3; ++k) {
        box[k] = low[k] < box[k] ? low[k] : box[k];
        box[k + 3] = high[k] > box[k + 3] ? high[k] : box[k + 3];
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

/* ---- distances of points ------------------------------------------------------------------ */

/* One run over the sites. */
typedef struct measuring {
    ov_meter *meter;
    ov_facets *facets;
    const ov_sites *sites;
    size_t group, batch;
    cl_uint each;           /* points of a work-item */
    const ov_buffer *there; /* all sites on the device, in batches that are not waited for; NULL */
    bool use_bound;         /* the distances are bounds already */
    ov_tree tree;           /* over the leaves */
    float box[BOX];         /* about the chunk on the device, with use_bound */
} measuring;

/* A trail's sites from `first` on. */
static void round_sites(const measuring *m, size_t first, size_t count, float *xyz) {
    const ov_trail *const trail = m->sites->trail;
    size_t vertices = first < trail->vertices ? trail->vertices - first : 0;
    vertices = vertices < count ? vertices : count;
    ov_facets_round(m->facets, trail->mesh, trail->vertex, first, vertices, xyz);
    for (size_t k = first + vertices; k < first + count; ++k) {
        double centre[3];
        ov_mesh_centre(trail->mesh, ov_trail_triangle(trail, k - trail->vertices), centre);
        for (size_t axis = 0; axis < 3; ++axis)
            xyz[3 * (k - first) + axis] = (float)(centre[axis] - m->facets->origin[axis]);
    }
}

/* The sites from `first` on; *xyz is theirs until the next call. */
static void find_sites(const measuring *m, size_t first, size_t count, const float **xyz) {
    const ov_trail *const trail = m->sites->trail;
    if (m->sites->xyz)
        *xyz = m->sites->xyz + 3 * first;
    else if (!trail->vertex && first + count <= trail->vertices &&
             ov_mesh_is_about(trail->mesh, m->facets->origin))
        *xyz = trail->mesh->offsets + 3 * first;
    else {
        round_sites(m, first, count, m->meter->points);
        *xyz = m->meter->points;
    }
}

/* Whether none of these points can be nearer to the chunk on the device than squared says. */
static bool out_of_reach(const measuring *m, const float *xyz, size_t count, const float *squared) {
    float box[BOX], most = 0.0f;
    empty_box(box);
    for (size_t k = 0; k < count; ++k) {
        widen_box(box, xyz + 3 * k, xyz + 3 * k);
        most = squared[k] > most ? squared[k] : most;
    }
    return box_distance(box, m->box) > most;
}

/* From `count` sites to the chunk on the device: from number `from` of m->there on, or else those
 * given. The squared distances are left on the device, from number `to` on. */
static ovoid_status launch_batch(ovoid_context *context, measuring *m, const float *xyz,
                                 size_t first, size_t count, size_t result) {
    ovoid_status status = OVOID_OK;
    ov_meter *const meter = m->meter;
    const ov_facets *const facets = m->facets;
    const cl_uint total = (cl_uint)count, each = m->each, first_leaf = (cl_uint)facets->first,
                  end_leaf = (cl_uint)facets->end, use_bound = m->use_bound,
                  from = m->there ? (cl_uint)first : 0, to = (cl_uint)result;
    const cl_float enough = (cl_float)(meter->enough * meter->enough);
    const cl_float4 low = {{m->box[0], m->box[1], m->box[2], 0.0f}},
                    high = {{m->box[3], m->box[4], m->box[5], 0.0f}};
    const cl_mem points = m->there ? m->there->memory : meter->xyz.memory;
    if (!m->there)
        OV_TRY(ov_buffer_write(context, &meter->xyz, 0, xyz, 3 * count * sizeof *xyz));
    OV_TRY(OV_LAUNCH(context, &meter->distances, (count + each - 1) / each, m->group, OV_ARG(total),
                     OV_ARG(each), OV_ARG(from), OV_ARG(points), OV_ARG(m->tree),
                     OV_ARG(facets->boxes.memory), OV_ARG(first_leaf), OV_ARG(end_leaf),
                     OV_ARG(low), OV_ARG(high), OV_ARG(facets->packed.memory), OV_ARG(use_bound),
                     OV_ARG(enough), OV_ARG(to), OV_ARG(meter->result.memory)));
cleanup:
    return status;
}

static ovoid_status measure_batch(ovoid_context *context, measuring *m, const float *xyz,
                                  size_t count, float *squared) {
    ovoid_status status = OVOID_OK;
    ov_meter *const meter = m->meter;
    if (m->use_bound)
        OV_TRY(ov_buffer_write(context, &meter->result, 0, squared, count * sizeof *squared));
    OV_TRY(launch_batch(context, m, xyz, 0, count, 0));
    OV_TRY(ov_buffer_read(context, &meter->result, 0, squared, count * sizeof *squared));
cleanup:
    return status;
}

/* From all sites to the leaves from first to end. */
static ovoid_status measure_leaves(ovoid_context *context, measuring *m, bool coarse, size_t first,
                                   size_t end, float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t count = m->sites->count;
    OV_TRY(ov_facets_load(context, m->facets, coarse, first, end));
    empty_box(m->box);
    for (size_t leaf = first; m->use_bound && leaf < end; ++leaf)
        widen_box(m->box, m->facets->box + leaf * BOX, m->facets->box + leaf * BOX + 3);
    for (size_t k = 0, size; k < count; k += size) {
        const float *xyz;
        if (m->meter->watch)
            OV_TRY(ov_watch_ask(context, m->meter->watch));
        else
            OV_TRY(ov_progress_step(context, k, count));
        size = count - k < m->batch ? count - k : m->batch;
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
    const size_t leaves = m->facets->leaves, chunk = m->facets->chunk;
    if (leaves > chunk || m->use_bound)
        OV_TRY(ov_facets_boxes(context, m->facets));
    if (leaves > chunk && !m->use_bound) {
        m->tree = coarse_tree(&m->facets->tree);
        OV_TRY(measure_leaves(context, m, true, 0, (leaves + OV_GROUP - 1) / OV_GROUP, squared));
        m->use_bound = true;
    }
    m->tree = m->facets->tree;
    for (size_t first = 0, end; first < leaves; first = end) {
        end = leaves - first < chunk ? leaves : first + chunk;
        OV_TRY(measure_leaves(context, m, false, first, end, squared));
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

static ovoid_status prepare(ovoid_context *context, measuring *m) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    ov_meter *const meter = m->meter;
    const size_t most = meter->batch ? meter->batch : OV_METER_BATCH, count = m->sites->count;
    OV_TRY(ov_device_get(context, &device));
    m->group = ov_item_group(device);
    m->each = device->shape.lanes == 1 ? CPU_POINTS : 1;
    m->batch = count < most ? count : most;
    OV_TRY(ov_grow(context, &meter->points, &meter->points_capacity, 3 * m->batch,
                   sizeof *meter->points, "points of a mesh"));
    OV_TRY(ov_buffer_reserve(context, &meter->xyz, 3 * m->batch * sizeof(cl_float),
                             "points of a mesh"));
    OV_TRY(ov_buffer_reserve(context, &meter->result, m->batch * sizeof(cl_float), "distances"));
    if (!meter->distances.handle)
        OV_TRY(ov_kernel_create(context, "distance", "distances", &meter->distances));
cleanup:
    return status;
}

ovoid_status ov_facets_distances(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                 const ov_sites *sites, float *squared) {
    ovoid_status status = OVOID_OK;
    measuring m = {.meter = meter, .facets = facets, .sites = sites};
    if (sites->count == 0)
        return OVOID_OK;
    if (facets->trail.triangles == 0)
        return ov_fail(context, OVOID_ERROR_NUMERIC, "there is no surface to be distant from");
    OV_TRY(prepare(context, &m));
    OV_TRY(measure_sites(context, &m, squared));
    OV_TRY(check_distances(context, squared, sites->count));
cleanup:
    return status;
}

ovoid_status ov_facets_nearer(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                              const ov_sites *sites, float *squared) {
    ovoid_status status = OVOID_OK;
    measuring m = {.meter = meter, .facets = facets, .sites = sites, .use_bound = true};
    if (sites->count == 0 || facets->trail.triangles == 0)
        return OVOID_OK;
    OV_TRY(prepare(context, &m));
    OV_TRY(measure_sites(context, &m, squared));
cleanup:
    return status;
}

void ov_meter_destroy(ov_meter *meter) {
    ov_buffer_destroy(&meter->xyz);
    ov_buffer_destroy(&meter->result);
    ov_kernel_destroy(&meter->distances);
    free(meter->points);
    memset(meter, 0, sizeof *meter);
}

/* ---- of vertices -------------------------------------------------------------------------- */

/* squared: of the trail's vertices, which become distances, each at its vertex's place. */
static void put_distances(const ov_trail *trail, const float *squared, float *distance) {
    for (size_t k = 0; k < trail->vertices; ++k)
        distance[ov_trail_vertex(trail, k)] = (float)sqrt((double)squared[k]);
}

ovoid_status ov_trail_distances(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                const ov_trail *from, float *distance) {
    ovoid_status status = OVOID_OK;
    const ov_sites sites = {.count = from->vertices, .trail = from};
    float *squared = NULL;
    if (from->vertex) {
        squared = ov_alloc(context, sites.count, sizeof *squared, "distances");
        if (!squared)
            return OVOID_ERROR_MEMORY;
        memset(distance, 0, from->mesh->vertices * sizeof *distance);
    }
    float *const found = squared ? squared : distance;
    OV_TRY(ov_facets_distances(context, meter, facets, &sites, found));
    put_distances(from, found, distance);
cleanup:
    free(squared);
    return status;
}

/* ---- without waiting ---------------------------------------------------------------------- */

/* From all sites, which are on the device, to the facets, which are one chunk. */
static ovoid_status launch_all(ovoid_context *context, measuring *m) {
    ovoid_status status = OVOID_OK;
    ov_meter *const meter = m->meter;
    const size_t count = m->sites->count;
    OV_TRY(ov_facets_load(context, m->facets, false, 0, m->facets->leaves));
    OV_TRY(ov_buffer_reserve(context, &meter->result, count * sizeof(cl_float), "distances"));
    m->tree = m->facets->tree;
    for (size_t k = 0, size; k < count; k += size) {
        if (meter->watch)
            OV_TRY(ov_watch_ask(context, meter->watch));
        size = count - k < m->batch ? count - k : m->batch;
        OV_TRY(launch_batch(context, m, NULL, k, size, k));
    }
cleanup:
    return status;
}

ovoid_status ov_vertex_distances_begin(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                                       const ov_facets *from, float *distance) {
    ovoid_status status = OVOID_OK;
    const ov_sites sites = {.count = from->trail.vertices, .trail = &from->trail};
    measuring m = {.meter = meter, .facets = facets, .sites = &sites, .there = ov_facets_xyz(from)};
    meter->later = (ov_later){0};
    if (from->trail.vertex || facets->leaves > facets->chunk || facets->leaves == 0)
        return ov_trail_distances(context, meter, facets, &from->trail, distance);
    OV_TRY(prepare(context, &m));
    OV_TRY(launch_all(context, &m));
    OV_TRY(ov_buffer_read_later(context, &meter->result, 0, distance,
                                sites.count * sizeof *distance, &meter->later));
cleanup:
    return status;
}

ovoid_status ov_vertex_distances_end(ovoid_context *context, ov_meter *meter, const ov_facets *from,
                                     float *distance) {
    ovoid_status status = OVOID_OK;
    if (!meter->later.event)
        return OVOID_OK;
    OV_TRY(ov_later_end(context, &meter->later));
    OV_TRY(check_distances(context, distance, from->trail.vertices));
    put_distances(&from->trail, distance, distance);
cleanup:
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
    if (of_vertices)
        put_distances(from, squared, of_vertices);
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
