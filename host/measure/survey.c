#include "measure/survey.h"

#include "base/progress.h"
#include "mesh/union.h"
#include "model/factor.h"
#include "neighbours/neighbours.h"

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
#define NO_PIECE UINT32_MAX
#define NO_IMAGE UINT32_MAX
/* Terms this near to a place, angstrom, are asked which is the largest there: atoms' surfaces are
 * within half of it. Where there are none, the nearest centre counts, within the second distance.
 */
#define LARGEST_WITHIN 4.0
#define NEAREST_WITHIN 24.0
/* In lattice steps: an image's vertices at the seam between a unit and its image lie this near to
 * the unit's own, which are of another lattice, and look the same way to within this cosine. */
#define PORT 2.0
#define PORT_COSINE 0.7

/* ---- one cell -------------------------------------------------------------------------------- */

/* One of the surfaces in the cell at hand. */
typedef struct sheet {
    ovoid_mesh *mesh;   /* NULL: there is none */
    float *distance;    /* of its vertices from the other one */
    uint32_t *piece_of; /* of its vertices; NO_PIECE: of no triangle in the cell */
    bool *inside;       /* of its triangles: whether they are in the cell */
    ov_trail trail;
    ov_facets facets;
} sheet;

static void sheet_destroy(sheet *s) {
    ov_trail_destroy(&s->trail);
    ov_facets_destroy(&s->facets);
    ovoid_mesh_destroy(&s->mesh);
    free(s->distance);
    free(s->piece_of);
    free(s->inside);
}

typedef struct surveyor {
    ovoid_context *context;
    const ov_survey_options *options;
    const double *low, *high;
    double origin[3];
    const ov_quadric *original;
    size_t original_count;
    ov_grid largest, nearest; /* the original's terms, where images have to be told apart */
    ov_marcher *marcher;
    ov_meter meter;
    sheet sheet[OV_SURVEY_SIDES];
} surveyor;

static ovoid_status mesh_sheet(surveyor *s, const ov_quadric *quadrics, size_t count, sheet *made) {
    ovoid_status status = OVOID_OK;
    ovoid_mesh_options meshing;
    ovoid_mesh_options_init(&meshing, sizeof meshing);
    meshing.isovalue = s->options->isovalue;
    meshing.spacing = s->options->spacing;
    ov_body *bodies = NULL;
    OV_TRY(ov_bodies_of_quadrics(s->context, quadrics, count, &bodies));
    status = count == 0 ? OVOID_ERROR_EMPTY
                        : ov_mesh_bodies_light(s->context, s->marcher, bodies, count, &meshing,
                                               s->origin, NULL, true, &made->mesh);
    free(bodies);
    if (status != OVOID_OK)
        return status == OVOID_ERROR_EMPTY ? OVOID_OK : status;
    OV_TRY(ov_mesh_finish(s->context, made->mesh));
    made->distance = ov_alloc(s->context, made->mesh->vertices, sizeof(float), "distances");
    made->piece_of = ov_alloc(s->context, made->mesh->vertices, sizeof(uint32_t), "pieces");
    made->inside = ov_alloc(s->context, made->mesh->triangles, sizeof(bool), "pieces");
    if (!made->distance || !made->piece_of || !made->inside) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_trail_create(s->context, made->mesh, false, &made->trail));
    OV_TRY(ov_facets_set(s->context, &made->facets, &made->trail, s->origin));
cleanup:
    return status;
}

static ovoid_status measure_sheet(surveyor *s, sheet *from, sheet *to) {
    if (!from->mesh)
        return OVOID_OK;
    if (!to->mesh) {
        for (size_t v = 0; v < from->mesh->vertices; ++v)
            from->distance[v] = INFINITY;
        return OVOID_OK;
    }
    s->meter.enough = isinf(s->options->least) ? 0.0 : ENOUGH * s->options->least;
    const ovoid_status status = ov_vertex_distances_begin(s->context, &s->meter, &to->facets,
                                                          &from->facets, from->distance);
    if (status != OVOID_OK) {
        ov_later_end(s->context, &s->meter.later);
        return status;
    }
    return ov_vertex_distances_end(s->context, &s->meter, &from->facets, from->distance);
}

/* The image whose term is the largest at a place. NO_IMAGE far from all: ellipsoids that are felt
 * near the unit make surfaces where others, which are not, are missing. */
