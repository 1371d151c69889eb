#include "mesh/components.h"

#include "base/parallel.h"
#include "mesh/union.h"

#include <stdlib.h>

/* Triangles of a part, at least, and parts at most. */
#define PART ((size_t)1 << 14)
#define PARTS_MOST ((size_t)64)

static size_t parts_of(const ovoid_mesh *mesh) {
    const size_t parts = mesh->triangles / PART;
    return parts < 1 ? 1 : parts < PARTS_MOST ? parts : PARTS_MOST;
}

static size_t part_begin(const ovoid_mesh *mesh, size_t parts, size_t k) {
    return mesh->triangles / parts * k +
           (k < mesh->triangles % parts ? k : mesh->triangles % parts);
}

/* ---- what hangs together --------------------------------------------------------------------- */

/* A share of the triangles, and of the vertices. Triangles follow their vertices, so that most have
 * theirs in their own part; the others are left for later. */
typedef struct stretch {
    size_t first, end;               /* triangles */
    uint32_t first_vertex, last_end; /* vertices */
} stretch;

typedef struct uniting {
    ovoid_mesh *mesh;
    stretch part[PARTS_MOST];
    size_t parts;
} uniting;

static void unite_triangle(uint32_t *of, const uint32_t corner[3]) {
    ov_unite(of, corner[0], corner[1]);
    ov_unite(of, corner[0], corner[2]);
}

static bool is_within(const stretch *s, const uint32_t corner[3]) {
    bool within = true;
    for (size_t i = 0; i < 3; ++i)
        within = within && corner[i] >= s->first_vertex && corner[i] < s->last_end;
    return within;
}

/* The triangles of a part whose corners are in it, or the others. */
static void unite_those(const uniting *u, const stretch *s, bool within) {
    const uint32_t *const corners = u->mesh->corners;
    for (size_t t = s->first; t < s->end; ++t) {
        ov_store_turn(u->mesh->store, t);
        if (is_within(s, corners + 3 * t) == within)
            unite_triangle(u->mesh->component_of, corners + 3 * t);
    }
}

static void unite_part(size_t k, void *user) {
    uniting *const u = user;
    const stretch *const s = &u->part[k];
    for (uint32_t v = s->first_vertex; v < s->last_end; ++v) {
        ov_store_turn(u->mesh->store, v);
        u->mesh->component_of[v] = v;
    }
    unite_those(u, s, true);
}

/* Where a part's first triangle begins, its vertices do. */
static void cut(uniting *u) {
    const ovoid_mesh *const mesh = u->mesh;
    uint32_t from = 0;
    for (size_t k = 0; k < u->parts; ++k) {
        stretch *const s = &u->part[k];
        s->first = part_begin(mesh, u->parts, k);
        s->end = part_begin(mesh, u->parts, k + 1);
        if (k > 0 && mesh->corners[3 * s->first] > from)
            from = mesh->corners[3 * s->first];
        s->first_vertex = from;
        if (k > 0)
            u->part[k - 1].last_end = from;
    }
    u->part[u->parts - 1].last_end = (uint32_t)mesh->vertices;
}

ovoid_status ov_components_find(ovoid_context *context, ovoid_mesh *mesh) {
    uint32_t *const of = mesh->component_of;
    uniting u = {.mesh = mesh, .parts = parts_of(mesh)};
    size_t count = 0;
    cut(&u);
    ov_parallel(u.parts, unite_part, &u);
    for (size_t k = 0; k < u.parts; ++k)
        unite_those(&u, &u.part[k], false);
    for (size_t v = 0; v < mesh->vertices; ++v) {
        ov_store_turn(mesh->store, v);
        count += of[v] == v;
    }
    mesh->components = count;
    mesh->component = ov_alloc(context, count, sizeof *mesh->component, "components of a mesh");
    if (!mesh->component)
        return OVOID_ERROR_MEMORY;
    /* Parents come before their children: when v is met, of[parent] is a component already. */
    uint32_t next = 0;
    for (size_t v = 0; v < mesh->vertices; ++v) {
        ov_store_turn(mesh->store, v);
        of[v] = of[v] == v ? next++ : of[of[v]];
        ++mesh->component[of[v]].vertices;
    }
    return OVOID_OK;
}

