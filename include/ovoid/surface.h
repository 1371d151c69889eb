/*
 * Surfaces of molecules and models: meshes, areas, volumes, distances, pictures, export.
 *
 * Conventions as in ovoid.h: angstrom, statuses, ownership, one thread per context.
 */
#ifndef OVOID_SURFACE_H
#define OVOID_SURFACE_H

#include "ovoid/ovoid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define OVOID_DEFAULT_MESH_SPACING 0.5 /* angstrom; the paper's areas and volumes fit it */

/* ---- meshes ------------------------------------------------------------------------------- */

/* A closed triangle mesh of a surface phi = c: vertices shared, triangles counter-clockwise seen
 * from outside (where phi <= c). No two vertices are equal, no triangle is without area. */
typedef struct ovoid_mesh ovoid_mesh;

/* Where the vertices lie on the edges of the lattice. */
typedef enum ovoid_vertex_rule {
    OVOID_VERTEX_EXACT = 0, /* on the surface, to about 1e-5 angstrom: Newton steps on the device */
    OVOID_VERTEX_LINEAR /* where phi, interpolated linearly along the edge, is c: what the paper's
                           isosurface function does */
} ovoid_vertex_rule;

typedef struct ovoid_mesh_options {
    double isovalue; /* c */
    double spacing;  /* of the marching-cubes lattice, angstrom */
    ovoid_vertex_rule vertices;
} ovoid_mesh_options;

/* isovalue 1, spacing OVOID_DEFAULT_MESH_SPACING, exact vertices. */
OVOID_API void ovoid_mesh_options_init(ovoid_mesh_options *options);

/* Marching cubes on the device over the lattice of multiples of `spacing` that covers the surface;
 * the lattice grows until the surface is closed inside it. Pieces of the surface that are small to
 * the lattice, of single atoms and ellipsoids above all, are meshed on finer lattices, each the
 * last one halved; a warning counts what is smaller than a thousandth of the spacing. Time and
 * memory follow the surface, not the box. OVOID_ERROR_EMPTY when the field is nowhere above the
 * isovalue on the lattice, OVOID_ERROR_LIMIT when that would have more than 2e10 points and 1e5
 * for each atom or ellipsoid, or more than 1e12 values of Gaussians at them and 1e6 for each. */
OVOID_API ovoid_status ovoid_molecule_mesh(ovoid_context *context, const ovoid_molecule *molecule,
                                           double decay, const ovoid_mesh_options *options,
                                           ovoid_mesh **mesh);
OVOID_API ovoid_status ovoid_model_mesh(ovoid_context *context, const ovoid_model *model,
                                        const ovoid_mesh_options *options, ovoid_mesh **mesh);

/* Makes a mesh from arrays (copied): xyz and normals 3 * vertices (normals may be NULL: taken from
 * the triangles), corners 3 * triangles vertex indices. For meshes read from elsewhere, and for
 * tests. */
OVOID_API ovoid_status ovoid_mesh_create(ovoid_context *context, const double *xyz,
                                         const float *normals, size_t vertices,
                                         const uint32_t *corners, size_t triangles,
                                         ovoid_mesh **mesh);
OVOID_API void ovoid_mesh_destroy(ovoid_mesh **mesh);

OVOID_API size_t ovoid_mesh_vertices(const ovoid_mesh *mesh);
OVOID_API size_t ovoid_mesh_triangles(const ovoid_mesh *mesh);
OVOID_API const double *ovoid_mesh_xyz(const ovoid_mesh *mesh);    /* 3 * vertices, angstrom */
OVOID_API const float *ovoid_mesh_normals(const ovoid_mesh *mesh); /* 3 * vertices, outward unit */
OVOID_API const uint32_t *ovoid_mesh_corners(const ovoid_mesh *mesh); /* 3 * triangles */
/* Connected component of each vertex, 0 .. components - 1, vertices values. */
OVOID_API const uint32_t *ovoid_mesh_component_of(const ovoid_mesh *mesh);