static uint32_t image_at(const surveyor *s, const double at[3]) {
    uint32_t near[2 * OV_NEAR_MAX], largest = OV_NOBODY;
    const size_t count = ov_grid_near(&s->largest, at, UINT32_MAX, near);
    double most = -INFINITY;
    for (size_t n = 0; n < count; ++n) {
        const double value = ov_quadric_log_value(&s->original[near[n]], at);
        if (value > most) {
            most = value;
            largest = near[n];
        }
    }
    if (largest == OV_NOBODY)
        largest = ov_grid_nearest(&s->nearest, s->original->centre, sizeof *s->original, at);
    return largest == OV_NOBODY ? NO_IMAGE : s->options->image[largest];
}

static ovoid_status tell_images_apart(surveyor *s) {
    ovoid_status status = OVOID_OK;
    if (!s->options->image || s->original_count == 0)
        return OVOID_OK;
    OV_TRY(ov_grid_of(s->context, s->original->centre, sizeof *s->original, s->original_count,
                      LARGEST_WITHIN, &s->largest));
    OV_TRY(ov_grid_of(s->context, s->original->centre, sizeof *s->original, s->original_count,
                      NEAREST_WITHIN, &s->nearest));
cleanup:
    return status;
}

static bool is_inside(const surveyor *s, const ovoid_mesh *mesh, size_t triangle) {
    double centre[3];
    bool inside = true;
    ov_mesh_centre(mesh, triangle, centre);
    for (size_t k = 0; k < 3; ++k)
        inside = inside && centre[k] >= s->low[k] && centre[k] < s->high[k];
    return inside && (!s->options->image || image_at(s, centre) == 0);
}

/* What hangs together by the triangles in the cell: what does so beyond it only may be an artefact
 * of where its surroundings end. Numbers the pieces, and returns how many there are. */
static size_t find_pieces(const surveyor *s, sheet *at) {
    const ovoid_mesh *const mesh = at->mesh;
    uint32_t *const of = at->piece_of;
    size_t count = 0;
    for (size_t v = 0; v < mesh->vertices; ++v)
        of[v] = NO_PIECE;
    for (size_t t = 0; t < mesh->triangles; ++t) {
        const uint32_t *const corner = mesh->corners + 3 * t;
        at->inside[t] = is_inside(s, mesh, t);
        if (!at->inside[t])
            continue;
        for (size_t i = 0; i < 3; ++i)
            if (of[corner[i]] == NO_PIECE)
                of[corner[i]] = corner[i];
        ov_unite(of, corner[0], corner[1]);
        ov_unite(of, corner[0], corner[2]);
    }
    for (size_t v = 0; v < mesh->vertices; ++v) /* parents come first */
        if (of[v] != NO_PIECE)
            of[v] = of[v] == v ? (uint32_t)count++ : of[of[v]];
    return count;
}

static void add_contents(const surveyor *s, const sheet *at, ov_survey_side *side) {
    static const double zero[3] = {0.0, 0.0, 0.0};
    const double *const centre = s->options->image ? s->options->centre : zero;
    for (size_t t = 0; t < at->mesh->triangles; ++t) {
        ov_content content = {0.0, 0.0};
        if (!at->inside[t])
            continue;
        ov_survey_piece *const piece = &side->piece[at->piece_of[at->mesh->corners[3 * t]]];
        ov_mesh_smooth_triangle(at->mesh, t, centre, &content);
        piece->area += content.area;
        piece->volume += content.volume;
    }
}

static bool is_at_seam(const surveyor *s, const double at[3]) {
    const double reach = SEAM * s->options->spacing;
    for (size_t k = 0; k < 3; ++k)
        if (fabs(at[k] - s->low[k]) <= reach || fabs(at[k] - s->high[k]) <= reach)
            return true;
    return false;
}

static uint64_t key_of(const surveyor *s, const double at[3]) {
    int64_t fine[3];
    for (size_t k = 0; k < 3; ++k)
        fine[k] = llround(at[k] / s->options->spacing * FINE);
    return ov_hash(fine, sizeof fine);
}

static ovoid_status add_seam(const surveyor *s, const double at[3], uint32_t piece,
                             ov_survey_side *side) {
    const ovoid_status status = ov_grow(s->context, &side->seam, &side->seam_capacity,
                                        side->seams + 1, sizeof *side->seam, "seams between parts");
    if (status == OVOID_OK)
        side->seam[side->seams++] = (ov_survey_seam){.key = key_of(s, at), .piece = piece};
    return status;
}

