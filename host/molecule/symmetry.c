#include "molecule/symmetry.h"

#include "molecule/assembly.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* So far apart may be what counts as the same place, angstrom: files give rotations to six digits
 * or more, and capsids are some hundred angstrom wide. */
#define SAME_PLACE 0.01
/* Each placement is carried by each motion: time and memory follow the square of this. */
#define PLACEMENTS_MAX 4096
/* Points that tell placements apart: the middle of the unit, and one along each axis from there. */
enum { ANCHORS = 4 };

/* A placement, and where it takes the anchors. */
typedef struct placed {
    ov_rigid rigid;
    double anchor[ANCHORS][3];
    uint32_t part;
    size_t number;
} placed;

typedef struct finder {
    const ovoid_molecule *molecule;
    placed *placed; /* in the order of the first coordinate of the first anchor */
    size_t count;
    size_t *at; /* where in that order each placement is */
    ov_rigid *motion;
    uint32_t *to; /* to[g * count + i]: what motion g makes of placement i */
    size_t order;
    bool *taken;
} finder;

/* ---- placements ------------------------------------------------------------------------------ */

/* The middle of the unit, and how far from it atoms are. */
static double unit_extent(const ovoid_molecule *m, double middle[3]) {
    double low[3], high[3], furthest = 0.0;
    for (size_t k = 0; k < 3; ++k) {
        low[k] = high[k] = m->xyzr[k];
        for (size_t i = 1; i < m->atoms; ++i) {
            low[k] = fmin(low[k], m->xyzr[4 * i + k]);
            high[k] = fmax(high[k], m->xyzr[4 * i + k]);
        }
        middle[k] = 0.5 * (low[k] + high[k]);
        furthest = fmax(furthest, high[k] - middle[k]);
    }
    return fmax(furthest, 1.0);
}

static int by_first_coordinate(const void *a, const void *b) {
    const placed *const p = a, *const q = b;
    if (p->anchor[0][0] != q->anchor[0][0])
        return p->anchor[0][0] < q->anchor[0][0] ? -1 : 1;
    return (p->number > q->number) - (p->number < q->number);
}

static void list_placements(finder *f) {
    double anchor[ANCHORS][3];
    const double extent = unit_extent(f->molecule, anchor[0]);
    for (size_t n = 1; n < ANCHORS; ++n) {
        memcpy(anchor[n], anchor[0], sizeof anchor[n]);
        anchor[n][n - 1] += extent;
    }
    for (size_t i = 0; i < f->count; ++i) {
        const ovoid_placement *const from = &f->molecule->placements[i];
        placed *const p = &f->placed[i];
        memcpy(p->rigid.rotation, from->rotation, sizeof p->rigid.rotation);
        memcpy(p->rigid.shift, from->translation, sizeof p->rigid.shift);
        p->part = from->part;
        p->number = i;
        for (size_t n = 0; n < ANCHORS; ++n)
            ov_rigid_move(&p->rigid, anchor[n], p->anchor[n]);
    }
    qsort(f->placed, f->count, sizeof *f->placed, by_first_coordinate);
    for (size_t i = 0; i < f->count; ++i)
        f->at[f->placed[i].number] = i;
}

static bool is_same_place(const double a[3], const double b[3]) {
    return fabs(a[0] - b[0]) <= SAME_PLACE && fabs(a[1] - b[1]) <= SAME_PLACE &&
           fabs(a[2] - b[2]) <= SAME_PLACE;
}

static bool is_same_placement(const placed *p, const double (*anchor)[3]) {
    for (size_t n = 0; n < ANCHORS; ++n)
        if (!is_same_place(p->anchor[n], anchor[n]))
            return false;
    return true;
}

