#include "measure/surveyor.h"

#include "base/parallel.h"
#include "base/progress.h"
#include "mesh/exposed.h"
#include "mesh/union.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Distances below this share of what makes a spot are only bounded. */
#define ENOUGH 0.8
/* Vertices this near to a face of the cell, in lattice steps, may be shared with another cell. */
#define SEAM 2.0
/* Steps of the lattice are cut so fine to tell vertices apart: far above rounding, far below what
 * lies between two sheets. */
#define FINE 256.0
/* What rounding may lift a vertex by over a plane of the lattice, in its steps. */
#define LEVEL 1e-4
#define NO_IMAGE UINT32_MAX
/* Terms this near to a place, angstrom, are asked which is the largest there: atoms' surfaces are
 * within half of it. Where there are none, the nearest centre counts, within the second distance.
 */
#define LARGEST_WITHIN 4.0
#define NEAREST_WITHIN 24.0

/* ---- the surfaces ---------------------------------------------------------------------------- */

static void sheet_destroy(ov_sheet *s) {
    ov_trail_destroy(&s->trail);
    ov_facets_destroy(&s->facets);
    ovoid_mesh_destroy(&s->mesh);
    free(s->zone);
    free(s->distance);
    free(s->piece_of);
    free(s->group_of);
    free(s->stands);
}

static ovoid_status make_mesh(ov_surveyor *s, const ov_body *bodies, size_t count, ov_sheet *made) {
    const double reach = s->options->halo + OV_SURVEY_ROOM * s->options->spacing;
    ovoid_mesh_options meshing;
    double low[3], high[3];
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    meshing.isovalue = s->options->isovalue;
    meshing.spacing = s->options->spacing;
    meshing.vertices = s->options->vertices;
    for (size_t k = 0; k < 3; ++k) {
        low[k] = s->low[k] - reach;
        high[k] = s->high[k] + reach;
    }
    if (s->options->halo > 0.0)
        ov_marcher_clip(s->marcher, low, high);
    const ovoid_status status =
        count == 0 ? OVOID_ERROR_EMPTY
                   : ov_mesh_bodies_light(s->context, s->marcher, bodies, count, &meshing,
                                          s->origin, &s->watch, true, &made->mesh);
    return status == OVOID_ERROR_EMPTY ? OVOID_OK : status;
}

static ovoid_status mesh_sheet(ov_surveyor *s, const ov_body *bodies, size_t count,
                               ov_sheet *made) {
    ovoid_status status = OVOID_OK;
    OV_TRY(make_mesh(s, bodies, count, made));
    if (!made->mesh)
        return OVOID_OK;
    OV_TRY(ov_mesh_check(s->context, made->mesh));
    made->zone = ov_alloc(s->context, made->mesh->triangles, sizeof *made->zone, "pieces");
    made->distance = ov_alloc(s->context, made->mesh->vertices, sizeof(float), "distances");
    made->piece_of = ov_alloc(s->context, made->mesh->vertices, sizeof(uint32_t), "pieces");
    if (!made->zone || !made->distance || !made->piece_of)
        status = OVOID_ERROR_MEMORY;
cleanup:
    return status;
}

/* ---- distances of vertices, where sums are not wanted ---------------------------------------- */

static ovoid_status lay_facets(ov_surveyor *s, ov_sheet *at) {
    ovoid_status status = OVOID_OK;
    if (!at->mesh)
        return OVOID_OK;
    OV_TRY(ov_trail_create(s->context, at->mesh, false, &at->trail));
    OV_TRY(ov_facets_set(s->context, &at->facets, &at->trail, s->origin));
cleanup:
    return status;
}

