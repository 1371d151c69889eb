#include "mixture/reduce.h"

#include "base/progress.h"

#include "mixture/component.h"
#include "mixture/start_field.h"
#include "neighbours/neighbours.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX

/* Of `inside`: what a Gaussian adds to the field below this is left out. */
#define FIELD_LEAST 2e-3

/* Bounds within which products of masses and determinants of covariances stay finite. */
#define CENTRE_MAX 1e15   /* angstrom */
#define VARIANCE_MAX 1e30 /* angstrom^2 */
#define VARIANCE_MIN 1e-30
#define MASS_MAX 1e150 /* angstrom^3, of all together */

/* Nodes: those of the start first, then one per merge, in order. */
struct ov_reduction {
    size_t count, merges;
    ov_quadric *start;
    ov_component *nodes;
    uint32_t *parent; /* of each node, or NONE */
    double *cost;     /* of each merge */
};

/* A node's cheapest pairs with older nodes (of lower index), cheapest first. Older nodes only ever
 * disappear, so what remains of the list stays the cheapest; when nothing remains although `more`
 * were near, the node looks again. Every pair belongs to its younger node alone. */
enum { KEPT = 4 };
typedef struct partners {
    double cost[KEPT];
    uint32_t older[KEPT];
    uint8_t next, count;
    bool more;
} partners;

/* The cheapest pair of a node, or one that was until its older half disappeared: never more than
 * the cheapest that remains. */
typedef struct entry {
    double cost;
    uint32_t node;
} entry;

typedef struct reducer {
    ovoid_context *context;
    const ov_reduction_options *options;
    ov_reduction *reduction;
    size_t nodes_max;
    partners *partners; /* per node */
    entry *heap;        /* at most one entry per node, cheapest first, then lowest index */
    size_t entries;
    ov_grid grid; /* of the nodes alive */
    double low[3], high[3];
    ov_start_field field;
    double discount_max;
} reducer;

/* ---- the heap ----------------------------------------------------------------------------- */

static bool comes_before(entry a, entry b) {
    return a.cost < b.cost || (a.cost == b.cost && a.node < b.node);
}

static void push(reducer *r, entry e) {
    size_t k = r->entries++;
    while (k > 0 && comes_before(e, r->heap[(k - 1) / 2])) {
        r->heap[k] = r->heap[(k - 1) / 2];
        k = (k - 1) / 2;
    }
    r->heap[k] = e;
}

/* Puts e in the place of the first entry. */
static void replace_first(reducer *r, entry e) {
    size_t k = 0;
    for (size_t child = 1; child < r->entries; child = 2 * k + 1) {
        if (child + 1 < r->entries && comes_before(r->heap[child + 1], r->heap[child]))
            ++child;
        if (!comes_before(r->heap[child], e))
            break;
        r->heap[k] = r->heap[child];
        k = child;
    }
    r->heap[k] = e;
}

static void drop_first(reducer *r) {
    const entry last = r->heap[--r->entries];
    if (r->entries > 0)
        replace_first(r, last);
}

/* ---- partners ----------------------------------------------------------------------------- */

/* What the cost of a merge is divided by where the field of the start is phi. */
static double discount(const reducer *r, double phi) {
    const double depth = phi / r->options->inside;
    return 1.0 + depth * depth;
}

/* Whether the pair would be among the cheapest. */
static bool belongs(const partners *list, double cost, uint32_t older) {
    const size_t last = KEPT - 1;
    return list->count < KEPT || cost < list->cost[last] ||
           (cost == list->cost[last] && older < list->older[last]);
}

/* Puts in a pair that belongs. */
static void insert(partners *list, double cost, uint32_t older) {
    size_t k = list->count < KEPT ? list->count++ : KEPT - 1;
    for (; k > 0 &&
           (cost < list->cost[k - 1] || (cost == list->cost[k - 1] && older < list->older[k - 1]));
         --k) {
        list->cost[k] = list->cost[k - 1];
        list->older[k] = list->older[k - 1];
    }
    list->cost[k] = cost;
    list->older[k] = older;
}

