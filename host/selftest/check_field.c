/* Layout, lists, and the sums over points and over terms. */
#include "selftest/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of FLT_EPSILON * scale; the project's tests hold PoCL's device to 3. */
#define TOLERANCE 4.0
#define NO_CUTOFF 1e-37

/* ---- layout ------------------------------------------------------------------------------- */

size_t ov_layout_of_host(uint32_t wanted[OV_LAYOUT_MOST]) {
    const uint32_t layout[] = {
        sizeof(ov_term),
        offsetof(ov_term, log2_amplitude),
        offsetof(ov_term, x),
        offsetof(ov_term, y),
        offsetof(ov_term, z),
        offsetof(ov_term, xx),
        offsetof(ov_term, xy),
        offsetof(ov_term, xz),
        offsetof(ov_term, yy),
        offsetof(ov_term, yz),
        offsetof(ov_term, zz),
        offsetof(ov_term, rest_x),
        offsetof(ov_term, rest_y),
        offsetof(ov_term, rest_z),
        offsetof(ov_term, reach),
        offsetof(ov_term, skin),
        sizeof(ov_tree),
        offsetof(ov_tree, levels),
        offsetof(ov_tree, boxes),
        offsetof(ov_tree, groups),
        offsetof(ov_tree, padding),
        OV_PACK,
        OV_GROUP,
        OV_LEVELS,
        OV_MONOMIALS,
    };
    memcpy(wanted, layout, sizeof layout);
    return sizeof layout / sizeof *layout;
}

ovoid_status ov_check_layout(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ov_kernel kernel = {0};
    ov_buffer buffer = {0};
    uint32_t wanted[OV_LAYOUT_MOST], got[OV_LAYOUT_MOST];
    const size_t count = ov_layout_of_host(wanted);
    memset(got, 0xff, sizeof got);
    OV_TRY(ov_kernel_create(c->context, "layout", "layout", &kernel));
    OV_TRY(ov_buffer_put(c->context, &buffer, got, sizeof got, "a layout"));
    OV_TRY(OV_LAUNCH(c->context, &kernel, 1, 0, OV_ARG(buffer.memory)));
    OV_TRY(ov_buffer_read(c->context, &buffer, 0, got, sizeof got));
    for (size_t k = 0; k < count; ++k)
        ov_expect(c, got[k] == wanted[k], "entry %zu of the layout is %u, not %u", k,
                  (unsigned)got[k], (unsigned)wanted[k]);
    ov_expect(c, got[count] == UINT32_MAX, "the layout has more entries than expected");
cleanup:
    ov_kernel_destroy(&kernel);
    ov_buffer_destroy(&buffer);
    return status;
}

/* ---- the tree over packs ------------------------------------------------------------------ */

/* What the device makes of boxes is what the host makes, bit by bit: three levels, the last group
 * of each not full. */
ovoid_status ov_check_tree(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    const size_t count = ov_check_size(c, 70003, 307);
    ov_random random = {23};
    ov_tree host = {0}, device = {0};
    ov_buffer leaves = {0}, boxes = {0};
    size_t floats = 0;
    float *wanted = NULL, *got = NULL;
    float *const leaf = ov_random_floats(context, &random, 6 * count, -9.0, 9.0);
    if (!leaf)
        return OVOID_ERROR_MEMORY;
    for (size_t k = 0; k < 6 * count; ++k)
        if (k % 6 >= 3)
            leaf[k] = leaf[k - 3] + fabsf(leaf[k]);
    OV_TRY(ov_tree_build(context, leaf, count, &host, &wanted, &floats));
    OV_TRY(ov_put_floats(context, &leaves, leaf, 6 * count));
    OV_TRY(ov_tree_grow(context, &leaves, count, &device, &boxes));
    OV_TRY(ov_read_words(context, &boxes, floats, &got));
    ov_expect_same(c, got, wanted, floats, "tree: side of a box");
cleanup:
    free(leaf);
    free(wanted);
    free(got);
    ov_buffer_destroy(&leaves);
    ov_buffer_destroy(&boxes);
    return status;
}

/* ---- lists -------------------------------------------------------------------------------- */

typedef struct pairs {
    uint32_t *term_start, *term_item, *pack_start, *pack_item;
} pairs;

