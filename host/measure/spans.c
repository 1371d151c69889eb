/* The distances between two surfaces in a cell, summed up. */
#include "measure/surveyor.h"

#include "base/progress.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* One in so many vertices, by their keys, tells what surfaces in a halo belong to; of each surface
 * so many at most are asked for. */
#define MARKS 32
#define ASKED_MOST 8

/* ---- places ---------------------------------------------------------------------------------- */

/* How far a point is from the cell along the axis where that is most; negative inside. */
static double beyond(const ov_surveyor *s, const double at[3]) {
    double most = -INFINITY;
    for (size_t k = 0; k < 3; ++k)
        most = fmax(most, fmax(s->low[k] - at[k], at[k] - s->high[k]));
    return most;
}

static bool is_marked(uint64_t key) {
    return (key >> 32) % MARKS == 0;
}

ovoid_status ov_spans_mark(ov_surveyor *s, size_t n, ov_survey_side *side) {
    const ov_sheet *const sheet = &s->sheet[n];
    const double reach = s->options->halo + 3.0 * s->options->spacing;
    for (size_t v = 0; v < sheet->mesh->vertices; ++v) {
        double at[3];
        if (sheet->piece_of[v] == OV_NO_PIECE)
            continue;
        ov_mesh_at(sheet->mesh, v, at);
        if (beyond(s, at) < -reach)
            continue;
        const uint64_t key = ov_survey_key(s, at);
        if (!is_marked(key))
            continue;
        const ovoid_status status = ov_survey_add_key(
            s->context, key, sheet->piece_of[v], &side->mark, &side->marks, &side->mark_capacity);
        if (status != OVOID_OK)
            return status;
    }
    return OVOID_OK;
}

/* ---- what hangs together in cell and halo ---------------------------------------------------- */

/* Of each group of a sheet. */
typedef struct group {
    uint32_t piece; /* of the cell; OV_NO_PIECE: it is in the halo alone */
    bool open;      /* it goes on beyond */
    bool known;
    double volume; /* angstrom^3, where it is closed */
    int votes;     /* of its vertices that others know: for an outer one */
    uint32_t asked;
} group;

static void look_at_groups(const ov_surveyor *s, const ov_sheet *at, group *groups) {
    const ovoid_mesh *const mesh = at->mesh;
    for (size_t g = 0; g < at->groups; ++g)
        groups[g] = (group){.piece = OV_NO_PIECE};
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        if (at->zone[t] == OV_ZONE_BEYOND) {
            for (size_t i = 0; i < 3; ++i)
                if (at->group_of[corner[i]] != OV_NO_PIECE)
                    groups[at->group_of[corner[i]]].open = true;
            continue;
        }
        group *const of = &groups[at->group_of[corner[0]]];
        ov_content content = {0.0, 0.0};
        ov_mesh_flat_triangle(mesh, t, s->origin, &content);
        of->volume += content.volume;
        if (at->zone[t] == OV_ZONE_CELL)
            of->piece = at->piece_of[corner[0]];
    }
}

/* Surfaces of the halo that go on beyond it: what is known of them where they come from, or, before
 * that is known, the vertices to ask for. */
static ovoid_status ask_others(ov_surveyor *s, size_t n, const ov_survey_standing *standing,
                               group *groups, ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    const ov_sheet *const at = &s->sheet[n];
    for (size_t v = 0; v < at->mesh->vertices; ++v) {
        const uint32_t g = at->group_of[v];
        double place[3];
        if (g == OV_NO_PIECE || groups[g].piece != OV_NO_PIECE || !groups[g].open)
            continue;
        ov_mesh_at(at->mesh, v, place);
        const uint64_t key = ov_survey_key(s, place);
        if (!is_marked(key) || groups[g].asked == ASKED_MOST)
            continue;
        ++groups[g].asked;
        const int vote = standing ? ov_survey_stands(standing, n, key) : 1;
        groups[g].votes += vote;
        groups[g].known |= vote != 0;
        if (!standing)
            OV_TRY(ov_survey_add_key(s->context, key, g, &side->asked, &side->askings,
                                     &side->asked_capacity));
    }
cleanup:
    return status;
}

static int by_piece(const void *a, const void *b) {
    const ov_survey_seam *const p = a, *const q = b;
    return (p->piece > q->piece) - (p->piece < q->piece);
}

