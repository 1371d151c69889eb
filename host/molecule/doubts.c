/*
 * What a molecule may hold that its user hardly means: atoms without a radius, and atoms at the
 * very place of another, as where a file holds the same molecule twice.
 */
#include "molecule/molecule.h"

#include <stdlib.h>
#include <string.h>

/* A hash of the bits of x, y and z (splitmix64's mixing). Adding 0 makes -0 the same as 0. */
static uint64_t hash_of(const double *place) {
    uint64_t hash = 0;
    for (int k = 0; k < 3; k++) {
        const double value = place[k] + 0.0;
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        hash = (hash ^ bits) + 0x9e3779b97f4a7c15u;
        hash = (hash ^ hash >> 30) * 0xbf58476d1ce4e5b9u;
        hash = (hash ^ hash >> 27) * 0x94d049bb133111ebu;
        hash ^= hash >> 31;
    }
    return hash;
}

static bool same_place(const double *a, const double *b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Atoms at the place of one before them, by a table of open addressing with twice as many slots as
 * atoms; a slot holds an atom's number plus one. */
static ovoid_status count_doubled(ovoid_context *context, const ovoid_molecule *molecule,
                                  size_t *doubled, size_t *first) {
    size_t slots = 16;
    while (slots < 2 * molecule->atoms)
        slots *= 2;
    uint32_t *const table = ov_alloc(context, slots, sizeof *table, "places of atoms");
    if (!table)
        return OVOID_ERROR_MEMORY;
    *doubled = 0;
    for (size_t i = 0; i < molecule->atoms; i++) {
        const double *const place = molecule->xyzr + 4 * i;
        size_t slot = hash_of(place) & (slots - 1);
        while (table[slot] && !same_place(place, molecule->xyzr + 4 * (size_t)(table[slot] - 1)))
            slot = (slot + 1) & (slots - 1);
        if (!table[slot])
            table[slot] = (uint32_t)i + 1;
        else if ((*doubled)++ == 0)
            *first = i;
    }
    free(table);
    return OVOID_OK;
}

ovoid_status ov_molecule_doubts(ovoid_context *context, const char *name,
                                const ovoid_molecule *molecule) {
    const unsigned long long zeros = molecule->counts.zero_radius, atoms = molecule->atoms;
    size_t doubled, first = 0;
    if (zeros)
        ov_warn(context, "%s: %llu of %llu atom%s ha%s radius 0: a Gaussian of height 1 each", name,
                zeros, atoms, atoms == 1 ? "" : "s", zeros == 1 ? "s" : "ve");
    const ovoid_status status = count_doubled(context, molecule, &doubled, &first);
    if (status == OVOID_OK && doubled)
        ov_warn(context,
                "%s: %zu of %llu atoms stand%s exactly where another does, the first of them atom "
                "%zu; they count all the same",
                name, doubled, atoms, doubled == 1 ? "s" : "", first + 1);
    return status;
}
