#include "write/paint.h"

#include "base/progress.h"
#include "neighbours/neighbours.h"
#include "picture/palette.h"
#include "write/mesh_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- scales --------------------------------------------------------------------------------- */

double ov_paint_round_up(double value) {
    static const double steps[] = {1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0};
    if (!(value > 1e-3))
        return 1e-3;
    const double power = pow(10.0, floor(log10(value) + 1e-9));
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        if (value <= steps[i] * power * (1.0 + 1e-6))
            return steps[i] * power;
    return 10.0 * power;
}

static int by_value(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

ovoid_status ov_paint_range(ovoid_context *context, double asked, const float *values, size_t count,
                            double *range) {
    *range = asked;
    if (asked > 0.0 || !count)
        return OVOID_OK;
    float *const sizes = ov_alloc(context, count, sizeof *sizes, "distances of vertices");
    if (!sizes)
        return OVOID_ERROR_MEMORY;
    for (size_t i = 0; i < count; i++)
        sizes[i] = fabsf(values[i]);
    qsort(sizes, count, sizeof *sizes, by_value);
    *range = ov_paint_round_up((double)sizes[(size_t)(0.99 * (double)(count - 1))]);
    free(sizes);
    return OVOID_OK;
}

/* ---- nearest atoms -------------------------------------------------------------------------- */

/* Of the atoms near a point, the one with the least |x - x_i|^2 - r_i^2: with one decay rate for
 * all, its Gaussian is the largest there. */
static uint32_t largest_atom(const double *xyzr, const uint32_t *near, size_t count,
                             const double at[3]) {
    uint32_t best = near[0];
    double least = INFINITY;
    for (size_t k = 0; k < count; k++) {
        const double *const a = xyzr + 4 * (size_t)near[k];
        const double d[3] = {a[0] - at[0], a[1] - at[1], a[2] - at[2]};
        const double power = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - a[3] * a[3];
        if (power < least) {
            least = power;
            best = near[k];
        }
    }
    return best;
}

/* The largest Gaussian of n at a point of the surface is at least c / n: how far its atom is. */
static double reach_of(const ov_scene *scene, const double *xyzr, size_t atoms) {
    double radius = 0.0;
    for (size_t i = 0; i < atoms; i++)
        radius = fmax(radius, xyzr[4 * i + 3]);
    const double spread = log(fmax((double)atoms / scene->isovalue, 1.0)) / scene->decay;
    return sqrt(radius * radius + spread) + 0.1;
}

static ovoid_status find_atoms(ovoid_context *context, const ov_scene *scene, ov_painted *p) {
    ovoid_status status = OVOID_OK;
    const size_t atoms = ovoid_molecule_atoms(scene->molecule);
    const size_t vertices = ovoid_mesh_vertices(p->mesh);
    ov_grid grid = {0};
    uint32_t near[2 * OV_NEAR_MAX];
    p->atom = ov_alloc(context, vertices, sizeof *p->atom, "atoms of vertices");
    if (!p->atom)
        return OVOID_ERROR_MEMORY;
    OV_TRY(ovoid_molecule_expand(context, scene->molecule));
    const double *const xyzr = ovoid_molecule_xyzr(scene->molecule);
    OV_TRY(ov_grid_of(context, xyzr, 4 * sizeof *xyzr, atoms, reach_of(scene, xyzr, atoms), &grid));
    for (size_t v = 0; v < vertices; v++) {
        const double *const at = ovoid_mesh_xyz(p->mesh) + 3 * v;
        OV_TRY(ov_progress_turn(context, v, vertices));
        const size_t found = ov_grid_near(&grid, at, (uint32_t)atoms, near);
        p->atom[v] = found ? largest_atom(xyzr, near, found, at) : 0;
    }
cleanup:
    ov_grid_destroy(&grid);
    return status;
}

/* ---- colours -------------------------------------------------------------------------------- */

static ovoid_status colour_by(ovoid_context *context, ov_painted *p, const uint32_t *entry,
                              const ov_colour palette[OV_PALETTE_SIZE]) {
    const size_t vertices = ovoid_mesh_vertices(p->mesh);
    p->rgb = ov_alloc(context, 3 * vertices, sizeof *p->rgb, "colours of vertices");
    if (!p->rgb)
        return OVOID_ERROR_MEMORY;
    for (size_t v = 0; v < vertices; v++)
        for (size_t k = 0; k < 3; k++)
            p->rgb[3 * v + k] = ov_srgb_encode((double)palette[entry[v] % OV_PALETTE_SIZE].rgba[k]);
    return OVOID_OK;
}

static void entries_of_difference(const ov_painted *p, uint32_t *entry) {
    for (size_t v = 0; v < ovoid_mesh_vertices(p->mesh); v++) {
        const double share = fmin(fmax((double)p->difference[v] / p->range, -1.0), 1.0);
        entry[v] = (uint32_t)lround(0.5 * (share + 1.0) * (OV_PALETTE_SIZE - 1));
    }
}

/* The number of a residue's chain: that of an earlier residue of it, or the next one. */
static uint32_t chain_of(const ovoid_residue *residues, const uint32_t *number, uint32_t residue,
                         uint32_t *chains) {
    for (uint32_t i = residue; i-- > 0;)
        if (strcmp(residues[i].chain, residues[residue].chain) == 0)
            return number[i];
    return (*chains)++;
}

static ovoid_status entries_of_residues(ovoid_context *context, const ov_scene *scene,
                                        const ov_painted *p, bool chains, uint32_t *entry) {
    size_t count, placement;
    uint32_t known = 0;
    const ovoid_atom *const atoms = ovoid_molecule_identity(scene->molecule);
    const ovoid_residue *const residues = ovoid_molecule_residues(scene->molecule, &count);
    if (!atoms)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "the molecule does not name its residues: no colours by %s",
                       chains ? "chain" : "residue");
    uint32_t *const number = ov_alloc(context, count, sizeof *number, "colours of residues");
    if (!number)
        return OVOID_ERROR_MEMORY;
    for (uint32_t i = 0; i < count; i++)
        number[i] = chains ? chain_of(residues, number, i, &known) : i;
    for (size_t v = 0; v < ovoid_mesh_vertices(p->mesh); v++)
        entry[v] =
            number[atoms[ovoid_molecule_origin(scene->molecule, p->atom[v], &placement)].residue];
    free(number);
    return OVOID_OK;
}