static ovoid_status add_port(const surveyor *s, const ovoid_mesh *mesh, size_t v, uint32_t piece,
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
static ovoid_status add_ports(const surveyor *s, const sheet *from, ov_survey_side *side) {
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
            any = any || from->piece_of[corner[i]] != NO_PIECE;
        if (from->inside[t] || !any)
            continue;
        ov_mesh_centre(mesh, t, centre);
        const uint32_t image = image_at(s, centre);
        for (size_t i = 0; i < 3 && image > 0 && image != NO_IMAGE; ++i) {
            const uint32_t v = corner[i], piece = from->piece_of[v];
            if (piece == NO_PIECE || last[v] == image)
                continue;
            last[v] = image;
            OV_TRY(add_port(s, mesh, v, piece, image, side));
        }
    }
cleanup:
    free(last);
    return status;
}

static ovoid_status add_spot(const surveyor *s, const double at[3], double distance, uint32_t piece,
                             ov_survey_side *side) {
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

static ovoid_status record_sheet(surveyor *s, sheet *from, ov_survey_side *side) {
    ovoid_status status = OVOID_OK;
    if (!from->mesh)
        return OVOID_OK;
    side->pieces = find_pieces(s, from);
    side->piece = ov_alloc(s->context, side->pieces, sizeof *side->piece, "pieces of a surface");
    if (!side->piece)
        return OVOID_ERROR_MEMORY;
    add_contents(s, from, side);
    for (size_t v = 0; v < from->mesh->vertices; ++v) {
        const uint32_t piece = from->piece_of[v];
        double at[3];
        if (piece == NO_PIECE)
            continue;
        ov_mesh_at(from->mesh, v, at);
        side->piece[piece].furthest = fmax(side->piece[piece].furthest, from->distance[v]);
        if (is_at_seam(s, at))
            OV_TRY(add_seam(s, at, piece, side));
        if (from->distance[v] >= s->options->least)
            OV_TRY(add_spot(s, at, from->distance[v], piece, side));
    }
    if (s->options->image)
        OV_TRY(add_ports(s, from, side));
cleanup:
    return status;
}

/* The middle of some terms, which offsets are counted from. */
static void middle_of(const ov_quadric *quadrics, size_t count, double origin[3]) {
    for (size_t k = 0; k < 3; ++k) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < count; ++i) {
            low = fmin(low, quadrics[i].centre[k]);
            high = fmax(high, quadrics[i].centre[k]);
        }
        origin[k] = count > 0 ? 0.5 * low + 0.5 * high : 0.0;
    }
}

ovoid_status ov_survey(ovoid_context *context, const ov_survey_options *options,
                       const ov_quadric *original, size_t original_count, const ov_quadric *model,
                       size_t model_count, const double low[3], const double high[3],
                       ov_survey_cell *cell) {
    ovoid_status status = OVOID_OK;
    ov_survey_cell made = {0};
    surveyor s = {.context = context,
                  .options = options,
                  .low = low,
                  .high = high,
                  .original = original,
                  .original_count = original_count};
    middle_of(original, original_count, s.origin);
    OV_TRY(tell_images_apart(&s));
    OV_TRY(ov_marcher_create(context, &s.marcher));
    OV_TRY(mesh_sheet(&s, original, original_count, &s.sheet[0]));
    OV_TRY(mesh_sheet(&s, model, model_count, &s.sheet[1]));
    OV_TRY(measure_sheet(&s, &s.sheet[0], &s.sheet[1]));
    OV_TRY(measure_sheet(&s, &s.sheet[1], &s.sheet[0]));
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        OV_TRY(record_sheet(&s, &s.sheet[n], &made.side[n]));
cleanup:
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n)
        sheet_destroy(&s.sheet[n]);
    ov_grid_destroy(&s.largest);
    ov_grid_destroy(&s.nearest);
    ov_meter_destroy(&s.meter);
    ov_marcher_destroy(&s.marcher);
    if (status == OVOID_OK)
        *cell = made;
    else
        ov_survey_cell_destroy(&made);
    return status;
}