/* One connected piece of a surface. */
typedef struct ovoid_component {
    uint64_t vertices, triangles;
    double area;   /* angstrom^2 */
    double volume; /* angstrom^3; negative for the wall of a cavity */
    bool outer;    /* encloses matter: its volume is positive */
    int32_t euler; /* vertices - edges + triangles: 2 - 2 genus where closed */
    bool closed;   /* every edge has two triangles, oppositely oriented */
} ovoid_component;
OVOID_API size_t ovoid_mesh_components(const ovoid_mesh *mesh);
OVOID_API const ovoid_component *ovoid_mesh_component(const ovoid_mesh *mesh, size_t index);

/* Area and volume of the flat triangles: the formulas of section 4.2 of the paper. */
OVOID_API double ovoid_mesh_area(const ovoid_mesh *mesh);
OVOID_API double ovoid_mesh_volume(const ovoid_mesh *mesh);

/* The same of the smooth surface that the vertices and their normals lie on: each edge is bent to
 * the height that its ends' normals ask for (sagitta of edge ij: (p_j - p_i) . (n_j - n_i) / 8),
 * each triangle to the quadratic patch through its three edges. The error is of fourth order in the
 * spacing. For exact vertices. */
OVOID_API double ovoid_mesh_smooth_area(const ovoid_mesh *mesh);
OVOID_API double ovoid_mesh_smooth_volume(const ovoid_mesh *mesh);

/* Writes a mesh by its extension: .ply (binary), .obj, .stl (binary), .off, .glb. Whole or not at
 * all. */
OVOID_API ovoid_status ovoid_mesh_write(ovoid_context *context, const ovoid_mesh *mesh,
                                        const char *path);

/* ---- distances ---------------------------------------------------------------------------- */

/* Distances from the points of a surface (its vertices and its triangles' centres) to the nearest
 * point of the other surface's triangles, both ways (as Metro does; section 4.2 of the paper). */
typedef struct ovoid_distances {
    double hausdorff; /* the larger of the two directed maxima, angstrom */
    double forward;   /* largest from a to b */
    double backward;  /* largest from b to a */
    double mean;      /* area-weighted mean, average of both directions */
    double rms;
} ovoid_distances;

/* On the device, through a tree of boxes over the triangles. outer_only leaves out components that
 * are not outer, of both meshes. from_a, when not NULL, receives the distance of each vertex of a
 * (0 for those left out). OVOID_ERROR_EMPTY when a mesh has no triangle that counts. */
OVOID_API ovoid_status ovoid_mesh_distances(ovoid_context *context, const ovoid_mesh *a,
                                            const ovoid_mesh *b, bool outer_only,
                                            ovoid_distances *distances, float *from_a);

/* ---- measures ----------------------------------------------------------------------------- */

typedef struct ovoid_pair {
    double original; /* of the molecule */
    double sparse;   /* of the model */
    double error;    /* |sparse - original| / original */
} ovoid_pair;

typedef struct ovoid_measure_options {
    double isovalue;
    double spacing; /* of both meshes, angstrom */
    ovoid_vertex_rule vertices;
    bool distances; /* also compute distances */
} ovoid_measure_options;

typedef struct ovoid_measures {
    ovoid_pair area; /* of the whole surfaces, angstrom^2: smooth with exact vertices, flat with */
    ovoid_pair volume;     /* linear ones; volume in angstrom^3 */
    ovoid_pair area_outer; /* of the outer components alone */
    ovoid_pair volume_outer;
    uint64_t components_original, components_sparse; /* connected pieces */
    uint64_t outer_original, outer_sparse;           /* of these, outer ones */
    ovoid_distances distances;
    ovoid_distances distances_outer;
    double deviation; /* largest distance of a vertex of either outer surface from the other whole
                         surface, angstrom: unlike the Hausdorff distance of the outer surfaces it
                         does not jump when the neck of a tunnel opens or closes, and unlike that of
                         the whole ones not with a small cavity. What a tolerance is about. */
    double seconds_mesh, seconds_distances;
} ovoid_measures;

OVOID_API void ovoid_measure_options_init(ovoid_measure_options *options);

