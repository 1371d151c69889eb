/* What the cells of a survey come to when they are joined. */
#include "measure/survey.h"

#include "mesh/union.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In lattice steps: an image's vertices at the seam between a unit and its image lie this near to
 * the unit's own, which are of another lattice, and look the same way to within this cosine. */
#define PORT 2.0
#define PORT_COSINE 0.7

/* What is in the unit as `from` goes on in an image of it, as what is `to` in the unit. */
typedef struct link {
    uint32_t from, to, image;
} link;

/* The pieces of one side, those of all cells one after the other. */
typedef struct joint {
    size_t pieces, seams, ports, necks;
    size_t *first;   /* of each cell */
    uint32_t *whole; /* of each piece: the first one that it hangs together with, */
    uint32_t *about; /* and the first one that it may hang together with by necks, too */
    bool *exposed;   /* of each such, whether one of them is an outer one */
    double *volume;  /* of each such, */
    double *at;      /* counted from a vertex of it */
    ov_survey_seam *seam, *neck;
    ov_survey_port *port;
    link *link; /* between what hangs together in the unit */
    size_t links, link_capacity;
    uint64_t *copies; /* of each `whole`: how many of it the images make; NULL: one */
} joint;

static void joint_destroy(joint *j) {
    free(j->first);
    free(j->whole);
    free(j->about);
    free(j->exposed);
    free(j->neck);
    free(j->volume);
    free(j->at);
    free(j->seam);
    free(j->port);
    free(j->link);
    free(j->copies);
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
        j->necks += cells[c].side[n].necks;
    }
    if (j->pieces >= UINT32_MAX)
        return ov_fail(context, OVOID_ERROR_LIMIT, "a surface of %zu pieces", j->pieces);
    j->first = ov_alloc(context, count, sizeof *j->first, "pieces of a surface");
    j->whole = ov_alloc(context, j->pieces, sizeof *j->whole, "pieces of a surface");
    j->about = ov_alloc(context, j->pieces, sizeof *j->about, "pieces of a surface");
    j->exposed = ov_alloc(context, j->pieces, sizeof *j->exposed, "pieces of a surface");
    j->volume = ov_alloc(context, j->pieces, sizeof *j->volume, "pieces of a surface");
    j->at = ov_alloc(context, j->pieces, 3 * sizeof *j->at, "pieces of a surface");
    j->seam = ov_alloc(context, j->seams, sizeof *j->seam, "seams between parts");
    j->port = ov_alloc(context, j->ports, sizeof *j->port, "seams between units");
    j->neck = ov_alloc(context, j->necks, sizeof *j->neck, "necks between pieces");
    const bool made = j->first && j->whole && j->about && j->exposed && j->volume && j->at &&
                      j->seam && j->port && j->neck;
    return made ? OVOID_OK : OVOID_ERROR_MEMORY;
}

/* Adds what a piece has of a volume that counts from this place. */
static void add_volume(const ov_survey_piece *piece, const double from[3], double *volume) {
    *volume += piece->volume;
    for (size_t k = 0; k < 3; ++k)
        *volume += (piece->at[k] - from[k]) * piece->vector[k] / 3.0;
}

static void copy_seams(const ov_survey_seam *seams, size_t count, size_t first,
                       ov_survey_seam *to) {
    for (size_t k = 0; k < count; ++k)
        to[k] = (ov_survey_seam){.key = seams[k].key, .piece = (uint32_t)first + seams[k].piece};
}

/* Those with the same key. */
static void unite_by_key(ov_survey_seam *seams, size_t count, uint32_t *of) {
    qsort(seams, count, sizeof *seams, by_key);
    for (size_t k = 1; k < count; ++k)
        if (seams[k].key == seams[k - 1].key)
            ov_unite(of, seams[k].piece, seams[k - 1].piece);
}

