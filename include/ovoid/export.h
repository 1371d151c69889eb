/*
 * Models, fields and surfaces for other programs, and as a page for a browser.
 */
#ifndef OVOID_EXPORT_H
#define OVOID_EXPORT_H

#include "ovoid/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

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
    OVOID_EXPORT_DX,   /* .dx: OpenDX text as APBS writes it */
    /* and of a scene, a molecule and its models: */
    OVOID_EXPORT_HTML, /* .html, .htm: a page to turn them in, one file without network access */
    OVOID_EXPORT_IHM,  /* .cif, .mmcif: IHMCIF, the category ihm_gaussian_obj_site */
    /* and more ellipsoids, of models: */
    OVOID_EXPORT_XYZ,    /* .xyz, .extxyz: extended XYZ with semi-axes and orientations, OVITO's */
    OVOID_EXPORT_LAMMPS, /* .lmp, .data: LAMMPS data of atom style ellipsoid */
    OVOID_EXPORT_ANISOU, /* .pdb, .ent: pseudo-atoms with ANISOU */
    OVOID_EXPORT_SPLAT,  /* .gltf: glTF with KHR_gaussian_splatting */
    /* and surfaces of scenes, the molecule's or without one the first model's: */
    OVOID_EXPORT_PLY, /* .ply: binary, with colours */
    OVOID_EXPORT_GLB, /* .glb: binary glTF, with colours */
    OVOID_EXPORT_3MF, /* .3mf: for printers, with colours; 1 angstrom is 1 millimetre */
    OVOID_EXPORT_MSMS /* .vert, and beside it .face: as MSMS writes them, with the nearest atom */
} ovoid_export_format;

/* What the colours of a surface stand for. */
typedef enum ovoid_colouring {
    OVOID_COLOUR_AUTO = 0, /* the difference where there are a molecule and a model, else nothing */
    OVOID_COLOUR_PLAIN,    /* nothing */
    OVOID_COLOUR_DIFFERENCE, /* how far outside (red) or inside (blue) the model's surface lies */
    OVOID_COLOUR_CHAIN,      /* the chain of the nearest atom, that whose Gaussian is the largest */
    OVOID_COLOUR_RESIDUE,    /* its residue */
    OVOID_COLOUR_ELLIPSOID   /* the ellipsoid that it counts for */
} ovoid_colouring;

typedef struct ovoid_export_options {
    size_t size;
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
    double range;         /* of a difference's colours, angstrom to either side; 0: what 99 % of
                             the surfaces stay within, rounded up */
    double max_triangles; /* of a surface in a page: the spacing becomes larger where it would have
                             more */
    ovoid_colouring colouring; /* of a surface */
} ovoid_export_options;

#define OVOID_DEFAULT_MAP_GIGABYTES 1.0
#define OVOID_DEFAULT_MAX_TRIANGLES 5e5

/* Format by extension, isovalue 0, spacing OVOID_DEFAULT_MESH_SPACING (of maps and of surfaces), an
 * opaque blue, maps of up to OVOID_DEFAULT_MAP_GIGABYTES, range 0, OVOID_DEFAULT_MAX_TRIANGLES;
 * size is sizeof *options. */
OVOID_API void ovoid_export_options_init(ovoid_export_options *options, size_t size);

/* Writes a file for another program, whole or not at all; "-" is standard output and needs a
 * format. options may be NULL. OVOID_ERROR_ARGUMENT where the path's extension stands for another
 * format than the options name, and for ellipsoids of a molecule, which has none. A map is computed
 * on the device and written piece by piece: memory does not grow with it; OVOID_ERROR_LIMIT, before
 * anything is computed, where it would take more than max_gigabytes. */
OVOID_API ovoid_status ovoid_field_export(ovoid_context *context, ovoid_field *field,
                                          const char *path, const ovoid_export_options *options);

/* What a scene shows: a molecule, models of it, or both. Nothing is copied, and all of it must live
 * as long as the call that it is given to. */
typedef struct ovoid_scene {
    size_t size;
    const ovoid_molecule *molecule; /* NULL: none */
    const ovoid_model *const
        *models; /* levels of detail, the finest first; NULL with a count of 0 */
    size_t model_count;
    const char *title; /* UTF-8; NULL: the name of the file that is written */
    double decay;      /* of the molecule's field, angstrom^-2; 0: the first model's, or
                          OVOID_DEFAULT_DECAY without one */
    double isovalue;   /* of the molecule's surface; 0: likewise */
} ovoid_scene;

/* Nothing in it; size is sizeof *scene. */
OVOID_API void ovoid_scene_init(ovoid_scene *scene, size_t size);

/* Writes a scene as a file of any format, whole or not at all; "-" is standard output and needs a
 * format. options may be NULL. Surfaces are meshed, and their distances measured, on the device.
 * Formats of ellipsoids take the first model, and maps the field of the first model or, without
 * one, of the molecule, as ovoid_field_export() does. Which atoms an ellipsoid stands for is what
 * ovoid_model_owner() says, where it has as many entries as the molecule atoms; else an atom counts
 * for the ellipsoid with the largest value at its centre. */
OVOID_API ovoid_status ovoid_scene_export(ovoid_context *context, const ovoid_scene *scene,
                                          const char *path, const ovoid_export_options *options);

/* Name of a format as ovoid_export_format_find() takes it, "bild" for example; NULL for others. */
OVOID_API const char *ovoid_export_format_name(ovoid_export_format format);

/* The format of a name ("ccp4") or an extension ("mrc", with its dot or without), in any case of
 * letters; AUTO when there is none. */
OVOID_API ovoid_export_format ovoid_export_format_find(const char *name);

#ifdef __cplusplus
}
#endif

#endif
