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

/* The box in which distances are asked for, as offsets, and wherever rounding leaves them. */
static void asked_of(const measuring *m, cl_float4 *low, cl_float4 *high) {
    const ov_box *const within = m->meter->within;
    *low = *high = (cl_float4){{0.0f, 0.0f, 0.0f, 0.0f}};
    for (size_t k = 0; k < 3; ++k) {
        const double from = within ? within->low[k] - m->facets->origin[k] : -INFINITY,
                     to = within ? within->high[k] - m->facets->origin[k] : INFINITY;
        low->s[k] = nextafterf((float)from, -INFINITY);
        high->s[k] = nextafterf((float)to, INFINITY);
    }
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
    cl_float4 asked_low, asked_high;
    asked_of(m, &asked_low, &asked_high);
    const cl_mem points = m->there ? m->there->memory : meter->xyz.memory;
    if (!m->there)
        OV_TRY(ov_buffer_write(context, &meter->xyz, 0, xyz, 3 * count * sizeof *xyz));
    OV_TRY(OV_LAUNCH(context, &meter->distances, (count + each - 1) / each, m->group, OV_ARG(total),
                     OV_ARG(each), OV_ARG(from), OV_ARG(points), OV_ARG(m->tree),
                     OV_ARG(facets->boxes.memory), OV_ARG(first_leaf), OV_ARG(end_leaf),
                     OV_ARG(low), OV_ARG(high), OV_ARG(asked_low), OV_ARG(asked_high),
                     OV_ARG(facets->packed.memory), OV_ARG(use_bound), OV_ARG(enough), OV_ARG(to),
                     OV_ARG(meter->result.memory)));
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

/* ---- of triangles ------------------------------------------------------------------------- */

/* From `count` triangles to the chunk on the device. */
static ovoid_status reach_batch(ovoid_context *context, ov_meter *meter, const ov_facets *facets,
                                const float *xyz, size_t count, float *squared) {
    ovoid_status status = OVOID_OK;
    ov_device *device;
    const cl_uint total = (cl_uint)count, first = (cl_uint)facets->first,
                  end = (cl_uint)facets->end;
    OV_TRY(ov_device_get(context, &device));
    if (!meter->reach.handle)
        OV_TRY(ov_kernel_create(context, "distance", "triangle_distances", &meter->reach));
    OV_TRY(ov_buffer_put(context, &meter->xyz, xyz, 9 * count * sizeof *xyz,
                         "triangles of a surface"));
    OV_TRY(ov_buffer_put(context, &meter->result, squared, count * sizeof *squared, "distances"));
    OV_TRY(OV_LAUNCH(context, &meter->reach, count, ov_item_group(device), OV_ARG(total),
                     OV_ARG(meter->xyz.memory), OV_ARG(facets->tree), OV_ARG(facets->boxes.memory),
                     OV_ARG(first), OV_ARG(end), OV_ARG(facets->packed.memory),
                     OV_ARG(meter->result.memory)));
    OV_TRY(ov_buffer_read(context, &meter->result, 0, squared, count * sizeof *squared));
cleanup:
    return status;
}

ovoid_status ov_facets_reach(ovoid_context *context, ov_meter *meter, ov_facets *facets,
                             const float *xyz, size_t count, float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t leaves = facets->leaves, chunk = facets->chunk,
                 batch = (meter->batch ? meter->batch : OV_METER_BATCH) / 3 + 1;
    for (size_t first = 0, end; first < leaves && count > 0; first = end) {
        end = leaves - first < chunk ? leaves : first + chunk;
        OV_TRY(ov_facets_load(context, facets, false, first, end));
        for (size_t k = 0, size; k < count; k += size) {
            size = count - k < batch ? count - k : batch;
            OV_TRY(reach_batch(context, meter, facets, xyz + 9 * k, size, squared + k));
        }
    }
cleanup:
    return status;
}

void ov_meter_destroy(ov_meter *meter) {
    ov_buffer_destroy(&meter->xyz);
    ov_buffer_destroy(&meter->result);
    ov_kernel_destroy(&meter->distances);
    ov_kernel_destroy(&meter->reach);
    free(meter->points);
    memset(meter, 0, sizeof *meter);
}

/* ---- of vertices -------------------------------------------------------------------------- */

void ov_trail_put_distances(const ov_trail *trail, const float *squared, float *distance) {
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
    ov_trail_put_distances(from, found, distance);
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
    ov_trail_put_distances(&from->trail, distance, distance);
cleanup:
    return status;
}