static uint8_t standing_of(const ov_surveyor *s, size_t n, const ov_survey_standing *standing,
                           const group *g) {
    if (g->piece != OV_NO_PIECE && standing)
        return standing->outer[n][standing->first[n][s->options->cell] + g->piece]
                   ? OV_STANDS_OUTER
                   : OV_STANDS_INNER;
    if (!g->open)
        return g->volume > 0.0 ? OV_STANDS_OUTER : OV_STANDS_INNER;
    if (g->piece != OV_NO_PIECE)
        return OV_STANDS_OUTER; /* until more is known */
    if (!g->known)
        return OV_STANDS_UNKNOWN;
    return g->votes >= 0 ? OV_STANDS_OUTER : OV_STANDS_INNER;
}

/* As far about the cell as nothing is unknown. */
static double reach_of(const ov_surveyor *s, const ov_sheet *at) {
    double reach = s->options->halo;
    for (size_t v = 0; v < at->mesh->vertices; ++v) {
        const uint32_t g = at->group_of[v];
        double place[3];
        if (g == OV_NO_PIECE || at->stands[g] != OV_STANDS_UNKNOWN)
            continue;
        ov_mesh_at(at->mesh, v, place);
        reach = fmin(reach, fmax(beyond(s, place) - s->options->spacing, 0.0));
    }
    return reach;
}

static ovoid_status find_groups(ov_surveyor *s, size_t n, const ov_survey_standing *standing,
                                ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    ov_sheet *const at = &s->sheet[n];
    group *groups = NULL;
    if (!at->mesh)
        return OVOID_OK;
    at->group_of = ov_alloc(s->context, at->mesh->vertices, sizeof *at->group_of, "pieces");
    if (!at->group_of)
        return OVOID_ERROR_MEMORY;
    at->groups = ov_sheet_unite(at, OV_ZONE_HALO, at->group_of);
    groups = ov_alloc(s->context, at->groups, sizeof *groups, "pieces");
    at->stands = ov_alloc(s->context, at->groups, sizeof *at->stands, "pieces");
    if (!groups || !at->stands) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    look_at_groups(s, at, groups);
    OV_TRY(ask_others(s, n, standing, groups, side));
    if (side->askings > 0)
        qsort(side->asked, side->askings, sizeof *side->asked, by_piece);
    for (size_t g = 0; g < at->groups; ++g) {
        at->stands[g] = standing_of(s, n, standing, &groups[g]);
        if (!standing && groups[g].piece != OV_NO_PIECE)
            side->piece[groups[g].piece].outer_supposed = at->stands[g] == OV_STANDS_OUTER;
    }
    at->reach = reach_of(s, at);
cleanup:
    free(groups);
    return status;
}

/* ---- triangles that count -------------------------------------------------------------------- */

static uint8_t stands_at(const ov_sheet *at, size_t triangle) {
    return at->stands[at->group_of[at->mesh->corners[3 * triangle]]];
}

typedef enum choice { SOURCES, TARGETS, OUTER_TARGETS, OTHER_TARGETS } choice;

/* Those in the cell, which are measured from, or those whose places are known, which are measured
 * to: of the whole surface, of what is known of the outer one, or of what is left. */
static ovoid_status choose(ov_surveyor *s, size_t n, choice what, ov_trail *trail) {
    const ov_sheet *const at = &s->sheet[n];
    const bool from = what == SOURCES;
    const bool all = what == SOURCES || what == TARGETS;
    bool *const chosen = ov_alloc(s->context, at->mesh->triangles, sizeof *chosen, "triangles");
    if (!chosen)
        return OVOID_ERROR_MEMORY;
    for (size_t t = 0; t < at->mesh->triangles; ++t)
        chosen[t] = at->zone[t] >= (from ? OV_ZONE_CELL : OV_ZONE_HALO) &&
                    (all || (stands_at(at, t) == OV_STANDS_OUTER) == (what != OTHER_TARGETS));
    const ovoid_status status = ov_trail_choose(s->context, at->mesh, chosen, trail);
    free(chosen);
    return status;
}

/* ---- sums ------------------------------------------------------------------------------------ */

typedef struct span {
    size_t side;
    bool outer;
    double reach; /* what is no further than this about the cell is all there */
    const ov_trail *from;
    const float *squared; /* of its vertices and centres */
    ov_survey_cell *cell;
} span;

static ovoid_status add_far(ov_surveyor *s, const span *of, const ov_survey_far *far) {
    ov_survey_cell *const cell = of->cell;
    const ovoid_status status = ov_grow(s->context, &cell->far, &cell->far_capacity, cell->fars + 1,
                                        sizeof *cell->far, "points that are far");
    if (status == OVOID_OK)
        cell->far[cell->fars++] = *far;
    return status;
}

