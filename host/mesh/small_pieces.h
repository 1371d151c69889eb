/*
 * The small connected pieces of a mesh, found by the box about them.
 */
#ifndef OV_SMALL_PIECES_H
#define OV_SMALL_PIECES_H

#include "base/store.h"

typedef struct ov_small_piece {
    double low[3], high[3]; /* angstrom */
    uint32_t root;          /* its first vertex */
} ov_small_piece;

typedef struct ov_small_pieces {
    ov_store *store; /* of the arrays; the caller's */
    size_t count;
    ov_small_piece *piece; /* by low[0] */
    uint32_t *root;        /* of all vertices */
} ov_small_pieces;

/* Pieces no longer than `most` along any axis, of a mesh whose vertices lie where `at` says. store
 * may be NULL. The pieces may be destroyed also after a failure. */
ovoid_status ov_small_pieces_find(ovoid_context *context, ov_store *store,
                                  void (*at)(size_t vertex, double xyz[3], const void *user),
                                  const void *user, size_t vertices, const uint32_t *corners,
                                  size_t triangles, double most, ov_small_pieces *pieces);
void ov_small_pieces_destroy(ov_small_pieces *pieces);

/* Calls back for each piece within the box; returns how many there are. */
size_t ov_small_pieces_within(const ov_small_pieces *pieces, const double low[3],
                              const double high[3],
                              void (*visit)(const ov_small_piece *piece, void *user), void *user);

#endif
