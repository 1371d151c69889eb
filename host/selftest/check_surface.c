/* Meshes, distances to them, and pictures. */
#include "selftest/check.h"

#include "measure/distance.h"
#include "mesh/march.h"
#include "picture/image.h"
#include "picture/palette.h"
#include "picture/rays.h"
#include "picture/render.h"
#include "selftest/twin_distance.h"
#include "selftest/twin_march.h"
#include "selftest/twin_render.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- meshes ------------------------------------------------------------------------------- */

#define ISOVALUE 1.0
#define SPACING 0.4
#define DECAY 6.0

/* Small sharp atoms in a cube of `box` lattice points: every case of the table comes up. */
typedef struct noise {
    size_t count, box;
    ov_body *bodies;
    ov_quadric *quadrics;
} noise;

static void destroy_noise(noise *n) {
    free(n->bodies);
    free(n->quadrics);
}

static ovoid_status make_noise(ov_checking *c, noise *n) {
    ov_random random = {15};
    const double half = c->whole ? 4.0 : 1.4;
    n->count = ov_check_size(c, 500, 20);
    n->box = ov_check_size(c, 31, 15);
    n->bodies = ov_alloc(c->context, n->count, sizeof *n->bodies, "atoms of a check");
    n->quadrics = ov_alloc(c->context, n->count, sizeof *n->quadrics, "atoms of a check");
    if (!n->bodies || !n->quadrics)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < n->count; ++i) {
        double xyzr[4];
        for (size_t k = 0; k < 3; ++k)
            xyzr[k] = ov_random_uniform(&random, -half, half);
        xyzr[3] = ov_random_uniform(&random, 0.2, 0.5);
        ov_body_of_atom(xyzr, DECAY, &n->bodies[i]);
        n->quadrics[i] = n->bodies[i].quadric;
    }
    return OVOID_OK;
}

/* About an origin: a light mesh, whose vertices the device places. NULL: a full one. */
static ovoid_status march(ov_checking *c, const noise *n, ovoid_vertex_rule rule,
                          const double *origin, ovoid_mesh **mesh) {
    static const uint64_t limit[3] = {8, 8, 8}; /* several pieces, with seams */
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.isovalue = ISOVALUE;
    options.spacing = SPACING;
    options.vertices = rule;
    if (origin)
        return ov_march_light(c->context, n->bodies, n->count, &options, limit, origin, NULL, mesh);
    return ov_march(c->context, n->bodies, n->count, &options, limit, mesh);
}

/* Number of vertex v in the twin, or OV_TWIN_NO_VERTEX. */
static uint32_t name_of(const ovoid_mesh *mesh, size_t v, const ov_twin_mesh *twin) {
    const unsigned axis = mesh->edge[v] & OV_EDGE_AXES;
    size_t point = 0;
    for (size_t k = 3; k-- > 0;) {
        const double at = mesh->xyz[3 * v + k] / SPACING;
        const double low = (k == axis ? floor(at) : round(at)) - (double)twin->low[k];
        if (!(low >= 0.0 && low < (double)twin->size[k]))
            return OV_TWIN_NO_VERTEX;
        point = point * twin->size[k] + (size_t)low;
    }
    return twin->vertex[3 * point + axis];
}

/* Triangles as a sum that does not go with their order, nor with the corner that they begin with:
 * each of the directed edges by its two ends. */
static uint64_t sum_of_edges(const uint32_t *corner, size_t triangles, const uint32_t *name) {
    uint64_t sum = 0;
    for (size_t k = 0; k < 3 * triangles; ++k) {
        const size_t next = k % 3 == 2 ? k - 2 : k + 1;
        const uint64_t a = name ? name[corner[k]] : corner[k];
        const uint64_t b = name ? name[corner[next]] : corner[next];
        ov_random edge = {a << 32 | b};
        sum += ov_random_bits(&edge);
    }
    return sum;
}

