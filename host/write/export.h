/*
 * Models and fields for other programs: what the formats share, and one writer each.
 *
 * Writers of text expect the "C" locale. A failed write shows in the stream's error flag; they stop
 * at it, and where the context's progress callback says so.
 */
#ifndef OV_EXPORT_H
#define OV_EXPORT_H

#include "base/base.h"
#include "field/quadric.h"
#include "ovoid/ovoid.h"

#include <stdio.h>

/* ---- ellipsoids --------------------------------------------------------------------------- */

/* How ellipsoids are drawn: the options, with nothing left open. */
typedef struct ov_drawing {
    double isovalue;
    double colour[3], opacity;
    char title[64]; /* letters, digits, '-' and '_' */
} ov_drawing;

/* One as a solid: x = centre + sum_p t_p semi[p] axis[p] with |t| <= 1. The axes are unit vectors
 * and right-handed. */
typedef struct ov_solid {
    double centre[3];
    double semi[3];
    double axis[3][3];
} ov_solid;

/* The isosurface of one ellipsoid's Gaussian at the isovalue, or, where it nowhere reaches that, at
 * half its amplitude. */
void ov_solid_of_ellipsoid(const ovoid_ellipsoid *ellipsoid, double isovalue, ov_solid *solid);

/* The rotation that takes x, y and z to the solid's axes: about this unit vector by this angle
 * (degrees, 0 to 180). */
void ov_solid_rotation(const ov_solid *solid, double vector[3], double *angle);

/* The same as a quaternion x, y, z, w of length 1, with w >= 0. */
void ov_solid_quaternion(const ov_solid *solid, double q[4]);

/* One of a model's ellipsoids, to be written to a stream. */
typedef struct ov_drawn {
    ovoid_context *context;
    const ov_drawing *drawing;
    const ovoid_ellipsoid *ellipsoid;
    size_t index; /* from 0 */
    ov_solid solid;
    FILE *stream;
} ov_drawn;

typedef ovoid_status (*ov_drawn_writer)(const ov_drawn *drawn);

/* Has each of the model's ellipsoids written, in their order, until a write fails or the context's
 * progress callback says stop. */
ovoid_status ov_write_each(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, ov_drawn_writer write, FILE *stream);

/* Of the Gaussian a exp(-z^T A z): its integral over all space, a sqrt(pi^3 / det A), angstrom^3;
 * and (2 A)^-1 = R^T diag(1 / (2 d)) R, as xx, xy, xz, yy, yz, zz, angstrom^2. */
double ov_ellipsoid_integral(const ovoid_ellipsoid *ellipsoid);
void ov_ellipsoid_covariance(const ovoid_ellipsoid *ellipsoid, double c[6]);

ovoid_status ov_write_bild(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_cxc(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_pymol(ovoid_context *context, const ovoid_model *model,
                            const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_gmm(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_json(ovoid_context *context, const ovoid_model *model,
                           const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_xyz(ovoid_context *context, const ovoid_model *model,
                          const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_lammps(ovoid_context *context, const ovoid_model *model,
                             const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_anisou(ovoid_context *context, const ovoid_model *model,
                             const ov_drawing *drawing, FILE *stream);
ovoid_status ov_write_splat(ovoid_context *context, const ovoid_model *model,
                            const ov_drawing *drawing, FILE *stream);

/* ---- maps --------------------------------------------------------------------------------- */

/* A field on the lattice of points spacing * (start + i), i = 0 .. size - 1 in each axis. */
typedef struct ov_map {
    const ov_quadric *quadrics; /* not owned */
    size_t count;
    struct ov_evaluator *evaluator; /* of the quadrics; not owned */
    double spacing;                 /* angstrom */
    int32_t start[3];               /* x, y, z */
    int32_t size[3];
    char label[80]; /* what field it is */
} ov_map;

/* Sets the lattice: it covers the region where a Gaussian is at least isovalue / 100.
 * OVOID_ERROR_LIMIT when it has too many points. */
ovoid_status ov_map_cover(ovoid_context *context, ov_map *map, double isovalue);

uint64_t ov_map_points(const ov_map *map);

/* Takes the next values of a map. */
typedef void (*ov_map_sink)(const float *values, size_t count, void *user);

/* Computes the field piece by piece, fast[0] the axis that runs fastest, fast[2] slowest, until all
 * is done, a write to `stream` fails, or the context's progress callback says stop. */
ovoid_status ov_map_run(ovoid_context *context, const ov_map *map, const int fast[3], FILE *stream,
                        ov_map_sink sink, void *user);

ovoid_status ov_write_ccp4(ovoid_context *context, const ov_map *map, FILE *stream);
ovoid_status ov_write_dx(ovoid_context *context, const ov_map *map, FILE *stream);

#endif