static ovoid_status measure_sheet(ov_surveyor *s, ov_sheet *from, ov_sheet *to) {
    if (!from->mesh)
        return OVOID_OK;
    if (!to->mesh) {
        for (size_t v = 0; v < from->mesh->vertices; ++v)
            from->distance[v] = INFINITY;
        return OVOID_OK;
    }
    const bool exact = s->options->exact || isinf(s->options->least);
    s->meter.enough = exact ? 0.0 : ENOUGH * s->options->least;
    const ovoid_status status = ov_vertex_distances_begin(s->context, &s->meter, &to->facets,
                                                          &from->facets, from->distance);
    if (status != OVOID_OK) {
        ov_later_end(s->context, &s->meter.later);
        return status;
    }
    return ov_vertex_distances_end(s->context, &s->meter, &from->facets, from->distance);
}

static ovoid_status measure_vertices(ov_surveyor *s) {
    ovoid_status status = OVOID_OK;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        OV_TRY(lay_facets(s, &s->sheet[n]));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        OV_TRY(measure_sheet(s, &s->sheet[n], &s->sheet[1 - n]));
cleanup:
    return status;
}

/* ---- what lies in the cell ------------------------------------------------------------------- */

/* The image whose term is the largest at a place. NO_IMAGE far from all: ellipsoids that are felt
 * near the unit make surfaces where others, which are not, are missing. */
static uint32_t image_at(const ov_surveyor *s, const double at[3]) {
    uint32_t near[2 * OV_NEAR_MAX], largest = OV_NOBODY;
    const size_t count = ov_grid_near(&s->largest, at, UINT32_MAX, near);
    double most = -INFINITY;
    for (size_t n = 0; n < count; ++n) {
        const double value = ov_quadric_log_value(&s->original[near[n]].quadric, at);
        if (value > most) {
            most = value;
            largest = near[n];
        }
    }
    for (size_t k = 0; k < OV_SURVEY_NEAREST && largest == OV_NOBODY; ++k)
        largest =
            ov_grid_nearest(&s->nearest[k], s->original->quadric.centre, sizeof *s->original, at);
    return largest == OV_NOBODY ? NO_IMAGE : s->options->image[largest];
}

/* Cells as wide as terms count would have most of them asked for each place. */
static ovoid_status tell_images_apart(ov_surveyor *s) {
    ovoid_status status = OVOID_OK;
    double reach = s->options->nearest > 0.0 ? s->options->nearest : NEAREST_WITHIN;
    if (!s->options->image || s->original_count == 0)
        return OVOID_OK;
    OV_TRY(ov_grid_of(s->context, s->original->quadric.centre, sizeof *s->original,
                      s->original_count, LARGEST_WITHIN, &s->largest));
    for (size_t k = OV_SURVEY_NEAREST; k-- > 0; reach *= 0.5)
        OV_TRY(ov_grid_of(s->context, s->original->quadric.centre, sizeof *s->original,
                          s->original_count, reach, &s->nearest[k]));
cleanup:
    return status;
}

/* Whether all of a triangle lies in a plane across an axis, in steps of the lattice, but for
 * rounding. */
static bool is_level(const ov_surveyor *s, const ovoid_mesh *mesh, size_t triangle, size_t axis,
                     double plane) {
    for (size_t i = 0; i < 3; ++i) {
        double at[3];
        ov_mesh_at(mesh, mesh->corners[3 * triangle + i], at);
        if (fabs(at[axis] / s->options->spacing - plane) > LEVEL)
            return false;
    }
    return true;
}

/* Where a triangle counts as being: at its centre or, where each has to be in one cell and no
 * other, in the middle of its cube of the lattice, of which no rounding makes another one. */
static void find_place(const ov_surveyor *s, const ovoid_mesh *mesh, size_t triangle,
                       double place[3]) {
    ov_mesh_centre(mesh, triangle, place);
    for (size_t k = 0; s->options->halo > 0.0 && k < 3; ++k) {
        const double steps = place[k] / s->options->spacing, plane = round(steps);
        const double first = is_level(s, mesh, triangle, k, plane) ? plane : floor(steps);
        place[k] = (first + 0.5) * s->options->spacing;
    }
}

/* Whether a place that is less than `off` away along each axis is in the cell: 1, or 0 where it is
 * not; -1: that depends on where it is. */