static ovoid_status compare_mesh(ov_checking *c, const ovoid_mesh *mesh, const ov_twin_mesh *twin) {
    if (!ov_expect(c, mesh->vertices == twin->vertices && mesh->triangles == twin->triangles,
                   "march: %zu vertices and %zu triangles, not %zu and %zu", mesh->vertices,
                   mesh->triangles, twin->vertices, twin->triangles))
        return OVOID_OK;
    uint32_t *const name = ov_alloc(c->context, mesh->vertices, sizeof *name, "names of vertices");
    if (!name)
        return OVOID_ERROR_MEMORY;
    bool known = true;
    for (size_t v = 0; known && v < mesh->vertices; ++v) {
        const size_t axis = mesh->edge[v] & OV_EDGE_AXES;
        name[v] = name_of(mesh, v, twin);
        known = ov_expect(c, name[v] != OV_TWIN_NO_VERTEX,
                          "march: vertex %zu is on an edge that is not crossed", v);
        if (known)
            ov_expect_near(c, mesh->xyz[3 * v + axis], twin->xyz[3 * (size_t)name[v] + axis],
                           1e-5 * (1.0 + twin->softness[name[v]]), "march_vertices: vertex", v);
    }
    if (known)
        ov_expect(c,
                  sum_of_edges(mesh->corners, mesh->triangles, name) ==
                      sum_of_edges(twin->corner, twin->triangles, NULL),
                  "march_triangles: the triangles are not those that they should be");
    free(name);
    return OVOID_OK;
}

/* Vertices on the surface, normals against the gradient. */
static void expect_surface(ov_checking *c, const ovoid_mesh *mesh, const noise *n) {
    for (size_t v = 0; v < mesh->vertices; ++v) {
        const double *const y = mesh->xyz + 3 * v;
        ov_twin_sum gradient[3];
        const ov_twin_sum phi = ov_twin_field(n->quadrics, n->count, y);
        ov_twin_gradient(n->quadrics, n->count, y, gradient);
        double square = 0.0, cosine = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            square += gradient[k].value * gradient[k].value;
            cosine -= mesh->normals[3 * v + k] * gradient[k].value;
        }
        const double length = sqrt(square);
        ov_expect_near(c, phi.value, ISOVALUE,
                       1e-5 * length + 4.0 * FLT_EPSILON * phi.scale + 2e-6 * ISOVALUE,
                       "march_refine: phi at vertex", v);
        if (length > 0.1 * ISOVALUE)
            ov_expect_near(c, cosine / length, 1.0, 1e-5, "march_refine: normal", v);
    }
}

/* The light mesh is the full one, rounded. */
static void expect_light_mesh(ov_checking *c, const ovoid_mesh *full, const ovoid_mesh *light) {
    if (!ov_expect(c, light->vertices == full->vertices && light->triangles == full->triangles,
                   "march: a light mesh of %zu vertices and %zu triangles, not %zu and %zu",
                   light->vertices, light->triangles, full->vertices, full->triangles))
        return;
    for (size_t k = 0; k < 3 * full->vertices; ++k) {
        ov_expect_near(c, light->offsets[k], full->xyz[k] - light->origin[k % 3], 1e-5,
                       "march_place: coordinate", k);
        ov_expect_near(c, light->normals[k], full->normals[k], 1e-5, "march_place: normal", k);
    }
    for (size_t k = 0; k < 3 * full->triangles; ++k)
        ov_expect(c, light->corners[k] == full->corners[k],
                  "march_triangles: corner %zu of the light mesh is %u, not %u", k,
                  (unsigned)light->corners[k], (unsigned)full->corners[k]);
}