/* Pieces that have a vertex in common are parts of one. */
static void join(const ov_survey_cell *cells, size_t count, size_t n, joint *j) {
    size_t piece = 0, seam = 0, port = 0, neck = 0;
    for (size_t c = 0; c < count; ++c) {
        const ov_survey_side *const side = &cells[c].side[n];
        j->first[c] = piece;
        for (size_t k = 0; k < side->ports; ++k, ++port) {
            j->port[port] = side->port[k];
            j->port[port].piece += (uint32_t)piece;
        }
        copy_seams(side->seam, side->seams, piece, j->seam + seam);
        copy_seams(side->neck, side->necks, piece, j->neck + neck);
        seam += side->seams;
        neck += side->necks;
        for (size_t k = 0; k < side->pieces; ++k, ++piece) {
            j->whole[piece] = (uint32_t)piece;
            memcpy(j->at + 3 * piece, side->piece[k].at, sizeof side->piece[k].at);
        }
    }
    unite_by_key(j->seam, j->seams, j->whole);
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

/* Where pieces go on in an image of the unit. */
static ovoid_status find_links(ovoid_context *context, const ov_survey_images *images, joint *j) {
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
        if (!other)
            continue;
        OV_TRY(ov_grow(context, &j->link, &j->link_capacity, j->links + 1, sizeof *j->link,
                       "seams between units"));
        j->link[j->links++] = (link){.from = port->piece, .to = other->piece, .image = port->image};
    }
cleanup:
    ov_grid_destroy(&grid);
    free(back);
    return status;
}

static int by_ends(const void *a, const void *b) {
    const link *const p = a, *const q = b;
    if (p->image != q->image)
        return p->image < q->image ? -1 : 1;
    if (p->from != q->from)
        return p->from < q->from ? -1 : 1;
    return (p->to > q->to) - (p->to < q->to);
}

/* Of pieces those that stand for what hangs together in the unit, and each link once. */
static void tidy_links(joint *j) {
    size_t kept = 0;
    for (size_t k = 0; k < j->links; ++k) {
        j->link[k].from = ov_union_first(j->whole, j->link[k].from);
        j->link[k].to = ov_union_first(j->whole, j->link[k].to);
    }
    if (j->links > 0)
        qsort(j->link, j->links, sizeof *j->link, by_ends);
    for (size_t k = 0; k < j->links; ++k)
        if (k == 0 || by_ends(&j->link[k], &j->link[kept - 1]) != 0)
            j->link[kept++] = j->link[k];
    j->links = kept;
}

/* The pieces with links in all images: which hang together in the whole. */
typedef struct spread {
    size_t images, linked;
    uint32_t *number; /* of each piece among those with links */
    uint32_t *piece;  /* of each number */
    uint32_t *of;     /* number * images + image leads to the first that it hangs together with */
} spread;

static void spread_destroy(spread *s) {
    free(s->number);
    free(s->piece);
    free(s->of);
}

static void number_piece(uint32_t piece, spread *s) {
    if (s->number[piece] != UINT32_MAX)
        return;
    s->number[piece] = (uint32_t)s->linked;
    s->piece[s->linked++] = piece;
}

static ovoid_status spread_create(ovoid_context *context, const joint *j, size_t images,
                                  spread *s) {
    s->images = images;
    s->number = ov_alloc(context, j->pieces, sizeof *s->number, "pieces of a surface");
    s->piece = ov_alloc(context, 2 * j->links, sizeof *s->piece, "pieces of a surface");
    if (!s->number || !s->piece)
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < j->pieces; ++p)
        s->number[p] = UINT32_MAX;
    for (size_t k = 0; k < j->links; ++k) {
        number_piece(j->link[k].from, s);
        number_piece(j->link[k].to, s);
    }
    if (s->linked > UINT32_MAX / images)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu pieces of a surface in %zu units",
                       s->linked, images);
    s->of = ov_alloc(context, s->linked * images, sizeof *s->of, "pieces of a surface");
    if (!s->of)
        return OVOID_ERROR_MEMORY;
    for (size_t n = 0; n < s->linked * images; ++n)
        s->of[n] = (uint32_t)n;
    return OVOID_OK;
}

/* Joins what is linked, in all images. */
static void join_everywhere(const joint *j, const ov_survey_images *images, spread *s) {
    for (size_t g = 0; g < images->count; ++g) {
        size_t there = 0;
        for (size_t k = 0; k < j->links; ++k) {
            const link *const l = &j->link[k];
            if (k == 0 || l->image != l[-1].image) { /* the image of an image */
                const ov_rigid both = ov_rigid_after(&images->image[l->image], &images->image[g]);
                there = ov_rigid_find(images->image, images->count, &both);
            }
            ov_unite(s->of, (uint32_t)(s->number[l->from] * s->images + g),
                     (uint32_t)(s->number[l->to] * s->images + there));
        }
    }
}

/* As many of each piece as there are images; where it goes on in some of these, fewer: each in the
 * whole counts for the piece that it begins with. */
