/*
 * Disjoint sets of vertices, to tell what hangs together: parent[v] leads from each vertex towards
 * the first of its set, which leads to itself. At first parent[v] = v.
 */
#ifndef OV_UNION_H
#define OV_UNION_H

#include <stdint.h>

/* The smallest of a vertex's set; the way there is shortened. */
static inline uint32_t ov_union_first(uint32_t *parent, uint32_t vertex) {
    while (parent[vertex] != vertex) {
        parent[vertex] = parent[parent[vertex]];
        vertex = parent[vertex];
    }
    return vertex;
}

static inline void ov_unite(uint32_t *parent, uint32_t a, uint32_t b) {
    a = ov_union_first(parent, a);
    b = ov_union_first(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

#endif