ovoid_status ov_check_mesh(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    noise n = {0};
    ov_twin_mesh twin = {0};
    const double origin[3] = {0.3, -40.0, 7.0};
    ovoid_mesh *linear = NULL, *exact = NULL, *light = NULL;
    OV_TRY(make_noise(c, &n));
    const int64_t low = -(int64_t)n.box / 2;
    if (!ov_twin_march(n.quadrics, n.count, ISOVALUE, SPACING, (const int64_t[3]){low, low, low},
                       (const size_t[3]){n.box, n.box, n.box}, &twin)) {
        status = ov_fail(c->context, OVOID_ERROR_MEMORY, "out of memory for a check's mesh");
        goto cleanup;
    }
    OV_TRY(march(c, &n, OVOID_VERTEX_LINEAR, NULL, &linear));
    OV_TRY(compare_mesh(c, linear, &twin));
    OV_TRY(march(c, &n, OVOID_VERTEX_EXACT, NULL, &exact));
    ov_expect(c, exact->vertices == twin.vertices, "march: %zu exact vertices, not %zu",
              exact->vertices, twin.vertices);
    expect_surface(c, exact, &n);
    OV_TRY(march(c, &n, OVOID_VERTEX_EXACT, origin, &light));
    expect_light_mesh(c, exact, light);
cleanup:
    ovoid_mesh_destroy(&linear);
    ovoid_mesh_destroy(&exact);
    ovoid_mesh_destroy(&light);
    ov_twin_mesh_destroy(&twin);
    destroy_noise(&n);
    return status;
}

/* ---- distances ---------------------------------------------------------------------------- */

/* Triangles of all sizes, of which some are an edge, a point or a needle. */
static void make_triangles(ov_random *random, size_t triangles, double *xyz, uint32_t *corners) {
    for (size_t t = 0; t < triangles; ++t) {
        const double size = exp(ov_random_uniform(random, -4.0, 1.0));
        double centre[3];
        for (size_t k = 0; k < 3; ++k)
            centre[k] = ov_random_uniform(random, -5.0, 5.0);
        for (size_t k = 0; k < 9; ++k)
            xyz[9 * t + k] = (float)(centre[k % 3] + ov_random_uniform(random, -size, size));
        for (size_t k = 0; k < 3; ++k) {
            corners[3 * t + k] = (uint32_t)(3 * t + k);
            if (t % 7 == 3 || t % 7 == 4)
                xyz[9 * t + 6 + k] = xyz[9 * t + (t % 7 == 3 ? k : 3 + k)];
            if (t % 7 == 4)
                xyz[9 * t + 3 + k] = xyz[9 * t + 6 + k] = xyz[9 * t + k];
            if (t % 7 == 5)
                xyz[9 * t + 6 + k] = (float)(0.5 * (xyz[9 * t + k] + xyz[9 * t + 3 + k]));
        }
    }
}

/* How far a triangle reaches from a mesh: from the triangle of it that says least. */
static double reach_of(const float *triangle, const ovoid_mesh *mesh) {
    double least = INFINITY, corner[3][3];
    for (size_t i = 0; i < 9; ++i)
        corner[i / 3][i % 3] = triangle[i];
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const double *to[3];
        double most = 0.0;
        for (size_t i = 0; i < 3; ++i)
            to[i] = mesh->xyz + 3 * (size_t)mesh->corners[3 * t + i];
        for (size_t i = 0; i < 3; ++i)
            most = fmax(most, ov_twin_triangle_distance(corner[i], to[0], to[1], to[2]));
        least = fmin(least, most);
    }
    return least;
}

/* Of the points three by three. */
static ovoid_status check_reach(ov_checking *c, ov_meter *meter, ov_facets *facets,
                                const float *points, size_t count) {
    ovoid_status status = OVOID_OK;
    float *const squared = ov_alloc(c->context, count, sizeof *squared, "distances of a check");
    if (!squared)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < count; ++k)
        squared[k] = k % 2 ? INFINITY : 4.0f;
    OV_TRY(ov_facets_reach(c->context, meter, facets, points, count, squared));
    for (size_t k = 0; k < count; ++k) {
        const double reach = reach_of(points + 9 * k, facets->trail.mesh),
                     wanted = k % 2 ? reach : fmin(reach, 2.0);
        ov_expect_near(c, sqrt((double)squared[k]), wanted, 2e-6 * fmax(wanted, 1.0),
                       "distances: triangle", k);
    }
