/* What the lattice does not tell of a mesh: specks, and normals where the gradient vanishes. */
#include "mesh/marching.h"

#include "mesh/specks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double coordinate(const ov_marcher *m, size_t vertex, size_t axis) {
    return m->origin ? (double)m->offsets[3 * vertex + axis] : m->xyz[3 * vertex + axis];
}

/* ---- what the lattice does not meet ------------------------------------------------------- */

static void vertex_at(size_t vertex, double xyz[3], const void *user) {
    const ov_marcher *const m = user;
    for (size_t k = 0; k < 3; ++k)
        xyz[k] = coordinate(m, vertex, k) + (m->origin ? m->origin[k] : 0.0);
}

/* Drops the vertices that are replaced, and their triangles. `number` becomes the new ones. */
static void drop_replaced(ov_marcher *m, const bool *replaced, uint32_t *number) {
    size_t kept = 0, triangles = 0;
    for (size_t v = 0; v < m->vertices; ++v) {
        ov_store_turn(m->store, v);
        if (replaced[v])
            continue;
        for (size_t k = 0; k < 3; ++k) {
            if (m->origin)
                m->offsets[3 * kept + k] = m->offsets[3 * v + k];
            else
                m->xyz[3 * kept + k] = m->xyz[3 * v + k];
            if (!m->bare)
                m->normals[3 * kept + k] = m->normals[3 * v + k];
        }
        if (m->edge_of)
            m->edge_of[kept] = m->edge_of[v];
        number[v] = (uint32_t)kept++;
    }
    for (size_t t = 0; t < m->triangles; ++t) {
        const uint32_t *const from = m->triangle + 3 * t;
        ov_store_turn(m->store, t);
        if (replaced[from[0]])
            continue;
        for (size_t k = 0; k < 3; ++k)
            m->triangle[3 * triangles + k] = number[from[k]];
        ++triangles;
    }
    m->vertices = kept;
    m->triangles = triangles;
}

static ovoid_status append_specks(ovoid_context *context, ov_marcher *m, const ov_specks *specks) {
    ovoid_status status = OVOID_OK;
    const size_t total = m->vertices + specks->vertices, corners = 3 * m->triangles;
    if (total > UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT,
                       "the mesh has more than 2^32 vertices; use a larger spacing");
    OV_TRY(ov_marching_grow_vertices(context, m, total));
    OV_TRY(ov_marching_grow_triangles(context, m, m->triangles + specks->triangles));
    for (size_t k = 0; k < 3 * specks->vertices; ++k) {
        ov_store_turn(m->store, k);
        ov_marching_put(m, 3 * m->vertices + k, specks->xyz[k]);
        if (!m->bare)
            m->normals[3 * m->vertices + k] = specks->normals[k];
    }
    if (m->edge_of)
        memcpy(m->edge_of + m->vertices, specks->edge, specks->vertices);
    for (size_t k = 0; k < 3 * specks->triangles; ++k) {
        ov_store_turn(m->store, k);
        m->triangle[corners + k] = (uint32_t)m->vertices + specks->corners[k];
    }
    m->vertices = total;
    m->triangles += specks->triangles;
cleanup:
    return status;
}

ovoid_status ov_marching_add_specks(ovoid_context *context, ov_marcher *m, size_t count) {
    ovoid_status status = OVOID_OK;
    ov_specks specks = {.store = m->store};
    uint32_t *number = NULL;
    ov_lattice_mesh lattice = {.at = vertex_at,
                               .user = m,
                               .corners = m->triangle,
                               .vertices = m->vertices,
                               .triangles = m->triangles};
    OV_TRY(ov_store_alloc(context, m->store, &lattice.replaced, m->vertices,
                          sizeof *lattice.replaced, "vertices"));
    OV_TRY(ov_specks_find(context, m->bodies, count, m->options, m->cutoff, &lattice, &specks));
    m->missed = specks.missed;
    if (specks.vertices == 0)
        goto cleanup;
    OV_TRY(ov_store_alloc(context, m->store, &number, m->vertices, sizeof *number, "vertices"));
    m->resident = false;
    drop_replaced(m, lattice.replaced, number);
    OV_TRY(append_specks(context, m, &specks));
cleanup:
    ov_store_free(m->store, number);
    ov_store_free(m->store, lattice.replaced);
    ov_specks_destroy(&specks);
    return status;
}

/* ---- normals where the gradient vanishes -------------------------------------------------- */

static bool vanishes(const float normal[3]) {
    return normal[0] == 0.0f && normal[1] == 0.0f && normal[2] == 0.0f;
}

/* Twice a triangle's area times its normal. */
static void triangle_normal(const ov_marcher *m, const uint32_t corner[3], double normal[3]) {
    double u[3], v[3];
    for (size_t k = 0; k < 3; ++k) {
        const double from = coordinate(m, corner[0], k);
        u[k] = coordinate(m, corner[1], k) - from;
        v[k] = coordinate(m, corner[2], k) - from;
    }
    for (int k = 0; k < 3; ++k)
        normal[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
}

/* Gives a vertex the mean normal of its triangles, or any unit vector if they have no area. */
ovoid_status ov_marching_mend_normals(ovoid_context *context, ov_marcher *m) {
    size_t missing = 0;
    double *sums = NULL;
    for (size_t k = 0; !m->bare && k < m->vertices; ++k) {
        ov_store_turn(m->store, k);
        missing += vanishes(m->normals + 3 * k);
    }
    if (missing == 0)
        return OVOID_OK;
    const ovoid_status status =
        ov_store_alloc(context, m->store, &sums, 3 * m->vertices, sizeof *sums, "normals");
    if (status != OVOID_OK)
        return status;
    for (size_t k = 0; k < m->triangles; ++k) {
        double normal[3];
        ov_store_turn(m->store, k);
        triangle_normal(m, m->triangle + 3 * k, normal);
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis)
                sums[3 * (size_t)m->triangle[3 * k + (size_t)corner] + (size_t)axis] +=
                    normal[axis];
    }
    for (size_t k = 0; k < m->vertices; ++k) {
        const double *const s = sums + 3 * k;
        float *const normal = m->normals + 3 * k;
        const double length = sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
        ov_store_turn(m->store, k);
        if (!vanishes(normal))
            continue;
        normal[2] = 1.0f;
        for (int axis = 0; axis < 3 && length > 0.0; ++axis)
            normal[axis] = (float)(s[axis] / length);
    }
    ov_store_free(m->store, sums);
    return OVOID_OK;
}
