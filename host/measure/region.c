/*
 * Judging a model where no more than a box counts, as of a part of a molecule: there alone. What is
 * hidden beyond the box is so in the original.
 */
#include "measure/excerpt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool ov_judge_is_regional(const ov_judge *judge) {
    return judge->in_region && isinf(judge->stray) && !judge->whole;
}

void ov_region_destroy(ov_region *region) {
    ov_trail_destroy(&region->own);
    ov_trail_destroy(&region->about);
    free(region->outside);
    free(region->hidden);
    ov_grid_destroy(&region->grid);
    *region = (ov_region){0};
}

/* A component that leaves the region is held against what the original has this near, angstrom: one
 * in so many of its vertices, which are far nearer to each other. */
#define NEAR 3.0
#define KEPT_EVERY 4

/* Some of the original's vertices about the region. */
static ovoid_status find_outside(ov_judge *judge, const ov_box *about) {
    ovoid_status status = OVOID_OK;
    const ovoid_mesh *const mesh = judge->mesh;
    ov_region *const region = &judge->known;
    size_t room = 0, flags = 0;
    for (size_t v = 0; v < mesh->vertices; v += KEPT_EVERY) {
        double at[3];
        const size_t n = region->outside_count;
        ov_mesh_at(mesh, v, at);
        if (!ov_box_near(about, at, NEAR) || ov_box_near(&judge->region, at, 0.0))
            continue;
        OV_TRY(ov_grow(judge->context, (void *)&region->outside, &room, 3 * (n + 1),
                       sizeof *region->outside, "points of a mesh"));
        OV_TRY(ov_grow(judge->context, (void *)&region->hidden, &flags, n + 1,
                       sizeof *region->hidden, "points of a mesh"));
        memcpy(region->outside + 3 * n, at, sizeof at);
        region->hidden[n] = !ov_mesh_is_exposed(mesh, v);
        ++region->outside_count;
    }
    if (region->outside_count > 0)
        OV_TRY(ov_grid_of(judge->context, region->outside, 3 * sizeof *region->outside,
                          region->outside_count, NEAR, &region->grid));
cleanup:
    return status;
}

/* What is known of the original there, unless it is known already with as much room. */
static ovoid_status know_region(ov_judge *judge, double room) {
    ovoid_status status = OVOID_OK;
    ov_region *const region = &judge->known;
    const ov_box about = ov_box_larger(&judge->region, room);
    if (region->room >= room)
        return OVOID_OK;
    if (judge->laid == &region->about)
        judge->laid = NULL;
    ov_region_destroy(region);
    OV_TRY(find_outside(judge, &about));
    OV_TRY(ov_excerpt_original(judge, &judge->region, &region->own));
    OV_TRY(ov_excerpt_original(judge, &about, &region->about));
    region->room = room;
cleanup:
    if (status != OVOID_OK)
        ov_region_destroy(region);
    return status;
}

ovoid_status ov_judge_region(ov_judge *judge, const ov_quadric *quadrics, size_t count,
                             double least, ov_spot_list *found, double *farthest, bool *looked) {
    ovoid_status status = OVOID_OK;
    const double room = ov_excerpt_room(judge, least);
    const ov_excerpt_asked asked = {.judge = judge,
                                    .quadrics = quadrics,
                                    .count = count,
                                    .least = least,
                                    .marcher = judge->marcher,
                                    .box = &judge->region,
                                    .region = &judge->known};
    *farthest = 0.0;
    *looked = false;
    OV_TRY(know_region(judge, room));
    if (judge->known.about.triangles == 0)
        goto cleanup;
    OV_TRY(ov_judge_lay(judge, &judge->known.about));
    judge->seen.known = false;
    OV_TRY(ov_excerpt_look(&asked, found, farthest, looked));
    judge->seen.box = ov_box_larger(&judge->region, room);
    if (*looked)
        OV_TRY(ov_seen_model(judge, quadrics, count, least, found->spot, found->count));
cleanup:
    ov_marcher_clip(judge->marcher, NULL, NULL);
    if (status != OVOID_OK || !*looked)
        found->count = 0;
    return status;
}