cleanup:
    free(squared);
    return status;
}

/* squared: of `count` points (3 floats each), allocated. With c the triangles that they make are
 * checked, too. */
static ovoid_status measure(ovoid_context *context, const ovoid_mesh *mesh, const float *points,
                            size_t count, float **squared, ov_checking *c) {
    static const double origin[3] = {0.0, 0.0, 0.0};
    ovoid_status status = OVOID_OK;
    ov_trail trail = {0};
    ov_facets facets = {0};
    ov_meter meter = {0};
    const ov_sites sites = {.count = count, .xyz = points};
    float *const made = ov_alloc(context, count, sizeof *made, "distances of a check");
    if (!made)
        return OVOID_ERROR_MEMORY;
    meter.batch = count;
    OV_TRY(ov_trail_create(context, mesh, false, &trail));
    OV_TRY(ov_facets_set(context, &facets, &trail, origin));
    OV_TRY(ov_facets_distances(context, &meter, &facets, &sites, made));
    if (c)
        OV_TRY(check_reach(c, &meter, &facets, points, count / 3));
    *squared = made;
cleanup:
    if (status != OVOID_OK)
        free(made);
    ov_facets_destroy(&facets);
    ov_meter_destroy(&meter);
    ov_trail_destroy(&trail);
    return status;
}

ovoid_status ov_check_distances(ov_checking *c) {
    ovoid_status status = OVOID_ERROR_MEMORY;
    ovoid_context *const context = c->context;
    const size_t triangles = ov_check_size(c, 3001, 321), count = ov_check_size(c, 501, 101);
    ov_random random = {17};
    ovoid_mesh *mesh = NULL;
    float *squared = NULL, *points = ov_random_floats(context, &random, 3 * count, -9.0, 9.0);
    double *const xyz = ov_alloc(context, 9 * triangles, sizeof *xyz, "triangles of a check");
    uint32_t *const corners = ov_alloc(context, 3 * triangles, sizeof *corners, "their corners");
    if (!points || !xyz || !corners)
        goto cleanup;
    make_triangles(&random, triangles, xyz, corners);
    OV_TRY(ovoid_mesh_create(context, xyz, NULL, 3 * triangles, corners, triangles, &mesh));
    OV_TRY(measure(context, mesh, points, count, &squared, c));
    for (size_t k = 0; k < count; ++k) {
        const double at[3] = {points[3 * k], points[3 * k + 1], points[3 * k + 2]};
        const double wanted = ov_twin_mesh_distance(at, mesh, false);
        ov_expect_near(c, sqrt((double)squared[k]), wanted, 2e-6 * fmax(wanted, 1.0),
                       "distances: point", k);
    }
cleanup:
    free(points);
    free(squared);
    free(xyz);
    free(corners);
    ovoid_mesh_destroy(&mesh);
    return status;
}

/* More than 2^21 points over a square of many triangles in the plane z = 0: each distance is |z|.
 */