static void look(reducer *r, uint32_t node) {
    const ov_component *nodes = r->reduction->nodes;
    partners *list = r->partners + node;
    uint32_t near[2 * OV_NEAR_MAX];
    const size_t count = ov_grid_near(&r->grid, nodes[node].mean, node, near);
    list->next = list->count = 0;
    list->more = count > KEPT;
    for (size_t k = 0; k < count; ++k) {
        const ov_component *older = nodes + near[k];
        double cost = ov_component_cost(r->options->cost, older, nodes + node);
        /* The field there is looked up only if it can matter. */
        if (r->options->inside > 0.0 && belongs(list, cost / r->discount_max, near[k])) {
            double mean[3];
            ov_component_mean(older, nodes + node, mean);
            cost /= discount(r, ov_start_field_at(&r->field, mean));
        }
        if (belongs(list, cost, near[k]))
            insert(list, cost, near[k]);
    }
}

/* Steps over partners that have disappeared, looking again if need be; false if none is left. */
static bool find_partner(reducer *r, uint32_t node) {
    partners *list = r->partners + node;
    while (list->next < list->count && r->reduction->parent[list->older[list->next]] != NONE)
        ++list->next;
    if (list->next == list->count && list->more)
        look(r, node);
    return list->next < list->count;
}

static void look_and_push(reducer *r, uint32_t node) {
    const partners *list = r->partners + node;
    look(r, node);
    if (list->count > 0)
        push(r, (entry){list->cost[0], node});
}

/* ---- merging ------------------------------------------------------------------------------ */

static size_t nodes_count(const ov_reduction *reduction) {
    return reduction->count + reduction->merges;
}

/* A turn takes some microseconds, and more where Gaussians lie close. */
static ovoid_status ask(const reducer *r, uint64_t turn) {
    return turn & 0x3ff ? OVOID_OK : ov_progress_ask(r->context);
}

/* All pairs of the nodes alive within reach. */
static ovoid_status gather(reducer *r, double reach) {
    ovoid_status status = OVOID_OK;
    const ov_reduction *reduction = r->reduction;
    ov_grid_destroy(&r->grid);
    OV_TRY(ov_grid_create(r->context, r->low, r->high, reach, reduction->count - reduction->merges,
                          r->nodes_max, &r->grid));
    r->entries = 0;
    for (uint32_t k = 0; k < nodes_count(reduction); ++k)
        if (reduction->parent[k] == NONE) {
            OV_TRY(ask(r, k));
            look_and_push(r, k); /* at those before it */
            OV_TRY(ov_grid_add(r->context, &r->grid, reduction->nodes[k].mean, k));
        }
cleanup:
    return status;
}

static ovoid_status merge(reducer *r, uint32_t older, uint32_t younger, double cost) {
    ov_reduction *reduction = r->reduction;
    ov_component *nodes = reduction->nodes;
    const uint32_t merged = (uint32_t)nodes_count(reduction);
    ov_component_merge(nodes + older, nodes + younger, nodes + merged);
    reduction->cost[reduction->merges++] = cost;
    reduction->parent[older] = reduction->parent[younger] = merged;
    reduction->parent[merged] = NONE;
    ov_grid_remove(&r->grid, nodes[older].mean, older);
    ov_grid_remove(&r->grid, nodes[younger].mean, younger);
    const ovoid_status status = ov_grid_add(r->context, &r->grid, nodes[merged].mean, merged);
    if (status == OVOID_OK)
        look_and_push(r, merged);
    return status;
}

