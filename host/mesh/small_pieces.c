#include "mesh/small_pieces.h"
#include "mesh/union.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int by_low(const void *a, const void *b) {
    const ov_small_piece *const p = a, *const q = b;
    if (p->low[0] != q->low[0])
        return p->low[0] < q->low[0] ? -1 : 1;
    return (p->root > q->root) - (p->root < q->root);
}

/* Boxes of all pieces, at the place of their first vertices. */
static void box_pieces(void (*at)(size_t vertex, double xyz[3], const void *user), const void *user,
                       size_t vertices, const uint32_t *number, ov_small_pieces *pieces) {
    const uint32_t *const root = pieces->root;
    for (size_t v = 0; v < vertices; ++v) {
        ov_small_piece *const p = &pieces->piece[number[root[v]]];
        double xyz[3];
        ov_store_turn(pieces->store, v);
        at(v, xyz, user);
        for (int axis = 0; axis < 3; ++axis) {
            p->low[axis] = root[v] == v ? xyz[axis] : fmin(p->low[axis], xyz[axis]);
            p->high[axis] = root[v] == v ? xyz[axis] : fmax(p->high[axis], xyz[axis]);
        }
    }
}

static void keep_small(ov_small_pieces *pieces, double most) {
    size_t kept = 0;
    for (size_t k = 0; k < pieces->count; ++k) {
        const ov_small_piece *const p = &pieces->piece[k];
        bool small = true;
        for (int axis = 0; axis < 3; ++axis)
            small &= p->high[axis] - p->low[axis] <= most;
        if (small)
            pieces->piece[kept++] = *p;
    }
    pieces->count = kept;
}

/* Fills in the first vertices of all pieces, and numbers the pieces by these. */
static void find_roots(size_t vertices, const uint32_t *corners, size_t triangles, uint32_t *number,
                       ov_small_pieces *pieces) {
    uint32_t *const root = pieces->root;
    for (size_t v = 0; v < vertices; ++v) {
        ov_store_turn(pieces->store, v);
        root[v] = (uint32_t)v;
    }
    for (size_t t = 0; t < triangles; ++t) {
        ov_store_turn(pieces->store, t);
        ov_unite(root, corners[3 * t], corners[3 * t + 1]);
        ov_unite(root, corners[3 * t], corners[3 * t + 2]);
    }
    for (size_t v = 0; v < vertices; ++v) {
        ov_store_turn(pieces->store, v);
        root[v] = ov_union_first(root, (uint32_t)v);
        if (root[v] == v)
            number[v] = (uint32_t)pieces->count++;
    }
}

ovoid_status ov_small_pieces_find(ovoid_context *context, ov_store *store,
                                  void (*at)(size_t vertex, double xyz[3], const void *user),
                                  const void *user, size_t vertices, const uint32_t *corners,
                                  size_t triangles, double most, ov_small_pieces *pieces) {
    static const char what[] = "pieces of a mesh";
    ovoid_status status = OVOID_OK;
    uint32_t *number = NULL;
    *pieces = (ov_small_pieces){.store = store};
    OV_TRY(ov_store_alloc(context, store, &number, vertices, sizeof *number, what));
    OV_TRY(ov_store_alloc(context, store, &pieces->root, vertices, sizeof *pieces->root, what));
    find_roots(vertices, corners, triangles, number, pieces);
    OV_TRY(
        ov_store_alloc(context, store, &pieces->piece, pieces->count, sizeof *pieces->piece, what));
    for (size_t v = 0; v < vertices; ++v) {
        ov_store_turn(store, v);
        pieces->piece[number[pieces->root[v]]].root = pieces->root[v];
    }
    box_pieces(at, user, vertices, number, pieces);
    keep_small(pieces, most);
    if (pieces->count > 0)
        qsort(pieces->piece, pieces->count, sizeof *pieces->piece, by_low);
cleanup:
    ov_store_free(store, number);
    return status;
}

void ov_small_pieces_destroy(ov_small_pieces *pieces) {
    ov_store_free(pieces->store, pieces->piece);
    ov_store_free(pieces->store, pieces->root);
    memset(pieces, 0, sizeof *pieces);
}

/* Position of the first piece whose low[0] is at least x. */
static size_t first_from(const ov_small_pieces *pieces, double x) {
    size_t low = 0, high = pieces->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (pieces->piece[middle].low[0] < x)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

size_t ov_small_pieces_within(const ov_small_pieces *pieces, const double low[3],
                              const double high[3],
                              void (*visit)(const ov_small_piece *piece, void *user), void *user) {
    size_t found = 0;
    for (size_t k = first_from(pieces, low[0]);
         k < pieces->count && pieces->piece[k].low[0] <= high[0]; ++k) {
        const ov_small_piece *const p = &pieces->piece[k];
        bool within = true;
        for (int axis = 0; axis < 3; ++axis)
            within &= p->low[axis] >= low[axis] && p->high[axis] <= high[axis];
        if (!within)
            continue;
        visit(p, user);
        ++found;
    }
    return found;
}