ovoid_status ov_check_many_distances(ov_checking *c) {
    enum { SIDE = 40 };
    ovoid_status status = OVOID_ERROR_MEMORY;
    ovoid_context *const context = c->context;
    const size_t count = ((size_t)1 << 21) + 77, vertices = (SIDE + 1) * (SIDE + 1);
    ov_random random = {19};
    ovoid_mesh *mesh = NULL;
    float *squared = NULL, *points = ov_random_floats(context, &random, 3 * count, -9.0, 9.0);
    double *const xyz = ov_alloc(context, 3 * vertices, sizeof *xyz, "a check's square");
    uint32_t *const corners = ov_alloc(context, 6 * SIDE * SIDE, sizeof *corners, "its corners");
    if (!points || !xyz || !corners)
        goto cleanup;
    for (size_t v = 0; v < vertices; ++v) {
        xyz[3 * v] = (double)(v % (SIDE + 1)) - 0.5 * SIDE;
        xyz[3 * v + 1] = (double)(v / (SIDE + 1)) - 0.5 * SIDE;
    }
    for (uint32_t n = 0; n < SIDE * SIDE; ++n) {
        const uint32_t v = n / SIDE * (SIDE + 1) + n % SIDE;
        const uint32_t own[6] = {v, v + 1, v + SIDE + 1, v + 1, v + SIDE + 2, v + SIDE + 1};
        memcpy(corners + 6 * (size_t)n, own, sizeof own);
    }
    OV_TRY(ovoid_mesh_create(context, xyz, NULL, vertices, corners, 2 * SIDE * SIDE, &mesh));
    OV_TRY(measure(context, mesh, points, count, &squared, NULL));
    for (size_t k = 0; k < count; ++k)
        ov_expect_near(c, sqrt((double)squared[k]), fabs((double)points[3 * k + 2]), 2e-5,
                       "distances, many points: point", k);
cleanup:
    free(points);
    free(squared);
    free(xyz);
    free(corners);
    ovoid_mesh_destroy(&mesh);
    return status;
}

/* ---- rays --------------------------------------------------------------------------------- */

enum { TERMS = 12 };
#define WIDE 12.0  /* angstrom, of the picture */
#define DEPTH 60.0 /* angstrom, to either side of the origin */

/* What rays meet, on the host. */
typedef struct view {
    float *depth, *extra;
    int32_t *normal;
} view;

static void destroy_view(view *v) {
    free(v->depth);
    free(v->extra);
    free(v->normal);
}

static ovoid_status read_view(ovoid_context *context, const ov_rays *rays, const ov_hits *hits,
                              view *v) {
    ovoid_status status = OVOID_OK;
    const size_t count = ov_rays_packs(rays) * OV_PACK;
    OV_TRY(ov_read_words(context, &hits->depth, count, &v->depth));
    OV_TRY(ov_read_words(context, &hits->extra, count, &v->extra));
    OV_TRY(ov_read_words(context, &hits->normal, count, &v->normal));
cleanup:
    return status;
}

static void unpack_normal(int32_t packed, double normal[2]) {
    normal[0] = (int16_t)(uint16_t)((uint32_t)packed & 0xffffu) / 32767.0;
    normal[1] = (int16_t)(uint16_t)((uint32_t)packed >> 16) / 32767.0;
}

static void expect_normal(ov_checking *c, const char *what, size_t at, int32_t packed,
                          const double wanted[3], double allowed) {
    double got[2];
    unpack_normal(packed, got);
    for (size_t k = 0; k < 2; ++k)
        ov_expect_near(c, got[k], wanted[k], allowed, what, at);
}

/* A hit lies between those of a slightly higher and of a slightly lower level, which holds also
 * where rays only just touch. extra: the slope, or what compare() makes of it. */
static void expect_hit(ov_checking *c, const ov_quadric *own, const ov_quadric *other, double x,
                       double y, const view *v, const view *compared, size_t at) {
    const double later = ov_twin_hit(own, TERMS, 1.0003 * ISOVALUE, x, y, DEPTH, -DEPTH);
    const double sooner = ov_twin_hit(own, TERMS, 0.9997 * ISOVALUE, x, y, DEPTH, -DEPTH);
    const double z = v->depth[at] > OV_NOWHERE ? (double)v->depth[at] : -INFINITY;
    if (!ov_expect(c, z >= later - 1e-4 && z <= sooner + 1e-4,
                   "trace: ray (%g, %g) ends at %g, not within %g .. %g", x, y, z, later, sooner) ||
        isinf(z))
        return;
    const double point[3] = {x, y, z};
    double normal[3];
    const double slope = ov_twin_normal(own, TERMS, point, normal);
    const double apart = (ov_twin_sum_at(other, TERMS, point) - ISOVALUE) / slope;
    ov_expect_near(c, v->extra[at], slope, 1e-3 * slope + 1e-4, "trace: slope of ray", at);
    expect_normal(c, "trace: normal of ray", at, v->normal[at], normal, 1e-3);
    ov_expect_near(c, compared->extra[at], apart, 2e-3 * fabs(apart) + 2e-4,
                   "compare: distance at ray", at);
}

