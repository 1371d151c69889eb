/* Areas and volumes, flat and smooth. */
#include "base/parallel.h"
#include "base/progress.h"
#include "mesh/vectors.h"

#include <math.h>
#include <stdlib.h>

/* ---- flat ------------------------------------------------------------------------------------ */

void ov_mesh_flat_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
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

void ov_mesh_flat_vector(const ovoid_mesh *mesh, size_t triangle, double vector[3]) {
    double a[3], u[3], v[3], normal[3];
    corners_at(mesh, triangle, a, u, v);
    subtract(u, a, u);
    subtract(v, a, v);
    cross(u, v, normal);
    for (size_t k = 0; k < 3; ++k)
        vector[k] += 0.5 * normal[k];
}

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

/* ---- smooth ---------------------------------------------------------------------------------- */

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

/* What each node adds. */
typedef struct bent_nodes {
    double area[NODES], volume[NODES];
} bent_nodes;

/* The area's integrand is the vector area along the interpolated normal: signed, so that what
 * bending folds over in a needle of a triangle counts for nothing. All nodes go side by side, which
 * compilers turn into vectors. */
static void integrate_nodes(const bent_triangle *t, bent_nodes *nodes) {
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
    double along[NODES], square[NODES];
    for (size_t q = 0; q < NODES; ++q) {
        const double a0 = u[1][q] * v[2][q] - u[2][q] * v[1][q],
                     a1 = u[2][q] * v[0][q] - u[0][q] * v[2][q],
                     a2 = u[0][q] * v[1][q] - u[1][q] * v[0][q];
        nodes->volume[q] = x[0][q] * a0 + x[1][q] * a1 + x[2][q] * a2;
        along[q] = n[0][q] * a0 + n[1][q] * a1 + n[2][q] * a2;
        square[q] = n[0][q] * n[0][q] + n[1][q] * n[1][q] + n[2][q] * n[2][q];
    }
    for (size_t q = 0; q < NODES; ++q) {
        nodes->area[q] = square[q] > 1e-6 ? 0.5 * node_weight[q] * along[q] / sqrt(square[q]) : 0.0;
        nodes->volume[q] = node_weight[q] / 6.0 * nodes->volume[q];
    }
}

static void add_nodes(const bent_nodes *nodes, ov_content *content) {
    for (size_t q = 0; q < NODES; ++q) {
        content->area += nodes->area[q];
        content->volume += nodes->volume[q];
    }
}

void ov_mesh_smooth_triangle(const ovoid_mesh *mesh, size_t triangle, const double origin[3],
                             ov_content *content) {
    bent_triangle bent;
    bent_nodes nodes;
    bend(mesh, triangle, origin, &bent);
    integrate_nodes(&bent, &nodes);
    add_nodes(&nodes, content);
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

/* ---- of all of a mesh ------------------------------------------------------------------------ */

/* So many triangles are integrated as one part, and so many parts at a time: what their nodes come
 * to is added up afterwards, node by node in the order of the triangles, so that sums do not depend
 * on how many threads there are. */
#define BLOCK ((size_t)1 << 11)
#define BLOCKS ((size_t)32)
#define FEW ((size_t)64)

typedef struct integrating {
    const ovoid_mesh *mesh;
    double origin[3];
    size_t first, end; /* triangles at hand */
    bent_nodes *nodes; /* of each */
} integrating;

static void integrate_block(size_t k, void *user) {
    const integrating *const all = user;
    const size_t from = all->first + k * BLOCK,
                 to = from + BLOCK < all->end ? from + BLOCK : all->end;
    for (size_t t = from; t < to; ++t) {
        bent_triangle bent;
        bend(all->mesh, t, all->origin, &bent);
        integrate_nodes(&bent, &all->nodes[t - all->first]);
    }
}

static void add_all(const integrating *all, ov_content *whole, ov_content *outer) {
    for (size_t t = all->first; t < all->end; ++t) {
        const bent_nodes *const nodes = &all->nodes[t - all->first];
        add_nodes(nodes, whole);
        if (ov_mesh_component_of_triangle(all->mesh, t)->outer)
            add_nodes(nodes, outer);
    }
}

static ovoid_status add_smooth(ovoid_context *context, const ovoid_mesh *mesh, ov_content *whole,
                               ov_content *outer) {
    ovoid_status status = OVOID_OK;
    integrating all = {.mesh = mesh};
    bent_nodes few[FEW]; /* where there is no memory for more */
    bent_nodes *const many = mesh->triangles > FEW ? malloc(BLOCKS * BLOCK * sizeof *many) : NULL;
    const size_t room = many ? BLOCKS * BLOCK : FEW;
    all.nodes = many ? many : few;
    if (mesh->vertices > 0)
        ov_mesh_at(mesh, 0, all.origin);
    for (; all.first < mesh->triangles; all.first = all.end) {
        OV_TRY(ov_progress_step(context, all.first, mesh->triangles));
        all.end = mesh->triangles - all.first < room ? mesh->triangles : all.first + room;
        ov_parallel((all.end - all.first + BLOCK - 1) / BLOCK, integrate_block, &all);
        add_all(&all, whole, outer);
        ov_store_rest(mesh->store);
    }
cleanup:
    free(many);
    return status;
}

ovoid_status ov_mesh_contents(ovoid_context *context, const ovoid_mesh *mesh, bool smooth,
                              ov_content *whole, ov_content *outer) {
    *whole = *outer = (ov_content){0.0, 0.0};
    if (smooth)
        return add_smooth(context, mesh, whole, outer);
    *whole = ov_mesh_flat(mesh, false);
    *outer = ov_mesh_flat(mesh, true);
    return OVOID_OK;
}

ov_content ov_mesh_smooth(const ovoid_mesh *mesh, bool outer_only) {
    ov_content whole, outer;
    (void)ov_mesh_contents(NULL, mesh, true, &whole, &outer); /* nobody stops it */
    return outer_only ? outer : whole;
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