static int is_surely_inside(const ov_surveyor *s, const double at[3], double off) {
    int inside = 1;
    for (size_t k = 0; k < 3; ++k) {
        if (at[k] < s->low[k] - off || at[k] > s->high[k] + off)
            return 0;
        if (at[k] < s->low[k] + off || at[k] > s->high[k] - off)
            inside = -1;
    }
    return inside;
}

/* The middle of a cube is less than a step from the centre of any triangle in it, and from that of
 * one in its low face. */
static bool is_inside(const ov_surveyor *s, const ovoid_mesh *mesh, size_t triangle) {
    double centre[3];
    ov_mesh_centre(mesh, triangle, centre);
    int inside = is_surely_inside(s, centre, s->options->spacing);
    if (inside < 0) {
        find_place(s, mesh, triangle, centre);
        inside = 1;
        for (size_t k = 0; k < 3; ++k)
            inside = inside && centre[k] >= s->low[k] && centre[k] < s->high[k];
    }
    if (inside && s->options->image) {
        find_place(s, mesh, triangle, centre);
        return image_at(s, centre) == 0;
    }
    return inside;
}

/* Whether a triangle that is not in the cell is near enough for its place to be right: as far out
 * as one reaches that has a point in the halo. */
static bool is_near(const ov_surveyor *s, const ovoid_mesh *mesh, size_t triangle) {
    const double reach = s->options->halo + s->options->spacing;
    double centre[3];
    ov_mesh_centre(mesh, triangle, centre);
    for (size_t k = 0; k < 3; ++k)
        if (centre[k] < s->low[k] - reach || centre[k] > s->high[k] + reach)
            return false;
    return s->options->halo > 0.0;
}

/* Triangles whose zones are found one after the other. */
#define STRETCH 4096

typedef struct zones {
    const ov_surveyor *surveyor;
    ov_sheet *sheet;
} zones;

static void find_some_zones(size_t k, void *user) {
    const zones *const of = user;
    const ov_surveyor *const s = of->surveyor;
    const ovoid_mesh *const mesh = of->sheet->mesh;
    const size_t end = (k + 1) * STRETCH < mesh->triangles ? (k + 1) * STRETCH : mesh->triangles;
    for (size_t t = k * STRETCH; t < end; ++t)
        of->sheet->zone[t] = is_inside(s, mesh, t) ? OV_ZONE_CELL
                             : is_near(s, mesh, t) ? OV_ZONE_HALO
                                                   : OV_ZONE_BEYOND;
}

static void find_zones(const ov_surveyor *s, ov_sheet *at) {
    zones of = {.surveyor = s, .sheet = at};
    ov_parallel((at->mesh->triangles + STRETCH - 1) / STRETCH, find_some_zones, &of);
}

size_t ov_sheet_unite(const ov_sheet *at, int least, uint32_t *of) {
    const ovoid_mesh *const mesh = at->mesh;
    size_t sets = 0;
    for (size_t v = 0; v < mesh->vertices; ++v)
        of[v] = OV_NO_PIECE;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        if (at->zone[t] < least)
            continue;
        for (size_t i = 0; i < 3; ++i)
            if (of[corner[i]] == OV_NO_PIECE)
                of[corner[i]] = corner[i];
        ov_unite(of, corner[0], corner[1]);
        ov_unite(of, corner[0], corner[2]);
    }
    for (size_t v = 0; v < mesh->vertices; ++v) /* parents come first */
        if (of[v] != OV_NO_PIECE)
            of[v] = of[v] == v ? (uint32_t)sets++ : of[of[v]];
    return sets;
}

/* What hangs together by the triangles in the cell: what does so beyond it only may be an artefact
 * of where its surroundings end. Numbers the pieces. */
static void find_pieces(ov_sheet *at) {
    at->pieces = ov_sheet_unite(at, OV_ZONE_CELL, at->piece_of);
}