static ovoid_status count_copies(ovoid_context *context, const ov_survey_images *images, joint *j) {
    ovoid_status status = OVOID_OK;
    spread s = {0};
    j->copies = ov_alloc(context, j->pieces, sizeof *j->copies, "pieces of a surface");
    if (!j->copies)
        return OVOID_ERROR_MEMORY;
    OV_TRY(spread_create(context, j, images->count, &s));
    join_everywhere(j, images, &s);
    for (size_t p = 0; p < j->pieces; ++p)
        j->copies[p] = s.number[p] == UINT32_MAX ? images->count : 0;
    for (size_t n = 0; n < s.linked * s.images; ++n)
        j->copies[s.piece[n / s.images]] += s.of[n] == n;
cleanup:
    spread_destroy(&s);
    return status;
}

/* Pieces that go on in an image of the unit hang together with what the unit has there. */
static ovoid_status join_images(ovoid_context *context, const ov_survey_images *images, joint *j) {
    ovoid_status status = OVOID_OK;
    if (images->count == 1)
        return OVOID_OK;
    OV_TRY(find_links(context, images, j));
    tidy_links(j);
    OV_TRY(count_copies(context, images, j));
    for (size_t k = 0; k < j->links; ++k)
        ov_unite(j->whole, j->link[k].from, j->link[k].to);
    for (size_t k = 0; k < 2 * j->links; ++k) {
        const uint32_t p = k % 2 == 0 ? j->link[k / 2].from : j->link[k / 2].to;
        const uint32_t first = ov_union_first(j->whole, p);
        if (first == p)
            continue;
        j->copies[first] += j->copies[p];
        j->copies[p] = 0;
    }
cleanup:
    return status;
}

/* Volumes that images of the unit go on with count from where the axes meet. */
static void add_volumes(const ov_survey_cell *cells, size_t count, size_t n,
                        const ov_survey_images *images, joint *j) {
    const double *const centre = images->count > 1 ? images->centre : NULL;
    for (size_t c = 0; c < count; ++c)
        for (size_t k = 0; k < cells[c].side[n].pieces; ++k) {
            const uint32_t whole = ov_union_first(j->whole, (uint32_t)(j->first[c] + k));
            add_volume(&cells[c].side[n].piece[k], centre ? centre : j->at + 3 * (size_t)whole,
                       &j->volume[whole]);
        }
}

static bool is_outer(joint *j, size_t piece) {
    return j->volume[ov_union_first(j->whole, (uint32_t)piece)] > 0.0;
}

/* When volumes are known. */
static void expose(joint *j) {
    for (size_t p = 0; p < j->pieces; ++p)
        j->about[p] = ov_union_first(j->whole, (uint32_t)p);
    unite_by_key(j->neck, j->necks, j->about);
    for (size_t p = 0; p < j->pieces; ++p)
        if (is_outer(j, p))
            j->exposed[ov_union_first(j->about, (uint32_t)p)] = true;
}

static bool is_exposed(joint *j, size_t piece) {
    return j->exposed[ov_union_first(j->about, (uint32_t)piece)];
}

static void add_sums(const ov_survey_sums *one, ov_survey_sums *all) {
    all->weight += one->weight;
    all->mean += one->mean;
    all->square += one->square;
    all->largest = fmax(all->largest, one->largest);
}

static void add_side(const ov_survey_cell *cells, size_t count, size_t n, joint *j,
                     ov_survey_total *total) {
    for (size_t c = 0; c < count; ++c)
        for (size_t k = 0; k < cells[c].side[n].pieces; ++k) {
            const ov_survey_piece *const piece = &cells[c].side[n].piece[k];
            const size_t at = j->first[c] + k;
            const bool outer = is_outer(j, at), first = j->whole[at] == at;
            const uint64_t copies = !first ? 0 : j->copies ? j->copies[at] : 1;
            total->area[n] += piece->area;
            total->volume[n] += first ? j->volume[at] : 0.0;
            total->components[n] += copies;
            total->hausdorff = fmax(total->hausdorff, piece->furthest);
            add_sums(&piece->whole, &total->sums[n]);
            if (is_exposed(j, at))
                total->deviation = fmax(total->deviation, piece->furthest);
            if (!outer)
                continue;
            total->area_outer[n] += piece->area;
            total->volume_outer[n] += first ? j->volume[at] : 0.0;
            total->outer[n] += copies;
            add_sums(&piece->outer, &total->sums_outer[n]);
        }
}