/* The first in order that may be so far along the first coordinate. */
static size_t first_from(const finder *f, double x) {
    size_t low = 0, high = f->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (f->placed[middle].anchor[0][0] < x)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The placement of the same part that the motion makes of p; as many as there are where there is
 * none. */
static size_t carried(const finder *f, const ov_rigid *motion, const placed *p) {
    double anchor[ANCHORS][3];
    for (size_t n = 0; n < ANCHORS; ++n)
        ov_rigid_move(motion, p->anchor[n], anchor[n]);
    for (size_t j = first_from(f, anchor[0][0] - SAME_PLACE);
         j < f->count && f->placed[j].anchor[0][0] <= anchor[0][0] + SAME_PLACE; ++j) {
        const placed *const q = &f->placed[j];
        if (q->part == p->part && !f->taken[j] && is_same_placement(q, anchor))
            return j;
    }
    return f->count;
}

/* ---- motions --------------------------------------------------------------------------------- */

/* Whether it carries all placements onto others, each onto one of its own: to[] gets which. */
static bool is_symmetry(finder *f, const ov_rigid *motion, uint32_t *to) {
    memset(f->taken, 0, f->count * sizeof *f->taken);
    for (size_t i = 0; i < f->count; ++i) {
        const placed *const p = &f->placed[f->at[i]];
        const size_t j = carried(f, motion, p);
        if (j == f->count)
            return false;
        f->taken[j] = true;
        to[i] = (uint32_t)f->placed[j].number;
    }
    return true;
}

/* A motion carries the first placement somewhere: those that do are all there can be. */
static void find_motions(finder *f) {
    const placed *const from = &f->placed[f->at[0]];
    const ov_rigid back = ov_rigid_inverse(&from->rigid);
    for (size_t i = 0; i < f->count; ++i) {
        const placed *const p = &f->placed[f->at[i]];
        if (p->part != from->part)
            continue;
        if (i > 0 && is_same_placement(p, from->anchor)) { /* it is there twice: nothing moves it */
            f->order = 0;
            return;
        }
        const ov_rigid motion = i == 0 ? ov_rigid_identity : ov_rigid_after(&back, &p->rigid);
        if (is_symmetry(f, &motion, f->to + f->order * f->count))
            f->motion[f->order++] = motion;
    }
}

/* ---- the unit -------------------------------------------------------------------------------- */

static double apart(const finder *f, size_t i, size_t j) {
    const double *const a = f->placed[f->at[i]].anchor[0], *const b = f->placed[f->at[j]].anchor[0];
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* Of what the motions make of placement i, the one that is nearest to the first of all, so that the
 * unit hangs together. */
static size_t nearest_image(const finder *f, size_t i) {
    size_t nearest = i;
    for (size_t g = 0; g < f->order; ++g) {
        const size_t j = f->to[g * f->count + i];
        const double more = apart(f, j, 0) - apart(f, nearest, 0);
        if (more < -SAME_PLACE || (more <= SAME_PLACE && j < nearest))
            nearest = j;
    }
    return nearest;
}

static void add_to_unit(finder *f, size_t i, ov_symmetry *made) {
    const ovoid_molecule *const m = f->molecule;
    const size_t u = made->units++;
    made->placement[u] = i;
    made->atoms[u] = m->parts[m->placements[i].part].atoms;
    made->unit_atoms += made->atoms[u];
}

/* One placement of each orbit. */
static void choose_unit(finder *f, ov_symmetry *made) {
    memset(f->taken, 0, f->count * sizeof *f->taken);
    for (size_t i = 0; i < f->count; ++i) {
        if (f->taken[i])
            continue;
        for (size_t g = 0; g < f->order; ++g)
            f->taken[f->to[g * f->count + i]] = true;
        add_to_unit(f, nearest_image(f, i), made);
    }
    for (size_t g = 0; g < f->order; ++g)
        for (size_t u = 0; u < made->units; ++u) {
            const size_t i = f->to[g * f->count + made->placement[u]];
            made->first[g * made->units + u] = (size_t)f->molecule->placements[i].first;
        }
}

/* ---- all of it ------------------------------------------------------------------------------- */

static ovoid_status find(ovoid_context *context, finder *f, ov_symmetry *made) {
    const size_t n = f->count;
    f->placed = ov_alloc(context, n, sizeof *f->placed, "an assembly");
    f->at = ov_alloc(context, n, sizeof *f->at, "an assembly");
    f->motion = ov_alloc(context, n, sizeof *f->motion, "an assembly");
    f->to = ov_alloc(context, n * n, sizeof *f->to, "an assembly");
    f->taken = ov_alloc(context, n, sizeof *f->taken, "an assembly");
    made->placement = ov_alloc(context, n, sizeof *made->placement, "an assembly");
    made->atoms = ov_alloc(context, n, sizeof *made->atoms, "an assembly");
    made->first = ov_alloc(context, n, sizeof *made->first, "an assembly");
    if (!f->placed || !f->at || !f->motion || !f->to || !f->taken || !made->placement ||
        !made->atoms || !made->first)
        return OVOID_ERROR_MEMORY;
    list_placements(f);
    find_motions(f);
    if (f->order > 0) {
        choose_unit(f, made);
        made->order = f->order;
        made->motion = f->motion;
        f->motion = NULL;
    }
    return OVOID_OK;
}

ovoid_status ov_symmetry_find(ovoid_context *context, const ovoid_molecule *molecule,
                              ov_symmetry *symmetry) {
    finder f = {.molecule = molecule, .count = molecule->placement_count};
    ov_symmetry made = {0};
    ovoid_status status = OVOID_OK;
    if (f.count > 0 && f.count <= PLACEMENTS_MAX)
        status = find(context, &f, &made);
    free(f.placed);
    free(f.at);
    free(f.motion);
    free(f.to);
    free(f.taken);
    if (status != OVOID_OK || made.order == 0)
        ov_symmetry_destroy(&made);
    *symmetry = made;
    return status;
}

void ov_symmetry_destroy(ov_symmetry *symmetry) {
    free(symmetry->motion);
    free(symmetry->placement);
    free(symmetry->atoms);
    free(symmetry->first);
    *symmetry = (ov_symmetry){0};
}

ovoid_status ov_symmetry_unit(ovoid_context *context, const ovoid_molecule *molecule,
                              const ov_symmetry *symmetry, double **xyzr) {
    double *const made = ov_alloc(context, 4 * symmetry->unit_atoms, sizeof *made, "atoms");
    double *next = made;
    if (!made)
        return OVOID_ERROR_MEMORY;
    for (size_t u = 0; u < symmetry->units; ++u) {
        ov_placement_atoms(molecule, &molecule->placements[symmetry->placement[u]], next);
        next += 4 * symmetry->atoms[u];
    }
    *xyzr = made;
    return OVOID_OK;
}