/* Each piece has a place of its own that its volume counts from: what rounding leaves open between
 * cells is little beside a cavity then, however far from everything's middle it is. */
static void add_contents(const ov_surveyor *s, const ov_sheet *at, ov_survey_side *side) {
    const bool exact = s->options->vertices == OVOID_VERTEX_EXACT && !s->options->flat;
    for (size_t v = 0; v < at->mesh->vertices; ++v)
        if (at->piece_of[v] != OV_NO_PIECE)
            ov_mesh_at(at->mesh, v, side->piece[at->piece_of[v]].at);
    for (size_t t = 0; t < at->mesh->triangles; ++t) {
        ov_content content = {0.0, 0.0};
        if (at->zone[t] != OV_ZONE_CELL)
            continue;
        ov_survey_piece *const piece = &side->piece[at->piece_of[at->mesh->corners[3 * t]]];
        (exact ? ov_mesh_smooth_triangle : ov_mesh_flat_triangle)(at->mesh, t, piece->at, &content);
        (exact ? ov_mesh_smooth_vector : ov_mesh_flat_vector)(at->mesh, t, piece->vector);
        piece->area += content.area;
        piece->volume += content.volume;
    }
}

static bool is_at_seam(const ov_surveyor *s, const double at[3]) {
    const double reach = SEAM * s->options->spacing;
    for (size_t k = 0; k < 3; ++k)
        if (fabs(at[k] - s->low[k]) <= reach || fabs(at[k] - s->high[k]) <= reach)
            return true;
    return false;
}

uint64_t ov_survey_key(const ov_surveyor *s, const double at[3]) {
    int64_t fine[3];
    for (size_t k = 0; k < 3; ++k)
        fine[k] = llround(at[k] / s->options->spacing * FINE);
    return ov_hash(fine, sizeof fine);
}

ovoid_status ov_survey_add_key(ovoid_context *context, uint64_t key, uint32_t piece,
                               ov_survey_seam **list, size_t *count, size_t *capacity) {
    const ovoid_status status =
        ov_grow(context, list, capacity, *count + 1, sizeof **list, "seams between parts");
    if (status == OVOID_OK)
        (*list)[(*count)++] = (ov_survey_seam){.key = key, .piece = piece};
    return status;
}

static ovoid_status add_seam(const ov_surveyor *s, const double at[3], uint32_t piece,
                             ov_survey_side *side) {
    return ov_survey_add_key(s->context, ov_survey_key(s, at), piece, &side->seam, &side->seams,
                             &side->seam_capacity);
}

static ovoid_status add_port(const ov_surveyor *s, const ovoid_mesh *mesh, size_t v, uint32_t piece,
                             uint32_t image, ov_survey_side *side) {
    const ovoid_status status = ov_grow(s->context, &side->port, &side->port_capacity,
                                        side->ports + 1, sizeof *side->port, "seams between units");
    if (status != OVOID_OK)
        return status;
    ov_survey_port *const port = &side->port[side->ports++];
    *port = (ov_survey_port){.image = image, .piece = piece};
    ov_mesh_at(mesh, v, port->at);
    memcpy(port->normal, mesh->normals + 3 * v, sizeof port->normal);
    return OVOID_OK;
}

/* Vertices of pieces that triangles of other images have, too, once for each such image. */
static ovoid_status add_ports(const ov_surveyor *s, const ov_sheet *from, ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    const ovoid_mesh *const mesh = from->mesh;
    uint32_t *const last = ov_alloc(s->context, mesh->vertices, sizeof *last, "seams");
    if (!last)
        return OVOID_ERROR_MEMORY;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        double centre[3];
        bool any = false;
        for (size_t i = 0; i < 3; ++i)
            any = any || from->piece_of[corner[i]] != OV_NO_PIECE;
        if (from->zone[t] == OV_ZONE_CELL || !any)
            continue;
        find_place(s, mesh, t, centre);
        const uint32_t image = image_at(s, centre);
        for (size_t i = 0; i < 3 && image > 0 && image != NO_IMAGE; ++i) {
            const uint32_t v = corner[i], piece = from->piece_of[v];
            if (piece == OV_NO_PIECE || last[v] == image)
                continue;
            last[v] = image;
            OV_TRY(add_port(s, mesh, v, piece, image, side));
        }
    }
