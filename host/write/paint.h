/*
 * Surfaces of a scene with something at each vertex: how far the other surface is, the nearest
 * atom, a colour.
 */
#ifndef OV_PAINT_H
#define OV_PAINT_H

#include "write/scene.h"

/* All of it owned. */
typedef struct ov_painted {
    ovoid_mesh *mesh;  /* the molecule's surface, or without a molecule the first model's */
    float *difference; /* angstrom, at each vertex: how far outside the molecule's surface the
                          model's lies; NULL: not asked for */
    double range;      /* of its colours, angstrom */
    uint32_t *atom;    /* at each vertex the one whose Gaussian is largest there; NULL likewise */
    uint8_t *rgb;      /* red, green, blue (sRGB) of each vertex; NULL: all of one colour */
} ov_painted;

/* The surface, coloured as the options say; with_atoms: with the nearest atoms in any case. */
ovoid_status ov_paint(ovoid_context *context, const ov_scene *scene,
                      const ovoid_export_options *options, bool with_atoms, ov_painted *painted);
void ov_painted_drop(ov_painted *painted);

/* The end of a scale of colours: what the options say, or what 99 % of the values stay within,
 * rounded up to a number that reads well. */
ovoid_status ov_paint_range(ovoid_context *context, double asked, const float *values, size_t count,
                            double *range);

/* The next number not below `value`, at least 0.001, that reads well at the end of a scale. */
double ov_paint_round_up(double value);

/* Writers of meshes with colours; painted->rgb may be NULL. */
ovoid_status ov_write_painted_ply(ovoid_context *context, const ov_scene *scene,
                                  const ovoid_export_options *options, const char *title,
                                  FILE *stream);
ovoid_status ov_write_painted_glb(ovoid_context *context, const ov_scene *scene,
                                  const ovoid_export_options *options, const char *title,
                                  FILE *stream);
ovoid_status ov_write_3mf(ovoid_context *context, const ov_scene *scene,
                          const ovoid_export_options *options, const char *title, FILE *stream);

/* Two files: at `path`, and with its last five characters ".vert" replaced by ".face". */
ovoid_status ov_write_msms(ovoid_context *context, const ov_scene *scene,
                           const ovoid_export_options *options, const char *title,
                           const char *path);

#endif