static void expect_single(ov_checking *c, const ov_quadric *quadrics, double x, double y,
                          const view *v, size_t at) {
    size_t which = 0;
    int32_t index;
    const double z = ov_twin_hit_single(quadrics, TERMS, ISOVALUE, x, y, &which);
    if (!ov_expect(c, (v->depth[at] > OV_NOWHERE) == (z > -INFINITY),
                   "trace_ellipsoids: ray (%g, %g) ends at %g, not at %g", x, y,
                   (double)v->depth[at], z) ||
        isinf(z))
        return;
    const double point[3] = {x, y, z};
    double normal[3];
    ov_twin_normal(&quadrics[which], 1, point, normal);
    memcpy(&index, &v->extra[at], sizeof index);
    ov_expect(c, index == (int32_t)which, "trace_ellipsoids: ray (%g, %g) meets %d, not %zu", x, y,
              (int)index, which);
    ov_expect_near(c, v->depth[at] * normal[2], z * normal[2], 1e-4,
                   "trace_ellipsoids: depth of ray", at);
    expect_normal(c, "trace_ellipsoids: normal of ray", at, v->normal[at], normal, 2e-3);
}

static ovoid_status check_rays(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    const uint32_t side = (uint32_t)ov_check_size(c, 32, 12);
    const double spacing = WIDE / side;
    const ov_rays rays = {side, side, -0.5 * (side - 1) * spacing, 0.5 * (side - 1) * spacing,
                          spacing};
    ov_random random = {21};
    ov_quadric own[TERMS], other[TERMS];
    ov_boxes boxes = {0}, others = {0}, singles = {0};
    ov_hits hits = {0}, single_hits = {0};
    ov_tracer tracer = {0};
    view traced = {0}, compared = {0}, singly = {0};
    for (size_t i = 0; i < TERMS; ++i) {
        ov_random_quadric(&random, 4.0, &own[i]);
        other[i] = own[i];
        other[i].amplitude *= ov_random_uniform(&random, 0.8, 1.25);
    }
    OV_TRY(ov_boxes_create(context, own, TERMS, OV_PICTURE_CUTOFF, &rays, &boxes));
    OV_TRY(ov_boxes_create(context, other, TERMS, OV_PICTURE_CUTOFF, &rays, &others));
    OV_TRY(ov_boxes_create(context, own, TERMS, ISOVALUE, &rays, &singles));
    OV_TRY(ov_trace(context, &tracer, &rays, &boxes, ISOVALUE, &hits));
    OV_TRY(read_view(context, &rays, &hits, &traced));
    OV_TRY(ov_compare(context, &tracer, &rays, &others, ISOVALUE, &hits));
    OV_TRY(read_view(context, &rays, &hits, &compared));
    OV_TRY(ov_trace_ellipsoids(context, &tracer, &rays, &singles, &single_hits));
    OV_TRY(read_view(context, &rays, &single_hits, &singly));
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const size_t at = ov_rays_index(&rays, column, row);
            const double x = rays.left + column * spacing, y = rays.top - row * spacing;
            expect_hit(c, own, other, x, y, &traced, &compared, at);
            expect_single(c, own, x, y, &singly, at);
        }
cleanup:
    destroy_view(&traced);
    destroy_view(&compared);
    destroy_view(&singly);
    ov_hits_destroy(&hits);
    ov_hits_destroy(&single_hits);
    ov_boxes_destroy(&boxes);
    ov_boxes_destroy(&others);
    ov_boxes_destroy(&singles);
    ov_tracer_destroy(&tracer);
    return status;
}

/* ---- light -------------------------------------------------------------------------------- */

enum { SIDE = 35 };
#define ACROSS 10.0 /* angstrom */