void ov_survey_cell_destroy(ov_survey_cell *cell) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        free(cell->side[n].piece);
        free(cell->side[n].seam);
        free(cell->side[n].port);
        free(cell->side[n].spot);
        free(cell->side[n].spot_on);
    }
    *cell = (ov_survey_cell){0};
}

/* ---- all cells ------------------------------------------------------------------------------- */

/* The pieces of one side, those of all cells one after the other. */
typedef struct joint {
    size_t pieces, seams, ports;
    size_t *first;   /* of each cell */
    uint32_t *whole; /* of each piece: the first one that it hangs together with */
    double *volume;  /* of each such */
    ov_survey_seam *seam;
    ov_survey_port *port;
} joint;

static void joint_destroy(joint *j) {
    free(j->first);
    free(j->whole);
    free(j->volume);
    free(j->seam);
    free(j->port);
}

static int by_key(const void *a, const void *b) {
    const ov_survey_seam *const p = a, *const q = b;
    if (p->key != q->key)
        return p->key < q->key ? -1 : 1;
    return (p->piece > q->piece) - (p->piece < q->piece);
}

static ovoid_status joint_create(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                                 size_t n, joint *j) {
    for (size_t c = 0; c < count; ++c) {
        j->pieces += cells[c].side[n].pieces;
        j->seams += cells[c].side[n].seams;
        j->ports += cells[c].side[n].ports;
    }
    if (j->pieces >= UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT, "a surface of %zu pieces", j->pieces);
    j->first = ov_alloc(context, count, sizeof *j->first, "pieces of a surface");
    j->whole = ov_alloc(context, j->pieces, sizeof *j->whole, "pieces of a surface");
    j->volume = ov_alloc(context, j->pieces, sizeof *j->volume, "pieces of a surface");
    j->seam = ov_alloc(context, j->seams, sizeof *j->seam, "seams between parts");
    j->port = ov_alloc(context, j->ports, sizeof *j->port, "seams between units");
    return j->first && j->whole && j->volume && j->seam && j->port ? OVOID_OK : OVOID_ERROR_MEMORY;
}

/* Pieces that have a vertex in common are parts of one. */
static void join(const ov_survey_cell *cells, size_t count, size_t n, joint *j) {
    size_t piece = 0, seam = 0, port = 0;
    for (size_t c = 0; c < count; ++c) {
        const ov_survey_side *const side = &cells[c].side[n];
        j->first[c] = piece;
        for (size_t k = 0; k < side->ports; ++k, ++port) {
            j->port[port] = side->port[k];
            j->port[port].piece += (uint32_t)piece;
        }
        for (size_t k = 0; k < side->seams; ++k)
            j->seam[seam++] = (ov_survey_seam){.key = side->seam[k].key,
                                               .piece = (uint32_t)piece + side->seam[k].piece};
        for (size_t k = 0; k < side->pieces; ++k, ++piece)
            j->whole[piece] = (uint32_t)piece;
    }
    qsort(j->seam, j->seams, sizeof *j->seam, by_key);
    for (size_t k = 1; k < j->seams; ++k)
        if (j->seam[k].key == j->seam[k - 1].key)
            ov_unite(j->whole, j->seam[k].piece, j->seam[k - 1].piece);
}

/* Of the vertices at seams the one that is what image the port leads to has where the port is: near
 * there and facing the same way. NULL: there is none. */
static const ov_survey_port *find_port(const joint *j, const ov_grid *grid,
                                       const ov_survey_port *port, const ov_rigid *back) {
    uint32_t near[2 * OV_NEAR_MAX];
    const double normal[3] = {port->normal[0], port->normal[1], port->normal[2]};
    double at[3], facing[3], least = INFINITY;
    const ov_survey_port *nearest = NULL;
    ov_rigid_move(back, port->at, at);
    ov_rigid_turn(back, normal, facing);
    const size_t count = ov_grid_near(grid, at, UINT32_MAX, near);
    for (size_t n = 0; n < count; ++n) {
        const ov_survey_port *const other = &j->port[near[n]];
        double cosine = 0.0, square = 0.0;
        for (size_t k = 0; k < 3; ++k) {
            cosine += facing[k] * other->normal[k];
            square += (at[k] - other->at[k]) * (at[k] - other->at[k]);
        }
        if (cosine >= PORT_COSINE && square < least) {
            least = square;
            nearest = other;
        }
    }
    return nearest;
}