cleanup:
    free(last);
    return status;
}

static ovoid_status add_spot(const ov_surveyor *s, const double at[3], double distance,
                             uint32_t piece, ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    OV_TRY(ov_grow(s->context, &side->spot, &side->spot_capacity, side->spots + 1,
                   sizeof *side->spot, "spots"));
    OV_TRY(ov_grow(s->context, &side->spot_on, &side->spot_on_capacity, side->spots + 1,
                   sizeof *side->spot_on, "spots"));
    side->spot[side->spots] = (ov_spot){.at = {at[0], at[1], at[2]}, .distance = distance};
    side->spot_on[side->spots++] = piece;
cleanup:
    return status;
}

/* A vertex of a piece, wherever it is. */
static ovoid_status record_vertex(ov_surveyor *s, const ov_sheet *from, size_t v,
                                  ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    const uint32_t piece = from->piece_of[v];
    const double distance = from->distance[v]; /* zeros unless it was measured */
    double at[3];
    ov_mesh_at(from->mesh, v, at);
    side->piece[piece].furthest = fmax(side->piece[piece].furthest, distance);
    if (is_at_seam(s, at))
        OV_TRY(add_seam(s, at, piece, side));
    if (distance >= s->options->least)
        OV_TRY(add_spot(s, at, distance, piece, side));
cleanup:
    return status;
}

/* ---- necks ----------------------------------------------------------------------------------- */

typedef struct necks {
    ov_surveyor *surveyor;
    const ov_sheet *sheet;
    ov_survey_side *side;
} necks;

/* The same for a pair of vertices whichever comes first, and in each cell. */
static uint64_t key_of_pair(const necks *all, uint32_t v, uint32_t w) {
    const uint32_t vertex[2] = {v, w};
    uint64_t key = 0;
    for (size_t n = 0; n < 2; ++n) {
        double at[3];
        ov_mesh_at(all->sheet->mesh, vertex[n], at);
        key += ov_survey_key(all->surveyor, at);
    }
    return key;
}

static ovoid_status add_neck(uint32_t v, uint32_t w, void *user) {
    ovoid_status status = OVOID_OK;
    const necks *const all = user;
    const uint64_t key = key_of_pair(all, v, w);
    const uint32_t piece[2] = {all->sheet->piece_of[v], all->sheet->piece_of[w]};
    for (size_t n = 0; n < 2; ++n)
        if (piece[n] != OV_NO_PIECE)
            OV_TRY(ov_survey_add_key(all->surveyor->context, key, piece[n], &all->side->neck,
                                     &all->side->necks, &all->side->neck_capacity));
cleanup:
    return status;
}

static int joined_zone(const ov_surveyor *s) {
    return s->options->halo > 0.0 ? OV_ZONE_HALO : OV_ZONE_BEYOND;
}

/* Sets whose surface is closed about matter become one, the first of them: they are outer ones
 * whatever is elsewhere, and there may be many, such as waters. */
static ovoid_status unite_outer(const ov_surveyor *s, const ov_sheet *from, size_t sets,
                                uint32_t *set_of) {
    const ovoid_mesh *const mesh = from->mesh;
    uint32_t first = OV_NO_SET;
    double *const volume = ov_alloc(s->context, sets, sizeof *volume, "pieces");
    if (!volume)
        return OVOID_ERROR_MEMORY;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        ov_content content = {0.0, 0.0};
        ov_mesh_flat_triangle(mesh, t, s->origin, &content);
        for (size_t i = 0; i < 3; ++i)
            if (set_of[corner[i]] != OV_NO_SET)
                volume[set_of[corner[i]]] +=
                    from->zone[t] >= joined_zone(s) ? content.volume / 3.0 : -INFINITY;
    }
    for (size_t v = 0; v < mesh->vertices; ++v)
        if (set_of[v] != OV_NO_SET && volume[set_of[v]] > 0.0)
            set_of[v] = first = first == OV_NO_SET ? set_of[v] : first;
    free(volume);
    return OVOID_OK;
}