/* Starts run from 0 to the number of items, items ascend without repeats and within range. */
static bool is_list(ov_checking *c, const uint32_t *start, const uint32_t *item, size_t count,
                    size_t items, size_t range, const char *what) {
    if (!ov_expect(c, start[0] == 0 && start[count] == items,
                   "the lists of %s begin at %u and end at %u, not at 0 and %zu", what,
                   (unsigned)start[0], (unsigned)start[count], items))
        return false;
    for (size_t i = 0; i < count; ++i)
        if (!ov_expect(c, start[i] <= start[i + 1] && start[i + 1] <= items,
                       "the list of %s %zu ends before it begins", what, i))
            return false;
    for (size_t i = 0; i < count; ++i)
        for (uint32_t k = start[i]; k < start[i + 1]; ++k)
            if (!ov_expect(c, item[k] < range && (k == start[i] || item[k - 1] < item[k]),
                           "the list of %s %zu is not in order, or holds %u of %zu", what, i,
                           (unsigned)item[k], range))
                return false;
    return true;
}

bool ov_list_holds(const uint32_t *start, const uint32_t *item, size_t list, uint32_t value) {
    uint32_t low = start[list], high = start[list + 1];
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (item[middle] < value)
            low = middle + 1;
        else
            high = middle;
    }
    return low < start[list + 1] && item[low] == value;
}

static void box_of_pack(const ov_setting *s, size_t pack, double box[6]) {
    for (size_t axis = 0; axis < 3; ++axis) {
        box[axis] = INFINITY;
        box[axis + 3] = -INFINITY;
        for (size_t k = pack * OV_PACK; k < (pack + 1) * OV_PACK; ++k) {
            box[axis] = fmin(box[axis], s->xyz[3 * k + axis]);
            box[axis + 3] = fmax(box[axis + 3], s->xyz[3 * k + axis]);
        }
    }
}

/* Both lists have the same pairs; of each `stride`-th term those that reach a pack, and of the
 * others none by much. */
static void expect_pairs(ov_checking *c, const ov_setting *s, const pairs *p, double cutoff,
                         size_t stride) {
    for (size_t i = 0; i < s->count; ++i)
        for (uint32_t k = p->term_start[i]; k < p->term_start[i + 1]; ++k)
            if (!ov_expect(
                    c, ov_list_holds(p->pack_start, p->pack_item, p->term_item[k], (uint32_t)i),
                    "term %zu has pack %u, which does not have it", i, (unsigned)p->term_item[k]))
                return;
    for (size_t i = 0; i < s->count; i += stride) {
        const double reach = log(s->quadrics[i].amplitude / cutoff);
        for (size_t pack = 0; pack < s->points.packs; ++pack) {
            double box[6];
            box_of_pack(s, pack, box);
            const double least = ov_twin_least_exponent(&s->quadrics[i], box);
            const bool listed = ov_list_holds(p->term_start, p->term_item, i, (uint32_t)pack);
            ov_expect(c, listed || least > reach - 1e-3,
                      "term %zu reaches pack %zu (%.4g of %.4g) and is not in its list", i, pack,
                      least, reach);
            ov_expect(c, !listed || least < 1.25 * reach + 1.0,
                      "term %zu is far from pack %zu (%.4g of %.4g) and in its list", i, pack,
                      least, reach);
        }
    }
}

static ovoid_status check_pairs(ov_checking *c, const ov_setting *s, double cutoff) {
    ovoid_status status = OVOID_OK;
    const ov_lists *const l = &s->lists;
    pairs p = {0};
    OV_TRY(ov_read_words(c->context, &l->term_start, l->terms + 1, &p.term_start));
    OV_TRY(ov_read_words(c->context, &l->term_item, l->items, &p.term_item));
    OV_TRY(ov_read_words(c->context, &l->pack_start, l->packs + 1, &p.pack_start));
    OV_TRY(ov_read_words(c->context, &l->pack_item, l->items, &p.pack_item));
    if (is_list(c, p.term_start, p.term_item, l->terms, l->items, l->packs, "term") &&
        is_list(c, p.pack_start, p.pack_item, l->packs, l->items, l->terms, "pack"))
        expect_pairs(c, s, &p, cutoff, ov_check_size(c, 20, 1));
cleanup:
    free(p.term_start);
    free(p.term_item);
    free(p.pack_start);
    free(p.pack_item);
    return status;
}