/* Pieces that go on in an image of the unit hang together with what the unit has there. */
static ovoid_status join_images(ovoid_context *context, const ov_survey_images *images, joint *j) {
    ovoid_status status = OVOID_OK;
    ov_grid grid = {0};
    ov_rigid *const back = ov_alloc(context, images->count, sizeof *back, "seams between units");
    if (!back)
        return OVOID_ERROR_MEMORY;
    for (size_t g = 0; g < images->count; ++g)
        back[g] = ov_rigid_inverse(&images->image[g]);
    if (j->ports > 0)
        OV_TRY(ov_grid_of(context, j->port->at, sizeof *j->port, j->ports, PORT * images->spacing,
                          &grid));
    for (size_t k = 0; k < j->ports; ++k) {
        const ov_survey_port *const port = &j->port[k];
        const ov_survey_port *const other = find_port(j, &grid, port, &back[port->image]);
        if (other)
            ov_unite(j->whole, port->piece, other->piece);
    }
cleanup:
    ov_grid_destroy(&grid);
    free(back);
    return status;
}

static void add_volumes(const ov_survey_cell *cells, size_t count, size_t n, joint *j) {
    for (size_t c = 0; c < count; ++c)
        for (size_t k = 0; k < cells[c].side[n].pieces; ++k) {
            const uint32_t whole = ov_union_first(j->whole, (uint32_t)(j->first[c] + k));
            j->volume[whole] += cells[c].side[n].piece[k].volume;
        }
}

static bool is_outer(joint *j, size_t piece) {
    return j->volume[ov_union_first(j->whole, (uint32_t)piece)] > 0.0;
}

static void add_side(const ov_survey_cell *cells, size_t count, size_t n, joint *j,
                     ov_survey_total *total) {
    for (size_t c = 0; c < count; ++c)
        for (size_t k = 0; k < cells[c].side[n].pieces; ++k) {
            const ov_survey_piece *const piece = &cells[c].side[n].piece[k];
            const size_t at = j->first[c] + k;
            const bool outer = is_outer(j, at), first = j->whole[at] == at;
            total->area[n] += piece->area;
            total->volume[n] += piece->volume;
            total->components[n] += first;
            total->hausdorff = fmax(total->hausdorff, piece->furthest);
            if (!outer)
                continue;
            total->area_outer[n] += piece->area;
            total->volume_outer[n] += piece->volume;
            total->outer[n] += first;
            total->deviation = fmax(total->deviation, piece->furthest);
        }
}

static ovoid_status add_spots(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                              size_t n, joint *j, size_t *capacity, ov_survey_total *total) {
    ovoid_status status = OVOID_OK;
    for (size_t c = 0; c < count; ++c) {
        const ov_survey_side *const side = &cells[c].side[n];
        for (size_t k = 0; k < side->spots; ++k) {
            if (!is_outer(j, j->first[c] + side->spot_on[k]))
                continue;
            OV_TRY(ov_grow(context, &total->spot, capacity, total->spots + 1, sizeof *total->spot,
                           "spots"));
            total->spot[total->spots++] = side->spot[k];
        }
    }
cleanup:
    return status;
}

ovoid_status ov_survey_join(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                            const ov_survey_images *images, double apart, ov_survey_total *total) {
    ovoid_status status = OVOID_OK;
    ov_survey_total made = {0};
    size_t capacity = 0;
    for (size_t n = 0; n < OV_SURVEY_SIDES && status == OVOID_OK; ++n) {
        joint j = {0};
        status = joint_create(context, cells, count, n, &j);
        if (status == OVOID_OK) {
            join(cells, count, n, &j);
            status = images->count > 1 ? join_images(context, images, &j) : OVOID_OK;
        }
        if (status == OVOID_OK) {
            add_volumes(cells, count, n, &j);
            add_side(cells, count, n, &j, &made);
            status = add_spots(context, cells, count, n, &j, &capacity, &made);
        }
        joint_destroy(&j);
    }
    OV_TRY(status);
    OV_TRY(ov_spots_thin(context, made.spot, &made.spots, apart, SIZE_MAX));
    *total = made;
    made = (ov_survey_total){0};
cleanup:
    ov_survey_total_destroy(&made);
    return status;
}

void ov_survey_total_destroy(ov_survey_total *total) {
    free(total->spot);
    *total = (ov_survey_total){0};
}