/* Merges the cheapest pair; none in *merged if no two are within reach. */
static ovoid_status merge_cheapest(reducer *r, bool *merged) {
    *merged = false;
    while (r->entries > 0) {
        const entry first = r->heap[0];
        const partners *list = r->partners + first.node;
        if (r->reduction->parent[first.node] != NONE || !find_partner(r, first.node)) {
            drop_first(r);
        } else if (list->cost[list->next] > first.cost) {
            replace_first(r, (entry){list->cost[list->next], first.node});
        } else {
            drop_first(r);
            *merged = true;
            return merge(r, list->older[list->next], first.node, first.cost);
        }
    }
    return OVOID_OK;
}

static ovoid_status reduce(reducer *r, size_t down_to) {
    ovoid_status status = OVOID_OK;
    double reach = r->options->reach;
    OV_TRY(gather(r, reach));
    while (r->reduction->count - r->reduction->merges > down_to) {
        bool merged;
        OV_TRY(ask(r, r->reduction->merges));
        OV_TRY(merge_cheapest(r, &merged));
        if (!merged) {
            reach *= 2.0;
            OV_TRY(gather(r, reach));
        }
    }
cleanup:
    return status;
}

/* ---- creation ----------------------------------------------------------------------------- */

static bool in_range(const ov_component *m) {
    static const int diagonal[3] = {0, 3, 5};
    for (int k = 0; k < 3; ++k)
        if (!(fabs(m->mean[k]) <= CENTRE_MAX) || !(m->s[diagonal[k]] <= VARIANCE_MAX) ||
            !(m->s[diagonal[k]] >= VARIANCE_MIN))
            return false;
    return true;
}

static ovoid_status check(ovoid_context *context, size_t count, size_t down_to,
                          const ov_reduction_options *options) {
    if (count == 0)
        return ov_fail(context, OVOID_ERROR_EMPTY, "no Gaussian to reduce");
    if (count > UINT32_MAX / 2)
        return ov_fail(context, OVOID_ERROR_LIMIT, "%zu Gaussians are too many to reduce", count);
    if (down_to == 0)
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "cannot reduce to no Gaussian at all");
    if (!(options->reach > 0.0 && options->reach <= CENTRE_MAX))
        return ov_fail(context, OVOID_ERROR_ARGUMENT, "reach of merges: %g angstrom, not positive",
                       options->reach);
    if (!(options->inside >= 0.0 && isfinite(options->inside)))
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "field that counts as inside: %g, not 0 or positive", options->inside);
    return OVOID_OK;
}

static ovoid_status allocate(ovoid_context *context, ov_reduction *reduction, size_t merges) {
    const size_t nodes = reduction->count + merges;
    reduction->start = ov_alloc(context, reduction->count, sizeof *reduction->start, "Gaussians");
    reduction->nodes = ov_alloc(context, nodes, sizeof *reduction->nodes, "merged Gaussians");
    reduction->parent = ov_alloc(context, nodes, sizeof *reduction->parent, "merges");
    reduction->cost = ov_alloc(context, merges, sizeof *reduction->cost, "costs of merges");
    return reduction->start && reduction->nodes && reduction->parent && reduction->cost
               ? OVOID_OK
               : OVOID_ERROR_MEMORY;
}

/* The start's nodes, and the box of their centres. */
static ovoid_status take_start(reducer *r, const ov_quadric *start) {
    ov_reduction *reduction = r->reduction;
    double mass = 0.0;
    memcpy(reduction->start, start, reduction->count * sizeof *start);
    for (size_t k = 0; k < reduction->count; ++k) {
        ov_component *node = reduction->nodes + k;
        if (!ov_component_of_quadric(start + k, node) || !in_range(node))
            return ov_fail(r->context, OVOID_ERROR_ARGUMENT,
                           "number %zu of the Gaussians to reduce is none, or out of range", k + 1);
        reduction->parent[k] = NONE;
        mass += node->mass;
        for (int axis = 0; axis < 3; ++axis) {
            r->low[axis] = k ? fmin(r->low[axis], node->mean[axis]) : node->mean[axis];
            r->high[axis] = k ? fmax(r->high[axis], node->mean[axis]) : node->mean[axis];
        }
    }
    return mass <= MASS_MAX
               ? OVOID_OK
               : ov_fail(r->context, OVOID_ERROR_NUMERIC,
                         "amplitudes are too large to be reduced: total mass %g", mass);
}