/* Meshes both surfaces on the same lattice and compares them. decay is that of the model. */
OVOID_API ovoid_status ovoid_measure(ovoid_context *context, const ovoid_molecule *molecule,
                                     const ovoid_model *model, const ovoid_measure_options *options,
                                     ovoid_measures *measures);

/* ---- export ------------------------------------------------------------------------------- */

/* Files for other programs. Ellipsoids, of models alone: */
typedef enum ovoid_export_format {
    OVOID_EXPORT_AUTO = 0, /* by the extension */
    OVOID_EXPORT_BILD,     /* .bild, .bld: ChimeraX, one object of coarse ellipsoids */
    OVOID_EXPORT_CXC,      /* .cxc: ChimeraX commands, each ellipsoid a smooth surface of its own */
    OVOID_EXPORT_PYMOL,    /* .py: a script that loads the ellipsoids into PyMOL */
    OVOID_EXPORT_GMM,      /* .gmm: the Gaussian mixture text of gmconvert and gmfit */
    OVOID_EXPORT_JSON,     /* .json */
    /* and the field on a lattice, of models and molecules: */
    OVOID_EXPORT_CCP4, /* .mrc, .map, .ccp4: MRC2014, 32-bit floats */
    OVOID_EXPORT_DX    /* .dx: OpenDX text as APBS writes it */
} ovoid_export_format;

typedef struct ovoid_export_options {
    ovoid_export_format format;
    /* c. An ellipsoid is drawn where its own Gaussian is c: with semi-axes sqrt(ln(a / c) / d_p).
     * One that nowhere reaches c (a <= c) is drawn where it has half its amplitude, with semi-axes
     * sqrt(ln 2 / d_p). A map reaches to where each Gaussian has fallen to c / 100. 0: the model's,
     * or OVOID_DEFAULT_ISOVALUE of a molecule. */
    double isovalue;
    double spacing;       /* of a map, angstrom; its points are multiples of it */
    double colour[3];     /* red, green, blue from 0 to 1, of drawn ellipsoids */
    double opacity;       /* from 0 to 1, of drawn ellipsoids */
    double max_gigabytes; /* a map that would take more (1e9 bytes each) is refused */
} ovoid_export_options;

#define OVOID_DEFAULT_MAP_GIGABYTES 1.0

/* Format by extension, isovalue 0, spacing OVOID_DEFAULT_MESH_SPACING, an opaque blue, maps of up
 * to OVOID_DEFAULT_MAP_GIGABYTES. */
OVOID_API void ovoid_export_options_init(ovoid_export_options *options);

/* Writes a file for another program, whole or not at all; "-" is standard output and needs a
 * format. options may be NULL. OVOID_ERROR_ARGUMENT where the path's extension stands for another
 * format than the options name. A map is computed on the device and written piece by piece: memory
 * does not grow with it; OVOID_ERROR_LIMIT, before anything is computed, where it would take more
 * than max_gigabytes. */
OVOID_API ovoid_status ovoid_model_export(ovoid_context *context, const ovoid_model *model,
                                          const char *path, const ovoid_export_options *options);

/* As ovoid_model_export(), for the field of a molecule: maps alone. */
OVOID_API ovoid_status ovoid_molecule_export(ovoid_context *context, const ovoid_molecule *molecule,
                                             double decay, const char *path,
                                             const ovoid_export_options *options);

/* Name of a format as ovoid_export_format_find() takes it, "bild" for example; NULL for others. */
OVOID_API const char *ovoid_export_format_name(ovoid_export_format format);

/* The format of a name ("ccp4") or an extension ("mrc", with its dot or without), in any case of
 * letters; AUTO when there is none. */
OVOID_API ovoid_export_format ovoid_export_format_find(const char *name);

/* ---- pictures ----------------------------------------------------------------------------- */

/* What a picture shows. */
typedef enum ovoid_view {
    OVOID_VIEW_ORIGINAL = 0, /* the molecule's surface */
    OVOID_VIEW_MODEL,        /* the model's surface */
    OVOID_VIEW_OVERLAY,      /* the model's surface under the molecule's as tinted glass */
    OVOID_VIEW_DIFFERENCE,   /* the molecule's surface, coloured by how far outside it the model's
                                lies, (phi~ - phi) / |grad phi|, with a colour bar in angstrom */
    OVOID_VIEW_ELLIPSOIDS,   /* each ellipsoid by itself, where its own Gaussian is c; one whose
                                amplitude is at most c shows its centre alone */
    OVOID_VIEW_PANEL         /* original, model with centres, and overlay side by side */
} ovoid_view;

