/*
 * How good a fit is where its parts meet: seams MOLECULE
 *
 * Fits the molecule as a whole and cut into 4 and 16 parts, to the default tolerance and by ratio
 * (0.066, with effort 0 and 1), and measures what lies within 5 angstrom of the seams between 4, or
 * 16, parts beside what lies elsewhere; of the whole, too, in the same places. Prints CSV: of both
 * surfaces, meshed 0.5 angstrom apart, area and its error, volume (by points 0.5 angstrom apart)
 * and its error, the mean distance of vertices from the other surface weighted with their areas,
 * and the deviation, the largest one of a vertex of an exposed piece.
 */
#include "measure/compare.h"
#include "measure/partition.h"
#include "mesh/mesh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NEAR 5.0 /* angstrom from a seam */
#define STEP 0.5 /* angstrom: of meshes, and of points that volumes are counted by */
#define RATIO 0.066

enum { ORIGINAL, MODEL, SIDES };
enum { SEAM, ELSEWHERE, REGIONS };
static const char *const region_names[REGIONS] = {"seam", "elsewhere"};
static const size_t cuts[] = {4, 16};

typedef struct region {
    double area[SIDES], volume[SIDES], distance, weight, deviation;
} region;

typedef struct subject {
    ovoid_context *context;
    ovoid_molecule *molecule;
    const double *xyzr;
    size_t atoms;
    ovoid_field *field[SIDES];
    ovoid_mesh *mesh[SIDES];
    float *distance[SIDES]; /* of vertices from the other surface */
} subject;

static void check(const subject *s, ovoid_status status) {
    if (status == OVOID_OK)
        return;
    fprintf(stderr, "seams: %s\n", ovoid_context_error(s->context));
    exit(1);
}

static void *allocate(size_t count, size_t size) {
    void *const made = calloc(count, size);
    if (!made) {
        fputs("seams: out of memory\n", stderr);
        exit(1);
    }
    return made;
}

/* ---- where ----------------------------------------------------------------------------------- */

/* Within reach of the cells of two parts. */
static int region_of(const ov_partition *cut, const double at[3]) {
    size_t near = 0;
    for (size_t p = 0; p < cut->count; ++p)
        near += ov_box_distance(&cut->part[p].cell, at) < NEAR;
    return near > 1 ? SEAM : ELSEWHERE;
}

static size_t part_atoms(const subject *s, size_t parts) {
    return (s->atoms + parts - 1) / parts;
}

/* ---- how much -------------------------------------------------------------------------------- */

static void add_surface(const subject *s, const ov_partition *cut, int side, region *regions) {
    const ovoid_mesh *const mesh = s->mesh[side];
    for (size_t t = 0; t < mesh->triangles; ++t) {
        double centre[3];
        const double origin[3] = {0.0, 0.0, 0.0};
        ov_content content = {0.0, 0.0};
        ov_mesh_centre(mesh, t, centre);
        region *const of = &regions[region_of(cut, centre)];
        ov_mesh_flat_triangle(mesh, t, origin, &content);
        of->area[side] += content.area;
        of->weight += content.area;
        for (size_t i = 0; i < 3; ++i)
            of->distance +=
                content.area / 3.0 * (double)s->distance[side][mesh->corners[3 * t + i]];
    }
    for (size_t v = 0; v < mesh->vertices; ++v) {
        double at[3];
        ov_mesh_at(mesh, v, at);
        region *const of = &regions[region_of(cut, at)];
        if (ov_mesh_is_exposed(mesh, v))
            of->deviation = fmax(of->deviation, (double)s->distance[side][v]);
    }
}

static void bound(const subject *s, double low[3], double high[3]) {
    for (size_t k = 0; k < 3; ++k) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (size_t v = 0; v < s->mesh[ORIGINAL]->vertices; ++v) {
            double at[3];
            ov_mesh_at(s->mesh[ORIGINAL], v, at);
            low[k] = fmin(low[k], at[k] - 4.0);
            high[k] = fmax(high[k], at[k] + 4.0);
        }
    }
}

/* Points inside, a plane of them at a time. */
static void add_volumes(const subject *s, const ov_partition *cut, region *regions) {
    double low[3], high[3];
    bound(s, low, high);
    const size_t nx = (size_t)((high[0] - low[0]) / STEP), ny = (size_t)((high[1] - low[1]) / STEP);
    double *const xyz = allocate(nx * ny, 3 * sizeof *xyz);
    double *const value = allocate(nx * ny, sizeof *value);
    for (double z = low[2]; z < high[2]; z += STEP) {
        for (size_t k = 0; k < nx * ny; ++k) {
            xyz[3 * k] = low[0] + STEP * (double)(k % nx);
            xyz[3 * k + 1] = low[1] + STEP * (double)(k / nx);
            xyz[3 * k + 2] = z;
        }
        for (int side = 0; side < SIDES; ++side) {
            check(s, ovoid_field_evaluate(s->context, s->field[side], xyz, nx * ny, value, NULL));
            for (size_t k = 0; k < nx * ny; ++k)
                if (value[k] > OVOID_DEFAULT_ISOVALUE)
                    regions[region_of(cut, xyz + 3 * k)].volume[side] += STEP * STEP * STEP;
        }
    }
    free(xyz);
    free(value);
}