ovoid_status ov_reduction_create(ovoid_context *context, const ov_quadric *start, size_t count,
                                 size_t down_to, const ov_reduction_options *options,
                                 ov_reduction **reduction) {
    ovoid_status status = OVOID_OK;
    reducer r = {.context = context, .options = options};
    *reduction = NULL;
    OV_TRY(check(context, count, down_to, options));
    const size_t merges = count > down_to ? count - down_to : 0;
    r.reduction = ov_alloc(context, 1, sizeof *r.reduction, "a reduction");
    r.partners = ov_alloc(context, count + merges, sizeof *r.partners, "pairs to merge");
    r.heap = ov_alloc(context, count + merges, sizeof *r.heap, "pairs to merge");
    if (!r.reduction || !r.partners || !r.heap) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    r.reduction->count = count;
    r.nodes_max = count + merges;
    OV_TRY(allocate(context, r.reduction, merges));
    OV_TRY(take_start(&r, start));
    if (merges > 0 && options->inside > 0.0) {
        OV_TRY(ov_start_field_create(context, start, r.reduction->nodes, count,
                                     FIELD_LEAST * options->inside, &r.field));
        r.discount_max = discount(&r, r.field.largest) * (1.0 + 1e-9); /* against rounding */
    }
    if (merges > 0)
        OV_TRY(reduce(&r, down_to));
    *reduction = r.reduction;
    r.reduction = NULL;
cleanup:
    ov_reduction_destroy(&r.reduction);
    free(r.partners);
    free(r.heap);
    ov_grid_destroy(&r.grid);
    ov_start_field_destroy(&r.field);
    return status;
}

void ov_reduction_destroy(ov_reduction **reduction) {
    if (!*reduction)
        return;
    free((*reduction)->start);
    free((*reduction)->nodes);
    free((*reduction)->parent);
    free((*reduction)->cost);
    free(*reduction);
    *reduction = NULL;
}

/* ---- reading ------------------------------------------------------------------------------ */

size_t ov_reduction_most(const ov_reduction *reduction) {
    return reduction->count;
}

size_t ov_reduction_least(const ov_reduction *reduction) {
    return reduction->count - reduction->merges;
}

ovoid_status ov_reduction_cut(ovoid_context *context, const ov_reduction *reduction, size_t count,
                              ov_quadric *quadrics, uint32_t *owner) {
    const size_t most = ov_reduction_most(reduction), least = ov_reduction_least(reduction);
    if (count < least || count > most)
        return ov_fail(context, OVOID_ERROR_ARGUMENT,
                       "a reduction from %zu to %zu Gaussians has no state of %zu", most, least,
                       count);
    const size_t nodes = most + (most - count);
    uint32_t *place = ov_alloc(context, nodes, sizeof *place, "a cut");
    if (!place)
        return OVOID_ERROR_MEMORY;
    uint32_t next = (uint32_t)count; /* parents have higher indices than their children */
    for (size_t k = nodes; k-- > 0;) {
        const uint32_t parent = reduction->parent[k];
        if (parent < nodes) {
            place[k] = place[parent];
            continue;
        }
        place[k] = --next;
        if (k < most)
            quadrics[next] = reduction->start[k];
        else
            ov_quadric_of_component(reduction->nodes + k, quadrics + next);
    }
    if (owner)
        memcpy(owner, place, most * sizeof *owner);
    free(place);
    return OVOID_OK;
}

double ov_reduction_cost(const ov_reduction *reduction, size_t count) {
    if (count >= reduction->count || count < ov_reduction_least(reduction))
        return 0.0;
    return reduction->cost[reduction->count - count - 1];
}