/* ---- how large it is ------------------------------------------------------------------------- */

/* Triangles of one component that follow one another. */
typedef struct stint {
    uint32_t component;
    size_t triangles;
    ov_content content;
} stint;

typedef struct measuring {
    const ovoid_mesh *mesh;
    const uint32_t *first; /* vertex of each component */
    size_t parts;
    size_t begin; /* the first part of those at hand */
    struct {
        stint *stint;
        size_t count, capacity;
        bool failed;
    } part[PARTS_MOST];
} measuring;

static uint32_t component_at(const ovoid_mesh *mesh, size_t triangle) {
    return mesh->component_of[mesh->corners[3 * triangle]];
}

/* From triangle t on; returns where it ends. */
static size_t measure_stint(const measuring *m, size_t t, size_t end, stint *made) {
    const ovoid_mesh *const mesh = m->mesh;
    const size_t from = t;
    double origin[3];
    *made = (stint){.component = component_at(mesh, t)};
    ov_mesh_at(mesh, m->first[made->component], origin);
    for (; t < end && component_at(mesh, t) == made->component; ++t) {
        ov_store_turn(mesh->store, t);
        ov_mesh_flat_triangle(mesh, t, origin, &made->content);
    }
    made->triangles = t - from;
    return t;
}

static void measure_part(size_t number, void *user) {
    measuring *const m = user;
    const size_t k = m->begin + number;
    const size_t end = part_begin(m->mesh, m->parts, k + 1);
    for (size_t t = part_begin(m->mesh, m->parts, k); t < end && !m->part[k].failed;) {
        m->part[k].failed = ov_grow(NULL, &m->part[k].stint, &m->part[k].capacity,
                                    m->part[k].count + 1, sizeof(stint), "parts") != OVOID_OK;
        if (!m->part[k].failed)
            t = measure_stint(m, t, end, &m->part[k].stint[m->part[k].count++]);
    }
}

static bool add_stints(measuring *m, size_t end, ovoid_component *components) {
    bool whole = true;
    for (size_t k = m->begin; k < end; ++k) {
        whole = whole && !m->part[k].failed;
        for (size_t n = 0; n < m->part[k].count; ++n) {
            const stint *const one = &m->part[k].stint[n];
            ovoid_component *const component = &components[one->component];
            component->triangles += one->triangles;
            component->area += one->content.area;
            component->volume += one->content.volume;
        }
        free(m->part[k].stint);
    }
    return whole;
}

/* Parts of a mesh in files that are measured before their stints are added up. */
#define PARTS_AT_ONCE ((size_t)8)

ovoid_status ov_components_measure(ovoid_context *context, ovoid_mesh *mesh) {
    measuring m = {.mesh = mesh, .parts = parts_of(mesh)};
    const size_t at_once = mesh->store ? PARTS_AT_ONCE : m.parts;
    bool whole = true;
    uint32_t *const first =
        ov_alloc(context, mesh->components, sizeof *first, "components of a mesh");
    if (!first)
        return OVOID_ERROR_MEMORY;
    for (size_t v = mesh->vertices; v-- > 0;) {
        ov_store_turn(mesh->store, v);
        first[mesh->component_of[v]] = (uint32_t)v;
    }
    m.first = first;
    for (size_t end; m.begin < m.parts; m.begin = end) {
        end = m.parts - m.begin < at_once ? m.parts : m.begin + at_once;
        ov_parallel(end - m.begin, measure_part, &m);
        whole = add_stints(&m, end, mesh->component) && whole;
    }
    free(first);
    if (!whole)
        return ov_fail(context, OVOID_ERROR_MEMORY, "no memory for the components of a mesh");
    for (size_t c = 0; c < mesh->components; ++c)
        mesh->component[c].outer = mesh->component[c].volume > 0.0;
    return OVOID_OK;
}
