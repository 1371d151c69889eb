/*
 * Specks: pieces of a surface that are small to the lattice, such as that of a small ion far from
 * everything else. The lattice may have no point in them, or too few for their area. They are
 * looked for from the terms that reach the isovalue by themselves, and meshed on finer lattices of
 * their own.
 */
#ifndef OV_SPECKS_H
#define OV_SPECKS_H

#include "base/store.h"
#include "mesh/pieces.h"
#include "ovoid/ovoid.h"

/* A lattice is halved so often for a speck, at most: what is smaller than about a thousandth of the
 * spacing is only counted. */
#define OV_SPECK_HALVINGS 10

/* Closed meshes, appended one after another. */
typedef struct ov_specks {
    ov_store *store; /* of the arrays; the caller's */
    double *xyz;     /* 3 * vertices, angstrom */
    float *normals;
    uint8_t *edge; /* as in ovoid_mesh */
    size_t vertices;
    uint32_t *corners; /* 3 * triangles, counted from the first vertex here */
    size_t triangles;
    size_t missed; /* terms whose piece of the surface is too small or too thin to be meshed */
    size_t xyz_room, normals_room, edge_room, corners_room;
} ov_specks;

/* The mesh of the lattice that specks are added to: arrays of the caller. */
typedef struct ov_lattice_mesh {
    void (*at)(size_t vertex, double xyz[3], const void *user);
    const void *user;
    const uint32_t *corners;
    size_t vertices, triangles;
    bool *replaced; /* vertices; becomes true for those of pieces that are specks: all their
                       vertices and triangles are to go */
} ov_lattice_mesh;

/* Finds the specks of the lattice of multiples of options->spacing. cutoff: a term counts where it
 * is at least this. The specks may be destroyed also after a failure. */
ovoid_status ov_specks_find(ovoid_context *context, const ov_body *bodies, size_t count,
                            const ovoid_mesh_options *options, double cutoff,
                            const ov_lattice_mesh *lattice, ov_specks *specks);
void ov_specks_destroy(ov_specks *specks);

#endif