/* ---- the table ------------------------------------------------------------------------------- */

static void mesh(subject *s, int side) {
    ovoid_mesh_options options;
    ovoid_mesh_options_init(&options, sizeof options);
    options.spacing = STEP;
    check(s, ovoid_field_mesh(s->context, s->field[side], &options, &s->mesh[side]));
    s->distance[side] = allocate(s->mesh[side]->vertices, sizeof(float));
}

static double error_of(const double pair[SIDES]) {
    return fabs(pair[MODEL] - pair[ORIGINAL]) / pair[ORIGINAL];
}

static void print_rows(subject *s, const char *goal, size_t parts, size_t ellipsoids,
                       size_t seams) {
    ov_partition cut = {.near = NEAR, .image = &ov_rigid_identity, .images = 1};
    region regions[REGIONS] = {0};
    check(s, ov_partition_create(s->context, s->xyzr, s->atoms, part_atoms(s, seams), &cut));
    for (int side = 0; side < SIDES; ++side)
        add_surface(s, &cut, side, regions);
    add_volumes(s, &cut, regions);
    for (int n = 0; n < REGIONS; ++n)
        printf("%s,%zu,%zu,%zu,%s,%.0f,%.4f,%.0f,%.5f,%.4f,%.4f\n", goal, parts, ellipsoids,
               cut.count, region_names[n], regions[n].area[ORIGINAL], error_of(regions[n].area),
               regions[n].volume[ORIGINAL], error_of(regions[n].volume),
               regions[n].distance / regions[n].weight, regions[n].deviation);
    fflush(stdout);
    ov_partition_destroy(&cut);
}

/* Seams of its own; a whole is looked at where the others have theirs. */
static void measure(subject *s, const char *goal, size_t parts, const ovoid_model *model) {
    ovoid_distances all;
    check(s, ovoid_field_of_model(s->context, model, &s->field[MODEL]));
    mesh(s, MODEL);
    check(s, ov_mesh_distances(s->context, s->mesh[ORIGINAL], s->mesh[MODEL], false, &all,
                               s->distance[ORIGINAL], s->distance[MODEL], NULL));
    for (size_t n = 0; n < sizeof cuts / sizeof *cuts; ++n)
        if (parts == 1 || parts == cuts[n])
            print_rows(s, goal, parts, ovoid_model_size(model), cuts[n]);
    ovoid_mesh_destroy(&s->mesh[MODEL]);
    ovoid_field_destroy(&s->field[MODEL]);
    free(s->distance[MODEL]);
}

static const struct {
    const char *name;
    ovoid_goal goal;
    uint32_t effort;
} goals[] = {{"default", OVOID_GOAL_TOLERANCE, 1},
             {"ratio 0.066 effort 0", OVOID_GOAL_RATIO, 0},
             {"ratio 0.066", OVOID_GOAL_RATIO, 1}};

static void fit(subject *s, size_t goal, size_t parts) {
    ovoid_fit_options options;
    ovoid_model *model = NULL;
    ovoid_fit_options_init(&options, sizeof options);
    options.adaptive.goal = goals[goal].goal;
    options.adaptive.effort = goals[goal].effort;
    options.adaptive.ratio = RATIO;
    options.parts.atoms = parts > 1 ? (uint32_t)part_atoms(s, parts) : 0;
    check(s, ovoid_fit(s->context, s->molecule, &options, &model, NULL));
    measure(s, goals[goal].name, parts, model);
    ovoid_model_destroy(&model);
}

int main(int argc, char **argv) {
    static const size_t parts[] = {1, 4, 16};
    subject s = {0};
    if (argc != 2) {
        fputs("usage: seams MOLECULE\n", stderr);
        return 2;
    }
    if (ovoid_context_create(&s.context) != OVOID_OK)
        return 1;
    check(&s, ovoid_molecule_read(s.context, argv[1], OVOID_MOLECULE_AUTO, &s.molecule));
    s.xyzr = ovoid_molecule_xyzr(s.molecule);
    s.atoms = ovoid_molecule_atoms(s.molecule);
    check(&s, ovoid_field_of_molecule(s.context, s.molecule, OVOID_DEFAULT_DECAY,
                                      OVOID_DEFAULT_ISOVALUE, &s.field[ORIGINAL]));
    mesh(&s, ORIGINAL);
    printf("# ovoid %s, %s; bench/seams %s\n", ovoid_version(),
           ovoid_context_device(s.context)->name,
           strrchr(argv[1], '/') ? strrchr(argv[1], '/') + 1 : argv[1]);
    puts("goal,parts,ellipsoids,seams_of,region,area,area_error,volume,volume_error,mean_distance,"
         "deviation");
    for (size_t goal = 0; goal < sizeof goals / sizeof *goals; ++goal)
        for (size_t n = 0; n < sizeof parts / sizeof *parts; ++n)
            fit(&s, goal, parts[n]);
    free(s.distance[ORIGINAL]);
    ovoid_mesh_destroy(&s.mesh[ORIGINAL]);
    ovoid_field_destroy(&s.field[ORIGINAL]);
    ovoid_molecule_destroy(&s.molecule);
    ovoid_context_destroy(&s.context);
    return 0;
}