static ovoid_status add_spots(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                              size_t n, joint *j, size_t *capacity, ov_survey_total *total) {
    ovoid_status status = OVOID_OK;
    for (size_t c = 0; c < count; ++c) {
        const ov_survey_side *const side = &cells[c].side[n];
        for (size_t k = 0; k < side->spots; ++k) {
            if (!is_exposed(j, j->first[c] + side->spot_on[k]))
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
            status = join_images(context, images, &j);
        }
        if (status == OVOID_OK) {
            add_volumes(cells, count, n, images, &j);
            expose(&j);
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

/* ---- standing -------------------------------------------------------------------------------- */

static ovoid_status stand_side(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                               size_t n, joint *j, ov_survey_standing *made) {
    size_t marks = 0;
    for (size_t c = 0; c < count; ++c)
        marks += cells[c].side[n].marks;
    made->outer[n] = ov_alloc(context, j->pieces, sizeof *made->outer[n], "pieces of a surface");
    made->mark[n] = ov_alloc(context, marks, sizeof *made->mark[n], "seams between parts");
    if (!made->outer[n] || !made->mark[n])
        return OVOID_ERROR_MEMORY;
    for (size_t p = 0; p < j->pieces; ++p)
        made->outer[n][p] = is_outer(j, p);
    for (size_t c = 0; c < count; ++c)
        for (size_t k = 0; k < cells[c].side[n].marks; ++k) {
            const ov_survey_seam *const mark = &cells[c].side[n].mark[k];
            made->mark[n][made->marks[n]++] = (ov_survey_seam){
                .key = mark->key, .piece = made->outer[n][j->first[c] + mark->piece]};
        }
    qsort(made->mark[n], marks, sizeof *made->mark[n], by_key);
    made->first[n] = j->first;
    j->first = NULL;
    return OVOID_OK;
}

ovoid_status ov_survey_stand(ovoid_context *context, const ov_survey_cell *cells, size_t count,
                             const ov_survey_images *images, ov_survey_standing *standing) {
    ovoid_status status = OVOID_OK;
    ov_survey_standing made = {0};
    for (size_t n = 0; n < OV_SURVEY_SIDES && status == OVOID_OK; ++n) {
        joint j = {0};
        status = joint_create(context, cells, count, n, &j);
        if (status == OVOID_OK) {
            join(cells, count, n, &j);
            status = join_images(context, images, &j);
        }
        if (status == OVOID_OK) {
            add_volumes(cells, count, n, images, &j);
            status = stand_side(context, cells, count, n, &j, &made);
        }
        joint_destroy(&j);
    }
    if (status == OVOID_OK)
        *standing = made;
    else
        ov_survey_standing_destroy(&made);
    return status;
}

void ov_survey_standing_destroy(ov_survey_standing *standing) {
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        free(standing->first[n]);
        free(standing->outer[n]);
        free(standing->mark[n]);
    }
    *standing = (ov_survey_standing){0};
}

int ov_survey_stands(const ov_survey_standing *standing, size_t n, uint64_t key) {
    size_t low = 0, high = standing->marks[n];
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (standing->mark[n][middle].key < key)
            low = middle + 1;
        else
            high = middle;
    }
    if (low == standing->marks[n] || standing->mark[n][low].key != key)
        return 0;
    return standing->mark[n][low].piece ? 1 : -1;
}

/* The surfaces that are not in the cell: their keys follow one another. */
static bool askings_hold(const ov_survey_standing *standing, const ov_survey_side *side, size_t n) {
    for (size_t k = 0, end; k < side->askings; k = end) {
        int votes = 0, found = 0;
        for (end = k; end < side->askings && side->asked[end].piece == side->asked[k].piece;
             ++end) {
            const int vote = ov_survey_stands(standing, n, side->asked[end].key);
            votes += vote;
            found += vote != 0;
        }
        if (found == 0 || votes < 0)
            return false;
    }
    return true;
}

bool ov_survey_holds(const ov_survey_standing *standing, const ov_survey_cell *cell, size_t c) {
    if (cell->outer_later)
        return false;
    for (size_t n = 0; n < OV_SURVEY_SIDES; ++n) {
        const ov_survey_side *const side = &cell->side[n];
        for (size_t p = 0; p < side->pieces; ++p)
            if (side->piece[p].outer_supposed != standing->outer[n][standing->first[n][c] + p])
                return false;
        if (!askings_hold(standing, side, n))
            return false;
    }
    return true;
}

void ov_survey_settle(const ov_survey_far *far, ov_survey_cell *cell) {
    ov_survey_piece *const piece = &cell->side[far->side].piece[far->piece];
    const double d = far->distance;
    const ov_survey_sums sums = {far->weight, far->weight * d, far->weight * d * d, d};
    add_sums(&sums, far->outer ? &piece->outer : &piece->whole);
    if (far->vertex && !far->outer)
        piece->furthest = fmax(piece->furthest, d);
}