/* Once waiting for the counts, and once more in the memory that there is then. */
static ovoid_status check_lists(ov_checking *c, size_t terms, size_t points) {
    ovoid_status status = OVOID_OK;
    const double cutoff = 1e-3;
    ov_setting s = {0};
    bool whole = true;
    OV_TRY(ov_setting_create(c->context, 1, terms, points, 12.0, 18.0, cutoff, &s));
    OV_TRY(check_pairs(c, &s, cutoff));
    OV_TRY(ov_lists_begin(c->context, &s.lists, &s.points, &s.terms, 0.0));
    OV_TRY(ov_lists_end(c->context, &s.lists, &whole));
    ov_expect_near(c, whole, 1.0, 0.0, "lists: whole", 0);
    if (whole)
        OV_TRY(check_pairs(c, &s, cutoff));
cleanup:
    ov_later_end(c->context, &s.lists.later);
    ov_setting_destroy(&s);
    return status;
}

ovoid_status ov_check_lists(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    OV_TRY(check_lists(c, 70, 611));
    if (ov_check_size(c, 1, 0))
        OV_TRY(check_lists(c, 2000, 20011));
cleanup:
    return status;
}

/* ---- fields ------------------------------------------------------------------------------- */

static ovoid_status make_setting(ov_checking *c, uint64_t seed, ov_setting *s) {
    return ov_setting_create(c->context, seed, ov_check_size(c, 100, 18),
                             ov_check_size(c, 3003, 331), 4.0, 6.0, NO_CUTOFF, s);
}

static ovoid_status check_values(ov_checking *c, ov_setting *s) {
    ovoid_status status = OVOID_OK;
    ov_buffer value = {0}, gradient = {0};
    float *got = NULL, *again = NULL, *slope = NULL;
    OV_TRY(ov_field(c->context, &s->operations, &s->points, &s->terms, &s->lists, &value));
    OV_TRY(ov_read_words(c->context, &value, s->places, &got));
    OV_TRY(ov_field_gradient(c->context, &s->operations, &s->points, &s->terms, &s->lists, &value,
                             &gradient));
    OV_TRY(ov_read_words(c->context, &value, s->places, &again));
    OV_TRY(ov_read_words(c->context, &gradient, 3 * s->places, &slope));
    for (size_t k = 0; k < s->places; ++k) {
        const ov_twin_sum wanted = ov_twin_field(s->quadrics, s->count, s->xyz + 3 * k);
        ov_twin_sum slopes[3];
        ov_twin_gradient(s->quadrics, s->count, s->xyz + 3 * k, slopes);
        ov_expect_close(c, got[k], wanted, TOLERANCE, "field: value", k);
        ov_expect_close(c, again[k], wanted, TOLERANCE, "field_gradient: value", k);
        for (size_t axis = 0; axis < 3; ++axis)
            ov_expect_close(c, slope[(3 * (k / OV_PACK) + axis) * OV_PACK + k % OV_PACK],
                            slopes[axis], TOLERANCE, "field_gradient: component", 3 * k + axis);
    }
cleanup:
    free(got);
    free(again);
    free(slope);
    ov_buffer_destroy(&value);
    ov_buffer_destroy(&gradient);
    return status;
}