static ovoid_status add_site(ov_surveyor *s, const span *of, const double at[3], double weight,
                             double squared, uint32_t piece, bool vertex) {
    const double distance = sqrt(squared);
    const ov_survey_far site = {.at = {at[0], at[1], at[2]},
                                .weight = weight,
                                .distance = distance,
                                .cell = s->options->cell,
                                .piece = piece,
                                .side = (uint8_t)of->side,
                                .outer = of->outer,
                                .vertex = vertex};
    if (!(distance <= of->reach - beyond(s, at)))
        return add_far(s, of, &site);
    ov_survey_settle(&site, of->cell);
    return OVOID_OK;
}

/* A third of a quarter of each triangle's area at its corners, three quarters at its centre, as in
 * distance.c. */
static ovoid_status add_sites(ov_surveyor *s, const span *of) {
    ovoid_status status = OVOID_OK;
    const ov_sheet *const at = &s->sheet[of->side];
    const ovoid_mesh *const mesh = at->mesh;
    float *const weight = ov_alloc(s->context, mesh->vertices, sizeof *weight, "distances");
    double place[3];
    if (!weight)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < of->from->triangles; ++k) {
        const size_t t = ov_trail_triangle(of->from, k);
        const uint32_t *const corner = mesh->corners + 3 * t;
        ov_content content = {0.0, 0.0};
        if (of->outer && stands_at(at, t) != OV_STANDS_OUTER)
            continue;
        ov_mesh_flat_triangle(mesh, t, s->origin, &content);
        for (size_t i = 0; i < 3; ++i)
            weight[corner[i]] += (float)(content.area / 12.0);
        ov_mesh_centre(mesh, t, place);
        OV_TRY(add_site(s, of, place, 0.75 * content.area, of->squared[of->from->vertices + k],
                        at->piece_of[corner[0]], false));
    }
    for (size_t k = 0; k < of->from->vertices; ++k) {
        const uint32_t v = ov_trail_vertex(of->from, k);
        if (of->outer && at->stands[at->group_of[v]] != OV_STANDS_OUTER)
            continue;
        ov_mesh_at(mesh, v, place);
        OV_TRY(add_site(s, of, place, weight[v], of->squared[k], at->piece_of[v], true));
    }
cleanup:
    free(weight);
    return status;
}

/* ---- measuring ------------------------------------------------------------------------------- */

/* squared gets the distances of these points from the triangles of side n that are chosen. */
static ovoid_status measure_sites(ov_surveyor *s, size_t n, choice what, const ov_sites *sites,
                                  float *squared) {
    ovoid_status status = OVOID_OK;
    ov_trail to = {0};
    for (size_t k = 0; k < sites->count; ++k)
        squared[k] = INFINITY;
    if (!s->sheet[n].mesh || sites->count == 0)
        return OVOID_OK;
    OV_TRY(choose(s, n, what, &to));
    if (to.triangles == 0)
        goto cleanup;
    OV_TRY(ov_facets_set(s->context, &s->facets, &to, s->origin));
    OV_TRY(ov_facets_distances(s->context, &s->meter, &s->facets, sites, squared));
cleanup:
    ov_trail_destroy(&to);
    return status;
}

/* What a distance has to become less by so as to have come from another triangle. */
#define NEARER_SHARE 1e-5f
#define NEARER_LEAST 1e-9f /* angstrom^2 */

static float a_little_more(float squared) {
    return squared + NEARER_SHARE * squared + NEARER_LEAST;
}

/* near[k]: whether the nearest triangle of side n may be one that is not of an outer component. */
static ovoid_status find_others(ov_surveyor *s, size_t n, const ov_sites *sites,
                                const float *squared, bool *near) {
    ovoid_status status = OVOID_OK;
    ov_trail to = {0};
    float *const bound = ov_alloc(s->context, sites->count, sizeof *bound, "distances");
    if (!bound)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < sites->count; ++k)
        bound[k] = a_little_more(squared[k]);
    OV_TRY(choose(s, n, OTHER_TARGETS, &to));
    OV_TRY(ov_facets_set(s->context, &s->facets, &to, s->origin));
    OV_TRY(ov_facets_nearer(s->context, &s->meter, &s->facets, sites, bound));
    for (size_t k = 0; k < sites->count; ++k)
        near[k] = bound[k] < a_little_more(squared[k]);