static ovoid_status entries_of_ellipsoids(ovoid_context *context, const ov_scene *scene,
                                          const ov_painted *p, uint32_t *entry) {
    uint32_t *owner = NULL;
    const ovoid_status status = ov_scene_owner(context, scene->molecule, scene->models[0], &owner);
    for (size_t v = 0; status == OVOID_OK && v < ovoid_mesh_vertices(p->mesh); v++)
        entry[v] = owner[p->atom[v]];
    free(owner);
    return status;
}

static ovoid_status find_difference(ovoid_context *context, const ov_scene *scene,
                                    const ovoid_export_options *options, ov_painted *p) {
    ovoid_status status = OVOID_OK;
    ovoid_mesh *other = NULL;
    OV_TRY(ov_scene_mesh(context, scene->fields[0], 0.0, options->spacing, &other));
    OV_TRY(ov_scene_distances(context, p->mesh, other, scene->fields[0],
                              ovoid_model_isovalue(scene->models[0]), &p->difference));
    OV_TRY(ov_paint_range(context, options->range, p->difference, ovoid_mesh_vertices(p->mesh),
                          &p->range));
cleanup:
    ovoid_mesh_destroy(&other);
    return status;
}

static ovoid_status colour(ovoid_context *context, const ov_scene *scene,
                           const ovoid_export_options *options, ovoid_colouring colouring,
                           ov_painted *p) {
    ovoid_status status = OVOID_OK;
    ov_colour palette[OV_PALETTE_SIZE];
    uint32_t *const entry =
        ov_alloc(context, ovoid_mesh_vertices(p->mesh), sizeof *entry, "colours of vertices");
    if (!entry)
        return OVOID_ERROR_MEMORY;
    ov_palette_distinct(palette);
    if (colouring == OVOID_COLOUR_DIFFERENCE) {
        ov_palette_diverging(palette);
        OV_TRY(find_difference(context, scene, options, p));
        entries_of_difference(p, entry);
    } else if (colouring == OVOID_COLOUR_ELLIPSOID) {
        OV_TRY(entries_of_ellipsoids(context, scene, p, entry));
    } else {
        OV_TRY(entries_of_residues(context, scene, p, colouring == OVOID_COLOUR_CHAIN, entry));
    }
    OV_TRY(colour_by(context, p, entry, palette));
cleanup:
    free(entry);
    return status;
}