/* What hangs together in cell and halo, or in all of a sheet that has no halo, has no neck. */
static ovoid_status find_necks(ov_surveyor *s, const ov_sheet *from, ov_survey_side *side) {
    const ovoid_mesh *const mesh = from->mesh;
    ovoid_status status = OVOID_OK;
    necks all = {.surveyor = s, .sheet = from, .side = side};
    uint32_t *const set_of = ov_alloc(s->context, mesh->vertices, sizeof *set_of, "pieces");
    if (!set_of)
        return OVOID_ERROR_MEMORY;
    const size_t sets = ov_sheet_unite(from, joined_zone(s), set_of);
    if (sets > 1)
        OV_TRY(unite_outer(s, from, sets, set_of));
    OV_TRY(ov_mesh_near_sets(s->context, mesh, set_of, sets, OV_NECK * s->options->spacing,
                             add_neck, &all));
cleanup:
    free(set_of);
    return status;
}

static ovoid_status record_sheet(ov_surveyor *s, size_t n, ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    const ov_sheet *const from = &s->sheet[n];
    ov_survey_side *const side = &cell->side[n];
    if (!from->mesh)
        return OVOID_OK;
    side->missed = from->mesh->missed;
    side->pieces = from->pieces;
    side->piece = ov_alloc(s->context, side->pieces, sizeof *side->piece, "pieces of a surface");
    if (!side->piece)
        return OVOID_ERROR_MEMORY;
    add_contents(s, from, side);
    for (size_t v = 0; v < from->mesh->vertices; ++v)
        if (from->piece_of[v] != OV_NO_PIECE)
            OV_TRY(record_vertex(s, from, v, side));
    OV_TRY(find_necks(s, from, side));
    if (s->options->sums)
        OV_TRY(ov_spans_mark(s, n, side));
    if (s->options->image)
        OV_TRY(add_ports(s, from, side));
cleanup:
    return status;
}

/* The middle of some terms, which offsets are counted from. */
static void middle_of(const ov_body *bodies, size_t count, double origin[3]) {
    for (size_t k = 0; k < 3; ++k) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; ++i) {
            low = fmin(low, bodies[i].quadric.centre[k]);
            high = fmax(high, bodies[i].quadric.centre[k]);
        }
        origin[k] = count > 0 ? 0.5 * low + 0.5 * high : 0.0;
    }
}

/* ---- what is kept ---------------------------------------------------------------------------- */

struct ov_survey_kept {
    double origin[3];
    ov_sheet sheet[OV_SURVEY_SIDES];
    float *squared[OV_SURVEY_SIDES];
    size_t bytes;
};

/* What meshes and distances take, which is most of it. */
static size_t bytes_of(const ov_sheet *at) {
    const size_t each = 3 * sizeof(float) + sizeof *at->piece_of + sizeof(float);
    const size_t triangle = 3 * sizeof(uint32_t) + sizeof *at->zone + sizeof(float);
    return at->mesh ? each * at->mesh->vertices + triangle * at->mesh->triangles : 0;
}

/* From the surveyor, without what belongs to the device or can be found again. */
static void move_to_kept(ov_surveyor *s, ov_survey_kept *kept) {
    memcpy(kept->origin, s->origin, sizeof kept->origin);
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ov_sheet *const at = &s->sheet[n];
        kept->sheet[n] = (ov_sheet){
            .mesh = at->mesh, .zone = at->zone, .piece_of = at->piece_of, .pieces = at->pieces};
        kept->squared[n] = s->squared[n];
        kept->bytes += bytes_of(at);
        if (at->mesh)
            ov_mesh_lighten(at->mesh);
        at->mesh = NULL;
        at->zone = NULL;
        at->piece_of = NULL;
        s->squared[n] = NULL;
    }
}

