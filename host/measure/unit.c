/* How far the unit of a symmetric assembly goes among its images. */
#include "measure/cells.h"

#include "model/ellipsoid.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A surface is where one term at least comes to this share of the isovalue: eight of them together
 * make it. */
#define SHARE 0.125
/* Ellipsoids with longer half axes, angstrom, are looked at half way to their ends, too. */
#define LONG 10.0
/* Within the first of these, angstrom, an atom is as good as the place itself; beyond the last one
 * nothing is known to belong anywhere. */
enum { NEAR, FAR, FURTHEST, GRIDS };
static const double within[GRIDS] = {5.0, 24.0, 120.0};

typedef struct finder {
    const ov_quadric *atoms;
    size_t count;
    const ov_rigid *back;
    size_t images;
    double level;
    ov_box box; /* of the atoms */
    ov_grid grid[GRIDS];
    ov_unit_ends ends;
} finder;

/* Finds the image with the atom nearest to a place, and the place as it lies to the unit from
 * there; how far it is from it, INFINITY: further than the grid reaches. */
static double find_nearest(const finder *f, int grid, const double place[3], double nearest[3]) {
    double least = INFINITY;
    for (size_t g = 0; g < f->images && !(grid == NEAR && isfinite(least)); ++g) {
        double at[3], square = 0.0;
        ov_rigid_move(&f->back[g], place, at);
        if (!ov_box_near(&f->box, at, within[grid]))
            continue;
        const uint32_t near =
            ov_grid_nearest(&f->grid[grid], f->atoms->centre, sizeof *f->atoms, at);
        for (size_t k = 0; near != OV_NOBODY && k < 3; ++k)
            square += (at[k] - f->atoms[near].centre[k]) * (at[k] - f->atoms[near].centre[k]);
        if (near == OV_NOBODY || square >= least)
            continue;
        least = square;
        memcpy(nearest, at, sizeof at);
    }
    return sqrt(least);
}

/* A place where the surface may be: what is near an atom is within the box about all of them. */
static void add_place(finder *f, const double place[3]) {
    double nearest[3];
    if (isfinite(find_nearest(f, NEAR, place, nearest)))
        return;
    double off = find_nearest(f, FAR, place, nearest);
    if (isinf(off))
        off = find_nearest(f, FURTHEST, place, nearest);
    if (isinf(off)) {
        f->ends.scattered = true;
        return;
    }
    f->ends.nearest = fmax(f->ends.nearest, off + within[NEAR]);
    ov_box_add(&f->ends.box, nearest, within[NEAR]);
}

/* Where an ellipsoid is: its middle, and all about it, so far out that it counts. */
static void add_ellipsoid(finder *f, const ovoid_ellipsoid *e) {
    const double q = log(e->amplitude / f->level);
    double r[3][3], longest = 0.0;
    if (!(q > 0.0))
        return;
    ov_rotation(e->angle, r);
    for (size_t p = 0; p < 3; ++p)
        longest = fmax(longest, sqrt(q / e->decay[p]));
    add_place(f, e->centre);
    for (int n = 0; n < 27; ++n) {
        const int side[3] = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
        const int sides = abs(side[0]) + abs(side[1]) + abs(side[2]);
        for (double share = 1.0; sides > 0 && share > (longest > LONG ? 0.4 : 0.6); share *= 0.5) {
            double place[3] = {e->centre[0], e->centre[1], e->centre[2]};
            for (size_t p = 0; p < 3; ++p)
                for (size_t k = 0; k < 3; ++k)
                    place[k] += share * side[p] * sqrt(q / e->decay[p] / sides) * r[p][k];
            add_place(f, place);
        }
    }
}

/* Likewise of a ball. */
static void add_ball(finder *f, const ovoid_field *field, size_t i) {
    const double *const from = field->quadrics[i].centre;
    double place[3] = {from[0], from[1], from[2]};
    ov_body body;
    ov_body_of_field(field, i, &body);
    const double reach = fmax(ov_body_reach(&body, f->level), 0.0) * body.extent[0];
    add_place(f, place);
    for (size_t end = 0; end < 6; ++end) {
        memcpy(place, from, sizeof place);
        place[end / 2] += end % 2 == 0 ? reach : -reach;
        add_place(f, place);
    }
}

ovoid_status ov_unit_find_ends(ovoid_context *context, const ovoid_field *original,
                               const ovoid_field *sparse, double isovalue, const ov_rigid *back,
                               size_t images, ov_unit_ends *ends) {
    ovoid_status status = OVOID_OK;
    finder f = {.atoms = original->quadrics,
                .count = original->count,
                .back = back,
                .images = images,
                .level = SHARE * isovalue,
                .box = ov_box_empty};
    for (size_t n = 0; n < GRIDS; ++n)
        OV_TRY(
            ov_grid_of(context, f.atoms->centre, sizeof *f.atoms, f.count, within[n], &f.grid[n]));
    for (size_t i = 0; i < f.count; ++i)
        ov_box_add(&f.box, f.atoms[i].centre, 0.0);
    f.ends.box = f.box;
    f.ends.nearest = 2.0 * within[NEAR];
    for (size_t k = 0; k < 3; ++k) {
        f.ends.box.low[k] -= within[NEAR];
        f.ends.box.high[k] += within[NEAR];
    }
    for (size_t i = 0; i < original->count; ++i)
        add_ball(&f, original, i);
    for (size_t i = 0; i < sparse->count; ++i)
        if (sparse->model)
            add_ellipsoid(&f, &sparse->model->unit[i]);
        else
            add_ball(&f, sparse, i);
    *ends = f.ends;
cleanup:
    for (size_t n = 0; n < GRIDS; ++n)
        ov_grid_destroy(&f.grid[n]);
    return status;
}