/* ---- the whole ------------------------------------------------------------------------------ */

static ovoid_status choose_colouring(ovoid_context *context, const ov_scene *scene,
                                     ovoid_colouring asked, ovoid_colouring *chosen) {
    const bool both = scene->molecule && scene->count;
    *chosen = asked != OVOID_COLOUR_AUTO ? asked
              : both                     ? OVOID_COLOUR_DIFFERENCE
                                         : OVOID_COLOUR_PLAIN;
    if (!both && (*chosen == OVOID_COLOUR_DIFFERENCE || *chosen == OVOID_COLOUR_ELLIPSOID))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "colours by %s take a molecule and a model",
                       *chosen == OVOID_COLOUR_DIFFERENCE ? "difference" : "ellipsoid");
    if (!scene->molecule && *chosen != OVOID_COLOUR_PLAIN)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "colours by chain or residue take a molecule");
    return OVOID_OK;
}

ovoid_status ov_paint(ovoid_context *context, const ov_scene *scene,
                      const ovoid_export_options *options, bool with_atoms, ov_painted *painted) {
    ovoid_status status = OVOID_OK;
    ovoid_colouring colouring;
    *painted = (ov_painted){0};
    OV_TRY(choose_colouring(context, scene, options->colouring, &colouring));
    if (scene->original)
        OV_TRY(ov_scene_mesh(context, scene->original, scene->isovalue, options->spacing,
                             &painted->mesh));
    else
        OV_TRY(ov_scene_mesh(context, scene->fields[0], 0.0, options->spacing, &painted->mesh));
    if (with_atoms || colouring > OVOID_COLOUR_DIFFERENCE)
        OV_TRY(find_atoms(context, scene, painted));
    if (colouring != OVOID_COLOUR_PLAIN)
        OV_TRY(colour(context, scene, options, colouring, painted));
cleanup:
    if (status != OVOID_OK)
        ov_painted_drop(painted);
    return status;
}

void ov_painted_drop(ov_painted *painted) {
    ovoid_mesh_destroy(&painted->mesh);
    free(painted->difference);
    free(painted->atom);
    free(painted->rgb);
    *painted = (ov_painted){0};
}

/* ---- PLY and glTF --------------------------------------------------------------------------- */

typedef ovoid_status (*writer)(ovoid_context *context, const ovoid_mesh *mesh,
                               const ov_colours *colours, FILE *stream);

static ovoid_status write_painted(ovoid_context *context, const ov_scene *scene,
                                  const ovoid_export_options *options, writer write, FILE *stream) {
    ov_painted painted;
    ovoid_status status = ov_paint(context, scene, options, false, &painted);
    if (status != OVOID_OK)
        return status;
    const ov_colours colours = {painted.rgb, painted.difference};
    (void)ov_progress_stage(context, "write");
    status = write(context, painted.mesh, painted.rgb ? &colours : NULL, stream);
    ov_painted_drop(&painted);
    return status;
}

ovoid_status ov_write_painted_ply(ovoid_context *context, const ov_scene *scene,
                                  const ovoid_export_options *options, const char *title,
                                  FILE *stream) {
    (void)title;
    return write_painted(context, scene, options, ov_write_ply_with, stream);
}

ovoid_status ov_write_painted_glb(ovoid_context *context, const ov_scene *scene,
                                  const ovoid_export_options *options, const char *title,
                                  FILE *stream) {
    (void)title;
    return write_painted(context, scene, options, ov_write_glb_with, stream);
}
