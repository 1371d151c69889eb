#include "mesh/exposed.h"

#include "base/progress.h"
#include "mesh/union.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- vertices near to each other ------------------------------------------------------------- */

/* The vertices that are not of the largest set, and the lattice cells in which a vertex may be near
 * to one of them: most vertices are in none, and most of the others in one that only their own set
 * comes near, which is soon seen. Vertices that follow one another are often in one cell. Of a mesh
 * in files, the cells of a slab are looked at at a time, with one more on either side. */
typedef struct minority {
    const ovoid_mesh *mesh;
    const uint32_t *set_of;
    uint32_t largest;
    size_t count;
    double low[3], high[3]; /* of the box about them */
    int64_t slab, slab_end; /* cells along z at hand */
    ov_grid grid;
    ov_cells about;
    uint32_t *only; /* of each cell: the one set that comes near, or SEVERAL */
    size_t only_capacity;
} minority;

#define SEVERAL OV_NO_SET

static void minority_destroy(minority *m) {
    ov_grid_destroy(&m->grid);
    ov_cells_destroy(&m->about);
    free(m->only);
    m->only = NULL;
    m->only_capacity = 0;
}

static ovoid_status find_largest(ovoid_context *context, minority *m, size_t sets) {
    size_t known = 0;
    size_t *const size = ov_alloc(context, sets, sizeof *size, "pieces of a surface");
    if (!size)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < m->mesh->vertices; ++v) {
        ov_store_turn(m->mesh->store, v);
        if (m->set_of[v] != OV_NO_SET) {
            ++size[m->set_of[v]];
            ++known;
        }
    }
    for (size_t s = 0; s < sets; ++s)
        if (size[s] > size[m->largest])
            m->largest = (uint32_t)s;
    m->count = known - size[m->largest];
    free(size);
    return OVOID_OK;
}

static bool is_minor(const minority *m, size_t v) {
    return m->set_of[v] != OV_NO_SET && m->set_of[v] != m->largest;
}

static void find_box(minority *m) {
    for (size_t k = 0; k < 3; ++k) {
        m->low[k] = INFINITY;
        m->high[k] = -INFINITY;
    }
    for (size_t v = 0; v < m->mesh->vertices; ++v) {
        double at[3];
        ov_store_turn(m->mesh->store, v);
        if (!is_minor(m, v))
            continue;
        ov_mesh_at(m->mesh, v, at);
        for (size_t k = 0; k < 3; ++k) {
            m->low[k] = fmin(m->low[k], at[k]);
            m->high[k] = fmax(m->high[k], at[k]);
        }
    }
}

/* Whether a place is in the slab, or so many cells beside it. */
static bool is_in_slab(const minority *m, const int32_t place[3], int64_t beside) {
    return place[2] >= m->slab - beside && place[2] < m->slab_end + beside;
}

/* Set `set` comes near what is in the cell in the middle, or about it. */
static ovoid_status add_about(ovoid_context *context, minority *m, const int32_t middle[3],
                              uint32_t set) {
    ovoid_status status = OVOID_OK;
    for (int n = 0; n < 27 && status == OVOID_OK; ++n) {
        const int32_t place[3] = {middle[0] + n % 3 - 1, middle[1] + n / 3 % 3 - 1,
                                  middle[2] + n / 9 - 1};
        uint32_t number;
        bool added;
        OV_TRY(ov_cells_add(context, &m->about, place, &number, &added));
        OV_TRY(ov_grow(context, &m->only, &m->only_capacity, (size_t)number + 1, sizeof *m->only,
                       "cells"));
        m->only[number] = added || m->only[number] == set ? set : SEVERAL;
    }
cleanup:
    return status;
}

/* The place of one vertex after the other, and whether it is another one than that before. */
typedef struct walk {
    int32_t place[3];
    uint32_t set; /* of the last */
    bool begun;
} walk;

static bool move_on(walk *w, const int32_t place[3], uint32_t set) {
    const bool same = w->begun && w->set == set && memcmp(place, w->place, sizeof w->place) == 0;
    memcpy(w->place, place, sizeof w->place);
    w->set = set;
    w->begun = true;
    return !same;
}

/* The grid of those in the slab and beside it; expected: about how many these are. */
static ovoid_status gather(ovoid_context *context, minority *m, double reach, size_t expected) {
    ovoid_status status = OVOID_OK;
    walk w = {.begun = false};
    OV_TRY(ov_grid_create(context, m->low, m->high, reach, expected, 0, &m->grid));
    OV_TRY(ov_cells_create(context, m->low, m->grid.cells.edge, expected, &m->about));
    for (size_t v = 0; v < m->mesh->vertices; ++v) {
        double at[3];
        int32_t place[3];
        ov_store_turn(m->mesh->store, v);
        if (!is_minor(m, v))
            continue;
        ov_mesh_at(m->mesh, v, at);
        ov_cells_place(&m->about, at, place);
        if (!is_in_slab(m, place, 1))
            continue;
        OV_TRY(ov_grid_add(context, &m->grid, at, (uint32_t)v));
        if (move_on(&w, place, m->set_of[v]))
            OV_TRY(add_about(context, m, w.place, m->set_of[v]));
    }
cleanup:
    return status;
}

static ovoid_status tell(const minority *m, uint32_t v, const double at[3], ov_near_found found,
                         void *user) {
    ovoid_status status = OVOID_OK;
    uint32_t near[2 * OV_NEAR_MAX];
    const size_t count = ov_grid_near(&m->grid, at, UINT32_MAX, near);
    for (size_t n = 0; n < count && status == OVOID_OK; ++n)
        if (m->set_of[near[n]] != m->set_of[v])
            status = found(v, near[n], user);
    return status;
}