static void move_from_kept(ov_survey_kept *kept, ov_surveyor *s) {
    memcpy(s->origin, kept->origin, sizeof s->origin);
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        s->sheet[n] = kept->sheet[n];
        s->squared[n] = kept->squared[n];
        kept->sheet[n] = (ov_sheet){0};
        kept->squared[n] = NULL;
    }
    kept->bytes = 0;
}

/* Without memory for it nothing is kept. */
static ov_survey_kept *keep(ov_surveyor *s) {
    ov_survey_kept *const made = ov_alloc(NULL, 1, sizeof *made, "surfaces");
    if (made)
        move_to_kept(s, made);
    return made;
}

size_t ov_survey_kept_bytes(const ov_survey_kept *kept) {
    return kept ? kept->bytes : 0;
}

void ov_survey_kept_destroy(ov_survey_kept **kept) {
    if (!*kept)
        return;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        sheet_destroy(&(*kept)->sheet[n]);
        free((*kept)->squared[n]);
    }
    free(*kept);
    *kept = NULL;
}

/* ---- surveying ------------------------------------------------------------------------------- */

/* Meshes both surfaces and finds their pieces. The surveyor is to be closed, after a failure too.
 */
static ovoid_status open_survey(ov_surveyor *s, const ov_survey_terms *terms) {
    ovoid_status status = OVOID_OK;
    const size_t first = terms->count[0] > 0 ? 0 : 1;
    const double began = ov_seconds();
    middle_of(terms->body[first], terms->count[first], s->origin);
    s->meter.watch = &s->watch;
    s->original = terms->body[0];
    s->original_count = terms->count[0];
    OV_TRY(tell_images_apart(s));
    OV_TRY(ov_marcher_create(s->context, &s->marcher));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        OV_TRY(mesh_sheet(s, terms->body[n], terms->count[n], &s->sheet[n]));
        if (!s->sheet[n].mesh)
            continue;
        find_zones(s, &s->sheet[n]);
        find_pieces(&s->sheet[n]);
    }
    ov_marcher_destroy(&s->marcher); /* distances take as much, and have no use for it */
    ov_buffers_trim(s->context);
    if (s->options->meshing)
        *s->options->meshing += ov_seconds() - began;
cleanup:
    return status;
}

static void close_survey(ov_surveyor *s) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        sheet_destroy(&s->sheet[n]);
        free(s->squared[n]);
    }
    ov_facets_destroy(&s->facets);
    ov_grid_destroy(&s->largest);
    for (size_t k = 0; k < OV_SURVEY_NEAREST; ++k)
        ov_grid_destroy(&s->nearest[k]);
    ov_meter_destroy(&s->meter);
    ov_marcher_destroy(&s->marcher);
}

ovoid_status ov_survey_bodies(ovoid_context *context, const ov_survey_options *options,
                              const ov_survey_terms *terms, const double low[3],
                              const double high[3], ov_survey_cell *cell, ov_survey_kept **kept) {
    ovoid_status status = OVOID_OK;
    ov_survey_cell made = {0};
    ov_surveyor s = {.context = context, .options = options, .low = low, .high = high};
    OV_TRY(open_survey(&s, terms));
    if (!options->sums && !options->contents)
        OV_TRY(measure_vertices(&s));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        OV_TRY(record_sheet(&s, n, &made));
    if (options->sums)
        OV_TRY(ov_spans_whole(&s, &made));
    if (options->sums && !kept)
        OV_TRY(ov_spans_outer(&s, NULL, &made));
    made.outer_later = options->sums && kept;
    if (kept)
        *kept = keep(&s);
cleanup:
    close_survey(&s);
    if (status == OVOID_OK)
        *cell = made;
    else
        ov_survey_cell_destroy(&made);
    return status;
}