cleanup:
    ov_trail_destroy(&to);
    free(bound);
    return status;
}

/* Place k of the points of a trail, relative to the origin. */
static void place_of(const ov_surveyor *s, const ov_trail *trail, size_t k, float place[3]) {
    double at[3];
    if (k < trail->vertices)
        ov_mesh_at(trail->mesh, ov_trail_vertex(trail, k), at);
    else
        ov_mesh_centre(trail->mesh, ov_trail_triangle(trail, k - trail->vertices), at);
    for (size_t axis = 0; axis < 3; ++axis)
        place[axis] = (float)(at[axis] - s->origin[axis]);
}

/* Measures those for which again holds anew, to outer components alone. */
static ovoid_status measure_again(ov_surveyor *s, size_t n, const ov_trail *from, const bool *again,
                                  float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t count = from->vertices + from->triangles;
    size_t chosen = 0, next = 0;
    float *xyz = NULL, *found = NULL;
    for (size_t k = 0; k < count; ++k)
        chosen += again[k];
    xyz = ov_alloc(s->context, 3 * chosen, sizeof *xyz, "points of a mesh");
    found = ov_alloc(s->context, chosen, sizeof *found, "distances");
    if (!xyz || !found) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t k = 0; k < count; ++k)
        if (again[k])
            place_of(s, from, k, xyz + 3 * next++);
    const ov_sites sites = {.count = chosen, .xyz = xyz};
    OV_TRY(measure_sites(s, n, OUTER_TARGETS, &sites, found));
    next = 0;
    for (size_t k = 0; k < count; ++k)
        if (again[k])
            squared[k] = found[next++];
cleanup:
    free(xyz);
    free(found);
    return status;
}

/* Whether all of a surface within reach is of outer components, as far as is known. */
static bool is_all_outer(const ov_sheet *at) {
    for (size_t g = 0; at->mesh && g < at->groups; ++g)
        if (at->stands[g] != OV_STANDS_OUTER)
            return false;
    return true;
}

/* Whether point k of what is measured from is of an outer component. */
static bool is_outer_site(const ov_surveyor *s, const span *of, size_t k) {
    const ov_sheet *const at = &s->sheet[of->side];
    const size_t vertices = of->from->vertices;
    return k < vertices
               ? at->stands[at->group_of[ov_trail_vertex(of->from, k)]] == OV_STANDS_OUTER
               : stands_at(at, ov_trail_triangle(of->from, k - vertices)) == OV_STANDS_OUTER;
}

/* From distances to the whole other surface to those from its outer components: most are the same.
 */
static ovoid_status leave_others_out(ov_surveyor *s, const span *of, const ov_sites *sites,
                                     float *squared) {
    ovoid_status status = OVOID_OK;
    const size_t other = 1 - of->side;
    bool *const near = ov_alloc(s->context, sites->count, sizeof *near, "distances");
    if (!near)
        return OVOID_ERROR_MEMORY;
    OV_TRY(find_others(s, other, sites, squared, near));
    for (size_t k = 0; k < sites->count; ++k)
        near[k] = near[k] && is_outer_site(s, of, k);
    OV_TRY(measure_again(s, other, of->from, near, squared));
cleanup:
    free(near);
    return status;
}

/* How far what is measured from is from all of the other surface: found once. */
static ovoid_status find_squared(ov_surveyor *s, size_t n, const ov_sites *sites) {
    if (s->squared[n])
        return OVOID_OK;
    s->squared[n] = ov_alloc(s->context, sites->count, sizeof *s->squared[n], "distances");
    if (!s->squared[n])
        return OVOID_ERROR_MEMORY;
    return measure_sites(s, 1 - n, TARGETS, sites, s->squared[n]);
}

static bool is_in_cell(const ov_surveyor *s, size_t n) {
    return s->sheet[n].mesh && s->sheet[n].pieces > 0;
}

/* From side n to the other surface, and, in a copy of these distances, to its outer components
 * unless they are all there is; *squared: NULL where the whole surface will do. */
static ovoid_status find_spans(ov_surveyor *s, size_t n, bool outer, span *of, float **squared) {
    ovoid_status status = OVOID_OK;
    const ov_sites sites = {.count = of->from->vertices + of->from->triangles, .trail = of->from};
    OV_TRY(find_squared(s, n, &sites));
    of->squared = s->squared[n];
    if (!outer || is_all_outer(&s->sheet[1 - n]))
        return OVOID_OK;
    *squared = ov_copy(s->context, s->squared[n], sites.count, sizeof **squared, "distances");
    if (!*squared)
        return OVOID_ERROR_MEMORY;
    of->squared = *squared;
    OV_TRY(leave_others_out(s, of, &sites, *squared));
cleanup:
    return status;
}