/* Whether a vertex of this set in the cell may be near to one of another. */
static bool may_be_near(const minority *m, const int32_t place[3], uint32_t set) {
    const uint32_t number = ov_cells_find(&m->about, place);
    return number != OV_NO_CELL && m->only[number] != set;
}

static ovoid_status tell_all(const minority *m, ov_near_found found, void *user) {
    ovoid_status status = OVOID_OK;
    walk w = {.begun = false};
    bool near = false;
    for (size_t v = 0; v < m->mesh->vertices; ++v) {
        double at[3];
        int32_t place[3];
        ov_store_turn(m->mesh->store, v);
        if (m->set_of[v] == OV_NO_SET)
            continue;
        ov_mesh_at(m->mesh, v, at);
        ov_cells_place(&m->about, at, place);
        if (!is_in_slab(m, place, 0))
            continue;
        if (move_on(&w, place, m->set_of[v]))
            near = may_be_near(m, w.place, m->set_of[v]);
        if (near)
            OV_TRY(tell(m, (uint32_t)v, at, found, user));
    }
cleanup:
    return status;
}

/* Bytes that a vertex takes in a grid and in the cells about it; those of a slab come to four times
 * what the mesh's store has room for. */
#define VERTEX_BYTES 64.0
#define SLAB_ROOMS 4.0

static ovoid_status look_slab_by_slab(ovoid_context *context, minority *m, double reach,
                                      ov_near_found found, void *user) {
    ovoid_status status = OVOID_OK;
    const double cells = fmin(floor((m->high[2] - m->low[2]) / reach) + 1.0, 1e9),
                 wanted = ceil(VERTEX_BYTES * (double)m->count /
                               (SLAB_ROOMS * (double)ov_store_room(m->mesh->store)));
    const int64_t most = (int64_t)cells, slabs = (int64_t)fmin(wanted, cells);
    for (int64_t n = 0; n < slabs; ++n) {
        m->slab = n > 0 ? most * n / slabs : INT32_MIN;
        m->slab_end = n + 1 < slabs ? most * (n + 1) / slabs : INT32_MAX;
        if (n > 0)
            OV_TRY(ov_progress_ask(context));
        OV_TRY(gather(context, m, reach, m->count / (size_t)slabs));
        OV_TRY(tell_all(m, found, user));
        minority_destroy(m);
    }
cleanup:
    return status;
}

ovoid_status ov_mesh_near_sets(ovoid_context *context, const ovoid_mesh *mesh,
                               const uint32_t *set_of, size_t sets, double reach,
                               ov_near_found found, void *user) {
    ovoid_status status = OVOID_OK;
    minority m = {.mesh = mesh, .set_of = set_of};
    if (sets < 2)
        return OVOID_OK;
    OV_TRY(find_largest(context, &m, sets));
    if (m.count == 0)
        goto cleanup;
    find_box(&m);
    OV_TRY(look_slab_by_slab(context, &m, reach, found, user));
cleanup:
    minority_destroy(&m);
    return status;
}

/* ---- components ------------------------------------------------------------------------------ */

typedef struct joining {
    const ovoid_mesh *mesh;
    uint32_t *of; /* of each component */
} joining;

static ovoid_status join(uint32_t v, uint32_t w, void *user) {
    const joining *const j = user;
    ov_unite(j->of, j->mesh->component_of[v], j->mesh->component_of[w]);
    return OVOID_OK;
}

static void mark(const joining *j, ovoid_mesh *mesh) {
    for (size_t c = 0; c < mesh->components; ++c)
        if (mesh->component[c].outer)
            mesh->component[ov_union_first(j->of, (uint32_t)c)].exposed = true;
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].exposed = mesh->component[ov_union_first(j->of, (uint32_t)c)].exposed;
}

/* Where vertices belong: all outer components are one set, however many they are, since it does not
 * matter which of them is near to which. */
static ovoid_status find_sets(ovoid_context *context, const ovoid_mesh *mesh, uint32_t **set_of) {
    uint32_t first = 0;
    const ovoid_status status = ov_store_alloc(context, mesh->store, set_of, mesh->vertices,
                                               sizeof **set_of, "components of a mesh");
    while (first < mesh->components && !mesh->component[first].outer)
        ++first;
    for (size_t v = 0; status == OVOID_OK && v < mesh->vertices; ++v) {
        const uint32_t own = mesh->component_of[v];
        ov_store_turn(mesh->store, v);
        (*set_of)[v] = mesh->component[own].outer ? first : own;
    }
    return status;
}

static bool has_cavities(const ovoid_mesh *mesh) {
    for (size_t c = 0; c < mesh->components; ++c)
        if (!mesh->component[c].outer)
            return true;
    return false;
}

ovoid_status ov_mesh_expose(ovoid_context *context, ovoid_mesh *mesh) {
    ovoid_status status = OVOID_OK;
    joining j = {.mesh = mesh};
    uint32_t *set_of = NULL;
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].exposed = mesh->component[c].outer;
    if (mesh->components < 2 || !(mesh->spacing > 0.0) || !has_cavities(mesh))
        return OVOID_OK;
    j.of = ov_alloc(context, mesh->components, sizeof *j.of, "components of a mesh");
    if (!j.of)
        return OVOID_ERROR_MEMORY;
    OV_TRY(find_sets(context, mesh, &set_of));
    for (size_t c = 0; c < mesh->components; ++c)
        j.of[c] = (uint32_t)c;
    OV_TRY(ov_mesh_near_sets(context, mesh, set_of, mesh->components, OV_NECK * mesh->spacing, join,
                             &j));
    mark(&j, mesh);
cleanup:
    ov_store_free(mesh->store, set_of);
    free(j.of);
    return status;
}