static ovoid_status check_polynomial(ov_checking *c, ov_setting *s) {
    ovoid_status status = OVOID_OK;
    ov_random random = {3};
    ov_buffer value = {0}, polynomial = {0}, weight = {0};
    float *got = NULL, *w = ov_setting_floats(c->context, s, &random, 0.2, 2.0);
    float *const p = ov_random_floats(c->context, &random, s->count * OV_MONOMIALS, -1.0, 1.0);
    if (!w || !p) {
        status = OVOID_ERROR_MEMORY;
        goto cleanup;
    }
    OV_TRY(ov_put_floats(c->context, &weight, w, s->places));
    OV_TRY(ov_put_floats(c->context, &polynomial, p, s->count * OV_MONOMIALS));
    OV_TRY(ov_field_polynomial(c->context, &s->operations, &s->points, &s->terms, &s->lists,
                               &polynomial, &weight, &value));
    OV_TRY(ov_read_words(c->context, &value, s->places, &got));
    for (size_t k = 0; k < s->places; ++k) {
        ov_twin_sum wanted = ov_twin_field_polynomial(s->quadrics, p, s->count, s->xyz + 3 * k);
        wanted.value *= w[k];
        wanted.scale *= w[k];
        ov_expect_close(c, got[k], wanted, TOLERANCE, "field_polynomial: value", k);
    }
cleanup:
    free(got);
    free(w);
    free(p);
    ov_buffer_destroy(&value);
    ov_buffer_destroy(&polynomial);
    ov_buffer_destroy(&weight);
    return status;
}

ovoid_status ov_check_field(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ov_setting s = {0};
    OV_TRY(make_setting(c, 2, &s));
    OV_TRY(check_values(c, &s));
    OV_TRY(check_polynomial(c, &s));
cleanup:
    ov_setting_destroy(&s);
    return status;
}

/* ---- moments ------------------------------------------------------------------------------ */

static void widen(const float *from, double *to, size_t count) {
    for (size_t k = 0; k < count; ++k)
        to[k] = from[k];
}

static void expect_moments(ov_checking *c, const ov_setting *s, const float *moments,
                           const float *gram, const double *u, const double *w) {
    for (size_t i = 0; i < s->count; ++i) {
        ov_twin_sum wanted[OV_MONOMIALS], squares[OV_GRAM];
        ov_twin_moments(&s->quadrics[i], s->xyz, u, s->places, wanted);
        ov_twin_gram(&s->quadrics[i], s->xyz, w, s->places, squares);
        for (size_t m = i * OV_MONOMIALS; m < (i + 1) * OV_MONOMIALS; ++m)
            ov_expect_close(c, (double)moments[2 * m] + (double)moments[2 * m + 1],
                            wanted[m % OV_MONOMIALS], TOLERANCE, "moments: sum", m);
        for (size_t m = i * OV_GRAM; m < (i + 1) * OV_GRAM; ++m)
            ov_expect_close(c, gram[m], squares[m % OV_GRAM], TOLERANCE, "gram: sum", m);
    }
}

ovoid_status ov_check_moments(ov_checking *c) {
    ovoid_status status = OVOID_OK;
    ovoid_context *const context = c->context;
    ov_random random = {5};
    ov_setting s = {0};
    ov_buffer u = {0}, w = {0}, moments = {0}, gram = {0};
    float *of_u = NULL, *of_w = NULL, *sums = NULL, *squares = NULL;
    double *wide = NULL;
    OV_TRY(make_setting(c, 4, &s));
    status = OVOID_ERROR_MEMORY;
    of_u = ov_setting_floats(context, &s, &random, -1.0, 1.0);
    of_w = ov_setting_floats(context, &s, &random, 0.1, 2.0);
    wide = ov_alloc(context, 2 * s.places, sizeof *wide, "weights of a check");
    if (!of_u || !of_w || !wide)
        goto cleanup;
    OV_TRY(ov_put_floats(context, &u, of_u, s.places));
    OV_TRY(ov_put_floats(context, &w, of_w, s.places));
    OV_TRY(ov_moments(context, &s.operations, &s.points, &s.terms, &s.lists, &u, &moments));
    OV_TRY(ov_gram(context, &s.operations, &s.points, &s.terms, &s.lists, &w, &gram));
    OV_TRY(ov_read_words(context, &moments, 2 * OV_MONOMIALS * s.count, &sums));
    OV_TRY(ov_read_words(context, &gram, OV_GRAM * s.count, &squares));
    widen(of_u, wide, s.places);
    widen(of_w, wide + s.places, s.places);
    expect_moments(c, &s, sums, squares, wide, wide + s.places);
cleanup:
    free(of_u);
    free(of_w);
    free(sums);
    free(squares);
    free(wide);
    ov_buffer_destroy(&u);
    ov_buffer_destroy(&w);
    ov_buffer_destroy(&moments);
    ov_buffer_destroy(&gram);
    ov_setting_destroy(&s);
    return status;
}