static ovoid_status render_atoms(ovoid_context *context, const double *xyzr, size_t atoms,
                                 ovoid_image **image) {
    ovoid_status status = OVOID_OK;
    ovoid_molecule *molecule = NULL;
    ovoid_field *field = NULL;
    ovoid_picture_options options;
    ovoid_picture_options_init(&options, sizeof options);
    options.width = options.height = SIDE;
    options.samples = 1;
    options.isovalue = ISOVALUE;
    options.across = ACROSS;
    options.direction[2] = 1.0;
    options.background = 0x204060ff;
    memset(options.centre, 0, sizeof options.centre);
    OV_TRY(ovoid_molecule_create(context, xyzr, atoms, &molecule));
    OV_TRY(ovoid_field_of_molecule(context, molecule, 0.5, ISOVALUE, &field));
    OV_TRY(ovoid_render(context, field, NULL, &options, image));
cleanup:
    ovoid_field_destroy(&field);
    ovoid_molecule_destroy(&molecule);
    return status;
}

static const uint8_t *pixel_of(const ovoid_image *image, size_t x, size_t y) {
    return ovoid_image_pixels(image) + 4 * (y * SIDE + x);
}

/* A sphere of radius 2 by itself: the light of the reference where it is, the background around. */
static void expect_light(ov_checking *c, const ovoid_image *image) {
    const ov_lights *const lights = &ov_default_lights;
    const ov_colour own = ov_colour_linear(0x5b9bd5ff), haze = ov_colour_linear(0x204060ffu);
    const double extent = sqrt(4.0 + log(1.0 / 0.4) / 0.5); /* what the distance fades over */
    for (size_t k = 0; k < SIDE * SIDE; ++k) {
        const size_t x = k % SIDE, y = k / SIDE;
        const double u = ACROSS / SIDE * ((double)x - SIDE / 2),
                     w = ACROSS / SIDE * (SIDE / 2 - (double)y);
        const double square = 4.0 - u * u - w * w;
        static const uint8_t around[4] = {0x20, 0x40, 0x60, 0xff};
        const uint8_t *const got = pixel_of(image, x, y);
        if (square < 0.0)
            ov_expect(c, memcmp(got, around, 4) == 0, "shade: pixel %zu is not the background", k);
        if (square < 0.05)
            continue;
        const double z = sqrt(square), normal[3] = {u / 2.0, w / 2.0, z / 2.0};
        const double fade = lights->fade * (extent - z) / (2.0 * extent);
        const double colour[3] = {own.rgba[0], own.rgba[1], own.rgba[2]};
        double light[3];
        ov_twin_light(colour, normal, lights->key, lights->fill, lights->ambient, light);
        for (size_t n = 0; n < 3; ++n)
            ov_expect_near(c, got[n], ov_srgb_encode(light[n] + fade * (haze.rgba[n] - light[n])),
                           1.01, "shade: colour", 3 * k + n);
    }
}

/* Beside another sphere it is darker where it looks toward that one. */
static ovoid_status check_light(ov_checking *c) {
    static const double two[8] = {0.0, 0.0, 0.0, 2.0, 4.0, 0.0, 0.0, 2.0};
    ovoid_status status = OVOID_OK;
    ovoid_image *alone = NULL, *beside = NULL;
    const size_t toward = SIDE / 2 + 4, row = SIDE / 2;
    OV_TRY(render_atoms(c->context, two, 1, &alone));
    OV_TRY(render_atoms(c->context, two, 2, &beside));
    expect_light(c, alone);
    for (size_t n = 0; n < 3; ++n)
        ov_expect(c, pixel_of(beside, toward, row)[n] < pixel_of(alone, toward, row)[n],
                  "shade: a neighbour does not shade");
cleanup:
    ovoid_image_destroy(&alone);
    ovoid_image_destroy(&beside);
    return status;
}

ovoid_status ov_check_picture(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    OV_TRY(check_rays(c));
    OV_TRY(check_light(c));
cleanup:
    return status;
}