ovoid_status ov_survey(ovoid_context *context, const ov_survey_options *options,
                       const ov_quadric *original, size_t original_count, const ov_quadric *model,
                       size_t model_count, const double low[3], const double high[3],
                       ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    ov_body *body[OV_SURVEY_SIDES] = {NULL, NULL};
    OV_TRY(ov_bodies_of_quadrics(context, original, original_count, &body[0]));
    OV_TRY(ov_bodies_of_quadrics(context, model, model_count, &body[1]));
    const ov_survey_terms terms = {{body[0], body[1]}, {original_count, model_count}};
    OV_TRY(ov_survey_bodies(context, options, &terms, low, high, cell, NULL));
cleanup:
    free(body[0]);
    free(body[1]);
    return status;
}

/* ---- once more ------------------------------------------------------------------------------- */

/* With the surfaces that were kept, or else anew. */
static ovoid_status open_again(ov_surveyor *s, const ov_survey_terms *terms, ov_survey_kept *kept) {
    if (!kept)
        return open_survey(s, terms);
    move_from_kept(kept, s);
    s->meter.watch = &s->watch;
    return OVOID_OK;
}

static void close_again(ov_surveyor *s, ov_survey_kept *kept) {
    if (kept)
        move_to_kept(s, kept);
    close_survey(s);
}

/* The pieces are those that the cell had; all that is known of outer surfaces is forgotten. */
static ovoid_status forget_outer(const ov_surveyor *s, ov_survey_cell *cell) {
    size_t kept = 0;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        ov_survey_side *const side = &cell->side[n];
        if (side->pieces != s->sheet[n].pieces)
            return ov_fail(s->context, OVOID_ERROR_NUMERIC,
                           "the device made another mesh of a surface than before");
        for (size_t p = 0; p < side->pieces; ++p)
            side->piece[p].outer = (ov_survey_sums){0};
    }
    for (size_t k = 0; k < cell->fars; ++k)
        if (!cell->far[k].outer)
            cell->far[kept++] = cell->far[k];
    cell->fars = kept;
    return OVOID_OK;
}

ovoid_status ov_survey_again(ovoid_context *context, const ov_survey_options *options,
                             const ov_survey_terms *terms, const double low[3],
                             const double high[3], const ov_survey_standing *standing,
                             ov_survey_kept *kept, ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    ov_surveyor s = {.context = context, .options = options, .low = low, .high = high};
    OV_TRY(open_again(&s, terms, kept));
    OV_TRY(forget_outer(&s, cell));
    OV_TRY(ov_spans_outer(&s, standing, cell));
    cell->outer_later = false;
cleanup:
    close_again(&s, kept);
    return status;
}

ovoid_status ov_survey_seek(ovoid_context *context, const ov_survey_options *options,
                            const ov_survey_terms *terms, const double low[3], const double high[3],
                            const ov_survey_standing *standing, const ov_survey_cell *cell,
                            ov_survey_kept *kept, ov_survey_far *far, size_t count) {
    ovoid_status status = OVOID_OK;
    ov_surveyor s = {.context = context, .options = options, .low = low, .high = high};
    OV_TRY(open_again(&s, terms, kept));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        if (cell->side[n].pieces != s.sheet[n].pieces)
            OV_TRY(ov_fail(context, OVOID_ERROR_NUMERIC,
                           "the device made another mesh of a surface than before"));
    OV_TRY(ov_spans_seek(&s, standing, far, count));
cleanup:
    close_again(&s, kept);
    return status;
}

void ov_survey_cell_destroy(ov_survey_cell *cell) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        free(cell->side[n].piece);
        free(cell->side[n].seam);
        free(cell->side[n].port);
        free(cell->side[n].spot);
        free(cell->side[n].spot_on);
        free(cell->side[n].mark);
        free(cell->side[n].asked);
        free(cell->side[n].neck);
    }
    free(cell->far);
    *cell = (ov_survey_cell){0};
}