static ovoid_status span_sides(ov_surveyor *s, size_t n, bool outer, ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    const ov_sheet *const other = &s->sheet[1 - n];
    ov_trail from = {0};
    span of = {.side = n, .outer = outer, .from = &from, .cell = cell};
    float *squared = NULL;
    of.reach = outer && other->mesh ? other->reach : s->options->halo;
    OV_TRY(choose(s, n, SOURCES, &from));
    OV_TRY(find_spans(s, n, outer, &of, &squared));
    OV_TRY(add_sites(s, &of));
cleanup:
    ov_trail_destroy(&from);
    free(squared);
    return status;
}

ovoid_status ov_spans_whole(ov_surveyor *s, ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < OV_SURVEY_SIDES && status == OVOID_OK; ++n)
        if (is_in_cell(s, n))
            status = span_sides(s, n, false, cell);
    return status;
}

ovoid_status ov_spans_outer(ov_surveyor *s, const ov_survey_standing *standing,
                            ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        OV_TRY(find_groups(s, n, standing, &cell->side[n]));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        if (is_in_cell(s, n))
            OV_TRY(span_sides(s, n, true, cell));
cleanup:
    return status;
}

/* ---- for others ------------------------------------------------------------------------------ */

/* The triangles in the cell of side n, or those of its outer components. */
static ovoid_status choose_own(ov_surveyor *s, size_t n, const ov_survey_standing *standing,
                               bool outer, ov_trail *trail) {
    const ov_sheet *const at = &s->sheet[n];
    const bool *const stands = standing->outer[n] + standing->first[n][s->options->cell];
    bool *const chosen = ov_alloc(s->context, at->mesh->triangles, sizeof *chosen, "triangles");
    if (!chosen)
        return OVOID_ERROR_MEMORY;
    for (size_t t = 0; t < at->mesh->triangles; ++t)
        chosen[t] = at->zone[t] == OV_ZONE_CELL &&
                    (!outer || stands[at->piece_of[at->mesh->corners[3 * t]]]);
    const ovoid_status status = ov_trail_choose(s->context, at->mesh, chosen, trail);
    free(chosen);
    return status;
}

/* Those of the points that are on the other side n, and want its outer components or all of it. */
static ovoid_status seek_one(ov_surveyor *s, size_t n, bool outer, const ov_trail *to,
                             ov_survey_far *far, size_t count) {
    ovoid_status status = OVOID_OK;
    size_t sites = 0;
    float *const xyz = ov_alloc(s->context, 3 * count, sizeof *xyz, "points that are far");
    float *const squared = ov_alloc(s->context, count, sizeof *squared, "distances");
    if (!xyz || !squared) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    for (size_t k = 0; k < count; ++k)
        if (far[k].side != n && far[k].outer == outer) {
            for (size_t axis = 0; axis < 3; ++axis)
                xyz[3 * sites + axis] = (float)(far[k].at[axis] - s->origin[axis]);
            squared[sites++] = (float)(far[k].distance * far[k].distance);
        }
    const ov_sites from = {.count = sites, .xyz = xyz};
    OV_TRY(ov_facets_set(s->context, &s->facets, to, s->origin));
    OV_TRY(ov_facets_nearer(s->context, &s->meter, &s->facets, &from, squared));
    for (size_t k = 0, site = 0; k < count; ++k)
        if (far[k].side != n && far[k].outer == outer) {
            far[k].distance = fmin(far[k].distance, sqrt((double)squared[site]));
            ++site;
        }
cleanup:
    free(xyz);
    free(squared);
    return status;
}

ovoid_status ov_spans_seek(ov_surveyor *s, const ov_survey_standing *standing, ov_survey_far *far,
                           size_t count) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        for (int outer = 0; outer < 2; ++outer) {
            ov_trail to = {0};
            if (!s->sheet[n].mesh)
                continue;
            status = choose_own(s, n, standing, outer, &to);
            if (status == OVOID_OK && to.triangles > 0)
                status = seek_one(s, n, outer, &to, far, count);
            ov_trail_destroy(&to);
            OV_TRY(status);
        }
cleanup:
    return status;
}