#define OVOID_PICTURE_SIDE_MAX 16384 /* pixels */
#define OVOID_PICTURE_SAMPLES_MAX 8  /* rays across a pixel */

/* A colour as 0xRRGGBBAA (sRGB). */
typedef struct ovoid_picture_options {
    ovoid_view view;
    uint32_t width, height; /* pixels, 1 .. OVOID_PICTURE_SIDE_MAX; of the whole panel */
    uint32_t samples;       /* rays across a pixel, 1 .. OVOID_PICTURE_SAMPLES_MAX: a pixel is the
                               mean of samples^2 rays */
    double isovalue;        /* c */
    double direction[3];    /* from the molecule to the eye; 0, 0, 0: along the least principal axis
                               of the atoms' centres. The longest one lies across the longer side. */
    double rotation[3]; /* about the screen's x (right), y (up), z (to the eye), radian: turns the
                           molecule after that, in this order */
    double centre[3];   /* angstrom, in the middle of the picture; NAN: chosen to fit */
    double across;      /* angstrom across the width of a picture; 0: chosen to fit */
    uint32_t original;  /* colours of the surfaces; opacity is not used */
    uint32_t model;
    uint32_t points;     /* of the centres */
    uint32_t background; /* opacity 00 makes it transparent */
    bool centres;        /* show the ellipsoids' centres in views of the model */
    bool colour_bar;     /* of the difference */
    double range;        /* of the difference's colours, angstrom to either side; 0: fits 99 % of
                            what is seen */
} ovoid_picture_options;

/* OVOID_VIEW_ORIGINAL, 1200 by 900 pixels of 3^2 rays, isovalue 1, default direction, fit to size,
 * a white background, centres and colour bar shown. */
OVOID_API void ovoid_picture_options_init(ovoid_picture_options *options);

typedef struct ovoid_image ovoid_image;

/* Takes a picture on the device: orthographic, shaded, with ambient occlusion and depth fading. The
 * view decides which of molecule and model are needed; the other may be NULL. decay is that of the
 * molecule's surface. The same input, options, device and driver give the same bytes.
 *
 * A surface that is out of sight or does not exist (the isovalue is above the field's maximum) is
 * no error: the picture shows the background, and ovoid_image_covered() is 0. */
OVOID_API ovoid_status ovoid_render(ovoid_context *context, const ovoid_molecule *molecule,
                                    double decay, const ovoid_model *model,
                                    const ovoid_picture_options *options, ovoid_image **image);

/* Makes an image of pixels (copied): 4 * width * height bytes as ovoid_image_pixels(). */
OVOID_API ovoid_status ovoid_image_create(ovoid_context *context, uint32_t width, uint32_t height,
                                          const uint8_t *pixels, ovoid_image **image);
OVOID_API void ovoid_image_destroy(ovoid_image **image);

OVOID_API uint32_t ovoid_image_width(const ovoid_image *image);
OVOID_API uint32_t ovoid_image_height(const ovoid_image *image);

/* Red, green, blue, opacity of each pixel (sRGB, not premultiplied), rows from the top. */
OVOID_API const uint8_t *ovoid_image_pixels(const ovoid_image *image);

/* Pixels in which ovoid_render() saw a surface; 0 for other images. */
OVOID_API uint64_t ovoid_image_covered(const ovoid_image *image);

/* The range of colours of OVOID_VIEW_DIFFERENCE, angstrom to either side; 0 for other views. */
OVOID_API double ovoid_image_range(const ovoid_image *image);

/* Writes a PNG file, whole or not at all. "-" is standard output. */
OVOID_API ovoid_status ovoid_image_write(ovoid_context *context, const ovoid_image *image,
                                         const char *path);

#ifdef __cplusplus
}
#endif

#endif
